//! Scan paths in the formats of other programs and machines, read by [`Table`](super::Table).
//!
//! - `additivefoam`: the scan path of AdditiveFOAM. A header, then rows `mode x y z power parameter`, separated by blanks. Mode 0:
//!   a straight move from the position of the row before to this one with `parameter` as its speed (m/s). Mode 1: the source
//!   rests at this position for `parameter` (s). Positions in m, power in W, that of the row. The path begins at time 0; a first
//!   row of mode 0 begins at the origin, as in AdditiveFOAM.
//! - `xypt`: commands of a galvanometer scanner at constant intervals, as published for the AM-Bench builds of NIST. Rows of X (mm),
//!   Y (mm), power (W) and optionally the trigger of a camera, which is not used; separated by commas or blanks, with or without a
//!   header. The power of a row holds until the next one; the position is linear between rows.

use std::path::Path;

use nalgebra::Vector3;

use super::track::TrackBuilder;
use super::{ToolpathError, Track};

/// The rows of a file that are not empty and no comments, with their lines in the file, counted from 1.
fn rows(content: &str) -> impl Iterator<Item = (u64, Vec<&str>)> {
    let lines = (1..).zip(content.lines());
    let rows = lines.map(|(line, text)| {
        let entries = text.split(|c: char| c == ',' || c.is_whitespace());
        (line, entries.filter(|e| !e.is_empty()).collect::<Vec<_>>())
    });
    rows.filter(|(_, row)| row.first().is_some_and(|e| !e.starts_with('#')))
}

fn is_header(row: &[&str]) -> bool {
    row.iter().all(|entry| entry.parse::<f64>().is_err())
}

/// Reads the numbers of rows, and makes errors.
struct Rows<'a> {
    path: &'a Path,
    columns: &'static [&'static str],
    /// How many of the columns a row must have.
    needed: usize,
}

impl Rows<'_> {
    fn wrong(
        &self,
        line: u64,
        column: &'static str,
        value: f64,
        expected: &'static str,
    ) -> ToolpathError {
        ToolpathError::TableValue {
            path: self.path.into(),
            line,
            column,
            value,
            expected,
        }
    }

    /// The numbers of a row; zero in columns that are left out.
    fn numbers<const N: usize>(&self, line: u64, row: &[&str]) -> Result<[f64; N], ToolpathError> {
        let unreadable = |problem: String| ToolpathError::TableLine {
            path: self.path.into(),
            line,
            problem,
            columns: self.columns.join(" "),
        };
        if !(self.needed..=N).contains(&row.len()) {
            return Err(unreadable(format!("it has {} entries", row.len())));
        }
        let mut numbers = [0.0_f64; N];
        for (i, entry) in row.iter().enumerate() {
            numbers[i] = entry
                .parse()
                .map_err(|_| unreadable(format!("`{entry}` is not a number")))?;
            if !numbers[i].is_finite() {
                return Err(self.wrong(line, self.columns[i], numbers[i], "a finite number"));
            }
        }
        Ok(numbers)
    }

    fn not_negative(
        &self,
        line: u64,
        column: &'static str,
        value: f64,
    ) -> Result<f64, ToolpathError> {
        match value >= 0.0 {
            true => Ok(value),
            false => Err(self.wrong(line, column, value, "a finite number, zero or greater")),
        }
    }

    fn finish(&self, track: Option<TrackBuilder>, rows: usize) -> Result<Track, ToolpathError> {
        let too_short = || ToolpathError::TableShort {
            path: self.path.into(),
            rows,
        };
        track.and_then(TrackBuilder::finish).ok_or_else(too_short)
    }
}

/// The scan path of AdditiveFOAM.
pub(super) fn additivefoam(content: &str, path: &Path) -> Result<Track, ToolpathError> {
    let reader = Rows {
        path,
        columns: &["mode", "x", "y", "z", "power", "parameter"],
        needed: 6,
    };
    let mut track: Option<TrackBuilder> = None;
    let mut number = 0;
    for (line, row) in rows(content) {
        if number == 0 && is_header(&row) {
            continue;
        }
        let [mode, x, y, z, power, parameter] = reader.numbers(line, &row)?;
        let place = Vector3::new(x, y, z);
        let power = reader.not_negative(line, "power", power)?;
        if mode == 0.0 {
            if parameter <= 0.0 {
                let expected = "a speed above 0, m/s";
                return Err(reader.wrong(line, "parameter", parameter, expected));
            }
            let track = track.get_or_insert_with(|| TrackBuilder::new(0.0, Vector3::zeros()));
            track.go(place, parameter, power);
        } else if mode == 1.0 {
            let duration = reader.not_negative(line, "parameter", parameter)?;
            let track = track.get_or_insert_with(|| TrackBuilder::new(0.0, place));
            track.glide(place, 0.0, [power; 2]);
            track.dwell(duration, power);
        } else {
            return Err(reader.wrong(line, "mode", mode, "0 (a move) or 1 (a rest)"));
        }
        number += 1;
    }
    reader.finish(track, number)
}

/// Commands of a scanner at intervals of `time_step` (s), at the height `z` (m).
pub(super) fn xypt(
    content: &str,
    path: &Path,
    (time_step, z): (f64, f64),
) -> Result<Track, ToolpathError> {
    const MILLIMETRE: f64 = 1e-3;
    let reader = Rows {
        path,
        columns: &["x(mm)", "y(mm)", "power(W)", "trigger"],
        needed: 3,
    };
    let mut track: Option<(TrackBuilder, f64)> = None;
    let mut number = 0;
    for (line, row) in rows(content) {
        if number == 0 && is_header(&row) {
            continue;
        }
        let [x, y, power, _trigger] = reader.numbers(line, &row)?;
        let place = Vector3::new(x * MILLIMETRE, y * MILLIMETRE, z);
        let power = reader.not_negative(line, "power(W)", power)?;
        match &mut track {
            None => track = Some((TrackBuilder::new(0.0, place), power)),
            Some((track, before)) => {
                track.glide(place, time_step, [*before; 2]);
                *before = power;
            }
        }
        number += 1;
    }
    reader.finish(track.map(|(track, _)| track), number)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TWO_TRACKS: &str = "Mode X(m) Y(m) Z(m) Power(W) tParam\n\
        1 0.001 0.002 0.0005 0 0\n\
        0 0.003 0.002 0.0005 195 0.8\n\
        1 0.003 0.002 0.0005 0 1e-3\n\n\
        1 0.003 0.0021 0.0005 50 5e-4\n\
        0 0.001 0.0021 0.0005 195 1.6\n";

    #[test]
    fn a_path_of_additivefoam_moves_and_rests() {
        let track = additivefoam(TWO_TRACKS, Path::new("path")).expect("valid");
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
    fn a_first_move_of_additivefoam_begins_at_the_origin() {
        let path = "mode x y z power parameter\n0 0.002 0 0 10 2\n";
        let track = additivefoam(path, Path::new("path")).expect("valid");
        assert!((track.pose(0.5e-3).position - Vector3::x() * 1e-3).norm() < 1e-15);
    }

    #[test]
    fn commands_of_a_scanner_are_rows_at_equal_intervals() {
        // 0.8 m/s: 8 um in 10 us
        for head in ["X(mm),Y(mm),Power(W),Trigger\n", "# a comment\n", ""] {
            let content =
                format!("{head}0.2,1,0,0\n0.208,1,195,2\n0.216,1,195,0\n0.216,1.004,0,0\n");
            let track = xypt(&content, Path::new("path"), (1e-5, 2e-3)).expect("valid");
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
        let blanks = xypt("0 0 1\n1 0 1\n", Path::new("path"), (0.5, 0.0)).expect("valid");
        assert_eq!(blanks.energy(0.0, 1.0), 0.5);
    }

    #[test]
    fn mistakes_name_the_line_and_the_column() {
        for (content, expected) in [
            ("mode x y z power p\n\n0 0 0 0 1\n", "line 3"),
            ("mode x y z power p\n0 0 0 0 b 1\n", "`b` is not a number"),
            ("mode x y z power p\n2 0 0 0 1 1\n", "`mode` is 2"),
            ("mode x y z power p\n0 1 0 0 1 0\n", "`parameter` is 0"),
            ("mode x y z power p\n1 0 0 0 -1 1\n", "`power` is -1"),
            ("mode x y z power p\n1 0 0 0 1 1 7\n", "it has 7 entries"),
            ("mode x y z power p\n", "0 rows"),
        ] {
            let error = additivefoam(content, Path::new("path")).expect_err("faulty");
            assert!(
                error.to_string().contains(expected),
                "{error} lacks {expected}"
            );
        }
        for (content, expected) in [
            ("x,y,power,trigger\n0,0\n", "line 2"),
            ("0,0,1,0\n0,nan,1,0\n", "line 2"),
            ("0,0,1,0\n1,0,-1,0\n", "`power(W)` is -1"),
            ("0,0,1,0\n", "1 rows"),
        ] {
            let error = xypt(content, Path::new("path"), (1e-5, 0.0)).expect_err("faulty");
            assert!(
                error.to_string().contains(expected),
                "{error} lacks {expected}"
            );
        }
    }
}
