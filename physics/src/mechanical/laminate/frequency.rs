//! Stiffness of single points of a laminate: for the stable step, and to precondition equilibrium.

use perimelt_core::Family;

use super::Laminate;
use super::interface::Interface;
use super::kernels::{InterfaceBlock, PlyBlock};
use crate::mechanical::classical::symmetric;

/// Stiffness of the points beside an interface, per area.
struct BesideInterface {
    /// Of displacements along x, y, z by themselves, N/m³.
    own: [f64; 3],
    /// Largest sum of the absolute values of a row, N/m³.
    row: f64,
}

impl Interface {
    fn stiffness(&self, plane: &Family) -> Vec<BesideInterface> {
        let mut sums = vec![[0.0; 6]; plane.points()];
        plane.sum(&InterfaceBlock(self.crossing), [], &mut sums);
        let opening = self.modulus / self.crossing.distance;
        let of_point = |[x, y, z, a, b, c]: &[f64; 6]| BesideInterface {
            own: [*x, *y, z + opening],
            row: a.max(*b).max(c + 2.0 * opening),
        };
        sums.iter().map(of_point).collect()
    }
}

impl Laminate {
    /// Diagonal blocks of the stiffness of each point in its plane (xx, yy, xy), and the sum of `w / |xi|` of each.
    fn plane_blocks(&self) -> impl Iterator<Item = Vec<[f64; 4]>> {
        self.layers.iter().map(|layer| {
            let mut sums = vec![[0.0; 4]; self.points_of_layer()];
            let inputs = layer.inputs(true, &self.zeros);
            self.plane.sum(&PlyBlock(layer.bonds), inputs, &mut sums);
            sums
        })
    }

    /// Evaluates the diagonal blocks; those of the dilatation are left out.
    pub(super) fn load_blocks(&mut self) {
        let points = self.points_of_layer();
        let in_plane = self.plane_blocks().flatten();
        self.blocks = in_plane
            .map(|[xx, yy, xy, _]| [xx, yy, 0.0, xy, 0.0, 0.0])
            .collect();
        for (number, interface) in self.interfaces.iter().enumerate() {
            for (point, beside) in interface.stiffness(&self.plane).iter().enumerate() {
                for layer in [number, number + 1] {
                    let block = &mut self.blocks[layer * points + point];
                    let thickness = self.layers[layer].thickness;
                    (0..3).for_each(|axis| block[axis] += beside.own[axis] / thickness);
                }
            }
        }
    }

    /// A bound of the squares of the eigenfrequencies: the sum of bounds of the layers and of the interfaces. That of a layer is
    /// twice the largest eigenvalue of a diagonal block, as for a network of springs, and the springs of the dilatation
    /// (`ordinary`); that of interfaces the largest sum of a row.
    pub(super) fn largest_square(&self, density: &[f64]) -> f64 {
        let points = self.points_of_layer();
        let mut rows = vec![0.0; density.len()];
        for (number, interface) in self.interfaces.iter().enumerate() {
            for (point, beside) in interface.stiffness(&self.plane).iter().enumerate() {
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
