//! Where the unknown displacement of a solid lives, and what holds and loads it there.
//!
//! Boundaries act on points and faces. The nodes of peridynamic solids are the points, and layers continue the
//! displacement behind faces. The nodes of a staggered solid are the corners of the cells, which lie on the faces. Solvers see
//! nodes only; the field `displacement` is that of points.

use std::borrow::Cow;
use std::sync::Arc;

use nalgebra::{Matrix3, Vector3};
use perimelt_core::Body;
use perimelt_core::family::LayerRule;
use rayon::prelude::*;

use super::staggered::Corners;

/// The nodes of a solid.
#[derive(Clone, Debug, Default)]
pub enum Nodes {
    /// The points.
    #[default]
    Points,
    /// The corners of the cells of a lattice.
    Corners(Arc<Corners>),
}

/// What holds the points of a body; empty where nothing does.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Held<'a> {
    /// Number of boundaries that hold each component.
    pub(super) count: &'a [Vector3<f64>],
    /// Sum of the displacements at which they hold it, m.
    pub(super) sum: &'a [Vector3<f64>],
}

/// Loads of the points of a body; empty where there are none.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct PointLoads<'a> {
    /// Force per volume, N/m³.
    pub(super) force: &'a [Vector3<f64>],
    /// Its first moment about the point, N/m².
    pub(super) moment: &'a [Matrix3<f64>],
}

/// Components of nodes that are held.
#[derive(Clone, Debug)]
pub(super) struct HeldNodes<'a> {
    /// Number of boundaries that hold each component.
    pub(super) count: Cow<'a, [f64]>,
    /// Sum of the displacements at which they hold it, m.
    pub(super) sum: Cow<'a, [f64]>,
}

impl HeldNodes<'_> {
    /// Sets held components of a displacement (m) to the mean of the values at which they are held; `movement` then has the
    /// change.
    pub(super) fn place(&self, displacement: &mut [f64], movement: &mut [f64]) {
        let given = self.count.par_iter().zip(&*self.sum);
        let components = displacement.par_iter_mut().zip(movement).zip(given);
        let components = components.with_min_len(4096);
        components.for_each(|((u, movement), (count, sum))| {
            let before = *u;
            if *count > 0.0 {
                *u = sum / count;
            }
            *movement = *u - before;
        });
    }
}

impl Nodes {
    /// The corners, if they are the nodes.
    pub(super) fn corners(&self) -> Option<&Arc<Corners>> {
        match self {
            Nodes::Points => None,
            Nodes::Corners(corners) => Some(corners),
        }
    }

    /// Positions, m.
    pub(super) fn positions<'a>(&'a self, body: &'a Body) -> &'a [Vector3<f64>] {
        match self {
            Nodes::Points => &body.points.position,
            Nodes::Corners(corners) => &corners.position,
        }
    }

    /// The unknown displacement: the field of the points, or that of the corners.
    pub(super) fn unknowns<'a>(
        &self,
        points: &'a mut [Vector3<f64>],
        corners: &'a mut [f64],
    ) -> &'a mut [f64] {
        match self {
            Nodes::Points => bytemuck::cast_slice_mut(points),
            Nodes::Corners(_) => corners,
        }
    }

    /// Whether each node has material, from whether each point has; empty if all have.
    pub(super) fn present<'a>(&self, points: &'a [bool]) -> Cow<'a, [bool]> {
        match self {
            Nodes::Points => Cow::Borrowed(points),
            Nodes::Corners(corners) => Cow::Owned(corners.present(points)),
        }
    }

    /// Force density by component, N/m³; empty without loads.
    pub(super) fn loads<'a>(&self, loads: PointLoads<'a>, present: &[bool]) -> Cow<'a, [f64]> {
        match self {
            Nodes::Points => Cow::Borrowed(bytemuck::cast_slice(loads.force)),
            Nodes::Corners(_) if loads.force.is_empty() => Cow::Borrowed(&[]),
            Nodes::Corners(corners) => Cow::Owned(corners.loads(loads, present)),
        }
    }

    /// What holds the nodes of a body: its points, and faces whose layers follow `rules`.
    pub(super) fn held<'a>(
        &self,
        held: Held<'a>,
        rules: &[LayerRule],
        present: &[bool],
    ) -> HeldNodes<'a> {
        match self {
            Nodes::Points => HeldNodes {
                count: Cow::Borrowed(bytemuck::cast_slice(held.count)),
                sum: Cow::Borrowed(bytemuck::cast_slice(held.sum)),
            },
            Nodes::Corners(corners) => corners.held(held, rules, present),
        }
    }
}
