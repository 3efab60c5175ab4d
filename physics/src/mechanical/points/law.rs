//! Laws of points as plugins: [`PointLaw`], the stress of a point as a function of its strain and state.
//!
//! A law is the struct of its keys in the case file, `law.<name> = { keys }`, and a value: it returns what it computed from
//! the state at the start of the step. Constants are properties of materials, evaluated at the temperature of each point;
//! state variables become fields. Eigenstrains, plane stress, bars, layers and cracks are not the law's business.

use std::fmt::Debug;

use nalgebra::Matrix3;
use perimelt_core::SetupError;
use perimelt_core::law::{Constant, StateVariable};

/// A point in a step.
#[derive(Clone, Copy, Debug)]
pub struct LawPoint<'a> {
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
    /// Finite kinematics.
    pub finite: bool,
    /// Axes of the material in the undeformed body, by columns; those of space where the law has no directions.
    pub axes: Matrix3<f64>,
    /// Its number in the body.
    pub number: usize,
    /// Its reference position, m.
    pub position: [f64; 3],
    /// Its spacing, m.
    pub spacing: f64,
    /// Start of the step, s.
    pub start: f64,
}

impl LawPoint<'_> {
    /// First Lamé constant, Pa.
    pub fn lame(&self) -> f64 {
        self.bulk_modulus - 2.0 / 3.0 * self.shear_modulus
    }
}

/// The strain from which the stress of a law follows. That of an eigenstrain is taken out of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measure {
    /// Small strain and stress; under finite kinematics the strain of Green and Lagrange, and the second stress of Piola and
    /// Kirchhoff.
    Strain,
    /// Deformation gradient F, and the first stress of Piola and Kirchhoff. It needs finite kinematics.
    Gradient,
    /// Small strain and stress; under finite kinematics the deformation gradient F, and the first stress of Piola and Kirchhoff.
    StrainOrGradient,
}

impl Measure {
    /// Whether it is the deformation gradient.
    pub(super) fn is_gradient(self, finite: bool) -> bool {
        match self {
            Measure::Strain => false,
            Measure::Gradient => true,
            Measure::StrainOrGradient => finite,
        }
    }
}

/// State variables of a point.
#[derive(Clone, Copy, Debug)]
pub struct StepStates<'a> {
    /// At the start of the step.
    pub start: &'a [f64],
    /// At its end.
    pub end: &'a [f64],
}

/// The law of the stress of points in three dimensions. Plane stress and bars are found by iteration.
///
/// A law that finds no solution returns numbers that are not finite, which the solver reports.
pub trait PointLaw: Debug + Send + Sync + serde::Serialize + 'static {
    /// Properties of materials that the law needs besides the elastic ones.
    const CONSTANTS: &'static [Constant] = &[];
    /// State variables.
    const STATE: &'static [StateVariable] = &[];
    /// The strain from which the stress follows.
    const STRAIN: Measure;
    /// Whether [`PointLaw::tangent`] has a closed form; central differences replace it otherwise.
    const HAS_TANGENT: bool = false;
    /// Whether the derivative of the stress by the strain is symmetric, as that of an energy. Others are solved by GMRES.
    const IS_SYMMETRIC: bool = true;

    /// Whether the axes of the material count.
    const HAS_DIRECTIONS: bool = false;
    /// The property that is Young's modulus of the isotropic solid which stands for the law in springs, bounds and preconditioners; its
    /// Poisson's ratio is that of bonds. `None` for a law that has Young's modulus and Poisson's ratio.
    const YOUNGS_MODULUS: Option<&'static str> = None;

    /// Checks the keys, and computes from them what each point needs.
    ///
    /// # Errors
    /// A value that makes no sense; the key of the error begins behind the name of the law.
    fn prepare(&mut self) -> Result<(), SetupError> {
        Ok(())
    }

    /// Checks the constants of a material at a temperature, which `of` names.
    ///
    /// # Errors
    /// Constants that make no sense together; the key of the error begins behind the name of the law.
    fn check(&self, _constants: &[f64], _of: &str) -> Result<(), SetupError> {
        Ok(())
    }

    /// State variables, where keys add to [`PointLaw::STATE`].
    fn state(&self) -> &[StateVariable] {
        Self::STATE
    }

    /// Advances the state variables from the start of the step to its end, where the point has the strain.
    fn evolve(&self, _point: &LawPoint<'_>, _strain: &Matrix3<f64>, _state: &mut [f64]) {}

    /// Stress at a strain and state, Pa.
    fn stress(&self, point: &LawPoint<'_>, strain: &Matrix3<f64>, state: &[f64]) -> Matrix3<f64>;

    /// Stored energy at a strain and state, J/m³.
    fn energy(&self, point: &LawPoint<'_>, strain: &Matrix3<f64>, state: &[f64]) -> f64;

    /// Change of the stress with a change of the strain, about the strain at the end of a step; `None` without a closed form.
    fn tangent(
        &self,
        _point: &LawPoint<'_>,
        _strain: &Matrix3<f64>,
        _states: StepStates<'_>,
        _change: &Matrix3<f64>,
    ) -> Option<Matrix3<f64>> {
        None
    }

    /// The largest stiffness at the strains for which the law is meant, over the elastic one at no strain, at least one: the
    /// stable step of explicit motion follows from it.
    fn steepest(&self, point: &LawPoint<'_>) -> f64;
}
