//! What solids of all formulations have: bonds, moduli, plastic state, strength and layers.

use std::sync::Arc;

use nalgebra::Matrix3;
use perimelt_core::body::Horizons;
use perimelt_core::family::{Continuation, LayerRule, WithTractions};
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::solver::Reducer;
use perimelt_core::{Body, BondKernel, BrokenBonds, Family, SlotField};
use rayon::prelude::*;

use super::classical::{Point, symmetric};
use super::elastic::ElasticPoints;
use super::fracture::{BondEnergy, Fracture};
use super::gradient::Gradient;
use super::layer_forces::{LayerForces, Summed};
use super::moduli::Moduli;
use super::nodes::Nodes;
use super::plasticity::Plasticity;
use super::points::LawPoints;
use super::residual::Tangent;
use super::solid::{Constitution, EnergyKind, PointModuli, StrainKind, StressKind};

/// Properties of a formulation.
#[derive(Clone, Copy, Debug)]
pub struct Properties {
    /// Whether bonds resist relative motion perpendicular to them.
    pub bonds_shear: bool,
    /// Whether the stiffness is symmetric under plastic flow: forces must be the derivative of an energy of the strain
    /// that enters the flow rule.
    pub has_symmetric_plastic_tangent: bool,
    /// Whether the tangent of finite kinematics is that of the deformed shape.
    pub has_finite_tangent: bool,
}

/// Properties of a law of elasticity.
#[derive(Clone, Copy, Debug)]
pub(super) struct ElasticProperties {
    pub(super) is_linear: bool,
    /// Largest stiffness at the strains for which the law is meant, over that at no strain.
    pub(super) steepest: f64,
}

/// The bonds of a body that are summed over.
#[derive(Clone, Copy)]
pub(super) struct Bonds<'a> {
    pub(super) family: &'a Family,
    pub(super) broken: Option<&'a BrokenBonds>,
}

impl<'a> Bonds<'a> {
    /// The unbroken bonds of a family.
    pub(super) fn unbroken(family: &'a Family, fracture: Option<&'a Fracture>) -> Self {
        Bonds {
            family,
            broken: fracture.map(Fracture::broken),
        }
    }
}

/// Modes of the displacement without a gradient in which points are free of stress, besides those of the eigenstrain.
#[derive(Debug, Default)]
pub(super) struct RelievedModes {
    /// By point, mode and axis, m; empty where none was relieved.
    pub(super) modes: Vec<[[f64; 3]; 4]>,
    /// Whether the loads that follow from the modes are those of the present modes, springs and eigenstrain.
    pub(super) is_load_current: bool,
}

impl RelievedModes {
    pub(super) fn saved(modes: Vec<[[f64; 3]; 4]>) -> Self {
        RelievedModes {
            modes,
            is_load_current: false,
        }
    }
}

/// What solids of all formulations have.
#[derive(Debug)]
pub struct SolidBase {
    pub(super) nodes: Nodes,
    /// Without points in formulations without bonds.
    pub(super) family: Arc<Family>,
    pub(super) dimension: usize,
    /// Horizon of each point, m.
    pub(super) horizons: Horizons,
    pub(super) properties: Properties,
    pub(super) elastic_law: ElasticProperties,
    /// The law of the points, if it is not linear.
    pub(super) law_points: Option<LawPoints>,
    pub(super) elastic: ElasticPoints,
    pub(super) plasticity: Option<Plasticity>,
    pub(super) fracture: Option<Fracture>,
    pub(super) relieved: RelievedModes,
    pub(super) continuation: Continuation,
    pub(super) layer_forces: LayerForces,
    /// The points of the body, which processes may share.
    pub(super) points: Reducer,
    /// Sums with as many components as the dimension, in 2D.
    pub(super) padded: Vec<f64>,
    /// Energy density and conjugate stress of each point.
    pub(super) energy: Vec<[f64; 2]>,
    /// Symmetric tensors of each point.
    pub(super) tensors: Vec<[f64; 6]>,
}

impl SolidBase {
    pub(super) fn new(
        body: &Body,
        family: Arc<Family>,
        constitution: Constitution,
        properties: Properties,
    ) -> Self {
        let (points, dimension) = (body.points.len(), body.dimension);
        let Constitution {
            elasticity,
            finite,
            plasticity,
            fracture,
            in_motion,
            points: reducer,
            ..
        } = constitution;
        SolidBase {
            nodes: Nodes::Points,
            dimension,
            horizons: Horizons::of(&body.points, family.spec().horizon),
            properties,
            elastic_law: ElasticProperties {
                is_linear: true,
                steepest: 1.0,
            },
            law_points: None,
            elastic: ElasticPoints::new(body, elasticity, finite),
            plasticity,
            fracture,
            relieved: RelievedModes::default(),
            continuation: Continuation::default(),
            layer_forces: LayerForces::new(dimension, &body.points.volume, in_motion),
            points: reducer,
            padded: vec![0.0; if dimension == 2 { 2 * points } else { 0 }],
            energy: vec![[0.0; 2]; points],
            tensors: vec![[0.0; 6]; points],
            family,
        }
    }

    /// The bonds of the body.
    pub fn family(&self) -> &Family {
        &self.family
    }

    /// Largest horizon, m.
    pub(super) fn largest_horizon(&self) -> f64 {
        self.horizons.largest()
    }

    /// Whether kinematics are finite.
    pub(super) fn is_finite(&self) -> bool {
        self.elastic.finite
    }

    /// Strength and broken bonds, if bonds break.
    pub fn fracture(&self) -> Option<&Fracture> {
        self.fracture.as_ref()
    }

    /// Bonds that broke, if bonds break.
    pub(super) fn broken(&self) -> Option<&BrokenBonds> {
        self.fracture().map(Fracture::broken)
    }

    pub(super) fn bonds(&self) -> Bonds<'_> {
        Bonds::unbroken(&self.family, self.fracture())
    }

    /// Takes the law of the points, if it is not linear.
    pub(super) fn set_law(&mut self, points: Option<LawPoints>) {
        self.law_points = points;
        self.find_steepest();
    }

    fn find_steepest(&mut self) {
        if let Some(points) = &self.law_points {
            self.elastic_law = ElasticProperties {
                is_linear: false,
                steepest: points.steepest(&self.elastic),
            };
        }
    }

    /// The law of a point, unless it is linear or the point is loose.
    pub(super) fn law_points_of(&self, gradient: &Gradient, point: usize) -> Option<&LawPoints> {
        let points = self.law_points.as_ref();
        points.filter(|_| !gradient.is_loose(point))
    }

    /// Takes the moduli of the points, and the constants of their law; whether moduli can have changed.
    pub(super) fn set_moduli(&mut self, moduli: PointModuli<'_>) -> bool {
        if let Some(points) = &mut self.law_points {
            match moduli {
                PointModuli::At(body, temperature) => points.load_constants(body, temperature),
                // the same in a resumed run, whatever the temperature
                PointModuli::Stiffest(body) => points.load_constants(body, None),
            }
        }
        let changed = self.elastic.set_moduli(moduli);
        if let PointModuli::Stiffest(_) = moduli {
            self.find_steepest();
        }
        changed
    }

    /// Sets the trial states of the flow and of the law of the points that follow the gradients.
    pub(super) fn try_gradients(&mut self, gradient: &Gradient) {
        if let Some(plasticity) = &mut self.plasticity {
            plasticity.try_strains(self.elastic.strained(gradient));
        }
        if let Some(points) = &mut self.law_points {
            points.try_gradients(&self.elastic, gradient);
        }
    }

    /// Plastic state, if the body flows.
    pub fn plasticity(&mut self) -> Option<&mut Plasticity> {
        self.plasticity.as_mut()
    }

    /// How the forces change with the displacement.
    pub(super) fn tangent(&self) -> Tangent {
        if self.plasticity.is_some() || self.law_points.is_some() {
            return Tangent::Linearised;
        }
        match (self.elastic_law.is_linear, self.elastic.finite) {
            (_, true) if self.properties.has_finite_tangent => Tangent::Linearised,
            (_, true) => Tangent::Differences,
            (true, false) => Tangent::Stiffness,
            (false, false) => Tangent::Linearised,
        }
    }

    /// Whether the linearised forces have a symmetric stiffness.
    pub(super) fn has_symmetric_tangent(&self) -> bool {
        let is_symmetric = |plasticity: &Plasticity| {
            plasticity.is_symmetric() && self.properties.has_symmetric_plastic_tangent
        };
        self.plasticity.as_ref().is_none_or(is_symmetric)
            && self.law_points.as_ref().is_none_or(LawPoints::is_symmetric)
    }

    /// Moduli of a point at its present temperature.
    pub fn moduli_of(&self, point: usize) -> Moduli {
        self.elastic.moduli(point)
    }

    /// The law of a point for the given kind of strain; a loose point of the gradient has no stiffness.
    pub(super) fn law_of(&self, gradient: &Gradient, point: usize, strain: StrainKind) -> Point {
        let law = self.elastic.strained(gradient).law(point);
        let law = match strain {
            StrainKind::Elastic => law,
            StrainKind::Total | StrainKind::Change => law.of_change(),
        };
        match (&self.plasticity, strain) {
            (None, _) | (_, StrainKind::Total) => law,
            (Some(p), StrainKind::Elastic) => {
                law.with_inelastic(p.stress_state, p.states.tried()[point].strain)
            }
            (Some(p), StrainKind::Change) => law.with_inelastic(p.stress_state, p.change[point]),
        }
    }

    /// Stress in space of a point with a gradient of the displacement as xx, yy, zz, xy, yz, zx, Pa.
    pub(super) fn spatial_stress(
        &self,
        gradients: &Gradient,
        point: usize,
        gradient: &Matrix3<f64>,
    ) -> [f64; 6] {
        if let Some(points) = self.law_points_of(gradients, point) {
            return points.spatial_stress(&self.elastic, point, gradient);
        }
        let finite = self.elastic.finite;
        let law = self.law_of(gradients, point, StrainKind::Elastic);
        let mut stress = law.piola(gradient, finite);
        if finite {
            let deformation = Matrix3::identity() + gradient;
            stress = stress * deformation.transpose() / deformation.determinant();
        }
        law.components(&stress, self.elastic.is_plane_strain())
    }

    /// Energy density of a point with a gradient of the displacement (J/m³), and the stress conjugate to the eigenstrain (Pa),
    /// which is zero for [`EnergyKind::Elastic`].
    pub(super) fn energy_density(
        &self,
        gradients: &Gradient,
        point: usize,
        gradient: &Matrix3<f64>,
        kind: EnergyKind,
    ) -> [f64; 2] {
        let elastic = &self.elastic;
        match (self.law_points_of(gradients, point), kind) {
            (Some(points), EnergyKind::Elastic) => [points.energy(elastic, point, gradient), 0.0],
            (Some(points), EnergyKind::Total) => points.total_energy(elastic, point, gradient),
            (None, EnergyKind::Elastic) => {
                let law = self.law_of(gradients, point, StrainKind::Elastic);
                let stress = law.material_stress(gradient, elastic.finite);
                [law.energy_of(&stress), 0.0]
            }
            (None, EnergyKind::Total) => {
                let law = self.law_of(gradients, point, StrainKind::Total);
                self.total_energy(point, &law, gradient)
            }
        }
    }

    /// The total strain of a point beyond that at its birth.
    fn strain_since_birth(&self, point: usize, gradient: &Matrix3<f64>) -> Matrix3<f64> {
        let strain = Point::strain(gradient, self.elastic.finite);
        match self.elastic.birth.get(point) {
            Some(birth) => strain - symmetric(birth),
            None => strain,
        }
    }

    /// Evaluates the stress conjugate to the eigenstrain at the gradients of points.
    pub(super) fn evaluate_conjugate_stress(&mut self, gradient: &Gradient) {
        let mut tensors = std::mem::take(&mut self.tensors);
        let points = tensors.par_iter_mut().zip(&gradient.values).enumerate();
        points.for_all(|(i, (tensor, gradient_of_point))| {
            if let Some(points) = self.law_points_of(gradient, i) {
                *tensor = points.conjugate_stress(&self.elastic, i, gradient_of_point);
                return;
            }
            let law = self.law_of(gradient, i, StrainKind::Total);
            let stress = law.stress(&self.strain_since_birth(i, gradient_of_point));
            *tensor = law.components(&stress, self.elastic.is_plane_strain());
        });
        self.tensors = tensors;
    }

    /// Energy density of the total strain (J/m³) and the stress conjugate to the eigenstrain (Pa) of a point with a law of
    /// changes and a gradient of the displacement.
    pub(super) fn total_energy(
        &self,
        point: usize,
        law: &Point,
        gradient: &Matrix3<f64>,
    ) -> [f64; 2] {
        let strain = self.strain_since_birth(point, gradient);
        let stress = law.stress(&strain);
        let conjugate = (0..self.dimension).map(|a| stress[(a, a)]).sum::<f64>();
        [0.5 * stress.dot(&strain), conjugate * law.moduli.swelling]
    }

    /// The largest factor by which moduli rose with the temperature since the last call; one if none did.
    pub(super) fn take_stiffening(&mut self) -> f64 {
        self.elastic.take_stiffening()
    }

    /// Evaluates the stress of the trial state of the flow, without rotation, where the body flows.
    pub(super) fn evaluate_tried_stress(&mut self, gradient: Option<&Gradient>) {
        if let (Some(plasticity), Some(gradient)) = (&self.plasticity, gradient) {
            plasticity.tried_stress(self.elastic.strained(gradient), &mut self.tensors);
        }
    }

    /// Linearises the plastic flow and the law of the points about the trial state.
    pub(super) fn linearise(&mut self, gradient: Option<&Gradient>, damping: f64) {
        let Some(gradient) = gradient else {
            return;
        };
        if let Some(plasticity) = &mut self.plasticity {
            plasticity.linearise(self.elastic.strained(gradient), damping);
        }
        if let Some(points) = &mut self.law_points {
            points.about.copy_from_slice(&gradient.values);
        }
    }

    /// The stress that was evaluated, if it was.
    pub(super) fn stress_of(&self, kind: Option<StressKind>) -> &[[f64; 6]] {
        match kind {
            None => &[],
            Some(StressKind::Material) if self.plasticity.is_none() => &[],
            Some(_) => &self.tensors,
        }
    }

    /// The energy that was evaluated, if it was.
    pub(super) fn energy_of(&self, kind: Option<EnergyKind>) -> &[[f64; 2]] {
        match kind {
            None => &[],
            Some(_) => &self.energy,
        }
    }

    /// Evaluates the limits of bonds at the temperature of each point, K, if they can have changed; whether they can. `energy`
    /// is that of a bond whose law is not linear.
    pub(super) fn load_limits(
        &mut self,
        body: &Body,
        temperature: Option<&[f64]>,
        moduli_changed: bool,
        energy: Option<BondEnergy<'_>>,
    ) -> bool {
        let Some(fracture) = &mut self.fracture else {
            return false;
        };
        if !moduli_changed && fracture.is_constant() {
            return false;
        }
        fracture.load(body, temperature, |i| self.elastic.moduli(i), energy);
        true
    }

    /// Completes the forces of a kernel that was summed over `inputs`, whose first are the displacement, at layers.
    pub(super) fn complete<const I: usize, const D: usize>(
        &mut self,
        kernel: &impl BondKernel<I, D>,
        inputs: [&[f64]; I],
        out: &mut [f64],
    ) {
        let summed = Summed {
            kernel,
            displacement: 0,
            inputs,
        };
        let bonds = Bonds::unbroken(&self.family, self.fracture.as_ref());
        let continuation = &self.continuation;
        self.layer_forces
            .complete::<I, D>(summed, bonds, continuation, out);
    }

    /// Loads a displacement (one field for each dimension) and continues it into the layers by `rules`. Under a traction the
    /// slope of the layer follows from the moduli and the eigenstrain.
    pub(super) fn continue_displacement(
        &mut self,
        values: &[f64],
        rules: &[LayerRule],
        vector: &mut [SlotField],
    ) {
        let (elastic, dimension) = (&self.elastic, self.dimension);
        let ghosts = WithTractions {
            rules,
            continuation: &mut self.continuation,
            slope: |face, traction, point, lateral: &Matrix3<f64>| {
                let eigenstrain = elastic.eigenstrain[point];
                let moduli = elastic.moduli(point);
                moduli.slope_under_traction(face, traction, lateral, eigenstrain, dimension)
            },
        };
        let along = |axis: usize| move |point: usize| values[3 * point + axis];
        SlotField::load_all(vector, &self.family, along, ghosts);
        self.layer_forces.follow(&self.family, &self.continuation);
    }
}

/// Where sums of `D` components go: to the output itself in 3D, else to the work array.
pub(super) fn flat<'a, const D: usize>(
    padded: &'a mut [f64],
    out: &'a mut [[f64; 3]],
) -> &'a mut [[f64; D]] {
    match D {
        3 => bytemuck::cast_slice_mut::<f64, [f64; D]>(bytemuck::cast_slice_mut(out)),
        _ => bytemuck::cast_slice_mut(padded),
    }
}

/// Spreads sums of `D` components to vectors of three.
pub(super) fn unflatten<const D: usize>(padded: &[f64], out: &mut [f64]) {
    if D < 3 {
        let (vectors, _) = out.as_chunks_mut::<3>();
        for (out, sum) in vectors.iter_mut().zip(padded.as_chunks::<D>().0) {
            *out = std::array::from_fn(|axis| if axis < D { sum[axis] } else { 0.0 });
        }
    }
}
