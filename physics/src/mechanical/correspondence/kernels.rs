//! Bond kernels of correspondence solids.

use perimelt_core::{Bond, BondKernel};

/// Inputs of the kernels, in slot space: nine components of `P K^-1 - g H` by rows, the
/// displacement, g.
pub(super) const INPUTS: usize = 13;
pub(super) const DISPLACEMENT: usize = 9;
pub(super) const STABILISATION: usize = 12;

/// `sum_j w |u_j - u_i|^2`, m.
pub(super) struct SquaredExtension;

impl BondKernel<3, 1> for SquaredExtension {
    const RARE: bool = true;

    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; 3], other: [f64; 3]) -> [f64; 1] {
        [bond.weight * (0..3).fold(0.0, |sum, a| sum + (other[a] - own[a]).powi(2))]
    }
}

/// Force density, N/m³.
pub(super) struct Force;

impl<const D: usize> BondKernel<INPUTS, D> for Force {
    const PAIRED: usize = D;

    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; INPUTS], other: [f64; INPUTS]) -> [f64; D] {
        let sum = |i: usize| bond.weight * own[i] + bond.dual * other[i];
        let spring = sum(STABILISATION);
        std::array::from_fn(|row| {
            let relative = other[DISPLACEMENT + row] - own[DISPLACEMENT + row];
            (0..D).fold(spring * relative, |f, column| {
                f + sum(3 * row + column) * bond.xi[column]
            })
        })
    }
}

/// Diagonal block of the stiffness but for what the point's own strain adds, which vanishes in
/// complete families. Inputs: `K^-1` as xx, yy, zz, xy, yz, zx, Lamé's constants, g.
pub(super) struct Block;

impl BondKernel<9, 6> for Block {
    const RARE: bool = true;

    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; 9], other: [f64; 9]) -> [f64; 6] {
        let [x, y, z] = bond.xi;
        let [xx, yy, zz, xy, yz, zx, lame, shear, _] = other;
        let q = [
            xx * x + xy * y + zx * z,
            xy * x + yy * y + yz * z,
            zx * x + yz * y + zz * z,
        ];
        let fraction = bond.dual * (q[0] * x + q[1] * y + q[2] * z);
        let springs = (bond.weight * own[8] + bond.dual * other[8]) * (1.0 - fraction).max(0.0);
        let square = q.iter().fold(0.0, |sum, c| sum + c * c);
        let isotropic = bond.dual * bond.dual * shear * square + springs;
        let dyad = bond.dual * bond.dual * (lame + shear);
        [
            dyad * q[0] * q[0] + isotropic,
            dyad * q[1] * q[1] + isotropic,
            dyad * q[2] * q[2] + isotropic,
            dyad * q[0] * q[1],
            dyad * q[1] * q[2],
            dyad * q[2] * q[0],
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Vector3};

    /// The owner moves by a unit vector: the strain of the other point changes by `w' u K^-1 xi`, and its stress pulls
    /// back along the same bond.
    #[test]
    fn the_block_is_the_force_of_the_strain_at_the_other_end() {
        let bond = Bond {
            xi: [0.3, -0.5, 0.7],
            length: 0.83_f64.sqrt(),
            inverse_length: 1.0 / 0.83_f64.sqrt(),
            weight: 0.4,
            dual: 0.9,
        };
        let (lame, shear) = (3.0, 2.0);
        let components = [0.55, 0.4, 0.7, 0.1, -0.15, 0.05];
        let [xx, yy, zz, xy, yz, zx] = components;
        let inverse = Matrix3::new(xx, xy, zx, xy, yy, yz, zx, yz, zz);
        let q = inverse * Vector3::from(bond.xi);
        let column = |moved: Vector3<f64>| {
            let gradient = bond.dual * moved * q.transpose();
            let strain = 0.5 * (gradient + gradient.transpose());
            let stress = lame * strain.trace() * Matrix3::identity() + 2.0 * shear * strain;
            bond.dual * stress * q
        };
        let mut other = [0.0; 9];
        other[..6].copy_from_slice(&components);
        (other[6], other[7]) = (lame, shear);
        let [b_xx, b_yy, b_zz, b_xy, b_yz, b_zx] = Block.bond(&bond, [0.0; 9], other);
        let block = Matrix3::new(b_xx, b_xy, b_zx, b_xy, b_yy, b_yz, b_zx, b_yz, b_zz);
        for axis in 0..3 {
            let unit = Vector3::ith(axis, 1.0);
            let difference = column(unit) - block * unit;
            assert!(difference.norm() < 1e-14, "{difference}");
        }
        // the springs of both ends act on what the strain leaves of the bond
        let mut own = [0.0; 9];
        (own[8], other[8]) = (5.0, 7.0);
        let with_springs = Block.bond(&bond, own, other);
        let left = 1.0 - bond.dual * q.dot(&Vector3::from(bond.xi));
        let springs = left * (bond.weight * own[8] + bond.dual * other[8]);
        let expected = [
            b_xx + springs,
            b_yy + springs,
            b_zz + springs,
            b_xy,
            b_yz,
            b_zx,
        ];
        let pairs = with_springs.iter().zip(expected);
        assert!(left > 0.0 && pairs.map(|(a, b)| (a - b).abs()).sum::<f64>() < 1e-13);
    }
}
