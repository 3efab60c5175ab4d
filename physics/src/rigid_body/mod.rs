//! Motion of a solid that does not deform.
//!
//! ```text
//! P' = F,   P = M V                      momentum, N s
//! L' = sum x_i x f_i                     angular momentum about the origin, N m s
//! L  = x_c x P + S,   S = R I R^T omega  x_c: centre of mass, m; R: rotation; I: inertia, kg m²
//! u_i = d + (R - 1) a_i                  displacement of a point with the reference arm a_i from x_c, m
//! v_i = V + omega x (R a_i)              its velocity, m/s
//! ```
//!
//! A step adds the sink `impulse` at the positions of its start (`P += J`, `L += sum x_i x j_i`), so that momentum exchanged
//! with other bodies is conserved to rounding, and then integrates `body_force`, springs and dashpots by velocity
//! Verlet. Free rotation in 3D is a composition of exact rotations that conserves S (`rotation.rs`); in 2D and about
//! a fixed axis it is an angle. The positions of points follow from the rigid motion and are not integrated: the
//! shape is kept to rounding over any number of steps.
//!
//! Not for bodies that deform (`mechanical`), and bodies do not collide by themselves.

pub mod degrees;
pub mod inertia;
mod mass;
mod report;
mod rotation;
mod state;
#[cfg(test)]
mod tests;

use nalgebra::{Matrix3, Vector3};
use perimelt_core::numbers::check_positive;
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::world::BodyIndex;
use perimelt_core::world::Rigid;
use perimelt_core::{
    Balance, LoadError, Physics, PhysicsReport, Prepared, Read, RunError, RunningPhysics,
    SavedState, Setup, SetupError, Step, StepLimits, StepSize, Stepping, Work, World, Write, keys,
};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::momentum::AXES;
use degrees::{ByDegree, Degree, Freedoms, Prescribed, Turning};
use inertia::{AngularVelocity, Inertia};
use mass::{MassProperties, PointWeights, Resultant};
use rotation::PrincipalInertia;
use state::{RigidDynamics, RigidState, Wrench};

/// Rigid body, free, held or driven along each degree of freedom; owns `displacement` and `velocity`, consumes
/// `body_force` and `impulse`.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RigidBody {
    /// Body that moves; may be left out when there is only one.
    #[serde(default)]
    pub body: Option<String>,
    /// Mass, kg; density times volume when left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub mass: Option<f64>,
    /// Inertia about the centre of mass, kg m²: a number in 2D; in 3D `[xx, yy, zz]` or a 3 by 3 matrix. That of the
    /// points and their cells when left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inertia: Option<Inertia>,
    /// Degrees of freedom that are held, such as `["x", "rotation"]`.
    #[serde(default)]
    pub hold: Vec<Degree>,
    /// Degrees of freedom that follow a prescribed displacement or velocity, such as
    /// `driven.y.sine = { amplitude = 0.01, frequency = 2 }`.
    #[serde(default)]
    pub driven: ByDegree<Prescribed>,
    /// Springs to the reference position, N/m (rotation: N m/rad), such as `spring.x = 100`.
    #[serde(default)]
    pub spring: ByDegree<f64>,
    /// Dashpots, N s/m (rotation: N m s/rad).
    #[serde(default)]
    pub damping: ByDegree<f64>,
    /// Initial velocity of the centre of mass, m/s; fitted to the initial field `velocity` when left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub initial_velocity: Option<[f64; 3]>,
    /// Initial angular velocity, rad/s: a number in 2D, a vector in 3D; fitted to the initial field `velocity` when left
    /// out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub initial_angular_velocity: Option<AngularVelocity>,
    /// Step in s, or "auto": the largest stable one of the springs.
    #[serde(default)]
    pub step: StepSize,
}

/// A rigid body that moves.
struct RunningRigidBody {
    body: BodyIndex,
    initial_velocity: Option<[f64; 3]>,
    initial_angular_velocity: Option<AngularVelocity>,
    name: String,
    displacement: Write<Vector3<f64>>,
    velocity: Write<Vector3<f64>>,
    body_force: Option<Read<Vector3<f64>>>,
    impulse: Option<Read<Vector3<f64>>>,
    properties: MassProperties,
    /// Volumes of the points and their moments.
    volumes: PointWeights,
    dynamics: RigidDynamics,
    state: RigidState,
}

/// An initial displacement that is not a rigid motion.
#[derive(Debug, thiserror::Error)]
#[error(
    "the initial displacement of rigid body `{body}` is not rigid: point {point} lies {distance:.3e} m beside the \
     closest rigid motion; give a uniform displacement{rotation}"
)]
struct NotRigid {
    body: String,
    point: usize,
    distance: f64,
    rotation: &'static str,
}

impl RunningRigidBody {
    /// Load on the body: the resultant of `body_force`, which moves with the points during a step.
    fn load(resultant: Option<Resultant>, state: &RigidState) -> Wrench {
        resultant.map_or_else(Wrench::default, |r| Wrench {
            force: r.total,
            moment: r.moment(&state.rotation()),
        })
    }

    fn move_points(&mut self, world: &World, step: Step) {
        let before = self.dynamics.momenta(&self.state);
        if let Some(impulse) = self.impulse {
            let resultant = self.volumes.resultant(&world.read(impulse));
            let impulse = Wrench {
                force: resultant.total,
                moment: resultant.moment(&self.state.rotation()),
            };
            self.state.received.force += impulse.force;
            self.state.received.moment += impulse.moment;
            self.dynamics.kick(&mut self.state, &impulse);
        }
        self.state.elapsed += step.size;
        let resultant = self
            .body_force
            .map(|force| self.volumes.resultant(&world.read(force)));
        let load = |state: &RigidState| Self::load(resultant, state);
        self.dynamics.advance(&mut self.state, step, load);
        self.dynamics.account_holder(&mut self.state, &before);
        self.place_points(world);
    }

    fn place_points(&self, world: &World) {
        let motion = self
            .dynamics
            .motion_of_points(&self.state, &self.properties.arms);
        let mut displacement = world.write(self.displacement);
        let mut velocity = world.write(self.velocity);
        let points = displacement.par_iter_mut().zip(velocity.par_iter_mut());
        let points = points.enumerate().with_min_len(4096);
        points.for_all(|(point, (u, v))| (*u, *v) = motion(point));
    }

    /// Displacement and orientation of the initial field `displacement`.
    fn fit_displacement(&mut self, world: &World) -> Result<(), NotRigid> {
        let displacement = world.read::<Vector3<f64>>(self.displacement.into());
        self.state.displacement = self.properties.mean(&displacement);
        let mut rotation = "";
        if let Turning::About(axis, _) = self.dynamics.freedoms.turning {
            self.state.angle = self.properties.fit_angle(axis, &displacement);
            self.state.orientation = rotation::about(axis, self.state.angle);
            rotation = ", or one that turns the body about its axis";
        }
        let motion = self
            .dynamics
            .motion_of_points(&self.state, &self.properties.arms);
        let body = world.body(self.body);
        let (min, max) = body.bounds();
        // formulas of a case file give a rigid rotation to rounding
        let limit = 1e-6 * (max - min).norm();
        let distance = |point: usize| (motion(point).0 - displacement[point]).norm();
        let reducer = &self.properties.reducer;
        let beside = (0..reducer.owned()).find(|point| distance(*point) > limit);
        let beside = beside.map(|point| (-f64::from(reducer.number(point)), [distance(point)]));
        match reducer.largest(beside) {
            None => Ok(()),
            Some((number, [distance])) => Err(NotRigid {
                body: body.name.clone(),
                point: -number as usize,
                distance,
                rotation,
            }),
        }
    }
}

impl RigidBody {
    fn properties(&self, setup: &Setup<'_>, body: BodyIndex) -> Result<MassProperties, SetupError> {
        check_positive("mass", self.mass, "kg")?;
        let density = match (setup.world().density_at_points(body), self.mass) {
            (Ok(density), _) => density,
            // a body with a mass and no density is uniform
            (Err(_), Some(_)) => vec![1.0; setup.body(body).points.len()],
            (Err(error), None) => return Err(error),
        };
        let reducer = setup.world().reducer(body);
        let body = setup.body(body);
        let mut properties =
            MassProperties::of_points(body.dimension, &body.points, &density, self.mass, reducer);
        if let Some(inertia) = self.inertia {
            properties.inertia = inertia.matrix(body.dimension)?;
        }
        Ok(properties)
    }

    /// Refuses initial velocities of degrees of freedom that are not free.
    fn check_initial(&self, freedoms: &Freedoms) -> Result<(), SetupError> {
        let refuse = |key: &str, axis: usize| {
            let message = format!("the body cannot move along or rotate about {}", AXES[axis]);
            Err(SetupError::value(key, message, "zero there"))
        };
        let velocity = self.initial_velocity.unwrap_or_default();
        let fixed = |&axis: &usize| velocity[axis] != 0.0 && !freedoms.translation[axis].is_free();
        if let Some(axis) = (0..3).find(fixed) {
            return refuse("initial_velocity", axis);
        }
        let Some(velocity) = self.initial_angular_velocity else {
            return Ok(());
        };
        let velocity = velocity.vector(freedoms.dimension)?;
        let free = |axis: usize| match &freedoms.turning {
            Turning::Any => true,
            Turning::About(only, freedom) => axis == *only && freedom.is_free(),
            Turning::Held => false,
        };
        match (0..3).find(|&axis| velocity[axis] != 0.0 && !free(axis)) {
            Some(axis) => refuse("initial_angular_velocity", axis),
            None => Ok(()),
        }
    }
}

/// Refuses bodies that cannot move as rigid bodies, and boundaries of the displacement, which have no effect.
fn check_body(
    setup: &mut Setup<'_>,
    body: BodyIndex,
    freedoms: &Freedoms,
) -> Result<(), SetupError> {
    if setup.body(body).periodic != [false; 3] {
        let message = "a periodic body has no centre of mass and cannot rotate";
        return Err(SetupError::value(
            "body",
            message,
            "a body without `periodic`",
        ));
    }
    let layers = setup.layers(body, &keys::DISPLACEMENT);
    let (faces, prescribed) = (layers.faces(), layers.prescribed);
    if let Some(face) = prescribed.first() {
        let message = format!(
            "a boundary prescribes the displacement at face `{}`",
            face.name()
        );
        let expected = "`hold` or `driven` of the rigid body instead of the boundary";
        return Err(SetupError::value("body", message, expected));
    }
    let crossing = |face: &&perimelt_core::Face| freedoms.translation[face.axis()].is_free();
    if let Some(face) = faces.iter().find(crossing) {
        let message = format!(
            "the body is free to leave its plane of symmetry `{}`",
            face.name()
        );
        let expected = format!("`hold = [\"{}\"]`", AXES[face.axis()]);
        return Err(SetupError::value("hold", message, expected));
    }
    Ok(())
}

#[typetag::serialize(name = "rigid_body")]
impl Physics for RigidBody {
    fn prepare(self: Box<Self>, setup: &mut Setup<'_>) -> Prepared<dyn RunningPhysics> {
        let body = setup.find_body(self.body.as_deref())?;
        let dimension = setup.body(body).dimension;
        if dimension == 1 {
            let message = "a 1D body cannot move as a rigid body";
            return Err(SetupError::value("body", message, "a 2D or 3D body"));
        }
        let freedoms = Freedoms::new(dimension, &self.hold, &self.driven)?;
        freedoms.check_resistance("spring", &self.spring)?;
        freedoms.check_resistance("damping", &self.damping)?;
        self.check_initial(&freedoms)?;
        check_body(setup, body, &freedoms)?;
        let properties = self.properties(setup, body)?;
        let inverse_inertia = properties.inertia.try_inverse();
        let dynamics = RigidDynamics {
            mass: properties.mass,
            centre: properties.centre,
            inertia: properties.inertia,
            // the inertia of points and cells is positive, and a given inertia was checked
            inverse_inertia: inverse_inertia.unwrap_or_else(Matrix3::zeros),
            principal: PrincipalInertia::new(&properties.inertia),
            freedoms,
            spring: self.spring.clone(),
            damping: self.damping.clone(),
        };
        setup.publish(body, Rigid)?;
        let volume = setup.body(body).points.volume.to_vec();
        setup.stepping(Stepping {
            step: self.step,
            ..Stepping::default()
        });
        Ok(Box::new(RunningRigidBody {
            body,
            initial_velocity: self.initial_velocity,
            initial_angular_velocity: self.initial_angular_velocity,
            name: setup.body(body).name.clone(),
            displacement: setup.own(body, &keys::DISPLACEMENT)?,
            velocity: setup.own(body, &keys::VELOCITY)?,
            body_force: setup.consume_if_added(body, &keys::BODY_FORCE)?,
            impulse: setup.take_if_added(body, &keys::IMPULSE)?,
            volumes: PointWeights::new(
                dimension,
                volume,
                &properties.arms,
                properties.reducer.clone(),
            ),
            properties,
            dynamics,
            state: RigidState::default(),
        }))
    }
}

impl RunningPhysics for RunningRigidBody {
    fn start(&mut self, world: &World) -> Result<(), RunError> {
        self.fit_displacement(world)
            .map_err(|cause| RunError::Plugin {
                plugin: "rigid_body".into(),
                time: 0.0,
                cause: cause.into(),
            })?;
        let rotation = self.state.rotation();
        let field = self.velocity.into();
        let fitted = self.properties.fit_velocity(&rotation, &world.read(field));
        let velocity = self.initial_velocity.map_or(fitted.0, Vector3::from);
        let given = self.initial_angular_velocity;
        let given =
            given.and_then(|velocity| velocity.vector(self.dynamics.freedoms.dimension).ok());
        let angular = given.unwrap_or(fitted.1);
        self.state.momentum = velocity * self.dynamics.mass;
        self.state.spin = match self.dynamics.freedoms.turning {
            Turning::About(axis, _) => {
                Vector3::ith(axis, self.dynamics.inertia_about(axis) * angular[axis])
            }
            _ => rotation * self.dynamics.inertia * rotation.transpose() * angular,
        };
        self.dynamics.constrain_start(&mut self.state);
        self.state.initial = self.dynamics.momenta(&self.state);
        self.place_points(world);
        Ok(())
    }

    fn stable_step(&mut self, _world: &World) -> Option<f64> {
        self.dynamics.stable_step()
    }

    fn step_limits(&self, time: f64) -> StepLimits {
        StepLimits {
            next_event: self.dynamics.freedoms.next_event(time),
            longest: None,
        }
    }

    /// A body may travel far in free flight; an unstable load exceeds any limit within a few hundred steps.
    fn find_blow_up(&mut self, world: &World, field: &str, largest: f64) -> Option<usize> {
        let (min, max) = world.body(self.body).bounds();
        let limit = 1e4 * (max - min).norm();
        let is_beyond = field == keys::DISPLACEMENT.name && largest > limit;
        let displacement = Read::from(self.displacement);
        is_beyond.then(|| world.first_beyond(displacement, limit))?
    }

    fn advance(&mut self, world: &World, step: Step) -> Result<Work, RunError> {
        self.move_points(world, step);
        Ok(Work::of_stages(1))
    }

    fn observe(&mut self, _world: &World, _time: f64) -> Result<(), RunError> {
        self.state.observe();
        Ok(())
    }

    fn balance(&self, world: &World) -> Vec<Balance> {
        self.balances(world)
    }

    fn report(&self, _world: &World) -> PhysicsReport {
        self.reports().into()
    }

    fn save(&self, _: &World) -> Box<dyn erased_serde::Serialize + '_> {
        Box::new(&self.state)
    }

    fn load(&mut self, _world: &World, state: SavedState<'_, '_>) -> Result<(), LoadError> {
        self.state = erased_serde::deserialize(state)?;
        Ok(())
    }
}

perimelt_core::register_physics!("rigid_body", RigidBody, supports: [Division]);
