//! Isotherms: lines of constant value on a raster of cell centres, by marching squares.

use super::section::Raster;

/// End points of a piece of a line, m.
pub(crate) type Segment = [[f64; 2]; 2];

/// Pieces of the line `value = level`, linear between the centres of neighbouring cells. Between
/// the outermost centres and the faces of the raster, the value goes to the surface value
/// `(9 v1 - v2) / 8` of a face without gradient. Squares with an empty cell have none.
pub(crate) fn contour(raster: &Raster, level: f64) -> Vec<Segment> {
    let mut segments = Vec::new();
    for j in 1..raster.cells[1] + 2 {
        for i in 1..raster.cells[0] + 2 {
            // counter-clockwise
            let corners = [(i - 1, j - 1), (i, j - 1), (i, j), (i - 1, j)];
            let values = corners.map(|node| node_value(raster, node));
            if values.iter().any(|value| value.is_nan()) {
                continue;
            }
            let crossing = |edge: usize| {
                let (a, b) = (edge, (edge + 1) % 4);
                let fraction = (level - values[a]) / (values[b] - values[a]);
                let (from, to) = (
                    node_place(raster, corners[a]),
                    node_place(raster, corners[b]),
                );
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
    }
    segments
}

/// Place (m) of a node: 0 is the face, 1 the first centre, `cells + 1` the other face.
fn node_place(raster: &Raster, (i, j): (usize, usize)) -> [f64; 2] {
    let place = |axis: usize, node: usize| {
        let last = raster.cells[axis] as f64 - 0.5;
        raster.origin[axis] + (node as f64 - 1.0).clamp(-0.5, last) * raster.spacing
    };
    [place(0, i), place(1, j)]
}

/// Value at a node.
fn node_value(raster: &Raster, (i, j): (usize, usize)) -> f64 {
    let [nx, ny] = raster.cells;
    let along_row = |j: usize| at_node(i, nx, |i| raster.value(i, j));
    at_node(j, ny, along_row)
}

fn at_node(node: usize, count: usize, value: impl Fn(usize) -> f64) -> f64 {
    let (first, second) = match node {
        0 => (0, 1),
        node if node == count + 1 => (count - 1, count.wrapping_sub(2)),
        node => return value(node - 1),
    };
    if second < count {
        (9.0 * value(first) - value(second)) / 8.0
    } else {
        value(first)
    }
}

/// Pieces joined end to end into as few lines as possible.
pub(crate) fn joined(segments: &[Segment]) -> Vec<Vec<[f64; 2]>> {
    use std::collections::HashMap;
    // both squares beside an edge compute its crossing from the same two values, but in opposite
    // directions, so ends agree to rounding only
    let size = segments
        .iter()
        .flatten()
        .flatten()
        .fold(0.0_f64, |size, x| size.max(x.abs()));
    let grain = size.max(f64::MIN_POSITIVE) * 1e-9;
    let key = |point: [f64; 2]| point.map(|x| (x / grain).round() as i64);
    let mut ends: HashMap<[i64; 2], Vec<usize>> = HashMap::new();
    for (index, segment) in segments.iter().enumerate() {
        for end in segment {
            ends.entry(key(*end)).or_default().push(index);
        }
    }
    let mut used = vec![false; segments.len()];
    let mut lines = Vec::new();
    for start in 0..segments.len() {
        if used[start] {
            continue;
        }
        used[start] = true;
        let mut line = std::collections::VecDeque::from(segments[start]);
        for forwards in [true, false] {
            loop {
                let end = if forwards {
                    line[line.len() - 1]
                } else {
                    line[0]
                };
                let beside = ends.get(&key(end)).into_iter().flatten();
                let Some(&next) = beside.into_iter().find(|&&index| !used[index]) else {
                    break;
                };
                used[next] = true;
                let [a, b] = segments[next];
                let far = if key(a) == key(end) { b } else { a };
                if forwards {
                    line.push_back(far)
                } else {
                    line.push_front(far)
                }
            }
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
        let n = 41;
        let mut raster = Raster {
            origin: [-2.0, -2.0],
            spacing: 0.1,
            cells: [n, n],
            values: Vec::new(),
            points: Vec::new(),
        };
        for j in 0..n {
            for i in 0..n {
                let [x, y] = raster.centre((i, j));
                raster.values.push(2.0 - x.hypot(y));
            }
        }
        let lines = joined(&contour(&raster, 0.55));
        assert_eq!(lines.len(), 1);
        assert!((lines[0][0][0] - lines[0][lines[0].len() - 1][0]).abs() < 1e-6);
        for [x, y] in &lines[0] {
            assert!(x.abs() < 1.9 && y.abs() < 1.9);
            // linear interpolation across a circle of radius r: dx^2 / (8 r)
            assert!((x.hypot(*y) - 1.45).abs() < 0.1 * 0.1 / (8.0 * 1.45) * 1.5);
        }
    }
}
