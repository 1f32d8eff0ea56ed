//! Rows that are kept out of an estimate.

/// Rows kept out of the estimate: those whose number modulo `every` is one of `rows`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Holdout {
    /// The length of the pattern \[rows\].
    pub every: usize,
    /// The rows of the pattern held out, from 0, ascending; neither none nor all of them.
    pub rows: Vec<usize>,
}

impl Holdout {
    /// Whether the row with this number, counted from 0 after selection, is held out.
    #[must_use]
    pub fn holds_out(&self, row: usize) -> bool {
        row.checked_rem(self.every)
            .is_some_and(|rest| self.rows.binary_search(&rest).is_ok())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn holdout_counts_modulo() {
        let holdout = Holdout {
            every: 10,
            rows: vec![0, 3, 7],
        };
        let held: Vec<usize> = (0..20).filter(|&row| holdout.holds_out(row)).collect();
        assert_eq!(held, [0, 3, 7, 10, 13, 17]);
        let odd = Holdout {
            every: 0,
            rows: vec![0],
        };
        assert!(!odd.holds_out(3));
    }
}
