//! The commands of an operator: they find, look at, restart and end a running deployment.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::Stdio;

use crate::harness::replay::DRIVE;
use crate::harness::{Sandbox, WATCHDOG, is_running, worlds};

/// The answer of the page's server to a request, with its head.
fn get(page: &str, path: &str) -> String {
    let host = page.trim_start_matches("http://").trim_end_matches('/');
    let mut stream = TcpStream::connect(host).unwrap();
    stream.set_read_timeout(Some(WATCHDOG)).unwrap();
    write!(stream, "GET {path} HTTP/1.1\r\nHost: {host}\r\n\r\n").unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    answer
}

#[test]
fn a_requested_restart_leaves_no_trace_in_the_map() {
    let sandbox = Sandbox::new();
    let world = worlds::path("corridor-empty");
    let mut run = sandbox.start(sandbox.stillmap(["demo", "--speed", "4", "--world", world.to_str().unwrap()]));
    run.wait_for("mapping", "it has received 100 scans", |it| it.received > 100);
    let listed = sandbox.output(["list"]);
    listed.assert_code(0);
    assert!(
        listed.stdout.contains("demo-") && listed.stdout.contains(" running ") && listed.stdout.contains("demo-out"),
        "{}",
        listed.stdout
    );

    for process in ["mapping", "fti"] {
        let restarted = sandbox.output(["restart", process]);
        restarted.assert_code(0);
        assert!(restarted.stdout.starts_with(&format!("{process}: restarted, process ")), "{}", restarted.stdout);
        let logs = sandbox.output(["logs", process]).stdout;
        assert!(logs.contains(&format!("INFO  {process}: restarts on request")), "{logs}");
        assert!(logs.lines().all(|line| line.contains(&format!(" {process}: "))), "{logs}");
    }
    sandbox.output(["restart", "nothing"]).assert_code(2);
    sandbox.output(["logs", "nothing"]).assert_code(2);

    let page = run.wait_for("viewer", "it serves the page", |it| it.note.as_str().starts_with("http://")).note;
    let metrics = get(page.as_str(), "/metrics");
    assert!(metrics.starts_with("HTTP/1.1 200 OK") && metrics.contains(",process=\"mapping\"} 1\n"), "{metrics}");

    let stopped = sandbox.output(["stop"]);
    stopped.assert_code(0);
    assert!(stopped.stdout.contains(" has ended"), "{}", stopped.stdout);
    let driven = run.end().map();
    assert_eq!(sandbox.replayed(&sandbox.path("demo-out/drive.mcap"), "again"), driven);
    sandbox.assert_nothing_left();
}

#[test]
fn without_a_deployment_no_verb_has_a_target() {
    let sandbox = Sandbox::new();
    for verb in [&["list"][..], &["stop"], &["restart", "std"], &["logs"]] {
        sandbox.output(verb).assert_code(4);
    }
}

#[test]
fn lines_are_followed_until_the_deployment_ends() {
    let sandbox = Sandbox::new();
    let replay = DRIVE.replay(&sandbox, "followed").set("pace", "live");
    let mut run = sandbox.run(&replay, &["--speed", "5"]);
    run.wait_for("playback", "it runs", is_running);
    let mut follower = sandbox.stillmap(["logs", "--follow"]).stdout(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(follower.stdout.take().unwrap()).lines();
    let first = lines.next().unwrap().unwrap();
    assert!(first.starts_with("INFO  "), "the lines before it began: {first}");
    sandbox.output(["stop"]).assert_code(0);
    run.end();
    let later: Vec<String> = lines.map(Result::unwrap).collect();
    assert!(later.iter().any(|line| line.starts_with("INFO  supervisor: stopping in order")), "{later:?}");
    assert_eq!(follower.wait().unwrap().code(), Some(0));
}
