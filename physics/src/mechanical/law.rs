//! Laws of elasticity as plugins: the key `law` of `mechanical`.
//!
//! A law is the struct of its keys in the case file, `law.<name> = { keys }`. Its kind decides which formulations it serves:
//! [`BondLaw`] those with forces along bonds, [`PointLaw`] those with strains at points; `linear` serves all. Constants are properties of
//! materials.

use std::fmt::Debug;
use std::sync::Arc;

use perimelt_core::family::LayerRule;
use perimelt_core::law::{Constant, Constants, Law, LawFacts, LawKind, LawRegistration};
use perimelt_core::named::{HasName, by_name};
use perimelt_core::world::BodyIndex;
use perimelt_core::{Body, Family, Setup, SetupError};

use super::correspondence::{Correspondence, Settings};
use super::fields::{has_tensor_eigenstrain, is_conjugate_tensor_read};
use super::gradient::FlatFamily;
use super::keys::Formulation;
use super::laminate::no_layup;
use super::law_states::visit_states;
use super::linear::LinearSolids;
use super::ordinary::Ordinary;
use super::plasticity::ChosenFlow;
use super::points::{LawPoints, Measure, PointLaw, PointResponse};
use super::solid::{Constitution, Solid};
use super::staggered;
use super::stretch::{BodyLaw, BondConstants, BondLaw, Linear, Pairs, States};

/// What a solid is made of, besides its law.
#[derive(Debug)]
pub struct Parts<'a> {
    /// The body.
    pub body: &'a Body,
    /// Its bonds.
    pub family: Arc<Family>,
    /// Moduli, plastic flow, strength and kinematics.
    pub constitution: Constitution,
    /// The formulation.
    pub formulation: Formulation,
    /// Stabilisation G of modes without strain, if it is given.
    pub stabilisation: Option<f64>,
    /// Name of the law.
    pub name: &'static str,
    /// Constants of the law.
    pub constants: Constants,
}

/// A law of elasticity: it makes the solid that it is compiled into.
pub trait ElasticLaw: Debug + Send + Sync + erased_serde::Serialize {
    /// Properties of materials that the law needs besides the elastic ones.
    fn constants(&self) -> &'static [Constant];

    /// Whether the stress is in proportion to the strain.
    fn is_linear(&self) -> bool;

    /// Whether the law is that of the plies of a lay-up. Its constants take the place of Young's modulus and Poisson's ratio.
    fn is_of_plies(&self) -> bool {
        false
    }

    /// Whether it takes a stress-free strain with components. A law that is linear does.
    fn takes_tensor_strain(&self) -> bool {
        self.is_linear()
    }

    /// The property that takes the place of Young's modulus; Poisson's ratio is then that of bonds, see
    /// [`PointLaw::YOUNGS_MODULUS`].
    fn youngs_modulus(&self) -> Option<&'static str> {
        None
    }

    /// Checks the keys, and computes from them what the solid needs.
    ///
    /// # Errors
    /// A value that makes no sense; the key of the error begins behind the name of the law.
    fn prepare(&mut self) -> Result<(), SetupError>;

    /// The solid of a body, in one of the formulations that the law serves.
    ///
    /// # Errors
    /// A body that the formulation does not support.
    fn solid(self: Box<Self>, parts: Parts<'_>) -> Result<Box<dyn Solid>, SetupError>;
}

erased_serde::serialize_trait_object!(ElasticLaw);

/// A law of bonds.
#[derive(Debug, serde::Serialize)]
#[serde(transparent)]
pub struct OfBonds<L>(L);

impl<L: BondLaw> OfBonds<L> {
    /// The formulations that the law serves.
    pub const FORMULATIONS: &'static [Formulation] = &[Formulation::Bond, Formulation::Ordinary];

    /// What `perimelt explain` says besides the keys.
    pub const FACTS: LawFacts = LawFacts {
        constants: L::CONSTANTS,
        state: &[],
        others: &[
            (
                "tangent",
                "closed form; differences of forces in finite kinematics",
            ),
            ("formulations", "bond, ordinary"),
        ],
    };
}

impl<L> From<L> for OfBonds<L> {
    fn from(law: L) -> Self {
        OfBonds(law)
    }
}

impl<L: BondLaw> ElasticLaw for OfBonds<L> {
    fn constants(&self) -> &'static [Constant] {
        L::CONSTANTS
    }

    fn is_linear(&self) -> bool {
        L::IS_LINEAR
    }

    fn prepare(&mut self) -> Result<(), SetupError> {
        self.0.prepare()
    }

    fn solid(self: Box<Self>, parts: Parts<'_>) -> Result<Box<dyn Solid>, SetupError> {
        let constants = common_constants(&parts, L::CONSTANTS)?;
        let Parts {
            body,
            family,
            constitution,
            ..
        } = parts;
        let mut values = BondConstants::default();
        values[..constants.len()].copy_from_slice(&constants);
        let law = BodyLaw::new(self.0, values);
        match constitution.elasticity.has_free_poissons_ratio() {
            true => boxed(Ordinary::new(body, family, constitution, States(law))),
            false => boxed(Ordinary::new(body, family, constitution, Pairs(law))),
        }
    }
}

/// A law of points.
#[derive(Debug, serde::Serialize)]
#[serde(transparent)]
pub struct OfPoints<L>(L);

impl<L: PointLaw> OfPoints<L> {
    /// The formulations that the law serves.
    pub const FORMULATIONS: &'static [Formulation] =
        &[Formulation::Correspondence, Formulation::Staggered];

    /// What `perimelt explain` says besides the keys.
    pub const FACTS: LawFacts = LawFacts {
        constants: L::CONSTANTS,
        state: L::STATE,
        others: &[
            (
                "strain",
                match L::STRAIN {
                    Measure::Strain => "small strain; of Green and Lagrange in finite kinematics",
                    Measure::Gradient => "deformation gradient, in finite kinematics",
                    Measure::StrainOrGradient => {
                        "small strain; deformation gradient in finite kinematics"
                    }
                },
            ),
            (
                "tangent",
                if L::HAS_TANGENT {
                    "closed form; central differences in plane stress"
                } else {
                    "central differences"
                },
            ),
            ("formulations", "correspondence, staggered"),
        ],
    };
}

impl<L> From<L> for OfPoints<L> {
    fn from(law: L) -> Self {
        OfPoints(law)
    }
}

impl<L: PointLaw> ElasticLaw for OfPoints<L> {
    fn constants(&self) -> &'static [Constant] {
        L::CONSTANTS
    }

    fn is_linear(&self) -> bool {
        false
    }

    fn takes_tensor_strain(&self) -> bool {
        true
    }

    fn youngs_modulus(&self) -> Option<&'static str> {
        L::YOUNGS_MODULUS
    }

    fn prepare(&mut self) -> Result<(), SetupError> {
        PointLaw::prepare(&mut self.0)
    }

    fn solid(self: Box<Self>, parts: Parts<'_>) -> Result<Box<dyn Solid>, SetupError> {
        let Parts {
            body,
            constitution,
            name,
            ..
        } = &parts;
        if body.dimension == 1 {
            let message = format!("`{}` needs strains across", key_of(name));
            let expected = "a body of two or three dimensions";
            return Err(SetupError::value("body", message, expected));
        }
        if L::STRAIN == Measure::Gradient && !constitution.finite {
            let message = format!("`{}` follows the deformation gradient", key_of(name));
            return Err(SetupError::value(
                "kinematics",
                message,
                "`kinematics = \"finite\"`",
            ));
        }
        check_constants(&self.0, &parts)?;
        with_strains(parts, Some(Box::new(self.0)))
    }
}

/// Checks the constants of each material at the temperatures of their tables.
fn check_constants<L: PointLaw>(law: &L, parts: &Parts<'_>) -> Result<(), SetupError> {
    visit_states(
        parts.body,
        &parts.constants,
        L::CONSTANTS.len(),
        |values, of| {
            let checked = law.check(values, of);
            checked.map_err(|e| e.below(&key_of(parts.name)))
        },
    )
}

/// The constants of a law that does not change from point to point.
///
/// # Errors
/// One in which materials differ, or which depends on the temperature.
pub(super) fn common_constants(
    parts: &Parts<'_>,
    constants: &[Constant],
) -> Result<Vec<f64>, SetupError> {
    parts.constants.common().map_err(|constant| {
        let (name, body) = (key_of(parts.name), &parts.body.name);
        let property = constants[constant].property;
        let message = format!("`{property}` is not one number for body `{body}`");
        let expected = format!(
            "the same number for all materials of the body: `{name}` does not change from point to point"
        );
        SetupError::value(name, message, expected)
    })
}

/// The solid of a body in a formulation with strains at points, which follow a law or the linear one.
pub(super) fn with_strains(
    parts: Parts<'_>,
    law: Option<Box<dyn PointResponse>>,
) -> Result<Box<dyn Solid>, SetupError> {
    let law = law.map(|law| LawPoints::new(parts.name, law, parts.constants, parts.body));
    if parts.formulation == Formulation::Staggered {
        return staggered::solid(parts.body, parts.constitution, law, parts.stabilisation);
    }
    let settings = Settings {
        law,
        stabilisation: parts.stabilisation.unwrap_or(0.1),
    };
    boxed(Correspondence::new(
        parts.body,
        parts.family,
        parts.constitution,
        settings,
    ))
}

/// A solid, or the reason why a formulation does not support its body.
pub(super) fn boxed(
    solid: Result<impl Solid + 'static, FlatFamily>,
) -> Result<Box<dyn Solid>, SetupError> {
    match solid {
        Ok(solid) => Ok(Box::new(solid)),
        Err(error) => Err(SetupError::other("", error)),
    }
}

/// A registered law of elasticity.
pub struct ElasticRegistration {
    /// Name, keys and facts.
    pub law: LawRegistration<dyn ElasticLaw>,
    /// The formulations that it serves.
    pub formulations: &'static [Formulation],
}

perimelt_core::inventory::collect!(ElasticRegistration);

impl HasName for ElasticRegistration {
    fn name(&self) -> &'static str {
        self.law.name
    }
}

impl LawKind for dyn ElasticLaw {
    const KEY: &'static str = "law";

    fn registered() -> Vec<&'static LawRegistration<Self>> {
        by_name(|registration: &'static ElasticRegistration| &registration.law)
    }
}

/// Makes a [`BondLaw`] known as `law.<name>`: `register_bond_law!("stiffening", Stiffening)`. The law implements `Serialize`,
/// `Deserialize` (with `deny_unknown_fields`) and `JsonSchema`.
#[macro_export]
macro_rules! register_bond_law {
    ($name:literal, $law:ty) => {
        $crate::register_elastic_law!($name, $law, $crate::mechanical::law::OfBonds<$law>);
    };
}

/// Makes a [`PointLaw`] known as `law.<name>`, as [`register_bond_law!`](crate::register_bond_law) does a [`BondLaw`].
#[macro_export]
macro_rules! register_point_law {
    ($name:literal, $law:ty) => {
        $crate::register_elastic_law!($name, $law, $crate::mechanical::law::OfPoints<$law>);
    };
}

#[doc(hidden)]
#[macro_export]
macro_rules! register_elastic_law {
    ($name:literal, $law:ty, $kind:ty) => {
        $crate::perimelt_core::inventory::submit! {
            $crate::mechanical::law::ElasticRegistration {
                law: $crate::perimelt_core::law_registration!($name, $law, <$kind>::from, <$kind>::FACTS),
                formulations: <$kind>::FORMULATIONS,
            }
        }
    };
}

fn quoted(formulation: Formulation) -> String {
    format!("\"{}\"", formulation.name())
}

/// The key of a law.
fn key_of(name: &str) -> String {
    format!("{}.{name}", <dyn ElasticLaw>::KEY)
}

/// The law of elasticity of a body.
#[derive(Debug)]
pub(super) struct ChosenLaw {
    pub(super) law: Box<dyn ElasticLaw>,
    pub(super) name: &'static str,
}

impl ChosenLaw {
    /// The law that the keys of a physics choose, and the linear one where they choose none.
    ///
    /// # Errors
    /// A law that does not serve the formulation, or whose keys make no sense.
    pub(super) fn of(
        law: Option<Law<dyn ElasticLaw>>,
        formulation: Formulation,
    ) -> Result<Self, SetupError> {
        let Some(Law { name, mut law }) = law else {
            return Ok(ChosenLaw {
                name: "linear",
                law: Box::new(LinearSolids::from(Linear {})),
            });
        };
        let all = by_name(|registration: &'static ElasticRegistration| registration);
        let own = all.iter().filter(|r| r.law.name == name);
        let own: Vec<Formulation> = own.flat_map(|r| r.formulations).copied().collect();
        if !own.contains(&formulation) {
            let fitting: Vec<_> = own.into_iter().map(quoted).collect();
            let serving = all.iter().filter(|r| r.formulations.contains(&formulation));
            let others: Vec<_> = serving.map(|r| key_of(r.law.name)).collect();
            let message = format!(
                "the law `{name}` does not fit `formulation` {}",
                quoted(formulation)
            );
            let expected = format!(
                "`formulation` {}, or one of the laws that fit: `{}`",
                fitting.join(" or "),
                others.join("`, `")
            );
            return Err(SetupError::value("law", message, expected));
        }
        law.prepare().map_err(|e| e.below(&key_of(name)))?;
        Ok(ChosenLaw { name, law })
    }

    /// Refuses what only the linear law supports.
    ///
    /// # Errors
    /// A flow, a traction by a layer or a stress-free strain with components beside another law.
    pub(super) fn check(
        &self,
        setup: &Setup<'_>,
        body: BodyIndex,
        flow: Option<&ChosenFlow>,
        bent: Option<&LayerRule>,
    ) -> Result<(), SetupError> {
        if self.law.is_linear() {
            return Ok(());
        }
        let key = key_of(self.name);
        let refuse = |message: String, expected: &str| {
            Err(SetupError::value(
                &key,
                message,
                format!("`law.linear`, or {expected}"),
            ))
        };
        if let Some(flow) = flow {
            let message = format!(
                "the law of flow in `{}` starts from a stress in proportion to the strain",
                flow.key()
            );
            return refuse(message, "no plastic flow");
        }
        if let Some(rule) = bent {
            let message = format!(
                "the traction on face `{}` acts by a layer, whose strain is that of a linear law",
                rule.face.name()
            );
            return refuse(message, "`by = \"body_force\"` in `traction`");
        }
        if setup.world().is_growing(body) {
            let message =
                "material that is deposited or cut off takes its stress from a linear law";
            return refuse(message.into(), "a body that does not change");
        }
        if !self.law.takes_tensor_strain()
            && (has_tensor_eigenstrain(setup, body) || is_conjugate_tensor_read(setup, body))
        {
            let message = "a stress-free strain that differs by direction makes its stress by a linear law or by one of points";
            return refuse(message.into(), "no such strain");
        }
        Ok(())
    }

    /// Refuses plies without their law, and their law without plies.
    ///
    /// # Errors
    /// See above.
    pub(super) fn check_plies(&self, body: &Body) -> Result<(), SetupError> {
        match (self.law.is_of_plies(), body.layers()) {
            (true, None) => Err(no_layup(body)),
            (false, Some(_)) => {
                let message = format!("body `{}` has a `layup`", body.name);
                let expected =
                    "`formulation = \"bond\"` with `law.lamina = {}`, or a body without plies";
                Err(SetupError::value("law", message, expected))
            }
            _ => Ok(()),
        }
    }

    /// The constants of the law in a body.
    ///
    /// # Errors
    /// A material without one of them.
    pub(super) fn constants(&self, body: &Body) -> Result<Constants, SetupError> {
        let key = key_of(self.name);
        Constants::of(body, &key, &key, self.law.constants())
    }
}
