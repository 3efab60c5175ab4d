//! What is reported of the interface between two fluids, and of the first of them.

use std::f64::consts::{PI, TAU};

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

/// Where a fluid is along a periodic axis of a body, roughly.
#[derive(Clone, Copy)]
struct Middle {
    /// m.
    at: f64,
    /// Of the body, m.
    low: f64,
    length: f64,
}

/// The middle by axis of a fluid with this position (m) and volume (m³) of points: the mean on the circle that a periodic axis is. None where the
/// axis is not periodic, or the fluid is everywhere alike.
fn middle(body: &Body, point: impl Fn(usize) -> (Vector3<f64>, f64) + Sync) -> [Option<Middle>; 3] {
    /// Length of the mean vector on the circle below which it has no direction.
    const LEAST: f64 = 1e-6;
    let (low, high) = body.bounds();
    let along = |axis: usize| {
        let (low, length) = (low[axis], high[axis] - low[axis]);
        let angle = TAU / length;
        let [cos, sin, whole] = sum_points(body.points.len(), |i| {
            let (x, volume) = point(i);
            let (sin, cos) = (angle * (x[axis] - low)).sin_cos();
            [volume * cos, volume * sin, volume]
        });
        let at = low + sin.atan2(cos) / angle;
        (cos.hypot(sin) > LEAST * whole).then_some(Middle { at, low, length })
    };
    std::array::from_fn(|axis| body.periodic[axis].then(|| along(axis)).flatten())
}

impl Middle {
    /// The periodic image of a coordinate that is nearest to the middle, m.
    fn image(self, x: f64) -> f64 {
        x - self.length * ((x - self.at) / self.length).round()
    }

    /// The periodic image of a coordinate that is in the body, m.
    fn inside(self, x: f64) -> f64 {
        x - self.length * ((x - self.low) / self.length).floor()
    }
}

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
        let mean = |of: &(dyn Fn(usize) -> Vector3<f64> + Sync)| {
            let sum = sum_points(volume.len(), |i| (volume[i] * fraction[i] * of(i)).into());
            sum.map(|x| x / whole)
        };
        let around = middle(body, |i| (position[i], volume[i] * fraction[i]));
        let nearest = |i: usize| {
            Vector3::from_fn(|axis, _| {
                let x = position[i][axis];
                around[axis].map_or(x, |middle| middle.image(x))
            })
        };
        let centre = mean(&nearest);
        let inside = |axis: usize| {
            let x = centre[axis];
            around[axis].map_or(x, |middle| middle.inside(x))
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
            centre: std::array::from_fn(inside),
            velocity: mean(&|i| velocity[i]),
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
