//! Steps of the heat equation in time.

use perimelt_core::solver::reduce::{norm, weighted_sum};
use perimelt_core::solver::{
    Implicit, KrylovMethod, Newton, NewtonOptions, Rkl2, SolverError, steady_state,
};
use perimelt_core::world::refinement::Level;
use perimelt_core::{Step, Work, World};
use rayon::prelude::*;

use super::below::Below;
use super::carried::Carried;
use super::conduction::Matter;
use super::control::{ControlledSteps, Method, StepControl};
use super::keys::{Thermal, ThermalSolver};
use super::rates::{CurrentVolumes, Drawn, EnthalpyRate, Flow, TemperatureRate, Vectors};
use super::refined::Refined;
use super::run::{HeatAccount, RunningThermal};

/// A solver with its work vectors.
#[derive(Debug)]
pub(super) struct Integrator {
    solver: Solver,
    stable_step: f64,
    row_sums: Vec<[f64; 1]>,
    state: Vec<f64>,
    controlled: ControlledSteps,
    vectors: Vectors,
}

#[derive(Debug)]
enum Solver {
    Explicit,
    Controlled(Method),
    Steady(Newton, f64),
}

impl Integrator {
    pub(super) fn new(thermal: &Thermal) -> Self {
        let (solver, tolerance) = (thermal.solver, thermal.tolerance);
        let options = NewtonOptions {
            relative_tolerance: tolerance,
            ..NewtonOptions::default()
        };
        let controlled = Solver::Controlled;
        let solver = match solver {
            ThermalSolver::Explicit => Solver::Explicit,
            ThermalSolver::Rkl2 => controlled(Method::Rkl2(Rkl2::default())),
            ThermalSolver::Implicit => controlled(Method::Euler(Implicit::euler(options))),
            ThermalSolver::CrankNicolson => {
                controlled(Method::CrankNicolson(Implicit::crank_nicolson(options)))
            }
            ThermalSolver::Steady => {
                let krylov = KrylovMethod::ConjugateGradient;
                let options = NewtonOptions {
                    relative_tolerance: 0.0,
                    krylov,
                    ..options
                };
                Solver::Steady(Newton::new(options), tolerance)
            }
        };
        Integrator {
            solver,
            stable_step: f64::INFINITY,
            row_sums: Vec::new(),
            state: Vec::new(),
            controlled: ControlledSteps::new(thermal.time_tolerance),
            vectors: Vectors::default(),
        }
    }

    /// Sets the sums of the coefficients of each point's bonds at the largest conductivities, W/(m³ K).
    pub(super) fn set_row_sums(&mut self, row_sums: Vec<[f64; 1]>) {
        self.row_sums = row_sums;
    }

    /// What [`Integrator::set_row_sums`] set; empty before.
    pub(super) fn row_sums(&self) -> &[[f64; 1]] {
        &self.row_sums
    }

    /// The same, to change.
    pub(super) fn row_sums_mut(&mut self) -> &mut Vec<[f64; 1]> {
        &mut self.row_sums
    }

    /// The step that keeps the error in time next, s; `None` for solvers without one.
    pub(super) fn next_step(&self) -> Option<f64> {
        let is_controlled = matches!(self.solver, Solver::Controlled(_));
        is_controlled.then(|| self.controlled.control.next(self.stable_step))
    }

    /// Control of the sizes of steps.
    pub(super) fn control(&self) -> StepControl {
        self.controlled.control
    }

    /// Takes up a control that was saved.
    pub(super) fn set_control(&mut self, control: StepControl) {
        self.controlled.control = control;
    }

    /// Sets the largest stable explicit step, s.
    pub(super) fn set_stable_step(&mut self, stable_step: f64) {
        self.stable_step = stable_step;
    }
}

/// Fields of the heat during a step, and their account.
struct Fields<'a> {
    temperature: &'a mut [f64],
    enthalpy: &'a mut [f64],
    account: &'a mut HeatAccount,
}

impl Fields<'_> {
    /// Takes equal steps of forward Euler that cover `size` (s); `refined`: of a body that has a window of finer points or
    /// is one.
    fn advance_explicitly(
        self,
        mut flow: Flow<'_>,
        (size, steps): (f64, usize),
        mut refined: Option<(&mut Refined, &World)>,
    ) -> Work {
        let dt = size / steps as f64;
        for _ in 0..steps {
            self.account.supply(dt * flow.evaluate(self.temperature));
            if let Some((refined, world)) = &mut refined {
                let heat = refined.exchange(world, dt, flow.conduction);
                self.account.supply(heat);
            }
            let curves = flow.matter.curves;
            let points = self
                .temperature
                .par_iter_mut()
                .zip(&mut *self.enthalpy)
                .zip(&flow.conduction.rate)
                .zip(flow.matter.material);
            points
                .with_min_len(4096)
                .for_each(|(((t, h), [rate]), &m)| {
                    (*t, *h) = curves[m as usize].advance(*t, *h, dt * rate);
                });
        }
        Work::of_stages(steps)
    }

    /// Finds the steady state at a time, s; `floating` where nothing holds the level of the temperature.
    fn find_steady_state(
        self,
        (newton, tolerance): (&mut Newton, f64),
        mut flow: Flow<'_>,
        (time, floating): (f64, bool),
    ) -> Result<Work, SolverError> {
        let surface = flow.surface.as_ref();
        let is_linear = surface.is_none_or(|surface| surface.is_linear());
        newton.options.linear = is_linear && flow.conduction.is_linear();
        flow.evaluate(&vec![0.0; self.temperature.len()]);
        let mut loads: Vec<f64> = bytemuck::cast_slice(&flow.conduction.rate).to_vec();
        let (volume, matter) = (flow.volume, flow.matter);
        let weights = flow.is_weighted.then_some(volume);
        if weights.is_some() {
            loads.iter_mut().zip(volume).for_each(|(q, v)| *q *= v);
        }
        newton.options.absolute_tolerance = tolerance * norm(&loads);
        let mut rate = TemperatureRate { flow, weights };
        let report = steady_state(newton, &mut rate, time, self.temperature, floating)?;
        let points = self.enthalpy.iter_mut().zip(&*self.temperature);
        let points = points.zip(matter.material);
        points.for_each(|((h, t), &m)| *h = matter.curves[m as usize].enthalpy(*t));
        // states that a common steady state of several bodies went through leave no trace
        let stored = weighted_sum(self.enthalpy, volume);
        let account = self.account;
        account.supply(stored - account.initial - account.supplied);
        Ok(report.into())
    }

    /// Advances the enthalpies together with the heat supplied by steps of a method that keep the tolerance.
    fn advance_enthalpy(
        self,
        flow: Flow<'_>,
        state: &mut Vec<f64>,
        take: impl FnOnce(&mut EnthalpyRate<'_>, &mut [f64]) -> Result<Work, SolverError>,
    ) -> Result<Work, SolverError> {
        let matter = flow.matter;
        state.clear();
        state.extend_from_slice(self.enthalpy);
        state.push(0.0);
        let work = take(&mut EnthalpyRate(flow), state)?;
        let points = self.enthalpy.len();
        self.account.supply(state[points]);
        self.enthalpy.copy_from_slice(&state[..points]);
        let points = self.temperature.par_iter_mut().zip(&*self.enthalpy);
        let points = points.zip(matter.material);
        points.for_each(|((t, h), &m)| *t = matter.curves[m as usize].temperature(*h));
        Ok(work)
    }
}

impl RunningThermal {
    /// Advances temperature and enthalpy over `step`.
    pub(super) fn integrate(&mut self, world: &World, step: Step) -> Result<Work, SolverError> {
        let work = self.take_step(world, step)?;
        if let Some(refined) = &self.refined {
            refined.cover(world, (self.temperature, self.enthalpy), &self.curves);
        }
        Ok(work)
    }

    fn take_step(&mut self, world: &World, step: Step) -> Result<Work, SolverError> {
        self.take_births(world);
        self.hold_temperatures(world);
        self.follow_interfaces(world);
        self.follow_surface(world);
        if let Some(consolidated) = self.consolidated {
            self.conduction.consolidate(&world.read(consolidated));
        }
        if let Some((conductivity, fraction)) = &self.austenite
            && let Some(fraction) = world.read_if_provided(*fraction)
        {
            self.conduction.set_austenite(conductivity, &fraction);
        }
        let rules = world.layer_rules(self.layers);
        let body = world.body(self.body);
        let source = self.heat_source.map(|s| world.read(s));
        let is_steady = matches!(self.integrator.solver, Solver::Steady(..));
        let conductance = self.heat_conductance.filter(|_| is_steady);
        let conductance = conductance.map(|c| world.read(c));
        let constraint = self.constraint.map(|c| world.read(c));
        let growth = self.growth.as_ref();
        let masked = |values: &'_ [f64]| growth.map(|g| g.masked(values).into_owned());
        let source_there = source.as_deref().and_then(masked);
        let constraint_there = constraint.as_deref().and_then(masked);
        let family = world.family(self.family);
        let ratios = self.volume_ratios(world);
        let configuration = ratios.as_ref().map(|_| world.configuration(self.body));
        if let Some(refined) = &mut self.refined {
            refined.follow(world, &family, &mut self.conduction);
        }
        let matter = Matter {
            family: &family,
            rules: &rules,
            material: &body.material_of_point,
            curves: &self.curves,
        };
        if let Some(carried) = &mut self.carried {
            let temperature = world.read::<f64>(self.temperature.into());
            let state = Carried {
                velocity: &world.read(carried.velocity),
                density: &world.read(carried.density),
                mass_flux: &world.read(carried.mass_flux),
                temperature: &temperature,
                enthalpy: &world.read(self.enthalpy.into()),
            };
            let points = Below {
                conduction: &self.conduction,
                curves: &self.curves,
                material: matter.material,
                temperature: &temperature,
            };
            let conductivity = |point: usize| points.conductivity(point);
            carried.start((world, body), (&matter, &state), conductivity);
        }
        let current = configuration.as_ref().zip(ratios.as_ref());
        let current = current.map(|(now, ratio)| CurrentVolumes {
            volume: now.volumes(),
            ratio,
        });
        let Integrator {
            solver,
            stable_step,
            row_sums,
            state,
            controlled,
            vectors,
        } = &mut self.integrator;
        vectors.start_step();
        // a plate takes up its heat where the window does not cover it
        let uncovered = self.refined.as_ref().and_then(Refined::uncovered);
        let flow = Flow {
            conduction: &mut self.conduction,
            matter,
            volume: uncovered.as_deref().unwrap_or(&body.points.volume),
            is_weighted: body.lattice().is_none() || current.is_some(),
            current,
            source: source_there.as_deref().or(source.as_deref()),
            surface: self.surface.as_mut(),
            drawn: conductance.as_deref().map(|conductance| Drawn {
                conductance,
                temperature: world.read::<f64>(self.temperature.into()).to_vec(),
            }),
            carried: self.carried.as_mut().map(|c| (c, step.size)),
            constraint: constraint_there.as_deref().or(constraint.as_deref()),
            row_sums,
            vectors,
        };
        let fields = Fields {
            temperature: &mut world.write(self.temperature),
            enthalpy: &mut world.write(self.enthalpy),
            account: &mut self.heat,
        };
        let (start, size) = (step.start, step.size);
        match solver {
            Solver::Explicit => {
                // deposited points may have shortened the stable step since this one was chosen
                let steps = match growth {
                    Some(_) => (size / *stable_step * (1.0 - 1e-9)).ceil().max(1.0) as usize,
                    None => 1,
                };
                let refined = self.refined.as_mut().map(|r| (r, world));
                Ok(fields.advance_explicitly(flow, (size, steps), refined))
            }
            Solver::Steady(newton, tolerance) => {
                let at = (step.end(), self.floating);
                fields.find_steady_state((newton, *tolerance), flow, at)
            }
            Solver::Controlled(method) => {
                let has_material = |point: usize| growth.is_none_or(|g| g.is_born(point));
                fields.advance_enthalpy(flow, state, |rate, state| {
                    let span = (start, size, *stable_step);
                    controlled.cover(method, rate, span, state, has_material)
                })
            }
        }
    }

    /// Sets the temperatures that boundaries hold.
    fn hold_temperatures(&mut self, world: &World) {
        let (Some(constraint), Some(held)) = (self.constraint, self.held) else {
            return;
        };
        let (constraint, held) = (world.read(constraint), world.read(held));
        let mut temperature = world.write(self.temperature);
        let mut enthalpy = world.write(self.enthalpy);
        let volume = &world.body(self.body).points.volume;
        let material = &world.body(self.body).material_of_point;
        // the heat of covered points is that of the window
        let plate = world.refinement(self.body);
        let plate = plate.filter(|(_, level)| *level == Level::Plate);
        let counts = |point: usize| plate.is_none_or(|(r, _)| !r.covers(r.plate_cell(point)));
        let mut supplied = 0.0;
        let growth = self.growth.as_ref();
        let is_held = |(i, c): &(usize, &f64)| **c > 0.0 && growth.is_none_or(|g| g.is_born(*i));
        for (i, c) in constraint.iter().enumerate().filter(is_held) {
            temperature[i] = held[i] / c;
            let new = self.curves[material[i] as usize].enthalpy(temperature[i]);
            if counts(i) {
                supplied += volume[i] * (new - enthalpy[i]);
            }
            enthalpy[i] = new;
        }
        self.heat.supply(supplied);
    }
}
