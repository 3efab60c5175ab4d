//! Keys of a `mechanical` table in a case file.

use perimelt_core::law::Law;
use perimelt_core::solver::RelaxationOptions;
use perimelt_core::{Correction, Horizon, Influence, PartialVolume, SetupError, StepSize, Update};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::fracture::FractureSection;
use super::law::ElasticLaw;
use super::moduli::Plane;
use super::plasticity::{FlowSweep, PlasticitySection};
use super::section::Section;
use super::surface_stress::SurfaceStress;

/// Thermoelastic solid: bond-based, ordinary state-based, by correspondence or staggered; owns `displacement` and `velocity`,
/// consumes `eigenstrain`, `eigenstrain_tensor` and `body_force`, provides `stress` and `conjugate_stress`.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Mechanical {
    /// Body that deforms; may be left out when there is only one.
    #[serde(default)]
    pub body: Option<String>,
    /// How forces follow the displacement; default "staggered" with plastic flow (`plasticity`, `flow`), else "bond".
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub formulation: Option<Formulation>,
    /// Law of elasticity, such as `law.linear = {}`, which is the default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub law: Option<Law<dyn ElasticLaw>>,
    /// Plane stress or plane strain, for a 2D body.
    #[serde(default)]
    pub plane: Plane,
    /// Stabilisation G of the zero-energy modes of `correspondence` and `staggered`; default 0.1, for `staggered` that with which a
    /// plate of one cell has its bending stiffness, or 0.2 (3D) and 0.3 (2D) with plastic flow or a law of points.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = 0))]
    pub stabilisation: Option<f64>,
    /// Horizon in spacings of each point, or `{ length = ... }` in m for a uniform one; default 3 spacings, or 2 for
    /// `correspondence`. Points of `staggered` solids have no horizon.
    #[serde(default)]
    pub horizon: Option<Horizon>,
    /// Partial volume of neighbours at the edge of the horizon.
    #[serde(default)]
    pub partial_volume: PartialVolume,
    /// Influence of neighbours by their distance.
    #[serde(default)]
    pub influence: Influence,
    /// Calibration of the bonds.
    #[serde(default)]
    pub correction: Correction,
    /// Small displacements, or finite ones by current lengths and directions of bonds.
    #[serde(default)]
    pub kinematics: Kinematics,
    /// Plastic flow, such as `{ annealing_temperature = 1300 }`: the short form of `flow.j2` and `annealing_temperature`;
    /// elastic if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub plasticity: Option<PlasticitySection>,
    /// Law of plastic flow, such as `flow.johnson_cook = {}`; elastic if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub flow: Option<Law<dyn FlowSweep>>,
    /// Temperature (K) at and above which a point of a body with a `flow` loses its stress and its hardening; default never.
    #[schemars(extend("exclusiveMinimum" = 0))]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub annealing_temperature: Option<f64>,
    /// When bonds break, such as `{ no_fail = ["grip"] }`; never if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fracture: Option<FractureSection>,
    /// Solver of equilibrium or motion.
    #[serde(default)]
    pub solver: MechanicalSolver,
    /// Step in s, or "auto" (explicit solver).
    #[serde(default)]
    pub step: StepSize,
    /// Advance in every macro `step`, or once per `log` interval.
    #[serde(default)]
    pub update: Update,
    /// Planes whose force is reported with each logged state, such as
    /// `sections = [{ name = "middle", axis = "x", at = 0 }]`.
    #[serde(default)]
    pub sections: Vec<Section>,
    /// Stress of points near bare surfaces of a lattice.
    #[serde(default)]
    pub surface_stress: SurfaceStress,
}

/// How forces follow the displacement, which limits Poisson's ratio.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Formulation {
    /// A force along the bond that depends on its own stretch. Poisson's ratio is 1/4 (3D, plane strain) or 1/3
    /// (plane stress); that of the material is ignored.
    Bond,
    /// A force along the bond that depends on its stretch and on the dilatation at its ends: any Poisson's ratio.
    Ordinary,
    /// A force from the classical stress at both ends: exact for uniform strain on any cloud of points; most
    /// accurate with a horizon of 2 spacings.
    Correspondence,
    /// Displacements at the corners of the cells of a lattice, stresses at the points: for metal that yields or is deposited.
    Staggered,
}

impl Formulation {
    /// Its name in a case file.
    pub const fn name(self) -> &'static str {
        match self {
            Formulation::Bond => "bond",
            Formulation::Ordinary => "ordinary",
            Formulation::Correspondence => "correspondence",
            Formulation::Staggered => "staggered",
        }
    }
}

/// Measure of stretch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Kinematics {
    /// Stretch linear in the displacement, directions of the reference configuration.
    #[default]
    Linear,
    /// Current lengths and directions: large rotations and displacements.
    Finite,
}

/// Solver of the mechanical state.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MechanicalSolver {
    /// Equilibrium at every step by Newton-Krylov, without stress waves.
    QuasiStatic {
        /// Unbalanced force relative to the loads at which the iteration stops.
        #[serde(default = "tolerance")]
        #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 1))]
        tolerance: f64,
    },
    /// Equilibrium at every step by adaptive dynamic relaxation, as published; `relative_tolerance`
    /// is relative to the loads.
    Relaxation(RelaxationOptions),
    /// Motion by velocity Verlet, with stress waves.
    Explicit {
        /// Mass-proportional damping rate, 1/s.
        #[serde(default)]
        #[schemars(extend("minimum" = 0))]
        damping: f64,
    },
}

/// Refuses tolerances relative to the loads that all states meet.
fn check_tolerance(key: &str, tolerance: f64, is_positive: bool) -> Result<(), SetupError> {
    match is_positive && tolerance < 1.0 {
        true => Ok(()),
        false => {
            let message = format!("`{key}` is {tolerance}");
            Err(SetupError::value(
                key,
                message,
                "a number above 0 and below 1",
            ))
        }
    }
}

pub(super) fn tolerance() -> f64 {
    1e-8
}

impl MechanicalSolver {
    /// Damping rate of a body in motion, 1/s; none in equilibrium.
    pub(super) fn damping(self) -> Option<f64> {
        match self {
            MechanicalSolver::Explicit { damping } => Some(damping),
            MechanicalSolver::QuasiStatic { .. } | MechanicalSolver::Relaxation(_) => None,
        }
    }
}

impl Mechanical {
    /// The formulation: without the key, the one whose stress holds where metal flows if it does, else the fastest.
    pub(super) fn formulation(&self) -> Formulation {
        let flows = self.plasticity.is_some() || self.flow.is_some();
        self.formulation.unwrap_or(match flows {
            true => Formulation::Staggered,
            false => Formulation::Bond,
        })
    }

    /// The horizon, or the usual one of the formulation.
    pub(super) fn horizon(&self) -> Horizon {
        let usual = match self.formulation() {
            Formulation::Correspondence => 2.0,
            _ => 3.0,
        };
        self.horizon.unwrap_or(Horizon::Spacings(usual))
    }

    /// Refuses numbers beyond their ranges.
    pub(super) fn check(&self) -> Result<(), SetupError> {
        let at_least_zero = |key: &str, value: f64| match value >= 0.0 && value.is_finite() {
            true => Ok(()),
            false => {
                let message = format!("`{key}` is {value}");
                Err(SetupError::value(key, message, "zero or above"))
            }
        };
        at_least_zero("stabilisation", self.stabilisation.unwrap_or(0.0))?;
        match self.solver {
            MechanicalSolver::QuasiStatic { tolerance } => {
                check_tolerance("solver.quasi_static.tolerance", tolerance, tolerance > 0.0)
            }
            MechanicalSolver::Relaxation(options) => check_tolerance(
                "solver.relaxation.relative_tolerance",
                options.relative_tolerance,
                options.relative_tolerance >= 0.0,
            ),
            MechanicalSolver::Explicit { damping } => {
                at_least_zero("solver.explicit.damping", damping)
            }
        }
    }
}

impl Default for MechanicalSolver {
    fn default() -> Self {
        MechanicalSolver::QuasiStatic {
            tolerance: tolerance(),
        }
    }
}
