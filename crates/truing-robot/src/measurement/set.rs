//! Sets of measurements of one kind.

use super::groups::{Groups, Rows};
use super::kind::Kind;
use super::measurand::Measurand;
use super::method::Method;
use super::readings::{Readings, Tool};
use crate::robot::Unit;
use std::ops::{Deref, DerefMut};
use std::sync::Arc;
use truing::Loss;

/// Measurements of one kind, by one sensor, with one tool or two: [`Readings`] and what they mean.
#[derive(Debug, Clone)]
pub struct MeasurementSet {
    /// What was measured.
    pub kind: Arc<dyn Kind>,
    /// Other equations than the kind's own for the same measurements.
    pub method: Option<Arc<dyn Method>>,
    /// What was read.
    pub readings: Readings,
}

impl Deref for MeasurementSet {
    type Target = Readings;

    fn deref(&self) -> &Readings {
        &self.readings
    }
}

impl DerefMut for MeasurementSet {
    fn deref_mut(&mut self) -> &mut Readings {
        &mut self.readings
    }
}

impl MeasurementSet {
    /// A set of rows of the tool of robot number 0, without groups, with the kind's usual noise, in the
    /// reference frame. Where there are two tools, both start as that robot's.
    pub fn new(name: impl Into<String>, kind: impl Kind, q: Vec<Vec<f64>>, values: Rows) -> Self {
        Self::of(name, Arc::new(kind), q, values)
    }

    /// The same of a kind that is shared.
    pub fn of(
        name: impl Into<String>,
        kind: Arc<dyn Kind>,
        q: Vec<Vec<f64>>,
        values: Rows,
    ) -> Self {
        let rows = q.len();
        let tool = Tool {
            q,
            ..Tool::default()
        };
        let usual: Vec<f64> = kind.measurands().iter().map(|m| m.sigma).collect();
        Self {
            readings: Readings {
                name: name.into(),
                tools: vec![tool; kind.tools()],
                values,
                groups: Groups::single(rows),
                sigma: Rows::repeated(&usual, rows),
                loss: Loss::Trivial,
                frame: None,
                frame_guess: None,
                origin: None,
            },
            kind,
            method: None,
        }
    }

    /// The same set of another robot.
    #[must_use]
    pub fn robot(mut self, robot: usize) -> Self {
        self.tools.iter_mut().for_each(|tool| tool.robot = robot);
        self
    }

    /// The same set with rows grouped by equal labels.
    #[must_use]
    pub fn groups(mut self, labels: impl IntoIterator<Item = impl Into<String>>) -> Self {
        self.readings.groups = Groups::by_label(labels);
        self
    }

    /// The same set with another second tool.
    #[must_use]
    pub fn second(mut self, tool: Tool) -> Self {
        self.tools.truncate(1);
        self.tools.push(tool);
        self
    }

    /// The same set measured at a tool point, or a body on the tool, that is estimated.
    #[must_use]
    pub fn target(mut self, name: &str) -> Self {
        let robot = self.tools[0].robot;
        for tool in self.tools.iter_mut().filter(|tool| tool.robot == robot) {
            tool.target = Some(name.to_owned());
        }
        self
    }

    /// The same set measured in a sensor's frame that is estimated.
    #[must_use]
    pub fn frame(mut self, name: &str) -> Self {
        self.readings.frame = Some(name.to_owned());
        self
    }

    /// The same set with a robust loss.
    #[must_use]
    pub fn loss(mut self, loss: Loss) -> Self {
        self.readings.loss = loss;
        self
    }

    /// The same set with other equations.
    #[must_use]
    pub fn method(mut self, method: Arc<dyn Method>) -> Self {
        self.method = Some(method);
        self
    }

    /// The same set with other standard deviations of all rows, one a measurand; those left out stay.
    #[must_use]
    pub fn sigma(mut self, sigma: &[f64]) -> Self {
        for row in 0..self.len() {
            let own = self.readings.sigma.row_mut(row).iter_mut();
            own.zip(sigma).for_each(|(own, sigma)| *own = *sigma);
        }
        self
    }

    /// The same measurements with the kind's own equations, in which errors are reported.
    #[must_use]
    pub fn plain(&self) -> Self {
        Self {
            method: None,
            ..self.clone()
        }
    }

    /// The same measurements, weighed by their standard deviations alone: a robust loss weighs rows by
    /// how far an estimate is off.
    #[must_use]
    pub fn unweighted(&self) -> Self {
        let mut set = self.clone();
        set.readings.loss = Loss::Trivial;
        set
    }

    /// The same set without its standard deviations: structure knows no noise.
    #[must_use]
    pub fn noiseless(&self) -> Self {
        let mut set = self.clone();
        set.readings.sigma = Rows::new(self.sigma.width());
        set
    }

    /// Some of the rows, in the given order. Groups keep their names and numbers.
    #[must_use]
    pub fn rows(&self, rows: &[usize]) -> Self {
        Self {
            readings: self.readings.rows(rows),
            ..self.clone()
        }
    }

    /// Number of measurements.
    pub fn len(&self) -> usize {
        self.readings.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.readings.is_empty()
    }

    /// Residual rows of each measurement.
    pub fn dim(&self) -> usize {
        self.kind.measurands().iter().map(|m| m.rows).sum()
    }

    /// The standard deviation of a row's first length \[m\]; none where no length is measured.
    pub fn length_sigma(&self, row: usize) -> Option<f64> {
        let length = |m: &Measurand| m.unit == Unit::Meter;
        let k = self.kind.measurands().iter().position(length)?;
        Some(self.sigma.row(row)[k])
    }

    /// Whether its equations leave out the unknowns that its errors are reported with.
    pub fn eliminates(&self) -> bool {
        let method = self.method.as_ref();
        method.is_some_and(|method| method.eliminates(&*self.kind))
    }
}
