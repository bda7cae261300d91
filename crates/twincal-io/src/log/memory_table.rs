//! Tables in memory: columns by name, which are matched to the joints as those of a file are.

use super::{Cells, LogOptions, Request, assemble, in_memory};
use crate::error::{Error, Place, Result};
use twincal::robot::Robot;
use twincal::signal::Recording;
use twincal::{Code, Finding, Severity};

/// What a column holds.
#[derive(Debug, Clone, PartialEq)]
pub enum Column {
    /// One number per sample, SI units; NaN where there is none.
    Numbers(Vec<f64>),
    /// Time stamps whose type states their unit.
    Stamps {
        /// Stamps, s; NaN where there is none.
        seconds: Vec<f64>,
        /// The unit of the type, such as "nanoseconds".
        unit: &'static str,
    },
    /// No numbers. The text says what instead, such as "is text, not a number": a channel of this name is refused, any other column passed over.
    Other(String),
}

impl Column {
    /// The numbers; none where it has none.
    #[must_use]
    pub fn numbers(&self) -> Option<&[f64]> {
        match self {
            Self::Numbers(values) => Some(values),
            Self::Stamps { seconds, .. } => Some(seconds),
            Self::Other(_) => None,
        }
    }
}

/// A log of columns in memory, which are matched to the joints as those of a table are; `name` is what messages call it.
///
/// # Errors
/// Like [`super::read_log`]; columns of different lengths, and channels that are no numbers.
///
/// # Example
/// ```
/// use twincal_io::log::{Column, LogOptions, read_columns};
///
/// # use twincal_io::model::parse_model;
/// # let text = r#"<robot name="pendulum"><link name="base"/><link name="rod"><inertial><origin xyz="0 0 -0.5"/><mass value="1"/>
/// # <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
/// # <joint name="pivot" type="continuous"><parent link="base"/><child link="rod"/><axis xyz="0 1 0"/></joint></robot>"#;
/// # let (robot, _) = parse_model("pendulum.urdf", text.as_bytes(), &Default::default())?.robot(&Default::default())?;
/// let header = ["t", "pivot.q", "pivot.tau"].map(String::from);
/// let columns = [[0.0, 0.01], [0.1, 0.2], [0.5, 1.0]].map(|values| Column::Numbers(values.to_vec()));
/// let (log, _) = read_columns("run1", &header, &columns, &robot, &LogOptions::default())?;
/// assert_eq!((&*log.name, &log.joints[0].q[..]), ("run1", &[0.1, 0.2][..]));
/// # Ok::<(), twincal_io::Error>(())
/// ```
pub fn read_columns(
    name: &str,
    header: &[String],
    columns: &[Column],
    robot: &Robot,
    options: &LogOptions,
) -> Result<(Recording, Vec<Finding>)> {
    let request = Request {
        name,
        robot,
        options,
        chapters: false,
    };
    require_one_length(name, header, columns)?;
    let selection = request.select(header)?;
    let mut cells = Cells::default();
    let mut findings = Vec::new();
    for index in selection.file_columns() {
        let own = &header[index];
        match &columns[index] {
            Column::Numbers(values) => cells.columns.push(values.clone()),
            Column::Stamps { seconds, unit } => {
                cells.columns.push(seconds.clone());
                findings.push(typed_stamps(name, own, unit));
            }
            Column::Other(what) => {
                return Err(Error::content(
                    Place::file(name),
                    format!("column `{own}` {what}"),
                    "give it as numbers, or map another column in [columns]",
                ));
            }
        }
    }
    let log = assemble(request, cells, selection, &mut findings)?;
    in_memory((log, findings))
}

fn require_one_length(name: &str, header: &[String], columns: &[Column]) -> Result<()> {
    let mut lengths = header.iter().zip(columns).filter_map(|(own, column)| {
        let values = column.numbers()?;
        Some((own, values.len()))
    });
    let Some((first, rows)) = lengths.next() else {
        return Ok(());
    };
    match lengths.find(|(_, len)| *len != rows) {
        None => Ok(()),
        Some((other, len)) => Err(Error::content(
            Place::file(name),
            format!("column `{other}` has {len} samples, `{first}` has {rows}"),
            "give one value for each time stamp, NaN where it is not known",
        )),
    }
}

/// The note on stamps whose type states their unit.
pub(super) fn typed_stamps(name: &str, column: &str, unit: &str) -> Finding {
    Finding::new(
        Severity::Note,
        Code::TimestampType,
        name,
        format!(
            "column `{column}` is a timestamp in {unit} by its type and was turned into seconds"
        ),
        0,
    )
}
