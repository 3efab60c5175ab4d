//! Strength of plies and of the interfaces between them.

use perimelt_core::law::{Constant, Constants};
use perimelt_core::material::ValueRange;
use perimelt_core::world::BodyIndex;
use perimelt_core::{Access, Setup, SetupError, keys, register_property};

use crate::mechanical::fracture::{Criterion, FractureSection, Limits};

register_property!(
    "shear_fracture_energy",
    "J/m²",
    "fracture energy per area of the interface between plies that slide",
    ValueRange::Positive
);
register_property!(
    "tensile_strength_1",
    "Pa",
    "stress along the fibres of a ply at which they break",
    ValueRange::Positive
);
register_property!(
    "compressive_strength_1",
    "Pa",
    "compressive stress along the fibres of a ply at which they break",
    ValueRange::Positive
);

/// Strength of plies, and points whose bonds never break.
#[derive(Clone, Debug)]
pub struct PlyStrength {
    /// Of cracks along the fibres and of interfaces that open, J/m².
    pub(super) fracture_energy: f64,
    /// Of interfaces that slide, J/m².
    pub(super) shear_fracture_energy: f64,
    /// Of bonds of the matrix; infinite where it follows from the fracture energy.
    pub(super) critical_stretch: f64,
    /// Of fibres under tension and compression, Pa; infinite where they do not break.
    pub(super) fibres: [f64; 2],
    pub(super) limits: Limits,
    /// By point.
    pub(super) unbreakable: Vec<bool>,
    /// Whether a change of the conjugate stress heats the body: breaking bonds must not change it.
    pub(super) heats: bool,
}

const CONSTANTS: &[Constant] = &[
    Constant::required("fracture_energy"),
    Constant::required("shear_fracture_energy"),
    Constant::or("critical_stretch", f64::INFINITY),
    Constant::or("tensile_strength_1", f64::INFINITY),
    Constant::or("compressive_strength_1", f64::INFINITY),
];

impl PlyStrength {
    /// Takes the strengths of the material of a body with plies.
    ///
    /// # Errors
    /// A material without fracture energies or with strengths that depend on the temperature, keys of other solids, an unknown region.
    pub(in crate::mechanical) fn of(
        section: &FractureSection,
        setup: &Setup<'_>,
        body: BodyIndex,
    ) -> Result<Self, SetupError> {
        if section.criterion == Criterion::Energy {
            let message =
                "bonds of plies break by their stretch, and those between plies by the shear angle";
            return Err(SetupError::value(
                "fracture.criterion",
                message,
                "\"stretch\"",
            ));
        }
        if !section.interface.0.is_empty() {
            let message = "`interface` is one between materials; plies have the strength of their material between them";
            let expected = "`fracture_energy` and `shear_fracture_energy` of the material";
            return Err(SetupError::value("fracture.interface", message, expected));
        }
        let this = setup.body(body);
        let constants = Constants::of(this, "fracture", "fracture", CONSTANTS)?;
        let values = constants.common().map_err(|constant| {
            let property = CONSTANTS[constant].property;
            let message = format!("`{property}` is not one number for body `{}`", this.name);
            let expected = "the same number at all temperatures for all plies";
            SetupError::value("fracture", message, expected)
        })?;
        let [opening, sliding, stretch, tension, compression] = values[..] else {
            unreachable!("as many values as constants");
        };
        Ok(PlyStrength {
            fracture_energy: opening,
            shear_fracture_energy: sliding,
            critical_stretch: stretch,
            fibres: [tension, compression],
            limits: section.limits,
            unbreakable: section.unbreakable(setup, body)?,
            heats: setup.is_declared(body, &keys::CONJUGATE_STRESS, Access::Read)
                || setup.is_declared(body, &keys::CONJUGATE_STRESS_TENSOR, Access::Read),
        })
    }
}
