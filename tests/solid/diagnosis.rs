//! What is wrong is said, and exit codes tell it to scripts.

use std::fs;
use std::path::Path;

use rustix::process::Signal;

use super::harness::replays::DRIVE;
use super::harness::{Bench, Run, signal, text};

/// A deployment of mapping and a foreign program.
fn deployment(bench: &Bench, name: &str, command: &[&str], more: &str) -> String {
    let mapping = "[[process]]\nname = \"mapping\"\nrun = \"mapping\"\n";
    let foreign = format!("[[process]]\nname = \"driver\"\ncommand = {command:?}\n");
    bench.write(&format!("{name}.toml"), &format!("name = {name:?}\n{mapping}{foreign}{more}")).to_str().unwrap().to_owned()
}

/// What a command says that refuses with this exit code, in one line.
#[track_caller]
fn refuses(bench: &Bench, arguments: &[&str], code: i32) -> String {
    let output = bench.output(arguments);
    let said = text(&output.stderr);
    assert_eq!((output.status.code(), said.lines().count()), (Some(code), 1), "{arguments:?}: {said}{}", text(&output.stdout));
    said
}

#[test]
fn a_missing_program_is_named_before_anything_starts() {
    let bench = Bench::new();
    for (program, words) in [
        ("/no/such/driver", "process driver: /no/such/driver: no such program\n"),
        ("no-such-driver", "process driver: no-such-driver: no such program in /"),
        ("/etc/passwd", "process driver: /etc/passwd: not a program that this user may start: "),
    ] {
        let settings = deployment(&bench, "missing", &[program], "");
        for command in ["check", "run"] {
            let said = refuses(&bench, &[command, &settings], 2);
            assert!(said.contains(words), "{said}");
        }
    }
    let script = bench.write("driver", "#!/no/such/python3\n");
    let mut mode = fs::metadata(&script).unwrap().permissions();
    std::os::unix::fs::PermissionsExt::set_mode(&mut mode, 0o755);
    fs::set_permissions(&script, mode).unwrap();
    let settings = deployment(&bench, "missing", &["./driver"], "");
    assert!(refuses(&bench, &["check", &settings], 2).contains("/driver: its interpreter /no/such/python3 does not exist"));
}

#[test]
fn check_looks_for_devices() {
    let bench = Bench::new();
    let kinds = ["mapping", "pioneer", "camera"].map(|kind| format!("[[process]]\nname = {kind:?}\nrun = {kind:?}\n")).concat();
    let settings = |port: &str, camera: &str| {
        let sections = format!("[pioneer]\nport = {port:?}\n[camera]\ndevice = {camera:?}\n");
        bench.write("devices.toml", &format!("name = \"devices\"\n{kinds}{sections}")).to_str().unwrap().to_owned()
    };
    let said = refuses(&bench, &["check", &settings("/dev/ttyNONE7", "/etc/passwd")], 2);
    assert!(said.contains("pioneer.port /dev/ttyNONE7: no such device: is the robot's cable plugged in?"), "{said}");
    assert!(said.contains("camera.device /etc/passwd: not a device"), "{said}");
    assert_eq!(bench.output(["check", &settings("/dev/null", "/dev/null")]).status.code(), Some(0));
}

#[test]
fn a_tilde_is_refused_where_no_shell_expands_it() {
    let bench = Bench::new();
    let out = deployment(&bench, "tilde", &["true"], "");
    let text = fs::read_to_string(&out).unwrap();
    let with = |from: &str, to: &str| bench.write("tilde.toml", &text.replacen(from, to, 1)).to_str().unwrap().to_owned();
    for (key, settings) in [
        ("out", with("name = \"tilde\"\n", "name = \"tilde\"\nout = \"~/maps\"\n")),
        ("process[1].command", with("[\"true\"]", "[\"~/driver\"]")),
    ] {
        let said = refuses(&bench, &["check", &settings], 2);
        assert!(said.contains(key) && said.contains("only a shell expands"), "{said}");
    }
    let said = refuses(&bench, &["replay", DRIVE.1.to_str().unwrap(), "--out=~/maps"], 2);
    assert!(said.contains("--out=~/maps"), "{said}");
    assert!(!bench.path("~").exists());
}

#[test]
fn exit_codes_of_status_tell_how_things_are() {
    let bench = Bench::new();
    let code = |arguments: &[&str]| bench.output(arguments).status.code();
    assert_eq!(code(&["status"]), Some(4));
    assert_eq!(code(&["status", "--json"]), Some(4));
    assert_eq!(code(&["status", "--deployment", "other"]), Some(4));
    assert_eq!(code(&["top"]), Some(4));
    assert_eq!(code(&["map"]), Some(4));
    let patience = "[supervisor]\nrestarts = 1\nbackoff_first_s = 0.01\nbackoff_last_s = 0.01\nstartup_deadline_s = 600\n";
    let settings = deployment(&bench, "well", &["sleep", "1000"], patience);
    let run = Run::start(bench.stillmap(["run", &settings]));
    bench.wait_for("mapping", "it runs", |it| it["state"] == "running");
    assert_eq!(code(&["status"]), Some(0));
    assert_eq!(code(&["status", "--deployment", "other"]), Some(4));
    // Its budget of restarts is one.
    for restarts in 0..2 {
        let driver = bench.wait_for("driver", "it is there", |it| it["pid"].is_u64() && it["restarts"] == restarts);
        super::harness::kill(driver["pid"].as_u64().unwrap());
    }
    bench.wait_for("driver", "it has failed", |it| it["state"] == "failed");
    assert_eq!(code(&["status"]), Some(3));
    assert_eq!(code(&["status", "--json"]), Some(3));
    // One that is stopped does not answer.
    signal(run.pid().into(), Signal::STOP);
    assert_eq!(code(&["status"]), Some(1));
    signal(run.pid().into(), Signal::CONT);
    signal(run.pid().into(), Signal::TERM);
    assert_eq!(run.end().status.code(), Some(3));
}

#[test]
fn a_deployment_elsewhere_is_hinted_at() {
    let (bench, elsewhere) = (Bench::new(), Bench::new());
    let settings = deployment(&elsewhere, "hidden", &["sleep", "1000"], "");
    let run = Run::start(elsewhere.stillmap(["run", &settings]));
    elsewhere.wait_for("mapping", "it runs", |it| it["state"] == "running");
    let said = text(&bench.output(["status"]).stdout);
    assert!(said.starts_with("no deployment of user ") && said.contains("another STILLMAP_RUNTIME_DIR"), "{said}");
    signal(run.pid().into(), Signal::TERM);
    drop(run.end());
}

#[test]
fn log_info_tells_damage_by_its_exit_code() {
    let bench = Bench::new();
    let whole = fs::read(&DRIVE.1).unwrap();
    let code = |name: &str, bytes: &[u8]| {
        let log = bench.path(name);
        fs::write(&log, bytes).unwrap();
        bench.output([Path::new("log"), Path::new("info"), &log]).status.code()
    };
    assert_eq!(code("whole.mcap", &whole), Some(0));
    assert_eq!(code("cut.mcap", &whole[..whole.len() / 2]), Some(3));
    let mut damaged = whole.clone();
    let middle = damaged.len() / 2;
    damaged[middle..middle + 64].fill(0xff);
    assert_eq!(code("damaged.mcap", &damaged), Some(3));
}
