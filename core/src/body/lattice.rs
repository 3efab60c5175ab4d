//! Bodies on one uniform grid of cells.

use std::sync::Arc;

use nalgebra::Vector3;

use super::{
    Body, BodyError, Discretisation, Face, Points, Positions, Same, Sizes, bounded, positive,
};
use crate::shape::{Bounds, Shape};

/// Marks a lattice cell without a point.
pub const NO_POINT: u32 = u32::MAX;

/// Uniform grid of cubic cells; points sit at the centres of the cells inside the body. Cells and points are numbered with x running fastest.
#[derive(Clone, Debug)]
pub struct Lattice {
    /// Lower corner of cell (0, 0, 0), m.
    pub origin: Vector3<f64>,
    /// Edge of a cell, m.
    pub spacing: f64,
    /// Number of cells along x, y, z (1 along axes that the body's dimension leaves out).
    pub cells: [usize; 3],
    /// `None` where every cell holds the point of the same number.
    numbering: Option<Numbering>,
    /// The lattice of the whole body, where the points are those of a part.
    pub(super) whole: Option<Arc<Lattice>>,
}

/// Which cells hold points.
#[derive(Clone, Debug)]
struct Numbering {
    /// Number of the point in each cell, [`NO_POINT`] where there is no material.
    point_of_cell: Vec<u32>,
    /// Number of the cell of each point.
    cell_of_point: Vec<u32>,
}

impl Numbering {
    /// Points in these of `cells` cells.
    fn new(cells: usize, cell_of_point: Vec<u32>) -> Self {
        let mut point_of_cell = vec![NO_POINT; cells];
        for (point, cell) in (0..).zip(&cell_of_point) {
            point_of_cell[*cell as usize] = point;
        }
        Numbering {
            point_of_cell,
            cell_of_point,
        }
    }
}

impl Lattice {
    /// The lattice of the whole body, with the numbers that its points have there; this one where the points are not those of a part.
    pub fn whole(&self) -> &Lattice {
        self.whole.as_deref().unwrap_or(self)
    }

    /// Number of points.
    pub fn points(&self) -> usize {
        match &self.numbering {
            Some(numbering) => numbering.cell_of_point.len(),
            None => self.cell_count(),
        }
    }

    /// Memory, bytes.
    pub fn memory(&self) -> usize {
        self.numbering.as_ref().map_or(0, |numbering| {
            size_of_val(&*numbering.point_of_cell) + size_of_val(&*numbering.cell_of_point)
        })
    }

    fn cell_count(&self) -> usize {
        self.cells.iter().product()
    }

    /// Cell of a point.
    #[inline]
    pub fn cell(&self, point: usize) -> [u32; 3] {
        self.cell_numbered(match &self.numbering {
            Some(numbering) => numbering.cell_of_point[point],
            None => point as u32,
        })
    }

    /// Cells of all points, in their order.
    pub fn cells_of_points(&self) -> impl ExactSizeIterator<Item = [u32; 3]> + Clone {
        (0..self.points()).map(|point| self.cell(point))
    }

    #[inline]
    fn cell_numbered(&self, number: u32) -> [u32; 3] {
        let [nx, ny] = [self.cells[0] as u32, self.cells[1] as u32];
        let row = number / nx;
        [number % nx, row % ny, row / ny]
    }

    /// The lattice with some of the points of this one, in this order.
    pub(super) fn subset(self: &Arc<Self>, points: &[u32]) -> Lattice {
        let cell = |point: &u32| match &self.numbering {
            Some(numbering) => numbering.cell_of_point[*point as usize],
            None => *point,
        };
        let cells = points.iter().map(cell).collect();
        Lattice {
            numbering: Some(Numbering::new(self.cell_count(), cells)),
            whole: Some(self.clone()),
            ..**self
        }
    }

    /// Centre of a cell, m.
    pub fn centre(&self, cell: [u32; 3]) -> Vector3<f64> {
        self.origin + Vector3::from(cell.map(|c| (f64::from(c) + 0.5) * self.spacing))
    }

    /// Whether a point lies in the layer of cells at a face.
    pub fn reaches(&self, face: Face) -> bool {
        let this = self.whole();
        let axis = face.axis();
        let last = match face.is_upper() {
            true => self.cells[axis] as u32 - 1,
            false => 0,
        };
        this.numbering.is_none() || this.cells_of_points().any(|cell| cell[axis] == last)
    }

    /// Point in the cell with the given (possibly outside) indices.
    pub fn point(&self, cell: [i64; 3]) -> Option<usize> {
        if (0..3).any(|a| cell[a] < 0 || cell[a] >= self.cells[a] as i64) {
            return None;
        }
        let [i, j, k] = cell.map(|c| c as usize);
        let cell = (k * self.cells[1] + j) * self.cells[0] + i;
        let Some(numbering) = &self.numbering else {
            return Some(cell);
        };
        let point = numbering.point_of_cell[cell];
        (point != NO_POINT).then_some(point as usize)
    }

    /// The point in the cell behind a face of a point's cell; the last cell along a periodic axis has the first one behind it.
    pub(super) fn neighbour(&self, point: usize, face: Face, periodic: [bool; 3]) -> Option<usize> {
        let (cell, step) = (self.cell(point), face.step());
        self.point(std::array::from_fn(|a| {
            let at = i64::from(cell[a]) + step[a];
            match periodic[a] {
                true => at.rem_euclid(self.cells[a] as i64),
                false => at,
            }
        }))
    }

    pub(super) fn bounds(&self) -> Bounds {
        let extent = Vector3::from(self.cells.map(|c| c as f64 * self.spacing));
        (self.origin, self.origin + extent)
    }

    /// Whether every cell holds a point.
    pub fn is_full(&self) -> bool {
        self.whole().numbering.is_none()
    }
}

impl Body {
    /// Fills `shape` with the centres of cubic cells of edge `spacing` (m). The cells are
    /// aligned with the lower corner of the bounding box; a cell belongs to the body when
    /// its centre lies inside. 1D and 2D bodies lie at the middle of the bounding box in
    /// the missing axes, so that `thickness` need not agree with the shape.
    ///
    /// # Errors
    /// [`BodyError`] when the shape contains no cell centre or a number is out of range.
    pub fn fill(
        name: &str,
        shape: &Shape,
        dimension: usize,
        spacing: f64,
        thickness: f64,
    ) -> Result<Body, BodyError> {
        positive("spacing", spacing)?;
        let (min, max) = bounded(shape, dimension, thickness)?;
        let extent: [f64; 3] = (max - min).into();
        let no_points = || BodyError::NoPoints { extent, spacing };
        let mut cells = [1; 3];
        let mut origin = (min + max) / 2.0 - Vector3::repeat(spacing / 2.0);
        for axis in 0..dimension {
            // a cell is kept when its centre is inside; a thousandth covers rounding of the quotient
            let count = (extent[axis] / spacing + 0.5 + 1e-3).floor();
            if count < 1.0 {
                return Err(no_points());
            }
            if count > 4e9 {
                return Err(BodyError::TooManyPoints(count));
            }
            cells[axis] = count as usize;
            origin[axis] = min[axis];
        }
        let total: f64 = cells.iter().map(|&c| c as f64).product();
        if total >= f64::from(NO_POINT) {
            return Err(BodyError::TooManyPoints(total));
        }

        let mut lattice = Lattice {
            origin,
            spacing,
            cells,
            numbering: None,
            whole: None,
        };
        let tolerance = 1e-6 * spacing;
        let is_inside =
            |cell: &u32| shape.contains(&lattice.centre(lattice.cell_numbered(*cell)), tolerance);
        if !(0..total as u32).all(|cell| is_inside(&cell)) {
            let inside: Vec<u32> = (0..total as u32).filter(is_inside).collect();
            if inside.is_empty() {
                return Err(no_points());
            }
            lattice.numbering = Some(Numbering::new(total as usize, inside));
        }
        let depth = if dimension == 3 { 1.0 } else { thickness };
        let count = lattice.points();
        let same = |value: f64| Sizes::by(Same { value, count });
        let lattice = Arc::new(lattice);
        let points = Points {
            position: Positions::by(lattice.clone()),
            volume: same(spacing.powi(dimension as i32) * depth),
            spacing: same(spacing),
            horizon_factor: Vec::new(),
        };
        let discretisation = Discretisation::Lattice(lattice);
        Ok(Body::new(name, dimension, thickness, points, discretisation).outlined(shape))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shape::{BoxShape, Sphere};

    fn block(max: [f64; 3], dimension: usize, spacing: f64, thickness: f64) -> Body {
        let shape = Shape::Box(BoxShape { min: [0.0; 3], max });
        Body::fill("block", &shape, dimension, spacing, thickness).expect("a valid block")
    }

    #[test]
    fn points_are_cell_centred_and_fill_the_volume() {
        for (dimension, thickness, volume) in [(1, 0.5, 1.5), (2, 0.1, 0.6), (3, 1.0, 6.0)] {
            let body = block([3.0, 2.0, 1.0], dimension, 0.25, thickness);
            assert!((body.points.volume.iter().sum::<f64>() - volume).abs() < 1e-12);
            assert_eq!(body.points.position.at(0).x, 0.125);
        }
    }

    #[test]
    fn rounding_of_the_quotient_loses_no_row() {
        assert_eq!(
            block([0.1, 0.1, 0.01], 3, 4e-4, 1.0)
                .lattice()
                .map(|l| l.cells),
            Some([250, 250, 25])
        );
    }

    #[test]
    fn a_sphere_has_its_volume_and_a_closed_surface() {
        let shape = Shape::Sphere(Sphere {
            centre: [0.0; 3],
            radius: 1.0,
        });
        let ball = Body::fill("ball", &shape, 3, 0.05, 1.0).expect("a valid ball");
        let volume: f64 = ball.points.volume.iter().sum();
        assert!(
            (volume / 4.18879 - 1.0).abs() < 0.01,
            "staircase volume within 1 %: {volume}"
        );
        let net: Vector3<f64> = ball
            .surface(&Face::ALL)
            .iter()
            .map(|s| s.face.normal() * s.face_area)
            .sum();
        assert!(net.norm() < 1e-12, "the normals of a closed surface cancel");
    }

    #[test]
    fn a_body_thinner_than_half_a_cell_is_refused() {
        let shape = Shape::Box(BoxShape {
            min: [0.0; 3],
            max: [1.0, 1.0, 0.1],
        });
        assert!(matches!(
            Body::fill("film", &shape, 3, 0.3, 1.0),
            Err(BodyError::NoPoints { .. })
        ));
    }
}
