//! Walls at which the interface of two fluids meets at an angle theta, measured in the first fluid.
//!
//! ```text
//! psi'   = psi + 2 d cos(theta),   dpsi'/dN = 2 cos(theta) - dpsi/dN             at the depth d behind the wall, N into the wall
//! -kappa = eps lap (c_p - c) / (c (1 - c)),   c_p(xi) = 1/(1 + exp(-(psi + n . xi)/eps))        in the row of points at the wall
//! ```
//!
//! The first line is exact for a plane interface. With the second one the force of the row is that of the energy of interface and
//! wall, `-gamma cos(theta)` per area that the first fluid covers, so that Young's law is the equilibrium; the first line alone fixes
//! a direction without a force. The energy, `(1 - 2 c)/eps - eps lap c / (c (1 - c))`, of a plane interface of the same normal n is subtracted:
//! it is the error of the sum over bonds, which drives currents. A wall without an angle has the first line with 90 degrees, and no energy.

use perimelt_core::family::{ForeignGhost, LayerRule, Rising};
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::world::WallPlace;
use perimelt_core::{Body, Bond, BondKernel, Face, SlotField};
use rayon::prelude::*;

use super::phase::InterfaceBonds;
use super::wetted_body::WettedBody;
use crate::fluid::pair::FluidPair;
use crate::fluid::walls::Walls;

/// `c (1 - c)` below which the curvature of the row at a wall fades: there the interface has no force.
const LEAST_STEEPNESS: f64 = 0.01;

/// `sum_j w (f_j - f_i)`.
struct Differences;

impl BondKernel<1, 1> for Differences {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; 1], other: [f64; 1]) -> [f64; 1] {
        [bond.weight * (other[0] - own[0])]
    }
}

/// Walls of two fluids.
#[derive(Debug)]
pub(super) struct Wetting {
    /// Cosines of the angles, by face.
    cosine: [f64; 6],
    /// How the gradient of the distance continues behind faces.
    pub(super) gradient: Vec<LayerRule>,
    /// Bodies that are walls, in the order of the walls.
    pub(super) bodies: Vec<WettedBody>,
    /// Points next to a wall with an angle.
    row: Vec<u32>,
    /// Bonds of a complete family with their weights.
    stencil: Vec<([f64; 3], f64)>,
    /// Sum over the bonds of each point of the row, less that of a plane interface.
    beyond_plane: Vec<f64>,
    /// Part of the bonds to bodies that are walls, by point.
    behind: Vec<[f64; 1]>,
}

impl Wetting {
    pub(super) fn new(
        pair: &FluidPair,
        body: &Body,
        walls: &Walls,
        bodies: Vec<WettedBody>,
        stencil: Vec<([f64; 3], f64)>,
    ) -> Self {
        let at_faces = Face::ALL.map(|face| pair.contact_cosine(WallPlace::Face(face)));
        let cosine = at_faces.map(|cosine| cosine.unwrap_or(0.0));
        let wetted = |f: &Face| at_faces[*f as usize].is_some();
        let faces = || Face::ALL.into_iter().filter(wetted);
        let is_next_to = |point: usize, face: Face| {
            let along = body.points.position.at(point)[face.axis()];
            (along - body.face_position(face)).abs() < body.finest_spacing()
        };
        let mut beside_body = vec![false; body.points.len()];
        for (wetted, wall) in bodies.iter().zip(&walls.bodies) {
            if wetted.cosine.is_some() {
                let row = wetted.row(wall, body.finest_spacing());
                row.for_each(|point| beside_body[point] = true);
            }
        }
        let points = 0..body.points.len();
        let row = points
            .filter(|&point| beside_body[point] || faces().any(|face| is_next_to(point, face)));
        Wetting {
            cosine,
            gradient: pair.normal_rules(body),
            bodies,
            row: row.map(|point| point as u32).collect(),
            stencil,
            beyond_plane: Vec::new(),
            behind: Vec::new(),
        }
    }

    /// How the distance continues behind faces.
    pub(super) fn distance(&self) -> Rising<impl Fn(usize, usize, f64) -> f64> {
        let cosine = self.cosine;
        Rising(move |axis: usize, _point: usize, across: f64| {
            cosine[2 * axis + usize::from(across > 0.0)] * across.abs()
        })
    }

    /// Replaces the curvature (1/m) in the row of points at walls, for an interface of the thickness `eps` (m) with this normal at a
    /// point.
    pub(super) fn set_curvature(
        &mut self,
        bonds: InterfaceBonds<'_>,
        distance: &SlotField,
        normal: impl Fn(usize) -> [f64; 3] + Sync,
        eps: f64,
        curvature: &mut [[f64; 1]],
    ) {
        if self.row.is_empty() {
            return;
        }
        let InterfaceBonds { family, walls, .. } = bonds;
        let profile = |psi: f64| 1.0 / (1.0 + (-psi / eps).exp());
        let here = |point: usize| distance[family.slot_of(point)];
        let stencil = &self.stencil;
        let beyond_plane = |point: &u32| {
            let point = *point as usize;
            let (psi, n) = (here(point), normal(point));
            let own = profile(psi);
            let mut sum = 0.0;
            family.for_each_bond(point, |_, bond, slot| {
                sum += bond.weight * (profile(distance[slot]) - own);
            });
            for (xi, weight) in stencil {
                let rise = n[0] * xi[0] + n[1] * xi[1] + n[2] * xi[2];
                sum -= weight * (profile(psi + rise) - own);
            }
            sum
        };
        let row = self.row.par_iter().map(beyond_plane);
        row.fill(&mut self.beyond_plane);
        self.behind.clear();
        self.behind.resize(curvature.len(), [0.0]);
        let own = |point: usize| [profile(here(point))];
        for (body, wall) in self.bodies.iter().zip(&walls.bodies) {
            let behind = |ghost: &ForeignGhost| Some([profile(body.distance(ghost)?)]);
            body.add(wall, &Differences, own, behind, &mut self.behind);
        }
        for (&point, beyond_plane) in self.row.iter().zip(&self.beyond_plane) {
            let point = point as usize;
            let [c] = own(point);
            let sum = beyond_plane + self.behind[point][0];
            let laplacian = 2.0 * bonds.inverse * sum;
            curvature[point] = [eps * laplacian / (c * (1.0 - c)).max(LEAST_STEEPNESS)];
        }
    }
}
