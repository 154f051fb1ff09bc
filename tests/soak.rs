//! Random kills over replays of one recorded drive: every replay ends with the map of the undisturbed one.
//!
//! `STILLMAP_SOAK_KILLS` (default 30) kills are spread over as many replays as that takes, `STILLMAP_SOAK_PER_REPLAY` (default 10)
//! at most in each; `STILLMAP_SOAK_SEED` chooses whom and when. The long run, a thousand kills in a thousand replays:
//! `STILLMAP_SOAK_KILLS=1000 STILLMAP_SOAK_PER_REPLAY=1 cargo test --release -p stillmap --test soak -- --nocapture`.
#![expect(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

mod harness;

use std::collections::{BTreeMap, HashMap};
use std::io::Write;
use std::time::{Duration, Instant};

use harness::Bench;
use harness::replays::{Dice, PROCESSES, Watched, children, record_drive, replay_settings, sha256_of, try_kill};

/// A replay that says nothing for so long hangs, and is told so by its end.
const SILENCE: Duration = Duration::from_secs(60);

fn number(variable: &str, default: u64) -> u64 {
    std::env::var(variable).ok().and_then(|text| text.parse().ok()).unwrap_or(default)
}

fn say(line: &str) {
    let _ = writeln!(std::io::stderr(), "{line}");
}

/// How long ago the process was killed that this line says is there again, ms.
fn recovered_ms(down: &mut HashMap<String, Instant>, at: Instant, line: &str) -> Option<f64> {
    let back = down.keys().find(|name| line.contains("is up again") && line.contains(name.as_str())).cloned()?;
    down.remove(&back).map(|since| (at - since).as_secs_f64() * 1e3)
}

#[test]
fn random_kills_leave_the_map_as_it_is() {
    let (kills, per_replay) = (number("STILLMAP_SOAK_KILLS", 30), number("STILLMAP_SOAK_PER_REPLAY", 10));
    let seed = number("STILLMAP_SOAK_SEED", 1);
    let bench = Bench::with_a_copy();
    let log = record_drive(&bench);
    let settings = bench.write("soak.toml", &replay_settings("soak", &log, ""));
    let replay = || Watched::start(bench.stillmap(["run", settings.to_str().unwrap()]));
    let began = Instant::now();
    let undisturbed = sha256_of(&replay().end());
    // A single kill falls anywhere in a replay, several one after the other over the length of it: some on processes that are just
    // starting, most on processes at work.
    let longest_pause_ms = (2 * began.elapsed().as_millis() as usize / (per_replay as usize + 1)).max(1);
    say(&format!("seed {seed}: map {undisturbed}, replayed in {:.1} s", began.elapsed().as_secs_f64()));

    let mut dice = Dice(seed);
    let (mut killed, mut replays) = (0, 0);
    let mut by_process: BTreeMap<&str, u64> = BTreeMap::new();
    let mut recoveries_ms: Vec<f64> = Vec::new();
    while killed < kills {
        let mut run = replay();
        let mut down: HashMap<String, Instant> = HashMap::new();
        let mut here = 0;
        'replay: while here < per_replay && killed < kills {
            let until = Instant::now() + Duration::from_millis(dice.below(longest_pause_ms) as u64);
            loop {
                match run.line(until.saturating_duration_since(Instant::now())) {
                    None => break 'replay,
                    Some(None) => break,
                    Some(Some((at, line))) => recoveries_ms.extend(recovered_ms(&mut down, at, &line)),
                }
            }
            // By name: what starts last would otherwise be killed least.
            let name = PROCESSES[dice.below(PROCESSES.len())];
            let Some((_, pid)) = children(run.pid()).into_iter().find(|(it, _)| it == name) else { continue };
            if try_kill(pid) {
                down.entry(name.to_owned()).or_insert_with(Instant::now);
                *by_process.entry(name).or_default() += 1;
                killed += 1;
                here += 1;
            }
        }
        while !down.is_empty()
            && let Some(Some((at, line))) = run.line(SILENCE)
        {
            recoveries_ms.extend(recovered_ms(&mut down, at, &line));
        }
        replays += 1;
        let ended = run.end_or(|| harness::text(&bench.output(["status", "--json"]).stdout));
        assert_eq!(sha256_of(&ended), undisturbed, "seed {seed}, replay {replays}, after {killed} kills:\n{}", ended.2);
        if replays % 50 == 0 {
            say(&format!("{killed} kills in {replays} replays, all maps equal"));
        }
    }
    recoveries_ms.sort_by(f64::total_cmp);
    let median = recoveries_ms.get(recoveries_ms.len() / 2).copied().unwrap_or_default();
    let worst = recoveries_ms.last().copied().unwrap_or_default();
    say(&format!("seed {seed}: {killed} kills in {replays} replays, all maps equal; killed: {by_process:?}"));
    say(&format!("from a kill until \"is up again\", {} times seen: median {median:.0} ms, worst {worst:.0} ms", recoveries_ms.len()));
}
