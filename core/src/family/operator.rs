//! Sums of a kernel over scalar fields, with the arrays that they need, for simple
//! physics. The hot kernels of `thermal` and `mechanical` pack their inputs
//! themselves.

use std::sync::Arc;

use super::{BondKernel, Family, Mirrored, SlotField};

/// Sums of kernels with `I` inputs and `O` sums over one family; layers mirror every input.
#[derive(Debug)]
pub struct Operator<const I: usize, const O: usize> {
    family: Arc<Family>,
    slots: [SlotField; I],
    sums: Vec<[f64; O]>,
}

impl<const I: usize, const O: usize> Operator<I, O> {
    /// An operator over `family`.
    pub fn new(family: Arc<Family>) -> Self {
        Operator {
            slots: std::array::from_fn(|_| SlotField::zeros(&family)),
            sums: vec![[0.0; O]; family.points],
            family,
        }
    }

    /// For every point, the sum of `kernel` over its bonds; `inputs` by point.
    pub fn sum(&mut self, kernel: &impl BondKernel<I, O>, inputs: [&[f64]; I]) -> &[[f64; O]] {
        for (slots, input) in self.slots.iter_mut().zip(inputs) {
            slots.load(&self.family, input, Mirrored::Scalar);
        }
        let slots = self.slots.each_ref().map(|s| &s[..]);
        self.family.sum(kernel, slots, &mut self.sums);
        &self.sums
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shape::{BoxShape, Shape};
    use crate::{Body, Bond, FamilySpec};

    struct Conduction;

    impl BondKernel<1, 1> for Conduction {
        fn bond(&self, bond: &Bond, [own]: [f64; 1], [other]: [f64; 1]) -> [f64; 1] {
            [2.0 * bond.mean() * bond.inverse_length * (other - own)]
        }
    }

    #[test]
    fn sums_are_the_laplacian_inside_and_vanish_in_total_behind_mirrored_faces() {
        let (min, max) = ([0.0; 3], [12.0, 5.0, 5.0]);
        let shape = Shape::Box(BoxShape { min, max });
        let body = Body::fill("block", &shape, 3, 1.0, 1.0).expect("a valid block");
        let spec = FamilySpec::mirrored(&body, 2.0);
        let family = Arc::new(Family::build(&body, &spec).expect("it has neighbours"));
        let square: Vec<f64> = body.points.position.iter().map(|x| x.x * x.x).collect();
        let sums = Operator::new(family).sum(&Conduction, [&square]).to_vec();
        for (x, [sum]) in body.points.position.iter().zip(&sums) {
            // bonds of two spacings reach a layer from closer points
            if x.x > 2.0 && x.x < 10.0 {
                assert!((sum - 2.0).abs() < 1e-12, "calibrated to rounding");
            }
        }
        let total: f64 = sums.iter().map(|[s]| s).sum();
        assert!(total.abs() < 1e-10, "pairs cancel to rounding: {total}");
    }
}
