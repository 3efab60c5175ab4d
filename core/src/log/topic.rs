//! The topics of a log.

pub(super) const BALANCE: &str = "/balance";
pub(super) const PROGRESS: &str = "/progress";
pub(super) const CHECKPOINT: &str = "/checkpoint";
pub(super) const INDEX: &str = "/index";
const PROBES: &str = "/probes/";
const POINTS: &str = "/points";

/// Content of a topic.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Topic<'a> {
    /// the point clouds of a body
    Points(&'a str),
    /// a further part of the messages of another topic, see [`part`]
    Part(&'a str),
    Probe(&'a str),
    Balance,
    Progress,
    Checkpoint,
    Index,
    /// written by another tool
    Other,
}

impl<'a> Topic<'a> {
    pub(super) fn of(name: &'a str) -> Self {
        match name {
            BALANCE => Self::Balance,
            PROGRESS => Self::Progress,
            CHECKPOINT => Self::Checkpoint,
            INDEX => Self::Index,
            _ => {
                if let Some(probe) = name.strip_prefix(PROBES) {
                    Self::Probe(probe)
                } else if let Some(body) = body_of(name) {
                    Self::Points(body)
                } else {
                    Self::further_part(name).unwrap_or(Self::Other)
                }
            }
        }
    }

    fn further_part(name: &'a str) -> Option<Self> {
        let (first, number) = name.rsplit_once('/')?;
        let is_number = !number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit());
        // a part has no parts: a name of any length is looked at once
        let is_whole =
            first == CHECKPOINT || !first.starts_with(PROBES) && body_of(first).is_some();
        (is_number && is_whole).then_some(Self::Part(first))
    }

    /// Checkpoints and the index are of no use without the file.
    pub(super) fn is_for_resuming(self) -> bool {
        matches!(
            self,
            Self::Checkpoint | Self::Index | Self::Part(CHECKPOINT)
        )
    }

    /// Point clouds and checkpoints are large and are read from the file on request.
    pub(super) fn is_large(self) -> bool {
        matches!(self, Self::Points(_) | Self::Part(_) | Self::Checkpoint)
    }
}

/// The body whose points a topic has.
fn body_of(name: &str) -> Option<&str> {
    name.strip_prefix('/')?.strip_suffix(POINTS)
}

/// Topic of part `number`, from 2, of the messages of topic `first`.
pub(super) fn part(first: &str, number: usize) -> String {
    format!("{first}/{number}")
}

pub(super) fn points(body: &str) -> String {
    format!("/{body}{POINTS}")
}

pub(super) fn probe(name: &str) -> String {
    format!("{PROBES}{name}")
}

/// A body's name is one level of a topic, and must not be the level of the probes.
pub(super) fn is_body_name(name: &str) -> bool {
    !name.is_empty() && !name.contains('/') && name != "probes"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_belong_to_states_only() {
        let is_part = |name: &str| matches!(Topic::of(name), Topic::Part(_));
        assert!(is_part("/plate/points/2") && is_part("/checkpoint/3"));
        assert!(!is_part("/probes/points/2") && !is_part("/plate/points/x"));
        assert!(!is_part("/plate/points/2/2"));
        // more levels than a stack has room for
        assert!(matches!(Topic::of(&"/1".repeat(1 << 20)), Topic::Other));
    }
}
