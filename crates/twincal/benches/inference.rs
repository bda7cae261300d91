//! How fast is inference on one core, and beside what people use today? `cargo bench -p twincal --bench inference`
//!
//! Times are CPU time of this process, the least of several runs. Peers run in the same minute with the project's
//! Python environment (`.venv`), if it is there.
#![allow(clippy::print_stdout, reason = "a bench prints its table")]

use std::process::Command;
use std::time::Instant;
use twincal::infer::{Choice, InferenceSettings, infer, scan};
use twincal::posterior::{Method, Problem};
use twincal::prior::{Inclusion, Prior};

/// CPU seconds that all threads of this process have used; wall-clock where the system does not tell.
fn cpu_seconds(start: Instant) -> f64 {
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
fn least<T>(repeats: usize, mut run: impl FnMut() -> T) -> (f64, T) {
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

/// Columns with pairwise correlation `correlation`, a few of them true with effects of the given size; effects near 0 keep
/// every model in play.
fn problem(size: usize, correlation: f64, effect: f64) -> Problem {
    let mut state = 88_172_645_463_325_252u64;
    let mut normal = || -> f64 {
        (0..12)
            .map(|_| {
                state ^= state << 13;
                state ^= state >> 7;
                state ^= state << 17;
                (state >> 11) as f64 / (1u64 << 53) as f64
            })
            .sum::<f64>()
            - 6.0
    };
    let rows = 2000;
    let (mut gram, mut xy, mut yy) = (vec![0.0; size * size], vec![0.0; size], 0.0);
    for _ in 0..rows {
        let common = normal();
        let x: Vec<f64> = (0..size)
            .map(|_| correlation.sqrt() * common + (1.0 - correlation).sqrt() * normal())
            .collect();
        let y = effect * (x[0] - 0.5 * x[3] + 0.3 * x[5] + 0.2 * x[7]) + normal();
        for i in 0..size {
            xy[i] += x[i] * y;
            (0..size).for_each(|j| gram[i * size + j] += x[i] * x[j]);
        }
        yy += y * y;
    }
    Problem {
        gram,
        xy,
        yy,
        n: f64::from(rows),
        log_constant: 0.0,
        names: (0..size).map(|k| format!("x{k}")).collect(),
        prior: Prior::single(
            vec![100.0; size],
            (0..size).map(|k| k * 3 / size).collect(),
            Inclusion::ExpectedTerms(5.0),
            (1e-3, 1e-3),
        ),
    }
}

fn main() {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .expect("one thread");
    let settings = |method, draws| InferenceSettings {
        method,
        chains: 4,
        draws,
        seed: 1,
        allow_disagreement: true,
    };
    println!("{:<44} {:>10}", "one core, CPU time", "seconds");
    for (size, effect) in [(20, 0.05), (24, 0.05), (24, 1.0)] {
        let problem = problem(size, 0.5, effect);
        let (seconds, _) = pool.install(|| {
            least(7, || {
                infer(&problem, &settings(Choice::Exact, 0)).expect("exact")
            })
        });
        let each = seconds * 1e9 / (1u64 << size) as f64;
        let what = if effect < 0.5 {
            "every model visited"
        } else {
            "four strong effects"
        };
        println!(
            "{:<44} {seconds:>10.6} {each:>9.3} ns/model",
            format!("exact/2^{size}/{what}")
        );
    }
    for (size, scans) in [(24, 400_000), (50, 100_000), (200, 10_000)] {
        for correlation in [0.5, 0.9] {
            let problem = problem(size, correlation, 1.0);
            let (seconds, flips) =
                pool.install(|| least(5, || scan(&problem, scans, 1).expect("scans")));
            let (rate, flips) = (scans as f64 / seconds, 2.0 * flips as f64 / scans as f64);
            let name = format!("gibbs/{size} columns/correlation {correlation}");
            println!(
                "{name:<44} {seconds:>10.6} {:>9.3} M scans/s, {flips:.2} flips per scan",
                rate * 1e-6
            );
        }
    }
    let problem = problem(24, 0.5, 1.0);
    let (seconds, posterior) = pool.install(|| {
        least(3, || {
            infer(&problem, &settings(Choice::Gibbs, 5000)).expect("gibbs")
        })
    });
    if let Method::Gibbs { ess, r_hat, .. } = posterior.method {
        println!(
            "{:<44} {seconds:>10.6} ESS {ess:.0}, R-hat {r_hat:.4}",
            "gibbs/24 columns/4 chains of 5000, judged"
        );
    }
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
    match Command::new(format!("{root}/.venv/bin/python"))
        .arg(format!("{root}/benches/peers/inference.py"))
        .output()
    {
        Ok(output) if output.status.success() => {
            print!("{}", String::from_utf8_lossy(&output.stdout))
        }
        Ok(output) => println!("peers failed: {}", String::from_utf8_lossy(&output.stderr)),
        Err(_) => println!("peers skipped: no .venv (./check makes it)"),
    }
}
