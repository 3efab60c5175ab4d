//! Thermocapillary forces: a static film, drops and slopes of the tension.

use std::f64::consts::PI;

use nalgebra::Vector3;

use super::super::heat::FlowHeat;
use super::super::tests::{STEEL_AND_GAS, Tank, sides};
use super::*;
use crate::fluid::pair::FluidPair;

/// Gives a tank this temperature (K) by place, and forces along surfaces.
pub(in crate::fluid) fn heat(
    tank: &mut Tank,
    laws: SurfaceLaws,
    temperature: impl Fn(&Vector3<f64>) -> f64,
) {
    let rates = &mut tank.rates;
    let places = tank.body.points.position.iter();
    let temperature: Vec<f64> = places.map(temperature).collect();
    let mut heat = FlowHeat::new(Vec::new(), None, &tank.body);
    heat.start(&temperature, &temperature);
    rates.heat = Some(heat);
    let inverse = rates.inverse();
    rates.thermocapillary = Thermocapillary::new(laws, &tank.body, &rates.family, inverse);
}

/// On a drop in a gradient the curved interface pushes to the cold side where the tension is larger, and what acts along it pulls back:
/// by `pi R dgamma/dT grad T` each, with opposite signs.
#[test]
fn forces_of_a_closed_interface_balance() {
    let (n, radius, slope) = (64, 0.3, -2.0);
    let mut tank = Tank::with(2, n, sides(2), 2.015, Some(STEEL_AND_GAS));
    let spacing = 1.0 / n as f64;
    let distance = |x: &Vector3<f64>| radius - (x.x - 0.51).hypot(x.y - 0.497);
    let fraction = |x: &Vector3<f64>| 1.0 / (1.0 + (-distance(x) / (0.75 * spacing)).exp());
    let laws = SurfaceLaws {
        interface: Some(TensionLaw::linear(5.0, 300.0, slope)),
        conductivity: None,
        faces: Vec::new(),
    };
    heat(&mut tank, laws, |x| 300.0 + x.y);
    let fraction: Vec<f64> = tank.body.points.position.iter().map(fraction).collect();
    tank.rates.set_fraction(&fraction);
    (tank.rates).set_fluxes(&tank.velocity, &tank.density, &tank.pressure);
    tank.rates.find_surface_force(&tank.density);
    let rates = &tank.rates;
    let surface = rates.thermocapillary.as_ref().expect("forces");
    let mut steps = vec![[0.0; 2]; fraction.len()];
    let gradient = Gradient {
        inverse: rates.inverse(),
    };
    rates.family.sum(&gradient, [&rates.slots.step], &mut steps);
    let (mut across, mut along) = ([0.0; 2], [0.0; 2]);
    for (point, step) in steps.iter().enumerate() {
        let tension = rates.slots.tension[rates.slot[point] as usize];
        for a in 0..2 {
            across[a] += spacing * spacing * tension * step[a];
            along[a] += spacing * spacing * surface.force(point, 2)[a];
        }
    }
    let size = PI * radius * slope;
    assert!((along[1] / size - 1.0).abs() < 0.02, "{along:?} {size}");
    assert!((across[1] / size + 1.0).abs() < 0.02, "{across:?} {size}");
    assert!((along[1] + across[1]).abs() < 0.005 * size.abs());
    assert!(along[0].abs().max(across[0].abs()) < 1e-3 * size.abs());
    let largest = rates.state.tension.iter().copied().fold(0.0, f64::max);
    assert!(
        (rates.capillary_step() / STEEL_AND_GAS.capillary_step(spacing) - (5.0 / largest).sqrt())
            .abs()
            < 1e-12
    );
}

/// Outside of a plane layer the flow is that of a sharp interface, for any ratio of viscosities: the force along it has no power
/// in the flow of a uniform stress, whose velocity vanishes at the sharp interface. Forces at points in proportion to the rise
/// of H have one of the order of the width.
#[test]
fn the_stress_along_a_plane_layer_acts_at_the_interface() {
    // bonds of three spacings bridge the layer: the sampled power of the force has an error of 2 % of what the force at points has
    for (horizon, shift, viscosity, limit) in [
        (2.015, 0.0, [2.0, 1.0], 2e-3),
        (2.015, 0.5, [1.0, 2.0], 2e-3),
        (2.015, 0.3, [100.0, 1.0], 2e-3),
        (3.015, 0.0, [1.0, 2.0], 3e-2),
    ] {
        let (n, slope) = (32, -2.0);
        let pair = FluidPair {
            viscosity,
            ..STEEL_AND_GAS
        };
        let mut tank = Tank::with(2, n, sides(2), horizon, Some(pair.clone()));
        let spacing = 1.0 / n as f64;
        let width = pair.width * spacing;
        let distance = |x: &Vector3<f64>| x.y - 0.5 - shift * spacing;
        let fraction = |x: &Vector3<f64>| 1.0 / (1.0 + (-distance(x) / width).exp());
        let laws = SurfaceLaws {
            interface: Some(TensionLaw::linear(5.0, 300.0, slope)),
            conductivity: None,
            faces: Vec::new(),
        };
        heat(&mut tank, laws, |x| 300.0 + x.x);
        let fraction: Vec<f64> = tank.body.points.position.iter().map(fraction).collect();
        tank.rates.set_fraction(&fraction);
        (tank.rates).set_fluxes(&tank.velocity, &tank.density, &tank.pressure);
        tank.rates.find_surface_force(&tank.density);
        let surface = tank.rates.thermocapillary.as_ref().expect("forces");
        let places = &tank.body.points.position;
        let is_in_column = |i: &usize| (places[*i].x - 0.5 - 0.5 * spacing).abs() < 0.1 * spacing;
        let mut column: Vec<usize> = (0..places.len()).filter(is_in_column).collect();
        column.sort_by(|i, j| places[*i].y.total_cmp(&places[*j].y));
        let first = column[0];
        let mut velocity = distance(&places[first]) / viscosity[1];
        let [mut force, mut power, mut at_points] = [0.0; 3];
        let fluidity = |i: usize| 1.0 / pair.viscosity_of(fraction[i]);
        for (at, &i) in column.iter().enumerate() {
            if at > 0 {
                velocity += 0.5 * spacing * (fluidity(column[at - 1]) + fluidity(i));
            }
            let [x, y] = [surface.force(i, 2)[0], surface.force(i, 2)[1]];
            force += spacing * x;
            power += spacing * x * velocity;
            let c = fraction[i];
            at_points += spacing * 6.0 * (c * (1.0 - c)).powi(2) / width * velocity;
            assert!(y.abs() < 1e-9, "{y}");
        }
        assert!((force / slope - 1.0).abs() < 1e-3, "{force}");
        let scale = width * pair.jump_of_fluidity().abs();
        assert!(at_points.abs() > 0.8 * scale, "{at_points} {scale}");
        let error = (power / slope / scale).abs();
        assert!(error < limit, "{horizon} {viscosity:?}: {error}");
    }
}

/// The force on the points before a face adds up to the stress, for any horizon, and is that of the temperature of the first row.
#[test]
fn the_force_before_a_face_is_the_stress() {
    for horizon in [2.015, 3.015] {
        let (n, slope) = (12, -2.0);
        let mut tank = Tank::new(2, n, sides(2), horizon);
        let laws = SurfaceLaws {
            interface: None,
            conductivity: None,
            faces: vec![(Face::YMax, TensionLaw::linear(0.0, 0.0, slope))],
        };
        heat(&mut tank, laws, |x| 300.0 + 7.0 * x.x * x.y);
        tank.rates.find_surface_force(&tank.density);
        let surface = tank.rates.thermocapillary.as_ref().expect("forces");
        let spacing = 1.0 / n as f64;
        let mut columns = vec![0.0; n];
        for (point, place) in tank.body.points.position.iter().enumerate() {
            let [x, y] = [surface.force(point, 2)[0], surface.force(point, 2)[1]];
            columns[(place.x / spacing) as usize] += spacing * x;
            assert_eq!(y, 0.0);
        }
        let stress = slope * 7.0 * (1.0 - 0.5 * spacing);
        for sum in columns {
            assert!((sum / stress - 1.0).abs() < 1e-12, "{sum} {stress}");
        }
    }
}
