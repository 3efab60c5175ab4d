//! The ordinary state-based form: the heat flow of a bond depends on all bonds of its two ends.
//!
//! The potential of a point is a function of its mean temperature gradient `g` and of the deviations of its bonds:
//!
//! ```text
//! Z_i = 1/2 ( k g.g + s k ( sum_j c_ij tau_ij^2 - g.M g ) )      tau_ij = T_j - T_i,  c_ij = w_ij / |xi|
//! g   = M^-1 sum_j c_ij tau_ij xi,    M = sum_j c_ij xi xi
//! ```
//!
//! with the weights `w` of the bonds. By the general form of the equation of heat flow, the heat flow
//! (Wang (2025), eqs. 6.5 to 6.7; docs/theory/heat_conduction.md, "Ordinary form") is
//!
//! ```text
//! dh_i/dt = sum_j c_ij ( xi.p_i + s k_i tau_ij ) + c_ji ( xi.p_j + s k_j tau_ij ),    p = k (M^-1 - s) g
//! ```
//!
//! Pairs of points exchange heat as in the form of bonds, to rounding. A family of any shape conducts with the conductivity of its
//! material in all directions (`M` takes the place of corrections), also beside a crack. `s` is the stabilisation: with 1, and
//! where `M` is the unit tensor, as in a calibrated complete family, the form is that of bonds; with 0, temperatures that
//! alternate from point to point do not decay.
//!
//! A conductivity with directions, the tensor K, has `g.K g` in place of `k g.g`, and `p = M^-1 K g - s k g` with the mean k of its
//! principal values.

use nalgebra::{Matrix3, Vector3};
use perimelt_core::family::{ByRules, LayerRule};
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::solver::Reducer;
use perimelt_core::{Body, Bond, BondKernel, BrokenBonds, Family, SlotField};
use rayon::prelude::*;

use super::conduction::Matter;
use super::conductivity::Directions;

/// Families whose moment along an axis is below this fraction of a complete one keep the form of bonds.
const LEAST_MOMENT: f64 = 0.2;

/// Moments and gradients of all points.
#[derive(Debug)]
pub(super) struct OrdinaryState {
    dimension: usize,
    periodic: [bool; 3],
    stabilisation: f64,
    /// `M^-1` of each point, `None` for poor families, which keep the form of bonds; empty until found.
    inverse: Vec<Option<Matrix3<f64>>>,
    moment: Vec<[f64; 6]>,
    gradient: Vec<[f64; 3]>,
    /// `p` of each point, W/m².
    state: Vec<[f64; 3]>,
    slots: [SlotField; 3],
    /// Number of broken bonds with which the moments were found.
    broken: usize,
}

/// `M`: xx, yy, zz, xy, xz, yz.
struct Moment;

impl BondKernel<0, 6> for Moment {
    #[inline(always)]
    fn bond(&self, bond: &Bond, _: [f64; 0], _: [f64; 0]) -> [f64; 6] {
        let ([x, y, z], c) = (bond.xi, bond.weight * bond.inverse_length);
        [x * x, y * y, z * z, x * y, x * z, y * z].map(|product| c * product)
    }
}

/// `sum_j c_ij tau_ij xi`.
struct Slope;

impl BondKernel<1, 3> for Slope {
    #[inline(always)]
    fn bond(&self, bond: &Bond, [own]: [f64; 1], [other]: [f64; 1]) -> [f64; 3] {
        let c = bond.weight * bond.inverse_length * (other - own);
        bond.xi.map(|x| c * x)
    }
}

/// The heat flow from temperature, the three components of `p`, and conductivity of the ends.
pub(super) struct StateFlow {
    stabilisation: f64,
}

impl BondKernel<5, 1> for StateFlow {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; 5], other: [f64; 5]) -> [f64; 1] {
        let [x, y, z] = bond.xi;
        let along = |p: &[f64; 5]| x * p[1] + y * p[2] + z * p[3];
        let tau = self.stabilisation * (other[0] - own[0]);
        let of_own = bond.weight * (along(&own) + own[4] * tau);
        let of_other = bond.dual * (along(&other) + other[4] * tau);
        [bond.inverse_length * (of_own + of_other)]
    }
}

/// Conductivity of points.
#[derive(Clone, Copy)]
pub(super) struct PointConductivity<'a> {
    /// Mean over the directions, W/(m K).
    pub(super) mean: &'a [f64],
    /// Where it has directions.
    pub(super) directions: Option<&'a Directions>,
}

/// `M^-1 - s`.
fn excess(inverse: &Matrix3<f64>, s: f64) -> Matrix3<f64> {
    inverse - Matrix3::identity() * s
}

impl OrdinaryState {
    pub(super) fn new(body: &Body, stabilisation: f64) -> OrdinaryState {
        let points = body.points.len();
        OrdinaryState {
            dimension: body.dimension,
            periodic: body.periodic,
            stabilisation,
            inverse: Vec::new(),
            moment: vec![[0.0; 6]; points],
            gradient: vec![[0.0; 3]; points],
            state: vec![[0.0; 3]; points],
            slots: Default::default(),
            broken: 0,
        }
    }

    /// Finds `M^-1` when bonds have broken since the last time.
    fn find_moments(&mut self, family: &Family, broken: Option<&BrokenBonds>) {
        let number = broken.map_or(0, BrokenBonds::total);
        if !self.inverse.is_empty() && number == self.broken {
            return;
        }
        self.broken = number;
        family.sum_unbroken(&Moment, [], broken, &mut self.moment);
        let dimension = self.dimension;
        let inverse = self.moment.par_iter().map(|[xx, yy, zz, xy, xz, yz]| {
            let mut moment = Matrix3::new(*xx, *xy, *xz, *xy, *yy, *yz, *xz, *yz, *zz);
            (dimension..3).for_each(|axis| moment[(axis, axis)] = 1.0);
            let least = moment.symmetric_eigenvalues().min();
            moment.try_inverse().filter(|_| least > LEAST_MOMENT)
        });
        inverse.fill(&mut self.inverse);
    }

    /// Largest ratio of the potential of a point to the potential of its bonds, by which the stable step is divided.
    pub(super) fn stiffness(
        &mut self,
        family: &Family,
        broken: Option<&BrokenBonds>,
        points: &Reducer,
    ) -> f64 {
        self.find_moments(family, broken);
        let s = self.stabilisation;
        let of = |inverse: &Option<Matrix3<f64>>| match inverse {
            Some(inverse) => s + excess(inverse, s).symmetric_eigenvalues().max().max(0.0),
            None => s,
        };
        let own = self.inverse[..points.owned()].par_iter();
        points.max(own.map(of).reduce(|| s, f64::max))
    }

    /// Finds `p` from temperatures by slot (K) and conductivities of the points.
    pub(super) fn load(
        &mut self,
        matter: &Matter<'_>,
        temperature: &[f64],
        conductivity: PointConductivity<'_>,
        broken: Option<&BrokenBonds>,
    ) {
        let family = matter.family;
        self.find_moments(family, broken);
        family.sum_unbroken(&Slope, [temperature], broken, &mut self.gradient);
        let points = self.state.par_iter_mut().zip(&self.gradient);
        let points = points.zip(&self.inverse).zip(conductivity.mean);
        let s = self.stabilisation;
        points
            .enumerate()
            .for_all(|(i, (((state, slope), inverse), k))| {
                let Some(inverse) = inverse else {
                    *state = [0.0; 3];
                    return;
                };
                // the gradient is M^-1 times the slope
                let gradient = inverse * Vector3::from(*slope);
                let found = match conductivity.directions {
                    None => *k * (excess(inverse, s) * gradient),
                    Some(directions) => {
                        let flux = directions.times(i, gradient);
                        inverse * flux - s * *k * gradient
                    }
                };
                *state = found.into();
            });
        matter.points.bring(self.state.as_flattened_mut());
        let rules = self.turned(family, matter.rules);
        for (component, slots) in self.slots.iter_mut().enumerate() {
            let state = |point: usize| self.state[point][component];
            slots.load(family, state, ByRules(&rules, component));
        }
    }

    /// The kernel and its inputs as last loaded.
    pub(super) fn flow<'a>(
        &'a self,
        temperature: &'a [f64],
        conductivity: &'a [f64],
    ) -> (StateFlow, [&'a [f64]; 5]) {
        let [x, y, z] = &self.slots;
        let kernel = StateFlow {
            stabilisation: self.stabilisation,
        };
        (kernel, [temperature, x, y, z, conductivity])
    }

    /// Continuation of `p` behind faces: that of the gradient of a temperature that continues by `rules`; behind periodic faces
    /// it is a copy.
    fn turned(&self, family: &Family, rules: &[LayerRule]) -> Vec<LayerRule> {
        let faces = family.spec().layers.iter();
        let mirrored = faces.filter(|face| !self.periodic[face.axis()]);
        let rule = |face: &perimelt_core::Face| {
            let of_temperature = rules.iter().find(|r| r.face == *face);
            let scale = of_temperature.map_or(1.0, |r| r.scale[0]);
            LayerRule {
                scale: std::array::from_fn(|a| if a == face.axis() { -scale } else { scale }),
                ..LayerRule::even(*face)
            }
        };
        mirrored.map(rule).collect()
    }
}
