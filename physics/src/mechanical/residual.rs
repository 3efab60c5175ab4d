//! Unbalanced force of a body, for Newton's method.

use perimelt_core::family::LayerRule;
use perimelt_core::solver::{At, Reducer, Rhs, SolverError};

use super::solid::{Solid, Stiffness, Wanted};

/// Unbalanced force of a displacement; zero for held components.
pub(super) struct Residual<'a> {
    pub(super) solid: &'a mut dyn Solid,
    pub(super) rules: &'a [LayerRule],
    /// The rules with prescribed values of zero, for differences of displacements.
    pub(super) homogeneous: Vec<LayerRule>,
    pub(super) body_force: &'a [f64],
    /// Relative volumes of the components, if they differ: forces are densities.
    pub(super) volumes: Option<&'a [f64]>,
    pub(super) constraint: &'a [f64],
    /// Whether each point has material; empty for a body that does not grow.
    pub(super) present: &'a [bool],
    /// The points to which the displacements belong.
    pub(super) points: Reducer,
    pub(super) dimension: usize,
    pub(super) tangent: Tangent,
}

/// How the residual changes with the displacement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Tangent {
    /// By the elastic stiffness.
    Stiffness,
    /// By the stiffness of the linearised state.
    Linearised,
    /// By differences of forces.
    Differences,
}

impl Residual<'_> {
    /// Sets held components and those that the dimension leaves out.
    fn set_held(&self, out: &mut [f64], value: f64) {
        for (i, (f, c)) in out.iter_mut().zip(self.constraint).enumerate() {
            if *c > 0.0 || i % 3 >= self.dimension {
                *f = value;
            }
        }
    }

    /// Change of the unbalanced force along a direction, by one of the stiffnesses of the solid.
    fn rate_of_change(&mut self, direction: &[f64], kind: Stiffness, out: &mut [f64]) {
        self.solid.set_displacement(direction, &self.homogeneous);
        self.solid.stiffness(kind, out);
        out.iter_mut().for_each(|f| *f = -*f);
        self.set_held(out, 0.0);
    }
}

impl Rhs for Residual<'_> {
    fn rate(&mut self, _: f64, state: &[f64], rate: &mut [f64]) -> Result<(), SolverError> {
        self.solid.set_displacement(state, self.rules);
        self.solid.evaluate(Wanted::force(rate));
        rate.iter_mut()
            .zip(self.body_force)
            .for_each(|(f, b)| *f += b);
        self.set_held(rate, 0.0);
        Ok(())
    }

    fn tangent(
        &mut self,
        _: At<'_>,
        direction: &[f64],
        out: &mut [f64],
    ) -> Result<bool, SolverError> {
        match self.tangent {
            Tangent::Differences => return Ok(false),
            Tangent::Stiffness => self.rate_of_change(direction, Stiffness::Elastic, out),
            Tangent::Linearised => self.rate_of_change(direction, Stiffness::Tangent, out),
        }
        Ok(true)
    }

    /// The norm of displacements of a horizon each, so that the tangent by differences does not depend on the size
    /// of the body.
    fn scale(&self) -> f64 {
        let components = self.points.sum_of([self.constraint], |_| 1.0);
        self.points.max(self.solid.base().largest_horizon()) * components.sqrt()
    }

    fn weights(&self) -> Option<&[f64]> {
        self.volumes
    }

    fn points(&self) -> Reducer {
        self.points.clone()
    }

    fn is_force(&self) -> bool {
        true
    }

    /// Called once in each iteration, right after the rate of its state.
    fn tangent_diagonal(&mut self, at: At<'_>, out: &mut [f64]) -> Result<bool, SolverError> {
        if self.tangent == Tangent::Linearised {
            self.solid.linearise(at.damping);
        }
        for (out, block) in out.chunks_exact_mut(3).zip(self.solid.blocks()) {
            (0..3).for_each(|axis| out[axis] = -block[axis]);
        }
        self.set_held(out, -1.0);
        if self.solid.fracture_state().is_some() {
            // a point without unbroken bonds does not move
            let lost = |point| self.solid.has_lost_bonds(point);
            let zeros = out.iter_mut().enumerate().filter(|(_, d)| **d == 0.0);
            zeros
                .filter(|(i, _)| lost(i / 3))
                .for_each(|(_, d)| *d = -1.0);
        }
        if !self.present.is_empty() {
            // nor does a point whose neighbours have no material yet
            let zeros = out.iter_mut().filter(|d| **d == 0.0);
            zeros.for_each(|d| *d = -1.0);
        }
        match self.points.own(out).iter().position(|&d| d == 0.0) {
            Some(component) => Err(SolverError::model(UnresistedPoint {
                point: component / 3,
                axis: ["x", "y", "z"][component % 3],
            })),
            None => Ok(true),
        }
    }
}

/// Unbalanced force of the same body with small displacements: linear in the displacement, exact to first order.
pub(super) struct Linearised<'r, 'a> {
    residual: &'r mut Residual<'a>,
    /// Forces without displacement.
    loads: Vec<f64>,
}

impl<'r, 'a> Linearised<'r, 'a> {
    pub(super) fn new(residual: &'r mut Residual<'a>) -> Self {
        let mut loads = vec![0.0; residual.constraint.len()];
        let Residual {
            solid, homogeneous, ..
        } = &mut *residual;
        solid.set_displacement(&loads, homogeneous);
        solid.evaluate(Wanted::force(&mut loads));
        for (load, force) in loads.iter_mut().zip(residual.body_force) {
            *load += force;
        }
        Linearised { residual, loads }
    }
}

impl Rhs for Linearised<'_, '_> {
    fn rate(&mut self, _: f64, state: &[f64], rate: &mut [f64]) -> Result<(), SolverError> {
        let Residual { solid, rules, .. } = &mut *self.residual;
        solid.set_displacement(state, rules);
        solid.stiffness(Stiffness::Elastic, rate);
        let loads = rate.iter_mut().zip(&self.loads);
        loads.for_each(|(force, load)| *force = load - *force);
        self.residual.set_held(rate, 0.0);
        Ok(())
    }

    fn tangent(
        &mut self,
        _: At<'_>,
        direction: &[f64],
        out: &mut [f64],
    ) -> Result<bool, SolverError> {
        self.residual
            .rate_of_change(direction, Stiffness::Elastic, out);
        Ok(true)
    }

    fn weights(&self) -> Option<&[f64]> {
        self.residual.weights()
    }

    fn points(&self) -> Reducer {
        self.residual.points()
    }

    fn tangent_diagonal(&mut self, at: At<'_>, out: &mut [f64]) -> Result<bool, SolverError> {
        self.residual.tangent_diagonal(at, out)
    }
}

/// A point that can move along an axis without stretching a bond.
#[derive(Debug, thiserror::Error)]
#[error(
    "no bond of point {point} resists motion along {axis}: the body needs two points or more along {axis}, or that direction held"
)]
struct UnresistedPoint {
    point: usize,
    axis: &'static str,
}
