//! A domain: the place where one deployment lives, and nobody else.

use std::cell::Cell;
use std::fs::{File, OpenOptions};
use std::io::{self, Read, Write};
use std::os::fd::BorrowedFd;
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::time::{Duration, Instant};

use iceoryx2::port::listener::Listener;
use iceoryx2::prelude::ipc;
use messages::{
    CameraBackground, CameraFrame, CameraMask, CameraMotion, DeploymentStatus, FilterVerdict, Heartbeat, LogLine, MapSummary, MapTile,
    Payload, Pictures, PlaybackControl, Progress, Service, SonarMotion, SonarScan, TruthMask, TruthScan, TruthSurfaces, VerdictOutlook,
    Walkers, WayChunk,
};
use rustix::fs::{FlockOperation, flock};

use crate::broken::BusError;
use crate::clock::DeploymentClock;
use crate::fabric::{Channel, Fabric};
use crate::membership::Membership;
use crate::memory::{FOR_A_DEPLOYMENT, check_free};
use crate::outlet::Refresh;
use crate::paths::{DomainPaths, ignore_missing, make_private, runtime_dir};
use crate::reader::Reader;
use crate::shell::{drain, listener_descriptor, timespec};
use crate::state::{Kept, State};
use crate::writer::Writer;

/// How long a lock may be held by someone who only looks, or by processes that are about to be gone.
const LOCK_PATIENCE: Duration = Duration::from_secs(5);
/// The names of iceoryx2's sockets, which begin with the folder of the domain, may have 107 bytes.
const LONGEST_FOLDER: usize = 48;
/// Stamps of a run may be so much later than its last note, s of the wall clock: notes are taken every second or so.
const UNNOTED_S: f64 = 3.0;

/// A domain that could not be opened, joined or cleaned.
#[derive(Debug, thiserror::Error)]
pub enum DomainError {
    /// The name cannot be one.
    #[error("deployment name {name:?}: expected 1 to 40 of a-z, 0-9 and -")]
    Name {
        /// What was given.
        name: String,
    },
    /// A supervisor holds it.
    #[error("deployment {name} is already running (process {pid})")]
    Running {
        /// Its name.
        name: String,
        /// Process id of its supervisor, as it wrote it.
        pid: String,
    },
    /// Nobody holds it.
    #[error("deployment {name} is not running")]
    NoDomain {
        /// Its name.
        name: String,
    },
    /// Processes of an earlier run are still alive in it.
    #[error("processes of an earlier run of {name} are still alive after {waited:?}")]
    StillInhabited {
        /// Its name.
        name: String,
        /// How long it was waited for them.
        waited: Duration,
    },
    /// The files of the bus would have longer names than the system takes.
    #[error("the runtime folder {folder} is {found} bytes long, expected at most {most}: set STILLMAP_RUNTIME_DIR to a shorter one")]
    LongFolder {
        /// The folder of the domain.
        folder: PathBuf,
        /// Its length.
        found: usize,
        /// The longest that can be.
        most: usize,
    },
    /// Too little shared memory.
    #[error("/dev/shm has {free} bytes free, expected at least {needed}")]
    SharedMemory {
        /// Bytes free.
        free: u64,
        /// Bytes needed.
        needed: u64,
    },
    /// The file system refuses.
    #[error("{path}: {source}")]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What it says.
        source: io::Error,
    },
    /// The bus fails.
    #[error("{0}")]
    Bus(#[from] BusError),
}

/// A service, and what keeps it in being.
type Held = (Service, Box<dyn std::any::Any>);

/// The supervisor's hold on a domain: the lock, the folder and every service.
pub struct Domain {
    paths: DomainPaths,
    fabric: Option<Fabric>,
    services: Vec<Held>,
    writers: Vec<Rc<dyn Refresh>>,
    listeners: Vec<Rc<Listener<ipc::Service>>>,
    clock: DeploymentClock,
    /// The run, and where its checkpoints are.
    state: State,
    /// Services whose messages go through a process between their publishers and their readers.
    routed: Vec<String>,
    _lock: File,
}

impl Domain {
    /// Opens the domain of this name for a new run: takes its lock, removes what an earlier run left, creates every service.
    ///
    /// # Errors
    /// When a supervisor holds it, processes of an earlier run are alive, or memory or the file system refuse.
    pub fn open(name: &str, speed: f64) -> Result<Self, DomainError> {
        Self::open_with(name, speed, &[], None)
    }

    /// As [`Domain::open`]. What is sent on the services named in `routed` does not go straight to their readers, but to who
    /// [taps](crate::Shell::tap) it. `kept` says where checkpoints outlive the deployment, if they do: the run that was there last
    /// goes on then, under its own number and with a clock that is not behind it.
    ///
    /// # Errors
    /// As [`Domain::open`].
    pub fn open_with(name: &str, speed: f64, routed: &[&str], kept: Option<Kept<'_>>) -> Result<Self, DomainError> {
        check_name(name)?;
        let runtime = runtime_dir().map_err(|source| DomainError::Io { path: "the runtime folder".into(), source })?;
        remove_abandoned(&runtime, name);
        let paths = DomainPaths::new(&runtime, name);
        check_length(&paths.directory)?;
        check_free(FOR_A_DEPLOYMENT)?;
        let mut lock = take_lock(&paths)?;
        wait_until_deserted(&paths)?;
        let clock = DeploymentClock::start(speed);
        let new_run = clock.started_real_ns ^ (u64::from(std::process::id()) << 48);
        let io = |path: &Path| {
            let path = path.to_owned();
            move |source| DomainError::Io { path, source }
        };
        paths.wipe().map_err(io(&paths.directory))?;
        let state = match kept {
            None => State::of_the_run(&paths.directory, new_run),
            Some(kept) => State::take_up(kept, name, new_run).map_err(io(kept.folder))?,
        };
        let unnoted_ns = (UNNOTED_S * clock.speed() * 1e9) as u64;
        let clock = clock.not_before(state.last_ns().saturating_add(unnoted_ns));
        let run = state.run();
        lock.set_len(0).and_then(|()| write!(lock, "{} {run:016x}", std::process::id())).map_err(io(&paths.lock))?;
        let mut domain = Self {
            paths,
            fabric: None,
            services: Vec::new(),
            writers: Vec::new(),
            listeners: Vec::new(),
            clock,
            state,
            routed: routed.iter().map(|name| (*name).to_owned()).collect(),
            _lock: lock,
        };
        if let Err(error) = domain.rebuild() {
            domain.release();
            demolish(&domain.paths)?;
            return Err(error);
        }
        if let Err(error) = domain.note_time() {
            tracing::warn!("{error}: the next start may go on with a clock that is behind");
        }
        Ok(domain)
    }

    /// Wipes the bus and creates every service anew, in the same run; the checkpoints stay. Only while no process of it lives.
    /// Readers and writers made before have to be dropped before: they would take parts of the new bus with them.
    ///
    /// # Errors
    /// As [`Domain::open`].
    pub fn rebuild(&mut self) -> Result<(), DomainError> {
        let io = |source| DomainError::Io { path: self.paths.directory.clone(), source };
        self.writers.clear();
        self.listeners.clear();
        self.services.clear();
        self.fabric = None;
        self.paths.wipe_bus().map_err(io)?;
        make_private(&self.paths.directory).map_err(io)?;
        make_private(&self.paths.root()).map_err(io)?;
        let fabric = Fabric::join(&self.paths, "supervisor")?;
        let mut services: Vec<Held> = Vec::new();
        let routed = &self.routed;
        hold::<SonarScan>(&fabric, routed, &mut services)?;
        hold::<SonarMotion>(&fabric, routed, &mut services)?;
        hold::<CameraMotion>(&fabric, routed, &mut services)?;
        hold::<FilterVerdict>(&fabric, routed, &mut services)?;
        hold::<VerdictOutlook>(&fabric, routed, &mut services)?;
        hold::<Walkers>(&fabric, routed, &mut services)?;
        hold::<MapTile>(&fabric, routed, &mut services)?;
        hold::<WayChunk>(&fabric, routed, &mut services)?;
        hold::<MapSummary>(&fabric, routed, &mut services)?;
        hold::<Heartbeat>(&fabric, routed, &mut services)?;
        hold::<Progress>(&fabric, routed, &mut services)?;
        hold::<DeploymentStatus>(&fabric, routed, &mut services)?;
        hold::<LogLine>(&fabric, routed, &mut services)?;
        hold::<PlaybackControl>(&fabric, routed, &mut services)?;
        hold::<TruthScan>(&fabric, routed, &mut services)?;
        hold::<TruthSurfaces>(&fabric, routed, &mut services)?;
        hold_pictures::<CameraFrame>(&fabric, &mut services)?;
        hold_pictures::<CameraMask>(&fabric, &mut services)?;
        hold_pictures::<CameraBackground>(&fabric, &mut services)?;
        hold_pictures::<TruthMask>(&fabric, &mut services)?;
        self.paths.close_to_others().map_err(|source| DomainError::Io { path: "/dev/shm".into(), source })?;
        self.services = services;
        self.fabric = Some(fabric);
        Ok(())
    }

    /// The domain's folder.
    #[must_use]
    pub fn directory(&self) -> &Path {
        &self.paths.directory
    }

    /// The run that this hold stands for.
    #[must_use]
    pub fn run(&self) -> u64 {
        self.state.run()
    }

    /// Whether this is an earlier run that goes on.
    #[must_use]
    pub fn goes_on(&self) -> bool {
        self.state.start() > 0
    }

    /// Keeps how late it is in the deployment for the next start of the run; to be called every second or so.
    ///
    /// # Errors
    /// When the file system refuses.
    pub fn note_time(&self) -> Result<(), DomainError> {
        self.state.note(self.clock.now_ns()).map_err(|source| DomainError::Io { path: self.state.folder().to_owned(), source })
    }

    /// What a child is told: its environment is [`Membership::environment`].
    #[must_use]
    pub fn membership_for(&self, process: &str, incarnation: u32, settings_path: &Path) -> Membership {
        Membership {
            directory: self.paths.directory.clone(),
            process: process.to_owned(),
            run: self.run(),
            incarnation,
            clock: self.clock,
            settings_path: settings_path.to_owned(),
            routed: self.routed.clone(),
            state: self.state.folder().to_owned(),
            start: self.state.start(),
            supervisor: std::process::id(),
        }
    }

    /// An input of the supervisor itself.
    ///
    /// # Errors
    /// When no place is left on the service.
    pub fn reader<T: Payload>(&mut self) -> Result<Reader<T>, BusError> {
        let reader = Reader::new(&self.fabric()?.open(Channel::Open)?, self.run(), None)?;
        self.listeners.extend(reader.listener());
        Ok(reader)
    }

    /// An output of the supervisor itself.
    ///
    /// # Errors
    /// When no place is left on the service.
    pub fn writer<T: Payload>(&mut self) -> Result<Writer<T>, BusError> {
        let writer = Writer::new(self.fabric()?.open(Channel::Open)?, self.run(), Rc::new(Cell::new(0)))?;
        self.writers.push(writer.refresh());
        Ok(writer)
    }

    /// Whether what is sent on the service of this name is a numbered stream, of which every message counts.
    #[must_use]
    pub fn is_sequenced(&self, service: &str) -> bool {
        self.services.iter().any(|(held, _)| held.name == service && held.sequenced)
    }

    /// Descriptors that become readable when a message waits on an input of the supervisor.
    #[must_use]
    pub fn descriptors(&self) -> Vec<BorrowedFd<'_>> {
        self.listeners.iter().map(|listener| listener_descriptor(listener)).collect()
    }

    /// Takes note of wake-ups and lets readers that have joined have what was sent; to be called after each wait.
    pub fn refresh(&self) {
        self.listeners.iter().for_each(|listener| drain(listener));
        self.writers.iter().for_each(|writer| writer.refresh());
    }

    /// Removes what dead processes have left on the bus; to be called after each `waitpid`, and now and then for
    /// visitors. Returns how many nodes were dead.
    pub fn remove_the_dead(&self) -> usize {
        self.fabric.as_ref().map_or(0, Fabric::remove_the_dead)
    }

    /// Waits until the last process has left, and removes everything the domain put anywhere.
    ///
    /// # Errors
    /// When processes stay, or the file system refuses.
    pub fn close(mut self) -> Result<(), DomainError> {
        self.release();
        demolish(&self.paths)
    }

    fn release(&mut self) {
        self.writers.clear();
        self.listeners.clear();
        self.services.clear();
        self.fabric = None;
    }

    fn fabric(&self) -> Result<&Fabric, BusError> {
        self.fabric.as_ref().ok_or(BusError::NoService { service: "any" })
    }
}

fn hold<T: Payload>(fabric: &Fabric, routed: &[String], services: &mut Vec<Held>) -> Result<(), BusError> {
    services.push((T::SERVICE, Box::new(fabric.create::<T>(Channel::Open)?)));
    if routed.iter().any(|name| name == T::SERVICE.name) {
        services.push((T::SERVICE, Box::new(fabric.create::<T>(Channel::Tapped)?)));
    }
    Ok(())
}

fn hold_pictures<P: Pictures>(fabric: &Fabric, services: &mut Vec<Held>) -> Result<(), BusError> {
    services.push((P::SERVICE, Box::new(fabric.create_pictures::<P>()?)));
    Ok(())
}

/// A deployment that runs on this machine under this user.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RunningDomain {
    paths: DomainPaths,
    run: u64,
    pid: u32,
}

impl RunningDomain {
    /// Every deployment that runs, by name.
    ///
    /// # Errors
    /// When the runtime folder cannot be read.
    pub fn all() -> Result<Vec<Self>, DomainError> {
        let runtime = runtime_dir().map_err(|source| DomainError::Io { path: "the runtime folder".into(), source })?;
        let mut running: Vec<Self> =
            names(&runtime).into_iter().filter_map(|name| Self::look(&DomainPaths::new(&runtime, &name))).collect();
        running.sort_by(|a, b| a.paths.name.cmp(&b.paths.name));
        Ok(running)
    }

    /// Its name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.paths.name
    }

    /// Process id of its supervisor.
    #[must_use]
    pub fn pid(&self) -> u32 {
        self.pid
    }

    /// Its folder.
    #[must_use]
    pub fn directory(&self) -> &Path {
        &self.paths.directory
    }

    pub(crate) fn run(&self) -> u64 {
        self.run
    }

    pub(crate) fn paths(&self) -> &DomainPaths {
        &self.paths
    }

    fn look(paths: &DomainPaths) -> Option<Self> {
        let mut file = File::open(&paths.lock).ok()?;
        if flock(&file, FlockOperation::NonBlockingLockShared).is_ok() {
            return None;
        }
        let mut text = String::new();
        file.read_to_string(&mut text).ok()?;
        let (pid, run) = text.split_once(' ')?;
        Some(Self { paths: paths.clone(), run: u64::from_str_radix(run, 16).ok()?, pid: pid.parse().ok()? })
    }
}

/// Says that this process lives in the domain, as long as the file is held.
pub(crate) fn join_members(paths: &DomainPaths) -> Result<File, DomainError> {
    let io = |source| DomainError::Io { path: paths.members.clone(), source };
    if !paths.directory.is_dir() {
        return Err(DomainError::NoDomain { name: paths.name.clone() });
    }
    let file = open_lock_file(&paths.members).map_err(io)?;
    flock(&file, FlockOperation::LockShared).map_err(|error| io(error.into()))?;
    Ok(file)
}

/// Removes what the supervisor of the domain at `directory` left when it was killed: waits until its last process is gone. Where the
/// whole runtime folder has been removed, as a service manager does, nobody can be told to wait, and what is in shared memory goes at once.
///
/// # Errors
/// When another supervisor has taken the domain, processes stay, or the file system refuses.
pub fn sweep(directory: &Path) -> Result<(), DomainError> {
    let paths = DomainPaths::of_directory(directory).ok_or_else(|| DomainError::Name { name: directory.display().to_string() })?;
    if !paths.lock.parent().is_some_and(Path::is_dir) {
        return paths.wipe().map_err(|source| DomainError::Io { path: paths.directory, source });
    }
    let _lock = take_lock(&paths)?;
    demolish(&paths)
}

fn demolish(paths: &DomainPaths) -> Result<(), DomainError> {
    let _deserted = wait_until_deserted(paths)?;
    let io = |source| DomainError::Io { path: paths.directory.clone(), source };
    paths.wipe().map_err(io)?;
    ignore_missing(std::fs::remove_file(&paths.members)).map_err(io)?;
    ignore_missing(std::fs::remove_file(&paths.lock)).map_err(io)
}

/// Removes domains whose supervisor was killed and whose processes are gone, other than `except`.
fn remove_abandoned(runtime: &Path, except: &str) {
    for name in names(runtime) {
        let paths = DomainPaths::new(runtime, &name);
        let Ok(lock) = open_lock_file(&paths.lock) else { continue };
        let free = |file: &File| flock(file, FlockOperation::NonBlockingLockExclusive).is_ok();
        if name == except || !free(&lock) || !is_current(&lock, &paths.lock) {
            continue;
        }
        let deserted = open_lock_file(&paths.members).is_ok_and(|members| free(&members));
        if deserted && demolish(&paths).is_ok() {
            tracing::info!("removed what deployment {name} had left behind");
        }
    }
}

fn names(runtime: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(runtime).into_iter().flatten().flatten();
    entries.filter_map(|entry| Some(entry.file_name().to_str()?.strip_suffix(".lock")?.to_owned())).collect()
}

fn take_lock(paths: &DomainPaths) -> Result<File, DomainError> {
    let io = |source| DomainError::Io { path: paths.lock.clone(), source };
    let started = Instant::now();
    loop {
        let mut lock = open_lock_file(&paths.lock).map_err(io)?;
        let taken = flock(&lock, FlockOperation::NonBlockingLockExclusive).is_ok();
        if taken && is_current(&lock, &paths.lock) {
            return Ok(lock);
        }
        if started.elapsed() > LOCK_PATIENCE / 5 && !taken {
            let mut pid = String::new();
            lock.read_to_string(&mut pid).map_err(io)?;
            let pid = pid.split(' ').next().unwrap_or_default().to_owned();
            return Err(DomainError::Running { name: paths.name.clone(), pid });
        }
        pause();
    }
}

fn wait_until_deserted(paths: &DomainPaths) -> Result<File, DomainError> {
    let io = |source| DomainError::Io { path: paths.members.clone(), source };
    let members = open_lock_file(&paths.members).map_err(io)?;
    let started = Instant::now();
    while flock(&members, FlockOperation::NonBlockingLockExclusive).is_err() {
        if started.elapsed() > LOCK_PATIENCE {
            return Err(DomainError::StillInhabited { name: paths.name.clone(), waited: LOCK_PATIENCE });
        }
        pause();
    }
    Ok(members)
}

/// The kernel has no way to wait for a file lock with a limit.
fn pause() {
    let _ = rustix::event::poll(&mut [], Some(&timespec(Duration::from_millis(5))));
}

fn open_lock_file(path: &Path) -> io::Result<File> {
    OpenOptions::new().read(true).write(true).create(true).truncate(false).mode(0o600).open(path)
}

/// Whether the file behind the path is still the one that was opened, and locked.
fn is_current(file: &File, path: &Path) -> bool {
    let identity = |found: io::Result<std::fs::Metadata>| found.ok().map(|found| (found.dev(), found.ino()));
    identity(file.metadata()) == identity(std::fs::metadata(path))
}

fn check_length(folder: &Path) -> Result<(), DomainError> {
    let found = folder.as_os_str().len();
    if found > LONGEST_FOLDER {
        return Err(DomainError::LongFolder { folder: folder.to_owned(), found, most: LONGEST_FOLDER });
    }
    Ok(())
}

fn check_name(name: &str) -> Result<(), DomainError> {
    let allowed = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
    if name.is_empty() || name.len() > 40 || !name.chars().all(allowed) {
        return Err(DomainError::Name { name: name.to_owned() });
    }
    Ok(())
}
