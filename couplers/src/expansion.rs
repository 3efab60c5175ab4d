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
use perimelt_core::material::{Directional, Expansion, ThermalState};
use perimelt_core::numbers::check_above;
use perimelt_core::orientation::{PointAxes, tensor};
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
    /// Temperature above which the body expands no further (K), where it has lost its strength.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cutoff_temperature: Option<f64>,
}

/// An expansion that is ready to act.
struct RunningThermalExpansion {
    body: usize,
    /// Expansion by material.
    expansion: Vec<Directional<Expansion>>,
    temperature: Read<f64>,
    liquid_fraction: ReadIfProvided<f64>,
    /// Temperature at birth, K; zero at points that exist from the start.
    birth_temperature: ReadIfProvided<f64>,
    sink: Sink,
    /// Reference temperature at each point, K.
    reference: Vec<f64>,
    /// Cut-off temperature, K.
    cutoff: Option<f64>,
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
        let positions = setup.body(body).points.position.clone();
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
        setup.stepping(Stepping {
            is_steady: true,
            ..Stepping::default()
        });
        let expansion = expansions_from(setup, body, &reference)?;
        Ok(Box::new(RunningThermalExpansion {
            body,
            temperature: setup.read(body, &keys::TEMPERATURE)?,
            liquid_fraction: setup.read_if_provided(body, &keys::LIQUID_FRACTION)?,
            birth_temperature: setup.read_if_provided(body, &keys::BIRTH_TEMPERATURE)?,
            sink: Sink::of(setup, body, &expansion)?,
            expansion,
            reference,
            cutoff: self.cutoff_temperature,
        }))
    }
}

impl RunningCoupler for RunningThermalExpansion {
    fn apply(&mut self, world: &World, _step: Step) -> Result<(), RunError> {
        let temperature: &[f64] = &world.read(self.temperature);
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
            points.for_each(|(point, sum)| *sum += along(point, 0));
            return Ok(());
        };
        rest.axes.follow(&world.read(rest.orientation));
        let mut tensors = world.write(rest.strain);
        let points = points.zip(tensors.par_iter_mut());
        points.for_each(|((point, sum), rest_of_point)| {
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

perimelt_core::register_coupler!("thermal_expansion", ThermalExpansion, supports: [Births, Cuts]);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{STEEL, apply, block, prepare, read, refusal, set, values};

    #[test]
    fn strain_is_the_secant_coefficient_at_the_temperature_times_the_rise() {
        let mut world = World::new(vec![block([3, 1, 1], 1, STEEL)]);
        let expansion: ThermalExpansion = read("reference_temperature = 300");
        let (mut expansion, ()) = prepare(&mut world, expansion, |setup| {
            setup.own(0, &keys::TEMPERATURE).expect("free");
            setup.consume(0, &keys::EIGENSTRAIN).expect("free");
        })
        .expect("valid");
        set(&mut world, &keys::TEMPERATURE, |i| [200.0, 300.0, 800.0][i]);
        set(&mut world, &keys::EIGENSTRAIN, |_| 1.0);
        apply(&world, &mut *expansion, 0.0);
        // 15e-6 half way through the table, 10e-6 below it; added to what was there
        let expected = [1.0 - 10e-6 * 100.0, 1.0, 1.0 + 15e-6 * 500.0];
        for (strain, expected) in values(&world, &keys::EIGENSTRAIN).iter().zip(expected) {
            assert!((strain - expected).abs() < 1e-15, "rounding of 1");
        }
    }

    /// A bar of EN 1993-1-2 steel, e(T) = alpha(T) (T - 293.15 K), that is free of stress at another temperature: heated from
    /// there, with a cut-off, and deposited. The table is exact at the rows.
    #[test]
    fn mean_coefficients_count_from_their_own_reference_temperature() {
        let metal = "thermal_expansion = { temperature = [473, 873, 1273], value = [12.88e-6, 14.48e-6, 14.08e-6] }\nexpansion_reference = 293.15";
        let elongation = |t: f64| {
            let coefficient = [(473.0, 12.88e-6), (873.0, 14.48e-6), (1273.0, 14.08e-6)];
            let row = coefficient.iter().find(|row| row.0 == t).expect("a row");
            row.1 * (t - 293.15)
        };
        let mut world = World::new(vec![block([4, 1, 1], 1, metal)]);
        let keys_given = "reference_temperature = 473\ncutoff_temperature = 1273";
        let expansion: ThermalExpansion = read(keys_given);
        let (mut expansion, ()) = prepare(&mut world, expansion, |setup| {
            setup.own(0, &keys::TEMPERATURE).expect("free");
            setup.own(0, &keys::BIRTH_TEMPERATURE).expect("free");
            setup.consume(0, &keys::EIGENSTRAIN).expect("free");
        })
        .expect("valid");
        set(&mut world, &keys::TEMPERATURE, |i| {
            [473.0, 873.0, 1900.0, 873.0][i]
        });
        set(&mut world, &keys::BIRTH_TEMPERATURE, |i| {
            [0.0, 0.0, 0.0, 1900.0][i]
        });
        apply(&world, &mut *expansion, 0.0);
        let expected = [
            (473.0, 473.0),
            (473.0, 873.0),
            (473.0, 1273.0),
            (1273.0, 873.0),
        ];
        let found = values(&world, &keys::EIGENSTRAIN);
        for (found, (from, to)) in found.iter().zip(expected) {
            let expected = elongation(to) - elongation(from);
            assert!((found - expected).abs() < 1e-16, "{from} to {to}: {found}");
        }
    }

    #[test]
    fn the_reference_temperature_may_depend_on_the_place() {
        let mut world = World::new(vec![block([3, 1, 1], 1, "thermal_expansion = 1e-5")]);
        let expansion: ThermalExpansion = read("reference_temperature = '300 + 100 * x'");
        let (mut expansion, ()) = prepare(&mut world, expansion, |setup| {
            setup.own(0, &keys::TEMPERATURE).expect("free");
            setup.consume(0, &keys::EIGENSTRAIN).expect("free");
        })
        .expect("valid");
        set(&mut world, &keys::TEMPERATURE, |_| 600.0);
        apply(&world, &mut *expansion, 0.0);
        // points at x = 0.5, 1.5, 2.5 m
        for (strain, expected) in values(&world, &keys::EIGENSTRAIN)
            .iter()
            .zip([2.5e-3, 1.5e-3, 0.5e-3])
        {
            assert!((strain - expected).abs() < 1e-15, "{strain} {expected}");
        }
        let expansion: ThermalExpansion = read("reference_temperature = '300 + t'");
        assert!(refusal(&mut world, expansion).contains("changes in time"));
    }

    /// -1e-6/K along fibres at 30 degrees and 3e-5/K across, free of stress at 300 K or, where it was deposited, at 500 K; a
    /// metal beside it.
    #[test]
    fn expansions_along_axes_turn_with_the_orientation() {
        let mut body = block(
            [4, 1, 1],
            3,
            "thermal_expansion = { along = -1e-6, across = 3e-5 }",
        );
        let metal = block([1, 1, 1], 3, "thermal_expansion = 1e-5");
        body.materials.extend(metal.materials);
        body.material_of_point[3] = 1;
        let mut world = World::new(vec![body]);
        let expansion: ThermalExpansion = read("reference_temperature = 300");
        let (mut expansion, ()) = prepare(&mut world, expansion, |setup| {
            setup.own(0, &keys::TEMPERATURE).expect("free");
            setup.own(0, &keys::BIRTH_TEMPERATURE).expect("free");
            setup.own(0, &keys::ORIENTATION).expect("free");
            setup.consume(0, &keys::EIGENSTRAIN).expect("free");
            setup.consume(0, &keys::EIGENSTRAIN_TENSOR).expect("free");
        })
        .expect("valid");
        set(&mut world, &keys::TEMPERATURE, |_| 400.0);
        set(&mut world, &keys::BIRTH_TEMPERATURE, |i| {
            [0.0, 0.0, 500.0, 0.0][i]
        });
        let turn = Vector3::new(0.0, 0.0, 30_f64.to_radians());
        set(&mut world, &keys::ORIENTATION, |i| {
            [Vector3::zeros(), turn, turn, turn][i]
        });
        apply(&world, &mut *expansion, 0.0);
        let (mean, rest) = (
            values(&world, &keys::EIGENSTRAIN),
            values(&world, &keys::EIGENSTRAIN_TENSOR),
        );
        let (xx, yy) = (0.75 * -1e-4 + 0.25 * 3e-3, 0.25 * -1e-4 + 0.75 * 3e-3);
        let xy = -3.1e-3 * 0.75_f64.sqrt() * 0.5;
        for (point, [a, b, c, d]) in [
            [-1e-4, 0.0, 3e-3, 3e-3],
            [xx, xy, yy, 3e-3],
            [-xx, -xy, -yy, -3e-3],
            [1e-3, 0.0, 1e-3, 1e-3],
        ]
        .into_iter()
        .enumerate()
        {
            let expected = [a, b, 0.0, b, c, 0.0, 0.0, 0.0, d];
            let rest = &rest[9 * point..][..9];
            assert!((rest[0] + rest[4] + rest[8]).abs() < 1e-17);
            for (i, (rest, expected)) in rest.iter().zip(expected).enumerate() {
                let found = rest + if i % 4 == 0 { mean[point] } else { 0.0 };
                assert!(
                    (found - expected).abs() < 1e-17,
                    "{point}: {found} {expected}"
                );
            }
        }
    }

    #[test]
    fn expansion_ends_at_the_cutoff() {
        let mut world = World::new(vec![block([3, 1, 1], 1, STEEL)]);
        let expansion: ThermalExpansion =
            read("reference_temperature = 300\ncutoff_temperature = 800");
        let (mut expansion, ()) = prepare(&mut world, expansion, |setup| {
            setup.own(0, &keys::TEMPERATURE).expect("free");
            setup.consume(0, &keys::EIGENSTRAIN).expect("free");
        })
        .expect("valid");
        set(&mut world, &keys::TEMPERATURE, |i| {
            [300.0, 800.0, 2800.0][i]
        });
        apply(&world, &mut *expansion, 0.0);
        let strain = values(&world, &keys::EIGENSTRAIN);
        assert_eq!(strain[0], 0.0);
        assert!(strain[1] > 0.0);
        assert_eq!(strain[1], strain[2]);
    }

    /// Material is free of stress at the temperature at which it was deposited, or at the cut-off where it was hotter. The
    /// coefficient is 1e-5 in the solid and 3e-5 in the liquid.
    #[test]
    fn deposited_material_is_free_of_stress_at_its_birth() {
        let metal = "thermal_expansion = { solid = 1e-5, liquid = 3e-5 }";
        for (cutoff, expected) in [
            ("", [5e-3, 5e-3 - 7e-3, 0.0, 0.5 * 4e-5 * 1000.0 - 7e-3]),
            // above the cut-off as the solid at it
            ("\ncutoff_temperature = 900", [5e-3, 5e-3 - 6e-3, 0.0, 0.0]),
        ] {
            let mut world = World::new(vec![block([4, 1, 1], 1, metal)]);
            let expansion: ThermalExpansion = read(&format!("reference_temperature = 300{cutoff}"));
            let (mut expansion, ()) = prepare(&mut world, expansion, |setup| {
                setup.own(0, &keys::TEMPERATURE).expect("free");
                setup.own(0, &keys::LIQUID_FRACTION).expect("free");
                setup.own(0, &keys::BIRTH_TEMPERATURE).expect("free");
                setup.consume(0, &keys::EIGENSTRAIN).expect("free");
            })
            .expect("valid");
            set(&mut world, &keys::TEMPERATURE, |i| {
                [800.0, 800.0, 1000.0, 1300.0][i]
            });
            set(&mut world, &keys::LIQUID_FRACTION, |i| {
                [0.0, 0.0, 0.0, 0.5][i]
            });
            // there from the start, or deposited at 1000 K
            set(&mut world, &keys::BIRTH_TEMPERATURE, |i| {
                [0.0, 1000.0, 1000.0, 1000.0][i]
            });
            apply(&world, &mut *expansion, 0.0);
            let found = values(&world, &keys::EIGENSTRAIN);
            for (found, expected) in found.iter().zip(expected) {
                assert!(
                    (found - expected).abs() < 1e-15,
                    "{cutoff}: {found} {expected}"
                );
            }
        }
    }

    #[test]
    fn a_cutoff_below_the_reference_is_refused() {
        let mut world = World::new(vec![block([3, 1, 1], 1, STEEL)]);
        for cutoff in ["293", "300", "nan"] {
            let table = format!("reference_temperature = 300\ncutoff_temperature = {cutoff}");
            let expansion: ThermalExpansion = read(&table);
            let message = refusal(&mut world, expansion);
            assert!(
                message.contains("expected a number above 300 K"),
                "{message}"
            );
        }
    }

    #[test]
    fn a_material_without_expansion_is_named() {
        let mut world = World::new(vec![block([3, 1, 1], 1, "density = 1")]);
        let expansion: ThermalExpansion = read("reference_temperature = 300");
        let message = refusal(&mut world, expansion);
        assert!(message.contains("material `steel` of body `block` has no `thermal_expansion`"));
    }
}
