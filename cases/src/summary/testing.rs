//! A log of a plate for tests.

use std::path::Path;

use perimelt_core::Face;
use perimelt_core::log::{
    BodyInfo, CloudView, Coordinates, Entry, FieldInfo, FieldView, Log, Precision, RunInfo, Writer,
};
use serde_json::Value;

use super::ReadOff;

pub(super) const SPACING: f64 = 2.5e-4;

/// The case in the log, before its probes.
const CASE: &str = r#"
[bodies.plate]
shape.box = { min = [0, 0, -2e-3], max = [6e-3, 5e-3, 0] }
spacing = 2.5e-4
material = "steel"

[materials.steel]
solidus = 1500
liquidus = 1550
yield_stress = 300e6
carbon = 0.2
silicon = 0.5

[[physics]]
type = "thermal"

[time]
end = 1

[log]
interval = 0.2
"#;

/// Name, unit, components and values of a field, by point.
pub(super) type Field = (&'static str, &'static str, usize, Vec<f64>);

/// Names, units and values of the columns of a time series at one time.
pub(super) type SeriesRow<'a> = Vec<(String, &'a str, f64)>;

/// A log of the plate.
#[derive(Default)]
pub(super) struct Plate<'a> {
    /// Fields in each state, which are a second apart.
    pub states: Vec<Vec<Field>>,
    pub symmetry: Vec<Face>,
    pub plugins: Value,
    /// Tables of probes in the case.
    pub probes: &'a str,
    /// Name of a time series, with its row in each state.
    pub series: Option<(&'a str, Vec<SeriesRow<'a>>)>,
}

/// Reference positions of the plate, m.
pub(super) fn positions() -> Vec<[f64; 3]> {
    let mut positions = Vec::new();
    for k in -8..0 {
        for j in 0..20 {
            for i in 0..24 {
                positions.push([i, j, k].map(|x| (f64::from(x) + 0.5) * SPACING));
            }
        }
    }
    positions
}

impl Plate<'_> {
    pub fn log(&self, path: &Path) -> Log {
        let fields = self.states[0].iter();
        let fields = fields.map(|(name, unit, components, _)| FieldInfo {
            name: (*name).into(),
            unit: (*unit).into(),
            components: *components,
        });
        let positions = positions();
        let plate = BodyInfo {
            name: "plate".into(),
            dimension: 3,
            spacing: SPACING,
            thickness: 1.0,
            points: positions.len(),
            symmetry: self.symmetry.clone(),
            lattice: None,
            plies: Vec::new(),
            fields: fields.collect(),
        };
        let run = RunInfo {
            version: "test".into(),
            bodies: vec![plate],
            plugins: self.plugins.clone(),
            ..RunInfo::default()
        };
        let case = format!("{CASE}{}", self.probes);
        let mut writer = Writer::create(path, &run, "plate.toml", &case).expect("a new file");
        for (index, state) in self.states.iter().enumerate() {
            let time = index as f64;
            let fields = state.iter().map(|(name, _, components, values)| FieldView {
                name,
                components: *components,
                values,
            });
            let cloud = CloudView {
                time,
                positions: Coordinates::Listed(&positions),
                fields: &fields.collect::<Vec<_>>(),
            };
            let written = writer.points("plate", Precision::F64, &cloud);
            written.expect("written");
            if let Some((name, rows)) = &self.series {
                let row = rows[index].iter().map(|(c, u, v)| Entry::new(c, u, *v));
                let row: Vec<_> = row.collect();
                writer.probe(name, time, &row).expect("written");
            }
        }
        writer.finish().expect("written");
        Log::open(path).expect("a log")
    }
}

pub(super) fn number<'a>(found: &'a [ReadOff], quantity: &str) -> &'a ReadOff {
    let number = found.iter().find(|r| r.quantity == quantity);
    number.unwrap_or_else(|| panic!("{quantity} in {found:#?}"))
}
