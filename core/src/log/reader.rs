//! Reading the log of a run, finished or not.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    sync::{Mutex, PoisonError},
};

use mcap::records::{MessageHeader, Record};

use super::{
    CheckpointInfo, Damage, Ending, Follow, LogError, LoggedCloud, Progress, RunInfo, Series,
    point_cloud, rescue,
    scan::{Contents, MessagePlace, is_of_checkpoint},
    source::{Limit, RecordReader},
    topic,
};

/// A log opened for reading. Time series are in memory; point clouds and checkpoints are read
/// from the file on request.
pub struct Log {
    path: PathBuf,
    run: RunInfo,
    case_name: String,
    ending: Ending,
    contents: Contents,
    /// times of the point clouds by body, s
    times: BTreeMap<String, Vec<f64>>,
    checkpoints: Vec<CheckpointInfo>,
    source: Mutex<RecordReader>,
}

impl Log {
    /// Opens a log. An unfinished or damaged log is read up to its last complete record, see
    /// [`ending`](Self::ending).
    ///
    /// # Errors
    /// The file cannot be read, is not MCAP, or lacks the case and run information that a log
    /// begins with.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, LogError> {
        let path = path.as_ref();
        let mut source = RecordReader::open(path)?;
        let (mut contents, ending) = Contents::scan(&mut source)?;

        // the damage of a log of Perimelt is reported; for other files it is the reason why they are refused
        let is_ours = contents.is_ours && contents.channels.bodies().next().is_some();
        let missing = |missing| LogError::NotARun {
            path: path.into(),
            missing,
            ending: ending.clone(),
        };
        if contents.case_text.is_none() && !is_ours {
            return Err(missing("attachment `case.toml`"));
        }
        let metadata = match contents.run.take() {
            None if !is_ours => return Err(missing("metadata `run`")),
            metadata => metadata.unwrap_or_default(),
        };
        let described = rescue::describe(metadata, &mut contents);
        let (run, case_name) = described.map_err(|source| LogError::RunInfo {
            path: path.into(),
            source,
        })?;

        let exact_of = |topic: &str| -> Vec<CheckpointInfo> {
            let messages = contents.large.get(topic).into_iter().flatten();
            messages
                .map(|message| contents.exact(topic, message.log_time))
                .collect()
        };
        let times_of = |body: &str| {
            exact_of(&topic::points(body))
                .iter()
                .map(|message| message.time)
                .collect()
        };
        let times = run
            .bodies
            .iter()
            .map(|body| (body.name.clone(), times_of(&body.name)));
        let mut log = Self {
            path: path.into(),
            times: times.collect(),
            checkpoints: exact_of(topic::CHECKPOINT),
            run,
            case_name,
            ending,
            contents,
            source: Mutex::new(source),
        };
        log.describe_lost_bodies();
        Ok(log)
    }

    /// Describes bodies whose description is lost by their first state.
    fn describe_lost_bodies(&mut self) {
        for index in 0..self.run.bodies.len() {
            let body = &self.run.bodies[index];
            if rescue::is_sound(body) {
                continue;
            }
            let cloud = self.first_cloud(&body.name).ok();
            self.run.bodies[index] = rescue::body(&body.name, cloud.as_ref());
        }
    }

    /// Whether the case file is there as it was run. Where it is damaged, [`case_text`](Self::case_text) is empty.
    #[must_use]
    pub fn has_case(&self) -> bool {
        self.contents.case_text.is_some()
    }

    /// The file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Description of the run.
    #[must_use]
    pub fn run(&self) -> &RunInfo {
        &self.run
    }

    /// The case file as run.
    #[must_use]
    pub fn case_text(&self) -> &str {
        self.contents.case_text.as_deref().unwrap_or_default()
    }

    /// Name of the case file.
    #[must_use]
    pub fn case_name(&self) -> &str {
        &self.case_name
    }

    /// Whether the writer closed the file. The run need not have reached the end time of the case:
    /// a run that stopped with an error closes its log too.
    #[must_use]
    pub fn finished(&self) -> bool {
        self.ending == Ending::Finished
    }

    /// Where and why the log ends.
    #[must_use]
    pub fn ending(&self) -> &Ending {
        &self.ending
    }

    /// Names of the bodies, in case-file order.
    pub fn bodies(&self) -> impl Iterator<Item = &str> {
        self.run.bodies.iter().map(|body| body.name.as_str())
    }

    /// Times of a body's point clouds, s; empty for a body that the run does not have.
    #[must_use]
    pub fn times(&self, body: &str) -> &[f64] {
        self.times.get(body).map_or(&[], Vec::as_slice)
    }

    /// Point cloud number `index` of a body, counted from 0.
    ///
    /// # Errors
    /// No such body or cloud, or the file is damaged there.
    pub fn cloud(&self, body: &str, index: usize) -> Result<LoggedCloud, LogError> {
        let info = self
            .run
            .bodies
            .iter()
            .find(|info| info.name == body)
            .ok_or_else(|| LogError::UnknownBody {
                body: body.into(),
                known: self.bodies().map(String::from).collect(),
            })?;
        let topic = topic::points(body);
        let time = *self
            .times(body)
            .get(index)
            .ok_or_else(|| self.no_such(&topic, index))?;
        let mut cloud: Option<LoggedCloud> = None;
        for place in self.parts(&topic, index)? {
            let part = point_cloud::decode(&self.message(place)?, time)
                .map_err(|undecodable| undecodable.in_topic(&topic))?;
            match &mut cloud {
                None => cloud = Some(part),
                Some(cloud) => point_cloud::append(cloud, part)
                    .map_err(|undecodable| undecodable.in_topic(&topic))?,
            }
        }
        let mut cloud = cloud.ok_or_else(|| self.no_such(&topic, index))?;
        for field in &mut cloud.fields {
            if let Some(info) = info.fields.iter().find(|info| info.name == field.name) {
                field.unit.clone_from(&info.unit);
            }
        }
        Ok(cloud)
    }

    /// The probes by name.
    #[must_use]
    pub fn probes(&self) -> &BTreeMap<String, Series> {
        &self.contents.probes
    }

    /// Energy, mass and momentum over time; empty if not logged.
    #[must_use]
    pub fn balance(&self) -> &Series {
        &self.contents.balance
    }

    /// How the run went on.
    #[must_use]
    pub fn progress(&self) -> &[Progress] {
        &self.contents.progress
    }

    /// The checkpoints, oldest first.
    #[must_use]
    pub fn checkpoints(&self) -> &[CheckpointInfo] {
        &self.checkpoints
    }

    /// The state in checkpoint number `index`, counted from 0.
    ///
    /// # Errors
    /// No such checkpoint, or the file is damaged there.
    pub fn checkpoint(&self, index: usize) -> Result<Vec<u8>, LogError> {
        let mut state = Vec::new();
        for place in self.parts(topic::CHECKPOINT, index)? {
            state.append(&mut self.message(place)?);
        }
        Ok(state)
    }

    /// The last checkpoint that can be read, the one to resume from: its number and state.
    ///
    /// # Errors
    /// There is none.
    pub fn last_sound_checkpoint(&self) -> Result<(usize, Vec<u8>), LogError> {
        let mut index = self.last_checkpoint()?;
        loop {
            match self.checkpoint(index) {
                Err(LogError::Damaged { .. }) if index > 0 => index -= 1,
                state => return Ok((index, state?)),
            }
        }
    }

    /// Number of the last checkpoint, which may be damaged.
    ///
    /// # Errors
    /// There is none.
    pub fn last_checkpoint(&self) -> Result<usize, LogError> {
        let none = || LogError::NoCheckpoint {
            path: self.path.clone(),
        };
        self.checkpoints.len().checked_sub(1).ok_or_else(none)
    }

    /// Log times of a checkpoint and of the one before it (the same for the first).
    pub(super) fn resume_range(&self, checkpoint: usize) -> Result<(u64, u64), LogError> {
        self.last_checkpoint()?;
        let end = self.place(topic::CHECKPOINT, checkpoint)?.log_time;
        let before = self
            .place(topic::CHECKPOINT, checkpoint.saturating_sub(1))?
            .log_time;
        Ok((end, before))
    }

    /// The first cloud of a body that can be read.
    ///
    /// # Errors
    /// There is none, or the file cannot be read.
    pub fn first_cloud(&self, body: &str) -> Result<LoggedCloud, LogError> {
        let mut index = 0;
        loop {
            match self.cloud(body, index) {
                Err(LogError::Damaged { .. }) => index += 1,
                cloud => return cloud,
            }
        }
    }

    /// Parts that cannot be read: chunks of small states, rows of probes, balances and progress, the case file, the description of the run.
    #[must_use]
    pub fn damage(&self) -> &[Damage] {
        &self.contents.damage
    }

    /// Visits all messages in file order: topic, data of its schema, header, message. Those of damaged chunks are left out.
    pub(super) fn visit_messages(
        &self,
        mut visit: impl FnMut(&str, &[u8], &MessageHeader, &[u8]) -> Result<(), LogError>,
    ) -> Result<(), LogError> {
        let mut source = self.source.lock().unwrap_or_else(PoisonError::into_inner);
        for (place, limit) in &self.contents.chunks {
            let visited = source.visit(*place, *limit, |record| match record {
                Record::Message { header, data } => {
                    match self.contents.channels.get(header.channel_id) {
                        Some(channel) => {
                            visit(&channel.topic, &channel.schema.data, &header, &data)
                        }
                        None => Ok(()),
                    }
                }
                _ => Ok(()),
            });
            // the checksum is looked at before the first message
            if !matches!(visited, Err(LogError::Damaged { .. })) {
                visited?;
            }
        }
        Ok(())
    }

    /// Follows the log from its newest state on.
    #[must_use]
    pub fn follow(self) -> Follow {
        // messages of the newest state follow the chunk with the state before it
        let offset = self.run.bodies.first().and_then(|body| {
            let (newest, before) = self.messages(&topic::points(&body.name)).split_last()?;
            let mut ends = before.iter().rev().map(|state| state.place.end());
            ends.find(|end| *end <= newest.place.offset)
        });
        let source = self.source.into_inner();
        Follow::new(
            source.unwrap_or_else(PoisonError::into_inner),
            offset.unwrap_or(mcap::MAGIC.len() as u64),
            self.contents.channels,
        )
    }

    /// The messages of a topic that is large.
    fn messages(&self, topic: &str) -> &[MessagePlace] {
        let messages = self.contents.large.get(topic);
        messages.map_or(&[], Vec::as_slice)
    }

    fn no_such(&self, topic: &str, index: usize) -> LogError {
        LogError::NoSuchMessage {
            topic: topic.into(),
            index,
            count: self.messages(topic).len(),
        }
    }

    fn place(&self, topic: &str, index: usize) -> Result<MessagePlace, LogError> {
        let place = self.messages(topic).get(index).copied();
        place.ok_or_else(|| self.no_such(topic, index))
    }

    /// Message number `index` of a topic, and the further parts of the same state, in order.
    fn parts(&self, topic: &str, index: usize) -> Result<Vec<MessagePlace>, LogError> {
        let first = self.place(topic, index)?;
        let of_this_state = |number: usize| {
            let messages = self.messages(&topic::part(topic, number));
            let found = messages.binary_search_by_key(&first.log_time, |place| place.log_time);
            found.ok().map(|at| messages[at])
        };
        let further = (2..).map_while(of_this_state);
        Ok(std::iter::once(first).chain(further).collect())
    }

    fn message(&self, wanted: MessagePlace) -> Result<Vec<u8>, LogError> {
        let channel = self.contents.channels.get(wanted.channel);
        let limit = match channel.is_some_and(|channel| is_of_checkpoint(&channel.topic)) {
            true => Limit::Checkpoint,
            false => Limit::Points,
        };
        let mut source = self.source.lock().unwrap_or_else(PoisonError::into_inner);
        let mut message = Vec::new();
        let mut ordinal = 0;
        source.visit(wanted.place, limit, |record| {
            if let Record::Message { header, data } = record
                && header.channel_id == wanted.channel
            {
                if ordinal == wanted.ordinal {
                    message = data.into_owned();
                }
                ordinal += 1;
            }
            Ok(())
        })?;
        Ok(message)
    }
}
