//! A beam that the first of two fluids absorbs at their interface: column by column along the beam, in proportion to the rise of the square of its
//! fraction c from the side of the beam, `max(0, c_k^2 - max c^2 above)`, whose sum in a column is 1. All power of a column enters its metal,
//! wherever the interface lies and whatever its inclination. A column without metal loses its power.
//!
//! The square moves the heat to the metal's side of the layer: each cell of the layer gets heat in proportion to the metal in it times
//! the gradient of c, so that cells that are mostly gas do not overheat.

use super::beam::{MOST_CELLS, Scratch, Span, inside};
use super::profile::Footprint;
use super::{CellGrid, CellSampling, Deposit, HeatedBody, check_cells};
use crate::toolpath::Pose;
use perimelt_core::SetupError;

/// Largest fraction in a column from which on it counts as one with metal.
const METAL: f64 = 0.5;

/// A footprint, absorbed where the beam meets the first of two fluids.
#[derive(Debug, Clone)]
pub struct InterfaceBeam {
    pub(super) footprint: Footprint,
    pub(super) sampled: CellSampling,
    /// Key of the greatest lateral length.
    pub(super) widest_key: &'static str,
}

impl InterfaceBeam {
    /// Refuses a beam that covers more columns than can be held.
    pub(super) fn check_size(&self, grid: &CellGrid) -> Result<(), SetupError> {
        let axis = self.sampled.heated_surface.face.axis();
        let [along, across] = self.footprint.reach();
        let lateral: f64 = (0..3)
            .filter(|&other| other != axis && !grid.is_thickness(other))
            .map(|other| 2.0 * along.max(across) / grid.spacing[other] + 2.0)
            .product();
        check_cells(self.widest_key, lateral, MOST_CELLS)
    }

    /// Adds the density of `power` (W) to `values` (W/m³).
    pub(super) fn add(
        &self,
        body: &(impl HeatedBody + ?Sized),
        pose: &Pose,
        power: f64,
        values: &mut [f64],
        scratch: &mut Scratch,
    ) -> Deposit {
        let grid = *body.grid();
        let face = self.sampled.heated_surface.face;
        let depth_axis = face.axis();
        let axes = [(depth_axis + 1) % 3, (depth_axis + 2) % 3];
        let travel = self.footprint.travel(axes.map(|axis| pose.direction[axis]));
        let reach = self.footprint.half_lengths(travel);
        let spans = [0, 1].map(|i| Span::new(&grid, axes[i], pose.position[axes[i]], reach[i]));
        let sampling = self.sampled.sampling;
        self.footprint.fill_parts(&spans, travel, sampling, scratch);
        let all: f64 = scratch.lateral.iter().sum();
        let scale = match self.sampled.normalise && all > 0.0 {
            true => power / all,
            false => power,
        };
        let rows = inside(spans[1].first, spans[1].count, grid.dims[axes[1]]);
        let columns = inside(spans[0].first, spans[0].count, grid.dims[axes[0]]);
        let layers = grid.dims[depth_axis];
        let mut hit = 0.0;
        for j in rows {
            for i in columns.clone() {
                let part = scratch.lateral[j * spans[0].count + i];
                let point = |layer: usize| {
                    let mut cell = [0; 3];
                    cell[depth_axis] = match face.is_upper() {
                        true => layers - 1 - layer,
                        false => layer,
                    };
                    cell[axes[0]] = (spans[0].first + i as i64) as usize;
                    cell[axes[1]] = (spans[1].first + j as i64) as usize;
                    body.point(cell)
                };
                let squares = &mut scratch.depth;
                squares.clear();
                squares.extend((0..layers).map(|layer| {
                    let fraction = point(layer).and_then(|point| body.first_fluid(point));
                    fraction.map_or(0.0, |c| c.clamp(0.0, 1.0).powi(2))
                }));
                let largest = squares.iter().copied().fold(0.0, f64::max);
                if largest < METAL * METAL {
                    continue;
                }
                let mut above = 0.0;
                for (layer, square) in squares.iter().enumerate() {
                    let rise = square - above;
                    if let Some(point) = point(layer).filter(|_| rise > 0.0) {
                        values[point] += scale * part * rise / (largest * body.volume(point));
                        above = *square;
                    }
                }
                hit += part;
            }
        }
        // a difference of rounding size is not lost power
        let lost = if all - hit > 1e-12 * all {
            scale * (all - hit)
        } else {
            0.0
        };
        Deposit {
            asked: power,
            deposited: scale * hit,
            lost,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::heated_body::lattice::TestLattice;
    use super::super::{PowerDensity, SourceShape, SuperGaussian};
    use super::*;
    use nalgebra::Vector3;

    /// A lattice with metal below a surface that rises along x.
    struct Metal {
        lattice: TestLattice,
        fraction: Vec<f64>,
    }

    impl HeatedBody for Metal {
        fn grid(&self) -> &CellGrid {
            self.lattice.grid()
        }

        fn point(&self, cell: [usize; 3]) -> Option<usize> {
            self.lattice.point(cell)
        }

        fn volume(&self, point: usize) -> f64 {
            self.lattice.volume(point)
        }

        fn first_fluid(&self, point: usize) -> Option<f64> {
            Some(self.fraction[point])
        }
    }

    fn beam(keys: &str) -> InterfaceBeam {
        let keys = format!("radius = 2.0\nabsorptivity = 1\npenetration = 'interface'\n{keys}");
        let shape: SuperGaussian = toml::from_str(&keys).expect("valid keys");
        let grid = TestLattice::full([0.0; 3], [1.0; 3], [2; 3]).grid;
        match shape.power_density(&grid).expect("valid") {
            PowerDensity::Interface(beam) => beam,
            other => panic!("{other:?}"),
        }
    }

    fn metal(surface: impl Fn(f64, f64) -> f64) -> Metal {
        let lattice = TestLattice::full([-16.0, -16.0, 0.0], [1.0; 3], [32, 32, 20]);
        let mut fraction = lattice.zeros();
        for (point, c) in fraction.iter_mut().enumerate() {
            let cell = [point % 32, point / 32 % 32, point / 1024];
            let [x, y, z] = [0, 1, 2].map(|a| lattice.grid.origin[a] + cell[a] as f64 + 0.5);
            *c = 1.0 / (1.0 + ((z - surface(x, y)) / 0.75).exp());
        }
        Metal { lattice, fraction }
    }

    fn pose() -> Pose {
        Pose {
            position: Vector3::new(0.3, -0.2, 25.0),
            direction: Vector3::x(),
            power: 100.0,
            speed: 0.0,
            torch: None,
        }
    }

    /// On flat, inclined and stepped surfaces, from above and from below.
    #[test]
    fn a_surface_of_any_shape_absorbs_all_power_in_its_layer() {
        let shapes: [fn(f64, f64) -> f64; 3] = [
            |_, _| 10.3,
            |x, y| 10.0 + 0.4 * x - 0.1 * y,
            |x, _| if x > 0.0 { 6.0 } else { 14.0 },
        ];
        for surface in shapes {
            let metal = metal(surface);
            let mut values = metal.lattice.zeros();
            let deposit =
                beam("").add(&metal, &pose(), 100.0, &mut values, &mut Scratch::default());
            assert!((deposit.deposited - 100.0).abs() < 1e-9, "{deposit:?}");
            assert_eq!(deposit.lost, 0.0);
            assert!((metal.lattice.power(&values) - 100.0).abs() < 1e-9);
            let mean: f64 = values.iter().zip(&metal.fraction).map(|(q, c)| q * c).sum();
            // the mean of c over rises of its square is 2/3, a little more by cells
            assert!((mean / 100.0 - 2.0 / 3.0).abs() < 0.12, "{mean}");
        }
        // from below it is metal everywhere: the first cell absorbs
        let metal = metal(|_, _| 10.3);
        let mut values = metal.lattice.zeros();
        let from_below = beam("heated_surface.face = 'z-'");
        from_below.add(&metal, &pose(), 100.0, &mut values, &mut Scratch::default());
        let first: f64 = values[..1024].iter().sum();
        assert!((first - 100.0).abs() < 1e-3, "{first}");
    }

    #[test]
    fn columns_without_metal_lose_their_power() {
        let metal = metal(|x, _| if x > 0.3 { -9.0 } else { 10.0 });
        let mut values = metal.lattice.zeros();
        let mut at = pose();
        at.position.x = 1.0;
        let deposit = beam("").add(&metal, &at, 100.0, &mut values, &mut Scratch::default());
        // the part of a beam of radius 2 beyond its own axis: the first column of metal ends at x = 0
        let inside = 0.5 * libm::erfc(2.0_f64.sqrt() * 1.0 / 2.0);
        assert!(
            (deposit.deposited / 100.0 - inside).abs() < 1e-6,
            "{deposit:?} {inside}"
        );
        assert!((deposit.deposited + deposit.lost - 100.0).abs() < 1e-9);
    }
}
