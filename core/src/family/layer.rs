//! Layers behind faces: how fields continue there, and layer points as images of points.
//!
//! A value that is prescribed on a face is mirrored, odd or even. A *traction* is prescribed by the
//! strain that it makes (Wang (2025), eqs. 4.24 to 4.28; corrected, see spec 01, 1.9):
//!
//! ```text
//! u(layer) = u(mirror) + (x(layer) - x(mirror)) q
//! ```
//!
//! with the distance along the normal and q the derivative of the displacement along the axis of the
//! normal, which the physics knows from the traction and the derivatives along the face. Exact for
//! affine fields. Such an operator is not symmetric.

use nalgebra::{Matrix3, Vector3};

use crate::body::{Body, Face, Lattice};

use super::lattice::EMPTY;
use super::{Family, Ghost};

/// How a field continues in the mirrored layer behind a face:
/// `value(layer point) = scale * value(mirror point) + offset`, component by component
/// (scalars use the first). Prescribed value `b`: scale -1, offset 2 b (Wang (2025),
/// eq. 7.17); constant layer: 0, b; insulated: 1, 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LayerRule {
    /// The face.
    pub face: Face,
    /// Factors on the mirrored components.
    pub scale: [f64; 3],
    /// Added to the mirrored components, in the unit of the field.
    pub offset: [f64; 3],
    /// Traction that bends the layer, of vector fields.
    pub traction: Option<Traction>,
}

/// Traction on a face.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Traction {
    /// Force per area, Pa.
    pub stress: [f64; 3],
    /// Whether the field is a difference of displacements, so that stress-free strain has no part.
    pub difference: bool,
}

impl LayerRule {
    /// The mirror image as it is.
    pub fn even(face: Face) -> Self {
        LayerRule {
            face,
            scale: [1.0; 3],
            offset: [0.0; 3],
            traction: None,
        }
    }

    /// The value on the face, where the rule prescribes one.
    fn prescribed(&self, component: usize) -> Option<f64> {
        let (scale, offset) = (self.scale[component], self.offset[component]);
        (scale != 1.0).then(|| offset / (1.0 - scale))
    }

    /// The rule without what it prescribes: for differences of two fields.
    pub fn homogeneous(&self) -> Self {
        let none = Traction {
            stress: [0.0; 3],
            difference: true,
        };
        LayerRule {
            offset: [0.0; 3],
            traction: self.traction.map(|_| none),
            ..*self
        }
    }
}

/// How a vector field continues at the moment, see [`Family::continue_vector`].
#[derive(Clone, Debug, Default)]
pub struct Continuation {
    rules: Vec<LayerRule>,
    /// By layer point; empty without tractions.
    bends: Vec<Matrix3<f64>>,
}

impl Continuation {
    /// By rules without traction.
    pub fn plain(rules: &[LayerRule]) -> Self {
        Continuation {
            rules: rules.to_vec(),
            bends: Vec::new(),
        }
    }

    /// Whether any layer is more than a mirror image.
    pub fn is_bent(&self) -> bool {
        !self.bends.is_empty()
    }

    /// The rules.
    pub fn rules(&self) -> &[LayerRule] {
        &self.rules
    }

    /// The linear part of how the field continues, but for the slopes of bent layers.
    pub fn layout(&self) -> Layout {
        let mut layout = Layout::default();
        for (i, rule) in self.rules.iter().enumerate() {
            let face = rule.face as usize;
            layout.rules[face] = Some((rule.scale, rule.traction.is_some()));
            for other in &self.rules[..i] {
                let faces = [face.min(other.face as usize), face.max(other.face as usize)];
                layout.disagree[faces[0]][faces[1]] =
                    std::array::from_fn(|a| match (rule.prescribed(a), other.prescribed(a)) {
                        (Some(value), Some(other)) => value != other,
                        _ => false,
                    });
            }
        }
        layout
    }
}

/// The linear part of a [`Continuation`]: layers of equal layouts scale the field alike.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Layout {
    /// By face: factors on the components, and whether a traction bends the layer.
    rules: [Option<([f64; 3], bool)>; 6],
    /// By pair of faces and component, whether both prescribe a value and the values differ.
    disagree: [[[bool; 3]; 6]; 6],
}

/// A component of a field behind a corner at which faces prescribe different values.
struct Jump {
    /// Mean of what the faces prescribe.
    mean: f64,
    /// Factor on the deviation of the point from the mean.
    scale: f64,
}

impl Jump {
    /// `None` where the faces of `corner` agree.
    fn at(corner: &Ghost, rules: &[LayerRule], component: usize) -> Option<Jump> {
        let passed = |r: &&LayerRule| corner.passes[r.face as usize] > 0;
        let faces = || {
            let rules = rules.iter().filter(passed);
            rules.filter_map(|r| Some((r.prescribed(component)?, r.scale[component])))
        };
        let (first, _) = faces().next()?;
        if faces().all(|(value, _)| value == first) {
            return None;
        }
        Some(Jump {
            mean: faces().map(|(value, _)| value).sum::<f64>() / faces().count() as f64,
            scale: -faces().map(|(_, scale)| scale).product::<f64>().abs(),
        })
    }
}

/// A layer point as the image of a point: `dv/dx (slot) = scale dv/dx (point) mirror + bend` for a
/// vector field v by its rules, with the rows of dv/dx scaled and its columns mirrored, and bonds
/// `xi_a (slot) = mirror_a xi_a (point)`.
#[derive(Clone, Copy, Debug)]
pub struct Image {
    /// Slot of the layer point.
    pub slot: usize,
    /// The point.
    pub point: usize,
    /// Factors on the components of the field.
    pub scale: [f64; 3],
    /// Signs of the axes: -1 where mirrored.
    pub mirror: [f64; 3],
    /// What tractions add to the gradient.
    pub bend: Matrix3<f64>,
    /// Whether it lies behind a face under traction.
    pub is_bent: bool,
}

impl Image {
    /// Whether the body and its image form one body that deforms symmetrically: components change sign across the
    /// faces to which they are normal, and only there.
    pub fn is_symmetric(&self) -> bool {
        self.scale == self.mirror && !self.is_bent
    }
}

/// Slots as cells, and what is in them.
#[derive(Debug)]
pub(super) struct Grid {
    cells: [usize; 3],
    /// Lower corner of the slots, m.
    origin: Vector3<f64>,
    spacing: f64,
    dimension: usize,
    /// The faces that mirrored the content of each slot, one bit each; none for points.
    mirrored: Vec<u8>,
}

/// Neither point nor layer.
const NOTHING: u8 = u8::MAX;

impl Grid {
    pub(super) fn new(
        body: &Body,
        lattice: &Lattice,
        (cells, pad): ([usize; 3], [usize; 3]),
        mirror_of: &[u32],
        ghosts: &[Ghost],
    ) -> Self {
        let dimension = body.dimension;
        let margin = Vector3::from(pad.map(|p| p as f64 * lattice.spacing));
        let content = mirror_of
            .iter()
            .map(|&m| if m == EMPTY { NOTHING } else { 0 });
        let mut mirrored: Vec<u8> = content.collect();
        for ghost in ghosts {
            let bits = ghost.passes.iter().enumerate();
            mirrored[ghost.slot as usize] =
                bits.fold(0, |bits, (face, &n)| bits | u8::from(n > 0) << face);
        }
        Grid {
            cells,
            origin: lattice.origin - margin,
            spacing: lattice.spacing,
            dimension,
            mirrored,
        }
    }

    /// Slots along each axis.
    pub(super) fn cells(&self) -> [usize; 3] {
        self.cells
    }

    fn stride(&self, axis: usize) -> usize {
        self.cells[..axis].iter().product()
    }

    fn cell(&self, slot: usize, axis: usize) -> usize {
        slot / self.stride(axis) % self.cells[axis]
    }

    /// Centre of a slot along an axis, m.
    pub(super) fn position(&self, slot: usize, axis: usize) -> f64 {
        self.origin[axis] + (self.cell(slot, axis) as f64 + 0.5) * self.spacing
    }

    /// Derivatives of a field along all axes but `normal`, central where there are `usable` neighbours
    /// on both sides; the argument of `usable` is the faces that mirrored them.
    fn lateral(
        &self,
        field: &[Vec<f64>],
        (slot, normal): (usize, usize),
        usable: impl Fn(u8) -> bool,
    ) -> Matrix3<f64> {
        let usable = |s: &usize| self.mirrored[*s] != NOTHING && usable(self.mirrored[*s]);
        let mut gradient = Matrix3::zeros();
        for axis in (0..self.dimension).filter(|a| *a != normal) {
            let (stride, cell) = (self.stride(axis), self.cell(slot, axis));
            let below = (cell > 0).then(|| slot - stride).filter(&usable);
            let above = (cell + 1 < self.cells[axis])
                .then(|| slot + stride)
                .filter(&usable);
            let steps = usize::from(below.is_some()) + usize::from(above.is_some());
            if steps == 0 {
                continue;
            }
            let (below, above) = (below.unwrap_or(slot), above.unwrap_or(slot));
            for (row, values) in field.iter().enumerate() {
                gradient[(row, axis)] =
                    (values[above] - values[below]) / (steps as f64 * self.spacing);
            }
        }
        gradient
    }
}

impl Family {
    /// Slots of the layer points, with the cells of the body's lattice in which they lie, counted on beyond its faces; none
    /// of a cloud.
    pub fn layer_cells(&self) -> Vec<(u32, [i64; 3])> {
        let Some(grid) = &self.grid else {
            return Vec::new();
        };
        let first = self.spans.first().map_or(0, |span| span.slot as usize);
        let cell = |slot: usize| -> [i64; 3] {
            std::array::from_fn(|a| grid.cell(slot, a) as i64 - grid.cell(first, a) as i64)
        };
        let layers = self.ghosts.iter();
        layers.map(|g| (g.slot, cell(g.slot as usize))).collect()
    }

    /// Number of layer points.
    pub fn layer_points(&self) -> usize {
        self.ghosts.len()
    }

    /// Fills the slots of the layer points of one `component` from their mirror points.
    /// Layers without a rule mirror the value as it is; tractions are left out. Where faces that meet prescribe
    /// different values the field jumps; its value there is taken to be their mean.
    pub fn fill_layers(&self, rules: &[LayerRule], component: usize, slots: &mut [f64]) {
        for (face, range) in &self.layers {
            let rule = rules.iter().find(|r| r.face == *face);
            let (scale, offset) =
                rule.map_or((1.0, 0.0), |r| (r.scale[component], r.offset[component]));
            for ghost in &self.ghosts[range.clone()] {
                slots[ghost.slot as usize] = scale * slots[ghost.source as usize] + offset;
            }
        }
        if rules.iter().any(|r| r.offset[component] != 0.0) {
            self.fill_corners(rules, component, slots);
        }
    }

    /// Continues a field behind corners at which faces disagree: odd about the mean of what they prescribe, or
    /// constant where their layers are. One face after the other would let the last one go on beyond the corner.
    fn fill_corners(&self, rules: &[LayerRule], component: usize, slots: &mut [f64]) {
        for corner in &self.corners {
            if let Some(jump) = Jump::at(corner, rules, component) {
                let image = slots[self.slot_of(corner.point as usize)];
                slots[corner.slot as usize] = jump.mean + jump.scale * (image - jump.mean);
            }
        }
    }

    /// Transpose of the linear part of [`Family::fill_layers`]: adds the values of the layer points to those of the
    /// points that they follow, and clears them.
    pub fn fold_layers(&self, rules: &[LayerRule], component: usize, slots: &mut [f64]) {
        if rules.iter().any(|r| r.offset[component] != 0.0) {
            for corner in &self.corners {
                if let Some(jump) = Jump::at(corner, rules, component) {
                    let value = std::mem::take(&mut slots[corner.slot as usize]);
                    slots[self.slot_of(corner.point as usize)] += jump.scale * value;
                }
            }
        }
        for (face, range) in self.layers.iter().rev() {
            let rule = rules.iter().find(|r| r.face == *face);
            let scale = rule.map_or(1.0, |r| r.scale[component]);
            for ghost in self.ghosts[range.clone()].iter().rev() {
                let value = std::mem::take(&mut slots[ghost.slot as usize]);
                slots[ghost.source as usize] += scale * value;
            }
        }
    }

    /// Fills the slots of the layer points with the values of their mirror points plus
    /// `rise(axis, point, distance)`: what the field grows by from the mirror point, the image of `point`,
    /// over the distance (m) along the axis of the normal. Copies behind periodic faces do not grow.
    pub fn fill_layers_rising(&self, slots: &mut [f64], rise: impl Fn(usize, usize, f64) -> f64) {
        for (face, range) in &self.layers {
            let axis = face.axis();
            for ghost in &self.ghosts[range.clone()] {
                let (slot, source) = (ghost.slot as usize, ghost.source as usize);
                let grown = match self.periodic[axis] {
                    true => 0.0,
                    false => {
                        let distance = self.place(slot, axis) - self.place(source, axis);
                        rise(axis, ghost.point as usize, distance)
                    }
                };
                slots[slot] = slots[source] + grown;
            }
        }
    }

    /// Gives the layers of a lattice behind faces that prescribe all components of a field, odd, the curvature `c` of the
    /// parabola through the value `b` on the face and the two points before it: adds `c x^2` at the distance x, with
    /// `c = 4/3 (f2 - b - 3 (f1 - b)) / spacing^2`. An odd layer alone has no curvature on the face. For layers that
    /// [`Family::fill_layers`] has filled; layers behind edges and corners stay as they are.
    pub fn curve_layers(&self, rules: &[LayerRule], component: usize, slots: &mut [f64]) {
        let Some(grid) = &self.grid else {
            return;
        };
        for (face, range) in &self.layers {
            let axis = face.axis();
            let prescribes_all =
                |r: &&LayerRule| r.face == *face && r.scale == [-1.0; 3] && r.traction.is_none();
            let Some(rule) = rules.iter().find(prescribes_all) else {
                continue;
            };
            if self.periodic[axis] {
                continue;
            }
            let on_face = 0.5 * rule.offset[component];
            let stride = grid.stride(axis);
            let inwards = |slot: usize, cells: usize| match face.is_upper() {
                true => slot - cells * stride,
                false => slot + cells * stride,
            };
            for ghost in &self.ghosts[range.clone()] {
                let (slot, source) = (ghost.slot as usize, ghost.source as usize);
                let layer = (slot.abs_diff(source) / stride).div_ceil(2);
                let [first, second] = [layer, layer + 1].map(|cells| inwards(slot, cells));
                let are_points = grid.mirrored[first] == 0 && grid.mirrored[second] == 0;
                if !are_points {
                    continue;
                }
                let [first, second] = [first, second].map(|s| slots[s] - on_face);
                let distance = layer as f64 - 0.5;
                slots[slot] += 4.0 / 3.0 * (second - 3.0 * first) * distance * distance;
            }
        }
    }

    /// Copies a component of a field (point-major, so many components per point) to slots, as many as there are, and
    /// continues it behind faces by their rules.
    pub fn load(
        &self,
        (field, components): (&[f64], usize),
        component: usize,
        rules: &[LayerRule],
        slots: &mut Vec<f64>,
    ) {
        slots.resize(self.slots(), 0.0);
        self.scatter(field, components, component, slots);
        self.fill_layers(rules, component, slots);
    }

    /// Coordinate along an axis by slot, m; behind faces that of the mirror point, behind periodic faces that of the copy.
    pub fn mirrored_coordinates(&self, axis: usize, slots: &mut Vec<f64>) {
        slots.clear();
        slots.extend((0..self.slots()).map(|slot| self.place(slot, axis)));
        for (face, range) in &self.layers {
            for ghost in &self.ghosts[range.clone()] {
                let (slot, source) = (ghost.slot as usize, ghost.source as usize);
                let way = match self.periodic[face.axis()] {
                    true => self.place(slot, axis) - self.place(source, axis),
                    false => 0.0,
                };
                slots[slot] = slots[source] + way;
            }
        }
    }

    /// Fills the slots of the layer points with the values of their mirror points, with the other sign where
    /// `turns(axis)` says that a mirror across that axis turns it. Copies behind periodic faces do not turn.
    pub fn fill_layers_turning(&self, slots: &mut [f64], turns: impl Fn(usize) -> bool) {
        for (face, range) in &self.layers {
            let axis = face.axis();
            let sign = if turns(axis) && !self.periodic[axis] {
                -1.0
            } else {
                1.0
            };
            for ghost in &self.ghosts[range.clone()] {
                slots[ghost.slot as usize] = sign * slots[ghost.source as usize];
            }
        }
    }

    /// Fills the layer points of a vector field, one slot array for each component, and keeps in
    /// `continuation` how.
    ///
    /// `slope(face, traction, point, lateral)`: the derivative of the field along the axis of the
    /// normal that a traction makes at the mirror image of `point`, with the `lateral` columns of the
    /// gradient given.
    pub fn continue_vector(
        &self,
        rules: &[LayerRule],
        slots: &mut [Vec<f64>],
        continuation: &mut Continuation,
        slope: impl Fn(Face, &Traction, usize, &Matrix3<f64>) -> Vector3<f64>,
    ) {
        for (component, slots) in slots.iter_mut().enumerate() {
            self.fill_layers(rules, component, slots);
        }
        let Continuation { rules: own, bends } = continuation;
        own.clear();
        own.extend_from_slice(rules);
        bends.clear();
        let bent = rules.iter().filter(|r| r.traction.is_some());
        let bent = bent.fold(0, |bits, r| bits | 1u8 << r.face as usize);
        // tractions by layers are refused on clouds
        let Some(grid) = self.grid.as_ref().filter(|_| bent != 0) else {
            return;
        };
        let mut done = 0;
        for (face, range) in &self.layers {
            let axis = face.axis();
            // plain mirror images hold already, bent layers from the order in which they are filled
            let usable = |faces: u8| faces & bent == 0 || faces & !done == 0;
            let even = LayerRule::even(*face);
            let rule = rules.iter().find(|r| r.face == *face).unwrap_or(&even);
            for ghost in &self.ghosts[range.clone()] {
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
                    let lateral = grid.lateral(slots, (source, axis), usable);
                    let slope = slope(*face, traction, ghost.point as usize, &lateral);
                    let cells = [slot, source].map(|s| grid.cell(s, axis) as f64);
                    let distance = (cells[0] - cells[1]) * grid.spacing;
                    for (a, slots) in slots.iter_mut().enumerate() {
                        slots[slot] += distance * slope[a];
                        bend[(a, axis)] += 2.0 * slope[a];
                    }
                }
                bends.push(bend);
            }
            done |= 1u8 << *face as usize;
        }
    }

    /// Whether there are layer points.
    pub fn has_layers(&self) -> bool {
        !self.ghosts.is_empty()
    }

    /// The layer points as images of points, for the vector field of `continuation`.
    pub fn images<'a>(
        &'a self,
        continuation: &'a Continuation,
    ) -> impl Iterator<Item = Image> + 'a {
        let rules = &continuation.rules[..];
        let rule_of = |face: Face| rules.iter().find(|r| r.face == face);
        let scales = Face::ALL.map(|face| rule_of(face).map_or([1.0; 3], |r| r.scale));
        let bent = Face::ALL.map(|face| rule_of(face).is_some_and(|r| r.traction.is_some()));
        self.ghosts.iter().enumerate().map(move |(index, ghost)| {
            let mut image = Image {
                slot: ghost.slot as usize,
                point: ghost.point as usize,
                scale: [1.0; 3],
                mirror: [1.0; 3],
                bend: continuation.bends.get(index).copied().unwrap_or_default(),
                is_bent: (ghost.passes.iter().zip(bent)).any(|(&n, bent)| n > 0 && bent),
            };
            for (face, &passes) in Face::ALL.iter().zip(&ghost.passes) {
                for _ in 0..passes {
                    image.mirror[face.axis()] *= -1.0;
                    (0..3).for_each(|a| image.scale[a] *= scales[*face as usize][a]);
                }
            }
            if ghost.is_corner() {
                for (axis, scale) in image.scale.iter_mut().enumerate() {
                    *scale = Jump::at(ghost, rules, axis).map_or(*scale, |jump| jump.scale);
                }
            }
            image
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::family::{Correction, FamilySpec};
    use crate::shape::{BoxShape, Shape};

    #[test]
    fn where_faces_disagree_none_comes_first() {
        let rule = |face, scale, value| LayerRule {
            scale: [scale; 3],
            offset: [(1.0 - scale) * value; 3],
            ..LayerRule::even(face)
        };
        let rules = [
            rule(Face::XMax, -1.0, 1.0),
            rule(Face::YMin, -1.0, 7.0),
            rule(Face::YMax, -1.0, 1.0),
            rule(Face::ZMax, 0.0, 4.0),
            rule(Face::ZMin, 1.0, 0.0),
        ];
        let shape = Shape::Box(BoxShape {
            min: [0.0; 3],
            max: [0.4; 3],
        });
        let body = Body::fill("block", &shape, 3, 0.1, 0.5).expect("valid");
        let spec = FamilySpec {
            layers: rules.iter().map(|r| r.face).collect(),
            correction: Correction::None,
            ..FamilySpec::new(0.2)
        };
        let families = [Family::build(&body, &spec), Family::moving(&body, &spec)];
        for family in families.map(|f| f.expect("valid")) {
            let values: Vec<f64> = (0..body.points.len()).map(|i| i as f64).collect();
            let mut slots = vec![0.0; family.slots()];
            family.scatter(&values, 1, 0, &mut slots);
            family.fill_layers(&rules, 0, &mut slots);
            let behind = |faces: &[Face]| {
                let is = |g: &&Ghost| {
                    let passed = |f: &Face| faces.contains(f) == (g.passes[*f as usize] > 0);
                    Face::ALL.iter().all(passed)
                };
                let ghost = family.ghosts.iter().find(is).expect("behind each corner");
                (slots[ghost.slot as usize], f64::from(ghost.point))
            };
            use Face::{XMax, YMax, YMin, ZMax, ZMin};
            for faces in [&[XMax, YMin][..], &[XMax, YMin, ZMin]] {
                let (value, point) = behind(faces);
                assert_eq!(value, 8.0 - point);
            }
            assert_eq!(behind(&[XMax, ZMax]).0, 2.5);
            assert_eq!(behind(&[XMax, YMin, ZMax]).0, 4.0);
            // where they agree, or one has nothing to say, it is the image
            let (value, point) = behind(&[XMax, YMax]);
            assert_eq!(value, point);
            let (value, point) = behind(&[XMax, ZMin]);
            assert_eq!(value, 2.0 - point);
        }
    }
}
