//! Parts of a body: the points that one process owns, and those of others around them.

use nalgebra::Vector3;

use super::{Body, Curve, Discretisation, Horizon, Lattice, NO_POINT, Points};

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
            curve: Curve::through(&body.points.position, &body.points.spacing),
            coarsest: body.coarsest_spacing(),
            body: body.clone(),
        }
    }

    /// The part of `body` that owns the given points (ascending), for families of this horizon. Remote points are those up to
    /// three horizons beyond the box of the owned ones: the weights of a bond depend on the families of both ends, and which
    /// of them share the stencil on those of their members.
    ///
    /// # Panics
    /// When the part does not contain all points along a periodic axis.
    pub fn new(body: &Body, owned: &[u32], horizon: Horizon) -> Part {
        let widest = body
            .points
            .horizons(horizon)
            .into_iter()
            .fold(0.0, f64::max);
        let margin = 3.0 * (widest + body.coarsest_spacing());
        let at = |point: &u32| body.points.position[*point as usize];
        let places = || owned.iter().map(at);
        let low = places().fold(Vector3::repeat(f64::INFINITY), |low, x| low.inf(&x));
        let high = places().fold(Vector3::repeat(f64::NEG_INFINITY), |high, x| high.sup(&x));
        let is_near = |axis: usize, x: &Vector3<f64>| {
            (low[axis] - margin..=high[axis] + margin).contains(&x[axis])
        };
        let periodic = (0..3).filter(|axis| body.periodic[*axis]);
        for axis in periodic {
            let mut all = body.points.position.iter();
            assert!(all.all(|x| is_near(axis, x)), "periodic axes are not cut");
        }
        let mut numbers = owned.to_vec();
        let others = 0..body.points.len() as u32;
        let remote = others.filter(|p| owned.binary_search(p).is_err());
        numbers.extend(remote.filter(|p| (0..3).all(|axis| is_near(axis, &at(p)))));
        Part {
            body: body.subset(&numbers),
            owned: owned.len(),
            numbers,
            curve: Curve::through(&body.points.position, &body.points.spacing),
            coarsest: body.coarsest_spacing(),
        }
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

impl Body {
    /// Some points of the body, in this order, in its box.
    fn subset(&self, numbers: &[u32]) -> Body {
        fn of<T: Copy>(values: &[T], numbers: &[u32]) -> Vec<T> {
            let some = numbers.iter().filter_map(|p| values.get(*p as usize));
            some.copied().collect()
        }
        let points = &self.points;
        let discretisation = match &self.discretisation {
            Discretisation::Lattice(lattice) => {
                let mut lattice = Lattice {
                    point_of_cell: vec![NO_POINT; lattice.point_of_cell.len()],
                    cell_of_point: of(&lattice.cell_of_point, numbers),
                    ..lattice.clone()
                };
                for (point, cell) in (0..).zip(&lattice.cell_of_point) {
                    let [i, j, k] = cell.map(|c| c as usize);
                    let [nx, ny, _] = lattice.cells;
                    lattice.point_of_cell[(k * ny + j) * nx + i] = point;
                }
                Discretisation::Lattice(lattice)
            }
            Discretisation::Cloud(cloud) => {
                let spacing = of(&points.spacing, numbers);
                Discretisation::Cloud(cloud.subset(of(cloud.centres(), numbers), &spacing))
            }
            // families of layers are those of their plane grid
            Discretisation::Layers(layers) => Discretisation::Layers(layers.clone()),
        };
        Body {
            points: Points {
                position: of(&points.position, numbers),
                volume: of(&points.volume, numbers),
                spacing: of(&points.spacing, numbers),
                horizon_factor: of(&points.horizon_factor, numbers),
            },
            discretisation,
            material_of_point: of(&self.material_of_point, numbers),
            regions: Default::default(),
            outline: None,
            ..self.clone()
        }
    }
}
