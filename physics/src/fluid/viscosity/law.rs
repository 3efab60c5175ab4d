//! Laws of viscosity as plugins: [`ViscosityLaw`].
//!
//! A law is the struct of its keys in the case file, `viscosity.<name> = { keys }`. Constants are properties of materials,
//! evaluated at the temperature and the liquid fraction of each point. Points, forms of the equations and the shear rate
//! are not the law's business.

use std::fmt::Debug;

use perimelt_core::SetupError;
use perimelt_core::law::{Constant, Constants, LawFacts};
use perimelt_core::material::EnthalpyCurve;
use perimelt_core::parallel::ParallelLoop;
use rayon::prelude::*;
use serde::Serialize;

use crate::fluid::rates::POINTS_PER_TASK;

/// Most constants of a law.
const MOST_CONSTANTS: usize = 8;

/// A law of viscosity: the viscosity of a point in a step.
pub trait ViscosityLaw: Clone + Debug + Send + Sync + Serialize + 'static {
    /// Properties of materials that the law needs, at most eight.
    const CONSTANTS: &'static [Constant];
    /// Whether the viscosity depends on the shear rate, which is computed then, at the cost of a pass over the bonds.
    const NEEDS_SHEAR_RATE: bool;

    /// Checks the keys.
    ///
    /// # Errors
    /// A value that makes no sense; the key of the error begins behind the name of the law.
    fn check(&self) -> Result<(), SetupError> {
        Ok(())
    }

    /// Viscosity (Pa s), from the constants in the order of their declaration and the shear rate `sqrt(2 D : D)` (1/s), D the
    /// symmetric part of the velocity gradient; the shear rate is zero for laws that do not need it.
    fn viscosity(&self, constants: &[f64], shear_rate: f64) -> f64;

    /// Largest viscosity (Pa s) of a material, on which the stable step depends, from the largest value of each constant.
    fn largest(&self, constants: &[f64]) -> f64;
}

/// What the viscosity of the points of a body depends on in a step.
#[derive(Clone, Copy)]
pub struct ViscousPoints<'a> {
    pub(super) constants: &'a Constants,
    /// Material of each point.
    pub(super) material: &'a [u16],
    /// Temperature of each point (K), and the enthalpy curve of each material; `None` where all constants are numbers.
    pub(super) temperature: Option<(&'a [f64], &'a [EnthalpyCurve])>,
    /// By point, 1/s; empty for a law that does not need it.
    pub(super) shear_rate: &'a [f64],
}

/// A law of viscosity, swept over the points of a body: one dynamic call for all points.
pub trait ViscositySweep: Debug + Send + Sync + erased_serde::Serialize {
    /// See [`ViscosityLaw::CONSTANTS`].
    fn constants(&self) -> &'static [Constant];

    /// See [`ViscosityLaw::NEEDS_SHEAR_RATE`].
    fn needs_shear_rate(&self) -> bool;

    /// See [`ViscosityLaw::check`].
    ///
    /// # Errors
    /// Errors of the law.
    fn check(&self) -> Result<(), SetupError>;

    /// See [`ViscosityLaw::largest`].
    fn largest(&self, constants: &[f64]) -> f64;

    /// Sets the viscosity of each point, Pa s.
    fn evaluate(&self, points: ViscousPoints<'_>, viscosity: &mut [f64]);

    /// A copy.
    fn copy(&self) -> Box<dyn ViscositySweep>;
}

erased_serde::serialize_trait_object!(ViscositySweep);

impl Clone for Box<dyn ViscositySweep> {
    fn clone(&self) -> Self {
        (**self).copy()
    }
}

impl<L: ViscosityLaw> ViscositySweep for L {
    fn constants(&self) -> &'static [Constant] {
        L::CONSTANTS
    }

    fn needs_shear_rate(&self) -> bool {
        L::NEEDS_SHEAR_RATE
    }

    fn check(&self) -> Result<(), SetupError> {
        ViscosityLaw::check(self)
    }

    fn largest(&self, constants: &[f64]) -> f64 {
        ViscosityLaw::largest(self, constants)
    }

    fn evaluate(&self, points: ViscousPoints<'_>, viscosity: &mut [f64]) {
        const { assert!(L::CONSTANTS.len() <= MOST_CONSTANTS) };
        let values = viscosity.par_iter_mut().zip(points.material).enumerate();
        values
            .with_min_len(POINTS_PER_TASK)
            .for_all(|(i, (value, &m))| {
                let mut constants = [0.0; MOST_CONSTANTS];
                let constants = &mut constants[..L::CONSTANTS.len()];
                let (temperature, liquid) = points.temperature.map_or((0.0, 0.0), |(t, curves)| {
                    (t[i], curves[m as usize].liquid_fraction(t[i]))
                });
                points
                    .constants
                    .load(m as usize, temperature, liquid, constants);
                let shear_rate = match L::NEEDS_SHEAR_RATE {
                    true => points.shear_rate[i],
                    false => 0.0,
                };
                *value = self.viscosity(constants, shear_rate);
            });
    }

    fn copy(&self) -> Box<dyn ViscositySweep> {
        Box::new(self.clone())
    }
}

perimelt_core::law_kind! {
    /// A registered law of viscosity.
    pub ViscosityRegistration, dyn ViscositySweep, "viscosity"
}

/// What `perimelt explain` says about a law besides its keys.
pub const fn facts<L: ViscosityLaw>() -> LawFacts {
    LawFacts {
        constants: L::CONSTANTS,
        state: &[],
        others: match L::NEEDS_SHEAR_RATE {
            true => &[
                ("depends on", "temperature, phase, shear rate"),
                ("forms", "conservative"),
            ],
            false => &[("depends on", "temperature, phase")],
        },
    }
}

/// Makes a [`ViscosityLaw`] known as `viscosity.<name>`: `register_viscosity_law!("newtonian", Newtonian)`. The law implements
/// `Serialize`, `Deserialize` (with `deny_unknown_fields`) and `JsonSchema`.
#[macro_export]
macro_rules! register_viscosity_law {
    ($name:literal, $law:ty) => {
        $crate::perimelt_core::inventory::submit! {
            $crate::fluid::viscosity::ViscosityRegistration(
                $crate::perimelt_core::law_registration!($name, $law, ::core::convert::identity, $crate::fluid::viscosity::facts::<$law>()),
            )
        }
    };
}
