//! Keys of a fluid that fit neither the body nor each other.

use perimelt_core::body::{Body, Jitter, Store};
use perimelt_core::law::Law;
use perimelt_core::{Axis, SetupError};

use super::Fluid;
use super::kinds::FluidKeys;
use super::viscosity::{Viscosity, ViscositySweep};
use crate::testing::{block, material, read};

fn water(dimension: usize) -> Body {
    let cells = [
        8,
        if dimension > 1 { 8 } else { 1 },
        if dimension > 2 { 8 } else { 1 },
    ];
    block(
        cells,
        dimension,
        1.0,
        Store::Lattice,
        "density = 1\nviscosity = 1",
    )
}

/// The keys of a fluid, or the mistake.
fn keys(body: &Body, keys: &str) -> Result<FluidKeys, SetupError> {
    let fluid: Fluid = read(&format!("state.tait.sound_speed = 1\n{keys}"));
    fluid.check_numbers(body)?;
    let keys = fluid.take_keys()?;
    keys.check_body(body)?;
    Ok(keys)
}

/// The key at fault, if any.
fn fault(body: &Body, table: &str) -> Option<String> {
    keys(body, table).err().map(|e| e.key)
}

const EULER: &str = "description = 'eulerian'\nform = 'conservative'";
const FOLLOWING: &str = "description = 'arbitrary_lagrangian_eulerian'\nform = 'conservative'";

#[test]
fn numbers_have_their_ranges() {
    let body = water(2);
    for key in [
        "density_diffusion",
        "startup",
        "shifting",
        "xsph",
        "artificial_viscosity",
        "least_distance",
    ] {
        assert_eq!(fault(&body, &format!("{key} = 0")), None, "{key}");
        for value in ["-0.1", "inf", "nan"] {
            let found = fault(&body, &format!("{key} = {value}"));
            assert_eq!(found.as_deref(), Some(key), "{value}");
        }
    }
    let relaxation = |value: &str| {
        let table = format!("form = 'conservative'\nvolume_relaxation = {value}");
        fault(&body, &table)
    };
    assert_eq!(relaxation("0"), None);
    assert_eq!(relaxation("-1e-4").as_deref(), Some("volume_relaxation"));
    assert_eq!(fault(&body, "least_distance = 0.99"), None);
    assert!(fault(&body, "least_distance = 1").is_some());
    for (keys, at_fault) in [
        ("", None),
        ("restitution = 0, distance = 1", None),
        ("restitution = 1.1", Some("collisions.restitution")),
        ("distance = -0.1", Some("collisions.distance")),
    ] {
        let table = format!("form = 'conservative'\ncollisions = {{ {keys} }}");
        let found = fault(&body, &table);
        assert_eq!(found.as_deref(), at_fault, "{keys}");
    }
}

#[test]
fn keys_fit_each_other() {
    for (keys, at_fault) in [
        ("", None),
        ("xsph = 0.5\nshifting = 0.1\nleast_distance = 0.5", None),
        ("description = 'total_lagrangian'", None),
        ("description = 'total_lagrangian'\nxsph = 0.5", Some("xsph")),
        (
            "description = 'total_lagrangian'\nshifting = 0.5",
            Some("shifting"),
        ),
        (
            "description = 'eulerian'\nleast_distance = 0.5",
            Some("least_distance"),
        ),
        ("description = 'eulerian'\nconvection = 'central'", None),
        ("convection = 'central'", Some("convection")),
        ("volume_relaxation = 1e-4", Some("volume_relaxation")),
        ("collisions = {}", Some("collisions")),
        ("form = 'conservative'\ncollisions = {}", None),
        ("surface = 'natural'\nstress = 'incompressible'", None),
        ("form = 'conservative'", None),
        (
            "form = 'conservative'\ndescription = 'total_lagrangian'",
            Some("description"),
        ),
        (
            "form = 'conservative'\nstress = 'compressible'",
            Some("stress"),
        ),
        ("stress = 'compressible'", None),
        ("form = 'conservative'\nstress = 'central'", None),
        ("stress = 'central'", Some("stress")),
        ("form = 'conservative'\nsurface = 'closed'", None),
        ("surface = 'closed'", Some("surface")),
        ("surface = 'zero_pressure'", None),
        (EULER, None),
        (&format!("{EULER}\nstress = 'central'"), Some("stress")),
        (&format!("{EULER}\nsurface = 'closed'"), Some("surface")),
        (&format!("{EULER}\ncollisions = {{}}"), Some("collisions")),
        (&format!("{EULER}\nsmoothing = 5"), None),
        ("smoothing = 5\nsmoothed = 'density'", None),
        ("smoothed = 'density'", Some("smoothed")),
        ("smoothing = 0\nsmoothed = 'density'", Some("smoothed")),
        (FOLLOWING, None),
        (&format!("{FOLLOWING}\nsmoothing = 5"), Some("smoothing")),
        (
            "description = 'arbitrary_lagrangian_eulerian'",
            Some("description"),
        ),
    ] {
        assert_eq!(fault(&water(2), keys).as_deref(), at_fault, "{keys}");
    }
}

#[test]
fn the_body_fits_the_form() {
    let jitter = Jitter {
        amplitude: 0.1,
        seed: 1,
    };
    let cloud = water(2).jittered(jitter).expect("valid");
    for (body, keys, at_fault) in [
        (water(1), "", Some("body")),
        (water(3), "", None),
        (cloud.clone(), "form = 'conservative'", None),
        (cloud.clone(), EULER, Some("description")),
        (water(3), EULER, None),
    ] {
        assert_eq!(fault(&body, keys).as_deref(), at_fault, "{keys}");
    }
    let mut two_spacings = cloud;
    two_spacings.points.spacing[0] = 2.0;
    let found = fault(&two_spacings, "form = 'conservative'");
    assert_eq!(found.as_deref(), Some("form"));
    assert_eq!(fault(&two_spacings, ""), None);
    let mut ring = water(2);
    ring.repeat(&[Axis::X]).expect("it fills its box");
    assert_eq!(fault(&ring, EULER), None);
}

/// Forces along bonds keep angular momentum, as long as nothing else moves points or smooths fields.
#[test]
fn angular_momentum_is_kept_by_central_forces_alone() {
    let central = "form = 'conservative'\nstress = 'central'";
    for (table, is_kept) in [
        (central.to_owned(), true),
        ("form = 'conservative'".into(), false),
        (format!("{central}\nsurface = 'zero_pressure'"), false),
        (format!("{central}\nsurface = 'closed'"), true),
        (format!("{central}\nsmoothing = 20"), false),
        (format!("{central}\nxsph = 0.1"), false),
        (format!("{central}\nshifting = 0.1"), false),
        (format!("{central}\ndensity_diffusion = 0.1"), true),
    ] {
        let keys = keys(&water(2), &table).expect("they fit");
        assert_eq!(keys.keeps_angular_momentum(), is_kept, "{table}");
    }
    for (table, may) in [
        ("", false),
        ("form = 'conservative'", true),
        ("surface = 'zero_pressure'", true),
    ] {
        let keys = keys(&water(2), table).expect("they fit");
        assert_eq!(keys.may_have_free_surface(), may, "{table}");
    }
}

/// The message names the key, says with which form or description it works, and what to write.
#[test]
fn the_message_follows_from_the_keys_of_other_fluids() {
    for (table, expected) in [
        (
            "stress = 'central'",
            "`stress = \"central\"` does not work with `form = \"differences\"`; \
             expected `form = \"conservative\"` or no `stress`",
        ),
        (
            "description = 'total_lagrangian'\nshifting = 0.1",
            "`shifting` does not work with `description = \"total_lagrangian\"`; \
             expected `description = \"updated_lagrangian\"` or no `shifting`",
        ),
        (
            "description = 'total_lagrangian'\nvolume_relaxation = 0.1",
            "`volume_relaxation` does not work with `description = \"total_lagrangian\"` and `form = \"differences\"`; \
             expected `description = \"updated_lagrangian\"` with `form = \"conservative\"` or no `volume_relaxation`",
        ),
        (
            &format!("{EULER}\ncollisions = {{}}"),
            "`collisions` does not work with `description = \"eulerian\"`; \
             expected `description = \"updated_lagrangian\"` or no `collisions`",
        ),
        (
            "description = 'arbitrary_lagrangian_eulerian'",
            "`description = \"arbitrary_lagrangian_eulerian\"` does not work with `form = \"differences\"`; \
             expected `description = \"updated_lagrangian\"`, `description = \"total_lagrangian\"`, `description = \"eulerian\"` \
             or `form = \"conservative\"`",
        ),
    ] {
        let error = keys(&water(2), table).expect_err("a key of other fluids");
        assert_eq!(error.to_string(), expected);
    }
}

/// A fluid that keeps its volume rests on points at rest, in the conservative form, and has no keys of sound.
#[test]
fn keys_of_sound_do_not_work_without_sound() {
    let water = water(2);
    let fault = |table: &str| {
        let fluid: Fluid = read(&format!("state.incompressible = {{}}\n{table}"));
        let found = fluid.check_numbers(&water).and_then(|()| fluid.take_keys());
        found.err().map(|e| (e.key.clone(), e.to_string()))
    };
    assert_eq!(fault(EULER), None);
    assert_eq!(
        fault(&format!(
            "{EULER}\nscheme = 'symplectic'\nconvection = 'central'"
        )),
        None
    );
    for (table, at_fault, expected) in [
        ("interface = {}", "interface", "`fluids`"),
        (
            "",
            "state",
            "does not work with `description = \"updated_lagrangian\"` and `form = \"differences\"`",
        ),
        (FOLLOWING, "description", "`description = \"eulerian\"`"),
        (
            &format!("{EULER}\ndensity_diffusion = 0.1"),
            "density_diffusion",
            "no `density_diffusion`",
        ),
        (
            &format!("{EULER}\nartificial_viscosity = 0.1"),
            "artificial_viscosity",
            "a `state` with sound",
        ),
        (
            &format!("{EULER}\nstartup = 0.1"),
            "startup",
            "a `state` with sound",
        ),
        (
            &format!("{EULER}\nsmoothing = 20"),
            "smoothing",
            "a `state` with sound",
        ),
        (
            &format!("{EULER}\nscheme = 'kick_drift_kick'"),
            "scheme",
            "a `state` with sound",
        ),
    ] {
        let (key, message) = fault(table).expect("a mistake");
        assert_eq!(key, at_fault, "{message}");
        assert!(message.contains(expected), "{message}");
    }
}

#[test]
fn laws_of_the_shear_rate_need_forces_that_balance_and_points_that_do_not_follow_walls() {
    #[derive(serde::Deserialize)]
    struct Table {
        viscosity: Law<dyn ViscositySweep>,
    }
    let mut paste = water(2);
    paste.materials = vec![material("consistency = 1\nflow_index = 0.5\nviscosity = 1")];
    for (law, table, at_fault) in [
        ("power_law = { largest = 9 }", "", Some("form")),
        ("power_law = { largest = 9 }", "form = 'conservative'", None),
        ("power_law = { largest = 9 }", EULER, None),
        ("power_law = { largest = 9 }", FOLLOWING, Some("viscosity")),
        ("newtonian = {}", "", None),
        ("newtonian = {}", FOLLOWING, None),
    ] {
        let law = read::<Table>(&format!("viscosity.{law}")).viscosity;
        let viscosity = Viscosity::new(Some(law), &paste, false).expect("valid");
        let keys = keys(&paste, table).expect("valid");
        let found = keys.check_viscosity(&viscosity).err().map(|e| e.key);
        assert_eq!(found.as_deref(), at_fault, "{table}");
    }
}
