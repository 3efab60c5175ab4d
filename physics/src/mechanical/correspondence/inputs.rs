//! Inputs of the bond kernels by slot.

use perimelt_core::{Family, SlotField};

use super::kernels::{DISPLACEMENT, INPUTS, STABILISATION};
use crate::mechanical::stretch::EXCESS_INPUTS;

/// Inputs of the bond kernels of a body.
#[derive(Debug)]
pub(super) struct Inputs {
    dimension: usize,
    /// Components of `P K^-1 - g H` in the dimensions of the body, by rows.
    pub(super) force_state: Vec<SlotField>,
    /// One field for each dimension, m.
    pub(super) displacement: Vec<SlotField>,
    /// g.
    pub(super) stabilisation: SlotField,
    /// Eigenstrain and critical stretch; empty if bonds do not break.
    pub(super) strength: [SlotField; 2],
    /// Takes the place of inputs that the dimension leaves out.
    zeros: SlotField,
}

impl Inputs {
    /// Zero everywhere.
    pub(super) fn new(family: &Family, dimension: usize, breaks: bool) -> Self {
        let zeros = SlotField::zeros(family);
        let strength = match breaks {
            true => zeros.clone(),
            false => SlotField::default(),
        };
        Inputs {
            dimension,
            force_state: vec![zeros.clone(); dimension * dimension],
            displacement: vec![zeros.clone(); dimension],
            stabilisation: zeros.clone(),
            strength: [strength.clone(), strength],
            zeros,
        }
    }

    /// The displacement along an axis.
    pub(super) fn along(&self, axis: usize) -> &[f64] {
        self.displacement.get(axis).unwrap_or(&self.zeros)
    }

    /// Inputs of the kernels of forces.
    pub(super) fn of_forces(&self) -> [&[f64]; INPUTS] {
        std::array::from_fn(|i| match i {
            STABILISATION => &self.stabilisation[..],
            i if i >= DISPLACEMENT => self.along(i - DISPLACEMENT),
            i => match [i / 3, i % 3] {
                [row, column] if row.max(column) < self.dimension => {
                    &self.force_state[row * self.dimension + column]
                }
                _ => &self.zeros,
            },
        })
    }

    /// Inputs of [`Excess`](crate::mechanical::stretch::Excess).
    pub(super) fn of_excess(&self) -> [&[f64]; EXCESS_INPUTS] {
        std::array::from_fn(|i| match i.checked_sub(3) {
            Some(strength) => &self.strength[strength][..],
            None => self.along(i),
        })
    }
}
