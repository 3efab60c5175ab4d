//! Collision of fluid points with walls that are bodies, where pressure does not keep them out: at speeds near that of
//! sound, or for single points, which have no pressure.
//!
//! A point f of the fluid collides with the nearest point s of a wall if it approaches it and would come closer to it than
//! d spacings along its normal (Gao (2020), eqs. 7.10 to 7.14, with the velocity relative to the wall as in eq. 6.45, where
//! eq. 7.12 has that of the fluid),
//!
//! ```text
//! n . (y_f + dt v_f - (y_s + dt v_s - d dx n)) > 0   and   n . (v_f - v_w) > 0
//! v_f <- v_f - (1 + e) M / (m_f + M) [n . (v_f - v_w)] n
//! ```
//!
//! with the coefficient of restitution e (1 in the reference) and the normal n of the wall from the fluid to the solid
//! ([`wall_normal`]). It is then displaced with this velocity
//! from its old position and so does not penetrate; no point is displaced beside that, so that momenta are not moved.
//!
//! The wall takes the opposite of what the fluid gets. It is distributed over the points of the wall around by weights with
//! `sum_k l_k = 1` and `sum_k l_k (y_k - y_f) = 0` along the wall (moving least squares of first order), so that angular
//! momentum is kept, too. In return the wall has the velocity `v_w = sum_k l_k v_k`, and the mass
//! `1/M = sum_k l_k^2 / m_k` if its points move on their own: with e = 1 the collision is elastic for fluid and wall together.
//! The reference takes M as infinite, with which a fluid that collides with a light solid gains energy; so does this scheme for
//! rigid bodies, whose mass is large beside that of a fluid point.
//!
//! A point under tension, which the wall attracts, loses its approach only (e = 0). Density and velocity
//! advance one after the other, with the invariant `q^2 + v^2 + w dt q v` of a sound wave (q: pressure over `rho c`): a reversal of v
//! adds to it where the pressure is negative, and a single point that bounces along a wall gains energy without bound.

use nalgebra::{Matrix4, Vector3, Vector4};
use perimelt_core::SetupError;
use perimelt_core::family::{ForeignBond, ForeignBonds};
use perimelt_core::numbers::check_fraction;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::fluid::walls::interface::{Interface, wall_normal};

/// Distance of a point that collides from the nearest point of a wall at most, in the half diagonal of a cell of the wall.
const NEAREST: f64 = 1.1;

/// Least determinant of the moments of a distribution; a complete neighbourhood has about 0.1.
const LEAST_DETERMINANT: f64 = 1e-4;

/// Collision of points of a fluid with solids that they would penetrate (Gao (2020), eqs. 7.10 to 7.14, with
/// the velocity relative to the solid). Without keys as published: elastic, at the face of the solid.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Collisions {
    /// Coefficient of restitution, from 0 to 1: 1 reflects the velocity relative to the solid, 0 takes the approach only.
    #[schemars(extend("minimum" = 0, "maximum" = 1))]
    pub restitution: f64,
    /// Distance from the first points of the solid within which points collide, in spacings of the solid, from 0 to 1:
    /// its face lies at 0.5. Fluid under pressure against a curved solid touches the face, and its collisions there
    /// are noise in the pressure; 0.25 lets only those collide that the pressure has not kept out.
    #[schemars(extend("minimum" = 0, "maximum" = 1))]
    pub distance: f64,
}

impl Default for Collisions {
    fn default() -> Self {
        Collisions {
            restitution: 1.0,
            distance: 0.5,
        }
    }
}

impl Collisions {
    pub(crate) fn check(&self) -> Result<(), SetupError> {
        check_fraction("collisions.restitution", self.restitution)?;
        check_fraction("collisions.distance", self.distance)?;
        Ok(())
    }
}

/// Points of the fluid during a step.
pub(crate) struct FluidPoints<'a> {
    /// m/s.
    pub(crate) velocity: &'a mut [Vector3<f64>],
    /// kg.
    pub(crate) mass: &'a [f64],
    /// Pa.
    pub(crate) pressure: &'a [f64],
    pub(crate) rule: Collisions,
    /// Size of the step, s.
    pub(crate) dt: f64,
}

/// A wall as collisions see it.
pub(crate) struct CollisionWall<'a> {
    /// All walls of the fluid.
    pub(crate) interfaces: &'a [Interface<'a>],
    /// Place of this wall among them.
    pub(crate) number: usize,
    /// Spacing of the wall, m.
    pub(crate) spacing: f64,
    /// Masses of its points, kg; `None` for a rigid body.
    pub(crate) mass: Option<&'a [f64]>,
}

/// An impulse (N s) on a fluid point; the wall has the opposite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Hit {
    pub(crate) point: usize,
    pub(crate) impulse: Vector3<f64>,
}

/// Fraction of an impulse that a point of the wall, seen through a bond, takes.
#[derive(Clone, Copy, Debug)]
struct Part {
    bond: usize,
    fraction: f64,
}

impl CollisionWall<'_> {
    fn bonds(&self) -> &ForeignBonds {
        self.interfaces[self.number].bonds
    }

    /// Lets points of the fluid collide with the wall, whose points have these velocities (m/s). Appends the impulses on
    /// points of the wall to `impulses` (N s) and passes each one on the fluid to `receive`.
    pub(crate) fn collide(
        &self,
        fluid: &mut FluidPoints<'_>,
        velocity: &mut [Vector3<f64>],
        impulses: &mut Vec<(usize, Vector3<f64>)>,
        mut receive: impl FnMut(Hit),
    ) {
        let bonds = self.bonds();
        for (owner, &point) in bonds.owners().iter().enumerate() {
            let point = point as usize;
            let Some((normal, parts)) = self.find(owner, fluid, velocity) else {
                continue;
            };
            let of_wall = |part: &Part| {
                let ghost = bonds.bond(part.bond).ghost;
                part.fraction * ghost.reflect(velocity[ghost.point])
            };
            let wall: Vector3<f64> = parts.iter().map(of_wall).sum();
            let approach = normal.dot(&(fluid.velocity[point] - wall));
            if !(approach > 0.0) {
                continue;
            }
            let inverse = |part: &Part| {
                let mass = self.mass.map(|m| m[bonds.bond(part.bond).ghost.point]);
                mass.map_or(0.0, |m| part.fraction * part.fraction / m)
            };
            let mobility = parts.iter().map(inverse).sum();
            let restitution = match fluid.pressure[point] < 0.0 {
                true => 0.0,
                false => fluid.rule.restitution,
            };
            let impulse = impulse(approach, fluid.mass[point], mobility, restitution) * normal;
            fluid.velocity[point] += impulse / fluid.mass[point];
            for part in &parts {
                let ghost = bonds.bond(part.bond).ghost;
                let taken = -part.fraction * ghost.reflect(impulse);
                impulses.push((ghost.point, taken));
                if let Some(mass) = self.mass {
                    // what collides next meets a wall that has been hit
                    velocity[ghost.point] += taken / mass[ghost.point];
                }
            }
            receive(Hit { point, impulse });
        }
    }

    /// The normal at the point of the wall with which a fluid point collides, and how the wall takes it; `None` if it does not.
    fn find(
        &self,
        owner: usize,
        fluid: &FluidPoints<'_>,
        velocity: &[Vector3<f64>],
    ) -> Option<(Vector3<f64>, Vec<Part>)> {
        let (bonds, interface) = (self.bonds(), &self.interfaces[self.number]);
        let length = |n: &usize| bonds.bond(*n).bond.length;
        let all = bonds.bonds_of(owner);
        let nearest = all.min_by(|a, b| length(a).total_cmp(&length(b)))?;
        let ForeignBond { bond, point, ghost } = bonds.bond(nearest);
        let relative = fluid.velocity[point] - ghost.reflect(velocity[ghost.point]);
        let diagonal = 0.5 * self.spacing * (interface.dimension as f64).sqrt();
        if bond.length > NEAREST * diagonal + fluid.dt * relative.norm() {
            return None;
        }
        let at = &interface.solid.positions[ghost.point];
        let normal = ghost.reflect(wall_normal(self.interfaces, at)?);
        let distance = normal.dot(&Vector3::from(bond.xi));
        let approach = normal.dot(&relative);
        if !(approach > 0.0 && distance - fluid.dt * approach < fluid.rule.distance * self.spacing)
        {
            return None;
        }
        let all = bonds.bonds_of(owner);
        Some((normal, distribute(bonds, all, &normal, nearest)))
    }
}

/// Impulse (N s) of a collision with this relative velocity (m/s), from the mass of one body (kg) and the inverse of the
/// other one's (1/kg).
fn impulse(approach: f64, mass: f64, mobility: f64, restitution: f64) -> f64 {
    -(1.0 + restitution) * approach * mass / (1.0 + mass * mobility)
}

/// Fractions of an impulse on a fluid point at points of a wall, whose first moment along the wall vanishes; all of it at
/// the nearest bond where these points do not span the wall.
fn distribute(
    bonds: &ForeignBonds,
    all: std::ops::Range<usize>,
    normal: &Vector3<f64>,
    nearest: usize,
) -> Vec<Part> {
    let scale = bonds.bond(nearest).bond.length;
    // 1 and the way along the wall
    let basis = |number: usize| {
        let xi = Vector3::from(bonds.bond(number).bond.xi) / scale;
        (xi - normal.dot(&xi) * normal).insert_row(0, 1.0)
    };
    let weight = |number: usize| bonds.bond(number).bond.dual;
    let total: f64 = all.clone().map(weight).sum();
    let mut moments = Matrix4::zeros();
    for number in all.clone() {
        let p: Vector4<f64> = basis(number);
        moments += weight(number) / total * p * p.transpose();
    }
    // across the wall, and across the plane of a plane body, nothing is to be balanced
    let across = normal.insert_row(0, 0.0);
    moments += across * across.transpose();
    if all.clone().all(|n| bonds.bond(n).bond.xi[2] == 0.0) && normal.z == 0.0 {
        moments[(3, 3)] += 1.0;
    }
    if let Some(inverse) = moments.try_inverse()
        && moments.determinant() > LEAST_DETERMINANT
    {
        let part = |number: usize| Part {
            bond: number,
            fraction: weight(number) / total * inverse.column(0).dot(&basis(number)),
        };
        return all.filter(|n| weight(*n) > 0.0).map(part).collect();
    }
    vec![Part {
        bond: nearest,
        fraction: 1.0,
    }]
}

#[cfg(test)]
mod tests {
    use perimelt_core::family::Places;
    use perimelt_core::shape::{BoxShape, Shape};
    use perimelt_core::{Body, FamilySpec, Influence};

    use super::*;

    const SPACING: f64 = 0.01;
    const DT: f64 = 1e-3;

    /// Velocity of one point (0.2 kg) that meets a wall to its right, whose points have this velocity (m/s) and mass
    /// (kg), and what the wall took: momentum and moment, of wall and fluid. The wall is turned by an angle.
    struct Met {
        before: Vector3<f64>,
        after: Vector3<f64>,
        normal: Vector3<f64>,
        exchanged: [Vector3<f64>; 2],
        moments: [Vector3<f64>; 2],
        wall_energy: f64,
    }

    fn meet(before: [f64; 2], wall: f64, mass: Option<f64>, angle: f64) -> Met {
        meet_under(before, 0.0, wall, mass, angle)
    }

    /// What [`meet`] finds where the fluid point has a pressure (Pa).
    fn meet_under(
        before: [f64; 2],
        pressure: f64,
        wall: f64,
        mass: Option<f64>,
        angle: f64,
    ) -> Met {
        let shape = Shape::Box(BoxShape {
            min: [0.0; 3],
            max: [0.1, 0.1, SPACING],
        });
        let body = Body::fill("water", &shape, 2, SPACING, 1.0).expect("valid");
        let spec = FamilySpec {
            influence: Influence::Wendland,
            ..FamilySpec::new(3.0 * SPACING)
        };
        let turned = |x: f64, y: f64| {
            let (sin, cos) = angle.sin_cos();
            Vector3::new(cos * x - sin * y, sin * x + cos * y, 0.0)
        };
        // not opposite to a point of the wall
        let positions = [turned(-0.5003 * SPACING, 0.2 * SPACING)];
        let columns = (0..4).flat_map(|i| (-8..=8).map(move |j| (i, j)));
        let solid: Vec<_> = columns
            .map(|(i, j)| turned(f64::from(i) * SPACING, f64::from(j) * SPACING))
            .collect();
        let volumes = vec![SPACING * SPACING; solid.len()];
        let mut bonds = ForeignBonds::new(&body, &spec);
        let places = |positions, count: usize| Places {
            positions,
            volumes: &volumes[..count],
        };
        bonds.follow(places(&positions, 1), places(&solid, solid.len()));
        let masses = mass.map(|m| vec![m; solid.len()]);
        let interface = Interface {
            bonds: &bonds,
            solid: places(&solid, solid.len()),
            horizon: bonds.horizon(),
            spacing: SPACING,
            dimension: 2,
        };
        let wall_of_fluid = CollisionWall {
            interfaces: &[interface],
            number: 0,
            spacing: SPACING,
            mass: masses.as_deref(),
        };
        let normal = turned(1.0, 0.0);
        let before = turned(before[0], before[1]);
        let mut velocity = [before];
        let mut of_wall = vec![wall * normal; solid.len()];
        let mut fluid = FluidPoints {
            velocity: &mut velocity,
            mass: &[0.2],
            pressure: &[pressure],
            rule: Collisions::default(),
            dt: DT,
        };
        let mut impulses = Vec::new();
        let mut exchanged = [Vector3::zeros(); 2];
        wall_of_fluid.collide(&mut fluid, &mut of_wall, &mut impulses, |hit| {
            exchanged[1] += hit.impulse;
        });
        let mut moments = [Vector3::zeros(), positions[0].cross(&exchanged[1])];
        for (point, impulse) in impulses {
            exchanged[0] += impulse;
            moments[0] += solid[point].cross(&impulse);
        }
        let energy = |v: &Vector3<f64>| 0.5 * mass.unwrap_or(0.0) * v.norm_squared();
        Met {
            before,
            after: velocity[0],
            normal,
            exchanged,
            moments,
            wall_energy: of_wall.iter().map(energy).sum(),
        }
    }

    #[test]
    fn a_point_is_reflected_by_a_wall_at_rest_and_by_one_that_moves() {
        // docs/theory/fluid_structure.md, "Collision with a wall"
        for angle in [0.0, 0.3, 2.0] {
            for wall in [0.0, 0.3, -0.3] {
                let met = meet([1.0, 0.4], wall, None, angle);
                let of_wall = wall * met.normal;
                let expected =
                    met.before - 2.0 * (met.before - of_wall).dot(&met.normal) * met.normal;
                assert!((met.after - expected).norm() < 1e-12, "{}", met.after);
                let [before, after] = [met.before, met.after].map(|v| v - of_wall);
                assert!((after.norm() - before.norm()).abs() < 1e-12);
                assert!((after.dot(&met.normal) + before.dot(&met.normal)).abs() < 1e-12);
                let along = |v: Vector3<f64>| v - v.dot(&met.normal) * met.normal;
                assert!((along(after) - along(before)).norm() < 1e-12);
            }
        }
    }

    #[test]
    fn momentum_angular_momentum_and_energy_are_kept_with_a_wall_of_free_points() {
        for (wall, mass) in [(0.0, 0.1), (0.3, 0.1), (0.3, 5.0)] {
            let met = meet([1.0, 0.4], wall, Some(mass), 0.3);
            let [on_wall, on_fluid] = met.exchanged;
            assert!(on_fluid.norm() > 0.05, "{on_fluid}");
            assert!((on_wall + on_fluid).norm() < 1e-14, "{on_wall} {on_fluid}");
            let [on_wall, on_fluid] = met.moments;
            assert!((on_wall + on_fluid).norm() < 1e-16, "{on_wall} {on_fluid}");
            let kinetic = |v: Vector3<f64>| 0.5 * 0.2 * v.norm_squared();
            let rest = 0.5 * mass * wall * wall * (4 * 17) as f64;
            let [before, after] = [
                kinetic(met.before) + rest,
                kinetic(met.after) + met.wall_energy,
            ];
            assert!((after - before).abs() < 1e-12, "{before} {after}");
        }
    }

    #[test]
    fn a_point_under_tension_loses_its_approach_only() {
        let met = meet_under([1.0, 0.4], -5.0, 0.3, None, 0.3);
        let approach = (met.before - 0.3 * met.normal).dot(&met.normal);
        assert!((met.after - (met.before - approach * met.normal)).norm() < 1e-12);
    }

    #[test]
    fn a_point_that_leaves_or_does_not_reach_the_wall_keeps_its_velocity() {
        // 3e-6 m before the wall
        for (velocity, wall) in [([-1.0, 0.4], 0.0), ([1e-3, 0.4], 0.0), ([0.2, 0.4], 0.3)] {
            let met = meet(velocity, wall, None, 0.3);
            assert_eq!(met.after, met.before);
            assert_eq!(met.exchanged, [Vector3::zeros(); 2]);
        }
    }

    /// `-(1 + e) v m M / (m + M)`, of a wall without a mass `-(1 + e) v m`.
    #[test]
    fn an_impulse_is_that_of_the_reduced_mass() {
        for (mobility, restitution, expected) in [
            (0.0, 1.0, -2.0 * 3.0 * 2.0),
            (0.0, 0.0, -3.0 * 2.0),
            (0.5, 0.0, -3.0 * 1.0),
            (0.25, 0.5, -1.5 * 3.0 * 2.0 * 4.0 / 6.0),
        ] {
            let found = impulse(3.0, 2.0, mobility, restitution);
            assert!(
                (found - expected).abs() < 1e-12,
                "{mobility} {restitution}: {found}"
            );
        }
    }
}
