//! The reference shapes of walls: their bonds to the fluid, their surfaces, and how far they are displaced.

use nalgebra::{Matrix3, Vector3};
use perimelt_core::family::{ForeignBond, Places};
use perimelt_core::text::position;
use perimelt_core::world::BodyIndex;
use perimelt_core::{Body, Family, Setup, SetupError, World};

use super::Immersed;
use crate::fluid::eulerian::point_motion::LEAST_DISTORTION;
use crate::fluid::walls::wall_motion::shortest;
use crate::fluid::walls::{WallBody, Walls};
use crate::shape_tensor::{CompleteFamily, Completion};

/// Least content of a family that walls complete, as a fraction of a complete one.
const LEAST_CONTENT: f64 = 0.8;

/// Where the surface of walls lies beside the points of the fluid.
struct Surface {
    /// Distance of each fluid point from the cells of walls, m.
    distance: Vec<f64>,
    /// A vector from each fluid point towards walls.
    towards: Vec<Vector3<f64>>,
}

impl Walls {
    /// Takes the walls in their reference shapes; they must complete the families of the fluid.
    pub(crate) fn immerse(
        &mut self,
        setup: &Setup<'_>,
        body: BodyIndex,
        family: &Family,
        complete: &CompleteFamily,
    ) -> Result<(), SetupError> {
        if complete.content == 0.0 {
            let message =
                "bonds as long as the horizon have no weight, so that points have no families";
            return Err(SetupError::value(
                "horizon",
                message,
                "at least 1.5 (spacings)",
            ));
        }
        let fluid = setup.body(body);
        for wall in &mut self.bodies {
            let solid = setup.body(wall.wall.other);
            wall.bonds
                .follow(Places::reference(fluid), Places::reference(solid));
        }
        let bonds = self.bodies.iter().map(|wall| &wall.bonds);
        let completion = Completion::of(fluid.points.len(), family, bonds);
        self.check_completion(setup, fluid, complete, &completion)?;
        let surface = self.surface(setup, fluid);
        for wall in &mut self.bodies {
            completion.correct(&mut wall.bonds);
            let solid = setup.body(wall.wall.other);
            let spacing = fluid.finest_spacing();
            let immersed = Immersed::new(wall, &surface, &solid.points.position, spacing);
            wall.immersed = Some(immersed);
        }
        Ok(())
    }

    /// Refuses families of the fluid that walls do not complete.
    fn check_completion(
        &self,
        setup: &Setup<'_>,
        fluid: &Body,
        complete: &CompleteFamily,
        completion: &Completion,
    ) -> Result<(), SetupError> {
        let spacing = fluid.finest_spacing();
        let walls = self.bodies.iter();
        let walls: Vec<&Body> = walls.map(|wall| setup.body(wall.wall.other)).collect();
        let has_other_spacing =
            |wall: &&&Body| (wall.finest_spacing() - spacing).abs() > 1e-6 * spacing;
        for (point, x) in fluid.points.position.iter().enumerate() {
            let at_walls = completion.at_walls[point];
            let is_alone =
                at_walls == 0.0 && completion.asymmetry(point) > 1e-6 * complete.content * spacing;
            let found = (completion.content[point] + at_walls) / complete.content;
            if !is_alone && found >= LEAST_CONTENT {
                continue;
            }
            let at = position(*x);
            let message = match walls.iter().find(has_other_spacing) {
                Some(wall) if at_walls > 0.0 || found >= LEAST_CONTENT => format!(
                    "the points of the wall `{}`, {} m apart, do not continue those of the fluid, {spacing} m apart, beside the point at \
                     {at} m: its family holds {:.0} % of a complete one, and is not symmetric",
                    wall.name,
                    wall.finest_spacing(),
                    100.0 * found
                ),
                _ => format!(
                    "beside the point at {at} m there is neither fluid nor a wall: its family holds {:.0} % of a complete one{}",
                    100.0 * found,
                    match at_walls == 0.0 {
                        true => ", and no point of a wall",
                        false => "",
                    }
                ),
            };
            let expected = "an Eulerian fluid without free surface and without a gap at bodies that are walls, whose points lie on \
                            the lattice of the fluid and that are at least as thick as its horizon or two rows of its points";
            return Err(SetupError::value("description", message, expected));
        }
        Ok(())
    }

    fn surface(&self, setup: &Setup<'_>, fluid: &Body) -> Surface {
        let points = fluid.points.len();
        let mut surface = Surface {
            distance: vec![f64::INFINITY; points],
            towards: vec![Vector3::zeros(); points],
        };
        for wall in &self.bodies {
            let solid = setup.body(wall.wall.other);
            for n in 0..wall.bonds.len() {
                let ForeignBond { bond, point, ghost } = wall.bonds.bond(n);
                surface.towards[point] += bond.weight * Vector3::from(bond.xi);
                let half = 0.5 * solid.points.spacing[ghost.point];
                let beside = bond.xi.map(|x| (x.abs() - half).max(0.0));
                let in_plane = |a, _| if a < fluid.dimension { beside[a] } else { 0.0 };
                let distance = Vector3::from_fn(in_plane).norm();
                surface.distance[point] = distance.min(surface.distance[point]);
            }
        }
        surface
    }

    /// Reference positions of the points of each wall, m.
    pub(crate) fn places(&self) -> Vec<&[Vector3<f64>]> {
        let walls = self.bodies.iter().filter_map(|w| w.immersed.as_ref());
        walls.map(|immersed| &immersed.position[..]).collect()
    }

    /// Displacements of the points of each wall, m.
    pub(crate) fn displacements(&self) -> Vec<&[Vector3<f64>]> {
        let walls = self.bodies.iter().filter_map(|w| w.immersed.as_ref());
        walls.map(|immersed| &immersed.displacement[..]).collect()
    }

    /// Maps the bonds of the reference shapes by the cofactors at their fluid points. They are corrected as those of points at rest:
    /// `open(point)` is half of `sum w (C_i + C_j) xi V` over the fluid, which with `sum w C_i xi V` over walls adds up to zero.
    pub(crate) fn map_bonds(
        &mut self,
        points: usize,
        cofactors: impl Fn(usize) -> Matrix3<f64>,
        open: impl Fn(usize) -> Vector3<f64>,
    ) {
        let mut sums = vec![(0.0, Vector3::zeros()); points];
        for wall in &mut self.bodies {
            let Some(immersed) = &wall.immersed else {
                continue;
            };
            let mut reference = immersed.xi.iter();
            wall.bonds.for_each_mut(|point, bond| {
                let xi = reference.next().map_or(bond.xi, |xi| *xi);
                let mapped = cofactors(point) * Vector3::from(xi);
                bond.xi = mapped.into();
                sums[point].0 += bond.weight;
                sums[point].1 += bond.weight * mapped;
            });
        }
        for wall in &mut self.bodies {
            wall.bonds.for_each_mut(|point, bond| {
                // members in the skin have weight zero
                let (weight, sum) = sums[point];
                if weight > 0.0 {
                    let correction = (sum + open(point)) / weight;
                    (0..3).for_each(|a| bond.xi[a] -= correction[a]);
                }
            });
        }
    }

    /// Takes the displacements of the walls relative to those of the fluid, `of_fluid(place)` (m).
    pub(crate) fn displace_relative(&mut self, of_fluid: impl Fn(&Vector3<f64>) -> Vector3<f64>) {
        for immersed in self.bodies.iter_mut().filter_map(|w| w.immersed.as_mut()) {
            immersed.find_shift(&of_fluid);
        }
    }

    /// Largest displacement of a wall along its normal beside the fluid in spacings of the fluid, and the name of the wall.
    pub(crate) fn largest_displacement(&self) -> Option<(f64, &str)> {
        let of_wall = |wall: &'_ WallBody| {
            let immersed = wall.immersed.as_ref()?;
            let shifts = immersed.surface_shift.iter();
            Some(shifts.fold(0.0, |a: f64, s| a.max(s.abs())) / immersed.spacing)
        };
        let all = self.bodies.iter();
        let all = all.filter_map(|wall| Some((of_wall(wall)?, &wall.name[..])));
        all.max_by(|a, b| a.0.total_cmp(&b.0))
    }
}

impl Immersed {
    /// A wall with corrected bonds. The normal of a wall point is the mean over the fluid around it, whose points see more of the wall than it sees of
    /// them.
    fn new(wall: &WallBody, surface: &Surface, position: &[Vector3<f64>], spacing: f64) -> Self {
        let bonds = &wall.bonds;
        let mut sums: Vec<[f64; 5]> = Vec::new();
        let part = |n: usize| {
            let ForeignBond { bond, point, ghost } = bonds.bond(n);
            let out = surface.towards[point]
                .try_normalize(0.0)
                .unwrap_or_else(Vector3::zeros);
            let out = -ghost.reflect(out);
            [out.x, out.y, out.z, surface.distance[point], 1.0].map(|x| bond.dual * x)
        };
        bonds.sum_by_foreign(part, &mut sums);
        let normal = |[x, y, z, ..]: &[f64; 5]| {
            let sum = Vector3::new(*x, *y, *z);
            sum.try_normalize(0.0).unwrap_or_else(Vector3::zeros)
        };
        let normal: Vec<_> = sums.iter().map(normal).collect();
        let mean = |[.., sum, weight]: &[f64; 5]| if *weight > 0.0 { sum / weight } else { 0.0 };
        let depth = |n: usize| {
            let ForeignBond { bond, point, ghost } = bonds.bond(n);
            let way = ghost.reflect(-Vector3::from(bond.xi));
            normal[ghost.point].dot(&way) - surface.distance[point]
        };
        let mut depths: Vec<[f64; 1]> = Vec::new();
        bonds.sum_by_foreign(|n| [bonds.bond(n).bond.dual * depth(n)], &mut depths);
        let below = depths.iter().zip(&sums);
        let below = below.map(|([depth], [.., weight])| match *weight > 0.0 {
            true => depth / weight,
            false => 0.0,
        });
        Immersed {
            mean_distance: sums.iter().map(mean).collect(),
            mean_depth: below.collect(),
            depth: (0..bonds.len()).map(depth).collect(),
            position: position.to_vec(),
            displacement: vec![Vector3::zeros(); normal.len()],
            xi: (0..bonds.len()).map(|n| bonds.bond(n).bond.xi).collect(),
            surface_shift: vec![0.0; normal.len()],
            mean_velocity: vec![Vector3::zeros(); normal.len()],
            velocity_slope: vec![Vector3::zeros(); normal.len()],
            fluid_ends: Vec::new(),
            flux: Vec::new(),
            spacing,
            normal,
        }
    }

    /// Finds how far the surface at each point is displaced along its normal with respect to a fluid displaced by `of_fluid(place)`
    /// (m), as a distance between points that rest: over the stretch of the fluid there.
    fn find_shift(&mut self, of_fluid: impl Fn(&Vector3<f64>) -> Vector3<f64>) {
        let along = |j: usize| {
            let normal = &self.normal[j];
            if *normal == Vector3::zeros() {
                return 0.0;
            }
            let surface = self.position[j] + self.mean_depth[j] * normal;
            let here = of_fluid(&surface);
            let beside = of_fluid(&(surface + self.spacing * normal));
            let stretch = 1.0 + normal.dot(&(beside - here)) / self.spacing;
            normal.dot(&(self.displacement[j] - here)) / stretch.max(LEAST_DISTORTION)
        };
        self.surface_shift = (0..self.normal.len()).map(along).collect();
    }
}

impl WallBody {
    /// Depth (m) of a point of an immersed wall below its surface, and the unit vector from there into the wall: those of the
    /// shape of the body where its cells make steps of it.
    pub(crate) fn surface_behind(&self, solid: &Body, point: usize) -> (f64, Vector3<f64>) {
        let Some(immersed) = &self.immersed else {
            return (0.0, Vector3::zeros());
        };
        let at = solid.points.position.at(point);
        let outward = immersed.normal[point];
        match solid.surface_near(at, outward) {
            Some(part) => ((part.foot - at).dot(&part.normal), -part.normal),
            None => (immersed.mean_depth[point], -outward),
        }
    }

    /// Takes the displacement of the points of an immersed wall, from where they are now (m).
    pub(crate) fn displace(&mut self, world: &World, now: &[Vector3<f64>]) {
        let Some(immersed) = &mut self.immersed else {
            return;
        };
        let body = world.body(self.wall.other);
        let points = now.iter().zip(&immersed.position);
        let way = |(x, from): (&Vector3<f64>, _)| shortest(body, x - from);
        immersed.displacement.clear();
        immersed.displacement.extend(points.map(way));
        immersed.find_shift(|_| Vector3::zeros());
    }
}
