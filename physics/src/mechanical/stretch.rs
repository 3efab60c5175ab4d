//! Bond kernels of solids whose bonds pull along themselves: bond-based and ordinary state-based.
//!
//! ```text
//! T_ij = [ c_i/2 (s - e_i) + p_i / |xi| ] w_ij n         Wang (2025), eqs. 3.3, 3.10; spec 04, 1.3
//! f_i  = sum_j T_ij - T_ji
//! s    = (|y_j - y_i| - |xi|) / |xi|                     finite kinematics, eq. 3.5
//! s    = n . (u_j - u_i) / |xi|                          linear kinematics
//! c = 2 (d + 2) mu,   p = 2 a N theta,   theta = N sum_j s w_ij - d e,   N = d / sum_j w_ij
//! ```
//!
//! `w` is the weight of the bond in the family of the owner of the force state (`c` and `p` are free
//! of horizons, whose moment the weights hold), `e` the eigenstrain (thermal expansion), `mu` the
//! shear modulus, `a` the dilatation stiffness, `d` the dimension. In a bond-based solid `a` and `p`
//! are zero, and a bond takes the means of c and e at its ends. Forces are the derivative of the energy `sum_i V_i (a theta_i^2 + c_i/4 sum_j w_ij
//! |xi| (s - e_i)^2)`, with single and dual horizons.

use perimelt_core::{Bond, BondKernel};

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

type Ends<'a> = (&'a [f64; INPUTS], &'a [f64; INPUTS]);

/// Force density along a bond of a bond-based solid, which takes the means of its ends (Wang (2025), eqs.
/// 7.14, 7.15), N/m³. The owners' states would give the mean of the products, several percent apart
/// where stiffness and eigenstrain change within a horizon, as at a melt pool.
#[inline(always)]
fn pair_tension(bond: &Bond, stretch: f64, (own, other): Ends<'_>) -> f64 {
    let mean = |i: usize| 0.5 * (own[i] + other[i]);
    bond.mean() * mean(STIFFNESS) * (stretch - mean(EIGENSTRAIN))
}

/// Force density along the bond from the stretch of both ends, N/m³.
#[inline(always)]
fn tension(bond: &Bond, stretch: f64, (own, other): Ends<'_>) -> f64 {
    // the same at both ends where points differ in what moves them only
    let end = |point: &[f64; INPUTS]| 0.5 * point[STIFFNESS] * (stretch - point[EIGENSTRAIN]);
    bond.weight * end(own) + bond.dual * end(other)
}

#[inline(always)]
fn pressure(bond: &Bond, (own, other): Ends<'_>) -> f64 {
    (bond.weight * own[PRESSURE] + bond.dual * other[PRESSURE]) * bond.inverse_length
}

/// Force density along the bond of either solid, N/m³.
#[inline(always)]
fn pull<const DILATATION: bool>(bond: &Bond, stretch: f64, ends: Ends<'_>) -> f64 {
    match DILATATION {
        true => tension(bond, stretch, ends) + pressure(bond, ends),
        false => pair_tension(bond, stretch, ends),
    }
}

/// Force density of the bonds, N/m³.
pub struct Force<const FINITE: bool, const DILATATION: bool>;

/// [`Force`] along `D` axes, and by how much the bonds that are to break exceed their limit (`ENERGY`: of
/// energy), in all.
pub struct Breaking<const D: usize, const FINITE: bool, const DILATATION: bool, const ENERGY: bool>;

/// What [`Breaking`] compares, over its limit (`[0]`), and the excess over the limit (`[1]`).
pub struct Load {
    /// Finite kinematics.
    pub finite: bool,
    /// The limit is one of energy.
    pub energy: bool,
    /// Bonds take the means of their ends: a bond-based solid.
    pub pairs: bool,
}

/// By how much the bonds that are to break exceed their critical stretch, in all, of a solid whose bonds do
/// not pull along themselves. Inputs: the displacement, eigenstrain, critical stretch.
pub struct Excess<const FINITE: bool>;

/// Inputs of [`Excess`].
pub const EXCESS_INPUTS: usize = 5;

impl<const FINITE: bool> Excess<FINITE> {
    /// Thermo-elastic stretch of a bond, and the critical one.
    #[inline(always)]
    pub fn stretch_and_limit(
        bond: &Bond,
        own: [f64; EXCESS_INPUTS],
        other: [f64; EXCESS_INPUTS],
    ) -> (f64, f64) {
        let [own, other] = [own, other].map(|[x, y, z, eigenstrain, critical]| {
            let mut end = [x, y, z, 0.0, 0.0, 0.0, 0.0];
            (end[EIGENSTRAIN], end[CRITICAL]) = (eigenstrain, critical);
            end
        });
        let ends = (&own, &other);
        let stretch = stretched::<FINITE, 3, _>(bond, ends).stretch();
        load_and_limit(false, bond, (stretch, 0.0), ends)
    }
}

/// Stiffness times displacement, N/m³: the linear part of minus [`Force`], with the pressure that the
/// displacement makes.
pub struct Stiffness<const DILATATION: bool>;

/// What the bonds contribute to the diagonal block of the stiffness, `sum_j (c_i w_ij + c_j w_ji) /
/// (2 |xi|) n n^T`, as xx, yy, zz, xy, yz, zx, N/m⁵.
pub struct Block;

/// `sum_j w s`.
pub struct Dilation<const FINITE: bool>;

/// [`Dilation`] in parts along the axes, whose sum it is.
pub struct Expansion<const FINITE: bool>;

/// `sum_j w`.
pub struct TotalWeight;

/// `sum_j w n (x) n` as xx, yy, zz, xy, yz, zx.
pub struct Directions;

/// `sum_j w / |xi|`.
pub struct WeightOverLength;

/// Of the point's own bonds and their total stretch: the energy density `c/4 sum_j w |xi| s^2`
/// (J/m³) and the stress `c/2 sum_j w |xi| s` conjugate to the eigenstrain (Pa), with the means of both
/// ends where bonds take those.
pub struct Energy<const FINITE: bool> {
    /// Bonds take the means of their ends: a bond-based solid.
    pub pairs: bool,
}

/// Peridynamic stress `sum_j T_ij (x) xi` (Pa) as xx, yy, zz, xy, yz, zx (spec 07, 1.8, S1): the
/// momentum that the point's own bonds carry; or half of that of both ends, `1/2 sum_j (T_ij - T_ji) (x) xi` (S2).
pub struct Stress {
    /// Finite kinematics.
    pub finite: bool,
    /// S2: where horizons change, S1 is farther off within a horizon. Both add up to the same over a body.
    pub symmetric: bool,
}

/// A kernel for points that differ in their first inputs only, and take the others from one point.
pub struct Uniform<'a, K>(pub &'a K, pub [f64; INPUTS]);

/// A kernel for points with a plastic strain besides the eigenstrain: inputs from [`INPUTS`] on are
/// its components xx, yy, zz, xy, yz, zx.
pub struct Plastic<K>(pub K);

/// Inputs of [`Plastic`] kernels.
pub const PLASTIC_INPUTS: usize = INPUTS + 6;

/// How a bond is stretched: by `scale sum_a relative_a arm_a`, of which each axis has its part.
struct Stretched<const D: usize> {
    relative: [f64; D],
    arm: [f64; D],
    scale: f64,
    /// Along the bond, m.
    along: [f64; D],
    /// One over the length of `along`, 1/m.
    inverse_length: f64,
}

#[inline(always)]
fn stretched<const FINITE: bool, const D: usize, const I: usize>(
    bond: &Bond,
    ends: (&[f64; I], &[f64; I]),
) -> Stretched<D> {
    stretched_by::<FINITE, false, D, I>(bond, ends)
}

/// [`stretched`], by fused multiply-adds if `FUSED`.
#[inline(always)]
fn stretched_by<const FINITE: bool, const FUSED: bool, const D: usize, const I: usize>(
    bond: &Bond,
    (own, other): (&[f64; I], &[f64; I]),
) -> Stretched<D> {
    let relative: [f64; D] = std::array::from_fn(|a| other[a] - own[a]);
    let xi: [f64; D] = std::array::from_fn(|a| bond.xi[a]);
    if FINITE {
        let along: [f64; D] = std::array::from_fn(|a| xi[a] + relative[a]);
        let length = dot::<FUSED, D>(along, along).sqrt();
        // l - l0 = (l^2 - l0^2) / (l + l0): small stretches keep their digits; one division serves
        // both this and the direction
        let sum = (length + bond.length) * bond.length;
        let inverse = 1.0 / (length * sum);
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

/// Not begun from zero: a compiler has to add it.
#[inline(always)]
fn dot<const FUSED: bool, const D: usize>(a: [f64; D], b: [f64; D]) -> f64 {
    (1..D).fold(a[0] * b[0], |sum, axis| match FUSED {
        true => a[axis].mul_add(b[axis], sum),
        false => sum + a[axis] * b[axis],
    })
}

impl<const D: usize> Stretched<D> {
    #[inline(always)]
    fn stretch(&self) -> f64 {
        self.stretch_by::<false>()
    }

    #[inline(always)]
    fn stretch_by<const FUSED: bool>(&self) -> f64 {
        self.scale * dot::<FUSED, D>(self.relative, self.arm)
    }

    /// Parts of the stretch along the axes.
    #[inline(always)]
    fn parts(&self) -> [f64; D] {
        std::array::from_fn(|a| self.relative[a] * self.arm[a] * self.scale)
    }

    /// Adds a vector along the bond to one end, and takes it from the other.
    #[inline(always)]
    fn add_pull<const O: usize>(&self, size: f64, [here, there]: [&mut [f64; O]; 2]) {
        let size = size * self.inverse_length;
        for axis in 0..D {
            here[axis] = size.mul_add(self.along[axis], here[axis]);
            there[axis] = (-size).mul_add(self.along[axis], there[axis]);
        }
    }

    /// A vector along the bond.
    #[inline(always)]
    fn vector(&self, size: f64) -> [f64; D] {
        let size = size * self.inverse_length;
        std::array::from_fn(|a| size * self.along[a])
    }
}

#[inline(always)]
fn stretched_in(finite: bool, bond: &Bond, ends: Ends<'_>) -> Stretched<3> {
    match finite {
        true => stretched::<true, 3, _>(bond, ends),
        false => stretched::<false, 3, _>(bond, ends),
    }
}

#[inline(always)]
fn dyad(factor: f64, &[x, y, z]: &[f64; 3]) -> [f64; 6] {
    [x * x, y * y, z * z, x * y, y * z, z * x].map(|n| factor * n)
}

impl<const FINITE: bool, const DILATATION: bool, const D: usize> BondKernel<INPUTS, D>
    for Force<FINITE, DILATATION>
{
    const PAIRED: usize = if FINITE { D } else { 0 };

    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; INPUTS], other: [f64; INPUTS]) -> [f64; D] {
        let ends = (&own, &other);
        let change = stretched::<FINITE, D, _>(bond, ends);
        change.vector(pull::<DILATATION>(bond, change.stretch(), ends))
    }

    #[inline(always)]
    fn add_ends(
        &self,
        bond: &Bond,
        own: [f64; INPUTS],
        other: [f64; INPUTS],
        sums: [&mut [f64; D]; 2],
    ) {
        let ends = (&own, &other);
        let change = stretched_by::<FINITE, true, D, _>(bond, ends);
        change.add_pull(
            pull::<DILATATION>(bond, change.stretch_by::<true>(), ends),
            sums,
        );
    }
}

/// What is compared with the limit of a bond, and the limit: thermo-elastic stretch, or energy and limit
/// both times the weight; not above zero unless the bond is pulled. `force` along the bond in N/m³.
#[inline(always)]
fn load_and_limit(
    energy: bool,
    bond: &Bond,
    (stretch, force): (f64, f64),
    (own, other): Ends<'_>,
) -> (f64, f64) {
    let elastic = stretch - 0.5 * (own[EIGENSTRAIN] + other[EIGENSTRAIN]);
    let limit = 0.5 * (own[CRITICAL] + other[CRITICAL]);
    match energy {
        true => (
            0.5 * force.max(0.0) * bond.length * elastic,
            limit * bond.mean(),
        ),
        false => (elastic, limit),
    }
}

impl<const D: usize, const FINITE: bool, const DILATATION: bool, const ENERGY: bool>
    BondKernel<INPUTS, 4> for Breaking<D, FINITE, DILATATION, ENERGY>
{
    const PAIRED: usize = if FINITE { D } else { 0 };

    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; INPUTS], other: [f64; INPUTS]) -> [f64; 4] {
        let ends = (&own, &other);
        let change = stretched::<FINITE, D, _>(bond, ends);
        let stretch = change.stretch();
        let force = pull::<DILATATION>(bond, stretch, ends);
        let (load, limit) = load_and_limit(ENERGY, bond, (stretch, force), ends);
        let mut sums = [0.0, 0.0, 0.0, (load - limit).max(0.0)];
        let vector = change.vector(force);
        (0..D).for_each(|axis| sums[axis] = vector[axis]);
        sums
    }

    #[inline(always)]
    fn add_ends(
        &self,
        bond: &Bond,
        own: [f64; INPUTS],
        other: [f64; INPUTS],
        [here, there]: [&mut [f64; 4]; 2],
    ) {
        let ends = (&own, &other);
        let change = stretched_by::<FINITE, true, D, _>(bond, ends);
        let stretch = change.stretch_by::<true>();
        let force = pull::<DILATATION>(bond, stretch, ends);
        let (load, limit) = load_and_limit(ENERGY, bond, (stretch, force), ends);
        here[3] += (load - limit).max(0.0);
        change.add_pull(force, [here, there]);
    }
}

impl<const FINITE: bool> BondKernel<EXCESS_INPUTS, 1> for Excess<FINITE> {
    #[inline(always)]
    fn bond(
        &self,
        bond: &Bond,
        own: [f64; EXCESS_INPUTS],
        other: [f64; EXCESS_INPUTS],
    ) -> [f64; 1] {
        let (stretch, limit) = Self::stretch_and_limit(bond, own, other);
        [(stretch - limit).max(0.0)]
    }
}

impl BondKernel<INPUTS, 2> for Load {
    const RARE: bool = true;

    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; INPUTS], other: [f64; INPUTS]) -> [f64; 2] {
        let ends = (&own, &other);
        let stretch = stretched_in(self.finite, bond, ends).stretch();
        let force = match self.pairs {
            true => pull::<false>(bond, stretch, ends),
            false => pull::<true>(bond, stretch, ends),
        };
        let (load, limit) = load_and_limit(self.energy, bond, (stretch, force), ends);
        [load / limit, (load - limit).max(0.0)]
    }
}

impl<const DILATATION: bool, const D: usize> BondKernel<INPUTS, D> for Stiffness<DILATATION> {
    #[inline(always)]
    fn bond(&self, bond: &Bond, mut own: [f64; INPUTS], mut other: [f64; INPUTS]) -> [f64; D] {
        own[EIGENSTRAIN] = 0.0;
        other[EIGENSTRAIN] = 0.0;
        Force::<false, DILATATION>
            .bond(bond, own, other)
            .map(|f: f64| -f)
    }
}

impl<const FINITE: bool> BondKernel<3, 1> for Dilation<FINITE> {
    const PAIRED: usize = if FINITE { 1 } else { 0 };

    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; 3], other: [f64; 3]) -> [f64; 1] {
        let [here, _] = self.ends(bond, own, other);
        here
    }

    #[inline(always)]
    fn ends(&self, bond: &Bond, own: [f64; 3], other: [f64; 3]) -> [[f64; 1]; 2] {
        let stretch = stretched::<FINITE, 3, _>(bond, (&own, &other)).stretch();
        [[bond.weight * stretch], [bond.dual * stretch]]
    }

    #[inline(always)]
    fn add_ends(
        &self,
        bond: &Bond,
        own: [f64; 3],
        other: [f64; 3],
        [[here], [there]]: [&mut [f64; 1]; 2],
    ) {
        let change = stretched_by::<FINITE, true, 3, _>(bond, (&own, &other));
        let stretch = change.stretch_by::<true>();
        *here = bond.weight.mul_add(stretch, *here);
        *there = bond.dual.mul_add(stretch, *there);
    }
}

impl<const FINITE: bool> BondKernel<3, 3> for Expansion<FINITE> {
    const PAIRED: usize = if FINITE { 3 } else { 0 };

    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; 3], other: [f64; 3]) -> [f64; 3] {
        let [here, _] = self.ends(bond, own, other);
        here
    }

    #[inline(always)]
    fn ends(&self, bond: &Bond, own: [f64; 3], other: [f64; 3]) -> [[f64; 3]; 2] {
        let parts = stretched::<FINITE, 3, _>(bond, (&own, &other)).parts();
        [
            std::array::from_fn(|a| bond.weight * parts[a]),
            std::array::from_fn(|a| bond.dual * parts[a]),
        ]
    }
}

impl BondKernel<0, 1> for TotalWeight {
    const RARE: bool = true;

    #[inline(always)]
    fn bond(&self, bond: &Bond, _: [f64; 0], _: [f64; 0]) -> [f64; 1] {
        [bond.weight]
    }
}

impl BondKernel<INPUTS, 6> for Directions {
    #[inline(always)]
    fn bond(&self, bond: &Bond, _: [f64; INPUTS], _: [f64; INPUTS]) -> [f64; 6] {
        dyad(bond.weight, &bond.xi.map(|xi| xi / bond.length))
    }
}

impl BondKernel<INPUTS, 1> for WeightOverLength {
    const RARE: bool = true;

    #[inline(always)]
    fn bond(&self, bond: &Bond, _: [f64; INPUTS], _: [f64; INPUTS]) -> [f64; 1] {
        [bond.weight / bond.length]
    }
}

impl BondKernel<INPUTS, 6> for Block {
    const RARE: bool = true;

    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; INPUTS], other: [f64; INPUTS]) -> [f64; 6] {
        let ends = own[STIFFNESS] * bond.weight + other[STIFFNESS] * bond.dual;
        dyad(
            0.5 * ends / bond.length,
            &bond.xi.map(|xi| xi / bond.length),
        )
    }
}

impl<const FINITE: bool> BondKernel<INPUTS, 2> for Energy<FINITE> {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; INPUTS], other: [f64; INPUTS]) -> [f64; 2] {
        let stretch = stretched::<FINITE, 3, _>(bond, (&own, &other)).stretch();
        let density = 0.25 * own[STIFFNESS] * bond.weight * bond.length * stretch * stretch;
        let force = match self.pairs {
            true => 0.5 * (own[STIFFNESS] + other[STIFFNESS]) * bond.mean(),
            false => own[STIFFNESS] * bond.weight,
        };
        [density, 0.5 * force * bond.length * stretch]
    }
}

impl BondKernel<INPUTS, 6> for Stress {
    const RARE: bool = true;

    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; INPUTS], other: [f64; INPUTS]) -> [f64; 6] {
        let change = stretched_in(self.finite, bond, (&own, &other));
        let carried = |weight: f64, point: &[f64; INPUTS]| {
            let stretch = change.stretch() - point[EIGENSTRAIN];
            weight * (0.5 * point[STIFFNESS] * stretch * bond.length + point[PRESSURE])
        };
        let tension = match self.symmetric {
            true => 0.5 * (carried(bond.weight, &own) + carried(bond.dual, &other)),
            false => carried(bond.weight, &own),
        };
        dyad(tension, &change.vector(1.0))
    }
}

impl<K, const I: usize, const O: usize> BondKernel<I, O> for Uniform<'_, K>
where
    K: BondKernel<INPUTS, O>,
{
    const RARE: bool = K::RARE;
    const PAIRED: usize = K::PAIRED;

    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; I], other: [f64; I]) -> [f64; O] {
        self.0.bond(bond, self.all(own), self.all(other))
    }

    #[inline(always)]
    fn ends(&self, bond: &Bond, own: [f64; I], other: [f64; I]) -> [[f64; O]; 2] {
        self.0.ends(bond, self.all(own), self.all(other))
    }

    #[inline(always)]
    fn add_ends(&self, bond: &Bond, own: [f64; I], other: [f64; I], sums: [&mut [f64; O]; 2]) {
        self.0.add_ends(bond, self.all(own), self.all(other), sums);
    }
}

impl<K> Uniform<'_, K> {
    #[inline(always)]
    fn all<const I: usize>(&self, first: [f64; I]) -> [f64; INPUTS] {
        std::array::from_fn(|i| if i < I { first[i] } else { self.1[i] })
    }
}

impl<K: BondKernel<INPUTS, O>, const O: usize> BondKernel<PLASTIC_INPUTS, O> for Plastic<K> {
    const RARE: bool = K::RARE;
    const PAIRED: usize = K::PAIRED;

    #[inline(always)]
    fn bond(
        &self,
        bond: &Bond,
        own: [f64; PLASTIC_INPUTS],
        other: [f64; PLASTIC_INPUTS],
    ) -> [f64; O] {
        let [own, other] = strained(bond, [own, other]);
        self.0.bond(bond, own, other)
    }

    #[inline(always)]
    fn ends(
        &self,
        bond: &Bond,
        own: [f64; PLASTIC_INPUTS],
        other: [f64; PLASTIC_INPUTS],
    ) -> [[f64; O]; 2] {
        let [own, other] = strained(bond, [own, other]);
        self.0.ends(bond, own, other)
    }

    #[inline(always)]
    fn add_ends(
        &self,
        bond: &Bond,
        own: [f64; PLASTIC_INPUTS],
        other: [f64; PLASTIC_INPUTS],
        sums: [&mut [f64; O]; 2],
    ) {
        let [own, other] = strained(bond, [own, other]);
        self.0.add_ends(bond, own, other, sums);
    }
}

/// Inputs of both ends, with their plastic strain along the bond in the eigenstrain.
#[inline(always)]
fn strained(bond: &Bond, ends: [[f64; PLASTIC_INPUTS]; 2]) -> [[f64; INPUTS]; 2] {
    let [x, y, z] = bond.xi.map(|xi| xi / bond.length);
    let along = [x * x, y * y, z * z, 2.0 * x * y, 2.0 * y * z, 2.0 * z * x];
    ends.map(|inputs| {
        let mut end = std::array::from_fn(|i| inputs[i]);
        for (n, e) in along.iter().zip(&inputs[INPUTS..]) {
            end[EIGENSTRAIN] += n * e;
        }
        end
    })
}
