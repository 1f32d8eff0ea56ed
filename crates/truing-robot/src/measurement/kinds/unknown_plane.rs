//! A touch of the tool point on a plane that is estimated.

use super::known_plane::{drawn, plane_distance, touching};
use crate::error::Error;
use crate::measurement::at::At;
use crate::measurement::draw::Draw;
use crate::measurement::equations::Equations;
use crate::measurement::fit::best_fit_plane;
use crate::measurement::groups::Rows;
use crate::measurement::kind::{Grouping, Kind, Placed, Scene, Touched};
use crate::measurement::measurand::Measurand;
use crate::measurement::places::Places;
use crate::measurement::set::MeasurementSet;
use crate::robot::Chain;
use crate::robot::chain::{reference_or_regressor, regressor_at, write_block, write_tip};
use crate::text::{InputError, ManyOf, Section, Units};
use crate::unknown::{Unknown, Value};
use std::sync::Arc;
use truing::manifold::{Plane3, Point3, Vector};
use truing::nalgebra::{SMatrix, Vector3};
use truing::{Constraint, Jacobian, Point, Scalar, Variable, Views, autodiff};

/// A tool point on an unknown plane: r = normal · p − distance \[m\], p = base_from_tool · target.
///
/// Variables: robot parameters, the target in the tool frame, the plane. One row.
#[derive(Clone)]
pub struct UnknownPlane {
    /// The robot.
    pub chain: Arc<Chain>,
    /// Joint values.
    pub q: Vec<f64>,
}

impl Constraint for UnknownPlane {
    type Vars = (Vector, Point3, Plane3);
    const DIM: usize = 1;

    fn residual<T: Scalar>(&self, (robot, target, plane): Views<'_, Self, T>, r: &mut [T]) {
        r[0] = plane.signed_distance(&self.chain.tip(robot, &self.q, &target));
    }

    fn linearize(&self, at: &mut Point<'_, Self::Vars>, r: &mut [f64], j: &mut Jacobian<'_>) {
        let Some(source) = reference_or_regressor(self, &self.chain, at, r, j) else {
            return;
        };
        let (parameters, target, _) = at.views();
        let stored = at.raw(2);
        let regressor = regressor_at(at, source, &self.chain, parameters, &self.q);
        let tip = regressor.tool.apply(&target);
        let (value, gradient): ([f64; 1], SMatrix<f64, 1, 6>) =
            autodiff::small(&[tip.x, tip.y, tip.z, 0.0, 0.0, 0.0], |x, out| {
                let mut moved = [x[0]; 4];
                Plane3::plus(stored, &x[3..6], &mut moved);
                out[0] = Plane3::view(&moved).signed_distance(&Vector3::new(x[0], x[1], x[2]));
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

/// Touches of planes that are estimated: kind `unknown-plane`, one plane a group.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct UnknownPlaneTouches {
    /// In simulations, how far from the origin planes are that are drawn \[m\]; none for planes through a point
    /// within reach.
    pub drawn_at: Option<f64>,
}

/// Touches of planes that are estimated by the tool of robot number 0; rows of equal labels touched the
/// same plane.
pub fn unknown_plane(
    name: impl Into<String>,
    q: Vec<Vec<f64>>,
    planes: impl IntoIterator<Item = impl Into<String>>,
) -> MeasurementSet {
    let rows = q.len();
    let kind = UnknownPlaneTouches::default();
    MeasurementSet::new(name, kind, q, Rows::repeated(&[], rows)).groups(planes)
}

impl Kind for UnknownPlaneTouches {
    fn name(&self) -> &'static str {
        "unknown-plane"
    }

    fn measurands(&self) -> &'static [Measurand] {
        &[Measurand::LENGTH]
    }

    fn grouping(&self) -> Option<Grouping> {
        Some(Grouping {
            group: "plane",
            rows: ["touch", "touches"],
            least: 4,
            alone: true,
            asked: 1,
            steps: true,
        })
    }

    fn unknowns(&self) -> Vec<Unknown> {
        vec![Unknown::place("plane")]
    }

    fn start(&self, at: &At<'_>, group: usize) -> Vec<Value> {
        vec![Value::of::<Plane3>(best_fit_plane(&at.tips(group)))]
    }

    fn equations(&self, on: &mut Equations<'_>) -> Result<(), Error> {
        on.add(|on, row| {
            let tool = &on.tools[0];
            let touch = UnknownPlane {
                chain: tool.chain.clone(),
                q: on.q(0, row),
            };
            ((tool.robot, tool.point(), on.unknown("plane", row)), touch)
        })
    }

    fn touched(&self) -> Option<Touched> {
        Some(Touched::Unknown("plane"))
    }

    fn scene_keys(&self) -> &'static [&'static str] {
        &["planes", "plane_distance"]
    }

    fn scene(&self, table: &mut Section<'_>) -> Result<Scene, InputError> {
        let planes = table.many("planes", "planes", |item| item.plane(&Units::SI))?;
        let given = matches!(planes, ManyOf::Listed(_));
        let drawn_at = plane_distance(table, given)?;
        Ok(match planes {
            ManyOf::Drawn(n) => Scene::drawn(n),
            ManyOf::Listed(all) => {
                let one = |plane| vec![Value::of::<Plane3>(plane)];
                Scene::given(all.into_iter().map(one).collect())
            }
        }
        .of(Self { drawn_at }))
    }

    fn place(&self, places: &mut Places<'_>) -> Placed {
        vec![Value::of::<Plane3>(drawn(places, self.drawn_at))].into()
    }

    fn draw(&self, draw: &mut Draw<'_>) -> Result<Vec<f64>, Error> {
        let mut plane = draw.own::<Plane3>("plane");
        plane.distance += draw.error(0);
        let what = format!("plane `{}`", draw.group_name());
        draw.reach(&what, 400, touching(plane))?;
        Ok(Vec::new())
    }
}
