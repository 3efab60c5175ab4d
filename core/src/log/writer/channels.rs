//! What a log begins with, and the channels it declares.

use std::{borrow::Cow, collections::BTreeMap};

use mcap::{Attachment, records::Metadata};
use serde_json::{Value, json};

use super::{Channel, RunHeader, Writer};
use crate::log::{LogError, Progress, foxglove_schema, series, topic};

/// Schema of the messages of a channel.
struct ChannelSchema<'a> {
    name: &'a str,
    encoding: &'a str,
    data: &'a [u8],
}

impl Writer {
    /// Writes case, run and the channels that every log has.
    pub(super) fn describe(&mut self, header: RunHeader<'_>) -> Result<(), LogError> {
        let RunHeader {
            run,
            case_name,
            case_text,
        } = header;
        let nanoseconds = run.started.saturating_mul(1_000_000_000);
        let case = Attachment {
            log_time: nanoseconds,
            create_time: nanoseconds,
            name: "case.toml".into(),
            media_type: "application/toml".into(),
            data: Cow::Borrowed(case_text.as_bytes()),
        };
        self.mcap
            .attach(&case)
            .map_err(|source| self.failed(source))?;

        let wrong = |source| LogError::RunInfo {
            path: self.path.clone(),
            source,
        };
        let mut description = serde_json::to_value(run).map_err(wrong)?;
        description["case_file"] = case_name.into();
        let entries = description.as_object().into_iter().flatten();
        let metadata = Metadata {
            name: "run".into(),
            metadata: entries
                .map(|(key, value)| (key.clone(), value.to_string()))
                .collect(),
        };
        self.mcap
            .write_metadata(&metadata)
            .map_err(|source| self.failed(source))?;

        let descriptor = foxglove_schema::file_descriptor_set();
        for body in &run.bodies {
            let topic = topic::points(&body.name);
            let schema = ChannelSchema {
                name: foxglove_schema::NAME,
                encoding: "protobuf",
                data: &descriptor,
            };
            self.declare(&topic, schema, "protobuf", Vec::new())?;
        }
        let checkpoint = ChannelSchema {
            name: "perimelt.Checkpoint",
            encoding: "",
            data: &[],
        };
        self.declare(topic::CHECKPOINT, checkpoint, "msgpack", Vec::new())?;
        self.declare_json(topic::INDEX, "perimelt.Index", &index_schema(), Vec::new())?;
        let progress = schemars::schema_for!(Progress).to_value();
        self.declare_json(topic::PROGRESS, "perimelt.Progress", &progress, Vec::new())?;
        self.flush()
    }

    pub(super) fn declare_series(
        &mut self,
        topic: &str,
        columns: Vec<(String, String)>,
    ) -> Result<(), LogError> {
        let name = format!("perimelt{}", topic.replace('/', "."));
        self.declare_json(topic, &name, &series::schema(&columns), columns)
    }

    fn declare_json(
        &mut self,
        topic: &str,
        name: &str,
        schema: &Value,
        columns: Vec<(String, String)>,
    ) -> Result<(), LogError> {
        let schema = schema.to_string();
        let schema = ChannelSchema {
            name,
            encoding: "jsonschema",
            data: schema.as_bytes(),
        };
        self.declare(topic, schema, "json", columns)
    }

    /// Declares a channel, unless it is declared.
    fn declare(
        &mut self,
        topic: &str,
        schema: ChannelSchema<'_>,
        encoding: &'static str,
        columns: Vec<(String, String)>,
    ) -> Result<(), LogError> {
        if self.channels.contains_key(topic) {
            return Ok(());
        }
        let schema = self
            .mcap
            .add_schema(schema.name, schema.encoding, schema.data)
            .map_err(|source| self.failed(source))?;
        self.add_channel(topic, schema, encoding, columns)
    }

    fn add_channel(
        &mut self,
        topic: &str,
        schema: u16,
        encoding: &'static str,
        columns: Vec<(String, String)>,
    ) -> Result<(), LogError> {
        let id = self
            .mcap
            .add_channel(schema, topic, encoding, &BTreeMap::new())
            .map_err(|source| self.failed(source))?;
        let channel = Channel {
            id,
            next_sequence: 0,
            schema,
            encoding,
            columns,
        };
        self.channels.insert(topic.into(), channel);
        Ok(())
    }

    /// Declares the channel of a part, unless it is declared, with the schema of the `first` part.
    pub(super) fn declare_part(&mut self, topic: &str, first: &str) -> Result<(), LogError> {
        if self.channels.contains_key(topic) {
            return Ok(());
        }
        let Some(first) = self.channels.get(first) else {
            return Ok(());
        };
        let (schema, encoding) = (first.schema, first.encoding);
        self.add_channel(topic, schema, encoding, Vec::new())
    }
}

fn index_schema() -> Value {
    json!({
        "type": "object",
        "properties": {
            "time": {"type": "number", "unit": "s"},
            "topic": {"type": "string"},
            "step": {"type": "integer"},
        },
        "required": ["time", "topic"],
    })
}
