//! How benches take time: CPU seconds, which other people's work on the machine does not add to.

use std::time::Instant;

/// CPU seconds that all threads of this process have used; wall-clock where the system does not tell.
pub(crate) fn cpu_seconds(start: Instant) -> f64 {
    // The system writes a thread's time down when it leaves the core, or some milliseconds later.
    std::thread::yield_now();
    let of_thread = |path: std::path::PathBuf| -> Option<f64> {
        let text = std::fs::read_to_string(path.join("schedstat")).ok()?;
        Some(text.split_whitespace().next()?.parse::<f64>().ok()? * 1e-9)
    };
    std::fs::read_dir("/proc/self/task")
        .map(|tasks| {
            tasks
                .flatten()
                .filter_map(|task| of_thread(task.path()))
                .sum::<f64>()
        })
        .ok()
        .filter(|&seconds| seconds > 0.0)
        .unwrap_or_else(|| start.elapsed().as_secs_f64())
}

/// Least CPU time of `repeats` runs, and the last answer.
pub(crate) fn least<T>(repeats: usize, mut run: impl FnMut() -> T) -> (f64, T) {
    let start = Instant::now();
    let mut timed = || {
        let before = cpu_seconds(start);
        let answer = run();
        (cpu_seconds(start) - before, answer)
    };
    let (mut best, mut answer) = timed();
    for _ in 1..repeats {
        let (seconds, last) = timed();
        best = best.min(seconds);
        answer = last;
    }
    (best, answer)
}
