//! Bodies at whose surface the interface of two fluids meets at an angle: distance and normals behind the surface.
//!
//! At a point of the body at the depth d, with the unit vector N into the body, they follow from those at its mirror point in the fluid,
//!
//! ```text
//! psi' = psi + 2 d cos(theta),   grad psi' = grad psi + 2 [cos(theta) - N . grad psi] N
//! ```
//!
//! which are interpolated between the points of the lattice. Where points of the body are among these, a second sweep takes the values that the
//! first one found there.

use std::collections::BTreeMap;
use std::ops::{Add, Div, Mul};

use nalgebra::Vector3;
use perimelt_core::body::Lattice;
use perimelt_core::family::{ForeignBond, ForeignGhost};
use perimelt_core::{Body, BondKernel};

use crate::fluid::walls::WallBody;

/// Weights of the interpolation below this count as zero.
const LEAST_WEIGHT: f64 = 1e-9;

/// A point this near to the next cell, in spacings, lies in it.
const EDGE: f64 = 1e-6;

/// A corner of the cell of the lattice in which a mirror point lies.
#[derive(Clone, Copy, Debug)]
enum Corner {
    /// A point of the fluid.
    Fluid(usize),
    /// A ghost.
    Ghost(usize),
}

/// A point of the body beside the fluid.
#[derive(Debug)]
struct Ghost {
    /// Below the surface, m.
    depth: f64,
    /// Into the body.
    normal: Vector3<f64>,
    /// Corners around the mirror point, with their weights.
    corners: Vec<(Corner, f64)>,
}

/// Values of a field at the ghosts of a body; none where no point of the fluid is near the mirror point.
#[derive(Debug)]
struct Behind<T> {
    now: Vec<Option<T>>,
    before: Vec<Option<T>>,
}

impl<T> Behind<T>
where
    T: Copy + Default + Add<Output = T> + Mul<f64, Output = T> + Div<f64, Output = T>,
{
    fn new(ghosts: usize) -> Behind<T> {
        Behind {
            now: vec![None; ghosts],
            before: Vec::new(),
        }
    }

    /// Interpolates values of points of the fluid at the mirror points, and continues what is found there.
    fn find(
        &mut self,
        ghosts: &[Ghost],
        of_fluid: impl Fn(usize) -> T,
        continued: impl Fn(&Ghost, T) -> T,
    ) {
        self.now.fill(None);
        for _ in 0..2 {
            self.before.clone_from(&self.now);
            for (ghost, now) in ghosts.iter().zip(&mut self.now) {
                let (mut weights, mut sum) = (0.0, T::default());
                for &(corner, weight) in &ghost.corners {
                    let value = match corner {
                        Corner::Fluid(point) => Some(of_fluid(point)),
                        Corner::Ghost(ghost) => self.before[ghost],
                    };
                    if let Some(value) = value {
                        weights += weight;
                        sum = sum + value * weight;
                    }
                }
                *now = (weights > LEAST_WEIGHT).then(|| continued(ghost, sum / weights));
            }
        }
    }
}

/// The surface of a body in two fluids.
#[derive(Debug)]
pub(in crate::fluid::eulerian) struct WettedBody {
    /// Of the angle in the first fluid; none where the wall has no energy.
    pub(super) cosine: Option<f64>,
    ghosts: Vec<Ghost>,
    /// Ghost of each point of the body that has one.
    ghost_of: BTreeMap<usize, usize>,
    /// m, and its gradient.
    distance: Behind<f64>,
    gradient: Behind<Vector3<f64>>,
}

impl WettedBody {
    /// The surface of `solid`, which is a wall of `fluid`.
    pub(in crate::fluid::eulerian) fn new(
        fluid: &Body,
        solid: &Body,
        wall: &WallBody,
        cosine: Option<f64>,
    ) -> WettedBody {
        let bonded = (0..solid.points.len()).filter(|j| !wall.bonds.bonds_to(*j).is_empty());
        let ghost_of: BTreeMap<usize, usize> = bonded.zip(0..).collect();
        let place = &solid.points.position;
        let mut ghosts = Vec::new();
        if let Some(lattice) = fluid.lattice() {
            let cell = |(j, ghost): (&usize, &usize)| {
                let along = |a: usize| (place[*j][a] - lattice.origin[a]) / lattice.spacing;
                let inside = |a| {
                    if a < fluid.dimension {
                        (along(a) + EDGE).floor()
                    } else {
                        0.0
                    }
                };
                (std::array::from_fn(|a| inside(a) as i64), *ghost)
            };
            let around = Around {
                fluid,
                lattice,
                ghost_in: ghost_of.iter().map(cell).collect(),
            };
            ghosts.extend(ghost_of.keys().map(|&j| {
                let (depth, normal) = wall.surface_behind(solid, j);
                Ghost {
                    depth,
                    normal,
                    corners: around.corners(&(place[j] - 2.0 * depth * normal)),
                }
            }));
        }
        WettedBody {
            cosine,
            distance: Behind::new(ghosts.len()),
            gradient: Behind::new(ghosts.len()),
            ghosts,
            ghost_of,
        }
    }

    /// Finds the distance behind the surface from that by point of the fluid (m).
    pub(super) fn find_distance(&mut self, distance: impl Fn(usize) -> f64) {
        let cosine = self.cosine.unwrap_or(0.0);
        let continued = |ghost: &Ghost, psi: f64| psi + 2.0 * ghost.depth * cosine;
        self.distance.find(&self.ghosts, distance, continued);
    }

    /// Finds the gradient behind the surface from that by point of the fluid.
    pub(super) fn find_gradient(&mut self, gradient: impl Fn(usize) -> Vector3<f64>) {
        let cosine = self.cosine.unwrap_or(0.0);
        let continued = |ghost: &Ghost, gradient: Vector3<f64>| {
            gradient + 2.0 * (cosine - ghost.normal.dot(&gradient)) * ghost.normal
        };
        self.gradient.find(&self.ghosts, gradient, continued);
    }

    /// Distance at a point of the body, m.
    pub(super) fn distance(&self, ghost: &ForeignGhost) -> Option<f64> {
        self.distance.now[*self.ghost_of.get(&ghost.point)?]
    }

    /// Normal of the interface at a point of the body.
    pub(super) fn normal(&self, ghost: &ForeignGhost) -> Option<Vector3<f64>> {
        let gradient = self.gradient.now[*self.ghost_of.get(&ghost.point)?]?;
        Some(ghost.reflect(gradient / (gradient.norm() + f64::MIN_POSITIVE)))
    }

    /// Adds the bonds to the body to the sums of a kernel, with inputs of a point of the fluid and of a point of the body.
    pub(super) fn add<const I: usize, const O: usize>(
        &self,
        wall: &WallBody,
        kernel: &impl BondKernel<I, O>,
        own: impl Fn(usize) -> [f64; I] + Sync,
        behind: impl Fn(&ForeignGhost) -> Option<[f64; I]> + Sync,
        sums: &mut [[f64; O]],
    ) {
        let part = |n: usize| {
            let ForeignBond { bond, point, ghost } = wall.bonds.bond(n);
            let other = behind(ghost);
            other.map_or([0.0; O], |other| kernel.bond(bond, own(point), other))
        };
        let mut found = Vec::new();
        wall.bonds.sum_by_owner(part, &mut found);
        wall.bonds.add_to_owners(&found, sums);
    }

    /// Points of the fluid whose cells touch the body.
    pub(super) fn row<'a>(
        &self,
        wall: &'a WallBody,
        spacing: f64,
    ) -> impl Iterator<Item = usize> + 'a {
        let bonds = (0..wall.bonds.len()).map(|n| wall.bonds.bond(n));
        // across an edge, with a spacing that rounding may have made larger
        let touches = move |bond: &ForeignBond<'_>| bond.bond.length < 1.5 * spacing;
        bonds.filter(touches).map(|bond| bond.point)
    }
}

/// The lattice of a fluid around a body.
struct Around<'a> {
    fluid: &'a Body,
    lattice: &'a Lattice,
    /// Ghost in each cell that has one.
    ghost_in: BTreeMap<[i64; 3], usize>,
}

impl Around<'_> {
    /// Points around a position and their weights; behind the faces of the box the fluid continues.
    fn corners(&self, at: &Vector3<f64>) -> Vec<(Corner, f64)> {
        let (fluid, lattice) = (self.fluid, self.lattice);
        let mut corners = Vec::new();
        for corner in 0..1 << fluid.dimension {
            let (mut cell, mut weight) = ([0; 3], 1.0);
            for a in 0..fluid.dimension {
                let along = (at[a] - lattice.origin[a]) / lattice.spacing - 0.5;
                let (upper, part) = (corner >> a & 1, along - along.floor());
                weight *= if upper == 1 { part } else { 1.0 - part };
                let cells = lattice.cells[a] as i64;
                let number = along.floor() as i64 + upper;
                cell[a] = match fluid.periodic[a] {
                    true => number.rem_euclid(cells),
                    false => number.clamp(0, cells - 1),
                };
            }
            let point = lattice.point(cell).map(Corner::Fluid);
            let found = point.or_else(|| self.ghost_in.get(&cell).copied().map(Corner::Ghost));
            if let Some(found) = found.filter(|_| weight > LEAST_WEIGHT) {
                corners.push((found, weight));
            }
        }
        corners
    }
}
