//! J2 plasticity with isotropic hardening:
//! `flow stress = yield_stress(T) h(p) + hardening_modulus(T) p`, h a table.

use perimelt_core::SetupError;
use perimelt_core::law::Constant;
use perimelt_core::material::Table;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::law::{EquivalentStrain, FlowPoint, FlowStressLaw};

/// J2 plasticity (von Mises) with isotropic hardening.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct J2 {
    /// Flow stress over yield stress by equivalent plastic strain.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hardening: Option<HardeningTable>,
    /// h(p).
    #[serde(skip)]
    pub(super) table: Option<Table>,
}

/// Rows of a hardening curve; beyond the last row the flow stress is constant.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HardeningTable {
    /// Equivalent plastic strain, increasing from 0.
    pub plastic_strain: Vec<f64>,
    /// Flow stress over the yield stress at the same temperature; never falling.
    pub factor: Vec<f64>,
}

impl HardeningTable {
    /// The table.
    ///
    /// # Errors
    /// It falls, or does not start at 0.
    pub(super) fn table(&self) -> Result<Table, SetupError> {
        let Self {
            plastic_strain,
            factor,
        } = self;
        let falls = factor.windows(2).any(|w| w[1] < w[0]);
        if falls || plastic_strain.first() != Some(&0.0) {
            return Err(SetupError::value(
                "hardening",
                "the hardening curve falls or does not start at 0",
                "`plastic_strain` increasing from 0, `factor` never falling",
            ));
        }
        Table::new(plastic_strain.clone(), factor.clone())
            .map_err(|e| SetupError::other("hardening", e))
    }
}

impl FlowStressLaw for J2 {
    const CONSTANTS: &'static [Constant] = &[
        Constant::required("yield_stress"),
        Constant::or("hardening_modulus", 0.0),
    ];

    fn prepare(&mut self) -> Result<(), SetupError> {
        self.table = match &self.hardening {
            Some(hardening) => Some(hardening.table()?),
            None => None,
        };
        Ok(())
    }

    #[inline(always)]
    fn flow_stress(&self, point: &FlowPoint<'_>, strain: EquivalentStrain) -> f64 {
        let factor = self.table.as_ref().map_or(1.0, |t| t.at(strain.end));
        point.constants[0] * factor + point.constants[1] * strain.end
    }

    fn hardening(&self, point: &FlowPoint<'_>, strain: EquivalentStrain) -> f64 {
        let slope = self.table.as_ref().map_or(0.0, |t| t.slope(strain.end));
        point.constants[0] * slope + point.constants[1]
    }

    fn scale(&self, point: &FlowPoint<'_>) -> f64 {
        point.constants[0]
    }
}

crate::register_flow_stress_law!("j2", J2);
