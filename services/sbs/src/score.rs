//! The score of a mask against the truth, in the labels of the ChangeDetection benchmark.

use crate::components::components;
use crate::plane::Plane;

/// Truth: background.
pub const LABEL_BACKGROUND: u8 = 0;
/// Truth: background in the shadow of something that moves.
pub const LABEL_SHADOW: u8 = 50;
/// Truth: outside the region that is scored.
pub const LABEL_OUTSIDE: u8 = 85;
/// Truth: unknown (edges of what moves); not scored.
pub const LABEL_UNKNOWN: u8 = 170;
/// Truth: moving.
pub const LABEL_MOVING: u8 = 255;

/// A component smaller than this in a picture 160 wide is dropped before scoring; it grows with the square of the width.
const SIZE_MIN_AT_160: f64 = 40.0;
/// A component is a false blob when less of it than this lies on moving or unscored truth.
const TRUE_SHARE: f64 = 0.3;

/// Sums over frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Score {
    /// Frames that have a pixel that is scored.
    pub frames: u64,
    /// Moving pixels called foreground.
    pub true_positives: u64,
    /// Still pixels called foreground.
    pub false_positives: u64,
    /// Moving pixels called background.
    pub false_negatives: u64,
    /// Shadow pixels.
    pub shadow: u64,
    /// Shadow pixels called foreground.
    pub shadow_as_foreground: u64,
    /// Components under 30 % of which are on moving or unscored truth.
    pub false_blobs: u64,
}

impl Score {
    /// Adds a frame: its mask (not 0: foreground) and its truth, of the same size. Truth that scores no pixel adds nothing.
    pub fn add(&mut self, mask: &Plane<u8>, truth: &Plane<u8>) {
        if truth.values().iter().all(|&label| matches!(label, LABEL_UNKNOWN | LABEL_OUTSIDE)) {
            return;
        }
        self.frames += 1;
        let size_min = SIZE_MIN_AT_160 * (mask.width() as f64 / 160.0).powi(2);
        let found = components(mask);
        let large: Vec<bool> = found.list.iter().map(|c| f64::from(c.size) >= size_min).collect();
        let mut on_truth = vec![0_u32; found.list.len()];
        let mut foreground = Plane::filled(mask.width(), mask.height(), false);
        for run in found.runs.iter().filter(|run| large[run.component]) {
            foreground.row_mut(run.row)[run.start..run.end].fill(true);
            let labels = truth.row(run.row).get(run.start..run.end).unwrap_or(&[]);
            on_truth[run.component] += labels.iter().filter(|l| matches!(**l, LABEL_MOVING | LABEL_UNKNOWN | LABEL_OUTSIDE)).count() as u32;
        }
        for (&foreground, &label) in foreground.values().iter().zip(truth.values()) {
            match label {
                LABEL_MOVING if foreground => self.true_positives += 1,
                LABEL_MOVING => self.false_negatives += 1,
                LABEL_UNKNOWN | LABEL_OUTSIDE => {}
                _ => self.false_positives += u64::from(foreground),
            }
            if label == LABEL_SHADOW {
                self.shadow += 1;
                self.shadow_as_foreground += u64::from(foreground);
            }
        }
        let blobs = found.list.iter().zip(&on_truth).zip(&large).filter(|(_, large)| **large);
        self.false_blobs += blobs.filter(|((c, on), _)| f64::from(**on) < TRUE_SHARE * f64::from(c.size)).count() as u64;
    }

    /// Share of the pixels called foreground that move; 1 when none is.
    #[must_use]
    pub fn precision(&self) -> f64 {
        share(self.true_positives, self.true_positives + self.false_positives)
    }

    /// Share of the moving pixels called foreground; 1 when none moves.
    #[must_use]
    pub fn recall(&self) -> f64 {
        share(self.true_positives, self.true_positives + self.false_negatives)
    }

    /// The harmonic mean of precision and recall.
    #[must_use]
    pub fn f1(&self) -> f64 {
        share(2 * self.true_positives, 2 * self.true_positives + self.false_positives + self.false_negatives)
    }

    /// False blobs a frame.
    #[must_use]
    pub fn false_blobs_per_frame(&self) -> f64 {
        self.false_blobs as f64 / self.frames.max(1) as f64
    }

    /// Share of the shadow pixels called foreground; 0 without shadow.
    #[must_use]
    pub fn shadow_as_foreground(&self) -> f64 {
        self.shadow_as_foreground as f64 / self.shadow.max(1) as f64
    }
}

fn share(part: u64, total: u64) -> f64 {
    if total == 0 { 1.0 } else { part as f64 / total as f64 }
}
