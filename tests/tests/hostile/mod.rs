//! Logs that somebody made to do harm: made from the log of a run by changing its records.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::Cursor;

use mcap::read::ChunkFlattener;
use mcap::records::{MessageHeader, Metadata, Record};
use mcap::{Attachment, Compression, WriteOptions};
use serde::{Deserialize, Serialize};

/// A message.
#[derive(Clone, Debug)]
pub struct Message {
    pub topic: String,
    pub schema: (String, String, Vec<u8>),
    pub encoding: String,
    pub log_time: u64,
    pub data: Vec<u8>,
}

/// A log in parts that can be changed.
#[derive(Clone, Debug, Default)]
pub struct Forgery {
    pub case: String,
    /// One JSON text per key.
    pub run: BTreeMap<String, String>,
    pub messages: Vec<Message>,
    pub compressed: bool,
}

impl Forgery {
    /// The parts of a log.
    pub fn of(log: &[u8]) -> Self {
        let mut forgery = Forgery::default();
        let mut schemas = BTreeMap::new();
        let mut channels = BTreeMap::new();
        for record in ChunkFlattener::new(log).expect("a log") {
            match record.expect("sound") {
                Record::Schema { header, data } => {
                    let schema = (header.name, header.encoding, data.into_owned());
                    schemas.insert(header.id, schema);
                }
                Record::Channel(channel) => {
                    channels.insert(channel.id, channel);
                }
                Record::Attachment { data, .. } => {
                    forgery.case = String::from_utf8_lossy(&data).into_owned();
                }
                Record::Metadata(metadata) => forgery.run = metadata.metadata,
                Record::Message { header, data } => {
                    let channel = &channels[&header.channel_id];
                    forgery.messages.push(Message {
                        topic: channel.topic.clone(),
                        schema: schemas[&channel.schema_id].clone(),
                        encoding: channel.message_encoding.clone(),
                        log_time: header.log_time,
                        data: data.into_owned(),
                    });
                }
                _ => {}
            }
        }
        forgery
    }

    /// The log.
    pub fn bytes(&self) -> Vec<u8> {
        let compression = self.compressed.then_some(Compression::Zstd);
        let options = WriteOptions::new()
            .profile("perimelt")
            .compression(compression)
            .compression_threads(0)
            .chunk_size(None);
        let mut writer = options.create(Cursor::new(Vec::new())).expect("memory");
        let case = Attachment {
            log_time: 0,
            create_time: 0,
            name: "case.toml".into(),
            media_type: "application/toml".into(),
            data: Cow::Borrowed(self.case.as_bytes()),
        };
        writer.attach(&case).expect("memory");
        let run = Metadata {
            name: "run".into(),
            metadata: self.run.clone(),
        };
        writer.write_metadata(&run).expect("memory");
        let mut channels = BTreeMap::new();
        for (sequence, message) in (0..).zip(&self.messages) {
            let (name, encoding, data) = &message.schema;
            let id = *channels.entry(&message.topic).or_insert_with(|| {
                let schema = writer.add_schema(name, encoding, data).expect("memory");
                let added =
                    writer.add_channel(schema, &message.topic, &message.encoding, &BTreeMap::new());
                added.expect("memory")
            });
            let header = MessageHeader {
                channel_id: id,
                sequence,
                log_time: message.log_time,
                publish_time: message.log_time,
            };
            let written = writer.write_to_known_channel(&header, &message.data);
            written.expect("memory");
            // a chunk for each message, as of large ones
            writer.flush().expect("memory");
        }
        writer.finish().expect("memory");
        writer.into_inner().into_inner()
    }

    /// Changes all messages of a topic.
    pub fn change(&mut self, topic: &str, mut change: impl FnMut(&mut Message)) {
        let messages = self.messages.iter_mut();
        messages
            .filter(|message| message.topic == topic)
            .for_each(&mut change);
    }

    /// Changes the last checkpoint.
    pub fn change_checkpoint(&mut self, change: impl FnOnce(&mut Checkpoint)) {
        let messages = self.messages.iter_mut().rev();
        let mut checkpoints = messages.filter(|message| message.topic == "/checkpoint");
        let last = checkpoints.next().expect("a checkpoint");
        let packed = rmp_serde::from_slice(&last.data);
        let (format, mut checkpoint): (u32, Checkpoint) = packed.expect("a checkpoint");
        change(&mut checkpoint);
        last.data = rmp_serde::to_vec(&(format, checkpoint)).expect("memory");
    }
}

/// The state of a run as it is packed.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Checkpoint {
    pub clock: Clock,
    pub fields: Vec<Field>,
    pub physics: Vec<serde_bytes::ByteBuf>,
    pub couplers: Vec<serde_bytes::ByteBuf>,
    pub rows_found_at: Vec<Vec<[f64; 3]>>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Clock {
    pub time: f64,
    pub logs: u64,
    pub advanced_to: Vec<f64>,
    pub progress: Progress,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Progress {
    pub macro_steps: u64,
    pub sub_steps: Vec<u64>,
    pub iterations: Vec<u64>,
    pub evaluations: Vec<u64>,
    pub passes: u64,
    pub unconverged: u64,
    pub last_step: f64,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Field {
    pub body: usize,
    pub name: String,
    #[serde(with = "serde_bytes")]
    pub values: Vec<u8>,
}
