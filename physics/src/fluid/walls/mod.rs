//! Bodies that are walls for a fluid in the conservative form: a deformable or rigid solid of any shape, at rest or moving.
//!
//! The points of a wall are foreign ghosts of the fluid ([`ForeignBonds`]). With the velocity v_w and the position
//! of each wall point j, its values as a point of the fluid are means over the fluid around it
//! (Adami, Hu and Adams (2012)), and v_w the mean velocity over its last step ([`WallMotion`]),
//!
//! ```text
//! <f>_j = sum_i w f_i V_i / sum_i w V_i
//! p_j   = <p_i + f_i . (x_j - x_i)>          with the body force f, so that the fluid can be at rest
//! v_j   = 2 v_w - <v_i>                      for the viscous force; a wall with slip has no viscous force
//! A_j   = a I                                as of a complete family
//! ```
//!
//! The divergence at a fluid point takes v_w at the wall, and the fluid next to a wall also takes up the compression of the
//! ghosts, as far as their pressure is its own:
//!
//! ```text
//! div_i += sum_j w q_j V_j,   q_j = sum_i w (v_i - v_w) . (x_i - x_j) V_i / (a sum_i w V_i)
//! ```
//!
//! This is the adjoint of the mean in p_j: the work of the pressure on fluid and wall is the energy of compression. (The
//! reference takes v_w alone, which makes a fluid that is pressed against a wall too soft.)
//!
//! What a bond to a ghost does to the fluid, the wall point gets with the opposite sign, as an impulse: momentum of
//! fluid and wall is kept to rounding, bond by bond. Pressure acts along the bond or through the symmetric A_i, so that
//! angular momentum is kept, too, with viscosity along bonds (`stress = "central"`).
//!
//! With `collisions`, points that pressure does not keep out collide with the wall ([`crate::fluid::lagrangian::collision`]).
//!
//! Walls must be so thick that the fluid sees no fluid behind them: three rows of points, two with `influence =
//! "wendland"` at a horizon of three spacings.

pub(super) mod interface;
pub(super) mod wall_motion;

pub(super) use wall_motion::WallMotion;

use nalgebra::Vector3;
use perimelt_core::family::{ForeignBond, ForeignBonds, Places};
use perimelt_core::world::BodyIndex;
use perimelt_core::{
    Access, Body, BondKernel, Configuration, FamilySpec, Read, Report, Setup, SetupError, Wall,
    World, Write, keys,
};

use super::eulerian::immersed::Immersed;
use crate::shape_tensor::is_diagonal;
use interface::{Interface, NormalField};

/// All walls of a fluid.
#[derive(Debug, Default)]
pub(super) struct Walls {
    pub(super) bodies: Vec<WallBody>,
}

/// A body that is a wall.
#[derive(Debug)]
pub(super) struct WallBody {
    pub(super) name: String,
    pub(super) wall: Wall,
    /// Density of the fluid over that of each point of the wall.
    pub(super) density_ratio: Vec<f64>,
    velocity: Read<Vector3<f64>>,
    motion: WallMotion,
    /// For a fluid whose points rest.
    pub(super) immersed: Option<Immersed>,
    pub(super) impulse: Write<Vector3<f64>>,
    pub(super) bonds: ForeignBonds,
    pub(super) points: Vec<WallPoint>,
    pub(super) means: Vec<[f64; 7]>,
    pressures: Vec<[f64; 2]>,
    pub(super) extra: Vec<[f64; 1]>,
    forces: Vec<[f64; 3]>,
    /// On the wall in the last step, N.
    pub(super) force: Vector3<f64>,
    /// Masses of its points, kg; empty without a density.
    pub(super) mass: Vec<f64>,
    normal: Option<NormalField>,
    /// Momentum (N s) and angular momentum (N m s) that collisions gave to the fluid in the last step.
    pub(super) collisions: [Vector3<f64>; 2],
}

/// A point of a wall as a point of the fluid.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct WallPoint {
    /// Velocity of the wall, m/s.
    pub(super) velocity: Vector3<f64>,
    /// Velocity in the sums of viscosity, m/s.
    pub(super) held: Vector3<f64>,
    /// kg/m³.
    pub(super) density: f64,
    /// Pa s.
    pub(super) viscosity: f64,
    /// Pa.
    pub(super) pressure: f64,
    /// Compression that the fluid around the point takes up, m/s.
    pub(super) compression: f64,
}

/// Refuses a fluid at the place of another body.
fn check_apart(fluid: &Body, wall: &Body) -> Result<(), SetupError> {
    let Some(point) = fluid.first_inside(wall) else {
        return Ok(());
    };
    let [x, y, z] = fluid.points.position.at(point).into();
    let message = format!(
        "point ({x:.3e}, {y:.3e}, {z:.3e}) m of body `{}` lies inside body `{}`",
        fluid.name, wall.name
    );
    let expected = "shapes that do not overlap, such as a `shape.difference`";
    Err(SetupError::value("body", message, expected))
}

impl Walls {
    /// Prepares the walls that couplers gave to a body, with families as `spec` says.
    pub(super) fn prepare(
        setup: &mut Setup<'_>,
        body: BodyIndex,
        spec: &FamilySpec,
    ) -> Result<Walls, SetupError> {
        let mut bodies = Vec::new();
        let walls: Vec<Wall> = setup.facts(body).copied().collect();
        for wall in walls {
            setup.read(wall.other, &keys::DISPLACEMENT)?;
            let density = setup.world().density_at_points(body)?;
            let heaviest = density.into_iter().fold(0.0, f64::max);
            let solid = setup.body(wall.other);
            check_apart(setup.body(body), solid)?;
            let density = setup.world().density_at_points(wall.other)?;
            let mass = density.iter().zip(&solid.points.volume);
            bodies.push(WallBody {
                name: solid.name.clone(),
                mass: mass.map(|(rho, volume)| rho * volume).collect(),
                normal: NormalField::declare(setup, wall.other),
                collisions: Default::default(),
                wall,
                density_ratio: density.iter().map(|rho| heaviest / rho).collect(),
                velocity: setup.read(wall.other, &keys::VELOCITY)?,
                motion: WallMotion::default(),
                immersed: None,
                impulse: setup.give(wall.other, &keys::IMPULSE, Access::Give)?,
                bonds: ForeignBonds::new(setup.body(body), spec),
                points: Vec::new(),
                means: Vec::new(),
                pressures: Vec::new(),
                extra: Vec::new(),
                forces: Vec::new(),
                force: Vector3::zeros(),
            });
        }
        Ok(Walls { bodies })
    }

    pub(super) fn is_empty(&self) -> bool {
        self.bodies.is_empty()
    }

    /// Lets the points of the walls be where they are now, with their mean velocities.
    pub(super) fn follow(&mut self, world: &World, body: BodyIndex) {
        if self.is_empty() {
            return;
        }
        let own = world.configuration(body);
        for wall in &mut self.bodies {
            let other = world.configuration(wall.wall.other);
            match wall.immersed {
                Some(_) => wall.displace(world, other.positions()),
                None => wall.bonds.follow(places(&own), places(&other)),
            }
            let time = world.time_of(wall.velocity);
            let motion = &mut wall.motion;
            let walls = world.body(wall.wall.other);
            motion.follow(walls, time, other.positions(), &world.read(wall.velocity));
            wall.points
                .resize(motion.velocity.len(), WallPoint::default());
            let points = wall.points.iter_mut().zip(&motion.velocity);
            points.for_each(|(point, v)| point.velocity = *v);
            wall.force = Vector3::zeros();
            wall.collisions = Default::default();
            if wall.normal.as_ref().is_some_and(|n| n.is_read) {
                wall.set_normals(world, places(&other));
            }
        }
    }

    /// Momentum (N s) and angular momentum (N m s) that collisions with walls gave to the fluid in the last step.
    pub(super) fn collisions(&self) -> [Vector3<f64>; 2] {
        let sum = |k: usize| self.bodies.iter().map(|wall| wall.collisions[k]).sum();
        [sum(0), sum(1)]
    }

    /// Finds the normals of the walls at the interface.
    pub(super) fn observe(&mut self, world: &World, body: BodyIndex) {
        let own = world.configuration(body);
        for wall in &mut self.bodies {
            let other = world.configuration(wall.wall.other);
            if wall.immersed.is_none() {
                wall.bonds.follow(places(&own), places(&other));
            }
            wall.set_normals(world, places(&other));
        }
    }

    /// Finds the pressure of the ghosts from that of the fluid by slot (Pa) and the body force by point (N/m³).
    pub(super) fn set_pressure(
        &mut self,
        slot_of: impl Fn(usize) -> usize + Sync,
        pressure: &[f64],
        force: impl Fn(usize) -> Vector3<f64> + Sync,
    ) {
        for wall in &mut self.bodies {
            let bonds = &wall.bonds;
            let part = |n: usize| {
                let ForeignBond { bond, point, .. } = bonds.bond(n);
                let here = pressure[slot_of(point)] + force(point).dot(&Vector3::from(bond.xi));
                [bond.dual, bond.dual * here]
            };
            bonds.sum_by_foreign(part, &mut wall.pressures);
            for (point, [sum, pressure]) in wall.points.iter_mut().zip(&wall.pressures) {
                point.pressure = if *sum > 0.0 { pressure / sum } else { 0.0 };
            }
        }
    }

    /// Adds the weights of the bonds to ghosts, times their lengths and as they are, by point. A wall that yields
    /// raises the squared frequency of a bond by the ratio of the inertias, `1/m_i + 1/m_j` over `1/m_i`.
    pub(super) fn add_sums(&self, sums: &mut [[f64; 2]]) {
        let mut found = Vec::new();
        for wall in &self.bodies {
            let part = |n: usize| {
                let ForeignBond { bond, ghost, .. } = wall.bonds.bond(n);
                let rise = 1.0 + wall.density_ratio[ghost.point];
                [bond.weight * bond.length * rise.sqrt(), bond.weight * rise]
            };
            wall.bonds.sum_by_owner(part, &mut found);
            wall.bonds.add_to_owners(&found, sums);
        }
    }

    /// Adds the bonds to ghosts to the force of the pressure, one row for each point, N/m³.
    pub(super) fn add_pressure<const I: usize, const D: usize>(
        &self,
        kernel: &impl BondKernel<I, D>,
        own: impl Fn(usize) -> [f64; I] + Sync,
        moment: f64,
        sums: &mut [[f64; D]],
    ) {
        let mut found = Vec::new();
        for wall in &self.bodies {
            wall.bonds
                .sum_by_owner(|n| wall.pressure_part(n, kernel, &own, moment), &mut found);
            wall.bonds.add_to_owners(&found, sums);
        }
    }

    /// Gives the walls the opposite of what `force(wall, bond)` (N/m³ of the fluid) does in a time (s).
    pub(super) fn give(
        &mut self,
        world: &World,
        time: f64,
        force: impl Fn(&WallBody, usize) -> Vector3<f64> + Sync,
    ) {
        for wall in &mut self.bodies {
            let mut forces = std::mem::take(&mut wall.forces);
            let part = |n: usize| {
                let ghost = wall.bonds.bond(n).ghost;
                let on_fluid = force(wall, n) * wall.bonds.own_volume(n);
                (-ghost.reflect(on_fluid)).into()
            };
            wall.bonds.sum_by_foreign(part, &mut forces);
            let volume = &world.body(wall.wall.other).points.volume;
            let mut impulse = world.write(wall.impulse);
            for ((j, force), volume) in impulse.iter_mut().zip(&forces).zip(volume) {
                let force = Vector3::from(*force);
                *j += force * (time / volume);
                wall.force += force;
            }
            wall.forces = forces;
        }
    }

    /// Momentum given to the walls per time in the last step, N, and its moment about the origin, N m.
    pub(super) fn total_force(&self, world: &World) -> [Vector3<f64>; 2] {
        let mut totals = [Vector3::zeros(); 2];
        for wall in &self.bodies {
            let other = world.configuration(wall.wall.other);
            for (force, x) in wall.forces.iter().zip(other.positions()) {
                let force = Vector3::from(*force);
                totals[0] += force;
                totals[1] += x.cross(&force);
            }
        }
        totals
    }

    /// What a resumed run must know of the walls.
    pub(super) fn motions(&self) -> Vec<WallMotion> {
        self.bodies.iter().map(|w| w.motion.clone()).collect()
    }

    /// Restores what [`Walls::motions`] gave.
    pub(super) fn set_motions(&mut self, motions: Vec<WallMotion>) {
        for (wall, motion) in self.bodies.iter_mut().zip(motions) {
            wall.motion = motion;
        }
    }

    /// Force on each wall and, where there are several, on all of them, N.
    pub(super) fn reports(&self) -> Vec<Report> {
        let mut forces: Vec<_> = self.bodies.iter().map(|w| (&w.name[..], w.force)).collect();
        if forces.len() > 1 {
            forces.push(("all", forces.iter().map(|(_, force)| force).sum()));
        }
        let of_wall = |(name, force): (&str, Vector3<f64>)| {
            [("x", force.x), ("y", force.y), ("z", force.z)]
                .map(|(axis, value)| Report::new(format!("force.{name}.{axis}"), "N", value))
        };
        forces.into_iter().flat_map(of_wall).collect()
    }
}

pub(super) fn places(configuration: &Configuration) -> Places<'_> {
    Places {
        positions: configuration.positions(),
        volumes: configuration.volumes(),
    }
}

impl WallBody {
    pub(super) fn interface<'a>(&'a self, world: &World, solid: Places<'a>) -> Interface<'a> {
        let solid_body = world.body(self.wall.other);
        Interface {
            bonds: &self.bonds,
            solid,
            horizon: self.bonds.horizon(),
            spacing: self.bonds.spacing(),
            dimension: solid_body.dimension,
        }
    }

    fn set_normals(&self, world: &World, solid: Places<'_>) {
        let Some(normal) = &self.normal else {
            return;
        };
        if let Some(immersed) = &self.immersed {
            return normal.set_to(world, &immersed.normal);
        }
        normal.set(world, &self.interface(world, solid));
    }

    /// What a bond adds to the force of the pressure on its fluid point, N/m³.
    pub(super) fn pressure_part<const I: usize, const D: usize>(
        &self,
        number: usize,
        kernel: &impl BondKernel<I, D>,
        own: &impl Fn(usize) -> [f64; I],
        moment: f64,
    ) -> [f64; D] {
        let ForeignBond { bond, point, ghost } = self.bonds.bond(number);
        let other = std::array::from_fn(|i| match i {
            0 => self.points[ghost.point].pressure,
            _ if is_diagonal(i - 1) => 1.0 / moment,
            _ => 0.0,
        });
        kernel.bond(bond, own(point), other)
    }
}
