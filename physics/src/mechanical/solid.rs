//! What the solvers need of a formulation, and what all formulations share.

use std::fmt::Debug;

use nalgebra::Matrix3;
use perimelt_core::body::Sizes;
use perimelt_core::family::{AxisPlane, LayerRule};
use perimelt_core::solver::{Reducer, Spring};
use perimelt_core::{Body, Face};

use super::base::SolidBase;
use super::deformation::Deformation;
use super::fracture::{Fracture, FractureState, NewBreaks};
use super::laminate::PlyStrength;
use super::moduli::Elasticity;
use super::plasticity::Plasticity;

/// The constitutive behaviour of a body.
#[derive(Debug)]
pub struct Constitution {
    /// Elastic properties of its materials.
    pub elasticity: Elasticity,
    /// Finite kinematics: current lengths and directions of bonds.
    pub finite: bool,
    /// Plastic state, if the body flows.
    pub plasticity: Option<Plasticity>,
    /// Strength of the bonds, if they break.
    pub fracture: Option<Fracture>,
    /// Strength of plies, if they break.
    pub failure: Option<PlyStrength>,
    /// Whether the body moves, so that its forces must have an energy also at layers.
    pub in_motion: bool,
    /// Faces that are planes of symmetry.
    pub symmetry: Vec<Face>,
    /// The points of the body, which processes may share.
    pub points: Reducer,
}

impl Constitution {
    /// An elastic body of small displacements that does not break.
    pub fn elastic(elasticity: Elasticity) -> Self {
        Constitution {
            elasticity,
            finite: false,
            plasticity: None,
            fracture: None,
            failure: None,
            in_motion: false,
            symmetry: Vec::new(),
            points: Reducer::default(),
        }
    }
}

/// Forces, stiffness, energy and stress of a body in one formulation. Vectors have three components
/// per point whatever the dimension; those that the dimension leaves out are zero. Symmetric tensors
/// are xx, yy, zz, xy, yz, zx.
pub trait Solid: Debug + Sync {
    /// What solids of all formulations have.
    fn base(&self) -> &SolidBase;

    /// Mutable access to [`Solid::base`].
    fn base_mut(&mut self) -> &mut SolidBase;

    /// Takes the states of the points on which forces depend.
    fn set_points(&mut self, states: PointStates<'_>);

    /// Takes displacements, m, and sets the mirrored layers by `rules`.
    fn set_displacement(&mut self, displacement: &[f64], rules: &[LayerRule]);

    /// The deformation by the displacement that was set.
    fn deformation(&mut self) -> Deformation<'_>;

    /// Evaluates what is wanted of the displacement that was set. The inelastic strain is that of the trial state of
    /// [`Plasticity`], which [`Wanted::force`] sets.
    fn evaluate(&mut self, wanted: Wanted<'_>) -> Evaluated<'_>;

    /// Linearises the forces about the displacement that was set and the trial state of its force, for
    /// [`Stiffness::Tangent`]; plastic flow with a fraction of the elastic stiffness, the damping.
    fn linearise(&mut self, damping: f64);

    /// Stiffness times the displacement that was set, N/m³, with the directions of the undeformed shape, whatever the kinematics.
    fn stiffness(&mut self, kind: Stiffness, out: &mut [f64]);

    /// Diagonal block of the elastic stiffness of each point, N/m⁵, or an estimate of it.
    fn blocks(&mut self) -> &[[f64; 6]];

    /// Passes the elastic stiffness between a node and each node that it acts on to `receive`, N/m⁵, for the coarse space.
    /// Solids whose bonds are those of a family of the body pass nothing: these are springs.
    fn couplings(&self, _node: usize, _receive: &mut dyn FnMut(Spring)) {}

    /// An upper bound of the eigenfrequencies of the body, whose layers follow `rules`, in any state of damage, rad/s;
    /// `density` in kg/m³ by point.
    fn largest_frequency(&mut self, density: &[f64], rules: &[LayerRule]) -> f64;

    /// Takes the largest step of explicit motion, s, after [`Solid::largest_frequency`] was asked.
    fn set_largest_step(&mut self, _step: f64) {}

    /// Subtracts from a force density of nodes, N/m³, what inertia beside that of their mass takes from it, if the frequencies of the solid are bounded with such
    /// inertia. `inverse_density` is that of components, m³/kg, zero where they are held.
    fn subtract_added_inertia(&mut self, _inverse_density: &[f64], _force: &mut [f64]) {}

    /// Kinetic energy of that inertia by velocities of nodes (m/s) of these volumes (m³), J.
    fn added_kinetic_energy(&self, _velocity: &[f64], _volume: &Sizes) -> f64 {
        0.0
    }

    /// Lets the points for which `is_relieved` says so be free of stress in those modes of the displacement that was set which
    /// have no gradient. Solids without springs for single points have no such modes.
    fn relieve_modes(&mut self, _is_relieved: &dyn Fn(usize) -> bool) {}

    /// The broken bonds; `None` if bonds do not break.
    fn fracture_state(&self) -> Option<&FractureState> {
        self.base().fracture().map(|fracture| &fracture.state)
    }

    /// All pairs of points between which no bond is left.
    fn broken_pairs(&self) -> Vec<[u32; 2]> {
        let base = self.base();
        let pairs = |fracture: &Fracture| fracture.broken_pairs(base.family());
        base.fracture().map(pairs).unwrap_or_default()
    }

    /// Whether a point has lost bonds, so that it may have none left.
    fn has_lost_bonds(&self, point: usize) -> bool {
        self.base().broken().is_some_and(|b| b.of(point) > 0)
    }

    /// The ways in which bonds of a solid break that has several.
    fn failure_modes(&self) -> Vec<FailureMode<'_>> {
        Vec::new()
    }

    /// Replaces the broken bonds, and invalidates what was computed from them; returns those before. `None` if
    /// bonds do not break.
    fn replace_fracture_state(&mut self, state: FractureState) -> Option<FractureState>;

    /// Breaks those bonds that exceed their limit in the displacement whose force was evaluated, and whose load is at
    /// least `fraction` of the largest; see [`Fracture::break_bonds`](super::fracture::Fracture::break_bonds).
    fn break_bonds(&mut self, fraction: f64, damage: &mut [f64]) -> NewBreaks;

    /// Passes each point below the plane and the force density of its bonds with points above
    /// the plane, N/m³, to `receive`.
    fn force_across(&mut self, plane: AxisPlane, receive: &mut dyn FnMut(usize, [f64; 3]));
}

/// A way in which bonds of a body break.
#[derive(Clone, Copy, Debug)]
pub struct FailureMode<'a> {
    /// Of the field `damage.<name>` and the report `bonds.broken.<name>`.
    pub name: &'static str,
    /// Number of broken bonds.
    pub broken: f64,
    /// By point, the fraction of these bonds that broke.
    pub damage: &'a [f64],
}

/// Moduli and strengths of the points of a body.
#[derive(Clone, Copy, Debug)]
pub enum PointModuli<'a> {
    /// At the temperature of each point, K; `None` if the body has no temperature.
    At(&'a Body, Option<&'a [f64]>),
    /// The stiffest moduli of each material, for the stable step.
    Stiffest(&'a Body),
}

/// Stress-free strain with components (xx, yy, zz, xy, yz, zx) of each point, in addition to the isotropic eigenstrain.
#[derive(Clone, Copy, Debug)]
pub struct StressFreeStrain<'a> {
    /// The sum of the eigenstrain that differs by direction and the strain at birth.
    pub strain: &'a [[f64; 6]],
    /// The eigenstrain that differs by direction: it is prescribed at points and does not follow from their own strain.
    /// Empty if there is none.
    pub prescribed: &'a [[f64; 6]],
}

/// States of the points of a body; what is `None` stays.
#[derive(Clone, Copy, Debug, Default)]
pub struct PointStates<'a> {
    /// Moduli and strengths.
    pub moduli: Option<PointModuli<'a>>,
    /// Isotropic stress-free strain of each point; mirrored layers take that of their points.
    pub eigenstrain: Option<&'a [f64]>,
    /// Further stress-free strain. Set-up refuses that of births unless the formulation is `correspondence` or `staggered`.
    pub stress_free: Option<StressFreeStrain<'a>>,
    /// Points that have material, of a family that grows; set-up refuses it unless the formulation is
    /// `correspondence`.
    pub present: Option<&'a [bool]>,
}

/// What [`Solid::evaluate`] computes.
#[derive(Debug, Default)]
pub struct Wanted<'a> {
    /// Takes the force density of the bonds, N/m³. Stresses are returned to the flow stress, which sets the trial state
    /// of the flow, and the loads of bonds are compared with their limits.
    pub force: Option<&'a mut [f64]>,
    /// Stress.
    pub stress: Option<StressKind>,
    /// Energy density.
    pub energy: Option<EnergyKind>,
    /// Gradient of the displacement.
    pub gradient: bool,
}

impl<'a> Wanted<'a> {
    /// The force density alone, N/m³.
    pub fn force(out: &'a mut [f64]) -> Self {
        Wanted {
            force: Some(out),
            ..Wanted::default()
        }
    }

    /// A stress alone.
    pub fn stress(kind: StressKind) -> Self {
        Wanted {
            stress: Some(kind),
            ..Wanted::default()
        }
    }

    /// An energy density alone.
    pub fn energy(kind: EnergyKind) -> Self {
        Wanted {
            energy: Some(kind),
            ..Wanted::default()
        }
    }
}

/// The values that [`Solid::evaluate`] found, for each point; empty where they were not wanted.
#[derive(Clone, Copy, Debug, Default)]
pub struct Evaluated<'a> {
    /// Stress, Pa.
    pub stress: &'a [[f64; 6]],
    /// Energy density (J/m³), and the stress conjugate to the eigenstrain (Pa), which is zero for
    /// [`EnergyKind::Elastic`].
    pub energy: &'a [[f64; 2]],
    /// Gradient of the displacement from which the stress follows; empty in formulations without.
    pub gradient: &'a [Matrix3<f64>],
    /// What means over families add to the prescribed strains; empty where they add nothing.
    pub smoothing: &'a [[f64; 6]],
}

/// The stress that is evaluated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StressKind {
    /// In space: Cauchy stress under finite kinematics.
    Spatial,
    /// The stress that enters the flow rule, without rotation; empty for a body that does not flow.
    Material,
    /// The stress conjugate to the eigenstrain: the derivative of the energy of the total strain by the strain in the
    /// undeformed body.
    Conjugate,
}

/// The energy density that is evaluated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EnergyKind {
    /// Energy of the elastic strain: the total strain without eigenstrain and inelastic strain. Forces are its derivative;
    /// its values at single points have no physical meaning.
    Elastic,
    /// Energy of the total strain, with the stress conjugate to the eigenstrain.
    Total,
}

/// The stiffness that is multiplied with a displacement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stiffness {
    /// The linear part of minus the force.
    Elastic,
    /// By the law of elasticity and the plastic flow that were linearised.
    Tangent,
}

/// The strain from which a stress is evaluated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum StrainKind {
    /// The elastic strain: the total strain minus eigenstrain and inelastic strain of the trial state.
    Elastic,
    /// The total strain.
    Total,
    /// A change of the total strain minus the change of the inelastic strain that it causes.
    Change,
}
