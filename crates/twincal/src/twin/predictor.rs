//! Torque with intervals for blocks of evaluated rows: the mixture over models, prepared once per joint.

use super::components::Components;
use super::consistency::check;
use super::kernel::{Bands, Constants, Group, Scratch};
use super::{JointTorque, TorqueSignal};
use crate::error::Result;
use crate::lanes::{LANES, Lane};
use crate::likelihood::{JointNoise, Spread};
use crate::posterior::Posterior;
use crate::posterior::mixture::Level;
use crate::posterior::student::StudentT;
use crate::rows::{JointRows, RowBlock};
use rayon::prelude::*;

/// Rows of one joint, ready to be predicted: its columns and nominal torque, low-passed like the training rows.
#[derive(Debug, Clone, Copy)]
pub struct JointInput<'a> {
    /// Columns, `x[i * stride + row]` for the i-th column of the joint (ascending), N·m per unit of β.
    pub x: &'a [f64],
    /// Distance between columns in `x`, at least the number of rows.
    pub stride: usize,
    /// Nominal torque per row, N·m; its length is the number of rows.
    pub nominal: &'a [f64],
    /// Torque beside it that no coefficient moves; empty where there is none.
    pub products: &'a [f64],
    /// Measured torque per row, N·m, for `pit`; empty if there is none.
    pub measured: &'a [f64],
    /// Rows where the joint stands still; empty if none does.
    pub standstill: &'a [bool],
    /// Position, velocity and acceleration per row, for `extrapolating`; empty slices if unknown.
    pub motion: [&'a [f64]; 3],
}

impl<'a> JointInput<'a> {
    /// The rows of `joint` in a block.
    #[must_use]
    pub fn of_block(block: &RowBlock<'a>, joint: usize) -> Self {
        let JointRows {
            x,
            stride,
            nominal,
            products,
            measured,
            standstill,
            ..
        } = block.joints[joint];
        let own = joint * block.len..(joint + 1) * block.len;
        let motion = [
            &block.q[own.clone()],
            &block.qd[own.clone()],
            &block.qdd[own],
        ];
        Self {
            x,
            stride,
            nominal,
            products,
            measured,
            standstill,
            motion,
        }
    }
}

/// What one joint needs.
#[derive(Debug, Clone)]
struct Joint {
    columns: Vec<usize>,
    /// E[β | y] of those columns.
    mean: Vec<f64>,
    components: Components,
    /// `f²/(w_j (1−ρ_j²))`.
    noise_factor: f64,
    out_of_band: f64,
    spread: Spread,
    /// Rows that count as one: τ_j, with ar1 (1+ρ)/(1−ρ).
    memory: f64,
    /// |E[β]| of the joint's Coulomb friction, N·m; 0 if it is no candidate.
    coulomb: f64,
    /// `[q_min, q_max, qd_min, qd_max, qdd_min, qdd_max]`, already widened by the margin.
    hull: [f64; 6],
}

/// Everything that predictions share, worked out once from a posterior; cheap to use from many threads.
#[derive(Debug, Clone)]
pub struct Predictor {
    student: StudentT,
    levels: [Level; 2],
    shape: f64,
    /// E[φ | y].
    noise: f64,
    joints: Vec<Joint>,
}

/// How a joint enters a [`Predictor`].
#[derive(Debug, Clone, Copy)]
pub struct JointSetting<'a> {
    /// Columns of the library that are structurally non-zero on this joint, ascending.
    pub columns: &'a [usize],
    /// The joint's Coulomb column, if it is a candidate.
    pub coulomb: Option<usize>,
    /// Its noise.
    pub noise: &'a JointNoise,
    /// Range of its training motion, see [`super::Twin::hull`].
    pub hull: [f64; 6],
}

/// Share of the training range by which motion may leave it before it counts as extrapolation.
const HULL_MARGIN: f64 = 0.05;
/// Rows per parallel task.
const TASK: usize = 512;

impl Predictor {
    /// Prepares the mixtures of all joints.
    ///
    /// # Errors
    /// [`crate::Error::Setting`] with the key `twin` if posterior, noise and columns do not fit each other (a damaged file).
    pub fn new(posterior: &Posterior, joints: &[JointSetting<'_>]) -> Result<Self> {
        check(posterior, joints)?;
        let student = StudentT::new(2.0 * posterior.shape);
        let levels = Level::central(&student, 0.95);
        let joints = joints
            .iter()
            .map(|joint| Joint {
                columns: joint.columns.to_vec(),
                mean: joint.columns.iter().map(|&k| posterior.mean[k]).collect(),
                components: Components::of_joint(posterior, joint.columns),
                noise_factor: joint.noise.interval_factor.powi(2)
                    / (joint.noise.weight * (1.0 - joint.noise.rho * joint.noise.rho)),
                out_of_band: joint.noise.out_of_band.powi(2),
                spread: joint.noise.spread.clone(),
                memory: joint.noise.memory(),
                coulomb: joint.coulomb.map_or(0.0, |k| posterior.mean[k].abs()),
                hull: widened(joint.hull),
            })
            .collect();
        Ok(Self {
            student,
            levels,
            shape: posterior.shape,
            noise: posterior.noise,
            joints,
        })
    }

    /// Number of joints.
    #[must_use]
    pub fn dof(&self) -> usize {
        self.joints.len()
    }

    /// Columns that `input.x` must hold for `joint`, ascending.
    #[must_use]
    pub fn columns(&self, joint: usize) -> &[usize] {
        &self.joints[joint].columns
    }

    /// Rows of `joint` that count as one independent row, at least 1.
    #[must_use]
    pub fn memory(&self, joint: usize) -> f64 {
        self.joints[joint].memory
    }

    /// [`Predictor::torque`] of every joint of a block.
    ///
    /// # Panics
    /// If the block's columns are not those of this predictor.
    #[must_use]
    pub fn block(&self, block: &RowBlock<'_>, signal: TorqueSignal) -> Vec<JointTorque> {
        let joints: Vec<usize> = (0..self.joints.len()).collect();
        let predict = |joint: usize| {
            assert_eq!(
                block.joints[joint].columns,
                self.columns(joint),
                "columns of joint {joint}"
            );
            self.torque(joint, &JointInput::of_block(block, joint), signal)
        };
        joints.into_par_iter().map(predict).collect()
    }

    /// Torque of `joint` over a block of rows, with the central 95 % interval of the mixture over models.
    ///
    /// ```text
    /// tau | z, y ~ t_{2 a_n}( tau_nom + products + xᵀμ_z,  (b_n/a_n) (f²/(w_j(1−ρ_j²)) + xᵀA_z⁻¹x) [+ s_out²] ),  mixed over z
    /// calibrated = tau_nom + products + xᵀE[β | y]
    /// ```
    /// f is the joint's interval factor; where noise changes with speed or load, f² is multiplied by g(|q̇|) h(|τ_nom|). For [`TorqueSignal::Raw`] the variance s_out² of the torque outside the filter's
    /// band is added to scale² as it is: it was measured directly, φ does not multiply it. While a joint stands still,
    /// stiction holds any torque within ± its Coulomb coefficient: the interval is widened by that much on both sides.
    ///
    /// Results do not depend on how rows are cut into blocks nor on the number of threads.
    ///
    /// # Panics
    /// If the slices of `input` do not fit each other or the joint's columns.
    #[must_use]
    pub fn torque(
        &self,
        joint: usize,
        input: &JointInput<'_>,
        signal: TorqueSignal,
    ) -> JointTorque {
        let rows = input.nominal.len();
        let own = &self.joints[joint];
        assert!(
            input.stride >= rows,
            "stride {} below {rows} rows",
            input.stride
        );
        if let Some(last) = own.columns.len().checked_sub(1) {
            assert!(
                input.x.len() >= last * input.stride + rows,
                "columns of joint {joint} are cut off"
            );
        }
        for length in [
            input.measured.len(),
            input.products.len(),
            input.standstill.len(),
            input.motion[0].len(),
        ] {
            assert!(
                length == 0 || length == rows,
                "{length} values for {rows} rows"
            );
        }
        let constants = Constants {
            student: &self.student,
            levels: self.levels,
            joint: &own.components,
            noise_factor: own.noise_factor,
            out_of_band: if signal == TorqueSignal::Raw {
                own.out_of_band
            } else {
                0.0
            },
            mean_over_rate: if self.shape > 1.0 {
                self.shape / (self.shape - 1.0)
            } else {
                f64::INFINITY
            },
        };
        let tasks: Vec<usize> = (0..rows).step_by(TASK).collect();
        let parts: Vec<JointTorque> = tasks
            .into_par_iter()
            .map(|start| self.task(own, &constants, input, start..(start + TASK).min(rows)))
            .collect();
        let mut torque = JointTorque::default();
        for part in parts {
            torque.append(part);
        }
        torque
    }

    fn task(
        &self,
        joint: &Joint,
        constants: &Constants<'_>,
        input: &JointInput<'_>,
        rows: std::ops::Range<usize>,
    ) -> JointTorque {
        let arch = pulp::Arch::new();
        let mut scratch = Scratch::default();
        let mut torque = JointTorque::default();
        let mut x: Vec<Lane> = vec![[0.0; LANES]; joint.columns.len()];
        let noise = |spread: f64| self.noise * joint.noise_factor * spread + constants.out_of_band;
        for start in rows.clone().step_by(LANES) {
            let count = LANES.min(rows.end - start);
            // A last group that is not full repeats its last row.
            let row_of = |lane: usize| start + lane.min(count - 1);
            let mut correction = [0.0; LANES];
            for (i, column) in x.iter_mut().enumerate() {
                for lane in 0..LANES {
                    column[lane] = input.x[i * input.stride + row_of(lane)];
                    correction[lane] += joint.mean[i] * column[lane];
                }
            }
            let band: Lane = std::array::from_fn(|lane| joint.stiction(input, row_of(lane)));
            let spread: Lane = std::array::from_fn(|lane| joint.spread(input, row_of(lane)));
            let constant =
                |row: usize| input.nominal[row] + input.products.get(row).copied().unwrap_or(0.0);
            let residual: Option<Lane> = (!input.measured.is_empty()).then(|| {
                std::array::from_fn(|lane| input.measured[row_of(lane)] - constant(row_of(lane)))
            });
            let bands: Bands = arch.dispatch(Group {
                constants,
                scratch: &mut scratch,
                x: &x,
                residual: residual.as_ref(),
                spread: &spread,
                band: &band,
            });
            for lane in 0..count {
                let row = start + lane;
                let constant = constant(row);
                torque.nominal.push(input.nominal[row]);
                torque.calibrated.push(constant + correction[lane]);
                torque.low.push(constant + bands.low[lane]);
                torque.high.push(constant + bands.high[lane]);
                torque.epistemic.push(bands.epistemic[lane].sqrt());
                let noise = noise(spread[lane]);
                torque.noise.push(noise.sqrt());
                let new_motion = joint.leaves_hull(input, row);
                torque.new_motion.push(new_motion);
                (torque.extrapolating).push(new_motion || bands.epistemic[lane] > noise);
                if residual.is_some() {
                    torque.pit.push(bands.pit[lane]);
                    torque.log_density.push(bands.density[lane].ln());
                }
            }
        }
        torque
    }
}

impl Joint {
    /// Relative noise variance of a row; 1 where the motion is unknown.
    fn spread(&self, input: &JointInput<'_>, row: usize) -> f64 {
        let velocity = input.motion[1].get(row);
        velocity.map_or(1.0, |v| self.spread.at(*v, input.nominal[row]))
    }

    /// Torque that stiction holds either way in a row, N·m; 0 where the joint moves.
    fn stiction(&self, input: &JointInput<'_>, row: usize) -> f64 {
        if input.standstill.get(row).copied().unwrap_or(false) {
            self.coulomb
        } else {
            0.0
        }
    }

    fn leaves_hull(&self, input: &JointInput<'_>, row: usize) -> bool {
        (0..3).any(|k| {
            let value = input.motion[k].get(row);
            value.is_some_and(|&value| value < self.hull[2 * k] || value > self.hull[2 * k + 1])
        })
    }
}

pub(super) fn widened(hull: [f64; 6]) -> [f64; 6] {
    let mut wide = hull;
    for k in 0..3 {
        let margin = HULL_MARGIN * (hull[2 * k + 1] - hull[2 * k]);
        wide[2 * k] -= margin;
        wide[2 * k + 1] += margin;
    }
    wide
}
