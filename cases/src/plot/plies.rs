//! Plies of laminates in pictures.

use perimelt_core::log::{BodyInfo, LoggedCloud};
use perimelt_plot::{View, views};

use super::fields::cells_of;
use super::{PlotError, Plotter};
use crate::cell_grid::CellGrid;
use crate::log_names::PLY;
use crate::quantity::scalar::{Scalar, scalar};
use crate::unit;

/// So many plies are drawn without being asked for.
const MANY: usize = 4;

impl Plotter<'_> {
    /// Plies from above, one below the other: of each its highest layer of points.
    pub(super) fn plies(
        &self,
        body: &BodyInfo,
        cloud: &LoggedCloud,
        positions: &[[f64; 3]],
        values: &Scalar,
    ) -> Result<Vec<View>, PlotError> {
        let scattered = || PlotError::Scattered {
            body: body.name.clone(),
            time: cloud.time,
        };
        if !self.args.section.is_empty() {
            let body = body.name.clone();
            return Err(PlotError::SectionOfLayers { body });
        }
        let ply_of = scalar(cloud, PLY).ok_or_else(scattered)?.values;
        let count = body.plies.len();
        let view = |ply: usize| {
            let info = ply.checked_sub(1).and_then(|ply| body.plies.get(ply));
            let info = info.ok_or_else(|| PlotError::NoPly {
                body: body.name.clone(),
                ply,
                plies: count,
            })?;
            let own: Vec<usize> = (0..positions.len())
                .filter(|point| ply_of[*point] == ply as f64)
                .collect();
            let heights = own.iter().map(|point| positions[*point][2]);
            let top = heights.fold(f64::NEG_INFINITY, f64::max);
            // layers of a ply are further apart than the rounding of single precision
            let is_highest = |point: &usize| positions[*point][2] > top - 1e-3 * body.spacing;
            let own: Vec<usize> = own.into_iter().filter(is_highest).collect();
            let places: Vec<_> = own.iter().map(|point| positions[*point]).collect();
            let grid = CellGrid::new(&places, body.spacing).ok_or_else(scattered)?;
            let mut cells = cells_of(&grid);
            cells
                .covered
                .iter_mut()
                .for_each(|(point, _)| *point = own[*point]);
            let no_caption = |_, _| String::new();
            let views = views(&cells, 2, &values.values, &[], no_caption);
            let view = views.into_iter().flatten().next().ok_or_else(scattered)?;
            let angle = unit::signed_number(info.angle, 4);
            Ok(View {
                caption: format!("ply {ply} of {count} from below, {angle}°"),
                ..view
            })
        };
        let mut wanted = match &self.args.ply[..] {
            [] if count > MANY => vec![1, count.div_ceil(2), count],
            [] => (1..=count).collect(),
            asked => asked.to_vec(),
        };
        // the highest one above the others, as in the laminate
        wanted.sort_unstable();
        wanted.dedup();
        wanted.into_iter().rev().map(view).collect()
    }
}
