//! `[columns]` for arrays: `q = "positions"` is an array of samples × joints, `elbow = "positions[:,2]"` one of its columns, counted from 0.

use super::Array;
use crate::config::ChannelNames;
use crate::error::{Error, Place, Result};
use crate::log::LogOptions;
use std::borrow::Cow;
use twincal::robot::{Robot, did_you_mean};

/// Array and column of `positions[:,2]`; the column is `None` for `positions[:,*]`, which means all.
fn indexed(text: &str) -> Option<(&str, Option<usize>)> {
    let (key, rest) = text.split_once('[')?;
    let inner: String = rest
        .strip_suffix(']')?
        .chars()
        .filter(|c| *c != ' ')
        .collect();
    match inner.strip_prefix(":,")? {
        "*" | ":" => Some((key, None)),
        number => Some((key, Some(number.parse().ok()?))),
    }
}

/// Gives the columns of arrays that the config names the names that it has for them, and a name by joint to all that it says of whole arrays.
///
/// # Errors
/// [`Error::Content`] for an array that is not there or is no table, a column beyond its last, a table with another number of columns than the
/// model has moving joints.
pub(super) fn name_columns<'a>(
    file: &str,
    arrays: &[Array],
    names: &[String],
    columns: &mut [String],
    robot: &Robot,
    options: &'a LogOptions,
) -> Result<Cow<'a, LogOptions>> {
    let said = &options.columns;
    if [&said.q, &said.qd, &said.qdd, &said.tau, &said.temperature]
        .iter()
        .all(|names| names.is_empty())
    {
        return Ok(Cow::Borrowed(options));
    }
    let mut tables = Tables {
        file,
        arrays,
        names,
        joints: robot.joint_names(),
        columns,
    };
    let mut options = options.clone();
    let said = &mut options.columns;
    let channels = [
        ("q", &mut said.q),
        ("qd", &mut said.qd),
        ("qdd", &mut said.qdd),
        ("tau", &mut said.tau),
        ("temperature", &mut said.temperature),
    ];
    for (channel, names_of) in channels {
        let by_joint = match &*names_of {
            ChannelNames::ByJoint(by_name) => by_name
                .iter()
                .map(|(joint, text)| Ok((joint.clone(), tables.one(channel, joint, text)?)))
                .collect::<Result<Vec<_>>>()?,
            ChannelNames::All(text) => match tables.all(channel, text)? {
                Some(by_joint) => by_joint,
                None => continue,
            },
        };
        *names_of = by_joint.into_iter().collect();
    }
    Ok(Cow::Owned(options))
}

/// The arrays of a file, and the columns that they make.
struct Tables<'a> {
    file: &'a str,
    arrays: &'a [Array],
    /// What the file calls the columns of its arrays; empty where it does not say.
    names: &'a [String],
    /// Moving joints of the model.
    joints: Vec<&'a str>,
    columns: &'a mut [String],
}

impl<'a> Tables<'a> {
    fn refuse(&self, problem: String, remedy: String) -> Error {
        Error::content(Place::file(self.file), problem, remedy)
    }

    /// Whether a text is the plain name of a column.
    fn is_column(&self, text: &str) -> bool {
        self.columns.iter().any(|column| column == text)
    }

    /// The array `key` of samples × joints that `text` names.
    fn table(&self, key: &str, text: &str) -> Result<&'a Array> {
        let Some(array) = self.arrays.iter().find(|array| array.key == key) else {
            let keys = self.arrays.iter().map(|array| array.key.as_str());
            return Err(self.refuse(
                format!("has no array `{key}`, which [columns] names in `{text}`"),
                did_you_mean(key, keys),
            ));
        };
        match array.header.shape[..] {
            [_, _] if array.width > 0 => Ok(array),
            _ => Err(self.refuse(
                format!(
                    "array `{key}` has shape {:?}, `{text}` asks for samples × joints",
                    array.header.shape
                ),
                "save a table of one row per time stamp, or name another array".into(),
            )),
        }
    }

    /// Gives a column of an array the name `key[:,column]`, which is returned.
    fn name(&mut self, array: &Array, key: &str, column: usize) -> String {
        let canonical = format!("{key}[:,{column}]");
        self.columns[array.first + column].clone_from(&canonical);
        canonical
    }

    /// Name of the column that `text` says of one joint.
    fn one(&mut self, channel: &str, joint: &str, text: &str) -> Result<String> {
        let plain = self.is_column(text);
        let Some((key, column)) = indexed(text).filter(|_| !plain) else {
            return Ok(text.to_owned());
        };
        let array = self.table(key, text)?;
        let Some(column) = column else {
            return Err(self.refuse(
                format!("[columns] {channel} gives joint `{joint}` all of `{text}`"),
                format!("write its column, `{key}[:,0]`, or {channel} = \"{key}\" for all joints"),
            ));
        };
        if column >= array.width {
            return Err(self.refuse(
                format!(
                    "array `{key}` has {} columns, none of number {column} (from 0)",
                    array.width
                ),
                format!("correct `{text}` in [columns] {channel}"),
            ));
        }
        Ok(self.name(array, key, column))
    }

    /// Joints with their columns of the array that `text` says of all; `None` where it names no array of two dimensions.
    fn all(&mut self, channel: &str, text: &str) -> Result<Option<Vec<(String, String)>>> {
        let key = match indexed(text) {
            Some((key, None)) => key,
            _ => text,
        };
        // A pattern for arrays of one dimension, or the only column of the only joint.
        if self.is_column(text) || text.contains('*') && indexed(text).is_none() {
            return Ok(None);
        }
        let array = self.table(key, text)?;
        if self.names.len() != array.width && array.width != self.joints.len() {
            return Err(self.refuse(
                format!(
                    "array `{key}` has {} columns, the model has {} moving joints",
                    array.width,
                    self.joints.len()
                ),
                format!(
                    "name them joint by joint: {channel} = {{ {} = \"{key}[:,0]\" }}",
                    self.joints[0]
                ),
            ));
        }
        let mut by_joint = Vec::with_capacity(self.joints.len());
        for number in 0..self.joints.len() {
            let column = self.column_of(array, key, number)?;
            let canonical = self.name(array, key, column);
            by_joint.push((self.joints[number].to_owned(), canonical));
        }
        Ok(Some(by_joint))
    }

    /// Column of a joint of the model: by its name where the columns have names, else in the model's order.
    fn column_of(&self, array: &Array, key: &str, number: usize) -> Result<usize> {
        if self.names.len() != array.width {
            return Ok(number);
        }
        let joint = self.joints[number];
        let column = self.names.iter().position(|name| name == joint);
        column.ok_or_else(|| {
            self.refuse(
                format!("the array of names, which says whose the columns of `{key}` are, lacks joint `{joint}`"),
                did_you_mean(joint, self.names.iter().map(String::as_str)),
            )
        })
    }
}
