//! A model file as a generated one of the other format: `export_generated MODEL [JOINT=POSITION …] > FILE`.
//!
//! Joints with a position (rad or m) are locked there. Notes of the generated file go to standard error. The Python checks hold
//! these files against MuJoCo and Pinocchio.

use std::collections::BTreeMap;
use std::error::Error;
use std::io::{self, Write};
use std::path::Path;
use twincal::write_back::{Holds, WriteBack, dropped};
use twincal_io::export::generate::generate_model;
use twincal_io::model::{ModelFormat, ModelSettings, read_model};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let file = arguments
        .next()
        .ok_or("usage: export_generated MODEL [JOINT=POSITION …]")?;
    let mut locked = BTreeMap::new();
    for argument in arguments {
        let (joint, position) = argument.split_once('=').ok_or("JOINT=POSITION")?;
        locked.insert(joint.to_owned(), position.parse()?);
    }
    let model = read_model(Path::new(&file), &ModelSettings::default())?;
    let (robot, _) = model.robot(&locked)?;
    let (format, holds) = match model.format() {
        ModelFormat::Urdf => (ModelFormat::Mjcf, Holds::MJCF),
        ModelFormat::Mjcf => (ModelFormat::Urdf, Holds::URDF),
    };
    let change = WriteBack {
        dropped: dropped(&robot, holds),
        ..WriteBack::default()
    };
    let generated = generate_model(format, &robot, &change, &file)?;
    for note in generated.notes {
        writeln!(io::stderr(), "{note}")?;
    }
    Ok(io::stdout().write_all(&generated.bytes)?)
}
