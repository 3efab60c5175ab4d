//! The current configuration of a body: where its points are now and how large they are.
//!
//! The [`World`] owns one configuration for each body. A physics that moves the points declares so at set-up
//! ([`Setup::move_points`](crate::Setup::move_points)) and sets positions and volumes through the [`PointMover`]
//! that it gets. Everybody else reads them ([`World::configuration`]). Where nobody moves the points, they lie at
//! their reference positions, displaced where the body has a `displacement`, and have their reference volumes.
//!
//! Families of such a body follow the points ([`World::family`]). Where their rows are found is decided when the
//! configuration is set, so that it does not depend on who asks for the family, and is saved with a checkpoint: the order
//! in which a family adds depends on it. Images and weights are computed when the family is asked for, once for each
//! version of the configuration.
//!
//! Which points of a body have material is part of its configuration, see [`crate::world::activity`].

use std::cell::{Cell, RefCell};
use std::sync::Arc;

use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::changes::{Change, Changes};
use super::facts::{Fact, FactRule};
use super::{BodyIndex, World};
use crate::field::keys;

/// Positions and volumes of the points of a body at one moment.
#[derive(Clone, Debug, Default)]
pub struct Configuration {
    positions: Vec<Vector3<f64>>,
    volumes: Vec<f64>,
    version: u64,
}

impl Configuration {
    /// Position of each point, m.
    pub fn positions(&self) -> &[Vector3<f64>] {
        &self.positions
    }

    /// Volume of each point, m³.
    pub fn volumes(&self) -> &[f64] {
        &self.volumes
    }

    /// Counter that changes whenever positions or volumes change.
    pub fn version(&self) -> u64 {
        self.version
    }

    fn replace(&mut self, positions: impl Iterator<Item = Vector3<f64>>, volumes: &[f64]) {
        self.positions.clear();
        self.positions.extend(positions);
        self.volumes.clear();
        self.volumes.extend_from_slice(volumes);
        self.version += 1;
    }
}

/// What the points of a body are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Description {
    /// Points move with the matter; families are those of their current positions.
    #[default]
    UpdatedLagrangian,
    /// Points are matter, too; families stay those of the reference configuration.
    TotalLagrangian,
    /// Points stay and matter flows through them.
    Eulerian,
    /// Matter flows through points that follow the walls of the fluid.
    ArbitraryLagrangianEulerian,
}

impl Description {
    /// Whether matter flows through the points.
    pub fn flows_through(self) -> bool {
        matches!(
            self,
            Description::Eulerian | Description::ArbitraryLagrangianEulerian
        )
    }
}

/// Permission of one physics to move the points of a body.
#[derive(Debug)]
pub struct PointMover {
    pub(crate) body: BodyIndex,
}

/// Current configuration of one body.
#[derive(Debug, Default)]
struct Current {
    /// `None` until somebody asks for it.
    configuration: RefCell<Option<Arc<Configuration>>>,
    /// Changes of the displacement that the configuration includes.
    displacement_seen: Cell<Option<u64>>,
    /// Shift of a window that it includes, m.
    shift_seen: Cell<Vector3<f64>>,
}

/// Configurations of all bodies.
#[derive(Debug, Default)]
pub(crate) struct Configurations(Vec<Current>);

impl Configurations {
    pub(crate) fn new(bodies: usize) -> Self {
        Configurations((0..bodies).map(|_| Current::default()).collect())
    }
}

impl Fact for Description {
    const SECOND: Option<FactRule> = Some(FactRule {
        key: "body",
        message: "`{first}` already decides where the points of body `{body}` are",
        expected: "one physics that moves the points or flows through them",
    });

    fn changes(&self) -> Changes {
        match self {
            Description::UpdatedLagrangian => Changes::of(&[Change::Motion]),
            Description::TotalLagrangian => Changes::NONE,
            Description::Eulerian => Changes::of(&[Change::Flow]),
            Description::ArbitraryLagrangianEulerian => {
                Changes::of(&[Change::Motion, Change::Flow])
            }
        }
    }
}

impl World {
    /// What the points of a body are: matter at rest or that of a solid, unless a physics says otherwise.
    pub fn description(&self, body: BodyIndex) -> Description {
        let published = self.fact::<Description>(body).copied();
        published.unwrap_or(Description::TotalLagrangian)
    }

    /// Whether a physics moves the points of a body with the matter, so that they change neighbours.
    pub(crate) fn moves_freely(&self, body: BodyIndex) -> bool {
        self.description(body) == Description::UpdatedLagrangian
    }

    /// Where the points of a body are now and how large they are. The values stay as they are when the configuration
    /// changes: ask again in each step.
    pub fn configuration(&self, body: BodyIndex) -> Arc<Configuration> {
        let current = &self.configurations.0[body];
        let changes = self.displacement_changes(body);
        let shift = self.window_shift(body);
        let mut configuration = current.configuration.borrow_mut();
        if let Some(configuration) = &*configuration
            && current.displacement_seen.get() == changes
            && current.shift_seen.get() == shift
        {
            return configuration.clone();
        }
        let mut now = configuration.take().unwrap_or_default();
        let points = &self.bodies[body].points;
        let displaced = self.displaced(body);
        let positions = (0..points.len()).map(|point| displaced(point) + shift);
        Arc::make_mut(&mut now).replace(positions, &points.volume);
        current.displacement_seen.set(changes);
        current.shift_seen.set(shift);
        *configuration = Some(now.clone());
        now
    }

    /// Where the points of a body are now, m: [`World::configuration`] as a list of its own, which nobody keeps.
    pub fn positions(&self, body: BodyIndex) -> Vec<Vector3<f64>> {
        let at = self.place_of_points(body);
        (0..self.bodies[body].points.len()).map(at).collect()
    }

    /// Where each point of a body is now, m: [`World::positions`] one by one.
    pub fn place_of_points(&self, body: BodyIndex) -> Box<dyn Fn(usize) -> Vector3<f64> + '_> {
        if self.moves_freely(body) {
            let now = self.configuration(body);
            return Box::new(move |point| now.positions()[point]);
        }
        let shift = self.window_shift(body);
        let displaced = self.displaced(body);
        Box::new(move |point| displaced(point) + shift)
    }

    /// Where the points of a body are now, if a physics moves them: points of an updated Lagrangian fluid, and those that
    /// follow the walls of one. `None` for points at rest and for solids, whose sources and boundaries act on the
    /// reference configuration.
    pub fn moving_points(&self, body: BodyIndex) -> Option<Arc<Configuration>> {
        let moves = self.changes[body].contains(Change::Motion);
        moves.then(|| self.configuration(body))
    }

    /// The time level of the current positions of a body (s): that to which its `displacement` was advanced.
    pub fn time_of_points(&self, body: BodyIndex) -> f64 {
        let field = self.fields.find(body, &keys::DISPLACEMENT.name);
        field.map_or(0.0, |field| self.time_of_field(field))
    }

    /// How often the displacement of a body changed; `None` without displacement, and where a physics sets the
    /// configuration.
    fn displacement_changes(&self, body: BodyIndex) -> Option<u64> {
        let field = self.displacement_field(body);
        field.map(|index| self.fields.field(index).changes())
    }

    /// The displacement of a body, unless a physics sets the configuration.
    fn displacement_field(&self, body: BodyIndex) -> Option<usize> {
        let field = self.fields.find(body, &keys::DISPLACEMENT.name);
        field.filter(|_| !self.moves_freely(body))
    }

    /// Reference position of each point of a body plus its displacement, m.
    fn displaced(&self, body: BodyIndex) -> impl Fn(usize) -> Vector3<f64> + '_ {
        let reference = &self.bodies[body].points.position;
        let field = self.displacement_field(body);
        let displacement = field.map(|index| self.fields.field(index).data());
        move |point| match &displacement {
            None => reference.at(point),
            Some(displacement) => {
                let of_point = &displacement.flat()[3 * point..3 * point + 3];
                reference.at(point) + Vector3::from_column_slice(of_point)
            }
        }
    }

    /// Sets positions (m) and volumes (m³) of the points of a body. Families that follow them change with them.
    ///
    /// # Panics
    /// When there is not one position and one volume for each point.
    pub fn set_configuration(
        &self,
        mover: &PointMover,
        positions: &[Vector3<f64>],
        volumes: &[f64],
    ) {
        let points = self.bodies[mover.body].points.len();
        assert_eq!([positions.len(), volumes.len()], [points; 2]);
        let mut current = self.configurations.0[mover.body].configuration.borrow_mut();
        let mut now = current.take().unwrap_or_default();
        Arc::make_mut(&mut now).replace(positions.iter().copied(), volumes);
        *current = Some(now);
        self.follow_points(mover.body, positions);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::Body;
    use crate::family::{Correction, Family, FamilySpec};
    use crate::setup::Setup;
    use crate::shape::{BoxShape, Shape};
    use std::path::Path;

    fn world() -> World {
        let shape = Shape::Box(BoxShape {
            min: [0.0; 3],
            max: [0.8, 0.6, 0.1],
        });
        let body = Body::fill("block", &shape, 2, 0.1, 0.5).expect("valid");
        World::new(vec![body])
    }

    fn spec() -> FamilySpec {
        FamilySpec {
            correction: Correction::None,
            ..FamilySpec::new(0.25)
        }
    }

    #[test]
    fn a_family_of_moving_points_is_refused_where_the_plugin_needs_points_at_rest() {
        let mut world = world();
        let mut setup = Setup::new(&mut world, Path::new("."));
        setup.next_physics("water");
        let moves = Description::UpdatedLagrangian;
        setup.publish(0, moves).expect("the first one");
        let plugin = setup.add_plugin("heat", true, Changes::NONE);
        setup.enter(plugin);
        let error = setup.family(0, &spec()).expect_err("at rest").to_string();
        assert!(
            error.contains("`water` moves the points of body `block`"),
            "{error}"
        );
    }

    #[test]
    fn moving_families_are_shared_and_follow_the_configuration() {
        let mut world = world();
        let mut setup = Setup::new(&mut world, Path::new("."));
        setup.next_physics("water");
        let moves = Description::UpdatedLagrangian;
        setup.publish(0, moves).expect("the first one");
        let mover = setup.move_points(0);
        let family = setup.family(0, &spec()).expect("valid");
        assert_eq!(setup.family(0, &spec()).expect("valid"), family);
        assert_eq!(setup.world().families().count(), 1);
        setup.finish().expect("complete");

        let before = world.configuration(0);
        let moved = before.positions().iter();
        let moved: Vec<_> = moved.map(|x| x + Vector3::x() * 2.0 * x.y).collect();
        let held = world.family(family);
        world.set_configuration(&mover, &moved, before.volumes());
        let now = world.configuration(0);
        assert_ne!(before.version(), now.version());
        assert_eq!(now.positions(), &moved[..]);
        // the family that is held stays as it was
        let body = world.body(0).clone();
        let bonds = |family: &Family| {
            let of = |point| {
                let mut sum = 0.0;
                family.for_each_bond(point, |_, bond, _| sum += bond.weight * bond.xi[0].abs());
                sum
            };
            (0..body.points.len()).map(of).collect::<Vec<f64>>()
        };
        let at_rest = bonds(&Family::moving(&body, &spec()).expect("valid"));
        assert_eq!(bonds(&held), at_rest);
        let mut sheared = body.clone();
        sheared.points.position = moved.into();
        let expected = bonds(&Family::moving(&sheared, &spec()).expect("valid"));
        assert_eq!(bonds(&world.family(family)), expected);
        drop(held);
        assert_eq!(bonds(&world.family(family)), expected);
    }

    #[test]
    fn solids_lie_where_their_displacement_puts_them() {
        let mut world = world();
        let mut setup = Setup::new(&mut world, Path::new("."));
        setup.next_plugin("solid");
        let displacement = setup.own(0, &keys::DISPLACEMENT).expect("free");
        setup.finish().expect("complete");
        let before = world.configuration(0);
        assert_eq!(before.positions(), &world.body(0).points.position[..]);
        assert_eq!(before.version(), world.configuration(0).version());
        world.write(displacement)[3] = Vector3::new(0.1, 0.2, 0.0);
        let now = world.configuration(0);
        assert_ne!(before.version(), now.version());
        assert_eq!(now.positions(), &world.positions(0)[..]);
        assert_ne!(now.positions()[3], before.positions()[3]);
    }
}
