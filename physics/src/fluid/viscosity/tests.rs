use nalgebra::{Matrix3, Vector3};
use perimelt_core::FamilySpec;
use perimelt_core::body::Store;
use perimelt_core::law::LawKind;
use perimelt_core::material::{EnthalpyCurve, Property};

use super::*;
use crate::testing::{block, material, read};

/// Three points of two materials with these keys.
fn body(materials: [&str; 2]) -> Body {
    let mut body = block([3, 1, 1], 1, 1.0, Store::Lattice, "density = 1");
    let keys = |keys: &str| material(&format!("density = 1\n{keys}"));
    body.materials = materials.map(keys).into();
    body.material_of_point = vec![0, 1, 0];
    body
}

fn law(keys: &str) -> Law<dyn ViscositySweep> {
    #[derive(serde::Deserialize)]
    struct Table {
        viscosity: Law<dyn ViscositySweep>,
    }
    read::<Table>(&format!("viscosity.{keys}")).viscosity
}

const FALLING: &str = "{ temperature = [300, 400], value = [8, 2] }";

#[test]
fn a_newtonian_viscosity_is_that_of_the_material_and_the_temperature_of_a_point() {
    let curve = || {
        let specific_heat = Property::Constant(1.0);
        EnthalpyCurve::new(1.0, &specific_heat, None).expect("a curve")
    };
    for (values, varies, by_temperature, at_first, hot) in [
        (["3", "3"], false, false, [3.0; 3], [3.0; 3]),
        (["3", "5"], true, false, [3.0, 5.0, 3.0], [3.0, 5.0, 3.0]),
        (["3", FALLING], true, true, [0.0; 3], [3.0, 5.0, 3.0]),
    ] {
        let keys = values.map(|value| format!("viscosity = {value}"));
        let body = body([&keys[0], &keys[1]]);
        let mut viscosity = Viscosity::new(None, &body, false).expect("valid");
        assert_eq!(viscosity.varies, varies, "{values:?}");
        assert_eq!(viscosity.depends_on_temperature(), by_temperature);
        assert_eq!(viscosity.value, at_first, "{values:?}");
        let curves = [curve(), curve()];
        viscosity.evaluate(&body.material_of_point, Some((&[350.0; 3], &curves)));
        assert_eq!(viscosity.value, hot, "{values:?}");
        let largest = if by_temperature { 8.0 } else { hot[1] };
        assert_eq!([0, 1].map(|m| viscosity.largest(m)), [3.0, largest]);
    }
}

/// A fluid that does not freeze is liquid; one that does has the liquid fraction of its temperature.
#[test]
fn a_viscosity_by_phase_is_that_of_the_liquid_unless_the_fluid_freezes() {
    let body = body(["viscosity = { solid = 100, liquid = 3 }", "viscosity = 5"]);
    let liquid = Viscosity::new(None, &body, false).expect("valid");
    assert_eq!(liquid.value, [3.0, 5.0, 3.0]);
    assert!(!liquid.depends_on_temperature());
    let freezing = Viscosity::new(None, &body, true).expect("valid");
    assert!(freezing.depends_on_temperature());
}

/// `K g^(n-1)` and `t_y / g + K g^(n-1)`, up to the largest viscosity, also at rest.
#[test]
fn laws_of_the_shear_rate_are_bounded() {
    let (thin, thick) = ("flow_index = 0.5", "flow_index = 1.5");
    let yields = "\nshear_yield_stress = 6";
    for (keys, material, at) in [
        (
            "power_law",
            thin.to_string(),
            [(0.0, 50.0), (0.25, 4.0), (4.0, 1.0)],
        ),
        (
            "power_law",
            thick.to_string(),
            [(0.0, 0.0), (4.0, 4.0), (1e4, 50.0)],
        ),
        (
            "herschel_bulkley",
            thin.to_string() + yields,
            [(0.0, 50.0), (0.01, 50.0), (4.0, 2.5)],
        ),
        (
            "herschel_bulkley",
            thick.to_string() + yields,
            [(0.0, 50.0), (4.0, 5.5), (1e4, 50.0)],
        ),
    ] {
        let material = format!("consistency = 2\n{material}");
        let body = body([&material, &material]);
        let law = law(&format!("{keys} = {{ largest = 50 }}"));
        let mut viscosity = Viscosity::new(Some(law), &body, false).expect("valid");
        assert!(viscosity.varies && viscosity.needs_shear_rate());
        assert_eq!(viscosity.largest(1), 50.0);
        viscosity.shear.value = at.map(|(rate, _)| rate).into();
        viscosity.evaluate(&body.material_of_point, None);
        assert_eq!(
            viscosity.value,
            at.map(|(_, value)| value),
            "{keys} {material}"
        );
    }
}

#[test]
fn mistakes_name_law_material_and_key() {
    let water = body(["viscosity = 1", "viscosity = 1"]);
    for (keys, key, message) in [
        (
            "power_law = { largest = 0 }",
            "viscosity.power_law.largest",
            "above 0 Pa s",
        ),
        (
            "power_law = { largest = 1 }",
            "viscosity.power_law",
            "`consistency`",
        ),
    ] {
        let error = Viscosity::new(Some(law(keys)), &water, false).expect_err(keys);
        assert_eq!(error.key, key);
        assert!(error.to_string().contains(message), "{error}");
    }
    let dry = body(["", "viscosity = 1"]);
    let error = Viscosity::new(None, &dry, false).expect_err("no viscosity");
    assert!(error.to_string().contains("`viscosity`"), "{error}");
}

#[test]
fn laws_are_known_by_name() {
    let names = <dyn ViscositySweep>::registered();
    let names: Vec<_> = names.iter().map(|law| law.name).collect();
    assert_eq!(names, ["herschel_bulkley", "newtonian", "power_law"]);
}

/// A linear velocity has the shear rate `sqrt(2 D : D)` inside and at flat surfaces; a rotation has none.
#[test]
fn shear_rates_of_linear_velocities_are_exact() {
    let shear = Matrix3::new(0.0, 3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    let stretch = Matrix3::new(2.0, 0.0, 0.0, 0.0, -2.0, 0.0, 0.0, 0.0, 0.0);
    let rotation = Matrix3::new(0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    for dimension in [2, 3] {
        let cells = if dimension == 2 { [6, 5, 1] } else { [5, 4, 4] };
        let body = block(cells, dimension, 0.5, Store::Lattice, "density = 1");
        let family = Family::build(&body, &FamilySpec::new(2.015)).expect("a family");
        for (gradient, expected) in [(shear, 3.0), (stretch, 4.0), (rotation, 0.0)] {
            let velocity: Vec<Vector3<f64>> =
                body.points.position.iter().map(|x| gradient * x).collect();
            let slots: Vec<SlotField> = (0..dimension)
                .map(|axis| {
                    let mut slots = SlotField::default();
                    slots.load(&family, |i: usize| velocity[i][axis], Mirrored::Scalar);
                    slots
                })
                .collect();
            let mut rates = ShearRates::default();
            rates.find(&family, &slots, body.points.len());
            let (min, max) = body.bounds();
            let is_inside = |x: &Vector3<f64>| {
                let at_face = |a: &usize| x[*a] - min[*a] < 0.5 || max[*a] - x[*a] < 0.5;
                (0..dimension).filter(at_face).count() < 2
            };
            let points = rates.value.iter().zip(&body.points.position);
            for (rate, at) in points.filter(|(_, at)| is_inside(at)) {
                assert!((rate - expected).abs() < 1e-12, "{at:?}: {rate}");
            }
        }
    }
}

/// The mean of the ends, or of two halves in series; zero where both ends are.
#[test]
fn the_viscosity_of_a_bond_follows_from_its_ends() {
    assert_eq!(of_bond::<false>(1.0, 3.0), 2.0);
    assert_eq!(of_bond::<true>(1.0, 3.0), 1.5);
    assert_eq!(of_bond::<true>(2.0, 2.0), 2.0);
    assert_eq!(of_bond::<true>(0.0, 0.0), 0.0);
}
