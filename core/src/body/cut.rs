//! Cuts: flat cracks that sever the bonds crossing them.

use nalgebra::Vector3;

use crate::body::{Body, Discretisation, Face};

/// A flat cut through a body: every bond whose reference segment crosses it is removed, from
/// all families of the body. Neither heat nor force passes a cut.
#[derive(Clone, Debug, PartialEq)]
pub struct Cut {
    /// Corner, or centre.
    corner: Vector3<f64>,
    /// Edges from the corner, or radii.
    edges: [Vector3<f64>; 2],
    outline: Outline,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Outline {
    Parallelogram,
    /// Without bounds along the second edge.
    Strip,
    Disc,
}

impl Cut {
    /// The segment from `from` to `to` (x, y in m), extended over all z: cracks of 2D bodies
    /// and through-cracks of 3D ones. `None` when it has no length.
    pub fn segment(from: [f64; 2], to: [f64; 2]) -> Option<Cut> {
        let cut = Cut {
            corner: Vector3::new(from[0], from[1], 0.0),
            edges: [
                Vector3::new(to[0] - from[0], to[1] - from[1], 0.0),
                Vector3::z(),
            ],
            outline: Outline::Strip,
        };
        cut.has_area().then_some(cut)
    }

    /// The parallelogram spanned by two edge vectors from `corner`, all in m. `None` when it
    /// has no area.
    pub fn parallelogram(corner: [f64; 3], edges: [[f64; 3]; 2]) -> Option<Cut> {
        let cut = Cut {
            corner: corner.into(),
            edges: edges.map(Vector3::from),
            outline: Outline::Parallelogram,
        };
        cut.has_area().then_some(cut)
    }

    /// The disc about `centre` (m) across `normal` of a radius in m. `None` when it has no area.
    pub fn disc(centre: [f64; 3], normal: [f64; 3], radius: f64) -> Option<Cut> {
        let normal = Vector3::from(normal).try_normalize(0.0)?;
        let across = normal.cross(&Vector3::ith_axis(normal.iamin()));
        let first = radius * across.try_normalize(0.0)?;
        let cut = Cut {
            corner: centre.into(),
            edges: [first, normal.cross(&first)],
            outline: Outline::Disc,
        };
        (radius > 0.0 && cut.has_area()).then_some(cut)
    }

    fn has_area(&self) -> bool {
        self.normal().norm() > 0.0
    }

    fn normal(&self) -> Vector3<f64> {
        self.edges[0].cross(&self.edges[1])
    }

    /// Whether the middle of the cut lies in a box between two corners (m) of a body of a dimension.
    pub fn is_within(&self, [min, max]: [Vector3<f64>; 2], dimension: usize) -> bool {
        let (middle, axes) = match self.outline {
            Outline::Disc => (self.corner, 3),
            Outline::Strip => (self.corner + 0.5 * self.edges[0], 2),
            Outline::Parallelogram => (self.corner + 0.5 * (self.edges[0] + self.edges[1]), 3),
        };
        (0..axes.min(dimension)).all(|a| (min[a]..=max[a]).contains(&middle[a]))
    }

    /// Distance of `position` from the plane of the cut, m; positive on the side of
    /// `edge 1 x edge 2`.
    pub fn distance(&self, position: &Vector3<f64>) -> f64 {
        (position - self.corner).dot(&self.normal().normalize())
    }

    /// Whether the segment from `from` to `to` (m) crosses the cut.
    ///
    /// A point in the plane of the cut, to within a millionth of its first edge, counts to
    /// the positive side, so that a crack along a row of points severs it from one side only.
    pub fn crosses(&self, from: &Vector3<f64>, to: &Vector3<f64>) -> bool {
        const NEAR: f64 = 1e-6;
        let (before, after) = (self.distance(from), self.distance(to));
        let side = |distance: f64| distance >= -NEAR * self.edges[0].norm();
        if side(before) == side(after) {
            return false;
        }
        let share = (before / (before - after)).clamp(0.0, 1.0);
        let arm = from + (to - from) * share - self.corner;
        // coordinates of the crossing along the two edges, by Cramer's rule
        let normal = self.normal();
        let along = |a: &Vector3<f64>, b: &Vector3<f64>| {
            let coordinate = a.cross(b).dot(&normal) / normal.norm_squared();
            (-NEAR..=1.0 + NEAR).contains(&coordinate)
        };
        match self.outline {
            Outline::Disc => arm.norm() <= (1.0 + NEAR) * self.edges[0].norm(),
            Outline::Strip => along(&arm, &self.edges[1]),
            Outline::Parallelogram => along(&arm, &self.edges[1]) && along(&self.edges[0], &arm),
        }
    }

    /// The copy of the cut behind a face of a periodic body with this `extent` (m) along the axis.
    pub(crate) fn shifted(&self, face: Face, extent: f64) -> Cut {
        let mut image = self.clone();
        image.corner[face.axis()] += if face.is_upper() { extent } else { -extent };
        image
    }

    /// The image of the cut behind the plane at `position` (m) of a face.
    pub(crate) fn mirrored(&self, face: Face, position: f64) -> Cut {
        let axis = face.axis();
        let mut image = self.clone();
        image.corner[axis] = 2.0 * position - image.corner[axis];
        image.edges.iter_mut().for_each(|e| e[axis] = -e[axis]);
        image
    }
}

/// Whether a cut separates two positions (m).
pub fn severed(cuts: &[Cut], from: &Vector3<f64>, to: &Vector3<f64>) -> bool {
    // most points are far from all cuts
    let is_near = |cut: &&Cut| cut.distance(from).abs() <= 2.0 * (to - from).norm();
    cuts.iter().filter(is_near).any(|cut| cut.crosses(from, to))
}

impl Body {
    /// Adds a crack; it passes through all layers of a laminate.
    pub fn sever(&mut self, cut: Cut) {
        if let Discretisation::Layers(layers) = &mut self.discretisation {
            layers.plane_mut().cuts.push(cut.clone());
        }
        self.cuts.push(cut);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::family::{Bond, BondKernel, Family, FamilySpec, Mirrored, SlotField};
    use crate::shape::{BoxShape, Shape};

    #[test]
    fn only_segments_through_the_cut_cross_it() {
        let cut = Cut::parallelogram([0.0; 3], [[1.0, 0.0, 0.0], [0.0, 2.0, 0.0]]).expect("area");
        for (x, y, crosses) in [(0.5, 1.9, true), (0.5, 2.1, false), (-0.1, 1.0, false)] {
            let (below, above) = (Vector3::new(x, y, -0.3), Vector3::new(x, y, 0.1));
            assert_eq!(cut.crosses(&below, &above), crosses, "{x} {y}");
            assert_eq!(cut.crosses(&above, &below), crosses, "{x} {y} backwards");
            assert!(!cut.crosses(&above, &(above + Vector3::z())));
        }
        let slanted = Cut::segment([0.0, 0.0], [1.0, 1.0]).expect("length");
        let high = Vector3::new(0.4, 0.6, 7.0);
        assert!(slanted.crosses(&high, &Vector3::new(0.6, 0.4, 7.0)));
        assert!(Cut::segment([1.0, 1.0], [1.0, 1.0]).is_none());

        let disc = Cut::disc([1.0, 2.0, 3.0], [0.0, 0.0, 5.0], 0.5).expect("area");
        for (angle, share) in [(0.3f64, 0.99), (2.0, 0.99), (4.0, 1.01), (5.5, 1.01)] {
            let (x, y) = (
                1.0 + 0.5 * share * angle.cos(),
                2.0 + 0.5 * share * angle.sin(),
            );
            let (below, above) = (Vector3::new(x, y, 2.0), Vector3::new(x, y, 3.1));
            assert_eq!(disc.crosses(&below, &above), share < 1.0, "{angle}");
        }
        assert!(Cut::disc([0.0; 3], [0.0; 3], 1.0).is_none());
        assert!(Cut::disc([0.0; 3], [1.0, 0.0, 0.0], 0.0).is_none());
    }

    struct Flow;
    impl BondKernel<1, 1> for Flow {
        #[inline(always)]
        fn bond(&self, bond: &Bond, own: [f64; 1], other: [f64; 1]) -> [f64; 1] {
            [bond.mean() * (other[0] - own[0]) / bond.length]
        }
    }

    fn plate() -> Body {
        let shape = Shape::Box(BoxShape {
            min: [0.0; 3],
            max: [10.0, 8.0, 1.0],
        });
        Body::fill("plate", &shape, 2, 1.0, 1.0).expect("valid")
    }

    fn spec(layers: Vec<Face>) -> FamilySpec {
        FamilySpec {
            layers,
            ..FamilySpec::new(3.0)
        }
    }

    fn sums(body: &Body, spec: &FamilySpec, field: impl Fn(&Vector3<f64>) -> f64) -> Vec<f64> {
        let family = Family::build(body, spec).expect("valid");
        let values: Vec<f64> = body.points.position.iter().map(field).collect();
        let mut slots = SlotField::default();
        slots.load(&family, &values[..], Mirrored::Scalar);
        let mut sums = vec![[0.0]; values.len()];
        family.sum(&Flow, [&slots], &mut sums);
        sums.into_iter().map(|[s]| s).collect()
    }

    #[test]
    fn nothing_passes_a_cut_through_the_whole_body_whatever_lies_behind_its_faces() {
        // the layers behind x- and x+ would carry bonds around the ends of the cut
        let mut body = plate();
        body.cuts = vec![Cut::segment([0.0, 4.0], [10.0, 4.0]).expect("length")];
        for layers in [Vec::new(), Face::ALL.to_vec()] {
            let flow = sums(&body, &spec(layers), |x| f64::from(u8::from(x.y > 4.0)));
            assert!(flow.iter().all(|f| *f == 0.0));
        }
    }

    #[test]
    fn a_cut_leaves_the_factors_of_the_bonds_that_remain() {
        // a field that differs only at the lower left point sees the bonds of that point alone
        let (bare, mut cracked) = (plate(), plate());
        cracked.cuts = vec![Cut::segment([-1.0, 1.0], [11.0, 1.0]).expect("length")];
        let only_first = |x: &Vector3<f64>| f64::from(u8::from(x.x < 1.0 && x.y < 1.0));
        let (whole, cut) = (
            sums(&bare, &spec(vec![]), only_first),
            sums(&cracked, &spec(vec![]), only_first),
        );
        for (point, x) in bare.points.position.iter().enumerate().skip(1) {
            let expected = if x.y < 1.0 { whole[point] } else { 0.0 };
            assert_eq!(cut[point], expected, "at {x:?}");
        }
    }
}
