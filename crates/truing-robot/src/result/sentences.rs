//! Doubts in words, with what to do.

use crate::doubt::{Doubt, Forecast, SearchEnd, Suspect};
use std::fmt;

/// How the sentence of a fatal doubt starts.
const DISTRUST: &str = "not to be trusted: ";

/// A length in millimetres, in as many digits as say something.
fn mm(length: f64) -> String {
    let mm = length * 1e3;
    if mm == 0.0 || (1e-4..1e7).contains(&mm.abs()) {
        if mm.abs() < 1.0 {
            format!("{mm:.4} mm")
        } else {
            format!("{mm:.2} mm")
        }
    } else {
        format!("{mm:.2e} mm")
    }
}

impl fmt::Display for Suspect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::ZeroOffset { joint, offset } => write!(
                f,
                "joint `{joint}`: the data fit a zero offset of {:.2}°; correct the file",
                offset.to_degrees()
            ),
            Self::Direction { joint } => write!(
                f,
                "joint `{joint}`: the data fit a joint that counts the other way; change the sign of its column, or set its gain to −1"
            ),
            Self::Swapped { joint, other } => write!(
                f,
                "joints `{joint}` and `{other}`: the data fit with their columns exchanged; correct the header or `columns`"
            ),
            Self::Shifted { set, rows } => write!(
                f,
                "`{set}`: the data fit with joint values and readings {rows} row apart; the columns are shifted against each other"
            ),
            Self::Mirrored { set } => write!(
                f,
                "`{set}`: the data fit with one axis of the sensor reversed; its frame is left-handed, so change the sign of one column"
            ),
            Self::Degrees => write!(
                f,
                "the data fit with joint values in degrees; write the unit into the header, `q1 [deg]`"
            ),
            Self::Scale { set, factor } => write!(
                f,
                "`{set}`: the data fit with readings {factor:.5} times as long; the unit of its columns is another one"
            ),
        }
    }
}

impl fmt::Display for Doubt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.is_fatal() {
            f.write_str(DISTRUST)?;
        }
        match self {
            Self::HeldOutWorse { set, calibrated, nominal, registered, .. } => write!(
                f,
                "the calibrated robot predicts `{set}` worse than {}: {:.4} mm against {:.4} mm RMS on rows that were not used",
                if *registered { "the registered nominal one" } else { "the nominal robot of the file" },
                calibrated * 1e3,
                nominal * 1e3
            ),
            Self::Absurd { set, error, reach } => write!(
                f,
                "the calibrated robot predicts `{set}` {:.1} mm wrong on rows that were not used, and reaches {:.0} mm: are \
                 the units of the robot file right, and those of the data?",
                error * 1e3,
                reach * 1e3
            ),
            Self::Prediction { forecast, ratio, gain, clusters } => {
                let how = match forecast {
                    Forecast::Worse => "worse than",
                    _ => "no better, beyond chance, than",
                };
                write!(
                    f,
                    "the calibrated robot predicts measurements that it was not estimated from {how} the registered nominal one: \
                     errors {ratio:.2} times as large over {clusters} clusters of postures left out in turn ({gain:.1} standard \
                     errors); measure more, in more varied postures, or estimate fewer parameters"
                )
            }
            Self::OnePosture => f.write_str(
                "everything was measured in one posture, so nothing shows how the robot predicts another; measure in varied postures",
            ),
            Self::Elsewhere { robot, expected, nominal, gain, measured, .. } => write!(
                f,
                "{} the tool of {robot} is expected to be {} RMS off, and that of the nominal robot {}, which is no difference \
                 beyond chance ({gain:.1} standard errors); {}",
                if *measured { "where it was measured" } else { "all over the ranges of its joints" },
                mm(*expected),
                mm(*nominal),
                if *measured {
                    "measure more, or estimate fewer parameters"
                } else {
                    "use the result near the postures that were measured, or measure in others too"
                }
            ),
            Self::Grown { robot, factor, share } => write!(
                f,
                "the calibration makes {robot} {factor:.5} times as large, which is {:.0} % of what it changes: lengths of the \
                 robot file or readings of the sensor are in another unit or scale; compare one length that both know",
                share * 100.0
            ),
            Self::Input { suspect, before, after } => {
                write!(f, "{suspect} (weighted residuals of the nominal robot {before:.4} RMS, corrected {after:.4})")
            }
            Self::Deformed { robot, change, total } => write!(
                f,
                "the lengths of {robot} moved by {:.0} mm in all, of {total:.3} m: no drawing is that wrong; either the data hardly \
                 determine them (add a `prior` about nominal, or measurements that do), or the file is of another robot",
                change * 1e3
            ),
            Self::Collapsed => f.write_str(
                "the estimated robot fits because its joints hardly matter any more: it has collapsed, or its axes have turned \
                 parallel; add a `prior` about nominal, or measurements that hold its size",
            ),
            Self::Inseparable { reason } => write!(
                f,
                "at this solution some unknowns cannot be told apart, so there are no standard deviations ({reason})"
            ),
            Self::FrameUndetermined { frame, component } => write!(
                f,
                "the sensor frame `{frame}` is not determined by its readings ({component}): read at least three places that are \
                 not in one line"
            ),
            Self::NothingDetermined => f.write_str(
                "these data determine none of the robot parameters that were asked for: measure in more varied postures",
            ),
            Self::Unchecked { rows } => write!(
                f,
                "there are as many unknowns as measured values of different postures, {rows}: they fit whatever was measured, and nothing \
                 checks them; measure in more postures"
            ),
            Self::FarStart { starts, rms, end } => {
                let far = "the nominal robot is far from what was measured, and a few plain steps did not fit it";
                let tried = match starts {
                    1 => "one continuation".to_owned(),
                    n => format!("{n} continuations from places near it"),
                };
                match end {
                    SearchEnd::Found => write!(f, "{far}: found by {tried}"),
                    SearchEnd::Stopped => write!(f, "{far}; the search for a better start was stopped after {tried}"),
                    SearchEnd::Unsure => write!(
                        f,
                        "{far}; {tried} led to none that is down to the noise (weighted residuals of {rms:.1} RMS at best), nor two \
                         to the same one: the robot file, its units, the measurements or their `sigma` may be wrong"
                    ),
                }
            }
            Self::Misfit { sigma0, causes, .. } => {
                write!(f, "residuals are {sigma0:.1} times as large as the stated noise")?;
                let Some(first) = causes.first() else {
                    return f.write_str(
                        ": `sigma` is too small, or something moves the robot that its model does not have; what is said of the \
                         tool counts them",
                    );
                };
                let with = match &first.joint {
                    Some(joint) => format!(
                        "the sine and cosine of joint `{joint}`: try `model = [\"gain\", \"harmonics(2)\"]` there"
                    ),
                    None => "the number of the row, a drift: measure again, from last to first".to_owned(),
                };
                write!(
                    f,
                    "; in `{}` {:.0} % of their squares go with {with}",
                    first.set,
                    first.share * 100.0
                )
            }
            Self::Duplicated { set, rows, postures } => write!(
                f,
                "the {rows} rows of `{set}` are of {postures} postures: rows of one posture count together where predictions are judged"
            ),
            Self::Note { text } => f.write_str(text),
        }
    }
}
