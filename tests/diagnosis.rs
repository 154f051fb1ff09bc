//! Mistakes are named in one line, and exit codes report them to scripts.

use std::fs;
use std::path::Path;

use messages::ProcessState;
use rustix::process::Signal;

use crate::harness::processes::{kill, resume, signal};
use crate::harness::replay::DRIVE;
use crate::harness::{Deployment, Sandbox, is_running};

/// A deployment of mapping and a foreign program that may run without end.
fn deployment(name: &str, command: &[&str]) -> Deployment {
    let driver = toml::Table::from_iter([("name".to_owned(), "driver".into()), ("command".to_owned(), command.to_vec().into())]);
    let mapping = toml::toml! { name = "mapping" run = "mapping" };
    Deployment::new(name, &[]).set("process", [mapping, driver])
}

/// The line of a command that refuses with this exit code.
#[track_caller]
fn refused_line(sandbox: &Sandbox, arguments: &[&str], code: i32) -> String {
    let ended = sandbox.output(arguments);
    ended.assert_code(code);
    assert_eq!(ended.stderr.lines().count(), 1, "{arguments:?}: {}", ended.stderr);
    ended.stderr
}

#[test]
fn a_missing_program_is_named_before_anything_starts() {
    let sandbox = Sandbox::new();
    let write = |deployment: Deployment| deployment.write(&sandbox).to_str().unwrap().to_owned();
    for (program, words) in [
        ("/no/such/driver", "process driver: /no/such/driver: no such program\n"),
        ("no-such-driver", "process driver: no-such-driver: no such program in /"),
        ("/etc/passwd", "process driver: /etc/passwd: not a program that this user may start: "),
    ] {
        let settings = write(deployment("missing", &[program]));
        for command in ["check", "run"] {
            let said = refused_line(&sandbox, &[command, &settings], 2);
            assert!(said.contains(words), "{said}");
        }
    }
    let script = sandbox.write("driver", "#!/no/such/python3\n");
    let mut mode = fs::metadata(&script).unwrap().permissions();
    std::os::unix::fs::PermissionsExt::set_mode(&mut mode, 0o755);
    fs::set_permissions(&script, mode).unwrap();
    let settings = write(deployment("missing", &["./driver"]));
    assert!(refused_line(&sandbox, &["check", &settings], 2).contains("/driver: its interpreter /no/such/python3 does not exist"));
}

#[test]
fn check_refuses_devices_that_are_missing() {
    let sandbox = Sandbox::new();
    let settings = |port: &str, camera: &str| {
        let devices = Deployment::new("devices", &["mapping", "pioneer", "camera"]).set("pioneer.port", port);
        devices.set("camera.device", camera).write(&sandbox).to_str().unwrap().to_owned()
    };
    let said = refused_line(&sandbox, &["check", &settings("/dev/ttyNONE7", "/etc/passwd")], 2);
    assert!(said.contains("pioneer.port /dev/ttyNONE7: no such device: is the robot's cable plugged in?"), "{said}");
    assert!(said.contains("camera.device /etc/passwd: not a device"), "{said}");
    sandbox.output(["check", &settings("/dev/null", "/dev/null")]).assert_code(0);
}

#[test]
fn a_tilde_is_refused_where_no_shell_expands_it() {
    let sandbox = Sandbox::new();
    for (key, tilde) in
        [("out", deployment("tilde", &["true"]).set("out", "~/maps")), ("process[1].command", deployment("tilde", &["~/driver"]))]
    {
        let settings = tilde.write(&sandbox).to_str().unwrap().to_owned();
        let said = refused_line(&sandbox, &["check", &settings], 2);
        assert!(said.contains(key) && said.contains("only a shell expands"), "{said}");
    }
    let said = refused_line(&sandbox, &["replay", DRIVE.log(&sandbox).to_str().unwrap(), "--out=~/maps"], 2);
    assert!(said.contains("--out=~/maps"), "{said}");
    assert!(!sandbox.path("~").exists());
}

#[test]
fn the_exit_code_of_status_reports_the_state() {
    let sandbox = Sandbox::new();
    let code = |arguments: &[&str]| sandbox.output(arguments).code;
    assert_eq!(code(&["status"]), Some(4));
    assert_eq!(code(&["status", "--json"]), Some(4));
    assert_eq!(code(&["status", "--deployment", "other"]), Some(4));
    assert_eq!(code(&["top"]), Some(4));
    assert_eq!(code(&["map"]), Some(4));
    let well = deployment("well", &["sleep", "1000"]).set("supervisor.restarts", 1).set("supervisor.startup_deadline_s", 600);
    let well = well.set("supervisor.backoff_first_s", 0.01).set("supervisor.backoff_last_s", 0.01);
    let mut run = sandbox.run(&well, &[]);
    run.wait_for("mapping", "it runs", is_running);
    assert_eq!(code(&["status"]), Some(0));
    assert_eq!(code(&["status", "--deployment", "other"]), Some(4));
    // Its budget of restarts is one.
    for restarts in 0..2 {
        kill(run.wait_for("driver", "it is started", |it| it.pid != 0 && it.restarts == restarts).pid);
    }
    run.wait_for("driver", "it has failed", |it| it.state == ProcessState::Failed as u32);
    assert_eq!(code(&["status"]), Some(3));
    assert_eq!(code(&["status", "--json"]), Some(3));
    // A supervisor that is stopped does not answer.
    crate::harness::processes::stop(run.pid());
    assert_eq!(code(&["status"]), Some(1));
    resume(run.pid());
    signal(run.pid(), Signal::TERM);
    run.end().assert_code(3);
}

#[test]
fn status_hints_at_a_deployment_in_another_runtime_folder() {
    let (sandbox, elsewhere) = (Sandbox::new(), Sandbox::new());
    let mut run = elsewhere.run(&deployment("hidden", &["sleep", "1000"]), &[]);
    run.wait_for("mapping", "it runs", is_running);
    let said = sandbox.output(["status"]).stdout;
    assert!(said.starts_with("no deployment of user ") && said.contains("another STILLMAP_RUNTIME_DIR"), "{said}");
    signal(run.pid(), Signal::TERM);
    run.end();
}

#[test]
fn the_exit_code_of_log_info_reports_damage() {
    let sandbox = Sandbox::new();
    let intact = fs::read(DRIVE.log(&sandbox)).unwrap();
    let code = |name: &str, bytes: &[u8]| {
        let log = sandbox.path(name);
        fs::write(&log, bytes).unwrap();
        sandbox.output([Path::new("log"), Path::new("info"), &log]).code
    };
    assert_eq!(code("intact.mcap", &intact), Some(0));
    assert_eq!(code("cut.mcap", &intact[..intact.len() / 2]), Some(3));
    let mut damaged = intact.clone();
    let middle = damaged.len() / 2;
    damaged[middle..middle + 64].fill(0xff);
    assert_eq!(code("damaged.mcap", &damaged), Some(3));
}
