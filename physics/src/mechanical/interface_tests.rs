//! Strength of bonds between materials, through thin layers and across interfaces.

use crate::mechanical::solid::Wanted;
use perimelt_core::body::{Jitter, Store};
use perimelt_core::{Body, Region, Setup, World};

use super::Mechanical;
use crate::testing::{block, material, read, simulation};

const SPACING: f64 = 1e-3;
const CELLS: [usize; 3] = [15, 8, 1];
/// Column of points of the layer.
const LAYER: f64 = 7.5 * SPACING;

fn strength(criterion: &str, factor: f64) -> String {
    let limit = match criterion {
        "stretch" => format!("critical_stretch = {}", 1e-3 * factor),
        _ => format!("fracture_energy = {}", 100.0 * factor * factor),
    };
    format!("density = 2500\nyoungs_modulus = 7e10\npoissons_ratio = 0.3\n{limit}")
}

/// A bar of two halves and a layer of one row of points, whose strengths have these factors.
fn bar(criterion: &str, [halves, layer]: [f64; 2], cloud: bool) -> Body {
    let mut body = block(
        CELLS,
        2,
        SPACING,
        Store::Lattice,
        &strength(criterion, halves),
    );
    if cloud {
        let jitter = Jitter {
            amplitude: 0.05,
            seed: 2,
        };
        body = body.jittered(jitter).expect("a valid amplitude");
    }
    body.materials.push(material(&strength(criterion, layer)));
    let positions = &body.points.position;
    let of = |is_here: &dyn Fn(f64) -> bool| Region {
        points: (0..positions.len() as u32)
            .filter(|p| is_here(positions[*p as usize].x))
            .collect(),
    };
    let half = 0.5 * SPACING;
    let regions = [
        ("left", of(&|x| x < LAYER - half)),
        ("layer", of(&|x| (x - LAYER).abs() <= half)),
        ("right", of(&|x| x > LAYER + half)),
    ];
    if layer != halves {
        for point in &regions[1].1.points {
            body.material_of_point[*point as usize] = 1;
        }
    }
    for (name, region) in regions {
        body.regions.insert(name.into(), region);
    }
    body
}

/// Side of the layer on which a point lies; 0 in the layer.
fn side(x: f64) -> i32 {
    match (x - LAYER) / SPACING {
        d if d < -0.5 => -1,
        d if d > 0.5 => 1,
        _ => 0,
    }
}

/// The sides of the ends of bonds that broke, and of those that did not, when all bonds are stretched alike.
fn broken_and_whole(body: Body, keys: &str, strain: f64) -> [Vec<[i32; 2]>; 2] {
    let mechanical: Mechanical = read(keys);
    let mut world = World::new(vec![body]);
    let mut setup = Setup::new(&mut world, std::path::Path::new("."));
    setup.next_plugin("mechanical");
    let mut mechanical = mechanical.ready(&mut setup).expect("valid");
    let positions = &world.body(0).points.position;
    let solid = &mut mechanical.run.solid;
    let displacement: Vec<f64> = positions
        .iter()
        .flat_map(|x| [strain * x.x, strain * x.y, 0.0])
        .collect();
    solid.set_displacement(&displacement, &[]);
    let mut force = vec![0.0; displacement.len()];
    solid.evaluate(Wanted::force(&mut force));
    solid.break_bonds(0.0, &mut vec![0.0; positions.len()]);
    let (family, broken) = (
        solid.base().family(),
        solid.base().fracture().expect("it breaks").broken(),
    );
    let mut found = [Vec::new(), Vec::new()];
    for point in 0..positions.len() {
        family.for_each_bond(point, |number, _, slot| {
            let other = family.point_in(slot).expect("no layers");
            let sides = [point, other].map(|p| side(positions[p].x));
            found[usize::from(!broken.is_broken(point, number))].push(sides);
        });
    }
    found
}

fn variants() -> Vec<(&'static str, &'static str, bool)> {
    let mut variants = Vec::new();
    for (formulation, criterion) in [
        ("bond", "stretch"),
        ("bond", "energy"),
        ("ordinary", "stretch"),
        ("ordinary", "energy"),
        ("correspondence", "stretch"),
    ] {
        variants.extend([false, true].map(|cloud| (formulation, criterion, cloud)));
    }
    variants
}

/// Bonds to a weak layer and those from one side of it to the other have its strength; those within a half do not.
#[test]
fn a_weak_layer_breaks_at_its_own_strength() {
    for (formulation, criterion, cloud) in variants() {
        for kinematics in ["linear", "finite"] {
            let keys = format!(
                "formulation = '{formulation}'\nkinematics = '{kinematics}'\nhorizon = 3\n\
                 fracture = {{ criterion = '{criterion}' }}"
            );
            let body = bar(criterion, [1.0, 1e-2], cloud);
            // far above the strength of the layer, far below that of the halves
            let [broken, whole] = broken_and_whole(body, &keys, 1e-4);
            let is_within = |sides: &[i32; 2]| sides[0] == sides[1] && sides[0] != 0;
            assert!(!broken.is_empty() && !whole.is_empty());
            assert!(
                broken.iter().all(|sides| !is_within(sides)),
                "{keys} {cloud}"
            );
            assert!(whole.iter().all(is_within), "{keys} {cloud}");
        }
    }
}

/// An interface breaks at its own strength, smaller or larger than that of the material.
#[test]
fn an_interface_has_a_strength_of_its_own() {
    for (formulation, criterion, cloud) in variants() {
        for factor in [1e-2, 1e2] {
            let limit = match criterion {
                "stretch" => format!("critical_stretch = {}", 1e-3 * factor),
                _ => format!("fracture_energy = {}", 100.0 * factor * factor),
            };
            let at = 8.0 * SPACING;
            for place in [
                "between = ['layer', 'right']".to_string(),
                format!("through = [[{at}, -1], [{at}, 1]]"),
            ] {
                // the layer is of the material of the halves
                let body = bar(criterion, [1.0, 1.0], cloud);
                let keys = format!(
                    "formulation = '{formulation}'\nhorizon = 3\n[fracture]\ncriterion = '{criterion}'\n\
                     interface = {{ {place}, {limit} }}"
                );
                let is_line = place.contains("through");
                let crosses = |sides: &[i32; 2]| match is_line {
                    true => (sides[0] > 0) != (sides[1] > 0),
                    // bonds from the left to the right pass through the layer, too
                    false => (sides[0] > 0) != (sides[1] > 0),
                };
                let strain = if factor < 1.0 { 1e-4 } else { 1e-2 };
                let [broken, whole] = broken_and_whole(body, &keys, strain);
                let (crossing, others) = match factor < 1.0 {
                    true => (broken, whole),
                    false => (whole, broken),
                };
                assert!(!crossing.is_empty() && !others.is_empty());
                assert!(crossing.iter().all(crosses), "{keys} {cloud}");
                assert!(!others.iter().any(crosses), "{keys} {cloud}");
            }
        }
    }
}

/// The fracture energy of an interface gives the critical stretch that it gives a material.
#[test]
fn energies_of_interfaces_are_limits_as_those_of_materials() {
    let keys = |interface: &str| {
        format!("formulation = 'ordinary'\nhorizon = 3\nfracture = {{ {interface} }}")
    };
    for strain in [1e-5, 1e-4, 3e-4, 1e-3, 3e-3] {
        let body = bar("energy", [1.0, 1.0], false);
        let [plain, _] = broken_and_whole(body, &keys(""), strain);
        let body = bar("energy", [1.0, 1.0], false);
        let same = "interface = { between = ['left', 'right'], fracture_energy = 100 }";
        let [with, _] = broken_and_whole(body, &keys(same), strain);
        assert_eq!(plain.len(), with.len(), "{strain}");
    }
}

#[test]
fn materials_thinner_than_the_horizon_are_warned_of() {
    let warnings = |horizon: f64, layer: f64| {
        let keys = format!("formulation = 'ordinary'\nhorizon = {horizon}\nfracture = {{}}");
        let mechanical: Mechanical = read(&keys);
        let body = bar("stretch", [1.0, layer], false);
        let warnings = simulation(body, vec![Box::new(mechanical)], vec![], 1.0).warnings();
        let thin = warnings
            .iter()
            .filter(|w| w.message.contains("thinner than the horizon"));
        thin.count()
    };
    assert_eq!(warnings(3.0, 0.1), 1);
    assert_eq!(warnings(3.0, 1.0), 0);
}

#[test]
fn interfaces_that_make_no_sense_are_refused() {
    for (interface, message) in [
        (
            "{ between = ['left', 'nowhere'], fracture_energy = 1 }",
            "no region or material `nowhere`",
        ),
        (
            "{ between = ['left', 'left'], fracture_energy = 1 }",
            "belongs to both sides",
        ),
        ("{ between = ['left', 'right'] }", "no strength, or two"),
        ("{ fracture_energy = 1 }", "no description, or several"),
        (
            "{ through = [[1, 1], [2, 2]], fracture_energy = 1 }",
            "no bond crosses interface",
        ),
        (
            "{ through = [[1, 1]], fracture_energy = 1 }",
            "length or area",
        ),
        (
            "[{ between = ['left', 'right'], fracture_energy = -1 }]",
            "strength is -1",
        ),
    ] {
        let mechanical: Mechanical = read(&format!("fracture = {{ interface = {interface} }}"));
        let mut world = World::new(vec![bar("energy", [1.0, 1.0], false)]);
        let mut setup = Setup::new(&mut world, std::path::Path::new("."));
        setup.next_plugin("mechanical");
        let error = mechanical
            .ready(&mut setup)
            .err()
            .expect("refused")
            .to_string();
        assert!(error.contains(message), "{interface}: {error}");
    }
    let stretch = "fracture = { criterion = 'energy', interface = { between = ['left', 'right'], critical_stretch = 1 } }";
    let mechanical: Mechanical = read(stretch);
    let mut world = World::new(vec![bar("energy", [1.0, 1.0], false)]);
    let mut setup = Setup::new(&mut world, std::path::Path::new("."));
    setup.next_plugin("mechanical");
    assert!(mechanical.ready(&mut setup).is_err());
}
