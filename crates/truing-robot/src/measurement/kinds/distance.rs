//! The distance between two tool points: two arms touching, or one robot in two postures.

use crate::error::Error;
use crate::measurement::at::At;
use crate::measurement::draw::{ConditionRow, Draw};
use crate::measurement::equations::Equations;
use crate::measurement::groups::Rows;
use crate::measurement::kind::{Kind, Placed, Scene};
use crate::measurement::measurand::Measurand;
use crate::measurement::places::Places;
use crate::measurement::readings::Tool;
use crate::measurement::set::MeasurementSet;
use crate::robot::chain::{norm, reference_or_regressor, write_block, write_tip};
use crate::robot::{Chain, Regressor, Unit};
use crate::text::{Dimension, InputError, Section, Units};
use crate::unknown::{Unknown, Value};
use std::sync::Arc;
use truing::manifold::{Point3, Pose, Vector};
use truing::nalgebra::{SMatrix, Vector3};
use truing::{Constraint, Jacobian, Point, Scalar, Views, autodiff};

/// The distance between tool points of two robots: r = ‖p_a − p_b‖ − distance \[m\].
///
/// Variables: parameters and target of robot a, those of robot b, and the distance as a vector of
/// one number (hold it where it is known). One row. Two spheres that touch are at the sum of their
/// radii.
#[derive(Clone)]
pub struct Distance {
    /// Robot a.
    pub a: Arc<Chain>,
    /// Robot b.
    pub b: Arc<Chain>,
    /// Joint values of robot a.
    pub q_a: Vec<f64>,
    /// Joint values of robot b.
    pub q_b: Vec<f64>,
}

/// ‖a − b‖ − d with its gradient (1 × 7) in a, b and d.
fn gradient_of(a: &Vector3<f64>, b: &Vector3<f64>, d: f64) -> ([f64; 1], SMatrix<f64, 1, 7>) {
    autodiff::small(&[a.x, a.y, a.z, b.x, b.y, b.z, d], |x, out| {
        out[0] = norm(&(Vector3::new(x[0], x[1], x[2]) - Vector3::new(x[3], x[4], x[5]))) - x[6];
    })
}

#[derive(Default)]
struct Pair {
    a: Regressor,
    b: Regressor,
}

impl Constraint for Distance {
    type Vars = (Vector, Point3, Vector, Point3, Vector);
    const DIM: usize = 1;

    fn residual<T: Scalar>(&self, (a, target_a, b, target_b, d): Views<'_, Self, T>, r: &mut [T]) {
        let between = self.a.tip(a, &self.q_a, &target_a) - self.b.tip(b, &self.q_b, &target_b);
        r[0] = norm(&between) - d[0];
    }

    fn linearize(&self, at: &mut Point<'_, Self::Vars>, r: &mut [f64], j: &mut Jacobian<'_>) {
        let Some(source) = reference_or_regressor(self, &self.a, at, r, j) else {
            return;
        };
        let (a, target_a, b, target_b, d) = at.views();
        let pair = at.memory::<Pair>();
        source.regressor(&self.a.robot, a, &self.q_a, &mut pair.a);
        source.regressor(&self.b.robot, b, &self.q_b, &mut pair.b);
        let (tip_a, tip_b) = (pair.a.tool.apply(&target_a), pair.b.tool.apply(&target_b));
        let (value, gradient) = gradient_of(&tip_a, &tip_b, d[0]);
        r.copy_from_slice(&value);
        write_tip(
            j,
            0,
            1,
            &pair.a,
            &tip_a,
            &gradient.fixed_columns::<3>(0).into_owned(),
        );
        write_tip(
            j,
            2,
            3,
            &pair.b,
            &tip_b,
            &gradient.fixed_columns::<3>(3).into_owned(),
        );
        write_block(j, 4, &gradient.fixed_columns::<1>(6).into_owned());
    }
}

/// The distance between a tool point in two postures of one robot: r = ‖p(q_a) − p(q_b)‖ − distance \[m\].
///
/// Variables: robot parameters, the target in the tool frame, the distance as a vector of one
/// number. One row. A ball bar or a gauge block gives such data.
#[derive(Clone)]
pub struct PostureDistance {
    /// The robot.
    pub chain: Arc<Chain>,
    /// Joint values of the first posture.
    pub q_a: Vec<f64>,
    /// Joint values of the second posture.
    pub q_b: Vec<f64>,
}

impl Constraint for PostureDistance {
    type Vars = (Vector, Point3, Vector);
    const DIM: usize = 1;

    fn residual<T: Scalar>(&self, (robot, target, d): Views<'_, Self, T>, r: &mut [T]) {
        let between =
            self.chain.tip(robot, &self.q_a, &target) - self.chain.tip(robot, &self.q_b, &target);
        r[0] = norm(&between) - d[0];
    }

    fn linearize(&self, at: &mut Point<'_, Self::Vars>, r: &mut [f64], j: &mut Jacobian<'_>) {
        let Some(source) = reference_or_regressor(self, &self.chain, at, r, j) else {
            return;
        };
        let (parameters, target, d) = at.views();
        let pair = at.memory::<Pair>();
        source.regressor(&self.chain.robot, parameters, &self.q_a, &mut pair.a);
        source.regressor(&self.chain.robot, parameters, &self.q_b, &mut pair.b);
        let (tip_a, tip_b) = (pair.a.tool.apply(&target), pair.b.tool.apply(&target));
        let (value, gradient) = gradient_of(&tip_a, &tip_b, d[0]);
        r.copy_from_slice(&value);
        let by_a = gradient.fixed_columns::<3>(0).into_owned();
        let by_b = gradient.fixed_columns::<3>(3).into_owned();
        let twists = pair.a.twists.iter().zip(&pair.b.twists);
        for (entry, (a, b)) in j.block_mut(0).iter_mut().zip(twists) {
            *entry = (by_a * a.at(&tip_a) + by_b * b.at(&tip_b))[0];
        }
        write_block(
            j,
            1,
            &(by_a * pair.a.tool.rotation + by_b * pair.b.tool.rotation),
        );
        write_block(j, 2, &gradient.fixed_columns::<1>(6).into_owned());
    }
}

/// Distances between two tool points: kind `distance`, of two robots or of one in two postures.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Distances {
    /// The distance \[m\]; none where it is estimated.
    pub distance: Option<f64>,
}

/// Distances between the tool points of robots 0 and 1 \[m\]; none to estimate the distance.
pub fn distance(
    name: impl Into<String>,
    q: Vec<Vec<f64>>,
    q_b: Vec<Vec<f64>>,
    distance: Option<f64>,
) -> MeasurementSet {
    let second = Tool {
        robot: 1,
        q: q_b,
        ..Tool::default()
    };
    posture_distance(name, q, Vec::new(), distance).second(second)
}

/// Distances between the tool point of robot 0 in two postures \[m\]; none to estimate the distance.
pub fn posture_distance(
    name: impl Into<String>,
    q: Vec<Vec<f64>>,
    q_b: Vec<Vec<f64>>,
    distance: Option<f64>,
) -> MeasurementSet {
    let rows = q.len();
    let kind = Distances { distance };
    let second = Tool {
        q: q_b,
        ..Tool::default()
    };
    MeasurementSet::new(name, kind, q, Rows::repeated(&[], rows)).second(second)
}

fn value_of(distance: f64) -> Value {
    Value::number("distance", Unit::Meter, distance)
}

impl Kind for Distances {
    fn name(&self) -> &'static str {
        "distance"
    }

    fn measurands(&self) -> &'static [Measurand] {
        &[Measurand::LENGTH]
    }

    fn tools(&self) -> usize {
        2
    }

    fn unknowns(&self) -> Vec<Unknown> {
        vec![Unknown::place("distance").known(self.distance.is_some())]
    }

    fn start(&self, at: &At<'_>, group: usize) -> Vec<Value> {
        if let Some(distance) = self.distance {
            return vec![value_of(distance)];
        }
        let rows = at.rows(group);
        let apart = |row: &usize| (at.tip(0, *row) - at.tip(1, *row)).norm();
        let total: f64 = rows.iter().map(apart).sum();
        vec![value_of(total / rows.len().max(1) as f64)]
    }

    fn equations(&self, on: &mut Equations<'_>) -> Result<(), Error> {
        if on.readings.tools[0].robot == on.readings.tools[1].robot {
            return on.add(|on, row| {
                let tool = &on.tools[0];
                let distance = PostureDistance {
                    chain: tool.chain.clone(),
                    q_a: on.q(0, row),
                    q_b: on.q(1, row),
                };
                (
                    (tool.robot, tool.point(), on.unknown("distance", row)),
                    distance,
                )
            });
        }
        on.add(|on, row| {
            let (a, b) = (&on.tools[0], &on.tools[1]);
            let distance = Distance {
                a: a.chain.clone(),
                b: b.chain.clone(),
                q_a: on.q(0, row),
                q_b: on.q(1, row),
            };
            let vars = (
                a.robot,
                a.point(),
                b.robot,
                b.point(),
                on.unknown("distance", row),
            );
            (vars, distance)
        })
    }

    fn keys(&self) -> &'static [&'static str] {
        &["distance"]
    }

    /// `0.116`, `"116 mm"` or `"estimate"`.
    fn read(
        &self,
        table: &mut Section<'_>,
        units: &Units,
    ) -> Result<Option<Arc<dyn Kind>>, InputError> {
        let item = table.require("distance", "expected a length or \"estimate\"")?;
        if item.is_estimate("a length")? {
            return Ok(Some(Arc::new(Self { distance: None })));
        }
        let value = item.in_units(Dimension::Length, units)?;
        if value > 0.0 {
            let distance = Some(value);
            return Ok(Some(Arc::new(Self { distance })));
        }
        Err(item
            .error(format!("found {value}; expected more than 0"))
            .with_help("two points that meet are a `same-point`; balls that touch are the sum of their radii apart"))
    }

    fn written(&self) -> Vec<(&'static str, String)> {
        let known = self.distance.map(|d| format!("{d:?}"));
        vec![("distance", known.unwrap_or_else(|| "\"estimate\"".into()))]
    }

    fn scene_keys(&self) -> &'static [&'static str] {
        &["distance"]
    }

    fn scene(&self, table: &mut Section<'_>) -> Result<Scene, InputError> {
        let item = table.require("distance", "expected a length")?;
        let distance = item.size(Dimension::Length)?;
        let kind = Self {
            distance: Some(distance),
        };
        Ok(Scene::given(vec![vec![value_of(distance)]]).of(kind))
    }

    fn place(&self, places: &mut Places<'_>) -> Placed {
        let distance = places.distance();
        let kind = Self {
            distance: Some(distance),
        };
        Placed {
            kind: Some(Arc::new(kind)),
            values: vec![value_of(distance)],
        }
    }

    fn draw(&self, draw: &mut Draw<'_>) -> Result<Vec<f64>, Error> {
        let length = draw.own::<Vector>("distance")[0] + draw.error(0);
        draw.reach("the distance", 400, |tools| vec![apart(tools, length)])?;
        Ok(Vec::new())
    }
}

/// ‖tip_a − tip_b‖ − distance = 0.
fn apart(tools: &[Pose<f64>], distance: f64) -> ConditionRow {
    let between = tools[0].translation - tools[1].translation;
    let length = between.norm();
    let unit = if length > 0.0 {
        between / length
    } else {
        Vector3::x()
    };
    ConditionRow {
        value: length - distance,
        by: vec![(unit, Vector3::zeros()), (-unit, Vector3::zeros())],
    }
}
