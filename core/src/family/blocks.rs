//! Blocks: neighbouring points of a lattice whose bonds have weights of their own.
//!
//! At bare surfaces, beside cuts, and where bonds are corrected for the sake of a neighbour, bonds differ
//! from the stencil in nothing but their weights: a bond that there is not has none. So [`BLOCK`] points
//! advance together through the stencil as complete families do, with weights streamed from memory.

/// Points of a block: one AVX-512 register.
pub(super) const BLOCK: usize = 8;

/// Weights of all blocks, by block, then bond of the stencil, then lane.
#[derive(Debug, Default)]
pub(super) struct Blocks {
    pub(super) head: Vec<Head>,
    pub(super) weight: Vec<[f64; BLOCK]>,
    pub(super) dual: Vec<[f64; BLOCK]>,
}

/// Consecutive points in consecutive slots; lanes from `len` on count nothing.
#[derive(Clone, Copy, Debug)]
pub(super) struct Head {
    pub(super) point: u32,
    pub(super) slot: u32,
    pub(super) len: u32,
}

impl Blocks {
    /// Adds a point with its bonds (number in the stencil, weight, dual), after those before it.
    pub(super) fn push(
        &mut self,
        (point, slot): (u32, u32),
        stencil: usize,
        bonds: impl Iterator<Item = (usize, [f64; 2])>,
    ) {
        let follows =
            |h: &Head| h.len < BLOCK as u32 && [h.point + h.len, h.slot + h.len] == [point, slot];
        if !self.head.last().is_some_and(follows) {
            self.head.push(Head {
                point,
                slot,
                len: 0,
            });
            let weights = self.head.len() * stencil;
            self.weight.resize(weights, [0.0; BLOCK]);
            self.dual.resize(weights, [0.0; BLOCK]);
        }
        let head = self.head.last_mut().expect("pushed above");
        let lane = head.len as usize;
        head.len += 1;
        let first = self.weight.len() - stencil;
        for (number, [weight, dual]) in bonds {
            self.weight[first + number][lane] = weight;
            self.dual[first + number][lane] = dual;
        }
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

    /// Number of points.
    pub(super) fn points(&self) -> usize {
        self.head.iter().map(|h| h.len as usize).sum()
    }

    pub(super) fn memory(&self) -> usize {
        size_of_val(&*self.head) + size_of_val(&*self.weight) + size_of_val(&*self.dual)
    }
}
