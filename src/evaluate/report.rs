//! The scores of drives.

use evaluate::{Causes, Detection, Ghosts, LocalisationScore, Score, Tally, Trial};
use serde::Serialize;

/// The scores of several drives.
#[derive(Debug, Serialize)]
pub(crate) struct Report {
    #[serde(flatten)]
    pub(super) total: Figures,
    pub(super) runs: Vec<Row>,
}

/// The score of one drive.
#[derive(Debug, Serialize)]
pub(crate) struct Row {
    /// The world or the log; `random` for random worlds.
    pub(super) run: String,
    pub(super) seed: Option<u64>,
    pub(super) walkers: Option<u32>,
    #[serde(flatten)]
    pub(super) figures: Figures,
    /// `None` where localisation does not run.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) localisation: Option<LocalisationScore>,
    #[serde(skip)]
    counts: Counts,
}

/// Counts that are summed over drives.
#[derive(Debug, Clone, Default)]
struct Counts {
    tally: Tally,
    causes: Causes,
    detection: Detection,
    track_errors_m: Vec<f64>,
}

#[derive(Debug, Clone, Serialize)]
pub(super) struct Figures {
    #[serde(flatten)]
    pub(super) score: Score,
    pub(super) ghosts_before: usize,
    pub(super) ghosts_after: usize,
    /// The ghost cells by where the walkers were that caused them.
    pub(super) ghosts_by_cause: Ghosts,
    /// Echoes with wrong verdicts by their causes.
    pub(super) wrong_verdicts: Causes,
    /// Median distance of a walker from the nearest track, m; `None` without tracks.
    pub(super) track_error_m: Option<f64>,
    pub(super) std: StdFigures,
}

#[derive(Debug, Clone, Copy, Serialize)]
pub(super) struct StdFigures {
    pub(super) precision: f64,
    pub(super) recall: f64,
    pub(super) false_alarms_a_minute: f64,
}

impl Counts {
    fn of(trial: &Trial) -> Self {
        Self { tally: trial.tally, causes: trial.causes, detection: trial.detection, track_errors_m: trial.track_errors_m.clone() }
    }

    fn sum<'a>(all: impl Iterator<Item = &'a Self>) -> Self {
        let mut sum = Self::default();
        for counts in all {
            sum.tally = sum.tally.with(&counts.tally);
            sum.causes = sum.causes.with(&counts.causes);
            sum.detection = sum.detection.with(&counts.detection);
            sum.track_errors_m.extend(&counts.track_errors_m);
        }
        sum.track_errors_m.sort_by(f64::total_cmp);
        sum
    }

    fn figures(&self) -> Figures {
        let share = |part: usize, total: usize| if total == 0 { 0.0 } else { part as f64 / total as f64 };
        let (seen, cells) = (&self.detection, &self.tally.cells);
        Figures {
            score: self.tally.score(),
            ghosts_before: cells.caused,
            ghosts_after: cells.caused_left,
            ghosts_by_cause: self.tally.ghosts,
            wrong_verdicts: self.causes,
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
        Self { run, seed, walkers, figures: counts.figures(), localisation: None, counts }
    }

    pub(super) fn with(self, localisation: Option<LocalisationScore>) -> Self {
        Self { localisation, ..self }
    }
}

/// The figures of several rows together.
pub(super) fn sum<'a>(rows: impl Iterator<Item = &'a Row>) -> Figures {
    Counts::sum(rows.map(|row| &row.counts)).figures()
}

impl Report {
    pub(crate) fn of(runs: Vec<Row>) -> Self {
        Self { total: sum(runs.iter()), runs }
    }
}

/// The score of one drive in a sentence.
pub(crate) fn sentence(trial: &Trial) -> String {
    let (score, cells) = (trial.tally.score(), &trial.tally.cells);
    format!(
        "{} of {} ghost cells removed ({:.0} %), {:.1} % of the walls lost, F1 {:.2}",
        cells.caused.saturating_sub(cells.caused_left),
        cells.caused,
        100.0 * score.ghosts_removed,
        100.0 * score.walls_lost,
        score.f1
    )
}
