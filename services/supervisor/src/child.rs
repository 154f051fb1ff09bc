//! A child process: start, output, signals, end.

use crate::leftovers::{Origin, kill_descendants};
use crate::lifecycle::Exit;
use crate::lines::Lines;
use crate::usage::Usage;
use rustix::io::Errno;
use rustix::process::{Pid, PidfdFlags, Signal, getpgid, getpid, getppid, kill_process_group, pidfd_open, set_parent_process_death_signal};
use std::io::{self, PipeReader, Read, Write};
use std::os::fd::{AsFd, AsRawFd, BorrowedFd, OwnedFd};
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::process::{Command, ExitStatus, Stdio};

/// Exit code of a process whose settings, world or log cannot be used.
pub const EXIT_BAD_INPUT: u8 = 2;

/// Most bytes that are taken from a child in one round: one that floods its log does not hold up the others.
const ROUND_BYTES: usize = 64 * 1024;

/// A child in a process group of its own that dies when the thread that started it ends, however that comes about.
#[derive(Debug)]
pub(crate) struct Child {
    child: std::process::Child,
    pid: Pid,
    pidfd: OwnedFd,
    output: Option<PipeReader>,
    lines: Lines,
}

impl Child {
    /// Starts the command with nothing to read; what it writes comes to [`Child::read_output`]. It tells the guard of itself before it
    /// can start anything, so that of one that could not be started the guard may know, too.
    ///
    /// Not to be called from a thread that ends before the child should.
    pub(crate) fn start(mut command: Command, guard: Option<BorrowedFd<'_>>) -> io::Result<Self> {
        let (output, end) = io::pipe()?;
        rustix::io::ioctl_fionbio(&output, true)?;
        command.stdin(Stdio::null()).stdout(end.try_clone()?).stderr(end).process_group(0);
        die_with_this_thread(&mut command, guard);
        let child = command.spawn()?;
        let pid = Pid::from_child(&child);
        // Fails only where no file descriptor is left; the child must not stay without a watch then.
        let pidfd = match pidfd_open(pid, PidfdFlags::empty()) {
            Ok(pidfd) => pidfd,
            Err(error) => {
                let mut child = child;
                child.kill()?;
                child.wait()?;
                return Err(error.into());
            }
        };
        Ok(Self { child, pid, pidfd, output: Some(output), lines: Lines::default() })
    }

    /// Its process id.
    pub(crate) fn pid(&self) -> u32 {
        self.child.id()
    }

    /// Whether the process of this id is the child or one that it started.
    pub(crate) fn is(&self, pid: u32) -> bool {
        let pid = i32::try_from(pid).ok().and_then(Pid::from_raw);
        pid.is_some_and(|pid| pid == self.pid || getpgid(Some(pid)) == Ok(self.pid))
    }

    /// Descriptors that become readable when the child ends or writes.
    pub(crate) fn descriptors(&self) -> impl Iterator<Item = BorrowedFd<'_>> {
        std::iter::once(self.pidfd.as_fd()).chain(self.output.as_ref().map(AsFd::as_fd))
    }

    /// Signals the child and everything that it started.
    pub(crate) fn signal(&self, signal: Signal) {
        // The group exists for as long as the child has not been waited for; nothing else can fail.
        let _ = kill_process_group(self.pid, signal);
    }

    /// Takes what the child has written, line by line.
    pub(crate) fn read_output(&mut self, mut each: impl FnMut(&str)) {
        let mut taken = 0;
        let mut buffer = [0; 4096];
        while let Some(output) = self.output.as_mut().filter(|_| taken < ROUND_BYTES) {
            match output.read(&mut buffer) {
                Ok(0) => {
                    self.lines.flush(&mut each);
                    self.output = None;
                }
                Ok(count) => {
                    self.lines.push(&buffer[..count], &mut each);
                    taken += count;
                }
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => return,
                Err(_) => self.output = None,
            }
        }
    }

    /// How the child ended, which it has; what it had started ends with it, and what it wrote last is taken. `before` is called when
    /// nothing of it runs any more, while its process id is still its own.
    pub(crate) fn reap(&mut self, origin: Origin<'_>, each: impl FnMut(&str), before: impl FnOnce(u32)) -> io::Result<Exit> {
        self.signal(Signal::KILL);
        kill_descendants(origin);
        self.read_output(each);
        before(self.pid());
        Ok(exit(self.child.wait()?))
    }

    /// Whether it has ended; it is there until it is reaped.
    pub(crate) fn has_ended(&self) -> io::Result<bool> {
        use rustix::process::{WaitId, WaitIdOptions, waitid};
        let options = WaitIdOptions::EXITED | WaitIdOptions::NOHANG | WaitIdOptions::NOWAIT;
        match waitid(WaitId::PidFd(self.pidfd.as_fd()), options) {
            Ok(status) => Ok(status.is_some()),
            Err(Errno::INTR) => Ok(false),
            Err(error) => Err(error.into()),
        }
    }

    /// Processor time and memory so far.
    pub(crate) fn usage(&self) -> Option<Usage> {
        let read = |file: &str| std::fs::read_to_string(format!("/proc/{}/{file}", self.pid())).ok();
        Usage::read(&read("stat")?, &read("statm")?)
    }
}

fn exit(status: ExitStatus) -> Exit {
    match (status.code(), status.signal()) {
        (Some(0), _) => Exit::Finished,
        (Some(code), _) if code == i32::from(EXIT_BAD_INPUT) => Exit::BadInput,
        (Some(code), _) if code == i32::from(bus::EXIT_BROKEN_DOMAIN) => Exit::BrokenDomain,
        (Some(code), _) => Exit::Code(code),
        (None, signal) => Exit::Signal(signal.unwrap_or_default()),
    }
}

#[expect(unsafe_code, reason = "the parent-death signal can only be set between fork and exec")]
fn die_with_this_thread(command: &mut Command, guard: Option<BorrowedFd<'_>>) {
    let parent = getpid();
    let guard = guard.map(|guard| guard.as_raw_fd());
    let prepare = move || {
        set_parent_process_death_signal(Some(Signal::KILL))?;
        // The parent may have died before the signal was set.
        if getppid() != Some(parent) {
            return Err(Errno::SRCH.into());
        }
        if let Some(guard) = guard {
            // SAFETY: the supervisor keeps the descriptor open while it starts a child, and the child has its copy until exec.
            let guard = unsafe { BorrowedFd::borrow_raw(guard) };
            let mut line = [0; 16];
            let mut rest = &mut line[..];
            writeln!(rest, "+{}", getpid().as_raw_pid())?;
            let length = 16 - rest.len();
            // The supervisor tells once more, and finds out when the guard does not read.
            let _ = rustix::io::write(guard, &line[..length]);
        }
        Ok(())
    };
    // SAFETY: the closure only makes system calls, which are async-signal-safe; it allocates nothing and takes no lock.
    unsafe { command.pre_exec(prepare) };
}
