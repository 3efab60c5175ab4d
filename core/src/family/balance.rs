//! Factors of the bonds of a cloud that put a linear field in equilibrium.
//!
//! Where horizons or spacings change, the bonds of a point do not balance: under a linear field more heat arrives from the
//! side of the larger horizon than leaves to the other, and a steady profile has a kink
//! (docs/theory/heat_conduction.md tabulates it). Each bond gets the factor
//!
//! ```text
//! f_ij = 1 + (l_i - l_j) . xi_ij          with    V_i sum_j c_ij f_ij xi_ij = 0    at every point i
//! ```
//!
//! where `c_ij` is the coefficient of the bond in the conduction. The factor is the same from both ends, so that bonds stay
//! pairs and heat is conserved to rounding. Of all factors with this property these have the smallest deviations from one,
//! weighted with `c_ij`: the vectors `l` are their Lagrange multipliers. Their equations are those of the
//! displacements of springs between the points, symmetric and positive semidefinite, and are solved once, by conjugate gradients.
//!
//! Points whose families a bare surface cuts keep `l = 0`: their bonds need not balance, since the heat of
//! a linear field leaves through the surface. Mirrored layers mirror `l`.

use nalgebra::Vector3;
use rayon::prelude::*;

use crate::body::{Body, Face};
use crate::cell_list::CellList;
use crate::parallel::ParallelLoop;
use crate::solver::reduce::norm;
use crate::solver::{Hints, Krylov, KrylovMethod, KrylovOptions, Reducer};

use super::build::continued_faces;
use super::cloud::SlotBond;
use super::images::Images;
use super::{Bond, FamilyError, FamilySpec, Rows};

/// Tolerance of the balance, relative to the sum of the absolute values of its terms.
const TOLERANCE: f64 = 1e-12;

/// Least factor of a bond. Heat flows against the temperature through bonds of negative factors, and smaller ones show that
/// points lie too irregularly.
const LEAST: f64 = 0.02;

/// Multipliers by slot.
#[derive(Debug)]
pub(super) struct Balance {
    multiplier: Vec<Vector3<f64>>,
}

/// The equations of the multipliers.
struct Equations<'a> {
    images: &'a Images,
    /// Signs of a vector along the axes in each slot.
    sign: Vec<Vector3<f64>>,
    rows: Rows,
    volume: &'a [f64],
    is_free: Vec<bool>,
}

/// A bond in the equations of the multipliers.
struct Spring {
    slot: usize,
    /// m.
    xi: Vector3<f64>,
    coefficient: f64,
}

impl Balance {
    /// Balances the bonds of all points, with corrections and without cuts.
    pub(super) fn new(
        body: &Body,
        spec: &FamilySpec,
        images: &Images,
        bonds: Vec<Vec<SlotBond>>,
    ) -> Result<Balance, FamilyError> {
        let parts: Vec<Rows> = bonds
            .into_par_iter()
            .enumerate()
            .map(|(p, row)| Rows::of_point(p, &row))
            .collect();
        let equations = Equations {
            images,
            sign: signs(body, images),
            rows: Rows::joined(&parts),
            volume: &body.points.volume,
            is_free: free_points(body, spec),
        };
        drop(parts);
        let balance = Balance {
            multiplier: equations.solve()?,
        };
        let least = (0..body.points.len())
            .into_par_iter()
            .map(|p| equations.least_factor(p, &balance))
            .reduce(|| f64::INFINITY, f64::min);
        match least > LEAST {
            true => Ok(balance),
            false => Err(FamilyError::NotBalanced {
                reason: format!("the least would be {least:.3}"),
            }),
        }
    }

    /// The factor of a bond.
    pub(super) fn factor(&self, point: usize, slot: usize, bond: &Bond) -> f64 {
        let xi = Vector3::from(bond.xi);
        1.0 + (self.multiplier[point] - self.multiplier[slot]).dot(&xi)
    }
}

impl Equations<'_> {
    fn bonds(&self, point: usize) -> impl Iterator<Item = Spring> {
        let row = self.rows.start[point]..self.rows.start[point + 1];
        row.map(move |at| {
            let slot = self.rows.column[at] as usize;
            let xi = self.images.position[slot] - self.images.position[point];
            let mean = 0.5 * (self.rows.weight[at] + self.rows.dual[at]);
            Spring {
                slot,
                xi,
                coefficient: self.volume[point] * mean / xi.norm(),
            }
        })
    }

    fn by_point(&self, of: impl Fn(usize) -> Vector3<f64> + Sync) -> Vec<f64> {
        let mut values = vec![0.0; 3 * self.volume.len()];
        self.fill(&mut values, of);
        values
    }

    fn fill(&self, out: &mut [f64], of: impl Fn(usize) -> Vector3<f64> + Sync) {
        let points = out.par_chunks_exact_mut(3).enumerate();
        points.with_min_len(256).for_all(|(point, out)| {
            let value = match self.is_free[point] {
                true => of(point),
                false => Vector3::zeros(),
            };
            out.copy_from_slice(value.as_slice());
        });
    }

    /// The multiplier in a slot, from those of the points.
    fn in_slot(&self, values: &[f64], slot: usize) -> Vector3<f64> {
        let point = self.images.point[slot] as usize;
        let own = Vector3::from_column_slice(&values[3 * point..3 * point + 3]);
        own.component_mul(&self.sign[slot])
    }

    fn apply(&self, values: &[f64], out: &mut [f64]) {
        self.fill(out, |point| {
            let own = Vector3::from_column_slice(&values[3 * point..3 * point + 3]);
            let bonds = self.bonds(point);
            let term = |bond: Spring| {
                let change = own - self.in_slot(values, bond.slot);
                bond.coefficient * bond.xi.dot(&change) * bond.xi
            };
            bonds.map(term).sum()
        });
    }

    /// Multipliers by slot.
    fn solve(&self) -> Result<Vec<Vector3<f64>>, FamilyError> {
        let sum = |point: usize, term: fn(&Vector3<f64>) -> Vector3<f64>| -> Vector3<f64> {
            let bonds = self.bonds(point);
            bonds.map(|bond| bond.coefficient * term(&bond.xi)).sum()
        };
        let unbalanced = self.by_point(|p| -sum(p, |xi| *xi));
        let terms = self.by_point(|p| sum(p, |xi| xi.abs()));
        let mut diagonal = self.by_point(|p| sum(p, |xi| xi.component_mul(xi)));
        diagonal
            .iter_mut()
            .filter(|d| **d == 0.0)
            .for_each(|d| *d = 1.0);
        let options = KrylovOptions {
            relative_tolerance: 0.0,
            absolute_tolerance: TOLERANCE * norm(&terms),
            ..KrylovOptions::default()
        };
        let apply = |values: &[f64], out: &mut [f64]| {
            self.apply(values, out);
            Ok(())
        };
        let hints = Hints {
            diagonal: Some(&diagonal),
            ..Hints::default()
        };
        let alone = Reducer::default();
        let mut values = vec![0.0; unbalanced.len()];
        Krylov::new(KrylovMethod::ConjugateGradient, options)
            .solve(apply, &unbalanced, &mut values, &alone, hints)
            .map_err(|e| FamilyError::NotBalanced {
                reason: e.to_string(),
            })?;
        let slots = 0..self.images.point.len();
        Ok(slots.map(|slot| self.in_slot(&values, slot)).collect())
    }

    fn least_factor(&self, point: usize, balance: &Balance) -> f64 {
        let own = balance.multiplier[point];
        let factor = |bond: Spring| 1.0 + (own - balance.multiplier[bond.slot]).dot(&bond.xi);
        self.bonds(point).map(factor).fold(f64::INFINITY, f64::min)
    }
}

/// Signs of the components of a vector in each slot: images behind mirrors are reversed across them.
fn signs(body: &Body, images: &Images) -> Vec<Vector3<f64>> {
    let mut signs = vec![Vector3::repeat(1.0); images.position.len()];
    for ghost in &images.layers.ghosts {
        signs[ghost.slot as usize] = Vector3::from_fn(|axis, _| {
            let passes = ghost.passes[2 * axis] + ghost.passes[2 * axis + 1];
            f64::from(1 - 2 * i8::from(passes % 2 == 1))
        });
    }
    debug_assert_eq!(signs.len(), body.points.len() + images.layers.ghosts.len());
    signs
}

/// Which points have families that no bare surface cuts.
fn free_points(body: &Body, spec: &FamilySpec) -> Vec<bool> {
    let positions = &body.points.position;
    let horizon = body.points.horizons(spec.horizon);
    let mut is_free = vec![true; positions.len()];
    let continued = continued_faces(body, spec);
    let goes_on = |face: &Face, point: usize| {
        let depth = (body.face_position(*face) - positions[point][face.axis()]).abs();
        continued.contains(face) && depth <= body.points.spacing[point]
    };
    let list = CellList::new(positions, &horizon);
    let faces: Vec<Face> = Face::ALL
        .into_iter()
        .filter(|f| f.axis() < body.dimension)
        .collect();
    for cell in body.surface(&faces) {
        let bare = cell.point as usize;
        if goes_on(&cell.face, bare) {
            continue;
        }
        let half = 0.5 * body.points.spacing[bare];
        let at = positions[bare] + half * cell.face.normal();
        let reach = horizon[bare] + half;
        list.visit_near(&at, reach, |other| {
            let distance = (positions[other] - at).norm();
            is_free[other] &= distance > reach.max(horizon[other] + half);
        });
    }
    is_free
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::Horizon;
    use crate::family::Correction;
    use crate::family::balance_tests::{plate, spec};

    /// The right side alone is bare. Surface cells are reached by their own horizon and by that of the other point.
    #[test]
    fn points_are_free_beyond_the_reach_of_bare_surfaces() {
        let layers = [Face::XMin, Face::YMin, Face::YMax];
        let spec = FamilySpec {
            horizon: Horizon::Spacings(2.9),
            ..spec(Correction::Balanced, &layers)
        };
        // last column that is free: 2 m less 2.9 and a half spacings; or less 1.16 m, the horizon on the left
        for (left, last) in [((0.1, 1.0), 1.65), ((0.2, 2.0), 0.7)] {
            let right = if left.0 == 0.1 { 0.1 } else { 0.05 };
            let body = plate([left, (right, 1.0)], 0.0);
            let is_free = free_points(&body, &spec);
            for (x, is_free) in body.points.position.iter().zip(is_free) {
                let is_reached = match left.0 == 0.2 && x.x > 1.0 {
                    true => x.x > 2.0 - 3.4 * right,
                    false => x.x > last + 1e-6,
                };
                assert_eq!(is_free, !is_reached, "{x}");
            }
        }
    }
}
