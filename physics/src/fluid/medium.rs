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

    /// Pressure of a point whose density went from `before` to `after` (kg/m³), Pa.
    pub(super) fn pressure(&self, point: usize, densities: (f64, f64), pressure: f64) -> f64 {
        self.state
            .pressure(densities, pressure, self.reference_density[point])
    }
}
