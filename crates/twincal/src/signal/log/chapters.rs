//! Walks through the chapters of a log: each by itself, or between its neighbours. What chapters say of themselves is said once for the
//! log, see [`told_once`].

use super::long::LongLog;
use super::recording::Recording;
use crate::error::{Code, Error, Finding, Result, Severity};

/// Share of the samples in chapters that cannot be used beyond which the log counts as degraded.
const LEFT_OUT_LIMIT: f64 = 0.01;

/// A chapter between its neighbours.
#[derive(Debug)]
pub(in crate::signal) struct Place<'a> {
    pub(in crate::signal) before: Option<&'a Recording>,
    pub(in crate::signal) chapter: &'a Recording,
    pub(in crate::signal) after: Option<&'a Recording>,
}

impl LongLog {
    /// Visits all chapters in order, by their number; one that cannot be used is left out, and said, unless none can.
    ///
    /// # Errors
    /// Of chapters that cannot be read, the first of all if no chapter can be used, and any that is not about the log.
    pub fn visit(
        &self,
        findings: &mut Vec<Finding>,
        mut visit: impl FnMut(usize, &Recording, &mut Vec<Finding>) -> Result<()> + Send,
    ) -> Result<()> {
        self.walk(false, findings, |number, place, said| {
            visit(number, place.chapter, said)
        })
    }

    /// Visits all chapters in order, with their neighbours where these are asked for.
    pub(in crate::signal) fn walk(
        &self,
        neighbours: bool,
        findings: &mut Vec<Finding>,
        mut visit: impl FnMut(usize, &Place<'_>, &mut Vec<Finding>) -> Result<()> + Send,
    ) -> Result<()> {
        let chapters = self.chapters();
        let (mut said, mut unused) = (Vec::new(), Vec::new());
        let read = |chapter: usize| {
            (chapter < chapters)
                .then(|| self.chapter(chapter))
                .transpose()
        };
        let mut before = None;
        let mut next = read(0)?;
        let mut after = if neighbours { read(1)? } else { None };
        for number in 0..chapters {
            let Some(chapter) = next.take() else {
                break;
            };
            let place = Place {
                before: before.as_ref(),
                chapter: &chapter,
                after: after.as_ref(),
            };
            let mut of_chapter = Vec::new();
            // The next chapter is read meanwhile.
            let (visited, ahead) = rayon::join(
                || visit(number, &place, &mut of_chapter),
                || read(number + 1 + usize::from(neighbours)),
            );
            let ahead = ahead?;
            // What cannot be put away is no fault of the chapter.
            if let Some(failure) = self.shelf.as_ref().and_then(|shelf| shelf.failure()) {
                return Err(failure);
            }
            match visited {
                Ok(()) => said.extend(of_chapter.into_iter().map(|finding| (number, finding))),
                Err(unusable @ (Error::Log { .. } | Error::Unit { .. })) => {
                    unused.push((number, unusable));
                }
                Err(other) => return Err(other),
            }
            if neighbours {
                before = Some(chapter);
                next = std::mem::replace(&mut after, ahead);
            } else {
                next = ahead;
            }
        }
        findings.extend(self.folding.findings(&self.name));
        findings.extend(told_once(said, chapters));
        findings.extend(self.left_out(unused)?);
        Ok(())
    }

    /// That these chapters cannot be used; the first one's error where they are all.
    fn left_out(&self, unused: Vec<(usize, Error)>) -> Result<Option<Finding>> {
        let (chapters, count) = (self.chapters(), unused.len());
        let rows: u64 = (unused.iter())
            .map(|(chapter, _)| self.samples[*chapter] as u64)
            .sum();
        let Some((chapter, first)) = unused.into_iter().next() else {
            return Ok(None);
        };
        if count == chapters {
            return Err(first);
        }
        let all: usize = self.samples.iter().sum();
        let severity = if rows as f64 > LEFT_OUT_LIMIT * all as f64 {
            Severity::Degraded
        } else {
            Severity::Warning
        };
        let finding = Finding::new(
            severity,
            Code::ChaptersLeftOut,
            &self.name,
            format!(
                "{count} of {chapters} chapters cannot be used and were left out; the first is number {}: {}",
                chapter + 1,
                first.without_log()
            ),
            rows,
        )
        .with([
            ("chapters_left_out", count as f64),
            ("chapters", chapters as f64),
            ("first_chapter", (chapter + 1) as f64),
        ]);
        Ok(Some(finding))
    }

    /// That it is long, as a note; `cut`: filters end where chapters do.
    pub fn say(&self, cut: bool) -> Finding {
        let samples: usize = self.samples.iter().sum();
        let ends = if cut { ", each cut at its ends" } else { "" };
        Finding::new(
            Severity::Note,
            Code::Chapters,
            &self.name,
            format!(
                "the log is long ({samples} samples) and was read in {} chapters of up to {} samples{ends}",
                self.chapters(),
                self.samples.iter().max().unwrap_or(&0),
            ),
            samples as u64,
        )
        .with([
            ("chapters", self.chapters() as f64),
            ("samples_at_most", self.samples.iter().max().copied().unwrap_or(0) as f64),
        ])
    }
}

/// What the chapters of a log say (chapter, finding), said once: findings of one code about one thing are one, in the words of the
/// chapter where it matters most.
pub(crate) fn told_once(said: Vec<(usize, Finding)>, chapters: usize) -> Vec<Finding> {
    let mut groups: Vec<Vec<(usize, Finding)>> = Vec::new();
    for (chapter, finding) in said {
        let alike = |group: &&mut Vec<(usize, Finding)>| {
            let first = &group[0].1;
            let thing = |own: &Finding| (own.code, own.subject.clone(), own.joint.clone());
            thing(first) == thing(&finding)
        };
        match groups.iter_mut().find(alike) {
            Some(group) => group.push((chapter, finding)),
            None => groups.push(vec![(chapter, finding)]),
        }
    }
    groups
        .into_iter()
        .filter_map(|group| {
            let count: u64 = group.iter().map(|(_, finding)| finding.count).sum();
            let others = group.len() - 1;
            let rank = |(chapter, finding): &(usize, Finding)| {
                (finding.severity, finding.count, std::cmp::Reverse(*chapter))
            };
            let (chapter, worst) = group.into_iter().max_by_key(rank)?;
            let place = format!("in chapter {} of {chapters}", chapter + 1);
            let more = match others {
                0 => String::new(),
                1 => "; one more is alike".to_owned(),
                others => format!("; {others} more are alike"),
            };
            let numbers = [
                ("chapter", (chapter + 1) as f64),
                ("chapters", chapters as f64),
                ("chapters_alike", others as f64),
            ];
            let told = Finding {
                message: format!("{} ({place}{more})", worst.message),
                count,
                ..worst
            };
            Some(told.with(numbers))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn findings_of_chapters_are_told_once_in_the_words_of_the_worst() {
        let finding = |severity, joint: &str, count| {
            Finding::new(
                severity,
                Code::Standstill,
                "run",
                format!("joint `{joint}` rests {count}"),
                count,
            )
            .of_joint(joint)
        };
        let said = vec![
            (0, finding(Severity::Note, "elbow", 10)),
            (0, finding(Severity::Note, "wrist", 1)),
            (1, finding(Severity::Warning, "elbow", 5)),
            (3, finding(Severity::Note, "elbow", 20)),
        ];
        let told = told_once(said, 4);
        let words: Vec<(&str, u64, Severity)> = told
            .iter()
            .map(|f| (f.message.as_str(), f.count, f.severity))
            .collect();
        assert_eq!(
            words,
            [
                (
                    "joint `elbow` rests 5 (in chapter 2 of 4; 2 more are alike)",
                    35,
                    Severity::Warning
                ),
                (
                    "joint `wrist` rests 1 (in chapter 1 of 4)",
                    1,
                    Severity::Note
                ),
            ]
        );
    }
}
