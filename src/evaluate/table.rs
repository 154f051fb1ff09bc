//! The scores of drives as tables: a row for each world and number of walkers, and one for all.

use super::localisation;
use super::report::{Figures, Report, Row, sum};
use std::fmt::{Display, Formatter};

const HEAD: [&str; 13] = ["", "walkers", "drives", "ghosts", "removed", "lost", "worst", "net", "IoU", "blocked", "F1", "SA/DA/AA", "STD"];
/// Space between two columns.
const GAP: &str = "  ";

impl Display for Report {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        write_table(f, self.table(HEAD, line))?;
        if self.runs.iter().any(|row| row.localisation.is_some()) {
            writeln!(f)?;
            write_table(f, self.table(localisation::HEAD, localisation::line))?;
        }
        Ok(())
    }
}

impl Report {
    /// The head, and below it what `line` says of the rows of each world and number of walkers, and of all.
    fn table<const N: usize>(&self, head: [&str; N], line: fn(&str, &str, &[&Row]) -> [String; N]) -> Vec<[String; N]> {
        let mut rows = vec![head.map(str::to_owned)];
        let groups = self.groups();
        for (run, walkers) in &groups {
            let of_group: Vec<&Row> = self.runs.iter().filter(|row| row.run == *run && row.walkers == *walkers).collect();
            let walkers = walkers.map_or_else(|| "file".to_owned(), |walkers| walkers.to_string());
            rows.push(line(run, &walkers, &of_group));
        }
        if groups.len() > 1 {
            rows.push(line("all", "", &self.runs.iter().collect::<Vec<_>>()));
        }
        rows
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

/// Numbers are aligned to the right, the name of the world to the left.
fn write_table<const N: usize>(f: &mut Formatter<'_>, rows: Vec<[String; N]>) -> std::fmt::Result {
    let widths: Vec<usize> = (0..N).map(|column| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0)).collect();
    for row in &rows {
        let cells = row.iter().zip(&widths).enumerate();
        let aligned = cells.map(|(column, (cell, &wide))| if column == 0 { format!("{cell:wide$}") } else { format!("{cell:>wide$}") });
        writeln!(f, "{}", aligned.collect::<Vec<_>>().join(GAP))?;
    }
    Ok(())
}

fn line(run: &str, walkers: &str, rows: &[&Row]) -> [String; HEAD.len()] {
    let Figures { score, ghosts_before, ghosts_after, std, .. } = &sum(rows.iter().copied());
    [
        run.to_owned(),
        walkers.to_owned(),
        rows.len().to_string(),
        format!("{ghosts_before} -> {ghosts_after}"),
        percent(score.ghosts_removed, 1),
        percent(score.walls_lost, 2),
        worst(rows),
        score.net.map_or_else(|| "-".to_owned(), |net| format!("{:+.0} %", 100.0 * net)),
        format!("{:.3} -> {:.3}", score.iou_empty_unfiltered, score.iou_empty),
        format!("{:.1} -> {}", 100.0 * score.blocked_unfiltered, percent(score.blocked, 1)),
        format!("{:.3}", score.f1),
        format!("{:.3}/{:.3}/{:.3}", score.sa, score.da, score.aa),
        format!("{:.2}/{:.2}/{:.1}", std.precision, std.recall, std.false_alarms_a_minute),
    ]
}

/// The most that one drive lost of the walls, with its seed.
fn worst(rows: &[&Row]) -> String {
    let lost = |row: &&&Row| row.figures.score.walls_lost;
    let Some(row) = rows.iter().max_by(|a, b| lost(a).total_cmp(&lost(b))) else { return String::new() };
    let seed = row.seed.filter(|_| rows.len() > 1).map_or_else(String::new, |seed| format!(" ({seed})"));
    format!("{}{seed}", percent(row.figures.score.walls_lost, 1))
}

fn percent(share: f64, digits: usize) -> String {
    format!("{:.digits$} %", 100.0 * share)
}
