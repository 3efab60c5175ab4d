//! A window of fine points that moves over a plate: heat is kept to rounding, whatever crosses its faces; a uniform
//! temperature stays uniform; runs go on bit by bit, on any number of threads.

use std::path::Path;

use perimelt::case::Case;
use perimelt::core::Simulation;
use proptest::prelude::*;

/// A plate with a window that follows a source of this power (W), which is on the window.
struct Track {
    dimension: usize,
    horizon: usize,
    ratio: usize,
    conductivity: &'static str,
    temperature: String,
    power: f64,
    /// Of the source along x and y, in cells of the plate.
    to: [f64; 2],
}

impl Track {
    /// Cells of the plate are 1 mm; the window covers four of them along each axis, from 2 mm on, below the top.
    fn compose(&self) -> Simulation {
        let (top, bottom) = match self.dimension {
            2 => (1.0, 0.0),
            _ => (0.0, -8.0),
        };
        let window = if self.dimension == 2 { bottom } else { -4.0 };
        let body = |name: &str, low: [f64; 3], high: [f64; 3], spacing: f64| {
            let mm = |x: [f64; 3]| x.map(|x| x * 1e-3);
            format!(
                "[bodies.{name}]
                shape.box = {{ min = {:?}, max = {:?} }}
                dimension = {}
                thickness = 1e-3
                spacing = {}
                material = 'metal'
                initial.temperature = \"{}\"
                [[physics]]
                type = 'thermal'
                body = '{name}'
                horizon = {}
                [[couplers]]
                type = 'phase_change'
                body = '{name}'\n",
                mm(low),
                mm(high),
                self.dimension,
                spacing * 1e-3,
                self.temperature,
                self.horizon
            )
        };
        let text = format!(
            "{}{}
            [materials.metal]
            density = 8000
            specific_heat = 500
            conductivity = {}
            solidus = 1700
            liquidus = 1750
            latent_heat = 2.5e5
            [[couplers]]
            type = 'moving_refinement'
            body = 'plate'
            fine = 'window'
            follow = 'torch'
            [[couplers]]
            type = 'gaussian_source'
            name = 'torch'
            body = 'window'
            power = {:e}
            sigma = 4e-4
            {}
            toolpath.line = {{ start = [4e-3, 4e-3, {top}e-3], end = [{}e-3, {}e-3, {top}e-3], speed = 0.02 }}
            [time]
            end = 0.4
            [log]
            interval = 0.1",
            body("plate", [0.0, 0.0, bottom], [12.0, 9.0, top], 1.0),
            body("window", [2.0, 2.0, window], [6.0, 6.0, top], 1.0 / self.ratio as f64),
            self.conductivity,
            self.power,
            if self.dimension == 3 { "effective_depth = 1e-3" } else { "" },
            self.to[0],
            self.to[1],
        );
        let case = Case::parse("window.toml", text, Path::new("")).expect("a valid case");
        let composed = case.compose();
        let mut simulation = composed.unwrap_or_else(|e| panic!("{}", e.render(false)));
        simulation.start().expect("it starts");
        simulation
    }
}

/// A plate with a hot spot, which the window crosses.
fn hot_spot(horizon: usize, ratio: usize, dimension: usize) -> Track {
    Track {
        dimension,
        horizon,
        ratio,
        conductivity: "{ temperature = [300, 2000], value = [20, 60] }",
        temperature: "300 + 2000 * exp(-((x - 0.006)^2 + (y - 0.004)^2) / 2e-6)".into(),
        power: 100.0,
        to: [12.0, 7.0],
    }
}

/// Stored heat, heat at the start, and heat supplied, of both bodies together, J.
fn heat(simulation: &Simulation) -> [f64; 3] {
    let balances = simulation.balances();
    let all = balances.iter().flat_map(|(_, balances)| balances);
    all.fold([0.0; 3], |[stored, initial, supplied], b| {
        [
            stored + b.stored,
            initial + b.initial,
            supplied + b.supplied,
        ]
    })
}

/// Energy of the torch, J.
fn energy(simulation: &Simulation) -> f64 {
    let reports = simulation.reports();
    let all = reports.iter().flat_map(|(_, reports)| reports);
    all.filter(|r| r.name == "energy.deposited")
        .map(|r| r.value)
        .sum()
}

fn finish(simulation: &mut Simulation) {
    while !simulation.is_finished() {
        simulation.step().expect("it goes on");
    }
}

/// Largest error of the heat of both bodies, over their heat.
fn drift(simulation: &mut Simulation) -> f64 {
    let mut largest: f64 = 0.0;
    while !simulation.is_finished() {
        simulation.step().expect("it goes on");
        let [stored, initial, supplied] = heat(simulation);
        let error = stored - initial - energy(simulation);
        largest = largest.max(error.abs().max((stored - initial - supplied).abs()) / stored);
    }
    largest
}

#[test]
fn heat_of_a_hot_spot_that_the_window_crosses_is_kept_to_rounding() {
    for (horizon, ratio, dimension) in [(1, 4, 3), (2, 2, 3), (3, 4, 2), (3, 2, 2), (1, 3, 2)] {
        let mut simulation = hot_spot(horizon, ratio, dimension).compose();
        let drift = drift(&mut simulation);
        assert!(drift < 1e-13, "{horizon} {ratio} {dimension}: {drift}");
        // steps of the simulation bound both bodies where horizons are long or spacings close
        let sub_steps = &simulation.progress().sub_steps;
        let has_sub_steps = sub_steps[1] > sub_steps[0];
        assert!(has_sub_steps || (horizon, ratio) != (1, 4), "{sub_steps:?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]
    #[test]
    fn heat_is_kept_on_any_path(horizon in 1usize..4, ratio in 2usize..5, x in 2.0..14.0f64, y in -2.0..12.0f64) {
        let mut track = hot_spot(horizon, ratio, 2);
        track.to = [x, y];
        let drift = drift(&mut track.compose());
        prop_assert!(drift < 1e-13, "{drift}");
    }
}

#[test]
fn a_uniform_temperature_stays_uniform_while_the_window_moves() {
    for horizon in [1, 3] {
        let track = Track {
            temperature: "1000".into(),
            power: 1e-12,
            ..hot_spot(horizon, 4, 3)
        };
        let mut simulation = track.compose();
        finish(&mut simulation);
        for (body, moves) in [(0, false), (1, true)] {
            let world = simulation.world();
            let field = world
                .fields()
                .find(body, "temperature")
                .expect("it has one");
            let data = world.fields().field(field).data();
            let largest = data
                .flat()
                .iter()
                .map(|t| (t - 1000.0).abs())
                .fold(0.0, f64::max);
            assert!(largest < 1e-8, "{horizon} {body}: {largest}");
            assert_eq!(world.window_shift(body).norm() > 1e-3, moves);
        }
    }
}

/// Temperatures of both bodies.
fn state(simulation: &Simulation) -> Vec<f64> {
    let fields = simulation.lasting();
    fields.flat_map(|f| f.data().flat().to_vec()).collect()
}

#[test]
fn a_window_on_its_way_goes_on_bit_by_bit_on_any_number_of_threads() {
    let on = |threads: usize, run: &(dyn Fn() -> Vec<f64> + Sync)| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        pool.build().expect("a pool").install(run)
    };
    let whole = || {
        let mut simulation = hot_spot(2, 4, 3).compose();
        finish(&mut simulation);
        state(&simulation)
    };
    let expected = on(1, &whole);
    assert!(expected == on(3, &whole));
    let halves = || {
        let mut first = hot_spot(2, 4, 3).compose();
        while first.time() < 0.2 {
            first.step().expect("it goes on");
        }
        assert!(first.world().window_shift(1).norm() > 1e-3);
        let saved = first.save().expect("it is saved");
        let mut second = hot_spot(2, 4, 3).compose();
        second.load(&saved).expect("it is loaded");
        finish(&mut second);
        state(&second)
    };
    assert!(expected == on(2, &halves));
}
