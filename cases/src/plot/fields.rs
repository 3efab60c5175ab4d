//! Pictures of a field of a body: what belongs on each of them.

use perimelt_core::log::{BodyInfo, LogError, LoggedCloud};

use super::{
    PlotError, Plotter,
    args::{Cut, ValueRange},
    axes::ChartAxis,
    charts::line_chart,
    curves::Chart,
    picture::Picture,
    scale::ColourScale,
    section,
    snapshot::Snapshot,
};
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
    pub range: Option<ValueRange>,
    /// a box that is shown in any case, m
    pub extent: Option<[[f64; 3]; 2]>,
    pub is_film: bool,
}

/// A picture of a body, or the curve along one of one dimension.
pub(super) enum Drawn {
    Picture(Picture),
    Chart(Chart),
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
    ) -> Result<Option<Drawn>, PlotError> {
        let body = plot.body;
        // a body without material is not drawn
        let Some(scalar) = scalar(cloud, plot.field).filter(|_| !cloud.positions.is_empty()) else {
            return Ok(None);
        };
        let title = format!(
            "{}, t = {}",
            unit::pretty_name(&body.name),
            unit::time_text(cloud.time)
        );
        if body.dimension == 1 {
            let chart = line_chart(title, cloud, &scalar, self.args.celsius);
            return Ok(Some(Drawn::Chart(chart)));
        }
        let positions = plot.reference.positions(cloud);
        let grid = grid_of(body, cloud, &positions).ok_or_else(|| PlotError::Scattered {
            body: body.name.clone(),
            time: cloud.time,
        })?;
        let views = section::views(&grid, body.dimension, &scalar.values, &plot.cuts).map_err(
            |section::Outside { cut, extent }| PlotError::SectionOutside {
                axis: super::args::AXES[cut.axis],
                at: cut.at,
                body: body.name.clone(),
                extent,
            },
        )?;
        let (scale, shown) = self.colours(plot, &scalar);
        let factor = self.args.deform;
        let displacement = factor.and_then(|factor| super::deformation(cloud, factor));
        let deformed = match (&displacement, factor) {
            (Some(_), Some(factor)) => format!(", deformed {} ×", unit::signed_number(factor, 4)),
            _ => String::new(),
        };
        let mut snapshot = Snapshot {
            case: &self.title,
            title: format!("{title}{deformed}"),
            views: &views,
            label: &scalar.label,
            shown,
            scale,
            isotherms: &plot.isotherms,
            name_all: plot.is_film,
            displacement: displacement.as_deref(),
            extent: plot.extent,
            smooth: self.args.smooth,
        };
        let round = self.round_isotherms(plot, &snapshot);
        if let Some(round) = &round {
            snapshot.isotherms = round;
        }
        let picture = snapshot.draw(self.layout_width).scaled_to(self.args.width);
        Ok(Some(Drawn::Picture(picture)))
    }

    /// Colours and unit of the values of a picture.
    fn colours(&self, plot: &FieldPlot<'_>, scalar: &Scalar) -> (ColourScale, Shown) {
        let celsius = self.args.celsius;
        let asked = self.args.range.map(|range| {
            // temperatures are given as they are shown, other values in SI units
            let kelvin = Shown::new(&scalar.unit, 0.0, celsius && scalar.unit == "K");
            let si = |x: f64| {
                if scalar.unit == "K" {
                    kelvin.inverse(x)
                } else {
                    x
                }
            };
            ValueRange {
                from: si(range.from),
                to: si(range.to),
            }
        });
        let scale = match asked.or(plot.range) {
            Some(range) if asked.is_some() => ColourScale::asked(plot.field, range),
            Some(range) => ColourScale::new(plot.field, range.from, range.to),
            None => ColourScale::of(plot.field, &scalar.values),
        };
        let largest = scale.from.abs().max(scale.to.abs());
        (scale, Shown::new(&scalar.unit, largest, celsius))
    }

    /// Isotherms at round temperatures for a picture that would have none: of a body that is nowhere molten.
    fn round_isotherms(
        &self,
        plot: &FieldPlot<'_>,
        snapshot: &Snapshot<'_>,
    ) -> Option<Vec<Isotherm>> {
        /// range of temperatures below which isotherms show nothing, K
        const LEAST: f64 = 1.0;
        let ColourScale { from, to, .. } = snapshot.scale;
        let is_needed = plot.field == "temperature"
            && self.args.isotherm.is_empty()
            && !plot.is_film
            && to - from > LEAST
            && plot
                .isotherms
                .iter()
                .all(|i| !(from < i.temperature && i.temperature < to));
        if !is_needed {
            return None;
        }
        let shown = |value: f64| snapshot.shown.of(value);
        let ticks = ChartAxis::linear(shown(from), shown(to), "").ticks(5.0);
        let isotherm = |(number, _): (f64, String)| Isotherm {
            name: String::new(),
            temperature: snapshot.shown.inverse(number),
        };
        Some(ticks.into_iter().map(isotherm).collect())
    }
}
