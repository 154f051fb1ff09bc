//! Who answers on a serial port: the driver's own session, listened to for a few seconds, then closed.

use std::collections::BTreeSet;
use std::time::{Duration, Instant};

use psos::{Identity, Model};
use rustix::event::{PollFd, PollFlags, Timespec, poll};

use crate::address::Address;
use crate::connect::Opening;
use crate::event::{Event, at_speed};
use crate::exchange::{Input, Output};
use crate::parameters::Parameters;
use crate::port::{Port, words};
use crate::session::Session;

/// How long a robot that answers is listened to, ns: sixteen sonars fire more than three times.
const LISTEN_NS: u64 = 2_500_000_000;

/// Rounds over all baud rates without an answer after which the probe gives up. The first may fall into the start of a board that
/// resets when its port is opened; from the second on, a robot that was left synchronised is closed first.
const ROUNDS: u64 = 3;

/// Longest that a probe takes, ns: three rounds over five baud rates take 19 s, and what answers then has as long again.
const PATIENCE_NS: u64 = 40_000_000_000;

/// Connections that may end before the probe gives up.
const RECONNECTS: u32 = 3;

/// What answered.
#[derive(Debug, Clone, PartialEq)]
pub struct Answer {
    /// Who the robot says it is.
    pub identity: Identity,
    /// Its factors, if it is of a model that is known here.
    pub model: Option<&'static Model>,
    /// The baud rate.
    pub baud: u32,
    /// Its sonars, all that it has.
    pub sonars: usize,
    /// The numbers of those that fired.
    pub fired: BTreeSet<u32>,
    /// Status packets that came.
    pub packets: u64,
    /// Packets and bytes that came damaged.
    pub damaged: u64,
    /// What the session has to say about the link.
    pub note: String,
}

/// Why nothing that can be used answers.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ProbeError {
    /// The port cannot be opened, or went away.
    #[error("{port}: {why}")]
    Port {
        /// The port.
        port: String,
        /// Why, in words.
        why: String,
    },
    /// The port cannot be opened.
    #[error("{why}")]
    Open {
        /// The port, and why.
        why: String,
    },
    /// Not a byte came.
    #[error("{port}: silence{at}: is the robot switched on, its cable connected, and this the right port?")]
    Silent {
        /// The port.
        port: String,
        /// The baud rates tried, in words.
        at: String,
    },
    /// Bytes came that no Pioneer says.
    #[error("{port}: what answers is not a Pioneer ({bytes} bytes{at}, no answer to its handshake): is this the right port?")]
    NoRobot {
        /// The port.
        port: String,
        /// The baud rates tried, in words.
        at: String,
        /// Bytes that came.
        bytes: u64,
    },
    /// What is sent comes back.
    #[error("{port}: sends back what is sent to it: a loop-back plug or a modem that echoes, not a robot: is this the right port?")]
    Echo {
        /// The port.
        port: String,
    },
    /// A robot answered the handshake and then sent nothing.
    #[error("{port}: {name} answers{}, but sends no status packets: switch it off and on", at_speed(*baud))]
    NoPackets {
        /// The port.
        port: String,
        /// What the robot calls itself.
        name: String,
        /// The baud rate.
        baud: u32,
    },
}

/// What the session's outputs tell so far.
#[derive(Debug, Default)]
struct Findings {
    bytes: u64,
    identity: Option<(Identity, u32)>,
    connected_ns: u64,
    fired: BTreeSet<u32>,
    packets: u64,
    echo: bool,
    reconnects: u32,
}

/// Asks who is on a port. The robot is not moved, and closed at the end.
///
/// # Errors
/// When nothing that can be used answers, and why.
pub fn probe(port: &Address, parameters: &Parameters) -> Result<Answer, ProbeError> {
    let name = port.to_string();
    let lost = |why: String| ProbeError::Port { port: name.clone(), why };
    let mut session = Session::new(parameters.clone(), None);
    let mut line = open(port, session.baud())?;
    let started = Instant::now();
    // The session takes no stamp for a real one that is not after the last.
    let now_ns = || 1 + started.elapsed().as_nanos() as u64;
    let mut findings = Findings::default();
    let mut input = Input::Opened;
    let mut bytes = [0; 4096];
    let mut count;
    while !findings.are_complete(now_ns()) && session.rounds() < ROUNDS {
        for output in session.step(input, now_ns()) {
            findings.take(&output, now_ns());
            act(&output, &mut line).map_err(lost)?;
        }
        wait(&line, session.due_ns().unwrap_or(u64::MAX).saturating_sub(now_ns()));
        count = match line.read(&mut bytes) {
            Ok(count) => count,
            // Some simulators end the connection when a robot that was left open is closed.
            Err(_) if !port.has_speed() && findings.reconnects < RECONNECTS => {
                findings.reconnects += 1;
                let _ = session.step(Input::Vanished, now_ns());
                line = open(port, session.baud())?;
                input = Input::Opened;
                continue;
            }
            Err(error) => return Err(lost(error.to_string())),
        };
        findings.bytes += count as u64;
        input = if count > 0 { Input::Bytes(&bytes[..count]) } else { Input::Tick };
    }
    let note = session.note(&name);
    for output in session.step(Input::Stop, now_ns()) {
        act(&output, &mut line).map_err(lost)?;
    }
    let damaged = session.link().bad_checksums + session.link().skipped_bytes;
    findings.answer(name, parameters, damaged, note)
}

fn open(port: &Address, baud: u32) -> Result<Port, ProbeError> {
    Opening::start(port, baud).wait().map_err(|error| ProbeError::Open { why: error.to_string() })
}

/// Does what the session wants with the line. A device that refuses a setting may still carry bytes.
fn act(output: &Output, line: &mut Port) -> Result<(), String> {
    match output {
        Output::Send(command) => line.send(&command.packet()).map(drop).map_err(|error| error.to_string()),
        Output::Baud(baud) => line.set_baud(*baud).map_err(|error| words(&error)),
        Output::Flush => line.flush().map_err(|error| words(&error)),
        Output::Forward(_) | Output::Reopen | Output::Publish(_) | Output::Event(_) => Ok(()),
    }
}

fn wait(line: &Port, for_ns: u64) {
    let patience = Duration::from_nanos(for_ns).clamp(Duration::from_millis(1), Duration::from_millis(100));
    let patience = Timespec { tv_sec: 0, tv_nsec: patience.subsec_nanos().into() };
    // An interrupted wait is a short one.
    let _ = poll(&mut [PollFd::from_borrowed_fd(line.descriptor(), PollFlags::IN)], Some(&patience));
}

impl Findings {
    fn take(&mut self, output: &Output, now_ns: u64) {
        match output {
            Output::Event(Event::Connected { identity, baud, .. }) => {
                self.identity = Some((identity.clone(), *baud));
                self.connected_ns = now_ns;
            }
            Output::Event(Event::NotARobot { echo, .. }) => self.echo |= echo,
            Output::Publish(saved) => {
                self.packets += 1;
                self.fired.extend(saved.scan.readings().iter().map(|reading| reading.sonar));
            }
            _ => {}
        }
    }

    fn are_complete(&self, now_ns: u64) -> bool {
        let has_listened = self.identity.is_some() && now_ns.saturating_sub(self.connected_ns) >= LISTEN_NS;
        has_listened || now_ns >= PATIENCE_NS
    }

    fn answer(self, port: String, parameters: &Parameters, damaged: u64, note: String) -> Result<Answer, ProbeError> {
        let bauds = parameters.bauds.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
        let at = if bauds.is_empty() { bauds } else { format!(" at {bauds} baud") };
        match self.identity {
            None if self.echo => Err(ProbeError::Echo { port }),
            None if self.bytes == 0 => Err(ProbeError::Silent { port, at }),
            None => Err(ProbeError::NoRobot { port, at, bytes: self.bytes }),
            Some((identity, baud)) if self.packets == 0 => Err(ProbeError::NoPackets { port, name: identity.name, baud }),
            Some((identity, baud)) => {
                let model = Model::of(&identity);
                let sonars = parameters.ring_of(model.unwrap_or(parameters.model)).len();
                Ok(Answer { identity, model, baud, sonars, fired: self.fired, packets: self.packets, damaged, note })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn answer(findings: Findings) -> Result<Answer, ProbeError> {
        findings.answer("/dev/x".to_owned(), &Parameters::default(), 0, String::new())
    }

    fn connected(subclass: &str) -> Findings {
        let identity = Identity { name: "Amigo".to_owned(), class: "Pioneer".to_owned(), subclass: subclass.to_owned() };
        Findings { bytes: 40, identity: Some((identity, 9600)), ..Findings::default() }
    }

    #[test]
    fn what_is_wrong_is_told_apart() {
        let silent = answer(Findings::default()).unwrap_err().to_string();
        assert_eq!(
            silent,
            "/dev/x: silence at 9600, 38400, 19200, 115200, 57600 baud: is the robot switched on, its cable connected, and this the \
             right port?"
        );
        let stranger = answer(Findings { bytes: 12, ..Findings::default() }).unwrap_err().to_string();
        assert!(stranger.starts_with("/dev/x: what answers is not a Pioneer (12 bytes at"), "{stranger}");
        let echo = answer(Findings { bytes: 12, echo: true, ..Findings::default() }).unwrap_err().to_string();
        assert!(echo.starts_with("/dev/x: sends back what is sent to it"), "{echo}");
        let mute = answer(connected("pion1m")).unwrap_err().to_string();
        assert_eq!(mute, "/dev/x: Amigo answers at 9600 baud, but sends no status packets: switch it off and on");
    }

    #[test]
    fn a_robot_is_told_with_its_sonars() {
        let known = answer(Findings { packets: 9, fired: [0, 3].into(), ..connected("pion1m") }).unwrap();
        assert_eq!((known.model.map(|model| model.name), known.sonars), (Some("pioneer-1"), 7));
        let unknown = answer(Findings { packets: 9, ..connected("wheelbarrow") }).unwrap();
        assert_eq!((unknown.model, unknown.sonars), (None, 7));
    }

    #[test]
    fn a_port_that_cannot_be_opened_is_told_in_one_line() {
        let told = |path: &str| probe(&Address::Device(path.into()), &Parameters::default()).unwrap_err().to_string();
        assert_eq!(
            told("/dev/no-such-port"),
            "/dev/no-such-port: no such device: is the adapter plugged in? `ls /dev/serial/by-id` shows what there is"
        );
        assert_eq!(told("/dev/null"), "/dev/null: not a serial port");
        assert_eq!(told("/"), "/: not a serial port");
    }
}
