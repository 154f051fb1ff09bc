//! Every kind of problem, with the one line that tells it.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

use stillmap_settings::{DocumentError, Settings};

/// A deployment to which a test adds what it wants to see refused: 7 lines.
const BASE: &str = r#"name = "test"
[[process]]
name = "driver"
run = "pioneer"
[[process]]
name = "mapping"
run = "mapping"
"#;

#[track_caller]
fn refused(text: &str) -> String {
    let error: DocumentError = Settings::parse("demo.toml", text).expect_err("the text has a problem");
    let line = error.to_string();
    assert!(!line.contains('\n'), "{line}");
    line
}

/// `added` after the base, which ends with line 7, is refused with exactly this line.
#[track_caller]
fn check(added: &str, expected: &str) {
    assert_eq!(refused(&format!("{BASE}{added}")), expected);
}

#[track_caller]
fn check_whole(text: &str, expected: &str) {
    assert_eq!(refused(text), expected);
}

#[test]
fn numbers_out_of_range() {
    check("[mapping]\n\ncell_m = -0.05\n", "demo.toml:10: mapping.cell_m = -0.05: expected 0.005 to 1 m");
    check("[mapping]\ncell_m = nan", "demo.toml:9: mapping.cell_m = nan: expected 0.005 to 1 m");
    check("[mapping]\ncell_m = inf", "demo.toml:9: mapping.cell_m = inf: expected 0.005 to 1 m");
    check("[mapping]\ncell_m = 1e999", "demo.toml:9: mapping.cell_m = 1e999: expected 0.005 to 1 m");
    check("[mapping]\ncell_m = 2", "demo.toml:9: mapping.cell_m = 2: expected 0.005 to 1 m");
    check("mapping.k_o = 0.5", "demo.toml:8: process[1].mapping: unknown key, expected one of name, run, command, ends_run, publishes");
    check("[mapping]\nk_o = 1.0", "demo.toml:9: mapping.k_o = 1.0: expected 0.55 to 0.99");
    check("[simulator]\nseed = -1", "demo.toml:9: simulator.seed = -1: expected a whole number, 0 to 4294967295");
    check("[simulator]\nseed = 1.5", "demo.toml:9: simulator.seed = 1.5: expected a whole number, 0 to 4294967295");
    check("[simulator]\nseed = 0x1_0000_0000", "demo.toml:9: simulator.seed = 0x1_0000_0000: expected a whole number, 0 to 4294967295");
    check(
        "[playback]\nwindow = 99999999999999999999",
        "demo.toml:9: playback.window = 99999999999999999999: expected a whole number, 1 to 256 scans",
    );
    check("[robot]\nodometry_modulus = 1000", "demo.toml:9: robot.odometry_modulus = 1000: expected one of 4096, 32768, 65536");
    check("[pioneer]\nbauds = [\n9600,\n1200]", "demo.toml:11: pioneer.bauds[1] = 1200: expected one of 9600, 19200, 38400, 57600, 115200");
    check(
        "[[robot.sonar]]\nx_m = 0.1\ny_m = 0\nheading_deg = 270",
        "demo.toml:11: robot.sonar[0].heading_deg = 270: expected -180 to 180 deg",
    );
}

#[test]
fn values_of_another_type() {
    check("[mapping]\ncell_m = \"5 cm\"", "demo.toml:9: mapping.cell_m = \"5 cm\": expected 0.005 to 1 m");
    check("[mapping]\ncell_m = 2026-11-22", "demo.toml:9: mapping.cell_m = 2026-11-22: expected 0.005 to 1 m");
    check("[mapping]\ncell_m = { a = 1 }", "demo.toml:9: mapping.cell_m: expected 0.005 to 1 m");
    check("[mapping]\nfades = \"no\"", "demo.toml:9: mapping.fades = \"no\": expected true or false");
    check("[robot]\nmodel = 3", "demo.toml:9: robot.model = 3: expected a string");
    check(
        "[robot]\nmodel = \"p3dy\"",
        "demo.toml:9: robot.model = \"p3dy\": expected a type of robot, as `stillmap pioneer probe` tells it: \"pioneer-1\", \"p3-dx\", \"p2at\" … (SETTINGS.md lists them)",
    );
    check("[recorder]\nfile = 7", "demo.toml:9: recorder.file = 7: expected a string");
    check("[pioneer]\nbauds = 9600", "demo.toml:9: pioneer.bauds = 9600: expected a list");
    check_whole("name = \"test\"\nprocess = 4\nmapping = 3", "demo.toml:2: process = 4: expected a list");
    check_whole("name = \"test\"\nmapping = 3", "demo.toml:2: mapping = 3: expected a table");
    check_whole("name = \"test\"\nprocess = [4]", "demo.toml:2: process[0] = 4: expected a table");
}

#[test]
fn texts_of_another_form() {
    check_whole("name = \"Demo!\"", "demo.toml:1: name = \"Demo!\": expected 1 to 24 of a-z, 0-9 and -");
    check_whole("name = \"a/../b\"", "demo.toml:1: name = \"a/../b\": expected 1 to 24 of a-z, 0-9 and -");
    check_whole("name = \"\"", "demo.toml:1: name = \"\": expected 1 to 24 of a-z, 0-9 and -");
    check(
        "[recorder]\nfile = \"../x\"",
        "demo.toml:9: recorder.file = \"../x\": expected the name of a file, without a folder, at most 200 bytes",
    );
    check(
        "[recorder]\nfile = \"..\"",
        "demo.toml:9: recorder.file = \"..\": expected the name of a file, without a folder, at most 200 bytes",
    );
    check(
        "[pioneer]\nport = \"\"",
        "demo.toml:9: pioneer.port = \"\": expected \"simulator\", the path of a serial device, or tcp://HOST:PORT",
    );
    check(
        "[pioneer]\nport = \"tcp://robot:0\"",
        "demo.toml:9: pioneer.port = \"tcp://robot:0\": expected tcp://HOST:PORT, an IPv6 address in [ ]",
    );
    check("[simulator]\nworld = \"\"", "demo.toml:9: simulator.world = \"\": expected a path");
    check("[playback]\nlog = \"a\\u0000b\"", "demo.toml:9: playback.log = \"a\\u0000b\": expected a path");
}

#[test]
fn unknown_and_missing_keys() {
    check(
        "[recorder]\nflush = 1.0",
        "demo.toml:9: recorder.flush: unknown key, expected one of flush_s, file, pictures, keep_mb, leave_free_mb",
    );
    check(
        "[mapping]\ncel_m = 1",
        "demo.toml:9: mapping.cel_m: unknown key, expected one of cell_m, k_o, l_max, fades, tuning, sigma_r_m, horizon_s, free_fade_m, lonely_below, half_beam_deg, no_echo_free_m, occupied_fade_m, keep_unfiltered",
    );
    let section = refused(&format!("{BASE}[lidar]\n"));
    assert!(section.starts_with("demo.toml:8: lidar: unknown key, expected one of ") && section.contains("mapping"), "{section}");
    check("[[robot.sonar]]\nx_m = 0.1\n", "demo.toml:8: robot.sonar[0].y_m: missing, expected this key");
    check("[[process]]\nrun = \"recorder\"", "demo.toml:8: process[2].name: missing, expected this key");
    check_whole("", "demo.toml:1: name: missing, expected this key");
    check_whole("\n\nname = \"x\"", "demo.toml:1: process: missing, expected this key");
}

#[test]
fn tables_of_the_tuning() {
    check("[mapping.tuning]\ngain = [[0, 0, 0],\n[0, 0, 2],\n[0, 0, 0]]", "demo.toml:10: mapping.tuning.gain[1][2] = 2: expected 0 to 1");
    check("[mapping.tuning]\nk_e = [[0.3, 0.3, 0.3], [0.3, 0.3]]", "demo.toml:9: mapping.tuning.k_e[1] = [0.3, 0.3]: expected a list of 3");
    check(
        "[mapping.tuning]\nk_e = [[0.3, 0.3, 0.3, 0.3]]",
        "demo.toml:9: mapping.tuning.k_e[0] = [0.3, 0.3, 0.3, 0.3]: expected a list of 3",
    );
    check(
        "[mapping.tuning]\np_arc = [0.5, 0.5, 0.9]",
        "demo.toml:9: mapping.tuning.p_arc = [0.5, 0.5, 0.9]: expected three ascending numbers from 0 to 1",
    );
    check(
        "[mapping.tuning]\np_free = [0.5, 0.7, 1.1]",
        "demo.toml:9: mapping.tuning.p_free = [0.5, 0.7, 1.1]: expected three ascending numbers from 0 to 1",
    );
    check("[mapping.tuning]\np_free = [0.5, 0.7]", "demo.toml:9: mapping.tuning.p_free = [0.5, 0.7]: expected a list of 3");
}

#[test]
fn who_may_look() {
    check(
        "[viewer]\naddress = \"robot\"",
        "demo.toml:9: viewer.address = \"robot\": expected an IP address, such as \"127.0.0.1\" or \"0.0.0.0\"",
    );
    check("[viewer]\naddress = \"0.0.0.0\"", "demo.toml:9: viewer.address = \"0.0.0.0\": expected 127.0.0.1 or ::1, or else a token");
    check("[viewer]\ntoken = \"short\"", "demo.toml:9: viewer.token = \"short\": expected 16 to 128 of a-z, A-Z, 0-9, - and _");
    check("[viewer]\nport = 80", "demo.toml:9: viewer.port = 80: expected a whole number, 1024 to 65526");
}

#[test]
fn sections_that_do_not_go_together() {
    check(
        "[[process]]\nname = \"mapping\"\nrun = \"recorder\"",
        "demo.toml:9: process[2].name = \"mapping\": expected a name that no other process has",
    );
    check(
        "[[process]]\nname = \"map\"\nrun = \"mapping\"",
        "demo.toml:10: process[2].run = \"mapping\": expected each built-in process once",
    );
    check("[[process]]\nname = \"x\"", "demo.toml:8: process[2]: expected exactly one of run and command");
    check(
        "[[process]]\nname = \"x\"\nrun = \"recorder\"\ncommand = [\"x\"]",
        "demo.toml:8: process[2]: expected exactly one of run and command",
    );
    check("[[process]]\nname = \"x\"\ncommand = []", "demo.toml:10: process[2].command = []: expected a program and its arguments");
    check("[[process]]\nname = \"x\"\ncommand = [\"\"]", "demo.toml:10: process[2].command = [\"\"]: expected a program and its arguments");
    check(
        "[[process]]\nname = \"log\"\nrun = \"playback\"",
        "demo.toml:10: process[2].run = \"playback\": expected one source of scans, either \"pioneer\" or \"playback\"",
    );
    check(
        "[pioneer]\nport = \"simulator\"",
        "demo.toml:9: pioneer.port = \"simulator\": expected a serial device or tcp://HOST:PORT, or else a process with run = \"simulator\"",
    );
    check("[pioneer]\nbauds = []", "demo.toml:9: pioneer.bauds = []: expected at least one speed, and each once");
    check("[pioneer]\nbauds = [9600, 9600]", "demo.toml:9: pioneer.bauds = [9600, 9600]: expected at least one speed, and each once");
    check(
        "[supervisor]\nbackoff_first_s = 6",
        "demo.toml:9: supervisor.backoff_first_s = 6: expected at most backoff_last_s, which is 5 s",
    );
    // The key that is at fault keeps its default: the line is its table's.
    check(
        "\n[supervisor]\nbackoff_last_s = 0.01",
        "demo.toml:9: supervisor.backoff_first_s: expected at most backoff_last_s, which is 0.01 s",
    );
    check_whole("name = \"x\"\nprocess = []", "demo.toml:2: process = []: expected 1 to 23 processes, found 0");
    check_whole(
        "name = \"x\"\n[[process]]\nname = \"m\"\nrun = \"mapping\"",
        "demo.toml:2: process: expected a source of scans: run = \"pioneer\" or \"playback\", or a command",
    );
    check_whole(
        &BASE.replace("name = \"test\"\n", "name = \"test\"\npace = \"lockstep\"\n"),
        "demo.toml:2: pace = \"lockstep\": expected \"live\", because a robot does not wait",
    );
    let sonars = "[[robot.sonar]]\nx_m = 0\ny_m = 0\nheading_deg = 0\n".repeat(33);
    check(&sonars, "demo.toml:8: robot.sonar: expected at most 32 sonars, found 33");
    let many: String = (0..22).map(|n| format!("[[process]]\nname = \"p{n}\"\ncommand = [\"x\"]\n")).collect();
    check(&many, "demo.toml:2: process: expected 1 to 23 processes, found 24");
}

#[test]
fn text_that_is_no_toml() {
    check_whole("name = live", "demo.toml:1:8: found `live`: string values must be quoted, expected literal string");
    check_whole("name = \"x\"\n[mapping\n", "demo.toml:2:9: found the end of the line: unclosed table, expected `]`");
    check_whole("name = \"x\n", "demo.toml:1:10: found the end of the line: invalid basic string, expected `\"`");
    check_whole("name = \"x\"\nname = \"y\"", "demo.toml:2:1: found `name`: duplicate key");
    check_whole("[a]\nb = 1\n[a]", "demo.toml:3:2: found `a`: duplicate key");
    check_whole("name\n", "demo.toml:1:5: found the end of the line: key with no value, expected `=`");
    check_whole("= 3", "demo.toml:1:1: found `=`: unquoted keys cannot be empty, expected letters, numbers, `-`, `_`");
    check_whole("a = [1, 2", "demo.toml:1:10: found the end of the file: unclosed array, expected `]`");
    check_whole("\u{feff}name = 1 2", "demo.toml:1:9: found `1 2`: string values must be quoted, expected literal string");
    check_whole("é = 3", "demo.toml:1:1: found `é`: invalid unquoted key, expected letters, numbers, `-`, `_`");
    check_whole("\0", "demo.toml:1:2: found the end of the file: key with no value, expected `=`");
    check_whole(
        "name = \"\u{7}\"",
        "demo.toml:1:9: found `\\u{7}`: invalid basic string, expected non-double-quote visible characters, `\\`",
    );
    let deep = "[".repeat(1000);
    check_whole(&format!("a = {deep}"), "demo.toml:1:85: found `[`: cannot recurse further; max recursion depth met");
}

#[test]
fn errors_never_carry_control_characters() {
    let line = refused("\"\\u001b[31m\\n\" = 3");
    assert!(line.starts_with("demo.toml:1: \\u{1b}[31m: unknown key"), "{line}");
}

#[test]
fn verdicts_and_camera_motion_have_one_source() {
    const FTI: &str = "[[process]]\nname = \"fti\"\nrun = \"fti\"\n";
    const STD: &str = "[[process]]\nname = \"std\"\nrun = \"std\"\n";
    let other = |publishes: &str| format!("[[process]]\nname = \"other\"\ncommand = [\"other\"]\npublishes = [{publishes:?}]\n");
    check(FTI, "demo.toml:2: process: expected a process with run = \"std\" beside \"fti\", which waits for its answers");
    check(
        &format!("{FTI}{STD}{}", other("map/verdict")),
        "demo.toml:2: process: expected one source of verdicts, either run = \"fti\" or a command that publishes \"map/verdict\"",
    );
    check(
        "[[process]]\nname = \"x\"\nrun = \"std\"\npublishes = [\"map/verdict\"]",
        "demo.toml:8: process[2]: expected no publishes beside run: a built-in process publishes what it always does",
    );
    let expects = |added: &str| {
        let settings = Settings::parse("demo.toml", &format!("{BASE}{added}")).unwrap();
        (settings.expects_verdicts(), settings.expects_camera_motion())
    };
    assert_eq!(expects(""), (false, false));
    assert_eq!(expects(&format!("{FTI}{STD}")), (true, false));
    assert_eq!(expects(&other("map/verdict")), (true, false));
    assert_eq!(expects(&other("motion/camera")), (false, true));
    assert_eq!(
        expects(&format!("{FTI}{STD}[[process]]\nname = \"sbs\"\nrun = \"sbs\"\n[[process]]\nname = \"camera\"\nrun = \"camera\"\n")),
        (true, true)
    );
}

#[test]
fn keys_without_effect_are_refused() {
    check("[sbs]\nk = 2.0", "demo.toml:8: sbs: expected no [sbs], or else a process with run = \"sbs\"");
    check("[playback]\nwindow = 3", "demo.toml:8: playback: expected no [playback], or else a process with run = \"playback\"");
    check(
        "[mapping]\nfades = false\nfree_fade_m = 2.0",
        "demo.toml:10: mapping.free_fade_m = 2.0: expected no such key, or else mapping.fades = true",
    );
    let filter = "[[process]]\nname = \"fti\"\nrun = \"fti\"\n[[process]]\nname = \"std\"\nrun = \"std\"\n";
    check(
        &format!("{filter}[fti.paper]\ncorrespond_m = 1.0"),
        "demo.toml:14: fti.paper: expected no [fti.paper], or else fti.method = \"paper\"",
    );
    check(
        &format!("{filter}[fti]\nmethod = \"paper\"\nprior_log_odds = 1.0"),
        "demo.toml:16: fti.prior_log_odds = 1.0: expected no such key, or else fti.method = \"likelihood\"",
    );
    Settings::parse("demo.toml", &format!("{BASE}{filter}[fti]\nmethod = \"paper\"\n[fti.paper]\ncorrespond_m = 1.0")).unwrap();
}

#[test]
fn recorded_settings_lose_unknown_keys_by_name() {
    let text = format!("{BASE}[lidar]\nrate_hz = 5\n[mapping]\ncell_m = 0.1\nexpect_verdicts = true\n[sbs]\nk = 2.0\n");
    let (settings, mut left_out) = Settings::parse_recorded("drive.mcap", &text).unwrap();
    left_out.sort();
    assert_eq!(left_out, ["lidar", "mapping.expect_verdicts"]);
    assert_eq!((settings.mapping.cell_m.get(), settings.sbs.k.get()), (0.1, 2.0));
    let error = Settings::parse_recorded("drive.mcap", &text.replace("0.1", "-1")).unwrap_err();
    assert!(error.to_string().contains("mapping.cell_m = -1"), "{error}");
}

#[test]
fn written_settings_hold_only_what_differs_from_the_defaults() {
    let text = format!("{BASE}[mapping]\ncell_m = 0.1\nl_max = 2.0\n");
    let settings = Settings::parse("demo.toml", &text).unwrap();
    let written = settings.to_toml().unwrap();
    assert!(written.contains("cell_m = 0.1") && !written.contains("l_max") && !written.contains("[fti"), "{written}");
    assert_eq!(Settings::parse_recorded("x", &written).unwrap(), (settings, Vec::new()));
}

#[test]
fn pictures_come_from_one_place_and_go_somewhere() {
    let process = |kind: &str| format!("[[process]]\nname = {kind:?}\nrun = {kind:?}\n");
    let deployment = |kinds: &[&str], provides: &str| {
        let processes: String = kinds.iter().map(|kind| process(kind)).collect();
        let camera = format!("[simulator.camera]\nprovides = {provides:?}\n");
        format!("name = \"x\"\n{processes}{}", if kinds.contains(&"simulator") { &camera } else { "" })
    };
    let check = |kinds: &[&str], provides: &str, expected: &str| assert_eq!(refused(&deployment(kinds, provides)), expected);
    check(
        &["mapping", "simulator", "pioneer", "camera"],
        "pictures",
        "demo.toml:15: simulator.camera.provides = \"pictures\": expected \"off\", since a process runs \"camera\", which gives the pictures",
    );
    let no_pictures = "demo.toml:2: process: expected a source of pictures for \"sbs\": run = \"camera\", or the simulator with \
                       camera.provides = \"pictures\"";
    check(&["mapping", "simulator", "pioneer", "sbs"], "off", no_pictures);
    check(&["mapping", "pioneer", "sbs"], "off", no_pictures);
    check(
        &["mapping", "playback", "camera"],
        "off",
        "demo.toml:2: process: expected one source of pictures, either \"camera\" or \"playback\"",
    );
    check(
        &["mapping", "playback", "simulator"],
        "off",
        "demo.toml:2: process: expected one world, either that of \"simulator\" or that of \"playback\"",
    );
    for (kinds, provides) in [
        (&["mapping", "simulator", "pioneer", "sbs"][..], "pictures"),
        (&["mapping", "simulator", "pioneer", "sbs", "camera"], "off"),
        (&["mapping", "pioneer", "sbs", "camera"], "off"),
        (&["mapping", "playback", "sbs"], "off"),
        (&["mapping", "simulator", "pioneer"], "off"),
    ] {
        let parsed = Settings::parse("demo.toml", &deployment(kinds, provides));
        assert!(parsed.is_ok(), "{kinds:?}: {parsed:?}");
    }
}

#[test]
fn tables_of_the_paper_are_whole_and_of_known_sets() {
    const FILTER: &str = "[[process]]\nname = \"fti\"\nrun = \"fti\"\n[[process]]\nname = \"std\"\nrun = \"std\"\n";
    let row = "[\"VS\", \"S\", \"M\", \"L\", \"VL\"]";
    let rows = |last: &str| format!("{FILTER}[fti]\nmethod = \"paper\"\n[fti.paper.tables]\nsize = [{row}, {row}, {row}, {row}, {last}]\n");
    Settings::parse("demo.toml", &format!("{BASE}{}", rows(row))).unwrap();
    for last in ["[\"VS\", \"S\", \"M\", \"L\"]", "[\"VS\", \"S\", \"M\", \"L\", \"HUGE\"]"] {
        let line = refused(&format!("{BASE}{}", rows(last)));
        assert!(line.starts_with("demo.toml:17: fti.paper.tables.size[4]"), "{line}");
    }
}

#[test]
fn a_span_of_a_log_ends_behind_its_start() {
    let playback =
        "name = \"x\"\nprocess = [{ name = \"p\", run = \"playback\" }, { name = \"mapping\", run = \"mapping\" }]\n[playback]\n";
    let expected = "demo.toml:5: playback.to_s = 1.5: expected a time that is not before playback.from_s";
    assert_eq!(refused(&format!("{playback}from_s = 2\nto_s = 1.5")), expected);
    assert!(Settings::parse("demo.toml", &format!("{playback}from_s = 2\nto_s = 2")).is_ok());
}
