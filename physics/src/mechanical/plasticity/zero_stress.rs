//! Laws in three dimensions under plane stress and in bars: the strain across that leaves no stress there.

use super::law::{Flow, FlowLaw};
use super::return_mapping::{StressState, root};
use super::rule::RulePoint;

/// The flow of a law from a trial stress (Pa) without components across, where it leaves no stress across. The elastic
/// strain across is found by the Illinois method; in a bar both directions across have the same one.
pub(super) fn flow_without_stress_across<L: FlowLaw>(
    law: &L,
    at: &RulePoint<'_>,
    trial: &[f64; 6],
    state: &mut [f64],
) -> Option<Flow> {
    let (bulk, shear) = (at.point.bulk_modulus, at.point.shear_modulus);
    let lame = bulk - 2.0 / 3.0 * shear;
    // stress of a unit strain across, and the axes across
    let (unit, across) = match at.stress_state {
        StressState::Uniaxial => {
            let normal = 2.0 * (lame + shear);
            ([2.0 * lame, normal, normal], 1..3)
        }
        _ => ([lame, lame, lame + 2.0 * shear], 2..3),
    };
    let stiffness = unit[2];
    let count = across.len() as f64;
    let strained = |strain: f64| {
        let mut stress = *trial;
        (0..3).for_each(|axis| stress[axis] += strain * unit[axis]);
        stress
    };
    let flow = |strain: f64, state: &mut [f64]| law.flow(&at.point, &strained(strain), state);
    // stress across that is left
    let mut left = |strain: f64| {
        let [_, y, z, ..] = strained(strain);
        let all = if count == 2.0 { y + z } else { z };
        let relieved = flow(strain, state).map_or(0.0, |flow| {
            let volume: f64 = flow.strain[..3].iter().sum();
            let deviatoric: f64 = across.clone().map(|axis| flow.strain[axis]).sum();
            count * lame * volume + 2.0 * shear * deviatoric
        });
        (all - relieved) / count
    };
    let excess = left(0.0);
    let sign = excess.signum();
    let mut most = excess.abs() / stiffness;
    if most > 0.0 {
        const LARGEST: f64 = 10.0;
        while sign * left(-sign * most) > 0.0 && most < LARGEST {
            most *= 4.0;
        }
    }
    let strain = root(|strain| sign * left(-sign * strain), most).unwrap_or(0.0);
    flow(-sign * strain, state)
}
