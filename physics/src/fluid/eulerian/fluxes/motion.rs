//! Points that follow the walls: the mapped sums, the bonds to walls, and the volumes.

use nalgebra::Vector3;
use perimelt_core::SlotField;
use perimelt_core::family::Mirrored;

use super::Fluxes;
use super::kernels::{In, MappedPush, Outflow};
#[cfg(test)]
use super::{OUTFLOW_2D, OUTFLOW_3D};

impl Fluxes {
    /// A gradient (of x) at a point as one of the lattice.
    pub(super) fn on_lattice(&self, point: usize, gradient: Vector3<f64>) -> Vector3<f64> {
        match &self.motion {
            Some(motion) => motion.points()[point].gradient.tr_mul(&gradient),
            None => gradient,
        }
    }

    /// A gradient (of x) at a point as one of the bonds to walls, which have the cofactors in their vectors.
    pub(super) fn on_bonds(&self, point: usize, gradient: Vector3<f64>) -> Vector3<f64> {
        match &self.motion {
            Some(motion) => {
                let mapped = &motion.points()[point];
                let stretch = mapped.gradient * mapped.gradient.transpose();
                stretch * gradient / mapped.gradient.determinant()
            }
            None => gradient,
        }
    }

    /// Finds the rates at which points that move and walls change the volumes.
    pub(super) fn find_swept<const D: usize, const I: usize>(&mut self) {
        self.swept.fill([0.0]);
        if let Some(motion) = &self.motion {
            let mut slots: [SlotField; D] = std::array::from_fn(|_| SlotField::default());
            for (axis, slots) in slots.iter_mut().enumerate() {
                let along = |point: usize| {
                    let mapped = &motion.points()[point];
                    mapped.cofactors.column(axis).dot(&mapped.velocity)
                };
                slots.load(&self.family, along, Mirrored::Vector(axis));
            }
            let inputs: [&[f64]; I] = std::array::from_fn(|i| &slots[i.min(D - 1)][..]);
            let kernel = In::<D, _>(Outflow {
                inverse: self.inverse(),
                diffusion: 0.0,
            });
            self.family.sum(&kernel, inputs, &mut self.swept);
        }
        let swept = &mut self.swept;
        let inverse = 1.0 / self.complete.moment;
        self.walls
            .for_each_swept(inverse, |point, rate| swept[point][0] += rate);
    }

    /// Sums [`MappedPush`] over these inputs.
    pub(super) fn push_by<const D: usize>(&self, rows: &[SlotField], sums: &mut [[f64; D]]) {
        let inverse = self.inverse();
        match D {
            2 => {
                let inputs: [&[f64]; 4] = std::array::from_fn(|n| &rows[n][..]);
                self.family.sum(&MappedPush { inverse }, inputs, sums);
            }
            _ => {
                let inputs: [&[f64]; 9] = std::array::from_fn(|n| &rows[n][..]);
                self.family.sum(&MappedPush { inverse }, inputs, sums);
            }
        }
    }

    /// Lets points follow the walls in a step of `dt` (s).
    pub(super) fn move_points(&mut self, dt: f64) {
        let Some(motion) = &mut self.motion else {
            return;
        };
        let displaced = self.walls.displacements();
        motion.follow(&self.family, &displaced, dt);
        self.map_walls();
    }

    /// Displaces the points by this much at each place (m) in a step of `dt` (s).
    #[cfg(test)]
    pub(crate) fn displace_points(
        &mut self,
        family: &perimelt_core::Family,
        dt: f64,
        by: impl Fn(&Vector3<f64>) -> Vector3<f64>,
    ) {
        if let Some(motion) = &mut self.motion {
            motion.displace(family, dt, by);
        }
        match self.dimension {
            2 => self.find_swept::<2, OUTFLOW_2D>(),
            _ => self.find_swept::<3, OUTFLOW_3D>(),
        }
    }

    /// Maps the bonds to walls as the points are now.
    pub(super) fn map_walls(&mut self) {
        let points = self.points();
        let mut rows = std::mem::take(&mut self.push);
        rows.resize(points * self.dimension, 0.0);
        if let Some(motion) = &self.motion {
            match self.dimension {
                2 => self.push_by::<2>(&motion.cofactors, rows.as_chunks_mut().0),
                _ => self.push_by::<3>(&motion.cofactors, rows.as_chunks_mut().0),
            }
            let (d, moment) = (self.dimension, self.complete.moment);
            let open = |i: usize| {
                let row = &rows[i * d..(i + 1) * d];
                Vector3::from_fn(|a, _| row.get(a).map_or(0.0, |sum| -0.5 * moment * sum))
            };
            let cofactors = |i: usize| motion.points()[i].cofactors;
            self.walls.map_bonds(points, cofactors, open);
            self.walls
                .displace_relative(|place| motion.displacement_at(place));
        }
        self.push = rows;
    }
}
