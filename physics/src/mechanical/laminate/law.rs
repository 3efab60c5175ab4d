//! The law of plies, `law.lamina`.

use perimelt_core::law::{Constant, LawFacts};
use perimelt_core::material::ValueRange;
use perimelt_core::{Body, SetupError, register_property};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Laminate;
use super::constants::PlyPoints;
use crate::mechanical::keys::Formulation;
use crate::mechanical::law::{ElasticLaw, Parts};
use crate::mechanical::solid::Solid;

register_property!(
    "youngs_modulus_1",
    "Pa",
    "Young's modulus of a ply along its fibres",
    ValueRange::Positive
);
register_property!(
    "youngs_modulus_2",
    "Pa",
    "Young's modulus of a ply across its fibres",
    ValueRange::Positive
);
register_property!(
    "youngs_modulus_3",
    "Pa",
    "Young's modulus through the thickness of a ply",
    ValueRange::Positive
);
register_property!(
    "poissons_ratio_12",
    "1",
    "contraction of a ply across its fibres over the strain along them, under stress along them",
    ValueRange::Any
);
register_property!(
    "shear_modulus_12",
    "Pa",
    "shear modulus of a ply in its plane",
    ValueRange::Positive
);
register_property!(
    "shear_modulus_13",
    "Pa",
    "shear modulus of a ply between its fibres and its thickness",
    ValueRange::Positive
);
register_property!(
    "shear_modulus_23",
    "Pa",
    "shear modulus of a ply between the direction across its fibres and its thickness",
    ValueRange::Positive
);

/// Plies of a `layup`, each with a stiffness along its fibres and another one across them; between plies they resist opening
/// and shear.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Lamina {}

/// Laminates.
#[derive(Debug, Serialize)]
#[serde(transparent)]
pub struct OfPlies(Lamina);

impl From<Lamina> for OfPlies {
    fn from(law: Lamina) -> Self {
        OfPlies(law)
    }
}

/// In the order of [`PlyConstants`](super::constants::PlyConstants).
pub(super) const CONSTANTS: &[Constant] = &[
    Constant::required("youngs_modulus_1"),
    Constant::required("youngs_modulus_2"),
    Constant::required("poissons_ratio_12"),
    Constant::required("shear_modulus_12"),
    Constant::required("shear_modulus_13"),
    Constant::required("shear_modulus_23"),
    Constant::required("youngs_modulus_3"),
];

impl OfPlies {
    /// The formulations that the law serves.
    pub const FORMULATIONS: &'static [Formulation] = &[Formulation::Bond];

    /// What `perimelt explain` says besides the keys.
    pub const FACTS: LawFacts = LawFacts {
        constants: CONSTANTS,
        state: &[],
        others: &[
            (
                "tangent",
                "constant at a temperature; differences of forces in finite kinematics",
            ),
            ("bodies", "those with a `layup`"),
            ("formulations", "bond"),
        ],
    };
}

impl ElasticLaw for OfPlies {
    fn constants(&self) -> &'static [Constant] {
        CONSTANTS
    }

    fn is_linear(&self) -> bool {
        true
    }

    fn is_of_plies(&self) -> bool {
        true
    }

    /// The largest one, for bounds.
    fn youngs_modulus(&self) -> Option<&'static str> {
        Some("youngs_modulus_1")
    }

    fn prepare(&mut self) -> Result<(), SetupError> {
        Ok(())
    }

    fn solid(self: Box<Self>, parts: Parts<'_>) -> Result<Box<dyn Solid>, SetupError> {
        let Parts {
            body,
            family,
            constitution,
            constants,
            ..
        } = parts;
        let Some(layers) = body.layers() else {
            return Err(no_layup(body));
        };
        if layers.layers().len() == 1 && !constitution.in_motion {
            let message = format!(
                "body `{}` is one layer of points, which does not resist bending",
                body.name
            );
            let expected =
                "two stations (`layup.stations`) or two plies or more, or `solver.explicit`";
            return Err(SetupError::value("solver", message, expected));
        }
        let plies = PlyPoints::new(body, constants)?;
        let laminate = Laminate::new(body, layers, family, constitution, plies)?;
        Ok(Box::new(laminate))
    }
}

/// The mistake of a body without plies.
pub(in crate::mechanical) fn no_layup(body: &Body) -> SetupError {
    let message = format!("body `{}` has no plies", body.name);
    let expected = "a body with a `layup`, or another law";
    SetupError::value("law.lamina", message, expected)
}

crate::register_elastic_law!("lamina", Lamina, crate::mechanical::laminate::OfPlies);
