//! Krylov methods on chains, rings and diagonals with known answers.

use super::*;
use crate::parallel::ParallelLoop;
use crate::solver::reduce::sum;
use rayon::prelude::*;

const ALL: [KrylovMethod; 3] = [
    KrylovMethod::ConjugateGradient,
    KrylovMethod::BiCgStab,
    KrylovMethod::Gmres,
];

type Outcome = Result<(), SolverError>;

/// `-y_(i-1) + (2 + shift) y_i - (1 + wind) y_(i+1)` with zero beyond the ends.
fn chain(shift: f64, wind: f64) -> impl Fn(&[f64], &mut [f64]) -> Outcome + Sync + Copy {
    move |x, out| {
        out.par_iter_mut().enumerate().for_all(|(i, out)| {
            let left = if i == 0 { 0.0 } else { x[i - 1] };
            let right = x.get(i + 1).copied().unwrap_or(0.0);
            *out = (2.0 + shift) * x[i] - left - (1.0 + wind) * right;
        });
        Ok(())
    }
}

fn ring(x: &[f64], out: &mut [f64]) -> Outcome {
    let n = x.len();
    for i in 0..n {
        out[i] = 2.0 * x[i] - x[(i + 1) % n] - x[(i + n - 1) % n];
    }
    Ok(())
}

fn solver(method: KrylovMethod) -> Krylov {
    Krylov::new(method, KrylovOptions::default())
}

#[test]
fn all_methods_recover_a_known_solution() {
    let n = 500;
    let exact: Vec<f64> = (0..n).map(|i| (i as f64 * 0.37).sin()).collect();
    let diagonal = vec![2.1; n];
    for (method, wind) in [
        (KrylovMethod::ConjugateGradient, 0.0),
        (KrylovMethod::BiCgStab, 0.0),
        (KrylovMethod::BiCgStab, -0.5),
        (KrylovMethod::Gmres, 0.0),
        (KrylovMethod::Gmres, -0.5),
    ] {
        for diagonal in [None, Some(&diagonal[..])] {
            let (mut b, mut x) = (vec![0.0; n], vec![1.0; n]);
            chain(0.1, wind)(&exact, &mut b).unwrap();
            let hints = Hints {
                diagonal,
                ..Hints::default()
            };
            let report = solver(method)
                .solve(chain(0.1, wind), &b, &mut x, &Reducer::default(), hints)
                .unwrap();
            assert!(report.iterations > 5);
            for (x, exact) in x.iter().zip(&exact) {
                // relative residual 1e-10 times |b|, about 20, over the smallest eigenvalue 0.1
                assert!((x - exact).abs() < 2e-8, "{method:?}");
            }
        }
    }
}

#[test]
fn a_diagonal_of_wide_range_is_worth_its_preconditioner() {
    let n = 200;
    let diagonal: Vec<f64> = (0..n).map(|i| 10f64.powi((i % 9) as i32)).collect();
    let apply = |x: &[f64], out: &mut [f64]| {
        update(out, [x, &diagonal], |_, [x, d]| d * x);
        Ok(())
    };
    for method in ALL {
        let mut x = vec![0.0; n];
        let hints = Hints {
            diagonal: Some(&diagonal),
            ..Hints::default()
        };
        let report = solver(method)
            .solve(apply, &vec![1.0; n], &mut x, &Reducer::default(), hints)
            .unwrap();
        assert_eq!(report.iterations, 1, "{method:?}");
    }
}

#[test]
fn a_singular_matrix_is_solved_beside_its_null_space() {
    let n = 101;
    let constant = NullSpace::constant(n, &Reducer::default());
    let hints = Hints {
        null_space: Some(&constant),
        ..Hints::default()
    };
    for method in ALL {
        // the constant part of the load has no answer and is ignored
        let b: Vec<f64> = (0..n).map(|i| (i as f64).cos() + 7.0).collect();
        let mut x = vec![3.0; n];
        let mut krylov = solver(method);
        krylov
            .solve(ring, &b, &mut x, &Reducer::default(), hints)
            .unwrap();
        let mut residual = vec![0.0; n];
        ring(&x, &mut residual).unwrap();
        let mean = sum(&b) / n as f64;
        for (r, b) in residual.iter().zip(&b) {
            // tolerance 1e-10 of a right-hand side of norm 7
            assert!((r - (b - mean)).abs() < 1e-9, "{method:?}");
        }
        // the mean of the guess stays: rounding of 101 values up to 300
        assert!(
            (sum(&x) / n as f64 - 3.0).abs() < 1e-11,
            "{method:?}: {}",
            sum(&x)
        );
    }
}

#[test]
fn dependent_modes_are_dropped() {
    let modes = vec![
        vec![1.0, 1.0, 1.0],
        vec![2.0, 2.0, 2.0],
        vec![0.0, 1.0, 2.0],
    ];
    let null_space = NullSpace::new(modes, &Reducer::default());
    let mut v = vec![1.0, 5.0, 3.0];
    null_space.project(&mut v);
    // what is left is the part along (1, -2, 1), which is (-6 / 6) of it
    for (v, exact) in v.iter().zip([-1.0, 2.0, -1.0]) {
        assert!((v - exact).abs() < 1e-14);
    }
}

#[test]
fn wrong_matrices_and_limits_are_reported() {
    let minus = |x: &[f64], out: &mut [f64]| {
        update(out, [x], |_, [x]| -x);
        Ok(())
    };
    let mut cg = solver(KrylovMethod::ConjugateGradient);
    let error = cg
        .solve(
            minus,
            &[1.0; 4],
            &mut [0.0; 4],
            &Reducer::default(),
            Hints::default(),
        )
        .unwrap_err();
    assert!(
        matches!(error, SolverError::NotPositiveDefinite { .. }),
        "{error}"
    );
    for method in ALL {
        let mut krylov = solver(method);
        krylov.options.max_iterations = 3;
        let error = krylov.solve(
            chain(0.0, 0.0),
            &[1.0; 500],
            &mut [0.0; 500],
            &Reducer::default(),
            Hints::default(),
        );
        assert!(
            matches!(error, Err(SolverError::NotConverged { iterations: 3, .. })),
            "{method:?}"
        );
        let nan = |_: &[f64], out: &mut [f64]| {
            out.fill(f64::NAN);
            Ok(())
        };
        let error = krylov.solve(
            nan,
            &[1.0; 4],
            &mut [0.0; 4],
            &Reducer::default(),
            Hints::default(),
        );
        assert!(
            matches!(error, Err(SolverError::NotFinite { .. })),
            "{method:?}"
        );
        let error = krylov.solve(
            ring,
            &[1.0; 4],
            &mut [0.0; 3],
            &Reducer::default(),
            Hints::default(),
        );
        assert!(
            matches!(error, Err(SolverError::Length { .. })),
            "{method:?}"
        );
        // a singular matrix and a load outside its range: no answer, and no endless loop
        krylov.options.max_iterations = 1000;
        assert!(
            krylov
                .solve(
                    ring,
                    &[1.0; 8],
                    &mut [0.0; 8],
                    &Reducer::default(),
                    Hints::default()
                )
                .is_err()
        );
    }
}

#[test]
fn solutions_have_the_same_bits_for_any_number_of_threads() {
    let n = 100_000;
    let b: Vec<f64> = (0..n).map(|i| (i as f64 * 0.1).sin()).collect();
    let constant = NullSpace::constant(n, &Reducer::default());
    for method in ALL {
        let solve = |threads| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap();
            pool.install(|| {
                let mut x = vec![0.0; n];
                let hints = Hints {
                    null_space: Some(&constant),
                    ..Hints::default()
                };
                solver(method)
                    .solve(chain(0.5, 0.0), &b, &mut x, &Reducer::default(), hints)
                    .unwrap();
                x.iter().map(|x| x.to_bits()).collect::<Vec<_>>()
            })
        };
        assert!(solve(1) == solve(2), "{method:?}");
    }
}

#[test]
fn a_residual_at_right_angles_to_its_shadow_starts_again() {
    // after a half step the residual has no first component, and its shadow has no other
    let apply = |x: &[f64], out: &mut [f64]| {
        out[0] = 2.0 * x[0];
        out[1] = x[0] + 3.0 * x[1] + x[2];
        out[2] = 0.5 * x[0] - x[1] + 4.0 * x[2];
        Ok(())
    };
    let mut x = [0.0; 3];
    let report = solver(KrylovMethod::BiCgStab)
        .solve(
            apply,
            &[1.0, 0.0, 0.0],
            &mut x,
            &Reducer::default(),
            Hints::default(),
        )
        .unwrap();
    // one to the breakdown, and two for the two components that are left
    assert_eq!(report.iterations, 3);
    let mut image = [0.0; 3];
    apply(&x, &mut image).unwrap();
    for (found, wanted) in image.iter().zip([1.0, 0.0, 0.0]) {
        assert!((found - wanted).abs() < 1e-9, "{x:?}");
    }
}

/// For a skew matrix the image of the residual is at right angles to it: the recurrence breaks down before its first step,
/// and again after each start with the same residual.
#[test]
fn a_breakdown_right_after_a_start_is_told_at_once() {
    let skew = |x: &[f64], out: &mut [f64]| {
        out.copy_from_slice(&[x[1], -x[0]]);
        Ok(())
    };
    // of norm 5, whose square is not its double
    let failed = solver(KrylovMethod::BiCgStab).solve(
        skew,
        &[3.0, 4.0],
        &mut [0.0; 2],
        &Reducer::default(),
        Hints::default(),
    );
    let Err(SolverError::NotConverged {
        iterations,
        residual,
        advice,
        ..
    }) = failed
    else {
        panic!("{failed:?}");
    };
    assert_eq!((iterations, residual), (0, 5.0));
    assert!(advice.contains("broke down"), "{advice}");
}

/// After the first step of this system the image of the direction is at right angles to the shadow residual. The method
/// starts again from the residual, and needs three more steps for three unknowns.
#[test]
fn a_breakdown_on_the_way_starts_again() {
    let apply = |x: &[f64], out: &mut [f64]| {
        out[0] = x[0];
        out[1] = -x[0] - x[1] - x[2];
        out[2] = -x[0] - 2.0 * x[1] + x[2];
        Ok(())
    };
    let rhs = [-2.0, 2.0, -2.0];
    let mut x = [0.0; 3];
    let report = solver(KrylovMethod::BiCgStab)
        .solve(apply, &rhs, &mut x, &Reducer::default(), Hints::default())
        .unwrap();
    // one step, the breakdown, three steps
    assert_eq!(report.iterations, 5);
    // by hand: x = -2, so y + z = 0 and z - 2 y = -4
    for (found, exact) in x.iter().zip([-2.0, 4.0 / 3.0, -4.0 / 3.0]) {
        assert!((found - exact).abs() < 1e-9, "{x:?}");
    }
}
