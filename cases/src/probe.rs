//! Probes: numbers taken from the fields with every logged state.

use nalgebra::Vector3;
use perimelt_core::body::{Discretisation, Face};
use perimelt_core::error::Problem;
use perimelt_core::field::FieldIndex;
use perimelt_core::{Axis, Body, SetupError, Simulation, World};

use crate::case::sections::{LineProbe, MeltPoolProbe, ProbeKind, ProbeSection, Statistic};
use crate::component::Number;

/// A probe, ready to measure.
#[derive(Debug)]
pub struct Probe {
    /// Name of its time series.
    pub name: String,
    /// Names and units of its numbers.
    pub columns: Vec<(String, String)>,
    body: usize,
    measure: Measure,
}

#[derive(Debug)]
enum Measure {
    /// Weighted means at positions.
    Positions(Component, Vec<Weights>),
    Region(Component, Vec<u32>, Statistic),
    MeltPool(FieldIndex, MeltPool),
}

/// Points and weights of an interpolation.
type Weights = Vec<(usize, f64)>;

/// Which number of a field.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Component {
    field: FieldIndex,
    number: Number,
}

#[derive(Clone, Copy, Debug)]
struct MeltPool {
    isotherm: f64,
    /// Axes of length, width and depth.
    axes: [usize; 3],
}

impl Probe {
    /// Finds body, field, component and points of a `[[probes]]` table.
    ///
    /// # Errors
    /// The key at fault.
    pub fn new(section: &ProbeSection, simulation: &Simulation) -> Result<Probe, SetupError> {
        let world = simulation.world();
        let body = find_body(world, section.body.as_deref())?;
        let points = world.body(body);
        let name = section.name.clone();
        if let ProbeKind::MeltPool(pool) = &section.kind {
            let field = find_field(simulation, body, "temperature", "kind")?;
            let pool = MeltPool::new(pool, points)?;
            let metres = ["length", "width", "depth"].map(|n| (n.to_string(), "m".to_string()));
            let columns = metres
                .into_iter()
                .chain([("volume".into(), "m3".into())])
                .collect();
            return Ok(Probe {
                name,
                columns,
                body,
                measure: Measure::MeltPool(field, pool),
            });
        }
        let Some(field_name) = &section.field else {
            return Err(SetupError::value(
                "",
                "the probe names no field",
                "`field = \"...\"`",
            ));
        };
        let field = find_field(simulation, body, field_name, "field")?;
        let component = Component::new(world, field, section.component.as_deref())?;
        let unit = world.fields().field(field).unit.clone();
        let column = match &section.component {
            Some(part) => format!("{field_name}.{part}"),
            None => field_name.clone(),
        };
        let (columns, measure) = match &section.kind {
            ProbeKind::Point(position) => {
                let weights = interpolation(points, &Vector3::from(*position), "kind.point")?;
                (
                    vec![(column, unit)],
                    Measure::Positions(component, vec![weights]),
                )
            }
            ProbeKind::Line(line) => {
                let (names, weights) = along(points, line)?;
                let columns = names.into_iter().map(|n| (n, unit.clone())).collect();
                (columns, Measure::Positions(component, weights))
            }
            ProbeKind::Region(region) => {
                let selected = points_of(points, region.name.as_deref(), "kind.region.name")?;
                let unit = match (region.statistic, points.dimension) {
                    (Statistic::Integral, _) => format!("{unit} m3"),
                    _ => unit,
                };
                (
                    vec![(column, unit)],
                    Measure::Region(component, selected, region.statistic),
                )
            }
            ProbeKind::MeltPool(_) => unreachable!("handled above"),
        };
        Ok(Probe {
            name,
            columns,
            body,
            measure,
        })
    }

    /// The numbers now, in the order of the columns.
    pub fn measure(&self, world: &World) -> Vec<f64> {
        let body = world.body(self.body);
        match &self.measure {
            Measure::Positions(component, positions) => {
                let value = |w: &Weights| w.iter().map(|&(p, w)| w * component.at(world, p)).sum();
                positions.iter().map(value).collect()
            }
            Measure::Region(component, points, statistic) => {
                let values = points.iter().map(|&p| {
                    (
                        component.at(world, p as usize),
                        body.points.volume[p as usize],
                    )
                });
                vec![reduce(values, *statistic)]
            }
            Measure::MeltPool(field, pool) => {
                let data = world.fields().field(*field).data();
                pool.measure(body, data.flat())
            }
        }
    }
}

/// The points of a region, or all.
///
/// # Errors
/// At `key`, when the body has no such region.
pub fn points_of(body: &Body, region: Option<&str>, key: &str) -> Result<Vec<u32>, SetupError> {
    let Some(name) = region else {
        return Ok((0..body.points.len() as u32).collect());
    };
    let found = body.regions.get(name).map(|r| r.points.clone());
    found.ok_or_else(|| {
        let problem = Problem::UnknownName {
            what: "region",
            name: name.into(),
            known: body.regions.keys().cloned().collect(),
        };
        SetupError::new(key, problem)
    })
}

pub(crate) fn find_body(world: &World, name: Option<&str>) -> Result<usize, SetupError> {
    let known: Vec<String> = world.bodies().iter().map(|b| b.name.clone()).collect();
    match name {
        Some(name) => known.iter().position(|b| b == name).ok_or_else(|| {
            let name = name.to_string();
            SetupError::new(
                "body",
                Problem::UnknownName {
                    what: "body",
                    name,
                    known,
                },
            )
        }),
        None if known.len() == 1 => Ok(0),
        None => Err(SetupError::new("", Problem::WhichBody(known))),
    }
}

pub(crate) fn find_field(
    simulation: &Simulation,
    body: usize,
    name: &str,
    key: &str,
) -> Result<FieldIndex, SetupError> {
    let of_body = || simulation.lasting().filter(|f| f.body == body);
    if of_body().any(|f| f.name == name)
        && let Some(index) = simulation.world().fields().find(body, name)
    {
        return Ok(index);
    }
    let known = of_body().map(|f| f.name.clone()).collect();
    Err(SetupError::new(
        key,
        Problem::UnknownName {
            what: "field",
            name: name.into(),
            known,
        },
    ))
}

impl Component {
    pub(crate) fn new(
        world: &World,
        field: FieldIndex,
        name: Option<&str>,
    ) -> Result<Component, SetupError> {
        let components = world.fields().field(field).data().components();
        let number = match (name, components) {
            (None, 1) => Number::Entry(0),
            (None, 3) => Number::Magnitude,
            (None, _) => {
                let expected = format!(
                    "`component`, one of {}",
                    Number::names(components).join(", ")
                );
                let message = "this is a tensor field";
                return Err(SetupError::value("field", message, expected));
            }
            (Some(name), _) => Number::find(components, name).ok_or_else(|| {
                let known = Number::names(components).into_iter();
                let problem = Problem::UnknownName {
                    what: "component of this field",
                    name: name.into(),
                    known: known.map(String::from).collect(),
                };
                SetupError::new("component", problem)
            })?,
        };
        Ok(Component { field, number })
    }

    pub(crate) fn at(self, world: &World, point: usize) -> f64 {
        let data = world.fields().field(self.field).data();
        let components = data.components();
        let values = &data.flat()[point * components..][..components];
        self.number.of(values)
    }
}

fn reduce(values: impl Iterator<Item = (f64, f64)>, statistic: Statistic) -> f64 {
    match statistic {
        Statistic::Max => values.map(|(v, _)| v).fold(f64::NEG_INFINITY, f64::max),
        Statistic::Min => values.map(|(v, _)| v).fold(f64::INFINITY, f64::min),
        Statistic::Sum => values.map(|(v, _)| v).sum(),
        Statistic::Integral => values.map(|(v, volume)| v * volume).sum(),
        Statistic::Mean => {
            let (sum, total) = values.fold((0.0, 0.0), |(s, t), (v, w)| (s + v * w, t + w));
            sum / total
        }
    }
}

/// Linear weights of the points around a position. On a lattice these are the points of the cells
/// around it, beyond the outermost cell centres the outermost ones alone; on a cloud they are those
/// of a least-squares fit.
fn interpolation(body: &Body, position: &Vector3<f64>, key: &str) -> Result<Weights, SetupError> {
    let tolerance = 1e-6 * body.finest_spacing();
    let (min, max) = body.bounds();
    let outside = (0..body.dimension)
        .any(|a| position[a] < min[a] - tolerance || position[a] > max[a] + tolerance);
    let off_body = || {
        let message = format!(
            "no point of body `{}` is near [{}, {}, {}]",
            body.name, position.x, position.y, position.z
        );
        let expected = format!(
            "a position on the body, within {:?} and {:?} m",
            min.as_slice(),
            max.as_slice()
        );
        SetupError::value(key, message, expected)
    };
    if outside {
        return Err(off_body());
    }
    let lattice = match &body.discretisation {
        Discretisation::Lattice(lattice) => lattice,
        Discretisation::Cloud(cloud) => {
            let weights = cloud.weights(&body.points, body.dimension, position);
            return weights.ok_or_else(off_body);
        }
    };
    // a position on a cell centre, but for rounding, is that point alone
    let snap = |share: f64| {
        let nearest = share.round();
        if (share - nearest).abs() < 1e-6 {
            nearest
        } else {
            share
        }
    };
    let relative = (position - lattice.origin) / lattice.spacing;
    let mut low = [0i64; 3];
    let mut share = [0.0; 3];
    for a in 0..body.dimension {
        let cells = snap(relative[a] - 0.5);
        low[a] = cells.floor() as i64;
        share[a] = cells - cells.floor();
    }
    let mut weights = Weights::new();
    for corner in 0..1 << body.dimension {
        let bit = |a: usize| (corner >> a) & 1;
        let cell = std::array::from_fn(|a| low[a] + bit(a) as i64);
        let factor = |a: usize| {
            if bit(a) == 1 {
                share[a]
            } else {
                1.0 - share[a]
            }
        };
        let weight: f64 = (0..body.dimension).map(factor).product();
        if let Some(point) = lattice.point(cell)
            && weight > 0.0
        {
            weights.push((point, weight));
        }
    }
    let total: f64 = weights.iter().map(|(_, w)| w).sum();
    if weights.is_empty() {
        return Err(off_body());
    }
    weights.iter_mut().for_each(|(_, w)| *w /= total);
    Ok(weights)
}

/// Column names (distance from the start, m) and weights of a line of positions.
fn along(body: &Body, line: &LineProbe) -> Result<(Vec<String>, Vec<Weights>), SetupError> {
    if line.number < 2 {
        let message = format!("a line of {} positions", line.number);
        return Err(SetupError::value("kind.line.number", message, "2 or more"));
    }
    let (from, to) = (Vector3::from(line.from), Vector3::from(line.to));
    let mut names = Vec::new();
    let mut weights = Vec::new();
    for i in 0..line.number {
        let share = i as f64 / (line.number - 1) as f64;
        let position = from + (to - from) * share;
        names.push(format!("{:.6e}", (to - from).norm() * share));
        weights.push(interpolation(body, &position, "kind.line")?);
    }
    Ok((names, weights))
}

impl MeltPool {
    fn new(section: &MeltPoolProbe, body: &Body) -> Result<MeltPool, SetupError> {
        let isotherm = match section.isotherm {
            Some(isotherm) => isotherm,
            None => body.materials[0].constant("solidus").map_err(|e| {
                let problem = Problem::Value {
                    message: e.to_string(),
                    expected: "`isotherm`, K, or a solidus".into(),
                };
                SetupError::new("kind.melt_pool", problem)
            })?,
        };
        let axis = |axis: Axis| axis as usize;
        let (length, depth) = (axis(section.along), axis(section.down));
        if length == depth {
            let message = "length and depth lie along the same axis";
            return Err(SetupError::value(
                "kind.melt_pool",
                message,
                "two different axes as `along` and `down`",
            ));
        }
        Ok(MeltPool {
            isotherm,
            axes: [length, 3 - length - depth, depth],
        })
    }

    /// Length, width, depth (m) and volume (m³) of the points at or above the isotherm. Between
    /// a point above and its neighbour below the edge is interpolated; at the surface of the
    /// body it is the cell's face.
    fn measure(&self, body: &Body, temperature: &[f64]) -> Vec<f64> {
        let mut low = [f64::INFINITY; 3];
        let mut high = [f64::NEG_INFINITY; 3];
        let mut volume = 0.0;
        for (point, &own) in temperature.iter().enumerate() {
            if own < self.isotherm {
                continue;
            }
            volume += body.points.volume[point];
            let position = body.points.position[point];
            for a in 0..body.dimension {
                let reach = |face: Face| match body.neighbour(point, face) {
                    None => 0.5 * body.points.spacing[point],
                    Some(n) if temperature[n] >= self.isotherm => 0.0,
                    Some(n) => {
                        let distance = (body.points.position[n][a] - position[a]).abs();
                        distance * (own - self.isotherm) / (own - temperature[n])
                    }
                };
                low[a] = low[a].min(position[a] - reach(Face::ALL[2 * a]));
                high[a] = high[a].max(position[a] + reach(Face::ALL[2 * a + 1]));
            }
        }
        let extent = |a: usize| (high[a] - low[a]).max(0.0);
        let mut values: Vec<f64> = self.axes.iter().map(|&a| extent(a)).collect();
        values.push(volume);
        values
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use perimelt_core::shape::{BoxShape, Shape};

    fn block() -> Body {
        let shape = Shape::Box(BoxShape {
            min: [0.0; 3],
            max: [4.0, 3.0, 2.0],
        });
        Body::fill("block", &shape, 3, 0.5, 1.0).expect("a valid block")
    }

    #[test]
    fn a_linear_field_is_interpolated_exactly_between_cell_centres() {
        let body = block();
        let field = |p: &Vector3<f64>| 1.0 + 2.0 * p.x - 3.0 * p.y + 0.5 * p.z;
        for position in [[1.1, 1.3, 0.9], [0.25, 0.25, 0.25], [2.0, 1.0, 1.0]] {
            let position = Vector3::from(position);
            let weights = interpolation(&body, &position, "kind.point").expect("on the body");
            let value: f64 = weights
                .iter()
                .map(|&(p, w)| w * field(&body.points.position[p]))
                .sum();
            // rounding of a sum of eight terms
            assert!((value - field(&position)).abs() < 1e-13, "{position}");
        }
        let centre =
            interpolation(&body, &Vector3::new(0.25, 0.25, 0.25), "").expect("on the body");
        assert_eq!(centre, [(0, 1.0)], "a cell centre is that point alone");
    }

    #[test]
    fn a_position_off_the_body_is_refused() {
        let error = interpolation(&block(), &Vector3::new(9.0, 0.0, 0.0), "kind.point");
        assert_eq!(error.expect_err("off the body").key, "kind.point");
    }

    #[test]
    fn a_melt_pool_is_as_long_as_its_isotherm() {
        let body = block();
        let pool = MeltPool {
            isotherm: 1000.0,
            axes: [0, 1, 2],
        };
        // falls by 100 K per metre from x = 2, whatever y and z: 1000 K at 2 - 1.3 and 2 + 1.3
        let temperature: Vec<f64> = body
            .points
            .position
            .iter()
            .map(|p| 1130.0 - 100.0 * (p.x - 2.0).abs())
            .collect();
        let values = pool.measure(&body, &temperature);
        for (value, exact) in values.iter().zip([2.6, 3.0, 2.0]) {
            // interpolation is exact away from the kink at x = 2
            assert!((value - exact).abs() < 1e-12, "{value} for {exact}");
        }
        let cold = pool.measure(&body, &vec![300.0; temperature.len()]);
        assert_eq!(cold, [0.0; 4]);
    }
}
