//! Conduction across interfaces between the materials of a body.
//!
//! The parts of a bond on the two sides of an interface conduct in series:
//!
//! ```text
//! k_ij = (d_i + d_j) / (d_i / k_i + d_j / k_j)        d_i = min_j ( |xi_ij| - h_j / 2 ) over bonds to other materials
//! ```
//!
//! `d` is the distance of a point from the interface, which lies half a spacing `h` before the nearest point of another
//! material. The temperature in steady flow across a flat interface has a kink there, and `k_ij (T_j - T_i)` is the heat
//! flux times the length of the bond across the interface, as in a body of one material: the resistance of a laminate is exact
//! for every horizon. With a horizon of one spacing `k_ij` is the harmonic mean. The mean of the ends, `(k_i + k_j) / 2`,
//! counts too little resistance, by about a horizon of the poorer conductor.
//!
//! Parallel to an interface, in a layer of one horizon, bonds that cross it conduct less than the materials in parallel. The
//! resistance of a layer thinner than the horizon is neglected by bonds that cross it.

use perimelt_core::body::Sizes;
use perimelt_core::family::Mirrored;
use perimelt_core::material::in_series;
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::solver::Reducer;
use perimelt_core::{Bond, BondKernel, Family, SlotField};
use rayon::prelude::*;

/// Least distance from an interface, in spacings: points of a cloud may lie closer to each other than half a spacing.
const LEAST_DISTANCE: f64 = 0.25;

/// Conduction by temperature, conductivity and distance from the interface of the ends.
pub(super) struct Across;

impl BondKernel<3, 1> for Across {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; 3], other: [f64; 3]) -> [f64; 1] {
        let twice = 2.0 * in_series([own[1], other[1]], [own[2], other[2]]);
        [twice * bond.mean() * bond.inverse_length * (other[0] - own[0])]
    }
}

/// Conduction by temperature, conductivity, potential, material and distance from the interface of the ends.
pub(super) struct Mixed;

impl BondKernel<5, 1> for Mixed {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; 5], other: [f64; 5]) -> [f64; 1] {
        let between = in_series([own[1], other[1]], [own[4], other[4]]) * (other[0] - own[0]);
        let within = other[2] - own[2];
        let flow = if own[3] == other[3] { within } else { between };
        [2.0 * flow * bond.mean() * bond.inverse_length]
    }
}

/// Sum of the coefficients of a point's bonds, W/(m³ K), from conductivity and distance from the interface of the ends. It is
/// largest at the largest conductivities.
pub(super) struct RowSumAcross;

impl BondKernel<2, 1> for RowSumAcross {
    const RARE: bool = true;

    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; 2], other: [f64; 2]) -> [f64; 1] {
        let twice = 2.0 * in_series([own[0], other[0]], [own[1], other[1]]);
        [twice * bond.mean() * bond.inverse_length]
    }
}

/// Materials and spacings of the points of a body.
#[derive(Clone, Copy)]
pub(super) struct MaterialPoints<'a> {
    pub(super) material: &'a [u16],
    /// m.
    pub(super) spacing: &'a Sizes,
}

/// Distances of points from interfaces.
#[derive(Clone, Debug)]
pub(super) struct Interfaces {
    /// Distance of each point, m; one where no bond leads to another material.
    distance: Vec<f64>,
    slots: SlotField,
}

impl Interfaces {
    pub(super) fn new(points: usize) -> Interfaces {
        Interfaces {
            distance: vec![1.0; points],
            slots: SlotField::default(),
        }
    }

    /// Those of the layers of a laminate, by the family of their plane: bonds between layers do not count.
    pub(super) fn of_layers(plane: &Family, points: MaterialPoints<'_>) -> Interfaces {
        let number = plane.points();
        let layers = (points.material.chunks(number)).zip(points.spacing.chunks(number));
        let in_layer = |(material, spacing): (&[u16], &[f64])| {
            let spacing = &Sizes::from(spacing.to_vec());
            let points = MaterialPoints { material, spacing };
            let of = |p| distance(plane, points, p, |slot| plane.point_in(slot));
            (0..number).map(of).collect::<Vec<_>>()
        };
        Interfaces {
            distance: layers.flat_map(in_layer).collect(),
            slots: SlotField::default(),
        }
    }

    /// Finds the distances of all points.
    pub(super) fn find(&mut self, family: &Family, points: MaterialPoints<'_>, reducer: &Reducer) {
        let point_in = family.points_of_slots();
        let at = |slot: usize| point_in.get(slot).map(|p| *p as usize);
        let all = self.distance.par_iter_mut().enumerate();
        all.for_all(|(point, d)| *d = distance(family, points, point, at));
        reducer.bring(&mut self.distance);
    }

    /// Finds the distances of the `changed` points of a growing family.
    pub(super) fn find_some(
        &mut self,
        family: &Family,
        points: MaterialPoints<'_>,
        changed: &[u32],
        reducer: &Reducer,
    ) {
        for &point in changed {
            let at = |slot| family.mirrored_point(slot);
            self.distance[point as usize] = distance(family, points, point as usize, at);
        }
        reducer.bring(&mut self.distance);
    }

    pub(super) fn of(&self, point: usize) -> f64 {
        self.distance[point]
    }

    /// Copies the distances to slots; layer points have those of the points that they mirror.
    pub(super) fn load(&mut self, family: &Family) {
        self.slots
            .load(family, &self.distance[..], Mirrored::Scalar);
    }

    /// Distances by slot as last loaded, m.
    pub(super) fn slots(&self) -> &[f64] {
        &self.slots
    }
}

fn distance(
    family: &Family,
    MaterialPoints { material, spacing }: MaterialPoints<'_>,
    point: usize,
    point_in: impl Fn(usize) -> Option<usize>,
) -> f64 {
    let mut nearest = f64::INFINITY;
    family.for_each_bond(point, |_, bond, slot| {
        let other = point_in(slot).filter(|p| *p < material.len());
        if let Some(other) = other.filter(|p| material[*p] != material[point]) {
            nearest = nearest.min(bond.length - 0.5 * spacing[other]);
        }
    });
    match nearest.is_finite() {
        true => nearest.max(LEAST_DISTANCE * spacing[point]),
        false => 1.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_in_series_have_the_resistance_of_both() {
        for (k, lengths) in [
            ([1.0, 100.0], [0.5, 0.5]),
            ([3.0, 40.0], [2.5, 0.5]),
            ([7.0, 7.0], [1.0, 2.0]),
        ] {
            let resistance = lengths[0] / k[0] + lengths[1] / k[1];
            let expected = (lengths[0] + lengths[1]) / resistance;
            // rounding
            assert!((in_series(k, lengths) / expected - 1.0).abs() < 1e-15);
        }
        assert_eq!(in_series([0.0, 0.0], [0.5, 0.5]), 0.0);
        assert_eq!(in_series([0.0, 5.0], [0.5, 0.5]), 0.0);
        assert_eq!(in_series([0.0, 0.0], [0.0, 0.0]), 0.0);
    }
}
