//! Equilibrium: units of length, and the evaluations of forces that are counted.

use nalgebra::Vector3;
use perimelt_core::body::Store;
use perimelt_core::simulation::Simulation;
use perimelt_core::{
    Coupler, RunError, RunningCoupler, Setup, SetupError, Step, World, Write, keys,
};
use serde::{Deserialize, Serialize};

use super::Mechanical;
use crate::testing::{block, read, run, simulation, values};

/// Holds both ends of a film across x, and stretches it.
#[derive(Debug, Serialize, Deserialize)]
struct Stretching {
    /// Strain at the end.
    strain: f64,
    /// Duration of the stretching, s.
    duration: f64,
    #[serde(skip)]
    fields: Option<[Write<Vector3<f64>>; 2]>,
}

#[typetag::serialize(name = "test_stretching")]
impl Coupler for Stretching {
    fn prepare(
        mut self: Box<Self>,
        setup: &mut Setup<'_>,
    ) -> Result<Box<dyn RunningCoupler>, SetupError> {
        let constraint = setup.add(0, &keys::CONSTRAINT)?;
        self.fields = Some([constraint, setup.add(0, &keys::HELD_DISPLACEMENT)?]);
        Ok(self)
    }
}

impl RunningCoupler for Stretching {
    fn apply(&mut self, world: &World, step: Step) -> Result<(), RunError> {
        let [constraint, held] = self.fields.expect("prepared");
        let (mut constraint, mut held) = (world.write(constraint), world.write(held));
        let body = world.body(0);
        let ((min, max), spacing) = (body.bounds(), body.coarsest_spacing());
        for (i, x) in body.points.position.iter().enumerate() {
            let is_right = max[0] - x.x < 2.0 * spacing;
            if is_right || x.x - min[0] < 2.0 * spacing {
                constraint[i] += Vector3::repeat(1.0);
                let strain = self.strain * (step.end() / self.duration).min(1.0);
                let pull = if is_right { strain } else { 0.0 };
                held[i] += Vector3::new(pull * (max[0] - min[0]), 0.0, 0.0);
            }
        }
        Ok(())
    }
}

/// Stretches by 5 % within the first step.
const STRETCHING: Stretching = Stretching {
    strain: 0.05,
    duration: f64::MIN_POSITIVE,
    fields: None,
};

/// A film of `cells` points that are `spacing` apart, held at both ends and stretched within 1 s.
fn film(cells: [usize; 3], spacing: f64, keys: &str, stretching: Stretching) -> Simulation {
    let material = "density = 8000\nyoungs_modulus = 2e11\npoissons_ratio = 0.3";
    let body = block(cells, 2, spacing, Store::Lattice, material);
    let mechanical: Mechanical = read(keys);
    let couplers: Vec<Box<dyn Coupler>> = vec![Box::new(stretching)];
    simulation(body, vec![Box::new(mechanical)], couplers, 1.0)
}

/// Displacement over spacing, and the number of evaluations of forces.
fn stretched(spacing: f64, keys: &str) -> (Vec<f64>, u64) {
    let mut s = film([16, 6, 1], spacing, keys, STRETCHING);
    run(&mut s);
    let displacement = values(&s, "displacement");
    let relative = displacement.iter().map(|u| u / spacing).collect();
    (relative, s.progress().evaluations[0])
}

#[test]
fn a_nanometre_film_converges_as_a_metre_film_does() {
    for formulation in ["bond", "ordinary", "correspondence"] {
        let keys = format!("formulation = \"{formulation}\"\nkinematics = \"finite\"");
        let (metres, evaluations) = stretched(1.0, &keys);
        // a power of two, so that no number rounds otherwise
        let (nanometres, as_many) = stretched(0.5f64.powi(30), &keys);
        assert_eq!(evaluations, as_many, "{formulation}");
        let size = metres.iter().fold(0.0f64, |s, u| s.max(u.abs()));
        for (a, b) in metres.iter().zip(&nanometres) {
            assert!((a - b).abs() < 1e-12 * size, "{formulation}: {a} {b}");
        }
    }
}

#[test]
fn evaluations_of_the_unbalanced_force_and_of_the_loads_are_counted() {
    let mut s = film([16, 6, 1], 1.0, "step = 0.5", STRETCHING);
    s.start().expect("starts");
    let mut counts = Vec::new();
    while !s.is_finished() {
        s.step().expect("steps");
        let progress = s.progress();
        counts.push((progress.iterations[0], progress.evaluations[0]));
    }
    // a linear body: before the iterations, one in each, and after them
    let (iterations, evaluations) = counts[0];
    assert!(iterations > 0);
    assert_eq!(evaluations, iterations + 2, "{counts:?}");
    // in equilibrium already: the loads, and that there is nothing to do
    assert_eq!(counts[1], (iterations, evaluations + 2), "{counts:?}");
}

/// Displacement of a film that is shortened by 2.4 spacings at once, or in steps of 0.05 s within 1 s.
fn shortened(formulation: &str, duration: f64) -> Vec<f64> {
    let keys = format!("formulation = \"{formulation}\"\nkinematics = \"finite\"\nstep = 0.05");
    let shortening = Stretching {
        strain: -0.05,
        duration,
        fields: None,
    };
    let mut s = film([48, 24, 1], 1.0, &keys, shortening);
    run(&mut s);
    values(&s, "displacement")
}

#[test]
fn a_displacement_of_many_spacings_in_one_step_ends_as_in_many_steps() {
    for formulation in ["bond", "ordinary", "correspondence"] {
        let at_once = shortened(formulation, f64::MIN_POSITIVE);
        let in_steps = shortened(formulation, 1.0);
        for (a, b) in at_once.iter().zip(&in_steps) {
            assert!((a - b).abs() < 1e-6, "{formulation}: {a} {b}");
        }
    }
}

/// Smaller steps do not help above the limit load, and are not advised.
#[test]
fn a_body_that_flows_is_told_of_its_limit_load() {
    use perimelt_core::solver::SolverError;
    let stopped = || SolverError::NotConverged {
        method: "Newton's method",
        iterations: 50,
        residual: 1.0,
        tolerance: 0.1,
        advice: "take a smaller step",
    };
    let text = super::equilibrium::about_flow(stopped()).to_string();
    assert!(
        text.contains("limit load") && !text.contains("smaller"),
        "{text}"
    );
    assert!(
        text.contains("50 iterations at a residual of 1e0"),
        "{text}"
    );
    let other = SolverError::NotFinite {
        what: "the residual",
        iteration: 1,
    };
    let text = super::equilibrium::about_flow(other).to_string();
    assert!(text.starts_with("the residual is not finite"), "{text}");
}
