//! Adaptive dynamic relaxation: static equilibrium `F(u) = 0` by damped fictitious motion.
//!
//! ```text
//! D u'' + C D u' = F(u),   dt = 1                                            Wang (2025), eq. 4.13
//! v_half = ((2 - C) v + 2 F/D) / (2 + C)                                     eq. 4.17
//! u_new  = u + v_half                                                        eq. 4.18; corrected
//! C      = 2 sqrt( (u . K u) / (u . u) )                                     eq. 4.19
//! K_i    = -(F_i/D_i - F_i,before/D_i) / v_i                                 eq. 4.20
//! ```
//!
//! Not given by the source (docs/theory/mechanics.md): the start `v = F / (2 D)`; `K_i = 0` where
//! `v_i = 0`; `C = 0` if the radicand is not positive and 1.9 if `C` would exceed 2.
//!
//! Robust for softening, fracture and contact, where the tangent is misleading. For smooth problems
//! [`super::Newton`] needs far fewer evaluations of the force. Not for the path between equilibria: the motion has
//! no physical time, and overshoots can break bonds that a slow load would not.

use super::error::{SolverError, same_length};
use super::reducer::Reducer;
use super::vector::{quotient, update};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// When a relaxation stops: at `|F/D| <= relative |F/D at start| + absolute`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RelaxationOptions {
    /// Force over fictitious mass, relative to that at the start (-).
    pub relative_tolerance: f64,
    /// Norm of force over fictitious mass (m), about the displacement of one iteration.
    pub absolute_tolerance: f64,
    /// Iterations after which the solver gives up.
    pub max_iterations: usize,
}

impl Default for RelaxationOptions {
    fn default() -> Self {
        Self {
            relative_tolerance: 1e-7,
            absolute_tolerance: 0.0,
            max_iterations: 100_000,
        }
    }
}

/// Report of a relaxation.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct RelaxationReport {
    /// Iterations, each with one evaluation of the force.
    pub iterations: usize,
    /// Norm of force over fictitious mass at the end (m).
    pub residual: f64,
}

/// Fictitious mass from the sum `sum_j |K_ij|` of a row of the stiffness matrix [N/m, or its
/// density]: `D = margin/4 sum_j |K_ij|`, stable for `margin >= 1` by Gershgorin's theorem.
/// A margin of 1.1 to 1.5 leaves room for stiffening; a larger one wastes iterations.
pub fn fictitious_mass(stiffness_row_sum: f64, margin: f64) -> f64 {
    0.25 * margin * stiffness_row_sum
}

/// Adaptive dynamic relaxation with its work vectors, which are allocated once.
#[derive(Debug, Clone, Default)]
pub struct Relaxation {
    /// When to stop.
    pub options: RelaxationOptions,
    velocity: Vec<f64>,
    force: Vec<f64>,
    acceleration: Vec<f64>,
    previous: Vec<f64>,
}

impl Relaxation {
    /// A solver that sizes its work vectors at first use.
    pub fn new(options: RelaxationOptions) -> Self {
        Self {
            options,
            ..Default::default()
        }
    }

    /// Relaxes `displacement` (m), which holds the initial guess on entry and after an error
    /// the last iterate.
    ///
    /// `force(u, out)` writes the force of all components into `out` (zero for held ones),
    /// after refreshing what follows `u`, such as mirrored boundary layers.
    /// `fictitious_mass`: see [`fictitious_mass`]; positive, in the unit of force per metre.
    /// `loads`: the residual that the relative tolerance refers to, in its unit; zero for that of the initial guess.
    /// `points`: those to which the entries belong; the forces of those that other processes own are replaced.
    ///
    /// # Errors
    /// No convergence, numbers that are not finite (the mass is too small), vectors of
    /// different lengths, a mass that is not positive, and errors of `force`.
    pub fn solve(
        &mut self,
        displacement: &mut [f64],
        fictitious_mass: &[f64],
        loads: f64,
        points: &Reducer,
        mut force: impl FnMut(&[f64], &mut [f64]) -> Result<(), SolverError>,
    ) -> Result<RelaxationReport, SolverError> {
        let n = displacement.len();
        same_length("the fictitious mass", n, fictitious_mass.len())?;
        let mut own = points.own(fictitious_mass).iter();
        if let Some(&value) = own.find(|d| d.is_nan() || **d <= 0.0) {
            return Err(SolverError::OutOfRange {
                what: "a fictitious mass",
                value,
                range: "positive; check for free points without bonds",
            });
        }
        let Self {
            options,
            velocity,
            force: f,
            acceleration,
            previous,
        } = self;
        for vector in [&mut *velocity, &mut *f, &mut *acceleration, &mut *previous] {
            vector.resize(n, 0.0);
        }
        let mut tolerance = options.absolute_tolerance;
        for iteration in 0.. {
            std::mem::swap(acceleration, previous);
            force(displacement, f)?;
            points.bring(f);
            update(acceleration, [f, fictitious_mass], |_, parts| {
                quotient(parts)
            });
            let residual = points.norm(acceleration);
            if !residual.is_finite() {
                return Err(SolverError::NotFinite {
                    what: "the relaxed force",
                    iteration,
                });
            }
            if iteration == 0 {
                let size = if loads > 0.0 { loads } else { residual };
                tolerance += options.relative_tolerance * size;
            }
            if residual <= tolerance {
                return Ok(RelaxationReport {
                    iterations: iteration,
                    residual,
                });
            }
            if iteration == options.max_iterations {
                return Err(SolverError::NotConverged {
                    method: "dynamic relaxation",
                    iterations: iteration,
                    residual,
                    tolerance,
                    advice: "allow more iterations, hold the body against rigid motion, or raise the fictitious mass if the residual grows",
                });
            }
            if iteration == 0 {
                update(velocity, [acceleration], |_, [a]| 0.5 * a);
            } else {
                let c = damping(points, [displacement, velocity, acceleration, previous]);
                update(velocity, [acceleration], |v, [a]| {
                    ((2.0 - c) * v + 2.0 * a) / (2.0 + c)
                });
            }
            update(displacement, [velocity], |u, [v]| u + v);
        }
        unreachable!("the loop ends by convergence or at the iteration limit")
    }
}

/// `C`, eqs. 4.19 and 4.20, from displacement, velocity, acceleration and that before.
fn damping(points: &Reducer, vectors: [&[f64]; 4]) -> f64 {
    let stiffness = points.sum_of(vectors, |[u, v, a, before]| {
        if v == 0.0 {
            0.0
        } else {
            -u * u * (a - before) / v
        }
    });
    let length = points.dot(vectors[0], vectors[0]);
    if stiffness > 0.0 && length > 0.0 {
        let c = 2.0 * (stiffness / length).sqrt();
        if c > 2.0 { 1.9 } else { c }
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Chain of springs of stiffness 1000 + 10 i held at the left end, with a load at the right end.
    fn chain(u: &[f64], force: &mut [f64]) -> Result<(), SolverError> {
        force.fill(0.0);
        for i in 0..u.len() {
            let left = if i == 0 { 0.0 } else { u[i - 1] };
            let tension = (1000.0 + 10.0 * i as f64) * (u[i] - left);
            force[i] -= tension;
            if i > 0 {
                force[i - 1] += tension;
            }
        }
        force[u.len() - 1] += 5.0;
        Ok(())
    }

    fn mass(n: usize) -> Vec<f64> {
        (0..n)
            .map(|i| fictitious_mass(2.0 * (2010.0 + 20.0 * i as f64), 1.1))
            .collect()
    }

    #[test]
    fn a_spring_chain_finds_its_static_solution() {
        let n = 100;
        let mut u = vec![0.0; n];
        let options = RelaxationOptions {
            relative_tolerance: 1e-9,
            ..Default::default()
        };
        let report = Relaxation::new(options)
            .solve(&mut u, &mass(n), 0.0, &Reducer::default(), chain)
            .unwrap();
        let mut exact = 0.0;
        for (i, u) in u.iter().enumerate() {
            exact += 5.0 / (1000.0 + 10.0 * i as f64);
            // relative residual 1e-9 times the condition number, about 10^4
            assert!((u - exact).abs() < 1e-5 * exact, "{i}: {u} {exact}");
        }
        // critically damped: some multiple of the number of points, far from its square
        assert!(report.iterations < 30 * n, "{report:?}");
    }

    /// One point on a spring: `C` is twice its frequency, but never more than 1.9.
    #[test]
    fn the_damping_is_critical_for_the_stiffness_along_the_way() {
        let of = |stiffness: f64| {
            let (u, v) = (2.0, 0.1);
            let (before, now) = (-stiffness * (u - v), -stiffness * u);
            damping(&Reducer::default(), [&[u], &[v], &[now], &[before]])
        };
        assert!((of(0.09) - 0.6).abs() < 1e-12);
        assert_eq!(of(4.0), 1.9);
        assert_eq!(of(-0.09), 0.0);
        assert_eq!(
            damping(&Reducer::default(), [&[0.0], &[0.1], &[1.0], &[2.0]]),
            0.0
        );
    }

    #[test]
    fn an_equilibrium_is_recognised_and_a_limit_reported() {
        let mut u = vec![0.0; 10];
        let mut relaxation = Relaxation::new(RelaxationOptions {
            max_iterations: 5,
            ..Default::default()
        });
        let error = relaxation
            .solve(&mut u, &mass(10), 0.0, &Reducer::default(), chain)
            .unwrap_err();
        assert!(
            matches!(error, SolverError::NotConverged { iterations: 5, .. }),
            "{error}"
        );

        relaxation.options = RelaxationOptions {
            absolute_tolerance: 1e-12,
            ..Default::default()
        };
        relaxation
            .solve(&mut u, &mass(10), 0.0, &Reducer::default(), chain)
            .unwrap();
        relaxation.options.absolute_tolerance = 1e-6;
        assert_eq!(
            relaxation
                .solve(&mut u, &mass(10), 0.0, &Reducer::default(), chain)
                .unwrap()
                .iterations,
            0
        );
    }

    #[test]
    fn a_mass_below_the_stable_one_is_reported_not_returned() {
        let mut u = vec![0.0; 10];
        let light: Vec<f64> = mass(10).iter().map(|d| d / 4.0).collect();
        assert!(
            Relaxation::default()
                .solve(&mut u, &light, 0.0, &Reducer::default(), chain)
                .is_err()
        );
        assert!(
            Relaxation::default()
                .solve(&mut u, &[0.0; 10], 0.0, &Reducer::default(), chain)
                .is_err()
        );
    }
}
