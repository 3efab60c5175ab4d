//! Conductivity of the materials of a body, by a law ([`ConductivityLaw`]).

mod fourier;
mod law;
#[cfg(test)]
mod tests;

use nalgebra::Vector3;
use perimelt_core::law::{Constants, Law};
use perimelt_core::material::{Directional, EnthalpyCurve, Property};
use perimelt_core::orientation::PointAxes;
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::solver::reduce::max_abs;
use perimelt_core::{Body, SetupError};
use rayon::prelude::*;

pub use fourier::Fourier;
pub use law::{AnyConductivity, ConductivityLaw, ConductivityRegistration, facts};

/// The conductivity of each material of a body, by the law that the keys choose; the property of the material when they choose none.
///
/// # Errors
/// Keys of the law that make no sense, or a material without one of its properties.
pub(super) fn conductivities(
    law: Option<Law<dyn AnyConductivity>>,
    body: &Body,
) -> Result<Vec<Directional<Property>>, SetupError> {
    let fourier = || Law::<dyn AnyConductivity> {
        name: "fourier",
        law: Box::new(Fourier {}),
    };
    let law = law.unwrap_or_else(fourier);
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
    materials: Vec<Directional<Property>>,
    axes: PointAxes,
    /// Along the axes of each point as last evaluated, W/(m K).
    value: Vec<[f64; 3]>,
}

impl Directions {
    /// The directions of materials at points along the axes of space; `None` where none of them has any.
    pub(super) fn of(conductivities: &[Directional<Property>], body: &Body) -> Option<Self> {
        let has_directions = conductivities.iter().any(Directional::has_directions);
        has_directions.then(|| Directions {
            dimension: body.dimension,
            materials: conductivities.to_vec(),
            axes: PointAxes::new(body.points.len()),
            value: Vec::new(),
        })
    }

    /// Turns the axes of the points by rotation vectors, rad.
    pub(super) fn set_orientation(&mut self, orientation: &[Vector3<f64>]) {
        self.axes.follow(orientation);
    }

    /// Whether they depend on neither temperature nor phase.
    pub(super) fn is_constant(&self) -> bool {
        let mut all = self.materials.iter().flat_map(Directional::values);
        all.all(Property::is_constant)
    }

    /// Mean over the axes, W/(m K).
    pub(super) fn mean(&self, material: usize, temperature: f64, liquid: f64) -> f64 {
        let along = |axis: usize| self.materials[material].along(axis);
        let all = (0..self.dimension).map(|axis| along(axis).at(temperature, liquid));
        all.sum::<f64>() / self.dimension as f64
    }

    /// Largest along an axis, W/(m K): in plane bodies any of them may lie in the plane.
    pub(super) fn largest(&self, material: usize) -> f64 {
        let along = self.materials[material].values().iter();
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
            [0, 1, 2].map(|axis| materials[m as usize].along(axis).at(t, liquid))
        });
        value.fill(&mut self.value);
    }

    /// Conductivity of a point times a gradient, as last evaluated.
    #[inline(always)]
    pub(super) fn times(&self, point: usize, gradient: Vector3<f64>) -> Vector3<f64> {
        let value = &self.value[point];
        let mut product = Vector3::zeros();
        for (axis, k) in self.axes.of(point).column_iter().zip(value) {
            product += *k * axis.dot(&gradient) * axis;
        }
        product
    }
}
