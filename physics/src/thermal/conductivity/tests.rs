use nalgebra::Matrix3;
use perimelt_core::body::Store;
use perimelt_core::law::LawKind;

use super::*;
use crate::testing::{block, read, run, set, simulation, values};
use crate::thermal::Thermal;

const PLY: &str = "conductivity = { axes = [8.3075, 0.7575, 0.5] }";

fn law(keys: &str) -> Law<dyn AnyConductivity> {
    #[derive(serde::Deserialize)]
    struct Table {
        conductivity: Law<dyn AnyConductivity>,
    }
    read::<Table>(&format!("conductivity.{keys}")).conductivity
}

fn body(dimension: usize, material: &str) -> Body {
    let cells = match dimension {
        2 => [15, 15, 1],
        _ => [13, 13, 13],
    };
    let keys = format!("density = 1\nspecific_heat = 1\n{material}");
    block(cells, dimension, 1.0, Store::Lattice, &keys)
}

#[test]
fn laws_are_known_by_name() {
    let names = <dyn AnyConductivity>::registered();
    let names: Vec<_> = names.iter().map(|law| law.name).collect();
    assert_eq!(names, ["fourier"]);
}

#[test]
fn mistakes_name_law_material_and_key() {
    let error = conductivities(Some(law("fourier = {}")), &body(2, "")).expect_err("no property");
    assert_eq!(error.key, "conductivity.fourier");
    assert!(error.to_string().contains("`conductivity`"), "{error}");
    assert!(conductivities(None, &body(2, "conductivity = 3")).is_ok());
}

/// A rotation by 30 degrees about z.
fn turn() -> Vector3<f64> {
    Vector3::new(0.0, 0.0, 30_f64.to_radians())
}

/// `K = k1 a a^T + k2 b b^T` at 30 degrees, with the temperature of each point.
#[test]
fn a_conductivity_with_directions_turns_with_the_orientation() {
    let falling = "conductivity = { along = { temperature = [300, 400], value = [8.3075, 4.3075] }, across = 0.7575 }";
    for (material, is_constant, temperature, [xx, xy, yy]) in [
        (PLY, true, 999.0, [6.42, 3.269_246, 2.645]),
        (falling, false, 300.0, [6.42, 3.269_246, 2.645]),
        (falling, false, 400.0, [3.42, 1.537_195, 1.645]),
    ] {
        let body = body(2, material);
        let found = conductivities(None, &body);
        let found = found.expect("valid");
        let mut directions = Directions::of(&found, &body).expect("directions");
        directions.set_orientation(&vec![turn(); body.points.len()]);
        assert_eq!(directions.is_constant(), is_constant);
        assert_eq!(directions.largest(0), 8.3075);
        let mean = 0.5 * (xx + yy);
        assert!((directions.mean(0, temperature, 0.0) - mean).abs() < 1e-12);
        let specific_heat = Property::Constant(1.0);
        let curve = EnthalpyCurve::new(1.0, &specific_heat, None).expect("a curve");
        directions.evaluate(&[temperature], &[0], &[curve]);
        let along = |axis: Vector3<f64>| directions.times(0, axis);
        let expected = [Vector3::new(xx, xy, 0.0), Vector3::new(xy, yy, 0.0)];
        for (found, expected) in [Vector3::x(), Vector3::y()].map(along).iter().zip(expected) {
            assert!((found - expected).norm() < 1e-6, "{found}");
        }
    }
}

/// Heat that flows to the points of a body with this temperature, W/m³, where families and those of their members are complete.
fn rates(dimension: usize, temperature: impl Fn([f64; 3]) -> f64) -> Vec<f64> {
    const TIME: f64 = 1e-3;
    let thermal: Thermal = read("horizon = 2\nform = 'ordinary'");
    let mut s = simulation(
        body(dimension, PLY),
        vec![Box::new(thermal)],
        Vec::new(),
        TIME,
    );
    let positions = s.world().body(0).points.position.to_vec();
    let (min, max) = s.world().body(0).bounds();
    let middle = 0.5 * (min + max);
    set(&mut s, "temperature", |x| {
        let x = Vector3::from(x) - middle;
        [500.0 + temperature(x.into())]
    });
    set(&mut s, "orientation", |_| turn().into());
    let before = values(&s, "temperature");
    run(&mut s);
    let after = values(&s, "temperature");
    let is_inside = |x: &Vector3<f64>| (0..dimension).all(|a| (x[a] - middle[a]).abs() < 2.0);
    let points = positions.iter().zip(before.iter().zip(&after));
    let inside = points.filter(|(x, _)| is_inside(x));
    inside
        .map(|(_, (before, after))| (after - before) / TIME)
        .collect()
}

/// `K : grad grad T` of quadratic temperatures, to the rounding of their values.
#[test]
fn quadratic_temperatures_conduct_with_the_tensor() {
    let (xx, xy, yy, zz) = (6.42, 7.55 * 3_f64.sqrt() / 4.0, 2.645, 0.5);
    let tensor = Matrix3::new(xx, xy, 0.0, xy, yy, 0.0, 0.0, 0.0, zz);
    for dimension in [2, 3] {
        for (a, b) in [(0, 0), (0, 1), (1, 1), (2, 2), (0, 2)] {
            if a.max(b) >= dimension {
                continue;
            }
            let second = if a == b { 2.0 } else { 1.0 };
            let expected = second * tensor[(a, b)] * if a == b { 1.0 } else { 2.0 };
            let found = rates(dimension, |x| x[a] * x[b]);
            assert!(!found.is_empty());
            for rate in found {
                assert!(
                    (rate - expected).abs() < 1e-8,
                    "{dimension} {a}{b}: {rate} {expected}"
                );
            }
        }
    }
}
