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
        true => " --limits limits.toml",
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

    #[test]
    fn the_command_names_the_folder_and_what_it_decides() {
        let open = fixture::with_open_effects();
        let motion = next_motion(&open, "out").expect("open effects");
        assert_eq!(motion.command, "twincal design --twin out -o motion");
        assert!(motion.sentence().starts_with(&motion.command));
        let mut closed = open;
        closed.problem = None;
        assert_eq!(next_motion(&closed, "out"), None);
    }

    #[test]
    fn a_page_shows_the_command_as_code_in_its_own_case() {
        let open = fixture::with_open_effects();
        let html = render(&open, &ReportContext::default()).expect("a page");
        let code = "<code>twincal design --twin DIR -o motion</code> designs a motion to decide";
        assert!(html.contains(code));
        assert!(html.contains("DIR is the folder of this page."));
        assert!(!html.contains(&format!("<p class=\"next\">{code}")));
    }
}
