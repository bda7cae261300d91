//! Torque that no rigid body and no friction explains, far beyond what they leave otherwise, for a short time: contacts.
//!
//! What is left is measured by its median size ([`rigid_fit`](crate::rigid_fit)), which a push of a quarter of the log does not move, and
//! by the joint's Coulomb friction, which is what a wrong friction law can be off by: where a joint slides a share of it, at a
//! velocity reversal and at rest, where friction is anything between plus and minus its static value, several times that. What
//! comes again where the robot is in the same state is the model's error, what the motion's own spike explains is a position glitch.

use super::incident::{Incident, IncidentKind};
use super::repeats::{Peak, repeats};
use crate::rigid_fit::{Bins, Design, Settled, Zone, mad, settle};
use crate::robot::Robot;
use std::ops::Range;

/// A contact leaves at least this many robust standard deviations of what is left where the joint slides.
const SPREADS: f64 = 10.0;
/// Shares of the joint's Coulomb friction that it reaches at least: where the joint slides, and at reversals and at rest. There a
/// friction that turns over is wrong by twice its size.
const SLIDING: f64 = 0.8;
const REVERSING: f64 = 3.0;
/// The same in standard deviations of what reversals leave.
const REVERSING_SPREADS: f64 = 3.0;
/// Share of the torque's own standard deviation that it reaches at least.
const MATTERS: f64 = 0.2;
/// What lasts for no more than these bins is this many times as large.
const SHORT: usize = 3;
const SHORT_TIMES: f64 = 2.0;
/// A contact begins and ends at this share of its peak, or at this many standard deviations.
const FOOT: f64 = 0.4;
const FOOT_SPREADS: f64 = 3.0;
/// Longest time that contacts are joined over, s.
const JOINED: f64 = 0.25;
/// Bins up to which an incident may be a glitch of position, and the share of it that torque itself shows if it is none.
const GLITCH: usize = 6;
const SHOWN: f64 = 0.5;
/// Fewest bins of a log, and fewest in which a joint moves.
const FEWEST: usize = 60;
const MOVING: usize = 30;
/// Contacts of a log that are always few enough, and bins per contact beyond those: what happens more often is noise with heavy tails, which
/// has its own finding. Share of the log that contacts take at most: what lasts longer is another robot than the model's.
const FEW: usize = 6;
const RARE: usize = 100;
const LONGEST: f64 = 0.5;

/// Contacts of all joints; those that overlap are one, of the joint in which it is largest.
pub(super) fn contacts(robot: &Robot, bins: &[Bins]) -> Vec<Incident> {
    let all: usize = bins.iter().map(Bins::len).sum();
    if all < FEWEST {
        return Vec::new();
    }
    let Some(mut left) = Left::new(robot, bins) else {
        return Vec::new();
    };
    let mut candidates: Vec<Candidate> = Vec::new();
    for joint in 0..robot.dof() {
        candidates.extend(left.candidates(bins, joint));
    }
    let peaks: Vec<Peak> = candidates.iter().map(|c| c.peak.clone()).collect();
    let again = repeats(robot.dof(), bins, &left.torque, &peaks);
    let mut again = again.into_iter();
    candidates.retain(|_| !again.next().unwrap_or(false));
    left.torque.clear();
    let interval = bins.first().map_or(1.0, |bins| bins.intervals[1]);
    let merged = merge(robot, bins, candidates, interval);
    let taken: f64 = merged.iter().map(|i| i.span[1] - i.span[0]).sum();
    let whole: f64 = bins
        .iter()
        .flat_map(|b| &b.spans)
        .map(|s| s[1] - s[0])
        .sum();
    let many = merged.len() > FEW && merged.len() * RARE > all;
    if many || taken > LONGEST * whole {
        return Vec::new();
    }
    merged
}

/// One incident for candidates that overlap or nearly do.
fn merge(robot: &Robot, bins: &[Bins], candidates: Vec<Candidate>, interval: f64) -> Vec<Incident> {
    let names = robot.joint_names();
    let mut found: Vec<(f64, Incident)> = candidates
        .into_iter()
        .map(|candidate| {
            let Candidate {
                peak,
                times,
                torque,
            } = candidate;
            let spans = &bins[peak.segment].spans;
            let span = [spans[peak.bins.start][0], spans[peak.bins.end - 1][1]];
            let incident = Incident {
                kind: IncidentKind::Contact,
                joint: names[peak.joint].to_owned(),
                span,
                torque,
                samples: peak.bins.len() as u64 * bins[peak.segment].width,
            };
            (times, incident)
        })
        .collect();
    found.sort_by(|a, b| a.1.span[0].total_cmp(&b.1.span[0]));
    let mut merged: Vec<(f64, Incident)> = Vec::new();
    for (times, incident) in found {
        match merged.last_mut() {
            Some((most, last)) if incident.span[0] - last.span[1] <= JOINED => {
                let span = [last.span[0], last.span[1].max(incident.span[1])];
                if times > *most {
                    (*most, *last) = (times, incident);
                }
                last.span = span;
                last.samples = ((span[1] - span[0]) / interval).round() as u64 + 1;
            }
            _ => merged.push((times, incident)),
        }
    }
    merged.into_iter().map(|(_, incident)| incident).collect()
}

/// A stretch of one joint that may be a contact.
struct Candidate {
    peak: Peak,
    /// How many times its threshold the peak reaches.
    times: f64,
    /// Torque at the peak, N·m or N.
    torque: f64,
}

/// What rigid bodies and friction leave of the torque of every joint.
struct Left {
    /// By joint, then per segment and bin.
    torque: Vec<Vec<Vec<f64>>>,
    /// Robust standard deviations by joint: sliding, reversing, at rest.
    spread: Vec<[f64; 3]>,
    /// Coulomb friction by joint.
    coulomb: Vec<f64>,
    /// Standard deviation of the torque by joint.
    sd: Vec<f64>,
}

impl Left {
    fn new(robot: &Robot, bins: &[Bins]) -> Option<Self> {
        let Settled {
            robot,
            parts,
            design,
            solution,
        } = settle(robot, bins)?;
        let theta = &solution.theta;
        let dof = robot.dof();
        let coulomb = (0..dof).map(|joint| {
            let read = design.coulomb(joint, theta);
            read.max(solution.spread[joint][1])
        });
        let coulomb = coulomb.collect();
        let sd = design.joints.iter().map(|rows| {
            let mean = rows.torque.iter().sum::<f64>() / rows.torque.len() as f64;
            mad(rows.torque.iter().map(|tau| tau - mean).collect())
        });
        let sd = sd.collect();
        let whole = parts
            .iter()
            .all(|(segment, range)| *range == (0..bins[*segment].len()));
        let mut torque: Vec<Vec<Vec<f64>>> = vec![Vec::with_capacity(bins.len()); dof];
        if whole {
            put(&mut torque, bins, &design.residual(theta));
        } else {
            drop(design);
            for (segment, own) in bins.iter().enumerate() {
                let mut joints: Vec<Vec<f64>> = vec![Vec::with_capacity(own.len()); dof];
                let mut from = 0;
                while from < own.len() {
                    let range = from..own.len().min(from + 1024);
                    let rows = Design::new(&robot, bins, &[(segment, range.clone())]);
                    for (all, more) in joints.iter_mut().zip(rows.residual(theta)) {
                        all.extend(more);
                    }
                    from = range.end;
                }
                torque
                    .iter_mut()
                    .zip(joints)
                    .for_each(|(all, own)| all.push(own));
            }
        }
        Some(Self {
            torque,
            spread: solution.spread,
            coulomb,
            sd,
        })
    }

    /// What a contact of a joint exceeds in a bin.
    fn threshold(&self, joint: usize, zone: Zone) -> f64 {
        let ([slides, reverses, _], coulomb) = (self.spread[joint], self.coulomb[joint]);
        let least = (SPREADS * slides)
            .max(SLIDING * coulomb)
            .max(MATTERS * self.sd[joint]);
        match zone {
            Zone::Slides => least,
            Zone::Reverses | Zone::Rests => least
                .max(REVERSING * coulomb)
                .max(REVERSING_SPREADS * reverses),
            Zone::Unknown => f64::INFINITY,
        }
    }

    /// Stretches of a joint that exceed the threshold, largest first; none where there are too many of them.
    fn candidates(&self, bins: &[Bins], joint: usize) -> Vec<Candidate> {
        let moves = |bins: &Bins| {
            let zones = bins.zones(joint).iter();
            zones
                .filter(|zone| matches!(zone, Zone::Slides | Zone::Reverses))
                .count()
        };
        if bins.iter().map(moves).sum::<usize>() < MOVING {
            return Vec::new();
        }
        let mut found = Vec::new();
        for (segment, own) in bins.iter().enumerate() {
            let left = &self.torque[joint][segment];
            let thresholds = own.zones(joint).iter().map(|z| self.threshold(joint, *z));
            let times: Vec<f64> = left
                .iter()
                .zip(thresholds)
                .map(|(t, least)| t.abs() / least)
                .collect();
            let mut beyond: Vec<usize> = (0..times.len()).filter(|&i| times[i] > 1.0).collect();
            beyond.sort_by(|a, b| times[*b].total_cmp(&times[*a]));
            let mut taken = vec![false; times.len()];
            for at in beyond {
                if taken[at] {
                    continue;
                }
                let range = self.stretch(left, joint, at);
                taken[range.clone()].fill(true);
                let short = range.len() <= SHORT && times[at] < SHORT_TIMES;
                if short || self.is_glitch(bins, (joint, segment), &range, at) {
                    continue;
                }
                found.push(Candidate {
                    peak: Peak {
                        joint,
                        segment,
                        bin: at,
                        bins: range,
                    },
                    times: times[at],
                    torque: left[at].abs(),
                });
            }
        }
        found
    }

    /// Bins about a peak that are beyond its foot on the same side.
    fn stretch(&self, left: &[f64], joint: usize, at: usize) -> Range<usize> {
        let foot = (FOOT * left[at].abs()).max(FOOT_SPREADS * self.spread[joint][0]);
        let inside = |i: &usize| left[*i] * left[at].signum() > foot;
        let from = (0..at).rev().take_while(inside).last().unwrap_or(at);
        let to = (at + 1..left.len()).take_while(inside).last().unwrap_or(at);
        from..to + 1
    }

    /// Whether torque itself shows hardly anything of a short incident, and the motion's own acceleration all of it.
    fn is_glitch(
        &self,
        bins: &[Bins],
        (joint, segment): (usize, usize),
        range: &Range<usize>,
        at: usize,
    ) -> bool {
        let own = &bins[segment];
        if range.len() > GLITCH || range.start == 0 || range.end >= own.len() {
            return false;
        }
        let around = range.start - 1..range.end + 1;
        let channels = own.joint(joint, &around);
        let measured = channels.torque();
        let left = &self.torque[joint][segment][around.clone()];
        let explained: Vec<f64> = measured
            .iter()
            .zip(left)
            .map(|(tau, left)| tau - left)
            .collect();
        let beyond_line = |values: &[f64]| {
            let (first, last) = (values[0], values[values.len() - 1]);
            let step = (last - first) / (values.len() - 1) as f64;
            let lines = values.iter().enumerate();
            lines
                .map(|(i, value)| (value - first - step * i as f64).abs())
                .fold(0.0, f64::max)
        };
        let size = self.torque[joint][segment][at].abs();
        beyond_line(measured) < SHOWN * size && beyond_line(&explained) > SHOWN * size
    }
}

/// Puts residuals of whole segments, which stand one behind the other, into their segments.
fn put(torque: &mut [Vec<Vec<f64>>], bins: &[Bins], residual: &[Vec<f64>]) {
    for (all, left) in torque.iter_mut().zip(residual) {
        let mut from = 0;
        for own in bins {
            all.push(left[from..from + own.len()].to_vec());
            from += own.len();
        }
    }
}
