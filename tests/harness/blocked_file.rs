//! A file that a process begins to write and cannot finish, so that it can be killed in the middle.

use std::fs::{File, OpenOptions};
use std::io::{Read, Write};
use std::os::fd::AsFd;
use std::os::unix::fs::{DirBuilderExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

use rustix::fs::inotify::WatchFlags;
use rustix::fs::{CWD, Mode, OFlags, RenameFlags, mkfifoat, renameat_with};

use super::inotify::Inotify;
use super::processes::{kill, look_until};

/// A pipe holds whole pages; this one has a single one.
const PAGE: usize = 4096;

/// A pipe at the path of a file that a process is going to make. Its writer opens it, writes as much as there is room for, and waits for
/// a reader that never comes.
pub(crate) struct BlockedFile {
    path: PathBuf,
    pipe: File,
    /// Whether there is no room at all.
    full: bool,
}

/// How much of the file is written before the writer waits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Room {
    /// For a file of less than a page.
    None,
    Page,
}

impl BlockedFile {
    /// Puts the pipe at the path, or waits with it until no file is there: a file that another is renamed from comes and goes.
    pub(crate) fn at(path: &Path, room: Room) -> Self {
        let folder = path.parent().unwrap();
        std::fs::DirBuilder::new().recursive(true).mode(0o700).create(folder).unwrap();
        // Made aside and put there when it is ready.
        let aside = path.with_extension("blocked");
        mkfifoat(CWD, &aside, Mode::RUSR | Mode::WUSR).unwrap();
        let flags = OFlags::NONBLOCK.bits() as i32;
        let mut pipe = OpenOptions::new().read(true).write(true).custom_flags(flags).open(&aside).unwrap();
        assert_eq!(rustix::pipe::fcntl_setpipe_size(&pipe, PAGE).unwrap(), PAGE);
        let full = room == Room::None;
        if full {
            pipe.write_all(&[0; PAGE]).unwrap();
        }
        let removed = Inotify::watch(folder, WatchFlags::MOVED_FROM | WatchFlags::DELETE);
        removed.wait_until("a file is renamed", || match renameat_with(CWD, &aside, CWD, path, RenameFlags::NOREPLACE) {
            Ok(()) => true,
            Err(rustix::io::Errno::EXIST) => false,
            Err(error) => panic!("{}: {error}", path.display()),
        });
        Self { path: path.to_owned(), pipe, full }
    }

    /// The next checkpoint of a process that has saved one in this folder and overwrites it in place: it writes a new file when the old one
    /// is not as it has left it. A byte at the end belongs to no record.
    pub(crate) fn at_checkpoint(folder: &Path, process: &str) -> Self {
        let file = Self::at(&folder.join(format!("{process}.fresh")), Room::None);
        let mut checkpoint = OpenOptions::new().append(true).open(folder.join(format!("{process}.checkpoint"))).unwrap();
        checkpoint.write_all(&[0]).unwrap();
        file
    }

    /// Waits until the process is in the middle of writing the file.
    #[track_caller]
    pub(crate) fn wait_for_writer(&self, pid: u32) {
        let is_open = || {
            let descriptors = std::fs::read_dir(format!("/proc/{pid}/fd")).into_iter().flatten().flatten();
            descriptors.filter_map(|entry| std::fs::read_link(entry.path()).ok()).any(|target| target == self.path)
        };
        let what = format!("process {pid} writes {}", self.path.display());
        look_until(&what, || is_open() && rustix::io::ioctl_fionread(&self.pipe).unwrap() > 0);
    }

    /// Kills the process in the middle of writing the file, and leaves what it has written as a file.
    #[track_caller]
    pub(crate) fn kill_writer(self, pid: u32) {
        self.wait_for_writer(pid);
        let mut written = vec![0; PAGE];
        let count = if self.full { 0 } else { self.copy_of_contents().read(&mut written).unwrap() };
        let aside = self.path.with_extension("blocked");
        std::fs::write(&aside, &written[..count]).unwrap();
        // Before the kill: the process that is started next finds the file. The writer still has the pipe, where there is no room.
        std::fs::rename(&aside, &self.path).unwrap();
        kill(pid);
    }

    /// A pipe with the same bytes: to take them from this one would make room for more.
    fn copy_of_contents(&self) -> File {
        let (reader, writer) = rustix::pipe::pipe().unwrap();
        let copied = rustix::pipe::tee(self.pipe.as_fd(), &writer, PAGE, rustix::pipe::SpliceFlags::empty()).unwrap();
        assert!(copied > 0);
        File::from(reader)
    }
}
