//! Faces of the box in which a fluid flows: which of them need a wall, and points that have crossed one.

use nalgebra::Vector3;
use perimelt_core::family::LayerRule;
use perimelt_core::world::BodyIndex;
use perimelt_core::{Body, Face, Setup, SetupError};

/// Refuses a body whose families would be incomplete: one that does not fill its box, or has a face without a wall.
pub(super) fn check_closed(
    setup: &Setup<'_>,
    body: BodyIndex,
    walls: &[Face],
) -> Result<(), SetupError> {
    if !setup.body(body).fills_box() {
        let message = "the body does not fill its box, so that its surface is free";
        let expected = "`form = \"conservative\"`, or a body that fills its box";
        return Err(SetupError::value("form", message, expected));
    }
    check_faces(setup, body, walls)
}

/// Refuses a body with a face that is neither a wall nor periodic.
pub(super) fn check_faces(
    setup: &Setup<'_>,
    body: BodyIndex,
    walls: &[Face],
) -> Result<(), SetupError> {
    let this = setup.body(body);
    let is_open =
        |f: &Face| f.axis() < this.dimension && !this.periodic[f.axis()] && !walls.contains(f);
    match Face::ALL.into_iter().find(is_open) {
        None => Ok(()),
        Some(face) => {
            let message = format!("face `{}` of the body has no boundary", face.name());
            let expected = "a `wall` or `symmetry` there, a body that is `periodic` along that axis, or \
                            `form = \"conservative\"`";
            Err(SetupError::value("body", message, expected))
        }
    }
}

/// Puts back points that have left the box: through a periodic face to the other side (Gao (2020), eq. 5.117), through
/// a wall or a plane of symmetry as reflected (eq. 6.45).
pub(super) fn keep_inside(
    body: &Body,
    rules: &[LayerRule],
    displacement: &mut [Vector3<f64>],
    velocity: &mut [Vector3<f64>],
) {
    let is_closed = |face: Face| body.periodic[face.axis()] || rules.iter().any(|r| r.face == face);
    let end = |face: Face| match is_closed(face) {
        true => body.face_position(face),
        false if face.is_upper() => f64::INFINITY,
        false => f64::NEG_INFINITY,
    };
    let [low, high] = [0, 1].map(|side| [0, 1, 2].map(|a| end(Face::ALL[2 * a + side])));
    let points = displacement
        .iter_mut()
        .zip(velocity)
        .zip(&body.points.position);
    for ((u, v), start) in points {
        for axis in 0..body.dimension {
            let x = start[axis] + u[axis];
            let beyond = (x - high[axis]).max(0.0) + (x - low[axis]).min(0.0);
            if beyond == 0.0 {
                continue;
            }
            if body.periodic[axis] {
                u[axis] -= beyond.signum() * (high[axis] - low[axis]);
            } else {
                u[axis] -= 2.0 * beyond;
                if v[axis] * beyond > 0.0 {
                    v[axis] = -v[axis];
                }
            }
        }
    }
}
