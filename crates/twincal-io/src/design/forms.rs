//! A motion as CSV, as a ROS 2 trajectory and as keyframes of MuJoCo.

use super::WARNING;
use std::fmt::Write as _;
use twincal::design::DesignedMotion;

/// Samples of a trajectory or of keyframes per second at most: controllers interpolate between them.
const MESSAGE_RATE: f64 = 100.0;

/// `t, q1…, qd1…, qdd1…`: s, rad, rad/s, rad/s² (m for sliders).
#[must_use]
pub fn motion_csv(motion: &DesignedMotion) -> String {
    let mut text = format!("{}\n", column_names(motion.joints.len()).join(","));
    for k in 0..motion.len {
        // Writing to a string cannot fail.
        let _ = write!(text, "{}", k as f64 / motion.rate);
        for all in quantities(motion) {
            let _ = write!(text, ",{}", row(motion, all, k, ","));
        }
        text.push('\n');
    }
    text
}

/// Columns of the motion's table.
pub(super) fn column_names(dof: usize) -> Vec<String> {
    let names = ["q", "qd", "qdd"].into_iter();
    let names = names.flat_map(|name| (1..=dof).map(move |j| format!("{name}{j}")));
    std::iter::once("t".to_owned()).chain(names).collect()
}

/// Position, velocity and acceleration, `[joint * len + sample]`.
pub(super) fn quantities(motion: &DesignedMotion) -> [&[f64]; 3] {
    [&motion.q, &motion.qd, &motion.qdd]
}

/// Samples that stand in messages: evenly, the last one included.
fn shown(motion: &DesignedMotion) -> Vec<usize> {
    let step = (motion.rate / MESSAGE_RATE).ceil().max(1.0) as usize;
    let mut samples: Vec<usize> = (0..motion.len).step_by(step).collect();
    if samples.last() != Some(&(motion.len - 1)) {
        samples.push(motion.len - 1);
    }
    samples
}

/// `trajectory_msgs/JointTrajectory` as YAML.
#[must_use]
pub fn joint_trajectory(motion: &DesignedMotion) -> String {
    let mut text = format!("# {WARNING}\njoint_names:\n");
    for name in &motion.joints {
        let _ = writeln!(text, "  - {}", quoted(name));
    }
    text.push_str("points:\n");
    for k in shown(motion) {
        let time = k as f64 / motion.rate;
        let (seconds, rest) = (time.floor(), time.fract());
        let rows = [
            ("positions", &motion.q),
            ("velocities", &motion.qd),
            ("accelerations", &motion.qdd),
        ];
        for (at, (name, all)) in rows.into_iter().enumerate() {
            let lead = if at == 0 { "  - " } else { "    " };
            let _ = writeln!(text, "{lead}{name}: [{}]", row(motion, all, k, ", "));
        }
        let _ = writeln!(
            text,
            "    time_from_start: {{sec: {seconds}, nanosec: {}}}",
            (rest * 1e9).round().min(999_999_999.0)
        );
    }
    text
}

/// `<keyframe>` of an MJCF model whose joints are those of the motion, in its order.
#[must_use]
pub fn mujoco_keyframes(motion: &DesignedMotion) -> String {
    let mut text = format!("<!-- {WARNING} -->\n<mujoco>\n  <keyframe>\n");
    for (at, k) in shown(motion).into_iter().enumerate() {
        let _ = writeln!(
            text,
            "    <key name=\"design{at}\" time=\"{}\" qpos=\"{}\" qvel=\"{}\"/>",
            k as f64 / motion.rate,
            row(motion, &motion.q, k, " "),
            row(motion, &motion.qd, k, " ")
        );
    }
    text.push_str("  </keyframe>\n</mujoco>\n");
    text
}

fn row(motion: &DesignedMotion, all: &[f64], k: usize, between: &str) -> String {
    let values = (0..motion.joints.len()).map(|j| all[j * motion.len + k].to_string());
    values.collect::<Vec<_>>().join(between)
}

/// A name as a YAML string in double quotes, which are those of JSON.
fn quoted(name: &str) -> String {
    serde_json::Value::from(name).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn motion() -> DesignedMotion {
        DesignedMotion {
            joints: vec!["a: \"b\"\n".into(), "c".into()],
            rate: 300.0,
            len: 5,
            q: (0..10).map(f64::from).collect(),
            qd: vec![0.5; 10],
            qdd: vec![-0.25; 10],
        }
    }

    #[test]
    fn the_table_has_a_row_per_sample() {
        let text = motion_csv(&motion());
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[0], "t,q1,q2,qd1,qd2,qdd1,qdd2");
        assert_eq!(lines.len(), 6);
        assert_eq!(lines[4], "0.01,3,8,0.5,0.5,-0.25,-0.25");
    }

    #[test]
    fn messages_have_every_third_sample_and_the_last_and_names_are_text() {
        let yaml = joint_trajectory(&motion());
        assert!(yaml.contains(r#"  - "a: \"b\"\n""#), "{yaml}");
        assert_eq!(yaml.matches("positions").count(), 3);
        assert!(yaml.contains("nanosec: 13333333}"), "{yaml}");
        assert!(yaml.starts_with('#') && yaml.contains("10 % speed"));
        let xml = mujoco_keyframes(&motion());
        assert!(
            xml.contains(r#"qpos="4 9""#) && xml.contains("10 % speed"),
            "{xml}"
        );
    }
}
