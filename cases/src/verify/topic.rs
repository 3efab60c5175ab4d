//! Topics of the benchmark cases, by which their results are divided into pages.

use serde::Deserialize;

use crate::case::Case;

/// Topic of a case, which follows from its plugins.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Topic {
    /// Heat conduction alone.
    HeatConduction,
    /// Heat conduction with a phase change.
    Melting,
    /// Deformation at constant temperature.
    Mechanics,
    /// Bonds that break by load.
    Fracture,
    /// Heat conduction and deformation.
    Thermomechanics,
    /// Transformations of steel.
    Metallurgy,
    /// Material that is added, cut off or powder, and inherent strains.
    Deposition,
    /// One fluid between walls.
    Flow,
    /// Several bodies with an interface between them, and rigid bodies.
    BodiesThatMeet,
}

/// Sections of a case file from which its topic follows.
#[derive(Default, Deserialize)]
#[serde(default)]
struct Sections {
    physics: Vec<toml::Table>,
    couplers: Vec<toml::Table>,
}

impl Topic {
    /// Topic of a case: the first rule that applies.
    pub fn of(case: &Case) -> Topic {
        let sections = toml::from_str(&case.file.text);
        let Sections { physics, couplers } = sections.unwrap_or_default();
        let has = |names: &[&str]| {
            let mut types = physics
                .iter()
                .chain(&couplers)
                .filter_map(|t| t.get("type"));
            types.any(|t| t.as_str().is_some_and(|t| names.contains(&t)))
        };
        if has(&["deposit", "cut", "inherent_strain", "powder"]) {
            Topic::Deposition
        } else if has(&["fluid_structure", "heat_interface", "rigid_body"]) {
            Topic::BodiesThatMeet
        } else if has(&["fluid"]) {
            Topic::Flow
        } else if has(&["metallurgy"]) {
            Topic::Metallurgy
        } else if physics.iter().any(|p| p.contains_key("fracture")) {
            Topic::Fracture
        } else if has(&["mechanical"]) && has(&["thermal"]) {
            Topic::Thermomechanics
        } else if has(&["mechanical"]) {
            Topic::Mechanics
        } else if has(&["phase_change"]) {
            Topic::Melting
        } else {
            Topic::HeatConduction
        }
    }

    /// Title of its page.
    pub fn title(self) -> &'static str {
        match self {
            Topic::HeatConduction => "heat conduction",
            Topic::Melting => "melting",
            Topic::Mechanics => "mechanics",
            Topic::Fracture => "fracture",
            Topic::Thermomechanics => "thermomechanics",
            Topic::Metallurgy => "metallurgy",
            Topic::Deposition => "deposition",
            Topic::Flow => "flow",
            Topic::BodiesThatMeet => "bodies that meet",
        }
    }

    /// File of its page.
    pub fn file(self) -> String {
        format!("{}.md", self.title().replace(' ', "_"))
    }
}
