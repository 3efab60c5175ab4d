//! The benchmark cases, built into the program: `cases/verification/*.toml`, and the cases of the other folders, which
//! show the use of the program.

use std::io::Write;
use std::path::{Path, PathBuf};

use tempfile::TempDir;

use super::VerifyError;
use super::results::file_error;
use crate::case::Case;

/// A case file in the program.
#[derive(Clone, Copy, Debug)]
pub struct BuiltIn {
    /// Folder in `cases`.
    pub folder: &'static str,
    /// Name.
    pub name: &'static str,
    /// Text.
    pub text: &'static str,
    /// Name and contents of the files that it reads from its folder.
    pub files: &'static [(&'static str, &'static [u8])],
}

impl BuiltIn {
    /// Writes the files that the case reads into a folder. A file with other contents is not replaced.
    ///
    /// # Errors
    /// The path of a file that has other contents or cannot be written.
    pub fn write_files(&self, folder: &Path) -> Result<(), (PathBuf, std::io::Error)> {
        for (name, contents) in self.files {
            let path = folder.join(name);
            if std::fs::read(&path).is_ok_and(|present| present == *contents) {
                continue;
            }
            let created = std::fs::File::create_new(&path);
            let written = created.and_then(|mut file| file.write_all(contents));
            written.map_err(|source| (path, source))?;
        }
        Ok(())
    }
}

macro_rules! benchmarks {
    ($($folder:literal: [$($name:literal $(reads $file:literal)*),* $(,)?]),* $(,)?) => {
        /// The benchmark cases.
        pub const BENCHMARKS: &[BuiltIn] = &[$($(
            BuiltIn {
                folder: $folder,
                name: $name,
                text: include_str!(concat!("../../", $folder, "/", $name, ".toml")),
                files: &[$(($file, include_bytes!(concat!("../../", $folder, "/", $file)))),*],
            }
        ),*),*];
    };
}

benchmarks!(
    "verification": [
    "wang-4.0.3-roller-bb",
    "wang-4.0.3-roller-osb",
    "wang-4.0.3-roller-nosb",
    "wang-4.0.4-wave-bb",
    "wang-4.0.4-wave-osb",
    "wang-4.0.4-wave-nosb",
    "wang-4.3.2-vibration-bb",
    "wang-4.3.2-vibration-osb",
    "wang-4.3.2-vibration-nosb",
    "wang-4.3.2-vibration-nosb-n1",
    "wang-4.3.2-vibration-bb-n1",
    "wang-4.3.2-vibration-bb-n2",
    "wang-4.3.2-vibration-bb-uncorrected",
    "wang-4.3.2-vibration-nosb-unstabilised",
    "wang-4.3.6-vibration-osb",
    "wang-4.3.3-tension-bb",
    "wang-4.3.3-tension-osb",
    "wang-4.3.3-tension-nosb-n1",
    "wang-4.3.3-tension-nosb-n2",
    "wang-4.3.3-tension-nosb-n3",
    "wang-4.3.3-tension-nosb-g0.01",
    "wang-4.3.3-tension-nosb-g1",
    "wang-4.3.3-tension-bb-n1",
    "wang-4.3.3-tension-bb-n2",
    "wang-4.3.3-tension-bb-n4",
    "wang-4.3.3-tension-osb-n1",
    "wang-4.3.3-tension-osb-n2",
    "wang-4.3.3-tension-osb-n4",
    "wang-4.3.3-tension-nosb-n4",
    "wang-4.3.3-tension-nosb-n5",
    "wang-4.3.3-force-bb",
    "wang-4.3.3-force-nosb",
    "wang-4.3.3-force-bb-uncorrected",
    "wang-4.3.6-tension-osb",
    "wang-4.3.4-block-vibration-nosb",
    "wang-4.3.4-block-vibration-bb",
    "wang-4.3.4-block-vibration-osb",
    "wang-4.3.4-block-vibration-bb-extended",
    "wang-4.3.4-block-vibration-osb-extended",
    "wang-4.3.5-block-tension-nosb",
    "wang-4.3.5-block-tension-bb",
    "wang-4.3.5-block-tension-bb-n1",
    "wang-4.3.5-block-tension-bb-n2",
    "wang-4.3.5-block-tension-osb",
    "wang-4.3.5-block-tension-bb-extended",
    "wang-4.3.5-block-tension-osb-extended",
    "wang-4.3.5-block-tension-bb-fine",
    "wang-4.3.5-block-tension-osb-fine",
    "wang-5.4.1.1-vibration-local-bb",
    "wang-5.4.1.1-vibration-local-osb",
    "wang-5.4.1.1-vibration-local-nosb",
    "wang-5.4.1.2-vibration-constant-bb",
    "wang-5.4.1.2-vibration-constant-osb",
    "wang-5.4.1.2-vibration-constant-nosb",
    "wang-5.4.2.1-tension-local-bb",
    "wang-5.4.2.1-tension-local-osb",
    "wang-5.4.2.1-tension-local-nosb",
    "wang-5.4.2.1-tension-local-nosb-n3",
    "wang-5.4.2.2-tension-constant-bb",
    "wang-5.4.2.2-tension-constant-osb",
    "wang-5.4.2.2-tension-constant-nosb",
    "wang-5.4.2.2-tension-constant-nosb-n3",
    "wang-6.4.1.1-n1",
    "wang-6.4.1.2-n1",
    "wang-6.4.1.3-n1",
    "wang-6.4.1.4-n1",
    "wang-6.4.1.1-n2",
    "wang-6.4.1.2-n2",
    "wang-6.4.1.3-n2",
    "wang-6.4.1.4-n2",
    "wang-6.4.1.1-n3",
    "wang-6.4.1.2-n3",
    "wang-6.4.1.3-n3",
    "wang-6.4.1.4-n3",
    "wang-6.4.1.1-n4",
    "wang-6.4.1.2-n4",
    "wang-6.4.1.3-n4",
    "wang-6.4.1.4-n4",
    "wang-6.4.1.1-n5",
    "wang-6.4.1.2-n5",
    "wang-6.4.1.3-n5",
    "wang-6.4.1.4-n5",
    "wang-6.4.1.2-n1-balanced",
    "wang-6.4.1.2-n3-balanced",
    "wang-6.4.1.2-n5-balanced",
    "wang-6.4.1.3-n1-balanced",
    "wang-6.4.1.3-n3-balanced",
    "wang-6.4.1.3-n5-balanced",
    "wang-6.4.1.4-n1-balanced",
    "wang-6.4.1.4-n3-balanced",
    "wang-6.4.1.4-n5-balanced",
    "wang-6.4.1.4-n3-ordinary",
    "wang-6.4.1.4-n5-ordinary",
    "wang-6.4.1.1-transient",
    "wang-6.4.2.1-n2",
    "wang-6.4.2.1-n3",
    "wang-6.4.2.1-n4",
    "wang-6.4.2.1-n5",
    "wang-6.4.2.2-n2",
    "wang-6.4.2.2-n3",
    "wang-6.4.2.2-n4",
    "wang-6.4.2.2-n5",
    "wang-6.4.2.3-n2",
    "wang-6.4.2.3-n3",
    "wang-6.4.2.3-n4",
    "wang-6.4.2.3-n5",
    "wang-6.4.2.4-n2",
    "wang-6.4.2.4-n3",
    "wang-6.4.2.4-n4",
    "wang-6.4.2.4-n5",
    "wang-6.4.2.2-n5-balanced",
    "wang-6.4.2.4-n5-balanced",
    "wang-6.4.2.1-n3-plate",
    "wang-6.4.2.4-n3-plate",
    "wang-6.4.3-insulation",
    "wang-6.4.3.1-n1",
    "wang-6.4.3.1-n2",
    "wang-6.4.3.1-n3",
    "wang-6.4.3.1-n4",
    "wang-6.4.3.1-n5",
    "wang-6.4.3.2-n1",
    "wang-6.4.3.2-n2",
    "wang-6.4.3.2-n3",
    "wang-6.4.3.2-n4",
    "wang-6.4.3.2-n4-ordinary",
    "wang-6.4.3.2-n5-ordinary",
    "wang-6.4.3.2-n5-uncalibrated",
    "wang-6.4.3.3-n1",
    "wang-6.4.3.3-n2",
    "wang-6.4.3.3-n3",
    "wang-6.4.3.3-n4",
    "wang-6.4.3.3-n4-ordinary",
    "wang-6.4.3.3-n5-ordinary",
    "wang-6.4.3.3-n5-uncalibrated",
    "wang-6.4.3.4-n1",
    "wang-6.4.3.4-n2",
    "wang-6.4.3.4-n3",
    "wang-6.4.3.4-n4",
    "wang-6.4.3.4-n5",
    "wang-6.4.3.1-n3-ordinary",
    "wang-6.4.3.1-n5-ordinary",
    "wang-6.4.3.4-n5-ordinary",
    "dhpd-4.4-film",
    "dhpd-4.4-film-plate",
    "dhpd-4.4-film-zones",
    "dhpd-4.5-A",
    "dhpd-4.5-A-plate",
    "dhpd-4.5-B",
    "dual-growing-crack",
    "dual-bar",
    "dual-block",
    "dual-goldak",
    "wang-7.5.1-stefan",
    "wang-7.5.1-stefan-plate",
    "wang-7.5.1-stefan-no-latent",
    "wang-7.5.2-neumann",
    "wang-7.5.2-neumann-plate",
    "freezing-water",
    "freezing-water-horizon-3",
    "freezing-water-implicit",
    "wang-7.5.3-point",
    "wang-7.5.4.1-goldak",
    "wang-7.5.4.1-goldak-window",
    "wang-7.5.4.2-goldak-phase",
    "wang-7.5.4.2-goldak-phase-window",
    "wang-7.5.4.2-goldak-phase-apparent",
    "wang-7.5.5.1-gauss-A",
    "wang-7.5.5.1-gauss-B",
    "wang-7.5.5.1-gauss-B-horizon-3",
    "wang-7.5.5.1-gauss-B-published",
    "wang-7.5.5.2-gauss-phase-C",
    "wang-7.5.5.2-gauss-phase-D",
    "wang-7.5.5.2-gauss-phase-D-constant-modulus",
    "wang-7.5.5.2-gauss-phase-D-no-latent",
    "gao-3.5.1-plate-shock-l1-uncoupled",
    "gao-3.5.1-plate-shock-l1",
    "gao-3.5.1-plate-shock-l2-uncoupled",
    "gao-3.5.1-plate-shock-l2",
    "gao-3.5.1-plate-shock-l3-uncoupled",
    "gao-3.5.1-plate-shock-l1-uncoupled-fine",
    "gao-3.5.1-plate-shock-l2-uncoupled-fine",
    "gao-3.5.1-plate-shock-l1-fine",
    "gao-3.5.1-plate-shock-l2-fine",
    "gao-3.5.2-steel-plate-tension",
    "gao-3.5.2-steel-plate-tension-linear",
    "gao-3.5.2-steel-plate-tension-scaled",
    "gao-3.5.2-steel-plate-sine",
    "gao-3.5.3-block-thermal-coarse",
    "fluid-and-solid",
    "rigid-spring",
    "gao-7.s1-hydrostatic",
    "gao-7.s2-stress",
    "gao-7.s2-strain",
    "gao-7.s2-stress-uncorrected",
    "gao-7.s2-strain-uncorrected",
    "gao-7.s2-finite",
    "gao-7.s3-normals",
    "gao-7.s4-wall-at-rest",
    "gao-7.s4-moving-wall",
    "gao-7.s5-plate",
    "gao-7.3-gate-coarse",
    "gao-7.3-gate-fine",
    "interface-added-mass",
    "interface-ale-carried-bodies",
    "interface-ale-sheared-layer",
    "interface-ale-uniform-stream",
    "interface-drag-array",
    "interface-floating-block",
    "interface-heat-perfect",
    "interface-heat-steady",
    "interface-oil-on-water",
    "interface-two-layers",
    "casting-slab",
    "casting-jet",
    "deposit-rod",
    "deposit-rod-fine",
    "deposit-wall-present",
    "deposit-wall",
    "interpass-wait",
    "deposit-loaded-bar",
    "deposit-hot-layer",
    "deposit-loaded-wall-present",
    "deposit-loaded-wall",
    "deposit-moving-bar",
    "cut-bar",
    "inherent-strain-transient",
    "inherent-strain-wall",
    "laminate",
    "powder-bar",
    "elastic-flag",
    "held-cantilever-bond",
    "held-cantilever-ordinary",
    "held-cantilever-correspondence",
    "held-block-ordinary",
    "held-block-correspondence",
    "turek-hron-cfd1",
    "turek-hron-cfd1-eulerian",
    "turek-hron-fsi1",
    "turek-hron-fsi1-ale",
    "turek-hron-fsi1-eulerian",
    "gao-5.5.1-hydrostatic-first",
    "gao-5.5.1-hydrostatic",
    "gao-5.5.1-hydrostatic-long",
    "gao-5.5.2-couette-mirrored-n50",
    "gao-5.5.2-couette-updated-n50",
    "gao-5.5.2-couette-constant-n50",
    "gao-5.5.2-couette-constant-n100",
    "gao-5.5.2-couette-constant-n200",
    "gao-5.5.2-couette-constant-n400",
    "gao-5.5.3-poiseuille-mirrored-n25",
    "gao-5.5.3-poiseuille-mirrored-n50",
    "gao-5.5.3-poiseuille-constant-n50",
    "gao-5.5.4-taylor-green-n40",
    "gao-5.5.4-taylor-green-updated-n40",
    "gao-5.5.4-taylor-green-conservative-n40",
    "gao-5.5.4-taylor-green-n50",
    "gao-5.5.4-taylor-green-n100",
    "gao-5.5.4-taylor-green-eulerian-n40",
    "gao-5.5.4-taylor-green-eulerian-n50",
    "gao-5.5.6-dam",
    "gao-5.5.6-dam-long",
    "martin-moyce-n2",
    "martin-moyce-n2-fine",
    "gao-5.6.4-mixed-re100-n50",
    "gao-5.6.4-mixed-re10-n100",
    "gao-5.6.4-mixed-re100-n100",
    "gao-5.6.4-mixed-re400-n100",
    "gao-5.6.2-heat-conduction-n50",
    "gao-5.6.2-heat-conduction-n100",
    "gao-5.6.2-heat-conduction-n200",
    "gao-5.6.3-convection-1e3-n40",
    "gao-5.6.3-convection-1e3-n100",
    "gao-5.6.3-convection-1e3-constant-n200",
    "gao-5.6.3-convection-1e4-n100",
    "gao-5.6.3-convection-1e5-n100",
    "gao-5.6.3-convection-1e6-n100",
    "gao-5.5.5-cavity-re1-n40",
    "gao-5.5.5-cavity-re1-conservative-n40",
    "gao-5.5.5-cavity-re1-conservative-n60",
    "gao-5.5.5-cavity-re1-updated-n40",
    "gao-5.5.5-cavity-re1-updated-n60",
    "gao-5.5.5-cavity-re1-updated-n100",
    "gao-5.5.5-cavity-re1-n60",
    "gao-5.5.5-cavity-re1-n100",
    "gao-5.5.5-cavity-re1-constant-n100",
    "gao-5.5.5-cavity-re100-n50",
    "gao-5.5.5-cavity-re100-n100",
    "gao-5.5.5-cavity-re100-n200",
    "gao-5.5.5-cavity-re400-n200",
    "gao-5.5.5-cavity-re1000-n100",
    "gao-3.5.3-block-thermal",
    "khoshrou-4.0-plain-phi1",
    "khoshrou-4.0-plain-phi2",
    "khoshrou-4.0-plain-phi4",
    "khoshrou-4.0-circle-phi1",
    "khoshrou-4.0-circle-phi2",
    "khoshrou-4.0-circle-phi2-direct",
    "khoshrou-4.1a",
    "khoshrou-4.1b",
    "khoshrou-4.2-phi2",
    "khoshrou-4.2-phi4",
    "khoshrou-4.2-phi8-stable",
    "khoshrou-4.2-phi8-narrow",
    "khoshrou-4.2-phi8-unstable",
    "clamped-bar-residual-stress",
    "clamped-bar-ordinary",
    "metallurgy-isothermal",
    "metallurgy-dilatometer",
    "dilatometer-sa540-10",
    "dilatometer-sa540-1",
    "satoh-austenite",
    "satoh-martensite",
    "satoh-transformation-plasticity",
    "three-bar-residual-stress",
    "hill-cylinder", "hill-cylinder-ordinary", "hill-sphere", "hill-sphere-hardening",
    "autofrettage", "autofrettage-ordinary", "quenched-ball",
    "slotted-bar-load", "slotted-bar-load-ordinary", "slotted-bar-limit", "slotted-bar-limit-ordinary",
    "heated-cylinder-re20",
    "heated-cylinder-re40",
    "heated-disc",
    "source-on-moving-points",
    "quench-2.1-rod",
    "quench-2.1-rod-constant",
    "quench-2.1-rod-constant-n50",
    "quench-2.2-plate",
    "quench-2.3-crack",
    "quench-2.3-crack-steady",
    "quench-2.3-crack-steady-n10",
    "quench-2.3-crack-steady-n20",
    "quench-2.4-growing-crack",
    "quench-2.4-centred-crack",
    "quench-2.5-jet",
    "quench-2.5-jet-cracks",
    "quench-2.5-edge",
    "quench-3.2-tension",
    "quench-3.3-hole",
    "quench-3.3-damage",
    "quench-3.3-damage-fine",
    "quench-3.4-crack",
    "quench-3.4-damage",
    "quench-3.4-growth",
    "plastic-heat-bar",
    "melt-pool-symmetry",
    "window-track",
    "window-track-uniform",
    "cooling-time-thick-plate",
    "cooling-time-thin-plate",
    "cooling-time-plate",
    "strong-coupling-bar",
    "gao-3.6.1-bending",
    "gao-3.6.2a-cracked-plate",
    "gao-3.6.2b-tearing-plate-uncoupled",
    "gao-3.6.2b-tearing-plate-coupled",
    "gao-3.6.2b-tearing-plate-nosb",
    "surface-steady-wall-300K", "surface-steady-wall-1000K", "surface-steady-radiation",
    "surface-spray-quench", "surface-round-bar", "surface-radiating-cube",
    "surface-symmetry-whole", "surface-symmetry-half",
    "expansion-preheated",
    "gao-3.6.3-kalthoff",
    ],
    "welding": ["bead_on_plate", "butt_weld", "haz_hardness", "residual_stress", "t_joint"],
    "additive": [
        "amb2018_02_a",
        "amb2018_02_b",
        "amb2018_02_c",
        "gcode_part",
        "hatch",
        "part_inherent_strain",
        "powder_bed_hatch",
        "powder_bed_tower",
        "single_track",
        "single_track_window",
        "wall_distortion",
        "wire_arc_wall",
    ],
    "quenching": ["billet", "casting", "end_quench"],
    "geometry": ["elbow" reads "elbow.stl", "v_groove"],
    "toolpaths": ["corner_weld" reads "corner_weld.gcode"],
    "fracture": ["impact"],
    "spacings": ["two-zone-plate"],
);

/// Cases with their names.
#[derive(Debug)]
pub struct Benchmarks {
    /// The cases.
    pub cases: Vec<(String, Case)>,
    /// Files that built-in cases read, deleted when this is dropped.
    _files: Option<TempDir>,
}

/// The benchmark cases of the program, or those of a folder. The files that built-in cases read are written into a
/// temporary folder.
///
/// # Errors
/// The folder cannot be read, the temporary folder cannot be written, or the first mistake in a case.
pub fn load(folder: Option<&Path>) -> Result<Benchmarks, VerifyError> {
    match folder {
        None => built_in(),
        Some(folder) => Ok(Benchmarks {
            cases: of_folder(folder)?,
            _files: None,
        }),
    }
}

fn built_in() -> Result<Benchmarks, VerifyError> {
    let unwritable =
        |path: &Path, source: std::io::Error| file_error(path, "cannot be written", source.into());
    let files = TempDir::with_prefix("perimelt-verify-")
        .map_err(|source| unwritable(&std::env::temp_dir(), source))?;
    let parse = |built_in: &BuiltIn| {
        let BuiltIn {
            folder, name, text, ..
        } = built_in;
        let file = format!("cases/{folder}/{name}.toml");
        let written = built_in.write_files(files.path());
        written.map_err(|(path, source)| unwritable(&path, source))?;
        let case = Case::parse(&file, text.to_string(), files.path())?;
        Ok((name.to_string(), case))
    };
    let cases: Result<_, VerifyError> = BENCHMARKS.iter().map(parse).collect();
    Ok(Benchmarks {
        cases: cases?,
        _files: Some(files),
    })
}

fn of_folder(folder: &Path) -> Result<Vec<(String, Case)>, VerifyError> {
    let unreadable = |source| VerifyError::Folder {
        folder: folder.into(),
        source,
    };
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(unreadable)? {
        paths.push(entry.map_err(unreadable)?.path());
    }
    paths.retain(|path| path.extension().is_some_and(|e| e == "toml"));
    paths.sort();
    let read = |path: std::path::PathBuf| {
        let name = path
            .file_stem()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        Ok((name, Case::read(&path)?))
    };
    paths.into_iter().map(read).collect()
}
