//! A beam that the first of two fluids absorbs at their interface: column by column along the beam, in proportion to the rise of the square of its
//! fraction c from the side of the beam, `max(0, c_k^2 - max c^2 above)`, whose sum in a column is 1. All power of a column enters its metal,
//! wherever the interface lies and whatever its inclination. A column without metal loses its power.
//!
//! The square moves the heat to the metal's side of the layer: each cell of the layer gets heat in proportion to the metal in it times
//! the gradient of c, so that cells that are mostly gas do not overheat.

use std::ops::Range;

use perimelt_core::{Face, SetupError};

use super::beam::{MOST_CELLS, PlacedFootprint, Scratch, Span, inside};
use super::profile::Footprint;
use super::{CellGrid, CellSampling, Deposit, HeatedBody, check_cells};
use crate::toolpath::Pose;

/// Largest fraction in a column from which on it counts as one with metal.
const METAL: f64 = 0.5;

/// A footprint, absorbed where the beam meets the first of two fluids.
#[derive(Debug, Clone)]
pub struct InterfaceBeam {
    pub(super) footprint: Footprint,
    pub(super) sampled: CellSampling,
    /// Absorptivity of the flat surface, where a depression absorbs what its walls reflect.
    pub(super) reflecting: Option<f64>,
    /// Key of the greatest lateral length.
    pub(super) widest_key: &'static str,
}

/// The columns of a body along a beam.
struct Columns<'a, B: ?Sized> {
    body: &'a B,
    face: Face,
    /// Lateral axes.
    axes: [usize; 2],
    spans: [Span; 2],
}

impl<B: HeatedBody + ?Sized> Columns<'_, B> {
    /// Ranges of the columns that lie on the body.
    fn ranges(&self) -> [Range<usize>; 2] {
        let dims = self.body.grid().dims;
        [0, 1].map(|a| {
            let Span { first, count, .. } = self.spans[a];
            inside(first, count, dims[self.axes[a]])
        })
    }

    fn layers(&self) -> usize {
        self.body.grid().dims[self.face.axis()]
    }

    /// The point in a layer of a column; layers count from the side of the beam.
    fn point(&self, [i, j]: [usize; 2], layer: usize) -> Option<usize> {
        let mut cell = [0; 3];
        cell[self.face.axis()] = match self.face.is_upper() {
            true => self.layers() - 1 - layer,
            false => layer,
        };
        cell[self.axes[0]] = (self.spans[0].first + i as i64) as usize;
        cell[self.axes[1]] = (self.spans[1].first + j as i64) as usize;
        self.body.point(cell)
    }

    /// Fills in the squares of the fraction in the layers of a column, and returns the largest one; `None` without metal.
    fn load(&self, column: [usize; 2], squares: &mut Vec<f64>) -> Option<f64> {
        squares.clear();
        squares.extend((0..self.layers()).map(|layer| {
            let point = self.point(column, layer);
            let fraction = point.and_then(|point| self.body.first_fluid(point));
            fraction.map_or(0.0, |c| c.clamp(0.0, 1.0).powi(2))
        }));
        let largest = squares.iter().copied().fold(0.0, f64::max);
        (largest >= METAL * METAL).then_some(largest)
    }

    /// Depth of the surface of a column below the side of the beam, in layers: the mean over what it absorbs.
    fn depth(&self, column: [usize; 2], squares: &mut Vec<f64>) -> Option<f64> {
        let largest = self.load(column, squares)?;
        let (mut above, mut depth) = (0.0, 0.0);
        for (layer, square) in squares.iter().enumerate() {
            let rise = f64::max(square - above, 0.0);
            // between the centres of the layer and of the one before it
            depth += rise / largest * layer as f64;
            above += rise;
        }
        Some(depth)
    }
}

impl InterfaceBeam {
    /// Refuses a beam that covers more columns than can be held.
    pub(super) fn check_size(&self, grid: &CellGrid) -> Result<(), SetupError> {
        let axis = self.sampled.heated_surface.face.axis();
        check_cells(
            self.widest_key,
            self.footprint.columns(grid, axis),
            MOST_CELLS,
        )
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
        let PlacedFootprint {
            axes,
            travel,
            reach,
        } = self.footprint.placed(face.axis(), pose);
        let spans = [0, 1].map(|i| Span::new(&grid, axes[i], pose.position[axes[i]], reach[i]));
        let sampling = self.sampled.sampling;
        self.footprint.fill_parts(&spans, travel, sampling, scratch);
        let columns = Columns {
            body,
            face,
            axes,
            spans,
        };
        let power = power * self.gain(&columns, pose, scratch);
        let all: f64 = scratch.lateral.iter().sum();
        let scale = match self.sampled.normalise && all > 0.0 {
            true => power / all,
            false => power,
        };
        let [across, rows] = columns.ranges();
        let mut hit = 0.0;
        for j in rows {
            for i in across.clone() {
                let part = scratch.lateral[j * columns.spans[0].count + i];
                let squares = &mut scratch.depth;
                let Some(largest) = columns.load([i, j], squares) else {
                    continue;
                };
                let mut above = 0.0;
                for (layer, square) in squares.iter().enumerate() {
                    let rise = square - above;
                    let point = columns.point([i, j], layer);
                    if let Some(point) = point.filter(|_| rise > 0.0) {
                        values[point] += scale * part * rise / (largest * body.volume(point));
                        above = *square;
                    }
                }
                hit += part;
            }
        }
        Deposit::of_parts(power, scale, hit, all)
    }

    /// Absorptivity of the depression over that of the flat surface: `1 / (A + (1 - A) s/S)` with the area s of its opening and the area S of its wall
    /// ([Gouffe1945]), for light that the wall scatters in all directions. Columns belong to it whose surface is more than a spacing below the
    /// level of the source.
    fn gain<B: HeatedBody + ?Sized>(
        &self,
        columns: &Columns<'_, B>,
        pose: &Pose,
        scratch: &mut Scratch,
    ) -> f64 {
        let Some(absorptivity) = self.reflecting else {
            return 1.0;
        };
        let grid = *columns.body.grid();
        let axis = columns.face.axis();
        let level = self.sampled.heated_surface.level;
        let level = grid.in_cells(axis, level.unwrap_or(pose.position[axis]));
        let level = match columns.face.is_upper() {
            true => columns.layers() as f64 - level,
            false => level,
        };
        let [across, rows] = columns.ranges();
        let width = across.len();
        let depths = &mut scratch.depths;
        depths.clear();
        for j in rows.clone() {
            for i in across.clone() {
                let depth = columns.depth([i, j], &mut scratch.depth);
                depths.push(depth.unwrap_or(columns.layers() as f64));
            }
        }
        let (mut opening, mut wall) = (0.0, 0.0);
        for (n, depth) in depths.iter().enumerate() {
            if *depth < level + 1.0 {
                continue;
            }
            let (i, j) = (n % width, n / width);
            let step = |other: Option<&f64>| other.map_or(0.0, |other| (other - depth).powi(2));
            let mut squares = 0.0;
            // each axis has the mean of the squares of the slopes on both sides
            for (has_low, has_high, stride) in [
                (i > 0, i + 1 < width, 1),
                (j > 0, j + 1 < rows.len(), width),
            ] {
                let low = has_low.then(|| &depths[n - stride]);
                let high = has_high.then(|| &depths[n + stride]);
                squares += 0.5 * (step(low) + step(high));
            }
            opening += 1.0;
            wall += (1.0 + squares).sqrt();
        }
        match wall > 0.0 {
            true => 1.0 / (absorptivity + (1.0 - absorptivity) * opening / wall),
            false => 1.0,
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

    /// A flat surface and one above the level reflect into the open; a groove with walls of 45 degrees has `s/S = 1/sqrt(2)`.
    #[test]
    fn a_depression_absorbs_what_its_walls_reflect() {
        let gain = |surface: fn(f64, f64) -> f64, level: f64| {
            let metal = metal(surface);
            let mut values = metal.lattice.zeros();
            let mut at = pose();
            at.position.z = level;
            let mut beam = beam("");
            beam.reflecting = Some(0.3);
            let deposit = beam.add(&metal, &at, 30.0, &mut values, &mut Scratch::default());
            assert!((metal.lattice.power(&values) - deposit.deposited).abs() < 1e-9);
            deposit.asked / 30.0
        };
        assert_eq!(gain(|_, _| 10.0, 10.0), 1.0);
        assert_eq!(gain(|x, _| 10.0 + x.abs(), 3.0), 1.0);
        let groove = gain(|x, _| f64::min(5.0 + x.abs(), 10.0), 10.0);
        let expected = 1.0 / (0.3 + 0.7 / 2.0_f64.sqrt());
        // the layer rounds the bottom
        assert!(
            (groove / expected - 1.0).abs() < 0.05,
            "{groove} {expected}"
        );
        let deep = gain(|x, _| if x.abs() < 1.6 { 2.0 } else { 14.0 }, 14.0);
        // four columns; the steps of 12 spacings beside two of them have a root mean square of 12/sqrt(2)
        let expected = 1.0 / (0.3 + 0.7 * 4.0 / (2.0 + 2.0 * 73.0_f64.sqrt()));
        assert!((deep / expected - 1.0).abs() < 0.05, "{deep} {expected}");
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
