//! The frames of a robot: which function each is, and what moves it.

use super::frame::{
    AnyFrameModel, Base, DenavitHartenberg, KhalilKleinfinger, TableFrame, differentiate_after,
    general, lifted,
};
use super::frame_row::{Convention, GeneralFrame};
use super::joint_kind::JointKind;
use super::joint_model::{AnyJointModel, MOST};
use super::twist::{Twist, twist_in_reference};
use std::any::TypeId;
use std::ops::Range;
use std::sync::Arc;
use truing::manifold::Pose;
use truing::{Dual, Scalar, value};

/// Which function a frame is; a match and not a pointer, so that forward kinematics stay generic.
#[derive(Debug, Clone)]
pub(super) enum FrameFunction {
    Base,
    KhalilKleinfinger,
    DenavitHartenberg,
    General(Box<GeneralFrame>),
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
    #[inline(always)]
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
    #[inline(always)]
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
    #[inline(always)]
    pub fn displacement<T: Scalar>(&self, parameters: &[T], row: &[f64]) -> T {
        match &self.motion {
            Some(motion) => motion.displacement(parameters, row),
            None => T::zero(),
        }
    }

    /// parent_from_frame, from its own parameters and the displacement of its joint.
    pub fn transform<T: Scalar>(&self, own: &[T], displacement: T) -> Pose<T> {
        self.place(own, displacement, |local| local)
    }

    /// base_from_frame, from base_from_parent.
    #[inline]
    pub(super) fn after<T: Scalar>(&self, parent: &Pose<T>, own: &[T], displacement: T) -> Pose<T> {
        self.place(own, displacement, |local| parent.compose(&local))
    }

    /// Hands parent_from_frame on as it is made: written out for each function, so that it stays in registers.
    #[inline(always)]
    fn place<T: Scalar>(
        &self,
        own: &[T],
        displacement: T,
        then: impl Fn(Pose<T>) -> Pose<T>,
    ) -> Pose<T> {
        let (turns, adds_to) = self.moved();
        match &self.function {
            FrameFunction::Base => then(Base::transform(own)),
            FrameFunction::KhalilKleinfinger => {
                by_table::<KhalilKleinfinger, T>(own, adds_to, displacement, then)
            }
            FrameFunction::DenavitHartenberg => {
                by_table::<DenavitHartenberg, T>(own, adds_to, displacement, then)
            }
            FrameFunction::General(frame) => then(general(frame, turns, own, displacement)),
            FrameFunction::Custom(model) => then(lifted(model, own, displacement)),
        }
    }

    #[inline]
    fn moved(&self) -> (bool, Option<usize>) {
        let motion = self.motion.as_ref();
        (
            motion.is_none_or(|motion| motion.kind != JointKind::Prismatic),
            motion.and_then(|motion| motion.adds_to),
        )
    }

    /// [`after`](Self::after) with derivatives: the twists of its own parameters in the reference frame, and that of
    /// the displacement.
    #[inline]
    pub(super) fn differentiate(
        &self,
        parent: &Pose<f64>,
        own: &[f64],
        displacement: f64,
        twists: &mut [Twist],
    ) -> (Pose<f64>, Twist) {
        let (turns, adds_to) = self.moved();
        let pose = match &self.function {
            FrameFunction::Base => {
                let p = [own[0], own[1]];
                differentiate_after(parent, &p, Base::transform, twists)
            }
            FrameFunction::KhalilKleinfinger => differentiate_by_table::<KhalilKleinfinger>(
                parent,
                own,
                adds_to,
                displacement,
                twists,
            ),
            FrameFunction::DenavitHartenberg => differentiate_by_table::<DenavitHartenberg>(
                parent,
                own,
                adds_to,
                displacement,
                twists,
            ),
            FrameFunction::General(frame) => {
                let mut p = [0.0; 7];
                p[..6].copy_from_slice(own);
                p[6] = displacement;
                let mut all = [Twist::default(); 7];
                let place = |p: &[Dual<7>]| general(frame, turns, &p[..6], p[6]);
                let pose = differentiate_after(parent, &p, place, &mut all);
                twists.copy_from_slice(&all[..6]);
                return (pose, all[6]);
            }
            FrameFunction::Custom(model) => {
                let local = model.differentiate(own, displacement);
                for (twist, own) in twists.iter_mut().zip(&local.twists) {
                    *twist = twist_in_reference(parent, own);
                }
                let moved = twist_in_reference(parent, &local.twists[own.len()]);
                return (parent.compose(&local.pose), moved);
            }
        };
        (pose, adds_to.map_or_else(Twist::default, |k| twists[k]))
    }
}

/// A frame of a table, with or without β.
#[inline(always)]
fn by_table<F: TableFrame, T: Scalar>(
    own: &[T],
    adds_to: Option<usize>,
    displacement: T,
    then: impl Fn(Pose<T>) -> Pose<T>,
) -> Pose<T> {
    if own.len() == 5 {
        then(F::transform(&displaced::<5, T>(own, adds_to, displacement)))
    } else {
        then(F::transform(&displaced::<4, T>(own, adds_to, displacement)))
    }
}

/// The same with derivatives.
#[inline(always)]
fn differentiate_by_table<F: TableFrame>(
    parent: &Pose<f64>,
    own: &[f64],
    adds_to: Option<usize>,
    displacement: f64,
    twists: &mut [Twist],
) -> Pose<f64> {
    if own.len() == 5 {
        let p = displaced::<5, f64>(own, adds_to, displacement);
        differentiate_after(parent, &p, |p| F::transform(p), twists)
    } else {
        let p = displaced::<4, f64>(own, adds_to, displacement);
        differentiate_after(parent, &p, |p| F::transform(p), twists)
    }
}

/// Parameters with the displacement added to one of them.
#[inline(always)]
fn displaced<const W: usize, T: Scalar>(
    own: &[T],
    adds_to: Option<usize>,
    displacement: T,
) -> [T; W] {
    // Chosen and not indexed, so that they stay in registers.
    std::array::from_fn(|k| match adds_to {
        Some(place) if place == k => own[k] + displacement,
        _ => own[k],
    })
}
