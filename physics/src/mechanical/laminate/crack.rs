//! Limits of the bonds of plies from the energy of the bonds that a plane cuts.
//!
//! A plane along the fibres opens by `D`, and each bond that crosses it breaks once its stretch `D cos / |xi|` reaches the limit s.
//! What the bonds dissipate per area is `s^2 K` with
//!
//! ```text
//! K = 1/2 sum |xi| cos w |xi| C  +  sum over breaks of the fall of  2 integral a theta(y)^2 dy
//! ```
//!
//! over the bonds of a complete family that cross the plane from one side: `|xi| cos` is the depth from which points reach across, y the depth of
//! a point, theta its dilatation by the bonds that cross and are whole, per limit. On a lattice y runs over rows, whose distance the integral,
//! constant between the depths of bonds, takes into account. The limit is `sqrt(G / K)`: exact for the discrete bonds.

use std::f64::consts::PI;

use super::weights::{PARTS, PlyBonds, PlyStiffness, Reduced};
use crate::plies::{CompleteFamily, CrossingBond};

/// Openings of bonds that differ by less are the same.
const ROUNDING: f64 = 1e-9;

/// `K` of a ply, Pa m: fracture energy over the square of the limit of the stretch. It is linear in what the bonds carry and in
/// the dilatation stiffness.
#[derive(Clone, Copy, Debug)]
pub(super) struct CrackEnergy {
    /// Over the parts of [`Reduced::of_bonds`], m.
    bonds: [f64; PARTS],
    /// Over the dilatation stiffness a, m.
    dilatation: f64,
}

impl CrackEnergy {
    /// That of a crack along the fibres.
    pub(super) fn new(family: &CompleteFamily, bonds: &PlyBonds) -> Self {
        let [x, y] = bonds.fibre;
        let mut crossing = family.crossing([-y, x]);
        let breaks_at = |bond: &CrossingBond<'_>| bond.length / bond.cosine;
        crossing.sort_by(|a, b| breaks_at(a).total_cmp(&breaks_at(b)));
        let of_part = |part: usize| {
            let mut parts = [0.0; PARTS];
            parts[part] = 1.0;
            let of_bond = |bond: &CrossingBond<'_>| {
                0.5 * bond.length * bond.cosine * bond.moment * bonds.matrix(*bond.direction, parts)
            };
            crossing.iter().map(of_bond).sum()
        };
        let mut dilatation = 0.0;
        let mut rest = &crossing[..];
        while let Some(first) = rest.first() {
            let opening = breaks_at(first);
            let together = |bond: &CrossingBond<'_>| breaks_at(bond) <= (1.0 + ROUNDING) * opening;
            let after = &rest[rest.partition_point(together)..];
            let fall = square_of_dilatation(rest) - square_of_dilatation(after);
            dilatation += 2.0 * opening * opening * fall;
            rest = after;
        }
        CrackEnergy {
            bonds: std::array::from_fn(of_part),
            dilatation,
        }
    }

    /// That of a ply, Pa m.
    pub(super) fn of(&self, ply: &Reduced) -> f64 {
        let parts = ply.of_bonds();
        let of_bonds: f64 = (0..PARTS).map(|part| parts[part] * self.bonds[part]).sum();
        of_bonds + self.dilatation * ply.dilatation()
    }
}

/// Integral of the square of theta over the depth, per square of the opening, 1/m.
fn square_of_dilatation(bonds: &[CrossingBond<'_>]) -> f64 {
    let depth = |bond: &CrossingBond<'_>| bond.length * bond.cosine;
    let mut sorted: Vec<_> = bonds.iter().collect();
    sorted.sort_by(|a, b| depth(b).total_cmp(&depth(a)));
    let (mut theta, mut integral) = (0.0_f64, 0.0);
    for (number, bond) in sorted.iter().enumerate() {
        theta += bond.moment * bond.cosine / bond.length;
        let next = sorted.get(number + 1).map_or(0.0, |next| depth(next));
        integral += theta * theta * (depth(bond) - next);
    }
    integral
}

/// Limit of the shear angle of crossing bonds over the distance `d` (m) with the sum of their stiffness `w |xi| g` (Pa) for a fracture
/// energy (J/m²): each breaks by itself once its angle reaches the limit, `G = d/4 sum_j w |xi| g phi^2`.
pub(super) fn shear_limit(sum: f64, distance: f64, energy: f64) -> f64 {
    (4.0 * energy / (distance * sum)).sqrt()
}

/// `K` of \[Gao2020\], eq. 4.38, Pa m: that of an isotropic solid under plane stress with the modulus across the fibres and the Poisson's ratio of
/// the ply, which has another shear modulus.
pub(super) fn published_energy(ply: &PlyStiffness, horizon: f64) -> f64 {
    let (modulus, ratio) = (ply.moduli[1], ply.poissons_ratio);
    let bulk = 0.5 * modulus / (1.0 - ratio);
    let shear = 0.5 * modulus / (1.0 + ratio);
    (6.0 * shear / PI + 16.0 / (9.0 * PI * PI) * (bulk - 2.0 * shear)) * horizon
}

/// Limit of the stretch across an interface of the modulus E (Pa) over the distance `d` (m): `G = 1/2 E d s^2`.
pub(super) fn opening_limit(modulus: f64, distance: f64, energy: f64) -> f64 {
    (2.0 * energy / (modulus * distance)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Graphite/epoxy and glass/epoxy of [Gao2020], 4.3.4 and 4.4.2: 0.0177 and 0.0147 as printed.
    #[test]
    fn published_limits_are_those_of_the_source() {
        let ply = |e1, e2, nu, shear| PlyStiffness {
            moduli: [e1, e2],
            poissons_ratio: nu,
            shear,
        };
        for (ply, horizon, energy, limit) in [
            (ply(181e9, 10.3e9, 0.28, 7.17e9), 1.005e-3, 2370.0, 0.017705),
            (
                ply(39.3e9, 9.7e9, 0.33, 3.32e9),
                8.0027e-3,
                11850.0,
                0.014592,
            ),
        ] {
            let found: f64 = (energy / published_energy(&ply, horizon)).sqrt();
            assert!((found / limit - 1.0).abs() < 1e-4, "{found} {limit}");
        }
    }
}
