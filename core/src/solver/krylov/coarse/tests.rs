use nalgebra::Vector3;

use super::*;
use crate::solver::{Hints, Krylov, KrylovMethod, KrylovOptions, NullSpace, Reducer};

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
                    stiffness: Spring::axial(
                        if soft { softness } else { 1.0 },
                        step.map(|s| s as f64 / length),
                        0.0,
                    ),
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
                let stiffness = nalgebra::Matrix3::from(spring.stiffness).transpose();
                force += stiffness * (at(point) - at(spring.to));
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
        let points = Reducer::alone(self.position.len());
        let grid = CoarseGrid::new(&self.position, 3, self.free.clone(), &points, springs);
        let grid = grid.expect("a long beam has many patches");
        let space = CoarseSpace::new(Arc::new(grid), 1.0, &points, springs).expect("positive");
        let modes = |m: usize| -> Vec<f64> {
            let axis = Vector3::ith_axis(m % 3).into_inner();
            let motion = |x: &Vector3<f64>| if m < 3 { axis } else { axis.cross(x) };
            self.position
                .iter()
                .flat_map(|x| <[f64; 3]>::from(motion(x)))
                .collect()
        };
        let null_space = NullSpace::new(
            (0..if free { 6 } else { 0 }).map(modes).collect(),
            &Reducer::default(),
        );
        let diagonal = |i: usize| {
            let springs = self.springs[i / 3].iter();
            let sum: f64 = springs.map(|s| s.stiffness[i % 3][i % 3]).sum();
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
                &Reducer::default(),
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
    let points = Reducer::alone(beam.position.len());
    assert!(CoarseGrid::new(&beam.position, 3, beam.free, &points, none).is_none());
}
