//! Steps whose sizes keep the error in time below a tolerance, within one step of the schedule.
//!
//! A step whose estimated error is `e` tolerances is taken where `e <= 1`, and repeated with a shorter one elsewhere; the next
//! one is `0.9 e^(-1 / (p + 1))` times as long, for a method of order `p`. Steps up to the stable one of forward Euler are
//! always taken.
//!
//! Errors are counted as temperatures, so that an error of the enthalpy of a point that melts counts little, and relative to
//! the difference of temperature that the body has had so far, or to its highest temperature where that is lower.

use perimelt_core::solver::{Implicit, Rkl2, SolverError};
use perimelt_core::{Step, Work};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::rates::{EnthalpyRate, HeatFlow};

/// Safety factor of the step with an error of one tolerance.
const SAFETY: f64 = 0.9;

/// Least and largest ratio of a step to the one before it.
const RATIOS: [f64; 2] = [0.1, 5.0];

/// Least difference of temperature over the highest temperature by which errors are scaled; below it they are rounding.
const LEAST_DIFFERENCE: f64 = 1e-6;

/// A step, and the stable step of forward Euler.
#[derive(Clone, Copy)]
pub(super) struct LimitedStep {
    pub(super) step: Step,
    /// Stable step of forward Euler, s.
    pub(super) stable: f64,
}

/// A method of one step that estimates its error.
#[derive(Debug)]
pub(super) enum Method {
    Rkl2(Rkl2),
    Euler(Implicit),
    CrankNicolson(Implicit),
}

impl Method {
    fn order(&self) -> f64 {
        match self {
            Method::Euler(_) => 1.0,
            Method::Rkl2(_) | Method::CrankNicolson(_) => 2.0,
        }
    }

    /// Advances `state` over a step and estimates its error.
    fn step(
        &mut self,
        rate: &mut EnthalpyRate<'_>,
        step: LimitedStep,
        vectors: &mut [Vec<f64>; 2],
        state: &mut [f64],
    ) -> Result<Work, SolverError> {
        let LimitedStep { step, stable } = step;
        let (start, size) = (step.start, step.size);
        let [before, error] = vectors;
        match self {
            Method::Rkl2(method) => {
                let stages = Rkl2::stages(size, stable)?;
                method.step(rate, start, size, stages, state)?;
                method.error(rate, start, size, [before, state], error)?;
                Ok(Work::of_stages(stages + 1))
            }
            Method::Euler(method) | Method::CrankNicolson(method) => {
                let mut report = method.step(rate, start, size, state)?;
                method.error(rate, start, size, [before, state], error)?;
                report.evaluations += 1;
                Ok(report.into())
            }
        }
    }
}

/// State of the step control, saved with checkpoints.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct StepControl {
    /// Size to be tried next, s.
    next: Option<f64>,
    /// Lowest and highest temperature so far, K.
    extremes: Option<[f64; 2]>,
}

impl StepControl {
    /// Size to be tried next (s), at first the stable one of forward Euler.
    pub(super) fn next(&self, stable: f64) -> f64 {
        self.next.unwrap_or(stable)
    }
}

/// Extreme temperatures and the largest error of a state.
#[derive(Clone, Copy)]
struct Measure {
    lowest: f64,
    highest: f64,
    /// Largest error, K.
    error: f64,
}

/// Steps of a method with their control and work vectors.
#[derive(Debug)]
pub(super) struct ControlledSteps {
    tolerance: f64,
    pub(super) control: StepControl,
    /// The state before a step, and the error of the step.
    vectors: [Vec<f64>; 2],
}

impl ControlledSteps {
    /// Steps with this tolerance of the error, relative to the difference of temperature.
    pub(super) fn new(tolerance: f64) -> Self {
        ControlledSteps {
            tolerance,
            control: StepControl::default(),
            vectors: Default::default(),
        }
    }

    /// Advances `state`, enthalpies and the heat supplied, over a step. Points for which `counts` is false have no state.
    pub(super) fn cover(
        &mut self,
        method: &mut Method,
        rate: &mut EnthalpyRate<'_>,
        whole: LimitedStep,
        state: &mut [f64],
        counts: impl Fn(usize) -> bool + Sync,
    ) -> Result<Work, SolverError> {
        let LimitedStep { step, stable } = whole;
        let (start, size) = (step.start, step.size);
        let exponent = -1.0 / (method.order() + 1.0);
        for vector in &mut self.vectors {
            vector.resize(state.len(), 0.0);
        }
        if self.control.extremes.is_none() {
            let now = measure(&rate.0, state, &self.vectors[1], &counts);
            self.control.extremes = Some([now.lowest, now.highest]);
        }
        let mut work = Work::default();
        let mut done = 0.0;
        while done < size {
            let left = size - done;
            let wanted = self.control.next(stable);
            let pieces = (left / wanted * (1.0 - 1e-9)).ceil().max(1.0);
            // two nearly equal steps rather than a long one and a short one
            let step = match pieces {
                1.0 => left,
                2.0 => 0.5 * left,
                _ => wanted,
            };
            self.vectors[0].copy_from_slice(state);
            let at = LimitedStep {
                step: Step::new(start + done, step),
                stable,
            };
            let is_short = step <= stable * (1.0 + 1e-9);
            match method.step(rate, at, &mut self.vectors, state) {
                Ok(taken) => work = work + taken,
                Err(SolverError::NotConverged { .. }) if !is_short => {
                    state.copy_from_slice(&self.vectors[0]);
                    self.control.next = Some((0.5 * step).max(stable));
                    continue;
                }
                Err(e) => return Err(e),
            }
            let now = measure(&rate.0, state, &self.vectors[1], &counts);
            let [lowest, highest] = self.control.extremes.unwrap_or_default();
            let extremes = [lowest.min(now.lowest), highest.max(now.highest)];
            let difference = (extremes[1] - extremes[0]).min(now.highest);
            let scale = difference.max(LEAST_DIFFERENCE * now.highest.abs());
            let error = now.error / (self.tolerance * scale);
            let [least, most] = RATIOS;
            // `error` is 0 / 0 without an error and a scale
            let ratio = (SAFETY * error.powf(exponent)).min(most).max(least);
            if error > 1.0 && !is_short {
                state.copy_from_slice(&self.vectors[0]);
                self.control.next = Some((ratio * step).max(stable));
                continue;
            }
            let next = (ratio * step).max(stable);
            // the error of a shortened step gives no reason to shorten the next one
            self.control.next = Some(if step < wanted {
                next.max(wanted)
            } else {
                next
            });
            self.control.extremes = Some(extremes);
            done = if step == left { size } else { done + step };
        }
        Ok(work)
    }
}

/// Temperatures of the points that count, and their errors from errors of the enthalpy.
fn measure(
    flow: &HeatFlow<'_>,
    enthalpy: &[f64],
    error: &[f64],
    counts: &(impl Fn(usize) -> bool + Sync),
) -> Measure {
    let none = Measure {
        lowest: f64::INFINITY,
        highest: f64::NEG_INFINITY,
        error: 0.0,
    };
    let join = |a: Measure, b: Measure| Measure {
        lowest: a.lowest.min(b.lowest),
        highest: a.highest.max(b.highest),
        error: a.error.max(b.error),
    };
    let (matter, reducer) = (&flow.matter, flow.matter.points);
    let own = &matter.material[..reducer.owned()];
    let points = own.par_iter().enumerate().with_min_len(4096);
    let of_point = |(point, &m): (usize, &u16)| {
        if !counts(point) {
            return none;
        }
        let (curve, h, e) = (&matter.curves[m as usize], enthalpy[point], error[point]);
        let [below, at, above] = [h - e, h, h + e].map(|h| curve.temperature(h));
        Measure {
            lowest: at,
            highest: at,
            error: 0.5 * (above - below).abs(),
        }
    };
    let own = points.map(of_point).reduce(|| none, join);
    Measure {
        lowest: reducer.min(own.lowest),
        highest: reducer.max(own.highest),
        error: reducer.max(own.error),
    }
}

#[cfg(test)]
mod tests {
    use perimelt_core::body::Store;

    use crate::testing::{block, read, run, set, simulation, values};
    use crate::thermal::Thermal;

    const SPOT: f64 = 2000.0;

    /// Temperatures at the end, and evaluations, of a sheet with a hot spot in one corner, in equal steps of the schedule.
    fn spot(keys: &str, material: &str, steps: u32) -> (Vec<f64>, u64) {
        const END: f64 = 0.2;
        let body = block([30, 30, 1], 2, 1e-4, Store::Lattice, material);
        let step = END / f64::from(steps);
        let thermal: Thermal = read(&format!("horizon = 1\nstep = {step}\n{keys}"));
        let mut s = simulation(body, vec![Box::new(thermal)], vec![], END);
        set(&mut s, "temperature", |[x, y, _]| {
            let is_hot = x < 5e-4 && y < 5e-4;
            [if is_hot { SPOT } else { 300.0 }]
        });
        run(&mut s);
        (values(&s, "temperature"), s.progress().evaluations[0])
    }

    /// Steep temperatures spread in one or several long steps as in the shortest ones of forward Euler: with and without melting.
    #[test]
    fn a_hot_spot_spreads_alike_in_steps_of_any_length() {
        let steel = "density = 7900\nspecific_heat = 600\nconductivity = 20";
        let melting = format!("{steel}\nsolidus = 1670\nliquidus = 1730\nlatent_heat = 270e3");
        for material in [steel, &melting] {
            // 200 of the longest explicit steps
            let (expected, explicit) = spot("", material, 1000);
            // errors of early steps fade as heat spreads: that of two steps is left at most
            let most = 2.0 * 1e-3 * (SPOT - 300.0);
            for solver in ["rkl2", "implicit", "crank_nicolson"] {
                for steps in [1, 3, 20] {
                    let (found, evaluations) =
                        spot(&format!("solver = '{solver}'"), material, steps);
                    let pairs = found.iter().zip(&expected);
                    let worst = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                    let what = format!("{solver} in {steps} steps");
                    assert!(worst < most, "{what}: {worst} K");
                    if solver == "rkl2" {
                        assert!(2 * evaluations < explicit, "{what}: {evaluations}");
                    }
                }
            }
        }
    }
}
