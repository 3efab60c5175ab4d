//! Forces of the bonds of a ply and of the pairs of bonds that cross each other between two layers.
//!
//! ```text
//! ply:        t = [mean(w) C(n)] (s - e) + w p + w' p',   p = 2 a theta,   theta = sum_j w |xi| (s - e)
//! interface:  phi = L^2 (s_1 - s_2) / (2 d |xi|),   W = 1/4 sum_j w |xi| g(n) phi^2 d    per area
//! ```
//!
//! The two bonds of an interface run from the point k in the lower layer to j in the upper one and from j in the lower to k
//! in the upper one; d is the distance of the layers, xi the projection of the bonds on the plane, L their length. In linear
//! kinematics `phi = n . (D_k + D_j) / (2 d) + (w_j - w_k) / |xi|` with D the displacement of the upper layer relative to the
//! lower one and w the mean of both along z: the shear angle along n of \[Gao2020\], chapter 4, whose length in the denominator is
//! L instead of |xi|.

use perimelt_core::{Bond, BondKernel};

use super::weights::PlyBonds;
use crate::plies::{TensorBonds, is_along, plane_direction};

/// Inputs of the kernels of a ply; the first three are the displacement, m.
pub(super) const INPUTS: usize = 8;
/// Components xx, yy and xy of the stress-free strain.
pub(super) const STRAIN: usize = 3;
/// 2 a theta, Pa.
pub(super) const PRESSURE: usize = 6;
/// Factor that calibrates the bonds along the fibres.
pub(super) const FIBRE: usize = 7;

type Inputs = [f64; INPUTS];

/// A bond that is stretched.
#[derive(Clone, Copy)]
struct Stretched {
    stretch: f64,
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

/// The stretch of a bond along `xi` (m) by the displacement `relative` of its end (m).
#[inline(always)]
fn stretched<const FINITE: bool>(xi: [f64; 3], reference: Length, relative: [f64; 3]) -> Stretched {
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let Length { length, inverse } = reference;
    if FINITE {
        let along: [f64; 3] = std::array::from_fn(|a| xi[a] + relative[a]);
        let current = dot(along, along).max(f64::MIN_POSITIVE).sqrt();
        let sum: [f64; 3] = std::array::from_fn(|a| xi[a] + along[a]);
        // one division, which takes longer than all of the rest, for 1 / l and 1 / (l + l0)
        let both = current + length;
        let inverse_product = 1.0 / (current * both);
        let inverse_current = inverse_product * both;
        Stretched {
            // (l^2 - l0^2) / (l + l0) avoids cancellation
            stretch: dot(relative, sum) * (inverse_product * current) * inverse,
            direction: along.map(|x| x * inverse_current),
        }
    } else {
        let direction = xi.map(|x| x * inverse);
        Stretched {
            stretch: dot(relative, direction) * inverse,
            direction,
        }
    }
}

/// Stiffness of a bond with its mean weight, Pa/m.
#[inline(always)]
fn stiffness(law: &PlyBonds, bond: &Bond, own: &Inputs, other: &Inputs) -> f64 {
    let n = plane_direction(bond);
    let calibrated = 0.5 * (own[FIBRE] + other[FIBRE]);
    bond.mean() * (law.matrix(n) + calibrated * law.along_fibre(n))
}

/// Stretch without the mean of the stress-free strains of both ends.
#[inline(always)]
fn elastic<const FINITE: bool>(bond: &Bond, own: &Inputs, other: &Inputs) -> Stretched {
    let relative = std::array::from_fn(|a| other[a] - own[a]);
    let length = Length {
        length: bond.length,
        inverse: bond.inverse_length,
    };
    let stretched = stretched::<FINITE>([bond.xi[0], bond.xi[1], 0.0], length, relative);
    let [x, y] = plane_direction(bond);
    let free = |ends: &Inputs| {
        let [xx, yy, xy] = [ends[STRAIN], ends[STRAIN + 1], ends[STRAIN + 2]];
        xx * x * x + yy * y * y + 2.0 * xy * x * y
    };
    Stretched {
        stretch: stretched.stretch - 0.5 * (free(own) + free(other)),
        ..stretched
    }
}

/// Force density along a bond, N/m³.
#[inline(always)]
fn tension(law: &PlyBonds, bond: &Bond, own: &Inputs, other: &Inputs, stretch: f64) -> f64 {
    stiffness(law, bond, own, other) * stretch
        + bond.weight * own[PRESSURE]
        + bond.dual * other[PRESSURE]
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
        let extension = bond.length * elastic::<FINITE>(bond, &own, &other).stretch;
        [[bond.weight * extension], [bond.dual * extension]]
    }
}

/// Force density, N/m³.
pub(super) struct PlyForce<const FINITE: bool>(pub(super) PlyBonds);

impl<const FINITE: bool> BondKernel<INPUTS, 3> for PlyForce<FINITE> {
    const PAIRED: usize = 3;

    #[inline(always)]
    fn bond(&self, bond: &Bond, own: Inputs, other: Inputs) -> [f64; 3] {
        let Stretched { stretch, direction } = elastic::<FINITE>(bond, &own, &other);
        let tension = tension(&self.0, bond, &own, &other, stretch);
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
    const RARE: bool = true;

    fn bond(&self, bond: &Bond, own: Inputs, other: Inputs) -> [f64; 3] {
        let Stretched { stretch, direction } = elastic::<FINITE>(bond, &own, &other);
        let half = 0.5 * bond.length * tension(&self.bonds, bond, &own, &other, stretch);
        let [x, y] = match self.is_conjugate {
            true => plane_direction(bond),
            false => [direction[0], direction[1]],
        };
        [half * x * x, half * y * y, half * x * y]
    }
}

/// Limits of the elastic stretch of bonds.
#[derive(Clone, Copy, Debug)]
pub(super) struct StretchLimits {
    pub(super) tension: f64,
    /// Positive; infinite where bonds do not break in compression.
    pub(super) compression: f64,
    /// Unit vector along the bonds that break, if not all do.
    pub(super) along: Option<[f64; 2]>,
}

/// Load of bonds over their limits.
pub(super) trait BondLoad<const I: usize>: Sync {
    /// That of a bond with inputs at both ends.
    fn ratio(&self, bond: &Bond, own: &[f64; I], other: &[f64; I]) -> f64;
}

/// Excess of bonds over their limits, relative.
pub(super) struct Excess<'a, L>(pub(super) &'a L);

impl<const I: usize, L: BondLoad<I>> BondKernel<I, 1> for Excess<'_, L> {
    const PAIRED: usize = 1;

    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; I], other: [f64; I]) -> [f64; 1] {
        [(self.0.ratio(bond, &own, &other) - 1.0).max(0.0)]
    }

    #[inline(always)]
    fn ends(&self, bond: &Bond, own: [f64; I], other: [f64; I]) -> [[f64; 1]; 2] {
        [self.bond(bond, own, other); 2]
    }
}

/// Inputs of [`Load`]: those of a ply, and a factor of the limits, which is infinite where bonds never break.
pub(super) const LOAD_INPUTS: usize = INPUTS + 1;

/// Stretch of the bonds of a ply over its limits.
pub(super) struct Load<const FINITE: bool>(pub(super) StretchLimits);

impl<const FINITE: bool> BondLoad<LOAD_INPUTS> for Load<FINITE> {
    #[inline(always)]
    fn ratio(&self, bond: &Bond, own: &[f64; LOAD_INPUTS], other: &[f64; LOAD_INPUTS]) -> f64 {
        let StretchLimits {
            tension,
            compression,
            along,
        } = self.0;
        if along.is_some_and(|fibre| !is_along(fibre, plane_direction(bond))) {
            return 0.0;
        }
        let [first, second] = [own, other].map(|end| std::array::from_fn(|n| end[n]));
        let stretch = elastic::<FINITE>(bond, &first, &second).stretch;
        let factor = 0.5 * (own[INPUTS] + other[INPUTS]);
        (stretch / tension).max(-stretch / compression) / factor
    }
}

/// Energy density without that of the dilatation, J/m³.
pub(super) struct PlyEnergy<const FINITE: bool>(pub(super) PlyBonds);

impl<const FINITE: bool> BondKernel<INPUTS, 1> for PlyEnergy<FINITE> {
    const PAIRED: usize = 1;

    #[inline(always)]
    fn bond(&self, bond: &Bond, own: Inputs, other: Inputs) -> [f64; 1] {
        let stretch = elastic::<FINITE>(bond, &own, &other).stretch;
        [0.25 * stiffness(&self.0, bond, &own, &other) * bond.length * stretch * stretch]
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

/// Diagonal block of the stiffness in the plane, xx, yy, xy, N/m⁵, and the sum of `w / |xi|`, 1/m².
pub(super) struct PlyBlock(pub(super) PlyBonds);

impl BondKernel<INPUTS, 4> for PlyBlock {
    const RARE: bool = true;

    fn bond(&self, bond: &Bond, own: Inputs, other: Inputs) -> [f64; 4] {
        let [x, y] = plane_direction(bond);
        let spring = stiffness(&self.0, bond, &own, &other) * bond.inverse_length;
        let of_dilatation = bond.mean() * bond.inverse_length;
        [
            spring * x * x,
            spring * y * y,
            spring * x * y,
            of_dilatation,
        ]
    }
}

/// The bonds between two layers.
#[derive(Clone, Copy, Debug)]
pub(super) struct Crossing {
    pub(super) bonds: TensorBonds,
    /// Distance of the layers, m.
    pub(super) distance: f64,
}

/// A pair of crossing bonds, from k in the lower layer and to k in the upper one.
struct CrossingPair {
    up: Stretched,
    down: Stretched,
    /// Shear angle.
    angle: f64,
    length: f64,
    /// `w |xi| g`, Pa.
    moment: f64,
}

impl Crossing {
    #[inline(always)]
    fn pair<const FINITE: bool>(
        &self,
        bond: &Bond,
        own: &[f64; 6],
        other: &[f64; 6],
    ) -> CrossingPair {
        let (d, [x, y, _]) = (self.distance, bond.xi);
        let length = (bond.length * bond.length + d * d).sqrt();
        let angle_of_stretch = 0.5 * length * length * bond.inverse_length / d;
        let reference = Length {
            length,
            inverse: 1.0 / length,
        };
        let up = std::array::from_fn(|a| other[3 + a] - own[a]);
        let up = stretched::<FINITE>([x, y, d], reference, up);
        let down = std::array::from_fn(|a| own[3 + a] - other[a]);
        let down = stretched::<FINITE>([-x, -y, d], reference, down);
        let angle = angle_of_stretch * (up.stretch - down.stretch);
        CrossingPair {
            up,
            down,
            angle,
            length,
            moment: bond.mean() * (bond.length * self.bonds.of(plane_direction(bond))),
        }
    }
}

/// Forces on the point in the lower and in the upper layer per area, Pa. Inputs are their displacements, m.
pub(super) struct InterfaceForce<const FINITE: bool>(pub(super) Crossing);

impl<const FINITE: bool> BondKernel<6, 6> for InterfaceForce<FINITE> {
    const PAIRED: usize = 6;

    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; 6], other: [f64; 6]) -> [f64; 6] {
        let [here, _] = self.ends(bond, own, other);
        here
    }

    #[inline(always)]
    fn ends(&self, bond: &Bond, own: [f64; 6], other: [f64; 6]) -> [[f64; 6]; 2] {
        let pair = self.0.pair::<FINITE>(bond, &own, &other);
        let size = 0.5 * pair.length * bond.inverse_length * (pair.moment * pair.angle);
        let [up, down] = [pair.up, pair.down].map(|bond| bond.direction.map(|n| size * n));
        let ([ux, uy, uz], [dx, dy, dz]) = (up, down);
        // from the other end the bond down is that up, and the angle is opposite
        [[ux, uy, uz, dx, dy, dz], [-dx, -dy, -dz, -ux, -uy, -uz]]
    }
}

/// Inputs of [`InterfaceLoad`]: displacements of two layers, and their factors of the limits.
pub(super) const SHEAR_INPUTS: usize = 8;

/// Angle of pairs of crossing bonds over its limit.
pub(super) struct InterfaceLoad<const FINITE: bool> {
    pub(super) crossing: Crossing,
    pub(super) limit: f64,
}

impl<const FINITE: bool> BondLoad<SHEAR_INPUTS> for InterfaceLoad<FINITE> {
    #[inline(always)]
    fn ratio(&self, bond: &Bond, own: &[f64; SHEAR_INPUTS], other: &[f64; SHEAR_INPUTS]) -> f64 {
        let [first, second] = [own, other].map(|end| std::array::from_fn(|n| end[n]));
        let angle = self.crossing.pair::<FINITE>(bond, &first, &second).angle;
        let factor = 0.25 * (own[6] + own[7] + other[6] + other[7]);
        angle.abs() / (self.limit * factor)
    }
}

/// Energy per area, J/m².
pub(super) struct InterfaceEnergy<const FINITE: bool>(pub(super) Crossing);

impl<const FINITE: bool> BondKernel<6, 1> for InterfaceEnergy<FINITE> {
    const PAIRED: usize = 1;

    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; 6], other: [f64; 6]) -> [f64; 1] {
        let pair = self.0.pair::<FINITE>(bond, &own, &other);
        [0.25 * self.0.distance * pair.moment * pair.angle * pair.angle]
    }

    #[inline(always)]
    fn ends(&self, bond: &Bond, own: [f64; 6], other: [f64; 6]) -> [[f64; 1]; 2] {
        [self.bond(bond, own, other); 2]
    }
}

/// Diagonal of the stiffness of a point against displacements along x, y and z, per area, N/m³, and a bound of the sums of the
/// absolute values in the three rows.
pub(super) struct InterfaceBlock(pub(super) Crossing);

impl BondKernel<0, 6> for InterfaceBlock {
    const RARE: bool = true;

    fn bond(&self, bond: &Bond, _: [f64; 0], _: [f64; 0]) -> [f64; 6] {
        let d = self.0.distance;
        let moment = bond.mean() * bond.length * self.0.bonds.of(plane_direction(bond));
        let scale = 0.5 * bond.inverse_length / d;
        let angle = [bond.xi[0].abs(), bond.xi[1].abs(), d].map(|x| x * scale);
        let all = 4.0 * angle.iter().sum::<f64>();
        std::array::from_fn(|n| {
            let own = angle[n % 3];
            d * moment * own * if n < 3 { own } else { all }
        })
    }
}

/// Stretch of the bond between two points above each other without its stress-free part, and its direction.
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
    let Stretched { stretch, direction } = match finite {
        true => stretched::<true>(xi, length, relative),
        false => stretched::<false>(xi, length, relative),
    };
    (stretch - free, direction)
}
