//! What any rigid body and friction explain of measured torque, whatever else is in the log: for contacts and for lags.
//!
//! ```text
//! τ_j = τ_nominal,j + Σ_b Y_jb Δπ_b + f_j(q̇_j, q̈_j, q_j) + r_j        f: seven columns for each joint
//! ```
//! All inertial parameters are free about the nominal ones, with a weak prior of one mean link, so that a payload or a wrong link
//! is no residual. Averages over bins of a twentieth of a second; robust against stretches that do not fit
//! ([`robust`](self::robust)). Friction is only trusted away from a velocity reversal ([`Zone`]).

mod bins;
mod design;
mod lean;
mod robust;

pub(crate) use bins::{Bins, Zone, bins};
pub(crate) use design::{Design, JointRows, prior, sample};
pub(crate) use lean::{Fit, Settled, about_lean, leaning, settle};
pub(crate) use robust::{Normal, mad};

#[cfg(test)]
mod tests;
