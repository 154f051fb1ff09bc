//! The scores of localisation as the lines of a table.

use super::report::Row;
use evaluate::{ByPoses, LocalisationScore};

pub(super) const HEAD: [&str; 11] = [
    "",
    "walkers",
    "drives",
    "path",
    "F1 exact",
    "odometry",
    "commit -> final",
    "worst",
    "ATE m odometry -> commit -> final",
    "worst",
    "closures",
];

/// Means over the drives, and the worst of them with its seed.
pub(super) fn line(run: &str, walkers: &str, rows: &[&Row]) -> [String; HEAD.len()] {
    let scored: Vec<(&Row, &LocalisationScore)> = rows.iter().filter_map(|row| Some((*row, row.localisation.as_ref()?))).collect();
    let mean = |number: &dyn Fn(&LocalisationScore) -> f64| {
        scored.iter().map(|(_, score)| number(score)).sum::<f64>() / scored.len().max(1) as f64
    };
    let f1 = |of: fn(&ByPoses<f64>) -> f64| mean(&|score| of(&score.f1));
    let seed = |row: &Row| row.seed.filter(|_| scored.len() > 1).map_or_else(String::new, |seed| format!(" ({seed})"));
    let worst_f1 = scored.iter().min_by(|(_, a), (_, b)| a.f1.last.total_cmp(&b.f1.last));
    let worst_m = scored.iter().max_by(|(_, a), (_, b)| a.error.last.distance_m.total_cmp(&b.error.last.distance_m));
    [
        run.to_owned(),
        walkers.to_owned(),
        scored.len().to_string(),
        format!("{:.0} m", mean(&|score| score.path_m)),
        format!("{:.3}", f1(|f1| f1.exact)),
        format!("{:.3}", f1(|f1| f1.odometry)),
        format!("{:.3} -> {:.3}", f1(|f1| f1.commit), f1(|f1| f1.last)),
        worst_f1.map_or_else(String::new, |(row, score)| format!("{:.3}{}", score.f1.last, seed(row))),
        format!(
            "{:.2} -> {:.3} -> {:.3}",
            mean(&|score| score.error.odometry.distance_m),
            mean(&|score| score.error.commit.distance_m),
            mean(&|score| score.error.last.distance_m)
        ),
        worst_m.map_or_else(String::new, |(row, score)| format!("{:.3}{}", score.error.last.distance_m, seed(row))),
        format!("{:.1}", mean(&|score| score.closures as f64)),
    ]
}
