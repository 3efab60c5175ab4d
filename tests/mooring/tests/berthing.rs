//! A body of a stranger's physics exchanges impulses with a body of ours and keeps what both have.

use std::path::Path;

use mooring as _;
use perimelt::case::Case;
use perimelt_core::Simulation;

fn compose(changes: &[(&str, &str)]) -> Simulation {
    let mut text = include_str!("../berthing.toml").to_string();
    for (old, new) in changes {
        assert!(text.contains(old), "`{old}` is in the case");
        text = text.replace(old, new);
    }
    let case = Case::parse("berthing.toml", text, Path::new("")).expect("a valid case");
    let composed = case.compose();
    let mut simulation = composed.unwrap_or_else(|e| panic!("{}", e.render(false)));
    simulation.start().expect("it starts");
    simulation
}

/// Momentum of both bodies along x, N s.
fn momenta(simulation: &Simulation) -> [f64; 2] {
    let world = simulation.world();
    [(0, 700.0), (1, 1100.0)].map(|(body, density)| {
        let index = world.fields().find(body, "velocity").expect("it is owned");
        let data = world.fields().field(index).data();
        let (velocities, _) = data.flat().as_chunks::<3>();
        let points = velocities.iter().zip(&world.body(body).points.volume);
        points.map(|(v, volume)| density * volume * v[0]).sum()
    })
}

#[test]
fn a_fender_without_springs_takes_just_the_momentum_that_the_ship_loses() {
    let mut simulation = compose(&[
        ("stiffness = 5e4", "stiffness = 0"),
        ("damping = 2e4", "damping = 0"),
        ("step = 1e-2", "step = 3e-3"),
    ]);
    let start = momenta(&simulation);
    let mut met = false;
    while !simulation.is_finished() {
        simulation.step().expect("a step");
        let now = momenta(&simulation);
        met |= now[1] > 0.1 * start[0];
        let drift = (now[0] + now[1] - start[0]).abs();
        assert!(drift < 1e-12 * start[0], "{drift} N s");
    }
    assert!(met, "the bodies have met");
}

#[test]
fn a_fender_stops_the_ship() {
    let mut simulation = compose(&[]);
    while !simulation.is_finished() {
        simulation.step().expect("a step");
    }
    let [ship, _] = momenta(&simulation);
    let start = 700.0 * 8.0 * 0.5;
    println!("{} of the ship's momentum is left", ship / start);
    // it has been pushed back, with less than it brought
    assert!(ship < 0.0 && ship > -start, "{ship} N s");
}
