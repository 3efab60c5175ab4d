//! A law of points in the stress state and kinematics of a body, behind a dynamic call.

use nalgebra::Matrix3;
use perimelt_core::SetupError;
use perimelt_core::law::{Constant, StateVariable};

use super::law::{LawPoint, Measure, PointLaw, StepStates};
use super::scratch::with_copy;
use crate::mechanical::classical::Point;
use crate::mechanical::plasticity::StressState;

/// A strain that is free of stress: lengths of the undeformed body grow by one plus it.
#[derive(Clone, Copy, Debug)]
pub struct FreeStrain {
    strain: Matrix3<f64>,
    /// Inverse of the gradient of the deformation by it.
    inverse_growth: Matrix3<f64>,
}

impl FreeStrain {
    /// The same in all directions.
    pub fn isotropic(strain: f64) -> Self {
        FreeStrain {
            strain: Matrix3::identity() * strain,
            inverse_growth: Matrix3::identity() / (1.0 + strain),
        }
    }

    /// With components.
    pub fn with_components(strain: Matrix3<f64>) -> Self {
        let growth = Matrix3::identity() + strain;
        let not_finite = Matrix3::from_element(f64::NAN);
        FreeStrain {
            strain,
            inverse_growth: growth.try_inverse().unwrap_or(not_finite),
        }
    }
}

/// A point in the stress state of its body.
#[derive(Clone, Copy, Debug)]
pub struct BodyPoint<'a> {
    /// The point as laws see it.
    pub point: LawPoint<'a>,
    /// The components that the stress of the body has; plane strain has all.
    pub stress_state: StressState,
    /// The strain that is free of stress.
    pub free: FreeStrain,
}

/// What solids need of a law of points. Gradients H are those of the displacement; P is the first stress of Piola and
/// Kirchhoff, Pa.
pub trait PointResponse: std::fmt::Debug + Send + Sync + erased_serde::Serialize {
    /// See [`PointLaw::CONSTANTS`].
    fn constants(&self) -> &'static [Constant];

    /// See [`PointLaw::state`].
    fn state(&self) -> &[StateVariable];

    /// See [`PointLaw::STRAIN`].
    fn measure(&self) -> Measure;

    /// See [`PointLaw::IS_SYMMETRIC`].
    fn is_symmetric(&self) -> bool;

    /// See [`PointLaw::HAS_DIRECTIONS`].
    fn has_directions(&self) -> bool;

    /// See [`PointLaw::prepare`].
    ///
    /// # Errors
    /// Errors of the law.
    fn prepare(&mut self) -> Result<(), SetupError>;

    /// H with the components that the stress state leaves open, at the end of a step; advances the state variables to it.
    fn evolve(
        &self,
        at: &BodyPoint<'_>,
        gradient: &Matrix3<f64>,
        state: &mut [f64],
    ) -> Matrix3<f64>;

    /// H with the components that the stress state leaves open, at a state.
    fn complete(&self, at: &BodyPoint<'_>, gradient: &Matrix3<f64>, state: &[f64]) -> Matrix3<f64>;

    /// P of a complete H.
    fn piola(&self, at: &BodyPoint<'_>, gradient: &Matrix3<f64>, state: &[f64]) -> Matrix3<f64>;

    /// Energy density of a complete H, J/m³.
    fn energy(&self, at: &BodyPoint<'_>, gradient: &Matrix3<f64>, state: &[f64]) -> f64;

    /// Change of P with a change of H at the end of a step.
    fn tangent(
        &self,
        at: &BodyPoint<'_>,
        gradient: &Matrix3<f64>,
        states: StepStates<'_>,
        change: &Matrix3<f64>,
    ) -> Matrix3<f64>;

    /// See [`PointLaw::steepest`].
    fn steepest(&self, point: &LawPoint<'_>) -> f64;
}

impl BodyPoint<'_> {
    /// The strain of a law, without the stress-free strain: the whole strain is the product of both gradients, or the sum of both
    /// strains.
    fn strain(&self, measure: Measure, gradient: &Matrix3<f64>) -> Matrix3<f64> {
        let (free, finite) = (self.free.strain, self.point.finite);
        if measure.is_gradient(finite) {
            return (Matrix3::identity() + gradient) * self.free.inverse_growth;
        }
        let strain = Point::strain(gradient, finite) - free;
        if finite {
            strain - free * free * 0.5
        } else {
            strain
        }
    }

    /// P of the stress of a law.
    fn piola(
        &self,
        measure: Measure,
        gradient: &Matrix3<f64>,
        stress: Matrix3<f64>,
    ) -> Matrix3<f64> {
        match (measure.is_gradient(self.point.finite), self.point.finite) {
            (true, _) => stress * self.free.inverse_growth,
            (false, true) => stress + gradient * stress,
            (false, false) => stress,
        }
    }

    /// The first axis across the stress state.
    fn across(&self) -> Option<usize> {
        match self.stress_state {
            StressState::Full => None,
            StressState::Plane => Some(2),
            StressState::Uniaxial => Some(1),
        }
    }

    /// H with the components across that make `stress` (P along the first axis across) zero, by Newton's method with
    /// differences.
    fn complete(
        &self,
        gradient: &Matrix3<f64>,
        stress: impl Fn(&Matrix3<f64>) -> f64,
    ) -> Matrix3<f64> {
        /// Step of the differences.
        const STEP: f64 = 1e-6;
        /// Newton's method converges in a few.
        const ITERATIONS: usize = 50;
        let Some(axis) = self.across() else {
            return *gradient;
        };
        let with = |across: f64| {
            let mut gradient = *gradient;
            (axis..3).for_each(|a| gradient[(a, a)] = across);
            gradient
        };
        let mut across = 0.0;
        for _ in 0..ITERATIONS {
            let [low, here, high] = [-STEP, 0.0, STEP].map(|step| stress(&with(across + step)));
            let step = -here * 2.0 * STEP / (high - low);
            // not beyond a point that is turned inside out
            let next = (across + step).max(0.5 * (across - 1.0));
            let is_found = !((next - across).abs() > 1e-14);
            across = next;
            if is_found {
                break;
            }
        }
        with(across)
    }
}

impl<L: PointLaw> PointResponse for L {
    fn constants(&self) -> &'static [Constant] {
        L::CONSTANTS
    }

    fn state(&self) -> &[StateVariable] {
        PointLaw::state(self)
    }

    fn measure(&self) -> Measure {
        L::STRAIN
    }

    fn is_symmetric(&self) -> bool {
        L::IS_SYMMETRIC
    }

    fn has_directions(&self) -> bool {
        L::HAS_DIRECTIONS
    }

    fn prepare(&mut self) -> Result<(), SetupError> {
        PointLaw::prepare(self)
    }

    fn evolve(
        &self,
        at: &BodyPoint<'_>,
        gradient: &Matrix3<f64>,
        state: &mut [f64],
    ) -> Matrix3<f64> {
        let start = &*state;
        let gradient = at.complete(gradient, |gradient| {
            with_copy(start, |end| {
                PointLaw::evolve(self, &at.point, &at.strain(L::STRAIN, gradient), end);
                let axis = at.across().unwrap_or(0);
                PointResponse::piola(self, at, gradient, end)[(axis, axis)]
            })
        });
        PointLaw::evolve(self, &at.point, &at.strain(L::STRAIN, &gradient), state);
        gradient
    }

    fn complete(&self, at: &BodyPoint<'_>, gradient: &Matrix3<f64>, state: &[f64]) -> Matrix3<f64> {
        let axis = at.across().unwrap_or(0);
        at.complete(gradient, |gradient| {
            PointResponse::piola(self, at, gradient, state)[(axis, axis)]
        })
    }

    fn piola(&self, at: &BodyPoint<'_>, gradient: &Matrix3<f64>, state: &[f64]) -> Matrix3<f64> {
        let stress = self.stress(&at.point, &at.strain(L::STRAIN, gradient), state);
        at.piola(L::STRAIN, gradient, stress)
    }

    fn energy(&self, at: &BodyPoint<'_>, gradient: &Matrix3<f64>, state: &[f64]) -> f64 {
        PointLaw::energy(self, &at.point, &at.strain(L::STRAIN, gradient), state)
    }

    fn tangent(
        &self,
        at: &BodyPoint<'_>,
        gradient: &Matrix3<f64>,
        states: StepStates<'_>,
        change: &Matrix3<f64>,
    ) -> Matrix3<f64> {
        if let (true, None) = (L::HAS_TANGENT, at.across())
            && let Some(tangent) = closed_tangent(self, at, gradient, states, change)
        {
            return tangent;
        }
        /// Size of the differences of gradients.
        const STEP: f64 = 1e-6;
        let size = change.norm();
        if size == 0.0 {
            return Matrix3::zeros();
        }
        let step = STEP / size;
        let [up, down] = [step, -step].map(|factor| {
            with_copy(states.start, |state| {
                let gradient = gradient + change * factor;
                let gradient = PointResponse::evolve(self, at, &gradient, state);
                PointResponse::piola(self, at, &gradient, state)
            })
        });
        (up - down) / (2.0 * step)
    }

    fn steepest(&self, point: &LawPoint<'_>) -> f64 {
        PointLaw::steepest(self, point)
    }
}

/// The change of P by the closed form of a law.
fn closed_tangent<L: PointLaw>(
    law: &L,
    at: &BodyPoint<'_>,
    gradient: &Matrix3<f64>,
    states: StepStates<'_>,
    change: &Matrix3<f64>,
) -> Option<Matrix3<f64>> {
    let (strain, finite) = (at.strain(L::STRAIN, gradient), at.point.finite);
    let is_gradient = L::STRAIN.is_gradient(finite);
    let rate = match (is_gradient, finite) {
        (true, _) => change * at.free.inverse_growth,
        (false, true) => {
            let turned = (Matrix3::identity() + gradient).transpose() * change;
            0.5 * (turned + turned.transpose())
        }
        (false, false) => 0.5 * (change + change.transpose()),
    };
    let tangent = law.tangent(&at.point, &strain, states, &rate)?;
    let along = at.piola(L::STRAIN, gradient, tangent);
    Some(match !is_gradient && finite {
        true => along + change * law.stress(&at.point, &strain, states.end),
        false => along,
    })
}
