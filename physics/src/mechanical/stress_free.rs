//! Displacements of stress-free strains that vary in space, as the shape tensor sees them.
//!
//! A strain E that varies linearly, such as that of a linear temperature, is compatible: a free body deforms without stress.
//! About a point its displacement is, but for a rotation,
//!
//! ```text
//! u* = E xi + q,   q_a = (E_ab,c - 1/2 E_bc,a) xi_b xi_c          isotropic E = e 1: q = (g . xi) xi - 1/2 g |xi|^2, g = grad e
//! D  = [sum_j w q (x) xi] K^-1
//! ```
//!
//! The gradient by the shape tensor of u* is `E + D`: a mean over the family, which is that of the point only where the family is
//! symmetric. At surfaces, edges and corners, beside cracks and on clouds families are one-sided, and D is not zero. Strains that
//! are prescribed at points (thermal, of phases, inherent) pass through the same operator as the total strain when the stress is
//! that of `H - D`. Plastic strains and those at births follow from the strain of the point itself, which has passed through it.
//!
//! The gradient of E by the shape tensor is exact for linear strains on any family. In finite kinematics the strain of q is
//! split off the deformation gradient: `F (1 - D)`.

use nalgebra::{Matrix3, Vector3};
use perimelt_core::family::{ByImage, Continuation, Mirrored};
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::solver::Reducer;
use perimelt_core::{Bond, BondKernel, BrokenBonds, Family, Image, SlotField};
use rayon::prelude::*;

use super::base::Bonds;
use super::classical::COMPONENTS;

/// Components of the gradient of a tensor: three for each of xx, yy, zz, xy, yz, zx.
const TENSOR: usize = 18;

/// Which of xx, yy, zz, xy, yz, zx is at a row and column.
const COMPONENT_AT: [[usize; 3]; 3] = [[0, 3, 5], [3, 1, 4], [5, 4, 2]];

/// Families are symmetric when their third moment over that of lengths is below this.
const SYMMETRIC: f64 = 1e-10;

/// The families of the points of a body.
#[derive(Clone, Copy)]
pub(super) struct ShapedFamilies<'a> {
    pub(super) bonds: Bonds<'a>,
    /// `K^-1` of each point, 1/m.
    pub(super) inverse_shape: &'a [Matrix3<f64>],
    /// The points of the body, which processes may share.
    pub(super) points: &'a Reducer,
}

/// In-plane strains that are prescribed at the points of a body.
#[derive(Clone, Copy)]
pub(super) enum Prescribed<'a> {
    /// An isotropic strain.
    Isotropic(&'a [f64]),
    /// Components xx, yy, zz, xy, yz, zx.
    Tensor(&'a [[f64; 6]]),
}

/// `sum_j w (f_j - f_i) xi` of a scalar f.
struct ScalarMoment;

impl BondKernel<1, 3> for ScalarMoment {
    #[inline(always)]
    fn bond(&self, bond: &Bond, [own]: [f64; 1], [other]: [f64; 1]) -> [f64; 3] {
        bond.xi.map(|xi| bond.weight * (other - own) * xi)
    }
}

/// q, from the gradient of an isotropic strain or of a tensor.
#[inline(always)]
fn quadratic<const S: usize>(gradient: &[f64; S], xi: [f64; 3]) -> [f64; 3] {
    if S == TENSOR {
        let of = |a: usize, b: usize, c: usize| gradient[3 * COMPONENT_AT[a][b] + c];
        return std::array::from_fn(|a| {
            (0..9).fold(0.0, |sum, n| {
                let (b, c) = (n / 3, n % 3);
                sum + (of(a, b, c) - 0.5 * of(b, c, a)) * xi[b] * xi[c]
            })
        });
    }
    let along = (0..3).fold(0.0, |sum, a| sum + gradient[a] * xi[a]);
    let square = xi.iter().fold(0.0, |sum, x| sum + x * x);
    std::array::from_fn(|a| along * xi[a] - 0.5 * square * gradient[a])
}

/// What the springs against modes without strain contribute because of q, N/m³: `-sum_j w g_i q_i - w' g_j q_j`. The first
/// input is the stiffness g of the springs, the others are the gradient of the strain.
struct Springs;

/// An end of a bond with the springs of its point.
struct SpringEnd<const S: usize> {
    /// Gradient of the strain.
    gradient: [f64; S],
    /// g.
    stiffness: f64,
}

#[inline(always)]
fn springs<const S: usize>(bond: &Bond, own: &SpringEnd<S>, other: &SpringEnd<S>) -> [f64; 3] {
    let (here, there) = (bond.weight * own.stiffness, bond.dual * other.stiffness);
    let difference = std::array::from_fn(|i| there * other.gradient[i] - here * own.gradient[i]);
    quadratic::<S>(&difference, bond.xi)
}

impl BondKernel<4, 3> for Springs {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; 4], other: [f64; 4]) -> [f64; 3] {
        let split = |[stiffness, gradient @ ..]: [f64; 4]| SpringEnd {
            gradient,
            stiffness,
        };
        springs::<3>(bond, &split(own), &split(other))
    }
}

impl BondKernel<{ TENSOR + 1 }, 3> for Springs {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; TENSOR + 1], other: [f64; TENSOR + 1]) -> [f64; 3] {
        let split = |[stiffness, gradient @ ..]: [f64; TENSOR + 1]| SpringEnd {
            gradient,
            stiffness,
        };
        springs::<TENSOR>(bond, &split(own), &split(other))
    }
}

/// `sum_j w |u_j - u_i - q|^2`, m. Inputs: the displacement, the gradient of the strain.
struct SquaredExtension;

#[inline(always)]
fn squared_extension<const S: usize>(
    bond: &Bond,
    own: ([f64; 3], [f64; S]),
    other: [f64; 3],
) -> [f64; 1] {
    let q = quadratic::<S>(&own.1, bond.xi);
    [bond.weight * (0..3).fold(0.0, |sum, a| sum + (other[a] - own.0[a] - q[a]).powi(2))]
}

impl BondKernel<6, 1> for SquaredExtension {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; 6], [x, y, z, ..]: [f64; 6]) -> [f64; 1] {
        let [a, b, c, gradient @ ..] = own;
        squared_extension::<3>(bond, ([a, b, c], gradient), [x, y, z])
    }
}

impl BondKernel<{ TENSOR + 3 }, 1> for SquaredExtension {
    const RARE: bool = true;

    #[inline(always)]
    fn bond(
        &self,
        bond: &Bond,
        own: [f64; TENSOR + 3],
        [x, y, z, ..]: [f64; TENSOR + 3],
    ) -> [f64; 1] {
        let [a, b, c, gradient @ ..] = own;
        squared_extension::<TENSOR>(bond, ([a, b, c], gradient), [x, y, z])
    }
}

/// `sum_j w xi (x) xi (x) xi` of a family, m².
type ThirdMoment = [[[f64; 3]; 3]; 3];

/// The third moment of a point over its unbroken bonds; `None` if its family is symmetric.
fn third_moment(
    family: &Family,
    point: usize,
    broken: Option<&BrokenBonds>,
) -> Option<ThirdMoment> {
    let mut moment = [[[0.0; 3]; 3]; 3];
    let mut size = 0.0;
    family.for_each_bond(point, |number, bond, _| {
        if broken.is_some_and(|b| b.is_broken(point, number)) {
            return;
        }
        size += bond.weight * bond.length.powi(3);
        for (a, rows) in moment.iter_mut().enumerate() {
            for (b, row) in rows.iter_mut().enumerate() {
                for (c, entry) in row.iter_mut().enumerate() {
                    *entry += bond.weight * bond.xi[a] * bond.xi[b] * bond.xi[c];
                }
            }
        }
    });
    let largest = moment.as_flattened().as_flattened().iter();
    let largest = largest.fold(0.0f64, |m, v| m.max(v.abs()));
    (largest > SYMMETRIC * size).then_some(moment)
}

/// What strains that are prescribed at points do to displacement gradients; empty where they are uniform.
#[derive(Debug, Default)]
pub(super) struct StressFreeDisplacement {
    /// Points with one-sided families; empty until they are needed.
    one_sided: Vec<(u32, ThirdMoment)>,
    /// Gradient of the strain by slot: 3 or 18 components.
    gradient: Vec<SlotField>,
    /// D of each point.
    correction: Vec<Matrix3<f64>>,
    has_one_sided: bool,
}

impl StressFreeDisplacement {
    /// D of a point; `None` where the strain is uniform.
    pub(super) fn of(&self, point: usize) -> Option<&Matrix3<f64>> {
        self.correction.get(point)
    }

    /// Whether the strain is uniform.
    pub(super) fn is_zero(&self) -> bool {
        self.correction.is_empty()
    }

    /// Lets the one-sided families be found again.
    pub(super) fn forget_families(&mut self) {
        self.has_one_sided = false;
    }

    /// Evaluates D of a strain.
    pub(super) fn evaluate(
        &mut self,
        families: ShapedFamilies<'_>,
        continuation: &Continuation,
        strain: Prescribed<'_>,
    ) {
        let ShapedFamilies {
            bonds: Bonds { family, broken },
            inverse_shape,
            points: shared,
        } = families;
        let varies = match strain {
            Prescribed::Isotropic(strain) => strain.windows(2).any(|s| s[0] != s[1]),
            Prescribed::Tensor(strain) => strain.windows(2).any(|s| s[0] != s[1]),
        };
        if !shared.any(varies) {
            self.gradient.clear();
            self.correction.clear();
            return;
        }
        if !self.has_one_sided {
            let points = (0..family.points()).into_par_iter();
            let of = |point| third_moment(family, point, broken).map(|m| (point as u32, m));
            self.one_sided = points.filter_map(of).collect();
            self.has_one_sided = true;
        }
        self.load_gradient(families, continuation, strain);
        self.correction.clear();
        self.correction
            .resize(inverse_shape.len(), Matrix3::zeros());
        let is_tensor = matches!(strain, Prescribed::Tensor(_));
        let gradient = &self.gradient;
        let of = |(point, moment): &(u32, ThirdMoment)| {
            let (point, slot) = (*point as usize, family.slot_of(*point as usize));
            let of_strain = |a: usize, b: usize, c: usize| match (is_tensor, a == b) {
                (true, _) => gradient[3 * COMPONENT_AT[a][b] + c][slot],
                (false, true) => gradient[c][slot],
                (false, false) => 0.0,
            };
            let sum = Matrix3::from_fn(|a, e| {
                (0..9).fold(0.0, |sum, n| {
                    let (b, c) = (n / 3, n % 3);
                    sum + (of_strain(a, b, c) - 0.5 * of_strain(b, c, a)) * moment[b][c][e]
                })
            });
            (point, sum * inverse_shape[point])
        };
        let corrections: Vec<_> = self.one_sided.par_iter().map(of).collect();
        for (point, correction) in corrections {
            self.correction[point] = correction;
        }
        shared.bring(bytemuck::cast_slice_mut(&mut self.correction));
    }

    /// Evaluates the gradient of the strain by slot.
    fn load_gradient(
        &mut self,
        families: ShapedFamilies<'_>,
        continuation: &Continuation,
        strain: Prescribed<'_>,
    ) {
        let ShapedFamilies {
            bonds: Bonds { family, broken },
            inverse_shape,
            points: shared,
        } = families;
        let components = match strain {
            Prescribed::Isotropic(_) => 1,
            Prescribed::Tensor(_) => COMPONENTS.len(),
        };
        self.gradient.resize(3 * components, SlotField::default());
        let mut sums = vec![[0.0; 3]; inverse_shape.len()];
        let mut values = SlotField::default();
        for (component, gradient) in self.gradient.chunks_mut(3).enumerate() {
            let (row, column) = COMPONENTS[component];
            match strain {
                Prescribed::Isotropic(strain) => values.load(family, strain, Mirrored::Scalar),
                Prescribed::Tensor(strain) => {
                    let value = |point: usize| strain[point][component];
                    values.load(family, value, Mirrored::Tensor(row, column));
                }
            }
            family.sum_unbroken(&ScalarMoment, [&values[..]], broken, &mut sums);
            let points = sums.par_iter_mut().zip(inverse_shape).with_min_len(4096);
            points.for_all(|(sum, inverse)| *sum = (inverse * Vector3::from(*sum)).into());
            shared.bring(sums.as_flattened_mut());
            let sums = &sums;
            let along = |axis: usize| move |point: usize| sums[point][axis];
            let of_image = |image: &Image| {
                let sign = match components {
                    1 => 1.0,
                    _ => image.mirror[row] * image.mirror[column],
                };
                std::array::from_fn::<_, 3, _>(|axis| {
                    sign * image.mirror[axis] * sums[image.point][axis]
                })
            };
            SlotField::load_all(gradient, family, along, ByImage(continuation, of_image));
        }
    }

    /// The gradient of the strain after some other inputs.
    fn inputs<'a, const I: usize, const N: usize>(
        &'a self,
        first: [&'a [f64]; N],
    ) -> [&'a [f64]; I] {
        std::array::from_fn(|i| match first.get(i) {
            Some(input) => *input,
            None => &self.gradient[i - N],
        })
    }

    /// Force density of the springs against modes without strain because of q, N/m³; `stiffness` by slot.
    pub(super) fn spring_forces(
        &self,
        bonds: Bonds<'_>,
        stiffness: &[f64],
        forces: &mut Vec<[f64; 3]>,
    ) {
        let Bonds { family, broken } = bonds;
        forces.clear();
        if self.is_zero() {
            return;
        }
        forces.resize(family.points(), [0.0; 3]);
        match self.gradient.len() {
            TENSOR => {
                let inputs = self.inputs::<{ TENSOR + 1 }, 1>([stiffness]);
                family.sum_unbroken(&Springs, inputs, broken, forces);
            }
            _ => {
                let inputs = self.inputs::<4, 1>([stiffness]);
                family.sum_unbroken(&Springs, inputs, broken, forces);
            }
        }
    }

    /// `sum_j w |u_j - u_i - q|^2` of each point, m², where the strain is not uniform; `displacement` by slot.
    pub(super) fn squared_extension(
        &self,
        bonds: Bonds<'_>,
        displacement: [&[f64]; 3],
        extension: &mut [[f64; 1]],
    ) {
        let Bonds { family, broken } = bonds;
        match self.gradient.len() {
            TENSOR => {
                let inputs = self.inputs::<{ TENSOR + 3 }, 3>(displacement);
                family.sum_unbroken(&SquaredExtension, inputs, broken, extension);
            }
            _ => {
                let inputs = self.inputs::<6, 3>(displacement);
                family.sum_unbroken(&SquaredExtension, inputs, broken, extension);
            }
        }
    }
}
