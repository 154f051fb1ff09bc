//! A domain: the folder, shared memory and lock of one deployment.

use std::fs::File;
use std::io::{self, Write};
use std::os::fd::BorrowedFd;
use std::path::{Path, PathBuf};

use messages::{Payload, Pictures, ServiceVisitor, visit_services};

use crate::clock::DeploymentClock;
use crate::descriptors::close_on_exec;
use crate::error::{BusError, DomainError};
use crate::fabric::{Channel, Fabric};
use crate::locks::{is_current, is_free, open_lock_file, take_lock, wait_until_deserted};
use crate::membership::Membership;
use crate::memory::{FOR_THE_SERVICES, check_free};
use crate::paths::{DomainPaths, ignore_missing, make_private, names, runtime_dir, volatile_state};
use crate::ports::{Ports, Presence};
use crate::reader::Reader;
use crate::writer::Writer;

/// Longest folder of a domain, bytes. A socket of iceoryx2 in it is `bus/`, the prefix of the domain, a number and `.event`. The kernel
/// takes 108 bytes with the one that ends the name, and iceoryx2 writes beyond them. The number grows with the ports that a process
/// has ever made: with 34 digits it allows for 126,000 of them, and a supervisor makes about 60 for each domain.
const LONGEST_FOLDER: usize = LONGEST_SOCKET - "/bus/stillmap_01234567_".len() - LONGEST_ID - ".event".len();
/// Longest name of a socket, bytes.
const LONGEST_SOCKET: usize = 107;
/// Most digits of the number of a port.
const LONGEST_ID: usize = 34;

/// What keeps a service in being.
type Held = Box<dyn std::any::Any>;

/// Which run a domain is for, and where its checkpoints are.
///
/// ```
/// use stillmap_bus::{Claim, Run};
///
/// let claim = Claim::take(&format!("example-run-{}", std::process::id()), 1.0)?;
/// // The run of this number is resumed for the third time.
/// let resumed = Run { number: 7, start: 3, ..claim.new_run() };
/// let domain = claim.open(resumed, &[])?;
/// assert_eq!(domain.run(), 7);
/// domain.close()?;
/// # Ok::<(), stillmap_bus::DomainError>(())
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Run {
    /// In the header of every message.
    pub number: u64,
    /// How many times the run was started before.
    pub start: u32,
    /// The folder of checkpoints.
    pub state: PathBuf,
    /// The deployment's clock is not set to an earlier time than this, ns since the Unix epoch.
    pub not_before_ns: u64,
}

/// The name of a domain, taken for a new supervisor: no process lives in it, and what an earlier run left is removed.
///
/// ```
/// use stillmap_bus::Claim;
///
/// let claim = Claim::take(&format!("example-claim-{}", std::process::id()), 1.0)?;
/// let run = claim.new_run();
/// // Scans go through a process that taps the service.
/// let domain = claim.open(run, &["robot/scan"])?;
/// domain.close()?;
/// # Ok::<(), stillmap_bus::DomainError>(())
/// ```
pub struct Claim {
    paths: DomainPaths,
    lock: File,
    clock: DeploymentClock,
}

/// The supervisor's hold on a domain: the lock, the folder and every service.
///
/// ```
/// use stillmap_bus::Domain;
///
/// let domain = Domain::open(&format!("example-domain-{}", std::process::id()), 1.0)?;
/// // A child process joins with this environment.
/// let environment = domain.membership_for("driver", 0, "settings.toml".as_ref()).environment();
/// assert!(environment.iter().any(|(variable, _)| *variable == "STILLMAP_DOMAIN"));
/// domain.close()?;
/// # Ok::<(), stillmap_bus::DomainError>(())
/// ```
pub struct Domain {
    paths: DomainPaths,
    /// Its own ports; None only while the bus is made anew.
    ports: Option<Ports>,
    services: Vec<Held>,
    clock: DeploymentClock,
    run: Run,
    /// Services whose messages go through a process between their publishers and their readers.
    routed: Vec<String>,
    lock: File,
    /// What is there as long as the bus is.
    made: Vec<PathBuf>,
}

impl Claim {
    /// Takes the lock of the domain of this name and removes what an earlier run left. Its clock runs `speed` times faster than
    /// the wall.
    ///
    /// # Errors
    /// When a supervisor holds it, processes of an earlier run are alive, or memory or the file system refuse.
    pub fn take(name: &str, speed: f64) -> Result<Self, DomainError> {
        check_name(name)?;
        let runtime = runtime_dir().map_err(|source| DomainError::Io { path: "the runtime folder".into(), source })?;
        remove_abandoned(&runtime, name);
        let paths = DomainPaths::new(&runtime, name);
        check_length(&paths.directory)?;
        let lock = take_lock(&paths)?;
        wait_until_deserted(&paths)?;
        let clock = DeploymentClock::start(speed);
        paths.wipe().map_err(|source| DomainError::Io { path: paths.directory.clone(), source })?;
        // Only now: what an earlier run left may be what fills it.
        check_free(FOR_THE_SERVICES)?;
        Ok(Self { paths, lock, clock })
    }

    /// A run that was never there before, with checkpoints that are removed with the domain.
    #[must_use]
    pub fn new_run(&self) -> Run {
        let number = self.clock.started_real_ns ^ (u64::from(std::process::id()) << 48);
        Run { number, start: 0, state: volatile_state(&self.paths.directory), not_before_ns: 0 }
    }

    /// The clock of the domain.
    #[must_use]
    pub fn clock(&self) -> DeploymentClock {
        self.clock
    }

    /// Creates the folder of the domain and every service. What is sent on the services named in `routed` does not go straight
    /// to their readers, but to the process that [taps](Ports::tap) it.
    ///
    /// # Errors
    /// When memory or the file system refuse.
    pub fn open(self, run: Run, routed: &[&str]) -> Result<Domain, DomainError> {
        let Self { paths, lock, clock } = self;
        sign(&lock, &run).map_err(|source| DomainError::Io { path: paths.lock.clone(), source })?;
        let mut domain = Domain {
            paths,
            ports: None,
            services: Vec::new(),
            clock: clock.not_before(run.not_before_ns),
            run,
            routed: routed.iter().map(|name| (*name).to_owned()).collect(),
            lock,
            made: Vec::new(),
        };
        if let Err(error) = domain.rebuild() {
            domain.release();
            destroy(&domain.paths)?;
            return Err(error);
        }
        Ok(domain)
    }
}

impl Domain {
    /// Opens the domain of this name for a new run.
    ///
    /// # Errors
    /// As [`Claim::take`] and [`Claim::open`].
    pub fn open(name: &str, speed: f64) -> Result<Self, DomainError> {
        let claim = Claim::take(name, speed)?;
        let run = claim.new_run();
        claim.open(run, &[])
    }

    /// Wipes the bus and creates every service anew, in the same run; the checkpoints stay. Only while no process of it lives.
    /// Readers and writers made before have to be dropped before: they would take parts of the new bus with them.
    ///
    /// # Errors
    /// As [`Domain::open`].
    pub fn rebuild(&mut self) -> Result<(), DomainError> {
        self.release();
        self.lock_again()?;
        let io = |source| DomainError::Io { path: self.paths.directory.clone(), source };
        self.paths.wipe_bus().map_err(io)?;
        make_private(&self.paths.directory).map_err(io)?;
        make_private(&self.paths.root()).map_err(io)?;
        let fabric = Fabric::join(&self.paths, "supervisor")?;
        let mut creation = Creation { fabric: &fabric, routed: &self.routed, services: Vec::new() };
        visit_services(&mut creation)?;
        self.services = creation.services;
        self.paths.close_to_others().map_err(|source| DomainError::Io { path: "/dev/shm".into(), source })?;
        self.ports = Some(Ports::new(fabric, self.run.number, Presence::Supervisor));
        self.made = self.paths.of_the_bus().map_err(|source| DomainError::Io { path: "/dev/shm".into(), source })?;
        Ok(())
    }

    /// A file or folder of the domain that another program has removed. What runs continues without it, but no process can join.
    #[must_use]
    pub fn removed(&self) -> Option<&Path> {
        let lock = Some(&self.paths.lock).filter(|path| !is_current(&self.lock, path));
        lock.or_else(|| self.made.iter().find(|path| !path.exists())).map(PathBuf::as_path)
    }

    /// Makes and takes the lock again where its file was removed: other supervisors are kept out, and commands find the run.
    ///
    /// # Errors
    /// When another supervisor was faster, or the file system refuses.
    pub fn lock_again(&mut self) -> Result<(), DomainError> {
        if is_current(&self.lock, &self.paths.lock) {
            return Ok(());
        }
        let io = |source| DomainError::Io { path: self.paths.lock.clone(), source };
        self.paths.lock.parent().map_or(Ok(()), make_private).map_err(io)?;
        self.lock = take_lock(&self.paths)?;
        sign(&self.lock, &self.run).map_err(io)
    }

    /// Fails if shared memory has no room for a deployment that needs so many bytes ([`needed_memory`](crate::needed_memory)).
    ///
    /// # Errors
    /// The room, and what is needed.
    pub fn check_memory(&self, needed: u64) -> Result<(), DomainError> {
        check_free(needed)
    }

    /// Keeps what this process has open on the bus from the programs that it starts: iceoryx2 does not. To be called before each start.
    pub fn close_on_exec(&self) {
        close_on_exec();
    }

    /// The domain's folder.
    #[must_use]
    pub fn directory(&self) -> &Path {
        &self.paths.directory
    }

    /// The folder of checkpoints.
    #[must_use]
    pub fn state(&self) -> &Path {
        &self.run.state
    }

    /// The number of the run, in the header of every message.
    #[must_use]
    pub fn run(&self) -> u64 {
        self.run.number
    }

    /// The deployment's clock.
    #[must_use]
    pub fn clock(&self) -> DeploymentClock {
        self.clock
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
            state: self.run.state.clone(),
            start: self.run.start,
            supervisor: std::process::id(),
        }
    }

    /// An input of the supervisor itself.
    ///
    /// # Errors
    /// When no place is left on the service.
    pub fn reader<T: Payload>(&mut self) -> Result<Reader<T>, BusError> {
        self.ports()?.uncounted_reader()
    }

    /// An output of the supervisor itself.
    ///
    /// # Errors
    /// When no place is left on the service.
    pub fn writer<T: Payload>(&mut self) -> Result<Writer<T>, BusError> {
        self.ports()?.uncounted_writer()
    }

    /// Descriptors that become readable when a message waits on an input of the supervisor.
    #[must_use]
    pub fn descriptors(&self) -> Vec<BorrowedFd<'_>> {
        self.ports.as_ref().map_or_else(Vec::new, Ports::descriptors)
    }

    /// Takes note of wake-ups and lets readers that have joined have what was sent; to be called after each wait.
    pub fn refresh(&self) {
        if let Some(ports) = &self.ports {
            ports.drain();
            ports.refresh();
        }
    }

    /// Removes what dead processes have left on the bus; to be called after each `waitpid`, and now and then for
    /// visitors. Returns how many nodes were dead.
    pub fn remove_dead_nodes(&self) -> usize {
        self.ports.as_ref().map_or(0, |ports| ports.fabric().remove_dead_nodes())
    }

    /// Waits until the last process has left, and removes everything the domain put anywhere.
    ///
    /// # Errors
    /// When processes stay, or the file system refuses.
    pub fn close(mut self) -> Result<(), DomainError> {
        self.release();
        destroy(&self.paths)
    }

    fn release(&mut self) {
        self.services.clear();
        self.ports = None;
    }

    fn ports(&mut self) -> Result<&mut Ports, BusError> {
        self.ports.as_mut().ok_or(BusError::NoService { service: "any" })
    }
}

/// Says in the lock file which process holds it, and for which run.
fn sign(mut lock: &File, run: &Run) -> io::Result<()> {
    lock.set_len(0)?;
    write!(lock, "{} {:016x}", std::process::id(), run.number)
}

/// Creates every service of the registry.
struct Creation<'a> {
    fabric: &'a Fabric,
    routed: &'a [String],
    services: Vec<Held>,
}

impl ServiceVisitor for Creation<'_> {
    type Error = BusError;

    fn message<T: Payload>(&mut self) -> Result<(), BusError> {
        self.services.push(Box::new(self.fabric.create::<T>(Channel::Open)?));
        if self.routed.iter().any(|name| name == T::SERVICE.name) {
            self.services.push(Box::new(self.fabric.create::<T>(Channel::Tapped)?));
        }
        Ok(())
    }

    fn pictures<P: Pictures>(&mut self) -> Result<(), BusError> {
        self.services.push(Box::new(self.fabric.create_pictures::<P>()?));
        Ok(())
    }
}

/// Removes what the supervisor of the domain at `directory` left when it was killed: waits until its last process is gone. Where the
/// whole runtime folder has been removed, as a service manager does, no lock is left to wait for, and what is in shared memory goes at once.
///
/// ```
/// use stillmap_bus::{Domain, sweep};
///
/// let domain = Domain::open(&format!("example-sweep-{}", std::process::id()), 1.0)?;
/// let folder = domain.directory().to_owned();
/// domain.close()?;
/// // The guard of a killed supervisor does this. Here nothing is left.
/// sweep(&folder)?;
/// # Ok::<(), stillmap_bus::DomainError>(())
/// ```
///
/// # Errors
/// When another supervisor has taken the domain, processes stay, or the file system refuses.
pub fn sweep(directory: &Path) -> Result<(), DomainError> {
    let paths = DomainPaths::of_directory(directory).ok_or_else(|| DomainError::Name { name: directory.display().to_string() })?;
    if !paths.lock.parent().is_some_and(Path::is_dir) {
        return paths.wipe().map_err(|source| DomainError::Io { path: paths.directory, source });
    }
    let _lock = take_lock(&paths)?;
    destroy(&paths)
}

fn destroy(paths: &DomainPaths) -> Result<(), DomainError> {
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
        if name == except || !is_free(&lock) || !is_current(&lock, &paths.lock) {
            continue;
        }
        let deserted = open_lock_file(&paths.members).is_ok_and(|members| is_free(&members));
        if deserted && destroy(&paths).is_ok() {
            tracing::info!("removed what deployment {name} had left behind");
        }
    }
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

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests fail by panicking")]
mod tests {
    use std::os::unix::fs::FileTypeExt;

    use messages::SonarScan;

    use super::*;

    /// A name with which the folder of the domain has this many bytes.
    fn name_for(folder_bytes: usize) -> String {
        let mut name = format!("long-{}", std::process::id());
        let missing = folder_bytes - runtime_dir().unwrap().join(&name).as_os_str().len();
        name.extend(std::iter::repeat_n('x', missing));
        name
    }

    #[test]
    fn sockets_of_the_longest_folder_have_room_for_their_numbers() {
        let domain = Domain::open(&name_for(LONGEST_FOLDER), 1.0).unwrap();
        let mut ports = Ports::join(&domain.membership_for("example", 0, "settings.toml".as_ref())).unwrap();
        let scans = ports.reader::<SonarScan>().unwrap();
        let files = std::fs::read_dir(domain.directory().join("bus")).unwrap().map(|entry| entry.unwrap());
        let sockets: Vec<PathBuf> = files.filter(|file| file.file_type().unwrap().is_socket()).map(|file| file.path()).collect();
        assert!(!sockets.is_empty());
        for socket in sockets {
            let name = socket.file_name().unwrap().to_str().unwrap();
            let id = name.rsplit('_').next().unwrap().trim_end_matches(".event");
            assert!(id.bytes().all(|byte| byte.is_ascii_digit()) && id.len() <= LONGEST_ID, "{name}");
            assert_eq!(socket.as_os_str().len() - id.len() + LONGEST_ID, LONGEST_SOCKET, "{name}");
        }
        drop((scans, ports));
        domain.close().unwrap();
    }

    #[test]
    fn a_longer_folder_is_refused() {
        let error = Domain::open(&name_for(LONGEST_FOLDER + 1), 1.0).err().unwrap().to_string();
        assert!(error.contains("is 45 bytes long, expected at most 44"), "{error}");
    }
}
