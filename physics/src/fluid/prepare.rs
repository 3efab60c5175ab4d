//! Set-up of a fluid: fields, family, operators, properties.

use std::sync::Arc;

use perimelt_core::solver::reduce::sum;
use perimelt_core::world::BodyIndex;
use perimelt_core::{
    Access, Body, Description, Face, Family, FamilyHandle, FamilySpec, Influence, Pddo, PointMover,
    Setup, SetupError, SlotField, World, keys,
};

use crate::advection::{FlowFamily, usual_horizon};
use crate::shape_tensor::CompleteFamily;

use super::boundaries::{check_closed, check_faces};
use super::conservative::Conservative;
use super::differences::Differences;
use super::fluxes::Fluxes;
use super::keys::{Fluid, Form, Stress, Surface};
use super::medium::{Coefficient, Medium};
use super::point_motion::PointMotion;
use super::rates::{LargestSums, Rates};
use super::run::{FluidRun, FluidTemperature, Moving};
use super::treatments::Treatments;
use super::walls::Walls;

/// Where the points are: a family, and what moves them.
struct Neighbours {
    family: Arc<Family>,
    moving: Option<(PointMover, FamilyHandle)>,
}

impl FluidRun {
    pub(super) fn prepare(fluid: &Fluid, setup: &mut Setup<'_>) -> Result<FluidRun, SetupError> {
        let body = setup.find_body(fluid.body.as_deref())?;
        fluid.check(setup.body(body))?;
        let velocity = setup.own(body, &keys::VELOCITY)?;
        let density = setup.own(body, &keys::DENSITY)?;
        let pressure = setup.own(body, &keys::PRESSURE)?;
        let displacement = match fluid.description {
            Description::Eulerian => None,
            _ => Some(setup.own(body, &keys::DISPLACEMENT)?),
        };
        let moves_through = fluid.description == Description::ArbitraryLagrangianEulerian;
        let mass_flux = match fluid.description {
            Description::Eulerian => Some(setup.own(body, &keys::MASS_FLUX)?),
            _ => None,
        };
        let body_force = setup.consume_if_added(body, &keys::BODY_FORCE)?;
        let impulse = match fluid.description {
            Description::UpdatedLagrangian => setup.take_if_added(body, &keys::IMPULSE)?,
            _ => None,
        };
        let velocity_layers = setup.layers(body, &keys::VELOCITY);
        let (walls, velocity_layers) = (velocity_layers.faces(), velocity_layers.handle);
        if !fluid.may_have_free_surface() {
            check_closed(setup, body, &walls)?;
        }
        if fluid.surface == Surface::Closed {
            let otherwise =
                "another `surface` than \"closed\": a fluid beyond a face is no boundary";
            check_faces(setup, body, &walls, otherwise)?;
        }
        let medium = prepare_medium(fluid, setup, body)?;
        let temperature = match medium.viscosity.depends_on_temperature() {
            true => Some(FluidTemperature {
                field: setup.read(body, &keys::TEMPERATURE)?,
                curves: setup.world().enthalpy_curves(body)?,
            }),
            false => None,
        };
        let viscous_work = match setup.is_declared(body, &keys::VISCOUS_WORK, Access::Read) {
            true => Some(setup.own(body, &keys::VISCOUS_WORK)?),
            false => None,
        };
        let has_faces = !walls.is_empty();
        let spec = family_spec(fluid, setup.body(body), walls);
        let mut solids = Walls::prepare(setup, body, &spec)?;
        fluid.check_walls(&solids)?;
        let Neighbours { family, moving } = neighbours(fluid, setup, body, &spec)?;
        let complete = CompleteFamily::of(setup.body(body), &family);
        let is_eulerian = fluid.description.flows_through();
        if is_eulerian && fluid.form == Form::Conservative {
            solids.immerse(setup, (body, &family), &complete)?;
        }
        let this = setup.body(body);
        let sums = LargestSums::of(&family, this.points.len(), None);
        let treatments = Treatments::new(complete, this.dimension);
        let rates: Box<dyn Rates> = match fluid.form {
            Form::Conservative if is_eulerian => {
                let size = (this.dimension, this.points.len());
                let motion = match moves_through {
                    true => Some(PointMotion::prepare(this, &family, &solids.places())?),
                    false => None,
                };
                let walls = (solids, motion);
                Box::new(Fluxes::new(family, size, treatments.complete, walls))
            }
            Form::Conservative => {
                let walls = (solids, fluid.stress == Stress::Central);
                Box::new(Conservative::new(family, this, treatments.complete, walls))
            }
            Form::Differences => {
                let pddo = Pddo::build(this, family, 2);
                let pddo = pddo.map_err(|e| SetupError::other("horizon", e))?;
                Box::new(Differences::new(pddo, is_eulerian))
            }
        };
        let is_periodic = this.periodic[..this.dimension] == [true; 3][..this.dimension];
        let is_partly_periodic = this.periodic.contains(&true);
        let keeps_angular_momentum =
            !has_faces && !is_partly_periodic && fluid.keeps_angular_momentum();
        Ok(FluidRun {
            body,
            velocity,
            density,
            pressure,
            displacement,
            mass_flux,
            body_force,
            impulse,
            temperature,
            viscous_work,
            velocity_layers,
            medium,
            initial_stability: rates.stability(),
            stability: rates.stability(),
            stable_step: None,
            rates,
            treatments,
            slots: vec![SlotField::default(); this.dimension],
            moving: moving.map(|(mover, family)| Moving {
                mover,
                family,
                initial_sums: sums,
                mass: vec![0.0; this.points.len()],
                position: Vec::new(),
                volume: Vec::new(),
            }),
            container: (fluid.surface == Surface::Closed).then(|| sum(&this.points.volume)),
            steps: 0,
            initial_mass: 0.0,
            momentum: (is_periodic || !has_faces).then(Default::default),
            angular_momentum: keeps_angular_momentum.then(Default::default),
            kinetic_energy: 0.0,
            density_deviation: 0.0,
        })
    }

    /// Density from the pressure at the start.
    pub(super) fn complete_state(&mut self, world: &World) {
        let pressure = world.read(self.pressure.into());
        let mut density = world.write(self.density);
        let medium = &self.medium;
        let points = density
            .iter_mut()
            .zip(&*pressure)
            .zip(&medium.reference_density);
        for ((rho, &p), &rho0) in points {
            *rho = medium.state.density(p, rho0);
        }
    }
}

fn family_spec(fluid: &Fluid, body: &Body, walls: Vec<Face>) -> FamilySpec {
    let horizon = usual_horizon(fluid.description, body);
    FamilySpec {
        partial_volume: fluid.partial_volume,
        influence: fluid.influence.unwrap_or(match fluid.form {
            Form::Differences => Influence::Gaussian,
            Form::Conservative => Influence::Wendland,
        }),
        layers: walls,
        ..Pddo::spec(fluid.horizon.unwrap_or(horizon))
    }
}

/// The family of the points, which follows them in the updated Lagrangian description.
fn neighbours(
    fluid: &Fluid,
    setup: &mut Setup<'_>,
    body: BodyIndex,
    spec: &FamilySpec,
) -> Result<Neighbours, SetupError> {
    let family = setup.family(body, spec)?;
    let moves = fluid.description == Description::UpdatedLagrangian;
    if !moves {
        setup.publish(body, FlowFamily(family))?;
    }
    Ok(Neighbours {
        family: setup.world().family(family),
        moving: moves.then(|| (setup.move_points(body), family)),
    })
}

fn prepare_medium(fluid: &Fluid, setup: &Setup<'_>, body: BodyIndex) -> Result<Medium, SetupError> {
    let viscosity = setup.world().property(body, "viscosity")?;
    let this = setup.body(body);
    Ok(Medium {
        state: fluid.state,
        reference_density: setup.world().density_at_points(body)?,
        spacing: this.points.spacing.clone(),
        viscosity: Coefficient::new(viscosity, &this.material_of_point),
    })
}
