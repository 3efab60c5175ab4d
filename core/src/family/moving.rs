//! Families that follow their points: neighbours, images and weights change as points move.
//!
//! Rows hold all members within the horizon and a skin; members in the skin have weight zero. Rows stay as they are
//! until a point has moved by half the skin. Then [`Family::rebuild_rows`] finds new rows and puts slots and rows in
//! the order in which the points lie in space, so that neighbours stay close together in memory however much the
//! points mix. [`Family::update_weights`] moves the images behind faces with their points and computes the weights; it is
//! called for every new configuration. The [`World`](crate::World) owns the families of moving bodies and calls both.

use nalgebra::Vector3;
use rayon::prelude::*;

use crate::body::{Body, Curve, Part};
use crate::cell_list::CellList;
use crate::neighbours::{self, Reaching};
use crate::parallel::ParallelLoop;

use super::build::Share;
use super::images::Images;
use super::kernel::{ROW_LANES, RowOwner, Weighing};
use super::{
    CloudRows, Correction, Family, FamilyError, FamilySpec, PointSlots, Rows, Slots, Store, TIE,
};

/// Width of the skin, in spacings of the finest points.
const SKIN: f64 = 0.5;

/// Rows that a thread weighs at once.
const ROWS_PER_TASK: usize = 512;

/// Width of the skin of families of a body with this finest spacing, m.
pub(crate) fn skin(finest: f64) -> f64 {
    SKIN * finest
}

/// Refuses what a family of moving points does not support.
fn check(body: &Body, spec: &FamilySpec) -> Result<(), FamilyError> {
    let refuse = |what, expected| Err(FamilyError::Moving { what, expected });
    if spec.correction != Correction::None {
        return refuse("corrections of its bonds", "`correction = \"none\"`");
    }
    if !body.points.horizon_factor.is_empty() {
        return refuse("a `horizon_factor`", "zones without one");
    }
    if !body.cuts.is_empty() {
        return refuse("bonds that a `crack` cuts", "a body without cracks");
    }
    let horizon = |spacing: f64| spec.horizon.of(spacing);
    let (finest, coarsest) = (body.finest_spacing(), body.coarsest_spacing());
    if horizon(finest) < horizon(coarsest) {
        return refuse(
            "horizons that differ from point to point",
            "points of one spacing, or `horizon = { length = ... }`",
        );
    }
    if horizon(finest) < coarsest * (1.0 - TIE) {
        return Err(FamilyError::HorizonTooSmall {
            horizon: horizon(finest),
            spacing: coarsest,
        });
    }
    Ok(())
}

/// Data by which a family follows its points.
#[derive(Debug)]
pub(super) struct Following {
    /// The body with current positions and volumes, by slot: the owned points, then those of other parts, each along the curve.
    body: Body,
    /// Number of the points that have bonds.
    owned: usize,
    /// Number in the whole body of each point.
    numbers: Vec<u32>,
    /// Largest spacing in the whole body, m.
    coarsest: f64,
    /// By point, m.
    spacing_of_point: Vec<f64>,
    /// By slot, m.
    horizon: Vec<f64>,
    skin: f64,
    list: CellList,
    /// Moment of a family of horizon 1 m; it grows as a power of the horizon.
    unit_moment: f64,
    /// By slot, m³.
    volume: Vec<f64>,
    /// By slot, m.
    spacing: Vec<f64>,
}

impl Family {
    /// A family of the points of `body`, found by position whatever the store of the body, that can follow them.
    ///
    /// # Errors
    /// See [`Family::build`]; also for cuts, corrections and different horizons, which families of moving points do not
    /// support.
    pub fn moving(body: &Body, spec: &FamilySpec) -> Result<Family, FamilyError> {
        Family::of_moving_part(Part::whole(body), spec)
    }

    /// A family of the points that a part of a body owns, which can follow them until one of them needs new rows: then the body
    /// is divided anew. Slots of remote points are filled by an exchange ([`Family::remote`]), which brings their positions
    /// and volumes, too.
    ///
    /// # Errors
    /// See [`Family::moving`].
    pub fn of_moving_part(part: Part, spec: &FamilySpec) -> Result<Family, FamilyError> {
        let Part {
            body,
            owned,
            numbers,
            curve,
            coarsest,
        } = part;
        check(&body, spec)?;
        let (positions, volumes) = (body.points.position.to_vec(), body.points.volume.to_vec());
        let slots = PointSlots::sorted(Vec::new());
        let mut family = Family {
            points: owned,
            ..Family::of_rows(&body, spec, Store::default(), slots)
        };
        let rows = CloudRows::new(&body, Rows::default());
        let spacings = &body.points.spacing;
        let following = Following {
            owned,
            numbers,
            coarsest,
            spacing_of_point: spacings.to_vec(),
            horizon: spacings.each().map(|s| spec.horizon.of(s)).collect(),
            skin: skin(curve.width),
            list: CellList::default(),
            unit_moment: spec.moment(&body, 1.0),
            volume: Vec::new(),
            spacing: Vec::new(),
            body,
        };
        family.store = Store::Moving(rows, Box::new(following));
        family.find_rows(&positions, curve);
        family.forget_unreached();
        family.weigh(&volumes);
        Ok(family)
    }

    /// Moves points and their images to these positions (m) and computes the weights of all bonds, for these volumes
    /// (m³). No point may be farther than half the skin from where the rows were found.
    ///
    /// # Panics
    /// For another number of points.
    pub fn update_weights(&mut self, positions: &[Vector3<f64>], volumes: &[f64]) {
        if let Store::Moving(cloud, following) = &mut self.store {
            let points = &mut following.body.points.position;
            self.slots.points.arrange(positions, points);
            following.place_images(&self.slots, &mut cloud.places.at);
        }
        self.weigh(volumes);
    }

    /// Finds the neighbours of all points at these positions (m). Slots change with the images behind faces, so
    /// that [`Family::slots`] changes. The weights are valid only after [`Family::update_weights`].
    ///
    /// # Panics
    /// When the family does not move or is that of a part, or for another number of points.
    pub fn rebuild_rows(&mut self, positions: &[Vector3<f64>]) {
        let Store::Moving(_, following) = &self.store else {
            panic!("the family does not move");
        };
        assert!(following.is_whole(), "a part is cut anew");
        let curve = Curve::through(
            positions.iter().copied(),
            following.spacing_of_point.iter().copied(),
        );
        self.find_rows(positions, curve);
    }

    /// Finds slots and rows of points at these positions (m), sorted along the curve.
    fn find_rows(&mut self, positions: &[Vector3<f64>], curve: Curve) {
        let Store::Moving(cloud, following) = &mut self.store else {
            return;
        };
        let order = following.order(positions, curve);
        let ranks = following.ranks(&order, positions, curve);
        self.slots.points = PointSlots::sorted(order.clone());
        following.arrange(&self.slots.points, positions);
        let mut images = following.find_rows(&self.spec, &ranks, &mut cloud.rows);
        let (owned, remote) = order.split_at(following.owned);
        cloud.rows.point.clear();
        cloud.rows.point.extend(owned);
        self.slots.remote = (following.owned as u32..)
            .zip(remote.iter().copied())
            .collect();
        self.layer_rows = match self.spec.audited.is_empty() {
            true => Rows::joined(&[]),
            false => cloud.rows.of_columns(&images.audited),
        };
        let ghosts = images.layers.ghosts.iter_mut();
        ghosts.for_each(|g| g.point = order[g.point as usize]);
        self.take_images(images);
    }

    /// Weights of all bonds from where their ends are, for points of these volumes (m³).
    fn weigh(&mut self, volumes: &[f64]) {
        let Store::Moving(cloud, following) = &mut self.store else {
            return;
        };
        let Following {
            body,
            horizon,
            unit_moment,
            volume,
            spacing,
            ..
        } = &mut **following;
        self.slots.points.arrange(volumes, &mut body.points.volume);
        for (by_slot, own) in [
            (&mut *volume, &body.points.volume),
            (&mut *spacing, &body.points.spacing),
        ] {
            by_slot.clear();
            by_slot.extend(own);
            for ghost in &self.slots.ghosts {
                by_slot.push(by_slot[ghost.source as usize]);
            }
        }
        let weighing = Weighing::new(&self.spec, &cloud.places, volume, spacing);
        let power = body.dimension as i32 + 1;
        let owner = |slot: usize| RowOwner {
            slot,
            horizon: horizon[slot],
            moment: *unit_moment * horizon[slot].powi(power),
        };
        cloud.rows.weigh(&weighing, &owner);
        self.layer_rows.weigh(&weighing, &owner);
    }
}

impl Following {
    fn is_whole(&self) -> bool {
        self.owned == self.numbers.len()
    }

    /// The point in each slot.
    fn order(&self, positions: &[Vector3<f64>], curve: Curve) -> Vec<u32> {
        let mut order: Vec<u32> = (0..positions.len() as u32).collect();
        let (owned, remote) = order.split_at_mut(self.owned);
        for points in [owned, remote] {
            curve.sort(points, positions, |p| self.numbers[p as usize]);
        }
        order
    }

    /// Place of the point in each slot along the curve through all points.
    fn ranks(&self, order: &[u32], positions: &[Vector3<f64>], curve: Curve) -> Vec<u32> {
        let mut ranks: Vec<u32> = (0..order.len() as u32).collect();
        if !self.is_whole() {
            let mut along = order.to_vec();
            curve.sort(&mut along, positions, |p| self.numbers[p as usize]);
            let slots = PointSlots::sorted(order.to_vec());
            for (rank, point) in (0..).zip(along) {
                ranks[slots.of(point as usize)] = rank;
            }
        }
        ranks
    }

    /// Copies positions (m) and spacings of the points to their slots.
    fn arrange(&mut self, points: &PointSlots, positions: &[Vector3<f64>]) {
        points.arrange(positions, &mut self.body.points.position);
        points.arrange(&self.spacing_of_point, &mut self.body.points.spacing);
    }

    /// Finds the rows of the points in their slots, of which `ranks` gives the order, and their images.
    fn find_rows(&mut self, spec: &FamilySpec, ranks: &[u32], rows: &mut Rows) -> Images {
        let is_whole = self.is_whole();
        let Following {
            body,
            owned,
            coarsest,
            horizon,
            skin,
            list,
            ..
        } = self;
        let spacings = horizon.iter_mut().zip(&body.points.spacing);
        spacings.for_each(|(h, s)| *h = spec.horizon.of(*s));
        let reach = horizon.iter().map(|h| spec.reach(*h, *coarsest) + *skin);
        let reach: Vec<f64> = reach.collect();
        let widest = reach.iter().copied().fold(0.0, f64::max);
        let share = Share {
            body,
            owned: *owned,
            numbers: Some(ranks),
        };
        let images = Images::new(share, spec, widest);
        let reaches: Vec<f64> = images.point.iter().map(|&p| reach[p as usize]).collect();
        let owners = Reaching {
            positions: &body.points.position[..*owned],
            reach: &reach[..*owned],
        };
        let candidates = Reaching {
            positions: &images.position,
            reach: &reaches,
        };
        let within = |point: usize, slot: usize| (slot != point).then_some(reach[point]);
        let near = neighbours::find(list, owners, candidates, within);
        let Rows {
            slot,
            start,
            column,
            weight,
            ..
        } = rows;
        slot.clear();
        slot.extend(0..near.len() as u32);
        column.clear();
        column.reserve(near.iter().map(Vec::len).sum::<usize>() + ROW_LANES);
        start.clear();
        start.push(0);
        for mut row in near {
            if !is_whole {
                row.sort_by_key(|slot| images.rank[*slot as usize]);
            }
            column.extend(row);
            start.push(column.len());
        }
        // the last row is read a few lanes further
        column.extend([0; ROW_LANES]);
        weight.clear();
        weight.resize(column.len(), 0.0);
        images
    }

    /// Moves the images with their points.
    fn place_images(&self, slots: &Slots, places: &mut [Vec<f64>; 3]) {
        let body = &self.body;
        for (axis, places) in places.iter_mut().enumerate() {
            let points = places.iter_mut().zip(&body.points.position);
            points.for_each(|(place, x)| *place = x[axis]);
        }
        for (face, ghosts) in slots.layers() {
            let axis = face.axis();
            let (position, extent) = (body.face_position(face), body.extent(axis));
            for ghost in ghosts {
                let (slot, source) = (ghost.slot as usize, ghost.source as usize);
                for (a, places) in places.iter_mut().enumerate() {
                    places[slot] = match (a == axis, slots.periodic[axis]) {
                        (false, _) => places[source],
                        (true, false) => 2.0 * position - places[source],
                        (true, true) if face.is_upper() => places[source] + extent,
                        (true, true) => places[source] - extent,
                    };
                }
            }
        }
    }
}

impl Rows {
    /// Weights of all bonds; `owner` gives the point in a slot.
    fn weigh(&mut self, weighing: &Weighing<'_>, owner: &(impl Fn(usize) -> RowOwner + Sync)) {
        let Rows {
            slot,
            start,
            column,
            weight,
            ..
        } = self;
        let (mut tasks, mut rest, mut done) = (Vec::new(), &mut weight[..], 0);
        for first in (0..slot.len()).step_by(ROWS_PER_TASK) {
            let last = (first + ROWS_PER_TASK).min(slot.len());
            let (task, left) = rest.split_at_mut(start[last] - done);
            tasks.push((first..last, task));
            (rest, done) = (left, start[last]);
        }
        tasks.into_par_iter().for_all(|(rows, weights)| {
            let offset = start[rows.start];
            for row in rows {
                let (from, to) = (start[row], start[row + 1]);
                let weights = &mut weights[from - offset..to - offset];
                weighing.weigh(owner(slot[row] as usize), &column[from..], weights);
            }
        });
    }

    /// The bonds whose other end lies in a slot that is kept, of all rows that have such bonds.
    fn of_columns(&self, is_kept: &[bool]) -> Rows {
        let mut kept = Rows {
            start: vec![0],
            ..Rows::default()
        };
        for (row, (&point, &slot)) in self.point.iter().zip(&self.slot).enumerate() {
            let columns = &self.column[self.start[row]..self.start[row + 1]];
            let columns = columns.iter().filter(|c| is_kept[**c as usize]);
            kept.column.extend(columns);
            if kept.start.last() != Some(&kept.column.len()) {
                kept.point.push(point);
                kept.slot.push(slot);
                kept.start.push(kept.column.len());
            }
        }
        kept.weight = vec![0.0; kept.column.len() + ROW_LANES];
        // the last row is read a few lanes further
        kept.column.extend([0; ROW_LANES]);
        kept
    }
}
