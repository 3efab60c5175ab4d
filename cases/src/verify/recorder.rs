//! Takes a measurement while a simulation runs.

use perimelt_core::field::FieldIndex;
use perimelt_core::{Problem, SetupError, Simulation, World};

use super::check::{BalanceMeasure, Extent, Interpolation, Measure, MeltPoolMeasure};
use super::sample::weights;
use crate::case::sections::{ProbeKind, ProbeSection, RegionProbe};
use crate::melt_pool::{Travel, melt_pool_on};
use crate::plot::grid::Grid;
use crate::probe::{Component, Probe, find_body, find_field};

/// A measurement under way.
pub struct Recorder {
    taker: Taker,
    /// When, s; `None`: at the end.
    time: Option<f64>,
    values: Option<Vec<f64>>,
}

enum Taker {
    Field {
        component: Component,
        weights: Vec<Vec<(usize, f64)>>,
        offset: f64,
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
    Statistic {
        probe: Probe,
        offset: f64,
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

impl Recorder {
    /// Finds what `measure` names in a composed simulation.
    ///
    /// # Errors
    /// The key at fault.
    pub fn new(measure: &Measure, simulation: &Simulation) -> Result<Recorder, SetupError> {
        let world = simulation.world();
        let mut when = None;
        let taker = match measure {
            Measure::Field(m) => {
                let body = find_body(world, m.body.as_deref())?;
                let field = find_field(simulation, body, &m.field, "measure.field.field")?;
                let component = Component::new(world, field, m.component.as_deref())?;
                let weights =
                    m.at.iter()
                        .map(|&at| weights(world.body(body), at, m.interpolation));
                when = m.time;
                Taker::Field {
                    component,
                    weights: weights.collect::<Result<_, _>>()?,
                    offset: m.offset,
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
            Measure::Statistic(m) => {
                let region = RegionProbe {
                    name: m.region.clone(),
                    statistic: m.statistic,
                };
                let section = ProbeSection {
                    name: String::new(),
                    body: m.body.clone(),
                    field: Some(m.field.clone()),
                    component: m.component.clone(),
                    kind: ProbeKind::Region(region),
                };
                when = m.time;
                Taker::Statistic {
                    probe: Probe::new(&section, simulation)?,
                    offset: m.offset,
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
                is_one_of("report of a coupler", "measure.report.name", &m.name, known)?;
                Taker::Report {
                    name: m.name.clone(),
                }
            }
        };
        Ok(Recorder {
            taker,
            time: when,
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
                if (now - time).abs() <= 1e-9 * end {
                    self.values = Some(self.taker.take(simulation));
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
            Taker::Statistic { probe, offset } => {
                probe.measure(world).iter().map(|v| v + offset).collect()
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
            Taker::History { .. } | Taker::Crossing { .. } | Taker::Balance { .. } => {
                unreachable!("seen step by step")
            }
        }
    }
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
