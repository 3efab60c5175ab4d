//! Bodies whose points have individual spacings.

use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Body, BodyError, Discretisation, Face, Points};
use crate::cell_list::CellList;
use crate::shape::Bounds;

/// Rounding of cell edges, in spacings.
const NEAR: f64 = 1e-6;

/// Samples along each edge of a cell face.
const SAMPLES: i32 = 4;

/// The cells of points with individual spacings.
#[derive(Clone, Debug)]
pub struct Cloud {
    /// Centre of the cell of each point, m; the point itself may be displaced.
    centre: Vec<Vector3<f64>>,
    bounds: Bounds,
    /// Cells are extended by this many spacings to each side, since the cells of a table leave gaps.
    slack: f64,
    pub(super) list: CellList,
    /// Of some points of a body: what is true of all of them.
    pub(super) whole: Option<WholeCloud>,
}

/// What is true of all points of a body of which a process has some.
#[derive(Clone, Copy, Debug)]
pub(super) struct WholeCloud {
    /// Whether their cells fill the box of the body.
    pub(super) fills_box: bool,
    /// Smallest and largest spacing, m.
    pub(super) spacings: [f64; 2],
}

/// Random displacement of points.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Jitter {
    /// Largest displacement along each axis, in spacings of the point, below 0.5.
    #[schemars(extend("minimum" = 0, "exclusiveMaximum" = 0.5))]
    pub amplitude: f64,
    /// Seed of the random numbers: equal seeds give equal displacements.
    #[serde(default)]
    pub seed: u64,
}

impl Cloud {
    /// Cubes of edge `spacing` (m) around `centre`; also along missing axes.
    fn new(centre: Vec<Vector3<f64>>, spacing: &[f64], slack: f64) -> Cloud {
        let cells = || centre.iter().zip(spacing);
        let low = cells().map(|(c, s)| c.add_scalar(-0.5 * s));
        let high = cells().map(|(c, s)| c.add_scalar(0.5 * s));
        let start = Vector3::repeat(f64::INFINITY);
        let bounds = (
            low.fold(start, |a, b| a.inf(&b)),
            high.fold(-start, |a, b| a.sup(&b)),
        );
        let half = 0.5 + slack + NEAR;
        let reach: Vec<f64> = spacing.iter().map(|s| 3f64.sqrt() * half * s).collect();
        let list = CellList::new(&centre, &reach);
        Cloud {
            centre,
            bounds,
            slack,
            list,
            whole: None,
        }
    }

    /// Some of the cells, between the same bounds.
    pub(super) fn subset(
        &self,
        centre: Vec<Vector3<f64>>,
        spacing: &[f64],
        whole: WholeCloud,
    ) -> Cloud {
        Cloud {
            bounds: self.bounds,
            whole: Some(whole),
            ..Cloud::new(centre, spacing, self.slack)
        }
    }

    pub(super) fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// Centre of the cell of each point, m.
    pub fn centres(&self) -> &[Vector3<f64>] {
        &self.centre
    }

    /// Whether the cells form a grid and touch without gaps, unlike those of a table.
    pub fn is_tiled(&self) -> bool {
        self.slack == 0.0
    }

    /// The point, other than `except`, whose cell contains a position (m); the nearest in its spacings, if several
    /// do.
    pub(super) fn point_at(
        &self,
        spacing: &[f64],
        at: &Vector3<f64>,
        except: Option<usize>,
    ) -> Option<usize> {
        let mut best: Option<(usize, f64)> = None;
        self.list.visit_near(at, 0.0, |p| {
            let away = (at - self.centre[p]).amax() / spacing[p];
            let nearer = best.is_none_or(|(q, b)| away < b || away == b && p < q);
            if Some(p) != except && nearer && away <= 0.5 + self.slack + NEAR {
                best = Some((p, away));
            }
        });
        best.map(|(point, _)| point)
    }

    /// The point whose cell lies just behind a face, `across` half spacings from its middle.
    pub(super) fn behind(
        &self,
        spacing: &[f64],
        point: usize,
        face: Face,
        across: [f64; 3],
    ) -> Option<usize> {
        let size = spacing[point];
        // cells of a table leave gaps between their faces
        let beyond = 0.5 + 1e-3 + self.slack;
        let offset = beyond * face.normal() + 0.5 * Vector3::from(across);
        let at = self.centre[point] + size * offset;
        self.point_at(spacing, &at, Some(point))
    }

    /// Bare fraction of a cell face, by samples.
    pub(super) fn bare_fraction(
        &self,
        dimension: usize,
        spacing: &[f64],
        point: usize,
        face: Face,
    ) -> f64 {
        let across = |axis: usize| axis < dimension && axis != face.axis();
        let samples = |axis: usize| if across(axis) { SAMPLES } else { 1 };
        let place =
            |axis: usize, i: i32| f64::from(2 * i + 1 - samples(axis)) / f64::from(samples(axis));
        let (mut bare, mut all) = (0, 0);
        for k in 0..samples(2) {
            for j in 0..samples(1) {
                for i in 0..samples(0) {
                    let at = [place(0, i), place(1, j), place(2, k)];
                    all += 1;
                    bare += i32::from(self.behind(spacing, point, face, at).is_none());
                }
            }
        }
        f64::from(bare) / f64::from(all)
    }
}

impl Body {
    /// The body as a cloud whose points are displaced at random within their cells; volumes are unchanged.
    /// With an amplitude of 0 points are not displaced.
    ///
    /// # Errors
    /// [`BodyError::Jitter`] for an amplitude with which points leave their cells.
    pub fn jittered(mut self, jitter: Jitter) -> Result<Body, BodyError> {
        if !(0.0..0.5).contains(&jitter.amplitude) {
            return Err(BodyError::Jitter(jitter.amplitude));
        }
        if let Discretisation::Lattice(_) = self.discretisation {
            (self.points, self.discretisation) = self.points.into_cloud(0.0);
        }
        let mut random = SplitMix(jitter.seed);
        for (x, size) in self.points.position.iter_mut().zip(&self.points.spacing) {
            for axis in 0..self.dimension {
                x[axis] += jitter.amplitude * size * random.next();
            }
        }
        Ok(self)
    }
}

impl Points {
    /// In spatial order, and as a cloud with the given slack.
    pub(super) fn into_cloud(self, slack: f64) -> (Points, Discretisation) {
        let mut order: Vec<u32> = (0..self.len() as u32).collect();
        Curve::of(&self).sort(&mut order, &self.position, |p| p);
        let points = self.reordered(&order);
        let cloud = Cloud::new(points.position.to_vec(), &points.spacing, slack);
        (points, Discretisation::Cloud(Box::new(cloud)))
    }

    fn reordered(&self, order: &[u32]) -> Points {
        let factor = |point: &u32| self.horizon_factor[*point as usize];
        Points {
            position: self.position.of(order),
            volume: self.volume.of(order),
            spacing: self.spacing.of(order),
            horizon_factor: match self.horizon_factor.is_empty() {
                true => Vec::new(),
                false => order.iter().map(factor).collect(),
            },
        }
    }
}

/// Cells of a Z-order curve along which points are sorted, so that families are contiguous in memory.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Curve {
    /// Lower corner of the first cell, m.
    low: Vector3<f64>,
    /// Width of a cell: the finest spacing, m.
    pub(crate) width: f64,
}

impl Curve {
    /// Through these points.
    pub(crate) fn of(points: &Points) -> Curve {
        Curve::through(points.position.each(), points.spacing.each())
    }

    /// Through points at these positions (m) with these spacings (m).
    pub(crate) fn through(
        positions: impl Iterator<Item = Vector3<f64>>,
        spacings: impl Iterator<Item = f64>,
    ) -> Curve {
        let none = Vector3::repeat(f64::INFINITY);
        Curve {
            low: positions.fold(none, |low, x| low.inf(&x)),
            width: spacings.fold(f64::INFINITY, f64::min),
        }
    }

    /// Sorts points by their cells, those of one cell by their numbers.
    pub(crate) fn sort(
        &self,
        points: &mut [u32],
        position: &[Vector3<f64>],
        number: impl Fn(u32) -> u32,
    ) {
        points.sort_by_cached_key(|&p| (self.cell(&position[p as usize]), number(p)));
    }

    /// Number of the cell of a point along the curve.
    fn cell(&self, x: &Vector3<f64>) -> u64 {
        let cell = (x - self.low).map(|d| ((d / self.width + 0.5) as u64).min((1 << 21) - 1));
        (0..21).fold(0_u64, |code, bit| {
            let part = |axis: usize| (cell[axis] >> bit & 1) << (3 * bit + axis);
            code | part(0) | part(1) | part(2)
        })
    }
}

/// Splitmix64 (Steele, Lea and Flood, 2014).
struct SplitMix(u64);

impl SplitMix {
    /// Between -1 and 1.
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^= z >> 31;
        2.0 * ((z >> 11) as f64 / (1_u64 << 53) as f64) - 1.0
    }
}
