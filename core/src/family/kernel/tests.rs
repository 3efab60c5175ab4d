//! Sweeps of bodies so small that Miri can run them: every path through the code that is `unsafe`.

use crate::body::{Body, Face, Jitter, Store};
use crate::family::{Bond, BondKernel, BrokenBonds, Family, FamilySpec, Mirrored, SlotField};
use crate::instructions::{InstructionSet, limited};
use crate::shape::{BoxShape, Shape};

/// Each end by itself.
struct Flow;

impl BondKernel<1, 1> for Flow {
    #[inline(always)]
    fn bond(&self, bond: &Bond, [own]: [f64; 1], [other]: [f64; 1]) -> [f64; 1] {
        [bond.mean() * (other - own)]
    }
}

/// Both ends of a bond in one visit.
struct Pull;

impl BondKernel<1, 1> for Pull {
    const PAIRED: usize = 1;

    #[inline(always)]
    fn bond(&self, bond: &Bond, ends: [f64; 1], others: [f64; 1]) -> [f64; 1] {
        Flow.bond(bond, ends, others)
    }
}

/// Hardly wider than a horizon.
fn block(dimension: usize, length: f64) -> Body {
    let max = [length, 2.0, if dimension == 3 { 2.0 } else { 1.0 }];
    let shape = Shape::Box(BoxShape { min: [0.0; 3], max });
    Body::fill("block", &shape, dimension, 1.0, 1.0).expect("valid")
}

fn check<K: BondKernel<1, 1>>(kernel: &K, family: &Family, broken: Option<&BrokenBonds>) {
    let mut slots = SlotField::default();
    slots.load(family, |p: usize| (p as f64).sin(), Mirrored::Scalar);
    let sweep = || {
        let mut sums = vec![[0.0]; family.points];
        family.sum_unbroken(kernel, [&slots], broken, &mut sums);
        sums
    };
    let sums = sweep();
    if !cfg!(miri) {
        let [plain, avx2, avx512] = InstructionSet::ALL.map(|set| limited::to(set, sweep));
        assert_eq!(avx2, avx512);
        assert!(K::PAIRED > 0 || plain == avx2);
    }
    for (point, [swept]) in sums.iter().enumerate() {
        let own = slots[family.slot_of(point)];
        let mut expected = 0.0;
        family.for_each_bond(point, |number, bond, other| {
            if broken.is_none_or(|b| !b.is_broken(point, number)) {
                let part = kernel.bond(bond, [own], [slots[other]]);
                expected += part[0];
            }
        });
        assert!(
            (swept - expected).abs() < 1e-13,
            "{point}: {swept} {expected}"
        );
    }
}

#[test]
fn sweeps_of_tiny_bodies_are_the_sums_of_their_bonds() {
    let jitter = Jitter {
        amplitude: 0.2,
        seed: 3,
    };
    let layers = &[Face::YMin, Face::YMax][..];
    // rows of fewer points than the lanes of a vector, and of more
    let bodies = [
        (2, 17.0, layers),
        (2, 5.0, layers),
        (2, 7.0, layers),
        (2, 36.0, layers),
        (3, 17.0, &[]),
    ];
    // Miri takes a minute for the first
    for (dimension, length, layers) in &bodies[..if cfg!(miri) { 1 } else { 5 }] {
        let lattice = block(*dimension, *length);
        let mut list = block(*dimension, *length);
        list.store = Store::List;
        let cloud = block(*dimension, *length);
        let mut cloud = cloud.jittered(jitter).expect("valid");
        // points of a plane body have no distance along z
        if *dimension == 2 {
            let points = cloud.points.position.iter_mut().zip(1..);
            points.for_each(|(x, number)| x.z += 0.1 * f64::from(number).sin());
        }
        for body in [lattice, list, cloud] {
            let spec = FamilySpec {
                layers: layers.to_vec(),
                ..FamilySpec::new(1.5)
            };
            let family = Family::build(&body, &spec).expect("valid");
            let mut broken = family.unbroken();
            let point_in = family.points_of_slots();
            let points = [3, 11, 25].into_iter();
            for point in points.filter(|p| p + 1 < family.points as u32) {
                family.break_pair([point, point + 1], &point_in, &mut broken);
            }
            for broken in [None, Some(&broken)] {
                check(&Flow, &family, broken);
                check(&Pull, &family, broken);
            }
        }
    }
}
