//! Back into the user's model: which of the found effects a model file can hold, and what stays beside it.
//!
//! A file holds inertias, friction and, in MJCF, motor inertia, springs and gravity. All of these are linear in the
//! coefficients, so what is written is the posterior mean of exactly those columns; the rest is the residual.

mod joints;
mod linear_part;
mod links;
mod metric;
mod lost;
mod dropped;
mod torque_error;
#[cfg(test)]
mod tests;

pub use crate::rigid_body::Projection;
pub use dropped::{Dropped, dropped};
pub use joints::JointChange;
pub use links::LinkChange;
pub use torque_error::JointTorqueError;

use crate::calibrate::{Alike, Calibration, ComponentSummary, Status, StatusReason};
use crate::error::Result;
use crate::evaluator::{States, rms};
use crate::robot::{Robot, RobotDescription};
use crate::term::{Family, Library, ModelColumn};
use linear_part::Share;
use serde::Serialize;
use torque_error::InFile;

/// What a model format can hold beside inertias, viscous and dry friction.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Holds {
    /// Its name in messages.
    pub format: &'static str,
    /// Motor inertia, springs with rest position, and gravity.
    pub more: bool,
}

impl Holds {
    /// `<inertial>` and `<dynamics damping friction>`.
    pub const URDF: Self = Self {
        format: "URDF",
        more: false,
    };
    /// Also joint `armature`, `stiffness`, `springref` and `<option gravity>`.
    pub const MJCF: Self = Self {
        format: "MJCF",
        more: true,
    };
}

/// A component that goes into the file.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Written {
    /// Name of the component.
    pub component: String,
    /// In physical words, with its parameters given that it is in.
    pub words: String,
    /// Probability that it is in; the file holds the model average, so this share of the parameters.
    pub pip: f64,
    /// Link or joint that changes; `gravity`.
    pub place: String,
    /// What the file holds of a joint's friction or motor inertia, SI, where it is another number than the one in `words` by more than 2 %.
    pub in_file: Option<f64>,
    /// True where `in_file` stands for quadratic friction as well, which no file holds; else it is the average over all models.
    pub nearest: bool,
}

/// A component that the file cannot hold, or that is not established.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Residual {
    /// Name of the component.
    pub component: String,
    /// In physical words.
    pub words: String,
    /// Probability that it is in.
    pub pip: f64,
    /// Why it stays out.
    pub reason: String,
    /// RMS of its model-averaged torque over states within the training range, per joint, N·m (N).
    pub torque: Vec<f64>,
    /// `(name of the column, E[β | y])`; of friction that a file can stand for in part, minus that part as well.
    pub coefficients: Vec<(String, f64)>,
}

/// What changes in the model, and what stays beside it.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct WriteBack {
    /// Links with a new inertia, in the model's order.
    pub links: Vec<LinkChange>,
    /// Joints with new friction, motor inertia or spring, in the model's order.
    pub joints: Vec<JointChange>,
    /// Gravity in the base frame, m/s², where it changes.
    pub gravity: Option<[f64; 3]>,
    /// Components that are in the file now.
    pub written: Vec<Written>,
    /// Components that are not, largest torque first.
    pub residual: Vec<Residual>,
    /// What the nominal model itself has and the format cannot hold; the written robot is without it.
    pub dropped: Vec<Dropped>,
    /// How inertias were made physical; `None` where they were already.
    pub projection: Option<Projection>,
    /// RMS of the torque by which the file differs from the written components, per joint, N·m (N): what it costs that
    /// inertias are physical and friction is not negative.
    pub lost: Vec<f64>,
    /// RMS of the torque that all components add to the nominal model, per joint, N·m (N).
    pub correction: Vec<f64>,
    /// RMS of the torque that the twin has and the file has not, per joint, N·m (N): that of all residual components and of what is lost,
    /// summed state by state.
    pub lacks: Vec<f64>,
    /// Error of the user's file and of the written one on held-out rows, joint by joint, with the friction that they state.
    pub torque_error: Vec<JointTorqueError>,
}

/// Everything that a write-back needs of a calibration, worked out once for mean and draws.
///
/// # Example
/// 2 kg at the tip in the model, 2.6 kg in truth: the new inertia is the link's, the hidden torque has no place in a model file.
/// ```
/// # #[path = "../../examples/two_link.rs"] mod two_link;
/// use twincal::robot::potential_energy;
/// use twincal::write_back::{Holds, Writer};
///
/// # let fit = two_link::study()?;
/// let change = Writer::new(&fit, Holds::URDF)?.mean()?;
/// assert_eq!(change.links[0].link, "fore");
/// assert!((change.links[0].after.mass - 2.6).abs() < 0.02);
/// assert_eq!(change.residual[0].component, "sin(q1 - q2)");
/// let calibrated = change.robot(&fit.twin().robot)?; // the robot that the file describes
/// let upright = potential_energy(&calibrated, &[std::f64::consts::FRAC_PI_2, 0.0]);
/// assert!((upright - 9.81 * (3.0 * 0.5 + 2.6 * 1.0)).abs() < 0.1); // J
/// # Ok::<(), twincal::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct Writer<'a> {
    calibration: &'a Calibration,
    holds: Holds,
    library: Library,
    states: States,
}

/// Where coefficients go.
struct Places<'a> {
    /// Components that are to go into the file.
    chosen: &'a [bool],
    /// Components all of whose columns fit.
    whole: &'a [bool],
    /// Place of each column that the file holds.
    held: &'a [Option<Place>],
    /// All coefficients.
    beta: &'a [f64],
    /// Those of the columns that the file holds, as it holds them.
    file: &'a [f64],
    /// What the file holds of columns that do not fit.
    shares: &'a [Share],
}

/// Share by which a number in the file may differ from the one in words before both are told: words round, too.
const AS_TOLD: f64 = 0.02;

impl<'a> Writer<'a> {
    /// Prepares the write-back of a calibration into a file that holds this.
    ///
    /// # Errors
    /// Those of [`crate::twin::Twin::library`].
    pub fn new(calibration: &'a Calibration, holds: Holds) -> Result<Self> {
        let library = calibration.twin.library()?;
        let states = States::new(&calibration.twin, &library);
        Ok(Self {
            calibration,
            holds,
            library,
            states,
        })
    }

    /// The established effects, and sets of the same torque in every motion, with E[β | y]; all others stay beside the file, so that both together are the model average.
    ///
    /// # Errors
    /// [`crate::Error::Refused`] where no physical inertia can be found.
    pub fn mean(&self) -> Result<WriteBack> {
        let chosen = self.chosen();
        self.write(&chosen, &self.calibration.twin.posterior.mean)
    }

    /// One draw of all coefficients: every component that is in it.
    ///
    /// `beta` has one value per column; 0 where the column is out.
    ///
    /// # Errors
    /// As [`Writer::mean`].
    pub fn draw(&self, beta: &[f64]) -> Result<WriteBack> {
        let mut chosen = vec![false; self.library.components().len()];
        for (&term, &value) in self.library.columns().iter().zip(beta) {
            chosen[self.library.terms()[term].component] |= value != 0.0;
        }
        self.write(&chosen, beta)
    }

    /// The effects that are established, and of sets that are, whose members have the same torque in every motion, all members: their torque
    /// is established, only its name is open.
    fn chosen(&self) -> Vec<bool> {
        let is_chosen = |own: &ComponentSummary| match (own.status, &own.reason) {
            (Status::Established, _) => true,
            (Status::Equivalent, StatusReason::SameTorque { alike, .. }) => {
                *alike == Alike::EveryMotion
            }
            _ => false,
        };
        self.calibration.components.iter().map(is_chosen).collect()
    }

    /// The write-back of coefficients `beta` for the `chosen` components.
    fn write(&self, chosen: &[bool], beta: &[f64]) -> Result<WriteBack> {
        let robot = &self.calibration.twin.robot;
        let held: Vec<Option<Place>> = (0..beta.len())
            .map(|column| {
                self.place(column)
                    .filter(|_| chosen[self.component(column)])
            })
            .collect();
        // One column that does not fit keeps the whole story out.
        let mut whole = chosen.to_vec();
        for (column, place) in held.iter().enumerate() {
            whole[self.component(column)] &= place.is_some();
        }
        let held: Vec<Option<Place>> = (held.into_iter().enumerate())
            .map(|(column, place)| place.filter(|_| whole[self.component(column)]))
            .collect();
        let shares = self.shares(chosen, &held, beta);
        let file = linear_part::written(beta, &shares);
        let gravity = gravity(robot, &held, &file);
        let (links, projection) = links::changes(self, &held, &file, gravity)?;
        let absent = self.absent(&held);
        let said = joints::Said {
            held: &held,
            beta: &file,
            absent: &absent,
        };
        let joints = joints::changes(robot, said, self.holds);
        let mut change = WriteBack {
            links,
            joints,
            gravity,
            written: Vec::new(),
            residual: Vec::new(),
            dropped: Vec::new(),
            projection,
            lost: Vec::new(),
            correction: Vec::new(),
            lacks: Vec::new(),
            torque_error: Vec::new(),
        };
        let places = Places {
            chosen,
            whole: &whole,
            held: &held,
            beta,
            file: &file,
            shares: &shares,
        };
        self.measure(&mut change, &places)?;
        self.report(&mut change, &places);
        Ok(change)
    }

    /// Torque that the file has and lacks, by the robots before and after.
    fn measure(&self, change: &mut WriteBack, places: &Places<'_>) -> Result<()> {
        let (held, file, beta) = (places.held, places.file, places.beta);
        let robot = &self.calibration.twin.robot;
        let (states, whole_robot) = (&self.states, change.robot(robot)?);
        let (robots, joints) = ([robot, &whole_robot], &change.joints);
        change.lost = rms(&lost::difference(states, robots, joints, held, file));
        let alone = lost::held_alone(held, file);
        let linear = lost::beyond(states, robots, joints, held, &alone);
        change.dropped = dropped(robot, self.holds);
        let robots = [robot, &change.robot(robot)?];
        let without = lost::nominal_difference(states, [&whole_robot, robots[1]]);
        let in_file = InFile {
            held,
            coefficients: file,
            lost: &linear,
            dropped: &self.dropped_coefficients(&change.dropped, &without),
        };
        change.torque_error = self.torque_error(change, &in_file);
        let mut correction = states.torque(beta);
        states.add_products(&mut correction);
        change.correction = rms(&correction);
        let mut lacks = lost::beyond(states, robots, &change.joints, held, beta);
        states.add_products(&mut lacks);
        change.lacks = rms(&lacks);
        Ok(())
    }

    /// Places of columns that the data see and that are not `held`: what a file states there was not found.
    fn absent(&self, held: &[Option<Place>]) -> Vec<Place> {
        let components = &self.calibration.components;
        let judged = |column: usize| {
            let own = &components[self.component(column)];
            own.pip.is_some() && own.status != Status::Unidentifiable
        };
        let columns = held.iter().enumerate();
        let absent = columns.filter(|(column, place)| place.is_none() && judged(*column));
        absent
            .filter_map(|(column, _)| self.place(column))
            .collect()
    }

    /// Index of a column's component.
    fn component(&self, column: usize) -> usize {
        self.library.terms()[self.library.columns()[column]].component
    }

    /// Where a column's coefficient goes in a file of this format.
    fn place(&self, column: usize) -> Option<Place> {
        self.place_in(column, self.holds)
    }

    /// Where a column's coefficient goes in a file that holds this.
    fn place_in(&self, column: usize, holds: Holds) -> Option<Place> {
        let term = &self.library.terms()[self.library.columns()[column]];
        let joint = || {
            let names = self.calibration.twin.robot.joint_names();
            let component = &self.library.components()[term.component].name;
            let own = component
                .strip_suffix(term.family.word())?
                .strip_suffix('.')?;
            names.iter().position(|joint| *joint == own)
        };
        let more = holds.more;
        match (term.family, self.library.model_column(column)) {
            (_, Some(&ModelColumn::Inertia { body, weights })) => {
                Some(Place::Inertia { body, weights })
            }
            (Family::Viscous, _) => joint().map(Place::Viscous),
            (Family::Coulomb, _) => joint().map(Place::Coulomb),
            (Family::MotorInertia, _) if more => joint().map(Place::Armature),
            (Family::Spring, _) if more && term.name.ends_with(".stiffness") => {
                joint().map(Place::Stiffness)
            }
            (Family::Spring, _) if more => joint().map(Place::Preload),
            (_, Some(&ModelColumn::Gravity { axis })) if more => Some(Place::Gravity(axis)),
            _ => None,
        }
    }

    /// Says in words what went where.
    fn report(&self, change: &mut WriteBack, places: &Places<'_>) {
        for (index, component) in self.calibration.components.iter().enumerate() {
            let own: Vec<usize> = (0..places.beta.len())
                .filter(|&column| self.component(column) == index)
                .collect();
            let Some(pip) = component.pip.filter(|_| !own.is_empty()) else {
                continue;
            };
            if places.whole[index] {
                let written = self.written((component, pip), &own, places);
                change.written.push(written);
            } else {
                let (coefficients, reason) = self.beside((index, component), &own, places);
                let mut alone = vec![0.0; places.beta.len()];
                coefficients
                    .iter()
                    .for_each(|&(column, value)| alone[column] += value);
                change.residual.push(Residual {
                    component: component.name.clone(),
                    words: component.words.clone(),
                    pip,
                    reason,
                    torque: self.states.rms(&alone),
                    coefficients: coefficients
                        .iter()
                        .map(|&(column, value)| (self.name(column).to_owned(), value))
                        .collect(),
                });
            }
        }
        let size = |residual: &Residual| residual.torque.iter().fold(0.0_f64, |m, x| m.max(*x));
        change.residual.sort_by(|a, b| size(b).total_cmp(&size(a)));
    }

    /// A component that the file holds, of these columns.
    fn written(
        &self,
        (component, pip): (&ComponentSummary, f64),
        own: &[usize],
        places: &Places<'_>,
    ) -> Written {
        let (beta, file) = (places.beta, places.file);
        let place = own.iter().find_map(|&column| places.held[column].as_ref());
        let nearest = own.iter().find(|&&column| file[column] != beta[column]);
        let averaged = || match (place, own) {
            (Some(Place::Viscous(_) | Place::Coulomb(_) | Place::Armature(_)), &[column]) => {
                let reported = component.parameters.first()?.told().0;
                let far = (file[column] - reported).abs() > AS_TOLD * reported.abs();
                far.then_some(file[column])
            }
            _ => None,
        };
        Written {
            component: component.name.clone(),
            words: component.words.clone(),
            pip,
            in_file: nearest.map(|&column| file[column]).or_else(averaged),
            nearest: nearest.is_some(),
            place: self.place_name(place, component.family),
        }
    }

    /// Link or joint that changes with a component of that family.
    fn place_name(&self, place: Option<&Place>, family: Family) -> String {
        match place {
            Some(Place::Inertia { body, .. }) => {
                format!("link {}", links::home(self, *body, family))
            }
            Some(Place::Gravity(_)) | None => "gravity".into(),
            Some(
                Place::Viscous(joint)
                | Place::Coulomb(joint)
                | Place::Armature(joint)
                | Place::Stiffness(joint)
                | Place::Preload(joint),
            ) => {
                let robot = &self.calibration.twin.robot;
                format!("joint {}", robot.joint_names()[*joint])
            }
        }
    }

    /// Coefficients of a component that stay beside the file, by column, and why they do.
    fn beside(
        &self,
        (index, component): (usize, &ComponentSummary),
        own: &[usize],
        places: &Places<'_>,
    ) -> (Vec<(usize, f64)>, String) {
        let beside = linear_part::beside(own, places.beta, places.shares);
        let reason = if beside.len() > own.len() {
            let what = reason(component.family, self.holds.format);
            let shares: Vec<String> = (beside[own.len()..].iter())
                .map(|(column, value)| format!("{} {:+.3}", self.name(*column), -value))
                .collect();
            format!(
                "{what}; added to the file as nearest to it: {}",
                shares.join(", ")
            )
        } else if places.chosen[index] {
            reason(component.family, self.holds.format)
        } else {
            format!("it is {}, not established", component.status.word())
        };
        (beside, reason)
    }

    /// Name of a column's term.
    fn name(&self, column: usize) -> &str {
        &self.library.terms()[self.library.columns()[column]].name
    }
}

/// Where one coefficient goes.
#[derive(Debug, Clone, PartialEq)]
enum Place {
    /// Inertial parameters of a body, in its frame.
    Inertia {
        body: usize,
        weights: [f64; 10],
    },
    Viscous(usize),
    Coulomb(usize),
    Armature(usize),
    Stiffness(usize),
    Preload(usize),
    Gravity(usize),
}

impl WriteBack {
    /// The nominal robot with the change.
    ///
    /// # Errors
    /// Those of [`Robot::new`]: a changed number that is none.
    pub fn robot(&self, nominal: &Robot) -> Result<Robot> {
        let description = self.description(nominal.description());
        Robot::new(description, nominal.locked()).map(|(robot, _)| robot)
    }

    /// The nominal description with the change, without what the format cannot hold; dry friction has no place in it.
    #[must_use]
    pub fn description(&self, nominal: &RobotDescription) -> RobotDescription {
        let mut description = nominal.clone();
        for link in &mut description.links {
            if let Some(change) = self.links.iter().find(|change| change.link == link.name) {
                link.inertia = Some(change.after);
            }
        }
        for joint in &mut description.joints {
            if let Some(change) = self.joints.iter().find(|change| change.joint == joint.name) {
                change.apply(joint);
            }
            if self.dropped.iter().any(|own| own.joint == joint.name) {
                Dropped::apply(joint);
            }
        }
        description.gravity = self.gravity.unwrap_or(description.gravity);
        description
    }

    /// Whether the written file predicts torque worse than the user's on some joint: see [`JointTorqueError::worse`].
    #[must_use]
    pub fn is_worse(&self) -> bool {
        self.torque_error.iter().any(|own| own.worse().is_some())
    }
}

/// New gravity, where a column changes it.
fn gravity(robot: &Robot, held: &[Option<Place>], beta: &[f64]) -> Option<[f64; 3]> {
    let mut gravity = None;
    for (place, beta) in held.iter().zip(beta) {
        if let Some(Place::Gravity(axis)) = place {
            gravity.get_or_insert(robot.description().gravity)[*axis] += beta;
        }
    }
    gravity
}

/// Why a family has no place in a format.
fn reason(family: Family, format: &str) -> String {
    let what = match family {
        Family::User | Family::Generic => "energy terms",
        Family::Offset => "a constant torque",
        Family::MotorInertia => "motor inertia",
        Family::Tilt => "gravity",
        Family::Spring => "springs",
        Family::Potential => "potentials of a joint",
        Family::Asymmetry => "friction that depends on direction",
        Family::Stribeck => "friction that changes with speed",
        Family::QuadraticFriction => "friction that is not in proportion to the speed",
        Family::LoadFriction => "friction that grows with the load",
        Family::CoupledFriction => "friction of coupled motors",
        Family::CoupledInertia => "inertia of coupled motors",
        Family::Gain => "torque gains",
        Family::EncoderZero => "encoder zeros",
        Family::Ripple => "gear ripple",
        Family::Hysteresis => "friction with hysteresis",
        Family::WarmUp => "friction that changes with warmth",
        Family::Viscous
        | Family::Coulomb
        | Family::Payload
        | Family::PayloadTensor
        | Family::MassMoments
        | Family::Tensor
        | Family::Density => "this",
    };
    let article = if format.starts_with('M') { "an" } else { "a" };
    format!("{article} {format} cannot hold {what}")
}
