//! Properties of the fluid at its points.

use perimelt_core::family::Mirrored;
use perimelt_core::material::{EnthalpyCurve, Property};
use perimelt_core::solver::reduce::max_abs;
use perimelt_core::{Family, SlotField};
use rayon::prelude::*;

use super::rates::POINTS_PER_TASK;
use super::state::State;

/// The fluid and its properties at its present temperature.
#[derive(Debug)]
pub(super) struct Medium {
    pub(super) state: State,
    /// By point, kg/m³.
    pub(super) reference_density: Vec<f64>,
    /// By point, m.
    pub(super) spacing: Vec<f64>,
    /// Pa s.
    pub(super) viscosity: Coefficient,
}

/// A property of the fluid.
#[derive(Debug)]
pub(super) struct Coefficient {
    /// By material.
    properties: Vec<Property>,
    /// By point.
    pub(super) value: Vec<f64>,
    /// Whether it differs from point to point.
    pub(super) varies: bool,
}

impl Coefficient {
    /// Points are of these materials.
    pub(super) fn new(properties: Vec<Property>, material: &[u16]) -> Self {
        let uniform = Property::common(&properties);
        let at_point = |&m: &u16| {
            let property = properties.get(m as usize);
            property.and_then(Property::constant).unwrap_or(0.0)
        };
        Coefficient {
            value: match uniform {
                Some(value) => vec![value; material.len()],
                None => material.iter().map(at_point).collect(),
            },
            varies: uniform.is_none() && !properties.is_empty(),
            properties,
        }
    }

    /// Whether a temperature is needed to evaluate it.
    pub(super) fn depends_on_temperature(&self) -> bool {
        self.properties.iter().any(|p| !p.is_constant())
    }

    pub(super) fn evaluate(
        &mut self,
        temperature: &[f64],
        material: &[u16],
        curves: &[EnthalpyCurve],
    ) {
        if !self.varies {
            return;
        }
        let points = self.value.par_iter_mut().zip(temperature).zip(material);
        points
            .with_min_len(POINTS_PER_TASK)
            .for_each(|((value, &t), &m)| {
                let liquid = curves[m as usize].liquid_fraction(t);
                *value = self.properties[m as usize].at(t, liquid);
            });
    }

    /// Copies it to slots; where it does not vary only when their number changed.
    pub(super) fn load(&self, family: &Family, slots: &mut SlotField) {
        if self.varies || slots.len() != family.slots() {
            slots.load(family, &self.value[..], Mirrored::Scalar);
        }
    }

    /// Largest value that a material can have.
    pub(super) fn largest(&self, material: u16) -> f64 {
        let property = self.properties.get(material as usize);
        property.map_or(0.0, |p| max_abs(&p.values()))
    }
}

impl Medium {
    /// m/s.
    pub(super) fn sound_speed(&self, point: usize) -> f64 {
        self.state.sound_speed(self.reference_density[point])
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
        let reference = self.reference_density[point];
        *pressure = self.state.pressure(*density, after, *pressure, reference);
        *density = after;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fluid::state::Tait;
    use crate::testing::material;

    fn viscosities(materials: &[&str]) -> Vec<Property> {
        let materials = materials
            .iter()
            .map(|m| material(&format!("viscosity = {m}")));
        materials
            .map(|m| m.get("viscosity").cloned().expect("given"))
            .collect()
    }

    const FALLING: &str = "{ temperature = [300, 400], value = [8, 2] }";

    #[test]
    fn a_coefficient_is_that_of_the_material_and_the_temperature_of_a_point() {
        let curve = || {
            let specific_heat = Property::Constant(1.0);
            EnthalpyCurve::new(1.0, &specific_heat, None).expect("a curve")
        };
        for (materials, varies, by_temperature, at_first, hot) in [
            (&["3"][..], false, false, [3.0; 3], [3.0; 3]),
            (&["3", "3"], false, false, [3.0; 3], [3.0; 3]),
            (&["3", "5"], true, false, [3.0, 5.0, 3.0], [3.0, 5.0, 3.0]),
            (
                &["3", FALLING],
                true,
                true,
                [3.0, 0.0, 3.0],
                [3.0, 5.0, 3.0],
            ),
        ] {
            let mut coefficient = Coefficient::new(viscosities(materials), &[0, 1, 0]);
            assert_eq!(coefficient.varies, varies, "{materials:?}");
            assert_eq!(coefficient.depends_on_temperature(), by_temperature);
            assert_eq!(coefficient.value, at_first, "{materials:?}");
            let curves = [curve(), curve()];
            coefficient.evaluate(&[350.0; 3], &[0, 1, 0], &curves);
            assert_eq!(coefficient.value, hot, "{materials:?}");
        }
        let coefficient = Coefficient::new(viscosities(&["3", FALLING]), &[0, 1]);
        assert_eq!([0, 1, 2].map(|m| coefficient.largest(m)), [3.0, 8.0, 0.0]);
        assert!(
            !Coefficient::new(Vec::new(), &[0, 0]).varies,
            "without viscosity"
        );
    }

    #[test]
    fn lengths_and_diffusivities_are_those_of_spacing_and_sound() {
        let medium = Medium {
            state: super::super::state::State::Tait(Tait {
                sound_speed: 20.0,
                exponent: 1.0,
                background: 0.0,
            }),
            reference_density: vec![2.0],
            spacing: vec![0.5],
            viscosity: Coefficient::new(viscosities(&["3"]), &[0]),
        };
        assert_eq!(medium.sound_diffusivity(0), 10.0);
        assert_eq!(medium.smoothing_length(0), 0.6);
        // 2 * 400 (rho / 2 - 1)
        let (mut density, mut pressure) = (2.0, 9.0);
        medium.change_density(0, 3.0, &mut density, &mut pressure);
        assert_eq!([density, pressure], [3.0, 400.0]);
    }
}
