//! Families that reach across gaps and holes of the body, or not to the coarser points beside them.
//!
//! The points of a family that lie in matter of one piece are connected by cells that touch. A family that falls into
//! pieces has bonds across empty space: two sides of a slit, or of a hole between coarse rows of points, hold together
//! and conduct as if it were filled. Where the spacing jumps, the horizon of a fine point may end before the centres of the
//! coarse cells beside it, so that the fine points have a free surface there (docs/theory/horizons.md).

use nalgebra::Vector3;
use rayon::prelude::*;

use super::FamilySpec;
use super::build::cuts;
use crate::body::{Body, Discretisation, Lattice};
use crate::body::{Cut, Horizon};
use crate::cell_list::CellList;

/// Gap between cells that touch, in spacings: of displaced points, and of rounding.
const SLACK: [f64; 2] = [0.3, 1e-6];

/// A finding about the family of a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Finding {
    Alone,
    InPieces,
    EndsAtCoarse,
}

/// Sentences about the points of a body whose families reach across a gap, miss the coarser points beside them, or are
/// empty.
pub(crate) fn warnings(body: &Body, spec: &FamilySpec) -> Vec<String> {
    if body.lattice().is_some_and(Lattice::is_full) {
        return Vec::new();
    }
    let review = Review::new(body, spec);
    let found: Vec<_> = (0..body.points.len())
        .into_par_iter()
        .flat_map_iter(|point| review.of(point).map(|finding| (finding, point)))
        .collect();
    let describe = |finding: Finding, what: &str| {
        let mut points = found.iter().filter(|(f, _)| *f == finding);
        let (_, first) = points.next()?;
        let [x, y, z] = body.points.position.at(*first).into();
        let name = &body.name;
        let number = 1 + points.count();
        Some(format!(
            "{what}: {number} of the points of body `{name}`, the first at ({x:.4e}, {y:.4e}, {z:.4e}) m"
        ))
    };
    let sentences = [
        describe(
            Finding::InPieces,
            "bonds cross a gap or a hole, which is smaller than the horizon (cut them by a crack, or refine the points \
             around it)",
        ),
        describe(
            Finding::EndsAtCoarse,
            "the horizon ends before the coarser points beside it (put a zone with a spacing in between)",
        ),
        describe(Finding::Alone, "there is no other point within the horizon"),
    ];
    sentences.into_iter().flatten().collect()
}

struct Review<'a> {
    body: &'a Body,
    horizon: Horizon,
    cuts: Vec<Cut>,
    list: CellList,
    slack: f64,
}

impl<'a> Review<'a> {
    fn new(body: &'a Body, spec: &FamilySpec) -> Self {
        // cells that touch face to face find each other
        let reach = &body.points.spacing;
        let [displaced, rounding] = SLACK;
        Review {
            body,
            horizon: spec.horizon,
            cuts: cuts(body, spec),
            list: CellList::new(&body.points.position, reach),
            slack: match body.discretisation {
                Discretisation::Lattice(_) | Discretisation::Layers(_) => rounding,
                Discretisation::Cloud(_) => displaced,
            },
        }
    }

    fn of(&self, point: usize) -> Option<Finding> {
        let (position, spacing) = (&self.body.points.position, &self.body.points.spacing);
        let at = &position[point];
        let horizon = self.body.points.horizon(point, self.horizon) * (1.0 + 1e-9);
        // the point itself is the first
        let mut family = vec![point];
        let mut coarse = (false, false);
        self.list.visit_near(at, horizon, |other| {
            if other == point
                || self
                    .cuts
                    .iter()
                    .any(|cut| cut.crosses(at, &position[other]))
            {
                return;
            }
            let is_near = (position[other] - at).norm() <= horizon;
            if is_near {
                family.push(other);
            }
            if spacing[other] > spacing[point] && self.touch(point, other) {
                let (touches, reaches) = coarse;
                coarse = (touches || !is_near, reaches || is_near);
            }
        });
        if family.len() == 1 {
            return Some(Finding::Alone);
        }
        if !self.is_connected(&mut family) {
            return Some(Finding::InPieces);
        }
        (coarse == (true, false)).then_some(Finding::EndsAtCoarse)
    }

    /// Whether all points can be reached from the first over cells that touch; changes the order of the others.
    fn is_connected(&self, family: &mut [usize]) -> bool {
        let mut reached = 1;
        let mut next = 0;
        while next < reached {
            let here = family[next];
            let mut left = reached;
            while left < family.len() {
                if self.touch(here, family[left]) {
                    family.swap(reached, left);
                    reached += 1;
                }
                left += 1;
            }
            next += 1;
        }
        reached == family.len()
    }

    /// Whether the cells of two points touch.
    fn touch(&self, a: usize, b: usize) -> bool {
        let points = &self.body.points;
        let (low, high) = {
            let (a, b) = (points.spacing[a], points.spacing[b]);
            (a.min(b), a.max(b))
        };
        let reach = 0.5 * (low + high) + self.slack * low;
        let offset: Vector3<f64> = points.position.at(a) - points.position.at(b);
        offset
            .iter()
            .take(self.body.dimension)
            .all(|d| d.abs() <= reach)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::Cut;
    use crate::body::Zone;
    use crate::shape::{BoxShape, Difference, Shape, Sphere};

    fn rectangle(min: [f64; 2], max: [f64; 2]) -> Shape {
        Shape::Box(BoxShape {
            min: [min[0], min[1], 0.0],
            max: [max[0], max[1], 1.0],
        })
    }

    fn without(subtract: Shape) -> Shape {
        Shape::Difference(Difference {
            from: Box::new(rectangle([0.0; 2], [20.0; 2])),
            subtract: Box::new(subtract),
        })
    }

    /// A plate of 20 x 20 cells with a slit of this height (cells) from its left side to the middle.
    fn slit(height: f64) -> Body {
        let shape = without(rectangle([-1.0, 10.0], [10.0, 10.0 + height]));
        Body::fill("plate", &shape, 2, 1.0, 1.0).expect("a valid plate")
    }

    fn found(body: &Body) -> Vec<String> {
        let spec = FamilySpec {
            horizon: Horizon::Spacings(3.015),
            ..FamilySpec::default()
        };
        warnings(body, &spec)
    }

    #[test]
    fn bonds_across_a_slit_are_told_unless_they_are_cut_or_too_short() {
        let body = slit(2.0);
        let [sentence] = &found(&body)[..] else {
            panic!("one sentence");
        };
        // of the two rows of ten points, the families of the last go around the tip
        assert!(
            sentence.starts_with("bonds cross a gap or a hole"),
            "{sentence}"
        );
        assert!(sentence.contains(": 18 of the points"), "{sentence}");
        let mut body = slit(2.0);
        body.cuts.extend(Cut::segment([-1.0, 11.0], [10.0, 11.0]));
        assert_eq!(found(&body), [""; 0]);
        assert_eq!(found(&slit(4.0)), [""; 0]);
    }

    #[test]
    fn neighbours_at_the_very_horizon_belong_to_the_family() {
        let spec = FamilySpec {
            horizon: Horizon::Spacings(1.0),
            ..FamilySpec::default()
        };
        assert_eq!(warnings(&slit(2.0), &spec), [""; 0]);
    }

    #[test]
    fn round_holes_and_corners_are_no_gaps() {
        let shape = without(Shape::Sphere(Sphere {
            centre: [10.0, 10.0, 0.5],
            radius: 5.2,
        }));
        let body = Body::fill("plate", &shape, 2, 1.0, 1.0).expect("a valid plate");
        assert_eq!(found(&body), [""; 0]);
    }

    #[test]
    fn a_spacing_that_jumps_is_told() {
        let body = |fine: f64| {
            let zones = [
                Zone {
                    min: [0.0; 3],
                    max: [6.0, 12.0, 0.0],
                    spacing: fine,
                    horizon_factor: 1.0,
                },
                Zone {
                    min: [6.0, 0.0, 0.0],
                    max: [12.0, 12.0, 0.0],
                    spacing: 3.0,
                    horizon_factor: 1.0,
                },
            ];
            Body::fill_zones("plate", &rectangle([0.0; 2], [12.0; 2]), 2, 1.0, &zones[..])
                .expect("a valid plate")
        };
        assert_eq!(found(&body(1.0)), [""; 0]);
        let sentence = found(&body(0.5)).concat();
        assert!(
            sentence.starts_with("the horizon ends before"),
            "{sentence}"
        );
        assert!(sentence.contains(": 24 of the points"), "{sentence}");
    }

    #[test]
    fn a_point_alone_is_told() {
        let shape = Shape::Union(vec![
            rectangle([0.0; 2], [5.0; 2]),
            rectangle([20.0; 2], [21.0; 2]),
        ]);
        let body = Body::fill("plate", &shape, 2, 1.0, 1.0).expect("a valid plate");
        let sentence = found(&body).concat();
        assert!(
            sentence.starts_with("there is no other point"),
            "{sentence}"
        );
        assert!(sentence.contains(": 1 of the points"), "{sentence}");
    }
}
