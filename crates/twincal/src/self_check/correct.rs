//! The reading of the log that model and friction explain best: signs turned, joints exchanged.

use super::explain::{Explained, Reading, explain};
use super::sample::Sample;
use crate::robot::Robot;
use rayon::prelude::*;

/// Share of torque left beyond which it is worth looking for another reading.
const DOUBTFUL: f64 = 0.1;
/// Share left beyond which a joint counts as unexplained, and below which as explained.
const BAD: f64 = 0.4;
const GOOD: f64 = 0.2;
/// Least gain in Σ ln(share left) where a joint was unexplained: e² ≈ 7 times less in all.
const LEAST_GAIN: f64 = 2.0;
/// Least gain where every joint was explained somehow: e⁶ ≈ 400 times less.
const GREAT_GAIN: f64 = 6.0;
/// A joint may not get worse by more than this factor, unless it stays explained.
const WORSE: f64 = 1.5;
/// Share of torque by which a joint may be explained less and still counts as explained alike: half of the last digit that is shown.
const ALIKE: f64 = 0.005;
/// The same where only the free factor makes the difference: on a joint that friction rules it fits an unknown payload as well as it can.
const BY_FACTOR: f64 = 0.03;
/// Shares below this are alike.
const FLOOR: f64 = 1e-3;
/// Least gain of a single step on the way.
const LEAST_STEP: f64 = 1.0;
/// By how much a step that changes more must be better than one that changes less.
const PREFERENCE: f64 = 0.3;

/// One change of a reading, ordered by how much it changes.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Step {
    TurnTorque(usize),
    TurnPosition(usize),
    TurnRates(usize),
    TurnMotion(usize),
    TurnBoth(usize),
    SwapTorque(usize, usize),
    SwapBoth(usize, usize),
    SwapMotion(usize, usize),
}

impl Step {
    fn all(dof: usize) -> Vec<Self> {
        let joints = || 0..dof;
        let pairs = || joints().flat_map(move |a| (a + 1..dof).map(move |b| (a, b)));
        let mut steps: Vec<Self> = joints().map(Self::TurnTorque).collect();
        steps.extend(joints().map(Self::TurnMotion));
        steps.extend(joints().map(Self::TurnBoth));
        steps.extend(pairs().map(|(a, b)| Self::SwapBoth(a, b)));
        steps.extend(pairs().map(|(a, b)| Self::SwapTorque(a, b)));
        steps.extend(pairs().map(|(a, b)| Self::SwapMotion(a, b)));
        steps
    }

    fn apply(self, reading: &Reading) -> Reading {
        let mut new = reading.clone();
        match self {
            Self::TurnTorque(j) => new.torque[j].1 *= -1.0,
            Self::TurnPosition(j) => new.motion[j].1 *= -1.0,
            Self::TurnRates(j) => new.rates[j] *= -1.0,
            Self::TurnMotion(j) => {
                new.motion[j].1 *= -1.0;
                new.rates[j] *= -1.0;
            }
            Self::TurnBoth(j) => {
                new.motion[j].1 *= -1.0;
                new.rates[j] *= -1.0;
                new.torque[j].1 *= -1.0;
            }
            Self::SwapTorque(a, b) => new.torque.swap(a, b),
            Self::SwapMotion(a, b) => {
                new.motion.swap(a, b);
                new.rates.swap(a, b);
            }
            Self::SwapBoth(a, b) => {
                new.motion.swap(a, b);
                new.rates.swap(a, b);
                new.torque.swap(a, b);
            }
        }
        new
    }
}

/// Share left as which a torque counts that the model makes larger.
const AGAINST: f64 = 2.0;

/// By which share that is left a reading is judged: with a free factor at the model's torque, or with the model as it is. Friction and
/// motor inertia explain much of the torque of a wrong joint too where the model's may be left out; a model that is wrong in its masses
/// is told by the first alone. A torque that the model only adds to counts as unexplained, and twice at most ([`AGAINST`]): to make the model's
/// smaller is no gain.
type Left = fn(&Explained) -> f64;
const LEFT: [Left; 2] = [
    |joint| joint.left,
    |joint| joint.left_as_modelled.min(AGAINST),
];

/// True where a joint's torque is not well explained, so that it is worth looking for another reading.
fn doubtful(joints: &[Option<Explained>], left: Left) -> bool {
    joints.iter().flatten().any(|joint| left(joint) > DOUBTFUL)
}

/// True where any joint's torque is not well explained, by either measure.
pub(super) fn is_doubtful(joints: &[Option<Explained>]) -> bool {
    LEFT.into_iter().any(|left| doubtful(joints, left))
}

/// Σ ln(share left) before less after, with a free factor at the model's torque.
pub(super) fn gain_of(before: &[Option<Explained>], after: &[Option<Explained>]) -> f64 {
    gain(before, after, LEFT[0])
}

/// Σ ln(share left) before less after.
fn gain(before: &[Option<Explained>], after: &[Option<Explained>], left: Left) -> f64 {
    let both = before.iter().flatten().zip(after.iter().flatten());
    both.map(|(b, a)| (left(b).max(FLOOR) / left(a).max(FLOOR)).ln())
        .sum()
}

/// True if no joint's torque is explained less than before: no reading is proposed that does. Less is what the model leaves both with a free factor
/// and as it is, or with a free factor by far.
pub(super) fn none_less(before: &[Option<Explained>], after: &[Option<Explained>]) -> bool {
    let mut joints = before.iter().zip(after);
    joints.all(|joint| match joint {
        (Some(before), Some(after)) => {
            let less = |by: f64, left: Left| left(after) > left(before) + by;
            let in_both = LEFT.into_iter().all(|left| less(ALIKE, left));
            !in_both && !less(BY_FACTOR, LEFT[0])
        }
        (Some(_), None) => false,
        (None, _) => true,
    })
}

/// True if `after` explains more by `least` in Σ ln(share left) and half of what a driven joint had left, and no joint less.
pub(super) fn explains_more(
    before: &[Option<Explained>],
    after: &[Option<Explained>],
    least: f64,
) -> bool {
    let halves = |left: Left| {
        let mut both = before.iter().zip(after).filter_map(|(b, a)| b.zip(*a));
        both.any(|(b, a)| a.driven && left(&a) < 0.5 * left(&b))
    };
    let better = |left: Left| gain(before, after, left) >= least && halves(left);
    none_less(before, after) && LEFT.into_iter().any(better)
}

/// True if `after` explains a driven joint by so much more that chance and model error are out of the question, and no joint
/// pays for it.
pub(super) fn overwhelming(before: &[Option<Explained>], after: &[Option<Explained>]) -> bool {
    let both = || before.iter().zip(after).filter_map(|(b, a)| b.zip(*a));
    let pays =
        |left: Left| both().any(|(b, a)| left(&a) > 0.5 * GOOD && left(&a) > WORSE * left(&b));
    if pays(LEFT[0]) || !none_less(before, after) {
        return false;
    }
    let honest = || LEFT.into_iter().filter(|left| !pays(*left));
    let gain = honest()
        .map(|left| gain(before, after, left))
        .fold(0.0, f64::max);
    let any = |better: fn([f64; 2]) -> bool| {
        honest().any(|left| both().any(|(b, a)| a.driven && better([left(&b), left(&a)])))
    };
    let corrected = any(|[b, a]| b > BAD && a < GOOD);
    let improved = any(|[b, a]| b > DOUBTFUL && a < 0.1 * b);
    corrected && gain >= LEAST_GAIN || improved && gain >= GREAT_GAIN
}

/// Turns signs and exchanges joints, the best step first, while that helps; unless the result is [`overwhelming`], the log as it
/// stands but for joints whose velocity is minus the change of their position ([`consistent`]).
pub(super) fn correct(
    robot: &Robot,
    sample: &Sample,
    as_logged: &[Option<Explained>],
) -> (Reading, Vec<Option<Explained>>) {
    let first = consistent(robot, sample, as_logged);
    for left in LEFT {
        let (reading, now) = search(robot, sample, &first, left);
        if overwhelming(&first.1, &now) || overwhelming(as_logged, &now) {
            return (reading, now);
        }
    }
    first
}

/// The reading that is found by taking the best step again and again.
fn search(
    robot: &Robot,
    sample: &Sample,
    first: &(Reading, Vec<Option<Explained>>),
    left: Left,
) -> (Reading, Vec<Option<Explained>>) {
    let dof = robot.dof();
    let (mut reading, mut current) = first.clone();
    for _ in 0..2 * dof {
        if !doubtful(&current, left) {
            break;
        }
        let mut best: Option<(f64, Reading, Vec<Option<Explained>>)> = None;
        let tried: Vec<(Reading, Vec<Option<Explained>>)> = (Step::all(dof).into_par_iter())
            .map(|step| {
                let tried = step.apply(&reading);
                let explained = explain(robot, sample, &tried);
                (tried, explained)
            })
            .collect();
        for (tried, explained) in tried {
            let gain = gain(&current, &explained, left);
            let most = best
                .as_ref()
                .map_or(LEAST_STEP, |(most, ..)| most + PREFERENCE);
            if gain > most {
                best = Some((gain, tried, explained));
            }
        }
        let Some((_, better, explained)) = best else {
            break;
        };
        (reading, current) = (better, explained);
    }
    (reading, current)
}

/// Where the velocity of a joint is minus the change of its position, one of the two is turned: the one with which by far more of the
/// torque is explained than with the other, if there is such a one. What is clearest comes first.
fn consistent(
    robot: &Robot,
    sample: &Sample,
    as_logged: &[Option<Explained>],
) -> (Reading, Vec<Option<Explained>>) {
    let mut now = (Reading::as_logged(robot.dof()), as_logged.to_vec());
    let opposite = (0..robot.dof()).filter(|&joint| sample.opposite[joint] == Some(true));
    let mut left: Vec<usize> = opposite.collect();
    while !left.is_empty() {
        let mut clearest: Option<(f64, usize, Reading, Vec<Option<Explained>>)> = None;
        for &joint in &left {
            let mut tried = [Step::TurnPosition(joint), Step::TurnRates(joint)].map(|step| {
                let reading = step.apply(&now.0);
                let explained = explain(robot, sample, &reading);
                (gain(&now.1, &explained, LEFT[0]), reading, explained)
            });
            tried.sort_by(|a, b| b.0.total_cmp(&a.0));
            let [(gain, reading, explained), (other, ..)] = tried;
            let least = clearest.as_ref().map_or(LEAST_STEP, |(most, ..)| *most);
            if gain - other > least && gain > -PREFERENCE {
                clearest = Some((gain - other, joint, reading, explained));
            }
        }
        let better = clearest.filter(|(.., explained)| none_less(as_logged, explained));
        let Some((_, joint, reading, explained)) = better else {
            break;
        };
        left.retain(|&other| other != joint);
        now = (reading, explained);
    }
    now
}
