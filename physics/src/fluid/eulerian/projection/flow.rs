//! Sums of a step: viscosity, what the fluxes carry, the prediction, and the acceleration along the bonds.

use nalgebra::Vector3;
use perimelt_core::family::{ByRules, ForeignBond, Mirrored};
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::{BondKernel, SlotField, World};
use rayon::prelude::*;

use super::kernels::{Carry, JumpSums, JumpingViscosity, Layer, Push, Volume};
use super::phase::{InterfaceBonds, Phase};
use super::{Projection, SUMS_2D, SUMS_3D, VISCOUS_2D, VISCOUS_3D};
use crate::fluid::eulerian::fluxes::FlowNow;
use crate::fluid::eulerian::fluxes::kernels::Viscosity;
use crate::fluid::eulerian::immersed::ImmersedFlow;
use crate::fluid::rates::{POINTS_PER_TASK, Terms};

impl Projection {
    pub(super) fn inverse(&self) -> f64 {
        1.0 / self.complete.moment
    }

    pub(super) fn volume<const D: usize>(&self, step: f64) -> Volume<D> {
        Volume {
            inverse: self.inverse(),
            twice: 2.0 * step,
        }
    }

    pub(super) fn inputs<const I: usize>(&self) -> [&[f64]; I] {
        let mut all = self.slots.all();
        std::array::from_fn(|_| all.next().map_or(&[][..], |slots| &slots[..]))
    }

    /// Copies the state to slots.
    pub(super) fn load_state(&mut self) {
        let state = &self.state;
        for (axis, slots) in self.slots.acceleration.iter_mut().enumerate() {
            let along = |i: usize| state.acceleration[i][axis];
            slots.load(&self.family, along, Mirrored::Scalar);
        }
        for (axis, slots) in self.slots.predicted.iter_mut().enumerate() {
            let along = |i: usize| state.predicted[i][axis];
            slots.load(&self.family, along, Mirrored::Vector(axis));
        }
    }

    /// Finds where the interface lies, for these densities (kg/m³).
    pub(super) fn find_interface(&mut self, density: &[f64]) {
        self.slots
            .density
            .load(&self.family, density, Mirrored::Scalar);
        let bonds = InterfaceBonds {
            family: &self.family,
            walls: &self.walls,
            spacing: self.spacing,
            inverse: self.inverse(),
        };
        if let Some(phase) = &mut self.phase {
            match self.dimension {
                2 => phase.find::<2>(bonds, &mut self.slots),
                _ => phase.find::<3>(bonds, &mut self.slots),
            }
        }
        self.load_frozen(density);
        self.load_tension();
    }

    /// Finds the velocity behind the surfaces of bodies that are walls.
    pub(super) fn find_slopes(&mut self, flow: &FlowNow<'_>) {
        let viscosity = match &self.phase {
            None => &flow.terms.medium.viscosity.value,
            Some(_) => &self.mixed_viscosity,
        };
        self.walls.find_slopes(&ImmersedFlow {
            slot: &self.slot,
            velocity: flow.velocity,
            density: flow.density,
            viscosity,
            slope: |_| Vector3::zeros(),
            stretch: |_| [0.0; 6],
            moment: self.complete.moment,
            diffusion: 0.0,
        });
    }

    /// Gives the walls the opposite of what they do to the fluid in a time, s.
    pub(in crate::fluid::eulerian) fn give_impulses(&mut self, world: &World, time: f64) {
        match self.dimension {
            _ if self.walls.is_empty() => (),
            2 => self.give::<2, VISCOUS_2D, SUMS_2D>(world, time),
            _ => self.give::<3, VISCOUS_3D, SUMS_3D>(world, time),
        }
    }

    /// Behind a wall the pressure is that of the point, and what balances the forces there: `p_i + rho_i g_i . xi`.
    fn give<const D: usize, const I: usize, const O: usize>(&mut self, world: &World, time: f64) {
        let inverse = self.inverse();
        let viscosity = Viscosity::<D, false> {
            laplacian: 2.0 * inverse,
        };
        let (slots, slot, forces) = (&self.slots, &self.slot, &self.state.acceleration);
        self.walls.give(world, time, |wall, n| {
            let ForeignBond { bond, point, .. } = wall.bonds.bond(n);
            let (xi, here) = (Vector3::from(bond.xi), slot[point] as usize);
            let rise = slots.density[here] * forces[point].dot(&xi);
            let pressure = -bond.weight * inverse * (2.0 * slots.pressure[here] + rise);
            let viscous = wall.held_part::<D, I, O>(n, &viscosity);
            Vector3::from_fn(|a, _| {
                if a < D {
                    pressure * xi[a] + viscous[a]
                } else {
                    0.0
                }
            })
        });
    }

    /// Finds force and work of the viscosity of one fluid.
    pub(super) fn find_viscosity<
        const D: usize,
        const I: usize,
        const O: usize,
        const SERIES: bool,
    >(
        &mut self,
        flow: &FlowNow<'_>,
    ) {
        let (sums, _) = self.diffusion.as_chunks_mut::<O>();
        let kernel = Viscosity::<D, SERIES> {
            laplacian: 2.0 / self.complete.moment,
        };
        let inputs = viscous_inputs::<I>(flow, &self.viscosity);
        self.family.sum(&kernel, inputs, sums);
        self.walls.add_viscosity::<D, I, O>(&kernel, sums);
    }

    /// Finds force and work of viscosity where it jumps: `2 b mu_ij (v_j - v_i)` along bonds, and `(grad v) . grad mu`.
    pub(super) fn find_jumping_viscosity<const D: usize, const I: usize, const O: usize>(
        &mut self,
        flow: &FlowNow<'_>,
    ) where
        JumpingViscosity: BondKernel<I, O>,
    {
        let kernel = JumpingViscosity {
            inverse: self.inverse(),
        };
        self.jumps.resize(self.slot.len() * O, 0.0);
        let (sums, _) = self.jumps.as_chunks_mut::<O>();
        let inputs = viscous_inputs::<I>(flow, &self.viscosity);
        self.family.sum(&kernel, inputs, sums);
        self.walls.add_viscosity::<D, I, O>(&kernel, sums);
        let rows = self.diffusion.par_chunks_exact_mut(D + 1).zip(sums);
        rows.with_min_len(POINTS_PER_TASK).for_all(|(row, sums)| {
            row.copy_from_slice(&sums[..=D]);
            for a in 0..D {
                for b in 0..D {
                    let slope = sums[JumpSums::<D>::SLOPES + D * a + b];
                    row[a] += slope * sums[JumpSums::<D>::RISE + b];
                }
            }
        });
    }

    /// How the layer between two fluids is kept thin in a flow of this largest speed (m/s).
    pub(super) fn layer(&self, speed: f64) -> Layer {
        self.phase
            .as_ref()
            .map_or_else(Layer::default, |phase| Layer {
                mobility: phase.mobility(speed, self.spacing),
                width: 2.0 * phase.pair.width * self.spacing,
                jump: phase.pair.density[0] - phase.pair.density[1],
            })
    }

    /// Finds what the fluxes of the last step carry away, with the velocity at the start or in the middle of the step.
    pub(super) fn find_carried<const D: usize, const I: usize, const O: usize>(
        &mut self,
        terms: &Terms<'_>,
        layer: Layer,
        velocity: &[Vector3<f64>],
    ) {
        for (axis, slots) in self.slots.carried.iter_mut().enumerate() {
            let along = |point: usize| velocity[point][axis];
            slots.load(&self.family, along, ByRules(terms.rules, axis));
        }
        let mut rows = std::mem::take(&mut self.carried);
        let (sums, _) = rows.as_chunks_mut::<O>();
        let volume = self.volume::<D>(self.state.step);
        let kernel = Carry { volume, layer };
        self.family.sum(&kernel, self.inputs::<I>(), sums);
        self.carried = rows;
    }

    /// Advances the fraction of the first fluid, and with it the density (kg/m³).
    pub(super) fn advance_phase(&mut self, dt: f64, density: &mut [f64]) {
        let Some(phase) = &mut self.phase else {
            return;
        };
        let d = self.dimension;
        let Phase { pair, fraction, .. } = phase;
        let rows = self.carried.par_chunks_exact(d + 1);
        let points = fraction.par_iter_mut().zip(density).zip(rows);
        let points = points.with_min_len(POINTS_PER_TASK);
        points.for_all(|((c, rho), row)| {
            *c -= dt * row[d];
            *rho = pair.density_of(*c);
        });
    }

    /// Acceleration by viscosity and by what the flow carries, m/s².
    pub(super) fn acceleration(&self, i: usize, density: f64) -> Vector3<f64> {
        let d = self.dimension;
        let mut acceleration = Vector3::zeros();
        for a in 0..d {
            let viscous = self.diffusion[i * (d + 1) + a] + self.short_waves.rate(i, a);
            acceleration[a] = (viscous - self.carried[i * (d + 1) + a]) / density;
        }
        acceleration
    }

    /// Finds the velocity in the middle of the step, with the acceleration of pressure and forces of the last step. After a step that was much
    /// shorter, which ended on an event, the tolerance of the pressure over that step would be most of the acceleration: it then acts as
    /// long as it did.
    pub(super) fn find_middle(&mut self, dt: f64, density: &[f64]) {
        let mut middle = std::mem::take(&mut self.middle);
        let before = match self.state.step {
            0.0 => 0.0,
            step => dt.min(step) / (dt * step),
        };
        let points = middle.par_iter_mut().enumerate();
        points.with_min_len(POINTS_PER_TASK).for_all(|(i, middle)| {
            let v = self.start[i];
            let push = before * (v - self.state.predicted[i]);
            *middle = v + 0.5 * dt * (push + self.acceleration(i, density[i]));
        });
        self.middle = middle;
    }

    /// Finds the velocity before the pressure acts, and the acceleration by forces.
    pub(super) fn predict(&mut self, terms: &Terms<'_>, density: &[f64]) {
        let mut state = std::mem::take(&mut self.state);
        let points = state.predicted.par_iter_mut().zip(&mut state.acceleration);
        let points = points.enumerate().with_min_len(POINTS_PER_TASK);
        points.for_all(|(i, (predicted, acceleration))| {
            *predicted = self.start[i] + terms.dt * self.acceleration(i, density[i]);
            if let Some(surface) = &self.thermocapillary {
                let force = surface.force(i, self.dimension);
                for (v, force) in predicted.iter_mut().zip(force) {
                    *v += terms.dt * force / density[i];
                }
            }
            *acceleration = Vector3::zeros();
            if state.frozen.get(i) == Some(&true) {
                *predicted = Vector3::zeros();
                return;
            }
            for a in 0..self.dimension {
                acceleration[a] = terms.body_acceleration(i, a);
            }
        });
        state.step = terms.dt;
        self.state = state;
        self.note_walls(terms.rules);
        self.load_state();
    }

    /// Carries mass and momentum, predicts the velocity, and finds the volume that flows out of the points with the pressure of
    /// the last step.
    pub(super) fn find_excess<const D: usize, const V: usize, const C: usize, const O: usize>(
        &mut self,
        terms: &Terms<'_>,
        density: &mut [f64],
    ) {
        let layer = self.layer(largest(&self.start));
        let start = std::mem::take(&mut self.start);
        self.find_carried::<D, C, O>(terms, layer, &start);
        self.start = start;
        self.advance_phase(terms.dt, density);
        self.carry_heat(terms.dt, layer);
        self.find_middle(terms.dt, density);
        let middle = std::mem::take(&mut self.middle);
        self.find_carried::<D, C, O>(terms, layer, &middle);
        self.middle = middle;
        self.find_frozen();
        self.find_interface(density);
        self.set_tension();
        self.find_surface_force(density);
        self.predict(terms, density);
        let mut excess = std::mem::take(&mut self.excess);
        let kernel = self.volume::<D>(terms.dt);
        self.family.sum(&kernel, self.inputs::<V>(), &mut excess);
        self.excess = excess;
    }

    /// Divergence (1/s) up to which the pressure is found.
    pub(super) fn divergence(&self, terms: &Terms<'_>) -> f64 {
        let speed = largest(&self.state.predicted);
        let gained = terms.dt * largest(&self.state.acceleration);
        let pressure = &self.state.interface_pressure;
        let pressure = pressure.iter().copied().fold(0.0, f64::max);
        let surface = |phase: &Phase| phase.surface_speed(pressure, self.spacing);
        let surface = self.phase.as_ref().map_or(0.0, surface);
        self.tolerance * speed.max(gained).max(surface) / self.spacing
    }

    pub(super) fn find_push<const D: usize, const I: usize>(&mut self) {
        let mut rows = std::mem::take(&mut self.push);
        let (sums, _) = rows.as_chunks_mut::<D>();
        let kernel = Push {
            inverse: self.inverse(),
        };
        self.family.sum(&kernel, self.inputs::<I>(), sums);
        self.push = rows;
    }
}

/// Inputs of the kernels of viscosity.
fn viscous_inputs<'a, const I: usize>(
    flow: &FlowNow<'a>,
    viscosity: &'a SlotField,
) -> [&'a [f64]; I] {
    std::array::from_fn(|i| flow.velocity.get(i).map_or(&viscosity[..], |v| &v[..]))
}

/// Largest length of a vector.
pub(super) fn largest(vectors: &[Vector3<f64>]) -> f64 {
    let vectors = vectors.par_iter().with_min_len(POINTS_PER_TASK);
    let squares = vectors.map(Vector3::norm_squared);
    squares.reduce(|| 0.0, f64::max).sqrt()
}
