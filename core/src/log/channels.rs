//! The channels and schemas of a log.

use std::collections::HashMap;

use mcap::records::Record;

use super::topic::{self, Topic};

/// Format of the messages of a topic.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Channel {
    /// topic
    pub topic: String,
    /// encoding of its messages: `json`, `protobuf`
    pub encoding: String,
    /// form of its messages; empty for bytes of no form
    pub schema: Schema,
}

/// A schema of messages.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Schema {
    /// name, such as `foxglove.PointCloud`
    pub name: String,
    /// language of the schema: `jsonschema`, `protobuf`
    pub encoding: String,
    /// the schema
    pub data: Vec<u8>,
}

/// The channels and schemas that were met so far, by number.
#[derive(Default)]
pub(super) struct Channels {
    channels: HashMap<u16, Channel>,
    schemas: HashMap<u16, Schema>,
}

impl Channels {
    /// The channel of a number.
    pub(super) fn get(&self, number: u16) -> Option<&Channel> {
        self.channels.get(&number)
    }

    /// Names of the bodies that have point clouds.
    pub(super) fn bodies(&self) -> impl Iterator<Item = &str> {
        let topics = self.channels.values().map(|channel| &*channel.topic);
        topics.filter_map(|topic| match Topic::of(topic) {
            Topic::Points(body) if topic::is_body_name(body) => Some(body),
            _ => None,
        })
    }

    /// Takes a record if it is a schema or a channel.
    pub(super) fn add(&mut self, record: Record) {
        match record {
            Record::Schema { header, data } => {
                let schema = Schema {
                    name: header.name,
                    encoding: header.encoding,
                    data: data.into_owned(),
                };
                self.schemas.insert(header.id, schema);
            }
            Record::Channel(channel) => {
                let schema = self.schemas.get(&channel.schema_id).cloned();
                let known = Channel {
                    topic: channel.topic,
                    encoding: channel.message_encoding,
                    schema: schema.unwrap_or_default(),
                };
                self.channels.insert(channel.id, known);
            }
            _ => {}
        }
    }
}
