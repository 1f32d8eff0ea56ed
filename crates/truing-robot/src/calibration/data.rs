//! The rows of a data file as one constraint reads them.

use super::measurement::{Arm, Groups, Sigma};
use super::names::listed;
use crate::file::{
    CalibrationFile, ConstraintSpec, Dimension, InputError, Kind, PlaneSpec, SigmaSpec, Table,
    nearest,
};
use crate::kinematics::JointKind;
use std::ops::Range;
use truing::manifold::{Plane, Pose, so3};
use truing::nalgebra::Vector3;

/// The data of one constraint while it is read: a table and the rows in use.
pub(super) struct Data<'a> {
    pub file: &'a CalibrationFile,
    pub spec: &'a ConstraintSpec,
    pub table: &'a Table,
    pub rows: Vec<usize>,
}

impl Data<'_> {
    /// The column a quantity is read from: as mapped, or of its own name.
    fn column(&self, name: &str) -> (String, Option<Range<usize>>) {
        match self.spec.columns.iter().find(|(from, _)| from == name) {
            Some((_, to)) => (to.value.clone(), Some(to.span.clone())),
            None => (name.to_owned(), None),
        }
    }

    fn numbers(&self, name: &str, dimension: Dimension) -> Result<Vec<f64>, InputError> {
        let (column, span) = self.column(name);
        let error = match self
            .table
            .numbers(&column, dimension, &self.spec.units, &self.rows)
        {
            Ok(numbers) => return Ok(numbers),
            Err(error) => error,
        };
        Err(match span {
            // The name in `columns` is wrong, not the data.
            Some(span) if !self.table.has(&column) => error.moved_to(&self.file.source, span),
            _ => error,
        })
    }

    /// Joint values of a robot, one row a measurement; `suffix` marks a second posture. Columns in
    /// `taken` are other joints' already.
    pub fn joints(
        &self,
        arm: &Arm,
        suffix: &str,
        taken: &mut Vec<String>,
    ) -> Result<Vec<Vec<f64>>, InputError> {
        let mut q = vec![Vec::with_capacity(arm.robot.joints().len()); self.rows.len()];
        for (k, joint) in arm.robot.joints().iter().enumerate() {
            let dimension = if joint.kind == JointKind::Prismatic {
                Dimension::Length
            } else {
                Dimension::Angle
            };
            let candidates = joint_columns(arm, k, suffix);
            let mapped = candidates
                .iter()
                .find(|name| self.spec.columns.iter().any(|(from, _)| from == *name));
            let name = mapped.or_else(|| candidates.iter().find(|name| self.table.has(name)));
            let values = match (name, joint.value) {
                (Some(name), _) => {
                    let (column, span) = self.column(name);
                    if taken.contains(&column) {
                        let message = format!(
                            "joint `{}{suffix}` would be read from column `{column}`, which is another joint's already",
                            joint.name
                        );
                        let error = match span {
                            Some(span) => self.file.error_at(span, message),
                            None => self.table.header_error(message),
                        };
                        return Err(error.with_help(format!(
                            "name each joint's column in the calibration file, columns = {{ \"{}\" = \"…\" }}",
                            joint_columns(arm, k, suffix)[0]
                        )));
                    }
                    taken.push(column);
                    self.numbers(name, dimension)?
                }
                (None, Some(value)) => vec![value; self.rows.len()],
                (None, None) => {
                    let columns: Vec<String> =
                        self.table.column_names().map(str::to_owned).collect();
                    let wanted = match candidates[0]
                        .contains(|c: char| !(c.is_ascii_alphanumeric() || "_-".contains(c)))
                    {
                        true => format!("\"{}\"", candidates[0]),
                        false => candidates[0].clone(),
                    };
                    // A column that is another joint's is not this one's with a slip of the pen.
                    let joints = 0..arm.robot.joints().len();
                    let others: Vec<String> =
                        joints.flat_map(|k| joint_columns(arm, k, "")).collect();
                    let free = columns.iter().filter(|column| !others.contains(column));
                    let near = nearest(&candidates[0], free.map(String::as_str));
                    let column = near.unwrap_or("…");
                    return Err(self.table.header_error(format!(
                        "there is no column for joint `{}{suffix}`; the columns are {}",
                        joint.name,
                        listed(&columns)
                    ))
                    .with_help(format!(
                        "say in the calibration file which it is, columns = {{ {wanted} = \"{column}\" }}; \
                         if the joint is parked, give it a `value` in the robot file"
                    )));
                }
            };
            for (row, value) in q.iter_mut().zip(values) {
                row.push(value);
            }
        }
        Ok(q)
    }

    /// Every name in `columns` must be one that is read.
    pub fn check_columns(&self, arms: &[Arm]) -> Result<(), InputError> {
        let measured = [
            "x", "y", "z", "qw", "qx", "qy", "qz", "sigma", "plane", "point", "location",
        ];
        let mut known: Vec<String> = measured.map(str::to_owned).to_vec();
        known.extend(self.spec.group.iter().cloned());
        for arm in arms {
            for k in 0..arm.robot.joints().len() {
                known.extend(joint_columns(arm, k, ""));
                if self.spec.kind == Kind::Distance {
                    known.extend(joint_columns(arm, k, "b"));
                }
            }
        }
        let unknown = self
            .spec
            .columns
            .iter()
            .find(|(name, _)| !known.contains(name));
        let Some((name, column)) = unknown else {
            return Ok(());
        };
        let joints: Vec<String> = arms
            .iter()
            .flat_map(|arm| {
                (0..arm.robot.joints().len()).map(|k| joint_columns(arm, k, "").swap_remove(0))
            })
            .collect();
        let help = match nearest(name, known.iter().map(String::as_str)) {
            Some(near) => format!("did you mean `{near}`?"),
            None => format!(
                "what is read is {}, and the joints {}",
                measured.join(", "),
                listed(&joints)
            ),
        };
        let message = format!("`columns`: nothing is read as `{name}`");
        Err(self
            .file
            .error_at(column.span.clone(), message)
            .with_help(help))
    }

    pub fn points(&self) -> Result<Vec<Vector3<f64>>, InputError> {
        let [x, y, z] = ["x", "y", "z"].map(|name| self.numbers(name, Dimension::Length));
        let (x, y, z) = (x?, y?, z?);
        Ok((0..self.rows.len())
            .map(|k| Vector3::new(x[k], y[k], z[k]))
            .collect())
    }

    /// The poses, and how many quaternions had to be normalised.
    pub fn poses(&self) -> Result<(Vec<Pose<f64>>, usize), InputError> {
        let points = self.points()?;
        let [w, x, y, z] = ["qw", "qx", "qy", "qz"].map(|name| self.numbers(name, Dimension::None));
        let (w, x, y, z) = (w?, x?, y?, z?);
        let mut renormalised = 0;
        let mut poses = Vec::with_capacity(points.len());
        for (k, point) in points.into_iter().enumerate() {
            let q = [w[k], x[k], y[k], z[k]];
            let length = q.iter().map(|c| c * c).sum::<f64>().sqrt();
            if (length - 1.0).abs() > 0.01 {
                return Err(self
                    .table
                    .error_at(
                        self.rows[k],
                        format!(
                            "the quaternion ({:.4}, {:.4}, {:.4}, {:.4}) has length {length:.4}; expected 1",
                            q[0], q[1], q[2], q[3]
                        ),
                    )
                    .with_help("give unit quaternions as qw, qx, qy, qz (w first)"));
            }
            if (length - 1.0).abs() > 1e-5 {
                renormalised += 1;
            }
            let unit = q.map(|c| c / length);
            poses.push(Pose {
                rotation: so3::quaternion_matrix(&unit),
                translation: point,
            });
        }
        Ok((poses, renormalised))
    }

    pub fn groups(&self, default: &str) -> Result<Groups, InputError> {
        let names: Vec<String> = if self.spec.group.is_empty() {
            vec![default.to_owned()]
        } else {
            self.spec.group.clone()
        };
        let mut labels = vec![Vec::new(); self.rows.len()];
        for name in &names {
            let (column, _) = self.column(name);
            if !self.table.has(&column) {
                if self.spec.group.is_empty() && default == "plane" {
                    // Without a column all touches are of one plane.
                    return Ok(Groups::by_label(
                        self.rows.iter().map(|_| "plane".to_owned()),
                    ));
                }
                let columns: Vec<String> = self.table.column_names().map(str::to_owned).collect();
                return Err(self
                    .file
                    .error_at(
                        self.spec.span_of("group"),
                        format!("`{}` has no column `{column}` to group by; its columns are {}", self.spec.name, listed(&columns)),
                    )
                    .with_help(match nearest(&column, self.table.column_names()) {
                        Some(near) => format!("did you mean `{near}`?"),
                        None => "name the columns that tell one plane, point or location from another, like group = [\"plane\", \"rep\"]".to_owned(),
                    }));
            }
            let cells = self.table.strings(&column, &self.rows)?;
            for ((label, cell), row) in labels.iter_mut().zip(cells).zip(&self.rows) {
                if cell.is_empty() {
                    let message = format!(
                        "column `{column}`: found an empty cell; expected the name of a group"
                    );
                    return Err(self
                        .table
                        .error_at(*row, message)
                        .with_help("fill it in, or leave the row out with `rows`"));
                }
                label.push(cell.to_owned());
            }
        }
        Ok(Groups::by_label(
            labels.into_iter().map(|label| label.join("/")),
        ))
    }

    pub fn sigmas(&self) -> Result<Vec<Sigma>, InputError> {
        let mut sigma = Sigma::default();
        match self.spec.sigma {
            None => {}
            Some(SigmaSpec::Single(quantity)) => {
                sigma.position = quantity.value;
                if self.spec.kind.has_rotation() && quantity.dimension.is_none() {
                    sigma.rotation = quantity.value;
                }
            }
            Some(SigmaSpec::Pose { position, rotation }) => sigma = Sigma { position, rotation },
        }
        if let Some(wrong) = [sigma.position, sigma.rotation]
            .into_iter()
            .find(|s| !ordinary(*s))
        {
            let message =
                format!("`sigma`: found {wrong:e}; expected a standard deviation of ordinary size");
            return Err(self
                .file
                .error_at(self.spec.span_of("sigma"), message)
                .with_help("write the standard deviation of one measurement, like \"0.1 mm\""));
        }
        let mut sigmas = vec![sigma; self.rows.len()];
        let (column, _) = self.column("sigma");
        if self.table.has(&column) {
            for (k, value) in self
                .numbers("sigma", Dimension::Length)?
                .into_iter()
                .enumerate()
            {
                if !ordinary(value) {
                    return Err(self
                        .table
                        .error_at(self.rows[k], format!("column `{column}`: found {value}; expected a standard deviation above 0, of ordinary size"))
                        .with_help("correct the row, or leave it out with `rows`"));
                }
                sigmas[k].position = value;
            }
        }
        Ok(sigmas)
    }
}

/// The names of the columns that a joint may have, the preferred first; `suffix` marks a second posture.
pub(super) fn joint_columns(arm: &Arm, joint: usize, suffix: &str) -> Vec<String> {
    let mut names = Vec::new();
    for name in [
        format!("{}{suffix}", arm.robot.joints()[joint].name),
        format!("q{}{suffix}", joint + 1),
    ] {
        if !arm.name.is_empty() {
            names.push(format!("{}.{name}", arm.name));
            names.push(format!("{}_{name}", arm.name));
        }
        names.push(name);
    }
    names
}

/// Whether a standard deviation [m or rad] can weigh a measurement: not zero, nor so small or large that weights overflow.
pub(super) fn ordinary(sigma: f64) -> bool {
    (1e-12..=1e12).contains(&sigma)
}

/// The plane of a `known-plane`: the one given, or the one that its method always has.
pub(super) fn known_plane(
    file: &CalibrationFile,
    spec: &ConstraintSpec,
    fixed: Option<Plane<f64>>,
) -> Result<Plane<f64>, InputError> {
    match (spec.plane, fixed) {
        (Some(_), Some(_)) => Err(file
            .error_at(spec.span_of("plane"), "this method has a plane of its own")
            .with_help("remove the key, or the `method`")),
        (Some(plane), None) => {
            let (normal, distance) = PlaneSpec::normalised(plane);
            Ok(Plane {
                normal: normal.into(),
                distance,
            })
        }
        (None, Some(plane)) => Ok(plane),
        (None, None) => Err(file
            .error_at(
                spec.spans.table(),
                "this known-plane constraint has no `plane`",
            )
            .with_help("add plane = { normal = [0, 0, 1], distance = 0.4 }")),
    }
}
