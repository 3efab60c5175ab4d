//! Means of prescribed strains over families.
//!
//! The gradient of the displacement by the shape tensor is a mean over the family. A strain that is prescribed at points, and jumps from
//! one row to the next, is not: the stress of the rows beside the jump would be that of the difference, with the bulk modulus, and plastic
//! flow does not relieve pressure. The strain of a point therefore is
//!
//! ```text
//! e_i + s_i,   s_i = sum_j w (1 - a . xi) (e_j - e_i) / (w_0 + sum_j w),   a = K^-1 sum_j w xi,   K = sum_j w xi (x) xi
//! ```
//!
//! the mean over the owner and those of its family that are of the same material, about the place of the point: s is zero for strains that
//! vary linearly, on any family. Materials of different stiffness share no strain. See docs/theory/mechanics.md, "Strains that jump".

use nalgebra::{Matrix3, Vector3};
use perimelt_core::family::Mirrored;
use perimelt_core::solver::Reducer;
use perimelt_core::{Bond, BondKernel, BrokenBonds, Family, SlotField};
use rayon::prelude::*;

use super::base::Bonds;
use super::classical::COMPONENTS;
use super::elastic::ElasticPoints;

/// `sum_j w (e_j - e_i) xi` and `sum_j w (e_j - e_i)` over neighbours of the same material. Inputs: e, the number of the material.
struct Moments;

impl BondKernel<2, 4> for Moments {
    #[inline(always)]
    fn bond(&self, bond: &Bond, [own, here]: [f64; 2], [other, there]: [f64; 2]) -> [f64; 4] {
        let weight = if here == there { bond.weight } else { 0.0 };
        let difference = weight * (other - own);
        let [x, y, z] = bond.xi;
        [difference * x, difference * y, difference * z, difference]
    }
}

/// Weight w_0 of the owner over that of its neighbours. The rows beside a jump have the fraction 0.29 of the strain behind it on a square
/// lattice with a horizon of two spacings and 0.27 on a cubic one; the gradient of the displacement has 0.30 and 0.27.
const OWN: f64 = 0.2;

/// What means over families add to the prescribed strains of the points.
#[derive(Debug)]
pub(super) struct Smoothing {
    /// Number of the material of each point.
    material: Vec<f64>,
    /// The same by slot, as long as there are `families`.
    material_in_slots: SlotField,
    /// a (1/m) and `w_0 + sum_j w` of each point over unbroken bonds; empty until they are needed.
    families: Vec<(Vector3<f64>, f64)>,
    /// s of each point as xx, yy, zz, xy, yz, zx; empty where prescribed strains are uniform.
    strain: Vec<[f64; 6]>,
}

impl Smoothing {
    pub(super) fn new(material_of_point: &[u16]) -> Self {
        Smoothing {
            material: material_of_point.iter().map(|m| f64::from(*m)).collect(),
            material_in_slots: SlotField::default(),
            families: Vec::new(),
            strain: Vec::new(),
        }
    }

    /// s of each point; empty where prescribed strains are uniform.
    pub(super) fn strain(&self) -> &[[f64; 6]] {
        &self.strain
    }

    /// Lets the families be measured again.
    pub(super) fn forget_families(&mut self) {
        self.families.clear();
    }

    /// Evaluates s of the strains that are prescribed at the points.
    pub(super) fn evaluate(&mut self, bonds: Bonds<'_>, elastic: &ElasticPoints, shared: &Reducer) {
        let isotropic = |point: usize| elastic.eigenstrain[point] / elastic.moduli(point).swelling;
        let points = 1..elastic.eigenstrain.len();
        let has_same = |point: usize| isotropic(point) == isotropic(0);
        let is_uniform = !shared.any(!points.into_par_iter().all(has_same));
        let prescribed = &elastic.prescribed;
        self.strain.clear();
        if is_uniform && !shared.any(prescribed.windows(2).any(|s| s[0] != s[1])) {
            return;
        }
        let Bonds { family, broken } = bonds;
        let material = &mut self.material_in_slots;
        if self.families.is_empty() {
            material.load(family, &self.material[..], Mirrored::Scalar);
            let points = (0..family.points()).into_par_iter();
            let of = |point| measure(family, point, broken, material);
            self.families = points.map(of).collect();
        }
        self.strain.resize(elastic.eigenstrain.len(), [0.0; 6]);
        let mut add = |component: usize, means: &[f64]| {
            let strains = self.strain.iter_mut().zip(means);
            strains.for_each(|(strain, mean)| strain[component] += mean);
        };
        let mean = Mean {
            bonds,
            material: &self.material_in_slots,
            families: &self.families,
        };
        if !is_uniform {
            let means = mean.of(isotropic, Mirrored::Scalar);
            (0..3).for_each(|axis| add(axis, &means));
        }
        if !prescribed.is_empty() {
            for (component, (row, column)) in COMPONENTS.into_iter().enumerate() {
                let value = |point: usize| prescribed[point][component];
                add(component, &mean.of(value, Mirrored::Tensor(row, column)));
            }
        }
        shared.bring(self.strain.as_flattened_mut());
    }
}

/// a and `w_0 + sum_j w` of a point; `material` by slot.
fn measure(
    family: &Family,
    point: usize,
    broken: Option<&BrokenBonds>,
    material: &[f64],
) -> (Vector3<f64>, f64) {
    let here = material[family.slot_of(point)];
    let (mut first, mut shape, mut sum) = (Vector3::zeros(), Matrix3::zeros(), 0.0);
    family.for_each_bond(point, |number, bond, slot| {
        if material[slot] == here && !broken.is_some_and(|b| b.is_broken(point, number)) {
            let xi = Vector3::from(bond.xi);
            first += bond.weight * xi;
            shape += bond.weight * xi * xi.transpose();
            sum += bond.weight;
        }
    });
    // within the directions that the family spans
    let inverse = shape.pseudo_inverse(1e-6 * shape.trace());
    (inverse.unwrap_or_default() * first, (1.0 + OWN) * sum)
}

/// Means over families.
#[derive(Clone, Copy)]
struct Mean<'a> {
    bonds: Bonds<'a>,
    /// By slot.
    material: &'a [f64],
    families: &'a [(Vector3<f64>, f64)],
}

impl Mean<'_> {
    /// s of a component of the strain.
    fn of(self, value: impl Fn(usize) -> f64 + Sync, mirrored: Mirrored) -> Vec<f64> {
        let Bonds { family, broken } = self.bonds;
        let mut slots = SlotField::default();
        slots.load(family, value, mirrored);
        let mut sums = vec![[0.0; 4]; family.points()];
        family.sum_unbroken(&Moments, [&slots[..], self.material], broken, &mut sums);
        let points = sums.par_iter().zip(self.families);
        let mean = |([x, y, z, sum], (a, weight)): (&[f64; 4], &(Vector3<f64>, f64))| match *weight
            > 0.0
        {
            true => (sum - a.dot(&Vector3::new(*x, *y, *z))) / weight,
            false => 0.0,
        };
        points.map(mean).collect()
    }
}
