//! Loads and limits of bonds that break.

use perimelt_core::{Bond, BondKernel};

use super::{
    BondForce, CRITICAL, EIGENSTRAIN, Ends, INPUTS, elastic_stretch, stretched, stretched_by,
    stretched_in,
};

/// The kernel `Force` along `D` axes, and the sum of the excess of bonds over their limits (of energy if `ENERGY`).
pub struct Breaking<const D: usize, const FINITE: bool, L, const ENERGY: bool>(pub L);

/// The load of a bond over its limit (`[0]`), and its excess over the limit (`[1]`), as in [`Breaking`].
#[derive(Clone, Copy, Debug)]
pub struct Load<L> {
    /// Finite kinematics.
    pub finite: bool,
    /// The limit is one of energy.
    pub energy: bool,
    /// The forces of the bonds.
    pub law: L,
}

/// Sum of the excess of bonds over their critical stretch, in a correspondence solid. Inputs: the displacement,
/// eigenstrain, critical stretch.
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
        let ends = Ends::new(&own, &other);
        let stretch = stretched::<FINITE, 3, _, _>(bond, ends).stretch();
        let elastic = elastic_stretch(stretch, ends);
        (elastic, ends.mean(CRITICAL))
    }
}

/// Stretch of a bond and the force density along it, N/m³.
struct BondStretch {
    stretch: f64,
    force: f64,
}

/// Load of a bond and its limit: thermo-elastic stretch, or energy and limit both times the weight. The load is
/// positive in tension only.
#[inline(always)]
fn load_and_limit<L: BondForce>(
    law: L,
    energy: bool,
    bond: &Bond,
    stretched: BondStretch,
    ends: Ends<'_>,
) -> (f64, f64) {
    let BondStretch { stretch, force } = stretched;
    let elastic = elastic_stretch(stretch, ends);
    let limit = ends.mean(CRITICAL);
    match energy {
        true => {
            let mean = law.mean_tension(bond, stretch, ends, force);
            (mean.max(0.0) * bond.length * elastic, limit * bond.mean())
        }
        false => (elastic, limit),
    }
}

impl<const D: usize, const FINITE: bool, L: BondForce, const ENERGY: bool> BondKernel<INPUTS, 4>
    for Breaking<D, FINITE, L, ENERGY>
{
    const PAIRED: usize = if FINITE { D } else { 0 };

    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; INPUTS], other: [f64; INPUTS]) -> [f64; 4] {
        let ends = Ends::new(&own, &other);
        let change = stretched::<FINITE, D, _, _>(bond, ends);
        let stretch = change.stretch();
        let force = self.0.tension(bond, stretch, ends);
        let stretched = BondStretch { stretch, force };
        let (load, limit) = load_and_limit(self.0, ENERGY, bond, stretched, ends);
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
        let ends = Ends::new(&own, &other);
        let change = stretched_by::<FINITE, true, D, _, _>(bond, ends);
        let stretch = change.stretch_by::<true>();
        let force = self.0.tension(bond, stretch, ends);
        let stretched = BondStretch { stretch, force };
        let (load, limit) = load_and_limit(self.0, ENERGY, bond, stretched, ends);
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

impl<L: BondForce> BondKernel<INPUTS, 2> for Load<L> {
    const RARE: bool = true;

    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; INPUTS], other: [f64; INPUTS]) -> [f64; 2] {
        let ends = Ends::new(&own, &other);
        let stretch = stretched_in(self.finite, bond, ends).stretch();
        let force = self.law.tension(bond, stretch, ends);
        let stretched = BondStretch { stretch, force };
        let (load, limit) = load_and_limit(self.law, self.energy, bond, stretched, ends);
        [load / limit, (load - limit).max(0.0)]
    }
}
