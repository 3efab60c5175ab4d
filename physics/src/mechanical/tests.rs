mod flow;
mod motion;

use crate::mechanical::solid::{EnergyKind, StressKind, Wanted};
use perimelt_core::body::Store;
use perimelt_core::simulation::Simulation;
use perimelt_core::{
    Coupler, Family, FamilySpec, RunError, RunningCoupler, Setup, SetupError, Step, World, Write,
    keys,
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
    fn prepare(
        mut self: Box<Self>,
        setup: &mut Setup<'_>,
    ) -> Result<Box<dyn RunningCoupler>, SetupError> {
        self.eigenstrain = Some(setup.add(0, &keys::EIGENSTRAIN)?);
        Ok(self)
    }
}

impl RunningCoupler for Swelling {
    fn apply(&mut self, world: &World, _: Step) -> Result<(), RunError> {
        let field = self.eigenstrain.expect("prepared");
        world
            .write(field)
            .iter_mut()
            .for_each(|e| *e += self.strain);
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
    let mechanical: Mechanical = read(keys);
    let mut world = World::new(vec![body]);
    let mut setup = Setup::new(&mut world, std::path::Path::new("."));
    setup.next_plugin("mechanical");
    let mut mechanical = mechanical.ready(&mut setup).expect("valid");
    let solid = &mut mechanical.run.solid;
    let nodes = solid.base().nodes.clone();
    let u: Vec<f64> = nodes
        .positions(world.body(0))
        .iter()
        .flat_map(|x| displacement((*x).into()))
        .collect();
    solid.set_displacement(&u, &[]);
    let mut force = vec![0.0; u.len()];
    solid.evaluate(Wanted::force(&mut force));
    let half = cells.map(|c| c / 2);
    Evaluated {
        force,
        energy: solid
            .evaluate(Wanted::energy(EnergyKind::Total))
            .energy
            .to_vec(),
        stress: solid
            .evaluate(Wanted::stress(StressKind::Spatial))
            .stress
            .to_vec(),
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

/// Residual anisotropy of a complete family at 3.015 spacings (`docs/theory/thermomechanics.md`: moments with partial
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

/// Accepted: 1 % in 2D, 6 % in 3D at 3.015 spacings.
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

/// Heat of deformation is proportional to the conjugate stress, which pure shear does not have.
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

/// Gao (2020), 3.5.2: `beta^2 T / (rho c (lambda + 2 mu))` of carbon steel under plane stress (Gao (2020), eq. 3.21).
#[test]
fn the_coupling_coefficient_of_the_steel_plate_is_the_published_one() {
    let moduli = Moduli::new(200e9, 0.17, 2, Plane::Stress);
    let thermal_modulus = 2.0 * moduli.bulk * 11.5e-6;
    let stiffness = moduli.lame + 2.0 * moduli.shear;
    let coupling = thermal_modulus.powi(2) * 285.0 / (7870.0 * 472.0 * stiffness);
    assert!((coupling - 0.0028606).abs() < 5e-8, "{coupling}");
}

/// `wang-4.0.1`: family sizes, volume and energies of uncorrected lattices (cases/references/lattice_elasticity.py).
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
            "formulation = \"staggered\"",
            "formulation = \"staggered\"\nsolver.relaxation = { relative_tolerance = 1e-8 }",
            "formulation = \"staggered\"\nkinematics = \"finite\"",
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
