//! A comparison as a table.

use std::io::{self, Write};

use super::{Compared, DiffArgs, Difference, LogComparison};
use crate::unit::{label, number, pretty_unit};

/// Prints the differences by quantity, the contents of only one log, and the conclusion.
///
/// # Errors
/// The output cannot be written.
pub fn print(comparison: &LogComparison, args: &DiffArgs, out: &mut impl Write) -> io::Result<()> {
    let name = |c: &Compared| format!("  {}", label(&c.name, &pretty_unit(&c.unit)));
    let width = comparison.compared.iter().map(|c| name(c).chars().count());
    let width = width.max().unwrap_or(0).max("  quantity".len());
    writeln!(
        out,
        "{:width$} {:>12} {:>12} {:>12} {:>14}",
        "  quantity", "largest", "RMS", "relative", "at (s)"
    )?;
    let mut of = "";
    for compared in &comparison.compared {
        if compared.of != of {
            of = &compared.of;
            writeln!(out, "{of}")?;
        }
        let shown = match (args.times, compared.worst()) {
            (true, _) => compared.differences.clone(),
            (false, worst) => worst.into_iter().collect(),
        };
        for (row, difference) in shown.into_iter().enumerate() {
            let title = if row == 0 {
                name(compared)
            } else {
                String::new()
            };
            let relative = compared.relative(difference.largest);
            let mark = if relative <= args.tolerance {
                ""
            } else {
                "  *"
            };
            let row = numbers(difference, relative, args.times);
            writeln!(out, "{title:width$} {row}{mark}")?;
        }
    }
    for sentence in &comparison.unmatched {
        writeln!(out, "{sentence}")?;
    }
    let tolerance = match args.tolerance {
        0.0 => String::new(),
        tolerance => format!(" within a relative tolerance of {tolerance}"),
    };
    let all = comparison.compared.len();
    match (
        comparison.beyond(args.tolerance),
        comparison.unmatched.is_empty(),
    ) {
        (0, true) => writeln!(out, "equal{tolerance}: {all} quantities"),
        (0, false) => writeln!(
            out,
            "different: the {all} quantities that both logs have are equal{tolerance}"
        ),
        (some, _) => writeln!(
            out,
            "different: {some} of {all} quantities (*){}",
            match args.tolerance {
                0.0 => String::new(),
                tolerance => format!(" by more than {tolerance} of their size"),
            }
        ),
    }
}

fn numbers(difference: Difference, relative: f64, with_time: bool) -> String {
    let Difference { time, largest, rms } = difference;
    let short = |value: f64| number(value, 4);
    // where all times are equal, none is the worst
    let at = if largest == 0.0 && !with_time {
        String::new()
    } else {
        number(time, 8)
    };
    let line = format!(
        "{:>12} {:>12} {:>12} {at:>14}",
        short(largest),
        short(rms),
        short(relative),
    );
    line.trim_end().to_owned()
}
