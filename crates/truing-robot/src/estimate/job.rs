//! A calibration that was checked: names understood, nothing that does not fit.

use super::calibration::{Calibration, Strategy};
use super::check_sets::check_sets;
use crate::error::Error;
use crate::identify::default_preference;
use crate::measurement::MeasurementSet;
use crate::model::{errors_of, residuals};
use crate::robot::{Arm, Derivatives, Unit, names, posture};
use crate::unknown::State;
use truing::{Loss, Settings};

/// A calibration whose names are understood and whose measurements were checked.
#[derive(Clone)]
pub(crate) struct Job {
    pub arms: Vec<Arm>,
    pub sets: Vec<MeasurementSet>,
    pub held_out: Vec<(usize, MeasurementSet)>,
    pub validate: Vec<MeasurementSet>,
    pub estimate: Chosen,
    pub notes: Vec<String>,
}

/// What to estimate, by positions.
#[derive(Clone)]
pub(crate) struct Chosen {
    /// Which parameters of which robot.
    pub wanted: Vec<Vec<bool>>,
    /// Robot, parameter, lower and upper difference from nominal.
    pub bounds: Vec<(usize, usize, f64, f64)>,
    /// Robot, parameter, standard deviation.
    pub priors: Vec<(usize, usize, f64)>,
    /// How far drawings are off, as a part of the robots' dimensions; none to hold nothing.
    pub drawing: Option<f64>,
    /// All parameters as (robot, parameter), those kept first first.
    pub preference: Vec<(usize, usize)>,
    pub derivatives: Derivatives,
    pub settings: Settings,
    pub strategy: Strategy,
    pub from: Option<Vec<Vec<f64>>>,
}

impl Job {
    /// Checks a calibration.
    ///
    /// # Errors
    /// Names what does not fit: a name that means no parameter, a set and row with wrong counts, or a number
    /// that is none.
    pub fn of(calibration: &Calibration) -> Result<Self, Error> {
        let arms = &calibration.arms;
        let mut job = Self {
            arms: arms.clone(),
            sets: calibration.sets.clone(),
            held_out: calibration.held_out.clone(),
            validate: calibration.validate.clone(),
            estimate: chosen(calibration)?,
            notes: calibration.notes.clone(),
        };
        let held_out = job.held_out.iter_mut().map(|(_, set)| set);
        check_sets(
            arms,
            &mut job.sets,
            held_out.collect(),
            &mut job.validate,
            &mut job.notes,
        )?;
        Ok(job)
    }

    pub fn wants(&self, robot: usize, parameter: usize) -> bool {
        self.estimate.wanted[robot][parameter]
    }

    pub fn nominal(&self) -> Vec<Vec<f64>> {
        self.arms.iter().map(|arm| arm.robot.nominal()).collect()
    }

    /// Whether a set has a robust loss.
    pub fn is_robust(&self) -> bool {
        self.sets.iter().any(|set| set.loss != Loss::Trivial)
    }

    /// Residuals of a set in a state by its kind's own equations.
    pub fn residuals(&self, set: &MeasurementSet, state: &State) -> Result<Vec<f64>, Error> {
        residuals(&self.arms, set, state, &self.estimate.derivatives)
    }

    /// The largest median error in length of a set of measurements in a state \[m\]: outliers do not count.
    pub fn misfit(&self, state: &State) -> Result<f64, Error> {
        let mut largest = 0.0_f64;
        for set in &self.sets {
            let measurands = set.kind.measurands();
            let Some(length) = measurands.iter().position(|m| m.unit == Unit::Meter) else {
                continue;
            };
            let mut errors = errors_of(set, length, &self.residuals(set, state)?);
            errors.iter_mut().for_each(|e| *e = e.abs());
            errors.sort_by(f64::total_cmp);
            largest = largest.max(errors.get(errors.len() / 2).copied().unwrap_or_default());
        }
        Ok(largest)
    }

    /// How far the tools reach, about \[m\], on average over the robots.
    pub fn reach(&self) -> f64 {
        let sizes: f64 = self.arms.iter().map(|arm| posture::reach(&arm.robot)).sum();
        sizes / self.arms.len().max(1) as f64
    }

    /// Where a bounded parameter ended, if it is at one of its bounds.
    pub fn at_bound(&self, robot: usize, parameter: usize, estimate: f64) -> Option<&'static str> {
        let bound = |(r, p, ..): &&(usize, usize, f64, f64)| (*r, *p) == (robot, parameter);
        let (_, _, lower, upper) = self.estimate.bounds.iter().find(bound)?;
        let moved = estimate - self.arms[robot].robot.parameters()[parameter].nominal;
        let close = 1e-9 * (upper - lower);
        if moved <= lower + close {
            Some("lower")
        } else if moved >= upper - close {
            Some("upper")
        } else {
            None
        }
    }
}

/// The estimate of a calibration with its names understood.
fn chosen(calibration: &Calibration) -> Result<Chosen, Error> {
    let (arms, estimate) = (&calibration.arms, &calibration.estimate);
    let find = |text: &String| {
        names::find(arms, text).map_err(|unknown| Error::calibration(unknown.message, unknown.help))
    };
    let none = |arm: &Arm| vec![false; arm.robot.parameters().len()];
    let mut wanted: Vec<Vec<bool>> = arms.iter().map(none).collect();
    for (texts, wants) in [(&estimate.parameters, true), (&estimate.fixed, false)] {
        for text in texts {
            for (r, p) in find(text)? {
                wanted[r][p] = wants;
            }
        }
    }
    let mut bounds: Vec<(usize, usize, f64, f64)> = Vec::new();
    for (text, lower, upper) in &estimate.bounds {
        if !(*lower <= 0.0 && *upper >= 0.0) {
            return Err(Error::calibration(
                format!("the bounds [{lower}, {upper}] of `{text}` exclude its nominal value"),
                "give differences from nominal: none above zero below, none below zero above",
            ));
        }
        for (r, p) in find(text)? {
            bounds.retain(|(a, b, ..)| (*a, *b) != (r, p));
            bounds.push((r, p, *lower, *upper));
        }
    }
    bounds.sort_by_key(|(r, p, ..)| (*r, *p));
    let mut priors: Vec<(usize, usize, f64)> = Vec::new();
    for (text, sigma) in &estimate.priors {
        if !(sigma.is_finite() && *sigma > 0.0) {
            return Err(Error::calibration(
                format!("the prior of `{text}` has a standard deviation of {sigma}"),
                "give a positive, finite one",
            ));
        }
        for (r, p) in find(text)? {
            priors.retain(|(a, b, _)| (*a, *b) != (r, p));
            priors.push((r, p, *sigma));
        }
    }
    priors.sort_by_key(|(r, p, _)| (*r, *p));
    let mut preference = Vec::new();
    for text in &estimate.preference {
        preference.extend(find(text)?);
    }
    preference.extend(default_preference(arms));
    let mut order: Vec<(usize, usize)> = Vec::new();
    for parameter in preference {
        if !order.contains(&parameter) {
            order.push(parameter);
        }
    }
    if let Some(from) = &estimate.from {
        let right = from.len() == arms.len()
            && from.iter().zip(&wanted).all(|(f, w)| f.len() == w.len())
            && from.iter().flatten().all(|x| x.is_finite());
        if !right {
            return Err(Error::calibration(
                "`from` has other numbers of parameters than the robots, or numbers that are not finite",
                "give one finite number for each parameter of each robot",
            ));
        }
    }
    Ok(Chosen {
        wanted,
        bounds,
        priors,
        drawing: estimate.drawing,
        preference: order,
        derivatives: estimate.derivatives.clone(),
        settings: estimate.settings.clone(),
        strategy: estimate.strategy,
        from: estimate.from.clone(),
    })
}
