//! Two fluids at the points of a body: enthalpy and conductivity of their mixture.

use std::cell::Ref;

use perimelt_core::material::{EnthalpyCurve, Property, mixed_conductivity};
use perimelt_core::world::{BodyIndex, LayerSideBySide, TwoFluids};
use perimelt_core::{Read, Setup, SetupError, World, keys};

use super::run::RunningThermal;
use crate::dependent_keys::need;
use crate::heat_content::{HeatContent, LARGEST_RATIO, Mixture};

/// Two fluids whose heat is computed.
#[derive(Clone, Copy, Debug)]
pub(super) struct MixedFluids {
    pub(super) materials: [u16; 2],
    /// Fraction of the first one.
    pub(super) fraction: Read<f64>,
    /// Whether they conduct side by side in the layer between them.
    conducts_side_by_side: bool,
}

impl MixedFluids {
    /// The two fluids of a body, where there are two.
    pub(super) fn prepare(
        setup: &mut Setup<'_>,
        body: BodyIndex,
    ) -> Result<Option<MixedFluids>, SetupError> {
        let fluids = setup.facts::<TwoFluids>(body).next();
        let materials = fluids.and_then(|fluids| fluids.indices(setup.body(body)));
        let Some(materials) = materials else {
            return Ok(None);
        };
        Ok(Some(MixedFluids {
            materials,
            fraction: setup.read(body, &keys::FLUID_FRACTION)?,
            conducts_side_by_side: setup.facts::<LayerSideBySide>(body).next().is_some(),
        }))
    }

    /// Refuses heat capacities that differ too much, and melting that a mixture cannot have.
    pub(super) fn check(&self, curves: &[EnthalpyCurve]) -> Result<(), SetupError> {
        let melting = self.materials.map(|m| curves[m as usize].latent_heat());
        need(
            melting[1].is_none(),
            "body",
            "the second of two fluids melts, and only the first one may freeze",
            "`fluids` with the material that melts in front, and a gas without `solidus`, `liquidus` and `latent_heat`",
        )?;
        need(
            melting[0].is_none_or(|latent| latent.solidus < latent.liquidus),
            "body",
            "the first of two fluids melts at one temperature, so that the temperature of a mixture does not tell how much of it is liquid",
            "a `liquidus` above the `solidus` of the material",
        )?;
        let of = |m: u16| {
            let curve = &curves[m as usize];
            [curve.minimum_capacity(), curve.maximum_capacity()]
        };
        let [first, second] = self.materials.map(of);
        let ratio = (first[1] / second[0]).max(second[1] / first[0]);
        if ratio > LARGEST_RATIO {
            let message = format!(
                "the heat capacities per volume of the two fluids, with latent heat, differ by a factor of {ratio:.0}"
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
    /// Largest of each, W/(m K).
    largest: [f64; 2],
    /// Enthalpy of the first one, by which it melts.
    first: EnthalpyCurve,
    /// Whether the layer between the fluids conducts as if they lay side by side.
    is_parallel: bool,
    fraction: Vec<f64>,
}

impl MixedConductivity {
    /// Conductivity of fluids of these largest conductivities (W/(m K)).
    pub(super) fn new(
        fluids: &MixedFluids,
        curves: &[EnthalpyCurve],
        largest: [f64; 2],
        points: usize,
    ) -> Self {
        MixedConductivity {
            materials: fluids.materials,
            largest,
            first: curves[fluids.materials[0] as usize].clone(),
            is_parallel: fluids.conducts_side_by_side,
            fraction: vec![0.0; points],
        }
    }

    pub(super) fn set_fraction(&mut self, fraction: &[f64]) {
        self.fraction.copy_from_slice(fraction);
    }

    /// Largest conductivity of each fluid, W/(m K).
    pub(super) fn largest(&self) -> [f64; 2] {
        self.largest
    }

    /// Conductivity of a point at a temperature (K), W/(m K).
    pub(super) fn at(&self, by_material: &[Property], point: usize, temperature: f64) -> f64 {
        let liquid = self.first.liquid_fraction(temperature);
        let [first, second] = self.materials.map(|m| &by_material[m as usize]);
        let k = [first.at(temperature, liquid), second.at(temperature, 0.0)];
        mixed_conductivity(k, self.fraction[point], self.is_parallel)
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
