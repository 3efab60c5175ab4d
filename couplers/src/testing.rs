//! A small world for the tests of couplers, in which the test plays the physics.

use std::path::Path;
use std::rc::Rc;

use nalgebra::Vector3;
use perimelt_core::body::Zone;
use perimelt_core::field::Value;
use perimelt_core::material::Material;
use perimelt_core::shape::{BoxShape, Shape};
use perimelt_core::world::TwoFluids;
use perimelt_core::world::exchange::Exchange;
use perimelt_core::{Body, Coupler, Key, RunningCoupler, Setup, SetupError, Step, World, keys};

/// Steel that melts, expands and radiates.
pub const STEEL: &str = "
    density = 8000
    specific_heat = 500
    conductivity = 40
    solidus = 1700
    liquidus = 1800
    latent_heat = 250e3
    thermal_expansion = { temperature = [300, 1300], value = [10e-6, 20e-6] }
    emissivity = 0.8
";

/// A block of unit cells with its lower corner in the origin; region `left` is its first layer.
pub fn block(cells: [usize; 3], dimension: usize, material: &str) -> Body {
    let max = cells.map(|c| c as f64);
    let shape = Shape::Box(BoxShape { min: [0.0; 3], max });
    let mut body = Body::fill("block", &shape, dimension, 1.0, 1.0).expect("a valid block");
    let section = toml::from_str(material).expect("a valid material");
    body.materials = vec![Material::new("steel", section, None).expect("a valid material")];
    let left = Shape::Box(BoxShape {
        min: [0.0; 3],
        max: [1.0, max[1], max[2]],
    });
    body.regions.insert("left".into(), body.points_in(&left));
    body
}

/// A plate of 2 x 2 m, 2D, with a round hole of 1 m in its middle, and a disc that fills the hole, of these spacings (m); the
/// lower left corner of the plate lies at `-offset` (m) along both axes.
pub fn disc_in_plate(spacings: [f64; 2], offset: f64) -> [Body; 2] {
    let corner = -offset;
    let disc = "sphere = { centre = [1, 1, 0.5], radius = 0.5 }";
    let plate = format!(
        "difference = {{ from = {{ box = {{ min = [{corner}, {corner}, 0], max = [2, 2, 1] }} }}, subtract = {{ {disc} }} }}"
    );
    let bodies = [("plate", &*plate, spacings[0]), ("disc", disc, spacings[1])];
    bodies.map(|(name, shape, spacing)| {
        let shape: Shape = toml::from_str(shape).expect("a shape");
        let mut body = Body::fill(name, &shape, 2, spacing, 1.0).expect("valid");
        body.materials = block([1, 1, 1], 3, STEEL).materials;
        body
    })
}

/// A body of 20 x 20 x 8 m with a fine part in the middle between coarse ends.
pub fn zones(dimension: usize) -> Body {
    let shape = Shape::Box(BoxShape {
        min: [0.0; 3],
        max: [20.0, 20.0, 8.0],
    });
    let zone = |from: f64, to: f64, spacing: f64| Zone {
        min: [from, 0.0, 0.0],
        max: [to, 20.0, 8.0],
        spacing,
        horizon_factor: 1.0,
    };
    let zones = [
        zone(0.0, 8.0, 2.0),
        zone(8.0, 14.0, 1.0),
        zone(14.0, 20.0, 2.0),
    ];
    let mut body = Body::fill_zones("block", &shape, dimension, 8.0, &zones).expect("valid");
    body.materials = block([1, 1, 1], 3, STEEL).materials;
    body
}

/// A coupler from the keys of its table.
pub fn read<C: serde::de::DeserializeOwned>(table: &str) -> C {
    toml::from_str(table).unwrap_or_else(|e| panic!("{e}"))
}

/// Prepares `coupler` as the first plugin and lets `physics` declare what it owns and consumes: the coupler that runs, and
/// what the physics got.
pub fn prepare<R>(
    world: &mut World,
    coupler: impl Coupler + 'static,
    physics: impl FnOnce(&mut Setup<'_>) -> R,
) -> Result<(Box<dyn RunningCoupler>, R), SetupError> {
    prepare_after(world, |_| (), coupler, physics)
}

/// Adds a second material to a body, `gas`, which flows through its points beside the first one.
pub fn add_gas(body: &mut Body, material: &str) {
    let section = toml::from_str(material).expect("a valid material");
    let gas = Material::new("gas", section, None).expect("a valid material");
    body.materials.push(gas);
}

/// Declares what the fluid of a body to which [`add_gas`] was applied does.
pub fn two_fluids(setup: &mut Setup<'_>, body: usize) {
    let materials = vec!["steel".to_owned(), "gas".to_owned()];
    let fluids = TwoFluids { materials };
    setup.publish(body, fluids).expect("the first");
    setup.own(body, &keys::FLUID_FRACTION).expect("free");
}

/// [`prepare`] after a physics that declares what it does before the coupler is prepared.
pub fn prepare_after<R>(
    world: &mut World,
    before: impl FnOnce(&mut Setup<'_>),
    coupler: impl Coupler + 'static,
    physics: impl FnOnce(&mut Setup<'_>) -> R,
) -> Result<(Box<dyn RunningCoupler>, R), SetupError> {
    let mut setup = Setup::new(world, Path::new("."));
    setup.next_plugin("the physics before");
    before(&mut setup);
    setup.next_plugin("the coupler");
    let mut coupler = Box::new(coupler);
    coupler.publish(&mut setup)?;
    let running = coupler.prepare(&mut setup)?;
    setup.next_plugin("the physics");
    let handles = physics(&mut setup);
    let finished = setup.finish();
    finished.map_err(|mut mistakes| mistakes.swap_remove(0).1)?;
    Ok((running, handles))
}

/// The message of a preparation that must fail, with the key at fault in front.
pub fn refusal(world: &mut World, coupler: impl Coupler + 'static) -> String {
    match prepare(world, coupler, |_| ()) {
        Err(e) => format!("{}: {e}", e.key),
        Ok(_) => panic!("the coupler must be refused"),
    }
}

/// Applies `coupler` for the second from `start`.
pub fn apply(world: &World, coupler: &mut dyn RunningCoupler, start: f64) {
    coupler
        .apply(world, Step::new(start, 1.0))
        .expect("the coupler applies");
}

/// All components of a field of the first body.
pub fn values<T: Value>(world: &World, key: &Key<T>) -> Vec<f64> {
    let index = world.fields().find(0, &key.name).expect("a known field");
    world.fields().field(index).data().flat().to_vec()
}

/// Sets a field of the first body, point by point.
pub fn set<T: Value>(world: &mut World, key: &Key<T>, value: impl Fn(usize) -> T) {
    let index = world.fields().find(0, &key.name).expect("a known field");
    let entries = bytemuck::cast_slice_mut(world.values_mut(index)).iter_mut();
    entries.enumerate().for_each(|(i, v)| *v = value(i));
}

/// Sum of a density times volume.
pub fn total(world: &World, key: &Key<f64>) -> f64 {
    let volumes = &world.body(0).points.volume;
    values(world, key)
        .iter()
        .zip(volumes)
        .map(|(v, w)| v * w)
        .sum()
}

/// Sets a vector field of the first body everywhere.
pub fn set_vector(world: &mut World, key: &Key<Vector3<f64>>, value: Vector3<f64>) {
    let index = world.fields().find(0, &key.name).expect("a known field");
    let points = world.values_mut(index).chunks_exact_mut(3);
    points.for_each(|v| v.copy_from_slice(value.as_slice()));
}

/// Prepares a boundary that exchanges heat with the first body, and plays its heat physics: the boundary that runs, and the
/// exchange.
pub fn exchange(
    world: &mut World,
    coupler: impl Coupler + 'static,
) -> (Box<dyn RunningCoupler>, Rc<Exchange>) {
    let prepared = prepare(world, coupler, |setup| {
        setup.own(0, &keys::TEMPERATURE).expect("free");
        setup.facts::<Rc<Exchange>>(0).next().cloned()
    });
    let (running, exchange) = prepared.expect("valid");
    (running, exchange.expect("one"))
}

/// Heat that each point of the first body takes up from an exchange (W), with the surface as warm as the points (K).
pub fn heat(world: &World, exchange: &Exchange, temperature: impl Fn(usize) -> f64) -> Vec<f64> {
    let mut heat = vec![0.0; world.body(0).points.len()];
    let law = exchange.law();
    for (i, cell) in exchange.cells().iter().enumerate() {
        let point = cell.point as usize;
        heat[point] += law.flux(i, temperature(point)).flux * cell.area;
    }
    heat
}

/// Compares the slopes of a law with differences of its fluxes at the first cell.
pub fn check_slopes(exchange: &Exchange, temperatures: &[f64]) {
    let law = exchange.law();
    for &t in temperatures {
        let step = 1e-4 * t;
        let [low, high] = [t - step, t + step].map(|t| law.flux(0, t).flux);
        let (slope, expected) = (law.flux(0, t).slope, (high - low) / (2.0 * step));
        let scale = expected.abs().max(1e-6);
        assert!(
            (slope - expected).abs() < 1e-3 * scale,
            "{t}: {slope} {expected}"
        );
    }
}
