//! Forces of the bonds between points and layer points that are no symmetric images.
//!
//! Behind a face, a layer continues the displacement by a linear map L, `u(layer) = L u + c`. The energy of the body is
//! that of its points, `E = sum_i V_i W_i(u, L u + c)`, and its forces are the derivative
//!
//! ```text
//! V f = -dE/du = -dE/du at fixed layers - L^T dE/du(layer)
//! ```
//!
//! Layer points have no force states of their own: each gives the forces that the states of points exert on it to the
//! points that it follows. Where a layer is odd in its normal component and even in the others, as behind a symmetry
//! plane or a roller, the body and its image form one body, and those forces are what the state of the image would
//! exert: such layers, and layers that are constant in all components, need nothing of this file. Behind a clamped face
//! the state of the image has no such meaning: its forces make the stiffness nonsymmetric, and a body that vibrates
//! gains energy without bound.
//!
//! Solvers of equilibrium take the states of images at all layers: both kinds of forces differ at the points next to the
//! face only, and the displacement of a clamped plate under tension by 0.03 %.
//!
//! In a component in which a layer is constant while it is not in others, layer points keep the part of their states
//! that depends on that component alone.

use perimelt_core::body::Sizes;
use perimelt_core::family::{Continuation, Folded, Image, Layout};
use perimelt_core::parallel::ParallelLoop;
use perimelt_core::{Bond, BondKernel, BrokenBonds, Family, SlotField};
use rayon::prelude::*;

use super::base::Bonds;

/// The bonds of a body to layer points that are no symmetric images.
#[derive(Debug, Default)]
pub(super) struct LayerForces {
    dimension: usize,
    /// Volume of each point, m³; empty for a body that does not move.
    volume: Sizes,
    /// What the bonds were found for.
    layout: Layout,
    owners: Vec<Owner>,
    bonds: Vec<LayerBond>,
    ghosts: Vec<Ghost>,
    /// Points that ghosts follow, with their slots.
    followed: Vec<(usize, usize)>,
    /// Force density of the state of its point along each bond, N/m³.
    pulls: Vec<[f64; 3]>,
    /// Force on each slot, N: one field for each dimension.
    reaction: Vec<SlotField>,
}

/// A point with bonds to layer points.
#[derive(Debug)]
struct Owner {
    point: usize,
    slot: usize,
    /// First and last of its bonds, exclusive.
    bonds: [usize; 2],
}

#[derive(Debug)]
struct LayerBond {
    /// With the weight of its point alone, then with that of the layer point alone.
    halves: [Bond; 2],
    /// Among the bonds of its point.
    number: usize,
    owner: usize,
    ghost: usize,
}

/// A layer point that is no symmetric image.
#[derive(Debug)]
struct Ghost {
    slot: usize,
    /// Factors on the components of its point.
    scale: [f64; 3],
    point: usize,
    bonds: Vec<usize>,
}

/// A kernel of forces that was summed over the bonds of a body.
pub(super) struct Summed<'a, K, const I: usize> {
    pub(super) kernel: &'a K,
    /// The input that holds the first component of the displacement.
    pub(super) displacement: usize,
    /// By slot.
    pub(super) inputs: [&'a [f64]; I],
}

impl LayerForces {
    /// The bonds of a body in motion, from the volume of each point (m³); none for a body that does not move.
    pub(super) fn new(dimension: usize, volume: &Sizes, in_motion: bool) -> Self {
        LayerForces {
            dimension,
            volume: match in_motion {
                true => volume.clone(),
                false => Sizes::default(),
            },
            ..LayerForces::default()
        }
    }

    /// Makes the bonds to layers be found again: points were born or cut off.
    pub(super) fn forget(&mut self) {
        self.layout = Layout::default();
    }

    /// Whether bonds to this image take the forces of this file instead of the state of the image.
    pub(super) fn replace(&self, image: &Image) -> bool {
        let is_constant = image.is_constant(self.dimension);
        let keeps_state = image.is_symmetric() || image.is_bent || is_constant;
        !(keeps_state || self.volume.count() == 0)
    }

    /// Finds the bonds if layers scale the displacement in another way than before.
    pub(super) fn follow(&mut self, family: &Family, continuation: &Continuation) {
        if self.volume.count() == 0 {
            return;
        }
        let layout = continuation.layout();
        if self.layout == layout {
            return;
        }
        self.layout = layout;
        let mut number_in = vec![u32::MAX; family.slots()];
        self.ghosts.clear();
        let images: Vec<Image> = (family.images(continuation))
            .filter(|image| self.replace(image))
            .collect();
        for image in images {
            number_in[image.slot] = self.ghosts.len() as u32;
            self.ghosts.push(Ghost {
                slot: image.slot,
                scale: image.scale,
                point: image.point,
                bonds: Vec::new(),
            });
        }
        self.owners.clear();
        self.bonds.clear();
        let points = if self.ghosts.is_empty() {
            0
        } else {
            family.points()
        };
        for point in 0..points {
            let (first, owner) = (self.bonds.len(), self.owners.len());
            family.for_each_bond(point, |number, bond, slot| {
                if let Some(ghost) = self.ghosts.get_mut(number_in[slot] as usize) {
                    ghost.bonds.push(self.bonds.len());
                    self.bonds.push(LayerBond {
                        halves: [[bond.weight, 0.0], [0.0, bond.dual]].map(|[weight, dual]| Bond {
                            weight,
                            dual,
                            ..*bond
                        }),
                        number,
                        owner,
                        ghost: number_in[slot] as usize,
                    });
                }
            });
            if self.bonds.len() > first {
                self.owners.push(Owner {
                    point,
                    slot: family.slot_of(point),
                    bonds: [first, self.bonds.len()],
                });
            }
        }
        self.ghosts.retain(|ghost| !ghost.bonds.is_empty());
        for (number, ghost) in self.ghosts.iter().enumerate() {
            for &bond in &ghost.bonds {
                self.bonds[bond].ghost = number;
            }
        }
        let mut followed: Vec<usize> = self.ghosts.iter().map(|g| g.point).collect();
        followed.sort_unstable();
        followed.dedup();
        self.followed = followed.iter().map(|&p| (p, family.slot_of(p))).collect();
        self.pulls = vec![[0.0; 3]; self.bonds.len()];
        let reaction = match points {
            0 => SlotField::default(),
            _ => SlotField::zeros(family),
        };
        self.reaction = vec![reaction; self.dimension];
    }

    /// Whether all layer points are symmetric images, or their displacement is constant.
    pub(super) fn is_empty(&self) -> bool {
        self.bonds.is_empty()
    }

    /// Replaces what the states of layer points give to forces that were summed in `out` (three components for
    /// each point).
    pub(super) fn complete<const I: usize, const D: usize>(
        &mut self,
        summed: Summed<'_, impl BondKernel<I, D>, I>,
        bonds: Bonds<'_>,
        continuation: &Continuation,
        out: &mut [f64],
    ) {
        let Summed {
            kernel,
            displacement: first,
            inputs,
        } = summed;
        let Bonds { family, broken } = bonds;
        if self.is_empty() {
            return;
        }
        let (bonds, ghosts) = (&self.bonds, &self.ghosts);
        let at = |slot: usize| inputs.each_ref().map(|i| i[slot]);
        let pull = |owner: &Owner, bond: &LayerBond| {
            let ghost = &ghosts[bond.ghost];
            let (own, other) = (at(owner.slot), at(ghost.slot));
            let [of_point, of_layer] = &bond.halves;
            let pull = kernel.bond(of_point, own, other);
            let mut replaced = kernel.bond(of_layer, own, other);
            if ghost.scale[..D].contains(&0.0) {
                let mut kept = other;
                for axis in (0..D).filter(|a| ghost.scale[*a] != 0.0) {
                    kept[first + axis] = own[first + axis];
                }
                let kept = kernel.bond(of_layer, own, kept);
                for axis in (0..D).filter(|a| ghost.scale[*a] == 0.0) {
                    replaced[axis] -= kept[axis];
                }
            }
            (pull, replaced)
        };
        // the bonds of one owner follow those of another
        let mut rest = &mut self.pulls[..];
        let mut parts = Vec::with_capacity(self.owners.len());
        for owner in &self.owners {
            let (part, behind) = rest.split_at_mut(owner.bonds[1] - owner.bonds[0]);
            parts.push((owner, part, [0.0; D]));
            rest = behind;
        }
        let sweep = parts.par_iter_mut().with_min_len(16);
        sweep.for_all(|(owner, pulls, sum)| {
            let own = &bonds[owner.bonds[0]..owner.bonds[1]];
            for (bond, store) in own.iter().zip(pulls.iter_mut()) {
                let is_broken = broken.is_some_and(|b| b.is_broken(owner.point, bond.number));
                let (of_point, replaced) = match is_broken {
                    true => ([0.0; D], [0.0; D]),
                    false => pull(owner, bond),
                };
                store[..D].copy_from_slice(&of_point);
                sum.iter_mut().zip(replaced).for_each(|(s, r)| *s -= r);
            }
        });
        for (owner, _, sum) in &parts {
            let out = &mut out[3 * owner.point..3 * owner.point + D];
            out.iter_mut().zip(sum).for_each(|(f, s)| *f += s);
        }
        drop(parts);
        self.fold(family, continuation, out);
    }

    /// Gives the forces on layer points to the points that these follow.
    fn fold(&mut self, family: &Family, continuation: &Continuation, out: &mut [f64]) {
        let Self {
            owners,
            bonds,
            ghosts,
            pulls,
            volume,
            ..
        } = self;
        for (axis, reaction) in self.reaction.iter_mut().enumerate() {
            for ghost in &*ghosts {
                let on_ghost = |&bond: &usize| {
                    let owner = &owners[bonds[bond].owner];
                    -volume[owner.point] * pulls[bond][axis]
                };
                reaction[ghost.slot] = ghost.bonds.iter().map(on_ghost).sum();
            }
            reaction.fill_ghosts(family, Folded(continuation.rules(), axis));
            for (point, slot) in &self.followed {
                let force = std::mem::take(&mut reaction[*slot]);
                out[3 * point + axis] += force / volume[*point];
            }
        }
    }

    /// Completes the diagonal blocks of the stiffness (xx, yy, zz, xy, yz, zx) that `kernel` has summed, as
    /// [`LayerForces::complete`] does forces.
    pub(super) fn complete_blocks<const I: usize>(
        &self,
        kernel: &impl BondKernel<I, 6>,
        inputs: [&[f64]; I],
        broken: Option<&BrokenBonds>,
        blocks: &mut [[f64; 6]],
    ) {
        const PAIRS: [[usize; 2]; 6] = [[0, 0], [1, 1], [2, 2], [0, 1], [1, 2], [2, 0]];
        let at = |slot: usize| inputs.each_ref().map(|i| i[slot]);
        for bond in &self.bonds {
            let (owner, ghost) = (&self.owners[bond.owner], &self.ghosts[bond.ghost]);
            if broken.is_some_and(|b| b.is_broken(owner.point, bond.number)) {
                continue;
            }
            let (own, other) = (at(owner.slot), at(ghost.slot));
            let [of_point, of_layer] = (bond.halves.each_ref()).map(|b| kernel.bond(b, own, other));
            let ratio = self.volume[owner.point] / self.volume[ghost.point];
            for (c, [a, b]) in PAIRS.into_iter().enumerate() {
                let scales = [ghost.scale[a], ghost.scale[b]];
                blocks[ghost.point][c] += ratio * scales[0] * scales[1] * of_point[c];
                if scales != [0.0; 2] {
                    blocks[owner.point][c] -= of_layer[c];
                }
            }
        }
    }
}
