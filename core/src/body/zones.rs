//! Bodies of several zones, each with a spacing.

use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Body, BodyError, Points, bounded};
use crate::shape::Shape;

/// A box with a spacing.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Zone {
    /// Corner with the smallest coordinates, m; those of missing axes are ignored.
    pub min: [f64; 3],
    /// Corner with the largest coordinates, m: a whole number of spacings from `min`.
    pub max: [f64; 3],
    /// Distance between neighbouring points, m.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub spacing: f64,
    /// Factor of the horizons of its points, 1 by default: with `horizon_factor = 2` and `horizon = 3` they are 6
    /// spacings.
    #[schemars(extend("exclusiveMinimum" = 0))]
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub horizon_factor: f64,
}

fn one() -> f64 {
    1.0
}

#[expect(
    clippy::trivially_copy_pass_by_ref,
    reason = "serde passes a reference"
)]
fn is_one(factor: &f64) -> bool {
    *factor == 1.0
}

/// What can be wrong with a zone.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ZoneError {
    /// A spacing that is not positive.
    #[error("`spacing` = {0} must be positive")]
    Spacing(f64),
    /// A factor of the horizon that is not positive.
    #[error("`horizon_factor` = {0} must be positive and finite")]
    HorizonFactor(f64),
    /// An edge that is not a whole number of spacings.
    #[error(
        "its extent is {extent} m along {}, not a whole number of spacings of {spacing} m",
        ["x", "y", "z"][*axis]
    )]
    Uneven {
        /// Axis.
        axis: usize,
        /// Length along it, m.
        extent: f64,
        /// Spacing, m.
        spacing: f64,
    },
    /// Two zones with common cells.
    #[error("the zone overlaps with zone {}", .0 + 1)]
    Overlap(usize),
    /// No cell centre inside the shape.
    #[error("no cell centre of the zone lies inside the shape")]
    Empty,
}

impl Zone {
    /// Number of cells along each axis.
    fn cells(&self, dimension: usize) -> Result<[usize; 3], ZoneError> {
        if self.spacing.is_nan() || self.spacing <= 0.0 {
            return Err(ZoneError::Spacing(self.spacing));
        }
        if !(self.horizon_factor > 0.0 && self.horizon_factor.is_finite()) {
            return Err(ZoneError::HorizonFactor(self.horizon_factor));
        }
        let mut cells = [1; 3];
        for (axis, cells) in cells.iter_mut().enumerate().take(dimension) {
            let extent = self.max[axis] - self.min[axis];
            let count = (extent / self.spacing).round();
            // a thousandth of a cell covers decimals that are cut off
            if !(count >= 1.0 && (extent / self.spacing - count).abs() < 1e-3) {
                return Err(ZoneError::Uneven {
                    axis,
                    extent,
                    spacing: self.spacing,
                });
            }
            *cells = count as usize;
        }
        Ok(cells)
    }

    fn overlaps(&self, other: &Zone, dimension: usize) -> bool {
        let near = 1e-3 * self.spacing.min(other.spacing);
        (0..dimension).all(|a| self.max[a].min(other.max[a]) - self.min[a].max(other.min[a]) > near)
    }

    fn contains(&self, at: &Vector3<f64>, dimension: usize) -> bool {
        let near = 1e-3 * self.spacing;
        (0..dimension).all(|a| at[a] >= self.min[a] - near && at[a] <= self.max[a] + near)
    }
}

impl Body {
    /// Fills `shape` with the centres of the cells of several zones; a cell belongs to the body
    /// when its centre lies inside. 1D and 2D bodies lie at the middle of the shape's box in the
    /// missing axes.
    ///
    /// # Errors
    /// [`BodyError`] for zones that overlap, hold no point or leave out a part of the shape.
    pub fn fill_zones(
        name: &str,
        shape: &Shape,
        dimension: usize,
        thickness: f64,
        zones: &[Zone],
    ) -> Result<Body, BodyError> {
        let (min, max) = bounded(shape, dimension, thickness)?;
        let middle = 0.5 * (min + max);
        let depth = if dimension == 3 { 1.0 } else { thickness };
        let (mut position, mut spacing) = (Vec::new(), Vec::new());
        let mut horizon_factor = Vec::new();
        for (number, zone) in zones.iter().enumerate() {
            let wrong = |mistake| BodyError::Zone { number, mistake };
            let cells = zone.cells(dimension).map_err(wrong)?;
            let total: f64 = cells.iter().map(|&c| c as f64).product();
            if total + position.len() as f64 >= f64::from(u32::MAX) {
                return Err(BodyError::TooManyPoints(total));
            }
            let other = zones[..number]
                .iter()
                .position(|z| z.overlaps(zone, dimension));
            if let Some(other) = other {
                return Err(wrong(ZoneError::Overlap(other)));
            }
            let before = position.len();
            for index in 0..total as usize {
                let cell = [
                    index % cells[0],
                    index / cells[0] % cells[1],
                    index / (cells[0] * cells[1]),
                ];
                let centre = Vector3::from_fn(|a, _| {
                    if a < dimension {
                        zone.min[a] + (cell[a] as f64 + 0.5) * zone.spacing
                    } else {
                        middle[a]
                    }
                });
                if shape.contains(&centre, 1e-6 * zone.spacing) {
                    position.push(centre);
                }
            }
            if position.len() == before {
                return Err(wrong(ZoneError::Empty));
            }
            spacing.resize(position.len(), zone.spacing);
            horizon_factor.resize(position.len(), zone.horizon_factor);
        }
        if horizon_factor.iter().all(|f| *f == 1.0) {
            horizon_factor.clear();
        }
        if let Some(at) = uncovered(shape, dimension, zones, min, max) {
            return Err(BodyError::NotCovered { at: at.into() });
        }
        let volume = spacing.iter().map(|s| s.powi(dimension as i32) * depth);
        let points = Points {
            volume: volume.collect::<Vec<_>>().into(),
            position: position.into(),
            spacing: spacing.into(),
            horizon_factor,
        };
        let (points, discretisation) = points.into_cloud(0.0);
        Ok(Body::new(name, dimension, thickness, points, discretisation).outlined(shape))
    }
}

/// A position inside the shape that no zone covers, if samples find one.
fn uncovered(
    shape: &Shape,
    dimension: usize,
    zones: &[Zone],
    min: Vector3<f64>,
    max: Vector3<f64>,
) -> Option<Vector3<f64>> {
    const SAMPLES: usize = 60;
    let samples: [usize; 3] = std::array::from_fn(|a| if a < dimension { SAMPLES } else { 1 });
    let count = samples.iter().product::<usize>();
    let sample = |index: usize| {
        let at = [
            index % samples[0],
            index / samples[0] % samples[1],
            index / (samples[0] * samples[1]),
        ];
        let fraction = |a: usize| (at[a] as f64 + 0.5) / samples[a] as f64;
        Vector3::from_fn(|a, _| min[a] + fraction(a) * (max[a] - min[a]))
    };
    // the last cell of a zone may end up to half a spacing before a face of the shape
    let finest = zones
        .iter()
        .map(|z| z.spacing)
        .fold(f64::INFINITY, f64::min);
    (0..count).map(sample).find(|x| {
        shape.contains(x, -0.5 * finest) && !zones.iter().any(|z| z.contains(x, dimension))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::Face;
    use crate::shape::BoxShape;

    fn zone(min: [f64; 2], max: [f64; 2], spacing: f64) -> Zone {
        Zone {
            min: [min[0], min[1], 0.0],
            max: [max[0], max[1], 0.0],
            spacing,
            horizon_factor: 1.0,
        }
    }

    fn plate(zones: &[Zone]) -> Result<Body, BodyError> {
        let shape = Shape::Box(BoxShape {
            min: [0.0; 3],
            max: [2.0, 1.0, 0.1],
        });
        Body::fill_zones("plate", &shape, 2, 0.1, zones)
    }

    fn mistake(zones: &[Zone]) -> String {
        plate(zones).expect_err("zones that cannot be").to_string()
    }

    #[test]
    fn zones_fill_the_volume_and_have_a_closed_surface_of_the_right_area() {
        let zones = [
            zone([0.0, 0.0], [1.0, 1.0], 0.1),
            zone([1.0, 0.0], [2.0, 1.0], 0.25),
        ];
        let body = plate(&zones).expect("valid zones");
        assert_eq!(body.points.len(), 100 + 16);
        assert!((body.points.volume.iter().sum::<f64>() - 0.2).abs() < 1e-12);
        assert!(body.fills_box());
        assert_eq!(
            (body.finest_spacing(), body.coarsest_spacing()),
            (0.1, 0.25)
        );
        for (face, area) in [(Face::XMin, 0.1), (Face::XMax, 0.1), (Face::YMax, 0.2)] {
            let bare: f64 = body.surface(&[face]).iter().map(|s| s.area).sum();
            assert!((bare - area).abs() < 1e-12, "{face:?}: {bare}");
        }
    }

    #[test]
    fn points_without_jitter_stay_and_with_it_stay_in_their_cells() {
        let shape = Shape::Box(BoxShape {
            min: [0.0; 3],
            max: [1.0; 3],
        });
        let block = Body::fill("block", &shape, 3, 0.125, 1.0).expect("valid");
        let go = |amplitude, seed| {
            let jitter = super::super::Jitter { amplitude, seed };
            block.clone().jittered(jitter).expect("valid").points
        };
        let (still, moved) = (go(0.0, 1), go(0.2, 1));
        assert_eq!(go(0.2, 1).position, moved.position);
        assert!(go(0.2, 2).position != moved.position);
        let away = |(a, b): (&Vector3<f64>, &Vector3<f64>)| (a - b).amax();
        let pairs = still.position.iter().zip(&moved.position);
        let largest = pairs.map(away).fold(0.0, f64::max);
        assert!(largest <= 0.025 && largest > 0.024, "{largest}");
        assert_eq!(still.volume, moved.volume);
    }

    #[test]
    fn zones_that_cannot_be_are_refused_with_their_number() {
        let left = zone([0.0, 0.0], [1.0, 1.0], 0.1);
        let uneven = mistake(&[left, zone([1.0, 0.0], [2.0, 1.0], 0.3)]);
        assert!(
            uneven.contains("zone 2: its extent is 1 m along x, not a whole number of spacings")
        );
        let overlap = mistake(&[left, zone([0.5, 0.0], [2.0, 1.0], 0.25)]);
        assert!(
            overlap.contains("zone 2: the zone overlaps with zone 1"),
            "{overlap}"
        );
        let outside = mistake(&[left, zone([3.0, 0.0], [4.0, 1.0], 0.25)]);
        assert!(outside.contains("zone 2: no cell centre of the zone lies inside the shape"));
        let left_out = mistake(&[left]);
        assert!(
            left_out.contains("no zone covers the part of the shape around"),
            "{left_out}"
        );
        assert!(mistake(&[zone([0.0, 0.0], [2.0, 1.0], 0.0)]).contains("must be positive"));
    }
}
