//! The motion to record next, as the command that designs it.

use super::NAMED;
use super::list::{first_of, list};
use twincal::assess::open_effects;
use twincal::calibrate::Calibration;

/// The command that designs a motion for what a fit leaves open, and what that is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NextMotion {
    /// "twincal design --twin twincal-out -o motion".
    pub command: String,
    /// Effects that the motion decides: "payload, elbow.spring and 2 more".
    pub decides: String,
}

/// The motion for a twin that lies in `folder`; `None` where nothing is open. With a file of limits where the model has no velocity limit of
/// a joint.
#[must_use]
pub fn next_motion(calibration: &Calibration, folder: &str) -> Option<NextMotion> {
    let open = open_effects(calibration).into_iter().map(str::to_owned);
    let open: Vec<String> = open.collect();
    let robot = &calibration.twin.robot;
    let unlimited = (0..robot.joint_names().len())
        .any(|joint| robot.joint(joint).limits.velocity.is_none_or(|v| v <= 0.0));
    let limits = match unlimited {
        true => " --limits FILE",
        false => "",
    };
    (!open.is_empty()).then(|| NextMotion {
        command: format!("twincal design --twin {folder}{limits} -o motion"),
        decides: list(&first_of(open, NAMED)),
    })
}

impl NextMotion {
    /// "twincal design --twin twincal-out -o motion designs a motion to decide payload."
    #[must_use]
    pub fn sentence(&self) -> String {
        format!(
            "{} designs a motion to decide {}.",
            self.command, self.decides
        )
    }

    /// The sentence of a page that lies in the twin's folder and does not know where: the command is code.
    #[cfg(feature = "report")]
    pub(crate) fn on_page(&self) -> String {
        format!(
            "`{}` designs a motion to decide {}. {PAGE_FOLDER} is the folder of this page.",
            self.command, self.decides
        )
    }
}

/// Stands for the folder of the page, which may be moved.
#[cfg(feature = "report")]
pub(crate) const PAGE_FOLDER: &str = "DIR";

#[cfg(all(test, feature = "report"))]
mod tests {
    use super::*;
    use crate::context::ReportContext;
    use crate::report::{fixture, render};
    use std::collections::BTreeMap;
    use twincal::assess::{RequestCode, assess};
    use twincal::calibrate::{Alike, Group};
    use twincal::robot::Robot;
    use twincal::{Code, Finding, Severity};

    #[test]
    fn the_command_names_the_folder_and_what_it_decides() {
        let open = fixture::with_open_effects();
        let motion = next_motion(&open, "out").expect("open effects");
        assert!(motion.command.starts_with("twincal design --twin out"));
        assert!(motion.sentence().starts_with(&motion.command));
        let mut closed = open;
        closed.problem = None;
        assert_eq!(next_motion(&closed, "out"), None);
    }

    #[test]
    fn what_is_open_is_asked_for_only_where_a_motion_can_decide_it() {
        let mut own = fixture::with_open_effects();
        let pips = [0.04, 0.05, 0.5, 0.9, 0.94, 0.95];
        assert!(own.components.len() >= pips.len());
        own.components.truncate(pips.len());
        for (component, pip) in own.components.iter_mut().zip(pips) {
            component.pip = Some(pip);
        }
        let name = |at: usize| own.components[at].name.clone();
        let decides = |own: &Calibration| next_motion(own, "out").map(|motion| motion.decides);
        let three = format!("{}, {}, {} and 1 more", name(1), name(2), name(3));
        assert_eq!(decides(&own), Some(three));
        let asked = assess(&own).next;
        let designed = asked
            .iter()
            .filter(|own| own.code == RequestCode::DesignedMotion);
        let designed = designed.map(|own| own.subject.name().to_owned());
        assert!(designed.eq([1, 2, 3, 4].map(name)));
        let mut structural = own.clone();
        structural.groups.push(Group {
            members: [1, 2, 3, 4].map(name).to_vec(),
            pip: 0.9,
            alike: Alike::EveryMotion,
            settled: false,
            words: String::new(),
        });
        assert_eq!(decides(&structural), None, "no motion decides");
        let mut doubtful = own.clone();
        let code = Code::SignFlip;
        doubtful.findings = vec![Finding::new(Severity::Warning, code, "log", "", 1)];
        assert_eq!(decides(&doubtful), None, "a doubtful log");
        for component in &mut own.components {
            component.pip = Some(0.99);
        }
        assert_eq!(decides(&own), None, "nothing open");
    }

    /// A model without velocity limits needs a file of limits.
    #[test]
    fn the_command_has_a_file_of_limits_where_the_model_has_none() {
        let with = |velocity: Option<f64>| {
            let mut own = fixture::with_open_effects();
            let mut description = own.twin.robot.description().clone();
            for joint in &mut description.joints {
                joint.limits.velocity = velocity;
            }
            own.twin.robot = Robot::new(description, &BTreeMap::new())
                .expect("a robot")
                .0;
            next_motion(&own, "out").expect("open effects").command
        };
        assert_eq!(with(Some(2.0)), "twincal design --twin out -o motion");
        let stated = "twincal design --twin out --limits FILE -o motion";
        assert_eq!([with(None), with(Some(0.0))], [stated; 2]);
    }

    #[test]
    fn a_page_shows_the_command_as_code_in_its_own_case() {
        let open = fixture::with_open_effects();
        let html = render(&open, &ReportContext::default()).expect("a page");
        let command = next_motion(&open, PAGE_FOLDER)
            .expect("open effects")
            .command;
        let code = format!("<code>{command}</code> designs a motion to decide");
        assert!(html.contains(&code));
        assert!(html.contains("DIR is the folder of this page."));
        assert!(!html.contains(&format!("<p class=\"next\">{code}")));
    }
}
