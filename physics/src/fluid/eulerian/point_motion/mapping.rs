//! The mapping of the lattice at each point, from the displacement of the cells.

use nalgebra::{Matrix3, Vector3};
use perimelt_core::family::Mirrored;
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::{Bond, BondKernel, Family, SlotField};
use rayon::prelude::*;

use super::PointMotion;
use crate::fluid::rates::POINTS_PER_TASK;
use crate::shape_tensor::{COMPONENTS, components, is_diagonal};

/// The mapping at a point of the fluid.
#[derive(Clone, Debug)]
pub(crate) struct Mapped {
    /// m/s.
    pub(crate) velocity: Vector3<f64>,
    /// F.
    pub(crate) gradient: Matrix3<f64>,
    /// C.
    pub(crate) cofactors: Matrix3<f64>,
    /// J.
    pub(crate) volume: f64,
    /// Q with which weights `w (1 + n . Q n)` of bonds along n give the tensor K.
    pub(crate) stretch: [f64; 6],
    /// Least of J and of the factors `1 + n . Q n`.
    pub(crate) distortion: f64,
}

/// The bonds of a complete family.
struct CompleteBonds<'a> {
    dimension: usize,
    /// [`PointMotion::fourth_moment`].
    fourth_moment: f64,
    directions: &'a [Vector3<f64>],
}

/// `(1/a) sum w xi_B (f_j - f_i)` of `I` fields.
struct Gradient<const D: usize> {
    /// `1/a`, 1/m.
    inverse: f64,
}

impl<const D: usize, const I: usize, const O: usize> BondKernel<I, O> for Gradient<D> {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; I], other: [f64; I]) -> [f64; O] {
        let weight = bond.weight * self.inverse;
        std::array::from_fn(|n| weight * bond.xi[n % D] * (other[n / D] - own[n / D]))
    }
}

/// `(1/a) sum w xi_B (T_j - T_i)` with `T_aAB = sum 1/2 e_abc e_ABC u_b G_cC`, from u and G: the part of the cofactors that is of
/// second order.
struct SecondOrder {
    inverse: f64,
}

impl SecondOrder {
    /// Where the nine components of G begin among the inputs, after those of u.
    const GRADIENT: usize = 3;
    const INPUTS: usize = Self::GRADIENT + Self::SUMS;
    /// The components of T.
    const SUMS: usize = 9;
}

impl BondKernel<{ SecondOrder::INPUTS }, { SecondOrder::SUMS }> for SecondOrder {
    #[inline(always)]
    fn bond(
        &self,
        bond: &Bond,
        own: [f64; SecondOrder::INPUTS],
        other: [f64; SecondOrder::INPUTS],
    ) -> [f64; SecondOrder::SUMS] {
        let half = 0.5 * bond.weight * self.inverse;
        let product = |b: usize, c: usize, at: usize| {
            let of = |end: &[f64; Self::INPUTS]| end[b] * end[Self::GRADIENT + 3 * c + at];
            of(&other) - of(&own)
        };
        // even permutations (a, a1, a2) and (A, A1, A2)
        std::array::from_fn(|n| {
            let (a, axis) = (n / 3, n % 3);
            let (b, c) = ((a + 1) % 3, (a + 2) % 3);
            let (e, f) = ((axis + 1) % 3, (axis + 2) % 3);
            half * (bond.xi[e] * (product(b, c, f) - product(c, b, f))
                - bond.xi[f] * (product(b, c, e) - product(c, b, e)))
        })
    }
}

impl Default for Mapped {
    fn default() -> Self {
        Mapped {
            velocity: Vector3::zeros(),
            gradient: Matrix3::identity(),
            cofactors: Matrix3::identity(),
            volume: 1.0,
            stretch: [0.0; 6],
            distortion: 1.0,
        }
    }
}

impl PointMotion {
    /// Finds the mapping from u; `P = D * D`.
    pub(super) fn find_mapping<const D: usize, const P: usize>(&mut self) {
        let cells = self.displacement.len();
        for (axis, slots) in self.slots.iter_mut().enumerate() {
            let along = |cell: usize| self.displacement[cell][axis];
            slots.load(&self.family, along, Mirrored::Vector(axis));
        }
        let inverse = 1.0 / self.complete.moment;
        let inputs: [&[f64]; D] = std::array::from_fn(|a| &self.slots[a][..]);
        let mut gradient = vec![[0.0; P]; cells];
        self.family
            .sum(&Gradient::<D> { inverse }, inputs, &mut gradient);
        let mut second = Vec::new();
        if D == 3 {
            second = self.second_order(&gradient, inverse);
        }
        let complete = CompleteBonds {
            dimension: D,
            fourth_moment: self.fourth_moment(),
            directions: &self.directions,
        };
        let points = self.points.par_iter_mut().zip(&self.cell);
        points
            .with_min_len(POINTS_PER_TASK)
            .for_all(|(mapped, cell)| {
                let own = &gradient[*cell as usize];
                let mut slope = Matrix3::zeros();
                (0..P).for_each(|n| slope[(n / D, n % D)] = own[n]);
                let mut cofactors = Matrix3::identity() * (1.0 + slope.trace()) - slope.transpose();
                if let Some(second) = second.get(*cell as usize) {
                    (0..9).for_each(|n| cofactors[(n / 3, n % 3)] += second[n]);
                }
                mapped.set(slope, cofactors, &complete);
            });
    }

    /// The part of the cofactors that is of second order, by cell.
    fn second_order<const P: usize>(
        &self,
        gradient: &[[f64; P]],
        inverse: f64,
    ) -> Vec<[f64; SecondOrder::SUMS]> {
        let mut slots: [SlotField; P] = std::array::from_fn(|_| SlotField::default());
        for (n, slots) in slots.iter_mut().enumerate() {
            let component = |cell: usize| gradient[cell][n];
            slots.load(&self.family, component, Mirrored::Tensor(n / 3, n % 3));
        }
        let inputs: [&[f64]; SecondOrder::INPUTS] = std::array::from_fn(|n| match n {
            0..SecondOrder::GRADIENT => &self.slots[n][..],
            _ => &slots[n - SecondOrder::GRADIENT],
        });
        let mut sums = vec![[0.0; SecondOrder::SUMS]; self.displacement.len()];
        self.family.sum(&SecondOrder { inverse }, inputs, &mut sums);
        sums
    }

    /// `sum w xi_x^2 xi_y^2 / xi^2` of a complete family over its moment.
    fn fourth_moment(&self) -> f64 {
        let mut sum = 0.0;
        self.family.for_each_bond(self.complete.point, |_, b, _| {
            sum += b.weight * (b.xi[0] * b.xi[1] * b.inverse_length).powi(2);
        });
        sum / self.complete.moment
    }

    /// Copies cofactors and stretch to the slots of the fluid.
    pub(super) fn fill_slots(&mut self, family: &Family) {
        let d = self.dimension;
        self.cofactors.resize(d * d, SlotField::default());
        self.stretch.resize(components(d), SlotField::default());
        for (n, slots) in self.cofactors.iter_mut().enumerate() {
            let (a, b) = (n / d, n % d);
            let cofactor = |point: usize| self.points[point].cofactors[(a, b)];
            slots.load(family, cofactor, Mirrored::Tensor(a, b));
        }
        for (n, (slots, &(a, b))) in self.stretch.iter_mut().zip(&COMPONENTS).enumerate() {
            let stretch = |point: usize| self.points[point].stretch[n];
            slots.load(family, stretch, Mirrored::Tensor(a, b));
        }
    }
}

impl Mapped {
    /// Sets the mapping from `grad u` and C.
    fn set(&mut self, slope: Matrix3<f64>, cofactors: Matrix3<f64>, complete: &CompleteBonds<'_>) {
        let (dimension, fourth) = (complete.dimension, complete.fourth_moment);
        self.gradient = Matrix3::identity() + slope;
        self.cofactors = cofactors;
        self.volume = self.gradient.determinant();
        let tensor = cofactors.transpose() * cofactors / self.volume;
        let trace: f64 = (0..dimension).map(|a| tensor[(a, a)] - 1.0).sum();
        // sum w xi_a xi_b n.Qn over a complete family, for Q
        let along = 1.0 - (dimension as f64 - 1.0) * fourth;
        let mut matrix = Matrix3::zeros();
        for (n, &(a, b)) in COMPONENTS[..components(dimension)].iter().enumerate() {
            self.stretch[n] = match is_diagonal(n) {
                true => (tensor[(a, a)] - 1.0 - fourth * trace) / (along - fourth),
                false => tensor[(a, b)] / (2.0 * fourth),
            };
            (matrix[(a, b)], matrix[(b, a)]) = (self.stretch[n], self.stretch[n]);
        }
        let factor = |n: &Vector3<f64>| 1.0 + n.dot(&(matrix * n));
        let factors = complete.directions.iter().map(factor);
        self.distortion = factors.fold(self.volume, f64::min);
    }
}
