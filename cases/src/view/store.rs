//! The log that is shown, and a cache of values computed from it.

use std::collections::hash_map::DefaultHasher;
use std::collections::{BTreeMap, VecDeque};
use std::hash::Hasher;
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use perimelt_core::log::{BodyInfo, CloudField, Log, LogError, LoggedCloud};

use crate::growing_log::{GrowingLog, LogChange};
use crate::melt_pool::{Aim, LoggedSources, MeltPool, Travel};
use crate::quantity::isotherm::{Isotherm, isotherms};
use crate::quantity::scalar::scalar;
use crate::quantity::survey::Reference;

/// Numbers in the clouds that are kept in memory, 8 bytes each; the newest cloud is kept whatever its size.
const KEPT: usize = 1 << 26;

/// Times (s) and melt pools of a body.
pub(super) type Pools = Arc<Vec<(f64, Option<MeltPool>)>>;

/// A log with a cache of what was read and computed.
pub(super) struct Store {
    log: Mutex<GrowingLog>,
    /// locked while a cloud is read, so that several requests for one cloud read it once
    clouds: Mutex<VecDeque<(Key, Arc<LoggedCloud>)>>,
    /// smallest and largest value of a scalar in a state; `None` where it has no finite one
    ranges: Mutex<BTreeMap<(String, Key), Option<Range>>>,
    outlines: Mutex<BTreeMap<String, Arc<LoggedCloud>>>,
    reference: Mutex<BTreeMap<String, Arc<Reference>>>,
    isotherms: Mutex<BTreeMap<String, Vec<Isotherm>>>,
    /// with the number of states that were measured
    pools: Mutex<BTreeMap<String, (usize, Pools)>>,
}

/// A scalar over all states of a body.
#[derive(Clone, Copy, Debug, Default, serde::Serialize)]
pub(super) struct ScalarExtremes {
    /// smallest and largest finite value
    pub(super) range: Option<Range>,
    /// number of the state in which its size is largest
    pub(super) peak: Option<usize>,
}

/// Smallest and largest value.
type Range = [f64; 2];

/// A body and the number of a state.
type Key = (String, usize);

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Store {
    /// Opens a log.
    ///
    /// # Errors
    /// It cannot be read.
    pub(super) fn open(path: &Path) -> Result<Store, LogError> {
        Ok(Store {
            log: Mutex::new(GrowingLog::open(path)?),
            clouds: Mutex::default(),
            ranges: Mutex::default(),
            outlines: Mutex::default(),
            reference: Mutex::default(),
            isotherms: Mutex::default(),
            pools: Mutex::default(),
        })
    }

    /// The log as it was last opened.
    pub(super) fn log(&self) -> Arc<Log> {
        lock(&self.log).log().clone()
    }

    /// The log as it is now. A file that cannot be read at the moment leaves the log as it was.
    pub(super) fn refreshed(&self) -> Arc<Log> {
        let mut growing = lock(&self.log);
        if growing.refresh() == LogChange::Replaced {
            self.forget();
        }
        growing.log().clone()
    }

    /// Time since the file last changed.
    pub(super) fn age(&self) -> Option<Duration> {
        lock(&self.log).age()
    }

    fn forget(&self) {
        lock(&self.clouds).clear();
        lock(&self.ranges).clear();
        lock(&self.outlines).clear();
        lock(&self.reference).clear();
        lock(&self.isotherms).clear();
        lock(&self.pools).clear();
    }

    /// A logged state of a body.
    ///
    /// # Errors
    /// There is none, or it is damaged.
    pub(super) fn cloud(&self, body: &str, index: usize) -> Result<Arc<LoggedCloud>, LogError> {
        let log = self.log();
        let mut clouds = lock(&self.clouds);
        let wanted =
            |((name, number), _): &(Key, Arc<LoggedCloud>)| name == body && *number == index;
        if let Some(found) = clouds.iter().position(wanted)
            && let Some(entry) = clouds.remove(found)
        {
            let cloud = entry.1.clone();
            clouds.push_back(entry);
            return Ok(cloud);
        }
        let cloud = Arc::new(log.cloud(body, index)?);
        clouds.push_back(((body.into(), index), cloud.clone()));
        let mut kept: usize = clouds.iter().map(|(_, cloud)| numbers(cloud)).sum();
        while clouds.len() > 1 && kept > KEPT {
            kept -= clouds.pop_front().map_or(0, |(_, cloud)| numbers(&cloud));
        }
        Ok(cloud)
    }

    /// The first state of a body that can be read, without its numbers: the fields that it has.
    ///
    /// # Errors
    /// The file cannot be read.
    pub(super) fn outline(&self, body: &str) -> Result<Arc<LoggedCloud>, LogError> {
        if let Some(outline) = lock(&self.outlines).get(body) {
            return Ok(outline.clone());
        }
        let log = self.log();
        for index in 0..log.times(body).len() {
            let cloud = match self.cloud(body, index) {
                Err(LogError::Damaged { .. }) => continue,
                cloud => cloud?,
            };
            let fields = cloud.fields.iter().map(|field| CloudField {
                name: field.name.clone(),
                unit: field.unit.clone(),
                components: field.components,
                values: Vec::new(),
            });
            let outline = Arc::new(LoggedCloud {
                time: cloud.time,
                positions: Vec::new(),
                fields: fields.collect(),
            });
            lock(&self.outlines).insert(body.to_owned(), outline.clone());
            return Ok(outline);
        }
        Ok(Arc::new(LoggedCloud {
            time: 0.0,
            positions: Vec::new(),
            fields: Vec::new(),
        }))
    }

    /// Reference positions of a body.
    ///
    /// # Errors
    /// The first state cannot be read.
    pub(super) fn reference(&self, body: &BodyInfo) -> Result<Arc<Reference>, LogError> {
        let mut known = lock(&self.reference);
        if let Some(reference) = known.get(&body.name) {
            return Ok(reference.clone());
        }
        let reference = Arc::new(Reference::new(&self.log(), body)?);
        known.insert(body.name.clone(), reference.clone());
        Ok(reference)
    }

    /// Smallest and largest finite value of a scalar over all states that can be read, and the first state in which its
    /// size is largest.
    ///
    /// # Errors
    /// The file cannot be read.
    pub(super) fn range(&self, body: &str, name: &str) -> Result<ScalarExtremes, LogError> {
        let log = self.log();
        let mut survey = ScalarExtremes::default();
        let mut largest = f64::NEG_INFINITY;
        for index in 0..log.times(body).len() {
            let key = (name.to_owned(), (body.to_owned(), index));
            let known = lock(&self.ranges).get(&key).copied();
            let found = match known {
                Some(found) => found,
                None => {
                    let found = match log.cloud(body, index) {
                        Err(LogError::Damaged { .. }) => None,
                        cloud => scalar(&cloud?, name).and_then(|s| range_of(&s.values)),
                    };
                    lock(&self.ranges).insert(key, found);
                    found
                }
            };
            survey.range = union(survey.range, found);
            let size = found.map_or(f64::NEG_INFINITY, |[low, high]| low.abs().max(high.abs()));
            if size > largest {
                largest = size;
                survey.peak = Some(index);
            }
        }
        Ok(survey)
    }

    /// Isotherms of the material of a body, the first bounds its melt pool.
    pub(super) fn isotherms(&self, body: &str) -> Vec<Isotherm> {
        let mut known = lock(&self.isotherms);
        let found = known.entry(body.to_owned());
        found
            .or_insert_with(|| isotherms(&self.log(), body, &[]))
            .clone()
    }

    /// The melt pools of a body in all of its states.
    ///
    /// # Errors
    /// The file cannot be read.
    pub(super) fn pools(&self, body: &BodyInfo, travel: Travel) -> Result<Pools, LogError> {
        let log = self.log();
        let Some(isotherm) = self.isotherms(&body.name).first().map(|i| i.temperature) else {
            return Ok(Pools::default());
        };
        let reference = self.reference(body)?;
        let known = lock(&self.pools).get(&body.name).cloned();
        let (done, pools) = known.unwrap_or_default();
        let states = log.times(&body.name).len();
        if done == states {
            return Ok(pools);
        }
        let mut pools = Vec::clone(&pools);
        let sources = LoggedSources::of_log(&log);
        for index in done..states {
            let cloud = match log.cloud(&body.name, index) {
                Err(LogError::Damaged { .. }) => continue,
                cloud => cloud?,
            };
            if let Some(temperature) = scalar(&cloud, "temperature") {
                let aim = Aim {
                    sources: sources.at(cloud.time),
                    ..Aim::fixed(travel)
                };
                let gauge = reference.gauge(body, &cloud, isotherm);
                let pool =
                    gauge.and_then(|gauge| gauge.measure_logged(&cloud, &temperature.values, aim));
                pools.push((cloud.time, pool));
            }
        }
        let pools = Arc::new(pools);
        lock(&self.pools).insert(body.name.clone(), (states, pools.clone()));
        Ok(pools)
    }
}

/// Count of the numbers in a cloud.
fn numbers(cloud: &LoggedCloud) -> usize {
    let values: usize = cloud.fields.iter().map(|field| field.values.len()).sum();
    values + 3 * cloud.positions.len()
}

/// Smallest and largest finite value.
pub(super) fn range_of(values: &[f64]) -> Option<Range> {
    let finite = values.iter().copied().filter(|x| x.is_finite());
    finite.map(|x| Some([x, x])).fold(None, union)
}

fn union(one: Option<Range>, other: Option<Range>) -> Option<Range> {
    match (one, other) {
        (Some(a), Some(b)) => Some([a[0].min(b[0]), a[1].max(b[1])]),
        (one, other) => one.or(other),
    }
}

/// Hash of positions.
pub(super) fn fingerprint(positions: &[[f64; 3]]) -> u64 {
    let mut hasher = DefaultHasher::new();
    hasher.write_usize(positions.len());
    for x in positions.iter().flatten() {
        hasher.write_u64(x.to_bits());
    }
    hasher.finish()
}
