//! Construction of a family: slots, mirrored layers, completeness, corrections, rows, chunks.

use std::collections::BTreeMap;
use std::sync::OnceLock;

use nalgebra::Vector3;

use crate::body::{Body, Discretisation, Face, Lattice, Store};

use super::blocks::{self, BLOCK};
use super::calibration::{Calibration, factor_along};
use super::layer::Grid;
use super::{
    Bond, Chunk, Cut, Family, FamilyError, FamilySpec, Ghost, Order, Rows, Span, StencilBond,
};

/// Points per chunk: small enough to balance two to many cores, large enough to amortise.
const CHUNK_POINTS: u32 = 4096;

/// No layer, no point.
pub(super) const EMPTY: u32 = u32::MAX;

/// The lattice with a margin that holds the layers; slots are its cells, x fastest.
struct Padded {
    cells: [usize; 3],
    pad: [usize; 3],
}

impl Padded {
    fn slot(&self, cell: [i64; 3]) -> Option<usize> {
        let shifted: [i64; 3] = std::array::from_fn(|a| cell[a] + self.pad[a] as i64);
        let inside = (0..3).all(|a| shifted[a] >= 0 && shifted[a] < self.cells[a] as i64);
        let [i, j, k] = shifted.map(|c| c as usize);
        inside.then(|| (k * self.cells[1] + j) * self.cells[0] + i)
    }

    fn cell(&self, slot: usize) -> [i64; 3] {
        let [nx, ny, _] = self.cells;
        let shifted = [slot % nx, slot / nx % ny, slot / (nx * ny)];
        std::array::from_fn(|a| shifted[a] as i64 - self.pad[a] as i64)
    }

    fn len(&self) -> usize {
        self.cells.iter().product()
    }

    fn offset(&self, step: [i64; 3]) -> isize {
        ((step[2] * self.cells[1] as i64 + step[1]) * self.cells[0] as i64 + step[0]) as isize
    }
}

impl Family {
    /// Lays out the family of every point of `body`.
    ///
    /// # Errors
    /// [`FamilyError`] when the horizon reaches no neighbour or a point has none.
    pub fn build(body: &Body, spec: &FamilySpec) -> Result<Family, FamilyError> {
        if body.tank.is_some() {
            return Err(FamilyError::Tank);
        }
        match &body.discretisation {
            Discretisation::Lattice(lattice) => Family::on_lattice(body, lattice, spec),
            Discretisation::Cloud(_) => Family::on_cloud(body, spec),
        }
    }

    fn on_lattice(
        body: &Body,
        lattice: &Lattice,
        spec: &FamilySpec,
    ) -> Result<Family, FamilyError> {
        let horizon = spec.horizon.of(lattice.spacing);
        let stencil = stencil(body, lattice.spacing, spec);
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
        let pad: [usize; 3] = std::array::from_fn(|a| {
            if a < body.dimension {
                reach as usize
            } else {
                0
            }
        });
        let padded = Padded {
            cells: std::array::from_fn(|a| lattice.cells[a] + 2 * pad[a]),
            pad,
        };

        // slot -> the point whose state the slot carries or mirrors
        let mut mirror_of = vec![EMPTY; padded.len()];
        let slot_of_point: Vec<u32> = lattice
            .cell_of_point
            .iter()
            .map(|cell| {
                padded
                    .slot(cell.map(i64::from))
                    .expect("points lie inside the padded lattice") as u32
            })
            .collect();
        for (point, &slot) in slot_of_point.iter().enumerate() {
            mirror_of[slot as usize] = point as u32;
        }
        let faces = continued_faces(body, spec);
        let (ghosts, layers) = mirror(body, lattice, (&faces, &padded), reach, &mut mirror_of);
        let grid = Grid::new(
            body,
            lattice,
            (padded.cells, padded.pad),
            &mirror_of,
            &ghosts,
        );
        // a corner mirrors a mirror: it is audited when any face on its way is
        let mut audited = vec![false; padded.len()];
        for (face, range) in &layers {
            for ghost in &ghosts[range.clone()] {
                audited[ghost.slot as usize] =
                    spec.audited.contains(face) || audited[ghost.source as usize];
            }
        }

        let cuts = cuts(body, spec);
        let severed = |point: usize, bond: &Bond| {
            let from = &body.points.position[point];
            // most points are far from all cuts
            cuts.iter().any(|cut| {
                cut.distance(from).abs() <= 2.0 * bond.length
                    && cut.crosses(from, &(from + Vector3::from(bond.xi)))
            })
        };

        let steps: Vec<(isize, Bond)> = stencil
            .iter()
            .map(|(step, bond)| (padded.offset(*step), *bond))
            .collect();
        let slots = padded.len();
        let neighbour = |slot: u32, offset: isize| {
            Some(slot as usize)
                .map(|s| s.wrapping_add_signed(offset))
                .filter(|&s| s < slots && mirror_of[s] != EMPTY)
        };
        let complete: Vec<bool> = slot_of_point
            .iter()
            .map(|&s| steps.iter().all(|(o, _)| neighbour(s, *o).is_some()))
            .collect();

        let calibration = Calibration::new(body, spec);
        let lattice_factor = calibration.factors(horizon, steps.iter().map(|(_, b)| b))[0];

        // per-point factors only where they differ from the lattice factor; a cut does not
        // count as missing material: at a crack nothing is repaired (spec 02, 4.3)
        let truncated = |point: usize| spec.correction.is_by_point() && !complete[point];
        let factor: Vec<[f64; 3]> = if spec.correction.is_by_point() {
            (0..body.points.len())
                .map(|p| {
                    if complete[p] {
                        return [lattice_factor; 3];
                    }
                    let present = steps
                        .iter()
                        .filter(|(o, _)| neighbour(slot_of_point[p], *o).is_some());
                    calibration.factors(horizon, present.map(|(_, b)| b))
                })
                .collect()
        } else {
            Vec::new()
        };

        let mut rows = Rows {
            start: vec![0],
            ..Rows::default()
        };
        let mut layer_rows = Rows {
            start: vec![0],
            ..Rows::default()
        };
        let mut blocks = blocks::Builder::new(steps.len());
        let mut in_runs = vec![false; body.points.len()];
        let mut bonds = 0;
        for (point, &slot) in slot_of_point.iter().enumerate() {
            let members = || {
                let present = (0u16..)
                    .zip(&steps)
                    .filter(|(_, (_, b))| cuts.is_empty() || !severed(point, b));
                present.filter_map(|(step, (o, b))| Some((step, neighbour(slot, *o)?, b)))
            };
            let count = if complete[point] && cuts.is_empty() {
                steps.len()
            } else {
                members().count()
            };
            if count == 0 {
                return Err(FamilyError::NoNeighbours {
                    at: body.points.position[point].into(),
                    horizon,
                });
            }
            bonds += count;
            let corrected = |(step, slot, bond): (u16, usize, &Bond)| {
                let [own, dual] = if spec.correction.is_by_point() {
                    [point, mirror_of[slot] as usize].map(|p| factor_along(bond, &factor[p]))
                } else {
                    [lattice_factor; 2]
                };
                let weights = [bond.weight * own, bond.weight * dual];
                (step, slot as u32, weights)
            };
            let uneven = spec.correction.is_by_point()
                && (truncated(point)
                    || members().any(|(_, s, _)| truncated(mirror_of[s] as usize)));
            if body.store == Store::List {
                rows.push(point, slot, members().map(corrected));
            } else if count < steps.len() || uneven {
                let bonds = members().map(corrected);
                let bonds = bonds.map(|(step, _, weights)| (usize::from(step), weights));
                blocks.push((point as u32, slot), bonds);
            } else {
                in_runs[point] = true;
            }
            if !spec.audited.is_empty() && members().any(|(_, s, _)| audited[s]) {
                let from_layer = members().filter(|(_, s, _)| audited[*s]);
                layer_rows.push(point, slot, from_layer.map(corrected));
            }
        }

        let blocks = blocks.finish();
        let spans = stretches(&slot_of_point, |_| true);
        let runs = stretches(&slot_of_point, |p| in_runs[p]);
        let chunks = chunks(&runs, blocks.head.len(), rows.point.len());
        let stencil = steps
            .iter()
            .map(|(offset, bond)| StencilBond {
                offset: *offset,
                bond: Bond {
                    weight: bond.weight * lattice_factor,
                    dual: bond.weight * lattice_factor,
                    ..*bond
                },
            })
            .collect();
        let swept = runs.iter().map(|r| r.len as usize).sum::<usize>();
        let swept = swept + blocks.points() + rows.point.len();
        assert_eq!(
            swept,
            body.points.len(),
            "runs, blocks and rows partition the points"
        );
        Ok(Family {
            spec: spec.clone(),
            points: body.points.len(),
            bonds,
            // lanes of the last block that are no points reach a little beyond
            slots: slots + BLOCK,
            spans,
            corners: ghosts.iter().copied().filter(Ghost::is_corner).collect(),
            ghosts,
            layers,
            periodic: body.periodic,
            places: Default::default(),
            flat: body.dimension < 3,
            grid: Some(grid),
            stencil,
            runs,
            blocks,
            rows,
            layer_rows,
            chunks,
            order: Order::default(),
            following: None,
            pairs: OnceLock::new(),
        })
    }
}

/// The faces behind which the body goes on, as a mirror image or as a copy.
pub(super) fn continued_faces(body: &Body, spec: &FamilySpec) -> Vec<Face> {
    let goes_on = |f: &Face| spec.layers.contains(f) || body.periodic[f.axis()];
    let faces = Face::ALL.into_iter().filter(|f| f.axis() < body.dimension);
    faces.filter(goes_on).collect()
}

/// The cuts of the body and their images behind the faces where it goes on.
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

/// Members of a complete family as lattice steps, with influence and partial volumes, ordered z, y, x. Lengths are
/// compared in spacings.
fn stencil(body: &Body, spacing: f64, spec: &FamilySpec) -> Vec<([i64; 3], Bond)> {
    let horizon = spec.horizon.of(spacing) / spacing;
    let moment = spec.moment(body, spec.horizon.of(spacing));
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
                let weight = share * body.points.volume[0] / moment;
                let bond = Bond {
                    xi: step.map(|s| s as f64 * spacing),
                    length: length * spacing,
                    inverse_length: 1.0 / (length * spacing),
                    weight,
                    dual: weight,
                };
                members.push((step, bond));
            }
        }
    }
    members
}

/// Layer points behind `faces`, each the image of a point or of an earlier layer point, a copy where
/// the body is periodic; repeated until edges, corners and bodies thinner than the horizon
/// are complete. Returned in the order in which they must be filled.
fn mirror(
    body: &Body,
    lattice: &Lattice,
    (faces, padded): (&[Face], &Padded),
    reach: i64,
    mirror_of: &mut [u32],
) -> (Vec<Ghost>, Vec<(Face, std::ops::Range<usize>)>) {
    let mut ghosts: Vec<Ghost> = Vec::new();
    let mut ghost_in = BTreeMap::new();
    let mut layers = Vec::new();
    loop {
        let before = ghosts.len();
        for &face in faces {
            let first = ghosts.len();
            let axis = face.axis();
            for depth in 0..reach {
                // cells at `depth` behind the face mirror those at the same depth before it, or copy those
                // before the opposite face
                let size = lattice.cells[axis] as i64;
                let periodic = body.periodic[axis];
                let (outer, inner) = match (face.is_upper(), periodic) {
                    (true, false) => (size + depth, size - 1 - depth),
                    (true, true) => (size + depth, depth),
                    (false, false) => (-1 - depth, depth),
                    (false, true) => (-1 - depth, size - 1 - depth),
                };
                for slot in 0..padded.len() / padded.cells[axis] {
                    let mut cell = plane_cell(padded, axis, slot);
                    cell[axis] = outer;
                    let target = padded.slot(cell).expect("the margin holds the layer");
                    cell[axis] = inner;
                    let Some(source) = padded.slot(cell) else {
                        continue;
                    };
                    if mirror_of[target] == EMPTY && mirror_of[source] != EMPTY {
                        mirror_of[target] = mirror_of[source];
                        let parent: Option<u32> = ghost_in.get(&source).copied();
                        let mut passes = parent.map_or([0; 6], |g| ghosts[g as usize].passes);
                        passes[face as usize] += u8::from(!periodic);
                        ghost_in.insert(target, ghosts.len() as u32);
                        ghosts.push(Ghost {
                            slot: target as u32,
                            source: source as u32,
                            parent,
                            point: mirror_of[source],
                            passes,
                        });
                    }
                }
            }
            if ghosts.len() > first {
                layers.push((face, first..ghosts.len()));
            }
        }
        if ghosts.len() == before {
            return (ghosts, layers);
        }
    }
}

/// The `index`-th cell of the padded plane normal to `axis`.
fn plane_cell(padded: &Padded, axis: usize, index: usize) -> [i64; 3] {
    let [u, v] = match axis {
        0 => [1, 2],
        1 => [0, 2],
        _ => [0, 1],
    };
    let mut cell = padded.cell(0);
    cell[u] += (index % padded.cells[u]) as i64;
    cell[v] += (index / padded.cells[u]) as i64;
    cell
}

impl Rows {
    fn push(&mut self, point: usize, slot: u32, bonds: impl Iterator<Item = (u16, u32, [f64; 2])>) {
        self.point.push(point as u32);
        self.slot.push(slot);
        for (step, column, [weight, dual]) in bonds {
            self.step.push(step);
            self.column.push(column);
            self.weight.push(weight);
            self.dual.push(dual);
        }
        self.start.push(self.column.len());
    }
}

/// Maximal stretches of consecutive points in consecutive slots that satisfy `keep`.
fn stretches(slot_of_point: &[u32], keep: impl Fn(usize) -> bool) -> Vec<Span> {
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

pub(super) fn chunks(runs: &[Span], blocks: usize, rows: usize) -> Vec<Chunk> {
    let mut chunks = Vec::new();
    let none = Chunk {
        runs: 0..0,
        blocks: 0..0,
        rows: 0..0,
    };
    let (mut first, mut points) = (0, 0);
    for (index, run) in runs.iter().enumerate() {
        points += run.len;
        if points >= CHUNK_POINTS || index + 1 == runs.len() {
            chunks.push(Chunk {
                runs: first..index + 1,
                ..none.clone()
            });
            (first, points) = (index + 1, 0);
        }
    }
    let step = CHUNK_POINTS as usize / BLOCK / 2;
    chunks.extend((0..blocks).step_by(step).map(|b| Chunk {
        blocks: b..(b + step).min(blocks),
        ..none.clone()
    }));
    // a row costs a few times a lane of a run
    let step = CHUNK_POINTS as usize / 4;
    chunks.extend((0..rows).step_by(step).map(|r| Chunk {
        rows: r..(r + step).min(rows),
        ..none.clone()
    }));
    chunks
}
