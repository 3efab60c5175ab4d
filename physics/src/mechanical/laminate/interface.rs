//! Interfaces between the layers of a laminate.

use nalgebra::Matrix2;
use perimelt_core::body::{Layer, Layers};
use perimelt_core::family::Mirrored;
use perimelt_core::{Family, SetupError, SlotField};

use super::constants::{PlyConstants, PlyPoints, PlyState};
use super::kernels::{Crossing, MODULI};
use crate::plies::{CompleteFamily, TensorBonds};

/// The bonds between two layers, one above the other.
#[derive(Debug)]
pub(super) struct Interface {
    pub(super) crossing: Crossing,
    /// Unit vectors along the fibres of the lower and of the upper layer.
    fibres: [[f64; 2]; 2],
    /// Fractions of the distance that lie in the ply of the lower and of the upper layer.
    pub(super) fractions: [f64; 2],
    /// Young's modulus across, by point of the plane, Pa.
    pub(super) modulus: Vec<f64>,
    /// Shear moduli xx, yy and xy by point of the plane, Pa.
    pub(super) moduli: Vec<[f64; MODULI]>,
    /// The same by slot.
    pub(super) slots: [SlotField; MODULI],
}

impl Interface {
    /// The bonds between two layers; [`Interface::load`] gives them their stiffness.
    ///
    /// # Errors
    /// Shear moduli of a state of the plies for which a bond would have a negative stiffness.
    pub(super) fn new(
        layers: &Layers,
        [lower, upper]: [&Layer; 2],
        complete: &CompleteFamily,
        plies: &PlyPoints,
    ) -> Result<Self, SetupError> {
        let distance = upper.z - lower.z;
        let above = match lower.ply == upper.ply {
            true => 0.5,
            false => (upper.z - layers.plies()[upper.ply].low) / distance,
        };
        let fibres = [lower, upper].map(|layer| {
            let (sin, cos) = layers.plies()[layer.ply].angle.sin_cos();
            [cos, sin]
        });
        let units = [
            Matrix2::new(1.0, 0.0, 0.0, 0.0),
            Matrix2::new(0.0, 0.0, 0.0, 1.0),
            Matrix2::new(0.0, 1.0, 1.0, 0.0),
        ];
        let bonds = units.map(|unit| TensorBonds::new(complete, &unit));
        let [Some(xx), Some(yy), Some(xy)] = bonds else {
            return Err(refusal(&plies.states[0]));
        };
        let points = layers.points_of_layer();
        let mut interface = Interface {
            crossing: Crossing {
                bonds: [xx, yy, xy],
                uniform: [0.0; MODULI],
                distance,
            },
            fibres,
            fractions: [1.0 - above, above],
            modulus: vec![0.0; points],
            moduli: vec![[0.0; MODULI]; points],
            slots: Default::default(),
        };
        for state in &plies.states {
            interface.check(complete, state)?;
        }
        interface.crossing.uniform = interface.moduli_of([&plies.states[0].constants; 2]);
        Ok(interface)
    }

    /// Refuses bonds of negative stiffness between plies in the same state. Two states whose moduli differ by direction by less than a factor
    /// do not differ by more in series.
    fn check(&self, complete: &CompleteFamily, state: &PlyState) -> Result<(), SetupError> {
        let moduli = self.moduli_of([&state.constants; 2]);
        let mut bonds = complete.bonds.iter();
        let is_positive = bonds.all(|b| self.crossing.stiffness(b.direction, moduli) >= 0.0);
        is_positive.then_some(()).ok_or_else(|| refusal(state))
    }

    /// Shear moduli xx, yy and xy of the parts in the lower and the upper ply in series, Pa.
    pub(super) fn moduli_of(&self, constants: [&PlyConstants; 2]) -> [f64; MODULI] {
        let parts =
            (0..2).map(|n| self.fractions[n] * constants[n].shear_compliance(self.fibres[n]));
        let compliance: Matrix2<f64> = parts.sum();
        let [xx, yy, xy] = [(0, 0), (1, 1), (0, 1)].map(|at| compliance[at]);
        let determinant = xx * yy - xy * xy;
        [yy / determinant, xx / determinant, -xy / determinant]
    }

    /// Takes the constants of the points of the lower and of the upper layer.
    pub(super) fn load(&mut self, plane: &Family, [lower, upper]: [&[PlyConstants]; 2]) {
        for (point, both) in lower.iter().zip(upper).enumerate() {
            self.moduli[point] = self.moduli_of([both.0, both.1]);
            let [below, above] = self.fractions;
            let compliance = below / both.0.modulus_across + above / both.1.modulus_across;
            self.modulus[point] = 1.0 / compliance;
        }
        for (component, slots) in self.slots.iter_mut().enumerate() {
            let moduli = &self.moduli;
            slots.load(
                plane,
                |point: usize| moduli[point][component],
                Mirrored::Scalar,
            );
        }
    }
}

/// The mistake of a state with bonds of negative stiffness.
fn refusal(state: &PlyState) -> SetupError {
    let [along, across] = state.constants.shear_across;
    let message = format!(
        "{} has shear moduli across the ply of {along} Pa along its fibres and {across} Pa across them, which give bonds of \
         negative stiffness between layers",
        state.name
    );
    let expected =
        "`shear_modulus_13` and `shear_modulus_23` that differ by less than a factor of 3";
    SetupError::value("law.lamina", message, expected)
}
