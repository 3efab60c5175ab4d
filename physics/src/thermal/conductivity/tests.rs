use nalgebra::Matrix3;
use perimelt_core::body::Store;
use perimelt_core::law::LawKind;

use super::*;
use crate::testing::{block, read, run, set, simulation, values};
use crate::thermal::Thermal;

const PLY: &str = "conductivity_1 = 8.3075\nconductivity_2 = 0.7575\nconductivity_3 = 0.5";

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
    assert_eq!(names, ["isotropic", "orthotropic"]);
}

#[test]
fn mistakes_name_law_material_and_key() {
    for (keys, key, message) in [
        ("isotropic = {}", "conductivity.isotropic", "`conductivity`"),
        (
            "orthotropic = { angle = inf }",
            "conductivity.orthotropic.angle",
            "a finite number",
        ),
    ] {
        let error = conductivities(Some(law(keys)), &body(2, PLY)).expect_err(keys);
        assert_eq!(error.key, key);
        assert!(error.to_string().contains(message), "{error}");
    }
    assert!(conductivities(None, &body(2, "conductivity = 3")).is_ok());
}

/// `K = k1 a a^T + k2 b b^T` at 30 degrees, with the temperature of each point.
#[test]
fn an_orthotropic_conductivity_turns_with_its_angle() {
    let falling = "conductivity_2 = 0.7575\nconductivity_3 = 0.5\n\
                   conductivity_1 = { temperature = [300, 400], value = [8.3075, 4.3075] }";
    for (material, is_constant, temperature, [xx, xy, yy]) in [
        (PLY, true, 999.0, [6.42, 3.269_246, 2.645]),
        (falling, false, 300.0, [6.42, 3.269_246, 2.645]),
        (falling, false, 400.0, [3.42, 1.537_195, 1.645]),
    ] {
        let body = body(2, material);
        let found = conductivities(Some(law("orthotropic = { angle = 30 }")), &body);
        let mut directions = Directions::of(&found.expect("valid"), 2).expect("directions");
        assert_eq!(directions.is_constant(), is_constant);
        assert_eq!(directions.largest(0), 8.3075);
        let mean = 0.5 * (xx + yy);
        assert!((directions.mean(0, temperature, 0.0) - mean).abs() < 1e-12);
        let specific_heat = Property::Constant(1.0);
        let curve = EnthalpyCurve::new(1.0, &specific_heat, None).expect("a curve");
        directions.evaluate(&[temperature], &[0], &[curve]);
        let along = |axis: Vector3<f64>| directions.times(0, 0, axis);
        let expected = [Vector3::new(xx, xy, 0.0), Vector3::new(xy, yy, 0.0)];
        for (found, expected) in [Vector3::x(), Vector3::y()].map(along).iter().zip(expected) {
            assert!((found - expected).norm() < 1e-6, "{found}");
        }
    }
}

/// Heat that flows to the points of a body with this temperature, W/m³, where families and those of their members are complete.
fn rates(dimension: usize, keys: &str, temperature: impl Fn([f64; 3]) -> f64) -> Vec<f64> {
    const TIME: f64 = 1e-3;
    let thermal: Thermal = read(&format!("horizon = 2\nform = 'ordinary'\n{keys}"));
    let material = format!("{PLY}\nconductivity = 0.7575");
    let mut s = simulation(
        body(dimension, &material),
        vec![Box::new(thermal)],
        Vec::new(),
        TIME,
    );
    let positions = s.world().body(0).points.position.clone();
    let (min, max) = s.world().body(0).bounds();
    let middle = 0.5 * (min + max);
    set(&mut s, "temperature", |x| {
        let x = Vector3::from(x) - middle;
        [500.0 + temperature(x.into())]
    });
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
            let keys = "conductivity.orthotropic = { angle = 30 }";
            let found = rates(dimension, keys, |x| x[a] * x[b]);
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
