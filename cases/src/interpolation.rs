//! A field between the points of a body: Lagrange interpolation on the lattice, a linear fit on a
//! cloud.
//!
//! Beyond the outermost points the field goes on as its mirror image at the face, so that the
//! value on a face is `(9 T1 - T2) / 8` from the two outermost points (cubic) or `T1` (linear).

use nalgebra::Vector3;
use perimelt_core::body::Discretisation;
use perimelt_core::{Body, SetupError};

use super::check::Interpolation;

/// Points and weights whose sum is the value at `position` (m).
///
/// # Errors
/// The position lies off the body, or next to cells without a point.
pub fn weights(
    body: &Body,
    position: [f64; 3],
    interpolation: Interpolation,
) -> Result<Vec<(usize, f64)>, SetupError> {
    let lattice = match &body.discretisation {
        Discretisation::Lattice(lattice) => lattice,
        Discretisation::Cloud(_) if interpolation == Interpolation::Cubic => {
            let message = format!("body `{}` is no lattice", body.name);
            let expected = "`interpolation = \"linear\"`";
            return Err(SetupError::value(
                "measure.field.interpolation",
                message,
                expected,
            ));
        }
        Discretisation::Cloud(cloud) => {
            let weights = cloud.weights(&body.points, body.dimension, &position.into());
            return weights.ok_or_else(|| off_body(body, position));
        }
    };
    let relative = (Vector3::from(position) - lattice.origin) / lattice.spacing;
    let mut axes: [Vec<(i64, f64)>; 3] = std::array::from_fn(|_| vec![(0, 1.0)]);
    for axis in 0..body.dimension {
        axes[axis] = along(relative[axis] - 0.5, lattice.cells[axis], interpolation)
            .ok_or_else(|| off_body(body, position))?;
    }
    let [xs, ys, zs] = &axes;
    let mut weights = Vec::new();
    for (z, wz) in zs {
        for (y, wy) in ys {
            for (x, wx) in xs {
                let point = lattice
                    .point([*x, *y, *z])
                    .ok_or_else(|| off_body(body, position))?;
                weights.push((point, wx * wy * wz));
            }
        }
    }
    Ok(weights)
}

/// Cells and weights along an axis; `at` counts cells from the first centre.
fn along(at: f64, cells: usize, interpolation: Interpolation) -> Option<Vec<(i64, f64)>> {
    let last = cells as i64 - 1;
    if !(at > -0.5 - 1e-6 && at < last as f64 + 0.5 + 1e-6) {
        return None;
    }
    // a position on a cell centre, but for rounding, is that point alone
    if (at - at.round()).abs() < 1e-6 {
        return Some(vec![(at.round() as i64, 1.0)]);
    }
    let low = at.floor();
    let t = at - low;
    let nodes: Vec<(i64, f64)> = match interpolation {
        Interpolation::Linear => vec![(0, 1.0 - t), (1, t)],
        Interpolation::Cubic => vec![
            (-1, -t * (t - 1.0) * (t - 2.0) / 6.0),
            (0, (t + 1.0) * (t - 1.0) * (t - 2.0) / 2.0),
            (1, -(t + 1.0) * t * (t - 2.0) / 2.0),
            (2, (t + 1.0) * t * (t - 1.0) / 6.0),
        ],
    };
    let mirrored = |cell: i64| {
        let period = 2 * (last + 1);
        let folded = cell.rem_euclid(period);
        folded.min(period - 1 - folded)
    };
    Some(
        nodes
            .into_iter()
            .map(|(step, weight)| (mirrored(low as i64 + step), weight))
            .collect(),
    )
}

fn off_body(body: &Body, [x, y, z]: [f64; 3]) -> SetupError {
    let (min, max) = body.bounds();
    let message = format!("body `{}` has no points around [{x}, {y}, {z}]", body.name);
    let expected = format!(
        "a position on the body, within {:?} and {:?} m",
        min.as_slice(),
        max.as_slice()
    );
    SetupError::value("measure.field.at", message, expected)
}

#[cfg(test)]
mod tests {
    use super::*;
    use perimelt_core::shape::{BoxShape, Shape};

    fn block() -> Body {
        let shape = Shape::Box(BoxShape {
            min: [0.0; 3],
            max: [4.0, 3.0, 2.0],
        });
        Body::fill("block", &shape, 3, 0.25, 1.0).expect("a valid block")
    }

    fn value(
        body: &Body,
        position: [f64; 3],
        kind: Interpolation,
        field: impl Fn(&Vector3<f64>) -> f64,
    ) -> f64 {
        let weights = weights(body, position, kind).expect("on the body");
        weights
            .iter()
            .map(|&(p, w)| w * field(&body.points.position[p]))
            .sum()
    }

    #[test]
    fn a_cubic_field_is_exact_away_from_the_faces() {
        let body = block();
        let field = |p: &Vector3<f64>| p.x.powi(3) - 2.0 * p.x * p.y * p.y + p.z;
        for position in [[1.1, 1.3, 0.9], [2.0, 1.5, 1.0]] {
            let exact = field(&position.into());
            // rounding of 64 terms of order one
            assert!((value(&body, position, Interpolation::Cubic, field) - exact).abs() < 1e-12);
        }
    }

    #[test]
    fn an_even_field_is_extrapolated_to_the_face() {
        let body = block();
        let field = |p: &Vector3<f64>| 1.0 + p.x * p.x;
        let on_face = value(&body, [0.0, 1.125, 1.125], Interpolation::Cubic, field);
        assert!(
            (on_face - 1.0).abs() < 1e-14,
            "parabola with its top on the face: {on_face}"
        );
        let linear = value(&body, [0.0, 1.125, 1.125], Interpolation::Linear, field);
        assert_eq!(linear, 1.0 + 0.125 * 0.125, "the outermost point");
    }

    #[test]
    fn a_cell_centre_is_that_point_and_a_position_outside_is_refused() {
        let body = block();
        let centre =
            weights(&body, [0.125, 0.125, 0.125], Interpolation::Cubic).expect("on the body");
        assert_eq!(centre, [(0, 1.0)]);
        assert!(weights(&body, [-0.01, 1.0, 1.0], Interpolation::Cubic).is_err());
    }

    #[test]
    fn a_single_row_of_cells_is_its_own_mirror_image() {
        assert_eq!(
            along(0.3, 1, Interpolation::Linear),
            Some(vec![(0, 0.7), (0, 0.3)])
        );
    }
}
