//! A beam whose axis is not normal to a face of the lattice: a torch in a fillet, or around a pipe.
//!
//! The density is footprint × depth profile in the frame of the torch: zeta along its axis, xi along the travel direction
//! normal to the axis, eta across. It is continued evenly to zeta < 0, above the plane through the position of the source,
//! and cells with material take their part of it. A flat surface through the position that contains the travel
//! direction cuts the density into equal halves, so that its material receives the power asked for at any
//! inclination. In a concave corner, such as a fillet, material covers more than a half and the density is scaled down; over
//! an edge material covers less, and the rest is lost.

use nalgebra::Vector3;

use super::Sampling;
use super::beam::Beam;
use super::sampled::{Sampled, SourceFrame};
use crate::toolpath::Pose;

impl Beam {
    /// The density at `pose` with the axis of the torch along the unit vector `axis`.
    pub(super) fn tilted(&self, pose: &Pose, axis: Vector3<f64>) -> Sampled<'_> {
        let mut origin = pose.position;
        if let Some(level) = self.sampled.heated_surface.level {
            origin[self.sampled.heated_surface.face.axis()] = level;
        }
        let [along, across] = self.footprint.reach();
        Sampled {
            frame: SourceFrame::new(origin, axis, pose.direction),
            reach: [along, across, self.depth.reach()],
            finest: self.footprint.finest().min(self.depth.finest()),
            at_centres: self.sampled.sampling == Sampling::Point,
            is_even: true,
            normalise: self.sampled.normalise,
            density: Box::new(|xi, eta, zeta| {
                self.footprint.density(xi, eta) * self.depth.density(zeta)
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::heated_body::lattice::TestLattice;
    use super::super::{Deposit, Depositor, Goldak};
    use super::*;

    fn goldak(direction: [f64; 3]) -> Goldak {
        toml::from_str(&format!(
            "front_length = 2e-3\nrear_length = 4e-3\nhalf_width = 2e-3\ndepth = 2e-3
             heated_surface = {{ direction = {direction:?} }}"
        ))
        .expect("a valid source")
    }

    fn pose(position: [f64; 3]) -> Pose {
        Pose {
            position: position.into(),
            direction: Vector3::x(),
            power: 1000.0,
            speed: 0.01,
            torch: None,
        }
    }

    fn deposit(lattice: &TestLattice, direction: [f64; 3], at: [f64; 3]) -> (Deposit, Vec<f64>) {
        let mut values = vec![0.0; lattice.grid.dims.iter().product()];
        let mut depositor = Depositor::new(&goldak(direction), &lattice.grid).expect("valid");
        let deposit = depositor.add(lattice, &pose(at), &mut values);
        (deposit, values)
    }

    /// Centre of the power across the travel direction, m.
    fn centre(lattice: &TestLattice, values: &[f64]) -> [f64; 2] {
        let [nx, ny, _] = lattice.grid.dims;
        let mut sums = [0.0; 3];
        for (point, value) in values.iter().enumerate() {
            let cell = [(point / nx) % ny, point / (nx * ny)];
            let at = [0, 1].map(|a| {
                lattice.grid.origin[a + 1] + (cell[a] as f64 + 0.5) * lattice.grid.spacing[a + 1]
            });
            sums[0] += value;
            sums[1] += value * at[0];
            sums[2] += value * at[1];
        }
        [sums[1] / sums[0], sums[2] / sums[0]]
    }

    #[test]
    fn an_upright_torch_is_the_source_of_the_face() {
        let lattice = TestLattice::full([0.0; 3], [1e-3; 3], [40, 30, 15]);
        let at = [0.02, 0.015, 0.015];
        let (tilted, values) = deposit(&lattice, [0.0, 0.0, -2.0], at);
        let source = toml::from_str(
            "front_length = 2e-3\nrear_length = 4e-3\nhalf_width = 2e-3\ndepth = 2e-3",
        );
        let source: Goldak = source.expect("valid");
        let mut upright = vec![0.0; values.len()];
        let mut depositor = Depositor::new(&source, &lattice.grid).expect("valid");
        depositor.add(&lattice, &pose(at), &mut upright);
        assert!((tilted.deposited - 1000.0).abs() < 1e-9 && tilted.lost == 0.0);
        let peak = upright.iter().copied().fold(0.0, f64::max);
        let apart = values.iter().zip(&upright).map(|(a, b)| (a - b).abs());
        // two Gauss points in each cell against exact averages
        assert!(apart.fold(0.0, f64::max) < 0.01 * peak);
    }

    #[test]
    fn an_inclined_torch_heats_a_flat_plate_with_its_whole_power() {
        let lattice = TestLattice::full([0.0; 3], [1e-3; 3], [40, 30, 15]);
        for degrees in [10.0_f64, 35.0, 60.0] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let (found, values) = deposit(&lattice, [0.0, sin, -cos], [0.02, 0.015, 0.015]);
            assert!((found.deposited - 1000.0).abs() < 1e-9, "{found:?}");
            assert!((lattice.power(&values) - 1000.0).abs() < 1e-9);
            let [y, z] = centre(&lattice, &values);
            assert!(z < 0.015 && y >= 0.015 - 1e-9, "{degrees}: {y} {z}");
        }
    }

    #[test]
    fn a_torch_in_a_fillet_heats_both_plates_alike_and_over_the_edge_power_is_lost() {
        let mut lattice = TestLattice::full([0.0; 3], [1e-3; 3], [40, 30, 30]);
        // the corner at y = z = 10 mm: air where both are larger
        lattice.material = |[_, y, z]| y < 10 || z < 10;
        let corner = [0.02, 0.01, 0.01];
        let (found, values) = deposit(&lattice, [0.0, -1.0, -1.0], corner);
        assert!((found.deposited - 1000.0).abs() < 1e-9);
        let [y, z] = centre(&lattice, &values);
        assert!((y - z).abs() < 1e-9 && y < 0.01, "{y} {z}");
        let (end, _) = deposit(&lattice, [0.0, -1.0, -1.0], [0.0, 0.01, 0.01]);
        assert!((end.deposited + end.lost - 1000.0).abs() < 1e-9);
        let (out, _) = deposit(&lattice, [0.0, -1.0, -1.0], [-0.02, 0.01, 0.01]);
        assert_eq!((out.deposited, out.lost), (0.0, 1000.0));
    }

    #[test]
    fn a_plate_and_a_direction_that_is_none_are_refused() {
        let plate = TestLattice::plate(1e-3, 5e-3, 20);
        assert!(Depositor::new(&goldak([0.0, 1.0, -1.0]), &plate.grid).is_err());
        let block = TestLattice::full([0.0; 3], [1e-3; 3], [4, 4, 4]);
        assert!(Depositor::new(&goldak([0.0; 3]), &block.grid).is_err());
    }
}
