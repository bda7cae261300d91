//! Logs become rows: filters, corrections, history, and one log or chapter after the other behind them.

pub(super) mod aligned;
pub(super) mod all_logs;
pub(super) mod cross_checked;
pub(super) mod facts;
pub(super) mod history;
pub(super) mod log;
pub(super) mod log_summary;
pub(super) mod other_cutoffs;
pub(super) mod reader;
pub(super) mod room;
