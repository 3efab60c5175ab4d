//! Rates of the fields: what every form of the equations offers to a step, and what it needs.

use nalgebra::Vector3;
use perimelt_core::family::LayerRule;
use perimelt_core::solver::SolverError;
use perimelt_core::{Family, SlotField};
use rayon::prelude::*;

use super::medium::Medium;
use super::walls::Walls;

/// Least number of points that a thread takes at once.
pub(super) const POINTS_PER_TASK: usize = 1024;

/// What a step takes into account.
pub(super) struct Terms<'a> {
    pub(super) medium: &'a Medium,
    /// N/m³.
    pub(super) force: Option<&'a [Vector3<f64>]>,
    pub(super) density_diffusion: f64,
    /// Fraction of the acceleration that counts during the start-up.
    pub(super) acceleration_fraction: f64,
    /// How the velocity continues behind faces.
    pub(super) rules: &'a [LayerRule],
    /// Step, s.
    pub(super) dt: f64,
}

impl Terms<'_> {
    /// Along an axis, m/s².
    pub(super) fn body_acceleration(&self, point: usize, axis: usize) -> f64 {
        let density = self.medium.reference_density[point];
        self.force.map_or(0.0, |f| f[point][axis] / density)
    }

    /// Derivative of the density along an axis in the hydrostatic pressure of the body force, kg/m⁴.
    pub(super) fn density_slope(&self, point: usize, axis: usize) -> f64 {
        let sound = self.medium.sound_speed(point);
        self.force.map_or(0.0, |f| f[point][axis] / (sound * sound))
    }

    /// Gradient of the density in the hydrostatic pressure of the body force, kg/m⁴.
    pub(super) fn density_gradient(&self, point: usize) -> Vector3<f64> {
        Vector3::from_fn(|axis, _| self.density_slope(point, axis))
    }

    /// Diffusivity of the density, m²/s.
    pub(super) fn density_diffusivity(&self, point: usize) -> f64 {
        self.density_diffusion * self.medium.sound_diffusivity(point)
    }
}

/// What the largest stable step depends on.
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
pub(super) struct Stability {
    /// Largest wave number of the gradient, 1/m.
    pub(super) wave_number: f64,
    /// Sum of the weights of the Laplacian, 1/m².
    pub(super) laplacian: f64,
}

impl Stability {
    /// Operators whose largest sums went from `initial` to `now`.
    pub(super) fn scaled(self, initial: LargestSums, now: LargestSums) -> Self {
        let growth = |initial: f64, now: f64| (now / initial).max(1.0);
        Stability {
            wave_number: self.wave_number * growth(initial.first, now.first),
            laplacian: self.laplacian * growth(initial.second, now.second),
        }
    }

    /// Operators where squared distances went down by this factor.
    pub(super) fn compressed(self, factor: f64) -> Self {
        Stability {
            wave_number: self.wave_number * factor.sqrt(),
            laplacian: self.laplacian * factor,
        }
    }
}

/// Largest sums over the bonds of a point; only their growth matters.
#[derive(Clone, Copy, Debug)]
pub(super) struct LargestSums {
    /// Sum of the weights of bonds times their lengths: bounds the response of first derivatives.
    first: f64,
    /// Sum of the weights: bounds the response of second derivatives.
    second: f64,
}

impl LargestSums {
    /// Over the bonds of a family, and those to walls.
    pub(super) fn of(family: &Family, points: usize, walls: Option<&Walls>) -> Self {
        let mut at_walls = Vec::new();
        if let Some(walls) = walls.filter(|w| !w.is_empty()) {
            at_walls.resize(points, [0.0; 2]);
            walls.add_sums(&mut at_walls);
        }
        let sums = |point: usize| {
            let [mut first, mut second] = at_walls.get(point).copied().unwrap_or_default();
            family.for_each_bond(point, |_, bond, _| {
                first += bond.weight * bond.length;
                second += bond.weight;
            });
            (first, second)
        };
        let points = (0..points).into_par_iter().with_min_len(POINTS_PER_TASK);
        let largest = |a: (f64, f64), b: (f64, f64)| (a.0.max(b.0), a.1.max(b.1));
        let (first, second) = points.map(sums).reduce(|| (0.0, 0.0), largest);
        LargestSums { first, second }
    }
}

/// Rates of the fields in one form of the equations. A step first sets the fields on which the rates depend, then
/// advances others.
pub(super) trait Rates: std::fmt::Debug {
    /// The family over which sums are taken.
    fn family(&self) -> &Family;

    /// What the largest stable step depends on, for the points at their reference positions.
    fn stability(&self) -> Stability;

    /// Takes the viscosity at the start of a step.
    fn set_viscosity(&mut self, medium: &Medium);

    /// Sets the velocity, by slot and component, and the density.
    fn set_velocity(&mut self, velocity: &[SlotField], density: &[f64], terms: &Terms<'_>);

    /// Sets the pressure; behind faces it grows with the weight of the fluid before them.
    fn set_pressure(&mut self, pressure: &[f64], force: Option<&[Vector3<f64>]>);

    /// Advances density and pressure by the step.
    ///
    /// # Errors
    /// When no pressure is found.
    fn advance_density(
        &mut self,
        terms: &Terms<'_>,
        density: &mut [f64],
        pressure: &mut [f64],
    ) -> Result<(), SolverError>;

    /// Advances the velocity by a time (s), after velocity and pressure are set.
    fn advance_velocity(
        &mut self,
        terms: &Terms<'_>,
        time: f64,
        velocity: &mut [Vector3<f64>],
        density: &[f64],
    );

    /// Finds the heat of viscous friction per current volume, W/m³.
    fn friction(&self, medium: &Medium, friction: &mut Vec<f64>);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Limits follow sums that grow, and do not become longer where they fall; squared distances shorten wave numbers by
    /// their root.
    #[test]
    fn stability_follows_the_sums_of_the_weights() {
        let stability = Stability {
            wave_number: 10.0,
            laplacian: 50.0,
        };
        let sums = |first, second| LargestSums { first, second };
        for (now, expected) in [
            (sums(2.0, 4.0), [10.0, 50.0]),
            (sums(3.0, 4.0), [15.0, 50.0]),
            (sums(1.0, 12.0), [10.0, 150.0]),
        ] {
            let scaled = stability.scaled(sums(2.0, 4.0), now);
            assert_eq!([scaled.wave_number, scaled.laplacian], expected);
        }
        let compressed = stability.compressed(4.0);
        assert_eq!(
            [compressed.wave_number, compressed.laplacian],
            [20.0, 200.0]
        );
    }
}
