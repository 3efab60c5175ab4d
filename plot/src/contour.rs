//! Isotherms: lines of constant value on a raster, by marching squares.
//!
//! Each cell is divided into four squares, whose corners are its centre, the middles of two faces and a corner of the cell.
//! At a face between two cells the value is their mean. At a face of the surface it goes to `(9 v1 - v2) / 8`, the surface
//! value of a face without gradient, so that lines reach the outer faces and those of cut corners alike.

use std::collections::{HashMap, VecDeque};

use crate::section::Raster;

/// End points of a piece of a line, m.
pub(crate) type Segment = [[f64; 2]; 2];

/// The squares of a cell: on which side of its centre they lie, counter-clockwise.
const SQUARES: [[i64; 2]; 4] = [[-1, -1], [1, -1], [1, 1], [-1, 1]];

/// Lines `value = level`; cells without a finite value have none.
pub(crate) fn contour(raster: &Raster, level: f64) -> Vec<Vec<[f64; 2]>> {
    joined(&segments(raster, level))
}

/// Pieces of the line `value = level`.
fn segments(raster: &Raster, level: f64) -> Vec<Segment> {
    let mut segments = Vec::new();
    let [nx, ny] = raster.cells;
    for cell in (0..ny).flat_map(|j| (0..nx).map(move |i| [i, j])) {
        let Some(values) = cell_values(raster, cell) else {
            continue;
        };
        for [x, y] in SQUARES {
            let mut corners = [[0, 0], [x, 0], [x, y], [0, y]];
            if x != y {
                corners.swap(1, 3);
            }
            let values = corners.map(|[x, y]| values[(x + 1) as usize][(y + 1) as usize]);
            let centre = raster.centre(cell);
            let place = |corner: [i64; 2]| {
                let half = 0.5 * raster.spacing;
                [0, 1].map(|axis| centre[axis] + half * corner[axis] as f64)
            };
            march(corners.map(place), values, level, &mut segments);
        }
    }
    segments
}

/// Adds the pieces of the line in a square, given by its corners (m, counter-clockwise) and their values.
fn march(corners: [[f64; 2]; 4], values: [f64; 4], level: f64, segments: &mut Vec<Segment>) {
    let crossing = |edge: usize| {
        let (a, b) = (edge, (edge + 1) % 4);
        let fraction = (level - values[a]) / (values[b] - values[a]);
        let (from, to) = (corners[a], corners[b]);
        [0, 1].map(|axis| from[axis] + fraction * (to[axis] - from[axis]))
    };
    let is_above = values.map(|value| value >= level);
    let edges: Vec<usize> = (0..4)
        .filter(|&edge| is_above[edge] != is_above[(edge + 1) % 4])
        .collect();
    match edges[..] {
        [a, b] => segments.push([crossing(a), crossing(b)]),
        [_, _, _, _] => {
            // a saddle: the mean value determines which corners are joined
            let mean_above = values.iter().sum::<f64>() / 4.0 >= level;
            let pairs = if mean_above == is_above[0] {
                [(0, 1), (2, 3)]
            } else {
                [(3, 0), (1, 2)]
            };
            segments.extend(pairs.map(|(a, b)| [crossing(a), crossing(b)]));
        }
        _ => {}
    }
}

/// The value of a cell; `None` outside of the material.
fn finite(raster: &Raster, [i, j]: [i64; 2]) -> Option<f64> {
    let [nx, ny] = raster.cells.map(|count| count as i64);
    let is_inside = (0..nx).contains(&i) && (0..ny).contains(&j);
    let value = is_inside.then(|| raster.value([i as usize, j as usize]))?;
    value.is_finite().then_some(value)
}

/// The value of a cell, if it belongs to the same surface as another one beside it: a view from above shows parts of
/// different height.
fn beside(raster: &Raster, from: [i64; 2], to: [i64; 2]) -> Option<f64> {
    let value = finite(raster, to)?;
    let height = |[i, j]: [i64; 2]| raster.heights[j as usize * raster.cells[0] + i as usize];
    (height(from).abs_diff(height(to)) <= 1).then_some(value)
}

/// Value in the middle of the face of a cell on a side of an axis.
fn face_value(raster: &Raster, cell: [i64; 2], axis: usize, side: i64) -> f64 {
    let Some(value) = finite(raster, cell) else {
        return f64::NAN;
    };
    let neighbour = |side: i64| {
        let mut other = cell;
        other[axis] += side;
        beside(raster, cell, other)
    };
    match (neighbour(side), neighbour(-side)) {
        (Some(next), _) => 0.5 * (value + next),
        (None, Some(opposite)) => value + (value - opposite) / 8.0,
        (None, None) => value,
    }
}

/// Values at the corners, in the middles of the faces and in the centre of a cell, by their side of the centre (-1, 0, 1) plus 1
/// along both axes; `None` for a cell without a finite value.
pub(crate) fn cell_values(raster: &Raster, [i, j]: [usize; 2]) -> Option<[[f64; 3]; 3]> {
    let cell = [i as i64, j as i64];
    let centre = finite(raster, cell)?;
    let value = |x: i64, y: i64| match [x, y] {
        [0, 0] => centre,
        [x, 0] => face_value(raster, cell, 0, x),
        [0, y] => face_value(raster, cell, 1, y),
        corner => corner_value(raster, cell, corner),
    };
    Some([-1, 0, 1].map(|x| [-1, 0, 1].map(|y| value(x, y))))
}

/// Value in a corner of a cell: the mean of what the cells around it extrapolate.
fn corner_value(raster: &Raster, cell: [i64; 2], [x, y]: [i64; 2]) -> f64 {
    // in the order of the raster, so that all of these cells find the same sum
    let sides = |side: i64| if side < 0 { [-1, 0] } else { [0, 1] };
    let around = sides(y).into_iter().flat_map(|j| sides(x).map(|i| [i, j]));
    let extrapolated = around.filter_map(|[i, j]| {
        let other = [cell[0] + i, cell[1] + j];
        let value = beside(raster, cell, other)?;
        // the side of that cell on which the corner lies
        let [x, y] = [x - 2 * i, y - 2 * j];
        Some(face_value(raster, other, 0, x) + face_value(raster, other, 1, y) - value)
    });
    let (sum, count) = extrapolated.fold((0.0, 0.0), |(sum, n), v| (sum + v, n + 1.0));
    sum / count
}

/// Pieces joined end to end into as few lines as possible.
fn joined(segments: &[Segment]) -> Vec<Vec<[f64; 2]>> {
    // both squares beside an edge compute its crossing from the same two values, but in opposite
    // directions, so ends agree to rounding only
    let coordinates = segments.iter().flatten().flatten();
    let size = coordinates.fold(0.0_f64, |size, x| size.max(x.abs()));
    let grain = size.max(f64::MIN_POSITIVE) * 1e-9;
    let key = |point: [f64; 2]| point.map(|x| (x / grain).round() as i64);
    let mut ends: HashMap<[i64; 2], Vec<usize>> = HashMap::new();
    for (index, segment) in segments.iter().enumerate() {
        for end in segment {
            ends.entry(key(*end)).or_default().push(index);
        }
    }
    let mut used = vec![false; segments.len()];
    // the far end of an unused piece that begins or ends at a point
    let next = |used: &mut [bool], end: [f64; 2]| {
        let mut beside = ends.get(&key(end)).into_iter().flatten();
        let &next = beside.find(|&&index| !used[index])?;
        used[next] = true;
        let [a, b] = segments[next];
        Some(if key(a) == key(end) { b } else { a })
    };
    let mut lines = Vec::new();
    for start in 0..segments.len() {
        if std::mem::replace(&mut used[start], true) {
            continue;
        }
        let mut line = VecDeque::from(segments[start]);
        while let Some(end) = next(&mut used, line[line.len() - 1]) {
            line.push_back(end);
        }
        while let Some(end) = next(&mut used, line[0]) {
            line.push_front(end);
        }
        lines.push(line.into());
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn contour_of_a_cone_is_one_closed_circle() {
        let lines = contour(&Raster::of(41, |[x, y]| 2.0 - x.hypot(y)), 0.55);
        assert_eq!(lines.len(), 1);
        assert!((lines[0][0][0] - lines[0][lines[0].len() - 1][0]).abs() < 1e-6);
        for [x, y] in &lines[0] {
            assert!(x.abs() < 1.9 && y.abs() < 1.9);
            // linear interpolation across a circle of radius r: dx^2 / (8 r)
            assert!((x.hypot(*y) - 1.45).abs() < 0.1 * 0.1 / (8.0 * 1.45) * 1.5);
        }
    }

    #[test]
    fn the_mean_of_a_saddle_determines_which_sides_are_joined() {
        // a square between the centre and the corner of a cell, 1 and 0.75, and the middles of two faces, 0.5
        let mut raster = Raster::of(2, |_| 0.0);
        raster.values = vec![1.0, 0.0, 0.0, 2.0];
        for (level, are_joined) in [(0.6, true), (0.7, false)] {
            let lines = contour(&raster, level);
            // beside the diagonal through both warm cells, or across it
            let is_beside = |line: &Vec<[f64; 2]>| {
                line.iter().all(|[x, y]| x > y) || line.iter().all(|[x, y]| x < y)
            };
            assert_eq!(lines.len(), 2, "{lines:?}");
            assert_eq!(lines.iter().all(is_beside), are_joined, "{lines:?}");
        }
        assert!(contour(&raster, 3.0).is_empty());
    }

    /// Ends of the only line, sorted.
    fn ends(raster: &Raster, level: f64) -> [[f64; 2]; 2] {
        let lines = contour(raster, level);
        assert_eq!(lines.len(), 1, "{lines:?}");
        let line = &lines[0];
        let mut ends = [line[0], line[line.len() - 1]];
        ends.sort_by(|a, b| a[1].total_cmp(&b[1]));
        ends
    }

    #[test]
    fn lines_reach_the_faces_of_cut_corners() {
        // material below y = 0 at x < 0, and below y = 0.5 at x > 0
        let is_there = |[x, y]: [f64; 2]| y < if x < 0.0 { 0.0 } else { 0.5 };
        let value = |place: [f64; 2]| if is_there(place) { place[0] } else { f64::NAN };
        let raster = Raster::of(20, value);
        for (level, top) in [(-0.33, 0.0), (0.42, 0.5)] {
            let [low, high] = ends(&raster, level);
            let close =
                |[x, y]: [f64; 2], end: f64| (x - level).abs() < 1e-9 && (y - end).abs() < 1e-9;
            assert!(close(low, -1.0) && close(high, top), "{low:?} {high:?}");
        }
    }

    #[test]
    fn lines_end_where_the_surface_seen_from_above_jumps() {
        // a hot ledge beside a cold web that is 5 cells higher
        let mut raster = Raster::of(20, |[x, y]| if x > 0.0 { 0.0 } else { 1.0 - y.abs() });
        let mut lines = |web: usize, ledge: usize| {
            let height = |cell: usize| if cell % 20 < 10 { ledge } else { web };
            raster.heights = (0..400).map(height).collect();
            contour(&raster, 0.52)
        };
        let at_web = |line: &Vec<[f64; 2]>| line.iter().any(|[x, _]| x.abs() < 1e-9);
        let of_jump = lines(6, 1);
        assert!(
            of_jump.len() == 2 && of_jump.iter().all(at_web),
            "{of_jump:?}"
        );
        // over a step of one cell the line goes on: around the end of the ledge
        assert_eq!(lines(1, 0).len(), 1);
    }
}
