//! Thermal history of each point: highest temperature, time above a temperature, cooling time and solidification.
//!
//! The physics stands after the one that owns the temperature and reads it at the end of every macro step. Between two of
//! them the temperature is taken as linear in time, so that times of crossing have an error of second order in the step
//! (`time.step`, `time.stages`, and no step is longer than the log interval).
//!
//! - `cooling_time` is the time in which a point last cooled from the upper to the lower of two temperatures without
//!   reaching the upper one again: `t8/5` between 800 and 500 °C.
//! - At the last solidification of a point, when its temperature falls below `solidification`: `cooling_rate`
//!   dT/dt, `thermal_gradient` G, the magnitude of the gradient by a quadratic least-squares fit to the points within two
//!   spacings, at the time of crossing, and `solidification_speed` R = dT/dt / G of the front along its normal;
//!   `melting_time` and `solidification_time`, when the point rose above that temperature and fell below it.
//!   `solidifications` counts them: states that are logged between two of them have all (`perimelt export --format exaca`).
//!
//! All are zero where no such event has occurred, and at points whose material has not been deposited yet. The history of a
//! deposited point begins at the end of the step in which it is born.

use std::cmp::Ordering;

use nalgebra::{Cholesky, SMatrix, SVector, Vector3};
use perimelt_core::body::{Body, BoxImage, BoxImages};
use perimelt_core::cell_list::CellList;
use perimelt_core::material::Property;
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::world::activity::is_active;
use perimelt_core::{
    Face, LoadError, Physics, Prepared, Read, RunError, RunningPhysics, SavedState, Setup,
    SetupError, Step, Work, World, Write, keys,
};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Radius of the fit of a gradient, in spacings.
const RADIUS: f64 = 2.01;

/// Highest temperatures, times above a temperature, cooling times and solidification of all points.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ThermalHistory {
    /// Body; may be left out when there is only one.
    #[serde(default)]
    pub body: Option<String>,
    /// Temperature of `time_above`, K; the solidus of the body's material when left out.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub above: Option<f64>,
    /// Upper and lower temperature of `cooling_time`, K.
    #[serde(default = "default_cooling_range")]
    pub cooling: [f64; 2],
    /// Temperature of the solidification front, K; the liquidus of the body's material when left out.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub solidification: Option<f64>,
}

/// 800 and 500 °C.
fn default_cooling_range() -> [f64; 2] {
    [1073.15, 773.15]
}

/// A history that is recorded.
struct RunningHistory {
    body: usize,
    /// Temperatures between which the cooling time is measured, K.
    cooling: [f64; 2],
    temperature: Read<f64>,
    peak: Write<f64>,
    time_above: Write<f64>,
    cooling_time: Write<f64>,
    cooling_rate: Write<f64>,
    gradient: Write<f64>,
    speed: Write<f64>,
    melting_time: Write<f64>,
    solidification_time: Write<f64>,
    solidifications: Write<f64>,
    above: Option<f64>,
    solidification: Option<f64>,
    neighbours: CellList,
    images: Vec<BoxImage>,
    /// Histories at the end of the last step.
    points: Vec<PointHistory>,
    /// Histories at the end of this step, and their changes.
    next: Vec<(PointHistory, HistoryChange)>,
}

/// State of a point that is carried from one step to the next.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct PointHistory {
    /// Temperature, K; zero where there is no material yet.
    temperature: f64,
    /// Time at which the temperature fell below the upper temperature of `cooling_time`, s.
    cooling_since: Option<f64>,
    /// Time of melting, s, while the point is liquid.
    molten_since: Option<f64>,
}

/// Change of the history of a point in a step.
#[derive(Clone, Copy, Debug, Default)]
struct HistoryChange {
    time_above: f64,
    cooling_time: Option<f64>,
    solidified: Option<Solidification>,
}

/// A solidification of a point.
#[derive(Clone, Copy, Debug)]
struct Solidification {
    /// Cooling rate, K/s, positive.
    rate: f64,
    /// Magnitude of the temperature gradient, K/m.
    gradient: f64,
    /// Time of the preceding melting, s.
    melted: f64,
    /// Time of solidification, s.
    time: f64,
}

/// Fraction of a step after which a linearly changing temperature crosses a level, if it does.
fn crossing(before: f64, after: f64, level: f64) -> Option<f64> {
    ((before > level) != (after > level)).then(|| (before - level) / (before - after))
}

impl ThermalHistory {
    fn check(&self) -> Result<(), SetupError> {
        let [upper, lower] = self.cooling;
        if !(upper > lower && lower > 0.0 && upper.is_finite()) {
            let message = format!("a point cannot cool from {upper} to {lower} K");
            return Err(SetupError::value(
                "cooling",
                message,
                "the upper temperature, then the lower one, K",
            ));
        }
        let given = [
            ("above", self.above),
            ("solidification", self.solidification),
        ];
        for (key, temperature) in given {
            if let Some(t) = temperature.filter(|t| !(*t > 0.0 && t.is_finite())) {
                return Err(SetupError::value(
                    key,
                    format!("`{key}` is {t} K"),
                    "kelvins above zero",
                ));
            }
        }
        Ok(())
    }
}

/// A property that is equal in all materials of a body, if it is.
fn common(body: &Body, property: &str) -> Option<f64> {
    let materials = body.materials.iter();
    let values: Option<Vec<Property>> = materials.map(|m| m.get(property).cloned()).collect();
    Property::common(&values?)
}

#[typetag::serialize(name = "thermal_history")]
impl Physics for ThermalHistory {
    fn prepare(self: Box<Self>, setup: &mut Setup<'_>) -> Prepared<dyn RunningPhysics> {
        Ok(Box::new(self.prepare_history(setup)?))
    }
}

impl ThermalHistory {
    fn prepare_history(&self, setup: &mut Setup<'_>) -> Result<RunningHistory, SetupError> {
        self.check()?;
        let body = setup.find_body(self.body.as_deref())?;
        let this = setup.body(body);
        let reach: Vec<f64> = this.points.spacing.iter().map(|s| RADIUS * s).collect();
        let neighbours = CellList::new(&this.points.position, &reach);
        let images = images(this, &setup.world().symmetry(body));
        let count = this.points.len();
        let (solidus, liquidus) = (common(this, "solidus"), common(this, "liquidus"));
        let neighbourhood = Neighbourhood {
            body: this,
            list: &neighbours,
            images: &images,
        };
        let mut around = vec![false; count];
        for point in 0..setup.world().reducer(body).owned() {
            neighbourhood.visit(point, |other, _| around[other] = true);
        }
        setup.read_points(body, (0..count).filter(|point| around[*point]));
        Ok(RunningHistory {
            body,
            cooling: self.cooling,
            temperature: setup.read(body, &keys::TEMPERATURE)?,
            peak: setup.own_derived(body, &keys::PEAK_TEMPERATURE)?,
            time_above: setup.own_derived(body, &keys::TIME_ABOVE)?,
            cooling_time: setup.own_derived(body, &keys::COOLING_TIME)?,
            cooling_rate: setup.own_derived(body, &keys::COOLING_RATE)?,
            gradient: setup.own_derived(body, &keys::THERMAL_GRADIENT)?,
            speed: setup.own_derived(body, &keys::SOLIDIFICATION_SPEED)?,
            melting_time: setup.own_derived(body, &keys::MELTING_TIME)?,
            solidification_time: setup.own_derived(body, &keys::SOLIDIFICATION_TIME)?,
            solidifications: setup.own_derived(body, &keys::SOLIDIFICATIONS)?,
            above: self.above.or(solidus),
            solidification: self.solidification.or(liquidus),
            neighbours,
            images,
            points: vec![PointHistory::default(); count],
            next: Vec::with_capacity(count),
        })
    }
}

perimelt_core::register_physics!("thermal_history", ThermalHistory, supports: [Births, Cuts, Division]);

impl RunningPhysics for RunningHistory {
    fn start(&mut self, world: &World) -> Result<(), RunError> {
        let temperature = world.read(self.temperature);
        let activity = world.activity(self.body);
        let is_there = |i: usize| activity.as_ref().is_none_or(|a| is_active(a[i]));
        let mut peak = world.write(self.peak);
        for (i, point) in self.points.iter_mut().enumerate() {
            let temperature = if is_there(i) { temperature[i] } else { 0.0 };
            peak[i] = temperature;
            let is_molten = self.solidification.is_some_and(|level| temperature > level);
            *point = PointHistory {
                temperature,
                cooling_since: None,
                molten_since: is_molten.then_some(0.0),
            };
        }
        Ok(())
    }

    fn advance(&mut self, world: &World, step: Step) -> Result<Work, RunError> {
        self.find_changes(world, step);
        self.write(world);
        Ok(Work::default())
    }

    fn save(&self, world: &World) -> Box<dyn erased_serde::Serialize + '_> {
        Box::new(world.whole_of(self.body, &self.points))
    }

    fn load(&mut self, world: &World, state: SavedState<'_, '_>) -> Result<(), LoadError> {
        self.points = world.load_points(self.body, state)?;
        Ok(())
    }
}

impl RunningHistory {
    /// Finds the changes of all histories in a step.
    fn find_changes(&mut self, world: &World, step: Step) {
        let [upper, lower] = self.cooling;
        let now = world.read(self.temperature);
        let now: &[f64] = &now;
        let body = world.body(self.body);
        let (above, solidification) = (self.above, self.solidification);
        let neighbourhood = Neighbourhood {
            body,
            list: &self.neighbours,
            images: &self.images,
        };
        let points = &self.points;
        let activity = world.activity(self.body);
        let activity = activity.as_deref();
        let is_known = |i: usize| activity.is_none() || points[i].temperature > 0.0;
        let of_point = |i: usize| {
            let PointHistory {
                temperature: before,
                mut cooling_since,
                mut molten_since,
            } = points[i];
            if activity.is_some_and(|a| !is_active(a[i])) {
                return (PointHistory::default(), HistoryChange::default());
            }
            let after = now[i];
            let before = if is_known(i) { before } else { after };
            let mut found = HistoryChange::default();
            let at = |fraction: f64| step.start + fraction * step.size;
            if let Some(level) = above {
                found.time_above = step.size * fraction_above(before, after, level);
            }
            match crossing(before, after, upper) {
                Some(fraction) if after < before => cooling_since = Some(at(fraction)),
                Some(_) => cooling_since = None,
                None => {}
            }
            let reaches_lower = crossing(before, after, lower).filter(|_| after < before);
            if let (Some(since), Some(fraction)) = (cooling_since, reaches_lower) {
                found.cooling_time = Some(at(fraction) - since);
                cooling_since = None;
            }
            let passes = solidification.and_then(|level| crossing(before, after, level));
            match passes {
                Some(fraction) if after > before => molten_since = Some(at(fraction)),
                // deposition of liquid material
                None if !is_known(i) && solidification.is_some_and(|level| after > level) => {
                    molten_since = Some(step.start + step.size);
                }
                _ => {}
            }
            found.solidified = passes.filter(|_| after < before).map(|fraction| {
                let field = |j: usize| {
                    let before = points[j].temperature;
                    before + fraction * (now[j] - before)
                };
                Solidification {
                    rate: (before - after) / step.size,
                    gradient: neighbourhood.gradient(i, is_known, field).norm(),
                    melted: molten_since.take().unwrap_or(0.0),
                    time: at(fraction),
                }
            });
            let point = PointHistory {
                temperature: after,
                cooling_since,
                molten_since,
            };
            (point, found)
        };
        (0..points.len())
            .into_par_iter()
            .map(of_point)
            .fill(&mut self.next);
    }

    fn write(&mut self, world: &World) {
        let mut peak = world.write(self.peak);
        let mut time_above = world.write(self.time_above);
        let mut cooling_time = world.write(self.cooling_time);
        let mut rate = world.write(self.cooling_rate);
        let mut gradient = world.write(self.gradient);
        let mut speed = world.write(self.speed);
        let mut melting_time = world.write(self.melting_time);
        let mut solidification_time = world.write(self.solidification_time);
        let mut solidifications = world.write(self.solidifications);
        for (i, (point, found)) in self.next.iter().enumerate() {
            self.points[i] = *point;
            peak[i] = peak[i].max(point.temperature);
            time_above[i] += found.time_above;
            if let Some(time) = found.cooling_time {
                cooling_time[i] = time;
            }
            if let Some(solidified) = found.solidified {
                rate[i] = solidified.rate;
                gradient[i] = solidified.gradient;
                melting_time[i] = solidified.melted;
                solidification_time[i] = solidified.time;
                solidifications[i] += 1.0;
                let is_uniform = solidified.gradient == 0.0;
                speed[i] = if is_uniform {
                    0.0
                } else {
                    solidified.rate / solidified.gradient
                };
            }
        }
    }
}

/// Fraction of a step in which a linearly changing temperature is above a level.
fn fraction_above(before: f64, after: f64, level: f64) -> f64 {
    match crossing(before, after, level) {
        Some(fraction) if after < before => fraction,
        Some(fraction) => 1.0 - fraction,
        None if after > level => 1.0,
        None => 0.0,
    }
}

/// Terms of a quadratic polynomial without its constant: along three axes, squares, products.
const TERMS: usize = 9;

/// All images of a body at planes of symmetry and beyond periodic sides.
fn images(body: &Body, symmetry: &[Face]) -> Vec<BoxImage> {
    let continues = |face: &Face| symmetry.contains(face) || body.periodic[face.axis()];
    let faces = Face::ALL.into_iter().filter(|f| f.axis() < body.dimension);
    let faces: Vec<Face> = faces.filter(continues).collect();
    BoxImages::new(body, &faces, RADIUS * body.coarsest_spacing()).all()
}

/// Points of a body and their images.
struct Neighbourhood<'a> {
    body: &'a Body,
    list: &'a CellList,
    images: &'a [BoxImage],
}

impl Neighbourhood<'_> {
    /// Calls `visit` with the other points within [`RADIUS`] of a point, images included, and the ways there over the spacing of the point.
    fn visit(&self, point: usize, mut visit: impl FnMut(usize, Vector3<f64>)) {
        let Neighbourhood { body, list, images } = *self;
        let (at, spacing) = (body.points.position.at(point), body.points.spacing[point]);
        for image in images {
            list.visit_near(&image.origin(at), RADIUS * spacing, |other| {
                let mut xi: Vector3<f64> =
                    (image.of(body.points.position.at(other)) - at) / spacing;
                (body.dimension..3).for_each(|axis| xi[axis] = 0.0);
                let is_itself = image.is_original() && other == point;
                if !is_itself && xi.norm_squared() <= RADIUS * RADIUS {
                    visit(other, xi);
                }
            });
        }
    }

    /// Gradient of a field at a point, per m, by a least-squares fit of a quadratic polynomial to the points within
    /// [`RADIUS`]; of a linear one where these points do not determine a quadratic one; zero where they determine neither.
    /// Only points for which the field `is_known` count.
    fn gradient(
        &self,
        point: usize,
        is_known: impl Fn(usize) -> bool,
        field: impl Fn(usize) -> f64,
    ) -> Vector3<f64> {
        let spacing = self.body.points.spacing[point];
        let own = field(point);
        let mut moment = SMatrix::<f64, TERMS, TERMS>::zeros();
        let mut right = SVector::<f64, TERMS>::zeros();
        let mut around = Vec::new();
        self.visit(point, |other, xi| {
            if is_known(other) {
                around.push((xi.into(), other));
            }
        });
        // in an order that processes which have different points share
        let by_place = |a: &[f64; 3], b: &[f64; 3]| {
            let axes = (0..3).map(|axis| a[axis].total_cmp(&b[axis]));
            axes.fold(Ordering::Equal, Ordering::then)
        };
        around.sort_unstable_by(|(a, _), (b, _)| by_place(a, b));
        for (xi, other) in around {
            let [x, y, z]: [f64; 3] = xi;
            let squared = x * x + y * y + z * z;
            let terms = SVector::from([x, y, z, x * x, y * y, z * z, x * y, y * z, z * x]);
            moment += terms * terms.transpose() / squared;
            right += terms * ((field(other) - own) / squared);
        }
        // terms along axes beyond the dimension of the body are zero
        for term in 0..TERMS {
            if moment[(term, term)] == 0.0 {
                moment[(term, term)] = 1.0;
            }
        }
        let quadratic = solve(moment, right).map(|all| all.fixed_rows::<3>(0).into_owned());
        let linear = || {
            let moment = moment.fixed_view::<3, 3>(0, 0).into_owned();
            solve(moment, right.fixed_rows::<3>(0).into_owned())
        };
        quadratic.or_else(linear).unwrap_or_default() / spacing
    }
}

/// Solves normal equations; `None` if the matrix is singular to single precision.
fn solve<const N: usize>(
    matrix: SMatrix<f64, N, N>,
    right: SVector<f64, N>,
) -> Option<SVector<f64, N>> {
    let factor = Cholesky::new(matrix)?;
    let pivots = factor.l_dirty().diagonal();
    (pivots.min() > 1e-4 * pivots.max()).then(|| factor.solve(&right))
}

#[cfg(test)]
mod tests;
