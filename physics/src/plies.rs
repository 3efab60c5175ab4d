//! Bonds of plies by their direction, from the discrete moments of a complete family of a plane grid.
//!
//! The moments are those of the lattice, so that what follows from them is exact to rounding whatever the horizon.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector, Matrix2};
use perimelt_core::family::FamilyError;
use perimelt_core::shape::{BoxShape, Shape};
use perimelt_core::{Body, Bond, Correction, Family, FamilySpec};

/// Sine of the angle up to which a bond runs along the fibres.
const ALONG: f64 = 1e-6;

/// The bonds of a complete family in a plane.
#[derive(Clone, Debug)]
pub(crate) struct CompleteFamily {
    pub(crate) bonds: Vec<PlaneBond>,
}

/// A bond of a complete family.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlaneBond {
    /// Weight times length.
    pub(crate) moment: f64,
    /// Unit vector.
    pub(crate) direction: [f64; 2],
    /// m.
    pub(crate) length: f64,
}

/// A bond that crosses a plane.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CrossingBond<'a> {
    /// Cosine of the angle from the normal, positive.
    pub(crate) cosine: f64,
    /// Weight times length.
    pub(crate) moment: f64,
    pub(crate) direction: &'a [f64; 2],
    /// m.
    pub(crate) length: f64,
}

impl CompleteFamily {
    /// That of the points of a plane grid of this spacing (m).
    pub(crate) fn new(spacing: f64, spec: &FamilySpec) -> Result<Self, FamilyError> {
        let reach = (spec.horizon.of(spacing) / spacing).ceil() + 1.0;
        let side = 2.0 * reach + 1.0;
        let square = Shape::Box(BoxShape {
            min: [0.0; 3],
            max: [side * spacing, side * spacing, spacing],
        });
        let body = Body::fill("plane", &square, 2, spacing, 1.0);
        let body = body.expect("a square of at least three cells");
        let whole = FamilySpec {
            layers: Vec::new(),
            ..spec.clone()
        };
        let family = Family::build(&body, &whole)?;
        let mut bonds = Vec::new();
        family.for_each_bond(body.points.len() / 2, |_, bond, _| {
            bonds.push(PlaneBond {
                moment: bond.weight * bond.length,
                direction: [bond.xi[0], bond.xi[1]].map(|x| x * bond.inverse_length),
                length: bond.length,
            });
        });
        Ok(CompleteFamily { bonds })
    }

    /// Sum of weight times length over the bonds along a direction.
    pub(crate) fn moment_along(&self, fibre: [f64; 2]) -> f64 {
        let along = self.bonds.iter().filter(|b| is_along(fibre, b.direction));
        along.map(|bond| bond.moment).sum()
    }

    /// Bonds that cross a plane with this normal from one of its sides.
    pub(crate) fn crossing(&self, normal: [f64; 2]) -> Vec<CrossingBond<'_>> {
        let along =
            |bond: &PlaneBond| normal[0] * bond.direction[0] + normal[1] * bond.direction[1];
        let bonds = self.bonds.iter().map(|bond| CrossingBond {
            cosine: along(bond),
            moment: bond.moment,
            direction: &bond.direction,
            length: bond.length,
        });
        bonds.filter(|bond| bond.cosine > ALONG).collect()
    }

    /// `sum_j w |xi| g(n)` over all bonds.
    pub(crate) fn sum_of(&self, of_direction: impl Fn([f64; 2]) -> f64) -> f64 {
        let bonds = self.bonds.iter();
        bonds.map(|b| b.moment * of_direction(b.direction)).sum()
    }

    /// `1/2 sum_j w |xi| m_r(n) p_c(n)` by row and column, with moments m of the directions n and parts p of the stiffness.
    pub(crate) fn moments<const N: usize>(
        &self,
        of_direction: impl Fn([f64; 2]) -> [[f64; N]; 2],
    ) -> DMatrix<f64> {
        let mut matrix = DMatrix::zeros(N, N);
        for bond in &self.bonds {
            let [moments, parts] = of_direction(bond.direction);
            for (row, moment) in moments.iter().enumerate() {
                for (column, part) in parts.iter().enumerate() {
                    matrix[(row, column)] += 0.5 * bond.moment * moment * part;
                }
            }
        }
        matrix
    }
}

/// Whether a unit vector runs along the fibres.
#[inline(always)]
pub(crate) fn is_along(fibre: [f64; 2], direction: [f64; 2]) -> bool {
    let sine = fibre[0] * direction[1] - fibre[1] * direction[0];
    sine.abs() < ALONG
}

/// Cosine and sine of the angle from the fibres.
#[inline(always)]
pub(crate) fn relative(fibre: [f64; 2], direction: [f64; 2]) -> [f64; 2] {
    [
        fibre[0] * direction[0] + fibre[1] * direction[1],
        fibre[0] * direction[1] - fibre[1] * direction[0],
    ]
}

/// 1, cos 2 psi, sin 2 psi, cos 4 psi and sin 4 psi of the angle from the fibres.
#[inline(always)]
pub(crate) fn waves(fibre: [f64; 2], direction: [f64; 2]) -> [f64; 5] {
    let [c, s] = relative(fibre, direction);
    let (cos2, sin2) = (c * c - s * s, 2.0 * c * s);
    [
        1.0,
        cos2,
        sin2,
        cos2 * cos2 - sin2 * sin2,
        2.0 * cos2 * sin2,
    ]
}

/// The smallest solution: waves that no moment contains, such as sines on a lattice that is symmetric about the fibres, are zero.
/// `None` where the moments cannot be met, since bonds run in too few directions.
pub(crate) fn solve(matrix: DMatrix<f64>, target: &[f64]) -> Option<Vec<f64>> {
    let target = DVector::from_column_slice(target);
    let parts = matrix.clone().svd(true, true);
    let least = 1e-9 * parts.singular_values.max();
    let factors = parts.solve(&target, least).ok()?;
    let missed = (matrix * &factors - &target).amax();
    (missed < 1e-9 * target.amax()).then(|| factors.as_slice().to_vec())
}

/// Bonds by their direction whose moments `1/2 sum_j w |xi| g n_a n_b` are a symmetric tensor: of the stiffness of an interface against shear
/// (Pa), and half of the conductivity of a ply (W/(m K)).
#[derive(Clone, Copy, Debug)]
pub(crate) struct TensorBonds {
    /// Factors of 1, cos 2 psi and sin 2 psi, with psi from x.
    factors: [f64; 3],
}

impl TensorBonds {
    /// The bonds with this tensor; `None` where bonds run in too few directions.
    pub(crate) fn new(family: &CompleteFamily, moduli: &Matrix2<f64>) -> Option<Self> {
        let matrix = family.moments(|[x, y]| {
            let [one, cos2, sin2, ..] = waves([1.0, 0.0], [x, y]);
            [[x * x, y * y, x * y], [one, cos2, sin2]]
        });
        let target = [moduli[(0, 0)], moduli[(1, 1)], moduli[(0, 1)]];
        let factors = solve(matrix, &target)?;
        Some(TensorBonds {
            factors: [factors[0], factors[1], factors[2]],
        })
    }

    /// The factor of a bond whose projection runs along a unit vector.
    #[inline(always)]
    pub(crate) fn of(&self, direction: [f64; 2]) -> f64 {
        let waves = waves([1.0, 0.0], direction);
        (1..3).fold(self.factors[0], |sum, n| sum + self.factors[n] * waves[n])
    }
}

/// The symmetric tensor in the plane with these values along and across the fibres.
pub(crate) fn turned(fibre: [f64; 2], [along, across]: [f64; 2]) -> Matrix2<f64> {
    let [c, s] = fibre;
    Matrix2::new(
        along * c * c + across * s * s,
        (along - across) * c * s,
        (along - across) * c * s,
        along * s * s + across * c * c,
    )
}

/// Unit vector of a bond in the plane.
#[inline(always)]
pub(crate) fn plane_direction(bond: &Bond) -> [f64; 2] {
    [bond.xi[0], bond.xi[1]].map(|x| x * bond.inverse_length)
}

/// By point, factors that give the bonds along a direction the moment of a complete row, where the family is corrected at surfaces; empty
/// where it is not. `plane` has no cracks: corrections beside a crack stay those of the uncut body.
pub(crate) fn fibre_factors(
    plane: &Family,
    complete: &CompleteFamily,
    fibre: [f64; 2],
) -> Vec<f64> {
    let is_corrected = matches!(
        plane.spec().correction,
        Correction::Point | Correction::Uniaxial | Correction::Balanced
    );
    if !is_corrected {
        return Vec::new();
    }
    let target = complete.moment_along(fibre);
    let factor = |point: usize| {
        let mut sum = 0.0;
        plane.for_each_bond(point, |_, bond, _| {
            if is_along(fibre, plane_direction(bond)) {
                sum += bond.mean() * bond.length;
            }
        });
        if sum > 0.0 { target / sum } else { 0.0 }
    };
    (0..plane.points()).map(factor).collect()
}

/// The family without cracks: corrections beside a crack stay those of the uncut body.
pub(crate) fn uncut(body: &Body, plane: &Arc<Family>) -> Result<Arc<Family>, FamilyError> {
    if body.cuts.is_empty() {
        return Ok(plane.clone());
    }
    let mut body = body.clone();
    body.cuts.clear();
    Ok(Arc::new(Family::build(&body, plane.spec())?))
}
