//! Bonds of the points of a lattice: slots, what each of them mirrors, the stencil, and the weights of bonds by the
//! families of both ends.

use nalgebra::Vector3;
use rayon::prelude::*;

use crate::body::{Body, BoxImage, BoxImages, Face, Lattice};

use super::blocks::BLOCK;
use super::build::{Share, continued_faces, stretches};
use super::calibration::{Calibration, factor_along};
use super::images::{Layers, PointImage};
use super::layer::SlotGrid;
use super::store::RowBond;
use super::{Bond, FamilyError, FamilySpec, PointSlots, Slots, Stencil, StencilBond};

/// A slot without a point or layer point.
pub(super) const EMPTY: u32 = u32::MAX;

/// Data from which the bonds of all points of a lattice follow.
#[derive(Debug)]
pub(super) struct LatticeBonds {
    /// Offsets in slots and bonds of a complete family, without correction.
    pub(super) steps: Vec<(isize, Bond)>,
    pub(super) slot_of_point: Vec<u32>,
    /// The point that each slot carries or mirrors.
    pub(super) mirror_of: Vec<u32>,
    /// Whether each slot holds material.
    pub(super) present: Vec<bool>,
    /// Whether each slot belongs to an audited layer.
    pub(super) audited: Vec<bool>,
    pub(super) layers: Layers,
    calibration: Calibration,
    /// m.
    pub(super) horizon: f64,
    /// Factor of the bonds of complete families.
    lattice_factor: f64,
    /// Whether points have factors of their own.
    is_by_point: bool,
    complete: Vec<bool>,
    /// By point; empty where all are equal.
    factor: Vec<[f64; 3]>,
}

/// A bond of a point: its number in the stencil, the slot of its other end, and the bond without correction.
pub(super) struct Member<'a> {
    pub(super) step: u16,
    pub(super) slot: usize,
    pub(super) bond: &'a Bond,
}

impl LatticeBonds {
    /// Lays out slots, layers and the stencil; all points are present.
    ///
    /// # Errors
    /// A horizon that reaches no neighbour, or too many.
    pub(super) fn new(
        share: Share<'_>,
        lattice: &Lattice,
        spec: &FamilySpec,
    ) -> Result<(LatticeBonds, SlotGrid), FamilyError> {
        let body = share.body;
        let horizon = spec.horizon.of(lattice.spacing);
        let stencil = stencil(body, spec, horizon, lattice.spacing, body.points.volume[0]);
        if stencil.len() > usize::from(u16::MAX) {
            return Err(FamilyError::HorizonTooLarge {
                bonds: stencil.len(),
            });
        }
        if stencil.is_empty() {
            return Err(FamilyError::HorizonTooSmall {
                horizon,
                spacing: lattice.spacing,
            });
        }
        let reach = stencil.iter().map(|(step, _)| step[0]).max().unwrap_or(0);
        let padded = PaddedLattice::new(share, lattice, reach);
        let slot_of = |cell: [u32; 3]| {
            let slot = padded.slot(cell.map(i64::from));
            slot.expect("points lie inside the padded lattice") as u32
        };
        let slot_of_point: Vec<u32> = lattice.cells_of_points().map(slot_of).collect();
        let mut mirror_of = vec![EMPTY; padded.len()];
        for (point, &slot) in slot_of_point.iter().enumerate() {
            mirror_of[slot as usize] = point as u32;
        }
        let faces = continued_faces(body, spec);
        let layers = mirror(body, lattice, &faces, &padded, &mut mirror_of);
        let grid = SlotGrid::new(body, lattice, &padded, &mirror_of, &layers.ghosts);
        // a corner mirrors a mirror: it is audited when any face on its way is
        let mut audited = vec![false; padded.len()];
        for (face, range) in &layers.faces {
            for ghost in &layers.ghosts[range.clone()] {
                audited[ghost.slot as usize] =
                    spec.audited.contains(face) || audited[ghost.source as usize];
            }
        }
        let steps: Vec<(isize, Bond)> = stencil
            .iter()
            .map(|(step, bond)| (padded.offset(*step), *bond))
            .collect();
        let calibration = Calibration::new(body, spec);
        let lattice_factor = calibration.factors(horizon, steps.iter().map(|(_, b)| b))[0];
        let mut bonds = LatticeBonds {
            steps,
            slot_of_point,
            present: mirror_of.iter().map(|&point| point != EMPTY).collect(),
            mirror_of,
            audited,
            layers,
            calibration,
            horizon,
            lattice_factor,
            is_by_point: spec.correction.is_by_point(),
            complete: Vec::new(),
            factor: Vec::new(),
        };
        bonds.complete = bonds.points_amid(|slot| bonds.present[slot]);
        if bonds.is_by_point {
            let points = 0..body.points.len();
            bonds.factor = points
                .into_par_iter()
                .map(|p| bonds.find_factors(p))
                .collect();
        }
        Ok((bonds, grid))
    }

    /// By point, whether a condition holds for its slot and all slots of the stencil around it.
    fn points_amid(&self, holds: impl Fn(usize) -> bool) -> Vec<bool> {
        // number of slots from each slot on for which it holds
        let mut stretch = vec![0u16; self.present.len()];
        let mut following = 0u16;
        for (slot, stretch) in stretch.iter_mut().enumerate().rev() {
            following = match holds(slot) {
                true => following.saturating_add(1),
                false => 0,
            };
            *stretch = following;
        }
        // slots of the stencil that follow each other: the first and how many
        let mut offsets: Vec<isize> = self.steps.iter().map(|(offset, _)| *offset).collect();
        offsets.push(0);
        offsets.sort_unstable();
        let rows = offsets.chunk_by(|a, b| a + 1 == *b);
        let rows: Vec<(isize, u16)> = rows.map(|row| (row[0], row.len() as u16)).collect();
        let is_amid = |&slot: &u32| {
            rows.iter().all(|&(first, len)| {
                let first = (slot as usize).wrapping_add_signed(first);
                stretch.get(first).is_some_and(|stretch| *stretch >= len)
            })
        };
        self.slot_of_point.par_iter().map(is_amid).collect()
    }

    /// By point, whether all bonds have the weights of the stencil, if nothing cuts them.
    pub(super) fn even_points(&self) -> Vec<bool> {
        match self.is_by_point {
            true => self.points_amid(|slot| match self.mirror_of[slot] {
                EMPTY => false,
                point => self.complete[point as usize],
            }),
            false => self.complete.clone(),
        }
    }

    /// The slot of a neighbour, if there is material.
    fn neighbour(&self, slot: u32, offset: isize) -> Option<usize> {
        let other = (slot as usize).wrapping_add_signed(offset);
        self.present.get(other).is_some_and(|p| *p).then_some(other)
    }

    /// Whether the slots around a point complete all bonds of the stencil.
    fn finds_complete(&self, point: usize) -> bool {
        let slot = self.slot_of_point[point];
        let mut steps = self.steps.iter();
        steps.all(|(o, _)| self.neighbour(slot, *o).is_some())
    }

    /// Factors along the axes; equal to that of the lattice where the family is complete. A cut does not count as missing
    /// material: bonds are not corrected at a crack (docs/theory/heat_conduction.md, "Calibration").
    fn find_factors(&self, point: usize) -> [f64; 3] {
        if self.complete[point] {
            return [self.lattice_factor; 3];
        }
        let present = self.members(point).map(|m| m.bond);
        // a point without neighbours has no bond to correct
        match present.clone().next() {
            Some(_) => self.calibration.factors(self.horizon, present),
            None => [self.lattice_factor; 3],
        }
    }

    /// Whether the family of a point is complete.
    pub(super) fn is_complete(&self, point: usize) -> bool {
        self.complete[point]
    }

    /// Bonds of a point, in the order of the stencil.
    pub(super) fn members(&self, point: usize) -> impl Iterator<Item = Member<'_>> + Clone {
        let slot = self.slot_of_point[point];
        let steps = (0u16..).zip(&self.steps);
        steps.filter_map(move |(step, (offset, bond))| {
            let slot = self.neighbour(slot, *offset)?;
            Some(Member { step, slot, bond })
        })
    }

    /// Whether the weights of some bonds of a point differ from the stencil.
    pub(super) fn is_uneven(&self, point: usize) -> bool {
        let truncated = |point: usize| !self.complete[point];
        let mut slots = self.members(point).map(|m| m.slot);
        self.is_by_point
            && (truncated(point) || slots.any(|s| truncated(self.mirror_of[s] as usize)))
    }

    /// Weights of a bond of a point by its own family and by that of the other end.
    pub(super) fn weights(&self, point: usize, member: &Member<'_>) -> [f64; 2] {
        let ends = [point, self.mirror_of[member.slot] as usize];
        let factors = match self.is_by_point {
            true => ends.map(|p| factor_along(member.bond, &self.factor[p])),
            false => [self.lattice_factor; 2],
        };
        factors.map(|factor| member.bond.weight * factor)
    }

    /// A bond of a point for the list of its bonds.
    pub(super) fn row_bond(&self, point: usize, member: &Member<'_>) -> RowBond {
        RowBond {
            step: member.step,
            column: member.slot as u32,
            weights: self.weights(point, member),
        }
    }

    /// Computes completeness and factors of these points again; returns the points for which one of them differs.
    pub(super) fn recalibrate(&mut self, points: &[u32]) -> Vec<u32> {
        let complete: Vec<bool> = points
            .par_iter()
            .map(|&p| self.finds_complete(p as usize))
            .collect();
        let mut differ = vec![false; points.len()];
        for ((&point, complete), differ) in points.iter().zip(complete).zip(&mut differ) {
            let before = std::mem::replace(&mut self.complete[point as usize], complete);
            *differ = before != complete;
        }
        if self.is_by_point {
            let factor: Vec<[f64; 3]> = points
                .par_iter()
                .map(|&p| self.find_factors(p as usize))
                .collect();
            for ((&point, factor), differ) in points.iter().zip(factor).zip(&mut differ) {
                let before = std::mem::replace(&mut self.factor[point as usize], factor);
                *differ |= before != factor;
            }
        }
        let differ = points.iter().zip(differ).filter(|(_, d)| *d);
        differ.map(|(&point, _)| point).collect()
    }

    pub(super) fn memory(&self) -> usize {
        size_of_val(&*self.slot_of_point)
            + size_of_val(&*self.mirror_of)
            + size_of_val(&*self.factor)
            + 2 * self.present.len()
            + self.complete.len()
    }

    /// The slots of points and ghosts.
    pub(super) fn slots(&self, share: Share<'_>) -> Slots {
        let (owned, remote) = self.slot_of_point.split_at(share.owned);
        let mut slots = Slots {
            // lanes of the last block that are no points reach a little beyond
            len: self.mirror_of.len() + BLOCK,
            points: PointSlots::Ascending(stretches(owned, |_| true)),
            remote: remote.iter().copied().zip(share.owned as u32..).collect(),
            periodic: share.body.periodic,
            ..Slots::default()
        };
        slots.set_ghosts(self.layers.clone());
        slots
    }

    /// The bonds of complete families.
    pub(super) fn stencil(&self, grid: SlotGrid) -> Stencil {
        let factor = self.lattice_factor;
        let corrected = |(offset, bond): &(isize, Bond)| StencilBond {
            offset: *offset,
            bond: Bond {
                weight: bond.weight * factor,
                dual: bond.weight * factor,
                ..*bond
            },
        };
        let bonds = self.steps.iter().map(corrected).collect();
        Stencil { grid, bonds }
    }
}

/// The cells of a lattice around the points, with a margin for the layers; slots are its cells, x fastest.
pub(super) struct PaddedLattice {
    /// The lowest cell, in those of the lattice.
    pub(super) first: [i64; 3],
    pub(super) cells: [usize; 3],
    /// Width of the margin along each axis, in cells.
    pub(super) pad: [i64; 3],
}

impl PaddedLattice {
    fn new(share: Share<'_>, lattice: &Lattice, reach: i64) -> Self {
        let is_along = |axis: usize| axis < share.body.dimension;
        let pad = std::array::from_fn(|axis| if is_along(axis) { reach } else { 0 });
        let (mut first, mut cells) = ([0; 3], [0; 3]);
        for axis in 0..3 {
            let along = || lattice.cells_of_points().map(|c| i64::from(c[axis]));
            let (low, high) = match share.is_whole() {
                true => (0, lattice.cells[axis] as i64 - 1),
                false => (along().min().unwrap_or(0), along().max().unwrap_or(0)),
            };
            first[axis] = low - pad[axis];
            cells[axis] = (high + pad[axis] - first[axis] + 1) as usize;
        }
        PaddedLattice { first, cells, pad }
    }

    fn slot(&self, cell: [i64; 3]) -> Option<usize> {
        let shifted: [i64; 3] = std::array::from_fn(|a| cell[a] - self.first[a]);
        let inside = (0..3).all(|a| shifted[a] >= 0 && shifted[a] < self.cells[a] as i64);
        let [i, j, k] = shifted.map(|c| c as usize);
        inside.then(|| (k * self.cells[1] + j) * self.cells[0] + i)
    }

    fn len(&self) -> usize {
        self.cells.iter().product()
    }

    fn offset(&self, step: [i64; 3]) -> isize {
        ((step[2] * self.cells[1] as i64 + step[1]) * self.cells[0] as i64 + step[0]) as isize
    }
}

/// Members of a complete family of the given horizon (m) on a lattice of points of the given spacing (m) and volume (m³),
/// as lattice steps, with influence and partial volumes, ordered z, y, x. Lengths are compared in spacings.
pub(super) fn stencil(
    body: &Body,
    spec: &FamilySpec,
    horizon: f64,
    spacing: f64,
    volume: f64,
) -> Vec<([i64; 3], Bond)> {
    let moment = spec.moment(body, horizon);
    let horizon = horizon / spacing;
    let cut = spec.reach(horizon, 1.0);
    let reach: [i64; 3] = std::array::from_fn(|a| {
        if a < body.dimension {
            cut.floor() as i64
        } else {
            0
        }
    });
    let mut members = Vec::new();
    for k in -reach[2]..=reach[2] {
        for j in -reach[1]..=reach[1] {
            for i in -reach[0]..=reach[0] {
                let step = [i, j, k];
                let length = step.iter().map(|s| (s * s) as f64).sum::<f64>().sqrt();
                if length == 0.0 || length > cut {
                    continue;
                }
                let share = spec.share(horizon, 1.0, length);
                let weight = share * volume / moment;
                let xi = step.map(|s| s as f64 * spacing);
                members.push((step, Bond::new(xi, length * spacing, [weight; 2])));
            }
        }
    }
    members
}

/// Layer points behind `faces`, each the image of a point or of an earlier layer point, a copy where the body is periodic. They
/// are made by going through the faces again and again until edges, corners and bodies thinner than the horizon are complete.
fn mirror(
    body: &Body,
    lattice: &Lattice,
    faces: &[Face],
    padded: &PaddedLattice,
    mirror_of: &mut [u32],
) -> Layers {
    let ends = [[0.0; 3], lattice.cells.map(|n| n as f64)];
    let reach = padded.pad.into_iter().max().unwrap_or(0) as f64;
    let images = BoxImages::of_box(ends, body.periodic, faces, reach);
    let centre = |point: u32| {
        let cell = lattice.cell(point as usize);
        Vector3::from(cell.map(|c| f64::from(c) + 0.5))
    };
    let slot = |point: u32, image: BoxImage| {
        let at = image.of(centre(point));
        padded.slot(at.map(|x| x.floor() as i64).into())
    };
    let mut near = Vec::new();
    for point in 0..lattice.points() as u32 {
        images.for_each_near(&centre(point), |image, _| {
            if let Some(step) = image.last_step(body.periodic)
                && slot(point, image).is_some()
            {
                near.push(PointImage {
                    point,
                    image,
                    face: step.face,
                    order: step.pass,
                });
            }
        });
    }
    near.sort_by_key(|i| (i.order, i.face, i.point, i.image.n));
    let in_slot = |point: u32, image: BoxImage| {
        let slot = slot(point, image);
        slot.expect("points and their images lie inside the padded lattice") as u32
    };
    let place = |i: &PointImage, _| {
        let slot = in_slot(i.point, i.image);
        mirror_of[slot as usize] = i.point;
        slot
    };
    let slot_of = |point| in_slot(point, BoxImage::ORIGINAL);
    Layers::new(&near, body.periodic, slot_of, place)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slots_and_cells_of_a_padded_lattice_belong_together() {
        let padded = PaddedLattice {
            first: [-2, -1, 0],
            cells: [7, 5, 4],
            pad: [2, 1, 0],
        };
        let rows = (0..4).flat_map(|k| (-1..4).map(move |j| (j, k)));
        let cells = rows.flat_map(|(j, k)| (-2..5).map(move |i| [i, j, k]));
        for (slot, cell) in cells.enumerate() {
            assert_eq!(padded.slot(cell), Some(slot), "{cell:?}");
        }
        assert_eq!(padded.slot([-3, 0, 0]), None);
        assert_eq!(padded.slot([5, 0, 0]), None);
    }
}
