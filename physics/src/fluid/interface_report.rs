//! What is reported of the interface between two fluids, and of the first of them.

use std::f64::consts::PI;

use nalgebra::Vector3;
use perimelt_core::solver::reduce::sum_points;
use perimelt_core::{Body, Report};

use crate::momentum::AXES;

/// What is reported of the interface and the first fluid.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::fluid) struct InterfaceReport {
    /// Mean pressure within the first fluid less that within the second, outside of the layer between them, Pa.
    pressure_jump: f64,
    /// m².
    area: f64,
    /// Surface of a sphere, or in the plane circumference of a circle, of the volume of the first fluid over that of the interface.
    roundness: f64,
    /// Of the first fluid, m.
    centre: [f64; 3],
    /// Of the first fluid, m/s.
    velocity: [f64; 3],
}

/// The first of two fluids of a body.
pub(in crate::fluid) struct FirstFluid<'a> {
    pub(in crate::fluid) body: &'a Body,
    /// Fraction that it has of each point.
    pub(in crate::fluid) fraction: &'a [f64],
    /// m³.
    pub(in crate::fluid) volume: &'a [f64],
    /// m.
    pub(in crate::fluid) position: &'a [Vector3<f64>],
    pub(in crate::fluid) flow: InterfaceFlow<'a>,
}

/// Flow in which an interface is measured.
#[derive(Clone, Copy)]
pub(in crate::fluid) struct InterfaceFlow<'a> {
    /// m/s.
    pub(in crate::fluid) velocity: &'a [Vector3<f64>],
    /// Pa.
    pub(in crate::fluid) pressure: &'a [f64],
}

/// Gradient of the fraction below which a point lies within a fluid, over an inverse spacing.
const WITHIN: f64 = 0.01;

impl InterfaceReport {
    /// Of a fluid whose fraction has at each point a gradient of this size (1/m).
    pub(in crate::fluid) fn of(
        first: &FirstFluid<'_>,
        steepness: impl Fn(usize) -> f64 + Sync,
    ) -> InterfaceReport {
        let FirstFluid {
            body,
            fraction,
            volume,
            position,
            flow: InterfaceFlow { velocity, pressure },
        } = *first;
        let least = WITHIN / body.finest_spacing();
        let parts = |i: usize| {
            let steepness = steepness(i);
            let volume = volume[i];
            let part = |is_here: bool| if is_here { volume } else { 0.0 };
            let within = steepness <= least;
            let first = part(within && fraction[i] > 0.5);
            let second = part(within && fraction[i] <= 0.5);
            let pressures = [first * pressure[i], second * pressure[i]];
            [
                volume * steepness,
                volume * fraction[i],
                first,
                second,
                pressures[0],
                pressures[1],
            ]
        };
        let [area, whole, first, second, in_first, in_second] = sum_points(volume.len(), parts);
        let mean = |of: &[Vector3<f64>]| {
            let sum = sum_points(volume.len(), |i| (volume[i] * fraction[i] * of[i]).into());
            sum.map(|x| x / whole)
        };
        InterfaceReport {
            pressure_jump: match first > 0.0 && second > 0.0 {
                true => in_first / first - in_second / second,
                false => 0.0,
            },
            area,
            roundness: match body.dimension {
                2 => 2.0 * (PI * whole * body.thickness).sqrt() / area,
                _ => PI.cbrt() * (6.0 * whole).powf(2.0 / 3.0) / area,
            },
            centre: mean(position),
            velocity: mean(velocity),
        }
    }

    pub(in crate::fluid) fn reports(&self) -> Vec<Report> {
        let mut all = vec![
            Report::new("interface.pressure_jump", "Pa", self.pressure_jump),
            Report::new("interface.area", "m2", self.area),
            Report::new("interface.roundness", "1", self.roundness),
        ];
        for (axis, name) in AXES.into_iter().enumerate() {
            let centre = format!("first_fluid.centre.{name}");
            let velocity = format!("first_fluid.velocity.{name}");
            all.push(Report::new(centre, "m", self.centre[axis]));
            all.push(Report::new(velocity, "m/s", self.velocity[axis]));
        }
        all
    }
}
