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
        let place = body.points.position[point][across];
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
            tension.collect_into_vec(&mut self.state.tension);
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
        points.for_each(|(i, (along, slope))| {
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
pub(super) mod tests {
    use std::f64::consts::PI;

    use nalgebra::Vector3;

    use super::super::heat::FlowHeat;
    use super::super::tests::{STEEL_AND_GAS, Tank, sides};
    use super::*;
    use crate::fluid::pair::FluidPair;

    /// Gives a tank this temperature (K) by place, and forces along surfaces.
    pub(in crate::fluid) fn heat(
        tank: &mut Tank,
        laws: SurfaceLaws,
        temperature: impl Fn(&Vector3<f64>) -> f64,
    ) {
        let rates = &mut tank.rates;
        let places = tank.body.points.position.iter();
        let temperature: Vec<f64> = places.map(temperature).collect();
        let mut heat = FlowHeat::new(Vec::new(), None, &tank.body);
        heat.start(&temperature, &temperature);
        rates.heat = Some(heat);
        let inverse = rates.inverse();
        rates.thermocapillary = Thermocapillary::new(laws, &tank.body, &rates.family, inverse);
    }

    /// On a drop in a gradient the curved interface pushes to the cold side where the tension is larger, and what acts along it pulls back:
    /// by `pi R dgamma/dT grad T` each, with opposite signs.
    #[test]
    fn forces_of_a_closed_interface_balance() {
        let (n, radius, slope) = (64, 0.3, -2.0);
        let mut tank = Tank::with(2, n, sides(2), 2.015, Some(STEEL_AND_GAS));
        let spacing = 1.0 / n as f64;
        let distance = |x: &Vector3<f64>| radius - (x.x - 0.51).hypot(x.y - 0.497);
        let fraction = |x: &Vector3<f64>| 1.0 / (1.0 + (-distance(x) / (0.75 * spacing)).exp());
        let laws = SurfaceLaws {
            interface: Some(TensionLaw::linear(5.0, 300.0, slope)),
            conductivity: None,
            faces: Vec::new(),
        };
        heat(&mut tank, laws, |x| 300.0 + x.y);
        let fraction: Vec<f64> = tank.body.points.position.iter().map(fraction).collect();
        tank.rates.set_fraction(&fraction);
        (tank.rates).set_fluxes(&tank.velocity, &tank.density, &tank.pressure);
        tank.rates.find_surface_force(&tank.density);
        let rates = &tank.rates;
        let surface = rates.thermocapillary.as_ref().expect("forces");
        let mut steps = vec![[0.0; 2]; fraction.len()];
        let gradient = Gradient {
            inverse: rates.inverse(),
        };
        rates.family.sum(&gradient, [&rates.slots.step], &mut steps);
        let (mut across, mut along) = ([0.0; 2], [0.0; 2]);
        for (point, step) in steps.iter().enumerate() {
            let tension = rates.slots.tension[rates.slot[point] as usize];
            for a in 0..2 {
                across[a] += spacing * spacing * tension * step[a];
                along[a] += spacing * spacing * surface.force(point, 2)[a];
            }
        }
        let size = PI * radius * slope;
        assert!((along[1] / size - 1.0).abs() < 0.02, "{along:?} {size}");
        assert!((across[1] / size + 1.0).abs() < 0.02, "{across:?} {size}");
        assert!((along[1] + across[1]).abs() < 0.005 * size.abs());
        assert!(along[0].abs().max(across[0].abs()) < 1e-3 * size.abs());
        let largest = rates.state.tension.iter().copied().fold(0.0, f64::max);
        assert!(
            (rates.capillary_step() / STEEL_AND_GAS.capillary_step(spacing)
                - (5.0 / largest).sqrt())
            .abs()
                < 1e-12
        );
    }

    /// Outside of a plane layer the flow is that of a sharp interface, for any ratio of viscosities: the force along it has no power
    /// in the flow of a uniform stress, whose velocity vanishes at the sharp interface. Forces at points in proportion to the rise
    /// of H have one of the order of the width.
    #[test]
    fn the_stress_along_a_plane_layer_acts_at_the_interface() {
        // bonds of three spacings bridge the layer: the sampled power of the force has an error of 2 % of what the force at points has
        for (horizon, shift, viscosity, limit) in [
            (2.015, 0.0, [2.0, 1.0], 2e-3),
            (2.015, 0.5, [1.0, 2.0], 2e-3),
            (2.015, 0.3, [100.0, 1.0], 2e-3),
            (3.015, 0.0, [1.0, 2.0], 3e-2),
        ] {
            let (n, slope) = (32, -2.0);
            let pair = FluidPair {
                viscosity,
                ..STEEL_AND_GAS
            };
            let mut tank = Tank::with(2, n, sides(2), horizon, Some(pair.clone()));
            let spacing = 1.0 / n as f64;
            let width = pair.width * spacing;
            let distance = |x: &Vector3<f64>| x.y - 0.5 - shift * spacing;
            let fraction = |x: &Vector3<f64>| 1.0 / (1.0 + (-distance(x) / width).exp());
            let laws = SurfaceLaws {
                interface: Some(TensionLaw::linear(5.0, 300.0, slope)),
                conductivity: None,
                faces: Vec::new(),
            };
            heat(&mut tank, laws, |x| 300.0 + x.x);
            let fraction: Vec<f64> = tank.body.points.position.iter().map(fraction).collect();
            tank.rates.set_fraction(&fraction);
            (tank.rates).set_fluxes(&tank.velocity, &tank.density, &tank.pressure);
            tank.rates.find_surface_force(&tank.density);
            let surface = tank.rates.thermocapillary.as_ref().expect("forces");
            let places = &tank.body.points.position;
            let is_in_column =
                |i: &usize| (places[*i].x - 0.5 - 0.5 * spacing).abs() < 0.1 * spacing;
            let mut column: Vec<usize> = (0..places.len()).filter(is_in_column).collect();
            column.sort_by(|i, j| places[*i].y.total_cmp(&places[*j].y));
            let first = column[0];
            let mut velocity = distance(&places[first]) / viscosity[1];
            let [mut force, mut power, mut at_points] = [0.0; 3];
            let fluidity = |i: usize| 1.0 / pair.viscosity_of(fraction[i]);
            for (at, &i) in column.iter().enumerate() {
                if at > 0 {
                    velocity += 0.5 * spacing * (fluidity(column[at - 1]) + fluidity(i));
                }
                let [x, y] = [surface.force(i, 2)[0], surface.force(i, 2)[1]];
                force += spacing * x;
                power += spacing * x * velocity;
                let c = fraction[i];
                at_points += spacing * 6.0 * (c * (1.0 - c)).powi(2) / width * velocity;
                assert!(y.abs() < 1e-9, "{y}");
            }
            assert!((force / slope - 1.0).abs() < 1e-3, "{force}");
            let scale = width * pair.jump_of_fluidity().abs();
            assert!(at_points.abs() > 0.8 * scale, "{at_points} {scale}");
            let error = (power / slope / scale).abs();
            assert!(error < limit, "{horizon} {viscosity:?}: {error}");
        }
    }

    /// The force on the points before a face adds up to the stress, for any horizon, and is that of the temperature of the first row.
    #[test]
    fn the_force_before_a_face_is_the_stress() {
        for horizon in [2.015, 3.015] {
            let (n, slope) = (12, -2.0);
            let mut tank = Tank::new(2, n, sides(2), horizon);
            let laws = SurfaceLaws {
                interface: None,
                conductivity: None,
                faces: vec![(Face::YMax, TensionLaw::linear(0.0, 0.0, slope))],
            };
            heat(&mut tank, laws, |x| 300.0 + 7.0 * x.x * x.y);
            tank.rates.find_surface_force(&tank.density);
            let surface = tank.rates.thermocapillary.as_ref().expect("forces");
            let spacing = 1.0 / n as f64;
            let mut columns = vec![0.0; n];
            for (point, place) in tank.body.points.position.iter().enumerate() {
                let [x, y] = [surface.force(point, 2)[0], surface.force(point, 2)[1]];
                columns[(place.x / spacing) as usize] += spacing * x;
                assert_eq!(y, 0.0);
            }
            let stress = slope * 7.0 * (1.0 - 0.5 * spacing);
            for sum in columns {
                assert!((sum / stress - 1.0).abs() < 1e-12, "{sum} {stress}");
            }
        }
    }
}
