//! Lorentz force of an arc on the melt below it.
//!
//! The current of the arc enters the plate through a spot with the density of a Gaussian and leaves through the bottom; its field and
//! that of its continuation in the plate follow from continuity (Tsao & Wu (1988); docs/theory/melt_flow.md):
//!
//! ```text
//! F_r = -(mu0 I^2/(4 pi^2 s^2 r)) E (1 - E) (1 - z/L)^2,   F_z = (mu0 I^2/(4 pi^2 r^2 L)) (1 - E)^2 (1 - z/L)
//! E = exp(-r^2/(2 s^2))
//! ```
//!
//! with the distance r from the axis of the torch, the depth z, the width s of the spot and the thickness L of the plate. The force
//! points inwards and down. Not for: plates that are not much wider than thick, joints that conduct poorly.

use std::f64::consts::PI;
use std::rc::Rc;

use nalgebra::Vector3;
use perimelt_core::numbers::{check_finite, check_positive};
use perimelt_core::world::BodyIndex;
use perimelt_core::{
    Coupler, Prepared, RunError, RunningCoupler, Setup, SetupError, Step, World, Write, keys,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::toolpath::TimedPath;

/// Magnetic constant, N/A².
const MAGNETIC: f64 = 4e-7 * PI;

/// Lorentz force of an arc; needs `melt_flow` on the body.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LorentzForce {
    /// Body; may be left out when there is one only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<String>,
    /// Name of the heat source that is the arc.
    pub source: String,
    /// Current, A.
    pub current: f64,
    /// Standard deviation of the current density in the spot, m.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub width: f64,
    /// Thickness of the plate, m.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub thickness: f64,
}

/// A force that is ready to act.
struct RunningLorentzForce {
    body: BodyIndex,
    keys: LorentzForce,
    path: Rc<TimedPath>,
    force: Write<Vector3<f64>>,
}

impl LorentzForce {
    /// Force per volume (N/m³) at a distance from the axis and a depth (m): towards the axis negative, and along the torch.
    fn at(&self, distance: f64, depth: f64) -> [f64; 2] {
        let rest = 1.0 - depth / self.thickness;
        if distance <= 0.0 || rest <= 0.0 {
            return [0.0; 2];
        }
        let squares = self.width * self.width;
        let outside = (-distance * distance / (2.0 * squares)).exp();
        let inside = -(-distance * distance / (2.0 * squares)).exp_m1();
        let strength = MAGNETIC * self.current * self.current / (4.0 * PI * PI);
        let across = -strength / (squares * distance) * outside * inside * rest * rest;
        let along = strength / (distance * distance * self.thickness) * inside * inside * rest;
        [across, along]
    }
}

#[typetag::serialize(name = "lorentz_force")]
impl Coupler for LorentzForce {
    fn prepare(self: Box<Self>, setup: &mut Setup<'_>) -> Prepared<dyn RunningCoupler> {
        let body = setup.find_body(self.body.as_deref())?;
        check_finite("current", self.current)?;
        check_positive("width", self.width, "m")?;
        check_positive("thickness", self.thickness, "m")?;
        if setup.body(body).dimension < 3 {
            let message = "the force of an arc is that around its axis";
            return Err(SetupError::value("body", message, "a 3D body"));
        }
        Ok(Box::new(RunningLorentzForce {
            body,
            path: setup.shared("source", "heat source", &self.source)?,
            force: setup.add(body, &keys::MELT_FORCE)?,
            keys: *self,
        }))
    }
}

impl RunningCoupler for RunningLorentzForce {
    fn apply(&mut self, world: &World, step: Step) -> Result<(), RunError> {
        let pose = self.path.pose(step.middle());
        if pose.power <= 0.0 {
            return Ok(());
        }
        let (spot, axis) = self.path.spot(&pose);
        let shift = world.window_shift(self.body);
        let mut force = world.write(self.force);
        let positions = &world.body(self.body).points.position;
        for (sum, position) in force.iter_mut().zip(positions) {
            let from_spot = position + shift - spot;
            let depth = from_spot.dot(&axis);
            let across = from_spot - depth * axis;
            let distance = across.norm();
            if distance > 0.0 {
                let [inwards, along] = self.keys.at(distance, depth);
                *sum += inwards / distance * across + along * axis;
            }
        }
        Ok(())
    }
}

perimelt_core::register_coupler!("lorentz_force", LorentzForce, supports: [Births, Cuts, Window, Division]);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::heat_source::GaussianSource;
    use crate::testing::{STEEL, apply, block, prepare_after, read, values};

    /// Near the axis both components vanish, as `r/(2 s²)` and `r²/(4 s⁴)` times the strength; below the plate there is none.
    #[test]
    fn an_arc_pushes_inwards_and_down() {
        let arc: LorentzForce =
            read("source = 'arc'\ncurrent = 200\nwidth = 1e-3\nthickness = 5e-3");
        for (distance, depth) in [(1e-4, 0.0), (1e-3, 1e-3), (5e-3, 4e-3)] {
            let [across, along] = arc.at(distance, depth);
            assert!(across < 0.0 && along > 0.0, "{distance} {depth}");
        }
        // small r: E(1 - E)/r -> r/(2 s²)
        let strength = MAGNETIC * 200.0f64.powi(2) / (4.0 * PI * PI);
        let [across, along] = arc.at(1e-6, 0.0);
        assert!((across / (-strength * 1e-6 / 2e-12) - 1.0).abs() < 1e-5);
        assert!((along / (strength * 1e-12 / (4e-12 * 5e-3)) - 1.0).abs() < 1e-5);
        assert_eq!(arc.at(1e-3, 5e-3), [0.0; 2]);
        assert_eq!(arc.at(0.0, 0.0), [0.0; 2]);
    }

    /// `F_r` at the surface is `-J_z B` with the density of the spot and the field of the current within r.
    #[test]
    fn the_force_at_the_surface_is_current_times_field() {
        let arc: LorentzForce =
            read("source = 'arc'\ncurrent = 150\nwidth = 2e-3\nthickness = 6e-3");
        let (r, squares): (f64, f64) = (1.5e-3, 4e-6);
        let density = 150.0 / (2.0 * PI * squares) * (-r * r / (2.0 * squares)).exp();
        let enclosed = 150.0 * (1.0 - (-r * r / (2.0 * squares)).exp());
        let field = MAGNETIC * enclosed / (2.0 * PI * r);
        let [across, _] = arc.at(r, 0.0);
        assert!(
            (across / (-density * field) - 1.0).abs() < 1e-12,
            "{across}"
        );
    }

    /// Force on a point 1 m beside the axis and 0.5 m below the top, with x, y, z turned into the axes of `turn`, by an arc over `face`.
    fn force_below(face: &str, turn: [usize; 3], is_upper: bool, level: Option<f64>) -> [f64; 3] {
        let turned = |v: [f64; 3]| {
            let mut out = [0.0; 3];
            (0..3).for_each(|a| out[turn[a]] = v[a]);
            out
        };
        let height = if is_upper { 4.0 } else { 0.0 };
        // a path off its level, which the source has instead
        let start = turned([2.5, 2.5, height + if level.is_some() { 7.0 } else { 0.0 }]);
        let level = level.map_or(String::new(), |l| format!(", level = {l}"));
        let source: GaussianSource = read(&format!(
            "toolpath.polyline = {{ start = {start:?}, segments = [{{ to = {start:?}, dwell = 1 }}] }}
             power = 1\nsigma = 1\neffective_depth = 1\nheated_surface = {{ face = '{face}'{level} }}"
        ));
        let mut world = World::new(vec![block([4, 4, 4], 3, STEEL)]);
        let before = |setup: &mut Setup<'_>| {
            setup.consume(0, &keys::MELT_FORCE).expect("free");
            setup.next_plugin("arc");
            let mut source = source;
            source.publish_path(setup).expect("valid");
        };
        let arc: LorentzForce = read("source = 'arc'\ncurrent = 200\nwidth = 1\nthickness = 4");
        let prepared = prepare_after(&mut world, before, arc, |_| ());
        apply(&world, &mut *prepared.expect("valid").0, 0.0);
        let at = turned([3.5, 2.5, if is_upper { 3.5 } else { 0.5 }]);
        let positions = &world.body(0).points.position;
        let point = positions.iter().position(|x| <[f64; 3]>::from(*x) == at);
        let force = &values(&world, &keys::MELT_FORCE)[3 * point.expect("a point")..][..3];
        [force[turn[0]], force[turn[1]], force[turn[2]]]
    }

    /// An arc over any face pushes into the body as one over the top does, from the level of its source.
    #[test]
    fn an_arc_pushes_into_the_face_that_it_heats() {
        let top = force_below("z+", [0, 1, 2], true, None);
        assert!(top[0] < 0.0 && top[1] == 0.0 && top[2] < 0.0, "{top:?}");
        assert_eq!(force_below("z+", [0, 1, 2], true, Some(4.0)), top);
        for (face, turn, is_upper) in [
            ("z-", [0, 1, 2], false),
            ("x+", [1, 2, 0], true),
            ("x-", [1, 2, 0], false),
            ("y+", [2, 0, 1], true),
        ] {
            let [across, other, along] = force_below(face, turn, is_upper, None);
            let into = if is_upper { along } else { -along };
            assert_eq!([across, other, into], top, "{face}");
        }
    }
}
