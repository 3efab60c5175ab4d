//! Laminates: bonds within each layer of a lay-up, and between layers.
//!
//! All layers have the family of one plane grid; what differs by ply is the stiffness of the bonds by their direction
//! (`weights`), and whether they run along fibres. Within a layer a bond resists its stretch, and a point its dilatation; between two layers
//! crossing pairs of bonds resist shear, and bonds between points above each other resist opening. Forces are the derivative of the energy of
//! all of them (`kernels`; docs/theory/laminates.md).
//!
//! Near free edges the bonds have the stiffness of the interior times the correction of the family; bonds along the fibres
//! have a correction of their own, as the rows of fibres end elsewhere than the family does.

mod breaking;
mod crack;
mod failure;
#[cfg(test)]
mod failure_tests;
mod force;
mod frequency;
mod interface;
mod kernels;
mod law;
mod solid;
mod strength;
#[cfg(test)]
mod tests;
mod weights;

use std::sync::Arc;

use nalgebra::Matrix3;
use perimelt_core::body::{Layer, Layers};
use perimelt_core::family::Mirrored;
use perimelt_core::{Body, Family, SetupError, SlotField, text};

use super::base::{Properties, SolidBase};
use super::solid::Constitution;
use crate::plies::{CompleteFamily, fibre_factors, uncut};
use failure::{Failure, LaminateParts};
use interface::Interface;
use kernels::INPUTS;
use law::PlyConstants;
pub(super) use law::no_layup;
pub use law::{Lamina, OfPlies};
pub use strength::PlyStrength;
use weights::{NoBonds, PlyBonds};

/// A layer of points.
#[derive(Debug)]
struct LayerSolid {
    bonds: PlyBonds,
    /// `a` of the dilatation, Pa.
    dilatation: f64,
    /// m.
    thickness: f64,
    /// Inputs of the kernels by slot of the plane.
    slots: [SlotField; INPUTS],
}

/// The solid of a laminate.
#[derive(Debug)]
pub struct Laminate {
    base: SolidBase,
    /// The family of each layer.
    plane: Arc<Family>,
    layers: Vec<LayerSolid>,
    interfaces: Vec<Interface>,
    /// Position of each layer along z, m.
    heights: Vec<f64>,
    /// By point and axis, m.
    displacement: Vec<[f64; 3]>,
    /// Stress-free strain of each point: xx, yy, zz, xy, yz, zx.
    strain: Vec<[f64; 6]>,
    /// Takes the place of the stress-free strain in a change of the force.
    zeros: SlotField,
    /// Sums over the bonds of a layer.
    work: Work,
    /// Limits and broken bonds, if bonds break.
    failure: Option<Failure>,
    /// Diagonal blocks of the stiffness of the unbroken bonds; empty until they are needed.
    blocks: Vec<[f64; 6]>,
    gradients: Vec<Matrix3<f64>>,
}

/// Sums over the bonds of a layer, by point of the plane.
#[derive(Debug)]
struct Work {
    scalars: Vec<[f64; 1]>,
    vectors: Vec<[f64; 3]>,
    pairs: Vec<[f64; 6]>,
    /// Of fibres by themselves.
    added: Vec<f64>,
}

impl Work {
    fn new(points: usize) -> Self {
        Work {
            scalars: vec![[0.0]; points],
            vectors: vec![[0.0; 3]; points],
            pairs: vec![[0.0; 6]; points],
            added: Vec::new(),
        }
    }
}

/// What is wrong with a ply whose bonds have no positive stiffness.
fn refusal(layers: &Layers, layer: &Layer, reason: NoBonds) -> SetupError {
    let angle = text::number(layers.plies()[layer.ply].angle.to_degrees(), 5);
    match reason {
        NoBonds::TooFew => SetupError::value(
            "horizon",
            "the horizon holds bonds in too few directions for a ply",
            "2 spacings or more, usually 3",
        ),
        NoBonds::Negative {
            angle: bond,
            has_fibres,
        } => {
            let why = match has_fibres {
                true => "",
                false => ", and no bond of the lattice runs along its fibres",
            };
            let message = format!(
                "a ply at {angle} degrees would have bonds of negative stiffness at {bond:.1} degrees from its fibres{why}"
            );
            SetupError::value(
                "law.lamina",
                message,
                "plies at 0, 90, 45 or -45 degrees, or moduli that differ less by direction",
            )
        }
    }
}

impl Laminate {
    /// The solid of a body with a lay-up, whose layers have the bonds of `plane`.
    ///
    /// # Errors
    /// A ply or an interface whose bonds have no positive stiffness.
    fn new(
        body: &Body,
        layers: &Layers,
        plane: Arc<Family>,
        constitution: Constitution,
        constants: &PlyConstants,
    ) -> Result<Self, SetupError> {
        let spacing = body.finest_spacing();
        let complete = CompleteFamily::new(spacing, plane.spec());
        let complete = complete.map_err(|e| SetupError::new("horizon", e))?;
        let reduced = constants.ply.reduced();
        let uncut = uncut(layers.plane(), &plane).map_err(|e| SetupError::new("horizon", e))?;
        let solid_of = |layer: &Layer| {
            let (sin, cos) = layers.plies()[layer.ply].angle.sin_cos();
            let bonds = PlyBonds::new(&complete, [cos, sin], &reduced);
            let bonds = bonds.map_err(|reason| refusal(layers, layer, reason))?;
            let mut slots: [SlotField; INPUTS] = std::array::from_fn(|_| SlotField::zeros(&plane));
            let factors = match bonds.has_fibres() {
                true => fibre_factors(&uncut, &complete, bonds.fibre),
                false => Vec::new(),
            };
            let factors = |point: usize| factors.get(point).copied().unwrap_or(1.0);
            slots[kernels::FIBRE].load(&plane, factors, Mirrored::Scalar);
            Ok(LayerSolid {
                bonds,
                dilatation: reduced.dilatation(),
                thickness: layer.thickness,
                slots,
            })
        };
        let solids: Result<Vec<LayerSolid>, SetupError> =
            layers.layers().iter().map(solid_of).collect();
        let pairs = layers.layers().windows(2);
        let interfaces: Result<Vec<Interface>, SetupError> = pairs
            .map(|pair| Interface::new(layers, [&pair[0], &pair[1]], &complete, constants))
            .collect();
        let (solids, interfaces) = (solids?, interfaces?);
        let failure = constitution.failure.as_ref().map(|strength| {
            let parts = LaminateParts {
                layers,
                plane: &plane,
                complete: &complete,
                solids: &solids,
                interfaces: &interfaces,
            };
            Failure::new(&parts, constants, strength)
        });
        let properties = Properties {
            bonds_shear: true,
            has_symmetric_plastic_tangent: true,
            has_finite_tangent: false,
        };
        // the family of the base is that of points of the body, and these are points of the plane
        let mut base = SolidBase::new(body, Arc::default(), constitution, properties);
        let horizon = plane.spec().horizon.of(spacing);
        base.horizons.fill(horizon);
        let points = body.points.len();
        Ok(Laminate {
            base,
            layers: solids,
            interfaces,
            failure,
            heights: layers.layers().iter().map(|layer| layer.z).collect(),
            displacement: vec![[0.0; 3]; points],
            strain: vec![[0.0; 6]; points],
            zeros: SlotField::zeros(&plane),
            work: Work::new(layers.points_of_layer()),
            blocks: Vec::new(),
            gradients: vec![Matrix3::zeros(); points],
            plane,
        })
    }

    /// Number of points of a layer.
    fn points_of_layer(&self) -> usize {
        self.plane.points()
    }
}
