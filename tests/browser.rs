//! The live page in a real browser.
#![expect(clippy::unwrap_used, clippy::panic, clippy::print_stderr, reason = "tests fail by panicking, and say what they left out")]

mod chromium;
mod harness;

use chromium::Chromium;
use harness::{Bench, Run, kill, text};
use std::path::Path;

/// Pictures of the page are left here for people.
const PICTURES: &str = env!("CARGO_TARGET_TMPDIR");

#[test]
fn a_browser_sees_the_map_grow_a_walker_and_a_process_that_comes_back() {
    let Some(mut browser) = Chromium::start() else {
        assert!(std::env::var_os("CI").is_none(), "no chromium on this machine, and it is to be tested with");
        eprintln!("skipped: no chromium on this machine");
        return;
    };
    let bench = Bench::new();
    let run = Run::start(bench.stillmap(["demo", "--speed", "2", "--out", bench.path("out").to_str().unwrap()]));
    let viewer =
        bench.wait_for("viewer", "it serves the page", |process| process["note"].as_str().is_some_and(|note| note.starts_with("http://")));
    let page = viewer["note"].as_str().unwrap();

    browser.open(page);
    browser.wait("stillmap.tiles.known > 0");
    browser.screen(1280, 800);
    let first = browser.number("stillmap.tiles.known");
    browser.wait(&format!("stillmap.tiles.known > {first} + 4"));
    browser.wait("stillmap.overlay.path.length > 20");
    browser.wait("stillmap.overlay.trails.size > 0");
    browser.wait("[...stillmap.overlay.trails.values()].some(trail => trail.length > 3)");
    browser.picture(&Path::new(PICTURES).join("page-1280.png"));

    // What a row has been, from now on: a process comes back faster than anybody asks.
    browser.run(
        "window.seen = []; new MutationObserver(() => seen.push(document.querySelector('[data-process=mapping]').className))\
         .observe(document.querySelector('#processes'), { subtree: true, attributes: true, attributeFilter: ['class'] })",
    );
    let mapping = bench.wait_for("mapping", "it runs", |process| process["state"] == "running");
    kill(mapping["pid"].as_u64().unwrap());
    browser.wait("seen.some(state => state.includes('broken'))");
    browser.wait("document.querySelector('[data-process=mapping]').className === 'running'");
    assert!(browser.text("document.querySelector('[data-process=mapping] .state').textContent").contains("×1"));

    browser.wait("!document.querySelector('#camera').hidden && document.querySelector('#camera canvas').width === 160");
    browser.wait("document.querySelector('#foxglove code').textContent.startsWith('ws://127.0.0.1:')");
    browser.run("document.querySelector('[data-layer=difference]').click()");
    browser.wait("stillmap.tiles.mode === 'difference' && document.querySelector('#legend .difference').offsetHeight > 0");
    browser.picture(&Path::new(PICTURES).join("page-difference.png"));
    browser.run("document.querySelector('[data-layer=filtered]').click()");

    browser.screen(390, 844);
    browser.wait("document.documentElement.scrollWidth <= 390");
    browser.picture(&Path::new(PICTURES).join("page-390.png"));
    assert_eq!(browser.text("stillmap.errors.join()"), "", "nothing went wrong in the page");

    let pid = rustix::process::Pid::from_raw(i32::try_from(run.pid()).unwrap()).unwrap();
    rustix::process::kill_process(pid, rustix::process::Signal::TERM).unwrap();
    browser.wait("document.querySelector('#link').className === 'over'");
    let output = run.end();
    assert!(text(&output.stdout).contains("map sha256 "), "{}", text(&output.stderr));
}

/// How many pictures a second a browser draws of a map of 50 m × 50 m of which 20 tiles change with each, and how many bytes a
/// second a drive at its own pace takes; for people to read.
#[test]
#[ignore = "a measurement: --ignored --nocapture"]
fn how_smooth_a_large_map_is() {
    let mut browser = Chromium::start().expect("chromium");
    let bench = Bench::new();
    let _run = Run::start(bench.stillmap(["demo", "--speed", "1", "--out", bench.path("out").to_str().unwrap()]));
    let is_served = |process: &serde_json::Value| process["note"].as_str().is_some_and(|note| note.starts_with("http://"));
    browser.open(bench.wait_for("viewer", "it serves the page", is_served)["note"].as_str().unwrap());
    browser.screen(1280, 800);
    let sent =
        || bench.wait_for("viewer", "it counts", |process| process["counters"]["bytes sent"].is_u64())["counters"]["bytes sent"].clone();
    browser.wait("stillmap.overlay.trails.size > 0");
    let first = sent();
    browser.run("await new Promise(done => setTimeout(done, 20000))");
    let bytes = sent().as_u64().unwrap() - first.as_u64().unwrap();
    eprintln!("a drive at its own pace, camera and all: {} kB/s", bytes / 20_000);
    let measured = browser.text(
        "(async () => {
            const [edge, bytes] = [31, 12 + 1024];
            const message = (count, at) => {
                const view = new DataView(new ArrayBuffer(4 + count * bytes));
                view.setUint8(0, 1);
                for (let k = 0; k < count; k++) {
                    const tile = (at + k * 37) % (2 * edge * edge);
                    const start = 4 + k * bytes;
                    view.setUint32(start, tile % 2, true);
                    view.setInt32(start + 4, (tile >> 1) % edge, true);
                    view.setInt32(start + 8, Math.floor((tile >> 1) / edge), true);
                    for (let cell = 0; cell < 1024; cell++) view.setInt8(start + 12 + cell, (cell * 7 + at) % 127 - 63);
                }
                return view;
            };
            const filled = performance.now();
            stillmap.tiles.take(message(2 * edge * edge, 0));
            const fill = performance.now() - filled;
            let [frames, worst, busy] = [0, 0, 0];
            const start = performance.now();
            while (performance.now() - start < 5000) {
                await new Promise(requestAnimationFrame);
                const began = performance.now();
                stillmap.tiles.take(message(20, frames * 20));
                stillmap.view.draw(stillmap.view.canvas.getContext('2d'), stillmap.view);
                const took = performance.now() - began;
                busy += took;
                worst = Math.max(worst, took);
                frames++;
            }
            const once = 2 * edge * edge * bytes / 1e6;
            return `${once.toFixed(1)} MB once, ${(frames / 5).toFixed(1)} pictures/s, ${(busy / frames).toFixed(1)} ms each, worst ${worst.toFixed(1)} ms; ${fill.toFixed(0)} ms to take all tiles`;
        })()",
    );
    eprintln!("a map of 50 m x 50 m, both layers: {measured}");
}
