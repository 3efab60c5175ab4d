//! Tables: one header line with units in brackets, numbers that read back exactly.

use std::{
    collections::BTreeSet,
    io::{self, Write},
};

use perimelt_core::log::{LoggedCloud, Progress, Series};

use crate::component::{TENSOR, VECTOR};
use crate::log_file::fit_f32;
use crate::terminal::clean;

/// Positions and fields, a line per point.
pub(super) fn cloud(file: &mut impl Write, cloud: &LoggedCloud) -> io::Result<()> {
    let mut header: Vec<String> = VECTOR.map(|axis| title(axis, "m")).into();
    for field in &cloud.fields {
        let suffixes: &[&str] = match field.components {
            3 => &VECTOR,
            9 => &TENSOR,
            _ => &[],
        };
        let suffixed = |suffix: &&str| title(&format!("{}.{suffix}", field.name), &field.unit);
        header.extend(suffixes.iter().map(suffixed));
        if suffixes.is_empty() {
            header.push(title(&field.name, &field.unit));
        }
    }
    writeln!(file, "{}", header.join(","))?;

    let positions = cloud.positions.as_flattened();
    let mut columns = vec![(3, positions, fit_f32(positions))];
    columns.extend(
        cloud
            .fields
            .iter()
            .map(|f| (f.components, &f.values[..], fit_f32(&f.values))),
    );
    for point in 0..cloud.positions.len() {
        let mut separator = "";
        for &(components, values, short) in &columns {
            for value in &values[point * components..(point + 1) * components] {
                write!(file, "{separator}")?;
                // the shortest digits that read back as the same four or eight bytes
                if short {
                    write!(file, "{}", *value as f32)?
                } else {
                    write!(file, "{value}")?
                }
                separator = ",";
            }
        }
        writeln!(file)?;
    }
    Ok(())
}

/// A time series, a line per time.
pub(super) fn series(file: &mut impl Write, series: &Series) -> io::Result<()> {
    let titles = series
        .columns
        .iter()
        .map(|column| title(&column.name, &column.unit));
    let header: Vec<String> = std::iter::once(title("time", "s")).chain(titles).collect();
    writeln!(file, "{}", header.join(","))?;
    for (row, time) in series.times.iter().enumerate() {
        write!(file, "{time}")?;
        for column in &series.columns {
            write!(file, ",{}", column.values[row])?;
        }
        writeln!(file)?;
    }
    Ok(())
}

/// Times of the clouds by number.
pub(super) fn times(file: &mut impl Write, times: &[f64]) -> io::Result<()> {
    writeln!(file, "number,{}", title("time", "s"))?;
    times
        .iter()
        .enumerate()
        .try_for_each(|(number, time)| writeln!(file, "{number:05},{time}"))
}

/// Progress of the run, with a column for each physics that sub-steps or iterates.
pub(super) fn progress(file: &mut impl Write, progress: &[Progress]) -> io::Result<()> {
    let names = |of: fn(&Progress) -> Vec<&String>| -> BTreeSet<&String> {
        progress.iter().flat_map(of).collect()
    };
    let sub_steps = names(|line| line.sub_steps.keys().collect());
    let iterations = names(|line| line.iterations.keys().collect());
    let evaluations = names(|line| line.evaluations.keys().collect());
    let mut header: Vec<String> = vec![title("time", "s"), "step".into(), title("step_size", "s")];
    header.extend(
        sub_steps
            .iter()
            .map(|name| title(&format!("sub_steps.{name}"), "1")),
    );
    header.extend(
        iterations
            .iter()
            .map(|name| title(&format!("iterations.{name}"), "1")),
    );
    header.extend(
        evaluations
            .iter()
            .map(|name| title(&format!("evaluations.{name}"), "1")),
    );
    header.extend(["coupling_passes".into(), title("wall_time", "s")]);
    writeln!(file, "{}", header.join(","))?;
    for line in progress {
        write!(file, "{},{},{}", line.time, line.step, line.step_size)?;
        let of = |counts: &std::collections::BTreeMap<String, u64>, name: &String| {
            counts.get(name).copied().unwrap_or_default()
        };
        for name in &sub_steps {
            write!(file, ",{}", of(&line.sub_steps, name))?;
        }
        for name in &iterations {
            write!(file, ",{}", of(&line.iterations, name))?;
        }
        for name in &evaluations {
            write!(file, ",{}", of(&line.evaluations, name))?;
        }
        writeln!(file, ",{},{}", line.coupling_passes, line.wall_seconds)?;
    }
    Ok(())
}

/// `name [unit]`, quoted if it has to be.
fn title(name: &str, unit: &str) -> String {
    let title = match unit {
        "" | "1" => name.to_owned(),
        unit => format!("{name} [{unit}]"),
    };
    let title = clean(&title);
    if title.contains([',', '"', '\n']) {
        format!("\"{}\"", title.replace('"', "\"\""))
    } else {
        title
    }
}
