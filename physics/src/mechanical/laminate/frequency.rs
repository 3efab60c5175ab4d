//! Stiffness of single points of a laminate: for the stable step, and to precondition equilibrium.

use super::Laminate;
use super::force::{broken_in, sum_parts};
use super::kernels::{InterfaceBlock, PlyBlock};
use crate::mechanical::classical::symmetric;

/// Stiffness of the points beside an interface, per area.
struct BesideInterface {
    /// Of displacements along x, y, z by themselves, N/m³.
    own: [f64; 3],
    /// Largest sum of the absolute values of a row, N/m³.
    row: f64,
}

impl Laminate {
    /// Stiffness beside each interface.
    fn beside_interfaces(&self) -> impl Iterator<Item = Vec<BesideInterface>> {
        self.interfaces
            .iter()
            .enumerate()
            .map(|(number, interface)| {
                let failure = self.failure.as_ref();
                let broken = failure.map(|failure| failure.of_interface(number));
                let mut sums = vec![[0.0; 6]; self.points_of_layer()];
                let kernel = InterfaceBlock(interface.crossing);
                self.plane.sum_unbroken(&kernel, [], broken, &mut sums);
                let of_point = |(point, [x, y, z, a, b, c]): (usize, &[f64; 6])| {
                    let opening = match failure.is_some_and(|f| f.is_open(number, point)) {
                        true => 0.0,
                        false => interface.modulus / interface.crossing.distance,
                    };
                    BesideInterface {
                        own: [*x, *y, z + opening],
                        row: a.max(*b).max(c + 2.0 * opening),
                    }
                };
                sums.iter().enumerate().map(of_point).collect()
            })
    }

    /// Diagonal blocks of the stiffness of each point in its plane (xx, yy, xy), and the sum of `w / |xi|` of each.
    fn plane_blocks(&self) -> impl Iterator<Item = Vec<[f64; 4]>> {
        self.layers.iter().enumerate().map(|(number, layer)| {
            let mut sums = vec![[0.0; 4]; self.points_of_layer()];
            let broken = broken_in(self.failure.as_ref(), number);
            let parts = layer.parts(true, &self.zeros, broken);
            sum_parts(&self.plane, &parts, PlyBlock, &mut sums, &mut Vec::new());
            sums
        })
    }

    /// Evaluates the diagonal blocks; those of the dilatation are left out.
    pub(super) fn load_blocks(&mut self) {
        let points = self.points_of_layer();
        let in_plane = self.plane_blocks().flatten();
        let mut blocks: Vec<[f64; 6]> = in_plane
            .map(|[xx, yy, xy, _]| [xx, yy, 0.0, xy, 0.0, 0.0])
            .collect();
        for (number, beside) in self.beside_interfaces().enumerate() {
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

    /// A bound of the squares of the eigenfrequencies: the sum of bounds of the layers and of the interfaces. That of a layer is
    /// twice the largest eigenvalue of a diagonal block, as for a network of springs, and the springs of the dilatation
    /// (`ordinary`); that of interfaces the largest sum of a row.
    pub(super) fn largest_square(&self, density: &[f64]) -> f64 {
        let points = self.points_of_layer();
        let mut rows = vec![0.0; density.len()];
        for (number, beside) in self.beside_interfaces().enumerate() {
            for (point, beside) in beside.iter().enumerate() {
                for layer in [number, number + 1] {
                    rows[layer * points + point] += beside.row / self.layers[layer].thickness;
                }
            }
        }
        let mut largest = 0.0_f64;
        for (number, (blocks, layer)) in self.plane_blocks().zip(&self.layers).enumerate() {
            for (point, [xx, yy, xy, weights]) in blocks.iter().enumerate() {
                let point = number * points + point;
                let dilatation = 4.0 * layer.dilatation.max(0.0) * weights;
                let block = symmetric(&[xx + dilatation, yy + dilatation, 0.0, *xy, 0.0, 0.0]);
                let in_plane = 2.0 * block.symmetric_eigenvalues().max();
                largest = largest.max((in_plane + rows[point]) / density[point]);
            }
        }
        largest
    }
}
