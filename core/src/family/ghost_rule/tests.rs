use super::*;
use crate::Axis;
use crate::body::Body;
use crate::family::{Correction, FamilySpec, Ghost};
use crate::shape::{BoxShape, Shape};

#[test]
fn where_faces_disagree_none_comes_first() {
    let rule = |face, scale, value| LayerRule {
        scale: [scale; 3],
        offset: [(1.0 - scale) * value; 3],
        ..LayerRule::even(face)
    };
    let rules = [
        rule(Face::XMax, -1.0, 1.0),
        rule(Face::YMin, -1.0, 7.0),
        rule(Face::YMax, -1.0, 1.0),
        rule(Face::ZMax, 0.0, 4.0),
        rule(Face::ZMin, 1.0, 0.0),
    ];
    let shape = Shape::Box(BoxShape {
        min: [0.0; 3],
        max: [0.4; 3],
    });
    let body = Body::fill("block", &shape, 3, 0.1, 0.5).expect("valid");
    let spec = FamilySpec {
        layers: rules.iter().map(|r| r.face).collect(),
        correction: Correction::None,
        ..FamilySpec::new(0.2)
    };
    let families = [Family::build(&body, &spec), Family::moving(&body, &spec)];
    for family in families.map(|f| f.expect("valid")) {
        let values: Vec<f64> = (0..body.points.len()).map(|i| i as f64).collect();
        let mut slots = SlotField::default();
        slots.load(&family, &values[..], ByRules(&rules, 0));
        let behind = |faces: &[Face]| {
            let is = |g: &&Ghost| {
                let passed = |f: &Face| faces.contains(f) == (g.passes[*f as usize] > 0);
                Face::ALL.iter().all(passed)
            };
            let ghost = family
                .slots
                .ghosts
                .iter()
                .find(is)
                .expect("behind each corner");
            (slots[ghost.slot as usize], f64::from(ghost.point))
        };
        use Face::{XMax, YMax, YMin, ZMax, ZMin};
        for faces in [&[XMax, YMin][..], &[XMax, YMin, ZMin]] {
            let (value, point) = behind(faces);
            assert_eq!(value, 8.0 - point);
        }
        assert_eq!(behind(&[XMax, ZMax]).0, 2.5);
        assert_eq!(behind(&[XMax, YMin, ZMax]).0, 4.0);
        // also where all faces prescribe a value
        let mut filled = SlotField::default();
        filled.load(&family, &values[..], ByRules(&rules[..3], 0));
        for ghost in &family.slots.ghosts {
            let is_behind = |f: &Face| ghost.passes[*f as usize] > 0;
            if Face::ALL.into_iter().filter(is_behind).eq([XMax, YMin]) {
                assert_eq!(filled[ghost.slot as usize], 8.0 - f64::from(ghost.point));
            }
        }
        // where they agree, or one has nothing to say, it is the image
        let (value, point) = behind(&[XMax, YMax]);
        assert_eq!(value, point);
        let (value, point) = behind(&[XMax, ZMin]);
        assert_eq!(value, 2.0 - point);
    }
}

/// Cells count from that of the first point, in front of it below zero.
#[test]
fn the_cells_of_layers_are_where_their_points_are() {
    for dimension in [2, 3] {
        let (min, max) = ([0.0; 3], [0.6, 0.5, 0.4]);
        let shape = Shape::Box(BoxShape { min, max });
        let body = Body::fill("block", &shape, dimension, 0.1, 0.5).expect("valid");
        let spec = FamilySpec::mirrored(&body, 2.0);
        let family = Family::build(&body, &spec).expect("valid");
        let cells = family.layer_cells();
        assert_eq!(cells.len(), family.layer_points());
        for (slot, cell) in cells {
            for (axis, cell) in cell.into_iter().enumerate().take(dimension) {
                let expected = 0.1 * (cell as f64 + 0.5);
                let found = family.place(slot as usize, axis);
                assert!(
                    (found - expected).abs() < 1e-12,
                    "{slot}: {found} {expected}"
                );
            }
        }
    }
}

#[test]
fn images_mirror_scalars_vectors_and_tensors() {
    for dimension in [2, 3] {
        let shape = Shape::Box(BoxShape {
            min: [0.0; 3],
            max: [0.6, 0.5, 0.4],
        });
        let mut body = Body::fill("block", &shape, dimension, 0.1, 0.5).expect("valid");
        body.repeat(&[Axis::Y]).expect("it fits");
        let spec = FamilySpec {
            correction: Correction::None,
            ..FamilySpec::mirrored(&body, 2.0)
        };
        let families = [Family::build(&body, &spec), Family::moving(&body, &spec)];
        for family in families.map(|f| f.expect("valid")) {
            assert!(family.has_layers());
            let values: Vec<f64> = (0..body.points.len()).map(|i| (i as f64).sin()).collect();
            let signs = |image: &Image, axes: &[usize]| {
                let periodic = |axis: usize| family.slots.periodic[axis];
                let sign = |&axis: &usize| {
                    if periodic(axis) {
                        1.0
                    } else {
                        image.mirror[axis]
                    }
                };
                axes.iter().map(sign).product::<f64>()
            };
            let images = Continuation::default();
            for (ghosts, axes) in [
                (Mirrored::Scalar, vec![]),
                (Mirrored::Vector(0), vec![0]),
                (Mirrored::Vector(1), vec![1]),
                (Mirrored::Tensor(0, 0), vec![0, 0]),
                (Mirrored::Tensor(0, 1), vec![0, 1]),
                (Mirrored::Tensor(2, 0), vec![2, 0]),
            ] {
                let (mut found, mut expected) = (SlotField::default(), SlotField::default());
                found.load(&family, &values[..], ghosts);
                let value = |image: &Image| [signs(image, &axes) * values[image.point]];
                let at = |point: usize| values[point];
                expected.load(&family, at, ByImage(&images, value));
                assert_eq!(found, expected, "{ghosts:?}");
            }
        }
    }
}

/// Images of curved layers behind planes of symmetry, and copies of them along periodic axes, are those of curved layers, whichever axis is filled
/// first.
#[test]
fn images_of_curved_layers_are_curved() {
    use std::collections::HashMap;
    let shape = Shape::Box(BoxShape {
        min: [0.0; 3],
        max: [0.5, 0.5, 0.1],
    });
    for wall in [Axis::X, Axis::Y] {
        for is_periodic in [false, true] {
            let mut body = Body::fill("box", &shape, 2, 0.1, 0.5).expect("valid");
            let other = if wall == Axis::X { Axis::Y } else { Axis::X };
            let mut layers: Vec<Face> = Face::ALL[..4].to_vec();
            if is_periodic {
                body.repeat(&[other]).expect("it fills its box");
                layers.retain(|face| face.axis() == wall.index());
            }
            let rule = |face: &Face| {
                let mut rule = LayerRule::even(*face);
                if face.axis() == wall.index() {
                    (rule.scale, rule.offset) = ([-1.0; 3], [0.6; 3]);
                } else {
                    rule.scale[face.axis()] = -1.0;
                }
                rule
            };
            let rules: Vec<LayerRule> = layers.iter().map(rule).collect();
            let spec = FamilySpec {
                layers,
                correction: Correction::None,
                ..FamilySpec::new(0.2)
            };
            let family = Family::build(&body, &spec).expect("valid");
            let values: Vec<f64> = (0..25).map(|i| (f64::from(i) * 1.7).sin()).collect();
            let [mut slots, mut plain] = [(); 2].map(|()| SlotField::default());
            slots.load(&family, &values[..], Curved(ByRules(&rules, 2)));
            plain.load(&family, &values[..], ByRules(&rules, 2));
            let of_wall = |ghost: &Ghost| {
                let passes = [0, 1].map(|side| ghost.passes[2 * wall.index() + side]);
                (ghost.point, passes)
            };
            let across = |ghost: &Ghost| -> u8 {
                (0..2)
                    .map(|side| ghost.passes[2 * other.index() + side])
                    .sum()
            };
            let mut single = HashMap::new();
            for ghost in family.slots.ghosts.iter().filter(|g| across(g) == 0) {
                let value = slots[ghost.slot as usize];
                let first = single.entry(of_wall(ghost)).or_insert(value);
                assert!((*first - value).abs() < 1e-14, "{wall:?} {is_periodic}");
                let is_curved = value != plain[ghost.slot as usize];
                assert_eq!(is_curved, of_wall(ghost).1 != [0, 0]);
            }
            for ghost in family.slots.ghosts.iter().filter(|g| across(g) == 1) {
                if let Some(value) = single.get(&of_wall(ghost)) {
                    let found = slots[ghost.slot as usize];
                    assert!((found - value).abs() < 1e-14, "{wall:?}: {found} {value}");
                }
            }
        }
    }
}
