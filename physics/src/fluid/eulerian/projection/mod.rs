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

mod flow;
mod freezing;
pub(in crate::fluid) mod heat;
pub(in crate::fluid) mod interface_temperature;
mod kernels;
mod limits;
mod phase;
mod pressure;
mod slots;
#[cfg(test)]
mod tests;
pub(in crate::fluid) mod thermocapillary;
pub(super) mod wetted_body;
mod wetting;

use std::sync::Arc;

use nalgebra::Vector3;
use perimelt_core::family::{LayerRule, Mirrored};
use perimelt_core::material::EnthalpyCurve;
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::plugin::check_length;
use perimelt_core::solver::SolverError;
use perimelt_core::solver::reduce::dot;
use perimelt_core::{Body, Family, SlotField};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use freezing::Freezing;
use heat::{FlowHeat, HeatedFluid};
use kernels::{Inputs, JumpSums, RIGID};
use phase::{Measured, Phase};
use pressure::{PressureBonds, PressureSolver};
use slots::FlowSlots;
use thermocapillary::Thermocapillary;
use wetted_body::WettedBody;

use super::fluxes::AT_WALLS;
use super::fluxes::FlowNow;
use super::fluxes::kernels::{ViscosityInputs, ViscositySums};
use super::fluxes::short_waves::{DecayingWaves, FlowBonds};
use crate::advection::Convection;
use crate::fluid::interface_report::{InterfaceFlow, InterfaceReport};
use crate::fluid::medium::Medium;
use crate::fluid::pair::FluidPair;
use crate::fluid::rates::{POINTS_PER_TASK, Rates, Stability, Terms};
use crate::fluid::walls::Walls;
use crate::shape_tensor::CompleteFamily;

/// Flow of a fluid that keeps its volume.
#[derive(Debug)]
pub(in crate::fluid) struct Projection {
    dimension: usize,
    family: Arc<Family>,
    complete: CompleteFamily,
    /// Bodies that are walls.
    pub(in crate::fluid::eulerian) walls: Walls,
    /// Largest divergence over speed by spacing.
    tolerance: f64,
    /// m.
    spacing: f64,
    /// Slot of each point.
    slot: Vec<u32>,
    state: ProjectionState,
    slots: FlowSlots,
    viscosity: SlotField,
    /// By point, Pa s; empty where there is one fluid.
    mixed_viscosity: Vec<f64>,
    /// What two fluids have besides.
    phase: Option<Phase>,
    /// Where the first of two fluids freezes.
    freezing: Option<Freezing>,
    /// Heat that is carried, where `thermal` takes it up.
    heat: Option<FlowHeat>,
    /// Where surface tension depends on the temperature.
    thermocapillary: Option<Thermocapillary>,
    /// At the start of the step, and in its middle, by point, m/s.
    start: Vec<Vector3<f64>>,
    middle: Vec<Vector3<f64>>,
    /// Rows of points: force (N/m³) and work (W/m³) of viscosity; momentum (N/m³) and volume of the first fluid (1/s) that are
    /// carried away; acceleration along the bonds (m/s²).
    diffusion: Vec<f64>,
    carried: Vec<f64>,
    push: Vec<f64>,
    /// Sums of [`JumpSums`], rows of points; empty where there is one fluid.
    jumps: Vec<f64>,
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
    /// Largest speed of the walls in the last step, m/s: a run that is resumed knows it before boundaries set it again.
    wall_speed: f64,
    /// Volume of the first of two fluids at the start, m³.
    first_volume: f64,
    /// Surface tension by point, N/m; empty where it does not depend on the temperature.
    tension: Vec<f64>,
    /// Largest acceleration along surfaces, m/s².
    surface_acceleration: f64,
    /// Pressure on the interface by point, Pa; empty where nothing presses.
    interface_pressure: Vec<f64>,
    /// Whether the first fluid has frozen at a point; empty where it does not freeze.
    frozen: Vec<bool>,
    /// Whether a point is above the melt, so that the first fluid is liquid there.
    melted: Vec<bool>,
}

const PUSH_2D: usize = Inputs::<2>::PUSH;
const PUSH_3D: usize = Inputs::<3>::PUSH;
const VOLUME_2D: usize = Inputs::<2>::VOLUME;
const VOLUME_3D: usize = Inputs::<3>::VOLUME;
const CARRY_2D: usize = Inputs::<2>::CARRY;
const CARRY_3D: usize = Inputs::<3>::CARRY;
const VISCOUS_2D: usize = ViscosityInputs::<2>::PLAIN;
const VISCOUS_3D: usize = ViscosityInputs::<3>::PLAIN;
const SUMS_2D: usize = ViscositySums::<2>::COUNT;
const SUMS_3D: usize = ViscositySums::<3>::COUNT;
const JUMPS_2D: usize = JumpSums::<2>::COUNT;
const JUMPS_3D: usize = JumpSums::<3>::COUNT;

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
    pub(super) walls: Walls,
    /// Where there are two fluids.
    pub(super) pair: Option<FluidPair>,
    /// Where the temperature is known.
    pub(super) heat: Option<HeatedFluid>,
    /// What two fluids do at the walls.
    pub(super) wetted: Vec<WettedBody>,
}

impl Projection {
    /// Flow through the points of `body`, whose families are complete.
    pub(super) fn new(
        keys: ProjectionKeys,
        convection: Convection,
        body: &Body,
        domain: ProjectionDomain,
    ) -> Self {
        let ProjectionDomain {
            family,
            complete,
            walls,
            pair,
            heat,
            wetted,
        } = domain;
        let (dimension, points) = (body.dimension, body.points.len());
        let (curves, surfaces) = heat.map(|heat| (heat.curves, heat.surfaces)).unzip();
        let melting = curves.as_ref().zip(pair.as_ref());
        let melting = melting.and_then(|(curves, pair): (&Vec<EnthalpyCurve>, _)| {
            curves[pair.material[0] as usize].latent_heat()
        });
        Projection {
            dimension,
            complete,
            tolerance: keys.tolerance,
            spacing: body.finest_spacing(),
            slot: (0..points).map(|i| family.slot_of(i) as u32).collect(),
            state: ProjectionState {
                predicted: vec![Vector3::zeros(); points],
                acceleration: vec![Vector3::zeros(); points],
                ..ProjectionState::default()
            },
            slots: FlowSlots::new(&family, dimension),
            viscosity: SlotField::default(),
            mixed_viscosity: Vec::new(),
            freezing: melting.map(|melting| Freezing::new(melting, points)),
            heat: curves
                .map(|curves| FlowHeat::new(curves, pair.as_ref().map(|p| p.material), body)),
            thermocapillary: surfaces
                .and_then(|laws| Thermocapillary::new(laws, body, &family, 1.0 / complete.moment)),
            phase: pair.map(|pair| {
                let mut stencil = Vec::new();
                family.for_each_bond(complete.point, |_, bond, _| {
                    stencil.push((bond.xi, bond.weight));
                });
                Phase::new(pair, body, &walls, wetted, stencil)
            }),
            start: vec![Vector3::zeros(); points],
            middle: vec![Vector3::zeros(); points],
            diffusion: vec![0.0; points * (dimension + 1)],
            carried: vec![0.0; points * (dimension + 1)],
            jumps: Vec::new(),
            push: vec![0.0; points * dimension],
            short_waves: DecayingWaves::new(convection, dimension),
            excess: vec![[0.0]; points],
            solver: PressureSolver::new(points),
            iterations: 0,
            walls,
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
        if !state.tension.is_empty() {
            check_length("surface tensions", state.tension.len(), points)?;
        }
        if !state.interface_pressure.is_empty() {
            let found = state.interface_pressure.len();
            check_length("pressures on the interface", found, points)?;
        }
        if self.freezing.is_some() {
            check_length("frozen points", state.frozen.len(), points)?;
            check_length("melted points", state.melted.len(), points)?;
        }
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
            self.find_frozen();
        }
        self.slots
            .pressure
            .load(&self.family, pressure, Mirrored::Scalar);
        self.load_state();
        self.find_interface(density);
        if self.state.step == 0.0 {
            self.set_tension();
        }
    }

    /// The two fluids, where there are two.
    pub(in crate::fluid) fn pair(&self) -> Option<&FluidPair> {
        self.phase.as_ref().map(|phase| &phase.pair)
    }

    /// Takes the fraction of the first of two fluids by point, before the fluxes.
    pub(in crate::fluid) fn set_fraction(&mut self, fraction: &[f64]) {
        if let Some(phase) = &mut self.phase {
            phase.fraction.copy_from_slice(fraction);
        }
    }

    /// Takes the pressure on the interface by point, Pa.
    pub(in crate::fluid) fn set_interface_pressure(&mut self, pressure: &[f64]) {
        self.state.interface_pressure.clear();
        self.state.interface_pressure.extend_from_slice(pressure);
    }

    /// Copies the fraction of the first of two fluids to points.
    pub(in crate::fluid) fn copy_fraction(&self, fraction: &mut [f64]) {
        if let Some(phase) = &self.phase {
            fraction.copy_from_slice(&phase.fraction);
        }
    }

    /// Heat that is carried, where `thermal` takes it up.
    pub(in crate::fluid) fn heat(&self) -> Option<&FlowHeat> {
        self.heat.as_ref()
    }

    pub(in crate::fluid) fn heat_mut(&mut self) -> Option<&mut FlowHeat> {
        self.heat.as_mut()
    }

    /// Keeps the volume of the first of two fluids at the start, for volumes by point (m³).
    pub(in crate::fluid) fn weigh(&mut self, volume: &[f64]) {
        let first = |phase: &Phase| dot(&phase.fraction, volume);
        self.state.first_volume = self.phase.as_ref().map_or(0.0, first);
    }

    /// Volume of the first of two fluids now and at the start, m³.
    pub(in crate::fluid) fn first_volumes(&self, volume: &[f64]) -> Option<[f64; 2]> {
        let phase = self.phase.as_ref()?;
        Some([dot(&phase.fraction, volume), self.state.first_volume])
    }

    /// Measures the interface of two fluids.
    pub(in crate::fluid) fn measure(
        &mut self,
        body: &Body,
        flow: InterfaceFlow<'_>,
    ) -> Option<InterfaceReport> {
        let phase = self.phase.as_mut()?;
        let measured = Measured {
            family: &self.family,
            inverse: 1.0 / self.complete.moment,
            slots: &self.slots,
            body,
            flow,
        };
        Some(match self.dimension {
            2 => phase.measure::<2>(measured),
            _ => phase.measure::<3>(measured),
        })
    }

    /// Iterations for the pressure of the last step.
    pub(in crate::fluid) fn iterations(&self) -> usize {
        self.iterations
    }

    /// Takes the speed of the walls behind faces from the rules of the velocity.
    pub(in crate::fluid) fn note_walls(&mut self, rules: &[LayerRule]) {
        let of_face = |rule: &LayerRule| 0.5 * Vector3::from(rule.offset).norm();
        self.state.wall_speed = rules.iter().map(of_face).fold(0.0, f64::max);
    }
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
        let Some(phase) = &self.phase else {
            return medium.viscosity.load(&self.family, &mut self.viscosity);
        };
        let points = phase.fraction.par_iter().with_min_len(POINTS_PER_TASK);
        let mixed = points.map(|c| phase.pair.viscosity_of(*c));
        mixed.fill(&mut self.mixed_viscosity);
        let (values, frozen) = (&self.mixed_viscosity, &self.state.frozen);
        let value = |i: usize| match frozen.get(i) {
            Some(true) => RIGID,
            _ => values[i],
        };
        self.viscosity.load(&self.family, value, Mirrored::Scalar);
    }

    fn set_velocity(&mut self, velocity: &[SlotField], density: &[f64], terms: &Terms<'_>) {
        let points = self.start.par_iter_mut().zip(&self.slot);
        points.with_min_len(POINTS_PER_TASK).for_all(|(v, slot)| {
            for (a, along) in velocity.iter().enumerate() {
                v[a] = along[*slot as usize];
            }
        });
        let flow = FlowNow {
            terms,
            velocity,
            density,
        };
        self.find_slopes(&flow);
        let in_series = terms.medium.viscosity.needs_shear_rate();
        match (self.dimension, &self.phase) {
            (2, Some(_)) => self.find_jumping_viscosity::<2, VISCOUS_2D, JUMPS_2D>(&flow),
            (_, Some(_)) => self.find_jumping_viscosity::<3, VISCOUS_3D, JUMPS_3D>(&flow),
            (2, None) if in_series => self.find_viscosity::<2, VISCOUS_2D, SUMS_2D, true>(&flow),
            (_, None) if in_series => self.find_viscosity::<3, VISCOUS_3D, SUMS_3D, true>(&flow),
            (2, None) => self.find_viscosity::<2, VISCOUS_2D, SUMS_2D, false>(&flow),
            (_, None) => self.find_viscosity::<3, VISCOUS_3D, SUMS_3D, false>(&flow),
        }
        let bonds = FlowBonds {
            family: &self.family,
            complete: &self.complete,
            slot: &self.slot,
        };
        let viscosity = match &self.phase {
            None => &terms.medium.viscosity.value,
            Some(_) => &self.mixed_viscosity,
        };
        match self.dimension {
            2 => self.short_waves.find::<2>(bonds, &flow, viscosity),
            _ => self.short_waves.find::<3>(bonds, &flow, viscosity),
        }
    }

    fn set_pressure(&mut self, pressure: &[f64], _force: Option<&[Vector3<f64>]>) {
        self.slots
            .pressure
            .load(&self.family, pressure, Mirrored::Scalar);
    }

    fn advance_density(
        &mut self,
        terms: &Terms<'_>,
        density: &mut [f64],
        pressure: &mut [f64],
    ) -> Result<(), SolverError> {
        match self.dimension {
            2 => self.find_excess::<2, VOLUME_2D, CARRY_2D, SUMS_2D>(terms, density),
            _ => self.find_excess::<3, VOLUME_3D, CARRY_3D, SUMS_3D>(terms, density),
        }
        let bonds = PressureBonds {
            family: &self.family,
            laplacian: 2.0 * self.inverse(),
            density: match &self.freezing {
                Some(freezing) => &freezing.inertia,
                None => &self.slots.density,
            },
        };
        let tolerance = self.divergence(terms);
        self.iterations = self.solver.solve(bonds, &self.excess, tolerance)?;
        let points = pressure.par_iter_mut().zip(&self.solver.surplus);
        let points = points.with_min_len(POINTS_PER_TASK);
        points.for_all(|(p, surplus)| *p -= surplus / terms.dt);
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
        points.for_all(|(i, (v, predicted))| {
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
