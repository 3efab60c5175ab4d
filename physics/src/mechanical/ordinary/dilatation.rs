//! Dilatation of the points and the pressure that it causes.

use nalgebra::Matrix3;
use perimelt_core::family::{ByImage, Continuation, Image};
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::solver::Reducer;
use perimelt_core::{Body, BrokenBonds, Correction, Family};
use rayon::prelude::*;

use super::inputs::Inputs;
use crate::mechanical::classical::{diagonal, image_of, symmetric};
use crate::mechanical::elastic::ElasticPoints;
use crate::mechanical::layer_forces::LayerForces;
use crate::mechanical::plasticity::Plasticity;
use crate::mechanical::solid::StrainKind;
use crate::mechanical::specialise::specialise;
use crate::mechanical::stretch::{
    Dilation, Directions, ElasticDilation, ElasticExpansion, Expansion, INPUTS, PRESSURE,
    TotalWeight,
};

/// Dilatation and pressure of the points of a body.
#[derive(Debug)]
pub(super) struct Dilatation {
    /// `N = d / sum_j w_ij` of each point; without correction of the bonds, that of a full horizon.
    pub(super) normaliser: Vec<f64>,
    /// Dilatation `N sum_j w` of each point under an isotropic strain of one; `d` unless bonds are not corrected.
    of_unit_strain: Vec<f64>,
    /// `sum_j w s` of each point, or of the elastic stretch.
    pub(super) sums: Vec<[f64; 1]>,
    /// The parts of `sums` along the axes, and minus that of the eigenstrain, which the images of points need; empty
    /// without layers.
    parts: Vec<[f64; 4]>,
    /// `sum_j w n (x) n` of each point; empty until it is needed.
    directions: Vec<[f64; 6]>,
    pressure: Vec<f64>,
    /// Whether the points of other processes have their normalisers.
    knows_remote: bool,
}

/// The law by which the pressure of a point follows its dilatation.
pub(super) struct PressureLaw<'a> {
    pub(super) elastic: &'a ElasticPoints,
    pub(super) plasticity: Option<&'a Plasticity>,
    pub(super) layers: &'a LayerForces,
    pub(super) strain: StrainKind,
}

impl PressureLaw<'_> {
    /// Inelastic strain of a point; `None` if there is none.
    fn inelastic(&self, point: usize) -> Option<[f64; 6]> {
        let plasticity = self.plasticity?;
        match self.strain {
            StrainKind::Elastic => Some(plasticity.states.tried()[point].strain),
            StrainKind::Change => Some(plasticity.change[point]),
            StrainKind::Total => None,
        }
    }

    /// `p = 2 a N theta`, Pa, from `theta / N`. The stress of an inelastic strain is `lame tr + 2 mu strain`; bonds contribute
    /// `mu` of the trace instead of `lame`, and the pressure contributes the difference.
    fn pressure(
        &self,
        point: usize,
        normaliser: f64,
        dilation: f64,
        inelastic: Option<[f64; 6]>,
    ) -> f64 {
        let dimension = self.elastic.dimension;
        let moduli = self.elastic.moduli(point);
        let pressure = 2.0 * moduli.dilatation_stiffness(dimension);
        let relieved = inelastic
            .zip(self.plasticity)
            .map_or(0.0, |(strain, plasticity)| {
                let in_plane: f64 = strain[..dimension].iter().sum();
                moduli.lame * plasticity.stress_state.trace(&strain) - moduli.shear * in_plane
            });
        normaliser * (pressure * normaliser * dilation - relieved)
    }
}

/// `N = d / sum_j w_ij` of each point, so that the dilatation of any family is exact under isotropic strain. Without
/// correction the sum is that of a full horizon, `integral of w dV / M`: the published constant `d` (Gao (2020),
/// eq. 2.11). `totals` are the sums of the weights.
fn normaliser(family: &Family, body: &Body, totals: &[[f64; 1]]) -> Vec<f64> {
    let (d, spec) = (body.dimension as f64, family.spec());
    if spec.correction == Correction::None {
        let of_point = |horizon: f64| d * spec.moment(body, horizon) / spec.volume(body, horizon);
        let horizons = body.points.horizons(spec.horizon);
        return horizons.into_iter().map(of_point).collect();
    }
    // remote points have no sums
    let of_total = |total: f64| if total > 0.0 { d / total } else { 0.0 };
    totals.iter().map(|[total]| of_total(*total)).collect()
}

impl Dilatation {
    pub(super) fn new(family: &Family, body: &Body) -> Self {
        let points = body.points.len();
        let parts = if family.has_layers() { points } else { 0 };
        let mut totals = vec![[0.0]; points];
        family.sum(&TotalWeight, [], &mut totals);
        let normaliser = normaliser(family, body, &totals);
        let of_unit_strain = normaliser.iter().zip(&totals);
        let of_unit_strain = of_unit_strain.map(|(n, [total])| n * total).collect();
        Dilatation {
            normaliser,
            of_unit_strain,
            sums: vec![[0.0]; points],
            parts: vec![[0.0; 4]; parts],
            directions: Vec::new(),
            pressure: vec![0.0; points],
            knows_remote: false,
        }
    }

    /// Brings the points of other processes their normalisers, which do not change.
    pub(super) fn bring_normalisers(&mut self, points: &Reducer) {
        if !std::mem::replace(&mut self.knows_remote, true) {
            points.bring(&mut self.normaliser);
        }
    }

    /// Brings the points of other processes what was summed last.
    pub(super) fn bring_sums(&mut self, points: &Reducer) {
        self.bring_normalisers(points);
        points.bring(self.sums.as_flattened_mut());
        if !self.parts.is_empty() {
            points.bring(self.parts.as_flattened_mut());
        }
    }

    /// Sums the stretches of the displacement that was loaded, of a kind of strain.
    pub(super) fn sum(
        &mut self,
        strain: StrainKind,
        finite: bool,
        inputs: &Inputs,
        broken: Option<&BrokenBonds>,
    ) {
        let Self { sums, parts, .. } = self;
        let is_elastic = strain == StrainKind::Elastic;
        let has_tensor = is_elastic && inputs.has_tensor();
        let has_eigenstrain = is_elastic && !inputs.is_free_of_eigenstrain();
        if parts.is_empty() {
            specialise!(FINITE = finite => match (has_tensor, has_eigenstrain) {
                (true, _) => inputs.sum_with_tensor(ElasticDilation::<FINITE>, broken, sums),
                (false, true) => inputs.sum::<INPUTS, 1>(&ElasticDilation::<FINITE>, broken, sums),
                (false, false) => inputs.sum::<3, 1>(&Dilation::<FINITE>, broken, sums),
            });
            return;
        }
        specialise!(FINITE = finite => match (has_tensor, has_eigenstrain) {
            (true, _) => inputs.sum_with_tensor(ElasticExpansion::<FINITE>, broken, parts),
            (false, true) => inputs.sum::<INPUTS, 4>(&ElasticExpansion::<FINITE>, broken, parts),
            (false, false) => inputs.sum::<3, 4>(&Expansion::<FINITE>, broken, parts),
        });
        let sums = sums.par_iter_mut().zip(parts).with_min_len(4096);
        sums.for_all(|(sum, [x, y, z, eigenstrain])| *sum = [*x + *y + *z - *eigenstrain]);
    }

    /// Loads the pressure of the dilatation that was summed last.
    pub(super) fn load_pressure(
        &mut self,
        law: &PressureLaw<'_>,
        family: &Family,
        inputs: &mut Inputs,
        continuation: &Continuation,
    ) {
        let (normaliser, sums) = (&self.normaliser, &self.sums);
        let pressures = self.pressure.par_iter_mut().enumerate();
        pressures.for_all(|(i, pressure)| {
            *pressure = law.pressure(i, normaliser[i], sums[i][0], law.inelastic(i));
        });
        let bent = continuation.is_bent();
        let of_image = |image: &Image| [self.pressure_of_image(law, image, bent)];
        let ghosts = ByImage(continuation, of_image);
        inputs.slots[PRESSURE].load(family, &self.pressure[..], ghosts);
    }

    /// Pressure of the mirror image of a point, Pa.
    fn pressure_of_image(&self, law: &PressureLaw<'_>, image: &Image, bent: bool) -> f64 {
        let point = image.point;
        let [x, y, z, eigenstrain] = self.parts[point];
        let sums = [x, y, z];
        // a state that gives way to other forces keeps the pressure of no strain where the layer is constant
        let mut sums: [f64; 3] = match law.layers.replace(image) {
            true => [0.0; 3],
            false => std::array::from_fn(|a| image.scale[a] * image.mirror[a] * sums[a]),
        };
        if bent {
            let mirror = Matrix3::from_diagonal(&image.mirror.into());
            let directions = mirror * symmetric(&self.directions[point]) * mirror;
            sums[0] += image.bend.dot(&directions);
        }
        let dilation = sums.iter().sum::<f64>() - eigenstrain;
        let inelastic = law.inelastic(point).map(|strain| {
            let [scale, mirror] = [image.scale, image.mirror].map(diagonal);
            image_of(&scale, &strain, &mirror)
        });
        law.pressure(point, self.normaliser[point], dilation, inelastic)
    }

    /// Sums what bent layers and the conjugate stress need.
    pub(super) fn sum_directions(
        &mut self,
        inputs: &Inputs,
        broken: Option<&BrokenBonds>,
        points: &Reducer,
    ) {
        if self.directions.is_empty() {
            self.directions = vec![[0.0; 6]; self.sums.len()];
            inputs.sum::<INPUTS, 6>(&Directions, broken, &mut self.directions);
            points.bring(self.directions.as_flattened_mut());
        }
    }

    /// Dilatation of a point, from the stretches that were summed last.
    pub(super) fn of(&self, point: usize) -> f64 {
        self.normaliser[point] * self.sums[point][0]
    }

    /// Energy density of the dilatation of a point (J/m³), from the stretches that were summed last. Its derivative is the
    /// pressure of [`PressureLaw`].
    pub(super) fn energy(
        &self,
        elastic: &ElasticPoints,
        plasticity: Option<&Plasticity>,
        point: usize,
    ) -> f64 {
        let (moduli, d) = (elastic.moduli(point), elastic.dimension);
        let dilatation = self.of(point);
        let mut energy = moduli.dilatation_stiffness(d) * dilatation * dilatation;
        if let Some(plasticity) = plasticity {
            let strain = &plasticity.states.tried()[point].strain;
            let in_plane: f64 = strain[..d].iter().sum();
            let trace = plasticity.stress_state.trace(strain);
            let relieved = moduli.lame * trace - moduli.shear * in_plane;
            energy -= relieved * (dilatation - 0.5 * in_plane);
        }
        energy
    }

    /// Contribution of the stretches that were summed last to the stress conjugate to the eigenstrain as a tensor, Pa.
    pub(super) fn conjugate_stress_tensor(
        &self,
        elastic: &ElasticPoints,
        point: usize,
    ) -> [f64; 6] {
        let a = elastic
            .moduli(point)
            .dilatation_stiffness(elastic.dimension);
        let pressure = 2.0 * a * self.of(point) * self.normaliser[point];
        self.directions[point].map(|direction| pressure * direction)
    }

    /// Contribution of `sum_j w s` to the stress conjugate to the eigenstrain, Pa.
    pub(super) fn conjugate_stress(
        &self,
        elastic: &ElasticPoints,
        point: usize,
        dilation: f64,
    ) -> f64 {
        let a = elastic
            .moduli(point)
            .dilatation_stiffness(elastic.dimension);
        let theta = self.normaliser[point] * dilation;
        2.0 * a * theta * self.of_unit_strain[point]
    }
}
