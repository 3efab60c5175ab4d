//! Forces of the bonds of a ply and of the pairs of bonds that cross each other between two layers.
//!
//! ```text
//! ply:        t = mean(w) mean(C(n)) (s - e) + w p + w' p',   p = 2 a theta,   theta = sum_j w |xi| (s - e)
//! interface:  phi = L^2 (s_1 - s_2) / (2 d |xi|),   W = 1/4 sum_j w |xi| g(n) phi^2 d    per area
//! ```
//!
//! The two bonds of an interface run from the point k in the lower layer to j in the upper one and from j in the lower to k
//! in the upper one; C, g and e are means of both ends, so that forces are opposite at them and the derivative of one energy. d is the distance of the layers, xi the projection of the bonds on the plane, L their length. In linear
//! kinematics `phi = n . (D_k + D_j) / (2 d) + (w_j - w_k) / |xi|` with D the displacement of the upper layer relative to the
//! lower one and w the mean of both along z: the shear angle along n of \[Gao2020\], chapter 4, whose length in the denominator is
//! L instead of |xi|.

use perimelt_core::{Bond, BondKernel};

use super::weights::{PARTS, PlyBonds};
use crate::plies::{TensorBonds, plane_direction};

/// Inputs of the kernels of a ply; the first three are the displacement, m.
pub(super) const INPUTS: usize = MATRIX + PARTS;
/// Components xx, yy and xy of the stress-free strain.
pub(super) const STRAIN: usize = 3;
/// 2 a theta, Pa.
pub(super) const PRESSURE: usize = 6;
/// Stiffness that fibres add to the bonds along them, calibrated, Pa.
pub(super) const FIBRE: usize = 7;
/// Parts of the stiffness of all bonds, Pa.
pub(super) const MATRIX: usize = 8;

type Inputs = [f64; INPUTS];

/// A bond that is stretched.
#[derive(Clone, Copy)]
pub(super) struct Stretched {
    pub(super) stretch: f64,
    /// Unit vector along the bond; the reference one in linear kinematics.
    direction: [f64; 3],
}

/// Reference length of a bond. Where bonds of many points are alike, what depends on it alone is computed once.
#[derive(Clone, Copy)]
struct Length {
    /// m.
    length: f64,
    /// 1/m.
    inverse: f64,
}

/// The stretches of bonds along `xi` (m), all of one length, by the displacements `relative` of their ends (m).
#[inline(always)]
fn stretched<const FINITE: bool, const N: usize>(
    xi: [[f64; 3]; N],
    reference: Length,
    relative: [[f64; 3]; N],
) -> [Stretched; N] {
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let Length { length, inverse } = reference;
    if FINITE {
        let along: [[f64; 3]; N] =
            std::array::from_fn(|n| std::array::from_fn(|a| xi[n][a] + relative[n][a]));
        let current = along.map(|along| dot(along, along).max(f64::MIN_POSITIVE).sqrt());
        // one division, which takes longer than all of the rest, for 1 / l and 1 / (l + l0) of all bonds
        let product = current.map(|current| current * (current + length));
        let inverse_of_all = 1.0 / product.iter().product::<f64>();
        std::array::from_fn(|n| {
            let others = (0..N).filter(|other| *other != n);
            let inverse_product = others.fold(inverse_of_all, |sum, other| sum * product[other]);
            let inverse_current = inverse_product * (current[n] + length);
            let sum: [f64; 3] = std::array::from_fn(|a| xi[n][a] + along[n][a]);
            Stretched {
                // (l^2 - l0^2) / (l + l0) avoids cancellation
                stretch: dot(relative[n], sum) * (inverse_product * current[n]) * inverse,
                direction: along[n].map(|x| x * inverse_current),
            }
        })
    } else {
        std::array::from_fn(|n| {
            let direction = xi[n].map(|x| x * inverse);
            Stretched {
                stretch: dot(relative[n], direction) * inverse,
                direction,
            }
        })
    }
}

/// Stiffness of a bond with its mean weight, Pa/m, by the parts of both ends or by those that are the same everywhere.
#[inline(always)]
pub(super) fn stiffness<const BY_POINT: bool>(
    law: &PlyBonds,
    bond: &Bond,
    own: &Inputs,
    other: &Inputs,
) -> f64 {
    let parts = match BY_POINT {
        true => std::array::from_fn(|part| 0.5 * (own[MATRIX + part] + other[MATRIX + part])),
        false => law.uniform,
    };
    let n = plane_direction(bond);
    bond.mean() * (law.matrix(n, parts) + of_fibre(law, bond, own, other))
}

/// What the fibres add to the stiffness of a bond, Pa.
#[inline(always)]
pub(super) fn of_fibre(law: &PlyBonds, bond: &Bond, own: &Inputs, other: &Inputs) -> f64 {
    law.along_fibre(plane_direction(bond)) * (0.5 * (own[FIBRE] + other[FIBRE]))
}

/// Stretch without the mean of the stress-free strains of both ends.
#[inline(always)]
pub(super) fn elastic<const FINITE: bool, const I: usize>(
    bond: &Bond,
    own: &[f64; I],
    other: &[f64; I],
) -> Stretched {
    let relative = std::array::from_fn(|a| other[a] - own[a]);
    let length = Length {
        length: bond.length,
        inverse: bond.inverse_length,
    };
    let [stretched] = stretched::<FINITE, 1>([[bond.xi[0], bond.xi[1], 0.0]], length, [relative]);
    let [x, y] = plane_direction(bond);
    let free = |ends: &[f64; I]| {
        let [xx, yy, xy] = [ends[STRAIN], ends[STRAIN + 1], ends[STRAIN + 2]];
        xx * x * x + yy * y * y + 2.0 * xy * x * y
    };
    Stretched {
        stretch: stretched.stretch - 0.5 * (free(own) + free(other)),
        ..stretched
    }
}

/// Force density along a bond with a stiffness (Pa/m) and a stretch, N/m³.
#[inline(always)]
fn tension(bond: &Bond, own: &Inputs, other: &Inputs, [stiffness, stretch]: [f64; 2]) -> f64 {
    stiffness * stretch + bond.weight * own[PRESSURE] + bond.dual * other[PRESSURE]
}

/// Dilatation theta.
pub(super) struct Dilatation<const FINITE: bool>;

impl<const FINITE: bool> BondKernel<INPUTS, 1> for Dilatation<FINITE> {
    const PAIRED: usize = 1;

    #[inline(always)]
    fn bond(&self, bond: &Bond, own: Inputs, other: Inputs) -> [f64; 1] {
        let [here, _] = self.ends(bond, own, other);
        here
    }

    #[inline(always)]
    fn ends(&self, bond: &Bond, own: Inputs, other: Inputs) -> [[f64; 1]; 2] {
        let extension = bond.length * elastic::<FINITE, _>(bond, &own, &other).stretch;
        [[bond.weight * extension], [bond.dual * extension]]
    }
}

/// Force density, N/m³.
pub(super) struct PlyForce<const FINITE: bool, const BY_POINT: bool>(pub(super) PlyBonds);

impl<const FINITE: bool, const BY_POINT: bool> BondKernel<INPUTS, 3>
    for PlyForce<FINITE, BY_POINT>
{
    const PAIRED: usize = 3;

    #[inline(always)]
    fn bond(&self, bond: &Bond, own: Inputs, other: Inputs) -> [f64; 3] {
        let Stretched { stretch, direction } = elastic::<FINITE, _>(bond, &own, &other);
        let stiffness = stiffness::<BY_POINT>(&self.0, bond, &own, &other);
        let tension = tension(bond, &own, &other, [stiffness, stretch]);
        direction.map(|n| tension * n)
    }
}

/// Stress in the plane, xx, yy, xy, Pa: half of what the bonds carry along themselves.
pub(super) struct PlyStress<const FINITE: bool> {
    pub(super) bonds: PlyBonds,
    /// Whether the stress is conjugate to the stress-free strain, which stretches bonds by their reference direction.
    pub(super) is_conjugate: bool,
}

impl<const FINITE: bool> BondKernel<INPUTS, 3> for PlyStress<FINITE> {
    const PAIRED: usize = 3;

    #[inline(always)]
    fn bond(&self, bond: &Bond, own: Inputs, other: Inputs) -> [f64; 3] {
        let Stretched { stretch, direction } = elastic::<FINITE, _>(bond, &own, &other);
        let stiffness = stiffness::<true>(&self.bonds, bond, &own, &other);
        let half = 0.5 * bond.length * tension(bond, &own, &other, [stiffness, stretch]);
        let [x, y] = match self.is_conjugate {
            true => plane_direction(bond),
            false => [direction[0], direction[1]],
        };
        [half * x * x, half * y * y, half * x * y]
    }

    #[inline(always)]
    fn ends(&self, bond: &Bond, own: Inputs, other: Inputs) -> [[f64; 3]; 2] {
        [self.bond(bond, own, other); 2]
    }
}

/// Energy density without that of the dilatation, J/m³.
pub(super) struct PlyEnergy<const FINITE: bool>(pub(super) PlyBonds);

impl<const FINITE: bool> BondKernel<INPUTS, 1> for PlyEnergy<FINITE> {
    const PAIRED: usize = 1;

    #[inline(always)]
    fn bond(&self, bond: &Bond, own: Inputs, other: Inputs) -> [f64; 1] {
        let stretch = elastic::<FINITE, _>(bond, &own, &other).stretch;
        let stiffness = stiffness::<true>(&self.0, bond, &own, &other);
        [0.25 * stiffness * bond.length * stretch * stretch]
    }

    #[inline(always)]
    fn ends(&self, bond: &Bond, own: Inputs, other: Inputs) -> [[f64; 1]; 2] {
        [self.bond(bond, own, other); 2]
    }
}

/// Gradient of the displacement in the plane: that of x, y and z along x, then along y.
pub(super) struct PlaneGradient;

impl BondKernel<INPUTS, 6> for PlaneGradient {
    const RARE: bool = true;

    fn bond(&self, bond: &Bond, own: Inputs, other: Inputs) -> [f64; 6] {
        let n = plane_direction(bond);
        std::array::from_fn(|c| bond.weight * (other[c % 3] - own[c % 3]) * n[c / 3])
    }
}

/// Diagonal block of the stiffness in the plane, xx, yy, xy, N/m⁵, and the sum of `w / |xi|`, 1/m², by the stiffness of a bond (Pa/m).
pub(super) struct PlyBlock<F>(pub(super) F);

impl<F: Fn(&Bond, &Inputs, &Inputs) -> f64 + Sync> BondKernel<INPUTS, 4> for PlyBlock<F> {
    const RARE: bool = true;

    fn bond(&self, bond: &Bond, own: Inputs, other: Inputs) -> [f64; 4] {
        let [x, y] = plane_direction(bond);
        let spring = (self.0)(bond, &own, &other) * bond.inverse_length;
        let of_dilatation = bond.mean() * bond.inverse_length;
        [
            spring * x * x,
            spring * y * y,
            spring * x * y,
            of_dilatation,
        ]
    }
}

/// Components xx, yy and xy of the shear moduli of an interface.
pub(super) const MODULI: usize = 3;
/// Inputs of the kernels of an interface: displacements of the lower and the upper layer, m, and shear moduli, Pa.
pub(super) const SHEAR_INPUTS: usize = 6 + MODULI;

type ShearInputs = [f64; SHEAR_INPUTS];

/// The bonds between two layers.
#[derive(Clone, Copy, Debug)]
pub(super) struct Crossing {
    /// Over each of the shear moduli.
    pub(super) bonds: [TensorBonds; MODULI],
    /// The shear moduli where they are the same at all points at any temperature, Pa.
    pub(super) uniform: [f64; MODULI],
    /// Distance of the layers, m.
    pub(super) distance: f64,
}

/// A pair of crossing bonds, from k in the lower layer and to k in the upper one.
pub(super) struct CrossingPair {
    up: Stretched,
    down: Stretched,
    /// Shear angle.
    pub(super) angle: f64,
    length: f64,
}

impl Crossing {
    /// Stiffness g of a bond whose projection runs along a unit vector, Pa.
    #[inline(always)]
    pub(super) fn stiffness(&self, direction: [f64; 2], moduli: [f64; MODULI]) -> f64 {
        let parts = self.bonds.iter().zip(moduli);
        parts.fold(0.0, |sum, (bonds, modulus)| {
            sum + modulus * bonds.of(direction)
        })
    }

    /// `w |xi| g`, Pa, by the moduli of both ends or by those that are the same everywhere.
    #[inline(always)]
    pub(super) fn moment<const BY_POINT: bool>(
        &self,
        bond: &Bond,
        own: &ShearInputs,
        other: &ShearInputs,
    ) -> f64 {
        let moduli = match BY_POINT {
            true => std::array::from_fn(|c| 0.5 * (own[6 + c] + other[6 + c])),
            false => self.uniform,
        };
        bond.mean() * (bond.length * self.stiffness(plane_direction(bond), moduli))
    }

    #[inline(always)]
    pub(super) fn pair<const FINITE: bool, const I: usize>(
        &self,
        bond: &Bond,
        own: &[f64; I],
        other: &[f64; I],
    ) -> CrossingPair {
        let (d, [x, y, _]) = (self.distance, bond.xi);
        let length = (bond.length * bond.length + d * d).sqrt();
        let angle_of_stretch = 0.5 * length * length * bond.inverse_length / d;
        let reference = Length {
            length,
            inverse: 1.0 / length,
        };
        let up = std::array::from_fn(|a| other[3 + a] - own[a]);
        let down = std::array::from_fn(|a| own[3 + a] - other[a]);
        let both = [[x, y, d], [-x, -y, d]];
        let [up, down] = stretched::<FINITE, 2>(both, reference, [up, down]);
        let angle = angle_of_stretch * (up.stretch - down.stretch);
        CrossingPair {
            up,
            down,
            angle,
            length,
        }
    }
}

/// Forces on the point in the lower and in the upper layer per area, Pa.
pub(super) struct InterfaceForce<const FINITE: bool, const BY_POINT: bool>(pub(super) Crossing);

impl<const FINITE: bool, const BY_POINT: bool> BondKernel<SHEAR_INPUTS, 6>
    for InterfaceForce<FINITE, BY_POINT>
{
    const PAIRED: usize = 6;

    #[inline(always)]
    fn bond(&self, bond: &Bond, own: ShearInputs, other: ShearInputs) -> [f64; 6] {
        let [here, _] = self.ends(bond, own, other);
        here
    }

    #[inline(always)]
    fn ends(&self, bond: &Bond, own: ShearInputs, other: ShearInputs) -> [[f64; 6]; 2] {
        let pair = self.0.pair::<FINITE, _>(bond, &own, &other);
        let moment = self.0.moment::<BY_POINT>(bond, &own, &other);
        let size = 0.5 * pair.length * bond.inverse_length * (moment * pair.angle);
        let [up, down] = [pair.up, pair.down].map(|bond| bond.direction.map(|n| size * n));
        let ([ux, uy, uz], [dx, dy, dz]) = (up, down);
        // from the other end the bond down is that up, and the angle is opposite
        [[ux, uy, uz, dx, dy, dz], [-dx, -dy, -dz, -ux, -uy, -uz]]
    }
}

/// Energy per area, J/m².
pub(super) struct InterfaceEnergy<const FINITE: bool>(pub(super) Crossing);

impl<const FINITE: bool> BondKernel<SHEAR_INPUTS, 1> for InterfaceEnergy<FINITE> {
    const PAIRED: usize = 1;

    #[inline(always)]
    fn bond(&self, bond: &Bond, own: ShearInputs, other: ShearInputs) -> [f64; 1] {
        let pair = self.0.pair::<FINITE, _>(bond, &own, &other);
        let moment = self.0.moment::<true>(bond, &own, &other);
        [0.25 * self.0.distance * moment * pair.angle * pair.angle]
    }

    #[inline(always)]
    fn ends(&self, bond: &Bond, own: ShearInputs, other: ShearInputs) -> [[f64; 1]; 2] {
        [self.bond(bond, own, other); 2]
    }
}

/// Stiffness of a point by the pairs of crossing bonds, per area, N/m³, over the distance of the layers (m) by the moment `w |xi| g` of a bond (Pa).
///
/// The angle of a pair is `n . (D_k + D_j) / (2 h) + (w_j - w_k) / |xi|` with the shift D of the upper layer against the lower one and the mean deflection w of
/// both: xx, yy, xy of the stiffness against a uniform shift, and that against deflections of the point by itself.
pub(super) struct InterfaceBlock<F> {
    pub(super) distance: f64,
    pub(super) moment: F,
}

impl<F: Fn(&Bond, &ShearInputs, &ShearInputs) -> f64 + Sync> BondKernel<SHEAR_INPUTS, 4>
    for InterfaceBlock<F>
{
    const RARE: bool = true;

    fn bond(&self, bond: &Bond, own: ShearInputs, other: ShearInputs) -> [f64; 4] {
        let d = self.distance;
        let moment = (self.moment)(bond, &own, &other);
        let of_shift = 0.5 * moment / d;
        let [x, y] = plane_direction(bond);
        let of_deflection = d * moment * bond.inverse_length * bond.inverse_length;
        [
            of_shift * x * x,
            of_shift * y * y,
            of_shift * x * y,
            of_deflection,
        ]
    }
}

/// Stretch of the bond between two points above each other without its stress-free part, and its direction.
#[inline(always)]
pub(super) fn across(
    finite: bool,
    distance: f64,
    relative: [f64; 3],
    free: f64,
) -> (f64, [f64; 3]) {
    let xi = [0.0, 0.0, distance];
    let length = Length {
        length: distance,
        inverse: 1.0 / distance,
    };
    let [Stretched { stretch, direction }] = match finite {
        true => stretched::<true, 1>([xi], length, [relative]),
        false => stretched::<false, 1>([xi], length, [relative]),
    };
    (stretch - free, direction)
}
