//! The motion of a few chapters of a long log: what looks at a log as it was recorded needs no more.

use crate::signal::filter::trajectory::Trajectory;

/// Chapters whose motion is kept, and samples of them together, about: raw scores, the lag and the self-check look at no more.
const CHAPTERS: usize = 16;
const SAMPLES: usize = 1 << 16;

/// Motion of evenly spread chapters.
#[derive(Debug)]
pub(crate) struct FewChapters {
    /// Chapters of the log.
    all: usize,
    /// Whether one was taken, by stretch of the log.
    taken: Vec<bool>,
    kept: Option<Trajectory>,
}

impl FewChapters {
    /// Of a log of so many chapters.
    pub(crate) fn new(chapters: usize) -> Self {
        Self {
            all: chapters,
            taken: vec![false; chapters.min(CHAPTERS)],
            kept: None,
        }
    }

    /// Takes the motion of a chapter, if none was taken from its stretch of the log.
    pub(crate) fn take(&mut self, chapter: usize, trajectory: Trajectory) {
        let stretches = self.taken.len();
        let taken = &mut self.taken[chapter * stretches / self.all];
        if std::mem::replace(taken, true) {
            return;
        }
        let mut trajectory = trajectory.thinned_out(SAMPLES / stretches);
        match &mut self.kept {
            Some(kept) => kept.segments.append(&mut trajectory.segments),
            None => self.kept = Some(trajectory),
        }
    }

    /// What was taken; `None` if nothing was.
    pub(crate) fn into_trajectory(self) -> Option<Trajectory> {
        self.kept
    }
}
