//! Distance of a moving robot from itself, from the floor and from forbidden space, between samples too.

use super::spline::{Spline, StateWeights};
use std::ops::Range;

/// Positions of all joints on an even grid of time, with what bounds the motion between them.
#[derive(Debug, Clone, PartialEq)]
pub struct Path {
    /// rad or m, `[joint * len + sample]`.
    pub q: Vec<f64>,
    /// Samples of each joint.
    pub len: usize,
    /// Time between two samples, s.
    pub step: f64,
    /// Samples of a span; the last sample ends the last span.
    pub per_span: usize,
    /// Largest speed of each joint anywhere in each span, rad/s or m/s, `[joint * spans + span]`.
    pub speed: Vec<f64>,
    /// Time of the first sample, s.
    pub start: f64,
}

impl Path {
    /// Spans of the path.
    #[must_use]
    pub fn spans(&self) -> usize {
        self.len.div_ceil(self.per_span).saturating_sub(1).max(1)
    }

    /// A robot at rest.
    #[must_use]
    pub fn at_rest(q: &[f64]) -> Self {
        Self {
            q: q.to_vec(),
            len: 1,
            step: 0.0,
            per_span: 1,
            speed: vec![0.0; q.len()],
            start: 0.0,
        }
    }

    /// Positions of one sample.
    #[must_use]
    pub fn position(&self, sample: usize) -> Vec<f64> {
        let own = self.q.iter().skip(sample).step_by(self.len);
        own.copied().collect()
    }
}

/// Two things, how far they are apart, and when.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Approach {
    /// Names of links, boxes or the floor.
    pub between: [String; 2],
    /// m; 0 where they overlap.
    pub distance: f64,
    /// s since the motion's start.
    pub time: f64,
}

impl Approach {
    /// Who comes how close, and when.
    pub(super) fn in_words(&self) -> String {
        let [one, other] = &self.between;
        format!(
            "`{one}` and `{other}` would be {} m apart at {} s",
            crate::words::significant(self.distance, 2),
            crate::words::significant(self.time, 3)
        )
    }
}

/// How what is left between two things changes with the positions of the joints.
#[derive(Debug, Clone, PartialEq)]
pub struct NearSlope {
    /// Number of the position.
    pub state: usize,
    /// ∂ ln(distance beyond the margin) / ∂q of every joint, 1/rad or 1/m.
    pub slopes: Vec<f64>,
}

/// How far a robot is from itself, from the floor and from forbidden space.
pub trait Clearance: Sync {
    /// The first approach closer than the margin; `None`: at every moment of the path, between samples too, nothing is closer.
    ///
    /// With `joint` it alone differs from a path on which nothing was closer.
    fn breach(&self, path: &Path, joint: Option<usize>) -> Option<Approach>;

    /// Σ ln(what is left to the margin, as a share of a short distance) over what is nearer than that: 0 where nothing is, and smaller the
    /// nearer; of each of `len` positions `[joint * len + state]`.
    fn nearness(&self, q: &[f64], len: usize) -> Vec<f64>;

    /// What makes [`Self::nearness`] less than 0, with its slopes; `steps` are small changes of each joint's position.
    fn nearness_slopes(&self, q: &[f64], len: usize, steps: &[f64]) -> Vec<NearSlope>;

    /// The smallest distance at the samples of the path; `None` where nothing can come close.
    fn closest(&self, path: &Path) -> Option<Approach>;
}

/// Some spans of a motion.
pub(super) fn path_of(splines: &[Spline], spans: Range<usize>, per_span: usize) -> Path {
    let len = spans.len() * per_span + 1;
    let span = splines.first().map_or(0.0, |spline| spline.span);
    let weights: Vec<StateWeights> = (0..per_span)
        .map(|at| StateWeights::at(at as f64 / per_span as f64))
        .collect();
    let at_end = StateWeights::at(1.0);
    let mut path = Path {
        q: Vec::with_capacity(splines.len() * len),
        len,
        step: span / per_span as f64,
        per_span,
        speed: Vec::with_capacity(splines.len() * spans.len()),
        start: spans.start as f64 * span,
    };
    for spline in splines {
        for at in spans.clone() {
            let own = &spline.points[at..at + 6];
            path.q
                .extend(weights.iter().map(|own| spline.state(at, own)[0]));
            let fastest = own.windows(2).map(|c| (c[1] - c[0]).abs());
            path.speed.push(fastest.fold(0.0, f64::max) / span);
        }
        path.q.push(spline.state(spans.end - 1, &at_end)[0]);
    }
    path
}
