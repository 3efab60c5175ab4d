//! A log for tests: a hot spot that moves over a lattice.

use std::path::Path;

use perimelt_core::log::{
    BodyInfo, CloudView, Coordinates, Entry, FieldInfo, FieldView, Precision, Progress, RunInfo,
    Writer,
};

pub(crate) const SPACING: f64 = 2.5e-4;
pub(crate) const TIMES: usize = 6;

/// The case file in the log, from which the isotherms of its bodies are read.
const CASE: &str = r#"
[bodies.plate]
shape.box = { min = [0, 0, 0], max = [6e-3, 2e-3, 1.5e-3] }
spacing = 2.5e-4
material = "steel"

[bodies.sheet]
shape.box = { min = [0, 0, 0], max = [6e-3, 4e-3, 1] }
dimension = 2
spacing = 2.5e-4
thickness = 1e-3
material = "steel"

[materials.steel]
solidus = 1658.15
liquidus = 1723.15

[[physics]]
type = "thermal"

[time]
end = 1

[log]
interval = 0.2
"#;

/// Half a plate (3D, cut at y = 0, `cells` of 0.25 mm, its surface at z = 0) and a plane sheet,
/// with temperature and displacement at six times 0, 0.2 s, ... 1 s.
pub(crate) fn write_log(path: &Path, cells: [usize; 3]) {
    let field = |name: &str, unit: &str, components| FieldInfo {
        name: name.into(),
        unit: unit.into(),
        components,
    };
    let [nx, ny, _] = cells;
    let bodies = [("plate", 3, cells), ("sheet", 2, [nx, 2 * ny, 1])];
    let info = bodies.map(|(name, dimension, cells)| BodyInfo {
        name: name.into(),
        dimension,
        spacing: SPACING,
        thickness: 1e-3,
        points: cells.iter().product(),
        fields: vec![field("temperature", "K", 1), field("displacement", "m", 3)],
        ..BodyInfo::default()
    });
    let run = RunInfo {
        version: "test".into(),
        threads: 1,
        bodies: info.into(),
        ..RunInfo::default()
    };
    let mut writer = Writer::create(path, &run, "spot.toml", CASE).expect("a new file");
    for step in 0..TIMES {
        let time = 0.2 * step as f64;
        for (name, dimension, cells) in bodies {
            let (positions, temperature, displacement) = state(cells, dimension, time);
            let field = |name, components, values| FieldView {
                name,
                components,
                values,
            };
            let cloud = CloudView {
                time,
                positions: Coordinates::Listed(&positions),
                fields: &[
                    field("temperature", 1, &temperature),
                    field("displacement", 3, &displacement),
                ],
            };
            let written = writer.points(name, Precision::F64, &cloud);
            written.expect("written");
        }
        write_series(&mut writer, step as u64, time);
    }
    writer.finish().expect("written");
}

/// A probe, a balance and the progress.
fn write_series(writer: &mut Writer, step: u64, time: f64) {
    let (hot, cold) = (300.0 + 900.0 * time.sqrt(), 300.0 + 200.0 * time);
    let probe = [
        Entry::new("near_weld", "K", hot),
        Entry::new("far", "K", cold),
        Entry::new("uz", "m", -2e-5 * time),
    ];
    writer
        .probe("thermocouples", time, &probe)
        .expect("written");
    let error = 1e-13 * (1.0 + time * 30.0);
    let balance = [
        Entry::new("heat.energy.stored", "J", 500.0 * time),
        Entry::new("heat.energy.error", "J", -error),
        Entry::new("heat.energy.relative_error", "1", error / 500.0),
    ];
    writer.balance(time, &balance).expect("written");
    let mut progress = Progress {
        time,
        step,
        ..Progress::default()
    };
    progress.sub_steps.insert("heat".into(), 20);
    writer.progress(&progress).expect("written");
}

/// Positions, temperature and displacement, the hot spot at 30 % to 70 % of the length.
fn state(cells: [usize; 3], dimension: usize, time: f64) -> (Vec<[f64; 3]>, Vec<f64>, Vec<f64>) {
    let [nx, ny, nz] = cells;
    let spot = (0.3 + 0.4 * time) * nx as f64 * SPACING;
    let (mut positions, mut temperature, mut displacement) = (Vec::new(), Vec::new(), Vec::new());
    let (y_start, z_start) = match dimension {
        3 => (0.0, -(nz as f64)),
        _ => (-0.5 * ny as f64, -0.5),
    };
    for k in 0..nz {
        for j in 0..ny {
            for i in 0..nx {
                let x = (i as f64 + 0.5) * SPACING;
                let y = (y_start + j as f64 + 0.5) * SPACING;
                let z = (z_start + k as f64 + 0.5) * SPACING;
                let behind = (x - spot).min(0.0).abs();
                let ahead = (x - spot).max(0.0);
                let along = behind / 8e-3 + ahead / 2e-3;
                let r2 = along * along + (y / 2.6e-3).powi(2) + (z / 2e-3).powi(2);
                let heat = (-0.9 * r2.sqrt().powf(1.5)).exp() * (time / 0.2).min(1.0);
                temperature.push(300.0 + 2100.0 * heat);
                let stretch = 6e-5 * time;
                let (u, v, w) = ((x * 150.0).sin(), -2e-2, 2.0 * heat);
                let [u, v, w] = [u, v, w].map(|part| stretch * part);
                displacement.extend([u, v, w]);
                positions.push([x + u, y + v, z + w]);
            }
        }
    }
    (positions, temperature, displacement)
}
