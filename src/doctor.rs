//! `stillmap doctor`: whether this computer can run a deployment, and what to do if not.

mod checks;
mod finding;
mod orphans;

use crate::check::{self, missing_devices, missing_programs};
use crate::{built_in, exit, output};
use checks::{clock, devices, disk, kernel, logout, open_files, runtime_folder, shared_memory};
use clap::Args;
use finding::Finding;
use messages::printable;
use orphans::orphans;
use settings::Settings;
use std::path::PathBuf;

/// Arguments of `stillmap doctor`.
#[derive(Debug, Args)]
pub(crate) struct DoctorArgs {
    /// The settings file of the deployment that is to run. Without it, the needs of the demo are checked, and all devices
    #[arg(value_name = "FILE")]
    settings: Option<PathBuf>,
}

/// Prints what is found; the exit code.
pub(crate) fn doctor(args: &DoctorArgs) -> anyhow::Result<u8> {
    let settings = match &args.settings {
        Some(path) => check::read(path)?,
        None => Settings::parse("demo.toml", built_in::DEMO)?,
    };
    let out = if args.settings.is_some() { settings.out.clone() } else { PathBuf::from(".") };
    let mut findings = vec![
        ("kernel", kernel()),
        ("shared memory", shared_memory(supervisor::needed_memory(&settings))),
        ("dead deployments", orphans()),
        ("open files", open_files(settings.process.len())),
        ("runtime folder", runtime_folder()),
        ("logout", logout()),
        ("clock", clock()),
        ("disk", disk(&out, settings.supervisor.disk_low_mb.get())),
    ];
    if args.settings.is_some() {
        let missing = missing_programs(&settings).into_iter().chain(missing_devices(&settings));
        findings.extend(missing.map(|found| ("settings", Finding::Fault { found, remedy: "mend it, or change the file".to_owned() })));
    } else {
        findings.extend(devices());
    }
    let lines: String = findings.iter().map(|(name, finding)| line(name, finding)).collect();
    output::write(&lines)?;
    let has_fault = findings.iter().any(|(_, finding)| matches!(finding, Finding::Fault { .. }));
    Ok(if has_fault { exit::INCOMPLETE } else { exit::SUCCESS })
}

fn line(name: &str, finding: &Finding) -> String {
    match finding {
        Finding::Well(found) => format!("ok     {name}: {}\n", printable(found)),
        Finding::Doubtful { found, remedy } => format!("doubt  {name}: {}\n       -> {}\n", printable(found), printable(remedy)),
        Finding::Fault { found, remedy } => format!("FAULT  {name}: {}\n       -> {}\n", printable(found), printable(remedy)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_is_printed_with_its_remedy() {
        let fault = Finding::Fault { found: "3 MB free".to_owned(), remedy: "make room".to_owned() };
        assert_eq!(line("disk", &fault), "FAULT  disk: 3 MB free\n       -> make room\n");
        assert_eq!(line("disk", &Finding::Well("9 GB free".to_owned())), "ok     disk: 9 GB free\n");
    }
}
