//! Title of the case, title of the picture, and names of lines in rows.

use super::{
    axes::{LABEL, TICK, TITLE, look},
    picture::{Anchor, Picture, TextLook, text_width},
};

/// Height of a title without that of the case, pixels.
const TITLE_HEIGHT: f64 = 64.0;
/// Height of the title of the case.
const CASE_HEIGHT: f64 = 30.0;
/// Height of a row of names.
pub(super) const ROW: f64 = 26.0;
/// Length of the piece of a line beside its name.
const SAMPLE: f64 = 36.0;

/// Height of the titles, pixels.
pub(super) fn heading_height(case: &str) -> f64 {
    TITLE_HEIGHT + if case.is_empty() { 0.0 } else { CASE_HEIGHT }
}

/// Draws the title of the case above that of the picture.
pub(super) fn draw_heading(picture: &mut Picture, left: f64, case: &str, title: &str) {
    let bold = TextLook {
        bold: true,
        ..look(TITLE, Anchor::Left)
    };
    let room = picture.width() - left - 20.0;
    if case.is_empty() {
        picture.text(
            shortened(title, TITLE, room),
            [left, 0.45 * TITLE_HEIGHT],
            bold,
        );
        return;
    }
    picture.text(
        shortened(case, TITLE, room),
        [left, 0.45 * TITLE_HEIGHT],
        bold,
    );
    let y = 0.45 * TITLE_HEIGHT + CASE_HEIGHT;
    picture.text(
        shortened(title, LABEL, room),
        [left, y],
        look(LABEL, Anchor::Left),
    );
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

/// Numbers of the names in each row, so that no row is wider than the room.
pub(super) fn rows(names: &[String], room: f64) -> Vec<Vec<usize>> {
    let mut rows: Vec<Vec<usize>> = Vec::new();
    let mut used = f64::INFINITY;
    for (index, name) in names.iter().enumerate() {
        let width = width_of(name);
        match rows.last_mut() {
            Some(row) if used + width <= room => {
                row.push(index);
                used += width;
            }
            _ => {
                rows.push(vec![index]);
                used = width;
            }
        }
    }
    rows
}

/// Width of a row of names, pixels.
pub(super) fn row_width(names: &[String], row: &[usize]) -> f64 {
    row.iter().map(|&index| width_of(&names[index])).sum()
}

fn width_of(name: &str) -> f64 {
    text_width(name, TICK) + SAMPLE + LABEL
}

/// Draws rows of names that end at `right`, the first one at the height `y`; `sample` draws a piece of line number `index`.
pub(super) fn draw_rows(
    picture: &mut Picture,
    names: &[String],
    rows: &[Vec<usize>],
    [right, y]: [f64; 2],
    sample: impl Fn(&mut Picture, Vec<[f64; 2]>, usize),
) {
    for (number, row) in rows.iter().enumerate() {
        let y = y + number as f64 * ROW;
        let mut x = right - row_width(names, row);
        for &index in row {
            x += LABEL;
            sample(picture, vec![[x, y], [x + SAMPLE - 8.0, y]], index);
            x += SAMPLE;
            picture.text(&names[index], [x, y], look(TICK, Anchor::Left));
            x += text_width(&names[index], TICK);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_fill_rows_without_leaving_the_picture() {
        let names: Vec<String> = (0..20).map(|i| format!("isotherm {i}")).collect();
        let rows = rows(&names, 700.0);
        assert!(rows.len() > 2);
        assert_eq!(rows.concat(), (0..20).collect::<Vec<_>>());
        assert!(rows.iter().all(|row| row_width(&names, row) <= 700.0));
    }

    #[test]
    fn long_titles_are_cut_off() {
        let long = "Weld of a plate ".repeat(30);
        let short = shortened(&long, TITLE, 500.0);
        assert!(short.ends_with('…') && text_width(&short, TITLE) <= 500.0);
        assert_eq!(shortened("Weld", TITLE, 500.0), "Weld");
    }
}
