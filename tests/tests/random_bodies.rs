//! Random bodies that meet keep momentum, angular momentum and heat, whatever steps they take, over the whole run.

mod meeting;

use meeting::{compose, exchanged, largest_drift, oil_and_rubber, total};
use perimelt::core::Simulation;
use proptest::prelude::*;

/// A drop between an elastic disc and a rigid one, in a line at an angle (degrees), with gaps of `gaps` spacings.
#[derive(Clone, Debug)]
struct Encounter {
    angle: f64,
    /// m.
    radii: [f64; 3],
    gaps: [f64; 2],
    /// Of the discs towards the drop, and across, m/s.
    velocities: [[f64; 2]; 2],
    slip: [bool; 2],
    /// Step of the fluid as a fraction of 5e-5 s.
    step: f64,
}

fn encounters() -> impl Strategy<Value = Encounter> {
    let velocity = || (0.1..1.0, -1.0..1.0).prop_map(|(towards, across)| [towards, across]);
    (
        0.0..360.0,
        [0.012..0.02, 0.012..0.02, 0.012..0.02],
        [0.6..1.2, 0.6..1.2],
        [velocity(), velocity()],
        any::<[bool; 2]>(),
        0.05..1.0,
    )
        .prop_map(|(angle, radii, gaps, velocities, slip, step)| Encounter {
            angle,
            radii,
            gaps,
            velocities,
            slip,
            step,
        })
}

impl Encounter {
    const SPACING: f64 = 0.002;

    fn compose(&self) -> Simulation {
        let (sin, cos) = self.angle.to_radians().sin_cos();
        let [drop, elastic, rigid] = self.radii;
        let places = [
            0.0,
            drop + elastic + self.gaps[0] * Self::SPACING,
            -(drop + rigid + self.gaps[1] * Self::SPACING),
        ];
        let body = |n: usize, name: &str, material: &str| {
            let [vx, vy] = match n {
                0 => [0.0; 2],
                _ => {
                    let [towards, across] = self.velocities[n - 1];
                    let along = -towards * places[n].signum();
                    [along * cos - across * sin, along * sin + across * cos]
                }
            };
            format!(
                "[bodies.{name}]
                shape.sphere = {{ centre = [{}, {}, 0], radius = {} }}
                dimension = 2
                thickness = 1
                spacing = {}
                material = '{material}'
                initial.velocity = [{vx}, {vy}, 0]
                ",
                places[n] * cos,
                places[n] * sin,
                self.radii[n],
                Self::SPACING,
            )
        };
        let bodies = [
            body(0, "drop", "oil"),
            body(1, "elastic", "rubber"),
            body(2, "rigid", "rubber"),
        ];
        let [slip, other_slip] = self.slip;
        compose(&format!(
            "{}
            {}
            [[couplers]]
            type = 'fluid_structure'
            fluid = 'drop'
            solid = 'elastic'
            slip = {slip}
            [[couplers]]
            type = 'fluid_structure'
            fluid = 'drop'
            solid = 'rigid'
            slip = {other_slip}
            [time]
            end = 0.004
            [log]
            interval = 0.004",
            bodies.concat(),
            oil_and_rubber(
                &format!("step = {}", 5e-5 * self.step),
                ["elastic", "rigid"]
            )
        ))
    }
}

/// A hot block that slides over a cold plate. Spacings are fractions of 0.02 m.
#[derive(Clone, Debug)]
struct Slider {
    cells: [u8; 2],
    conductivities: [f64; 2],
    /// K.
    temperatures: [f64; 2],
    /// W/(m² K); perfect contact if there is none.
    conductance: Option<f64>,
    /// m/s.
    velocity: f64,
    /// Step of the plate as a fraction of 0.005 s, if given.
    step: Option<f64>,
}

fn sliders() -> impl Strategy<Value = Slider> {
    (
        [5..20_u8, 5..20_u8],
        [5.0..100.0, 5.0..100.0],
        [300.0..400.0, 500.0..1500.0],
        prop::option::of(100.0..1e4),
        0.0..0.06,
        prop::option::of(0.1..1.0),
    )
        .prop_map(
            |(cells, conductivities, temperatures, conductance, velocity, step)| Slider {
                cells,
                conductivities,
                temperatures,
                conductance,
                velocity,
                step,
            },
        )
}

impl Slider {
    fn compose(&self) -> Simulation {
        let body = |n: usize, name: &str, extent: [f64; 4]| {
            let [x0, y0, x1, y1] = extent;
            let spacing = 0.02 / f64::from(self.cells[n]);
            format!(
                "[bodies.{name}]
                shape.box = {{ min = [{x0}, {y0}, 0], max = [{x1}, {y1}, {spacing}] }}
                dimension = 2
                thickness = 1
                spacing = {spacing}
                material = '{name}'
                initial.temperature = {}
                [materials.{name}]
                density = 5000
                specific_heat = 500
                conductivity = {}
                ",
                self.temperatures[n], self.conductivities[n],
            )
        };
        let conductance = self.conductance.map(|h| format!("conductance = {h}"));
        let step = self.step.map(|s| format!("step = {}", 0.005 * s));
        compose(&format!(
            "{}{}
            [[physics]]
            type = 'thermal'
            body = 'plate'
            horizon = 1
            {}
            [[physics]]
            type = 'rigid_body'
            body = 'block'
            hold = ['y', 'rotation']
            driven.x.velocity = {}
            [[physics]]
            type = 'thermal'
            body = 'block'
            horizon = 1
            [[couplers]]
            type = 'heat_interface'
            body = 'plate'
            other = 'block'
            {}
            [time]
            end = 1
            [log]
            interval = 1",
            body(0, "plate", [0.0, 0.0, 0.1, 0.02]),
            body(1, "block", [0.0, 0.02, 0.04, 0.04]),
            step.unwrap_or_default(),
            self.velocity,
            conductance.unwrap_or_default(),
        ))
    }
}

/// What bodies were supplied with that no other body gave, relative to what they exchanged.
fn unmatched(simulation: &Simulation, quantity: &str) -> f64 {
    let balances = simulation.balances();
    let of_quantity = balances.iter().flat_map(|(_, balances)| balances);
    let of_quantity = of_quantity.filter(|b| b.quantity == quantity);
    let supplied: f64 = of_quantity.map(|b| b.supplied).sum();
    supplied.abs() / exchanged(simulation, quantity)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 16, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn random_bodies_keep_their_momentum_and_angular_momentum(encounter in encounters()) {
        let mut simulation = encounter.compose();
        let quantities = ["momentum.x", "momentum.y", "angular_momentum.z"];
        let drifts = largest_drift(&mut simulation, &quantities);
        prop_assert!(drifts.iter().all(|d| *d < 1e-12), "{drifts:?}");
    }

    #[test]
    fn a_hot_block_that_slides_over_a_plate_keeps_the_heat(slider in sliders()) {
        let mut simulation = slider.compose();
        let stored = total(&simulation, "heat")[0];
        let mut largest = [0.0_f64; 2];
        while !simulation.is_finished() {
            simulation.step().expect("a step");
            let drift = (total(&simulation, "heat")[0] - stored).abs() / stored;
            largest = [largest[0].max(drift), largest[1].max(unmatched(&simulation, "heat"))];
        }
        prop_assert!(largest.iter().all(|l| *l < 1e-13), "{largest:?}");
        prop_assert!(exchanged(&simulation, "heat") > 0.0);
    }
}
