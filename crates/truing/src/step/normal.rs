//! The normal matrix H = AᵀA of a sparse A, panel by panel.

use super::Quadratic;
use super::jacobian::ScaledJacobian;

/// H = AᵀA (upper triangle, compressed columns, the diagonal last in every column and always there).
///
/// Successive rows with entries in the same columns are a panel P (rows × columns), as a constraint
/// writes it, and H = Σ PᵀP. Where each product goes is found once; columns that follow each other
/// are neighbours in H too, so that one place serves a whole run of them. New numbers cost
/// Σ rows · (entries a row)² multiplications and no allocation.
#[derive(Debug, Clone, Default)]
pub(super) struct Normal {
    /// Start of every column: n + 1 numbers.
    pub starts: Vec<usize>,
    /// Row of every entry, ascending.
    pub rows: Vec<usize>,
    /// The entries.
    pub values: Vec<f64>,
    patterns: Vec<Pattern>,
    /// For every panel: its pattern, its number of rows, and where its firsts begin.
    panels: Vec<(usize, usize, usize)>,
    /// The first entry of a panel in each of its columns.
    firsts: Vec<usize>,
}

/// The columns of a panel.
#[derive(Debug, Clone)]
struct Pattern {
    columns: Vec<usize>,
    /// Runs of successive columns: ranges of `columns`.
    runs: Vec<(usize, usize)>,
    /// For every column, for every run that begins at or before it: where the run's first product
    /// goes in `values`.
    places: Vec<usize>,
}

/// Rows of a panel are taken at most so many at a time, so that they stay in the cache.
const PANEL_ROWS: usize = 128;

impl Normal {
    /// Finds the pattern.
    pub fn new(a: &ScaledJacobian) -> Self {
        let n = a.cols();
        let mut normal = Self::default();
        normal.find_panels(a);
        // Which patterns have a column.
        let mut holders = vec![Vec::new(); n];
        for (i, pattern) in normal.patterns.iter().enumerate() {
            pattern.columns.iter().for_each(|k| holders[*k].push(i));
        }
        let mut seen = vec![usize::MAX; n];
        normal.starts.push(0);
        for k in 0..n {
            let first = normal.rows.len();
            for pattern in &holders[k] {
                for i in &normal.patterns[*pattern].columns {
                    if *i > k {
                        break;
                    }
                    if seen[*i] != k {
                        seen[*i] = k;
                        normal.rows.push(*i);
                    }
                }
            }
            if seen[k] != k {
                normal.rows.push(k);
            }
            normal.rows[first..].sort_unstable();
            normal.starts.push(normal.rows.len());
        }
        normal.values = vec![0.0; normal.rows.len()];
        for pattern in &mut normal.patterns {
            for k in &pattern.columns {
                let (start, end) = (normal.starts[*k], normal.starts[k + 1]);
                let column = &normal.rows[start..end];
                for (first, _) in &pattern.runs {
                    let i = pattern.columns[*first];
                    if i > *k {
                        break;
                    }
                    let place = column.partition_point(|row| *row < i);
                    pattern.places.push(start + place);
                }
            }
        }
        normal
    }

    /// Finds rows in succession with the same columns.
    fn find_panels(&mut self, a: &ScaledJacobian) {
        // The transpose: for every row its columns and where their entries are.
        let mut row_starts = vec![0; a.rows + 1];
        a.indices.iter().for_each(|row| row_starts[row + 1] += 1);
        for row in 0..a.rows {
            row_starts[row + 1] += row_starts[row];
        }
        let mut cursor = row_starts.clone();
        let mut across = vec![(0, 0); a.indices.len()];
        for k in 0..a.cols() {
            for entry in a.starts[k]..a.starts[k + 1] {
                let place = &mut cursor[a.indices[entry]];
                across[*place] = (k, entry);
                *place += 1;
            }
        }
        let mut last: Option<usize> = None;
        for row in 0..a.rows {
            let entries = &across[row_starts[row]..row_starts[row + 1]];
            if entries.is_empty() {
                last = None;
                continue;
            }
            let columns = || entries.iter().map(|(k, _)| *k);
            let before = last.map(|before| &across[row_starts[before]..row_starts[before + 1]]);
            let same = before.is_some_and(|before| before.iter().map(|(k, _)| *k).eq(columns()));
            last = Some(row);
            if !same {
                let columns: Vec<usize> = columns().collect();
                let mut runs: Vec<(usize, usize)> = Vec::new();
                for i in 0..columns.len() {
                    match runs.last_mut() {
                        Some((_, end)) if columns[i] == columns[i - 1] + 1 => *end = i + 1,
                        _ => runs.push((i, i + 1)),
                    }
                }
                self.patterns.push(Pattern {
                    columns,
                    runs,
                    places: Vec::new(),
                });
            }
            match self.panels.last_mut() {
                Some((_, rows, _)) if same && *rows < PANEL_ROWS => *rows += 1,
                _ => {
                    let firsts = self.firsts.len();
                    self.panels.push((self.patterns.len() - 1, 1, firsts));
                    self.firsts.extend(entries.iter().map(|(_, entry)| *entry));
                }
            }
        }
    }

    /// The numbers, for an A of the structure that it was made for.
    pub fn update(&mut self, a: &ScaledJacobian) {
        self.values.fill(0.0);
        for (pattern, rows, firsts) in &self.panels {
            let pattern = &self.patterns[*pattern];
            let entries = |i: usize| {
                let first = self.firsts[firsts + i];
                &a.values[first..first + rows]
            };
            let mut places = pattern.places.iter();
            for k in 0..pattern.columns.len() {
                let right = entries(k);
                for (first, end) in pattern.runs.iter().take_while(|(first, _)| *first <= k) {
                    let Some(place) = places.next() else { break };
                    for i in *first..(*end).min(k + 1) {
                        let product: f64 = (entries(i).iter().zip(right)).map(|(a, b)| a * b).sum();
                        self.values[place + i - first] += product;
                    }
                }
            }
        }
    }

    /// With q, for a quadratic program.
    pub fn quadratic(&self, linear: Vec<f64>) -> Quadratic {
        Quadratic {
            starts: self.starts.clone(),
            rows: self.rows.clone(),
            values: self.values.clone(),
            linear,
        }
    }
}
