//! What of a bag cannot be read.

/// Most damages that are listed: more tell nothing new, and a bag of strangers may have any number.
const MOST_LISTED: usize = 20;

/// The first damages, and the number of the rest.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Damages {
    listed: Vec<String>,
    unlisted: u64,
}

impl Damages {
    pub(crate) fn add(&mut self, damage: String) {
        if self.listed.len() < MOST_LISTED {
            self.listed.push(damage);
        } else {
            self.unlisted += 1;
        }
    }

    /// One line for each that is listed, and one for the rest.
    pub(crate) fn lines(self) -> Vec<String> {
        let rest = (self.unlisted > 0).then(|| format!("{} more damages", self.unlisted));
        self.listed.into_iter().chain(rest).collect()
    }
}
