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
    let image = scale * symmetric(strain) * mirror;
    COMPONENTS.map(|(a, b)| 0.5 * (image[(a, b)] + image[(b, a)]))
}

pub(super) fn diagonal(signs: [f64; 3]) -> Matrix3<f64> {
    Matrix3::from_diagonal(&signs.into())
}

/// Row and column of xx, yy, zz, xy, yz, zx.
pub(super) const COMPONENTS: [(usize, usize); 6] = [(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0)];

/// A symmetric tensor from xx, yy, zz, xy, yz, zx.
pub(super) fn symmetric(&[xx, yy, zz, xy, yz, zx]: &[f64; 6]) -> Matrix3<f64> {
    Matrix3::new(xx, xy, zx, xy, yy, yz, zx, yz, zz)
}
