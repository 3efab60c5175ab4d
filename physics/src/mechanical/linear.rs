//! The linear law of elasticity, `law.linear`, in all formulations.

use perimelt_core::SetupError;
use perimelt_core::law::{Constant, LawFacts};
use serde::Serialize;

use super::keys::Formulation;
use super::law::{ElasticLaw, OfBonds, Parts, with_strains};
use super::solid::Solid;
use super::stretch::Linear;

/// Solids of the linear law.
#[derive(Debug, Serialize)]
#[serde(transparent)]
pub struct LinearSolids(OfBonds<Linear>);

impl LinearSolids {
    /// The formulations that the law serves.
    pub const FORMULATIONS: &'static [Formulation] = &[
        Formulation::Bond,
        Formulation::Ordinary,
        Formulation::Correspondence,
        Formulation::Staggered,
    ];

    /// What `perimelt explain` says besides the keys.
    pub const FACTS: LawFacts = LawFacts {
        constants: &[],
        state: &[],
        others: &[
            (
                "tangent",
                "constant; differences of forces in finite kinematics",
            ),
            ("formulations", "bond, ordinary, correspondence, staggered"),
        ],
    };
}

impl From<Linear> for LinearSolids {
    fn from(law: Linear) -> Self {
        LinearSolids(law.into())
    }
}

impl ElasticLaw for LinearSolids {
    fn constants(&self) -> &'static [Constant] {
        &[]
    }

    fn is_linear(&self) -> bool {
        true
    }

    fn prepare(&mut self) -> Result<(), SetupError> {
        Ok(())
    }

    fn solid(self: Box<Self>, parts: Parts<'_>) -> Result<Box<dyn Solid>, SetupError> {
        match parts.formulation {
            Formulation::Bond | Formulation::Ordinary => Box::new(self.0).solid(parts),
            Formulation::Correspondence | Formulation::Staggered => with_strains(parts, None),
        }
    }
}

crate::register_elastic_law!("linear", Linear, crate::mechanical::linear::LinearSolids);
