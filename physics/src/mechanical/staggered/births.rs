//! Motion of corners that get material.

use nalgebra::{Matrix3, Vector3};
use perimelt_core::family::LayerRule;
use perimelt_core::solver::Reducer;

use super::Corners;
use crate::mechanical::growth::continued_part;
use crate::mechanical::nodes::{CornerMotion, Held};

/// Material that is born.
#[derive(Clone, Copy, Debug)]
pub(in crate::mechanical) struct Births<'a> {
    /// Whether each point had material before.
    pub(in crate::mechanical) was_present: &'a [bool],
    /// Whether it has material now.
    pub(in crate::mechanical) present: &'a [bool],
    /// Gradient of the displacement of each point before.
    pub(in crate::mechanical) gradients: &'a [Matrix3<f64>],
    /// Layers behind faces, which hold the corners in them.
    pub(in crate::mechanical) rules: &'a [LayerRule],
}

/// A corner whose displacement is known, with the gradient by which it is continued.
#[derive(Clone, Copy, Debug, Default)]
struct Known {
    displacement: Vector3<f64>,
    gradient: Matrix3<f64>,
    velocity: Vector3<f64>,
}

impl Known {
    /// Replaces what is known of corners by what their owners know. Collective.
    fn bring(corners: &Reducer, all: &mut [Option<Known>]) {
        const NUMBERS: usize = 16;
        if corners.processes().size() == 1 {
            return;
        }
        let mut numbers = vec![[0.0; NUMBERS]; all.len()];
        for (numbers, known) in numbers.iter_mut().zip(&*all) {
            if let Some(known) = known {
                numbers[0] = 1.0;
                numbers[1..4].copy_from_slice(known.displacement.as_slice());
                numbers[4..13].copy_from_slice(known.gradient.as_slice());
                numbers[13..].copy_from_slice(known.velocity.as_slice());
            }
        }
        corners.bring(numbers.as_flattened_mut());
        for (known, numbers) in all.iter_mut().zip(&numbers) {
            *known = (numbers[0] > 0.0).then(|| Known {
                displacement: Vector3::from_column_slice(&numbers[1..4]),
                gradient: Matrix3::from_column_slice(&numbers[4..13]),
                velocity: Vector3::from_column_slice(&numbers[13..]),
            });
        }
    }
}

impl Corners {
    /// Sets the motion of corners of this process that have material now and had none before: it continues that of the corners with which
    /// they share a cell, next to the body first. Collective.
    pub(in crate::mechanical) fn place_born(&self, motion: &mut CornerMotion, births: Births<'_>) {
        let (nodes, _) = motion.displacement.as_chunks_mut::<3>();
        let (velocities, _) = motion.velocity.as_chunks_mut::<3>();
        let known = |corner: usize| {
            let velocity = velocities.get(corner).copied().unwrap_or_default();
            self.known(corner, [nodes[corner], velocity], births)
        };
        let corners = self.reducer();
        let mut known: Vec<Option<Known>> = (0..nodes.len()).map(known).collect();
        Known::bring(corners, &mut known);
        let is_waiting = |corner: &usize| {
            known[*corner].is_none() && self.around(*corner, births.present).next().is_some()
        };
        let born: Vec<usize> = (0..corners.owned()).filter(is_waiting).collect();
        let mut waiting = born.clone();
        while corners.any(!waiting.is_empty()) {
            let placed = waiting.iter();
            let placed: Vec<_> = placed
                .map(|&corner| self.continued(corner, &known, births.present))
                .collect();
            // where nothing is there to which the material is attached, it stays at rest
            let is_alone = !corners.any(placed.iter().any(Option::is_some));
            for (&corner, placed) in waiting.iter().zip(placed) {
                known[corner] = placed.or_else(|| is_alone.then(Known::default));
            }
            waiting.retain(|corner| known[*corner].is_none());
            Known::bring(corners, &mut known);
        }
        let held = self.held(Held::default(), births.rules, births.present);
        for corner in born {
            let placed = known[corner].unwrap_or_default();
            if let Some(velocity) = velocities.get_mut(corner) {
                *velocity = placed.velocity.into();
            }
            for (axis, u) in nodes[corner].iter_mut().enumerate() {
                let component = 3 * corner + axis;
                *u = match held.count[component] > 0.0 {
                    true => held.sum[component] / held.count[component],
                    false => placed.displacement[axis],
                };
            }
        }
    }

    /// A corner that had material before.
    fn known(
        &self,
        corner: usize,
        [displacement, velocity]: [[f64; 3]; 2],
        births: Births<'_>,
    ) -> Option<Known> {
        let around = || self.around(corner, births.was_present);
        let count = around().count();
        let gradients = around().map(|(_, point)| continued_part(&births.gradients[point]));
        (count > 0).then(|| Known {
            displacement: displacement.into(),
            velocity: velocity.into(),
            gradient: gradients.sum::<Matrix3<f64>>() / count as f64,
        })
    }

    /// Continues the displacement of the known corners of the cells around a corner to it.
    fn continued(&self, corner: usize, known: &[Option<Known>], present: &[bool]) -> Option<Known> {
        let (mut total, mut sum) = (0.0, Known::default());
        for (_, point) in self.around(corner, present) {
            for &other in self.of(point) {
                let Some(known) = known[other as usize] else {
                    continue;
                };
                let mut xi = self.position[corner] - self.position[other as usize];
                // across a periodic side
                let wrapped = xi.iter_mut().filter(|x| x.abs() > 1.5 * self.spacing);
                wrapped.for_each(|x| *x = -x.signum() * self.spacing);
                let weight = 1.0 / xi.norm_squared();
                sum.displacement += weight * (known.displacement + known.gradient * xi);
                sum.velocity += weight * known.velocity;
                sum.gradient += weight * known.gradient;
                total += weight;
            }
        }
        (total > 0.0).then(|| Known {
            displacement: sum.displacement / total,
            velocity: sum.velocity / total,
            gradient: sum.gradient / total,
        })
    }
}
