//! What plugins may declare, and which mistakes are told to whom.

use nalgebra::Vector3;

use super::*;
use crate::body::{Body, Face};
use crate::family::{Correction, FamilySpec, LayerRule};
use crate::field::{Key, keys};
use crate::material::Material;
use crate::shape::{BoxShape, Shape};
use crate::world::Wall;
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
        (Given, [true, true, false, false, false]),
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

/// The case gives a field to any number of readers, or a plugin computes it.
#[test]
fn a_given_field_needs_no_plugin() {
    let mut world = world();
    let mut setup = Setup::new(&mut world, Path::new("."));
    for key in [&X, &SINK, &X] {
        setup.next_plugin("reader");
        setup.given(0, key).expect("given");
    }
    setup.read(0, &X).expect("provided");
    setup.write(0, &SINK).expect("no other writer");
    assert_eq!(finished(setup), Ok(()));
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
    assert_eq!(setup.world().density_at_points(0).expect("given"), expected);
    assert_eq!(
        setup
            .world()
            .constant_at_points(0, "density")
            .expect("given"),
        expected
    );
    let table = setup.world().constant_at_points(0, "youngs_modulus");
    let message = table.expect_err("of steel").to_string();
    assert!(message.contains("`youngs_modulus` is a table"), "{message}");
    let lacking = setup.world().property(0, "conductivity");
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
    let is = |setup: &Setup<'_>, access| {
        [(0, X), (0, SINK), (1, X), (1, SINK)].map(|(b, key)| setup.is_declared(b, &key, access))
    };
    assert_eq!(is(&setup, Access::Add), [false, true, false, false]);
    assert_eq!(is(&setup, Access::Write), [true, false, false, false]);
    assert_eq!(is(&setup, Access::Read), [false; 4]);
    setup.read(0, &X).expect("provided");
    assert_eq!(is(&setup, Access::Read), [true, false, false, false]);
    assert!(setup.consume_if_added(1, &SINK).expect("free").is_none());
    assert!(setup.take_if_added(1, &SINK).expect("free").is_none());
    assert!(setup.consume_if_added(0, &SINK).expect("free").is_some());
    let refused = setup.add(0, &SINK).expect_err("a physics");
    assert!(
        refused
            .to_string()
            .contains("a physics cannot add to `added`")
    );
    assert_eq!(finished(setup), Ok(()));
    let first = world.fields().find(0, "x").expect("a field");
    let values = world.fields().field(first).data().flat().to_vec();
    assert_eq!(values, (0..12).map(f64::from).collect::<Vec<_>>());
}

#[test]
fn what_is_read_is_provided_and_what_is_added_is_taken_up() {
    type Declare = fn(&mut Setup<'_>) -> Result<(), SetupError>;
    let cases: [(Declare, Option<&str>); 6] = [
        (
            |s| s.read(0, &X).map(|_| ()),
            Some("which no physics or coupler provides"),
        ),
        (|s| s.read_if_provided(0, &X).map(|_| ()), None),
        (|s| s.add(0, &SINK).map(|_| ()), Some("`added`")),
        (
            |s| s.give(0, &SINK, Access::GiveSum).map(|_| ()),
            Some("`added`"),
        ),
        (
            |s| {
                s.layer(0, &X, Face::XMin, LayerRole::Prescribed)
                    .map(|_| ())
            },
            Some("which no physics or coupler provides"),
        ),
        (
            |s| {
                s.layer(0, &X, Face::XMin, LayerRole::IfProvided)
                    .map(|_| ())
            },
            None,
        ),
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
        unread: FactRule {
            key: "fluid",
            message: "no physics of body `{body}` has walls",
            expected: "a fluid",
        },
    };
    let mut world = world();
    let mut setup = Setup::new(&mut world, Path::new("."));
    setup.next_plugin("interface");
    setup.publish(0, wall).expect("free");
    (setup.publish(1, ExpectedGift::of(&keys::IMPULSE))).expect("any number of gifts");
    assert!(setup.is_declared(1, &keys::IMPULSE, Access::Add));
    assert!(!setup.is_declared(0, &keys::IMPULSE, Access::Add));
    assert!(!setup.is_declared(1, &SINK, Access::Add));
    setup.next_physics("solid");
    setup.take_if_added(1, &keys::IMPULSE).expect("free");
    setup.next_physics("fluid");
    assert_eq!(setup.facts::<Wall>(1).count(), 0);
    assert_eq!(setup.facts::<Wall>(0).collect::<Vec<_>>(), [&wall]);
    setup.give(1, &keys::IMPULSE, Access::Give).expect("free");
    assert_eq!(finished(setup), Ok(()));

    let mut world = self::world();
    let mut setup = Setup::new(&mut world, Path::new("."));
    setup.next_plugin("another");
    setup.next_plugin("interface");
    setup.publish(0, wall).expect("free");
    setup.next_physics("solid");
    let (plugin, key, message) = finished(setup).expect_err("no fluid");
    assert_eq!((plugin, &*key), (1, "fluid"));
    assert!(message.contains("no physics of body `plate` has walls"));
}

#[test]
fn what_couplers_share_is_found_by_name_and_type() {
    let mut world = world();
    let mut setup = Setup::new(&mut world, Path::new("."));
    setup.next_plugin("torch");
    setup.share(Rc::new(1.5_f64));
    setup.next_plugin("laser");
    setup.share(Rc::new(2_u8));
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
    let upper = setup
        .layer(0, &X, Face::YMax, LayerRole::Prescribed)
        .expect("free");
    setup
        .layer(0, &X, Face::XMin, LayerRole::Free)
        .expect("another face");
    setup
        .layer(1, &X, Face::YMax, LayerRole::Prescribed)
        .expect("another body");
    setup
        .layer(0, &SINK, Face::YMax, LayerRole::Free)
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
        let refused = setup
            .layer(0, &X, face, LayerRole::Prescribed)
            .expect_err("not free");
        assert_eq!(refused.key, "face");
        assert!(refused.to_string().contains(message), "{refused}");
    }
    setup.next_physics("a physics");
    let layers = setup.layers(0, &X);
    assert_eq!(layers.faces(), [Face::XMin, Face::YMax]);
    assert_eq!(layers.prescribed, [Face::YMax]);
    let scales: Vec<f64> = layers.rules.iter().map(|r| r.scale[0]).collect();
    assert_eq!(
        scales,
        [1.0, -1.0],
        "only the layer of the face is announced"
    );
    assert_eq!(setup.layers(1, &SINK).faces(), []);
}

#[test]
fn a_periodic_body_has_no_layer_along_its_axis() {
    let mut plate = world().body(0).clone();
    plate.repeat(&[crate::Axis::X]).expect("it fills its box");
    let mut world = World::new(vec![plate]);
    let mut setup = Setup::new(&mut world, Path::new("."));
    setup.next_plugin("a boundary");
    let refused = setup
        .layer(0, &X, Face::XMax, LayerRole::Prescribed)
        .expect_err("a copy");
    assert!(refused.to_string().contains("is periodic across face"));
    setup
        .layer(0, &X, Face::YMax, LayerRole::Prescribed)
        .expect("free");
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
    assert!(first == second && first != third);
    let bonds = |family| setup.world().family(family).bonds();
    assert!(bonds(bar) < bonds(first) && bonds(first) < bonds(third));
    let requests = setup.requests();
    let told: Vec<_> = requests
        .iter()
        .map(|request| (&*request.plugin, request.body))
        .collect();
    assert_eq!(told, [("heat", 0), ("stress", 0), ("stress", 1)]);
}

#[test]
fn one_physics_decides_where_points_are() {
    let mut world = world();
    let mut setup = Setup::new(&mut world, Path::new("."));
    setup.next_physics("flow");
    setup.publish(0, Description::Eulerian).expect("the first");
    setup.next_physics("heat");
    let described = [0, 1].map(|body| setup.world().description(body));
    let expected = [Description::Eulerian, Description::TotalLagrangian];
    assert_eq!(described, expected);
    let refused = setup.publish(0, Description::UpdatedLagrangian);
    let refused = refused.expect_err("one physics").to_string();
    assert!(
        refused.contains("`flow` already decides where the points of body `plate` are"),
        "{refused}"
    );
    assert!(setup.decides_points(0) && !setup.decides_points(1));
}

/// What happens to points is refused for plugins that act on them and do not support it, in whatever order they come.
#[test]
fn plugins_support_what_happens_to_the_points_on_which_they_act() {
    let births = Changes::of(&[Change::Births]);
    for (supports, body, is_refused) in [
        (Changes::NONE, 0, true),
        (births, 0, false),
        (Changes::of(&[Change::Motion]), 0, true),
        // the other body keeps its material
        (Changes::NONE, 1, false),
    ] {
        for is_before in [true, false] {
            let mut world = world();
            let mut setup = Setup::new(&mut world, Path::new("."));
            let acting = setup.add_plugin("heating", false, supports);
            let deposit = setup.add_plugin("deposit", false, births);
            let mut order = [acting, deposit];
            if !is_before {
                order.reverse();
            }
            for plugin in order {
                setup.enter(plugin);
                match plugin == deposit {
                    true => setup.change_material(0, Change::Births, &[3]).map(|_| ()),
                    false => setup.add(body, &SINK).map(|_| ()),
                }
                .expect("told at the end");
            }
            let physics = setup.add_plugin("physics", true, births);
            setup.enter(physics);
            setup.consume(body, &SINK).expect("free");
            let refused = finished(setup).err();
            assert_eq!(refused.is_some(), is_refused, "{supports:?} {body}");
            if let Some((plugin, _, message)) = refused {
                assert_eq!(plugin, acting);
                let expected =
                    "`deposit` adds material to body `plate`, which `heating` does not support";
                assert!(message.contains(expected), "{message}");
            }
        }
    }
}

#[test]
fn a_plugin_may_refuse_a_change_that_its_type_supports() {
    for (moved, expected) in [(0, Some((1, "faces"))), (1, None)] {
        let mut world = world();
        let mut setup = Setup::new(&mut world, Path::new("."));
        setup.next_plugin("another");
        setup.next_plugin("source");
        let error = SetupError::value("faces", "the points move", "points at rest");
        setup
            .refuse(0, Change::Motion, error)
            .expect("not known yet");
        setup.next_physics("fluid");
        setup
            .publish(moved, Description::UpdatedLagrangian)
            .expect("nobody else");
        let found = finished(setup).err();
        let found = found.as_ref().map(|(plugin, key, _)| (*plugin, &**key));
        assert_eq!(found, expected);
    }
}
