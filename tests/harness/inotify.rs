//! Waiting for what happens to files, as the kernel reports it.

use std::mem::MaybeUninit;
use std::os::fd::OwnedFd;
use std::path::Path;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::inotify::{self, CreateFlags, WatchFlags};

use super::WATCHDOG;

/// Events of one file or folder from the start of the watch.
pub(crate) struct Inotify(OwnedFd);

impl Inotify {
    pub(crate) fn watch(path: &Path, events: WatchFlags) -> Self {
        let watch = inotify::init(CreateFlags::CLOEXEC | CreateFlags::NONBLOCK).unwrap();
        inotify::add_watch(&watch, path, events).unwrap();
        Self(watch)
    }

    /// Waits until `wanted` holds; looks now and after each event.
    #[track_caller]
    pub(crate) fn wait_until(&self, what: &str, mut wanted: impl FnMut() -> bool) {
        while !wanted() {
            let mut polled = [PollFd::new(&self.0, PollFlags::IN)];
            let watchdog = Timespec { tv_sec: WATCHDOG.as_secs() as i64, tv_nsec: 0 };
            assert_eq!(poll(&mut polled, Some(&watchdog)).unwrap(), 1, "never: {what}");
            let mut buffer = [MaybeUninit::uninit(); 4096];
            let mut events = inotify::Reader::new(&self.0, &mut buffer);
            while events.next().is_ok() {}
        }
    }
}
