//! Title of the case, title of the picture, and names of lines in rows.

use crate::axes::{LABEL, TICK, TITLE};
use crate::picture::{Anchor, Picture, TextLook, look, text_width};

/// Height of a title without that of the case, pixels.
const TITLE_HEIGHT: f64 = 64.0;
/// Height of the title of the case.
const CASE_HEIGHT: f64 = 30.0;
/// Height of a row of names.
pub(crate) const ROW: f64 = 26.0;
/// Length of the piece of a line beside its name.
const SAMPLE: f64 = 36.0;

/// Height of the titles, pixels.
pub(crate) fn heading_height(case: &str) -> f64 {
    TITLE_HEIGHT + if case.is_empty() { 0.0 } else { CASE_HEIGHT }
}

/// Draws the title of the case above that of the picture.
pub(crate) fn draw_heading(picture: &mut Picture, left: f64, case: &str, title: &str) {
    let room = picture.width() - left - 20.0;
    let bold = TextLook {
        bold: true,
        ..look(TITLE, Anchor::Left)
    };
    let y = 0.45 * TITLE_HEIGHT;
    let upper = if case.is_empty() { title } else { case };
    picture.text(shortened(upper, TITLE, room), [left, y], bold);
    if !case.is_empty() {
        let at = [left, y + CASE_HEIGHT];
        picture.text(shortened(title, LABEL, room), at, look(LABEL, Anchor::Left));
    }
}

/// The text, cut off at its end where it would be wider than the room.
fn shortened(text: &str, size: f64, room: f64) -> String {
    if text_width(text, size) <= room {
        return text.to_owned();
    }
    let mut letters: Vec<char> = text.chars().collect();
    while letters.pop().is_some() {
        let short = format!("{}…", letters.iter().collect::<String>().trim_end());
        if text_width(&short, size) <= room {
            return short;
        }
    }
    String::new()
}

/// Names of lines in rows, each beside a piece of its line.
#[derive(Clone, Debug)]
pub(crate) struct Legend {
    /// numbers and names of the lines
    rows: Vec<Vec<(usize, String)>>,
}

fn width_of(row: &[(usize, String)]) -> f64 {
    let widths = row
        .iter()
        .map(|(_, name)| text_width(name, TICK) + SAMPLE + LABEL);
    widths.sum()
}

impl Legend {
    /// Rows that are no wider than the room (pixels).
    pub(crate) fn new(names: impl IntoIterator<Item = String>, room: f64) -> Self {
        let mut rows: Vec<Vec<(usize, String)>> = Vec::new();
        for entry in names.into_iter().enumerate() {
            let width = width_of(std::slice::from_ref(&entry));
            match rows.last_mut().filter(|row| width_of(row) + width <= room) {
                Some(row) => row.push(entry),
                None => rows.push(vec![entry]),
            }
        }
        Self { rows }
    }

    /// Number of rows.
    pub(crate) fn len(&self) -> usize {
        self.rows.len()
    }

    /// Width of the widest row, pixels.
    pub(crate) fn width(&self) -> f64 {
        self.rows
            .iter()
            .map(|row| width_of(row))
            .fold(0.0, f64::max)
    }

    /// Draws the rows up to `right`, the first one at the height `y`; `sample` draws a piece of a line, given by its number.
    pub(crate) fn draw(
        &self,
        picture: &mut Picture,
        [right, y]: [f64; 2],
        sample: impl Fn(&mut Picture, [[f64; 2]; 2], usize),
    ) {
        for (number, row) in self.rows.iter().enumerate() {
            let y = y + number as f64 * ROW;
            let mut x = right - width_of(row);
            for (index, name) in row {
                x += LABEL;
                sample(picture, [[x, y], [x + SAMPLE - 8.0, y]], *index);
                x += SAMPLE;
                picture.text(name, [x, y], look(TICK, Anchor::Left));
                x += text_width(name, TICK);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_fill_rows_without_leaving_the_picture() {
        let legend = Legend::new((0..20).map(|i| format!("isotherm {i}")), 700.0);
        assert!(legend.len() > 2 && legend.width() <= 700.0);
        let numbers = legend.rows.iter().flatten().map(|(index, _)| *index);
        assert!(numbers.eq(0..20));
        // one name has a row of its own, however wide it is
        assert_eq!(Legend::new(["long".into(), "names".into()], 1.0).len(), 2);
        assert_eq!(Legend::new([], 1.0).len(), 0);
    }

    #[test]
    fn long_titles_are_cut_off() {
        let long = "Weld of a plate ".repeat(30);
        let short = shortened(&long, TITLE, 500.0);
        assert!(short.ends_with('…') && text_width(&short, TITLE) <= 500.0);
        assert_eq!(shortened("Weld", TITLE, 500.0), "Weld");
    }
}
