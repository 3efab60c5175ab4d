//! Colours between points: cells are divided into pieces so small that no edges are seen.

use super::{
    colour::{Colour, GREY},
    contour::cell_values,
    picture::Picture,
    section::View,
    snapshot::{OVERLAP, Snapshot, widened},
};

/// Pieces of a cell are at most this wide, pixels.
const PIECE: f64 = 2.0;

/// Most pieces along an edge of a cell.
const MOST: usize = 32;

impl Snapshot<'_> {
    /// Draws a view with colours between points. Lines of constant colour are those of the isotherms: the values are the same.
    pub(super) fn draw_smooth(
        &self,
        picture: &mut Picture,
        view: &View,
        place: impl Fn([f64; 2]) -> [f64; 2],
    ) {
        self.visit_places(view, |cell, corners, _| {
            let corners = corners.map(&place);
            let values = cell_values(&view.raster, cell);
            let pieces = values.map_or(1, |_| pieces(corners));
            for row in 0..pieces {
                let colours: Vec<Colour> = (0..pieces)
                    .map(|column| {
                        let middle = |n: usize| (n as f64 + 0.5) / pieces as f64;
                        let value = values.map(|v| interpolated(v, [middle(column), middle(row)]));
                        value.map_or(GREY, |value| self.scale.colour(value))
                    })
                    .collect();
                // neighbours of one colour in one piece
                let mut start = 0;
                for end in 1..=pieces {
                    if end < pieces && colours[end] == colours[start] {
                        continue;
                    }
                    let part = |n: usize| n as f64 / pieces as f64;
                    let [[left, right], [low, high]] =
                        [[part(start), part(end)], [part(row), part(row + 1)]];
                    let piece = [[left, low], [right, low], [right, high], [left, high]];
                    let piece = piece.map(|at| between(corners, at));
                    if self.displacement.is_some() {
                        picture.area(widened(piece).into(), colours[start]);
                    } else {
                        let [[left, bottom], _, [right, top], _] = piece;
                        let corners = [[left, bottom], [right + OVERLAP, top - OVERLAP]];
                        picture.rectangle(corners, colours[start]);
                    }
                    start = end;
                }
            }
        });
    }
}

/// Number of pieces along an edge of a cell with these corners (pixels); even, so that no piece lies on both sides of the centre.
fn pieces(corners: [[f64; 2]; 4]) -> usize {
    let edge = |a: usize, b: usize| {
        let [a, b] = [corners[a], corners[b]];
        (b[0] - a[0]).hypot(b[1] - a[1])
    };
    let longest = edge(0, 1).max(edge(1, 2));
    2 * ((0.5 * longest / PIECE).ceil().max(1.0) as usize).min(MOST / 2)
}

/// The position in a cell with these corners, by fractions of its edges.
fn between(corners: [[f64; 2]; 4], [u, v]: [f64; 2]) -> [f64; 2] {
    let [a, b, c, d] = corners;
    [0, 1].map(|axis| {
        let low = a[axis] + u * (b[axis] - a[axis]);
        let high = d[axis] + u * (c[axis] - d[axis]);
        low + v * (high - low)
    })
}

/// The value at a place of a cell, given by parts of the way along its edges: bilinear in the quarter in which it lies.
fn interpolated(values: [[f64; 3]; 3], at: [f64; 2]) -> f64 {
    let quarter = at.map(|part| usize::from(part >= 0.5));
    let [u, v] = [0, 1].map(|axis| 2.0 * at[axis] - quarter[axis] as f64);
    let value = |x: usize, y: usize| values[quarter[0] + x][quarter[1] + y];
    let low = value(0, 0) + u * (value(1, 0) - value(0, 0));
    let high = value(0, 1) + u * (value(1, 1) - value(0, 1));
    low + v * (high - low)
}

#[cfg(test)]
mod tests {
    use super::super::section::Raster;
    use super::*;

    #[test]
    fn values_between_points_follow_a_linear_field() {
        let field = |[x, y]: [f64; 2]| 300.0 + 20.0 * x - 5.0 * y;
        let mut raster = Raster {
            origin: [0.0; 2],
            spacing: 1.0,
            cells: [4, 4],
            values: Vec::new(),
            points: Vec::new(),
            heights: vec![0; 16],
        };
        for j in 0..4 {
            for i in 0..4 {
                raster.values.push(field(raster.centre([i, j])));
            }
        }
        // inside of the surface, where values are extrapolated by the law of faces without gradient
        let values = cell_values(&raster, [1, 2]).expect("a value");
        for at in [[0.1, 0.2], [0.5, 0.5], [0.9, 0.3], [0.0, 1.0]] {
            let place = [1.0 + at[0] - 0.5, 2.0 + at[1] - 0.5];
            // rounding only
            let error = interpolated(values, at) - field(place);
            assert!(error.abs() < 1e-9, "{at:?}: {error}");
        }
        raster.values[9] = f64::NAN;
        assert!(cell_values(&raster, [1, 2]).is_none());
    }

    #[test]
    fn pieces_are_even_and_small() {
        let square = |a: f64| [[0.0, 0.0], [a, 0.0], [a, a], [0.0, a]];
        assert_eq!(pieces(square(1.0)), 2);
        assert_eq!(pieces(square(9.0)), 6);
        assert_eq!(pieces(square(500.0)), MOST);
    }
}
