//! Heat that a fluid that keeps its volume carries: its fields.

use perimelt_core::material::EnthalpyCurve;
use perimelt_core::world::{BodyIndex, FaceTension, LayerSideBySide, TwoFluids};
use perimelt_core::{Access, Read, Setup, SetupError, TensionLaw, World, Write, keys};

use super::eulerian::projection::heat::HeatedFluid;
use super::eulerian::projection::interface_temperature::LayeredConductivity;
use super::eulerian::projection::thermocapillary::SurfaceLaws;
use super::run::FluidRun;
use crate::dependent_keys::need;
use crate::tension::prepare_face_tension;
use crate::thermal::ConductsHeat;

/// State of the heat, and the amounts that are given.
#[derive(Debug)]
pub(super) struct FluidHeat {
    temperature: Read<f64>,
    enthalpy: Read<f64>,
    carried: Write<f64>,
}

impl FluidHeat {
    /// The heat of a body that `thermal` computes.
    pub(super) fn declare(setup: &mut Setup<'_>, body: BodyIndex) -> Result<FluidHeat, SetupError> {
        Ok(FluidHeat {
            temperature: setup.read(body, &keys::TEMPERATURE)?,
            enthalpy: setup.read(body, &keys::ENTHALPY)?,
            carried: setup.give(body, &keys::CARRIED_HEAT, Access::Give)?,
        })
    }
}

/// Whether `thermal` computes the temperature of a body, on which a `tension` of its interface may depend.
pub(super) fn is_heated(
    setup: &Setup<'_>,
    body: BodyIndex,
    tension: Option<&TensionLaw>,
) -> Result<bool, SetupError> {
    let is_heated = setup.facts::<ConductsHeat>(body).next().is_some();
    need(
        is_heated || tension.is_none(),
        "interface.tension",
        "the tension depends on the temperature, which no physics computes",
        "`thermal` on the body, or a number for `interface.surface_tension`",
    )?;
    Ok(is_heated)
}

impl HeatedFluid {
    /// What a fluid needs whose temperature `thermal` computes, with the `tension` of its interface where that depends on it.
    pub(super) fn prepare(
        setup: &mut Setup<'_>,
        body: BodyIndex,
        tension: Option<TensionLaw>,
    ) -> Result<Option<HeatedFluid>, SetupError> {
        if !is_heated(setup, body, tension.as_ref())? {
            return Ok(None);
        }
        let is_single = setup.facts::<TwoFluids>(body).next().is_none();
        let faces: Vec<FaceTension> = match is_single {
            true => setup.facts(body).copied().collect(),
            false => Vec::new(),
        };
        let material = setup.body(body).material_of_point[0];
        let law = |FaceTension { face, tension }: FaceTension| {
            Ok((
                face,
                prepare_face_tension(tension, "surface", setup, body, material)?,
            ))
        };
        let faces: Result<_, SetupError> = faces.into_iter().map(law).collect();
        let faces = faces?;
        let curves = setup.world().enthalpy_curves(body)?;
        let conductivity = match tension {
            Some(_) => layered_conductivity(setup, body, &curves)?,
            None => None,
        };
        Ok(Some(HeatedFluid {
            curves,
            surfaces: SurfaceLaws {
                interface: tension,
                conductivity,
                faces,
            },
        }))
    }
}

/// Conductivities of two fluids between which heat flows across the interface; none where those of the layer between them conduct side by side.
fn layered_conductivity(
    setup: &Setup<'_>,
    body: BodyIndex,
    curves: &[EnthalpyCurve],
) -> Result<Option<LayeredConductivity>, SetupError> {
    let conducts_side_by_side = setup.facts::<LayerSideBySide>(body).next().is_some();
    let fluids = setup.facts::<TwoFluids>(body).next();
    let materials = fluids.and_then(|fluids| fluids.indices(setup.body(body)));
    let Some(materials) = materials.filter(|_| !conducts_side_by_side) else {
        return Ok(None);
    };
    let of_materials = setup.world().property(body, "conductivity")?;
    Ok(Some(LayeredConductivity {
        conductivity: materials.map(|m| of_materials[m as usize].clone()),
        first: curves[materials[0] as usize].clone(),
    }))
}

impl FluidRun {
    /// Takes temperature and enthalpy at the start of a step.
    pub(super) fn take_heat(&mut self, world: &World) {
        let projection = self.points.projection_mut();
        let heat = projection.and_then(|projection| projection.heat_mut());
        if let (Some(fields), Some(heat)) = (&self.fields.heat, heat) {
            heat.start(
                &world.read(fields.temperature),
                &world.read(fields.enthalpy),
            );
        }
    }

    /// Gives the heat that was carried in the step.
    pub(super) fn give_heat(&self, world: &World) {
        let projection = self.points.projection();
        let heat = projection.and_then(|projection| projection.heat());
        if let (Some(fields), Some(heat)) = (&self.fields.heat, heat) {
            world.write(fields.carried).copy_from_slice(heat.carried());
        }
    }
}
