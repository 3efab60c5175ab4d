//! Walls that are bodies for a fluid whose points rest on a lattice (`description = "eulerian"`).
//!
//! The lattice stays, and so do the bonds to the points of a wall: they are those of the *reference shape* of the wall, while its
//! points give velocity and displacement. Small displacements count to first order, up to half a spacing of the fluid. Where the
//! points of the fluid follow the walls ([`crate::fluid::eulerian::point_motion`]), only the displacement of a wall relative to them is small, and
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

mod reference;

use nalgebra::Vector3;
use perimelt_core::family::ForeignBond;
use perimelt_core::{BondKernel, SlotField};

use super::fluxes::kernels::ViscosityInputs;
use crate::fluid::walls::{WallBody, Walls};

/// Largest displacement of a wall along its normal, in spacings of the fluid.
pub(crate) const LARGEST_DISPLACEMENT: f64 = 0.5;

/// Least distance over which the velocity is extrapolated, in spacings of the fluid.
const LEAST_DISTANCE: f64 = 0.25;

/// A wall in its reference shape, by its points or bonds.
#[derive(Debug, Default)]
pub(crate) struct Immersed {
    /// From the wall into the fluid, by point; zero away from the fluid.
    pub(crate) normal: Vec<Vector3<f64>>,
    /// Mean distance `<d>` of the fluid around each point from the surface, m.
    mean_distance: Vec<f64>,
    /// Depth `e` of the end of each bond below the surface, m.
    depth: Vec<f64>,
    /// Mean of these depths at each point, m.
    mean_depth: Vec<f64>,
    /// Reference positions of the points, m.
    position: Vec<Vector3<f64>>,
    /// Displacement of the points since then, m.
    displacement: Vec<Vector3<f64>>,
    /// Corrected bonds of the reference shape, m.
    xi: Vec<[f64; 3]>,
    /// Displacement `s` of the surface at each point along its normal into the fluid, m.
    surface_shift: Vec<f64>,
    /// Mean velocity `<v>` of the fluid around each point, m/s.
    mean_velocity: Vec<Vector3<f64>>,
    /// Slope `G` of the velocity behind the surface at each point, 1/s.
    velocity_slope: Vec<Vector3<f64>>,
    fluid_ends: Vec<FluidEnd>,
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
    /// Slot of each point.
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
            let ghost = wall.bonds.bond(n).ghost;
            let carried = immersed.flux[n] * ghost.reflect(immersed.mean_velocity[ghost.point]);
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
                let ForeignBond { bond, ghost, .. } = wall.bonds.bond(n);
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

impl WallBody {
    /// Finds the mean velocities of the fluid around the points of the wall.
    fn find_means(&mut self, velocity: impl Fn(usize) -> Vector3<f64> + Sync) {
        let Some(immersed) = &mut self.immersed else {
            return;
        };
        let bonds = &self.bonds;
        let part = |n: usize| {
            let ForeignBond { bond, point, ghost } = bonds.bond(n);
            let v = ghost.reflect(velocity(point));
            [1.0, v.x, v.y, v.z].map(|value| bond.dual * value)
        };
        let mut sums = Vec::new();
        bonds.sum_by_foreign(part, &mut sums);
        immersed.mean_velocity.clear();
        let mean = |[sum, x, y, z]: &[f64; 4]| match *sum > 0.0 {
            true => Vector3::new(*x, *y, *z) / *sum,
            false => Vector3::zeros(),
        };
        immersed.mean_velocity.extend(sums.iter().map(mean));
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
        for j in 0..immersed.mean_velocity.len() {
            let distance = (immersed.mean_distance[j] - immersed.surface_shift[j]).max(least);
            immersed.velocity_slope[j] =
                (immersed.mean_velocity[j] - self.points[j].velocity) / distance;
        }
        let own = |n: usize| {
            let point = self.bonds.bond(n).point;
            FluidEnd {
                velocity: flow.velocity(point),
                viscosity: flow.viscosity[point],
                stretch: (flow.stretch)(point),
            }
        };
        immersed.fluid_ends.clear();
        immersed.fluid_ends.extend((0..self.bonds.len()).map(own));
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
            let ForeignBond { bond, point, ghost } = bonds.bond(n);
            let v = flow.velocity(point) - ghost.reflect(points[ghost.point].velocity);
            flow.density[point] * v.dot(&Vector3::from(bond.xi)) / flow.moment
        };
        let part = |n: usize| {
            let ForeignBond { bond, point, .. } = bonds.bond(n);
            let rise = (flow.slope)(point).dot(&Vector3::from(bond.xi));
            [1.0, towards(n), flow.density[point] + rise].map(|value| bond.dual * value)
        };
        let mut sums = Vec::new();
        bonds.sum_by_foreign(part, &mut sums);
        let of_bond = |n: usize| {
            let ForeignBond { bond, point, ghost } = bonds.bond(n);
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
        let ForeignBond { bond, ghost, .. } = self.bonds.bond(n);
        let j = ghost.point;
        let depth = immersed.depth[n] + immersed.surface_shift[j];
        let held = ghost.reflect(self.points[j].velocity - depth * immersed.velocity_slope[j]);
        let own = &immersed.fluid_ends[n];
        let inputs = |v: &Vector3<f64>| {
            std::array::from_fn(|i| match i {
                _ if i < ViscosityInputs::<D>::VISCOSITY => v[i],
                _ if i < ViscosityInputs::<D>::STRETCH => own.viscosity,
                _ => own.stretch[i - ViscosityInputs::<D>::STRETCH],
            })
        };
        kernel.bond(bond, inputs(&own.velocity), inputs(&held))
    }
}
