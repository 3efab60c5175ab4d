//! Takes a measurement while a simulation runs.

use nalgebra::Vector3;
use perimelt_core::body::weights_among;
use perimelt_core::cell_list::CellList;
use perimelt_core::field::FieldIndex;
use perimelt_core::{Body, Problem, SetupError, Simulation, World};

use super::check::{
    BalanceMeasure, DeviationMeasure, Extent, Extreme, Interpolation, Measure, MeltPoolMeasure,
    Norm, PassingMeasure,
};
use super::sample::weights;
use crate::case::sections::{ProbeKind, ProbeSection, RegionProbe, Statistic};
use crate::melt_pool::{Travel, melt_pool_on};
use crate::plot::grid::Grid;
use crate::probe::{Component, Probe, find_body, find_field, points_of};

/// A measurement under way.
pub struct Recorder {
    taker: Taker,
    /// When, s; `None`: at the end.
    time: Option<f64>,
    /// From when on the mean is taken, s, and the number of states in it so far.
    since: Option<(f64, u32)>,
    values: Option<Vec<f64>>,
}

enum Taker {
    Field {
        component: Component,
        weights: Vec<Vec<(usize, f64)>>,
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
        weights: Vec<(usize, f64)>,
        until: f64,
    },
    Crossing {
        component: Component,
        weights: Vec<(usize, f64)>,
        level: f64,
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
        body: usize,
        component: Component,
        points: Vec<u32>,
        section: DeviationMeasure,
    },
    MeltPool {
        body: usize,
        temperature: FieldIndex,
        section: MeltPoolMeasure,
    },
    Balance {
        section: BalanceMeasure,
        largest: f64,
    },
    Report {
        name: String,
    },
}

/// The body called `name`, which must have a displacement.
fn find_moving_body(simulation: &Simulation, name: Option<&str>) -> Result<usize, SetupError> {
    let body = find_body(simulation.world(), name)?;
    find_field(simulation, body, "displacement", "measure")?;
    Ok(body)
}

impl Recorder {
    /// Finds what `measure` names in a composed simulation.
    ///
    /// # Errors
    /// The key at fault.
    pub fn new(measure: &Measure, simulation: &Simulation) -> Result<Recorder, SetupError> {
        let world = simulation.world();
        let (mut when, mut since) = (None, None);
        let taker = match measure {
            Measure::Field(m) => {
                let body = find_body(world, m.body.as_deref())?;
                let field = find_field(simulation, body, &m.field, "measure.field.field")?;
                let component = Component::new(world, field, m.component.as_deref())?;
                let weights = |at| weights(world.body(body), at, m.interpolation);
                let subtracted = match m.from {
                    Some(from) => weights(from)?,
                    None => Vec::new(),
                };
                let weights = |&at: &[f64; 3]| {
                    let subtracted = subtracted.iter().map(|(point, w)| (*point, -w));
                    Ok(weights(at)?.into_iter().chain(subtracted).collect())
                };
                when = m.time;
                Taker::Field {
                    component,
                    weights: m
                        .at
                        .iter()
                        .map(weights)
                        .collect::<Result<_, SetupError>>()?,
                    offset: m.offset,
                }
            }
            Measure::Passing(m) => {
                let body = find_moving_body(simulation, m.body.as_deref())?;
                let field = find_field(simulation, body, &m.field, "measure.passing.field")?;
                (when, since) = (m.time, m.since);
                Taker::Passing {
                    body,
                    component: Component::new(world, field, m.component.as_deref())?,
                    section: m.clone(),
                }
            }
            Measure::Reach(m) => {
                when = m.time;
                Taker::Reach {
                    body: find_moving_body(simulation, m.body.as_deref())?,
                    along: m.along.into(),
                }
            }
            Measure::Nearest(m) => {
                when = m.time;
                Taker::Nearest {
                    body: find_moving_body(simulation, m.body.as_deref())?,
                }
            }
            Measure::History(m) => {
                let body = find_body(world, m.body.as_deref())?;
                let field = find_field(simulation, body, &m.field, "measure.history.field")?;
                let component = Component::new(world, field, m.component.as_deref())?;
                let weights = weights(world.body(body), m.at, m.interpolation)?;
                let end = simulation.options().end;
                Taker::History {
                    component,
                    weights,
                    until: m.until.unwrap_or(end) + 1e-9 * end,
                }
            }
            Measure::Crossing(m) => {
                let body = find_body(world, m.body.as_deref())?;
                let field = find_field(simulation, body, &m.field, "measure.crossing.field")?;
                let component = Component::new(world, field, None)?;
                let interpolation = match world.body(body).lattice() {
                    Some(_) => Interpolation::Cubic,
                    None => Interpolation::Linear,
                };
                let weights = weights(world.body(body), m.at, interpolation)?;
                Taker::Crossing {
                    component,
                    weights,
                    level: m.value,
                    last: (f64::NAN, f64::NAN),
                }
            }
            Measure::Onset(m) => Taker::Onset {
                largest: region_probe(
                    (&m.body, &m.field, None),
                    (&m.region, Statistic::Max),
                    simulation,
                )?,
                above: m.above,
            },
            Measure::Tip(m) => {
                let body = find_body(world, m.body.as_deref())?;
                let field = find_field(simulation, body, &m.field, "measure.tip.field")?;
                when = m.time;
                Taker::Tip {
                    body,
                    component: Component::new(world, field, None)?,
                    above: m.above,
                    along: m.along.into(),
                }
            }
            Measure::Statistic(m) => {
                let field = (&m.body, &m.field[..], m.component.clone());
                (when, since) = (m.time, m.since);
                Taker::Statistic {
                    probe: region_probe(field, (&m.region, m.statistic), simulation)?,
                    offset: m.offset,
                }
            }
            Measure::Place(m) => {
                let body = find_body(world, m.body.as_deref())?;
                let field = find_field(simulation, body, &m.field, "measure.place.field")?;
                when = m.time;
                let region = m.region.as_deref();
                Taker::Place {
                    body,
                    component: Component::new(world, field, m.component.as_deref())?,
                    points: points_of(world.body(body), region, "measure.place.region")?,
                    of: m.of,
                }
            }
            Measure::Deviation(m) => {
                let body = find_body(world, m.body.as_deref())?;
                let field = find_field(simulation, body, &m.field, "measure.deviation.field")?;
                when = m.time;
                let region = m.region.as_deref();
                let points = points_of(world.body(body), region, "measure.deviation.region")?;
                Taker::Deviation {
                    body,
                    component: Component::new(world, field, m.component.as_deref())?,
                    points,
                    section: m.clone(),
                }
            }
            Measure::MeltPool(m) => {
                let body = find_body(world, m.body.as_deref())?;
                let temperature = find_field(simulation, body, "temperature", "measure.melt_pool")?;
                when = m.time;
                Taker::MeltPool {
                    body,
                    temperature,
                    section: m.clone(),
                }
            }
            Measure::Balance(m) => {
                let known: Vec<String> = simulation
                    .balances()
                    .into_iter()
                    .flat_map(|(_, b)| b)
                    .map(|b| b.quantity)
                    .collect();
                is_one_of("balance", "measure.balance.quantity", &m.quantity, known)?;
                Taker::Balance {
                    section: m.clone(),
                    largest: 0.0,
                }
            }
            Measure::Report(m) => {
                let known: Vec<String> = simulation
                    .reports()
                    .into_iter()
                    .flat_map(|(_, r)| r)
                    .map(|r| r.name)
                    .collect();
                is_one_of("report", "measure.report.name", &m.name, known)?;
                when = m.time;
                Taker::Report {
                    name: m.name.clone(),
                }
            }
        };
        Ok(Recorder {
            taker,
            time: when,
            since: since.map(|since| (since, 0)),
            values: None,
        })
    }

    /// Looks at the state after a step; `logging`: it is a logged one.
    pub fn see(&mut self, simulation: &Simulation, logging: bool) {
        let (world, now) = (simulation.world(), simulation.time());
        match &mut self.taker {
            Taker::Crossing {
                component,
                weights,
                level,
                last,
            } => {
                if self.values.is_some() {
                    return;
                }
                let value = sum(*component, weights, world);
                let (before, earlier) = *last;
                if (earlier - *level) * (value - *level) <= 0.0 && earlier != value {
                    let share = (*level - earlier) / (value - earlier);
                    self.values = Some(vec![before + share * (now - before)]);
                }
                *last = (now, value);
            }
            Taker::Onset { largest, above } => {
                if self.values.is_none() && largest.measure(world)[0] > *above {
                    self.values = Some(vec![now]);
                }
            }
            Taker::History {
                component,
                weights,
                until,
            } if logging => {
                if now <= *until {
                    let value = sum(*component, weights, world);
                    self.values.get_or_insert_default().push(value);
                }
            }
            Taker::Balance { section, largest } if logging => {
                let balances = simulation.balances();
                let all = balances.iter().flat_map(|(_, b)| b);
                let errors = all
                    .filter(|b| b.quantity == section.quantity)
                    .map(|b| b.relative_error());
                *largest = errors.fold(*largest, |a, b| if b.is_nan() { b } else { a.max(b) });
                self.values = Some(vec![*largest]);
            }
            _ if !logging => {}
            _ => {
                let end = simulation.options().end;
                let time = self.time.unwrap_or(end);
                let near = 1e-9 * end;
                match &mut self.since {
                    None if (now - time).abs() <= near => {
                        self.values = Some(self.taker.take(simulation));
                    }
                    Some((since, states)) if now >= *since - near && now <= time + near => {
                        let taken = self.taker.take(simulation);
                        let means = self.values.get_or_insert_with(|| vec![0.0; taken.len()]);
                        *states += 1;
                        let share = 1.0 / f64::from(*states);
                        means
                            .iter_mut()
                            .zip(taken)
                            .for_each(|(m, v)| *m += share * (v - *m));
                    }
                    _ => {}
                }
            }
        }
    }

    /// What was measured; `None` if the run never came to it.
    pub fn values(&self) -> Option<&[f64]> {
        self.values.as_deref()
    }
}

impl Taker {
    fn take(&self, simulation: &Simulation) -> Vec<f64> {
        let world = simulation.world();
        match self {
            Taker::Field {
                component,
                weights,
                offset,
            } => weights
                .iter()
                .map(|w| sum(*component, w, world) + offset)
                .collect(),
            Taker::Passing {
                body,
                component,
                section,
            } => {
                let positions = world.positions(*body);
                let body = world.body(*body);
                let size = body.finest_spacing();
                let at = |at: &[f64; 3]| {
                    let weights =
                        weights_among(&positions, body.dimension, &Vector3::from(*at), size);
                    weights.map_or(f64::NAN, |w| sum(*component, &w, world))
                };
                section.at.iter().map(at).collect()
            }
            Taker::Reach { body, along } => {
                let along = along.normalize();
                let spacings = &world.body(*body).points.spacing;
                let ends = world.positions(*body).into_iter().zip(spacings);
                let ends = ends.map(|(x, spacing)| x.dot(&along) + 0.5 * spacing);
                vec![ends.fold(f64::NEG_INFINITY, f64::max)]
            }
            Taker::Nearest { body } => {
                let positions = world.positions(*body);
                let spacing = world.body(*body).finest_spacing();
                let list = CellList::new(&positions, &vec![spacing; positions.len()]);
                let mut nearest = spacing * spacing;
                for (i, x) in positions.iter().enumerate() {
                    list.visit_near(x, spacing, |j| {
                        if j > i {
                            nearest = nearest.min((positions[j] - x).norm_squared());
                        }
                    });
                }
                vec![nearest.sqrt() / spacing]
            }
            Taker::Statistic { probe, offset } => {
                probe.measure(world).iter().map(|v| v + offset).collect()
            }
            Taker::Place {
                body,
                component,
                points,
                of,
            } => {
                let sign = match of {
                    Extreme::Max => 1.0,
                    Extreme::Min => -1.0,
                };
                let points = points.iter().map(|&p| p as usize);
                place_of_largest(world.body(*body), points, |p| sign * component.at(world, p))
            }
            Taker::Deviation {
                body,
                component,
                points,
                section,
            } => {
                let positions = &world.body(*body).points.position;
                let pairs = points.iter().map(|&p| {
                    let expected = section
                        .expected
                        .at(positions[p as usize].into(), simulation.time());
                    (component.at(world, p as usize) - expected, expected)
                });
                let [error, size] = match section.norm {
                    Norm::L2 => pairs
                        .fold([0.0; 2], |[e, s], (d, x)| [e + d * d, s + x * x])
                        .map(f64::sqrt),
                    Norm::Largest => pairs.fold([0.0_f64; 2], |[e, s], (d, x)| {
                        [e.max(d.abs()), s.max(x.abs())]
                    }),
                };
                vec![error / size]
            }
            Taker::MeltPool {
                body,
                temperature,
                section,
            } => {
                let body = world.body(*body);
                let positions: Vec<[f64; 3]> =
                    body.points.position.iter().map(|&p| p.into()).collect();
                let temperature = world.fields().field(*temperature).data();
                let grid = match body.lattice() {
                    Some(lattice) => Grid::new(&positions, lattice.spacing),
                    None => Grid::of_spacings(&positions, &body.points.spacing),
                };
                let pool = grid.and_then(|grid| {
                    let (dimension, isotherm) = (body.dimension, section.isotherm);
                    melt_pool_on(&grid, temperature.flat(), dimension, Travel::X, isotherm)
                });
                let extent = pool.and_then(|pool| match section.extent {
                    Extent::Rear => Some(pool.rear),
                    Extent::Front => Some(pool.front),
                    Extent::Width => pool.width,
                    Extent::Depth => pool.depth,
                });
                vec![extent.unwrap_or(f64::NAN)]
            }
            Taker::Report { name } => {
                let reports = simulation.reports();
                let all = reports.iter().flat_map(|(_, r)| r);
                vec![all.filter(|r| r.name == *name).map(|r| r.value).sum()]
            }
            Taker::Tip {
                body,
                component,
                above,
                along,
            } => {
                let body = world.body(*body);
                let points = 0..body.points.len();
                let beyond = points.filter(|&p| component.at(world, p) > *above);
                place_of_largest(body, beyond, |p| body.points.position[p].dot(along))
            }
            Taker::History { .. }
            | Taker::Crossing { .. }
            | Taker::Onset { .. }
            | Taker::Balance { .. } => {
                unreachable!("seen step by step")
            }
        }
    }
}

/// Where the point lies at which something is largest; not a number where there is none.
fn place_of_largest(
    body: &Body,
    points: impl Iterator<Item = usize>,
    of: impl Fn(usize) -> f64,
) -> Vec<f64> {
    let place = points.max_by(|&a, &b| of(a).total_cmp(&of(b)));
    place.map_or(vec![f64::NAN; 3], |p| {
        body.points.position[p].as_slice().to_vec()
    })
}

fn region_probe(
    (body, field, component): (&Option<String>, &str, Option<String>),
    (region, statistic): (&Option<String>, Statistic),
    simulation: &Simulation,
) -> Result<Probe, SetupError> {
    let region = RegionProbe {
        name: region.clone(),
        statistic,
    };
    let section = ProbeSection {
        name: String::new(),
        body: body.clone(),
        field: Some(field.into()),
        component,
        kind: ProbeKind::Region(region),
    };
    Probe::new(&section, simulation)
}

fn sum(component: Component, weights: &[(usize, f64)], world: &World) -> f64 {
    weights
        .iter()
        .map(|&(point, weight)| weight * component.at(world, point))
        .sum()
}

fn is_one_of(
    what: &'static str,
    key: &str,
    name: &str,
    mut known: Vec<String>,
) -> Result<(), SetupError> {
    if known.iter().any(|k| k == name) {
        return Ok(());
    }
    known.sort();
    known.dedup();
    Err(SetupError::new(
        key,
        Problem::UnknownName {
            what,
            name: name.into(),
            known,
        },
    ))
}
