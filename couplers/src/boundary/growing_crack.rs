//! A straight crack through the thickness of a 2D body that grows at a given speed and insulates.
//!
//! Bonds that cross it end when its tip has passed them, for the `thermal` of the body (`broken_bonds = "insulate"`). It
//! carries load: cracks that grow by load are those of `fracture` of a `mechanical`. Points must not lie on its line.
//!
//! A body may have several; a crack that grows both ways from a place is two of them.

use nalgebra::Vector3;
use perimelt_core::cell_list::CellList;
use perimelt_core::numbers::check_at_least;
use perimelt_core::world::BondBreaker;
use perimelt_core::{
    Body, Coupler, Horizon, LoadError, Prepared, Report, RunError, RunningCoupler, SavedState,
    Setup, SetupError, Step, World,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A crack that grows along a line at a given speed.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GrowingCrack {
    /// Body; may be left out when there is one only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<String>,
    /// Where it begins, x and y (m).
    pub from: [f64; 2],
    /// Where it ends when fully grown, x and y (m).
    pub to: [f64; 2],
    /// Speed of the tip (m/s).
    #[schemars(extend("minimum" = 0))]
    pub speed: f64,
    /// When it begins to grow (s).
    #[serde(default)]
    pub start_time: f64,
    /// Longest bond that it can cross, in spacings of the end with the larger ones: not below the horizon.
    #[serde(default = "usual_reach")]
    #[schemars(extend("minimum" = 1))]
    pub reach: f64,
}

fn usual_reach() -> f64 {
    4.0
}

/// A crack that is ready to grow.
struct RunningGrowingCrack {
    speed: f64,
    start_time: f64,
    breaker: BondBreaker,
    /// Pairs whose bond crosses the line, with the distance from its beginning (m), in the order of growth.
    crossings: Vec<(f64, [u32; 2])>,
    /// Number of pairs whose bond is broken.
    broken: usize,
    /// Present length, m.
    length: f64,
}

impl GrowingCrack {
    fn check(&self) -> Result<(), SetupError> {
        if self.from == self.to || self.from.iter().chain(&self.to).any(|x| !x.is_finite()) {
            let message = "`from` and `to` are the same point, or not finite";
            return Err(SetupError::value(
                "to",
                message,
                "a finite position other than `from`",
            ));
        }
        check_at_least("speed", self.speed, 0.0, "m/s")?;
        check_at_least("start_time", self.start_time, 0.0, "s")?;
        check_at_least("reach", self.reach, 1.0, "spacing")?;
        Ok(())
    }

    /// Pairs of points whose connection crosses the line.
    fn crossings(&self, body: &Body) -> Vec<(f64, [u32; 2])> {
        let [from, to] = [self.from, self.to].map(|[x, y]| Vector3::new(x, y, 0.0));
        let length = (to - from).norm();
        let along = (to - from) / length;
        let across = Vector3::new(-along.y, along.x, 0.0);
        let positions = &body.points.position;
        let reach = body.points.horizons(Horizon::Spacings(self.reach));
        let list = CellList::new(positions, &reach);
        // a bond is as long as the larger of two horizons
        let widest = reach.iter().copied().fold(0.0, f64::max);
        let mut found = Vec::new();
        for (point, at) in positions.iter().enumerate() {
            let height = across.dot(&(at - from));
            if height.abs() > widest {
                continue;
            }
            list.visit_near(at, reach[point], |other| {
                let above = across.dot(&(positions[other] - from));
                let distance = (positions[other] - at).norm();
                if height < 0.0 && above >= 0.0 && distance <= reach[point].max(reach[other]) {
                    let share = -height / (above - height);
                    let place = along.dot(&(at + share * (positions[other] - at) - from));
                    if (0.0..=length).contains(&place) {
                        found.push((place, [point as u32, other as u32]));
                    }
                }
            });
        }
        found.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        found
    }
}

#[typetag::serialize(name = "growing_crack")]
impl Coupler for GrowingCrack {
    fn prepare(self: Box<Self>, setup: &mut Setup<'_>) -> Prepared<dyn RunningCoupler> {
        self.check()?;
        let body = setup.find_body(self.body.as_deref())?;
        if setup.body(body).dimension != 2 {
            let message = "a crack that grows is a line in a 2D body";
            return Err(SetupError::value("body", message, "a 2D body"));
        }
        let mut crossings = self.crossings(setup.body(body));
        let reducer = setup.world().reducer(body);
        crossings.retain(|(_, pair)| pair.iter().any(|p| (*p as usize) < reducer.owned()));
        if !reducer.any(!crossings.is_empty()) {
            let message = "no bond crosses the crack";
            return Err(SetupError::value(
                "from",
                message,
                "a line through the body",
            ));
        }
        Ok(Box::new(RunningGrowingCrack {
            speed: self.speed,
            start_time: self.start_time,
            breaker: setup.break_bonds(body, true)?,
            crossings,
            broken: 0,
            length: 0.0,
        }))
    }
}

impl RunningGrowingCrack {
    /// Breaks the pairs up to the tip that are not broken yet.
    fn break_pairs(&mut self, world: &World) {
        let crossed = self
            .crossings
            .partition_point(|(place, _)| *place <= self.length);
        if self.broken < crossed {
            let new = self.crossings[self.broken..crossed].iter();
            world.break_pairs(&self.breaker, new.map(|(_, pair)| *pair));
            self.broken = crossed;
        }
    }
}

impl RunningCoupler for RunningGrowingCrack {
    fn apply(&mut self, world: &World, step: Step) -> Result<(), RunError> {
        self.length = self.speed * (step.end() - self.start_time).max(0.0);
        self.break_pairs(world);
        Ok(())
    }

    fn report(&self) -> Vec<Report> {
        vec![Report::new("length", "m", self.length)]
    }

    fn save(&self, _world: &World) -> Box<dyn erased_serde::Serialize + '_> {
        Box::new(self.length)
    }

    /// The first step of a run that goes on sees the crack already.
    fn load(&mut self, world: &World, state: SavedState<'_, '_>) -> Result<(), LoadError> {
        self.length = erased_serde::deserialize(state)?;
        self.break_pairs(world);
        Ok(())
    }
}

perimelt_core::register_coupler!("growing_crack", GrowingCrack, supports: [Division]);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{STEEL, block, prepare, read, refusal};

    #[test]
    fn pairs_break_when_the_tip_has_passed_them() {
        let mut world = World::new(vec![block([4, 4, 1], 2, STEEL)]);
        let crack: GrowingCrack = read("from = [0, 2]\nto = [3, 2]\nspeed = 1\nreach = 1");
        let (mut crack, _) = prepare(&mut world, crack, |_| ()).expect("valid");
        let mut broken = Vec::new();
        for second in 0..5 {
            let step = Step::new(f64::from(second), 1.0);
            crack.apply(&world, step).expect("applies");
            broken.push(world.broken_pairs(0).pairs.clone());
        }
        // columns at 0.5, 1.5, 2.5; rows below and above y = 2
        assert_eq!(broken[0], [[4, 8]]);
        assert_eq!(broken[1], [[4, 8], [5, 9]]);
        assert_eq!(broken[2], [[4, 8], [5, 9], [6, 10]]);
        assert_eq!(broken[4].len(), 3);
    }

    #[test]
    fn a_run_that_goes_on_begins_with_the_crack() {
        let prepared = || {
            let mut world = World::new(vec![block([4, 4, 1], 2, STEEL)]);
            let crack: GrowingCrack = read("from = [0, 2]\nto = [3, 2]\nspeed = 1\nreach = 1");
            let (crack, _) = prepare(&mut world, crack, |_| ()).expect("valid");
            (world, crack)
        };
        let (world, mut crack) = prepared();
        crack.apply(&world, Step::new(0.0, 2.0)).expect("applies");
        let saved = serde_json::to_string(&crack.save(&world)).expect("saved");
        let (after, mut goes_on) = prepared();
        let mut source = serde_json::Deserializer::from_str(&saved);
        let mut state = <dyn erased_serde::Deserializer<'_>>::erase(&mut source);
        goes_on.load(&after, &mut state).expect("loaded");
        let pairs = |world: &World| world.broken_pairs(0).pairs.clone();
        assert_eq!(pairs(&world), [[4, 8], [5, 9]]);
        assert_eq!(pairs(&after), pairs(&world));
    }

    #[test]
    fn several_cracks_grow_on_one_body() {
        let mut world = World::new(vec![block([4, 4, 1], 2, STEEL)]);
        let cracks: [GrowingCrack; 2] = [
            read("from = [2, 2]\nto = [4, 2]\nspeed = 1\nreach = 1"),
            read("from = [2, 2]\nto = [0, 2]\nspeed = 2\nreach = 1"),
        ];
        let mut setup = Setup::new(&mut world, std::path::Path::new("."));
        let mut cracks = cracks.map(|crack| {
            setup.next_plugin("a crack");
            let crack = Box::new(crack).prepare(&mut setup);
            crack.expect("cracks share a body")
        });
        setup.next_plugin("fracture");
        let message = setup.break_bonds(0, false).expect_err("taken").to_string();
        assert!(
            message.contains("`a crack` already breaks bonds of body `block`"),
            "{message}"
        );
        setup.finish().expect("complete");
        let mut broken = Vec::new();
        for second in 0..3 {
            for crack in &mut cracks {
                let step = Step::new(f64::from(second), 1.0);
                crack.apply(&world, step).expect("applies");
            }
            let mut pairs = world.broken_pairs(0).pairs.clone();
            pairs.iter_mut().for_each(|pair| pair.sort_unstable());
            broken.push(pairs);
        }
        assert_eq!(broken[0], [[6, 10], [5, 9], [4, 8]]);
        assert_eq!(broken[1], [[6, 10], [5, 9], [4, 8], [7, 11]]);
        assert_eq!(broken[2].len(), 4);
    }

    #[test]
    fn a_crack_rests_until_its_start() {
        let mut world = World::new(vec![block([4, 4, 1], 2, STEEL)]);
        let crack: GrowingCrack =
            read("from = [0, 2]\nto = [3, 2]\nspeed = 1\nreach = 1\nstart_time = 2");
        let (mut crack, _) = prepare(&mut world, crack, |_| ()).expect("valid");
        for (start, length) in [(0.0, 0.0), (1.0, 0.0), (2.0, 1.0), (3.0, 2.0)] {
            crack.apply(&world, Step::new(start, 1.0)).expect("applies");
            assert_eq!(crack.report()[0].value, length);
            assert_eq!(world.broken_pairs(0).pairs.len(), length as usize);
        }
    }

    #[test]
    fn a_slanted_crack_breaks_what_it_crosses() {
        // between the diagonal i + j = 2 and the next one; below i = j
        for (keys, expected) in [
            (
                "from = [0, 3.5]\nto = [3.5, 0]",
                [[2, 3], [2, 6], [5, 6], [5, 9], [8, 9], [8, 12]],
            ),
            (
                "from = [0.5, 0]\nto = [4, 3.5]",
                [[0, 1], [1, 5], [5, 6], [6, 10], [10, 11], [11, 15]],
            ),
        ] {
            let crack: GrowingCrack = read(&format!("{keys}\nspeed = 1\nreach = 1"));
            let found = crack.crossings(&block([4, 4, 1], 2, STEEL));
            let mut pairs: Vec<[u32; 2]> = found.iter().map(|(_, pair)| *pair).collect();
            pairs.iter_mut().for_each(|pair| pair.sort_unstable());
            pairs.sort_unstable();
            assert_eq!(pairs, expected, "{keys}");
        }
    }

    #[test]
    fn a_crack_that_cannot_be_is_refused() {
        for (keys, key) in [
            ("from = [0, 2]\nto = [0, 2]\nspeed = 1", "to"),
            ("from = [0, 2]\nto = [3, 2]\nspeed = -1", "speed"),
            ("from = [0, 9]\nto = [3, 9]\nspeed = 1", "from"),
            ("from = [0, inf]\nto = [3, 2]\nspeed = 1", "to"),
            ("from = [0, 2]\nto = [3, 2]\nspeed = inf", "speed"),
            (
                "from = [0, 2]\nto = [3, 2]\nspeed = 1\nstart_time = -1",
                "start_time",
            ),
            (
                "from = [0, 2]\nto = [3, 2]\nspeed = 1\nreach = 0.9",
                "reach",
            ),
        ] {
            let mut world = World::new(vec![block([4, 4, 1], 2, STEEL)]);
            assert!(
                refusal(&mut world, read::<GrowingCrack>(keys)).starts_with(key),
                "{keys}"
            );
        }
    }

    /// Bonds as long as the reach of the longer of two cross the crack; with a reach of 2 those of the next rows, too.
    #[test]
    fn bonds_up_to_the_reach_are_broken() {
        for (reach, expected) in [(1.0, 4), (1.4, 4), (1.5, 4 + 6), (2.0, 4 + 6 + 2 * 4)] {
            let keys = format!("from = [0, 2]\nto = [4, 2]\nspeed = 1\nreach = {reach}");
            let crack: GrowingCrack = read(&keys);
            let found = crack.crossings(&block([4, 4, 1], 2, STEEL));
            assert_eq!(found.len(), expected, "{reach}");
            let crack: GrowingCrack = read(&keys);
            let mut solid = World::new(vec![block([4, 4, 4], 3, STEEL)]);
            assert!(refusal(&mut solid, crack).starts_with("body: "));
        }
    }
}
