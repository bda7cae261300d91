//! Names in a sentence.

use super::NAMED;
use std::fmt::Write as _;

/// Joints as the subject of a sentence, the first by name; "joint" is not said twice where they are called so.
pub(crate) fn subject<S: AsRef<str>>(joints: &[S]) -> String {
    let is_said = |name: &S| name.as_ref().to_lowercase().starts_with("joint");
    let word = match joints {
        all if all.iter().all(is_said) => "",
        [_] => "Joint ",
        _ => "Joints ",
    };
    let names = joints.iter().map(|name| name.as_ref().to_owned());
    format!("{word}{}", list(&first_of(names.collect(), NAMED)))
}

/// A number of each joint in their order; the range of them where there are more than are named.
pub(crate) fn each_or_range(values: &[f64], show: impl Fn(f64) -> String) -> String {
    let shown = |values: &[f64]| values.iter().map(|value| show(*value)).collect::<Vec<_>>();
    if values.len() <= NAMED {
        return list(&shown(values));
    }
    let low = values.iter().copied().fold(f64::INFINITY, f64::min);
    let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    shown(&[low, high]).join(" to ")
}

/// At most so many names; the others are counted, as the last one: "2 more".
pub(crate) fn first_of(mut names: Vec<String>, most: usize) -> Vec<String> {
    let more = names.len().saturating_sub(most);
    names.truncate(most);
    if more > 0 {
        names.push(format!("{more} more"));
    }
    names
}

/// "a", "a and b", "a, b and c".
pub(crate) fn list<S: AsRef<str>>(items: &[S]) -> String {
    let mut out = String::new();
    for (i, item) in items.iter().enumerate() {
        let join = if i == 0 {
            ""
        } else if i + 1 == items.len() {
            " and "
        } else {
            ", "
        };
        let _ = write!(out, "{join}{}", item.as_ref());
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_listed_and_joints_called_so_once() {
        assert_eq!(subject(&["joint_4"]), "joint_4");
        assert_eq!(subject(&["Joint1", "joint2"]), "Joint1 and joint2");
        assert_eq!(subject(&["elbow"]), "Joint elbow");
        assert_eq!(subject(&["joint1", "elbow"]), "Joints joint1 and elbow");
        assert_eq!(list(&["a", "b", "c"]), "a, b and c");
        let many: Vec<String> = (1..=44).map(|joint| format!("axis{joint}")).collect();
        assert_eq!(subject(&many), "Joints axis1, axis2, axis3 and 41 more");
    }

    #[test]
    fn numbers_of_many_joints_are_a_range() {
        let whole = |value: f64| format!("{value:.0}");
        assert_eq!(each_or_range(&[3.0, 1.0], whole), "3 and 1");
        assert_eq!(each_or_range(&[3.0, 1.0, 4.0, 2.0], whole), "1 to 4");
    }
}
