//! Encoders × rates × rest × motion: none of them cuts a log; a real reset does.

use super::*;
use crate::error::Code;
use crate::robot::JointKind;
use crate::signal::clean::correct::Corrections;
use crate::signal::clean::prepare::prepare;
use crate::signal::worlds::{JOINTS, MOTIONS, World};
use rand::{RngExt, SeedableRng};

fn facts() -> Vec<JointFacts> {
    let facts = |joint: usize| JointFacts {
        name: format!("joint{joint}"),
        kind: JointKind::Revolute,
        range: None,
        effort: None,
    };
    (0..JOINTS).map(facts).collect()
}

fn prepared(log: &Recording) -> (usize, Vec<Finding>) {
    let mut findings = Vec::new();
    let prepared = prepare(&facts(), log, false, &Corrections::default(), &mut findings);
    (prepared.unwrap().pieces.len(), findings)
}

/// Where velocity comes from.
#[derive(Debug, Clone, Copy)]
enum Velocity {
    Missing,
    Logged,
    /// Difference of two readings over the step, as many drives log it.
    Differenced,
}

fn with_velocity(mut log: Recording, velocity: Velocity, rate: f64) -> Recording {
    for joint in &mut log.joints {
        match velocity {
            Velocity::Missing => joint.qd = None,
            Velocity::Logged => {}
            Velocity::Differenced => {
                let first = [0.0].into_iter();
                let steps = joint.q.windows(2).map(|pair| (pair[1] - pair[0]) * rate);
                joint.qd = Some(first.chain(steps).collect());
            }
        }
    }
    log
}

const VELOCITIES: [Velocity; 3] = [Velocity::Missing, Velocity::Logged, Velocity::Differenced];

/// 432 logs of 20 s without a reset.
#[test]
fn no_encoder_at_rest_or_in_motion_cuts_a_log() {
    let mut seed = 0;
    for motion in MOTIONS {
        for bits in [16, 18, 20] {
            for rate in [125.0, 250.0, 500.0, 1000.0] {
                for dither in [0.0, 0.3, 1.0] {
                    for velocity in VELOCITIES {
                        seed += 1;
                        let world = World {
                            rate,
                            counts: f64::from(1 << bits),
                            dither,
                            ..World::new(motion, seed)
                        };
                        let log = with_velocity(world.clean(), velocity, rate);
                        let (pieces, findings) = prepared(&log);
                        assert_eq!(pieces, 1, "{world:?} {velocity:?}: {findings:?}");
                    }
                }
            }
        }
    }
}

/// Encoder zeros that jump by 0.05 to 1 rad: all of 288 cut, where they are.
#[test]
fn a_real_reset_cuts_in_rest_and_in_motion() {
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(9);
    let mut seed = 5000;
    for motion in MOTIONS {
        for bits in [16, 20] {
            for rate in [125.0, 1000.0] {
                for dither in [0.0, 1.0] {
                    for velocity in VELOCITIES {
                        for size in [0.05, -0.3, 1.0] {
                            seed += 1;
                            let world = World {
                                rate,
                                counts: f64::from(1 << bits),
                                dither,
                                ..World::new(motion, seed)
                            };
                            let mut log = world.clean();
                            let len = log.time.len();
                            // Slower than 0.15 of the reset per step.
                            let at = loop {
                                let at = random.random_range(len / 4..3 * len / 4);
                                let speed = motion.at(0, log.time[at])[1].abs();
                                if speed / rate < 0.15 * f64::abs(size) {
                                    break at;
                                }
                            };
                            log.joints[0].q[at..].iter_mut().for_each(|q| *q += size);
                            let log = with_velocity(log, velocity, rate);
                            let (pieces, findings) = prepared(&log);
                            let said = findings
                                .iter()
                                .find(|finding| finding.code == Code::PositionStep);
                            let said = said.unwrap_or_else(|| {
                                panic!("{world:?} {velocity:?} {size}: {findings:?}")
                            });
                            assert_eq!(
                                (said.count, pieces),
                                (1, 2),
                                "{world:?} {velocity:?}: {findings:?}"
                            );
                        }
                    }
                }
            }
        }
    }
}
