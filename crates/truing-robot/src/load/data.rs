//! The rows of a data file as one constraint reads them.

use super::names::dimension_of;
use crate::estimate::ordinary;
use crate::file::{CalibrationFile, ConstraintSpec};
use crate::measurement::{Groups, Kind, Rows};
use crate::plugin::Registry;
use crate::robot::names::listed;
use crate::robot::{Arm, InputColumn, JointKind};
use crate::text::{Dimension, InputError, Table, nearest};
use std::ops::Range;
use std::sync::Arc;

/// The data of one constraint while it is read: a table and the rows in use.
pub struct Data<'a> {
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
        for column in arm.robot.columns() {
            let values = self.further(arm, column, suffix)?;
            for (row, value) in q.iter_mut().zip(values) {
                row.push(value);
            }
        }
        Ok(q)
    }

    /// A further column that joints of a robot are a function of.
    fn further(
        &self,
        arm: &Arm,
        column: &InputColumn,
        suffix: &str,
    ) -> Result<Vec<f64>, InputError> {
        let candidates = further_columns(arm, column, suffix);
        let mapped = |name: &&String| self.spec.columns.iter().any(|(from, _)| from == *name);
        let name = candidates.iter().find(mapped);
        let name = name.or_else(|| candidates.iter().find(|name| self.table.has(name)));
        match (name, column.value) {
            (Some(name), _) => self.numbers(name, Dimension::None),
            (None, Some(value)) => Ok(vec![value; self.rows.len()]),
            (None, None) => {
                let columns: Vec<String> = self.table.column_names().map(str::to_owned).collect();
                Err(self
                    .table
                    .header_error(format!(
                        "there is no column `{}{suffix}`, which a joint of {} is a function of; the columns are {}",
                        column.name,
                        arm.title(),
                        listed(&columns)
                    ))
                    .with_help(format!(
                        "say in the calibration file which it is, columns = {{ {} = \"…\" }}; if it is always \
                         the same, say so in the robot file, [inputs] {} = {{ value = … }}",
                        candidates[0], column.name
                    )))
            }
        }
    }

    /// Every name in `columns` must be one that is read.
    pub fn check_columns(&self, arms: &[Arm], registry: &Registry) -> Result<(), InputError> {
        let kinds = registry.kinds().iter();
        let read = |kind: &Arc<dyn Kind>| -> Vec<&str> {
            let group = kind.grouping().map(|grouping| grouping.group);
            let columns = kind.columns().iter().map(|column| column.name);
            columns.chain(group).collect()
        };
        let mut measured: Vec<&str> = Vec::new();
        for name in kinds.flat_map(read).chain(["sigma"]) {
            if !measured.contains(&name) {
                measured.push(name);
            }
        }
        let mut known: Vec<String> = measured.iter().map(|name| (*name).to_owned()).collect();
        known.extend(self.spec.group.iter().cloned());
        for arm in arms {
            for k in 0..arm.robot.joints().len() {
                known.extend(joint_columns(arm, k, ""));
                if self.spec.kind.tools() > 1 {
                    known.extend(joint_columns(arm, k, "b"));
                }
            }
            for column in arm.robot.columns() {
                known.extend(further_columns(arm, column, ""));
                known.extend(further_columns(arm, column, "b"));
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

    /// What was read, in the columns of the kind, and how many rows were brought into form.
    pub fn values(&self) -> Result<(Rows, usize), InputError> {
        let kind = &self.spec.kind;
        let columns = kind.columns().iter();
        let columns: Vec<Vec<f64>> = columns
            .map(|column| self.numbers(column.name, column.dimension))
            .collect::<Result<_, _>>()?;
        let mut values = Rows::new(columns.len());
        let mut changed = 0;
        for (k, table_row) in self.rows.iter().enumerate() {
            let mut row: Vec<f64> = columns.iter().map(|column| column[k]).collect();
            match kind.check_row(&mut row) {
                Ok(was) => changed += usize::from(was),
                Err((message, help)) => {
                    return Err(self.table.error_at(*table_row, message).with_help(help));
                }
            }
            values.push(&row);
        }
        Ok((values, changed))
    }

    /// The groups of the rows.
    pub fn groups(&self) -> Result<Groups, InputError> {
        let Some(grouping) = self.spec.kind.grouping() else {
            return Ok(Groups::single(self.rows.len()));
        };
        let default = grouping.group;
        let names: Vec<String> = if self.spec.group.is_empty() {
            vec![default.to_owned()]
        } else {
            self.spec.group.clone()
        };
        let mut labels = vec![Vec::new(); self.rows.len()];
        for name in &names {
            let (column, _) = self.column(name);
            if !self.table.has(&column) {
                if self.spec.group.is_empty() && grouping.alone {
                    return Ok(Groups::by_label(
                        self.rows.iter().map(|_| default.to_owned()),
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

    /// Standard deviations, one a measurand.
    pub fn sigmas(&self) -> Result<Rows, InputError> {
        let measurands = self.spec.kind.measurands();
        let given = measurands.iter().zip(&self.spec.sigma);
        let usual: Vec<f64> = given.map(|(m, given)| given.unwrap_or(m.sigma)).collect();
        if let Some(wrong) = usual.iter().find(|s| !ordinary(**s)) {
            let message =
                format!("`sigma`: found {wrong:e}; expected a standard deviation of ordinary size");
            return Err(self
                .file
                .error_at(self.spec.span_of("sigma"), message)
                .with_help("write the standard deviation of one measurement, like \"0.1 mm\""));
        }
        let mut sigmas = Rows::repeated(&usual, self.rows.len());
        let (column, _) = self.column("sigma");
        if self.table.has(&column) {
            let dimension = dimension_of(measurands[0].unit);
            for (k, value) in self.numbers("sigma", dimension)?.into_iter().enumerate() {
                if !ordinary(value) {
                    return Err(self
                        .table
                        .error_at(self.rows[k], format!("column `{column}`: found {value}; expected a standard deviation above 0, of ordinary size"))
                        .with_help("correct the row, or leave it out with `rows`"));
                }
                sigmas.row_mut(k)[0] = value;
            }
        }
        Ok(sigmas)
    }
}

/// The names that a further column may have, the preferred first; `suffix` marks a second posture.
fn further_columns(arm: &Arm, column: &InputColumn, suffix: &str) -> Vec<String> {
    let name = format!("{}{suffix}", column.name);
    if arm.name.is_empty() {
        return vec![name];
    }
    vec![
        format!("{}.{name}", arm.name),
        format!("{}_{name}", arm.name),
        name,
    ]
}

/// The names of the columns that a joint may have, the preferred first; `suffix` marks a second posture.
fn joint_columns(arm: &Arm, joint: usize, suffix: &str) -> Vec<String> {
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
