//! `Problem` implements argmin's own traits: cost, gradient, residual and Jacobian over the tangent at
//! the start agree with differences of each other, on flat and curved variables.

use argmin::core::{CostFunction, Gradient, Jacobian, Operator};
use nalgebra::{UnitQuaternion, Vector3};
use truing::manifold::{Point3, Pose, Pose3, Vector};
use truing::{Batch, Constraint, Error, Loss, Noise, Problem, Scalar, Views};

/// pose · point + scale · b − a.
struct Chain {
    a: Vector3<f64>,
    b: Vector3<f64>,
}

impl Constraint for Chain {
    type Vars = (Pose3, Point3, Vector);
    const DIM: usize = 3;
    fn residual<T: Scalar>(&self, (pose, point, scale): Views<'_, Self, T>, r: &mut [T]) {
        for i in 0..3 {
            r[i] = pose.translation[i] + scale[0] * self.b[i] - self.a[i];
            for k in 0..3 {
                r[i] += pose.rotation[(i, k)] * point[k];
            }
        }
    }
}

fn problem(loss: Loss) -> Problem {
    let mut problem = Problem::new();
    let turned = UnitQuaternion::from_scaled_axis(Vector3::new(0.3, -0.2, 0.4));
    let start = Pose {
        rotation: *turned.to_rotation_matrix().matrix(),
        translation: Vector3::new(0.1, 0.2, 0.3),
    };
    let pose = problem.add_variable::<Pose3>("pose", &start);
    let point = problem.add_variable::<Point3>("point", &Vector3::new(1.0, -0.5, 0.2));
    let scale = problem.add_variable::<Vector>("scale", &vec![1.5]);
    let mut batch = Batch::new("chain")
        .noise(Noise::isotropic(0.1).unwrap())
        .loss(loss);
    for k in 0..6 {
        let k = f64::from(k);
        let a = Vector3::new(k.sin(), k.cos(), 0.1 * k);
        batch.push((pose, point, scale), Chain { a, b: a.yzx() });
    }
    problem.add_block(batch);
    problem.fix_component(point, 1);
    problem
}

#[test]
fn gradient_and_jacobian_are_the_differences_of_cost_and_residual() {
    for loss in [Loss::Trivial, Loss::huber(1.0).unwrap()] {
        let problem = problem(loss);
        // Far from the start as well, where the tangent there is bent.
        for p in [
            vec![0.0; 9],
            vec![0.4, -0.3, 0.2, 1.1, -0.7, 0.9, 0.2, 0.1, -0.4],
        ] {
            let gradient = problem.gradient(&p).unwrap();
            let jacobian = problem.jacobian(&p).unwrap();
            assert_eq!((gradient.len(), jacobian.len()), (9, 18));
            for k in 0..9 {
                let h = 1e-6;
                let at = |h: f64| {
                    let mut p = p.clone();
                    p[k] += h;
                    p
                };
                let slope =
                    (problem.cost(&at(h)).unwrap() - problem.cost(&at(-h)).unwrap()) / (2.0 * h);
                let size = 1.0 + gradient[k].abs();
                assert!(
                    (slope - gradient[k]).abs() < 1e-6 * size,
                    "{slope} {gradient:?}"
                );
                if loss == Loss::Trivial {
                    let (above, below) = (
                        problem.apply(&at(h)).unwrap(),
                        problem.apply(&at(-h)).unwrap(),
                    );
                    for (row, j) in jacobian.iter().enumerate() {
                        let slope = (above[row] - below[row]) / (2.0 * h);
                        assert!((slope - j[k]).abs() < 1e-6 * (1.0 + slope.abs()));
                    }
                }
            }
            // Gradient = Jᵀ r, with the same weights.
            let r = problem.apply(&p).unwrap();
            for k in 0..9 {
                let product: f64 = jacobian.iter().zip(&r).map(|(j, r)| j[k] * r).sum();
                assert!((product - gradient[k]).abs() < 1e-9 * (1.0 + product.abs()));
            }
        }
    }
}

#[test]
fn a_parameter_of_the_wrong_length_is_an_error() {
    let error = problem(Loss::Trivial).at(&[0.0; 4]).unwrap_err();
    assert_eq!(
        error,
        Error::Parameters {
            found: 4,
            expected: 9
        }
    );
}
