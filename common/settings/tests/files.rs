//! Files in, effective settings out.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

use std::path::{Path, PathBuf};

use stillmap_settings::{BuiltIn, CellSize, DocumentError, Pace, Port, Process, Program, Settings};

fn config(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config").join(file)
}

#[test]
fn every_file_in_config_is_a_deployment() {
    let mut files = 0;
    for entry in std::fs::read_dir(config("")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|extension| extension == "toml") {
            Settings::read(&path).unwrap_or_else(|error| panic!("{error}"));
            files += 1;
        }
    }
    assert!(files >= 2, "{files} files");
}

#[test]
fn the_demo_starts_listeners_before_speakers() {
    let demo = Settings::read(&config("demo.toml")).unwrap();
    let order: Vec<&str> = demo.process.iter().map(|process| process.name.as_str()).collect();
    assert_eq!(order, ["recorder", "mapping", "fti", "std", "sbs", "viewer", "simulator", "pioneer"]);
    assert_eq!(demo.pioneer.port, Port::Simulator);
    assert_eq!(demo.pace, Pace::Live);
    let ends: Vec<bool> = demo.process.iter().map(|process| process.ends_run).collect();
    assert_eq!(ends, [false, false, false, false, false, false, true, false]);
}

#[test]
fn defaults_are_those_of_the_algorithm() {
    let mapping = Settings::default().mapping;
    let tuning = &mapping.tuning;
    assert_eq!((mapping.cell_m.get(), mapping.half_beam_deg.get(), mapping.k_o.get()), (0.05, 12.5, 0.8));
    assert_eq!((mapping.sigma_r_m.get(), mapping.l_max.get(), mapping.horizon_s.get()), (0.06, 2.0, 3.0));
    assert_eq!((mapping.no_echo_free_m.get(), mapping.occupied_fade_m.get(), mapping.free_fade_m.get()), (1.2, 2.0, 1.6));
    assert!(mapping.fades && tuning.enabled && !mapping.keep_unfiltered);
    assert_eq!((tuning.p_arc.get(), tuning.p_free.get()), ([0.5, 0.7, 0.9], [0.5, 0.7, 0.9]));
    assert_eq!(tuning.gain.map(|row| row.map(|gain| gain.get())), [[0.0; 3], [0.5; 3], [1.0; 3]]);
    assert_eq!(tuning.sigma_theta_deg.map(|row| row.map(|width| width.get())), [[30.0; 3], [24.0; 3], [16.0; 3]]);
    assert_eq!(tuning.k_e.map(|row| row.map(|peak| peak.get())), [[0.35, 0.40, 0.43]; 3]);
}

#[test]
fn a_key_that_is_left_out_keeps_its_default() {
    let settings = Settings::parse(
        "x",
        "name = \"x\"\nprocess = [{ name = \"p\", run = \"playback\" }, { name = \"mapping\", run = \"mapping\" }]\n[mapping]\nl_max = 3",
    )
    .unwrap();
    let mut expected = Settings {
        process: vec![
            Process { name: "p".to_owned().try_into().unwrap(), ..Process::built_in(BuiltIn::Playback) },
            Process::built_in(BuiltIn::Mapping),
        ],
        ..Settings::default()
    };
    expected.name = "x".to_owned().try_into().unwrap();
    expected.mapping.l_max = 3.0.try_into().unwrap();
    assert_eq!(settings, expected);
}

#[test]
fn names_in_the_code_have_the_form_of_names() {
    let written = Settings {
        process: [BuiltIn::Recorder, BuiltIn::Mapping, BuiltIn::Playback].map(Process::built_in).to_vec(),
        ..Settings::default()
    };
    assert_eq!(Settings::parse("written", &written.to_toml().unwrap()).unwrap(), written);
    let written = Settings { process: [BuiltIn::Simulator, BuiltIn::Pioneer].map(Process::built_in).to_vec(), ..Settings::default() };
    assert_eq!(Settings::parse("written", &written.to_toml().unwrap()).unwrap(), written);
}

#[test]
fn effective_settings_mean_the_same_anywhere() {
    for file in ["demo.toml", "pioneer1.toml"] {
        let settings = Settings::read(&config(file)).unwrap();
        let text = settings.to_toml().unwrap();
        let folder = tempfile::tempdir().unwrap();
        let elsewhere = folder.path().join("effective.toml");
        std::fs::write(&elsewhere, &text).unwrap();
        assert_eq!(Settings::read_handed(&elsewhere).unwrap(), settings, "{text}");
    }
}

#[test]
fn relative_paths_mean_the_folder_of_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("deployment.toml");
    let text = r#"
        name = "x"
        out = "there"
        [[process]]
        name = "mine"
        command = ["./bin/driver", "./argument"]
        [[process]]
        name = "path"
        command = ["driver"]
        [[process]]
        name = "pioneer"
        run = "pioneer"
        [[process]]
        name = "simulator"
        run = "simulator"
        [pioneer]
        port = "/dev/ttyS0"
        [simulator]
        world = "w.toml"
    "#;
    std::fs::write(&file, text).unwrap();
    let settings = Settings::read(&file).unwrap();
    let here = folder.path();
    assert_eq!(settings.out, here.join("there"));
    assert_eq!(settings.simulator.world, here.join("w.toml"));
    let playback = "name = \"x\"\nprocess = [{ name = \"p\", run = \"playback\" }]\n[playback]\nlog = \"/logs/a.mcap\"\n";
    assert_eq!(Settings::parse("x", playback).unwrap().playback.log, Path::new("/logs/a.mcap"));
    assert_eq!(settings.pioneer.port, Port::Device("/dev/ttyS0".into()));
    let program = here.join("./bin/driver").to_str().unwrap().to_owned();
    assert_eq!(settings.process[0].program, Program::Command(vec![program, "./argument".to_owned()]));
    assert_eq!(settings.process[1].program, Program::Command(vec!["driver".to_owned()]));
}

#[test]
fn a_relative_camera_device_is_in_the_folder_of_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("deployment.toml");
    let runs = ["pioneer", "camera", "sbs"].map(|run| format!("{{ name = \"{run}\", run = \"{run}\" }}")).join(", ");
    std::fs::write(&file, format!("name = \"x\"\nprocess = [{runs}]\n[camera]\ndevice = \"video\"\n")).unwrap();
    assert_eq!(Settings::read(&file).unwrap().camera.device, folder.path().join("video"));
}

#[test]
fn paths_come_out_absolute_however_the_file_is_named() {
    // Tests run in the folder of their package.
    let settings = Settings::read(Path::new("../../config/demo.toml")).unwrap();
    assert!(settings.out.is_absolute(), "{}", settings.out.display());
    assert!(settings.simulator.world.is_file(), "{}", settings.simulator.world.display());
}

#[test]
fn a_run_ends_with_what_brings_the_world_in() {
    let ends = |run: &str, given: &str| {
        let other = if run == "mapping" { "pioneer" } else { "mapping" };
        let text = format!(
            "name = \"x\"\nprocess = [{{ name = \"a\", run = \"{run}\"{given} }}, {{ name = \"b\", run = \"{other}\" }}, {{ name = \"c\", command = [\"c\"] }}]"
        );
        let settings = Settings::parse("x", &text).unwrap_or_else(|error| panic!("{error}"));
        assert!(!settings.process[2].ends_run);
        settings.process[0].ends_run
    };
    for (run, by_default) in [("recorder", false), ("mapping", false), ("pioneer", false), ("simulator", true), ("playback", true)] {
        assert_eq!(ends(run, ""), by_default, "{run}");
        assert!(ends(run, ", ends_run = true"), "{run}");
        assert!(!ends(run, ", ends_run = false"), "{run}");
    }
}

#[test]
fn files_that_are_no_text() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("x.toml");
    let name = file.display();
    let missing = Settings::read(&file).unwrap_err();
    assert_eq!(missing.to_string(), format!("{name}: cannot be read: No such file or directory (os error 2)"));

    let directory = Settings::read(folder.path()).unwrap_err();
    assert!(matches!(directory, DocumentError::Unreadable { .. }), "{directory}");

    std::fs::write(&file, b"name = \"x\"\n# caf\xe9\n").unwrap();
    let latin = Settings::read(&file).unwrap_err();
    assert_eq!(latin.to_string(), format!("{name}:2: found byte 0xe9 at offset 16, expected UTF-8 text"));

    std::fs::write(&file, "#".repeat((1 << 20) + 1)).unwrap();
    let huge = Settings::read(&file).unwrap_err();
    assert_eq!(huge.to_string(), format!("{name}: more than 1048576 bytes, expected settings"));
}

#[test]
fn numbers_know_their_limits() {
    assert_eq!(CellSize::try_from(0.005).unwrap(), CellSize::MIN);
    assert_eq!(CellSize::try_from(1.0).unwrap(), CellSize::MAX);
    for outside in [0.00499, 1.00001, -0.05, f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let error = CellSize::try_from(outside).unwrap_err();
        assert_eq!(error.to_string(), format!("{outside}: expected 0.005 to 1 m"));
    }
}

#[cfg(unix)]
#[test]
fn a_path_that_toml_cannot_hold_is_refused() {
    use std::os::unix::ffi::OsStringExt as _;
    let mut settings = Settings { process: vec![Process::built_in(BuiltIn::Playback)], ..Settings::default() };
    settings.out = PathBuf::from(std::ffi::OsString::from_vec(b"caf\xe9".to_vec()));
    assert_eq!(settings.to_toml().unwrap_err().to_string(), "out: expected a path in UTF-8, for it is written to a file");
}
