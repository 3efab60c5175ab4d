//! Constants of plies, by material and temperature.

use nalgebra::Matrix2;
use perimelt_core::law::Constants;
use perimelt_core::{Body, SetupError};
use rayon::prelude::*;

use super::law::CONSTANTS;
use super::weights::PlyStiffness;
use crate::mechanical::law_states::visit_states;
use crate::plies::turned;

/// Constants of a ply.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PlyConstants {
    pub(super) ply: PlyStiffness,
    /// Shear moduli between the thickness and the directions along and across the fibres, Pa.
    pub(super) shear_across: [f64; 2],
    /// Young's modulus through the thickness, Pa.
    pub(super) modulus_across: f64,
}

/// Number of constants.
const COUNT: usize = CONSTANTS.len();

impl From<[f64; COUNT]> for PlyConstants {
    fn from([e1, e2, nu12, g12, g13, g23, e3]: [f64; COUNT]) -> Self {
        PlyConstants {
            ply: PlyStiffness {
                moduli: [e1, e2],
                poissons_ratio: nu12,
                shear: g12,
            },
            shear_across: [g13, g23],
            modulus_across: e3,
        }
    }
}

impl PlyConstants {
    /// Shear compliance between the thickness and the directions x and y of a ply with fibres along a unit vector, 1/Pa.
    pub(super) fn shear_compliance(&self, fibre: [f64; 2]) -> Matrix2<f64> {
        turned(fibre, self.shear_across.map(|modulus| 1.0 / modulus))
    }

    /// The largest factor by which a modulus is above that of `before`; that of the modulus along the fibres is left out.
    fn rise_from(&self, before: &PlyConstants) -> f64 {
        let moduli = |c: &PlyConstants| {
            let [along, across] = c.shear_across;
            [
                c.ply.moduli[1],
                c.ply.shear,
                along,
                across,
                c.modulus_across,
            ]
        };
        let both = moduli(self).into_iter().zip(moduli(before));
        both.map(|(now, before)| now / before).fold(1.0, f64::max)
    }
}

/// Constants of a material at a temperature at which its tables have values.
#[derive(Clone, Debug)]
pub(super) struct PlyState {
    pub(super) constants: PlyConstants,
    /// The material, and the temperature if the constants depend on it.
    pub(super) name: String,
}

/// The constants of plies at the points of a body.
#[derive(Debug)]
pub(super) struct PlyPoints {
    constants: Constants,
    /// Those of all materials at the temperatures of their tables.
    pub(super) states: Vec<PlyState>,
    /// Whether they are the same at all points at any temperature.
    pub(super) is_uniform: bool,
    pub(super) by_point: Vec<PlyConstants>,
}

impl PlyPoints {
    /// Those of the materials of a body, at the lowest temperature of their tables.
    ///
    /// # Errors
    /// A stiffness by which a strain would release energy, at a temperature of the tables.
    pub(super) fn new(body: &Body, constants: Constants) -> Result<Self, SetupError> {
        let mut states = Vec::new();
        visit_states(body, &constants, COUNT, |values, name| {
            let values = std::array::from_fn(|constant| values[constant]);
            let state = PlyState {
                constants: PlyConstants::from(values),
                name: name.to_owned(),
            };
            check(&state)?;
            states.push(state);
            Ok(())
        })?;
        let mut points = PlyPoints {
            is_uniform: constants.common().is_ok(),
            by_point: vec![states[0].constants; body.points.len()],
            constants,
            states,
        };
        points.set(body, None);
        Ok(points)
    }

    /// The constants of a material at a temperature, K.
    fn at(&self, material: u16, temperature: f64) -> PlyConstants {
        let mut values = [0.0; COUNT];
        self.constants
            .load(usize::from(material), temperature, 0.0, &mut values);
        PlyConstants::from(values)
    }

    /// Takes the temperature of each point, K. `None` if no constant changed, else the largest factor by which one of them rose; that of
    /// the modulus along the fibres is left out.
    pub(super) fn set(&mut self, body: &Body, temperature: Option<&[f64]>) -> Option<f64> {
        if self.is_uniform {
            return None;
        }
        let mut by_point = std::mem::take(&mut self.by_point);
        let points = by_point.par_iter_mut().zip(&body.material_of_point);
        let set = |(point, (own, &material)): (usize, (&mut PlyConstants, &u16))| {
            let before = *own;
            *own = self.at(material, temperature.map_or(0.0, |t| t[point]));
            (*own != before).then(|| own.rise_from(&before))
        };
        let rises = points.enumerate().map(set);
        let rise = rises.reduce(
            || None,
            |a, b| a.map_or(b, |a| Some(b.map_or(a, |b| a.max(b)))),
        );
        self.by_point = by_point;
        rise
    }
}

/// Refuses a stiffness that is not positive.
fn check(state: &PlyState) -> Result<(), SetupError> {
    let ply = state.constants.ply;
    if ply.is_positive() {
        return Ok(());
    }
    let ([e1, e2], nu12) = (ply.moduli, ply.poissons_ratio);
    let most = (e1 / e2).sqrt();
    let message = format!(
        "{} has `poissons_ratio_12` = {nu12} with `youngs_modulus_1` = {e1} and `youngs_modulus_2` = {e2}: some strains would \
         release energy",
        state.name
    );
    let expected = format!("a value between -{most:.4} and {most:.4}");
    Err(SetupError::value("law.lamina", message, expected))
}
