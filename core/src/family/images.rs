//! Ghosts for the images of points, and the slots of clouds.

use std::collections::BTreeMap;
use std::ops::Range;

use nalgebra::Vector3;

use crate::body::{BoxImage, BoxImages, Face};

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
    pub layers: Layers,
    /// Whether a slot lies behind an audited face, also by way of another image.
    pub audited: Vec<bool>,
    /// Place of each slot in the order of the bonds of a point: that of points in the whole body, then images.
    pub rank: Vec<u32>,
}

/// An image of a point, and the last face behind which it is made.
#[derive(Clone, Copy)]
pub(super) struct PointImage {
    pub(super) point: u32,
    pub(super) image: BoxImage,
    pub(super) face: Face,
    /// Images of a lower order are made before.
    pub(super) order: i32,
}

/// Ghosts in the order in which they are filled, with their faces.
#[derive(Clone, Debug, Default)]
pub(super) struct Layers {
    pub(super) ghosts: Vec<Ghost>,
    pub(super) faces: Vec<(Face, Range<usize>)>,
}

impl Layers {
    /// Ghosts for images, which are sorted by order and face. `place` gives the slot of an image, from that of its source;
    /// `slot_of` is that of a point. Images without a source are left out.
    pub(super) fn new(
        images: &[PointImage],
        periodic: [bool; 3],
        slot_of: impl Fn(u32) -> u32,
        mut place: impl FnMut(&PointImage, u32) -> u32,
    ) -> Layers {
        let mut layers = Layers::default();
        let Layers { ghosts, faces } = &mut layers;
        let mut ghost_of: BTreeMap<(u32, [i32; 3]), u32> = BTreeMap::new();
        let mut last = None;
        for of_point in images {
            let PointImage {
                point,
                image,
                face,
                order,
            } = *of_point;
            let before = image.before(face, periodic);
            let parent = ghost_of.get(&(point, before)).copied();
            let source = match parent {
                Some(parent) => ghosts[parent as usize].slot,
                None if before == [0; 3] => slot_of(point),
                // a point of a run that has blown up may lie far outside of the box, with a part of its images only
                None => continue,
            };
            let ghost = ghosts.len();
            ghost_of.insert((point, image.n), ghost as u32);
            if last.replace((order, face)) != Some((order, face)) {
                faces.push((face, ghost..ghost));
            }
            if let Some((_, range)) = faces.last_mut() {
                range.end = ghost + 1;
            }
            let mut passes = parent.map_or([0; 6], |parent| ghosts[parent as usize].passes);
            passes[face as usize] += u8::from(!periodic[face.axis()]);
            ghosts.push(Ghost {
                slot: place(of_point, source),
                source,
                parent,
                point,
                passes,
            });
        }
        layers
    }
}

impl Images {
    /// Images of all points within `reach` (m) of the box, mirrored repeatedly until edges,
    /// corners and bodies thinner than the reach are complete.
    pub(super) fn new(share: Share<'_>, spec: &FamilySpec, reach: f64) -> Images {
        let body = share.body;
        let positions = &body.points.position;
        let images = BoxImages::new(body, &continued_faces(body, spec), reach);
        let mut near = Vec::new();
        for (point, x) in (0..).zip(positions) {
            images.for_each_near(x, |image, depth| {
                if let Some(step) = image.last_step(body.periodic)
                    && depth.norm() <= reach
                {
                    near.push(PointImage {
                        point,
                        image,
                        face: step.face,
                        order: image.level(),
                    });
                }
            });
        }
        near.sort_by_key(|i| (i.order, i.face, share.number(i.point as usize), i.image.n));

        let mut all = Images {
            position: positions.to_vec(),
            point: (0..positions.len() as u32).collect(),
            audited: vec![false; positions.len()],
            rank: (0..body.points.len()).map(|p| share.number(p)).collect(),
            layers: Layers::default(),
        };
        let place = |of_point: &PointImage, source: u32| {
            let PointImage {
                point, image, face, ..
            } = *of_point;
            let slot = all.position.len();
            all.position.push(image.of(positions[point as usize]));
            all.point.push(point);
            all.rank
                .push(BEHIND_POINTS + (slot - positions.len()) as u32);
            let audited = spec.audited.contains(&face) || all.audited[source as usize];
            all.audited.push(audited);
            slot as u32
        };
        all.layers = Layers::new(&near, body.periodic, |point| point, place);
        all
    }
}
