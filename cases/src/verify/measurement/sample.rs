//! The values of a measurement, taken from the state of a simulation.

use nalgebra::Vector3;
use perimelt_core::body::weights_among;
use perimelt_core::cell_list::CellList;
use perimelt_core::field::FieldIndex;
use perimelt_core::world::activity::is_active;
use perimelt_core::{Body, Simulation, World};

use crate::component::Component;
use crate::melt_pool::{Aim, MeltPoolGauge, Travel, metal, sources_of};
use crate::probe::interpolation::Weights;
use crate::probe::{Probe, largest};
use crate::verify::check::{DeviationMeasure, Extent, Extreme, Norm, PassingMeasure};

/// Takes the values of one kind of measurement.
pub(super) enum Sampler {
    Field {
        component: Component,
        weights: Vec<Weights>,
        offset: f64,
    },
    Passing {
        body: usize,
        component: Component,
        section: PassingMeasure,
    },
    Reach {
        body: usize,
        along: Vector3<f64>,
    },
    Nearest {
        body: usize,
    },
    History {
        component: Component,
        weights: Weights,
        until: f64,
    },
    Crossing {
        component: Component,
        weights: Weights,
        level: f64,
        /// Time before which crossings do not count, s.
        after: f64,
        /// time (s) and value after the previous step
        last: (f64, f64),
    },
    Onset {
        largest: Probe,
        above: f64,
    },
    Tip {
        body: usize,
        component: Component,
        above: f64,
        along: Vector3<f64>,
        angle_from: Option<[f64; 2]>,
    },
    Statistic {
        probe: Probe,
        offset: f64,
    },
    Place {
        body: usize,
        component: Component,
        points: Vec<u32>,
        of: Extreme,
    },
    Deviation {
        component: Component,
        points: Vec<u32>,
        section: DeviationMeasure,
    },
    Alternation {
        component: Component,
        rows: Vec<[usize; 3]>,
        norm: Norm,
    },
    MeltPool {
        temperature: FieldIndex,
        gauge: MeltPoolGauge,
        extent: Extent,
    },
    Balance {
        quantity: String,
        largest: f64,
    },
    Report {
        name: String,
        /// name of the divisor
        of: Option<String>,
    },
    Passes,
}

impl Sampler {
    /// Whether the values need every step or logged state, not one alone.
    pub(super) fn is_followed(&self) -> bool {
        matches!(
            self,
            Sampler::Crossing { .. }
                | Sampler::Onset { .. }
                | Sampler::History { .. }
                | Sampler::Balance { .. }
        )
    }

    /// Follows the state after a step; `logging`: the state is logged.
    pub(super) fn follow(
        &mut self,
        simulation: &Simulation,
        logging: bool,
        values: &mut Option<Vec<f64>>,
    ) {
        let (world, now) = (simulation.world(), simulation.time());
        match self {
            Sampler::Crossing {
                component,
                weights,
                level,
                after,
                last,
            } => {
                let value = weights.value(*component, world);
                let (before, earlier) = std::mem::replace(last, (now, value));
                let is_crossed = (earlier - *level) * (value - *level) <= 0.0 && earlier != value;
                if values.is_none() && is_crossed && now > *after {
                    let fraction = (*level - earlier) / (value - earlier);
                    *values = Some(vec![before + fraction * (now - before)]);
                }
            }
            Sampler::Onset { largest, above }
                if values.is_none() && largest.measure(world, &[])[0] > *above =>
            {
                *values = Some(vec![now]);
            }
            Sampler::History {
                component,
                weights,
                until,
            } if logging && now <= *until => {
                let value = weights.value(*component, world);
                values.get_or_insert_default().push(value);
            }
            Sampler::Balance { quantity, largest } if logging => {
                *largest = worst_error(simulation, quantity, *largest);
                *values = Some(vec![*largest]);
            }
            _ => {}
        }
    }

    /// The values of the present state; `None` where there are none, such as the extent of a melt pool while all is solid, and for
    /// samplers that follow every state ([`Sampler::is_followed`]).
    pub(super) fn take(&self, simulation: &Simulation) -> Option<Vec<f64>> {
        let world = simulation.world();
        Some(match self {
            Sampler::Field {
                component,
                weights,
                offset,
            } => {
                let values = weights.iter().map(|w| w.value(*component, world));
                values.map(|value| value + offset).collect()
            }
            Sampler::Passing {
                body,
                component,
                section,
            } => passing(world, *body, *component, &section.at),
            Sampler::Reach { body, along } => vec![reach(world, *body, along)],
            Sampler::Nearest { body } => vec![nearest(world, *body)],
            Sampler::Statistic { probe, offset } => probe
                .measure(world, &[])
                .iter()
                .map(|v| v + offset)
                .collect(),
            Sampler::Place {
                body,
                component,
                points,
                of,
            } => {
                let sign = match of {
                    Extreme::Max => 1.0,
                    Extreme::Min => -1.0,
                };
                let points = present(points.iter().map(|&p| p as usize), *component, world);
                place_of_largest(world.body(*body), points, |p| sign * component.at(world, p))?
            }
            Sampler::Deviation {
                component,
                points,
                section,
            } => vec![deviation(simulation, *component, points, section)],
            Sampler::Alternation {
                component,
                rows,
                norm,
            } => vec![alternation(world, *component, rows, *norm)],
            Sampler::MeltPool {
                temperature,
                gauge,
                extent,
            } => {
                vec![pool_extent(simulation, *temperature, gauge, *extent)?]
            }
            Sampler::Report { name, of } => {
                let divisor = of.as_ref().map_or(1.0, |of| report_sum(simulation, of));
                vec![report_sum(simulation, name) / divisor]
            }
            Sampler::Passes => {
                let progress = simulation.progress();
                vec![progress.passes as f64 / progress.macro_steps as f64]
            }
            Sampler::Tip {
                body,
                component,
                above,
                along,
                angle_from,
            } => {
                let body = world.body(*body);
                let points = present(0..body.points.len(), *component, world);
                let beyond = points.filter(|&p| component.at(world, p) > *above);
                let tip =
                    place_of_largest(body, beyond, |p| body.points.position.at(p).dot(along))?;
                let angle = angle_from.map(|from| vec![angle_of(from, &tip)]);
                angle.unwrap_or(tip)
            }
            Sampler::History { .. }
            | Sampler::Crossing { .. }
            | Sampler::Onset { .. }
            | Sampler::Balance { .. } => return None,
        })
    }
}

/// Largest coordinate (m) of the cells of a body along a direction.
fn reach(world: &World, body: usize, along: &Vector3<f64>) -> f64 {
    let along = along.normalize();
    let spacings = &world.body(body).points.spacing;
    let ends = world.positions(body).into_iter().zip(spacings);
    largest(ends.map(|(x, spacing)| x.dot(&along) + 0.5 * spacing))
}

/// An extent (m) of the melt pool; `None` while nothing is molten.
fn pool_extent(
    simulation: &Simulation,
    temperature: FieldIndex,
    gauge: &MeltPoolGauge,
    extent: Extent,
) -> Option<f64> {
    let world = simulation.world();
    let field = world.fields().field(temperature);
    let (temperature, metal) = (field.data(), metal(world, field.body));
    // the gauge has the initial position of the body
    let shift = world.window_shift(field.body);
    let sources = sources_of(simulation);
    let sources: Vec<_> = sources.iter().map(|s| s.seen_from(shift.into())).collect();
    let aim = Aim {
        sources: &sources,
        ..Aim::fixed(Travel::X)
    };
    let pool = gauge.measure_present(temperature.flat(), metal.as_deref(), aim)?;
    let along = shift.dot(&Vector3::from(pool.travel));
    match extent {
        Extent::Rear => Some(pool.rear + along),
        Extent::Front => Some(pool.front + along),
        Extent::Length => Some(pool.length()),
        Extent::Width => pool.width,
        Extent::Depth => pool.depth,
    }
}

/// Sum of all reports of a name.
fn report_sum(simulation: &Simulation, name: &str) -> f64 {
    let reports = simulation.reports().into_iter().flat_map(|(_, r)| r);
    reports.filter(|r| r.name == name).map(|r| r.value).sum()
}

/// The points of the body of a field that have material.
fn present(
    points: impl Iterator<Item = usize>,
    component: Component,
    world: &World,
) -> impl Iterator<Item = usize> {
    let activity = component.activity(world);
    points.filter(move |point| activity.as_ref().is_none_or(|a| is_active(a[*point])))
}

/// Norm of the deviations of a field from a formula.
fn deviation(
    simulation: &Simulation,
    component: Component,
    points: &[u32],
    measure: &DeviationMeasure,
) -> f64 {
    let world = simulation.world();
    let body = world.fields().field(component.field).body;
    let positions = &world.body(body).points.position;
    let points = points.iter().map(|&p| p as usize);
    let points: Vec<usize> = present(points, component, world).collect();
    let pairs = points.iter().map(|&p| {
        let expected = measure.expected.at(positions[p].into(), simulation.time());
        (component.at(world, p) - expected, expected)
    });
    relative_norm(pairs, measure.norm)
}

/// A component at places in space (m) among the present points; NaN where there are
/// too few.
fn passing(world: &World, body: usize, component: Component, at: &[[f64; 3]]) -> Vec<f64> {
    let positions = world.positions(body);
    let body = world.body(body);
    let size = body.finest_spacing();
    let value = |at: &[f64; 3]| {
        let weights = weights_among(&positions, body.dimension, &Vector3::from(*at), size);
        weights.map_or(f64::NAN, |w| Weights::of_points(w).value(component, world))
    };
    at.iter().map(value).collect()
}

/// Smallest distance of two points of a body now, in spacings; 1 if none is smaller.
fn nearest(world: &World, body: usize) -> f64 {
    let positions = world.positions(body);
    let spacing = world.body(body).finest_spacing();
    let list = CellList::new(&positions, &vec![spacing; positions.len()]);
    let mut nearest = spacing * spacing;
    for (i, x) in positions.iter().enumerate() {
        list.visit_near(x, spacing, |j| {
            if j > i {
                nearest = nearest.min((positions[j] - x).norm_squared());
            }
        });
    }
    nearest.sqrt() / spacing
}

/// Norm of the differences over that of the expected values, from pairs of them.
fn relative_norm(pairs: impl Iterator<Item = (f64, f64)> + Clone, norm: Norm) -> f64 {
    norm.of(pairs.clone().map(|(d, _)| d)) / norm.of(pairs.map(|(_, x)| x))
}

impl Norm {
    /// The norm of numbers; NaN if one of them is NaN or there are none.
    fn of(self, numbers: impl Iterator<Item = f64>) -> f64 {
        match self {
            Norm::L2 => {
                let (number, squares) = numbers.fold((0, 0.0), |(n, s), x| (n + 1, s + x * x));
                (squares / f64::from(number)).sqrt()
            }
            Norm::Largest => largest(numbers.map(f64::abs)),
        }
    }
}

/// Alternation of a component over rows of three neighbours, of those that have material.
fn alternation(world: &World, component: Component, rows: &[[usize; 3]], norm: Norm) -> f64 {
    let activity = component.activity(world);
    let is_present = |point: &usize| activity.as_ref().is_none_or(|a| is_active(a[*point]));
    let rows = rows.iter().filter(|row| row.iter().all(is_present));
    norm.of(rows.map(|row| {
        let [before, here, behind] = row.map(|point| component.at(world, point));
        0.25 * (before - 2.0 * here + behind)
    }))
}

/// The larger of the present relative error of a balance and `before`; NaN if one of them is NaN.
fn worst_error(simulation: &Simulation, quantity: &str, before: f64) -> f64 {
    let balances = simulation.balances();
    let all = balances.iter().flat_map(|(_, b)| b);
    let errors = all.filter(|b| b.quantity == quantity);
    let errors = errors.map(|b| b.relative_error());
    largest(std::iter::once(before).chain(errors))
}

/// Reference position (m) of the point at which something is largest; `None` where there is no point, NaN where
/// a value is NaN.
fn place_of_largest(
    body: &Body,
    points: impl Iterator<Item = usize>,
    of: impl Fn(usize) -> f64,
) -> Option<Vec<f64>> {
    let mut best: Option<(f64, usize)> = None;
    for point in points {
        let value = of(point);
        if value.is_nan() {
            return Some(vec![f64::NAN; 3]);
        }
        // the last of equal values
        if best.is_none_or(|(largest, _)| value >= largest) {
            best = Some((value, point));
        }
    }
    best.map(|(_, point)| body.points.position.at(point).as_slice().to_vec())
}

/// Angle of the line from a place to a tip from x towards y, degrees.
fn angle_of([x, y]: [f64; 2], tip: &[f64]) -> f64 {
    (tip[1] - y).atan2(tip[0] - x).to_degrees()
}
