//! A log as pieces, each on one even clock: what is made of a recording before anything is filtered.

use super::standstill::span;
use crate::signal::log::recording::{Channels, Recording};
use rayon::prelude::*;
use std::borrow::Cow;

/// One joint's values on the grid of a piece: the recording's own where nothing had to change.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Values<'a> {
    /// rad or m.
    pub(crate) q: Cow<'a, [f64]>,
    /// rad/s or m/s, if logged.
    pub(crate) qd: Option<Cow<'a, [f64]>>,
    /// rad/s² or m/s², if logged.
    pub(crate) qdd: Option<Cow<'a, [f64]>>,
    /// N·m or N, if logged.
    pub(crate) tau: Option<Cow<'a, [f64]>>,
}

impl<'a> Values<'a> {
    /// The channels there are: q, q̇, q̈, τ.
    pub(crate) fn channels(&self) -> impl Iterator<Item = &[f64]> {
        let others = [&self.qd, &self.qdd, &self.tau].into_iter().flatten();
        std::iter::once(&self.q)
            .chain(others)
            .map(|channel| &**channel)
    }

    /// Some of them, lent.
    fn lent(&self, range: &std::ops::Range<usize>) -> Values<'_> {
        Values {
            q: Cow::Borrowed(&self.q[range.clone()]),
            qd: self.qd.as_ref().map(|x| Cow::Borrowed(&x[range.clone()])),
            qdd: self.qdd.as_ref().map(|x| Cow::Borrowed(&x[range.clone()])),
            tau: self.tau.as_ref().map(|x| Cow::Borrowed(&x[range.clone()])),
        }
    }

    /// The same without the recording.
    fn into_owned(self) -> Values<'static> {
        let own = |channel: Cow<'a, [f64]>| Cow::Owned(channel.into_owned());
        Values {
            q: own(self.q),
            qd: self.qd.map(own),
            qdd: self.qdd.map(own),
            tau: self.tau.map(own),
        }
    }

    /// Changes them, in that order.
    pub(crate) fn for_each(&mut self, change: impl FnMut(&mut Cow<'a, [f64]>)) {
        let others = [&mut self.qd, &mut self.qdd, &mut self.tau]
            .into_iter()
            .flatten();
        std::iter::once(&mut self.q).chain(others).for_each(change);
    }
}

/// A run of samples on one even clock.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Piece<'a> {
    /// Grid, s: the stamps themselves when they are even.
    pub(crate) time: Vec<f64>,
    /// Interval, s.
    pub(crate) interval: f64,
    /// How many samples of the log became one.
    pub(crate) every: usize,
    /// Rows of the recording; one per stamp of the run.
    pub(crate) rows: Vec<usize>,
    /// Row of the recording of every grid sample; empty where the stamps were uneven.
    pub(crate) grid_rows: Vec<usize>,
    /// Values on the grid.
    pub(crate) joints: Vec<Values<'a>>,
}

impl Piece<'_> {
    /// These samples of the grid, lent; without the rows that they come from where the stamps were uneven.
    pub(crate) fn lent(&self, range: std::ops::Range<usize>) -> Piece<'_> {
        let grid_rows = self.grid_rows.get(range.clone()).unwrap_or_default();
        Piece {
            time: self.time[range.clone()].to_vec(),
            rows: grid_rows.to_vec(),
            grid_rows: grid_rows.to_vec(),
            joints: (self.joints.iter())
                .map(|values| values.lent(&range))
                .collect(),
            ..*self
        }
    }

    /// The same without the recording.
    pub(crate) fn into_owned(self) -> Piece<'static> {
        Piece {
            joints: self.joints.into_iter().map(Values::into_owned).collect(),
            time: self.time,
            interval: self.interval,
            every: self.every,
            rows: self.rows,
            grid_rows: self.grid_rows,
        }
    }

    /// The stamps were uneven.
    pub(crate) fn resampled(&self) -> bool {
        self.grid_rows.is_empty()
    }

    /// Keeps these samples of the grid.
    pub(crate) fn keep(&mut self, range: std::ops::Range<usize>) {
        self.time = self.time[range.clone()].to_vec();
        if !self.resampled() {
            self.rows = self.rows[range.clone()].to_vec();
            self.grid_rows = self.grid_rows[range.clone()].to_vec();
        }
        for values in &mut self.joints {
            values.for_each(|channel| {
                *channel = match channel {
                    Cow::Borrowed(all) => Cow::Borrowed(&all[range.clone()]),
                    Cow::Owned(all) => Cow::Owned(all[range.clone()].to_vec()),
                };
            });
        }
    }
}

/// A log as pieces.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Prepared<'a> {
    /// In the log's order.
    pub(crate) pieces: Vec<Piece<'a>>,
    /// Median step of the log, s.
    pub(crate) interval: f64,
    /// Stamps on the controller's clock, s, by row of the recording, where the logged ones are a receiver's.
    pub(crate) time: Option<Vec<f64>>,
}

impl Prepared<'_> {
    /// Time between cuts, s: from the first to the last stamp of each piece.
    pub(crate) fn seconds(&self) -> f64 {
        let of_piece = |piece: &Piece<'_>| {
            let ends = piece.time.first().zip(piece.time.last());
            ends.map_or(0.0, |(first, last)| last - first)
        };
        self.pieces.iter().map(of_piece).sum()
    }

    /// What each joint's position spans at most at rest, rad or m; before anything is thinned.
    pub(crate) fn at_rest(&self, log: &Recording) -> Vec<f64> {
        let joints = log.joints.par_iter().enumerate();
        let of_joint = |(joint, channels): (usize, &Channels)| {
            let pieces = self.pieces.iter().map(|piece| &*piece.joints[joint].q);
            span(&channels.q, pieces)
        };
        joints.map(of_joint).collect()
    }
}

/// Values of some rows, which ascend: a stretch of the channel where none is missing.
pub(crate) fn pick<'a>(values: &'a [f64], rows: &[usize]) -> Cow<'a, [f64]> {
    match (rows.first(), rows.last()) {
        (Some(&first), Some(&last)) if last - first + 1 == rows.len() => {
            Cow::Borrowed(&values[first..=last])
        }
        _ => rows.iter().map(|&row| values[row]).collect(),
    }
}
