//! What plugins may declare, and which mistakes are told to whom.

use super::*;
use crate::family::{Correction, FamilySpec, LayerRule};
use crate::shape::{BoxShape, Shape};
use crate::world::configuration::Description;

/// A plate of 4 by 3 points, half of them of a second material, and a bar.
fn world() -> World {
    let block = |name: &str, dimension: usize, max: [f64; 3]| {
        let min = [0.0; 3];
        let shape = Shape::Box(BoxShape { min, max });
        Body::fill(name, &shape, dimension, 1.0, 1.0).expect("a valid body")
    };
    let mut plate = block("plate", 2, [4.0, 3.0, 1.0]);
    let material = |name: &str, text: &str| {
        let section = toml::from_str(text).expect("a valid material");
        Material::new(name, section, None).expect("a valid material")
    };
    let steel = "density = 8000\nyoungs_modulus = { temperature = [300, 400], value = [2e11, 1e11] }\npoissons_ratio = 0.3";
    let copper = "density = 9000\nyoungs_modulus = 1.2e11\npoissons_ratio = 0.3";
    plate.materials = vec![material("steel", steel), material("copper", copper)];
    let second = |x: &Vector3<f64>| u16::from(x.x > 2.0);
    plate.material_of_point = plate.points.position.iter().map(second).collect();
    let region = |max: [f64; 3]| plate.points_in(&Shape::Box(BoxShape { min: [0.0; 3], max }));
    let (left, empty) = (region([1.0, 3.0, 1.0]), region([0.1, 0.1, 1.0]));
    plate.regions.insert("left".into(), left);
    plate.regions.insert("empty".into(), empty);
    World::new(vec![plate, block("bar", 2, [4.0, 1.0, 1.0])])
}

const X: Key<f64> = Key::new("x", "1", "a number");
const SINK: Key<f64> = Key::new("added", "1/s", "added to x");

fn spec() -> FamilySpec {
    FamilySpec {
        correction: Correction::None,
        ..FamilySpec::new(2.0)
    }
}

/// Plugin at fault, and key and message of the only mistake, if there is one.
fn finished(setup: Setup<'_>) -> Result<(), (usize, String, String)> {
    let refused = setup.finish().map(|_| ());
    refused.map_err(|mistakes| {
        let [(plugin, e)] = &mistakes[..] else {
            panic!("{mistakes:?}");
        };
        (*plugin, e.key.clone(), e.to_string())
    })
}

#[test]
fn each_access_provides_reads_gives_consumes_or_writes() {
    use Access::*;
    for (access, expected) in [
        // provides, reads, gives, consumes, writes
        (Own, [true, false, false, false, false]),
        (Consume, [false, true, false, true, false]),
        (Take, [false, true, false, true, false]),
        (Write, [true, false, false, false, true]),
        (Add, [false, false, false, false, true]),
        (Give, [false, false, true, false, false]),
        (GiveSum, [false, false, true, false, false]),
        (Read, [false, true, false, false, false]),
        (ReadIfProvided, [false, true, false, false, false]),
        (Layer, [false, false, false, false, true]),
        (LayerIfProvided, [false, false, false, false, true]),
    ] {
        let found = [
            access.provides(),
            access.reads(),
            access.gives(),
            access.consumes(),
            access.writes(),
        ];
        assert_eq!(found, expected, "{access:?}");
    }
}

#[test]
fn bodies_and_regions_are_found_by_name() {
    let mut world = world();
    let setup = Setup::new(&mut world, Path::new("folder"));
    assert_eq!(setup.find_body(Some("bar")).expect("a body"), 1);
    for (name, message) in [(None, "plate, bar"), (Some("bra"), "did you mean `bar`?")] {
        let refused = setup.find_body(name).expect_err("which one?");
        assert_eq!(refused.key, "body");
        assert!(refused.to_string().contains(message), "{refused}");
    }
    let left = setup.region(0, "zone", "left").expect("a region");
    assert_eq!(left.points, [0, 4, 8]);
    for (name, message) in [
        ("lef", "did you mean `left`?"),
        ("empty", "region `empty` holds no point of body `plate`"),
    ] {
        let refused = setup.region(0, "zone", name).expect_err("no points");
        assert_eq!(refused.key, "zone");
        assert!(refused.to_string().contains(message), "{refused}");
    }
    assert_eq!(setup.path("log.mcap"), Path::new("folder/log.mcap"));
    let mut alone = World::new(vec![world.body(0).clone()]);
    let setup = Setup::new(&mut alone, Path::new("."));
    assert_eq!(setup.find_body(None).expect("the only one"), 0);
}

#[test]
fn properties_are_those_of_the_material_of_a_point() {
    let mut world = world();
    let setup = Setup::new(&mut world, Path::new("."));
    let row = [8000.0, 8000.0, 9000.0, 9000.0];
    let expected = [row, row, row].concat();
    assert_eq!(setup.density_at_points(0).expect("given"), expected);
    assert_eq!(
        setup.constant_at_points(0, "density").expect("given"),
        expected
    );
    let table = setup.constant_property(0, "youngs_modulus");
    let message = table.expect_err("of steel").to_string();
    assert!(message.contains("`youngs_modulus` is a table"), "{message}");
    let lacking = setup.property(0, "conductivity");
    let message = lacking.expect_err("not given").to_string();
    assert!(
        message.contains("material `steel` of body `plate`"),
        "{message}"
    );
}

#[test]
fn a_field_has_one_provider_one_consumer_and_one_type() {
    type Declare = fn(&mut Setup<'_>) -> Result<(), SetupError>;
    let own: Declare = |s| s.own(0, &X).map(|_| ());
    let write: Declare = |s| s.write(0, &X).map(|_| ());
    let read: Declare = |s| s.read(0, &X).map(|_| ());
    let consume: Declare = |s| s.consume(0, &X).map(|_| ());
    let take: Declare = |s| s.take(0, &X).map(|_| ());
    for (first, second, is_refused) in [
        (own, own, true),
        (own, write, true),
        (write, own, true),
        (consume, take, true),
        (take, consume, true),
        (own, read, false),
        (own, consume, false),
        (read, read, false),
    ] {
        let mut world = world();
        let mut setup = Setup::new(&mut world, Path::new("."));
        setup.next_plugin("the first");
        first(&mut setup).expect("free");
        // the same name on another body is another field
        setup.own(1, &X).expect("free");
        setup.next_plugin("the second");
        match second(&mut setup) {
            Ok(()) => assert!(!is_refused),
            Err(e) => {
                assert!(is_refused, "{e}");
                assert!(e.to_string().contains("the first"), "{e}");
            }
        }
    }
    let mut world = world();
    let mut setup = Setup::new(&mut world, Path::new("."));
    setup.next_plugin("the first");
    setup.own(0, &X).expect("free");
    let vector: Key<Vector3<f64>> = Key::new("x", "1", "a vector");
    let refused = setup.read(0, &vector).expect_err("a number");
    let Problem::FieldType { asked, present, .. } = refused.problem else {
        panic!("{refused}");
    };
    assert_eq!((asked, present), (3, 1));
}

#[test]
fn a_physics_knows_what_couplers_add_and_write() {
    let mut world = world();
    let mut setup = Setup::new(&mut world, Path::new("."));
    setup.next_plugin("a coupler");
    setup.add(0, &SINK).expect("free");
    let derived = setup.write(0, &X).expect("free");
    setup.set_first(derived, |point| point as f64);
    setup.next_physics("a physics");
    assert!(setup.is_added(0, &SINK) && !setup.is_added(1, &SINK) && !setup.is_added(0, &X));
    assert!(setup.is_written(0, &X) && !setup.is_written(1, &X) && !setup.is_written(0, &SINK));
    assert!(!setup.is_read(0, &X));
    setup.read(0, &X).expect("provided");
    assert!(setup.is_read(0, &X) && !setup.is_read(1, &X));
    assert!(setup.consume_if_added(1, &SINK).expect("free").is_none());
    assert!(setup.take_if_added(1, &SINK).expect("free").is_none());
    assert!(setup.consume_if_added(0, &SINK).expect("free").is_some());
    let refused = setup.add(0, &SINK).expect_err("a physics");
    assert!(refused.to_string().contains("a physics adds to `added`"));
    assert_eq!(finished(setup), Ok(()));
    let first = world.fields().find(0, "x").expect("a field");
    let values = world.fields().field(first).data().flat().to_vec();
    assert_eq!(values, (0..12).map(f64::from).collect::<Vec<_>>());
}

#[test]
fn what_is_read_is_provided_and_what_is_added_is_taken_up() {
    type Declare = fn(&mut Setup<'_>) -> Result<(), SetupError>;
    let cases: [(Declare, Option<&str>); 6] = [
        (|s| s.read(0, &X).map(|_| ()), Some("nobody provides it")),
        (|s| s.read_if_provided(0, &X).map(|_| ()), None),
        (|s| s.add(0, &SINK).map(|_| ()), Some("`added`")),
        (|s| s.give_sum(0, &SINK).map(|_| ()), Some("`added`")),
        (
            |s| s.layer(0, &X, Face::XMin, true).map(|_| ()),
            Some("nobody provides it"),
        ),
        (|s| s.layer_if_provided(0, &X, Face::XMin).map(|_| ()), None),
    ];
    for (declare, message) in cases {
        let mut world = world();
        let mut setup = Setup::new(&mut world, Path::new("."));
        setup.next_plugin("innocent");
        setup.own(1, &X).expect("free");
        setup.next_plugin("at fault");
        declare(&mut setup).expect("told at the end");
        match (finished(setup), message) {
            (Ok(()), None) => {}
            (Err((1, _, found)), Some(message)) => {
                assert!(
                    found.contains(message) && found.contains("at fault"),
                    "{found}"
                );
            }
            (found, _) => panic!("{found:?} {message:?}"),
        }
    }
}

#[test]
fn walls_are_taken_by_the_physics_of_the_fluid() {
    let wall = Wall {
        other: 1,
        slip: true,
    };
    let mut world = world();
    let mut setup = Setup::new(&mut world, Path::new("."));
    setup.next_plugin("interface");
    setup.set_wall(0, wall);
    assert!(setup.is_added(1, &keys::IMPULSE) && !setup.is_added(0, &keys::IMPULSE));
    assert!(!setup.is_added(1, &SINK));
    setup.next_physics("solid");
    setup.take_if_added(1, &keys::IMPULSE).expect("free");
    setup.next_physics("fluid");
    assert_eq!(setup.walls(1), []);
    assert_eq!(setup.walls(0), [wall]);
    setup.give_impulses(&wall).expect("free");
    assert_eq!(finished(setup), Ok(()));

    let mut world = self::world();
    let mut setup = Setup::new(&mut world, Path::new("."));
    setup.next_plugin("another");
    setup.next_plugin("interface");
    setup.set_wall(0, wall);
    setup.next_physics("solid");
    let (plugin, key, message) = finished(setup).expect_err("no fluid");
    assert_eq!((plugin, &*key), (1, "fluid"));
    assert!(message.contains("no physics of body `plate` has walls"));
}

#[test]
fn what_couplers_share_is_found_by_name_and_type() {
    let mut world = world();
    let mut setup = Setup::new(&mut world, Path::new("."));
    setup.share("torch", Rc::new(1.5_f64));
    setup.share("laser", Rc::new(2_u8));
    let found: Rc<f64> = setup
        .shared("source", "heat source", "torch")
        .expect("known");
    assert_eq!(*found, 1.5);
    for name in ["torhc", "laser"] {
        let refused = setup.shared::<f64>("source", "heat source", name);
        let refused = refused.expect_err("another name or type");
        assert_eq!(refused.key, "source");
        let Problem::UnknownName { known, .. } = refused.problem else {
            panic!("{refused}");
        };
        assert_eq!(known, ["torch"]);
    }
}

#[test]
fn a_face_has_one_layer_for_each_field() {
    let mut world = world();
    let mut setup = Setup::new(&mut world, Path::new("."));
    setup.next_plugin("a boundary");
    let upper = setup.layer(0, &X, Face::YMax, true).expect("free");
    setup.layer(0, &X, Face::XMin, false).expect("another face");
    setup.layer(1, &X, Face::YMax, true).expect("another body");
    setup
        .layer(0, &SINK, Face::YMax, false)
        .expect("another field");
    let odd = LayerRule {
        scale: [-1.0; 3],
        ..LayerRule::even(Face::YMax)
    };
    setup.announce_layer(upper, odd);
    for (face, message) in [
        (Face::YMax, "face `y+` already has a layer for `x`"),
        (Face::ZMin, "a 2D body has no face `z-`"),
    ] {
        let refused = setup.layer(0, &X, face, true).expect_err("not free");
        assert_eq!(refused.key, "face");
        assert!(refused.to_string().contains(message), "{refused}");
    }
    setup.next_physics("a physics");
    let (handle, faces, prescribed) = setup.layers(0, &X);
    assert_eq!(faces, [Face::XMin, Face::YMax]);
    assert_eq!(prescribed, [Face::YMax]);
    let scales: Vec<f64> = setup
        .announced_layers(handle)
        .iter()
        .map(|r| r.scale[0])
        .collect();
    assert_eq!(
        scales,
        [1.0, -1.0],
        "only the layer of the face is announced"
    );
    assert_eq!(setup.layers(1, &SINK).1, []);
}

#[test]
fn a_periodic_body_has_no_layer_along_its_axis() {
    let mut plate = world().body(0).clone();
    plate.repeat(&[crate::Axis::X]).expect("it fills its box");
    let mut world = World::new(vec![plate]);
    let mut setup = Setup::new(&mut world, Path::new("."));
    setup.next_plugin("a boundary");
    let refused = setup.layer(0, &X, Face::XMax, true).expect_err("a copy");
    assert!(refused.to_string().contains("goes on as a copy"));
    setup.layer(0, &X, Face::YMax, true).expect("free");
}

#[test]
fn equal_requests_share_a_family_and_are_told_with_the_first_plugin() {
    let mut world = world();
    let mut setup = Setup::new(&mut world, Path::new("."));
    setup.next_plugin("heat");
    let first = setup.family(0, &spec()).expect("valid");
    setup.next_plugin("stress");
    let second = setup.family(0, &spec()).expect("valid");
    let wider = FamilySpec {
        correction: Correction::None,
        ..FamilySpec::new(3.0)
    };
    let third = setup.family(0, &wider).expect("valid");
    let bar = setup.family(1, &spec()).expect("valid");
    assert!(std::sync::Arc::ptr_eq(&first, &second));
    assert!(!std::sync::Arc::ptr_eq(&first, &third));
    assert!(bar.bonds() < first.bonds() && first.bonds() < third.bonds());
    let requests = setup.requests();
    let told: Vec<_> = requests
        .iter()
        .map(|(plugin, body, _)| (&**plugin, *body))
        .collect();
    assert_eq!(told, [("heat", 0), ("stress", 0), ("stress", 1)]);
    assert_eq!(setup.plugins_with_families(0).collect::<Vec<_>>(), [0, 1]);
    assert_eq!(
        setup.families().map(|(body, _)| body).collect::<Vec<_>>(),
        [0, 0, 1]
    );
}

/// The physics that decides where the points of a body are has its own families of it; others come after it.
#[test]
fn points_are_moved_or_passed_by_one_physics() {
    let mut world = world();
    let mut setup = Setup::new(&mut world, Path::new("."));
    setup.next_plugin("first");
    setup.family(1, &spec()).expect("of the other body");
    setup.next_plugin("flow");
    setup.family(0, &spec()).expect("its own");
    assert_eq!(setup.description(0), Description::TotalLagrangian);
    assert!(setup.flow_family(0).is_none());
    setup
        .flow_through(0, Description::Eulerian)
        .expect("nobody else");
    setup.next_plugin("heat");
    assert_eq!(setup.description(0), Description::Eulerian);
    let of_flow = setup.flow_family(0).map(|f| f.spec().clone());
    assert_eq!(of_flow, Some(spec()));
    assert!(setup.flow_family(1).is_none());
    let refused = setup.move_points(0).expect_err("one physics").to_string();
    assert!(
        refused.contains("`flow` already decides where the points of body `plate` are"),
        "{refused}"
    );
}

#[test]
fn a_plugin_that_needs_points_at_rest_is_at_fault_where_they_move() {
    for (moved, expected) in [(0, Some((1, "faces"))), (1, None)] {
        let mut world = world();
        let mut setup = Setup::new(&mut world, Path::new("."));
        setup.next_plugin("another");
        setup.next_plugin("convection");
        let error = SetupError::value("faces", "the points move", "points at rest");
        setup.refuse_moving_points(0, error);
        setup.next_physics("fluid");
        setup.move_points(moved).expect("nobody else");
        let found = finished(setup).err();
        let found = found.as_ref().map(|(plugin, key, _)| (*plugin, &**key));
        assert_eq!(found, expected);
    }
}
