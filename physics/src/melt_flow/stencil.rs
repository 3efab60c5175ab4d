//! The bonds of a cell with its neighbours on a lattice.

use perimelt_core::Influence;

/// Horizon of the bonds, in spacings. The influence vanishes so fast towards it that only neighbours along edges and diagonals
/// count.
const HORIZON: f64 = 2.015;

/// A bond of a cell with one of its neighbours.
#[derive(Clone, Copy, Debug)]
pub(super) struct StencilBond {
    /// To the neighbour, in cells.
    pub(super) step: [i64; 3],
    /// To the neighbour, m.
    pub(super) xi: [f64; 3],
    /// Weight `b`, 1/m²: `grad f = sum b xi f_j`, `lap f = 2 sum b (f_j - f_i)`.
    pub(super) weight: f64,
}

/// The bonds of a cell: 2, 8 or 26 by the dimension.
#[derive(Clone, Debug)]
pub(super) struct Stencil {
    pub(super) bonds: Vec<StencilBond>,
    /// Spacing, m.
    pub(super) spacing: f64,
    /// Sum of the weights of the Laplacian, 1/m².
    pub(super) laplacian: f64,
}

impl Stencil {
    pub(super) fn new(dimension: usize, spacing: f64) -> Stencil {
        let range = |axis: usize| if axis < dimension { -1..=1 } else { 0..=0 };
        let mut bonds = Vec::new();
        for z in range(2) {
            for y in range(1) {
                for x in range(0) {
                    let step: [i64; 3] = [x, y, z];
                    if step != [0; 3] {
                        let xi = step.map(|s| s as f64 * spacing);
                        let length = step.iter().map(|s| (s * s) as f64).sum::<f64>().sqrt();
                        let weight = Influence::Wendland.at(length / HORIZON);
                        bonds.push(StencilBond { step, xi, weight });
                    }
                }
            }
        }
        let moment: f64 = bonds.iter().map(|b| b.weight * b.xi[0] * b.xi[0]).sum();
        bonds.iter_mut().for_each(|b| b.weight /= moment);
        let laplacian = bonds.iter().map(|b| 2.0 * b.weight).sum();
        Stencil {
            bonds,
            spacing,
            laplacian,
        }
    }

    /// The bond with the neighbour along an axis.
    pub(super) fn straight(&self, axis: usize, is_upper: bool) -> usize {
        let mut step = [0; 3];
        step[axis] = if is_upper { 1 } else { -1 };
        let found = self.bonds.iter().position(|b| b.step == step);
        found.unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gradients_and_laplacians_of_quadratic_fields_are_exact() {
        for dimension in [1, 2, 3] {
            let stencil = Stencil::new(dimension, 0.5);
            assert_eq!(stencil.bonds.len(), 3usize.pow(dimension as u32) - 1);
            let linear: f64 = stencil
                .bonds
                .iter()
                .map(|b| b.weight * b.xi[0] * 3.0 * b.xi[0])
                .sum();
            assert!((linear - 3.0).abs() < 1e-14, "{dimension}: {linear}");
            let squares = stencil.bonds.iter();
            let squares = squares.map(|b| 2.0 * b.weight * b.xi.iter().map(|x| x * x).sum::<f64>());
            let laplacian: f64 = squares.sum();
            assert!(
                (laplacian - 2.0 * dimension as f64).abs() < 1e-13,
                "{dimension}: {laplacian}"
            );
            let upper = stencil.bonds[stencil.straight(0, true)];
            assert_eq!(upper.step, [1, 0, 0]);
        }
    }
}
