//! Return of a trial stress to the flow stress, and relief by annealing: the law of one point.

use super::law::EquivalentStrain;
use crate::mechanical::moduli::{Moduli, Plane};
use nalgebra::{Matrix6, Vector6};

/// The components that the stress of a body has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StressState {
    /// 1D.
    Uniaxial,
    /// 2D without stress across the plane.
    Plane,
    /// 3D and plane strain.
    Full,
}

impl StressState {
    /// The stress state of a body.
    pub fn of(dimension: usize, plane: Plane) -> Self {
        match (dimension, plane) {
            (1, _) => StressState::Uniaxial,
            (2, Plane::Stress) => StressState::Plane,
            _ => StressState::Full,
        }
    }

    /// Trace of an inelastic strain over the axes that have a stress.
    pub fn trace(self, strain: &[f64; 6]) -> f64 {
        match self {
            StressState::Uniaxial => strain[0],
            StressState::Plane => strain[0] + strain[1],
            StressState::Full => strain[0] + strain[1] + strain[2],
        }
    }
}

/// Increments of plastic strain (xx, yy, zz, xy, yz, zx) and equivalent plastic strain that bring a
/// trial stress (Pa) back to the flow stress (Pa), which does not fall with the increment; `None` when it is below.
/// `start` is the equivalent plastic strain before.
pub fn return_to_yield(
    state: StressState,
    trial: &[f64; 6],
    moduli: &Moduli,
    flow_stress: impl Fn(EquivalentStrain) -> f64,
    start: f64,
) -> Option<([f64; 6], f64)> {
    let [xx, yy, zz, xy, yz, zx] = *trial;
    let flow_stress = |increment: f64| {
        let end = start + increment;
        flow_stress(EquivalentStrain { end, increment })
    };
    match state {
        StressState::Uniaxial => {
            let q = xx.abs();
            let excess = |dp: f64| q - moduli.bulk * dp - flow_stress(dp);
            let dp = root(excess, q / moduli.bulk)?;
            let along = dp * xx.signum();
            Some(([along, -0.5 * along, -0.5 * along, 0.0, 0.0, 0.0], dp))
        }
        StressState::Full => {
            let mean = (xx + yy + zz) / 3.0;
            let deviator = [xx - mean, yy - mean, zz - mean, xy, yz, zx];
            let q = equivalent_stress(&deviator);
            let excess = |dp: f64| q - 3.0 * moduli.shear * dp - flow_stress(dp);
            let dp = root(excess, q / (3.0 * moduli.shear))?;
            Some((deviator.map(|s| 1.5 * dp * s / q), dp))
        }
        StressState::Plane => {
            let (sum, difference) = (xx + yy, xx - yy);
            let q = |g: f64| {
                let (mean, rest) = fall_in_plane(moduli, g);
                let square = (sum * mean).powi(2) / 6.0
                    + (0.5 * difference.powi(2) + 2.0 * xy * xy) * rest * rest;
                (1.5 * square).sqrt()
            };
            let excess = |g: f64| q(g) - flow_stress(2.0 / 3.0 * g * q(g));
            // q decreases to zero for large g, so that the flow stress is reached
            let mut most = 1.0 / moduli.shear;
            while excess(most) > 0.0 {
                most *= 4.0;
            }
            let g = root(excess, most)?;
            let (_, strain) = flow_along_deviator(state, trial, moduli, g);
            Some((strain, 2.0 / 3.0 * g * q(g)))
        }
    }
}

/// Factors by which the in-plane mean and the deviatoric part of a plane stress decrease with g.
fn fall_in_plane(moduli: &Moduli, g: f64) -> (f64, f64) {
    (
        1.0 / (1.0 + 2.0 / 3.0 * moduli.bulk * g),
        1.0 / (1.0 + 2.0 * moduli.shear * g),
    )
}

/// Stress (Pa) and plastic strain after a flow of `g` (1/Pa) times the deviator of that stress, from a trial stress
/// (Pa).
pub fn flow_along_deviator(
    state: StressState,
    trial: &[f64; 6],
    moduli: &Moduli,
    g: f64,
) -> ([f64; 6], [f64; 6]) {
    let [xx, yy, zz, xy, yz, zx] = *trial;
    let (stress, mean) = match state {
        StressState::Uniaxial => {
            let along = xx / (1.0 + 2.0 / 3.0 * moduli.bulk * g);
            ([along, 0.0, 0.0, 0.0, 0.0, 0.0], along / 3.0)
        }
        StressState::Plane => {
            let (mean, rest) = fall_in_plane(moduli, g);
            let (sum, difference) = ((xx + yy) * mean, (xx - yy) * rest);
            let (x, y) = (0.5 * (sum + difference), 0.5 * (sum - difference));
            ([x, y, 0.0, xy * rest, 0.0, 0.0], sum / 3.0)
        }
        StressState::Full => {
            let mean = (xx + yy + zz) / 3.0;
            let rest = 1.0 / (1.0 + 2.0 * moduli.shear * g);
            let normal = [xx, yy, zz].map(|s| mean + (s - mean) * rest);
            let [xx, yy, zz] = normal;
            ([xx, yy, zz, xy * rest, yz * rest, zx * rest], mean)
        }
    };
    let deviator = |c: usize| if c < 3 { stress[c] - mean } else { stress[c] };
    (stress, std::array::from_fn(|c| g * deviator(c)))
}

/// How a point flowed in a step.
#[derive(Clone, Copy, Debug)]
pub(super) struct Flowed {
    /// Flow along the deviator before the return, see [`flow_along_deviator`], 1/Pa.
    pub(super) transformation: f64,
    /// Increment of the equivalent plastic strain by the return.
    pub(super) increment: f64,
    /// Derivative of the flow stress by the equivalent plastic strain after it, Pa.
    pub(super) hardening: f64,
}

/// The consistent tangent of the return along the trial deviator: the derivative of the inelastic strain of a step by the
/// strain (xx, yy, zz, xy, yz, zx), from the trial stress (Pa). `None` in plane stress, whose flow is not along the trial deviator.
///
/// In 3D and plane strain (Simo & Hughes (1998), section 3.3.2), with the trial deviator s, n = s/|s|, the equivalent stress
/// q of the trial and Q(q) after the step:
/// `(1 - Q/q) (I - n (x) n) + (1 - dQ/dq) n (x) n`, I the projection on deviators.
pub(super) fn radial_tangent(
    state: StressState,
    trial: &[f64; 6],
    moduli: &Moduli,
    flowed: Flowed,
) -> Option<Matrix6<f64>> {
    let Flowed {
        transformation: g,
        increment,
        hardening,
    } = flowed;
    let flows = increment > 0.0;
    // part of the slope that is left, with a stiffness against flow
    let left = |stiffness: f64| {
        if flows {
            hardening / (stiffness + hardening)
        } else {
            1.0
        }
    };
    match state {
        StressState::Plane => None,
        StressState::Uniaxial => {
            let slope = left(moduli.bulk) / (1.0 + 2.0 / 3.0 * moduli.bulk * g);
            let along = [1.0, -0.5, -0.5, 0.0, 0.0, 0.0];
            let column = Vector6::from(along) * (1.0 - slope);
            Some(column * Vector6::x().transpose())
        }
        StressState::Full => {
            let [xx, yy, zz, xy, yz, zx] = *trial;
            let mean = (xx + yy + zz) / 3.0;
            let deviator = [xx - mean, yy - mean, zz - mean, xy, yz, zx];
            let q = equivalent_stress(&deviator);
            if q == 0.0 {
                return Some(Matrix6::zeros());
            }
            let softened = 1.0 / (1.0 + 2.0 * moduli.shear * g);
            let ratio = softened - 3.0 * moduli.shear * increment / q;
            let slope = left(3.0 * moduli.shear) * softened;
            let size = q / 1.5f64.sqrt();
            let normal = Vector6::from(deviator) / size;
            // n : e counts the shear components twice
            let twice = Vector6::new(1.0, 1.0, 1.0, 2.0, 2.0, 2.0);
            let along = normal * normal.component_mul(&twice).transpose();
            let mut projection = Matrix6::identity();
            let mut volumetric = projection.fixed_view_mut::<3, 3>(0, 0);
            volumetric.add_scalar_mut(-1.0 / 3.0);
            Some(projection * (1.0 - ratio) + along * (ratio - slope))
        }
    }
}

/// `sqrt(3/2 s : s)` of a deviator.
fn equivalent_stress(s: &[f64; 6]) -> f64 {
    let normal: f64 = s[..3].iter().map(|c| c * c).sum();
    let shear: f64 = s[3..].iter().map(|c| 2.0 * c * c).sum();
    (1.5 * (normal + shear)).sqrt()
}

/// Root between 0 and `most` of a decreasing function, by the Illinois method; `None` if it is not positive at 0.
pub(super) fn root(mut f: impl FnMut(f64) -> f64, most: f64) -> Option<f64> {
    let (mut low, mut f_low) = (0.0, f(0.0));
    let scale = f_low;
    if f_low <= 0.0 {
        return None;
    }
    let (mut high, mut f_high) = (most, f(most));
    let mut x = high;
    for _ in 0..100 {
        x = (low * f_high - high * f_low) / (f_high - f_low);
        let value = f(x);
        if value.abs() <= 1e-14 * scale || high - low <= 1e-16 * most {
            break;
        }
        if value > 0.0 {
            (low, f_low) = (x, value);
            f_high *= 0.5;
        } else {
            (high, f_high) = (x, value);
            f_low *= 0.5;
        }
    }
    Some(x)
}

/// The elastic strain that annealing relieves. In 3D and plane strain it is only that of the deviator: confined
/// metal keeps its volume, and with it its pressure. Relieving the pressure, too, would lose percents of the volume
/// of a weld pool that cold metal confines, and leave a hydrostatic stress of GPa.
pub(super) fn relieved_strain(state: StressState, stress: &[f64; 6], moduli: &Moduli) -> [f64; 6] {
    let mut strain = elastic_strain(state, stress, moduli);
    if state == StressState::Full {
        let mean = (strain[0] + strain[1] + strain[2]) / 3.0;
        strain[..3].iter_mut().for_each(|e| *e -= mean);
    }
    strain
}

/// Elastic strain of a stress (Pa); in plane stress, of the components in the plane.
pub(super) fn elastic_strain(state: StressState, stress: &[f64; 6], moduli: &Moduli) -> [f64; 6] {
    let [xx, yy, zz, ..] = *stress;
    let shear = 2.0 * moduli.shear;
    let mut strain = stress.map(|s| s / shear);
    // mean stress, and its strain along each axis
    let (axes, mean, expansion) = match state {
        StressState::Uniaxial => return [xx / moduli.bulk, 0.0, 0.0, 0.0, 0.0, 0.0],
        StressState::Plane => (2, 0.5 * (xx + yy), 0.25 * (xx + yy) / moduli.bulk),
        StressState::Full => {
            let mean = (xx + yy + zz) / 3.0;
            (3, mean, mean / (3.0 * moduli.lame + shear))
        }
    };
    (0..axes).for_each(|a| strain[a] = (stress[a] - mean) / shear + expansion);
    strain
}

#[cfg(test)]
mod tests {
    use super::*;
    use perimelt_core::material::Table;
    use proptest::prelude::*;

    #[test]
    fn annealing_keeps_the_volume_where_no_direction_is_free() {
        let full = moduli(StressState::Full);
        let stress = [90e6, -30e6, 60e6, 10e6, 0.0, 0.0];
        let strain = relieved_strain(StressState::Full, &stress, &full);
        assert!((strain[0] + strain[1] + strain[2]).abs() < 1e-18);
        let deviator = [50e6, -70e6, 20e6, 10e6, 0.0, 0.0];
        for (strain, deviator) in strain.iter().zip(deviator) {
            assert!((strain - deviator / (2.0 * full.shear)).abs() < 1e-15);
        }
        // across a plane in plane stress metal flows freely
        let (state, plane) = (StressState::Plane, moduli(StressState::Plane));
        let all = relieved_strain(state, &stress, &plane);
        assert_eq!(all, elastic_strain(state, &stress, &plane));
    }

    const YIELD: f64 = 250e6;

    fn moduli(state: StressState) -> Moduli {
        let dimension = match state {
            StressState::Uniaxial => 1,
            StressState::Plane => 2,
            StressState::Full => 3,
        };
        Moduli::new(2e11, 0.3, dimension, Plane::Stress)
    }

    /// Stress of an elastic strain in the dimensions of the state.
    fn stress_of(state: StressState, strain: &[f64; 6]) -> [f64; 6] {
        let moduli = moduli(state);
        let mut stress = strain.map(|e| 2.0 * moduli.shear * e);
        let axes = match state {
            StressState::Uniaxial => 1,
            StressState::Plane => 2,
            StressState::Full => 3,
        };
        let trace: f64 = strain[..axes].iter().sum();
        (0..6).for_each(|c| match c < axes {
            true => stress[c] += moduli.lame * trace,
            false if c < 3 || axes == 1 || axes == 2 && c > 3 => stress[c] = 0.0,
            false => {}
        });
        stress
    }

    fn von_mises(stress: &[f64; 6]) -> f64 {
        let mean = stress[..3].iter().sum::<f64>() / 3.0;
        let mut deviator = *stress;
        deviator[..3].iter_mut().for_each(|s| *s -= mean);
        equivalent_stress(&deviator)
    }

    proptest! {
        #[test]
        fn the_returned_stress_lies_on_the_flow_stress(
            strain in prop::array::uniform6(-0.01..0.01f64),
            equivalent in 0.0..0.05f64,
        ) {
            let table = Table::new(vec![0.0, 0.01, 0.1], vec![1.0, 1.2, 1.5]).expect("rows");
            for state in [StressState::Uniaxial, StressState::Plane, StressState::Full] {
                let flow = |p: f64| YIELD * table.at(p) + 2e9 * p;
                let trial = stress_of(state, &strain);
                let moved = return_to_yield(state, &trial, &moduli(state), |p| flow(p.end), equivalent);
                let Some((plastic, increment)) = moved else {
                    prop_assert!(von_mises(&trial) <= flow(equivalent));
                    continue;
                };
                let relieved = stress_of(state, &plastic);
                let stress: [f64; 6] = std::array::from_fn(|c| trial[c] - relieved[c]);
                let flow_stress = flow(equivalent + increment);
                prop_assert!((von_mises(&stress) / flow_stress - 1.0).abs() < 1e-9, "{state:?}");
                let volume: f64 = plastic[..3].iter().sum();
                prop_assert!(volume.abs() < 1e-15);
                // the flow is as large as its equivalent and along the deviator of the result
                let size = equivalent_stress(&plastic) / 1.5;
                prop_assert!((size / increment - 1.0).abs() < 1e-9, "{state:?} {size} {increment}");
                let along: f64 = (0..6).map(|c| {
                    let mean = if c < 3 { stress[..3].iter().sum::<f64>() / 3.0 } else { 0.0 };
                    (if c < 3 { 1.0 } else { 2.0 }) * plastic[c] * (stress[c] - mean)
                }).sum();
                prop_assert!((along / (flow_stress * increment) - 1.0).abs() < 1e-9);
            }
        }

        #[test]
        fn elastic_strains_belong_to_their_stress(strain in prop::array::uniform6(-0.01..0.01f64)) {
            for state in [StressState::Uniaxial, StressState::Plane, StressState::Full] {
                let stress = stress_of(state, &strain);
                let found = elastic_strain(state, &stress, &moduli(state));
                let again = stress_of(state, &found);
                for (a, b) in stress.iter().zip(again) {
                    prop_assert!((a - b).abs() < 1e-12 * 2e11 * 0.01, "{state:?}");
                }
            }
        }
    }
}
