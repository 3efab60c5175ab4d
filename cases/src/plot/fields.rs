//! Pictures of a field of a body: what belongs on each of them.

use perimelt_core::log::{BodyInfo, LogError, LoggedCloud};
use perimelt_plot::{
    AXES, Cells, ChartAxis, ColourMap, ColourScale, Cut, Isoline, Picture, Snapshot, View, views,
};

use super::charts::line_chart;
use super::{PlotError, Plotter, deformation};
use crate::cell_grid::CellGrid;
use crate::quantity::isotherm::{Isotherm, of_highest_temperatures};
use crate::quantity::scalar::{Scalar, scalar};
use crate::quantity::survey::{BodySurvey, Hottest, Reference, grid_of};
use crate::unit::{self, Shown};

/// The field whose isotherms are the macrograph of a weld.
pub(super) const HIGHEST_TEMPERATURES: &str = "peak_temperature";

/// Common data of all pictures of a field of a body.
#[derive(Clone, Debug)]
pub(super) struct FieldPlot<'a> {
    pub body: &'a BodyInfo,
    pub field: &'a str,
    pub isotherms: Vec<Isotherm>,
    pub reference: Reference,
    pub cuts: Vec<Cut>,
    /// range of the colours in all pictures; by time without
    pub range: Option<[f64; 2]>,
    /// a box that is shown in any case, m
    pub extent: Option<[[f64; 3]; 2]>,
    pub is_film: bool,
}

impl Plotter<'_> {
    /// Settings for the pictures of a field.
    pub(super) fn field_plot<'a>(
        &self,
        body: &'a BodyInfo,
        field: &'a str,
        isotherms: &[Isotherm],
        survey: &BodySurvey,
    ) -> Result<FieldPlot<'a>, LogError> {
        let reference = Reference::new(self.log, body)?;
        Ok(FieldPlot {
            body,
            field,
            isotherms: match field {
                "temperature" => isotherms.to_vec(),
                HIGHEST_TEMPERATURES => {
                    of_highest_temperatures(self.log, &body.name, &self.isotherms())
                }
                _ => Vec::new(),
            },
            reference,
            cuts: self.cuts(survey.middle()),
            range: None,
            extent: None,
            is_film: false,
        })
    }

    /// The requested sections, or those along and across through a point.
    pub(super) fn cuts(&self, hottest: Option<Hottest>) -> Vec<Cut> {
        if !self.args.section.is_empty() {
            return self.args.section.clone();
        }
        let through = |hottest: Hottest| {
            let [x, y, _] = hottest.place;
            vec![Cut { axis: 1, at: y }, Cut { axis: 0, at: x }]
        };
        hottest.map_or_else(Vec::new, through)
    }

    /// A field at one time; `None` of a body without points, or without the field.
    pub(super) fn draw_field(
        &self,
        plot: &FieldPlot<'_>,
        cloud: &LoggedCloud,
    ) -> Result<Option<Picture>, PlotError> {
        let body = plot.body;
        // a body without material is not drawn
        let Some(scalar) = scalar(cloud, plot.field).filter(|_| !cloud.positions.is_empty()) else {
            return Ok(None);
        };
        let name = unit::pretty_name(&body.name);
        let mut title = format!("{name}, t = {}", unit::time_text(cloud.time));
        if body.dimension == 1 {
            let chart = line_chart(title, cloud, &scalar, self.args.celsius);
            return Ok(self.draw_chart(&chart));
        }
        let positions = plot.reference.positions(cloud);
        let views = match body.plies.is_empty() {
            true => self.views(plot, cloud, &positions, &scalar)?,
            false => self.plies(body, cloud, &positions, &scalar)?,
        };
        let displacement = deformation(cloud, self.args.deform);
        if let (Some(_), Some(factor)) = (&displacement, self.args.deform) {
            title += &format!(", deformed {} ×", unit::signed_number(factor, 4));
        }
        let scale = self.scale(plot, &scalar);
        let largest = scale.from.abs().max(scale.to.abs());
        let shown = Shown::new(&scalar.unit, largest, self.args.celsius);
        let label = unit::label(&scalar.label, &shown.unit);
        let bar = ChartAxis::linear(shown.of(scale.from), shown.of(scale.to), label);
        let snapshot = Snapshot {
            case: &self.title,
            title,
            views: &views,
            scale,
            isolines: self.isolines(plot, scale, &bar, &shown),
            bar,
            name_all: plot.is_film,
            displacement: displacement.as_deref(),
            extent: plot.extent,
            smooth: self.args.smooth,
            length_unit: |size| {
                let unit::Prefixed { factor, unit } = unit::length(size);
                (factor, unit)
            },
        };
        let picture = snapshot.draw(self.layout_width);
        Ok(Some(picture.scaled_to(self.args.width)))
    }

    /// A body from above, with sections.
    fn views(
        &self,
        plot: &FieldPlot<'_>,
        cloud: &LoggedCloud,
        positions: &[[f64; 3]],
        scalar: &Scalar,
    ) -> Result<Vec<View>, PlotError> {
        let body = plot.body;
        let grid = grid_of(body, cloud, positions).ok_or_else(|| PlotError::Scattered {
            body: body.name.clone(),
            time: cloud.time,
        })?;
        let caption = |cut, letter| section_caption(&grid, cut, letter);
        let cells = cells_of(&grid);
        let views = views(&cells, body.dimension, &scalar.values, &plot.cuts, caption);
        views.map_err(|outside| PlotError::SectionOutside {
            body: body.name.clone(),
            outside,
        })
    }

    /// Colours of the values of a picture.
    pub(super) fn scale(&self, plot: &FieldPlot<'_>, scalar: &Scalar) -> ColourScale {
        let map = match plot.field {
            "temperature" => ColourMap::Inferno,
            _ => ColourMap::Viridis,
        };
        // temperatures are given as they are shown, other values in SI units
        let kelvin = Shown::new("K", 0.0, self.args.celsius);
        let asked = self.args.range.map(|range| match &*scalar.unit {
            "K" => range.map(|x| kelvin.inverse(x)),
            _ => range,
        });
        match (asked, plot.range) {
            (Some(range), _) => ColourScale::asked(map, range),
            (None, Some(range)) => ColourScale::new(map, range),
            (None, None) => ColourScale::of(map, &scalar.values),
        }
    }

    /// The isotherms of a picture; round temperatures where it would have none, of a body that is nowhere molten.
    fn isolines(
        &self,
        plot: &FieldPlot<'_>,
        scale: ColourScale,
        bar: &ChartAxis,
        shown: &Shown,
    ) -> Vec<Isoline> {
        /// range of temperatures below which isotherms show nothing, K
        const LEAST: f64 = 1.0;
        let ColourScale { from, to, .. } = scale;
        let isoline = |name: &str, value: f64| {
            let number = unit::signed_number(shown.of(value), 5);
            let name = format!("{name} {number} {}", shown.unit);
            let name = name.trim().to_owned();
            Isoline { name, value }
        };
        let is_shown =
            |isotherm: &Isotherm| from < isotherm.temperature && isotherm.temperature < to;
        let needs_round = plot.field == "temperature"
            && self.args.isotherm.is_empty()
            && !plot.is_film
            && to - from > LEAST
            && !plot.isotherms.iter().any(is_shown);
        if needs_round {
            let ticks = bar.ticks(5.0).into_iter();
            return ticks
                .map(|(number, _)| isoline("", shown.inverse(number)))
                .collect();
        }
        let isotherms = plot.isotherms.iter();
        isotherms
            .map(|isotherm| isoline(&isotherm.name, isotherm.temperature))
            .collect()
    }
}

/// The cells of a grid with the points that cover them.
pub(super) fn cells_of(grid: &CellGrid) -> Cells {
    Cells {
        origin: grid.origin,
        spacing: grid.spacing,
        counts: grid.cells,
        covered: grid.covered().collect(),
    }
}

/// `section A, y = 1.5 mm`.
fn section_caption(grid: &CellGrid, Cut { axis, at }: Cut, letter: char) -> String {
    let extent = grid.cells[axis] as f64 * grid.spacing;
    let unit::Prefixed { factor, unit } = unit::length(extent.max(at.abs()));
    let number = unit::signed_number(at * factor, 4);
    format!("section {letter}, {} = {number} {unit}", AXES[axis])
}
