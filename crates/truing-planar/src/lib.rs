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
use truing::Method as Solver;
use truing::nalgebra::Vector3;
use truing_robot::kinds::KnownPlaneTouches;
use truing_robot::measurement::{Chart, Equations, Kind, Method, Readings};
use truing_robot::robot::{Derivatives, DifferentiateChain};
use truing_robot::{Calibration, Error, Plugin};

/// What this crate adds to calibration files.
#[derive(Debug, Clone, Copy, Default)]
pub struct Planar;

impl Plugin for Planar {
    fn analytic(&self) -> Option<Arc<dyn DifferentiateChain>> {
        Some(Arc::new(GeneralisedModel))
    }

    fn methods(&self) -> Vec<Arc<dyn Method>> {
        vec![Arc::new(Paper), Arc::new(Products), Arc::new(FixedPlane)]
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
        let method: Arc<dyn Method> = Arc::new(Paper);
        method
            .check(&*set.kind, &set.readings)
            .map_err(|message| format!("`{}`: {message}", set.name))?;
        set.method = Some(method);
    }
    calibration.estimate.derivatives = Derivatives::Regressor(Arc::new(GeneralisedModel));
    calibration.estimate.settings.method = Solver::GaussNewton;
    Ok(calibration)
}

/// The equations of the paper, whatever was measured.
#[derive(Debug, Clone, Copy, Default)]
pub struct Paper;

impl Paper {
    fn no_equation(kind: &dyn Kind) -> String {
        format!(
            "the paper has no equation for measurements of kind {}",
            kind.name()
        )
    }
}

impl Method for Paper {
    fn name(&self) -> &'static str {
        "paper"
    }

    fn kinds(&self) -> &'static [&'static str] {
        &[
            "position",
            "pose",
            "known-plane",
            "unknown-plane",
            "same-point",
            "same-location",
        ]
    }

    fn check(&self, kind: &dyn Kind, readings: &Readings) -> Result<(), String> {
        if !self.kinds().contains(&kind.name()) {
            return Err(Self::no_equation(kind));
        }
        if kind.name() == "pose" && readings.tool().target.is_some() {
            return Err("the paper has no body on the tool whose orientation is estimated".into());
        }
        match kind.downcast::<KnownPlaneTouches>() {
            Some(touches) => Coefficients::of(&touches.plane).map(|_| ()),
            None => Ok(()),
        }
    }

    fn equations(&self, kind: &dyn Kind, on: &mut Equations<'_>) -> Result<(), Error> {
        match kind.name() {
            "position" => classical::add_positions(on),
            "pose" => classical::add_poses(on),
            "unknown-plane" => plane::add_unknown(on),
            "same-point" => links::add_points(on),
            "same-location" => links::add_locations(on),
            _ => match kind.downcast::<KnownPlaneTouches>() {
                Some(touches) => plane::add_known(&touches.plane, on),
                None => Err(Error::Calibration {
                    message: format!("`{}`: {}", on.readings.name, Self::no_equation(kind)),
                    help: "leave `method` out".into(),
                }),
            },
        }
    }

    fn eliminates(&self, kind: &dyn Kind) -> bool {
        ["same-point", "same-location"].contains(&kind.name())
    }

    fn chart(&self, kind: &dyn Kind, _: &str) -> Option<Arc<dyn Chart>> {
        let has = kind.name() == "unknown-plane";
        has.then(|| Arc::new(Coefficients) as Arc<dyn Chart>)
    }
}

/// Vector products of points in one plane, equated to zero.
#[derive(Debug, Clone, Copy, Default)]
pub struct Products;

impl Method for Products {
    fn name(&self) -> &'static str {
        "vector-products"
    }

    fn kinds(&self) -> &'static [&'static str] {
        &["unknown-plane"]
    }

    fn check(&self, kind: &dyn Kind, _: &Readings) -> Result<(), String> {
        if kind.name() == "unknown-plane" {
            return Ok(());
        }
        Err(format!(
            "vector products are of touches of unknown planes, not of kind {}",
            kind.name()
        ))
    }

    fn equations(&self, _: &dyn Kind, on: &mut Equations<'_>) -> Result<(), Error> {
        products::add(on)
    }

    fn eliminates(&self, _: &dyn Kind) -> bool {
        true
    }
}

/// The fixed plane z = 0 of the reference frame: r = P_z.
#[derive(Debug, Clone, Copy, Default)]
pub struct FixedPlane;

impl Method for FixedPlane {
    fn name(&self) -> &'static str {
        "fixed-plane"
    }

    fn kinds(&self) -> &'static [&'static str] {
        &["known-plane"]
    }

    fn check(&self, kind: &dyn Kind, _: &Readings) -> Result<(), String> {
        match kind.downcast::<KnownPlaneTouches>() {
            Some(touches)
                if touches.plane.normal == Vector3::z() && touches.plane.distance == 0.0 =>
            {
                Ok(())
            }
            _ => Err("the fixed plane is z = 0 of the reference frame".into()),
        }
    }

    fn equations(&self, _: &dyn Kind, on: &mut Equations<'_>) -> Result<(), Error> {
        plane::add_fixed(on)
    }

    fn constants(&self) -> Option<Arc<dyn Kind>> {
        Some(Arc::new(KnownPlaneTouches::default()))
    }
}
