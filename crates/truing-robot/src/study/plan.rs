//! From a study file to a study that can run: robots read, names understood, an example tried.

use super::cases::{Case, Forms, Method, Study};
use super::draw::{self, Drawn, Purpose, Stream};
use crate::error::Error;
use crate::estimate::{Calibration, Estimated, Registration};
use crate::file::{CaseSpec, MethodSpec, StartKind, StudyFile};
use crate::identify::Choice;
use crate::load::{Names, estimate, read_arms};
use crate::measurement::Kind;
use crate::model::Owner;
use crate::plugin::Registry;
use crate::simulate::noise;
use crate::text::{InputError, Spanned};

/// Errors on fresh configurations up to which a robot counts as recovered where nothing has noise \[m\].
pub const EXACT: f64 = 1e-6;

/// How many standard deviations of noise are allowed on top: what 0.1 mm does to the parameters of an
/// arm shows up several times as large at the far ends of its workspace, a wrong robot a hundred times.
pub const NOISE: f64 = 50.0;

/// Reads the robots that a study file names, and checks the study on an example without errors or noise.
///
/// # Errors
/// Whatever is wrong with a file, or too little is measured in a case to estimate from.
pub fn load_study(file: &StudyFile, registry: &Registry) -> Result<Study, Error> {
    let arms = read_arms(&file.robots, &file.source, registry.models())?;
    let mut methods = Vec::new();
    for spec in &file.methods {
        methods.push(Method {
            name: spec.name.clone(),
            from_truth: spec.start == StartKind::Truth,
            registration: if spec.start != StartKind::Auto {
                Registration::Never
            } else {
                Registration::IfFar
            },
            estimate: estimate(&spec.estimate, &file.source, &arms, registry)?,
        });
    }
    let mut study = Study {
        source: file.source.clone(),
        seed: file.seed,
        trials: file.trials,
        configurations: file.configurations,
        arms,
        errors: file.errors.clone(),
        levels: file.tool_errors.clone(),
        cases: Vec::new(),
        methods,
    };
    for spec in &file.methods {
        check_method(spec, file, registry)?;
    }
    for spec in &file.cases {
        let case = study.case(spec, file, registry)?;
        study.cases.push(case);
    }
    Ok(study)
}

/// A method must be for one of the cases, at least.
fn check_method(
    spec: &MethodSpec,
    file: &StudyFile,
    registry: &Registry,
) -> Result<(), InputError> {
    let Some(form) = &spec.form else {
        return Ok(());
    };
    if file
        .cases
        .iter()
        .any(|case| forms(Some(form), case, registry).is_some())
    {
        return Ok(());
    }
    let methods = || registry.methods().iter();
    let message = if methods().any(|method| method.name() == form.value) {
        format!("the method `{}` is for none of the cases", form.value)
    } else {
        format!("there is no method `{}`", form.value)
    };
    let known: Vec<String> = methods()
        .flat_map(|method| method.kinds().iter().map(|kind| (method.name(), *kind)))
        .map(|(name, kind)| format!("{name} ({kind})"))
        .collect();
    let help = match known.as_slice() {
        [] => "leave `method` out".to_owned(),
        known => format!(
            "the methods are {}; or leave `method` out",
            known.join(", ")
        ),
    };
    Err(file
        .source
        .error_at(form.span.clone(), message)
        .with_help(help))
}

/// The forms of a case's sets, if the method is for all of them.
fn forms(method: Option<&Spanned<String>>, case: &CaseSpec, registry: &Registry) -> Option<Forms> {
    let form = |kind: &dyn Kind| match method {
        None => Some(None),
        Some(method) => registry
            .method(&method.value, kind.name())
            .cloned()
            .map(Some),
    };
    case.constraints
        .iter()
        .map(|spec| form(&*spec.kind))
        .collect()
}

impl Study {
    /// Understands a case: tries its methods on the nominal robot, which shows what is estimated.
    fn case(&self, spec: &CaseSpec, file: &StudyFile, registry: &Registry) -> Result<Case, Error> {
        let nowhere: Vec<Vec<bool>> = self
            .arms
            .iter()
            .map(|arm| vec![false; arm.robot.parameters().len()])
            .collect();
        let noise = spec.constraints.iter().map(|constraint| {
            // A rotation at an arm's length.
            noise(constraint).into_iter().fold(0.0, f64::max)
        });
        let noise = noise.fold(0.0, f64::max);
        let methods = file.methods.iter();
        let mut case = Case {
            name: spec.name.clone(),
            constraints: spec.constraints.clone(),
            chosen: nowhere.clone(),
            comparable: false,
            scale_free: false,
            tolerance: file.tolerance.unwrap_or(EXACT + NOISE * noise),
            forms: methods
                .map(|method| forms(method.form.as_ref(), spec, registry))
                .collect(),
        };
        let drawn = self.example(&case, spec)?;
        let mut identifiable: Option<Vec<Vec<bool>>> = None;
        for (m, method) in self.methods.iter().enumerate() {
            let Some(estimated) = self.estimate(&case, m, &drawn, Registration::Never) else {
                continue;
            };
            let estimated = estimated.map_err(|error| self.about(error, spec, method))?;
            let mut own = nowhere.clone();
            for (column, choice) in estimated.columns.iter().zip(&estimated.choices) {
                if let (Owner::Parameter { robot, parameter }, true) = (
                    &column.owner,
                    matches!(choice, Choice::Estimated | Choice::Unexcited),
                ) {
                    own[*robot][*parameter] = true;
                }
                case.scale_free |= matches!(choice, Choice::Anchor(_));
            }
            let both = identifiable.get_or_insert_with(|| own.clone());
            for (both, own) in both.iter_mut().flatten().zip(own.iter().flatten()) {
                *both &= own;
            }
        }
        let Some(identifiable) = identifiable else {
            let message = format!("no method is for the case `{}`", case.name);
            return Err(self
                .source
                .error_at(spec.span.clone(), message)
                .with_help("add a [[method]] without `method`, which is for everything")
                .into());
        };
        case.chosen = self.chosen(&identifiable)?;
        let wrong = case.chosen.iter().flatten();
        case.comparable = wrong
            .zip(identifiable.iter().flatten())
            .all(|(wrong, identifiable)| !wrong || *identifiable);
        // Where nothing but what is estimated is wrong, what anchors the scale is right.
        case.scale_free &= !case.comparable;
        Ok(case)
    }

    /// Measurements of the nominal robot.
    fn example(&self, case: &Case, spec: &CaseSpec) -> Result<Drawn, Error> {
        let nominal: Vec<Vec<f64>> = self.arms.iter().map(|arm| arm.robot.nominal()).collect();
        let stream = Stream {
            seed: self.seed,
            level: 0,
            trial: self.cases.len(),
        };
        let (drawn, attempts) = draw::measurements(self, case, &nominal, stream, Purpose::Example)?;
        drawn.ok_or_else(|| {
            let message = format!(
                "the nominal robot cannot make the measurements of the case `{}` ({attempts} attempts)",
                case.name
            );
            self.source
                .error_at(spec.span.clone(), message)
                .with_help("check where planes and points are, the units and the joint limits")
                .into()
        })
    }

    /// A case's measurements estimated by a method; none if it is not for them.
    pub(super) fn estimate(
        &self,
        case: &Case,
        method: usize,
        drawn: &Drawn,
        registration: Registration,
    ) -> Option<Result<Estimated, Error>> {
        let forms = case.forms[method].as_ref()?;
        let mut sets = drawn.sets.clone();
        for (set, form) in sets.iter_mut().zip(forms) {
            if let Some(form) = form {
                if let Err(message) = form.check(&*set.kind, &set.readings) {
                    let message = format!("`{}`: {message}", set.name);
                    let help = "change the measurements, or leave `method` out";
                    return Some(Err(Error::calibration(message, help)));
                }
                set.method = Some(form.clone());
            }
        }
        let mut calibration = Calibration {
            estimate: self.methods[method].estimate.clone(),
            ..Calibration::new(self.arms.clone(), sets)
        };
        if self.methods[method].from_truth {
            calibration.estimate.from = Some(drawn.truth.robots.clone());
        }
        Some(calibration.estimate_only(registration))
    }

    /// An error of the example, at the case it is in.
    fn about(&self, error: Error, spec: &CaseSpec, method: &Method) -> Error {
        let (message, help) = match error {
            Error::Calibration { message, help } | Error::Unreachable { message, help } => {
                (message, help)
            }
            other => (
                other.to_string(),
                "check the robot and the case for values that make no sense".to_owned(),
            ),
        };
        let message = format!(
            "the case `{}` cannot be estimated with `{}`: {message}",
            spec.name, method.name
        );
        self.source
            .error_at(spec.span.clone(), message)
            .with_help(help)
            .into()
    }

    /// Which parameters have errors.
    fn chosen(&self, identifiable: &[Vec<bool>]) -> Result<Vec<Vec<bool>>, InputError> {
        let names = Names {
            source: &self.source,
            arms: &self.arms,
        };
        let mut chosen: Vec<Vec<bool>> = identifiable
            .iter()
            .map(|of| vec![false; of.len()])
            .collect();
        for (texts, choice) in [(&self.errors.parameters, true), (&self.errors.fixed, false)] {
            for text in texts {
                if text.value == "identifiable" {
                    let all = chosen.iter_mut().flatten();
                    all.zip(identifiable.iter().flatten())
                        .filter(|(_, identifiable)| **identifiable)
                        .for_each(|(chosen, _)| *chosen = choice);
                    continue;
                }
                for (r, p) in names.find(text)? {
                    chosen[r][p] = choice;
                }
            }
        }
        Ok(chosen)
    }
}
