//! Families of moving points.

use nalgebra::Vector3;

use super::{Bond, BondKernel, Correction, Family, FamilySpec, Mirrored, SlotField};
use crate::body::{Body, Cut, Face, Jitter};
use crate::shape::{BoxShape, Shape};

struct Pull;

impl BondKernel<1, 3> for Pull {
    #[inline(always)]
    fn bond(&self, bond: &Bond, [own]: [f64; 1], [other]: [f64; 1]) -> [f64; 3] {
        bond.xi.map(|xi| bond.weight * xi * (other - own))
    }
}

#[test]
fn the_order_of_the_points_does_not_matter() {
    let shape = Shape::Box(BoxShape {
        min: [0.0; 3],
        max: [0.8, 0.6, 0.5],
    });
    let body = Body::fill("block", &shape, 3, 0.1, 0.5).expect("valid");
    let body = body.jittered(Jitter {
        amplitude: 0.3,
        seed: 5,
    });
    let mut body = body.expect("valid");
    let spec = FamilySpec {
        layers: vec![Face::XMin, Face::ZMax],
        correction: Correction::None,
        ..FamilySpec::new(0.25)
    };
    let sums = |body: &Body| {
        let mut family = Family::moving(body, &spec).expect("valid");
        // with the old rows, then with new ones
        let mut all = Vec::new();
        for (way, is_near) in [(0.01, true), (0.2, false)] {
            let moved = body.points.position.iter();
            let moved: Vec<_> = moved.map(|x| x + Vector3::x() * way * x.y).collect();
            if !is_near {
                family.rebuild_rows(&moved);
            }
            family.update_weights(&moved, &body.points.volume);
            let values: Vec<f64> = moved.iter().map(|x| (x.x * x.y).exp() + x.z).collect();
            let mut slots = SlotField::default();
            slots.load(&family, &values[..], Mirrored::Scalar);
            let mut sums = vec![[0.0; 3]; values.len()];
            family.sum(&Pull, [&slots], &mut sums);
            let bonds = (0..values.len()).map(|p| family.bonds_of(p) as f64);
            let slots = (0..values.len()).map(|p| slots[family.slot_of(p)]);
            let rest = bonds
                .zip(slots)
                .zip(&values)
                .map(|((b, s), v)| [b, s - v, 0.0]);
            all.push(sums.iter().copied().zip(rest).collect::<Vec<_>>());
        }
        all
    };
    let expected = sums(&body);
    let points = body.points.len();
    // 7 and the number of points have no common divisor
    let order: Vec<usize> = (0..points).map(|i| 7 * i % points).collect();
    let (position, volume) = (body.points.position.to_vec(), body.points.volume.clone());
    for (at, &from) in order.iter().enumerate() {
        body.points.position[at] = position[from];
        body.points.volume[at] = volume[from];
    }
    for (found, expected) in sums(&body).iter().zip(&expected) {
        for (found, from) in found.iter().zip(&order) {
            let (sum, rest) = expected[*from];
            assert_eq!(found.1, rest);
            assert_eq!(rest[1], 0.0, "a slot holds its point");
            assert!((0..3).all(|a| (found.0[a] - sum[a]).abs() < 1e-12));
        }
    }
}

#[test]
fn a_point_far_outside_of_its_box_is_no_panic() {
    let shape = Shape::Box(BoxShape {
        min: [0.0; 3],
        max: [0.8, 0.6, 0.1],
    });
    let mut body = Body::fill("block", &shape, 2, 0.1, 0.5).expect("valid");
    body.periodic = [true, false, false];
    let spec = FamilySpec {
        layers: vec![Face::YMin, Face::YMax],
        correction: Correction::None,
        ..FamilySpec::new(0.25)
    };
    let mut family = Family::moving(&body, &spec).expect("valid");
    let mut positions = body.points.position.to_vec();
    // only its second periodic copy lies near the box
    positions[0].x = 2.5 * 0.8;
    family.rebuild_rows(&positions);
    assert!(family.slots() > body.points.len());
}

#[test]
fn what_a_moving_family_does_not_support_is_refused() {
    let shape = Shape::Box(BoxShape {
        min: [0.0; 3],
        max: [0.8, 0.6, 0.1],
    });
    let body = Body::fill("block", &shape, 2, 0.1, 0.5).expect("valid");
    let plain = FamilySpec {
        correction: Correction::None,
        ..FamilySpec::new(0.25)
    };
    Family::moving(&body, &plain).expect("supported");
    let corrected = FamilySpec::new(0.25);
    let error = Family::moving(&body, &corrected).expect_err("corrected");
    assert!(error.to_string().contains("correction"), "{error}");
    let mut cut = body.clone();
    let line = Cut::segment([0.4, 0.0], [0.4, 0.6]).expect("it has a length");
    cut.cuts.push(line);
    let error = Family::moving(&cut, &plain).expect_err("cut");
    assert!(error.to_string().contains("crack"), "{error}");
}
