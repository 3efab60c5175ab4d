//! How the values of ghosts follow from those of points.
//!
//! | ghosts | rule |
//! |---|---|
//! | images of a scalar, of a vector or a tensor; copies of periodic sides | [`Mirrored`] |
//! | as boundaries prescribe | [`ByRules`], [`Curved`], [`WithTractions`] |
//! | images that rise with the distance | [`Rising`] |
//! | a value of each image, for any fields | [`ByImage`] |
//! | sums that points get back from their images | [`Folded`] |

use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

use crate::body::Face;

use super::layer::{Continuation, Image, Jump, LayerRule, Traction};
use super::{Family, SlotField, Stencil};

/// In which direction a field crosses the border between points and ghosts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// Ghosts take values: first remote points those of their owners, then images those of the points that they mirror.
    ValuesOut,
    /// Points get sums: first those of their images, then owners those of remote points.
    SumsBack,
}

/// How the values of ghosts follow from those of points.
pub trait GhostRule {
    /// The direction in which the field crosses the border.
    const DIRECTION: Direction = Direction::ValuesOut;

    /// Fills the ghosts of fields whose points have their values. [`SlotField::load`] and [`SlotField::fill_ghosts`] call it.
    fn fill(self, family: &Family, fields: &mut [SlotField]);
}

/// Ghosts as mirror images of points. Copies of periodic sides keep the sign.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mirrored {
    /// A scalar keeps its sign.
    Scalar,
    /// The component of a vector along an axis changes sign across faces normal to it.
    Vector(usize),
    /// A component of a tensor changes sign across faces that are normal to one of its two axes only.
    Tensor(usize, usize),
}

impl Mirrored {
    fn turns(self, axis: usize) -> bool {
        match self {
            Mirrored::Scalar => false,
            Mirrored::Vector(a) => axis == a,
            Mirrored::Tensor(a, b) => (axis == a) != (axis == b),
        }
    }
}

impl GhostRule for Mirrored {
    fn fill(self, family: &Family, fields: &mut [SlotField]) {
        for slots in fields {
            for (face, ghosts) in family.slots.layers() {
                let axis = face.axis();
                let turns = self.turns(axis) && !family.slots.periodic[axis];
                let sign = if turns { -1.0 } else { 1.0 };
                for ghost in ghosts {
                    slots[ghost.slot as usize] = sign * slots[ghost.source as usize];
                }
            }
        }
    }
}

/// A component of a field by the rules of boundaries; without one, ghosts are images as they are. Tractions are left
/// out. Where faces that meet prescribe different values the field jumps; its value there is taken to be their mean.
#[derive(Clone, Copy, Debug)]
pub struct ByRules<'a>(pub &'a [LayerRule], pub usize);

impl GhostRule for ByRules<'_> {
    fn fill(self, family: &Family, fields: &mut [SlotField]) {
        let ByRules(rules, component) = self;
        for slots in fields {
            family.fill_layers(rules, component, slots, u8::MAX);
        }
    }
}

/// [`ByRules`], and curvature behind faces of a lattice that prescribe all components of a field by odd layers: `c x^2` is
/// added at the distance x, with the curvature `c = 4/3 (f2 - b - 3 (f1 - b)) / spacing^2` of the parabola through the value
/// `b` on the face and the two points before it. An odd layer alone has no curvature on the face. Layers behind the edges and
/// corners of such faces are not curved; images of layers behind other faces are those of curved ones.
#[derive(Clone, Copy, Debug)]
pub struct Curved<'a>(pub ByRules<'a>);

impl GhostRule for Curved<'_> {
    fn fill(self, family: &Family, fields: &mut [SlotField]) {
        let ByRules(rules, component) = self.0;
        self.0.fill(family, fields);
        let curved = rules.iter().filter(|rule| {
            let is_odd = rule.scale == [-1.0; 3] && rule.traction.is_none();
            is_odd && !family.slots.periodic[rule.face.axis()]
        });
        let curved = curved.fold(0, |bits, rule| bits | rule.face.bit());
        if curved == 0 {
            return;
        }
        for slots in fields {
            family.curve_layers(rules, component, slots, curved);
            family.fill_layers(rules, component, slots, !curved);
        }
    }
}

/// Images of a scalar plus `rise(axis, point, distance)`: what the field grows by from the mirror image of `point`, over the
/// distance (m) along the axis of the normal. Copies of periodic sides do not grow.
#[derive(Clone, Copy, Debug)]
pub struct Rising<F: Fn(usize, usize, f64) -> f64>(pub F);

impl<F: Fn(usize, usize, f64) -> f64> GhostRule for Rising<F> {
    fn fill(self, family: &Family, fields: &mut [SlotField]) {
        let Rising(rise) = self;
        for slots in fields {
            for (face, ghosts) in family.slots.layers() {
                let axis = face.axis();
                for ghost in ghosts {
                    let (slot, source) = (ghost.slot as usize, ghost.source as usize);
                    let grown = match family.slots.periodic[axis] {
                        true => 0.0,
                        false => {
                            let distance = family.place(slot, axis) - family.place(source, axis);
                            rise(axis, ghost.point as usize, distance)
                        }
                    };
                    slots[slot] = slots[source] + grown;
                }
            }
        }
    }
}

/// Values of `N` fields at each image of a point, where layers continue the vector field of a [`Continuation`].
#[derive(Clone, Copy, Debug)]
pub struct ByImage<'a, F>(pub &'a Continuation, pub F);

impl<const N: usize, F: FnMut(&Image) -> [f64; N]> GhostRule for ByImage<'_, F> {
    fn fill(self, family: &Family, fields: &mut [SlotField]) {
        let ByImage(continuation, mut values) = self;
        for image in family.images(continuation) {
            let fields = fields.iter_mut().zip(values(&image));
            fields.for_each(|(slots, value)| slots[image.slot] = value);
        }
    }
}

/// The components of a vector field by the rules of boundaries, tractions included.
#[derive(Debug)]
pub struct WithTractions<'a, F>
where
    F: Fn(Face, &Traction, usize, &Matrix3<f64>) -> Vector3<f64>,
{
    /// The rules.
    pub rules: &'a [LayerRule],
    /// Keeps how the field continues.
    pub continuation: &'a mut Continuation,
    /// `slope(face, traction, point, lateral)`: the derivative of the field along the axis of the
    /// normal that a traction makes at the mirror image of `point`, with the `lateral` columns of the
    /// gradient given.
    pub slope: F,
}

impl<F> GhostRule for WithTractions<'_, F>
where
    F: Fn(Face, &Traction, usize, &Matrix3<f64>) -> Vector3<f64>,
{
    fn fill(self, family: &Family, fields: &mut [SlotField]) {
        for (component, slots) in fields.chunks_mut(1).enumerate() {
            ByRules(self.rules, component).fill(family, slots);
        }
        let WithTractions {
            rules,
            continuation,
            slope,
        } = self;
        family.bend_layers(rules, fields, continuation, slope);
    }
}

/// Transpose of the linear part of [`ByRules`]: adds the values of ghosts to those of the points that they follow, and
/// clears them.
#[derive(Clone, Copy, Debug)]
pub struct Folded<'a>(pub &'a [LayerRule], pub usize);

impl GhostRule for Folded<'_> {
    const DIRECTION: Direction = Direction::SumsBack;

    fn fill(self, family: &Family, fields: &mut [SlotField]) {
        let Folded(rules, component) = self;
        let has_offset = rules.iter().any(|r| r.has_offset(component));
        let corners = family.slots.corners.iter().filter(|_| has_offset);
        for slots in fields {
            for corner in corners.clone() {
                if let Some(jump) = Jump::at(corner, rules, component) {
                    let value = std::mem::take(&mut slots[corner.slot as usize]);
                    slots[corner.source as usize] += jump.scale * value;
                }
            }
            for (face, ghosts) in family.slots.layers().rev() {
                let rule = rules.iter().find(|r| r.face == face);
                let scale = rule.map_or(1.0, |r| r.scale[component]);
                for ghost in ghosts.iter().rev() {
                    let value = std::mem::take(&mut slots[ghost.slot as usize]);
                    slots[ghost.source as usize] += scale * value;
                }
            }
        }
    }
}

/// Coordinate along an axis: that of the mirrored point; copies of periodic sides have their own.
struct Coordinate(usize);

impl GhostRule for Coordinate {
    fn fill(self, family: &Family, fields: &mut [SlotField]) {
        let Coordinate(along) = self;
        for slots in fields {
            for (face, ghosts) in family.slots.layers() {
                for ghost in ghosts {
                    let (slot, source) = (ghost.slot as usize, ghost.source as usize);
                    let way = match family.slots.periodic[face.axis()] {
                        true => family.place(slot, along) - family.place(source, along),
                        false => 0.0,
                    };
                    slots[slot] = slots[source] + way;
                }
            }
        }
    }
}

impl SlotField {
    /// Sets the coordinate along an axis, m; behind faces that of the mirror point, behind periodic faces that of the
    /// copy.
    pub fn load_coordinate(&mut self, family: &Family, axis: usize) {
        let slots = (0..family.slots.len).into_par_iter();
        self.set(slots.map(|slot| family.place(slot, axis)));
        self.fill_ghosts(family, Coordinate(axis));
    }
}

impl Family {
    /// Fills the ghosts of fields whose points have their values. All ghosts of all fields are filled here.
    pub(super) fn fill_ghosts(&self, fields: &mut [SlotField], ghosts: impl GhostRule) {
        ghosts.fill(self, fields);
    }

    /// Continues a field behind corners at which faces disagree: odd about the mean of what they prescribe, or
    /// constant where their layers are constant. Filling face by face would continue the field of the last one.
    fn fill_corners(&self, rules: &[LayerRule], component: usize, slots: &mut [f64]) {
        for corner in &self.slots.corners {
            if let Some(jump) = Jump::at(corner, rules, component) {
                let image = slots[corner.source as usize];
                slots[corner.slot as usize] = jump.mean + jump.scale * (image - jump.mean);
            }
        }
    }

    /// Fills the layers behind a set of faces as boundaries prescribe.
    fn fill_layers(&self, rules: &[LayerRule], component: usize, slots: &mut [f64], faces: u8) {
        let layers = self.slots.layers();
        for (face, ghosts) in layers.filter(|(face, _)| faces & face.bit() != 0) {
            let rule = rules.iter().find(|r| r.face == face);
            let (scale, offset) =
                rule.map_or((1.0, 0.0), |r| (r.scale[component], r.offset[component]));
            let by_place = rule.filter(|r| r.values.is_some());
            for ghost in ghosts {
                let offset = by_place.map_or(offset, |r| r.offset_of(component, ghost.point));
                slots[ghost.slot as usize] = scale * slots[ghost.source as usize] + offset;
            }
        }
        if rules.iter().any(|r| r.has_offset(component)) {
            self.fill_corners(rules, component, slots);
        }
    }

    /// Adds the curvature of [`Curved`] behind a set of faces.
    fn curve_layers(&self, rules: &[LayerRule], component: usize, slots: &mut [f64], curved: u8) {
        let Some(Stencil { grid, .. }) = self.store.stencil() else {
            return;
        };
        for (face, ghosts) in self.slots.layers() {
            let axis = face.axis();
            let is_curved = |rule: &&LayerRule| rule.face == face && curved & face.bit() != 0;
            let Some(rule) = rules.iter().find(is_curved) else {
                continue;
            };
            let not_behind = curved | face.bit() | face.opposite().bit();
            let on_face = 0.5 * rule.offset[component];
            let stride = grid.stride(axis);
            let inwards = |slot: usize, cells: usize| match face.is_upper() {
                true => slot - cells * stride,
                false => slot + cells * stride,
            };
            for ghost in ghosts {
                let (slot, source) = (ghost.slot as usize, ghost.source as usize);
                let layer = (slot.abs_diff(source) / stride).div_ceil(2);
                let [first, second] = [layer, layer + 1].map(|cells| inwards(slot, cells));
                let faces = grid.mirrored[first] | grid.mirrored[second];
                if faces & not_behind != 0 {
                    continue;
                }
                let [first, second] = [first, second].map(|s| slots[s] - on_face);
                let distance = layer as f64 - 0.5;
                slots[slot] += 4.0 / 3.0 * (second - 3.0 * first) * distance * distance;
            }
        }
    }

    /// Bends the layers of a vector field behind faces under traction, and keeps in `continuation` how all of them continue.
    fn bend_layers(
        &self,
        rules: &[LayerRule],
        slots: &mut [SlotField],
        continuation: &mut Continuation,
        slope: impl Fn(Face, &Traction, usize, &Matrix3<f64>) -> Vector3<f64>,
    ) {
        let (own, bends) = (&mut continuation.rules, &mut continuation.bends);
        own.clear();
        own.extend_from_slice(rules);
        bends.clear();
        let bent = rules.iter().filter(|r| r.traction.is_some());
        let bent = bent.fold(0, |bits, r| bits | r.face.bit());
        // tractions by layers are refused on clouds
        let Some(Stencil { grid, .. }) = self.store.stencil().filter(|_| bent != 0) else {
            return;
        };
        let mut done = 0;
        for (face, ghosts) in self.slots.layers() {
            let axis = face.axis();
            // plain mirror images are final, bent layers once they are filled
            let usable = |faces: u8| faces & bent == 0 || faces & !done == 0;
            let even = LayerRule::even(face);
            let rule = rules.iter().find(|r| r.face == face).unwrap_or(&even);
            for ghost in ghosts {
                let (slot, source) = (ghost.slot as usize, ghost.source as usize);
                if grid.mirrored[slot] & bent == 0 {
                    bends.push(Matrix3::zeros());
                    continue;
                }
                for (a, slots) in slots.iter_mut().enumerate() {
                    slots[slot] = rule.scale[a] * slots[source] + rule.offset[a];
                }
                let mut bend: Matrix3<f64> = ghost
                    .parent
                    .map_or_else(Matrix3::zeros, |parent| bends[parent as usize]);
                (0..3).for_each(|a| bend.row_mut(a).scale_mut(rule.scale[a]));
                bend.column_mut(axis).scale_mut(-1.0);
                if let Some(traction) = &rule.traction {
                    let lateral = grid.lateral(slots, source, axis, usable);
                    let slope = slope(face, traction, ghost.point as usize, &lateral);
                    let cells = [slot, source].map(|s| grid.cell(s, axis) as f64);
                    let distance = (cells[0] - cells[1]) * grid.spacing;
                    for (a, slots) in slots.iter_mut().enumerate() {
                        slots[slot] += distance * slope[a];
                        bend[(a, axis)] += 2.0 * slope[a];
                    }
                }
                bends.push(bend);
            }
            done |= face.bit();
        }
    }
}

#[cfg(test)]
mod tests;
