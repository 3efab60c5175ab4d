//! Families of bodies that grow: points without material have no bonds, and when points become active or inactive,
//! only the weights around them are computed again.
//!
//! The weights of a point follow from the points that are present around it, so that a family depends on the present
//! points only, not on the order in which they became active: a body that is complete has the same bonds as one that never
//! grew, and a resumed run is bit-identical.
//!
//! Points are divided into blocks of consecutive slots once and for all, the same in all processes that share a body. A block is empty, shares
//! the stencil, or has weights of its own, which equal blocks share ([`Patterns`]).

#[cfg(test)]
mod tests;

use std::collections::HashMap;
use std::collections::hash_map::DefaultHasher;
use std::hash::{Hash, Hasher};

use rayon::prelude::*;

use crate::body::{self, Discretisation};

use super::blocks::{BLOCK, BlockHead, Blocks, Weights};
use super::build::{Share, chunks, stretches};
use super::lattice::{EMPTY, LatticeBonds, Member};
use super::{Family, FamilyError, FamilySpec, Rows, Span, StencilBonds, Store};

/// Which points are present, and what the bonds follow from.
#[derive(Debug)]
pub(super) struct GrowingBonds {
    bonds: LatticeBonds,
    active: Vec<bool>,
    /// Points and the layer slots that mirror them, ordered by point.
    images: Vec<(u32, u32)>,
    /// The points that the family owns, in blocks that do not change.
    parts: Vec<Span>,
    part_of_point: Vec<u32>,
    state: Vec<BlockBonds>,
    unborn: Vec<Span>,
    patterns: Patterns,
    /// Owned points with bonds to audited layers.
    beside_layers: Vec<u32>,
    /// Owned points whose bonds the last change concerned.
    recalibrated: Vec<u32>,
    version: u64,
}

/// The bonds of a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum BlockBonds {
    /// No point is active.
    Empty,
    /// All bonds equal those of the stencil.
    Stencil,
    /// The weights are those of this pattern.
    Own(u32),
}

/// The new bonds of a block.
enum NewBonds {
    Empty,
    Stencil,
    Own(Vec<Weights>),
}

/// Weights that blocks share, with the number of blocks that use them.
#[derive(Debug, Default)]
struct Patterns {
    /// Patterns by a hash of the weights.
    known: HashMap<u64, Vec<u32>>,
    /// Number of blocks by pattern.
    uses: Vec<u32>,
    free: Vec<u32>,
}

impl Patterns {
    fn hash(weights: &[Weights]) -> u64 {
        let mut hasher = DefaultHasher::new();
        let lanes = weights.as_flattened().as_flattened();
        lanes.iter().for_each(|w| w.to_bits().hash(&mut hasher));
        hasher.finish()
    }

    /// The pattern of these weights, which are added to `blocks` if they are new.
    fn take(&mut self, blocks: &mut Blocks, weights: &[Weights]) -> u32 {
        let alike = self.known.entry(Patterns::hash(weights)).or_default();
        let same = alike.iter().find(|&&n| blocks.pattern(n) == weights);
        if let Some(&number) = same {
            self.uses[number as usize] += 1;
            return number;
        }
        let number = self.free.pop().unwrap_or(self.uses.len() as u32);
        if number as usize == self.uses.len() {
            self.uses.push(0);
        }
        blocks.set_pattern(number, weights);
        alike.push(number);
        self.uses[number as usize] = 1;
        number
    }

    /// Counts one block less for a pattern.
    fn give_back(&mut self, blocks: &Blocks, number: u32) {
        self.uses[number as usize] -= 1;
        if self.uses[number as usize] == 0 {
            if let Some(alike) = self.known.get_mut(&Patterns::hash(blocks.pattern(number))) {
                alike.retain(|n| *n != number);
            }
            self.free.push(number);
        }
    }
}

impl Family {
    /// A family whose points become active and inactive ([`Family::set_active`]), with the bonds of those that are active
    /// now; `active` has remote points, too.
    ///
    /// # Errors
    /// See [`Family::build`]; also for a body whose families have no stencil or have cuts.
    pub(crate) fn growing(
        share: Share<'_>,
        spec: &FamilySpec,
        active: &[bool],
        version: u64,
    ) -> Result<Family, FamilyError> {
        let body = share.body;
        let lattice = match &body.discretisation {
            Discretisation::Lattice(lattice) if body.store == body::Store::Lattice => lattice,
            _ => return Err(FamilyError::Growing("points without a lattice as store")),
        };
        if body.tank.is_some() {
            return Err(FamilyError::Tank);
        }
        if !body.cuts.is_empty() {
            return Err(FamilyError::Growing("cuts"));
        }
        let (bonds, grid) = LatticeBonds::new(share, lattice, spec)?;
        let (points, owned) = (bonds.slot_of_point.len(), share.owned);
        let audited = |p: &u32| bonds.members(*p as usize).any(|m| bonds.audited[m.slot]);
        let beside_layers = match spec.audited.is_empty() {
            true => Vec::new(),
            false => (0..owned as u32).filter(audited).collect(),
        };
        let mut images: Vec<(u32, u32)> = bonds
            .layers
            .ghosts
            .iter()
            .map(|g| (g.point, g.slot))
            .collect();
        images.sort_unstable();
        let parts = parts(share, &stretches(&bonds.slot_of_point[..owned], |_| true));
        let mut part_of_point = vec![0; owned];
        for (number, part) in (0..).zip(&parts) {
            part_of_point[part.points()].fill(number);
        }
        let number = (0..owned).map(|p| bonds.members(p).count()).sum();
        let growth = GrowingBonds {
            state: vec![BlockBonds::Empty; parts.len()],
            unborn: Vec::new(),
            active: vec![true; points],
            parts,
            part_of_point,
            images,
            patterns: Patterns::default(),
            beside_layers,
            recalibrated: Vec::new(),
            version,
            bonds,
        };
        let swept = StencilBonds {
            stencil: growth.bonds.stencil(grid),
            runs: Vec::new(),
            blocks: Blocks::of_stencil(growth.bonds.steps.len()),
            remote: Blocks::default(),
        };
        let mut family = Family {
            spec: spec.clone(),
            points: owned,
            of_body: points,
            bonds: number,
            slots: growth.bonds.slots(share),
            layer_rows: Rows::default(),
            chunks: Vec::new(),
            store: Store::Growing(swept, Box::new(growth)),
        };
        if !share.is_whole() {
            // bonds of all points tell which remote ones they reach
            family.change(&[], true);
            family.forget_unreached();
        }
        let inactive: Vec<u32> = (0..points as u32)
            .filter(|&p| !active[p as usize])
            .collect();
        family.change(&inactive, true);
        Ok(family)
    }

    /// Sets which points are present, remote ones included; only bonds around those that change are computed again. A new
    /// [`version`](Family::version) also where none changes, as changes may be those of other processes.
    ///
    /// # Panics
    /// When there is not one value for each point.
    pub fn set_active(&mut self, active: &[bool]) {
        assert_eq!(active.len(), self.of_body, "one value for each point");
        let Some(growth) = self.store.growth() else {
            return;
        };
        let differ = growth.active.iter().zip(active).zip(0..);
        let differ = differ.filter(|((before, now), _)| before != now);
        let changed: Vec<u32> = differ.map(|(_, point)| point).collect();
        self.change(&changed, false);
    }

    /// Changes whether `points` are present; `all`: the bonds of all points are computed.
    fn change(&mut self, points: &[u32], all: bool) {
        let Store::Growing(swept, growth) = &mut self.store else {
            return;
        };
        growth.toggle(points);
        let parts = growth.recalibrate(points, all);
        growth.fill(&parts, &mut swept.blocks);
        let changed = |point: &u32| growth.recalibrated.binary_search(point).is_ok();
        if growth.beside_layers.iter().any(changed) {
            self.layer_rows = growth.layer_rows();
        }
        growth.version += 1;
        growth.collect_parts(swept);
        self.chunks = chunks(&self.store);
    }

    /// Whether points become present and absent.
    pub fn grows(&self) -> bool {
        self.store.growth().is_some()
    }

    /// Counts the changes of a family that grows.
    pub fn version(&self) -> u64 {
        self.store.growth().map_or(0, |g| g.version)
    }

    /// Points whose bonds differ from the version before, ascending.
    pub fn recalibrated(&self) -> &[u32] {
        self.store.growth().map_or(&[], |g| &g.recalibrated)
    }

    /// The point that a slot carries or mirrors, in a family that grows.
    pub fn mirrored_point(&self, slot: usize) -> Option<usize> {
        let point = self.store.growth()?.bonds.mirror_of.get(slot)?;
        (*point != EMPTY).then_some(*point as usize)
    }
}

/// Stretches of points in blocks, which end at multiples of [`BLOCK`] in the numbers of the whole body: whether a point shares
/// the stencil depends on the other points of its block.
fn parts(share: Share<'_>, stretches: &[Span]) -> Vec<Span> {
    let step = BLOCK as u32;
    let mut parts = Vec::new();
    for span in stretches {
        let mut rest = *span;
        while rest.len > 0 {
            let number = share.number(rest.point as usize);
            let len = (step - number % step).min(rest.len);
            parts.push(Span { len, ..rest });
            rest.slot += len;
            rest.point += len;
            rest.len -= len;
        }
    }
    parts
}

impl GrowingBonds {
    pub(super) fn is_unborn(&self, point: usize) -> bool {
        !self.active[point]
    }

    /// Points without material.
    pub(super) fn unborn(&self) -> &[Span] {
        &self.unborn
    }

    /// Updates the runs and blocks that a sweep visits.
    fn collect_parts(&mut self, swept: &mut StencilBonds) {
        let heads = &mut swept.blocks.head;
        swept.runs.clear();
        self.unborn.clear();
        heads.clear();
        for (part, state) in self.parts.iter().zip(&self.state) {
            let list = match state {
                BlockBonds::Empty => &mut self.unborn,
                BlockBonds::Stencil => &mut swept.runs,
                BlockBonds::Own(pattern) => {
                    heads.push(BlockHead {
                        point: part.point,
                        slot: part.slot,
                        len: part.len,
                        pattern: *pattern,
                    });
                    continue;
                }
            };
            match list.last_mut() {
                Some(s) if [s.point + s.len, s.slot + s.len] == [part.point, part.slot] => {
                    s.len += part.len;
                }
                _ => list.push(*part),
            }
        }
    }

    /// Slots that carry or mirror a point.
    fn slots_of(&self, point: u32) -> impl Iterator<Item = usize> {
        let first = self.images.partition_point(|(p, _)| *p < point);
        let images = self.images[first..].iter();
        let images = images.take_while(move |(p, _)| *p == point);
        let own = self.bonds.slot_of_point[point as usize];
        std::iter::once(own)
            .chain(images.map(|(_, slot)| *slot))
            .map(|slot| slot as usize)
    }

    fn toggle(&mut self, points: &[u32]) {
        for &point in points {
            let now = !self.active[point as usize];
            self.active[point as usize] = now;
            let slots: Vec<usize> = self.slots_of(point).collect();
            slots.into_iter().for_each(|s| self.bonds.present[s] = now);
        }
    }

    /// Marks `points` and all points whose stencil reaches one of them.
    fn mark_around(&self, points: impl Iterator<Item = u32>, marks: &mut [bool]) {
        let LatticeBonds {
            mirror_of,
            slot_of_point,
            ..
        } = &self.bonds;
        for point in points {
            marks[point as usize] = true;
            for slot in self.slots_of(point) {
                for (offset, _) in &self.bonds.steps {
                    // the stencil is symmetric
                    let other = slot.wrapping_add_signed(*offset);
                    let Some(&near) = mirror_of.get(other).filter(|p| **p != EMPTY) else {
                        continue;
                    };
                    if slot_of_point[near as usize] as usize == other {
                        marks[near as usize] = true;
                    }
                }
            }
        }
    }

    /// Computes completeness and corrections again around `changed` points; returns the blocks whose weights may differ.
    fn recalibrate(&mut self, changed: &[u32], all: bool) -> Vec<u32> {
        let mut marks = vec![all; self.active.len()];
        if !all {
            self.mark_around(changed.iter().copied(), &mut marks);
        }
        let marked = |marks: &[bool]| -> Vec<u32> {
            let points = (0..).zip(marks);
            points.filter(|(_, m)| **m).map(|(p, _)| p).collect()
        };
        let near = marked(&marks);
        let corrected = self.bonds.recalibrate(&near);
        if !all {
            self.mark_around(corrected.into_iter(), &mut marks);
        }
        // weights of remote points follow from factors
        marks.truncate(self.part_of_point.len());
        self.recalibrated = marked(&marks);
        let parts = self.recalibrated.iter();
        let mut parts: Vec<u32> = parts.map(|&p| self.part_of_point[p as usize]).collect();
        parts.dedup();
        parts
    }

    /// The bonds of a block.
    fn new_bonds(&self, part: u32) -> NewBonds {
        let points = self.parts[part as usize].points();
        if points.clone().all(|p| !self.active[p]) {
            return NewBonds::Empty;
        }
        let bonds = &self.bonds;
        let shares = |p: usize| self.active[p] && bonds.is_complete(p) && !bonds.is_uneven(p);
        if points.clone().all(shares) {
            return NewBonds::Stencil;
        }
        let mut weights = vec![[[0.0; BLOCK]; 2]; bonds.steps.len()];
        for (lane, point) in points.enumerate().filter(|(_, p)| self.active[*p]) {
            for member in bonds.members(point) {
                let [weight, dual] = bonds.weights(point, &member);
                let own = &mut weights[usize::from(member.step)];
                (own[0][lane], own[1][lane]) = (weight, dual);
            }
        }
        NewBonds::Own(weights)
    }

    /// Computes the bonds of blocks.
    fn fill(&mut self, parts: &[u32], blocks: &mut Blocks) {
        /// Blocks whose weights are held at a time.
        const AT_ONCE: usize = 4096;
        for some in parts.chunks(AT_ONCE) {
            let states: Vec<NewBonds> = some.par_iter().map(|&p| self.new_bonds(p)).collect();
            for (&part, new) in some.iter().zip(states) {
                let new = match new {
                    NewBonds::Empty => BlockBonds::Empty,
                    NewBonds::Stencil => BlockBonds::Stencil,
                    NewBonds::Own(weights) => BlockBonds::Own(self.patterns.take(blocks, &weights)),
                };
                let old = std::mem::replace(&mut self.state[part as usize], new);
                if let BlockBonds::Own(pattern) = old {
                    self.patterns.give_back(blocks, pattern);
                }
            }
        }
    }

    /// Rows of the bonds with audited layers.
    fn layer_rows(&self) -> Rows {
        let bonds = &self.bonds;
        let mut rows = Rows::new();
        for &point in &self.beside_layers {
            let point = point as usize;
            let from_layer = bonds.members(point).filter(|m| bonds.audited[m.slot]);
            let weighted = |m: Member<'_>| bonds.row_bond(point, &m);
            if self.active[point] && from_layer.clone().next().is_some() {
                let slot = bonds.slot_of_point[point];
                rows.push(point, slot, from_layer.map(weighted));
            }
        }
        rows
    }

    pub(super) fn memory(&self) -> usize {
        self.bonds.memory()
            + size_of_val(&*self.parts)
            + self.active.len() * (1 + size_of::<u32>())
            + size_of_val(&*self.state)
    }
}
