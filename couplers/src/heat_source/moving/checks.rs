//! Checks of a moving source: its size, its power, and whether it reaches the body.

use nalgebra::Vector3;
use perimelt_core::solver::Reducer;
use perimelt_core::text::{number, position};
use perimelt_core::{Body, Setup, SetupError};

use super::MovingSource;
use crate::heat_source::lattice::{AbsorbingState, LatticeBody, grid};
use crate::heat_source::shape::{Depositor, SourceShape};
use crate::toolpath::Track;

/// Least fraction of its power with which a source outside the box of the body heats it.
const LEAST_FRACTION: f64 = 0.01;

/// Most moves whose heat is tried where the path lies outside the box of the body.
const MOST_TRIED: usize = 100;

/// Powers of welding sources are below this, W.
const STRONGEST: f64 = 2e5;

impl<S: SourceShape> MovingSource<S> {
    /// Warns of a source finer than the spacing, and of a power that is probably in other units.
    pub(super) fn warn_of_size(&self, setup: &mut Setup<'_>, body: usize) {
        let (length, spacing) = (self.shape.length(), setup.body(body).finest_spacing());
        if length > 0.0 && length < spacing {
            let [length, spacing] = [length, spacing].map(|x| number(x, 4));
            setup.warn(format!(
                "the shortest length of the source is {length} m, finer than the spacing {spacing} m: it heats \
                 single cells"
            ));
        }
        let power = self.power().ok().flatten();
        if let Some(power) = power.filter(|power| *power > STRONGEST) {
            setup.warn(format!(
                "a power of {} W is unusual; powers are in watts",
                number(power, 5)
            ));
        }
    }

    /// Refuses a toolpath on which the source is never on within `margin` (m) of the box of the body and heats no cell of its
    /// lattice. A beam from outside the box may heat cells.
    pub(super) fn check_path(
        &self,
        body: &Body,
        reducer: &Reducer,
        track: &Track,
        margin: f64,
        depositor: &mut Depositor,
    ) -> Result<(), SetupError> {
        let (min, max) = body.bounds();
        let surface = self.shape.surface();
        let touches = |position: &Vector3<f64>| {
            (0..body.dimension).all(|axis| {
                let at = match surface.level {
                    Some(level) if axis == surface.face.axis() => level,
                    _ => position[axis],
                };
                at >= min[axis] - margin && at <= max[axis] + margin
            })
        };
        let mut first = None;
        for (start, end) in track.powered_moves() {
            let pose = track.pose(start);
            // beyond this distance a move without an end does not return to the body
            let reach = (pose.position - 0.5 * (min + max)).norm() + (max - min).norm();
            let end = if end.is_finite() {
                end
            } else {
                start + 2.0 * reach / pose.speed
            };
            let samples = (pose.speed * (end - start) / margin).ceil().clamp(1.0, 1e4);
            for sample in 0..=samples as usize {
                let time = start + (end - start) * sample as f64 / samples;
                let position = track.pose(time).position;
                first.get_or_insert(position);
                if touches(&position) {
                    return Ok(());
                }
            }
        }
        let lattice = body.lattice().map(|_| LatticeBody {
            body,
            grid: grid(body),
            activity: None,
            state: AbsorbingState::None,
            reducer: reducer.clone(),
        });
        let mut heat = vec![0.0; body.points.len()];
        let heats = |(start, end): (f64, f64)| {
            let end = if end.is_finite() { end } else { start };
            let pose = track.pose(0.5 * (start + end));
            let deposit = lattice
                .as_ref()
                .map(|body| depositor.add(body, &pose, &mut heat));
            deposit.is_some_and(|d| d.deposited > LEAST_FRACTION * d.asked)
        };
        if track.powered_moves().take(MOST_TRIED).any(heats) {
            return Ok(());
        }
        let Some(first) = first else {
            let message = "the power of the source is zero at all times";
            return Err(SetupError::value("toolpath", message, "a power above 0"));
        };
        let message = format!(
            "the source never heats the body: it is switched on at {} m, \
             but body `{}` spans {} to {} m",
            position(first),
            body.name,
            position(min),
            position(max),
        );
        Err(SetupError::value(
            "toolpath",
            message,
            "a path over the body",
        ))
    }
}
