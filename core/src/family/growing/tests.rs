use super::*;
use crate::body::{Body, Face};
use crate::family::{Bond, BondKernel, ByRules, Correction, LayerRule, SlotField};
use crate::shape::{BoxShape, Shape};

struct Flow;
impl BondKernel<1, 1> for Flow {
    #[inline(always)]
    fn bond(&self, bond: &Bond, [own]: [f64; 1], [other]: [f64; 1]) -> [f64; 1] {
        [2.0 * bond.mean() * bond.inverse_length * (other - own)]
    }
}

fn block(cells: [f64; 3], dimension: usize) -> Body {
    let (min, max) = ([0.0; 3], cells);
    let shape = Shape::Box(BoxShape { min, max });
    Body::fill("block", &shape, dimension, 1.0, 1.0).expect("valid")
}

fn spec(layers: &[Face]) -> FamilySpec {
    FamilySpec {
        layers: layers.to_vec(),
        audited: layers[..1].to_vec(),
        ..FamilySpec::new(3.0)
    }
}

/// A field without any symmetry, by the position of a point.
fn value(x: &nalgebra::Vector3<f64>) -> f64 {
    (1.7 * x.x).sin() + 0.3 * x.y * x.z + 0.1 * x.z * x.z
}

/// Sums of all bonds and of those with audited layers, of a field that is `-1` times its mirror image there.
fn sums(family: &Family, values: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let mut slots = SlotField::zeros(family);
    slots.fill(f64::NAN);
    let odd = |&face: &Face| LayerRule {
        scale: [-1.0; 3],
        ..LayerRule::even(face)
    };
    let rules: Vec<LayerRule> = family.spec().audited.iter().map(odd).collect();
    slots.load(family, values, ByRules(&rules, 0));
    let mut sums = vec![[f64::NAN]; values.len()];
    family.sum(&Flow, [&slots], &mut sums);
    let mut layers = vec![0.0; values.len()];
    family.sum_from_layers(&Flow, [&slots], |point, [sum]| layers[point] = sum);
    (sums.into_iter().map(|[s]| s).collect(), layers)
}

fn field(body: &Body) -> Vec<f64> {
    body.points.position.iter().map(value).collect()
}

/// A permutation by a linear congruential generator.
fn shuffled(points: usize, seed: u64) -> Vec<usize> {
    let mut order: Vec<usize> = (0..points).collect();
    let mut state = seed;
    for i in (1..points).rev() {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        order.swap(i, (state >> 33) as usize % (i + 1));
    }
    order
}

#[test]
fn in_any_order_heat_is_conserved_uniform_stays_uniform_and_the_end_is_the_body_itself() {
    for (dimension, seed) in [(1, 1), (2, 2), (3, 3), (3, 4)] {
        let body = block([19.0, 7.0, 6.0], dimension);
        let points = body.points.len();
        let spec = match seed {
            3 => FamilySpec::new(3.0),
            _ => spec(&[Face::XMin, Face::XMax]),
        };
        let values = field(&body);
        let uniform = vec![300.0; points];
        let mut active = vec![false; points];
        let mut family = Family::growing(Share::whole(&body), &spec, &active, 0).expect("valid");
        let order = shuffled(points, seed);
        for some in order.chunks(points / 13 + 1) {
            some.iter().for_each(|&p| active[p] = true);
            family.set_active(&active);
            // the same bits as a family that starts with these points, as after a restart
            let fresh = Family::growing(Share::whole(&body), &spec, &active, 0).expect("valid");
            let (now, layers) = sums(&family, &values);
            assert_eq!((now.clone(), layers.clone()), sums(&fresh, &values));
            let inner: f64 = now.iter().sum::<f64>() - layers.iter().sum::<f64>();
            let size: f64 = now.iter().map(|s| s.abs()).sum();
            assert!(inner.abs() <= 1e-14 * size, "{inner} of {size}");
            let (level, held) = sums(&family, &uniform);
            assert!(level.iter().zip(&held).all(|(s, h)| (s - h).abs() < 1e-10));
            let unborn = now.iter().zip(&active).filter(|(_, a)| !**a);
            assert!(unborn.clone().all(|(s, _)| *s == 0.0));
        }
        let whole = Family::build(&body, &spec).expect("valid");
        assert_eq!(sums(&family, &values), sums(&whole, &values));
        // and back again
        for point in &order[..points / 2] {
            active[*point] = false;
        }
        family.set_active(&active);
        let fresh = Family::growing(Share::whole(&body), &spec, &active, 0).expect("valid");
        assert_eq!(sums(&family, &values), sums(&fresh, &values));
    }
}

#[test]
fn a_body_that_ends_where_material_ends_is_the_smaller_body() {
    let layers = [Face::XMin, Face::XMax, Face::YMin, Face::YMax, Face::ZMin];
    for correction in [Correction::Point, Correction::Lattice, Correction::None] {
        let spec = FamilySpec {
            correction,
            ..spec(&layers)
        };
        let (large, small) = (block([9.0, 7.0, 8.0], 3), block([9.0, 7.0, 5.0], 3));
        let active: Vec<bool> = large.points.position.iter().map(|x| x.z < 5.0).collect();
        let grown = Family::growing(Share::whole(&large), &spec, &active, 0).expect("valid");
        let (grown, _) = sums(&grown, &field(&large));
        let family = Family::build(&small, &spec).expect("valid");
        let (alone, _) = sums(&family, &field(&small));
        // points are numbered layer by layer
        assert_eq!(grown[..alone.len()], alone);
        assert!(grown[alone.len()..].iter().all(|s| *s == 0.0));
    }
}

#[test]
fn only_bonds_near_the_front_are_found_again() {
    let body = block([60.0, 9.0, 1.0], 2);
    let mut active: Vec<bool> = body.points.position.iter().map(|x| x.x < 30.0).collect();
    let mut family =
        Family::growing(Share::whole(&body), &spec(&[Face::YMin]), &active, 0).expect("valid");
    let version = family.version();
    let point = body.points.position.iter().position(|x| x.x > 30.0);
    active[point.expect("there is one")] = true;
    family.set_active(&active);
    assert_eq!(family.version(), version + 1);
    let far = |p: &&u32| (body.points.position.at(**p as usize).x - 30.0).abs() > 7.0;
    assert!(family.recalibrated().len() > 10);
    assert_eq!(family.recalibrated().iter().filter(far).count(), 0);
    // patterns that no block has any more are used again
    let patterns = |f: &Family| f.store.stencil_bonds().expect("blocks").blocks.memory();
    let before = patterns(&family);
    for _ in 0..50 {
        active[point.expect("there is one")] ^= true;
        family.set_active(&active);
    }
    assert!(patterns(&family) <= before + before / 2);
}

#[test]
fn bodies_without_a_stencil_are_refused() {
    let mut body = block([9.0, 7.0, 5.0], 3);
    body.store = body::Store::List;
    let active = vec![true; body.points.len()];
    let refused = Family::growing(Share::whole(&body), &FamilySpec::new(3.0), &active, 0);
    assert!(matches!(refused, Err(FamilyError::Growing(_))));
}
