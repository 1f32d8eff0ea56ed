//! Real measurements, a third of them spoilt: a robust calibration is that of the unspoilt ones, and names
//! the others.
//!
//! The data are not part of the project: they are looked for in `TRUING_DATA`, or in `shared/data`
//! beside the checkout, and the tests report themselves ignored where they are absent.

use libtest_mimic::{Arguments, Failed, Trial};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use truing::nalgebra::Vector3;
use truing_robot::file::CalibrationFile;
use truing_robot::load::load;
use truing_robot::result::CalibrationResult;

fn data() -> PathBuf {
    match std::env::var_os("TRUING_DATA") {
        Some(folder) => PathBuf::from(folder),
        None => Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"),
    }
}

/// The IRB 120 of the data, in Khalil–Kleinfinger's convention [rad, m].
fn robot() -> String {
    let text = std::fs::read_to_string(data().join("irb120_faro/nominal.json")).unwrap();
    let json: serde_json::Value = serde_json::from_str(&text).unwrap();
    let mut robot = String::from("convention = \"khalil-kleinfinger\"\n");
    for row in json["rows"].as_array().unwrap() {
        robot += "[[joint]]\ntype = \"revolute\"\n";
        for (key, from) in [
            ("alpha", "alpha"),
            ("d", "a"),
            ("theta", "theta"),
            ("r", "r"),
        ] {
            robot += &format!("{key} = {:?}\n", row[from].as_f64().unwrap());
        }
    }
    robot
}

/// Calibrates one reflector's positions; with a seed, 30 % of the rows, which come back, lie one to
/// five centimetres off in random directions.
fn calibrate(loss: &str, seed: Option<u64>) -> (CalibrationResult, BTreeSet<usize>) {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("robot.toml"), robot()).unwrap();
    let text = format!(
        "[robot]\nfile = \"robot.toml\"\n[estimate]\nfixed = [\"K*\"]\n\
         [[constraint]]\nkind = \"position\"\nname = \"s1\"\ndata = \"{}\"\nsigma = \"0.3 mm\"\nloss = \"{loss}\"\n\
         frame = \"tracker\"\ntarget = \"s1\"\nrows = \"valid == 1\"\n\
         columns = {{ x = \"s1x\", y = \"s1y\", z = \"s1z\" }}\n",
        data().join("irb120_faro/samples.csv").display()
    );
    let path = folder.path().join("calibration.toml");
    std::fs::write(&path, text).unwrap();
    let mut calibration = load(&CalibrationFile::read(&path).unwrap()).unwrap();
    let mut bad = BTreeSet::new();
    if let Some(seed) = seed {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let rows = calibration.sets[0].origin.clone().unwrap().rows;
        let set = &mut calibration.sets[0];
        for (k, row) in rows.into_iter().enumerate() {
            if rng.random::<f64>() < 0.3 {
                let mut point = Vector3::from_column_slice(set.values.row(k));
                let direction = point.map(|_| rng.random_range(-1.0..1.0)).normalize();
                point += direction * rng.random_range(0.01..0.05);
                let read = set.readings.values.row_mut(k);
                read.copy_from_slice(point.as_slice());
                bad.insert(row);
            }
        }
    }
    (calibration.run(&|_| {}).unwrap().result, bad)
}

/// Within 2 σ of the estimate from the data as they are, by least squares and by the same loss, in
/// every parameter, σ being that of least squares.
fn irb120_with_a_third_spoilt(loss: &str) -> Result<(), Failed> {
    let (squares, _) = calibrate("trivial", None);
    let (clean, _) = calibrate(loss, None);
    let apart = |clean: &CalibrationResult, other: &CalibrationResult| {
        let pairs = clean.parameters.iter().zip(&other.parameters);
        let sigmas = squares.parameters.iter().map(|p| p.sigma);
        pairs
            .zip(sigmas)
            .filter_map(|((a, b), sigma)| Some((a.estimate - b.estimate).abs() / sigma?))
            .fold(0.0, f64::max)
    };
    for seed in 1..=4 {
        let (robust, bad) = calibrate(loss, Some(seed));
        let named: BTreeSet<usize> = robust.outliers.iter().map(|o| o.row).collect();
        let good: Vec<&usize> = named.difference(&bad).collect();
        // Some of the measurements are not normal to begin with.
        let known: Vec<usize> = clean.outliers.iter().map(|o| o.row).collect();
        let new = good.iter().filter(|row| !known.contains(row)).count();
        let off = apart(&clean, &robust);
        println!(
            "{loss}, seed {seed}: {off:.2} σ from clean ({:.2} σ from least squares, which are {:.2} σ apart), {} of {} \
             named, {} others of {}, {new} of them not among the {} of the clean data, σ₀ {:?} ({:?}), {:?}",
            apart(&squares, &robust),
            apart(&squares, &clean),
            named.len() - good.len(),
            bad.len(),
            good.len(),
            clean.constraints[0].count,
            known.len(),
            robust.sigma0,
            squares.sigma0,
            robust.warnings,
        );
        if off > 2.0 {
            return Err(format!("seed {seed}: {off:.2} σ").into());
        }
        if !bad.is_subset(&named) {
            return Err(format!("seed {seed}: {:?} not named", bad.difference(&named)).into());
        }
        if new > clean.constraints[0].count / 100 {
            return Err(format!("seed {seed}: {new} good rows named").into());
        }
        if !robust.trusted {
            return Err(format!("seed {seed}: {:?}", robust.warnings).into());
        }
    }
    Ok(())
}

fn main() -> ExitCode {
    let arguments = Arguments::from_args();
    let absent = !data().join("irb120_faro/samples.csv").is_file();
    let trial = |loss: &'static str| {
        let name = format!("irb120_with_a_third_spoilt_{loss}");
        Trial::test(name, move || irb120_with_a_third_spoilt(loss)).with_ignored_flag(absent)
    };
    let tests = vec![trial("cauchy"), trial("tukey"), trial("geman-mcclure")];
    libtest_mimic::run(&arguments, tests).exit_code()
}
