//! Stiffness of single points of a laminate: for the stable step, and to precondition equilibrium.

use perimelt_core::Bond;

use super::Laminate;
use super::added_inertia::{AddedInertia, Springs, Stack};
use super::constants::PlyState;
use super::force::{broken_in, sum_parts};
use super::kernels::{InterfaceBlock, MODULI, PlyBlock, of_fibre, stiffness};
use super::weights::{PARTS, PlyBonds};
use crate::mechanical::classical::symmetric;
use crate::plies::plane_direction;

/// Shares of the stiffness across that added inertia has, the smallest first.
const SHARES: [f64; 7] = [0.0, 1.0 / 16.0, 0.25, 1.0, 4.0, 16.0, 64.0];

/// Inertia that the first wave across the layers may have added, over its own.
const LARGEST_INERTIA: f64 = 0.02;

/// The square of the frequency that a smaller share may leave, over the smallest one.
const ENOUGH: f64 = 1.1;

/// Splits of the angle of crossing bonds into that of shifts and that of deflections: the weight of either in a bound of the square of the sum.
const SPLITS: [f64; 9] = [0.0625, 0.125, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0];

/// Stiffness of the points beside an interface, per area, N/m³.
struct BesideInterface {
    /// Against a uniform shift of the layers: xx, yy and xy.
    shift: [f64; 3],
    /// Against deflections of the point by itself.
    deflection: f64,
    /// Against opening.
    opening: f64,
}

impl BesideInterface {
    /// The largest stiffness against a shift.
    fn largest_shift(&self) -> f64 {
        let [xx, yy, xy] = self.shift;
        0.5 * (xx + yy) + (0.25 * (xx - yy) * (xx - yy) + xy * xy).sqrt()
    }
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
                let mut sums = vec![[0.0; 4]; self.points_of_layer()];
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
                let of_point = |(point, [xx, yy, xy, deflection]): (usize, &[f64; 4])| {
                    let modulus = match at {
                        At::Present => interface.modulus[point],
                        At::Stiffest => modulus,
                    };
                    let is_open = failure.is_some_and(|f| f.is_open(number, point));
                    BesideInterface {
                        shift: [*xx, *yy, *xy],
                        deflection: *deflection,
                        opening: if is_open { 0.0 } else { modulus / distance },
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
                    let [xx, yy, _] = beside.shift.map(|both| 0.5 * both);
                    let own = [xx, yy, 0.25 * beside.deflection + beside.opening];
                    (0..3).for_each(|axis| block[axis] += own[axis] / thickness);
                }
            }
        }
        self.blocks = blocks;
    }

    /// A bound of the squares of the eigenfrequencies at any temperature, with the inertia that is added to columns, unless bonds break: then waves
    /// across the layers decide what opens.
    ///
    /// It is the sum of the largest eigenvalues of parts: of the diagonal blocks of a matrix that is nowhere less stiff, twice those of the bonds
    /// of a layer, as for a network of springs, beside the springs of the dilatation (`ordinary`); and of a column whose
    /// layers shift or open.
    pub(super) fn largest_square(&mut self, density: &[f64]) -> f64 {
        let beside: Vec<Vec<BesideInterface>> = self.beside_interfaces(At::Stiffest).collect();
        let largest_of = |value: fn(&BesideInterface) -> f64| {
            let interfaces = beside.iter().map(|points| points.iter().map(value));
            interfaces
                .map(|values| values.fold(0.0, f64::max))
                .collect()
        };
        let springs = Springs {
            shear: largest_of(BesideInterface::largest_shift),
            opening: largest_of(|beside| beside.opening),
        };
        let stack = Stack::new(&self.layers, &self.interfaces, density);
        let of_layers = self.largest_squares_of_layers(density, &beside);
        let shares = match self.failure {
            Some(_) => &SHARES[..1],
            None => &SHARES,
        };
        let bound = |share: &f64| {
            let of_column = stack.largest_squares(&springs, *share);
            let bounds = SPLITS.map(|split| of_layers(split, of_column));
            (*share, bounds.into_iter().fold(f64::INFINITY, f64::min))
        };
        let inertia = stack.inertia_of_first_wave(&springs);
        let bounds = shares
            .iter()
            .map(bound)
            .filter(|(share, bound)| *share == 0.0 || share * inertia <= LARGEST_INERTIA * bound);
        let bounds: Vec<(f64, f64)> = bounds.collect();
        let smallest = bounds.iter().fold(f64::INFINITY, |m, (_, b)| m.min(*b));
        let enough = |(_, bound): &&(f64, f64)| *bound <= ENOUGH * smallest;
        let (share, bound) = bounds.iter().find(enough).unwrap_or(&bounds[0]);
        self.added_inertia = match *share > 0.0 {
            true => stack.added_inertia(&springs, *share),
            false => AddedInertia::default(),
        };
        *bound
    }

    /// The bound of [`Laminate::largest_square`] from the weight of deflections and the squares of the frequencies of a column, for shear and for opening.
    fn largest_squares_of_layers(
        &mut self,
        density: &[f64],
        beside: &[Vec<BesideInterface>],
    ) -> impl Fn(f64, [f64; 2]) -> f64 + use<> {
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
        let mut deflection = 0.0_f64;
        for (number, layer) in self.layers.iter().enumerate() {
            for point in 0..points {
                let interfaces = number.saturating_sub(1)..beside.len().min(number + 1);
                let both: f64 = interfaces.map(|n| beside[n][point].deflection).sum();
                let mass = layer.thickness * density[number * points + point];
                deflection = deflection.max(both / mass);
            }
        }
        let mut in_plane = 0.0_f64;
        for (number, blocks) in self.plane_blocks(At::Stiffest).enumerate() {
            for (point, [xx, yy, xy, weights]) in blocks.iter().enumerate() {
                let density = density[number * points + point];
                let dilatation = dilatation * weights;
                let [xx, yy] = [xx, yy].map(|along| 2.0 * (along + dilatation));
                let block = symmetric(&[xx, yy, 0.0, 2.0 * xy, 0.0, 0.0]);
                in_plane = in_plane.max(block.symmetric_eigenvalues().max() / density);
            }
        }
        self.load_constants();
        move |split, [shear, opening]| {
            let shift = in_plane + (1.0 + split) * shear;
            shift.max((1.0 + 1.0 / split) * deflection + opening)
        }
    }
}
