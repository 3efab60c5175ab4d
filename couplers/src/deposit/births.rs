//! When the material of each point is deposited: by layers, or in the bead behind a toolpath.

use nalgebra::Vector3;
use perimelt_core::PointRows;
use perimelt_core::solver::Reducer;
use perimelt_core::world::BodyIndex;
use perimelt_core::{Body, Face, World};
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
pub(super) struct PointBirth {
    pub(super) time: f64,
    pub(super) point: u32,
}

/// Material that is deposited at once.
#[derive(Clone, Copy, Debug)]
pub(super) struct Birth {
    /// s
    pub(super) time: f64,
    /// m³
    pub(super) volume: f64,
    /// kg
    pub(super) mass: f64,
    pub(super) material: u16,
}

/// Births of points, in the order of time.
#[derive(Debug, Default)]
pub(super) struct Births {
    /// Those of all points, whichever process owns them.
    pub(super) all: Vec<Birth>,
    /// Places among them of the births of points that this process has, with these points.
    here: Vec<(u32, u32)>,
}

impl Births {
    /// The births of all points, from those of the points that each process has. `density` by point, kg/m³. Collective.
    pub(super) fn of_whole(
        world: &World,
        body: BodyIndex,
        density: &[f64],
        mut births: Vec<PointBirth>,
    ) -> Births {
        let this = world.body(body);
        let reducer = world.reducer(body);
        births.sort_by_key(|birth| birth.point);
        let mut rows = PointRows::default();
        for birth in births
            .iter()
            .filter(|b| (b.point as usize) < reducer.owned())
        {
            let point = birth.point as usize;
            let volume = this.points.volume[point];
            let [time, volume, mass] =
                [birth.time, volume, density[point] * volume].map(f64::to_bits);
            let material = u64::from(this.material_of_point[point]);
            rows.push(point, &[time, volume, mass, material]);
        }
        let rows = world.rows_of_whole(body, rows);
        let birth = |row: &[u64]| Birth {
            time: f64::from_bits(row[0]),
            volume: f64::from_bits(row[1]),
            mass: f64::from_bits(row[2]),
            material: row[3] as u16,
        };
        let all = rows.iter(4);
        let mut all: Vec<(usize, Birth)> = all.map(|(point, row)| (point, birth(row))).collect();
        let order = |a: (f64, usize), b: (f64, usize)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
        all.sort_by(|a, b| order((a.1.time, a.0), (b.1.time, b.0)));
        let place = |birth: &PointBirth| {
            let number = reducer.number(birth.point as usize) as usize;
            let found = all.binary_search_by(|(n, b)| order((b.time, *n), (birth.time, number)));
            Some((found.ok()? as u32, birth.point))
        };
        let mut here: Vec<(u32, u32)> = births.iter().filter_map(place).collect();
        here.sort_unstable();
        Births {
            all: all.into_iter().map(|(_, birth)| birth).collect(),
            here,
        }
    }

    /// Those among all from `first` to `end` of points that this process has: time (s) and point.
    pub(super) fn here(&self, first: usize, end: usize) -> impl Iterator<Item = (f64, usize)> {
        let place = |at: usize| {
            self.here
                .partition_point(|(birth, _)| (*birth as usize) < at)
        };
        let births = self.here[place(first)..place(end)].iter();
        births.map(|(birth, point)| (self.all[*birth as usize].time, *point as usize))
    }

    /// Number of births that have happened, as the points of this process tell.
    pub(super) fn count(&self, has_happened: impl Fn(usize) -> bool) -> usize {
        let here = self.here.iter();
        let happened = here.take_while(|(_, point)| has_happened(*point as usize));
        happened.last().map_or(0, |(birth, _)| *birth as usize + 1)
    }
}

/// Points that have no material at first, on a body that is built up in a direction.
pub(super) struct BuildRegion<'a> {
    pub(super) body: &'a Body,
    pub(super) points: &'a [u32],
    pub(super) up: Face,
    pub(super) reducer: Reducer,
}

impl BuildRegion<'_> {
    /// Coordinate of a position in the direction of build, m.
    fn level(&self, position: &Vector3<f64>) -> f64 {
        position.dot(&self.up.normal())
    }

    /// Births by layers, the lowest of which begins at the lowest cells of the points. Collective.
    pub(super) fn by_layers(&self, layers: &Layers) -> Vec<PointBirth> {
        let position = |p: u32| self.body.points.position.at(p as usize);
        let levels = self.points.iter().map(|&p| self.level(&position(p)));
        let lowest = self.reducer.min(levels.fold(f64::INFINITY, f64::min));
        let base = lowest - 0.5 * self.body.finest_spacing();
        let together = f64::from(layers.at_once);
        let birth = |&point: &u32| {
            let layer = (self.level(&position(point)) - base) / (layers.height * together);
            PointBirth {
                time: layers.first + (layer + NEAR).floor() * layers.interval * together,
                point,
            }
        };
        self.points.iter().map(birth).collect()
    }

    /// Births by the bead that a toolpath leaves while it has power; points that it never covers have no birth. In 3D the bead
    /// lies along the axis of the torch that the path gives, or else along `torch` (unit vector into the material).
    pub(super) fn by_bead(
        &self,
        track: &Track,
        bead: &Bead,
        torch: Option<Vector3<f64>>,
    ) -> Vec<PointBirth> {
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
                        births.push(PointBirth { time, point });
                    }
                });
            }
        }
        births
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
                    let position = self.body.points.position.at(point);
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
