//! The report in the user's browser, by the program that the system has for that.

use crate::terminal::Terminal;
use std::io;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// The system's program that opens a file with what the user chose for its kind.
pub(super) const OPENER: &str = if cfg!(target_os = "macos") {
    "open"
} else {
    "xdg-open"
};
/// An opener that failed has said so by then; one that runs on is the browser itself.
const PATIENCE: Duration = Duration::from_secs(2);

/// Opens a page; that it cannot be opened is a note, because the page itself is there.
pub(super) fn open(page: &Path, terminal: &mut Terminal) {
    if let Err(error) = opened(page) {
        terminal.note(&format!(
            "note: cannot open {} with {OPENER}: {error}",
            page.to_string_lossy()
        ));
    }
}

fn opened(page: &Path) -> io::Result<()> {
    // An absolute path is never read as a flag.
    let mut child = Command::new(OPENER)
        .arg(std::path::absolute(page)?)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()?;
    let began = Instant::now();
    while began.elapsed() < PATIENCE {
        match child.try_wait()? {
            Some(status) if status.success() => return Ok(()),
            Some(status) => return Err(io::Error::other(status.to_string())),
            None => std::thread::sleep(Duration::from_millis(20)),
        }
    }
    Ok(())
}
