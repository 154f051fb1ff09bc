//! The serial adapter, plugged and pulled by the machine around this one.

use std::fs::File;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;

use rustix::fs::inotify::WatchFlags;
use rustix::fs::{Mode, OFlags};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};

use crate::harness::inotify::Inotify;

/// Its device while it is plugged.
pub(crate) const PORT: &str = "/dev/ttyUSB0";

/// What is at the other end of the cable.
#[derive(Debug, Clone, Copy)]
pub(crate) enum End {
    Nothing,
    Stranger,
    /// A simulated Pioneer 1 at the start of its drive down the empty corridor.
    Robot,
}

/// Commands the machine around this one, and waits until it is done.
fn tell(word: &str) {
    let line = rustix::fs::open("/dev/ttyS1", OFlags::RDWR | OFlags::NOCTTY, Mode::empty()).unwrap();
    let mut attributes = tcgetattr(&line).unwrap();
    attributes.make_raw();
    tcsetattr(&line, OptionalActions::Now, &attributes).unwrap();
    let mut line = File::from(line);
    line.write_all(format!("{word}\n").as_bytes()).unwrap();
    let mut answer = String::new();
    BufReader::new(line).read_line(&mut answer).unwrap();
    assert_eq!(answer, "ok\n");
}

/// Puts something at the other end of the cable.
pub(crate) fn connect(end: End) {
    tell(match end {
        End::Nothing => "nothing",
        End::Stranger => "stranger",
        End::Robot => "robot",
    });
}

/// Plugs the adapter, and waits until the kernel has made its device.
pub(crate) fn plug() {
    change("plug", true);
}

/// Pulls the adapter, and waits until the kernel has taken its device away.
pub(crate) fn pull() {
    change("pull", false);
}

fn change(word: &str, plugged: bool) {
    let devices = Inotify::watch(Path::new("/dev"), WatchFlags::CREATE | WatchFlags::DELETE);
    tell(word);
    devices.wait_until(word, || Path::new(PORT).exists() == plugged);
}
