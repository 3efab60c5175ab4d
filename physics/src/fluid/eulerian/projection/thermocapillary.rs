//! Surface tension that depends on the temperature (Marangoni): at the interface of two fluids, and along flat faces of one.
//!
//! ```text
//! interface   F = -gamma(T) kappa grad H + dgamma/dT [grad T - (n . grad T) n] |grad H|
//! face        F_i = tau sum_j 4 b s,   tau = dgamma/dT grad_s T
//! ```
//!
//! The first term acts along the bonds, where a pressure may balance it; what acts along surfaces changes the velocity before the
//! pressure does. Both take the same gamma: the sum of their forces over a closed interface vanishes. At a face the sum is over the bonds
//! to images at the distance s behind it, which is the viscous force of images that move by `2 s tau/mu` faster: a linear profile has no error,
//! and the total is exactly the stress. The temperature of a face is that of the first row of points.

use perimelt_core::family::Mirrored;
use perimelt_core::surface_tension::gradient_along;
use perimelt_core::{Body, Face, Family, SlotField, TensionLaw};
use rayon::prelude::*;

use super::Projection;
use super::phase::Gradient;
use crate::fluid::rates::POINTS_PER_TASK;

/// What depends on the temperature.
#[derive(Debug, Default)]
pub(in crate::fluid) struct SurfaceLaws {
    /// Of the interface between two fluids.
    pub(in crate::fluid) interface: Option<TensionLaw>,
    pub(in crate::fluid) faces: Vec<(Face, TensionLaw)>,
}

/// Forces along surfaces.
#[derive(Debug)]
pub(super) struct Thermocapillary {
    interface: Option<TensionLaw>,
    faces: Vec<SurfaceFace>,
    /// By slot, K.
    temperature: SlotField,
    /// Rows of points: gradients of the temperature (K/m) and of the step between the fluids (1/m).
    slopes: Vec<f64>,
    steps: Vec<f64>,
    /// Rows of points, N/m³.
    force: Vec<f64>,
}

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
        let SurfaceLaws { interface, faces } = laws;
        if interface.is_none() && faces.is_empty() {
            return None;
        }
        let rows = body.points.len() * body.dimension;
        let faces = faces.into_iter().map(|(face, law)| SurfaceFace {
            law,
            points: face_points(body, family, inverse, face),
        });
        Some(Thermocapillary {
            interface,
            faces: faces.collect(),
            temperature: SlotField::default(),
            slopes: vec![0.0; rows],
            steps: vec![0.0; rows],
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

    /// Finds the gradients of the temperature (K) and of the step between two fluids.
    fn find_slopes<const D: usize>(&mut self, bonds: SlopeBonds<'_>, temperature: &[f64]) {
        let SlopeBonds {
            family,
            inverse,
            step,
        } = bonds;
        self.temperature.load(family, temperature, Mirrored::Scalar);
        let fields = [&self.temperature, step].into_iter();
        for (field, rows) in fields.zip([&mut self.slopes, &mut self.steps]) {
            let (rows, _) = rows.as_chunks_mut::<D>();
            family.sum(&Gradient { inverse }, [field], rows);
        }
    }

    /// Finds the force along the interface; `normal(point, axis)` points into the first fluid, of which the `liquid` part is given where it
    /// freezes.
    fn find_interface_force<const D: usize>(
        &mut self,
        temperature: &[f64],
        normal: impl Fn(usize, usize) -> f64 + Sync,
        liquid: Option<&[[f64; 1]]>,
    ) {
        let Some(law) = &self.interface else {
            return;
        };
        let (force, _) = self.force.as_chunks_mut::<D>();
        let (slopes, _) = self.slopes.as_chunks::<D>();
        let (steps, _) = self.steps.as_chunks::<D>();
        let points = force.par_iter_mut().zip(slopes).zip(steps).enumerate();
        let points = points.with_min_len(POINTS_PER_TASK);
        points.for_each(|(i, ((force, slope), step))| {
            let (mut across, mut square) = (0.0, 0.0);
            for a in 0..D {
                across += normal(i, a) * slope[a];
                square += step[a] * step[a];
            }
            let liquid = liquid.map_or(1.0, |liquid| liquid[i][0]);
            let strength = liquid * law.slope(temperature[i]) * square.sqrt();
            for a in 0..D {
                force[a] = strength * (slope[a] - across * normal(i, a));
            }
        });
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

/// Bonds over which gradients are summed, and the step between two fluids by slot.
#[derive(Clone, Copy)]
struct SlopeBonds<'a> {
    family: &'a Family,
    /// `1 / a`, 1/m.
    inverse: f64,
    step: &'a SlotField,
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
    /// Sets the tension by point from the temperatures at the start of the step, where it depends on them.
    pub(super) fn set_tension(&mut self) {
        let law = self
            .thermocapillary
            .as_ref()
            .and_then(|t| t.interface.as_ref());
        if let (Some(law), Some(heat)) = (law, &self.heat) {
            let points = heat.temperature().par_iter().with_min_len(POINTS_PER_TASK);
            let tension = points.map(|t| law.value(*t));
            tension.collect_into_vec(&mut self.state.tension);
        }
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
    pub(super) fn find_surface_force<const D: usize>(&mut self, density: &[f64]) {
        let Some(mut surface) = self.thermocapillary.take() else {
            return;
        };
        if let Some(heat) = &self.heat {
            let temperature = heat.temperature();
            if let Some(phase) = &self.phase {
                let bonds = SlopeBonds {
                    family: &self.family,
                    inverse: self.inverse(),
                    step: &self.slots.step,
                };
                surface.find_slopes::<D>(bonds, temperature);
                let normal =
                    |point: usize, axis: usize| phase.normal[axis][self.slot[point] as usize];
                let liquid = (self.freezing.as_ref()).map(|f| &f.liquid_part[..]);
                surface.find_interface_force::<D>(temperature, normal, liquid);
            } else {
                surface.force.fill(0.0);
                surface.find_face_force::<D>(temperature, self.spacing);
            }
        }
        self.state.surface_acceleration = surface.largest_acceleration::<D>(density);
        self.thermocapillary = Some(surface);
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use nalgebra::Vector3;

    use super::super::heat::FlowHeat;
    use super::super::tests::{STEEL_AND_GAS, Tank, sides};
    use super::*;

    /// Gives a tank this temperature (K) by place, and forces along surfaces.
    fn heat(tank: &mut Tank, laws: SurfaceLaws, temperature: impl Fn(&Vector3<f64>) -> f64) {
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
            faces: Vec::new(),
        };
        heat(&mut tank, laws, |x| 300.0 + x.y);
        let fraction: Vec<f64> = tank.body.points.position.iter().map(fraction).collect();
        tank.rates.set_fraction(&fraction);
        (tank.rates).set_fluxes(&tank.velocity, &tank.density, &tank.pressure);
        tank.rates.find_surface_force::<2>(&tank.density);
        let rates = &tank.rates;
        let surface = rates.thermocapillary.as_ref().expect("forces");
        let (mut across, mut along) = ([0.0; 2], [0.0; 2]);
        for point in 0..fraction.len() {
            let tension = rates.slots.tension[rates.slot[point] as usize];
            for a in 0..2 {
                across[a] += spacing * spacing * tension * surface.steps[2 * point + a];
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

    /// The force on the points before a face adds up to the stress, for any horizon, and is that of the temperature of the first row.
    #[test]
    fn the_force_before_a_face_is_the_stress() {
        for horizon in [2.015, 3.015] {
            let (n, slope) = (12, -2.0);
            let mut tank = Tank::new(2, n, sides(2), horizon);
            let laws = SurfaceLaws {
                interface: None,
                faces: vec![(Face::YMax, TensionLaw::linear(0.0, 0.0, slope))],
            };
            heat(&mut tank, laws, |x| 300.0 + 7.0 * x.x * x.y);
            tank.rates.find_surface_force::<2>(&tank.density);
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
