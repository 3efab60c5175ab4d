//! A coarse space for networks of springs: patches of points that move as rigid bodies.
//!
//! What neighbours do to each other the diagonal of the stiffness knows; that far ends of a body pull
//! and bend each other takes conjugate gradients as many iterations as there are neighbourhoods between
//! them. Patches know it at once. Both together precondition a body whatever its size and slenderness,
//! and stiff parts beside soft ones: two-level additive Schwarz with aggregates, after Nicolaides (1987),
//! SIAM J. Numer. Anal. 24, 355-365, with rotations for elasticity.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Vector3};
use rayon::prelude::*;

/// Patches at most: their dense matrix has six rows for each.
const MOST_PATCHES: usize = 160;

/// Below this the diagonal does as well.
const LEAST_PATCHES: usize = 12;

/// Share by which the coarse matrix is stiffened along its diagonal: a free body has motions that
/// nothing resists.
const STIFFENING: f64 = 1e-8;

/// A spring from a point to another, or to a mirror image.
#[derive(Clone, Copy, Debug)]
pub struct Spring {
    /// Force over extension.
    pub stiffness: f64,
    /// Unit vector.
    pub along: [f64; 3],
    /// The point at the other end, or whose image is there.
    pub to: usize,
    /// Factors on its displacement: those of the image, or one.
    pub scale: [f64; 3],
}

/// Rigid motions of patches, and the inverse of the stiffness between them.
#[derive(Clone, Debug)]
pub struct CoarseSpace {
    points: Points,
    inverse: Cholesky<f64, Dyn>,
}

/// Points in their patches.
#[derive(Clone, Debug)]
struct Points {
    /// Those of the motions (three translations, three rotations) that the dimension has.
    motions: &'static [usize],
    patch: Vec<u32>,
    /// From the centre of the patch, in sizes of patches.
    arm: Vec<Vector3<f64>>,
    /// One or, for held components, zero.
    free: Vec<[f64; 3]>,
    /// Points by patch.
    members: Vec<Vec<u32>>,
}

impl CoarseSpace {
    /// The space for points at `position` (m) with the `springs` of each, whose stiffness is that of the
    /// system to be solved; patches are `size` (m) wide or wider. `free` holds zero for held components.
    /// `None` for bodies of few patches.
    pub fn new(
        position: &[Vector3<f64>],
        dimension: usize,
        size: f64,
        free: Vec<[f64; 3]>,
        springs: impl Fn(usize, &mut dyn FnMut(Spring)) + Sync,
    ) -> Option<Self> {
        let points = Points::new(position, dimension, size, free)?;
        let motions = points.motions.len();
        let rows = motions * points.members.len();
        let mut matrix = vec![0.0; rows * rows];
        let patches = matrix.par_chunks_mut(motions * rows).enumerate();
        patches.for_each(|(patch, stripe)| {
            for &point in &points.members[patch] {
                springs(point as usize, &mut |spring| {
                    points.add(stripe, (patch, point as usize), spring);
                });
            }
        });
        for diagonal in matrix.iter_mut().step_by(rows + 1) {
            *diagonal *= 1.0 + STIFFENING;
            if *diagonal == 0.0 {
                *diagonal = 1.0;
            }
        }
        let inverse = Cholesky::new(DMatrix::from_vec(rows, rows, matrix))?;
        Some(CoarseSpace { points, inverse })
    }

    /// Adds the coarse displacement under `residual` to `out`, three components for each point.
    pub(super) fn add_correction(&self, residual: &[f64], out: &mut [f64]) {
        let points = &self.points;
        let (forces, _) = residual.as_chunks::<3>();
        let motions = points.motions.len();
        let mut coarse = DVector::zeros(motions * points.members.len());
        let patches = coarse.as_mut_slice().par_chunks_mut(motions);
        patches.zip(&points.members).for_each(|(sums, members)| {
            for &point in members {
                let parts = points.along_motions(point as usize, &forces[point as usize]);
                let motions = points.motions.iter();
                sums.iter_mut()
                    .zip(motions)
                    .for_each(|(sum, m)| *sum += parts[*m]);
            }
        });
        self.inverse.solve_mut(&mut coarse);
        let (vectors, _) = out.as_chunks_mut::<3>();
        vectors.par_iter_mut().enumerate().for_each(|(point, out)| {
            let mut motion = [0.0; 6];
            let values = &coarse.as_slice()[motions * points.patch[point] as usize..][..motions];
            for (m, value) in points.motions.iter().zip(values) {
                motion[*m] = *value;
            }
            let [x, y, z, about_x, about_y, about_z] = motion;
            let turn = Vector3::new(about_x, about_y, about_z).cross(&points.arm[point]);
            let moved = turn + Vector3::new(x, y, z);
            (0..3).for_each(|axis| out[axis] += points.free[point][axis] * moved[axis]);
        });
    }
}

impl Points {
    fn new(
        position: &[Vector3<f64>],
        dimension: usize,
        mut size: f64,
        free: Vec<[f64; 3]>,
    ) -> Option<Self> {
        let first = *position.first()?;
        let (low, high) = position
            .iter()
            .fold((first, first), |(low, high), x| (low.inf(x), high.sup(x)));
        let extent = high - low;
        let along = |size: f64| -> [usize; 3] {
            std::array::from_fn(|axis| match axis < dimension {
                true => (extent[axis] / size).round().max(1.0) as usize,
                false => 1,
            })
        };
        while along(size).iter().product::<usize>() > MOST_PATCHES {
            size *= 1.05;
        }
        let count = along(size);
        let mut members = vec![Vec::new(); count.iter().product()];
        for (point, x) in position.iter().enumerate() {
            let cell: [usize; 3] = std::array::from_fn(|axis| {
                let share = (x[axis] - low[axis]) / extent[axis].max(f64::MIN_POSITIVE);
                ((share * count[axis] as f64) as usize).min(count[axis] - 1)
            });
            members[(cell[2] * count[1] + cell[1]) * count[0] + cell[0]].push(point as u32);
        }
        members.retain(|m| !m.is_empty());
        if members.len() < LEAST_PATCHES {
            return None;
        }
        let mut patch = vec![0; position.len()];
        let mut arm = vec![Vector3::zeros(); position.len()];
        for (number, members) in members.iter().enumerate() {
            let of = members.iter().map(|p| &position[*p as usize]);
            let centre = of.sum::<Vector3<f64>>() / members.len() as f64;
            for &point in members {
                patch[point as usize] = number as u32;
                arm[point as usize] = (position[point as usize] - centre) / size;
            }
        }
        Some(Points {
            motions: match dimension {
                1 => &[0],
                2 => &[0, 1, 5],
                _ => &[0, 1, 2, 3, 4, 5],
            },
            patch,
            arm,
            free,
            members,
        })
    }

    /// The work of a force at a point along each motion of its patch.
    fn along_motions(&self, point: usize, force: &[f64; 3]) -> [f64; 6] {
        let free = &self.free[point];
        let force = Vector3::from_fn(|axis, _| free[axis] * force[axis]);
        let moment = self.arm[point].cross(&force);
        [force.x, force.y, force.z, moment.x, moment.y, moment.z]
    }

    /// Adds a spring of a point to the rows of its patch.
    fn add(&self, rows: &mut [f64], (patch, point): (usize, usize), spring: Spring) {
        let other = spring.to;
        let whole = |point: usize| self.free[point] == [1.0; 3];
        let within = self.patch[other] as usize == patch && spring.scale == [1.0; 3];
        if within && whole(point) && whole(other) {
            return;
        }
        let motions = self.motions.len();
        let row = motions * self.members.len();
        let own = self.along_motions(point, &spring.along);
        let mut add = |patch: usize, factor: f64, end: [f64; 6]| {
            for (r, m) in self.motions.iter().enumerate() {
                for (c, n) in self.motions.iter().enumerate() {
                    rows[r * row + patch * motions + c] += factor * own[*m] * end[*n];
                }
            }
        };
        add(patch, spring.stiffness, own);
        let along = std::array::from_fn(|axis| spring.scale[axis] * spring.along[axis]);
        let end = self.along_motions(other, &along);
        add(self.patch[other] as usize, -spring.stiffness, end);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solver::{Hints, Krylov, KrylovMethod, KrylovOptions, NullSpace};

    /// Points of a lattice, each with springs to the 26 around it; the first half of those softer.
    struct Beam {
        position: Vec<Vector3<f64>>,
        springs: Vec<Vec<Spring>>,
        free: Vec<[f64; 3]>,
    }

    impl Beam {
        fn new(cells: [i64; 3], softness: f64, is_held: impl Fn(&Vector3<f64>) -> bool) -> Self {
            let all = (0..cells[2]).flat_map(|k| {
                let plane = (0..cells[1]).flat_map(move |j| (0..cells[0]).map(move |i| [i, j, k]));
                plane.collect::<Vec<_>>()
            });
            let cell: Vec<[i64; 3]> = all.collect();
            let number = |c: [i64; 3]| {
                let inside = (0..3).all(|a| (0..cells[a]).contains(&c[a]));
                inside.then(|| ((c[2] * cells[1] + c[1]) * cells[0] + c[0]) as usize)
            };
            let springs = cell.iter().map(|c| {
                let around = (0..27).filter(|s| *s != 13);
                let ends = around.filter_map(|s| {
                    let step = [s % 3 - 1, s / 3 % 3 - 1, s / 9 - 1];
                    let other = std::array::from_fn(|a| c[a] + step[a]);
                    let length = step.map(|s| (s * s) as f64).iter().sum::<f64>().sqrt();
                    let soft = 2 * c[0] < cells[0] && 2 * other[0] < cells[0];
                    Some(Spring {
                        stiffness: if soft { softness } else { 1.0 },
                        along: step.map(|s| s as f64 / length),
                        to: number(other)?,
                        scale: [1.0; 3],
                    })
                });
                ends.collect()
            });
            let position: Vec<Vector3<f64>> = cell
                .iter()
                .map(|c| Vector3::from(c.map(|c| c as f64)))
                .collect();
            Beam {
                springs: springs.collect(),
                free: position
                    .iter()
                    .map(|x| [if is_held(x) { 0.0 } else { 1.0 }; 3])
                    .collect(),
                position,
            }
        }

        fn apply(&self, u: &[f64], out: &mut [f64]) {
            let at = |point: usize| Vector3::from_column_slice(&u[3 * point..3 * point + 3]);
            for point in 0..self.position.len() {
                let mut force = Vector3::zeros();
                for spring in &self.springs[point] {
                    let along = Vector3::from(spring.along);
                    let change = at(point) - at(spring.to);
                    force += spring.stiffness * along.dot(&change) * along;
                }
                for axis in 0..3 {
                    let free = self.free[point][axis];
                    out[3 * point + axis] = free * force[axis] + (1.0 - free) * u[3 * point + axis];
                }
            }
        }

        fn solve(&self, load: &[f64], coarse: bool, free: bool) -> (usize, Vec<f64>) {
            let springs = |point: usize, receive: &mut dyn FnMut(Spring)| {
                self.springs[point].iter().for_each(|s| receive(*s));
            };
            let space = CoarseSpace::new(&self.position, 3, 3.0, self.free.clone(), springs)
                .expect("a long beam has many patches");
            let modes = |m: usize| -> Vec<f64> {
                let axis = Vector3::ith_axis(m % 3).into_inner();
                let motion = |x: &Vector3<f64>| if m < 3 { axis } else { axis.cross(x) };
                self.position
                    .iter()
                    .flat_map(|x| <[f64; 3]>::from(motion(x)))
                    .collect()
            };
            let null_space = NullSpace::new((0..if free { 6 } else { 0 }).map(modes).collect());
            let diagonal = |i: usize| {
                let springs = self.springs[i / 3].iter();
                let sum: f64 = springs.map(|s| s.stiffness * s.along[i % 3].powi(2)).sum();
                if self.free[i / 3][i % 3] == 0.0 {
                    1.0
                } else {
                    sum
                }
            };
            let diagonal: Vec<f64> = (0..load.len()).map(diagonal).collect();
            let options = KrylovOptions {
                relative_tolerance: 1e-9,
                ..KrylovOptions::default()
            };
            let mut solution = vec![0.0; load.len()];
            let hints = Hints {
                diagonal: Some(&diagonal),
                null_space: Some(&null_space),
                coarse: coarse.then_some(&space),
            };
            let report = Krylov::new(KrylovMethod::ConjugateGradient, options)
                .solve(
                    |u, out| {
                        self.apply(u, out);
                        Ok(())
                    },
                    load,
                    &mut solution,
                    hints,
                )
                .unwrap();
            (report.iterations, solution)
        }
    }

    fn tip_load(beam: &Beam, balanced: bool) -> Vec<f64> {
        let last = beam.position.len() - 1;
        let mut load = vec![0.0; 3 * beam.position.len()];
        load[3 * last + 2] = 1.0;
        if balanced {
            load[2] = 0.5;
            load[3 * (last / 2) + 2] = -1.5;
        }
        load
    }

    #[test]
    fn a_slender_beam_takes_far_fewer_iterations_and_bends_the_same() {
        for softness in [1.0, 1e-3] {
            let beam = Beam::new([60, 3, 3], softness, |x| x.x < 0.5);
            let load = tip_load(&beam, false);
            let (without, expected) = beam.solve(&load, false, false);
            let (with, bent) = beam.solve(&load, true, false);
            assert!(5 * with < without, "{with} against {without}");
            let size = expected.iter().fold(0.0f64, |s, u| s.max(u.abs()));
            let differ = bent.iter().zip(&expected).map(|(a, b)| (a - b).abs());
            assert!(differ.fold(0.0, f64::max) < 1e-4 * size);
        }
    }

    #[test]
    fn a_free_beam_keeps_out_of_its_rigid_motions() {
        let beam = Beam::new([60, 3, 3], 1.0, |_| false);
        let mut load = tip_load(&beam, true);
        let (without, _) = beam.solve(&load, false, true);
        let (with, bent) = beam.solve(&load, true, true);
        assert!(5 * with < without, "{with} against {without}");
        beam.apply(&bent.clone(), &mut load);
        assert!(bent.iter().step_by(3).sum::<f64>().abs() < 1e-6);
    }

    #[test]
    fn a_compact_body_has_no_coarse_space() {
        let beam = Beam::new([4, 4, 4], 1.0, |_| false);
        let none = |_: usize, _: &mut dyn FnMut(Spring)| {};
        assert!(CoarseSpace::new(&beam.position, 3, 3.0, beam.free, none).is_none());
    }
}
