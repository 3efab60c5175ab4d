//! Images of a box of points: reversed behind planes of symmetry and mirrored faces, copies beyond periodic sides, repeated
//! where the box is thinner than the reach.

use nalgebra::Vector3;

use super::{Body, Face};

/// A map of the points of a body to an image of them: `mirror * x + offset` along each axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoxImage {
    /// Boxes between the image and the original along each axis; odd ones are reversed between mirrors.
    pub(crate) n: [i32; 3],
    /// Factor of each coordinate, and of each component of a vector: -1 where the image is mirrored.
    pub mirror: [f64; 3],
    /// Offset of each coordinate, m.
    pub offset: [f64; 3],
}

/// One image of a coordinate.
#[derive(Clone, Copy, Debug)]
struct AxisImage {
    n: i32,
    mirror: f64,
    offset: f64,
}

/// Images of a box.
#[derive(Clone, Debug)]
pub struct BoxImages {
    low: [f64; 3],
    high: [f64; 3],
    /// By axis, beginning with the original.
    axes: [Vec<AxisImage>; 3],
    /// How far behind the faces images are, m.
    reach: f64,
}

/// The last face behind which an image is made, and how often all faces were gone through before.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct LastStep {
    pub(crate) pass: i32,
    pub(crate) face: Face,
}

impl BoxImage {
    /// The body itself.
    pub const ORIGINAL: BoxImage = BoxImage {
        n: [0; 3],
        mirror: [1.0; 3],
        offset: [0.0; 3],
    };

    /// Whether it is the body itself.
    pub fn is_original(&self) -> bool {
        self.n == [0; 3]
    }

    /// The image of a position, m.
    pub fn of(&self, x: Vector3<f64>) -> Vector3<f64> {
        self.reflect(x) + Vector3::from(self.offset)
    }

    /// The position whose image is `x`, m.
    pub fn origin(&self, x: Vector3<f64>) -> Vector3<f64> {
        self.reflect(x - Vector3::from(self.offset))
    }

    /// Mirrors a vector to the image, or back.
    pub fn reflect(&self, vector: Vector3<f64>) -> Vector3<f64> {
        vector.component_mul(&Vector3::from(self.mirror))
    }

    fn set(&mut self, axis: usize, along: AxisImage) {
        self.n[axis] = along.n;
        (self.mirror[axis], self.offset[axis]) = (along.mirror, along.offset);
    }

    /// Number of faces on the way to the image.
    pub(crate) fn level(&self) -> i32 {
        self.n.iter().map(|n| n.abs()).sum()
    }

    /// The last face on the way when one goes through all faces again and again; `None` for the original.
    pub(crate) fn last_step(&self, periodic: [bool; 3]) -> Option<LastStep> {
        let along = |axis: usize| {
            let (n, is_upper) = (self.n[axis], self.n[axis] > 0);
            let pass = match (periodic[axis], is_upper) {
                (true, _) => n.abs(),
                // upper faces come after the lower one of their axis
                (false, true) => (n + 1) / 2,
                (false, false) => 1 - n / 2,
            };
            let face = Face::ALL[2 * axis + usize::from(is_upper)];
            (n != 0).then_some(LastStep { pass, face })
        };
        (0..3).filter_map(along).max()
    }

    /// Boxes between the original and the image of which a last step makes this image.
    pub(crate) fn before(&self, face: Face, periodic: [bool; 3]) -> [i32; 3] {
        let mut before = self.n;
        let n = &mut before[face.axis()];
        *n = match (face.is_upper(), periodic[face.axis()]) {
            (true, false) => 1 - *n,
            (false, false) => -1 - *n,
            (true, true) => *n - 1,
            (false, true) => *n + 1,
        };
        before
    }
}

impl BoxImages {
    /// Images up to `reach` (m) behind the given faces of a body, which are mirrors where it is not periodic.
    pub fn new(body: &Body, faces: &[Face], reach: f64) -> BoxImages {
        let end = |upper: usize| {
            std::array::from_fn(|axis| body.face_position(Face::ALL[2 * axis + upper]))
        };
        BoxImages::of_box([end(0), end(1)], body.periodic, faces, reach)
    }

    /// Images of the box between two corners.
    pub(crate) fn of_box(
        [low, high]: [[f64; 3]; 2],
        periodic: [bool; 3],
        faces: &[Face],
        reach: f64,
    ) -> BoxImages {
        let along = |axis: usize| {
            let mut images = vec![AxisImage {
                n: 0,
                mirror: 1.0,
                offset: 0.0,
            }];
            let is_open = [0, 1].map(|upper| faces.contains(&Face::ALL[2 * axis + upper]));
            if is_open == [false; 2] {
                return images;
            }
            let size = high[axis] - low[axis];
            // one more for points that have left the box
            for count in 1..=(reach / size).ceil() as i32 + 1 {
                for (n, is_open_here) in [(-count, is_open[0]), (count, is_open[1])] {
                    // further images need the other face as well
                    if !is_open_here || count > 1 && is_open != [true; 2] {
                        continue;
                    }
                    let (mirror, offset) = match (n % 2 == 0 || periodic[axis], n < 0) {
                        (true, _) => (1.0, f64::from(n) * size),
                        (false, true) => (-1.0, 2.0 * low[axis] + f64::from(n + 1) * size),
                        (false, false) => (-1.0, 2.0 * high[axis] + f64::from(n - 1) * size),
                    };
                    images.push(AxisImage { n, mirror, offset });
                }
            }
            images
        };
        BoxImages {
            axes: std::array::from_fn(along),
            low,
            high,
            reach,
        }
    }

    /// All images, beginning with the original.
    pub fn all(&self) -> Vec<BoxImage> {
        let mut images = vec![BoxImage::ORIGINAL];
        for (axis, along) in self.axes.iter().enumerate() {
            for n in 0..images.len() {
                for &along in &along[1..] {
                    let mut image = images[n];
                    image.set(axis, along);
                    images.push(image);
                }
            }
        }
        images
    }

    /// Passes the images of a position (m) within the reach of each face to `receive`, each with its distances from the box
    /// along the axes (m).
    pub(crate) fn for_each_near(
        &self,
        x: &Vector3<f64>,
        mut receive: impl FnMut(BoxImage, Vector3<f64>),
    ) {
        let near = |axis: usize| {
            self.axes[axis].iter().filter_map(move |along| {
                let at = along.mirror * x[axis] + along.offset;
                let depth = match along.n {
                    0 => 0.0,
                    n if n < 0 => self.low[axis] - at,
                    _ => at - self.high[axis],
                };
                (depth <= self.reach).then_some((*along, depth))
            })
        };
        for along_z in near(2) {
            for along_y in near(1) {
                for along_x in near(0) {
                    let along = [along_x, along_y, along_z];
                    let mut image = BoxImage::ORIGINAL;
                    (0..3).for_each(|axis| image.set(axis, along[axis].0));
                    if !image.is_original() {
                        receive(image, Vector3::from(along.map(|(_, depth)| depth)));
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shape::{BoxShape, Shape};

    #[test]
    fn a_bar_shorter_than_the_reach_is_mirrored_again_and_again() {
        let (low, high, reach) = (0.5, 3.5, 7.0);
        let shape = Shape::Box(BoxShape {
            min: [low, 0.0, 0.0],
            max: [high, 1.0, 1.0],
        });
        let bar = Body::fill("bar", &shape, 1, 1.0, 0.5).expect("valid");
        let images = BoxImages::new(&bar, &[Face::XMin, Face::XMax], reach);
        for x in &bar.points.position {
            let copies = (-3..=3).flat_map(|k| {
                let shift = 2.0 * f64::from(k) * (high - low);
                [x.x + shift, 2.0 * low - x.x + shift]
            });
            let mut expected: Vec<f64> = copies
                .filter(|at| (low - reach..=high + reach).contains(at))
                .collect();
            let mut found = vec![x.x];
            images.for_each_near(x, |image, depth| {
                let at = image.of(*x).x;
                assert_eq!(depth.x, (low - at).max(at - high));
                assert_eq!(image.origin(image.of(*x)), *x);
                found.push(at);
            });
            expected.sort_by(f64::total_cmp);
            found.sort_by(f64::total_cmp);
            assert_eq!(found, expected);
        }
    }

    /// Going through the faces again and again, an image is made of one that was there before.
    #[test]
    fn the_image_before_a_step_was_made_by_an_earlier_one() {
        for periodic in [[false; 3], [true; 3], [false, true, false]] {
            let ends = [[0.0; 3], [1.0; 3]];
            let images = BoxImages::of_box(ends, periodic, &Face::ALL, 3.0).all();
            assert_eq!(images.len(), 9 * 9 * 9);
            for image in &images[1..] {
                let step = image.last_step(periodic).expect("an image");
                let n = image.before(step.face, periodic);
                let before = images.iter().find(|i| i.n == n).expect("it is nearer");
                assert_eq!(before.level() + 1, image.level());
                assert!(before.last_step(periodic) < Some(step), "{:?}", image.n);
            }
        }
    }
}
