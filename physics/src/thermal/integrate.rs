//! Steps of the heat equation in time.
//!
//! All solvers but forward Euler and the steady one advance the enthalpies together with one
//! more component: the heat supplied so far (J), whose rate is the power of sources and
//! boundaries. The scheme that integrates the state thereby integrates its account, and the
//! balance holds to rounding.

use perimelt_core::refinement::Level;
use perimelt_core::solver::reduce::{norm, sum_of, sum_points};
use perimelt_core::solver::{
    At, Implicit, KrylovMethod, Newton, NewtonOptions, Rhs, Rkl2, SolverError, steady_state,
};
use perimelt_core::{Step, Work, World};
use rayon::prelude::*;

use super::carried::{Carried, CarriedHeat};
use super::conduction::{Conduction, Matter};
use super::keys::ThermalSolver;
use super::refined::Refined;
use super::run::{HeatAccount, Run};

/// A solver with its work vectors.
#[derive(Debug)]
pub(super) struct Integrator {
    method: Method,
    stable_step: f64,
    row_sums: Vec<[f64; 1]>,
    state: Vec<f64>,
    temperature: Vec<f64>,
}

#[derive(Debug)]
enum Method {
    Explicit,
    Rkl2(Rkl2),
    Implicit(Implicit),
    Steady(Newton, f64),
}

impl Integrator {
    pub(super) fn new(solver: ThermalSolver, tolerance: f64) -> Self {
        let options = NewtonOptions {
            relative_tolerance: tolerance,
            ..NewtonOptions::default()
        };
        let method = match solver {
            ThermalSolver::Explicit => Method::Explicit,
            ThermalSolver::Rkl2 => Method::Rkl2(Rkl2::default()),
            ThermalSolver::Implicit => Method::Implicit(Implicit::euler(options)),
            ThermalSolver::CrankNicolson => Method::Implicit(Implicit::crank_nicolson(options)),
            ThermalSolver::Steady => {
                let krylov = KrylovMethod::ConjugateGradient;
                let options = NewtonOptions {
                    relative_tolerance: 0.0,
                    krylov,
                    ..options
                };
                Method::Steady(Newton::new(options), tolerance)
            }
        };
        Integrator {
            method,
            stable_step: f64::INFINITY,
            row_sums: Vec::new(),
            state: Vec::new(),
            temperature: Vec::new(),
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

    /// Sets the largest stable explicit step, s.
    pub(super) fn set_stable_step(&mut self, stable_step: f64) {
        self.stable_step = stable_step;
    }
}

/// What the flow of heat depends on during a step.
struct Flow<'a> {
    conduction: &'a mut Conduction,
    matter: Matter<'a>,
    /// Reference volumes, to which enthalpies and sources refer, m³.
    volume: &'a [f64],
    /// Whether the volumes make the conduction symmetric: where they differ, or points move.
    is_weighted: bool,
    /// Where points move.
    current: Option<CurrentVolumes<'a>>,
    source: Option<&'a [f64]>,
    /// Heat that an Eulerian fluid carries, and the step, s.
    carried: Option<(&'a mut CarriedHeat, f64)>,
    /// Positive where the temperature is held.
    constraint: Option<&'a [f64]>,
    row_sums: &'a [[f64; 1]],
    temperature: &'a mut Vec<f64>,
}

/// Volumes of points that move.
struct CurrentVolumes<'a> {
    /// m³.
    volume: &'a [f64],
    /// Over the reference volume.
    ratio: &'a [f64],
}

impl Flow<'_> {
    /// Leaves `flow + source` in `conduction.rate`, zero at held points; returns the power
    /// that comes in through sources and boundaries, W.
    fn evaluate(&mut self, temperature: &[f64]) -> f64 {
        self.conduction.load(&self.matter, temperature);
        self.conduction.flow(&self.matter);
        let volume = self.current.as_ref().map_or(self.volume, |c| c.volume);
        let mut power = self.conduction.inflow(self.matter.family, volume);
        let rate = &mut self.conduction.rate;
        if let Some(CurrentVolumes { ratio, .. }) = self.current {
            let points = rate.par_iter_mut().zip(ratio).with_min_len(4096);
            points.for_each(|([r], ratio)| *r *= ratio);
        }
        if let Some(source) = self.source {
            power += sum_of([source, self.volume], |[q, v]| q * v);
            rate.par_iter_mut()
                .zip(source)
                .with_min_len(4096)
                .for_each(|([r], q)| *r += q);
        }
        if let Some((carried, dt)) = &mut self.carried {
            carried.add(&self.matter, *dt, rate);
        }
        if let Some(constraint) = self.constraint {
            for (([r], c), v) in rate.iter_mut().zip(constraint).zip(self.volume) {
                if *c > 0.0 {
                    power -= *r * v;
                    *r = 0.0;
                }
            }
        }
        power
    }
}

/// Bound of the relative rounding error of a temperature that was computed from an enthalpy, and of what the two ends of a
/// bond add to it.
const ROUNDING: f64 = 4.0 * f64::EPSILON;

/// Norm of the rounding errors of rates, from the sums of the coefficients of points (W/(m³ K)) and their temperatures (K): a
/// rate is a small difference of products of these.
fn rounding(
    row_sums: &[[f64; 1]],
    weights: Option<&[f64]>,
    temperature: impl Fn(usize) -> f64 + Sync,
) -> f64 {
    let [squares] = sum_points(row_sums.len(), |i| {
        let weight = weights.map_or(1.0, |w| w[i]);
        [(weight * row_sums[i][0] * temperature(i)).powi(2)]
    });
    ROUNDING * squares.sqrt()
}

/// Enthalpies of all points, then the heat supplied; nonlinear in the enthalpy.
struct EnthalpyRate<'a>(Flow<'a>);

impl Rhs for EnthalpyRate<'_> {
    fn rate(&mut self, _: f64, state: &[f64], rate: &mut [f64]) -> Result<(), SolverError> {
        let flow = &mut self.0;
        let points = flow.volume.len();
        let mut temperature = std::mem::take(flow.temperature);
        temperature.resize(points, 0.0);
        let curves = flow.matter.curves;
        temperature
            .par_iter_mut()
            .zip(state)
            .zip(flow.matter.material)
            .with_min_len(4096)
            .for_each(|((t, h), &m)| *t = curves[m as usize].temperature(*h));
        rate[points] = flow.evaluate(&temperature);
        *flow.temperature = temperature;
        rate[..points].copy_from_slice(bytemuck::cast_slice(&flow.conduction.rate));
        Ok(())
    }

    fn rounding(&self, at: At<'_>) -> f64 {
        let Flow {
            matter, row_sums, ..
        } = &self.0;
        let curve = |i: usize| &matter.curves[matter.material[i] as usize];
        rounding(row_sums, None, |i| curve(i).temperature(at.state[i]))
    }

    fn tangent_diagonal(&mut self, at: At<'_>, out: &mut [f64]) -> Result<bool, SolverError> {
        let flow = &self.0;
        for (i, (out, h)) in out.iter_mut().zip(at.state).enumerate() {
            *out = match flow.row_sums.get(i) {
                Some([sum]) => {
                    let curve = &flow.matter.curves[flow.matter.material[i] as usize];
                    -sum / curve.capacity(curve.temperature(*h))
                }
                None => 0.0,
            };
        }
        Ok(true)
    }
}

/// Temperatures of all points; the steady state is where their rate vanishes.
struct TemperatureRate<'a> {
    flow: Flow<'a>,
    /// Where points have volumes of several sizes: those make the conduction symmetric.
    weights: Option<&'a [f64]>,
}

impl Rhs for TemperatureRate<'_> {
    fn rate(&mut self, _: f64, state: &[f64], rate: &mut [f64]) -> Result<(), SolverError> {
        self.flow.evaluate(state);
        rate.copy_from_slice(bytemuck::cast_slice(&self.flow.conduction.rate));
        Ok(())
    }

    fn rounding(&self, at: At<'_>) -> f64 {
        rounding(self.flow.row_sums, self.weights, |i| at.state[i])
    }

    fn tangent_diagonal(&mut self, _: At<'_>, out: &mut [f64]) -> Result<bool, SolverError> {
        out.iter_mut()
            .zip(self.flow.row_sums)
            .for_each(|(out, [sum])| *out = -sum);
        Ok(true)
    }

    fn weights(&self) -> Option<&[f64]> {
        self.weights
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
        newton.options.linear = flow.conduction.is_linear();
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
        let mut supplied = 0.0;
        let points = self.enthalpy.iter_mut().zip(&*self.temperature);
        for (((h, t), &m), v) in points.zip(matter.material).zip(volume) {
            let new = matter.curves[m as usize].enthalpy(*t);
            supplied += v * (new - *h);
            *h = new;
        }
        self.account.supply(supplied);
        Ok(report.into())
    }

    /// Advances the enthalpies together with the heat supplied by `take`, a step of a solver.
    fn advance_enthalpy(
        self,
        flow: Flow<'_>,
        state: &mut Vec<f64>,
        take: impl FnOnce(&mut EnthalpyRate<'_>, &mut Vec<f64>) -> Result<Work, SolverError>,
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

impl Run {
    /// Advances temperature and enthalpy over `step`.
    pub(super) fn advance(&mut self, world: &World, step: Step) -> Result<Work, SolverError> {
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
        if let Some(consolidated) = self.consolidated {
            self.conduction.consolidate(&world.read(consolidated));
        }
        let rules = world.layer_rules(self.layers);
        let body = world.body(self.body);
        let source = self.heat_source.map(|s| world.read(s));
        let constraint = self.constraint.map(|c| world.read(c));
        let growth = self.growth.as_ref();
        let masked = |values: &'_ [f64]| growth.map(|g| g.masked(values).into_owned());
        let source_there = source.as_deref().and_then(masked);
        let constraint_there = constraint.as_deref().and_then(masked);
        let family = self.neighbours.now(world);
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
            let (conduction, temperature) = (&self.conduction, &temperature[..]);
            let conductivity = |i: usize| {
                let (m, t) = (matter.material[i], temperature[i]);
                let liquid = matter.curves[m as usize].liquid_fraction(t);
                conduction.conductivity((i, m), t, liquid)
            };
            carried.start(body, (&matter, &state), conductivity);
        }
        let current = configuration.as_ref().zip(ratios.as_ref());
        let current = current.map(|(now, ratio)| CurrentVolumes {
            volume: now.volumes(),
            ratio,
        });
        let Integrator {
            method,
            stable_step,
            row_sums,
            state,
            temperature: work,
        } = &mut self.integrator;
        // a plate takes up its heat where the window does not cover it
        let uncovered = self.refined.as_ref().and_then(Refined::uncovered);
        let flow = Flow {
            conduction: &mut self.conduction,
            matter,
            volume: uncovered.as_deref().unwrap_or(&body.points.volume),
            is_weighted: body.lattice().is_none() || current.is_some(),
            current,
            source: source_there.as_deref().or(source.as_deref()),
            carried: self.carried.as_mut().map(|c| (c, step.size)),
            constraint: constraint_there.as_deref().or(constraint.as_deref()),
            row_sums,
            temperature: work,
        };
        let fields = Fields {
            temperature: &mut world.write(self.temperature),
            enthalpy: &mut world.write(self.enthalpy),
            account: &mut self.heat,
        };
        let (start, size) = (step.start, step.size);
        match method {
            Method::Explicit => {
                // deposited points may have shortened the stable step since this one was chosen
                let steps = match growth {
                    Some(_) => (size / *stable_step * (1.0 - 1e-9)).ceil().max(1.0) as usize,
                    None => 1,
                };
                let refined = self.refined.as_mut().map(|r| (r, world));
                Ok(fields.advance_explicitly(flow, (size, steps), refined))
            }
            Method::Steady(newton, tolerance) => {
                let at = (step.end(), self.floating);
                fields.find_steady_state((newton, *tolerance), flow, at)
            }
            Method::Rkl2(rkl2) => {
                let stages = Rkl2::stages(size, *stable_step)?;
                fields.advance_enthalpy(flow, state, |rate, state| {
                    rkl2.step(rate, start, size, stages, state)?;
                    Ok(Work::of_stages(stages))
                })
            }
            Method::Implicit(implicit) => fields.advance_enthalpy(flow, state, |rate, state| {
                Ok(implicit.step(rate, start, size, state)?.into())
            }),
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
