//! What the solvers ask of a formulation.

use std::fmt::Debug;

use perimelt_core::family::{Continuation, LayerRule};
use perimelt_core::{Body, Family};
use rayon::prelude::*;

use super::fracture::Fracture;
use super::moduli::Moduli;
use super::plasticity::Plasticity;

/// Forces, stiffness, energy and stress of a body in one formulation. Vectors have three components
/// per point whatever the dimension; those that the dimension leaves out stay zero. Symmetric tensors
/// are xx, yy, zz, xy, yz, zx.
pub trait Solid: Debug {
    /// Evaluates the moduli at the temperature of each point, K.
    fn set_moduli(&mut self, body: &Body, temperature: Option<&[f64]>);

    /// Takes the stiffest moduli of each material: those of the stable step.
    fn set_stiffest_moduli(&mut self, body: &Body);

    /// Takes the stress-free strain of each point; layers mirror it.
    fn set_eigenstrain(&mut self, eigenstrain: &[f64]);

    /// Takes displacements, m, and fills the layers by `rules`.
    fn set_displacement(&mut self, displacement: &[f64], rules: &[LayerRule]);

    /// Largest horizon, m.
    fn horizon(&self) -> f64;

    /// Force density of the bonds, N/m³.
    fn force(&mut self, out: &mut [f64]);

    /// Stiffness times the displacement that was set, N/m³: the linear part of minus
    /// [`Solid::force`] about the undeformed state, whatever the kinematics.
    fn stiffness(&mut self, out: &mut [f64]);

    /// Takes the state of the last [`Solid::force`] as the one about which [`Solid::tangent`] is linear.
    fn linearise(&mut self) {}

    /// Stiffness of the body as it flows times the displacement that was set, N/m³; about the undeformed
    /// shape, whatever the kinematics.
    fn tangent(&mut self, out: &mut [f64]) {
        self.stiffness(out);
    }

    /// Whether forces are the derivative of an energy of the strain that makes the body flow: then
    /// [`Solid::tangent`] is symmetric.
    fn flows_by_its_own_strain(&self) -> bool;

    /// Whether bonds resist motion across them.
    fn bonds_shear(&self) -> bool {
        false
    }

    /// Diagonal block of the stiffness of each point, N/m⁵, or a good estimate.
    fn blocks(&mut self) -> &[[f64; 6]];

    /// An upper bound of the frequencies at which the body can vibrate, rad/s, or `None` where there is
    /// only the power iteration; `density` in kg/m³ by point.
    fn frequency_bound(&mut self, _density: &[f64]) -> Option<f64> {
        None
    }

    /// By how much lost bonds may raise the square of the largest frequency of the whole body.
    fn rise_by_damage(&self) -> f64 {
        1.0
    }

    /// Plastic state, where there is one. [`Solid::force`] leaves the state that it tried there.
    fn plasticity(&mut self) -> Option<&mut Plasticity>;

    /// Strength and broken bonds, where bonds break.
    fn fracture(&self) -> Option<&Fracture> {
        None
    }

    /// As [`Solid::fracture`].
    fn fracture_mut(&mut self) -> Option<&mut Fracture> {
        None
    }

    /// Breaks those bonds that exceed their limit in the displacement of the last [`Solid::force`] and are
    /// loaded to at least `share` of the worst; see [`Fracture::break_bonds`].
    fn break_bonds(&mut self, _share: f64, _damage: &mut [f64]) -> (Vec<[u32; 2]>, bool) {
        (Vec::new(), false)
    }

    /// The bonds.
    fn family(&self) -> &Family;

    /// Stress of each point as plastic flow sees it, Pa: unrotated, of the state that was tried last.
    fn material_stress(&mut self) -> Vec<[f64; 6]>;

    /// Moduli of a point now.
    fn moduli_of(&self, point: usize) -> Moduli;

    /// Elastic energy density of the total strain (J/m³), and the stress conjugate to the eigenstrain
    /// (Pa), of each point.
    fn energy(&mut self) -> &[[f64; 2]];

    /// Stress of each point, Pa, with the inelastic strain that was tried last.
    fn stress(&mut self) -> &[[f64; 6]];

    /// Passes each point below the plane `x_axis = at` (m) and the force density of its bonds with what
    /// lies above, N/m³, to `receive`.
    fn force_across(&mut self, plane: (usize, f64), receive: &mut dyn FnMut(usize, [f64; 3]));
}

/// Which strain a stress is evaluated of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Of {
    /// The elastic one: without eigenstrain and tried inelastic strain.
    Elastic,
    /// The total one.
    Total,
    /// A change, without the change of the inelastic strain that it makes.
    Change,
}

/// Fills the slots of a displacement (m; `vector` has one array for each dimension) from the points and
/// by the rules of its layers; `at` gives moduli and eigenstrain of a point, which the slope under a
/// traction needs.
pub(super) fn continue_displacement(
    family: &Family,
    (displacement, rules): (&[f64], &[LayerRule]),
    (vector, continuation): (&mut [Vec<f64>], &mut Continuation),
    at: impl Fn(usize) -> (Moduli, f64),
) {
    let dimension = vector.len();
    let axes = vector.par_iter_mut().enumerate();
    axes.for_each(|(axis, slots)| family.scatter(displacement, 3, axis, slots));
    family.continue_vector(
        rules,
        vector,
        continuation,
        |face, traction, point, lateral| {
            let (moduli, eigenstrain) = at(point);
            moduli.slope_under_traction((face, traction), lateral, eigenstrain, dimension)
        },
    );
}
