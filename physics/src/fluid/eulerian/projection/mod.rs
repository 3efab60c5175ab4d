//! Flow of a fluid that keeps its volume through points of a lattice at rest: the pressure follows from the fluxes of volume.
//!
//! With `b = w V_j / a` of a complete family, in a step dt:
//!
//! ```text
//! v~   = v + dt (viscosity - sum_j N_ij (v_j* - v_i*)/2) / rho
//! U_ij = b xi . (v~_i + v~_j) + 2 dt b beta_ij [G_ij - (p_j - p_i)],   sum_j U_ij = 0 determines p
//! v'   = v~ + dt sum_j b xi beta_ij [G_ij - (p_j - p_i)],              beta_ij = 2/(rho_i + rho_j)
//! ```
//!
//! with the force `G_ij` of accelerations g, `beta_ij G_ij = (g_i + g_j)/2 . (x_j - x_i)`, and velocities v* in the middle of the step.
//! Fluxes and velocities take the same bracket along each bond: what a pressure can balance moves nothing, and no pressure alternates
//! from point to point. `N_ij = (rho_i + rho_j)/2 U_ij` is the flux of mass of the step before, which is that of the velocity at the
//! start. Behind faces pressure, density and coordinates are those of the mirror point, so that nothing pushes through; the
//! velocity is mirrored, so that nothing flows through. See docs/theory/fluids.md, "Fluids that keep their volume".

mod kernels;
mod pressure;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use nalgebra::Vector3;
use perimelt_core::family::{ByRules, Mirrored};
use perimelt_core::plugin::check_length;
use perimelt_core::solver::SolverError;
use perimelt_core::{Body, Family, SlotField};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use kernels::{Carry, Inputs, Push, Volume};
use pressure::{PressureBonds, PressureSolver};

use super::fluxes::AT_WALLS;
use super::fluxes::FlowNow;
use super::fluxes::kernels::{Viscosity, ViscosityInputs, ViscositySums};
use super::fluxes::short_waves::{DecayingWaves, FlowBonds};
use crate::advection::Convection;
use crate::fluid::medium::Medium;
use crate::fluid::rates::{POINTS_PER_TASK, Rates, Stability, Terms};
use crate::shape_tensor::CompleteFamily;

/// Largest way of the fluid in a step, in spacings.
const LARGEST_WAY: f64 = 0.4;

/// Flow of a fluid that keeps its volume.
#[derive(Debug)]
pub(in crate::fluid) struct Projection {
    dimension: usize,
    family: Arc<Family>,
    complete: CompleteFamily,
    /// Largest divergence over speed by spacing.
    tolerance: f64,
    /// m.
    spacing: f64,
    /// Slot of each point.
    slot: Vec<u32>,
    state: ProjectionState,
    /// By slot, in the order of [`Inputs`].
    fields: Vec<SlotField>,
    viscosity: SlotField,
    /// At the start of the step, and in its middle, by point, m/s.
    start: Vec<Vector3<f64>>,
    middle: Vec<Vector3<f64>>,
    /// Rows of points: force (N/m³) and work (W/m³) of viscosity; momentum that is carried away (N/m³); acceleration along the
    /// bonds (m/s²).
    diffusion: Vec<f64>,
    carried: Vec<f64>,
    push: Vec<f64>,
    short_waves: DecayingWaves,
    /// Volume that flows out of each point, 1/s.
    excess: Vec<[f64; 1]>,
    solver: PressureSolver,
    /// Iterations for the pressure of the last step.
    iterations: usize,
}

/// What the fluxes of the last step follow from, besides pressure and density.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(in crate::fluid) struct ProjectionState {
    /// Size of the step, s; zero before the first one.
    step: f64,
    /// Velocity before the pressure acted, m/s.
    predicted: Vec<Vector3<f64>>,
    /// Acceleration by forces, m/s².
    acceleration: Vec<Vector3<f64>>,
}

const PUSH_2D: usize = Inputs::<2>::PUSH;
const PUSH_3D: usize = Inputs::<3>::PUSH;
const VOLUME_2D: usize = Inputs::<2>::VOLUME;
const VOLUME_3D: usize = Inputs::<3>::VOLUME;
const CARRY_2D: usize = Inputs::<2>::CARRY;
const CARRY_3D: usize = Inputs::<3>::CARRY;
const VISCOUS_2D: usize = ViscosityInputs::<2>::PLAIN;
const VISCOUS_3D: usize = ViscosityInputs::<3>::PLAIN;

/// Keys of a fluid that keeps its volume.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::fluid) struct ProjectionKeys {
    /// Largest divergence over speed by spacing.
    pub(in crate::fluid) tolerance: f64,
}

/// What sums are taken over.
pub(super) struct ProjectionDomain {
    pub(super) family: Arc<Family>,
    pub(super) complete: CompleteFamily,
}

impl Projection {
    /// Flow through the points of `body`, whose families are complete.
    pub(super) fn new(
        keys: ProjectionKeys,
        convection: Convection,
        body: &Body,
        domain: ProjectionDomain,
    ) -> Self {
        let ProjectionDomain { family, complete } = domain;
        let (dimension, points) = (body.dimension, body.points.len());
        let mut fields = vec![SlotField::zeros(&family); 2 + 4 * dimension];
        for axis in 0..dimension {
            fields[2 + axis].load_coordinate(&family, axis);
        }
        Projection {
            dimension,
            complete,
            tolerance: keys.tolerance,
            spacing: body.finest_spacing(),
            slot: (0..points).map(|i| family.slot_of(i) as u32).collect(),
            state: ProjectionState {
                step: 0.0,
                predicted: vec![Vector3::zeros(); points],
                acceleration: vec![Vector3::zeros(); points],
            },
            fields,
            viscosity: SlotField::default(),
            start: vec![Vector3::zeros(); points],
            middle: vec![Vector3::zeros(); points],
            diffusion: vec![0.0; points * (dimension + 1)],
            carried: vec![0.0; points * dimension],
            push: vec![0.0; points * dimension],
            short_waves: DecayingWaves::new(convection, dimension),
            excess: vec![[0.0]; points],
            solver: PressureSolver::new(points),
            iterations: 0,
            family,
        }
    }

    pub(super) fn state(&self) -> &ProjectionState {
        &self.state
    }

    pub(super) fn load(&mut self, state: ProjectionState) -> Result<(), erased_serde::Error> {
        let points = self.slot.len();
        check_length("predicted velocities", state.predicted.len(), points)?;
        check_length("accelerations", state.acceleration.len(), points)?;
        self.state = state;
        Ok(())
    }

    /// Sets what the fluxes of the last step follow from; before the first step they are those of the velocity.
    pub(in crate::fluid) fn set_fluxes(
        &mut self,
        velocity: &[Vector3<f64>],
        density: &[f64],
        pressure: &[f64],
    ) {
        if self.state.step == 0.0 {
            self.state.predicted.copy_from_slice(velocity);
        }
        self.load_scalar(0, pressure);
        self.load_scalar(1, density);
        self.load_state();
    }

    /// Iterations for the pressure of the last step.
    pub(in crate::fluid) fn iterations(&self) -> usize {
        self.iterations
    }

    /// Largest step (s) for this velocity of the fluid and speed of the walls (m/s): viscosity as in other fluids, and a way of
    /// [`LARGEST_WAY`] also under the forces of the last step.
    pub(in crate::fluid) fn stable_step(
        &self,
        velocity: &[Vector3<f64>],
        walls: f64,
        diffusivity: f64,
    ) -> f64 {
        let speed = largest(velocity).max(walls);
        let way = LARGEST_WAY * self.spacing;
        let half = 0.5 * largest(&self.state.acceleration);
        let by_way = 2.0 * way / (speed + (speed * speed + 4.0 * half * way).sqrt());
        let by_viscosity = 1.0 / (self.stability().laplacian * diffusivity);
        by_way.min(by_viscosity)
    }

    fn inverse(&self) -> f64 {
        1.0 / self.complete.moment
    }

    fn volume<const D: usize>(&self, step: f64) -> Volume<D> {
        Volume {
            inverse: self.inverse(),
            twice: 2.0 * step,
        }
    }

    fn inputs<const I: usize>(&self) -> [&[f64]; I] {
        std::array::from_fn(|i| &self.fields[i][..])
    }

    fn load_scalar(&mut self, field: usize, values: &[f64]) {
        self.fields[field].load(&self.family, values, Mirrored::Scalar);
    }

    /// Copies the state to slots.
    fn load_state(&mut self) {
        let (d, state) = (self.dimension, &self.state);
        for axis in 0..d {
            let acceleration = |i: usize| state.acceleration[i][axis];
            self.fields[2 + d + axis].load(&self.family, acceleration, Mirrored::Scalar);
            let predicted = |i: usize| state.predicted[i][axis];
            let ghosts = Mirrored::Vector(axis);
            self.fields[2 + 2 * d + axis].load(&self.family, predicted, ghosts);
        }
    }

    /// Finds force and work of viscosity, and the decay of short waves.
    fn find_viscosity<const D: usize, const I: usize, const O: usize>(
        &mut self,
        flow: &FlowNow<'_>,
    ) {
        let laplacian = 2.0 * self.inverse();
        let (sums, _) = self.diffusion.as_chunks_mut::<O>();
        let inputs: [&[f64]; I] = std::array::from_fn(|i| match i < D {
            true => &flow.velocity[i][..],
            false => &self.viscosity,
        });
        let kernel = Viscosity::<D, false> { laplacian };
        self.family.sum(&kernel, inputs, sums);
        let bonds = FlowBonds {
            family: &self.family,
            complete: &self.complete,
            slot: &self.slot,
        };
        let viscosity = &flow.terms.medium.viscosity.value;
        self.short_waves.find::<D>(bonds, flow, viscosity);
    }

    /// Finds the momentum that the fluxes of the last step carry away with a velocity, at the start or in the middle of the step.
    fn find_carried<const D: usize, const I: usize>(&mut self, terms: &Terms<'_>, middle: bool) {
        let velocity = if middle { &self.middle } else { &self.start };
        for axis in 0..D {
            let along = |point: usize| velocity[point][axis];
            let ghosts = ByRules(terms.rules, axis);
            self.fields[Inputs::<D>::CARRIED + axis].load(&self.family, along, ghosts);
        }
        let mut rows = std::mem::take(&mut self.carried);
        let (sums, _) = rows.as_chunks_mut::<D>();
        let kernel = Carry(self.volume::<D>(self.state.step));
        self.family.sum(&kernel, self.inputs::<I>(), sums);
        self.carried = rows;
    }

    /// Acceleration by viscosity and by what the flow carries, m/s².
    fn acceleration(&self, i: usize, density: f64) -> Vector3<f64> {
        let d = self.dimension;
        let mut acceleration = Vector3::zeros();
        for a in 0..d {
            let viscous = self.diffusion[i * (d + 1) + a] + self.short_waves.rate(i, a);
            acceleration[a] = (viscous - self.carried[i * d + a]) / density;
        }
        acceleration
    }

    /// Finds the velocity in the middle of the step, with the acceleration of pressure and forces of the last step.
    fn find_middle(&mut self, dt: f64, density: &[f64]) {
        let mut middle = std::mem::take(&mut self.middle);
        let before = match self.state.step {
            0.0 => 0.0,
            step => 1.0 / step,
        };
        let points = middle.par_iter_mut().enumerate();
        points
            .with_min_len(POINTS_PER_TASK)
            .for_each(|(i, middle)| {
                let v = self.start[i];
                let push = before * (v - self.state.predicted[i]);
                *middle = v + 0.5 * dt * (push + self.acceleration(i, density[i]));
            });
        self.middle = middle;
    }

    /// Finds the velocity before the pressure acts, and the acceleration by forces.
    fn predict(&mut self, terms: &Terms<'_>, density: &[f64]) {
        let mut state = std::mem::take(&mut self.state);
        let points = state.predicted.par_iter_mut().zip(&mut state.acceleration);
        let points = points.enumerate().with_min_len(POINTS_PER_TASK);
        points.for_each(|(i, (predicted, acceleration))| {
            *predicted = self.start[i] + terms.dt * self.acceleration(i, density[i]);
            *acceleration = Vector3::zeros();
            for a in 0..self.dimension {
                acceleration[a] = terms.body_acceleration(i, a);
            }
        });
        state.step = terms.dt;
        self.state = state;
        self.load_state();
    }

    /// Predicts the velocity, and finds the volume that flows out of the points with the pressure of the last step.
    fn find_excess<const D: usize, const V: usize, const C: usize>(
        &mut self,
        terms: &Terms<'_>,
        density: &[f64],
    ) {
        self.find_carried::<D, C>(terms, false);
        self.find_middle(terms.dt, density);
        self.find_carried::<D, C>(terms, true);
        self.predict(terms, density);
        let mut excess = std::mem::take(&mut self.excess);
        let kernel = self.volume::<D>(terms.dt);
        self.family.sum(&kernel, self.inputs::<V>(), &mut excess);
        self.excess = excess;
    }

    /// Divergence (1/s) up to which the pressure is found.
    fn divergence(&self, terms: &Terms<'_>) -> f64 {
        let speed = largest(&self.state.predicted);
        let gained = terms.dt * largest(&self.state.acceleration);
        self.tolerance * speed.max(gained) / self.spacing
    }

    fn find_push<const D: usize, const I: usize>(&mut self) {
        let mut rows = std::mem::take(&mut self.push);
        let (sums, _) = rows.as_chunks_mut::<D>();
        let kernel = Push {
            inverse: self.inverse(),
        };
        self.family.sum(&kernel, self.inputs::<I>(), sums);
        self.push = rows;
    }
}

/// Largest length of a vector.
fn largest(vectors: &[Vector3<f64>]) -> f64 {
    let squares = vectors.iter().map(Vector3::norm_squared);
    squares.fold(0.0, f64::max).sqrt()
}

impl Rates for Projection {
    fn family(&self) -> &Family {
        &self.family
    }

    fn stability(&self) -> Stability {
        Stability {
            wave_number: 0.0,
            laplacian: AT_WALLS * 2.0 * self.inverse() * self.complete.content,
        }
    }

    fn set_viscosity(&mut self, medium: &Medium) {
        medium.viscosity.load(&self.family, &mut self.viscosity);
    }

    fn set_velocity(&mut self, velocity: &[SlotField], density: &[f64], terms: &Terms<'_>) {
        let points = self.start.par_iter_mut().zip(&self.slot);
        points.with_min_len(POINTS_PER_TASK).for_each(|(v, slot)| {
            for (a, along) in velocity.iter().enumerate() {
                v[a] = along[*slot as usize];
            }
        });
        let flow = FlowNow {
            terms,
            velocity,
            density,
        };
        match self.dimension {
            2 => self.find_viscosity::<2, VISCOUS_2D, { ViscositySums::<2>::COUNT }>(&flow),
            _ => self.find_viscosity::<3, VISCOUS_3D, { ViscositySums::<3>::COUNT }>(&flow),
        }
    }

    fn set_pressure(&mut self, pressure: &[f64], _force: Option<&[Vector3<f64>]>) {
        self.load_scalar(0, pressure);
    }

    fn advance_density(
        &mut self,
        terms: &Terms<'_>,
        density: &mut [f64],
        pressure: &mut [f64],
    ) -> Result<(), SolverError> {
        match self.dimension {
            2 => self.find_excess::<2, VOLUME_2D, CARRY_2D>(terms, density),
            _ => self.find_excess::<3, VOLUME_3D, CARRY_3D>(terms, density),
        }
        let bonds = PressureBonds {
            family: &self.family,
            laplacian: 2.0 * self.inverse(),
            density: &self.fields[1],
        };
        let tolerance = self.divergence(terms);
        self.iterations = self.solver.solve(bonds, &self.excess, tolerance)?;
        let points = pressure.iter_mut().zip(&self.solver.surplus);
        points.for_each(|(p, surplus)| *p -= surplus / terms.dt);
        Ok(())
    }

    fn advance_velocity(
        &mut self,
        _terms: &Terms<'_>,
        time: f64,
        velocity: &mut [Vector3<f64>],
        _density: &[f64],
    ) {
        match self.dimension {
            2 => self.find_push::<2, PUSH_2D>(),
            _ => self.find_push::<3, PUSH_3D>(),
        }
        let d = self.dimension;
        let points = velocity.par_iter_mut().zip(&self.state.predicted);
        let points = points.enumerate().with_min_len(POINTS_PER_TASK);
        points.for_each(|(i, (v, predicted))| {
            for a in 0..d {
                v[a] = predicted[a] + time * self.push[i * d + a];
            }
        });
    }

    fn friction(&self, _medium: &Medium, friction: &mut Vec<f64>) {
        let d = self.dimension;
        friction.clear();
        friction.extend(self.diffusion.chunks_exact(d + 1).map(|row| row[d]));
    }
}
