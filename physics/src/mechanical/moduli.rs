//! Elastic moduli in one, two or three dimensions.

use nalgebra::{Matrix3, Vector3};
use perimelt_core::family::Traction;
use perimelt_core::material::Property;
use perimelt_core::{Face, Setup, SetupError};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// State across the thickness of a 2D body.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Plane {
    /// No stress: thin plates.
    #[default]
    Stress,
    /// No strain: sections of long bodies.
    Strain,
}

/// Moduli of an isotropic solid of `d` dimensions, Pa: mean stress is `bulk` times the sum of the
/// `d` strains. Wang (2025), table 3-2; plane strain `docs/theory/thermomechanics.md`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moduli {
    /// Bulk modulus of `d` dimensions.
    pub bulk: f64,
    /// Shear modulus; in 1D the value that gives a bond-based bar its Young's modulus.
    pub shear: f64,
    /// First Lamé constant of `d` dimensions: `bulk - 2 shear / d`.
    pub lame: f64,
    /// In-plane strain that a unit of eigenstrain makes: `1 + nu` in plane strain, else 1.
    pub swelling: f64,
}

impl Moduli {
    /// From Young's modulus (Pa) and Poisson's ratio.
    pub fn new(youngs_modulus: f64, poissons_ratio: f64, dimension: usize, plane: Plane) -> Self {
        let (e, nu) = (youngs_modulus, poissons_ratio);
        let shear = match dimension {
            1 => e / 3.0,
            _ => e / (2.0 * (1.0 + nu)),
        };
        let (bulk, swelling) = match (dimension, plane) {
            (1, _) => (e, 1.0),
            (2, Plane::Stress) => (e / (2.0 * (1.0 - nu)), 1.0),
            (2, Plane::Strain) => (e / (2.0 * (1.0 + nu) * (1.0 - 2.0 * nu)), 1.0 + nu),
            _ => (e / (3.0 * (1.0 - 2.0 * nu)), 1.0),
        };
        Moduli {
            bulk,
            shear,
            lame: bulk - 2.0 * shear / dimension as f64,
            swelling,
        }
    }

    /// Stiffness of the bonds, Pa: the bond constant times the moment of the family,
    /// `4 delta b M = 2 (d + 2) mu` (Wang (2025), table 3-1). With Poisson's ratio of
    /// [`bond_based_poissons_ratio`] it is `2 d bulk`, that of the bond-based solid.
    pub fn bond_stiffness(&self, dimension: usize) -> f64 {
        2.0 * (dimension + 2) as f64 * self.shear
    }

    /// Derivative of the displacement along the axis of the normal at a face under `traction`, from
    /// the derivatives along the face (columns of `lateral`) and the in-plane eigenstrain. Wang (2025),
    /// eqs. 4.24 to 4.28; corrected, see docs/theory/mechanics.md. For small strains.
    pub fn slope_under_traction(
        &self,
        face: Face,
        traction: &Traction,
        lateral: &Matrix3<f64>,
        eigenstrain: f64,
        dimension: usize,
    ) -> Vector3<f64> {
        let (normal, d) = (face.axis(), dimension as f64);
        let sign = if face.is_upper() { 1.0 } else { -1.0 };
        let lame = self.lame;
        let swelling = match traction.difference {
            true => 0.0,
            false => d * self.bulk * eigenstrain,
        };
        let mut slope = Vector3::zeros();
        for axis in 0..dimension {
            let stress = sign * traction.stress[axis];
            slope[axis] = match axis == normal {
                true => {
                    let along: f64 = (0..dimension).map(|a| lateral[(a, a)]).sum();
                    (stress + swelling - lame * along) / (lame + 2.0 * self.shear)
                }
                false => stress / self.shear - lateral[(normal, axis)],
            };
        }
        slope
    }

    /// Stress across the plane under plane strain, Pa, from that in the plane (xx, yy, ...) and the
    /// in-plane eigenstrain and the inelastic strain across: `nu (xx + yy) - 2 mu e - E e_zz`.
    pub fn stress_across(&self, stress: &[f64; 6], eigenstrain: f64, inelastic: f64) -> f64 {
        let poissons_ratio = 0.5 * (1.0 - self.shear / self.bulk);
        let strain = eigenstrain + (1.0 + poissons_ratio) * inelastic;
        poissons_ratio * (stress[0] + stress[1]) - 2.0 * self.shear * strain
    }

    /// `a` of Wang (2025), table 3-1, Pa: the stiffness against dilatation besides that of the bonds. Negative
    /// if Poisson's ratio is below that of the bond-based solid.
    pub fn dilatation_stiffness(&self, dimension: usize) -> f64 {
        let d = dimension as f64;
        0.5 * (self.bulk - (d + 2.0) / d * self.shear)
    }
}

/// Poisson's ratio of a bond-based solid.
pub fn bond_based_poissons_ratio(dimension: usize, plane: Plane) -> f64 {
    match (dimension, plane) {
        (2, Plane::Stress) => 1.0 / 3.0,
        _ => 0.25,
    }
}

/// Elastic properties of the materials of a body and the moduli that they give.
#[derive(Debug)]
pub struct Elasticity {
    dimension: usize,
    plane: Plane,
    youngs_modulus: Vec<Property>,
    /// `None` for that of a bond-based solid.
    poissons_ratio: Option<Vec<Property>>,
}

impl Elasticity {
    /// Takes the properties of the materials of `body`; Poisson's ratio only where the formulation
    /// permits any.
    ///
    /// # Errors
    /// A material lacks one.
    pub fn of(
        setup: &Setup<'_>,
        body: usize,
        plane: Plane,
        bond_based: bool,
    ) -> Result<Self, SetupError> {
        let poissons_ratio = match bond_based || setup.body(body).dimension == 1 {
            true => None,
            false => Some(setup.world().property(body, "poissons_ratio")?),
        };
        for ratio in poissons_ratio.iter().flatten() {
            // of the ends of the range the bulk or the shear modulus is infinite
            if let Some(value) = [-1.0, 0.5]
                .into_iter()
                .find(|end| ratio.values().contains(end))
            {
                let message = format!("a material of the body has the `poissons_ratio` {value}");
                let expected = "a number above -1 and below 0.5, such as 0.499";
                return Err(SetupError::value("", message, expected));
            }
        }
        Ok(Elasticity {
            dimension: setup.body(body).dimension,
            plane,
            youngs_modulus: setup.world().property(body, "youngs_modulus")?,
            poissons_ratio,
        })
    }

    /// The isotropic solid that stands for a law with constants of its own, by a Young's modulus of the law.
    ///
    /// # Errors
    /// A material lacks the property.
    pub fn alike(
        setup: &Setup<'_>,
        body: usize,
        plane: Plane,
        property: &str,
    ) -> Result<Self, SetupError> {
        let youngs_modulus = setup.world().property(body, property)?;
        let dimension = setup.body(body).dimension;
        Ok(Elasticity {
            plane,
            ..Elasticity::bond_based(youngs_modulus, dimension)
        })
    }

    /// Young's moduli and the Poisson's ratio of a bond-based solid, in plane stress.
    pub fn bond_based(youngs_modulus: Vec<Property>, dimension: usize) -> Self {
        Elasticity {
            dimension,
            plane: Plane::Stress,
            youngs_modulus,
            poissons_ratio: None,
        }
    }

    /// Whether Poisson's ratio is that of the material, not that of a bond-based solid.
    pub fn has_free_poissons_ratio(&self) -> bool {
        self.poissons_ratio.is_some()
    }

    /// Whether the body is in plane strain.
    pub fn is_plane_strain(&self) -> bool {
        self.dimension == 2 && self.plane == Plane::Strain
    }

    /// Moduli of a material at a temperature, K.
    pub fn at(&self, material: usize, temperature: f64) -> Moduli {
        let at = |p: &[Property]| p[material].at(temperature, 0.0);
        let poissons_ratio = self
            .poissons_ratio
            .as_deref()
            .map_or_else(|| bond_based_poissons_ratio(self.dimension, self.plane), at);
        let youngs_modulus = at(&self.youngs_modulus);
        Moduli::new(youngs_modulus, poissons_ratio, self.dimension, self.plane)
    }

    /// The moduli, where they are the same everywhere at any temperature.
    pub fn uniform(&self) -> Option<Moduli> {
        let constant = |properties: &[Property]| {
            let first = properties[0].constant();
            first.filter(|_| properties.iter().all(|p| p.constant() == first))
        };
        constant(&self.youngs_modulus)?;
        if let Some(ratios) = &self.poissons_ratio {
            constant(ratios)?;
        }
        Some(self.at(0, 0.0))
    }

    /// The least Poisson's ratio of all materials at any temperature.
    pub fn least_poissons_ratio(&self) -> f64 {
        let ratios = self.poissons_ratio.iter().flatten();
        let least = ratios.flat_map(|p| p.values()).reduce(f64::min);
        least.unwrap_or_else(|| bond_based_poissons_ratio(self.dimension, self.plane))
    }

    /// The stiffest moduli of a material over its temperature range, for the stable step.
    pub fn stiffest(&self, material: usize) -> Moduli {
        let largest = |p: &Property| p.values().into_iter().fold(0.0, f64::max);
        let poissons_ratio = self.poissons_ratio.as_deref().map_or_else(
            || bond_based_poissons_ratio(self.dimension, self.plane),
            |p| largest(&p[material]),
        );
        let youngs_modulus = largest(&self.youngs_modulus[material]);
        Moduli::new(youngs_modulus, poissons_ratio, self.dimension, self.plane)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::material;

    const E: f64 = 200e9;
    const NU: f64 = 0.3;

    fn close(found: f64, expected: f64) {
        let error = (found - expected).abs();
        assert!(error <= 1e-12 * expected.abs().max(E), "{found} {expected}");
    }

    /// Shear modulus, and Lamé constant of the dimension: `E nu / ((1 + nu) (1 - 2 nu))`, in plane stress
    /// `E nu / (1 - nu²)`; the bulk modulus of d dimensions is `lame + 2 shear / d`.
    #[test]
    fn moduli_are_those_of_hookes_law() {
        let full = E * NU / ((1.0 + NU) * (1.0 - 2.0 * NU));
        for (dimension, plane, lame, swelling) in [
            (2, Plane::Stress, E * NU / (1.0 - NU * NU), 1.0),
            (2, Plane::Strain, full, 1.0 + NU),
            (3, Plane::Stress, full, 1.0),
            (3, Plane::Strain, full, 1.0),
        ] {
            let moduli = Moduli::new(E, NU, dimension, plane);
            close(moduli.shear, E / 2.6);
            close(moduli.lame, lame);
            close(moduli.bulk, lame + 2.0 * moduli.shear / dimension as f64);
            close(moduli.swelling, swelling);
        }
        let bar = Moduli::new(E, NU, 1, Plane::Stress);
        let found = [bar.bulk, bar.shear, bar.lame, bar.swelling];
        let expected = [E, E / 3.0, E / 3.0, 1.0];
        found
            .into_iter()
            .zip(expected)
            .for_each(|(a, b)| close(a, b));
    }

    /// With Poisson's ratio of the bonds their stiffness is `2 d bulk`, and nothing is left for the dilatation; else it is
    /// `(bulk - (d + 2) / d shear) / 2`.
    #[test]
    fn bonds_carry_all_of_a_bond_based_solid() {
        for (dimension, plane) in [
            (1, Plane::Stress),
            (2, Plane::Stress),
            (2, Plane::Strain),
            (3, Plane::Stress),
        ] {
            let ratio = bond_based_poissons_ratio(dimension, plane);
            let d = dimension as f64;
            let bonds = Moduli::new(E, ratio, dimension, plane);
            close(bonds.bond_stiffness(dimension), 2.0 * d * bonds.bulk);
            close(bonds.dilatation_stiffness(dimension), 0.0);
        }
        let moduli = Moduli::new(E, NU, 3, Plane::Stress);
        close(moduli.bond_stiffness(3), 10.0 * moduli.shear);
        let rest = 0.5 * (moduli.bulk - 5.0 / 3.0 * moduli.shear);
        close(moduli.dilatation_stiffness(3), rest);
    }

    /// The derivative of the displacement along the normal, for the traction that Hooke's law gives for it,
    /// `sigma = lame tr(e) 1 + 2 shear e - d bulk eigenstrain 1`; a difference of tractions has no eigenstrain.
    #[test]
    fn the_slope_at_a_face_belongs_to_its_traction() {
        let gradient = Matrix3::new(1e-3, 2e-4, -5e-4, 7e-4, -3e-4, 4e-4, 1e-4, -6e-4, 8e-4);
        for (dimension, plane) in [(2, Plane::Stress), (2, Plane::Strain), (3, Plane::Stress)] {
            let moduli = Moduli::new(E, NU, dimension, plane);
            let mut gradient = gradient;
            if dimension == 2 {
                gradient.fill_row(2, 0.0);
                gradient.fill_column(2, 0.0);
            }
            let strain: Matrix3<f64> = (gradient + gradient.transpose()) * 0.5;
            for (difference, eigenstrain) in [(false, 2e-4), (true, 0.0)] {
                let hydrostatic =
                    moduli.lame * strain.trace() - dimension as f64 * moduli.bulk * eigenstrain;
                let stress = Matrix3::identity() * hydrostatic + strain * (2.0 * moduli.shear);
                for face in Face::ALL.into_iter().filter(|f| f.axis() < dimension) {
                    let normal = face.axis();
                    let traction = Traction {
                        stress: (stress * face.normal()).into(),
                        difference,
                    };
                    let mut lateral = gradient;
                    lateral.fill_column(normal, 0.0);
                    // a difference does not see the eigenstrain of the body
                    let seen = if difference { 5e-4 } else { eigenstrain };
                    let slope =
                        moduli.slope_under_traction(face, &traction, &lateral, seen, dimension);
                    for axis in 0..dimension {
                        let expected = gradient[(axis, normal)];
                        let error = (slope[axis] - expected).abs();
                        assert!(error < 1e-15, "{dimension}D {}: {slope}", face.name());
                    }
                }
            }
        }
    }

    /// `nu (xx + yy) - E alpha dT` across the plane, of which the in-plane eigenstrain is `(1 + nu) alpha dT`.
    #[test]
    fn plane_strain_has_a_stress_across_the_plane() {
        let moduli = Moduli::new(E, NU, 2, Plane::Strain);
        let stress = [90e6, -20e6, 0.0, 5e6, 0.0, 0.0];
        let (thermal, inelastic) = (1e-3, 4e-4);
        let expected = NU * 70e6 - E * thermal - E * inelastic;
        let found = moduli.stress_across(&stress, (1.0 + NU) * thermal, inelastic);
        assert!((found / expected - 1.0).abs() < 1e-12, "{found} {expected}");
    }

    #[test]
    fn elasticity_is_uniform_where_all_materials_are_alike_and_constant() {
        let steel = "youngs_modulus = 200e9\npoissons_ratio = 0.3";
        let table = "youngs_modulus = { temperature = [300, 1300], value = [200e9, 50e9] }\npoissons_ratio = { temperature = [300, 1300], value = [0.3, 0.4] }";
        let soft = "youngs_modulus = 70e9\npoissons_ratio = 0.3";
        let incompressible = "youngs_modulus = 200e9\npoissons_ratio = 0.45";
        let of = |materials: &[&str], is_free: bool| {
            let all = |name: &str| -> Vec<Property> {
                let materials = materials.iter().map(|m| material(m));
                materials
                    .map(|m| m.get(name).cloned().expect("given"))
                    .collect()
            };
            Elasticity {
                dimension: 2,
                plane: Plane::Stress,
                youngs_modulus: all("youngs_modulus"),
                poissons_ratio: is_free.then(|| all("poissons_ratio")),
            }
        };
        let third = Moduli::new(E, 1.0 / 3.0, 2, Plane::Stress);
        for (materials, is_free, expected) in [
            (
                &[steel][..],
                true,
                Some(Moduli::new(E, NU, 2, Plane::Stress)),
            ),
            (
                &[steel, steel],
                true,
                Some(Moduli::new(E, NU, 2, Plane::Stress)),
            ),
            (&[steel, soft], true, None),
            (&[steel, incompressible], true, None),
            // Poisson's ratio is that of the bonds
            (&[steel, incompressible], false, Some(third)),
            (&[steel, table], true, None),
            (&[table], false, None),
        ] {
            let elasticity = of(materials, is_free);
            assert_eq!(elasticity.uniform(), expected, "{materials:?}");
            assert_eq!(elasticity.has_free_poissons_ratio(), is_free);
        }
        let hot = of(&[steel, table], true);
        assert_eq!(hot.at(1, 800.0), Moduli::new(125e9, 0.35, 2, Plane::Stress));
        assert_eq!(hot.stiffest(1), Moduli::new(E, 0.4, 2, Plane::Stress));
        let bonds = Elasticity::bond_based(of(&[table], true).youngs_modulus, 2);
        assert_eq!(bonds.stiffest(0), third);
        for (dimension, plane, expected) in [
            (2, Plane::Strain, true),
            (2, Plane::Stress, false),
            (3, Plane::Strain, false),
        ] {
            let elasticity = Elasticity {
                dimension,
                plane,
                ..of(&[steel], true)
            };
            assert_eq!(elasticity.is_plane_strain(), expected);
        }
    }
}
