//! Whether what is left of a torque comes again when the robot is in the same state: then it is the model's error, not a contact.

use crate::linear_algebra::dot;
use crate::rigid_fit::Bins;
use std::ops::Range;

/// Distance of states that are the same, in standard deviations of each position and velocity: bins of two cycles are up to half a bin apart.
const SAME: f64 = 0.35;
/// Bins apart below which two states are one pass, and passes that are looked at.
const PASS: usize = 10;
const PASSES: usize = 5;
/// Share of a peak that comes again in most passes if it repeats.
const SHARE: f64 = 0.5;
/// Peaks that are looked at, largest first come first.
const PEAKS: usize = 256;
/// Bins that are read at once.
const BLOCK: usize = 1024;

/// Where a joint's residual is largest.
#[derive(Debug, Clone)]
pub(super) struct Peak {
    pub(super) joint: usize,
    pub(super) segment: usize,
    pub(super) bin: usize,
    /// The whole stretch.
    pub(super) bins: Range<usize>,
}

/// Another pass through the state of a peak.
#[derive(Clone, Copy)]
struct Pass {
    place: (usize, usize),
    distance: f64,
    /// Torque that is left there, on the side of the peak.
    left: f64,
}

/// For each peak whether it comes again; `left`: by joint, segment and bin. More than [`PEAKS`] peaks are not looked at: so many are no contacts.
pub(super) fn repeats(
    dof: usize,
    bins: &[Bins],
    left: &[Vec<Vec<f64>>],
    peaks: &[Peak],
) -> Vec<bool> {
    if peaks.is_empty() || peaks.len() > PEAKS {
        return vec![false; peaks.len()];
    }
    let states: Vec<Vec<f64>> = peaks
        .iter()
        .map(|peak| state(dof, &bins[peak.segment], &(peak.bin..peak.bin + 1)).concat())
        .collect();
    let scale = scales(dof, bins);
    let mut passes: Vec<Vec<Pass>> = vec![Vec::new(); peaks.len()];
    for (segment, own) in bins.iter().enumerate() {
        let mut from = 0;
        while from < own.len() {
            let range = from..own.len().min(from + BLOCK);
            let channels = state(dof, own, &range);
            for ((peak, at), passes) in peaks.iter().zip(&states).zip(&mut passes) {
                for bin in range.clone() {
                    let row = bin - range.start;
                    let velocity = dof + peak.joint;
                    let turned = channels[velocity][row] * at[velocity] < 0.0;
                    let own_pass = segment == peak.segment
                        && bin + PASS > peak.bins.start
                        && bin < peak.bins.end + PASS;
                    if own_pass || turned {
                        continue;
                    }
                    let distance = distance(&channels, row, at, &scale);
                    if distance < SAME {
                        let side = left[peak.joint][peak.segment][peak.bin].signum();
                        let place = (segment, bin);
                        let left = largest(&left[peak.joint][segment], bin, side);
                        note(
                            passes,
                            Pass {
                                place,
                                distance,
                                left,
                            },
                        );
                    }
                }
            }
            from = range.end;
        }
    }
    let size = |peak: &Peak| left[peak.joint][peak.segment][peak.bin].abs();
    let looked_at = peaks.iter().zip(passes);
    looked_at
        .map(|(peak, passes)| most_alike(passes, size(peak)))
        .collect()
}

/// Whether most of the nearest passes show a share of a peak of this size.
fn most_alike(mut passes: Vec<Pass>, size: f64) -> bool {
    passes.sort_by(|a, b| a.distance.total_cmp(&b.distance));
    passes.truncate(PASSES);
    let alike = passes
        .iter()
        .filter(|pass| pass.left > SHARE * size)
        .count();
    2 * alike > passes.len()
}

/// Positions, then velocities of all joints.
fn state(dof: usize, bins: &Bins, range: &Range<usize>) -> Vec<Vec<f64>> {
    let joints: Vec<_> = (0..dof).map(|joint| bins.joint(joint, range)).collect();
    let q = joints.iter().map(|joint| joint.position().to_vec());
    let qd = joints.iter().map(|joint| joint.velocity().to_vec());
    q.chain(qd).collect()
}

/// Standard deviation of each channel in the longest segment.
fn scales(dof: usize, bins: &[Bins]) -> Vec<f64> {
    let longest = bins.iter().max_by_key(|bins| bins.len());
    let channels = longest.map_or_else(Vec::new, |bins| {
        state(dof, bins, &(0..bins.len().min(64 * BLOCK)))
    });
    let sd = |values: &Vec<f64>| {
        let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
        let apart: Vec<f64> = values.iter().map(|x| x - mean).collect();
        mean_square(&apart).sqrt().max(1e-6)
    };
    channels.iter().map(sd).collect()
}

/// Root mean square over the channels of what two states differ by.
fn distance(channels: &[Vec<f64>], row: usize, at: &[f64], scale: &[f64]) -> f64 {
    let mut sum = 0.0;
    for ((channel, at), scale) in channels.iter().zip(at).zip(scale) {
        let apart = (channel[row] - at) / scale;
        sum += apart * apart;
    }
    (sum / channels.len() as f64).sqrt()
}

/// What is left in a bin or its neighbours, on one side.
fn largest(left: &[f64], bin: usize, side: f64) -> f64 {
    let around = bin.saturating_sub(1)..left.len().min(bin + 2);
    let sided = left[around].iter().map(|left| side * left);
    sided.fold(f64::NEG_INFINITY, f64::max)
}

/// Keeps the nearest bin of each pass.
fn note(passes: &mut Vec<Pass>, pass: Pass) {
    match passes.last_mut() {
        Some(last) if last.place.0 == pass.place.0 && pass.place.1 - last.place.1 <= PASS => {
            if pass.distance < last.distance {
                *last = pass;
            }
        }
        _ => passes.push(pass),
    }
}

/// Mean square of some numbers.
fn mean_square(values: &[f64]) -> f64 {
    dot(values, values) / values.len().max(1) as f64
}
