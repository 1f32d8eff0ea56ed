//! Autonomous calibration of robots using planar points (Khalil, Lemoine & Gautier 1996): the
//! methods of that paper, and those that it names, as a plugin of [`truing_robot`].
//!
//! [`Planar`] hands them to calibration files: `jacobian = "analytic"` is the
//! [`GeneralisedModel`], and `method = "…"` on a constraint chooses equations as the paper writes
//! them. From Rust, [`as_in_the_paper`] makes a whole calibration the paper's, and every equation is
//! an ordinary [`truing::Constraint`].
//!
//! | `method` | kinds | equations |
//! | --- | --- | --- |
//! | `paper` | `position`, `pose` | (2)–(4): the classical method |
//! | `paper` | `known-plane` | (8)–(9), the plane as a·x + b·y + c·z + 1 = 0 |
//! | `paper` | `unknown-plane` | (10)–(11), started by (12) |
//! | `paper` | `same-point`, `same-location` | its reference 7: position link, frame link |
//! | `vector-products` | `unknown-plane` | its reference 9: vector products of points in one plane |
//! | `fixed-plane` | `known-plane` | its reference 10: the plane z = 0 |

mod classical;
mod links;
mod model;
mod plane;
mod products;

pub use classical::{ClassicalPose, ClassicalPosition};
pub use links::{FrameLink, PositionLink};
pub use model::GeneralisedModel;
pub use plane::{Coefficients, CoefficientsUnknown, KnownCoefficients};
pub use products::VectorProducts;

use std::sync::Arc;
use truing::manifold::Plane;
use truing::nalgebra::Vector3;
use truing::{Method, Problem};
use truing_robot::Error;
use truing_robot::calibration::{
    Calibration, Form, Measured, MeasurementSet, Parts, PlaneChart, Plugin,
};
use truing_robot::constraint::Derivatives;
use truing_robot::file::Kind;
use truing_robot::kinematics::DifferentiateChain;

/// What this crate adds to calibration files.
#[derive(Debug, Clone, Copy, Default)]
pub struct Planar;

impl Plugin for Planar {
    fn analytic(&self) -> Option<Arc<dyn DifferentiateChain>> {
        Some(Arc::new(GeneralisedModel))
    }

    fn methods(&self) -> Vec<(&'static str, Kind)> {
        vec![
            ("paper", Kind::Position),
            ("paper", Kind::Pose),
            ("paper", Kind::KnownPlane),
            ("paper", Kind::UnknownPlane),
            ("paper", Kind::SamePoint),
            ("paper", Kind::SameLocation),
            ("vector-products", Kind::UnknownPlane),
            ("fixed-plane", Kind::KnownPlane),
        ]
    }

    fn form(&self, method: &str, kind: Kind) -> Option<Arc<dyn Form>> {
        let form: Arc<dyn Form> = match method {
            "paper" => Arc::new(Paper),
            "vector-products" => Arc::new(Products),
            "fixed-plane" => Arc::new(FixedPlane),
            _ => return None,
        };
        let known = self.methods().contains(&(form.name(), kind));
        known.then_some(form)
    }

    fn fixed_plane(&self, method: &str) -> Option<Plane<f64>> {
        (method == "fixed-plane").then(|| Plane {
            normal: Vector3::z(),
            distance: 0.0,
        })
    }
}

/// A calibration by the paper's own program: its equations, its analytic Jacobian, the linearised
/// model solved by least squares again and again, and base parameters only (which is how
/// [`Calibration`] chooses its unknowns anyway).
///
/// # Errors
/// Names the set that the paper has no equations for, and why.
pub fn as_in_the_paper(mut calibration: Calibration) -> Result<Calibration, String> {
    for set in &mut calibration.sets {
        let form: Arc<dyn Form> = Arc::new(Paper);
        form.check(set)
            .map_err(|message| format!("`{}`: {message}", set.name))?;
        set.form = Some(form);
    }
    calibration.estimate.derivatives = Derivatives::Regressor(Arc::new(GeneralisedModel));
    calibration.estimate.settings.method = Method::GaussNewton;
    Ok(calibration)
}

/// The equations of the paper, whatever was measured.
#[derive(Debug, Clone, Copy, Default)]
pub struct Paper;

impl Form for Paper {
    fn name(&self) -> &'static str {
        "paper"
    }

    fn check(&self, set: &MeasurementSet) -> Result<(), String> {
        match &set.measured {
            Measured::KnownPlane(plane) => Coefficients::of(plane).map(|_| ()),
            Measured::Distance { .. } => Err("the paper has no equation for distances".into()),
            _ => Ok(()),
        }
    }

    fn add(
        &self,
        set: &MeasurementSet,
        parts: &Parts<'_>,
        problem: &mut Problem,
    ) -> Result<(), Error> {
        match &set.measured {
            Measured::Position(points) => classical::add_positions(set, points, parts, problem),
            Measured::Pose(poses) => classical::add_poses(set, poses, parts, problem),
            Measured::KnownPlane(plane) => plane::add_known(set, plane, parts, problem),
            Measured::UnknownPlane(groups) => plane::add_unknown(set, groups, parts, problem),
            Measured::SamePoint(groups) => links::add_points(set, groups, parts, problem),
            Measured::SameLocation(groups) => links::add_locations(set, groups, parts, problem),
            Measured::Distance { .. } => Err(Error::Calibration {
                message: format!("`{}`: the paper has no equation for distances", set.name),
                help: "leave `method` out".into(),
            }),
        }
    }

    fn eliminates(&self, measured: &Measured) -> bool {
        matches!(measured, Measured::SamePoint(_) | Measured::SameLocation(_))
    }

    fn chart(&self) -> Option<&dyn PlaneChart> {
        Some(&Coefficients)
    }
}

/// Vector products of points in one plane, equated to zero.
#[derive(Debug, Clone, Copy, Default)]
pub struct Products;

impl Form for Products {
    fn name(&self) -> &'static str {
        "vector-products"
    }

    fn check(&self, set: &MeasurementSet) -> Result<(), String> {
        match &set.measured {
            Measured::UnknownPlane(_) => Ok(()),
            other => Err(format!(
                "vector products are of touches of unknown planes, not of kind {}",
                other.kind()
            )),
        }
    }

    fn add(
        &self,
        set: &MeasurementSet,
        parts: &Parts<'_>,
        problem: &mut Problem,
    ) -> Result<(), Error> {
        products::add(set, parts, problem)
    }

    fn eliminates(&self, _: &Measured) -> bool {
        true
    }
}

/// The fixed plane z = 0 of the reference frame: r = P_z.
#[derive(Debug, Clone, Copy, Default)]
pub struct FixedPlane;

impl Form for FixedPlane {
    fn name(&self) -> &'static str {
        "fixed-plane"
    }

    fn check(&self, set: &MeasurementSet) -> Result<(), String> {
        match &set.measured {
            Measured::KnownPlane(plane)
                if plane.normal == Vector3::z() && plane.distance == 0.0 =>
            {
                Ok(())
            }
            _ => Err("the fixed plane is z = 0 of the reference frame".into()),
        }
    }

    fn add(
        &self,
        set: &MeasurementSet,
        parts: &Parts<'_>,
        problem: &mut Problem,
    ) -> Result<(), Error> {
        plane::add_fixed(set, parts, problem)
    }
}
