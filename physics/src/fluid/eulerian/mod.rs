//! Points through which the fluid flows: at rest, or following bodies that are walls.

mod carried_flow;
mod differences;
pub(super) mod fluxes;
pub(super) mod immersed;
pub(super) mod point_motion;
pub(super) mod projection;

use nalgebra::Vector3;
use perimelt_core::plugin::check_length;
use perimelt_core::world::{BodyIndex, WallPlace};
use perimelt_core::{Setup, SetupError, World, Write, keys};
use serde::{Deserialize, Serialize};

use crate::advection::{Convection, FlowFamily};

use super::differences::Differences;
use super::kinds::{EulerianForm, EulerianKeys};
use super::pair::FluidPair;
use super::points::Surroundings;
use super::rates::{Rates, Stability};
use super::walls::{WallBody, WallMotion, Walls};
pub(super) use carried_flow::CarriedFlow;
use differences::EulerianDifferences;
use fluxes::{FluxDomain, Fluxes};
use point_motion::PointMotion;
use projection::wetted_body::WettedBody;
use projection::{Projection, ProjectionDomain, ProjectionState};

/// Points through which the fluid flows.
#[derive(Debug)]
pub(super) struct EulerianPoints {
    pub(super) convection: Convection,
    form: EulerianRates,
    place: Place,
}

/// Form of the equations.
#[derive(Debug)]
enum EulerianRates {
    Differences(Box<EulerianDifferences>),
    Fluxes(Box<Fluxes>),
    /// Of a fluid that keeps its volume.
    Projection(Box<Projection>),
}

/// Where the points are, with the field that tells it to others.
#[derive(Debug)]
enum Place {
    /// At rest.
    Resting { mass_flux: Write<Vector3<f64>> },
    /// They follow bodies that are walls.
    FollowingWalls { displacement: Write<Vector3<f64>> },
}

/// State of points through which the fluid flows, by form of the equations.
#[derive(Serialize, Deserialize)]
pub(super) enum SavedEulerian {
    Differences,
    Fluxes {
        /// Volume of the fluid at each point over that of its cell.
        fullness: Vec<f64>,
        /// Displacement of the cells of points that follow walls, m.
        displacement: Option<Vec<Vector3<f64>>>,
        walls: Vec<WallMotion>,
    },
    Projection {
        state: ProjectionState,
        walls: Vec<WallMotion>,
    },
}

impl EulerianPoints {
    pub(super) fn prepare(
        keys: EulerianKeys,
        setup: &mut Setup<'_>,
        mut around: Surroundings,
    ) -> Result<Self, SetupError> {
        let body = around.body;
        let place = match keys.form {
            EulerianForm::FollowingWalls => Place::FollowingWalls {
                displacement: setup.own(body, &keys::DISPLACEMENT)?,
            },
            EulerianForm::Differences(_) | EulerianForm::Resting | EulerianForm::Projection(_) => {
                Place::Resting {
                    mass_flux: setup.own_derived(body, &keys::MASS_FLUX)?,
                }
            }
        };
        setup.publish(body, FlowFamily(around.family))?;
        let family = setup.world().family(around.family);
        let convection = keys.convection;
        if !matches!(keys.form, EulerianForm::Differences(_)) {
            let walls = &mut around.walls;
            walls.immerse(setup, body, &family, &around.complete)?;
        }
        let form = match keys.form {
            EulerianForm::Differences(keys) => {
                let fluid = setup.body(body);
                let core = Differences::prepare(keys, fluid, family, &around.complete)?;
                let rates = EulerianDifferences::new(core, convection);
                EulerianRates::Differences(Box::new(rates))
            }
            EulerianForm::Projection(keys) => {
                let pair = around.pair.map(|prepared| prepared.pair);
                let wetted = |pair: &FluidPair| {
                    let fluid = setup.body(body);
                    let walls = around.walls.bodies.iter();
                    let of_wall = |wall: &WallBody| {
                        let solid = wall.wall.other;
                        let cosine = pair.contact_cosine(WallPlace::Body(solid));
                        WettedBody::new(fluid, setup.body(solid), wall, cosine)
                    };
                    walls.map(of_wall).collect()
                };
                let domain = ProjectionDomain {
                    wetted: pair.as_ref().map_or_else(Vec::new, wetted),
                    family,
                    complete: around.complete,
                    walls: around.walls,
                    pair,
                    heat: around.heat,
                };
                let rates = Projection::new(keys, convection, setup.body(body), domain);
                EulerianRates::Projection(Box::new(rates))
            }
            EulerianForm::Resting | EulerianForm::FollowingWalls => {
                let motion = match place {
                    Place::Resting { .. } => None,
                    Place::FollowingWalls { .. } => {
                        let fluid = setup.body(body);
                        Some(PointMotion::prepare(
                            fluid,
                            &family,
                            &around.walls.places(),
                        )?)
                    }
                };
                let domain = FluxDomain {
                    family,
                    complete: around.complete,
                    walls: around.walls,
                    motion,
                };
                let rates = Fluxes::new(convection, setup.body(body), domain);
                EulerianRates::Fluxes(Box::new(rates))
            }
        };
        Ok(EulerianPoints {
            convection,
            form,
            place,
        })
    }

    pub(super) fn rates(&self) -> &dyn Rates {
        match &self.form {
            EulerianRates::Differences(rates) => &**rates,
            EulerianRates::Fluxes(rates) => &**rates,
            EulerianRates::Projection(rates) => &**rates,
        }
    }

    pub(super) fn rates_mut(&mut self) -> &mut dyn Rates {
        match &mut self.form {
            EulerianRates::Differences(rates) => &mut **rates,
            EulerianRates::Fluxes(rates) => &mut **rates,
            EulerianRates::Projection(rates) => &mut **rates,
        }
    }

    fn fluxes(&self) -> Option<&Fluxes> {
        match &self.form {
            EulerianRates::Fluxes(rates) => Some(rates),
            EulerianRates::Differences(_) | EulerianRates::Projection(_) => None,
        }
    }

    pub(super) fn projection(&self) -> Option<&Projection> {
        match &self.form {
            EulerianRates::Projection(rates) => Some(rates),
            EulerianRates::Differences(_) | EulerianRates::Fluxes(_) => None,
        }
    }

    pub(super) fn projection_mut(&mut self) -> Option<&mut Projection> {
        match &mut self.form {
            EulerianRates::Projection(rates) => Some(rates),
            EulerianRates::Differences(_) | EulerianRates::Fluxes(_) => None,
        }
    }

    /// Motion of points that follow walls.
    pub(super) fn motion(&self) -> Option<&PointMotion> {
        self.fluxes()?.motion.as_ref()
    }

    pub(super) fn walls(&self) -> Option<&Walls> {
        match &self.form {
            EulerianRates::Differences(_) => None,
            EulerianRates::Fluxes(rates) => Some(&rates.walls),
            EulerianRates::Projection(rates) => Some(&rates.walls),
        }
    }

    pub(super) fn walls_mut(&mut self) -> Option<&mut Walls> {
        match &mut self.form {
            EulerianRates::Differences(_) => None,
            EulerianRates::Fluxes(rates) => Some(&mut rates.walls),
            EulerianRates::Projection(rates) => Some(&mut rates.walls),
        }
    }

    /// Volume of the fluid at a point over that of its cell.
    pub(super) fn fullness(&self, point: usize) -> f64 {
        self.fluxes().map_or(1.0, |rates| rates.fullness[point])
    }

    /// Takes positions and velocities of the bodies that are walls for the fluid of `body`, and lets points follow them in a
    /// step of `dt` (s).
    pub(super) fn follow_walls(&mut self, world: &World, body: BodyIndex, dt: f64) {
        match &mut self.form {
            EulerianRates::Differences(_) => (),
            EulerianRates::Fluxes(rates) => rates.follow_walls(world, body, dt),
            EulerianRates::Projection(rates) => rates.walls.follow(world, body),
        }
    }

    /// Gives the walls the opposite of what they do to the fluid in a time, s.
    pub(super) fn give_impulses(&mut self, world: &World, time: f64) {
        match &mut self.form {
            EulerianRates::Differences(_) => (),
            EulerianRates::Fluxes(rates) => rates.give_impulses(world, time),
            EulerianRates::Projection(rates) => rates.give_impulses(world, time),
        }
    }

    /// Writes the flux of mass through points at rest.
    pub(super) fn write_mass_flux(
        &self,
        world: &World,
        velocity: &[Vector3<f64>],
        density: &[f64],
    ) {
        if let Place::Resting { mass_flux } = self.place {
            let mut flux = world.write(mass_flux);
            match &self.form {
                EulerianRates::Differences(rates) => rates.mass_flux(&mut flux),
                EulerianRates::Fluxes(rates) => rates.mass_flux(&mut flux),
                EulerianRates::Projection(_) => {
                    let points = flux.iter_mut().zip(velocity).zip(density);
                    points.for_each(|((flux, v), rho)| *flux = *rho * v);
                }
            }
        }
    }

    /// Writes the displacement of points that follow walls.
    pub(super) fn write_displacement(&self, world: &World) {
        if let (Place::FollowingWalls { displacement }, Some(motion)) = (&self.place, self.motion())
        {
            let mut displacement = world.write(*displacement);
            let points = displacement.iter_mut().zip(motion.displacements());
            points.for_each(|(u, now)| *u = now);
        }
    }

    pub(super) fn stability_now(&self, initial: Stability) -> Option<Stability> {
        let compression = self.motion()?.largest_compression();
        Some(initial.compressed(compression))
    }

    pub(super) fn save(&self) -> SavedEulerian {
        match &self.form {
            EulerianRates::Differences(_) => SavedEulerian::Differences,
            EulerianRates::Fluxes(rates) => SavedEulerian::Fluxes {
                fullness: rates.fullness.clone(),
                displacement: rates.motion.as_ref().map(|motion| motion.state().clone()),
                walls: rates.walls.motions(),
            },
            EulerianRates::Projection(rates) => SavedEulerian::Projection {
                state: rates.state().clone(),
                walls: rates.walls.motions(),
            },
        }
    }

    pub(super) fn load(&mut self, saved: SavedEulerian) -> Result<(), erased_serde::Error> {
        match (&mut self.form, saved) {
            (EulerianRates::Differences(_), SavedEulerian::Differences) => Ok(()),
            (EulerianRates::Projection(rates), SavedEulerian::Projection { state, walls }) => {
                rates.walls.set_motions(walls);
                rates.load(state)
            }
            (
                EulerianRates::Fluxes(rates),
                SavedEulerian::Fluxes {
                    fullness,
                    displacement,
                    walls,
                },
            ) => {
                check_length("fullness", fullness.len(), rates.fullness.len())?;
                rates.fullness = fullness;
                rates.walls.set_motions(walls);
                if let (Some(motion), Some(displacement)) = (&mut rates.motion, displacement) {
                    let (found, expected) = (displacement.len(), motion.state().len());
                    check_length("displacements", found, expected)?;
                    motion.set_state(displacement);
                }
                Ok(())
            }
            _ => Err(serde::de::Error::custom(
                "the saved fluid has another form of the equations",
            )),
        }
    }
}
