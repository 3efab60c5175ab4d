//! Two fluids on one lattice: how the fraction of the first one is carried and kept in a thin layer, and where their interface lies.
//!
//! ```text
//! C_ij = U_ij (c_i + c_j)/2 - Gamma b [2 eps (c_j - c_i) - xi . (q_i + q_j)],   q = c (1 - c) n
//! c'   = c - dt sum_j C_ij,   rho = rho_2 + (rho_1 - rho_2) c,   N_ij = rho_2 U_ij + (rho_1 - rho_2) C_ij
//! n    = grad psi / |grad psi|,   psi = eps ln(c / (1 - c))
//! ```
//!
//! The conservative Allen-Cahn flux of Chiu & Lin (2011) with the normals of Mirjalili & Mani (2021): across a plane interface the fraction is
//! `1 / (1 + exp(-d / eps))` at the distance d. Both fluids keep their masses to rounding. Surface tension is the force
//! `-gamma kappa grad H`, `kappa = div n`, `H = 3 c^2 - 2 c^3`; along a bond `-gamma (kappa_i + kappa_j)/2 (H_j - H_i)`, which a pressure
//! balances where the curvature is uniform.

use nalgebra::Vector3;
use perimelt_core::family::{ByRules, ForeignGhost, Mirrored};
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::{Body, Bond, BondKernel, Family, SlotField};
use rayon::prelude::*;

use super::slots::FlowSlots;
use super::wetted_body::WettedBody;
use super::wetting::Wetting;
use crate::fluid::interface_report::{FirstFluid, InterfaceFlow, InterfaceReport};
use crate::fluid::pair::FluidPair;
use crate::fluid::rates::POINTS_PER_TASK;
use crate::fluid::walls::Walls;

/// Fractions are cut to this distance from 0 and 1 where their logarithm is taken.
const CUT: f64 = 1e-12;

/// Least speed at which the layer is kept thin, over that of capillary waves of the spacing. A drop that moves is braked by tension times its speed
/// over that of the layer; explicit steps allow hardly more.
const LEAST_MOBILITY: f64 = 0.15;

/// A speed, over that of capillary waves of the spacing, that is small beside those to which tension drives the fluids.
const SMALL_SPEED: f64 = 0.05;

/// `sum_j b xi (f_j - f_i)`.
pub(super) struct Gradient {
    /// `1 / a`, 1/m.
    pub(super) inverse: f64,
}

impl<const D: usize> BondKernel<1, D> for Gradient {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; 1], other: [f64; 1]) -> [f64; D] {
        let part = bond.weight * self.inverse * (other[0] - own[0]);
        let mut sums = [0.0; D];
        for (sum, xi) in sums.iter_mut().zip(bond.xi) {
            *sum = part * xi;
        }
        sums
    }
}

/// `sum_j b xi . (f_j - f_i)`.
struct Divergence {
    /// `1 / a`, 1/m.
    inverse: f64,
}

impl<const D: usize> BondKernel<D, 1> for Divergence {
    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; D], other: [f64; D]) -> [f64; 1] {
        let mut sum = 0.0;
        for a in 0..D {
            sum += bond.xi[a] * (other[a] - own[a]);
        }
        [bond.weight * self.inverse * sum]
    }
}

/// The fraction of the first fluid, and the interface that follows from it.
#[derive(Debug)]
pub(super) struct Phase {
    pub(super) pair: FluidPair,
    /// By point.
    pub(super) fraction: Vec<f64>,
    wetting: Wetting,
    /// Gradient of the distance, rows of points.
    gradient: Vec<f64>,
    pub(super) curvature: Vec<[f64; 1]>,
    /// By slot: distance, m, steepness of the distance, and normals into the first fluid.
    distance: SlotField,
    steepness: SlotField,
    pub(super) normal: Vec<SlotField>,
}

impl Phase {
    pub(super) fn new(
        pair: FluidPair,
        body: &Body,
        walls: &Walls,
        bodies: Vec<WettedBody>,
        stencil: Vec<([f64; 3], f64)>,
    ) -> Self {
        let (dimension, points) = (body.dimension, body.points.len());
        Phase {
            wetting: Wetting::new(&pair, body, walls, bodies, stencil),
            pair,
            fraction: vec![0.0; points],
            gradient: vec![0.0; points * dimension],
            curvature: vec![[0.0]; points],
            distance: SlotField::default(),
            steepness: SlotField::default(),
            normal: vec![SlotField::default(); dimension],
        }
    }

    /// Finds the interface.
    pub(super) fn find<const D: usize>(
        &mut self,
        bonds: InterfaceBonds<'_>,
        slots: &mut FlowSlots,
    ) {
        let InterfaceBonds {
            family,
            walls,
            spacing,
            inverse,
        } = bonds;
        let fraction = &self.fraction;
        let eps = self.pair.width * spacing;
        let distance = |i: usize| {
            let c = fraction[i].clamp(CUT, 1.0 - CUT);
            eps * (c / (1.0 - c)).ln()
        };
        (self.distance).load(family, distance, self.wetting.distance());
        let (gradient, _) = self.gradient.as_chunks_mut::<D>();
        family.sum(&Gradient { inverse }, [&self.distance], gradient);
        for (body, wall) in self.wetting.bodies.iter_mut().zip(&walls.bodies) {
            body.find_distance(distance);
            let behind = |ghost: &ForeignGhost| Some([body.distance(ghost)?]);
            let own = |point: usize| [distance(point)];
            body.add(wall, &Gradient { inverse }, own, behind, gradient);
        }
        for body in &mut self.wetting.bodies {
            body.find_gradient(|i| {
                Vector3::from_fn(|a, _| gradient[i].get(a).copied().unwrap_or(0.0))
            });
        }
        slots.fraction.load(family, &fraction[..], Mirrored::Scalar);
        self.find_normals::<D>(family, slots);
        let inputs: [&[f64]; D] = std::array::from_fn(|a| &self.normal[a][..]);
        family.sum(&Divergence { inverse }, inputs, &mut self.curvature);
        let own = |i: usize| inputs.map(|along| along[family.slot_of(i)]);
        for (body, wall) in self.wetting.bodies.iter().zip(&walls.bodies) {
            let behind = |ghost: &ForeignGhost| {
                let normal = body.normal(ghost)?;
                Some(std::array::from_fn(|a| normal[a]))
            };
            body.add::<D, 1>(
                wall,
                &Divergence { inverse },
                own,
                behind,
                &mut self.curvature,
            );
        }
        let normal = |i: usize| {
            let along = own(i);
            std::array::from_fn(|a| along.get(a).copied().unwrap_or(0.0))
        };
        (self.wetting).set_curvature(bonds, &self.distance, normal, eps, &mut self.curvature);
        let fraction = &self.fraction;
        let step = |i: usize| {
            let c = fraction[i];
            c * c * (3.0 - 2.0 * c)
        };
        slots.step.load(family, step, Mirrored::Scalar);
    }

    /// Normal in a slot.
    pub(super) fn normal_in<const D: usize>(&self, slot: u32) -> [f64; D] {
        std::array::from_fn(|a| self.normal[a][slot as usize])
    }

    /// Finds normals, and what compresses the layer between the fluids, from the gradient of the distance and the fraction. Behind
    /// faces normals continue by the angle there, and compression by its mirror image: nothing crosses a wall.
    fn find_normals<const D: usize>(&mut self, family: &Family, slots: &mut FlowSlots) {
        let (gradient, _) = self.gradient.as_chunks::<D>();
        for (axis, slots) in self.normal.iter_mut().enumerate() {
            let along = |i: usize| gradient[i][axis];
            slots.load(family, along, ByRules(&self.wetting.gradient, axis));
        }
        let normal = &self.normal;
        let steepness = (0..self.distance.len()).into_par_iter().map(|slot| {
            let mut square = 0.0;
            for along in normal {
                square += along[slot] * along[slot];
            }
            square.sqrt() + f64::MIN_POSITIVE
        });
        self.steepness.set(steepness);
        let FlowSlots {
            fraction,
            compression,
            ..
        } = slots;
        for (axis, (normal, compression)) in self.normal.iter_mut().zip(compression).enumerate() {
            let each = normal.par_iter_mut().zip(&self.steepness[..]);
            let each = each.with_min_len(POINTS_PER_TASK);
            each.for_all(|(along, steepness)| *along /= steepness);
            let each = fraction.par_iter().zip(&normal[..]);
            compression.set(each.map(|(c, along)| c * (1.0 - c) * along));
            compression.fill_ghosts(family, Mirrored::Vector(axis));
        }
    }

    /// Speed at which the layer is kept thin in a flow of this largest speed, m/s.
    pub(super) fn mobility(&self, speed: f64, spacing: f64) -> f64 {
        (self.pair.mobility() * speed).max(self.least_mobility(spacing))
    }

    /// Speed at which the layer is kept thin where nothing flows, m/s.
    pub(super) fn least_mobility(&self, spacing: f64) -> f64 {
        LEAST_MOBILITY * self.pair.capillary_speed(spacing)
    }

    /// Speed, small beside those to which tension and a `pressure` on the interface (Pa) may drive the fluids, m/s.
    pub(super) fn surface_speed(&self, pressure: f64, spacing: f64) -> f64 {
        let density: f64 = self.pair.density.iter().sum();
        let capillary = self.pair.capillary_speed(spacing);
        SMALL_SPEED * capillary.max((pressure / density).sqrt())
    }

    /// What is reported of the interface and the first fluid.
    pub(super) fn measure<const D: usize>(&mut self, measured: Measured<'_>) -> InterfaceReport {
        let Measured {
            family,
            inverse,
            slots,
            body,
            flow,
        } = measured;
        let (slopes, _) = self.gradient.as_chunks_mut::<D>();
        family.sum(&Gradient { inverse }, [&slots.fraction], slopes);
        let steepness = |i: usize| slopes[i].iter().map(|x| x * x).sum::<f64>().sqrt();
        let first = FirstFluid {
            body,
            fraction: &self.fraction,
            volume: &body.points.volume,
            position: &body.points.position,
            flow,
        };
        InterfaceReport::of(&first, steepness)
    }
}

/// Bonds by which the interface is found.
#[derive(Clone, Copy)]
pub(super) struct InterfaceBonds<'a> {
    pub(super) family: &'a Family,
    pub(super) walls: &'a Walls,
    /// m.
    pub(super) spacing: f64,
    /// `1 / a`, 1/m.
    pub(super) inverse: f64,
}

/// Where the interface is measured.
pub(super) struct Measured<'a> {
    pub(super) family: &'a Family,
    /// `1 / a`, 1/m.
    pub(super) inverse: f64,
    pub(super) slots: &'a FlowSlots,
    pub(super) body: &'a Body,
    pub(super) flow: InterfaceFlow<'a>,
}
