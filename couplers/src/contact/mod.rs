//! Contact: points that come too close push each other away, whatever bonds there are.
//!
//! ```text
//! f_i = sum_j k (d_ij - |y_i - y_j|) n V_j   where positive,   k = 15 c / horizon
//! d_ij = min(0.9 |x_i - x_j|, 1.35 (spacing_i + spacing_j) / 2)
//! ```
//!
//! after Silling and Askari (2005), section 6, with the bond constant c of a horizon of 3 spacings at
//! Young's modulus of the points. Bonded neighbours repel each other only once they are 10 % closer than
//! in the reference configuration. Without friction.
//!
//! The forces of a step are those of its end, to which positions are extrapolated with the velocities:
//! forces of its beginning would lag behind and feed the motion.

mod impactor;

pub use impactor::Impactor;

use nalgebra::Vector3;
use perimelt_core::cell_list::CellList;
use perimelt_core::solver::reduce::max_abs;
use perimelt_core::{
    Body, Coupler, FamilySpec, Read, Report, RunError, Setup, SetupError, Step, World, Write, keys,
};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Pieces of a body, or two bodies, do not pass through each other; for explicit mechanics.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Contact {
    /// Body; may be left out when there is one only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<String>,
    /// The body that it meets; left out: its own pieces meet.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub other: Option<String>,
    /// Stiffness of the contact in those of a bond.
    #[serde(default = "fifteen")]
    pub stiffness: f64,
    #[serde(skip)]
    #[schemars(skip)]
    prepared: Option<Prepared>,
}

fn fifteen() -> f64 {
    15.0
}

/// Points that a thread takes at a time.
const POINTS: usize = 4096;

/// Distance at which unbonded points meet, in spacings.
const REACH: f64 = 1.35;
/// Distance at which bonded points meet, as a share of that at rest.
const CLOSE: f64 = 0.9;
/// How much farther than their reach candidates are sought, in spacings: the list serves until a point
/// has moved half of this.
const SKIN: f64 = 0.3;

#[derive(Debug)]
struct Prepared {
    sides: Vec<Side>,
    /// Number of points of the first body, where there are two.
    first: Option<usize>,
    /// Of all points, those of the first body first.
    reference: Vec<Vector3<f64>>,
    spacing: Vec<f64>,
    volume: Vec<f64>,
    /// k, N/m⁷.
    stiffness: Vec<f64>,
    /// At the end of the step.
    position: Vec<Vector3<f64>>,
    candidates: Candidates,
    /// N/m³.
    force: Vec<Vector3<f64>>,
    /// Start and size of the step that the forces are of.
    step: Option<[f64; 2]>,
}

/// A body in contact.
#[derive(Debug)]
struct Side {
    body: usize,
    motion: Motion,
    body_force: Write<Vector3<f64>>,
}

/// Where the points of a body are and how they move.
#[derive(Debug)]
struct Motion {
    displacement: Read<Vector3<f64>>,
    velocity: Read<Vector3<f64>>,
}

impl Motion {
    fn of(setup: &mut Setup<'_>, body: usize) -> Result<Motion, SetupError> {
        Ok(Motion {
            displacement: setup.read(body, &keys::DISPLACEMENT)?,
            velocity: setup.read(body, &keys::VELOCITY)?,
        })
    }

    /// Positions after `time` (s) at the present velocities, m.
    fn extrapolate(
        &self,
        world: &World,
        (reference, time): (&[Vector3<f64>], f64),
        out: &mut [Vector3<f64>],
    ) {
        let (displacement, velocity) = (world.read(self.displacement), world.read(self.velocity));
        let points = out.par_iter_mut().zip(reference).zip(&*displacement);
        let points = points.zip(&*velocity).with_min_len(POINTS);
        points.for_each(|(((y, x), u), v)| *y = x + u + time * v);
    }
}

/// Stiffness of the contact of each point, N/m⁷.
fn stiffness(setup: &Setup<'_>, body: usize, factor: f64) -> Result<Vec<f64>, SetupError> {
    let modulus = setup.property(body, "youngs_modulus")?;
    let this = setup.body(body);
    // of a bond-based solid: 2 d bulk
    let share = [2.0, 3.0, 4.0][this.dimension - 1];
    let point = |(material, spacing): (&u16, &f64)| {
        let horizon = 3.0 * spacing;
        let moment = FamilySpec::new(horizon).moment(this, horizon);
        factor * share * max_abs(&modulus[*material as usize].values()) / (moment * horizon)
    };
    let points = this.material_of_point.iter().zip(&this.points.spacing);
    Ok(points.map(point).collect())
}

fn check_stiffness(stiffness: f64) -> Result<(), SetupError> {
    match stiffness > 0.0 && stiffness.is_finite() {
        true => Ok(()),
        false => {
            let message = format!("a contact of stiffness {stiffness} holds nothing apart");
            Err(SetupError::value(
                "stiffness",
                message,
                "above 0, such as 15",
            ))
        }
    }
}

/// For each point, those that it may touch before the list is made again, ascending.
#[derive(Debug, Default)]
struct Candidates {
    cells: CellList,
    reach: Vec<f64>,
    /// Positions for which the list was made.
    made_for: Vec<Vector3<f64>>,
    start: Vec<u32>,
    other: Vec<u32>,
    /// Square of the distance at which each is met, m².
    square: Vec<f64>,
}

impl Prepared {
    /// Distance at which two points meet, m.
    fn distance(&self, i: usize, j: usize) -> f64 {
        let rest = (self.reference[i] - self.reference[j]).norm();
        let reach = 0.5 * REACH * (self.spacing[i] + self.spacing[j]);
        reach.min(CLOSE * rest)
    }

    fn update_candidates(&mut self) {
        let mut list = std::mem::take(&mut self.candidates);
        let skin = |i: usize| SKIN * self.spacing[i];
        let moved = |(i, (y, old)): (usize, (&Vector3<f64>, &Vector3<f64>))| {
            (y - old).norm_squared() > (0.5 * skin(i)).powi(2)
        };
        let pairs = self.position.par_iter().zip(&list.made_for).enumerate();
        if list.made_for.is_empty() || pairs.with_min_len(POINTS).any(moved) {
            list.reach.clear();
            list.reach
                .extend(self.spacing.iter().map(|s| (REACH + SKIN) * s));
            list.cells.update(&self.position, &list.reach);
            list.made_for.clear();
            list.made_for.extend_from_slice(&self.position);
            list.start.clear();
            list.other.clear();
            list.square.clear();
            list.start.push(0);
            for (i, y) in self.position.iter().enumerate() {
                let own = list.other.len();
                let other = &mut list.other;
                list.cells.visit_near(y, list.reach[i], |j| {
                    let meets = match self.first {
                        Some(first) => (i < first) != (j < first),
                        None => i != j,
                    };
                    // the skin of either may be used up
                    let within = self.distance(i, j) + 0.5 * (skin(i) + skin(j));
                    if meets && (y - self.position[j]).norm_squared() < within * within {
                        other.push(j as u32);
                    }
                });
                // in an order that does not depend on when the list was made
                list.other[own..].sort_unstable();
                let squares = list.other[own..].iter();
                list.square
                    .extend(squares.map(|&j| self.distance(i, j as usize).powi(2)));
                list.start.push(list.other.len() as u32);
            }
        }
        self.candidates = list;
    }

    /// Forces at the end of `step`.
    fn evaluate(&mut self, world: &World, step: Step) {
        let mut rest = &mut self.position[..];
        for side in &self.sides {
            let reference = &world.body(side.body).points.position;
            let (own, others) = rest.split_at_mut(reference.len());
            side.motion.extrapolate(world, (reference, step.size), own);
            rest = others;
        }
        self.update_candidates();
        let mut force = std::mem::take(&mut self.force);
        let list = &self.candidates;
        let points = force.par_iter_mut().enumerate().with_min_len(POINTS / 4);
        points.for_each(|(i, force)| {
            *force = Vector3::zeros();
            let range = list.start[i] as usize..list.start[i + 1] as usize;
            for (&j, &limit) in list.other[range.clone()].iter().zip(&list.square[range]) {
                let j = j as usize;
                let apart = self.position[i] - self.position[j];
                let square = apart.norm_squared();
                if square < limit && square > 0.0 {
                    let apart_by = square.sqrt();
                    let stiffness = 0.5 * (self.stiffness[i] + self.stiffness[j]);
                    let size = stiffness * (limit.sqrt() - apart_by) * self.volume[j];
                    *force += apart * (size / apart_by);
                }
            }
        });
        self.force = force;
    }
}

#[typetag::serde(name = "contact")]
impl Coupler for Contact {
    fn prepare(&mut self, setup: &mut Setup<'_>) -> Result<(), SetupError> {
        check_stiffness(self.stiffness)?;
        let body = setup.find_body(self.body.as_deref())?;
        let mut bodies = vec![body];
        if let Some(other) = &self.other {
            let other = setup.find_body(Some(other)).map_err(|mut e| {
                e.key = "other".into();
                e
            })?;
            if other == body {
                let message = "a body meets itself when `other` is left out";
                return Err(SetupError::value(
                    "other",
                    message,
                    "the name of another body",
                ));
            }
            bodies.push(other);
        }
        let mut prepared = Prepared {
            first: (bodies.len() == 2).then(|| setup.body(body).points.len()),
            sides: Vec::new(),
            reference: Vec::new(),
            spacing: Vec::new(),
            volume: Vec::new(),
            stiffness: Vec::new(),
            position: Vec::new(),
            candidates: Candidates::default(),
            force: Vec::new(),
            step: None,
        };
        for body in bodies {
            prepared.sides.push(Side {
                body,
                motion: Motion::of(setup, body)?,
                body_force: setup.add(body, &keys::BODY_FORCE)?,
            });
            let stiffness = stiffness(setup, body, self.stiffness)?;
            prepared.stiffness.extend(stiffness);
            let Body { points, .. } = setup.body(body);
            prepared.reference.extend(&points.position);
            prepared.spacing.extend(&points.spacing);
            prepared.volume.extend(&points.volume);
        }
        prepared.position = prepared.reference.clone();
        prepared.force = vec![Vector3::zeros(); prepared.position.len()];
        self.prepared = Some(prepared);
        Ok(())
    }

    /// Two bodies that take the same step feel the same forces: their momentum is kept.
    fn apply(&mut self, world: &World, step: Step) -> Result<(), RunError> {
        let p = self.prepared.as_mut().expect("prepared before the run");
        let now = Some([step.start, step.size]);
        if p.step != now {
            p.evaluate(world, step);
            p.step = now;
        }
        let mut rest = &p.force[..];
        for side in &p.sides {
            let mut body_force = world.write(side.body_force);
            let (own, others) = rest.split_at(body_force.len());
            let points = body_force.par_iter_mut().zip(own).with_min_len(POINTS);
            points.for_each(|(sum, f)| *sum += f);
            rest = others;
        }
        Ok(())
    }

    /// State of the moment is all there is.
    fn load(
        &mut self,
        _: &mut dyn erased_serde::Deserializer<'_>,
    ) -> Result<(), erased_serde::Error> {
        self.prepared
            .as_mut()
            .expect("prepared before a restart")
            .step = None;
        Ok(())
    }

    fn report(&self) -> Vec<Report> {
        let Some(p) = &self.prepared else {
            return Vec::new();
        };
        let points = &p.force[..p.first.unwrap_or(p.force.len())];
        let pairs = points.iter().zip(&p.volume);
        match p.first {
            Some(_) => {
                let force: Vector3<f64> = pairs.map(|(f, volume)| f * *volume).sum();
                let axes = ["x", "y", "z"].into_iter().zip(force.iter());
                axes.map(|(axis, force)| Report {
                    name: format!("force.{axis}"),
                    unit: "N".into(),
                    value: *force,
                })
                .collect()
            }
            None => vec![Report {
                name: "points".into(),
                unit: "1".into(),
                value: pairs.filter(|(f, _)| f.norm_squared() > 0.0).count() as f64,
            }],
        }
    }
}

perimelt_core::register_coupler!("contact", Contact);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{block, prepare, read, refusal, values};

    const ELASTIC: &str = "density = 1000\nyoungs_modulus = 1e6";

    fn own(setup: &mut Setup<'_>, bodies: usize) {
        for body in 0..bodies {
            setup.own(body, &keys::DISPLACEMENT).expect("free");
            setup.own(body, &keys::VELOCITY).expect("free");
            setup.consume(body, &keys::BODY_FORCE).expect("free");
        }
    }

    /// A world of two blocks, the second moved by `offset`.
    fn two(offset: [f64; 3]) -> World {
        let mut second = block([3, 2, 2], 3, ELASTIC);
        second.name = "second".into();
        second
            .points
            .position
            .iter_mut()
            .for_each(|x| *x += Vector3::from(offset));
        World::new(vec![block([3, 2, 2], 3, ELASTIC), second])
    }

    #[test]
    fn bodies_repel_each_other_and_keep_their_momentum() {
        for (gap, touch) in [(0.3, true), (0.4, false)] {
            // apart by one spacing and the gap at the nearest points
            let mut world = two([4.0, 0.1, 0.0]);
            let mut contact: Contact = read("body = 'block'\nother = 'second'");
            prepare(&mut world, &mut contact, |setup| own(setup, 2)).expect("valid");
            // half of the way is gone, the other half is what the step will bring
            for (field, share) in [("displacement", 0.5), ("velocity", 5.0)] {
                let index = world.fields().find(0, field).expect("owned");
                let mut data = world.fields().field(index).data_mut();
                let x = data.flat_mut().chunks_exact_mut(3);
                x.for_each(|v| v[0] = share * (1.0 - gap));
            }
            contact.apply(&world, Step::new(0.0, 0.1)).expect("applies");
            let total = |body: usize| {
                let index = world.fields().find(body, "body_force").expect("a sink");
                let field = world.fields().field(index).data();
                let (vectors, _) = field.flat().as_chunks::<3>();
                vectors
                    .iter()
                    .map(|f| Vector3::from(*f))
                    .sum::<Vector3<f64>>()
            };
            let (first, second) = (total(0), total(1));
            assert!((first + second).norm() <= 1e-12 * first.norm());
            assert_eq!(first.x < 0.0 && second.x > 0.0, touch, "{first:?}");
            let reported: f64 = contact.report()[0].value;
            assert!((reported - first.x).abs() <= 1e-12 * first.norm());
        }
    }

    #[test]
    fn a_body_at_rest_or_turned_feels_nothing_and_one_that_is_crushed_resists() {
        for (shrink, touch) in [(1.0, false), (0.95, false), (0.85, true)] {
            let mut world = World::new(vec![block([5, 4, 3], 3, ELASTIC)]);
            let mut contact: Contact = read("stiffness = 10");
            prepare(&mut world, &mut contact, |setup| own(setup, 1)).expect("valid");
            let turn = nalgebra::Rotation3::from_euler_angles(0.4, 1.0, -0.3);
            let positions = world.body(0).points.position.clone();
            let index = world.fields().find(0, "displacement").expect("owned");
            let mut data = world.fields().field(index).data_mut();
            let u = data.flat_mut().chunks_exact_mut(3).zip(&positions);
            u.for_each(|(u, x)| u.copy_from_slice((turn * (x * shrink) - x).as_slice()));
            drop(data);
            contact.apply(&world, Step::new(0.0, 0.1)).expect("applies");
            let force = values(&world, &keys::BODY_FORCE);
            assert_eq!(force.iter().any(|f| f.abs() > 1e-6), touch, "{shrink}");
        }
    }

    #[test]
    fn forces_do_not_depend_on_when_the_list_of_candidates_was_made() {
        let mut world = World::new(vec![block([6, 5, 4], 3, ELASTIC)]);
        let mut old: Contact = read("");
        prepare(&mut world, &mut old, |setup| own(setup, 1)).expect("valid");
        old.apply(&world, Step::new(0.0, 0.1)).expect("applies");
        let mut other = World::new(vec![block([6, 5, 4], 3, ELASTIC)]);
        let mut new: Contact = read("");
        prepare(&mut other, &mut new, |setup| own(setup, 1)).expect("valid");
        for world in [&world, &other] {
            let positions = world.body(0).points.position.clone();
            let index = world.fields().find(0, "displacement").expect("owned");
            let mut data = world.fields().field(index).data_mut();
            let u = data.flat_mut().chunks_exact_mut(3).zip(&positions);
            // within the skin, so that the list of the first one serves
            u.for_each(|(u, x)| u[0] = 0.14 * (7.0 * x.x + 3.0 * x.y + x.z).sin());
        }
        for (contact, world) in [(&mut old, &world), (&mut new, &other)] {
            contact.apply(world, Step::new(1.0, 0.1)).expect("applies");
        }
        let force = values(&world, &keys::BODY_FORCE);
        assert!(force.iter().any(|f| *f != 0.0));
        assert_eq!(force, values(&other, &keys::BODY_FORCE));
    }

    #[test]
    fn a_contact_with_itself_or_without_stiffness_is_refused() {
        for (keys, message) in [
            ("body = 'block'\nother = 'block'", "meets itself"),
            ("body = 'block'\nstiffness = 0", "holds nothing apart"),
        ] {
            let mut contact: Contact = read(keys);
            assert!(refusal(&mut two([9.0; 3]), &mut contact).contains(message));
        }
    }
}
