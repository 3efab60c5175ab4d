//! Colours between points: cells are divided into pieces so small that no edges are seen.

use crate::colour::Colour;

/// Pieces of a cell are at most this wide, pixels.
const PIECE: f64 = 2.0;

/// Most pieces along an edge of a cell.
const MOST: usize = 32;

/// Visits the pieces of one colour of a cell with these corners (pixels) and values, as [`cell_values`] gives them. Lines of
/// constant colour are those of the isotherms: the values are the same.
///
/// [`cell_values`]: crate::contour::cell_values
pub(crate) fn visit_pieces(
    corners: [[f64; 2]; 4],
    values: [[f64; 3]; 3],
    colour: impl Fn(f64) -> Colour,
    mut visit: impl FnMut([[f64; 2]; 4], Colour),
) {
    let pieces = pieces(corners);
    let part = |n: usize| n as f64 / pieces as f64;
    let middle = |n: usize| (n as f64 + 0.5) / pieces as f64;
    for row in 0..pieces {
        let colours = (0..pieces).map(|n| colour(interpolated(values, [middle(n), middle(row)])));
        let colours: Vec<Colour> = colours.collect();
        let mut start = 0;
        // neighbours of one colour in one piece
        for same in colours.chunk_by(|a, b| a == b) {
            let [left, right] = [start, start + same.len()].map(part);
            let [low, high] = [row, row + 1].map(part);
            let piece = [[left, low], [right, low], [right, high], [left, high]];
            visit(piece.map(|at| between(corners, at)), same[0]);
            start += same.len();
        }
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
    use super::*;
    use crate::contour::cell_values;
    use crate::section::Raster;

    #[test]
    fn values_between_points_follow_a_linear_field() {
        let field = |[x, y]: [f64; 2]| 300.0 + 200.0 * x - 50.0 * y;
        let mut raster = Raster::of(4, field);
        // inside of the surface, where values are extrapolated by the law of faces without gradient
        let values = cell_values(&raster, [1, 2]).expect("a value");
        let [x, y] = raster.centre([1, 2]);
        for [u, v] in [[0.1, 0.2], [0.5, 0.5], [0.9, 0.3], [0.0, 1.0]] {
            // rounding only
            let place = [x + 0.1 * (u - 0.5), y + 0.1 * (v - 0.5)];
            let error = interpolated(values, [u, v]) - field(place);
            assert!(error.abs() < 1e-9, "{u} {v}: {error}");
        }
        raster.values[9] = f64::NAN;
        assert!(cell_values(&raster, [1, 2]).is_none());
    }

    fn square(a: f64) -> [[f64; 2]; 4] {
        [[0.0, 0.0], [a, 0.0], [a, a], [0.0, a]]
    }

    #[test]
    fn pieces_are_even_and_small() {
        assert_eq!([1.0, 9.0, 500.0].map(|a| pieces(square(a))), [2, 6, MOST]);
    }

    #[test]
    fn pieces_cover_the_cell_once() {
        // two colours, left and right of the middle
        let values = [[0.0; 3], [0.5; 3], [1.0; 3]];
        let (mut area, mut left) = ([0.0; 2], [9.0; 2]);
        let colour = |value: f64| [u8::from(value > 0.5); 3];
        visit_pieces(square(9.0), values, colour, |[a, _, c, _], [side, ..]| {
            let side = usize::from(side);
            area[side] += (c[0] - a[0]) * (c[1] - a[1]);
            left[side] = a[0].min(left[side]);
        });
        // rounding only
        assert!(
            area.iter().all(|area| (area - 40.5).abs() < 1e-9),
            "{area:?}"
        );
        assert_eq!(left, [0.0, 4.5]);
        let bent = [[0.0; 3], [0.0; 3], [1.0; 3]];
        assert_eq!(
            [0.25, 0.625].map(|u| interpolated(bent, [u, 0.2])),
            [0.0, 0.25]
        );
    }
}
