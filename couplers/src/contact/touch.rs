//! Which points touch, and how deep.

use nalgebra::Vector3;

use super::{RunningContact, Surfaces};

/// Distance at which unbonded points meet, in spacings.
pub(super) const REACH: f64 = 1.35;
/// Distance at which bonded points meet, as a fraction of that at rest.
const CLOSE: f64 = 0.9;
/// Range of a point of another body along the surface, in spacings.
const WIDTH: f64 = 2.0;
/// Largest deviation of a plane from flat, by dimension: a plane has 1, 0.6 and 0.38, an edge 0.94 and 0.6.
const FLAT: [f64; 3] = [f64::INFINITY, 0.75, 0.48];
/// Largest cosine between the outward normals of two flat surfaces that face each other. The side of a block on a floor does
/// not face the floor: a normal halfway between both would resist sliding.
const FACING_COSINE: f64 = -0.3;

/// A point in contact.
#[derive(Clone, Copy, Debug)]
pub(super) struct ContactPoint {
    /// Position in the reference configuration, m.
    pub(super) position: Vector3<f64>,
    /// m.
    pub(super) spacing: f64,
    /// m³.
    pub(super) volume: f64,
    /// kg.
    pub(super) mass: f64,
    /// Contact stiffness k, N/m⁷.
    pub(super) stiffness: f64,
}

impl ContactPoint {
    pub(super) fn numbers(&self) -> [f64; 7] {
        let [x, y, z] = self.position.into();
        let ContactPoint {
            spacing,
            volume,
            mass,
            stiffness,
            ..
        } = *self;
        [x, y, z, spacing, volume, mass, stiffness]
    }

    pub(super) fn from_numbers(
        [x, y, z, spacing, volume, mass, stiffness]: [f64; 7],
    ) -> ContactPoint {
        ContactPoint {
            position: Vector3::new(x, y, z),
            spacing,
            volume,
            mass,
            stiffness,
        }
    }

    /// Distance at which two points meet, m.
    pub(super) fn distance(&self, other: &ContactPoint) -> f64 {
        let rest = (self.position - other.position).norm();
        let reach = 0.5 * REACH * (self.spacing + other.spacing);
        reach.min(CLOSE * rest)
    }
}

/// Range of a point of another body, m, along and across its surface.
pub(super) fn contact_range(spacing: f64) -> f64 {
    (1.0 + WIDTH * WIDTH).sqrt() * spacing
}

/// Two points in contact, seen from the first one.
pub(super) struct Touch {
    /// Unit vector from the other point to this one.
    pub(super) normal: Vector3<f64>,
    /// Normal impulse, N s.
    pub(super) impulse: f64,
    /// Normal stiffness, N/m.
    pub(super) stiffness: f64,
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
    /// Calls `receive` with each point that touches point `i` and its contact in a step of `dt` (s).
    pub(super) fn for_each_touch(&self, i: usize, dt: f64, mut receive: impl FnMut(usize, Touch)) {
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
        let [(own, own_edge), (other, other_edge)] = [i, j].map(|point| {
            let [x, y, z, edge] = surfaces.normals[point];
            (Vector3::new(x, y, z), edge)
        });
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
}
