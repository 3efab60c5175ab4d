//! Arguments of a subroutine. Its tensors are xx, yy, zz, xy, xz, yz, with engineering shear strains.

use nalgebra::{Matrix3, Matrix6};

use super::kinematics::Increment;
use crate::mechanical::classical::COMPONENTS;
use crate::mechanical::points::LawPoint;

/// The place of each component of the subroutine in xx, yy, zz, xy, yz, zx, and the other way round.
const ORDER: [usize; 6] = [0, 1, 2, 3, 5, 4];

/// What a subroutine is told about a point, and its answer. Matrices are by columns.
#[cfg_attr(
    not(feature = "umat"),
    expect(dead_code, reason = "read by the subroutine")
)]
pub(super) struct Arguments {
    /// STRESS, Pa: at the start with the rotation of the end, then at the end.
    pub(super) stress: [f64; 6],
    /// DDSDDE, Pa.
    pub(super) tangent: [f64; 36],
    /// SSE, SPD, SCD, J/m³.
    pub(super) energies: [f64; 3],
    /// STRAN.
    pub(super) strain: [f64; 6],
    /// DSTRAN.
    pub(super) increment: [f64; 6],
    /// TIME, s.
    pub(super) time: [f64; 2],
    /// DTIME, s.
    pub(super) step: f64,
    /// TEMP, K: at the end of the step.
    pub(super) temperature: f64,
    /// COORDS, m.
    pub(super) position: [f64; 3],
    /// DROT.
    pub(super) rotation: [f64; 9],
    /// PNEWDT.
    pub(super) next_step: f64,
    /// CELENT, m.
    pub(super) spacing: f64,
    /// DFGRD0, DFGRD1.
    pub(super) gradients: [[f64; 9]; 2],
    /// NOEL.
    pub(super) number: i32,
    /// KINC: 1 in the first step, else 2.
    pub(super) increments: i32,
}

/// What a subroutine answers, in the order xx, yy, zz, xy, yz, zx.
pub(super) struct Answer {
    /// Pa.
    pub(super) stress: [f64; 6],
    /// Derivative of the stress by engineering strains, Pa.
    pub(super) tangent: Matrix6<f64>,
    /// Elastic energy, J/m³.
    pub(super) energy: f64,
}

/// Engineering strains xx, yy, zz, xy, yz, zx.
pub(super) fn engineering(strain: &Matrix3<f64>) -> [f64; 6] {
    COMPONENTS.map(|(a, b)| {
        if a == b {
            strain[(a, b)]
        } else {
            2.0 * strain[(a, b)]
        }
    })
}

impl Arguments {
    /// A point that is deformed from a stress (Pa) and an elastic energy (J/m³).
    pub(super) fn new(
        point: &LawPoint<'_>,
        increment: &Increment,
        stress: &Matrix3<f64>,
        energy: f64,
    ) -> Self {
        let turned = increment.turned(stress);
        let turned = COMPONENTS.map(|at| turned[at]);
        let strain = engineering(&increment.total());
        let change = engineering(&increment.strain);
        Arguments {
            stress: ORDER.map(|c| turned[c]),
            tangent: [0.0; 36],
            energies: [energy, 0.0, 0.0],
            strain: ORDER.map(|c| strain[c]),
            increment: ORDER.map(|c| change[c]),
            time: [point.start; 2],
            step: point.step,
            temperature: point.temperature.unwrap_or(0.0),
            position: point.position,
            rotation: bytemuck::must_cast(increment.rotation),
            next_step: 1.0,
            spacing: point.spacing,
            gradients: increment.gradients.map(bytemuck::must_cast),
            number: i32::try_from(point.number + 1).unwrap_or(i32::MAX),
            increments: if point.start == 0.0 { 1 } else { 2 },
        }
    }

    /// The answer; `None` if the subroutine wants a shorter step.
    pub(super) fn answer(&self) -> Option<Answer> {
        // also for a number that is not one
        if !(self.next_step >= 1.0) {
            return None;
        }
        let entry = |row: usize, column: usize| self.tangent[6 * ORDER[column] + ORDER[row]];
        Some(Answer {
            stress: ORDER.map(|c| self.stress[c]),
            tangent: Matrix6::from_fn(entry),
            energy: self.energies[0],
        })
    }
}
