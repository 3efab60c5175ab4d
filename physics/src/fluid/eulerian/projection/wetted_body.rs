//! Bodies at whose surface the interface of two fluids meets at an angle: distance and normals behind the surface.
//!
//! At a point of the body at the depth d, with the unit vector N into the body, they follow from those at the distance s before the surface,
//! its mirror point where d is at least half a spacing:
//!
//! ```text
//! psi' = psi + (d + s) cos(theta),   grad psi' = grad psi + (1 + d/s) [cos(theta) - N . grad psi] N
//! ```
//!
//! which are exact for a plane interface and interpolated linearly between the points of the lattice. Points of the body among these have the values
//! that follow from this rule, by sweeps: the steps of a curved surface have no part in it. Two sweeps, of which the first leaves
//! out points without a value, give 72 degrees for 60 on a cylinder.

use std::collections::BTreeMap;
use std::ops::{Add, Div, Mul};

use nalgebra::Vector3;
use perimelt_core::body::Lattice;
use perimelt_core::family::{ForeignBond, ForeignGhost};
use perimelt_core::{Body, BondKernel};

use crate::fluid::walls::WallBody;

/// Weights of the interpolation below this count as zero.
const LEAST_WEIGHT: f64 = 1e-9;

/// Least distance before the surface at which values are taken, in spacings: nearer to it they follow from those behind it, whose sweeps would
/// not converge.
const LEAST_REACH: f64 = 0.5;

/// Sweeps over the ghosts; the change of the last one is below a thousandth of the values on a cylinder.
const SWEEPS: usize = 10;

/// A point this near to the next cell, in spacings, lies in it.
const EDGE: f64 = 1e-6;

/// Where a point of the body lies behind the surface.
#[derive(Clone, Copy, Debug)]
struct Place {
    point: usize,
    /// m.
    at: Vector3<f64>,
    /// Below the surface, m.
    depth: f64,
    /// Into the body.
    normal: Vector3<f64>,
}

/// A point of the body beside the fluid.
#[derive(Debug)]
struct Ghost {
    /// Below the surface, m.
    depth: f64,
    /// From the surface to where values are taken, m.
    reach: f64,
    /// Into the body.
    normal: Vector3<f64>,
    around: Corners,
}

/// Corners of the cell of the lattice around a place, with their weights: points of the fluid, and ghosts.
#[derive(Debug, Default)]
struct Corners {
    fluid: Vec<(usize, f64)>,
    ghosts: Vec<(usize, f64)>,
}

/// Values of a field at the ghosts of a body; none where no point of the fluid is near.
#[derive(Debug)]
struct Behind<T> {
    now: Vec<Option<T>>,
    /// Weights of the points of the fluid around each ghost, and the sum of their values by these.
    known: Vec<(f64, T)>,
}

impl<T> Behind<T>
where
    T: Copy + Default + Add<Output = T> + Mul<f64, Output = T> + Div<f64, Output = T>,
{
    fn new(ghosts: usize) -> Behind<T> {
        Behind {
            now: vec![None; ghosts],
            known: vec![(0.0, T::default()); ghosts],
        }
    }

    /// Interpolates values before the surface, and continues what is found there. Sweeps go over the ghosts in their order and take the values
    /// that are known.
    fn find(
        &mut self,
        ghosts: &[Ghost],
        of_fluid: impl Fn(usize) -> T,
        continued: impl Fn(&Ghost, T) -> T,
    ) {
        self.now.fill(None);
        for (ghost, (weights, sum)) in ghosts.iter().zip(&mut self.known) {
            (*weights, *sum) = (0.0, T::default());
            for &(point, weight) in &ghost.around.fluid {
                *weights += weight;
                *sum = *sum + of_fluid(point) * weight;
            }
        }
        for _ in 0..SWEEPS {
            for (number, ghost) in ghosts.iter().enumerate() {
                let (mut weights, mut sum) = self.known[number];
                for &(other, weight) in &ghost.around.ghosts {
                    if let Some(value) = self.now[other] {
                        weights += weight;
                        sum = sum + value * weight;
                    }
                }
                self.now[number] =
                    (weights > LEAST_WEIGHT).then(|| continued(ghost, sum / weights));
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
        let places = bonded.map(|point| {
            let (depth, normal) = wall.surface_behind(solid, point);
            Place {
                point,
                at: solid.points.position.at(point),
                depth,
                normal,
            }
        });
        WettedBody::of(fluid, &places.collect::<Vec<_>>(), cosine)
    }

    /// A surface in `fluid` with the points of a body at these places.
    fn of(fluid: &Body, places: &[Place], cosine: Option<f64>) -> WettedBody {
        let mut ghosts = Vec::new();
        if let Some(lattice) = fluid.lattice() {
            let cell = |(ghost, place): (usize, &Place)| {
                let along = |a: usize| (place.at[a] - lattice.origin[a]) / lattice.spacing;
                let inside = |a| {
                    if a < fluid.dimension {
                        (along(a) + EDGE).floor()
                    } else {
                        0.0
                    }
                };
                (std::array::from_fn(|a| inside(a) as i64), ghost)
            };
            let around = Around {
                fluid,
                lattice,
                ghost_in: places.iter().enumerate().map(cell).collect(),
            };
            ghosts.extend(places.iter().map(|place| {
                let Place { depth, normal, .. } = *place;
                let reach = depth.max(LEAST_REACH * lattice.spacing);
                Ghost {
                    depth,
                    reach,
                    normal,
                    around: around.corners(&(place.at - (depth + reach) * normal)),
                }
            }));
        }
        WettedBody {
            cosine,
            distance: Behind::new(ghosts.len()),
            gradient: Behind::new(ghosts.len()),
            ghosts,
            ghost_of: places.iter().map(|place| place.point).zip(0..).collect(),
        }
    }

    /// Finds the distance behind the surface from that by point of the fluid (m).
    pub(super) fn find_distance(&mut self, distance: impl Fn(usize) -> f64) {
        let cosine = self.cosine.unwrap_or(0.0);
        let continued = |ghost: &Ghost, psi: f64| psi + (ghost.depth + ghost.reach) * cosine;
        self.distance.find(&self.ghosts, distance, continued);
    }

    /// Finds the gradient behind the surface from that by point of the fluid.
    pub(super) fn find_gradient(&mut self, gradient: impl Fn(usize) -> Vector3<f64>) {
        let cosine = self.cosine.unwrap_or(0.0);
        let continued = |ghost: &Ghost, gradient: Vector3<f64>| {
            let rise = 1.0 + ghost.depth / ghost.reach;
            gradient + rise * (cosine - ghost.normal.dot(&gradient)) * ghost.normal
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
    fn corners(&self, at: &Vector3<f64>) -> Corners {
        let (fluid, lattice) = (self.fluid, self.lattice);
        let mut corners = Corners::default();
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
            if weight <= LEAST_WEIGHT {
                continue;
            }
            if let Some(point) = lattice.point(cell) {
                corners.fluid.push((point, weight));
            } else if let Some(ghost) = self.ghost_in.get(&cell) {
                corners.ghosts.push((*ghost, weight));
            }
        }
        corners
    }
}

#[cfg(test)]
mod tests {
    use perimelt_core::shape::{BoxShape, Difference, HalfSpace, Shape};

    use super::*;

    const SPACING: f64 = 0.1;

    /// A fluid above an inclined plane through a place near the middle of a box, and the places of two rows of cells behind it, whose cells
    /// make steps of the plane.
    fn above_plane(out: Vector3<f64>, offset: f64) -> (Body, Vec<Place>) {
        let through = Vector3::new(1.0, 1.0 + offset, 1.0);
        let dimension = if out.z == 0.0 { 2 } else { 3 };
        let max = [2.0, 2.0, if dimension == 3 { 2.0 } else { SPACING }];
        let cells = Shape::Box(BoxShape { min: [0.0; 3], max });
        let fluid = Shape::Difference(Difference {
            from: Box::new(cells.clone()),
            subtract: Box::new(Shape::HalfSpace(HalfSpace {
                point: through.into(),
                normal: out.into(),
            })),
        });
        let fill = |shape: &Shape| Body::fill("b", shape, dimension, SPACING, SPACING);
        let fluid = fill(&fluid).expect("a fluid");
        let all = fill(&cells).expect("a box").points.position;
        let depth = |x: &Vector3<f64>| {
            let level = if dimension == 3 { x.z } else { through.z };
            -out.dot(&(Vector3::new(x.x, x.y, level) - through))
        };
        let behind = all
            .iter()
            .filter(|x| (0.0..2.5 * SPACING).contains(&depth(x)));
        let places = behind.enumerate().map(|(point, at)| Place {
            point,
            at: *at,
            depth: depth(at),
            normal: -out,
        });
        let places = places.collect();
        (fluid, places)
    }

    /// The distance from a plane interface that meets an inclined wall at its angle, and its gradient, continue behind the steps of the wall wherever
    /// these lie.
    #[test]
    fn a_plane_interface_continues_behind_the_steps_of_an_inclined_wall() {
        let slopes = [
            Vector3::new(0.6, 0.8, 0.0),
            Vector3::new(-0.5_f64.sqrt(), 0.5_f64.sqrt(), 0.0),
            Vector3::new(0.48, 0.8, 0.36),
        ];
        for out in slopes {
            for (offset, angle) in [
                (0.0, 60.0_f64),
                (0.017, 60.0),
                (0.043, 135.0),
                (0.081, 30.0),
            ] {
                let (fluid, places) = above_plane(out, offset);
                let cosine = angle.to_radians().cos();
                let along = out.cross(&Vector3::z()).normalize();
                let slope = -cosine * out + (1.0 - cosine * cosine).sqrt() * along;
                let mut body = WettedBody::of(&fluid, &places, Some(cosine));
                let place = &fluid.points.position;
                body.find_distance(|point| slope.dot(&place[point]));
                body.find_gradient(|_| slope);
                let inner = |x: &Place| {
                    let axes = 0..fluid.dimension;
                    axes.into_iter().all(|a| (0.6..1.4).contains(&x.at[a]))
                };
                let mut compared = 0;
                for (ghost, x) in places.iter().enumerate().filter(|(_, x)| inner(x)) {
                    let found = body.distance.now[ghost].expect("fluid nearby");
                    let error = (found - slope.dot(&x.at)).abs();
                    // what sweeps leave
                    assert!(error < 2e-3 * SPACING, "{out:?} {offset} {angle}: {error}");
                    let found = body.gradient.now[ghost].expect("fluid nearby");
                    assert!((found - slope).norm() < 2e-3, "{out:?} {offset}: {found:?}");
                    compared += 1;
                }
                assert!(compared > 10, "{compared}");
            }
        }
    }
}
