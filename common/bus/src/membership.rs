//! What a process is told by its supervisor: which domain, which run, who it is.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use crate::clock::DeploymentClock;
use crate::paths::volatile_state;

/// The environment that the supervisor gives to each of its children, and that [`Membership::from_env`] reads.
const DOMAIN: &str = "STILLMAP_DOMAIN";
const PROCESS: &str = "STILLMAP_PROCESS";
const RUN: &str = "STILLMAP_RUN";
const INCARNATION: &str = "STILLMAP_INCARNATION";
const CLOCK: &str = "STILLMAP_CLOCK";
const SETTINGS: &str = "STILLMAP_SETTINGS";
const ROUTE: &str = "STILLMAP_ROUTE";
const STATE: &str = "STILLMAP_STATE";
const START: &str = "STILLMAP_START";
const SUPERVISOR: &str = "STILLMAP_SUPERVISOR";

/// The place of a process in its deployment.
///
/// ```
/// use stillmap_bus::{Domain, Membership};
///
/// // A process that a supervisor has started reads its environment.
/// assert!(Membership::from_env().is_err(), "no supervisor has started this example");
///
/// let domain = Domain::open(&format!("example-membership-{}", std::process::id()), 1.0)?;
/// let membership = domain.membership_for("driver", 0, "settings.toml".as_ref());
/// assert_eq!((membership.process(), membership.incarnation()), ("driver", 0));
/// domain.close()?;
/// # Ok::<(), stillmap_bus::DomainError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Membership {
    pub(crate) directory: PathBuf,
    pub(crate) process: String,
    pub(crate) run: u64,
    pub(crate) incarnation: u32,
    pub(crate) clock: DeploymentClock,
    pub(crate) settings_path: PathBuf,
    /// Services whose messages do not go straight to their readers.
    pub(crate) routed: Vec<String>,
    /// The folder of checkpoints.
    pub(crate) state: PathBuf,
    /// How many times the run was started before.
    pub(crate) start: u32,
    /// Process id of the supervisor: who else asks to stop is not obeyed in order.
    pub(crate) supervisor: u32,
}

/// An environment that no supervisor made.
///
/// ```
/// use stillmap_bus::{Membership, MembershipError};
///
/// assert!(matches!(Membership::from_env(), Err(MembershipError::Missing { .. })));
/// ```
#[derive(Debug, thiserror::Error)]
pub enum MembershipError {
    /// A variable is missing: the process was not started by a supervisor.
    #[error("{variable} is not set: this process is started by `stillmap run`, not by hand")]
    Missing {
        /// The variable.
        variable: &'static str,
    },
    /// A variable cannot be read.
    #[error("{variable} is {found:?}, expected {expected}")]
    Malformed {
        /// The variable.
        variable: &'static str,
        /// Its value.
        found: String,
        /// What it should be.
        expected: &'static str,
    },
}

impl Membership {
    /// Reads the environment.
    ///
    /// # Errors
    /// When a variable is missing or malformed.
    pub fn from_env() -> Result<Self, MembershipError> {
        Self::from_lookup(std::env::var_os)
    }

    fn from_lookup(lookup: impl Fn(&'static str) -> Option<OsString>) -> Result<Self, MembershipError> {
        let path = |variable| lookup(variable).map(PathBuf::from).ok_or(MembershipError::Missing { variable });
        let text = |variable| {
            let found = lookup(variable).ok_or(MembershipError::Missing { variable })?;
            found.into_string().map_err(|found| MembershipError::Malformed {
                variable,
                found: found.to_string_lossy().into_owned(),
                expected: "UTF-8",
            })
        };
        let malformed = |variable, found: &str, expected| MembershipError::Malformed { variable, found: found.to_owned(), expected };

        let run = text(RUN)?;
        let incarnation = text(INCARNATION)?;
        let start = text(START)?;
        let supervisor = text(SUPERVISOR)?;
        let clock = text(CLOCK)?;
        let clock_parts: Option<DeploymentClock> = (|| {
            let mut parts = clock.split(':');
            let clock = DeploymentClock::from_parts(parts.next()?.parse().ok()?, parts.next()?.parse().ok()?, parts.next()?.parse().ok()?);
            parts.next().is_none().then_some(clock)
        })();
        Ok(Self {
            directory: path(DOMAIN)?,
            process: text(PROCESS)?,
            run: u64::from_str_radix(&run, 16).map_err(|_| malformed(RUN, &run, "a hexadecimal number"))?,
            incarnation: incarnation.parse().map_err(|_| malformed(INCARNATION, &incarnation, "a number"))?,
            clock: clock_parts.ok_or_else(|| malformed(CLOCK, &clock, "MONOTONIC_NS:REAL_NS:SPEED"))?,
            settings_path: path(SETTINGS)?,
            routed: text(ROUTE)?.split(',').filter(|name| !name.is_empty()).map(str::to_owned).collect(),
            state: path(STATE)?,
            start: start.parse().map_err(|_| malformed(START, &start, "a number"))?,
            supervisor: supervisor.parse().map_err(|_| malformed(SUPERVISOR, &supervisor, "a process id"))?,
        })
    }

    /// The environment that tells a child this membership.
    #[must_use]
    pub fn environment(&self) -> Vec<(&'static str, OsString)> {
        let clock = format!("{}:{}:{}", self.clock.started_monotonic_ns, self.clock.started_real_ns, self.clock.speed());
        vec![
            (DOMAIN, self.directory.clone().into_os_string()),
            (PROCESS, OsString::from(&self.process)),
            (RUN, OsString::from(format!("{:016x}", self.run))),
            (INCARNATION, OsString::from(self.incarnation.to_string())),
            (CLOCK, OsString::from(clock)),
            (SETTINGS, self.settings_path.clone().into_os_string()),
            (ROUTE, OsString::from(self.routed.join(","))),
            (STATE, self.state.clone().into_os_string()),
            (START, OsString::from(self.start.to_string())),
            (SUPERVISOR, OsString::from(self.supervisor.to_string())),
        ]
    }

    /// Name of the process in its deployment.
    #[must_use]
    pub fn process(&self) -> &str {
        &self.process
    }

    /// The run of the deployment, in every header.
    #[must_use]
    pub fn run(&self) -> u64 {
        self.run
    }

    /// How often this process has been started before since the deployment was.
    #[must_use]
    pub fn incarnation(&self) -> u32 {
        self.incarnation
    }

    /// The deployment's clock.
    #[must_use]
    pub fn clock(&self) -> DeploymentClock {
        self.clock
    }

    /// Deployment seconds that pass in a second of the wall clock.
    #[must_use]
    pub fn speed(&self) -> f64 {
        self.clock.speed()
    }

    /// The domain's folder, empty when the run starts and gone when it has ended.
    #[must_use]
    pub fn directory(&self) -> &Path {
        &self.directory
    }

    /// The folder of checkpoints, which outlives the deployment where its supervisor was told so.
    #[must_use]
    pub fn state(&self) -> &Path {
        &self.state
    }

    /// The folder of checkpoints that are removed with the domain.
    #[must_use]
    pub fn volatile_state(&self) -> PathBuf {
        volatile_state(&self.directory)
    }

    /// How many times the run was started before.
    #[must_use]
    pub fn start(&self) -> u32 {
        self.start
    }

    /// Process id of the supervisor.
    #[must_use]
    pub fn supervisor(&self) -> u32 {
        self.supervisor
    }

    /// The settings of the deployment, whole, as a TOML file.
    #[must_use]
    pub fn settings_path(&self) -> &Path {
        &self.settings_path
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn example() -> Membership {
        Membership {
            directory: "/run/stillmap/demo".into(),
            process: "mapping".into(),
            run: 0xfeed,
            incarnation: 3,
            clock: DeploymentClock::from_parts(12, 34, 2.5),
            settings_path: "/run/stillmap/demo/settings.toml".into(),
            routed: vec!["robot/scan".to_owned(), "map/verdict".to_owned()],
            state: "/home/robot/out/state".into(),
            start: 2,
            supervisor: 4242,
        }
    }

    #[test]
    fn what_is_told_is_what_is_read() {
        let told = example().environment();
        let read =
            Membership::from_lookup(|key| told.iter().find(|(name, _)| *name == key).map(|(_, value)| value.clone())).expect("readable");
        assert_eq!(read, example());
    }

    #[test]
    fn every_missing_or_malformed_variable_is_named() {
        let told = example().environment();
        for (missing, _) in &told {
            let error = Membership::from_lookup(|key| {
                told.iter().find(|(name, _)| *name == key && name != missing).map(|(_, value)| value.clone())
            })
            .expect_err("one is missing");
            assert!(error.to_string().contains(missing), "{error}");
        }
        for malformed in [RUN, INCARNATION, CLOCK, START, SUPERVISOR] {
            let error = Membership::from_lookup(|key| {
                told.iter()
                    .find(|(name, _)| *name == key)
                    .map(|(name, value)| if *name == malformed { "x:y".into() } else { value.clone() })
            })
            .expect_err("one is malformed");
            assert!(error.to_string().starts_with(malformed), "{error}");
        }
    }
}
