//! Bond kernels of the bond-based thermoelastic solid.
//!
//! ```text
//! f_i = sum_j c_ij (s - e_ij) n v V_j        Wang (2025), eq. 7.15; bracket corrected, spec 02, E7
//! s   = (|y_j - y_i| - |xi|) / |xi|          finite kinematics, eq. 3.5
//! s   = n . (u_j - u_i) / |xi|               linear kinematics
//! e_ij = (e_i + e_j) / 2,   c_ij = (E_i + E_j) / 2 * 2 d K / M
//! ```
//!
//! `e` is the eigenstrain field (thermal expansion), `E` Young's modulus, `d` the dimension, `K`
//! the bulk modulus for `E = 1` and `M` the integral of `|xi| n_m^2 dV` over the horizon: the
//! energy of isotropic strain is the classical one, on any lattice.

use perimelt_core::{Bond, BondKernel};

/// Inputs of every kernel, in slot space.
pub const INPUTS: usize = 5;
/// Input that holds the eigenstrain; those before it are the components of displacement (m).
pub const EIGENSTRAIN: usize = 3;
/// Input that holds Young's modulus where it varies (Pa).
pub const MODULUS: usize = 4;

type Ends<'a> = (&'a [f64; INPUTS], &'a [f64; INPUTS]);

/// Bulk modulus over Young's modulus, mean stress per sum of strains in the dimensions there
/// are: `1 / (d (1 - (d - 1) nu))`; Poisson's ratio of bond-based solids is 1/4 in 3D and 1/3
/// in plane stress.
pub fn bulk_modulus(dimension: usize) -> f64 {
    match dimension {
        1 => 1.0,
        2 => 3.0 / 4.0,
        _ => 2.0 / 3.0,
    }
}

/// The bond constant `c` (N/m⁶ in 3D) of a body: with `VARYING` modulus, `c / E`.
#[derive(Clone, Copy, Debug)]
pub struct Law<const VARYING: bool> {
    /// `c`, or `c / E`.
    pub bond_constant: f64,
}

impl<const VARYING: bool> Law<VARYING> {
    #[inline(always)]
    fn constant(&self, bond: &Bond, (own, other): Ends<'_>) -> f64 {
        let constant = self.bond_constant * bond.mean();
        if VARYING {
            constant * (0.5 * (own[MODULUS] + other[MODULUS]))
        } else {
            constant
        }
    }
}

/// Force density of the bonds, N/m³.
pub struct Force<const FINITE: bool, const VARYING: bool>(pub Law<VARYING>);

/// Stiffness times displacement, N/m³: the linear part of minus [`Force`].
pub struct Stiffness<const VARYING: bool>(pub Law<VARYING>);

/// Diagonal block of the stiffness, `sum_j c n n^T v V_j / |xi|`, as xx, yy, zz, xy, yz, zx, N/m⁵.
pub struct Block<const VARYING: bool>(pub Law<VARYING>);

/// Elastic energy density `sum_j c s^2 |xi| v V_j / 4` (J/m³) and eigenstress
/// `sum_j c s |xi| v V_j / 2` (Pa), both of the total stretch `s`.
pub struct Energy<const FINITE: bool, const VARYING: bool, const D: usize>(pub Law<VARYING>);

/// Peridynamic stress `sum_j c (s - e_ij) |xi| n n^T v V_j / 2` (Pa) as xx, yy, zz, xy, yz, zx:
/// the mean over the family of the momentum that its bonds carry. Exact for isotropic strain;
/// else the modulus is that of the lattice.
pub struct Stress<const FINITE: bool, const VARYING: bool, const D: usize>(pub Law<VARYING>);

/// Stretch and current direction of a bond.
#[inline(always)]
fn stretch<const FINITE: bool, const D: usize>(
    bond: &Bond,
    (own, other): Ends<'_>,
) -> (f64, [f64; D]) {
    let relative: [f64; D] = std::array::from_fn(|a| other[a] - own[a]);
    if FINITE {
        let current: [f64; D] = std::array::from_fn(|a| bond.xi[a] + relative[a]);
        let length = dot(&current, &current).sqrt();
        // l - l0 = (l^2 - l0^2) / (l + l0): small stretches keep their digits
        let twice: [f64; D] = std::array::from_fn(|a| bond.xi[a] + current[a]);
        let elongation = dot(&relative, &twice) / (length + bond.length);
        (elongation / bond.length, current.map(|y| y / length))
    } else {
        let direction: [f64; D] = std::array::from_fn(|a| bond.xi[a] / bond.length);
        (dot(&direction, &relative) / bond.length, direction)
    }
}

#[inline(always)]
fn dot<const D: usize>(a: &[f64; D], b: &[f64; D]) -> f64 {
    (0..D).fold(0.0, |sum, i| sum + a[i] * b[i])
}

impl<const FINITE: bool, const VARYING: bool, const D: usize> BondKernel<INPUTS, D>
    for Force<FINITE, VARYING>
{
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; INPUTS], other: [f64; INPUTS]) -> [f64; D] {
        let ends = (&own, &other);
        let (stretch, direction) = stretch::<FINITE, D>(bond, ends);
        let eigenstrain = 0.5 * (own[EIGENSTRAIN] + other[EIGENSTRAIN]);
        let force = self.0.constant(bond, ends) * (stretch - eigenstrain);
        direction.map(|n| force * n)
    }
}

impl<const VARYING: bool, const D: usize> BondKernel<INPUTS, D> for Stiffness<VARYING> {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; INPUTS], other: [f64; INPUTS]) -> [f64; D] {
        let ends = (&own, &other);
        let (stretch, direction) = stretch::<false, D>(bond, ends);
        let force = -self.0.constant(bond, ends) * stretch;
        direction.map(|n| force * n)
    }
}

impl<const FINITE: bool, const VARYING: bool, const D: usize> BondKernel<INPUTS, 6>
    for Stress<FINITE, VARYING, D>
{
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; INPUTS], other: [f64; INPUTS]) -> [f64; 6] {
        let ends = (&own, &other);
        let (stretch, direction) = stretch::<FINITE, D>(bond, ends);
        let eigenstrain = 0.5 * (own[EIGENSTRAIN] + other[EIGENSTRAIN]);
        let tension = 0.5 * self.0.constant(bond, ends) * (stretch - eigenstrain) * bond.length;
        let [x, y, z] = std::array::from_fn(|a| if a < D { direction[a] } else { 0.0 });
        [x * x, y * y, z * z, x * y, y * z, z * x].map(|n| tension * n)
    }
}

impl<const VARYING: bool> BondKernel<INPUTS, 6> for Block<VARYING> {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; INPUTS], other: [f64; INPUTS]) -> [f64; 6] {
        let constant = self.0.constant(bond, (&own, &other)) / bond.length;
        let [x, y, z] = bond.xi.map(|xi| xi / bond.length);
        [x * x, y * y, z * z, x * y, y * z, z * x].map(|n| constant * n)
    }
}

impl<const FINITE: bool, const VARYING: bool, const D: usize> BondKernel<INPUTS, 2>
    for Energy<FINITE, VARYING, D>
{
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; INPUTS], other: [f64; INPUTS]) -> [f64; 2] {
        let ends = (&own, &other);
        let (stretch, _) = stretch::<FINITE, D>(bond, ends);
        let eigenstress = 0.5 * self.0.constant(bond, ends) * bond.length * stretch;
        [0.5 * eigenstress * stretch, eigenstress]
    }
}
