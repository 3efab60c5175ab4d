//! When the material of each point is deposited: by layers, or in the bead behind a toolpath.

use nalgebra::Vector3;
use perimelt_core::{Body, Face};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::toolpath::Track;

/// Samples of a toolpath per spacing, which limit the delay of a birth.
const SAMPLES_PER_SPACING: f64 = 8.0;

/// Most samples of a move.
const MOST_SAMPLES: f64 = 1e7;

/// Rounding of positions, in spacings.
const NEAR: f64 = 1e-6;

/// Cross-section of the bead that a toolpath leaves: it ends at the toolpath, and its ends are rounded. It lies below the toolpath, or along
/// the axis of a torch that is inclined.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Bead {
    /// Width across the direction of travel (m).
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub width: f64,
    /// Height below the toolpath, or along the axis of an inclined torch (m).
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub height: f64,
}

/// Whole layers at fixed intervals.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Layers {
    /// Thickness of a layer (m).
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub height: f64,
    /// Time from one layer to the next (s).
    #[schemars(extend("minimum" = 0))]
    pub interval: f64,
    /// When the first layer is deposited (s); default 0.
    #[serde(default)]
    pub first: f64,
    /// Number of layers that are deposited at once, at the time of the first of them; default 1.
    #[serde(default = "one")]
    #[schemars(extend("minimum" = 1))]
    pub at_once: u32,
}

fn one() -> u32 {
    1
}

/// A point and the time at which its material is deposited, s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Birth {
    pub(super) time: f64,
    pub(super) point: u32,
}

/// Points that have no material at first, on a body that is built up in a direction.
pub(super) struct BuildRegion<'a> {
    pub(super) body: &'a Body,
    pub(super) points: &'a [u32],
    pub(super) up: Face,
}

impl BuildRegion<'_> {
    /// Coordinate of a position in the direction of build, m.
    fn level(&self, position: &Vector3<f64>) -> f64 {
        position.dot(&self.up.normal())
    }

    /// Births by layers, the lowest of which begins at the lowest cells of the points.
    pub(super) fn by_layers(&self, layers: &Layers) -> Vec<Birth> {
        let position = |p: u32| &self.body.points.position[p as usize];
        let levels = self.points.iter().map(|&p| self.level(position(p)));
        let lowest = levels.fold(f64::INFINITY, f64::min);
        let base = lowest - 0.5 * self.body.finest_spacing();
        let together = f64::from(layers.at_once);
        let birth = |&point: &u32| {
            let layer = (self.level(position(point)) - base) / (layers.height * together);
            Birth {
                time: layers.first + (layer + NEAR).floor() * layers.interval * together,
                point,
            }
        };
        in_order(self.points.iter().map(birth).collect())
    }

    /// Births by the bead that a toolpath leaves while it has power; points that it never covers have no birth. In 3D the bead
    /// lies along the axis of the torch that the path gives, or else along `torch` (unit vector into the material).
    pub(super) fn by_bead(
        &self,
        track: &Track,
        bead: &Bead,
        torch: Option<Vector3<f64>>,
    ) -> Vec<Birth> {
        let spacing = self.body.finest_spacing();
        let mut unborn = vec![false; self.body.points.len()];
        self.points.iter().for_each(|&p| unborn[p as usize] = true);
        let mut births = Vec::new();
        for (start, end) in track.powered_moves() {
            let end = self.end_of(start, end, track);
            let length = track.fastest() * (end - start);
            let samples = (SAMPLES_PER_SPACING * length / spacing).ceil();
            let samples = samples.clamp(1.0, MOST_SAMPLES);
            for sample in 0..=samples as usize {
                // the pose at the end of a move is that of the next one
                let fraction = (sample as f64 / samples).min(1.0 - 1e-12);
                let time = start + (end - start) * fraction;
                let pose = track.pose(time);
                let torch = pose.torch.or(torch).filter(|_| self.body.dimension == 3);
                let outward = torch.map_or(self.up.normal(), |axis| -axis);
                self.cover(&pose.position, outward, bead, |point| {
                    if std::mem::replace(&mut unborn[point as usize], false) {
                        births.push(Birth { time, point });
                    }
                });
            }
        }
        in_order(births)
    }

    /// End of a move, s: one without an end is followed to the far side of the body.
    fn end_of(&self, start: f64, end: f64, track: &Track) -> f64 {
        if end.is_finite() {
            return end;
        }
        let pose = track.pose(start);
        let (min, max) = self.body.bounds();
        let reach = (pose.position - 0.5 * (min + max)).norm() + (max - min).norm();
        start + 2.0 * reach / pose.speed
    }

    /// Calls `receive` with the points in the cross-section of the bead at the position `at` of the toolpath (m). The bead lies
    /// against the unit vector `outward`.
    fn cover(
        &self,
        at: &Vector3<f64>,
        outward: Vector3<f64>,
        bead: &Bead,
        mut receive: impl FnMut(u32),
    ) {
        let Some(lattice) = self.body.lattice() else {
            return;
        };
        let slack = NEAR * lattice.spacing;
        let radius = 0.5 * bead.width + slack;
        let reach = |axis: usize| {
            let along = outward[axis].abs();
            along * (bead.height + slack) + (1.0 - along * along).max(0.0).sqrt() * radius
        };
        let range = |axis: usize| {
            if axis >= self.body.dimension {
                return 0..=0;
            }
            let cell = |x: f64| ((x - lattice.origin[axis]) / lattice.spacing).floor() as i64;
            let last = lattice.cells[axis] as i64 - 1;
            let (low, high) = (cell(at[axis] - reach(axis)), cell(at[axis] + reach(axis)));
            low.max(0)..=high.min(last)
        };
        for k in range(2) {
            for j in range(1) {
                for i in range(0) {
                    let Some(point) = lattice.point([i, j, k]) else {
                        continue;
                    };
                    let position = &self.body.points.position[point];
                    let mut across = position - at;
                    let depth = -across.dot(&outward);
                    across += outward * depth;
                    (self.body.dimension..3).for_each(|axis| across[axis] = 0.0);
                    let is_inside = depth > -slack && depth < bead.height + slack;
                    if is_inside && across.norm() <= radius {
                        receive(point as u32);
                    }
                }
            }
        }
    }
}

fn in_order(mut births: Vec<Birth>) -> Vec<Birth> {
    births.sort_by(|a, b| a.time.total_cmp(&b.time).then(a.point.cmp(&b.point)));
    births
}
