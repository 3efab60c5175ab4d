//! Contact: points that come too close repel each other, with or without bonds between them, and have friction.
//!
//! ```text
//! J_n = dt k (d_ij - g_ij) w_ij V_i V_j   where positive,   k = 15 c / horizon
//! J_t = -(dt k_t s_ij + m_ij v_t)          across the normal, at most mu J_n (Coulomb),   k_t = 2/7 k w_ij V_i V_j
//! ds_ij / dt = v_t                          while the points stick
//! ```
//!
//! with the bond constant c of a horizon of 3 spacings at Young's modulus of the points (Silling and Askari (2005),
//! section 6).
//!
//! - *Pieces of one body*: the gap g is the distance of the two points, the normal the line between them, `w = 1`, and
//!   `d = min(0.9 |x_i - x_j|, 1.35 (spacing_i + spacing_j) / 2)`, so that bonded neighbours repel each other only once
//!   they are 10 % closer than in the reference configuration.
//! - *Two bodies*: the normal is the mean normal of the two surfaces, the normal of the plane where an edge meets a plane, or the
//!   line between the points where two edges meet. The gap g is the distance along the normal, d is the mean spacing, at which the
//!   surfaces touch, and w is a weight that falls smoothly over two spacings along the surface, with sum 1. Points of a surface
//!   then act as a plane. With the line between points as normal, a block would lock into the lattice below it without friction.
//!
//! Points stick by a spring of the length `s_ij`, their relative displacement since they touched (Cundall and Strack (1979)). The
//! spring carries a static load, such as the weight of a body on an incline, while points are at rest. The term of the relative
//! velocity `v_t`, with `1 / m_ij = n_i / m_i + n_j / m_j` for points in n contacts, damps the spring; without the spring a body
//! under load would creep. While points slide, the length of the spring is the one that gives the force of friction.
//!
//! Both bodies receive the impulses J of a step at its beginning, where both are at the same time: equal and opposite for any step
//! sizes. Repulsion applied in this way is the symplectic Euler scheme, whose energy error oscillates without drift. Between pieces
//! of one body J_n conserves angular momentum; other impulses are not parallel to the line between the points and conserve it only
//! in the mean.

mod friction;
mod impactor;
mod normals;
#[cfg(test)]
mod tests;
mod touch;

use friction::Springs;
pub use impactor::Impactor;
use normals::{NEAR, Neighbourhoods};
use touch::{ContactPoint, REACH, Touch, contact_range};

use nalgebra::Vector3;
use perimelt_core::numbers::{check_at_least, check_positive};
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::plugin::check_length;
use perimelt_core::solver::reduce::max_abs;
use perimelt_core::world::FamilyReach;
use perimelt_core::{
    Coupler, FamilySpec, Horizon, LoadError, PairList, Prepared, Read, Report, RunError,
    RunningCoupler, SavedState, Setup, SetupError, Step, World, Write, keys,
};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Pieces of a body, or two bodies, do not pass through each other; for explicit mechanics and rigid bodies.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Contact {
    /// Body; may be left out when there is one only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<String>,
    /// The body that it meets; left out: its own pieces meet.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub other: Option<String>,
    /// Stiffness of the contact as a multiple of that of a bond.
    #[serde(default = "default_stiffness")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub stiffness: f64,
    /// Coefficient of friction (Coulomb).
    #[serde(default)]
    #[schemars(extend("minimum" = 0))]
    pub friction: f64,
}

fn default_stiffness() -> f64 {
    15.0
}

/// Least number of points that a thread processes.
const POINTS: usize = 1024;

/// Contacts along the normal that a point may have at a time, by dimension: for the stable step.
const FACING: [f64; 3] = [1.0, 2.0, 4.0];

/// A contact that is ready to act.
struct RunningContact {
    friction_coefficient: f64,
    sides: Vec<Side>,
    pairs: PairList,
    /// Version of the pairs that `squares` belong to.
    version: u64,
    /// Square of the distance at which each candidate is met, m².
    squares: Vec<f64>,
    /// Surfaces, where two bodies meet.
    surfaces: Option<Surfaces>,
    /// The fields from here to `contacts` are by point of the pairs.
    points: Vec<ContactPoint>,
    /// Velocities, m/s.
    velocity: Vec<[f64; 3]>,
    /// Number of contacts; for friction only.
    contacts: Vec<[f64; 1]>,
    /// The fields from here to `impulse` are by point that this process owns. Numbers of the points that each point touches, and the
    /// lengths of their springs (m); for friction only.
    springs: Vec<Springs>,
    /// Springs of the previous step.
    last_springs: Vec<Springs>,
    /// Impulse per volume, N s/m³.
    impulse: Vec<Vector3<f64>>,
    dimension: usize,
    /// Force on the first body in the last step, N; number of points in contact, where pieces of one body meet.
    force: Vector3<f64>,
    touched: f64,
}

/// Surfaces of two bodies.
#[derive(Debug)]
struct Surfaces {
    neighbourhoods: Vec<Neighbourhoods>,
    /// Outward normal, zero inside, and the deviation of the surface from flat.
    normals: Vec<[f64; 4]>,
}

/// A body in contact.
#[derive(Debug)]
struct Side {
    velocity: Read<Vector3<f64>>,
    impulse: Write<Vector3<f64>>,
    /// Impulse per volume of all points that this process has, N s/m³.
    at_points: Vec<Vector3<f64>>,
}

/// Stiffness of the contact of each point, N/m⁷.
fn stiffness(setup: &Setup<'_>, body: usize, factor: f64) -> Result<Vec<f64>, SetupError> {
    let modulus = setup.world().property(body, "youngs_modulus")?;
    let this = setup.body(body);
    // bond-based solid: 2 d bulk modulus over Young's modulus
    let constant = [2.0, 3.0, 4.0][this.dimension - 1];
    let point = |(material, spacing): (&u16, &f64)| {
        let horizon = 3.0 * spacing;
        let moment = FamilySpec::new(horizon).moment(this, horizon);
        factor * constant * max_abs(&modulus[*material as usize].values()) / (moment * horizon)
    };
    let points = this.material_of_point.iter().zip(&this.points.spacing);
    Ok(points.map(point).collect())
}

impl RunningContact {
    fn update_pairs(&mut self, world: &World) {
        self.pairs.update(world);
        if self.version == self.pairs.version() {
            return;
        }
        self.version = self.pairs.version();
        let own = &self.points[..self.pairs.owned()];
        let mut numbers = own.iter().map(ContactPoint::numbers).collect();
        self.pairs.bring(world, &mut numbers);
        self.points.clear();
        self.points
            .extend(numbers.into_iter().map(ContactPoint::from_numbers));
        let pairs = &self.pairs;
        self.squares.clear();
        for (i, point) in self.points[..pairs.owned()].iter().enumerate() {
            let others = pairs.candidates(i).iter();
            let square = |&j: &u32| {
                let other = &self.points[j as usize];
                match self.surfaces {
                    Some(_) => {
                        let ranges = [point, other].map(|p| 0.5 * contact_range(p.spacing));
                        (ranges[0] + ranges[1]).powi(2)
                    }
                    None => point.distance(other).powi(2),
                }
            };
            self.squares.extend(others.map(square));
        }
    }

    /// Impulses of a step of `dt` (s).
    fn evaluate(&mut self, world: &World, dt: f64) {
        let has_friction = self.friction_coefficient > 0.0;
        self.update_pairs(world);
        if let Some(Surfaces {
            neighbourhoods,
            normals,
        }) = &mut self.surfaces
        {
            normals.resize(self.pairs.owned(), [0.0; 4]);
            for ((body, points), neighbourhoods) in self.pairs.of_bodies().zip(neighbourhoods) {
                let configuration = world.configuration(body);
                neighbourhoods.normals(configuration.positions(), &mut normals[points]);
            }
            self.pairs.bring(world, normals);
        }
        if has_friction {
            self.load_velocities(world);
            self.count_contacts(world);
        }
        std::mem::swap(&mut self.springs, &mut self.last_springs);
        let mut impulse = std::mem::take(&mut self.impulse);
        let mut springs = std::mem::take(&mut self.springs);
        let points = impulse.par_iter_mut().zip(&mut springs).enumerate();
        points.with_min_len(POINTS).for_all(|(i, (sum, springs))| {
            *sum = Vector3::zeros();
            springs.clear();
            self.for_each_touch(i, dt, |j, touch| {
                *sum += touch.normal * touch.impulse;
                if has_friction {
                    let number = self.pairs.number(j);
                    let last = self.last_springs[i].iter().find(|(p, _)| *p == number);
                    let last = last.map_or_else(Vector3::zeros, |(_, s)| (*s).into());
                    let (friction, spring) = self.friction(i, j, &touch, dt, last);
                    *sum += friction;
                    springs.push((number, spring.into()));
                }
            });
            *sum /= self.points[i].volume;
        });
        (self.impulse, self.springs) = (impulse, springs);
    }

    /// Sums up what is reported of a step of `dt` (s). Collective.
    fn count(&mut self, world: &World, dt: f64) {
        let (body, _) = self.pairs.of_bodies().next().expect("a body");
        let reducer = world.reducer(body);
        if self.sides.len() == 1 {
            let touched = self.impulse.iter().filter(|j| j.norm_squared() > 0.0);
            self.touched = reducer.total_of(touched.count() as f64);
            return;
        }
        let impulse = |point: usize| (self.impulse[point] * self.points[point].volume).into();
        let impulse = Vector3::from(reducer.sum_points(impulse));
        self.force = if dt > 0.0 {
            impulse / dt
        } else {
            Vector3::zeros()
        };
    }
}

impl Contact {
    fn bodies(&self, setup: &Setup<'_>) -> Result<Vec<usize>, SetupError> {
        let body = setup.find_body(self.body.as_deref())?;
        let Some(other) = &self.other else {
            return Ok(vec![body]);
        };
        let other = setup.find_body(Some(other)).map_err(|e| SetupError {
            key: "other".into(),
            ..e
        })?;
        if other == body {
            let message = "`body` and `other` are the same body";
            let expected = "another body, or no `other` for contact of the body with itself";
            return Err(SetupError::value("other", message, expected));
        }
        Ok(vec![body, other])
    }
}

#[typetag::serialize(name = "contact")]
impl Coupler for Contact {
    fn publish(&mut self, setup: &mut Setup<'_>) -> Result<(), SetupError> {
        for body in self.bodies(setup)? {
            setup.publish(body, FamilyReach(Horizon::Spacings(NEAR)))?;
        }
        Ok(())
    }

    fn prepare(self: Box<Self>, setup: &mut Setup<'_>) -> Prepared<dyn RunningCoupler> {
        check_positive("stiffness", self.stiffness, "")?;
        check_at_least("friction", self.friction, 0.0, "")?;
        let bodies = self.bodies(setup)?;
        let (mut sides, mut points, mut reach) = (Vec::new(), Vec::new(), Vec::new());
        let mut neighbourhoods = Vec::new();
        for &body in &bodies {
            setup.read(body, &keys::DISPLACEMENT)?;
            sides.push(Side {
                velocity: setup.read(body, &keys::VELOCITY)?,
                impulse: setup.add(body, &keys::IMPULSE)?,
                at_points: vec![Vector3::zeros(); setup.body(body).points.len()],
            });
            let stiffness = stiffness(setup, body, self.stiffness)?;
            let density = setup.world().density_at_points(body)?;
            let own = &setup.body(body).points;
            let owned = 0..setup.world().reducer(body).owned();
            points.extend(owned.map(|i| ContactPoint {
                position: own.position[i],
                spacing: own.spacing[i],
                volume: own.volume[i],
                mass: density[i] * own.volume[i],
                stiffness: stiffness[i],
            }));
            let spacings = own.spacing.iter();
            reach.push(match bodies.len() {
                1 => spacings.map(|s| REACH * s).collect::<Vec<_>>(),
                _ => spacings.map(|s| contact_range(*s)).collect(),
            });
            if bodies.len() == 2 {
                let near = Neighbourhoods::new(setup.body(body), &setup.world().reducer(body));
                setup.read_points(body, near.points());
                neighbourhoods.push(near);
            }
        }
        let world = setup.world();
        let pairs = match (&bodies[..], &reach[..]) {
            (&[first, second], [a, b]) => PairList::between(world, [first, second], [a, b]),
            (all, own) => PairList::within(world, all[0], &own[0]),
        };
        Ok(Box::new(RunningContact {
            friction_coefficient: self.friction,
            sides,
            pairs,
            version: 0,
            squares: Vec::new(),
            surfaces: (bodies.len() == 2).then_some(Surfaces {
                neighbourhoods,
                normals: Vec::new(),
            }),
            velocity: Vec::new(),
            contacts: Vec::new(),
            springs: vec![Springs::new(); points.len()],
            last_springs: vec![Springs::new(); points.len()],
            impulse: vec![Vector3::zeros(); points.len()],
            dimension: setup.body(bodies[0]).dimension,
            force: Vector3::zeros(),
            touched: 0.0,
            points,
        }))
    }
}

impl RunningCoupler for RunningContact {
    fn apply(&mut self, world: &World, step: Step) -> Result<(), RunError> {
        self.evaluate(world, step.size);
        for (side, (body, points)) in self.sides.iter_mut().zip(self.pairs.of_bodies()) {
            side.at_points[..points.len()].copy_from_slice(&self.impulse[points]);
            let at_points = bytemuck::cast_slice_mut(&mut side.at_points);
            world.reducer(body).bring(at_points);
            let mut impulse = world.write(side.impulse);
            let points = impulse.par_iter_mut().zip(&side.at_points);
            points.with_min_len(POINTS).for_all(|(sum, j)| *sum += j);
        }
        self.count(world, step.size);
        Ok(())
    }

    /// `2 / omega` for two points in the stiffest contact.
    fn stable_step(&mut self, world: &World) -> Option<f64> {
        let square = |point: &ContactPoint| {
            2.0 * FACING[self.dimension - 1] * point.stiffness * point.volume * point.volume
                / point.mass
        };
        let largest = self.points.iter().map(square).fold(0.0, f64::max);
        Some(2.0 / world.processes().max(largest).sqrt())
    }

    fn save(&self, world: &World) -> Box<dyn erased_serde::Serialize + '_> {
        let touching = self.springs.iter().any(|s| !s.is_empty());
        let springs = world.processes().any(touching).then(|| {
            let of_bodies = self.pairs.of_bodies();
            let of_bodies =
                of_bodies.map(|(body, points)| world.whole_of(body, &self.springs[points]));
            of_bodies.collect::<Vec<_>>().concat()
        });
        Box::new(springs)
    }

    fn load(&mut self, world: &World, saved: SavedState<'_, '_>) -> Result<(), LoadError> {
        let springs: Option<Vec<Springs>> = erased_serde::deserialize(saved)?;
        self.springs.fill(Springs::new());
        let Some(mut rest) = springs else {
            return Ok(());
        };
        let bodies = self.pairs.of_bodies().map(|(body, _)| body);
        let points = bodies.map(|body| world.points_of_whole(body)).sum();
        check_length("springs", rest.len(), points)?;
        for (body, points) in self.pairs.of_bodies() {
            let behind = rest.split_off(world.points_of_whole(body));
            let own = world.reducer(body).part_of(rest);
            self.springs[points.clone()].clone_from_slice(&own[..points.len()]);
            rest = behind;
        }
        Ok(())
    }

    fn report(&self) -> Vec<Report> {
        if self.sides.len() == 1 {
            return vec![Report::new("points", "1", self.touched)];
        }
        let axes = ["x", "y", "z"].into_iter().zip(&self.force);
        axes.map(|(axis, force)| Report::new(format!("force.{axis}"), "N", *force))
            .collect()
    }
}

perimelt_core::register_coupler!("contact", Contact, supports: [Motion, Division]);
