//! What a log starts with: all that its replay needs.

use std::borrow::Cow;
use std::collections::BTreeMap;

use mcap::Attachment;
use mcap::records::Metadata;
use messages::Pose;

use crate::damage::Fault;
use crate::json;

/// The format that is written and read.
const FORMAT: &str = "stillmap 1";
/// Name of the attachment with the settings.
pub(crate) const SETTINGS: &str = "settings.toml";
/// Name of the metadata record with the rest.
pub(crate) const DESCRIPTION: &str = "stillmap";
/// Name of the metadata record at the end of a part that another part follows.
pub(crate) const CONTINUED: &str = "stillmap.continued";
/// Entry of the description with the number of the part. Logs of earlier versions lack it.
const PART: &str = "part";
/// Entry of the description with the last part that the limits of the recorder may have removed.
const REMOVED: &str = "removed";

/// A record at the end of a part, which says that another part follows.
pub(crate) fn continued() -> Metadata {
    Metadata { name: CONTINUED.to_owned(), metadata: BTreeMap::new() }
}

/// The number of the part with this description, from 1.
pub(crate) fn part_number(entries: &BTreeMap<String, String>) -> Option<u32> {
    entries.get(PART)?.parse().ok()
}

/// Parts up to this number may have been removed on purpose, by a part with this description; 0 if none.
pub(crate) fn removed_parts(entries: &BTreeMap<String, String>) -> u32 {
    entries.get(REMOVED).and_then(|number| number.parse().ok()).unwrap_or_default()
}

/// The description at the start of a log, where a cut file has it too.
#[derive(Debug, Clone, PartialEq)]
pub struct Preamble {
    /// The run that is recorded; in the header of every message.
    pub run: u64,
    /// The type of robot, for example `pioneer-1`.
    pub robot: String,
    /// The sonar ring in the robot frame, in the order of the sonars' numbers.
    pub sonars: Vec<Pose>,
    /// The origin of the log, in words.
    pub origin: String,
    /// The complete settings of the deployment, as TOML.
    pub settings: String,
}

impl Preamble {
    /// The settings as the first record after the file's header.
    pub(crate) fn attachment(&self) -> Attachment<'_> {
        Attachment {
            log_time: 0,
            create_time: 0,
            name: SETTINGS.to_owned(),
            media_type: "application/toml".to_owned(),
            data: Cow::Borrowed(self.settings.as_bytes()),
        }
    }

    /// The rest as the second, in the part of this number. Parts up to `removed` may be gone on purpose.
    pub(crate) fn metadata(&self, part: u32, removed: u32) -> Metadata {
        let entries = [
            ("format", FORMAT.to_owned()),
            ("run", format!("{:016x}", self.run)),
            ("robot", self.robot.clone()),
            ("sonars", json::encode_list(&self.sonars)),
            ("origin", self.origin.clone()),
            (PART, part.to_string()),
        ];
        let removed = (removed > 0).then(|| (REMOVED, removed.to_string()));
        Metadata {
            name: DESCRIPTION.to_owned(),
            metadata: entries.into_iter().chain(removed).map(|(key, value)| (key.to_owned(), value)).collect(),
        }
    }

    /// From the two records.
    pub(crate) fn read(settings: String, entries: &BTreeMap<String, String>) -> Result<Self, Fault> {
        let entry = |entry| entries.get(entry).map(String::as_str).unwrap_or_default();
        let wrong = |entry, found: &str, expected| Fault::Description { entry, found: found.to_owned(), expected };
        if entry("format") != FORMAT {
            return Err(wrong("format", entry("format"), FORMAT));
        }
        let run = entry("run");
        let sonars = entry("sonars");
        Ok(Self {
            run: u64::from_str_radix(run, 16).map_err(|_| wrong("run", run, "a hexadecimal number"))?,
            robot: entry("robot").to_owned(),
            sonars: json::decode_list(sonars).map_err(|_| wrong("sonars", sonars, "a list of poses in JSON"))?,
            origin: entry("origin").to_owned(),
            settings,
        })
    }
}
