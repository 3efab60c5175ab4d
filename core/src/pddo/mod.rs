//! The peridynamic differential operator (PDDO): derivatives of fields as sums over families.
//!
//! ```text
//! D^n f (x_i) = sum_j (f_j - f_i) g^n(xi_ij) V_j,    g^n = w sum_q a^n_q p_q       Gao (2020), eqs. 2.22, 2.23
//! A a^n = n! e_n,    A = sum_j w p p^T V_j                                        eqs. 2.27, 2.28
//! ```
//!
//! `p` are the monomials of the bond up to the order of the operator, `n` the exponents of one of them,
//! `w V_j` the weight of the bond in its family, of which a common factor cancels. As A belongs to
//! the point, the sums are evaluated as `D^n f = n! e_n . A^-1 sum_j w p (f_j - f_i) V_j`: the kernel needs
//! the bond only, whatever the store of the family. Derivatives are exact for polynomials up to the
//! order on any family that determines them.

mod basis;
mod derivatives;
mod sums;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use nalgebra::{SMatrix, Vector3};
use rayon::prelude::*;

use crate::body::{Body, Horizon};
use crate::cell_list::CellList;
use crate::family::{Bond, BondKernel, Correction, Family, FamilySpec, Influence, PartialVolume};
use crate::parallel::ParallelLoop;
pub use basis::second;
use basis::{exponents, monomials, with_basis};
pub use derivatives::Derivatives;

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

/// The operator for all points of a family.
#[derive(Debug)]
pub struct Pddo {
    family: Arc<Family>,
    dimension: usize,
    order: usize,
    exponents: Vec<[u8; 3]>,
    /// `n! A^-1`, column by column; the first applies to all points that share their stencil.
    inverse: Vec<f64>,
    /// Which inverse belongs to each point.
    inverse_of_point: Vec<u32>,
    /// The point, or one of them, to which each inverse belongs.
    point_of_inverse: Vec<u32>,
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

/// [`Moments`] with differences that count with the mean of a coefficient of both ends in series.
struct MomentsInSeries<const D: usize, const N: usize>;

impl<const D: usize, const N: usize> BondKernel<2, N> for MomentsInSeries<D, N> {
    const RARE: bool = !matches!((D, N), (2, 5) | (3, 9));

    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; 2], other: [f64; 2]) -> [f64; N] {
        let mean = 2.0 * own[1] * other[1] / (own[1] + other[1] + f64::MIN_POSITIVE);
        let difference = bond.weight * mean * (other[0] - own[0]);
        monomials::<D, N>(&bond.xi).map(|p| p * difference)
    }
}

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
        // points of other processes have no bonds here, and derivatives of zero
        let points = 0..family.points() as u32;
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

    /// Computes the inverses for the current family, of points at these positions (m).
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

    /// Computes the operator on another family of these points, which lie at `positions` (m) now. The previous family is
    /// released before `family` is called, so that its owner can update it in place.
    ///
    /// # Errors
    /// See [`Pddo::build`].
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
        self.prepare(derivatives);
        with_basis!(self.dimension, self.order, |D, N| {
            let (sums, _) = derivatives.values.as_chunks_mut::<N>();
            self.family.sum(&Moments::<D, N>, [field], sums);
            self.solve(sums);
        });
    }

    /// All derivatives of a field whose differences count with the mean of a coefficient of both ends in series,
    /// `sum_j 2 c_i c_j/(c_i + c_j) (f_j - f_i) g^n V_j`: the flux through an interface at which the coefficient jumps.
    fn differentiate_in_series(
        &self,
        field: &[f64],
        coefficient: &[f64],
        derivatives: &mut Derivatives,
    ) {
        self.prepare(derivatives);
        with_basis!(self.dimension, self.order, |D, N| {
            let (sums, _) = derivatives.values.as_chunks_mut::<N>();
            let inputs = [field, coefficient];
            self.family.sum(&MomentsInSeries::<D, N>, inputs, sums);
            self.solve(sums);
        });
    }

    /// Gives the derivatives their size.
    fn prepare(&self, derivatives: &mut Derivatives) {
        let number = self.exponents.len();
        derivatives.dimension = self.dimension;
        derivatives.exponents.clone_from(&self.exponents);
        let size = number * self.inverse_of_point.len();
        derivatives.values.resize(size, 0.0);
    }

    /// Turns moments into derivatives.
    fn solve<const N: usize>(&self, moments: &mut [[f64; N]]) {
        let (columns, _) = self.inverse.as_chunks::<N>();
        let (inverses, _) = columns.as_chunks::<N>();
        let points = moments.par_iter_mut().zip(&self.inverse_of_point);
        points.with_min_len(1024).for_all(|(sums, &inverse)| {
            *sums = times(&inverses[inverse as usize], sums);
        });
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
                let xi = place - body.points.position.at(point);
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

/// Largest wave number that a gradient makes of a plane wave along an axis or a diagonal, 1/m
/// (docs/theory/fluids.md, "Numbers of the square lattice"). `bonds` passes those of a symmetric family with their parts of the gradient, 1/m.
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
