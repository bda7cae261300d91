//! Encoders that hold their value while the joint moves.
//!
//! Position that is constant for a while is rest, unless the joint is somewhere else afterwards, from one sample to the next, or its logged
//! velocity says that it moves as fast as it usually does.

use crate::error::{Code, Finding, Result, Severity};
use crate::robot::Robot;
use crate::signal::{Channels, Log, Recording, is_plausible_step, median_step};
use crate::words::significant;

/// Shortest time, s, and fewest samples for which a position is held: repeated samples of a polled stream are shorter.
const SHORTEST: f64 = 0.05;
const FEWEST: usize = 5;
/// Share of the joint's travel that is lost at least: what is less moves no prediction.
const TRAVEL: f64 = 0.005;
/// Encoder steps that are lost at least.
const STEPS: f64 = 10.0;
/// How much further than in the samples after it the position goes where it lets go.
const SUDDEN: f64 = 5.0;
/// Share of its rms velocity that a joint's logged velocity has meanwhile: at rest a velocity has noise and some offset.
const MOVES: f64 = 0.25;
/// Way that a velocity makes about its mean in a window of some seconds, rad or m, from which a position that never changes is wrong, and how many
/// standard deviations of what white noise makes there that is at least.
const FROZEN: f64 = 0.1;
const WINDOW: f64 = 4.0;
const NOISE: f64 = 10.0;
/// Stamps further apart than this many intervals are a gap.
const GAP: f64 = 3.0;

/// Where a position is held.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Held {
    /// First and last stamp, s.
    ends: [f64; 2],
    /// What is lost, rad or m.
    lost: f64,
}

/// A warning for every joint of every log whose position is held while it moves. Logs whose stamps are in another unit have none: how long
/// a position is held is not known there.
///
/// # Errors
/// Of chapters that cannot be read.
pub fn stuck_encoders(robot: &Robot, logs: &[Log<'_>]) -> Result<Vec<Finding>> {
    let names = robot.joint_names();
    let mut findings = Vec::new();
    for log in logs {
        let mut held: Vec<Vec<Held>> = vec![Vec::new(); names.len()];
        log.until(|recording| {
            for (held, channels) in held.iter_mut().zip(&recording.joints) {
                held.extend(of_joint(recording, channels));
            }
            false
        })?;
        for (name, held) in names.iter().zip(&held) {
            findings.extend(finding(log.name(), name, held));
        }
    }
    Ok(findings)
}

fn finding(log: &str, joint: &str, held: &[Held]) -> Option<Finding> {
    let most = |a: &&Held, b: &&Held| a.lost.abs().total_cmp(&b.lost.abs());
    let longest = held.iter().max_by(most)?;
    let [from, to] = longest.ends;
    let times = match held.len() {
        1 => String::new(),
        count => format!(", {count} times in all"),
    };
    Some(Finding::new(
        Severity::Warning,
        Code::EncoderStuck,
        joint,
        format!(
            "log `{log}`, joint `{joint}`: position holds one value from {from:.3} to {to:.3} s while the joint moves by {}{times}: repair the \
             encoder or its log, and leave that time out",
            significant(longest.lost.abs(), 3)
        ),
        held.len() as u64,
    )
    .with([("from", from), ("to", to), ("moved", longest.lost.abs())]))
}

/// Of one joint of a recording.
fn of_joint(recording: &Recording, channels: &Channels) -> Vec<Held> {
    let (time, q) = (&recording.time[..], &channels.q[..]);
    let Some(interval) = median_step(time).filter(|step| is_plausible_step(*step)) else {
        return Vec::new();
    };
    let changes = || q.windows(2).map(|pair| (pair[1] - pair[0]).abs());
    let step = changes()
        .filter(|change| *change > 0.0)
        .fold(f64::INFINITY, f64::min);
    let finite = || q.iter().copied().filter(|q| q.is_finite());
    let range = finite().fold(f64::MIN, f64::max) - finite().fold(f64::MAX, f64::min);
    let least = (STEPS * step).max(TRAVEL * range);
    if range == 0.0 {
        return frozen(time, q, channels, interval).into_iter().collect();
    }
    if !(least.is_finite() && range > least) {
        return Vec::new();
    }
    let usual = rms(&changes().collect::<Vec<f64>>()) / interval;
    let mut found = Vec::new();
    let mut from = 0;
    for run in q.chunk_by(|a, b| a == b) {
        let (first, last) = (from, from + run.len() - 1);
        from += run.len();
        let lasts = time[last] - time[first];
        // Long enough, and no gap within.
        let whole = lasts <= GAP * interval * run.len() as f64;
        if run.len() < FEWEST || lasts < SHORTEST || !whole {
            continue;
        }
        let of_velocity = channels.qd.as_deref().and_then(|qd| {
            let qd = &qd[first..=last];
            (rms(qd) > MOVES * usual).then(|| furthest(qd, lasts / (run.len() - 1) as f64))
        });
        let lost = let_go(time, q, last, interval)
            .or(of_velocity)
            .filter(|lost| lost.abs() >= least);
        found.extend(lost.map(|lost| Held {
            ends: [time[first], time[last]],
            lost,
        }));
    }
    found
}

/// A position that is one value throughout while the logged velocity goes to and fro: in some seconds it makes a way about its mean there that
/// neither its noise makes, nor its drift.
fn frozen(time: &[f64], q: &[f64], channels: &Channels, interval: f64) -> Option<Held> {
    let qd = channels.qd.as_deref()?;
    if q.iter().filter(|q| q.is_finite()).count() < FEWEST {
        return None;
    }
    let rows = ((WINDOW / interval) as usize).max(FEWEST);
    let mut runs = time.chunk_by(|a, b| b - a <= GAP * interval);
    let mut from = 0;
    let windows = runs.by_ref().flat_map(|run| {
        let own = &qd[from..from + run.len()];
        from += run.len();
        own.chunks(rows)
    });
    let ways = windows.map(|qd| {
        let finite = || qd.iter().copied().filter(|v| v.is_finite());
        let count = finite().count().max(1) as f64;
        let mean = finite().sum::<f64>() / count;
        let about: Vec<f64> = finite().map(|v| v - mean).collect();
        let changes: Vec<f64> = about.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let noise = rms(&changes) * interval * (0.5 * count).sqrt();
        (furthest(&about, interval), noise)
    });
    let clear = ways.filter(|(way, noise)| way.abs() > FROZEN.max(NOISE * noise));
    let (lost, _) = clear.max_by(|a, b| a.0.abs().total_cmp(&b.0.abs()))?;
    let ends = [*time.first()?, *time.last()?];
    Some(Held { ends, lost })
}

/// By how much the position steps after its sample `last`, where it does so at once and goes on from there.
fn let_go(time: &[f64], q: &[f64], last: usize, interval: f64) -> Option<f64> {
    let after = q.get(last..last + 4)?;
    let no_gap = time[last + 1] - time[last] < GAP * interval;
    let step = after[1] - after[0];
    let next = (after[2] - after[1]).abs().max((after[3] - after[2]).abs());
    // A single wrong sample comes back.
    (no_gap && step.abs() > SUDDEN * next).then_some(step)
}

/// Largest distance from its first position that a velocity makes, rad or m.
fn furthest(qd: &[f64], interval: f64) -> f64 {
    let mut place = 0.0_f64;
    let mut places = qd.iter().filter(|v| v.is_finite()).map(|v| {
        place += v * interval;
        place
    });
    let first = places.next().unwrap_or(0.0);
    places.fold(
        first,
        |far, place| if place.abs() > far.abs() { place } else { far },
    )
}

fn rms(values: &[f64]) -> f64 {
    let finite = || values.iter().filter(|v| v.is_finite());
    (finite().map(|v| v * v).sum::<f64>() / finite().count().max(1) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signal::Payload;

    const INTERVAL: f64 = 0.004;

    /// Moves between rests, encoder of 2^18 counts a turn; `change` is made to the positions.
    fn recording(velocity: bool, change: impl Fn(&mut Vec<f64>)) -> Recording {
        let step = std::f64::consts::TAU / 262_144.0;
        let place = |t: f64| {
            let phase = t.rem_euclid(2.0) / 2.0;
            0.8 * (6.0 * phase.powi(5) - 15.0 * phase.powi(4) + 10.0 * phase.powi(3))
                * if t.rem_euclid(4.0) < 2.0 { 1.0 } else { 0.0 }
                + if t.rem_euclid(4.0) < 2.0 { 0.0 } else { 0.8 }
                - if t.rem_euclid(4.0) < 2.0 {
                    0.0
                } else {
                    0.8 * phase.powi(3) * (6.0 * phase * phase - 15.0 * phase + 10.0)
                }
        };
        let time: Vec<f64> = (0..3000).map(|i| f64::from(i) * INTERVAL).collect();
        let speed = |t: &f64| (place(t + 1e-6) - place(t - 1e-6)) / 2e-6 + 0.002;
        let mut q: Vec<f64> = time
            .iter()
            .map(|t| (place(*t) / step).round() * step)
            .collect();
        change(&mut q);
        let qd = velocity.then(|| time.iter().map(speed).collect());
        let channels = Channels {
            q,
            qd,
            qdd: None,
            tau: None,
            temperature: None,
        };
        Recording {
            unfolded: false,
            start_ns: 0,
            name: "run".into(),
            time,
            joints: vec![channels],
            payload: Payload::None,
        }
    }

    /// What is found in it.
    fn held(velocity: bool, change: impl Fn(&mut Vec<f64>)) -> Vec<Held> {
        let recording = recording(velocity, change);
        of_joint(&recording, &recording.joints[0])
    }

    /// Eight samples that repeat last 32 ms: nothing is held. In stamps of milliseconds they last 32 s, and the clock is what is wrong.
    #[test]
    fn stamps_in_another_unit_hold_no_position() {
        let repeated = |q: &mut Vec<f64>| {
            let kept = q[200];
            q[200..208].fill(kept);
        };
        for velocity in [true, false] {
            assert!(held(velocity, repeated).is_empty());
            let mut log = recording(velocity, repeated);
            log.time.iter_mut().for_each(|t| *t *= 1e3);
            assert!(of_joint(&log, &log.joints[0]).is_empty(), "{velocity}");
        }
    }

    #[test]
    fn a_position_that_is_held_while_its_joint_moves_is_found_with_its_time() {
        for velocity in [true, false] {
            for rows in [25, 250] {
                let found = held(velocity, |q| {
                    let kept = q[200];
                    q[200..200 + rows].fill(kept);
                });
                assert_eq!(found.len(), 1, "{velocity} {rows}: {found:?}");
                assert!(
                    (found[0].ends[0] - 200.0 * INTERVAL).abs() < 1e-9,
                    "{found:?}"
                );
                assert!(found[0].lost.abs() > 0.04, "{found:?}");
            }
        }
        // To the end of the log only velocity says so.
        let to_the_end = |q: &mut Vec<f64>| {
            let kept = q[1200];
            q[1200..].fill(kept);
        };
        assert_eq!(held(true, to_the_end).len(), 1);
        assert!(held(false, to_the_end).is_empty());
    }

    #[test]
    fn a_position_that_never_changes_is_found_where_velocity_moves() {
        let never = |q: &mut Vec<f64>| q.fill(0.3);
        let [found] = held(true, never)[..] else {
            panic!("one stretch");
        };
        assert!(found.lost.abs() > 0.3, "{found:?}");
        assert_eq!(found.ends, [0.0, 2999.0 * INTERVAL]);
        // A lost sample changes nothing; without a velocity the joint may be at rest.
        let with_gap = |q: &mut Vec<f64>| {
            q.fill(0.3);
            q[700] = f64::NAN;
        };
        assert_eq!(held(true, with_gap).len(), 1);
        assert!(held(false, never).is_empty());
    }

    /// Half an hour, a gap of an hour, an offset that drifts: a way of ten standard deviations of white noise has probability 1e-20 in each of 450 windows.
    #[test]
    fn a_velocity_that_is_noise_or_drifts_is_rest() {
        let mut noise = crate::random::Random::new(3, 0);
        let rows = 450_000;
        for (sd, drift, gap) in [(0.05, 0.0, 0.0), (0.01, 0.002, 3600.0), (0.2, 0.0, 600.0)] {
            let time =
                (0..rows).map(|i| f64::from(i) * INTERVAL + if i > rows / 2 { gap } else { 0.0 });
            let time: Vec<f64> = time.collect();
            let turn = std::f64::consts::TAU / 600.0;
            let qd = time
                .iter()
                .map(|t| 0.2 + drift * (turn * t).sin() + sd * noise.normal());
            let at_rest = Channels {
                q: vec![0.3; time.len()],
                qd: Some(qd.collect()),
                qdd: None,
                tau: None,
                temperature: None,
            };
            assert_eq!(
                frozen(&time, &at_rest.q, &at_rest, INTERVAL),
                None,
                "{sd} {drift} {gap}"
            );
        }
    }

    #[test]
    fn rests_slow_parts_repeated_samples_and_spikes_are_none() {
        for velocity in [true, false] {
            assert!(held(velocity, |_| ()).is_empty());
            // Coarse: every value stands for many samples.
            let coarse =
                |q: &mut Vec<f64>| q.iter_mut().for_each(|q| *q = (*q / 2e-3).round() * 2e-3);
            assert!(held(velocity, coarse).is_empty());
            let repeated = |q: &mut Vec<f64>| {
                for row in (100..2900).step_by(37) {
                    q[row + 1] = q[row];
                    q[row + 2] = q[row];
                }
            };
            assert!(held(velocity, repeated).is_empty());
            assert!(held(velocity, |q| q[500] += 0.4).is_empty());
        }
    }
}
