//! Coupling of a coarse body to its refined window.

use std::collections::BTreeMap;
use std::sync::Arc;

use perimelt_core::body::Sizes;
use perimelt_core::world::BodyIndex;
use perimelt_core::{Family, Read, World};

use super::{Crossing, Exchange};
use crate::thermal::conduction::{Conduction, coefficient};

/// Coupling of the plate to the window.
#[derive(Debug)]
pub(in crate::thermal) struct Plate {
    pub(super) body: BodyIndex,
    pub(super) taken: Read<f64>,
    /// Volume of each cell, zero where the window covers it, m³.
    pub(super) volume: Arc<Sizes>,
    /// Points beside the window.
    pub(super) receivers: Vec<u32>,
    pub(super) exchange: Exchange,
    /// Position of the window for which the bonds were found.
    pub(super) at: Option<[i64; 3]>,
}

impl Plate {
    /// Updates the bonds for the position of the window.
    pub(super) fn follow(&mut self, world: &World, family: &Family) {
        let Some((refinement, _)) = world.refinement(self.body) else {
            return;
        };
        let low = refinement.position().low;
        if self.at == Some(low) {
            return;
        }
        self.at = Some(low);
        let body = world.body(self.body);
        self.volume = Arc::new(refinement.uncovered(&body.points.volume));
        let spacing = body.finest_spacing();
        let reach = (family.spec().horizon.of(spacing) / spacing).ceil() as i64 + 1;
        let covered = refinement.cells();
        let near = |a: usize| {
            let to = low[a] + covered[a] as i64 + reach;
            (low[a] - reach).max(0) as usize..to.min(refinement.plate_cells()[a] as i64) as usize
        };
        let point_in = family.points_of_slots();
        let mut by_cell: BTreeMap<u32, Vec<Crossing>> = BTreeMap::new();
        for z in near(2) {
            for y in near(1) {
                for x in near(0) {
                    let cell = [x, y, z];
                    if refinement.covers(cell) {
                        continue;
                    }
                    let point = refinement.plate_point(cell);
                    let beside = std::array::from_fn(|a| {
                        (cell[a] as i64).clamp(low[a] - 1, low[a] + covered[a] as i64) as usize
                    });
                    let receiver = refinement.plate_point(beside) as u32;
                    let own = family.slot_of(point) as u32;
                    family.for_each_bond(point, |_, bond, other| {
                        let end = point_in[other] as usize;
                        if refinement.covers(refinement.plate_cell(end)) {
                            by_cell.entry(receiver).or_default().push(Crossing {
                                own,
                                other: other as u32,
                                coefficient: body.points.volume[point] * coefficient(bond),
                            });
                        }
                    });
                }
            }
        }
        (self.receivers, self.exchange) = Exchange::collect(by_cell);
    }

    /// Removes the heat of bonds with covered cells, and adds the heat of the window in a step `dt` (s), which is
    /// returned, J.
    pub(super) fn take(&self, world: &World, dt: f64, conduction: &mut Conduction) -> f64 {
        let volume = &world.body(self.body).points.volume;
        for (cell, &point) in self.receivers.iter().enumerate() {
            let (field, factor) = conduction.linear_input();
            let power = self.exchange.power(cell, field, factor);
            conduction.rate[point as usize][0] -= power / volume[point as usize];
        }
        let mut heat = 0.0;
        let taken = world.read(self.taken);
        for (point, &amount) in taken.iter().enumerate().filter(|(_, a)| **a != 0.0) {
            conduction.rate[point][0] += amount / (dt * volume[point]);
            heat += amount;
        }
        heat
    }
}
