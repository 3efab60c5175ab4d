//! Small worlds for the tests of physics.

use std::path::Path;

use perimelt_core::body::{Body, Store};
use perimelt_core::material::{Material, MaterialSection};
use perimelt_core::shape::{BoxShape, Shape};
use perimelt_core::simulation::{LogTimes, Named, Simulation, TimeOptions};
use perimelt_core::world::PhaseChange;
use perimelt_core::{
    Coupler, Physics, Prepared, RunError, RunningCoupler, Setup, SetupError, Step, StepSize, World,
};
use serde::{Deserialize, Serialize};

/// A block of `cells` cubic cells of edge `spacing` (m), of a material given in TOML.
pub fn block(
    cells: [usize; 3],
    dimension: usize,
    spacing: f64,
    store: Store,
    material: &str,
) -> Body {
    let max = cells.map(|c| c as f64 * spacing);
    let shape = Shape::Box(BoxShape { min: [0.0; 3], max });
    let mut body = Body::fill("block", &shape, dimension, spacing, 0.1).expect("a valid block");
    body.materials = vec![self::material(material)];
    body.store = store;
    body
}

/// A material given in TOML.
pub fn material(keys: &str) -> Material {
    let section: MaterialSection = toml::from_str(keys).expect("a valid material");
    Material::new("test", section, None).expect("a valid material")
}

/// A plugin read from TOML, as a case file would give it.
pub fn read<P: serde::de::DeserializeOwned>(keys: &str) -> P {
    toml::from_str(keys).expect("valid keys")
}

/// One physics with couplers on one body, prepared but not started.
pub fn simulation(
    body: Body,
    physics: Vec<Box<dyn Physics>>,
    couplers: Vec<Box<dyn Coupler>>,
    end: f64,
) -> Simulation {
    simulation_in_steps(body, physics, couplers, end, StepSize::Auto)
}

/// A simulation in macro steps of a size.
pub fn simulation_in_steps(
    body: Body,
    physics: Vec<Box<dyn Physics>>,
    couplers: Vec<Box<dyn Coupler>>,
    end: f64,
    step: StepSize,
) -> Simulation {
    let physics = physics
        .into_iter()
        .map(|plugin| Named {
            label: plugin.typetag_name().into(),
            plugin,
        })
        .collect();
    let couplers = couplers
        .into_iter()
        .map(|plugin| Named {
            label: plugin.typetag_name().into(),
            plugin,
        })
        .collect();
    let options = TimeOptions {
        end,
        step,
        stages: Vec::new(),
        safety: 0.9,
        log: LogTimes::every(end),
        iteration: None,
    };
    Simulation::prepare(
        World::new(vec![body]),
        couplers,
        physics,
        options,
        Path::new("."),
    )
    .expect("a valid composition")
}

/// Sets a field from the positions of the points.
pub fn set<const N: usize>(s: &mut Simulation, field: &str, value: impl Fn([f64; 3]) -> [f64; N]) {
    let positions = s.world().body(0).points.position.to_vec();
    for (i, x) in positions.into_iter().enumerate() {
        s.set_initial(0, field, std::iter::once(i), &value(x.into()))
            .expect("the field exists");
    }
}

/// All components of a field.
pub fn values(s: &Simulation, field: &str) -> Vec<f64> {
    let fields = s.world().fields();
    let index = fields.find(0, field).expect("the field exists");
    fields.field(index).data().flat().to_vec()
}

/// Runs to the end.
pub fn run(s: &mut Simulation) {
    s.start().expect("starts");
    while !s.is_finished() {
        s.step().expect("steps");
    }
}

/// Says that the body melts.
#[derive(Debug, Serialize, Deserialize)]
pub struct Melting {}

#[typetag::serialize(name = "melting_of_a_test")]
impl Coupler for Melting {
    fn publish(&mut self, setup: &mut Setup<'_>) -> Result<(), SetupError> {
        setup.publish(0, PhaseChange::default())
    }

    fn prepare(self: Box<Self>, _: &mut Setup<'_>) -> Prepared<dyn RunningCoupler> {
        Ok(self)
    }
}

impl RunningCoupler for Melting {
    fn apply(&mut self, _: &World, _: Step) -> Result<(), RunError> {
        Ok(())
    }
}
