//! Laws of elasticity as plugins: the key `law` of `mechanical`.
//!
//! A law is the struct of its keys in the case file, `law.<name> = { keys }`. Its kind decides which formulations it serves:
//! [`BondLaw`] those with forces along bonds. Constants are properties of materials. `linear` serves all formulations.

use std::fmt::Debug;
use std::sync::Arc;

use perimelt_core::law::{Constant, Constants, Law, LawFacts, LawKind, LawRegistration};
use perimelt_core::{Body, Family, SetupError};

use super::gradient::FlatFamily;
use super::keys::Formulation;
use super::linear::LinearSolids;
use super::ordinary::Ordinary;
use super::solid::{Constitution, Solid};
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
    /// Constants of the law, in the order of their declaration.
    pub constants: &'a [f64],
}

/// A law of elasticity: it makes the solid that it is compiled into.
pub trait ElasticLaw: Debug + Send + Sync + erased_serde::Serialize {
    /// Properties of materials that the law needs besides the elastic ones.
    fn constants(&self) -> &'static [Constant];

    /// Whether the stress is in proportion to the strain.
    fn is_linear(&self) -> bool;

    /// Checks the keys, and computes from them what the solid needs.
    ///
    /// # Errors
    /// A value that makes no sense; the key of the error begins behind the name of the law.
    fn prepare(&mut self) -> Result<(), SetupError>;

    /// The solid of a body, in one of the formulations that the law serves.
    ///
    /// # Errors
    /// A body that the formulation does not support.
    fn solid(&self, parts: Parts<'_>) -> Result<Box<dyn Solid>, SetupError>;
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

    fn solid(&self, parts: Parts<'_>) -> Result<Box<dyn Solid>, SetupError> {
        let Parts {
            body,
            family,
            constitution,
            constants,
            ..
        } = parts;
        let mut values = BondConstants::default();
        values[..constants.len()].copy_from_slice(constants);
        let law = BodyLaw::new(self.0, values);
        match constitution.elasticity.has_free_poissons_ratio() {
            true => boxed(Ordinary::new(body, family, constitution, States(law))),
            false => boxed(Ordinary::new(body, family, constitution, Pairs(law))),
        }
    }
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

impl LawKind for dyn ElasticLaw {
    const KEY: &'static str = "law";

    fn registrations() -> Box<dyn Iterator<Item = &'static LawRegistration<Self>>> {
        let all = perimelt_core::inventory::iter::<ElasticRegistration>;
        Box::new(all.into_iter().map(|registration| &registration.law))
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

#[doc(hidden)]
#[macro_export]
macro_rules! register_elastic_law {
    ($name:literal, $law:ty, $kind:ty) => {
        $crate::perimelt_core::inventory::submit! {
            $crate::mechanical::law::ElasticRegistration {
                law: $crate::perimelt_core::law::LawRegistration {
                    name: $name,
                    schema: |generator| generator.subschema_for::<$law>(),
                    from_keys: |keys| {
                        let law: $law = $crate::perimelt_core::erased_serde::deserialize(keys)?;
                        Ok(Box::new(<$kind>::from(law)))
                    },
                    facts: <$kind>::FACTS,
                },
                formulations: <$kind>::FORMULATIONS,
            }
        }
    };
}

fn quoted(formulation: Formulation) -> String {
    format!("\"{}\"", formulation.name())
}

/// The law of elasticity of a body.
#[derive(Debug)]
pub(super) struct ChosenLaw(Law<dyn ElasticLaw>);

impl ChosenLaw {
    /// The law that the keys of a physics choose, and the linear one where they choose none.
    ///
    /// # Errors
    /// A law that does not serve the formulation, or whose keys make no sense.
    pub(super) fn of(
        law: Option<Law<dyn ElasticLaw>>,
        formulation: Formulation,
    ) -> Result<Self, SetupError> {
        let Some(mut law) = law else {
            return Ok(ChosenLaw(Law {
                name: "linear",
                law: Box::new(LinearSolids::from(Linear {})),
            }));
        };
        let all = || perimelt_core::inventory::iter::<ElasticRegistration>.into_iter();
        let serves = |r: &&ElasticRegistration| r.formulations.contains(&formulation);
        if !all().filter(serves).any(|r| r.law.name == law.name) {
            let own = all().filter(|r| r.law.name == law.name);
            let fitting = own.flat_map(|r| r.formulations).map(|f| quoted(*f));
            let mut others: Vec<_> = all().filter(serves).map(|r| r.law.name).collect();
            others.sort_unstable();
            let message = format!(
                "the law `{}` does not fit `formulation` {}",
                law.name,
                quoted(formulation)
            );
            let fitting: Vec<_> = fitting.collect();
            let mut expected = format!("`formulation` {}", fitting.join(" or "));
            if !others.is_empty() {
                expected += &format!(", or a law that fits: {}", others.join(", "));
            }
            return Err(SetupError::value(Self::KEY, message, expected));
        }
        let key = format!("{}.{}", Self::KEY, law.name);
        law.law.prepare().map_err(|error| SetupError {
            key: format!("{key}.{}", error.key),
            ..error
        })?;
        Ok(ChosenLaw(law))
    }

    const KEY: &'static str = <dyn ElasticLaw as LawKind>::KEY;

    /// Whether the stress is in proportion to the strain.
    pub(super) fn is_linear(&self) -> bool {
        self.0.law.is_linear()
    }

    /// The law in a message.
    pub(super) fn name(&self) -> String {
        format!("{}.{}", Self::KEY, self.0.name)
    }

    /// The constants of the law in a body.
    ///
    /// # Errors
    /// A material without one of them, materials that differ in one or a dependence on the temperature.
    pub(super) fn constants(&self, body: &Body) -> Result<Vec<f64>, SetupError> {
        let constants = self.0.law.constants();
        let name = self.name();
        let of_body = Constants::of(body, &name, &name, constants)?;
        let common = of_body.common();
        common.map_err(|constant| {
            let property = constants[constant].property;
            let message = format!("`{property}` is not one number for body `{}`", body.name);
            let expected = format!(
                "the same number for all materials of the body: `{name}` does not change from point to point"
            );
            SetupError::value(&name, message, expected)
        })
    }

    /// See [`ElasticLaw::solid`].
    pub(super) fn solid(&self, parts: Parts<'_>) -> Result<Box<dyn Solid>, SetupError> {
        self.0.law.solid(parts)
    }
}
