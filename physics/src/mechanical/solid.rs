//! What the solvers need of a formulation, and what all formulations share.

use std::fmt::Debug;

use nalgebra::Matrix3;
use perimelt_core::family::{AxisPlane, Continuation, LayerRule, WithTractions};
use perimelt_core::{Body, Family, SlotField};

use super::elastic::ElasticPoints;
use super::fracture::{Fracture, FractureState, NewBreaks};
use super::moduli::{Elasticity, Moduli};
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
    /// Whether the body moves, so that its forces must have an energy also at layers.
    pub in_motion: bool,
}

impl Constitution {
    /// An elastic body of small displacements that does not break.
    pub fn elastic(elasticity: Elasticity) -> Self {
        Constitution {
            elasticity,
            finite: false,
            plasticity: None,
            fracture: None,
            in_motion: false,
        }
    }
}

/// Forces, stiffness, energy and stress of a body in one formulation. Vectors have three components
/// per point whatever the dimension; those that the dimension leaves out are zero. Symmetric tensors
/// are xx, yy, zz, xy, yz, zx.
pub trait Solid: Debug {
    /// Evaluates the moduli at the temperature of each point, K.
    fn set_moduli(&mut self, body: &Body, temperature: Option<&[f64]>);

    /// Takes the stiffest moduli of each material: those of the stable step.
    fn set_stiffest_moduli(&mut self, body: &Body);

    /// Takes the stress-free strain of each point; mirrored layers take that of their points.
    fn set_eigenstrain(&mut self, eigenstrain: &[f64]);

    /// Takes the stress-free strain with components of each point (xx, yy, zz, xy, yz, zx), in addition to the
    /// eigenstrain, and the part of it that is prescribed at points, other than from their own strain; each is empty if there
    /// is none. Of correspondence solids.
    fn set_stress_free(&mut self, _strain: Vec<[f64; 6]>, _prescribed: &[[f64; 6]]) {}

    /// Takes the points that have material, of a family that grows. Of correspondence solids.
    fn set_present(&mut self, _present: &[bool]) {}

    /// Gradient of the displacement that was set, at each point, of which its stress follows; empty in formulations without.
    fn gradients(&mut self) -> Vec<Matrix3<f64>> {
        Vec::new()
    }

    /// Takes displacements, m, and sets the mirrored layers by `rules`.
    fn set_displacement(&mut self, displacement: &[f64], rules: &[LayerRule]);

    /// The point of which unbroken bonds exceed a stretch (or a compression) the most, in the displacement that was set;
    /// `None` if no bond does.
    fn find_overstretched(&self, limit: f64) -> Option<usize>;

    /// Largest displacement of the ends of an unbroken bond relative to each other, over its length, in the displacement
    /// that was set; `None` if it is not beyond `limit`.
    fn relative_displacement_beyond(&self, limit: f64) -> Option<f64>;

    /// Largest horizon, m.
    fn horizon(&self) -> f64;

    /// Force density of the bonds, N/m³.
    fn force(&mut self, out: &mut [f64]);

    /// Stiffness times the displacement that was set, N/m³: the linear part of minus
    /// [`Solid::force`] about the undeformed state, whatever the kinematics.
    fn stiffness(&mut self, out: &mut [f64]);

    /// Linearises the plastic flow about the state of the last [`Solid::force`], for [`Solid::tangent`].
    fn linearise(&mut self) {}

    /// Elastic-plastic stiffness times the displacement that was set, N/m³; about the undeformed shape, whatever
    /// the kinematics.
    fn tangent(&mut self, out: &mut [f64]) {
        self.stiffness(out);
    }

    /// Whether [`Solid::tangent`] is symmetric under plastic flow: forces must be the derivative of an energy of
    /// the strain that enters the flow rule.
    fn has_symmetric_plastic_tangent(&self) -> bool;

    /// Whether bonds resist relative motion perpendicular to them.
    fn bonds_shear(&self) -> bool {
        false
    }

    /// Diagonal block of the stiffness of each point, N/m⁵, or an estimate of it.
    fn blocks(&mut self) -> &[[f64; 6]];

    /// An upper bound of the eigenfrequencies of the body, rad/s, or `None` if the formulation has none and a
    /// power iteration is needed; `density` in kg/m³ by point.
    fn frequency_bound(&mut self, _density: &[f64]) -> Option<f64> {
        None
    }

    /// Factor by which broken bonds and births may raise the square of the largest frequency of the intact body.
    fn rise_by_damage(&self) -> f64 {
        1.0
    }

    /// Plastic state, if the body flows. [`Solid::force`] sets its trial state.
    fn plasticity(&mut self) -> Option<&mut Plasticity>;

    /// Strength and broken bonds, if bonds break.
    fn fracture(&self) -> Option<&Fracture> {
        None
    }

    /// Replaces the broken bonds, and invalidates what was computed from them; returns those before. `None` if
    /// bonds do not break.
    fn replace_fracture_state(&mut self, _state: FractureState) -> Option<FractureState> {
        None
    }

    /// Breaks those bonds that exceed their limit in the displacement of the last [`Solid::force`] and whose
    /// load is at least `fraction` of the largest; see [`Fracture::break_bonds`].
    fn break_bonds(&mut self, _fraction: f64, _damage: &mut [f64]) -> NewBreaks {
        NewBreaks::default()
    }

    /// The bonds of the body.
    fn family(&self) -> &Family;

    /// Stress of each point that enters the flow rule, Pa: without rotation, in the last trial state.
    fn material_stress(&mut self) -> Vec<[f64; 6]>;

    /// Moduli of a point at its present temperature.
    fn moduli_of(&self, point: usize) -> Moduli;

    /// Elastic energy density of the total strain (J/m³), and the stress conjugate to the eigenstrain
    /// (Pa), of each point.
    fn energy(&mut self) -> &[[f64; 2]];

    /// Energy density of the elastic strain (J/m³) of each point, behind which is no meaning: the total strain without
    /// eigenstrain and inelastic strain of the last trial state. Forces are its derivative.
    fn elastic_energy(&mut self) -> &[[f64; 2]];

    /// The largest factor by which moduli rose with the temperature since the last call; one if none did.
    fn take_stiffening(&mut self) -> f64;

    /// Stress of each point, Pa, with the inelastic strain of the last trial state.
    fn stress(&mut self) -> &[[f64; 6]];

    /// Passes each point below the plane and the force density of its bonds with points above
    /// the plane, N/m³, to `receive`.
    fn force_across(&mut self, plane: AxisPlane, receive: &mut dyn FnMut(usize, [f64; 3]));
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

/// A displacement, m, with the rules of its layers.
#[derive(Clone, Copy)]
pub(super) struct LayeredDisplacement<'a> {
    /// Three components for each point.
    pub(super) values: &'a [f64],
    pub(super) rules: &'a [LayerRule],
}

/// Loads a displacement (one field for each dimension) and continues it into the layers. Under a
/// traction the slope of the layer follows from the moduli and the eigenstrain of `elastic`.
pub(super) fn continue_displacement(
    family: &Family,
    displacement: LayeredDisplacement<'_>,
    elastic: &ElasticPoints,
    vector: &mut [SlotField],
    continuation: &mut Continuation,
) {
    let LayeredDisplacement { values, rules } = displacement;
    let dimension = vector.len();
    let ghosts = WithTractions {
        rules,
        continuation,
        slope: |face, traction, point, lateral| {
            let eigenstrain = elastic.eigenstrain[point];
            let moduli = elastic.moduli(point);
            moduli.slope_under_traction((face, traction), lateral, eigenstrain, dimension)
        },
    };
    let along = |axis: usize| move |point: usize| values[3 * point + axis];
    SlotField::load_all(vector, family, along, ghosts);
}

/// Where sums of `D` components go: to the output itself in 3D, else to the work array.
pub(super) fn flat<'a, const D: usize>(
    padded: &'a mut [f64],
    out: &'a mut [[f64; 3]],
) -> &'a mut [[f64; D]] {
    match D {
        3 => bytemuck::cast_slice_mut::<f64, [f64; D]>(bytemuck::cast_slice_mut(out)),
        _ => bytemuck::cast_slice_mut(padded),
    }
}

/// Spreads sums of `D` components to vectors of three.
pub(super) fn unflatten<const D: usize>(padded: &[f64], out: &mut [f64]) {
    if D < 3 {
        let (vectors, _) = out.as_chunks_mut::<3>();
        for (out, sum) in vectors.iter_mut().zip(padded.as_chunks::<D>().0) {
            *out = std::array::from_fn(|axis| if axis < D { sum[axis] } else { 0.0 });
        }
    }
}
