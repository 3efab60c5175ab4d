//! Bond kernels of solids with forces along the bonds: bond-based and ordinary state-based.
//!
//! ```text
//! T_ij = [ c_i/2 f(s - e) + p_i / |xi| ] w_ij n          Wang (2025), eqs. 3.3, 3.10, with f(s) = s
//! f_i  = sum_j T_ij - T_ji
//! s    = (|y_j - y_i| - |xi|) / |xi|                     finite kinematics, eq. 3.5
//! s    = n . (u_j - u_i) / |xi|                          linear kinematics
//! e    = (e_i + e_j) / 2
//! c = 2 (d + 2) mu,   p = 2 a N theta,   theta = N sum_j (s - e) w_ij,   N = d / sum_j w_ij
//! ```
//!
//! Without correction of the bonds, `N = d M / integral of w dV` over a full horizon, as published.
//!
//! `w` is the weight of the bond in the family of the owner of the force state (`c` and `p` are free
//! of horizons, since the weights contain the moment of the family), `e` the eigenstrain (thermal expansion), `mu` the shear modulus, `a` the dilatation stiffness, `d` the dimension. Wang (2025) subtracts the
//! eigenstrain of the point, `e_i` and `d e_i`; in a one-sided family that leaves stress where the eigenstrain is linear, which
//! a free body takes up without stress. In a bond-based solid `a` and `p` are zero, and a bond takes the mean of c at its ends.
//! Forces are the derivative of the energy `sum_i V_i (a theta_i^2 + c_i/2 sum_j w_ij |xi| phi(s - e))` with `phi' = f`, the
//! law of the bonds ([`BondLaw`]), with single and dual horizons.

mod adapters;
mod breaking;
mod energy;
mod force;
mod law;
mod sums;

use perimelt_core::{Bond, Number};

pub use adapters::{STRAIN_INPUTS, Uniform, WithStrain};
pub use breaking::{Breaking, EXCESS_INPUTS, Excess, Load};
pub use energy::{ConjugateStress, ElasticEnergy, Energy, Stress};
pub use force::{Block, Force, Stiffness, TANGENT_INPUTS, Tangent};
pub use law::{BodyLaw, BondConstants, BondForce, BondLaw, Linear, Pairs, States};
pub use sums::{
    Dilation, Directions, ElasticDilation, ElasticExpansion, Expansion, TotalWeight,
    WeightOverLength,
};
pub(super) use sums::{find_overstretched, relative_displacement_beyond};

/// Inputs of every kernel, in slot space; the first three are the displacement, m.
pub const INPUTS: usize = 7;
/// Input that holds the pressure p from dilatation, Pa.
pub const PRESSURE: usize = 3;
/// Input that holds the eigenstrain.
pub const EIGENSTRAIN: usize = 4;
/// Input that holds the bond stiffness c, Pa.
pub const STIFFNESS: usize = 5;
/// Input that holds the limit of bonds: critical stretch, or energy in J/m².
pub const CRITICAL: usize = 6;

/// Inputs of the point of a bond and of its other end.
#[derive(Clone, Copy, Debug)]
pub struct Ends<'a, const I: usize = INPUTS, N = f64> {
    /// Inputs of the point.
    pub own: &'a [N; I],
    /// Inputs of the other end.
    pub other: &'a [N; I],
}

impl<'a, const I: usize, N: Number> Ends<'a, I, N> {
    #[inline(always)]
    fn new(own: &'a [N; I], other: &'a [N; I]) -> Self {
        Ends { own, other }
    }

    /// Mean of an input.
    #[inline(always)]
    pub fn mean(&self, input: usize) -> N {
        (self.own[input] + self.other[input]) * 0.5
    }
}

/// Elastic stretch of a bond: without the eigenstrain, of which the bond has the mean of its ends. That of a linear
/// eigenstrain is zero in a free body, whose bonds have just this stretch.
#[inline(always)]
fn elastic_stretch<N: Number>(stretch: N, ends: Ends<'_, INPUTS, N>) -> N {
    stretch - ends.mean(EIGENSTRAIN)
}

/// Stretch of a bond, `scale sum_a relative_a arm_a`.
struct Stretched<const D: usize, N = f64> {
    relative: [N; D],
    arm: [N; D],
    scale: N,
    /// The current bond, m; the reference one in linear kinematics.
    along: [N; D],
    /// One over the length of `along`, 1/m.
    inverse_length: N,
}

#[inline(always)]
fn stretched<const FINITE: bool, const D: usize, const I: usize, N: Number>(
    bond: &Bond<N>,
    ends: Ends<'_, I, N>,
) -> Stretched<D, N> {
    stretched_by::<FINITE, false, D, I, N>(bond, ends)
}

/// [`stretched`], by fused multiply-adds if `FUSED`.
#[inline(always)]
fn stretched_by<
    const FINITE: bool,
    const FUSED: bool,
    const D: usize,
    const I: usize,
    N: Number,
>(
    bond: &Bond<N>,
    ends: Ends<'_, I, N>,
) -> Stretched<D, N> {
    let Ends { own, other } = ends;
    let relative: [N; D] = std::array::from_fn(|a| other[a] - own[a]);
    let xi: [N; D] = std::array::from_fn(|a| bond.xi[a]);
    if FINITE {
        let along: [N; D] = std::array::from_fn(|a| xi[a] + relative[a]);
        let length = positive(dot::<FUSED, D, N>(along, along)).sqrt();
        // l - l0 = (l^2 - l0^2) / (l + l0) avoids cancellation at small stretches; one division serves both
        // the stretch and the direction
        let sum = (length + bond.length) * bond.length;
        let inverse = N::from(1.0) / (length * sum);
        Stretched {
            arm: std::array::from_fn(|a| xi[a] + along[a]),
            scale: inverse * length,
            inverse_length: inverse * sum,
            relative,
            along,
        }
    } else {
        Stretched {
            arm: xi,
            scale: bond.inverse_length * bond.inverse_length,
            along: xi,
            relative,
            inverse_length: bond.inverse_length,
        }
    }
}

/// The square of a length, or the least positive number in place of zero: ends of a bond that coincide have a stretch of
/// -1, and no direction for a force.
#[inline(always)]
fn positive<N: Number>(square: N) -> N {
    let least = N::from(f64::MIN_POSITIVE);
    square.select_above(least, square, least)
}

/// Starts from the first product, not from zero, since compilers keep an addition of zero.
#[inline(always)]
fn dot<const FUSED: bool, const D: usize, N: Number>(a: [N; D], b: [N; D]) -> N {
    (1..D).fold(a[0] * b[0], |sum, axis| match FUSED {
        true => a[axis].mul_add(b[axis], sum),
        false => sum + a[axis] * b[axis],
    })
}

impl<const D: usize, N: Number> Stretched<D, N> {
    #[inline(always)]
    fn stretch(&self) -> N {
        self.stretch_by::<false>()
    }

    #[inline(always)]
    fn stretch_by<const FUSED: bool>(&self) -> N {
        self.scale * dot::<FUSED, D, N>(self.relative, self.arm)
    }

    /// A vector along the bond.
    #[inline(always)]
    fn vector(&self, size: N) -> [N; D] {
        let size = size * self.inverse_length;
        std::array::from_fn(|a| size * self.along[a])
    }
}

impl<const D: usize> Stretched<D> {
    /// Contributions of the axes to the stretch.
    #[inline(always)]
    fn parts(&self) -> [f64; D] {
        std::array::from_fn(|a| self.relative[a] * self.arm[a] * self.scale)
    }

    /// Adds a vector along the bond to one end, and subtracts it from the other.
    #[inline(always)]
    fn add_pull<const O: usize>(&self, size: f64, [here, there]: [&mut [f64; O]; 2]) {
        let size = size * self.inverse_length;
        for axis in 0..D {
            here[axis] = size.mul_add(self.along[axis], here[axis]);
            there[axis] = (-size).mul_add(self.along[axis], there[axis]);
        }
    }
}

#[inline(always)]
fn stretched_in(finite: bool, bond: &Bond, ends: Ends<'_>) -> Stretched<3> {
    match finite {
        true => stretched::<true, 3, _, _>(bond, ends),
        false => stretched::<false, 3, _, _>(bond, ends),
    }
}

#[inline(always)]
fn dyad(factor: f64, &[x, y, z]: &[f64; 3]) -> [f64; 6] {
    [x * x, y * y, z * z, x * y, y * z, z * x].map(|n| factor * n)
}
