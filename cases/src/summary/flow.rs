//! The interface between two fluids and the motion of the first of them at the end, and the flow of melt.

use perimelt_core::log::{Log, Series};

use super::{Label, ReadOff};
use crate::log_names::REPORTS;

/// Reports of the interface: name, name in words, SI unit.
const INTERFACE: [(&str, &str, &str); 3] = [
    (
        "interface.pressure_jump",
        "jump of pressure between the fluids at the end",
        "Pa",
    ),
    ("interface.area", "area of the interface at the end", "m2"),
    (
        "interface.roundness",
        "roundness of the first fluid at the end",
        "1",
    ),
];

/// Numbers of the interfaces between two fluids, and of the first fluid along the axes along which it moved.
pub(super) fn flow(log: &Log, found: &mut Vec<ReadOff>) {
    let Some(reports) = log.probes().get(REPORTS) else {
        return;
    };
    melt(reports, found);
    let column = |name: String| reports.columns.iter().find(|c| c.name == name);
    let suffix = format!(".{}", INTERFACE[0].0);
    let fluids = reports.columns.iter();
    for physics in fluids.filter_map(|c| c.name.strip_suffix(&suffix)) {
        let mut number = |name: &str, words: String, unit: &str| {
            let last = column(format!("{physics}.{name}")).and_then(|c| c.values.last());
            let label = Label::new(format!("{name}.end"), words);
            found.extend(last.map(|value| ReadOff::new(physics, label, *value, unit)));
        };
        for (name, words, unit) in INTERFACE {
            number(name, words.into(), unit);
        }
        for axis in ["x", "y", "z"] {
            let velocity = format!("first_fluid.velocity.{axis}");
            let of_axis = column(format!("{physics}.{velocity}"));
            if of_axis.is_some_and(|c| c.values.iter().any(|v| *v != 0.0)) {
                let centre = format!("first_fluid.centre.{axis}");
                let words =
                    |what: &str| format!("{what} of the first fluid along {axis} at the end");
                number(&centre, words("centre"), "m");
                number(&velocity, words("mean velocity"), "m/s");
            }
        }
    }
}

/// Largest numbers of melt in the logged states, and how well the points resolve the layer under its surface.
fn melt(reports: &Series, found: &mut Vec<ReadOff>) {
    const SPEED: &str = "speed.max";
    const LAYER: &str = "boundary_layer.points";
    let melts = |name: &str| name.strip_suffix(".momentum_to_solid.x").map(String::from);
    for physics in reports.columns.iter().filter_map(|c| melts(&c.name)) {
        let values = |name: &str| {
            let name = format!("{physics}.{name}");
            let column = reports.columns.iter().find(|c| c.name == name);
            let values = column.map_or(&[][..], |column| &column.values);
            let positive = move |(value, _): &(f64, f64)| *value > 0.0;
            values
                .iter()
                .copied()
                .zip(reports.times.iter().copied())
                .filter(positive)
        };
        let largest = |name: &str| values(name).max_by(|a, b| a.0.total_cmp(&b.0));
        let least = values(LAYER).min_by(|a, b| a.0.total_cmp(&b.0));
        for (id, words, unit, number) in [
            (
                "melt.speed.largest",
                "largest logged speed of the melt",
                "m/s",
                largest(SPEED),
            ),
            (
                "melt.volume.largest",
                "largest logged volume of the melt",
                "m3",
                largest("liquid.volume"),
            ),
            (
                "melt.layer.points",
                "fewest points across the layer of melt under the surface",
                "1",
                least,
            ),
        ] {
            let read_off =
                |(value, time)| ReadOff::new(&physics, Label::new(id, words), value, unit).at(time);
            found.extend(number.map(read_off));
        }
    }
}

#[cfg(test)]
mod tests {
    use perimelt_core::log::Log;

    use crate::case::Case;
    use crate::run::{Options, run};
    use crate::summary::{ReadOff, SummaryOptions, read_off};

    const DROP: &str = r#"
[bodies.box]
dimension = 2
spacing = 1e-3
shape.box = { min = [0, 0, 0], max = [0.02, 0.02, 1e-3] }
material = "water"
materials = { drop = "oil" }
regions.drop.cylinder = { start = [0.01, 0.01, 0], end = [0.01, 0.01, 1e-3], radius = 5e-3 }
initial.velocity = ["0.01", "0", "0"]
periodic = ["x"]

[materials.oil]
density = 900
viscosity = 0.05

[materials.water]
density = 1000
viscosity = 0.01

[[physics]]
type = "fluid"
description = "eulerian"
form = "conservative"
state.incompressible = {}
fluids = ["oil", "water"]
interface = { surface_tension = 0.03 }

[[couplers]]
type = "wall"
faces = ["y-", "y+"]
kind = "slip"

[time]
end = 1e-3
"#;

    /// What is told of a run.
    fn told(text: &str) -> Vec<ReadOff> {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("run.mcap");
        let case = Case::parse("run.toml", text.into(), folder.path()).expect("valid");
        let options = Options {
            out: path.clone(),
            quiet: true,
            ..Options::default()
        };
        assert!(run(&case, &options).is_ok());
        let log = Log::open(&path).expect("a log");
        read_off(&log, &SummaryOptions::default()).expect("readable")
    }

    const POOL: &str = r#"
[bodies.square]
shape.box = { min = [0, 0, 0], max = [0.008, 0.008, 1e-3] }
dimension = 2
spacing = 1e-3
material = "metal"
initial.temperature = "1100 + 1e4 * x"

[materials.metal]
density = 7000
specific_heat = 500
conductivity = 50
viscosity = 5e-2
solidus = 1000
liquidus = 1010
latent_heat = 2e5

[[physics]]
type = "melt_flow"
surface = { faces = ["y+"], tension.slope = -1e-4 }

[[physics]]
type = "thermal"
horizon = 1

[[couplers]]
type = "phase_change"

[time]
end = 0.02

[log]
interval = 0.01
"#;

    #[test]
    fn melt_has_its_numbers() {
        let found = told(POOL);
        let number = |id: &str| found.iter().find(|r| r.id == id).expect(id).value;
        let speed = number("melt.speed.largest");
        assert!((1e-4..1.0).contains(&speed), "{speed}");
        assert!((number("melt.volume.largest") / 6.4e-5 - 1.0).abs() < 1e-12);
        let layer = number("melt.layer.points");
        let expected = (5e-2 / 7000.0 * 0.008 / speed).sqrt() / 1e-3;
        assert!((layer / expected - 1.0).abs() < 1e-9, "{layer} {expected}");
    }

    /// Of a drop that moves along x.
    #[test]
    fn a_drop_has_its_numbers() {
        let found = told(DROP);
        let number = |id: &str| found.iter().find(|r| r.id == id).map(|r| r.value);
        let speed = number("first_fluid.velocity.x.end").expect("it moves");
        assert!((speed - 0.01).abs() < 1e-3, "{speed}");
        assert!(number("first_fluid.centre.z.end").is_none());
        let jump = number("interface.pressure_jump.end").expect("two fluids");
        assert!(jump > 0.0, "{jump}");
        assert!(number("velocity.end").is_some());
    }
}
