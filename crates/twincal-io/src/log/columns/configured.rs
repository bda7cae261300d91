//! What `[columns]` says of a table: a column per joint, or one name for all of them.

use super::Header;
use crate::config::ChannelNames;
use crate::error::{Error, Place, Result};
use crate::log::LogOptions;
use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use twincal::robot::did_you_mean;

/// A joint in `[columns]` that the model does not have.
pub(in super::super) fn refuse_unknown_joints(
    file: &str,
    joints: &[&str],
    options: &LogOptions,
) -> Result<()> {
    let columns = &options.columns;
    let tables = [
        ("q", &columns.q),
        ("qd", &columns.qd),
        ("qdd", &columns.qdd),
        ("tau", &columns.tau),
        ("temperature", &columns.temperature),
    ];
    for (key, names) in tables {
        let ChannelNames::ByJoint(table) = names else {
            continue;
        };
        let known: BTreeSet<&str> = joints.iter().copied().collect();
        let unknown = |joint: &&String| !known.contains(joint.as_str());
        if let Some(joint) = table.keys().find(unknown) {
            return Err(Error::content(
                Place::file(file),
                format!("[columns] {key} names joint `{joint}`, which does not move in the model"),
                did_you_mean(joint, joints.iter().copied()),
            ));
        }
    }
    Ok(())
}

/// Whether a table has the columns that `[columns]` names for one channel.
pub(crate) fn has_columns(header: &[String], names: &ChannelNames, joints: &[&str]) -> bool {
    let there: BTreeSet<&str> = header.iter().map(String::as_str).collect();
    let has = |column: &str| there.contains(column);
    match names {
        ChannelNames::ByJoint(table) => table.values().all(|column| has(column)),
        ChannelNames::All(pattern) => [0, 1].into_iter().any(|first| {
            let mut numbers = first..first + joints.len();
            numbers.all(|number| has(&pattern.replacen('*', &number.to_string(), 1)))
        }),
    }
}

/// Columns by joint name; one name for all joints has a `*` where numbers from 0 or from 1 stand.
pub(super) fn by_joint_name<'a>(
    header: &Header<'_>,
    key: &str,
    names: &'a ChannelNames,
    joints: &[&str],
) -> Result<Cow<'a, BTreeMap<String, String>>> {
    let pattern = match names {
        ChannelNames::ByJoint(table) => return Ok(Cow::Borrowed(table)),
        ChannelNames::All(pattern) => pattern,
    };
    let numbered = |first: usize| {
        let names = joints.iter().enumerate().map(move |(joint, name)| {
            let column = pattern.replacen('*', &(first + joint).to_string(), 1);
            ((*name).to_owned(), column)
        });
        names.collect::<BTreeMap<String, String>>()
    };
    if !pattern.contains('*') {
        if joints.len() == 1 {
            return Ok(Cow::Owned(numbered(0)));
        }
        return Err(Error::content(
            Place::file(header.file),
            format!(
                "[columns] {key} = \"{pattern}\" is one column for {} moving joints",
                joints.len()
            ),
            format!(
                "write * where the joint's number stands in the name, or a column per joint: {key} = {{ {} = \"{pattern}\" }}",
                super::key(joints[0])
            ),
        ));
    }
    let there = |table: &BTreeMap<String, String>| {
        let mut columns = table.values();
        columns.all(|column| header.exact.contains_key(column.as_str()))
    };
    // Column 0 decides: from 1 only where there is none.
    let tables = [numbered(0), numbered(1)];
    let from_zero = header
        .exact
        .contains_key(pattern.replacen('*', "0", 1).as_str());
    let [zero, one] = tables;
    let table = if from_zero { zero } else { one };
    if there(&table) {
        return Ok(Cow::Owned(table));
    }
    let missing = table
        .values()
        .find(|column| !header.exact.contains_key(column.as_str()));
    let missing = missing.cloned().unwrap_or_default();
    Err(Error::content(
        Place::file(header.file),
        format!(
            "[columns] {key} = \"{pattern}\" means a column per moving joint, and `{missing}` is not there"
        ),
        did_you_mean(&missing, header.names.iter().map(String::as_str)),
    ))
}
