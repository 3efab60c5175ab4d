//! The rates that the solvers of the heat equation integrate or bring to zero.
//!
//! All solvers but forward Euler and the steady one advance the enthalpies together with one
//! more component: the heat supplied so far (J), whose rate is the power of sources and
//! boundaries. The scheme that integrates the state thereby integrates its account, and the
//! balance holds to rounding.

use perimelt_core::material::EnthalpyCurve;
use perimelt_core::solver::reduce::{norm, sum_of, sum_points};
use perimelt_core::solver::{At, Rhs, SolverError};
use rayon::prelude::*;

use super::below::Below;
use super::carried::CarriedHeat;
use super::conduction::{Conduction, Matter};
use super::surface::Surface;

/// Work vectors of the enthalpy equation.
#[derive(Debug, Default)]
pub(super) struct Vectors {
    temperature: Vec<f64>,
    base: Base,
}

impl Vectors {
    /// Forgets where the flow was linearised: sources and conductivities have changed.
    pub(super) fn start_step(&mut self) {
        self.base.state.clear();
    }
}

/// Where the flow was linearised last.
#[derive(Debug, Default)]
struct Base {
    state: Vec<f64>,
    temperature: Vec<f64>,
    /// J/(m³ K), infinite while a pure substance melts.
    capacity: Vec<f64>,
    /// Flow and power, where these have no derivative; else empty.
    rate: Vec<f64>,
    /// Of the temperature; after it temperatures beside those of the base.
    change: Vec<f64>,
    /// Derivatives of the heat through the surface, W/(m³ K), by face.
    gains: Vec<f64>,
}

/// What the flow of heat depends on during a step.
pub(super) struct Flow<'a> {
    pub(super) conduction: &'a mut Conduction,
    pub(super) matter: Matter<'a>,
    /// Reference volumes, to which enthalpies and sources refer, m³.
    pub(super) volume: &'a [f64],
    /// Whether the volumes make the conduction symmetric: where they differ, or points move.
    pub(super) is_weighted: bool,
    /// Where points move.
    pub(super) current: Option<CurrentVolumes<'a>>,
    pub(super) source: Option<&'a [f64]>,
    /// What the surface exchanges with its surroundings.
    pub(super) surface: Option<&'a mut Surface>,
    /// In the search for a steady state, where other bodies draw points to their temperatures.
    pub(super) drawn: Option<Drawn<'a>>,
    /// Heat that an Eulerian fluid carries, and the step, s.
    pub(super) carried: Option<(&'a mut CarriedHeat, f64)>,
    /// Positive where the temperature is held.
    pub(super) constraint: Option<&'a [f64]>,
    pub(super) row_sums: &'a [[f64; 1]],
    pub(super) vectors: &'a mut Vectors,
}

/// What other bodies draw a body by: the sources of heat are those at these temperatures.
pub(super) struct Drawn<'a> {
    /// W/(m³ K).
    pub(super) conductance: &'a [f64],
    /// K.
    pub(super) temperature: Vec<f64>,
}

/// Volumes of points that move.
pub(super) struct CurrentVolumes<'a> {
    /// m³.
    pub(super) volume: &'a [f64],
    /// Over the reference volume.
    pub(super) ratio: &'a [f64],
}

impl Flow<'_> {
    /// What the curve of each point gives at its enthalpy (J/m³).
    fn by_point(
        &self,
        enthalpy: &[f64],
        out: &mut Vec<f64>,
        of: impl Fn(&EnthalpyCurve, f64) -> f64 + Sync,
    ) {
        let Matter {
            curves, material, ..
        } = self.matter;
        out.resize(self.volume.len(), 0.0);
        let points = out.par_iter_mut().zip(enthalpy).zip(material);
        let points = points.with_min_len(4096);
        points.for_each(|((out, h), &m)| *out = of(&curves[m as usize], *h));
    }

    /// Leaves `flow + source` in `conduction.rate`, zero at held points; returns the power
    /// that comes in through sources and boundaries, W.
    pub(super) fn evaluate(&mut self, temperature: &[f64]) -> f64 {
        self.conduction.load(&self.matter, temperature);
        self.exchange(temperature);
        self.sum(Through::Temperature(temperature))
    }

    /// Evaluates the exchange of the surface.
    fn exchange(&mut self, temperature: &[f64]) {
        let (conduction, matter) = (&*self.conduction, self.matter);
        if let Some(surface) = &mut self.surface {
            surface.evaluate(&Below {
                conduction,
                curves: matter.curves,
                material: matter.material,
                temperature,
            });
        }
    }

    /// Leaves the derivative of the flow along a change of the temperature (K) in `conduction.rate`, zero at held points;
    /// returns that of the power. `None`, without an effect, where no derivative is known.
    fn change(&mut self, temperature: &[f64], change: &[f64], gains: &[f64]) -> Option<f64> {
        let is_known = self.carried.is_none()
            && (self.conduction).load_change(&self.matter, (temperature, change));
        is_known.then(|| self.sum(Through::Change { gains, change }))
    }

    /// The flow from what was loaded, and what comes in otherwise.
    fn sum(&mut self, through: Through<'_>) -> f64 {
        self.conduction.flow(&self.matter);
        let volume = self.current.as_ref().map_or(self.volume, |c| c.volume);
        let mut power = self.conduction.inflow(self.matter.family, volume);
        let rate = &mut self.conduction.rate;
        if let Some(CurrentVolumes { ratio, .. }) = self.current {
            let points = rate.par_iter_mut().zip(ratio).with_min_len(4096);
            points.for_each(|([r], ratio)| *r *= ratio);
        }
        power += match (&self.surface, &through) {
            (None, _) => 0.0,
            (Some(surface), Through::Temperature(_)) => surface.add(rate, self.volume),
            (Some(surface), Through::Change { gains, change }) => {
                surface.add_change(gains, change, (rate, self.volume))
            }
        };
        if let (Some(drawn), Through::Temperature(now)) = (&self.drawn, &through) {
            let points = drawn.conductance.iter().zip(&drawn.temperature).zip(*now);
            for ([r], ((conductance, then), now)) in rate.iter_mut().zip(points) {
                *r += conductance * (then - now);
            }
        }
        let is_change = matches!(through, Through::Change { .. });
        if let Some(source) = self.source.filter(|_| !is_change) {
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

/// What is summed.
enum Through<'a> {
    /// The heat at the temperatures that were loaded (K), with all sources.
    Temperature(&'a [f64]),
    /// The change of the heat with temperatures that change (K), and the derivatives of the heat through the surface.
    Change { gains: &'a [f64], change: &'a [f64] },
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
pub(super) struct EnthalpyRate<'a>(pub(super) Flow<'a>);

impl Rhs for EnthalpyRate<'_> {
    fn rate(&mut self, _: f64, state: &[f64], rate: &mut [f64]) -> Result<(), SolverError> {
        let flow = &mut self.0;
        let points = flow.volume.len();
        let mut temperature = std::mem::take(&mut flow.vectors.temperature);
        flow.by_point(state, &mut temperature, EnthalpyCurve::temperature);
        rate[points] = flow.evaluate(&temperature);
        flow.vectors.temperature = temperature;
        rate[..points].copy_from_slice(bytemuck::cast_slice(&flow.conduction.rate));
        Ok(())
    }

    /// Temperatures, which also tell how much has melted where that happens at one temperature.
    fn unknowns(&self, state: &[f64], unknowns: &mut [f64]) {
        let Matter {
            curves, material, ..
        } = self.0.matter;
        unknowns.copy_from_slice(state);
        let points = unknowns.par_iter_mut().zip(material).with_min_len(4096);
        points.for_each(|(h, &m)| *h = curves[m as usize].combined(*h));
    }

    fn state(&self, unknowns: &[f64], state: &mut [f64], slope: &mut [f64]) {
        let Matter {
            curves, material, ..
        } = self.0.matter;
        state.copy_from_slice(unknowns);
        slope.fill(1.0);
        let points = state.par_iter_mut().zip(slope).zip(material);
        points.with_min_len(4096).for_each(|((h, slope), &m)| {
            (*h, *slope) = curves[m as usize].from_combined(*h);
        });
    }

    fn rounding(&self, at: At<'_>) -> f64 {
        let Flow {
            matter, row_sums, ..
        } = &self.0;
        let curve = |i: usize| &matter.curves[matter.material[i] as usize];
        rounding(row_sums, None, |i| curve(i).temperature(at.state[i]))
    }

    /// Exact where the flow has a derivative, a difference by the temperature elsewhere, in which the flow has no kinks but
    /// those of tables of the conductivity.
    fn tangent(
        &mut self,
        at: At<'_>,
        direction: &[f64],
        out: &mut [f64],
    ) -> Result<bool, SolverError> {
        let mut base = self.linearise(at);
        let points = base.temperature.len();
        base.change.resize(points, 0.0);
        let change = base.change.par_iter_mut().zip(direction);
        let change = change.zip(&base.capacity).with_min_len(4096);
        change.for_each(|((change, v), capacity)| *change = v / capacity);
        if let Some(power) = (self.0).change(&base.temperature, &base.change, &base.gains) {
            out[points] = power;
            out[..points].copy_from_slice(bytemuck::cast_slice(&self.0.conduction.rate));
        } else if base.change.iter().all(|change| *change == 0.0) {
            out.fill(0.0);
        } else {
            if base.rate.is_empty() {
                base.rate.resize(at.state.len(), 0.0);
                self.rate(at.time, at.state, &mut base.rate)?;
            }
            let flow = &mut self.0;
            let e = f64::EPSILON.sqrt() * norm(&base.temperature) / norm(&base.change);
            let moved = base.change.par_iter_mut().zip(&base.temperature);
            let moved = moved.with_min_len(4096);
            moved.for_each(|(change, t)| *change = t + e * *change);
            out[points] = (flow.evaluate(&base.change) - base.rate[points]) / e;
            let rates = flow.conduction.rate.par_iter().zip(&base.rate);
            let rates = out.par_iter_mut().zip(rates).with_min_len(4096);
            rates.for_each(|(out, ([rate], base))| *out = (rate - base) / e);
        }
        self.0.vectors.base = base;
        Ok(true)
    }

    fn tangent_diagonal(&mut self, at: At<'_>, out: &mut [f64]) -> Result<bool, SolverError> {
        let flow = &self.0;
        for (i, (out, h)) in out.iter_mut().zip(at.state).enumerate() {
            *out = match flow.row_sums.get(i) {
                Some([sum]) => {
                    let curve = &flow.matter.curves[flow.matter.material[i] as usize];
                    -sum / curve.capacity_from_enthalpy(*h)
                }
                None => 0.0,
            };
        }
        if let Some(surface) = &flow.surface {
            let matter = &flow.matter;
            surface.add_diagonal(out, |i| {
                matter.curves[matter.material[i] as usize].capacity_from_enthalpy(at.state[i])
            });
        }
        Ok(true)
    }
}

impl EnthalpyRate<'_> {
    /// Takes the base out of the work vectors, at this state.
    fn linearise(&mut self, at: At<'_>) -> Base {
        let flow = &mut self.0;
        let mut base = std::mem::take(&mut flow.vectors.base);
        if base.state != at.state {
            base.state.clear();
            base.state.extend_from_slice(at.state);
            base.rate.clear();
            flow.by_point(at.state, &mut base.temperature, EnthalpyCurve::temperature);
            let capacity = EnthalpyCurve::capacity_from_enthalpy;
            flow.by_point(at.state, &mut base.capacity, capacity);
            flow.exchange(&base.temperature);
            if let Some(surface) = &flow.surface {
                surface.gains(&mut base.gains);
            }
        }
        base
    }
}

/// Temperatures of all points; the steady state is where their rate vanishes.
pub(super) struct TemperatureRate<'a> {
    pub(super) flow: Flow<'a>,
    /// Where points have volumes of several sizes: those make the conduction symmetric.
    pub(super) weights: Option<&'a [f64]>,
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
        if let Some(surface) = &self.flow.surface {
            surface.add_diagonal(out, |_| 1.0);
        }
        if let Some(drawn) = &self.flow.drawn {
            let points = out.iter_mut().zip(drawn.conductance);
            points.for_each(|(out, conductance)| *out -= conductance);
        }
        Ok(true)
    }

    fn weights(&self) -> Option<&[f64]> {
        self.weights
    }
}
