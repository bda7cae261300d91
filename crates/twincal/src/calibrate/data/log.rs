//! One log as rows.

use super::log_summary::LogSummary;
use crate::gram::Gram;
use crate::incidents::Incident;
use crate::observations::Observations;

/// One log, ready.
pub(in crate::calibrate) struct Log {
    /// Contacts and protective stops, which are left out.
    pub(in crate::calibrate) incidents: Vec<Incident>,
    pub(in crate::calibrate) observations: Observations,
    pub(in crate::calibrate) summary: LogSummary,
    /// First and last stamp, s from `origin` on.
    pub(in crate::calibrate) ends: [f64; 2],
    /// Where stamps count from, s: since 1970 for a bag, 0 where they say that themselves.
    pub(in crate::calibrate) origin: f64,
    /// Of a log in chapters, statistics at the cut-offs of the sweep with nothing left out: made while its chapters were there.
    pub(in crate::calibrate) elsewhere: Vec<Option<Gram>>,
}
