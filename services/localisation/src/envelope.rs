//! Normal equations in envelope form, and their Cholesky factorisation in slices.
//!
//! Row i of the lower triangle is stored from its first entry on. Elimination fills a row no further than that, so that a chain of
//! poses stays as narrow as its links, and a wall is as wide as the stretch of drive that saw it.

/// The rows of a symmetric matrix from their first entries to the diagonal.
#[derive(Debug, Clone)]
pub(crate) struct Envelope {
    /// Column of the first entry of each row.
    first: Vec<usize>,
    /// Where each row begins in `entries`; one more than there are rows.
    starts: Vec<usize>,
    entries: Vec<f64>,
    right: Vec<f64>,
    /// Rows that are eliminated.
    done: usize,
}

/// The matrix is not positive definite, or a number is none.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Singular;

impl Envelope {
    /// A zero matrix whose rows begin at these columns, each at most its own number.
    pub(crate) fn new(first: Vec<usize>) -> Self {
        let mut starts = vec![0];
        let mut at = 0;
        for (row, first) in first.iter().enumerate() {
            at += row - first + 1;
            starts.push(at);
        }
        let right = vec![0.0; first.len()];
        Self { first, starts, entries: vec![0.0; at], right, done: 0 }
    }

    /// Adds a residual e of weight w, whose derivatives by some variables are given: w JᵀJ to the matrix, −w Jᵀe to the right side.
    pub(crate) fn add(&mut self, e: f64, w: f64, derivatives: &[(usize, f64)]) {
        for (k, &(i, a)) in derivatives.iter().enumerate() {
            self.right[i] -= w * a * e;
            for &(j, b) in &derivatives[..=k] {
                let (row, column) = (i.max(j), i.min(j));
                let at = self.starts[row] + column - self.first[row];
                self.entries[at] += w * a * b;
            }
        }
    }

    /// Adds to every diagonal entry.
    pub(crate) fn damp(&mut self, by: f64) {
        for end in &self.starts[1..] {
            self.entries[end - 1] += by;
        }
    }

    /// Eliminates rows until about `work` products were formed; whether all rows are eliminated.
    pub(crate) fn eliminate(&mut self, mut work: usize) -> Result<bool, Singular> {
        while self.done < self.first.len() && work > 0 {
            let used = self.eliminate_row(self.done)?;
            self.done += 1;
            work = work.saturating_sub(used);
        }
        Ok(self.done == self.first.len())
    }

    fn eliminate_row(&mut self, i: usize) -> Result<usize, Singular> {
        let from = self.first[i];
        let (before, rest) = self.entries.split_at_mut(self.starts[i]);
        let row = &mut rest[..=i - from];
        let mut used = 1;
        for j in from..i {
            let other = &before[self.starts[j]..self.starts[j + 1]];
            let start = from.max(self.first[j]);
            let product = dot(&row[start - from..j - from], &other[start - self.first[j]..j - self.first[j]]);
            used += j - start + 1;
            row[j - from] = (row[j - from] - product) / other[other.len() - 1];
        }
        let (diagonal, earlier) = row.split_last_mut().ok_or(Singular)?;
        let square = *diagonal - dot(earlier, earlier);
        if !(square > 0.0 && square.is_finite()) {
            return Err(Singular);
        }
        *diagonal = square.sqrt();
        Ok(used + i - from)
    }

    /// The solution, after every row is eliminated.
    pub(crate) fn solve(mut self) -> Vec<f64> {
        for i in 0..self.first.len() {
            let from = self.first[i];
            let row = &self.entries[self.starts[i]..self.starts[i + 1]];
            let product = dot(&row[..i - from], &self.right[from..i]);
            self.right[i] = (self.right[i] - product) / row[i - from];
        }
        for i in (0..self.first.len()).rev() {
            let from = self.first[i];
            let row = &self.entries[self.starts[i]..self.starts[i + 1]];
            self.right[i] /= row[i - from];
            let x = self.right[i];
            for (right, entry) in self.right[from..i].iter_mut().zip(row) {
                *right -= entry * x;
            }
        }
        self.right
    }
}

/// The sum of products: four sums side by side, whose order is the same on every machine.
fn dot(one: &[f64], other: &[f64]) -> f64 {
    let (ones, others) = (one.chunks_exact(4), other.chunks_exact(4));
    let rest: f64 = ones.remainder().iter().zip(others.remainder()).map(|(a, b)| a * b).sum();
    let mut sums = [0.0; 4];
    for (a, b) in ones.zip(others) {
        for k in 0..4 {
            sums[k] += a[k] * b[k];
        }
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Error, weight and derivatives.
    type Residual = (f64, f64, Vec<(usize, f64)>);

    /// Gaussian elimination of the full matrix.
    fn solved(mut matrix: Vec<Vec<f64>>, mut right: Vec<f64>) -> Vec<f64> {
        let n = right.len();
        for i in 0..n {
            for j in i + 1..n {
                let factor = matrix[j][i] / matrix[i][i];
                let pivot = matrix[i].clone();
                matrix[j].iter_mut().zip(pivot).skip(i).for_each(|(entry, of_pivot)| *entry -= factor * of_pivot);
                right[j] -= factor * right[i];
            }
        }
        for i in (0..n).rev() {
            let known: f64 = (i + 1..n).map(|k| matrix[i][k] * right[k]).sum();
            right[i] = (right[i] - known) / matrix[i][i];
        }
        right
    }

    fn residuals() -> impl Strategy<Value = Vec<Residual>> {
        let derivatives = proptest::collection::btree_map(0..12usize, -2.0..2.0f64, 1..4);
        proptest::collection::vec((-1.0..1.0f64, 0.1..3.0f64, derivatives.prop_map(|map| map.into_iter().collect())), 1..40)
    }

    proptest! {
        #[test]
        fn the_solution_is_that_of_the_full_matrix(residuals in residuals(), work in 1..50usize) {
            let mut first: Vec<usize> = (0..12).collect();
            let mut full = vec![vec![0.0; 12]; 12];
            let mut right = vec![0.0; 12];
            for (e, w, derivatives) in &residuals {
                for &(i, a) in derivatives {
                    right[i] -= w * a * e;
                    for &(j, b) in derivatives {
                        first[i.max(j)] = first[i.max(j)].min(i.min(j));
                        full[i][j] += w * a * b;
                    }
                }
            }
            let mut envelope = Envelope::new(first);
            residuals.iter().for_each(|(e, w, derivatives)| envelope.add(*e, *w, derivatives));
            envelope.damp(0.5);
            (0..12).for_each(|i| full[i][i] += 0.5);
            while !envelope.eliminate(work).unwrap() {}
            for (found, expected) in envelope.solve().iter().zip(solved(full, right)) {
                prop_assert!((found - expected).abs() < 1e-9, "{found} {expected}");
            }
        }

        #[test]
        fn slices_do_not_change_a_bit(residuals in residuals(), work in 1..50usize) {
            let build = || {
                let mut envelope = Envelope::new(vec![0; 12]);
                residuals.iter().for_each(|(e, w, derivatives)| envelope.add(*e, *w, derivatives));
                envelope.damp(0.5);
                envelope
            };
            let (mut sliced, mut whole_matrix) = (build(), build());
            while !sliced.eliminate(work).unwrap() {}
            prop_assert!(whole_matrix.eliminate(usize::MAX).unwrap());
            prop_assert_eq!(sliced.solve(), whole_matrix.solve());
        }
    }

    #[test]
    fn a_matrix_that_is_not_positive_is_refused() {
        assert_eq!(Envelope::new(vec![0, 0]).eliminate(usize::MAX), Err(Singular));
        let mut envelope = Envelope::new(vec![0]);
        envelope.add(0.0, f64::NAN, &[(0, 1.0)]);
        assert_eq!(envelope.eliminate(usize::MAX), Err(Singular));
    }
}
