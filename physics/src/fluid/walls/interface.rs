//! Normals of a solid that is a wall, at its interface with a fluid: from the fluid to the solid.
//!
//! The *colour gradient* (Gao (2020), eqs. 7.15 to 7.19; docs/theory/fluid_structure.md, "Normals") is the gradient
//! of a colour c, 1 in the fluid and 2 in the solid, by the peridynamic differential operator of second order over
//! the points of both,
//!
//! ```text
//! c_g(i) = sum_j (c_j - c_i) g1(y_j - y_i) V_j      weight exp(-(2 |xi| / delta)^2)
//! n(i)   = c_g / |c_g|  if |c_g| > 0.01 / spacing, else 0
//! ```
//!
//! with the vector as argument of g1, where the reference prints its length. Three rows of the solid have a normal
//! at a horizon of 3.6 spacings. It exists where there is fluid, and follows it: a single drop turns it.
//!
//! The *normal of the wall* is the direction of the sum over the points of all walls alone, `sum_j w xi V_j`, with the same
//! weight. It has the direction of the colour gradient where fluid covers the solid, is exact along a plane, also where
//! one body continues another one, and does not depend on how many points of the fluid are near.

use nalgebra::{SMatrix, SVector, Vector3};
use perimelt_core::family::{ForeignBond, ForeignBonds, ForeignGhost, Places};
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::world::BodyIndex;
use perimelt_core::{Access, Setup, World, Write, keys};
use rayon::prelude::*;

/// Monomials of second order in three dimensions.
const MONOMIALS: usize = 9;

/// Least colour gradient at the interface, times the spacing.
const CUT_OFF: f64 = 1e-2;

/// Least pivot of a matrix of moments, relative to their sum, for which derivatives exist.
const LEAST_PIVOT: f64 = 1e-10;

type Moments = SMatrix<f64, MONOMIALS, MONOMIALS>;

/// The field `interface_normal` of a solid.
#[derive(Debug)]
pub(crate) struct NormalField {
    field: Write<Vector3<f64>>,
    /// Whether it is needed in every step, not only when a state is logged.
    pub(crate) is_read: bool,
}

impl NormalField {
    /// `None` for a solid between two fluids, which has the normals of the first one.
    pub(crate) fn declare(setup: &mut Setup<'_>, solid: BodyIndex) -> Option<Self> {
        let field = setup.write(solid, &keys::INTERFACE_NORMAL).ok()?;
        let is_read = setup.is_declared(solid, &keys::INTERFACE_NORMAL, Access::Read);
        Some(NormalField { field, is_read })
    }

    /// Normals from a solid to a fluid whose points rest.
    pub(crate) fn set_to(&self, world: &World, outward: &[Vector3<f64>]) {
        let mut normals = world.write(self.field);
        let points = normals.iter_mut().zip(outward);
        points.for_each(|(normal, outward)| *normal = -outward);
    }

    pub(crate) fn set(&self, world: &World, interface: &Interface<'_>) {
        let mut normals = world.write(self.field);
        let points = normals.par_iter_mut().enumerate();
        points.for_all(|(point, normal)| *normal = interface.normal(point));
    }
}

/// A solid beside a fluid.
#[derive(Clone, Copy)]
pub(crate) struct Interface<'a> {
    /// Bonds of the fluid to the solid.
    pub(crate) bonds: &'a ForeignBonds,
    /// Points of the solid.
    pub(crate) solid: Places<'a>,
    /// m.
    pub(crate) horizon: f64,
    /// Spacing of the fluid, m.
    pub(crate) spacing: f64,
    pub(crate) dimension: usize,
}

impl Interface<'_> {
    /// Normal by the colour gradient at a point of the solid, zero away from the interface.
    pub(crate) fn normal(&self, point: usize) -> Vector3<f64> {
        let gradient = self.colour_gradient(point);
        match gradient.norm() > CUT_OFF / self.spacing {
            true => gradient.normalize(),
            false => Vector3::zeros(),
        }
    }

    /// Gradient of the colour at a point of the solid, 1/m; zero where its neighbours do not determine derivatives.
    pub(crate) fn colour_gradient(&self, point: usize) -> Vector3<f64> {
        if self.bonds.bonds_to(point).is_empty() {
            return Vector3::zeros();
        }
        let mut moments = Moments::zeros();
        let mut colour = SVector::<f64, MONOMIALS>::zeros();
        let mut add = |xi: Vector3<f64>, volume: f64, change: f64| {
            let weight = self.weight(&xi) * volume;
            let p = self.monomials(&xi);
            moments += weight * p * p.transpose();
            colour += weight * change * p;
        };
        let at = &self.solid.positions[point];
        self.for_each_in_solid(at, |xi, volume| add(xi, volume, 0.0));
        for &number in self.bonds.bonds_to(point) {
            let ForeignBond { bond, ghost, .. } = self.bonds.bond(number as usize);
            // from the point of the solid to that of the fluid, or to its image if an image of the solid has the bond
            let xi = ghost.reflect(-Vector3::from(bond.xi));
            if bond.length <= self.reach() {
                add(xi, self.bonds.own_volume(number as usize), -1.0);
            }
        }
        let size = moments.trace();
        for n in 0..MONOMIALS {
            // monomials that a plane body does not have
            if moments[(n, n)] == 0.0 {
                moments[(n, n)] = size;
            }
        }
        let Some(factors) = moments.cholesky() else {
            return Vector3::zeros();
        };
        let least = factors.l_dirty().diagonal().min();
        if least * least < LEAST_PIVOT * size {
            return Vector3::zeros();
        }
        let derivatives = factors.solve(&colour);
        Vector3::new(derivatives[0], derivatives[1], derivatives[2]) / self.horizon
    }

    /// The horizon, with points that lie on it whatever the rounding, m.
    fn reach(&self) -> f64 {
        self.horizon * (1.0 + 1e-9)
    }

    fn weight(&self, xi: &Vector3<f64>) -> f64 {
        (-4.0 * xi.norm_squared() / (self.horizon * self.horizon)).exp()
    }

    /// First and second powers of the coordinates over the horizon.
    fn monomials(&self, xi: &Vector3<f64>) -> SVector<f64, MONOMIALS> {
        let mut xi = xi / self.horizon;
        xi.as_mut_slice()[self.dimension..].fill(0.0);
        let [x, y, z] = xi.into();
        [x, y, z, x * x, y * y, z * z, x * y, y * z, z * x].into()
    }

    /// Passes vector (m) and volume (m³) of the points of the solid within the horizon of a position, but not at it, and of
    /// images behind mirrored faces.
    fn for_each_in_solid(&self, at: &Vector3<f64>, mut receive: impl FnMut(Vector3<f64>, f64)) {
        let Places { positions, volumes } = self.solid;
        let receive = |ghost: &ForeignGhost, xi| {
            if xi != Vector3::zeros() {
                receive(xi, volumes[ghost.point]);
            }
        };
        self.bonds
            .for_each_foreign(positions, at, self.reach(), receive);
    }
}

/// Normal of walls of one fluid at the position (m) of a point of theirs; `None` inside, and where they are too thin to tell
/// their sides.
pub(crate) fn wall_normal(walls: &[Interface<'_>], at: &Vector3<f64>) -> Option<Vector3<f64>> {
    let (mut sum, mut size) = (Vector3::zeros(), 0.0);
    for wall in walls {
        wall.for_each_in_solid(at, |xi, volume| {
            let weight = wall.weight(&xi) * volume;
            sum += weight * xi;
            size += weight * xi.norm();
        });
    }
    (sum.norm() > CUT_OFF * size).then(|| sum.normalize())
}

#[cfg(test)]
mod tests {
    use perimelt_core::shape::{BoxShape, Shape};
    use perimelt_core::{Body, FamilySpec, Influence};

    use super::*;

    const SPACING: f64 = 0.01;

    /// A plane lattice, `size` points to each side of the origin, of points of a fluid and of a solid.
    fn lattice(
        size: i32,
        is_solid: impl Fn(f64, f64) -> bool,
    ) -> (Vec<Vector3<f64>>, Vec<Vector3<f64>>) {
        let (mut fluid, mut solid) = (Vec::new(), Vec::new());
        for row in -size..size {
            for column in -size..size {
                let [x, y] = [column, row].map(|i| f64::from(i) + 0.5);
                let at = Vector3::new(x, y, 0.0) * SPACING;
                match is_solid(x, y) {
                    true => solid.push(at),
                    false => fluid.push(at),
                }
            }
        }
        (fluid, solid)
    }

    /// Evaluates something at the solid of a lattice with a horizon in spacings.
    fn with_interface<R>(
        horizon: f64,
        (fluid, solid): &(Vec<Vector3<f64>>, Vec<Vector3<f64>>),
        evaluate: impl FnOnce(&Interface<'_>) -> R,
    ) -> R {
        let shape = Shape::Box(BoxShape {
            min: [0.0; 3],
            max: [0.1, 0.1, SPACING],
        });
        let body = Body::fill("water", &shape, 2, SPACING, 1.0).expect("valid");
        let spec = FamilySpec {
            influence: Influence::Wendland,
            ..FamilySpec::new(horizon * SPACING)
        };
        let mut bonds = ForeignBonds::new(&body, &spec);
        let volumes = [fluid.len(), solid.len()].map(|n| vec![SPACING * SPACING; n]);
        let places = |positions, n: usize| Places {
            positions,
            volumes: &volumes[n],
        };
        bonds.follow(places(fluid, 0), places(solid, 1));
        evaluate(&Interface {
            bonds: &bonds,
            solid: places(solid, 1),
            horizon: bonds.horizon(),
            spacing: SPACING,
            dimension: 2,
        })
    }

    fn at(solid: &[Vector3<f64>], x: f64, y: f64) -> usize {
        let place = Vector3::new(x, y, 0.0) * SPACING;
        let found = solid.iter().position(|s| (s - place).norm() < 1e-9);
        found.expect("a point of the solid")
    }

    fn degrees(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
        a.angle(b).to_degrees()
    }

    #[test]
    fn rows_of_a_plane_interface_have_the_gradients_of_the_reference() {
        // cases/references/pddo_lattice.py
        for (horizon, rows) in [
            (3.6, [0.3144, 0.1539, 0.0317, 0.0]),
            (3.015, [0.3613, 0.1309, 0.0078, 0.0]),
        ] {
            let points = lattice(10, |x, _| x > 0.0);
            with_interface(horizon, &points, |interface| {
                for (row, expected) in rows.into_iter().enumerate() {
                    let point = at(&points.1, row as f64 + 0.5, 0.5);
                    let size = interface.colour_gradient(point).norm() * SPACING;
                    assert!((size - expected).abs() < 1e-3, "{horizon}: {row}: {size}");
                    let normal = interface.normal(point);
                    match expected > CUT_OFF {
                        true => assert!((normal - Vector3::x()).norm() < 1e-10, "{normal}"),
                        false => assert_eq!(normal, Vector3::zeros()),
                    }
                }
                let first = points.1[at(&points.1, 0.5, 0.5)];
                let wall = wall_normal(&[*interface], &first);
                assert!((wall.expect("a side") - Vector3::x()).norm() < 1e-12);
            });
        }
    }

    /// Why the load of the reference (eq. 7.22) is not used: `2 sum_b w0 V_b P_b` is the pressure at the interface itself only.
    /// At the points of the solid it is 53 % of it in the first row and 59 % in all rows together (docs/theory/fluid_structure.md,
    /// "The published load").
    #[test]
    fn the_published_load_is_the_pressure_at_the_interface_only() {
        let h = 1.2 * SPACING;
        let kernel = |r: f64| {
            let cut = (-9.0_f64).exp();
            let shape = ((-(r / h).powi(2)).exp() - cut).max(0.0);
            shape / (std::f64::consts::PI * h * h * (1.0 - 10.0 * cut))
        };
        let (fluid, _) = lattice(10, |x, _| x > 0.0);
        let load = |x: f64, y: f64| {
            let at = Vector3::new(x, y, 0.0) * SPACING;
            let parts = fluid.iter().map(|b| kernel((b - at).norm()));
            2.0 * SPACING * SPACING * parts.sum::<f64>()
        };
        let rows = [0.5, 1.5, 2.5].map(|x| load(x, 0.5));
        for (found, expected) in rows.into_iter().zip([0.5294, 0.0597, 0.0015]) {
            assert!((found - expected).abs() < 1e-4, "{found}");
        }
        assert!((load(0.0, 0.5) - 1.0).abs() < 1e-4);
    }

    #[test]
    fn the_normal_of_a_corner_lies_on_its_diagonal() {
        for horizon in [3.6, 3.015] {
            let points = lattice(10, |x, y| x > 0.0 && y > 0.0);
            let diagonal = Vector3::new(1.0, 1.0, 0.0);
            with_interface(horizon, &points, |interface| {
                let corner = at(&points.1, 0.5, 0.5);
                let normals = [interface.normal(corner)].into_iter();
                for normal in normals.chain(wall_normal(&[*interface], &points.1[corner])) {
                    assert!(degrees(&normal, &diagonal) < 1.0, "{normal}");
                }
            });
        }
    }

    #[test]
    fn normals_of_a_disc_point_to_its_centre_as_far_as_its_steps_allow() {
        // docs/theory/fluid_structure.md, "Normals": the error is that of the steps, also with a large radius
        let offsets = [[0.0, 0.0], [0.5, 0.5]];
        for (radius, [x0, y0]) in [10.0, 20.0]
            .into_iter()
            .flat_map(|r| offsets.map(|o| (r, o)))
        {
            for horizon in [3.6, 3.015] {
                let is_solid = |x: f64, y: f64| (x - x0).hypot(y - y0) < radius;
                let points = lattice(radius as i32 + 8, is_solid);
                let first = |s: &&Vector3<f64>| {
                    let [x, y] = [s.x / SPACING, s.y / SPACING];
                    let beside = [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)];
                    beside.iter().any(|(i, j)| !is_solid(x + i, y + j))
                };
                let angles: Vec<f64> = with_interface(horizon, &points, |interface| {
                    let all = points.1.iter().filter(first);
                    let angle = |s: &Vector3<f64>| {
                        let normal = interface.normal(at(&points.1, s.x / SPACING, s.y / SPACING));
                        degrees(&normal, &(Vector3::new(x0, y0, 0.0) * SPACING - s))
                    };
                    all.map(angle).collect()
                });
                let largest = angles.iter().copied().fold(0.0, f64::max);
                let mean = angles.iter().sum::<f64>() / angles.len() as f64;
                println!("radius {radius}, horizon {horizon}: {largest}, {mean}");
                assert!(largest < 12.0 && mean < 6.5, "{largest}, {mean}");
            }
        }
    }
}
