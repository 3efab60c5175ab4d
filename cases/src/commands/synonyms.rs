//! Words of welders and of other programs with the keys for them.

/// A word, and the names of the keys.
type Synonym = (&'static str, &'static [&'static str]);

/// Words in lower case, without hyphens.
const SYNONYMS: &[Synonym] = &[
    ("voltage", &["goldak.power", "goldak.efficiency"]),
    ("current", &["goldak.power", "goldak.efficiency"]),
    ("amperage", &["goldak.power", "goldak.efficiency"]),
    (
        "heat input",
        &[
            "goldak.power",
            "goldak.efficiency",
            "goldak.toolpath.line.speed",
        ],
    ),
    (
        "line energy",
        &[
            "goldak.power",
            "goldak.efficiency",
            "goldak.toolpath.line.speed",
        ],
    ),
    ("absorptivity", &["gaussian_source.efficiency"]),
    ("absorption", &["gaussian_source.efficiency"]),
    ("spot", &["gaussian_source.sigma"]),
    ("spot size", &["gaussian_source.sigma"]),
    ("beam diameter", &["gaussian_source.sigma"]),
    ("laser", &["gaussian_source"]),
    ("electron beam", &["gaussian_source"]),
    ("torch", &["goldak"]),
    ("arc", &["goldak"]),
    ("travel speed", &["goldak.toolpath.line.speed"]),
    ("welding speed", &["goldak.toolpath.line.speed"]),
    ("feed rate", &["goldak.toolpath.line.speed"]),
    ("filler", &["deposit"]),
    ("wire", &["deposit"]),
    ("bead", &["deposit"]),
    ("penetration", &["probes.kind.melt_pool", "thermal_history"]),
    ("pool depth", &["probes.kind.melt_pool"]),
    (
        "fusion zone",
        &["probes.kind.melt_pool", "peak_temperature"],
    ),
    (
        "haz",
        &["thermal_history", "metallurgy", "peak_temperature"],
    ),
    (
        "heat affected zone",
        &["thermal_history", "metallurgy", "peak_temperature"],
    ),
    ("microstructure", &["metallurgy"]),
    ("martensite", &["metallurgy"]),
    ("cooling rate", &["thermal_history"]),
    ("preheat", &["bodies.initial"]),
    ("preheating", &["bodies.initial"]),
    ("interpass", &["goldak.toolpath.polyline"]),
    ("film coefficient", &["convection.coefficient"]),
    ("heat transfer coefficient", &["convection.coefficient"]),
    ("htc", &["convection.coefficient"]),
    ("heat loss", &["convection", "radiation"]),
    ("fixture", &["clamp", "prescribed_displacement"]),
    ("distortion", &["displacement", "mechanical"]),
    ("shrinkage", &["thermal_expansion", "displacement"]),
    ("residual stress", &["stress", "mechanical.plasticity"]),
    ("mesh", &["bodies.spacing", "bodies.zones"]),
    ("element size", &["bodies.spacing", "bodies.zones"]),
    (
        "boundary condition",
        &[
            "prescribed_temperature",
            "prescribed_displacement",
            "convection",
        ],
    ),
    ("thermocouple", &["probes.kind"]),
    ("time step", &["time.step"]),
    ("gcode", &["goldak.toolpath.gcode"]),
];

/// The names that a word stands for.
pub(super) fn of(word: &str) -> Option<&'static [&'static str]> {
    let word = word.to_lowercase().replace(['-', '_'], " ");
    let found = SYNONYMS.iter().find(|(known, _)| *known == word);
    found.map(|(_, names)| *names)
}

/// All words.
#[cfg(test)]
pub(super) fn all() -> &'static [Synonym] {
    SYNONYMS
}
