//! Forces, stresses and energies of a laminate.

use perimelt_core::family::{AxisPlane, BrokenBonds, Mirrored};
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::{BondKernel, Family};
use rayon::prelude::*;

use super::failure::Failure;
use super::interface::Interface;
use super::kernels::{
    Dilatation, INPUTS, InterfaceEnergy, InterfaceForce, PRESSURE, PlyEnergy, PlyForce, PlyStress,
    SHEAR_INPUTS, STRAIN, across,
};
use super::weights::PlyBonds;
use super::{Laminate, LayerSolid, Work};
use crate::mechanical::specialise::specialise;

/// Kinematics, and whether strains are without their stress-free part.
#[derive(Clone, Copy, Debug)]
pub(super) struct Strained {
    pub(super) finite: bool,
    /// Otherwise strains are total ones.
    pub(super) elastic: bool,
}

impl LayerSolid {
    /// The inputs of the kernels; `zeros` take the place of the stress-free strain in total strains.
    pub(super) fn inputs<'a>(&'a self, elastic: bool, zeros: &'a [f64]) -> [&'a [f64]; INPUTS] {
        std::array::from_fn(
            |input| match (STRAIN..PRESSURE).contains(&input) && !elastic {
                true => zeros,
                false => &self.slots[input],
            },
        )
    }
}

/// Bonds of a layer that are summed over: all, or those of the matrix or of the fibres alone.
pub(super) struct Part<'a> {
    bonds: PlyBonds,
    inputs: [&'a [f64]; INPUTS],
    pub(super) broken: Option<&'a BrokenBonds>,
}

/// What is summed over in a layer: its bonds, or matrix and fibres by themselves once bonds of either broke.
pub(super) type Parts<'a> = [Option<Part<'a>>; 2];

impl LayerSolid {
    /// The parts of the bonds, with those of matrix and fibres that are `broken`. `zeros` take the place of the stress-free strain in total
    /// strains, and of the dilatation of fibres.
    pub(super) fn parts<'a>(
        &'a self,
        elastic: bool,
        zeros: &'a [f64],
        broken: Option<[&'a BrokenBonds; 2]>,
    ) -> Parts<'a> {
        let inputs = self.inputs(elastic, zeros);
        let part = |bonds, inputs, broken| {
            Some(Part {
                bonds,
                inputs,
                broken,
            })
        };
        let Some([matrix, fibres]) = broken else {
            return [part(self.bonds, inputs, None), None];
        };
        let mut of_fibres = inputs;
        of_fibres[PRESSURE] = zeros;
        let fibres = part(self.bonds.of_fibres(), of_fibres, Some(fibres));
        [
            part(self.bonds.of_matrix(), inputs, Some(matrix)),
            fibres.filter(|_| self.bonds.has_fibres()),
        ]
    }
}

/// Sums a kernel, by its bonds, over the parts of a layer; `added` is a work array.
pub(super) fn sum_parts<const O: usize, K: BondKernel<INPUTS, O>>(
    plane: &Family,
    parts: &Parts<'_>,
    kernel: impl Fn(PlyBonds) -> K,
    sums: &mut [[f64; O]],
    added: &mut Vec<f64>,
) {
    let [first, second] = parts;
    if let Some(part) = first {
        plane.sum_unbroken(&kernel(part.bonds), part.inputs, part.broken, sums);
    }
    if let Some(part) = second {
        added.resize(O * sums.len(), 0.0);
        let added = bytemuck::cast_slice_mut(added);
        plane.sum_unbroken(&kernel(part.bonds), part.inputs, part.broken, added);
        let both = sums.par_iter_mut().zip(&*added).with_min_len(4096);
        both.for_all(|(sums, added): (&mut [f64; O], &[f64; O])| {
            (0..O).for_each(|n| sums[n] += added[n]);
        });
    }
}

impl Interface {
    /// The inputs of the kernels, with the displacements of both layers.
    pub(super) fn inputs<'a>(
        &'a self,
        lower: &'a LayerSolid,
        upper: &'a LayerSolid,
    ) -> [&'a [f64]; SHEAR_INPUTS] {
        std::array::from_fn(|n| match n {
            0..3 => &lower.slots[n][..],
            3..6 => &upper.slots[n - 3],
            _ => &self.slots[n - 6],
        })
    }

    /// Stretch across the plies between two points without its stress-free part, and the direction of their bond.
    #[inline(always)]
    pub(super) fn across(
        &self,
        strained: Strained,
        displacement: [[f64; 3]; 2],
        free: [f64; 2],
    ) -> (f64, [f64; 3]) {
        let [lower, upper] = displacement;
        let relative = std::array::from_fn(|a| upper[a] - lower[a]);
        let free = match strained.elastic {
            true => self.fractions[0] * free[0] + self.fractions[1] * free[1],
            false => 0.0,
        };
        across(strained.finite, self.crossing.distance, relative, free)
    }
}

/// Broken bonds of matrix and fibres of a layer; `None` where none broke.
pub(super) fn broken_in(failure: Option<&Failure>, layer: usize) -> Option<[&BrokenBonds; 2]> {
    failure.and_then(|failure| failure.of_layer(layer))
}

impl Laminate {
    /// Loads the pressure of the dilatation in all layers, and passes the dilatation of each point to `receive`.
    pub(super) fn load_pressure(
        &mut self,
        strained: Strained,
        mut receive: impl FnMut(usize, f64, f64),
    ) {
        let points = self.points_of_layer();
        for (number, layer) in self.layers.iter_mut().enumerate() {
            if !layer.has_dilatation {
                continue;
            }
            let (plane, theta) = (&self.plane, &mut self.work.scalars);
            let inputs = layer.inputs(strained.elastic, &self.zeros);
            let broken = broken_in(self.failure.as_ref(), number).map(|[matrix, _]| matrix);
            specialise!(FINITE = strained.finite =>
                plane.sum_unbroken(&Dilatation::<FINITE>, inputs, broken, theta));
            let a = &layer.dilatation;
            for (point, [theta]) in theta.iter().enumerate() {
                receive(number * points + point, *theta, a[point]);
            }
            let pressure = |point: usize| 2.0 * a[point] * theta[point][0];
            layer.slots[PRESSURE].load(plane, pressure, Mirrored::Scalar);
        }
    }

    /// Force density of all bonds, N/m³.
    pub(super) fn sum_forces(&mut self, strained: Strained, out: &mut [f64]) {
        self.load_pressure(strained, |_, _, _| {});
        let points = self.points_of_layer();
        let (out, _) = out.as_chunks_mut::<3>();
        let layers = self.layers.iter().enumerate();
        for ((number, layer), out) in layers.zip(out.chunks_mut(points)) {
            let broken = broken_in(self.failure.as_ref(), number);
            let parts = layer.parts(strained.elastic, &self.zeros, broken);
            let (plane, added) = (&self.plane, &mut self.work.added);
            specialise!(FINITE = strained.finite, BY_POINT = !self.plies.is_uniform =>
                sum_parts(plane, &parts, PlyForce::<FINITE, BY_POINT>, out, added));
        }
        for number in 0..self.interfaces.len() {
            self.sum_crossing(number, strained);
            let (lower, upper) = out.split_at_mut((number + 1) * points);
            let lower = lower[number * points..].par_iter_mut().with_min_len(4096);
            let thickness = [number, number + 1].map(|l| 1.0 / self.layers[l].thickness);
            let across = self.pull_across(number, strained);
            let both = lower.zip(&mut upper[..points]).zip(&self.work.pairs);
            both.enumerate()
                .for_all(|(point, ((lower, upper), force))| {
                    let across = across(point);
                    for axis in 0..3 {
                        lower[axis] += thickness[0] * (force[axis] + across[axis]);
                        upper[axis] += thickness[1] * (force[3 + axis] - across[axis]);
                    }
                });
        }
    }

    /// Forces of an interface on the points below and above it, per area, Pa.
    pub(super) fn sum_interface(&mut self, number: usize, strained: Strained) {
        self.sum_crossing(number, strained);
        let mut sums = std::mem::take(&mut self.work.pairs);
        let across = self.pull_across(number, strained);
        let each = sums.par_iter_mut().enumerate().with_min_len(4096);
        each.for_all(|(point, force)| {
            let across = across(point);
            for axis in 0..3 {
                force[axis] += across[axis];
                force[3 + axis] -= across[axis];
            }
        });
        drop(across);
        self.work.pairs = sums;
    }

    /// Forces of the pairs of crossing bonds of an interface.
    fn sum_crossing(&mut self, number: usize, strained: Strained) {
        let interface = &self.interfaces[number];
        let inputs = interface.inputs(&self.layers[number], &self.layers[number + 1]);
        let (crossing, sums) = (interface.crossing, &mut self.work.pairs);
        let failure = self.failure.as_ref();
        let broken = failure.map(|failure| failure.of_interface(number));
        specialise!(FINITE = strained.finite, BY_POINT = !self.plies.is_uniform =>
        self.plane.sum_unbroken(
            &InterfaceForce::<FINITE, BY_POINT>(crossing),
            inputs,
            broken,
            sums,
        ));
    }

    /// The force of the bond across an interface on the lower one of the points above each other, per area, Pa.
    fn pull_across(
        &self,
        number: usize,
        strained: Strained,
    ) -> impl Fn(usize) -> [f64; 3] + Sync + '_ {
        let points = self.points_of_layer();
        let interface = &self.interfaces[number];
        let failure = self.failure.as_ref();
        move |point| {
            if failure.is_some_and(|failure| failure.is_open(number, point)) {
                return [0.0; 3];
            }
            let both = [number * points + point, (number + 1) * points + point];
            let displacement = both.map(|p| self.displacement[p]);
            let free = both.map(|p| self.strain_across(p));
            let (stretch, direction) = interface.across(strained, displacement, free);
            direction.map(|n| interface.modulus[point] * stretch * n)
        }
    }

    /// Stretch of the bond of a point across an interface.
    pub(super) fn stretch_across(&self, number: usize, point: usize, strained: Strained) -> f64 {
        let points = self.points_of_layer();
        let both = [number, number + 1].map(|layer| layer * points + point);
        let displacement = both.map(|p| self.displacement[p]);
        let free = both.map(|p| self.strain_across(p));
        let (stretch, _) = self.interfaces[number].across(strained, displacement, free);
        stretch
    }

    /// Stress-free strain of a point across the plies.
    pub(super) fn strain_across(&self, point: usize) -> f64 {
        self.strain.get(point).map_or(0.0, |strain| strain[2])
    }

    /// Stress of each point: in the plane from its layer, across it the mean of the two interfaces beside it, which are
    /// zero at the surfaces.
    pub(super) fn sum_stress(&mut self, strained: Strained) {
        self.sum_stress_of_layers(strained, false);
        let points = self.points_of_layer();
        for number in 0..self.interfaces.len() {
            self.sum_interface(number, strained);
            for (point, [x, y, z, ..]) in self.work.pairs.iter().enumerate() {
                for layer in [number, number + 1] {
                    let tensor = &mut self.base.tensors[layer * points + point];
                    tensor[2] += 0.5 * z;
                    tensor[4] += 0.5 * y;
                    tensor[5] += 0.5 * x;
                }
            }
        }
    }

    /// The stress conjugate to the stress-free strain of each point, with what broken bonds carried.
    pub(super) fn sum_conjugate_stress(&mut self, finite: bool) {
        self.sum_conjugate_of_bonds(finite);
        if let Some(failure) = &self.failure {
            let frozen = failure.state.frozen.iter();
            for (tensor, frozen) in self.base.tensors.iter_mut().zip(frozen) {
                (0..6).for_each(|c| tensor[c] += frozen[c]);
            }
        }
    }

    /// The stress conjugate to the stress-free strain of each point by unbroken bonds.
    pub(super) fn sum_conjugate_of_bonds(&mut self, finite: bool) {
        let strained = Strained {
            finite,
            elastic: false,
        };
        self.sum_stress_of_layers(strained, true);
        let points = self.points_of_layer();
        for (number, interface) in self.interfaces.iter().enumerate() {
            let failure = self.failure.as_ref();
            let is_open = |point| failure.is_some_and(|failure| failure.is_open(number, point));
            for point in (0..points).filter(|point| !is_open(*point)) {
                let both = [number * points + point, (number + 1) * points + point];
                let stretch = self.stretch_across(number, point, strained);
                let stress = interface.modulus[point] * interface.crossing.distance * stretch;
                for (side, point) in both.into_iter().enumerate() {
                    let thickness = self.layers[number + side].thickness;
                    self.base.tensors[point][2] += stress * interface.fractions[side] / thickness;
                }
            }
        }
    }

    /// Stress in the plane of each point by the bonds of its layer; that conjugate to the stress-free strain, if wanted.
    fn sum_stress_of_layers(&mut self, strained: Strained, is_conjugate: bool) {
        self.load_pressure(strained, |_, _, _| {});
        let points = self.points_of_layer();
        let tensors = self.base.tensors.chunks_mut(points);
        for ((number, layer), tensors) in self.layers.iter().enumerate().zip(tensors) {
            let broken = broken_in(self.failure.as_ref(), number);
            let parts = layer.parts(strained.elastic, &self.zeros, broken);
            let Work {
                vectors: sums,
                added,
                ..
            } = &mut self.work;
            specialise!(FINITE = strained.finite =>
            sum_parts(
                &self.plane,
                &parts,
                |bonds| PlyStress::<FINITE> { bonds, is_conjugate },
                sums,
                added,
            ));
            for (tensor, [xx, yy, xy]) in tensors.iter_mut().zip(sums) {
                *tensor = [*xx, *yy, 0.0, *xy, 0.0, 0.0];
            }
        }
    }

    /// Energy density of each point, J/m³: half of that of an interface belongs to either side.
    pub(super) fn sum_energy(&mut self, strained: Strained) {
        let points = self.points_of_layer();
        let mut energy = std::mem::take(&mut self.base.energy);
        energy.fill([0.0; 2]);
        self.load_pressure(strained, |point, theta, a| {
            energy[point][0] = a * theta * theta
        });
        let layers = self.layers.iter().enumerate();
        for ((number, layer), energy) in layers.zip(energy.chunks_mut(points)) {
            let broken = broken_in(self.failure.as_ref(), number);
            let parts = layer.parts(strained.elastic, &self.zeros, broken);
            let Work {
                scalars: sums,
                added,
                ..
            } = &mut self.work;
            specialise!(FINITE = strained.finite =>
                sum_parts(&self.plane, &parts, PlyEnergy::<FINITE>, sums, added));
            let both = energy.iter_mut().zip(sums);
            both.for_each(|(energy, [sum])| energy[0] += *sum);
        }
        for (number, interface) in self.interfaces.iter().enumerate() {
            let inputs = interface.inputs(&self.layers[number], &self.layers[number + 1]);
            let (crossing, sums) = (interface.crossing, &mut self.work.scalars);
            let failure = self.failure.as_ref();
            let broken = failure.map(|failure| failure.of_interface(number));
            specialise!(FINITE = strained.finite =>
                self.plane.sum_unbroken(&InterfaceEnergy::<FINITE>(crossing), inputs, broken, sums));
            for (point, [sum]) in self.work.scalars.iter().enumerate() {
                let both = [number * points + point, (number + 1) * points + point];
                let stretch = self.stretch_across(number, point, strained);
                let of_opening = match failure.is_some_and(|f| f.is_open(number, point)) {
                    true => 0.0,
                    false => 0.5 * interface.modulus[point] * crossing.distance * stretch * stretch,
                };
                for (layer, point) in [number, number + 1].into_iter().zip(both) {
                    energy[point][0] += 0.5 * (sum + of_opening) / self.layers[layer].thickness;
                }
            }
        }
        self.base.energy = energy;
    }

    /// Passes each point below the plane and the force density of its bonds with points above the plane to `receive`.
    pub(super) fn sum_across(
        &mut self,
        strained: Strained,
        plane: AxisPlane,
        receive: &mut dyn FnMut(usize, [f64; 3]),
    ) {
        if plane.axis == 2 {
            return self.sum_across_layers(strained, plane.at, receive);
        }
        self.load_pressure(strained, |_, _, _| {});
        let points = self.points_of_layer();
        let family: &Family = &self.plane;
        for (number, layer) in self.layers.iter().enumerate() {
            let broken = broken_in(self.failure.as_ref(), number);
            for part in layer.parts(strained.elastic, &self.zeros, broken) {
                let Some(Part {
                    bonds,
                    inputs,
                    broken,
                }) = part
                else {
                    continue;
                };
                let receive = |point: usize, force| receive(number * points + point, force);
                specialise!(FINITE = strained.finite =>
                family.sum_across(
                    &PlyForce::<FINITE, true>(bonds),
                    inputs,
                    broken,
                    plane,
                    receive,
                ));
            }
        }
        for (number, interface) in self.interfaces.iter().enumerate() {
            let inputs = interface.inputs(&self.layers[number], &self.layers[number + 1]);
            let crossing = interface.crossing;
            let thickness = [number, number + 1].map(|layer| self.layers[layer].thickness);
            let receive = |point: usize, [x, y, z, a, b, c]: [f64; 6]| {
                let [lower, upper] = thickness;
                receive(number * points + point, [x, y, z].map(|f| f / lower));
                receive((number + 1) * points + point, [a, b, c].map(|f| f / upper));
            };
            let failure = self.failure.as_ref();
            let broken = failure.map(|failure| failure.of_interface(number));
            specialise!(FINITE = strained.finite =>
            family.sum_across(
                &InterfaceForce::<FINITE, true>(crossing),
                inputs,
                broken,
                plane,
                receive,
            ));
        }
    }

    /// [`Laminate::sum_across`] for a plane between two layers, at a position along z, m.
    fn sum_across_layers(
        &mut self,
        strained: Strained,
        at: f64,
        receive: &mut dyn FnMut(usize, [f64; 3]),
    ) {
        let points = self.points_of_layer();
        let below = self.heights.partition_point(|z| *z <= at);
        let Some(number) = below.checked_sub(1).filter(|n| *n < self.interfaces.len()) else {
            return;
        };
        self.sum_interface(number, strained);
        let thickness = self.layers[number].thickness;
        for (point, [x, y, z, ..]) in self.work.pairs.iter().enumerate() {
            receive(number * points + point, [x, y, z].map(|f| f / thickness));
        }
    }
}
