//! Nominal torque of a model file for states in a CSV: `nominal_torque MODEL STATES.csv > TORQUES.csv`.
//!
//! The header of the states is `q1…qn, qd1…qdn, qdd1…qdn` (moving joints in the model's order, SI units); the answer
//! has `tau1…taun`, 17 digits. The Python checks hold it against MuJoCo's `mj_inverse`.

use std::collections::BTreeMap;
use std::error::Error;
use std::io::{self, BufWriter, Write};
use std::path::Path;
use twincal::robot::{Motion, Robot, nominal_torque};
use twincal_io::model::{ModelSettings, read_model};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [model, states] = arguments.as_slice() else {
        return Err("usage: nominal_torque MODEL STATES.csv".into());
    };
    let description = read_model(Path::new(model), &ModelSettings::default())?.description;
    let (robot, _) = Robot::new(description, &BTreeMap::new())?;
    let dof = robot.dof();

    // rows of the file → one array per column
    let mut reader = csv::Reader::from_path(states)?;
    let mut columns = vec![Vec::new(); 3 * dof];
    for row in reader.records() {
        let row = row?;
        if row.len() != columns.len() {
            return Err(format!(
                "{states}: {} columns, but {dof} joints need {}",
                row.len(),
                columns.len()
            )
            .into());
        }
        for (column, field) in columns.iter_mut().zip(&row) {
            column.push(field.parse::<f64>()?);
        }
    }
    let [q, qd, qdd] = [0, 1, 2].map(|part| columns[part * dof..(part + 1) * dof].concat());
    let len = q.len() / dof.max(1);
    let mut tau = vec![0.0; dof * len];
    nominal_torque(
        &robot,
        Motion {
            len,
            q: &q,
            qd: &qd,
            qdd: &qdd,
        },
        &mut tau,
    );

    let mut out = BufWriter::new(io::stdout().lock());
    let header: Vec<String> = (1..=dof).map(|joint| format!("tau{joint}")).collect();
    writeln!(out, "{}", header.join(","))?;
    for sample in 0..len {
        let row: Vec<String> = (0..dof)
            .map(|joint| format!("{:e}", tau[joint * len + sample]))
            .collect();
        writeln!(out, "{}", row.join(","))?;
    }
    Ok(out.flush()?)
}
