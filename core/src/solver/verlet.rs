//! Explicit motion `M u'' = F(t, u) - c M u'` with lumped mass by velocity Verlet.
//!
//! Stable for `dt < 2 / omega_max` and symplectic without damping: the energy error stays bounded over any
//! number of steps. Momentum is kept to rounding if the forces add up to zero.

use super::error::{SolverError, positive, same_length};
use super::vector::{update, update_both};
use serde::{Deserialize, Serialize};

/// The moving state, all vectors of one length: components of all points, in any order.
#[derive(Debug)]
pub struct VerletState<'a> {
    /// Displacement (m).
    pub displacement: &'a mut [f64],
    /// Velocity (m/s).
    pub velocity: &'a mut [f64],
    /// Force (N) (or its density) at the end of the last step, where the stepper knows it; then that at the end of this one.
    pub force: &'a mut [f64],
    /// `1 / m` (1/kg) (or 1/density, with force densities). Zero for components that keep
    /// their velocity whatever the force: held or driven points.
    pub inverse_mass: &'a [f64],
}

impl VerletState<'_> {
    fn check(&self, dt: f64) -> Result<(), SolverError> {
        positive("the time step [s]", dt)?;
        let n = self.displacement.len();
        same_length("the velocity", n, self.velocity.len())?;
        same_length("the force", n, self.force.len())?;
        same_length("the inverse mass", n, self.inverse_mass.len())
    }
}

/// The forces of a motion.
///
/// A closure `|time, displacement, force| { ...; Ok(()) }` implements it.
pub trait Dynamics {
    /// Writes `F(time, displacement)` into `out`.
    ///
    /// # Errors
    /// Errors of the model; wrap them with [`SolverError::model`].
    fn force(
        &mut self,
        time: f64,
        displacement: &[f64],
        out: &mut [f64],
    ) -> Result<(), SolverError>;

    /// Called before each of the two half kicks of a step, such as to sum impulses at the positions where
    /// they act.
    fn before_half_kick(&mut self, _kick: &HalfKick<'_>) {}
}

impl<F> Dynamics for F
where
    F: FnMut(f64, &[f64], &mut [f64]) -> Result<(), SolverError>,
{
    fn force(
        &mut self,
        time: f64,
        displacement: &[f64],
        out: &mut [f64],
    ) -> Result<(), SolverError> {
        self(time, displacement, out)
    }
}

/// One of the two changes of the velocity in a step: `m (v' - v) = duration F - friction m (v + v')`.
#[derive(Clone, Copy, Debug)]
pub struct HalfKick<'a> {
    /// Displacement at which the force acts (m).
    pub displacement: &'a [f64],
    /// Velocity before (m/s).
    pub velocity: &'a [f64],
    /// Force (N) (or its density).
    pub force: &'a [f64],
    /// Half the time step (s).
    pub duration: f64,
    /// `c dt/4` of the damping rate c (-).
    pub friction: f64,
}

impl HalfKick<'_> {
    /// The velocity afterwards (m/s) from velocity, force, and inverse mass. Components without inverse mass
    /// keep their velocity and are not damped.
    pub fn rule(&self) -> impl Fn(f64, f64, f64) -> f64 + Copy + Sync + use<> {
        let friction = self.friction;
        let (kept, gain) = (
            (1.0 - friction) / (1.0 + friction),
            self.duration / (1.0 + friction),
        );
        move |velocity, force, inverse_mass| {
            if inverse_mass == 0.0 {
                velocity
            } else {
                kept * velocity + gain * force * inverse_mass
            }
        }
    }
}

/// Velocity Verlet, second order:
///
/// ```text
/// v_half = ((1 - c dt/4) v + dt/2 F(t, u)/m) / (1 + c dt/4)
/// u_new  = u + dt v_half
/// v_new  = ((1 - c dt/4) v_half + dt/2 F(t + dt, u_new)/m) / (1 + c dt/4)
/// ```
///
/// One force per step: the force at the end serves the next step, and is part of the state as the velocity is. After a load jumped or
/// the displacement was changed from outside, call [`Verlet::forget_force`].
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct Verlet {
    /// Mass-proportional damping rate `c` (1/s); 0 for none. Stable for any value.
    pub damping: f64,
    knows_force: bool,
}

impl Verlet {
    /// A stepper with the given mass-proportional damping rate (1/s), not negative.
    pub fn new(damping: f64) -> Self {
        Self {
            damping,
            knows_force: false,
        }
    }

    /// Whether [`VerletState::force`] is that at the start of the next step; otherwise that step evaluates it.
    pub fn knows_force(&self) -> bool {
        self.knows_force
    }

    /// Makes the next step evaluate the force at its start.
    pub fn forget_force(&mut self) {
        self.knows_force = false;
    }

    /// Evaluates the force at `time` (s), the start of the next step.
    ///
    /// # Errors
    /// Those of the force.
    pub fn find_force(
        &mut self,
        time: f64,
        motion: &mut VerletState<'_>,
        dynamics: &mut impl Dynamics,
    ) -> Result<(), SolverError> {
        dynamics.force(time, motion.displacement, motion.force)?;
        self.knows_force = true;
        Ok(())
    }

    /// Advances the motion from `time` by `dt` (s).
    ///
    /// # Errors
    /// A step that is not positive, vectors of different lengths, and errors of the force.
    pub fn step(
        &mut self,
        time: f64,
        dt: f64,
        mut motion: VerletState,
        mut dynamics: impl Dynamics,
    ) -> Result<(), SolverError> {
        motion.check(dt)?;
        if !self.knows_force {
            self.find_force(time, &mut motion, &mut dynamics)?;
        }
        let VerletState {
            displacement,
            velocity,
            force,
            inverse_mass,
        } = motion;
        let kick = HalfKick {
            displacement,
            velocity,
            force,
            duration: 0.5 * dt,
            friction: 0.25 * self.damping * dt,
        };
        dynamics.before_half_kick(&kick);
        let kicked = kick.rule();
        update_both(
            [velocity, displacement],
            [&*force, inverse_mass],
            |[v, u], [force, inverse_mass]| {
                let v = kicked(v, force, inverse_mass);
                [v, u + dt * v]
            },
        );
        if let Err(error) = dynamics.force(time + dt, displacement, force) {
            self.forget_force();
            return Err(error);
        }
        dynamics.before_half_kick(&HalfKick {
            displacement,
            velocity,
            force,
            duration: 0.5 * dt,
            friction: 0.25 * self.damping * dt,
        });
        update(
            velocity,
            [&*force, inverse_mass],
            |v, [force, inverse_mass]| kicked(v, force, inverse_mass),
        );
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `F = -4 u` on mass 1: angular frequency 2.
    fn spring(_: f64, u: &[f64], force: &mut [f64]) -> Result<(), SolverError> {
        force[0] = -4.0 * u[0];
        Ok(())
    }

    fn swing(damping: f64, steps: usize, end: f64) -> (f64, f64, f64) {
        let (mut u, mut v, mut f) = ([1.0], [0.0], [0.0]);
        let mut verlet = Verlet::new(damping);
        let dt = end / steps as f64;
        let mut energy_drift = 0f64;
        for n in 0..steps {
            let motion = VerletState {
                displacement: &mut u,
                velocity: &mut v,
                force: &mut f,
                inverse_mass: &[1.0],
            };
            verlet.step(n as f64 * dt, dt, motion, spring).unwrap();
            energy_drift = energy_drift.max((0.5 * v[0] * v[0] + 2.0 * u[0] * u[0] - 2.0).abs());
        }
        (u[0], v[0], energy_drift)
    }

    #[test]
    fn verlet_is_of_second_order_with_and_without_damping() {
        for c in [0.0, 0.5] {
            let omega = (4.0f64 - 0.25 * c * c).sqrt();
            let exact = (-0.5 * c).exp() * (omega.cos() + 0.5 * c / omega * omega.sin());
            let order = ((swing(c, 50, 1.0).0 - exact) / (swing(c, 100, 1.0).0 - exact)).log2();
            // the next term of the error is dt^2 relative to the first
            assert!((order - 2.0).abs() < 0.01, "damping {c}: {order}");
        }
    }

    #[test]
    fn forces_that_depend_on_time_are_those_of_the_end_of_a_step() {
        let error = |steps: usize| {
            let (mut u, mut v, mut f) = ([0.0], [0.0], [0.0]);
            let mut verlet = Verlet::new(0.0);
            let dt = 1.0 / steps as f64;
            for n in 0..steps {
                let motion = VerletState {
                    displacement: &mut u,
                    velocity: &mut v,
                    force: &mut f,
                    inverse_mass: &[1.0],
                };
                let force = |time: f64, _: &[f64], f: &mut [f64]| {
                    f[0] = time.cos();
                    Ok(())
                };
                verlet.step(n as f64 * dt, dt, motion, force).unwrap();
            }
            u[0] - (1.0 - 1.0f64.cos())
        };
        let order = (error(50) / error(100)).log2();
        assert!((order - 2.0).abs() < 0.01, "{order}");
    }

    #[test]
    fn the_energy_of_verlet_does_not_drift() {
        // the error oscillates with amplitude E (omega dt)^2 / 4 = 0.005, over 10 swings as over 10,000
        for swings in [10, 10_000] {
            let drift = swing(0.0, swings * 31, swings as f64 * 31.0 * 0.05).2;
            assert!((0.004..0.0055).contains(&drift), "{swings} swings: {drift}");
        }
    }

    #[test]
    fn a_component_of_no_inverse_mass_keeps_its_velocity() {
        let (mut u, mut v, mut f) = ([0.0, 1.0], [3.0, 0.0], [0.0; 2]);
        let mut verlet = Verlet::new(0.7);
        for n in 0..10 {
            let motion = VerletState {
                displacement: &mut u,
                velocity: &mut v,
                force: &mut f,
                inverse_mass: &[0.0, 1.0],
            };
            verlet
                .step(n as f64, 0.1, motion, |_, u: &[f64], f: &mut [f64]| {
                    f[0] = u[1] - u[0];
                    f[1] = u[0] - u[1];
                    Ok(())
                })
                .unwrap();
        }
        assert_eq!(v[0], 3.0);
        assert!((u[0] - 3.0).abs() < 1e-14, "ten roundings");
    }

    #[test]
    fn a_run_resumed_from_saved_state_goes_on_with_the_same_bits() {
        let run = |split: bool| {
            let (mut u, mut v, mut f) = ([1.0], [0.3], [0.0]);
            let mut verlet = Verlet::new(0.1);
            for n in 0..20 {
                if split && n == 7 {
                    let saved = serde_json::to_string(&verlet).unwrap();
                    verlet = serde_json::from_str(&saved).unwrap();
                }
                let motion = VerletState {
                    displacement: &mut u,
                    velocity: &mut v,
                    force: &mut f,
                    inverse_mass: &[1.0],
                };
                verlet.step(n as f64 * 0.1, 0.1, motion, spring).unwrap();
            }
            (u[0].to_bits(), v[0].to_bits())
        };
        assert_eq!(run(false), run(true));
    }
}
