//! `twincal design`: the motion to record, within the limits of the robot.

use super::check::role_in_fit;
use super::inputs::{LogInput, Long, RobotInput};
use super::summary::paragraph;
use super::table::{print_table, table};
use super::{replaced, start_threads};
use crate::args::{Criterion as OfFlags, Design as Flags};
use crate::failure::{Failure, Outcome};
use crate::interrupts::{Caught, require_caller};
use crate::names::display_names;
use crate::progress::Progress;
use crate::terminal::Terminal;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use twincal::Severity;
use twincal::design::{
    Criterion, Design, DesignSettings, DesignStage, FoundTorque, JointLimits, Load, Loaded,
    NominalTorque, Questions, Recorded, Task, TorqueLimits, design, joint_limits, with_free_start,
};
use twincal::robot::{Robot, RobotDescription};
use twincal::signal::{Payload, choose_and_prepare};
use twincal::term::{Family, Library, LibrarySettings};
use twincal::words::significant as number;
use twincal_io::artifact::{Artifact, Claim, Inputs, MODEL_MJCF, MODEL_URDF, Maker};
use twincal_io::collision::CollisionWorld;
use twincal_io::config::{Config, Settings};
use twincal_io::context::FileHash;
use twincal_io::design::{
    About, DESIGN, KEYFRAMES, Limits, MOTION, PAGE, StatedLoad, TABLE, TRAJECTORY, WARNING,
    design_json, design_page, joint_trajectory, motion_csv, motion_parquet, mujoco_keyframes,
    read_limits,
};
use twincal_io::model::{Geometry, parse_model, read_model};
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
    /// Name of the model.
    model: String,
    stored: Option<StoredTwin>,
    geometry: Geometry,
    /// Where the model file is: its meshes are found from there.
    path: PathBuf,
}

impl Known {
    fn read(flags: &Flags, settings: &Settings) -> Outcome<Self> {
        let Some(folder) = &flags.twin else {
            let path = flags.model.as_ref().ok_or_else(super::no_model)?;
            let model = read_model(path, &settings.model)?;
            let geometry = model.geometry()?;
            let input = RobotInput::new(model, display_names(&[path]).remove(0), settings)?;
            return Ok(Self {
                robot: input.robot,
                model: input.file.name,
                stored: None,
                geometry,
                path: path.clone(),
            });
        };
        let artifact = Artifact::open(folder)?;
        let stored = StoredTwin::read(&artifact, true)?;
        let (path, model) = match &flags.model {
            Some(path) => (path.clone(), read_model(path, &settings.model)?),
            None => {
                let is_model = |name: &&str| [MODEL_URDF, MODEL_MJCF].contains(name);
                let name = artifact.names().find(is_model).unwrap_or(MODEL_URDF);
                let model = parse_model(name, &artifact.read(name)?, &settings.model)?;
                (folder.join(name), model)
            }
        };
        let robot = stored.calibration.twin.robot.clone();
        let links = |description: &RobotDescription| -> Vec<String> {
            description
                .links
                .iter()
                .map(|own| own.name.clone())
                .collect()
        };
        if links(&model.description) != links(robot.description()) {
            return Err(Failure::usage(
                format!(
                    "{} is not the model of the twin: other links",
                    path.display()
                ),
                "give the model file that was fitted, for its meshes",
            ));
        }
        Ok(Self {
            robot,
            model: stored.context.model.clone(),
            stored: Some(stored),
            geometry: model.geometry()?,
            path,
        })
    }

    /// What the robot is known to carry, in the payload frame of the twin or of the settings.
    fn load(&self, stated: StatedLoad, settings: &Settings) -> Outcome<Load> {
        let (robot, of_settings) = (&self.robot, &settings.calibration.library.payload_frame);
        let frame = match (&self.stored, of_settings) {
            (Some(stored), _) => {
                let twin = &stored.calibration.twin;
                if twin.payload_where_unknown {
                    return Err(Failure::usage(
                        "the twin's payload acts in logs whose payload is \"unknown\", not beside a known load",
                        "leave `load` out of the limits, or fit logs that state what they carry",
                    ));
                }
                let library = twin.library().map_err(twincal_io::Error::from)?;
                library.payload_frame(robot).to_owned()
            }
            (None, Some(frame)) => frame.clone(),
            (None, None) => robot.last_link().to_owned(),
        };
        Ok(Load {
            frame,
            mass: stated.mass,
            com: stated.com,
        })
    }

    /// The motion of logs that the twin does not know yet, read as its own were.
    fn recorded(
        &self,
        paths: &[PathBuf],
        settings: &Settings,
        terminal: &mut Terminal,
    ) -> Outcome<Option<Recorded>> {
        if paths.is_empty() {
            return Ok(None);
        }
        let progress = Progress::new();
        let (logs, pipeline) = match &self.stored {
            Some(stored) => {
                let logs = LogInput::for_twin(paths, stored, settings.log.clone(), &progress)?;
                let role = |file| role_in_fit(file, stored);
                if let Some(known) = logs.files.iter().find(|file| role(file) == Some("fit")) {
                    return Err(Failure::usage(
                        format!("{}: the twin was fitted to this log", known.name),
                        "leave it out of --after: what it shows is in the twin",
                    ));
                }
                (logs, stored.calibration.twin.pipeline.clone())
            }
            None => {
                let long = Long::of_settings(settings);
                let logs = LogInput::read(paths, &self.robot, &settings.log, long, &progress)?;
                let signal = &settings.calibration.signal;
                let chosen = choose_and_prepare(&self.robot, &logs.logs, signal);
                let pipeline = chosen.map_err(|error| logs.as_given(error))?.pipeline;
                (logs, pipeline)
            }
        };
        require_once(&logs)?;
        for log in logs
            .logs
            .iter()
            .filter(|own| own.payload() != Payload::None)
        {
            terminal.note(&format!(
                "warning: {}: what it carries is not counted, it counts as recorded without",
                log.name()
            ));
        }
        let recorded = Recorded::new(&self.robot, &pipeline, &logs.logs);
        let (recorded, mut findings) = recorded.map_err(|error| logs.as_given(error))?;
        drop(progress);
        findings.splice(0..0, logs.findings);
        for finding in findings.iter().filter(|own| own.severity > Severity::Note) {
            terminal.note(&format!("warning: {}", finding.message));
        }
        Ok(Some(recorded))
    }
}

pub(super) fn run(flags: &Flags, terminal: &mut Terminal) -> Outcome<u8> {
    let claim = claimed(flags)?;
    start_threads(flags.threads.map(|threads| threads as usize))?;
    let from_config = settings_of(flags)?;
    let stated = match &flags.limits {
        Some(path) => read_limits(path)?,
        None => Limits::default(),
    };
    let known = Known::read(flags, &from_config)?;
    let load = (stated.load)
        .map(|own| known.load(own, &from_config))
        .transpose()?;
    let recorded = known.recorded(&flags.after, &from_config, terminal)?;
    let limits = joint_limits(&known.robot, &stated.joints).map_err(twincal_io::Error::from)?;
    for text in words::beyond_model(&limits) {
        terminal.note(&format!("warning: {text}"));
    }
    let settings = design_settings(flags);
    let geometry = (&known.geometry, known.path.as_path());
    let world = CollisionWorld::new(&known.robot, geometry, &limits, &stated.surroundings)?;
    let within = Within {
        limits: &limits,
        world: &world,
        recorded: recorded.as_ref(),
        load: load.as_ref(),
    };
    let (found, limits) = match &known.stored {
        None => showing(&known, &within, &settings)?,
        Some(stored) => deciding(stored, &flags.decide, &within, &settings)?,
    };
    let about = About {
        model: known.model,
        settings: &settings,
        limits: &limits,
        surroundings: &stated.surroundings,
        world: &world,
        recorded: recorded.as_ref(),
        load: load.as_ref(),
        kinds: (0..known.robot.dof())
            .map(|joint| known.robot.joint_kind(joint))
            .collect(),
    };
    let json = design_json(&found, &about)?;
    let files = files(&found, &about, json.clone())?;
    require_caller()?;
    claim.commit(Maker::Design, files)?;
    terminal.complete(&flags.output);
    if flags.json {
        terminal.data(&String::from_utf8_lossy(&json));
    } else {
        print(&found, &about, &flags.output, terminal);
    }
    Ok(0)
}

/// The folder of the result, which none of the inputs is in.
fn claimed(flags: &Flags) -> Outcome<Claim> {
    let mut inputs = Inputs::default();
    let given = [&flags.model, &flags.twin, &flags.limits, &flags.config];
    let given = given.into_iter().flatten().chain(&flags.after);
    given.for_each(|path| inputs.add(path));
    Ok(Claim::new(&flags.output, replaced(flags.force), &inputs)?)
}

/// What --config says; of a twin it says how logs of --after are read, and nothing else.
fn settings_of(flags: &Flags) -> Outcome<Settings> {
    let Some(path) = &flags.config else {
        return Ok(Config::default().settings()?);
    };
    let settings = Config::read(path)?.settings()?;
    if flags.twin.is_some() && flags.after.is_empty() {
        return Err(Failure::usage(
            "--config says nothing of a twin: its base and its settings are those of the fit",
            "leave it out; with --after it says how those logs are read",
        ));
    }
    Ok(settings)
}

/// Length, rate, seed and criterion of the motion.
fn design_settings(flags: &Flags) -> DesignSettings {
    DesignSettings {
        duration: flags.duration,
        rate: flags.rate,
        seed: flags.seed,
        criterion: match flags.criterion {
            OfFlags::Determinant => Criterion::Determinant,
            OfFlags::Condition => Criterion::Condition,
        },
        ..DesignSettings::default()
    }
}

/// # Errors
/// Where a log is given twice: what it shows would count twice.
fn require_once(logs: &LogInput) -> Outcome<()> {
    for (place, file) in logs.files.iter().enumerate() {
        let same = |other: &&FileHash| other.sha256 == file.sha256;
        if let Some(other) = logs.files[..place].iter().find(same) {
            return Err(Failure::usage(
                format!("{} and {} are the same log", other.name, file.name),
                "give it once: what it shows would count twice",
            ));
        }
    }
    Ok(())
}

/// All that is written of a motion.
fn files(
    found: &Design,
    about: &About<'_>,
    json: Vec<u8>,
) -> Outcome<Vec<(&'static str, Vec<u8>)>> {
    let motion = &found.motion;
    Ok(vec![
        (MOTION, motion_csv(motion).into_bytes()),
        (TABLE, motion_parquet(motion)?),
        (DESIGN, json),
        (PAGE, design_page(found, about)?.into_bytes()),
        (TRAJECTORY, joint_trajectory(motion).into_bytes()),
        (KEYFRAMES, mujoco_keyframes(motion).into_bytes()),
    ])
}

/// A motion, and the limits with the start that it has.
type Found = (Design, Vec<JointLimits>);

/// What a motion stays within, and what it follows.
struct Within<'a> {
    limits: &'a [JointLimits],
    world: &'a CollisionWorld,
    recorded: Option<&'a Recorded>,
    load: Option<&'a Load>,
}

impl Within<'_> {
    /// A twin's robot and its candidates with what it carries in the motion.
    fn loaded(&self, robot: &Robot, library: &Library) -> Outcome<Option<Loaded>> {
        let with = |load| Loaded::new(robot, library, load);
        Ok(self
            .load
            .map(with)
            .transpose()
            .map_err(twincal_io::Error::from)?)
    }
}

/// A motion that shows body, motors and friction of a model.
fn showing(known: &Known, within: &Within<'_>, settings: &DesignSettings) -> Outcome<Found> {
    let carrying = |own: &Load| known.robot.carrying(&own.frame, own.mass, own.com);
    let loaded = within.load.map(carrying).transpose();
    let loaded = loaded.map_err(twincal_io::Error::from)?;
    let robot = loaded.as_ref().unwrap_or(&known.robot);
    let torque = NominalTorque::new(robot, within.limits);
    searched(&known.robot, within, (&torque, None), settings)
}

/// A motion that decides what a twin leaves open.
fn deciding(
    stored: &StoredTwin,
    decide: &[String],
    within: &Within<'_>,
    settings: &DesignSettings,
) -> Outcome<Found> {
    let (calibration, twin) = (&stored.calibration, &stored.calibration.twin);
    let Some(problem) = &calibration.problem else {
        return Err(Failure::usage(
            "the twin does not hold the regression behind it",
            "fit again with this version of twincal; the twin of a fleet has none",
        ));
    };
    let core = twincal_io::Error::from;
    let library = twin.library().map_err(core)?;
    let loaded = within.loaded(&twin.robot, &library)?;
    let torque = FoundTorque::new(twin, loaded.as_ref(), within.limits).map_err(core)?;
    let rate = calibration.kept_rate_hz();
    let questions = Questions::new((problem, twin), (&library, rate), decide);
    let mut questions = questions.map_err(core)?;
    if let Some(loaded) = &loaded {
        questions = questions.carrying(loaded);
    }
    searched(&twin.robot, within, (&torque, Some(&questions)), settings)
}

/// The search, with its gain on standard error; Ctrl-C ends it with what it has.
fn searched(
    robot: &Robot,
    within: &Within<'_>,
    (torque, questions): (&dyn TorqueLimits, Option<&Questions<'_>>),
    settings: &DesignSettings,
) -> Outcome<Found> {
    let library = LibrarySettings {
        families: FAMILIES.to_vec(),
        ..LibrarySettings::default()
    };
    let (library, _) = Library::propose(robot, &library).map_err(twincal_io::Error::from)?;
    let task = Task {
        robot,
        library: &library,
        questions,
        recorded: within.recorded,
        limits: within.limits,
        torque: Some(torque),
        clearance: Some(within.world),
    };
    let limits = with_free_start(&task).map_err(twincal_io::Error::from)?;
    let task = Task {
        limits: &limits,
        ..task
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
    let found = design(&task, settings, &watch).map_err(twincal_io::Error::from)?;
    Ok((found, limits))
}

/// What the motion is expected to say of each question.
fn print_promises(found: &Design, loaded: bool, terminal: &mut Terminal) {
    if found.promises.is_empty() {
        return;
    }
    let mut rows = table(&["effect", "PIP now", "decided rightly", "wrongly", "sd then"]);
    for promise in &found.promises {
        let decided = |share: f64| match promise.structural {
            true => "–".to_owned(),
            false => words::share(share),
        };
        rows.add_row([
            promise.effect.clone(),
            words::chance(promise.pip),
            decided(promise.right),
            decided(promise.wrong),
            promise.sd.map_or_else(|| "–".into(), |sd| number(sd, 2)),
        ]);
    }
    print_table(&rows, terminal);
    for promise in found.promises.iter().filter(|own| own.structural) {
        paragraph(&words::undecidable(promise, loaded), terminal);
    }
    terminal.say("");
}

fn print(found: &Design, about: &About<'_>, output: &Path, terminal: &mut Terminal) {
    terminal.heading(&words::headline(found));
    paragraph(&words::purpose(found, about.settings.criterion), terminal);
    paragraph(&words::information(found), terminal);
    if let Some(recorded) = about.recorded {
        paragraph(&words::before(recorded), terminal);
    }
    if let Some(load) = about.load {
        paragraph(&words::carried(load), terminal);
    }
    terminal.say("");
    print_promises(found, about.load.is_some(), terminal);
    let heads = [
        "joint",
        "from",
        "to",
        "velocity",
        "acceleration",
        "jerk",
        "torque",
    ];
    let mut rows = table(&heads);
    for used in &found.used {
        let share = |at: usize| words::share(used.share[at]);
        rows.add_row([
            used.joint.clone(),
            number(used.position[0], 3),
            number(used.position[1], 3),
            share(0),
            share(1),
            share(2),
            used.torque
                .map_or_else(|| words::NOT_LIMITED.into(), words::share),
        ]);
    }
    print_table(&rows, terminal);
    terminal.say(words::SHARES);
    for text in words::assumed(about.limits) {
        paragraph(&text, terminal);
    }
    for text in words::clearance(found, about.world) {
        paragraph(&text, terminal);
    }
    paragraph(WARNING, terminal);
    terminal.say(&output.join(MOTION).to_string_lossy());
}
