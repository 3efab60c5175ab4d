//! Arcs of a program: centre and angle.

use std::f64::consts::TAU;

use nalgebra::Vector3;
use perimelt_core::text::number;

use super::block::Block;
use super::machine::Machine;

/// Difference of the radii at both ends of an arc that is taken for rounding, relative and in m.
const ROUNDING: [f64; 2] = [5e-3, 5e-6];

impl Machine<'_> {
    /// Centre (m) and angle (rad, positive counter-clockwise) of an arc to a place.
    pub(super) fn arc(
        &self,
        block: &Block,
        to: Vector3<f64>,
        is_clockwise: bool,
    ) -> Result<(Vector3<f64>, f64), String> {
        let way = to - self.at;
        if way.z.abs() > ROUNDING[1] {
            return Err("an arc that changes its height is not supported".into());
        }
        if block.number('K')?.is_some_and(|k| k != 0.0) {
            return Err(
                "an arc in the plane xy (G17) has a centre by `I` and `J`, but `K` is given".into(),
            );
        }
        if let Some(turns) = block.number('P')?.filter(|p| *p != 1.0) {
            return Err(format!(
                "an arc of `P{turns}` turns is not supported, expected one block for each turn"
            ));
        }
        let sign = if is_clockwise { -1.0 } else { 1.0 };
        let centre = match (block.number('R')?, block.has_any("IJ")) {
            (Some(radius), false) => {
                let (radius, chord) = (radius * self.unit, way.norm());
                let height = radius * radius - 0.25 * chord * chord;
                if chord == 0.0 || height < -2.0 * radius.abs() * ROUNDING[1] {
                    return Err(format!(
                        "an arc of radius {radius} m does not reach over {chord} m"
                    ));
                }
                let left = Vector3::new(-way.y, way.x, 0.0) / chord;
                self.at + 0.5 * way + left * (sign * radius.signum() * height.max(0.0).sqrt())
            }
            (None, true) => {
                let [i, j] = ['I', 'J'].map(|letter| block.number(letter));
                self.at + Vector3::new(i?.unwrap_or(0.0), j?.unwrap_or(0.0), 0.0) * self.unit
            }
            _ => {
                return Err(
                    "an arc needs either its centre, `I` and `J`, or its radius `R`".into(),
                );
            }
        };
        let [from, end] = [self.at - centre, to - centre];
        let [first, last] = [from.norm(), end.norm()];
        let difference = (first - last).abs();
        if first == 0.0 || difference > (ROUNDING[0] * first).max(ROUNDING[1]) {
            let [first, last] = [first, last].map(|x| number(x, 5));
            return Err(format!(
                "the arc starts {first} m and ends {last} m from its centre"
            ));
        }
        let turned = end.y.atan2(end.x) - from.y.atan2(from.x);
        let angle = (sign * turned).rem_euclid(TAU);
        // back to where it starts: a whole turn
        let is_whole = way.norm() < ROUNDING[1] * 1e-3;
        Ok((centre, sign * if is_whole { TAU } else { angle }))
    }
}
