//! Stiffness of the bonds of a ply and of an interface by their direction, from the discrete moments of a complete family.
//!
//! ```text
//! Q_abcd - a_abcd = 1/2 sum_j w |xi| C(psi_j) n_a n_b n_c n_d        ply: C = k0 + k2 cos 2 psi + k4 cos 4 psi + F [along fibres]
//! G_ab            = 1/2 sum_j w |xi| g(psi_j) n_a n_b                interface: g = g0 + g2 cos 2 psi
//! ```
//!
//! with `a` the part of the dilatation, psi from the fibres, and sines where the lattice is not symmetric about the fibres.
//! The moments are those of the lattice, so that the stiffness is exact to rounding whatever the horizon.

use crate::plies::{CompleteFamily, is_along, relative, solve, waves};

/// Plane stiffness of a ply along and across its fibres, Pa.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlyStiffness {
    /// Young's moduli along and across the fibres.
    pub moduli: [f64; 2],
    /// Poisson's ratio of the strain across by a stress along the fibres.
    pub poissons_ratio: f64,
    /// Shear modulus in the plane.
    pub shear: f64,
}

/// Q11, Q22, Q12 and Q66 of plane stress, Pa.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Reduced {
    pub(super) along: f64,
    pub(super) across: f64,
    pub(super) coupling: f64,
    pub(super) shear: f64,
}

impl PlyStiffness {
    /// Whether every strain takes energy: `nu12² < E1 / E2`.
    pub(super) fn is_positive(&self) -> bool {
        let [along, across] = self.moduli;
        self.poissons_ratio * self.poissons_ratio * across < along
    }

    pub(super) fn reduced(&self) -> Reduced {
        let [along, across] = self.moduli;
        let nu = self.poissons_ratio;
        let whole = 1.0 - nu * nu * across / along;
        Reduced {
            along: along / whole,
            across: across / whole,
            coupling: nu * across / whole,
            shear: self.shear,
        }
    }
}

impl Reduced {
    /// The part of the dilatation, `a` of \[Gao2020\], chapter 4: bonds have equal Q12 and Q66.
    pub(super) fn dilatation(&self) -> f64 {
        0.5 * (self.coupling - self.shear)
    }

    /// What the bonds carry, Q11 - 2 a, Q22 - 2 a and Q66, Pa: their stiffness is linear in it.
    pub(super) fn of_bonds(&self) -> [f64; PARTS] {
        let of_dilatation = 2.0 * self.dilatation();
        [
            self.along - of_dilatation,
            self.across - of_dilatation,
            self.shear,
        ]
    }
}

/// Numbers on which the stiffness of the bonds of a ply depends: [`Reduced::of_bonds`].
pub(super) const PARTS: usize = 3;

/// Stiffness of the bonds of a ply by their direction, over the parts of [`Reduced::of_bonds`].
#[derive(Clone, Copy, Debug)]
pub struct PlyBonds {
    /// Unit vector along the fibres.
    pub(super) fibre: [f64; 2],
    /// By part, factors of 1, cos 2 psi, sin 2 psi, cos 4 psi, sin 4 psi.
    matrix: [[f64; 5]; PARTS],
    /// By part, what is added to bonds along the fibres.
    increment: [f64; PARTS],
    /// Whether bonds along the fibres have the increment.
    has_fibres: bool,
    /// The parts, where they are the same at all points at any temperature.
    pub(super) uniform: [f64; PARTS],
}

/// No stiffness of bonds gives that of the ply.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum NoBonds {
    /// The horizon holds bonds in too few directions.
    TooFew,
    /// A bond at this angle from the fibres (degrees) would have a negative stiffness.
    Negative {
        angle: f64,
        /// Whether there are bonds along the fibres.
        has_fibres: bool,
    },
}

impl PlyBonds {
    /// The bonds of a ply with fibres along a unit vector.
    pub(super) fn new(family: &CompleteFamily, fibre: [f64; 2]) -> Result<Self, NoBonds> {
        let has_fibres = family.moment_along(fibre) > 0.0;
        let moments = family.moments(|direction| {
            let [c, s] = relative(fibre, direction);
            let moments = [
                c.powi(4),
                s.powi(4),
                c * c * s * s,
                c * c * c * s,
                c * s * s * s,
            ];
            let mut parts = waves(fibre, direction);
            if has_fibres {
                parts[1] = f64::from(u8::from(is_along(fibre, direction)));
            }
            [moments, parts]
        });
        let mut bonds = PlyBonds {
            fibre,
            matrix: [[0.0; 5]; PARTS],
            increment: [0.0; PARTS],
            has_fibres,
            uniform: [0.0; PARTS],
        };
        for part in 0..PARTS {
            let mut target = [0.0; 5];
            target[part] = 1.0;
            let factors = solve(moments.clone(), &target).ok_or(NoBonds::TooFew)?;
            bonds.matrix[part].copy_from_slice(&factors);
            if has_fibres {
                bonds.increment[part] = std::mem::take(&mut bonds.matrix[part][1]);
            }
        }
        Ok(bonds)
    }

    /// Refuses bonds that push where they are stretched: waves of short length would grow.
    pub(super) fn check(
        &self,
        family: &CompleteFamily,
        parts: [f64; PARTS],
    ) -> Result<(), NoBonds> {
        for bond in &family.bonds {
            let stiffness = self.matrix(bond.direction, parts)
                + self.along_fibre(bond.direction) * self.increment(parts);
            if !(stiffness >= 0.0) {
                let [c, s] = relative(self.fibre, bond.direction);
                return Err(NoBonds::Negative {
                    angle: (s / c).atan().to_degrees(),
                    has_fibres: self.has_fibres,
                });
            }
        }
        Ok(())
    }

    /// Stiffness of a bond along a unit vector without that of fibres, Pa.
    #[inline(always)]
    pub(super) fn matrix(&self, direction: [f64; 2], parts: [f64; PARTS]) -> f64 {
        let waves = waves(self.fibre, direction);
        let of_part = |part: usize| {
            let factors = &self.matrix[part];
            (1..5).fold(factors[0], |sum, n| sum + factors[n] * waves[n])
        };
        (0..PARTS).fold(0.0, |sum, part| sum + parts[part] * of_part(part))
    }

    /// One for a bond along the fibres, whose stiffness has the increment, else zero.
    #[inline(always)]
    pub(super) fn along_fibre(&self, direction: [f64; 2]) -> f64 {
        match self.has_fibres && is_along(self.fibre, direction) {
            true => 1.0,
            false => 0.0,
        }
    }

    /// Stiffness that fibres add to bonds along them, Pa.
    pub(super) fn increment(&self, parts: [f64; PARTS]) -> f64 {
        (0..PARTS)
            .map(|part| parts[part] * self.increment[part])
            .sum()
    }

    /// Those without what the fibres add.
    pub(super) fn of_matrix(mut self) -> Self {
        self.has_fibres = false;
        self
    }

    /// What the fibres add alone.
    pub(super) fn of_fibres(mut self) -> Self {
        self.matrix = [[0.0; 5]; PARTS];
        self
    }

    /// Whether the fibres have bonds of their own.
    pub(super) fn has_fibres(&self) -> bool {
        self.has_fibres
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Matrix2;
    use perimelt_core::{Correction, FamilySpec, Horizon};

    use super::*;
    use crate::plies::{TensorBonds, turned};

    /// Graphite/epoxy and glass/epoxy of [Gao2020], chapter 4.
    const PLIES: [PlyStiffness; 2] = [
        PlyStiffness {
            moduli: [181e9, 10.3e9],
            poissons_ratio: 0.28,
            shear: 7.17e9,
        },
        PlyStiffness {
            moduli: [39.3e9, 9.7e9],
            poissons_ratio: 0.33,
            shear: 3.32e9,
        },
    ];

    fn family(horizon: f64) -> CompleteFamily {
        let spec = FamilySpec {
            horizon: Horizon::Spacings(horizon),
            correction: Correction::Lattice,
            ..FamilySpec::new(horizon)
        };
        CompleteFamily::new(0.5e-3, &spec).expect("a family")
    }

    /// `1/2 sum w |xi| C n n n n` along and across the fibres with the part of the dilatation: Q11, Q22, Q12, Q66, Q16, Q26.
    fn stiffness(family: &CompleteFamily, bonds: &PlyBonds, ply: &Reduced) -> [f64; 6] {
        let parts = ply.of_bonds();
        let mut sums = [0.0; 6];
        for bond in &family.bonds {
            let [c, s] = relative(bonds.fibre, bond.direction);
            let stiffness = bonds.matrix(bond.direction, parts)
                + bonds.along_fibre(bond.direction) * bonds.increment(parts);
            let half = 0.5 * bond.moment * stiffness;
            let moments = [
                c.powi(4),
                s.powi(4),
                c * c * s * s,
                c * c * s * s,
                c.powi(3) * s,
                c * s.powi(3),
            ];
            (0..6).for_each(|m| sums[m] += half * moments[m]);
        }
        (0..3).for_each(|m| sums[m] += 2.0 * ply.dilatation());
        sums
    }

    /// Compares the stiffness of bonds with that of their ply.
    fn assert_exact(family: &CompleteFamily, bonds: &PlyBonds, ply: &Reduced) {
        let found = stiffness(family, bonds, ply);
        let expected = [ply.along, ply.across, ply.coupling, ply.shear, 0.0, 0.0];
        for (found, expected) in found.iter().zip(expected) {
            let error = (found - expected).abs();
            assert!(error < 1e-12 * ply.along, "{bonds:?}: {found} {expected}");
        }
    }

    #[test]
    fn the_stiffness_of_plies_is_exact_on_every_lattice_and_positive_in_every_bond() {
        for (ply, horizon, angle) in PLIES.iter().flat_map(|ply| {
            [2.0, 3.0, 3.015, 4.0].into_iter().flat_map(move |horizon| {
                [0.0, 90.0, 45.0, -45.0].map(|angle| (ply, horizon, angle))
            })
        }) {
            let family = family(horizon);
            let reduced = ply.reduced();
            let (sin, cos) = f64::to_radians(angle).sin_cos();
            let bonds = PlyBonds::new(&family, [cos, sin]).expect("bonds");
            assert_eq!(bonds.check(&family, reduced.of_bonds()), Ok(()));
            assert!(bonds.has_fibres());
            assert_exact(&family, &bonds, &reduced);
        }
    }

    /// Without bonds along the fibres graphite/epoxy, whose moduli differ by a factor of 18, has no positive bonds.
    #[test]
    fn an_angle_without_bonds_of_the_lattice_needs_moduli_that_differ_little() {
        let family = family(3.0);
        let (sin, cos) = 30_f64.to_radians().sin_cos();
        let bonds = PlyBonds::new(&family, [cos, sin]).expect("bonds");
        let refused = bonds.check(&family, PLIES[0].reduced().of_bonds());
        assert!(
            matches!(
                refused,
                Err(NoBonds::Negative {
                    has_fibres: false,
                    ..
                })
            ),
            "{refused:?}"
        );
        let fabric = PlyStiffness {
            moduli: [12e9, 10e9],
            poissons_ratio: 0.3,
            shear: 4.2e9,
        };
        let reduced = fabric.reduced();
        assert_eq!(bonds.check(&family, reduced.of_bonds()), Ok(()));
        assert_exact(&family, &bonds, &reduced);
        let few = PlyBonds::new(&self::family(1.0), [1.0, 0.0]);
        assert_eq!(few.err(), Some(NoBonds::TooFew));
    }

    #[test]
    fn the_shear_stiffness_of_an_interface_is_exact_in_every_direction() {
        let family = family(3.0);
        let (sin, cos) = 30_f64.to_radians().sin_cos();
        let moduli = turned([cos, sin], [3e9, 2e9]);
        let bonds = TensorBonds::new(&family, &moduli).expect("bonds");
        let mut sum = Matrix2::zeros();
        for bond in &family.bonds {
            let n = nalgebra::Vector2::from(bond.direction);
            sum += 0.5 * bond.moment * bonds.of(bond.direction) * n * n.transpose();
        }
        assert!((sum - moduli).norm() < 1e-12 * moduli.norm());
        let least = |moduli| {
            let bonds = TensorBonds::new(&family, &moduli).expect("bonds");
            let all = family.bonds.iter().map(|bond| bonds.of(bond.direction));
            all.fold(f64::INFINITY, f64::min)
        };
        assert!(least(moduli) > 0.0);
        // more than a factor of three
        assert!(least(turned([1.0, 0.0], [7e9, 2e9])) < 0.0);
    }
}
