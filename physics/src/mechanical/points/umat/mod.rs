//! `law.umat`: a law in a shared library, by the interface of user subroutines UMAT (Abaqus User Subroutines Reference
//! Guide, section 1.1.44); docs/theory/mechanics.md, "Laws of points".
//!
//! | file | has |
//! |---|---|
//! | `kinematics` | strain and rotation in a step |
//! | `arguments` | the arguments of a subroutine in its order of components |
//! | `library` | the subroutine in its library, with the feature `umat` |
//! | `without` | its place without the feature |
//!
//! A subroutine returns the stress at the end of a step from stress and state variables at its start. All of them are state
//! variables of the law. Where a stress is wanted at another strain than that to which the point evolved, as that of an
//! image in a layer, the difference is elastic, with the moduli of the material.

mod arguments;
mod kinematics;
#[cfg(feature = "umat")]
#[allow(unsafe_code)]
mod library;
#[cfg(not(feature = "umat"))]
#[path = "without.rs"]
mod library;

use std::path::PathBuf;

use nalgebra::{Matrix3, Matrix6, Vector6};
use perimelt_core::SetupError;
use perimelt_core::law::{StateVariable, VariableShape};
use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize};

use super::law::{LawPoint, Measure, PointLaw, StepStates};
use super::scratch::with_copy;
use crate::mechanical::classical::symmetric;
use arguments::{Answer, Arguments, engineering};
use kinematics::Increment;
use library::Subroutine;

/// A material subroutine in a shared library, by the interface of UMAT. A wrong library can crash the program.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Umat {
    /// The shared library, such as "steel.so"; relative to the folder of the case.
    library: LibraryFile,
    /// Name of the subroutine in the library: that of compiled Fortran.
    #[serde(default = "umat")]
    symbol: String,
    /// Its constants (PROPS).
    #[serde(default)]
    properties: Vec<f64>,
    /// Number of its state variables (STATEV), which are the fields `umat.state_1` and so on. They are zero at the start,
    /// unless `initial` gives them.
    #[serde(default)]
    states: usize,
    /// Name of the material (CMNAME), 80 letters at most.
    #[serde(default)]
    material: String,
    /// Whether several threads may call it at once. Subroutines with COMMON blocks or SAVE must not be.
    #[serde(default)]
    parallel: bool,
    #[serde(skip)]
    variables: Vec<StateVariable>,
    #[serde(skip)]
    subroutine: Option<Subroutine>,
}

fn umat() -> String {
    "umat_".into()
}

/// A file of a case.
#[derive(Clone, Debug, Serialize, JsonSchema)]
#[serde(transparent)]
#[schemars(transparent)]
struct LibraryFile {
    /// The path in the case.
    given: PathBuf,
    /// Where the file is.
    #[serde(skip)]
    place: PathBuf,
}

impl<'de> Deserialize<'de> for LibraryFile {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let given = PathBuf::deserialize(deserializer)?;
        let place = perimelt_core::folder::path(&given);
        Ok(LibraryFile { given, place })
    }
}

/// The state variables in the row of a point.
struct Row<'a> {
    /// Stress of the measure of the subroutine, Pa: xx, yy, zz, xy, yz, zx.
    stress: &'a [f64; 6],
    /// F - 1; the small strain where displacements are small.
    gradient: &'a [f64; 9],
    /// J/m³; zero where the subroutine does not compute it.
    energy: f64,
}

/// Numbers before the state variables of the subroutine.
const OWN: usize = 16;

impl<'a> Row<'a> {
    fn of(state: &'a [f64]) -> Option<Self> {
        let (stress, rest) = state.split_first_chunk()?;
        let (gradient, rest) = rest.split_first_chunk()?;
        let energy = *rest.first()?;
        Some(Row {
            stress,
            gradient,
            energy,
        })
    }

    fn stress(&self) -> Matrix3<f64> {
        symmetric(self.stress)
    }

    fn gradient(&self) -> Matrix3<f64> {
        Matrix3::from_column_slice(self.gradient)
    }

    /// The energy of a subroutine; by the moduli of the material where the subroutine does not compute it.
    fn energy(&self, point: &LawPoint<'_>) -> f64 {
        if self.energy != 0.0 {
            return self.energy;
        }
        let stress = self.stress();
        let mean = stress.trace() / 3.0;
        let deviator = stress - Matrix3::identity() * mean;
        0.25 * deviator.norm_squared() / point.shear_modulus
            + 0.5 * mean * mean / point.bulk_modulus
    }
}

/// Stress (Pa) and energy density (J/m³) of the configuration at the end, with the increment that leads there from a state.
struct Extrapolated {
    stress: Matrix3<f64>,
    energy: f64,
    increment: Increment,
}

impl Extrapolated {
    /// The state of a point at a strain.
    fn new(point: &LawPoint<'_>, strain: &Matrix3<f64>, state: &[f64]) -> Option<Self> {
        let row = Row::of(state)?;
        let increment = Increment::new(point.finite, &row.gradient(), strain);
        let turned = increment.turned(&row.stress());
        let change = increment.strain;
        let isotropic = point.lame() * change.trace();
        let elastic = change * (2.0 * point.shear_modulus) + Matrix3::identity() * isotropic;
        Some(Extrapolated {
            energy: row.energy(point) + (turned + elastic * 0.5).dot(&change),
            stress: turned + elastic,
            increment,
        })
    }
}

impl Umat {
    /// Calls the subroutine for a step from a state; `state` has the state variables at the end of the step.
    fn call(
        &self,
        point: &LawPoint<'_>,
        increment: &Increment,
        state: &mut [f64],
    ) -> Option<Answer> {
        let row = Row::of(state)?;
        let mut arguments = Arguments::new(point, increment, &row.stress(), row.energy);
        let subroutine = self.subroutine.as_ref()?;
        subroutine.call(&mut arguments, &mut state[OWN..]);
        arguments.answer()
    }
}

impl PointLaw for Umat {
    const STATE: &'static [StateVariable] = &[
        StateVariable::tensor("stress", "Pa", "stress of the subroutine"),
        StateVariable::scalar("gradient", "1", "deformation gradient minus one")
            .of_shape(VariableShape::Matrix),
        StateVariable::scalar("energy", "J/m^3", "elastic energy"),
    ];
    const STRAIN: Measure = Measure::StrainOrGradient;
    const HAS_TANGENT: bool = true;
    const IS_SYMMETRIC: bool = false;

    fn state(&self) -> &[StateVariable] {
        &self.variables
    }

    fn prepare(&mut self) -> Result<(), SetupError> {
        let numbers = StateVariable::scalar("state", "1", "state variables of the subroutine");
        let numbers = numbers.of_shape(VariableShape::Numbers(self.states));
        self.variables = [Self::STATE, &[numbers]].concat();
        self.subroutine = Some(Subroutine::load(self)?);
        Ok(())
    }

    fn evolve(&self, point: &LawPoint<'_>, strain: &Matrix3<f64>, state: &mut [f64]) {
        let Some(row) = Row::of(state) else {
            return;
        };
        let increment = Increment::new(point.finite, &row.gradient(), strain);
        match self.call(point, &increment, state) {
            Some(answer) => {
                state[..6].copy_from_slice(&answer.stress);
                state[6..15].copy_from_slice(increment.end().as_slice());
                state[15] = answer.energy;
            }
            // not converged
            None => state.fill(f64::NAN),
        }
    }

    fn stress(&self, point: &LawPoint<'_>, strain: &Matrix3<f64>, state: &[f64]) -> Matrix3<f64> {
        match Extrapolated::new(point, strain, state) {
            Some(end) => end.increment.nominal(&end.stress),
            None => Matrix3::from_element(f64::NAN),
        }
    }

    /// The energy of subroutines is per volume of the deformed body.
    fn energy(&self, point: &LawPoint<'_>, strain: &Matrix3<f64>, state: &[f64]) -> f64 {
        let end = Extrapolated::new(point, strain, state);
        end.map_or(f64::NAN, |end| end.energy * end.increment.volume_ratio())
    }

    /// By DDSDDE, unless it is zero.
    fn tangent(
        &self,
        point: &LawPoint<'_>,
        strain: &Matrix3<f64>,
        states: StepStates<'_>,
        change: &Matrix3<f64>,
    ) -> Option<Matrix3<f64>> {
        let row = Row::of(states.start)?;
        let increment = Increment::new(point.finite, &row.gradient(), strain);
        let answer = with_copy(states.start, |state| self.call(point, &increment, state))?;
        if answer.tangent == Matrix6::zeros() {
            return None;
        }
        let rate = increment.rate(change);
        let stress = answer.tangent * Vector6::from(engineering(&rate.strain));
        let stress = symmetric(&stress.into());
        Some(increment.nominal_rate(&stress, &symmetric(&answer.stress), &rate))
    }

    /// The moduli of the material are the largest.
    fn steepest(&self, _: &LawPoint<'_>) -> f64 {
        1.0
    }
}

crate::register_point_law!("umat", Umat);
