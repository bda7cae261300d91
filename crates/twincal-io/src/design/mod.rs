//! What `twincal design` reads and writes: limits of joints, and a motion in the forms that controllers and simulators take.

#[cfg(test)]
mod fixture;
mod forms;
mod json;
mod limits;
#[cfg(feature = "report")]
mod page;
#[cfg(feature = "tables")]
mod parquet;

pub use forms::{joint_trajectory, motion_csv, mujoco_keyframes};
pub use json::{About, design_json, design_schema};
pub use limits::{Limits, StatedLoad, limits_schema, read_limits};
#[cfg(feature = "report")]
pub use page::design_page;
#[cfg(feature = "tables")]
pub use parquet::motion_parquet;

/// The motion as a table.
pub const MOTION: &str = "motion.csv";
/// The same table in Parquet.
pub const TABLE: &str = "motion.parquet";
/// What it shows, for people.
pub const PAGE: &str = "design.html";
/// What it shows, for programs.
pub const DESIGN: &str = "design.json";
/// The motion as a ROS 2 `trajectory_msgs/JointTrajectory`.
pub const TRAJECTORY: &str = "trajectory.yaml";
/// The motion as keyframes of MuJoCo.
pub const KEYFRAMES: &str = "keyframes.xml";

/// Stands in every output.
pub const WARNING: &str = "Simulated only. Run it at 10 % speed first. No warranty of clearance.";
