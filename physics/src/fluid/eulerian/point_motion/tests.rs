use std::f64::consts::TAU;
use std::sync::Arc;

use nalgebra::Vector3;
use perimelt_core::body::{Body, Store};
use perimelt_core::family::{ByRules, LayerRule};
use perimelt_core::{Face, Family, FamilySpec, Influence, Pddo, SlotField};

use super::PointMotion;
use crate::advection::Convection;
use crate::fluid::eulerian::fluxes::{FluxDomain, Fluxes};
use crate::fluid::medium::Medium;
use crate::fluid::rates::{Rates, Terms};
use crate::fluid::state::Tait;
use crate::fluid::tests::{Filled, MirroredBox};
use crate::fluid::walls::Walls;
use crate::testing::block;

/// A fluid in a box of 1 m, of which the faces `mirrored` are planes of symmetry and the others periodic.
struct Channel {
    body: Body,
    family: Arc<Family>,
    rates: Fluxes,
    medium: Medium,
    rules: Vec<LayerRule>,
}

impl Channel {
    fn new(dimension: usize, n: usize, mirrored: &[Face]) -> Channel {
        let filled = MirroredBox {
            dimension,
            n,
            mirrored,
            horizon: 2.015,
            viscosity: 3.0,
        };
        let state = Box::new(Tait {
            sound_speed: 10.0,
            exponent: 1.0,
            background: 0.0,
        });
        let Filled {
            body,
            family,
            complete,
            medium,
            rules,
        } = filled.fill("tait", state);
        let motion = PointMotion::prepare(&body, &family, &[]).expect("a lattice");
        let domain = FluxDomain {
            family: family.clone(),
            complete,
            walls: Walls::default(),
            motion: Some(motion),
        };
        let rates = Fluxes::new(Convection::Hybrid, &body, domain);
        Channel {
            rules,
            body,
            family,
            rates,
            medium,
        }
    }

    /// Sets density (kg/m³) and velocity (m/s) and gives what moves to `act`.
    fn set(
        &mut self,
        density: &[f64],
        velocity: &[Vector3<f64>],
        dt: f64,
        act: impl FnOnce(&mut Fluxes, &Terms<'_>),
    ) {
        let terms = Terms {
            medium: &self.medium,
            force: None,
            density_diffusion: 0.1,
            acceleration_fraction: 1.0,
            rules: &self.rules,
            dt,
        };
        let mut slots = vec![SlotField::default(); self.body.dimension];
        for (axis, slots) in slots.iter_mut().enumerate() {
            let along = |point: usize| velocity[point][axis];
            slots.load(&self.family, along, ByRules(&self.rules, axis));
        }
        self.rates.set_viscosity(&self.medium);
        self.rates.set_velocity(&slots, density, &terms);
        act(&mut self.rates, &terms);
    }
}

/// Displacement of the points at a time; it slides along the faces of the box.
fn wobble(dimension: usize, time: f64) -> impl Fn(&Vector3<f64>) -> Vector3<f64> {
    move |x| {
        let wave = |a: usize, b: usize| (TAU * x[a]).sin() * (TAU * x[b] + time).cos();
        let rise = 0.03 * (0.5 * TAU * x.y).sin() * (TAU * x.x + 2.0 * time).cos();
        let along = 0.02 * (TAU * x.x + time).sin() * (TAU * x.y).cos();
        match dimension {
            2 => Vector3::new(along, rise * time.sin(), 0.0),
            _ => Vector3::new(along, rise * time.sin(), 0.0) + 0.02 * Vector3::z() * wave(2, 0),
        }
    }
}

#[test]
fn a_uniform_flow_stays_uniform_however_the_points_move() {
    let faces = [Face::YMin, Face::YMax];
    for (dimension, n) in [(2, 20), (3, 12)] {
        let mut fluid = Channel::new(dimension, n, &faces);
        let points = fluid.body.points.len();
        let stream = Vector3::new(0.7, 0.0, if dimension == 3 { -0.4 } else { 0.0 });
        let (mut density, mut velocity) = (vec![2.5; points], vec![stream; points]);
        let mut pressure = vec![50.0; points];
        let mut mass = 0.0;
        for step in 1..=20 {
            let dt = 1e-5 * f64::from(step);
            let family = fluid.family.clone();
            let to = wobble(dimension, 0.2 * f64::from(step));
            fluid.rates.displace_points(&family, dt, to);
            let (mut rho, mut v) = (density.clone(), velocity.clone());
            fluid.set(&density, &velocity, dt, |rates, terms| {
                let advanced = rates.advance_density(terms, &mut rho, &mut pressure);
                advanced.expect("a density");
                rates.set_pressure(&pressure, None);
                rates.advance_velocity(terms, dt, &mut v, &rho);
            });
            (density, velocity) = (rho, v);
            let full = &fluid.rates.fullness;
            mass = full.iter().zip(&density).map(|(f, rho)| f * rho).sum();
            let spread = full.iter().fold(0.0_f64, |m, f| m.max((f - 1.0).abs()));
            assert!(step < 5 || spread > 0.03, "volumes change: {spread}");
        }
        for (rho, v) in density.iter().zip(&velocity) {
            // rounding of 20 steps, in which points move at 300 m/s
            assert!((rho / 2.5 - 1.0).abs() < 1e-12, "{dimension}D: {rho}");
            assert!((v - stream).norm() < 1e-11, "{dimension}D: {v:?}");
        }
        assert!((mass / (2.5 * points as f64) - 1.0).abs() < 1e-13);
    }
}

/// Largest error of the forces of pressure and viscosity over the largest force, with points displaced by a wave.
fn error_of_forces(n: usize) -> f64 {
    let mut fluid = Channel::new(2, n, &[]);
    let family = fluid.family.clone();
    let by = |x: &Vector3<f64>| {
        let wave = 0.02 * (TAU * x.x).sin() * (TAU * x.y).cos();
        Vector3::new(wave, -0.7 * wave, 0.0)
    };
    // twice, so that they rest
    fluid.rates.displace_points(&family, 1.0, by);
    fluid.rates.displace_points(&family, 1.0, by);
    let places = fluid.body.points.position.iter().map(|x| x + by(x));
    let places: Vec<_> = places.collect();
    let shear = |x: &Vector3<f64>| 0.01 * (TAU * (x.x + x.y)).sin();
    let velocity: Vec<_> = places.iter().map(|x| Vector3::x() * shear(x)).collect();
    let pressure: Vec<f64> = places.iter().map(|x| (TAU * x.x).cos()).collect();
    let density = vec![2.0; places.len()];
    let mut found = vec![Vector3::zeros(); places.len()];
    fluid.set(&density, &velocity, 1e-9, |rates, terms| {
        rates.set_pressure(&pressure, None);
        rates.carry(terms, 0.0, &velocity, &density);
        rates.accelerate(terms, 1.0, &mut found, &density);
    });
    let force = |(x, v): (&Vector3<f64>, &Vector3<f64>)| {
        let push = TAU * (TAU * x.x).sin();
        let diffusion = -3.0 * 2.0 * TAU * TAU * shear(x);
        (push + diffusion, *v)
    };
    let volume = |i: usize| {
        let x = &fluid.body.points.position.at(i);
        let wave = |a: f64, b: f64| 0.02 * TAU * a * b;
        let ((s, c), (t, d)) = ((TAU * x.x).sin_cos(), (TAU * x.y).sin_cos());
        (1.0 + wave(c, d)) * (1.0 + 0.7 * wave(s, t)) - 0.7 * wave(c, d) * wave(s, t)
    };
    let mut worst = 0.0_f64;
    for (i, ((expected, _), found)) in places
        .iter()
        .zip(&velocity)
        .map(force)
        .zip(&found)
        .enumerate()
    {
        // mass is density times the volume before the points moved, 1
        worst = worst.max((2.0 * found.x - expected * volume(i)).abs());
    }
    worst / TAU
}

#[test]
fn forces_are_those_of_the_displaced_points() {
    let [coarse, fine] = [24, 48].map(error_of_forces);
    assert!(fine < 0.02, "{coarse} {fine}");
    let order = (coarse / fine).log2();
    assert!(order > 1.7, "{order}");
}

#[test]
fn all_cells_around_a_point_of_a_wall_move_with_it() {
    let body = block([4, 4, 1], 2, 0.5, Store::Lattice, "density = 2");
    let spec = FamilySpec {
        influence: Influence::Wendland,
        ..Pddo::spec(perimelt_core::Horizon::Spacings(2.015))
    };
    let family = Family::build(&body, &spec).expect("a family");
    let wall = [Vector3::new(-0.4, 0.9, 0.25)];
    let mut motion = PointMotion::prepare(&body, &family, &[&wall]).expect("a lattice");
    let shift = Vector3::new(0.01, 0.02, 0.0);
    motion.follow(&family, &[&[shift]], 1.0);
    let mut cells = [[-0.75, 0.75], [-0.25, 0.75], [-0.75, 1.25], [-0.25, 1.25]].to_vec();
    for [place, displacement] in motion.cells_in_walls() {
        cells.retain(|cell| (place.x - cell[0]).hypot(place.y - cell[1]) > 1e-12);
        assert!((displacement - shift).norm() < 1e-15, "{place}");
    }
    assert!(cells.is_empty(), "{cells:?} are in no wall");
}

#[test]
fn short_waves_decay_by_the_diffusivity_that_they_lack() {
    const N: usize = 48;
    const SPEED: f64 = 3.0;
    let mut fluid = Channel::new(2, N, &[]);
    fluid.medium.viscosity.value.fill(1e-12);
    let places = fluid.body.points.position.to_vec();
    let velocity: Vec<_> = places
        .iter()
        .map(|x| Vector3::new(SPEED, 1e-3 * (TAU * x.x).sin(), 0.0))
        .collect();
    let density = vec![2.0; places.len()];
    let mut found = vec![Vector3::zeros(); places.len()];
    fluid.set(&density, &velocity, 1e-9, |rates, terms| {
        rates.set_pressure(&vec![0.0; places.len()], None);
        rates.carry(terms, 0.0, &velocity, &density);
        rates.accelerate(terms, 1.0, &mut found, &density);
    });
    // the sum of the weights of the Laplacian of a point within, 1/m²
    let (mut content, mut moment) = (0.0, 0.0);
    fluid.family.for_each_bond(0, |_, bond, _| {
        content += bond.weight;
        moment += bond.weight * bond.xi[0] * bond.xi[0];
    });
    let sum = 2.0 * content / moment;
    let missing = 0.15 * SPEED * N as f64 / sum;
    let expected = missing * TAU.powi(4) / sum;
    // what the flow carries is a quarter of a wave behind
    let (mut product, mut square) = (0.0, 0.0);
    for (v, found) in velocity.iter().zip(&found) {
        product -= found.y * v.y;
        square += v.y * v.y;
    }
    let decay = product / square;
    // discrete derivatives of a wave of 48 points
    assert!((decay / expected - 1.0).abs() < 0.03, "{decay} {expected}");
}
