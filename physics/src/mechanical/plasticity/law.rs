//! Laws of inelastic flow as plugins: [`FlowLaw`] and, for flow along the stress deviator, [`FlowStressLaw`].
//!
//! A law is the struct of its keys in the case file, `flow.<name> = { keys }`, and a value: it returns what it computed
//! from the state at the start of the step. Constants are properties of materials, evaluated at the temperature of each
//! point; state variables become fields. Elasticity, transformation plasticity, annealing, formulations and plane stress
//! are not the law's business.

use std::fmt::Debug;

use nalgebra::Matrix6;
use perimelt_core::SetupError;
use perimelt_core::law::{Constant, StateVariable};

use super::sweep::FlowSweep;

/// A point that may flow in a step.
#[derive(Clone, Copy, Debug)]
pub struct FlowPoint<'a> {
    /// Constants of the law at the temperature of the point, in the order of its declaration.
    pub constants: &'a [f64],
    /// Temperature, K; `None` in a body without.
    pub temperature: Option<f64>,
    /// Size of the step, s.
    pub step: f64,
    /// Shear modulus, Pa.
    pub shear_modulus: f64,
    /// Bulk modulus, Pa.
    pub bulk_modulus: f64,
    /// Equivalent plastic strain at the start of the step.
    pub equivalent: f64,
    /// State variables of the law at the start of the step, in the order of their declaration.
    pub state: &'a [f64],
}

/// Flow of a point in a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Flow {
    /// Increment of the inelastic strain: xx, yy, zz, xy, yz, zx.
    pub strain: [f64; 6],
    /// Increment of the equivalent plastic strain, above zero where the point flows.
    pub equivalent: f64,
    /// Work of the flow, J/m³.
    pub work: f64,
}

/// Equivalent plastic strain at the end of a step.
#[derive(Clone, Copy, Debug)]
pub struct EquivalentStrain {
    /// At the end of the step.
    pub end: f64,
    /// Its increment in the step.
    pub increment: f64,
}

/// A law of inelastic flow of points that are elastic and isotropic, in three dimensions; tensors are xx, yy, zz, xy, yz,
/// zx. Plane stress and bars are found by iteration.
///
/// A law that finds no solution returns numbers that are not finite, which the solver reports.
pub trait FlowLaw: Debug + Send + Sync + serde::Serialize + 'static {
    /// Properties of materials that the law needs.
    const CONSTANTS: &'static [Constant];
    /// State variables besides the equivalent plastic strain and the inelastic strain.
    const STATE: &'static [StateVariable] = &[];
    /// Whether [`FlowLaw::tangent`] has a closed form; central differences replace it otherwise.
    const HAS_TANGENT: bool = false;
    /// Whether the derivative of the stress by the strain is symmetric: flow along the normal of a yield surface, hardening
    /// without recovery. Others are solved by GMRES.
    const IS_SYMMETRIC: bool = false;

    /// Checks the keys, and computes from them what each point needs.
    ///
    /// # Errors
    /// A value that makes no sense; the key of the error begins behind the name of the law.
    fn prepare(&mut self) -> Result<(), SetupError> {
        Ok(())
    }

    /// The flow that follows a trial stress (Pa), which is elastic from the start of the step on, and the state variables at
    /// its end in `state`; `None` if the point does not flow, whatever `state` then has.
    fn flow(&self, point: &FlowPoint<'_>, trial: &[f64; 6], state: &mut [f64]) -> Option<Flow>;

    /// Derivative of the inelastic strain by the strain, from the trial stress (Pa), the equivalent plastic strain and the
    /// state variables that [`FlowLaw::flow`] found; `None` where it has no closed form.
    fn tangent(
        &self,
        _point: &FlowPoint<'_>,
        _trial: &[f64; 6],
        _strain: EquivalentStrain,
        _state: &[f64],
    ) -> Option<Matrix6<f64>> {
        None
    }

    /// Stress of the order at which points flow, Pa: 1e-4 of it is the step of differences.
    fn scale(&self, point: &FlowPoint<'_>) -> f64;
}

/// A law of flow along the stress deviator, by a flow stress that increases with the increment of the equivalent plastic
/// strain: isotropic hardening, rates, temperature. It has a tangent in closed form, and serves bars and plane stress.
pub trait FlowStressLaw: Debug + Send + Sync + serde::Serialize + 'static {
    /// Properties of materials that the law needs.
    const CONSTANTS: &'static [Constant];

    /// Checks the keys, and computes from them what each point needs.
    ///
    /// # Errors
    /// A value that makes no sense; the key of the error begins behind the name of the law.
    fn prepare(&mut self) -> Result<(), SetupError> {
        Ok(())
    }

    /// Flow stress at the end of a step, Pa.
    fn flow_stress(&self, point: &FlowPoint<'_>, strain: EquivalentStrain) -> f64;

    /// Its derivative by the increment of the equivalent plastic strain, Pa.
    fn hardening(&self, point: &FlowPoint<'_>, strain: EquivalentStrain) -> f64;

    /// Stress of the order at which points flow, Pa: 1e-4 of it is the step of differences.
    fn scale(&self, point: &FlowPoint<'_>) -> f64;
}

perimelt_core::law_kind! {
    /// A registered law of flow.
    pub FlowRegistration, dyn FlowSweep, "flow"
}

/// Makes a [`FlowLaw`] known as `flow.<name>`: `register_flow_law!("chaboche", Chaboche)`. The law implements `Serialize`,
/// `Deserialize` (with `deny_unknown_fields`) and `JsonSchema`.
#[macro_export]
macro_rules! register_flow_law {
    ($name:literal, $law:ty) => {
        $crate::register_flow!($name, $law, $crate::mechanical::plasticity::Spatial<$law>);
    };
}

/// Makes a [`FlowStressLaw`] known as `flow.<name>`, as [`register_flow_law!`](crate::register_flow_law) does a
/// [`FlowLaw`].
#[macro_export]
macro_rules! register_flow_stress_law {
    ($name:literal, $law:ty) => {
        $crate::register_flow!($name, $law, $crate::mechanical::plasticity::Radial<$law>);
    };
}

#[doc(hidden)]
#[macro_export]
macro_rules! register_flow {
    ($name:literal, $law:ty, $rule:ty) => {
        $crate::perimelt_core::inventory::submit! {
            $crate::mechanical::plasticity::FlowRegistration(
                $crate::perimelt_core::law_registration!($name, $law, <$rule>::from, <$rule>::FACTS),
            )
        }
    };
}
