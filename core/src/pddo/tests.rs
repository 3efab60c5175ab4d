mod sums;

use super::*;
use crate::body::{Jitter, Store};
use crate::family::{Mirrored, SlotField};
use crate::shape::{BoxShape, Shape};
use crate::{Axis, Face, Operator};
use proptest::prelude::*;

fn block(cells: [usize; 3], spacing: f64) -> Body {
    let dimension = cells.iter().filter(|c| **c > 1).count();
    let max = cells.map(|c| if c > 1 { c as f64 * spacing } else { spacing });
    let shape = Shape::Box(BoxShape { min: [0.0; 3], max });
    Body::fill("block", &shape, dimension, spacing, 1.0).expect("a valid block")
}

fn operator(body: &Body, horizon: f64, order: usize, mirrored: bool) -> Pddo {
    let mut spec = Pddo::spec(Horizon::Spacings(horizon));
    if mirrored {
        spec.layers = Face::ALL.to_vec();
    }
    let family = Family::build(body, &spec).expect("it has neighbours");
    Pddo::build(body, Arc::new(family), order).expect("not degenerate")
}

fn derivatives(body: &Body, pddo: &Pddo, f: impl Fn(&Vector3<f64>) -> f64) -> Derivatives {
    let values: Vec<f64> = body.points.position.iter().map(f).collect();
    let mut slots = SlotField::default();
    slots.load(pddo.family(), &values[..], Mirrored::Scalar);
    let mut derivatives = Derivatives::default();
    pddo.differentiate(&slots, &mut derivatives);
    derivatives
}

/// docs/theory/fluids.md, "Numbers of the square lattice": horizon, partial volumes, S, largest wave number.
#[test]
fn the_square_lattice_has_its_constants() {
    for (horizon, partial, sum, wave) in [
        (3.0, PartialVolume::Half, 1.1178, 0.6333),
        (3.015, PartialVolume::Half, 1.1096, 0.6310),
        (3.015, PartialVolume::None, 1.0484, 0.6139),
        (3.6, PartialVolume::Half, 0.7739, 0.5291),
        (4.015, PartialVolume::Half, 0.6181, 0.4706),
    ] {
        let spacing = 0.1;
        let body = block([9, 9, 1], spacing);
        let mut spec = Pddo::spec(Horizon::Spacings(horizon));
        spec.partial_volume = partial;
        spec.layers = Face::ALL.to_vec();
        let family = Arc::new(Family::build(&body, &spec).expect("it has neighbours"));
        let pddo = Pddo::build(&body, family, 2).expect("not degenerate");
        // printed with four digits
        assert!((pddo.laplacian_sum(40) * spacing * spacing - sum).abs() < 5e-5);
        assert!((pddo.largest_wave_number(40) * spacing - wave).abs() < 2e-4);
    }
}

/// Gao (2020), Table 1: f = x^2 + 2 y^3 on 21 x 21 points with dx = 0.1, at (1, 1).
#[test]
fn the_published_derivatives_are_reproduced_and_converge_in_second_order() {
    let f = |x: &Vector3<f64>| x.x.powi(2) + 2.0 * x.y.powi(3);
    for (cells, spacing, error) in [(21, 0.1, 0.05362), (41, 0.05, 0.05362 / 4.0)] {
        let body = block([cells, cells, 1], spacing);
        let pddo = operator(&body, 3.015, 2, false);
        // cells are centred; the function is of the corner of the published grid
        let shift = Vector3::new(0.5, 0.5, 0.0) * spacing;
        let all = derivatives(&body, &pddo, |x| f(&(x - shift)));
        let centre = cells * cells / 2;
        let [fx, fy, fxx, fxy, fyy] = all.at(centre) else {
            panic!("five derivatives")
        };
        for (value, exact, tolerance) in [
            (fx, 2.0, 1e-10),
            (fy, 6.0 + error, 1e-5),
            (fxx, 2.0, 1e-10),
            (fxy, 0.0, 1e-10),
            (fyy, 12.0, 1e-10),
        ] {
            assert!((value - exact).abs() < tolerance, "{value} {exact}");
        }
    }
}

/// Points of a square grid from 0 to 2 with normally distributed displacements of a standard deviation in spacings; the
/// point in the middle stays.
fn irregular(points: usize, deviation: f64, seed: u64) -> Body {
    let spacing = 2.0 / (points - 1) as f64;
    let mut state = seed;
    let mut uniform = || {
        state = state
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        ((state >> 11) as f64 + 0.5) / (1u64 << 53) as f64
    };
    let mut table = "x,y,spacing\n".to_string();
    for j in 0..points {
        for i in 0..points {
            let size = deviation * spacing * (-2.0 * uniform().ln()).sqrt();
            let (sin, cos) = (std::f64::consts::TAU * uniform()).sin_cos();
            let is_middle = (i, j) == (points / 2, points / 2);
            let [x, y] = match is_middle {
                true => [1.0, 1.0],
                false => [
                    i as f64 * spacing + size * cos,
                    j as f64 * spacing + size * sin,
                ],
            };
            table += &format!("{x},{y},{spacing}\n");
        }
    }
    let shape = Shape::Box(BoxShape {
        min: [-1.0; 3],
        max: [3.0; 3],
    });
    Body::from_table("irregular", &shape, 2, 1.0, &table).expect("valid")
}

/// Gao (2020), Table 1, on irregular points: errors of about the published size.
#[test]
fn derivatives_on_irregular_points_are_as_near_as_published() {
    let f = |x: &Vector3<f64>| x.x.powi(2) + 2.0 * x.y.powi(3);
    for seed in 1..=5 {
        let body = irregular(21, 0.2, seed);
        let all = derivatives(&body, &operator(&body, 3.015, 2, false), f);
        let middle = Vector3::new(1.0, 1.0, body.points.position.at(0).z);
        let found = body
            .points
            .position
            .iter()
            .position(|x| (x - middle).norm() < 1e-12);
        let [fx, fy, fxx, fxy, fyy] = all.at(found.expect("it stays")) else {
            panic!("five derivatives")
        };
        for (value, [low, high]) in [
            ((fx / 2.0 - 1.0).abs(), [0.0, 5e-3]),
            (fy / 6.0 - 1.0, [5e-3, 1.3e-2]),
            ((fxx / 2.0 - 1.0).abs(), [0.0, 0.03]),
            ((fyy / 12.0 - 1.0).abs(), [0.0, 0.02]),
            (fxy.abs(), [0.0, 0.15]),
        ] {
            assert!(
                (low..=high).contains(&value),
                "seed {seed}: {value} not in {low} to {high}"
            );
        }
    }
}

/// Gao (2020), 2.2.2.2: values on a grid from irregular points; the published errors are upper bounds.
#[test]
fn interpolation_from_irregular_points_is_nearer_than_published_and_converges() {
    let f = |x: &Vector3<f64>| x.x.powi(2) + 2.0 * x.y.powi(3);
    let error = |points: usize| {
        let body = irregular(points, 0.1, 1);
        let pddo = operator(&body, 3.015, 2, false);
        let all = derivatives(&body, &pddo, f);
        let values: Vec<f64> = body.points.position.iter().map(f).collect();
        let spacing = 2.0 / (points - 1) as f64;
        let place = |k: usize| {
            let [x, y] = [k % points, k / points].map(|i| i as f64 * spacing);
            Vector3::new(x, y, body.points.position.at(0).z)
        };
        let places: Vec<Vector3<f64>> = (0..points * points).map(place).collect();
        let found = pddo.interpolate(&body, &values, &all, &places);
        let [error, size] = places
            .iter()
            .zip(found)
            .fold([0.0; 2], |[e, s], (x, value)| {
                let exact = f(x);
                let difference = value.expect("within a horizon") - exact;
                [e + difference * difference, s + exact * exact]
            });
        (error / size).sqrt()
    };
    let errors = [21, 41, 51].map(error);
    for (found, expected) in errors.into_iter().zip([2.2e-4, 2.4e-5, 1.2e-5]) {
        assert!(
            (found / expected - 1.0).abs() < 0.3,
            "{found:e} {expected:e}"
        );
    }
    let order = (errors[0] / errors[1]).log2();
    assert!(order >= 2.2, "{order}");
}

/// The constants of the closed form for a disc of radius 1 (Wang (2025), eqs. 3.37 to 3.39), from moments of the
/// influence.
#[test]
fn moments_of_the_gaussian_give_the_published_constants() {
    use std::f64::consts::PI;
    // Simpson's rule; the fourth derivative times the fourth power of the step is below 1e-10
    let moment = |power: i32| {
        let n = 2000;
        let at = |k: i32| {
            let r = f64::from(k) / f64::from(n);
            let weight = match k {
                0 => 1.0,
                k if k == n => 1.0,
                k if k % 2 == 1 => 4.0,
                _ => 2.0,
            };
            weight * crate::Influence::Gaussian.at(r) * r.powi(power + 1)
        };
        (0..=n).map(at).sum::<f64>() / (3.0 * f64::from(n))
    };
    // integrals of w x x, w x^4 and w x^2 y^2 over the disc
    let second = PI * moment(2);
    let (fourth, mixed) = (0.75 * PI * moment(4), 0.25 * PI * moment(4));
    // second derivatives: the inverse of ((fourth, mixed), (mixed, fourth)), twice
    let determinant = fourth * fourth - mixed * mixed;
    for (found, expected) in [
        (1.0 / second, 11.2127607413),
        (2.0 * fourth / determinant, 80.2149406773),
        (2.0 * mixed / determinant, 26.7383135591),
        (1.0 / mixed, 106.9532542365),
    ] {
        // the constants have eleven digits
        assert!(
            (found / expected - 1.0f64).abs() < 1e-9,
            "{found} {expected}"
        );
    }
}

/// The operator of a disc in closed form (Gao (2020), Appendix D): a fine lattice comes near.
#[test]
fn functions_of_a_fine_family_are_those_of_the_disc() {
    let body = block([41, 41, 1], 1.0);
    let pddo = operator(&body, 20.0, 2, false);
    let (delta, e4) = (20.0_f64, 4.0_f64.exp());
    let scale = |length: f64| {
        32.0 * (4.0 - (2.0 * length / delta).powi(2)).exp() / (std::f64::consts::PI * delta.powi(4))
    };
    let largest = scale(0.5 * delta) * 0.5 * delta / (e4 - 5.0);
    pddo.for_each_bond(41 * 41 / 2, |bond, _, g| {
        let ([x, y, _], c) = (bond.xi, scale(bond.length));
        // away from the edge, where volumes are partial
        if bond.length < delta - 1.0 {
            let first = c * x / (e4 - 5.0);
            assert!((g[0] - first).abs() < 0.01 * largest);
            let mixed = c * 8.0 * x * y / ((e4 - 13.0) * delta * delta);
            let trace = 4.0 * c * bond.length.powi(2) / ((e4 - 13.0) * delta * delta);
            // of the largest second derivative along an axis
            let bound = 0.01 * 6.0 * scale(0.5 * delta) / (4.0 * (e4 - 13.0));
            assert!((g[3] - mixed).abs() < bound && (g[2] + g[4] - trace).abs() < bound);
        }
    });
}

#[test]
fn a_family_in_a_line_is_refused_with_its_place() {
    let body = block([9, 9, 1], 1.0);
    let family =
        Family::build(&body, &Pddo::spec(Horizon::Spacings(1.0))).expect("it has neighbours");
    let error = Pddo::build(&body, Arc::new(family), 2).expect_err("no mixed derivative");
    assert_eq!(
        error.to_string(),
        "the 4 neighbours of the point at (1.5, 1.5, 0.5) m do not determine the derivatives of order 2 there: \
         choose a larger horizon"
    );
}

#[test]
fn stores_agree_and_layers_count() {
    let f = |x: &Vector3<f64>| (0.3 * x.x).sin() + x.y * x.y;
    let mut body = block([12, 10, 1], 1.0);
    let lattice = derivatives(&body, &operator(&body, 3.015, 2, true), f);
    body.store = Store::List;
    let list = derivatives(&body, &operator(&body, 3.015, 2, true), f);
    for point in 0..body.points.len() {
        for (a, b) in lattice.at(point).iter().zip(list.at(point)) {
            assert!((a - b).abs() < 1e-12);
        }
    }
    // even mirrors: no gradient in the mean of the two points at a wall
    let wall = [0, 1].map(|row| list.gradient(5 + 12 * row).y);
    assert!(wall[0].abs() < wall[1].abs());
    assert_eq!(lattice.second(40)[(0, 1)], lattice.second(40)[(1, 0)]);
    let sum: f64 = (0..2).map(|a| lattice.second(40)[(a, a)]).sum();
    assert!((sum - lattice.laplacian(40)).abs() < 1e-14);
}

#[test]
fn interpolation_from_displaced_points_is_exact_for_polynomials_of_the_order() {
    let body = block([15, 15, 1], 0.1)
        .jittered(Jitter {
            amplitude: 0.3,
            seed: 3,
        })
        .expect("a valid share");
    let pddo = operator(&body, 3.015, 2, false);
    let f = |x: &Vector3<f64>| 1.0 + x.x - 2.0 * x.x * x.y + 0.5 * x.y * x.y;
    let values: Vec<f64> = body.points.position.iter().map(f).collect();
    let all = derivatives(&body, &pddo, f);
    let places = [
        Vector3::new(0.71, 0.33, 0.0),
        Vector3::new(0.01, 0.02, 0.0),
        Vector3::new(9.0, 0.0, 0.0),
    ];
    let found = pddo.interpolate(&body, &values, &all, &places);
    for (place, value) in places.iter().zip(&found).take(2) {
        assert!((value.expect("inside") - f(place)).abs() < 1e-10);
    }
    assert_eq!(found[2], None);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// On clouds, for every dimension and order: derivatives of a random polynomial at its points.
    #[test]
    fn polynomials_of_the_order_are_differentiated_exactly(
        dimension in 1..=3usize,
        order in 1..=3usize,
        seed in 0..1000u64,
        coefficients in prop::collection::vec(-1.0..1.0f64, 19),
    ) {
        let horizon = order as f64 + 1.015;
        let cells = [[24, 1, 1], [11, 11, 1], [8, 8, 8]][dimension - 1];
        let body = block(cells, 1.0).jittered(Jitter { amplitude: 0.2, seed }).expect("a valid amplitude");
        let pddo = operator(&body, horizon, order, false);
        let powers = pddo.exponents().to_vec();
        let centre = Vector3::new(4.0, 4.0, 4.0);
        let value = |x: &Vector3<f64>, shift: &[u8; 3]| -> f64 {
            powers.iter().zip(&coefficients).map(|(e, c)| {
                let axis = |a: usize| {
                    let (e, n) = (i32::from(e[a]), i32::from(shift[a]));
                    let falling: f64 = (0..n).map(|i| f64::from(e - i)).product();
                    if e < n { 0.0 } else { falling * (x[a] - centre[a]).powi(e - n) }
                };
                c * (0..dimension).map(axis).product::<f64>()
            }).sum()
        };
        let all = derivatives(&body, &pddo, |x| value(x, &[0; 3]));
        for (point, x) in body.points.position.iter().enumerate() {
            for (n, found) in powers.iter().zip(all.at(point)) {
                let exact = value(x, n);
                // one-sided families of third order are worse conditioned
                let limit = if order < 3 { 1e-10 } else { 1e-8 };
                prop_assert!((found - exact).abs() < limit * (1.0 + exact.abs()), "{n:?} {found} {exact}");
            }
        }
    }
}

#[test]
fn a_periodic_body_sees_itself_behind_its_faces() {
    let tau = std::f64::consts::TAU;
    let f = |x: &Vector3<f64>| (tau * x.x / 16.0).sin() * (2.0 * tau * x.y / 12.0).cos();
    let mut body = block([16, 12, 1], 1.0);
    body.repeat(&[Axis::X, Axis::Y]).expect("it fills its box");
    let mut cloud = body
        .clone()
        .jittered(Jitter {
            amplitude: 0.0,
            seed: 1,
        })
        .expect("a valid share");
    cloud.repeat(&[Axis::X, Axis::Y]).expect("it fills its box");
    let pddo = operator(&body, 3.015, 2, false);
    assert_eq!(pddo.family().stencil_share(), 1.0);
    let lattice = derivatives(&body, &pddo, f);
    let displaced = derivatives(&cloud, &operator(&cloud, 3.015, 2, false), f);
    for (point, x) in body.points.position.iter().enumerate() {
        // half a period on, all derivatives have the other sign
        let far = (point + 8) % 16 + point / 16 * 16;
        let other = cloud
            .points
            .position
            .iter()
            .position(|y| (x - y).norm() < 1e-9)
            .expect("the same points in another order");
        for (n, value) in lattice.at(point).iter().enumerate() {
            assert!((value + lattice.at(far)[n]).abs() < 1e-12);
            assert!((value - displaced.at(other)[n]).abs() < 1e-12);
        }
    }
    assert!(body.surface(&Face::ALL).is_empty());
    body.dimension = 1;
    let error = body.repeat(&[Axis::Y]).expect_err("no such axis");
    assert!(error.to_string().contains("periodic along y"), "{error}");
}

#[test]
fn a_moving_family_is_that_of_points_which_lie_there() {
    let shape = Shape::Box(BoxShape {
        min: [0.0; 3],
        max: [12.0, 10.0, 1.0],
    });
    let mut body = Body::fill("block", &shape, 2, 1.0, 1.0).expect("a valid block");
    body.repeat(&[Axis::X]).expect("it fills its box");
    let mut spec = Pddo::spec(Horizon::Spacings(3.015));
    spec.layers = vec![Face::YMin, Face::YMax];
    let mut family = Arc::new(Family::moving(&body, &spec).expect("valid"));
    let mut moving = Pddo::build(&body, family.clone(), 2).expect("not degenerate");
    let volume = body.points.volume.to_vec();
    let mut follow = |moving: &mut Pddo, positions: &[Vector3<f64>], is_far: bool| {
        let place = || {
            let released = Arc::get_mut(&mut family).expect("released");
            if is_far {
                released.rebuild_rows(positions);
            }
            released.update_weights(positions, &volume);
            family.clone()
        };
        moving.rebuild(positions, place).expect("not degenerate");
    };
    let field = |x: &Vector3<f64>| (std::f64::consts::TAU * x.x / 12.0).sin() * x.y;
    let mut now = body.clone();
    for step in 1..=8 {
        // a shear that is small enough for the skin during three steps
        for (x, start) in now.points.position.iter_mut().zip(&body.points.position) {
            *x = start
                + Vector3::new(
                    0.06 * f64::from(step) * (0.7 * start.y).sin(),
                    0.02 * f64::from(step) * (0.9 * start.x).cos(),
                    0.0,
                );
        }
        follow(&mut moving, &now.points.position, step % 3 == 1);
        let family = Family::moving(&now, &spec).expect("valid");
        let fresh = Pddo::build(&now, Arc::new(family), 2).expect("not degenerate");
        let (a, b) = (
            derivatives(&now, &moving, field),
            derivatives(&now, &fresh, field),
        );
        for point in 0..body.points.len() {
            for (a, b) in a.at(point).iter().zip(b.at(point)) {
                // lanes of the sums differ with the members in the skin
                assert!((a - b).abs() < 1e-10 * (1.0 + b.abs()), "{step} {a} {b}");
            }
        }
    }
    // at rest it is the lattice
    follow(&mut moving, &body.points.position, true);
    let family = Arc::new(Family::build(&body, &spec).expect("valid"));
    let lattice = derivatives(
        &body,
        &Pddo::build(&body, family, 2).expect("not degenerate"),
        field,
    );
    let back = derivatives(&body, &moving, field);
    for point in 0..body.points.len() {
        for (a, b) in lattice.at(point).iter().zip(back.at(point)) {
            assert!((a - b).abs() < 1e-10 * (1.0 + b.abs()), "{a} {b}");
        }
    }
}

/// A derivative is what [`Operator`] computes with a kernel of one's own, too.
#[test]
fn the_sums_are_those_of_a_kernel_with_the_functions() {
    let body = block([10, 10, 1], 0.5);
    let mut spec = Pddo::spec(Horizon::Spacings(3.015));
    spec.layers = Face::ALL.to_vec();
    let family = Arc::new(Family::build(&body, &spec).expect("it has neighbours"));
    let pddo = Pddo::build(&body, family.clone(), 2).expect("not degenerate");
    let field: Vec<f64> = body
        .points
        .position
        .iter()
        .map(|x| x.x * x.y * x.y)
        .collect();
    let all = derivatives(&body, &pddo, |x| x.x * x.y * x.y);
    struct Difference;
    impl BondKernel<1, 1> for Difference {
        fn bond(&self, bond: &Bond, [own]: [f64; 1], [other]: [f64; 1]) -> [f64; 1] {
            [bond.weight * bond.xi[0] * (other - own)]
        }
    }
    let sums = Operator::new(family).sum(&Difference, [&field]).to_vec();
    let mut moment = 0.0;
    pddo.family()
        .for_each_bond(44, |_, bond, _| moment += bond.weight * bond.xi[0].powi(2));
    assert!((sums[44][0] / moment - all.gradient(44).x).abs() < 1e-12);
}

/// The Cholesky decomposition alone would succeed: the offsets from the line are far above rounding.
#[test]
fn points_almost_on_a_slanted_line_are_degenerate() {
    let mut table = "x,y,spacing\n".to_string();
    for i in 0..9 {
        let x = 0.1 * f64::from(i);
        let offset = if i % 3 == 0 { 1e-8 } else { 0.0 };
        table += &format!("{x},{},0.1\n", x + offset);
    }
    let shape = Shape::Box(BoxShape {
        min: [-1.0; 3],
        max: [2.0; 3],
    });
    let body = Body::from_table("line", &shape, 2, 1.0, &table).expect("valid");
    let family = Family::build(&body, &Pddo::spec(Horizon::Spacings(3.015))).expect("valid");
    let refused = Pddo::build(&body, Arc::new(family), 1);
    assert!(matches!(refused, Err(PddoError::Degenerate { .. })));
}
