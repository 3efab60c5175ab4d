//! The points of a wall as points of the fluid, and their bonds in the sums of the fluid.

use nalgebra::Vector3;
use perimelt_core::{Bond, BondKernel};

use crate::shape_tensor::is_diagonal;

use super::{FluidAtWall, WallBody};

impl WallBody {
    pub(super) fn set_velocity<S, F>(&mut self, fluid: &FluidAtWall<'_, S, F>)
    where
        S: Fn(usize) -> usize + Sync,
        F: Fn(usize) -> Vector3<f64> + Sync,
    {
        let (bonds, points) = (&self.bonds, &self.points);
        let part = |n: usize| {
            let (bond, point, ghost) = bonds.bond(n);
            let (slot, xi) = ((fluid.slot_of)(point), Vector3::from(bond.xi));
            let mut v = Vector3::zeros();
            for (a, component) in fluid.velocity.iter().enumerate() {
                v[a] = component[slot];
            }
            let wall = ghost.reflect(points[ghost.point].velocity);
            let seen = ghost.reflect(v);
            let density = fluid.density[slot] + (fluid.slope)(point).dot(&xi);
            let divergence = (v - wall).dot(&-xi);
            let values = [
                1.0,
                seen.x,
                seen.y,
                seen.z,
                density,
                fluid.viscosity[slot],
                divergence,
            ];
            values.map(|value| bond.dual * value)
        };
        bonds.sum_by_foreign(part, &mut self.means);
        let slip = self.wall.slip;
        for (point, &[sum, x, y, z, density, viscosity, divergence]) in
            self.points.iter_mut().zip(&self.means)
        {
            if sum <= 0.0 {
                continue;
            }
            let mean = Vector3::new(x, y, z) / sum;
            point.held = if slip {
                point.velocity
            } else {
                2.0 * point.velocity - mean
            };
            point.density = density / sum;
            point.viscosity = viscosity / sum;
            point.compression = divergence / (fluid.moment * sum);
        }
    }

    /// What a bond adds to the sums of a kernel of the velocity of its fluid point.
    pub(in crate::fluid) fn velocity_part<const D: usize, const I: usize, const O: usize>(
        &self,
        number: usize,
        kernel: &impl BondKernel<I, O>,
        own: &impl Fn(usize) -> [f64; I],
        forces: &std::ops::Range<usize>,
    ) -> [f64; O] {
        let (bond, point, ghost) = self.bonds.bond(number);
        let there = &self.points[ghost.point];
        let [velocity, held] = [there.velocity, there.held].map(|v| ghost.reflect(v));
        let other = std::array::from_fn(|i| match i {
            _ if i < D => velocity[i],
            _ if i < 2 * D => held[i - D],
            _ if i == 2 * D => there.density,
            _ => there.viscosity,
        });
        let mut part = kernel.bond(bond, own(point), other);
        if self.wall.slip {
            part[forces.clone()].fill(0.0);
        }
        part
    }

    /// What a bond adds to the force of the pressure on its fluid point, N/m³.
    pub(in crate::fluid) fn pressure_part<const I: usize, const D: usize>(
        &self,
        number: usize,
        kernel: &impl BondKernel<I, D>,
        own: &impl Fn(usize) -> [f64; I],
        moment: f64,
    ) -> [f64; D] {
        let (bond, point, ghost): (&Bond, _, _) = self.bonds.bond(number);
        let other = std::array::from_fn(|i| match i {
            0 => self.points[ghost.point].pressure,
            _ if is_diagonal(i - 1) => 1.0 / moment,
            _ => 0.0,
        });
        kernel.bond(bond, own(point), other)
    }
}
