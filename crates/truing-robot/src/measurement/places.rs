//! Drawing where things truly are: planes, points, locations and distances that a robot reaches.

use crate::robot::{Robot, posture};
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use truing::manifold::{Plane, Pose};
use truing::nalgebra::Vector3;

/// Draws places within reach of a robot.
pub struct Places<'a> {
    pub(crate) robot: &'a Robot,
    pub(crate) parameters: &'a [f64],
    /// The tool point \[m\].
    pub(crate) target: Vector3<f64>,
    /// Whether places are in the middle of the workspace, which many postures reach; otherwise each is where
    /// the tool is in one random posture.
    pub(crate) middle: bool,
    pub(crate) rng: &'a mut ChaCha8Rng,
}

/// So many random tips show where the middle is.
const TIPS: usize = 31;

impl Places<'_> {
    /// A unit vector.
    pub fn direction(&mut self) -> Vector3<f64> {
        let v: Vector3<f64> = Vector3::from_fn(|_, _| self.rng.sample(StandardNormal));
        v.try_normalize(1e-12).unwrap_or_else(Vector3::z)
    }

    /// A plane; in the middle, with as many random tips on one side as on the other, elsewhere through one
    /// tip.
    pub fn plane(&mut self) -> Plane<f64> {
        if self.middle {
            let normal = self.direction();
            let along = self.tips().iter().map(|tip| normal.dot(tip)).collect();
            return Plane {
                normal,
                distance: median(along),
            };
        }
        let (location, normal) = self.somewhere(false);
        Plane {
            normal,
            distance: normal.dot(&location.translation),
        }
    }

    /// A point; in the middle, the random tip that is nearest to all others.
    pub fn point(&mut self) -> Vector3<f64> {
        if !self.middle {
            return self.somewhere(false).0.translation;
        }
        let tips = self.tips();
        let far = |a: &Vector3<f64>| tips.iter().map(|b| (a - b).norm()).sum::<f64>();
        let nearest = tips.iter().min_by(|a, b| far(a).total_cmp(&far(b)));
        nearest.copied().unwrap_or_default()
    }

    /// Where the tool is in a posture from which all directions are free.
    pub fn location(&mut self) -> Pose<f64> {
        if !self.middle {
            return self.somewhere(true).0;
        }
        let q = posture::dexterous(self.robot, self.parameters, self.rng);
        self.robot.forward(self.parameters, &q)
    }

    /// The median distance of two random tips \[m\].
    pub fn distance(&mut self) -> f64 {
        let (a, b) = (self.tips(), self.tips());
        median(a.iter().zip(&b).map(|(a, b)| (a - b).norm()).collect())
    }

    /// A number between two limits.
    pub fn number(&mut self, lower: f64, upper: f64) -> f64 {
        lower + (upper - lower) * self.rng.random::<f64>()
    }

    fn tips(&mut self) -> Vec<Vector3<f64>> {
        let limits = posture::limits(self.robot);
        (0..TIPS)
            .map(|_| {
                let q = posture::random(&limits, self.rng);
                let tool = self.robot.forward(self.parameters, &q);
                tool.apply(&self.target)
            })
            .collect()
    }

    /// Where the tool is in a random posture, and a direction.
    fn somewhere(&mut self, dexterous: bool) -> (Pose<f64>, Vector3<f64>) {
        let q = if dexterous {
            posture::dexterous(self.robot, self.parameters, self.rng)
        } else {
            posture::random(&posture::limits(self.robot), self.rng)
        };
        let tool = self.robot.forward(self.parameters, &q);
        let location = Pose {
            translation: tool.apply(&self.target),
            rotation: tool.rotation,
        };
        (location, self.direction())
    }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or_default()
}
