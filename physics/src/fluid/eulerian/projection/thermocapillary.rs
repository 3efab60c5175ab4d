//! Surface tension that depends on the temperature (Marangoni): at the interface of two fluids, and along flat faces of one.
//!
//! ```text
//! interface   F = -gamma(T) kappa grad H + tau |grad H| + div S,   tau = dgamma/dT [grad T - (n . grad T) n]
//! face        F_i = tau sum_j 4 b s,   tau = dgamma/dT grad_s T
//! ```
//!
//! The first term acts along the bonds, where a pressure may balance it; what acts along surfaces changes the velocity before the
//! pressure does. Both take the same gamma at the temperature of the interface ([`interface_temperature`](super::interface_temperature)): the sum of their
//! forces over a closed interface vanishes.
//!
//! In the layer both fluids shear in series, each under its own stress, which tau makes differ: they slip past each other by
//! `x tau` per length as in an elastic laminate with a strain of its own, and the mean stress lacks it,
//!
//! ```text
//! S = mu x (tau n^T + n tau^T),   x = [(c + H)/2 - c H] (1/mu_1 - 1/mu_2)
//! F_i = sum_j b {xi . (n_i + n_j)/2 (H_j - H_i) mu_i/(mu_i + mu_j) (tau_i + tau_j) + mu_ij [x_i (tau_i n_i^T + n_i tau_i^T) + (the same of j)] . xi}
//! ```
//!
//! The pull of a bond acts where the halves of the bond meet, so that its ends share it in proportion to their viscosities, and the halves slip in
//! series. The flow outside of a plane layer is then exactly that of a sharp interface, for any ratio of viscosities. Without S and these fractions the pull
//! acts in the less viscous fluid, at a distance of the order of the width of the layer. At a face the sum is over the bonds
//! to images at the distance s behind it, which is the viscous force of images that move by `2 s tau/mu` faster: a linear profile has no error,
//! and the total is exactly the stress. The temperature of a face is that of the first row of points.

use perimelt_core::family::Mirrored;
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::surface_tension::gradient_along;
use perimelt_core::{Body, Bond, BondKernel, Face, Family, SlotField, TensionLaw};
use rayon::prelude::*;

use super::Projection;
use super::interface_temperature::{InterfaceTemperature, LayeredConductivity};
use super::phase::Gradient;
use crate::fluid::rates::POINTS_PER_TASK;
use crate::fluid::viscosity::of_bond;

/// What depends on the temperature.
#[derive(Debug, Default)]
pub(in crate::fluid) struct SurfaceLaws {
    /// Of the interface between two fluids, with their conductivities where no heat arises in the layer between them.
    pub(in crate::fluid) interface: Option<TensionLaw>,
    pub(in crate::fluid) conductivity: Option<LayeredConductivity>,
    pub(in crate::fluid) faces: Vec<(Face, TensionLaw)>,
}

/// Forces along surfaces.
#[derive(Debug)]
pub(super) struct Thermocapillary {
    interface: Option<TensionLaw>,
    faces: Vec<SurfaceFace>,
    temperature: InterfaceTemperature,
    pull: Pull,
    /// Rows of points, N/m³.
    force: Vec<f64>,
}

/// What the force along the interface follows from.
#[derive(Debug)]
struct Pull {
    /// Temperature of the interface by slot, K, and rows of points: its gradient, K/m.
    temperature: SlotField,
    slopes: Vec<f64>,
    /// Rows of points, and components by slot: tau, Pa.
    along: Vec<f64>,
    stress: Vec<SlotField>,
    /// By slot: viscosity, Pa s, and x, 1/(Pa s).
    viscosity: SlotField,
    slip: SlotField,
}

/// Force along the interface, from tau, normals, the step H, viscosity and x.
struct AlongInterface<const D: usize> {
    /// `1 / a`, 1/m.
    inverse: f64,
}

impl<const D: usize> AlongInterface<D> {
    const NORMAL: usize = D;
    const STEP: usize = 2 * D;
    const VISCOSITY: usize = Self::STEP + 1;
    const SLIP: usize = Self::VISCOSITY + 1;
    const COUNT: usize = Self::SLIP + 1;
}

impl<const D: usize, const I: usize> BondKernel<I, D> for AlongInterface<D> {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; I], other: [f64; I]) -> [f64; D] {
        let weight = bond.weight * self.inverse;
        let ends = [own, other];
        let [mut normal, mut along] = [[0.0; 2]; 2];
        for (end, values) in ends.iter().enumerate() {
            for a in 0..D {
                along[end] += bond.xi[a] * values[a];
                normal[end] += bond.xi[a] * values[Self::NORMAL + a];
            }
        }
        let [here, there] = ends.map(|end| end[Self::VISCOSITY]);
        let rise = other[Self::STEP] - own[Self::STEP];
        let pull = weight * 0.5 * (normal[0] + normal[1]) * rise * here / (here + there);
        let in_series = weight * of_bond::<true>(here, there);
        let mut sums = [0.0; D];
        for (end, values) in ends.iter().enumerate() {
            let slip = in_series * values[Self::SLIP];
            for (a, sum) in sums.iter_mut().enumerate() {
                *sum += (pull + slip * normal[end]) * values[a];
                *sum += slip * along[end] * values[Self::NORMAL + a];
            }
        }
        sums
    }
}

const ALONG_2D: usize = AlongInterface::<2>::COUNT;
const ALONG_3D: usize = AlongInterface::<3>::COUNT;

/// A flat face along which tension acts.
#[derive(Debug)]
struct SurfaceFace {
    law: TensionLaw,
    points: Vec<FacePoint>,
}

/// A point with bonds across a face.
#[derive(Debug)]
struct FacePoint {
    point: usize,
    /// The point of the first row before it.
    surface: usize,
    /// Sum of `4 b s`, 1/m.
    weight: f64,
    /// Axes along the face, with the points beside that of the first row.
    along: Vec<(usize, [Option<usize>; 2])>,
}

impl Thermocapillary {
    /// Forces in a body whose complete families have the moment `1 / inverse` (m); `None` where no tension depends on the temperature.
    pub(super) fn new(
        laws: SurfaceLaws,
        body: &Body,
        family: &Family,
        inverse: f64,
    ) -> Option<Self> {
        let SurfaceLaws {
            interface,
            conductivity,
            faces,
        } = laws;
        if interface.is_none() && faces.is_empty() {
            return None;
        }
        let (points, dimension) = (body.points.len(), body.dimension);
        let rows = points * dimension;
        let faces = faces.into_iter().map(|(face, law)| SurfaceFace {
            law,
            points: face_points(body, family, inverse, face),
        });
        Some(Thermocapillary {
            interface,
            faces: faces.collect(),
            temperature: InterfaceTemperature::new(conductivity, points, dimension),
            pull: Pull {
                temperature: SlotField::default(),
                slopes: vec![0.0; rows],
                along: vec![0.0; rows],
                stress: vec![SlotField::default(); dimension],
                viscosity: SlotField::default(),
                slip: SlotField::default(),
            },
            force: vec![0.0; rows],
        })
    }

    /// Force at a point of a body of `dimension`, N/m³.
    pub(super) fn force(&self, point: usize, dimension: usize) -> &[f64] {
        &self.force[point * dimension..][..dimension]
    }

    /// Largest acceleration of points of these densities (kg/m³), m/s².
    fn largest_acceleration<const D: usize>(&self, density: &[f64]) -> f64 {
        let (force, _) = self.force.as_chunks::<D>();
        let points = force.par_iter().zip(density).with_min_len(POINTS_PER_TASK);
        let squares = points.map(|(force, density)| {
            let square: f64 = force.iter().map(|f| f * f).sum();
            square / (density * density)
        });
        squares.reduce(|| 0.0, f64::max).sqrt()
    }

    /// Finds the force along faces of a lattice of this spacing (m).
    fn find_face_force<const D: usize>(&mut self, temperature: &[f64], spacing: f64) {
        for SurfaceFace { law, points } in &self.faces {
            for at in points {
                for &(axis, beside) in &at.along {
                    let neighbours = beside.map(|point| point.map(|point| temperature[point]));
                    let own = temperature[at.surface];
                    let gradient = gradient_along(own, neighbours, spacing);
                    self.force[at.point * D + axis] += at.weight * law.stress(own, gradient);
                }
            }
        }
    }
}

/// Points with bonds across a face.
fn face_points(body: &Body, family: &Family, inverse: f64, face: Face) -> Vec<FacePoint> {
    let across = face.axis();
    let plane = body.face_position(face);
    let mut found = Vec::new();
    for point in 0..body.points.len() {
        let place = body.points.position.at(point)[across];
        let mut weight = 0.0;
        family.for_each_bond(point, |_, bond, _| {
            let end = place + bond.xi[across] - plane;
            let behind = if face.is_upper() { end } else { -end };
            weight += 4.0 * bond.weight * inverse * behind.max(0.0);
        });
        if weight == 0.0 {
            continue;
        }
        let mut surface = point;
        while let Some(next) = body.neighbour(surface, face) {
            surface = next;
        }
        let axes = (0..body.dimension).filter(|axis| *axis != across);
        let beside =
            |axis: usize| [0, 1].map(|upper| body.neighbour(surface, Face::ALL[2 * axis + upper]));
        found.push(FacePoint {
            point,
            surface,
            weight,
            along: axes.map(|axis| (axis, beside(axis))).collect(),
        });
    }
    found
}

impl Projection {
    /// Sets the tension by point from the temperature of the interface at the start of the step, where it depends on it.
    pub(super) fn set_tension(&mut self) {
        let Some(mut surface) = self.thermocapillary.take() else {
            return;
        };
        if let Some(law) = &surface.interface {
            match self.dimension {
                2 => self.find_interface_temperature::<2>(&mut surface.temperature),
                _ => self.find_interface_temperature::<3>(&mut surface.temperature),
            }
            let points = surface.temperature.value.par_iter();
            let tension = points.with_min_len(POINTS_PER_TASK).map(|t| law.value(*t));
            tension.fill(&mut self.state.tension);
            self.load_tension();
        }
        self.thermocapillary = Some(surface);
    }

    /// Loads what acts along the bonds of an interface: tension by curvature, and pressure, where the first fluid is liquid. Where the tension
    /// depends on the temperature, that of the pair becomes the largest one.
    pub(super) fn load_tension(&mut self) {
        let Some(phase) = &mut self.phase else {
            return;
        };
        let (tension, pressure) = (&self.state.tension, &self.state.interface_pressure);
        if !tension.is_empty() {
            phase.pair.surface_tension = tension.iter().copied().fold(0.0, f64::max);
        }
        let (gamma, curvature) = (phase.pair.surface_tension, &phase.curvature);
        let liquid = self.freezing.as_ref().map(|freezing| &freezing.liquid_part);
        let of = |point: usize| {
            let gamma = tension.get(point).copied().unwrap_or(gamma);
            let pressure = pressure.get(point).copied().unwrap_or(0.0);
            let force = pressure - gamma * curvature[point][0];
            liquid.map_or(force, |liquid| liquid[point][0] * force)
        };
        self.slots.tension.load(&self.family, of, Mirrored::Scalar);
    }

    /// Finds the forces along surfaces for densities by point, kg/m³.
    pub(super) fn find_surface_force(&mut self, density: &[f64]) {
        match self.dimension {
            2 => self.find_force_along::<2, ALONG_2D>(density),
            _ => self.find_force_along::<3, ALONG_3D>(density),
        }
    }

    fn find_force_along<const D: usize, const I: usize>(&mut self, density: &[f64]) {
        let Some(mut surface) = self.thermocapillary.take() else {
            return;
        };
        if self.phase.is_some() {
            self.find_interface_force::<D, I>(&mut surface);
        } else if let Some(heat) = &self.heat {
            surface.force.fill(0.0);
            surface.find_face_force::<D>(heat.temperature(), self.spacing);
        }
        self.state.surface_acceleration = surface.largest_acceleration::<D>(density);
        self.thermocapillary = Some(surface);
    }

    /// Finds the force along the interface between two fluids at its temperature, where the first one is liquid.
    fn find_interface_force<const D: usize, const I: usize>(&self, surface: &mut Thermocapillary) {
        let Thermocapillary {
            interface: Some(law),
            temperature,
            pull,
            force,
            ..
        } = surface
        else {
            return;
        };
        let Some(phase) = &self.phase else {
            return;
        };
        let (family, inverse) = (&*self.family, self.inverse());
        let (temperature, fraction) = (&temperature.value, &phase.fraction);
        (pull.temperature).load(family, &temperature[..], Mirrored::Scalar);
        let (slopes, _) = pull.slopes.as_chunks_mut::<D>();
        family.sum(&Gradient { inverse }, [&pull.temperature], slopes);
        let liquid = self.freezing.as_ref().map(|freezing| &freezing.liquid_part);
        let (along, _) = pull.along.as_chunks_mut::<D>();
        let points = along.par_iter_mut().zip(&*slopes).enumerate();
        let points = points.with_min_len(POINTS_PER_TASK);
        points.for_all(|(i, (along, slope))| {
            let normal: [f64; D] = phase.normal_in(self.slot[i]);
            let across: f64 = (0..D).map(|a| normal[a] * slope[a]).sum();
            let liquid = liquid.map_or(1.0, |liquid| liquid[i][0]);
            let rate = liquid * law.slope(temperature[i]);
            *along = std::array::from_fn(|a| rate * (slope[a] - across * normal[a]));
        });
        let along = &*along;
        for (axis, stress) in pull.stress.iter_mut().enumerate() {
            stress.load(family, |i: usize| along[i][axis], Mirrored::Vector(axis));
        }
        let viscosity = |i: usize| phase.pair.viscosity_of(fraction[i]);
        pull.viscosity.load(family, viscosity, Mirrored::Scalar);
        let jump = phase.pair.jump_of_fluidity();
        let slip = |i: usize| {
            let c = fraction[i].clamp(0.0, 1.0);
            let step = c * c * (3.0 - 2.0 * c);
            jump * (0.5 * (c + step) - c * step)
        };
        pull.slip.load(family, slip, Mirrored::Scalar);
        let mut fields = (pull.stress.iter().chain(&phase.normal)).chain([
            &self.slots.step,
            &pull.viscosity,
            &pull.slip,
        ]);
        let inputs: [&[f64]; I] =
            std::array::from_fn(|_| fields.next().map_or(&[][..], |slots| &slots[..]));
        let (force, _) = force.as_chunks_mut::<D>();
        family.sum(&AlongInterface::<D> { inverse }, inputs, force);
    }
}

#[cfg(test)]
pub(super) mod tests;
