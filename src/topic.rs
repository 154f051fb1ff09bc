//! `stillmap topic`: the services of a deployment, and what passes through one.

use crate::args::Which;
use crate::exit::BadInput;
use crate::output;
use crate::running::choose;
use bus::{Received, RunningDomain};
use clap::{Args, Subcommand};
use messages::{Payload, Pictures, SERVICES, ServiceVisitor, visit_services};
use runtime::Observer;
use std::time::{Duration, Instant};

/// Between two rates that are printed, and between two looks at whether the deployment still runs.
const PERIOD: Duration = Duration::from_secs(1);
/// Between two looks at a topic that wakes no reader: 16 reports wait for a reader, and the processes of a deployment send 5 a second each.
const POLL: Duration = Duration::from_millis(50);

#[derive(Debug, Subcommand)]
pub(crate) enum TopicCommand {
    /// Lists the topics and what they carry
    List,
    /// Prints the messages of a topic as JSON, one a line, until its stream ends
    Echo {
        #[command(flatten)]
        topic: Topic,
        /// Number of messages to print. The default is all
        #[arg(long, value_name = "N")]
        count: Option<u64>,
    },
    /// Prints once a second how many messages of a topic arrive per second, until its stream ends
    Hz {
        #[command(flatten)]
        topic: Topic,
        /// Number of rates to print. The default is all
        #[arg(long, value_name = "N")]
        count: Option<u64>,
    },
}

#[derive(Debug, Args)]
pub(crate) struct Topic {
    /// The topic, such as robot/scan
    #[arg(value_name = "TOPIC")]
    name: String,
    #[command(flatten)]
    which: Which,
}

/// What is printed of a topic.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum What {
    Messages,
    Rates,
}

/// Carries out a `topic` command.
pub(crate) fn topic(command: &TopicCommand) -> anyhow::Result<()> {
    match command {
        TopicCommand::List => {
            for service in SERVICES {
                let doc = service.doc.split_whitespace().collect::<Vec<_>>().join(" ");
                output::line(&format!("{:<24} {doc}", service.name))?;
            }
            Ok(())
        }
        TopicCommand::Echo { topic, count } => watch(topic, What::Messages, *count),
        TopicCommand::Hz { topic, count } => watch(topic, What::Rates, *count),
    }
}

fn watch(topic: &Topic, what: What, count: Option<u64>) -> anyhow::Result<()> {
    let mut watch = Watch { name: &topic.name, which: &topic.which, what, count: count.unwrap_or(u64::MAX), is_found: false };
    visit_services(&mut watch)?;
    if watch.is_found {
        return Ok(());
    }
    let names = SERVICES.iter().map(|service| service.name).collect::<Vec<_>>().join(", ");
    Err(BadInput(format!("no topic {}, expected one of {names}", topic.name)).into())
}

/// Finds the type of a topic by its name.
struct Watch<'a> {
    name: &'a str,
    which: &'a Which,
    what: What,
    count: u64,
    is_found: bool,
}

impl ServiceVisitor for Watch<'_> {
    type Error = anyhow::Error;

    fn message<T: Payload>(&mut self) -> anyhow::Result<()> {
        if self.name != T::SERVICE.name {
            return Ok(());
        }
        self.is_found = true;
        let domain = choose(self.which)?;
        let mut observer = Observer::join(&domain)?;
        let mut messages = observer.reader::<T>()?;
        let what = self.what;
        follow(&domain, &observer, what, self.count, || {
            Ok(match messages.take()? {
                Some(Received::Message(message)) if what == What::Messages => {
                    Taken::Message(Some(drivelog::to_json::<T>(message.seq(), &message)))
                }
                Some(Received::Message(_)) => Taken::Message(None),
                Some(Received::End { .. }) => Taken::End,
                None => Taken::Nothing,
            })
        })
    }

    fn pictures<P: Pictures>(&mut self) -> anyhow::Result<()> {
        if self.name != P::SERVICE.name {
            return Ok(());
        }
        self.is_found = true;
        if self.what == What::Messages {
            return Err(BadInput(format!("{} carries pictures: `stillmap topic hz` prints their rate", self.name)).into());
        }
        let domain = choose(self.which)?;
        let mut observer = Observer::join(&domain)?;
        let mut pictures = observer.frame_reader::<P>()?;
        follow(&domain, &observer, What::Rates, self.count, || {
            Ok(match pictures.take()? {
                Some(Received::Message(_)) => Taken::Message(None),
                Some(Received::End { .. }) => Taken::End,
                None => Taken::Nothing,
            })
        })
    }
}

/// What an input gave.
enum Taken {
    /// A message, as text if messages are printed.
    Message(Option<String>),
    End,
    Nothing,
}

/// Prints until the stream or the deployment ends, or so much is printed.
fn follow(
    domain: &RunningDomain,
    observer: &Observer,
    what: What,
    count: u64,
    mut take: impl FnMut() -> anyhow::Result<Taken>,
) -> anyhow::Result<()> {
    if what == What::Rates {
        // The history is of the past.
        while matches!(take()?, Taken::Message(_)) {}
    }
    let (mut printed, mut received, mut since) = (0, 0_u64, Instant::now());
    while printed < count {
        match take()? {
            Taken::Message(text) => {
                received += 1;
                if let Some(text) = text {
                    output::json(&text)?;
                    printed += 1;
                }
                continue;
            }
            Taken::End => return Ok(()),
            Taken::Nothing => {}
        }
        let elapsed = since.elapsed();
        if elapsed < PERIOD {
            observer.wait(POLL.min(PERIOD - elapsed))?;
            continue;
        }
        if what == What::Rates {
            output::line(&format!("{:.1} messages/s", received as f64 / elapsed.as_secs_f64()))?;
            printed += 1;
        }
        (received, since) = (0, Instant::now());
        if !RunningDomain::all()?.iter().any(|running| running.name() == domain.name()) {
            return Ok(());
        }
    }
    Ok(())
}
