//! What `[columns]` has to say of logs whose numbers have other units, signs or another order than the model.

use super::examine::{Examination, JointColumns, Mapping};
use super::units::Degrees;
use std::collections::BTreeMap;
use twincal::self_check::JointCheck;
use twincal::words::listed;
use twincal::{Code, Finding};
use twincal_io::config::{ChannelNames, ColumnsTable, PerJoint, Settings, key};

/// `[columns]` of a proposed config.
pub(super) struct Columns {
    pub(super) table: ColumnsTable,
    /// Why numbers need factors.
    pub(super) why: String,
    /// What the table fixes.
    pub(super) fixed: Vec<Fixed>,
}

/// What a proposed config fixes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Fixed {
    Finding(Code),
    /// The refusal of positions in degrees.
    Degrees,
    /// The refusal of stamps in ticks of a clock.
    Ticks,
}

/// What was said of columns, with what the logs ask for beside it.
pub(super) fn columns(examination: &Examination, logs: usize, settings: &Settings) -> Columns {
    let mut all = Columns {
        table: settings.log.columns.clone(),
        why: String::new(),
        fixed: Vec::new(),
    };
    if let Some(unit) = examination.time_unit(logs, settings) {
        all.table.time_unit = Some(unit);
        all.fixed.push(Fixed::Ticks);
    }
    let is_logged = |column: fn(&JointColumns) -> bool| {
        let mut joints = examination.mappings.iter().flat_map(|(_, m)| &m.joints);
        examination.mappings.is_empty() || joints.any(column)
    };
    let logged = [
        true,
        is_logged(|joint| joint.velocity.is_some()),
        is_logged(|joint| joint.acceleration.is_some()),
        true,
    ];
    let degrees = examination.degrees(logs);
    let of_degrees = degrees.map(|own| all.convert(examination, own, logged));
    let joints = &examination.checkup.joints;
    let turned = joints.iter().filter(|check| is_turned(check));
    let mut whys: Vec<String> = of_degrees.into_iter().collect();
    whys.extend(turned.map(|check| all.turn(examination, check, logged)));
    whys.extend(all.scale(examination));
    all.why = whys.join(" ");
    if joints.iter().any(is_moved) && reorder(examination, &mut all.table) {
        all.fixed.push(Fixed::Finding(Code::JointOrder));
    }
    all
}

/// Whether position, velocity, acceleration and torque are logged.
type Logged = [bool; 4];

impl Columns {
    /// Radians of degrees; why.
    fn convert(
        &mut self,
        examination: &Examination,
        Degrees { factors, joints }: &Degrees,
        logged: Logged,
    ) -> String {
        let [position, rates] = *factors;
        let factor = &mut self.table.factor;
        let channels = [
            (&mut factor.q, position),
            (&mut factor.qd, rates),
            (&mut factor.qdd, rates),
        ];
        for ((factor, number), logged) in channels.into_iter().zip(logged) {
            if logged && number != 1.0 {
                *factor = of_joints(examination, joints, number);
            }
        }
        self.fixed.push(Fixed::Degrees);
        "Positions or velocities are logged in degrees.".to_owned()
    }

    /// Turns a joint round; why.
    fn turn(&mut self, examination: &Examination, check: &JointCheck, logged: Logged) -> String {
        let factor = &mut self.table.factor;
        let [position, rates, torque] = signs(check);
        let channels = [
            (&mut factor.q, position),
            (&mut factor.qd, rates),
            (&mut factor.qdd, rates),
            (&mut factor.tau, torque),
        ];
        for ((factor, sign), logged) in channels.into_iter().zip(logged) {
            if logged && sign < 0.0 {
                multiply(factor, examination, &check.joint, -1.0);
            }
        }
        self.fixed.push(Fixed::Finding(Code::SignFlip));
        format!("The sign of {} is reversed.", check.joint)
    }

    /// N·m of torque in another unit; why, where there is some.
    fn scale(&mut self, examination: &Examination) -> Option<String> {
        let joints = &examination.checkup.joints;
        let scaled: Vec<&JointCheck> = joints
            .iter()
            .filter(|joint| joint.torque_factor.is_some())
            .collect();
        for check in &scaled {
            let number = check.torque_factor.unwrap_or(1.0);
            multiply(
                &mut self.table.factor.tau,
                examination,
                &check.joint,
                number,
            );
        }
        if scaled.is_empty() {
            return None;
        }
        let mut scales = (examination.findings.iter()).filter(|f| f.code == Code::TorqueScale);
        let has_factor =
            |f: &Finding| f.subject.is_empty() || scaled.iter().any(|c| c.joint == f.subject);
        if scales.all(has_factor) {
            self.fixed.push(Fixed::Finding(Code::TorqueScale));
        }
        let names: Vec<&str> = scaled.iter().map(|check| check.joint.as_str()).collect();
        let whose = match names.len() == joints.len() {
            true => "All torque".to_owned(),
            false => format!("Torque of {}", listed(&names, ", ")),
        };
        Some(format!("{whose} looks like thousandths of N·m."))
    }
}

/// The line that turns the signs of a joint.
pub(super) fn sign_line(check: &JointCheck) -> String {
    let turned = format!("{{ {} = -1.0 }}", key(&check.joint));
    let channels = ["q", "qd", "tau"].into_iter().zip(signs(check));
    let lines: Vec<String> = channels
        .filter(|(_, sign)| *sign < 0.0)
        .map(|(channel, _)| format!("{channel} = {turned}"))
        .collect();
    format!("[columns.factor] {}", lines.join(", "))
}

/// Signs of a joint's position, of its velocity and acceleration, and of its torque.
fn signs(check: &JointCheck) -> [f64; 3] {
    [check.motion.1, check.rates, check.torque.1]
}

fn is_turned(check: &JointCheck) -> bool {
    signs(check).iter().any(|sign| *sign < 0.0)
}

/// Position, velocity and torque have the opposite sign: the axis of the model may as well be what is turned.
pub(super) fn is_axis(check: &JointCheck) -> bool {
    signs(check).iter().all(|sign| *sign < 0.0)
}

fn is_moved(check: &JointCheck) -> bool {
    check.motion.0 != check.joint || check.torque.0 != check.joint
}

/// A factor of some joints.
fn of_joints(examination: &Examination, joints: &[usize], number: f64) -> PerJoint {
    let names = examination.robot.robot.joint_names();
    if joints.len() == names.len() {
        return PerJoint::All(number);
    }
    let named = joints
        .iter()
        .map(|&joint| (names[joint].to_owned(), number));
    PerJoint::ByJoint(named.collect())
}

/// Another factor on one joint.
fn multiply(factor: &mut PerJoint, examination: &Examination, joint: &str, by: f64) {
    let names = examination.robot.robot.joint_names();
    let said = names
        .iter()
        .filter_map(|name| Some(((*name).to_owned(), factor.of_joint(name)?)));
    let mut by_joint: BTreeMap<String, f64> = said.collect();
    *by_joint.entry(joint.to_owned()).or_insert(1.0) *= by;
    let all_alike = by_joint.len() == names.len() && by_joint.values().all(|own| *own == by);
    *factor = match all_alike {
        true => PerJoint::All(by),
        false => PerJoint::ByJoint(by_joint),
    };
}

/// Maps the columns of exchanged joints; false where the columns are not those of one table.
fn reorder(examination: &Examination, table: &mut ColumnsTable) -> bool {
    let mut mappings = examination.mappings.iter().map(|(_, mapping)| mapping);
    let Some(first) = mappings.next() else {
        return false;
    };
    if mappings.any(|other| other.joints != first.joints) {
        return false;
    }
    let checks = &examination.checkup.joints;
    let of = |from: fn(&JointCheck) -> &str, column: fn(&JointColumns) -> Option<&String>| {
        let named = checks.iter().filter_map(|check| {
            let own = joint_of(first, from(check))?;
            Some((check.joint.clone(), column(own)?.clone()))
        });
        named.collect::<ChannelNames>()
    };
    table.q = of(|check| &check.motion.0, |joint| joint.position.as_ref());
    table.qd = of(|check| &check.motion.0, |joint| joint.velocity.as_ref());
    table.qdd = of(|check| &check.motion.0, |joint| joint.acceleration.as_ref());
    table.tau = of(|check| &check.torque.0, |joint| joint.torque.as_ref());
    true
}

fn joint_of<'a>(mapping: &'a Mapping, name: &str) -> Option<&'a JointColumns> {
    mapping.joints.iter().find(|joint| joint.joint == name)
}
