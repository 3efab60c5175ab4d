//! Families that follow their points: neighbours, images and weights change as points move.
//!
//! Rows hold all members within the horizon and a skin; those beyond the horizon have no weight. So rows stay
//! as they are until a point has moved by half the skin ([`Family::follow`]).

use nalgebra::Vector3;
use rayon::prelude::*;

use crate::body::Body;
use crate::cell_list::CellList;

use super::images::Images;
use super::kernel::{ROW_LANES, Weighing};
use super::{Family, FamilyError, FamilySpec, Rows, TIE};

/// Width of the skin, in spacings of the finest points.
const SKIN: f64 = 0.5;

/// Rows that a thread weighs at once.
const SHARE: usize = 512;

/// What a family needs to follow its points.
#[derive(Debug)]
pub(super) struct Following {
    /// With positions and volumes as they are now.
    body: Body,
    horizon: Vec<f64>,
    skin: f64,
    /// Positions at which the rows were found, m.
    found_at: Vec<Vector3<f64>>,
    list: CellList,
    /// Of a family of horizon 1 m; it grows as a power of the horizon.
    unit_moment: f64,
    /// Of each slot, m³.
    volume: Vec<f64>,
    /// Of each slot, m.
    spacing: Vec<f64>,
}

impl Family {
    /// A family of the points of `body`, by position whatever their store, that can
    /// [`follow`](Family::follow) them. Weights are not corrected, and cuts have no part in it.
    ///
    /// # Errors
    /// As [`Family::build`].
    pub fn moving(body: &Body, spec: &FamilySpec) -> Result<Family, FamilyError> {
        let spacings = &body.points.spacing;
        let horizon: Vec<f64> = spacings.iter().map(|s| spec.horizon.of(*s)).collect();
        if let Some(i) = (0..horizon.len()).find(|&i| horizon[i] < spacings[i] * (1.0 - TIE)) {
            return Err(FamilyError::HorizonTooSmall {
                horizon: horizon[i],
                spacing: spacings[i],
            });
        }
        let mut family = Family::of_rows(body, spec, (Rows::default(), Rows::joined(&[])));
        family.following = Some(Box::new(Following {
            body: body.clone(),
            horizon,
            skin: SKIN * body.finest_spacing(),
            found_at: Vec::new(),
            list: CellList::default(),
            unit_moment: spec.moment(body, 1.0),
            volume: Vec::new(),
            spacing: Vec::new(),
        }));
        family.find_rows();
        family.weigh();
        Ok(family)
    }

    /// Lets points be where they are now (m), with the volumes (m³) that they have now. Slots change with
    /// the images behind faces, so that [`Family::slots`] must be asked again.
    ///
    /// # Panics
    /// When the family does not move, or for another number of points.
    pub fn follow(&mut self, positions: &[Vector3<f64>], volumes: &[f64]) {
        let following = self.following.as_mut().expect("a moving family");
        following.body.points.position.copy_from_slice(positions);
        following.body.points.volume.copy_from_slice(volumes);
        let moved = positions.par_iter().zip(&following.found_at);
        let moved = moved.map(|(x, before)| (x - before).norm_squared());
        let farthest = moved.reduce(|| 0.0, f64::max);
        if 4.0 * farthest > following.skin * following.skin {
            self.find_rows();
        } else {
            self.place_images();
        }
        self.weigh();
    }

    /// Positions at which the neighbours were last looked for (m): with [`Family::look_from`] a restart comes to the
    /// same bits.
    pub fn looked_from(&self) -> &[Vector3<f64>] {
        let following = self.following.as_ref().expect("a moving family");
        &following.found_at
    }

    /// Looks for neighbours at these positions (m).
    ///
    /// # Panics
    /// As [`Family::follow`].
    pub fn look_from(&mut self, positions: &[Vector3<f64>]) {
        let following = self.following.as_mut().expect("a moving family");
        following.body.points.position.copy_from_slice(positions);
        self.find_rows();
    }

    fn find_rows(&mut self) {
        let following = self.following.as_mut().expect("a moving family");
        let Following {
            body,
            horizon,
            skin,
            found_at,
            list,
            ..
        } = &mut **following;
        found_at.clone_from(&body.points.position);
        let coarsest = body.coarsest_spacing();
        let reach = horizon
            .iter()
            .map(|h| self.spec.reach(*h, coarsest) + *skin);
        let reach: Vec<f64> = reach.collect();
        let widest = reach.iter().copied().fold(0.0, f64::max);
        let images = Images::new(body, &self.spec, widest);
        let reaches: Vec<f64> = images.point.iter().map(|&p| reach[p as usize]).collect();
        list.update(&images.position, &reaches);
        let near = |point: usize| {
            let (here, reach) = (images.position[point], reach[point]);
            let mut row = Vec::with_capacity(64);
            list.visit_near(&here, reach, |slot| {
                if slot != point && (images.position[slot] - here).norm_squared() <= reach * reach {
                    row.push(slot as u32);
                }
            });
            row.sort_unstable();
            row
        };
        let rows: Vec<Vec<u32>> = (0..self.points).into_par_iter().map(near).collect();
        let bonds: usize = rows.iter().map(Vec::len).sum();
        let Rows {
            point,
            slot,
            start,
            column,
            weight,
            ..
        } = &mut self.rows;
        point.clear();
        point.extend(0..self.points as u32);
        slot.clone_from(point);
        column.clear();
        column.reserve(bonds + ROW_LANES);
        start.clear();
        start.push(0);
        for row in rows {
            column.extend(row);
            start.push(column.len());
        }
        // the last row is read a few lanes further
        column.extend([0; ROW_LANES]);
        weight.clear();
        weight.resize(column.len(), 0.0);
        self.take_images(images);
    }

    /// Moves the images with their points.
    fn place_images(&mut self) {
        let following = self.following.as_ref().expect("a moving family");
        let body = &following.body;
        for (axis, places) in self.places.iter_mut().enumerate() {
            let points = places.iter_mut().zip(&body.points.position);
            points.for_each(|(place, x)| *place = x[axis]);
        }
        for (face, range) in &self.layers {
            let axis = face.axis();
            let (position, extent) = (body.face_position(*face), body.extent(axis));
            for ghost in &self.ghosts[range.clone()] {
                let (slot, source) = (ghost.slot as usize, ghost.source as usize);
                for (a, places) in self.places.iter_mut().enumerate() {
                    places[slot] = match (a == axis, self.periodic[axis]) {
                        (false, _) => places[source],
                        (true, false) => 2.0 * position - places[source],
                        (true, true) if face.is_upper() => places[source] + extent,
                        (true, true) => places[source] - extent,
                    };
                }
            }
        }
    }

    /// Weights of all bonds from where their ends are.
    fn weigh(&mut self) {
        let following = self.following.as_mut().expect("a moving family");
        let Following {
            body,
            horizon,
            unit_moment,
            volume,
            spacing,
            ..
        } = &mut **following;
        let points = self.points;
        for (by_slot, by_point) in [
            (&mut *volume, &body.points.volume),
            (&mut *spacing, &body.points.spacing),
        ] {
            by_slot.clone_from(by_point);
            by_slot.extend(self.ghosts.iter().map(|g| by_point[g.point as usize]));
        }
        let weighing = Weighing::new(
            &self.spec,
            self.slots,
            (&self.places, self.flat),
            [volume, spacing],
        );
        let power = body.dimension as i32 + 1;
        let Rows {
            start,
            column,
            weight,
            ..
        } = &mut self.rows;
        let (mut shares, mut rest, mut done) = (Vec::new(), &mut weight[..], 0);
        for first in (0..points).step_by(SHARE) {
            let last = (first + SHARE).min(points);
            let (share, left) = rest.split_at_mut(start[last] - done);
            shares.push((first..last, share));
            (rest, done) = (left, start[last]);
        }
        shares.into_par_iter().for_each(|(rows, weights)| {
            let offset = start[rows.start];
            for point in rows {
                let (from, to) = (start[point], start[point + 1]);
                let moment = *unit_moment * horizon[point].powi(power);
                let weights = &mut weights[from - offset..to - offset];
                weighing.weigh((point, horizon[point], moment), &column[from..], weights);
            }
        });
    }
}
