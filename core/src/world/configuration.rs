//! The current configuration of a body: where its points are now and how large they are.
//!
//! The [`World`] owns one configuration for each body. A physics that moves the points declares so at set-up
//! ([`Setup::move_points`](crate::Setup::move_points)) and sets positions and volumes through the [`PointMover`]
//! that it gets. Everybody else reads them ([`World::configuration`]). Where nobody moves the points, they lie at
//! their reference positions, displaced where the body has a `displacement`, and have their reference volumes.
//!
//! Families that follow the points ([`Setup::moving_family`](crate::Setup::moving_family)) belong to the world, too.
//! Where their rows are found is decided when the configuration is set, so that it does not depend on who asks for
//! the family, and is saved with a checkpoint: the order in which a family adds depends on it. Images and weights
//! are computed when the family is asked for, once for each version of the configuration.
//!
//! Which points of a body that grows have material already is part of its configuration, see [`crate::world::activity`].

use std::cell::{Cell, RefCell};
use std::sync::Arc;

use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::activity::Grower;
use super::{BodyIndex, World};
use crate::body::Body;
use crate::family::{Family, FamilyError, FamilySpec, must_look_again, skin};
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

/// A family that follows the points of a body, owned by the [`World`].
#[derive(Clone, Copy, Debug)]
pub struct MovingFamily(pub(crate) usize);

/// Current configuration of one body.
#[derive(Debug, Default)]
struct Current {
    /// `None` until somebody asks for it.
    configuration: RefCell<Option<Arc<Configuration>>>,
    /// Changes of the displacement that the configuration includes.
    displacement_seen: Cell<Option<u64>>,
    /// Shift of a window that it includes, m.
    shift_seen: Cell<Vector3<f64>>,
    /// The plugin that moves the points, by its position in the set-up.
    mover: Option<usize>,
    /// The plugin whose matter flows through the points, and how it describes them.
    flow: Option<(usize, Description)>,
    /// A plugin that was told that the points are matter at rest.
    told_at_rest: Option<usize>,
}

/// A family that follows its points.
#[derive(Debug)]
struct Follower {
    body: BodyIndex,
    spec: FamilySpec,
    /// m.
    skin: f64,
    state: RefCell<FollowerState>,
}

#[derive(Debug)]
struct FollowerState {
    family: Arc<Family>,
    /// Positions at which the rows are to be found, m.
    found_at: Vec<Vector3<f64>>,
    /// Whether the family has other rows.
    has_old_rows: bool,
    /// Version of the configuration for which the family was last placed.
    placed_for: u64,
}

/// Configurations of all bodies and the families that follow them.
#[derive(Debug, Default)]
pub(crate) struct Configurations {
    bodies: Vec<Current>,
    followers: Vec<Follower>,
    /// Families of bodies that grow.
    pub(crate) growers: Vec<Grower>,
}

impl Configurations {
    pub(crate) fn new(bodies: usize) -> Self {
        Configurations {
            bodies: (0..bodies).map(|_| Current::default()).collect(),
            ..Configurations::default()
        }
    }

    /// The plugin that moves the points of a body.
    pub(crate) fn mover(&self, body: BodyIndex) -> Option<usize> {
        self.bodies[body].mover
    }

    /// The plugin that moves the points of a body or whose matter flows through them.
    pub(crate) fn owner(&self, body: BodyIndex) -> Option<usize> {
        let current = &self.bodies[body];
        current.mover.or(self.flow_owner(body))
    }

    /// Whether a physics moves the points of a body through space, with matter or along walls.
    pub(crate) fn moves_points(&self, body: BodyIndex) -> bool {
        let current = &self.bodies[body];
        let follows_walls =
            |(_, description)| description == Description::ArbitraryLagrangianEulerian;
        current.mover.is_some() || current.flow.is_some_and(follows_walls)
    }

    pub(crate) fn set_mover(&mut self, body: BodyIndex, plugin: usize) -> PointMover {
        self.bodies[body].mover = Some(plugin);
        PointMover { body }
    }

    pub(crate) fn set_flow(
        &mut self,
        body: BodyIndex,
        (plugin, description): (usize, Description),
    ) {
        self.bodies[body].flow = Some((plugin, description));
    }

    /// The plugin whose matter flows through the points of a body.
    pub(crate) fn flow_owner(&self, body: BodyIndex) -> Option<usize> {
        self.bodies[body].flow.map(|(plugin, _)| plugin)
    }

    /// A plugin that was told that the points are matter at rest.
    pub(crate) fn told_at_rest(&self, body: BodyIndex) -> Option<usize> {
        self.bodies[body].told_at_rest
    }

    /// What the points of a body are, as far as it was declared, for `plugin`.
    pub(crate) fn description(&mut self, body: BodyIndex, plugin: usize) -> Description {
        let current = &mut self.bodies[body];
        match (current.mover, current.flow) {
            (Some(_), _) => Description::UpdatedLagrangian,
            (None, Some((_, description))) => description,
            (None, None) => {
                current.told_at_rest.get_or_insert(plugin);
                Description::TotalLagrangian
            }
        }
    }

    /// A family of these points; equal requests share one.
    pub(crate) fn follow(
        &mut self,
        (index, body): (BodyIndex, &Body),
        spec: &FamilySpec,
    ) -> Result<MovingFamily, FamilyError> {
        let same = |f: &Follower| f.body == index && f.spec == *spec;
        if let Some(present) = self.followers.iter().position(same) {
            return Ok(MovingFamily(present));
        }
        let state = FollowerState {
            family: Arc::new(Family::moving(body, spec)?),
            found_at: body.points.position.clone(),
            has_old_rows: false,
            placed_for: 0,
        };
        self.followers.push(Follower {
            body: index,
            spec: spec.clone(),
            skin: skin(body),
            state: RefCell::new(state),
        });
        Ok(MovingFamily(self.followers.len() - 1))
    }

    /// All families with their bodies.
    pub(crate) fn families(&self) -> impl Iterator<Item = (BodyIndex, Arc<Family>)> {
        let families = self.followers.iter();
        let families = families.map(|f| (f.body, f.state.borrow().family.clone()));
        families.chain(self.growers.iter().map(Grower::family))
    }
}

impl FollowerState {
    /// Brings the family up to date. Whoever still holds it keeps the family as it was.
    fn place(&mut self, (body, spec): (&Body, &FamilySpec), now: &Configuration) {
        if Arc::get_mut(&mut self.family).is_none() {
            let fresh = Family::moving(body, spec).expect("the same family was built at set-up");
            (self.family, self.has_old_rows) = (Arc::new(fresh), true);
        }
        let family = Arc::get_mut(&mut self.family).expect("nobody else has it");
        if self.has_old_rows {
            family.look_from(&self.found_at);
            self.has_old_rows = false;
        }
        family.place_at(&now.positions, &now.volumes);
        self.placed_for = now.version;
    }
}

impl World {
    /// Where the points of a body are now and how large they are. The values stay as they are when the configuration
    /// changes: ask again in each step.
    pub fn configuration(&self, body: BodyIndex) -> Arc<Configuration> {
        let current = &self.configurations.bodies[body];
        let changes = self.displacement_changes(body, current.mover);
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
        let positions = match changes {
            None => points.position.clone(),
            Some(_) => self.displaced(body),
        };
        let positions = positions.into_iter().map(|x| x + shift);
        Arc::make_mut(&mut now).replace(positions, &points.volume);
        current.displacement_seen.set(changes);
        current.shift_seen.set(shift);
        *configuration = Some(now.clone());
        now
    }

    /// Where the points of a body are now, if a physics moves them: points of an updated Lagrangian fluid, and those that
    /// follow the walls of one. `None` for points at rest and for solids, whose sources and boundaries act on the
    /// reference configuration.
    pub fn moving_points(&self, body: BodyIndex) -> Option<Arc<Configuration>> {
        self.configurations
            .moves_points(body)
            .then(|| self.configuration(body))
    }

    /// The time level of the current positions of a body (s): that to which its `displacement` was advanced.
    pub fn time_of_points(&self, body: BodyIndex) -> f64 {
        let field = self.fields.find(body, &keys::DISPLACEMENT.name);
        field.map_or(0.0, |field| self.time_of_field(field))
    }

    /// How often the displacement of a body changed; `None` without displacement, and where a physics sets the
    /// configuration.
    fn displacement_changes(&self, body: BodyIndex, mover: Option<usize>) -> Option<u64> {
        let field = self.fields.find(body, &keys::DISPLACEMENT.name);
        let field = field.filter(|_| mover.is_none());
        field.map(|index| self.fields.field(index).changes())
    }

    /// Reference positions of a body plus its displacement, m.
    pub(crate) fn displaced(&self, body: BodyIndex) -> Vec<Vector3<f64>> {
        let mut positions = self.bodies[body].points.position.clone();
        if let Some(index) = self.fields.find(body, &keys::DISPLACEMENT.name) {
            let displacement = self.fields.field(index).data();
            let points = positions
                .iter_mut()
                .zip(displacement.flat().chunks_exact(3));
            points.for_each(|(x, u)| *x += Vector3::from_column_slice(u));
        }
        positions
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
        let mut current = self.configurations.bodies[mover.body]
            .configuration
            .borrow_mut();
        let mut now = current.take().unwrap_or_default();
        Arc::make_mut(&mut now).replace(positions.iter().copied(), volumes);
        *current = Some(now);
        let followers = self.configurations.followers.iter();
        for follower in followers.filter(|f| f.body == mover.body) {
            let state = &mut *follower.state.borrow_mut();
            if must_look_again(&state.found_at, positions, follower.skin) {
                state.found_at.copy_from_slice(positions);
                state.has_old_rows = true;
            }
        }
    }

    /// A family that follows the points of its body, with the weights of the current configuration. Do not keep it
    /// beyond a step: while somebody holds it, it cannot be updated in place and is built again instead.
    pub fn moving_family(&self, handle: MovingFamily) -> Arc<Family> {
        let follower = &self.configurations.followers[handle.0];
        let now = self.configuration(follower.body);
        let state = &mut *follower.state.borrow_mut();
        if state.placed_for != now.version {
            state.place((&self.bodies[follower.body], &follower.spec), &now);
        }
        state.family.clone()
    }

    /// Where the rows of each moving family were found (m): part of a checkpoint, because the order of sums depends
    /// on it.
    pub(crate) fn rows_found_at(&self) -> Vec<Vec<Vector3<f64>>> {
        let followers = self.configurations.followers.iter();
        followers
            .map(|f| f.state.borrow().found_at.clone())
            .collect()
    }

    /// Restores what [`World::rows_found_at`] gave; whether it fits the families.
    pub(crate) fn find_rows_at(&self, found_at: Vec<Vec<Vector3<f64>>>) -> bool {
        let followers = &self.configurations.followers;
        if followers.len() != found_at.len() {
            return false;
        }
        for (follower, found_at) in followers.iter().zip(found_at) {
            let mut state = follower.state.borrow_mut();
            if state.found_at.len() != found_at.len() {
                return false;
            }
            state.found_at = found_at;
            (state.has_old_rows, state.placed_for) = (true, 0);
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::family::{Correction, FamilySpec};
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
    fn a_second_physics_that_moves_the_points_is_refused_by_name() {
        let mut world = world();
        let mut setup = Setup::new(&mut world, Path::new("."));
        setup.next_plugin("water");
        setup.move_points(0).expect("the first one");
        setup.next_plugin("oil");
        let error = setup.move_points(0).expect_err("a second one").to_string();
        assert!(
            error.contains("`water`") && error.contains("`block`"),
            "{error}"
        );
        let error = setup.family(0, &spec()).expect_err("at rest").to_string();
        assert!(error.contains("`water`"), "{error}");
    }

    #[test]
    fn a_family_at_rest_is_not_left_behind_by_moving_points() {
        let mut world = world();
        let mut setup = Setup::new(&mut world, Path::new("."));
        setup.next_plugin("heat");
        assert_eq!(setup.description(0), Description::TotalLagrangian);
        setup.next_plugin("water");
        let moved = setup.move_points(0).expect_err("too late").to_string();
        let passed = setup
            .flow_through(0, Description::Eulerian)
            .expect_err("too late")
            .to_string();
        assert!(
            moved.contains("`heat`") && passed.contains("`heat`"),
            "{moved}"
        );
        // its own family at rest does not hinder a physics
        let mut world = self::world();
        let mut setup = Setup::new(&mut world, Path::new("."));
        setup.next_plugin("heat");
        setup.next_plugin("water");
        setup.family(0, &spec()).expect("valid");
        setup.move_points(0).expect("nobody else has one");
    }

    #[test]
    fn moving_families_are_shared_and_follow_the_configuration() {
        let mut world = world();
        let mut setup = Setup::new(&mut world, Path::new("."));
        setup.next_plugin("water");
        let mover = setup.move_points(0).expect("the first one");
        let family = setup.moving_family(0, &spec()).expect("valid");
        let same = setup.moving_family(0, &spec()).expect("valid");
        assert_eq!(family.0, same.0);
        assert_eq!(setup.families().count(), 1);
        setup.finish().expect("complete");

        let before = world.configuration(0);
        let moved = before.positions().iter();
        let moved: Vec<_> = moved.map(|x| x + Vector3::x() * 2.0 * x.y).collect();
        let held = world.moving_family(family);
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
        sheared.points.position = moved;
        let expected = bonds(&Family::moving(&sheared, &spec()).expect("valid"));
        assert_eq!(bonds(&world.moving_family(family)), expected);
        drop(held);
        assert_eq!(bonds(&world.moving_family(family)), expected);
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
