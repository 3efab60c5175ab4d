//! What bodies that meet exchange, over a whole run.

use std::path::Path;

use perimelt::case::Case;
use perimelt::core::Simulation;

/// A simulation of a case, started.
pub fn compose(text: &str) -> Simulation {
    let case = Case::parse("meet.toml", text.to_string(), Path::new("")).expect("a valid case");
    let composed = case.compose();
    let mut simulation = composed.unwrap_or_else(|e| panic!("{}", e.render(false)));
    simulation.start().expect("it starts");
    simulation
}

/// Materials and physics of a drop of oil, `drop`, and two bodies of rubber, one of them elastic and the other one rigid.
/// `steps` are keys of the fluid.
pub fn oil_and_rubber(steps: &str, [elastic, rigid]: [&str; 2]) -> String {
    format!(
        "[materials.oil]
        density = 900
        viscosity = 1
        [materials.rubber]
        density = 1100
        youngs_modulus = 1e6
        poissons_ratio = 0.4
        [[physics]]
        type = 'fluid'
        body = 'drop'
        form = 'conservative'
        stress = 'central'
        state.tait.sound_speed = 20
        artificial_viscosity = 0.1
        {steps}
        [[physics]]
        type = 'mechanical'
        body = '{elastic}'
        formulation = 'ordinary'
        kinematics = 'finite'
        solver.explicit = {{}}
        [[physics]]
        type = 'rigid_body'
        body = '{rigid}'"
    )
}

/// Distance of the bodies of an encounter from the origin, m.
const LEVER: f64 = 0.05;

/// Total of a conserved quantity over all physics, and the sum of the amounts with which they were supplied.
pub fn total(simulation: &Simulation, quantity: &str) -> [f64; 2] {
    let balances = simulation.balances();
    let of_quantity = balances.iter().flat_map(|(_, balances)| balances);
    let of_quantity = of_quantity.filter(|b| b.quantity == quantity);
    of_quantity.fold([0.0; 2], |[stored, exchanged], b| {
        [stored + b.stored, exchanged + b.supplied.abs()]
    })
}

/// What bodies exchanged of a quantity; for components of a vector the size of the vector.
pub fn exchanged(simulation: &Simulation, quantity: &str) -> f64 {
    let of = |quantity: &str| total(simulation, quantity)[1];
    let impulse = of("momentum.x").hypot(of("momentum.y"));
    match quantity {
        "angular_momentum.z" => of(quantity) + LEVER * impulse,
        "momentum.x" | "momentum.y" => impulse,
        _ => of(quantity),
    }
}

/// Largest deviation of totals from their values at the start, relative to what bodies exchanged, over the whole run. All
/// that bodies are supplied with comes from other bodies.
pub fn largest_drift(simulation: &mut Simulation, quantities: &[&str]) -> Vec<f64> {
    let start: Vec<_> = quantities.iter().map(|q| total(simulation, q)).collect();
    let mut largest = vec![0.0; quantities.len()];
    let mut most = vec![0.0_f64; quantities.len()];
    while !simulation.is_finished() {
        simulation.step().expect("a step");
        for (n, quantity) in quantities.iter().enumerate() {
            let now = total(simulation, quantity);
            largest[n] = f64::max(largest[n], (now[0] - start[n][0]).abs());
            most[n] = most[n].max(exchanged(simulation, quantity));
        }
    }
    let relative = largest.iter().zip(&most).map(|(l, m)| l / m);
    relative.collect()
}
