//! Families of several horizons: factors of horizons, calibration of zones, balanced bonds.

use nalgebra::Vector3;

use super::{
    Bond, BondKernel, ByRules, Correction, Family, FamilyError, FamilySpec, LayerRule, SlotField,
};
use crate::body::{Body, Face, Horizon, Jitter, Zone};
use crate::shape::{BoxShape, Shape};

/// Conduction with a conductivity of one.
struct Flow;

impl BondKernel<1, 1> for Flow {
    #[inline(always)]
    fn bond(&self, bond: &Bond, [own]: [f64; 1], [other]: [f64; 1]) -> [f64; 1] {
        [2.0 * bond.mean() * bond.inverse_length * (other - own)]
    }
}

/// A plate of 2 m by 1 m of two zones: spacing (m) and factor of the horizon of each.
pub(super) fn plate(zones: [(f64, f64); 2], jitter: f64) -> Body {
    let shape = Shape::Box(BoxShape {
        min: [0.0; 3],
        max: [2.0, 1.0, 0.1],
    });
    let zone = |left: f64, (spacing, horizon_factor): (f64, f64)| Zone {
        min: [left, 0.0, 0.0],
        max: [left + 1.0, 1.0, 0.0],
        spacing,
        horizon_factor,
    };
    let zones = [zone(0.0, zones[0]), zone(1.0, zones[1])];
    let body = Body::fill_zones("plate", &shape, 2, 0.1, &zones).expect("valid zones");
    let jitter = Jitter {
        amplitude: jitter,
        seed: 5,
    };
    body.jittered(jitter).expect("valid")
}

pub(super) fn spec(correction: Correction, layers: &[Face]) -> FamilySpec {
    FamilySpec {
        horizon: Horizon::Spacings(3.0),
        correction,
        layers: layers.to_vec(),
        ..FamilySpec::new(1.0)
    }
}

const SIDES: [Face; 4] = [Face::XMin, Face::XMax, Face::YMin, Face::YMax];

/// Heat flow at each point of a plate under `T = g.x`, prescribed on the faces across the axis of `g` and insulated on others.
fn flow(body: &Body, family: &Family, axis: usize) -> Vec<f64> {
    let values: Vec<f64> = body.points.position.iter().map(|x| x[axis]).collect();
    let rules: Vec<LayerRule> = SIDES
        .into_iter()
        .filter(|face| face.axis() == axis)
        .map(|face| LayerRule {
            values: None,
            traction: None,
            face,
            scale: [-1.0; 3],
            offset: [2.0 * body.face_position(face); 3],
        })
        .collect();
    let mut slots = SlotField::default();
    slots.load(family, &values[..], ByRules(&rules, 0));
    let mut sums = vec![[0.0]; values.len()];
    family.sum(&Flow, [&slots], &mut sums);
    sums.into_iter().map(|[sum]| sum).collect()
}

#[test]
fn horizons_are_those_of_the_zones() {
    let body = plate([(0.1, 2.0), (0.1, 1.0)], 0.0);
    let family = Family::build(&body, &spec(Correction::None, &SIDES)).expect("valid");
    for (point, x) in body.points.position.iter().enumerate() {
        let expected = if x.x < 1.0 { 0.6 } else { 0.3 };
        assert!((body.points.horizon(point, Horizon::Spacings(3.0)) - expected).abs() < 1e-12);
        let mut longest: f64 = 0.0;
        family.for_each_bond(point, |_, bond, _| {
            if bond.weight > 0.0 {
                longest = longest.max(bond.length);
            }
        });
        // mirrored layers complete every family: the ties at whole spacings belong to it
        assert!((longest - expected).abs() < 1e-9, "{longest} at {x}");
    }
    let refused = Horizon::Spacings(1.0).check(&plate([(0.1, 0.5), (0.1, 1.0)], 0.0));
    assert!(
        refused
            .expect_err("too short")
            .to_string()
            .contains("horizon_factor")
    );
}

#[test]
fn the_calibration_of_a_zone_is_that_of_its_lattice_up_to_the_interface() {
    let shape = Shape::Box(BoxShape {
        min: [0.0; 3],
        max: [1.0, 1.0, 0.1],
    });
    let lattice = Body::fill("plate", &shape, 2, 0.1, 0.1).expect("valid");
    let whole = Family::build(&lattice, &spec(Correction::Lattice, &SIDES)).expect("valid");
    let body = plate([(0.1, 1.0), (0.2, 1.0)], 0.0);
    let family = Family::build(&body, &spec(Correction::Zone, &SIDES)).expect("valid");
    let weight = |family: &Family, point: usize, xi: [f64; 3]| {
        let mut found = None;
        family.for_each_bond(point, |_, bond, _| {
            if (Vector3::from(bond.xi) - Vector3::from(xi)).norm() < 1e-9 {
                found = Some(bond.weight);
            }
        });
        found.expect("a bond")
    };
    for (point, x) in body
        .points
        .position
        .iter()
        .enumerate()
        .filter(|(_, x)| x.x < 1.0)
    {
        // the bond to the left neighbour
        let xi = [-0.1, 0.0, 0.0];
        let difference = weight(&family, point, xi) / weight(&whole, 0, xi) - 1.0;
        assert!(difference.abs() < 1e-12, "{difference} at {x}");
    }
}

#[test]
fn a_linear_field_is_in_equilibrium_on_balanced_bonds() {
    // a sudden change of spacing, of the horizon, of both, and displaced points
    for (zones, jitter) in [
        ([(0.05, 1.0), (0.1, 1.0)], 0.0),
        ([(0.05, 2.0), (0.05, 1.0)], 0.0),
        ([(0.05, 2.0), (0.1, 1.0)], 0.0),
        ([(0.05, 1.0), (0.1, 1.0)], 0.2),
    ] {
        let body = plate(zones, jitter);
        for axis in 0..2 {
            let rates = |correction| {
                let family = Family::build(&body, &spec(correction, &SIDES)).expect("valid");
                let rates = flow(&body, &family, axis);
                rates
                    .iter()
                    .fold(0.0, |largest: f64, r| largest.max(r.abs()))
            };
            let (point, balanced) = (rates(Correction::Point), rates(Correction::Balanced));
            // terms are of the order 1 / horizon
            assert!(
                balanced < 1e-10,
                "{zones:?} {jitter}, axis {axis}: {balanced}"
            );
            let is_uneven = axis == 0 || jitter > 0.0;
            assert!(!is_uneven || point > 0.1, "{zones:?} {jitter}: {point}");
        }
    }
}

#[test]
fn balanced_bonds_are_pairs_and_bare_surfaces_stay_as_they_are() {
    let body = plate([(0.05, 1.0), (0.1, 1.0)], 0.2);
    let [point, balanced] = [Correction::Point, Correction::Balanced]
        .map(|correction| Family::build(&body, &spec(correction, &[])).expect("valid"));
    let rates = |family: &Family| flow(&body, family, 0);
    let total = |rates: &[f64]| -> f64 {
        let heat = rates.iter().zip(&body.points.volume).map(|(r, v)| r * v);
        heat.sum()
    };
    // pairs cancel: rounding of a thousand terms of order 0.01
    assert!(total(&rates(&balanced)).abs() < 1e-13);
    let (before, after) = (rates(&point), rates(&balanced));
    for ((x, before), after) in body.points.position.iter().zip(before).zip(after) {
        let depth = x.x.min(2.0 - x.x).min(x.y).min(1.0 - x.y);
        if depth < 0.05 {
            assert!(before.abs() > 1e-3 && after.abs() > 1e-3);
        } else if depth > 0.75 {
            assert!(after.abs() < 1e-10, "{after} at {x}");
        }
    }
}

#[test]
fn cuts_remove_balanced_bonds_and_no_others_change() {
    let whole = plate([(0.05, 1.0), (0.1, 1.0)], 0.1);
    let mut cut = whole.clone();
    cut.cuts = crate::body::Cut::segment([0.5, 0.5], [1.5, 0.5])
        .into_iter()
        .collect();
    let spec = spec(Correction::Balanced, &SIDES);
    let [whole_family, cut_family] =
        [&whole, &cut].map(|b| Family::build(b, &spec).expect("valid"));
    let mut missing = 0;
    for point in 0..whole.points.len() {
        let bonds = |family: &Family| {
            let mut bonds = Vec::new();
            family.for_each_bond(point, |_, bond, slot| {
                bonds.push((slot, bond.weight, bond.dual))
            });
            bonds
        };
        let (all, left) = (bonds(&whole_family), bonds(&cut_family));
        missing += all.len() - left.len();
        assert!(left.iter().all(|bond| all.contains(bond)));
    }
    assert!(missing > 100);
}

#[test]
fn bonds_that_cannot_be_balanced_are_refused_with_the_reason() {
    // a coarse zone beside one a tenth of its size, with horizons that reach one neighbour
    let body = plate([(0.01, 1.0), (0.25, 1.0)], 0.4);
    let spec = FamilySpec {
        horizon: Horizon::Spacings(1.1),
        ..spec(Correction::Balanced, &SIDES)
    };
    match Family::build(&body, &spec) {
        Err(FamilyError::NotBalanced { reason }) => assert!(!reason.is_empty()),
        Err(FamilyError::NoNeighbours { .. }) => {}
        other => panic!("{:?}", other.map(|f| f.bonds())),
    }
}
