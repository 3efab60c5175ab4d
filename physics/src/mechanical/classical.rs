//! The classical law of a point: isotropic elasticity with eigenstrain and inelastic strain.

use nalgebra::Matrix3;

use super::moduli::Moduli;
use super::plasticity::StressState;

/// The law by which the stress of a point follows its strain.
#[derive(Clone, Copy)]
pub(super) struct Point {
    pub(super) moduli: Moduli,
    pub(super) eigenstrain: f64,
    /// Plastic and annealed strain as xx, yy, zz, xy, yz, zx.
    pub(super) inelastic: [f64; 6],
    /// Trace of `inelastic` in the stress state of the body.
    trace: f64,
    dimension: usize,
}

impl Point {
    pub(super) fn new(moduli: Moduli, eigenstrain: f64, dimension: usize) -> Self {
        Point {
            moduli,
            eigenstrain,
            inelastic: [0.0; 6],
            trace: 0.0,
            dimension,
        }
    }

    /// A loose point, whose bonds do not span the dimensions: it has no stress.
    pub(super) fn loose(moduli: Moduli, dimension: usize) -> Self {
        let moduli = Moduli {
            shear: 0.0,
            lame: 0.0,
            ..moduli
        };
        Point::new(moduli, 0.0, dimension)
    }

    /// `C : (strain - eigenstrain - inelastic strain)`, Pa; zero in components that the dimension leaves out.
    pub(super) fn stress(&self, strain: &Matrix3<f64>) -> Matrix3<f64> {
        let d = self.dimension;
        let trace: f64 = (0..d).map(|a| strain[(a, a)]).sum();
        let inelastic = symmetric(&self.inelastic);
        let isotropic = self.moduli.lame * (trace - self.trace)
            - d as f64 * self.moduli.bulk * self.eigenstrain;
        Matrix3::from_fn(|r, c| match r < d && c < d {
            false => 0.0,
            true => {
                let elastic = strain[(r, c)] - inelastic[(r, c)];
                2.0 * self.moduli.shear * elastic + if r == c { isotropic } else { 0.0 }
            }
        })
    }

    /// The law of changes of strain: without eigenstrain and inelastic strain.
    pub(super) fn of_change(self) -> Self {
        Point::new(self.moduli, 0.0, self.dimension)
    }

    /// With an inelastic strain in addition to what the point has.
    pub(super) fn with_inelastic(self, state: StressState, mut inelastic: [f64; 6]) -> Self {
        inelastic
            .iter_mut()
            .zip(self.inelastic)
            .for_each(|(e, own)| *e += own);
        self.replace_inelastic(state, inelastic)
    }

    /// With another inelastic strain.
    pub(super) fn replace_inelastic(self, state: StressState, inelastic: [f64; 6]) -> Self {
        let trace = state.trace(&inelastic);
        Point {
            inelastic,
            trace,
            ..self
        }
    }

    /// Green-Lagrange or small strain.
    pub(super) fn strain(gradient: &Matrix3<f64>, finite: bool) -> Matrix3<f64> {
        let linear = 0.5 * (gradient + gradient.transpose());
        if finite {
            linear + 0.5 * gradient.transpose() * gradient
        } else {
            linear
        }
    }

    /// First Piola-Kirchhoff stress, Pa. The Green-Lagrange strain of a stretch by e is `e + e^2/2`.
    pub(super) fn piola(&self, gradient: &Matrix3<f64>, finite: bool) -> Matrix3<f64> {
        let stress = self.material_stress(gradient, finite);
        if finite {
            stress + gradient * stress
        } else {
            stress
        }
    }

    /// Stress without the rotation of the point, Pa: second Piola-Kirchhoff under finite kinematics.
    pub(super) fn material_stress(&self, gradient: &Matrix3<f64>, finite: bool) -> Matrix3<f64> {
        let strain = Self::strain(gradient, finite);
        let eigenstrain = match finite {
            true => self.eigenstrain * (1.0 + 0.5 * self.eigenstrain),
            false => self.eigenstrain,
        };
        Point {
            eigenstrain,
            ..*self
        }
        .stress(&strain)
    }

    /// Energy density of the elastic strain that has a stress, J/m³; zero without stiffness.
    pub(super) fn energy_of(&self, stress: &Matrix3<f64>) -> f64 {
        let d = self.dimension;
        if self.moduli.shear <= 0.0 {
            return 0.0;
        }
        let mean = stress.trace() / d as f64;
        let square = stress.norm_squared() - d as f64 * mean * mean;
        0.25 * square / self.moduli.shear + 0.5 * mean * mean / self.moduli.bulk
    }

    /// Components xx, yy, zz, xy, yz, zx, with that across the plane of plane strain.
    pub(super) fn components(&self, stress: &Matrix3<f64>, plane_strain: bool) -> [f64; 6] {
        let mut tensor = COMPONENTS.map(|at| stress[at]);
        if plane_strain {
            tensor[2] = self
                .moduli
                .stress_across(&tensor, self.eigenstrain, self.inelastic[2]);
        }
        tensor
    }
}

/// Inelastic strain of a mirror image, which continues as the strain does: `sym(scale e mirror)`.
pub(super) fn image_of(scale: &Matrix3<f64>, strain: &[f64; 6], mirror: &Matrix3<f64>) -> [f64; 6] {
    components(&(scale * symmetric(strain) * mirror))
}

/// Eigenstrain of a mirror image: that of a body which is symmetric about the face, or, where the displacement along the face is
/// held, too, that of a body which goes on behind it. `scale` has the factors on the displacement of the image.
pub(super) fn eigenstrain_of_image(scale: [f64; 3], strain: &[f64; 6]) -> [f64; 6] {
    let signs = diagonal(signs_of_image(scale));
    image_of(&signs, strain, &signs)
}

/// Signs of the axes along which the material and the eigenstrain of a mirror image lie.
pub(super) fn signs_of_image(scale: [f64; 3]) -> [f64; 3] {
    scale.map(|s| if s > 0.0 { 1.0 } else { -1.0 })
}

pub(super) fn diagonal(signs: [f64; 3]) -> Matrix3<f64> {
    Matrix3::from_diagonal(&signs.into())
}

/// Row and column of xx, yy, zz, xy, yz, zx.
pub(super) const COMPONENTS: [(usize, usize); 6] = [(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0)];

/// xx, yy, zz, xy, yz, zx of the symmetric part of a tensor.
pub(super) fn components(tensor: &Matrix3<f64>) -> [f64; 6] {
    COMPONENTS.map(|(a, b)| 0.5 * (tensor[(a, b)] + tensor[(b, a)]))
}

/// A symmetric tensor from xx, yy, zz, xy, yz, zx.
pub(super) fn symmetric(&[xx, yy, zz, xy, yz, zx]: &[f64; 6]) -> Matrix3<f64> {
    Matrix3::new(xx, xy, zx, xy, yy, yz, zx, yz, zz)
}

#[cfg(test)]
mod tests {
    use super::super::moduli::Plane;
    use super::*;

    const EIGENSTRAIN: f64 = 2e-4;

    fn gradient(dimension: usize) -> Matrix3<f64> {
        let full = Matrix3::new(1e-3, 2e-4, -5e-4, 7e-4, -3e-4, 4e-4, 1e-4, -6e-4, 8e-4);
        Matrix3::from_fn(|r, c| {
            if r < dimension && c < dimension {
                full[(r, c)]
            } else {
                0.0
            }
        })
    }

    fn close(found: &Matrix3<f64>, expected: &Matrix3<f64>) {
        assert!(
            (found - expected).norm() < 1e-9 * expected.norm(),
            "{found} {expected}"
        );
    }

    /// `sigma = lame tr(e) 1 + 2 shear e` of the strain e without eigenstrain and inelastic strain, and half of their product
    /// as energy; in a bar `sigma = E e`.
    #[test]
    fn stress_and_energy_are_those_of_hookes_law() {
        let inelastic = [1e-4, -2e-4, 5e-5, 3e-5, -4e-5, 2e-5];
        for (dimension, state) in [
            (1, StressState::Uniaxial),
            (2, StressState::Plane),
            (3, StressState::Full),
        ] {
            let moduli = Moduli::new(2e11, 0.3, dimension, Plane::Stress);
            let law = Point::new(moduli, EIGENSTRAIN, dimension).with_inelastic(state, inelastic);
            let strain = Point::strain(&gradient(dimension), false);
            let swelling = Matrix3::identity() * EIGENSTRAIN;
            let elastic = strain - symmetric(&inelastic) - swelling;
            let elastic = Matrix3::from_fn(|r, c| {
                if r < dimension && c < dimension {
                    elastic[(r, c)]
                } else {
                    0.0
                }
            });
            let unit = Matrix3::from_fn(|r, c| if r == c && r < dimension { 1.0 } else { 0.0 });
            let expected = unit * (moduli.lame * elastic.trace()) + elastic * (2.0 * moduli.shear);
            let found = law.stress(&strain);
            close(&found, &expected);
            if dimension == 1 {
                assert!((found[(0, 0)] / (2e11 * elastic[(0, 0)]) - 1.0).abs() < 1e-12);
            }
            let energy = 0.5 * expected.dot(&elastic);
            assert!(
                (law.energy_of(&found) / energy - 1.0).abs() < 1e-12,
                "{dimension}D"
            );
            let twice = law.with_inelastic(state, inelastic);
            assert_eq!(twice.inelastic, inelastic.map(|e| 2.0 * e));
            let change = law.of_change().stress(&strain);
            close(
                &change,
                &(unit * (moduli.lame * strain.trace()) + strain * (2.0 * moduli.shear)),
            );
            let loose = Point::loose(moduli, dimension);
            assert_eq!(loose.stress(&strain), Matrix3::zeros());
            assert_eq!(loose.energy_of(&expected), 0.0);
        }
    }

    /// A body that is stretched by its eigenstrain and turned has no stress; `P = F S` with the deformation gradient F.
    #[test]
    fn finite_strains_do_not_see_rotations() {
        let moduli = Moduli::new(2e11, 0.3, 3, Plane::Stress);
        let law = Point::new(moduli, EIGENSTRAIN, 3);
        let turn = nalgebra::Rotation3::from_euler_angles(0.4, 1.0, -0.3).into_inner();
        let swollen = turn * (1.0 + EIGENSTRAIN) - Matrix3::identity();
        // rounding of numbers of order 1 times the modulus
        assert!(law.piola(&swollen, true).norm() < 1e-15 * 2e11 * 10.0);
        let gradient = gradient(3);
        let stress = law.material_stress(&gradient, true);
        let expected = (Matrix3::identity() + gradient) * stress;
        close(&law.piola(&gradient, true), &expected);
        let small = law.material_stress(&gradient, false);
        assert_eq!(law.piola(&gradient, false), small);
        let strain = Point::strain(&gradient, true);
        let linear: Matrix3<f64> = (gradient + gradient.transpose()) * 0.5;
        let quadratic: Matrix3<f64> = gradient.transpose() * gradient * 0.5;
        assert!((strain - linear - quadratic).norm() < 1e-18);
    }

    #[test]
    fn components_have_the_stress_across_a_plane_under_plane_strain() {
        let moduli = Moduli::new(2e11, 0.3, 2, Plane::Strain);
        let law = Point::new(moduli, 1.3e-3, 2);
        let stress = Matrix3::new(9e7, 5e6, 0.0, 5e6, -2e7, 0.0, 0.0, 0.0, 0.0);
        let across = 0.3 * 7e7 - 2e11 * 1e-3;
        for (plane_strain, zz) in [(false, 0.0), (true, across)] {
            let found = law.components(&stress, plane_strain);
            let expected = [9e7, -2e7, zz, 5e6, 0.0, 0.0];
            for (found, expected) in found.iter().zip(expected) {
                assert!((found - expected).abs() < 1e-6, "{found} {expected}");
            }
        }
    }

    /// The image behind a face across x has shear strains with x of the opposite sign; a layer that turns the signs of all
    /// displacements turns those of all strains.
    #[test]
    fn images_of_strains_are_mirrored() {
        let strain = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
        let mirror = diagonal([-1.0, 1.0, 1.0]);
        let even = image_of(&mirror, &strain, &mirror);
        assert_eq!(even, [1.0, 2.0, 3.0, -4.0, 5.0, -6.0]);
        let odd = image_of(&-mirror, &strain, &mirror);
        assert_eq!(odd, [-1.0, -2.0, -3.0, 4.0, -5.0, 6.0]);
        assert_eq!(eigenstrain_of_image([-1.0, 1.0, 1.0], &strain), even);
        // a wall, with a layer that is mirrored or constant
        assert_eq!(eigenstrain_of_image([-1.0; 3], &strain), strain);
        assert_eq!(eigenstrain_of_image([0.0; 3], &strain), strain);
    }
}
