//! One log as rows.

use super::log_summary::LogSummary;
use crate::gram::Gram;
use crate::incidents::Incident;
use crate::observations::Observations;

/// One log, ready.
pub(super) struct Log {
    /// Contacts and protective stops, which are left out.
    pub(super) incidents: Vec<Incident>,
    pub(super) observations: Observations,
    pub(super) summary: LogSummary,
    /// First and last stamp, s.
    pub(super) ends: [f64; 2],
    /// Of a log in chapters, statistics at the cut-offs of the sweep with nothing left out: made while its chapters were there.
    pub(super) elsewhere: Vec<Option<Gram>>,
}
