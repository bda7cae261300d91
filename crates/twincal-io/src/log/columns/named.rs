//! The columns of a file by their names.

use super::Channel;
use crate::error::{Error, Place, Result};
use crate::log::{MAX_COLUMNS, MAX_NAME};
use std::collections::BTreeMap;
use twincal::robot::did_you_mean;
use twincal::words::shortened;

/// Names of a file's columns, exact and without letter case.
pub(super) struct Header<'a> {
    pub(super) file: &'a str,
    pub(super) names: &'a [String],
    pub(super) exact: BTreeMap<&'a str, usize>,
    folded: BTreeMap<String, Vec<usize>>,
}

impl<'a> Header<'a> {
    pub(super) fn new(file: &'a str, names: &'a [String]) -> Result<Self> {
        if names.len() > MAX_COLUMNS {
            return Err(Error::content(
                Place::line(file, 1),
                format!("{} columns, the limit is {MAX_COLUMNS}", names.len()),
                "export only the columns that are needed",
            ));
        }
        let (mut exact, mut folded) = (BTreeMap::new(), BTreeMap::<String, Vec<usize>>::new());
        for (index, name) in names
            .iter()
            .enumerate()
            .filter(|(_, name)| !name.is_empty())
        {
            if name.len() > MAX_NAME {
                let problem = format!(
                    "the name of column {}, `{}`, has {} bytes, the limit is {MAX_NAME}",
                    index + 1,
                    shortened(name),
                    name.len()
                );
                let remedy = "give it a shorter name, or leave the column out";
                return Err(Error::content(Place::line(file, 1), problem, remedy));
            }
            if let Some(first) = exact.insert(name.as_str(), index) {
                let numbers = format!("number {} and {}", first + 1, index + 1);
                let (problem, remedy) = match is_unit(name) {
                    true => (
                        format!("the names of columns are units: `{name}` ({numbers})"),
                        "write names in the place of the units, such as `t,q1,qd1,tau1`",
                    ),
                    false => (
                        format!("two columns are called `{name}` ({numbers})"),
                        "give every column its own name",
                    ),
                };
                return Err(Error::content(Place::line(file, 1), problem, remedy));
            }
            folded.entry(name.to_lowercase()).or_default().push(index);
        }
        Ok(Self {
            file,
            names,
            exact,
            folded,
        })
    }

    pub(super) fn channel(&self, index: usize) -> Channel {
        Channel {
            index,
            name: self.names[index].clone(),
        }
    }

    /// The column of that name; letter case is free if it leaves one.
    pub(super) fn find(&self, name: &str) -> Option<usize> {
        if let Some(&index) = self.exact.get(name) {
            return Some(index);
        }
        match self.folded.get(&name.to_lowercase()).map(Vec::as_slice) {
            Some([index]) => Some(*index),
            _ => None,
        }
    }

    /// A column that the config names.
    pub(super) fn mapped(&self, key: &str, name: &str) -> Result<Channel> {
        let index = self.exact.get(name).ok_or_else(|| {
            Error::content(
                Place::file(self.file),
                format!("has no column `{name}`, which [columns] {key} names"),
                did_you_mean(name, self.names.iter().map(String::as_str)),
            )
        })?;
        Ok(self.channel(*index))
    }
}

/// Units of stamps, angles, lengths, torque and current, as recorders write them.
const UNITS: [&str; 34] = [
    "s", "sec", "ms", "us", "ns", "rad", "deg", "°", "m", "mm", "rad/s", "deg/s", "°/s", "m/s",
    "mm/s", "rad/s^2", "rad/s2", "rad/s²", "deg/s^2", "m/s^2", "m/s2", "m/s²", "nm", "n*m", "n·m",
    "n.m", "n m", "mnm", "n", "a", "ma", "v", "%", "-",
];

/// Whether a name is that of a unit, in brackets or without.
fn is_unit(name: &str) -> bool {
    let bare = name.trim_matches(['[', ']', '(', ')', ' ']).to_lowercase();
    UNITS.contains(&bare.as_str())
}
