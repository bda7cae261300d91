//! Small logs for tests: a two-joint motion as text cells that a test then spoils.

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use twincal::robot::{
    Inertia, JointDescription, JointKind, LinkDescription, Robot, RobotDescription,
};

/// A table of text cells.
#[derive(Debug, Clone)]
pub(crate) struct LogText {
    pub(crate) header: Vec<String>,
    pub(crate) rows: Vec<Vec<String>>,
}

/// Position, velocity and acceleration of joint `joint` (0, 1, …) at time `t`: two harmonics.
pub(crate) fn motion(joint: usize, t: f64) -> [f64; 3] {
    let (a, w) = (
        1.0 / (1.0 + joint as f64),
        TAU * (0.4 + 0.13 * joint as f64),
    );
    let (b, v) = (0.3, TAU * (1.1 - 0.2 * joint as f64));
    [
        a * (w * t).sin() + b * (v * t).cos(),
        a * w * (w * t).cos() - b * v * (v * t).sin(),
        -a * w * w * (w * t).sin() - b * v * v * (v * t).cos(),
    ]
}

impl LogText {
    /// `t,q1,qd1,qdd1,tau1,q2,…` for `seconds` at `rate` Hz; the torque is q̈ + 0.5 q̇.
    pub(crate) fn moving(joints: usize, rate: f64, seconds: f64) -> Self {
        let mut header = vec!["t".to_owned()];
        for j in 1..=joints {
            header.extend(["q", "qd", "qdd", "tau"].map(|word| format!("{word}{j}")));
        }
        let rows = (0..(rate * seconds) as usize)
            .map(|i| {
                let t = i as f64 / rate;
                let mut row = vec![format!("{t:.6}")];
                for j in 0..joints {
                    let [q, qd, qdd] = motion(j, t);
                    row.extend([q, qd, qdd, qdd + 0.5 * qd].map(|v| format!("{v:.9}")));
                }
                row
            })
            .collect();
        Self { header, rows }
    }

    /// Index of a column.
    pub(crate) fn column(&self, name: &str) -> usize {
        self.header.iter().position(|h| h == name).expect("column")
    }

    /// Overwrites a cell.
    pub(crate) fn set(&mut self, row: usize, column: &str, value: impl ToString) -> &mut Self {
        let index = self.column(column);
        self.rows[row][index] = value.to_string();
        self
    }

    /// Overwrites a column by a function of its row and old text.
    pub(crate) fn map(&mut self, column: &str, f: impl Fn(usize, &str) -> String) -> &mut Self {
        let index = self.column(column);
        for (i, row) in self.rows.iter_mut().enumerate() {
            row[index] = f(i, &row[index]);
        }
        self
    }

    /// Without the named columns.
    pub(crate) fn without(mut self, columns: &[&str]) -> Self {
        for name in columns {
            let index = self.column(name);
            self.header.remove(index);
            self.rows.iter_mut().for_each(|row| {
                row.remove(index);
            });
        }
        self
    }

    /// As text with a delimiter.
    pub(crate) fn delimited(&self, delimiter: &str) -> String {
        let mut text = self.header.join(delimiter) + "\n";
        for row in &self.rows {
            text += &row.join(delimiter);
            text.push('\n');
        }
        text
    }

    /// As CSV.
    pub(crate) fn csv(&self) -> String {
        self.delimited(",")
    }
}

/// A chain of equal links whose joints have the given names and kinds.
pub(crate) fn robot(joints: &[(&str, JointKind)]) -> Robot {
    let inertia = Inertia {
        mass: 1.0,
        com: [0.2, 0.0, 0.0],
        tensor: [[0.01, 0.0, 0.0], [0.0, 0.02, 0.0], [0.0, 0.0, 0.02]],
    };
    let mut links = vec![LinkDescription {
        name: "base".into(),
        inertia: None,
    }];
    let mut described = Vec::new();
    for (i, (name, kind)) in joints.iter().enumerate() {
        let child = format!("link{}", i + 1);
        described.push(JointDescription::new(name, *kind, &links[i].name, &child));
        links.push(LinkDescription {
            name: child,
            inertia: Some(inertia),
        });
    }
    let description = RobotDescription {
        name: "chain".into(),
        gravity: [0.0, -9.81, 0.0],
        links,
        joints: described,
        allow_unphysical: false,
    };
    Robot::new(description, &BTreeMap::new())
        .expect("valid robot")
        .0
}

/// Two revolute joints, `shoulder` and `elbow`.
pub(crate) fn arm() -> Robot {
    robot(&[
        ("shoulder", JointKind::Revolute),
        ("elbow", JointKind::Revolute),
    ])
}
