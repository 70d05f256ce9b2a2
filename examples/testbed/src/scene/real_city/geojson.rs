//! Reads the features of a GeoJSON file one by one, so that only one is in memory.

use std::fmt;
use std::io::Read;

use serde::de::{DeserializeSeed, Deserializer, Error, IgnoredAny, MapAccess, SeqAccess, Visitor};
use serde_json::Value;

/// Takes a feature and its number, from 0. An error is one line.
pub type TakeFeature<'t> = dyn FnMut(&Value, usize) -> Result<(), String> + 't;

/// Reads a feature collection. An error is one line, with the line and the column.
pub fn read(source: impl Read, take: &mut TakeFeature<'_>) -> Result<(), String> {
    let mut json = serde_json::Deserializer::from_reader(source);
    let read = Collection(take).deserialize(&mut json).and_then(|()| json.end());
    read.map_err(|error| error.to_string())
}

/// Reads a feature collection.
struct Collection<'a, 't>(&'a mut TakeFeature<'t>);

/// Reads its features one by one.
struct Features<'a, 't>(&'a mut TakeFeature<'t>);

impl<'de> DeserializeSeed<'de> for Collection<'_, '_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_map(self)
    }
}

impl<'de> Visitor<'de> for Collection<'_, '_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a FeatureCollection of GeoJSON")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        let (mut kind, mut has_features) = (Value::Null, false);
        while let Some(key) = map.next_key::<String>()? {
            match key.as_str() {
                "type" => kind = map.next_value()?,
                "features" => {
                    has_features = true;
                    map.next_value_seed(Features(&mut *self.0))?;
                }
                _ => {
                    map.next_value::<IgnoredAny>()?;
                }
            }
        }
        match (kind.as_str(), has_features) {
            (Some("FeatureCollection"), true) => Ok(()),
            (Some("FeatureCollection"), false) => Err(A::Error::custom("there are no \"features\"")),
            _ => Err(A::Error::custom(format!("\"type\" is {kind}, not \"FeatureCollection\""))),
        }
    }
}

impl<'de> DeserializeSeed<'de> for Features<'_, '_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_seq(self)
    }
}

impl<'de> Visitor<'de> for Features<'_, '_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a list of features")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut features: A) -> Result<(), A::Error> {
        let mut number = 0;
        while let Some(feature) = features.next_element::<Value>()? {
            (self.0)(&feature, number).map_err(A::Error::custom)?;
            number += 1;
        }
        Ok(())
    }
}
