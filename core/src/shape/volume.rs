//! Volume of any shape.
//!
//! The bounding box is halved along its longest edge again and again. A box that lies inside the shape, or outside of it, by
//! more than half its diagonal is counted as a whole; boxes at the surface are divided until their number reaches a limit.
//! Each box that is left counts as a whole or not at all, by one position in it. These positions are spread evenly by an
//! additive recurrence (Roberts 2018, with the powers of the root of x^4 = x + 1), so that the errors of neighbours cancel:
//! the error falls with the number n of boxes at the surface about as n^(-3/2) in three dimensions. The same shape always
//! has the same volume.

use nalgebra::Vector3;

use super::{Bounds, Shape};

/// Largest number of boxes at the surface.
const BOXES: usize = 60_000;

/// The root of x^4 = x + 1.
const ROOT: f64 = 1.220_744_084_605_76;

impl Shape {
    /// Length (m), area (m²) or volume (m³) of a shape in the first one, two or three axes; a section through the middle
    /// of its bounds where axes are left out. `None` for shapes without bounds.
    pub fn measure(&self, dimension: usize) -> Option<f64> {
        if let (Shape::Stl(stl), 3) = (self, dimension)
            && let Some(exact) = stl.volume()
        {
            return Some(exact);
        }
        Some(sampled(self, self.bounds()?, dimension.clamp(1, 3)))
    }
}

/// A box by its middle and half its edges.
#[derive(Clone, Copy)]
struct SampleBox {
    middle: Vector3<f64>,
    half: Vector3<f64>,
}

impl SampleBox {
    fn size(&self, dimension: usize) -> f64 {
        (0..dimension).map(|a| 2.0 * self.half[a]).product()
    }

    /// The two halves across the longest edge.
    fn halves(&self) -> [SampleBox; 2] {
        let axis = self.half.imax();
        [-0.5, 0.5].map(|side| {
            let mut half = *self;
            half.middle[axis] += side * self.half[axis];
            half.half[axis] *= 0.5;
            half
        })
    }
}

fn sampled(shape: &Shape, bounds: Bounds, dimension: usize) -> f64 {
    let (low, high) = bounds;
    let mut half = 0.5 * (high - low);
    for axis in dimension..3 {
        half[axis] = 0.0;
    }
    let whole = SampleBox {
        middle: 0.5 * (low + high),
        half,
    };
    let mut inside = 0.0;
    let mut surface = vec![whole];
    // boxes of one generation have equal sizes
    while !surface.is_empty() && surface.len() <= BOXES {
        let mut next = Vec::with_capacity(surface.len());
        for part in surface.iter().flat_map(SampleBox::halves) {
            let reach = part.half.norm();
            if shape.contains(&part.middle, -reach) {
                inside += part.size(dimension);
            } else if shape.contains(&part.middle, reach) {
                next.push(part);
            }
        }
        // edges of zero length cannot be divided
        if surface[0].half.max() < 1e-9 * half.max() {
            break;
        }
        surface = next;
    }
    let at_surface = surface.iter().enumerate().filter(|(index, part)| {
        let place = Vector3::from_fn(|axis, _| {
            let step = ROOT.powi(-1 - axis as i32);
            2.0 * (0.5 + (index + 1) as f64 * step).fract() - 1.0
        });
        shape.contains(&(part.middle + place.component_mul(&part.half)), 0.0)
    });
    let at_surface: f64 = at_surface.map(|(_, part)| part.size(dimension)).sum();
    inside + at_surface
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    fn shape(text: &str) -> Shape {
        toml::from_str(text).expect("a shape")
    }

    #[test]
    fn volumes_are_those_of_closed_forms() {
        let tube = "difference = { from.cylinder = { start = [0, 0, 0], end = [0, 0, 3], radius = 1 }, \
                    subtract.cylinder = { start = [0, 0, -1], end = [0, 0, 4], radius = 0.95 } }";
        let union = "union = [{ box = { min = [0, 0, 0], max = [1, 1, 1] } }, { box = { min = [0.5, 0, 0], max = [2, 1, 1] } }]";
        let turned = "rotate = { shape.box = { min = [0, 0, 0], max = [3, 1, 0.2] }, axis = [1, 1, 0.3], angle = 0.7 }";
        let half = "difference = { from.sphere = { centre = [0, 0, 0], radius = 2 }, \
                    subtract.half_space = { point = [0, 0, 0], normal = [1, 2, 3] } }";
        for (text, dimension, expected) in [
            ("box = { min = [0, 0, 0], max = [1, 2, 3] }", 3, 6.0),
            ("box = { min = [0, 0, 0], max = [1, 2, 3] }", 2, 2.0),
            ("box = { min = [0, 0, 0], max = [0.7, 2, 0] }", 1, 0.7),
            ("sphere = { centre = [1, 1, 1], radius = 0.5 }", 3, PI / 6.0),
            ("sphere = { centre = [1, 1, 1], radius = 0.5 }", 2, PI / 4.0),
            (tube, 3, 3.0 * PI * (1.0 - 0.95_f64.powi(2))),
            (union, 3, 2.0),
            (turned, 3, 0.6),
            (half, 3, PI * 16.0 / 3.0),
        ] {
            let found = shape(text).measure(dimension).expect("bounded");
            assert!(
                (found / expected - 1.0).abs() < 2e-3,
                "{text}: {found} {expected}"
            );
        }
        let plane = shape("half_space = { point = [0, 0, 0], normal = [0, 0, 1] }");
        assert_eq!(plane.measure(3), None);
    }
}
