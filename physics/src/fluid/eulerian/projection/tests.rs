use std::f64::consts::TAU;

use nalgebra::Vector3;
use perimelt_core::body::Body;
use perimelt_core::family::{ByRules, LayerRule};
use perimelt_core::world::{ContactAngle, WallPlace};
use perimelt_core::{Face, SlotField};

use super::{Projection, ProjectionDomain, ProjectionKeys, VOLUME_2D, VOLUME_3D};
use crate::advection::Convection;
use crate::fluid::medium::Medium;
use crate::fluid::pair::FluidPair;
use crate::fluid::rates::{Rates, Terms};
use crate::fluid::state::Incompressible;
use crate::fluid::tests::{Filled, MirroredBox, flow, periodic};
use crate::fluid::walls::Walls;
use crate::testing::{run, set, values};

/// A fluid of 2 kg/m³ in a box of 1 m, of which the faces `mirrored` are planes of symmetry and the others periodic.
pub(super) struct Tank {
    pub(super) body: Body,
    pub(super) rates: Projection,
    medium: Medium,
    rules: Vec<LayerRule>,
    pub(super) velocity: Vec<Vector3<f64>>,
    pub(super) density: Vec<f64>,
    pub(super) pressure: Vec<f64>,
}

impl Tank {
    pub(super) fn new(dimension: usize, n: usize, mirrored: &[Face], horizon: f64) -> Tank {
        Tank::with(dimension, n, mirrored, horizon, None)
    }

    pub(super) fn with(
        dimension: usize,
        n: usize,
        mirrored: &[Face],
        horizon: f64,
        pair: Option<FluidPair>,
    ) -> Tank {
        let filled = MirroredBox {
            dimension,
            n,
            mirrored,
            horizon,
            viscosity: 1e-3,
        };
        let state = Box::new(Incompressible { tolerance: 1e-11 });
        let Filled {
            body,
            family,
            complete,
            medium,
            rules,
        } = filled.fill("incompressible", state);
        let points = body.points.len();
        let keys = ProjectionKeys { tolerance: 1e-11 };
        let domain = ProjectionDomain {
            family,
            complete,
            walls: Walls::default(),
            pair,
            heat: None,
            wetted: Vec::new(),
        };
        let rates = Projection::new(keys, Convection::Central, &body, domain);
        Tank {
            rules,
            rates,
            medium,
            velocity: vec![Vector3::zeros(); points],
            density: vec![2.0; points],
            pressure: vec![0.0; points],
            body,
        }
    }

    /// A step of `dt` (s) under a force, N/m³.
    pub(super) fn step(&mut self, dt: f64, force: Option<&[Vector3<f64>]>) {
        let terms = Terms {
            medium: &self.medium,
            force,
            density_diffusion: 0.0,
            acceleration_fraction: 1.0,
            rules: &self.rules,
            dt,
        };
        let (rates, velocity) = (&mut self.rates, &mut self.velocity);
        rates.set_fluxes(velocity, &self.density, &self.pressure);
        let mut slots = vec![SlotField::default(); self.body.dimension];
        for (axis, slots) in slots.iter_mut().enumerate() {
            let along = |point: usize| velocity[point][axis];
            slots.load(&rates.family, along, ByRules(&self.rules, axis));
        }
        rates.set_viscosity(&self.medium);
        rates.set_velocity(&slots, &self.density, &terms);
        let (density, pressure) = (&mut self.density, &mut self.pressure);
        let advanced = rates.advance_density(&terms, density, pressure);
        advanced.expect("a pressure");
        rates.set_pressure(pressure, force);
        rates.advance_velocity(&terms, dt, velocity, density);
    }
}

pub(super) fn sides(dimension: usize) -> &'static [Face] {
    &Face::ALL[..2 * dimension]
}

/// The pressure rises by the weight from row to row, up to the walls, and nothing moves; for any horizon.
#[test]
fn pressure_bears_the_weight_of_a_fluid_at_rest() {
    for (dimension, n, horizon) in [(2, 12, 2.015), (2, 12, 3.015), (3, 8, 2.015)] {
        let mut tank = Tank::new(dimension, n, sides(dimension), horizon);
        let points = tank.body.points.len();
        let mut weight = Vector3::new(1.0, -4.0, 0.0);
        if dimension == 3 {
            weight.z = 2.0;
        }
        let force = vec![weight; points];
        for _ in 0..3 {
            tank.step(0.01, Some(&force));
        }
        let place = &tank.body.points.position;
        for i in 0..points {
            let rise = weight.dot(&(place[i] - place[0]));
            let found = tank.pressure[i] - tank.pressure[0];
            assert!((found - rise).abs() < 1e-8, "{dimension}D: {found} {rise}");
            // what is left of 0.02 m/s
            let speed = tank.velocity[i].norm();
            assert!(speed < 1e-9, "{dimension}D: {speed}");
        }
    }
}

/// Whatever flows at the start, as much volume enters each cell as leaves it after a step, and none crosses walls.
#[test]
fn nothing_accumulates_anywhere() {
    for dimension in [2, 3] {
        let mut tank = Tank::new(dimension, 10, sides(dimension), 2.015);
        for (v, x) in tank.velocity.iter_mut().zip(&tank.body.points.position) {
            let wave = (7.0 * x.x + 3.0 * x.y).sin() + (5.0 * x.z - 4.0 * x.x).cos();
            *v = Vector3::new(wave, x.x * wave, if dimension == 3 { -wave } else { 0.0 });
        }
        tank.step(1e-3, None);
        let rates = &tank.rates;
        let mut excess = vec![[0.0]; tank.velocity.len()];
        match dimension {
            2 => {
                let inputs = rates.inputs::<VOLUME_2D>();
                (rates.family).sum(&rates.volume::<2>(1e-3), inputs, &mut excess);
            }
            _ => {
                let inputs = rates.inputs::<VOLUME_3D>();
                (rates.family).sum(&rates.volume::<3>(1e-3), inputs, &mut excess);
            }
        }
        let largest = excess.iter().fold(0.0_f64, |m, [e]| m.max(e.abs()));
        let total: f64 = excess.as_flattened().iter().sum();
        // of 2 m/s over 0.1 m, by a tolerance of 1e-11
        assert!(largest < 1e-8, "{dimension}D: {largest}");
        assert!(total.abs() < 1e-10, "{dimension}D: {total}");
    }
}

const KEYS: &str =
    "description = 'eulerian'\nform = 'conservative'\nstate.incompressible = { tolerance = 1e-10 }";

#[test]
fn a_stream_with_vortices_keeps_its_momentum() {
    let mut s = flow(periodic(16, "density = 2\nviscosity = 0.01"), KEYS, 0.2);
    set(&mut s, "velocity", |[x, y, _]| {
        [1.0 + 0.2 * (TAU * y).sin(), 0.3 * (TAU * x).sin(), 0.0]
    });
    let sum = |v: &[f64], a: usize| v.iter().skip(a).step_by(3).sum::<f64>();
    let before = values(&s, "velocity");
    run(&mut s);
    let after = values(&s, "velocity");
    for axis in [0, 1] {
        let change = sum(&after, axis) - sum(&before, axis);
        assert!(change.abs() < 1e-6, "{change} of 256 m/s");
    }
}

/// The array of vortices, Re = 40, is carried by a stream through the points and decays as at rest: after 0.25 s, when a quarter of a
/// period has passed by.
#[test]
fn a_stream_carries_vortices_as_they_are() {
    let speed = 1.0;
    let wave = |x: f64, y: f64| {
        [
            -(TAU * x).cos() * (TAU * y).sin(),
            (TAU * x).sin() * (TAU * y).cos(),
        ]
    };
    let mut s = flow(periodic(32, "density = 1\nviscosity = 1e-3"), KEYS, 0.25);
    set(&mut s, "velocity", |[x, y, _]| {
        let [u, v] = wave(x, y);
        [speed + 0.1 * u, 0.1 * v, 0.0]
    });
    run(&mut s);
    let found = values(&s, "velocity");
    let decay = (-2.0 * TAU * TAU * 1e-3 * 0.25_f64).exp();
    for (v, x) in found.chunks(3).zip(&s.world().body(0).points.position) {
        let [u, w] = wave(x.x - 0.25 * speed, x.y);
        let error = (v[0] - speed - 0.1 * decay * u).hypot(v[1] - 0.1 * decay * w);
        // second order: (2 pi / 32)^2 / 6 of the way of a quarter of a turn, and a bit of time
        assert!(error < 0.02, "{error} at {x:?}");
    }
}

pub(super) const STEEL_AND_GAS: FluidPair = FluidPair {
    material: [0, 1],
    density: [8.0, 2.0],
    viscosity: [6.0, 2.0],
    surface_tension: 5.0,
    width: 0.75,
    angles: Vec::new(),
};

/// Densities add, viscosities act in series, also where a fraction overshoots; capillary waves have the step
/// `sqrt((rho_1 + rho_2) dx^3 / (4 pi gamma))`.
#[test]
fn mixtures_have_the_properties_of_layers() {
    let pair = STEEL_AND_GAS;
    for (fraction, density, viscosity) in [
        (0.0, 2.0, 2.0),
        (1.0, 8.0, 6.0),
        (0.5, 5.0, 3.0),
        (-0.01, 1.94, 2.0),
        (1.01, 8.06, 6.0),
    ] {
        assert!(
            (pair.density_of(fraction) - density).abs() < 1e-12,
            "{fraction}"
        );
        assert!(
            (pair.viscosity_of(fraction) - viscosity).abs() < 1e-12,
            "{fraction}"
        );
    }
    assert_eq!(pair.diffusivity(), 1.0);
    let expected = (10.0 * 0.1_f64.powi(3) / (4.0 * std::f64::consts::PI * 5.0)).sqrt();
    assert!((pair.capillary_step(0.1) / expected - 1.0).abs() < 1e-12);
    let still = FluidPair {
        surface_tension: 0.0,
        ..pair
    };
    assert_eq!(still.capillary_step(0.1), f64::INFINITY);
}

/// Tension times curvature at a circle and a sphere of the first fluid, `gamma / R` and `2 gamma / R`.
#[test]
fn curvature_is_that_of_a_circle_and_of_a_sphere() {
    for (dimension, n, tension) in [(2, 40, 5.0), (3, 24, 10.0)] {
        let mut tank = Tank::with(dimension, n, sides(dimension), 2.015, Some(STEEL_AND_GAS));
        let spacing = 1.0 / n as f64;
        let place = tank.body.points.position.to_vec();
        let height = if dimension == 3 { 0.5 } else { place[0].z };
        let middle = Vector3::new(0.5, 0.5, height);
        let distance = |x: &Vector3<f64>| 0.3 - (x - middle).norm();
        let fraction = |x: &Vector3<f64>| 1.0 / (1.0 + (-distance(x) / (0.75 * spacing)).exp());
        let fraction: Vec<f64> = place.iter().map(fraction).collect();
        tank.rates.set_fraction(&fraction);
        (tank.rates).set_fluxes(&tank.velocity, &tank.density, &tank.pressure);
        let near = (0..place.len()).filter(|i| distance(&place[*i]).abs() < 0.5 * spacing);
        for i in near {
            let found = tank.rates.slots.tension[tank.rates.slot[i] as usize];
            let expected = tension / (place[i] - middle).norm();
            let error = found / expected - 1.0;
            assert!(error.abs() < 0.05, "{dimension}D: {found} {expected}");
        }
    }
}

/// A drop that is four times as dense as what is around it moves through a box; its volume and the momentum of both stay.
#[test]
fn a_drop_in_a_stream_keeps_volume_and_momentum() {
    let n = 24;
    let mut tank = Tank::with(2, n, &[], 2.015, Some(STEEL_AND_GAS));
    let place = tank.body.points.position.to_vec();
    let length = 0.75 / n as f64;
    let distance = |x: &Vector3<f64>| 0.25 - (x.x - 0.5).hypot(x.y - 0.5);
    let fraction: Vec<f64> = (place
        .iter()
        .map(|x| 1.0 / (1.0 + (-distance(x) / length).exp())))
    .collect();
    tank.rates.set_fraction(&fraction);
    tank.density = fraction
        .iter()
        .map(|c| STEEL_AND_GAS.density_of(*c))
        .collect();
    for (v, c) in tank.velocity.iter_mut().zip(&fraction) {
        *v = Vector3::new(0.3 * c, -0.1, 0.0);
    }
    let momentum = |tank: &Tank| -> Vector3<f64> {
        tank.density
            .iter()
            .zip(&tank.velocity)
            .map(|(rho, v)| *rho * v)
            .sum()
    };
    // the first step projects the velocity of the start
    tank.step(1e-4, None);
    let before = (
        momentum(&tank),
        tank.rates.phase.as_ref().map(|p| p.fraction.clone()),
    );
    for _ in 0..50 {
        tank.step(1e-4, None);
    }
    let change = momentum(&tank) - before.0;
    let now = tank.rates.phase.as_ref().map(|p| p.fraction.clone());
    let sum = |c: &Option<Vec<f64>>| -> f64 { c.iter().flatten().sum() };
    let [start, end] = [sum(&before.1), sum(&now)];
    assert!((end / start - 1.0).abs() < 1e-13, "{start} {end}");
    // tension along bonds and viscosity that jumps are not opposite at their ends; 2e-5 found
    assert!(change.norm() < 1e-4 * before.0.norm(), "{change:?}");
}

/// An interface normal to a wall that wants another angle is pulled along it by `gamma cos(theta)`, in the row of points at the wall;
/// without an angle nothing pulls.
#[test]
fn walls_pull_at_an_interface() {
    let (n, face) = (40, Face::YMin);
    for (angle, cosine) in [
        (None, 0.0),
        (Some(60.0_f64), 0.5),
        (Some(150.0), -0.75_f64.sqrt()),
    ] {
        let mut pair = STEEL_AND_GAS;
        let wall = WallPlace::Face(face);
        (pair.angles).extend(angle.map(|angle| ContactAngle { wall, angle }));
        let mut tank = Tank::with(2, n, sides(2), 2.015, Some(pair));
        let spacing = 1.0 / n as f64;
        let place = tank.body.points.position.to_vec();
        let fraction = |x: &Vector3<f64>| 1.0 / (1.0 + ((x.x - 0.5) / (0.75 * spacing)).exp());
        tank.rates
            .set_fraction(&place.iter().map(fraction).collect::<Vec<_>>());
        (tank.rates).set_fluxes(&tank.velocity, &tank.density, &tank.pressure);
        let value = |slots: &SlotField, point: usize| slots[tank.rates.slot[point] as usize];
        let row: Vec<usize> = (0..place.len()).filter(|i| place[*i].y < spacing).collect();
        let slots = &tank.rates.slots;
        let pull: f64 = (row.windows(2))
            .map(|pair| {
                let [tension, step] =
                    [&slots.tension, &slots.step].map(|f| [value(f, pair[0]), value(f, pair[1])]);
                0.5 * (tension[0] + tension[1]) * (step[1] - step[0]) * spacing
            })
            .sum();
        // the first fluid lies at small x; the profile is some three spacings wide
        let expected = 5.0 * cosine;
        assert!(
            (pull - expected).abs() < 0.1 * 5.0,
            "{angle:?}: {pull} {expected}"
        );
    }
}

/// The distance from a plane interface that meets a wall at its angle continues behind it, and so do the normals.
#[test]
fn a_plane_that_meets_a_wall_at_its_angle_continues() {
    let n = 24;
    let mut pair = STEEL_AND_GAS;
    pair.angles.push(ContactAngle {
        wall: WallPlace::Face(Face::YMin),
        angle: 60.0,
    });
    let mut tank = Tank::with(2, n, sides(2), 2.015, Some(pair));
    let spacing = 1.0 / n as f64;
    let place = tank.body.points.position.to_vec();
    let normal = Vector3::new(0.75_f64.sqrt(), -0.5, 0.0);
    let distance = |x: &Vector3<f64>| normal.dot(&(x - Vector3::new(0.5, 0.2, x.z)));
    let fraction = |x: &Vector3<f64>| 1.0 / (1.0 + (-distance(x) / (0.75 * spacing)).exp());
    tank.rates
        .set_fraction(&place.iter().map(fraction).collect::<Vec<_>>());
    (tank.rates).set_fluxes(&tank.velocity, &tank.density, &tank.pressure);
    let phase = tank.rates.phase.as_ref().expect("two fluids");
    for (i, place) in place.iter().enumerate() {
        if place.y > spacing || distance(place).abs() > 3.0 * spacing {
            continue;
        }
        let slot = tank.rates.slot[i] as usize;
        for axis in 0..2 {
            let found = phase.normal[axis][slot];
            assert!((found - normal[axis]).abs() < 1e-4, "{i} {axis}: {found}");
        }
    }
}
