//! Bodies that meet: what one gives the other one gets, whatever steps they take, over the whole run.

use std::path::Path;

use perimelt::case::Case;
use perimelt::core::Simulation;

fn compose(text: &str) -> Simulation {
    let case = Case::parse("meet.toml", text.to_string(), Path::new("")).expect("a valid case");
    let composed = case.compose();
    let mut simulation = composed.unwrap_or_else(|e| panic!("{}", e.render(false)));
    simulation.start().expect("it starts");
    simulation
}

/// Total of a conserved quantity over all physics, what boundaries and body forces supplied, and its size.
fn total(simulation: &Simulation, quantity: &str) -> [f64; 3] {
    let balances = simulation.balances();
    let of_quantity = balances.iter().flat_map(|(_, balances)| balances);
    let of_quantity = of_quantity.filter(|b| b.quantity == quantity);
    of_quantity.fold([0.0; 3], |[stored, supplied, size], b| {
        let size = size + b.stored.abs() + b.supplied.abs();
        [stored + b.stored, supplied + b.supplied, size]
    })
}

/// Largest deviation of totals from their values at the start, relative to what bodies exchanged, over the whole run. All
/// impulses come from other bodies.
fn largest_drift(simulation: &mut Simulation, quantities: &[&str]) -> Vec<f64> {
    let start: Vec<_> = quantities.iter().map(|q| total(simulation, q)).collect();
    let mut largest = vec![0.0; quantities.len()];
    let mut exchanged = vec![0.0_f64; quantities.len()];
    while !simulation.is_finished() {
        simulation.step().expect("a step");
        for (n, quantity) in quantities.iter().enumerate() {
            let now = total(simulation, quantity);
            largest[n] = f64::max(largest[n], (now[0] - start[n][0]).abs());
            exchanged[n] = exchanged[n].max(now[2]);
        }
    }
    let relative = largest.iter().zip(&exchanged).map(|(l, e)| l / e);
    relative.collect()
}

/// A drop that flies against an elastic block, which floats free, above a rigid one.
fn drop_and_blocks(steps: &str, end: f64) -> Simulation {
    compose(&format!(
        "[bodies.drop]
        shape.box = {{ min = [0, 0, 0], max = [0.05, 0.05, 0.0025] }}
        dimension = 2
        thickness = 1
        spacing = 0.0025
        material = 'oil'
        initial.velocity = [1, 0.3, 0]
        [bodies.block]
        shape.box = {{ min = [0.05, 0.02, 0], max = [0.07, 0.08, 0.0025] }}
        dimension = 2
        thickness = 1
        spacing = 0.0025
        material = 'rubber'
        [bodies.float]
        shape.box = {{ min = [0.01, 0.05, 0], max = [0.04, 0.07, 0.0025] }}
        dimension = 2
        thickness = 1
        spacing = 0.0025
        material = 'rubber'
        [materials.oil]
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
        body = 'block'
        formulation = 'ordinary'
        kinematics = 'finite'
        solver.explicit = {{}}
        [[physics]]
        type = 'rigid_body'
        body = 'float'
        [[couplers]]
        type = 'fluid_structure'
        fluid = 'drop'
        solid = 'block'
        [[couplers]]
        type = 'fluid_structure'
        fluid = 'drop'
        solid = 'float'
        slip = true
        [time]
        end = {end}
        [log]
        interval = {end}"
    ))
}

#[test]
fn fluid_and_solids_keep_their_momentum_and_angular_momentum_with_equal_and_unequal_steps() {
    // as long as the fluid can, where the solid takes sub-steps; and shorter than the solid needs
    for steps in ["", "step = 1e-5"] {
        let mut simulation = drop_and_blocks(steps, 0.02);
        let quantities = ["momentum.x", "momentum.y", "angular_momentum.z"];
        let drifts = largest_drift(&mut simulation, &quantities);
        assert!(drifts.iter().all(|d| *d < 1e-12), "{steps}: {drifts:?}");
        let sub_steps = &simulation.progress().sub_steps;
        assert_eq!(
            sub_steps[1] > sub_steps[0],
            steps.is_empty(),
            "{sub_steps:?}"
        );
        // the drop has pushed both
        let reports = simulation.reports();
        let moved = reports.iter().any(|(_, reports)| {
            let mut speeds = reports.iter().filter(|r| r.name.contains("velocity"));
            speeds.any(|r| r.value.abs() > 1e-2)
        });
        assert!(moved, "{reports:?}");
    }
}

#[test]
fn collisions_alone_keep_momentum_and_angular_momentum() {
    // accelerations are switched off, so that pressure does not keep the drop out; its points fly through each other
    let mut simulation = drop_and_blocks("startup = 1e12\n collisions = true", 3e-3);
    let quantities = ["momentum.x", "momentum.y", "angular_momentum.z"];
    let drifts = largest_drift(&mut simulation, &quantities);
    assert!(drifts.iter().all(|d| *d < 1e-12), "{drifts:?}");
    let fields = simulation.world().fields();
    let index = fields.find(0, "velocity").expect("it is owned");
    let data = fields.field(index).data();
    let (points, _) = data.flat().as_chunks::<3>();
    let reflected = points.iter().filter(|v| v[0] < 0.0).count();
    assert!(reflected > 0, "the drop meets the block");
}

/// Two bars of the same material, the first one of which flies against the other one, which is free.
fn bars(steps: [&str; 2], lengths: [f64; 2]) -> Simulation {
    let [a, b] = lengths;

    compose(&format!(
        "[bodies.first]
        shape.box = {{ min = [{}, 0, 0], max = [0.1, 0.01, 0.0025] }}
        dimension = 2
        spacing = 0.0025
        material = 'steel'
        initial.velocity = [10, 0, 0]
        [bodies.second]
        shape.box = {{ min = [0.101, 0, 0], max = [{}, 0.01, 0.0025] }}
        dimension = 2
        spacing = 0.0025
        material = 'steel'
        [materials.steel]
        density = 7850
        youngs_modulus = 2e11
        [[physics]]
        type = 'mechanical'
        body = 'first'
        kinematics = 'finite'
        solver.explicit = {{}}
        {}
        [[physics]]
        type = 'mechanical'
        body = 'second'
        kinematics = 'finite'
        solver.explicit = {{}}
        {}
        [[couplers]]
        type = 'contact'
        body = 'first'
        other = 'second'
        [time]
        end = {}
        [log]
        interval = {}",
        0.1 - a,
        0.101 + b,
        steps[0],
        steps[1],
        8e-4,
        8e-4
    ))
}

/// Velocities of the centres of mass along x, m/s.
fn speeds(simulation: &Simulation) -> [f64; 2] {
    let fields = simulation.world().fields();
    [0, 1].map(|body| {
        let index = fields.find(body, "velocity").expect("it is owned");
        let data = fields.field(index).data();
        let (points, _) = data.flat().as_chunks::<3>();
        points.iter().map(|v| v[0]).sum::<f64>() / points.len() as f64
    })
}

#[test]
fn equal_bars_that_collide_change_their_velocities_whatever_steps_they_take() {
    for steps in [["", ""], ["step = 5e-8", ""], ["", "step = 3e-8"]] {
        let mut simulation = bars(steps, [0.2, 0.2]);
        let quantities = ["momentum.x", "momentum.y"];
        let drifts = largest_drift(&mut simulation, &quantities[..1]);
        assert!(drifts[0] < 1e-12, "{steps:?}: {drifts:?}");
        let [first, second] = speeds(&simulation);
        let restitution = (second - first) / 10.0;
        println!("{steps:?}: {first} {second}, restitution {restitution}");
        // bars of one length part without vibration: all of the momentum goes over
        assert!((restitution - 1.0).abs() < 0.02, "{steps:?}: {restitution}");
    }
}

/// Way of a rigid block down a slope of 20 degrees in 0.3 s, m; gravity is turned instead of the slope. A dashpot across the
/// slope lets it come to rest on its contact.
fn slide(friction: f64) -> f64 {
    let (g, angle) = (9.81, 20.0_f64.to_radians());
    let mut simulation = compose(&format!(
        "[bodies.block]
        shape.box = {{ min = [0, 0, 0], max = [0.1, 0.05, 0.01] }}
        dimension = 2
        spacing = 0.01
        material = 'rubber'
        [bodies.slope]
        shape.box = {{ min = [-0.1, -0.03, 0], max = [0.5, 0, 0.01] }}
        dimension = 2
        spacing = 0.01
        material = 'rubber'
        [materials.rubber]
        density = 1100
        youngs_modulus = 1e6
        [[physics]]
        type = 'rigid_body'
        body = 'block'
        hold = ['rotation']
        damping = {{ y = 100 }}
        step = 1e-4
        [[physics]]
        type = 'rigid_body'
        body = 'slope'
        hold = ['x', 'y', 'rotation']
        [[couplers]]
        type = 'contact'
        body = 'block'
        other = 'slope'
        friction = {friction}
        stiffness = 1
        [[couplers]]
        type = 'gravity'
        body = 'block'
        acceleration = [{}, {}, 0]
        [time]
        end = 0.3
        [log]
        interval = 0.3",
        g * angle.sin(),
        -g * angle.cos()
    ));
    while !simulation.is_finished() {
        simulation.step().expect("a step");
    }
    let fields = simulation.world().fields();
    let index = fields.find(0, "displacement").expect("it is owned");
    fields.field(index).data().flat()[0]
}

#[test]
fn a_block_on_a_slope_slides_or_sticks_as_coulomb_says() {
    let (g, angle) = (9.81, 20.0_f64.to_radians());
    for friction in [0.0, 0.2, 0.5] {
        let way = |acceleration: f64| 0.5 * acceleration.max(0.0) * 0.3 * 0.3;
        let expected = way(g * (angle.sin() - friction * angle.cos()));
        let found = slide(friction);
        println!("friction {friction}: {found} m, expected {expected} m");
        // the contact settles first, in about a hundredth of a second
        assert!(
            (found - expected).abs() < 0.02 * way(g * angle.sin()),
            "{found}"
        );
    }
}
