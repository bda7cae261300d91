//! "Move joint 4 more", in sentences.

use super::{Excitation, Unseen};

/// Names that a sentence holds at most.
const TOLD: usize = 4;

/// One sentence for each joint that should move more, most important first.
pub fn sentences(excitation: &Excitation) -> Vec<String> {
    excitation.unseen.iter().map(sentence).collect()
}

/// "move `elbow` more: these logs show nothing of elbow.viscous, and fore.tensor and payload only together".
pub fn sentence(unseen: &Unseen) -> String {
    let what = match &unseen.joint {
        Some(joint) => format!("move `{joint}` more"),
        None => "move several joints at once".to_owned(),
    };
    let mut shown = Vec::new();
    if !unseen.nothing_of.is_empty() {
        shown.push(format!("nothing of {}", list(&unseen.nothing_of)));
    }
    match &unseen.not_apart[..] {
        [] => {}
        [only] => shown.push(format!("only a part of {only}")),
        several => shown.push(format!("{} only in part or together", list(several))),
    }
    format!("{what}: these logs show {}", shown.join(", and "))
}

/// "a, b, c and 3 more".
fn list(names: &[String]) -> String {
    match names {
        [] => String::new(),
        [only] => only.clone(),
        _ if names.len() <= TOLD => {
            let (others, last) = names.split_at(names.len() - 1);
            format!("{} and {}", others.join(", "), last[0])
        }
        _ => format!(
            "{} and {} more",
            names[..TOLD - 1].join(", "),
            names.len() + 1 - TOLD
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_lists_are_cut_and_the_motion_comes_first() {
        let names = |count: usize| (0..count).map(|k| format!("c{k}")).collect::<Vec<_>>();
        let unseen = Unseen {
            joint: Some("elbow".into()),
            directions: 9,
            nothing_of: names(6),
            not_apart: names(2),
        };
        assert_eq!(
            sentence(&unseen),
            "move `elbow` more: these logs show nothing of c0, c1, c2 and 3 more, and c0 and c1 only in part or together"
        );
        assert_eq!(list(&names(4)), "c0, c1, c2 and c3");
    }
}
