//! Refinement that follows a heat source: a window of finer points that moves over a plate.
//!
//! The window is a separate body inside the plate, a box whose faces lie on faces of cells of the plate and
//! whose spacing is that of the plate divided by a whole number. It follows the source: when the
//! source has travelled by a cell of the plate along x or y, the window moves by that cell, as far as it stays on the
//! plate. Each body has its own `thermal`, and both have the same material and the same `phase_change`. Heat is conserved to
//! rounding when it crosses the faces of the window and when the window moves
//! ([`perimelt_core::world::refinement`]).
//!
//! Cells of the plate below the window have the mean temperature of the finer points; heat of sources and boundaries on
//! these cells is not counted. Sources and losses through surfaces therefore belong to both bodies, or to the window alone
//! where they act inside it only.
//!
//! The heat source with the followed path may heat either body. Temperatures around the window are those of cells of the plate: the
//! window should contain the melt pool and a few cells around it.
//!
//! Not for: mechanics, metallurgy and histories of points on the window, whose points do not stay with the material; they
//! act on the plate.

use std::rc::Rc;

use nalgebra::Vector3;
use perimelt_core::material::EnthalpyCurve;
use perimelt_core::world::refinement::{Transfer, WindowMover, WindowPosition};
use perimelt_core::world::{BodyIndex, PhaseChange};
use perimelt_core::{
    Coupler, LoadError, Prepared, Report, RunError, RunningCoupler, SavedState, Setup, SetupError,
    Step, World, keys,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::toolpath::TimedPath;

/// A window of finer points that follows a heat source over a plate.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MovingRefinement {
    /// Body with the coarser points, the plate.
    pub body: String,
    /// Body with the finer points, the window: a box inside of the plate, placed as it is when the source is at the start
    /// of its path.
    pub fine: String,
    /// Name of the heat source that the window follows, the `name` of its table.
    pub follow: String,
}

/// A window that is ready to move.
struct RunningMovingRefinement {
    window: BodyIndex,
    mover: WindowMover,
    path: Rc<TimedPath>,
    /// Enthalpy curves of the window, set when the first step begins.
    curves: Vec<EnthalpyCurve>,
    position: WindowPosition,
    /// Lower corner of the window, m.
    corner: Vector3<f64>,
}

impl RunningMovingRefinement {
    fn observe(&mut self, world: &World) {
        self.position = world.moved_refinement(self.mover).position();
        let (low, _) = world.body(self.window).bounds();
        self.corner = low + world.window_shift(self.window);
    }
}

#[typetag::serialize(name = "moving_refinement")]
impl Coupler for MovingRefinement {
    fn prepare(self: Box<Self>, setup: &mut Setup<'_>) -> Prepared<dyn RunningCoupler> {
        let plate = setup.find_body(Some(&self.body))?;
        let window = setup.find_body(Some(&self.fine)).map_err(|e| SetupError {
            key: "fine".into(),
            ..e
        })?;
        if plate == window {
            let message = format!("`body` and `fine` are both `{}`", self.body);
            return Err(SetupError::value("fine", message, "another body"));
        }
        let melting = [plate, window].map(|body| setup.world().fact::<PhaseChange>(body));
        if melting[0] != melting[1] {
            let message = format!(
                "bodies `{}` and `{}` melt in different ways",
                self.body, self.fine
            );
            let expected = "`phase_change` with the same keys for both bodies, or for none";
            return Err(SetupError::value("fine", message, expected));
        }
        let path: Rc<TimedPath> = setup.shared("follow", "heat source", &self.follow)?;
        let heat = Transfer {
            conserved: &keys::ENTHALPY,
            derived: &keys::TEMPERATURE,
        };
        let mover = setup.refine(plate, window, heat)?;
        let placed = setup.world().refinement(window).map(|(r, _)| r.position());
        Ok(Box::new(RunningMovingRefinement {
            window,
            mover,
            path,
            curves: Vec::new(),
            position: placed.unwrap_or_default(),
            corner: setup.body(window).bounds().0,
        }))
    }
}

impl RunningCoupler for RunningMovingRefinement {
    fn apply(&mut self, _world: &World, _step: Step) -> Result<(), RunError> {
        Ok(())
    }

    fn begin_step(&mut self, world: &World, time: f64) {
        if self.curves.is_empty() {
            // `thermal` has checked the curves at set-up
            self.curves = world.enthalpy_curves(self.window).unwrap_or_default();
        }
        let Some(curve) = self.curves.first() else {
            return;
        };
        let way = self.path.pose(time).position - self.path.first_position();
        let low = world.moved_refinement(self.mover).moved_by(way);
        world.move_window(self.mover, low, |h| curve.temperature(h));
        self.observe(world);
    }

    fn report(&self) -> Vec<Report> {
        vec![
            Report::new("corner.x", "m", self.corner.x),
            Report::new("corner.y", "m", self.corner.y),
            Report::new("heat of moves", "J", self.position.carried),
        ]
    }

    fn save(&self, _world: &World) -> Box<dyn erased_serde::Serialize + '_> {
        Box::new(self.position)
    }

    fn load(&mut self, world: &World, state: SavedState<'_, '_>) -> Result<(), LoadError> {
        world.restore_window(self.mover, erased_serde::deserialize(state)?);
        self.observe(world);
        Ok(())
    }
}

perimelt_core::register_coupler!("moving_refinement", MovingRefinement, supports: [Window]);
