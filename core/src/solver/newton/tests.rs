use super::*;
use crate::solver::rhs;

/// A bar whose springs harden, `N(e) = e + e^3`, held at the left, pulled by `p` at the right.
fn hardening_bar(p: f64) -> impl Rhs {
    rhs(move |_, u, force| {
        force.fill(0.0);
        for i in 0..u.len() {
            let e = u[i] - if i == 0 { 0.0 } else { u[i - 1] };
            force[i] -= e + e * e * e;
            if i > 0 {
                force[i - 1] += e + e * e * e;
            }
        }
        *force.last_mut().unwrap() += p;
        Ok(())
    })
}

#[test]
fn all_krylov_methods_find_the_nonlinear_equilibrium() {
    for krylov in [
        KrylovMethod::ConjugateGradient,
        KrylovMethod::BiCgStab,
        KrylovMethod::Gmres,
    ] {
        let mut newton = Newton::new(NewtonOptions {
            krylov,
            relative_tolerance: 1e-11,
            ..Default::default()
        });
        let mut u = vec![0.0; 50];
        // e + e^3 = 10 for e = 2
        let report = newton
            .solve(&mut hardening_bar(10.0), 0.0, &mut u, Hints::default())
            .unwrap();
        for (i, u) in u.iter().enumerate() {
            // residual 1e-10 on a chain whose flexibility is at most 50
            assert!((u - 2.0 * (i + 1) as f64).abs() < 1e-8, "{krylov:?}");
        }
        assert!(report.iterations < 20, "{report:?}");
        assert!(report.krylov_iterations >= report.iterations, "{report:?}");
    }
}

#[test]
fn a_linear_function_takes_one_iteration() {
    let mut bar = rhs(|_, u, force| {
        for i in 0..u.len() {
            let left = if i == 0 { 0.0 } else { u[i - 1] };
            let right = if i + 1 == u.len() { 1.0 } else { u[i + 1] };
            force[i] = left - 2.0 * u[i] + right;
        }
        Ok(())
    });
    let krylov = KrylovMethod::ConjugateGradient;
    let mut newton = Newton::new(NewtonOptions {
        krylov,
        linear: true,
        ..Default::default()
    });
    let mut u = vec![0.0; 99];
    let report = newton
        .solve(&mut bar, 0.0, &mut u, Hints::default())
        .unwrap();
    assert_eq!(report.iterations, 1);
    for (i, u) in u.iter().enumerate() {
        // relative residual 1e-8 times the condition number, about 4000
        assert!((u - (i + 1) as f64 / 100.0).abs() < 4e-5);
    }
}

#[test]
fn the_line_search_rescues_a_start_from_which_full_steps_diverge() {
    // atan has full steps of growing size from |y| > 1.392
    let mut function = rhs(|_, y, value| {
        value[0] = -y[0].atan();
        Ok(())
    });
    let mut y = [20.0];
    Newton::new(NewtonOptions::default())
        .solve(&mut function, 0.0, &mut y, Hints::default())
        .unwrap();
    assert!(y[0].abs() < 1e-7);
}

/// A spring of stiffness 1 that is pulled, behind it a spring that holds the end of a lever: it yields at the force 1 and
/// hardens by 0.1. The state is the displacement at the load and the angle of the lever.
struct YieldingLever {
    load: f64,
    is_force: bool,
}

impl YieldingLever {
    const ARM: f64 = 100.0;

    /// Derivatives of the extensions of both springs by the state.
    const EXTENSIONS: [[f64; 2]; 2] = [[1.0, -Self::ARM], [0.0, Self::ARM]];

    /// Force and stiffness of both springs; the stiffness at the kink is that below it.
    fn springs(state: &[f64]) -> [(f64, f64); 2] {
        let [pulled, held] = Self::EXTENSIONS.map(|[x, angle]| x * state[0] + angle * state[1]);
        let yields = held > 1.0 + 1e-12;
        let holding = match yields {
            true => (1.0 + 0.1 * (held - 1.0), 0.1),
            false => (held, 1.0),
        };
        [(pulled, 1.0), holding]
    }

    fn minus_sum(tensions: [f64; 2], out: &mut [f64]) {
        for (i, out) in out.iter_mut().enumerate() {
            let springs = Self::EXTENSIONS.iter().zip(tensions);
            *out = -springs.map(|(e, tension)| e[i] * tension).sum::<f64>();
        }
    }
}

impl Rhs for YieldingLever {
    fn rate(&mut self, _: f64, state: &[f64], force: &mut [f64]) -> Result<(), SolverError> {
        Self::minus_sum(Self::springs(state).map(|(tension, _)| tension), force);
        force[0] += self.load;
        Ok(())
    }

    fn tangent(&mut self, at: At, v: &[f64], out: &mut [f64]) -> Result<bool, SolverError> {
        let extensions = Self::EXTENSIONS.map(|e| e[0] * v[0] + e[1] * v[1]);
        let springs = Self::springs(at.state);
        let tensions = [0, 1].map(|spring| springs[spring].1 * extensions[spring]);
        Self::minus_sum(tensions, out);
        Ok(true)
    }

    fn is_force(&self) -> bool {
        self.is_force
    }
}

/// The tangent of the state at which the spring is about to yield is elastic. What it does not bear after that acts on the
/// lever as a moment, so that the norm of the forces rises in all but the shortest steps; the energy falls.
#[test]
fn yielding_is_brought_to_equilibrium_by_the_work() {
    let solve = |is_force| {
        let mut lever = YieldingLever {
            load: 1.2,
            is_force,
        };
        let mut newton = Newton::new(NewtonOptions {
            krylov: KrylovMethod::ConjugateGradient,
            ..Default::default()
        });
        let mut state = [2.0, 1.0 / YieldingLever::ARM];
        let report = newton.solve(&mut lever, 0.0, &mut state, Hints::default());
        (report, state)
    };
    let (report, state) = solve(true);
    let expected = [3.0 + 1.2, 3.0 / YieldingLever::ARM];
    for (found, expected) in state.iter().zip(expected) {
        assert!((found / expected - 1.0).abs() < 1e-6, "{state:?}");
    }
    let [by_work, by_norm] = [report, solve(false).0].map(|r| r.expect("an equilibrium"));
    assert!(by_work.iterations <= 10);
    assert!(
        2 * by_work.evaluations < by_norm.evaluations,
        "the norm alone shortens the first step to less than a thousandth"
    );
}

/// A spring that bears at most the force of its yielding, without hardening but for rounding, and whose state of the last step
/// was stretched far: where it flows nothing resists it.
struct PerfectlyPlastic {
    is_damped: bool,
}

impl PerfectlyPlastic {
    const HARDENING: f64 = 1e-9;

    /// Force and stiffness: elastic within 1 of the origin.
    fn spring(extension: f64) -> (f64, f64) {
        match extension.abs() > 1.0 {
            true => {
                let beyond = Self::HARDENING * (extension.abs() - 1.0);
                ((1.0 + beyond).copysign(extension), Self::HARDENING)
            }
            false => (extension, 1.0),
        }
    }
}

impl Rhs for PerfectlyPlastic {
    fn rate(&mut self, _: f64, state: &[f64], force: &mut [f64]) -> Result<(), SolverError> {
        force[0] = 0.5 - Self::spring(state[0]).0;
        Ok(())
    }

    fn tangent(&mut self, at: At, v: &[f64], out: &mut [f64]) -> Result<bool, SolverError> {
        let damping = if self.is_damped { at.damping } else { 0.0 };
        let (_, stiffness) = Self::spring(at.state[0]);
        out[0] = -((1.0 - damping) * stiffness + damping) * v[0];
        Ok(true)
    }

    fn is_force(&self) -> bool {
        true
    }
}

/// The undamped direction is 1e9 long, and the force along it turns over within 2.
#[test]
fn flow_that_nothing_resists_is_brought_to_equilibrium_by_a_damped_tangent() {
    let solve = |is_damped| {
        let mut newton = Newton::new(NewtonOptions::default());
        let mut state = [20.0];
        let hints = Hints::default();
        let report = newton.solve(&mut PerfectlyPlastic { is_damped }, 0.0, &mut state, hints);
        (report, state[0])
    };
    let (report, state) = solve(true);
    assert!((state - 0.5).abs() < 1e-8, "{state}");
    assert!(report.expect("an equilibrium").evaluations <= 40);
    assert!(solve(false).0.is_err(), "the steps are too long");
}

#[test]
fn a_function_without_zero_is_reported() {
    let mut function = rhs(|_, y, value| {
        value[0] = -1.0 - y[0] * y[0];
        Ok(())
    });
    let error = Newton::new(NewtonOptions::default())
        .solve(&mut function, 0.0, &mut [0.5], Hints::default())
        .unwrap_err();
    assert!(matches!(error, SolverError::NotConverged { .. }), "{error}");
}
