//! Sums of derivatives of fields: gradient, Laplacian and divergence.

use rayon::prelude::*;

use super::basis::{monomials, with_basis};
use super::{Derivatives, Pddo, second};
use crate::family::{Bond, BondKernel, SlotField};
use crate::parallel::ParallelLoop;

/// `O` sums of derivatives of `I` fields where all points share an inverse.
struct Contraction<const D: usize, const N: usize, const I: usize, const O: usize> {
    /// Factors of the moments of each field in each sum.
    rows: [[[f64; N]; I]; O],
}

impl<const D: usize, const N: usize, const I: usize, const O: usize> BondKernel<I, O>
    for Contraction<D, N, I, O>
{
    /// Physics need second order; of the sums of first order there are gradient and divergence only.
    const RARE: bool = match (D, N) {
        (2, 5) | (3, 9) => false,
        (2, 2) | (3, 3) => I * O != D,
        _ => true,
    };

    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; I], other: [f64; I]) -> [f64; O] {
        let monomials = monomials::<D, N>(&bond.xi);
        let difference: [f64; I] = std::array::from_fn(|i| bond.weight * (other[i] - own[i]));
        std::array::from_fn(|o| {
            let part = |i: usize| {
                let share = (0..N)
                    .map(|r| self.rows[o][i][r] * monomials[r])
                    .sum::<f64>();
                share * difference[i]
            };
            (0..I).map(part).sum()
        })
    }
}

/// Places of the first derivatives.
const FIRST: [&[usize]; 3] = [&[0], &[1], &[2]];

impl Pddo {
    /// The first derivatives of a field, whose values by slot are `field`, one row for each point. Like the other sums
    /// of derivatives, faster than all derivatives where points share their stencil. `work` holds intermediate results.
    ///
    /// # Panics
    /// See [`Pddo::differentiate`].
    pub fn gradient(&self, field: &[f64], work: &mut Derivatives, rows: &mut Vec<f64>) {
        let [x, y, z] = FIRST.map(|derivative| [derivative]);
        match self.dimension {
            1 => self.contract::<1, _, _>([field], [x], work, rows),
            2 => self.contract::<2, _, _>([field], [x, y], work, rows),
            _ => self.contract::<3, _, _>([field], [x, y, z], work, rows),
        }
    }

    /// [`Pddo::gradient`], and after it in each row the sum of the second derivatives along the axes.
    ///
    /// # Panics
    /// See [`Pddo::differentiate`]; also when the operator is of first order.
    pub fn gradient_and_laplacian(
        &self,
        field: &[f64],
        work: &mut Derivatives,
        rows: &mut Vec<f64>,
    ) {
        let [x, y, z] = FIRST.map(|derivative| [derivative]);
        let along = self.along_axes();
        let laplacian = [&along[..self.dimension]];
        match self.dimension {
            1 => self.contract::<1, _, _>([field], [x, laplacian], work, rows),
            2 => self.contract::<2, _, _>([field], [x, y, laplacian], work, rows),
            _ => self.contract::<3, _, _>([field], [x, y, z, laplacian], work, rows),
        }
    }

    /// The sum of the second derivatives along the axes of a field, whose values by slot are `field`, at all
    /// points.
    ///
    /// # Panics
    /// See [`Pddo::gradient_and_laplacian`].
    pub fn laplacian(&self, field: &[f64], work: &mut Derivatives, laplacian: &mut Vec<f64>) {
        let along = self.along_axes();
        let derivatives = [[&along[..self.dimension]]];
        match self.dimension {
            1 => self.contract::<1, _, _>([field], derivatives, work, laplacian),
            2 => self.contract::<2, _, _>([field], derivatives, work, laplacian),
            _ => self.contract::<3, _, _>([field], derivatives, work, laplacian),
        }
    }

    /// [`Pddo::gradient`] with differences that count with the mean of a coefficient of both ends in series, by slot.
    ///
    /// # Panics
    /// See [`Pddo::differentiate`].
    pub fn gradient_in_series(
        &self,
        field: &[f64],
        coefficient: &[f64],
        work: &mut Derivatives,
        rows: &mut Vec<f64>,
    ) {
        self.differentiate_in_series(field, coefficient, work);
        rows.resize(self.dimension * self.points(), 0.0);
        let points = rows.par_chunks_exact_mut(self.dimension).enumerate();
        let points = points.with_min_len(1024);
        points.for_all(|(point, row)| row.copy_from_slice(&work.at(point)[..self.dimension]));
    }

    /// [`Pddo::laplacian`] with differences that count with the mean of a coefficient of both ends in series, by slot.
    ///
    /// # Panics
    /// See [`Pddo::gradient_and_laplacian`].
    pub fn laplacian_in_series(
        &self,
        field: &[f64],
        coefficient: &[f64],
        work: &mut Derivatives,
        laplacian: &mut Vec<f64>,
    ) {
        assert!(self.order > 1, "an operator of second order");
        self.differentiate_in_series(field, coefficient, work);
        let points = (0..self.points()).into_par_iter().with_min_len(1024);
        let points = points.map(|point| work.laplacian(point));
        points.fill(laplacian);
    }

    /// The divergence at all points of a vector field, whose values by slot are `field`, one array for each
    /// axis.
    ///
    /// # Panics
    /// When an array of `field` is not `Family::slots` long, or there is not one for each axis.
    pub fn divergence(
        &self,
        field: &[SlotField],
        work: &mut Derivatives,
        divergence: &mut Vec<f64>,
    ) {
        assert_eq!(field.len(), self.dimension, "components");
        let [a, b, c] = FIRST;
        match field {
            [x] => self.contract::<1, _, _>([x], [[a]], work, divergence),
            [x, y] => self.contract::<2, _, _>([x, y], [[a, b]], work, divergence),
            [x, y, z] => self.contract::<3, _, _>([x, y, z], [[a, b, c]], work, divergence),
            _ => unreachable!("of up to three axes"),
        }
    }

    /// The first derivatives of the divergence of a vector field, one row for each point.
    ///
    /// # Panics
    /// See [`Pddo::divergence`]; also when the operator is of first order.
    pub fn gradient_of_divergence(
        &self,
        field: &[SlotField],
        work: &mut Derivatives,
        rows: &mut Vec<f64>,
    ) {
        assert_eq!(field.len(), self.dimension, "components");
        let all: [[[usize; 1]; 3]; 3] =
            std::array::from_fn(|a| std::array::from_fn(|b| [self.second(a, b)]));
        let [a, b, c] = all.each_ref().map(|row| row.each_ref().map(|at| &at[..]));
        match field {
            [x] => self.contract::<1, _, _>([x], [[a[0]]], work, rows),
            [x, y] => self.contract::<2, _, _>([x, y], [[a[0], a[1]], [b[0], b[1]]], work, rows),
            [x, y, z] => self.contract::<3, _, _>([x, y, z], [a, b, c], work, rows),
            _ => unreachable!("of up to three axes"),
        }
    }

    /// Place of the derivative along axes `a` and `b`.
    fn second(&self, a: usize, b: usize) -> usize {
        assert!(self.order > 1, "an operator of second order");
        second(self.dimension, a, b)
    }

    /// Places of the second derivatives along the axes.
    fn along_axes(&self) -> [usize; 3] {
        std::array::from_fn(|a| self.second(a, a))
    }

    /// Sums of derivatives in `D` dimensions, given by their places for each field; one row for each point.
    fn contract<const D: usize, const I: usize, const O: usize>(
        &self,
        fields: [&[f64]; I],
        derivatives: [[&[usize]; I]; O],
        work: &mut Derivatives,
        rows: &mut Vec<f64>,
    ) {
        rows.resize(O * self.inverse_of_point.len(), 0.0);
        let (rows, _) = rows.as_chunks_mut::<O>();
        if let [_] = self.point_of_inverse[..] {
            with_basis!(const D, self.order, |N| {
                let (columns, _) = self.inverse.as_chunks::<N>();
                let share = |of: &[usize], r: usize| of.iter().map(|&q| columns[r][q]).sum();
                let shares =
                    derivatives.map(|of| of.map(|of| std::array::from_fn(|r| share(of, r))));
                let kernel = Contraction::<D, N, I, O> { rows: shares };
                self.family.sum(&kernel, fields, rows);
            });
            return;
        }
        rows.fill([0.0; O]);
        for (i, field) in fields.into_iter().enumerate() {
            self.differentiate(field, work);
            let points = rows.par_iter_mut().enumerate().with_min_len(1024);
            points.for_all(|(point, row)| {
                let all = work.at(point);
                for (sum, of) in row.iter_mut().zip(&derivatives) {
                    *sum += of[i].iter().map(|&q| all[q]).sum::<f64>();
                }
            });
        }
    }
}
