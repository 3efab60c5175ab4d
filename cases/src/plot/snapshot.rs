//! A field of a body at one time, as coloured points.

use super::{
    axes::{ChartAxis, Frame, LABEL, TICK, TITLE, look},
    colour::{BLACK, Colour, ColourMap, GREY, WHITE},
    contour::{contour, joined},
    isotherm::Isotherm,
    picture::{Anchor, Picture, TextLook, text_width},
    section::View,
    unit,
};

const LEFT: f64 = 125.0;
const RIGHT: f64 = 165.0;
const TOP: f64 = 64.0;
const BOTTOM: f64 = 72.0;
const GAP: f64 = 112.0;
const CAPTION: f64 = 20.0;
/// panels together are at most this many times as high as the picture is wide
const MAX_HEIGHT: f64 = 0.75;
const ISOTHERM_COLOURS: [Colour; 3] = [WHITE, (110, 225, 255), (150, 255, 150)];

/// Contents of a picture.
#[derive(Clone, Debug)]
pub(crate) struct Snapshot<'a> {
    pub title: String,
    pub views: &'a [View],
    /// name of the values with their unit as shown
    pub label: String,
    /// values times this are shown
    pub factor: f64,
    pub scale: ColourScale,
    /// lines of these values
    pub isotherms: &'a [Isotherm],
    /// displacements (m) of the points, already exaggerated
    pub displacement: Option<&'a [[f64; 3]]>,
}

/// Values by colour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ColourScale {
    pub map: ColourMap,
    pub from: f64,
    pub to: f64,
}

impl ColourScale {
    /// The scale for values between `from` and `to`; symmetric if they have both signs.
    pub(crate) fn new(name: &str, from: f64, to: f64) -> Self {
        let size = from.abs().max(to.abs());
        if from < 0.0 && to > 0.0 && from.abs().min(to) > 0.02 * size {
            return Self {
                map: ColourMap::BlueRed,
                from: -size,
                to: size,
            };
        }
        let map = if name == "temperature" {
            ColourMap::Inferno
        } else {
            ColourMap::Viridis
        };
        // what only differs by rounding is constant
        let to = if to - from > 1e-9 * size {
            to
        } else {
            from + if size > 0.0 { size } else { 1.0 }
        };
        Self { map, from, to }
    }

    fn colour(&self, value: f64) -> Colour {
        self.map.colour((value - self.from) / (self.to - self.from))
    }
}

impl Snapshot<'_> {
    /// The snapshot as a picture of this width.
    pub(crate) fn draw(&self, width: u32) -> Picture {
        let bounds: Vec<[[f64; 2]; 2]> = self.views.iter().map(|view| self.bounds(view)).collect();
        let wide = |b: &[[f64; 2]; 2]| b[1][0] - b[0][0];
        let high = |b: &[[f64; 2]; 2]| b[1][1] - b[0][1];
        let widest = bounds.iter().map(wide).fold(0.0, f64::max);
        let highest: f64 = bounds.iter().map(high).sum();
        let room = f64::from(width) - LEFT - RIGHT;
        let pixels_per_metre = (room / widest).min(MAX_HEIGHT * f64::from(width) / highest);
        let left = LEFT + 0.5 * (room - widest * pixels_per_metre);

        let has_captions = self.views.len() > 1;
        let caption = if has_captions { CAPTION } else { 0.0 };
        let heights = highest * pixels_per_metre + (self.views.len() as f64 - 1.0) * GAP;
        // minimum height of a colour bar
        let inner = heights.max(190.0);
        let height = TOP + caption + inner + BOTTOM;
        let mut picture = Picture::new(width, height.ceil() as u32);
        let title = TextLook {
            bold: true,
            ..look(TITLE, Anchor::Left)
        };
        picture.text(&self.title, [LEFT, 0.45 * TOP], title);
        self.draw_legend(&mut picture, [f64::from(width) - 30.0, 0.45 * TOP]);

        let mut top = TOP + caption + 0.5 * (inner - heights);
        let lengths = unit::length(widest);
        for (view, bounds) in self.views.iter().zip(&bounds) {
            let axis = |side: usize| {
                let label = unit::label(["x", "y", "z"][view.axes[side]], lengths.unit);
                let (from, to) = (bounds[0][side], bounds[1][side]);
                ChartAxis::linear(from * lengths.factor, to * lengths.factor, label)
            };
            let right = left + wide(bounds) * pixels_per_metre;
            let bottom = top + high(bounds) * pixels_per_metre;
            let frame = Frame {
                edges: [left, top, right, bottom],
                horizontal: axis(0),
                vertical: axis(1),
            };
            let place = |p: [f64; 2]| frame.place(p[0] * lengths.factor, p[1] * lengths.factor);
            self.draw_points(&mut picture, view, place);
            if self.displacement.is_none() {
                self.draw_isotherms(&mut picture, view, place);
            }
            frame.draw(&mut picture, true);
            if has_captions {
                picture.text(&view.caption, [left, top - 16.0], look(TICK, Anchor::Left));
            }
            top = bottom + GAP;
        }
        let bar_left = left + widest * pixels_per_metre + 28.0;
        self.draw_colour_bar(
            &mut picture,
            bar_left,
            [TOP + caption, TOP + caption + inner],
        );
        picture
    }

    /// Lower left and upper right corner of what the view shows, m.
    fn bounds(&self, view: &View) -> [[f64; 2]; 2] {
        let raster = &view.raster;
        let half = 0.5 * raster.spacing;
        let last = raster.centre((raster.cells[0] - 1, raster.cells[1] - 1));
        let mut bounds = [raster.origin.map(|x| x - half), last.map(|x| x + half)];
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
                let [x, y] = raster.centre((i, j));
                let corner = |right: usize, up: usize| {
                    let [u, v] = moved(i + right, j + up);
                    let side = |index: usize| (2.0 * index as f64 - 1.0) * half;
                    [x + side(right) + u, y + side(up) + v]
                };
                let corners = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
                visit(corners, raster.value(i, j));
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
                picture.area(corners.map(&place).into(), colour);
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
            picture.rectangle(corners.map(&place), colour);
        }
    }

    fn draw_isotherms(
        &self,
        picture: &mut Picture,
        view: &View,
        place: impl Fn([f64; 2]) -> [f64; 2],
    ) {
        for (index, isotherm) in self.isotherms.iter().enumerate() {
            let lines = joined(&contour(&view.raster, isotherm.temperature));
            for line in lines {
                let line: Vec<_> = line.into_iter().map(&place).collect();
                draw_isotherm(picture, line, index);
            }
        }
    }

    fn draw_legend(&self, picture: &mut Picture, [mut x, y]: [f64; 2]) {
        if self.displacement.is_some() {
            return;
        }
        for (index, isotherm) in self.isotherms.iter().enumerate().rev() {
            let value = unit::number(isotherm.temperature, 5);
            let text = format!("{} {value} K", isotherm.name);
            x -= text_width(&text, TICK);
            picture.text(text, [x, y], look(TICK, Anchor::Left));
            draw_isotherm(picture, vec![[x - 40.0, y], [x - 8.0, y]], index);
            x -= 40.0 + LABEL;
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
            let corners = [
                [left, height(fraction(step + 1))],
                [right, height(fraction(step))],
            ];
            picture.rectangle(corners, colour);
        }
        let axis = ChartAxis::linear(
            self.scale.from * self.factor,
            self.scale.to * self.factor,
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
            &self.label,
            [right + 84.0, middle],
            look(LABEL, Anchor::Middle),
        );
    }
}

/// A bright line with a dark seam, visible on any colour.
fn draw_isotherm(picture: &mut Picture, line: Vec<[f64; 2]>, index: usize) {
    picture.line(line.clone(), 4.4, BLACK);
    picture.line(line, 2.2, ISOTHERM_COLOURS[index % ISOTHERM_COLOURS.len()]);
}
