//! One function for each thing that a deployment needs of its computer.

use super::finding::Finding;
use crate::running::user_name;
use bus::RunningDomain;
use rustix::fs::{Access, access, statvfs};
use rustix::process::{Resource, getrlimit};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// Ids of ordinary users begin here (login.defs of Debian, Fedora and others). logind removes the shared memory of these alone.
const FIRST_USER: u32 = 1000;

pub(super) fn kernel() -> Finding {
    let release = std::fs::read_to_string("/proc/sys/kernel/osrelease").unwrap_or_default();
    match supervisor::check_kernel() {
        Ok(()) => Finding::Well(format!("Linux {}", release.trim_end())),
        Err(error) => {
            Finding::Fault { found: error.to_string(), remedy: "install a newer kernel, or allow the call in the container".to_owned() }
        }
    }
}

pub(super) fn shared_memory(needed: u64) -> Finding {
    match statvfs("/dev/shm") {
        Ok(found) => judge_shared_memory(found.f_bavail.saturating_mul(found.f_frsize), needed),
        Err(error) => Finding::Fault { found: format!("/dev/shm: {error}"), remedy: "mount -t tmpfs tmpfs /dev/shm".to_owned() },
    }
}

fn judge_shared_memory(free: u64, needed: u64) -> Finding {
    let mb = |bytes: u64| bytes as f64 / 1e6;
    let found = format!("{:.0} MB free in /dev/shm, {:.1} MB needed", mb(free), mb(needed));
    if free >= needed {
        return Finding::Well(found);
    }
    let remedy = "mount -o remount,size=256M /dev/shm; in a container: --shm-size=256m. `ls -l /dev/shm` shows what takes it".to_owned();
    Finding::Fault { found, remedy }
}

pub(super) fn open_files(processes: usize) -> Finding {
    judge_open_files(getrlimit(Resource::Nofile).maximum, bus::needed_descriptors(processes))
}

fn judge_open_files(hard: Option<u64>, needed: u64) -> Finding {
    match hard {
        Some(limit) if limit < needed => Finding::Fault {
            found: format!("a process may open {limit} files, {needed} needed"),
            remedy: "raise the hard limit: ulimit -Hn, LimitNOFILE= of the service, or docker run --ulimit nofile=".to_owned(),
        },
        Some(limit) => Finding::Well(format!("a process may open {limit} files, {needed} needed")),
        None => Finding::Well("no limit".to_owned()),
    }
}

pub(super) fn runtime_folder() -> Finding {
    match RunningDomain::folder() {
        Ok(folder) => Finding::Well(folder.display().to_string()),
        Err(error) => Finding::Fault { found: error.to_string(), remedy: "set STILLMAP_RUNTIME_DIR to a folder of this user".to_owned() },
    }
}

/// Whether logind removes the shared memory of this user at the last logout.
pub(super) fn logout() -> Finding {
    let uid = rustix::process::getuid().as_raw();
    let lingers = Path::new("/var/lib/systemd/linger").join(user_name(uid)).exists();
    let config = std::fs::read_to_string("/etc/systemd/logind.conf").unwrap_or_default();
    judge_logout(uid, Path::new("/run/systemd/seats").exists(), lingers, &config)
}

fn judge_logout(uid: u32, has_logind: bool, lingers: bool, config: &str) -> Finding {
    let keeps = config.lines().any(|line| matches!(line.trim(), "RemoveIPC=no" | "RemoveIPC=false" | "RemoveIPC=0"));
    if uid < FIRST_USER {
        Finding::Well("a system user's shared memory stays".to_owned())
    } else if !has_logind || keeps || lingers {
        Finding::Well("shared memory stays after a logout".to_owned())
    } else {
        Finding::Doubtful {
            found: "shared memory of this user is removed at the last logout (RemoveIPC= of logind): every process would restart"
                .to_owned(),
            remedy: "loginctl enable-linger, or run as a service of a system user".to_owned(),
        }
    }
}

/// A computer without a battery for its clock starts at a fixed date. The file of this program cannot be newer than now.
#[expect(clippy::disallowed_methods, reason = "the wall clock itself is checked")]
pub(super) fn clock() -> Finding {
    let installed = std::env::current_exe().and_then(std::fs::metadata).and_then(|found| found.modified());
    judge_clock(SystemTime::now(), installed.unwrap_or(SystemTime::UNIX_EPOCH))
}

fn judge_clock(now: SystemTime, installed: SystemTime) -> Finding {
    if now >= installed {
        return Finding::Well("it is later than when stillmap was installed".to_owned());
    }
    Finding::Doubtful {
        found: "the clock is behind the date of the stillmap program: logs will be stamped with a wrong date".to_owned(),
        remedy: "timedatectl set-ntp true, or date -s".to_owned(),
    }
}

pub(super) fn disk(out: &Path, low_mb: f64) -> Finding {
    // The folder is created at the first run.
    let existing = out.ancestors().find(|folder| folder.is_dir()).unwrap_or(Path::new("."));
    match statvfs(existing) {
        Ok(found) => judge_disk(existing, found.f_bavail.saturating_mul(found.f_frsize) as f64 / 1e6, low_mb),
        Err(error) => Finding::Fault { found: format!("{}: {error}", existing.display()), remedy: "choose another folder: out".to_owned() },
    }
}

fn judge_disk(folder: &Path, free_mb: f64, low_mb: f64) -> Finding {
    let found = format!("{free_mb:.0} MB free for {}", folder.display());
    if free_mb >= low_mb {
        return Finding::Well(found);
    }
    Finding::Doubtful { found, remedy: format!("make room: below supervisor.disk_low_mb, which is {low_mb} MB, runs warn") }
}

/// Serial ports and video devices, and whether this user may open them.
pub(super) fn devices() -> Vec<(&'static str, Finding)> {
    let serial: Vec<PathBuf> = entries("/dev").into_iter().filter(|path| is_adapter(path)).collect();
    let cameras = camera::devices().unwrap_or_default();
    let mut findings = Vec::new();
    for (name, paths, group) in [("serial port", serial, "dialout"), ("camera", cameras, "video")] {
        if paths.is_empty() {
            findings.push((name, Finding::Well("none is plugged in".to_owned())));
        }
        findings
            .extend(paths.iter().map(|path| (name, judge_device(path, access(path, Access::READ_OK | Access::WRITE_OK).is_ok(), group))));
    }
    findings
}

fn entries(folder: &str) -> Vec<PathBuf> {
    let mut found: Vec<PathBuf> = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path()).collect();
    found.sort();
    found
}

/// A serial adapter. The built-in ports are always there, with nothing behind most of them.
fn is_adapter(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().as_encoded_bytes();
    [&b"ttyUSB"[..], b"ttyACM", b"pioneer"].iter().any(|start| name.starts_with(start))
}

fn judge_device(path: &Path, is_open: bool, group: &str) -> Finding {
    let path = path.display().to_string();
    if is_open {
        return Finding::Well(path);
    }
    let remedy = format!("sudo usermod -aG {group} $USER, then log in again; config/udev has rules for fixed names");
    Finding::Doubtful { found: format!("{path}: this user may not read and write it"), remedy }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    fn is_well(finding: &Finding) -> bool {
        matches!(finding, Finding::Well(_))
    }

    #[test]
    fn limits_are_faults_below_what_is_needed() {
        assert!(is_well(&judge_shared_memory(8, 8)) && matches!(judge_shared_memory(7, 8), Finding::Fault { .. }));
        assert!(is_well(&judge_open_files(Some(300), 300)) && is_well(&judge_open_files(None, 300)));
        assert!(matches!(judge_open_files(Some(299), 300), Finding::Fault { .. }));
        assert!(is_well(&judge_disk(Path::new("/"), 500.0, 500.0)) && !is_well(&judge_disk(Path::new("/"), 499.0, 500.0)));
    }

    #[test]
    fn a_logout_matters_to_users_who_do_not_linger() {
        assert!(!is_well(&judge_logout(1000, true, false, "#RemoveIPC=no\n")));
        assert!(is_well(&judge_logout(1000, true, false, "[Login]\nRemoveIPC=no\n")));
        assert!(is_well(&judge_logout(1000, true, true, "")) && is_well(&judge_logout(1000, false, false, "")));
        assert!(is_well(&judge_logout(999, true, false, "")));
    }

    #[test]
    fn a_clock_before_the_installation_is_doubtful() {
        let installed = SystemTime::UNIX_EPOCH + Duration::from_secs(1_000_000);
        assert!(is_well(&judge_clock(installed, installed)) && !is_well(&judge_clock(SystemTime::UNIX_EPOCH, installed)));
    }

    #[test]
    fn a_closed_device_names_its_group() {
        assert!(
            matches!(judge_device(Path::new("/dev/video0"), false, "video"), Finding::Doubtful { remedy, .. } if remedy.contains(" video "))
        );
        assert!(is_adapter(Path::new("/dev/ttyUSB0")) && !is_adapter(Path::new("/dev/ttyS0")));
    }
}
