//! Points of an Eulerian fluid that follow its walls (arbitrary Lagrangian-Eulerian description; Donea, Huerta, Ponthot and
//! Rodríguez-Ferran (2004), doi:10.1002/0470091355.ecm009).
//!
//! The points are displaced by `u`, the displacement of the walls where they are and harmonic between them. Sums stay those of
//! the lattice X, whose families do not change; the mapping `x = X + u` enters them by
//!
//! ```text
//! F = I + grad u,   J = det F,   C = J F^-T                       gradient, volume ratio, cofactors
//! div C^T f   for a flux f,   div (C p)   for the pressure,   div (K grad v) with K = C^T C / J   for viscosity
//! J' = div C^T w,   w = (u - u_before) / dt                       volumes of the points
//! ```
//!
//! Mass and momentum are carried by `v - w`. The cofactors are derivatives of the discrete gradient in the form of Thomas and
//! Lombard (1979), doi:10.2514/3.61273,
//!
//! ```text
//! C_aA = delta_aA (1 + sum_B G_BB) - G_Aa + sum 1/2 e_abc e_ABC D_B (u_b G_cC),   G_aA = D_A u_a
//! ```
//!
//! with the operator D of the sums, so that `D_A C_aA = 0` to rounding: a uniform pressure exerts no force, and with the volumes by
//! the same sums a uniform flow stays uniform, however the points move. For this u is known in all cells around the fluid, also those
//! that walls fill. Behind faces it is mirrored, so that points slide along them and do not leave them.
//!
//! A few sweeps of successive over-relaxation in each step let u follow the walls; they need not converge, since the equations
//! hold for any motion of the points.

#[cfg(test)]
mod tests;

mod cells;
mod mapping;

use nalgebra::{Matrix3, Vector3};
use perimelt_core::{Body, Family, SetupError, SlotField};

use crate::shape_tensor::CompleteFamily;
use cells::{Cells, WallCell};
use mapping::Mapped;

/// Pairs of sweeps, forth and back, in each step.
const SWEEPS: usize = 2;

/// Least volume ratio of a point, and least factor of a bond in the viscosity, of a mapping that is not folded.
pub(crate) const LEAST_DISTORTION: f64 = 0.1;

/// Motion of the points of a fluid.
#[derive(Debug)]
pub(crate) struct PointMotion {
    dimension: usize,
    cells: Cells,
    family: Family,
    complete: CompleteFamily,
    /// Cell of each point of the fluid.
    cell: Vec<u32>,
    /// Cells beside each one, below and above along each axis; itself behind a face.
    beside: Vec<[[u32; 2]; 3]>,
    /// Cells in which u is harmonic.
    free: Vec<u32>,
    in_walls: Vec<WallCell>,
    over_relaxation: f64,
    /// u by cell, m.
    displacement: Vec<Vector3<f64>>,
    /// By slot of the lattice, m.
    slots: Vec<SlotField>,
    /// Directions of the bonds of a complete family.
    directions: Vec<Vector3<f64>>,
    points: Vec<Mapped>,
    /// By slot of the family of the fluid: the rows of C, and the tensor of the viscosity.
    pub(super) cofactors: Vec<SlotField>,
    pub(super) stretch: Vec<SlotField>,
}

impl PointMotion {
    /// Motion of the points of `body` with this family, between walls of which the points lie at `walls` (m).
    pub(super) fn prepare(
        body: &Body,
        family: &Family,
        walls: &[&[Vector3<f64>]],
    ) -> Result<PointMotion, SetupError> {
        let failed = |e: Box<dyn std::error::Error + Send + Sync>| SetupError::other("body", e);
        let cells = Cells::around(body, family).map_err(|e| failed(e.into()))?;
        let own = Family::build(&cells.body, family.spec()).map_err(|e| failed(e.into()))?;
        let complete = CompleteFamily::of(&cells.body, &own);
        let cell = cells.of_points(&body.points.position);
        let (mut free, mut in_walls) = (Vec::new(), Vec::new());
        for (cell, mut parts) in (0..).zip(cells.filled(walls, &cell)) {
            if parts.is_empty() {
                free.push(cell);
                continue;
            }
            let sum: f64 = parts.iter().map(|part| part.fraction).sum();
            parts.iter_mut().for_each(|part| part.fraction /= sum);
            in_walls.push(WallCell { cell, parts });
        }
        let mut directions = Vec::new();
        own.for_each_bond(complete.point, |_, bond, _| {
            directions.push(Vector3::from(bond.xi) * bond.inverse_length);
        });
        let mut motion = PointMotion {
            dimension: body.dimension,
            displacement: vec![Vector3::zeros(); cells.body.points.len()],
            slots: vec![SlotField::default(); body.dimension],
            over_relaxation: cells.over_relaxation(),
            points: vec![Mapped::default(); cell.len()],
            cofactors: Vec::new(),
            stretch: Vec::new(),
            family: own,
            beside: cells.beside(),
            cells,
            complete,
            cell,
            free,
            in_walls,
            directions,
        };
        motion.fill_slots(family);
        Ok(motion)
    }

    /// Lets the points follow walls that are displaced by this much (m) since the set-up, in a step of `dt` (s); `family`: that of the
    /// fluid.
    pub(super) fn follow(&mut self, family: &Family, walls: &[&[Vector3<f64>]], dt: f64) {
        for WallCell { cell, parts } in &self.in_walls {
            let parts = parts.iter();
            let parts = parts.map(|p| p.fraction * walls[p.wall as usize][p.point as usize]);
            self.displacement[*cell as usize] = parts.sum();
        }
        let before: Vec<_> = self.displacements().collect();
        for _ in 0..SWEEPS {
            (0..self.free.len()).for_each(|n| self.relax(n));
            (0..self.free.len()).rev().for_each(|n| self.relax(n));
        }
        self.map(family, &before, dt);
    }

    /// Places and displacements (m) of the cells in walls.
    #[cfg(test)]
    pub(super) fn cells_in_walls(&self) -> impl Iterator<Item = [Vector3<f64>; 2]> {
        let cells = self.in_walls.iter().map(|wall| wall.cell as usize);
        cells.map(|cell| {
            [
                self.cells.body.points.position.at(cell),
                self.displacement[cell],
            ]
        })
    }

    /// Displaces the points by this much at each place (m) in a step of `dt` (s).
    #[cfg(test)]
    pub(super) fn displace(
        &mut self,
        family: &Family,
        dt: f64,
        by: impl Fn(&Vector3<f64>) -> Vector3<f64>,
    ) {
        let before: Vec<_> = self.displacements().collect();
        let places = self.cells.body.points.position.iter();
        self.displacement = places.map(by).collect();
        self.map(family, &before, dt);
    }

    fn map(&mut self, family: &Family, before: &[Vector3<f64>], dt: f64) {
        match self.dimension {
            2 => self.find_mapping::<2, 4>(),
            _ => self.find_mapping::<3, 9>(),
        }
        for ((mapped, before), cell) in self.points.iter_mut().zip(before).zip(&self.cell) {
            mapped.velocity = (self.displacement[*cell as usize] - before) / dt;
        }
        self.fill_slots(family);
    }

    /// One value of the relaxation.
    fn relax(&mut self, n: usize) {
        let cell = self.free[n] as usize;
        let beside = &self.beside[cell];
        let (mut sum, mut count) = (Vector3::zeros(), Vector3::zeros());
        for (axis, ends) in beside.iter().enumerate().take(self.dimension) {
            for end in ends.map(|end| end as usize) {
                if end == cell {
                    // the image behind the face: opposite along the axis, else the same
                    count[axis] += 2.0;
                } else {
                    sum += self.displacement[end];
                    count += Vector3::repeat(1.0);
                }
            }
        }
        let here = self.displacement[cell];
        for a in 0..self.dimension {
            if count[a] > 0.0 {
                let change = sum[a] / count[a] - here[a];
                self.displacement[cell][a] += self.over_relaxation * change;
            }
        }
    }

    /// The mapping at each point.
    pub(super) fn points(&self) -> &[Mapped] {
        &self.points
    }

    /// Displacement of each point of the fluid, m.
    pub(super) fn displacements(&self) -> impl Iterator<Item = Vector3<f64>> + '_ {
        self.cell.iter().map(|c| self.displacement[*c as usize])
    }

    /// Displacement of the lattice at a place of the reference configuration, m.
    pub(super) fn displacement_at(&self, x: &Vector3<f64>) -> Vector3<f64> {
        self.cells.interpolate(&self.displacement, x)
    }

    /// Displacement of all cells, m: what a resumed run must know.
    pub(super) fn state(&self) -> &Vec<Vector3<f64>> {
        &self.displacement
    }

    /// Restores what [`PointMotion::state`] gave.
    pub(super) fn set_state(&mut self, displacement: Vec<Vector3<f64>>) {
        self.displacement = displacement;
    }

    /// Least of the volume ratios and of the factors of bonds in the viscosity, and the point that has it.
    pub(crate) fn distortion(&self) -> (f64, usize) {
        let points = self.points.iter().zip(0..);
        points.fold((f64::INFINITY, 0), |least, (mapped, point)| {
            match mapped.distortion < least.0 {
                true => (mapped.distortion, point),
                false => least,
            }
        })
    }

    /// Largest `|F^-1|^2`, by which distances shrink at most.
    pub(super) fn largest_compression(&self) -> f64 {
        let of_point = |m: &Mapped| {
            let metric = m.cofactors.transpose() * m.cofactors / (m.volume * m.volume);
            1.0 + (metric - Matrix3::identity()).norm()
        };
        self.points.iter().map(of_point).fold(1.0, f64::max)
    }
}
