//! Random kills over replays of one recorded drive: every replay ends with the map of the undisturbed one.
//!
//! `STILLMAP_SOAK_KILLS` (default 30) kills are spread over as many replays as they need, `STILLMAP_SOAK_PER_REPLAY` (default 10) at most
//! in each; `STILLMAP_SOAK_SEED` chooses processes and times. The long run, a thousand kills in a thousand replays:
//!
//!     STILLMAP_SOAK_KILLS=1000 STILLMAP_SOAK_PER_REPLAY=1 cargo test --release -p stillmap --test stillmap soak -- --nocapture

use std::collections::{BTreeMap, HashMap};
use std::sync::mpsc::RecvTimeoutError;
use std::time::{Duration, Instant};

use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::harness::processes::{built_in_children, try_kill};
use crate::harness::replay::{DRIVE, PROCESSES};
use crate::harness::{Sandbox, WATCHDOG};

fn number(variable: &str, default: u64) -> u64 {
    std::env::var(variable).map_or(default, |text| text.parse().unwrap())
}

/// Time since the kill of the process that this line reports as restarted, ms.
fn recovered_ms(killed: &mut HashMap<String, Instant>, at: Instant, line: &str) -> Option<f64> {
    let back = killed.keys().find(|name| line.contains("is up again") && line.contains(name.as_str())).cloned()?;
    killed.remove(&back).map(|since| (at - since).as_secs_f64() * 1e3)
}

#[test]
fn random_kills_leave_the_map_unchanged() {
    let (kills, per_replay) = (number("STILLMAP_SOAK_KILLS", 30), number("STILLMAP_SOAK_PER_REPLAY", 10));
    let seed = number("STILLMAP_SOAK_SEED", 1);
    let sandbox = Sandbox::with_a_copy();
    let undisturbed = &DRIVE.map;
    let replay = DRIVE.replay(&sandbox, "soak");
    let began = Instant::now();
    assert_eq!(&sandbox.run(&replay, &[]).end().map(), undisturbed);
    // A single kill falls anywhere in a replay, several one after the other over the length of it: some on processes that are just
    // starting, most on processes at work.
    let longest_pause_ms = (2 * began.elapsed().as_millis() as u64 / (per_replay + 1)).max(1);
    eprintln!("seed {seed}: map {undisturbed}, replayed in {:.1} s", began.elapsed().as_secs_f64());

    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let (mut killed, mut replays) = (0, 0);
    let mut by_process: BTreeMap<&str, u64> = BTreeMap::new();
    let mut recoveries_ms: Vec<f64> = Vec::new();
    while killed < kills {
        let mut run = sandbox.run(&replay, &[]);
        let mut down: HashMap<String, Instant> = HashMap::new();
        let mut here = 0;
        'replay: while here < per_replay && killed < kills {
            let until = Instant::now() + Duration::from_millis(random.random_range(0..longest_pause_ms));
            loop {
                match run.line(until.saturating_duration_since(Instant::now())) {
                    Err(RecvTimeoutError::Disconnected) => break 'replay,
                    Err(RecvTimeoutError::Timeout) => break,
                    Ok((at, line)) => recoveries_ms.extend(recovered_ms(&mut down, at, &line)),
                }
            }
            // Chosen by name: by process id, the one that starts last would be killed least.
            let name = PROCESSES.choose(&mut random).unwrap();
            if built_in_children(run.pid()).get(*name).is_some_and(|pid| try_kill(*pid)) {
                down.entry((*name).to_owned()).or_insert_with(Instant::now);
                *by_process.entry(name).or_default() += 1;
                killed += 1;
                here += 1;
            }
        }
        while !down.is_empty()
            && let Ok((at, line)) = run.line(WATCHDOG)
        {
            recoveries_ms.extend(recovered_ms(&mut down, at, &line));
        }
        replays += 1;
        let ended = run.end();
        assert_eq!(&ended.map(), undisturbed, "seed {seed}, replay {replays}, after {killed} kills:\n{}", ended.stderr);
        if replays % 50 == 0 {
            eprintln!("{killed} kills in {replays} replays, all maps equal");
        }
    }
    recoveries_ms.sort_by(f64::total_cmp);
    let median = recoveries_ms.get(recoveries_ms.len() / 2).copied().unwrap_or_default();
    let worst = recoveries_ms.last().copied().unwrap_or_default();
    eprintln!("seed {seed}: {killed} kills in {replays} replays, all maps equal; killed: {by_process:?}");
    eprintln!("from a kill to \"is up again\", {} times: median {median:.0} ms, worst {worst:.0} ms", recoveries_ms.len());
}
