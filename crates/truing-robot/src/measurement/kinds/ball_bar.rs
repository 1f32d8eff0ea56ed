//! Lengths from the tool point to an anchor: a ball bar, a draw wire, a laser distance sensor.

use crate::error::Error;
use crate::measurement::at::At;
use crate::measurement::draw::Draw;
use crate::measurement::equations::Equations;
use crate::measurement::fit::mean;
use crate::measurement::groups::Rows;
use crate::measurement::kind::{DataColumn, Grouping, Kind, Placed, Scene};
use crate::measurement::measurand::Measurand;
use crate::measurement::places::Places;
use crate::measurement::set::MeasurementSet;
use crate::robot::Chain;
use crate::robot::chain::{norm, reference_or_regressor, regressor_at, write_block, write_tip};
use crate::text::{InputError, ManyOf, Section, Units};
use crate::unknown::{Unknown, Value};
use std::sync::Arc;
use truing::manifold::{Point3, Vector};
use truing::nalgebra::{DMatrix, DVector, SMatrix, Vector3};
use truing::{Constraint, Jacobian, Point, Scalar, Views, autodiff};

/// The length from a tool point to an anchor: r = ‖base_from_tool · target − anchor‖ − length \[m\].
///
/// Variables: robot parameters, the target in the tool frame, the anchor (hold it where it is known). One row.
#[derive(Clone)]
pub struct AnchorLength {
    /// The robot.
    pub chain: Arc<Chain>,
    /// Joint values.
    pub q: Vec<f64>,
    /// The length that was read \[m\].
    pub length: f64,
}

impl Constraint for AnchorLength {
    type Vars = (Vector, Point3, Point3);
    const DIM: usize = 1;

    fn residual<T: Scalar>(&self, (robot, target, anchor): Views<'_, Self, T>, r: &mut [T]) {
        let tip = self.chain.tip(robot, &self.q, &target);
        r[0] = norm(&(tip - anchor)) - T::from(self.length);
    }

    fn linearize(&self, at: &mut Point<'_, Self::Vars>, r: &mut [f64], j: &mut Jacobian<'_>) {
        let Some(source) = reference_or_regressor(self, &self.chain, at, r, j) else {
            return;
        };
        let (parameters, target, anchor) = at.views();
        let regressor = regressor_at(at, source, &self.chain, parameters, &self.q);
        let tip = regressor.tool.apply(&target);
        let inputs = [tip.x, tip.y, tip.z, anchor.x, anchor.y, anchor.z];
        let (distance, by): ([f64; 1], SMatrix<f64, 1, 6>) = autodiff::small(&inputs, |x, out| {
            out[0] = norm(&(Vector3::new(x[0], x[1], x[2]) - Vector3::new(x[3], x[4], x[5])));
        });
        r[0] = distance[0] - self.length;
        let by_tip = by.fixed_columns::<3>(0).into_owned();
        write_tip(j, 0, 1, regressor, &tip, &by_tip);
        write_block(j, 2, &by.fixed_columns::<3>(3).into_owned());
    }
}

/// Lengths from the tool point to anchors: kind `ball-bar`, one anchor a group.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct BallBar {
    /// The anchor in the reference frame \[m\]; none where it is estimated.
    pub anchor: Option<Vector3<f64>>,
}

/// Lengths \[m\] from the tool point of robot number 0 to an anchor; none to estimate where that is.
pub fn ball_bar(
    name: impl Into<String>,
    q: Vec<Vec<f64>>,
    lengths: &[f64],
    anchor: Option<Vector3<f64>>,
) -> MeasurementSet {
    let lengths = Rows::from_rows(lengths.iter().map(|length| [*length]));
    MeasurementSet::new(name, BallBar { anchor }, q, lengths)
}

/// How far a singular value is from zero, as a ratio to the largest, if the tool points are not in a plane.
const IN_SPACE: f64 = 1e-3;

/// The anchor that lies at the lengths from the points, in the least-squares sense: ‖p − a‖² = l² is linear in a
/// and ‖a‖², and Gauss–Newton's steps go on from there. Points of one plane leave two anchors that mirror each
/// other: the one that the plane's normal points to is taken, upwards.
fn trilaterate(points: &[Vector3<f64>], lengths: &[f64]) -> Vector3<f64> {
    let centre = mean(points);
    let centred: Vec<Vector3<f64>> = points.iter().map(|p| p - centre).collect();
    let n = points.len();
    let squares: Vec<f64> = (0..n)
        .map(|i| centred[i].norm_squared() - lengths[i] * lengths[i])
        .collect();
    let average = squares.iter().sum::<f64>() / n.max(1) as f64;
    let rows = DMatrix::from_fn(n, 3, |i, k| 2.0 * centred[i][k]);
    let right = DVector::from_fn(n, |i, _| squares[i] - average);
    let Some(normal) = centred
        .iter()
        .map(|p| p * p.transpose())
        .reduce(|a, b| a + b)
    else {
        return centre;
    };
    let axes = normal.symmetric_eigen();
    let flattest = axes.eigenvalues.imin();
    let largest = axes.eigenvalues.max();
    let svd = rows.svd(true, true);
    let threshold = IN_SPACE * svd.singular_values.max();
    let Ok(solution) = svd.solve(&right, threshold) else {
        return centre;
    };
    let mut anchor = Vector3::new(solution[0], solution[1], solution[2]);
    if axes.eigenvalues[flattest] <= IN_SPACE * IN_SPACE * largest {
        let up: Vector3<f64> = axes.eigenvectors.column(flattest).into_owned();
        let up = if up.z < 0.0 { -up } else { up };
        let height = -average - anchor.norm_squared();
        anchor += up * height.max(0.0).sqrt();
    }
    for _ in 0..10 {
        let off: Vec<Vector3<f64>> = centred.iter().map(|p| anchor - p).collect();
        let by = DMatrix::from_fn(n, 3, |i, k| {
            off[i][k] / off[i].norm().max(f64::MIN_POSITIVE)
        });
        let error = DVector::from_fn(n, |i, _| lengths[i] - off[i].norm());
        let svd = by.svd(true, true);
        let threshold = IN_SPACE * svd.singular_values.max();
        let Ok(step) = svd.solve(&error, threshold) else {
            break;
        };
        let next = anchor + Vector3::new(step[0], step[1], step[2]);
        let misfit = |a: &Vector3<f64>| -> f64 {
            let apart = centred.iter().zip(lengths);
            apart.map(|(p, l)| ((a - p).norm() - l).powi(2)).sum()
        };
        // An undefined misfit ends it, too.
        let better = misfit(&next) < misfit(&anchor);
        if !better {
            break;
        }
        anchor = next;
    }
    centre + anchor
}

fn values(anchor: Vector3<f64>) -> Vec<Value> {
    vec![Value::of::<Point3>(anchor)]
}

impl Kind for BallBar {
    fn name(&self) -> &'static str {
        "ball-bar"
    }

    fn measurands(&self) -> &'static [Measurand] {
        &[Measurand::LENGTH]
    }

    fn columns(&self) -> &'static [DataColumn] {
        const COLUMNS: [DataColumn; 1] = [DataColumn::length("length")];
        &COLUMNS
    }

    fn check_row(&self, row: &mut [f64]) -> Result<bool, (String, String)> {
        if row[0] > 0.0 {
            return Ok(false);
        }
        let message = format!("the length is {}; expected more than 0", row[0]);
        let help = "give the whole length from the anchor to the tool point, not its change";
        Err((message, help.to_owned()))
    }

    fn grouping(&self) -> Option<Grouping> {
        let estimated = self.anchor.is_none();
        estimated.then_some(Grouping {
            group: "anchor",
            rows: ["length", "lengths"],
            least: 4,
            alone: true,
            asked: 1,
            steps: false,
        })
    }

    fn unknowns(&self) -> Vec<Unknown> {
        vec![Unknown::place("anchor").known(self.anchor.is_some())]
    }

    fn start(&self, at: &At<'_>, group: usize) -> Vec<Value> {
        if let Some(anchor) = self.anchor {
            return values(anchor);
        }
        let lengths: Vec<f64> = at
            .rows(group)
            .iter()
            .map(|row| at.values(*row)[0])
            .collect();
        values(trilaterate(&at.tips(group), &lengths))
    }

    fn equations(&self, on: &mut Equations<'_>) -> Result<(), Error> {
        on.add(|on, row| {
            let tool = &on.tools[0];
            let length = AnchorLength {
                chain: tool.chain.clone(),
                q: on.q(0, row),
                length: on.values(row)[0],
            };
            (
                (tool.robot, tool.point(), on.unknown("anchor", row)),
                length,
            )
        })
    }

    fn keys(&self) -> &'static [&'static str] {
        &["anchor"]
    }

    /// `[0.5, 0, 0.1]` or `"estimate"`.
    fn read(
        &self,
        table: &mut Section<'_>,
        units: &Units,
    ) -> Result<Option<Arc<dyn Kind>>, InputError> {
        let item = table.require("anchor", "expected a point [x, y, z] or \"estimate\"")?;
        let anchor = match item.is_estimate("a point [x, y, z]")? {
            true => None,
            false => Some(item.point(units)?),
        };
        Ok(Some(Arc::new(Self { anchor })))
    }

    fn written(&self) -> Vec<(&'static str, String)> {
        let known = self
            .anchor
            .map(|a| format!("[{:?}, {:?}, {:?}]", a.x, a.y, a.z));
        vec![("anchor", known.unwrap_or_else(|| "\"estimate\"".into()))]
    }

    fn scene_keys(&self) -> &'static [&'static str] {
        &["anchors"]
    }

    fn scene(&self, table: &mut Section<'_>) -> Result<Scene, InputError> {
        let anchors = table.many("anchors", "anchors", |item| item.point(&Units::SI))?;
        Ok(match anchors {
            ManyOf::Drawn(n) => Scene::drawn(n),
            ManyOf::Listed(all) => Scene::given(all.into_iter().map(values).collect()),
        })
    }

    fn place(&self, places: &mut Places<'_>) -> Placed {
        values(places.point()).into()
    }

    fn draw(&self, draw: &mut Draw<'_>) -> Result<Vec<f64>, Error> {
        let anchor = draw.own::<Point3>("anchor");
        let tip = draw.anywhere()[0].translation;
        Ok(vec![(tip - anchor).norm() + draw.error(0)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(points: &[Vector3<f64>], anchor: Vector3<f64>) -> Vector3<f64> {
        let lengths: Vec<f64> = points.iter().map(|p| (p - anchor).norm()).collect();
        trilaterate(points, &lengths)
    }

    #[test]
    fn an_anchor_is_found_from_exact_lengths() {
        let anchor = Vector3::new(0.3, -0.4, 1.2);
        let corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]];
        let points = corners.map(|c| Vector3::from(c.map(f64::from)) * 0.5);
        assert!((found(&points, anchor) - anchor).norm() < 1e-12);
    }

    #[test]
    fn of_points_in_a_plane_the_upper_anchor_is_taken() {
        let anchor = Vector3::new(0.3, -0.4, 1.2);
        let corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]];
        let points = corners.map(|c| Vector3::from(c.map(f64::from)) * 0.5);
        assert!((found(&points, anchor) - anchor).norm() < 1e-12);
    }

    #[test]
    fn a_single_point_and_none_give_a_finite_anchor() {
        let point = Vector3::new(0.1, 0.2, 0.3);
        let anchor = trilaterate(&[point], &[0.5]);
        assert!(anchor.iter().all(|c| c.is_finite()), "{anchor}");
    }
}
