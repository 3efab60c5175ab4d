//! What the fluxes depend on, by slot.

use perimelt_core::family::Mirrored;
use perimelt_core::{Family, SlotField};

/// Fields by slot, in the order of [`Inputs`](super::kernels::Inputs). Without a second fluid the last three and what surface tension
/// needs are zero, and all points are open.
#[derive(Debug)]
pub(super) struct FlowSlots {
    /// Pa.
    pub(super) pressure: SlotField,
    /// kg/m³.
    pub(super) density: SlotField,
    /// Coordinates of mirror points, m.
    place: Vec<SlotField>,
    /// By forces, m/s².
    pub(super) acceleration: Vec<SlotField>,
    /// `-gamma kappa`, Pa.
    pub(super) tension: SlotField,
    /// H.
    pub(super) step: SlotField,
    /// 1 where something flows, 0 where the first of two fluids has frozen.
    pub(super) open: SlotField,
    /// Velocity before the pressure acts, and velocity that is carried, m/s.
    pub(super) predicted: Vec<SlotField>,
    pub(super) carried: Vec<SlotField>,
    /// c.
    pub(super) fraction: SlotField,
    /// q.
    pub(super) compression: Vec<SlotField>,
}

impl FlowSlots {
    pub(super) fn new(family: &Family, dimension: usize) -> Self {
        let zero = || SlotField::zeros(family);
        let vector = || vec![zero(); dimension];
        let mut place = vector();
        for (axis, slots) in place.iter_mut().enumerate() {
            slots.load_coordinate(family, axis);
        }
        let mut open = zero();
        open.load(family, |_| 1.0, Mirrored::Scalar);
        FlowSlots {
            pressure: zero(),
            density: zero(),
            place,
            acceleration: vector(),
            tension: zero(),
            step: zero(),
            open,
            predicted: vector(),
            carried: vector(),
            fraction: zero(),
            compression: vector(),
        }
    }

    /// All of them, in order.
    pub(super) fn all(&self) -> impl Iterator<Item = &SlotField> {
        let first = [&self.pressure, &self.density].into_iter();
        let forces = self.place.iter().chain(&self.acceleration);
        let capillary = [&self.tension, &self.step, &self.open].into_iter();
        let flow = self.predicted.iter().chain(&self.carried);
        let phase = std::iter::once(&self.fraction).chain(&self.compression);
        first
            .chain(forces)
            .chain(capillary)
            .chain(flow)
            .chain(phase)
    }
}
