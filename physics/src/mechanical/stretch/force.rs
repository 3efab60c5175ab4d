//! Forces of the bonds and their linear part.

use perimelt_core::device::DeviceKernel;
use perimelt_core::{Bond, BondKernel, Number};

use super::{BondForce, Ends, INPUTS, STIFFNESS, dyad, elastic_stretch, stretched, stretched_by};

/// Force density of the bonds, N/m³.
#[derive(Clone, Copy, Debug)]
pub struct Force<const FINITE: bool, L>(pub L);

impl<const FINITE: bool, L: BondForce, const D: usize> BondKernel<INPUTS, D> for Force<FINITE, L> {
    const PAIRED: usize = if FINITE { D } else { 0 };

    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; INPUTS], other: [f64; INPUTS]) -> [f64; D] {
        self.bond_of(bond, own, other)
    }

    #[inline(always)]
    fn add_ends(
        &self,
        bond: &Bond,
        own: [f64; INPUTS],
        other: [f64; INPUTS],
        sums: [&mut [f64; D]; 2],
    ) {
        let ends = Ends::new(&own, &other);
        let change = stretched_by::<FINITE, true, D, _, _>(bond, ends);
        change.add_pull(
            self.0.tension(bond, change.stretch_by::<true>(), ends),
            sums,
        );
    }
}

impl<const FINITE: bool, L: BondForce, const D: usize> DeviceKernel<INPUTS, D>
    for Force<FINITE, L>
{
    #[inline(always)]
    fn bond_of<N: Number>(&self, bond: &Bond<N>, own: [N; INPUTS], other: [N; INPUTS]) -> [N; D] {
        let ends = Ends::new(&own, &other);
        let change = stretched::<FINITE, D, _, _>(bond, ends);
        change.vector(self.0.tension(bond, change.stretch(), ends))
    }
}

/// Stiffness times displacement, N/m³: the linear part of minus [`Force`], with the pressure that the
/// displacement makes.
pub struct Stiffness<L>(pub L);

impl<L: BondForce, const D: usize> BondKernel<INPUTS, D> for Stiffness<L> {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; INPUTS], other: [f64; INPUTS]) -> [f64; D] {
        let ends = Ends::new(&own, &other);
        let change = stretched::<false, D, _, _>(bond, ends);
        let force = self.0.along(bond, ends, change.stretch(), 1.0);
        change.vector(force).map(|f| -f)
    }
}

/// The change of minus [`Force`] with a change of the displacement, N/m³, about a displacement: inputs from [`INPUTS`] on are
/// its components. The pressure is that of the change. In linear kinematics.
pub struct Tangent<L>(pub L);

/// Inputs of [`Tangent`].
pub const TANGENT_INPUTS: usize = INPUTS + 3;

impl<L: BondForce, const D: usize> BondKernel<TANGENT_INPUTS, D> for Tangent<L> {
    #[inline(always)]
    fn bond(
        &self,
        bond: &Bond,
        own: [f64; TANGENT_INPUTS],
        other: [f64; TANGENT_INPUTS],
    ) -> [f64; D] {
        let [own, other] = [own, other].map(|inputs| {
            let [x, y, z, rest @ .., a, b, c] = inputs;
            let [pressure, eigenstrain, stiffness, critical] = rest;
            let change = [x, y, z, pressure, eigenstrain, stiffness, critical];
            [change, [a, b, c, 0.0, eigenstrain, 0.0, 0.0]]
        });
        let about = Ends::new(&own[1], &other[1]);
        let stretch = stretched::<false, 3, _, _>(bond, about).stretch();
        let slope = self.0.law().slope(elastic_stretch(stretch, about));
        let ends = Ends::new(&own[0], &other[0]);
        let change = stretched::<false, D, _, _>(bond, ends);
        let force = self.0.along(bond, ends, slope * change.stretch(), 1.0);
        change.vector(force).map(|f| -f)
    }
}

/// Contribution of the bonds to the diagonal block of the stiffness, `sum_j (c_i w_ij + c_j w_ji) /
/// (2 |xi|) n n^T`, as xx, yy, zz, xy, yz, zx, N/m⁵.
pub struct Block;

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
