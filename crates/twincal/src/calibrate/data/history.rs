//! What is followed of the joints' history: thresholds of stop operators and what warmth is, from what the training logs hold.

use crate::calibrate::settings::CalibrationSettings;
use crate::error::{Code, Finding, Result, Severity};
use crate::robot::{JointKind, Robot};
use crate::signal::{
    JointHistory, Log, Pipeline, ReadyLog, STOPS, Warmth, known_temperatures, stretches,
};
use crate::term::Family;

/// Thresholds of a turning joint's stop operators, rad: friction of geared arms builds up over 2r of 3 to 30 mrad. Shorter ways look like
/// Coulomb friction behind the row filter. A factor of 3 apart, operators leave at most 1 % of the mean square of an exponential of 2 to 8 mrad,
/// and 3 % of one of 15 mrad.
const THRESHOLDS: [f64; STOPS] = [1.5e-3, 5e-3, 15e-3];
/// What turns thresholds of a sliding joint into metres.
const REACH: f64 = 0.1;
/// Travel of a joint in largest thresholds, at least: all of them are smaller where it travels less.
const TRAVEL: f64 = 20.0;
/// The least share of the usual thresholds that is tried: what turns within less rests more than it moves.
const LEAST: f64 = 0.1;
/// Samples of all training logs together that tell how far joints travel, about.
const SAMPLES: usize = 1 << 13;
/// Shortest log in which a joint warms up, s; shorter ones hold too few repetitions of a motion to tell.
const SHORTEST: f64 = 20.0;
/// So many of them at least: what was seen once is a drift, and says nothing of another log's start.
const FEWEST: usize = 2;
/// Time constant in lengths of the longest log. Of the rms of exp(−t/T') about its mean 3 % or less is left for T' from 0.2 to 2/3 of that length with a
/// second channel, first order in the logarithm of T'; without it up to 19 %.
const CONSTANT: f64 = 1.0 / 3.0;
/// Least standard deviation of a logged temperature that says anything, K.
const LEAST_SPREAD: f64 = 0.5;
/// Joints beyond which nothing is followed: the prior of what needs Coulomb friction takes `(joints + 1)^5` numbers.
const MOST_JOINTS: usize = 9;

/// What is followed, and who may ask for it.
pub(in crate::calibrate) struct Followed {
    /// Of every joint; empty where nothing is.
    pub(in crate::calibrate) history: Vec<JointHistory>,
    /// The calibration's, without the families that these logs say nothing of.
    pub(in crate::calibrate) settings: CalibrationSettings,
}

/// What the families that are asked for need of the joints' history, as far as the training logs hold it.
///
/// # Errors
/// Of chapters that cannot be read.
pub(in crate::calibrate) fn follow(
    robot: &Robot,
    (logs, prepared): (&[Log<'_>], &[ReadyLog<'_>]),
    pipeline: &Pipeline,
    settings: &CalibrationSettings,
    findings: &mut Vec<Finding>,
) -> Result<Followed> {
    let (dof, families) = (robot.dof(), &settings.library.families);
    let mut history = vec![JointHistory::default(); dof];
    let few = dof <= MOST_JOINTS;
    if few && families.contains(&Family::Hysteresis) {
        let travel = travel(dof, prepared, pipeline)?;
        for (joint, own) in history.iter_mut().enumerate() {
            own.thresholds = thresholds(travel[joint], robot.joint_kind(joint));
        }
    }
    if few && families.contains(&Family::WarmUp) {
        let by_time = of_time(logs)?;
        let temperatures = of_temperature(dof, logs)?;
        for (own, temperature) in history.iter_mut().zip(temperatures) {
            own.warmth = temperature.or(by_time);
        }
    }
    let bends = history.iter().any(|own| !own.thresholds.is_empty());
    let warms = history.iter().any(|own| own.warmth.is_some());
    let mut settings = settings.clone();
    for (family, followed) in [(Family::Hysteresis, bends), (Family::WarmUp, warms)] {
        if followed || !settings.library.families.contains(&family) {
            continue;
        }
        settings.library.families.retain(|other| *other != family);
        let why = match family {
            _ if !few => format!("{dof} joints move, more than {MOST_JOINTS}"),
            Family::WarmUp => {
                format!(
                    "fewer than {FEWEST} logs last {SHORTEST} s, and not all have a temperature that changes"
                )
            }
            _ => "no joint travels far enough".to_owned(),
        };
        let message = format!("`{}` of friction is no candidate: {why}", family.word());
        findings.push(
            Finding::new(Severity::Note, Code::HistoryNotFollowed, "", message, 0)
                .with((!few).then_some(("joints", dof as f64))),
        );
    }
    if !bends && !warms {
        history.clear();
    }
    Ok(Followed { history, settings })
}

/// The usual thresholds, or smaller ones of a joint that travels little; none where it hardly does.
fn thresholds(travel: f64, kind: JointKind) -> Vec<f64> {
    let unit = match kind {
        JointKind::Prismatic => REACH,
        _ => 1.0,
    };
    let share = (travel / (TRAVEL * unit * THRESHOLDS[STOPS - 1])).min(1.0);
    match share >= LEAST {
        true => THRESHOLDS.iter().map(|r| share * unit * r).collect(),
        false => Vec::new(),
    }
}

/// What the position of each joint spans, rad or m.
fn travel(dof: usize, logs: &[ReadyLog<'_>], pipeline: &Pipeline) -> Result<Vec<f64>> {
    let mut ends = vec![[f64::INFINITY, f64::NEG_INFINITY]; dof];
    let motion = stretches(logs, SAMPLES, pipeline)?;
    for segment in motion.iter().flat_map(|trajectory| &trajectory.segments) {
        let joints = segment.q.chunks_exact(segment.time.len());
        for (ends, q) in ends.iter_mut().zip(joints) {
            for &q in q {
                *ends = [ends[0].min(q), ends[1].max(q)];
            }
        }
    }
    Ok(ends
        .iter()
        .map(|[low, high]| (high - low).max(0.0))
        .collect())
}

/// Warmth by the time since a log's start, where logs that are long enough start more than once.
fn of_time(logs: &[Log<'_>]) -> Result<Option<Warmth>> {
    let lengths: Vec<f64> = logs.iter().map(length).collect::<Result<_>>()?;
    let longest = lengths.iter().copied().fold(0.0, f64::max);
    if lengths.iter().filter(|length| **length >= SHORTEST).count() < FEWEST {
        return Ok(None);
    }
    let constant = CONSTANT * longest;
    // ∫ exp(−t/T) dt and ∫ (t/T) exp(−t/T) dt over all logs, per second of them
    let all: f64 = lengths.iter().sum();
    let mean = |of: &dyn Fn(f64) -> f64| {
        let sum: f64 = lengths
            .iter()
            .map(|length| constant * of(length / constant))
            .sum();
        sum / all
    };
    Ok(Some(Warmth::Time {
        constant,
        mean: mean(&|end| -(-end).exp_m1()),
        later_mean: mean(&|end| -(-end).exp_m1() - end * (-end).exp()),
    }))
}

/// From first to last stamp, s.
fn length(log: &Log<'_>) -> Result<f64> {
    let finite = |time: &&f64| time.is_finite();
    let last = |time: &[f64]| time.iter().rfind(finite).copied();
    let ends = match log {
        Log::Whole(log) => log.time.iter().find(finite).copied().zip(last(&log.time)),
        Log::Long(log) => log
            .start()
            .zip(last(&log.chapter(log.chapters() - 1)?.time)),
    };
    Ok(ends.map_or(0.0, |(first, last)| last - first))
}

/// Warmth by the logged temperature of each joint, where every log has one and it changes.
fn of_temperature(dof: usize, logs: &[Log<'_>]) -> Result<Vec<Option<Warmth>>> {
    // number, sum, sum of squares; a sum that is no number is a log without
    let mut sums = vec![[0.0; 3]; dof];
    for log in logs {
        log.until(|recording| {
            let mut any = false;
            for (sums, channels) in sums.iter_mut().zip(&recording.joints) {
                match known_temperatures(&recording.time, &channels.temperature) {
                    Some(known) => {
                        any = true;
                        for (_, value) in known {
                            *sums = [sums[0] + 1.0, sums[1] + value, sums[2] + value * value];
                        }
                    }
                    None => sums[0] = f64::NAN,
                }
            }
            !any
        })?;
    }
    let of_joint = |[count, sum, squares]: [f64; 3]| {
        let mean = sum / count;
        let sd = (squares / count - mean * mean).max(0.0).sqrt();
        (sd >= LEAST_SPREAD).then_some(Warmth::Temperature { mean, sd })
    };
    Ok(sums.into_iter().map(of_joint).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thresholds_follow_the_travel() {
        assert_eq!(thresholds(2.0, JointKind::Revolute), THRESHOLDS);
        let near =
            |a: Vec<f64>, b: [f64; STOPS]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12);
        assert!(near(
            thresholds(0.15, JointKind::Continuous),
            [0.75e-3, 2.5e-3, 7.5e-3]
        ));
        assert!(near(
            thresholds(0.5, JointKind::Prismatic),
            [0.15e-3, 0.5e-3, 1.5e-3]
        ));
        assert!(thresholds(0.02, JointKind::Revolute).is_empty());
    }

    /// Least squares on a fine grid: what either channel, and both, leave of other time constants, each about its mean.
    #[test]
    fn a_second_channel_stands_for_other_time_constants() {
        let (steps, centred) = (3000, |of: &dyn Fn(f64) -> f64| -> Vec<f64> {
            let all: Vec<f64> = (0..3000).map(|i| of(f64::from(i) / 3000.0)).collect();
            let mean = all.iter().sum::<f64>() / 3000.0;
            all.iter().map(|x| x - mean).collect()
        });
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let without = |a: &[f64], b: &[f64]| -> Vec<f64> {
            let factor = dot(a, b) / dot(b, b);
            a.iter().zip(b).map(|(a, b)| a - factor * b).collect()
        };
        let first = centred(&|t| (-t / CONSTANT).exp());
        let later = centred(&|t| t / CONSTANT * (-t / CONSTANT).exp());
        let later = without(&later, &first);
        let (mut most, mut most_alone) = (0.0_f64, 0.0_f64);
        for other in [0.2, 0.25, 0.3, 0.4, 0.5, 2.0 / 3.0] {
            let truth = centred(&|t| (-t / other).exp());
            let alone = without(&truth, &first);
            let both = without(&alone, &later);
            let share = |left: &[f64]| (dot(left, left) / dot(&truth, &truth)).sqrt();
            (most, most_alone) = (most.max(share(&both)), most_alone.max(share(&alone)));
        }
        assert_eq!(first.len(), steps);
        assert!(most < 0.03 && most_alone > 0.18, "{most} {most_alone}");
    }

    /// The mean over both logs is that of sums over fine steps.
    #[test]
    fn warmth_has_the_mean_zero_over_the_training_logs() {
        let log = |seconds: f64| {
            Log::from(crate::signal::Recording {
                unfolded: true,
                name: "run".into(),
                time: vec![3.0, 3.0 + seconds],
                start_ns: 0,
                joints: Vec::new(),
                payload: crate::signal::Payload::None,
            })
        };
        let Some(Warmth::Time {
            constant,
            mean,
            later_mean,
        }) = of_time(&[log(60.0), log(15.0), log(20.0)]).unwrap()
        else {
            panic!("long enough");
        };
        assert_eq!(constant, 20.0);
        let steps = (0..95_000).map(|i| 1e-3 * (f64::from(i) + 0.5));
        let since = |t: f64| match t {
            t if t < 60.0 => t,
            t if t < 75.0 => t - 60.0,
            t => t - 75.0,
        };
        let sum: f64 = steps.clone().map(|t| (-since(t) / 20.0).exp()).sum();
        assert!((sum / 95_000.0 - mean).abs() < 1e-6);
        let sum: f64 = steps
            .map(|t| since(t) / 20.0 * (-since(t) / 20.0).exp())
            .sum();
        assert!((sum / 95_000.0 - later_mean).abs() < 1e-6);
        for few in [&[log(19.0), log(60.0)][..], &[log(600.0)]] {
            assert_eq!(of_time(few).unwrap(), None);
        }
    }
}
