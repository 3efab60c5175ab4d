//! Exchange at the sides and the edges of laminates, whatever the lay-up, the conductivities, the family and the solver.

use std::cell::RefCell;
use std::path::Path;
use std::rc::Rc;

use perimelt_core::body::{Layup, Stations};
use perimelt_core::material::Property;
use perimelt_core::shape::{BoxShape, Shape};
use perimelt_core::world::exchange::{NewExchange, SurfaceDepth, SurfaceFlux, SurfaceLaw};
use perimelt_core::{Body, Face, FactRule, RunningPhysics, Setup, Step, World, keys};

use super::Thermal;
use super::run::RunningThermal;
use crate::testing::material;

const SPACING: f64 = 1e-3;

const UNREAD: FactRule = FactRule {
    key: "body",
    message: "no heat",
    expected: "`thermal`",
};

/// `h (T_a - T)`, T_a by cell face.
#[derive(Debug)]
struct Films {
    coefficient: f64,
    ambient: Vec<f64>,
}

impl SurfaceLaw for Films {
    fn flux(&self, cell: usize, t: f64) -> SurfaceFlux {
        SurfaceFlux {
            flux: self.coefficient * (self.ambient[cell] - t),
            slope: -self.coefficient,
        }
    }

    fn stiffness(&self, _: f64) -> f64 {
        self.coefficient
    }

    fn is_linear(&self) -> bool {
        true
    }
}

/// Conductivities along and across the fibres and through the thickness.
const CONSTANT: &str = "conductivity = { axes = [8.0, 0.8, 0.2] }";
const BY_TEMPERATURE: &str = "conductivity = { axes = [8.0, { temperature = [300, 350, 400], value = [0.8, 1.2, 0.6] }, \
                              { temperature = [300, 400], value = [0.1, 0.3] }] }";

fn laminate(size: [f64; 3], angles: &[f64], stations: Stations, conductivity: &str) -> Body {
    let shape = Shape::Box(BoxShape {
        min: [0.0; 3],
        max: size,
    });
    let layup = Layup {
        angles: angles.to_vec(),
        ply_thickness: Vec::new(),
        stations,
    };
    let mut body = Body::stack("plate", &shape, SPACING, &layup).expect("a plate");
    let properties = format!("density = 1000\nspecific_heat = 1000\n{conductivity}");
    body.materials = vec![material(&properties)];
    body
}

/// A laminate with films on its lower (400 K) and upper (300 K) faces across some axes.
struct Exchanging {
    world: World,
    physics: RunningThermal,
}

impl Exchanging {
    fn new(body: Body, keys_of_physics: &str, axes: &[usize], coefficient: f64) -> Exchanging {
        let mut world = World::new(vec![body]);
        let physics: Thermal = toml::from_str(keys_of_physics).expect("keys");
        let mut setup = Setup::new(&mut world, Path::new("."));
        setup.next_plugin("films");
        let is_across = |face: &Face| axes.contains(&face.axis());
        let faces: Vec<Face> = Face::ALL.into_iter().filter(is_across).collect();
        let cells = setup.body(0).surface(&faces);
        let ambient = cells
            .iter()
            .map(|c| if c.face.is_upper() { 300.0 } else { 400.0 });
        let law = Films {
            coefficient,
            ambient: ambient.collect(),
        };
        let new = NewExchange {
            depth: SurfaceDepth::Face,
            law: Rc::new(RefCell::new(law)),
            cells,
            around: None,
            unread: UNREAD,
        };
        (setup.exchange(0, &keys::TEMPERATURE, new)).expect("an exchange");
        setup.next_plugin("thermal");
        let physics = RunningThermal::prepare(&physics, &mut setup).expect("prepared");
        setup.finish().expect("complete");
        let field = world.fields().find(0, "temperature").expect("owned");
        world.values_mut(field).fill(350.0);
        Exchanging { world, physics }
    }

    /// Temperatures after steps of a given length, s.
    fn run(&mut self, step: f64, steps: usize) -> Vec<f64> {
        for i in 0..steps {
            let step = Step::new(i as f64 * step, step);
            self.physics.advance(&self.world, step).expect("a step");
        }
        let field = self.world.fields().find(0, "temperature").expect("owned");
        self.world.fields().field(field).data().flat().to_vec()
    }

    /// The longest explicit step, s; `None` for solvers without one.
    fn start(&mut self) -> Option<f64> {
        self.physics.start(&self.world).expect("starts");
        self.physics.stable_step(&self.world)
    }
}

/// `int k dT` from 300 K.
fn potential(k: &Property, temperature: f64) -> f64 {
    let parts = 2000;
    let width = (temperature - 300.0) / f64::from(parts);
    let middle = |n: i32| k.at(300.0 + (f64::from(n) + 0.5) * width, 0.0);
    (0..parts).map(middle).sum::<f64>() * width
}

/// The temperatures in steady flow between two films: the potential is linear, and `q = h (T_a - T_s)` at both surfaces, which lie where the
/// laminate ends.
#[test]
fn heat_flows_through_edges_and_sides_by_resistances_in_series() {
    let long = [0.03, 3e-3, 1e-3];
    let thick = [4e-3, 4e-3, 3e-3];
    for (axis, size, angles, of_axis) in [
        (0, long, &[0.0][..], 0),
        (0, long, &[90.0], 1),
        (1, [3e-3, 0.03, 1e-3], &[0.0, 0.0], 1),
        (1, [3e-3, 0.03, 1e-3], &[90.0], 0),
        (2, thick, &[0.0, 90.0, 0.0], 2),
    ] {
        for stations in [Stations::One, Stations::Two] {
            for conductivity in [CONSTANT, BY_TEMPERATURE] {
                for (horizon, correction) in [(1, "lattice"), (2, "point"), (3, "point")] {
                    let body = laminate(size, angles, stations, conductivity);
                    let material = body.materials[0].directional("conductivity");
                    let k = material.expect("given").along(of_axis).clone();
                    let h = k.at(350.0, 0.0) / size[axis];
                    let keys = format!("horizon = {horizon}\ncorrection = '{correction}'\n");
                    // thin layers exchange so much heat that residuals round off earlier
                    let tolerance = if axis == 2 { 1e-6 } else { 1e-9 };
                    let steady = format!("{keys}solver = 'steady'\ntolerance = {tolerance}");
                    let implicit = format!("{keys}solver = 'implicit'");
                    let mut plate = Exchanging::new(body.clone(), &steady, &[axis], h);
                    plate.start();
                    let found = plate.run(1.0, 1);
                    let what = format!("{axis} {angles:?} {stations:?} {horizon} {conductivity}");
                    check(&body, axis, &k, h, &found, &what, f64::from(horizon));
                    // an implicit step has the derivative of the heat of bonds, and ends in the same state
                    if (horizon, stations) == (3, Stations::Two) {
                        let mut plate = Exchanging::new(body, &implicit, &[axis], h);
                        plate.start();
                        let late = plate.run(1e6, 2);
                        for (steady, late) in found.iter().zip(late) {
                            assert!((steady - late).abs() < 1e-2, "{what}: {steady} {late}");
                        }
                    }
                }
            }
        }
    }
}

/// Compares steady temperatures with resistances in series.
fn check(body: &Body, axis: usize, k: &Property, h: f64, found: &[f64], what: &str, horizon: f64) {
    let (low, high) = (body.face_position(Face::ALL[2 * axis]), body.extent(axis));
    let margin = match axis {
        2 => 0.0,
        _ => 3.0 * horizon * SPACING,
    };
    let points = body.points.position.iter().zip(found);
    let mut inside: Vec<[f64; 2]> = points
        .map(|(x, t)| [x[axis] - low, potential(k, *t)])
        .collect();
    inside.retain(|[x, _]| (margin..=high - margin).contains(x));
    inside.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let (first, last) = (inside[0], inside[inside.len() - 1]);
    let flux = (first[1] - last[1]) / (last[0] - first[0]);
    for [x, value] in &inside {
        let expected = first[1] - flux * (x - first[0]);
        // the temperature spans some 30 K
        assert!(
            (value - expected).abs() < 1e-3 * flux * high,
            "{what}: {value} {expected} at {x}"
        );
    }
    // the flux between the films: bisection
    let end = |temperature: f64| potential(k, temperature);
    let (mut low, mut most) = (0.0, 100.0 * h);
    for _ in 0..60 {
        let q = 0.5 * (low + most);
        let [hot, cold] = [400.0 - q / h, 300.0 + q / h];
        let flows = (end(hot) - end(cold)) / high;
        if flows > q { low = q } else { most = q }
    }
    assert!(
        (flux / low - 1.0).abs() < 3e-3,
        "{what}: {flux} W/m², expected {low}"
    );
}

/// Explicit steps as long as they may be keep the temperatures between those of the surroundings, also where films are strong.
#[test]
fn the_longest_explicit_step_is_stable() {
    for conductivity in [CONSTANT, BY_TEMPERATURE] {
        for (angles, horizon) in [(&[0.0, 90.0][..], 1), (&[0.0, 45.0, 90.0], 3)] {
            for coefficient in [10.0, 1e5] {
                let body = laminate([6e-3, 7e-3, 1e-3], angles, Stations::Two, conductivity);
                let keys = format!("horizon = {horizon}");
                let mut plate = Exchanging::new(body, &keys, &[0, 1, 2], coefficient);
                let longest = plate.start().expect("a limit");
                for _ in 0..30 {
                    for t in plate.run(longest, 1) {
                        assert!(
                            (300.0..=400.0).contains(&t),
                            "{angles:?}, {coefficient}: {t}"
                        );
                    }
                }
            }
        }
    }
}
