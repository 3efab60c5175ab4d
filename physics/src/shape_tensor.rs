//! Shape tensor `A = sum w xi xi^T V` of families, complete families, and families completed by the points of walls.

use nalgebra::{Matrix3, Vector3};
use perimelt_core::family::{ForeignBond, ForeignBonds};
use perimelt_core::{Body, Family};

/// Least eigenvalue of `A / a`: the value at a flat free surface. Families with less, as at corners, make the fluid slightly
/// softer, which has no effect at a surface without pressure.
const SMALLEST: f64 = 0.5;

/// Product of the eigenvalues of `A / a` from which a family counts as complete: the second row below a flat free
/// surface has 0.84. Below, one eigenvalue may be as small as [`SMALLEST`].
const COMPLETE: f64 = 0.85;

/// Components of `A^-1` in storage order; the components of a plane come first.
pub(crate) const COMPONENTS: [(usize, usize); 6] = [(0, 0), (1, 1), (0, 1), (2, 2), (1, 2), (0, 2)];

/// Whether a component stands on the diagonal.
pub(crate) fn is_diagonal(component: usize) -> bool {
    COMPONENTS[component].0 == COMPONENTS[component].1
}

/// Number of components.
pub(crate) const fn components(dimension: usize) -> usize {
    dimension * (dimension + 1) / 2
}

/// A complete family, or the fullest one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CompleteFamily {
    /// The point with this family.
    pub point: usize,
    /// `sum w |xi|^2 V / dimension`, m.
    pub moment: f64,
    /// `sum w |xi|^4 V` over `sum w |xi|^2 V`, m².
    pub mean_square: f64,
    /// `sum w V` of the neighbours, 1/m.
    pub content: f64,
    /// Weight of a point in its own family over its volume, 1/m⁴ (3D).
    pub own_weight: f64,
    /// Weight of a point in its own family, 1/m.
    pub own_content: f64,
}

/// `A^-1` from the components of `A`, with the eigenvalues of `A / complete` not below [`SMALLEST`], and whether the family is
/// complete.
pub(crate) fn inverted<const D: usize>(sums: &[f64], complete: f64) -> (Matrix3<f64>, bool) {
    // one along the axis that a plane body does not have
    let mut shape = Matrix3::identity();
    for (sum, &(a, b)) in sums.iter().zip(&COMPONENTS[..components(D)]) {
        shape[(a, b)] = sum / complete;
        shape[(b, a)] = sum / complete;
    }
    // the search for eigenvalues does not end for values that are not finite
    if !shape.iter().all(|x| x.is_finite()) {
        return (Matrix3::identity() / complete, false);
    }
    if shape.determinant() > COMPLETE
        && let Some(inverse) = shape.try_inverse()
    {
        return (inverse / complete, true);
    }
    let eigen = shape.symmetric_eigen();
    let kept = eigen.eigenvalues.map(|value| 1.0 / value.max(SMALLEST));
    let axes = eigen.eigenvectors;
    let inverse = axes * Matrix3::from_diagonal(&kept) * axes.transpose();
    (inverse / complete, false)
}

impl CompleteFamily {
    pub(crate) fn of(body: &Body, family: &Family) -> Self {
        let (mut square, mut content, mut point) = (0.0_f64, 0.0, 0);
        for candidate in 0..body.points.len() {
            let (mut own_square, mut own_content) = (0.0, 0.0);
            family.for_each_bond(candidate, |_, bond, _| {
                own_square += bond.weight * bond.length * bond.length;
                own_content += bond.weight;
            });
            // the tolerance makes the choice between equal families independent of rounding
            if own_square > square * (1.0 + 1e-9) {
                (square, content, point) = (own_square, own_content, candidate);
            }
        }
        let mut fourth = 0.0;
        family.for_each_bond(point, |_, bond, _| {
            fourth += bond.weight * bond.length.powi(4);
        });
        let horizon = family.spec().horizon.of(body.finest_spacing());
        let own_weight = 1.0 / family.spec().moment(body, horizon);
        CompleteFamily {
            point,
            moment: square / body.dimension as f64,
            mean_square: fourth / square,
            content,
            own_weight,
            own_content: own_weight * body.points.volume[0],
        }
    }
}

/// Sums over families and bonds to walls at each point.
pub(crate) struct Completion {
    /// `sum w V` over the family, 1/m.
    pub content: Vec<f64>,
    /// `sum w V` over bonds to walls, 1/m.
    pub at_walls: Vec<f64>,
    /// `sum w xi V` over the family and bonds to walls.
    asymmetry: Vec<Vector3<f64>>,
}

impl Completion {
    pub(crate) fn of<'a>(
        points: usize,
        family: &Family,
        walls: impl Iterator<Item = &'a ForeignBonds>,
    ) -> Completion {
        let mut found = Completion {
            content: vec![0.0; points],
            at_walls: vec![0.0; points],
            asymmetry: vec![Vector3::zeros(); points],
        };
        for point in 0..points {
            family.for_each_bond(point, |_, bond, _| {
                found.content[point] += bond.weight;
                found.asymmetry[point] += bond.weight * Vector3::from(bond.xi);
            });
        }
        for bonds in walls {
            for n in 0..bonds.len() {
                let ForeignBond { bond, point, .. } = bonds.bond(n);
                found.at_walls[point] += bond.weight;
                found.asymmetry[point] += bond.weight * Vector3::from(bond.xi);
            }
        }
        found
    }

    /// `|sum w xi V|` of a point.
    pub(crate) fn asymmetry(&self, point: usize) -> f64 {
        self.asymmetry[point].norm()
    }

    /// Corrects bonds to a wall, `xi <- xi - sum_all w xi V / sum_walls w V`, so that `sum w xi V = 0` as in a complete family.
    pub(crate) fn correct(&self, bonds: &mut ForeignBonds) {
        bonds.for_each_mut(|point, bond| {
            // members in the skin have weight zero
            if self.at_walls[point] > 0.0 {
                let correction = self.asymmetry[point] / self.at_walls[point];
                (0..3).for_each(|a| bond.xi[a] -= correction[a]);
            }
        });
    }
}
