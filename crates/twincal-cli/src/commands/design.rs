//! `twincal design`: the motion to record, within the limits of the robot.

use super::inputs::RobotInput;
use super::start_threads;
use super::summary::paragraph;
use super::table::{print_table, table};
use crate::args::Design as Flags;
use crate::failure::{Failure, Outcome};
use crate::interrupts::Caught;
use crate::progress::Progress;
use crate::terminal::Terminal;
use std::path::Path;
use std::sync::Mutex;
use twincal::design::{
    Design, DesignSettings, DesignStage, FoundTorque, JointLimits, NominalTorque, Questions, Task,
    TorqueLimits, design, joint_limits,
};
use twincal::robot::Robot;
use twincal::term::{Family, Library, LibrarySettings};
use twincal::words::significant as number;
use twincal_io::artifact::{Artifact, Claim, Inputs, Maker, Replace};
use twincal_io::config::Config;
use twincal_io::design::{
    About, DESIGN, KEYFRAMES, Limits, MOTION, PAGE, TABLE, TRAJECTORY, WARNING, design_json,
    design_page, joint_trajectory, motion_csv, motion_parquet, mujoco_keyframes, read_limits,
};
use twincal_io::twin_json::StoredTwin;
use twincal_io::words::design as words;

/// Candidates whose coefficients a motion is designed for where no twin says which are in question: the rigid body, motors and friction.
const FAMILIES: [Family; 7] = [
    Family::Density,
    Family::MassMoments,
    Family::Tensor,
    Family::MotorInertia,
    Family::Viscous,
    Family::Coulomb,
    Family::Offset,
];

/// The robot, and what is known of it.
struct Known {
    robot: Robot,
    model: String,
    stored: Option<StoredTwin>,
}

impl Known {
    fn read(flags: &Flags) -> Outcome<Self> {
        if let Some(folder) = &flags.twin {
            let stored = StoredTwin::read(&Artifact::open(folder)?, true)?;
            return Ok(Self {
                robot: stored.calibration.twin.robot.clone(),
                model: stored.context.model.clone(),
                stored: Some(stored),
            });
        }
        let model = flags.model.as_ref().ok_or_else(super::no_model)?;
        let input = RobotInput::read(model, &Config::default().settings()?)?;
        Ok(Self {
            robot: input.robot,
            model: input.file.name,
            stored: None,
        })
    }
}

pub(super) fn run(flags: &Flags, terminal: &mut Terminal) -> Outcome<u8> {
    let mut inputs = Inputs::default();
    let given = [&flags.model, &flags.twin, &flags.limits];
    given
        .into_iter()
        .flatten()
        .for_each(|path| inputs.add(path));
    let replace = match flags.force {
        true => Replace::Artifact,
        false => Replace::Never,
    };
    let claim = Claim::new(&flags.output, replace, &inputs)?;
    start_threads(flags.threads.map(|threads| threads as usize))?;
    let known = Known::read(flags)?;
    let stated = match &flags.limits {
        Some(path) => read_limits(path)?,
        None => Limits::default(),
    };
    let limits = joint_limits(&known.robot, &stated.joints).map_err(twincal_io::Error::from)?;
    let settings = DesignSettings {
        duration: flags.duration,
        rate: flags.rate,
        seed: flags.seed,
        ..DesignSettings::default()
    };
    let found = match &known.stored {
        None => {
            let torque = NominalTorque::new(&known.robot, &limits);
            searched(&known.robot, &limits, (&torque, None), &settings)?
        }
        Some(stored) => deciding(stored, &flags.decide, &limits, &settings)?,
    };
    let about = About {
        model: known.model,
        settings: &settings,
        limits: &limits,
        kinds: (0..known.robot.dof())
            .map(|joint| known.robot.joint_kind(joint))
            .collect(),
    };
    let json = design_json(&found, &about)?;
    let motion = &found.motion;
    let files = vec![
        (MOTION, motion_csv(motion).into_bytes()),
        (TABLE, motion_parquet(motion)?),
        (DESIGN, json.clone()),
        (PAGE, design_page(&found, &about)?.into_bytes()),
        (TRAJECTORY, joint_trajectory(motion).into_bytes()),
        (KEYFRAMES, mujoco_keyframes(motion).into_bytes()),
    ];
    claim.commit(Maker::Design, files)?;
    terminal.complete(&flags.output);
    if flags.json {
        terminal.data(&String::from_utf8_lossy(&json));
    } else {
        print(&found, &limits, &flags.output, terminal);
    }
    Ok(0)
}

/// A motion that decides what a twin leaves open.
fn deciding(
    stored: &StoredTwin,
    decide: &[String],
    limits: &[JointLimits],
    settings: &DesignSettings,
) -> Outcome<Design> {
    let (calibration, twin) = (&stored.calibration, &stored.calibration.twin);
    let Some(problem) = &calibration.problem else {
        return Err(Failure::usage(
            "the twin does not hold the regression behind it",
            "fit again with this version of twincal; the twin of a fleet has none",
        ));
    };
    let core = twincal_io::Error::from;
    let library = twin.library().map_err(core)?;
    let torque = FoundTorque::new(twin, limits).map_err(core)?;
    let noise = (&twin.noise[..], calibration.kept_rate_hz());
    let questions = Questions::new((problem, &twin.posterior), &library, noise, decide);
    let questions = questions.map_err(core)?;
    searched(&twin.robot, limits, (&torque, Some(&questions)), settings)
}

/// The search, with its gain on standard error; Ctrl-C ends it with what it has.
fn searched(
    robot: &Robot,
    limits: &[JointLimits],
    (torque, questions): (&dyn TorqueLimits, Option<&Questions<'_>>),
    settings: &DesignSettings,
) -> Outcome<Design> {
    let library = LibrarySettings {
        families: FAMILIES.to_vec(),
        ..LibrarySettings::default()
    };
    let (library, _) = Library::propose(robot, &library).map_err(twincal_io::Error::from)?;
    let task = Task {
        robot,
        library: &library,
        questions,
        limits,
        torque: Some(torque),
        clearance: None,
    };
    let progress = Mutex::new(Progress::new());
    let caught = Caught::new();
    let watch = |stage: DesignStage| {
        if caught.is_asked() {
            return Err(twincal::Error::Cancelled);
        }
        if let Ok(progress) = progress.lock() {
            let what = format!("searching, gain {}", number(stage.gain, 3));
            progress.counted(&what, stage.done, stage.all);
        }
        Ok(())
    };
    Ok(design(&task, settings, &watch).map_err(twincal_io::Error::from)?)
}

/// What the motion is expected to say of each question.
fn print_promises(found: &Design, terminal: &mut Terminal) {
    if found.promises.is_empty() {
        return;
    }
    let mut rows = table(&["effect", "PIP now", "decided rightly", "wrongly", "sd then"]);
    for promise in &found.promises {
        rows.add_row([
            promise.effect.clone(),
            words::chance(promise.pip),
            words::share(promise.right),
            words::share(promise.wrong),
            promise.sd.map_or_else(|| "–".into(), |sd| number(sd, 2)),
        ]);
    }
    print_table(&rows, terminal);
    for promise in found.promises.iter().filter(|own| own.structural) {
        paragraph(&words::undecidable(&promise.effect), terminal);
    }
    terminal.say("");
}

fn print(found: &Design, limits: &[JointLimits], output: &Path, terminal: &mut Terminal) {
    terminal.heading(&words::headline(found));
    paragraph(&words::information(found), terminal);
    terminal.say("");
    print_promises(found, terminal);
    let mut rows = table(&["joint", "from", "to", "velocity", "acceleration", "jerk"]);
    for used in &found.used {
        let share = |at: usize| words::share(used.share[at]);
        rows.add_row([
            used.joint.clone(),
            number(used.position[0], 3),
            number(used.position[1], 3),
            share(0),
            share(1),
            share(2),
        ]);
    }
    print_table(&rows, terminal);
    terminal.say(words::SHARES);
    for text in words::assumed(limits) {
        paragraph(&text, terminal);
    }
    paragraph(&words::clearance(found), terminal);
    paragraph(WARNING, terminal);
    terminal.say(&output.join(MOTION).to_string_lossy());
}
