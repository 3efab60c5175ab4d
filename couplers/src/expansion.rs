//! Thermal expansion: temperature gives every point a stress-free strain
//!
//! ```text
//! eigenstrain        += e,                          e = e(T) - e(T_ref)
//! eigenstrain_tensor += sum_k (e_k - e) a_k (x) a_k     where a material expands differently along its axes a_k; e is the mean
//! ```
//!
//! with the axes of space turned by the field `orientation`, the elongation e of the material, given by mean coefficients, instantaneous coefficients or a table of e
//! ([`Expansion`]), and the stress-free temperature T_ref. Mean (secant) coefficients alpha count from a temperature T_0
//! of their own, `expansion_reference` of the material: e(T) = alpha(T) (T - T_0); where the material does not give it, T_0 =
//! T_ref. A bond of a bond-based solid has the mean of the strains of its ends, alpha (theta + theta')/2 (Wang (2025),
//! eq. 7.5).
//!
//! Above a cut-off temperature T_cut the strain is that of T_cut. Use it with an annealing
//! temperature of the plasticity (`plasticity.annealing_temperature`), above which metal has no
//! strength: without a cut-off, two neighbouring points that anneal at 1600 K and at 2500 K differ by
//! one percent of volume after cooling, which is a hydrostatic stress of hundreds of MPa. With a
//! cut-off all points contract from the same strain.
//!
//! Material that is deposited during the run is free of stress at the temperature of its birth, so that the strain is
//! `e(T) - e(T_birth)`.
//!
//! Not for a change of the stress-free state by melting: relief of strain in the melt needs a plastic
//! or viscous solid.

use nalgebra::{Matrix3, Vector3};
use perimelt_core::in_space::Placed;
use perimelt_core::material::{Directional, Expansion, ThermalState};
use perimelt_core::numbers::check_above;
use perimelt_core::orientation::{PointAxes, tensor};
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::world::BodyIndex;
use perimelt_core::{
    Coupler, GivenValue, InSpace, Prepared, Read, ReadIfProvided, RunError, RunningCoupler, Setup,
    SetupError, Step, Stepping, World, Write, keys,
};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Strain from temperature; needs the material property `thermal_expansion`, `instantaneous_expansion` or
/// `thermal_elongation`.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ThermalExpansion {
    /// Body; may be left out when there is one only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<String>,
    /// Temperature at which the body is free of stress (K): a number, or by place a formula in x, y, z (m) or a file.
    pub reference_temperature: InSpace,
    /// Temperature (K) of a body whose temperature is known: a number, or by place and time a formula in x, y, z (m) and t (s) or a
    /// file; the field `temperature` when left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub temperature: Option<InSpace>,
    /// Temperature above which the body expands no further (K), where it has lost its strength.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cutoff_temperature: Option<f64>,
}

/// The strain by temperature of a body, whichever coupler computes it.
pub(crate) struct ExpansionByTemperature;

/// An expansion that is ready to act.
struct RunningThermalExpansion {
    body: usize,
    /// Expansion by material.
    expansion: Vec<Directional<Expansion>>,
    temperature: Temperature,
    liquid_fraction: ReadIfProvided<f64>,
    /// Temperature at birth, K; zero at points that exist from the start.
    birth_temperature: ReadIfProvided<f64>,
    sink: Sink,
    /// Reference temperature at each point, K.
    reference: Vec<f64>,
    /// Cut-off temperature, K.
    cutoff: Option<f64>,
}

/// Where the temperature comes from.
enum Temperature {
    Field(Read<f64>),
    Given(Box<Placed>),
}

/// Where the strain goes.
struct Sink {
    /// The strain, or its mean over the axes.
    mean: Write<f64>,
    /// For a body with a material that expands differently along its axes.
    rest: Option<Rest>,
}

/// What the strain differs from its mean by.
struct Rest {
    strain: Write<Matrix3<f64>>,
    orientation: Read<Vector3<f64>>,
    axes: PointAxes,
}

impl Sink {
    fn of(
        setup: &mut Setup<'_>,
        body: BodyIndex,
        expansion: &[Directional<Expansion>],
    ) -> Result<Self, SetupError> {
        let mean = setup.add(body, &keys::EIGENSTRAIN)?;
        let rest = match expansion.iter().any(Directional::has_directions) {
            false => None,
            true => Some(Rest {
                strain: setup.add(body, &keys::EIGENSTRAIN_TENSOR)?,
                orientation: setup.given(body, &keys::ORIENTATION)?,
                axes: PointAxes::new(setup.body(body).points.len()),
            }),
        };
        Ok(Sink { mean, rest })
    }
}

/// The thermal expansion of each material of a body. Mean coefficients whose reference temperature the material does not
/// give count from the reference temperatures of the coupler (K), with a warning.
///
/// # Errors
/// When a material states no expansion, or none from one temperature.
pub(crate) fn expansions_from(
    setup: &mut Setup<'_>,
    body: usize,
    references: &[f64],
) -> Result<Vec<Directional<Expansion>>, SetupError> {
    let reference = references.first().copied().unwrap_or(0.0);
    let expansions = setup.world().expansions(body)?;
    let lacks = |expansion: &Directional<Expansion>| {
        expansion.values().iter().any(Expansion::lacks_reference)
    };
    let lacks_reference = expansions.iter().any(lacks);
    if lacks_reference && references.iter().any(|r| *r != reference) {
        let message = "the reference temperature depends on the place, and a table of mean coefficients does not say from \
                       which temperature it counts";
        let expected = "`expansion_reference` [K] in the material, often 293.15";
        return Err(SetupError::value(
            "reference_temperature",
            message,
            expected,
        ));
    }
    let materials = setup.body(body).materials.iter().zip(&expansions);
    let lacking = materials.filter(|(_, expansion)| lacks(expansion));
    let warnings: Vec<String> = lacking
        .map(|(material, _)| {
            format!(
                "the mean coefficients `thermal_expansion` of material `{}` are taken to count from the reference temperature \
                 {reference} K of the coupler: give the temperature from which the table counts, `expansion_reference` [K], \
                 often 293.15",
                material.name()
            )
        })
        .collect();
    warnings.into_iter().for_each(|text| setup.warn(text));
    let expansions = expansions.into_iter();
    Ok(expansions
        .map(|e| e.map(|along| along.clone().with_default_reference(reference)))
        .collect())
}

#[typetag::serialize(name = "thermal_expansion")]
impl Coupler for ThermalExpansion {
    fn prepare(self: Box<Self>, setup: &mut Setup<'_>) -> Prepared<dyn RunningCoupler> {
        let body = setup.find_body(self.body.as_deref())?;
        let positions = setup.body(body).points.position.to_vec();
        let key = "reference_temperature";
        let given = GivenValue {
            key,
            value: &self.reference_temperature,
            column: "temperature",
        };
        let mut reference = setup.placed(body, given, positions)?;
        if reference.changes() {
            let message = "the temperature at which the body is free of stress changes in time";
            let expected = "a number, a formula in x, y and z, or a file with one time";
            return Err(SetupError::value(key, message, expected));
        }
        let reference = reference
            .at(0.0)
            .map_err(|e| SetupError::other(key, e))?
            .to_vec();
        let highest = reference.iter().copied().fold(0.0, f64::max);
        check_above(
            "cutoff_temperature",
            self.cutoff_temperature,
            highest,
            "K, the highest reference temperature",
        )?;
        let temperature = self.known_temperature(setup, body)?;
        setup.stepping(Stepping {
            is_steady: match &temperature {
                Temperature::Field(_) => true,
                Temperature::Given(placed) => !placed.changes(),
            },
            ..Stepping::default()
        });
        let expansion = expansions_from(setup, body, &reference)?;
        setup.once::<ExpansionByTemperature>(body)?;
        Ok(Box::new(RunningThermalExpansion {
            body,
            temperature,
            liquid_fraction: setup.read_if_provided(body, &keys::LIQUID_FRACTION)?,
            birth_temperature: setup.read_if_provided(body, &keys::BIRTH_TEMPERATURE)?,
            sink: Sink::of(setup, body, &expansion)?,
            expansion,
            reference,
            cutoff: self.cutoff_temperature,
        }))
    }
}

impl ThermalExpansion {
    fn known_temperature(
        &self,
        setup: &mut Setup<'_>,
        body: BodyIndex,
    ) -> Result<Temperature, SetupError> {
        let Some(value) = &self.temperature else {
            return Ok(Temperature::Field(setup.read(body, &keys::TEMPERATURE)?));
        };
        let given = GivenValue {
            key: "temperature",
            value,
            column: "temperature",
        };
        let positions = setup.body(body).points.position.to_vec();
        let placed = setup.placed(body, given, positions)?;
        Ok(Temperature::Given(Box::new(placed)))
    }
}

impl RunningCoupler for RunningThermalExpansion {
    fn apply(&mut self, world: &World, step: Step) -> Result<(), RunError> {
        let of_field;
        let temperature: &[f64] = match &mut self.temperature {
            Temperature::Field(field) => {
                of_field = world.read(*field);
                &of_field
            }
            Temperature::Given(placed) => {
                let time = step.end();
                let values = placed.at(time);
                values.map_err(|e| e.during("thermal_expansion", time))?
            }
        };
        let liquid_fraction = world.read_if_provided(self.liquid_fraction);
        let liquid_fraction = liquid_fraction.as_deref();
        let material = &world.body(self.body).material_of_point;
        let cutoff = self.cutoff;
        let birth_temperature = world.read_if_provided(self.birth_temperature);
        let birth_temperature = birth_temperature.as_deref();
        let states = |point: usize| {
            let reference = self.reference[point];
            let free_of_stress = match birth_temperature.map_or(0.0, |t| t[point]) {
                0.0 => reference,
                birth => cutoff.map_or(birth, |cutoff| birth.min(cutoff)),
            };
            let present = match cutoff {
                Some(cutoff) if temperature[point] > cutoff => ThermalState::solid(cutoff),
                _ => ThermalState {
                    temperature: temperature[point],
                    liquid_fraction: liquid_fraction.map_or(0.0, |f| f[point]),
                },
            };
            (ThermalState::solid(free_of_stress), present)
        };
        let expansion = |point: usize| &self.expansion[material[point] as usize];
        let along = |point: usize, axis: usize| {
            let (free_of_stress, present) = states(point);
            expansion(point).along(axis).strain(free_of_stress, present)
        };
        let Sink { mean, rest } = &mut self.sink;
        let mut eigenstrain = world.write(*mean);
        let points = eigenstrain.par_iter_mut().enumerate();
        let Some(rest) = rest else {
            points.for_all(|(point, sum)| *sum += along(point, 0));
            return Ok(());
        };
        rest.axes.follow(&world.read(rest.orientation));
        let mut tensors = world.write(rest.strain);
        let points = points.zip(tensors.par_iter_mut());
        points.for_all(|((point, sum), rest_of_point)| {
            if !expansion(point).has_directions() {
                *sum += along(point, 0);
                return;
            }
            let principal = [0, 1, 2].map(|axis| along(point, axis));
            let mean = principal.iter().sum::<f64>() / 3.0;
            *sum += mean;
            *rest_of_point += tensor(rest.axes.of(point), principal.map(|strain| strain - mean));
        });
        Ok(())
    }
}

perimelt_core::register_coupler!("thermal_expansion", ThermalExpansion, supports: [Births, Cuts, Layers, Division]);

#[cfg(test)]
mod tests;
