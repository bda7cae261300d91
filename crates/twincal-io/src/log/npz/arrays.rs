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
    let refuse =
        |problem: String, remedy: String| Error::content(Place::file(file), problem, remedy);
    let said = &options.columns;
    if [&said.q, &said.qd, &said.qdd, &said.tau, &said.temperature]
        .iter()
        .all(|names| names.is_empty())
    {
        return Ok(Cow::Borrowed(options));
    }
    let joints = robot.joint_names();
    let table = |key: &str, text: &str| {
        let Some(array) = arrays.iter().find(|array| array.key == key) else {
            let keys = arrays.iter().map(|array| array.key.as_str());
            return Err(refuse(
                format!("has no array `{key}`, which [columns] names in `{text}`"),
                did_you_mean(key, keys),
            ));
        };
        match array.header.shape[..] {
            [_, _] if array.width > 0 => Ok(array),
            _ => Err(refuse(
                format!(
                    "array `{key}` has shape {:?}, `{text}` asks for samples × joints",
                    array.header.shape
                ),
                "save a table of one row per time stamp, or name another array".into(),
            )),
        }
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
        let mut by_joint = Vec::new();
        match &*names_of {
            ChannelNames::ByJoint(by_name) => {
                for (joint, text) in by_name {
                    let plain = columns.contains(text);
                    let Some((key, column)) = indexed(text).filter(|_| !plain) else {
                        by_joint.push((joint.clone(), text.clone()));
                        continue;
                    };
                    let array = table(key, text)?;
                    let Some(column) = column else {
                        return Err(refuse(
                            format!("[columns] {channel} gives joint `{joint}` all of `{text}`"),
                            format!(
                                "write its column, `{key}[:,0]`, or {channel} = \"{key}\" for all joints"
                            ),
                        ));
                    };
                    if column >= array.width {
                        return Err(refuse(
                            format!(
                                "array `{key}` has {} columns, none of number {column} (from 0)",
                                array.width
                            ),
                            format!("correct `{text}` in [columns] {channel}"),
                        ));
                    }
                    let canonical = format!("{key}[:,{column}]");
                    columns[array.first + column].clone_from(&canonical);
                    by_joint.push((joint.clone(), canonical));
                }
            }
            ChannelNames::All(text) => {
                let key = match indexed(text) {
                    Some((key, None)) => key,
                    _ => text.as_str(),
                };
                // A pattern for arrays of one dimension, or the only column of the only joint.
                if columns.contains(text) || text.contains('*') && indexed(text).is_none() {
                    continue;
                }
                let array = table(key, text)?;
                let by_name = names.len() == array.width;
                if !by_name && array.width != joints.len() {
                    return Err(refuse(
                        format!(
                            "array `{key}` has {} columns, the model has {} moving joints",
                            array.width,
                            joints.len()
                        ),
                        format!(
                            "name them joint by joint: {channel} = {{ {} = \"{key}[:,0]\" }}",
                            joints[0]
                        ),
                    ));
                }
                for (number, joint) in joints.iter().enumerate() {
                    let column = match by_name {
                        false => number,
                        true => names.iter().position(|name| name == joint).ok_or_else(|| {
                            refuse(
                                format!("the array of names, which says whose the columns of `{key}` are, lacks joint `{joint}`"),
                                did_you_mean(joint, names.iter().map(String::as_str)),
                            )
                        })?,
                    };
                    let canonical = format!("{key}[:,{column}]");
                    columns[array.first + column].clone_from(&canonical);
                    by_joint.push(((*joint).to_owned(), canonical));
                }
            }
        }
        *names_of = by_joint.into_iter().collect();
    }
    Ok(Cow::Owned(options))
}
