//! Heat exchange between two bodies in contact.
//!
//! Cell faces of the two bodies that lie against each other exchange
//!
//! ```text
//! P_ij = A_ij (T_j - T_i) / (d_i / k_i + 1 / h + d_j / k_j)     W
//! ```
//!
//! over their present overlap A_ij: the resistances from the points to the surface, with the conductivity k of each side, in
//! series with the contact of conductance h (W/(m² K)); without h the contact is perfect. The distance d is half a cell, or
//! the depth that the family of the body has ([`World::surface_depths`]). The series is the harmonic mean of the
//! conductivities, exact for steady flux across the interface. For each pair, one body receives at the same time what the
//! other one loses, so that heat is conserved to rounding for any step sizes.
//!
//! Bodies may be at rest, deform or slide; faces keep the direction of their normals, so that bodies must not
//! rotate by more than a few degrees. Cells of different size may meet.

mod side;

use perimelt_core::body::NO_POINT;
use perimelt_core::cell_list::CellList;
use perimelt_core::numbers::check_positive;
use perimelt_core::text::number;
use perimelt_core::world::BodyIndex;
use perimelt_core::world::facts::Fact;
use perimelt_core::{
    Body, Coupler, Prepared, Report, RunError, RunningCoupler, Setup, SetupError, Step, World,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use side::Side;

/// Fraction of the time constant of the exchange that a step may take.
const STEP_FRACTION: f64 = 0.5;

/// Two bodies that touch exchange heat.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HeatInterface {
    /// One body.
    pub body: String,
    /// The other body.
    pub other: String,
    /// Contact conductance, W/(m² K); left out: perfect contact.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub conductance: Option<f64>,
    /// Largest distance of two surfaces in contact, m; left out: half of the smaller spacing. Steps of inclined and curved
    /// surfaces stand for what lies up to half a spacing of each body beside them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub gap: Option<f64>,
}

/// A body exchanges heat with another one.
struct Touched {
    other: BodyIndex,
}

impl Fact for Touched {}

/// An interface that is ready to exchange heat.
struct RunningHeatInterface {
    sides: [Side; 2],
    dimension: usize,
    /// Contact resistance 1 / h, m² K/W.
    resistance: f64,
    /// m.
    gap: f64,
    cells: CellList,
    overlaps: Vec<Overlap>,
    /// Power from the other body into the first one in the last step, W.
    power: f64,
}

/// Two cell faces in contact, by their index in the lists of both sides.
#[derive(Clone, Copy, Debug)]
struct Overlap {
    cells: [u32; 2],
    /// m².
    area: f64,
}

impl RunningHeatInterface {
    /// Finds the cell faces that lie against each other, if any point has moved.
    fn follow(&mut self, world: &World) {
        for side in &mut self.sides {
            side.find_depths(world);
            side.gather(world);
        }
        if self.sides.iter().any(|side| side.moved) {
            self.find_overlaps();
            self.sides.iter_mut().for_each(|side| side.moved = false);
        }
    }

    /// Finds the cell faces of the bodies that lie against each other.
    fn find_overlaps(&mut self) {
        let [first, second] = &self.sides;
        let cells = self.sides.each_ref().map(|side| &side.surface.cells);
        let spacing = |k: usize, cell: usize| self.sides[k].spacing(&cells[k][cell]);
        let reach = |k: usize, cell: usize| {
            let s = spacing(k, cell);
            let distance = cells[k][cell].contact_distance([s, s], true);
            self.gap.max(distance) + s
        };
        let reaches: Vec<f64> = (0..cells[1].len()).map(|c| reach(1, c)).collect();
        self.cells.update(&second.centre, &reaches);
        self.overlaps.clear();
        for (a, cell) in cells[0].iter().enumerate() {
            let centre = first.centre[a];
            let opposite = cell.face.opposite();
            let normal = cell.face.axis();
            let start = self.overlaps.len();
            let overlaps = &mut self.overlaps;
            self.cells.visit_near(&centre, reach(0, a), |b| {
                let between = second.centre[b] - centre;
                let (sa, sb) = (spacing(0, a), spacing(1, b));
                let other = &cells[1][b];
                let gap = match cell.is_step() && other.is_step() {
                    true => self.gap.max(cell.contact_distance([sa, sb], true)),
                    false => self.gap,
                };
                if other.face != opposite || between[normal].abs() > gap {
                    return;
                }
                let fraction = (0..self.dimension)
                    .filter(|axis| *axis != normal)
                    .map(|axis| {
                        let common = 0.5 * (sa + sb) - between[axis].abs();
                        common.clamp(0.0, sa.min(sb)) / sa
                    });
                // of the part of the cell of the other body that is bare
                let whole = second.surface.volume[other.point as usize] / sb;
                let bare = other.face_area / whole;
                // steps of an inclined interface stand for a smaller area
                let true_area = 0.5 * (cell.cosine() + other.cosine());
                let area = fraction.product::<f64>() * cell.face_area * bare * true_area;
                if area > 0.0 {
                    let cells = [a as u32, b as u32];
                    overlaps.push(Overlap { cells, area });
                }
            });
            self.overlaps[start..].sort_unstable_by_key(|o| o.cells[1]);
        }
    }

    fn exchange(&mut self, world: &World) {
        let [first, second] = &self.sides;
        let mut sources = [first, second].map(|side| world.write(side.heat_source));
        let mut conductances = [first, second].map(|side| world.write(side.heat_conductance));
        self.power = 0.0;
        for overlap in &self.overlaps {
            let places: [usize; 2] = std::array::from_fn(|k| {
                self.sides[k].surface.cells[overlap.cells[k] as usize].point as usize
            });
            let [own, other] = [0, 1].map(|k| self.sides[k].points[places[k]].temperature);
            let [here, there] = [0, 1].map(|k| self.sides[k].resistance(overlap.cells[k]));
            let conductance = overlap.area / (here + self.resistance + there);
            let power = conductance * (other - own);
            for (k, sign) in [1.0, -1.0].into_iter().enumerate() {
                let side = &self.sides[k];
                let point = side.own[places[k]];
                if point != NO_POINT {
                    let volume = side.surface.volume[places[k]];
                    sources[k][point as usize] += sign * power / volume;
                    conductances[k][point as usize] += conductance / volume;
                }
            }
            self.power += power;
        }
    }
}

/// Overlap of the boxes of two bodies, m; negative for boxes that are apart.
fn depth_of_overlap([one, other]: [&Body; 2]) -> f64 {
    let ((low, high), (other_low, other_high)) = (one.bounds(), other.bounds());
    let along = |a: usize| high[a].min(other_high[a]) - low[a].max(other_low[a]);
    (0..one.dimension).map(along).fold(f64::INFINITY, f64::min)
}

impl HeatInterface {
    fn check(&self) -> Result<(), SetupError> {
        check_positive("conductance", self.conductance, "W/(m² K)")?;
        check_positive("gap", self.gap, "m")?;
        match self.body == self.other {
            true => {
                let message = format!("`body` and `other` are both `{}`", self.body);
                Err(SetupError::value("other", message, "another body"))
            }
            false => Ok(()),
        }
    }
}

#[typetag::serialize(name = "heat_interface")]
impl Coupler for HeatInterface {
    fn prepare(self: Box<Self>, setup: &mut Setup<'_>) -> Prepared<dyn RunningCoupler> {
        self.check()?;
        let body = setup.find_body(Some(&self.body))?;
        let other = setup.find_body(Some(&self.other)).map_err(|e| SetupError {
            key: "other".into(),
            ..e
        })?;
        if setup.facts::<Touched>(body).any(|t| t.other == other) {
            let message = format!("`{}` and `{}` already exchange heat", self.body, self.other);
            let expected = "one `heat_interface` for two bodies";
            return Err(SetupError::value("other", message, expected));
        }
        for (body, other) in [(body, other), (other, body)] {
            setup.publish(body, Touched { other })?;
        }
        let dimensions = [body, other].map(|b| setup.body(b).dimension);
        if dimensions[0] != dimensions[1] {
            let message = format!(
                "a {}D body cannot touch a {}D body",
                dimensions[0], dimensions[1]
            );
            return Err(SetupError::value(
                "other",
                message,
                "bodies of one dimension",
            ));
        }
        let spacings = [body, other].map(|b| setup.body(b).finest_spacing());
        let gap = self.gap.unwrap_or(0.5 * spacings[0].min(spacings[1]));
        let mut interface = RunningHeatInterface {
            sides: [Side::new(setup, body)?, Side::new(setup, other)?],
            dimension: dimensions[0],
            resistance: self.conductance.map_or(0.0, |h| 1.0 / h),
            gap,
            cells: CellList::default(),
            overlaps: Vec::new(),
            power: 0.0,
        };
        interface.find_overlaps();
        if interface.overlaps.is_empty() {
            let names = format!("`{}` and `{}`", self.body, self.other);
            let depth = depth_of_overlap([body, other].map(|b| setup.body(b)));
            setup.warn(match depth > gap {
                true => format!(
                    "{names} overlap by {} m, and no faces of their cells touch: the bodies exchange no heat",
                    number(depth, 3)
                ),
                false => format!(
                    "at the start no faces of cells of {names} touch within `gap`, {gap} m: \
                     the bodies exchange no heat before they do"
                ),
            });
        }
        Ok(Box::new(interface))
    }
}

impl RunningCoupler for RunningHeatInterface {
    fn apply(&mut self, world: &World, _step: Step) -> Result<(), RunError> {
        self.follow(world);
        self.exchange(world);
        Ok(())
    }

    /// Half of the shortest time constant of a cell whose whole face is in contact.
    fn stable_step(&mut self, world: &World) -> Option<f64> {
        self.sides
            .iter_mut()
            .for_each(|side| side.find_depths(world));
        let constant = |k: usize| {
            let of_other = self.sides[1 - k].least_resistance(world);
            self.sides[k].least_time_constant(world, self.resistance + of_other)
        };
        Some(STEP_FRACTION * constant(0).min(constant(1)))
    }

    fn report(&self) -> Vec<Report> {
        let area = self.overlaps.iter().map(|o| o.area).sum();
        vec![
            Report::new("power into the body", "W", self.power),
            Report::new("area", "m2", area),
        ]
    }
}

perimelt_core::register_coupler!("heat_interface", HeatInterface, supports: [Motion, Flow, Division]);

#[cfg(test)]
mod tests;
