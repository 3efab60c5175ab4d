//! Fluids whose points move.

use super::*;

#[test]
fn points_carry_their_mass_through_a_periodic_side() {
    let mut s = stream("shifting = 0.05", 400);
    run(&mut s);
    let places = s.world().body(0).points.position.to_vec();
    let displacement = values(&s, "displacement");
    let density = values(&s, "density");
    let momentum: f64 = values(&s, "velocity").iter().step_by(3).sum::<f64>() / 256.0;
    // a stream is uniform in the end, with the momentum of the start
    assert!((momentum - 1.0).abs() < 2e-3, "{momentum}");
    for (i, x) in places.iter().enumerate() {
        let now = x + Vector3::from_column_slice(&displacement[3 * i..3 * i + 3]);
        assert!(
            (0.0..=1.0).contains(&now.x) && (0.0..=1.0).contains(&now.y),
            "{now}"
        );
        assert!((density[i] / 2.0 - 1.0).abs() < 0.02, "{}", density[i]);
    }
    let mass = &s.balances()[0].1[0];
    assert_eq!(mass.stored, mass.initial);
}

#[test]
fn shifting_keeps_points_apart() {
    let nearest = |keys: &str| {
        let mut s = stream(keys, 400);
        run(&mut s);
        let u = values(&s, "displacement");
        let places = &s.world().body(0).points.position;
        let now: Vec<_> = places
            .iter()
            .enumerate()
            .map(|(i, x)| x + Vector3::from_column_slice(&u[3 * i..3 * i + 3]))
            .collect();
        let mut nearest = f64::INFINITY;
        for (i, a) in now.iter().enumerate() {
            for b in &now[..i] {
                nearest = nearest.min((a - b).norm());
            }
        }
        16.0 * nearest
    };
    let (plain, shifted) = (nearest(""), nearest("shifting = 0.05"));
    assert!(
        shifted > 0.72 && shifted > plain + 0.02,
        "{shifted} {plain}"
    );
}

fn positions(s: &Simulation) -> Vec<Vector3<f64>> {
    let displacement = values(s, "displacement");
    let reference = s.world().body(0).points.position.iter();
    let moved = reference.zip(displacement.chunks_exact(3));
    moved
        .map(|(x, u)| x + Vector3::from_column_slice(u))
        .collect()
}

fn velocities(s: &Simulation) -> Vec<Vector3<f64>> {
    let flat = values(s, "velocity");
    flat.chunks_exact(3)
        .map(Vector3::from_column_slice)
        .collect()
}

#[test]
fn the_conservative_form_keeps_momentum_to_rounding() {
    let keys = "form = 'conservative'\ndensity_diffusion = 0.1\nartificial_viscosity = 0.02";
    let mut s = stream(keys, 200);
    run(&mut s);
    let bent = velocities(&s).iter().map(|v| v.y.abs()).sum::<f64>() / 256.0;
    assert!(bent > 0.01, "the stream is disturbed: {bent}");
    let balances = &s.balances()[0].1;
    for balance in &balances[1..] {
        // rounding of 200 steps
        assert!(balance.relative_error() < 1e-13, "{balance:?}");
    }
}

/// A block of fluid in empty space, which turns and is pressed.
fn turning(dimension: usize, keys: &str) -> Simulation {
    let cells = [10, 8, if dimension == 3 { 6 } else { 1 }];
    let body = block(
        cells,
        dimension,
        0.1,
        Store::Lattice,
        "density = 2\nviscosity = 1e-18",
    );
    let keys = format!("form = 'conservative'\nstate.tait.sound_speed = 10\nstep = 2e-3\n{keys}");
    let mut s = flow(body, &keys, 0.2);
    set(&mut s, "velocity", |[x, y, _]| {
        [0.3 - (y - 0.4), 0.2 + (x - 0.5), 0.0]
    });
    set(&mut s, "pressure", |[x, y, _]| [(3.0 * x).sin() + y]);
    s
}

#[test]
fn a_free_drop_keeps_momentum_and_spin_to_rounding() {
    for dimension in [2, 3] {
        let mut s = turning(
            dimension,
            "density_diffusion = 0.1\nartificial_viscosity = 0.02",
        );
        let mass: Vec<f64> = {
            s.start().expect("starts");
            let volume = &s.world().body(0).points.volume;
            let density = values(&s, "density");
            density.iter().zip(volume).map(|(rho, v)| rho * v).collect()
        };
        let totals = |s: &Simulation| {
            let points = positions(s).into_iter().zip(velocities(s)).zip(&mass);
            points.fold(
                (Vector3::zeros(), Vector3::zeros()),
                |(p, l), ((x, v), m)| (p + *m * v, l + *m * x.cross(&v)),
            )
        };
        let (before, shape) = (totals(&s), positions(&s));
        while !s.is_finished() {
            s.step().expect("steps");
        }
        let after = totals(&s);
        let distance = (positions(&s)[7] - positions(&s)[0]).norm();
        let change = (distance / (shape[7] - shape[0]).norm() - 1.0).abs();
        assert!(change > 1e-3, "it is pressed: {change}");
        // rounding of 100 steps; the size of both is 0.1
        assert!(
            (after.0 - before.0).norm() < 1e-14,
            "{dimension}D {before:?} {after:?}"
        );
        assert!(
            (after.1 - before.1).norm() < 1e-14,
            "{dimension}D {before:?} {after:?}"
        );
    }
}

#[test]
fn the_first_row_has_no_pressure_where_that_is_asked() {
    let mut s = turning(2, "surface = 'zero_pressure'");
    s.start().expect("starts");
    for _ in 0..5 {
        s.step().expect("steps");
        let (density, pressure) = (values(&s, "density"), values(&s, "pressure"));
        let mut largest = 0.0f64;
        for (i, x) in s.world().body(0).points.position.iter().enumerate() {
            if x.x < 0.1 || x.x > 0.9 || x.y < 0.1 || x.y > 0.7 {
                assert_eq!([density[i], pressure[i]], [2.0, 0.0], "at {x}");
            } else {
                largest = largest.max(pressure[i].abs());
            }
        }
        assert!(largest > 0.1, "{largest}");
    }
}

#[test]
fn a_thread_of_points_swings_along_itself() {
    // a family in a line does not tell how the fluid moves across it
    let material = "density = 2\nviscosity = 1e-18";
    let body = block([6, 1, 1], 2, 0.1, Store::Lattice, material);
    let keys = "form = 'conservative'\nstate.tait.sound_speed = 10\nstep = 2e-3";
    let mut s = flow(body, keys, 2.0);
    set(&mut s, "velocity", |[x, _, _]| [0.5 * (x - 0.3), 0.0, 0.0]);
    s.start().expect("starts");
    let (mut longest, mut crossings, mut before) = (0.0_f64, 0, 0.0);
    while !s.is_finished() {
        s.step().expect("steps");
        let places = positions(&s);
        assert!(places.iter().all(|x| x.y == 0.05), "{places:?}");
        let stretch = (places[5].x - places[0].x) / 0.5 - 1.0;
        crossings += u32::from(stretch * before < 0.0);
        (longest, before) = (longest.max(stretch), stretch);
    }
    assert!(longest > 0.005 && longest < 0.05, "{longest}");
    assert!(
        crossings > 10,
        "it swings at the speed of sound: {crossings}"
    );
}

#[test]
fn vortices_of_the_conservative_form_decay() {
    let material = "density = 1\nviscosity = 0.1";
    let keys = "form = 'conservative'\nstate.tait.sound_speed = 10\nstep = 5e-5";
    let mut s = flow(periodic(32, material), keys, 0.05);
    set(&mut s, "velocity", |x| taylor_green(x).map(|v| 25.0 * v));
    let mean = |values: Vec<f64>| values.iter().sum::<f64>() / 1024.0;
    let kinetic =
        |s: &Simulation| mean(values(s, "velocity").iter().map(|v| 0.5 * v * v).collect());
    let before = kinetic(&s);
    run(&mut s);
    let lost = before - kinetic(&s);
    // energy falls at 16 pi^2 nu
    let exact = before * (1.0 - (-16.0 * PI * PI * 0.1 * 0.05).exp());
    assert!((lost / exact - 1.0).abs() < 0.02, "{lost} {exact}");
}

#[test]
fn smoothing_leaves_linear_fields_as_they_are() {
    let body = block(
        [9, 7, 5],
        3,
        0.1,
        Store::Lattice,
        "density = 2\nviscosity = 1",
    );
    let spec = Pddo::spec(Horizon::Spacings(2.015));
    let family = Family::moving(&body, &spec).expect("valid");
    let complete = CompleteFamily::of(&body, &family);
    let mut treatments = Treatments::new(complete, 3);
    let place = &body.points.position;
    let linear = |x: &Vector3<f64>| 1.0 + x.x - 2.0 * x.y + 0.5 * x.z;
    let velocity: Vec<_> = place
        .iter()
        .map(|x| Vector3::new(linear(x), x.y, -x.x))
        .collect();
    let mut density: Vec<f64> = place.iter().map(linear).collect();
    // the densities of two materials differ by a jump
    let material: Vec<u16> = place.iter().map(|x| u16::from(x.x > 0.45)).collect();
    let jumps = density.iter_mut().zip(&material);
    jumps.for_each(|(rho, m)| *rho += 10.0 * f64::from(*m));
    let neighbours = || Neighbours {
        family: &family,
        volume: &body.points.volume,
        material: &material,
        rules: &[],
    };
    let smooth = treatments.smooth(neighbours(), &velocity, &density);
    for (i, smooth) in smooth.iter().enumerate() {
        // rounding of a solution by four
        assert!(
            (smooth.xyz() - velocity[i]).norm() < 1e-12 && (smooth.w - density[i]).abs() < 1e-12
        );
    }
    density[100] += 1.0;
    let smooth = treatments.smooth(neighbours(), &velocity, &density);
    assert!(density[100] - smooth[100].w > 0.5, "a peak is smoothed");
}

/// The density of an even shear flow stays nearly uniform, so that hardly anything changes where it alone is smoothed.
#[test]
fn smoothing_of_the_density_leaves_the_velocity() {
    let end = |keys: &str| {
        let material = "density = 2\nviscosity = 0.01";
        let keys = format!("state.tait.sound_speed = 10\nstep = 1e-3\n{keys}");
        let mut s = flow(periodic(12, material), &keys, 0.01);
        set(&mut s, "velocity", |[x, _, _]| {
            [0.0, (4.0 * std::f64::consts::TAU * x).sin(), 0.0]
        });
        run(&mut s);
        values(&s, "velocity")
    };
    let alone = end("");
    let departure = |keys: &str| {
        let pairs = alone.iter().zip(end(keys));
        pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    let density = departure("smoothing = 2\nsmoothed = 'density'");
    assert!(density < 1e-3, "{density}");
    assert!(departure("smoothing = 2") > 0.1);
}

/// Where all bonds have one length, its square is their mean square, whatever their weight.
#[test]
fn the_mean_square_of_nearest_neighbours_is_that_of_the_spacing() {
    for spacing in [0.1, 3.0] {
        let body = block(
            [9, 7, 1],
            2,
            spacing,
            Store::Lattice,
            "density = 2\nviscosity = 1",
        );
        let spec = Pddo::spec(Horizon::Spacings(1.015));
        let family = Family::moving(&body, &spec).expect("valid");
        let complete = CompleteFamily::of(&body, &family);
        let expected = spacing * spacing;
        assert!((complete.mean_square / expected - 1.0).abs() < 1e-12);
    }
}

#[test]
fn a_free_surface_needs_the_conservative_form() {
    let body = block(
        [8, 8, 1],
        2,
        1.0,
        Store::Lattice,
        "density = 1\nviscosity = 1",
    );
    let mut world = perimelt_core::World::new(vec![body]);
    for (keys, key) in [
        (
            "description = 'eulerian'\nform = 'conservative'",
            "description",
        ),
        ("form = 'conservative'\nstress = 'compressible'", "stress"),
        ("description = 'eulerian'\nxsph = 0.5", "xsph"),
        ("convection = 'central'", "convection"),
        ("artificial_viscosity = -1", "artificial_viscosity"),
    ] {
        let mut setup = perimelt_core::Setup::new(&mut world, std::path::Path::new("."));
        setup.next_plugin("fluid");
        let fluid: Fluid = read(&format!("state.tait.sound_speed = 1\n{keys}"));
        let error = FluidRun::prepare(fluid, &mut setup).expect_err(keys);
        assert_eq!(error.key, key, "{error}");
    }
}
