//! Probes: numbers computed from the fields with every logged state.

use nalgebra::Vector3;
use perimelt_core::error::Problem;
use perimelt_core::field::FieldIndex;
use perimelt_core::world::activity::is_active;
use perimelt_core::{Axis, Body, SetupError, Simulation, World};

use crate::component::Component;
use crate::melt_pool::{Aim, Directions, MeltPoolGauge, SourceState, metal};

pub mod interpolation;
mod section;

use interpolation::{Interpolation, Weights};
pub use section::{
    Above, LineProbe, MeltPoolProbe, ProbeKind, ProbeSection, RegionProbe, Statistic,
};

/// Most positions of a line: each is a column of a time series.
const MAX_LINE: usize = 100_000;

/// A probe, ready to measure.
#[derive(Debug)]
pub struct Probe {
    /// Name of its time series.
    pub name: String,
    /// Names and units of its numbers.
    pub columns: Vec<(String, String)>,
    body: usize,
    quantity: Quantity,
}

#[derive(Debug)]
enum Quantity {
    /// Weighted means at positions, those of a window of finer points where there is one.
    Positions(Component, Vec<Spot>, Option<Component>),
    Region(Component, Selected, Statistic),
    MeltPool(FieldIndex, PoolProbe),
}

/// Points of which a number is computed.
#[derive(Debug)]
struct Selected {
    points: Vec<u32>,
    /// Only where a field is above a value.
    condition: Option<(Component, f64)>,
}

/// A position (m) with its points.
#[derive(Debug)]
struct Spot {
    position: [f64; 3],
    weights: Weights,
}

impl Spot {
    /// A position on a body in its reference configuration. Mistakes are reported at `key`.
    fn new(body: &Body, position: [f64; 3], key: &str) -> Result<Spot, SetupError> {
        let weights = Weights::at(body, position, Interpolation::Linear, key)?;
        Ok(Spot { position, weights })
    }

    /// The value on a refined window that has the field and covers the position now.
    fn on_window(&self, component: Option<Component>, world: &World) -> Option<f64> {
        let component = component?;
        let window = world.fields().field(component.field).body;
        let at = Vector3::from(self.position) - world.window_shift(window);
        let window = world.body(window);
        let weights = Weights::at(window, at.into(), Interpolation::Linear, "").ok()?;
        Some(weights.value(component, world))
    }
}

#[derive(Debug)]
struct PoolProbe {
    gauge: MeltPoolGauge,
    /// Directions without a moving source.
    otherwise: Directions,
    /// Whether the case gives the axes, so that sources do not count.
    is_fixed: bool,
}

impl Probe {
    /// Finds body, field, component and points of a `[[probes]]` table.
    ///
    /// # Errors
    /// The key at fault.
    pub fn new(section: &ProbeSection, simulation: &Simulation) -> Result<Probe, SetupError> {
        let world = simulation.observed();
        let body = world.find_body(section.body.as_deref())?;
        let points = world.body(body);
        let name = section.name.clone();
        if let ProbeKind::MeltPool(pool) = &section.kind {
            let field = find_field(simulation, body, "temperature", "kind")?;
            let pool = PoolProbe::new(pool, world, body)?;
            let metres = ["length", "width", "depth"].map(|n| (n.to_string(), "m".to_string()));
            let columns = metres
                .into_iter()
                .chain([("volume".into(), "m3".into())])
                .collect();
            return Ok(Probe {
                name,
                columns,
                body,
                quantity: Quantity::MeltPool(field, pool),
            });
        }
        let Some(field_name) = &section.field else {
            return Err(SetupError::value(
                "",
                "the probe has no field",
                "`field = \"...\"`",
            ));
        };
        let field = find_field(simulation, body, field_name, "field")?;
        let component = Component::new(world, field, section.component.as_deref())?;
        let unit = world.fields().field(field).unit.clone();
        let finer = component.on_window(simulation, body);
        let column = match &section.component {
            Some(part) => format!("{field_name}.{part}"),
            None => field_name.clone(),
        };
        let (columns, quantity) = match &section.kind {
            ProbeKind::Point(position) => {
                let spots = vec![Spot::new(points, *position, "kind.point")?];
                let columns = vec![(column, unit)];
                (columns, Quantity::Positions(component, spots, finer))
            }
            ProbeKind::Line(line) => {
                let (names, spots) = along(points, line)?;
                let columns = names.into_iter().map(|n| (n, unit.clone())).collect();
                (columns, Quantity::Positions(component, spots, finer))
            }
            ProbeKind::Region(region) => {
                let condition = |condition: &Above| -> Result<_, SetupError> {
                    let key = "kind.region.where.field";
                    let field = find_field(simulation, body, &condition.field, key)?;
                    let component = Component::new(world, field, None)?;
                    Ok((component, condition.above))
                };
                let condition = region.condition.as_ref().map(condition);
                let selected = Selected {
                    points: points_of(world, body, region.name.as_deref(), "kind.region.name")?,
                    condition: condition.transpose()?,
                };
                let unit = match region.statistic {
                    Statistic::Integral => format!("{unit} m3"),
                    Statistic::VolumeAbove(_) => "m3".into(),
                    Statistic::FractionAbove(_) => "1".into(),
                    _ => unit,
                };
                (
                    vec![(column, unit)],
                    Quantity::Region(component, selected, region.statistic),
                )
            }
            ProbeKind::MeltPool(_) => unreachable!("handled above"),
        };
        Ok(Probe {
            name,
            columns,
            body,
            quantity,
        })
    }

    /// The numbers of the present state, in the order of the columns. A melt pool lies along the path of the nearest of the
    /// sources.
    pub fn measure(&self, world: &World, sources: &[SourceState]) -> Vec<f64> {
        let body = world.body(self.body);
        match &self.quantity {
            Quantity::Positions(component, spots, finer) => {
                let value = |spot: &Spot| {
                    let finer = spot.on_window(*finer, world);
                    finer.unwrap_or_else(|| spot.weights.value(*component, world))
                };
                spots.iter().map(value).collect()
            }
            Quantity::Region(component, selected, statistic) => {
                let activity = world.activity(self.body);
                let there = |p: &&u32| {
                    let (activity, point) = (activity.as_ref(), **p as usize);
                    let mut condition = selected.condition.iter();
                    activity.is_none_or(|a| is_active(a[point]))
                        && condition.all(|(field, above)| field.at(world, point) > *above)
                };
                let values = selected.points.iter().filter(there).map(|&p| {
                    (
                        component.at(world, p as usize),
                        body.points.volume[p as usize],
                    )
                });
                vec![reduce(values, *statistic)]
            }
            Quantity::MeltPool(field, pool) => {
                let data = world.fields().field(*field).data();
                let metal = metal(world, self.body);
                // the gauge has the initial position of the body
                let shift: [f64; 3] = world.window_shift(self.body).into();
                let sources: Vec<_> = sources.iter().map(|s| s.seen_from(shift)).collect();
                pool.measure(data.flat(), metal.as_deref(), &sources)
            }
        }
    }
}

/// The points of a region, or all.
///
/// # Errors
/// At `key`, when the body has no such region.
pub fn points_of(
    world: &World,
    body: usize,
    region: Option<&str>,
    key: &str,
) -> Result<Vec<u32>, SetupError> {
    match region {
        Some(name) => Ok(world.region(body, key, name)?.points.clone()),
        None => Ok((0..world.body(body).points.len() as u32).collect()),
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
        && let Some(index) = simulation.observed().fields().find(body, name)
    {
        return Ok(index);
    }
    let known = of_body().map(|f| &f.name);
    Err(SetupError::unknown(key, "field", name, known))
}

/// The largest value; NaN if one of the values is NaN, which `f64::max` would ignore.
pub(crate) fn largest(values: impl Iterator<Item = f64>) -> f64 {
    let larger = |a: f64, b: f64| if a.is_nan() || a > b { a } else { b };
    values.fold(f64::NEG_INFINITY, larger)
}

/// The mean of values with weights.
fn mean(values: impl Iterator<Item = (f64, f64)>) -> f64 {
    let (sum, total) = values.fold((0.0, 0.0), |(s, t), (v, w)| (s + v * w, t + w));
    sum / total
}

fn reduce(values: impl Iterator<Item = (f64, f64)>, statistic: Statistic) -> f64 {
    // 1 above the limit, 0 below, not a number where the value is none
    let is_above = |value: f64, limit: f64| match value.is_nan() {
        true => value,
        false => f64::from(u8::from(value > limit)),
    };
    match statistic {
        Statistic::Max => largest(values.map(|(v, _)| v)),
        Statistic::Min => -largest(values.map(|(v, _)| -v)),
        Statistic::Sum => values.map(|(v, _)| v).sum(),
        Statistic::Integral => values.map(|(v, volume)| v * volume).sum(),
        Statistic::Mean => mean(values),
        Statistic::VolumeAbove(limit) => {
            values.map(|(v, volume)| is_above(v, limit) * volume).sum()
        }
        Statistic::FractionAbove(limit) => {
            mean(values.map(|(v, volume)| (is_above(v, limit), volume)))
        }
    }
}

/// Whether columns have names as those of a line probe: ascending distances from its start (m), the first one zero.
pub(crate) fn is_line<'a>(names: impl Iterator<Item = &'a str>) -> bool {
    let distances: Option<Vec<f64>> = names.map(|name| name.parse().ok()).collect();
    distances
        .is_some_and(|d| d.len() >= 2 && d[0] == 0.0 && d.windows(2).all(|pair| pair[0] < pair[1]))
}

/// Column names (distance from the start, m) and positions of a line.
fn along(body: &Body, line: &LineProbe) -> Result<(Vec<String>, Vec<Spot>), SetupError> {
    if line.number < 2 {
        let message = format!("the line has {} positions", line.number);
        return Err(SetupError::value("kind.line.number", message, "2 or more"));
    }
    if line.number > MAX_LINE {
        let message = format!("the line has {} positions", line.number);
        let expected = format!("at most {MAX_LINE}");
        return Err(SetupError::value("kind.line.number", message, expected));
    }
    let (from, to) = (Vector3::from(line.from), Vector3::from(line.to));
    let names = distances((to - from).norm(), line.number);
    let mut spots = Vec::new();
    for i in 0..line.number {
        let fraction = i as f64 / (line.number - 1) as f64;
        let position = from + (to - from) * fraction;
        spots.push(Spot::new(body, position.into(), "kind.line")?);
    }
    Ok((names, spots))
}

/// Distances of equally spaced positions from the start of a line of `length` (m), with 6 significant digits, or more where
/// neighbours would be equal, and without an exponent.
fn distances(length: f64, number: usize) -> Vec<String> {
    let distance = |i: usize| length * (i as f64 / (number - 1) as f64);
    let rounded = |decimals: usize, distance: f64| -> f64 {
        let text = format!("{distance:.decimals$e}");
        text.parse().unwrap_or(distance)
    };
    let names = |decimals| -> Vec<String> {
        let distances = (0..number).map(|i| rounded(decimals, distance(i)));
        distances.map(|d| d.to_string()).collect()
    };
    let differ = |names: &Vec<String>| names.windows(2).all(|pair| pair[0] != pair[1]);
    (5..17).map(names).find(differ).unwrap_or_else(|| names(17))
}

impl PoolProbe {
    fn new(section: &MeltPoolProbe, world: &World, index: usize) -> Result<PoolProbe, SetupError> {
        let body = world.body(index);
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
        let key = "kind.melt_pool";
        let along = section.along.unwrap_or(Axis::X);
        let down = section.down.unwrap_or(Axis::Z);
        if along == down {
            let message = "length and depth lie along the same axis";
            let expected = "two different axes as `along` and `down`";
            return Err(SetupError::value(key, message, expected));
        }
        if along.index() >= body.dimension {
            let message = format!("the body has {} dimensions only", body.dimension);
            return Err(SetupError::value(key, message, "another axis as `along`"));
        }
        let gauge = MeltPoolGauge::of_body(world, index, isotherm)
            .ok_or_else(|| MeltPoolGauge::scattered(body, key))?;
        Ok(PoolProbe {
            gauge,
            otherwise: Directions::along(along, down),
            is_fixed: section.along.is_some() || section.down.is_some(),
        })
    }

    /// Length, width and depth (m), and volume (m³) of the region above the isotherm: zero
    /// while there is none, and along axes that the body does not have.
    /// Points without metal do not count.
    fn measure(
        &self,
        temperature: &[f64],
        metal: Option<&[f64]>,
        sources: &[SourceState],
    ) -> Vec<f64> {
        let aim = Aim {
            sources: if self.is_fixed { &[] } else { sources },
            otherwise: self.otherwise,
        };
        let Some(pool) = self.gauge.measure_present(temperature, metal, aim) else {
            return vec![0.0; 4];
        };
        let (width, depth) = (pool.width.unwrap_or(0.0), pool.depth.unwrap_or(0.0));
        vec![pool.length(), width, depth, pool.volume]
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
    fn a_statistic_of_values_that_are_not_numbers_is_none() {
        let values = |first| [(first, 1.0), (2.0, 1.0), (-3.0, 1.0)];
        let statistics = [
            (Statistic::Max, 2.0),
            (Statistic::Min, -3.0),
            (Statistic::Sum, 0.0),
            (Statistic::Mean, 0.0),
            (Statistic::Integral, 0.0),
            // the value equal to the limit is not above it
            (Statistic::VolumeAbove(1.0), 1.0),
            (Statistic::FractionAbove(0.5), 2.0 / 3.0),
        ];
        for (statistic, value) in statistics {
            assert_eq!(reduce(values(1.0).into_iter(), statistic), value);
            for place in 0..3 {
                let mut values = values(1.0);
                values[place].0 = f64::NAN;
                let value = reduce(values.into_iter(), statistic);
                assert!(value.is_nan(), "{statistic:?}, number {place}");
            }
        }
    }

    #[test]
    fn a_melt_pool_along_an_axis_that_the_body_lacks_is_refused() {
        let shape = Shape::Box(BoxShape {
            min: [0.0; 3],
            max: [4.0, 3.0, 0.0],
        });
        let body = Body::fill("plate", &shape, 2, 0.5, 1.0).expect("a valid plate");
        let world = World::new(vec![body]);
        let section = |along, down| MeltPoolProbe {
            isotherm: Some(1000.0),
            along: Some(along),
            down: Some(down),
        };
        assert!(PoolProbe::new(&section(Axis::Y, Axis::Z), &world, 0).is_ok());
        assert!(PoolProbe::new(&section(Axis::Z, Axis::Y), &world, 0).is_err());
        assert!(PoolProbe::new(&section(Axis::X, Axis::X), &world, 0).is_err());
    }

    #[test]
    fn a_melt_pool_is_as_long_as_its_isotherm() {
        let body = block();
        let section = MeltPoolProbe {
            isotherm: Some(1000.0),
            along: None,
            down: None,
        };
        let pool = PoolProbe::new(&section, &World::new(vec![body.clone()]), 0).expect("a pool");
        // falls by 100 K per metre from x = 2, at any y and z: 1000 K at 2 - 1.3 and 2 + 1.3
        let temperature: Vec<f64> = body
            .points
            .position
            .iter()
            .map(|p| 1130.0 - 100.0 * (p.x - 2.0).abs())
            .collect();
        let values = pool.measure(&temperature, None, &[]);
        for (value, exact) in values.iter().zip([2.6, 3.0, 2.0]) {
            // interpolation is exact away from the kink at x = 2
            assert!((value - exact).abs() < 1e-12, "{value} for {exact}");
        }
        let cold = vec![300.0; temperature.len()];
        let cold = pool.measure(&cold, None, &[]);
        assert_eq!(cold, [0.0; 4]);
    }

    #[test]
    fn positions_of_a_line_have_short_and_different_names() {
        let names = distances(0.023, 30);
        assert_eq!(names[..3], ["0", "0.000793103", "0.00158621"]);
        assert_eq!(names[29], "0.023");
        assert_eq!(distances(8e-5, 3), ["0", "0.00004", "0.00008"]);
        let names = distances(20.0, 100_000);
        assert_eq!(names[99_998], "19.9998");
        let names = distances(200.0, 100_000);
        assert_eq!(names[99_997..], ["199.996", "199.998", "200"]);
        let many: std::collections::BTreeSet<_> = names.iter().collect();
        assert_eq!(many.len(), 100_000);
    }
}
