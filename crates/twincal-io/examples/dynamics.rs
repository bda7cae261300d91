//! How to use the dynamics: `dynamics MODEL STATES > ANSWER` reads a URDF or MJCF file and gives torque and regressor.
//!
//! STATES holds numbers of 8 bytes (little-endian): all q, then all q̇, then all q̈, joint by joint (SI units, moving
//! joints in the model's order). The answer is one line of JSON, which says what follows, and numbers of the same kind:
//!
//! 1. nominal torque, `joint × sample`;
//! 2. the regressor, `pair × parameter × sample`: what the ten parameters of a link (about the origin of its frame, axes
//!    of its frame, order m, mcx, mcy, mcz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz) add to the torque of one joint.
//!
//! The Python checks hold both against Pinocchio on every robot of `example-robot-data`.

use serde_json::json;
use std::collections::BTreeMap;
use std::error::Error;
use std::io::{self, BufWriter, Write};
use std::path::Path;
use twincal::robot::{
    BLOCK, Motion, Regressor, Robot, base_parameters, nominal_torque, to_body_frame,
};
use twincal_io::model::{ModelSettings, read_model};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [model, states] = arguments.as_slice() else {
        return Err("usage: dynamics MODEL STATES > ANSWER".into());
    };
    let settings = ModelSettings {
        allow_unphysical: true,
        ..ModelSettings::default()
    };
    let description = read_model(Path::new(model), &settings)?.description;
    let (robot, findings) = Robot::new(description, &BTreeMap::new())?;
    let dof = robot.dof();

    let bytes = std::fs::read(states)?;
    let numbers: Vec<f64> = bytes
        .as_chunks::<8>()
        .0
        .iter()
        .map(|&b| f64::from_le_bytes(b))
        .collect();
    let len = numbers.len() / (3 * dof);
    let (q, rest) = numbers.split_at(dof * len);
    let (qd, qdd) = rest.split_at(dof * len);
    let qdd = &qdd[..dof * len];
    let motion = Motion { len, q, qd, qdd };

    // Any number of samples at once.
    let mut tau = vec![0.0; dof * len];
    nominal_torque(&robot, motion, &mut tau);

    let regressor = Regressor::new(&robot);
    let columns = link_columns(&robot, &regressor, motion);
    let bodies = robot.bodies();
    let base = base_parameters(&robot);
    let pairs = regressor.pairs().iter();
    let pairs: Vec<[usize; 2]> = pairs.map(|p| [p.coordinate, p.body]).collect();
    let mimics = (0..bodies.len()).map(|body| robot.motion_of_body(body));
    let header = json!({
        "joints": robot.joint_names(),
        "bodies": bodies,
        "motion": mimics.collect::<Vec<_>>(),
        "pairs": pairs,
        "base_parameters": { "count": base.count, "names": base.names },
        "unidentifiable": base.unidentifiable,
        "findings": findings.iter().map(|f| &f.message).collect::<Vec<_>>(),
    });
    let mut out = BufWriter::new(io::stdout().lock());
    writeln!(out, "{header}")?;
    for value in tau.iter().chain(&columns) {
        out.write_all(&value.to_le_bytes())?;
    }
    Ok(out.flush()?)
}

/// The regressor in the frames of the links, `pair × parameter × sample`.
///
/// It comes in blocks that stay in the caches: use each before the next one is computed. Here all are kept.
fn link_columns(robot: &Robot, regressor: &Regressor, motion: Motion<'_>) -> Vec<f64> {
    let len = motion.len;
    let mut block = regressor.block(robot);
    let bodies = robot.bodies();
    let mut columns = vec![0.0; regressor.pairs().len() * 10 * len];
    for first in (0..len).step_by(BLOCK) {
        let samples = first..len.min(first + BLOCK);
        regressor.evaluate(robot, motion, samples.clone(), &mut block);
        for (index, pair) in regressor.pairs().iter().enumerate() {
            // Columns are about the body's frame (z along the joint); a constant map leads to the link's own frame.
            let Some((_, frame)) = robot.body_of_link(bodies[pair.body]) else {
                continue;
            };
            let map = to_body_frame(&frame);
            for k in 0..10 {
                let start = (index * 10 + k) * len;
                let cells = &mut columns[start + samples.start..start + samples.end];
                for i in (0..10).filter(|&i| map[i][k] != 0.0 && pair.present[i]) {
                    for (cell, value) in cells.iter_mut().zip(block.column(index, i)) {
                        *cell += map[i][k] * value;
                    }
                }
            }
        }
    }
    columns
}
