//! Angular distortion and shrinkage of welded plates, from the displacements at the end.
//!
//! The parts on both sides of a straight weld move as rigid bodies but for a strip along it. The best rigid motion of each part
//! gives its rotation about the direction of travel, and the difference of the rotations is the angular distortion. The
//! transverse shrinkage is the approach of the centres of both parts, and the longitudinal one the shortening between the ends
//! of the body along the weld.

use perimelt_core::log::LogError;

use super::{BodyRecord, Label, ReadOff};
use crate::melt_pool::{Directions, Travel};
use crate::quantity::survey::Reference;

/// Fraction of the extent on each side of a weld that is left out because it deforms.
const STRIP: f64 = 0.3;

/// Fewest points of a part.
const FEWEST: usize = 8;

/// Rigid motion of a part beside a weld.
struct RigidMotion {
    /// centre in the reference configuration, m
    centre: [f64; 3],
    /// mean displacement, m
    displacement: [f64; 3],
    /// rotation about the direction of travel
    rotation: f64,
}

/// Reads off the distortion of a body of a straight path.
///
/// # Errors
/// A log that cannot be read.
pub(super) fn distortion(
    record: &BodyRecord<'_>,
    travel: Travel,
    found: &mut Vec<ReadOff>,
) -> Result<(), LogError> {
    let &BodyRecord {
        log,
        sources,
        body,
        last,
    } = record;
    let is_solid = body.fields.iter().any(|f| f.name == "stress") && body.dimension == 3;
    let displacement = last.fields.iter().find(|f| f.name == "displacement");
    let path = sources.path();
    let (Some(displacement), Some(first), true) = (displacement, path.first(), is_solid) else {
        return Ok(());
    };
    let angular = Label::new("distortion.angular", "angular distortion at the end");
    let directions = first.directions(Directions::from(travel));
    if !path
        .iter()
        .all(|state| state.directions(directions).is_close(&directions))
    {
        let reason = "the path turns, which leaves no two sides of one weld";
        found.push(ReadOff::left_out(&body.name, angular, "rad", reason));
        return Ok(());
    }
    let reference = Reference::new(log, body)?;
    let positions = reference.positions(last);
    let plates = Plates {
        positions: &positions,
        displacement: &displacement.values,
        place: first.position,
        directions,
    };
    let [one, other] = plates.parts();
    let is_half = |part: &Option<RigidMotion>| part.is_none() && !body.symmetry.is_empty();
    let across = directions.across();
    let along = |v: [f64; 3], d: [f64; 3]| (0..3).map(|a| v[a] * d[a]).sum::<f64>();
    let both = match (&one, &other) {
        (Some(one), Some(other)) => Some((one, other, 1.0)),
        // the other half is the mirror image
        (Some(one), None) if is_half(&other) => Some((one, one, 2.0)),
        (None, Some(other)) if is_half(&one) => Some((other, other, 2.0)),
        _ => None,
    };
    if let Some((one, other, halves)) = both {
        let is_mirrored = halves > 1.0;
        let turned = match is_mirrored {
            true => 2.0 * one.rotation,
            false => other.rotation - one.rotation,
        };
        found.push(ReadOff::new(&body.name, angular, turned.abs(), "rad"));
        // the plates of a fillet do not lie opposite to each other
        if plates.is_flat() {
            let approach = |part: &RigidMotion| {
                let side = along(part.centre, across) - along(plates.place, across);
                -side.signum() * along(part.displacement, across)
            };
            let shrinkage = match is_mirrored {
                true => 2.0 * approach(one),
                false => approach(one) + approach(other),
            };
            let name = Label::new("distortion.transverse", "transverse shrinkage at the end");
            found.push(ReadOff::new(&body.name, name, shrinkage, "m"));
        }
    }
    if let Some(shortening) = plates.shortening() {
        let name = Label::new(
            "distortion.longitudinal",
            "longitudinal shrinkage along the weld at the end",
        );
        found.push(ReadOff::new(&body.name, name, shortening, "m"));
    }
    Ok(())
}

/// Welded plates.
struct Plates<'a> {
    positions: &'a [[f64; 3]],
    displacement: &'a [f64],
    /// position of the torch, m
    place: [f64; 3],
    directions: Directions,
}

impl Plates<'_> {
    /// Whether the beam is normal to flat plates: it lies along an axis.
    fn is_flat(&self) -> bool {
        self.directions.beam.iter().any(|x| x.abs() > 0.9)
    }

    /// Directions from the weld into the two parts: across a beam that lies along an axis, else against the two components of
    /// the beam, along the plates of a fillet.
    fn sides(&self) -> Option<[[f64; 3]; 2]> {
        let (across, beam) = (self.directions.across(), self.directions.beam);
        if self.is_flat() {
            return Some([across.map(|x| -x), across]);
        }
        let mut axes = (0..3).filter(|&axis| beam[axis].abs() > 0.3);
        let unit = |axis: usize| {
            let mut unit = [0.0; 3];
            unit[axis] = -beam[axis].signum();
            unit
        };
        Some([unit(axes.next()?), unit(axes.next()?)])
    }

    fn parts(&self) -> [Option<RigidMotion>; 2] {
        let Some(sides) = self.sides() else {
            return [None, None];
        };
        let along =
            |p: &[f64; 3], d: [f64; 3]| (0..3).map(|a| (p[a] - self.place[a]) * d[a]).sum::<f64>();
        let far = sides.map(|side| {
            let ends = self.positions.iter().map(|p| along(p, side));
            ends.fold(0.0, f64::max)
        });
        [0, 1].map(|number| {
            let other = 1 - number;
            let is_in = |p: &[f64; 3]| {
                let is_beyond = along(p, sides[number]) > STRIP * far[number];
                // a plate of a fillet does not reach into the other one
                let is_other = along(p, sides[other]) > STRIP * far[other];
                far[number] > 0.0 && is_beyond && !is_other
            };
            let points = (0..self.positions.len()).filter(|&i| is_in(&self.positions[i]));
            self.rigid_motion(&points.collect::<Vec<_>>())
        })
    }

    /// The best rigid motion of some points in the plane normal to the direction of travel.
    fn rigid_motion(&self, points: &[usize]) -> Option<RigidMotion> {
        if points.len() < FEWEST {
            return None;
        }
        let moved = |i: usize| [0, 1, 2].map(|a| self.displacement[3 * i + a]);
        let mean = |of: &dyn Fn(usize) -> [f64; 3]| {
            let sum = points.iter().fold([0.0; 3], |sum: [f64; 3], &i| {
                let x = of(i);
                [0, 1, 2].map(|a| sum[a] + x[a])
            });
            sum.map(|x| x / points.len() as f64)
        };
        let centre = mean(&|i| self.positions[i]);
        let displacement = mean(&moved);
        let t = self.directions.travel;
        let (mut moment, mut inertia) = (0.0, 0.0);
        for &i in points {
            let from = |x: [f64; 3], mean: [f64; 3]| [0, 1, 2].map(|a| x[a] - mean[a]);
            let (r, u) = (
                from(self.positions[i], centre),
                from(moved(i), displacement),
            );
            let cross = [
                r[1] * u[2] - r[2] * u[1],
                r[2] * u[0] - r[0] * u[2],
                r[0] * u[1] - r[1] * u[0],
            ];
            let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
            moment += dot(cross, t);
            inertia += dot(r, r) - dot(r, t).powi(2);
        }
        (inertia > 0.0).then(|| RigidMotion {
            centre,
            displacement,
            rotation: moment / inertia,
        })
    }

    /// Shortening (m) between the ends of the body along the weld, from the points near the line of the weld at both ends.
    fn shortening(&self) -> Option<f64> {
        let t = self.directions.travel;
        let along = |i: usize| (0..3).map(|a| self.positions[i][a] * t[a]).sum::<f64>();
        let moved = |i: usize| {
            (0..3)
                .map(|a| self.displacement[3 * i + a] * t[a])
                .sum::<f64>()
        };
        let all = || 0..self.positions.len();
        let low = all().map(along).fold(f64::INFINITY, f64::min);
        let high = all().map(along).fold(f64::NEG_INFINITY, f64::max);
        let slack = 0.02 * (high - low);
        let end = |is_there: &dyn Fn(f64) -> bool| {
            let points: Vec<usize> = all().filter(|&i| is_there(along(i))).collect();
            let distance = |i: usize| {
                let off = [0, 1, 2].map(|a| self.positions[i][a] - self.place[a]);
                let part = (0..3).map(|a| off[a] * t[a]).sum::<f64>();
                off.iter().map(|x| x * x).sum::<f64>() - part * part
            };
            let nearest = points
                .into_iter()
                .min_by(|&a, &b| distance(a).total_cmp(&distance(b)));
            nearest.map(moved)
        };
        let at_start = end(&|x| x <= low + slack)?;
        let at_end = end(&|x| x >= high - slack)?;
        (high > low).then_some(at_start - at_end)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::melt_pool::Directions;

    /// Plates of 2 mm cells around the origin, moved by `motion`; the weld lies along x through `place`.
    fn plates<'a>(
        positions: &'a [[f64; 3]],
        displacement: &'a [f64],
        beam: [f64; 3],
    ) -> Plates<'a> {
        Plates {
            positions,
            displacement,
            place: [0.0; 3],
            directions: Directions {
                travel: [1.0, 0.0, 0.0],
                beam,
            },
        }
    }

    fn moved(
        is_there: impl Fn([f64; 3]) -> bool,
        motion: impl Fn([f64; 3]) -> [f64; 3],
    ) -> (Vec<[f64; 3]>, Vec<f64>) {
        let place = |i: i32| 2e-3 * (f64::from(i) + 0.5);
        let mut positions = Vec::new();
        for k in -15..15 {
            for j in -15..15 {
                for i in 0..10 {
                    positions.push([place(i), place(j), place(k)]);
                }
            }
        }
        positions.retain(|p| is_there(*p));
        let displacement = positions.iter().flat_map(|p| motion(*p)).collect();
        (positions, displacement)
    }

    #[test]
    fn plates_that_turn_up_on_both_sides_have_twice_the_angle_of_one() {
        let angle = 0.01;
        let is_there = |p: [f64; 3]| p[2] < 0.0 && p[2] > -8e-3;
        // each side turns by the angle about the weld and comes 0.1 mm nearer; the length shrinks by 0.2 %
        let motion = |p: [f64; 3]| {
            let side = p[1].signum();
            [
                -2e-3 * p[0],
                -side * 1e-4 - side * angle * p[2],
                side * angle * p[1],
            ]
        };
        let (positions, displacement) = moved(is_there, motion);
        let plates = plates(&positions, &displacement, [0.0, 0.0, -1.0]);
        let [Some(one), Some(other)] = plates.parts() else {
            panic!("two sides");
        };
        assert!(((other.rotation - one.rotation).abs() - 2.0 * angle).abs() < 1e-12);
        assert!(plates.is_flat());
        // between the centres of the outermost cells
        let shortening = plates.shortening().expect("a length");
        assert!((shortening - 2e-3 * 18e-3).abs() < 1e-12, "{shortening}");
    }

    #[test]
    fn the_web_of_a_fillet_turns_towards_the_weld() {
        let angle = 0.02;
        let is_base = |p: [f64; 3]| p[2] < 0.0 && p[2] > -6e-3;
        let is_web = |p: [f64; 3]| p[1] < 0.0 && p[1] > -6e-3 && p[2] > 0.0;
        let motion = |p: [f64; 3]| match is_web(p) {
            true => [0.0, angle * p[2], -angle * p[1]],
            false => [0.0; 3],
        };
        let (positions, displacement) = moved(|p| is_base(p) || is_web(p), motion);
        let beam = [0.0, -0.5_f64.sqrt(), -0.5_f64.sqrt()];
        let plates = plates(&positions, &displacement, beam);
        let [Some(one), Some(other)] = plates.parts() else {
            panic!("two plates");
        };
        let turned = (other.rotation - one.rotation).abs();
        assert!((turned - angle).abs() < 1e-12, "{turned}");
        assert!(!plates.is_flat());
    }
}
