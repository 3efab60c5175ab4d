use super::*;
use crate::testing::{STEEL, apply, block, prepare, read, refusal, set, values};

#[test]
fn strain_is_the_secant_coefficient_at_the_temperature_times_the_rise() {
    let mut world = World::new(vec![block([3, 1, 1], 1, STEEL)]);
    let expansion: ThermalExpansion = read("reference_temperature = 300");
    let (mut expansion, ()) = prepare(&mut world, expansion, |setup| {
        setup.own(0, &keys::TEMPERATURE).expect("free");
        setup.consume(0, &keys::EIGENSTRAIN).expect("free");
    })
    .expect("valid");
    set(&mut world, &keys::TEMPERATURE, |i| [200.0, 300.0, 800.0][i]);
    set(&mut world, &keys::EIGENSTRAIN, |_| 1.0);
    apply(&world, &mut *expansion, 0.0);
    // 15e-6 half way through the table, 10e-6 below it; added to what was there
    let expected = [1.0 - 10e-6 * 100.0, 1.0, 1.0 + 15e-6 * 500.0];
    for (strain, expected) in values(&world, &keys::EIGENSTRAIN).iter().zip(expected) {
        assert!((strain - expected).abs() < 1e-15, "rounding of 1");
    }
}

/// A bar of EN 1993-1-2 steel, e(T) = alpha(T) (T - 293.15 K), that is free of stress at another temperature: heated from
/// there, with a cut-off, and deposited. The table is exact at the rows.
#[test]
fn mean_coefficients_count_from_their_own_reference_temperature() {
    let metal = "thermal_expansion = { temperature = [473, 873, 1273], value = [12.88e-6, 14.48e-6, 14.08e-6] }\nexpansion_reference = 293.15";
    let elongation = |t: f64| {
        let coefficient = [(473.0, 12.88e-6), (873.0, 14.48e-6), (1273.0, 14.08e-6)];
        let row = coefficient.iter().find(|row| row.0 == t).expect("a row");
        row.1 * (t - 293.15)
    };
    let mut world = World::new(vec![block([4, 1, 1], 1, metal)]);
    let keys_given = "reference_temperature = 473\ncutoff_temperature = 1273";
    let expansion: ThermalExpansion = read(keys_given);
    let (mut expansion, ()) = prepare(&mut world, expansion, |setup| {
        setup.own(0, &keys::TEMPERATURE).expect("free");
        setup.own(0, &keys::BIRTH_TEMPERATURE).expect("free");
        setup.consume(0, &keys::EIGENSTRAIN).expect("free");
    })
    .expect("valid");
    set(&mut world, &keys::TEMPERATURE, |i| {
        [473.0, 873.0, 1900.0, 873.0][i]
    });
    set(&mut world, &keys::BIRTH_TEMPERATURE, |i| {
        [0.0, 0.0, 0.0, 1900.0][i]
    });
    apply(&world, &mut *expansion, 0.0);
    let expected = [
        (473.0, 473.0),
        (473.0, 873.0),
        (473.0, 1273.0),
        (1273.0, 873.0),
    ];
    let found = values(&world, &keys::EIGENSTRAIN);
    for (found, (from, to)) in found.iter().zip(expected) {
        let expected = elongation(to) - elongation(from);
        assert!((found - expected).abs() < 1e-16, "{from} to {to}: {found}");
    }
}

#[test]
fn the_reference_temperature_may_depend_on_the_place() {
    let mut world = World::new(vec![block([3, 1, 1], 1, "thermal_expansion = 1e-5")]);
    let expansion: ThermalExpansion = read("reference_temperature = '300 + 100 * x'");
    let (mut expansion, ()) = prepare(&mut world, expansion, |setup| {
        setup.own(0, &keys::TEMPERATURE).expect("free");
        setup.consume(0, &keys::EIGENSTRAIN).expect("free");
    })
    .expect("valid");
    set(&mut world, &keys::TEMPERATURE, |_| 600.0);
    apply(&world, &mut *expansion, 0.0);
    // points at x = 0.5, 1.5, 2.5 m
    for (strain, expected) in values(&world, &keys::EIGENSTRAIN)
        .iter()
        .zip([2.5e-3, 1.5e-3, 0.5e-3])
    {
        assert!((strain - expected).abs() < 1e-15, "{strain} {expected}");
    }
    let expansion: ThermalExpansion = read("reference_temperature = '300 + t'");
    assert!(refusal(&mut world, expansion).contains("changes in time"));
}

/// -1e-6/K along fibres at 30 degrees and 3e-5/K across, free of stress at 300 K or, where it was deposited, at 500 K; a
/// metal beside it.
#[test]
fn expansions_along_axes_turn_with_the_orientation() {
    let mut body = block(
        [4, 1, 1],
        3,
        "thermal_expansion = { along = -1e-6, across = 3e-5 }",
    );
    let metal = block([1, 1, 1], 3, "thermal_expansion = 1e-5");
    body.materials.extend(metal.materials);
    body.material_of_point[3] = 1;
    let mut world = World::new(vec![body]);
    let expansion: ThermalExpansion = read("reference_temperature = 300");
    let (mut expansion, ()) = prepare(&mut world, expansion, |setup| {
        setup.own(0, &keys::TEMPERATURE).expect("free");
        setup.own(0, &keys::BIRTH_TEMPERATURE).expect("free");
        setup.own(0, &keys::ORIENTATION).expect("free");
        setup.consume(0, &keys::EIGENSTRAIN).expect("free");
        setup.consume(0, &keys::EIGENSTRAIN_TENSOR).expect("free");
    })
    .expect("valid");
    set(&mut world, &keys::TEMPERATURE, |_| 400.0);
    set(&mut world, &keys::BIRTH_TEMPERATURE, |i| {
        [0.0, 0.0, 500.0, 0.0][i]
    });
    let turn = Vector3::new(0.0, 0.0, 30_f64.to_radians());
    set(&mut world, &keys::ORIENTATION, |i| {
        [Vector3::zeros(), turn, turn, turn][i]
    });
    apply(&world, &mut *expansion, 0.0);
    let (mean, rest) = (
        values(&world, &keys::EIGENSTRAIN),
        values(&world, &keys::EIGENSTRAIN_TENSOR),
    );
    let (xx, yy) = (0.75 * -1e-4 + 0.25 * 3e-3, 0.25 * -1e-4 + 0.75 * 3e-3);
    let xy = -3.1e-3 * 0.75_f64.sqrt() * 0.5;
    for (point, [a, b, c, d]) in [
        [-1e-4, 0.0, 3e-3, 3e-3],
        [xx, xy, yy, 3e-3],
        [-xx, -xy, -yy, -3e-3],
        [1e-3, 0.0, 1e-3, 1e-3],
    ]
    .into_iter()
    .enumerate()
    {
        let expected = [a, b, 0.0, b, c, 0.0, 0.0, 0.0, d];
        let rest = &rest[9 * point..][..9];
        assert!((rest[0] + rest[4] + rest[8]).abs() < 1e-17);
        for (i, (rest, expected)) in rest.iter().zip(expected).enumerate() {
            let found = rest + if i % 4 == 0 { mean[point] } else { 0.0 };
            assert!(
                (found - expected).abs() < 1e-17,
                "{point}: {found} {expected}"
            );
        }
    }
}

#[test]
fn expansion_ends_at_the_cutoff() {
    let mut world = World::new(vec![block([3, 1, 1], 1, STEEL)]);
    let expansion: ThermalExpansion = read("reference_temperature = 300\ncutoff_temperature = 800");
    let (mut expansion, ()) = prepare(&mut world, expansion, |setup| {
        setup.own(0, &keys::TEMPERATURE).expect("free");
        setup.consume(0, &keys::EIGENSTRAIN).expect("free");
    })
    .expect("valid");
    set(&mut world, &keys::TEMPERATURE, |i| {
        [300.0, 800.0, 2800.0][i]
    });
    apply(&world, &mut *expansion, 0.0);
    let strain = values(&world, &keys::EIGENSTRAIN);
    assert_eq!(strain[0], 0.0);
    assert!(strain[1] > 0.0);
    assert_eq!(strain[1], strain[2]);
}

/// Material is free of stress at the temperature at which it was deposited, or at the cut-off where it was hotter. The
/// coefficient is 1e-5 in the solid and 3e-5 in the liquid.
#[test]
fn deposited_material_is_free_of_stress_at_its_birth() {
    let metal = "thermal_expansion = { solid = 1e-5, liquid = 3e-5 }";
    for (cutoff, expected) in [
        ("", [5e-3, 5e-3 - 7e-3, 0.0, 0.5 * 4e-5 * 1000.0 - 7e-3]),
        // above the cut-off as the solid at it
        ("\ncutoff_temperature = 900", [5e-3, 5e-3 - 6e-3, 0.0, 0.0]),
    ] {
        let mut world = World::new(vec![block([4, 1, 1], 1, metal)]);
        let expansion: ThermalExpansion = read(&format!("reference_temperature = 300{cutoff}"));
        let (mut expansion, ()) = prepare(&mut world, expansion, |setup| {
            setup.own(0, &keys::TEMPERATURE).expect("free");
            setup.own(0, &keys::LIQUID_FRACTION).expect("free");
            setup.own(0, &keys::BIRTH_TEMPERATURE).expect("free");
            setup.consume(0, &keys::EIGENSTRAIN).expect("free");
        })
        .expect("valid");
        set(&mut world, &keys::TEMPERATURE, |i| {
            [800.0, 800.0, 1000.0, 1300.0][i]
        });
        set(&mut world, &keys::LIQUID_FRACTION, |i| {
            [0.0, 0.0, 0.0, 0.5][i]
        });
        // there from the start, or deposited at 1000 K
        set(&mut world, &keys::BIRTH_TEMPERATURE, |i| {
            [0.0, 1000.0, 1000.0, 1000.0][i]
        });
        apply(&world, &mut *expansion, 0.0);
        let found = values(&world, &keys::EIGENSTRAIN);
        for (found, expected) in found.iter().zip(expected) {
            assert!(
                (found - expected).abs() < 1e-15,
                "{cutoff}: {found} {expected}"
            );
        }
    }
}

#[test]
fn a_cutoff_below_the_reference_is_refused() {
    let mut world = World::new(vec![block([3, 1, 1], 1, STEEL)]);
    for cutoff in ["293", "300", "nan"] {
        let table = format!("reference_temperature = 300\ncutoff_temperature = {cutoff}");
        let expansion: ThermalExpansion = read(&table);
        let message = refusal(&mut world, expansion);
        assert!(
            message.contains("expected a number above 300 K"),
            "{message}"
        );
    }
}

#[test]
fn a_material_without_expansion_is_named() {
    let mut world = World::new(vec![block([3, 1, 1], 1, "density = 1")]);
    let expansion: ThermalExpansion = read("reference_temperature = 300");
    let message = refusal(&mut world, expansion);
    assert!(message.contains("material `steel` of body `block` has no `thermal_expansion`"));
}

/// A temperature that the case knows, by place and time, needs no field.
#[test]
fn a_known_temperature_takes_the_place_of_the_field() {
    let mut world = World::new(vec![block([3, 1, 1], 1, "thermal_expansion = 1e-5")]);
    let expansion: ThermalExpansion =
        read("reference_temperature = 300\ntemperature = '300 + 100 * x * t'");
    let (mut expansion, ()) = prepare(&mut world, expansion, |setup| {
        setup.consume(0, &keys::EIGENSTRAIN).expect("free");
    })
    .expect("valid");
    apply(&world, &mut *expansion, 1.0);
    for (strain, x) in values(&world, &keys::EIGENSTRAIN)
        .iter()
        .zip([0.5, 1.5, 2.5])
    {
        assert!((strain - 1e-5 * 200.0 * x).abs() < 1e-15, "{strain} {x}");
    }
}
