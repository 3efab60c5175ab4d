//! Memory that bodies will take, from their shapes, before any point is made.

use std::path::Path;

use nalgebra::Vector3;
use perimelt_core::shape::Shape;

use super::sections::BodySection;
use super::{Case, Result};
use crate::unit::bytes;

/// Bytes of a point of a lattice with the fewest fields: temperature, enthalpy, heat, and the arrays of a solver. Mechanics take several
/// times as much.
const BYTES_PER_POINT: f64 = 48.0;

/// Bytes of a point of a cloud, with its position, volume, cell and bonds.
const BYTES_PER_CLOUD_POINT: f64 = 200.0;

/// Bytes of a cell of the box around a body.
const BYTES_PER_CELL: f64 = 4.0;

/// Samples along each axis for the part of the box that a shape fills.
const SAMPLES: usize = 24;

/// Free memory (bytes) of the machine or of the control group of this process; `None` where the system does not report it.
pub(super) fn available() -> Option<f64> {
    let read = |path: &str| std::fs::read_to_string(Path::new(path)).ok();
    let info = read("/proc/meminfo")?;
    let line = info.lines().find_map(|l| l.strip_prefix("MemAvailable:"))?;
    let free = 1024.0
        * line
            .trim()
            .trim_end_matches("kB")
            .trim()
            .parse::<f64>()
            .ok()?;
    let number = |path: &str| read(path)?.trim().parse::<f64>().ok();
    let of_group = number("/sys/fs/cgroup/memory.max").zip(number("/sys/fs/cgroup/memory.current"));
    Some(of_group.map_or(free, |(most, used)| free.min(most - used)))
}

/// Largest number of cells of a body.
const MOST_CELLS: f64 = 4e9;

/// Number of cells of a box with corners (m), and of the cells in the shape, by samples.
fn cells(shape: &Shape, dimension: usize, spacing: f64) -> Option<(f64, f64)> {
    let (min, max) = shape.bounds()?;
    let extent = max - min;
    // a wrong dimension is refused later
    let dimension = dimension.min(3);
    let box_cells: f64 = (0..dimension)
        .map(|a| (extent[a] / spacing).max(1.0))
        .product();
    let counts: [usize; 3] = std::array::from_fn(|a| if a < dimension { SAMPLES } else { 1 });
    let (mut inside, mut all) = (0.0, 0.0);
    for index in 0..counts.iter().product() {
        let cell = [
            index % counts[0],
            index / counts[0] % counts[1],
            index / (counts[0] * counts[1]),
        ];
        let at =
            Vector3::from_fn(|a, _| min[a] + extent[a] * (cell[a] as f64 + 0.5) / counts[a] as f64);
        all += 1.0;
        inside += f64::from(u8::from(shape.contains(&at, 0.0)));
    }
    // thin shapes may lie between all samples
    Some((box_cells, box_cells * (inside / all)))
}

impl Case {
    /// Refuses a body that takes more memory than there is.
    pub(super) fn check_memory(
        &self,
        name: &str,
        section: &BodySection,
        shape: &Shape,
    ) -> Result<()> {
        let Some(available) = self.memory else {
            return Ok(());
        };
        let (key, boxes, points, each) = match section.spacing {
            Some(spacing) if spacing > 0.0 => {
                let Some((boxes, points)) = cells(shape, section.dimension, spacing) else {
                    return Ok(());
                };
                ("spacing", boxes, points, BYTES_PER_POINT)
            }
            _ => {
                let of_zone = |zone: &perimelt_core::body::Zone| {
                    let axes = 0..section.dimension.min(3);
                    axes.map(|a| ((zone.max[a] - zone.min[a]) / zone.spacing).max(1.0))
                        .product::<f64>()
                };
                let points: f64 = section.zones.iter().map(of_zone).sum();
                ("zones", 0.0, points, BYTES_PER_CLOUD_POINT)
            }
        };
        let needed = BYTES_PER_CELL * boxes + each * points;
        // smaller ones are not worth an estimate, and more points than an index can count are refused later
        if needed <= available || needed < 1e9 || boxes > MOST_CELLS {
            return Ok(());
        }
        let message = format!(
            "body `{name}` would have some {points:.2e} points, which take at least {}, and {} are free",
            bytes(needed),
            bytes(available)
        );
        let error = self.body_error(
            &[name, key],
            message,
            "expected a larger spacing, or a smaller body",
        );
        Err(error.help("`--any-memory` starts nevertheless"))
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn case(body: &str, memory: Option<f64>) -> std::result::Result<(), String> {
        let text = format!(
            r#"
            [bodies.b]
            {body}
            initial.temperature = 300
            material = "m"
            [materials.m]
            density = 7800
            specific_heat = 500
            conductivity = 30
            [[physics]]
            type = "thermal"
            [time]
            end = 1
            "#
        );
        let mut case = Case::parse("b.toml", text, Path::new("")).map_err(|e| e.render(false))?;
        case.memory = memory;
        let section = &case.bodies[0].1;
        let checked = case.check_memory("b", section, &section.shape);
        checked.map_err(|e| e.render(false))
    }

    #[test]
    fn a_body_beyond_the_memory_is_refused_before_it_is_filled() {
        let cube = "shape.box = { min = [0, 0, 0], max = [0.01, 0.01, 0.01] }\nspacing = 2e-5";
        let zones = "shape.box = { min = [0, 0, 0], max = [0.01, 0.01, 0.01] }\nzones = [{ min = [0, 0, 0], max = [0.01, 0.01, 0.01], spacing = 2e-5 }]";
        for body in [cube, zones] {
            let error = case(body, Some(4e9)).expect_err("at least 6 GB");
            assert!(
                error.contains("1.25e8 points") && error.contains("--any-memory"),
                "{error}"
            );
            assert_eq!(case(body, Some(64e9)), Ok(()));
            assert_eq!(case(body, None), Ok(()));
        }
        // a wall of a seventh of the box, which alone would take 49 GB
        let pipe = "shape.difference = { from = { cylinder = { start = [0, 0, 0], end = [0, 0, 0.1], radius = 0.05 } }, subtract = { cylinder = { start = [0, 0, 0], end = [0, 0, 0.1], radius = 0.045 } } }\nspacing = 1.6e-4";
        assert_eq!(case(pipe, Some(12e9)), Ok(()));
        assert_eq!(
            case(&cube.replace("2e-5", "1e-3"), Some(1.0)),
            Ok(()),
            "small bodies are always filled"
        );
    }

    #[test]
    fn the_free_memory_is_known_on_linux() {
        if cfg!(target_os = "linux") {
            assert!(available().is_some_and(|free| free > 1e6));
        }
    }
}
