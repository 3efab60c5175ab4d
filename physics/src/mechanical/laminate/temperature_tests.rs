//! Laminates whose constants and strengths follow the temperature and the material of their points.

use perimelt_core::Body;
use perimelt_core::body::Stations;

use super::failure_tests::strength_of;
use super::tests::{
    GRAPHITE, SPACING, displaced, energy, force, laminate_that_breaks, noise, plate,
};
use super::*;
use crate::mechanical::solid::{
    PointModuli, PointStates, Solid, Stiffness, StressFreeStrain, StressKind, Wanted,
};
use crate::testing::material;

/// Constants by name at 300 and 600 K.
const CONSTANTS: [(&str, [f64; 2]); 7] = [
    ("youngs_modulus_1", [181e9, 150e9]),
    ("youngs_modulus_2", [10.3e9, 5e9]),
    ("poissons_ratio_12", [0.28, 0.33]),
    ("shear_modulus_12", [7.17e9, 2e9]),
    ("shear_modulus_13", [2e9, 0.7e9]),
    ("shear_modulus_23", [1.3e9, 0.4e9]),
    ("youngs_modulus_3", [3.4e9, 1.2e9]),
];

/// Strengths by name at 300 and 600 K.
const STRENGTHS: [(&str, [f64; 2]); 4] = [
    ("fracture_energy", [1.0, 0.4]),
    ("shear_fracture_energy", [2.0, 0.5]),
    ("tensile_strength_1", [1e8, 0.7e8]),
    ("compressive_strength_1", [0.9e8, 0.5e8]),
];

/// Keys of a material with these values by the temperature, and with those at 450 K.
fn keys(values: &[(&str, [f64; 2])]) -> [String; 2] {
    let table = values.iter().map(|(name, [cold, hot])| {
        format!("{name} = {{ temperature = [300, 600], value = [{cold:e}, {hot:e}] }}\n")
    });
    let middle = values
        .iter()
        .map(|(name, [cold, hot])| format!("{name} = {:e}\n", 0.5 * (cold + hot)));
    [table.collect(), middle.collect()]
}

fn set_temperature(laminate: &mut Laminate, body: &Body, temperature: &[f64]) {
    laminate.set_points(PointStates {
        moduli: Some(PointModuli::At(body, Some(temperature))),
        ..PointStates::default()
    });
}

/// Temperatures that differ from point to point by any amount, K.
fn uneven(body: &Body) -> Vec<f64> {
    let numbers = noise(body.points.len());
    numbers.iter().map(|n| 450.0 + 200.0 * n).collect()
}

/// Three plies of a material by the temperature.
fn heated_plate() -> Body {
    let mut body = plate(&[0.0, 45.0, 90.0], &[1e-3, 0.5e-3, 1e-3], Stations::Two, 6);
    body.materials = vec![material(&keys(&CONSTANTS)[0])];
    body
}

fn set_free_strain(laminate: &mut Laminate, factor: f64) {
    let points = laminate.displacement.len();
    let strain: Vec<[f64; 6]> = noise(6 * points)
        .chunks(6)
        .map(|c| std::array::from_fn(|i| if i < 4 { factor * c[i] } else { 0.0 }))
        .collect();
    laminate.set_points(PointStates {
        eigenstrain: Some(&vec![0.0; points]),
        stress_free: Some(StressFreeStrain {
            strain: &strain,
            prescribed: &strain,
        }),
        ..PointStates::default()
    });
}

/// At one temperature everywhere, forces, energies, stresses and breaks are those of the numbers at that temperature.
#[test]
fn a_uniform_temperature_has_the_constants_and_strengths_at_it() {
    let close = |found: &[f64], expected: &[f64]| {
        let size = expected.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        let mut both = found.iter().zip(expected);
        both.all(|(a, b)| (a - b).abs() < 1e-12 * size)
    };
    for finite in [false, true] {
        let mut found = Vec::new();
        for number in 0..2 {
            let mut body = heated_plate();
            body.materials = vec![material(&keys(&CONSTANTS)[number])];
            let strength = strength_of(&body, &keys(&STRENGTHS)[number]);
            let mut laminate = laminate_that_breaks(&body, finite, Some(strength));
            let points = body.points.len();
            set_temperature(&mut laminate, &body, &vec![450.0; points]);
            set_free_strain(&mut laminate, 1e-4);
            let state: Vec<f64> = noise(3 * points).iter().map(|u| 1e-5 * u).collect();
            let forces = force(&mut laminate, &state);
            let energy = energy(&body, &mut laminate, &state);
            let stress = laminate
                .evaluate(Wanted::stress(StressKind::Conjugate))
                .stress;
            let stress = stress.concat();
            let blocks = laminate.blocks().concat();
            let mut damage = vec![0.0; points];
            laminate.break_bonds(0.0, &mut damage);
            let broken: Vec<f64> = laminate.failure_modes().iter().map(|m| m.broken).collect();
            assert!(broken.iter().all(|broken| *broken > 0.0), "{broken:?}");
            found.push((forces, energy, stress, blocks, broken, damage));
        }
        let [first, second] = &found[..] else {
            panic!("two laminates");
        };
        assert!(close(&first.0, &second.0));
        assert!((first.1 / second.1 - 1.0).abs() < 1e-12);
        assert!(close(&first.2, &second.2));
        assert!(close(&first.3, &second.3));
        assert_eq!((&first.4, &first.5), (&second.4, &second.5));
    }
}

/// In any field of the temperature forces keep the momentum and are the derivative of the energy by displacements, and the conjugate stress
/// that by stress-free strains; the stiffness is symmetric.
#[test]
fn forces_between_points_of_different_temperatures_are_the_derivative_of_one_energy() {
    let body = heated_plate();
    let count = 3 * body.points.len();
    let volume = |component: usize| body.points.volume[component / 3];
    for (finite, size) in [(false, 1e-5), (true, 2e-4)] {
        let mut laminate = laminate_that_breaks(&body, finite, None);
        set_temperature(&mut laminate, &body, &uneven(&body));
        set_free_strain(&mut laminate, 1e-3);
        let state: Vec<f64> = noise(count).iter().map(|u| size * u).collect();
        let direction = noise(count + 5).split_off(5);
        let forces = force(&mut laminate, &state);
        let each = || (0..count).map(|i| forces[i] * volume(i));
        let largest: f64 = each().map(f64::abs).sum();
        for axis in 0..3 {
            let total: f64 = each().skip(axis).step_by(3).sum();
            assert!(total.abs() < 1e-12 * largest, "{finite}: momentum {total}");
        }
        let power: f64 = each().zip(&direction).map(|(f, d)| f * d).sum();
        let step = 1e-8;
        let [up, down] = [1.0, -1.0].map(|sign| {
            let moved = state
                .iter()
                .zip(&direction)
                .map(|(u, d)| u + sign * step * d);
            energy(&body, &mut laminate, &moved.collect::<Vec<f64>>())
        });
        let rate = (up - down) / (2.0 * step);
        assert!(
            (rate / -power - 1.0).abs() < 1e-6,
            "{finite}: {rate} {power}"
        );

        // the strain of `set_free_strain`, whose energy is at most quadratic
        let [up, down] = [1e-3, -1e-3].map(|factor| {
            set_free_strain(&mut laminate, factor);
            energy(&body, &mut laminate, &state)
        });
        set_free_strain(&mut laminate, 0.0);
        laminate.set_displacement(&state, &[]);
        let stress = laminate.evaluate(Wanted::stress(StressKind::Conjugate));
        let strain = noise(2 * count);
        let work: f64 = (stress.stress.iter().zip(strain.chunks(6)))
            .zip(&body.points.volume)
            .map(|((s, e), volume)| {
                let normal: f64 = (0..3).map(|c| s[c] * e[c]).sum();
                1e-3 * volume * (normal + 2.0 * s[3] * e[3])
            })
            .sum();
        let lost = 0.5 * (down - up);
        assert!((lost / work - 1.0).abs() < 1e-8, "{finite}: {lost} {work}");

        let mut product = |u: &[f64], v: &[f64]| -> f64 {
            laminate.set_displacement(u, &[]);
            let mut stiffness = vec![0.0; count];
            laminate.stiffness(Stiffness::Elastic, &mut stiffness);
            (0..count).map(|i| stiffness[i] * v[i] * volume(i)).sum()
        };
        let (one, other) = (product(&state, &direction), product(&direction, &state));
        assert!((one / other - 1.0).abs() < 1e-10, "{one} {other}");
    }
}

/// Plies of two materials: the interface between them has both in series, and each ply its own stiffness.
#[test]
fn plies_of_two_materials_have_their_moduli_in_series_between_them() {
    let mut body = plate(&[0.0, 0.0], &[1e-3, 1e-3], Stations::One, 21);
    let glass = GRAPHITE
        .replace("181e9", "39e9")
        .replace("shear_modulus_13 = 2e9", "shear_modulus_13 = 3e9")
        .replace("3.4e9", "9e9");
    body.materials.push(material(&glass));
    let points = body.points.len() / 2;
    body.material_of_point[points..].fill(1);
    let mut laminate = laminate_that_breaks(&body, false, None);
    let shifted = displaced(&body, |_, _, z| {
        [1e-6, 0.0, 3e-6].map(|d| d * f64::from(u8::from(z > 0.0)))
    });
    let found = force(&mut laminate, &shifted);
    let series = |a: f64, b: f64| 2.0 / (1.0 / a + 1.0 / b);
    let middle = points / 2;
    for (axis, modulus, shift) in [(0, series(2e9, 3e9), 1e-6), (2, series(3.4e9, 9e9), 3e-6)] {
        let expected = modulus * shift / 1e-3 / 1e-3;
        for (point, sign) in [(middle, 1.0), (points + middle, -1.0)] {
            let ratio = sign * found[3 * point + axis] / expected;
            assert!((ratio - 1.0).abs() < 1e-10, "{axis}: {ratio}");
        }
    }
    let strained = displaced(&body, |x, _, _| [1e-3 * x, 0.0, 0.0]);
    laminate.set_displacement(&strained, &[]);
    let stress = laminate
        .evaluate(Wanted::stress(StressKind::Spatial))
        .stress;
    for (point, along) in [(middle, 181e9), (points + middle, 39e9)] {
        let whole = 1.0 - 0.28 * 0.28 * 10.3e9 / along;
        let ratio = stress[point][0] / (1e-3 * along / whole);
        assert!((ratio - 1.0).abs() < 1e-10, "{ratio}");
    }
}

/// The bound of the frequency holds at all temperatures, and finding it changes no force.
#[test]
fn the_stable_step_is_that_of_the_stiffest_temperatures() {
    let body = heated_plate();
    let points = body.points.len();
    let density = vec![1620.0; points];
    let mut laminate = laminate_that_breaks(&body, false, None);
    for temperature in [vec![300.0; points], uneven(&body), vec![600.0; points]] {
        set_temperature(&mut laminate, &body, &temperature);
        let mut mode = noise(3 * points);
        let before = force(&mut laminate, &mode);
        laminate.set_points(PointStates {
            moduli: Some(PointModuli::Stiffest(&body)),
            ..PointStates::default()
        });
        let bound = laminate.largest_frequency(&density, &[]);
        set_temperature(&mut laminate, &body, &temperature);
        assert_eq!(before, force(&mut laminate, &mode));
        let mut frequency = 0.0;
        for _ in 0..300 {
            let product = force(&mut laminate, &mode);
            let norm = |u: &[f64]| u.iter().map(|k| k * k).sum::<f64>().sqrt();
            let size = norm(&product);
            frequency = (size / norm(&mode) / 1620.0).sqrt();
            mode = product.iter().map(|k| k / size).collect();
        }
        assert!(bound >= frequency, "{bound} {frequency}");
        // that of the coldest plate
        let is_coldest = temperature.iter().all(|t| *t == 300.0);
        assert!(
            !is_coldest || bound < 1.8 * frequency,
            "{bound} {frequency}"
        );
    }
}

/// A mean of limits breaks bonds in a gradient of the temperature; where it is hottest they break first.
#[test]
fn bonds_break_first_where_their_energy_is_least() {
    let mut body = plate(&[0.0, 90.0], &[1e-3, 1e-3], Stations::One, 12);
    body.materials = vec![material(&keys(&CONSTANTS)[1])];
    let width = 12.0 * SPACING;
    let temperature: Vec<f64> = (body.points.position.iter())
        .map(|x| 300.0 + 300.0 * x.x / width)
        .collect();
    let strength = strength_of(&body, &keys(&STRENGTHS[..2])[0]);
    let mut laminate = laminate_that_breaks(&body, false, Some(strength));
    set_temperature(&mut laminate, &body, &temperature);
    // the limit of the interface is sqrt(2 G / (E h)), with 0.4 J/m² at 600 K
    let opening = |energy: f64| (2.0 * energy / (2.3e9 * 1e-3)).sqrt() * 1e-3;
    let mut damage = vec![0.0; temperature.len()];
    for (energy, count) in [(0.4, 0), (0.7, 6), (1.0, 12)] {
        let lifted = displaced(&body, |_, _, z| [0.0, 0.0, f64::from(u8::from(z > 0.0))]);
        let lifted: Vec<f64> = lifted.iter().map(|u| opening(energy) * u).collect();
        laminate.set_displacement(&lifted, &[]);
        laminate.break_bonds(0.0, &mut damage);
        let open = laminate.failure_modes()[2].damage[..12].to_vec();
        let expected: Vec<f64> = (0..12)
            .map(|x| f64::from(u8::from(x >= 12 - count)))
            .collect();
        assert_eq!(open, expected);
    }
}
