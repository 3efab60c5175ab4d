//! Laminates: bonds within each layer of a lay-up, and between layers.
//!
//! All layers have the family of one plane grid; what differs by ply is the stiffness of the bonds by their direction
//! (`weights`), and whether they run along fibres. Within a layer a bond resists its stretch, and a point its dilatation; between two layers
//! crossing pairs of bonds resist shear, and bonds between points above each other resist opening. Forces are the derivative of the energy of
//! all of them (`kernels`; docs/theory/laminates.md).
//!
//! Near free edges the bonds have the stiffness of the interior times the correction of the family; bonds along the fibres
//! have a correction of their own, as the rows of fibres end elsewhere than the family does.

mod added_inertia;
#[cfg(test)]
mod added_inertia_tests;
mod breaking;
mod constants;
mod crack;
mod failure;
#[cfg(test)]
mod failure_tests;
mod force;
mod frequency;
mod interface;
mod kernels;
mod law;
mod limits;
mod loads;
mod solid;
mod strength;
#[cfg(test)]
mod temperature_tests;
#[cfg(test)]
mod tests;
mod weights;

use std::sync::Arc;

use nalgebra::Matrix3;
use perimelt_core::body::{Horizons, Layer, Layers};
use perimelt_core::family::Mirrored;
use perimelt_core::{Body, Family, SetupError, SlotField, text};

use super::base::{Properties, SolidBase};
use super::solid::Constitution;
use crate::plies::{CompleteFamily, fibre_factors, uncut};
use added_inertia::AddedInertia;
use constants::{PlyConstants, PlyPoints, PlyState};
use failure::{Failure, LaminateParts};
use interface::Interface;
use kernels::{FIBRE, INPUTS, MATRIX};
pub(super) use law::no_layup;
pub use law::{Lamina, OfPlies};
use limits::LoadedParts;
pub use strength::PlyStrength;
use weights::{NoBonds, PARTS, PlyBonds};

/// A layer of points.
#[derive(Debug)]
struct LayerSolid {
    bonds: PlyBonds,
    /// `a` of the dilatation by point of the plane, Pa.
    dilatation: Vec<f64>,
    /// Whether one of them is not zero.
    has_dilatation: bool,
    /// m.
    thickness: f64,
    /// Factors that calibrate the bonds along the fibres, by point of the plane; empty where they are one.
    fibre_factors: Vec<f64>,
    /// Inputs of the kernels by slot of the plane.
    slots: [SlotField; INPUTS],
}

impl LayerSolid {
    /// Takes the constants of the points.
    fn load(&mut self, plane: &Family, constants: &[PlyConstants]) {
        for (own, constants) in self.dilatation.iter_mut().zip(constants) {
            *own = constants.ply.reduced().dilatation();
        }
        self.has_dilatation |= self.dilatation.iter().any(|a| *a != 0.0);
        let parts = |point: usize| constants[point].ply.reduced().of_bonds();
        for part in 0..PARTS {
            let of_point = |point: usize| parts(point)[part];
            self.slots[MATRIX + part].load(plane, of_point, Mirrored::Scalar);
        }
        let bonds = self.bonds;
        self.load_fibres(plane, |point| bonds.increment(parts(point)));
    }

    /// Takes what the fibres of each point add to the stiffness of the bonds along them, Pa.
    fn load_fibres(&mut self, plane: &Family, increment: impl Fn(usize) -> f64 + Sync) {
        let factors = &self.fibre_factors;
        let calibrated =
            |point: usize| factors.get(point).copied().unwrap_or(1.0) * increment(point);
        self.slots[FIBRE].load(plane, calibrated, Mirrored::Scalar);
    }
}

/// The solid of a laminate.
#[derive(Debug)]
pub struct Laminate {
    base: SolidBase,
    plies: PlyPoints,
    /// The family of each layer.
    plane: Arc<Family>,
    layers: Vec<LayerSolid>,
    interfaces: Vec<Interface>,
    /// Position of each layer along z, m.
    heights: Vec<f64>,
    /// By point and axis, m.
    displacement: Vec<[f64; 3]>,
    /// Stress-free strain of each point: xx, yy, zz, xy, yz, zx; empty until there is one.
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
    /// Inertia of motion across the layers, in explicit motion.
    added_inertia: AddedInertia,
}

/// Sums over the bonds of a layer, by point of the plane.
#[derive(Debug)]
struct Work {
    scalars: Vec<[f64; 1]>,
    vectors: Vec<[f64; 3]>,
    pairs: Vec<[f64; 6]>,
    /// Of fibres by themselves.
    added: Vec<f64>,
    /// Loads of an interface over its limits, by point and by slot.
    loads: Vec<f64>,
    load_slots: SlotField,
}

impl Work {
    fn new(points: usize) -> Self {
        Work {
            scalars: vec![[0.0]; points],
            vectors: vec![[0.0; 3]; points],
            pairs: vec![[0.0; 6]; points],
            added: Vec::new(),
            loads: Vec::new(),
            load_slots: SlotField::default(),
        }
    }
}

/// Directed bonds of a number of layers: those of each plane, and, between two of them, those of points above each other and the crossing ones.
pub(super) fn bonds_of_layers(layers: usize, plane: &Family) -> usize {
    let across = 2 * (plane.points() + plane.bonds());
    layers * plane.bonds() + layers.saturating_sub(1) * across
}

/// What is wrong with a ply in a state whose bonds have no positive stiffness.
fn refusal(layers: &Layers, layer: &Layer, state: &PlyState, reason: NoBonds) -> SetupError {
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
                "a ply at {angle} degrees of {} would have bonds of negative stiffness at {bond:.1} degrees from its fibres{why}",
                state.name
            );
            SetupError::value(
                "law.lamina",
                message,
                "plies at 0, 90, 45 or -45 degrees, or moduli that differ less by direction",
            )
        }
    }
}

/// The layers without the constants of their points.
///
/// # Errors
/// A ply whose bonds have no positive stiffness.
fn solids(
    layers: &Layers,
    plane: &Arc<Family>,
    complete: &CompleteFamily,
    plies: &PlyPoints,
) -> Result<Vec<LayerSolid>, SetupError> {
    let uncut = uncut(layers.plane(), plane).map_err(|e| SetupError::new("horizon", e))?;
    let solid_of = |layer: &Layer| {
        let (sin, cos) = layers.plies()[layer.ply].angle.sin_cos();
        let first = &plies.states[0];
        let bonds = PlyBonds::new(complete, [cos, sin]);
        let mut bonds = bonds.map_err(|reason| refusal(layers, layer, first, reason))?;
        for state in &plies.states {
            let checked = bonds.check(complete, state.constants.ply.reduced().of_bonds());
            checked.map_err(|reason| refusal(layers, layer, state, reason))?;
        }
        bonds.uniform = first.constants.ply.reduced().of_bonds();
        Ok(LayerSolid {
            dilatation: vec![0.0; layers.points_of_layer()],
            has_dilatation: false,
            thickness: layer.thickness,
            fibre_factors: match bonds.has_fibres() {
                true => fibre_factors(&uncut, complete, bonds.fibre),
                false => Vec::new(),
            },
            slots: std::array::from_fn(|_| SlotField::zeros(plane)),
            bonds,
        })
    };
    layers.layers().iter().map(solid_of).collect()
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
        mut constitution: Constitution,
        plies: PlyPoints,
    ) -> Result<Self, SetupError> {
        let spacing = body.finest_spacing();
        let complete = CompleteFamily::new(spacing, plane.spec());
        let complete = complete.map_err(|e| SetupError::new("horizon", e))?;
        let solids = solids(layers, &plane, &complete, &plies)?;
        let pairs = layers.layers().windows(2);
        let interfaces: Result<Vec<Interface>, SetupError> = pairs
            .map(|pair| Interface::new(layers, [&pair[0], &pair[1]], &complete, &plies))
            .collect();
        let interfaces = interfaces?;
        let failure = constitution.failure.take().map(|strength| {
            let parts = LaminateParts {
                layers,
                plane: &plane,
                complete: &complete,
                solids: &solids,
                interfaces: &interfaces,
            };
            Failure::new(&parts, strength)
        });
        let properties = Properties {
            bonds_shear: true,
            has_symmetric_plastic_tangent: true,
            has_finite_tangent: false,
        };
        // the family of the base is that of points of the body, and these are points of the plane
        let mut base = SolidBase::new(body, Arc::default(), constitution, properties);
        let horizon = plane.spec().horizon.of(spacing);
        base.horizons = Horizons::uniform(horizon);
        let points = body.points.len();
        let mut laminate = Laminate {
            base,
            plies,
            layers: solids,
            interfaces,
            failure,
            heights: layers.layers().iter().map(|layer| layer.z).collect(),
            displacement: vec![[0.0; 3]; points],
            strain: Vec::new(),
            zeros: SlotField::zeros(&plane),
            work: Work::new(layers.points_of_layer()),
            blocks: Vec::new(),
            gradients: vec![Matrix3::zeros(); points],
            added_inertia: AddedInertia::default(),
            plane,
        };
        laminate.load_constants();
        laminate.load_limits(body, None);
        Ok(laminate)
    }

    /// Passes the constants of the points to the bonds.
    fn load_constants(&mut self) {
        let points = self.points_of_layer();
        let by_point = &self.plies.by_point;
        for (layer, constants) in self.layers.iter_mut().zip(by_point.chunks(points)) {
            layer.load(&self.plane, constants);
        }
        for (number, interface) in self.interfaces.iter_mut().enumerate() {
            let of_layer = |layer: usize| &by_point[layer * points..][..points];
            interface.load(&self.plane, [number, number + 1].map(of_layer));
        }
        self.blocks.clear();
    }

    /// Evaluates the limits of the bonds at the temperature of each point, K.
    fn load_limits(&mut self, body: &Body, temperature: Option<&[f64]>) {
        if let Some(failure) = &mut self.failure {
            let parts = LoadedParts {
                plane: &self.plane,
                constants: &self.plies.by_point,
                interfaces: &self.interfaces,
            };
            failure.limits.load(&parts, body, temperature);
        }
    }

    /// Number of points of a layer.
    fn points_of_layer(&self) -> usize {
        self.plane.points()
    }
}
