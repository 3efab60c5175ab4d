//! Families of points with spacings and horizons of their own.
//!
//! A row holds the union of horizon and dual horizon, `{ j : |xi| <= delta_i or |xi| <= delta_j }`
//! (Wang (2025), eqs. 5.5, 5.12, 5.13; Khoshrou (2024), eq. 82). The partial volume of a
//! bond belongs to the owner of the horizon: its horizon and the spacing of the other end.

use rayon::prelude::*;

use crate::body::Body;
use crate::cell_list::CellList;

use super::balance::Balance;
use super::build::{Share, chunks, cuts};
use super::calibration::{Calibration, factor_along};
use super::images::Images;
use super::kernel::ROW_LANES;
use super::lattice::stencil;
use super::{
    Bond, CloudRows, Correction, Family, FamilyError, FamilySpec, PointSlots, Rows, SlotPlaces,
    Slots, Span, Store, TIE,
};
use crate::body::{Cut, severed};

/// Bonds of a point beyond which a horizon is a mistake.
const MOST_BONDS: usize = 65_535;

/// Points and images, with the data from which their bonds follow.
struct CloudBonds<'a> {
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
    list: CellList,
    /// Distance within which slots may be members, by slot, m.
    reach: Vec<f64>,
}

/// A bond and the slot at its other end.
pub(super) type SlotBond = (u32, Bond);

impl<'a> CloudBonds<'a> {
    fn new(share: Share<'a>, spec: &'a FamilySpec) -> Self {
        let body = share.body;
        let horizon = body.points.horizons(spec.horizon);
        let coarsest = body.coarsest_spacing();
        let reach = |horizon: f64| spec.reach(horizon, coarsest);
        let widest = reach(horizon.iter().copied().fold(0.0, f64::max));
        let images = Images::new(share, spec, widest);
        let of_slot = |&p: &u32| reach(horizon[p as usize]);
        let reach: Vec<f64> = images.point.iter().map(of_slot).collect();
        CloudBonds {
            spec,
            calibration: Calibration::new(body, spec),
            list: CellList::new(&images.position, &reach),
            images,
            spacing: &body.points.spacing,
            volume: &body.points.volume,
            horizon,
            unit_moment: spec.moment(body, 1.0),
            power: body.dimension as i32 + 1,
            reach,
        }
    }

    /// Refuses a horizon that is a mistake, by the point with the finest spacing.
    fn check_horizon(&self, body: &Body) -> Result<(), FamilyError> {
        let finest = body.finest_spacing();
        let densest = self.spacing.iter().position(|s| *s == finest);
        match self.of(densest.unwrap_or(0)).len() {
            bonds if bonds > MOST_BONDS => Err(FamilyError::HorizonTooLarge { bonds }),
            _ => Ok(()),
        }
    }

    /// Distance within which the family of `owner` contains points like `other`, m.
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
        reached.then(|| {
            let shares = [[point, other], [other, point]].map(|[a, b]| self.share(a, b, length));
            Bond::new(
                xi.into(),
                length,
                shares.map(|share| share * self.volume[other]),
            )
        })
    }

    /// The uncorrected bonds of a point, by slot.
    fn of(&self, point: usize) -> Vec<SlotBond> {
        let (position, reach) = (&self.images.position[point], self.reach[point]);
        let mut members = Vec::new();
        self.list.visit_near(position, reach, |slot| {
            if slot != point
                && let Some(bond) = self.bond(point, slot)
            {
                members.push((slot as u32, bond));
            }
        });
        members.sort_by_key(|(slot, _)| self.images.rank[*slot as usize]);
        members
    }

    /// The bonds of a point, by slot, with the factors of both ends.
    fn corrected(&self, point: usize, factors: &[[f64; 3]]) -> Vec<SlotBond> {
        let mut row = self.of(point);
        for (slot, bond) in &mut row {
            let other = self.images.point[*slot as usize] as usize;
            bond.weight *= factor_along(bond, &factors[point]);
            bond.dual *= factor_along(bond, &factors[other]);
        }
        row
    }

    /// Factors along the axes that calibrate a point's own family.
    fn factors(&self, body: &Body, point: usize) -> Result<[f64; 3], FamilyError> {
        let members = self.of(point);
        let near = TIE * self.spacing[point];
        if members.iter().any(|(_, b)| b.length <= near) {
            return Err(FamilyError::Coincident {
                at: body.points.position.at(point).into(),
            });
        }
        let own = || members.iter().map(|(_, b)| b).filter(|b| b.weight > 0.0);
        let trace: f64 = own().map(|b| b.weight * b.length).sum();
        if trace <= 0.0 {
            return Err(self.no_neighbours(body, point));
        }
        if self.spec.correction == Correction::Zone {
            let horizon = self.horizon[point];
            let (spacing, volume) = (self.spacing[point], self.volume[point]);
            let complete = stencil(body, self.spec, horizon, spacing, volume);
            let complete = complete.iter().map(|(_, b)| b);
            return Ok(self.calibration.factors(horizon, complete));
        }
        Ok(self.calibration.factors(self.horizon[point], own()))
    }

    /// Whether a cut separates the ends of a bond, whichever end is `point`.
    fn severed(&self, cuts: &[Cut], point: usize, slot: usize) -> bool {
        let Images { position, rank, .. } = &self.images;
        match rank[point] < rank[slot] {
            true => severed(cuts, &position[point], &position[slot]),
            false => severed(cuts, &position[slot], &position[point]),
        }
    }

    fn no_neighbours(&self, body: &Body, point: usize) -> FamilyError {
        FamilyError::NoNeighbours {
            at: body.points.position.at(point).into(),
            horizon: self.horizon[point],
        }
    }
}

impl Family {
    pub(super) fn on_cloud(share: Share<'_>, spec: &FamilySpec) -> Result<Family, FamilyError> {
        let (body, points) = (share.body, share.owned);
        let bonds = CloudBonds::new(share, spec);
        bonds.check_horizon(body)?;

        // the factors of both ends of a bond are available only after all families
        let factors: Vec<Result<[f64; 3], FamilyError>> = (0..body.points.len())
            .into_par_iter()
            .map(|p| match bonds.factors(body, p) {
                // at the edge of the part, where no bond reaches
                Err(_) if p >= points => Ok([0.0; 3]),
                factors => factors,
            })
            .collect();
        let factors = factors.into_iter().collect::<Result<Vec<_>, _>>()?;
        let corrected = |p: usize| bonds.corrected(p, &factors);
        let balance = match spec.correction {
            Correction::Balanced if !share.is_whole() => {
                let reason = "parts of a body are not balanced alone".to_string();
                return Err(FamilyError::NotBalanced { reason });
            }
            Correction::Balanced => {
                let whole = (0..points).into_par_iter().map(corrected).collect();
                Some(Balance::new(body, spec, &bonds.images, whole)?)
            }
            _ => None,
        };
        let cuts = cuts(body, spec);
        let rows: Vec<Rows> = (0..points)
            .into_par_iter()
            .map(|p| {
                let mut row = corrected(p);
                row.retain(|(slot, _)| !bonds.severed(&cuts, p, *slot as usize));
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
            return Err(bonds.no_neighbours(body, p));
        }

        let images = bonds.images;
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
        let rows = CloudRows::new(body, Rows::joined(&rows));
        let all = Span {
            slot: 0,
            point: 0,
            len: points as u32,
        };
        let slots = PointSlots::Ascending(vec![all]);
        let mut family = Family::of_rows(body, spec, Store::Cloud(rows), slots);
        (family.points, family.layer_rows) = (points, layer_rows);
        let remote = points as u32..body.points.len() as u32;
        family.slots.remote = remote.map(|point| (point, point)).collect();
        family.take_images(images);
        Ok(family)
    }

    /// A family with a row for every point, without slots yet ([`Family::take_images`]).
    pub(super) fn of_rows(
        body: &Body,
        spec: &FamilySpec,
        store: Store,
        points: PointSlots,
    ) -> Family {
        Family {
            spec: spec.clone(),
            points: body.points.len(),
            of_body: body.points.len(),
            bonds: 0,
            slots: Slots {
                points,
                periodic: body.periodic,
                ..Slots::default()
            },
            chunks: Vec::new(),
            store,
            layer_rows: Rows::joined(&[]),
        }
    }

    /// Lays out slots; the columns of the rows refer to `images`.
    pub(super) fn take_images(&mut self, images: Images) {
        let (Store::Cloud(cloud) | Store::Moving(cloud, _)) = &mut self.store else {
            return;
        };
        self.bonds = cloud.rows.column.len() - ROW_LANES;
        self.slots.len = images.position.len();
        let end_in_slots = |rows: &Rows| {
            let mut columns = rows.column.iter();
            columns.all(|c| (*c as usize) < self.slots.len)
        };
        // the sweep relies on it
        assert!(end_in_slots(&cloud.rows) && end_in_slots(&self.layer_rows));
        cloud.places.at = std::array::from_fn(|a| images.position.iter().map(|x| x[a]).collect());
        self.slots.set_ghosts(images.layers);
        self.chunks = chunks(&self.store);
    }
}

impl CloudRows {
    /// Rows of a body, without places yet ([`Family::take_images`]).
    pub(super) fn new(body: &Body, rows: Rows) -> CloudRows {
        let places = SlotPlaces {
            flat: body.dimension < 3,
            ..SlotPlaces::default()
        };
        CloudRows { places, rows }
    }
}

impl Rows {
    pub(super) fn of_point(point: usize, members: &[SlotBond]) -> Rows {
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
