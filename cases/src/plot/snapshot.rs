//! A field of a body at one time, as coloured points.

use super::{
    args::Cut,
    axes::{ChartAxis, ChartFrame, LABEL, TICK, look},
    colour::{BLACK, Colour, GREY, ISOTHERMS, WHITE},
    contour::{contour, joined},
    heading::{ROW, draw_heading, draw_rows, heading_height, row_width, rows},
    layout::{ViewPanel, panels},
    picture::{Anchor, Picture},
    scale::ColourScale,
    section::View,
};
use crate::quantity::isotherm::Isotherm;
use crate::unit::{self, Shown};

pub(super) const LEFT: f64 = 125.0;
pub(super) const RIGHT: f64 = 165.0;
const BOTTOM: f64 = 72.0;
pub(super) const GAP: f64 = 112.0;
const CAPTION: f64 = 20.0;
/// Distance of the letter of a section from the frame.
const LETTER: f64 = 14.0;

/// Contents of a picture.
#[derive(Clone, Debug)]
pub(crate) struct Snapshot<'a> {
    /// title of the case, may be empty
    pub case: &'a str,
    pub title: String,
    pub views: &'a [View],
    /// name of the values
    pub label: &'a str,
    /// how values are shown
    pub shown: Shown,
    pub scale: ColourScale,
    /// lines of these values
    pub isotherms: &'a [Isotherm],
    /// names isotherms that are absent, too, so that all pictures of a film have one size
    pub name_all: bool,
    /// displacements (m) of the points, already exaggerated
    pub displacement: Option<&'a [[f64; 3]]>,
    /// lower and upper corner of a box that is shown in any case, m
    pub extent: Option<[[f64; 3]; 2]>,
    /// colours between points instead of one for each
    pub smooth: bool,
}

/// Lines of one isotherm in each of the views, m.
type IsothermLines = Vec<Vec<Vec<[f64; 2]>>>;

impl Snapshot<'_> {
    /// The snapshot as a picture of this width.
    pub(crate) fn draw(&self, width: u32) -> Picture {
        let bounds: Vec<[[f64; 2]; 2]> = self.views.iter().map(|view| self.bounds(view)).collect();
        let axes: Vec<[usize; 2]> = self.views.iter().map(|view| view.axes).collect();
        let mut panels = panels(&bounds, &axes, f64::from(width));
        let has_captions = panels.len() > 1 || panels.iter().any(|panel| panel.stretch > 1.0);
        let above = match has_captions {
            true => CAPTION + self.caption_lift(&panels[0]),
            false => 0.0,
        };

        let isotherms: Vec<(usize, IsothermLines)> = (0..self.isotherms.len())
            .map(|index| (index, self.isotherm_lines(index)))
            .filter(|(_, lines)| self.name_all || lines.iter().any(|line| !line.is_empty()))
            .collect();
        let names: Vec<String> = isotherms
            .iter()
            .map(|(index, _)| self.name(&self.isotherms[*index]))
            .collect();
        let room = f64::from(width) - LEFT - 30.0;
        let legend = rows(&names, room);
        // the names stand beside the title if there is room
        let title_width = super::picture::text_width(&self.title, LABEL) + 2.0 * LABEL;
        let beside = match &legend[..] {
            [] => true,
            [row] => !self.case.is_empty() && title_width + row_width(&names, row) <= room,
            _ => false,
        };
        let legend_height = if beside {
            0.0
        } else {
            ROW * legend.len() as f64
        };
        let top = heading_height(self.case) + legend_height + above;

        let heights = panels.iter().map(|panel| panel.size[1]).sum::<f64>()
            + (panels.len() as f64 - 1.0) * GAP;
        // minimum height of a colour bar
        let inner = heights.max(190.0);
        let mut picture = Picture::new(width, (top + inner + BOTTOM).ceil() as u32);
        draw_heading(&mut picture, LEFT, self.case, &self.title);
        let legend_y = heading_height(self.case) - if beside { 35.0 } else { 14.0 };
        let sample = |picture: &mut Picture, line: Vec<[f64; 2]>, entry: usize| {
            draw_isotherm(picture, line, isotherms[entry].0);
        };
        let corner = [f64::from(width) - 30.0, legend_y];
        draw_rows(&mut picture, &names, &legend, corner, sample);

        let mut below = top + 0.5 * (inner - heights);
        for panel in &mut panels {
            panel.corner = [LEFT, below];
            below += panel.size[1] + GAP;
        }
        for (number, panel) in panels.iter().enumerate() {
            let view = &self.views[number];
            let lines = isotherms
                .iter()
                .map(|(index, lines)| (*index, &lines[number][..]));
            let lines: Vec<_> = lines.collect();
            self.draw_view(&mut picture, view, panel, &lines);
            if has_captions {
                let [left, top] = panel.corner;
                let text = panel.caption(&view.caption);
                let lift = if number == 0 { above - CAPTION } else { 0.0 };
                let at = [left, top - 16.0 - lift];
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
        let text = panel.caption(&view.caption);
        let end = super::picture::text_width(&text, TICK) + LETTER;
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

    /// A view with its axes, isotherms by number, and the planes of the sections.
    fn draw_view(
        &self,
        picture: &mut Picture,
        view: &View,
        panel: &ViewPanel,
        isotherms: &[(usize, &[Vec<[f64; 2]>])],
    ) {
        let [[_, _], [high, _]] = panel.bounds;
        let lengths = unit::length(high - panel.bounds[0][0]);
        let axis = |side: usize| {
            let label = unit::label(super::args::AXES[view.axes[side]], lengths.unit);
            let (from, to) = (panel.bounds[0][side], panel.bounds[1][side]);
            ChartAxis::linear(from * lengths.factor, to * lengths.factor, label)
        };
        let [left, top] = panel.corner;
        let frame = ChartFrame {
            edges: [left, top, left + panel.size[0], top + panel.size[1]],
            horizontal: axis(0),
            vertical: axis(1),
        };
        let place = |p: [f64; 2]| frame.place(p[0] * lengths.factor, p[1] * lengths.factor);
        if self.smooth {
            self.draw_smooth(picture, view, place);
        } else {
            self.draw_points(picture, view, place);
        }
        for (index, lines) in isotherms {
            for line in *lines {
                draw_isotherm(picture, line.iter().copied().map(place).collect(), *index);
            }
        }
        if view.cut.is_none() {
            for (cut, letter) in self.views.iter().filter_map(|view| view.cut) {
                draw_cut(picture, &frame, cut, letter, lengths.factor);
            }
        }
        frame.draw(picture, true);
    }

    /// Lines of an isotherm in each view; a deformed body has none.
    fn isotherm_lines(&self, index: usize) -> IsothermLines {
        let lines = |view: &View| match self.displacement {
            Some(_) => Vec::new(),
            None => joined(&contour(&view.raster, self.isotherms[index].temperature)),
        };
        self.views.iter().map(lines).collect()
    }

    fn name(&self, isotherm: &Isotherm) -> String {
        let value = unit::signed_number(self.shown.of(isotherm.temperature), 5);
        format!("{} {value} {}", isotherm.name, self.shown.unit)
            .trim()
            .to_owned()
    }

    /// Lower left and upper right corner of what the view shows, m.
    fn bounds(&self, view: &View) -> [[f64; 2]; 2] {
        let raster = &view.raster;
        let half = 0.5 * raster.spacing;
        let last = raster.centre(raster.cells.map(|n| n - 1));
        let mut bounds = [raster.origin.map(|x| x - half), last.map(|x| x + half)];
        if let Some(extent) = self.extent {
            for side in 0..2 {
                let [low, high] = extent.map(|corner| corner[view.axes[side]]);
                bounds[0][side] = bounds[0][side].min(low);
                bounds[1][side] = bounds[1][side].max(high);
            }
        }
        if self.displacement.is_some() {
            self.visit_cells(view, |corners, _| {
                for corner in corners {
                    for side in 0..2 {
                        bounds[0][side] = bounds[0][side].min(corner[side]);
                        bounds[1][side] = bounds[1][side].max(corner[side]);
                    }
                }
            });
        }
        bounds
    }

    /// Corners (m) and value of every cell with a point. A corner moves by the mean displacement
    /// of the points around it, so that a stretched body stays closed.
    fn visit_cells(&self, view: &View, mut visit: impl FnMut([[f64; 2]; 4], f64)) {
        self.visit_places(view, |_, corners, value| visit(corners, value));
    }

    /// [`Self::visit_cells`] with the indices of the cell in the raster.
    pub(super) fn visit_places(
        &self,
        view: &View,
        mut visit: impl FnMut([usize; 2], [[f64; 2]; 4], f64),
    ) {
        let raster = &view.raster;
        let [nx, ny] = raster.cells;
        let half = 0.5 * raster.spacing;
        let point = |i: usize, j: usize| {
            if i < nx && j < ny {
                raster.points[j * nx + i]
            } else {
                None
            }
        };
        let moved = |i: usize, j: usize| {
            let mut sum = [0.0; 2];
            let mut count = 0.0_f64;
            let Some(displacement) = self.displacement else {
                return sum;
            };
            for (i, j) in [
                (i.wrapping_sub(1), j.wrapping_sub(1)),
                (i, j.wrapping_sub(1)),
                (i.wrapping_sub(1), j),
                (i, j),
            ] {
                let Some(point) = point(i, j) else { continue };
                let moved = view.axes.map(|axis| displacement[point][axis]);
                if moved.iter().all(|x| x.is_finite()) {
                    sum = [sum[0] + moved[0], sum[1] + moved[1]];
                    count += 1.0;
                }
            }
            sum.map(|sum| sum / count.max(1.0))
        };
        for j in 0..ny {
            for i in 0..nx {
                if point(i, j).is_none() {
                    continue;
                }
                let [x, y] = raster.centre([i, j]);
                let corner = |right: usize, up: usize| {
                    let [u, v] = moved(i + right, j + up);
                    let side = |index: usize| (2.0 * index as f64 - 1.0) * half;
                    [x + side(right) + u, y + side(up) + v]
                };
                let corners = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
                visit([i, j], corners, raster.value(i, j));
            }
        }
    }

    fn draw_points(
        &self,
        picture: &mut Picture,
        view: &View,
        place: impl Fn([f64; 2]) -> [f64; 2],
    ) {
        // neighbours of one colour in one rectangle: a tenth of the marks
        let mut run: Option<([[f64; 2]; 2], Colour)> = None;
        let mut finished = Vec::new();
        self.visit_cells(view, |corners, value| {
            let colour = if value.is_finite() {
                self.scale.colour(value)
            } else {
                GREY
            };
            if self.displacement.is_some() {
                picture.area(widened(corners.map(&place)).into(), colour);
                return;
            }
            let close = |a: f64, b: f64| (a - b).abs() < 0.1 * view.raster.spacing;
            match &mut run {
                Some(([from, to], same))
                    if *same == colour
                        && close(to[0], corners[0][0])
                        && close(from[1], corners[0][1]) =>
                {
                    *to = corners[2];
                }
                _ => finished.extend(run.replace(([corners[0], corners[2]], colour))),
            }
        });
        finished.extend(run);
        for (corners, colour) in finished {
            let [[left, bottom], [right, top]] = corners.map(&place);
            // neighbours overlap: between edges that are smoothed, white would shine through
            let corners = [[left, bottom], [right + OVERLAP, top - OVERLAP]];
            picture.rectangle(corners, colour);
        }
    }

    fn draw_colour_bar(&self, picture: &mut Picture, left: f64, [top, bottom]: [f64; 2]) {
        let right = left + 22.0;
        let steps = 256;
        for step in 0..steps {
            let fraction = |step: i32| f64::from(step) / f64::from(steps);
            let height = |fraction: f64| bottom - fraction * (bottom - top);
            let colour = self
                .scale
                .map
                .colour(fraction(step) + 0.5 / f64::from(steps));
            let upper = (height(fraction(step + 1)) - OVERLAP).max(top);
            let corners = [[left, upper], [right, height(fraction(step))]];
            picture.rectangle(corners, colour);
        }
        let axis = ChartAxis::linear(
            self.shown.of(self.scale.from),
            self.shown.of(self.scale.to),
            "",
        );
        let outline = vec![
            [left, top],
            [right, top],
            [right, bottom],
            [left, bottom],
            [left, top],
        ];
        picture.line(outline, 1.0, GREY);
        for (tick, text) in axis.ticks(((bottom - top) / 60.0).max(2.0)) {
            let y = bottom - axis.fraction(tick) * (bottom - top);
            picture.line(vec![[right, y], [right + 6.0, y]], 1.0, GREY);
            picture.text(text, [right + 10.0, y], look(TICK, Anchor::Left));
        }
        let middle = 0.5 * (top + bottom);
        picture.upright_text(
            unit::label(self.label, &self.shown.unit),
            [right + 84.0, middle],
            look(LABEL, Anchor::Middle),
        );
    }
}

/// Overlap of neighbouring cells, pixels.
pub(super) const OVERLAP: f64 = 0.4;

/// The corners of a cell, moved away from its middle by the overlap.
pub(super) fn widened(corners: [[f64; 2]; 4]) -> [[f64; 2]; 4] {
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
fn draw_isotherm(picture: &mut Picture, line: Vec<[f64; 2]>, index: usize) {
    picture.line(line.clone(), 4.4, BLACK);
    picture.line(line, 2.2, ISOTHERMS[index % ISOTHERMS.len()]);
}

/// Marks the plane of a section in the view from above: a line with black and white dashes, visible on any
/// colour, and the letter of the section at its end.
fn draw_cut(picture: &mut Picture, frame: &ChartFrame, cut: Cut, letter: char, factor: f64) {
    const DASH: f64 = 12.0;
    const PAUSE: f64 = 12.0;
    let [left, top, right, bottom] = frame.edges;
    let at = cut.at * factor;
    let (start, end, text) = match cut.axis {
        0 => {
            let [x, _] = frame.place(at, frame.vertical.from);
            ([x, top], [x, bottom], [x, top - LETTER])
        }
        1 => {
            let [_, y] = frame.place(frame.horizontal.from, at);
            ([left, y], [right, y], [right + LETTER, y])
        }
        _ => return,
    };
    let length = (end[0] - start[0]).hypot(end[1] - start[1]);
    let along = |distance: f64| {
        let fraction = (distance / length).min(1.0);
        [0, 1].map(|axis| start[axis] + fraction * (end[axis] - start[axis]))
    };
    let dashes = (length / (DASH + PAUSE)).ceil() as usize;
    picture.line(vec![start, end], 1.8, WHITE);
    for dash in 0..dashes {
        let from = dash as f64 * (DASH + PAUSE);
        picture.line(vec![along(from), along(from + DASH)], 1.8, BLACK);
    }
    picture.text(letter.to_string(), text, look(TICK, Anchor::Middle));
}
