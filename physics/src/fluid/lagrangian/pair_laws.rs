//! Laws of the conservative form over pairs: a point of the fluid, and a neighbour of the fluid or of a body that is a wall.
//!
//! | law | kernel | parameters |
//! |---|---|---|
//! | shape, divergence, kernel sum | [`Survey`] | horizon |
//! | viscosity | [`Survey`] | `plain` or `central` |
//! | diffusion of density | [`Survey`] | `laplacian` |
//! | pressure | [`Push`] | |
//!
//! Laws that need velocity and density alone are one kernel, since a pass over the bonds costs more than its arithmetic: each is a
//! group of sums ([`SurveySums`]) with parameters of its own. Pressure needs the shape tensor of both ends, and is a pass of its own. The
//! family passes the bonds within the fluid to a kernel; [`Walls::add_velocity`] and [`Walls::add_pressure`] pass those to walls, with the
//! same kernel, and [`Walls::give`] gives the walls the opposite of each force.
//!
//! Surface tension is another law: a kernel like [`Push`] of the normals at both ends, after a pass that finds them. Its force belongs to
//! the sum in `Conservative::advance_velocity` and, for wetting, to the forces of `Conservative::give`.
//!
//! [`Walls::add_velocity`]: crate::fluid::walls::Walls::add_velocity
//! [`Walls::add_pressure`]: crate::fluid::walls::Walls::add_pressure
//! [`Walls::give`]: crate::fluid::walls::Walls::give

use perimelt_core::{Bond, BondKernel};

use crate::fluid::viscosity::of_bond;
use crate::shape_tensor::{COMPONENTS, CompleteFamily, components};

/// All sums over the velocity and density around a point in one pass, from [`SurveyInputs`] to [`SurveySums`]; for the viscosity of
/// bonds see [`of_bond`].
pub(super) struct Survey<const D: usize, const IN_SERIES: bool> {
    /// `2 / a`, 1/m.
    laplacian: f64,
    /// m.
    horizon: f64,
    /// 0 for viscous forces along bonds, else 1.
    plain: f64,
    /// `(d + 2) / r^2` for viscous forces along bonds, `(d + 2) (v_j - v_i) . xi xi / r^2` in place of `v_j - v_i`, with
    /// the mean `r^2 = sum w |xi|^4 / sum w |xi|^2` of a complete family; else 0. 1/m².
    central: f64,
}

/// Where the inputs of [`Survey`] begin: the velocity as mirrored by walls, as held by walls, density, viscosity.
pub(super) struct SurveyInputs<const D: usize>;

impl<const D: usize> SurveyInputs<D> {
    pub(super) const HELD: usize = D;
    pub(super) const DENSITY: usize = Self::HELD + D;
    pub(super) const VISCOSITY: usize = Self::DENSITY + 1;
    pub(super) const COUNT: usize = Self::VISCOSITY + 1;
}

/// Where the sums of [`Survey`] begin: the shape tensor `A`, `sum w xi (v_j - v_i)`, viscous force, friction,
/// `(2/a) sum w (rho_j - rho_i)`, `(2/a) sum w xi`, kernel sum.
pub(super) struct SurveySums<const D: usize>;

impl<const D: usize> SurveySums<D> {
    pub(super) const SLOPES: usize = components(D);
    pub(super) const FORCE: usize = Self::SLOPES + D * D;
    pub(super) const FRICTION: usize = Self::FORCE + D;
    pub(super) const DENSITY_LAPLACIAN: usize = Self::FRICTION + 1;
    pub(super) const ASYMMETRY: usize = Self::DENSITY_LAPLACIAN + 1;
    pub(super) const CROWDING: usize = Self::ASYMMETRY + D;
    pub(super) const COUNT: usize = Self::CROWDING + 1;
    /// What a wall with slip does not exert: the force of viscosity and its heat.
    pub(super) const VISCOUS: std::ops::Range<usize> = Self::FORCE..Self::FRICTION + 1;
}

/// Where the inputs of [`Push`] begin: the pressure, `A^-1`.
pub(super) struct PushInputs<const D: usize>;

impl<const D: usize> PushInputs<D> {
    pub(super) const INVERSE: usize = 1;
    pub(super) const COUNT: usize = Self::INVERSE + components(D);
}

/// Kernel over influence of Wendland, for a fraction of the horizon.
#[inline(always)]
pub(super) fn kernel_over_influence(fraction: f64) -> f64 {
    (1.0 - fraction) * (1.0 + 4.0 * fraction)
}

impl<const D: usize, const IN_SERIES: bool> Survey<D, IN_SERIES> {
    pub(super) fn new(complete: &CompleteFamily, horizon: f64, is_central: bool) -> Self {
        Survey {
            laplacian: 2.0 / complete.moment,
            horizon,
            plain: if is_central { 0.0 } else { 1.0 },
            central: match is_central {
                true => (D as f64 + 2.0) / complete.mean_square,
                false => 0.0,
            },
        }
    }
}

impl<const D: usize, const I: usize, const O: usize, const IN_SERIES: bool> BondKernel<I, O>
    for Survey<D, IN_SERIES>
{
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; I], other: [f64; I]) -> [f64; O] {
        let Bond { xi, weight, .. } = *bond;
        let difference: [f64; I] = std::array::from_fn(|i| other[i] - own[i]);
        let (along, mirrored) = (&xi[..D], &difference[..D]);
        let held = &difference[SurveyInputs::<D>::HELD..SurveyInputs::<D>::DENSITY];
        let (mut sums, mut at) = ([0.0; O], 0);
        let mut put = |value: f64| {
            sums[at] = value;
            at += 1;
        };
        for &(a, b) in &COMPONENTS[..components(D)] {
            put(weight * xi[a] * xi[b]);
        }
        for v in mirrored {
            for x in along {
                put(weight * v * x);
            }
        }
        let diffusive = weight * self.laplacian;
        let viscosity = SurveyInputs::<D>::VISCOSITY;
        let viscous = diffusive * of_bond::<IN_SERIES>(own[viscosity], other[viscosity]);
        let stretch: f64 = (0..D).map(|a| held[a] * xi[a]).sum();
        let (plain, central) = (viscous * self.plain, viscous * self.central * stretch);
        let mut work = central * stretch;
        for (v, x) in held.iter().zip(along) {
            put(plain * v + central * x);
            work += plain * v * v;
        }
        // each end gets half of the work of the pair
        put(0.5 * work);
        put(diffusive * difference[SurveyInputs::<D>::DENSITY]);
        for x in along {
            put(diffusive * x);
        }
        put(weight * kernel_over_influence(bond.length / self.horizon));
        sums
    }
}

/// `-sum w (p_i A_i^-1 + p_j A_j^-1) xi`, from pressure and `A^-1`.
pub(super) struct Push<const D: usize>;

impl<const D: usize, const I: usize> BondKernel<I, D> for Push<D> {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; I], other: [f64; I]) -> [f64; D] {
        let mut sums = [0.0; D];
        for (n, &(a, b)) in COMPONENTS[..components(D)].iter().enumerate() {
            let inverse = PushInputs::<D>::INVERSE + n;
            let part = -bond.weight * (own[0] * own[inverse] + other[0] * other[inverse]);
            sums[a] += part * bond.xi[b];
            if a != b {
                sums[b] += part * bond.xi[a];
            }
        }
        sums
    }
}
