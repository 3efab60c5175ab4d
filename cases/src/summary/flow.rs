//! The interface between two fluids and the motion of the first of them, the flow of melt, evaporation, and surfaces below beams.

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

/// Which of the logged values of a report is told.
#[derive(Clone, Copy)]
enum Of {
    Largest,
    Least,
    End,
}

/// Extremes of reports: the report that tells a plugin which has them, and of each its name, that of what is told, words and SI unit.
struct Extremes {
    of_plugins_with: &'static str,
    told: &'static [(&'static str, Of, &'static str, &'static str, &'static str)],
}

const EXTREMES: [Extremes; 4] = [
    Extremes {
        of_plugins_with: "momentum_to_solid.x",
        told: &[
            (
                "speed.max",
                Of::Largest,
                "melt.speed.largest",
                "largest logged speed of the melt",
                "m/s",
            ),
            (
                "liquid.volume",
                Of::Largest,
                "melt.volume.largest",
                "largest logged volume of the melt",
                "m3",
            ),
            (
                "boundary_layer.points",
                Of::Least,
                "melt.layer.points",
                "fewest points across the layer of melt under the surface",
                "1",
            ),
        ],
    },
    Extremes {
        of_plugins_with: "interface.roundness",
        told: &[(
            "interface.roundness",
            Of::Least,
            "interface.roundness.least",
            "least logged roundness of the first fluid",
            "1",
        )],
    },
    Extremes {
        of_plugins_with: "evaporated.mass",
        told: &[
            (
                "surface.temperature.max",
                Of::Largest,
                "evaporation.temperature.largest",
                "largest logged temperature of the surface",
                "K",
            ),
            (
                "recoil.max",
                Of::Largest,
                "evaporation.recoil.largest",
                "largest logged recoil pressure",
                "Pa",
            ),
            (
                "evaporated.mass",
                Of::End,
                "evaporation.mass",
                "evaporated mass",
                "kg",
            ),
            (
                "evaporated.energy",
                Of::End,
                "evaporation.energy",
                "energy that evaporation takes",
                "J",
            ),
        ],
    },
    Extremes {
        of_plugins_with: "absorptivity",
        told: &[
            (
                "depth",
                Of::Largest,
                "depression.depth.largest",
                "largest logged depth of the surface below the beam",
                "m",
            ),
            (
                "absorptivity",
                Of::Largest,
                "depression.absorptivity.largest",
                "largest logged absorptivity",
                "1",
            ),
        ],
    },
];

/// Numbers of the interfaces between two fluids, and of the first fluid along the axes along which it moved.
pub(super) fn flow(log: &Log, found: &mut Vec<ReadOff>) {
    let Some(reports) = log.probes().get(REPORTS) else {
        return;
    };
    EXTREMES
        .iter()
        .for_each(|extremes| extremes.find(reports, found));
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
        let mut squares = vec![0.0; reports.times.len()];
        for axis in ["x", "y", "z"] {
            let velocity = format!("first_fluid.velocity.{axis}");
            let of_axis = column(format!("{physics}.{velocity}"));
            let values = of_axis.map_or(&[][..], |c| &c.values);
            for (square, value) in squares.iter_mut().zip(values) {
                *square += value * value;
            }
            if values.iter().any(|v| *v != 0.0) {
                let centre = format!("first_fluid.centre.{axis}");
                let words =
                    |what: &str| format!("{what} of the first fluid along {axis} at the end");
                number(&centre, words("centre"), "m");
                number(&velocity, words("mean velocity"), "m/s");
            }
        }
        let speeds = squares.into_iter().map(f64::sqrt);
        let fastest = speeds
            .zip(&reports.times)
            .max_by(|a, b| a.0.total_cmp(&b.0));
        if let Some((speed, time)) = fastest.filter(|(speed, _)| *speed > 0.0) {
            let words = "largest logged speed of the mean motion of the first fluid";
            let label = Label::new("first_fluid.speed.largest", words);
            found.push(ReadOff::new(physics, label, speed, "m/s").at(*time));
        }
    }
}

impl Extremes {
    /// Positive numbers of all plugins that have them.
    fn find(&self, reports: &Series, found: &mut Vec<ReadOff>) {
        let suffix = format!(".{}", self.of_plugins_with);
        let columns = reports.columns.iter();
        for plugin in columns.filter_map(|c| c.name.strip_suffix(&suffix)) {
            for &(name, of, id, words, unit) in self.told {
                let name = format!("{plugin}.{name}");
                let column = reports.columns.iter().find(|c| c.name == name);
                let values = column.map_or(&[][..], |column| &column.values);
                let values = values.iter().copied().zip(reports.times.iter().copied());
                let mut positive = values.filter(|(value, _)| *value > 0.0);
                let number = match of {
                    Of::Largest => positive.max_by(|a, b| a.0.total_cmp(&b.0)),
                    Of::Least => positive.min_by(|a, b| a.0.total_cmp(&b.0)),
                    Of::End => positive.next_back(),
                };
                let read_off = |(value, time)| {
                    ReadOff::new(plugin, Label::new(id, words), value, unit).at(time)
                };
                found.extend(number.map(read_off));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use perimelt_core::log::Log;

    use crate::case::{Case, DROP};
    use crate::run::{Options, run};
    use crate::summary::{ReadOff, SummaryOptions, read_off};

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
        let fastest = number("first_fluid.speed.largest").expect("it moves");
        assert!((speed..0.011).contains(&fastest), "{fastest}");
        let end = number("interface.roundness.end").expect("two fluids");
        let least = number("interface.roundness.least").expect("two fluids");
        assert!((0.9..=end).contains(&least), "{least}");
    }
}
