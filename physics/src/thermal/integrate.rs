//! Steps of the heat equation in time.

use std::borrow::Cow;
use std::cell::Ref;

use perimelt_core::parallel::ParallelLoop;
use perimelt_core::solver::{
    ExactSum, Implicit, KrylovMethod, Newton, NewtonOptions, Rkl2, SolverError, steady_state,
};
use perimelt_core::world::refinement::Level;
use perimelt_core::{Step, Work, World};
use rayon::prelude::*;

use super::conduction::Matter;
use super::control::{ControlledSteps, LimitedStep, Method, StepControl};
use super::growth::Growth;
use super::keys::{Thermal, ThermalSolver};
use super::mixture::MixedFluids;
use super::rates::{
    BodyExchange, CurrentVolumes, EnthalpyRate, HeatFlow, TemperatureRate, Vectors,
};
use super::refined::Refined;
use super::run::{HeatAccount, RunningThermal};
use crate::heat_content::HeatContent;

/// A solver with its work vectors.
#[derive(Debug)]
pub(super) struct Integrator {
    solver: Solver,
    stable_step: f64,
    row_sums: Vec<[f64; 1]>,
    state: Vec<f64>,
    vectors: Vectors,
}

/// How heat is stepped in time.
#[derive(Debug)]
pub(super) enum Solver {
    Explicit,
    Controlled(Box<Method>, ControlledSteps),
    /// With the tolerance relative to the loads.
    Steady(Box<Newton>, f64),
}

impl Thermal {
    /// Takes the keys of a solver out of the table.
    pub(super) fn take_solver(&mut self, solver: ThermalSolver) -> Solver {
        let newton = |this: &mut Thermal| NewtonOptions {
            relative_tolerance: this.tolerance.take().unwrap_or(1e-10),
            ..NewtonOptions::default()
        };
        let method = match solver {
            ThermalSolver::Explicit => return Solver::Explicit,
            ThermalSolver::Rkl2 => Method::Rkl2(Rkl2::default()),
            ThermalSolver::Implicit => Method::Euler(Implicit::euler(newton(self))),
            ThermalSolver::CrankNicolson => {
                Method::CrankNicolson(Implicit::crank_nicolson(newton(self)))
            }
            ThermalSolver::Steady => {
                let options = newton(self);
                let tolerance = options.relative_tolerance;
                let options = NewtonOptions {
                    relative_tolerance: 0.0,
                    krylov: KrylovMethod::ConjugateGradient,
                    ..options
                };
                return Solver::Steady(Box::new(Newton::new(options)), tolerance);
            }
        };
        let tolerance = self.time_tolerance.take().unwrap_or(1e-3);
        Solver::Controlled(Box::new(method), ControlledSteps::new(tolerance))
    }
}

impl Integrator {
    pub(super) fn new(solver: Solver) -> Self {
        Integrator {
            solver,
            stable_step: f64::INFINITY,
            row_sums: Vec::new(),
            state: Vec::new(),
            vectors: Vectors::default(),
        }
    }

    /// Sets the sums of the coefficients of each point's bonds at the largest conductivities, W/(m³ K).
    pub(super) fn set_row_sums(&mut self, row_sums: Vec<[f64; 1]>) {
        self.row_sums = row_sums;
    }

    /// Sums set by [`Integrator::set_row_sums`]; empty before.
    pub(super) fn row_sums(&self) -> &[[f64; 1]] {
        &self.row_sums
    }

    /// Mutable access to [`Integrator::row_sums`].
    pub(super) fn row_sums_mut(&mut self) -> &mut Vec<[f64; 1]> {
        &mut self.row_sums
    }

    /// The next step by the error in time, s; `None` for solvers without an error estimate.
    pub(super) fn next_step(&self) -> Option<f64> {
        match &self.solver {
            Solver::Controlled(_, steps) => Some(steps.control.next(self.stable_step)),
            _ => None,
        }
    }

    /// State of the step control.
    pub(super) fn control(&self) -> StepControl {
        match &self.solver {
            Solver::Controlled(_, steps) => steps.control,
            _ => StepControl::default(),
        }
    }

    /// Restores a saved step control.
    pub(super) fn set_control(&mut self, control: StepControl) {
        if let Solver::Controlled(_, steps) = &mut self.solver {
            steps.control = control;
        }
    }

    /// Sets the largest stable explicit step, s.
    pub(super) fn set_stable_step(&mut self, stable_step: f64) {
        self.stable_step = stable_step;
    }
}

/// Fields of the heat during a step, and the heat balance.
struct Fields<'a> {
    temperature: &'a mut [f64],
    enthalpy: &'a mut [f64],
    account: &'a mut HeatAccount,
}

impl Fields<'_> {
    /// Takes equal steps of forward Euler over a time of `size` (s), with the exchange between a coarse body and its window.
    fn advance_explicitly(
        self,
        mut flow: HeatFlow<'_>,
        size: f64,
        steps: usize,
        mut refined: Option<(&mut Refined, &World)>,
    ) -> Work {
        let dt = size / steps as f64;
        let content = HeatContent {
            curves: flow.matter.curves,
            material: flow.matter.material,
            mixture: flow.mixture,
        };
        for _ in 0..steps {
            self.account.supply(dt * flow.evaluate(self.temperature));
            if let Some(surface) = &mut flow.surface {
                surface.give_during(dt, flow.volume);
            }
            if let Some((refined, world)) = &mut refined {
                let heat = refined.exchange(world, dt, flow.conduction);
                self.account.supply(heat);
            }
            let points = self
                .temperature
                .par_iter_mut()
                .zip(&mut *self.enthalpy)
                .zip(&flow.conduction.rate);
            points
                .enumerate()
                .with_min_len(4096)
                .for_all(|(i, ((t, h), [rate]))| {
                    (*t, *h) = content.advance(i, *t, *h, dt * rate);
                });
        }
        Work::of_stages(steps)
    }

    /// Finds the steady state at a time, s; `floating`: no boundary fixes the temperature.
    fn find_steady_state(
        self,
        newton: &mut Newton,
        tolerance: f64,
        mut flow: HeatFlow<'_>,
        time: f64,
        floating: bool,
    ) -> Result<Work, SolverError> {
        let surface = flow.surface.as_ref();
        let is_linear = surface.is_none_or(|surface| surface.is_linear());
        let points = flow.matter.points.clone();
        newton.options.linear = !points.any(!(is_linear && flow.conduction.is_linear()));
        flow.evaluate(&vec![0.0; self.temperature.len()]);
        let mut loads: Vec<f64> = bytemuck::cast_slice(&flow.conduction.rate).to_vec();
        let (volume, matter) = (flow.volume, flow.matter);
        let weights = flow.is_weighted.then_some(volume);
        if weights.is_some() {
            loads
                .iter_mut()
                .zip(volume.each())
                .for_each(|(q, v)| *q *= v);
        }
        newton.options.absolute_tolerance = tolerance * points.norm(&loads);
        let weights = weights.map(|volume| &**volume);
        let mut rate = TemperatureRate { flow, weights };
        let report = steady_state(newton, &mut rate, time, self.temperature, floating)?;
        let states = self.enthalpy.iter_mut().zip(&*self.temperature);
        let states = states.zip(matter.material);
        states.for_each(|((h, t), &m)| *h = matter.curves[m as usize].enthalpy(*t));
        // the balance counts the steady state only, not the states that the iteration of several bodies passed
        let stored = points.sum_over(self.enthalpy, volume, |h, v| h * v);
        let account = self.account;
        account.supply(stored - account.initial - account.supplied);
        Ok(report.into())
    }

    /// Advances the enthalpies and the heat supplied by controlled steps of a method.
    fn advance_enthalpy(
        self,
        flow: HeatFlow<'_>,
        state: &mut Vec<f64>,
        take: impl FnOnce(&mut EnthalpyRate<'_>, &mut [f64]) -> Result<Work, SolverError>,
    ) -> Result<Work, SolverError> {
        let matter = flow.matter;
        state.clear();
        state.extend_from_slice(self.enthalpy);
        state.push(0.0);
        let given = flow.surface.as_ref().map_or(0, |s| s.given.len());
        state.resize(state.len() + given, 0.0);
        let mut rate = EnthalpyRate(flow);
        let work = take(&mut rate, state)?;
        let points = self.enthalpy.len();
        self.account.supply(state[points]);
        if let Some(surface) = rate.0.surface {
            surface.given.add(1.0, &state[points + 1..]);
        }
        self.enthalpy.copy_from_slice(&state[..points]);
        let points = self.temperature.par_iter_mut().zip(&*self.enthalpy);
        let points = points.zip(matter.material);
        points.for_all(|((t, h), &m)| *t = matter.curves[m as usize].temperature(*h));
        Ok(work)
    }
}

/// Number of explicit steps in a step of a growing body: deposited points may have shortened the stable step since the
/// step was chosen.
fn explicit_steps(size: f64, stable_step: f64) -> usize {
    (size / stable_step * (1.0 - 1e-9)).ceil().max(1.0) as usize
}

/// A consumed field, zero at points of a growing body that are not born.
fn masked<'a>(growth: Option<&Growth>, values: Option<&'a [f64]>) -> Option<Cow<'a, [f64]>> {
    values.map(|values| growth.map_or(Cow::Borrowed(values), |g| g.masked(values)))
}

impl RunningThermal {
    /// Advances temperature and enthalpy over `step`.
    pub(super) fn integrate(&mut self, world: &World, step: Step) -> Result<Work, SolverError> {
        self.start_step(world);
        let work = self.take_step(world, step)?;
        if let Some(surface) = &mut self.surface {
            self.heat.from_bodies += surface.take_from_surroundings(world);
        }
        if let Some(refined) = &self.refined {
            refined.cover(
                world,
                self.fields.temperature,
                self.fields.enthalpy,
                &self.curves,
            );
        }
        Ok(work)
    }

    /// Updates points, boundaries, conductivities and the position of the window at the start of a step.
    fn start_step(&mut self, world: &World) {
        self.integrator.vectors.start_step();
        self.take_births(world);
        self.follow_fluids(world);
        self.take_carried_heat(world);
        self.take_given_heat(world);
        self.hold_temperatures(world);
        self.follow_interfaces(world);
        self.follow_surface(world);
        if let Some(orientation) = self.orientation {
            self.conduction.set_orientation(&world.read(orientation));
        }
        if let Some(consolidated) = self.consolidated {
            self.conduction.consolidate(&world.read(consolidated));
        }
        if let Some(austenite) = &self.austenite
            && let Some(fraction) = world.read_if_provided(austenite.fraction)
        {
            self.conduction
                .set_austenite(&austenite.conductivity, &fraction);
        }
        if let Some(refined) = &mut self.refined {
            let family = world.family(self.family);
            refined.follow(world, &family, &mut self.conduction);
        }
    }

    /// Advances temperature and enthalpy by the solver.
    fn take_step(&mut self, world: &World, step: Step) -> Result<Work, SolverError> {
        let rules = world.layer_rules(self.layers);
        let body = world.body(self.body);
        let source = self.fields.source.map(|s| world.read(s));
        let conductance = self.steady_conductance(world);
        let constraint = self.fields.constraint.map(|c| world.read(c));
        let fraction = self.fraction(world);
        let growth = self.growth.as_ref();
        let heat_state = self.heat_state();
        let source = masked(growth, source.as_deref());
        let constraint = masked(growth, constraint.as_deref());
        let family = world.family(self.family);
        let ratios = self.volume_ratios(world);
        let configuration = ratios.as_ref().map(|_| world.configuration(self.body));
        let matter = Matter {
            family: &family,
            rules: &rules,
            material: &body.material_of_point,
            curves: &self.curves,
            points: &world.reducer(self.body),
        };
        if let Some(carried) = &mut self.carried {
            carried.start(world, body, &matter, &self.conduction, &heat_state);
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
            vectors,
        } = &mut self.integrator;
        // heat sources act on the points of a coarse body that the window does not cover
        let uncovered = self.refined.as_ref().and_then(Refined::uncovered);
        let flow = HeatFlow {
            conduction: &mut self.conduction,
            matter,
            volume: uncovered.as_deref().unwrap_or(&body.points.volume),
            is_weighted: body.lattice().is_none() || current.is_some(),
            current,
            source: source.as_deref(),
            surface: self.surface.as_mut(),
            exchanged: conductance.as_deref().map(|conductance| BodyExchange {
                conductance,
                temperature: world.read::<f64>(self.fields.temperature.into()).to_vec(),
            }),
            carried: self.carried.as_mut().map(|c| (c, step.size)),
            mixture: self
                .fluids
                .zip(fraction.as_deref())
                .map(MixedFluids::mixture),
            constraint: constraint.as_deref(),
            row_sums,
            vectors,
        };
        let fields = Fields {
            temperature: &mut world.write(self.fields.temperature),
            enthalpy: &mut world.write(self.fields.enthalpy),
            account: &mut self.heat,
        };
        match solver {
            Solver::Explicit => {
                let steps = growth.map_or(1, |_| explicit_steps(step.size, *stable_step));
                let refined = self.refined.as_mut().map(|r| (r, world));
                Ok(fields.advance_explicitly(flow, step.size, steps, refined))
            }
            Solver::Steady(newton, tolerance) => {
                fields.find_steady_state(newton, *tolerance, flow, step.end(), self.floating)
            }
            Solver::Controlled(method, steps) => {
                let has_material = |point: usize| growth.is_none_or(|g| g.is_born(point));
                fields.advance_enthalpy(flow, state, |rate, state| {
                    let stable = *stable_step;
                    let step = LimitedStep { step, stable };
                    steps.cover(method, rate, step, state, has_material)
                })
            }
        }
    }

    /// Conductance to other bodies, in the search for a steady state.
    fn steady_conductance<'a>(&self, world: &'a World) -> Option<Ref<'a, [f64]>> {
        let is_steady = matches!(self.integrator.solver, Solver::Steady(..));
        let conductance = self.fields.conductance.filter(|_| is_steady);
        conductance.map(|c| world.read(c))
    }

    /// Adds the heat that a flow carried from point to point since the last step. It is not counted as supplied: its sum
    /// vanishes, which the balance verifies.
    fn take_carried_heat(&mut self, world: &World) {
        let Some(carried) = self.fields.carried else {
            return;
        };
        self.add_heat(world, &world.read(carried));
    }

    /// Adds heat to the points, J/m³.
    fn add_heat(&self, world: &World, heat: &[f64]) {
        let mut temperature = world.write(self.fields.temperature);
        let mut enthalpy = world.write(self.fields.enthalpy);
        let fraction = self.fraction(world);
        let content = self.content(
            &world.body(self.body).material_of_point,
            fraction.as_deref(),
        );
        for (i, heat) in heat.iter().enumerate().filter(|(_, heat)| **heat != 0.0) {
            enthalpy[i] += heat;
            temperature[i] = content.temperature(i, enthalpy[i], temperature[i]);
        }
    }

    /// Adds the heat that physics of other bodies gave since the last step.
    fn take_given_heat(&mut self, world: &World) {
        let Some(given) = self.fields.given else {
            return;
        };
        let given = world.read(given);
        let volume = &world.body(self.body).points.volume;
        let reducer = world.reducer(self.body);
        let heat = reducer.sum_over(&given, volume, |q, v| q * v);
        self.add_heat(world, &given);
        self.heat.supply(heat);
        self.heat.from_bodies += heat;
    }

    /// Sets the temperatures that boundaries prescribe.
    fn hold_temperatures(&mut self, world: &World) {
        let (Some(constraint), Some(held)) = (self.fields.constraint, self.fields.held) else {
            return;
        };
        let (constraint, held) = (world.read(constraint), world.read(held));
        let mut temperature = world.write(self.fields.temperature);
        let mut enthalpy = world.write(self.fields.enthalpy);
        let volume = &world.body(self.body).points.volume;
        let fraction = self.fraction(world);
        let content = self.content(
            &world.body(self.body).material_of_point,
            fraction.as_deref(),
        );
        // covered points of a coarse body do not count; their heat belongs to the window
        let plate = world.refinement(self.body);
        let plate = plate.filter(|(_, level)| *level == Level::Plate);
        let counts = |point: usize| plate.is_none_or(|(r, _)| !r.covers(r.plate_cell(point)));
        let reducer = world.reducer(self.body);
        let mut supplied = ExactSum::default();
        let growth = self.growth.as_ref();
        let is_held = |(i, c): &(usize, &f64)| **c > 0.0 && growth.is_none_or(|g| g.is_born(*i));
        for (i, c) in constraint.iter().enumerate().filter(is_held) {
            temperature[i] = held[i] / c;
            let new = content.enthalpy(i, temperature[i]);
            if i < reducer.owned() && counts(i) {
                supplied.add(volume[i] * (new - enthalpy[i]));
            }
            enthalpy[i] = new;
        }
        self.heat.supply(reducer.total(supplied));
    }
}
