//! Set-up of a fluid: fields, family, points, properties.

use perimelt_core::world::{BodyIndex, LayersHandle, PhaseChange};
use perimelt_core::{
    Access, Body, Face, FamilySpec, Influence, Pddo, Setup, SetupError, SlotField, TensionLaw,
    World, Write, keys,
};

use crate::advection::usual_horizon;
use crate::momentum::{Balanced, Momentum};
use crate::shape_tensor::CompleteFamily;

use super::boundaries::{check_closed, check_faces};
use super::eulerian::EulerianPoints;
use super::eulerian::projection::heat::HeatedFluid;
use super::heat::{FluidHeat, is_heated};
use super::interface_report::InterfaceReport;
use super::keys::Fluid;
use super::kinds::{FluidKeys, PointKeys};
use super::lagrangian::LagrangianPoints;
use super::medium::Medium;
use super::pair::{FluidPair, PairKeys, PreparedPair};
use super::points::{Points, Surroundings};
use super::run::{FluidFields, FluidRun, FluidTemperature, MomentumAccount};
use super::treatments::Treatments;
use super::viscosity::Viscosity;
use super::walls::Walls;

impl FluidRun {
    pub(super) fn prepare(mut fluid: Fluid, setup: &mut Setup<'_>) -> Result<FluidRun, SetupError> {
        let body = setup.find_body(fluid.body.as_deref())?;
        fluid.check_numbers(setup.body(body))?;
        let keys = fluid.take_keys()?;
        keys.check_body(setup.body(body))?;
        let pair = prepare_pair(&fluid, setup, body)?;
        keys.check_interface(fluid.interface.unwrap_or_default(), pair.is_some())?;
        let varying = pair
            .as_ref()
            .and_then(PreparedPair::varying_tension)
            .cloned();
        let layers = setup.layers(body, &keys::VELOCITY);
        let (faces, layers) = (layers.faces(), layers.handle);
        check_surfaces(&keys, setup, body, &faces)?;
        let medium = prepare_medium(&mut fluid, setup, body)?;
        keys.check_viscosity(&medium.viscosity)?;
        let mut fields = FluidFields::declare(setup, body, &medium, layers)?;
        let heat = fields.declare_heat(setup, body, keys.is_incompressible(), varying)?;
        if let Some(pair) = &pair {
            fields.declare_interface(setup, body, keys.is_incompressible(), &pair.pair)?;
        }
        let (has_faces, has_interface) = (!faces.is_empty(), pair.is_some());
        let spec = family_spec(&fluid, &keys, setup.body(body), faces);
        let walls = Walls::prepare(setup, body, &spec)?;
        keys.check_walls(&walls)?;
        let family = setup.family(body, &spec)?;
        let complete = CompleteFamily::of(setup.body(body), &setup.world().family(family));
        let around = Surroundings {
            body,
            family,
            complete,
            walls,
            pair,
            heat,
        };
        let points = match keys.points {
            PointKeys::Lagrangian(keys) => {
                Points::Lagrangian(LagrangianPoints::prepare(keys, setup, around)?)
            }
            PointKeys::Eulerian(keys) => {
                Points::Eulerian(EulerianPoints::prepare(keys, setup, around)?)
            }
        };
        let this = setup.body(body);
        let is_periodic = this.periodic[..this.dimension].iter().all(|p| *p);
        // a pressure that is found to a tolerance keeps momentum to that tolerance
        let is_balanced = (is_periodic || !has_faces) && !keys.is_incompressible();
        let is_partly_periodic = this.periodic.contains(&true);
        let keeps_angular_momentum =
            !has_faces && !is_partly_periodic && keys.keeps_angular_momentum();
        let stability = points.rates().stability();
        Ok(FluidRun {
            body,
            fields,
            settings: keys.settings,
            medium,
            points,
            initial_stability: stability,
            stability,
            stable_step: None,
            treatments: Treatments::new(complete, this.dimension),
            slots: vec![SlotField::default(); this.dimension],
            steps: 0,
            initial_mass: 0.0,
            momentum: is_balanced.then(|| MomentumAccount {
                balanced: Balanced {
                    dimension: this.dimension,
                    angular: keeps_angular_momentum,
                },
                initial: Momentum::default(),
                given: Momentum::default(),
            }),
            interface: has_interface.then(InterfaceReport::default),
            kinetic_energy: 0.0,
            density_deviation: (!keys.is_incompressible()).then_some(0.0),
        })
    }

    /// Density from the pressure at the start.
    pub(super) fn complete_state(&mut self, world: &World) {
        let pressure = world.read(self.fields.pressure.into());
        let mut density = world.write(self.fields.density);
        let medium = &self.medium;
        let points = density.iter_mut().zip(&*pressure).enumerate();
        points.for_each(|(i, (rho, &p))| *rho = medium.density(i, p));
        if let (Some(fraction), Some(projection)) = (self.fields.fraction, self.points.projection())
            && let Some(pair) = projection.pair()
        {
            let fraction = world.read::<f64>(fraction.into());
            let points = density.iter_mut().zip(&*fraction);
            points.for_each(|(rho, c)| *rho = pair.density_of(*c));
        }
        if let Points::Lagrangian(points) = &mut self.points {
            points.weigh(&density, &world.body(self.body).points.volume);
        }
    }
}

impl FluidFields {
    fn declare(
        setup: &mut Setup<'_>,
        body: BodyIndex,
        medium: &Medium,
        velocity_layers: LayersHandle,
    ) -> Result<Self, SetupError> {
        Ok(FluidFields {
            velocity: setup.own(body, &keys::VELOCITY)?,
            density: setup.own_derived(body, &keys::DENSITY)?,
            pressure: setup.own(body, &keys::PRESSURE)?,
            fraction: None,
            interface_pressure: None,
            interface_temperature: None,
            heat: None,
            body_force: setup.consume_if_added(body, &keys::BODY_FORCE)?,
            velocity_layers,
            temperature: match medium.viscosity.depends_on_temperature() {
                true => Some(FluidTemperature {
                    field: setup.read(body, &keys::TEMPERATURE)?,
                    curves: setup.world().enthalpy_curves(body)?,
                }),
                false => None,
            },
            viscous_work: match setup.is_declared(body, &keys::VISCOUS_WORK, Access::Read) {
                true => Some(setup.own_derived(body, &keys::VISCOUS_WORK)?),
                false => None,
            },
        })
    }

    /// Declares what is needed where `thermal` computes the temperature, on which the `tension` between two fluids may depend.
    fn declare_heat(
        &mut self,
        setup: &mut Setup<'_>,
        body: BodyIndex,
        is_incompressible: bool,
        tension: Option<TensionLaw>,
    ) -> Result<Option<HeatedFluid>, SetupError> {
        if is_incompressible {
            let heat = HeatedFluid::prepare(setup, body, tension)?;
            if heat.is_some() {
                self.heat = Some(FluidHeat::declare(setup, body)?);
            }
            return Ok(heat);
        }
        if is_heated(setup, body, tension.as_ref())? && tension.is_some() {
            self.interface_temperature = Some(setup.read(body, &keys::TEMPERATURE)?);
        }
        Ok(None)
    }

    /// Declares the fields of two fluids.
    fn declare_interface(
        &mut self,
        setup: &mut Setup<'_>,
        body: BodyIndex,
        is_incompressible: bool,
        pair: &FluidPair,
    ) -> Result<(), SetupError> {
        self.fraction = Some(declare_fraction(setup, body, pair)?);
        if is_incompressible {
            let key = &keys::INTERFACE_PRESSURE;
            self.interface_pressure = setup.consume_if_added(body, key)?;
        }
        Ok(())
    }
}

/// The two fluids of a body, where there are two.
fn prepare_pair(
    fluid: &Fluid,
    setup: &mut Setup<'_>,
    body: BodyIndex,
) -> Result<Option<PreparedPair>, SetupError> {
    let Some(fluids) = &fluid.fluids else {
        return Ok(None);
    };
    let keys = PairKeys {
        fluids,
        interface: fluid.interface.unwrap_or_default(),
        viscosity: fluid.viscosity.as_ref(),
    };
    FluidPair::prepare(keys, setup, body).map(Some)
}

/// The fraction of the first of two fluids, which begins with the materials of the points.
fn declare_fraction(
    setup: &mut Setup<'_>,
    body: BodyIndex,
    pair: &FluidPair,
) -> Result<Write<f64>, SetupError> {
    let fraction = setup.own(body, &keys::FLUID_FRACTION)?;
    let material = setup.body(body).material_of_point.clone();
    setup.set_first(fraction, |point| pair.fraction_of(material[point]));
    Ok(fraction)
}

/// Refuses surfaces without a wall where families must be complete, and open faces of a closed container.
fn check_surfaces(
    keys: &FluidKeys,
    setup: &Setup<'_>,
    body: BodyIndex,
    faces: &[Face],
) -> Result<(), SetupError> {
    if keys.is_incompressible() {
        // where it does not fill its box, bodies that are walls must
        let otherwise = "a `state` with sound, such as `state.tait`";
        check_faces(setup, body, faces, otherwise)?;
    } else if !keys.may_have_free_surface() {
        check_closed(setup, body, faces)?;
    }
    if keys.conservative().is_some_and(|keys| keys.is_closed) {
        let otherwise = "another `surface` than \"closed\"";
        check_faces(setup, body, faces, otherwise)?;
    }
    Ok(())
}

fn family_spec(fluid: &Fluid, keys: &FluidKeys, body: &Body, faces: Vec<Face>) -> FamilySpec {
    let horizon = usual_horizon(fluid.description, body);
    FamilySpec {
        partial_volume: fluid.partial_volume,
        influence: fluid.influence.unwrap_or(match keys.is_conservative() {
            false => Influence::Gaussian,
            true => Influence::Wendland,
        }),
        layers: faces,
        ..Pddo::spec(fluid.horizon.unwrap_or(horizon))
    }
}

fn prepare_medium(
    fluid: &mut Fluid,
    setup: &Setup<'_>,
    body: BodyIndex,
) -> Result<Medium, SetupError> {
    let this = setup.body(body);
    let freezes = setup.facts::<PhaseChange>(body).next().is_some();
    let viscosity = Viscosity::new(fluid.viscosity.take(), this, freezes)?;
    let density = setup.world().density_at_points(body)?;
    let spacing = this.points.spacing.to_vec();
    Ok(Medium::new(
        fluid.state.clone(),
        viscosity,
        density,
        spacing,
    ))
}
