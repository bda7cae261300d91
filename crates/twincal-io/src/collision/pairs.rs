//! Which solids may come close, and how fast.

use super::Placed;
use twincal::design::{JointLimits, Path};
use twincal::robot::MovingBody;

/// Distance beyond the margin at which a search begins to keep away, m; of pairs that are always close half of what they usually have.
const NEAR: f64 = 0.05;
/// Margin of pairs that touch in some positions, m.
pub(super) const TOUCHING: f64 = 1e-4;

/// Two solids between which joints move.
#[derive(Debug, Clone)]
pub(super) struct Pair {
    pub(super) one: usize,
    pub(super) other: usize,
    /// Smallest distance that is allowed, m.
    pub(super) margin: f64,
    /// Mean distance at random positions, m.
    pub(super) usual: f64,
    /// Joint, and the largest change of distance per change of its position.
    gains: Vec<(usize, f64)>,
}

impl Pair {
    /// Two solids, by what lies between them in the tree of bodies.
    pub(super) fn new(
        ((one, other), margin): ((usize, usize), f64),
        solids: &[Placed],
        bodies: &[MovingBody],
        limits: &[JointLimits],
    ) -> Self {
        let chains = [one, other].map(|at| chain(solids[at].body, bodies));
        let same = chains[0].iter().zip(&chains[1]);
        let same = same.take_while(|(a, b)| a == b).count();
        let mut gains = Vec::new();
        for (at, chain) in [one, other].into_iter().zip(&chains) {
            let solid = &solids[at];
            let mut radius = solid.solid.reach(&solid.pose);
            for &body in chain[same..].iter().rev() {
                let own = &bodies[body];
                let turn = match own.prismatic {
                    true => 1.0,
                    false => radius,
                };
                gains.push((own.joint, own.multiplier.abs() * turn));
                radius += own.offset_from_parent + slide(own, limits);
            }
        }
        Self {
            one,
            other,
            margin,
            usual: 0.0,
            gains,
        }
    }

    /// Distance beyond the margin within which a search keeps away, m.
    pub(super) fn room(&self) -> f64 {
        match self.margin > TOUCHING {
            true => NEAR,
            false => (0.5 * (self.usual - self.margin)).clamp(TOUCHING, NEAR),
        }
    }

    /// Joints that move the two against each other, each once.
    pub(super) fn joints(&self) -> Vec<usize> {
        let mut joints: Vec<usize> = self.gains.iter().map(|(joint, _)| *joint).collect();
        joints.sort_unstable();
        joints.dedup();
        joints
    }

    /// How far the two may move towards each other along a path.
    pub(super) fn travel(&self, path: &Path) -> Travel {
        let spans = path.spans();
        let per_sample = (0..spans).map(|span| {
            let speeds = self.gains.iter();
            let speed: f64 = speeds
                .map(|(joint, gain)| gain * path.speed[joint * spans + span])
                .sum();
            speed * path.step
        });
        Travel {
            per_sample: per_sample.collect(),
            per_span: path.per_span,
            len: path.len,
        }
    }
}

/// Largest way of a sliding joint, m.
fn slide(body: &MovingBody, limits: &[JointLimits]) -> f64 {
    if !body.prismatic {
        return 0.0;
    }
    let ends = limits[body.joint].position.iter();
    let ways = ends.map(|q| (body.multiplier * q + body.offset).abs());
    ways.fold(0.0, f64::max)
}

/// Bodies from the base to this one.
fn chain(body: Option<usize>, bodies: &[MovingBody]) -> Vec<usize> {
    let mut chain: Vec<usize> = std::iter::successors(body, |&at| bodies[at].parent).collect();
    chain.reverse();
    chain
}

/// Largest change of a distance per sample, span by span.
pub(super) struct Travel {
    per_sample: Vec<f64>,
    per_span: usize,
    len: usize,
}

impl Travel {
    /// The next sample to look at where a distance exceeds what is asked by `slack`: until then it holds at every moment.
    ///
    /// A sample answers for half a step before it and at least half a step after it; `None` where `slack` is not enough for that.
    pub(super) fn next(&self, sample: usize, slack: f64) -> Option<usize> {
        let spans = self.per_sample.len();
        let span_of = |at: usize| (at / self.per_span).min(spans - 1);
        let around = [span_of(sample.saturating_sub(1)), span_of(sample)];
        let fastest = around.map(|span| self.per_sample[span]);
        let mut left = slack;
        if left < 0.5 * fastest[0].max(fastest[1]) {
            return None;
        }
        let mut at = sample as f64;
        for span in span_of(sample)..spans {
            let end = ((span + 1) * self.per_span) as f64;
            let (speed, way) = (self.per_sample[span], (end - at).max(0.0));
            if way * speed > left {
                at += left / speed;
                // The last covered moment, and half a step back.
                return Some(((at + 0.5).floor() as usize).max(sample + 1));
            }
            left -= way * speed;
            at = end;
        }
        // Covered to the end; the last sample is looked at by itself.
        Some(match sample + 1 < self.len {
            true => self.len,
            false => sample + 1,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every moment is within the slack of a sample that is looked at, whatever the speeds.
    #[test]
    fn no_moment_is_left_out() {
        let per_sample = vec![0.01, 0.2, 0.0, 0.05, 0.4];
        let travel = Travel {
            per_sample: per_sample.clone(),
            per_span: 8,
            len: 41,
        };
        let moved = |from: f64, to: f64| {
            let parts = 1000;
            let step = (to - from) / f64::from(parts);
            let speeds = (0..parts).map(|k| {
                let at = from + (f64::from(k) + 0.5) * step;
                per_sample[((at / 8.0) as usize).min(4)]
            });
            speeds.sum::<f64>() * step
        };
        for slack in [0.2, 0.21, 0.5, 1.0, 7.0] {
            let (mut sample, mut covered) = (0, 0.0);
            while sample < 41 {
                let at = sample as f64;
                assert!(covered >= at - 0.5 - 1e-9, "{slack}: {covered} {at}");
                let next = travel.next(sample, slack).expect("enough");
                // Half a step before the next sample.
                covered = (next as f64 - 0.5).min(40.0);
                assert!(
                    moved(at, covered) <= slack + 1e-3,
                    "{slack}: {sample} {next}"
                );
                sample = next;
            }
            assert!(covered >= 40.0, "{slack}: {covered}");
        }
        assert_eq!(travel.next(33, 0.19), None);
        assert_eq!(travel.next(33, -0.01), None);
        assert_eq!(
            travel.next(16, 0.0),
            None,
            "the span before moves up to here"
        );
    }
}
