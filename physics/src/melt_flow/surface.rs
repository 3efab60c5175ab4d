//! Stress along free surfaces by a surface tension that depends on temperature (Marangoni).
//!
//! A face is a plane along which the melt slips; its first row of cells gets the force
//!
//! ```text
//! f = dgamma/dT grad_s T / dx         N/m³
//! ```
//!
//! in which the stress `dgamma/dT grad_s T` is contained exactly: a linear profile of the velocity has no error. The gradient
//! along the face is that of the first row, by central differences, one-sided beside a wall, and vanishes where a neighbour is solid.

use perimelt_core::surface_tension::gradient_along;
use perimelt_core::{Body, Face};

use super::melt::Melt;
use super::momentum::Vector;
use super::pool::Pool;

/// The first row of cells before the free faces.
#[derive(Debug)]
pub(super) struct Surface {
    faces: Vec<Face>,
    /// Cells with the axis across their face.
    cells: Vec<(u32, usize)>,
    dimension: usize,
}

impl Surface {
    /// The surface of a body with these free faces.
    pub(super) fn new(body: &Body, faces: Vec<Face>) -> Surface {
        Surface {
            faces,
            cells: Vec::new(),
            dimension: body.dimension,
        }
    }

    /// Finds the first row of cells of a new list.
    pub(super) fn follow(&mut self, body: &Body, pool: &Pool) {
        self.cells.clear();
        for face in &self.faces {
            let cells = (0..pool.len()).filter(|cell| pool.is_at(body, *cell, *face));
            self.cells
                .extend(cells.map(|cell| (cell as u32, face.axis())));
        }
    }

    /// Whether the melt reaches a free face.
    pub(super) fn is_reached(&self) -> bool {
        !self.cells.is_empty()
    }

    /// The cells of each pool that reaches a free face.
    pub(super) fn pools(&self, pool: &Pool) -> Vec<Vec<usize>> {
        let (count, pool_of) = pool.find_pools();
        let mut reaches = vec![false; count];
        for (cell, _) in &self.cells {
            reaches[pool_of[*cell as usize]] = true;
        }
        let mut cells = vec![Vec::new(); count];
        for (cell, of) in pool_of
            .into_iter()
            .enumerate()
            .filter(|(_, of)| reaches[*of])
        {
            cells[of].push(cell);
        }
        cells.retain(|pool| !pool.is_empty());
        cells
    }

    /// Adds the acceleration of the cells by the surface tension at their temperatures (K), m/s².
    pub(super) fn add_stress(
        &self,
        melt: &Melt,
        pool: &Pool,
        temperature: &[f64],
        acceleration: &mut [Vector],
    ) {
        let over = 1.0 / (melt.density * pool.stencil.spacing);
        for &(cell, across) in &self.cells {
            let cell = cell as usize;
            let Some(tension) = &melt.tension else {
                return;
            };
            for axis in (0..self.dimension).filter(|axis| *axis != across) {
                let gradient = gradient(pool, cell, axis, temperature);
                acceleration[cell][axis] += tension.stress(temperature[cell], gradient) * over;
            }
        }
    }
}

/// Gradient of the temperature of the first row along an axis, K/m.
fn gradient(pool: &Pool, cell: usize, axis: usize, temperature: &[f64]) -> f64 {
    let beside =
        [false, true].map(|is_upper| pool.neighbours(cell)[pool.stencil.straight(axis, is_upper)]);
    if beside.iter().any(|neighbour| !neighbour.is_open) {
        return 0.0;
    }
    let neighbours = beside.map(|neighbour| {
        let is_melt = !neighbour.is_behind_wall();
        is_melt.then(|| temperature[neighbour.cell as usize])
    });
    gradient_along(temperature[cell], neighbours, pool.stencil.spacing)
}
