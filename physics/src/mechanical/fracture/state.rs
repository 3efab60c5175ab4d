//! Broken bonds of a body, and how they are saved.

use perimelt_core::PointRows;
use perimelt_core::family::BrokenBonds;
use serde::{Deserialize, Serialize};

/// Broken bonds of a body, and the stress that they carried.
#[derive(Clone, Debug)]
pub struct FractureState {
    /// Bonds that broke, of each set of bonds that has its own: one, or the sets of a laminate.
    pub broken: Vec<BrokenBonds>,
    /// The stress conjugate to the eigenstrain that bonds of each point carried when they broke, Pa: xx, yy, zz, xy, yz, zx. It remains
    /// part of the `conjugate_stress`: a change of that field heats the body, and a break is not an unloading.
    pub frozen: Vec<[f64; 6]>,
    /// Energy that pairs of crossing bonds took when they broke, half of it from either end, J/m²: by interface of a laminate and point of its plane, where modes
    /// are mixed; else empty.
    pub sliding_energy: Vec<f64>,
}

/// A [`FractureState`] as it is saved: what differs from that of an intact body.
#[derive(Debug, Serialize, Deserialize)]
pub struct SavedFracture {
    broken: Vec<PointRows>,
    frozen: PointRows,
    sliding_energy: Vec<f64>,
}

impl FractureState {
    /// No broken bonds, of a body with this number of points.
    pub fn intact(unbroken: BrokenBonds, points: usize) -> Self {
        FractureState {
            broken: vec![unbroken],
            frozen: vec![[0.0; 6]; points],
            sliding_energy: Vec::new(),
        }
    }

    /// Trace of the stress that broken bonds of a point carried, Pa.
    pub fn trace(&self, point: usize) -> f64 {
        let [xx, yy, zz, ..] = self.frozen[point];
        xx + yy + zz
    }

    /// The state before any bond broke.
    #[must_use]
    pub fn before_breaks(&self) -> Self {
        FractureState {
            broken: self.broken.iter().map(BrokenBonds::unbroken).collect(),
            frozen: vec![[0.0; 6]; self.frozen.len()],
            sliding_energy: vec![0.0; self.sliding_energy.len()],
        }
    }

    /// Number of broken bonds.
    pub fn count(&self) -> f64 {
        0.5 * self.broken.iter().map(BrokenBonds::total).sum::<usize>() as f64
    }

    /// What is saved of the points that are owned, with the rows of the `whole` body in place of theirs.
    #[must_use]
    pub fn saved(&self, owned: usize, whole: impl Fn(PointRows) -> PointRows) -> SavedFracture {
        let mut frozen = PointRows::default();
        for (point, stress) in self.frozen[..owned].iter().enumerate() {
            if *stress != [0.0; 6] {
                frozen.push(point, &stress.map(f64::to_bits));
            }
        }
        SavedFracture {
            broken: self.broken.iter().map(|set| whole(set.rows())).collect(),
            frozen: whole(frozen),
            sliding_energy: self.sliding_energy.clone(),
        }
    }

    /// The state that was saved, of a body with the same bonds, where `part` are the rows of points that are here; `None` where it is
    /// that of another body.
    #[must_use]
    pub fn restored(
        &self,
        saved: SavedFracture,
        part: impl Fn(PointRows) -> PointRows,
    ) -> Option<Self> {
        let mut state = self.before_breaks();
        let is_own = saved.broken.len() == state.broken.len()
            && saved.sliding_energy.len() == state.sliding_energy.len();
        if !is_own {
            return None;
        }
        for (own, rows) in state.broken.iter_mut().zip(saved.broken) {
            if !own.break_rows(&part(rows)) {
                return None;
            }
        }
        let frozen = part(saved.frozen);
        if !frozen.is_valid(state.frozen.len(), 6) {
            return None;
        }
        for (point, stress) in frozen.iter(6) {
            state.frozen[point] = std::array::from_fn(|c| f64::from_bits(stress[c]));
        }
        state.sliding_energy = saved.sliding_energy;
        Some(state)
    }
}
