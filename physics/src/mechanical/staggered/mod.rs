//! Staggered solids: the displacement lives at the corners of the cells of a lattice, everything else at the points.
//!
//! ```text
//! H_i = sum_q U_q (x) phi_q,  phi_q = K^-1 d_q,  K = sum_q d_q (x) d_q     q: the 2^d corners of the cell, d_q = X_q - x_i
//! z_q = U_q - mean(U) - H d_q - z*_q - z0_q
//! W   = sum_i V_i [ psi(H_i) + 1/2 g_i sum_q |z_q|^2 ],   g = G mu / h^2
//! F_q = sum_i V_i [ sigma_i phi_q + g_i z_q ]                              i: the points around the corner
//! u_i = mean of U over the corners
//! ```
//!
//! The limit of a correspondence solid at its smallest horizon: a point has the family of its corners, one strain and one
//! stress, and H is exact for quadratic displacements also at bare surfaces. The springs g against modes without strain follow
//! the *shear* modulus. See docs/theory/mechanics.md, "Staggered solids", for G, for the displacement z* of eigenstrains
//! that vary linearly, and for z0 of material that was deposited or annealed. Related to finite elements of one point with
//! stabilisation, Flanagan & Belytschko (1981), Int. J. Numer. Methods Eng. 17, 679-706.
//!
//! In finite kinematics `P = F S` takes the place of sigma; |z|² does not change under rotations, see `modes`. Lattices only;
//! bonds do not exist, and do not break.

mod births;
mod checks;
mod corners;
mod forces;
#[cfg(test)]
mod frequency_tests;
#[cfg(test)]
mod growth_tests;
mod hinges;
mod kernels;
mod modes;
mod solid;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod topology_tests;

use std::sync::Arc;

use nalgebra::{Matrix3, Matrix6};
use perimelt_core::body::{Horizons, Lattice};
use perimelt_core::{Body, Face, Family, SetupError};

pub(super) use births::Births;
pub(super) use checks::check;
use corners::Behind;
pub use corners::Corners;

use super::base::{Properties, SolidBase};
use super::gradient::Gradient;
use super::moduli::Moduli;
use super::nodes::Nodes;
use super::points::LawPoints;
use super::solid::{Constitution, Solid};
use kernels::{Amplitudes, Cell, CellState};

/// Points swept by one task.
const CHUNK: usize = 512;

/// Stiffness of the springs against modes without strain.
#[derive(Clone, Copy, Debug)]
pub enum Springs {
    /// A plate that is one cell thick has its exact bending stiffness.
    Bending,
    /// G.
    Factor(f64),
}

impl Springs {
    /// G mu of a point, Pa. The strip of a plate that is one cell thick bends by `E' kappa^2 h^2 / 24` in energy per volume, with the
    /// plate modulus `E' = 4 mu (lame + mu) / (lame + 2 mu)`, and its springs by `2^d G mu kappa^2 h^2 / 32`.
    fn modulus(self, moduli: &Moduli, dimension: usize) -> f64 {
        let Moduli { lame, shear, .. } = *moduli;
        match self {
            Springs::Bending => {
                let plate = 4.0 * shear * (lame + shear) / (lame + 2.0 * shear);
                4.0 / 3.0 * plate / f64::from(1 << dimension)
            }
            Springs::Factor(factor) => factor * shear,
        }
    }
}

/// A point of a body in finite kinematics, linearised.
#[derive(Clone, Copy, Debug)]
struct About {
    /// F.
    deformation: Matrix3<f64>,
    /// Second Piola-Kirchhoff stress, Pa.
    stress: Matrix3<f64>,
}

/// The staggered solid of a body on a lattice, whose points follow a law or the linear one.
pub(super) fn solid(
    body: &Body,
    constitution: Constitution,
    law: Option<LawPoints>,
    stabilisation: Option<f64>,
) -> Result<Box<dyn Solid>, SetupError> {
    let lattice = checks::lattice(body)?;
    // a law with state may flow, too
    let has_state = |law: &LawPoints| !law.state_variables().is_empty();
    let may_yield = constitution.plasticity.is_some() || law.as_ref().is_some_and(has_state);
    let springs = match (stabilisation, may_yield) {
        (Some(factor), _) => Springs::Factor(factor),
        (None, false) => Springs::Bending,
        // elastic springs hold what has yielded beside them (docs/theory/mechanics.md)
        (None, true) => Springs::Factor(if body.dimension == 3 { 0.2 } else { 0.3 }),
    };
    let (c, s) = (constitution, springs);
    Ok(match body.dimension {
        1 => Box::new(Staggered::<1>::new(body, lattice, c, law, s)),
        2 => Box::new(Staggered::<2>::new(body, lattice, c, law, s)),
        _ => Box::new(Staggered::<3>::new(body, lattice, c, law, s)),
    })
}

/// A staggered solid of `D` dimensions.
#[derive(Debug)]
pub struct Staggered<const D: usize> {
    base: SolidBase,
    corners: Arc<Corners>,
    cell: Cell,
    springs: Springs,
    /// By component and corner, m.
    displacement: Vec<[f64; 3]>,
    /// H of each point.
    gradient: Gradient,
    /// g of each point, N/m⁵; zero without material.
    spring: Vec<f64>,
    /// Sum of g around each corner.
    corner_spring: Vec<f64>,
    /// The points behind the faces of a cell across which the eigenstrain is continuous, behind planes of symmetry that of the cell;
    /// `u32::MAX` where there is none.
    neighbours: Vec<[u32; 6]>,
    /// Modes at which points are free of stress, in finite kinematics; empty if there are none.
    free: Vec<Amplitudes>,
    /// The state about which forces were linearised, in finite kinematics.
    about: Vec<About>,
    /// `Plasticity::reliefs` of the linearised state, in linear kinematics.
    reliefs: Vec<(usize, Matrix6<f64>)>,
    /// `sum g (z* + z0)` of each corner, N/m³; empty if it is zero.
    mode_load: Vec<[f64; 3]>,
    states: Vec<CellState<D>>,
    blocks: Vec<[f64; 6]>,
}

impl<const D: usize> Staggered<D> {
    /// The solid of a body on a lattice.
    fn new(
        body: &Body,
        lattice: &Lattice,
        constitution: Constitution,
        law: Option<LawPoints>,
        springs: Springs,
    ) -> Self {
        let properties = Properties {
            bonds_shear: true,
            has_symmetric_plastic_tangent: true,
            has_finite_tangent: true,
        };
        let symmetry = constitution.symmetry.clone();
        let corners = Arc::new(Corners::new(body, lattice, &constitution.points));
        let (points, nodes) = (body.points.len(), corners.position.len());
        // a body without bonds
        let mut base = SolidBase::new(body, Arc::new(Family::default()), constitution, properties);
        base.horizons = Horizons::uniform(lattice.spacing);
        base.nodes = Nodes::Corners(corners.clone());
        base.set_law(law);
        let behind = |point: usize, face: Face| {
            let other = match corners::behind(body, &symmetry, point, face)? {
                Behind::Point(other) => other,
                Behind::Image => point,
            };
            let material = &body.material_of_point;
            (material[other] == material[point]).then_some(other as u32)
        };
        let neighbours = (0..points).map(|point| {
            Face::ALL.map(|face| match face.axis() < D {
                true => behind(point, face).unwrap_or(u32::MAX),
                false => u32::MAX,
            })
        });
        let mut gradient = Gradient::of_cells(points, D);
        if !corners.known_points().is_empty() {
            gradient.set_present(corners.known_points());
        }
        let mut this = Staggered {
            cell: Cell::new(lattice.spacing, D),
            springs,
            displacement: vec![[0.0; 3]; nodes],
            gradient,
            spring: vec![0.0; points],
            corner_spring: vec![0.0; nodes],
            neighbours: neighbours.collect(),
            free: Vec::new(),
            about: Vec::new(),
            reliefs: Vec::new(),
            mode_load: Vec::new(),
            states: vec![CellState::ZERO; points],
            blocks: vec![[0.0; 6]; nodes],
            corners,
            base,
        };
        this.load_springs();
        this
    }

    fn load_springs(&mut self) {
        let square = self.cell.spacing * self.cell.spacing;
        for (point, spring) in self.spring.iter_mut().enumerate() {
            *spring = match self.gradient.is_loose(point) {
                true => 0.0,
                false => self.springs.modulus(&self.base.elastic.moduli(point), D) / square,
            };
        }
        let spring = &self.spring;
        let corners = self.corner_spring.iter_mut().enumerate();
        corners.for_each(|(corner, sum)| {
            let around = self.corners.around(corner, &[]);
            *sum = around.map(|(_, point)| spring[point]).sum();
        });
        self.base.relieved.is_load_current = false;
    }

    /// Lets points have material or none. The stress of those that had material before does not change, also where they have
    /// other neighbours now.
    fn set_present(&mut self, present: &[bool]) {
        let points = 0..present.len();
        let modes = |this: &Self| points.clone().map(|p| this.eigenstrain_modes(p)).collect();
        let was_loose: Vec<bool> = points.clone().map(|p| self.gradient.is_loose(p)).collect();
        let before: Vec<Amplitudes> = modes(self);
        self.gradient
            .set_present(&self.corners.known_among(present));
        let after: Vec<Amplitudes> = modes(self);
        let all = &mut self.base.relieved.modes;
        all.resize(present.len(), Amplitudes::default());
        for point in points {
            let relieved = all[point].as_flattened_mut();
            if was_loose[point] || !present[point] {
                relieved.fill(0.0);
                continue;
            }
            let changes = before[point]
                .iter()
                .zip(&after[point])
                .flat_map(|(b, a)| b.iter().zip(a));
            relieved
                .iter_mut()
                .zip(changes)
                .for_each(|(z, (before, after))| *z += before - after);
        }
        self.load_springs();
    }
}
