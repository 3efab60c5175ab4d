//! Families of points with spacings and horizons of their own.
//!
//! A row holds the union of horizon and dual horizon, `{ j : |xi| <= delta_i or |xi| <= delta_j }`
//! (Wang (2025), eqs. 5.5, 5.12, 5.13; Khoshrou (2024), eq. 82). The partial volume of a
//! bond belongs to the owner of the horizon: its horizon and the spacing of the other end.

use std::sync::OnceLock;

use nalgebra::Vector3;
use rayon::prelude::*;

use crate::body::Body;
use crate::cell_list::CellList;

use super::balance::Balance;
use super::blocks::Blocks;
use super::build::{chunks, cuts};
use super::calibration::{Calibration, factor_along};
use super::images::Images;
use super::kernel::ROW_LANES;
use super::lattice::stencil;
use super::{Bond, Correction, Family, FamilyError, FamilySpec, Order, Rows, Span, TIE};
use crate::body::Cut;

/// Bonds of a point beyond which a horizon is taken for a mistake.
const MOST_BONDS: usize = 65_535;

/// Points and images, with what their families need.
struct Members<'a> {
    spec: &'a FamilySpec,
    calibration: Calibration,
    images: Images,
    spacing: &'a [f64],
    volume: &'a [f64],
    /// By point, m.
    horizon: Vec<f64>,
    /// Moment of a family of horizon 1 m; it grows as a power of the horizon.
    unit_moment: f64,
    power: i32,
}

/// A bond and the slot at its other end.
pub(super) type Member = (u32, Bond);

impl Members<'_> {
    /// How far the family of `owner` holds points like `other`, m.
    fn cut(&self, owner: usize, other: usize) -> f64 {
        self.spec.reach(self.horizon[owner], self.spacing[other])
    }

    /// Influence times partial volume over the moment, of a point like `other` in the family of
    /// `owner`.
    fn share(&self, owner: usize, other: usize, length: f64) -> f64 {
        let horizon = self.horizon[owner];
        let moment = self.unit_moment * horizon.powi(self.power);
        self.spec.share(horizon, self.spacing[other], length) / moment
    }

    /// The bond of a point to a slot, uncorrected; `None` beyond both horizons.
    fn bond(&self, point: usize, slot: usize) -> Option<Bond> {
        let xi = self.images.position[slot] - self.images.position[point];
        let length = xi.norm();
        let other = self.images.point[slot] as usize;
        let reached = length <= self.cut(point, other) || length <= self.cut(other, point);
        reached.then(|| Bond {
            xi: xi.into(),
            length,
            inverse_length: 1.0 / length,
            weight: self.share(point, other, length) * self.volume[other],
            dual: self.share(other, point, length) * self.volume[other],
        })
    }

    /// The bonds of a point, by slot.
    fn of(&self, list: &CellList, reach: f64, point: usize) -> Vec<Member> {
        let mut members = Vec::new();
        list.visit_near(&self.images.position[point], reach, |slot| {
            if slot != point
                && let Some(bond) = self.bond(point, slot)
            {
                members.push((slot as u32, bond));
            }
        });
        members.sort_by_key(|(slot, _)| *slot);
        members
    }

    /// Factors along the axes that calibrate a point's own family.
    fn factors(
        &self,
        body: &Body,
        point: usize,
        members: &[Member],
    ) -> Result<[f64; 3], FamilyError> {
        let near = TIE * self.spacing[point];
        if members.iter().any(|(_, b)| b.length <= near) {
            return Err(FamilyError::Coincident {
                at: body.points.position[point].into(),
            });
        }
        let own = || members.iter().map(|(_, b)| b).filter(|b| b.weight > 0.0);
        let trace: f64 = own().map(|b| b.weight * b.length).sum();
        if trace <= 0.0 {
            return Err(self.no_neighbours(body, point));
        }
        if self.spec.correction == Correction::Zone {
            let horizon = self.horizon[point];
            let cell = (self.spacing[point], self.volume[point]);
            let members = stencil(body, self.spec, horizon, cell);
            let complete = members.iter().map(|(_, b)| b);
            return Ok(self.calibration.factors(horizon, complete));
        }
        Ok(self.calibration.factors(self.horizon[point], own()))
    }

    fn no_neighbours(&self, body: &Body, point: usize) -> FamilyError {
        FamilyError::NoNeighbours {
            at: body.points.position[point].into(),
            horizon: self.horizon[point],
        }
    }
}

impl Family {
    pub(super) fn on_cloud(body: &Body, spec: &FamilySpec) -> Result<Family, FamilyError> {
        let points = body.points.len();
        let horizon = body.points.horizons(spec.horizon);
        let coarsest = body.coarsest_spacing();
        let reach = |horizon: f64| spec.reach(horizon, coarsest);
        let widest = reach(horizon.iter().copied().fold(0.0, f64::max));
        let members = Members {
            spec,
            calibration: Calibration::new(body, spec),
            images: Images::new(body, spec, widest),
            spacing: &body.points.spacing,
            volume: &body.points.volume,
            unit_moment: spec.moment(body, 1.0),
            power: body.dimension as i32 + 1,
            horizon,
        };
        let of_slot = |&p: &u32| reach(members.horizon[p as usize]);
        let reaches: Vec<f64> = members.images.point.iter().map(of_slot).collect();
        let list = CellList::new(&members.images.position, &reaches);
        let of = |p: usize| members.of(&list, reaches[p], p);
        let finest = body.finest_spacing();
        let densest = body.points.spacing.iter().position(|s| *s == finest);
        let bonds = of(densest.unwrap_or(0)).len();
        if bonds > MOST_BONDS {
            return Err(FamilyError::HorizonTooLarge { bonds });
        }

        // the factors of both ends of a bond are known only after all families
        let factors: Vec<Result<[f64; 3], FamilyError>> = (0..points)
            .into_par_iter()
            .map(|p| members.factors(body, p, &of(p)))
            .collect();
        let factors = factors.into_iter().collect::<Result<Vec<_>, _>>()?;

        let corrected = |p: usize| {
            let mut row = of(p);
            for (slot, bond) in &mut row {
                let other = members.images.point[*slot as usize] as usize;
                bond.weight *= factor_along(bond, &factors[p]);
                bond.dual *= factor_along(bond, &factors[other]);
            }
            row
        };
        let balance = match spec.correction {
            Correction::Balanced => {
                let whole = (0..points).into_par_iter().map(corrected).collect();
                Some(Balance::new(body, spec, &members.images, whole)?)
            }
            _ => None,
        };
        let cuts = cuts(body, spec);
        let rows: Vec<Rows> = (0..points)
            .into_par_iter()
            .map(|p| {
                let mut row = corrected(p);
                row.retain(|(slot, bond)| {
                    !severed(&cuts, &members.images.position, p, *slot as usize, bond)
                });
                if let Some(balance) = &balance {
                    for (slot, bond) in &mut row {
                        let factor = balance.factor(p, *slot as usize, bond);
                        bond.weight *= factor;
                        bond.dual *= factor;
                    }
                }
                Rows::of_point(p, &row)
            })
            .collect();
        if let Some(p) = rows.iter().position(|row| row.column.is_empty()) {
            return Err(members.no_neighbours(body, p));
        }

        let images = members.images;
        let audited = |row: &Rows| {
            let kept = |i: &usize| images.audited[row.column[*i] as usize];
            row.select((0..row.column.len()).filter(kept))
        };
        let layer_rows = if spec.audited.is_empty() {
            Rows::joined(&[])
        } else {
            let parts: Vec<Rows> = rows.iter().map(audited).collect();
            Rows::joined(&parts)
        };
        let rows = Rows::joined(&rows);
        let mut family = Family::of_rows(body, spec, (rows, layer_rows));
        family.take_images(images);
        Ok(family)
    }

    /// A family with a row for every point, without slots yet ([`Family::take_images`]).
    pub(super) fn of_rows(
        body: &Body,
        spec: &FamilySpec,
        (rows, layer_rows): (Rows, Rows),
    ) -> Family {
        let points = body.points.len();
        Family {
            spec: spec.clone(),
            points,
            bonds: 0,
            slots: 0,
            spans: vec![Span {
                slot: 0,
                point: 0,
                len: points as u32,
            }],
            ghosts: Vec::new(),
            layers: Vec::new(),
            corners: Vec::new(),
            periodic: body.periodic,
            flat: body.dimension < 3,
            places: Default::default(),
            grid: None,
            stencil: Vec::new(),
            runs: Vec::new(),
            chunks: chunks(&[], 0, points),
            blocks: Blocks::default(),
            rows,
            layer_rows,
            order: Order::default(),
            following: None,
            growth: None,
            unborn: Vec::new(),
            pairs: OnceLock::new(),
        }
    }

    /// Lets the columns of the rows be slots of these images.
    pub(super) fn take_images(&mut self, images: Images) {
        self.bonds = self.rows.column.len() - ROW_LANES;
        self.slots = images.position.len();
        let end_in_slots = |rows: &Rows| rows.column.iter().all(|c| (*c as usize) < self.slots);
        // the sweep relies on it
        assert!(end_in_slots(&self.rows) && end_in_slots(&self.layer_rows));
        self.places = std::array::from_fn(|a| images.position.iter().map(|x| x[a]).collect());
        let corners = images.ghosts.iter().copied();
        self.corners = corners.filter(super::Ghost::is_corner).collect();
        self.ghosts = images.ghosts;
        self.layers = images.layers;
    }
}

/// Whether a cut separates the ends of a bond; asked from either end, the answer is the same.
fn severed(
    cuts: &[Cut],
    position: &[Vector3<f64>],
    point: usize,
    slot: usize,
    bond: &Bond,
) -> bool {
    let (from, to) = (&position[point.min(slot)], &position[point.max(slot)]);
    // most points are far from all cuts
    cuts.iter()
        .any(|cut| cut.distance(from).abs() <= 2.0 * bond.length && cut.crosses(from, to))
}

impl Rows {
    pub(super) fn of_point(point: usize, members: &[Member]) -> Rows {
        Rows {
            point: vec![point as u32],
            slot: vec![point as u32],
            start: vec![0, members.len()],
            column: members.iter().map(|(slot, _)| *slot).collect(),
            step: Vec::new(),
            weight: members.iter().map(|(_, b)| b.weight).collect(),
            dual: members.iter().map(|(_, b)| b.dual).collect(),
        }
    }

    /// Some bonds of the row of one point.
    fn select(&self, bonds: impl Iterator<Item = usize> + Clone) -> Rows {
        let of = |values: &[f64]| bonds.clone().map(|i| values[i]).collect();
        let column: Vec<u32> = bonds.clone().map(|i| self.column[i]).collect();
        Rows {
            point: self.point.clone(),
            slot: self.slot.clone(),
            start: vec![0, column.len()],
            column,
            step: Vec::new(),
            weight: of(&self.weight),
            dual: of(&self.dual),
        }
    }

    /// All rows that have bonds.
    pub(super) fn joined(parts: &[Rows]) -> Rows {
        let parts = || parts.iter().filter(|p| !p.column.is_empty());
        let mut all = Rows {
            start: vec![0],
            ..Rows::default()
        };
        let bonds: usize = parts().map(|p| p.column.len()).sum();
        all.column.reserve_exact(bonds + ROW_LANES);
        all.weight.reserve_exact(all.column.capacity());
        all.dual.reserve_exact(all.column.capacity());
        for part in parts() {
            all.point.extend(&part.point);
            all.slot.extend(&part.slot);
            all.column.extend(&part.column);
            all.weight.extend(&part.weight);
            all.dual.extend(&part.dual);
            all.start.push(all.column.len());
        }
        // the last row is read a few lanes further
        all.column.extend([0; ROW_LANES]);
        all.weight.extend([0.0; ROW_LANES]);
        all.dual.extend([0.0; ROW_LANES]);
        all
    }
}
