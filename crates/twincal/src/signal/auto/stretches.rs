//! Evenly spread stretches of a log: what is asked of a log's motion but not row by row needs no more.

use super::ready::{LongReady, ReadyLog};
use crate::error::Result;
use crate::signal::filter::pipeline::Pipeline;
use crate::signal::filter::prepared_log::{PreparedLog, Raw};
use crate::signal::filter::thin::factor;
use crate::signal::filter::trajectory::Trajectory;
use std::ops::Range;

/// Shortest stretch, samples, and most of them in a segment.
const STRETCH: usize = 2048;
const MOST_STRETCHES: usize = 8;
/// Shortest stretch whose filtered rows are asked for, in lengths of what one row sees, and the fewest of them.
const KERNELS: f64 = 6.0;
const FEWEST: usize = 6;
/// Chapters of a long log that are looked at.
const CHAPTERS: usize = 4;

impl Trajectory {
    /// The same with about `samples` of its samples, in stretches that are spread evenly; its filtered rows are none of the log's.
    pub(crate) fn thinned_out(mut self, samples: usize) -> Self {
        let lengths: Vec<usize> = self.segments.iter().map(|s| s.time.len()).collect();
        if let Some(stretches) = spread(&lengths, samples, STRETCH) {
            let cut = |(segment, range): (usize, _)| self.segments[segment].cut(self.dof, range);
            self.segments = stretches.into_iter().map(cut).collect();
        }
        self
    }
}

/// Motion of evenly spread stretches of some logs, on the clock at which motion is held: about `samples` samples together, but at least
/// [`FEWEST`] stretches that are long enough for rows. What is too short for rows is left out: what is wrong with a log is said when all
/// of it is read.
///
/// # Errors
/// Of chapters that cannot be read.
pub(crate) fn stretches(
    logs: &[ReadyLog<'_>],
    samples: usize,
    pipeline: &Pipeline,
) -> Result<Vec<Trajectory>> {
    let lengths: Vec<usize> = logs.iter().map(|log| log.length(pipeline)).collect();
    let shortest = logs.iter().map(|log| log.shortest(pipeline));
    let samples = samples.max(FEWEST * shortest.max().unwrap_or(0));
    let all: usize = lengths.iter().sum::<usize>().max(1);
    let (mut seen, mut taken, mut kept) = (0, 0, Vec::new());
    for (log, length) in logs.iter().zip(lengths) {
        seen += length;
        let due = (samples.min(all) * seen / all).saturating_sub(taken);
        // Of many short logs some are taken whole.
        if due < length.min(log.shortest(pipeline)) {
            continue;
        }
        let due = due.min(length);
        taken += due;
        kept.extend(log.stretches(due, pipeline)?);
    }
    Ok(kept)
}

impl ReadyLog<'_> {
    /// Interval of the clock at which motion is held, s.
    fn held_interval(&self, pipeline: &Pipeline) -> f64 {
        match self {
            Self::Whole(log) => log.interval(),
            Self::Long(long) => long.interval * factor(pipeline, long.interval) as f64,
        }
    }

    /// Samples on that clock.
    fn length(&self, pipeline: &Pipeline) -> usize {
        match self {
            Self::Whole(log) => log.samples(),
            Self::Long(long) => {
                let samples: usize = long.log.samples().iter().sum();
                samples / factor(pipeline, long.interval)
            }
        }
    }

    /// Samples of a stretch most of which become rows.
    fn shortest(&self, pipeline: &Pipeline) -> usize {
        (KERNELS * pipeline.kernel_length() / self.held_interval(pipeline)).ceil() as usize
    }

    fn stretches(&self, samples: usize, pipeline: &Pipeline) -> Result<Vec<Trajectory>> {
        let shortest = self.shortest(pipeline);
        match self {
            Self::Whole(log) => Ok(log
                .stretches(samples, shortest, pipeline)
                .into_iter()
                .collect()),
            Self::Long(long) => long.stretches(samples, shortest, pipeline),
        }
    }
}

impl LongReady {
    fn stretches(
        &self,
        samples: usize,
        shortest: usize,
        pipeline: &Pipeline,
    ) -> Result<Vec<Trajectory>> {
        let all = self.log.chapters();
        let of = all.min((samples / shortest.max(1)).clamp(1, CHAPTERS));
        let mut kept = Vec::with_capacity(of);
        for i in 0..of {
            let chapter = self.log.chapter((2 * i + 1) * all / (2 * of))?;
            // Chapters that cannot be used are left out, as elsewhere.
            if let Ok(log) = PreparedLog::new(self.joints.clone(), &chapter, pipeline) {
                let log = log.since(self.log.start());
                kept.extend(log.stretches(samples / of, shortest, pipeline));
            }
        }
        Ok(kept)
    }
}

impl PreparedLog<'_> {
    fn stretches(
        &self,
        samples: usize,
        shortest: usize,
        pipeline: &Pipeline,
    ) -> Option<Trajectory> {
        let trajectory = match spread(&self.lengths(), samples, shortest) {
            None => self.align(pipeline, Raw::None),
            Some(stretches) => self.cut(&stretches).align(pipeline, Raw::None),
        };
        trajectory.ok().map(|(trajectory, _)| trajectory)
    }
}

/// Ranges of segments of these lengths, `samples` samples together and none much shorter than `shortest`, evenly spread; `None`: all of them.
fn spread(
    lengths: &[usize],
    samples: usize,
    shortest: usize,
) -> Option<Vec<(usize, Range<usize>)>> {
    let all: usize = lengths.iter().sum();
    if all <= samples {
        return None;
    }
    let (mut seen, mut taken, mut kept) = (0, 0, Vec::new());
    for (segment, &len) in lengths.iter().enumerate() {
        seen += len;
        let due = (samples * seen / all).saturating_sub(taken).min(len);
        // Of many short segments some are kept whole.
        if due < len.min(shortest) {
            continue;
        }
        let stretches = (due / shortest.max(1)).clamp(1, MOST_STRETCHES);
        let (of_each, apart) = (due / stretches, len / stretches);
        kept.extend((0..stretches).map(|i| {
            let from = i * apart + (apart - of_each) / 2;
            (segment, from..from + of_each)
        }));
        taken += stretches * of_each;
    }
    Some(kept)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Enough and not more, in order, inside their segments, none much shorter than asked for.
    #[test]
    fn stretches_are_spread_over_segments_of_any_length() {
        assert_eq!(spread(&[300, 200], 500, 100), None);
        for lengths in [
            vec![100_000],
            vec![50, 90_000, 7, 30_000, 20_000],
            vec![1000; 200],
            vec![20; 5000],
        ] {
            let (samples, shortest) = (20_000, 2000);
            let stretches = spread(&lengths, samples, shortest).unwrap();
            let taken: usize = stretches.iter().map(|(_, range)| range.len()).sum();
            assert!(taken <= samples && taken > samples / 2, "{taken}");
            let mut before = (0, 0);
            for (segment, range) in &stretches {
                let whole = lengths[*segment];
                assert!(range.len() >= whole.min(shortest) && range.end <= whole);
                assert!((*segment, range.start) >= before, "one after the other");
                before = (*segment, range.end);
            }
            // The last stretch lies in the last third of the log.
            let behind: usize = lengths[..before.0].iter().sum();
            let all: usize = lengths.iter().sum();
            assert!(3 * (behind + before.1) > 2 * all);
        }
    }
}
