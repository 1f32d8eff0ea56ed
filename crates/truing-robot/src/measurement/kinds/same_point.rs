//! The same point, reached in different postures.

use crate::error::Error;
use crate::measurement::at::At;
use crate::measurement::draw::{ConditionRow, Draw};
use crate::measurement::equations::Equations;
use crate::measurement::fit::mean;
use crate::measurement::groups::Rows;
use crate::measurement::kind::{Grouping, Kind, Placed, Scene};
use crate::measurement::measurand::Measurand;
use crate::measurement::places::Places;
use crate::measurement::set::MeasurementSet;
use crate::robot::Chain;
use crate::robot::chain::{reference_or_regressor, regressor_at, write_block, write_tip};
use crate::text::{InputError, ManyOf, Section, Units};
use crate::unknown::{Unknown, Value};
use std::sync::Arc;
use truing::manifold::{Point3, Vector};
use truing::nalgebra::{SMatrix, Vector3};
use truing::{Constraint, Jacobian, Point, Scalar, Views, autodiff};

/// A tool point at a point of space that is estimated: r = base_from_tool · target − point \[m\].
///
/// Variables: robot parameters, the target in the tool frame, the point. Three rows. All rows that
/// touched the same point share its variable ("position link", no external sensor).
#[derive(Clone)]
pub struct SamePoint {
    /// The robot.
    pub chain: Arc<Chain>,
    /// Joint values.
    pub q: Vec<f64>,
}

impl Constraint for SamePoint {
    type Vars = (Vector, Point3, Point3);
    const DIM: usize = 3;

    fn residual<T: Scalar>(&self, (robot, target, point): Views<'_, Self, T>, r: &mut [T]) {
        let tip = self.chain.tip(robot, &self.q, &target);
        for i in 0..3 {
            r[i] = tip[i] - point[i];
        }
    }

    fn linearize(&self, at: &mut Point<'_, Self::Vars>, r: &mut [f64], j: &mut Jacobian<'_>) {
        let Some(source) = reference_or_regressor(self, &self.chain, at, r, j) else {
            return;
        };
        let (parameters, target, point) = at.views();
        let regressor = regressor_at(at, source, &self.chain, parameters, &self.q);
        let tip = regressor.tool.apply(&target);
        let inputs = [tip.x, tip.y, tip.z, point.x, point.y, point.z];
        let (value, gradient): ([f64; 3], SMatrix<f64, 3, 6>) =
            autodiff::small(&inputs, |x, out| {
                let difference = Vector3::new(x[0], x[1], x[2]) - Vector3::new(x[3], x[4], x[5]);
                out.copy_from_slice(difference.as_slice());
            });
        r.copy_from_slice(&value);
        write_tip(
            j,
            0,
            1,
            regressor,
            &tip,
            &gradient.fixed_columns::<3>(0).into_owned(),
        );
        write_block(j, 2, &gradient.fixed_columns::<3>(3).into_owned());
    }
}

/// Visits of points that are estimated: kind `same-point`, one point a group.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct PointVisits;

/// Visits of points that are estimated by the tool of robot number 0; rows of equal labels visited the same
/// point.
pub fn same_point(
    name: impl Into<String>,
    q: Vec<Vec<f64>>,
    points: impl IntoIterator<Item = impl Into<String>>,
) -> MeasurementSet {
    let rows = q.len();
    MeasurementSet::new(name, PointVisits, q, Rows::repeated(&[], rows)).groups(points)
}

impl Kind for PointVisits {
    fn name(&self) -> &'static str {
        "same-point"
    }

    fn measurands(&self) -> &'static [Measurand] {
        &[Measurand::POSITION]
    }

    fn grouping(&self) -> Option<Grouping> {
        Some(Grouping {
            group: "point",
            rows: ["visit", "visits"],
            least: 2,
            alone: false,
            asked: 1,
            steps: false,
        })
    }

    fn unknowns(&self) -> Vec<Unknown> {
        vec![Unknown::place("point").comparing()]
    }

    fn start(&self, at: &At<'_>, group: usize) -> Vec<Value> {
        vec![Value::of::<Point3>(mean(&at.tips(group)))]
    }

    fn equations(&self, on: &mut Equations<'_>) -> Result<(), Error> {
        on.add(|on, row| {
            let tool = &on.tools[0];
            let visit = SamePoint {
                chain: tool.chain.clone(),
                q: on.q(0, row),
            };
            ((tool.robot, tool.point(), on.unknown("point", row)), visit)
        })
    }

    fn scene_keys(&self) -> &'static [&'static str] {
        &["points"]
    }

    fn scene(&self, table: &mut Section<'_>) -> Result<Scene, InputError> {
        let points = table.many("points", "points", |item| item.point(&Units::SI))?;
        Ok(match points {
            ManyOf::Drawn(n) => Scene::drawn(n),
            ManyOf::Listed(all) => {
                let one = |point| vec![Value::of::<Point3>(point)];
                Scene::given(all.into_iter().map(one).collect())
            }
        })
    }

    fn place(&self, places: &mut Places<'_>) -> Placed {
        vec![Value::of::<Point3>(places.point())].into()
    }

    fn draw(&self, draw: &mut Draw<'_>) -> Result<Vec<f64>, Error> {
        let point = draw.own::<Point3>("point") + draw.normal() * draw.noise[0];
        let what = format!("point `{}`", draw.group_name());
        draw.reach(&what, 400, |tools| {
            ConditionRow::point(&tools[0].translation, &point).to_vec()
        })?;
        Ok(Vec::new())
    }
}
