//! State of a rigid body and its motion over one step.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use perimelt_core::Step;
use serde::{Deserialize, Serialize};

use super::degrees::{ByDegree, Freedom, Freedoms, Turning};
use super::rotation::{PrincipalInertia, about, turned_by};

/// Properties of a rigid body that are constant during a run.
#[derive(Debug)]
pub(super) struct RigidDynamics {
    /// Mass, kg.
    pub mass: f64,
    /// Centre of mass in the reference configuration, m.
    pub centre: Vector3<f64>,
    /// Inertia about the centre of mass in the reference configuration, kg m².
    pub inertia: Matrix3<f64>,
    pub inverse_inertia: Matrix3<f64>,
    pub principal: PrincipalInertia,
    pub freedoms: Freedoms,
    /// Springs, N/m (rotation: N m/rad).
    pub spring: ByDegree<f64>,
    /// Dashpots, N s/m (rotation: N m s/rad).
    pub damping: ByDegree<f64>,
}

/// Force (N) and moment about the centre of mass (N m), or their integrals over time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Wrench {
    pub force: Vector3<f64>,
    pub moment: Vector3<f64>,
}

/// Momentum (N s) and angular momentum about the origin (N m s).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Momenta {
    pub momentum: Vector3<f64>,
    pub angular: Vector3<f64>,
}

/// State of a rigid body that is saved beside the fields.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct RigidState {
    /// Displacement of the centre of mass, m.
    pub displacement: Vector3<f64>,
    pub orientation: UnitQuaternion<f64>,
    /// Rotation about the only axis of rotation, rad; counts full turns. Zero where there is no such axis.
    pub angle: f64,
    /// Momentum, N s.
    pub momentum: Vector3<f64>,
    /// Angular momentum about the centre of mass, N m s; where the body turns about one axis, its component along it.
    pub spin: Vector3<f64>,
    pub initial: Momenta,
    /// Momenta supplied since the start by loads, springs, dashpots and constraints.
    pub given: Momenta,
    /// Sums of the sizes of all impulses (N s) and angular impulses (N m s) since the start.
    pub exchanged: [f64; 2],
    /// Impulses of couplers since the last logged state.
    pub received: Wrench,
    /// Time since the last logged state, s.
    pub elapsed: f64,
    /// Mean force and moment of the impulses between the last two logged states.
    pub mean: Wrench,
}

impl RigidDynamics {
    /// Centre of mass, m.
    pub(super) fn position(&self, state: &RigidState) -> Vector3<f64> {
        self.centre + state.displacement
    }

    /// Velocity of the centre of mass, m/s.
    pub(super) fn velocity(&self, state: &RigidState) -> Vector3<f64> {
        state.momentum / self.mass
    }

    /// Moment of inertia about the axis of space through the centre of mass about which the body turns, kg m².
    pub(super) fn inertia_about(&self, axis: usize) -> f64 {
        self.inertia[(axis, axis)]
    }

    /// Angular velocity, rad/s.
    pub(super) fn angular_velocity(&self, state: &RigidState) -> Vector3<f64> {
        match self.freedoms.turning {
            Turning::Held => Vector3::zeros(),
            Turning::About(axis, _) => state.spin / self.inertia_about(axis),
            Turning::Any => {
                let spin = state.orientation.inverse_transform_vector(&state.spin);
                state.orientation * (self.inverse_inertia * spin)
            }
        }
    }

    /// Angular momentum about the centre of mass, N m s. An asymmetric body on a fixed axis also has components
    /// across the axis, which the bearings of the axis exert.
    pub(super) fn spin(&self, state: &RigidState) -> Vector3<f64> {
        match self.freedoms.turning {
            Turning::About(..) if self.freedoms.dimension == 3 => {
                let velocity = self.angular_velocity(state);
                let velocity = state.orientation.inverse_transform_vector(&velocity);
                state.orientation * (self.inertia * velocity)
            }
            _ => state.spin,
        }
    }

    /// Momentum and angular momentum about the origin.
    pub(super) fn momenta(&self, state: &RigidState) -> Momenta {
        let orbital = self.position(state).cross(&state.momentum);
        Momenta {
            momentum: state.momentum,
            angular: orbital + self.spin(state),
        }
    }

    /// Kinetic energy, J.
    pub(super) fn kinetic_energy(&self, state: &RigidState) -> f64 {
        let translation = state.momentum.dot(&self.velocity(state));
        0.5 * (translation + self.spin(state).dot(&self.angular_velocity(state)))
    }

    /// Applies an impulse at the centre of mass and an angular impulse about it:
    ///
    /// ```text
    /// P += J,   L += x_c x J + M
    /// ```
    ///
    /// with the angular momentum L about the origin. Constraints balance the impulses on held and driven degrees of freedom.
    pub(super) fn kick(&self, state: &mut RigidState, impulse: &Wrench) {
        for axis in (0..3).filter(|&a| self.freedoms.translation[a].is_free()) {
            state.momentum[axis] += impulse.force[axis];
            state.given.momentum[axis] += impulse.force[axis];
        }
        match &self.freedoms.turning {
            Turning::Any => state.spin += impulse.moment,
            Turning::About(axis, Freedom::Free) => state.spin[*axis] += impulse.moment[*axis],
            _ => {}
        }
        let position = self.position(state);
        if self.freedoms.is_free() {
            state.given.angular += position.cross(&impulse.force) + impulse.moment;
        }
        state.exchanged[0] += impulse.force.norm();
        state.exchanged[1] += position.norm() * impulse.force.norm() + impulse.moment.norm();
    }

    /// Moves a body under the force and moment that `load` returns for an orientation, over `step`: a half-kick at the
    /// start, a drift, a half-kick at the end (velocity Verlet), second order and symplectic without damping.
    pub(super) fn advance(
        &self,
        state: &mut RigidState,
        step: Step,
        load: impl Fn(&RigidState) -> Wrench,
    ) {
        let half = 0.5 * step.size;
        let kick = self.half_kick(state, &load(state), half);
        self.kick(state, &kick);
        self.drift(state, step);
        let kick = self.half_kick(state, &load(state), half);
        self.kick(state, &kick);
    }

    /// Impulse of the load, the springs and the dashpots over the time `half` (s). With the force F, spring
    /// included, the momentum obeys `P' = F - c P / m`, whose exact solution for constant F is
    ///
    /// ```text
    /// P_new - P = (exp(-c h / m) - 1) P + F h (1 - exp(-c h / m)) / (c h / m)
    /// ```
    fn half_kick(&self, state: &RigidState, load: &Wrench, half: f64) -> Wrench {
        let (spring, damping) = (self.spring.translations(), self.damping.translations());
        let mut impulse = Wrench {
            force: load.force * half,
            moment: load.moment * half,
        };
        for axis in 0..3 {
            let force = load.force[axis] - resisted(spring[axis], state.displacement[axis]);
            let rate = resisted(damping[axis], 1.0 / self.mass);
            impulse.force[axis] = damped_impulse(state.momentum[axis], force, rate, half);
        }
        if let Turning::About(axis, Freedom::Free) = self.freedoms.turning {
            let moment = load.moment[axis] - resisted(self.spring.rotation.as_ref(), state.angle);
            let rate = resisted(
                self.damping.rotation.as_ref(),
                1.0 / self.inertia_about(axis),
            );
            impulse.moment[axis] = damped_impulse(state.spin[axis], moment, rate, half);
        }
        impulse
    }

    /// Moves the body with constant momenta.
    fn drift(&self, state: &mut RigidState, step: Step) {
        for (axis, freedom) in self.freedoms.translation.iter().enumerate() {
            match freedom {
                Freedom::Free => {
                    state.displacement[axis] += step.size * state.momentum[axis] / self.mass;
                }
                Freedom::Held => {}
                Freedom::Driven(prescribed) => {
                    let driven = prescribed.end(state.displacement[axis], step);
                    state.displacement[axis] = driven.displacement;
                    state.momentum[axis] = self.mass * driven.velocity;
                }
            }
        }
        match &self.freedoms.turning {
            Turning::Any => {
                let turned = self
                    .principal
                    .rotate(state.orientation, &state.spin, step.size);
                state.orientation = turned;
            }
            Turning::About(axis, freedom) => {
                let inertia = self.inertia_about(*axis);
                if let Freedom::Driven(prescribed) = freedom {
                    let driven = prescribed.end(state.angle, step);
                    state.angle = driven.displacement;
                    state.spin[*axis] = inertia * driven.velocity;
                } else {
                    state.angle += step.size * state.spin[*axis] / inertia;
                }
                state.orientation = about(*axis, state.angle);
            }
            Turning::Held => {}
        }
    }

    /// Counts the change of the momenta since `before` by constraints as supplied.
    pub(super) fn account_holder(&self, state: &mut RigidState, before: &Momenta) {
        let after = self.momenta(state);
        for axis in 0..3 {
            if !self.freedoms.translation[axis].is_free() {
                state.given.momentum[axis] += after.momentum[axis] - before.momentum[axis];
            }
        }
        if !self.freedoms.is_free() {
            state.given.angular += after.angular - before.angular;
        }
    }

    /// Sets held and driven degrees of freedom to their values at t = 0, independent of the initial fields.
    pub(super) fn constrain_start(&self, state: &mut RigidState) {
        for (axis, freedom) in self.freedoms.translation.iter().enumerate() {
            match freedom {
                Freedom::Free => {}
                Freedom::Held => state.momentum[axis] = 0.0,
                Freedom::Driven(prescribed) => {
                    let driven = prescribed.start(state.displacement[axis]);
                    state.displacement[axis] = driven.displacement;
                    state.momentum[axis] = self.mass * driven.velocity;
                }
            }
        }
        match &self.freedoms.turning {
            Turning::Any => {}
            Turning::Held => state.spin = Vector3::zeros(),
            Turning::About(axis, freedom) => {
                if let Freedom::Driven(prescribed) = freedom {
                    let driven = prescribed.start(state.angle);
                    state.angle = driven.displacement;
                    state.spin[*axis] = self.inertia_about(*axis) * driven.velocity;
                }
                let along = state.spin[*axis];
                state.spin = Vector3::zeros();
                state.spin[*axis] = along;
                state.orientation = about(*axis, state.angle);
            }
        }
    }

    /// Displacement (m) and velocity (m/s) of a point with the reference arm `a`:
    ///
    /// ```text
    /// u = d + (R - 1) a,   v = V + omega x (R a)
    /// ```
    pub(super) fn motion_of_points<'a>(
        &self,
        state: &RigidState,
        arms: &'a [Vector3<f64>],
    ) -> impl Fn(usize) -> (Vector3<f64>, Vector3<f64>) + use<'a> {
        let (displacement, velocity) = (state.displacement, self.velocity(state));
        let (turned, spinning) = (turned_by(&state.orientation), self.angular_velocity(state));
        move |point| {
            let arm = arms[point];
            let change = turned * arm;
            (
                displacement + change,
                velocity + spinning.cross(&(arm + change)),
            )
        }
    }

    /// `2 / omega` with the highest frequency of the springs, s.
    pub(super) fn stable_step(&self) -> Option<f64> {
        let translations = self.spring.translations();
        let squares = translations.into_iter().flatten().map(|k| k / self.mass);
        let rotation = match (&self.freedoms.turning, self.spring.rotation) {
            (Turning::About(axis, _), Some(k)) => Some(k / self.inertia_about(*axis)),
            _ => None,
        };
        let largest = squares.chain(rotation).fold(0.0, f64::max);
        (largest > 0.0).then(|| 2.0 / largest.sqrt())
    }
}

impl RigidState {
    /// Rotation matrix.
    pub(super) fn rotation(&self) -> Matrix3<f64> {
        Matrix3::identity() + turned_by(&self.orientation)
    }

    /// Finds the means of force and moment since the last logged state, and starts the next interval.
    pub(super) fn observe(&mut self) {
        if self.elapsed > 0.0 {
            self.mean = Wrench {
                force: self.received.force / self.elapsed,
                moment: self.received.moment / self.elapsed,
            };
            self.received = Wrench::default();
            self.elapsed = 0.0;
        }
    }
}

/// Force of a spring or dashpot; zero without one.
fn resisted(coefficient: Option<&f64>, by: f64) -> f64 {
    coefficient.map_or(0.0, |c| c * by)
}

/// Impulse of a constant force with damping over a `time` (s); see [`RigidDynamics::half_kick`].
fn damped_impulse(momentum: f64, force: f64, rate: f64, time: f64) -> f64 {
    let decay = rate * time;
    if decay == 0.0 {
        return force * time;
    }
    let lost = -(-decay).exp_m1();
    force * time * (lost / decay) - momentum * lost
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `P' = F - r P` from P: `P(t) - P = (F / r - P) (1 - exp(-r t))`, and `F t` without a dashpot.
    #[test]
    fn a_damped_impulse_is_the_exact_solution() {
        for (momentum, force, rate, time) in [
            (3.0, 0.0, 0.5, 2.0_f64),
            (3.0, 4.0, 0.5, 2.0),
            (-1.0, 4.0, 20.0, 0.3),
            (3.0, -4.0, 1e-9, 2.0),
        ] {
            let rate: f64 = rate;
            let expected = (force / rate - momentum) * -(-rate * time).exp_m1();
            let found = damped_impulse(momentum, force, rate, time);
            assert!(
                (found - expected).abs() < 1e-12 * (1.0 + expected.abs()),
                "{found} {expected}"
            );
        }
        assert_eq!(damped_impulse(3.0, 4.0, 0.0, 2.0), 8.0);
    }

    /// A body of 2 kg and 3 kg m² that turns about one axis.
    fn on_an_axis(spring: ByDegree<f64>) -> RigidDynamics {
        let inertia = Matrix3::from_diagonal(&Vector3::new(5.0, 3.0, 4.0));
        let mut freedoms = Freedoms::new(3, &[], &ByDegree::default()).expect("free");
        freedoms.turning = Turning::About(1, Freedom::Free);
        RigidDynamics {
            mass: 2.0,
            centre: Vector3::new(1.0, 0.0, 0.0),
            inertia,
            inverse_inertia: inertia.try_inverse().expect("positive"),
            principal: PrincipalInertia::new(&inertia),
            freedoms,
            spring,
            damping: ByDegree::default(),
        }
    }

    /// `2 / omega` with `omega² = k / m`, or `k / I` of the rotation.
    #[test]
    fn the_stable_step_is_that_of_the_highest_frequency() {
        let springs = |x, rotation| ByDegree {
            x,
            rotation,
            ..ByDegree::default()
        };
        for (spring, square) in [
            (springs(None, None), None),
            (springs(Some(8.0), None), Some(4.0)),
            (springs(None, Some(48.0)), Some(16.0)),
            (springs(Some(8.0), Some(48.0)), Some(16.0)),
            (springs(Some(80.0), Some(48.0)), Some(40.0)),
        ] {
            let expected = square.map(|s: f64| 2.0 / s.sqrt());
            assert_eq!(on_an_axis(spring).stable_step(), expected);
        }
    }

    #[test]
    fn momentum_and_energy_are_those_of_translation_and_rotation() {
        let dynamics = on_an_axis(ByDegree::default());
        let state = RigidState {
            displacement: Vector3::new(0.0, 0.5, 0.0),
            momentum: Vector3::new(0.0, 6.0, 8.0),
            spin: Vector3::new(0.0, 12.0, 0.0),
            ..RigidState::default()
        };
        assert_eq!(dynamics.velocity(&state), Vector3::new(0.0, 3.0, 4.0));
        assert_eq!(
            dynamics.angular_velocity(&state),
            Vector3::new(0.0, 4.0, 0.0)
        );
        // 0.5 (2 * 25 + 3 * 16)
        assert!((dynamics.kinetic_energy(&state) - 49.0).abs() < 1e-12);
        // (1, 0.5, 0) x (0, 6, 8) + (0, 12, 0)
        let angular = dynamics.momenta(&state).angular;
        assert!(
            (angular - Vector3::new(4.0, 4.0, 6.0)).norm() < 1e-12,
            "{angular}"
        );
    }

    #[test]
    fn means_are_those_since_the_last_logged_state() {
        let force = Vector3::new(3.0, 0.0, -1.0);
        let mut state = RigidState::default();
        state.received.force = force;
        state.received.moment = 2.0 * force;
        state.elapsed = 0.5;
        state.observe();
        assert_eq!(
            (state.mean.force, state.mean.moment),
            (2.0 * force, 4.0 * force)
        );
        assert_eq!((state.received, state.elapsed), (Wrench::default(), 0.0));
        // a second state at the same time has the same mean
        state.observe();
        assert_eq!(state.mean.force, 2.0 * force);
    }
}
