//! What a program that calibrates needs by name: `use twincal::prelude::*`.
//!
//! | | |
//! |---|---|
//! | in | [`Robot`], [`Recording`], [`Payload`], [`Log`], [`Settings`], [`Family`], [`Auto`] |
//! | run | [`Calibrate`], [`Stage`], [`Stopped`], [`Error`], [`Finding`], [`Severity`] |
//! | out | [`Calibration`], [`Effect`], [`Status`], [`ParameterSummary`], [`Twin`], [`Torque`], [`TorqueModel`] |
//!
//! # From arrays
//! One joint whose motor has inertia that the model lacks.
//! ```
//! # use twincal::prelude::*;
//! # use twincal::robot::*;
//! # fn slider() -> Result<Robot, Error> {
//! #     let inertia = Inertia { mass: 2.0, com: [0.0; 3], tensor: [[0.0; 3]; 3] };
//! #     let link = |name: &str, inertia| LinkDescription { name: name.into(), inertia };
//! #     let mut joint = JointDescription::new("axis", JointKind::Prismatic, "base", "cart");
//! #     joint.axis = [1.0, 0.0, 0.0];
//! #     let links = vec![link("base", None), link("cart", Some(inertia))];
//! #     let (name, gravity) = ("slider".into(), [0.0, 0.0, -9.81]);
//! #     let description = RobotDescription { name, gravity, links, joints: vec![joint], allow_unphysical: false };
//! #     Robot::from_description(description)
//! # }
//! # fn record(name: &str, phase: f64) -> Result<Recording, Error> {
//! let time: Vec<f64> = (0..4000).map(|i| 0.005 * f64::from(i)).collect();
//! let at = |t: &f64| (1.3 * t + phase, 3.1 * t - phase);
//! let q: Vec<f64> = time.iter().map(at).map(|(a, b)| 0.4 * a.sin() + 0.1 * b.sin()).collect();
//! let qdd: Vec<f64> = time.iter().map(at).map(|(a, b)| -0.676 * a.sin() - 0.961 * b.sin()).collect();
//! let force: Vec<f64> = qdd.iter().enumerate().map(|(i, a)| 2.5 * a + 0.01 * (1.7 * i as f64).sin()).collect();
//! let log = Recording::new(name, time).joint(q, force).acceleration(qdd)?;
//! # Ok(log) }
//! # let (log, other) = (record("run1", 0.0)?, record("run2", 1.0)?);
//! let robot = slider()?; // or twincal_io::read_robot("arm.urdf")?
//! let fit = Calibrate::new(&robot).logs([log]).heldout([other]).run()?;
//! for effect in fit.effects() {
//!     println!("{effect}");
//! }
//! # let found = fit.effects().next().ok_or("nothing")?;
//! # assert!(found.to_string().contains("+0.50"), "{found}");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Torque, and a term of one's own
//! The arm of the paper has 0.8 sin(q1 − q2) in its Lagrangian that no model has.
//! ```
//! # #[path = "../examples/two_link.rs"] mod two_link;
//! # use two_link::{arm, log};
//! # use twincal::prelude::*;
//! # let mut noise = twincal::random::Random::new(1, 0);
//! # let robot = arm(2.6)?;
//! # let log = log("run1", 0.3, &robot, &mut noise);
//! let mut settings = Settings::default();
//! settings.library.terms = vec!["sin(q1 - q2)".into(), "q2^2".into()]; // ΔL, by number of the joint
//! settings.library.families = vec![Family::Viscous];
//! let fit = Calibrate::new(&robot).logs([log]).settings(settings).run()?;
//! let term = fit.effects().find(|effect| effect.name() == "sin(q1 - q2)").ok_or("none")?;
//! assert!(term.status() == Status::Established && (term.parameters()[0].mean - 0.8).abs() < 0.02);
//!
//! let torque = fit.twin().torque(&[0.1, 0.7], &[0.5, -0.4], &[1.0, 0.0])?; // one state of two joints
//! for joint in 0..2 {
//!     println!("{:.2} … {:.2} N·m", torque.low[joint], torque.high[joint]);
//! }
//! # assert!(torque.low[0] < torque.mean[0] && torque.mean[0] < torque.high[0]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub use crate::builder::Calibrate;
pub use crate::calibrate::CalibrationSettings as Settings;
pub use crate::calibrate::{Calibration, Effect, ParameterSummary, Stage, Status, Stopped};
pub use crate::error::{Error, Finding, Severity};
pub use crate::robot::Robot;
pub use crate::signal::NextChannel as _;
pub use crate::signal::{Auto, Log, Payload, Recording};
pub use crate::term::Family;
pub use crate::twin::{Torque, TorqueModel, Twin};
