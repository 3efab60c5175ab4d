//! Two fluids at points that move, each of which keeps its material: continuum surface force (Brackbill et al. (1992), Morris (2000)), in the
//! form of Wang (2025), section 8.3, and Gao (2020), chapter 6.
//!
//! With c = 1 in the first fluid and 0 in the second, s = 1 where `|grad c|` exceeds a hundredth of an inverse spacing and 0 elsewhere:
//!
//! ```text
//! n     = grad c / |grad c|,   kappa_i = sum_j s_j (n_j - n_i) . g1 V_j / (sum_j s_j w V_j / sum_j w V_j)
//! a     = beta |grad c| [-gamma kappa n + dgamma/dT (grad T - (n . grad T) n)],   beta = 2/(rho_1 + rho_2)
//! ```
//!
//! One gradient of c on both sides does what the publications do by normals that point from the own fluid to the other one and a change of
//! their sign (Wang (2025), eqs. 8.50 to 8.67). The pressure takes `beta_ij = 2/(rho_i + rho_j)` in its gradient, so that a jump `gamma kappa`
//! balances the force exactly at any ratio of densities. Near walls with a contact angle, normals go over to the one that has the angle
//! (eqs. 8.54 to 8.60).

use std::f64::consts::TAU;

use nalgebra::Vector3;
use perimelt_core::family::{ByRules, LayerRule, Mirrored};
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::world::WallPlace;
use perimelt_core::{
    Body, Bond, BondKernel, Derivatives, Face, Family, Pddo, SlotField, TensionLaw,
};
use rayon::prelude::*;

use crate::fluid::pair::{FluidPair, PreparedPair};
use crate::fluid::rates::POINTS_PER_TASK;

/// Gradient of the fraction below which a point does not belong to the interface, over an inverse spacing (Morris (2000)).
const LEAST_GRADIENT: f64 = 0.01;

/// Depth below a wall in which normals go over to the one that has the contact angle, in spacings (Wang (2025), eq. 8.60).
const WALL_DEPTH: f64 = 2.0;

/// `sum_j s_j w V_j` and `sum_j w V_j`.
struct Selected;

impl BondKernel<1, 2> for Selected {
    #[inline(always)]
    fn bond(&self, bond: &Bond, _: [f64; 1], other: [f64; 1]) -> [f64; 2] {
        [bond.weight * other[0], bond.weight]
    }
}

/// A face that the interface meets at an angle.
#[derive(Debug)]
struct WettedFace {
    /// Out of the fluid.
    normal: Vector3<f64>,
    /// Coordinate along the normal, m.
    position: f64,
    cosine: f64,
    sine: f64,
}

/// Force at the interface of two fluids.
#[derive(Debug)]
pub(in crate::fluid) struct SurfaceForce {
    pub(in crate::fluid) pair: FluidPair,
    tension: TensionLaw,
    /// m.
    spacing: f64,
    faces: Vec<WettedFace>,
    /// How normals continue behind faces.
    rules: Vec<LayerRule>,
    /// 1 at points of the first fluid, 0 at points of the second.
    pub(super) fraction: Vec<f64>,
    /// By slot: fraction, specific volume (m³/kg), whether a point belongs to the interface, normals and temperature (K).
    fractions: SlotField,
    pub(super) specific_volume: SlotField,
    selected: SlotField,
    normals: Vec<SlotField>,
    temperature: SlotField,
    /// Rows of points: gradients of the fraction, of the selection (1/m) and of the temperature (K/m).
    steps: Vec<f64>,
    edges: Vec<f64>,
    slopes: Vec<f64>,
    /// By point; a normal is zero outside of the interface.
    normal: Vec<Vector3<f64>>,
    /// 1/m.
    curvature: Vec<f64>,
    shares: Vec<[f64; 2]>,
    /// m/s².
    pub(super) acceleration: Vec<Vector3<f64>>,
}

impl SurfaceForce {
    /// Force between the fluids of `body`, whose tension follows a law.
    pub(super) fn new(fluids: PreparedPair, body: &Body) -> Self {
        let PreparedPair { pair, tension } = fluids;
        let points = body.points.len();
        let wetted = |face: Face| {
            let cosine = pair.contact_cosine(WallPlace::Face(face))?;
            let normal = face.normal();
            Some(WettedFace {
                normal,
                position: normal[face.axis()] * body.face_position(face),
                cosine,
                sine: (1.0 - cosine * cosine).sqrt(),
            })
        };
        SurfaceForce {
            faces: Face::ALL.into_iter().filter_map(wetted).collect(),
            rules: pair.normal_rules(body),
            fraction: body
                .material_of_point
                .iter()
                .map(|m| pair.fraction_of(*m))
                .collect(),
            spacing: body.finest_spacing(),
            fractions: SlotField::default(),
            specific_volume: SlotField::default(),
            selected: SlotField::default(),
            normals: vec![SlotField::default(); body.dimension],
            temperature: SlotField::default(),
            steps: Vec::new(),
            edges: Vec::new(),
            slopes: Vec::new(),
            normal: vec![Vector3::zeros(); points],
            curvature: Vec::new(),
            shares: vec![[0.0; 2]; points],
            acceleration: vec![Vector3::zeros(); points],
            pair,
            tension,
        }
    }

    /// Gradient of the fraction at a point, 1/m.
    fn step(&self, point: usize) -> Vector3<f64> {
        row(&self.steps, self.normals.len(), point)
    }

    /// Size of the gradient of the fraction at a point, 1/m.
    pub(super) fn steepness(&self, point: usize) -> f64 {
        self.step(point).norm()
    }

    /// Largest step, `sqrt(rho dx^3 / (2 pi gamma)) / 4` with the smaller density (Wang (2025), eq. 8.114): a quarter of that of waves
    /// at a lattice, since the curvature of points in disorder is noisy; s. The tension is the largest one at the interface, with these
    /// temperatures (K) where it depends on them.
    pub(super) fn largest_step(&self, temperature: Option<&[f64]>) -> f64 {
        let [first, second] = self.pair.density;
        let tension = match temperature {
            Some(temperature) => {
                let points = temperature.par_iter().enumerate();
                let points = points.with_min_len(POINTS_PER_TASK);
                let at_interface = points.filter(|(i, _)| self.is_at_interface(*i));
                let tensions = at_interface.map(|(_, t)| self.tension.value(*t));
                tensions.reduce(|| 0.0, f64::max)
            }
            None => self.pair.surface_tension,
        };
        0.25 * (first.min(second) * self.spacing.powi(3) / (TAU * tension)).sqrt()
    }

    /// Whether a point belongs to the interface.
    fn is_at_interface(&self, point: usize) -> bool {
        self.steepness(point) > LEAST_GRADIENT / self.spacing
    }

    /// Takes the family of the points where they are now.
    pub(super) fn follow(&mut self, pddo: &Pddo, work: &mut Derivatives) {
        let (family, fraction) = (pddo.family(), &self.fraction);
        (self.fractions).load(family, &fraction[..], Mirrored::Scalar);
        let [first, second] = self.pair.density;
        let volume = |i: usize| {
            if fraction[i] > 0.5 {
                1.0 / first
            } else {
                1.0 / second
            }
        };
        (self.specific_volume).load(family, volume, Mirrored::Scalar);
        pddo.gradient(&self.fractions, work, &mut self.steps);
    }

    /// Finds the force on points at these positions (m) and, where the tension depends on them, temperatures (K).
    pub(super) fn find(
        &mut self,
        pddo: &Pddo,
        work: &mut Derivatives,
        position: &[Vector3<f64>],
        temperature: Option<&[f64]>,
    ) {
        self.find_normals(pddo.family(), position);
        self.find_curvature(pddo, work);
        if let Some(temperature) = temperature {
            (self.temperature).load(pddo.family(), temperature, Mirrored::Scalar);
            pddo.gradient(&self.temperature, work, &mut self.slopes);
        }
        let dimension = self.normals.len();
        let mut acceleration = std::mem::take(&mut self.acceleration);
        let factor = 2.0 / self.pair.density.iter().sum::<f64>();
        let points = acceleration.par_iter_mut().enumerate();
        points.with_min_len(POINTS_PER_TASK).for_all(|(i, a)| {
            let normal = &self.normal[i];
            let now = temperature.map_or(0.0, |t| t[i]);
            let mut force = -self.tension.value(now) * self.curvature[i] * normal;
            if temperature.is_some() {
                let slope = row(&self.slopes, dimension, i);
                force += self.tension.slope(now) * (slope - normal.dot(&slope) * normal);
            }
            *a = if *normal == Vector3::zeros() {
                Vector3::zeros()
            } else {
                factor * self.steepness(i) * force
            };
        });
        self.acceleration = acceleration;
    }

    /// Finds the normals into the first fluid, and which points belong to the interface.
    fn find_normals(&mut self, family: &Family, position: &[Vector3<f64>]) {
        let mut normal = std::mem::take(&mut self.normal);
        let points = normal.par_iter_mut().zip(position).enumerate();
        let points = points.with_min_len(POINTS_PER_TASK);
        points.for_all(|(i, (normal, place))| {
            *normal = match self.is_at_interface(i) {
                true => self.at_walls(self.step(i).normalize(), place),
                false => Vector3::zeros(),
            };
        });
        let is_selected = |i: usize| {
            if normal[i] == Vector3::zeros() {
                0.0
            } else {
                1.0
            }
        };
        self.selected.load(family, is_selected, Mirrored::Scalar);
        for (axis, slots) in self.normals.iter_mut().enumerate() {
            let along = |i: usize| normal[i][axis];
            slots.load(family, along, ByRules(&self.rules, axis));
            let each = slots.par_iter_mut().zip(&self.selected[..]);
            let each = each.with_min_len(POINTS_PER_TASK);
            each.for_all(|(along, selected)| *along *= selected);
        }
        self.normal = normal;
    }

    /// A normal near walls that the interface meets at an angle.
    fn at_walls(&self, normal: Vector3<f64>, place: &Vector3<f64>) -> Vector3<f64> {
        let depth = WALL_DEPTH * self.spacing;
        let mut blended = normal;
        for face in &self.faces {
            let below = face.position - face.normal.dot(place);
            let along = blended - blended.dot(&face.normal) * face.normal;
            let length = along.norm();
            if below >= depth || length < 1e-8 {
                continue;
            }
            let at_wall = along * (face.sine / length) + face.cosine * face.normal;
            let part = (below / depth).max(0.0);
            blended = (part * blended + (1.0 - part) * at_wall).normalize();
        }
        blended
    }

    fn find_curvature(&mut self, pddo: &Pddo, work: &mut Derivatives) {
        pddo.divergence(&self.normals, work, &mut self.curvature);
        pddo.gradient(&self.selected, work, &mut self.edges);
        (pddo.family()).sum(&Selected, [&self.selected], &mut self.shares);
        let dimension = self.normals.len();
        let (normal, edges) = (&self.normal, &self.edges);
        let points = self.curvature.par_iter_mut().zip(&self.shares).enumerate();
        let points = points.with_min_len(POINTS_PER_TASK);
        points.for_all(|(i, (curvature, [selected, all]))| {
            // neighbours outside of the interface have no normal
            let missing = normal[i].dot(&row(edges, dimension, i));
            *curvature = match *selected > 0.0 {
                true => (*curvature - missing) * all / selected,
                false => 0.0,
            };
        });
    }
}

/// The row of a point as a vector.
fn row(rows: &[f64], dimension: usize, point: usize) -> Vector3<f64> {
    let row = &rows[point * dimension..][..dimension];
    Vector3::from_fn(|a, _| row.get(a).copied().unwrap_or(0.0))
}

#[cfg(test)]
mod tests;
