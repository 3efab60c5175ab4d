//! Highest temperatures, times, rates and gradients of points whose temperature a test sets.

use std::path::Path;

use super::*;
use crate::testing::{block, read};
use perimelt_core::body::Store;

const ALLOY: &str = "density = 7800\nsolidus = 1700\nliquidus = 1750";

/// A block whose temperature a test sets, with its history.
struct Heated {
    world: World,
    temperature: Write<f64>,
    history: RunningHistory,
    time: f64,
}

impl Heated {
    fn new(dimension: usize, keys: &str, initial: impl Fn(Vector3<f64>) -> f64) -> Self {
        let mut world = World::new(vec![block(
            [5, 4, 3],
            dimension,
            0.1,
            Store::Lattice,
            ALLOY,
        )]);
        let history: ThermalHistory = read(keys);
        let mut setup = Setup::new(&mut world, Path::new("."));
        setup.next_plugin("heat");
        let temperature = setup.own(0, &keys::TEMPERATURE).expect("free");
        setup.next_plugin("history");
        let history = history.prepare_history(&mut setup).expect("valid");
        setup.finish().expect("complete");
        let mut heated = Heated {
            world,
            temperature,
            history,
            time: 0.0,
        };
        heated.set(initial);
        heated.history.start(&heated.world).expect("it starts");
        heated
    }

    fn set(&mut self, temperature: impl Fn(Vector3<f64>) -> f64) {
        let positions = &self.world.body(0).points.position;
        let mut values = self.world.write(self.temperature);
        values
            .iter_mut()
            .zip(positions)
            .for_each(|(t, x)| *t = temperature(*x));
    }

    fn step(&mut self, size: f64, temperature: impl Fn(Vector3<f64>) -> f64) {
        self.set(temperature);
        let step = Step::new(self.time, size);
        self.history.advance(&self.world, step).expect("a step");
        self.time += size;
    }

    fn field(&self, name: &str) -> Vec<f64> {
        let fields = self.world.fields();
        let field = fields.find(0, name).expect("owned by the history");
        fields.field(field).data().flat().to_vec()
    }
}

#[test]
fn a_body_that_cools_evenly_solidifies_as_its_gradient_and_rate_say() {
    for dimension in 1..=3 {
        let slope = Vector3::new(300.0, 400.0, 1200.0);
        let rate = 250.0;
        let initial = |x: Vector3<f64>| {
            let along = (0..dimension).map(|a| slope[a] * x[a]).sum::<f64>();
            1800.0 + along
        };
        let mut heated = Heated::new(dimension, "", initial);
        // steps that end on no crossing
        for step in 1..=10 {
            heated.step(0.7, |x| initial(x) - rate * 0.7 * f64::from(step));
        }
        let gradient = slope.rows(0, dimension).norm();
        let positions = heated.world.body(0).points.position.to_vec();
        let close = |found: Vec<f64>, exact: &dyn Fn(Vector3<f64>) -> f64| {
            for (found, x) in found.iter().zip(&positions) {
                let exact = exact(*x);
                assert!((found - exact).abs() < 1e-9 * exact, "{found} for {exact}");
            }
        };
        close(heated.field("peak_temperature"), &initial);
        close(heated.field("time_above"), &|x| {
            (initial(x) - 1700.0) / rate
        });
        close(heated.field("cooling_time"), &|_| 300.0 / rate);
        close(heated.field("cooling_rate"), &|_| rate);
        close(heated.field("thermal_gradient"), &|_| gradient);
        close(heated.field("solidification_speed"), &|_| rate / gradient);
    }
}

#[test]
fn gradients_of_quadratic_fields_are_exact_also_at_faces() {
    for dimension in 1..=3 {
        let field = |x: Vector3<f64>| {
            let [x, y, z] = std::array::from_fn(|a| if a < dimension { x[a] } else { 0.0 });
            2.0 * x - y + 3.0 * z + 4.0 * x * x - 5.0 * y * y + 6.0 * z * z + x * y - y * z
        };
        let heated = Heated::new(dimension, "", field);
        let body = heated.world.body(0);
        let values: Vec<f64> = body.points.position.iter().map(|x| field(*x)).collect();
        let run = &heated.history;
        let images = images(body, &[]);
        let neighbourhood = Neighbourhood {
            body,
            list: &run.neighbours,
            images: &images,
        };
        for (i, x) in body.points.position.iter().enumerate() {
            let found = neighbourhood.gradient(i, |_| true, |j| values[j]);
            let exact = Vector3::new(
                2.0 + 8.0 * x.x + if dimension > 1 { x.y } else { 0.0 },
                -1.0 - 10.0 * x.y + x.x - if dimension > 2 { x.z } else { 0.0 },
                3.0 + 12.0 * x.z - x.y,
            );
            for axis in 0..dimension {
                let error = (found[axis] - exact[axis]).abs();
                assert!(error < 1e-9, "{dimension}D, {x:?}: {found:?}");
            }
        }
    }
}

/// A half behind a plane of symmetry and a period of a body have the gradients of the whole.
#[test]
fn gradients_see_the_images_of_points() {
    let of = |body: &Body, symmetry: &[Face], field: &dyn Fn(Vector3<f64>) -> f64| {
        let values: Vec<f64> = body.points.position.iter().map(|x| field(*x)).collect();
        let reach: Vec<f64> = body.points.spacing.iter().map(|s| RADIUS * s).collect();
        let neighbours = CellList::new(&body.points.position, &reach);
        let neighbourhood = Neighbourhood {
            body,
            list: &neighbours,
            images: &images(body, symmetry),
        };
        let gradient = |i| neighbourhood.gradient(i, |_| true, |j| values[j]);
        (0..values.len()).map(gradient).collect::<Vec<_>>()
    };
    let cells = |cells: [usize; 3]| block(cells, 3, 0.1, Store::Lattice, ALLOY);
    let at = |body: &Body, x: Vector3<f64>| {
        let close = |y: &Vector3<f64>| (y - x).norm() < 1e-9;
        body.points
            .position
            .iter()
            .position(close)
            .expect("a point")
    };
    // even about the plane x = 0.4 m of the whole, with kinks that a quadratic polynomial does not follow
    let (whole, half) = (cells([8, 4, 3]), cells([4, 4, 3]));
    let even = |x: Vector3<f64>| (9.0 * (x.x - 0.4).powi(2)).cos() + (7.0 * x.y).sin() + x.z;
    let (expected, found) = (of(&whole, &[], &even), of(&half, &[Face::XMax], &even));
    for (x, found) in half.points.position.iter().zip(&found) {
        let expected = expected[at(&whole, *x)];
        assert!(
            (found - expected).norm() < 1e-9,
            "{x:?}: {found} {expected}"
        );
    }
    // of five periods the middle one
    let (whole, mut period) = (cells([20, 4, 3]), cells([4, 4, 3]));
    period.periodic[0] = true;
    let wave = |x: Vector3<f64>| (std::f64::consts::TAU * x.x / 0.4).sin() + (7.0 * x.y).cos();
    let (expected, found) = (of(&whole, &[], &wave), of(&period, &[], &wave));
    for (x, found) in period.points.position.iter().zip(&found) {
        let expected = expected[at(&whole, x + Vector3::new(0.8, 0.0, 0.0))];
        assert!(
            (found - expected).norm() < 1e-9,
            "{x:?}: {found} {expected}"
        );
    }
}

#[test]
fn a_second_pass_replaces_the_cooling_time_of_the_first() {
    let mut heated = Heated::new(1, "above = 1000", |_| 1200.0);
    let cooling_time = |heated: &Heated| heated.field("cooling_time")[0];
    // above 800 °C again before 500 °C are reached
    heated.step(1.0, |_| 900.0);
    heated.step(1.0, |_| 1100.0);
    assert_eq!(cooling_time(&heated), 0.0);
    heated.step(1.0, |_| 773.15);
    assert!((cooling_time(&heated) - 300.0 / 326.85).abs() < 1e-12);
    // a pass that stays below 800 °C has no effect
    heated.step(1.0, |_| 1000.0);
    heated.step(5.0, |_| 600.0);
    assert!((cooling_time(&heated) - 300.0 / 326.85).abs() < 1e-12);
    heated.step(1.0, |_| 1100.0);
    heated.step(3.0, |_| 500.0);
    assert!((cooling_time(&heated) - 1.5).abs() < 1e-12);
    // of 1200 to 900, 900 to 1100, 1100 to 773.15, 600 to 1100, 1100 to 500, in 1, 1, 1, 1 and 3 s
    let above = 2.0 / 3.0 + 0.5 + 100.0 / 326.85 + 0.2 + 0.5;
    assert!((heated.field("time_above")[0] - above).abs() < 1e-12);
    assert_eq!(heated.field("peak_temperature")[0], 1200.0);
}

#[test]
fn every_solidification_has_its_times_and_is_counted() {
    let mut heated = Heated::new(1, "", |_| 1800.0);
    let told = |heated: &Heated| {
        let names = ["melting_time", "solidification_time", "solidifications"];
        names.map(|name| heated.field(name)[0])
    };
    assert_eq!(told(&heated), [0.0; 3]);
    // the liquidus of 1750 K after a quarter, three quarters and a half of a step
    heated.step(1.0, |_| 1600.0);
    assert_eq!(told(&heated), [0.0, 0.25, 1.0]);
    heated.step(2.0, |_| 1800.0);
    assert_eq!(told(&heated), [0.0, 0.25, 1.0]);
    heated.step(1.0, |_| 1700.0);
    assert_eq!(told(&heated), [2.5, 3.5, 2.0]);
}

#[test]
fn mistakes_are_refused() {
    for (keys, message) in [
        ("cooling = [700, 900]", "cannot cool from 700 to 900 K"),
        ("cooling = [700, 700]", "cannot cool from 700 to 700 K"),
        ("cooling = [700, 0]", "cannot cool from 700 to 0 K"),
        ("cooling = [inf, 700]", "cannot cool from inf to 700 K"),
        ("above = -3", "`above` is -3 K"),
        ("above = 0", "`above` is 0 K"),
        ("solidification = inf", "`solidification` is inf K"),
    ] {
        let history: ThermalHistory = read(keys);
        let found = history.check().expect_err("a mistake").to_string();
        assert!(found.contains(message), "{found}");
    }
}

/// A temperature on the level is not above it.
#[test]
fn a_level_is_passed_by_linear_temperatures_in_a_fraction_of_a_step() {
    for (before, after, passed, above) in [
        (900.0, 1100.0, Some(0.5), 0.5),
        (1100.0, 900.0, Some(0.5), 0.5),
        (950.0, 1150.0, Some(0.25), 0.75),
        (1150.0, 950.0, Some(0.75), 0.75),
        (1000.0, 1100.0, Some(0.0), 1.0),
        (1100.0, 1000.0, Some(1.0), 1.0),
        (900.0, 1000.0, None, 0.0),
        (1000.0, 900.0, None, 0.0),
        (1000.0, 1000.0, None, 0.0),
        (1100.0, 1200.0, None, 1.0),
        (900.0, 800.0, None, 0.0),
    ] {
        assert_eq!(crossing(before, after, 1000.0), passed, "{before} {after}");
        assert_eq!(
            fraction_above(before, after, 1000.0),
            above,
            "{before} {after}"
        );
    }
}

/// The state of a point is restored by a restart in the middle of its cooling.
#[test]
fn a_restart_goes_on_with_the_cooling() {
    let half = || {
        let mut heated = Heated::new(1, "", |_| 1173.15);
        heated.step(1.0, |_| 973.15);
        heated
    };
    let (first, mut second) = (half(), Heated::new(1, "", |_| 300.0));
    let saved = serde_json::to_string(&first.history.save(&first.world)).expect("serialises");
    let mut json = serde_json::Deserializer::from_str(&saved);
    let mut erased = <dyn erased_serde::Deserializer<'_>>::erase(&mut json);
    second
        .history
        .load(&second.world, &mut erased)
        .expect("what was saved");
    second.time = 1.0;
    second.step(1.0, |_| 773.15);
    // from 800 °C after half a second to 500 °C after two
    let found = second.field("cooling_time");
    assert!(found.iter().all(|t| (t - 1.5).abs() < 1e-12), "{found:?}");
}
