//! Parts of a body: the points that one process owns, and those of others around them.

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::Vector3;

use super::cloud::WholeCloud;
use super::{Body, Curve, Discretisation, Horizon, NO_POINT, Points, Positions, Region};

/// A part of a body: the points that it owns, then the *remote* ones around them that others own, each in the order of the whole
/// body. A family of a part ([`Family::of_part`](crate::Family::of_part)) has the bonds of the owned points, in the order in
/// which the whole body has them: sums over bonds have the bits of the whole body.
#[derive(Clone, Debug)]
pub struct Part {
    /// The points; faces, lattice and all else are those of the whole body.
    pub(crate) body: Body,
    pub(crate) owned: usize,
    pub(crate) numbers: Vec<u32>,
    /// That of the whole body.
    pub(crate) curve: Curve,
    /// Largest spacing in the whole body, m.
    pub(crate) coarsest: f64,
}

impl Part {
    /// The part that owns all points.
    pub(crate) fn whole(body: &Body) -> Part {
        Part {
            owned: body.points.len(),
            numbers: (0..body.points.len() as u32).collect(),
            curve: Curve::of(&body.points),
            coarsest: body.coarsest_spacing(),
            body: body.clone(),
        }
    }

    /// The part of `body` that owns the given points (ascending), for families of this horizon. Remote points are those up to
    /// three horizons, or a third more, from owned ones: the weights of a bond depend on the families of both ends, and which
    /// of them share the stencil on those of their members.
    ///
    /// # Panics
    /// When the part does not contain all points along a periodic axis.
    pub fn new(body: &Body, owned: &[u32], horizon: Horizon) -> Part {
        let reach = Part::reach(body, horizon);
        let near = Surroundings::of(owned, body, reach);
        let cut = near.cut_axis(body);
        assert!(cut.is_none(), "periodic axes are not cut");
        let mut numbers = owned.to_vec();
        let others = 0..body.points.len() as u32;
        let remote = others.filter(|p| owned.binary_search(p).is_err());
        let at = |point: &u32| body.points.position.at(*point as usize);
        numbers.extend(remote.filter(|p| near.contains(&at(p))));
        Part {
            body: body.subset(&numbers),
            owned: owned.len(),
            numbers,
            curve: Curve::of(&body.points),
            coarsest: body.coarsest_spacing(),
        }
    }

    /// Width of the cells by which surroundings are counted, m.
    fn reach(body: &Body, horizon: Horizon) -> f64 {
        let horizons = body.points.horizons(horizon);
        horizons.into_iter().fold(0.0, f64::max) + body.coarsest_spacing()
    }

    /// A periodic axis along which the part of `body` that owns these points would not have all points.
    pub(crate) fn cut_axis(body: &Body, owned: &[u32], horizon: Horizon) -> Option<usize> {
        let reach = Part::reach(body, horizon);
        let is_periodic = body.periodic.contains(&true);
        let near = is_periodic.then(|| Surroundings::of(owned, body, reach))?;
        near.cut_axis(body)
    }

    /// The points, owned ones first, and their numbers in the whole body.
    pub(crate) fn into_points(self) -> (Body, Vec<u32>) {
        (self.body, self.numbers)
    }

    /// Number of owned points.
    pub fn owned(&self) -> usize {
        self.owned
    }

    /// Number in the whole body of each point.
    pub fn numbers(&self) -> &[u32] {
        &self.numbers
    }
}

/// The cells of a coarse grid in which points lie, or up to three cells away from them.
struct Surroundings {
    low: Vector3<f64>,
    /// Width of a cell, m.
    width: f64,
    cells: [usize; 3],
    is_near: Vec<bool>,
}

impl Surroundings {
    /// Most cells along an axis.
    const MOST: f64 = 1024.0;

    /// Those of some points of a body, on cells of the width `reach` (m) or wider.
    fn of(points: &[u32], body: &Body, reach: f64) -> Self {
        let mut all = body.points.position.each();
        let first = all.next().unwrap_or_default();
        let (low, high) = all.fold((first, first), |(low, high), x| (low.inf(&x), high.sup(&x)));
        let width = reach.max((high - low).max() / Self::MOST);
        let cells = [0, 1, 2].map(|axis| ((high - low)[axis] / width) as usize + 1);
        let mut surroundings = Surroundings {
            low,
            width,
            cells,
            is_near: vec![false; cells.iter().product()],
        };
        for point in points {
            let cell = surroundings.cell(&body.points.position.at(*point as usize));
            surroundings.is_near[cell] = true;
        }
        (0..3).for_each(|axis| surroundings.widen(axis));
        surroundings
    }

    fn cell(&self, position: &Vector3<f64>) -> usize {
        let [i, j, k] = [0, 1, 2].map(|axis| {
            let cell = ((position[axis] - self.low[axis]) / self.width) as usize;
            cell.min(self.cells[axis] - 1)
        });
        i + self.cells[0] * (j + self.cells[1] * k)
    }

    /// Adds three cells on both sides along an axis.
    fn widen(&mut self, axis: usize) {
        let stride: usize = self.cells[..axis].iter().product();
        let count = self.cells[axis];
        let before = self.is_near.clone();
        for (cell, is_near) in self.is_near.iter_mut().enumerate() {
            let along = cell / stride % count;
            let (first, last) = (along.saturating_sub(3), (along + 3).min(count - 1));
            let mut beside = (first..=last).map(|other| cell - along * stride + other * stride);
            *is_near = beside.any(|other| before[other]);
        }
    }

    /// A periodic axis of the body along which these are some of the cells only.
    fn cut_axis(&self, body: &Body) -> Option<usize> {
        (0..3).find(|axis| body.periodic[*axis] && !self.spans(*axis))
    }

    fn contains(&self, position: &Vector3<f64>) -> bool {
        self.is_near[self.cell(position)]
    }

    /// Whether all rows of cells along an axis with such a cell consist of them.
    fn spans(&self, axis: usize) -> bool {
        let stride: usize = self.cells[..axis].iter().product();
        let count = self.cells[axis];
        let first = (0..self.is_near.len()).filter(|cell| (cell / stride).is_multiple_of(count));
        let mut rows = first.map(|cell| (0..count).map(move |n| self.is_near[cell + n * stride]));
        rows.all(|mut row| {
            let value = row.next().unwrap_or(true);
            row.all(|other| other == value)
        })
    }
}

impl Body {
    /// The regions of a body of some of the points.
    fn regions_among(&self, numbers: &[u32]) -> BTreeMap<String, Region> {
        let mut place = vec![NO_POINT; self.points.len()];
        for (new, number) in (0..).zip(numbers) {
            place[*number as usize] = new;
        }
        let among = |region: &Region| {
            let points = region.points.iter().map(|point| place[*point as usize]);
            let mut points: Vec<u32> = points.filter(|point| *point != NO_POINT).collect();
            points.sort_unstable();
            Region { points }
        };
        let regions = self.regions.iter();
        regions
            .map(|(name, region)| (name.clone(), among(region)))
            .collect()
    }

    /// Some points of the body, in this order, in its box.
    fn subset(&self, numbers: &[u32]) -> Body {
        fn of<T: Copy>(values: &[T], numbers: &[u32]) -> Vec<T> {
            let some = numbers.iter().filter_map(|p| values.get(*p as usize));
            some.copied().collect()
        }
        let points = &self.points;
        let discretisation = match &self.discretisation {
            Discretisation::Lattice(lattice) => {
                Discretisation::Lattice(Arc::new(lattice.subset(numbers)))
            }
            Discretisation::Cloud(cloud) => {
                let spacing = points.spacing.of(numbers);
                let centres = of(cloud.centres(), numbers);
                let whole = WholeCloud {
                    fills_box: self.fills_box(),
                    spacings: [self.finest_spacing(), self.coarsest_spacing()],
                };
                Discretisation::Cloud(Box::new(cloud.subset(centres, &spacing, whole)))
            }
            // families of layers are those of their plane grid
            Discretisation::Layers(layers) => Discretisation::Layers(layers.clone()),
        };
        Body {
            points: Points {
                position: match &discretisation {
                    Discretisation::Lattice(lattice) if points.position.follow_rule() => {
                        Positions::by(lattice.clone())
                    }
                    _ => points.position.of(numbers),
                },
                volume: points.volume.subset(numbers),
                spacing: points.spacing.subset(numbers),
                horizon_factor: of(&points.horizon_factor, numbers),
            },
            discretisation,
            material_of_point: of(&self.material_of_point, numbers),
            regions: self.regions_among(numbers),
            ..self.clone()
        }
    }
}
