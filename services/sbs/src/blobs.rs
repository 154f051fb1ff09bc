//! BLOB_mov: which components of the mask are things that move.

use crate::components::{Component, Components, Run, runs};
use crate::model::Model;
use crate::morphology;
use crate::plane::Plane;
use crate::vectorised::vectorised;

/// What is a blob.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BlobRule {
    /// Smallest size in a picture 160 wide, px; it grows with the square of the width.
    pub size_min: f32,
    /// Smallest mean thickness in a picture 160 wide, px.
    pub thickness_min: f32,
    /// Smallest share of its pixels on the last mask.
    pub overlap_min: f32,
    /// Smallest share of its pixels where the compensated frame difference is not still.
    pub motion_min: f32,
    /// Smallest mean thickness, likewise, times the share of its pixels that no model pixel next to them explains either: an edge
    /// that is out of place by a pixel is no walker (the region of eq. 6, one pixel wide).
    pub firm_thickness_min: f32,
    /// A component of which at least half was a blob in the last frame needs this share of `motion_min` only: who
    /// slows down is not lost, and what flickers does not get in.
    pub known_share: f32,
    /// One that has been a blob for at least this many frames needs no motion: who walked and now stands is seen until the
    /// background takes the walker over.
    pub held_age: u8,
}

impl Default for BlobRule {
    fn default() -> Self {
        Self {
            size_min: 40.0,
            thickness_min: 3.0,
            overlap_min: 0.1,
            motion_min: 0.15,
            firm_thickness_min: 2.7,
            known_share: 0.5,
            held_age: 15,
        }
    }
}

/// What the tests of a frame's components rest on.
pub(crate) struct Evidence<'a> {
    pub(crate) mask: &'a Plane<u8>,
    /// The last frame's mask, dilated by what a thing moves in a frame.
    pub(crate) last: &'a Plane<u8>,
    /// The last frame's blobs, dilated likewise.
    pub(crate) blobs: &'a Plane<u8>,
    /// For how many frames the last frame's blobs have been such.
    pub(crate) age: &'a Plane<u8>,
    /// Where the compensated frame difference is not still.
    pub(crate) moved: &'a Plane<u8>,
    pub(crate) picture: &'a Plane<f32>,
    pub(crate) model: &'a Model,
    pub(crate) k: f32,
}

/// Counts over the pixels of a component.
#[derive(Debug, Clone, Copy, Default)]
struct Tally {
    overlap: u32,
    known: u32,
    age: u8,
    moved: u32,
    firm: u32,
    inner: u32,
}

/// The components that pass all tests, largest first, and at each of their pixels for how many frames it has been a blob.
pub(crate) fn select(components: &Components, evidence: &Evidence<'_>, rule: &BlobRule) -> (Vec<Component>, Plane<u8>) {
    let (width, height) = (evidence.mask.width(), evidence.mask.height());
    let unit = width as f32 / 160.0;
    let size_min = rule.size_min * unit * unit;
    let large: Vec<bool> = components.list.iter().map(|c| c.size as f32 >= size_min).collect();
    let inner = morphology::eroded(evidence.mask);
    let mut tallies = vec![Tally::default(); components.list.len()];
    let mut explained = Vec::new();
    for run in components.runs.iter().filter(|r| large[r.component]) {
        let tally = &mut tallies[run.component];
        let set = |plane: &Plane<u8>| plane.row(run.row)[run.start..run.end].iter().map(|&p| u32::from(p & 1)).sum::<u32>();
        tally.overlap += set(evidence.last);
        tally.known += set(evidence.blobs);
        tally.age = evidence.age.row(run.row)[run.start..run.end].iter().fold(tally.age, |a, &b| a.max(b));
        tally.moved += set(evidence.moved);
        tally.inner += set(&inner);
        tally.firm += firm(run, evidence, &mut explained);
    }
    inherit(components, &large, evidence.age, &mut tallies);
    let passes = |k: usize| {
        let (tally, size) = (&tallies[k], components.list[k].size as f32);
        // A strip of thickness t and length l has t l pixels, (t − 2) l of them inside.
        let thickness = 2.0 * size / (size - tally.inner as f32).max(1.0);
        let known = tally.known as f32 >= 0.5 * size;
        let ease = match known {
            true if tally.age >= rule.held_age => 0.0,
            true => rule.known_share,
            false => 1.0,
        };
        large[k]
            && thickness >= rule.thickness_min * unit
            && tally.overlap as f32 >= rule.overlap_min * size
            && tally.moved as f32 >= ease * rule.motion_min * size
            && thickness * tally.firm as f32 >= rule.firm_thickness_min * unit * size
    };
    let passing: Vec<bool> = (0..components.list.len()).map(passes).collect();
    let mut age = Plane::filled(width, height, 0_u8);
    for run in components.runs.iter().filter(|r| passing[r.component]) {
        let tally = &tallies[run.component];
        age.row_mut(run.row)[run.start..run.end].fill(tally.age.saturating_add(1));
    }
    let mut blobs: Vec<Component> = components.list.iter().zip(&passing).filter(|(_, passing)| **passing).map(|(c, _)| *c).collect();
    blobs.sort_by_key(|c| std::cmp::Reverse(c.size));
    (blobs, age)
}

/// A component keeps its age if it holds at least half of the blob that it comes from: what splits off is new.
fn inherit(components: &Components, large: &[bool], age: &Plane<u8>, tallies: &mut [Tally]) {
    let mut total = [0_u32; 256];
    for run in runs(age) {
        age.row(run.row)[run.start..run.end].iter().for_each(|&a| total[usize::from(a)] += 1);
    }
    let mut held = vec![0_u32; tallies.len()];
    for run in components.runs.iter().filter(|r| large[r.component]) {
        let oldest = tallies[run.component].age;
        held[run.component] += age.row(run.row)[run.start..run.end].iter().map(|&a| u32::from(a == oldest)).sum::<u32>();
    }
    for (tally, held) in tallies.iter_mut().zip(held) {
        if 2 * held < total[usize::from(tally.age)] {
            tally.age = 0;
        }
    }
}

vectorised! {
    /// Pixels of a run that neither B of the pixel itself nor that of its eight neighbours explains. `explained` is memory for it.
    fn firm(run: &Run, evidence: &Evidence<'_>, explained: &mut Vec<f32>) -> u32 {
        let (mean, variance) = (&evidence.model.background.mean, &evidence.model.background.variance);
        let (width, height) = (mean.width(), mean.height());
        let k2 = evidence.k * evidence.k;
        let z = &evidence.picture.row(run.row)[run.start..run.end];
        explained.clear();
        explained.resize(z.len(), f32::INFINITY);
        // The least squared distance from a neighbour's B, less what that accepts.
        for v in run.row.saturating_sub(1)..(run.row + 2).min(height) {
            for shift in 0..3 {
                let (skipped, first) = if run.start + shift == 0 { (1, 0) } else { (0, run.start + shift - 1) };
                let count = (z.len() - skipped).min(width - first);
                let near = mean.row(v)[first..first + count].iter().zip(&variance.row(v)[first..first + count]);
                for ((e, z), (m, variance)) in explained[skipped..].iter_mut().zip(&z[skipped..]).zip(near) {
                    let over = (z - m) * (z - m) - k2 * variance;
                    *e = if over < *e { over } else { *e };
                }
            }
        }
        explained.iter().map(|e| u32::from(*e > 0.0)).sum()
    }
}
