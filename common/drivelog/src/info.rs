//! A summary of a log.

use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;

use messages::{printable, seconds};
use serde_json::{Map, Value, json};

use crate::damage::LogError;
use crate::ending::Ending;
use crate::gaps::Gaps;
use crate::log::{Log, Outcome, Part};
use crate::preamble::Preamble;

/// Most damages that are listed.
const MAX_DAMAGES: usize = 20;

/// The summary of a log.
#[derive(Debug)]
pub struct Info {
    /// What it starts with.
    pub preamble: Preamble,
    /// Its files.
    pub parts: Vec<Part>,
    /// Its topics; messages that stand in two parts count once.
    pub channels: BTreeMap<String, ChannelInfo>,
    /// What cannot be read, at most the first 20.
    pub damages: Vec<LogError>,
    /// How many times something could not be read.
    pub damage_count: u64,
    /// What is missing.
    pub gaps: Gaps,
}

/// The summary of a topic.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ChannelInfo {
    /// Name of its schema.
    pub schema: String,
    /// Number of its messages.
    pub messages: u64,
    /// Its earliest message on the log's time line.
    pub first_ns: u64,
    /// Its latest message on the log's time line.
    pub last_ns: u64,
}

/// Reads a log from its start to its end.
///
/// # Errors
/// When it is no log, or one of its files cannot be opened; damage further on is part of the summary.
pub fn info(path: &Path) -> Result<Info, LogError> {
    let mut log = Log::open(path)?;
    let mut channels: BTreeMap<String, ChannelInfo> = BTreeMap::new();
    let (mut damages, mut damage_count) = (Vec::new(), 0);
    loop {
        match log.advance() {
            Ok(true) => {
                let Some(message) = log.message() else { continue };
                let stamp = message.log_ns;
                match channels.get_mut(&message.channel.topic) {
                    Some(channel) => {
                        channel.messages += 1;
                        channel.first_ns = channel.first_ns.min(stamp);
                        channel.last_ns = channel.last_ns.max(stamp);
                    }
                    None => {
                        let schema = message.channel.format.schema_name.clone();
                        let channel = ChannelInfo { schema, messages: 1, first_ns: stamp, last_ns: stamp };
                        channels.insert(message.channel.topic.clone(), channel);
                    }
                }
            }
            Ok(false) => break,
            Err(error) => {
                damage_count += 1;
                if damages.len() < MAX_DAMAGES {
                    damages.push(error);
                }
            }
        }
    }
    Ok(Info { preamble: log.preamble().clone(), parts: log.parts().to_vec(), gaps: log.gaps(), channels, damages, damage_count })
}

impl Info {
    /// First and last message on the log's time line, ns of sensor time.
    #[must_use]
    pub fn span_ns(&self) -> Option<(u64, u64)> {
        let first = self.channels.values().map(|channel| channel.first_ns).min()?;
        let last = self.channels.values().map(|channel| channel.last_ns).max()?;
        Some((first, last))
    }

    /// Whether no part and no scan or picture is missing, every file ends with its index, and everything can be read.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        self.damage_count == 0
            && self.gaps.is_empty()
            && self.parts.iter().all(|part| !matches!(part.outcome, Outcome::Read(Ending::Cut { .. }) | Outcome::Empty))
    }
}

impl Info {
    /// The same as [`Display`](fmt::Display), for programs.
    #[must_use]
    pub fn to_json(&self) -> Value {
        let file = |part: &Part| json!({ "path": part.path.to_string_lossy(), "bytes": part.bytes, "outcome": part.outcome.to_string() });
        let topic = |(topic, channel): (&String, &ChannelInfo)| {
            let ChannelInfo { schema, messages, first_ns, last_ns } = channel;
            (topic.clone(), json!({ "schema": schema, "messages": messages, "first_ns": first_ns, "last_ns": last_ns }))
        };
        json!({
            "run": format!("{:016x}", self.preamble.run),
            "origin": self.preamble.origin,
            "robot": self.preamble.robot,
            "sonars": self.preamble.sonars.len(),
            "first_ns": self.span_ns().map(|(first_ns, _)| first_ns),
            "last_ns": self.span_ns().map(|(_, last_ns)| last_ns),
            "files": self.parts.iter().map(file).collect::<Vec<_>>(),
            "topics": self.channels.iter().map(topic).collect::<Map<_, _>>(),
            "damage_count": self.damage_count,
            "damages": self.damages.iter().map(ToString::to_string).collect::<Vec<_>>(),
            "missing": self.gaps.lines(),
            "complete": self.is_complete(),
        })
    }
}

impl fmt::Display for Info {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Preamble { run, robot, sonars, origin, .. } = &self.preamble;
        writeln!(f, "run       {run:016x}, {}", printable(origin))?;
        writeln!(f, "robot     {}, {} sonars", printable(robot), sonars.len())?;
        match self.span_ns() {
            Some((first, last)) => {
                writeln!(f, "time      {:.3} s, from {:.3} s on", seconds(last.saturating_sub(first)), seconds(first))?;
            }
            None => writeln!(f, "time      no message")?,
        }
        for part in &self.parts {
            writeln!(
                f,
                "file      {}: {} bytes, {}",
                printable(&part.path.to_string_lossy()),
                part.bytes,
                printable(&part.outcome.to_string())
            )?;
        }
        if self.gaps.removed > 0 {
            writeln!(f, "removed   parts up to {} by the limits of the recorder, unless they are listed", self.gaps.removed)?;
        }
        for (topic, channel) in &self.channels {
            writeln!(f, "topic     {:<24} {:>9} messages  {}", printable(topic), channel.messages, printable(&channel.schema))?;
        }
        for damage in &self.damages {
            writeln!(f, "damage    {}", printable(&damage.to_string()))?;
        }
        let unlisted = self.damage_count - self.damages.len() as u64;
        if unlisted > 0 {
            writeln!(f, "damage    {unlisted} more")?;
        }
        self.gaps.lines().iter().try_for_each(|gap| writeln!(f, "missing   {gap}"))
    }
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Read(Ending::Complete) => f.write_str("complete"),
            Self::Read(Ending::Cut { offset }) => write!(f, "cut, complete up to byte {offset}"),
            Self::Read(Ending::Damaged(damage)) => damage.fmt(f),
            Self::Empty => f.write_str("cut before its first message"),
            Self::OtherRun(run) => write!(f, "left out, it is of another run ({run:016x})"),
        }
    }
}
