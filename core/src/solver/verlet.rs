//! Explicit motion `M u'' = F(t, u) - c M u'` with lumped mass: velocity Verlet and symplectic Euler.
//!
//! Both are stable for `dt < 2 / omega_max` and symplectic without damping: the energy
//! error stays bounded over any number of steps. Momentum is kept to rounding if the forces
//! add up to zero.

use super::error::{SolverError, positive, same_length};
use super::vector::{update, update_both};
use serde::{Deserialize, Serialize};

/// The moving state, all vectors of one length: components of all points, in any order.
#[derive(Debug)]
pub struct Motion<'a> {
    /// Displacement (m).
    pub displacement: &'a mut [f64],
    /// Velocity (m/s).
    pub velocity: &'a mut [f64],
    /// `1 / m` (1/kg) (or 1/density, with force densities). Zero for components that keep
    /// their velocity whatever the force: held or driven points.
    pub inverse_mass: &'a [f64],
}

impl Motion<'_> {
    fn check(&self, dt: f64) -> Result<usize, SolverError> {
        positive("the time step [s]", dt)?;
        let n = self.displacement.len();
        same_length("the velocity", n, self.velocity.len())?;
        same_length("the inverse mass", n, self.inverse_mass.len())?;
        Ok(n)
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
/// One force per step: that at the end serves the next step. It is part of the state: it
/// goes into a checkpoint with `serde`, and [`Verlet::forget_force`] is for a load that jumps
/// or a displacement that was changed from outside.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct Verlet {
    /// Mass-proportional damping rate `c` (1/s); 0 for none. Stable for any value.
    pub damping: f64,
    force: Vec<f64>,
}

impl Verlet {
    /// A stepper with the given mass-proportional damping rate (1/s), not negative.
    pub fn new(damping: f64) -> Self {
        Self {
            damping,
            force: Vec::new(),
        }
    }

    /// Makes the next step evaluate the force at its start.
    pub fn forget_force(&mut self) {
        self.force.clear();
    }

    /// Advances the motion from `time` by `dt` (s); `force(t, u, out)` writes `F(t, u)` into `out`.
    ///
    /// # Errors
    /// A step that is not positive, vectors of different lengths, and errors of `force`.
    pub fn step(
        &mut self,
        time: f64,
        dt: f64,
        motion: Motion,
        mut force: impl FnMut(f64, &[f64], &mut [f64]) -> Result<(), SolverError>,
    ) -> Result<(), SolverError> {
        let n = motion.check(dt)?;
        let Motion {
            displacement,
            velocity,
            inverse_mass,
        } = motion;
        if self.force.len() != n {
            let mut first = vec![0.0; n];
            force(time, displacement, &mut first)?;
            self.force = first;
        }
        let loss = 0.25 * self.damping * dt;
        let (kept, gain) = ((1.0 - loss) / (1.0 + loss), 0.5 * dt / (1.0 + loss));
        let kicked = |v: f64, force: f64, inverse_mass: f64| {
            // held and driven components are not damped either
            if inverse_mass == 0.0 {
                v
            } else {
                kept * v + gain * force * inverse_mass
            }
        };
        update_both(
            [velocity, displacement],
            [&self.force, inverse_mass],
            |[v, u], [force, inverse_mass]| {
                let v = kicked(v, force, inverse_mass);
                [v, u + dt * v]
            },
        );
        if let Err(error) = force(time + dt, displacement, &mut self.force) {
            self.forget_force();
            return Err(error);
        }
        update(
            velocity,
            [&self.force, inverse_mass],
            |v, [force, inverse_mass]| kicked(v, force, inverse_mass),
        );
        Ok(())
    }
}

/// Symplectic Euler, `v_new = v + dt F(t, u)/m`, `u_new = u + dt v_new`: first order with the
/// velocity read at whole steps, second order (leapfrog) with it read half a step earlier.
///
/// Wang (2025), eqs. 4.10 and 4.11; corrected, see spec 01, section 1.7.
#[derive(Debug, Clone, Default)]
pub struct SymplecticEuler {
    force: Vec<f64>,
}

impl SymplecticEuler {
    /// Advances the motion from `time` by `dt` (s); `force(t, u, out)` writes `F(t, u)` into `out`.
    ///
    /// # Errors
    /// A step that is not positive, vectors of different lengths, and errors of `force`.
    pub fn step(
        &mut self,
        time: f64,
        dt: f64,
        motion: Motion,
        mut force: impl FnMut(f64, &[f64], &mut [f64]) -> Result<(), SolverError>,
    ) -> Result<(), SolverError> {
        self.force.resize(motion.check(dt)?, 0.0);
        let Motion {
            displacement,
            velocity,
            inverse_mass,
        } = motion;
        force(time, displacement, &mut self.force)?;
        update(
            velocity,
            [&self.force, inverse_mass],
            |v, [force, inverse_mass]| v + dt * force * inverse_mass,
        );
        update(displacement, [velocity], |u, [v]| u + dt * v);
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
        let (mut u, mut v) = ([1.0], [0.0]);
        let mut verlet = Verlet::new(damping);
        let dt = end / steps as f64;
        let mut energy_drift = 0f64;
        for n in 0..steps {
            let motion = Motion {
                displacement: &mut u,
                velocity: &mut v,
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
    fn the_energy_of_verlet_does_not_drift() {
        // the error oscillates with amplitude E (omega dt)^2 / 4 = 0.005, over 10 swings as over 10,000
        for swings in [10, 10_000] {
            let drift = swing(0.0, swings * 31, swings as f64 * 31.0 * 0.05).2;
            assert!((0.004..0.0055).contains(&drift), "{swings} swings: {drift}");
        }
    }

    #[test]
    fn symplectic_euler_conserves_its_shadow_energy() {
        let (mut u, mut v, dt) = ([1.0], [0.0], 0.05);
        let mut euler = SymplecticEuler::default();
        // v^2/2 + w^2 u^2/2 - dt w^2 u v/2 is exactly conserved for a linear spring
        let shadow = |u: f64, v: f64| 0.5 * v * v + 2.0 * u * u - 2.0 * dt * u * v;
        for n in 0..100_000 {
            let motion = Motion {
                displacement: &mut u,
                velocity: &mut v,
                inverse_mass: &[1.0],
            };
            euler.step(n as f64 * dt, dt, motion, spring).unwrap();
        }
        // 1e5 roundings at random
        assert!((shadow(u[0], v[0]) - 2.0).abs() < 1e-12);
    }

    #[test]
    fn a_component_of_no_inverse_mass_keeps_its_velocity() {
        let (mut u, mut v) = ([0.0, 1.0], [3.0, 0.0]);
        let mut verlet = Verlet::new(0.7);
        for n in 0..10 {
            let motion = Motion {
                displacement: &mut u,
                velocity: &mut v,
                inverse_mass: &[0.0, 1.0],
            };
            verlet
                .step(n as f64, 0.1, motion, |_, u, f| {
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
            let (mut u, mut v) = ([1.0], [0.3]);
            let mut verlet = Verlet::new(0.1);
            for n in 0..20 {
                if split && n == 7 {
                    let saved = serde_json::to_string(&verlet).unwrap();
                    verlet = serde_json::from_str(&saved).unwrap();
                }
                let motion = Motion {
                    displacement: &mut u,
                    velocity: &mut v,
                    inverse_mass: &[1.0],
                };
                verlet.step(n as f64 * 0.1, 0.1, motion, spring).unwrap();
            }
            (u[0].to_bits(), v[0].to_bits())
        };
        assert_eq!(run(false), run(true));
    }
}
