//! What programs do, and what is told of mistakes in them.

use std::path::Path;

use nalgebra::Vector3;

use super::*;
use crate::toolpath::Track;

fn program(keys: &str, text: &str) -> Result<Track, String> {
    let gcode: Gcode = toml::from_str(&format!("file = 'part.gcode'\n{keys}")).expect("valid keys");
    gcode
        .read(text, Path::new("part.gcode"), Some(100.0))
        .map_err(|e| e.to_string())
}

fn close(found: Vector3<f64>, exact: [f64; 3]) {
    assert!(
        (found - Vector3::from(exact)).norm() < 1e-12,
        "{found:?} for {exact:?}"
    );
}

#[test]
fn moves_feeds_and_powers_last_until_they_change() {
    let track = program(
        "origin = [0.001, 0, 0.002]\npower_per_s = 2\nrapid_speed = 0.05",
        "%
        G21 G90 (millimetres) ; absolute
        G0 X10 Y0 Z0
        M3 S150
        G1 X20 F600
        Y10
        M5
        G91 G1 X-5 F1200
        G4 P0.5
        M3
        G90
        X0 Y0
        M30
        G1 X100",
    )
    .expect("a valid program");
    // 10 mm at 50 mm/s
    assert_eq!(track.power(0.1), 0.0);
    close(track.pose(0.1).position, [0.006, 0.0, 0.002]);
    // 10 mm at 10 mm/s twice, 300 W
    assert_eq!(track.power(0.7), 300.0);
    close(track.pose(0.7).position, [0.016, 0.0, 0.002]);
    close(track.pose(1.7).position, [0.021, 0.005, 0.002]);
    close(track.pose(1.7).direction, [0.0, 1.0, 0.0]);
    // 5 mm at 20 mm/s without power, a rest, back to zero with power
    assert_eq!(track.power(2.3), 0.0);
    close(track.pose(2.6).position, [0.016, 0.01, 0.002]);
    let end = 0.2 + 1.0 + 1.0 + 0.25 + 0.5 + 15f64.hypot(10.0) / 20.0;
    assert!((track.end().expect("an end") - end).abs() < 1e-12);
    assert_eq!(track.power(end - 1e-6), 300.0);
    let energy = 300.0 * (2.0 + 15f64.hypot(10.0) / 20.0);
    assert!((track.energy(0.0, end) - energy).abs() < 1e-9 * energy);
}

#[test]
fn arcs_run_the_way_that_their_code_says() {
    let at = |text: &str, share: f64| {
        let track = program("", &format!("G1 X10 F6000 \n M3 \n {text}")).expect("valid");
        let (start, end) = (0.1, track.end().expect("an end"));
        let pose = track.pose(start + share * (end - start));
        (pose.position * 1e3, end - start)
    };
    let quarter = 0.5 * std::f64::consts::PI * 0.01 / 0.1;
    let check = |text: &str, middle: [f64; 3], time: f64| {
        let (found, took) = at(text, 0.5);
        assert!(
            (found - Vector3::from(middle)).norm() < 1e-9,
            "{text}: {found:?}"
        );
        assert!((took - time).abs() < 1e-12, "{text}: {took}");
    };
    let r = 10.0 * 0.5f64.sqrt();
    check("G3 X0 Y10 I-10 J0", [r, r, 0.0], quarter);
    check("G3 X0 Y10 R10", [r, r, 0.0], quarter);
    check("G2 X0 Y10 I-10 J0", [-r, -r, 0.0], 3.0 * quarter);
    // the longer way round a circle about (10, 10)
    check("G3 X0 Y10 R-10", [10.0 + r, 10.0 + r, 0.0], 3.0 * quarter);
    check("G2 X0 Y10 R10", [10.0 - r, 10.0 - r, 0.0], quarter);
    check("G2 I-10", [-10.0, 0.0, 0.0], 4.0 * quarter);
    let inches = program("", "G20 G1 X1 F60").expect("valid");
    close(inches.pose(0.5).position, [0.0127, 0.0, 0.0]);
}

#[test]
fn the_line_of_a_mistake_is_told() {
    for (text, message) in [
        (
            "G1 X1",
            "line 1 of the program part.gcode: a move comes before the first feed",
        ),
        (
            "X1 F100",
            "line 1 of the program part.gcode: coordinates come before",
        ),
        (
            "G21\nG5 X1 F100",
            "line 2 of the program part.gcode: `G5` is not supported",
        ),
        ("G2 X1 F100", "an arc needs either its centre"),
        (
            "G1 F100 X10\nG2 X0 Y10 I-10 J3",
            "line 2 of the program part.gcode: the arc starts 0.01044 m",
        ),
        ("G2 X10 R1 F100", "does not reach over 0.01 m"),
        ("G2 X10 Z1 I5 F100", "changes its height"),
        ("G4", "needs its time `P`"),
        ("G1 F-3", "the feed `F` is -3"),
        ("M3", "the program part.gcode has no move"),
        ("G1 X", "`X` has no number"),
        ("M3.14159", "`M` needs the number of a code"),
        (
            "G1 X1 F100\nG2 X3 I1 P2",
            "line 2 of the program part.gcode: an arc of `P2` turns",
        ),
        ("G1 X1 F100\nG2 X3 I1 K1", "but `K` is given"),
        ("G1 X1 I2 F100", "belong to an arc"),
        ("G1 X1 L2 F100", "`L` has no meaning in this block"),
        ("G1 X1 P2 F100", "`P` has no meaning in this block"),
        (
            "G1 X1 F100\nG92 X0 G1 Y1",
            "line 2 of the program part.gcode: `G92`, `G1` in one block",
        ),
        ("G4 P1 G1 X1 F100", "`G4`, `G1` in one block"),
        ("G1 F100 G53 X1", "`G53` moves in machine coordinates"),
        (
            "G54\nG1 X1 F100\nG55",
            "line 3 of the program part.gcode: `G55` chooses another work offset",
        ),
        (
            "G1 X1 F100\n/X2",
            "line 2 of the program part.gcode: a `/` marks a block",
        ),
    ] {
        let found = program("", text).expect_err(text);
        assert!(found.contains(message), "{text}: {found}");
    }
    assert!(program("", "G1 X#1 F100").is_err(), "a variable");
}

/// The energy (J) of a program by a source of 100 W, and when it ends, s.
fn energy(keys: &str, text: &str) -> (f64, f64) {
    let track = program(keys, text).unwrap_or_else(|e| panic!("{text}: {e}"));
    (track.energy(0.0, 1e9), track.end().expect("an end"))
}

/// Each program is a weld of 20 mm at 20 mm/s with 100 W, among lines that change neither path nor power.
#[test]
fn settings_of_machines_change_neither_path_nor_power() {
    let weld = |before: &str, between: &str| {
        format!("{before}\nG21 G90\nG0 X0 Y0\nM3\nG1 X10 F1200\n{between}\nG1 X20\nM5")
    };
    for line in [
        "M201 X500 Y500 Z100 E1000",
        "X500 Y500 M201",
        "N10 X500 M201 Y500",
        "M203 X150 Y150 Z12 E100",
        "M204 P500 R500 T1500",
        "M205 X8 Y8 Z0.4 E1.5",
        "M73 P0 R12",
        "R12 M73",
        "M106 S40",
        "S40 M106",
        "M104 S235 T0",
        "M109 S235 R3 F1",
        "M190 S60",
        "M221 S95",
        "M220 S50 F3",
        "M92 X80 Y80",
        "M17 X Y Z",
        "M555 X0 Y0 W100 H100",
        "M201 X1 M205 Y2",
        "M900 K0.05",
        "M862.3 P \"MK3S\"",
        "M862.3 P\"X5 Y5\"",
        "M117 Layer 1 (of 2",
        "M82 ; absolute extruder",
        "M0 S5",
        "M8",
        "M62 P1",
        "M67 E0 Q100",
        "M19 R90",
        "T1",
        "T1 M6",
        "T0 S1",
        "G17 G40 G49 G54 G80 G94",
        "G64 P0.01 Q0.02",
        "G92 E0",
        "G90 (length (X): 20 mm)",
        "; (open",
        "N4 G90*20",
        "G1 F1200 E0.5",
        "G0 A0 B0",
        "",
    ] {
        for place in [weld(line, ""), weld("", line), weld(line, line)] {
            let (energy, end) = energy("", &place);
            assert!((energy - 100.0).abs() < 1e-9, "{place}: {energy} J");
            assert!((end - 1.0).abs() < 1e-12, "{place}: {end} s");
        }
    }
}

#[test]
fn codes_beside_a_move_do_not_take_its_words() {
    for text in [
        "M3 G1 X20 F1200",
        "G1 X20 F1200 M3",
        "X20 G1 F1200 M3",
        "G1 F1200\nM3\nX20 M8",
        "G1 F1200\nM3\nM8 X20",
        "G1 F1200\nM3\nX20 M62 P1",
        "G1 F1200\nM3\nX20 M106 S40",
        "G1 F1200\nM3\nG1 X20 M106 S40",
        "G1 F1200\nM3\nT2 X20",
        "G1 F1200\nM3\nG1 X20 M201 X500",
    ] {
        assert_eq!(energy("", text), (100.0, 1.0), "{text}");
    }
    // powers
    for (text, expected) in [
        ("M3 S40\nG1 X20 F1200", 40.0),
        ("S40 M3\nG1 X20 F1200", 40.0),
        ("S40\nM3\nG1 X20 F1200", 40.0),
        ("M3\nG1 X20 F1200 S40", 40.0),
        ("M3\nG1 F1200\nX20 S40 M8", 40.0),
        ("S40 M8\nM3\nG1 X20 F1200", 40.0),
        ("M3\nG1 X10 F1200\nM106 S40 M5\nG1 X20", 50.0),
        ("M106 S40 M3\nG1 X20 F1200", 100.0),
        ("M3 I S40\nG1 X20 F1200", 40.0),
    ] {
        assert_eq!(energy("", text).0, expected, "{text}");
    }
    // a laser that is switched like a fan
    let keys = "on = [106]\noff = [107]";
    let text = "M3 S9\nM106 S40\nG1 X20 F1200\nM107\nG1 X30";
    assert_eq!(energy(keys, text), (40.0, 1.5));
    // M3 is a code without a meaning then, and owns its words
    assert_eq!(energy(keys, "M106\nM3 S9\nG1 X20 F1200").0, 100.0);
}

#[test]
fn axes_that_the_path_does_not_have_keep_their_values() {
    for text in [
        "G0 X0 A0\nM3\nG1 X20 A0 F1200",
        "G0 X0 A90 C-30\nM3\nG1 X20 A90 F1200",
        "G0 A90\nM3\nG1 X20 F1200\nG0 A90",
        "G0 A90\nM3\nG91 G1 X20 A0 F1200",
        "G92 A90\nM3\nG1 X20 A90 F1200",
        "G1 X20 U0 V0 W0 F1200 M3",
    ] {
        assert_eq!(energy("", text), (100.0, 1.0), "{text}");
    }
    for (text, message) in [
        (
            "M3\nG1 X20 A90 F1200",
            "line 2 of the program part.gcode: axis `A` moves from 0 to 90",
        ),
        (
            "G0 A0\nG1 X20 F1200\nG0 C180",
            "line 3 of the program part.gcode: axis `C` moves from 0 to 180",
        ),
        ("G1 X20 F1200\nA180", "axis `A` moves"),
        ("G1 X20 F1200\nG91 G0 B1", "axis `B` moves from 0 to 1"),
        ("G1 X20 F1200\nG2 X0 I-10 W1", "axis `W` moves"),
    ] {
        let found = program("", text).expect_err(text);
        assert!(found.contains(message), "{text}: {found}");
    }
}

#[test]
fn a_program_ends_and_blocks_are_left_out() {
    for text in [
        "%\nM3\nG1 X20 F1200\nM5\nM30\n%\nend of tape",
        "%\nM3\nG1 X20 F1200\n%\nend of tape",
        "M3\nG1 X20 F1200\nM2\nG1 X#1 (open",
        "\u{feff}; a header\n\n%\nO1000 (weld)\nN1 M3\nG1 X20 F1200\n%",
        "M3\r\nG1 X20 F1200\r\nM30\r\n",
        "O1000\nM3 G1 X20 F1200",
    ] {
        assert_eq!(energy("", text), (100.0, 1.0), "{text}");
    }
    let text = "M3\n/G1 Y10 F600\nG1 X20 F1200";
    assert_eq!(energy("block_delete = true", text), (100.0, 1.0));
    // 10 mm at 10 mm/s, and 20 mm at 20 mm/s
    let expected = 200.0;
    let (energy, _) = energy("block_delete = false", text);
    assert!((energy - expected).abs() < 1e-9);
}

#[test]
fn subprograms_are_refused() {
    for (text, message) in [
        (
            "M3\nG1 X1 F100\nM98 P1",
            "line 3 of the program part.gcode: `M98` belongs to a subprogram",
        ),
        ("M3\nG1 X1 F100\nM99", "`M99` belongs"),
        ("M3\nG1 X1 F100\nM97 P10", "`M97` belongs"),
        (
            "M3\nG1 X1 F100\nO1\nG1 X2",
            "line 3 of the program part.gcode: `O` belongs",
        ),
        ("O100 G1 X1 F100", "`O` belongs"),
        ("G65 P1\nG1 X1 F100", "`G65` is not supported"),
        ("O100 sub", "`sub` is not understood"),
    ] {
        let found = program("", text).expect_err(text);
        assert!(found.contains(message), "{text}: {found}");
    }
}

#[test]
fn a_place_gets_new_coordinates() {
    for text in [
        "M3\nG1 X10 F1200\nG92 X0 Y0\nG1 X10",
        "M3\nG1 X10 F1200\nG92 X0\nG92.1\nG1 X20",
        "G92 X100\nM3\nG1 X120 F1200",
        "G20\nG92 X1\nG21\nM3\nG1 X45.4 F1200",
    ] {
        let track = program("origin = [0.001, 0, 0]", text).expect(text);
        close(track.pose(1e3).position, [0.021, 0.0, 0.0]);
        assert!((track.energy(0.0, 1e3) - 100.0).abs() < 1e-9, "{text}");
    }
}

#[test]
fn skipped_codes_are_told() {
    let text = "G28 X Y\nG29 P1\nG0 G43 H1 Z0\nM3\nG1 X10 F1200\nG53 G0 X500 Z0\nG28\nG28 X100\nG1 X20\nG92\nG10 P1";
    let track = program("", text).expect("valid");
    assert_eq!((track.energy(0.0, 1e3), track.end()), (100.0, Some(1.0)));
    let warnings = track.warnings().join("\n");
    for told in [
        "`G28` in line 1 and in 2 more lines of the program is skipped",
        "`G29` in line 2 of the program is skipped",
        "`G43` in line 3",
        "`G53` in line 6",
        "`G92` in line 10",
        "`G10` in line 11",
    ] {
        assert!(warnings.contains(told), "{warnings} lacks {told}");
    }
    let text = "M3\nG1 X20 F1200\nG5 X100 I1 J1\nM98 P1\nG55";
    assert!(program("", text).is_err());
    let track = program("skip = ['g5', 'M98', 'G54', 'G55']", text).expect("skipped");
    assert_eq!((track.energy(0.0, 1e3), track.end()), (100.0, Some(1.0)));
    assert_eq!(track.warnings().len(), 3);
    for entry in ["G1", "X3", "G", "28", "", "M1.55"] {
        let found = program(&format!("skip = ['{entry}']"), text).expect_err(entry);
        assert!(found.contains("`skip` has"), "{found}");
    }
}
