//! Names in a sentence.

use std::fmt::Write as _;

/// Joints as the subject of a sentence; "joint" is not said twice where they are called so.
pub(crate) fn subject<S: AsRef<str>>(joints: &[S]) -> String {
    let is_said = |name: &S| name.as_ref().to_lowercase().starts_with("joint");
    let word = match joints {
        all if all.iter().all(is_said) => "",
        [_] => "Joint ",
        _ => "Joints ",
    };
    format!("{word}{}", list(joints))
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
    }
}
