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
    pub(super) constants: Constants,
    pub(super) limits: Limits,
    /// Of the energies of opening and sliding, if interfaces break by both.
    pub(super) mixed_mode_exponent: Option<f64>,
    /// By point.
    pub(super) unbreakable: Vec<bool>,
    /// Whether a change of the conjugate stress heats the body: breaking bonds must not change it.
    pub(super) heats: bool,
}

/// Strength of a ply.
#[derive(Clone, Copy, Debug)]
pub(super) struct Strength {
    /// Fracture energies of what opens, cracks along the fibres and interfaces, and of interfaces that slide, J/m².
    pub(super) energies: [f64; 2],
    /// Of bonds of the matrix; infinite where it follows from the fracture energy.
    pub(super) critical_stretch: f64,
    /// Of fibres under tension and compression, Pa; infinite where they do not break.
    pub(super) fibres: [f64; 2],
}

pub(super) const CONSTANTS: &[Constant] = &[
    Constant::required("fracture_energy"),
    Constant::required("shear_fracture_energy"),
    Constant::or("critical_stretch", f64::INFINITY),
    Constant::or("tensile_strength_1", f64::INFINITY),
    Constant::or("compressive_strength_1", f64::INFINITY),
];

impl PlyStrength {
    /// Takes the strengths of the materials of a body with plies.
    ///
    /// # Errors
    /// A material without fracture energies, keys of other solids, an unknown region.
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
        if let Some(exponent) = section.mixed_mode_exponent
            && !(0.1..=100.0).contains(&exponent)
        {
            let key = "fracture.mixed_mode_exponent";
            let message = format!("the exponent of the energies is {exponent}");
            return Err(SetupError::value(
                key,
                message,
                "a number from 0.1 to 100, usually 1 or 2",
            ));
        }
        Ok(PlyStrength {
            constants: Constants::of(setup.body(body), "fracture", "fracture", CONSTANTS)?,
            limits: section.limits,
            mixed_mode_exponent: section.mixed_mode_exponent,
            unbreakable: section.unbreakable(setup, body)?,
            heats: setup.is_declared(body, &keys::CONJUGATE_STRESS, Access::Read)
                || setup.is_declared(body, &keys::CONJUGATE_STRESS_TENSOR, Access::Read),
        })
    }

    /// Whether it is the same at all temperatures.
    pub(super) fn is_constant(&self) -> bool {
        !self.constants.depend_on_temperature()
    }

    /// That of a material at a temperature, K.
    pub(super) fn at(&self, material: u16, temperature: f64) -> Strength {
        let mut values = [0.0; CONSTANTS.len()];
        self.constants
            .load(usize::from(material), temperature, 0.0, &mut values);
        let [opening, sliding, critical_stretch, tension, compression] = values;
        Strength {
            energies: [opening, sliding],
            critical_stretch,
            fibres: [tension, compression],
        }
    }
}
