//! `twincal demo`: the paper's study on logs that the program carries, written to ./twincal-demo.

mod truth;

use super::brief::Around;
use super::calibration::{Job, Print, command, report_of, say_where};
use super::inputs::{LogInput, RobotInput};
use super::open::{OPENER, open};
use super::start_threads;
use crate::args::Demo;
use crate::clock::Stopwatch;
use crate::failure::Outcome;
use crate::terminal::Terminal;
use std::path::{Path, PathBuf};
use twincal_io::artifact::{Claim, Inputs, Maker, REPORT, Replace};
use twincal_io::config::Config;
use twincal_io::model::parse_model;

/// What is simulated, and what is asked.
const ABOUT: &str = "\
A simulated two-joint arm (MuJoCo). Its model is missing a payload, friction and more.
Which effects, how probable is each, and how well do they predict torque?";

const FOLDER: &str = "twincal-demo";
const MODEL: (&str, &[u8]) = ("arm.urdf", include_bytes!("../../assets/arm.urdf"));
const TRAIN: [(&str, &[u8]); 3] = [
    (
        "train1.parquet",
        include_bytes!("../../assets/train1.parquet"),
    ),
    (
        "train2.parquet",
        include_bytes!("../../assets/train2.parquet"),
    ),
    (
        "train3.parquet",
        include_bytes!("../../assets/train3.parquet"),
    ),
];
const HELDOUT: [(&str, &[u8]); 2] = [
    (
        "heldout1.parquet",
        include_bytes!("../../assets/heldout1.parquet"),
    ),
    (
        "heldout2.parquet",
        include_bytes!("../../assets/heldout2.parquet"),
    ),
];

pub(super) fn run(flags: &Demo, terminal: &mut Terminal) -> Outcome<u8> {
    let watch = Stopwatch::start();
    let mut config = Config::default();
    config.file.inference.seed = flags.seed;
    config.file.inference.threads = flags.threads;
    config.file.output.json = flags.json.then_some(true);
    let settings = config.settings()?;
    let output = Path::new(FOLDER);
    // Its model and logs are in the program: it reads no file.
    let replace = Replace::MadeBy(Maker::Demo);
    let claim = Claim::new(output, replace, &Inputs::default())?;
    start_threads(settings.threads)?;
    let print = Print::of(flags.print, settings.json);
    if print != Print::Answer {
        terminal.note(ABOUT);
    }
    let progress = print.progress();
    let robot = RobotInput::new(
        parse_model(MODEL.0, MODEL.1, &settings.model)?,
        MODEL.0.into(),
        &settings,
    )?;
    let logs = LogInput::carried(&TRAIN, &robot.robot, &settings.log)?;
    let heldout = LogInput::carried(&HELDOUT, &robot.robot, &settings.log)?;
    let job = Job {
        maker: Maker::Demo,
        command: as_a_fit(),
        config: &config,
        settings: &settings,
        robot,
        logs,
        statistics: None,
        heldout,
        output,
        watch,
    };
    let done = job.run(claim, beside(), progress, terminal)?;
    let truth = truth::beside(&done.stored.calibration, terminal.width())?;
    let end = end(output);
    let around = Around {
        instead: &truth,
        behind: end.len(),
        ..done.around(output)
    };
    done.print(print, around, terminal)?;
    if print == Print::All {
        truth.iter().for_each(|line| terminal.say(line));
        terminal.say("");
    }
    say_where(output, print, terminal);
    if matches!(print, Print::Brief | Print::All) {
        end.iter().for_each(|line| terminal.say(line));
    }
    if flags.print.open {
        open(&output.join(REPORT), terminal);
    }
    Ok(done.code)
}

/// The inputs, which lie beside the result: the command in the report can be repeated there.
fn beside() -> Vec<(&'static str, Vec<u8>)> {
    let carried = std::iter::once(&MODEL).chain(&TRAIN).chain(&HELDOUT);
    let carried = carried.map(|(name, bytes)| (*name, bytes.to_vec()));
    carried.collect()
}

/// The command that makes the same twin of the files in the folder.
fn as_a_fit() -> String {
    let paths = |logs: &[(&str, &[u8])]| -> Vec<PathBuf> {
        logs.iter().map(|(name, _)| PathBuf::from(name)).collect()
    };
    command(Path::new(MODEL.0), &paths(&TRAIN), &paths(&HELDOUT), "")
}

/// How to open the page, and the command to try next.
fn end(output: &Path) -> [String; 2] {
    [
        format!("Open the page:  {OPENER} {}", report_of(output)),
        "Your own log:   twincal doctor run.csv --model arm.urdf".into(),
    ]
}
