//! Families of clouds against brute force, against lattices, and their conservation.

use nalgebra::Vector3;
use proptest::prelude::*;

use super::{
    AxisPlane, Bond, BondKernel, ByRules, CloudRows, Correction, Family, FamilyError, FamilySpec,
    Influence, LayerRule, Mirrored, PartialVolume, SlotField, Store,
};
use crate::body::{Body, Cut, Face, Horizon, Jitter, Zone};
use crate::shape::{BoxShape, Shape};

const RULES: [PartialVolume; 3] = [
    PartialVolume::None,
    PartialVolume::Half,
    PartialVolume::Full,
];

fn block(max: [f64; 3], dimension: usize, spacing: f64) -> Body {
    let shape = Shape::Box(BoxShape { min: [0.0; 3], max });
    Body::fill("block", &shape, dimension, spacing, 0.5).expect("valid")
}

/// A plate of bands across x: their right ends (m) and spacings (m).
fn bands(bands: &[(f64, f64)]) -> Body {
    let mut left = 0.0;
    let zone = |&(right, spacing): &(f64, f64)| {
        let min = [std::mem::replace(&mut left, right), 0.0, 0.0];
        Zone {
            min,
            max: [right, 1.2, 0.0],
            spacing,
            horizon_factor: 1.0,
        }
    };
    let zones: Vec<Zone> = bands.iter().map(zone).collect();
    let shape = Shape::Box(BoxShape {
        min: [0.0; 3],
        max: [left, 1.2, 0.1],
    });
    Body::fill_zones("plate", &shape, 2, 0.1, &zones).expect("valid zones")
}

fn jittered(body: Body, share: f64) -> Body {
    body.jittered(Jitter {
        amplitude: share,
        seed: 3,
    })
    .expect("valid")
}

/// Sums to compare, with every part of a bond in play.
struct All;

impl BondKernel<1, 4> for All {
    #[inline(always)]
    fn bond(&self, bond: &Bond, [own]: [f64; 1], [other]: [f64; 1]) -> [f64; 4] {
        [
            bond.weight * bond.length,
            bond.dual * bond.xi[0],
            bond.mean() * (other - own) * bond.xi[1],
            bond.weight * other * bond.xi[2],
        ]
    }
}

fn sums(body: &Body, family: &Family, rules: &[LayerRule]) -> Vec<[f64; 4]> {
    let value = |x: &Vector3<f64>| (3.0 * x.x).sin() + x.y * x.z + x.y;
    let values: Vec<f64> = body.points.position.iter().map(value).collect();
    let mut slots = SlotField::default();
    slots.load(family, &values[..], ByRules(rules, 0));
    let mut sums = vec![[0.0; 4]; values.len()];
    family.sum(&All, [&slots], &mut sums);
    sums
}

/// Sums of a cloud in the order of the points of a lattice that they coincide with.
fn in_order_of(lattice: &Body, cloud: &Body, sums: &[[f64; 4]]) -> Vec<[f64; 4]> {
    let positions = || cloud.points.position.iter();
    let nearest = |x: &Vector3<f64>| positions().position(|y| (x - y).norm() < 1e-9);
    let found = lattice.points.position.iter().map(nearest);
    found
        .map(|p| sums[p.expect("the points coincide")])
        .collect()
}

fn rows_of(family: &Family) -> &CloudRows {
    match &family.store {
        Store::Cloud(rows) => rows,
        _ => panic!("a cloud has rows"),
    }
}

#[test]
fn lists_equal_brute_force_and_ties_belong() {
    // horizons of 3 spacings reach points at 3 spacings exactly, on both sides
    for plate in [
        bands(&[(0.6, 0.05), (1.2, 0.1)]),
        bands(&[(0.6, 0.05), (1.2, 0.1), (2.4, 0.2)]),
    ] {
        for horizon in [Horizon::Spacings(3.0), Horizon::Length(0.6)] {
            let spec = FamilySpec {
                horizon,
                correction: Correction::None,
                partial_volume: PartialVolume::None,
                ..FamilySpec::new(1.0)
            };
            let family = Family::build(&plate, &spec).expect("valid");
            let (positions, spacing) = (&plate.points.position, &plate.points.spacing);
            let mut ties = 0;
            for p in 0..positions.len() {
                // whole numbers of quarter fine spacings: exact comparisons
                let apart = |q: usize| {
                    let steps = (positions[q] - positions[p]).map(|x| (x / 0.0125).round() as i64);
                    steps.dot(&steps)
                };
                let reach = |q: usize| (horizon.of(spacing[q]) / 0.0125).round() as i64;
                let holds = |owner: usize, q: &usize| *q != p && apart(*q) <= reach(owner).pow(2);
                let row = rows_of(&family).rows.start[p]..rows_of(&family).rows.start[p + 1];
                let columns = &rows_of(&family).rows.column[row.clone()];
                let listed = |weights: &[f64]| -> Vec<usize> {
                    let bonds = columns.iter().zip(&weights[row.clone()]);
                    let inside = bonds.filter(|(_, w)| **w > 0.0);
                    inside.map(|(q, _)| *q as usize).collect()
                };
                let all = 0..positions.len();
                let directed: Vec<usize> = all.clone().filter(|q| holds(p, q)).collect();
                let dual: Vec<usize> = all.filter(|q| holds(*q, q)).collect();
                ties += directed
                    .iter()
                    .filter(|q| apart(**q) == reach(p).pow(2))
                    .count();
                assert_eq!(listed(&rows_of(&family).rows.weight), directed);
                assert_eq!(listed(&rows_of(&family).rows.dual), dual);
            }
            assert!(ties > 100, "{ties}");
        }
    }
}

#[test]
fn a_uniform_cloud_has_the_sums_of_its_lattice() {
    let sizes = [
        ([1.0, 0.1, 0.1], 1),
        ([1.0, 0.8, 0.1], 2),
        ([0.8, 0.7, 0.6], 3),
    ];
    for (max, dimension) in sizes {
        for correction in [Correction::None, Correction::Point] {
            for rule in RULES {
                for layers in [vec![], vec![Face::XMin, Face::YMax], Face::ALL.to_vec()] {
                    let lattice = block(max, dimension, 0.1);
                    let cloud = jittered(lattice.clone(), 0.0);
                    let spec = FamilySpec {
                        correction,
                        partial_volume: rule,
                        layers,
                        ..FamilySpec::new(0.3)
                    };
                    let rule_of = |face: &Face| LayerRule {
                        values: None,
                        traction: None,
                        face: *face,
                        scale: [if face.is_upper() { -1.0 } else { 1.0 }; 3],
                        offset: [face.axis() as f64 + 0.5; 3],
                    };
                    let rules: Vec<LayerRule> = spec.layers.iter().map(rule_of).collect();
                    let family = Family::build(&lattice, &spec).expect("valid");
                    let expected = sums(&lattice, &family, &rules);
                    let family = Family::build(&cloud, &spec).expect("valid");
                    let found = sums(&cloud, &family, &rules);
                    let found = in_order_of(&lattice, &cloud, &found);
                    let largest = expected
                        .as_flattened()
                        .iter()
                        .fold(0.0, |m: f64, x| m.max(x.abs()));
                    for (a, b) in expected.as_flattened().iter().zip(found.as_flattened()) {
                        assert!(
                            (a - b).abs() <= 1e-12 * largest,
                            "{dimension}D {spec:?}: {a} {b}"
                        );
                    }
                }
            }
        }
    }
}

#[test]
fn the_lattice_correction_of_a_uniform_cloud_is_that_of_its_lattice_behind_mirrors() {
    let lattice = block([0.7, 0.6, 0.5], 3, 0.1);
    let cloud = jittered(lattice.clone(), 0.0);
    let spec = FamilySpec {
        correction: Correction::Lattice,
        ..FamilySpec::mirrored(&lattice, 2.0)
    };
    let [expected, found] = [&lattice, &cloud].map(|body| {
        let family = Family::build(body, &spec).expect("valid");
        sums(body, &family, &[])
    });
    let found = in_order_of(&lattice, &cloud, &found);
    for (a, b) in expected.as_flattened().iter().zip(found.as_flattened()) {
        assert!((a - b).abs() < 1e-11, "{a} {b}");
    }
}

#[test]
fn weights_of_corrected_families_sum_to_the_dimension() {
    let clouds = [
        jittered(block([2.0, 0.1, 0.1], 1, 0.1), 0.3),
        jittered(block([0.8, 0.7, 0.6], 3, 0.1), 0.3),
        bands(&[(0.6, 0.05), (1.2, 0.1)]),
        jittered(bands(&[(0.6, 0.05), (1.2, 0.2)]), 0.2),
    ];
    for body in clouds {
        for correction in [Correction::Lattice, Correction::Point] {
            for horizon in [Horizon::Spacings(3.015), Horizon::Length(0.35)] {
                for layers in [vec![], Face::ALL.to_vec()] {
                    let spec = FamilySpec {
                        horizon,
                        correction,
                        layers,
                        ..FamilySpec::new(1.0)
                    };
                    let family = Family::build(&body, &spec).expect("valid");
                    for [sum, ..] in sums(&body, &family, &[]) {
                        // rounding of sums of a few hundred terms, and of inverses
                        assert!((sum - body.dimension as f64).abs() < 1e-11, "{sum}");
                    }
                }
            }
        }
    }
}

/// A force along the bond that depends on both ends evenly.
struct Pair;

impl BondKernel<4, 3> for Pair {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; 4], other: [f64; 4]) -> [f64; 3] {
        let y: [f64; 3] = std::array::from_fn(|a| bond.xi[a] + other[a] - own[a]);
        let length = (y[0] * y[0] + y[1] * y[1] + y[2] * y[2]).sqrt();
        y.map(|y| bond.mean() * (own[3] + other[3]) * y / length)
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn momentum_of_pair_forces_is_conserved_on_random_clouds(
        points in prop::collection::vec((prop::array::uniform3(0.0..1.0f64), 0.02..0.12f64), 60..200),
        horizon in 3.0..7.0f64,
        rule in 0..3usize,
        corrected in 0..3usize,
        dimension in 2..4usize,
        cracked in any::<bool>(),
    ) {
        let mut table = "x,y,z,spacing\n".to_string();
        for ([x, y, z], spacing) in &points {
            table += &format!("{x},{y},{z},{spacing}\n");
        }
        let shape = Shape::Box(BoxShape { min: [0.0; 3], max: [1.0; 3] });
        let mut body = Body::from_table("cloud", &shape, dimension, 0.5, &table).expect("valid");
        if cracked {
            body.cuts = Cut::segment([0.3, 0.4], [0.6, 0.5]).into_iter().collect();
        }
        let spec = FamilySpec {
            horizon: Horizon::Spacings(horizon),
            partial_volume: RULES[rule],
            correction: [Correction::None, Correction::Lattice, Correction::Point][corrected],
            ..FamilySpec::new(1.0)
        };
        // some clouds leave a point without a neighbour, which is refused
        let family = match Family::build(&body, &spec) {
            Ok(family) => family,
            Err(FamilyError::NoNeighbours { .. }) => return Ok(()),
            Err(e) => panic!("{e}"),
        };
        let wave = |k: usize| body.points.position.iter().map(move |x| (x.dot(&Vector3::new(5.0, 7.0 + k as f64, 3.0))).sin() * 0.01);
        let fields: [SlotField; 4] = std::array::from_fn(|k| {
            let mut slots = SlotField::default();
            slots.load(&family, &wave(k).collect::<Vec<_>>()[..], Mirrored::Scalar);
            slots
        });
        let mut force = vec![[0.0; 3]; body.points.len()];
        family.sum(&Pair, fields.each_ref().map(|f| &f[..]), &mut force);
        let of = |(f, v): (&[f64; 3], &f64)| Vector3::from(*f) * *v;
        let total: Vector3<f64> = force.iter().zip(&body.points.volume).map(of).sum();
        let size: f64 = force.iter().zip(&body.points.volume).map(|p| of(p).norm()).sum();
        prop_assert!(total.norm() <= 1e-13 * size, "{} of {}", total.norm(), size);
    }
}

#[test]
fn what_flows_through_an_audited_layer_is_what_the_body_lacks() {
    // pairs inside cancel: what is left of the sum over the body came through the layers
    struct Flow;
    impl BondKernel<1, 1> for Flow {
        #[inline(always)]
        fn bond(&self, bond: &Bond, [own]: [f64; 1], [other]: [f64; 1]) -> [f64; 1] {
            [bond.mean() / bond.length * (other - own)]
        }
    }
    let body = jittered(bands(&[(0.6, 0.05), (1.2, 0.1)]), 0.1);
    let spec = FamilySpec {
        audited: vec![Face::XMin],
        ..FamilySpec::mirrored(&body, 3.0)
    };
    let family = Family::build(&body, &spec).expect("valid");
    let values: Vec<f64> = body
        .points
        .position
        .iter()
        .map(|x| 1.0 + x.x + x.y)
        .collect();
    let cold = LayerRule {
        values: None,
        traction: None,
        face: Face::XMin,
        scale: [-1.0; 3],
        offset: [0.0; 3],
    };
    let mut slots = SlotField::default();
    slots.load(&family, &values[..], ByRules(&[cold], 0));
    let mut flow = vec![[0.0]; values.len()];
    family.sum(&Flow, [&slots], &mut flow);
    let volume = &body.points.volume;
    let total: f64 = flow.iter().zip(volume).map(|([f], v)| f * v).sum();
    let mut through = 0.0;
    family.sum_from_layers(&Flow, [&slots], |p, [f]| through += f * volume[p]);
    assert!(through < -1e-3);
    assert!(
        (total - through).abs() < 1e-13 * through.abs() * 100.0,
        "{total} {through}"
    );
}

#[test]
fn threads_do_not_matter_and_nothing_passes_a_cut() {
    let mut body = jittered(block([2.0, 2.0, 1.0], 3, 0.1), 0.3);
    body.cuts = vec![Cut::segment([-1.0, 1.0], [3.0, 1.0]).expect("length")];
    let spec = FamilySpec {
        layers: vec![Face::XMin, Face::XMax],
        ..FamilySpec::new(0.25)
    };
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.expect("threads").install(|| {
            let family = Family::build(&body, &spec).expect("valid");
            let side = |slot: &u32| rows_of(&family).places.at[1][*slot as usize] > 1.0;
            for (row, &p) in rows_of(&family).rows.point.iter().enumerate() {
                let columns = &rows_of(&family).rows.column
                    [rows_of(&family).rows.start[row]..rows_of(&family).rows.start[row + 1]];
                assert!(columns.iter().all(|c| side(c) == side(&p)));
            }
            sums(&body, &family, &[])
        })
    };
    assert_eq!(on(1), on(2), "bit by bit");
}

#[test]
fn horizons_that_reach_nobody_and_points_in_one_place_are_refused() {
    let body = jittered(block([1.0, 1.0, 0.1], 2, 0.1), 0.2);
    let error = Family::build(&body, &FamilySpec::new(0.01)).expect_err("too short");
    assert!(
        error
            .to_string()
            .contains("has no neighbour within the horizon 0.01 m")
    );
    let shape = Shape::Box(BoxShape {
        min: [0.0; 3],
        max: [1.0; 3],
    });
    let table = "x,y,spacing\n0.5,0.5,0.1\n0.5,0.5,0.1";
    let twins = Body::from_table("twins", &shape, 2, 0.1, table).expect("valid");
    let error = Family::build(&twins, &FamilySpec::new(0.3)).expect_err("one place");
    assert!(
        error
            .to_string()
            .contains("two points lie at (0.5, 0.5, 0.5) m")
    );
}

#[test]
fn the_gaussian_is_exact_to_rounding() {
    for n in 0..=1000 {
        let share = f64::from(n) / 1000.0;
        let exact = (-4.0 * share * share).exp();
        let error = (Influence::Gaussian.at(share) / exact - 1.0).abs();
        // the sixteenth power of a sum that is exact to a unit or two
        assert!(error < 32.0 * f64::EPSILON, "{share}: {error}");
    }
}

/// Counts bonds.
struct Count;

impl BondKernel<0, 1> for Count {
    fn bond(&self, _: &Bond, _: [f64; 0], _: [f64; 0]) -> [f64; 1] {
        [1.0]
    }
}

#[test]
fn points_on_a_plane_count_as_below_it() {
    // points at 0.5, 1.5, ... m
    let body = block([8.0, 1.0, 1.0], 1, 1.0);
    let family = Family::build(&body, &FamilySpec::new(2.0)).expect("valid");
    let mut across = Vec::new();
    let receive = |point: usize, [bonds]: [f64; 1]| across.push((point, bonds));
    let plane = AxisPlane { axis: 0, at: 3.5 };
    family.sum_across(&Count, [], None, plane, receive);
    assert_eq!(across, [(0, 0.0), (1, 0.0), (2, 1.0), (3, 2.0)]);
}
