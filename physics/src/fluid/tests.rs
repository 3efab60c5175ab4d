mod moving;

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use nalgebra::Vector3;
use perimelt_core::body::{Body, Store};
use perimelt_core::family::{ByRules, Curved, LayerRule};
use perimelt_core::law::Law;
use perimelt_core::{
    Axis, Derivatives, Face, Family, FamilySpec, Horizon, Influence, Pddo, Physics, RunError,
    Simulation, SlotField,
};

use super::Fluid;
use super::medium::Medium;
use super::rates::{LargestSums, Stability};
use super::run::FluidRun;
use super::state::StateLaw;
use super::treatments::{Neighbours, Treatments};
use super::viscosity::Viscosity;
use crate::shape_tensor::CompleteFamily;
use crate::testing::{block, read, run, set, simulation, values};
use crate::thermal::Thermal;

/// A square of 1 m, periodic along both axes, with `n` points along each.
pub(super) fn periodic(n: usize, material: &str) -> Body {
    let mut body = block([n, n, 1], 2, 1.0 / n as f64, Store::Lattice, material);
    body.repeat(&[Axis::X, Axis::Y]).expect("it fills its box");
    body
}

/// A box of 1 m with `n` points along each axis, of which the faces `mirrored` are planes of symmetry and the others periodic.
pub(super) struct MirroredBox<'a> {
    pub(super) dimension: usize,
    pub(super) n: usize,
    pub(super) mirrored: &'a [Face],
    /// Spacings.
    pub(super) horizon: f64,
    /// Pa s.
    pub(super) viscosity: f64,
}

/// A fluid of 2 kg/m³ in such a box.
pub(super) struct Filled {
    pub(super) body: Body,
    pub(super) family: Arc<Family>,
    pub(super) complete: CompleteFamily,
    pub(super) medium: Medium,
    /// Of the velocity.
    pub(super) rules: Vec<LayerRule>,
}

impl MirroredBox<'_> {
    pub(super) fn fill(&self, name: &'static str, state: Box<dyn StateLaw>) -> Filled {
        let (dimension, mirrored) = (self.dimension, self.mirrored);
        let cells = std::array::from_fn(|a| if a < dimension { self.n } else { 1 });
        let spacing = 1.0 / self.n as f64;
        let fluid = format!("density = 2\nviscosity = {}", self.viscosity);
        let mut body = block(cells, dimension, spacing, Store::Lattice, &fluid);
        let closed = |axis: &Axis| mirrored.iter().any(|f| f.axis() == axis.index());
        let axes = Axis::ALL.into_iter().take(dimension);
        let axes: Vec<Axis> = axes.filter(|a| !closed(a)).collect();
        body.repeat(&axes).expect("it fills its box");
        let spec = FamilySpec {
            influence: Influence::Wendland,
            layers: mirrored.to_vec(),
            ..Pddo::spec(Horizon::Spacings(self.horizon))
        };
        let family = Arc::new(Family::build(&body, &spec).expect("a family"));
        let viscosity = Viscosity::new(None, &body, false).expect("a viscosity");
        let state = Law { name, law: state };
        let points = body.points.len();
        let rules = mirrored.iter().map(|f| LayerRule {
            scale: std::array::from_fn(|a| if a == f.axis() { -1.0 } else { 1.0 }),
            ..LayerRule::even(*f)
        });
        Filled {
            complete: CompleteFamily::of(&body, &family),
            medium: Medium::new(state, viscosity, vec![2.0; points], vec![spacing; points]),
            rules: rules.collect(),
            family,
            body,
        }
    }
}

pub(super) fn flow(body: Body, keys: &str, end: f64) -> Simulation {
    let fluid: Fluid = read(keys);
    simulation(body, vec![Box::new(fluid)], Vec::new(), end)
}

fn taylor_green([x, y, _]: [f64; 3]) -> [f64; 3] {
    let v = 0.04;
    [
        -v * (TAU * x).cos() * (TAU * y).sin(),
        v * (TAU * x).sin() * (TAU * y).cos(),
        0.0,
    ]
}

/// Points of an updated Lagrangian fluid in a stream along x, with a disturbance, for `steps` of 2 ms.
fn stream(keys: &str, steps: u32) -> Simulation {
    let keys = format!("state.tait.sound_speed = 10\nstep = 2e-3\n{keys}");
    let mut s = flow(
        periodic(16, "density = 2\nviscosity = 0.05"),
        &keys,
        f64::from(steps) * 2e-3,
    );
    set(&mut s, "velocity", |[x, y, _]| {
        [1.0 + 0.2 * (TAU * y).sin(), 0.2 * (TAU * x).sin(), 0.0]
    });
    s
}

/// docs/theory/fluids.md, "Array of vortices": the discrete operator lets vortices of 40 points a side decay at
/// 0.985262 times the rate 8 pi^2.
#[test]
fn vortices_decay_at_the_rate_of_the_discrete_operator() {
    for (description, tolerance) in [
        ("total_lagrangian", 2e-4),
        ("eulerian", 2e-3),
        ("updated_lagrangian", 4e-3),
    ] {
        let keys = format!(
            "description = '{description}'\nhorizon = 3.015\nstate.tait.sound_speed = 0.4\nstep = 5e-5"
        );
        let body = periodic(40, "density = 1\nviscosity = 1");
        let mut s = flow(body, &keys, 0.01);
        set(&mut s, "velocity", taylor_green);
        let before = values(&s, "velocity");
        run(&mut s);
        let after = values(&s, "velocity");
        // forward steps
        let steps = 200;
        let expected = (1.0 - 0.985262 * 8.0 * PI * PI * 0.01 / f64::from(steps)).powi(steps);
        for (v0, v) in before.iter().zip(&after) {
            // convection and its pressure are left over in the Eulerian description, and the way of the points
            // in the updated Lagrangian one
            assert!(
                (v - expected * v0).abs() < tolerance * 0.04,
                "{description}: {v} {v0}"
            );
        }
    }
}

/// Energy of sound over its energy at the start, after 20 periods of a standing wave.
pub(super) fn ringing(keys: &str) -> f64 {
    ringing_in_a_stream(&format!("{keys}\nstep = 0.01"), 0.0)
}

/// [`ringing`] in a fluid that flows with this speed, m/s.
fn ringing_in_a_stream(keys: &str, speed: f64) -> f64 {
    let keys = format!("{keys}\nstate.tait = {{ sound_speed = 1, exponent = 1 }}");
    let mut s = flow(periodic(16, "density = 1\nviscosity = 1e-9"), &keys, 20.0);
    let amplitude = 1e-6;
    set(
        &mut s,
        "pressure",
        |[x, _, _]| [amplitude * (TAU * x).cos()],
    );
    set(&mut s, "velocity", |_| [speed, 0.0, 0.0]);
    s.start().expect("starts");
    while !s.is_finished() {
        s.step().expect("steps");
    }
    let pressure = values(&s, "pressure");
    let velocity = values(&s, "velocity");
    let along = velocity.iter().step_by(3).map(|v| (v - speed).powi(2));
    let square = pressure.iter().map(|p| p * p).chain(along).sum::<f64>();
    square / (0.5 * 256.0 * amplitude * amplitude)
}

#[test]
fn a_stream_neither_amplifies_nor_damps_sound_at_the_automatic_step() {
    let schemes = ["symplectic", "kick_drift_kick"];
    let forms = ["differences", "conservative"];
    for (scheme, form) in schemes.into_iter().flat_map(|s| forms.map(|f| (s, f))) {
        let keys = format!(
            "description = 'eulerian'\nconvection = 'central'\nscheme = '{scheme}'\nform = '{form}'"
        );
        let energy = ringing_in_a_stream(&keys, 0.1);
        // values at the start of the step: more than 2
        assert!((energy - 1.0).abs() < 0.2, "{scheme}, {form}: {energy}");
    }
}

#[test]
fn sound_keeps_its_energy_but_in_the_published_scheme() {
    for keys in [
        "description = 'eulerian'",
        "description = 'eulerian'\nscheme = 'kick_drift_kick'",
        "form = 'conservative'",
        "form = 'conservative'\nscheme = 'kick_drift_kick'",
        "form = 'conservative'\ndescription = 'eulerian'",
    ] {
        let energy = ringing(keys);
        // the energy of a symplectic scheme swings by w dt
        assert!((energy - 1.0).abs() < 0.1, "{keys}: {energy}");
    }
    // 1 + (w dt)^2 in each step of energy: over 2000 steps
    assert!(ringing("description = 'eulerian'\nscheme = 'published'") > 10.0);
}

#[test]
fn an_eulerian_fluid_keeps_mass_and_momentum_in_a_periodic_box_to_rounding() {
    for form in ["differences", "conservative"] {
        let keys = format!(
            "description = 'eulerian'\nform = '{form}'\nstate.tait.sound_speed = 0.4\ndensity_diffusion = 0.1\nstep = 1e-3"
        );
        let mut s = flow(periodic(12, "density = 1000\nviscosity = 1"), &keys, 0.1);
        set(&mut s, "velocity", |[x, y, _]| {
            [0.03 * (TAU * x).sin(), 0.02 * (TAU * (x + y)).cos(), 0.0]
        });
        run(&mut s);
        let spread = values(&s, "density")
            .iter()
            .fold(0.0_f64, |m, rho| m.max((rho - 1000.0).abs()));
        assert!(spread > 1.0, "it was compressed: {spread}");
        for balance in &s.balances()[0].1 {
            assert!(balance.relative_error() < 1e-12, "{form}: {balance:?}");
        }
    }
}

#[test]
fn viscosity_that_falls_with_temperature_makes_an_uneven_shear() {
    // mu v' is constant where v does not change: with mu = 1 + sin, force-free
    let material = "density = 1\nviscosity = { temperature = [1, 3], value = [0.5, 1.5] }\nspecific_heat = 1e6\nconductivity = 1e-6";
    for form in [
        "description = 'eulerian'",
        "description = 'eulerian'\nform = 'conservative'",
        "description = 'updated_lagrangian'\nform = 'conservative'",
    ] {
        let keys = format!("{form}\nstate.tait.sound_speed = 10\nstep = 1e-5");
        let fluid: Fluid = read(&keys);
        let thermal: Thermal = read("step = 1e-5");
        let physics: Vec<Box<dyn Physics>> = vec![Box::new(fluid), Box::new(thermal)];
        let mut s = simulation(periodic(40, material), physics, Vec::new(), 1e-5);
        set(&mut s, "temperature", |[_, y, _]| [2.0 + (TAU * y).sin()]);
        set(&mut s, "velocity", |[_, y, _]| {
            [1e-3 * (TAU * y).cos(), 0.0, 0.0]
        });
        let before = values(&s, "velocity");
        run(&mut s);
        let places = s.world().body(0).points.position.to_vec();
        let after = values(&s, "velocity");
        for (i, x) in places.iter().enumerate() {
            let rate = (after[3 * i] - before[3 * i]) / 1e-5;
            // (mu v')' with mu = 1 + 0.5 sin(2 pi y)
            let exact = -1e-3
                * TAU
                * TAU
                * ((TAU * x.y).cos() * (1.0 + 0.5 * (TAU * x.y).sin())
                    + 0.5 * (TAU * x.y).cos() * (TAU * x.y).sin());
            assert!(
                (rate - exact).abs() < 0.03 * 1e-3 * TAU * TAU * 1.5,
                "{form}: {rate} {exact}"
            );
        }
    }
}

#[test]
fn a_face_without_a_wall_is_refused() {
    let mut body = block(
        [8, 8, 1],
        2,
        1.0,
        Store::Lattice,
        "density = 1\nviscosity = 1",
    );
    body.repeat(&[Axis::X]).expect("it fills its box");
    let mut world = perimelt_core::World::new(vec![body]);
    let mut setup = perimelt_core::Setup::new(&mut world, std::path::Path::new("."));
    setup.next_plugin("fluid");
    let fluid: Fluid = read("description = 'eulerian'\nstate.tait.sound_speed = 1");
    let error = FluidRun::prepare(fluid, &mut setup).expect_err("y is open");
    assert!(error.to_string().contains("`y-`"), "{error}");
}

#[test]
fn a_restart_comes_to_the_same_steps() {
    let crowded = || {
        let keys = "form = 'conservative'\nstate.tait.sound_speed = 10";
        let body = periodic(16, "density = 2\nviscosity = 0.05");
        let mut s = flow(body, keys, 0.4);
        set(&mut s, "velocity", |[_, y, _]| {
            [0.5 * (TAU * y).sin(), 0.0, 0.0]
        });
        s
    };
    let mut whole = crowded();
    run(&mut whole);
    let mut resumed = crowded();
    resumed
        .load(&whole.save().expect("it can be saved"))
        .expect("its own");
    assert_eq!(resumed.stable_steps(), whole.stable_steps());
}

#[test]
fn convection_smooths_only_what_is_not_resolved() {
    let amplitude = |viscosity: f64, waves: f64, keys: &str| {
        let keys =
            format!("description = 'eulerian'\nstate.tait.sound_speed = 10\nstep = 2e-3\n{keys}");
        let body = periodic(16, &format!("density = 1\nviscosity = {viscosity}"));
        let mut s = flow(body, &keys, 1.0);
        set(&mut s, "velocity", |[_, y, _]| {
            [
                1.0 + 0.01 * (waves * TAU * (y - 1.0 / 32.0)).cos(),
                0.0,
                0.0,
            ]
        });
        s.start().expect("starts");
        while !s.is_finished() {
            s.step().expect("steps");
        }
        let velocity = values(&s, "velocity");
        let along = velocity.iter().step_by(3).map(|v| (v - 1.0).abs() / 0.01);
        along.fold(0.0, f64::max)
    };
    let keys = ["", "convection = 'central'"];
    // speed times spacing is six times the viscosity
    let [hybrid, central] = keys.map(|keys| amplitude(0.01, 8.0, keys));
    assert_eq!(hybrid, central);
    // it is 62 times the viscosity; waves of two spacings, and of sixteen
    let [hybrid, central] = keys.map(|keys| amplitude(1e-3, 8.0, keys));
    assert!(hybrid < 0.1 && central > 0.3, "{hybrid} {central}");
    let [hybrid, central] = keys.map(|keys| amplitude(1e-3, 1.0, keys));
    assert!(
        hybrid > 0.99 * central && hybrid < central,
        "{hybrid} {central}"
    );
}

#[test]
fn a_run_that_blows_up_names_physics_field_and_point() {
    for keys in ["", "form = 'conservative'"] {
        let mut s = stream(keys, 100);
        let blown = |x: [f64; 3]| match x[0] < 0.1 && x[1] < 0.1 {
            true => [f64::INFINITY, 0.0, 0.0],
            false => [1.0, 0.0, 0.0],
        };
        set(&mut s, "velocity", blown);
        let mut result = s.start();
        while result.is_ok() && !s.is_finished() {
            result = s.step().map(|_| ());
        }
        let error = result.expect_err("nothing of it is finite");
        assert!(
            matches!(&error, RunError::BlowUp { physics, field, .. } if physics == "fluid" && field == "velocity"),
            "{keys}: {error}"
        );
    }
}

#[test]
fn the_stable_step_follows_the_arrangement_of_the_points() {
    let material = "density = 2\nviscosity = 0.05";
    let body = block([12, 12, 1], 2, 0.1, Store::Lattice, material);
    let points = body.points.len();
    let mut family = Family::moving(&body, &Pddo::spec(Horizon::Spacings(3.015))).expect("valid");
    let initial = LargestSums::of(&family, points, None);
    let stability = Stability {
        wave_number: 1.0,
        laplacian: 1.0,
    };
    // points that crowd without a change of their volumes, and points that spread
    for (scale, grows) in [(0.9, true), (1.1, false)] {
        let positions = body.points.position.iter().map(|x| x * scale);
        let positions: Vec<_> = positions.collect();
        family.rebuild_rows(&positions);
        family.update_weights(&positions, &body.points.volume);
        let now = stability.scaled(initial, LargestSums::of(&family, points, None));
        // the sum goes with the number of points in the horizon
        let expected = if grows { 1.1..1.35 } else { 1.0..1.0 + 1e-9 };
        assert!(expected.contains(&now.laplacian), "{scale}: {now:?}");
        assert!(
            now.wave_number >= 1.0 && grows == (now.wave_number > 1.01),
            "{now:?}"
        );
    }
}

#[test]
fn curved_layers_continue_a_parabola() {
    let material = "density = 2\nviscosity = 0.05";
    let body = block([12, 6, 1], 2, 0.1, Store::Lattice, material);
    let field = |x: f64| 1.0 + 2.0 * x + 3.0 * x * x;
    let ends = [Face::XMin, Face::XMax];
    let rule = |face| LayerRule {
        scale: [-1.0; 3],
        offset: [2.0 * field(body.face_position(face)); 3],
        ..LayerRule::even(face)
    };
    let rules = ends.map(rule);
    let spec = FamilySpec {
        layers: ends.to_vec(),
        ..Pddo::spec(Horizon::Spacings(3.015))
    };
    let family = std::sync::Arc::new(Family::build(&body, &spec).expect("valid"));
    let pddo = Pddo::build(&body, family.clone(), 2).expect("valid");
    let values: Vec<f64> = body.points.position.iter().map(|x| field(x.x)).collect();
    let (mut slots, mut laplacian) = (SlotField::default(), Vec::new());
    slots.load(&family, &values[..], Curved(ByRules(&rules, 0)));
    pddo.laplacian(&slots, &mut Derivatives::default(), &mut laplacian);
    assert!(
        laplacian.iter().all(|l| (l - 6.0).abs() < 1e-9),
        "{laplacian:?}"
    );
}
