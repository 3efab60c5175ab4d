//! One pass over the clouds of a body: when its fields peak, and how its melt pool grows.

use std::collections::BTreeMap;

use perimelt_core::log::{BodyInfo, Log, LogError, LoggedCloud};

use super::scalar::scalar;
use crate::melt_pool::{MeltPool, MeltPoolGauge, Travel};
use crate::moment::sound;

/// Result of the pass.
#[derive(Clone, Debug, Default)]
pub(crate) struct Survey {
    /// number of the cloud in which the field reaches its largest value
    pub peak: BTreeMap<String, usize>,
    /// times (s) and melt pools, `None` while nothing is molten
    pub pools: Vec<(f64, Option<MeltPool>)>,
}

/// Surveys `fields`; melt pools if there is an isotherm (K) to bound them.
pub(crate) fn survey(
    log: &Log,
    body: &BodyInfo,
    fields: &[String],
    isotherm: Option<f64>,
    travel: Travel,
) -> Result<Survey, LogError> {
    let mut survey = Survey::default();
    let mut largest: BTreeMap<&str, f64> = BTreeMap::new();
    let reference = Reference::new(log, body)?;
    for index in 0..log.times(&body.name).len() {
        let Some(cloud) = sound(log.cloud(&body.name, index))? else {
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
        if let (Some(isotherm), Some(temperature)) = (isotherm, scalar(&cloud, "temperature")) {
            let pool = reference.pool((body, &cloud), (isotherm, travel), &temperature.values);
            survey.pools.push((cloud.time, pool));
        }
    }
    Ok(survey)
}

/// Reference positions of a body; its deformed positions do not form a lattice.
#[derive(Clone, Debug, Default)]
pub(crate) struct Reference {
    first: Option<Vec<[f64; 3]>>,
}

impl Reference {
    /// From the first cloud of a body that is a solid, that is one with displacements.
    pub(crate) fn new(log: &Log, body: &BodyInfo) -> Result<Self, LogError> {
        if log.times(&body.name).is_empty() {
            return Ok(Self::default());
        }
        let cloud = log.first_cloud(&body.name)?;
        let is_solid = cloud
            .fields
            .iter()
            .any(|field| field.name == "displacement");
        Ok(Self {
            first: is_solid.then_some(cloud.positions),
        })
    }

    /// Reference positions (m) of the points of a cloud; for a fluid, the current ones.
    pub(crate) fn positions<'a>(&'a self, cloud: &'a LoggedCloud) -> &'a [[f64; 3]] {
        match &self.first {
            Some(first) if first.len() == cloud.positions.len() => first,
            _ => &cloud.positions,
        }
    }

    /// The region around the highest of the temperatures (K) that is above the isotherm (K).
    pub(crate) fn pool(
        &self,
        (body, cloud): (&BodyInfo, &LoggedCloud),
        (isotherm, travel): (f64, Travel),
        temperatures: &[f64],
    ) -> Option<MeltPool> {
        let grid = super::grid_of(body, cloud, self.positions(cloud))?;
        let gauge = MeltPoolGauge::on(grid, body.dimension, travel.into(), isotherm);
        gauge.with_symmetry(&body.symmetry).measure(temperatures)
    }
}
