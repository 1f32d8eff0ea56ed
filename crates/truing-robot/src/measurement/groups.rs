//! Rows that belong together, and numbers of every row.

/// Rows that belong together: touches of one plane, visits of one point. Rows of kinds without groups
/// are one group without a name.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Groups {
    /// Names, in order of appearance.
    pub names: Vec<String>,
    /// The group of every row.
    pub of_row: Vec<usize>,
}

impl Groups {
    /// One group without a name.
    pub fn single(rows: usize) -> Self {
        Self {
            names: vec![String::new()],
            of_row: vec![0; rows],
        }
    }

    /// Groups rows by equal labels.
    pub fn by_label(labels: impl IntoIterator<Item = impl Into<String>>) -> Self {
        let mut groups = Self::default();
        for label in labels {
            let label = label.into();
            let known = groups.names.iter().position(|name| *name == label);
            groups.of_row.push(known.unwrap_or(groups.names.len()));
            if known.is_none() {
                groups.names.push(label);
            }
        }
        groups
    }

    /// How many groups there are.
    pub fn len(&self) -> usize {
        self.names.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.names.is_empty()
    }

    /// How many rows each group has.
    pub fn counts(&self) -> Vec<usize> {
        let mut counts = vec![0; self.names.len()];
        self.of_row.iter().for_each(|g| counts[*g] += 1);
        counts
    }

    /// The rows of a group.
    pub fn rows(&self, group: usize) -> impl Iterator<Item = usize> + '_ {
        let of_row = self.of_row.iter().enumerate();
        of_row
            .filter(move |(_, g)| **g == group)
            .map(|(row, _)| row)
    }
}

/// Numbers of every row, as many in each.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Rows {
    width: usize,
    numbers: Vec<f64>,
}

impl Rows {
    /// No rows of a width.
    pub fn new(width: usize) -> Self {
        Self {
            width,
            numbers: Vec::new(),
        }
    }

    /// The same numbers in every row.
    pub fn repeated(row: &[f64], rows: usize) -> Self {
        Self {
            width: row.len(),
            numbers: row.repeat(rows),
        }
    }

    /// Rows from arrays.
    pub fn from_rows<const N: usize>(rows: impl IntoIterator<Item = [f64; N]>) -> Self {
        Self {
            width: N,
            numbers: rows.into_iter().flatten().collect(),
        }
    }

    /// Adds a row.
    ///
    /// # Panics
    /// If it is of another width.
    #[track_caller]
    pub fn push(&mut self, row: &[f64]) {
        assert_eq!(row.len(), self.width, "a row of another width");
        self.numbers.extend_from_slice(row);
    }

    /// Numbers in a row.
    pub fn width(&self) -> usize {
        self.width
    }

    /// All numbers, row after row.
    pub fn as_slice(&self) -> &[f64] {
        &self.numbers
    }

    /// A row.
    #[track_caller]
    pub fn row(&self, row: usize) -> &[f64] {
        &self.numbers[row * self.width..(row + 1) * self.width]
    }

    /// A row, to be changed.
    #[track_caller]
    pub fn row_mut(&mut self, row: usize) -> &mut [f64] {
        &mut self.numbers[row * self.width..(row + 1) * self.width]
    }

    /// Some of the rows, in the given order.
    #[must_use]
    pub fn pick(&self, rows: &[usize]) -> Self {
        let mut picked = Self::new(self.width);
        rows.iter().for_each(|row| picked.push(self.row(*row)));
        picked
    }
}
