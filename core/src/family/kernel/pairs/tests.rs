use super::*;
use crate::body::{Body, Face, Store};
use crate::family::kernel::{Bond, BondKernel};
use crate::family::{BrokenBonds, Correction, FamilySpec, Mirrored, SlotField};
use crate::shape::{BoxShape, Shape};

/// Something that pulls ends together, of finite length, and a sum for one end only.
struct Pull;

impl BondKernel<3, 4> for Pull {
    const PAIRED: usize = 3;

    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; 3], other: [f64; 3]) -> [f64; 4] {
        let y: [f64; 3] = std::array::from_fn(|a| bond.xi[a] + other[a] - own[a]);
        let length = (y[0] * y[0] + y[1] * y[1] + y[2] * y[2]).sqrt();
        let pull = bond.mean() * (1.0 / bond.length - 1.0 / length);
        [pull * y[0], pull * y[1], pull * y[2], bond.length]
    }
}

/// Each end gets its own weight.
struct Weigh;

impl BondKernel<0, 1> for Weigh {
    const PAIRED: usize = 1;

    #[inline(always)]
    fn bond(&self, bond: &Bond, _: [f64; 0], _: [f64; 0]) -> [f64; 1] {
        [bond.weight]
    }

    #[inline(always)]
    fn ends(&self, bond: &Bond, _: [f64; 0], _: [f64; 0]) -> [[f64; 1]; 2] {
        [[bond.weight], [bond.dual]]
    }
}

fn families(dimension: usize, layers: &[Face]) -> [Family; 2] {
    let max = [19.0, 23.0, if dimension == 3 { 17.0 } else { 1.0 }];
    let min = [0.0; 3];
    let shape = Shape::Box(BoxShape { min, max });
    let mut body = Body::fill("block", &shape, dimension, 1.0, 1.0).expect("valid");
    let spec = FamilySpec {
        correction: Correction::Point,
        layers: layers.to_vec(),
        ..FamilySpec::new(3.0)
    };
    [Store::Lattice, Store::List].map(|store| {
        body.store = store;
        Family::build(&body, &spec).expect("valid")
    })
}

/// Displacements that differ from slot to slot of points, and go on behind the faces.
fn displacement(family: &Family) -> [SlotField; 3] {
    std::array::from_fn(|axis| {
        let value = |point: usize| 0.05 * ((point * (axis + 3)) as f64).sin();
        let mut slots = SlotField::default();
        slots.load(family, value, Mirrored::Scalar);
        slots
    })
}

fn forces(family: &Family, broken: Option<&BrokenBonds>) -> Vec<[f64; 4]> {
    let slots = displacement(family);
    let mut sums = vec![[0.0; 4]; family.points];
    let inputs = slots.each_ref().map(|s| &s[..]);
    family.sum_unbroken(&Pull, inputs, broken, &mut sums);
    sums
}

#[test]
fn ends_get_what_each_gets_from_its_own_bonds() {
    for dimension in [2, 3] {
        for layers in [&[][..], &[Face::XMin, Face::YMax], &Face::ALL[..4]] {
            let [lattice, list] = families(dimension, layers);
            assert!(Pairs::new(&lattice).is_some() && Pairs::new(&list).is_none());
            let mut broken = [lattice.unbroken(), list.unbroken()];
            for crack in [false, true] {
                if crack {
                    for (family, broken) in [&lattice, &list].into_iter().zip(&mut broken) {
                        let point_in = family.points_of_slots();
                        for point in (40..200).step_by(7) {
                            for other in [point + 1, point + 2, point + 19, point + 37] {
                                family.break_pair([point, other], &point_in, broken);
                            }
                        }
                    }
                }
                let [ours, rows] = [(&lattice, &broken[0]), (&list, &broken[1])]
                    .map(|(family, broken)| forces(family, Some(broken)));
                for (point, (a, b)) in ours.iter().zip(&rows).enumerate() {
                    for axis in 0..3 {
                        assert!((a[axis] - b[axis]).abs() < 1e-14, "{point}: {a:?} {b:?}");
                    }
                }
                if layers.is_empty() {
                    let total =
                        |sums: &[[f64; 4]], o: usize| sums.iter().map(|s| s[o]).sum::<f64>();
                    (0..3).for_each(|axis| assert!(total(&ours, axis).abs() < 1e-12));
                    let lengths = [total(&ours, 3), total(&rows, 3) / 2.0];
                    assert!((lengths[0] / lengths[1] - 1.0).abs() < 1e-12, "{lengths:?}");
                }
            }
            let weights = [&lattice, &list].map(|family| {
                let mut sums = vec![[0.0]; family.points];
                family.sum(&Weigh, [], &mut sums);
                sums
            });
            let differ = weights[0].iter().zip(&weights[1]);
            assert!(differ.clone().all(|([a], [b])| (a - b).abs() < 1e-14));
        }
    }
}

#[test]
fn boxes_of_one_colour_keep_apart_in_bodies_of_all_sizes() {
    for dimension in [2, 3] {
        for horizon in [1.0, 2.0, 3.0, 4.0] {
            for rows in (1..75).step_by(if dimension == 2 { 1 } else { 3 }) {
                let max = [
                    9.0,
                    f64::from(rows),
                    if dimension == 3 { 13.0 } else { 1.0 },
                ];
                let min = [0.0; 3];
                let shape = Shape::Box(BoxShape { min, max });
                let body = Body::fill("block", &shape, dimension, 1.0, 1.0).expect("valid");
                let spec = FamilySpec {
                    correction: Correction::Lattice,
                    ..FamilySpec::new(horizon)
                };
                let family = Family::build(&body, &spec).expect("valid");
                // `Pairs::new` checks it
                assert!(Pairs::new(&family).is_some());
            }
        }
    }
}

#[test]
fn sums_do_not_depend_on_the_number_of_threads() {
    let [family, _] = families(3, &[Face::ZMin]);
    let sums = [1, 2, 5].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.expect("threads").install(|| forces(&family, None))
    });
    assert!(sums[0] == sums[1] && sums[0] == sums[2]);
}

#[test]
fn bonds_do_not_reach_beyond_the_next_box() {
    for cells in [[20, 50, 1], [20, 50, 30], [9, 13, 40], [9, 7, 7]] {
        let stride = |axis: usize| cells[..axis].iter().product::<usize>();
        let axis = if cells[2] == 1 { 1 } else { 2 };
        for reach in 1..4 {
            // the last bond of a horizon is that along the last axis, or one with ends that do not lie above each other
            for offset in [reach * stride(axis), reach * stride(axis) + 2] {
                let boxes = RowBoxes::new(cells, [[0; 3], cells], offset);
                assert_eq!(boxes.reach, reach, "{cells:?}, {offset}");
                assert!(boxes.across == 1 || boxes.across.is_multiple_of(2));
                for slot in 0..stride(axis) * (cells[axis] - reach) {
                    let [here, there] =
                        [slot, slot + reach * stride(axis)].map(|s| boxes.place_of(s));
                    let along = axis - 1;
                    assert!(there[along] - here[along] <= 1, "{here:?}, {there:?}");
                }
            }
        }
    }
}
