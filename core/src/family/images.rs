//! Images of the points of a cloud behind the faces of its box: mirrored, or copies where it is periodic.

use std::collections::BTreeMap;
use std::ops::Range;

use nalgebra::Vector3;

use crate::body::{Body, Face};

use super::build::{Share, continued_faces};
use super::{FamilySpec, Ghost};

/// Rank of the first image.
const BEHIND_POINTS: u32 = u32::MAX / 2;

/// Slots of a cloud: its points, then their images in the order in which they must be filled.
#[derive(Debug, Default)]
pub(super) struct Images {
    /// Position of each slot, m.
    pub position: Vec<Vector3<f64>>,
    /// The point whose state each slot carries or mirrors.
    pub point: Vec<u32>,
    pub ghosts: Vec<Ghost>,
    pub layers: Vec<(Face, Range<usize>)>,
    /// Whether a slot lies behind an audited face, also by way of another image.
    pub audited: Vec<bool>,
    /// Place of each slot in the order of the bonds of a point: that of points in the whole body, then images.
    pub rank: Vec<u32>,
}

/// One image of a coordinate: `n` counts the copies of the box from the original; odd ones are reversed
/// between mirrors.
#[derive(Clone, Copy)]
struct ImageCoordinate {
    n: i32,
    at: f64,
    depth: f64,
}

/// An image before it has a slot.
struct Image {
    point: u32,
    n: [i32; 3],
    position: Vector3<f64>,
    /// Place of the last face on its way among those of the family.
    face: usize,
}

impl Images {
    /// Images of all points within `reach` (m) of the box, mirrored repeatedly until edges,
    /// corners and bodies thinner than the reach are complete.
    pub(super) fn new(share: Share<'_>, spec: &FamilySpec, reach: f64) -> Images {
        let Share { body, numbers, .. } = share;
        let faces = continued_faces(body, spec);
        let positions = &body.points.position;
        let mut images = Vec::new();
        for (point, x) in positions.iter().enumerate() {
            let [xs, ys, zs] = std::array::from_fn(|a| along(body, &faces, a, x[a], reach));
            for z in &zs {
                for y in &ys {
                    for x in &xs {
                        let depth = Vector3::new(x.depth, y.depth, z.depth).norm();
                        let n = [x.n, y.n, z.n];
                        if n != [0; 3] && depth <= reach {
                            images.push(Image {
                                point: point as u32,
                                n,
                                position: Vector3::new(x.at, y.at, z.at),
                                face: last_face(&faces, n),
                            });
                        }
                    }
                }
            }
        }
        // an image is filled from one with fewer reflections
        let level = |i: &Image| i.n.iter().map(|n| n.abs()).sum::<i32>();
        images.sort_by_key(|i| (level(i), i.face, numbers[i.point as usize], i.n));

        let mut all = Images {
            position: positions.clone(),
            point: (0..positions.len() as u32).collect(),
            audited: vec![false; positions.len()],
            rank: numbers.to_vec(),
            ..Images::default()
        };
        let mut slot_of: BTreeMap<(u32, [i32; 3]), u32> = BTreeMap::new();
        let mut group = None;
        for image in &images {
            let (slot, face) = (all.position.len() as u32, faces[image.face]);
            let mut before = image.n;
            let n = &mut before[face.axis()];
            *n = match (face.is_upper(), body.periodic[face.axis()]) {
                (true, false) => 1 - *n,
                (false, false) => -1 - *n,
                (true, true) => *n - 1,
                (false, true) => *n + 1,
            };
            let source = match before {
                [0, 0, 0] => Some(image.point),
                _ => slot_of.get(&(image.point, before)).copied(),
            };
            // a point of a run that has blown up may lie far outside of the box, with a part of its images only
            let Some(source) = source else {
                continue;
            };
            slot_of.insert((image.point, image.n), slot);
            let ghost = all.ghosts.len();
            if group != Some((level(image), image.face)) {
                group = Some((level(image), image.face));
                all.layers.push((face, ghost..ghost));
            }
            if let Some((_, range)) = all.layers.last_mut() {
                range.end = ghost + 1;
            }
            let earlier = (source as usize).checked_sub(positions.len());
            let mut passes = earlier.map_or([0; 6], |g| all.ghosts[g].passes);
            passes[face as usize] += u8::from(!body.periodic[face.axis()]);
            all.ghosts.push(Ghost {
                slot,
                source,
                parent: earlier.map(|g| g as u32),
                point: image.point,
                passes,
            });
            all.position.push(image.position);
            all.point.push(image.point);
            all.rank.push(BEHIND_POINTS + ghost as u32);
            let audited = spec.audited.contains(&face) || all.audited[source as usize];
            all.audited.push(audited);
        }
        all
    }
}

/// The images of a coordinate along an axis, within `reach` of the box.
fn along(body: &Body, faces: &[Face], axis: usize, x: f64, reach: f64) -> Vec<ImageCoordinate> {
    let mut found = vec![ImageCoordinate {
        n: 0,
        at: x,
        depth: 0.0,
    }];
    let [lower, upper] = [Face::ALL[2 * axis], Face::ALL[2 * axis + 1]];
    let mirrored = [lower, upper].map(|f| faces.contains(&f));
    if mirrored == [false; 2] {
        return found;
    }
    let (low, high) = (body.face_position(lower), body.face_position(upper));
    let size = high - low;
    for count in 1..=(reach / size).ceil() as i32 + 1 {
        for (n, is_mirrored) in [(-count, mirrored[0]), (count, mirrored[1])] {
            // further images need the other mirror as well
            if !is_mirrored || count > 1 && mirrored != [true; 2] {
                continue;
            }
            let at = match (n % 2 == 0 || body.periodic[axis], n < 0) {
                (true, _) => x + f64::from(n) * size,
                (false, true) => 2.0 * low - x + f64::from(n + 1) * size,
                (false, false) => 2.0 * high - x + f64::from(n - 1) * size,
            };
            let depth = if n < 0 { low - at } else { at - high };
            if depth <= reach {
                found.push(ImageCoordinate { n, at, depth });
            }
        }
    }
    found
}

/// The last face on the way to an image, in the order of `faces`.
fn last_face(faces: &[Face], n: [i32; 3]) -> usize {
    let face = |axis: usize| match n[axis] {
        0 => None,
        n => Some(Face::ALL[2 * axis + usize::from(n > 0)]),
    };
    (0..3)
        .filter_map(face)
        .filter_map(|face| faces.iter().position(|f| *f == face))
        .max()
        .expect("an image lies behind a mirrored face")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shape::{BoxShape, Shape};

    #[test]
    fn a_bar_shorter_than_the_reach_is_mirrored_again_and_again() {
        let (low, high, reach) = (0.5, 3.5, 7.0);
        let shape = Shape::Box(BoxShape {
            min: [low, 0.0, 0.0],
            max: [high, 1.0, 1.0],
        });
        let bar = Body::fill("bar", &shape, 1, 1.0, 0.5).expect("valid");
        for x in bar.points.position.iter().map(|x| x.x) {
            let copies = (-3..=3).flat_map(|k| {
                let shift = 2.0 * f64::from(k) * (high - low);
                [x + shift, 2.0 * low - x + shift]
            });
            let mut expected: Vec<f64> = copies
                .filter(|at| (low - reach..=high + reach).contains(at))
                .collect();
            let images = along(&bar, &[Face::XMin, Face::XMax], 0, x, reach);
            let mut found: Vec<f64> = images.iter().map(|image| image.at).collect();
            expected.sort_by(f64::total_cmp);
            found.sort_by(f64::total_cmp);
            assert_eq!(found, expected);
            for image in images {
                let depth = (low - image.at).max(image.at - high).max(0.0);
                assert_eq!(image.depth, depth);
            }
        }
    }
}
