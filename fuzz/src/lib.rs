//! What the fuzz targets share: case files that are composed if this is little work and reads no other file.

use std::path::Path;

use perimelt::case::Case;
use perimelt::case::sections::BodySection;
use perimelt::core::Simulation;
use toml::Value;

/// Cells of all bodies up to which a case is composed; the families of more of them take most of the time.
const MOST_CELLS: f64 = 600.0;

/// Keys of plugins that name files.
const FILES: [&str; 3] = ["file", "log", "path"];

/// Parses a case and, if it is small and reads no other file, composes and starts it. Mistakes are rendered as the command line
/// renders them.
pub fn compose(name: &str, text: &str) -> Option<Simulation> {
    let case = match Case::parse(name, text.into(), Path::new("")) {
        Ok(case) => case,
        Err(mistake) => {
            render(&mistake);
            return None;
        }
    };
    let cells: f64 = case.bodies.iter().map(|(_, body)| cells(body)).sum();
    let reads_files = case.bodies.iter().any(|(_, body)| body.points.is_some())
        || text
            .parse()
            .is_ok_and(|table| names_file(&Value::Table(table)));
    // NaN is composed, too: it has to be refused
    if reads_files || cells > MOST_CELLS {
        return None;
    }
    let mut simulation = match case.compose() {
        Ok(simulation) => simulation,
        Err(mistake) => {
            render(&mistake);
            return None;
        }
    };
    match case.start(&mut simulation) {
        Ok(()) => {
            let _ = case.warnings(&simulation);
            Some(simulation)
        }
        Err(refused) => {
            let _ = refused.to_string();
            None
        }
    }
}

fn render(mistake: &perimelt::case::CaseError) {
    mistake.render(true);
    mistake.render(false);
}

/// Cells of the box of a body; 0 for what is refused before anything is filled.
fn cells(body: &BodySection) -> f64 {
    let in_box = |extent: [f64; 3], spacing: f64| -> f64 {
        let along = extent.iter().take(body.dimension);
        along
            .map(|length| (length / spacing).abs().max(1.0))
            .product()
    };
    let whole = match (body.spacing, body.shape.bounds()) {
        (Some(spacing), Some((min, max))) => in_box((max - min).into(), spacing),
        _ => 0.0,
    };
    let zones = body.zones.iter().map(|zone| {
        let extent = std::array::from_fn(|axis| zone.max[axis] - zone.min[axis]);
        in_box(extent, zone.spacing)
    });
    whole + zones.sum::<f64>()
}

/// Whether a plugin is told to read a file.
fn names_file(value: &Value) -> bool {
    match value {
        Value::Table(table) => table.iter().any(|(key, value)| {
            FILES.contains(&key.as_str()) && value.is_str() || names_file(value)
        }),
        Value::Array(list) => list.iter().any(names_file),
        _ => false,
    }
}
