//! Postures that are near each other, whatever their order.

use crate::measurement::MeasurementSet;
use crate::robot::{Arm, posture};
use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;

/// Postures that differ by less than this part of the joints' ranges are the same.
const SAME: f64 = 1e-5;

/// Postures near each other. The largest is cut first.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
struct Leaf {
    len: usize,
    /// Of leaves that are as large the first row decides.
    first: Reverse<usize>,
    rows: Vec<usize>,
}

/// The number of the cluster of every row of a set: at most `most` of them, each of postures that are near each
/// other, and all rows of one posture in one cluster.
///
/// Postures are halved at the median of the number that varies most beside its range, then the larger half, and so
/// on (Bentley 1975, k-d trees): no unit and no chance has a part in it.
pub fn clusters(arms: &[Arm], set: &MeasurementSet, most: usize) -> Vec<usize> {
    let mut places = vec![Vec::new(); set.len()];
    for tool in &set.tools {
        // What is derived from a row stands behind what has limits, and says nothing of its own.
        let limits = posture::limits(&arms[tool.robot].robot);
        for (place, q) in places.iter_mut().zip(&tool.q) {
            let parts = q.iter().zip(&limits);
            place.extend(parts.map(|(q, [low, high])| q / (high - low).max(f64::MIN_POSITIVE)));
        }
    }
    // In an order of their own, whatever that in the file is.
    let mut order: Vec<usize> = (0..set.len()).collect();
    let by_place = |a: &usize, b: &usize| {
        let pairs = places[*a].iter().zip(&places[*b]);
        pairs
            .map(|(a, b)| a.total_cmp(b))
            .find(|o| o.is_ne())
            .unwrap_or(Ordering::Equal)
    };
    order.sort_by(by_place);
    let places: Vec<Vec<f64>> = order
        .iter()
        .map(|row| std::mem::take(&mut places[*row]))
        .collect();
    let leaf = |rows: Vec<usize>| Leaf {
        len: rows.len(),
        first: Reverse(rows.first().copied().unwrap_or_default()),
        rows,
    };
    let mut open = BinaryHeap::from([leaf((0..set.len()).collect())]);
    let mut done = Vec::new();
    while done.len() + open.len() < most {
        let Some(largest) = open.pop() else { break };
        match cut(&places, &largest.rows) {
            Some((number, at)) => {
                let halves: (Vec<usize>, Vec<usize>) =
                    (largest.rows.into_iter()).partition(|row| places[*row][number] <= at);
                open.push(leaf(halves.0));
                open.push(leaf(halves.1));
            }
            None => done.push(largest),
        }
    }
    done.extend(open);
    let mut of_row = vec![0; set.len()];
    for (cluster, leaf) in done.iter().enumerate() {
        leaf.rows
            .iter()
            .for_each(|row| of_row[order[*row]] = cluster);
    }
    of_row
}

/// How many different postures a set has.
pub fn postures(arms: &[Arm], set: &MeasurementSet) -> usize {
    let last = clusters(arms, set, set.len()).into_iter().max();
    last.map_or(0, |last| last + 1)
}

/// Which number of some postures varies most, and at which value to cut it; none if all are the same.
fn cut(places: &[Vec<f64>], rows: &[usize]) -> Option<(usize, f64)> {
    let numbers = places.get(*rows.first()?)?.len();
    let values = |number: usize| rows.iter().map(move |row| places[*row][number]);
    let spread = |number: &usize| {
        let (low, high) = values(*number).fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| {
            (l.min(x), h.max(x))
        });
        high - low
    };
    let number = (0..numbers).max_by(|a, b| spread(a).total_cmp(&spread(b)).then(b.cmp(a)))?;
    let mut values: Vec<f64> = values(number).collect();
    values.sort_by(f64::total_cmp);
    let (first, last) = (*values.first()?, *values.last()?);
    if last - first <= SAME {
        return None;
    }
    let median = values[(values.len() - 1) / 2];
    let below = values.iter().rfind(|x| **x < last)?;
    Some((number, median.min(*below)))
}
