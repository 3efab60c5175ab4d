//! Two-way exchange with a body around the surface: what one body gains the other one loses, with every solver and law.

use std::cell::RefCell;
use std::path::Path;
use std::rc::Rc;

use perimelt_core::body::{Layup, Stations};
use perimelt_core::shape::{BoxShape, Shape};
use perimelt_core::solver::reduce::weighted_sum;
use perimelt_core::world::exchange::{
    Exchange, NewExchange, SurfaceDepth, SurfaceFlux, SurfaceLaw,
};
use perimelt_core::world::surrounding_body::NewSurroundingBody;
use perimelt_core::{
    Body, ExpectedGift, Face, FactRule, RunningPhysics, Setup, SetupError, Step, World, keys,
};

use super::Thermal;
use super::run::RunningThermal;
use crate::testing::material;

const UNREAD: FactRule = FactRule {
    key: "body",
    message: "no heat",
    expected: "`thermal`",
};

/// `h (T_a - T) + c (T_a^4 - T^4)`, T_a by cell face.
#[derive(Debug)]
struct Film {
    coefficient: f64,
    radiation: f64,
    ambient: Vec<f64>,
}

impl SurfaceLaw for Film {
    fn flux(&self, cell: usize, t: f64) -> SurfaceFlux {
        let ambient = self.ambient[cell];
        SurfaceFlux {
            flux: self.coefficient * (ambient - t) + self.radiation * (ambient.powi(4) - t.powi(4)),
            slope: -self.coefficient - 4.0 * self.radiation * t.powi(3),
        }
    }

    fn stiffness(&self, hottest: f64) -> f64 {
        self.coefficient + 4.0 * self.radiation * hottest.powi(3)
    }

    fn is_linear(&self) -> bool {
        self.radiation == 0.0
    }
}

fn shape(min: [f64; 3], max: [f64; 3]) -> Shape {
    Shape::Box(BoxShape { min, max })
}

/// A block or a laminate of 8 x 4 x 2 mm, and gas above its face y+, in two or three dimensions.
fn bodies(is_laminate: bool, dimension: usize) -> Vec<Body> {
    let place = shape([0.0; 3], [8e-3, 4e-3, 2e-3]);
    let mut solid = match is_laminate {
        true => {
            let layup = Layup {
                angles: vec![0.0, 90.0],
                ply_thickness: vec![1e-3; 2],
                stations: Stations::One,
            };
            Body::stack("solid", &place, 1e-3, &layup).expect("valid")
        }
        false => Body::fill("solid", &place, 3, 1e-3, 1.0).expect("valid"),
    };
    let heat = "density = 2000\nspecific_heat = { temperature = [300, 900], value = [800, 1400] }";
    let conductivity = match is_laminate {
        true => "{ axes = [8.0, 0.8, 0.2] }",
        false => "{ temperature = [300, 900], value = [2, 1] }",
    };
    solid.materials = vec![material(&format!("{heat}\nconductivity = {conductivity}"))];
    let above = shape([0.0, 4e-3, 0.0], [8e-3, 10e-3, 2e-3]);
    let mut gas = Body::fill("gas", &above, dimension, 1e-3, 2e-3).expect("valid");
    gas.materials = vec![material(
        "density = 100\nspecific_heat = 1000\nconductivity = 0.1",
    )];
    vec![solid, gas]
}

/// Two bodies that exchange heat, whose laws the test keeps up to date.
struct Pair {
    world: World,
    solid: RunningThermal,
    gas: RunningThermal,
    films: Vec<(Rc<RefCell<Film>>, Rc<Exchange>)>,
}

impl Pair {
    fn new(
        bodies: Vec<Body>,
        solvers: [&str; 2],
        laws: &[(f64, f64, bool)],
    ) -> Result<Pair, SetupError> {
        let mut world = World::new(bodies);
        let mut setup = Setup::new(&mut world, Path::new("."));
        let mut films = Vec::new();
        for (i, &(coefficient, radiation, is_two_way)) in laws.iter().enumerate() {
            setup.next_plugin(&format!("film {i}"));
            if is_two_way {
                setup.publish(1, ExpectedGift::of(&keys::GIVEN_HEAT))?;
            }
            let law = Rc::new(RefCell::new(Film {
                coefficient,
                radiation,
                ambient: Vec::new(),
            }));
            let new = NewExchange {
                depth: SurfaceDepth::Face,
                law: law.clone(),
                cells: setup.body(0).surface(&[Face::YMax]),
                around: Some(NewSurroundingBody {
                    body: 1,
                    radius: 2e-3,
                    is_two_way,
                }),
                unread: UNREAD,
            };
            films.push((law, setup.exchange(0, &keys::TEMPERATURE, new)?));
        }
        let mut prepare = |body: &str, solver: &str| {
            setup.next_plugin(&format!("thermal on {body}"));
            let table = format!("body = '{body}'\nhorizon = 1\nsolver = '{solver}'");
            let physics: Thermal = toml::from_str(&table).expect("keys");
            RunningThermal::prepare(&physics, &mut setup)
        };
        let (solid, gas) = (prepare("solid", solvers[0])?, prepare("gas", solvers[1])?);
        setup.finish().expect("complete");
        for (body, start) in [(0, 300.0), (1, 800.0)] {
            let field = world.fields().find(body, "temperature").expect("owned");
            let positions = world.body(body).points.position.to_vec();
            let values = world.values_mut(field).iter_mut().zip(positions);
            values.for_each(|(t, x)| *t = start + 5e3 * x.x);
        }
        let mut pair = Pair {
            world,
            solid,
            gas,
            films,
        };
        pair.solid.start(&pair.world).expect("starts");
        pair.gas.start(&pair.world).expect("starts");
        Ok(pair)
    }

    fn values(&self, body: usize, field: &str) -> Vec<f64> {
        let field = self.world.fields().find(body, field).expect("known");
        self.world.fields().field(field).data().flat().to_vec()
    }

    fn heat(&self, body: usize) -> f64 {
        let enthalpy = self.values(body, "enthalpy");
        weighted_sum(&enthalpy, &self.world.body(body).points.volume)
    }

    fn see_gas(&self) {
        let temperature = self.values(1, "temperature");
        for (law, exchange) in &self.films {
            let near = exchange.around.as_ref().expect("a body").near();
            let cells = 0..exchange.cells().len();
            law.borrow_mut().ambient = cells.map(|c| near.mean(c, |p| temperature[p])).collect();
        }
    }

    /// The longest step of both, s.
    fn longest_step(&mut self) -> f64 {
        self.see_gas();
        let steps = [&mut self.solid, &mut self.gas].map(|p| p.stable_step(&self.world));
        steps.into_iter().flatten().fold(f64::INFINITY, f64::min)
    }

    fn run(&mut self, step: f64, steps: usize) {
        for i in 0..steps {
            self.see_gas();
            if let Some(given) = self.world.fields().find(1, "given_heat") {
                self.world.values_mut(given).fill(0.0);
            }
            let step = Step::new(i as f64 * step, step);
            self.solid.advance(&self.world, step).expect("a step");
            self.gas.advance(&self.world, step).expect("a step");
        }
    }
}

/// Convection and radiation on the same faces, of a block and of a laminate, in gas of two and three dimensions.
#[test]
fn what_one_body_gains_the_other_loses_with_every_solver() {
    let laws = [(40.0, 0.0, true), (0.0, 4e-8, true)];
    for solver in ["explicit", "rkl2", "implicit", "crank_nicolson"] {
        for of_gas in ["explicit", "implicit"] {
            for is_laminate in [false, true] {
                for dimension in [2, 3] {
                    let bodies = bodies(is_laminate, dimension);
                    let mut pair = Pair::new(bodies, [solver, of_gas], &laws).expect("valid");
                    let before = [pair.heat(0), pair.heat(1)];
                    let step = pair.longest_step();
                    pair.run(0.9 * step, 40);
                    let gained = [pair.heat(0) - before[0], pair.heat(1) - before[1]];
                    let what = format!("{solver}, {of_gas}, laminate {is_laminate}, {dimension}D");
                    let content = before[0] + before[1];
                    assert!(gained[0] > 1e-4 * content, "{what}: {gained:?}");
                    assert!(
                        (gained[0] + gained[1]).abs() < 1e-13 * content,
                        "{what}: {gained:?}"
                    );
                    let [from_gas, to_solid] = [&pair.solid, &pair.gas].map(|p| p.heat.from_bodies);
                    assert!((from_gas + to_solid).abs() < 1e-12 * from_gas, "{what}");
                    assert!((from_gas / gained[0] - 1.0).abs() < 1e-9, "{what}");
                }
            }
        }
    }
}

/// Only the boundaries of a two-way exchange take heat from the gas, and they take the part that is theirs.
#[test]
fn a_one_way_boundary_beside_a_two_way_one_takes_nothing_from_the_gas() {
    for solver in ["explicit", "implicit"] {
        let lost = |laws: &[(f64, f64, bool)]| {
            let mut pair = Pair::new(bodies(false, 3), [solver, "explicit"], laws).expect("valid");
            let before = pair.heat(1);
            pair.run(2e-3, 5);
            before - pair.heat(1)
        };
        let all = lost(&[(60.0, 0.0, true)]);
        let third = lost(&[(20.0, 0.0, true), (40.0, 0.0, false)]);
        // the gas does not cool by what the other boundary takes, and heats the surface more
        assert!((3.0 * third / all - 1.0).abs() < 0.01, "{third} {all}");
        assert_eq!(lost(&[(60.0, 0.0, false)]), 0.0);
    }
}

/// The heat comes from the points near the surface: below, gas of 800 to 840 K along x, within 2 mm of the surface.
#[test]
fn heat_is_taken_from_the_points_near_the_surface() {
    let laws = [(50.0, 0.0, true)];
    let mut pair = Pair::new(bodies(true, 2), ["rkl2", "explicit"], &laws).expect("valid");
    let before = pair.values(1, "enthalpy");
    pair.run(1e-3, 1);
    let after = pair.values(1, "enthalpy");
    let positions = &pair.world.body(1).points.position;
    for ((before, after), x) in before.iter().zip(after).zip(positions) {
        // conduction along x carries less than the films in the first step
        let is_near = x.y < 4e-3 + 1.6e-3;
        let is_middle = (2e-3..6e-3).contains(&x.x);
        if is_middle {
            assert_eq!(
                after < before - 1e-6 * before,
                is_near,
                "{x}: {before} {after}"
            );
        }
    }
}

/// The step is so short that heat does not flow back, whatever the solver and the film. (A single point of the gas may become colder than
/// the surface, which sees the mean.)
#[test]
fn the_step_is_that_of_the_gas_near_the_surface() {
    for solver in ["rkl2", "implicit"] {
        for coefficient in [10.0, 1e3, 1e6] {
            let laws = [(coefficient, 0.0, true)];
            let mut pair = Pair::new(bodies(false, 2), [solver, "implicit"], &laws).expect("valid");
            let step = pair.longest_step();
            assert!(step.is_finite());
            for i in 0..20 {
                let before = pair.heat(0);
                pair.run(step, 1);
                let gained = pair.heat(0) - before;
                assert!(
                    gained > 0.0,
                    "{solver}, {coefficient}, step {i}: {gained} J"
                );
            }
        }
    }
}

#[test]
fn steady_states_of_bodies_that_give_heat_to_each_other_are_refused() {
    for solvers in [["steady", "explicit"], ["explicit", "steady"]] {
        let laws = [(50.0, 0.0, true)];
        let found = Pair::new(bodies(false, 3), solvers, &laws);
        let Err(error) = found else {
            panic!("must be refused");
        };
        assert_eq!(error.key, "solver");
        assert!(error.to_string().contains("two-way exchange"), "{error}");
        let one_way = [(50.0, 0.0, false)];
        Pair::new(bodies(false, 3), solvers, &one_way).expect("one way");
    }
}
