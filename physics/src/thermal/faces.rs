//! Heat that crosses faces with a prescribed temperature.

use perimelt_core::body::SurfaceCell;
use perimelt_core::family::LayerRule;
use perimelt_core::solver::{ExactSum, Reducer};
use perimelt_core::{Body, Face, Report};

/// A face that exchanges heat.
#[derive(Debug)]
pub(super) struct HeatedFace {
    pub(super) face: Face,
    /// Point at the face, the next one behind it, and area of the cell face, m².
    cells: Vec<(u32, u32, f64)>,
    /// Heat that enters, W.
    inflow: f64,
    /// Smallest and largest heat flux into the body, W/m².
    flux: [f64; 2],
}

impl HeatedFace {
    /// The cells of the points that this process owns.
    pub(super) fn of(body: &Body, face: Face, reducer: &Reducer) -> HeatedFace {
        let opposite = face.opposite();
        let cell = |cell: SurfaceCell| {
            let next = body.neighbour(cell.point as usize, opposite)?;
            let is_own = (cell.point as usize) < reducer.owned();
            is_own.then_some((cell.point, next as u32, cell.area))
        };
        HeatedFace {
            face,
            cells: body.surface(&[face]).into_iter().filter_map(cell).collect(),
            inflow: 0.0,
            flux: [0.0; 2],
        }
    }

    /// Whether the face has cells with a cell behind them, so that its heat flux can be measured.
    pub(super) fn is_measurable(&self, reducer: &Reducer) -> bool {
        reducer.processes().any(!self.cells.is_empty())
    }

    /// Finds the heat that enters by the slope of a parabola through the wall and the two points before it, from the
    /// temperatures (K) and the `conductivity` of points (W/(m K)). `has_material` tells which points exist. Returns the heat (W) that enters through
    /// the cells of this process, for [`HeatedFace::add_up`].
    pub(super) fn measure(
        &mut self,
        rule: &LayerRule,
        temperature: &[f64],
        has_material: impl Fn(usize) -> bool,
        conductivity: impl Fn(usize) -> f64,
        spacing: &[f64],
    ) -> ExactSum {
        let (scale, offset) = (rule.scale[0], rule.offset[0]);
        // an even layer insulates
        let wall = offset / (1.0 - scale);
        let mut inflow = ExactSum::default();
        if scale == 1.0 {
            self.flux = [0.0; 2];
            return inflow;
        }
        self.flux = [f64::INFINITY, f64::NEG_INFINITY];
        for &(first, next, area) in &self.cells {
            let [first, next] = [first, next].map(|p| p as usize);
            if !(has_material(first) && has_material(next)) {
                continue;
            }
            let slope = (3.0 * temperature[first] - (temperature[next] + 8.0 * wall) / 3.0)
                / spacing[first];
            let flux = -conductivity(first) * slope;
            inflow.add(flux * area);
            self.flux = [self.flux[0].min(flux), self.flux[1].max(flux)];
        }
        inflow
    }

    /// Completes what was measured by that of the other processes.
    pub(super) fn add_up(&mut self, own_inflow: ExactSum, reducer: &Reducer) {
        self.inflow = reducer.total(own_inflow);
        let [least, most] = self.flux;
        self.flux = [reducer.min(least), reducer.max(most)];
    }

    /// Heat that enters through all faces, zero in a steady state without sources.
    pub(super) fn total(faces: &[HeatedFace]) -> Report {
        let inflow = faces.iter().map(|f| f.inflow).sum();
        Report::new("heat.all_faces", "W", inflow)
    }

    pub(super) fn reports(&self) -> [Report; 3] {
        let ([least, most], face) = (self.flux, self.face.name());
        [
            Report::new(format!("heat.{face}"), "W", self.inflow),
            Report::new(format!("heat_flux.{face}.min"), "W/m2", least),
            Report::new(format!("heat_flux.{face}.max"), "W/m2", most),
        ]
    }
}
