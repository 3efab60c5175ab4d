//! Two fluids at the points of a body: enthalpy and conductivity of their mixture.

use std::cell::Ref;

use perimelt_core::material::{EnthalpyCurve, Property};
use perimelt_core::world::BodyIndex;
use perimelt_core::{Read, Setup, SetupError, World};

use super::interfaces::in_series;
use super::run::RunningThermal;
use crate::fluid::{FLUID_FRACTION, TwoFluids};
use crate::heat_content::{HeatContent, LARGEST_RATIO, Mixture};

/// Two fluids whose heat is computed.
#[derive(Clone, Copy, Debug)]
pub(super) struct MixedFluids {
    pub(super) materials: [u16; 2],
    /// Fraction of the first one.
    pub(super) fraction: Read<f64>,
}

impl MixedFluids {
    /// The two fluids of a body, where there are two.
    pub(super) fn prepare(
        setup: &mut Setup<'_>,
        body: BodyIndex,
    ) -> Result<Option<MixedFluids>, SetupError> {
        let fluids = setup.facts::<TwoFluids>(body).next();
        let materials = fluids.and_then(|fluids| fluids.materials(setup.body(body)));
        let Some(materials) = materials else {
            return Ok(None);
        };
        Ok(Some(MixedFluids {
            materials,
            fraction: setup.read(body, &FLUID_FRACTION)?,
        }))
    }

    /// Refuses heat capacities that differ too much.
    pub(super) fn check(&self, curves: &[EnthalpyCurve]) -> Result<(), SetupError> {
        let of = |m: u16| {
            let curve = &curves[m as usize];
            [curve.minimum_capacity(), curve.maximum_capacity()]
        };
        let [first, second] = self.materials.map(of);
        let ratio = (first[1] / second[0]).max(second[1] / first[0]);
        if ratio > LARGEST_RATIO {
            let message = format!(
                "the heat capacities per volume of the two fluids differ by a factor of {ratio:.0}"
            );
            let expected = format!(
                "a factor of at most {LARGEST_RATIO}: a larger density or specific heat of the gas"
            );
            return Err(SetupError::value("body", message, expected));
        }
        Ok(())
    }

    /// The mixture with this fraction of the first fluid by point.
    pub(super) fn mixture<'a>((fluids, fraction): (MixedFluids, &'a [f64])) -> Mixture<'a> {
        Mixture {
            materials: fluids.materials,
            fraction,
        }
    }
}

/// Conductivity of two fluids.
#[derive(Debug)]
pub(super) struct MixedConductivity {
    materials: [u16; 2],
    fraction: Vec<f64>,
}

impl MixedConductivity {
    pub(super) fn new(materials: [u16; 2], points: usize) -> Self {
        MixedConductivity {
            materials,
            fraction: vec![0.0; points],
        }
    }

    pub(super) fn set_fraction(&mut self, fraction: &[f64]) {
        self.fraction.copy_from_slice(fraction);
    }

    /// Conductivity of a point at a temperature (K), W/(m K): that of layers in series.
    pub(super) fn at(&self, by_material: &[Property], point: usize, temperature: f64) -> f64 {
        let of = |m: u16| by_material[m as usize].at(temperature, 0.0);
        let c = self.fraction[point].clamp(0.0, 1.0);
        in_series(self.materials.map(of), [c, 1.0 - c])
    }
}

impl RunningThermal {
    /// What the enthalpy of points of these materials depends on; `fraction` is that of the first of two fluids.
    pub(super) fn content<'a>(
        &'a self,
        material: &'a [u16],
        fraction: Option<&'a [f64]>,
    ) -> HeatContent<'a> {
        HeatContent {
            curves: &self.curves,
            material,
            mixture: self.fluids.zip(fraction).map(MixedFluids::mixture),
        }
    }

    /// Fraction of the first of two fluids, where there are two.
    pub(super) fn fraction<'a>(&self, world: &'a World) -> Option<Ref<'a, [f64]>> {
        self.fluids.map(|fluids| world.read(fluids.fraction))
    }

    /// Takes the fraction of the first of two fluids for the conductivity.
    pub(super) fn follow_fluids(&mut self, world: &World) {
        if let Some(fluids) = self.fluids {
            self.conduction.mix(&world.read(fluids.fraction));
        }
    }
}
