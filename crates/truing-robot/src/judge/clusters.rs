//! Postures that are near each other, whatever their order.

use crate::measurement::MeasurementSet;
use crate::robot::{Arm, posture};

/// The number of the cluster of every row of a set: at most `most` of them, each of postures that are near each
/// other, and all rows of one posture in one cluster.
///
/// Postures are halved at the median of the number that varies most beside its range, then the larger half, and so
/// on (Bentley 1975, k-d trees): no order of rows, no unit and no chance has a part in it.
pub fn clusters(arms: &[Arm], set: &MeasurementSet, most: usize) -> Vec<usize> {
    let ranges: Vec<f64> = (set.tools.iter())
        .flat_map(|tool| posture::limits(&arms[tool.robot].robot))
        .map(|[lower, upper]| (upper - lower).max(f64::MIN_POSITIVE))
        .collect();
    let places: Vec<Vec<f64>> = (0..set.len())
        .map(|row| {
            let q = set.tools.iter().flat_map(|tool| &tool.q[row]);
            q.zip(&ranges).map(|(q, range)| q / range).collect()
        })
        .collect();
    let mut leaves: Vec<Vec<usize>> = vec![(0..set.len()).collect()];
    while leaves.len() < most {
        let cuts = leaves.iter().map(|leaf| widest(&places, leaf));
        let best = cuts
            .enumerate()
            .filter(|(_, cut)| cut.is_some())
            .max_by(|(a, _), (b, _)| leaves[*a].len().cmp(&leaves[*b].len()).then(b.cmp(a)));
        let Some((k, Some((number, at)))) = best else {
            break;
        };
        let leaf = std::mem::take(&mut leaves[k]);
        let (low, high) = leaf.into_iter().partition(|row| places[*row][number] <= at);
        leaves[k] = low;
        leaves.push(high);
    }
    let mut of_row = vec![0; set.len()];
    for (cluster, leaf) in leaves.iter().enumerate() {
        leaf.iter().for_each(|row| of_row[*row] = cluster);
    }
    of_row
}

/// Which number of the postures of a leaf varies most, and where to cut it; none if all are the same.
fn widest(places: &[Vec<f64>], leaf: &[usize]) -> Option<(usize, f64)> {
    let numbers = places.get(*leaf.first()?)?.len();
    let spread = |k: &usize| {
        let values = leaf.iter().map(|row| places[*row][*k]);
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| {
            (l.min(x), h.max(x))
        });
        high - low
    };
    let number = (0..numbers).max_by(|a, b| spread(a).total_cmp(&spread(b)).then(b.cmp(a)))?;
    let mut values: Vec<f64> = leaf.iter().map(|row| places[*row][number]).collect();
    values.sort_by(f64::total_cmp);
    let (first, last) = (values[0], *values.last()?);
    // Readings that jitter by less than this part of the range are one posture, measured again.
    if last - first <= SAME {
        return None;
    }
    let middle = values[(values.len() - 1) / 2];
    let at = if middle < last {
        middle
    } else {
        *values.iter().rfind(|x| **x < last)?
    };
    Some((number, at))
}

/// Postures that differ by less than this part of the joints' ranges are the same.
const SAME: f64 = 1e-5;
