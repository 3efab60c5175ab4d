//! How a case file or a library file writes a material.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{self, DeserializeSeed, Deserializer, MapAccess, Visitor};
use serde::{Deserialize, Serialize};

use super::vocabulary::{PropertyKey, known_properties};
use super::{Directional, Property, check_range, known};

/// Keys of a section that are not properties.
pub(super) const OTHER_KEYS: [&str; 2] = ["library", "description"];

/// A `[materials.<name>]` section of a case file, or a whole library file.
///
/// ```toml
/// [materials.plate]
/// library = "S355"          # optional: start from the library entry, keys below override it
/// density = 7820            # [kg/m³]
/// conductivity = { temperature = [293.15, 1273.15], value = [50, 30] }
/// thermal_expansion = { along = -0.5e-6, across = 30e-6 }
/// ```
///
/// Reading it rejects unknown names and values out of range, each at its place in the file.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct MaterialSection {
    /// Name of the library entry to start from.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub library: Option<String>,
    /// What the material is, in a line.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub description: Option<String>,
    /// Properties by name.
    #[serde(flatten)]
    pub properties: BTreeMap<String, Directional<Property>>,
}

impl<'de> Deserialize<'de> for MaterialSection {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(SectionVisitor)
    }
}

struct SectionVisitor;

impl<'de> Visitor<'de> for SectionVisitor {
    type Value = MaterialSection;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a table of material properties")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<MaterialSection, A::Error> {
        let mut section = MaterialSection::default();
        while let Some(key) = map.next_key_seed(KeySeed)? {
            match key {
                Key::Library => section.library = Some(map.next_value()?),
                Key::Description => section.description = Some(map.next_value()?),
                Key::Property(key) => {
                    let property = map.next_value_seed(ValueSeed(key))?;
                    section.properties.insert(key.name.to_owned(), property);
                }
            }
        }
        Ok(section)
    }
}

enum Key {
    Library,
    Description,
    Property(&'static PropertyKey),
}

/// Reads a key on its own, so that the reader's error points at the key.
struct KeySeed;

impl<'de> DeserializeSeed<'de> for KeySeed {
    type Value = Key;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Key, D::Error> {
        match &*Cow::<str>::deserialize(deserializer)? {
            "library" => Ok(Key::Library),
            "description" => Ok(Key::Description),
            name => known(name)
                .map(Key::Property)
                .map_err(|e| de::Error::custom(e.explain())),
        }
    }
}

/// Reads and checks a value on its own, so that the reader's error points at the value.
struct ValueSeed(&'static PropertyKey);

impl<'de> DeserializeSeed<'de> for ValueSeed {
    type Value = Directional<Property>;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Self::Value, D::Error> {
        let property = match self.0.has_directions {
            true => Directional::deserialize(deserializer)?,
            false => Directional::Same(Property::deserialize(deserializer)?),
        };
        check_range(self.0, &property).map_err(de::Error::custom)?;
        Ok(property)
    }
}

impl JsonSchema for MaterialSection {
    fn schema_name() -> Cow<'static, str> {
        "Material".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let property = generator.subschema_for::<Property>();
        let directional = generator.subschema_for::<Directional<Property>>();
        let mut keys = serde_json::Map::new();
        keys.insert(
            "library".to_owned(),
            serde_json::json!({
                "type": "string",
                "description": "Library entry to start from; the keys given here replace its own"
            }),
        );
        keys.insert(
            "description".to_owned(),
            serde_json::json!({ "type": "string", "description": "What the material is, in a line" }),
        );
        for key in known_properties() {
            let description = format!("{} [{}], {}", key.meaning, key.unit, key.range);
            let value = match key.has_directions {
                true => &directional,
                false => &property,
            };
            keys.insert(
                key.name.to_owned(),
                serde_json::json!({ "description": description, "allOf": [value] }),
            );
        }
        json_schema!({
            "type": "object",
            "description": "A material: each property a number, a table against temperature, or one of these per phase; some may have one of these along each axis",
            "properties": keys,
            "additionalProperties": false
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::{Material, MaterialError};

    fn read(text: &str) -> Result<MaterialSection, toml::de::Error> {
        toml::from_str(text)
    }

    #[test]
    fn keys_of_a_section_replace_those_of_the_library_entry() {
        let library =
            read("description = 'steel'\ndensity = 7850\nspecific_heat = 500").expect("valid");
        let library = Material::new("S355", library, None).expect("valid");
        let section = read("library = 'S355'\ndensity = 7820\nconductivity = 50").expect("valid");
        assert_eq!(section.library.as_deref(), Some("S355"));
        let plate = Material::new("plate", section, Some(&library)).expect("valid");
        assert_eq!(plate.constant("density"), Ok(7820.0));
        assert_eq!(plate.constant("specific_heat"), Ok(500.0));
        assert_eq!(plate.constant("conductivity"), Ok(50.0));
        assert_eq!(
            (plate.name(), plate.description()),
            ("plate", Some("steel"))
        );
    }

    #[test]
    fn each_mistake_is_explained_where_it_is() {
        let cases = [
            (
                "conductivty = 50",
                "did you mean `conductivity`?",
                "conductivty",
            ),
            (
                "descripton = 'x'",
                "did you mean `description`?",
                "descripton",
            ),
            ("zzzz = 1", "the known ones are absorptivity,", "zzzz"),
            (
                "conductivity = -50",
                "`conductivity` must be above 0 [W/(m K)], but is -50",
                "-50",
            ),
            (
                "emissivity = { temperature = [300, 400], value = [0.5, 1.2] }",
                "must be from 0 to 1",
                "{ temperature = [300, 400], value = [0.5, 1.2] }",
            ),
            ("density = 'heavy'", "invalid type: string", "'heavy'"),
            (
                "density = { along = 1, across = 2 }",
                "`across` belongs to properties with directions",
                "across",
            ),
            // positive at all temperatures along all axes
            (
                "conductivity = { along = 8, across = { temperature = [300, 400], value = [1, -1] } }",
                "`conductivity` must be above 0 [W/(m K)], but is -1",
                "{ along = 8, across = { temperature = [300, 400], value = [1, -1] } }",
            ),
        ];
        for (line, message, place) in cases {
            let source = format!("specific_heat = 500\n{line}\n");
            let error = read(&source).expect_err(line);
            assert!(error.message().contains(message), "{line}: {error}");
            assert_eq!(&source[error.span().expect("has a place")], place, "{line}");
        }
    }

    #[test]
    fn a_section_built_by_hand_is_checked_too() {
        let section = |property: &str, value| MaterialSection {
            properties: BTreeMap::from([(
                property.to_owned(),
                Directional::Same(Property::Constant(value)),
            )]),
            ..Default::default()
        };
        assert_eq!(
            Material::new("m", section("densty", 1.0), None),
            Err(MaterialError::UnknownProperty {
                property: "densty".into(),
                nearest: Some("density".into())
            })
        );
        assert!(matches!(
            Material::new("m", section("density", 0.0), None),
            Err(MaterialError::OutOfRange {
                property: "density",
                ..
            })
        ));
    }

    #[test]
    fn what_a_physics_misses_is_named() {
        let section = read("solidus = 1700\nliquidus = 1600").expect("valid");
        let error = Material::new("m", section, None).expect_err("liquidus below solidus");
        assert!(error.to_string().contains("below the solidus (1700 K)"));
        let section = read("liquidus = 1600\nboiling_temperature = 1500").expect("valid");
        let error = Material::new("m", section, None).expect_err("boiling before melting");
        let message = "the boiling temperature (1500 K) lies below the liquidus (1600 K)";
        assert!(error.to_string().contains(message), "{error}");

        let section = read("specific_heat = { solid = 1, liquid = 2 }").expect("valid");
        let material = Material::new("m", section, None).expect("valid");
        let message = material
            .require("density")
            .expect_err("missing")
            .to_string();
        assert_eq!(message, "material `m` has no `density` [kg/m³]");
        let message = material
            .constant("specific_heat")
            .expect_err("two")
            .to_string();
        assert!(message.contains("must be one number"), "{message}");
    }

    #[test]
    fn the_reference_density_is_that_of_the_phase_at_room_temperature() {
        let text = "density = { solid = 917, liquid = 1000 }\nsolidus = 273.15\nliquidus = 273.15";
        let water = Material::new("water", read(text).expect("valid"), None).expect("valid");
        assert_eq!(water.reference_density(), Ok(1000.0));
        let hot = text.replace("273.15", "900");
        let metal = Material::new("metal", read(&hot).expect("valid"), None).expect("valid");
        assert_eq!(metal.reference_density(), Ok(917.0));
    }

    #[test]
    fn the_schema_lists_every_property_with_its_unit() {
        let schema = schemars::schema_for!(MaterialSection).to_value();
        for key in known_properties() {
            let description = schema["properties"][key.name]["description"].as_str();
            assert!(
                description.is_some_and(|text| text.contains(key.unit)),
                "{}",
                key.name
            );
        }
    }

    #[test]
    fn writing_and_reading_gives_the_same_section() {
        let section =
            read("library = 'S355'\ndensity = 7820\nconductivity = { axes = [3, 4, { solid = 3, liquid = 4 }] }")
                .expect("valid");
        let json = serde_json::to_string(&section).expect("serialises");
        assert_eq!(
            serde_json::from_str::<MaterialSection>(&json).expect("reads"),
            section
        );
    }
}
