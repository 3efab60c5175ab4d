//! Viscosity of a fluid at its points, by a law ([`ViscosityLaw`]).

mod generalised;
mod law;
mod newtonian;
mod shear;
#[cfg(test)]
mod tests;

use perimelt_core::family::Mirrored;
use perimelt_core::law::{Constants, Law};
use perimelt_core::material::EnthalpyCurve;
use perimelt_core::{Body, Family, SetupError, SlotField};

pub use generalised::{HerschelBulkley, PowerLaw};
pub use law::{ViscosityLaw, ViscosityRegistration, ViscositySweep, ViscousPoints, facts};
pub use newtonian::Newtonian;
use shear::ShearRates;
pub(super) use shear::squared_shear_rate;

/// Viscosity of a bond, from those of its ends: their mean, or that of two halves in series, through which one stress passes at
/// two shear rates. At a yield surface the viscosity changes by orders of magnitude from one point to the next, and the mean
/// would be that of the plug.
#[inline(always)]
pub(super) fn of_bond<const IN_SERIES: bool>(own: f64, other: f64) -> f64 {
    match IN_SERIES {
        // both may be zero where a fluid that thickens rests
        true => 2.0 * own * other / (own + other + f64::MIN_POSITIVE),
        false => 0.5 * (own + other),
    }
}

/// Viscosity of the points of a fluid.
#[derive(Debug)]
pub(super) struct Viscosity {
    law: Law<dyn ViscositySweep>,
    constants: Constants,
    shear: ShearRates,
    /// By point, Pa s.
    pub(super) value: Vec<f64>,
    /// Whether it differs from point to point.
    pub(super) varies: bool,
    /// Whether it changes in time.
    changes: bool,
    /// By material, Pa s.
    largest: Vec<f64>,
}

impl Viscosity {
    /// The viscosity of a body by the law that the keys of a fluid choose; Newtonian when they choose none. A fluid that does not freeze is liquid.
    ///
    /// # Errors
    /// Keys of the law that make no sense, or a material without one of its constants.
    pub(super) fn new(
        law: Option<Law<dyn ViscositySweep>>,
        body: &Body,
        freezes: bool,
    ) -> Result<Self, SetupError> {
        let newtonian = || Law::<dyn ViscositySweep> {
            name: "newtonian",
            law: Box::new(Newtonian {}),
        };
        let law = law.unwrap_or_else(newtonian);
        let key = law.key();
        law.law.check().map_err(|e| e.below(&key))?;
        let constants = Constants::of(body, &key, &key, law.law.constants())?;
        let constants = match freezes {
            true => constants,
            false => constants.of_liquid(),
        };
        let needs_shear_rate = law.law.needs_shear_rate();
        let largest = (0..body.materials.len()).map(|material| {
            let mut values = vec![0.0; law.law.constants().len()];
            constants.load_largest(material, &mut values);
            law.law.largest(&values)
        });
        let mut viscosity = Viscosity {
            value: vec![0.0; body.points.len()],
            varies: needs_shear_rate || constants.common().is_err(),
            changes: needs_shear_rate || constants.depend_on_temperature(),
            largest: largest.collect(),
            shear: ShearRates::default(),
            law,
            constants,
        };
        if !viscosity.changes {
            viscosity.fill(&body.material_of_point, None);
        }
        Ok(viscosity)
    }

    /// Whether a temperature is needed to evaluate it.
    pub(super) fn depends_on_temperature(&self) -> bool {
        self.constants.depend_on_temperature()
    }

    /// Whether it depends on the shear rate.
    pub(super) fn needs_shear_rate(&self) -> bool {
        self.law.law.needs_shear_rate()
    }

    /// Finds the shear rates on which it depends, from the components of the velocity by slot.
    pub(super) fn find_shear_rates(&mut self, family: &Family, velocity: &[SlotField]) {
        self.shear.find(family, velocity, self.value.len());
    }

    /// Evaluates it at the points, which are of these materials, from their temperature (K) and the enthalpy curves of the
    /// materials where it depends on them.
    pub(super) fn evaluate(
        &mut self,
        material: &[u16],
        temperature: Option<(&[f64], &[EnthalpyCurve])>,
    ) {
        if self.changes {
            self.fill(material, temperature);
        }
    }

    fn fill(&mut self, material: &[u16], temperature: Option<(&[f64], &[EnthalpyCurve])>) {
        let points = ViscousPoints {
            constants: &self.constants,
            material,
            temperature,
            shear_rate: &self.shear.value,
        };
        self.law.law.evaluate(points, &mut self.value);
    }

    /// Copies it to slots; where it does not vary only when their number changed.
    pub(super) fn load(&self, family: &Family, slots: &mut SlotField) {
        if self.varies || slots.len() != family.slots() {
            slots.load(family, &self.value[..], Mirrored::Scalar);
        }
    }

    /// Largest value that a material can have, Pa s.
    pub(super) fn largest(&self, material: u16) -> f64 {
        self.largest[material as usize]
    }
}
