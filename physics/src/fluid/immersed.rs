//! Walls that are bodies for a fluid whose points rest on a lattice (`description = "eulerian"`).
//!
//! The lattice stays, and so do the bonds to the points of a wall: they are those of the *reference shape* of the wall, while its
//! points give velocity and displacement. Small displacements count to first order, up to half a spacing of the fluid. Where the
//! points of the fluid follow the walls ([`super::point_motion`]), only the displacement of a wall relative to them is small, and
//! `xi` has the cofactors at the fluid point.
//!
//! At set-up the bonds of each fluid point i are corrected,
//!
//! ```text
//! xi <- xi - sum_all w xi V / sum_walls w V
//! ```
//!
//! so that `sum w xi V = 0` as in a complete family, also where steps of the lattice and a curved wall do not fit: a uniform
//! pressure then exerts no force, and a fluid that does not flow towards the wall is not compressed. Behind the wall, with the
//! mean `<f>_j = sum_i w f_i V_i / sum_i w V_i` over the fluid around a wall point,
//!
//! ```text
//! p_j   = <p_i + f_i . xi>                                     as at walls of moving points
//! N_ij  = w [rho_i (v_i - v_w) . xi / a + q_j],  sum_i N_ij V_i = 0   determines q_j: what enters a wall point leaves it
//! v_ij  = v_w - G_j (e_ij + s_j),   G_j = (<v>_j - v_w) / (<d>_j - s_j)   for viscosity
//! ```
//!
//! with the distance d of a fluid point from the surface, the depth e of the end of a bond below it, and the displacement s
//! of the wall along its normal into the fluid. The velocity is extrapolated linearly through the surface where it is now: the
//! steps of a curved wall do not count, and a displacement by a fraction of a spacing does. d is the distance from the cells of
//! the wall, so that a wall of finer points has a smoother surface. A wall with slip has no viscous force.
//!
//! What a bond does to the fluid, the wall point gets with the opposite sign, as an impulse.

use nalgebra::{Matrix3, Vector3};
use perimelt_core::family::Places;
use perimelt_core::world::BodyIndex;
use perimelt_core::{Body, BondKernel, Family, Setup, SetupError, SlotField, World};

use crate::shape_tensor::{CompleteFamily, Completion};

use super::point_motion::LEAST_DISTORTION;
use super::walls::{WallBody, Walls};

/// Largest displacement of a wall along its normal, in spacings of the fluid.
pub(super) const LARGEST_DISPLACEMENT: f64 = 0.5;

/// Least content of a family that walls complete, as a fraction of a complete one.
const LEAST_CONTENT: f64 = 0.8;

/// Least distance over which the velocity is extrapolated, in spacings of the fluid.
const LEAST_DISTANCE: f64 = 0.25;

/// A wall in its reference shape, by its points or bonds.
#[derive(Debug, Default)]
pub(super) struct Immersed {
    /// From the wall into the fluid, by point; zero away from the fluid.
    pub(super) normal: Vec<Vector3<f64>>,
    /// `<d>`, by point, m.
    distance: Vec<f64>,
    /// `e`, by bond, m.
    depth: Vec<f64>,
    /// Its mean, by point, m.
    below: Vec<f64>,
    /// Reference positions of the points, m.
    position: Vec<Vector3<f64>>,
    /// Displacement of the points since then, m.
    displacement: Vec<Vector3<f64>>,
    /// Corrected bonds of the reference shape, m.
    xi: Vec<[f64; 3]>,
    /// `s`, by point, m.
    shift: Vec<f64>,
    /// `<v>`, by point, m/s.
    mean: Vec<Vector3<f64>>,
    /// `G`, by point, 1/s.
    slope: Vec<Vector3<f64>>,
    /// Fluid end of each bond.
    own: Vec<FluidEnd>,
    /// Flux of mass of each bond, kg/(m³ s).
    flux: Vec<f64>,
    /// Spacing of the fluid, m.
    spacing: f64,
}

/// The fluid end of a bond to a wall.
#[derive(Clone, Copy, Debug)]
struct FluidEnd {
    /// m/s.
    velocity: Vector3<f64>,
    /// Pa s.
    viscosity: f64,
    /// Tensor of the mapping of points that move.
    stretch: [f64; 6],
}

/// The fluid as walls see it.
pub(super) struct ImmersedFlow<
    'a,
    F: Fn(usize) -> Vector3<f64> + Sync,
    G: Fn(usize) -> [f64; 6] + Sync,
> {
    /// Of each point.
    pub slot: &'a [u32],
    /// Components by slot, m/s.
    pub velocity: &'a [SlotField],
    /// By point, kg/m³.
    pub density: &'a [f64],
    /// By point, Pa s.
    pub viscosity: &'a [f64],
    /// Gradient of the density at rest, kg/m⁴, by point.
    pub slope: F,
    /// Tensor of the mapping, by point; zero for points at rest.
    pub stretch: G,
    /// `a` of a complete family, m.
    pub moment: f64,
    /// Twice the diffusivity of the density, m²/s.
    pub diffusion: f64,
}

impl<F: Fn(usize) -> Vector3<f64> + Sync, G: Fn(usize) -> [f64; 6] + Sync> ImmersedFlow<'_, F, G> {
    fn velocity(&self, point: usize) -> Vector3<f64> {
        let slot = self.slot[point] as usize;
        Vector3::from_fn(|a, _| self.velocity.get(a).map_or(0.0, |v| v[slot]))
    }
}

impl Walls {
    /// Takes the walls in their reference shapes; they must complete the families of the fluid.
    pub(super) fn immerse(
        &mut self,
        setup: &Setup<'_>,
        (body, family): (BodyIndex, &Family),
        complete: &CompleteFamily,
    ) -> Result<(), SetupError> {
        let fluid = setup.body(body);
        let points = &fluid.points;
        let spacing = fluid.finest_spacing();
        for wall in &mut self.bodies {
            let solid = setup.body(wall.wall.other);
            wall.bonds
                .follow(Places::reference(fluid), Places::reference(solid));
        }
        let bonds = self.bodies.iter().map(|wall| &wall.bonds);
        let completion = Completion::of(points.len(), family, bonds);
        let Completion {
            content, at_walls, ..
        } = &completion;
        let mut towards = vec![Vector3::zeros(); points.len()];
        let mut distance = vec![f64::INFINITY; points.len()];
        for wall in &self.bodies {
            let solid = setup.body(wall.wall.other);
            for n in 0..wall.bonds.len() {
                let (bond, point, ghost) = wall.bonds.bond(n);
                towards[point] += bond.weight * Vector3::from(bond.xi);
                let half = 0.5 * solid.points.spacing[ghost.point];
                let beside = bond.xi.map(|x| (x.abs() - half).max(0.0));
                let beside =
                    Vector3::from_fn(|a, _| if a < fluid.dimension { beside[a] } else { 0.0 });
                distance[point] = beside.norm().min(distance[point]);
            }
        }
        for (point, x) in points.position.iter().enumerate() {
            let is_alone = at_walls[point] == 0.0
                && completion.asymmetry(point) > 1e-6 * complete.content * spacing;
            let found = (content[point] + at_walls[point]) / complete.content;
            if is_alone || found < LEAST_CONTENT {
                let at = perimelt_core::text::position(*x);
                let walls: Vec<&Body> = self
                    .bodies
                    .iter()
                    .map(|wall| setup.body(wall.wall.other))
                    .collect();
                let other = walls
                    .iter()
                    .find(|wall| (wall.finest_spacing() - spacing).abs() > 1e-6 * spacing);
                let message = match other {
                    Some(wall) if at_walls[point] > 0.0 || found >= LEAST_CONTENT => format!(
                        "the points of the wall `{}`, {} m apart, do not continue those of the fluid, {spacing} m apart, beside the point at \
                         {at} m: its family holds {:.0} % of a complete one, and is not symmetric",
                        wall.name,
                        wall.finest_spacing(),
                        100.0 * found
                    ),
                    _ => format!(
                        "beside the point at {at} m there is neither fluid nor a wall: its family holds {:.0} % of a complete one{}",
                        100.0 * found,
                        if at_walls[point] == 0.0 {
                            ", and no point of a wall"
                        } else {
                            ""
                        }
                    ),
                };
                let expected = "an Eulerian fluid without free surface and without a gap at bodies that are walls, whose points lie on \
                                the lattice of the fluid and that are at least as thick as its horizon or two rows of its points";
                return Err(SetupError::value("description", message, expected));
            }
        }
        for wall in &mut self.bodies {
            completion.correct(&mut wall.bonds);
            let solid = setup.body(wall.wall.other);
            let surface = (&distance[..], &towards[..]);
            wall.immersed = Some(Immersed::of(wall, surface, &solid.points.position, spacing));
        }
        Ok(())
    }

    /// Reference positions of the points of each wall, m.
    pub(super) fn places(&self) -> Vec<&[Vector3<f64>]> {
        let walls = self.bodies.iter().filter_map(|w| w.immersed.as_ref());
        walls.map(|immersed| &immersed.position[..]).collect()
    }

    /// Displacements of the points of each wall, m.
    pub(super) fn displacements(&self) -> Vec<&[Vector3<f64>]> {
        let walls = self.bodies.iter().filter_map(|w| w.immersed.as_ref());
        walls.map(|immersed| &immersed.displacement[..]).collect()
    }

    /// Maps the bonds of the reference shapes by the cofactors at their fluid points. They are corrected as those of points at rest:
    /// `open(point)` is half of `sum w (C_i + C_j) xi V` over the fluid, which with `sum w C_i xi V` over walls adds up to zero.
    pub(super) fn map_bonds(
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
    pub(super) fn displace_relative(&mut self, of_fluid: impl Fn(&Vector3<f64>) -> Vector3<f64>) {
        for immersed in self.bodies.iter_mut().filter_map(|w| w.immersed.as_mut()) {
            immersed.find_shift(&of_fluid);
        }
    }

    /// Largest displacement of a wall along its normal beside the fluid in spacings of the fluid, and the name of the wall.
    pub(super) fn largest_displacement(&self) -> Option<(f64, &str)> {
        let of_wall = |wall: &'_ WallBody| {
            let immersed = wall.immersed.as_ref()?;
            let shifts = immersed.shift.iter();
            Some(shifts.fold(0.0, |a: f64, s| a.max(s.abs())) / immersed.spacing)
        };
        let all = self.bodies.iter();
        let all = all.filter_map(|wall| Some((of_wall(wall)?, &wall.name[..])));
        all.max_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// Largest density of the fluid over that of a wall that yields.
    pub(super) fn largest_density_ratio(&self) -> f64 {
        let all = self.bodies.iter().flat_map(|wall| &wall.density_ratio);
        all.copied().fold(0.0, f64::max)
    }

    /// Finds the velocities behind the walls.
    pub(super) fn find_slopes<F, G>(&mut self, flow: &ImmersedFlow<'_, F, G>)
    where
        F: Fn(usize) -> Vector3<f64> + Sync,
        G: Fn(usize) -> [f64; 6] + Sync,
    {
        self.bodies.iter_mut().for_each(|w| w.find_slopes(flow));
    }

    /// Finds the flux of mass of the bonds to walls.
    pub(super) fn find_flux<F, G>(&mut self, flow: &ImmersedFlow<'_, F, G>)
    where
        F: Fn(usize) -> Vector3<f64> + Sync,
        G: Fn(usize) -> [f64; 6] + Sync,
    {
        self.bodies.iter_mut().for_each(|w| w.find_flux(flow));
    }

    /// Adds the mass that flows out through bonds to walls, kg/(m³ s).
    pub(super) fn add_outflow(&self, sums: &mut [[f64; 1]]) {
        self.add_immersed(sums, |immersed, _, n| [immersed.flux[n]]);
    }

    /// Adds the momentum that it has, N/m³, and finds the mean velocities (m/s) with which it comes back.
    pub(super) fn add_carried<const D: usize>(
        &mut self,
        velocity: &[Vector3<f64>],
        sums: &mut [[f64; D]],
    ) {
        for wall in &mut self.bodies {
            wall.find_means(|point| velocity[point]);
        }
        self.add_immersed(sums, |immersed, wall, n| {
            let (_, _, ghost) = wall.bonds.bond(n);
            let carried = immersed.flux[n] * ghost.reflect(immersed.mean[ghost.point]);
            std::array::from_fn(|a| carried[a])
        });
    }

    /// Adds force and work of viscosity.
    pub(super) fn add_viscosity<const D: usize, const I: usize, const O: usize>(
        &self,
        kernel: &impl BondKernel<I, O>,
        sums: &mut [[f64; O]],
    ) {
        self.add_immersed(sums, |_, wall, n| wall.held_part::<D, I, O>(n, kernel));
    }

    /// Passes each fluid point at a wall, with the rate at which walls change its volume (1/s), to `receive`; `inverse`: `1/a`.
    pub(super) fn for_each_swept(&self, inverse: f64, mut receive: impl FnMut(usize, f64)) {
        let mut found = Vec::new();
        for wall in &self.bodies {
            let part = |n: usize| {
                let (bond, _, ghost) = wall.bonds.bond(n);
                let v = ghost.reflect(wall.points[ghost.point].velocity);
                [2.0 * inverse * bond.weight * v.dot(&Vector3::from(bond.xi))]
            };
            wall.bonds.sum_by_owner(part, &mut found);
            for (&owner, [rate]) in wall.bonds.owners().iter().zip(&found) {
                receive(owner as usize, *rate);
            }
        }
    }

    fn add_immersed<const O: usize>(
        &self,
        sums: &mut [[f64; O]],
        part: impl Fn(&Immersed, &WallBody, usize) -> [f64; O] + Sync,
    ) {
        let mut found = Vec::new();
        for wall in &self.bodies {
            let Some(immersed) = &wall.immersed else {
                continue;
            };
            let part = |n: usize| part(immersed, wall, n);
            wall.bonds.sum_by_owner(part, &mut found);
            wall.bonds.add_to_owners(&found, sums);
        }
    }
}

impl Immersed {
    /// Of a wall with corrected bonds; `surface`: distance of each fluid point from the surface (m) and a vector towards it.
    /// The normal of a wall point is the mean over the fluid around it, whose points see more of the wall than it sees of
    /// them.
    fn of(
        wall: &WallBody,
        (surface, towards): (&[f64], &[Vector3<f64>]),
        position: &[Vector3<f64>],
        spacing: f64,
    ) -> Self {
        let bonds = &wall.bonds;
        let mut sums: Vec<[f64; 5]> = Vec::new();
        let part = |n: usize| {
            let (bond, point, ghost) = bonds.bond(n);
            let out = towards[point]
                .try_normalize(0.0)
                .unwrap_or_else(Vector3::zeros);
            let out = -ghost.reflect(out);
            [out.x, out.y, out.z, surface[point], 1.0].map(|x| bond.dual * x)
        };
        bonds.sum_by_foreign(part, &mut sums);
        let normal = |[x, y, z, ..]: &[f64; 5]| {
            let sum = Vector3::new(*x, *y, *z);
            sum.try_normalize(0.0).unwrap_or_else(Vector3::zeros)
        };
        let normal: Vec<_> = sums.iter().map(normal).collect();
        let mean = |[.., sum, weight]: &[f64; 5]| if *weight > 0.0 { sum / weight } else { 0.0 };
        let depth = |n: usize| {
            let (bond, point, ghost) = bonds.bond(n);
            let way = ghost.reflect(-Vector3::from(bond.xi));
            normal[ghost.point].dot(&way) - surface[point]
        };
        let mut depths: Vec<[f64; 1]> = Vec::new();
        bonds.sum_by_foreign(|n| [bonds.bond(n).0.dual * depth(n)], &mut depths);
        let below = depths.iter().zip(&sums);
        let below = below.map(|([depth], [.., weight])| match *weight > 0.0 {
            true => depth / weight,
            false => 0.0,
        });
        Immersed {
            distance: sums.iter().map(mean).collect(),
            below: below.collect(),
            depth: (0..bonds.len()).map(depth).collect(),
            position: position.to_vec(),
            displacement: vec![Vector3::zeros(); normal.len()],
            xi: (0..bonds.len()).map(|n| bonds.bond(n).0.xi).collect(),
            shift: vec![0.0; normal.len()],
            mean: vec![Vector3::zeros(); normal.len()],
            slope: vec![Vector3::zeros(); normal.len()],
            own: Vec::new(),
            flux: Vec::new(),
            spacing,
            normal,
        }
    }
}

impl Immersed {
    /// Finds how far the surface at each point is displaced along its normal with respect to a fluid displaced by `of_fluid(place)`
    /// (m), as a distance between points that rest: over the stretch of the fluid there.
    fn find_shift(&mut self, of_fluid: impl Fn(&Vector3<f64>) -> Vector3<f64>) {
        let along = |j: usize| {
            let normal = &self.normal[j];
            if *normal == Vector3::zeros() {
                return 0.0;
            }
            let surface = self.position[j] + self.below[j] * normal;
            let here = of_fluid(&surface);
            let beside = of_fluid(&(surface + self.spacing * normal));
            let stretch = 1.0 + normal.dot(&(beside - here)) / self.spacing;
            normal.dot(&(self.displacement[j] - here)) / stretch.max(LEAST_DISTORTION)
        };
        self.shift = (0..self.normal.len()).map(along).collect();
    }
}

impl WallBody {
    /// Takes the displacement of the points of an immersed wall, from where they are now (m).
    pub(super) fn displace(&mut self, world: &World, now: &[Vector3<f64>]) {
        let Some(immersed) = &mut self.immersed else {
            return;
        };
        let body = world.body(self.wall.other);
        let points = now.iter().zip(&immersed.position);
        let way = |(x, from): (&Vector3<f64>, _)| super::wall_motion::shortest(body, x - from);
        immersed.displacement.clear();
        immersed.displacement.extend(points.map(way));
        immersed.find_shift(|_| Vector3::zeros());
    }

    /// Finds the mean velocities of the fluid around the points of the wall.
    fn find_means(&mut self, velocity: impl Fn(usize) -> Vector3<f64> + Sync) {
        let Some(immersed) = &mut self.immersed else {
            return;
        };
        let bonds = &self.bonds;
        let part = |n: usize| {
            let (bond, point, ghost) = bonds.bond(n);
            let v = ghost.reflect(velocity(point));
            [1.0, v.x, v.y, v.z].map(|value| bond.dual * value)
        };
        let mut sums = Vec::new();
        bonds.sum_by_foreign(part, &mut sums);
        immersed.mean.clear();
        let mean = |[sum, x, y, z]: &[f64; 4]| match *sum > 0.0 {
            true => Vector3::new(*x, *y, *z) / *sum,
            false => Vector3::zeros(),
        };
        immersed.mean.extend(sums.iter().map(mean));
    }

    fn find_slopes<F, G>(&mut self, flow: &ImmersedFlow<'_, F, G>)
    where
        F: Fn(usize) -> Vector3<f64> + Sync,
        G: Fn(usize) -> [f64; 6] + Sync,
    {
        self.find_means(|point| flow.velocity(point));
        let Some(immersed) = &mut self.immersed else {
            return;
        };
        let least = LEAST_DISTANCE * immersed.spacing;
        for j in 0..immersed.mean.len() {
            let distance = (immersed.distance[j] - immersed.shift[j]).max(least);
            immersed.slope[j] = (immersed.mean[j] - self.points[j].velocity) / distance;
        }
        let own = |n: usize| {
            let (_, point, _) = self.bonds.bond(n);
            FluidEnd {
                velocity: flow.velocity(point),
                viscosity: flow.viscosity[point],
                stretch: (flow.stretch)(point),
            }
        };
        immersed.own.clear();
        immersed.own.extend((0..self.bonds.len()).map(own));
    }

    fn find_flux<F, G>(&mut self, flow: &ImmersedFlow<'_, F, G>)
    where
        F: Fn(usize) -> Vector3<f64> + Sync,
        G: Fn(usize) -> [f64; 6] + Sync,
    {
        let Some(immersed) = &mut self.immersed else {
            return;
        };
        let (bonds, points) = (&self.bonds, &self.points);
        let towards = |n: usize| {
            let (bond, point, ghost) = bonds.bond(n);
            let v = flow.velocity(point) - ghost.reflect(points[ghost.point].velocity);
            flow.density[point] * v.dot(&Vector3::from(bond.xi)) / flow.moment
        };
        let part = |n: usize| {
            let (bond, point, _) = bonds.bond(n);
            let rise = (flow.slope)(point).dot(&Vector3::from(bond.xi));
            [1.0, towards(n), flow.density[point] + rise].map(|value| bond.dual * value)
        };
        let mut sums = Vec::new();
        bonds.sum_by_foreign(part, &mut sums);
        let of_bond = |n: usize| {
            let (bond, point, ghost) = bonds.bond(n);
            let [sum, through, density] = sums[ghost.point];
            if sum <= 0.0 {
                return 0.0;
            }
            let rise = (flow.slope)(point).dot(&Vector3::from(bond.xi));
            let difference = density / sum - flow.density[point] - rise;
            let diffusion = flow.diffusion * difference / flow.moment;
            bond.weight * (towards(n) - through / sum - diffusion)
        };
        immersed.flux.clear();
        immersed.flux.extend((0..bonds.len()).map(of_bond));
    }

    /// What a bond adds to the sums of a kernel of velocity and viscosity.
    pub(super) fn held_part<const D: usize, const I: usize, const O: usize>(
        &self,
        n: usize,
        kernel: &impl BondKernel<I, O>,
    ) -> [f64; O] {
        let Some(immersed) = self.immersed.as_ref().filter(|_| !self.wall.slip) else {
            return [0.0; O];
        };
        let (bond, _, ghost) = self.bonds.bond(n);
        let j = ghost.point;
        let depth = immersed.depth[n] + immersed.shift[j];
        let held = ghost.reflect(self.points[j].velocity - depth * immersed.slope[j]);
        let own = &immersed.own[n];
        let inputs = |v: &Vector3<f64>| {
            std::array::from_fn(|i| match i {
                _ if i < D => v[i],
                _ if i == D => own.viscosity,
                _ => own.stretch[i - D - 1],
            })
        };
        kernel.bond(bond, inputs(&own.velocity), inputs(&held))
    }
}
