//! One column of a picture while it is painted, from what is far to what is near.

/// Grey levels and truth of the pixels of a column, from the top.
#[derive(Debug, Clone, Default)]
pub(super) struct Column {
    pub(super) pixels: Vec<Pixel>,
}

/// A pixel.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Pixel {
    /// Grey level.
    pub(super) grey: f32,
    /// Share of it that shows a walker.
    pub(super) walker: f32,
    /// Share of the light that a walker's shadow takes.
    pub(super) shadow: f32,
}

impl Pixel {
    /// Something that is no walker covers a share of the pixel.
    pub(super) fn cover(&mut self, share: f32, grey: f32) {
        self.grey += share * (grey - self.grey);
        self.walker -= share * self.walker;
        self.shadow -= share * self.shadow;
    }

    /// A walker covers a share of the pixel.
    pub(super) fn cover_with_walker(&mut self, share: f32, grey: f32) {
        self.cover(share, grey);
        self.walker += share;
    }

    /// A shadow takes a share of the light.
    pub(super) fn darken(&mut self, share: f32) {
        self.grey -= share * self.grey;
        self.shadow += share * (1.0 - self.shadow);
    }

    /// Adds a share of another pixel.
    pub(super) fn add(&mut self, share: f32, other: &Self) {
        self.grey += share * other.grey;
        self.walker += share * other.walker;
        self.shadow += share * other.shadow;
    }
}

impl Column {
    /// Rows between two heights in the picture, px, in part or whole, each with the share of it that lies between them.
    pub(super) fn between(&mut self, top_px: f32, bottom_px: f32) -> impl Iterator<Item = (f32, f32, &mut Pixel)> {
        // What is not a number, or out of the picture, becomes the nearest end of it.
        let first = (top_px as usize).min(self.pixels.len());
        let end = (bottom_px as usize).saturating_add(1).clamp(first, self.pixels.len());
        let rows = self.pixels.get_mut(first..end).unwrap_or_default().iter_mut().zip(first..);
        rows.map(move |(pixel, row)| {
            let row = row as f32;
            ((bottom_px.min(row + 1.0) - top_px.max(row)).max(0.0), row + 0.5, pixel)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_covered_by_their_share() {
        let mut column = Column { pixels: vec![Pixel::default(); 5] };
        let mut shares = |top_px, bottom_px| column.between(top_px, bottom_px).map(|(share, row, _)| (row, share)).collect::<Vec<_>>();
        assert_eq!(shares(1.25, 3.5), [(1.5, 0.75), (2.5, 1.0), (3.5, 0.5)]);
        assert_eq!(shares(-7.0, 0.5), [(0.5, 0.5)]);
        assert_eq!(shares(4.5, 99.0), [(4.5, 0.5)]);
        assert!(shares(3.0, 2.0).iter().all(|(_, share)| *share == 0.0));
        assert!(shares(f32::NAN, f32::NAN).len() <= 1);
        assert_eq!(shares(f32::NEG_INFINITY, f32::INFINITY).len(), 5);
    }

    #[test]
    fn what_covers_hides_walker_and_shadow() {
        let mut pixel = Pixel { grey: 100.0, ..Pixel::default() };
        pixel.darken(0.2);
        assert_eq!(pixel, Pixel { grey: 80.0, walker: 0.0, shadow: 0.2 });
        pixel.cover_with_walker(0.5, 20.0);
        assert_eq!(pixel, Pixel { grey: 50.0, walker: 0.5, shadow: 0.1 });
        pixel.cover(1.0, 7.0);
        assert_eq!(pixel, Pixel { grey: 7.0, walker: 0.0, shadow: 0.0 });
    }
}
