//! Displacement gradient by the shape tensor: exact for affine displacements on any family.
//!
//! ```text
//! H = [sum_j w (u_j - u_i) (x) xi] K^-1,   K = sum_j w xi (x) xi       Wang (2025), eqs. 3.15, 3.19
//! ```
//!
//! Sums run over unbroken bonds, so H stays exact beside cracks. A point whose bonds are too few for that is
//! *loose*: its `K^-1` and its H are zero. In a body that grows, a point without material is loose, and so is one whose
//! neighbours were not deposited yet.
//!
//! Sums exist at the points that a process owns. What follows from them, `K^-1`, H and what prescribed strains do to it, is brought to those of other
//! processes, so that stresses and states of laws are evaluated there as at owned points.

use nalgebra::{Matrix3, Vector3};
use perimelt_core::family::Continuation;
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::solver::Reducer;
use perimelt_core::{Body, Bond, BondKernel, BrokenBonds, Family};
use rayon::prelude::*;

use super::base::Bonds;
use super::elastic::ElasticPoints;
use super::smoothing::Smoothing;
use super::stress_free::{Prescribed, ShapedFamilies, StressFreeDisplacement};

/// `sum_j w (u_j - u_i) (x) xi` by rows, m.
struct Moment<const D: usize>;

impl<const D: usize, const Q: usize> BondKernel<3, Q> for Moment<D> {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; 3], other: [f64; 3]) -> [f64; Q] {
        std::array::from_fn(|q| bond.weight * (other[q / D] - own[q / D]) * bond.xi[q % D])
    }
}

/// A point is loose when the least eigenvalue of K is below this fraction of the mean one of its intact family. At
/// horizons of 2 and 3 spacings, corners that cracks leave of complete families keep 21 and 18 % in 2D, 17 and 12 %
/// in 3D. Smaller fractions make damaged bodies stiffer, see [`RISE`]: a twentieth, 9 times.
const LEAST: f64 = 0.1;

/// The fraction [`LEAST`] for points in a body that grows, relative to the bonds that a point has: the corner of a block keeps 34 %
/// at a horizon of 2 spacings.
const LEAST_OF_BORN: f64 = 0.02;

/// Largest factor by which broken bonds raise the square of the largest frequency of a body, measured under random
/// damage: a point with few bonds has a large `K^-1`.
pub(super) const RISE: f64 = 5.0;

/// K of a point, m: over all its bonds, and over the unbroken ones.
fn shape_tensors(family: &Family, point: usize, broken: Option<&BrokenBonds>) -> [Matrix3<f64>; 2] {
    let [mut whole, mut left] = [Matrix3::zeros(); 2];
    family.for_each_bond(point, |number, bond, _| {
        let xi = Vector3::from(bond.xi);
        let part = bond.weight * xi * xi.transpose();
        whole += part;
        if broken.is_none_or(|b| !b.is_broken(point, number)) {
            left += part;
        }
    });
    [whole, left]
}

/// `K^-1`, zero in the components that the dimension leaves out; `None` if the least eigenvalue of K is below
/// `least` (m).
fn inverse_of(mut shape: Matrix3<f64>, least: f64, dimension: usize) -> Option<Matrix3<f64>> {
    let size = shape.trace();
    (dimension..3).for_each(|a| shape[(a, a)] = size);
    if shape.symmetric_eigenvalues().min() < least {
        return None;
    }
    let mut inverse = shape.try_inverse()?;
    (dimension..3).for_each(|a| inverse[(a, a)] = 0.0);
    Some(inverse)
}

/// `K^-1` of a point in a family that grows; zero if its bonds do not span the dimensions.
fn inverse_of_born(family: &Family, point: usize, dimension: usize) -> Matrix3<f64> {
    let [shape, _] = shape_tensors(family, point, None);
    let least = LEAST_OF_BORN * shape.trace() / dimension as f64;
    inverse_of(shape, least, dimension).unwrap_or_default()
}

/// Displacement gradients of the points of a body.
#[derive(Debug)]
pub(super) struct Gradient {
    dimension: usize,
    /// The points of the body, which processes may share.
    points: Reducer,
    /// Whether points of other processes have their present shape tensors.
    knows_remote: bool,
    /// `K^-1`, 1/m; zero in the components that the dimension leaves out, and of loose points. Empty for cells of which none
    /// is loose.
    pub(super) inverse_shape: Vec<Matrix3<f64>>,
    /// Broken bonds of each point when its tensor was inverted.
    lost: Vec<u32>,
    /// The last H.
    pub(super) values: Vec<Matrix3<f64>>,
    sums: Vec<f64>,
    /// What prescribed strains do to H.
    pub(super) stress_free: StressFreeDisplacement,
    /// Means of prescribed strains over families; `None` where strains are those of the points.
    smoothing: Option<Smoothing>,
    /// Whether `stress_free` and `smoothing` are those of the present strains and bonds.
    is_stress_free_current: bool,
}

impl Gradient {
    /// Inverts the shape tensors. Those of points of other processes are zero until the first evaluation.
    ///
    /// # Errors
    /// A point whose bonds do not span the dimensions, unless the family grows.
    pub(super) fn new(body: &Body, family: &Family, shared: Reducer) -> Result<Self, FlatFamily> {
        let (points, dimension) = (body.points.len(), body.dimension);
        let invert = |point: usize| {
            if family.grows() {
                return Ok(inverse_of_born(family, point, dimension));
            }
            let [shape, _] = shape_tensors(family, point, None);
            // relative to a full family, whose eigenvalues are equal
            inverse_of(shape, 1e-6 * shape.trace(), dimension).ok_or_else(|| FlatFamily {
                at: body.points.position.at(point).into(),
            })
        };
        let inverse_shape = (0..family.points()).into_par_iter().map(invert);
        let mut inverse_shape = inverse_shape.collect::<Result<Vec<_>, _>>()?;
        inverse_shape.resize(points, Matrix3::zeros());
        Ok(Gradient {
            dimension,
            points: shared,
            knows_remote: false,
            inverse_shape,
            values: vec![Matrix3::zeros(); points],
            sums: vec![0.0; points * if dimension == 3 { 9 } else { 4 }],
            lost: vec![0; points],
            stress_free: StressFreeDisplacement::default(),
            smoothing: None,
            is_stress_free_current: true,
        })
    }

    /// With prescribed strains that are means over families.
    pub(super) fn with_smoothing(self, body: &Body) -> Self {
        Gradient {
            smoothing: Some(Smoothing::new(&body.material_of_point)),
            ..self
        }
    }

    /// Gradients over the cells of points, which are never loose while they have material.
    pub(super) fn of_cells(points: usize, dimension: usize) -> Self {
        Gradient {
            dimension,
            points: Reducer::alone(points),
            knows_remote: false,
            inverse_shape: Vec::new(),
            values: vec![Matrix3::zeros(); points],
            sums: Vec::new(),
            lost: Vec::new(),
            stress_free: StressFreeDisplacement::default(),
            smoothing: None,
            is_stress_free_current: true,
        }
    }

    /// Lets those points be loose that have no material.
    pub(super) fn set_present(&mut self, present: &[bool]) {
        let shape = |present: &bool| match present {
            true => Matrix3::identity(),
            false => Matrix3::zeros(),
        };
        self.inverse_shape = present.iter().map(shape).collect();
    }

    /// H of each cell, with whether its point is loose.
    pub(super) fn cells_mut(
        &mut self,
    ) -> impl IndexedParallelIterator<Item = (&mut Matrix3<f64>, bool)> {
        let shapes = &self.inverse_shape;
        let is_loose = |point: usize| shapes.get(point).is_some_and(|k| k[(0, 0)] == 0.0);
        let values = self.values.par_iter_mut().enumerate();
        values.map(move |(point, value)| (value, is_loose(point)))
    }

    /// Inverts the shape tensors of the points whose bonds changed when the family last grew.
    pub(super) fn follow_growth(&mut self, family: &Family) {
        let points = family.recalibrated().par_iter();
        let dimension = self.dimension;
        let inverses = points.map(|&p| inverse_of_born(family, p as usize, dimension));
        let inverses: Vec<_> = inverses.collect();
        for (&point, inverse) in family.recalibrated().iter().zip(inverses) {
            self.inverse_shape[point as usize] = inverse;
        }
        self.knows_remote = false;
        self.forget_families();
    }

    fn forget_families(&mut self) {
        self.stress_free.forget_families();
        if let Some(smoothing) = &mut self.smoothing {
            smoothing.forget_families();
        }
        self.is_stress_free_current = false;
    }

    /// Makes the next [`Gradient::follow_strains`] evaluate what the prescribed strains do.
    pub(super) fn forget_strains(&mut self) {
        self.is_stress_free_current = false;
    }

    /// Evaluates what prescribed strains do to H, if they or bonds changed in any process; whether they did.
    pub(super) fn follow_strains(
        &mut self,
        bonds: Bonds<'_>,
        continuation: &Continuation,
        elastic: &ElasticPoints,
    ) -> bool {
        if !self.points.any(!self.is_stress_free_current) {
            return false;
        }
        self.is_stress_free_current = true;
        let (inverse, points) = (&self.inverse_shape, &self.points);
        if let Some(smoothing) = &mut self.smoothing {
            smoothing.evaluate(bonds, elastic, points);
        }
        let tensor = elastic.prescribed_tensor();
        let strains = match &tensor {
            Some(tensor) => Prescribed::Tensor(tensor),
            None => Prescribed::Isotropic(&elastic.eigenstrain),
        };
        let families = ShapedFamilies {
            bonds,
            inverse_shape: inverse,
            points,
        };
        self.stress_free.evaluate(families, continuation, strains);
        true
    }

    /// What means over families add to the prescribed strain of each point; empty if nothing.
    pub(super) fn smoothing(&self) -> &[[f64; 6]] {
        self.smoothing.as_ref().map_or(&[], Smoothing::strain)
    }

    /// The gradient of which the stress of a point follows: that of its displacement without what prescribed strains do
    /// to it beyond their value at the point.
    pub(super) fn elastic(&self, point: usize, finite: bool) -> Matrix3<f64> {
        without(&self.values[point], self.stress_free.of(point), finite)
    }

    /// Whether a point has too few bonds for a strain of its own.
    pub(super) fn is_loose(&self, point: usize) -> bool {
        let shape = self.inverse_shape.get(point);
        shape.is_some_and(|inverse| inverse[(0, 0)] == 0.0)
    }

    /// Inverts the shape tensors of points whose bonds broke; whether there were any in any process, or points of other processes got their first
    /// shape tensors.
    pub(super) fn update_shapes(&mut self, family: &Family, broken: Option<&BrokenBonds>) -> bool {
        let is_shared = self.points.processes().size() > 1;
        let is_first = is_shared && !std::mem::replace(&mut self.knows_remote, true);
        let own = broken.is_some_and(|broken| self.follow_breaks(family, broken));
        let changed = is_first || broken.is_some() && self.points.any(own);
        if changed {
            (self.points).bring(bytemuck::cast_slice_mut(&mut self.inverse_shape));
            self.forget_families();
        }
        changed
    }

    /// Inverts the shape tensors of owned points whose bonds broke; whether there were any.
    fn follow_breaks(&mut self, family: &Family, broken: &BrokenBonds) -> bool {
        let dimension = self.dimension;
        let own = &mut self.inverse_shape[..family.points()];
        let points = own.par_iter_mut().zip(&mut self.lost);
        let points = points.enumerate().with_min_len(1024);
        let update = |(point, (inverse, lost)): (usize, (&mut Matrix3<f64>, &mut u32))| {
            let now = broken.of(point) as u32;
            if *lost == now {
                return false;
            }
            *lost = now;
            let [whole, left] = shape_tensors(family, point, Some(broken));
            let least = LEAST * whole.trace() / dimension as f64;
            *inverse = inverse_of(left, least, dimension).unwrap_or_default();
            true
        };
        points.map(update).reduce(|| false, |any, one| any | one)
    }

    /// Makes the next update invert all shape tensors: other bonds may be broken than before.
    pub(super) fn invalidate(&mut self) {
        self.lost.fill(u32::MAX);
    }

    /// Evaluates H from displacement components by slot over unbroken bonds; whether a shape tensor changed.
    pub(super) fn evaluate(
        &mut self,
        family: &Family,
        displacement: [&[f64]; 3],
        broken: Option<&BrokenBonds>,
    ) -> bool {
        let changed = self.update_shapes(family, broken);
        match self.dimension {
            1 | 2 => self.evaluate_in::<2, 4>(family, displacement, broken),
            _ => self.evaluate_in::<3, 9>(family, displacement, broken),
        }
        changed
    }

    fn evaluate_in<const D: usize, const Q: usize>(
        &mut self,
        family: &Family,
        displacement: [&[f64]; 3],
        broken: Option<&BrokenBonds>,
    ) {
        let sums = bytemuck::cast_slice_mut(&mut self.sums);
        family.sum_unbroken::<3, Q, _>(&Moment::<D>, displacement, broken, sums);
        let sums = self.sums.par_chunks_exact(Q);
        let points = self
            .values
            .par_iter_mut()
            .zip(sums)
            .zip(&self.inverse_shape);
        points.for_all(|((value, sum), inverse)| {
            let entry = |r: usize, c: usize| match r < D && c < D {
                true => sum[r * D + c],
                false => 0.0,
            };
            *value = Matrix3::from_fn(entry) * inverse;
        });
        (self.points).bring(bytemuck::cast_slice_mut(&mut self.values));
    }
}

/// `H - D`, or that of `F (1 - D)` in finite kinematics.
pub(super) fn without(
    gradient: &Matrix3<f64>,
    correction: Option<&Matrix3<f64>>,
    finite: bool,
) -> Matrix3<f64> {
    match correction {
        None => *gradient,
        Some(correction) if finite => gradient - correction - gradient * correction,
        Some(correction) => gradient - correction,
    }
}

/// A point whose bonds lie in a plane or on a line.
#[derive(Debug, thiserror::Error)]
#[error(
    "the bonds of the point at ({}, {}, {}) m do not span all directions, so it has no strain tensor, which `correspondence` and `plasticity` need: give the body two points or more along each axis",
    at[0], at[1], at[2]
)]
pub struct FlatFamily {
    at: [f64; 3],
}
