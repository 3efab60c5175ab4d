//! One pass over the clouds of a body: when its fields peak, and how its melt pool grows.

use std::collections::BTreeMap;

use perimelt_core::log::{BodyInfo, CloudField, Log, LogError, LoggedCloud};

use super::scalar::scalar;
use crate::melt_pool::{Aim, LoggedSources, MeltPool, MeltPoolGauge, Travel};
use crate::moment::sound;

/// Result of the pass.
#[derive(Clone, Debug, Default)]
pub(crate) struct Survey {
    /// number of the cloud in which the field reaches its largest value
    pub peak: BTreeMap<String, usize>,
    /// times (s), melt pools, `None` while nothing is molten, and the hottest places (m)
    pub pools: Vec<(f64, Option<MeltPool>, [f64; 3])>,
    /// by cloud: the highest temperature (of a body without, the largest value of the first field), and where it is (m)
    hottest: Vec<Hottest>,
}

/// The hottest point of a cloud.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Hottest {
    /// its value
    value: f64,
    /// its reference position, m
    pub place: [f64; 3],
    /// number of the cloud
    pub index: usize,
    /// whether it is above the isotherm that bounds the melt pool
    is_molten: bool,
}

impl Survey {
    /// The hottest point half way through the times at which it is hot: a section there is not beside the weld, nor at one of
    /// its ends.
    pub(crate) fn middle(&self) -> Option<Hottest> {
        let from = self.hot_from();
        let hot: Vec<_> = self.hottest.iter().filter(|h| h.value >= from).collect();
        hot.get(hot.len() / 2).map(|hottest| **hottest)
    }

    /// The hottest point of a cloud that is hot, or else that of half way.
    pub(crate) fn hottest_of(&self, index: usize) -> Option<Hottest> {
        let of_cloud = self.hottest.iter().find(|hottest| hottest.index == index);
        let hot = of_cloud.filter(|h| h.is_molten || h.value >= self.hot_from());
        hot.copied().or_else(|| self.middle())
    }

    /// The value from which on the hottest point of a cloud counts as hot.
    fn hot_from(&self) -> f64 {
        /// part of the range of the highest temperatures
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
    /// part of the highest value that is rounding
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
) -> Result<Survey, LogError> {
    let mut survey = Survey::default();
    let mut largest: BTreeMap<&str, f64> = BTreeMap::new();
    let reference = Reference::new(log, body)?;
    let sources = LoggedSources::of_log(log);
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
        let heat = scalar(&cloud, "temperature").or_else(|| scalar(&cloud, fields.first()?));
        survey.hottest.extend(heat.and_then(|heat| {
            let (value, place) = highest(&heat.values, reference.positions(&cloud))?;
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
            let pool = reference.pool((body, &cloud), (isotherm, aim), &temperature.values);
            let hottest = survey.hottest.last().map_or([0.0; 3], |h| h.place);
            survey.pools.push((cloud.time, pool, hottest));
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
    /// From the first cloud of a body that is a solid, that is one with displacements: its positions without them.
    pub(crate) fn new(log: &Log, body: &BodyInfo) -> Result<Self, LogError> {
        if log.times(&body.name).is_empty() {
            return Ok(Self::default());
        }
        let LoggedCloud {
            mut positions,
            fields,
            ..
        } = log.first_cloud(&body.name)?;
        let of_solid = |field: &&CloudField| field.name == "displacement" && field.components == 3;
        let Some(displacement) = fields.iter().find(of_solid) else {
            return Ok(Self::default());
        };
        // a log that was cut does not begin with the undeformed body
        for (position, u) in positions
            .iter_mut()
            .zip(displacement.values.chunks_exact(3))
        {
            for axis in 0..3 {
                position[axis] -= u[axis];
            }
        }
        Ok(Self {
            first: Some(positions),
        })
    }

    /// Whether the body has displacements, so that its positions are not those of the undeformed body.
    pub(crate) fn is_of_solid(&self) -> bool {
        self.first.is_some()
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
        (isotherm, aim): (f64, Aim<'_>),
        temperatures: &[f64],
    ) -> Option<MeltPool> {
        let gauge = self.gauge((body, cloud), isotherm)?;
        gauge.measure(temperatures, aim)
    }

    /// Measures regions above an isotherm (K); `None` if the points are scattered too widely for a grid.
    pub(crate) fn gauge(
        &self,
        (body, cloud): (&BodyInfo, &LoggedCloud),
        isotherm: f64,
    ) -> Option<MeltPoolGauge> {
        let grid = super::grid_of(body, cloud, self.positions(cloud))?;
        let gauge = MeltPoolGauge::on(grid, (body.dimension, body.thickness), isotherm);
        Some(gauge.with_symmetry(&body.symmetry))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
