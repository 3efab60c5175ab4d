//! Blocks: neighbouring points of a lattice whose bonds have weights of their own.
//!
//! At bare surfaces, beside cuts, and where bonds are corrected because a neighbour is near a surface, bonds differ
//! from the stencil in their weights only: a missing bond has weight zero. So [`BLOCK`] points
//! advance together through the stencil as complete families do, with weights from memory. Equal blocks,
//! such as those along an edge, share their weights, most of which stay in the cache.

use std::ops::Range;

use rustc_hash::FxHashMap;

/// Points of a block: one AVX-512 register.
pub(super) const BLOCK: usize = 8;

/// Weights and duals of a bond in a block, by lane.
pub(super) type Weights<const LANES: usize = BLOCK> = [[f64; LANES]; 2];

/// The blocks of a family.
#[derive(Debug, Default)]
pub(super) struct Blocks {
    pub(super) head: Vec<BlockHead>,
    /// By pattern, then bond of the stencil.
    weights: Vec<Weights>,
    stencil: usize,
}

/// Numbers of the points of a block that do not follow each other.
pub(super) const MIXED: u32 = u32::MAX;

/// Consecutive points in consecutive slots; lanes from `len` on have no point.
#[derive(Clone, Copy, Debug)]
pub(super) struct BlockHead {
    /// The first point; [`MIXED`] where owned and remote points of a part are side by side.
    pub(super) point: u32,
    pub(super) slot: u32,
    pub(super) len: u32,
    pub(super) pattern: u32,
}

impl BlockHead {
    #[inline(always)]
    pub(super) fn points(&self) -> Range<usize> {
        self.point as usize..self.point as usize + self.len as usize
    }

    /// The slots of its points.
    pub(super) fn slots(&self) -> Range<usize> {
        self.slot as usize..self.slot as usize + self.len as usize
    }
}

impl Blocks {
    /// No blocks; `stencil` is the number of its bonds.
    pub(super) fn of_stencil(stencil: usize) -> Self {
        Blocks {
            stencil,
            ..Blocks::default()
        }
    }

    /// The weights of a pattern, by bond of the stencil.
    pub(super) fn pattern(&self, number: u32) -> &[Weights] {
        &self.weights[number as usize * self.stencil..][..self.stencil]
    }

    /// The weights of all patterns, one after the other: by bond, weights by lane, then duals.
    pub(super) fn all_weights(&self) -> &[f64] {
        self.weights.as_flattened().as_flattened()
    }

    /// Replaces the weights of a pattern, or adds the next one.
    pub(super) fn set_pattern(&mut self, number: u32, weights: &[Weights]) {
        let first = number as usize * self.stencil;
        let end = first + self.stencil;
        self.weights
            .resize(end.max(self.weights.len()), [[0.0; BLOCK]; 2]);
        self.weights[first..end].copy_from_slice(weights);
    }

    /// The weights of a block, by bond of the stencil.
    #[inline(always)]
    pub(super) fn weights(&self, block: usize) -> &[Weights] {
        &self.weights[self.head[block].pattern as usize * self.stencil..][..self.stencil]
    }

    /// The pattern of these weights and duals in all lanes, if any block has it.
    pub(super) fn pattern_of(&self, bonds: impl Iterator<Item = [f64; 2]>) -> Option<u32> {
        let wanted: Vec<Weights> = bonds.map(|bond| bond.map(|w| [w; BLOCK])).collect();
        let mut patterns = self.weights.chunks_exact(self.stencil);
        patterns.position(|p| p == wanted).map(|p| p as u32)
    }

    /// Block and lane of a point.
    pub(super) fn find(&self, point: u32) -> Option<(usize, usize)> {
        let block = self
            .head
            .partition_point(|h| h.point <= point)
            .checked_sub(1)?;
        let lane = point - self.head[block].point;
        (lane < self.head[block].len).then_some((block, lane as usize))
    }

    pub(super) fn memory(&self) -> usize {
        size_of_val(&*self.head) + size_of_val(&*self.weights)
    }
}

/// Gathers points in blocks and finds blocks of equal weights.
pub(super) struct BlockBuilder {
    blocks: Blocks,
    /// Whether points of a block may have any numbers.
    may_mix: bool,
    /// Weights of the last block while it may grow; else zero.
    open: Vec<Weights>,
    /// Whether the last block may grow and has no pattern yet.
    is_open: bool,
    /// Pattern of [`BlockBuilder::push_whole`].
    whole: Option<u32>,
    known: FxHashMap<Vec<[[u64; BLOCK]; 2]>, u32>,
}

impl BlockBuilder {
    /// No blocks; `stencil` is the number of its bonds.
    pub(super) fn new(stencil: usize) -> Self {
        BlockBuilder {
            blocks: Blocks::of_stencil(stencil),
            may_mix: false,
            open: vec![[[0.0; BLOCK]; 2]; stencil],
            is_open: false,
            whole: None,
            known: FxHashMap::default(),
        }
    }

    /// As [`BlockBuilder::new`], with blocks of points in consecutive slots, whatever their numbers.
    pub(super) fn of_slots(stencil: usize) -> Self {
        BlockBuilder {
            may_mix: true,
            ..BlockBuilder::new(stencil)
        }
    }

    /// Number of blocks.
    pub(super) fn len(&self) -> usize {
        self.blocks.head.len()
    }

    /// Adds a point with its bonds (number in the stencil, weight, dual), after those before it.
    pub(super) fn push(
        &mut self,
        point: u32,
        slot: u32,
        bonds: impl Iterator<Item = (usize, [f64; 2])>,
    ) {
        let continues = |h: &BlockHead| h.point != MIXED && h.point + h.len == point;
        let follows = |h: &BlockHead| {
            h.len < BLOCK as u32 && h.slot + h.len == slot && (self.may_mix || continues(h))
        };
        if !(self.is_open && self.blocks.head.last().is_some_and(follows)) {
            self.end_block();
            self.blocks.head.push(BlockHead {
                point,
                slot,
                len: 0,
                pattern: 0,
            });
            self.is_open = true;
        }
        let head = self.blocks.head.last_mut().expect("pushed above");
        let lane = head.len as usize;
        if lane > 0 && !continues(head) {
            head.point = MIXED;
        }
        head.len += 1;
        for (number, [weight, dual]) in bonds {
            self.open[number][0][lane] = weight;
            self.open[number][1][lane] = dual;
        }
    }

    /// Adds a block of [`BLOCK`] points, after those before it. The weights are the same for every block that is added so.
    pub(super) fn push_whole(&mut self, point: u32, slot: u32, weights: &[Weights]) {
        self.end_block();
        let pattern = self.whole.unwrap_or_else(|| self.find_pattern(weights));
        self.whole = Some(pattern);
        self.blocks.head.push(BlockHead {
            point,
            slot,
            len: BLOCK as u32,
            pattern,
        });
    }

    /// Adds all blocks of another builder, behind its own.
    pub(super) fn append(&mut self, mut other: BlockBuilder) {
        self.end_block();
        other.end_block();
        let patterns = other.blocks.weights.chunks_exact(self.open.len());
        let numbers: Vec<u32> = patterns.map(|weights| self.find_pattern(weights)).collect();
        let renumbered = |head: &BlockHead| BlockHead {
            pattern: numbers[head.pattern as usize],
            ..*head
        };
        let heads = other.blocks.head.iter().map(renumbered);
        self.blocks.head.extend(heads);
    }

    /// Lets the next point begin a block.
    pub(super) fn end_block(&mut self) {
        if !std::mem::take(&mut self.is_open) {
            return;
        }
        let [before @ .., _] = &self.blocks.head[..] else {
            return;
        };
        // most blocks are like the one before
        let before = before.last().map(|head| head.pattern);
        let pattern = match before.filter(|p| self.blocks.pattern(*p) == self.open) {
            Some(pattern) => pattern,
            None => {
                let open = std::mem::take(&mut self.open);
                let pattern = self.find_pattern(&open);
                self.open = open;
                pattern
            }
        };
        let head = self.blocks.head.last_mut().expect("there is one");
        head.pattern = pattern;
        self.open.fill([[0.0; BLOCK]; 2]);
    }

    /// The pattern of these weights.
    fn find_pattern(&mut self, weights: &[Weights]) -> u32 {
        let bits = weights.iter().map(|w| w.map(|w| w.map(f64::to_bits)));
        let new = self.known.len() as u32;
        let pattern = *self.known.entry(bits.collect()).or_insert(new);
        if pattern == new {
            self.blocks.weights.extend(weights);
        }
        pattern
    }

    /// All blocks.
    pub(super) fn finish(mut self) -> Blocks {
        self.end_block();
        self.blocks
    }
}
