//! One pass over the clouds of a body: when its fields peak, and how its melt pool grows.

use std::borrow::Cow;
use std::collections::BTreeMap;

use perimelt_core::log::{BodyInfo, FieldInfo, LatticeInfo, Log, LogError, LoggedCloud};

use super::scalar::scalar;
use crate::cell_grid::CellGrid;
use crate::log_file::skip_damaged;
use crate::log_names::SPACING;
use crate::melt_pool::{Aim, LoggedSources, MeltPool, MeltPoolGauge, Travel};

const DISPLACEMENT: &str = "displacement";

/// Peaks of the fields of a body and its melt pools.
#[derive(Clone, Debug, Default)]
pub(crate) struct BodySurvey {
    /// number of the cloud in which the field reaches its largest value
    pub peak: BTreeMap<String, usize>,
    pub pools: Vec<SurveyedPool>,
    /// hottest point of each cloud; of the first field where the body has no temperature
    hottest: Vec<Hottest>,
}

/// The melt pool of a cloud.
#[derive(Clone, Debug)]
pub(crate) struct SurveyedPool {
    /// s
    pub time: f64,
    /// `None` while nothing is molten
    pub pool: Option<MeltPool>,
    /// the hottest place (m)
    pub hottest: [f64; 3],
}

/// The hottest point of a cloud.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Hottest {
    /// temperature (K), or the value of the first field
    value: f64,
    /// reference position, m
    pub place: [f64; 3],
    /// number of the cloud
    pub index: usize,
    /// whether the value is above the isotherm that bounds the melt pool
    is_molten: bool,
}

impl BodySurvey {
    /// The hottest point halfway through the times at which it is hot: a section there lies on the weld and away from its ends.
    pub(crate) fn middle(&self) -> Option<Hottest> {
        let from = self.hot_from();
        let hot: Vec<_> = self.hottest.iter().filter(|h| h.value >= from).collect();
        hot.get(hot.len() / 2).map(|hottest| **hottest)
    }

    /// The hottest point of a cloud if it is hot, else [`Self::middle`].
    pub(crate) fn hottest_of(&self, index: usize) -> Option<Hottest> {
        let of_cloud = self.hottest.iter().find(|hottest| hottest.index == index);
        let hot = of_cloud.filter(|h| h.is_molten || h.value >= self.hot_from());
        hot.copied().or_else(|| self.middle())
    }

    /// The value from which on the hottest point of a cloud counts as hot.
    fn hot_from(&self) -> f64 {
        /// fraction of the range of the highest temperatures
        const HOT: f64 = 0.7;
        let values = || self.hottest.iter().map(|hottest| hottest.value);
        let low = values().fold(f64::INFINITY, f64::min);
        let high = values().fold(f64::NEG_INFINITY, f64::max);
        low + HOT * (high - low)
    }
}

/// The highest of the finite values and its place (m): where several points have it, such as those of a body of one
/// temperature, the one in their middle.
fn highest(values: &[f64], positions: &[[f64; 3]]) -> Option<(f64, [f64; 3])> {
    /// relative rounding error of the highest value
    const ROUNDING: f64 = 1e-9;
    let finite = || values.iter().zip(positions).filter(|(v, _)| v.is_finite());
    let highest = finite().map(|(v, _)| *v).max_by(f64::total_cmp)?;
    let least = highest - ROUNDING * highest.abs();
    let alike: Vec<[f64; 3]> = finite()
        .filter(|(v, _)| **v >= least)
        .map(|(_, p)| *p)
        .collect();
    let mean =
        [0, 1, 2].map(|axis| alike.iter().map(|p| p[axis]).sum::<f64>() / alike.len() as f64);
    let distance = |p: &[f64; 3]| {
        (0..3)
            .map(|axis| (p[axis] - mean[axis]).powi(2))
            .sum::<f64>()
    };
    let place = alike
        .into_iter()
        .min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
    Some((highest, place))
}

/// Surveys `fields`; melt pools if there is an isotherm (K) to bound them.
pub(crate) fn survey(
    log: &Log,
    body: &BodyInfo,
    fields: &[String],
    isotherm: Option<f64>,
    travel: Travel,
) -> Result<BodySurvey, LogError> {
    let mut survey = BodySurvey::default();
    let mut largest: BTreeMap<&str, f64> = BTreeMap::new();
    let reference = Reference::new(log, body)?;
    let sources = LoggedSources::of_log(log);
    for index in 0..log.times(&body.name).len() {
        let Some(cloud) = skip_damaged(log.cloud(&body.name, index))? else {
            continue;
        };
        for name in fields {
            let Some(scalar) = scalar(&cloud, name) else {
                continue;
            };
            let peak = scalar
                .values
                .iter()
                .fold(f64::NEG_INFINITY, |peak, x| peak.max(x.abs()));
            let so_far = largest.entry(name).or_insert(f64::NEG_INFINITY);
            if peak > *so_far {
                *so_far = peak;
                survey.peak.insert(name.clone(), index);
            }
        }
        let heat = scalar(&cloud, "temperature").or_else(|| scalar(&cloud, fields.first()?));
        survey.hottest.extend(heat.and_then(|heat| {
            let (value, place) = highest(&heat.values, &reference.positions(&cloud))?;
            Some(Hottest {
                value,
                place,
                index,
                is_molten: isotherm.is_some_and(|isotherm| value >= isotherm),
            })
        }));
        if let (Some(isotherm), Some(temperature)) = (isotherm, scalar(&cloud, "temperature")) {
            let aim = Aim {
                sources: sources.at(cloud.time),
                ..Aim::fixed(travel)
            };
            let gauge = reference.gauge(body, &cloud, isotherm);
            let pool =
                gauge.and_then(|gauge| gauge.measure_logged(&cloud, &temperature.values, aim));
            survey.pools.push(SurveyedPool {
                time: cloud.time,
                pool,
                hottest: survey.hottest.last().map_or([0.0; 3], |h| h.place),
            });
        }
    }
    Ok(survey)
}

/// Reference positions of a body, whose deformed positions do not form a lattice.
#[derive(Clone, Debug, Default)]
pub(crate) struct Reference {
    /// positions of the points in the first state; `None` for a body without displacements
    first: Option<Vec<[f64; 3]>>,
    lattice: Option<LatticeInfo>,
    spacing: f64,
}

impl Reference {
    /// Reference positions of a body of a log.
    pub(crate) fn new(log: &Log, body: &BodyInfo) -> Result<Self, LogError> {
        if log.times(&body.name).is_empty() {
            return Ok(Self::default());
        }
        let first = log.first_cloud(&body.name)?;
        // the states may be without the displacements
        let is_displacement = |f: &FieldInfo| f.name == DISPLACEMENT && f.components == 3;
        if displacement(&first).is_none() && !body.fields.iter().any(is_displacement) {
            return Ok(Self::default());
        }
        let mut reference = Self {
            first: None,
            lattice: body.lattice.clone(),
            spacing: body.spacing,
        };
        let at_rest = reference.at_rest(&first);
        reference.first = Some(at_rest.unwrap_or(first.positions));
        Ok(reference)
    }

    /// Whether the body has displacements, so that its positions are not those of the undeformed body.
    pub(crate) fn is_of_solid(&self) -> bool {
        self.first.is_some()
    }

    /// Reference positions (m) of the points of a state; for a fluid, the current ones. Points may get or lose their material
    /// from state to state: the positions are those of the state less its displacements. A state without displacements has those
    /// of the first state.
    pub(crate) fn positions<'a>(&'a self, cloud: &'a LoggedCloud) -> Cow<'a, [[f64; 3]]> {
        let Some(first) = &self.first else {
            return Cow::Borrowed(&cloud.positions);
        };
        match self.at_rest(cloud) {
            Some(at_rest) if !self.are_equal(&at_rest, first) => Cow::Owned(at_rest),
            None if first.len() != cloud.positions.len() => Cow::Borrowed(&cloud.positions),
            _ => Cow::Borrowed(first),
        }
    }

    /// The positions less the displacements, at the centre of a cell where the body has cells; `None` without displacements.
    fn at_rest(&self, cloud: &LoggedCloud) -> Option<Vec<[f64; 3]>> {
        let points = cloud.positions.iter().zip(displacement(cloud)?);
        let at_rest = |(x, u): (&[f64; 3], &[f64])| self.centred([0, 1, 2].map(|a| x[a] - u[a]));
        Some(points.map(at_rest).collect())
    }

    /// The centre of the cell in which a reference position (m) with the rounding of single precision lies. Other positions
    /// stay as they are.
    fn centred(&self, position: [f64; 3]) -> [f64; 3] {
        let Some(LatticeInfo {
            origin, spacing, ..
        }) = &self.lattice
        else {
            return position;
        };
        let centre = [0, 1, 2].map(|a| {
            let cell = ((position[a] - origin[a]) / spacing).round();
            origin[a] + cell * spacing
        });
        match is_near(&centre, &position, *spacing) {
            true => centre,
            false => position,
        }
    }

    fn are_equal(&self, some: &[[f64; 3]], others: &[[f64; 3]]) -> bool {
        let mut both = some.iter().zip(others);
        some.len() == others.len() && both.all(|(a, b)| is_near(a, b, self.spacing))
    }

    /// Measures regions above an isotherm (K); `None` if the points are scattered too widely for a grid.
    pub(crate) fn gauge(
        &self,
        body: &BodyInfo,
        cloud: &LoggedCloud,
        isotherm: f64,
    ) -> Option<MeltPoolGauge> {
        let grid = grid_of(body, cloud, &self.positions(cloud))?;
        let gauge = MeltPoolGauge::on(grid, body.dimension, body.thickness, isotherm);
        Some(gauge.with_symmetry(&body.symmetry))
    }
}

/// The grid of a body's points, by the spacings that a cloud has logged with them.
pub(crate) fn grid_of(
    body: &BodyInfo,
    cloud: &LoggedCloud,
    positions: &[[f64; 3]],
) -> Option<CellGrid> {
    let spacing = cloud.fields.iter().find(|f| f.name == SPACING);
    match spacing {
        Some(spacing) => CellGrid::of_spacings(positions, &spacing.values),
        None => CellGrid::new(positions, body.spacing),
    }
}

/// Whether two reference positions differ by the rounding of single precision only.
fn is_near(a: &[f64; 3], b: &[f64; 3], spacing: f64) -> bool {
    /// a body of 10^5 cells along an axis has half of this
    const ROUNDING: f64 = 0.02;
    (0..3).all(|axis| (a[axis] - b[axis]).abs() <= ROUNDING * spacing)
}

/// Logged displacement of each point, m.
pub(crate) fn displacement(cloud: &LoggedCloud) -> Option<std::slice::ChunksExact<'_, f64>> {
    let mut fields = cloud.fields.iter();
    let field = fields.find(|field| field.name == DISPLACEMENT && field.components == 3)?;
    Some(field.values.chunks_exact(3))
}

#[cfg(test)]
mod tests {
    use super::*;

    use perimelt_core::log::{CloudView, Coordinates, FieldView, Precision, RunInfo, Writer};

    const SPACING: f64 = 1e-3;

    /// A bar along x whose cells with these numbers have material in each state, each displaced by 0.8 of a spacing along z and
    /// by less along x.
    fn growing(path: &std::path::Path, states: &[&[usize]], with_lattice: bool) -> (Log, BodyInfo) {
        let lattice = LatticeInfo {
            origin: [0.5 * SPACING, 0.0, 0.0],
            spacing: SPACING,
            cells: [8, 1, 1],
        };
        let body = BodyInfo {
            name: "bar".into(),
            dimension: 3,
            spacing: SPACING,
            points: 8,
            lattice: with_lattice.then_some(lattice),
            plies: Vec::new(),
            fields: vec![FieldInfo {
                name: DISPLACEMENT.into(),
                unit: "m".into(),
                components: 3,
            }],
            ..BodyInfo::default()
        };
        let run = RunInfo {
            bodies: vec![body.clone()],
            ..RunInfo::default()
        };
        let mut writer = Writer::create(path, &run, "bar.toml", "").expect("a new file");
        for (time, cells) in states.iter().enumerate() {
            let displaced = |cell: usize| [1e-4 * (cell as f64).sin(), 0.0, 0.8 * SPACING];
            let place = |cell: usize| [(cell as f64 + 0.5) * SPACING, 0.0, 0.0];
            let moved = |cell: &usize| {
                let (x, u) = (place(*cell), displaced(*cell));
                [0, 1, 2].map(|a| x[a] + u[a] * time as f64)
            };
            let positions: Vec<[f64; 3]> = cells.iter().map(moved).collect();
            let values: Vec<f64> = cells
                .iter()
                .flat_map(|cell| displaced(*cell).map(|u| u * time as f64))
                .collect();
            let fields = [FieldView {
                name: DISPLACEMENT,
                components: 3,
                values: &values,
            }];
            let cloud = CloudView {
                time: time as f64,
                positions: Coordinates::Listed(&positions),
                fields: &fields,
            };
            writer
                .points("bar", Precision::F32, &cloud)
                .expect("written");
        }
        writer.finish().expect("written");
        (Log::open(path).expect("a log"), body)
    }

    #[test]
    fn reference_positions_follow_points_that_get_and_lose_material() {
        let folder = tempfile::tempdir().expect("a folder");
        // points are added before others, and as many are removed as added
        let states: [&[usize]; 4] = [&[2, 3, 5], &[2, 3, 4, 5], &[0, 3, 4, 7], &[0, 7]];
        for with_lattice in [true, false] {
            let path = folder.path().join(format!("{with_lattice}.mcap"));
            let (log, body) = growing(&path, &states, with_lattice);
            let reference = Reference::new(&log, &body).expect("readable");
            for (state, cells) in states.iter().enumerate() {
                let cloud = log.cloud("bar", state).expect("a cloud");
                let found = reference.positions(&cloud);
                let expected = cells
                    .iter()
                    .map(|c| [(*c as f64 + 0.5) * SPACING, 0.0, 0.0]);
                assert_eq!(found.len(), cells.len());
                for (found, expected) in found.iter().zip(expected) {
                    assert!(is_near(found, &expected, SPACING), "{found:?} {expected:?}");
                    // cells are those of the body, without the rounding of the log
                    let exact = (found[0] - expected[0]).abs() < 1e-15;
                    assert!(exact || !with_lattice, "{found:?}");
                }
                let grid = grid_of(&body, &cloud, &found).expect("a grid");
                assert_eq!(grid.cells[1..], [1, 1]);
            }
        }
    }

    #[test]
    fn the_highest_of_equal_values_is_in_their_middle() {
        let positions: Vec<[f64; 3]> = (0..9).map(|i| [f64::from(i), 0.0, 0.0]).collect();
        assert_eq!(
            highest(&[300.0; 9], &positions),
            Some((300.0, positions[4]))
        );
        let mut values = [300.0; 9];
        (values[2], values[7]) = (400.0, f64::NAN);
        assert_eq!(highest(&values, &positions), Some((400.0, positions[2])));
        assert_eq!(highest(&[f64::NAN], &positions), None);
    }
}
