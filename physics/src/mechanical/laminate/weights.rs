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
}

/// Stiffness of the bonds of a ply, Pa, by their direction.
#[derive(Clone, Copy, Debug)]
pub struct PlyBonds {
    /// Unit vector along the fibres.
    pub(super) fibre: [f64; 2],
    /// Factors of 1, cos 2 psi, sin 2 psi, cos 4 psi, sin 4 psi.
    matrix: [f64; 5],
    /// Added to bonds along the fibres.
    increment: f64,
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
    pub(super) fn new(
        family: &CompleteFamily,
        fibre: [f64; 2],
        ply: &Reduced,
    ) -> Result<Self, NoBonds> {
        let has_fibres = family.moment_along(fibre) > 0.0;
        let matrix = family.moments(|direction| {
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
        let of_dilatation = 2.0 * ply.dilatation();
        let target = [
            ply.along - of_dilatation,
            ply.across - of_dilatation,
            ply.shear,
            0.0,
            0.0,
        ];
        let factors = solve(matrix, &target).ok_or(NoBonds::TooFew)?;
        let [one, second, sin2, cos4, sin4] = factors[..] else {
            return Err(NoBonds::TooFew);
        };
        let (cos2, increment) = if has_fibres {
            (0.0, second)
        } else {
            (second, 0.0)
        };
        let bonds = PlyBonds {
            fibre,
            matrix: [one, cos2, sin2, cos4, sin4],
            increment,
        };
        bonds.check(family, has_fibres)?;
        Ok(bonds)
    }

    /// Refuses bonds that push where they are stretched: waves of short length would grow.
    fn check(&self, family: &CompleteFamily, has_fibres: bool) -> Result<(), NoBonds> {
        for bond in &family.bonds {
            let stiffness = self.matrix(bond.direction) + self.along_fibre(bond.direction);
            if !(stiffness >= 0.0) {
                let [c, s] = relative(self.fibre, bond.direction);
                return Err(NoBonds::Negative {
                    angle: (s / c).atan().to_degrees(),
                    has_fibres,
                });
            }
        }
        Ok(())
    }

    /// Stiffness of a bond along a unit vector, without that of fibres.
    #[inline(always)]
    pub(super) fn matrix(&self, direction: [f64; 2]) -> f64 {
        let waves = waves(self.fibre, direction);
        (1..5).fold(self.matrix[0], |sum, n| sum + self.matrix[n] * waves[n])
    }

    /// Stiffness that fibres add to a bond along a unit vector.
    #[inline(always)]
    pub(super) fn along_fibre(&self, direction: [f64; 2]) -> f64 {
        match is_along(self.fibre, direction) {
            true => self.increment,
            false => 0.0,
        }
    }

    /// Those without what the fibres add.
    pub(super) fn of_matrix(mut self) -> Self {
        self.increment = 0.0;
        self
    }

    /// What the fibres add alone.
    pub(super) fn of_fibres(mut self) -> Self {
        self.matrix = [0.0; 5];
        self
    }

    /// Whether the fibres have bonds of their own.
    pub(super) fn has_fibres(&self) -> bool {
        self.increment != 0.0
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
    fn stiffness(family: &CompleteFamily, bonds: &PlyBonds, a: f64) -> [f64; 6] {
        let mut sums = [0.0; 6];
        for bond in &family.bonds {
            let [c, s] = relative(bonds.fibre, bond.direction);
            let stiffness = bonds.matrix(bond.direction) + bonds.along_fibre(bond.direction);
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
        (0..3).for_each(|m| sums[m] += 2.0 * a);
        sums
    }

    /// Compares the stiffness of bonds with that of their ply.
    fn assert_exact(family: &CompleteFamily, bonds: &PlyBonds, ply: &Reduced) {
        let found = stiffness(family, bonds, ply.dilatation());
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
            let bonds = PlyBonds::new(&family, [cos, sin], &reduced).expect("bonds");
            assert!(bonds.has_fibres());
            assert_exact(&family, &bonds, &reduced);
        }
    }

    /// Without bonds along the fibres graphite/epoxy, whose moduli differ by a factor of 18, has no positive bonds.
    #[test]
    fn an_angle_without_bonds_of_the_lattice_needs_moduli_that_differ_little() {
        let family = family(3.0);
        let (sin, cos) = 30_f64.to_radians().sin_cos();
        let refused = PlyBonds::new(&family, [cos, sin], &PLIES[0].reduced());
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
        let bonds = PlyBonds::new(&family, [cos, sin], &reduced).expect("bonds");
        assert_exact(&family, &bonds, &reduced);
        assert_eq!(
            PlyBonds::new(&self::family(1.0), [1.0, 0.0], &reduced).err(),
            Some(NoBonds::TooFew)
        );
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
        // more than a factor of three
        assert!(TensorBonds::new(&family, &turned([1.0, 0.0], [7e9, 2e9])).is_none());
    }
}
