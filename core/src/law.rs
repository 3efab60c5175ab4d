//! Laws as plugins: a kind of law is a trait object, and a law of a crate makes itself known under a name.
//!
//! A key of a plugin whose value is a [`Law`] takes `name = { keys }`: the name chooses the registration, which reads the
//! keys. Constants of a law are properties of materials ([`Constant`]), its keys are choices of the model. The kind of law
//! collects the registrations ([`LawKind`]), so that messages, schemas, `list` and `explain` name every law.

use std::borrow::Cow;
use std::fmt;
use std::marker::PhantomData;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{DeserializeSeed, Deserializer, Error, MapAccess, Visitor};
use serde::ser::SerializeMap;
use serde::{Deserialize, Serialize, Serializer};
use serde_json::json;

use crate::body::Body;
use crate::error::{Problem, SetupError};
use crate::material::{Directional, Material, Property};
use crate::named::HasName;
use crate::solver::reduce::max_abs;

/// A property of the material that a law needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Constant {
    /// Name of the registered property.
    pub property: &'static str,
    /// Its value where a material has none; `None` where the law cannot do without.
    pub default: Option<f64>,
    /// Whether the law takes a property that differs along the axes of the material.
    pub has_directions: bool,
}

impl Constant {
    /// A property that every material must have.
    pub const fn required(property: &'static str) -> Self {
        Constant {
            property,
            default: None,
            has_directions: false,
        }
    }

    /// A property that every material must have, and which may differ along the axes of the material.
    pub const fn directional(property: &'static str) -> Self {
        Constant {
            has_directions: true,
            ..Constant::required(property)
        }
    }

    /// A property with a value for materials that do not have it.
    pub const fn or(property: &'static str, default: f64) -> Self {
        Constant {
            property,
            default: Some(default),
            has_directions: false,
        }
    }
}

/// What a state variable consists of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum VariableShape {
    /// One number.
    Scalar,
    /// A symmetric tensor, six numbers: xx, yy, zz, xy, yz, zx.
    Tensor,
    /// A tensor that is not symmetric, nine numbers by columns.
    Matrix,
    /// Numbers without directions.
    Numbers(usize),
}

/// A variable of the state of a point that a law declares. It becomes the field `<law>.<name>`; numbers become the fields
/// `<law>.<name>_1` and so on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StateVariable {
    /// Name behind that of the law.
    pub name: &'static str,
    /// SI unit.
    pub unit: &'static str,
    /// Meaning, in one line.
    pub meaning: &'static str,
    /// What it consists of.
    pub shape: VariableShape,
}

impl StateVariable {
    /// One number.
    pub const fn scalar(name: &'static str, unit: &'static str, meaning: &'static str) -> Self {
        StateVariable {
            name,
            unit,
            meaning,
            shape: VariableShape::Scalar,
        }
    }

    /// A symmetric tensor.
    pub const fn tensor(name: &'static str, unit: &'static str, meaning: &'static str) -> Self {
        StateVariable::scalar(name, unit, meaning).of_shape(VariableShape::Tensor)
    }

    /// With another shape.
    pub const fn of_shape(self, shape: VariableShape) -> Self {
        StateVariable { shape, ..self }
    }

    /// Numbers of the variable.
    pub const fn width(&self) -> usize {
        match self.shape {
            VariableShape::Scalar => 1,
            VariableShape::Tensor => 6,
            VariableShape::Matrix => 9,
            VariableShape::Numbers(count) => count,
        }
    }

    /// Numbers of all variables of a law.
    pub const fn width_of(variables: &[StateVariable]) -> usize {
        let (mut width, mut i) = (0, 0);
        while i < variables.len() {
            width += variables[i].width();
            i += 1;
        }
        width
    }
}

/// What `perimelt explain` says about a law besides its keys.
#[derive(Clone, Copy, Debug)]
pub struct LawFacts {
    /// Properties of materials that it needs.
    pub constants: &'static [Constant],
    /// Its state variables.
    pub state: &'static [StateVariable],
    /// Other facts: a heading and a text.
    pub others: &'static [(&'static str, &'static str)],
}

/// Reads a law from its keys.
pub type FromKeys<P> =
    fn(&mut dyn erased_serde::Deserializer<'_>) -> Result<Box<P>, erased_serde::Error>;

/// A registered law of the kind `P`.
pub struct LawRegistration<P: ?Sized + 'static> {
    /// Name in case files.
    pub name: &'static str,
    /// Keys, types, defaults, documentation.
    pub schema: fn(&mut SchemaGenerator) -> Schema,
    /// Constructor.
    pub from_keys: FromKeys<P>,
    /// Constants, state and more.
    pub facts: LawFacts,
}

impl<P: ?Sized> HasName for LawRegistration<P> {
    fn name(&self) -> &'static str {
        self.name
    }
}

/// The [`LawRegistration`] of a struct of keys: its name, its type, what makes the object of the kind of it, and its facts.
#[macro_export]
macro_rules! law_registration {
    ($name:expr, $law:ty, $object:expr, $facts:expr) => {
        $crate::law::LawRegistration {
            name: $name,
            schema: |generator| generator.subschema_for::<$law>(),
            from_keys: |keys| {
                let law: $law = $crate::erased_serde::deserialize(keys)?;
                Ok(Box::new($object(law)))
            },
            facts: $facts,
        }
    };
}

/// Makes a trait object a kind of law, with the struct that registers laws of this kind and the key of the plugin that takes
/// one: `law_kind!(pub FlowRegistration, dyn FlowSweep, "flow")`.
#[macro_export]
macro_rules! law_kind {
    ($(#[$doc:meta])* $visibility:vis $registration:ident, $object:ty, $key:literal) => {
        $(#[$doc])*
        $visibility struct $registration(pub $crate::law::LawRegistration<$object>);

        $crate::inventory::collect!($registration);

        impl $crate::law::LawKind for $object {
            const KEY: &'static str = $key;

            fn registered() -> Vec<&'static $crate::law::LawRegistration<Self>> {
                $crate::named::by_name(|registration: &'static $registration| &registration.0)
            }
        }
    };
}

/// A kind of law, such as that of plastic flow: the type of its objects.
pub trait LawKind: 'static {
    /// The key of the plugin that takes a law of this kind.
    const KEY: &'static str;

    /// All laws of this kind, by name ([`by_name`](crate::named::by_name)).
    fn registered() -> Vec<&'static LawRegistration<Self>>;
}

/// A law of the kind `P` in a case file: `name = { keys }`.
pub struct Law<P: ?Sized> {
    /// Name of the law.
    pub name: &'static str,
    /// The law.
    pub law: Box<P>,
}

impl<P: LawKind + ?Sized> Law<P> {
    /// The key of its table, such as `flow.j2`.
    pub fn key(&self) -> String {
        format!("{}.{}", P::KEY, self.name)
    }
}

impl<P: ?Sized> Clone for Law<P>
where
    Box<P>: Clone,
{
    fn clone(&self) -> Self {
        Law {
            name: self.name,
            law: self.law.clone(),
        }
    }
}

impl<P: ?Sized + fmt::Debug> fmt::Debug for Law<P> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} = {:?}", self.name, self.law)
    }
}

impl<P: ?Sized + Serialize> Serialize for Law<P> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(1))?;
        map.serialize_entry(self.name, &*self.law)?;
        map.end()
    }
}

impl<'de, P: LawKind + ?Sized> Deserialize<'de> for Law<P> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(LawVisitor(PhantomData))
    }
}

struct LawVisitor<P: ?Sized>(PhantomData<fn() -> Box<P>>);

impl<'de, P: LawKind + ?Sized> Visitor<'de> for LawVisitor<P> {
    type Value = Law<P>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "`name = {{ ... }}` with the keys of that law")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Law<P>, A::Error> {
        let wrong_number = |found| A::Error::custom(format!("wanted exactly 1 element, {found}"));
        let name = map.next_key_seed(LawName(PhantomData::<fn() -> Box<P>>))?;
        let registration = name.ok_or_else(|| wrong_number("found 0 elements"))?;
        let law = map.next_value_seed(LawKeys(registration))?;
        match map.next_key::<serde::de::IgnoredAny>()? {
            Some(_) => Err(wrong_number("more than 1 element")),
            None => Ok(Law {
                name: registration.name,
                law,
            }),
        }
    }
}

/// Finds the registration of a name.
struct LawName<P: ?Sized>(PhantomData<fn() -> Box<P>>);

impl<'de, P: LawKind + ?Sized> DeserializeSeed<'de> for LawName<P> {
    type Value = &'static LawRegistration<P>;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Self::Value, D::Error> {
        let name = Cow::<str>::deserialize(deserializer)?;
        let known = P::registered();
        let found = known.iter().find(|law| law.name == name);
        found.copied().ok_or_else(|| {
            let known: Vec<_> = known.iter().map(|law| format!("`{}`", law.name)).collect();
            let known = known.join(", ");
            D::Error::custom(format!("unknown variant `{name}`, expected one of {known}"))
        })
    }
}

/// Reads the keys of a law. An error keeps the names of the keys that lead to it in its text: places in the file do not
/// pass through [`erased_serde`].
struct LawKeys<P: ?Sized + 'static>(&'static LawRegistration<P>);

impl<'de, P: ?Sized> DeserializeSeed<'de> for LawKeys<P> {
    type Value = Box<P>;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Box<P>, D::Error> {
        let mut keys = <dyn erased_serde::Deserializer<'_>>::erase(deserializer);
        (self.0.from_keys)(&mut keys).map_err(D::Error::custom)
    }
}

/// One choice for each registered law, with its facts under `x-law`.
impl<P: LawKind + ?Sized> JsonSchema for Law<P> {
    fn schema_name() -> Cow<'static, str> {
        format!("{}_law", P::KEY).into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let choices = P::registered().into_iter().map(|law| {
            let keys = (law.schema)(generator);
            json!({
                "type": "object",
                "properties": { law.name: keys },
                "required": [law.name],
                "additionalProperties": false,
                "x-law": law.facts.lines(),
            })
        });
        let choices: Vec<_> = choices.collect();
        json_schema!({ "oneOf": choices })
    }
}

impl LawFacts {
    /// The facts in lines of text, such as `property yield_stress`.
    fn lines(&self) -> Vec<String> {
        let constants = self.constants.iter().map(|constant| {
            let name = constant.property;
            match constant.default {
                None => format!("property `{name}` of the material"),
                Some(value) => format!("property `{name}` of the material (default {value})"),
            }
        });
        let state = self.state.iter().map(|variable| {
            let StateVariable {
                name,
                unit,
                meaning,
                ..
            } = variable;
            format!("state variable `{name}` [{unit}] {meaning}")
        });
        let others = self.others.iter();
        let others = others.map(|(heading, text)| format!("{heading}: {text}"));
        constants.chain(state).chain(others).collect()
    }
}

/// The constants of a law for the materials of a body.
#[derive(Clone, Debug)]
pub struct Constants {
    count: usize,
    /// By material, then by constant.
    properties: Vec<ConstantOf>,
}

#[derive(Clone, Debug)]
enum ConstantOf {
    Given(Directional<Property>),
    Default(f64),
}

impl Constants {
    /// Takes the constants of `law`, such as `flow.j2`, which stands at `key`, from the materials of a body.
    ///
    /// # Errors
    /// A material without one of them, or with directions that the law does not take; the error names law, material and
    /// property.
    pub fn of(
        body: &Body,
        key: &str,
        law: &str,
        constants: &[Constant],
    ) -> Result<Self, SetupError> {
        let one = |(material, constant): (&Material, &Constant)| {
            if !constant.has_directions {
                let same = material.same_in_all_directions(constant.property);
                same.map_err(|e| SetupError::other(key, e))?;
            }
            let found = material.directional(constant.property).cloned();
            let found = found.map(ConstantOf::Given);
            let found = found.or(constant.default.map(ConstantOf::Default));
            found.ok_or_else(|| {
                let problem = Problem::MissingConstant {
                    material: material.name().into(),
                    body: body.name.clone(),
                    property: constant.property.into(),
                    law: law.into(),
                };
                SetupError::new(key, problem)
            })
        };
        let materials = body.materials.iter();
        let all = materials.flat_map(|m| constants.iter().map(move |c| (m, c)));
        Ok(Constants {
            count: constants.len(),
            properties: all.map(one).collect::<Result<_, _>>()?,
        })
    }

    /// Those of the liquid, where they depend on the phase.
    pub fn of_liquid(mut self) -> Self {
        for constant in &mut self.properties {
            if let ConstantOf::Given(property) = constant {
                *property = property.map(|of_phase| of_phase.of_liquid().clone());
            }
        }
        self
    }

    /// The constants, where each is one number for all materials.
    ///
    /// # Errors
    /// The place of a constant in which materials differ, or which depends on the temperature.
    pub fn common(&self) -> Result<Vec<f64>, usize> {
        let number = |constant: &ConstantOf| match constant {
            ConstantOf::Given(property) => property.same()?.constant(),
            ConstantOf::Default(value) => Some(*value),
        };
        let one = |constant: usize| {
            let mut values = self.properties.iter().skip(constant).step_by(self.count);
            let first = values.next().and_then(number);
            let first = first.filter(|_| values.all(|other| number(other) == first));
            first.ok_or(constant)
        };
        (0..self.count).map(one).collect()
    }

    /// Whether one of them depends on temperature or phase.
    pub fn depend_on_temperature(&self) -> bool {
        let depends = |constant: &ConstantOf| match constant {
            ConstantOf::Given(property) => !property.values().iter().all(Property::is_constant),
            ConstantOf::Default(_) => false,
        };
        self.properties.iter().any(depends)
    }

    /// The temperatures at which tables of the constants of a material have values, K.
    pub fn temperatures(&self, material: usize) -> Vec<f64> {
        let tables = self.of_material(material).iter().filter_map(|c| match c {
            ConstantOf::Given(property) => Some(property.along(0)),
            ConstantOf::Default(_) => None,
        });
        tables.flat_map(Property::temperatures).collect()
    }

    /// The constants of a material as properties.
    pub fn properties(&self, material: usize) -> Vec<Directional<Property>> {
        let one = |constant: &ConstantOf| match constant {
            ConstantOf::Given(property) => property.clone(),
            ConstantOf::Default(value) => Directional::Same(Property::Constant(*value)),
        };
        self.of_material(material).iter().map(one).collect()
    }

    fn of_material(&self, material: usize) -> &[ConstantOf] {
        &self.properties[material * self.count..][..self.count]
    }

    /// Writes the constants of a material, along its first axis, at a temperature (K) and a liquid fraction to `values`.
    #[inline]
    pub fn load(
        &self,
        material: usize,
        temperature: f64,
        liquid_fraction: f64,
        values: &mut [f64],
    ) {
        for (value, constant) in values.iter_mut().zip(self.of_material(material)) {
            *value = match constant {
                ConstantOf::Given(property) => property.along(0).at(temperature, liquid_fraction),
                ConstantOf::Default(value) => *value,
            };
        }
    }

    /// Writes the largest absolute value that each constant of a material can have to `values`.
    pub fn load_largest(&self, material: usize, values: &mut [f64]) {
        for (value, constant) in values.iter_mut().zip(self.of_material(material)) {
            *value = match constant {
                ConstantOf::Given(property) => max_abs(&property.along(0).values()),
                ConstantOf::Default(value) => value.abs(),
            };
        }
    }
}
