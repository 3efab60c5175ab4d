//! Families that follow their points: neighbours, images and weights change as points move.
//!
//! Rows hold all members within the horizon and a skin; members in the skin have weight zero. Rows stay as they are
//! until a point has moved by half the skin. Then [`Family::rebuild_rows`] finds new rows and puts slots and rows in
//! the order in which the points lie in space, so that neighbours stay close together in memory however much the
//! points mix. [`Family::update_weights`] moves the images behind faces with their points and computes the weights; it is
//! called for every new configuration. The [`World`](crate::World) owns the families of moving bodies and calls both.

use nalgebra::Vector3;
use rayon::prelude::*;

use crate::body::{Body, spatial_order};
use crate::cell_list::CellList;
use crate::neighbours::{self, Reaching};

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

/// Width of the skin of families of a body, m.
pub(crate) fn skin(body: &Body) -> f64 {
    SKIN * body.finest_spacing()
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
    /// The body with current positions and volumes, by slot.
    body: Body,
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
        check(body, spec)?;
        let spacings = &body.points.spacing;
        let following = Following {
            body: body.clone(),
            spacing_of_point: spacings.clone(),
            horizon: spacings.iter().map(|s| spec.horizon.of(*s)).collect(),
            skin: skin(body),
            list: CellList::default(),
            unit_moment: spec.moment(body, 1.0),
            volume: Vec::new(),
            spacing: Vec::new(),
        };
        let rows = CloudRows::new(body, Rows::default());
        let store = Store::Moving(rows, Box::new(following));
        let mut family = Family::of_rows(body, spec, store, PointSlots::sorted(Vec::new()));
        family.rebuild_rows(&body.points.position);
        family.weigh(&body.points.volume);
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
    /// When the family does not move, or for another number of points.
    pub fn rebuild_rows(&mut self, positions: &[Vector3<f64>]) {
        let Store::Moving(cloud, following) = &mut self.store else {
            panic!("the family does not move");
        };
        let order = spatial_order(positions, &following.spacing_of_point);
        self.slots.points = PointSlots::sorted(order.clone());
        let mut images =
            following.find_rows(&self.spec, &self.slots.points, positions, &mut cloud.rows);
        cloud.rows.point.clone_from(&order);
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
            by_slot.clone_from(own);
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
    /// Finds the rows of points in their slots at these positions (m), and their images.
    fn find_rows(
        &mut self,
        spec: &FamilySpec,
        points: &PointSlots,
        positions: &[Vector3<f64>],
        rows: &mut Rows,
    ) -> Images {
        let Following {
            body,
            spacing_of_point,
            horizon,
            skin,
            list,
            ..
        } = self;
        points.arrange(positions, &mut body.points.position);
        points.arrange(spacing_of_point, &mut body.points.spacing);
        let spacings = horizon.iter_mut().zip(&body.points.spacing);
        spacings.for_each(|(h, s)| *h = spec.horizon.of(*s));
        let coarsest = body.coarsest_spacing();
        let reach = horizon.iter().map(|h| spec.reach(*h, coarsest) + *skin);
        let reach: Vec<f64> = reach.collect();
        let widest = reach.iter().copied().fold(0.0, f64::max);
        let numbers: Vec<u32> = (0..body.points.len() as u32).collect();
        let images = Images::new(Share::whole(body, &numbers), spec, widest);
        let reaches: Vec<f64> = images.point.iter().map(|&p| reach[p as usize]).collect();
        let owners = Reaching {
            positions: &body.points.position,
            reach: &reach,
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
        slot.extend(0..reach.len() as u32);
        column.clear();
        column.reserve(near.iter().map(Vec::len).sum::<usize>() + ROW_LANES);
        start.clear();
        start.push(0);
        for row in near {
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
        tasks.into_par_iter().for_each(|(rows, weights)| {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::Cut;
    use crate::body::{Face, Jitter};
    use crate::family::{Bond, BondKernel, Mirrored, SlotField};
    use crate::shape::{BoxShape, Shape};

    struct Pull;

    impl BondKernel<1, 3> for Pull {
        #[inline(always)]
        fn bond(&self, bond: &Bond, [own]: [f64; 1], [other]: [f64; 1]) -> [f64; 3] {
            bond.xi.map(|xi| bond.weight * xi * (other - own))
        }
    }

    #[test]
    fn the_order_of_the_points_does_not_matter() {
        let shape = Shape::Box(BoxShape {
            min: [0.0; 3],
            max: [0.8, 0.6, 0.5],
        });
        let body = Body::fill("block", &shape, 3, 0.1, 0.5).expect("valid");
        let body = body.jittered(Jitter {
            amplitude: 0.3,
            seed: 5,
        });
        let mut body = body.expect("valid");
        let spec = FamilySpec {
            layers: vec![Face::XMin, Face::ZMax],
            correction: Correction::None,
            ..FamilySpec::new(0.25)
        };
        let sums = |body: &Body| {
            let mut family = Family::moving(body, &spec).expect("valid");
            // with the old rows, then with new ones
            let mut all = Vec::new();
            for (way, is_near) in [(0.01, true), (0.2, false)] {
                let moved = body.points.position.iter();
                let moved: Vec<_> = moved.map(|x| x + Vector3::x() * way * x.y).collect();
                if !is_near {
                    family.rebuild_rows(&moved);
                }
                family.update_weights(&moved, &body.points.volume);
                let values: Vec<f64> = moved.iter().map(|x| (x.x * x.y).exp() + x.z).collect();
                let mut slots = SlotField::default();
                slots.load(&family, &values[..], Mirrored::Scalar);
                let mut sums = vec![[0.0; 3]; values.len()];
                family.sum(&Pull, [&slots], &mut sums);
                let bonds = (0..values.len()).map(|p| family.bonds_of(p) as f64);
                let slots = (0..values.len()).map(|p| slots[family.slot_of(p)]);
                let rest = bonds
                    .zip(slots)
                    .zip(&values)
                    .map(|((b, s), v)| [b, s - v, 0.0]);
                all.push(sums.iter().copied().zip(rest).collect::<Vec<_>>());
            }
            all
        };
        let expected = sums(&body);
        let points = body.points.len();
        // 7 and the number of points have no common divisor
        let order: Vec<usize> = (0..points).map(|i| 7 * i % points).collect();
        let (position, volume) = (body.points.position.clone(), body.points.volume.clone());
        for (at, &from) in order.iter().enumerate() {
            body.points.position[at] = position[from];
            body.points.volume[at] = volume[from];
        }
        for (found, expected) in sums(&body).iter().zip(&expected) {
            for (found, from) in found.iter().zip(&order) {
                let (sum, rest) = expected[*from];
                assert_eq!(found.1, rest);
                assert_eq!(rest[1], 0.0, "a slot holds its point");
                assert!((0..3).all(|a| (found.0[a] - sum[a]).abs() < 1e-12));
            }
        }
    }

    #[test]
    fn a_point_far_outside_of_its_box_is_no_panic() {
        let shape = Shape::Box(BoxShape {
            min: [0.0; 3],
            max: [0.8, 0.6, 0.1],
        });
        let mut body = Body::fill("block", &shape, 2, 0.1, 0.5).expect("valid");
        body.periodic = [true, false, false];
        let spec = FamilySpec {
            layers: vec![Face::YMin, Face::YMax],
            correction: Correction::None,
            ..FamilySpec::new(0.25)
        };
        let mut family = Family::moving(&body, &spec).expect("valid");
        let mut positions = body.points.position.clone();
        // only its second periodic copy lies near the box
        positions[0].x = 2.5 * 0.8;
        family.rebuild_rows(&positions);
        assert!(family.slots() > body.points.len());
    }

    #[test]
    fn what_a_moving_family_does_not_support_is_refused() {
        let shape = Shape::Box(BoxShape {
            min: [0.0; 3],
            max: [0.8, 0.6, 0.1],
        });
        let body = Body::fill("block", &shape, 2, 0.1, 0.5).expect("valid");
        let plain = FamilySpec {
            correction: Correction::None,
            ..FamilySpec::new(0.25)
        };
        Family::moving(&body, &plain).expect("supported");
        let corrected = FamilySpec::new(0.25);
        let error = Family::moving(&body, &corrected).expect_err("corrected");
        assert!(error.to_string().contains("correction"), "{error}");
        let mut cut = body.clone();
        let line = Cut::segment([0.4, 0.0], [0.4, 0.6]).expect("it has a length");
        cut.cuts.push(line);
        let error = Family::moving(&cut, &plain).expect_err("cut");
        assert!(error.to_string().contains("crack"), "{error}");
    }
}
