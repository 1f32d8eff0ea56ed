//! The same location, a position with an orientation, reached in different postures.

use super::pose::MeasuredPose;
use crate::error::Error;
use crate::measurement::at::At;
use crate::measurement::draw::{ConditionRow, Draw};
use crate::measurement::equations::Equations;
use crate::measurement::fit::{mean, nearest_rotation};
use crate::measurement::groups::Rows;
use crate::measurement::kind::{Grouping, Kind, Placed, Scene};
use crate::measurement::measurand::Measurand;
use crate::measurement::places::Places;
use crate::measurement::set::MeasurementSet;
use crate::text::{InputError, ManyOf, Section, Units};
use crate::unknown::{Unknown, Value};
use truing::manifold::{Pose, Pose3, so3};
use truing::nalgebra::Vector3;

/// Visits of locations that are estimated: kind `same-location`, one location a group ("frame link").
///
/// The tool, seen from the location, stands at the identity: the equation is [`MeasuredPose`] with the
/// location as the sensor.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct LocationVisits;

/// Visits of locations that are estimated by the tool of robot number 0; rows of equal labels visited the same
/// location.
pub fn same_location(
    name: impl Into<String>,
    q: Vec<Vec<f64>>,
    locations: impl IntoIterator<Item = impl Into<String>>,
) -> MeasurementSet {
    let rows = q.len();
    MeasurementSet::new(name, LocationVisits, q, Rows::repeated(&[], rows)).groups(locations)
}

impl Kind for LocationVisits {
    fn name(&self) -> &'static str {
        "same-location"
    }

    fn measurands(&self) -> &'static [Measurand] {
        &[Measurand::POSITION, Measurand::ROTATION]
    }

    fn grouping(&self) -> Option<Grouping> {
        Some(Grouping {
            group: "location",
            rows: ["visit", "visits"],
            least: 2,
            alone: false,
            // One location is reached in few postures: it takes several.
            asked: 8,
            steps: false,
        })
    }

    fn unknowns(&self) -> Vec<Unknown> {
        vec![Unknown::place("location")]
    }

    fn start(&self, at: &At<'_>, group: usize) -> Vec<Value> {
        let rotations = at.readings.groups.rows(group);
        let rotations = rotations.map(|row| at.flange(0, row).rotation);
        vec![Value::of::<Pose3>(Pose {
            rotation: nearest_rotation(&rotations.sum()),
            translation: mean(&at.tips(group)),
        })]
    }

    fn equations(&self, on: &mut Equations<'_>) -> Result<(), Error> {
        on.add(|on, row| {
            let tool = &on.tools[0];
            let visit = MeasuredPose {
                chain: tool.chain.clone(),
                q: on.q(0, row),
                measured: Pose::identity(),
            };
            (
                (tool.robot, on.unknown("location", row), tool.point()),
                visit,
            )
        })
    }

    fn scene_keys(&self) -> &'static [&'static str] {
        &["locations"]
    }

    fn scene(&self, table: &mut Section<'_>) -> Result<Scene, InputError> {
        let locations = table.many("locations", "locations", |item| item.pose(&Units::SI))?;
        Ok(match locations {
            ManyOf::Drawn(n) => Scene::drawn(n),
            ManyOf::Listed(all) => {
                let one = |location| vec![Value::of::<Pose3>(location)];
                Scene::given(all.into_iter().map(one).collect())
            }
        })
    }

    fn place(&self, places: &mut Places<'_>) -> Placed {
        vec![Value::of::<Pose3>(places.location())].into()
    }

    fn draw(&self, draw: &mut Draw<'_>) -> Result<Vec<f64>, Error> {
        let location = draw.own::<Pose3>("location");
        let turn = so3::exp_matrix((draw.normal() * draw.noise[1]).as_slice());
        let location = Pose {
            translation: location.translation + draw.normal() * draw.noise[0],
            rotation: location.rotation * turn,
        };
        let what = format!("location `{}`", draw.group_name());
        // A location leaves no joint free: few starts lead there.
        draw.reach(&what, 2_000, |tools| at_location(&tools[0], &location))?;
        Ok(Vec::new())
    }
}

/// tip − position = 0 and log(R_tool · Rᵀ) = 0, six rows [m, rad]; the latter's derivatives are to first order in
/// the angle that is left: enough for Newton's steps to end at zero.
fn at_location(tool: &Pose<f64>, location: &Pose<f64>) -> Vec<ConditionRow> {
    let off = so3::log_matrix(&(tool.rotation * location.rotation.transpose()));
    let mut rows = ConditionRow::point(&tool.translation, &location.translation).to_vec();
    rows.extend((0..3).map(|k| ConditionRow::turned(off[k], Vector3::ith(k, 1.0))));
    rows
}
