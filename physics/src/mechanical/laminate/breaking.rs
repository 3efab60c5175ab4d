//! Bonds of a laminate beyond their limits, which break.

use perimelt_core::Bond;
use perimelt_core::family::Mirrored;

use super::Laminate;
use super::failure::{BondSet, Failure};
use super::interface::Interface;
use super::kernels::InterfaceEnergy;
use super::loads::{
    BondLoad, Excess, InterfaceLoad, LIMITS, LOAD_INPUTS, Load, MixedLoad, SHEAR_LOAD_INPUTS,
    UNBREAKABLE,
};
use crate::mechanical::exceeding::{Breakable, Exceeding};
use crate::mechanical::fracture::NewBreaks;
use crate::mechanical::specialise::specialise;

impl Laminate {
    /// Breaks the bonds beyond their limits whose load is at least `fraction` of the largest, in the displacement that was set.
    pub(super) fn break_exceeding(&mut self, fraction: f64, damage: &mut [f64]) -> NewBreaks {
        let Some(failure) = self.failure.take() else {
            return NewBreaks::default();
        };
        let mut found = Vec::new();
        for layer in 0..self.layers.len() {
            self.find_in_layer(&failure, BondSet::Matrix(layer), &mut found);
            if failure.limits.can_break_fibres && failure.fibres[layer].is_some() {
                self.find_in_layer(&failure, BondSet::Fibres(layer), &mut found);
            }
        }
        for interface in 0..self.interfaces.len() {
            match failure.limits.mixed_mode_exponent() {
                Some(exponent) => self.find_mixed(&failure, interface, exponent, &mut found),
                None => {
                    self.find_open(&failure, interface, &mut found);
                    self.find_sliding(&failure, interface, &mut found);
                }
            }
        }
        Exceeding::keep_largest(&mut found, fraction, &self.base.points);
        self.failure = Some(failure);
        if found.is_empty() {
            return NewBreaks::default();
        }
        self.blocks.clear();
        self.add_frozen(1.0);
        self.add_sliding_energy(1.0);
        let failure = self.failure.as_mut();
        let pairs = failure.map(|failure| failure.break_all(&self.plane, &found, damage));
        self.add_frozen(-1.0);
        self.add_sliding_energy(-1.0);
        NewBreaks {
            pairs: pairs.unwrap_or_default(),
            any: true,
        }
    }

    /// Adds the conjugate stress of unbroken bonds times a factor to what broken bonds carried, if its changes heat the body.
    fn add_frozen(&mut self, factor: f64) {
        if !self.failure.as_ref().is_some_and(|failure| failure.heats) {
            return;
        }
        self.sum_conjugate_of_bonds(self.base.is_finite());
        if let Some(failure) = &mut self.failure {
            let points = failure.state.frozen.iter_mut().zip(&self.base.tensors);
            for (frozen, stress) in points {
                (0..6).for_each(|c| frozen[c] += factor * stress[c]);
            }
        }
    }

    /// Adds the energy of the unbroken pairs of crossing bonds times a factor to that which broken ones took, where modes are mixed.
    fn add_sliding_energy(&mut self, factor: f64) {
        let Some(mut failure) = self.failure.take() else {
            return;
        };
        let mut taken = std::mem::take(&mut failure.state.sliding_energy);
        let points = self.points_of_layer();
        for (interface, taken) in taken.chunks_mut(points).enumerate() {
            self.sum_sliding_energy(&failure, interface);
            let both = taken.iter_mut().zip(&self.work.scalars);
            both.for_each(|(taken, [energy])| *taken += factor * energy);
        }
        failure.state.sliding_energy = taken;
        self.failure = Some(failure);
    }

    /// Sums the energy of the unbroken pairs of crossing bonds of an interface, J/m².
    fn sum_sliding_energy(&mut self, failure: &Failure, interface: usize) {
        let [lower, upper] = [interface, interface + 1].map(|layer| &self.layers[layer]);
        let inputs = self.interfaces[interface].inputs(lower, upper);
        let (crossing, sums) = (self.interfaces[interface].crossing, &mut self.work.scalars);
        let broken = Some(failure.of_interface(interface));
        specialise!(FINITE = self.base.is_finite() =>
            self.plane.sum_unbroken(&InterfaceEnergy::<FINITE>(crossing), inputs, broken, sums));
    }

    /// All bonds across an interface of the points whose energies of opening and sliding reach the limit of both.
    fn find_mixed(
        &mut self,
        failure: &Failure,
        interface: usize,
        exponent: f64,
        found: &mut Vec<Exceeding>,
    ) {
        self.sum_sliding_energy(failure, interface);
        let before = found.len();
        let points = self.points_of_layer();
        let [opening, sliding] = [BondSet::Opening(interface), BondSet::Sliding(interface)];
        let [opening, sliding] = [opening, sliding].map(|set| failure.number(set));
        let limits = &failure.limits.energies[interface];
        let taken = &failure.state.sliding_energy[interface * points..][..points];
        for point in (0..points).filter(|point| !failure.is_open(interface, *point)) {
            let stretch = self
                .stretch_across(interface, point, self.strained())
                .max(0.0);
            let Interface {
                modulus, crossing, ..
            } = &self.interfaces[interface];
            let of_opening = 0.5 * modulus[point] * crossing.distance * stretch * stretch;
            let energies = [of_opening, self.work.scalars[point][0] + taken[point]];
            // loads grow as the root of energies
            let loads = [0, 1].map(|mode| (energies[mode] / limits[point][mode]).sqrt());
            let ratio = mixed(loads, exponent);
            // neighbours may have broken all pairs of a point
            let pairs_left = self.plane.bonds_of(point) - failure.of_interface(interface).of(point);
            let ratio = if pairs_left == 0 {
                ratio.max(1.0)
            } else {
                ratio
            };
            if ratio < 1.0 {
                continue;
            }
            found.push(Exceeding {
                ratio,
                set: opening,
                point,
                slot: self.plane.slot_of(point),
            });
        }
        if found.len() == before {
            return;
        }
        // by slot, so that pairs across periodic faces break at both ends
        let mut loads = std::mem::take(&mut self.work.loads);
        loads.clear();
        loads.extend(limits.iter().map(|[_, sliding]| match sliding.is_finite() {
            true => 0.0,
            false => UNBREAKABLE,
        }));
        let open = found[before..].iter();
        // above one, where few pairs are left and the energy hardly depends on the load: bonds without an excess are not examined
        open.for_each(|open| loads[open.point] = open.ratio.next_up());
        let mut slots = std::mem::take(&mut self.work.load_slots);
        slots.load(&self.plane, &loads[..], Mirrored::Scalar);
        let breakable = failure.breakable(sliding, &self.plane);
        find_loaded(
            breakable,
            &MixedLoad,
            [&slots],
            &mut self.work.scalars,
            found,
        );
        self.work.load_slots = slots;
        self.work.loads = loads;
    }

    /// Bonds of a set of a layer beyond their limits.
    fn find_in_layer(&mut self, failure: &Failure, set: BondSet, found: &mut Vec<Exceeding>) {
        let sets = &failure.limits;
        let (layer, limits, along) = match set {
            BondSet::Matrix(layer) => (layer, &sets.matrix[layer], None),
            BondSet::Fibres(layer) => (layer, &sets.fibres[layer], failure.fibres[layer]),
            BondSet::Opening(_) | BondSet::Sliding(_) => return,
        };
        let own = self.layers[layer].inputs(true, &self.zeros);
        let inputs: [&[f64]; LOAD_INPUTS] = std::array::from_fn(|n| match n.checked_sub(LIMITS) {
            Some(side) => &limits[side][..],
            None => own[n],
        });
        let breakable = failure.breakable(failure.number(set), &self.plane);
        let excess = &mut self.work.scalars;
        specialise!(FINITE = self.base.is_finite() =>
            find_loaded(breakable, &Load::<FINITE> { along }, inputs, excess, found));
    }

    /// Bonds across an interface beyond their limit.
    fn find_open(&self, failure: &Failure, interface: usize, found: &mut Vec<Exceeding>) {
        let set = failure.number(BondSet::Opening(interface));
        let limits = &failure.limits.opening[interface];
        let points = self.points_of_layer();
        for point in (0..points).filter(|point| !failure.is_open(interface, *point)) {
            let ratio = self.stretch_across(interface, point, self.strained()) / limits[point];
            if ratio >= 1.0 {
                found.push(Exceeding {
                    ratio,
                    set,
                    point,
                    slot: self.plane.slot_of(point),
                });
            }
        }
    }

    /// Pairs of crossing bonds of an interface beyond their limit.
    fn find_sliding(&mut self, failure: &Failure, interface: usize, found: &mut Vec<Exceeding>) {
        let [lower, upper] = [interface, interface + 1].map(|layer| &self.layers[layer]);
        let of_stiffness = self.interfaces[interface].inputs(lower, upper);
        let limits = &failure.limits.sliding[interface];
        let inputs: [&[f64]; SHEAR_LOAD_INPUTS] = std::array::from_fn(|n| match n {
            0..6 => of_stiffness[n],
            _ => limits,
        });
        let crossing = self.interfaces[interface].crossing;
        let set = failure.number(BondSet::Sliding(interface));
        let breakable = failure.breakable(set, &self.plane);
        let excess = &mut self.work.scalars;
        specialise!(FINITE = self.base.is_finite() =>
            find_loaded(breakable, &InterfaceLoad::<FINITE>(crossing), inputs, excess, found));
    }
}

/// `(a^(2 m) + b^(2 m))^(1 / (2 m))` of two loads over their limits.
fn mixed([a, b]: [f64; 2], exponent: f64) -> f64 {
    let [small, large] = [a.min(b), a.max(b)];
    if small == 0.0 {
        return large;
    }
    let sum = 1.0 + (small / large).powf(2.0 * exponent);
    large * sum.powf(0.5 / exponent)
}

/// Adds the bonds of a set beyond their limit to `found`; only those of points with an `excess` are examined, which it becomes.
fn find_loaded<const I: usize>(
    breakable: Breakable<'_>,
    load: &impl BondLoad<I>,
    inputs: [&[f64]; I],
    excess: &mut [[f64; 1]],
    found: &mut Vec<Exceeding>,
) {
    let Breakable { family, broken, .. } = breakable;
    family.sum_unbroken(&Excess(load), inputs, Some(broken), excess);
    let points = excess.iter().enumerate();
    let points = points.filter(|(_, [e])| *e > 0.0).map(|(point, _)| point);
    let ratio = |point: usize, _: usize, bond: &Bond, slot: usize| {
        let [own, other] = [family.slot_of(point), slot].map(|slot| inputs.map(|i| i[slot]));
        load.ratio(bond, &own, &other)
    };
    breakable.find_exceeding(points, ratio, found);
}
