//! Where the unknown displacement of a solid lives, and what holds and loads it there.
//!
//! Boundaries act on points and faces. The nodes of peridynamic solids are the points, and layers continue the
//! displacement behind faces. The nodes of a staggered solid are the corners of the cells, which lie on the faces. Solvers see
//! nodes only; the field `displacement` is that of points.

use std::borrow::Cow;
use std::cell::Ref;
use std::sync::Arc;

use super::staggered::Corners;
use nalgebra::{Matrix3, Vector3};
use perimelt_core::Body;
use perimelt_core::body::{Positions, Sizes};
use perimelt_core::family::LayerRule;
use perimelt_core::parallel::ParallelLoop;
use rayon::prelude::*;

/// The nodes of a solid.
#[derive(Clone, Debug, Default)]
pub enum Nodes {
    /// The points.
    #[default]
    Points,
    /// The corners of the cells of a lattice.
    Corners(Arc<Corners>),
}

/// Motion of the corners of cells by component, where these are the nodes; else empty.
#[derive(Clone, Debug, Default)]
pub(super) struct CornerMotion {
    /// m.
    pub(super) displacement: Vec<f64>,
    /// m/s; empty in equilibrium.
    pub(super) velocity: Vec<f64>,
    /// Of the last step, N/m³; empty in equilibrium.
    pub(super) force: Vec<f64>,
    /// The body force in it, N/m³; empty in equilibrium.
    pub(super) loads: Vec<f64>,
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
    /// Layers behind faces of the box. Where nodes lie on the faces, their tractions act there.
    pub(super) faces: &'a [LayerRule],
}

/// The sinks of the loads of a body.
pub(super) struct LoadSinks<'a> {
    pub(super) force: Option<Ref<'a, [Vector3<f64>]>>,
    pub(super) moment: Option<Ref<'a, [Matrix3<f64>]>>,
}

impl LoadSinks<'_> {
    /// The loads, with layers behind faces of the box.
    pub(super) fn of_points<'a>(&'a self, faces: &'a [LayerRule]) -> PointLoads<'a> {
        PointLoads {
            force: self.force.as_deref().unwrap_or(&[]),
            moment: self.moment.as_deref().unwrap_or(&[]),
            faces,
        }
    }
}

impl PointLoads<'_> {
    fn is_loaded(&self) -> bool {
        !self.force.is_empty() || self.faces.iter().any(|face| face.traction.is_some())
    }
}

/// Components of nodes that are held; empty where nothing holds them.
#[derive(Clone, Copy, Debug)]
pub(super) struct HeldNodes<'a> {
    /// Number of boundaries that hold each component.
    pub(super) count: &'a [f64],
    /// Sum of the displacements at which they hold it, m.
    pub(super) sum: &'a [f64],
}

/// The corners that are held, with what that was found from.
#[derive(Debug, Default)]
pub(super) struct HeldCorners {
    /// See [`HeldNodes`].
    pub(super) count: Vec<f64>,
    pub(super) sum: Vec<f64>,
    of_points: [Vec<Vector3<f64>>; 2],
    rules: Vec<LayerRule>,
    present: Vec<bool>,
}

impl HeldCorners {
    pub(super) fn new(count: Vec<f64>, sum: Vec<f64>) -> Self {
        HeldCorners {
            count,
            sum,
            ..HeldCorners::default()
        }
    }

    /// Finds the corners that are held again, if what holds them has changed.
    fn follow(&mut self, corners: &Corners, held: Held<'_>, rules: &[LayerRule], present: &[bool]) {
        let is_known = !self.count.is_empty()
            && self.of_points[0] == held.count
            && self.of_points[1] == held.sum
            && self.rules == rules
            && self.present == present;
        if is_known {
            return;
        }
        *self = corners.held(held, rules, present);
        self.of_points = [held.count, held.sum].map(<[_]>::to_vec);
        self.rules = rules.to_vec();
        self.present = present.to_vec();
    }
}

impl HeldNodes<'_> {
    /// Sets held components of a displacement (m) to the mean of the values at which they are held; `movement` then has the
    /// change.
    pub(super) fn place(&self, displacement: &mut [f64], movement: &mut [f64]) {
        let given = self.count.par_iter().zip(self.sum);
        let components = displacement.par_iter_mut().zip(movement).zip(given);
        let components = components.with_min_len(4096);
        components.for_all(|((u, movement), (count, sum))| {
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

    /// Number of nodes.
    pub(super) fn count(&self, body: &Body) -> usize {
        match self {
            Nodes::Points => body.points.len(),
            Nodes::Corners(corners) => corners.position.len(),
        }
    }

    /// Positions, m.
    pub(super) fn positions<'a>(&'a self, body: &'a Body) -> &'a Positions {
        match self {
            Nodes::Points => &body.points.position,
            Nodes::Corners(corners) => &corners.position,
        }
    }

    /// Volumes whose force densities the nodes have, m³: on a lattice, those of its cells.
    pub(super) fn volumes<'a>(&'a self, body: &'a Body) -> &'a Sizes {
        match self {
            Nodes::Points => &body.points.volume,
            Nodes::Corners(corners) => &corners.volume,
        }
    }

    /// Components by node: those of the field of the points, or those of the corners.
    pub(super) fn values<'a>(&self, points: &'a [Vector3<f64>], corners: &'a [f64]) -> &'a [f64] {
        match self {
            Nodes::Points => bytemuck::cast_slice(points),
            Nodes::Corners(_) => corners,
        }
    }

    /// [`Nodes::values`], to be changed.
    pub(super) fn values_mut<'a>(
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

    /// Density (kg/m³) of each node, zero without material: a corner carries its part of the mass of each point around.
    pub(super) fn densities(&self, points: &[f64], present: &[bool]) -> Vec<f64> {
        match self {
            Nodes::Corners(corners) => corners.densities(points, present),
            Nodes::Points if present.is_empty() => points.to_vec(),
            Nodes::Points => {
                let densities = points.iter().zip(present);
                densities
                    .map(|(rho, p)| if *p { *rho } else { 0.0 })
                    .collect()
            }
        }
    }

    /// Force density by component, N/m³, zero without material; empty without loads. Those that differ from the loads of the points
    /// are in `buffer`.
    pub(super) fn loads<'a>(
        &self,
        loads: PointLoads<'a>,
        present: &[bool],
        buffer: &'a mut Vec<f64>,
    ) -> &'a [f64] {
        let of_points: &[f64] = bytemuck::cast_slice(loads.force);
        match self {
            Nodes::Corners(corners) if loads.is_loaded() => {
                corners.loads(loads, present, buffer);
                buffer
            }
            Nodes::Corners(_) => &[],
            Nodes::Points if of_points.is_empty() || present.iter().all(|p| *p) => of_points,
            Nodes::Points => {
                let components = of_points.iter().enumerate();
                buffer.clear();
                buffer.extend(components.map(|(n, b)| if present[n / 3] { *b } else { 0.0 }));
                buffer
            }
        }
    }

    /// What holds the nodes of a body: its points, and faces whose layers follow `rules`.
    pub(super) fn held<'a>(
        &self,
        held: Held<'a>,
        rules: &[LayerRule],
        present: &[bool],
        buffer: &'a mut HeldCorners,
    ) -> HeldNodes<'a> {
        match self {
            Nodes::Points => HeldNodes {
                count: bytemuck::cast_slice(held.count),
                sum: bytemuck::cast_slice(held.sum),
            },
            Nodes::Corners(corners) => {
                buffer.follow(corners, held, rules, present);
                HeldNodes {
                    count: &buffer.count,
                    sum: &buffer.sum,
                }
            }
        }
    }
}
