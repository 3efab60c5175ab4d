//! The keys of plastic flow: `flow`, or its short form `plasticity`, and the temperature of annealing.

use perimelt_core::SetupError;
use perimelt_core::law::Law;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::j2::{HardeningTable, J2};
use super::rule::Radial;
use super::sweep::FlowSweep;

/// Plastic flow by the material properties `yield_stress` and, if given, `hardening_modulus`: the short form of `flow.j2` and
/// `annealing_temperature`.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PlasticitySection {
    /// Temperature (K) at and above which a point loses its stress and its hardening; default never.
    #[schemars(extend("exclusiveMinimum" = 0))]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub annealing_temperature: Option<f64>,
    /// Flow stress over yield stress by equivalent plastic strain.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hardening: Option<HardeningTable>,
}

/// The law of flow of a body, with the keys that chose it.
#[derive(Debug)]
pub(in crate::mechanical) struct ChosenFlow {
    pub(super) law: Law<dyn FlowSweep>,
    /// Key of the law's table.
    pub(super) key: String,
    pub(super) annealing: Option<Annealing>,
}

/// A temperature of annealing, K, with its key.
#[derive(Clone, Copy, Debug)]
pub(super) struct Annealing {
    pub(super) limit: f64,
    key: &'static str,
}

impl ChosenFlow {
    /// The law that the keys of a physics choose; `None` for an elastic body.
    ///
    /// # Errors
    /// Both forms at once, an annealing temperature without flow or not above 0 K.
    pub(in crate::mechanical) fn of(
        short: Option<PlasticitySection>,
        flow: Option<Law<dyn FlowSweep>>,
        annealing_temperature: Option<f64>,
    ) -> Result<Option<Self>, SetupError> {
        let annealed = |limit: Option<f64>, key| limit.map(|limit| Annealing { limit, key });
        let chosen = match (short, flow) {
            (Some(_), Some(law)) => {
                let message = format!("the law `{}` stands beside `plasticity`", law.name);
                let expected = "`flow` and `annealing_temperature`, or `plasticity` alone";
                return Err(SetupError::value("flow", message, expected));
            }
            (Some(_), None) if annealing_temperature.is_some() => {
                let message = "`annealing_temperature` stands beside `plasticity`";
                let expected = "`plasticity.annealing_temperature`";
                return Err(SetupError::value(
                    "annealing_temperature",
                    message,
                    expected,
                ));
            }
            (None, None) if annealing_temperature.is_some() => {
                let message = "an elastic body does not anneal";
                let expected = "a law of flow, such as `flow.j2 = {}`";
                return Err(SetupError::value(
                    "annealing_temperature",
                    message,
                    expected,
                ));
            }
            (None, None) => return Ok(None),
            (Some(section), None) => ChosenFlow {
                law: Law {
                    name: "j2",
                    law: Box::new(Radial::from(J2 {
                        hardening: section.hardening,
                        table: None,
                    })),
                },
                key: "plasticity".into(),
                annealing: annealed(
                    section.annealing_temperature,
                    "plasticity.annealing_temperature",
                ),
            },
            (None, Some(law)) => ChosenFlow {
                key: law.key(),
                law,
                annealing: annealed(annealing_temperature, "annealing_temperature"),
            },
        };
        match chosen.annealing {
            Some(Annealing { limit, key }) if limit <= 0.0 => {
                let message = format!("the annealing temperature is {limit} K");
                Err(SetupError::value(key, message, "a temperature above 0 K"))
            }
            _ => Ok(Some(chosen)),
        }
    }

    /// The table of the law.
    pub(in crate::mechanical) fn key(&self) -> &str {
        &self.key
    }
}
