//! `stillmap topic` beside a running deployment.

use crate::harness::{Deployment, Sandbox};
use crate::own_driver::text_driver;

#[test]
fn messages_and_rates_of_a_running_deployment_are_printed() {
    let sandbox = Sandbox::new();
    let lines: Vec<String> = (1..=1_000).map(|k| format!("{k} 0 0 0  0.1 0 0 1.4")).collect();
    let scans = sandbox.write("scans.txt", &lines.join("\n"));
    let mut run = sandbox.run(&Deployment::new("own", &["mapping"]).with_driver([text_driver(), scans]), &[]);
    run.wait_for("driver", "it sends", |it| it.sent > 0);
    let echoed = sandbox.output(["topic", "echo", "robot/scan", "--count", "2"]);
    echoed.assert_code(0);
    let first = r#"{"seq":1,"pose":{"x_m":0.0,"y_m":0.0,"yaw_rad":0.0},"after_gap":0,"#;
    assert!(echoed.stdout.starts_with(first) && echoed.stdout.lines().count() == 2, "{}", echoed.stdout);
    let rates = sandbox.output(["topic", "hz", "health/heartbeat", "--count", "1"]);
    rates.assert_code(0);
    assert!(rates.stdout.ends_with(" messages/s\n") && !rates.stdout.starts_with("0.0"), "{}", rates.stdout);
    run.end().map();
}

#[test]
fn a_topic_that_cannot_be_printed_is_named() {
    let sandbox = Sandbox::new();
    let refused = |topic: &str| {
        let ended = sandbox.output(["topic", "echo", topic]);
        ended.assert_code(2);
        ended.stderr
    };
    assert!(refused("robot/scam").contains("no topic robot/scam, expected one of robot/scan, camera/frame"));
    assert!(refused("camera/frame").contains("camera/frame carries pictures: `stillmap topic hz` prints their rate"));
    sandbox.output(["topic", "hz", "robot/scan"]).assert_code(4);
    assert!(sandbox.output(["topic", "list"]).stdout.contains("\nmap/tile "));
}
