//! Non-ordinary state-based solids: a classical stress drives the bonds (correspondence).
//!
//! ```text
//! F = 1 + H,  H = [sum_j w (u_j - u_i) (x) xi] K^-1,  K = sum_j w xi (x) xi      Wang (2025), eqs. 3.15, 3.19
//! P = sigma(H)                 linear kinematics: linear elasticity
//! P = F S,  S = C : (E - e),  E = (F^T F - 1)/2      finite: Saint Venant-Kirchhoff, eqs. 3.16 to 3.18
//! T_ij = w_ij { P K^-1 xi + g z },  z = u_j - u_i - H xi,  g = G 2 d bulk / horizon
//!                                                     eqs. 3.14, 3.20; corrected, see spec 01, 1.4
//! f_i = sum_j T_ij - T_ji
//! ```
//!
//! `w` is the weight of the bond in the family of the owner, `g z` holds back the modes without
//! strain (Silling 2017) and vanishes in every affine deformation. Any uniform strain is exact on any
//! cloud, also at surfaces, and needs no calibration.
//!
//! Bonds break at their critical stretch ([`fracture`](super::fracture)). All sums run over those that are
//! left, K too, so that uniform strain stays exact beside cracks. A *loose* point, whose bonds do not
//! span the dimensions any more, has no strain, no stress and no `g z` of its
//! own; it follows what its neighbours do to it. Not for breaking by the energy of bonds: the stress is
//! that of points, and no bond has an energy of its own.

use std::sync::Arc;

use nalgebra::Matrix3;
use perimelt_core::family::{Continuation, LayerRule};
use perimelt_core::{Body, Bond, BondKernel, BrokenBonds, Family};
use rayon::prelude::*;

use super::classical::{COMPONENTS, Point, diagonal, image_of};
use super::fracture::Fracture;
use super::gradient::{FlatFamily, Gradient, RISE};
use super::moduli::{Elasticity, Moduli};
use super::ordinary::{flat, unflatten};
use super::plasticity::{Plasticity, Strains};
use super::solid::{Of, Solid, continue_displacement};
use super::stretch::{EXCESS_INPUTS, Excess};

/// Inputs of the kernels, in slot space: nine components of `P K^-1 - g H` by rows, the
/// displacement, g.
const INPUTS: usize = 13;
const DISPLACEMENT: usize = 9;
const STABILISATION: usize = 12;

/// `sum_j w |u_j - u_i|^2`, m.
struct SquaredExtension;

impl BondKernel<3, 1> for SquaredExtension {
    const RARE: bool = true;

    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; 3], other: [f64; 3]) -> [f64; 1] {
        [bond.weight * (0..3).fold(0.0, |sum, a| sum + (other[a] - own[a]).powi(2))]
    }
}

/// Force density, N/m³.
struct Force;

impl<const D: usize> BondKernel<INPUTS, D> for Force {
    const PAIRED: usize = D;

    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; INPUTS], other: [f64; INPUTS]) -> [f64; D] {
        let sum = |i: usize| bond.weight * own[i] + bond.dual * other[i];
        let spring = sum(STABILISATION);
        std::array::from_fn(|row| {
            let relative = other[DISPLACEMENT + row] - own[DISPLACEMENT + row];
            (0..D).fold(spring * relative, |f, column| {
                f + sum(3 * row + column) * bond.xi[column]
            })
        })
    }
}

/// Diagonal block of the stiffness but for what the point's own strain adds, which vanishes in
/// complete families. Inputs: `K^-1` as xx, yy, zz, xy, yz, zx, Lamé's constants, g.
struct Block;

impl BondKernel<9, 6> for Block {
    const RARE: bool = true;

    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; 9], other: [f64; 9]) -> [f64; 6] {
        let [x, y, z] = bond.xi;
        let [xx, yy, zz, xy, yz, zx, lame, shear, _] = other;
        let q = [
            xx * x + xy * y + zx * z,
            xy * x + yy * y + yz * z,
            zx * x + yz * y + zz * z,
        ];
        let share = bond.dual * (q[0] * x + q[1] * y + q[2] * z);
        let springs = (bond.weight * own[8] + bond.dual * other[8]) * (1.0 - share).max(0.0);
        let square = q.iter().fold(0.0, |sum, c| sum + c * c);
        let isotropic = bond.dual * bond.dual * shear * square + springs;
        let dyad = bond.dual * bond.dual * (lame + shear);
        [
            dyad * q[0] * q[0] + isotropic,
            dyad * q[1] * q[1] + isotropic,
            dyad * q[2] * q[2] + isotropic,
            dyad * q[0] * q[1],
            dyad * q[1] * q[2],
            dyad * q[2] * q[0],
        ]
    }
}

/// Family, moduli and work arrays of a body.
#[derive(Debug)]
pub struct Correspondence {
    family: Arc<Family>,
    dimension: usize,
    finite: bool,
    elasticity: Elasticity,
    /// G.
    stabilisation: f64,
    /// m, by point.
    horizon: Vec<f64>,
    moduli: Vec<Moduli>,
    eigenstrain: Vec<f64>,
    plasticity: Option<Plasticity>,
    fracture: Option<Fracture>,
    continuation: Continuation,
    slots: [Vec<f64>; INPUTS],
    /// Eigenstrain and critical stretch in slot space; empty where no bond breaks.
    strength: [Vec<f64>; 2],
    /// H of each point.
    gradient: Gradient,
    /// `P K^-1 - g H` of each point.
    drive: Vec<Matrix3<f64>>,
    padded: Vec<f64>,
    energy: Vec<[f64; 2]>,
    tensors: Vec<[f64; 6]>,
}

impl Correspondence {
    /// The operator of `body` with the given family; `stabilisation` is G.
    ///
    /// # Errors
    /// A point whose bonds do not span the dimensions.
    pub fn new(
        body: &Body,
        family: Arc<Family>,
        elasticity: Elasticity,
        finite: bool,
        stabilisation: f64,
        (plasticity, fracture): (Option<Plasticity>, Option<Fracture>),
    ) -> Result<Self, FlatFamily> {
        let (points, dimension) = (body.points.len(), body.dimension);
        let slots = family.slots();
        let breaking = if fracture.is_some() { slots } else { 0 };
        let gradient = Gradient::new(body, family.clone())?;
        let needed = |i: usize| match i {
            STABILISATION => true,
            i if i >= DISPLACEMENT => i - DISPLACEMENT < dimension,
            i => i / 3 < dimension && i % 3 < dimension,
        };
        let mut this = Correspondence {
            dimension,
            finite,
            stabilisation,
            horizon: body
                .points
                .spacing
                .iter()
                .map(|s| family.spec().horizon.of(*s))
                .collect(),
            moduli: body
                .material_of_point
                .iter()
                .map(|&m| elasticity.at(m as usize, 0.0))
                .collect(),
            eigenstrain: vec![0.0; points],
            plasticity,
            continuation: Continuation::default(),
            slots: std::array::from_fn(|i| vec![0.0; if needed(i) { slots } else { 0 }]),
            strength: std::array::from_fn(|_| vec![0.0; breaking]),
            gradient,
            drive: vec![Matrix3::zeros(); points],
            padded: vec![0.0; if dimension == 2 { 2 * points } else { 0 }],
            energy: vec![[0.0; 2]; points],
            tensors: vec![[0.0; 6]; points],
            fracture,
            elasticity,
            family,
        };
        this.load_stabilisation();
        this.load_strength(body, None);
        Ok(this)
    }

    /// g; loose points have none.
    fn spring(&self, point: usize) -> f64 {
        if self.gradient.is_loose(point) {
            return 0.0;
        }
        let bond_stiffness = 2.0 * self.dimension as f64 * self.moduli[point].bulk;
        self.stabilisation * bond_stiffness / self.horizon[point]
    }

    fn load_stabilisation(&mut self) {
        let springs: Vec<f64> = (0..self.moduli.len()).map(|i| self.spring(i)).collect();
        self.family
            .scatter(&springs, 1, 0, &mut self.slots[STABILISATION]);
        self.family
            .fill_layers(&[], 0, &mut self.slots[STABILISATION]);
    }

    fn load_strength(&mut self, body: &Body, temperature: Option<&[f64]>) {
        let Some(fracture) = &mut self.fracture else {
            return;
        };
        fracture.load(body, temperature, |i| self.moduli[i]);
        let slots = &mut self.strength[1];
        self.family.scatter(&fracture.critical, 1, 0, slots);
        self.family.fill_layers(&[], 0, slots);
    }

    fn broken(&self) -> Option<&BrokenBonds> {
        self.fracture.as_ref().map(|f| &f.state.broken)
    }

    fn point(&self, i: usize, of: Of) -> Point {
        let law = match of {
            Of::Elastic => self.law(i),
            Of::Total | Of::Change => self.law(i).of_change(),
        };
        match (&self.plasticity, of) {
            (None, _) | (_, Of::Total) => law,
            (Some(p), Of::Elastic) => law.with_inelastic(p.stress_state, p.tried[i].strain),
            (Some(p), Of::Change) => law.with_inelastic(p.stress_state, p.change[i]),
        }
    }

    /// The elastic law of a point.
    fn law(&self, i: usize) -> Point {
        match self.gradient.is_loose(i) {
            true => Point::loose(self.moduli[i], self.dimension),
            false => Point::new(self.moduli[i], self.eigenstrain[i], self.dimension),
        }
    }

    fn strains(&self) -> Strains<'_> {
        Strains {
            gradients: &self.gradient.values,
            finite: self.finite,
            plane_strain: self.elasticity.is_plane_strain(),
        }
    }

    /// Returns the stresses of the gradients that were loaded to the flow stress.
    fn flow(&mut self) {
        if let Some(mut plasticity) = self.plasticity.take() {
            plasticity.try_strains(self.strains(), |i| self.law(i));
            self.plasticity = Some(plasticity);
        }
    }

    /// Evaluates H of the displacement that was set.
    fn load_gradient(&mut self) {
        let axes = std::array::from_fn(|axis| &self.slots[DISPLACEMENT + axis][..]);
        let broken = self.fracture.as_ref().map(|f| &f.state.broken);
        if self.gradient.evaluate(axes, broken) {
            self.load_stabilisation();
        }
    }

    /// Evaluates the stress and loads what drives the bonds.
    fn load_drive(&mut self, of: Of, finite: bool) {
        let mut drive = std::mem::take(&mut self.drive);
        let mut slots = std::mem::take(&mut self.slots);
        let drive_of = |point: Point, i, gradient: &Matrix3<f64>, inverse: &Matrix3<f64>| {
            point.piola(gradient, finite) * inverse - self.spring(i) * gradient
        };
        drive.par_iter_mut().enumerate().for_each(|(i, drive)| {
            let point = self.point(i, of);
            *drive = drive_of(
                point,
                i,
                &self.gradient.values[i],
                &self.gradient.inverse_shape[i],
            );
        });
        // nalgebra stores columns
        let flat: &[f64] = bytemuck::cast_slice(&drive);
        for (row, column) in self.entries() {
            let slots = &mut slots[3 * row + column];
            self.family.scatter(flat, 9, 3 * column + row, slots);
        }
        for image in self.family.images(&self.continuation) {
            let (scale, mirror) = (diagonal(image.scale), diagonal(image.mirror));
            let gradient = scale * self.gradient.values[image.point] * mirror + image.bend;
            let inverse = mirror * self.gradient.inverse_shape[image.point] * mirror;
            let mut point = self.point(image.point, of);
            if let Some(plasticity) = &self.plasticity {
                let inelastic = image_of(&scale, &point.inelastic, &mirror);
                point = point.with_inelastic(plasticity.stress_state, inelastic);
            }
            let drive = drive_of(point, image.point, &gradient, &inverse);
            for (row, column) in self.entries() {
                slots[3 * row + column][image.slot] = drive[(row, column)];
            }
        }
        (self.drive, self.slots) = (drive, slots);
    }

    /// Rows and columns of tensors in the dimensions that there are.
    fn entries(&self) -> impl Iterator<Item = (usize, usize)> + use<> {
        let dimension = self.dimension;
        (0..dimension).flat_map(move |row| (0..dimension).map(move |column| (row, column)))
    }

    fn inputs(&self) -> [&[f64]; INPUTS] {
        self.slots.each_ref().map(|s| match s.is_empty() {
            true => &self.gradient.zeros[..],
            false => s,
        })
    }

    fn sum_forces(&mut self, out: &mut [f64]) {
        match self.dimension {
            2 => self.sum_forces_in::<2>(out),
            _ => self.sum_forces_in::<3>(out),
        }
    }

    fn sum_forces_in<const D: usize>(&mut self, out: &mut [f64]) {
        let mut padded = std::mem::take(&mut self.padded);
        let inputs = self.inputs();
        let sums = flat::<D>(&mut padded, bytemuck::cast_slice_mut(out));
        self.family
            .sum_unbroken(&Force, inputs, self.broken(), sums);
        unflatten::<D>(&padded, out);
        self.padded = padded;
    }

    /// Sums up by how much bonds exceed their critical stretch.
    fn watch_bonds(&mut self) {
        let Some(mut fracture) = self.fracture.take() else {
            return;
        };
        let (inputs, broken) = (self.watched(), Some(&fracture.state.broken));
        let sums = bytemuck::cast_slice_mut(&mut fracture.excess);
        match self.finite {
            true => (self.family).sum_unbroken(&Excess::<true>, inputs, broken, sums),
            false => (self.family).sum_unbroken(&Excess::<false>, inputs, broken, sums),
        }
        self.fracture = Some(fracture);
    }

    /// Inputs of [`Excess`].
    fn watched(&self) -> [&[f64]; EXCESS_INPUTS] {
        let inputs = self.inputs();
        let [eigenstrain, critical] = &self.strength;
        std::array::from_fn(|i| match i {
            3 => &eigenstrain[..],
            4 => critical,
            axis => inputs[DISPLACEMENT + axis],
        })
    }
}

impl Solid for Correspondence {
    fn set_moduli(&mut self, body: &Body, temperature: Option<&[f64]>) {
        let constant = self.elasticity.uniform().is_some();
        if !constant {
            let elasticity = &self.elasticity;
            let points = self.moduli.par_iter_mut().zip(&body.material_of_point);
            points.enumerate().for_each(|(i, (moduli, &m))| {
                *moduli = elasticity.at(m as usize, temperature.map_or(0.0, |t| t[i]));
            });
            self.load_stabilisation();
        }
        if !(constant && self.fracture.as_ref().is_some_and(Fracture::is_constant)) {
            self.load_strength(body, temperature);
        }
    }

    fn set_stiffest_moduli(&mut self, body: &Body) {
        for (moduli, &m) in self.moduli.iter_mut().zip(&body.material_of_point) {
            *moduli = self.elasticity.stiffest(m as usize);
        }
        self.load_stabilisation();
    }

    fn set_eigenstrain(&mut self, eigenstrain: &[f64]) {
        for ((own, e), moduli) in self
            .eigenstrain
            .iter_mut()
            .zip(eigenstrain)
            .zip(&self.moduli)
        {
            *own = e * moduli.swelling;
        }
        if self.fracture.is_some() {
            let slots = &mut self.strength[0];
            self.family.scatter(&self.eigenstrain, 1, 0, slots);
            self.family.fill_layers(&[], 0, slots);
        }
    }

    fn set_displacement(&mut self, displacement: &[f64], rules: &[LayerRule]) {
        let mut slots = std::mem::take(&mut self.slots);
        let mut continuation = std::mem::take(&mut self.continuation);
        let vector = &mut slots[DISPLACEMENT..DISPLACEMENT + self.dimension];
        continue_displacement(
            &self.family,
            (displacement, rules),
            (vector, &mut continuation),
            |i| (self.moduli[i], self.eigenstrain[i]),
        );
        (self.slots, self.continuation) = (slots, continuation);
    }

    fn force(&mut self, out: &mut [f64]) {
        self.load_gradient();
        self.flow();
        self.load_drive(Of::Elastic, self.finite);
        self.sum_forces(out);
        self.watch_bonds();
    }

    fn stiffness(&mut self, out: &mut [f64]) {
        self.load_gradient();
        self.load_drive(Of::Total, false);
        self.sum_forces(out);
        out.par_iter_mut().for_each(|f| *f = -*f);
    }

    fn flows_by_its_own_strain(&self) -> bool {
        true
    }

    fn bonds_shear(&self) -> bool {
        true
    }

    fn linearise(&mut self) {
        if let Some(mut plasticity) = self.plasticity.take() {
            plasticity.linearise(self.strains(), |i| self.law(i));
            self.plasticity = Some(plasticity);
        }
    }

    fn tangent(&mut self, out: &mut [f64]) {
        self.load_gradient();
        if let Some(plasticity) = &mut self.plasticity {
            plasticity.follow(&self.gradient.values);
        }
        self.load_drive(Of::Change, false);
        self.sum_forces(out);
        out.par_iter_mut().for_each(|f| *f = -*f);
    }

    fn blocks(&mut self) -> &[[f64; 6]] {
        let broken = self.fracture.as_ref().map(|f| &f.state.broken);
        if self.gradient.follow(broken) {
            self.load_stabilisation();
        }
        let points = self.moduli.len();
        let mut slots: [Vec<f64>; 9] = std::array::from_fn(|_| vec![0.0; self.family.slots()]);
        let mut field = vec![0.0; points];
        for (slots, (row, column)) in slots.iter_mut().zip(COMPONENTS) {
            let entries = field.iter_mut().zip(&self.gradient.inverse_shape);
            entries.for_each(|(entry, inverse)| *entry = inverse[(row, column)]);
            self.family.scatter(&field, 1, 0, slots);
            for image in self.family.images(&self.continuation) {
                slots[image.slot] = image.mirror[row] * image.mirror[column] * field[image.point];
            }
        }
        let moduli = |m: &Moduli| [m.lame, m.shear];
        for which in 0..2 {
            let entries = field.iter_mut().zip(&self.moduli);
            entries.for_each(|(entry, m)| *entry = moduli(m)[which]);
            self.family.scatter(&field, 1, 0, &mut slots[6 + which]);
            self.family.fill_layers(&[], 0, &mut slots[6 + which]);
        }
        slots[8].copy_from_slice(&self.slots[STABILISATION]);
        let mut tensors = std::mem::take(&mut self.tensors);
        let inputs = slots.each_ref().map(|s| &s[..]);
        self.family
            .sum_unbroken(&Block, inputs, self.broken(), &mut tensors);
        self.tensors = tensors;
        &self.tensors
    }

    fn rise_by_damage(&self) -> f64 {
        self.fracture.as_ref().map_or(1.0, |_| RISE)
    }

    fn energy(&mut self) -> &[[f64; 2]] {
        self.load_gradient();
        let points = self.moduli.len();
        let mut extension = vec![[0.0]; points];
        let inputs = self.inputs();
        let inputs = std::array::from_fn(|axis| inputs[DISPLACEMENT + axis]);
        self.family
            .sum_unbroken(&SquaredExtension, inputs, self.broken(), &mut extension);
        let mut energy = std::mem::take(&mut self.energy);
        for (i, energy) in energy.iter_mut().enumerate() {
            let (gradient, point) = (&self.gradient.values[i], self.point(i, Of::Total));
            let strain = Point::strain(gradient, self.finite);
            let stress = point.stress(&strain);
            // sum_j w |z|^2 = sum_j w |u_j - u_i|^2 - H : H K, with K the inverse of its inverse
            let mut shape = self.gradient.inverse_shape[i];
            (self.dimension..3).for_each(|a| shape[(a, a)] = 1.0);
            // none of a loose point, which has no springs either
            let affine = shape
                .try_inverse()
                .map_or(0.0, |shape| gradient.dot(&(gradient * shape)));
            let modes = 0.5 * self.spring(i) * (extension[i][0] - affine).max(0.0);
            let conjugate = (0..self.dimension).map(|a| stress[(a, a)]).sum::<f64>();
            *energy = [
                0.5 * stress.dot(&strain) + modes,
                conjugate * point.moduli.swelling,
            ];
        }
        self.energy = energy;
        &self.energy
    }

    fn horizon(&self) -> f64 {
        self.horizon.iter().copied().fold(0.0, f64::max)
    }

    fn plasticity(&mut self) -> Option<&mut Plasticity> {
        self.plasticity.as_mut()
    }

    fn fracture(&self) -> Option<&Fracture> {
        self.fracture.as_ref()
    }

    fn fracture_mut(&mut self) -> Option<&mut Fracture> {
        self.gradient.forget();
        self.fracture.as_mut()
    }

    /// Nothing is frozen: the conjugate stress is that of points, which follows the bonds that are left.
    fn break_bonds(&mut self, share: f64, damage: &mut [f64]) -> (Vec<[u32; 2]>, bool) {
        let Some(mut fracture) = self.fracture.take() else {
            return (Vec::new(), false);
        };
        let inputs = self.watched();
        let ratio = |bond: &Bond, own: usize, other: usize| {
            let [own, other] = [own, other].map(|slot| inputs.map(|i| i[slot]));
            let (stretch, limit) = match self.finite {
                true => Excess::<true>::stretch_and_limit(bond, own, other),
                false => Excess::<false>::stretch_and_limit(bond, own, other),
            };
            stretch / limit
        };
        let broken = fracture.break_bonds(&self.family, share, damage, ratio, |_, _, _| 0.0);
        self.fracture = Some(fracture);
        broken
    }

    fn family(&self) -> &Family {
        &self.family
    }

    fn material_stress(&mut self) -> Vec<[f64; 6]> {
        let plasticity = self.plasticity.as_ref();
        plasticity.map_or_else(Vec::new, |p| {
            p.tried_stress(self.strains(), |i| self.law(i))
        })
    }

    fn moduli_of(&self, point: usize) -> Moduli {
        self.moduli[point]
    }

    /// Cauchy stress under finite kinematics.
    fn stress(&mut self) -> &[[f64; 6]] {
        self.load_gradient();
        let mut tensors = std::mem::take(&mut self.tensors);
        for (i, tensor) in tensors.iter_mut().enumerate() {
            let (gradient, point) = (&self.gradient.values[i], self.point(i, Of::Elastic));
            let mut stress = point.piola(gradient, self.finite);
            if self.finite {
                let deformation = Matrix3::identity() + gradient;
                stress = stress * deformation.transpose() / deformation.determinant();
            }
            *tensor = point.components(&stress, self.elasticity.is_plane_strain());
        }
        self.tensors = tensors;
        &self.tensors
    }

    fn force_across(&mut self, plane: (usize, f64), receive: &mut dyn FnMut(usize, [f64; 3])) {
        self.load_gradient();
        self.load_drive(Of::Elastic, self.finite);
        self.family
            .sum_across(&Force, (self.inputs(), self.broken()), plane, receive);
    }
}
