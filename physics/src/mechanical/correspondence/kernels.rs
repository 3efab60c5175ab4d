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
