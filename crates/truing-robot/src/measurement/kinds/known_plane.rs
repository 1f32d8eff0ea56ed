//! A touch of the tool point on a plane that is known.

use crate::error::Error;
use crate::measurement::at::At;
use crate::measurement::draw::{ConditionRow, Draw};
use crate::measurement::equations::Equations;
use crate::measurement::groups::Rows;
use crate::measurement::kind::{Kind, Placed, Scene, Touched};
use crate::measurement::measurand::Measurand;
use crate::measurement::places::Places;
use crate::measurement::set::MeasurementSet;
use crate::robot::Chain;
use crate::robot::chain::{reference_or_regressor, regressor_at, write_tip};
use crate::text::{Dimension, InputError, Item, PLANE_FORMS, Section, Units};
use std::sync::Arc;
use truing::manifold::{Plane, Point3, Vector};
use truing::nalgebra::{SMatrix, Vector3};
use truing::{Constraint, Jacobian, Point, Scalar, Views, autodiff};

/// A tool point on a known plane: r = normal · p − distance \[m\], p = base_from_tool · target.
///
/// Variables: robot parameters, the target in the tool frame. One row.
#[derive(Clone)]
pub struct KnownPlane {
    /// The robot.
    pub chain: Arc<Chain>,
    /// Joint values.
    pub q: Vec<f64>,
    /// The plane in the reference frame, its normal of unit length.
    pub plane: Plane<f64>,
}

fn model<T: Scalar>(tip: &Vector3<T>, plane: &Plane<f64>, r: &mut [T]) {
    let lifted = Plane {
        normal: plane.normal.map(T::from),
        distance: T::from(plane.distance),
    };
    r[0] = lifted.signed_distance(tip);
}

impl Constraint for KnownPlane {
    type Vars = (Vector, Point3);
    const DIM: usize = 1;

    fn residual<T: Scalar>(&self, (robot, target): Views<'_, Self, T>, r: &mut [T]) {
        model(&self.chain.tip(robot, &self.q, &target), &self.plane, r);
    }

    fn linearize(&self, at: &mut Point<'_, Self::Vars>, r: &mut [f64], j: &mut Jacobian<'_>) {
        let Some(source) = reference_or_regressor(self, &self.chain, at, r, j) else {
            return;
        };
        let (parameters, target) = at.views();
        let regressor = regressor_at(at, source, &self.chain, parameters, &self.q);
        let tip = regressor.tool.apply(&target);
        let (value, gradient): ([f64; 1], SMatrix<f64, 1, 3>) =
            autodiff::small(&[tip.x, tip.y, tip.z], |x, out| {
                model(&Vector3::from(*x), &self.plane, out)
            });
        r.copy_from_slice(&value);
        write_tip(j, 0, 1, regressor, &tip, &gradient);
    }
}

/// Touches of a plane that is known: kind `known-plane`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KnownPlaneTouches {
    /// The plane in the reference frame, its normal of unit length.
    pub plane: Plane<f64>,
    /// In simulations, how far from the origin planes are that are drawn \[m\]; none for planes through a point
    /// within reach.
    pub drawn_at: Option<f64>,
}

impl KnownPlaneTouches {
    /// Touches of a plane; its normal is brought to unit length.
    pub fn of(plane: Plane<f64>) -> Self {
        let length = plane.normal.norm();
        Self {
            plane: Plane {
                normal: plane.normal / length,
                distance: plane.distance / length,
            },
            drawn_at: None,
        }
    }
}

impl Default for KnownPlaneTouches {
    /// Of the plane z = 0.
    fn default() -> Self {
        Self {
            plane: Plane {
                normal: Vector3::z(),
                distance: 0.0,
            },
            drawn_at: None,
        }
    }
}

/// Touches of a known plane (unit normal) by the tool of robot number 0.
pub fn known_plane(name: impl Into<String>, q: Vec<Vec<f64>>, plane: Plane<f64>) -> MeasurementSet {
    let kind = KnownPlaneTouches {
        plane,
        drawn_at: None,
    };
    let rows = q.len();
    MeasurementSet::new(name, kind, q, Rows::repeated(&[], rows))
}

/// How far from a known plane the touches may lie on average, as the robot of the file sees them, in
/// sums of the robot's lengths: a robot that is wrong, and not the plane.
const WRONG_ROBOT: f64 = 1.0;

/// A plane that is drawn, or at a distance from the origin: of the two, the one on the side of what is within
/// reach.
pub(super) fn drawn(places: &mut Places<'_>, at: Option<f64>) -> Plane<f64> {
    let mut plane = places.plane();
    if let Some(distance) = at {
        plane.distance = distance.copysign(plane.distance);
    }
    plane
}

/// `plane_distance`, which makes sense only where planes are drawn.
pub(super) fn plane_distance(
    table: &mut Section<'_>,
    given: bool,
) -> Result<Option<f64>, InputError> {
    match table.get("plane_distance") {
        Some(item) if given => Err(item
            .error("the planes are given; expected planes that are drawn")
            .with_help("write plane = \"random\", or planes = 1; or remove this key")),
        Some(item) => item.size(Dimension::Length).map(Some),
        None => Ok(None),
    }
}

/// The condition that a tool point is on a plane.
pub(super) fn touching(
    plane: Plane<f64>,
) -> impl Fn(&[truing::manifold::Pose<f64>]) -> Vec<ConditionRow> {
    move |tools| {
        let off = plane.normal.dot(&tools[0].translation) - plane.distance;
        vec![ConditionRow::at(off, plane.normal)]
    }
}

impl Kind for KnownPlaneTouches {
    fn name(&self) -> &'static str {
        "known-plane"
    }

    fn measurands(&self) -> &'static [Measurand] {
        &[Measurand::LENGTH]
    }

    fn equations(&self, on: &mut Equations<'_>) -> Result<(), Error> {
        on.add(|on, row| {
            let tool = &on.tools[0];
            let touch = KnownPlane {
                chain: tool.chain.clone(),
                q: on.q(0, row),
                plane: self.plane,
            };
            ((tool.robot, tool.point()), touch)
        })
    }

    fn keys(&self) -> &'static [&'static str] {
        &["plane"]
    }

    fn read(
        &self,
        table: &mut Section<'_>,
        units: &Units,
    ) -> Result<Option<Arc<dyn Kind>>, InputError> {
        let item = table.require("plane", &format!("expected {PLANE_FORMS}"));
        let item = item.map_err(|error| match error.help.as_deref() {
            Some(help) if help.starts_with("add") => {
                error.with_help("add plane = { normal = [0, 0, 1], distance = 0.4 }")
            }
            _ => error,
        })?;
        Ok(Some(Arc::new(Self {
            plane: item.plane(units)?,
            ..*self
        })))
    }

    fn written(&self) -> Vec<(&'static str, String)> {
        let (n, distance) = (self.plane.normal, self.plane.distance);
        let plane = format!(
            "{{ normal = [{:?}, {:?}, {:?}], distance = {distance:?} }}",
            n.x, n.y, n.z
        );
        vec![("plane", plane)]
    }

    fn touched(&self) -> Option<Touched> {
        Some(Touched::Known(self.plane))
    }

    /// The plane moved along its normal to where the robot believes to have touched.
    fn within_reach(&self, at: &At<'_>) -> Option<Arc<dyn Kind>> {
        let tips = at.all_tips();
        let mut plane = self.plane;
        let total: f64 = tips.iter().map(|tip| plane.signed_distance(tip)).sum();
        let off = total / tips.len() as f64;
        if off.is_nan() || off.abs() > WRONG_ROBOT * at.size() {
            return None;
        }
        plane.distance += off;
        Some(Arc::new(Self { plane, ..*self }))
    }

    fn scene_keys(&self) -> &'static [&'static str] {
        &["plane", "plane_distance"]
    }

    fn scene(&self, table: &mut Section<'_>) -> Result<Scene, InputError> {
        let forms = format!("\"random\", {PLANE_FORMS}");
        let item = table.require("plane", &format!("expected {forms}"))?;
        let random = |item: &Item<'_>| item.as_str() == Some("random");
        if random(&item) {
            return Ok(Scene::drawn(1).of(Self {
                drawn_at: plane_distance(table, false)?,
                ..*self
            }));
        }
        if !item.is_table() {
            let word = item.as_str().unwrap_or_default();
            return Err(item
                .wrong_type(&forms)
                .with_help(crate::text::error::suggest(word, &["random"])));
        }
        let plane = item.plane(&Units::SI)?;
        plane_distance(table, true)?;
        Ok(Scene::given(vec![Vec::new()]).of(Self { plane, ..*self }))
    }

    fn place(&self, places: &mut Places<'_>) -> Placed {
        let plane = drawn(places, self.drawn_at);
        Placed {
            kind: Some(Arc::new(Self { plane, ..*self })),
            values: Vec::new(),
        }
    }

    fn draw(&self, draw: &mut Draw<'_>) -> Result<Vec<f64>, Error> {
        let mut plane = self.plane;
        plane.distance += draw.error(0);
        draw.reach("its plane", 400, touching(plane))?;
        Ok(Vec::new())
    }
}
