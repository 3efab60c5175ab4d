//! States outside the validity of the model, for warnings at the end of a run.

use nalgebra::{Matrix3, Vector3};
use perimelt_core::material::Property;
use perimelt_core::solver::Reducer;
use perimelt_core::{Body, Report, World};

use super::step::MechanicalRun;

/// Displacement of the ends of a bond relative to each other, over its length, beyond which displacements are not small: a
/// rotation by 0.2 is a strain of 2 % to linear kinematics.
const SMALL: f64 = 0.2;

/// What the logged states of a body showed.
#[derive(Debug, Default)]
pub(super) struct Validity {
    /// Yield stress of each material of an elastic body, Pa; empty if no material has one, or if the body flows.
    yield_stress: Vec<Option<Property>>,
    is_linear: bool,
    /// Whether a step has begun: before, displacements need not be in equilibrium with anything.
    pub(super) has_begun: bool,
    /// In the last logged state.
    stress_over_yield: f64,
    largest: Option<OverYield>,
    /// Largest displacement of the ends of a bond relative to each other, over its length, beyond [`SMALL`].
    relative_displacement: Option<f64>,
}

/// A von Mises stress beyond the yield stress.
#[derive(Clone, Copy, Debug)]
struct OverYield {
    ratio: f64,
    /// Pa.
    stress: f64,
    /// m.
    place: [f64; 3],
    material: usize,
    /// K.
    temperature: Option<f64>,
}

impl OverYield {
    /// The largest of all processes.
    fn largest(own: Option<OverYield>, points: &Reducer) -> Option<OverYield> {
        const NONE: f64 = -1.0;
        let numbers = |own: OverYield| {
            let [x, y, z] = own.place;
            let temperature = own.temperature.unwrap_or(NONE);
            (
                own.ratio,
                [own.stress, x, y, z, own.material as f64, temperature],
            )
        };
        let (ratio, numbers) = points.largest(own.map(numbers))?;
        let [stress, x, y, z, material, temperature] = numbers;
        Some(OverYield {
            ratio,
            stress,
            place: [x, y, z],
            material: material as usize,
            temperature: Some(temperature).filter(|t| *t != NONE),
        })
    }
}

/// Von Mises stress, Pa.
fn von_mises(stress: &Matrix3<f64>) -> f64 {
    let deviator = stress - Matrix3::identity() * (stress.trace() / 3.0);
    (1.5 * deviator.norm_squared()).sqrt()
}

impl Validity {
    pub(super) fn new(body: &Body, is_linear: bool, is_plastic: bool) -> Self {
        let materials = body
            .materials
            .iter()
            .map(|m| m.get("yield_stress").cloned());
        let yield_stress: Vec<_> = materials.collect();
        let is_given = !is_plastic && yield_stress.iter().any(Option::is_some);
        Validity {
            yield_stress: if is_given { yield_stress } else { Vec::new() },
            is_linear,
            ..Validity::default()
        }
    }

    /// Largest von Mises stress over the yield stress.
    fn over_yield(
        &self,
        body: &Body,
        stress: &[Matrix3<f64>],
        temperature: Option<&[f64]>,
    ) -> Option<OverYield> {
        let points = stress.iter().zip(&body.material_of_point).enumerate();
        let ratios = points.filter_map(|(point, (stress, material))| {
            let property = self.yield_stress[usize::from(*material)].as_ref()?;
            let stress = von_mises(stress);
            let temperature = temperature.map(|t| t[point]);
            let limit = property.at(temperature.unwrap_or(0.0), 0.0);
            Some(OverYield {
                ratio: stress / limit,
                stress,
                place: body.points.position.at(point).into(),
                material: usize::from(*material),
                temperature,
            })
        });
        ratios.max_by(|a, b| a.ratio.total_cmp(&b.ratio))
    }

    /// For the log: whether an elastic body is stressed beyond yield.
    pub(super) fn report(&self) -> Option<Report> {
        (!self.yield_stress.is_empty())
            .then(|| Report::new("stress.over_yield", "1", self.stress_over_yield))
    }

    /// Sentences without a full stop.
    pub(super) fn remarks(&self, body: &Body) -> Vec<String> {
        let displaced = self.relative_displacement;
        let displaced = displaced.map(|largest| remark_on_displacement(body, largest));
        self.remark_on_yield(body)
            .into_iter()
            .chain(displaced)
            .collect()
    }

    fn remark_on_yield(&self, body: &Body) -> Option<String> {
        let over_yield = self.largest.filter(|largest| largest.ratio > 1.0)?;
        let OverYield {
            ratio,
            stress,
            place: [x, y, z],
            material,
            temperature,
        } = over_yield;
        let there = temperature.map_or_else(String::new, |t| format!(" at {t:.0} K"));
        let material = body.materials[material].name();
        Some(format!(
            "body `{}` is elastic, but its von Mises stress reaches {:.4} MPa at ({x:.4e}, {y:.4e}, {z:.4e}) m, where \
             `{material}` yields at {:.4} MPa{there} (use `plasticity`, or do not read stress as that of the material)",
            body.name,
            1e-6 * stress,
            1e-6 * stress / ratio,
        ))
    }
}

fn remark_on_displacement(body: &Body, largest: f64) -> String {
    format!(
        "body `{}` has neighbouring points that are displaced by up to {largest:.3} times their distance relative to each other, \
         and `kinematics = \"linear\"` assumes small rotations and strains (use `kinematics = \"finite\"`)",
        body.name
    )
}

impl MechanicalRun {
    /// Takes note of a state that is logged, after its stress was provided.
    pub(super) fn examine_validity(&mut self, world: &World) {
        if !self.validity.has_begun {
            return;
        }
        if self.validity.is_linear {
            let found = self.solid.deformation().relative_displacement_beyond(SMALL);
            let found = world.reducer(self.body).max(found.unwrap_or(0.0));
            if found > 0.0 {
                let largest = &mut self.validity.relative_displacement;
                *largest = Some(largest.unwrap_or(0.0).max(found));
            }
        }
        if self.validity.yield_stress.is_empty() {
            return;
        }
        let stress = world.read::<Matrix3<f64>>(self.fields.stress.into());
        let temperature = world.read_if_provided(self.fields.temperature);
        let body = world.body(self.body);
        let points = world.reducer(self.body);
        let own = points.owned();
        let found = self
            .validity
            .over_yield(body, &stress[..own], temperature.as_deref());
        let found = OverYield::largest(found, &points);
        let ratio = |over: Option<OverYield>| over.map_or(0.0, |o| o.ratio);
        self.validity.stress_over_yield = ratio(found);
        if ratio(found) > ratio(self.validity.largest) {
            self.validity.largest = found;
        }
    }
}

/// Bonds of a lattice with a horizon below this number of spacings run along its axes only.
const DIAGONAL: f64 = 1.41;

/// A sentence about a lattice whose bonds do not resist shear, as their forces act along themselves; `horizon` in m.
pub(super) fn shear_warning(body: &Body, horizons: &[f64]) -> Option<String> {
    let spacings = horizons.iter().zip(body.points.spacing.each());
    let (point, spacings) = spacings
        .map(|(horizon, spacing)| horizon / spacing)
        .enumerate()
        .min_by(|a, b| a.1.total_cmp(&b.1))?;
    if body.dimension == 1 || body.lattice().is_none() || spacings >= DIAGONAL {
        return None;
    }
    let at: Vector3<f64> = body.points.position.at(point);
    Some(format!(
        "with a horizon of {spacings:.3} spacings at ({:.4e}, {:.4e}, {:.4e}) m, body `{}` has bonds along the axes of its \
         lattice only, which do not resist shear and have no Poisson's ratio: stiffness and displacements are wrong (use a \
         horizon of 2 spacings or more, usually 3, or `formulation = \"correspondence\"`)",
        at.x, at.y, at.z, body.name
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn von_mises_of_tension_shear_and_pressure() {
        let tension = Matrix3::from_diagonal(&Vector3::new(3.0, 0.0, 0.0));
        let mut shear = Matrix3::zeros();
        (shear[(0, 1)], shear[(1, 0)]) = (2.0, 2.0);
        let pressure = Matrix3::identity() * 5.0;
        for (stress, expected) in [(tension, 3.0), (shear, 12f64.sqrt()), (pressure, 0.0)] {
            assert!((von_mises(&stress) - expected).abs() < 1e-14);
        }
    }
}
