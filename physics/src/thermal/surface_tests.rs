//! Exchange at surfaces: closed forms of steady states, a half space and cooling walls, with every solver.

use super::run::RunningThermal;
use std::cell::RefCell;
use std::path::Path;
use std::rc::Rc;

use perimelt_core::body::SurfaceCell;
use perimelt_core::shape::{BoxShape, Shape};
use perimelt_core::world::PhaseChange;
use perimelt_core::world::exchange::{NewExchange, SurfaceDepth, SurfaceFlux, SurfaceLaw};
use perimelt_core::{Body, Face, FactRule, LayerRole, RunningPhysics, Setup, Step, World, keys};

use super::Thermal;
use super::surface_depth::depths;
use crate::testing::material;

/// The mistake of an exchange that no physics evaluates.
const UNREAD: FactRule = FactRule {
    key: "body",
    message: "no heat",
    expected: "`thermal`",
};

const BOLTZMANN: f64 = 5.670_374_419e-8;

/// `q + h (T_a - T) + eps sigma (T_a^4 - T^4)`.
#[derive(Debug)]
struct Film {
    prescribed: f64,
    coefficient: f64,
    emissivity: f64,
    ambient: f64,
}

impl SurfaceLaw for Film {
    fn flux(&self, _: usize, t: f64) -> SurfaceFlux {
        let radiated = self.emissivity * BOLTZMANN;
        SurfaceFlux {
            flux: self.prescribed
                + self.coefficient * (self.ambient - t)
                + radiated * (self.ambient.powi(4) - t.powi(4)),
            slope: -self.coefficient - 4.0 * radiated * t.powi(3),
        }
    }

    fn stiffness(&self, hottest: f64) -> f64 {
        self.coefficient + 4.0 * self.emissivity * BOLTZMANN * hottest.powi(3)
    }

    fn surroundings(&self) -> f64 {
        self.ambient
    }

    fn is_linear(&self) -> bool {
        self.emissivity == 0.0
    }
}

/// A bar or block along x whose cells have a given spacing, of a material of conductivity 1.
fn bar(length: f64, spacing: f64, dimension: usize, across: f64) -> Body {
    let shape = Shape::Box(BoxShape {
        min: [0.0; 3],
        max: [length, across, across],
    });
    let mut body = Body::fill("bar", &shape, dimension, spacing, 1.0).expect("a bar");
    body.materials = vec![material(
        "density = 1000\nspecific_heat = 1000\nconductivity = 1",
    )];
    body
}

/// A world with its heat physics, whose surface towards `faces` exchanges heat by a law.
struct Cooled {
    world: World,
    physics: RunningThermal,
}

impl Cooled {
    fn new(
        body: Body,
        keys_of_physics: &str,
        faces: &[Face],
        film: Film,
        held: Option<f64>,
    ) -> Cooled {
        let mut world = World::new(vec![body]);
        let physics: Thermal = toml::from_str(keys_of_physics).expect("keys");
        let mut setup = Setup::new(&mut world, Path::new("."));
        setup.next_plugin("film");
        if setup.body(0).materials[0].get("solidus").is_some() {
            setup.publish(0, PhaseChange::default()).expect("free");
        }
        let cells: Vec<SurfaceCell> = setup.body(0).surface(faces);
        let law = Rc::new(RefCell::new(film));
        let new = NewExchange {
            depth: SurfaceDepth::Face,
            law,
            cells,
            around: None,
            unread: UNREAD,
        };
        setup
            .exchange(0, &keys::TEMPERATURE, new)
            .expect("an exchange");
        let layer = held.map(|_| {
            setup.next_plugin("held");
            setup
                .layer(0, &keys::TEMPERATURE, Face::XMin, LayerRole::Prescribed)
                .expect("a layer")
        });
        setup.next_plugin("thermal");
        let physics = RunningThermal::prepare(&physics, &mut setup).expect("prepared");
        setup.finish().expect("complete");
        if let (Some(layer), Some(held)) = (layer, held) {
            world.set_layer(layer, [-1.0; 3], [2.0 * held; 3]);
        }
        Cooled { world, physics }
    }

    fn start(&mut self, temperature: f64) {
        let field = self.world.fields().find(0, "temperature").expect("owned");
        self.world.values_mut(field).fill(temperature);
        self.physics.start(&self.world).expect("starts");
        self.physics.stable_step(&self.world);
    }

    fn run(&mut self, step: f64, steps: usize) {
        for i in 0..steps {
            let step = Step::new(i as f64 * step, step);
            self.physics.advance(&self.world, step).expect("a step");
        }
    }

    fn temperature(&self) -> Vec<f64> {
        let field = self.world.fields().find(0, "temperature").expect("owned");
        self.world.fields().field(field).data().flat().to_vec()
    }
}

fn film(coefficient: f64, emissivity: f64, ambient: f64) -> Film {
    Film {
        prescribed: 0.0,
        coefficient,
        emissivity,
        ambient,
    }
}

/// Resistances in series, whatever the initial temperature: `q = (T_0 - T_a) / (l / k + 1 / h)`, and with radiation the
/// root of `k (T_0 - T_s) / l = h (T_s - T_a) + eps sigma (T_s^4 - T_a^4)`.
#[test]
fn a_steady_wall_is_that_of_its_resistances_from_any_initial_temperature() {
    for (coefficient, emissivity) in [(20.0, 0.0), (0.0, 0.9), (15.0, 0.6)] {
        let law = film(coefficient, emissivity, 300.0);
        // bisection of the balance at the surface
        let (mut low, mut high) = (300.0, 600.0);
        for _ in 0..60 {
            let t = 0.5 * (low + high);
            let enters = (600.0 - t) / 0.1 + law.flux(0, t).flux;
            if enters > 0.0 { low = t } else { high = t }
        }
        let (surface, flux) = (low, (600.0 - low) / 0.1);
        for (dimension, across) in [(1, 1.0), (2, 0.02), (3, 0.02)] {
            for horizon in [1, 3] {
                for initial in [300.0, 400.0, 500.0, 1000.0] {
                    if initial != 1000.0 && dimension == 3 && horizon == 3 {
                        continue;
                    }
                    let body = bar(0.1, 0.005, dimension, across);
                    let physics =
                        format!("solver = 'steady'\nhorizon = {horizon}\ntolerance = 1e-9");
                    let law = film(coefficient, emissivity, 300.0);
                    let mut wall = Cooled::new(body, &physics, &[Face::XMax], law, Some(600.0));
                    wall.start(initial);
                    wall.run(1.0, 1);
                    let positions = &wall.world.body(0).points.position;
                    let points = positions.iter().zip(wall.temperature());
                    for (x, t) in points.filter(|(x, _)| (0.02..0.08).contains(&x.x)) {
                        let expected = 600.0 - flux * x.x;
                        assert!(
                            (t - expected).abs() < 2e-3 * (600.0 - surface),
                            "h {coefficient}, eps {emissivity}, {dimension}D, horizon {horizon}, \
                             from {initial} K: {t} {expected} at {x}"
                        );
                    }
                }
            }
        }
    }
}

/// A surface may become as warm as its surroundings, which limit explicit steps before it is: with k = 1 W/(m K) and 5 mm the
/// conductance to black surroundings of 2000 K, 1814 W/(m² K) in series with 400, is above that of a bond, 200.
#[test]
fn hot_surroundings_limit_steps_of_a_cold_body() {
    let longest = |ambient: f64| {
        let law = film(0.0, 1.0, ambient);
        let body = bar(0.1, 0.005, 1, 1.0);
        let mut wall = Cooled::new(body, "horizon = 1", &[Face::XMax], law, None);
        wall.start(300.0);
        wall.physics.stable_step(&wall.world).expect("a limit")
    };
    let ratio = longest(2000.0) / longest(300.0);
    assert!(ratio < 0.85, "{ratio}");
}

/// erfc by its continued fraction and series, to 1e-12 for the arguments used here.
fn erfc(x: f64) -> f64 {
    if x < 2.0 {
        let (mut term, mut sum) = (x, x);
        for n in 1..200 {
            term *= -x * x / n as f64;
            sum += term / (2 * n + 1) as f64;
        }
        return 1.0 - 2.0 / std::f64::consts::PI.sqrt() * sum;
    }
    let mut fraction = x;
    for n in (1..200).rev() {
        fraction = x + 0.5 * n as f64 / fraction;
    }
    (-x * x).exp() / std::f64::consts::PI.sqrt() / fraction
}

/// Heat taken up by a half space through a film, Carslaw and Jaeger (1959), section 2.7: the temperature of the surface is
/// `1 - exp(H^2) erfc(H)` of the difference, `H = h sqrt(a t) / k`; the heat `(k / h a) C (exp(H^2) erfc(H) - 1 + 2 H / sqrt(pi))`.
#[test]
fn a_half_space_takes_up_heat_through_a_film_to_second_order() {
    // k = 1, C = 1e6, a = 1e-6
    // bonds of three spacings, 6 mm, are not short against the depth that heat reaches, 8 mm
    for (horizon, tolerance) in [(1, 0.01), (3, 0.02)] {
        let mut errors = Vec::new();
        for spacing in [2e-3, 1e-3] {
            // h dx / 2 k = 0.3 at 2 mm
            let h = 300.0;
            let body = bar(0.12, spacing, 1, 1.0);
            let physics = format!("solver = 'rkl2'\nhorizon = {horizon}");
            let mut bar = Cooled::new(body, &physics, &[Face::XMin], film(h, 0.0, 400.0), None);
            bar.start(300.0);
            let time = 60.0_f64;
            bar.run(0.25, 240);
            let heat: f64 = bar
                .temperature()
                .iter()
                .map(|t| 1e6 * spacing * (t - 300.0))
                .sum();
            let reach = h * (1e-6 * time).sqrt();
            let scaled = (reach * reach).exp() * erfc(reach);
            let expected =
                100.0 * 1e6 / h * (scaled - 1.0 + 2.0 * reach / std::f64::consts::PI.sqrt());
            errors.push((heat / expected - 1.0).abs());
        }
        assert!(errors[0] < tolerance, "horizon {horizon}: {errors:?}");
        // second order: a quarter with half of the spacing; 0.4 leaves room for the error of the steps
        assert!(
            errors[1] < 0.4 * errors[0] + 2e-4,
            "horizon {horizon}: {errors:?}"
        );
    }
}

/// A thin wall that radiates on both sides, `C L dT/dt = -2 eps sigma T^4`: `T = T_0 (1 + 6 eps sigma T_0^3 t / (C L))^(-1/3)`.
/// In steps of the schedule up to that of the whole time, 1500 times the explicit one.
#[test]
fn a_radiating_wall_follows_the_closed_form_with_every_solver() {
    let (emissivity, length, initial, time) = (0.8, 4e-3, 1400.0_f64, 60.0);
    let rate = 6.0 * emissivity * BOLTZMANN * initial.powi(3) / (1e6 * length);
    let expected = initial * (1.0 + rate * time).powf(-1.0 / 3.0);
    for solver in ["explicit", "rkl2", "implicit", "crank_nicolson"] {
        for factor in [1.0, 10.0, 100.0, f64::INFINITY] {
            let mut wall = bar(length, 1e-3, 1, 1.0);
            // conducts so well that it is nearly uniform
            wall.materials = vec![material(
                "density = 1000\nspecific_heat = 1000\nconductivity = 40",
            )];
            let physics = format!("solver = '{solver}'\nhorizon = 1");
            let law = film(0.0, emissivity, 0.0);
            let mut wall = Cooled::new(wall, &physics, &[Face::XMin, Face::XMax], law, None);
            wall.start(initial);
            let limit = wall.physics.stable_step(&wall.world);
            // a tenth of the limit of conduction
            let step = limit.unwrap_or(1.25e-3 * factor);
            let steps = (time / step).ceil().max(1.0);
            wall.run(time / steps, steps as usize);
            let found = wall.temperature()[0];
            assert!(
                (found / expected - 1.0).abs() < 0.01,
                "{solver} in {steps} steps: {found} {expected}"
            );
            if solver == "explicit" {
                break;
            }
        }
    }
}

/// A strong flux on matter that conducts badly until it melts, as powder does: `q - eps sigma T_s^4` enters, with
/// `q - eps sigma T_s^4 = (k (T_l - T) + k_l (T_s - T_l)) / d`.
#[test]
fn a_half_cell_whose_surface_melts_conducts_as_melt_there() {
    let (flux, emissivity, initial) = (5e8, 0.5, 473.0);
    let (spacing, liquidus, [solid, melt]) = (2e-4, 1900.0, [0.2, 30.0]);
    let mut body = bar(spacing, spacing, 1, 1.0);
    body.materials = vec![material(
        "density = 1000\nspecific_heat = 1000\nconductivity = { solid = 0.2, liquid = 30 }\n\
         solidus = 1850\nliquidus = 1900\nlatent_heat = 1e5",
    )];
    let law = Film {
        prescribed: flux,
        ..film(0.0, emissivity, 0.0)
    };
    let mut wall = Cooled::new(body, "horizon = 1", &[Face::XMax], law, None);
    wall.start(initial);
    let step = 1e-9;
    wall.run(step, 1);
    let entered = (wall.temperature()[0] - initial) * 1e6 * spacing / step;
    let (mut low, mut high) = (liquidus, 1e5);
    for _ in 0..60 {
        let t = 0.5 * (low + high);
        let conducted = (solid * (liquidus - initial) + melt * (t - liquidus)) / (0.5 * spacing);
        let enters = flux - emissivity * BOLTZMANN * f64::powi(t, 4);
        if enters > conducted {
            low = t
        } else {
            high = t
        }
    }
    let expected = flux - emissivity * BOLTZMANN * low.powi(4);
    // temperatures of 473 K that change by 2.5 mK
    assert!(
        (entered / expected - 1.0).abs() < 1e-6,
        "{entered} {expected}"
    );
    assert!(expected > 0.99 * flux);
}

/// Without a stable step of its own, an exchange limits explicit steps: no point becomes colder than the surroundings.
#[test]
fn explicit_steps_stay_above_the_surroundings() {
    let mut body = bar(2e-3, 1e-3, 1, 1.0);
    body.materials = vec![material(
        "density = 1000\nspecific_heat = 1000\nconductivity = 0.1",
    )];
    let law = film(1e5, 0.0, 300.0);
    let mut wall = Cooled::new(body, "horizon = 1", &[Face::XMin, Face::XMax], law, None);
    wall.start(1400.0);
    let longest = wall.physics.stable_step(&wall.world).expect("a limit");
    for _ in 0..50 {
        wall.run(longest, 1);
        for t in wall.temperature() {
            assert!((300.0..=1400.0).contains(&t), "{t}");
        }
    }
}

/// `q = (T_a - T_0) / (1 / h + l / k)` through walls of a few cells, with any family.
#[test]
fn thin_walls_have_the_resistances_of_thick_ones() {
    for (horizon, surfaces) in [1, 2, 3]
        .into_iter()
        .flat_map(|h| [(h, "mirrored"), (h, "bare")])
    {
        for (cells, dimension) in [(4, 1), (6, 1), (10, 1), (13, 1), (4, 2), (6, 3)] {
            let (spacing, h) = (1e-3, 500.0);
            let length = cells as f64 * spacing;
            let physics = format!(
                "solver = 'steady'\nhorizon = {horizon}\nsurfaces = '{surfaces}'\ntolerance = 1e-10"
            );
            let body = bar(length, spacing, dimension, 8e-3);
            let law = film(h, 0.0, 400.0);
            let mut wall = Cooled::new(body, &physics, &[Face::XMax], law, Some(300.0));
            wall.start(300.0);
            wall.run(1.0, 1);
            let run = &wall.physics;
            let family = wall.world.family(run.family);
            let body = wall.world.body(0);
            let last = body.points.len() - 1;
            let cell = body.surface_of([last].into_iter(), &[Face::XMax], |_| true)[0];
            let depth = depths(body, &family).at(body, &cell) * spacing;
            let points = wall.world.body(0).points.position.iter();
            let outermost = points
                .zip(wall.temperature())
                .filter(|(x, _)| x.x > length - spacing);
            let fluxes: Vec<f64> = outermost
                .map(|(_, t)| (400.0 - t) / (1.0 / h + depth))
                .collect();
            let flux = fluxes.iter().sum::<f64>() / fluxes.len() as f64;
            let expected = 100.0 / (1.0 / h + length);
            assert!(
                (flux / expected - 1.0).abs() < 5e-3,
                "{cells} cells, {dimension}D, horizon {horizon}, {surfaces}: {flux} {expected}"
            );
        }
    }
}

/// The surface lies half a spacing from the points for nearest neighbours behind mirrored faces; for longer bonds the
/// temperature of a bar with a given flux gives the distance.
#[test]
fn the_surface_lies_where_the_linear_temperature_below_meets_it() {
    for (horizon, surfaces) in [(1, "mirrored"), (1, "bare"), (3, "mirrored"), (3, "bare")] {
        let body = bar(0.04, 1e-3, 1, 1.0);
        let physics = format!(
            "solver = 'steady'\nhorizon = {horizon}\nsurfaces = '{surfaces}'\ntolerance = 1e-10"
        );
        let law = film(1e-9, 0.0, 1e12);
        // nearly a flux of 1000 W/m² through x+
        let mut wall = Cooled::new(body, &physics, &[Face::XMax], law, Some(300.0));
        wall.start(300.0);
        wall.run(1.0, 1);
        let t = wall.temperature();
        let [a, b] = [20, 28].map(|i: usize| t[i]);
        let slope = (b - a) / 8.0;
        let surface = a + slope * (39.5 - 20.0);
        let expected = (surface - t[39]) / slope;
        let run = &wall.physics;
        let family = wall.world.family(run.family);
        let body = wall.world.body(0);
        let cell = body.surface_of([39].into_iter(), &[Face::XMax], |_| true)[0];
        let found = depths(body, &family).at(body, &cell);
        assert!(
            (found - expected).abs() < 2e-3,
            "horizon {horizon}, {surfaces}: {found} {expected}"
        );
        if (horizon, surfaces) == (1, "mirrored") {
            assert!((found - 0.5).abs() < 1e-12);
        }
    }
}
