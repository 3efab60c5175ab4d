//! Moduli and stress-free strain of the points of a body, and the elastic law that they give each point.

use nalgebra::Matrix3;
use perimelt_core::Body;
use perimelt_core::parallel::ParallelLoop;
use rayon::prelude::*;

use super::classical::{COMPONENTS, Point, symmetric};
use super::gradient::Gradient;
use super::moduli::{Elasticity, Moduli, Plane};
use super::plasticity::StressState;
use super::solid::{PointModuli, StressFreeStrain};

/// Moduli and eigenstrain of the points of a body.
#[derive(Debug)]
pub(super) struct ElasticPoints {
    pub(super) dimension: usize,
    /// Finite kinematics.
    pub(super) finite: bool,
    elasticity: Elasticity,
    /// The moduli where they are the same everywhere at any temperature; otherwise `moduli` has those of each
    /// point.
    uniform: Option<Moduli>,
    moduli: Vec<Moduli>,
    /// In-plane stress-free strain of each point.
    pub(super) eigenstrain: Vec<f64>,
    /// Stress-free strain with components of each point (xx, yy, zz, xy, yz, zx); empty if there is none. In finite kinematics
    /// it is that of Green and Lagrange.
    pub(super) stress_free: Vec<[f64; 6]>,
    /// Eigenstrain with components, by which lengths of the undeformed body grow; empty if there is none.
    pub(super) prescribed: Vec<[f64; 6]>,
    /// Stress-free strain of births; empty if there is none.
    pub(super) birth: Vec<[f64; 6]>,
    /// Largest factor by which moduli rose since it was taken, at least one.
    stiffening: f64,
}

impl ElasticPoints {
    pub(super) fn new(body: &Body, elasticity: Elasticity, finite: bool) -> Self {
        let uniform = elasticity.uniform();
        let moduli = body.material_of_point.iter();
        let moduli = moduli.map(|&m| elasticity.at(m as usize, 0.0));
        ElasticPoints {
            dimension: body.dimension,
            finite,
            moduli: match uniform {
                Some(_) => Vec::new(),
                None => moduli.collect(),
            },
            uniform,
            elasticity,
            eigenstrain: vec![0.0; body.points.len()],
            stress_free: Vec::new(),
            prescribed: Vec::new(),
            birth: Vec::new(),
            stiffening: 1.0,
        }
    }

    pub(super) fn moduli(&self, point: usize) -> Moduli {
        self.uniform.unwrap_or_else(|| self.moduli[point])
    }

    /// The moduli where they are the same everywhere at any temperature.
    pub(super) fn uniform(&self) -> Option<Moduli> {
        self.uniform
    }

    pub(super) fn is_plane_strain(&self) -> bool {
        self.elasticity.is_plane_strain()
    }

    /// The components that the stress of the body has.
    pub(super) fn stress_state(&self) -> StressState {
        let plane = match self.is_plane_strain() {
            true => Plane::Strain,
            false => Plane::Stress,
        };
        StressState::of(self.dimension, plane)
    }

    /// Takes the moduli of the points; whether they can have changed.
    pub(super) fn set_moduli(&mut self, moduli: PointModuli<'_>) -> bool {
        match moduli {
            PointModuli::At(body, temperature) => self.set_moduli_at(body, temperature),
            PointModuli::Stiffest(body) => self.set_stiffest_moduli(body),
        }
    }

    /// Evaluates the moduli at the temperature of each point, K.
    fn set_moduli_at(&mut self, body: &Body, temperature: Option<&[f64]>) -> bool {
        if self.uniform.is_some() {
            return false;
        }
        let elasticity = &self.elasticity;
        let points = self.moduli.par_iter_mut().zip(&body.material_of_point);
        let set = |(i, (moduli, &m)): (usize, (&mut Moduli, &u16))| {
            let before = *moduli;
            *moduli = elasticity.at(m as usize, temperature.map_or(0.0, |t| t[i]));
            (moduli.bulk / before.bulk).max(moduli.shear / before.shear)
        };
        let rise = points.enumerate().map(set).reduce(|| 1.0, f64::max);
        self.stiffening *= rise;
        true
    }

    /// Takes a factor by which the stiffness rose, besides that of the moduli.
    pub(super) fn note_stiffening(&mut self, factor: f64) {
        self.stiffening *= factor;
    }

    /// The largest factor by which moduli rose since the last call; one if none did.
    pub(super) fn take_stiffening(&mut self) -> f64 {
        std::mem::replace(&mut self.stiffening, 1.0)
    }

    /// Takes the stiffest moduli of each material.
    fn set_stiffest_moduli(&mut self, body: &Body) -> bool {
        for (moduli, &m) in self.moduli.iter_mut().zip(&body.material_of_point) {
            *moduli = self.elasticity.stiffest(m as usize);
        }
        self.uniform.is_none()
    }

    /// Takes the stress-free strain of each point; whether it changed.
    pub(super) fn set_eigenstrain(&mut self, eigenstrain: &[f64]) -> bool {
        let (uniform, moduli) = (self.uniform, &self.moduli);
        let moduli = |i: usize| uniform.unwrap_or_else(|| moduli[i]);
        let in_plane = |i: usize| eigenstrain[i] * moduli(i).swelling;
        let points = self.eigenstrain.par_iter().enumerate().with_min_len(4096);
        if points.all(|(i, own)| *own == in_plane(i)) {
            return false;
        }
        let points = self.eigenstrain.par_iter_mut().enumerate();
        let points = points.with_min_len(4096);
        points.for_all(|(i, own)| *own = in_plane(i));
        true
    }

    /// Takes the stress-free strains with components; whether the eigenstrain among them changed.
    pub(super) fn set_stress_free(&mut self, stress_free: StressFreeStrain<'_>) -> bool {
        let StressFreeStrain { strain, prescribed } = stress_free;
        self.stress_free.clear();
        self.stress_free.extend_from_slice(strain);
        self.birth.clear();
        self.birth.extend_from_slice(strain);
        for (birth, prescribed) in self.birth.iter_mut().zip(prescribed) {
            (0..6).for_each(|c| birth[c] -= prescribed[c]);
        }
        if self.finite {
            let points = self.stress_free.iter_mut().zip(prescribed);
            for ((own, prescribed), isotropic) in points.zip(&self.eigenstrain) {
                let second = second_order(prescribed, *isotropic);
                (0..6).for_each(|c| own[c] += second[c]);
            }
        }
        if self.prescribed == prescribed {
            return false;
        }
        self.prescribed.clear();
        self.prescribed.extend_from_slice(prescribed);
        true
    }

    /// In-plane isotropic strain that has the in-plane stress of a strain `across` the plane of plane strain; zero otherwise.
    pub(super) fn in_plane(&self, point: usize, across: f64) -> f64 {
        match self.is_plane_strain() {
            true => {
                let Moduli { lame, shear, .. } = self.moduli(point);
                0.5 * across * lame / (lame + shear)
            }
            false => 0.0,
        }
    }

    /// The in-plane strain that is prescribed at points, with components; `None` if it is the eigenstrain.
    pub(super) fn prescribed_tensor(&self) -> Option<Vec<[f64; 6]>> {
        if self.prescribed.is_empty() {
            return None;
        }
        let points = (0..self.eigenstrain.len()).into_par_iter();
        let of_point = |point: usize| self.in_plane_tensor(point, self.eigenstrain[point]);
        Some(points.map(of_point).collect())
    }

    /// The in-plane strain of the eigenstrain with components of a point, and of an isotropic one in the plane.
    pub(super) fn in_plane_tensor(&self, point: usize, isotropic: f64) -> [f64; 6] {
        let mut strain = self.prescribed[point];
        let isotropic = isotropic + self.in_plane(point, strain[2]);
        strain[..3].iter_mut().for_each(|e| *e += isotropic);
        strain
    }

    /// The points with their displacement gradients.
    pub(super) fn strained<'a>(&'a self, gradient: &'a Gradient) -> StrainedPoints<'a> {
        StrainedPoints {
            elastic: self,
            gradient,
        }
    }
}

/// What the strain of Green and Lagrange of the stretch `1 + e + E` has beyond E and that of e: `e E + E E / 2`.
fn second_order(tensor: &[f64; 6], isotropic: f64) -> [f64; 6] {
    let tensor = symmetric(tensor);
    let second = tensor * isotropic + tensor * tensor * 0.5;
    COMPONENTS.map(|at| second[at])
}

/// The points of a body with their displacement gradients.
#[derive(Clone, Copy)]
pub struct StrainedPoints<'a> {
    elastic: &'a ElasticPoints,
    gradient: &'a Gradient,
}

impl StrainedPoints<'_> {
    /// The elastic law of a point. A loose point has no stiffness.
    pub(super) fn law(&self, point: usize) -> Point {
        let Self { elastic, gradient } = self;
        let (moduli, dimension) = (elastic.moduli(point), elastic.dimension);
        match gradient.is_loose(point) {
            true => Point::loose(moduli, dimension),
            false => {
                let law = Point::new(moduli, elastic.eigenstrain[point], dimension);
                let strains = [&elastic.stress_free[..], gradient.smoothing()];
                let strains = strains.iter().filter_map(|strains| strains.get(point));
                strains.fold(law, |law, strain| {
                    law.with_inelastic(elastic.stress_state(), *strain)
                })
            }
        }
    }

    /// Stress of a point by the law `law`, Pa: without the rotation of the point.
    pub(super) fn stress(&self, point: usize, law: &Point) -> [f64; 6] {
        let gradient = self.gradient.elastic(point, self.elastic.finite);
        let stress = law.material_stress(&gradient, self.elastic.finite);
        law.components(&stress, self.elastic.is_plane_strain())
    }

    /// Stress that an inelastic strain (xx, yy, zz, xy, yz, zx) takes from a point, Pa.
    pub(super) fn relief(&self, law: &Point, inelastic: [f64; 6]) -> [f64; 6] {
        let law = law.of_change();
        let law = law.with_inelastic(self.elastic.stress_state(), inelastic);
        let stress = law.stress(&Matrix3::zeros());
        law.components(&stress, self.elastic.is_plane_strain())
            .map(|stress| -stress)
    }

    /// Elastic stress of a strain (xx, yy, zz, xy, yz, zx) alone, Pa.
    pub(super) fn elastic_stress(&self, law: &Point, strain: &[f64; 6]) -> [f64; 6] {
        let law = law.of_change();
        law.components(
            &law.stress(&symmetric(strain)),
            self.elastic.is_plane_strain(),
        )
    }
}
