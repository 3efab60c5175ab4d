//! Limits of the bonds of a laminate at the temperature of each point.
//!
//! Bonds of plies and pairs of crossing bonds have the mean of the limits of both ends. An interface has the smaller fracture energy of
//! the points that it connects.

use perimelt_core::family::Mirrored;
use perimelt_core::{Body, Family, SlotField};

use super::LayerSolid;
use super::constants::PlyConstants;
use super::crack::{CrackEnergy, opening_limit, published_energy, shear_limit};
use super::failure::LaminateParts;
use super::interface::Interface;
use super::kernels::MODULI;
use super::strength::{PlyStrength, Strength};
use crate::mechanical::fracture::Limits;

/// Limits of the bonds of each set.
#[derive(Debug)]
pub(super) struct SetLimits {
    strength: PlyStrength,
    /// m.
    horizon: f64,
    /// Of cracks along the fibres, by layer.
    cracks: Vec<CrackEnergy>,
    /// By interface, the sum of `w |xi|` times the stiffness of a bond over each of the shear moduli.
    sums: Vec<[f64; MODULI]>,
    /// By point of the body.
    strengths: Vec<Strength>,
    /// Whether fibres may break.
    pub(super) can_break_fibres: bool,
    /// Stretches of bonds of the matrix in tension, by layer; in compression they are infinite.
    pub(super) matrix: Vec<[SlotField; 2]>,
    /// Stretches of fibres in tension and in compression, by layer.
    pub(super) fibres: Vec<[SlotField; 2]>,
    /// Stretches across interfaces, by interface and point of the plane.
    pub(super) opening: Vec<Vec<f64>>,
    /// Angles of pairs of crossing bonds, by interface.
    pub(super) sliding: Vec<SlotField>,
    /// Fracture energies of opening and sliding, by interface and point of the plane, J/m²; infinite where bonds never break.
    pub(super) energies: Vec<Vec<[f64; 2]>>,
}

/// What limits follow from.
pub(super) struct LoadedParts<'a> {
    pub(super) plane: &'a Family,
    /// By point of the body.
    pub(super) constants: &'a [PlyConstants],
    pub(super) interfaces: &'a [Interface],
}

impl SetLimits {
    /// Limits that are not loaded.
    pub(super) fn new(parts: &LaminateParts<'_>, strength: PlyStrength) -> Self {
        let LaminateParts {
            layers,
            plane,
            complete,
            solids,
            interfaces,
        } = *parts;
        let crack = |layer: &LayerSolid| CrackEnergy::new(complete, &layer.bonds);
        let sums = |interface: &Interface| {
            let bonds = &interface.crossing.bonds;
            bonds.map(|bonds| complete.sum_of(|direction| bonds.of(direction)))
        };
        let pairs = || solids.iter().map(|_| Default::default()).collect();
        SetLimits {
            horizon: plane.spec().horizon.of(layers.plane().finest_spacing()),
            cracks: solids.iter().map(crack).collect(),
            sums: interfaces.iter().map(sums).collect(),
            strengths: Vec::new(),
            can_break_fibres: false,
            matrix: pairs(),
            fibres: pairs(),
            opening: vec![vec![0.0; layers.points_of_layer()]; interfaces.len()],
            sliding: interfaces.iter().map(|_| SlotField::default()).collect(),
            energies: vec![vec![[0.0; 2]; layers.points_of_layer()]; interfaces.len()],
            strength,
        }
    }

    /// See [`PlyStrength::mixed_mode_exponent`].
    pub(super) fn mixed_mode_exponent(&self) -> Option<f64> {
        self.strength.mixed_mode_exponent
    }

    /// Whether strengths are the same at all temperatures.
    pub(super) fn has_constant_strength(&self) -> bool {
        self.strength.is_constant()
    }

    /// Evaluates the limits at the temperature of each point, K.
    pub(super) fn load(
        &mut self,
        parts: &LoadedParts<'_>,
        body: &Body,
        temperature: Option<&[f64]>,
    ) {
        let strength = &self.strength;
        let of_point = |(point, material): (usize, &u16)| {
            strength.at(*material, temperature.map_or(0.0, |t| t[point]))
        };
        self.strengths.clear();
        let materials = body.material_of_point.iter().enumerate();
        self.strengths.extend(materials.map(of_point));
        let mut of_fibres = self.strengths.iter().flat_map(|s| s.fibres);
        self.can_break_fibres = of_fibres.any(f64::is_finite);
        self.load_layers(parts);
        self.load_interfaces(parts);
    }

    fn load_layers(&mut self, parts: &LoadedParts<'_>) {
        let LoadedParts {
            plane, constants, ..
        } = *parts;
        let Self {
            strength,
            strengths,
            horizon,
            ..
        } = self;
        let points = plane.points();
        let never = |point: usize| strength.unbreakable[point];
        for (layer, crack) in self.cracks.iter().enumerate() {
            let first = layer * points;
            let of_matrix = |point: usize| {
                let (constants, strength_of_point) = (&constants[point], &strengths[point]);
                let energy = match strength.limits {
                    Limits::Discrete => crack.of(&constants.ply.reduced()),
                    Limits::Published => published_energy(&constants.ply, *horizon),
                };
                match strength_of_point.critical_stretch {
                    stretch if stretch.is_finite() => stretch,
                    _ => (strength_of_point.energies[0] / energy).sqrt(),
                }
            };
            let of_fibres = |point: usize, side: usize| {
                strengths[point].fibres[side] / constants[point].ply.moduli[0]
            };
            let limit = |point: usize, limit: &dyn Fn(usize) -> f64| match never(point) {
                true => f64::INFINITY,
                false => limit(point),
            };
            for side in 0..2 {
                let matrix = |point: usize| match side {
                    0 => limit(first + point, &of_matrix),
                    _ => f64::INFINITY,
                };
                self.matrix[layer][side].load(plane, matrix, Mirrored::Scalar);
                let fibres = |point: usize| limit(first + point, &|p| of_fibres(p, side));
                self.fibres[layer][side].load(plane, fibres, Mirrored::Scalar);
            }
        }
    }

    fn load_interfaces(&mut self, parts: &LoadedParts<'_>) {
        let LoadedParts {
            plane, interfaces, ..
        } = *parts;
        let Self {
            strength,
            strengths,
            ..
        } = self;
        let points = plane.points();
        for (number, interface) in interfaces.iter().enumerate() {
            let distance = interface.crossing.distance;
            let energy = |point: usize, kind: usize| {
                let both = [number, number + 1].map(|layer| layer * points + point);
                match both.iter().any(|point| strength.unbreakable[*point]) {
                    true => f64::INFINITY,
                    false => (both
                        .map(|point| strengths[point].energies[kind])
                        .into_iter())
                    .fold(f64::INFINITY, f64::min),
                }
            };
            for (point, energies) in self.energies[number].iter_mut().enumerate() {
                *energies = [0, 1].map(|kind| energy(point, kind));
            }
            let energies = &self.energies[number];
            for (point, limit) in self.opening[number].iter_mut().enumerate() {
                *limit = opening_limit(interface.modulus[point], distance, energies[point][0]);
            }
            let sums = self.sums[number];
            let angle = |point: usize| {
                let moduli = interface.moduli[point].iter().zip(sums);
                let sum = moduli.map(|(modulus, sum)| modulus * sum).sum();
                shear_limit(sum, distance, energies[point][1])
            };
            self.sliding[number].load(plane, angle, Mirrored::Scalar);
        }
    }
}
