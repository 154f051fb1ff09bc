//! Whether a stream is missed, as people are told.

/// A stream that was missed is taken to be there again when it has been for this many times as long as it may be late: one
/// that comes in fits is missed all the time, and said so once.
const STEADY: f64 = 5.0;

/// What people know of a stream.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Missed {
    since_s: Option<f64>,
    /// Since when it has come in time again.
    in_time_s: Option<f64>,
}

/// What they are to be told.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum News {
    /// It is missed.
    Missed,
    /// It is there again.
    Back,
}

impl Missed {
    /// Takes note at `now_s` of whether the stream is late, which it may be by `late_s`.
    pub(super) fn look(&mut self, is_late: bool, now_s: f64, late_s: f64) -> Option<News> {
        if is_late {
            self.in_time_s = None;
            let is_news = self.since_s.is_none();
            self.since_s.get_or_insert(now_s);
            return is_news.then_some(News::Missed);
        }
        self.since_s?;
        let in_time_s = *self.in_time_s.get_or_insert(now_s);
        if now_s - in_time_s < STEADY * late_s {
            return None;
        }
        *self = Self::default();
        Some(News::Back)
    }

    /// Since when it is missed, s of deployment time.
    pub(super) fn since_s(&self) -> Option<f64> {
        self.since_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_comes_in_fits_is_missed_once_and_back_once() {
        let mut missed = Missed::default();
        let late = |at: u64| (10..40).contains(&at) && !at.is_multiple_of(4);
        let news: Vec<(u64, News)> = (0..60).filter_map(|at| Some((at, missed.look(late(at), at as f64, 2.0)?))).collect();
        assert_eq!(news, [(10, News::Missed), (50, News::Back)]);
        assert_eq!(missed.since_s(), None);
    }

    #[test]
    fn what_is_never_late_is_no_news() {
        let mut missed = Missed::default();
        assert!((0..100).all(|at| missed.look(false, f64::from(at), 2.0).is_none()));
    }
}
