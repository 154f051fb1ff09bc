//! A file that can be begun and not finished: whoever writes it stands in the middle of it.
#![allow(dead_code, reason = "each test uses its part")]

use std::fs::{File, OpenOptions};
use std::io::{Read, Write};
use std::os::unix::fs::{DirBuilderExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

use rustix::fs::{CWD, Mode, OFlags, mkfifoat};

/// A pipe holds whole pages; this one has a single one.
const PAGE: usize = 4096;

/// A pipe in the place of a file that a process is going to make. Its writer opens it, writes as much as there is room for, and
/// waits for a reader who does not come.
pub(crate) struct Cork {
    path: PathBuf,
    pipe: File,
    /// Whether there is no room at all, for a file of less than a page.
    full: bool,
}

impl Cork {
    /// Puts it there; `small` for a file of less than a page, of which then nothing is written.
    pub(crate) fn put(path: &Path, small: bool) -> Self {
        let folder = path.parent().unwrap();
        std::fs::DirBuilder::new().recursive(true).mode(0o700).create(folder).unwrap();
        mkfifoat(CWD, path, Mode::RUSR | Mode::WUSR).unwrap();
        let flags = OFlags::NONBLOCK.bits() as i32;
        let mut pipe = OpenOptions::new().read(true).write(true).custom_flags(flags).open(path).unwrap();
        assert_eq!(rustix::pipe::fcntl_setpipe_size(&pipe, PAGE).unwrap(), PAGE);
        if small {
            pipe.write_all(&[0; PAGE]).unwrap();
        }
        Self { path: path.to_owned(), pipe, full: small }
    }

    /// Whether the process has begun to write, and therefore stands in the middle of it.
    pub(crate) fn holds(&self, pid: u64) -> bool {
        let descriptors = std::fs::read_dir(format!("/proc/{pid}/fd")).into_iter().flatten().flatten();
        let mut targets = descriptors.filter_map(|entry| std::fs::read_link(entry.path()).ok());
        targets.any(|target| target == self.path) && rustix::io::ioctl_fionread(&self.pipe).unwrap() > 0
    }

    /// Leaves in its place what was written, as a file of which no more was written would.
    pub(crate) fn leave_what_was_written(mut self) {
        let mut written = vec![0; PAGE];
        let count = if self.full { 0 } else { self.pipe.read(&mut written).unwrap() };
        std::fs::remove_file(&self.path).unwrap();
        std::fs::write(&self.path, &written[..count]).unwrap();
    }
}
