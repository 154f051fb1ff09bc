//! The live page in a real browser.

mod chromium;

use std::path::Path;

use rustix::process::Signal;

use self::chromium::Chromium;
use crate::harness::processes::{kill, signal};
use crate::harness::{Sandbox, counter, is_running};
use crate::live_page::page_address;

/// Screenshots of the page are left here for people.
const SCREENSHOTS: &str = env!("CARGO_TARGET_TMPDIR");

#[test]
fn the_page_shows_map_walkers_camera_and_a_restarted_process() {
    let Some(mut browser) = Chromium::start() else {
        assert!(std::env::var_os("CI").is_none(), "chromium is not installed, and CI is to test with it");
        eprintln!("skipped: chromium is not installed");
        return;
    };
    let sandbox = Sandbox::new();
    let mut run = sandbox.start(sandbox.stillmap(["demo", "--speed", "2"]));

    browser.open(&page_address(&mut run));
    browser.wait("stillmap.tiles.known > 0");
    browser.screen(1280, 800);
    let first = browser.number("stillmap.tiles.known");
    browser.wait(&format!("stillmap.tiles.known > {first} + 4"));
    browser.wait("stillmap.overlay.path.length > 20");
    browser.wait("stillmap.overlay.trails.size > 0");
    browser.wait("[...stillmap.overlay.trails.values()].some(trail => trail.length > 3)");
    browser.screenshot(&Path::new(SCREENSHOTS).join("page-1280.png"));

    // The classes of a row from now on: a process restarts faster than the browser is asked.
    browser.run(
        "window.seen = []; new MutationObserver(() => seen.push(document.querySelector('[data-process=mapping]').className))\
         .observe(document.querySelector('#processes'), { subtree: true, attributes: true, attributeFilter: ['class'] })",
    );
    kill(run.wait_for("mapping", "it runs", is_running).pid);
    browser.wait("seen.some(state => state.includes('broken'))");
    browser.wait("document.querySelector('[data-process=mapping]').className === 'running'");
    assert!(browser.text("document.querySelector('[data-process=mapping] .state').textContent").contains("×1"));

    browser.wait("!document.querySelector('#camera').hidden && document.querySelector('#camera canvas').width === 160");
    browser.wait("document.querySelector('#foxglove code').textContent.startsWith('ws://127.0.0.1:')");
    browser.run("document.querySelector('[data-layer=difference]').click()");
    browser.wait("stillmap.tiles.mode === 'difference' && document.querySelector('#legend .difference').offsetHeight > 0");
    browser.screenshot(&Path::new(SCREENSHOTS).join("page-difference.png"));
    browser.run("document.querySelector('[data-layer=filtered]').click()");

    browser.screen(390, 844);
    browser.wait("document.documentElement.scrollWidth <= 390");
    browser.screenshot(&Path::new(SCREENSHOTS).join("page-390.png"));
    assert_eq!(browser.text("stillmap.errors.join()"), "", "errors of the page");

    signal(run.pid(), Signal::TERM);
    browser.wait("document.querySelector('#link').className === 'over'");
    run.end().map();
}

/// Frames per second that a browser draws of a map of 50 m × 50 m of which 20 tiles change with each frame, and bytes per second that a
/// drive at real speed sends: figures for people.
#[test]
#[ignore = "a measurement: --ignored --nocapture"]
fn measure_the_page_with_a_large_map() {
    let mut browser = Chromium::start().expect("chromium");
    let sandbox = Sandbox::new();
    let mut run = sandbox.start(sandbox.stillmap(["demo", "--speed", "1"]));
    browser.open(&page_address(&mut run));
    browser.screen(1280, 800);
    let mut sent = || {
        let viewer = run.wait_for("viewer", "it counts bytes", |it| counter(it, "bytes sent").is_some());
        counter(&viewer, "bytes sent").unwrap()
    };
    browser.wait("stillmap.overlay.trails.size > 0");
    let first = sent();
    browser.run("await new Promise(done => setTimeout(done, 20000))");
    eprintln!("a drive at real speed with a camera: {} kB/s", (sent() - first) / 20_000);
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
            return `${once.toFixed(1)} MB once, ${(frames / 5).toFixed(1)} frames/s, ${(busy / frames).toFixed(1)} ms each, worst ${worst.toFixed(1)} ms; ${fill.toFixed(0)} ms to load all tiles`;
        })()",
    );
    eprintln!("a map of 50 m x 50 m, both layers: {measured}");
}
