//! Properties of the fluid at its points.

use perimelt_core::law::Law;

use super::state::{DensityChange, StateLaw};
use super::viscosity::Viscosity;

/// The fluid and its properties at its present temperature.
#[derive(Debug)]
pub(super) struct Medium {
    state: Law<dyn StateLaw>,
    /// By point, kg/m³.
    pub(super) reference_density: Vec<f64>,
    /// By point, m/s.
    sound_speed: Vec<f64>,
    /// By point, m.
    pub(super) spacing: Vec<f64>,
    /// Pa s.
    pub(super) viscosity: Viscosity,
}

impl Medium {
    /// A fluid with an equation of state, whose points have a reference density (kg/m³) and a spacing (m).
    pub(super) fn new(
        state: Law<dyn StateLaw>,
        viscosity: Viscosity,
        reference_density: Vec<f64>,
        spacing: Vec<f64>,
    ) -> Self {
        let speeds = reference_density.iter();
        Medium {
            sound_speed: speeds.map(|rho| state.law.sound_speed(*rho)).collect(),
            state,
            reference_density,
            spacing,
            viscosity,
        }
    }

    /// m/s.
    pub(super) fn sound_speed(&self, point: usize) -> f64 {
        self.sound_speed[point]
    }

    /// m/s.
    pub(super) fn largest_sound_speed(&self) -> f64 {
        self.sound_speed.iter().copied().fold(0.0, f64::max)
    }

    /// Density at a pressure (Pa), kg/m³.
    pub(super) fn density(&self, point: usize, pressure: f64) -> f64 {
        let reference = self.reference_density[point];
        self.state.law.density(pressure, reference)
    }

    /// Spacing times speed of sound, m²/s.
    pub(super) fn sound_diffusivity(&self, point: usize) -> f64 {
        self.spacing[point] * self.sound_speed(point)
    }

    /// Length h of Gao (2020), chapter 6: 1.2 spacings, m.
    pub(super) fn smoothing_length(&self, point: usize) -> f64 {
        1.2 * self.spacing[point]
    }

    /// Gives a point another density (`after`, kg/m³), and the pressure that belongs to it.
    #[inline(always)]
    pub(super) fn change_density(
        &self,
        point: usize,
        after: f64,
        density: &mut f64,
        pressure: &mut f64,
    ) {
        *pressure = self.state.law.pressure(DensityChange {
            before: *density,
            after,
            pressure: *pressure,
            reference: self.reference_density[point],
        });
        *density = after;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fluid::state::Tait;
    use crate::testing::block;
    use perimelt_core::body::Store;

    #[test]
    fn lengths_and_diffusivities_are_those_of_spacing_and_sound() {
        let water = block([1, 1, 1], 1, 1.0, Store::Lattice, "viscosity = 3");
        let tait = Law::<dyn StateLaw> {
            name: "tait",
            law: Box::new(Tait {
                sound_speed: 20.0,
                exponent: 1.0,
                background: 0.0,
            }),
        };
        let viscosity = Viscosity::new(None, &water, false).expect("a viscosity");
        let medium = Medium::new(tait, viscosity, vec![2.0], vec![0.5]);
        assert_eq!(medium.sound_diffusivity(0), 10.0);
        assert_eq!(medium.smoothing_length(0), 0.6);
        // 2 * 400 (rho / 2 - 1)
        let (mut density, mut pressure) = (2.0, 9.0);
        medium.change_density(0, 3.0, &mut density, &mut pressure);
        assert_eq!([density, pressure], [3.0, 400.0]);
    }
}
