//! Conductivity of the materials of a body, by a law ([`ConductivityLaw`]).

mod isotropic;
mod law;
mod orthotropic;
#[cfg(test)]
mod tests;

use nalgebra::Vector3;
use perimelt_core::law::{Constants, Law};
use perimelt_core::material::{EnthalpyCurve, Property};
use perimelt_core::solver::reduce::max_abs;
use perimelt_core::{Body, SetupError};
use rayon::prelude::*;

pub use isotropic::Isotropic;
pub use law::{
    AnyConductivity, Conductivity, ConductivityLaw, ConductivityRegistration, Principal, facts,
};
pub use orthotropic::Orthotropic;

/// The conductivity of each material of a body, by the law that the keys choose; isotropic when they choose none.
///
/// # Errors
/// Keys of the law that make no sense, or a material without one of its properties.
pub(super) fn conductivities(
    law: Option<Law<dyn AnyConductivity>>,
    body: &Body,
) -> Result<Vec<Conductivity>, SetupError> {
    let isotropic = || Law::<dyn AnyConductivity> {
        name: "isotropic",
        law: Box::new(Isotropic {}),
    };
    let law = law.unwrap_or_else(isotropic);
    let (key, law) = (law.key(), law.law);
    law.check().map_err(|e| e.below(&key))?;
    let constants = Constants::of(body, &key, &key, law.constants())?;
    let materials = 0..body.materials.len();
    Ok(materials
        .map(|m| law.conductivity(&constants.properties(m)))
        .collect())
}

/// Conductivities with directions, of the points of a body.
#[derive(Debug)]
pub(super) struct Directions {
    dimension: usize,
    /// By material.
    materials: Vec<Principal>,
    /// Along the axes of each point as last evaluated, W/(m K).
    value: Vec<[f64; 3]>,
}

impl Directions {
    /// The directions of materials; `None` where none of them has any.
    pub(super) fn of(conductivities: &[Conductivity], dimension: usize) -> Option<Self> {
        let is_isotropic = |c: &Conductivity| matches!(c, Conductivity::Isotropic(_));
        if conductivities.iter().all(is_isotropic) {
            return None;
        }
        let materials = conductivities.iter().map(|c| match c {
            Conductivity::Principal(principal) => principal.clone(),
            Conductivity::Isotropic(conductivity) => Principal {
                conductivity: [0, 1, 2].map(|_| conductivity.clone()),
                axes: [Vector3::x(), Vector3::y(), Vector3::z()],
            },
        });
        Some(Directions {
            dimension,
            materials: materials.collect(),
            value: Vec::new(),
        })
    }

    /// The conductivities of a material along the axes in the dimensions of the body.
    fn along(&self, material: usize) -> &[Property] {
        &self.materials[material].conductivity[..self.dimension]
    }

    /// Whether they depend on neither temperature nor phase.
    pub(super) fn is_constant(&self) -> bool {
        let materials = 0..self.materials.len();
        materials
            .flat_map(|m| self.along(m))
            .all(Property::is_constant)
    }

    /// Mean over the axes, W/(m K).
    pub(super) fn mean(&self, material: usize, temperature: f64, liquid: f64) -> f64 {
        let along = self.along(material).iter();
        along.map(|k| k.at(temperature, liquid)).sum::<f64>() / self.dimension as f64
    }

    /// Largest along an axis, W/(m K).
    pub(super) fn largest(&self, material: usize) -> f64 {
        let along = self.along(material).iter();
        along.map(|k| max_abs(&k.values())).fold(0.0, f64::max)
    }

    /// Evaluates them at the temperatures of the points, K.
    pub(super) fn evaluate(
        &mut self,
        temperature: &[f64],
        material: &[u16],
        curves: &[EnthalpyCurve],
    ) {
        let materials = &self.materials;
        let points = temperature.par_iter().zip(material);
        let value = points.map(|(&t, &m)| {
            let liquid = curves[m as usize].liquid_fraction(t);
            let [a, b, c] = &materials[m as usize].conductivity;
            [a.at(t, liquid), b.at(t, liquid), c.at(t, liquid)]
        });
        value.collect_into_vec(&mut self.value);
    }

    /// Conductivity of a point times a gradient, as last evaluated.
    #[inline(always)]
    pub(super) fn times(
        &self,
        point: usize,
        material: u16,
        gradient: Vector3<f64>,
    ) -> Vector3<f64> {
        let axes = &self.materials[material as usize].axes;
        let value = &self.value[point];
        let mut product = Vector3::zeros();
        for (axis, k) in axes.iter().zip(value) {
            product += *k * axis.dot(&gradient) * axis;
        }
        product
    }
}
