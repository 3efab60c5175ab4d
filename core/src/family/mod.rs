//! Families: all bonds of the points of a body, behind one interface.
//!
//! 1. A physics describes the family it wants ([`FamilySpec`]): horizon, partial-volume rule,
//!    correction, and the faces behind which the body goes on as a mirrored layer.
//! 2. [`Family::build`] leaves out bonds across the body's [`Cut`]s and lays out *slots*: one for each point and one for each layer point
//!    (*ghost*). Kernel inputs live in slot space ([`Family::scatter`], [`Family::fill_layers`],
//!    [`Family::continue_vector`]).
//! 3. [`Family::sum`] evaluates a [`BondKernel`] over all bonds of all points, and
//!    [`Family::sum_unbroken`] over those that are not among the [`BrokenBonds`].
//!
//! Three stores hide behind this. On a lattice, points whose family is complete share one stencil
//! and are swept in contiguous runs with SIMD; all others (at bare surfaces, next to them when bonds
//! are corrected) have weights of their own for that stencil, in blocks. With
//! [`Store::List`](crate::body::Store::List) every point has a row of its own. All add the bonds of a point
//! in the same order, so they agree to rounding. On a cloud every point has a row
//! over the union of its horizon and its dual horizon. Families of points that move ([`Family::moving`]) have
//! rows, too, which are looked for again as points move.

mod blocks;
mod broken;
mod build;
mod calibration;
mod cloud;
#[cfg(test)]
mod cloud_tests;
mod cut;
mod horizon;
mod images;
mod kernel;
mod layer;
mod moving;
mod operator;

pub use broken::BrokenBonds;
pub use cut::Cut;
pub use horizon::Horizon;
pub use kernel::{Bond, BondKernel};
pub use layer::{Continuation, Image, LayerRule, Traction};
pub use operator::Operator;

use std::ops::Range;
use std::sync::OnceLock;

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::body::{Body, Face};
use blocks::Blocks;
use kernel::Pairs;
use layer::Grid;

/// Partial volume of members near the edge of the horizon (spec 02, 1.3; Wang (2025), eq. 4.2).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PartialVolume {
    /// Members with `|xi| <= horizon`, full volumes.
    None,
    /// Members with `|xi| <= horizon`; within half a spacing of the edge the volume falls
    /// linearly to one half.
    #[default]
    Half,
    /// Members with `|xi| < horizon + spacing / 2`; the volume falls linearly to zero.
    Full,
}

/// Slots that a thread fills at a time.
const SLOTS: usize = 1 << 14;

/// Ties such as |xi| = 3 dx belong to the family whatever the rounding, relative.
const TIE: f64 = 1e-9;

/// How the influence of a member falls with its distance (spec 01, 1.4; spec 04, 1.5).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Influence {
    /// The same throughout the horizon.
    #[default]
    Constant,
    /// Falls linearly to zero at the horizon, `1 - |xi| / horizon`.
    Conical,
    /// `exp(-(2 |xi| / horizon)^2)`.
    Gaussian,
    /// `(1 - |xi| / horizon)^3`: `w xi` is then the gradient of the kernel of Wendland (1995), C2, with which points
    /// that move keep apart.
    Wendland,
}

impl Influence {
    /// Influence at a distance given as a share of the horizon.
    pub fn at(self, share: f64) -> f64 {
        self.at_all([share])[0]
    }

    /// Influence at several distances, side by side.
    #[inline(always)]
    fn at_all<const N: usize>(self, shares: [f64; N]) -> [f64; N] {
        match self {
            Influence::Constant => [1.0; N],
            Influence::Conical => shares.map(|s| (1.0 - s).max(0.0)),
            Influence::Gaussian => shares.map(|s| exp_of_few(-4.0 * s * s)),
            Influence::Wendland => shares.map(|s| {
                let rest = (1.0 - s).max(0.0);
                rest * rest * rest
            }),
        }
    }

    /// `integral of w(r) r^(power - 1) dr` from 0 to 1, r as a share of the horizon, by Simpson's rule with an error below
    /// 1e-12.
    pub fn radial_moment(self, power: i32) -> f64 {
        const INTERVALS: i32 = 2000;
        let value = |i: i32| {
            let r = f64::from(i) / f64::from(INTERVALS);
            self.at(r) * r.powi(power - 1)
        };
        let inner: f64 = (1..INTERVALS)
            .map(|i| if i % 2 == 1 { 4.0 } else { 2.0 } * value(i))
            .sum();
        (value(0) + inner + value(INTERVALS)) / (3.0 * f64::from(INTERVALS))
    }
}

/// `exp(x)` for x from -8 to 0, to a few units of rounding: the 16th power of the series for `x / 16`, which
/// vectorises.
#[inline(always)]
fn exp_of_few(x: f64) -> f64 {
    let x = x / 16.0;
    let mut sum = 1.0;
    for n in (1..=14).rev() {
        sum = 1.0 + x / f64::from(n) * sum;
    }
    let squared = sum * sum;
    let fourth = squared * squared;
    let eighth = fourth * fourth;
    eighth * eighth
}

/// What makes a discrete family reproduce the classical energy of conduction, and that of
/// elasticity under isotropic strain; other strains then differ from the continuum by the
/// anisotropy of the lattice.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Correction {
    /// The continuum constants as they are.
    None,
    /// One factor for all bonds, so that a complete family is exact.
    Lattice,
    /// Factors for each point, so that its own family is exact also where a bare surface cuts it
    /// (after Wang (2025), eqs. 4.4 to 4.8); a bond takes the mean of its ends.
    #[default]
    Point,
    /// As `point`, but elasticity is exact under uniaxial strain along each axis, as published.
    Uniaxial,
}

impl Correction {
    /// Whether each point has factors of its own.
    fn is_by_point(self) -> bool {
        matches!(self, Correction::Point | Correction::Uniaxial)
    }
}

/// What a physics asks for.
#[derive(Clone, Debug, PartialEq)]
pub struct FamilySpec {
    /// Radius.
    pub horizon: Horizon,
    /// Rule for members at the edge.
    pub partial_volume: PartialVolume,
    /// Influence of members by their distance.
    pub influence: Influence,
    /// Correction of the bonds.
    pub correction: Correction,
    /// Faces behind which the body continues as a mirrored layer.
    pub layers: Vec<Face>,
    /// Those of `layers` whose exchange with the body is wanted ([`Family::sum_from_layers`]).
    pub audited: Vec<Face>,
}

impl FamilySpec {
    /// A family with a horizon in m, all else by default, and nothing behind the faces.
    pub fn new(horizon: f64) -> Self {
        FamilySpec {
            horizon: Horizon::Length(horizon),
            partial_volume: PartialVolume::default(),
            influence: Influence::default(),
            correction: Correction::default(),
            layers: Vec::new(),
            audited: Vec::new(),
        }
    }

    /// The usual family: a horizon in spacings of each point, default partial volumes and
    /// correction, and, where the body fills its box, mirrored layers behind all faces.
    pub fn mirrored(body: &Body, horizon: f64) -> Self {
        let fills_box = body.fills_box();
        let is_mirrored = |face: &Face| fills_box && face.axis() < body.dimension;
        FamilySpec {
            horizon: Horizon::Spacings(horizon),
            layers: Face::ALL.into_iter().filter(is_mirrored).collect(),
            ..FamilySpec::new(horizon)
        }
    }

    /// How far a point with this horizon (m) holds others of this spacing (m), m.
    #[inline(always)]
    fn reach(&self, horizon: f64, spacing: f64) -> f64 {
        match self.partial_volume {
            PartialVolume::Full => horizon + (0.5 - TIE) * spacing,
            _ => horizon * (1.0 + TIE),
        }
    }

    /// Influence times partial volume of a member of this spacing (m) at a distance (m) in a family
    /// of this horizon (m); zero beyond.
    fn share(&self, horizon: f64, spacing: f64, length: f64) -> f64 {
        self.shares(horizon, [spacing], [length])[0]
    }

    /// [`FamilySpec::share`] of several members, side by side.
    #[inline(always)]
    fn shares<const N: usize>(
        &self,
        horizon: f64,
        spacing: [f64; N],
        length: [f64; N],
    ) -> [f64; N] {
        let mut shares = self.influence.at_all(length.map(|l| l / horizon));
        if self.partial_volume != PartialVolume::None {
            for n in 0..N {
                let inside = horizon + 0.5 * spacing[n] - length[n];
                shares[n] *= (inside / spacing[n]).min(1.0);
            }
        }
        for n in 0..N {
            let reached = length[n] <= self.reach(horizon, spacing[n]);
            shares[n] = if reached { shares[n] } else { 0.0 };
        }
        shares
    }

    /// `integral of w |xi| n_m^2 dV` over a full horizon (m) on `body`, along any axis m, with the
    /// influence function w: what weights of bonds are divided by, and what [`Correction`]
    /// restores, m⁴ (3D). It is that of the energy of conduction under a uniform gradient and of
    /// elasticity under isotropic strain.
    pub fn moment(&self, body: &Body, horizon: f64) -> f64 {
        use std::f64::consts::PI;
        let solid_angle = [2.0, 2.0 * PI, 4.0 * PI][body.dimension - 1];
        let radial = self.influence.radial_moment(body.dimension as i32 + 1);
        let size = horizon.powi(body.dimension as i32 + 1);
        let thickness = if body.dimension == 3 {
            1.0
        } else {
            body.thickness
        };
        solid_angle / body.dimension as f64 * radial * size * thickness
    }
}

/// Mistakes in a family's description.
#[derive(Debug, thiserror::Error)]
pub enum FamilyError {
    /// The horizon is smaller than the distance to the nearest neighbour.
    #[error(
        "the horizon {horizon} m is below the spacing {spacing} m: every family would be empty"
    )]
    HorizonTooSmall {
        /// Horizon, m.
        horizon: f64,
        /// Spacing, m.
        spacing: f64,
    },
    /// More bonds than anybody can compute with.
    #[error("the horizon holds {bonds} neighbours of every point: choose a smaller one")]
    HorizonTooLarge {
        /// Bonds of a complete family.
        bonds: usize,
    },
    /// A tank holds the body, whose points stay.
    #[error("the points of a body in a tank must move, and change neighbours")]
    Tank,
    /// Two points in one place.
    #[error("two points lie at ({}, {}, {}) m", at[0], at[1], at[2])]
    Coincident {
        /// Position, m.
        at: [f64; 3],
    },
    /// A point without a bond.
    #[error("the point at ({}, {}, {}) m has no neighbour within the horizon {horizon} m", at[0], at[1], at[2])]
    Lonely {
        /// Position, m.
        at: [f64; 3],
        /// Horizon, m.
        horizon: f64,
    },
}

/// All bonds of the points of a body.
#[derive(Debug)]
pub struct Family {
    spec: FamilySpec,
    points: usize,
    bonds: usize,
    slots: usize,
    spans: Vec<Span>,
    ghosts: Vec<Ghost>,
    layers: Vec<(Face, Range<usize>)>,
    /// Layer points that faces of several axes mirrored.
    corners: Vec<Ghost>,
    /// Axes along which layers are copies.
    periodic: [bool; 3],
    /// Reference position of each slot along each axis, m; of clouds only.
    places: [Vec<f64>; 3],
    /// Whether all points lie in a plane of constant z.
    flat: bool,
    /// Of lattices only.
    grid: Option<Grid>,
    stencil: Vec<StencilBond>,
    runs: Vec<Span>,
    blocks: Blocks,
    rows: Rows,
    layer_rows: Rows,
    chunks: Vec<Chunk>,
    /// Of families that move, whose slots follow the points in space; else empty, and `spans` tell.
    order: Order,
    /// Of families that move only.
    following: Option<Box<moving::Following>>,
    /// Made by the first kernel that asks for them.
    pairs: OnceLock<Option<Pairs>>,
}

/// Consecutive points in consecutive slots.
#[derive(Clone, Copy, Debug)]
struct Span {
    slot: u32,
    point: u32,
    len: u32,
}

/// Points by slot and slots by point.
#[derive(Debug, Default)]
struct Order {
    point_in: Vec<u32>,
    slot_of: Vec<u32>,
}

impl Order {
    fn new(point_in: Vec<u32>) -> Self {
        let mut slot_of = vec![0; point_in.len()];
        for (slot, &point) in (0..).zip(&point_in) {
            slot_of[point as usize] = slot;
        }
        Order { point_in, slot_of }
    }

    /// Values by slot of values by point.
    fn arrange<T: Copy + Send + Sync>(&self, by_point: &[T], by_slot: &mut [T]) {
        let slots = by_slot.par_iter_mut().zip(&self.point_in);
        let slots = slots.with_min_len(SLOTS);
        slots.for_each(|(value, &point)| *value = by_point[point as usize]);
    }
}

/// A layer point: its slot and the slot that it mirrors, the layer point in that slot if it is one,
/// the point that is its image in the end, and how often each face mirrored it on the way.
#[derive(Clone, Copy, Debug)]
struct Ghost {
    slot: u32,
    source: u32,
    parent: Option<u32>,
    point: u32,
    passes: [u8; 6],
}

impl Ghost {
    /// Whether faces of several axes mirrored it, each once.
    fn is_corner(&self) -> bool {
        let along = self.passes.as_chunks::<2>().0.iter();
        let along = along.map(|[lower, upper]| lower + upper);
        along.clone().filter(|n| *n > 0).count() > 1 && along.max() == Some(1)
    }
}

#[derive(Clone, Copy, Debug)]
struct StencilBond {
    offset: isize,
    bond: Bond,
}

/// Compressed rows of bonds.
#[derive(Debug, Default)]
struct Rows {
    point: Vec<u32>,
    slot: Vec<u32>,
    start: Vec<usize>,
    column: Vec<u32>,
    /// Bond of the stencil that each one is a corrected copy of; on a lattice only.
    step: Vec<u16>,
    weight: Vec<f64>,
    /// Empty where it is the weight, as of families that move.
    dual: Vec<f64>,
}

/// A share of the work, sized to keep all cores busy.
#[derive(Clone, Debug)]
struct Chunk {
    runs: Range<usize>,
    blocks: Range<usize>,
    rows: Range<usize>,
}

impl Family {
    /// The description that it was built from.
    pub fn spec(&self) -> &FamilySpec {
        &self.spec
    }

    /// Number of directed bonds.
    pub fn bonds(&self) -> usize {
        self.bonds
    }

    /// Number of bonds of a point.
    pub fn bonds_of(&self, point: usize) -> usize {
        let mut bonds = 0;
        self.for_each_bond(point, |_, _, _| bonds += 1);
        bonds
    }

    /// Length of a slot array.
    pub fn slots(&self) -> usize {
        self.slots
    }

    /// Share of the points that are swept with the shared stencil.
    pub fn stencil_share(&self) -> f64 {
        self.runs.iter().map(|r| f64::from(r.len)).sum::<f64>() / self.points as f64
    }

    fn is_cloud(&self) -> bool {
        !self.places[0].is_empty()
    }

    /// Bytes held.
    pub fn memory(&self) -> usize {
        self.rows.memory()
            + self.blocks.memory()
            + self.layer_rows.memory()
            + size_of_val(&*self.ghosts)
            + size_of_val(&*self.spans)
            + size_of_val(&*self.order.point_in)
            + size_of_val(&*self.order.slot_of)
            + self.places.iter().map(|x| size_of_val(&**x)).sum::<usize>()
            + self
                .pairs
                .get()
                .and_then(Option::as_ref)
                .map_or(0, Pairs::memory)
    }

    /// Copies one component of a field (point-major, `components` per point) to the slots
    /// of its points.
    pub fn scatter(&self, field: &[f64], components: usize, component: usize, slots: &mut [f64]) {
        if !self.order.point_in.is_empty() {
            let slots = slots.par_iter_mut().zip(&self.order.point_in);
            return slots.with_min_len(SLOTS).for_each(|(value, &point)| {
                *value = field[point as usize * components + component];
            });
        }
        let parts = slots.par_chunks_mut(SLOTS).enumerate();
        parts.for_each(|(number, part)| {
            let (start, end) = (number * SLOTS, number * SLOTS + part.len());
            let from = self
                .spans
                .partition_point(|s| (s.slot + s.len) as usize <= start);
            let spans = self.spans[from..].iter();
            for span in spans.take_while(|s| (s.slot as usize) < end) {
                let (slot, point) = (span.slot as usize, span.point as usize);
                let here = slot.max(start)..(slot + span.len as usize).min(end);
                let first = point + here.start - slot;
                let target = &mut part[here.start - start..here.end - start];
                if components == 1 {
                    target.copy_from_slice(&field[first..][..target.len()]);
                } else {
                    let source = field[first * components + component..]
                        .iter()
                        .step_by(components);
                    target.iter_mut().zip(source).for_each(|(t, s)| *t = *s);
                }
            }
        });
    }
}

impl Rows {
    fn memory(&self) -> usize {
        size_of_val(&*self.column)
            + size_of_val(&*self.step)
            + size_of_val(&*self.weight)
            + size_of_val(&*self.dual)
            + self.point.len() * 16
    }
}
