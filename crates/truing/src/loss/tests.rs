//! Losses beside closed forms, differences and published constants.

use super::*;
use approx::assert_relative_eq;

fn all() -> Vec<Loss> {
    let mut all = vec![Loss::Trivial, Loss::huber(0.7).unwrap()];
    all.extend(Loss::EFFICIENT);
    for alpha in [
        2.0,
        2.0 - 1e-15,
        2.0 - 1e-9,
        1.5,
        1.0,
        0.3,
        1e-9,
        0.0,
        -1e-12,
        -0.5,
        -2.0,
        -50.0,
        -1e9,
        -1e20,
        f64::NEG_INFINITY,
    ] {
        all.push(Loss::barron(alpha, 1.3).unwrap());
    }
    all
}

#[test]
fn derivatives_are_those_of_the_loss() {
    for loss in all() {
        assert_eq!(loss.evaluate(0.0).0, 0.0, "{loss:?}");
        assert_eq!(loss.evaluate(0.0).1, 1.0, "{loss:?}");
        for s in [1e-4, 0.03, 0.4, 1.0, 3.0, 9.7, 21.0, 40.0, 1e3] {
            let h = 1e-5 * s;
            let [low, _, high] = [-h, 0.0, h].map(|h| loss.evaluate(s + h));
            let (rho, slope, curvature) = loss.evaluate(s);
            let (by_rho, by_slope) = ((high.0 - low.0) / (2.0 * h), (high.1 - low.1) / (2.0 * h));
            assert!(
                (by_rho - slope).abs() <= 1e-9 * (1.0 + rho.abs() / h * 1e-5),
                "{loss:?} at {s}: {by_rho} {slope}"
            );
            assert!(
                (by_slope - curvature).abs() <= 1e-9 + 1e-8 * curvature.abs() + 5e-11 / s,
                "{loss:?} at {s}: {by_slope} {curvature}"
            );
        }
        // From the right at zero.
        let (rho, slope, _) = loss.evaluate(1e-8);
        assert_relative_eq!(rho / 1e-8, 1.0, epsilon = 1e-7);
        // Next to α = 2 the slope falls at once, by next to nothing.
        let abrupt = matches!(loss, Loss::Barron { alpha, .. } if 2.0 - alpha < 1e-6);
        assert!(
            abrupt || ((slope - 1.0) / 1e-8 - loss.evaluate(0.0).2).abs() < 1e-6,
            "{loss:?}"
        );
    }
}

#[test]
fn nothing_is_too_large_or_too_small() {
    for loss in all() {
        for factor in [1e-90, 1.0, 1e80, 1e140, 1e200, f64::INFINITY] {
            let loss = loss.relaxed(factor);
            let mut before = 0.0;
            for s in [
                0.0,
                5e-324,
                1e-300,
                1.0,
                1e10,
                1e100,
                1e200,
                1e300,
                f64::MAX,
            ] {
                let (rho, slope, curvature) = loss.evaluate(s);
                assert!(
                    rho.is_finite() && before <= rho && rho <= s * (1.0 + 1e-12) + 1e-300,
                    "{loss:?} at {s}: {rho} after {before}"
                );
                assert!((0.0..=1.0).contains(&slope), "{loss:?} at {s}: {slope}");
                assert!(
                    curvature <= 0.0 && (s * curvature).is_finite(),
                    "{loss:?} at {s}: {curvature}"
                );
                before = rho * (1.0 - 1e-12);
            }
            let nan = loss.evaluate(f64::NAN);
            assert!(nan.0.is_nan(), "{loss:?}");
        }
    }
}

#[test]
fn barron_is_the_named_losses() {
    let c = 1.7;
    let root = 2.0_f64.sqrt();
    let pairs = [
        (2.0, Loss::Trivial),
        (1.0, Loss::SoftL1(c)),
        (0.0, Loss::Cauchy(root * c)),
        (-2.0, Loss::GemanMcClure(2.0 * c)),
        (f64::NEG_INFINITY, Loss::Welsch(root * c)),
    ];
    for (alpha, named) in pairs {
        // Exactly, and as the limit from both sides.
        let mut near = vec![(alpha, 1e-13)];
        if alpha.is_finite() {
            near.extend([(alpha - 1e-12, 1e-9), ((alpha + 1e-12).min(2.0), 1e-9)]);
        } else {
            near.push((-1e14, 1e-9));
        }
        for (alpha, tolerance) in near {
            let loss = Loss::barron(alpha, c).unwrap();
            for s in [1e-12, 1e-3, 0.5, 4.0, 30.0, 1e4] {
                let (a, b) = (loss.evaluate(s), named.evaluate(s));
                assert_relative_eq!(a.0, b.0, max_relative = tolerance);
                assert_relative_eq!(a.1, b.1, max_relative = 10.0 * tolerance, epsilon = 1e-30);
                // ρ″ itself converges to that of least squares only away from zero.
                assert_relative_eq!(
                    s * a.2,
                    s * b.2,
                    max_relative = 10.0 * tolerance,
                    epsilon = 1e-11
                );
            }
        }
    }
}

/// Barron 2019, equation 8: f(x, α, c) = (|α − 2|/α) (((x/c)²/|α − 2| + 1)^{α/2} − 1), of which
/// ρ is 2c².
#[test]
fn barron_is_as_published() {
    for (alpha, c, x) in [(-4.0, 0.5, 0.7), (0.5, 2.0, 3.0), (1.5, 1.0, 10.0)] {
        let d = f64::abs(alpha - 2.0);
        let f = d / alpha * (((x / c) * (x / c) / d + 1.0_f64).powf(alpha / 2.0) - 1.0);
        let rho = Loss::barron(alpha, c).unwrap().evaluate(x * x).0;
        assert_relative_eq!(rho, 2.0 * c * c * f, max_relative = 1e-13);
    }
}

/// ∫ g(x) φ(x) dx over the normal density by the trapezoidal rule.
fn normal_mean(g: impl Fn(f64) -> f64) -> f64 {
    let h = 1e-3;
    (-12_000..=12_000)
        .map(|k| f64::from(k) * h)
        .map(|x| h * g(x) * (-0.5 * x * x).exp())
        .sum::<f64>()
        / (2.0 * std::f64::consts::PI).sqrt()
}

#[test]
fn the_constants_are_of_95_percent_efficiency() {
    for loss in Loss::EFFICIENT {
        let slope = normal_mean(|x| {
            let (_, first, second) = loss.evaluate(x * x);
            first + 2.0 * x * x * second
        });
        let square = normal_mean(|x| (x * loss.evaluate(x * x).1).powi(2));
        assert_relative_eq!(slope * slope / square, 0.95, epsilon = 5e-4);
    }
}

#[test]
fn the_cost_is_convex_as_far_as_stated() {
    for loss in all() {
        let bend = |s: f64| loss.evaluate(s).1 + 2.0 * s * loss.evaluate(s).2;
        let end = loss.convex_up_to();
        assert!(bend(end.min(1e6) * 0.999) >= -1e-12, "{loss:?}");
        if loss.redescends() {
            assert!(bend(end * 1.001) < 0.0, "{loss:?}");
        }
    }
}

#[test]
fn impossible_losses_are_refused() {
    let by_scale = [
        Loss::huber,
        Loss::soft_l1,
        Loss::cauchy,
        Loss::tukey,
        Loss::welsch,
        Loss::geman_mcclure,
        |c| Loss::barron(0.5, c),
    ];
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        for make in by_scale {
            let error = make(bad).unwrap_err().to_string();
            assert!(error.contains("positive, finite"), "{error}");
        }
    }
    for bad in [2.1, f64::NAN, f64::INFINITY] {
        assert!(Loss::barron(bad, 1.0).is_err());
    }
}
