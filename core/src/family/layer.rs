//! Layers behind faces: how fields continue there, and layer points as images of points.
//!
//! A value that is prescribed on a face is mirrored, odd or even. A *traction* is prescribed by the
//! strain that it makes (Wang (2025), eqs. 4.24 to 4.28; corrected, see docs/theory/mechanics.md):
//!
//! ```text
//! u(layer) = u(mirror) + (x(layer) - x(mirror)) q
//! ```
//!
//! with the distance along the normal and q the derivative of the displacement along the axis of the
//! normal, which the physics derives from the traction and the derivatives along the face. Exact for
//! affine fields. Such an operator is not symmetric.

use std::sync::Arc;

use nalgebra::{Matrix3, Vector3};

use crate::body::{Body, Face, Lattice};

use super::lattice::{EMPTY, PaddedLattice};
use super::{Family, Ghost, SlotField, Stencil};

/// How a field continues in the mirrored layer behind a face:
/// `value(layer point) = scale * value(mirror point) + offset`, component by component
/// (scalars use the first). Prescribed value `b`: scale -1, offset 2 b (Wang (2025),
/// eq. 7.17); constant layer: 0, b; insulated: 1, 0.
#[derive(Clone, Debug, PartialEq)]
pub struct LayerRule {
    /// The face.
    pub face: Face,
    /// Factors on the mirrored components.
    pub scale: [f64; 3],
    /// Added to the mirrored components, in the unit of the field.
    pub offset: [f64; 3],
    /// Value prescribed on the face in front of each point of the body, where it is not uniform; replaces the offset of
    /// scalar fields.
    pub values: Option<Arc<[f64]>>,
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
            values: None,
            traction: None,
        }
    }

    /// The value on the face in front of a point, where the rule prescribes one.
    pub fn prescribed(&self, component: usize, point: u32) -> Option<f64> {
        let scale = self.scale[component];
        (scale != 1.0).then(|| self.offset_of(component, point) / (1.0 - scale))
    }

    /// Offset of a component of the image of a point.
    pub(super) fn offset_of(&self, component: usize, point: u32) -> f64 {
        match &self.values {
            Some(values) => (1.0 - self.scale[component]) * values[point as usize],
            None => self.offset[component],
        }
    }

    /// Whether the rule adds something to the image of a component.
    pub(super) fn has_offset(&self, component: usize) -> bool {
        self.values.is_some() || self.offset[component] != 0.0
    }

    /// Whether the forces of a body on the images of its points leave its stiffness symmetric: a mirror image, or a layer that does not move with
    /// the points.
    pub fn is_symmetric(&self, dimension: usize) -> bool {
        let mut mirror = [1.0; 3];
        mirror[self.face.axis()] = -1.0;
        self.traction.is_none() && (self.scale == mirror || is_constant(&self.scale, dimension))
    }

    /// The rule without what it prescribes: for differences of two fields.
    pub fn homogeneous(&self) -> Self {
        let none = Traction {
            stress: [0.0; 3],
            difference: true,
        };
        LayerRule {
            scale: self.scale,
            traction: self.traction.map(|_| none),
            ..LayerRule::even(self.face)
        }
    }
}

/// How a vector field currently continues, see [`WithTractions`](super::WithTractions).
#[derive(Clone, Debug, Default)]
pub struct Continuation {
    pub(super) rules: Vec<LayerRule>,
    /// By layer point; empty without tractions.
    pub(super) bends: Vec<Matrix3<f64>>,
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
                layout.disagree[faces[0]][faces[1]] = std::array::from_fn(|a| {
                    match (rule.prescribed(a, 0), other.prescribed(a, 0)) {
                        (Some(value), Some(other)) => value != other,
                        _ => false,
                    }
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
pub(super) struct Jump {
    /// Mean of what the faces prescribe.
    pub(super) mean: f64,
    /// Factor on the deviation of the point from the mean.
    pub(super) scale: f64,
}

impl Jump {
    /// `None` where the faces of `corner` agree.
    pub(super) fn at(corner: &Ghost, rules: &[LayerRule], component: usize) -> Option<Jump> {
        let passed = |r: &&LayerRule| corner.passes[r.face as usize] > 0;
        let faces = || {
            let rules = rules.iter().filter(passed);
            rules.filter_map(|r| Some((r.prescribed(component, corner.point)?, r.scale[component])))
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
    /// Contribution of tractions to the gradient.
    pub bend: Matrix3<f64>,
    /// Whether the layer point lies behind a face under traction.
    pub is_bent: bool,
}

/// Whether a layer with these factors does not move with the points.
fn is_constant(scale: &[f64; 3], dimension: usize) -> bool {
    scale[..dimension].iter().all(|s| *s == 0.0)
}

impl Image {
    /// Whether the image does not move with its point, in a body of so many dimensions.
    pub fn is_constant(&self, dimension: usize) -> bool {
        is_constant(&self.scale, dimension)
    }

    /// Whether the body and its image form one body that deforms symmetrically: components change sign across the
    /// faces to which they are normal, and only there.
    pub fn is_symmetric(&self) -> bool {
        self.scale == self.mirror && !self.is_bent
    }
}

/// The cells of slots and their content.
#[derive(Debug)]
pub(super) struct SlotGrid {
    cells: [usize; 3],
    /// The lowest slot, in those of the whole body.
    first: [usize; 3],
    /// Slots of the whole body along each axis.
    whole: [usize; 3],
    /// Slots before the first cell of the whole body along x.
    margin: usize,
    /// Lower corner of the slots of the whole body, m.
    origin: Vector3<f64>,
    pub(super) spacing: f64,
    dimension: usize,
    /// The faces that mirrored the content of each slot, one bit each; zero for points.
    pub(super) mirrored: Vec<u8>,
}

/// A slot without a point or layer point.
const NOTHING: u8 = u8::MAX;

impl SlotGrid {
    pub(super) fn new(
        body: &Body,
        lattice: &Lattice,
        padded: &PaddedLattice,
        mirror_of: &[u32],
        ghosts: &[Ghost],
    ) -> Self {
        let dimension = body.dimension;
        let margin = Vector3::from(padded.pad.map(|p| p as f64 * lattice.spacing));
        let content = mirror_of
            .iter()
            .map(|&m| if m == EMPTY { NOTHING } else { 0 });
        let mut mirrored: Vec<u8> = content.collect();
        for ghost in ghosts {
            let bits = ghost.passes.iter().enumerate();
            mirrored[ghost.slot as usize] =
                bits.fold(0, |bits, (face, &n)| bits | u8::from(n > 0) << face);
        }
        SlotGrid {
            cells: padded.cells,
            first: std::array::from_fn(|a| (padded.first[a] + padded.pad[a]) as usize),
            whole: std::array::from_fn(|a| lattice.cells[a] + 2 * padded.pad[a] as usize),
            margin: padded.pad[0] as usize,
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

    /// The lowest slot in those of the whole body, and the number of these, along each axis.
    pub(super) fn in_whole(&self) -> [[usize; 3]; 2] {
        [self.first, self.whole]
    }

    /// Cell of the whole body along x that follows a slot; slots before the first one count down from `usize::MAX`.
    pub(super) fn cell_of_row(&self, slot: usize) -> usize {
        (slot % self.cells[0] + self.first[0]).wrapping_sub(self.margin)
    }

    pub(super) fn stride(&self, axis: usize) -> usize {
        self.cells[..axis].iter().product()
    }

    pub(super) fn cell(&self, slot: usize, axis: usize) -> usize {
        slot / self.stride(axis) % self.cells[axis]
    }

    /// Centre of a slot along an axis, m.
    pub(super) fn position(&self, slot: usize, axis: usize) -> f64 {
        let cell = self.cell(slot, axis) + self.first[axis];
        self.origin[axis] + (cell as f64 + 0.5) * self.spacing
    }

    /// The slots beside a slot along an axis, below and above.
    fn along(&self, slot: usize, axis: usize) -> [Option<usize>; 2] {
        let (stride, cell) = (self.stride(axis), self.cell(slot, axis));
        [
            (cell > 0).then(|| slot - stride),
            (cell + 1 < self.cells[axis]).then(|| slot + stride),
        ]
    }

    /// The slots beside a slot along all axes but `normal`.
    pub(super) fn beside(&self, slot: usize, normal: usize) -> impl Iterator<Item = usize> {
        let axes = (0..self.dimension).filter(move |axis| *axis != normal);
        axes.flat_map(move |axis| self.along(slot, axis).into_iter().flatten())
    }

    /// Derivatives of a field along all axes but `normal`, central where there are `usable` neighbours
    /// on both sides; the argument of `usable` is the faces that mirrored them.
    pub(super) fn lateral(
        &self,
        field: &[SlotField],
        slot: usize,
        normal: usize,
        usable: impl Fn(u8) -> bool,
    ) -> Matrix3<f64> {
        let usable = |s: &usize| self.mirrored[*s] != NOTHING && usable(self.mirrored[*s]);
        let mut gradient = Matrix3::zeros();
        for axis in (0..self.dimension).filter(|a| *a != normal) {
            let [below, above] = self.along(slot, axis).map(|slot| slot.filter(&usable));
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
        let Some(Stencil { grid, .. }) = self.store.stencil() else {
            return Vec::new();
        };
        let first = self.slot_of(0);
        let cell = |slot: usize| -> [i64; 3] {
            std::array::from_fn(|a| grid.cell(slot, a) as i64 - grid.cell(first, a) as i64)
        };
        let layers = self.slots.ghosts.iter();
        layers.map(|g| (g.slot, cell(g.slot as usize))).collect()
    }

    /// Number of layer points.
    pub fn layer_points(&self) -> usize {
        self.slots.ghosts.len()
    }

    /// Whether the body continues in layers behind faces, also where a part has none of their points.
    pub fn has_layers(&self) -> bool {
        !self.spec.layers.is_empty()
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
        self.slots
            .ghosts
            .iter()
            .enumerate()
            .map(move |(index, ghost)| {
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
