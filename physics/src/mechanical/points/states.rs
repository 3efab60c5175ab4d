//! The points of a body with their law and state.

use nalgebra::{Matrix3, Vector3};
use perimelt_core::law::{Constants, StateVariable, VariableShape};
use perimelt_core::orientation::PointAxes;
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::{Body, Step};
use rayon::prelude::*;

use super::law::{LawPoint, StepStates};
use super::response::{BodyPoint, FreeStrain, PointResponse};
use super::scratch::with_copy;
use crate::mechanical::classical::{COMPONENTS, components, diagonal, symmetric};
use crate::mechanical::elastic::ElasticPoints;
use crate::mechanical::gradient::Gradient;
use crate::mechanical::plasticity::bulk_modulus;
use crate::mechanical::variables::VariableStates;

/// A law of points in a body, with the states of its points.
#[derive(Debug)]
pub(in crate::mechanical) struct LawPoints {
    law: Box<dyn PointResponse>,
    name: &'static str,
    constants: Constants,
    /// Constants of the law at each point, one after the other.
    values: Vec<f64>,
    /// K, by point; empty in a body without temperature.
    temperature: Vec<f64>,
    /// Reference position (m) and spacing (m), by point.
    places: Vec<([f64; 3], f64)>,
    /// Axes of the material, where they count.
    axes: Option<PointAxes>,
    /// The step.
    pub(in crate::mechanical) step: Step,
    pub(in crate::mechanical) states: VariableStates,
    /// Gradients of the displacement that was linearised.
    pub(in crate::mechanical) about: Vec<Matrix3<f64>>,
}

/// A point or its image, with its gradient of the displacement.
#[derive(Clone, Copy)]
pub(in crate::mechanical) struct At<'a> {
    /// The point, or that of the image.
    pub(in crate::mechanical) point: usize,
    /// Signs of the axes of an image; ones for a point.
    pub(in crate::mechanical) mirror: [f64; 3],
    /// Signs of the axes of material and prescribed strain of an image ([`signs_of_image`](crate::mechanical::classical::signs_of_image)).
    pub(in crate::mechanical) signs: [f64; 3],
    /// H without what prescribed strains do to it.
    pub(in crate::mechanical) gradient: &'a Matrix3<f64>,
}

impl<'a> At<'a> {
    /// A point.
    pub(in crate::mechanical) fn point(point: usize, gradient: &'a Matrix3<f64>) -> Self {
        At {
            point,
            mirror: [1.0; 3],
            signs: [1.0; 3],
            gradient,
        }
    }
}

impl LawPoints {
    /// The points of a body at no strain, without temperature.
    pub(in crate::mechanical) fn new(
        name: &'static str,
        law: Box<dyn PointResponse>,
        constants: Constants,
        body: &Body,
    ) -> Self {
        let points = body.points.len();
        let positions = body.points.position.iter().map(|x| (*x).into());
        let places = positions.zip(body.points.spacing.iter().copied());
        let mut this = LawPoints {
            values: vec![0.0; points * law.constants().len()],
            temperature: Vec::new(),
            places: places.collect(),
            axes: (law.has_directions()).then(|| PointAxes::new(points)),
            step: Step::new(0.0, 0.0),
            states: VariableStates::new(points, StateVariable::width_of(law.state())),
            about: vec![Matrix3::zeros(); points],
            law,
            name,
            constants,
        };
        this.load_constants(body, None);
        this
    }

    /// The name of the law.
    pub(in crate::mechanical) fn law_name(&self) -> &'static str {
        self.name
    }

    /// State variables of the law.
    pub(in crate::mechanical) fn state_variables(&self) -> &[StateVariable] {
        self.law.state()
    }

    /// Whether the derivative of the stress by the strain is symmetric.
    pub(in crate::mechanical) fn is_symmetric(&self) -> bool {
        self.law.is_symmetric()
    }

    /// Whether the axes of the material count.
    pub(in crate::mechanical) fn has_directions(&self) -> bool {
        self.axes.is_some()
    }

    /// Turns the axes of the material by rotation vectors, rad.
    pub(in crate::mechanical) fn set_orientation(&mut self, orientation: &[Vector3<f64>]) {
        if let Some(axes) = &mut self.axes {
            axes.follow(orientation);
        }
    }

    /// Evaluates the constants of the law at the temperature of each point, K.
    pub(in crate::mechanical) fn load_constants(
        &mut self,
        body: &Body,
        temperature: Option<&[f64]>,
    ) {
        let points = self
            .values
            .par_chunks_exact_mut(self.law.constants().len().max(1));
        let points = points.zip(&body.material_of_point).enumerate();
        points.for_all(|(i, (values, &m))| {
            let temperature = temperature.map_or(0.0, |t| t[i]);
            self.constants.load(m as usize, temperature, 0.0, values);
        });
        self.temperature.clear();
        self.temperature
            .extend_from_slice(temperature.unwrap_or_default());
    }

    /// A point or its image, whose axes have these signs.
    fn at(&self, elastic: &ElasticPoints, point: usize, signs: [f64; 3]) -> BodyPoint<'_> {
        let (moduli, stress_state) = (elastic.moduli(point), elastic.stress_state());
        let count = self.law.constants().len();
        let (position, spacing) = self.places[point];
        let signs = diagonal(signs);
        let axes = match &self.axes {
            Some(axes) => signs * axes.of(point),
            None => Matrix3::identity(),
        };
        let isotropic = elastic.eigenstrain[point] / moduli.swelling;
        let free = match elastic.prescribed.get(point) {
            None => FreeStrain::isotropic(isotropic),
            Some(strain) => FreeStrain::with_components(
                Matrix3::identity() * isotropic + signs * symmetric(strain) * signs,
            ),
        };
        BodyPoint {
            point: LawPoint {
                constants: &self.values[point * count..][..count],
                temperature: self.temperature.get(point).copied(),
                start: self.step.start,
                step: self.step.size,
                shear_modulus: moduli.shear,
                bulk_modulus: bulk_modulus(stress_state, &moduli),
                finite: elastic.finite,
                axes,
                number: point,
                position,
                spacing,
            },
            stress_state,
            free,
        }
    }

    /// The largest stiffness over the elastic one at no strain, of all points.
    pub(in crate::mechanical) fn steepest(&self, elastic: &ElasticPoints) -> f64 {
        let points = (0..self.about.len()).into_par_iter();
        let steepest = points.map(|i| self.law.steepest(&self.at(elastic, i, [1.0; 3]).point));
        steepest.reduce(|| 1.0, f64::max)
    }

    /// Advances the state variables from the start of the step to the trial state.
    pub(in crate::mechanical) fn try_gradients(
        &mut self,
        elastic: &ElasticPoints,
        gradient: &Gradient,
    ) {
        if self.law.state().is_empty() {
            return;
        }
        let mut states = std::mem::take(&mut self.states);
        let points = states.try_from_settled().enumerate();
        points.for_all(|(i, (settled, tried))| {
            tried.copy_from_slice(settled);
            if !gradient.is_loose(i) {
                let h = gradient.elastic(i, elastic.finite);
                self.law.evolve(&self.at(elastic, i, [1.0; 3]), &h, tried);
            }
        });
        self.states = states;
    }

    /// Calls `use_state` with the state variables of an image in a layer: tensors are mirrored.
    fn with_mirrored<R>(
        &self,
        state: &[f64],
        mirror: [f64; 3],
        use_state: impl FnOnce(&[f64]) -> R,
    ) -> R {
        if mirror == [1.0; 3] {
            return use_state(state);
        }
        with_copy(state, |image| {
            let mut rest = &mut image[..];
            for variable in self.law.state() {
                let (own, others) = rest.split_at_mut(variable.width());
                let sign = |(a, b): (usize, usize)| mirror[a] * mirror[b];
                let values = own.iter_mut().enumerate();
                match variable.shape {
                    VariableShape::Tensor => values.for_each(|(c, v)| *v *= sign(COMPONENTS[c])),
                    VariableShape::Matrix => values.for_each(|(c, v)| *v *= sign((c % 3, c / 3))),
                    VariableShape::Scalar | VariableShape::Numbers(_) => {}
                }
                rest = others;
            }
            use_state(image)
        })
    }

    /// P at the trial state, Pa.
    pub(in crate::mechanical) fn piola(&self, elastic: &ElasticPoints, at: At<'_>) -> Matrix3<f64> {
        let point = self.at(elastic, at.point, at.signs);
        self.with_mirrored(self.states.tried(at.point), at.mirror, |state| {
            let gradient = self.law.complete(&point, at.gradient, state);
            self.law.piola(&point, &gradient, state)
        })
    }

    /// Change of P with a change of H, from the state at the start of the step, Pa.
    pub(in crate::mechanical) fn tangent(
        &self,
        elastic: &ElasticPoints,
        at: At<'_>,
        change: &Matrix3<f64>,
    ) -> Matrix3<f64> {
        let point = self.at(elastic, at.point, at.signs);
        self.with_mirrored(self.states.settled(at.point), at.mirror, |start| {
            self.with_mirrored(self.states.tried(at.point), at.mirror, |end| {
                let states = StepStates { start, end };
                self.law.tangent(&point, at.gradient, states, change)
            })
        })
    }

    /// Stress in space at the trial state as xx, yy, zz, xy, yz, zx, Pa.
    pub(in crate::mechanical) fn spatial_stress(
        &self,
        elastic: &ElasticPoints,
        point: usize,
        gradient: &Matrix3<f64>,
    ) -> [f64; 6] {
        let Stressed {
            gradient,
            mut stress,
            ..
        } = self.stressed(self.at(elastic, point, [1.0; 3]), gradient);
        if elastic.finite {
            let deformation = Matrix3::identity() + gradient;
            stress = stress * deformation.transpose() / deformation.determinant();
        }
        components(&stress)
    }

    /// Energy density at the trial state, J/m³.
    pub(in crate::mechanical) fn energy(
        &self,
        elastic: &ElasticPoints,
        point: usize,
        gradient: &Matrix3<f64>,
    ) -> f64 {
        let (at, state) = (self.at(elastic, point, [1.0; 3]), self.states.tried(point));
        let gradient = self.law.complete(&at, gradient, state);
        self.law.energy(&at, &gradient, state)
    }

    /// Energy density of the total strain (J/m³) and the stress conjugate to the eigenstrain (Pa).
    pub(in crate::mechanical) fn total_energy(
        &self,
        elastic: &ElasticPoints,
        point: usize,
        gradient: &Matrix3<f64>,
    ) -> [f64; 2] {
        let total = self.of_total_strain(elastic, point, gradient);
        let trace: f64 = (0..elastic.dimension).map(|a| total.stress[(a, a)]).sum();
        let swelling = elastic.moduli(point).swelling;
        let state = self.states.tried(point);
        let energy = self.law.energy(&total.at, &total.gradient, state);
        [energy, trace * swelling]
    }

    /// Stress of the total strain as xx, yy, zz, xy, yz, zx, Pa.
    pub(in crate::mechanical) fn conjugate_stress(
        &self,
        elastic: &ElasticPoints,
        point: usize,
        gradient: &Matrix3<f64>,
    ) -> [f64; 6] {
        components(&self.of_total_strain(elastic, point, gradient).stress)
    }

    /// A point without its stress-free strain.
    fn of_total_strain(
        &self,
        elastic: &ElasticPoints,
        point: usize,
        gradient: &Matrix3<f64>,
    ) -> Stressed<'_> {
        let at = BodyPoint {
            free: FreeStrain::isotropic(0.0),
            ..self.at(elastic, point, [1.0; 3])
        };
        self.stressed(at, gradient)
    }

    /// A point in the trial state.
    fn stressed<'a>(&self, at: BodyPoint<'a>, gradient: &Matrix3<f64>) -> Stressed<'a> {
        let state = self.states.tried(at.point.number);
        let gradient = self.law.complete(&at, gradient, state);
        Stressed {
            stress: self.law.piola(&at, &gradient, state),
            gradient,
            at,
        }
    }
}

/// A point with its complete gradient of the displacement and its stress P, Pa.
struct Stressed<'a> {
    at: BodyPoint<'a>,
    gradient: Matrix3<f64>,
    stress: Matrix3<f64>,
}
