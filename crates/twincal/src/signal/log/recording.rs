//! What a recording is: time stamps and the channels of every joint, as they were read or put together from arrays.

use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};

/// One joint's channels as logged, SI units, all of the recording's length.
#[derive(Debug, Clone, PartialEq)]
pub struct Channels {
    /// rad or m.
    pub q: Vec<f64>,
    /// rad/s or m/s, if logged.
    pub qd: Option<Vec<f64>>,
    /// rad/s² or m/s², if logged.
    pub qdd: Option<Vec<f64>>,
    /// N·m or N; absent for a log that is only to be predicted.
    pub tau: Option<Vec<f64>>,
    /// Temperature of the drive, °C or K, if logged; NaN where it is not known. It explains drift and nothing else.
    pub temperature: Option<Vec<f64>>,
}

/// What a robot carried in a log, beyond its model.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Payload {
    /// Nothing that the model does not have.
    #[default]
    None,
    /// A point mass (a body whose own tensor is left out) at a known place.
    Known {
        /// kg.
        mass: f64,
        /// Centre of mass in the payload frame, m.
        com: [f64; 3],
    },
    /// Something: mass and centre of mass are to be found in these logs.
    Unknown,
}

/// A log as read: joints already matched to the robot's q1…qn, values untouched (NaN included).
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    /// Whether angles are unfolded already, or known not to be folded, by what the whole log shows: they are left as they are then.
    pub unfolded: bool,
    /// Name as given by the user.
    pub name: String,
    /// Time stamps, s from [`Recording::start_ns`] on.
    pub time: Vec<f64>,
    /// Where time counts from, ns: 0 for a log whose stamps are in `time` as they are, of a bag the first stamp (ns since 1970), which
    /// a double would round to 0.2 µs.
    pub start_ns: i64,
    /// One entry per moving joint of the robot, in order.
    pub joints: Vec<Channels>,
    /// What the robot carried.
    pub payload: Payload,
}

impl Recording {
    /// A recording without joints yet: `time` are its stamps, s.
    ///
    /// # Example
    /// ```
    /// use twincal::prelude::*;
    ///
    /// let time: Vec<f64> = (0..100).map(|i| 0.01 * f64::from(i)).collect();
    /// let [q, torque] = [f64::sin, f64::cos].map(|f| time.iter().map(|t| f(*t)).collect::<Vec<_>>());
    /// let log = Recording::new("run1", time).joint(q, torque)?;
    /// assert_eq!(log.joints.len(), 1);
    /// # Ok::<(), twincal::Error>(())
    /// ```
    pub fn new(name: impl Into<String>, time: impl Into<Vec<f64>>) -> Self {
        Self {
            unfolded: false,
            name: name.into(),
            time: time.into(),
            start_ns: 0,
            joints: Vec::new(),
            payload: Payload::None,
        }
    }

    /// Adds the next moving joint of the robot, in its order: positions, rad or m, and measured torque, N·m or N, one for each stamp. Samples that
    /// are not known are NaN.
    ///
    /// # Errors
    /// [`Error::Log`] with both lengths where one differs from that of the stamps.
    pub fn joint(self, q: impl Into<Vec<f64>>, torque: impl Into<Vec<f64>>) -> Result<Self> {
        let joint = self.joints.len() + 1;
        let q = self.checked(q.into(), "positions", joint)?;
        let torque = self.checked(torque.into(), "torques", joint)?;
        Ok(self.with(q, Some(torque)))
    }

    /// Adds the next moving joint without torque, for a recording that is only to be predicted.
    ///
    /// # Errors
    /// Those of [`Recording::joint`].
    pub fn joint_without_torque(self, q: impl Into<Vec<f64>>) -> Result<Self> {
        let q = self.checked(q.into(), "positions", self.joints.len() + 1)?;
        Ok(self.with(q, None))
    }

    /// Velocity of the joint that was added last, rad/s or m/s; without it velocity is derived from position.
    ///
    /// # Errors
    /// Those of [`Recording::joint`], and [`Error::Log`] before the first joint.
    pub fn velocity(self, qd: impl Into<Vec<f64>>) -> Result<Self> {
        self.channel(qd.into(), "velocities", |joint, values| {
            joint.qd = Some(values);
        })
    }

    /// Acceleration of the joint that was added last, rad/s² or m/s²; without it acceleration is derived.
    ///
    /// # Errors
    /// Those of [`Recording::velocity`].
    pub fn acceleration(self, qdd: impl Into<Vec<f64>>) -> Result<Self> {
        self.channel(qdd.into(), "accelerations", |joint, values| {
            joint.qdd = Some(values);
        })
    }

    /// Temperature of the drive of the joint that was added last, °C or K.
    ///
    /// # Errors
    /// Those of [`Recording::velocity`].
    pub fn temperature(self, temperature: impl Into<Vec<f64>>) -> Result<Self> {
        self.channel(temperature.into(), "temperatures", |joint, values| {
            joint.temperature = Some(values);
        })
    }

    /// What the robot carried.
    ///
    /// # Example
    /// ```
    /// use twincal::prelude::*;
    ///
    /// let log = Recording::new("with a gripper", [0.0, 0.01, 0.02]).joint([0.1; 3], [4.0; 3])?;
    /// let log = log.carrying(Payload::Known { mass: 0.9, com: [0.0, 0.0, 0.06] }); // kg, m in the payload frame
    /// assert!(matches!(log.payload, Payload::Known { mass, .. } if mass == 0.9));
    /// # Ok::<(), twincal::Error>(())
    /// ```
    #[must_use]
    pub fn carrying(mut self, payload: Payload) -> Self {
        self.payload = payload;
        self
    }

    fn with(mut self, q: Vec<f64>, tau: Option<Vec<f64>>) -> Self {
        self.joints.push(Channels {
            q,
            qd: None,
            qdd: None,
            tau,
            temperature: None,
        });
        self
    }

    fn channel(
        mut self,
        values: Vec<f64>,
        what: &str,
        put: impl FnOnce(&mut Channels, Vec<f64>),
    ) -> Result<Self> {
        let joint = self.joints.len();
        let Some(mut last) = self.joints.pop() else {
            return Err(Error::Log {
                log: self.name,
                problem: format!("has {what} before its first joint"),
                remedy: "add the joint with its positions first".into(),
            });
        };
        put(&mut last, self.checked(values, what, joint)?);
        self.joints.push(last);
        Ok(self)
    }

    fn checked(&self, values: Vec<f64>, what: &str, joint: usize) -> Result<Vec<f64>> {
        let (stamps, count) = (self.time.len(), values.len());
        if count == stamps {
            return Ok(values);
        }
        Err(Error::Log {
            log: self.name.clone(),
            problem: format!("joint {joint} has {count} {what} for {stamps} stamps"),
            remedy: "give one value for each stamp, NaN where it is not known".into(),
        })
    }

    /// A log can be predicted without torque, not fitted and not scored. `names`: moving joints in order.
    ///
    /// # Errors
    /// [`Error::Log`] naming the first joint without.
    pub fn require_torque(&self, names: &[&str]) -> Result<()> {
        let without = |(channels, _): &(&Channels, &&str)| channels.tau.is_none();
        match self.joints.iter().zip(names).find(without) {
            Some((_, name)) => Err(Error::Log {
                log: self.name.clone(),
                problem: format!("has no torque of joint `{name}`"),
                remedy: "measured torque is needed here; name its column in [columns] tau, and say torque = \"current\" in [[log]] if it is a current".into(),
            }),
            None => Ok(()),
        }
    }
}

/// The next channel of a recording whose channels so far are right: the first one that is not is the error.
///
/// # Example
/// ```
/// use twincal::prelude::*;
///
/// let log = || Recording::new("run1", [0.0, 0.1, 0.2]);
/// let two = log().joint([1.0; 3], [0.0; 3]).velocity([0.0; 3]).joint([2.0; 3], [0.5; 3])?;
/// assert_eq!(two.joints.len(), 2);
/// assert!(log().joint([1.0; 3], [0.0; 2]).joint([2.0; 3], [0.5; 3]).is_err());
/// # Ok::<(), twincal::Error>(())
/// ```
pub trait NextChannel: Sized {
    /// [`Recording::joint`].
    ///
    /// # Errors
    /// That of an earlier channel, or of this one.
    fn joint(self, q: impl Into<Vec<f64>>, torque: impl Into<Vec<f64>>) -> Result<Recording>;

    /// [`Recording::velocity`].
    ///
    /// # Errors
    /// That of an earlier channel, or of this one.
    fn velocity(self, qd: impl Into<Vec<f64>>) -> Result<Recording>;

    /// [`Recording::acceleration`].
    ///
    /// # Errors
    /// That of an earlier channel, or of this one.
    fn acceleration(self, qdd: impl Into<Vec<f64>>) -> Result<Recording>;

    /// [`Recording::temperature`].
    ///
    /// # Errors
    /// That of an earlier channel, or of this one.
    fn temperature(self, temperature: impl Into<Vec<f64>>) -> Result<Recording>;

    /// [`Recording::joint_without_torque`].
    ///
    /// # Errors
    /// That of an earlier channel, or of this one.
    fn joint_without_torque(self, q: impl Into<Vec<f64>>) -> Result<Recording>;

    /// [`Recording::carrying`].
    ///
    /// # Errors
    /// That of an earlier channel.
    fn carrying(self, payload: Payload) -> Result<Recording>;
}

impl NextChannel for Result<Recording> {
    fn joint(self, q: impl Into<Vec<f64>>, torque: impl Into<Vec<f64>>) -> Result<Recording> {
        self?.joint(q, torque)
    }

    fn velocity(self, qd: impl Into<Vec<f64>>) -> Result<Recording> {
        self?.velocity(qd)
    }

    fn acceleration(self, qdd: impl Into<Vec<f64>>) -> Result<Recording> {
        self?.acceleration(qdd)
    }

    fn temperature(self, temperature: impl Into<Vec<f64>>) -> Result<Recording> {
        self?.temperature(temperature)
    }

    fn joint_without_torque(self, q: impl Into<Vec<f64>>) -> Result<Recording> {
        self?.joint_without_torque(q)
    }

    fn carrying(self, payload: Payload) -> Result<Recording> {
        Ok(self?.carrying(payload))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_channel_of_another_length_is_an_error_with_both() {
        let log = || Recording::new("run1", [0.0, 0.1, 0.2]);
        let joint = log().joint([1.0, 2.0, 3.0], [0.0; 2]).unwrap_err();
        let said = "log `run1`: joint 1 has 2 torques for 3 stamps; give one value for each stamp, NaN where it is not known";
        assert_eq!(joint.to_string(), said);
        let early = log().velocity([0.0; 2]).unwrap_err().to_string();
        assert!(early.contains("before its first joint"), "{early}");
        let whole = log().joint([1.0, 2.0, 3.0], [0.0; 3]).unwrap();
        let second = whole.clone().joint([0.0; 4], [0.0; 3]).unwrap_err();
        assert!(second.to_string().contains("joint 2 has 4 positions"));
        let whole = whole.velocity([0.5; 3]).unwrap().carrying(Payload::Unknown);
        assert_eq!(whole.joints[0].qd, Some(vec![0.5; 3]));
        assert_eq!((whole.payload, whole.joints.len()), (Payload::Unknown, 1));
    }
}
