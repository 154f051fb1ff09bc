//! The scores of drives, as a table and as JSON.

use evaluate::{Detection, Score, Tally, Trial};
use serde::Serialize;
use std::fmt::{Display, Formatter};

/// The scores of several drives.
#[derive(Debug, Serialize)]
pub(crate) struct Report {
    #[serde(flatten)]
    total: Figures,
    runs: Vec<Row>,
}

/// The score of one drive.
#[derive(Debug, Serialize)]
pub(crate) struct Row {
    run: String,
    seed: Option<u64>,
    walkers: Option<u32>,
    #[serde(flatten)]
    figures: Figures,
    #[serde(skip)]
    counts: Counts,
}

/// Counts that are summed over drives.
#[derive(Debug, Clone, Default)]
struct Counts {
    tally: Tally,
    detection: Detection,
    track_errors_m: Vec<f64>,
}

/// Shares from 0 to 1.
#[derive(Debug, Clone, Serialize)]
struct Figures {
    #[serde(flatten)]
    score: Score,
    ghosts_before: usize,
    ghosts_after: usize,
    /// Median distance of a walker from the nearest track, m; `None` without tracks.
    track_error_m: Option<f64>,
    std: StdFigures,
}

#[derive(Debug, Clone, Copy, Serialize)]
struct StdFigures {
    precision: f64,
    recall: f64,
    false_alarms_a_minute: f64,
}

impl Counts {
    fn of(trial: &Trial) -> Self {
        Self { tally: trial.tally, detection: trial.detection, track_errors_m: trial.track_errors_m.clone() }
    }

    fn sum<'a>(all: impl Iterator<Item = &'a Self>) -> Self {
        let mut sum = Self::default();
        for counts in all {
            sum.tally = sum.tally.with(&counts.tally);
            sum.detection = sum.detection.with(&counts.detection);
            sum.track_errors_m.extend(&counts.track_errors_m);
        }
        sum.track_errors_m.sort_by(f64::total_cmp);
        sum
    }

    fn figures(&self) -> Figures {
        let share = |part: usize, total: usize| if total == 0 { 0.0 } else { part as f64 / total as f64 };
        let seen = &self.detection;
        Figures {
            score: self.tally.score(),
            ghosts_before: self.tally.ghosts_before,
            ghosts_after: self.tally.ghosts_after,
            track_error_m: self.track_errors_m.get(self.track_errors_m.len() / 2).copied(),
            std: StdFigures {
                precision: share(seen.detected, seen.reported),
                recall: share(seen.detected, seen.walker_echoes),
                false_alarms_a_minute: if seen.minutes > 0.0 { seen.false_alarms as f64 / seen.minutes } else { 0.0 },
            },
        }
    }
}

impl Row {
    pub(crate) fn new(run: String, seed: Option<u64>, walkers: Option<u32>, trial: &Trial) -> Self {
        let counts = Counts::of(trial);
        Self { run, seed, walkers, figures: counts.figures(), counts }
    }
}

impl Report {
    pub(crate) fn of(runs: Vec<Row>) -> Self {
        Self { total: Counts::sum(runs.iter().map(|row| &row.counts)).figures(), runs }
    }

    /// Runs and numbers of walkers in the order of their first rows.
    fn groups(&self) -> Vec<(&str, Option<u32>)> {
        let mut groups: Vec<(&str, Option<u32>)> = Vec::new();
        for row in &self.runs {
            let group = (row.run.as_str(), row.walkers);
            if !groups.contains(&group) {
                groups.push(group);
            }
        }
        groups
    }
}

const HEAD: [&str; 9] =
    ["walkers", "drives", "ghosts", "removed", "walls lost", "vs empty", "F1", "STD precision/recall/alarms per min", "track"];

impl Display for Report {
    /// A row for each run, or world and number of walkers, and one for all.
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        let groups = self.groups();
        let wide = groups.iter().map(|(run, _)| run.chars().count()).max().unwrap_or(0).max("all".len());
        let [walkers, drives, ghosts, removed, lost, reference, f1, std, track] = HEAD;
        writeln!(
            f,
            "{:wide$}  {walkers:>7}  {drives:>6}  {ghosts:>12}  {removed:>7}  {lost:>10}  {reference:>12}  {f1:>5}  {std}  {track}",
            ""
        )?;
        for (run, walkers) in &groups {
            let rows: Vec<&Counts> =
                self.runs.iter().filter(|row| row.run == *run && row.walkers == *walkers).map(|row| &row.counts).collect();
            let walkers = walkers.map_or_else(|| "file".to_owned(), |walkers| walkers.to_string());
            let figures = Counts::sum(rows.iter().copied()).figures();
            writeln!(f, "{run:wide$}  {walkers:>7}  {:>6}  {figures}", rows.len())?;
        }
        if groups.len() > 1 {
            writeln!(f, "{:wide$}  {:>7}  {:>6}  {}", "all", "", self.runs.len(), self.total)?;
        }
        Ok(())
    }
}

impl Display for Figures {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        let Self { score, ghosts_before, ghosts_after, track_error_m, std } = self;
        let ghosts = format!("{ghosts_before} -> {ghosts_after}");
        let percent = |share: f64, wide: usize, digits: usize| format!("{:>wide$.digits$} %", 100.0 * share, wide = wide - 2);
        let std = format!("{:.2} / {:.2} / {:.1}", std.precision, std.recall, std.false_alarms_a_minute);
        let track = track_error_m.map_or_else(|| "none".to_owned(), |error| format!("{error:.2} m"));
        let (removed, lost) = (percent(score.ghosts_removed, 7, 1), percent(score.walls_lost, 10, 2));
        let reference = percent(score.walls_lost_reference, 12, 2);
        write!(f, "{ghosts:>12}  {removed}  {lost}  {reference}  {:>5.3}  {std:<35}  {track}", score.f1)
    }
}

/// The score of one drive in a sentence.
pub(crate) fn sentence(trial: &Trial) -> String {
    let score = trial.tally.score();
    let (before, after) = (trial.tally.ghosts_before, trial.tally.ghosts_after);
    let gone = before.saturating_sub(after);
    format!(
        "{gone} of {before} ghost cells removed ({:.0} %), {:.1} % of the walls lost, F1 {:.2}",
        100.0 * score.ghosts_removed,
        100.0 * score.walls_lost,
        score.f1
    )
}
