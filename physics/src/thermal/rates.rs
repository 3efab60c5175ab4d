//! The rates that the solvers of the heat equation integrate or bring to zero.
//!
//! All solvers but forward Euler and the steady one advance the enthalpies together with
//! more components: the heat supplied so far (J), whose rate is the power of sources and
//! boundaries, and what of it other bodies gave through each part of the surface. The scheme that integrates the state thereby
//! integrates its account, and the balance holds to rounding.

use perimelt_core::body::Sizes;
use perimelt_core::material::EnthalpyCurve;
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::solver::reduce::are_equal;
use perimelt_core::solver::{At, Reducer, Rhs, SolverError};
use rayon::prelude::*;

use super::carried::CarriedHeat;
use super::conduction::{Conduction, Matter};
use super::points::ConductingPoints;
use super::surface::Surface;
use crate::heat_content::Mixture;

/// Work vectors of the enthalpy equation.
#[derive(Debug, Default)]
pub(super) struct Vectors {
    temperature: Vec<f64>,
    base: Linearisation,
}

impl Vectors {
    /// Discards the linearisation: sources and conductivities have changed.
    pub(super) fn start_step(&mut self) {
        self.base.state.clear();
    }
}

/// State at which the flow was linearised, and work vectors of its derivative.
#[derive(Debug, Default)]
struct Linearisation {
    state: Vec<f64>,
    temperature: Vec<f64>,
    /// J/(m³ K), infinite while a pure substance melts.
    capacity: Vec<f64>,
    /// Flow and power where no analytical derivative exists; empty otherwise.
    rate: Vec<f64>,
    /// Change of the temperature along the direction (K), then the perturbed temperatures.
    change: Vec<f64>,
    /// Derivatives of the heat through the surface, W/(m³ K), by face.
    gains: Vec<f64>,
}

/// The heat flow of a body during a step.
pub(super) struct HeatFlow<'a> {
    pub(super) conduction: &'a mut Conduction,
    pub(super) matter: Matter<'a>,
    /// Reference volumes, to which enthalpies and sources refer, m³.
    pub(super) volume: &'a Sizes,
    /// Whether the volumes are weights that make conduction symmetric, because they differ or points move.
    pub(super) is_weighted: bool,
    /// Current volumes, where points move.
    pub(super) current: Option<CurrentVolumes<'a>>,
    pub(super) source: Option<&'a [f64]>,
    /// Exchange of the surface with its surroundings.
    pub(super) surface: Option<&'a mut Surface>,
    /// Exchange with other bodies, in the search for a steady state.
    pub(super) exchanged: Option<BodyExchange<'a>>,
    /// Convection by an Eulerian fluid with sound, and the step, s.
    pub(super) carried: Option<(&'a mut CarriedHeat, f64)>,
    /// Two fluids, where there are two.
    pub(super) mixture: Option<Mixture<'a>>,
    /// Positive where the temperature is held.
    pub(super) constraint: Option<&'a [f64]>,
    pub(super) row_sums: &'a [[f64; 1]],
    pub(super) vectors: &'a mut Vectors,
}

/// Heat exchange with other bodies, linearised about the temperatures for which the heat sources were given.
pub(super) struct BodyExchange<'a> {
    /// W/(m³ K).
    pub(super) conductance: &'a [f64],
    /// Temperatures of the points, K.
    pub(super) temperature: Vec<f64>,
}

/// Volumes of points that move.
pub(super) struct CurrentVolumes<'a> {
    /// m³.
    pub(super) volume: &'a [f64],
    /// Current volume over reference volume.
    pub(super) ratio: &'a [f64],
}

impl HeatFlow<'_> {
    /// Evaluates `of` for the curve of each point at its enthalpy (J/m³).
    fn by_point(
        &self,
        enthalpy: &[f64],
        out: &mut Vec<f64>,
        of: impl Fn(&EnthalpyCurve, f64) -> f64 + Sync,
    ) {
        let Matter {
            curves, material, ..
        } = self.matter;
        out.resize(self.volume.count(), 0.0);
        let points = out.par_iter_mut().zip(enthalpy).zip(material);
        let points = points.with_min_len(4096);
        points.for_all(|((out, h), &m)| *out = of(&curves[m as usize], *h));
    }

    /// Writes `flow + source` to `conduction.rate`, zero at held points; returns the power of sources and boundaries, W.
    pub(super) fn evaluate(&mut self, temperature: &[f64]) -> f64 {
        self.conduction.load(&self.matter, temperature);
        self.exchange(temperature);
        self.sum(HeatSum::Temperature(temperature))
    }

    /// Evaluates the exchange of the surface.
    fn exchange(&mut self, temperature: &[f64]) {
        let (conduction, matter) = (&*self.conduction, self.matter);
        if let Some(surface) = &mut self.surface {
            surface.evaluate(&ConductingPoints {
                conduction,
                curves: matter.curves,
                material: matter.material,
                temperature,
            });
        }
    }

    /// Writes the derivative of the flow where it was linearised along a change of the temperature (K) to `conduction.rate`, zero at held points;
    /// returns the derivative of the power. `None`, without an effect, where no analytical derivative exists.
    fn change(&mut self, change: &[f64], gains: &[f64]) -> Option<f64> {
        let is_known =
            self.carried.is_none() && (self.conduction).load_change(&self.matter, change);
        is_known.then(|| self.sum(HeatSum::Change { gains, change }))
    }

    /// Sums the flow from what was loaded and the other contributions; returns the power, W.
    fn sum(&mut self, through: HeatSum<'_>) -> f64 {
        self.conduction.flow(&self.matter);
        let volume = |point: usize| match &self.current {
            Some(current) => current.volume[point],
            None => self.volume[point],
        };
        let mut power = self.conduction.inflow(self.matter.family, volume);
        let owned = self.matter.points.owned();
        let rate = &mut self.conduction.rate;
        if let Some(CurrentVolumes { ratio, .. }) = self.current {
            let points = rate.par_iter_mut().zip(ratio).with_min_len(4096);
            points.for_all(|([r], ratio)| *r *= ratio);
        }
        match (&self.surface, &through) {
            (None, _) => {}
            (Some(surface), HeatSum::Temperature(_)) => {
                surface.add(rate, self.volume, owned, &mut power);
            }
            (Some(surface), HeatSum::Change { gains, change }) => {
                surface.add_change([gains, change], rate, self.volume, owned, &mut power);
            }
        }
        if let (Some(exchanged), HeatSum::Temperature(now)) = (&self.exchanged, &through) {
            let points = exchanged
                .conductance
                .iter()
                .zip(&exchanged.temperature)
                .zip(*now);
            for ([r], ((conductance, then), now)) in rate.iter_mut().zip(points) {
                *r += conductance * (then - now);
            }
        }
        let is_change = matches!(through, HeatSum::Change { .. });
        if let Some(source) = self.source.filter(|_| !is_change) {
            power.merge(&(self.matter.points).own_sum_over(source, self.volume, |q, v| q * v));
            rate.par_iter_mut()
                .zip(source)
                .with_min_len(4096)
                .for_all(|([r], q)| *r += q);
        }
        if let Some((carried, dt)) = &mut self.carried {
            carried.add(&self.matter, *dt, rate);
        }
        if let Some(constraint) = self.constraint {
            let points = rate.iter_mut().zip(constraint).zip(self.volume.each());
            for (point, (([r], c), v)) in points.enumerate() {
                if *c > 0.0 {
                    if point < owned {
                        power.add(-*r * v);
                    }
                    *r = 0.0;
                }
            }
        }
        self.matter.points.total(power)
    }
}

/// Contributions to a sum of heat.
enum HeatSum<'a> {
    /// Heat at the temperatures that were loaded (K), with all sources.
    Temperature(&'a [f64]),
    /// Derivative of the heat along a change of the temperatures (K), with the derivatives of the heat through the surface.
    Change { gains: &'a [f64], change: &'a [f64] },
}

/// Bound of the relative rounding error of a temperature computed from an enthalpy and of the difference of two ends of a
/// bond.
const ROUNDING: f64 = 4.0 * f64::EPSILON;

/// Norm of the rounding errors of rates, from the sums of the coefficients of points (W/(m³ K)) and their temperatures (K): a
/// rate is a small difference of products of these.
fn rounding(
    points: &Reducer,
    row_sums: &[[f64; 1]],
    weights: Option<&[f64]>,
    temperature: impl Fn(usize) -> f64 + Sync,
) -> f64 {
    // known once the stable step was found
    if row_sums.is_empty() {
        return 0.0;
    }
    let [squares] = points.sum_points(|i| {
        let weight = weights.map_or(1.0, |w| w[i]);
        [(weight * row_sums[i][0] * temperature(i)).powi(2)]
    });
    ROUNDING * squares.sqrt()
}

/// Enthalpies of all points, then the heat supplied, then that given by other bodies; nonlinear in the enthalpy.
pub(super) struct EnthalpyRate<'a>(pub(super) HeatFlow<'a>);

impl Rhs for EnthalpyRate<'_> {
    fn rate(&mut self, _: f64, state: &[f64], rate: &mut [f64]) -> Result<(), SolverError> {
        let flow = &mut self.0;
        let points = flow.volume.count();
        let mut temperature = std::mem::take(&mut flow.vectors.temperature);
        flow.by_point(state, &mut temperature, EnthalpyCurve::temperature);
        rate[points] = flow.evaluate(&temperature);
        flow.vectors.temperature = temperature;
        if let Some(surface) = &flow.surface {
            surface.given_powers(flow.volume, &mut rate[points + 1..]);
        }
        rate[..points].copy_from_slice(bytemuck::cast_slice(&flow.conduction.rate));
        Ok(())
    }

    fn points(&self) -> Reducer {
        self.0.matter.points.clone()
    }

    /// Temperatures, extended by the molten fraction of materials that melt at one temperature.
    fn unknowns(&self, state: &[f64], unknowns: &mut [f64]) {
        let Matter {
            curves, material, ..
        } = self.0.matter;
        unknowns.copy_from_slice(state);
        let points = unknowns.par_iter_mut().zip(material).with_min_len(4096);
        points.for_all(|(h, &m)| *h = curves[m as usize].combined(*h));
    }

    fn state(&self, unknowns: &[f64], state: &mut [f64], slope: &mut [f64]) {
        let Matter {
            curves, material, ..
        } = self.0.matter;
        state.copy_from_slice(unknowns);
        slope.fill(1.0);
        let points = state.par_iter_mut().zip(slope).zip(material);
        points.with_min_len(4096).for_all(|((h, slope), &m)| {
            (*h, *slope) = curves[m as usize].from_combined(*h);
        });
    }

    fn rounding(&self, at: At<'_>) -> f64 {
        let HeatFlow {
            matter, row_sums, ..
        } = &self.0;
        let curve = |i: usize| &matter.curves[matter.material[i] as usize];
        rounding(matter.points, row_sums, None, |i| {
            curve(i).temperature(at.state[i])
        })
    }

    /// Exact where the flow has an analytical derivative; a finite difference by the temperature elsewhere, as a function of
    /// which the flow has kinks only at the rows of conductivity tables.
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
        change.for_all(|((change, v), capacity)| *change = v / capacity);
        if let Some(power) = (self.0).change(&base.change, &base.gains) {
            out[points] = power;
            if let Some(surface) = &self.0.surface {
                let powers = &mut out[points + 1..];
                surface.given_changes(&base.gains, &base.change, self.0.volume, powers);
            }
            out[..points].copy_from_slice(bytemuck::cast_slice(&self.0.conduction.rate));
        } else if !(self.points()).any(base.change.iter().any(|change| *change != 0.0)) {
            out.fill(0.0);
        } else {
            if base.rate.is_empty() {
                base.rate.resize(at.state.len(), 0.0);
                self.rate(at.time, at.state, &mut base.rate)?;
            }
            let flow = &mut self.0;
            let reducer = flow.matter.points;
            let size = reducer.norm(&base.temperature);
            let e = f64::EPSILON.sqrt() * size / reducer.norm(&base.change);
            let moved = base.change.par_iter_mut().zip(&base.temperature);
            let moved = moved.with_min_len(4096);
            moved.for_all(|(change, t)| *change = t + e * *change);
            out[points] = (flow.evaluate(&base.change) - base.rate[points]) / e;
            if let Some(surface) = &flow.surface {
                let powers = &mut out[points + 1..];
                surface.given_powers(flow.volume, powers);
                let powers = powers.iter_mut().zip(&base.rate[points + 1..]);
                powers.for_each(|(power, base)| *power = (*power - base) / e);
            }
            let rates = flow.conduction.rate.par_iter().zip(&base.rate);
            let rates = out.par_iter_mut().zip(rates).with_min_len(4096);
            rates.for_all(|(out, ([rate], base))| *out = (rate - base) / e);
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
    /// Moves the linearisation at this state out of the work vectors.
    fn linearise(&mut self, at: At<'_>) -> Linearisation {
        let flow = &mut self.0;
        let mut base = std::mem::take(&mut flow.vectors.base);
        if (flow.matter.points).any(!are_equal(&base.state, at.state)) {
            base.state.clear();
            base.state.extend_from_slice(at.state);
            base.rate.clear();
            flow.by_point(at.state, &mut base.temperature, EnthalpyCurve::temperature);
            let capacity = EnthalpyCurve::capacity_from_enthalpy;
            flow.by_point(at.state, &mut base.capacity, capacity);
            flow.conduction.linearise(&flow.matter, &base.temperature);
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
    pub(super) flow: HeatFlow<'a>,
    /// Volumes, where they differ or points move: these weights make conduction symmetric.
    pub(super) weights: Option<&'a [f64]>,
}

impl Rhs for TemperatureRate<'_> {
    fn rate(&mut self, _: f64, state: &[f64], rate: &mut [f64]) -> Result<(), SolverError> {
        self.flow.evaluate(state);
        rate.copy_from_slice(bytemuck::cast_slice(&self.flow.conduction.rate));
        Ok(())
    }

    fn rounding(&self, at: At<'_>) -> f64 {
        let HeatFlow {
            matter, row_sums, ..
        } = &self.flow;
        rounding(matter.points, row_sums, self.weights, |i| at.state[i])
    }

    fn tangent_diagonal(&mut self, _: At<'_>, out: &mut [f64]) -> Result<bool, SolverError> {
        out.iter_mut()
            .zip(self.flow.row_sums)
            .for_each(|(out, [sum])| *out = -sum);
        if let Some(surface) = &self.flow.surface {
            surface.add_diagonal(out, |_| 1.0);
        }
        if let Some(exchanged) = &self.flow.exchanged {
            let points = out.iter_mut().zip(exchanged.conductance);
            points.for_each(|(out, conductance)| *out -= conductance);
        }
        Ok(true)
    }

    fn weights(&self) -> Option<&[f64]> {
        self.weights
    }

    fn points(&self) -> Reducer {
        self.flow.matter.points.clone()
    }
}
