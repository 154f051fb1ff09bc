//! 8-connected components of a mask, by runs of pixels.

use crate::plane::Plane;

/// A connected set of pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Component {
    /// Pixels.
    pub size: u32,
    /// Sum of the pixels' columns.
    pub sum_u: u64,
    /// Sum of the pixels' rows.
    pub sum_v: u64,
    /// Leftmost column.
    pub left: u32,
    /// Uppermost row.
    pub top: u32,
    /// One past the rightmost column.
    pub right: u32,
    /// One past the lowest row.
    pub bottom: u32,
}

/// Set pixels of one row that touch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Run {
    /// The row.
    pub row: usize,
    /// First column.
    pub start: usize,
    /// One past the last column.
    pub end: usize,
    /// Index of the component among [`Components::list`].
    pub component: usize,
}

/// All components of a mask.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Components {
    /// In the order of their first pixel.
    pub list: Vec<Component>,
    /// Row by row, left to right.
    pub runs: Vec<Run>,
}

/// The components of a mask; a pixel that is not 0 is set.
#[must_use]
pub fn components(mask: &Plane<u8>) -> Components {
    let mut runs: Vec<Run> = Vec::new();
    // A run's component is first a label; parent[label] leads to the label of its component's first run.
    let mut parent: Vec<usize> = Vec::new();
    let mut above = 0..0;
    for row in 0..mask.height() {
        let first = runs.len();
        push_runs(mask.row(row), row, &mut runs);
        let mut candidate = above.start;
        for k in first..runs.len() {
            let Run { start, end, .. } = runs[k];
            while candidate < above.end && runs[candidate].end < start {
                candidate += 1;
            }
            let mut label = None;
            let mut other = candidate;
            while other < above.end && runs[other].start <= end {
                let found = root(&mut parent, runs[other].component);
                label = Some(label.map_or(found, |label: usize| {
                    let (low, high) = (label.min(found), label.max(found));
                    parent[high] = low;
                    low
                }));
                other += 1;
            }
            runs[k].component = label.unwrap_or_else(|| {
                parent.push(parent.len());
                parent.len() - 1
            });
        }
        above = first..runs.len();
    }
    number(runs, &mut parent)
}

/// The runs of a mask, row by row, left to right; their component is 0.
pub(crate) fn runs(mask: &Plane<u8>) -> Vec<Run> {
    let mut runs = Vec::new();
    for row in 0..mask.height() {
        push_runs(mask.row(row), row, &mut runs);
    }
    runs
}

fn push_runs(pixels: &[u8], row: usize, runs: &mut Vec<Run>) {
    let mut open = None;
    for (n, pixels) in pixels.chunks(64).enumerate() {
        let (set, first) = (bits(pixels), n * 64);
        if set == 0 && open.is_none() {
            continue;
        }
        let mut u = 0;
        while u < 64 {
            // The next pixel that starts a run or is the first one after it.
            let next = if open.is_none() { set >> u } else { !set >> u };
            if next == 0 {
                break;
            }
            u += next.trailing_zeros() as usize;
            match open.take() {
                None => open = Some(first + u),
                Some(start) => runs.push(Run { row, start, end: first + u, component: 0 }),
            }
        }
    }
    if let Some(start) = open {
        runs.push(Run { row, start, end: pixels.len(), component: 0 });
    }
}

/// Which of up to 64 pixels are not 0, the first one in the lowest bit.
fn bits(pixels: &[u8]) -> u64 {
    let (eights, rest) = pixels.as_chunks::<8>();
    let mut bits = 0;
    for (n, eight) in eights.iter().enumerate() {
        let x = u64::from_le_bytes(*eight);
        // The highest bit of each byte that is not 0; the product brings the eight of them together.
        let high = (((x & 0x7f7f_7f7f_7f7f_7f7f) + 0x7f7f_7f7f_7f7f_7f7f) | x) & 0x8080_8080_8080_8080;
        bits |= ((high >> 7).wrapping_mul(0x0102_0408_1020_4080) >> 56) << (8 * n);
    }
    for (n, pixel) in rest.iter().enumerate() {
        bits |= u64::from(*pixel != 0) << (8 * eights.len() + n);
    }
    bits
}

fn root(parent: &mut [usize], mut label: usize) -> usize {
    while parent[label] != label {
        parent[label] = parent[parent[label]];
        label = parent[label];
    }
    label
}

/// Numbers the components and sums them up.
fn number(mut runs: Vec<Run>, parent: &mut [usize]) -> Components {
    let mut index: Vec<Option<usize>> = vec![None; parent.len()];
    let mut list: Vec<Component> = Vec::new();
    for run in &mut runs {
        let root = root(parent, run.component);
        let k = *index[root].get_or_insert_with(|| {
            list.push(Component { left: u32::MAX, top: run.row as u32, ..Component::default() });
            list.len() - 1
        });
        run.component = k;
        let c = &mut list[k];
        let length = (run.end - run.start) as u64;
        c.size += length as u32;
        c.sum_u += (run.start as u64 + run.end as u64 - 1) * length / 2;
        c.sum_v += run.row as u64 * length;
        c.left = c.left.min(run.start as u32);
        c.right = c.right.max(run.end as u32);
        c.bottom = c.bottom.max(run.row as u32 + 1);
    }
    Components { list, runs }
}
