//! Construction of a family: slots, mirrored layers, completeness, corrections, rows, chunks.

use std::ops::Range;
use std::sync::OnceLock;

use nalgebra::Vector3;
use rayon::prelude::*;

use crate::body::{self, Body, Discretisation, Face, Lattice, Part};

use super::blocks::{BLOCK, BlockBuilder};
use super::lattice::{LatticeBonds, Member};
use super::{Chunk, Family, FamilyError, FamilySpec, Rows, Span, StencilBonds, Store};
use crate::body::{Cut, severed};

/// Points per chunk: small enough to balance two to many cores, large enough to amortise.
const CHUNK_POINTS: u32 = 4096;

/// Points whose bonds are gathered by one thread.
const PART_POINTS: usize = 1 << 14;

impl Family {
    /// Lays out the family of every point of `body`.
    ///
    /// # Errors
    /// [`FamilyError`] when the horizon reaches no neighbour or a point has none.
    pub fn build(body: &Body, spec: &FamilySpec) -> Result<Family, FamilyError> {
        Family::of_share(Share::whole(body), spec)
    }

    /// Lays out the family of the points that a part of a body owns. Slots of remote points are filled by an exchange
    /// ([`Family::remote`]).
    ///
    /// # Errors
    /// See [`Family::build`]; also for corrections that need the whole body.
    pub fn of_part(part: &Part, spec: &FamilySpec) -> Result<Family, FamilyError> {
        let share = Share {
            body: &part.body,
            owned: part.owned,
            numbers: Some(&part.numbers),
        };
        Family::of_share(share, spec)
    }

    /// The family of some points of a body.
    ///
    /// # Errors
    /// See [`Family::of_part`].
    pub(crate) fn of_share(share: Share<'_>, spec: &FamilySpec) -> Result<Family, FamilyError> {
        if share.body.tank.is_some() {
            return Err(FamilyError::Tank);
        }
        let mut family = match &share.body.discretisation {
            Discretisation::Lattice(lattice) => Family::on_lattice(share, lattice, spec),
            Discretisation::Cloud(_) => Family::on_cloud(share, spec),
            Discretisation::Layers(_) => Err(FamilyError::Layers),
        }?;
        family.forget_unreached();
        Ok(family)
    }

    /// Keeps those remote points only that bonds reach, directly or by an image, and those beside the points of images, whose slopes along the face
    /// the layers under traction follow.
    pub(super) fn forget_unreached(&mut self) {
        if self.slots.remote.is_empty() {
            return;
        }
        let mut is_reached = vec![false; self.slots.len];
        for point in 0..self.points {
            self.for_each_bond(point, |_, _, slot| is_reached[slot] = true);
        }
        let grid = self.store.stencil().map(|stencil| &stencil.grid);
        for (face, ghosts) in self.slots.layers().rev() {
            for ghost in ghosts.iter().rev() {
                let source = ghost.source as usize;
                if !is_reached[ghost.slot as usize] {
                    continue;
                }
                is_reached[source] = true;
                if let Some(grid) = grid {
                    (grid.beside(source, face.axis())).for_each(|slot| is_reached[slot] = true);
                }
            }
        }
        self.slots
            .remote
            .retain(|(slot, _)| is_reached[*slot as usize]);
    }

    fn on_lattice(
        share: Share<'_>,
        lattice: &Lattice,
        spec: &FamilySpec,
    ) -> Result<Family, FamilyError> {
        let body = share.body;
        let (bonds, grid) = LatticeBonds::new(share, lattice, spec)?;
        let gathering = Gathering {
            share,
            spec,
            bonds: &bonds,
            cuts: cuts(body, spec),
            even: bonds.even_points(),
        };
        let starts = (0..body.points.len()).into_par_iter().step_by(PART_POINTS);
        let parts: Vec<Result<Gathered, FamilyError>> = starts
            .map(|first| gathering.gather(first..(first + PART_POINTS).min(body.points.len())))
            .collect();
        let mut all = Gathered::new(bonds.steps.len());
        for part in parts {
            all.append(part?);
        }
        let Gathered {
            rows,
            layer_rows,
            blocks,
            remote,
            in_runs,
            number,
        } = all;
        let stencil = bonds.stencil(grid);
        let store = match body.store {
            body::Store::List => Store::List(stencil, rows),
            body::Store::Lattice => {
                let bonds = StencilBonds {
                    stencil,
                    runs: stretches(&bonds.slot_of_point[..share.owned], |p| in_runs[p]),
                    blocks: blocks.finish(),
                    remote: remote.finish(),
                };
                Store::Lattice(bonds, OnceLock::new())
            }
        };
        Ok(Family {
            spec: spec.clone(),
            points: share.owned,
            of_body: share.body.points.len(),
            bonds: number,
            chunks: chunks(&store),
            slots: bonds.slots(share),
            store,
            layer_rows,
        })
    }
}

/// What the bonds of the points of a lattice follow from.
struct Gathering<'a> {
    share: Share<'a>,
    spec: &'a FamilySpec,
    bonds: &'a LatticeBonds,
    cuts: Vec<Cut>,
    /// By point, whether its bonds have the weights of the stencil, if nothing cuts them.
    even: Vec<bool>,
}

/// The bonds of consecutive points.
struct Gathered {
    rows: Rows,
    layer_rows: Rows,
    blocks: BlockBuilder,
    remote: BlockBuilder,
    /// By owned point, whether its bonds are those of the stencil.
    in_runs: Vec<bool>,
    /// Number of bonds.
    number: usize,
}

impl Gathering<'_> {
    /// The bonds of some points.
    ///
    /// # Errors
    /// A point without neighbours.
    fn gather(&self, points: Range<usize>) -> Result<Gathered, FamilyError> {
        let (bonds, body, owned) = (self.bonds, self.share.body, self.share.owned);
        let mut found = Gathered::new(bonds.steps.len());
        for point in points {
            let slot = bonds.slot_of_point[point];
            let from = &body.points.position.at(point);
            let end = |m: &Member<'_>| from + Vector3::from(m.bond.xi);
            let is_whole = |m: &Member<'_>| !severed(&self.cuts, from, &end(m));
            let members = || bonds.members(point).filter(is_whole);
            let count = if bonds.is_complete(point) && self.cuts.is_empty() {
                bonds.steps.len()
            } else {
                members().count()
            };
            let own = || members().map(|m| (usize::from(m.step), bonds.weights(point, &m)));
            let is_even = count == bonds.steps.len() && self.even[point];
            if point >= owned {
                if !is_even {
                    found.remote.push(point as u32, slot, own());
                }
                continue;
            }
            if count == 0 {
                return Err(FamilyError::NoNeighbours {
                    at: (*from).into(),
                    horizon: bonds.horizon,
                });
            }
            found.number += count;
            let weighted = |m: Member<'_>| bonds.row_bond(point, &m);
            let is_list = body.store == body::Store::List;
            found.in_runs.push(is_even && !is_list);
            if is_list {
                found.rows.push(point, slot, members().map(weighted));
            } else if !is_even {
                found.blocks.push(point as u32, slot, own());
            }
            if !self.spec.audited.is_empty() && members().any(|m| bonds.audited[m.slot]) {
                let from_layer = members().filter(|m| bonds.audited[m.slot]);
                (found.layer_rows).push(point, slot, from_layer.map(weighted));
            }
        }
        Ok(found)
    }
}

impl Gathered {
    /// The bonds of no point; `stencil` is the number of those of a complete family.
    fn new(stencil: usize) -> Self {
        Gathered {
            rows: Rows::new(),
            layer_rows: Rows::new(),
            blocks: BlockBuilder::new(stencil),
            remote: BlockBuilder::new(stencil),
            in_runs: Vec::new(),
            number: 0,
        }
    }

    /// Adds the bonds of the points that follow.
    fn append(&mut self, next: Gathered) {
        self.rows.append(next.rows);
        self.layer_rows.append(next.layer_rows);
        self.blocks.append(next.blocks);
        self.remote.append(next.remote);
        self.in_runs.extend(next.in_runs);
        self.number += next.number;
    }
}

/// The points of a body whose bonds a family has.
#[derive(Clone, Copy)]
pub(crate) struct Share<'a> {
    pub(crate) body: &'a Body,
    /// Number of these points, which are the first of the body. Others are remote.
    pub(crate) owned: usize,
    /// Number of each point in the whole body; `None` where this is the whole body.
    pub(crate) numbers: Option<&'a [u32]>,
}

impl<'a> Share<'a> {
    /// All points.
    pub(crate) fn whole(body: &'a Body) -> Self {
        Share {
            body,
            owned: body.points.len(),
            numbers: None,
        }
    }

    /// Number of a point in the whole body, which orders bonds.
    pub(super) fn number(self, point: usize) -> u32 {
        self.numbers.map_or(point as u32, |numbers| numbers[point])
    }

    pub(super) fn is_whole(self) -> bool {
        self.owned == self.body.points.len()
    }
}

/// The faces behind which the body continues, as a mirror image or as a copy.
pub(super) fn continued_faces(body: &Body, spec: &FamilySpec) -> Vec<Face> {
    let goes_on = |f: &Face| spec.layers.contains(f) || body.periodic[f.axis()];
    let faces = Face::ALL.into_iter().filter(|f| f.axis() < body.dimension);
    faces.filter(goes_on).collect()
}

/// The cuts of the body and their images behind the faces where it continues.
pub(super) fn cuts(body: &Body, spec: &FamilySpec) -> Vec<Cut> {
    let mut cuts = body.cuts.clone();
    for face in continued_faces(body, spec) {
        let position = body.face_position(face);
        let image = |cut: &Cut| match body.periodic[face.axis()] {
            true => cut.shifted(face, body.extent(face.axis())),
            false => cut.mirrored(face, position),
        };
        let images: Vec<Cut> = cuts.iter().map(image).collect();
        cuts.extend(images);
    }
    cuts
}

/// Maximal stretches of consecutive points in consecutive slots that satisfy `keep`.
pub(super) fn stretches(slot_of_point: &[u32], keep: impl Fn(usize) -> bool) -> Vec<Span> {
    let mut spans: Vec<Span> = Vec::new();
    for (point, &slot) in slot_of_point.iter().enumerate().filter(|(p, _)| keep(*p)) {
        match spans.last_mut() {
            Some(s) if s.point + s.len == point as u32 && s.slot + s.len == slot => s.len += 1,
            _ => spans.push(Span {
                slot,
                point: point as u32,
                len: 1,
            }),
        }
    }
    spans
}

/// The parts of a sweep.
pub(super) fn chunks(store: &Store) -> Vec<Chunk> {
    let parts = |len: usize, step: usize| {
        let starts = (0..len).step_by(step);
        starts.map(move |first| first..(first + step).min(len))
    };
    let mut chunks = Vec::new();
    if let Some(rows) = store.rows() {
        // a row costs a few times a lane of a run
        let rows = parts(rows.point.len(), CHUNK_POINTS as usize / 4);
        chunks.extend(rows.map(|rows| Chunk {
            rows,
            ..Chunk::default()
        }));
    }
    let Some(bonds) = store.stencil_bonds() else {
        return chunks;
    };
    let (mut first, mut points) = (0, 0);
    for (index, run) in bonds.runs.iter().enumerate() {
        points += run.len;
        if points >= CHUNK_POINTS || index + 1 == bonds.runs.len() {
            chunks.push(Chunk {
                runs: first..index + 1,
                ..Chunk::default()
            });
            (first, points) = (index + 1, 0);
        }
    }
    let blocks = parts(bonds.blocks.head.len(), CHUNK_POINTS as usize / BLOCK / 2);
    chunks.extend(blocks.map(|blocks| Chunk {
        blocks,
        ..Chunk::default()
    }));
    chunks
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stretches_are_as_long_as_points_and_slots_follow_each_other() {
        let slot_of_point = [4, 5, 6, 9, 10, 11, 12];
        let spans = stretches(&slot_of_point, |point| point != 5);
        let found: Vec<_> = spans.iter().map(|s| (s.point, s.slot, s.len)).collect();
        assert_eq!(found, [(0, 4, 3), (3, 9, 2), (6, 12, 1)]);
    }
}
