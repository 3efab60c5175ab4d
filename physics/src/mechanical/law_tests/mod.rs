//! Solids with laws of elasticity of their own.

mod bonds;
mod orthotropic;
mod points;

use perimelt_core::body::Body;
use perimelt_core::{Setup, World};

use super::Mechanical;
use super::solid::{EnergyKind, PointStates, Solid, Stiffness, Wanted};

fn solid(body: &Body, keys: &str) -> Box<dyn Solid> {
    let mechanical: Mechanical = crate::testing::read(keys);
    let mut world = World::new(vec![body.clone()]);
    let mut setup = Setup::new(&mut world, std::path::Path::new("."));
    setup.next_plugin("mechanical");
    mechanical.ready(&mut setup).expect("valid").run.solid
}

fn force(solid: &mut dyn Solid, displacement: &[f64]) -> Vec<f64> {
    let mut force = vec![0.0; displacement.len()];
    solid.set_displacement(displacement, &[]);
    solid.evaluate(Wanted::force(&mut force));
    force
}

/// Displacements of up to `size` (m) without order.
fn scattered(components: usize, size: f64, seed: f64) -> Vec<f64> {
    let number = |i: usize| ((12.9898 * (i as f64 + seed)).sin() * 43758.5453).rem_euclid(2.0);
    (0..components).map(|i| size * (number(i) - 1.0)).collect()
}

/// Elastic energy over the volume of a point, at the state of the force.
fn energy(solid: &mut dyn Solid, displacement: &[f64]) -> f64 {
    force(solid, displacement);
    let densities = solid.evaluate(Wanted::energy(EnergyKind::Elastic)).energy;
    densities.iter().map(|[density, _]| density).sum()
}

/// Forces of a body in disorder are minus the derivative of its energy and, if there is one, the tangent is that of the forces.
fn check_derivatives(body: &Body, keys: &str, has_tangent: bool) {
    check_derivatives_of(&mut *solid(body, keys), body, keys, has_tangent);
}

/// [`check_derivatives`] of a solid.
fn check_derivatives_of(solid: &mut dyn Solid, body: &Body, keys: &str, has_tangent: bool) {
    let components = 3 * solid.base().nodes.positions(body).len();
    let in_body = |(i, u): (usize, f64)| if i % 3 < body.dimension { u } else { 0.0 };
    let scattered = |size: f64, seed: f64| -> Vec<f64> {
        let numbers = scattered(components, size, seed).into_iter().enumerate();
        numbers.map(in_body).collect()
    };
    let (about, along) = (scattered(5e-5, 0.0), scattered(1e-8, 7.0));
    let at = |factor: f64| -> Vec<f64> {
        let both = about.iter().zip(&along);
        both.map(|(u, du)| u + factor * du).collect()
    };
    solid.set_points(PointStates {
        eigenstrain: Some(&self::scattered(body.points.len(), 0.01, 3.0)),
        ..PointStates::default()
    });
    let forces = force(solid, &about);
    let work = forces.iter().zip(&along);
    let work: f64 = work.map(|(f, du)| f * du).sum();
    let change = 0.5 * (energy(solid, &at(1.0)) - energy(solid, &at(-1.0)));
    // rounding of the energies
    let error = (change / work + 1.0).abs();
    assert!(error < 1e-6, "{keys}: {change:e} {work:e}");
    if !has_tangent {
        return;
    }
    let (up, down) = (force(solid, &at(1.0)), force(solid, &at(-1.0)));
    force(solid, &about);
    solid.linearise(0.0);
    solid.set_displacement(&along, &[]);
    let mut tangent = vec![0.0; components];
    solid.stiffness(Stiffness::Tangent, &mut tangent);
    let largest = tangent.iter().fold(0.0f64, |l, t| l.max(t.abs()));
    for i in 0..components {
        let difference = 0.5 * (down[i] - up[i]);
        let error = (difference - tangent[i]).abs() / largest;
        assert!(error < 1e-6, "{keys}: {difference:e} {:e}", tangent[i]);
    }
}
