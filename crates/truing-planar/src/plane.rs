//! Planes as a·x + b·y + c·z + 1 = 0, equations (6) to (12).

use std::sync::Arc;
use truing::manifold::{Plane, Plane3, Point3, Vector};
use truing::nalgebra::{DMatrix, DVector, SMatrix, Vector3};
use truing::{Constraint, Jacobian, Noise, Point, Scalar, Views};
use truing_robot::Error;
use truing_robot::kinds::KnownPlane;
use truing_robot::measurement::fit::best_fit_plane;
use truing_robot::measurement::{At, Chart, Equations};
use truing_robot::robot::chain::{reference_or_regressor, regressor_at, write_block, write_tip};
use truing_robot::robot::{Chain, Unit};
use truing_robot::unknown::Value;

/// The coordinates (a, b, c) of the plane a·x + b·y + c·z + 1 = 0, equation (6).
///
/// A plane through the origin has none: that is why [`truing_robot`] itself has planes as unit normal
/// and distance, (a, b, c) = −normal / distance.
#[derive(Debug, Clone, Copy, Default)]
pub struct Coefficients;

/// A plane closer to the origin \[m\] has no coefficients of ordinary size.
const NEAR: f64 = 1e-9;

impl Coefficients {
    /// (a, b, c) of a plane \[1/m\].
    ///
    /// # Errors
    /// If it goes through the origin.
    pub fn of(plane: &Plane<f64>) -> Result<[f64; 3], String> {
        if plane.distance.abs() < NEAR {
            return Err(
                "a plane through the origin of the reference frame cannot be written as \
                 a·x + b·y + c·z + 1 = 0"
                    .into(),
            );
        }
        Ok((-plane.normal / plane.distance).into())
    }
}

impl Coefficients {
    /// Equation (12): the least-squares solution of P·(a, b, c) = −1 over the touches P. Where it has
    /// none of its own (touches in one line), the plane of least distances.
    pub fn fit(touches: &[Vector3<f64>]) -> Plane<f64> {
        let rows = DMatrix::from_fn(touches.len(), 3, |row, column| touches[row][column]);
        let svd = rows.svd(true, true);
        let (largest, smallest) = (svd.singular_values.max(), svd.singular_values.min());
        let ones = DVector::from_element(touches.len(), -1.0);
        match svd.solve(&ones, 0.0) {
            Ok(x) if touches.len() >= 3 && smallest > 1e-12 * largest => Self::plane(x.as_slice()),
            _ => best_fit_plane(touches),
        }
    }

    /// The plane with coefficients (a, b, c).
    pub fn plane(coefficients: &[f64]) -> Plane<f64> {
        let normal = Vector3::from_column_slice(coefficients);
        let length = normal.norm();
        if length == 0.0 {
            // All points are infinitely far from the plane at infinity.
            return Plane {
                normal: Vector3::z(),
                distance: f64::INFINITY,
            };
        }
        // The distance is positive: the normal points away from the origin.
        Plane {
            normal: -normal / length,
            distance: 1.0 / length,
        }
    }

    /// (a, b, c) of a plane, with what to do where there are none.
    fn wanted(plane: &Plane<f64>) -> Result<[f64; 3], Error> {
        Self::of(plane).map_err(|message| Error::Calibration {
            message,
            help: "leave `method` out: Truing's own planes may lie anywhere".into(),
        })
    }
}

/// The plane that a value is.
fn plane_of(value: &Value) -> Plane<f64> {
    let none = Plane {
        normal: Vector3::z(),
        distance: f64::NAN,
    };
    value.get::<Plane3>().copied().unwrap_or(none)
}

impl Chart for Coefficients {
    fn start(&self, at: &At<'_>, group: usize) -> Value {
        Value::of::<Plane3>(Self::fit(&at.tips(group)))
    }

    fn coordinates(&self, value: &Value) -> Result<Value, Error> {
        let [a, b, c] = Self::wanted(&plane_of(value))?;
        let numbers = [
            ("a", Unit::One, a),
            ("b", Unit::One, b),
            ("c", Unit::One, c),
        ];
        Ok(Value::numbers(&numbers))
    }

    fn value(&self, coordinates: &Value) -> Value {
        let coefficients = coordinates.get::<Vector>().map_or(&[0.0; 3][..], |c| c);
        Value::of::<Plane3>(Self::plane(coefficients))
    }

    fn growth(&self, value: &Value) -> Vec<f64> {
        let plane = plane_of(value);
        (plane.normal / plane.distance).as_slice().to_vec()
    }
}

/// a·Px + b·Py + c·Pz + 1.
fn equation<T: Scalar>(coefficients: &[T], tip: &Vector3<T>) -> T {
    coefficients[0] * tip.x + coefficients[1] * tip.y + coefficients[2] * tip.z + T::one()
}

/// A touch of a plane with known coefficients: r = a·Px + b·Py + c·Pz + 1, equation (9); no unit.
///
/// Its Jacobian is \[a·Jx + b·Jy + c·Jz\]. Variables: robot parameters, the target in the tool frame.
#[derive(Clone)]
pub struct KnownCoefficients {
    /// The robot.
    pub chain: Arc<Chain>,
    /// Joint values.
    pub q: Vec<f64>,
    /// (a, b, c) \[1/m\].
    pub coefficients: [f64; 3],
}

impl Constraint for KnownCoefficients {
    type Vars = (Vector, Point3);
    const DIM: usize = 1;

    fn residual<T: Scalar>(&self, (robot, target): Views<'_, Self, T>, r: &mut [T]) {
        let tip = self.chain.tip(robot, &self.q, &target);
        r[0] = equation(&self.coefficients.map(T::from), &tip);
    }

    fn linearize(&self, at: &mut Point<'_, Self::Vars>, r: &mut [f64], j: &mut Jacobian<'_>) {
        let Some(source) = reference_or_regressor(self, &self.chain, at, r, j) else {
            return;
        };
        let (parameters, target) = at.views();
        let regressor = regressor_at(at, source, &self.chain, parameters, &self.q);
        let tip = regressor.tool.apply(&target);
        r[0] = equation(&self.coefficients, &tip);
        let gradient = SMatrix::<f64, 1, 3>::from_row_slice(&self.coefficients);
        write_tip(j, 0, 1, regressor, &tip, &gradient);
    }
}

/// A touch of a plane whose coefficients are estimated: r = a·Px + b·Py + c·Pz + 1, equation (11);
/// no unit.
///
/// Its Jacobian is \[Px Py Pz | a·Jx + b·Jy + c·Jz\]. Variables: robot parameters, the target in the
/// tool frame, (a, b, c) as a vector of three.
#[derive(Clone)]
pub struct CoefficientsUnknown {
    /// The robot.
    pub chain: Arc<Chain>,
    /// Joint values.
    pub q: Vec<f64>,
}

impl Constraint for CoefficientsUnknown {
    type Vars = (Vector, Point3, Vector);
    const DIM: usize = 1;

    fn residual<T: Scalar>(&self, (robot, target, plane): Views<'_, Self, T>, r: &mut [T]) {
        r[0] = equation(plane, &self.chain.tip(robot, &self.q, &target));
    }

    fn linearize(&self, at: &mut Point<'_, Self::Vars>, r: &mut [f64], j: &mut Jacobian<'_>) {
        let Some(source) = reference_or_regressor(self, &self.chain, at, r, j) else {
            return;
        };
        let (parameters, target, plane) = at.views();
        let regressor = regressor_at(at, source, &self.chain, parameters, &self.q);
        let tip = regressor.tool.apply(&target);
        r[0] = equation(plane, &tip);
        let gradient = SMatrix::<f64, 1, 3>::from_row_slice(plane);
        write_tip(j, 0, 1, regressor, &tip, &gradient);
        write_block(j, 2, &tip.transpose());
    }
}

pub(crate) fn add_known(plane: &Plane<f64>, on: &mut Equations<'_>) -> Result<(), Error> {
    let coefficients = Coefficients::wanted(plane)?;
    let tool = on.tools[0].clone();
    let constraints = (0..on.readings.len()).map(|row| {
        let constraint = KnownCoefficients {
            chain: tool.chain.clone(),
            q: on.q(0, row),
            coefficients,
        };
        let noise = Noise::isotropic(on.readings.sigma.row(row)[0] / plane.distance.abs())?;
        Ok(((tool.robot, tool.point()), constraint, noise))
    });
    let block = on.block(constraints)?;
    on.problem.add_block(block);
    Ok(())
}

/// A length is worth 1 / distance of the plane at the start, so that residuals weigh as in metres.
pub(crate) fn add_unknown(on: &mut Equations<'_>) -> Result<(), Error> {
    let tool = on.tools[0].clone();
    let constraints = (0..on.readings.len()).map(|row| {
        let plane = on.unknown::<Vector>("plane", row);
        let scale = Vector3::from_column_slice(&on.problem.initial().get(plane)).norm();
        let constraint = CoefficientsUnknown {
            chain: tool.chain.clone(),
            q: on.q(0, row),
        };
        let noise = Noise::isotropic(on.readings.sigma.row(row)[0] * scale)?;
        Ok(((tool.robot, tool.point(), plane), constraint, noise))
    });
    let block = on.block(constraints)?;
    on.problem.add_block(block);
    Ok(())
}

pub(crate) fn add_fixed(on: &mut Equations<'_>) -> Result<(), Error> {
    on.add(|on, row| {
        let tool = &on.tools[0];
        let constraint = KnownPlane {
            chain: tool.chain.clone(),
            q: on.q(0, row),
            plane: Plane {
                normal: Vector3::z(),
                distance: 0.0,
            },
        };
        ((tool.robot, tool.point()), constraint)
    })
}
