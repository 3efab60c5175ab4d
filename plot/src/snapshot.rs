//! A field of a body at one time, as coloured points.

use crate::axes::{ChartAxis, ChartFrame, LABEL, TICK};
use crate::colour::{BLACK, Colour, GREY, ISOTHERMS, WHITE};
use crate::contour::{cell_values, contour};
use crate::heading::{Legend, ROW, draw_heading, heading_height};
use crate::layout::{LEFT, ViewPanel, height_of, panels, stack};
use crate::picture::{Anchor, Picture, TextLook, look, text_width};
use crate::scale::ColourScale;
use crate::section::{AXES, Cut, View};
use crate::smooth::visit_pieces;

const BOTTOM: f64 = 72.0;
const CAPTION: f64 = 20.0;
/// Room at the right of the names of the isotherms.
const RIGHT: f64 = 30.0;
/// Distance of the letter of a section from the frame.
const LETTER: f64 = 14.0;
/// Overlap of neighbouring cells, pixels: between edges that are smoothed, white would shine through.
const OVERLAP: f64 = 0.4;

/// A line of constant value.
#[derive(Clone, Debug, PartialEq)]
pub struct Isoline {
    /// how it is named
    pub name: String,
    /// the value
    pub value: f64,
}

/// Contents of a picture.
#[derive(Clone, Debug)]
pub struct Snapshot<'a> {
    /// title of the case, may be empty
    pub case: &'a str,
    /// title of the picture
    pub title: String,
    /// from above to below
    pub views: &'a [View],
    /// colours of the values
    pub scale: ColourScale,
    /// the axis beside the colours, with the numbers that are shown for the ends of the scale
    pub bar: ChartAxis,
    /// lines of these values
    pub isolines: Vec<Isoline>,
    /// names lines that are absent, too, so that all pictures of a film have one size
    pub name_all: bool,
    /// displacements (m) of the points, already exaggerated
    pub displacement: Option<&'a [[f64; 3]]>,
    /// lower and upper corner of a box that is shown in any case, m
    pub extent: Option<[[f64; 3]; 2]>,
    /// colours between points instead of one for each
    pub smooth: bool,
    /// the unit that suits lengths of a size (m): its number for one metre, and its name
    pub length_unit: fn(f64) -> (f64, &'static str),
}

/// An isoline in a picture.
struct DrawnIsoline<'a> {
    name: &'a str,
    colour: Colour,
    /// lines in each view, m
    lines: Vec<Vec<Vec<[f64; 2]>>>,
}

impl Snapshot<'_> {
    /// The snapshot as a picture of this width.
    pub fn draw(&self, width: u32) -> Picture {
        let bounds: Vec<_> = self
            .views
            .iter()
            .map(|view| (self.bounds(view), view.axes))
            .collect();
        let mut panels = panels(&bounds, f64::from(width));
        let has_captions = panels.len() > 1 || panels.iter().any(|panel| panel.stretch > 1.0);
        let above = match has_captions {
            true => CAPTION + self.caption_lift(&panels[0]),
            false => 0.0,
        };
        let isolines = self.drawn_isolines();
        let room = f64::from(width) - LEFT - RIGHT;
        let legend = Legend::new(isolines.iter().map(|line| line.name.to_owned()), room);
        // the names stand beside the title if there is room
        let title_width = text_width(&self.title, LABEL) + 2.0 * LABEL;
        let beside = match legend.len() {
            0 => true,
            1 => !self.case.is_empty() && title_width + legend.width() <= room,
            _ => false,
        };
        let (lift, legend_height) = match beside {
            true => (35.0, 0.0),
            false => (14.0, ROW * legend.len() as f64),
        };
        let heading = heading_height(self.case);
        let top = heading + legend_height + above;
        let heights = height_of(&panels);
        // minimum height of a colour bar
        let inner = heights.max(190.0);
        let mut picture = Picture::new(width, (top + inner + BOTTOM).ceil() as u32);
        draw_heading(&mut picture, LEFT, self.case, &self.title);
        let corner = [f64::from(width) - RIGHT, heading - lift];
        legend.draw(&mut picture, corner, |picture, line, entry| {
            draw_isoline(picture, line.into(), isolines[entry].colour);
        });
        stack(&mut panels, top + 0.5 * (inner - heights));
        for (number, panel) in panels.iter().enumerate() {
            self.draw_view(&mut picture, number, panel, &isolines);
            if has_captions {
                let lift = if number == 0 { above - CAPTION } else { 0.0 };
                let text = panel.caption(&self.views[number].caption);
                let at = [LEFT, panel.top - 16.0 - lift];
                picture.text(text, at, look(TICK, Anchor::Left));
            }
        }
        let widest = panels.iter().map(|panel| panel.size[0]).fold(0.0, f64::max);
        self.draw_colour_bar(&mut picture, LEFT + widest + 28.0, [top, top + inner]);
        picture
    }

    /// Lift of the caption of the first view, so that no letter of a section covers it, pixels.
    fn caption_lift(&self, panel: &ViewPanel) -> f64 {
        let view = &self.views[0];
        let end = text_width(&panel.caption(&view.caption), TICK) + LETTER;
        let [[from, _], [to, _]] = panel.bounds;
        let is_within = |cut: Cut| {
            cut.axis == view.axes[0] && (cut.at - from) / (to - from) * panel.size[0] < end
        };
        let mut cuts = self.views.iter().filter_map(|view| view.cut);
        if cuts.any(|(cut, _)| is_within(cut)) {
            CAPTION
        } else {
            0.0
        }
    }

    /// A view with its axes, isolines, and the planes of the sections.
    fn draw_view(
        &self,
        picture: &mut Picture,
        number: usize,
        panel: &ViewPanel,
        isolines: &[DrawnIsoline<'_>],
    ) {
        let view = &self.views[number];
        let [low, high] = panel.bounds;
        let (factor, unit) = (self.length_unit)(high[0] - low[0]);
        let axis = |side: usize| {
            let label = format!("{} ({unit})", AXES[view.axes[side]]);
            ChartAxis::linear(low[side] * factor, high[side] * factor, label)
        };
        let [wide, tall] = panel.size;
        let frame = ChartFrame {
            edges: [LEFT, panel.top, LEFT + wide, panel.top + tall],
            horizontal: axis(0),
            vertical: axis(1),
        };
        let place = |p: [f64; 2]| frame.place(p.map(|x| x * factor));
        if self.smooth {
            self.draw_smooth(picture, view, place);
        } else {
            self.draw_points(picture, view, place);
        }
        for isoline in isolines {
            for line in &isoline.lines[number] {
                let line = line.iter().copied().map(place).collect();
                draw_isoline(picture, line, isoline.colour);
            }
        }
        if view.cut.is_none() {
            for (cut, letter) in self.views.iter().filter_map(|view| view.cut) {
                draw_cut(picture, &frame, cut.axis, place([cut.at; 2]), letter);
            }
        }
        frame.draw(picture, true);
    }

    /// The isolines that are named; a deformed body has none.
    fn drawn_isolines(&self) -> Vec<DrawnIsoline<'_>> {
        let isolines = self.isolines.iter().zip(ISOTHERMS.into_iter().cycle());
        let drawn = isolines.map(|(isoline, colour)| {
            let lines = |view: &View| match self.displacement {
                Some(_) => Vec::new(),
                None => contour(&view.raster, isoline.value),
            };
            DrawnIsoline {
                name: &isoline.name,
                colour,
                lines: self.views.iter().map(lines).collect(),
            }
        });
        let is_there = |isoline: &DrawnIsoline| isoline.lines.iter().any(|line| !line.is_empty());
        drawn
            .filter(|line| self.name_all || is_there(line))
            .collect()
    }

    /// Lower left and upper right corner of what the view shows, m.
    fn bounds(&self, view: &View) -> [[f64; 2]; 2] {
        let raster = &view.raster;
        let half = 0.5 * raster.spacing;
        let last = raster.centre(raster.cells.map(|n| n - 1));
        let mut bounds = [raster.origin.map(|x| x - half), last.map(|x| x + half)];
        let mut extend = |point: [f64; 2]| {
            for side in 0..2 {
                bounds[0][side] = bounds[0][side].min(point[side]);
                bounds[1][side] = bounds[1][side].max(point[side]);
            }
        };
        for corner in self.extent.iter().flatten() {
            extend(view.axes.map(|axis| corner[axis]));
        }
        if self.displacement.is_some() {
            self.visit_cells(view, |_, corners, _| {
                corners.into_iter().for_each(&mut extend)
            });
        }
        bounds
    }

    /// Indices, corners (m) and value of every cell with a point. A corner moves by the mean displacement
    /// of the points around it, so that a stretched body stays closed.
    fn visit_cells(&self, view: &View, mut visit: impl FnMut([usize; 2], [[f64; 2]; 4], f64)) {
        let raster = &view.raster;
        let [nx, ny] = raster.cells;
        let half = 0.5 * raster.spacing;
        let point = |[i, j]: [usize; 2]| match i < nx && j < ny {
            true => raster.points[j * nx + i],
            false => None,
        };
        let moved = |i: usize, j: usize| {
            let Some(displacement) = self.displacement else {
                return [0.0; 2];
            };
            let around = [[1, 1], [0, 1], [1, 0], [0, 0]].into_iter();
            let around = around.map(|[left, down]| [i.wrapping_sub(left), j.wrapping_sub(down)]);
            let moved = around
                .filter_map(point)
                .map(|point| view.axes.map(|axis| displacement[point][axis]))
                .filter(|moved| moved.iter().all(|x| x.is_finite()));
            let (sum, count) = moved.fold(([0.0; 2], 0.0_f64), |(sum, count), moved| {
                ([sum[0] + moved[0], sum[1] + moved[1]], count + 1.0)
            });
            sum.map(|sum| sum / count.max(1.0))
        };
        for [i, j] in (0..ny).flat_map(|j| (0..nx).map(move |i| [i, j])) {
            if point([i, j]).is_some() {
                let [x, y] = raster.centre([i, j]);
                let corner = |right: usize, up: usize| {
                    let [u, v] = moved(i + right, j + up);
                    let side = |index: usize| (2.0 * index as f64 - 1.0) * half;
                    [x + side(right) + u, y + side(up) + v]
                };
                let corners = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
                visit([i, j], corners, raster.value([i, j]));
            }
        }
    }

    /// Draws a part of a view with these corners (pixels).
    fn paint(&self, picture: &mut Picture, corners: [[f64; 2]; 4], colour: Colour) {
        if self.displacement.is_some() {
            picture.area(widened(corners), colour);
        } else {
            let [[left, bottom], _, [right, top], _] = corners;
            picture.rectangle([[left, bottom], [right + OVERLAP, top - OVERLAP]], colour);
        }
    }

    fn draw_points(
        &self,
        picture: &mut Picture,
        view: &View,
        place: impl Fn([f64; 2]) -> [f64; 2],
    ) {
        let mut run: Option<([[f64; 2]; 4], Colour)> = None;
        let mut finished = Vec::new();
        self.visit_cells(view, |_, corners, value| {
            let colour = self.scale.colour(value);
            let close = |a: f64, b: f64| (a - b).abs() < 0.1 * view.raster.spacing;
            match &mut run {
                // neighbours of one colour in one rectangle: a tenth of the marks
                Some(([from, _, to, _], same))
                    if *same == colour
                        && self.displacement.is_none()
                        && close(to[0], corners[0][0])
                        && close(from[1], corners[0][1]) =>
                {
                    *to = corners[2];
                }
                _ => finished.extend(run.replace((corners, colour))),
            }
        });
        finished.extend(run);
        for (corners, colour) in finished {
            self.paint(picture, corners.map(&place), colour);
        }
    }

    fn draw_smooth(
        &self,
        picture: &mut Picture,
        view: &View,
        place: impl Fn([f64; 2]) -> [f64; 2],
    ) {
        self.visit_cells(view, |cell, corners, _| {
            let corners = corners.map(&place);
            match cell_values(&view.raster, cell) {
                None => self.paint(picture, corners, GREY),
                Some(values) => {
                    let colour = |value| self.scale.colour(value);
                    visit_pieces(corners, values, colour, |piece, colour| {
                        self.paint(picture, piece, colour);
                    });
                }
            }
        });
    }

    fn draw_colour_bar(&self, picture: &mut Picture, left: f64, [top, bottom]: [f64; 2]) {
        const STEPS: i32 = 256;
        let right = left + 22.0;
        let height = |fraction: f64| bottom - fraction * (bottom - top);
        for step in 0..STEPS {
            let fraction = |step: i32| f64::from(step) / f64::from(STEPS);
            let middle = fraction(step) + 0.5 / f64::from(STEPS);
            let upper = (height(fraction(step + 1)) - OVERLAP).max(top);
            let corners = [[left, upper], [right, height(fraction(step))]];
            picture.rectangle(corners, self.scale.map.colour(middle));
        }
        picture.outline([left, top, right, bottom], GREY);
        for (tick, text) in self.bar.ticks(((bottom - top) / 60.0).max(2.0)) {
            let y = height(self.bar.fraction(tick));
            picture.line([[right, y], [right + 6.0, y]], 1.0, GREY);
            picture.text(text, [right + 10.0, y], look(TICK, Anchor::Left));
        }
        let upright = TextLook {
            upright: true,
            ..look(LABEL, Anchor::Middle)
        };
        let at = [right + 84.0, 0.5 * (top + bottom)];
        picture.text(&self.bar.label, at, upright);
    }
}

/// The corners of a cell, moved away from its middle by the overlap.
fn widened(corners: [[f64; 2]; 4]) -> [[f64; 2]; 4] {
    let middle = |axis: usize| corners.iter().map(|corner| corner[axis]).sum::<f64>() / 4.0;
    let middle = [middle(0), middle(1)];
    corners.map(|corner| {
        let away = [corner[0] - middle[0], corner[1] - middle[1]];
        let distance = away[0].hypot(away[1]);
        if distance > 0.0 && distance.is_finite() {
            [0, 1].map(|axis| corner[axis] + OVERLAP * away[axis] / distance)
        } else {
            corner
        }
    })
}

/// A bright line with a dark seam, visible on any colour.
fn draw_isoline(picture: &mut Picture, line: Vec<[f64; 2]>, colour: Colour) {
    picture.line(line.clone(), 4.4, BLACK);
    picture.line(line, 2.2, colour);
}

/// Marks the plane of a section across an axis in the view from above: a line with black and white dashes, visible on any
/// colour, and the letter of the section at its end.
fn draw_cut(
    picture: &mut Picture,
    frame: &ChartFrame,
    axis: usize,
    [x, y]: [f64; 2],
    letter: char,
) {
    let [left, top, right, bottom] = frame.edges;
    let (start, end, text) = match axis {
        0 => ([x, top], [x, bottom], [x, top - LETTER]),
        1 => ([left, y], [right, y], [right + LETTER, y]),
        _ => return,
    };
    picture.line([start, end], 1.8, WHITE);
    picture.dashes([start, end], [12.0, 24.0], 1.8, BLACK);
    picture.text(letter.to_string(), text, look(TICK, Anchor::Middle));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::colour::ColourMap;
    use crate::section::Raster;

    /// A warm plate of 2 m from above, with sections across x at these places.
    fn drawn(cuts: &[f64], name_all: bool, displacement: Option<&[[f64; 3]]>) -> String {
        let view = |cut: Option<f64>| View {
            axes: [0, if cut.is_some() { 2 } else { 1 }],
            caption: if cut.is_some() { "section" } else { "above" }.into(),
            cut: cut.map(|at| (Cut { axis: 0, at }, 'A')),
            raster: Raster::of(20, |[x, y]| 1000.0 - 500.0 * x.hypot(y)),
        };
        let sections = cuts.iter().map(|at| view(Some(*at)));
        let views: Vec<View> = [view(None)].into_iter().chain(sections).collect();
        let snapshot = Snapshot {
            case: "case",
            title: "plate".into(),
            views: &views,
            scale: ColourScale::of(ColourMap::Inferno, &[300.0, 1000.0]),
            bar: ChartAxis::linear(300.0, 1000.0, "temperature (K)"),
            isolines: [600.0, 2000.0].map(isoline).into(),
            name_all,
            displacement,
            extent: None,
            smooth: false,
            length_unit: |_| (1e3, "mm"),
        };
        snapshot.draw(600).svg().expect("drawn")
    }

    fn isoline(value: f64) -> Isoline {
        Isoline {
            name: format!("T = {value}"),
            value,
        }
    }

    /// Place of a text that begins so, in pixels as they are drawn.
    fn place_of(svg: &str, text: &str) -> [f64; 2] {
        let (before, _) = svg.split_once(&format!(">\n{text}")).expect(text);
        let (_, tag) = before.rsplit_once("<text").expect("a tag");
        ["x", "y"].map(|name| {
            let (_, value) = tag.split_once(&format!(" {name}=\"")).expect(name);
            let (value, _) = value.split_once('"').expect("a value");
            value.parse().expect("a number")
        })
    }

    #[test]
    fn the_letter_of_a_section_does_not_cover_the_caption() {
        let height = |at: f64| {
            let svg = drawn(&[at], false, None);
            let [caption, letter] = ["above", "A\n"].map(|text| place_of(&svg, text));
            letter[1] - caption[1]
        };
        // drawn three times as large
        assert!(height(-0.9) > 3.0 * 16.0);
        assert!(height(0.5).abs() < 3.0 * 4.0);
    }

    #[test]
    fn axes_and_colours_are_labelled_in_the_given_units() {
        let svg = drawn(&[0.0], false, None);
        for label in [
            "x (mm)",
            "y (mm)",
            "z (mm)",
            "temperature (K)",
            "−500",
            "section",
        ] {
            assert!(svg.contains(label), "{label}");
        }
    }

    #[test]
    fn lines_that_are_absent_are_named_in_films_only() {
        let [picture, film] = [false, true].map(|all| drawn(&[], all, None));
        assert!(picture.contains("T = 600") && !picture.contains("T = 2000"));
        assert!(film.contains("T = 600") && film.contains("T = 2000"));
    }

    #[test]
    fn a_displaced_body_is_shown_completely_and_without_lines() {
        let moved: Vec<[f64; 3]> = (0..400).map(|_| [5.0, 0.0, 0.0]).collect();
        let svg = drawn(&[], false, Some(&moved));
        assert!(svg.contains("5000") && !svg.contains("T = 600"));
        // each cell with its own corners
        assert_eq!(svg.matches("<polygon").count(), 400);
        let large = widened([[0.0, 0.0], [3.0, 0.0], [3.0, 4.0], [0.0, 4.0]]);
        assert_eq!(large[2], [3.0 + 0.6 * OVERLAP, 4.0 + 0.8 * OVERLAP]);
    }
}
