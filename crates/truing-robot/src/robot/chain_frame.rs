//! The frames of a robot: which function each is, and what moves it.

use super::frame::{
    AnyFrameModel, LocalFrame, denavit_hartenberg, differentiate, general, khalil_kleinfinger,
    khalil_kleinfinger_base, lifted,
};
use super::frame_row::{Convention, GeneralFrame};
use super::joint_kind::JointKind;
use super::joint_model::{AnyJointModel, MOST};
use std::any::TypeId;
use std::ops::Range;
use std::sync::Arc;
use truing::manifold::Pose;
use truing::{Scalar, value};

/// Which function a frame is; a match and not a pointer, so that forward kinematics stay generic.
#[derive(Debug, Clone)]
pub(super) enum FrameFunction {
    Base,
    KhalilKleinfinger,
    DenavitHartenberg,
    General(GeneralFrame),
    Custom(Arc<dyn AnyFrameModel>),
}

/// One frame of the chain.
#[derive(Debug, Clone)]
pub struct Frame {
    /// All its parameters in the robot's vector: those of the frame, then those of its joint.
    pub parameters: Range<usize>,
    /// What moves it; none for a frame that stands.
    pub motion: Option<Motion>,
    /// How many of the parameters are the frame's own.
    pub(super) width: usize,
    pub(super) function: FrameFunction,
}

/// What moves a frame: its displacement is the sum of what its models say.
#[derive(Debug, Clone)]
pub struct Motion {
    /// The joint's name.
    pub name: String,
    /// How it moves.
    pub kind: JointKind,
    /// Number among the moving frames, by which a [`Regressor`](super::Regressor) has its motion.
    pub number: usize,
    /// Place of the frame's own parameter that the displacement adds to; none where it is a number of its own.
    pub(super) adds_to: Option<usize>,
    /// Place in the row of the reading that moves it.
    pub(super) reading: Option<usize>,
    /// The number of its gain.
    pub gain: Option<usize>,
    pub(super) terms: Vec<Term>,
}

/// A model of a joint, with its parameters and the places of its inputs.
#[derive(Debug, Clone)]
pub(super) struct Term {
    pub model: Arc<dyn AnyJointModel>,
    pub parameters: Range<usize>,
    pub inputs: Vec<usize>,
}

impl Term {
    fn inputs(&self, row: &[f64]) -> [f64; MOST] {
        let mut x = [0.0; MOST];
        let given = self.inputs.iter().map(|place| row[*place]);
        x.iter_mut().zip(given).for_each(|(x, given)| *x = given);
        x
    }

    /// What it adds: exact for numbers, to first order for dual numbers.
    fn add<T: Scalar>(&self, parameters: &[T], row: &[f64]) -> T {
        let x = self.inputs(row);
        let x = &x[..self.inputs.len()];
        let own = &parameters[self.parameters.clone()];
        let mut p = [0.0; MOST];
        p.iter_mut().zip(own).for_each(|(p, own)| *p = value(*own));
        if TypeId::of::<T>() == TypeId::of::<f64>() {
            return T::from(self.model.value(&p[..own.len()], x));
        }
        let mut slopes = [0.0; MOST];
        let at = self.model.by_parameters(&p[..own.len()], x, &mut slopes);
        own.iter()
            .zip(slopes)
            .fold(T::from(at), |sum, (own, slope)| {
                sum + (*own - T::from(value(*own))) * slope
            })
    }
}

impl Motion {
    /// The displacement [rad or m] with a robot's parameters at a row.
    #[inline]
    pub fn displacement<T: Scalar>(&self, parameters: &[T], row: &[f64]) -> T {
        let mut sum = match (self.gain, self.reading) {
            (Some(gain), Some(reading)) => parameters[gain] * row[reading],
            (None, Some(reading)) => T::from(row[reading]),
            _ => T::zero(),
        };
        for term in &self.terms {
            sum += term.add(parameters, row);
        }
        sum
    }

    /// The derivatives of the displacement by the parameters that it depends on, told one by one.
    pub fn by_parameters(&self, parameters: &[f64], row: &[f64], mut tell: impl FnMut(usize, f64)) {
        if let (Some(gain), Some(reading)) = (self.gain, self.reading) {
            tell(gain, row[reading]);
        }
        for term in &self.terms {
            let x = term.inputs(row);
            let mut slopes = [0.0; MOST];
            let own = &parameters[term.parameters.clone()];
            term.model
                .by_parameters(own, &x[..term.inputs.len()], &mut slopes);
            let numbers = term.parameters.clone();
            numbers.zip(slopes).for_each(|(k, slope)| tell(k, slope));
        }
    }

    /// The derivatives of the displacement by the readings that it depends on, told one by one; a reading may
    /// be told of more than once.
    pub fn by_readings(
        &self,
        parameters: &[f64],
        row: &[f64],
        readings: usize,
        mut tell: impl FnMut(usize, f64),
    ) {
        if let Some(reading) = self.reading {
            tell(reading, self.gain.map_or(1.0, |gain| parameters[gain]));
        }
        for term in &self.terms {
            let x = term.inputs(row);
            let mut slopes = [0.0; MOST];
            let own = &parameters[term.parameters.clone()];
            term.model
                .by_inputs(own, &x[..term.inputs.len()], &mut slopes);
            for (place, slope) in term.inputs.iter().zip(slopes) {
                if *place < readings {
                    tell(*place, slope);
                }
            }
        }
    }
}

impl Frame {
    /// The convention of the frame; none for a model from outside.
    pub fn convention(&self) -> Option<Convention> {
        match self.function {
            FrameFunction::Base | FrameFunction::KhalilKleinfinger => {
                Some(Convention::KhalilKleinfinger)
            }
            FrameFunction::DenavitHartenberg => Some(Convention::DenavitHartenberg),
            FrameFunction::General(_) => Some(Convention::General),
            FrameFunction::Custom(_) => None,
        }
    }

    /// The frame's own parameters, without those of its joint.
    pub fn own_parameters(&self) -> Range<usize> {
        self.parameters.start..self.parameters.start + self.width
    }

    /// The displacement of its joint with a robot's parameters at a row; zero where none moves it.
    #[inline]
    pub fn displacement<T: Scalar>(&self, parameters: &[T], row: &[f64]) -> T {
        match &self.motion {
            Some(motion) => motion.displacement(parameters, row),
            None => T::zero(),
        }
    }

    /// parent_from_frame, from its own parameters and the displacement of its joint.
    #[inline]
    pub fn transform<T: Scalar>(&self, own: &[T], displacement: T) -> Pose<T> {
        let (turns, adds_to) = self.moved();
        match &self.function {
            FrameFunction::Base => khalil_kleinfinger_base(own),
            FrameFunction::KhalilKleinfinger => {
                khalil_kleinfinger(&displaced(own, adds_to, displacement)[..own.len()])
            }
            FrameFunction::DenavitHartenberg => {
                denavit_hartenberg(&displaced(own, adds_to, displacement)[..own.len()])
            }
            FrameFunction::General(frame) => general(frame, turns, own, displacement),
            FrameFunction::Custom(model) => lifted(model, own, displacement),
        }
    }

    fn moved(&self) -> (bool, Option<usize>) {
        let motion = self.motion.as_ref();
        (
            motion.is_none_or(|motion| motion.kind != JointKind::Prismatic),
            motion.and_then(|motion| motion.adds_to),
        )
    }

    /// The same with derivatives by its own parameters, as twists in the parent frame; the place of the twist of
    /// the displacement comes back.
    #[inline]
    pub(super) fn differentiate(
        &self,
        own: &[f64],
        displacement: f64,
        out: &mut LocalFrame,
    ) -> usize {
        let (turns, adds_to) = self.moved();
        match &self.function {
            FrameFunction::Base => differentiate::<2>(own, khalil_kleinfinger_base, out),
            FrameFunction::KhalilKleinfinger => {
                let p = displaced(own, adds_to, displacement);
                if own.len() == 5 {
                    differentiate::<5>(&p, khalil_kleinfinger, out);
                } else {
                    differentiate::<4>(&p, khalil_kleinfinger, out);
                }
            }
            FrameFunction::DenavitHartenberg => {
                let p = displaced(own, adds_to, displacement);
                if own.len() == 5 {
                    differentiate::<5>(&p, denavit_hartenberg, out);
                } else {
                    differentiate::<4>(&p, denavit_hartenberg, out);
                }
            }
            FrameFunction::General(frame) => {
                let mut p = [0.0; 7];
                p[..6].copy_from_slice(own);
                p[6] = displacement;
                differentiate::<7>(&p, |p| general(frame, turns, &p[..6], p[6]), out);
            }
            FrameFunction::Custom(model) => *out = model.differentiate(own, displacement),
        }
        adds_to.unwrap_or(own.len())
    }
}

/// Parameters with the displacement added to one of them.
#[inline]
fn displaced<T: Scalar>(own: &[T], adds_to: Option<usize>, displacement: T) -> [T; 5] {
    let mut p = [T::zero(); 5];
    p[..own.len()].copy_from_slice(own);
    if let Some(place) = adds_to {
        p[place] += displacement;
    }
    p
}
