//! What tables of every format promise.

use std::path::Path;

use nalgebra::Vector3;

use super::*;

/// The path of a table with these keys, by a source of 200 W.
fn table(keys: &str, content: &str) -> Result<Track, String> {
    let table: Table = toml::from_str(&format!("file = 'path.txt'\n{keys}")).expect("valid keys");
    let track = table.read(content, Path::new("path.txt"), Some(200.0));
    track.map_err(|e| e.to_string())
}

fn of(format: &str, content: &str) -> Track {
    table(&format!("format = '{format}'"), content).unwrap_or_else(|e| panic!("{format}: {e}"))
}

const TWO_TRACKS: &str = "Mode X(m) Y(m) Z(m) Power(W) tParam\n\
    1 0.001 0.002 0.0005 0 0\n\
    0 0.003 0.002 0.0005 195 0.8\n\
    1 0.003 0.002 0.0005 0 1e-3\n\n\
    1 0.003 0.0021 0.0005 50 5e-4\n\
    0 0.001 0.0021 0.0005 195 1.6\n";

#[test]
fn a_scan_path_moves_and_rests() {
    let track = of("additivefoam", TWO_TRACKS);
    // 2 mm at 0.8 m/s, a pause of 1 ms, 0.5 ms on the spot, 2 mm at 1.6 m/s
    let ends = [2.5e-3, 3.5e-3, 4e-3, 5.25e-3];
    assert!((track.end().expect("it ends") - ends[3]).abs() < 1e-15);
    let middle = track.pose(1.25e-3);
    assert!((middle.position - Vector3::new(2e-3, 2e-3, 5e-4)).norm() < 1e-15);
    assert_eq!(middle.power, 195.0);
    assert!((middle.speed - 0.8).abs() < 1e-12);
    assert_eq!(track.power(3e-3), 0.0);
    let spot = track.pose(3.75e-3);
    assert_eq!((spot.power, spot.speed), (50.0, 0.0));
    assert!((spot.position - Vector3::new(3e-3, 2.1e-3, 5e-4)).norm() < 1e-15);
    assert!((track.pose(5e-3).direction + Vector3::x()).norm() < 1e-12);
    let energy = 195.0 * (2.5e-3 + 1.25e-3) + 50.0 * 5e-4;
    assert!((track.energy(0.0, 1.0) - energy).abs() < 1e-12);
}

#[test]
fn a_first_move_begins_at_the_origin() {
    let track = of(
        "additivefoam",
        "mode x y z power parameter\n0 0.002 0 0 10 2\n",
    );
    assert!((track.pose(0.5e-3).position - Vector3::x() * 1e-3).norm() < 1e-15);
}

/// 20 mm from (5, 10, 0) mm at 20 mm/s with 200 W in the words of each program: 200 J.
#[test]
fn one_path_in_the_formats_of_several_programs() {
    for (format, content) in [
        (
            "additivefoam",
            "Mode x y z pmod param\n1 0.005 0.010 0 0 1e-6\n0 0.025 0.010 0 1 0.02\n",
        ),
        (
            "additivefoam",
            "Mode X(mm) Y(mm) Z(mm) Power(W) tParam\n1 5 10 0 0 1e-6\n0 25 10 0 200 0.02\n",
        ),
        (
            "additivefoam",
            "1 0.005 0.010 0 0 1e-6\n0 0.025 0.010 0 200 0.02\n",
        ),
        (
            "additivefoam",
            "# Mode X(mm) Y(mm) Z(mm) Pmod tParam\n1 5 10 0 0 1e-6\n0 25 10 0 1 0.02\n",
        ),
        (
            "adamantine",
            "Number of path segments\n2\nMode    x       y     z   pmod    param\n1 0.005 0.01 0 0 1e-6\n0 0.025 0.01 0 1 0.02\n",
        ),
        (
            "adamantine",
            "1 0.005 0.01 0 0 1e-6\n0 0.025 0.01 0 1 0.02\n",
        ),
        (
            "3dthesis",
            "Mode\tX(mm)\tY(mm)\tZ(mm)\tPmod\tTime(s)\n1\t5\t10\t0\t0\t1e-6\n\n0\t25\t10\t0\t1\t0.02\n",
        ),
        (
            "3dthesis",
            "Mode X Y Z Pmod tParam\n1 5 10 0 0 1e-6\n0 25 10 0 1 0.02\n",
        ),
        ("3dthesis", "1 5 10 0 0 1e-6\n0 25 10 0 1 0.02\n"),
    ] {
        let track = of(format, content);
        let energy = track.energy(0.0, 1e3);
        assert!((energy - 200.0).abs() < 1e-9, "{content}: {energy} J");
        let end = track.pose(1e3).position;
        assert!(
            (end - Vector3::new(0.025, 0.01, 0.0)).norm() < 1e-15,
            "{content}"
        );
        assert!((track.end().expect("an end") - 1.000001).abs() < 1e-12);
    }
}

/// Two tracks of 1 s with 200 W, 0.5 s without power between them: 400 J.
#[test]
fn the_power_of_an_event_holds_until_the_next_one() {
    let (factors, watts) = ("power_as = 'factor'\n", "power_as = 'watts'\n");
    for (keys, content) in [
        (
            "",
            "time,x,y,z,power\n0,0.005,0.01,0,200\n1,0.025,0.01,0,0\n1.5,0.005,0.012,0,200\n2.5,0.025,0.012,0,0\n",
        ),
        (
            "",
            "0 0.005 0.01 0 200\n1 0.025 0.01 0 0\n1.5 0.005 0.012 0 200\n2.5 0.025 0.012 0 0\n",
        ),
        (
            watts,
            "0, 0.005, 0.01, 0, 200\n1, 0.025, 0.01, 0, 0\n1.5,0.005,0.012,0,200\n2.5,0.025,0.012,0,0",
        ),
        (
            factors,
            "0,0.005,0.01,0,1\n1,0.025,0.01,0,0\n1.5,0.005,0.012,0,1\n2.5,0.025,0.012,0,0\n",
        ),
        (
            "",
            "X(mm) Y(mm) Z(mm) pmod Time(ms)\n5 10 0 1 0\n25 10 0 0 1000\n5 12 0 1 1500\n25 12 0 0 2500\n",
        ),
    ] {
        let track = table(&format!("format = 'events'\n{keys}"), content).expect(content);
        assert!((track.energy(0.0, 1e3) - 400.0).abs() < 1e-9, "{content}");
        assert_eq!(
            [0.5, 1.25, 2.0].map(|t| track.power(t)),
            [200.0, 0.0, 200.0]
        );
        assert!((track.pose(0.5).position.x - 0.015).abs() < 1e-15);
        assert!((track.pose(1.25).position - Vector3::new(0.015, 0.011, 0.0)).norm() < 1e-15);
        assert_eq!(track.warnings(), &[] as &[String]);
    }
    let open = of("events", "0 0 0 0 5\n1 1 0 0 5\n");
    assert!(open.warnings()[0].contains("the last row of the toolpath table path.txt has power"));
}

#[test]
fn a_table_that_ramps_where_it_looks_switched_is_told() {
    let switched = "time,x,y,z,power\n0,0,0,0,200\n1,1,0,0,0\n1.5,0,0,0,200\n2.5,1,0,0,0\n";
    let track = of("csv", switched);
    assert_eq!(track.energy(0.0, 9.0), 250.0);
    assert!(
        track.warnings()[0].contains("`format = \"events\"`"),
        "{:?}",
        track.warnings()
    );
    for silent in [
        // rows at equal times switch
        "time,x,y,z,power\n0,0,0,0,200\n1,1,0,0,200\n1,1,0,0,0\n2,0,0,0,0\n",
        // a ramp at rest, and levels between
        "time,x,y,z,power\n0,0,0,0,0\n1,0,0,0,200\n2,1,0,0,200\n",
        "time,x,y,z,power\n0,0,0,0,0\n1,1,0,0,100\n2,2,0,0,200\n",
    ] {
        assert_eq!(of("csv", silent).warnings().len(), 0, "{silent}");
    }
    // columns in other units and orders
    let track = of(
        "csv",
        "x(mm),power(kW),time(ms),y(mm),z(mm)\n0,0.2,0,0,0\n10,0.2,500,0,0\n",
    );
    assert!((track.energy(0.0, 9.0) - 100.0).abs() < 1e-12);
    assert!((track.pose(0.25).position.x - 5e-3).abs() < 1e-15);
}

#[test]
fn commands_of_a_scanner_are_rows_at_equal_intervals() {
    let keys = "format = 'xypt'\ntime_step = 1e-5\nz = 2e-3";
    // 0.8 m/s: 8 um in 10 us
    for head in [
        "X(mm),Y(mm),Power(W),Trigger\n",
        "x y power trigger\n",
        "# a comment\n",
        "",
    ] {
        let content = format!("{head}0.2,1,0,0\n0.208,1,195,2\n0.216,1,195,0\n0.216,1.004,0,0\n");
        let track = table(keys, &content).expect("valid");
        assert!((track.end().expect("it ends") - 3e-5).abs() < 1e-18);
        assert_eq!(
            [5e-6, 1.5e-5, 2.5e-5].map(|t| track.power(t)),
            [0.0, 195.0, 195.0]
        );
        let pose = track.pose(1.5e-5);
        assert!((pose.position - Vector3::new(2.12e-4, 1e-3, 2e-3)).norm() < 1e-15);
        assert!((pose.speed - 0.8).abs() < 1e-9);
        assert!((track.energy(0.0, 1.0) - 195.0 * 2e-5).abs() < 1e-15);
    }
    let blanks = table("format = 'xypt'\ntime_step = 0.5", "0 0 1\n1 0 1\n").expect("valid");
    assert_eq!(blanks.energy(0.0, 1.0), 0.5);
}

/// Format, content and a part of the message.
const MISTAKES: &[(&str, &str, &str)] = &[
    (
        "additivefoam",
        "mode x y z power param\n\n0 0 0 0 1\n",
        "line 3",
    ),
    (
        "additivefoam",
        "mode x y z power param\n0 0 0 0 b 1\n0 0 0 0 1 1\n",
        "line 2",
    ),
    (
        "additivefoam",
        "mode x y z power param\n0 1 0 0 1 1\n0 0 0 0 b 1\n",
        "`b` is not a number",
    ),
    (
        "additivefoam",
        "mode x y z power param\n2 0 0 0 1 1\n",
        "`mode` is 2",
    ),
    (
        "additivefoam",
        "mode x y z power param\n0 1 0 0 1 0\n",
        "`parameter` is 0",
    ),
    (
        "additivefoam",
        "mode x y z power param\n1 0 0 0 1 -1\n",
        "`parameter` is -1",
    ),
    (
        "additivefoam",
        "mode x y z power param\n1 0 0 0 -1 1\n",
        "`power` is -1",
    ),
    (
        "additivefoam",
        "mode x y z pmod param\n1 0 0 0 -1 1\n",
        "`factor` is -1",
    ),
    (
        "additivefoam",
        "mode x y z power param\n1 0 0 0 1 1 7\n",
        "it has 7 entries",
    ),
    ("additivefoam", "mode x y z power param\n", "0 rows"),
    (
        "additivefoam",
        "mode x y z power p\n1 0 0 0 1 1\n",
        "line 1 of the toolpath table path.txt cannot be read: column `p` is there twice",
    ),
    (
        "additivefoam",
        "mode x(ft) y z power param\n",
        "the unit of column `x(ft)` is not known",
    ),
    (
        "adamantine",
        "Number of path segments\n3\nMode x y z pmod param\n1 0 0 0 1 1\n",
        "line 2 of the toolpath table path.txt cannot be read: 3 segments are announced, but 1 follow",
    ),
    ("events", "0 0 0 0 1\n-1 1 0 0 0\n", "line 2"),
    (
        "events",
        "0 0 0 0 1 0 0 0 1\n1 1 0 0 0 0 0 0 0\n",
        "it has 9 entries",
    ),
    (
        "events",
        "time,x,y,z\n0 0 0 0\n",
        "the column of the power is missing",
    ),
    ("events", "0 0 0 0 1\n", "1 rows"),
    ("xypt", "x,y,power,trigger\n0,0\n", "line 2"),
    ("xypt", "0,0,1,0\n0,nan,1,0\n", "line 2"),
    ("xypt", "0,0,1,0\n1,0,-1,0\n", "`power` is -1"),
    ("xypt", "0,0,1,0\n", "1 rows"),
];

#[test]
fn mistakes_name_the_line_and_the_column() {
    for &(format, content, expected) in MISTAKES {
        let found = table(&format!("format = '{format}'"), content).expect_err(content);
        assert!(found.contains(expected), "{content}: {found}");
    }
    let factor = Table {
        file: "p".into(),
        format: TableFormat::Thesis,
        power_as: None,
        time_step: None,
        z: None,
        wait_until: None,
    };
    let none = factor
        .read("1 0 0 0 1 1\n", Path::new("p"), None)
        .expect_err("no power");
    assert!(none.to_string().contains("no power is given"), "{none}");
}

#[test]
fn a_table_has_a_format() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let write = |name: &str, content: &str| {
        std::fs::write(folder.path().join(name), content).expect("a written file");
    };
    write(
        "path.txt",
        "Mode X Y Z Power Parameter\n1 0 0 0 0 0\n0 2 0 0 30 4\n",
    );
    write("path.csv", "0,0,30,0\n2,0,30,0\n");
    let track = |keys: &str| {
        let table: Table = toml::from_str(&keys.replace(", ", "\n")).expect("valid keys");
        table.track(None, folder.path())
    };
    let foam = track("file = 'path.txt', format = 'additivefoam'").expect("valid");
    assert_eq!(foam.energy(0.0, 1.0), 15.0);
    let scanner =
        track("file = 'path.csv', format = 'xypt', time_step = 0.5, z = 3").expect("valid");
    assert_eq!(scanner.pose(0.25).position, Vector3::new(1e-3, 0.0, 3.0));
    assert_eq!(scanner.energy(0.0, 1.0), 15.0);
    let usual = track("file = 'path.csv', format = 'xypt'").expect("valid");
    assert_eq!(usual.end(), Some(1e-5));
    for (keys, key) in [
        ("file = 'path.csv', time_step = 0.5", "time_step"),
        (
            "file = 'path.csv', format = 'xypt', time_step = 0",
            "time_step",
        ),
        ("file = 'path.txt', format = 'additivefoam', z = 1", "z"),
        ("file = 'path.csv', power_as = 'factor'", "power_as"),
    ] {
        assert_eq!(track(keys).expect_err("wrong").key, key);
    }
}
