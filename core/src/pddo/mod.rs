//! The peridynamic differential operator (PDDO): derivatives of fields as sums over families.
//!
//! ```text
//! D^n f (x_i) = sum_j (f_j - f_i) g^n(xi_ij) V_j,    g^n = w sum_q a^n_q p_q       Gao (2020), eqs. 2.22, 2.23
//! A a^n = n! e_n,    A = sum_j w p p^T V_j                                        eqs. 2.27, 2.28
//! ```
//!
//! `p` are the monomials of the bond up to the order of the operator, `n` the exponents of one of them,
//! `w V_j` the weight of the bond in its family, of which a factor common to all cancels. As A belongs to
//! the point, the sums are evaluated as `D^n f = n! e_n . A^-1 sum_j w p (f_j - f_i) V_j`: the kernel needs
//! nothing but the bond, whatever the store of the family. Derivatives are exact for polynomials up to the
//! order on any family that determines them.

mod basis;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use nalgebra::{Matrix3, SMatrix, Vector3};
use rayon::prelude::*;

use crate::body::Body;
use crate::body::Horizon;
use crate::cell_list::CellList;
use crate::family::{
    Bond, BondKernel, Correction, Family, FamilySpec, Influence, PartialVolume, SlotField,
};
use basis::{exponents, monomials};

/// A family does not determine the derivatives at its point.
#[derive(Debug, thiserror::Error)]
pub enum PddoError {
    /// Too few members, or members in a line or plane.
    #[error(
        "the {bonds} neighbours of the point at ({}, {}, {}) m do not determine the derivatives of order \
         {order} there: choose a larger horizon",
        at[0], at[1], at[2]
    )]
    Degenerate {
        /// Members of the family.
        bonds: usize,
        /// Order of the operator.
        order: usize,
        /// Position, m.
        at: [f64; 3],
    },
    /// No operator of that order.
    #[error("derivatives of order {0} are not available; orders are 1 to 4")]
    Order(usize),
}

/// Pivot of the moment matrix, with ones on its diagonal, below which a family counts as degenerate.
const SMALLEST_PIVOT: f64 = 1e-12;

/// Evaluates `$body` with `$D` and `$N`, the number of monomials, as constants. Where the dimension is a constant
/// already (`const D`), `$body` is compiled for no other.
macro_rules! with_basis {
    (const $D:ident, $order:expr, |$N:ident| $body:expr) => {
        with_basis!(@table constant $D, $order, $N, $body)
    };
    ($dimension:expr, $order:expr, |$D:ident, $N:ident| $body:expr) => {
        with_basis!(@table variable $dimension, $order, $D, $N, $body)
    };
    (@table $kind:ident $($arguments:tt)*) => {
        with_basis!(@$kind $($arguments)*;
            (1, 1, 1), (1, 2, 2), (1, 3, 3), (1, 4, 4),
            (2, 1, 2), (2, 2, 5), (2, 3, 9), (2, 4, 14),
            (3, 1, 3), (3, 2, 9), (3, 3, 19), (3, 4, 34))
    };
    (@variable $dimension:expr, $order:expr, $D:ident, $N:ident, $body:expr; $(($d:literal, $o:literal, $n:literal)),*) => {
        match ($dimension, $order) {
            $(($d, $o) => {
                const $D: usize = $d;
                const $N: usize = $n;
                $body
            })*
            _ => unreachable!("the order was checked when the operator was built"),
        }
    };
    (@constant $D:ident, $order:expr, $N:ident, $body:expr; $(($d:literal, $o:literal, $n:literal)),*) => {
        match $order {
            $($o if const { $D == $d } => {
                const $N: usize = $n;
                $body
            })*
            _ => unreachable!("the order was checked when the operator was built"),
        }
    };
}

/// The operator for all points of a family.
#[derive(Debug)]
pub struct Pddo {
    family: Arc<Family>,
    dimension: usize,
    order: usize,
    exponents: Vec<[u8; 3]>,
    /// `n! A^-1`, column by column; the first for all points that share their stencil.
    inverse: Vec<f64>,
    /// Which inverse belongs to each point.
    inverse_of_point: Vec<u32>,
    /// The point, or one of them, to which each inverse belongs.
    point_of_inverse: Vec<u32>,
}

/// Derivatives of one field at all points.
#[derive(Clone, Debug, Default)]
pub struct Derivatives {
    dimension: usize,
    exponents: Vec<[u8; 3]>,
    values: Vec<f64>,
}

struct Moments<const D: usize, const N: usize>;

impl<const D: usize, const N: usize> BondKernel<1, N> for Moments<D, N> {
    const RARE: bool = !matches!((D, N), (2, 2 | 5) | (3, 3 | 9));

    #[inline(always)]
    fn bond(&self, bond: &Bond, [own]: [f64; 1], [other]: [f64; 1]) -> [f64; N] {
        let difference = bond.weight * (other - own);
        monomials::<D, N>(&bond.xi).map(|p| p * difference)
    }
}

/// `O` sums of derivatives of `I` fields where all points share an inverse.
struct Contraction<const D: usize, const N: usize, const I: usize, const O: usize> {
    /// What the moments of each field count in each sum.
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

/// Columns of `n! A^-1` of a point; `None` where its family is degenerate.
fn inverse_of<const D: usize, const N: usize>(
    family: &Family,
    point: usize,
    exponents: &[[u8; 3]],
) -> Option<[[f64; N]; N]> {
    let mut moments = SMatrix::<f64, N, N>::zeros();
    family.for_each_bond(point, |_, bond, _| {
        // members in the skin of a moving family
        if bond.weight == 0.0 {
            return;
        }
        let p = monomials::<D, N>(&bond.xi);
        for q in 0..N {
            for r in 0..=q {
                moments[(q, r)] += bond.weight * p[q] * p[r];
            }
        }
    });
    // ones on the diagonal: lengths have no part in the condition
    let scale: [f64; N] = std::array::from_fn(|q| moments[(q, q)].sqrt().recip());
    if scale.iter().any(|s| !s.is_finite()) {
        return None;
    }
    for q in 0..N {
        for r in 0..=q {
            moments[(q, r)] *= scale[q] * scale[r];
        }
    }
    let cholesky = moments.cholesky()?;
    if (0..N).any(|q| cholesky.l_dirty()[(q, q)].powi(2) < SMALLEST_PIVOT) {
        return None;
    }
    let inverse = cholesky.inverse();
    let factorial = |e: &[u8; 3]| {
        e.iter()
            .flat_map(|&e| 1..=e)
            .map(f64::from)
            .product::<f64>()
    };
    Some(std::array::from_fn(|r| {
        std::array::from_fn(|q| factorial(&exponents[q]) * scale[q] * inverse[(q, r)] * scale[r])
    }))
}

/// `n! A^-1` times the moments of a field; in columns, so that all derivatives grow side by side.
#[inline(always)]
fn times<const N: usize>(columns: &[[f64; N]; N], moments: &[f64; N]) -> [f64; N] {
    let mut sums = [0.0; N];
    for (column, moment) in columns.iter().zip(moments) {
        for q in 0..N {
            sums[q] += column[q] * moment;
        }
    }
    sums
}

impl Pddo {
    /// The family of the published operator: Gaussian influence, partial volumes, nothing corrected, and
    /// `horizon` in spacings of each point (3.015 in most of Gao (2020)).
    pub fn spec(horizon: Horizon) -> FamilySpec {
        FamilySpec {
            horizon,
            partial_volume: PartialVolume::Half,
            influence: Influence::Gaussian,
            correction: Correction::None,
            ..FamilySpec::new(0.0)
        }
    }

    /// The operator up to derivatives of `order` (1 to 4) on a family of `body`.
    ///
    /// # Errors
    /// [`PddoError`] that names the point whose family is degenerate.
    pub fn build(body: &Body, family: Arc<Family>, order: usize) -> Result<Pddo, PddoError> {
        if !(1..=4).contains(&order) {
            return Err(PddoError::Order(order));
        }
        let points = 0..body.points.len() as u32;
        let shares = |p: &u32| family.shares_stencil(*p as usize);
        let shared = points.clone().find(shares);
        let own = points.filter(|p| !shares(p));
        let point_of_inverse: Vec<u32> = shared.into_iter().chain(own).collect();
        let mut inverse_of_point = vec![0; body.points.len()];
        for (index, &point) in point_of_inverse.iter().enumerate() {
            inverse_of_point[point as usize] = index as u32;
        }
        let exponents = exponents(body.dimension, order);
        let mut pddo = Pddo {
            inverse: vec![0.0; point_of_inverse.len() * exponents.len().pow(2)],
            dimension: body.dimension,
            order,
            exponents,
            inverse_of_point,
            point_of_inverse,
            family,
        };
        pddo.invert(&body.points.position)?;
        Ok(pddo)
    }

    /// Finds the inverses for the family as it is, of points at these positions (m).
    fn invert(&mut self, positions: &[Vector3<f64>]) -> Result<(), PddoError> {
        let (family, exponents) = (&*self.family, &self.exponents[..]);
        let points = &self.point_of_inverse;
        // the first one: which point an error names must not depend on the threads
        let lost = with_basis!(self.dimension, self.order, |D, N| {
            let (columns, _) = self.inverse.as_chunks_mut::<N>();
            let (inverses, _) = columns.as_chunks_mut::<N>();
            let invert = |(index, (inverse, &point)): (usize, (&mut [[f64; N]; N], &u32))| {
                let found = inverse_of::<D, N>(family, point as usize, exponents);
                found.map_or(index, |found| {
                    *inverse = found;
                    usize::MAX
                })
            };
            let all = inverses.par_iter_mut().zip(points).enumerate();
            let all = all.with_min_len(64).map(invert);
            all.reduce(|| usize::MAX, usize::min)
        });
        let Some(&point) = points.get(lost) else {
            return Ok(());
        };
        Err(PddoError::Degenerate {
            bonds: family.bonds_of(point as usize),
            order: self.order,
            at: positions[point as usize].into(),
        })
    }

    /// Lets the points of a moving family be where they are now (m), with these volumes (m³), and finds the
    /// operator there.
    ///
    /// # Errors
    /// As [`Pddo::build`].
    ///
    /// # Panics
    /// When the family does not move or is shared.
    pub fn follow(&mut self, positions: &[Vector3<f64>], volumes: &[f64]) -> Result<(), PddoError> {
        let family = Arc::get_mut(&mut self.family).expect("a moving family has one owner");
        family.follow(positions, volumes);
        self.invert(positions)
    }

    /// Finds the operator on another family of the same points, which lie at these positions (m) now. The family so
    /// far is released before `family` is called, so that its owner can update it in place.
    ///
    /// # Errors
    /// As [`Pddo::build`].
    pub fn rebuild(
        &mut self,
        positions: &[Vector3<f64>],
        family: impl FnOnce() -> Arc<Family>,
    ) -> Result<(), PddoError> {
        self.family = Arc::default();
        self.family = family();
        self.invert(positions)
    }

    /// Number of points.
    pub fn points(&self) -> usize {
        self.inverse_of_point.len()
    }

    /// The family over which sums are taken.
    pub fn family(&self) -> &Arc<Family> {
        &self.family
    }

    /// All derivatives of a field, whose values by slot are `field`, at all points.
    ///
    /// # Panics
    /// When `field` is not [`Family::slots`] long.
    pub fn differentiate(&self, field: &[f64], derivatives: &mut Derivatives) {
        let number = self.exponents.len();
        derivatives.dimension = self.dimension;
        derivatives.exponents.clone_from(&self.exponents);
        let size = number * self.inverse_of_point.len();
        derivatives.values.resize(size, 0.0);
        with_basis!(self.dimension, self.order, |D, N| {
            let (sums, _) = derivatives.values.as_chunks_mut::<N>();
            let (columns, _) = self.inverse.as_chunks::<N>();
            let (inverses, _) = columns.as_chunks::<N>();
            self.family.sum(&Moments::<D, N>, [field], sums);
            let points = sums.par_iter_mut().zip(&self.inverse_of_point);
            points.with_min_len(1024).for_each(|(sums, &inverse)| {
                *sums = times(&inverses[inverse as usize], sums);
            });
        });
    }

    /// The first derivatives of a field, whose values by slot are `field`, one row for each point; as the other sums
    /// of derivatives below faster than all derivatives where points share their stencil. `work` keeps what is
    /// needed on the way.
    ///
    /// # Panics
    /// As [`Pddo::differentiate`].
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
    /// As [`Pddo::differentiate`], or when the operator is of first order.
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
    /// As [`Pddo::gradient_and_laplacian`].
    pub fn laplacian(&self, field: &[f64], work: &mut Derivatives, laplacian: &mut Vec<f64>) {
        let along = self.along_axes();
        let derivatives = [[&along[..self.dimension]]];
        match self.dimension {
            1 => self.contract::<1, _, _>([field], derivatives, work, laplacian),
            2 => self.contract::<2, _, _>([field], derivatives, work, laplacian),
            _ => self.contract::<3, _, _>([field], derivatives, work, laplacian),
        }
    }

    /// The divergence at all points of a vector field, whose values by slot are `field`, one array for each
    /// axis.
    ///
    /// # Panics
    /// When an array of `field` is not [`Family::slots`] long, or there is not one for each axis.
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
    /// As [`Pddo::divergence`], or when the operator is of first order.
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
            points.for_each(|(point, row)| {
                let all = work.at(point);
                for (sum, of) in row.iter_mut().zip(&derivatives) {
                    *sum += of[i].iter().map(|&q| all[q]).sum::<f64>();
                }
            });
        }
    }

    /// Passes slot of the other end and `g^n V` of every bond of a point to `receive`, with the functions in
    /// the order of [`Pddo::exponents`], 1/m to the power of the derivative.
    pub fn for_each_bond(&self, point: usize, mut receive: impl FnMut(&Bond, usize, &[f64])) {
        with_basis!(self.dimension, self.order, |D, N| {
            let (columns, _) = self.inverse.as_chunks::<N>();
            let (inverses, _) = columns.as_chunks::<N>();
            let inverse = &inverses[self.inverse_of_point[point] as usize];
            self.family.for_each_bond(point, |_, bond, slot| {
                let g = times(inverse, &monomials::<D, N>(&bond.xi)).map(|g| bond.weight * g);
                receive(bond, slot, &g);
            });
        });
    }

    /// Number of axes.
    pub fn dimension(&self) -> usize {
        self.dimension
    }

    /// Exponents of the derivatives, by axis.
    pub fn exponents(&self) -> &[[u8; 3]] {
        &self.exponents
    }

    /// `sum_j Tr g2 V_j` of a point, 1/m²: explicit diffusion is stable up to the reciprocal of it times the
    /// diffusivity (docs/theory/fluids.md, "Numbers of the square lattice"). Zero for an operator of first order.
    pub fn laplacian_sum(&self, point: usize) -> f64 {
        let mut sum = 0.0;
        self.for_each_bond(point, |_, _, g| {
            let along = |a: usize| g.get(second(self.dimension, a, a)).copied();
            sum += (0..self.dimension).filter_map(along).sum::<f64>();
        });
        sum
    }

    /// Largest wave number that the gradient makes of a plane wave ([`largest_wave_number`]) at a point with a
    /// symmetric family, 1/m.
    pub fn largest_wave_number(&self, point: usize) -> f64 {
        largest_wave_number(self.dimension, |receive| {
            self.for_each_bond(point, |bond, _, g| {
                receive(
                    bond,
                    std::array::from_fn(|a| g.get(a).copied().unwrap_or(0.0)),
                );
            });
        })
    }

    /// Values at other places of a field with the given `values` and `derivatives` at the points of `body`:
    /// the mean of the Taylor series of all points within whose horizon a place lies (Gao (2020), eqs. 2.34,
    /// 2.35). `None` where there is no such point.
    pub fn interpolate(
        &self,
        body: &Body,
        values: &[f64],
        derivatives: &Derivatives,
        places: &[Vector3<f64>],
    ) -> Vec<Option<f64>> {
        let reach = body.points.horizons(self.family.spec().horizon);
        let list = CellList::new(&body.points.position, &reach);
        let at = |place: &Vector3<f64>| {
            let (mut sum, mut number) = (0.0, 0u32);
            list.visit_near(place, 0.0, |point| {
                let xi = place - body.points.position[point];
                if xi.norm() <= reach[point] {
                    sum += values[point] + derivatives.series(point, &xi);
                    number += 1;
                }
            });
            (number > 0).then(|| sum / f64::from(number))
        };
        places.par_iter().map(at).collect()
    }
}

/// Largest wave number that a gradient makes of a plane wave along an axis or a diagonal, 1/m (kappa of spec
/// 05, 1.1). `bonds` passes those of a symmetric family with their parts of the gradient, 1/m.
pub fn largest_wave_number(
    dimension: usize,
    bonds: impl FnOnce(&mut dyn FnMut(&Bond, [f64; 3])),
) -> f64 {
    const WAVES: u32 = 128;
    let (mut parts, mut shortest) = (Vec::new(), f64::INFINITY);
    bonds(&mut |bond, g| {
        shortest = bond.length.min(shortest);
        parts.push((Vector3::from(bond.xi), Vector3::from(g)));
    });
    let axes = (0..dimension).map(|a| Vector3::ith(a, 1.0));
    let diagonal = axes.clone().sum::<Vector3<f64>>().normalize();
    let mut largest = 0.0_f64;
    for direction in axes.chain([diagonal]) {
        for wave in 1..=WAVES {
            let number = std::f64::consts::PI * f64::from(wave) / (f64::from(WAVES) * shortest);
            let response = parts
                .iter()
                .map(|(xi, g)| g.dot(&direction) * (number * direction.dot(xi)).sin());
            largest = largest.max(response.sum::<f64>().abs());
        }
    }
    largest
}

/// Place of the derivative along axes `a` and `b` among those of a point, for operators of at least second
/// order.
#[inline(always)]
pub const fn second(dimension: usize, a: usize, b: usize) -> usize {
    let (low, high) = if a < b { (a, b) } else { (b, a) };
    // rows of an upper triangle, each one shorter than the one before
    dimension + low * (2 * dimension + 1 - low) / 2 + high - low
}

impl Derivatives {
    /// All derivatives at a point, in the order of [`Pddo::exponents`].
    #[inline]
    pub fn at(&self, point: usize) -> &[f64] {
        let number = self.exponents.len();
        &self.values[point * number..][..number]
    }

    /// First derivatives at a point.
    pub fn gradient(&self, point: usize) -> Vector3<f64> {
        let all = self.at(point);
        Vector3::from_fn(|a, _| if a < self.dimension { all[a] } else { 0.0 })
    }

    /// Second derivatives at a point; zero for an operator of first order.
    pub fn second(&self, point: usize) -> Matrix3<f64> {
        let all = self.at(point);
        Matrix3::from_fn(|a, b| match a.max(b) < self.dimension {
            true => all
                .get(second(self.dimension, a, b))
                .copied()
                .unwrap_or(0.0),
            false => 0.0,
        })
    }

    /// Sum of the second derivatives along the axes at a point.
    #[inline]
    pub fn laplacian(&self, point: usize) -> f64 {
        let all = self.at(point);
        let along = |a: usize| all.get(second(self.dimension, a, a)).copied();
        (0..self.dimension).filter_map(along).sum()
    }

    /// What the Taylor series adds to the value of a point at the distance `xi` (m) from it.
    fn series(&self, point: usize, xi: &Vector3<f64>) -> f64 {
        let term = |(e, derivative): (&[u8; 3], &f64)| {
            let axes = e.iter().zip(xi.iter());
            let power = |(&e, x): (&u8, &f64)| (1..=e).map(|n| x / f64::from(n)).product::<f64>();
            derivative * axes.map(power).product::<f64>()
        };
        self.exponents.iter().zip(self.at(point)).map(term).sum()
    }
}
