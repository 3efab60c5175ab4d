use perimelt_core::Face;
use perimelt_core::body::Store;
use perimelt_core::simulation::Simulation;
use perimelt_core::world::LayerHandle;
use perimelt_core::{
    Coupler, Family, FamilySpec, RunError, Setup, SetupError, Step, World, Write, keys,
};
use serde::{Deserialize, Serialize};

use super::Mechanical;
use super::moduli::{Moduli, Plane, bond_based_poissons_ratio};
use crate::testing::{block, read, run, set, simulation, values};

const STEEL: &str = "density = 8000\nyoungs_modulus = 2e11\npoissons_ratio = 0.25";
const CELLS: [[usize; 3]; 3] = [[30, 1, 1], [22, 20, 1], [14, 13, 12]];

/// A uniform eigenstrain, such as a uniform temperature gives.
#[derive(Debug, Default, Serialize, Deserialize)]
struct Swelling {
    strain: f64,
    #[serde(skip)]
    eigenstrain: Option<Write<f64>>,
}

#[typetag::serialize(name = "test_swelling")]
impl Coupler for Swelling {
    fn prepare(&mut self, setup: &mut Setup<'_>) -> Result<(), SetupError> {
        self.eigenstrain = Some(setup.add(0, &keys::EIGENSTRAIN)?);
        Ok(())
    }

    fn apply(&mut self, world: &World, _: Step) -> Result<(), RunError> {
        let field = self.eigenstrain.expect("prepared");
        world
            .write(field)
            .iter_mut()
            .for_each(|e| *e += self.strain);
        Ok(())
    }
}

/// Heating and cooling in 8 s between rigid, frictionless walls across x.
#[derive(Debug, Default, Serialize, Deserialize)]
struct HeatCycle {
    strain: f64,
    #[serde(skip)]
    eigenstrain: Option<Write<f64>>,
    #[serde(skip)]
    walls: Vec<LayerHandle>,
}

#[typetag::serialize(name = "test_heat_cycle")]
impl Coupler for HeatCycle {
    fn prepare(&mut self, setup: &mut Setup<'_>) -> Result<(), SetupError> {
        self.eigenstrain = Some(setup.add(0, &keys::EIGENSTRAIN)?);
        for face in [Face::XMin, Face::XMax] {
            self.walls
                .push(setup.layer(0, &keys::DISPLACEMENT, face, false)?);
        }
        Ok(())
    }

    fn apply(&mut self, world: &World, step: Step) -> Result<(), RunError> {
        for wall in &self.walls {
            world.set_layer(*wall, [-1.0, 1.0, 1.0], [0.0; 3]);
        }
        let strain = self.strain * (1.0 - (step.end() - 4.0).abs() / 4.0);
        let field = self.eigenstrain.expect("prepared");
        world.write(field).iter_mut().for_each(|e| *e += strain);
        Ok(())
    }
}

fn solid(cells: [usize; 3], keys: &str, strain: f64, end: f64) -> Simulation {
    let dimension = cells.iter().filter(|c| **c > 1).count();
    let body = block(cells, dimension, 1e-3, Store::Lattice, STEEL);
    let mechanical: Mechanical = read(keys);
    let swelling = Swelling {
        strain,
        ..Swelling::default()
    };
    simulation(
        body,
        vec![Box::new(mechanical)],
        vec![Box::new(swelling)],
        end,
    )
}

/// Force, energy and stress of a displaced block.
struct Evaluated {
    force: Vec<f64>,
    energy: Vec<[f64; 2]>,
    stress: Vec<[f64; 6]>,
    /// The point in the middle, whose family is complete.
    middle: usize,
}

const STEEL_MODULUS: f64 = 2e11;

fn evaluate(
    cells: [usize; 3],
    keys: &str,
    displacement: impl Fn([f64; 3]) -> [f64; 3],
) -> Evaluated {
    let dimension = dimension(cells);
    let store = if keys.contains("# list") {
        Store::List
    } else {
        Store::Lattice
    };
    let material = "density = 8000\nyoungs_modulus = 2e11\npoissons_ratio = 0.3";
    let body = block(cells, dimension, 1e-3, store, material);
    let mut mechanical: Mechanical = read(keys);
    let mut world = World::new(vec![body]);
    let mut setup = Setup::new(&mut world, std::path::Path::new("."));
    setup.next_plugin("mechanical");
    perimelt_core::Physics::prepare(&mut mechanical, &mut setup).expect("valid");
    let solid = &mut mechanical.run.as_mut().expect("prepared").solid;
    let points = &world.body(0).points;
    let u: Vec<f64> = points
        .position
        .iter()
        .flat_map(|x| displacement((*x).into()))
        .collect();
    solid.set_displacement(&u, &[]);
    let mut force = vec![0.0; u.len()];
    solid.force(&mut force);
    let half = cells.map(|c| c / 2);
    Evaluated {
        force,
        energy: solid.energy().to_vec(),
        stress: solid.stress().to_vec(),
        middle: (half[2] * cells[1] + half[1]) * cells[0] + half[0],
    }
}

fn dimension(cells: [usize; 3]) -> usize {
    cells.iter().filter(|c| **c > 1).count()
}

/// `H x`, with the rows of H.
fn affine(h: [[f64; 3]; 3]) -> impl Fn([f64; 3]) -> [f64; 3] {
    move |x| h.map(|row| (0..3).map(|a| row[a] * x[a]).sum())
}

/// Small strains in the given dimension: isotropic, along x, shear.
fn strains(dimension: usize, size: f64) -> Vec<[[f64; 3]; 3]> {
    let mut isotropic = [[0.0; 3]; 3];
    (0..dimension).for_each(|a| isotropic[a][a] = size);
    let mut uniaxial = [[0.0; 3]; 3];
    uniaxial[0][0] = size;
    let mut shear = [[0.0; 3]; 3];
    if dimension > 1 {
        (shear[0][1], shear[1][0]) = (size, size);
    }
    vec![isotropic, uniaxial, shear]
}

/// Classical energy density, J/m³, and stress, Pa, of a small strain.
fn classical(keys: &str, dimension: usize, strain: &[[f64; 3]; 3]) -> (f64, [f64; 6]) {
    let plane = if keys.contains("strain") {
        Plane::Strain
    } else {
        Plane::Stress
    };
    let ratio = if keys.contains("formulation") {
        0.3
    } else {
        bond_based_poissons_ratio(dimension, plane)
    };
    let moduli = Moduli::new(STEEL_MODULUS, ratio, dimension, plane);
    let trace: f64 = (0..dimension).map(|a| strain[a][a]).sum();
    let stress = |a: usize, b: usize| {
        let isotropic = if a == b && a < dimension {
            moduli.lame * trace
        } else {
            0.0
        };
        2.0 * moduli.shear * strain[a][b] + isotropic
    };
    // in 1D the shear modulus stands in for nothing
    let mut tensor = [(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0)].map(|(a, b)| stress(a, b));
    let energy = (0..9)
        .map(|c| 0.5 * stress(c / 3, c % 3) * strain[c / 3][c % 3])
        .sum();
    if dimension == 2 && plane == Plane::Strain {
        tensor[2] = ratio * (tensor[0] + tensor[1]);
    }
    (energy, tensor)
}

const FORMULATIONS: [&str; 3] = [
    "",
    "formulation = \"ordinary\"",
    "formulation = \"correspondence\"",
];
const STORES: [&str; 2] = ["", "# list"];
const PLANES: [&str; 2] = ["", "plane = \"strain\""];

/// Worst error of energy and stress over the given points, relative to the classical ones.
fn error(evaluated: &Evaluated, points: &[usize], exact: (f64, [f64; 6])) -> f64 {
    let scale = exact.1.iter().fold(0.0f64, |s, x| s.max(x.abs()));
    let of = |&i: &usize| {
        let stress = evaluated.stress[i].iter().zip(exact.1);
        let stress = stress
            .map(|(a, b)| (a - b).abs() / scale)
            .fold(0.0, f64::max);
        stress.max((evaluated.energy[i][0] / exact.0 - 1.0).abs())
    };
    points.iter().map(of).fold(0.0, f64::max)
}

/// Patch test over formulation, dimension, plane, store, influence and partial volume.
#[test]
fn uniform_strain_gives_the_classical_energy_and_stress() {
    for (cells, plane, store) in CELLS
        .iter()
        .flat_map(|c| PLANES.map(|p| (*c, p)))
        .flat_map(|(c, p)| STORES.map(|s| (c, p, s)))
    {
        let dimension = dimension(cells);
        if dimension != 2 && !plane.is_empty() {
            continue;
        }
        for formulation in FORMULATIONS {
            for family in [
                "horizon = 2\npartial_volume = \"none\"",
                "horizon = 2",
                "horizon = 3\ninfluence = \"conical\"",
                "horizon = 3\npartial_volume = \"full\"\ninfluence = \"gaussian\"",
            ] {
                let keys = [formulation, plane, family, store].join("\n");
                for (which, strain) in strains(dimension, 1e-6).iter().enumerate() {
                    if dimension == 1 && which == 2 {
                        continue;
                    }
                    let evaluated = evaluate(cells, &keys, affine(*strain));
                    let exact = classical(&keys, dimension, strain);
                    let inside = error(&evaluated, &[evaluated.middle], exact);
                    let all: Vec<usize> = (0..evaluated.energy.len()).collect();
                    let anywhere = error(&evaluated, &all, exact);
                    let case = format!("{cells:?} {keys:?} strain {which}: {inside} {anywhere}");
                    let correspondence = formulation.contains("correspondence");
                    if correspondence {
                        // sums of a hundred bonds
                        assert!(anywhere < 1e-10, "{case}");
                    } else if which == 0 {
                        assert!(inside < 1e-10, "{case}");
                        // calibrated by the owner's bonds along each axis; the stress at an edge also
                        // takes the dilatation of an incomplete family
                        assert!(energy_error(&evaluated, exact.0) < 1e-10, "{case}");
                    } else {
                        // anisotropy of lattices, that of the recommended family in the tests below
                        assert!(inside < 0.4, "{case}");
                    }
                }
            }
        }
    }
}

fn energy_error(evaluated: &Evaluated, exact: f64) -> f64 {
    let errors = evaluated
        .energy
        .iter()
        .map(|[w, _]| (w / exact - 1.0).abs());
    errors.fold(0.0, f64::max)
}

/// Residual anisotropy of a complete family at 3.015 spacings (spec 04, 1.12: moments with partial
/// volumes over that of isotropic strain).
#[test]
fn uniaxial_strain_is_off_by_the_anisotropy_of_the_lattice() {
    for (cells, longitudinal, shear) in [
        (CELLS[1], 0.8608 / 0.8622, 0.8666 / 0.8622),
        (CELLS[2], 0.8540 / 0.8896, 0.9430 / 0.8896),
    ] {
        let dimension = dimension(cells);
        let keys = "horizon = 3.015\ncorrection = \"lattice\"";
        for (which, ratio) in [(1, longitudinal), (2, shear)] {
            let strain = strains(dimension, 1e-6)[which];
            let evaluated = evaluate(cells, keys, affine(strain));
            let (energy, _) = classical(keys, dimension, &strain);
            let found = evaluated.energy[evaluated.middle][0] / energy;
            // the table has four digits
            assert!(
                (found / ratio - 1.0).abs() < 3e-4,
                "{cells:?} {which}: {found} {ratio}"
            );
        }
    }
}

/// Spec 04, gao-2.1-constants: 1 % in 2D, 6 % in 3D at 3.015 spacings.
#[test]
fn anisotropy_of_the_recommended_family_is_small() {
    for (cells, limit) in [([22, 20, 1], 0.01), ([14, 14, 14], 0.0601)] {
        let dimension = dimension(cells);
        for formulation in &FORMULATIONS[..2] {
            let keys = format!("{formulation}\nhorizon = 3.015\ncorrection = \"lattice\"");
            for strain in &strains(dimension, 1e-6)[1..] {
                let evaluated = evaluate(cells, &keys, affine(*strain));
                let (energy, _) = classical(&keys, dimension, strain);
                let error = (evaluated.energy[evaluated.middle][0] / energy - 1.0).abs();
                assert!(error < limit, "{cells:?} {keys}: {error}");
            }
        }
    }
}

#[test]
fn both_stores_give_the_same_forces() {
    let displacement =
        |[x, y, z]: [f64; 3]| [1e-6 * (300.0 * (x + y)).sin(), 2e-4 * x, 1e-4 * z * x];
    for cells in CELLS {
        let in_space = |x| {
            let u = displacement(x);
            std::array::from_fn(|a| if a < dimension(cells) { u[a] } else { 0.0 })
        };
        for formulation in FORMULATIONS {
            for kinematics in ["linear", "finite"] {
                let keys = format!("{formulation}\nkinematics = \"{kinematics}\"\nhorizon = 3");
                let [lattice, list] = STORES
                    .map(|store| evaluate(cells, &format!("{keys}\n{store}"), in_space).force);
                let scale = lattice.iter().fold(0.0f64, |s, f| s.max(f.abs()));
                for (a, b) in lattice.iter().zip(&list) {
                    let error = (a - b).abs() / scale;
                    assert!(error < 1e-12, "{cells:?} {keys}: {error:e}");
                }
            }
        }
    }
}

/// Spec 04, gao-3.2-heating: heat of deformation is proportional to the conjugate stress, which pure shear does not have.
#[test]
fn pure_shear_heats_nothing_and_stretching_heats_by_the_classical_value() {
    for cells in &CELLS[1..] {
        let dimension = dimension(*cells);
        for formulation in FORMULATIONS {
            let keys = format!("{formulation}\nhorizon = 3.015");
            let conjugate = |which: usize| {
                let strain = strains(dimension, 1e-6)[which];
                let evaluated = evaluate(*cells, &keys, affine(strain));
                let all: f64 = evaluated.energy.iter().map(|[_, p]| p).sum();
                (evaluated.energy[evaluated.middle][1], all)
            };
            let ((stretched, all), (sheared, none)) = (conjugate(1), conjugate(2));
            let ratio = match formulation {
                "" => bond_based_poissons_ratio(dimension, Plane::Stress),
                _ => 0.3,
            };
            let moduli = Moduli::new(STEEL_MODULUS, ratio, dimension, Plane::Stress);
            let classical = dimension as f64 * moduli.bulk * 1e-6;
            let case = format!("{cells:?} {formulation}");
            assert!(
                (stretched / classical - 1.0).abs() < 5e-3,
                "{case}: {stretched} {classical}"
            );
            assert!(sheared.abs() < 1e-10 * classical, "{case}: {sheared}");
            assert!(none.abs() < 1e-10 * all, "{case}: {none} {all}");
        }
    }
}

/// Gao (2020), 3.5.2: `beta^2 T / (rho c (lambda + 2 mu))` of carbon steel under plane stress (spec 04, 1.7).
#[test]
fn the_coupling_coefficient_of_the_steel_plate_is_the_published_one() {
    let moduli = Moduli::new(200e9, 0.17, 2, Plane::Stress);
    let thermal_modulus = 2.0 * moduli.bulk * 11.5e-6;
    let stiffness = moduli.lame + 2.0 * moduli.shear;
    let coupling = thermal_modulus.powi(2) * 285.0 / (7870.0 * 472.0 * stiffness);
    assert!((coupling - 0.0028606).abs() < 5e-8, "{coupling}");
}

/// Wang (2025), 4.3.4: a square bar that is released from a strain along its axis moves alike along y and z.
#[test]
fn a_square_bar_moves_alike_along_both_of_its_sides() {
    let cells = [12, 6, 6];
    for formulation in FORMULATIONS {
        let keys = format!("{formulation}\nsolver.explicit = {{}}\nkinematics = \"finite\"");
        let mut s = solid(cells, &keys, 0.0, 2e-6);
        set(&mut s, "displacement", |[x, ..]| [1e-3 * x, 0.0, 0.0]);
        run(&mut s);
        let u = values(&s, "displacement");
        let at = |i: usize, j: usize, k: usize| 3 * ((k * cells[1] + j) * cells[0] + i);
        let largest = u
            .iter()
            .skip(1)
            .step_by(3)
            .fold(0.0f64, |m, v| m.max(v.abs()));
        assert!(largest > 1e-8, "it moves");
        for (i, j, k) in (0..12).flat_map(|i| (0..36).map(move |n| (i, n / 6, n % 6))) {
            let apart = (u[at(i, j, k) + 1] - u[at(i, k, j) + 2]).abs();
            // rounding of some hundred steps; the benchmark asks for 1e-9 m
            assert!(
                apart < 1e-10 * largest,
                "{formulation} {i} {j} {k}: {apart:e}"
            );
        }
    }
}

/// `wang-4.0.1`: family sizes, volume and energies of uncorrected lattices (spec 01, table in 1.6.1).
#[test]
fn wang_4_0_1_lattice_constants() {
    let table: [(usize, usize, [f64; 3]); 10] = [
        (2, 4, [0.9549, 1.2732, 0.0000]),
        (2, 12, [0.8151, 0.8617, 0.6752]),
        (2, 28, [0.8690, 0.8675, 0.8737]),
        (2, 48, [0.8800, 0.8774, 0.8879]),
        (2, 80, [0.9348, 0.9212, 0.9756]),
        (3, 6, [0.9549, 1.5915, 0.0000]),
        (3, 32, [0.7880, 0.7968, 0.7749]),
        (3, 122, [0.9002, 0.8649, 0.9532]),
        (3, 256, [0.8629, 0.8536, 0.8770]),
        (3, 514, [0.8962, 0.8874, 0.9095]),
    ];
    for (row, (dimension, members, energies)) in table.into_iter().enumerate() {
        let n = row % 5 + 1;
        let side = 2 * n + 1;
        let cells = [side, side, if dimension == 3 { side } else { 1 }];
        let body = block(cells, dimension, 1.0, Store::Lattice, STEEL);
        let spec = FamilySpec::new(n as f64);
        let family = Family::build(&body, &spec).expect("valid");
        let complete = family.bonds_of(body.points.len() / 2);
        assert_eq!(complete, members, "{dimension}D, {n} spacings");
        let keys = format!("horizon = {n}\ncorrection = \"none\"");
        for (strain, ratio) in strains(dimension, 1e-6).iter().zip(energies) {
            let evaluated = evaluate(cells, &keys, affine(*strain));
            let (energy, _) = classical("", dimension, strain);
            let found = evaluated.energy[evaluated.middle][0] / energy;
            assert!(
                (found - ratio).abs() < 1e-4,
                "{dimension}D, {n}: {found} {ratio}"
            );
        }
    }
}

#[test]
fn the_published_calibration_is_exact_under_uniaxial_strain() {
    for cells in CELLS {
        let dimension = dimension(cells);
        for horizon in [2, 3] {
            let keys = format!("horizon = {horizon}\ncorrection = \"uniaxial\"");
            let strain = strains(dimension, 1e-6)[1];
            let evaluated = evaluate(cells, &keys, affine(strain));
            let (energy, _) = classical("", dimension, &strain);
            let found = evaluated.energy[evaluated.middle][0] / energy;
            // sums of a hundred bonds
            assert!((found - 1.0).abs() < 1e-10, "{cells:?} {keys}: {found}");
        }
    }
}

#[test]
fn ordinary_solids_with_poissons_ratio_of_the_bonds_are_bond_based() {
    for cells in &CELLS[1..] {
        let dimension = dimension(*cells);
        let ratio = bond_based_poissons_ratio(dimension, Plane::Stress);
        let material = format!("density = 8000\nyoungs_modulus = 2e11\npoissons_ratio = {ratio}");
        let force = |keys: &str| {
            let body = block(*cells, dimension, 1e-3, Store::Lattice, &material);
            let mut s = simulation(body, vec![Box::new(read::<Mechanical>(keys))], vec![], 1e-9);
            set(&mut s, "displacement", |[x, y, z]| {
                [1e-6 * (300.0 * y).sin(), 2e-4 * x, 1e-4 * z * x]
            });
            s.start().expect("starts");
            s.step().expect("steps");
            values(&s, "velocity")
        };
        let keys = "solver.explicit = {}\nstep = 1e-9\nkinematics = \"finite\"";
        let bond = force(keys);
        let ordinary = force(&format!("{keys}\nformulation = \"ordinary\""));
        let scale = bond.iter().fold(0.0f64, |s, f| s.max(f.abs()));
        let same = bond
            .iter()
            .zip(&ordinary)
            .all(|(a, b)| (a - b).abs() < 1e-12 * scale);
        assert!(same && scale > 0.0, "{cells:?}");
    }
}

#[test]
fn a_rigid_rotation_meets_no_force_under_finite_kinematics() {
    let (sin, cos) = 0.7f64.sin_cos();
    let rotation = affine([[cos - 1.0, -sin, 0.0], [sin, cos - 1.0, 0.0], [0.0; 3]]);
    for cells in &CELLS[1..] {
        for formulation in FORMULATIONS {
            let keys = format!("kinematics = \"finite\"\n{formulation}");
            let evaluated = evaluate(*cells, &keys, &rotation);
            // stress of a strain of one bit: 2e11 Pa 1e-16 over a spacing, and some bonds to sum
            let largest = evaluated.force.iter().fold(0.0f64, |s, f| s.max(f.abs()));
            assert!(
                largest < 2e11 * 1e-16 / 1e-3 * 300.0,
                "{cells:?} {keys}: {largest}"
            );
            // the energy of the modes without strain is a difference of sums: squares of strains
            assert!(
                evaluated.energy.iter().all(|[w, _]| *w < 1e-15 * 2e11),
                "{cells:?} {keys}"
            );
        }
    }
}

#[test]
fn both_kinematics_agree_for_small_strains() {
    let displacement = |[x, y, z]: [f64; 3]| [1e-9 * (300.0 * y).sin(), 2e-7 * x, 1e-7 * z * x];
    for formulation in FORMULATIONS {
        let linear = evaluate(CELLS[2], formulation, displacement).force;
        let keys = format!("kinematics = \"finite\"\n{formulation}");
        let finite = evaluate(CELLS[2], &keys, displacement).force;
        let scale = linear.iter().fold(0.0f64, |s, f| s.max(f.abs()));
        // second order in strains of 1e-6
        let same = linear
            .iter()
            .zip(&finite)
            .all(|(l, f)| (l - f).abs() < 1e-5 * scale);
        assert!(same, "{formulation}");
    }
}

/// Force is minus the derivative of the energy, also at surfaces, so momentum and energy are kept.
#[test]
fn forces_are_the_derivative_of_the_energy_and_cancel() {
    let cells = [7, 6, 5];
    let displacement = |size: f64| {
        move |[x, y, z]: [f64; 3]| {
            [
                1e-6 * (900.0 * y).sin() + size * (2000.0 * x).cos(),
                2e-4 * x + size * (1500.0 * z).sin(),
                0.1 * z * x,
            ]
        }
    };
    for formulation in FORMULATIONS {
        for kinematics in ["linear", "finite"] {
            let keys = format!("{formulation}\nkinematics = \"{kinematics}\"\nhorizon = 2");
            let at = |size: f64| evaluate(cells, &keys, displacement(size));
            let total = |e: &Evaluated| e.energy.iter().map(|[w, _]| w).sum::<f64>();
            let (size, middle) = (1e-8, at(0.0));
            let slope = (total(&at(size)) - total(&at(-size))) / (2.0 * size);
            let body = block(cells, 3, 1e-3, Store::Lattice, STEEL);
            let power: f64 = body
                .points
                .position
                .iter()
                .zip(middle.force.chunks_exact(3))
                .map(|(x, f)| f[0] * (2000.0 * x.x).cos() + f[1] * (1500.0 * x.z).sin())
                .sum();
            // third order in the size for finite kinematics, rounding of the difference
            let error = (slope + power).abs() / power.abs();
            assert!(error < 1e-6, "{keys}: {slope} {power}");
            let scale: f64 = middle.force.iter().map(|f| f.abs()).sum();
            for axis in 0..3 {
                let sum: f64 = middle.force.iter().skip(axis).step_by(3).sum();
                assert!(sum.abs() < 1e-13 * scale, "{keys}: momentum along {axis}");
            }
        }
    }
}

#[test]
fn a_free_body_swells_without_stress_by_every_solver() {
    let tight = "solver.relaxation = { relative_tolerance = 1e-12 }";
    for cells in CELLS {
        for keys in [
            "",
            "correction = \"none\"",
            "solver.quasi_static = { tolerance = 1e-12 }",
            tight,
            "formulation = \"ordinary\"",
            "formulation = \"ordinary\"\nsolver.relaxation = { relative_tolerance = 1e-8 }",
            "formulation = \"correspondence\"",
            "formulation = \"correspondence\"\nsolver.relaxation = { relative_tolerance = 1e-8 }",
            "formulation = \"correspondence\"\nkinematics = \"finite\"",
        ] {
            let mut s = solid(cells, keys, 1e-3, 1.0);
            run(&mut s);
            let u = values(&s, "displacement");
            let positions = &s.world().body(0).points.position;
            let dimension = s.world().body(0).dimension;
            let last = positions.len() - 1;
            for axis in 0..dimension {
                let span = positions[last][axis] - positions[0][axis];
                let swelling = (u[3 * last + axis] - u[axis]) / span;
                assert!(
                    (swelling / 1e-3 - 1.0).abs() < 1e-6,
                    "{cells:?} {keys} {axis}: {swelling}"
                );
            }
            assert!(
                u.iter()
                    .enumerate()
                    .all(|(i, u)| i % 3 < dimension || *u == 0.0)
            );
            // against the stress of the same strain held back
            let stress = values(&s, "stress");
            assert!(stress.iter().all(|p| p.abs() < 1e-5 * 2e11 * 1e-3));
        }
    }
}

#[test]
fn a_block_one_point_thick_is_refused_in_words() {
    let body = block([8, 8, 1], 3, 1e-3, Store::Lattice, STEEL);
    let mechanical: Mechanical = read("");
    let swelling = Swelling {
        strain: 1e-3,
        ..Swelling::default()
    };
    let mut s = simulation(
        body,
        vec![Box::new(mechanical)],
        vec![Box::new(swelling)],
        1.0,
    );
    let error = s.start().and_then(|()| s.step()).expect_err("it is loose");
    let message = error.to_string();
    assert!(
        message.contains("no bond of point 0 resists motion along z"),
        "{message}"
    );
}

#[test]
fn free_vibration_keeps_momentum_and_energy_and_has_the_classical_wave_speed() {
    let length = 0.1;
    let body = block([100, 1, 1], 1, 1e-3, Store::Lattice, STEEL);
    let wave_speed = (2e11f64 / 8000.0).sqrt();
    let period = 2.0 * length / wave_speed;
    let keys = "solver.explicit = {}\nstep = 2e-8";
    let mut s = simulation(
        body,
        vec![Box::new(read::<Mechanical>(keys))],
        vec![],
        period,
    );
    set(&mut s, "displacement", |[x, ..]| {
        [1e-6 * (std::f64::consts::PI * x / length).cos(), 0.0, 0.0]
    });
    run(&mut s);
    let u = values(&s, "displacement");
    // after a period of the first free-free mode the bar is back; the mode is nearly at rest
    // there, so an error of 1 % in speed shows as (2 pi 0.01)^2 / 2 in amplitude
    assert!((u[0] / 1e-6 - 1.0).abs() < 0.01, "{}", u[0]);
    let velocity = values(&s, "velocity");
    // an error in speed by d leaves a velocity of amplitude * omega * 2 pi d
    let omega = 2.0 * std::f64::consts::PI / period;
    assert!(
        velocity[0].abs() < 1e-6 * omega * 2.0 * std::f64::consts::PI * 0.02,
        "{}",
        velocity[0]
    );
    let momentum = &s.balances()[0].1[0];
    let scale = 8000.0 * 1e-6 * omega * length * 0.1;
    assert!(momentum.stored.abs() < 1e-10 * scale, "{momentum:?}");
}

#[test]
fn the_stable_step_is_stable_and_not_much_too_small() {
    for (cells, formulation) in CELLS.iter().flat_map(|c| FORMULATIONS.map(|f| (*c, f))) {
        for factor in [1.0, 2.2] {
            let keys = format!("solver.explicit = {{}}\n{formulation}");
            let mut s = solid(cells, &keys, 1e-4, 1.0);
            s.start().expect("starts");
            let stable = s.stable_steps()[0].expect("explicit motion has a limit");
            let keys = format!("{keys}\nstep = {}", factor * stable);
            let mut s = solid(cells, &keys, 1e-4, 2000.0 * stable);
            s.start().expect("starts");
            let mut outcome = Ok(false);
            while outcome.is_ok() && !s.is_finished() {
                outcome = s.step();
            }
            assert_eq!(
                outcome.is_ok(),
                factor == 1.0,
                "{cells:?} {formulation} {factor}"
            );
            if let Err(error) = outcome {
                assert!(error.to_string().contains("blew up"), "{error}");
            }
        }
    }
}

/// Mean axial stress (Pa) of a bar between rigid walls, free at its sides, at the end of a part of a heat cycle.
fn clamped_bar(cells: [usize; 3], keys: &str, strain: f64, end: f64) -> f64 {
    let material =
        "density = 8000\nyoungs_modulus = 2e11\npoissons_ratio = 0.3\nyield_stress = 2e8";
    let body = block(cells, dimension(cells), 1e-3, Store::Lattice, material);
    let cycle = HeatCycle {
        strain,
        ..HeatCycle::default()
    };
    let keys = format!(
        "{keys}\nstep = 0.5\nplasticity = {{}}\nsolver.quasi_static = {{ tolerance = 1e-9 }}"
    );
    let mechanical = read::<Mechanical>(&keys);
    let mut s = simulation(body, vec![Box::new(mechanical)], vec![Box::new(cycle)], end);
    run(&mut s);
    let stress = values(&s, "stress");
    stress.chunks_exact(9).map(|t| t[0]).sum::<f64>() / (stress.len() / 9) as f64
}

/// A bar between rigid walls is heated and cooled: it yields under compression, then under tension (closed form of the
/// elastic, perfectly plastic bar).
#[test]
fn a_clamped_bar_keeps_the_residual_stress_of_a_heat_cycle() {
    const YIELD: f64 = 200e6;
    for (cells, plane) in [
        ([12, 1, 1], ""),
        ([7, 5, 1], ""),
        ([7, 5, 1], PLANES[1]),
        ([6, 4, 4], ""),
    ] {
        // plane strain holds it across, too: equal stresses along both
        let held = if plane.is_empty() { 1.0 } else { 1.0 - 0.3 };
        let yield_strain = YIELD * held / 2e11;
        for formulation in &FORMULATIONS[1..] {
            let keys = format!("{formulation}\n{plane}");
            // ordinary solids of few rows have a stiffness of their own at surfaces and, in 3D, by the anisotropy of the
            // lattice: plastic flow must not add to the error of the elastic bar
            let elastic = clamped_bar(cells, &keys, 0.5 * yield_strain, 4.0) / (-0.5 * YIELD);
            let limit = (1.15 * (elastic - 1.0).abs() + 1e-5).min(0.05);
            // held strain of 1.5 and 2.6 yield strains
            for strain in [1.5e-3, 2.6e-3] {
                let residual = (strain / yield_strain - 1.0).clamp(0.0, 1.0);
                let expected = residual * YIELD;
                let found = clamped_bar(cells, &keys, strain, 8.0);
                let error = (found / expected - 1.0).abs();
                assert!(
                    error < limit,
                    "{cells:?} {keys} {strain}: {found} {expected}"
                );
            }
        }
    }
}

#[test]
fn the_tangent_of_a_flowing_body_is_the_derivative_of_its_forces() {
    let material = "density = 8000\nyoungs_modulus = 2e11\npoissons_ratio = 0.3\nyield_stress = 250e6\n\
        hardening_modulus = 5e9";
    for formulation in ["ordinary", "correspondence"] {
        // the last with transformation plasticity, 1/Pa
        for (cells, plane, transformation) in [
            ([12, 1, 1], "stress", 0.0),
            ([9, 8, 1], "stress", 0.0),
            ([9, 8, 1], "strain", 0.0),
            ([7, 6, 6], "stress", 0.0),
            ([12, 1, 1], "stress", 1e-12),
            ([9, 8, 1], "stress", 1e-12),
            ([7, 6, 6], "stress", 1e-12),
        ] {
            let body = block(cells, dimension(cells), 1e-3, Store::Lattice, material);
            let mut mechanical: Mechanical = read(&format!(
                "formulation = '{formulation}'\nplane = '{plane}'\nplasticity = {{}}"
            ));
            let mut world = World::new(vec![body]);
            let mut setup = Setup::new(&mut world, std::path::Path::new("."));
            setup.next_plugin("mechanical");
            perimelt_core::Physics::prepare(&mut mechanical, &mut setup).expect("valid");
            setup.finish().expect("complete");
            let run = mechanical.run.as_mut().expect("prepared");
            run.load_plasticity(&world, None);
            let plasticity = run.solid.plasticity().expect("it flows");
            if transformation > 0.0 {
                plasticity.set_transformation(
                    world.body(0).points.position.iter().map(|_| transformation),
                );
            }
            let positions = &world.body(0).points.position;
            let d = dimension(cells);
            // strains of some yield strains that differ from point to point
            let field = |size: f64, phase: f64| -> Vec<f64> {
                let value = |x: &nalgebra::Vector3<f64>, axis: usize| match axis < d {
                    true => {
                        size * ((axis as f64 + 1.0) * 300.0 * (x.x + 0.7 * x.y - 0.4 * x.z) + phase)
                            .sin()
                    }
                    false => 0.0,
                };
                let points = positions.iter();
                points
                    .flat_map(|x| [0, 1, 2].map(|axis| value(x, axis)))
                    .collect()
            };
            let (state, direction) = (field(1.5e-5, 0.3), field(1e-5, 1.1));
            let solid = &mut run.solid;
            let mut force = |step: f64| {
                let moved = state.iter().zip(&direction).map(|(u, v)| u + step * v);
                solid.set_displacement(&moved.collect::<Vec<_>>(), &[]);
                let mut out = vec![0.0; state.len()];
                solid.force(&mut out);
                out
            };
            let (up, down) = (force(1e-6), force(-1e-6));
            force(0.0);
            solid.linearise();
            solid.set_displacement(&direction, &[]);
            let (mut tangent, mut stiffness) = (vec![0.0; state.len()], vec![0.0; state.len()]);
            solid.tangent(&mut tangent);
            solid.set_displacement(&direction, &[]);
            solid.stiffness(&mut stiffness);
            let size = |of: &dyn Fn(usize) -> f64| {
                (0..state.len()).map(|i| of(i).powi(2)).sum::<f64>().sqrt()
            };
            let exact = |i: usize| (down[i] - up[i]) / 2e-6;
            let error = size(&|i| tangent[i] - exact(i)) / size(&exact);
            assert!(error < 1e-5, "{formulation} {cells:?} {plane}: {error}");
            // and it flows: the elastic stiffness is far off
            let elastic = size(&|i| stiffness[i] - exact(i)) / size(&exact);
            assert!(elastic > 0.2, "{formulation} {cells:?} {plane}: {elastic}");
        }
    }
}
