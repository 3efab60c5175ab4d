//! The linear law of elasticity, `law.linear`, in all formulations.

use perimelt_core::law::{Constant, LawFacts};
use perimelt_core::{Body, SetupError};
use serde::Serialize;

use super::keys::Formulation;
use super::law::{ElasticLaw, OfBonds, Parts, correspondence};
use super::solid::{Constitution, Solid};
use super::staggered::{self, Springs, Staggered};
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
            Formulation::Correspondence => correspondence(parts, None),
            Formulation::Staggered => {
                staggered(parts.body, parts.constitution, parts.stabilisation)
            }
        }
    }
}

crate::register_elastic_law!("linear", Linear, crate::mechanical::linear::LinearSolids);

/// The staggered solid of a body on a lattice.
fn staggered(
    body: &Body,
    constitution: Constitution,
    stabilisation: Option<f64>,
) -> Result<Box<dyn Solid>, SetupError> {
    let lattice = staggered::lattice(body)?;
    let springs = match (stabilisation, &constitution.plasticity) {
        (Some(factor), _) => Springs::Factor(factor),
        (None, None) => Springs::Bending,
        // elastic springs hold what has yielded beside them (docs/theory/mechanics.md)
        (None, Some(_)) => Springs::Factor(if body.dimension == 3 { 0.2 } else { 0.3 }),
    };
    Ok(match body.dimension {
        1 => Box::new(Staggered::<1>::new(body, lattice, constitution, springs)),
        2 => Box::new(Staggered::<2>::new(body, lattice, constitution, springs)),
        _ => Box::new(Staggered::<3>::new(body, lattice, constitution, springs)),
    })
}
