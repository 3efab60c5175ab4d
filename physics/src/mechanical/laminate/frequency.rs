//! Stiffness of single points of a laminate: for the stable step, and to precondition equilibrium.

use perimelt_core::Bond;

use super::Laminate;
use super::constants::PlyState;
use super::force::{broken_in, sum_parts};
use super::kernels::{InterfaceBlock, MODULI, PlyBlock, of_fibre, stiffness};
use super::weights::{PARTS, PlyBonds};
use crate::mechanical::classical::symmetric;
use crate::plies::plane_direction;

/// Stiffness of the points beside an interface, per area.
struct BesideInterface {
    /// Of displacements along x, y, z by themselves, N/m³.
    own: [f64; 3],
    /// Sums of the absolute values of the rows of x, y, z, N/m³.
    rows: [f64; 3],
}

/// Constants by which bonds are stiff.
#[derive(Clone, Copy, PartialEq, Eq)]
enum At {
    /// At the present temperature of each point.
    Present,
    /// For each bond, those of all materials and temperatures with which it is stiffest.
    Stiffest,
}

impl Laminate {
    /// Stiffness beside each interface. One between plies in two states is no stiffer than the mean of those in either.
    fn beside_interfaces(&self, at: At) -> impl Iterator<Item = Vec<BesideInterface>> {
        self.interfaces
            .iter()
            .enumerate()
            .map(move |(number, interface)| {
                let crossing = &interface.crossing;
                let failure = self.failure.as_ref();
                let broken = failure.map(|failure| failure.of_interface(number));
                let mut sums = vec![[0.0; 6]; self.points_of_layer()];
                let inputs = interface.inputs(&self.layers[number], &self.layers[number + 1]);
                let states = self.plies.states.iter().map(|state| &state.constants);
                let moduli: Vec<[f64; MODULI]> = states
                    .clone()
                    .map(|c| interface.moduli_of([c; 2]))
                    .collect();
                let modulus = states.map(|c| c.modulus_across).fold(0.0, f64::max);
                let distance = crossing.distance;
                match at {
                    At::Present => {
                        let kernel = InterfaceBlock {
                            distance,
                            moment: |bond: &Bond, own: &_, other: &_| {
                                crossing.moment::<true>(bond, own, other)
                            },
                        };
                        self.plane.sum_unbroken(&kernel, inputs, broken, &mut sums);
                    }
                    At::Stiffest => {
                        let moment = |bond: &Bond, _: &_, _: &_| {
                            let n = plane_direction(bond);
                            let stiffness = moduli.iter().map(|m| crossing.stiffness(n, *m));
                            bond.mean() * bond.length * stiffness.fold(0.0, f64::max)
                        };
                        let kernel = InterfaceBlock { distance, moment };
                        self.plane.sum_unbroken(&kernel, inputs, broken, &mut sums);
                    }
                }
                let of_point = |(point, [x, y, z, a, b, c]): (usize, &[f64; 6])| {
                    let modulus = match at {
                        At::Present => interface.modulus[point],
                        At::Stiffest => modulus,
                    };
                    let opening = match failure.is_some_and(|f| f.is_open(number, point)) {
                        true => 0.0,
                        false => modulus / distance,
                    };
                    BesideInterface {
                        own: [*x, *y, z + opening],
                        // shear depends on the mean of both deflections, opening on their difference
                        rows: [*a, *b, c.max(2.0 * opening)],
                    }
                };
                sums.iter().enumerate().map(of_point).collect()
            })
    }

    /// Diagonal blocks of the stiffness of each point in its plane (xx, yy, xy), and the sum of `w / |xi|` of each.
    fn plane_blocks(&self, at: At) -> impl Iterator<Item = Vec<[f64; 4]>> {
        let states = self.plies.states.iter();
        let parts: Vec<[f64; PARTS]> = states
            .map(|state| state.constants.ply.reduced().of_bonds())
            .collect();
        self.layers.iter().enumerate().map(move |(number, layer)| {
            let mut sums = vec![[0.0; 4]; self.points_of_layer()];
            let broken = broken_in(self.failure.as_ref(), number);
            let of_layer = layer.parts(true, &self.zeros, broken);
            let added = &mut Vec::new();
            match at {
                At::Present => {
                    let kernel = |bonds: PlyBonds| {
                        PlyBlock(move |bond: &Bond, own: &_, other: &_| {
                            stiffness::<true>(&bonds, bond, own, other)
                        })
                    };
                    sum_parts(&self.plane, &of_layer, kernel, &mut sums, added);
                }
                At::Stiffest => {
                    let parts = &parts;
                    let kernel = |bonds: PlyBonds| {
                        PlyBlock(move |bond: &Bond, own: &_, other: &_| {
                            let n = plane_direction(bond);
                            let matrix = parts.iter().map(|parts| bonds.matrix(n, *parts));
                            let matrix = matrix.fold(0.0, f64::max);
                            bond.mean() * (matrix + of_fibre(&bonds, bond, own, other))
                        })
                    };
                    sum_parts(&self.plane, &of_layer, kernel, &mut sums, added);
                }
            }
            sums
        })
    }

    /// Evaluates the diagonal blocks; those of the dilatation are left out.
    pub(super) fn load_blocks(&mut self) {
        let points = self.points_of_layer();
        let in_plane = self.plane_blocks(At::Present).flatten();
        let mut blocks: Vec<[f64; 6]> = in_plane
            .map(|[xx, yy, xy, _]| [xx, yy, 0.0, xy, 0.0, 0.0])
            .collect();
        for (number, beside) in self.beside_interfaces(At::Present).enumerate() {
            for (point, beside) in beside.iter().enumerate() {
                for layer in [number, number + 1] {
                    let block = &mut blocks[layer * points + point];
                    let thickness = self.layers[layer].thickness;
                    (0..3).for_each(|axis| block[axis] += beside.own[axis] / thickness);
                }
            }
        }
        self.blocks = blocks;
    }

    /// A bound of the squares of the eigenfrequencies at any temperature: the largest eigenvalue of the blocks on the diagonal of a matrix
    /// that is nowhere less stiff. Twice the block of a layer bounds its bonds, as for a network of springs, beside the springs of the
    /// dilatation (`ordinary`); the sums of the rows bound the interfaces (a symmetric matrix is no stiffer than the diagonal of the sums
    /// of its absolute values).
    pub(super) fn largest_square(&mut self, density: &[f64]) -> f64 {
        let points = self.points_of_layer();
        let reduced = |state: &PlyState| state.constants.ply.reduced();
        let largest_of = |value: &dyn Fn(&PlyState) -> f64| {
            let states = self.plies.states.iter();
            states.map(value).fold(0.0, f64::max)
        };
        let dilatation = 4.0 * largest_of(&|state| reduced(state).dilatation());
        for layer in &mut self.layers {
            let bonds = layer.bonds;
            let increment = largest_of(&|state| bonds.increment(reduced(state).of_bonds()));
            layer.load_fibres(&self.plane, |_| increment);
        }
        let mut rows = vec![[0.0; 3]; density.len()];
        for (number, beside) in self.beside_interfaces(At::Stiffest).enumerate() {
            for (point, beside) in beside.iter().enumerate() {
                for layer in [number, number + 1] {
                    let rows = &mut rows[layer * points + point];
                    let thickness = self.layers[layer].thickness;
                    (0..3).for_each(|axis| rows[axis] += beside.rows[axis] / thickness);
                }
            }
        }
        let mut largest = 0.0_f64;
        for (number, blocks) in self.plane_blocks(At::Stiffest).enumerate() {
            for (point, [xx, yy, xy, weights]) in blocks.iter().enumerate() {
                let point = number * points + point;
                let dilatation = dilatation * weights;
                let [x, y, z] = rows[point];
                let [xx, yy] = [xx, yy].map(|along| 2.0 * (along + dilatation));
                let block = symmetric(&[xx + x, yy + y, z, 2.0 * xy, 0.0, 0.0]);
                largest = largest.max(block.symmetric_eigenvalues().max() / density[point]);
            }
        }
        self.load_constants();
        largest
    }
}
