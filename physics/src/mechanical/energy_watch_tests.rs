//! Work of loads, and energy that grows without work.

use super::RunningMechanical;
use nalgebra::Vector3;
use perimelt_core::body::Store;
use perimelt_core::solver::reduce::sum_points;
use perimelt_core::world::LayerHandle;
use perimelt_core::{
    Body, Coupler, Face, LayerRole, Read, RunError, RunningCoupler, RunningPhysics, Setup,
    SetupError, Simulation, Step, World, Write, keys,
};
use serde::{Deserialize, Serialize};

use super::Mechanical;
use super::energy_watch::Reference;
use crate::testing::{block, read, set, simulation};

const STEEL: &str = "density = 8000\nyoungs_modulus = 2e11\npoissons_ratio = 0.3";
const FORMULATIONS: [&str; 4] = ["bond", "ordinary", "correspondence", "staggered"];
/// Of the tests that count work, s.
const STEP: f64 = 5e-8;

/// Which loads act, in turn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Load {
    BodyForce,
    Held,
    Impulse,
    Layer,
    Eigenstrain,
    /// With the stress conjugate to it.
    WorkOfEigenstrain,
}

/// A body under one load.
struct Loaded {
    world: World,
    mechanical: RunningMechanical,
    load: Load,
    vectors: Vec<Write<Vector3<f64>>>,
    eigenstrain: Option<Write<f64>>,
    layer: Option<LayerHandle>,
}

impl Loaded {
    fn new(formulation: &str, load: Load) -> Self {
        let body = block([6, 5, 1], 2, 1e-3, Store::Lattice, STEEL);
        let mechanical: Mechanical = read(&format!(
            "formulation = '{formulation}'\nsolver.explicit = {{}}"
        ));
        let mut world = World::new(vec![body]);
        let mut setup = Setup::new(&mut world, std::path::Path::new("."));
        setup.next_plugin("load");
        let keys = match load {
            Load::BodyForce => vec![keys::BODY_FORCE],
            Load::Held => vec![keys::CONSTRAINT, keys::HELD_DISPLACEMENT],
            Load::Impulse => vec![keys::IMPULSE],
            _ => Vec::new(),
        };
        let added = keys.iter().map(|key| setup.add(0, key).expect("free"));
        let vectors = added.collect();
        let eigenstrain = match load {
            Load::Eigenstrain | Load::WorkOfEigenstrain => {
                Some(setup.add(0, &keys::EIGENSTRAIN).expect("free"))
            }
            _ => None,
        };
        if load == Load::WorkOfEigenstrain {
            setup.read(0, &keys::CONJUGATE_STRESS).expect("provided");
        }
        let layer = (load == Load::Layer).then(|| {
            let layer = setup.layer(0, &keys::DISPLACEMENT, Face::XMin, LayerRole::Prescribed);
            layer.expect("free")
        });
        setup.next_plugin("mechanical");
        let mut mechanical = mechanical.ready(&mut setup).expect("valid");
        setup.finish().expect("complete");
        mechanical.start(&world).expect("starts");
        let run = &mut mechanical.run;
        // no heat follows the deformation, and is late
        run.scratch.is_repeated = true;
        Loaded {
            world,
            mechanical,
            load,
            vectors,
            eigenstrain,
            layer,
        }
    }

    /// Applies a load that is different in each step.
    fn apply(&self, step: usize) {
        let time = (step as f64 * 0.1).sin();
        let in_plane = |i: usize, size: f64| {
            let phase = i as f64;
            Vector3::new(phase.sin(), (1.7 * phase).cos(), 0.0) * (size * time)
        };
        let fill = |handle: Write<Vector3<f64>>, value: &dyn Fn(usize) -> Vector3<f64>| {
            let mut field = self.world.write(handle);
            (field.iter_mut().enumerate()).for_each(|(i, v)| *v = value(i));
        };
        match (self.load, &self.vectors[..]) {
            (Load::BodyForce, [force]) => fill(*force, &|i| in_plane(i, 1e8)),
            (Load::Impulse, [impulse]) => fill(*impulse, &|i| in_plane(i, 1e3)),
            (Load::Held, [constraint, held]) => {
                let is_held = |i: usize| if i.is_multiple_of(6) { 1.0 } else { 0.0 };
                fill(*constraint, &|i| Vector3::new(is_held(i), is_held(i), 0.0));
                fill(*held, &|i| is_held(i) * in_plane(i, 1e-6));
            }
            _ => {}
        }
        if let Some(eigenstrain) = self.eigenstrain {
            self.world.write(eigenstrain).fill(1e-4 * time);
        }
        if let Some(layer) = self.layer {
            self.world
                .set_layer(layer, [-1.0; 3], [1e-6 * time, 0.0, 0.0]);
        }
    }

    /// Energy that velocity Verlet keeps under constant loads of a linear body, `H - dt^2 / 8 sum V F^2 / rho`, and H with
    /// its bound, J.
    fn energies(&mut self) -> [f64; 3] {
        let run = &mut self.mechanical.run;
        let total = run.energy(&self.world).total();
        let volume = run.nodes().volumes(self.world.body(0));
        let inverse = &run.free_inverse_density;
        let squares = run.with_force(&self.world, |force| {
            let square = |i: usize| force[i] * force[i] * inverse[i] * volume[i / 3];
            sum_points(force.len(), |i| [square(i)])[0]
        });
        let squares = squares.expect("a step was taken");
        let bound = run
            .state
            .watch
            .reference
            .map_or(0.0, |r: Reference| r.bound);
        [total - 0.125 * STEP * STEP * squares, total, bound]
    }

    fn advance(&mut self, step: usize) {
        self.apply(step);
        let step = Step::new(step as f64 * STEP, STEP);
        self.mechanical.advance(&self.world, step).expect("a step");
    }
}

#[test]
fn the_bound_of_the_energy_grows_by_the_work_of_loads() {
    let loads = [
        Load::BodyForce,
        Load::Held,
        Load::Impulse,
        Load::WorkOfEigenstrain,
    ];
    // corners of a staggered solid move with its faces, and their work is known
    let staggered = ["staggered"].into_iter().zip([Load::Layer]);
    let cases = FORMULATIONS
        .iter()
        .flat_map(|f| loads.map(|load| (*f, load)));
    for (formulation, load) in cases.chain(staggered) {
        let mut body = Loaded::new(formulation, load);
        (0..2).for_each(|step| body.advance(step));
        let [kept, _, bound] = body.energies();
        let mut largest: f64 = 0.0;
        let mut worst: f64 = 0.0;
        for step in 2..300 {
            body.advance(step);
            let [kept_now, _, bound_now] = body.energies();
            let (work, change) = (bound_now - bound, kept_now - kept);
            largest = largest.max(change.abs());
            worst = worst.max((work - change).abs());
        }
        assert!(largest > 0.0, "{formulation} {load:?}");
        let error = worst / largest;
        // rounding of some hundred steps
        assert!(error < 1e-12, "{formulation} {load:?}: {error:e}");
    }
}

#[test]
fn the_energy_stays_below_the_upper_bounds_of_works() {
    for formulation in FORMULATIONS {
        for load in [Load::Layer, Load::Eigenstrain] {
            if (formulation, load) == ("staggered", Load::Layer) {
                continue;
            }
            let mut body = Loaded::new(formulation, load);
            (0..2).for_each(|step| body.advance(step));
            let mut largest: f64 = 0.0;
            for step in 2..300 {
                body.advance(step);
                let [kept, total, bound] = body.energies();
                assert!(
                    kept <= bound,
                    "{formulation} {load:?} {step}: {kept:e} {bound:e}"
                );
                largest = largest.max(total);
            }
            assert!(largest > 0.0, "{formulation} {load:?}");
        }
    }
}

/// What acts on a body whose energy grows without work.
#[derive(Debug, Default, Serialize, Deserialize)]
struct Surroundings {
    /// Rate of a body force along x at the points of the face, N/(m³ s).
    #[serde(default)]
    ramp: f64,
    /// Eigenstrain per conjugate stress before the step, 1/Pa: heat of deformation that is one step late.
    #[serde(default)]
    compliance: f64,
    #[serde(skip)]
    force: Option<Write<Vector3<f64>>>,
    #[serde(skip)]
    strain: Option<(Read<f64>, Write<f64>)>,
}

#[typetag::serialize(name = "test_energy_surroundings")]
impl Coupler for Surroundings {
    fn prepare(
        mut self: Box<Self>,
        setup: &mut Setup<'_>,
    ) -> Result<Box<dyn RunningCoupler>, SetupError> {
        if self.ramp != 0.0 {
            self.force = Some(setup.add(0, &keys::BODY_FORCE)?);
        }
        if self.compliance != 0.0 {
            let stress = setup.read(0, &keys::CONJUGATE_STRESS)?;
            self.strain = Some((stress, setup.add(0, &keys::EIGENSTRAIN)?));
        }
        Ok(self)
    }
}

impl RunningCoupler for Surroundings {
    fn apply(&mut self, world: &World, step: Step) -> Result<(), RunError> {
        if let Some(force) = self.force {
            let size = self.ramp * step.end();
            let mut force = world.write(force);
            let points = force.iter_mut().zip(&world.body(0).points.position);
            let loaded = points.filter(|(_, x)| x.x > 19.5e-3);
            loaded.for_each(|(force, _)| force.x -= size);
        }
        if let Some((stress, strain)) = self.strain {
            let stress = world.read(stress);
            let mut strain = world.write(strain);
            let points = strain.iter_mut().zip(&*stress);
            points.for_each(|(e, p)| *e -= self.compliance * p);
        }
        Ok(())
    }
}

/// A free bar of steel, 20 mm x 5 mm.
fn bar(keys: &str, surroundings: Surroundings, end: f64) -> Simulation {
    let body: Body = block([40, 10, 1], 2, 5e-4, Store::Lattice, STEEL);
    let mechanical: Mechanical = read(&format!("{keys}\nsolver.explicit = {{}}"));
    simulation(
        body,
        vec![Box::new(mechanical)],
        vec![Box::new(surroundings)],
        end,
    )
}

/// The error that stops a run.
fn error_of(mut s: Simulation, velocity: impl Fn([f64; 3]) -> [f64; 3]) -> String {
    set(&mut s, "velocity", velocity);
    s.start().expect("starts");
    while !s.is_finished() {
        if let Err(error) = s.step() {
            return error.to_string();
        }
    }
    panic!("it ends after {} steps", s.progress().sub_steps[0]);
}

/// Collapsing bonds, whose frequency is far above that of small strains.
fn chaos([x, y, _]: [f64; 3]) -> [f64; 3] {
    let (a, b) = (20_000.0 * x + 9_000.0 * y, 6e6 * x * y);
    [1000.0 * a.sin(), 1000.0 * b.cos(), 0.0]
}

const FINITE_BONDS: &str = "formulation = 'bond'\nkinematics = 'finite'";

#[test]
fn energy_that_grew_before_the_end_of_a_short_run_stops_it() {
    let error = error_of(bar(FINITE_BONDS, Surroundings::default(), 2.4e-4), chaos);
    assert!(
        error.contains("mechanical failed at t = 0.00024"),
        "{error}"
    );
    assert!(error.contains("without work being done on it"), "{error}");
}

#[test]
fn energy_that_grows_under_a_small_load_that_changes_stops_the_run() {
    let surroundings = Surroundings {
        ramp: 2e3,
        ..Surroundings::default()
    };
    let error = error_of(bar(FINITE_BONDS, surroundings, 2.4e-4), chaos);
    assert!(error.contains("without work being done on it"), "{error}");
}

#[test]
fn energy_from_heat_that_is_late_stops_the_run() {
    for formulation in FORMULATIONS {
        // alpha² T / (rho c) of steel with three times its expansion
        let surroundings = Surroundings {
            compliance: 3.6e-5 * 3.6e-5 * 300.0 / (7850.0 * 500.0),
            ..Surroundings::default()
        };
        let keys = format!("formulation = '{formulation}'\nstep = 4e-8");
        let s = bar(&keys, surroundings, 2e-3);
        let error = error_of(s, |[x, _, _]| [0.1 * x, 0.0, 0.0]);
        // bonds reach the limit of displacements between two samples of the energy
        let is_told = error.contains("time.iteration");
        let is_beyond = formulation == "bond" && error.contains("blew up");
        assert!(is_told || is_beyond, "{formulation}: {error}");
    }
}
