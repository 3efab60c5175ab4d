//! Stiffness of the bonds of a ply and of an interface by their direction, from the discrete moments of a complete family.
//!
//! ```text
//! Q_abcd - a_abcd = 1/2 sum_j w |xi| C(psi_j) n_a n_b n_c n_d        ply: C = k0 + k2 cos 2 psi + k4 cos 4 psi + F [along fibres]
//! G_ab            = 1/2 sum_j w |xi| g(psi_j) n_a n_b                interface: g = g0 + g2 cos 2 psi
//! ```
//!
//! with `a` the part of the dilatation, psi from the fibres, and sines where the lattice is not symmetric about the fibres.
//! The moments are those of the lattice, so that the stiffness is exact to rounding whatever the horizon.

use nalgebra::{DMatrix, DVector, Matrix2};
use perimelt_core::family::FamilyError;
use perimelt_core::shape::{BoxShape, Shape};
use perimelt_core::{Body, Family, FamilySpec};

/// Sine of the angle up to which a bond runs along the fibres.
const ALONG: f64 = 1e-6;

/// The bonds of a complete family in a plane.
#[derive(Clone, Debug)]
pub(super) struct CompleteFamily {
    bonds: Vec<PlaneBond>,
}

/// A bond of a complete family.
#[derive(Clone, Copy, Debug)]
struct PlaneBond {
    /// Weight times length.
    moment: f64,
    /// Unit vector.
    direction: [f64; 2],
}

impl CompleteFamily {
    /// That of the points of a plane grid of this spacing (m).
    pub(super) fn new(spacing: f64, spec: &FamilySpec) -> Result<Self, FamilyError> {
        let reach = (spec.horizon.of(spacing) / spacing).ceil() + 1.0;
        let side = 2.0 * reach + 1.0;
        let square = Shape::Box(BoxShape {
            min: [0.0; 3],
            max: [side * spacing, side * spacing, spacing],
        });
        let body = Body::fill("plane", &square, 2, spacing, 1.0);
        let body = body.expect("a square of at least three cells");
        let whole = FamilySpec {
            layers: Vec::new(),
            ..spec.clone()
        };
        let family = Family::build(&body, &whole)?;
        let mut bonds = Vec::new();
        family.for_each_bond(body.points.len() / 2, |_, bond, _| {
            bonds.push(PlaneBond {
                moment: bond.weight * bond.length,
                direction: [bond.xi[0], bond.xi[1]].map(|x| x * bond.inverse_length),
            });
        });
        Ok(CompleteFamily { bonds })
    }

    /// Sum of weight times length over the bonds along a direction.
    pub(super) fn moment_along(&self, fibre: [f64; 2]) -> f64 {
        let along = self.bonds.iter().filter(|b| is_along(fibre, b.direction));
        along.map(|bond| bond.moment).sum()
    }

    /// `1/2 sum_j w |xi| m_r(n) p_c(n)` by row and column, with moments m of the directions n and parts p of the stiffness.
    fn moments<const N: usize>(
        &self,
        of_direction: impl Fn([f64; 2]) -> [[f64; N]; 2],
    ) -> DMatrix<f64> {
        let mut matrix = DMatrix::zeros(N, N);
        for bond in &self.bonds {
            let [moments, parts] = of_direction(bond.direction);
            for (row, moment) in moments.iter().enumerate() {
                for (column, part) in parts.iter().enumerate() {
                    matrix[(row, column)] += 0.5 * bond.moment * moment * part;
                }
            }
        }
        matrix
    }
}

/// Whether a unit vector runs along the fibres.
#[inline(always)]
pub(super) fn is_along(fibre: [f64; 2], direction: [f64; 2]) -> bool {
    let sine = fibre[0] * direction[1] - fibre[1] * direction[0];
    sine.abs() < ALONG
}

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
    /// The part of the dilatation, `a` of [Gao2020], chapter 4: bonds have equal Q12 and Q66.
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

    /// Whether the fibres have bonds of their own.
    pub(super) fn has_fibres(&self) -> bool {
        self.increment != 0.0
    }
}

/// Cosine and sine of the angle from the fibres.
#[inline(always)]
fn relative(fibre: [f64; 2], direction: [f64; 2]) -> [f64; 2] {
    [
        fibre[0] * direction[0] + fibre[1] * direction[1],
        fibre[0] * direction[1] - fibre[1] * direction[0],
    ]
}

/// 1, cos 2 psi, sin 2 psi, cos 4 psi and sin 4 psi of the angle from the fibres.
#[inline(always)]
fn waves(fibre: [f64; 2], direction: [f64; 2]) -> [f64; 5] {
    let [c, s] = relative(fibre, direction);
    let (cos2, sin2) = (c * c - s * s, 2.0 * c * s);
    [
        1.0,
        cos2,
        sin2,
        cos2 * cos2 - sin2 * sin2,
        2.0 * cos2 * sin2,
    ]
}

/// The smallest solution: waves that no moment contains, such as sines on a lattice that is symmetric about the fibres, are zero.
/// `None` where the moments cannot be met, since bonds run in too few directions.
fn solve(matrix: DMatrix<f64>, target: &[f64]) -> Option<Vec<f64>> {
    let target = DVector::from_column_slice(target);
    let parts = matrix.clone().svd(true, true);
    let least = 1e-9 * parts.singular_values.max();
    let factors = parts.solve(&target, least).ok()?;
    let missed = (matrix * &factors - &target).amax();
    (missed < 1e-9 * target.amax()).then(|| factors.as_slice().to_vec())
}

/// Stiffness of the bonds across an interface against shear, Pa, by the direction of their projection on the plane.
#[derive(Clone, Copy, Debug)]
pub(super) struct ShearBonds {
    /// Factors of 1, cos 2 psi and sin 2 psi, with psi from x.
    factors: [f64; 3],
}

impl ShearBonds {
    /// The bonds of an interface with these shear moduli, Pa; `None` if one is negative.
    pub(super) fn new(family: &CompleteFamily, moduli: &Matrix2<f64>) -> Option<Self> {
        let matrix = family.moments(|[x, y]| {
            let [one, cos2, sin2, ..] = waves([1.0, 0.0], [x, y]);
            [[x * x, y * y, x * y], [one, cos2, sin2]]
        });
        let target = [moduli[(0, 0)], moduli[(1, 1)], moduli[(0, 1)]];
        let factors = solve(matrix, &target)?;
        let bonds = ShearBonds {
            factors: [factors[0], factors[1], factors[2]],
        };
        let mut all = family.bonds.iter();
        all.all(|bond| bonds.of(bond.direction) >= 0.0)
            .then_some(bonds)
    }

    /// Stiffness of a bond whose projection runs along a unit vector.
    #[inline(always)]
    pub(super) fn of(&self, direction: [f64; 2]) -> f64 {
        let waves = waves([1.0, 0.0], direction);
        (1..3).fold(self.factors[0], |sum, n| sum + self.factors[n] * waves[n])
    }
}

/// The symmetric tensor in the plane with these values along and across the fibres.
pub(super) fn turned(fibre: [f64; 2], [along, across]: [f64; 2]) -> Matrix2<f64> {
    let [c, s] = fibre;
    Matrix2::new(
        along * c * c + across * s * s,
        (along - across) * c * s,
        (along - across) * c * s,
        along * s * s + across * c * c,
    )
}

#[cfg(test)]
mod tests {
    use perimelt_core::{Correction, Horizon};

    use super::*;

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
        let bonds = ShearBonds::new(&family, &moduli).expect("bonds");
        let mut sum = Matrix2::zeros();
        for bond in &family.bonds {
            let n = nalgebra::Vector2::from(bond.direction);
            sum += 0.5 * bond.moment * bonds.of(bond.direction) * n * n.transpose();
        }
        assert!((sum - moduli).norm() < 1e-12 * moduli.norm());
        // more than a factor of three
        assert!(ShearBonds::new(&family, &turned([1.0, 0.0], [7e9, 2e9])).is_none());
    }
}
