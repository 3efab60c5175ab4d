//! Faces of the box in which a fluid flows: which of them need a wall, and points that have crossed one.

use nalgebra::Vector3;
use perimelt_core::family::LayerRule;
use perimelt_core::world::BodyIndex;
use perimelt_core::{Body, Face, Setup, SetupError};

/// The setting with which surfaces may be free.
const FREE: &str = "`form = \"conservative\"`";

/// Refuses a body whose families would be incomplete: one that does not fill its box, or has a face without a wall.
pub(super) fn check_closed(
    setup: &Setup<'_>,
    body: BodyIndex,
    walls: &[Face],
) -> Result<(), SetupError> {
    if !setup.body(body).fills_box() {
        let message = "the body does not fill its box, so that its surface is free";
        let expected = format!("{FREE}, or a body that fills its box");
        return Err(SetupError::value("form", message, expected));
    }
    check_faces(setup, body, walls, FREE)
}

/// Refuses a body with a face that is neither a wall nor periodic; `otherwise` is a setting that needs none.
pub(super) fn check_faces(
    setup: &Setup<'_>,
    body: BodyIndex,
    walls: &[Face],
    otherwise: &str,
) -> Result<(), SetupError> {
    let this = setup.body(body);
    let is_open =
        |f: &Face| f.axis() < this.dimension && !this.periodic[f.axis()] && !walls.contains(f);
    match Face::ALL.into_iter().find(is_open) {
        None => Ok(()),
        Some(face) => {
            let message = format!("face `{}` of the body has no boundary", face.name());
            let expected = format!(
                "a `wall` or `symmetry` there, a body that is `periodic` along that axis, or {otherwise}"
            );
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

#[cfg(test)]
mod tests {
    use super::*;
    use perimelt_core::Axis;
    use perimelt_core::shape::{BoxShape, Shape};

    /// A box of 4 by 2 m, periodic along x, with a wall at y = 0.
    #[test]
    fn points_come_back_through_periodic_faces_and_are_reflected_by_walls() {
        let shape = Shape::Box(BoxShape {
            min: [0.0; 3],
            max: [4.0, 2.0, 1.0],
        });
        let mut body = Body::fill("water", &shape, 2, 1.0, 1.0).expect("valid");
        body.repeat(&[Axis::X]).expect("it fills its box");
        // a point at (0.5, 0.5)
        let start = body.points.position.at(0);
        body.points.position = vec![start].into();
        let rules = [LayerRule::even(Face::YMin)];
        for (place, velocity, expected, after) in [
            ([3.9, 1.5], [1.0, 1.0], [3.9, 1.5], [1.0, 1.0]),
            // through the periodic faces, with the velocity that it has
            ([4.25, 1.0], [1.0, 1.0], [0.25, 1.0], [1.0, 1.0]),
            ([-0.25, 1.0], [-1.0, 1.0], [3.75, 1.0], [-1.0, 1.0]),
            // reflected by the wall, unless it already comes back
            ([1.0, -0.25], [1.0, -3.0], [1.0, 0.25], [1.0, 3.0]),
            ([1.0, -0.25], [1.0, 3.0], [1.0, 0.25], [1.0, 3.0]),
            // free at the other face
            ([1.0, 2.5], [1.0, 3.0], [1.0, 2.5], [1.0, 3.0]),
            ([4.5, -0.5], [1.0, -3.0], [0.5, 0.5], [1.0, 3.0]),
        ] {
            let at = |[x, y]: [f64; 2], z: f64| Vector3::new(x, y, z);
            let mut displacement = [at(place, 9.0) - at([start.x, start.y], 0.0)];
            let mut speed = [at(velocity, -9.0)];
            keep_inside(&body, &rules, &mut displacement, &mut speed);
            let found = start + displacement[0];
            assert!(
                (found.xy() - at(expected, 0.0).xy()).norm() < 1e-12,
                "{place:?}: {found}"
            );
            assert_eq!(speed[0], at(after, -9.0), "{place:?}");
        }
    }

    #[test]
    fn all_faces_are_walls_or_periodic() {
        let shape = Shape::Box(BoxShape {
            min: [0.0; 3],
            max: [4.0, 2.0, 1.0],
        });
        let mut body = Body::fill("water", &shape, 2, 1.0, 1.0).expect("valid");
        body.repeat(&[Axis::X]).expect("it fills its box");
        let mut world = perimelt_core::World::new(vec![body]);
        let setup = Setup::new(&mut world, std::path::Path::new("."));
        for (walls, open) in [
            (&[Face::YMin, Face::YMax][..], None),
            (&[Face::YMin], Some("face `y+`")),
            (&[Face::YMax, Face::ZMin], Some("face `y-`")),
        ] {
            let found = check_closed(&setup, 0, walls).err().map(|e| e.to_string());
            match (&found, open) {
                (None, None) => {}
                (Some(message), Some(open)) => assert!(message.contains(open), "{message}"),
                _ => panic!("{found:?} {open:?}"),
            }
        }
    }
}
