//! Least distance of the points of a fluid, kept by inelastic collisions.
//!
//! The divergence of the velocity does not see how close single points lie: where a flow stretches, rows of points meet
//! and pairs of points approach each other without a pressure that separates them. The moving-particle semi-implicit
//! method keeps its points apart by collisions (Lee, Park, Kim and Hwang (2011), with a coefficient of restitution). Here
//! a pair i, j with the vector `xi = r n` from i to j collides if it would come nearer than a distance d within the step,
//!
//! ```text
//! a = n . (v_i - v_j)                approach
//! b = max(r - d, 0) / dt             approach at which the distance d is reached at the end of the step
//! J = m_i m_j / (m_i + m_j) (a - b)  impulse along n, if a > b
//! ```
//!
//! so that points that come to rest at the distance d do not bounce. A point beside a closed face collides with its mirror
//! image: it comes no nearer to the face than d/2. Faces and pairs are visited in a fixed order (Gauss-Seidel), again until
//! no approach is too large. Impulses are central: momentum and angular momentum of the points are kept to
//! rounding, and since an approach is reduced but never turned, each collision takes kinetic energy.

use nalgebra::Vector3;
use perimelt_core::family::LayerRule;
use perimelt_core::{Body, Face, Family};
use rayon::prelude::*;

use crate::fluid::rates::POINTS_PER_TASK;

/// Largest number of sweeps over all pairs in a step. Where fewer are needed, as usual, no more are made.
const SWEEPS: usize = 200;

/// Approach that is left after the sweeps, as a fraction of the least distance per step.
const TOLERANCE: f64 = 1e-6;

/// Points of a fluid that keep a distance.
pub(super) struct DistantPoints<'a> {
    pub(super) body: &'a Body,
    pub(super) family: &'a Family,
    /// How the velocity continues behind faces: which of them are closed.
    pub(super) rules: &'a [LayerRule],
    /// Now, m.
    pub(super) position: &'a [Vector3<f64>],
    /// kg.
    pub(super) mass: &'a [f64],
    /// m.
    pub(super) distance: f64,
    /// Size of the step, s.
    pub(super) dt: f64,
}

/// Two points that may collide.
#[derive(Clone, Copy, Debug)]
struct Pair {
    points: [usize; 2],
    /// From the first to the second.
    normal: Vector3<f64>,
    /// `b`, m/s.
    allowed: f64,
    /// Fractions of the excess of the approach that the points take.
    fractions: [f64; 2],
}

/// A point that may collide with a face.
#[derive(Clone, Copy, Debug)]
struct AtFace {
    point: usize,
    axis: usize,
    /// Direction out of the body along the axis.
    outward: f64,
    /// m/s.
    allowed: f64,
}

impl DistantPoints<'_> {
    /// Takes the approach of points that would come too close to each other or to a closed face in this step.
    pub(super) fn keep(&self, velocity: &mut [Vector3<f64>]) {
        let square = velocity.par_iter().map(Vector3::norm_squared);
        let fastest = square.reduce(|| 0.0, f64::max).sqrt();
        let (pairs, at_faces) = (self.pairs(fastest), self.at_faces(fastest));
        let tolerance = TOLERANCE * self.distance / self.dt;
        for _ in 0..SWEEPS {
            let mut largest = 0.0_f64;
            for at in &at_faces {
                let v = &mut velocity[at.point][at.axis];
                let excess = at.outward * *v - at.allowed;
                if excess > 0.0 {
                    *v -= at.outward * excess;
                    largest = largest.max(excess);
                }
            }
            for pair in &pairs {
                let [i, j] = pair.points;
                let excess = pair.normal.dot(&(velocity[i] - velocity[j])) - pair.allowed;
                if excess > 0.0 {
                    velocity[i] -= pair.fractions[0] * excess * pair.normal;
                    velocity[j] += pair.fractions[1] * excess * pair.normal;
                    largest = largest.max(excess);
                }
            }
            if largest <= tolerance {
                return;
            }
        }
    }

    /// Speed of approach at which points at this distance (m) come to the distance `least` (m) in the step, m/s.
    fn allowed(&self, distance: f64, least: f64) -> f64 {
        (distance - least).max(0.0) / self.dt
    }

    /// Pairs that may come too close to each other at speeds up to `fastest` (m/s), in the order of their points.
    fn pairs(&self, fastest: f64) -> Vec<Pair> {
        let reach = self.distance + 2.0 * self.dt * fastest;
        let periodic = self.body.periodic.contains(&true);
        let point_of_slot = match periodic {
            true => self.family.points_of_slots(),
            false => Vec::new(),
        };
        let of_point = |point: usize| {
            let mut pairs = Vec::new();
            self.family.for_each_bond(point, |_, bond, slot| {
                if bond.length >= reach || bond.length == 0.0 {
                    return;
                }
                let xi = Vector3::from(bond.xi);
                let copied = || {
                    let other = *point_of_slot.get(slot)? as usize;
                    self.is_copy(point, other, &xi).then_some(other)
                };
                if let Some(other) = self.family.point_in(slot).or_else(copied)
                    && point < other
                {
                    pairs.push(self.pair([point, other], &xi, bond.length));
                }
            });
            // the order of bonds depends on when the family was found, which a restart changes
            pairs.sort_by_key(|pair| pair.points);
            pairs
        };
        let points = (0..self.position.len()).into_par_iter();
        let pairs = points.with_min_len(POINTS_PER_TASK).flat_map_iter(of_point);
        pairs.collect()
    }

    fn pair(&self, points: [usize; 2], xi: &Vector3<f64>, length: f64) -> Pair {
        let [m, n] = points.map(|point| self.mass[point]);
        Pair {
            points,
            normal: xi / length,
            allowed: self.allowed(length, self.distance),
            fractions: [n / (m + n), m / (m + n)],
        }
    }

    /// Whether the end of a bond `xi` (m) is a copy of a point behind periodic faces, not a mirror image.
    fn is_copy(&self, point: usize, other: usize, xi: &Vector3<f64>) -> bool {
        let Some(position) = self.position.get(other) else {
            return false;
        };
        let shift = position - self.position[point] - xi;
        let rounding = 1e-9 * self.distance;
        (0..3).all(|axis| {
            let [low, high] = [0, 1].map(|side| self.face_position(axis, side));
            let period = high - low;
            let is_shifted =
                self.body.periodic[axis] && (shift[axis].abs() - period).abs() < rounding;
            shift[axis].abs() < rounding || is_shifted
        })
    }

    fn face_position(&self, axis: usize, side: usize) -> f64 {
        self.body.face_position(Face::ALL[2 * axis + side])
    }

    /// Points that may come too close to closed faces at speeds up to `fastest`, m/s.
    fn at_faces(&self, fastest: f64) -> Vec<AtFace> {
        let least = 0.5 * self.distance;
        let reach = least + self.dt * fastest;
        let mut found = Vec::new();
        for face in Face::ALL {
            let axis = face.axis();
            let is_closed = self.rules.iter().any(|r| r.face == face);
            if !is_closed || axis >= self.body.dimension || self.body.periodic[axis] {
                continue;
            }
            let outward = if face.is_upper() { 1.0 } else { -1.0 };
            let end = self.body.face_position(face);
            for (point, x) in self.position.iter().enumerate() {
                let distance = outward * (end - x[axis]);
                if distance < reach {
                    found.push(AtFace {
                        point,
                        axis,
                        outward,
                        allowed: self.allowed(distance, least),
                    });
                }
            }
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use perimelt_core::shape::{BoxShape, Shape};
    use perimelt_core::{Correction, FamilySpec, Influence};

    use super::*;

    const SPACING: f64 = 0.01;
    const LEAST: f64 = 0.5 * SPACING;
    const DT: f64 = 1e-3;

    /// Numbers between -1 and 1 of a linear congruential generator.
    struct Random(u64);

    impl Random {
        fn next(&mut self) -> f64 {
            self.0 = (self.0.wrapping_mul(6364136223846793005)).wrapping_add(1442695040888963407);
            (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        }
    }

    /// Points of a box in disorder, with velocities (m/s) by which many of them would meet within a step.
    struct Crowd {
        body: Body,
        family: Family,
        position: Vec<Vector3<f64>>,
        velocity: Vec<Vector3<f64>>,
        mass: Vec<f64>,
    }

    impl Crowd {
        fn new(faces: &[Face], periodic: [bool; 3]) -> Self {
            let shape = Shape::Box(BoxShape {
                min: [0.0; 3],
                max: [0.1, 0.1, SPACING],
            });
            let mut body = Body::fill("water", &shape, 2, SPACING, 1.0).expect("valid");
            body.periodic = periodic;
            let spec = FamilySpec {
                correction: Correction::None,
                influence: Influence::Wendland,
                layers: faces.to_vec(),
                ..FamilySpec::new(3.0 * SPACING)
            };
            let mut random = Random(1);
            let mut random_in_plane = |size: f64| {
                let [x, y] = [random.next(), random.next()];
                size * Vector3::new(x, y, 0.0)
            };
            let start = body.points.position.to_vec();
            let disorder = 0.24 * SPACING;
            let position: Vec<_> = start
                .iter()
                .map(|x| x + random_in_plane(disorder))
                .collect();
            let velocity = start.iter().map(|_| random_in_plane(8.0)).collect();
            let mut family = Family::moving(&body, &spec).expect("valid");
            family.rebuild_rows(&position);
            family.update_weights(&position, &body.points.volume);
            let mass = (0..start.len()).map(|i| 0.1 + 0.01 * (i % 7) as f64);
            Crowd {
                mass: mass.collect(),
                body,
                family,
                position,
                velocity,
            }
        }

        /// Lets the points collide; returns their velocities.
        fn keep(&self, rules: &[LayerRule]) -> Vec<Vector3<f64>> {
            let points = DistantPoints {
                body: &self.body,
                family: &self.family,
                rules,
                position: &self.position,
                mass: &self.mass,
                distance: LEAST,
                dt: DT,
            };
            let mut velocity = self.velocity.clone();
            points.keep(&mut velocity);
            velocity
        }

        /// Momentum, angular momentum and kinetic energy of all points, at their positions before the step.
        fn sums(&self, velocity: &[Vector3<f64>]) -> (Vector3<f64>, Vector3<f64>, f64) {
            let mut sums = (Vector3::zeros(), Vector3::zeros(), 0.0);
            for ((v, x), m) in velocity.iter().zip(&self.position).zip(&self.mass) {
                sums.0 += *m * v;
                sums.1 += x.cross(&(*m * v));
                sums.2 += 0.5 * m * v.norm_squared();
            }
            sums
        }

        /// Through periodic sides of 0.1 m.
        fn nearest_copy(&self, mut xi: Vector3<f64>) -> Vector3<f64> {
            for axis in 0..2 {
                if self.body.periodic[axis] {
                    xi[axis] -= 0.1 * (xi[axis] / 0.1).round();
                }
            }
            xi
        }

        /// Smallest distance of two points at the end of the step, in that which they had or the least one, whichever is
        /// smaller.
        fn nearest(&self, velocity: &[Vector3<f64>]) -> f64 {
            let mut nearest = f64::INFINITY;
            for i in 0..velocity.len() {
                for j in 0..i {
                    let xi = self.nearest_copy(self.position[j] - self.position[i]);
                    let after = xi + DT * (velocity[j] - velocity[i]);
                    nearest = nearest.min(after.norm() / xi.norm().min(LEAST));
                }
            }
            nearest
        }
    }

    #[test]
    fn momentum_is_exact_energy_falls_and_points_keep_their_distance() {
        let crowd = Crowd::new(&[], [false; 3]);
        assert!(crowd.nearest(&crowd.velocity) < 0.5);
        let after = crowd.keep(&[]);
        assert!(
            crowd.nearest(&after) > 1.0 - 1e-3,
            "{}",
            crowd.nearest(&after)
        );
        let [before, now] = [&crowd.velocity, &after].map(|v| crowd.sums(v));
        assert!((now.0 - before.0).norm() < 1e-12, "{}", now.0 - before.0);
        assert!((now.1 - before.1).norm() < 1e-13, "{}", now.1 - before.1);
        assert!(now.2 < before.2 && now.2 > 0.0, "{} {}", now.2, before.2);
    }

    #[test]
    fn points_keep_half_the_distance_from_closed_faces() {
        let faces = [Face::XMin, Face::YMax];
        let crowd = Crowd::new(&faces, [false; 3]);
        let rules = faces.map(LayerRule::even);
        let after = crowd.keep(&rules);
        assert!(crowd.nearest(&after) > 1.0 - 1e-3);
        let mut have_met = 0;
        for (i, x) in crowd.position.iter().enumerate() {
            let gap = |x: Vector3<f64>| x.x.min(0.1 - x.y);
            let free = gap(x + DT * crowd.velocity[i]);
            have_met += usize::from(free < 0.5 * LEAST);
            let least = gap(*x).min(0.5 * LEAST);
            assert!(gap(x + DT * after[i]) > least - 1e-3 * LEAST);
        }
        assert!(have_met > 1);
        assert!(crowd.sums(&after).2 < crowd.sums(&crowd.velocity).2);
    }

    #[test]
    fn a_point_before_a_face_stops_at_half_the_distance() {
        let faces = [Face::XMin, Face::YMax];
        for (face, [x, y]) in [(0, [0.0, 0.05]), (1, [0.05, 0.1])] {
            let mut crowd = Crowd::new(&faces, [false; 3]);
            let near = |p: &Vector3<f64>| (p - Vector3::new(x, y, p.z)).norm();
            let distances: Vec<f64> = crowd.position.iter().map(near).collect();
            let nearest =
                (0..distances.len()).min_by(|a, b| distances[*a].total_cmp(&distances[*b]));
            let nearest = nearest.expect("there are points");
            let out = [-Vector3::x(), Vector3::y()][face];
            crowd
                .velocity
                .iter_mut()
                .for_each(|v| *v = Vector3::zeros());
            crowd.velocity[nearest] = 8.0 * out;
            let after = crowd.keep(&faces.map(LayerRule::even));
            let at = crowd.position[nearest];
            let gap = [at.x, 0.1 - at.y][face];
            let allowed = (gap - 0.5 * LEAST).max(0.0) / DT;
            assert!((after[nearest].dot(&out) - allowed).abs() < 1e-3 * LEAST / DT);
        }
    }

    #[test]
    fn points_collide_across_periodic_sides_and_not_with_mirror_images() {
        let crowd = Crowd::new(&[], [true, true, false]);
        let after = crowd.keep(&[]);
        assert!(crowd.nearest(&after) > 1.0 - 1e-3);
        let [before, now] = [&crowd.velocity, &after].map(|v| crowd.sums(v).0);
        assert!((now - before).norm() < 1e-12);
    }

    #[test]
    fn points_that_do_not_meet_keep_their_velocity_to_the_bit() {
        let mut crowd = Crowd::new(&[Face::YMin], [false; 3]);
        crowd.velocity.iter_mut().for_each(|v| *v *= 1e-4);
        assert_eq!(crowd.keep(&[LayerRule::even(Face::YMin)]), crowd.velocity);
    }
}
