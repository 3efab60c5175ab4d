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

use friction::Springs;
pub use impactor::Impactor;
use normals::Neighbourhoods;

use nalgebra::Vector3;
use perimelt_core::numbers::{check_at_least, check_positive};
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::solver::reduce::max_abs;
use perimelt_core::{
    Coupler, FamilySpec, LoadError, PairList, Prepared, Read, Report, RunError, RunningCoupler,
    SavedState, Setup, SetupError, Step, World, Write, keys,
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

/// Distance at which unbonded points meet, in spacings.
const REACH: f64 = 1.35;
/// Distance at which bonded points meet, as a fraction of that at rest.
const CLOSE: f64 = 0.9;
/// Range of a point of another body along the surface, in spacings.
const WIDTH: f64 = 2.0;
/// Largest deviation of a plane from flat, by dimension: a plane has 1, 0.6 and 0.38, an edge 0.94 and 0.6.
const FLAT: [f64; 3] = [f64::INFINITY, 0.75, 0.48];
/// Largest cosine between the outward normals of two flat surfaces that face each other. The side of a block on a floor does
/// not face the floor: a normal halfway between both would resist sliding.
const FACING_COSINE: f64 = -0.3;
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
    /// The fields from here to `impulse` are by point, with the points of the first body first.
    points: Vec<ContactPoint>,
    /// Velocities, m/s.
    velocity: Vec<Vector3<f64>>,
    /// Number of contacts; for friction only.
    contacts: Vec<f64>,
    /// The points that each point touches, and the lengths of their springs (m); for friction only.
    springs: Vec<Springs>,
    /// Springs of the previous step.
    last_springs: Vec<Springs>,
    /// Impulse per volume, N s/m³.
    impulse: Vec<Vector3<f64>>,
    dimension: usize,
    /// Size of the last step, s.
    step: f64,
}

/// Surfaces of two bodies.
#[derive(Debug, Default)]
struct Surfaces {
    neighbourhoods: Neighbourhoods,
    /// Outward normal, zero inside, and the deviation of the surface from flat.
    normals: Vec<(Vector3<f64>, f64)>,
}

/// A body in contact.
#[derive(Debug)]
struct Side {
    velocity: Read<Vector3<f64>>,
    impulse: Write<Vector3<f64>>,
}

/// A point in contact.
#[derive(Clone, Copy, Debug)]
struct ContactPoint {
    /// Position in the reference configuration, m.
    position: Vector3<f64>,
    /// m.
    spacing: f64,
    /// m³.
    volume: f64,
    /// kg.
    mass: f64,
    /// Contact stiffness k, N/m⁷.
    stiffness: f64,
}

impl ContactPoint {
    /// Distance at which two points meet, m.
    fn distance(&self, other: &ContactPoint) -> f64 {
        let rest = (self.position - other.position).norm();
        let reach = 0.5 * REACH * (self.spacing + other.spacing);
        reach.min(CLOSE * rest)
    }
}

/// Range of a point of another body, m, along and across its surface.
fn contact_range(spacing: f64) -> f64 {
    (1.0 + WIDTH * WIDTH).sqrt() * spacing
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

/// Two points in contact, seen from the first one.
struct Touch {
    /// Unit vector from the other point to this one.
    normal: Vector3<f64>,
    /// Normal impulse, N s.
    impulse: f64,
    /// Normal stiffness, N/m.
    stiffness: f64,
}

/// The overlap of the surfaces of two bodies at a pair of points.
struct Overlap {
    /// Unit vector from the other point to this one.
    normal: Vector3<f64>,
    /// Along the normal, m.
    depth: f64,
    /// Weight of the pair.
    weight: f64,
}

impl RunningContact {
    fn update_pairs(&mut self, world: &World) {
        self.pairs.update(world);
        if self.version == self.pairs.version() {
            return;
        }
        self.version = self.pairs.version();
        let pairs = &self.pairs;
        self.squares.clear();
        for (i, point) in self.points.iter().enumerate() {
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

    /// Calls `receive` with each point that touches point `i` and its contact in a step of `dt` (s).
    fn for_each_touch(&self, i: usize, dt: f64, mut receive: impl FnMut(usize, Touch)) {
        let (positions, point) = (self.pairs.positions(), &self.points[i]);
        let others = self.pairs.candidates(i).iter();
        for (&j, &limit) in others.zip(&self.squares[self.pairs.range(i)]) {
            let j = j as usize;
            let apart = positions[i] - positions[j];
            let square = apart.norm_squared();
            if square >= limit {
                continue;
            }
            let other = &self.points[j];
            let Overlap {
                normal,
                depth,
                weight,
            } = match &self.surfaces {
                None => {
                    let distance = square.sqrt();
                    Overlap {
                        normal: apart / distance,
                        depth: limit.sqrt() - distance,
                        weight: 1.0,
                    }
                }
                Some(surfaces) => self.overlap(surfaces, i, j, &apart),
            };
            // coincident points have no normal between them
            if normal.x.is_nan() {
                continue;
            }
            if depth > 0.0 && weight > 0.0 {
                let mean = 0.5 * (point.stiffness + other.stiffness);
                let stiffness = mean * weight * point.volume * other.volume;
                let touch = Touch {
                    normal,
                    impulse: dt * stiffness * depth,
                    stiffness,
                };
                receive(j, touch);
            }
        }
    }

    /// The overlap of the surfaces of two bodies at points i and j.
    fn overlap(&self, surfaces: &Surfaces, i: usize, j: usize, apart: &Vector3<f64>) -> Overlap {
        let [(own, own_edge), (other, other_edge)] = [surfaces.normals[i], surfaces.normals[j]];
        let is_flat = |edge: f64| edge < FLAT[self.dimension - 1];
        if is_flat(own_edge) && is_flat(other_edge) && own.dot(&other) > FACING_COSINE {
            return Overlap {
                normal: own,
                depth: 0.0,
                weight: 0.0,
            };
        }
        // an edge meets a plane along the normal of the plane, and another edge along the line between the points
        let along = match (is_flat(own_edge), is_flat(other_edge)) {
            (true, true) => other - own,
            (true, false) => -own,
            (false, true) => other,
            (false, false) => *apart,
        };
        let normal = along.normalize();
        let spacing = 0.5 * (self.points[i].spacing + self.points[j].spacing);
        let gap = normal.dot(apart);
        let across = (apart - gap * normal).norm() / (WIDTH * spacing);
        // sums of the weight over a line or a plane of points
        let sum = [
            1.0,
            16.0 / 15.0 * WIDTH,
            std::f64::consts::PI / 3.0 * WIDTH * WIDTH,
        ];
        let weight = (1.0 - across * across).max(0.0).powi(2) / sum[self.dimension - 1];
        Overlap {
            normal,
            depth: spacing - gap,
            weight,
        }
    }

    /// Impulses of a step of `dt` (s).
    fn evaluate(&mut self, world: &World, dt: f64) {
        let has_friction = self.friction_coefficient > 0.0;
        self.step = dt;
        self.update_pairs(world);
        if let Some(surfaces) = &mut self.surfaces {
            let positions = self.pairs.positions();
            let normals = &mut surfaces.normals;
            surfaces.neighbourhoods.normals(positions, normals);
        }
        if has_friction {
            self.load_velocities(world);
            self.count_contacts();
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
                    let last = self.last_springs[i].iter().find(|(p, _)| *p == j as u32);
                    let last = last.map_or_else(Vector3::zeros, |(_, s)| (*s).into());
                    let (friction, spring) = self.friction(i, j, &touch, dt, last);
                    *sum += friction;
                    springs.push((j as u32, spring.into()));
                }
            });
            *sum /= self.points[i].volume;
        });
        (self.impulse, self.springs) = (impulse, springs);
    }

    /// Impulse on the first body in the last step over its size, N.
    fn force(&self) -> Vector3<f64> {
        let points = self.impulse.iter().zip(&self.points);
        let first = points.take(self.pairs.first_points());
        let impulse: Vector3<f64> = first.map(|(j, p)| j * p.volume).sum();
        if self.step > 0.0 {
            impulse / self.step
        } else {
            Vector3::zeros()
        }
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
    fn prepare(self: Box<Self>, setup: &mut Setup<'_>) -> Prepared<dyn RunningCoupler> {
        check_positive("stiffness", self.stiffness, "")?;
        check_at_least("friction", self.friction, 0.0, "")?;
        let bodies = self.bodies(setup)?;
        let (mut sides, mut points, mut reach) = (Vec::new(), Vec::new(), Vec::new());
        let mut surfaces = Surfaces::default();
        for &body in &bodies {
            setup.read(body, &keys::DISPLACEMENT)?;
            sides.push(Side {
                velocity: setup.read(body, &keys::VELOCITY)?,
                impulse: setup.add(body, &keys::IMPULSE)?,
            });
            let stiffness = stiffness(setup, body, self.stiffness)?;
            let density = setup.world().density_at_points(body)?;
            let own = &setup.body(body).points;
            points.extend((0..own.len()).map(|i| ContactPoint {
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
            surfaces.neighbourhoods.add(setup.body(body));
        }
        let pairs = match (&bodies[..], &mut reach[..]) {
            (&[first, second], [a, b]) => {
                PairList::between([first, second], [std::mem::take(a), std::mem::take(b)])
            }
            (all, own) => PairList::within(all[0], std::mem::take(&mut own[0])),
        };
        Ok(Box::new(RunningContact {
            friction_coefficient: self.friction,
            sides,
            pairs,
            version: 0,
            squares: Vec::new(),
            surfaces: (bodies.len() == 2).then_some(surfaces),
            velocity: vec![Vector3::zeros(); points.len()],
            contacts: vec![0.0; points.len()],
            springs: vec![Springs::new(); points.len()],
            last_springs: vec![Springs::new(); points.len()],
            impulse: vec![Vector3::zeros(); points.len()],
            dimension: setup.body(bodies[0]).dimension,
            step: 0.0,
            points,
        }))
    }
}

impl RunningCoupler for RunningContact {
    fn apply(&mut self, world: &World, step: Step) -> Result<(), RunError> {
        self.evaluate(world, step.size);
        let mut rest = &self.impulse[..];
        for side in &self.sides {
            let mut impulse = world.write(side.impulse);
            let (own, others) = rest.split_at(impulse.len());
            let points = impulse.par_iter_mut().zip(own).with_min_len(POINTS);
            points.for_all(|(sum, j)| *sum += j);
            rest = others;
        }
        Ok(())
    }

    /// `2 / omega` for two points in the stiffest contact.
    fn stable_step(&mut self, _world: &World) -> Option<f64> {
        let square = |point: &ContactPoint| {
            2.0 * FACING[self.dimension - 1] * point.stiffness * point.volume * point.volume
                / point.mass
        };
        Some(2.0 / self.points.iter().map(square).fold(0.0, f64::max).sqrt())
    }

    fn save(&self, _world: &World) -> Box<dyn erased_serde::Serialize + '_> {
        let touching = self.springs.iter().any(|s| !s.is_empty());
        Box::new(touching.then_some(&self.springs))
    }

    fn load(&mut self, _world: &World, saved: SavedState<'_, '_>) -> Result<(), LoadError> {
        let springs: Option<Vec<Springs>> = erased_serde::deserialize(saved)?;
        let points = self.points.len();
        let springs = springs.unwrap_or_else(|| vec![Springs::new(); points]);
        if springs.len() != points {
            let message = format!("springs of {} points, not {points}", springs.len());
            return Err(serde::de::Error::custom(message));
        }
        self.springs = springs;
        Ok(())
    }

    fn report(&self) -> Vec<Report> {
        if self.sides.len() == 2 {
            let force = self.force();
            let axes = ["x", "y", "z"].into_iter().zip(&force);
            return axes
                .map(|(axis, force)| Report::new(format!("force.{axis}"), "N", *force))
                .collect();
        }
        let touched = self.impulse.iter().filter(|j| j.norm_squared() > 0.0);
        vec![Report::new("points", "1", touched.count() as f64)]
    }
}

perimelt_core::register_coupler!("contact", Contact, supports: [Motion]);
