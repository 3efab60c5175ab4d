//! Inertia that is added across layers: what it leaves alone, its equation, and the step that it allows.

use perimelt_core::Body;
use perimelt_core::body::Stations;

use super::Laminate;
use super::failure_tests::strength_of;
use super::tests::{displaced, force, laminate, laminate_that_breaks, noise, plate};
use crate::mechanical::solid::{Solid, Stiffness};

const DENSITY: f64 = 1620.0;

/// Twelve plies much thinner than the spacing.
fn thin(stations: Stations) -> Body {
    let (angles, thickness) = ([0.0, 90.0].repeat(6), [2e-5, 4e-5, 2e-5].repeat(4));
    plate(&angles, &thickness, stations, 7)
}

/// A laminate that moves with its largest step, s.
fn in_motion(body: &Body, finite: bool) -> (Laminate, f64) {
    let mut laminate = laminate(body, finite);
    let density = vec![DENSITY; body.points.len()];
    let step = 2.0 / laminate.largest_frequency(&density, &[]);
    laminate.set_largest_step(step);
    (laminate, step)
}

#[test]
fn forces_keep_their_sums_and_moments_and_linear_motions_their_inertia() {
    let body = thin(Stations::Two);
    let (mut laminate, _) = in_motion(&body, true);
    let points = body.points.len();
    let inverse = vec![1.0 / DENSITY; 3 * points];
    let given = noise(3 * points);
    let mut left = given.clone();
    laminate.subtract_added_inertia(&inverse, &mut left);
    let largest = |a: &[f64], b: &[f64]| {
        let differences = a.iter().zip(b).map(|(a, b)| (a - b).abs());
        differences.fold(0.0, f64::max)
    };
    assert!(largest(&given, &left) > 0.1, "noise moves against inertia");
    let of_layer = points / laminate.layers.len();
    for component in 0..3 * of_layer {
        let moment = |power: i32| -> f64 {
            let layers = laminate.layers.iter().enumerate();
            let of_layer = layers.map(|(n, layer)| {
                let n_component = 3 * of_layer * n + component;
                let z = laminate.heights[n] / 1e-4;
                layer.thickness / 1e-4 * z.powi(power) * (given[n_component] - left[n_component])
            });
            of_layer.sum()
        };
        assert!(moment(0).abs() < 1e-13 && moment(1).abs() < 1e-13);
    }
    let linear = displaced(&body, |x, y, z| {
        [1.0 + z / 1e-4, x / 1e-3 * z / 1e-4, y / 1e-3]
    });
    let mut left = linear.clone();
    laminate.subtract_added_inertia(&inverse, &mut left);
    assert!(largest(&linear, &left) < 1e-12);
}

/// `f* = f - dt²/4 K'' a` with `a = f* / rho`, and no acceleration of held components.
#[test]
fn what_is_left_of_forces_is_the_mass_times_the_acceleration() {
    let body = thin(Stations::One);
    let (mut laminate, _) = in_motion(&body, false);
    let points = body.points.len();
    let layers = laminate.layers.len();
    let of_layer = points / layers;
    let mut inverse = vec![1.0 / DENSITY; 3 * points];
    // one component of the second layer, and a column but for its top
    let held = [3 * of_layer + 4, 9, 3 * of_layer + 9, 6 * of_layer + 9];
    held.iter().for_each(|component| inverse[*component] = 0.0);
    let given = noise(3 * points);
    let mut left = given.clone();
    laminate.subtract_added_inertia(&inverse, &mut left);
    let acceleration: Vec<f64> = left.iter().zip(&inverse).map(|(f, i)| f * i).collect();
    let own = &laminate.added_inertia;
    for component in 0..3 * of_layer {
        let at = |layer: usize| 3 * of_layer * layer + component;
        let mut expected: Vec<f64> = (0..layers).map(|layer| given[at(layer)]).collect();
        for first in 0..layers - 2 {
            let z = &laminate.heights[first..first + 3];
            let [below, above] = [1.0 / (z[1] - z[0]), 1.0 / (z[2] - z[1])];
            let b = [below, -below - above, above];
            let second: f64 = (0..3).map(|n| b[n] * acceleration[at(first + n)]).sum();
            for (n, b) in b.iter().enumerate() {
                let thickness = laminate.layers[first + n].thickness;
                expected[first + n] -= own.inertia_of(first) * b * second / thickness;
            }
        }
        for (layer, expected) in expected.iter().enumerate() {
            assert!(
                (left[at(layer)] - expected).abs() < 1e-12,
                "{component} {layer}"
            );
        }
    }
}

/// The largest eigenvalue of the stiffness over mass and added inertia, times the square of the step, is at most 4.
#[test]
fn the_largest_step_is_stable_and_that_of_the_plane() {
    for stations in [Stations::One, Stations::Two] {
        let body = thin(stations);
        let (mut laminate, step) = in_motion(&body, false);
        let points = body.points.len();
        let inverse = vec![1.0 / DENSITY; 3 * points];
        let mut mode = noise(3 * points);
        let mut largest = 0.0;
        for _ in 0..400 {
            let mut product = vec![0.0; mode.len()];
            laminate.set_displacement(&mode, &[]);
            laminate.stiffness(Stiffness::Elastic, &mut product);
            laminate.subtract_added_inertia(&inverse, &mut product);
            let size = product.iter().map(|k| k * k).sum::<f64>().sqrt();
            let before = mode.iter().map(|u| u * u).sum::<f64>().sqrt();
            largest = size / before / DENSITY;
            mode = product.iter().map(|k| k / size).collect();
        }
        let ratio = largest * step * step;
        assert!((1.5..4.0).contains(&ratio), "{stations:?}: {ratio}");
        let strength = strength_of(&body, "fracture_energy = 2e3\nshear_fracture_energy = 7e3");
        let mut breaks = laminate_that_breaks(&body, false, Some(strength));
        let density = vec![DENSITY; points];
        let of_waves = 2.0 / breaks.largest_frequency(&density, &[]);
        assert!(step > 2.0 * of_waves, "{step} {of_waves}");
        breaks.set_largest_step(of_waves);
        let given = force(&mut breaks, &mode);
        let mut left = given.clone();
        breaks.subtract_added_inertia(&inverse, &mut left);
        assert_eq!(given, left, "a laminate that breaks has no added inertia");
    }
}
