//! How fast is inference on one core, and beside what people use today? `cargo bench -p twincal --bench inference`
//!
//! Times are CPU time of this process, the least of several runs. Peers run in the same minute with the project's
//! Python environment (`.venv`), if it is there.
#![allow(clippy::print_stdout, reason = "a bench prints its table")]

mod common;

use common::least;
use std::process::Command;
use twincal::gram::{JointAccumulator, Workspace};
use twincal::infer::{Choice, InferenceSettings, approximate, infer, scan};
use twincal::posterior::{Method, Problem};
use twincal::prior::{Inclusion, Prior};

/// Columns with pairwise correlation `correlation`, one after the other, and what a few of them make with effects of the given size,
/// with white noise; effects near 0 keep every model in play.
fn rows(size: usize, rows: usize, correlation: f64, effect: f64) -> (Vec<f64>, Vec<f64>) {
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
    let (mut columns, mut y) = (vec![0.0; size * rows], Vec::with_capacity(rows));
    for row in 0..rows {
        let common = normal();
        let x: Vec<f64> = (0..size)
            .map(|_| correlation.sqrt() * common + (1.0 - correlation).sqrt() * normal())
            .collect();
        y.push(effect * (x[0] - 0.5 * x[3] + 0.3 * x[5] + 0.2 * x[7]) + normal());
        (0..size).for_each(|k| columns[k * rows + row] = x[k]);
    }
    (columns, y)
}

/// The question that rows ask: their sums, as a fit makes them, and the prior.
fn question(size: usize, columns: &[f64], y: &[f64]) -> Problem {
    let mut sums = JointAccumulator::new((0..size as u32).collect());
    let keep = vec![true; y.len()];
    sums.push_block(columns, y.len(), y, &keep, true, &mut Workspace::default());
    let sums = sums.finish();
    let at = |i: usize, j: usize| sums.s0.at(i, j);
    Problem {
        gram: (0..size * size)
            .map(|cell| at(cell / size, cell % size))
            .collect(),
        xy: (0..size).map(|k| at(k, size)).collect(),
        yy: at(size, size),
        n: sums.n,
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

fn problem(size: usize, correlation: f64, effect: f64) -> Problem {
    let (columns, y) = rows(size, 2000, correlation, effect);
    question(size, &columns, &y)
}

/// A seven-joint arm: a payload (10 columns) that the last link's mass moments and tensor nearly repeat, seven links (4 + 6
/// columns each) and 30 single columns, K = 110 in C = 45; every second component acts.
fn arm(size: usize) -> Problem {
    let mut sizes = vec![10];
    (0..7).for_each(|_| sizes.extend([4, 6]));
    sizes.extend([1; 30]);
    let base = problem(110, 0.2, 0.0);
    let component: Vec<usize> = sizes
        .iter()
        .enumerate()
        .flat_map(|(c, &len)| std::iter::repeat_n(c, len))
        .collect();
    // x_payload = x_last + 0.1 · noise: columns 0..10 and 70..80.
    let gram = (0..10).fold(base.gram, |gram, k| nearly_repeated(&gram, 70 + k, k));
    let mut noise = base.xy.clone();
    (0..10).for_each(|k| noise[k] = noise[70 + k] + 0.1 * noise[k]);
    let beta: Vec<f64> = component
        .iter()
        .enumerate()
        .map(|(k, c)| match c % 2 {
            0 => 0.0,
            _ => 0.06 * (1.0 + (k % 3) as f64),
        })
        .collect();
    let signal: Vec<f64> = (0..110)
        .map(|i| (0..110).map(|j| gram[i * 110 + j] * beta[j]).sum())
        .collect();
    let xy: Vec<f64> = signal.iter().zip(&noise).map(|(s, e)| s + e).collect();
    let yy = base.yy
        + (0..110)
            .map(|k| beta[k] * (signal[k] + 2.0 * noise[k]))
            .sum::<f64>();
    // Only the first components, with all that they explain.
    let columns = component.iter().filter(|&&c| c < size).count();
    let keep = |i: usize| (0..columns).map(move |j| (i, j));
    Problem {
        gram: (0..columns)
            .flat_map(keep)
            .map(|(i, j)| gram[i * 110 + j])
            .collect(),
        xy: xy[..columns].to_vec(),
        yy,
        names: base.names[..columns].to_vec(),
        prior: Prior {
            parent: Vec::new(),
            slab: vec![10.0; columns],
            component: component[..columns].to_vec(),
            family: (0..size)
                .map(|c| if c < 15 { c.min(1) } else { 2 })
                .collect(),
            odds: vec![1.0; 3],
            lower: vec![f64::NEG_INFINITY; columns],
            halves: Vec::new(),
            inclusion: Inclusion::ExpectedTerms(size as f64 / 3.0),
            shape: 1e-3,
            scale: 1e-3,
        },
        ..base
    }
}

/// The Gram of 110 columns behind `x_to ← x_from + 0.1 · x_to`.
fn nearly_repeated(gram: &[f64], from: usize, to: usize) -> Vec<f64> {
    let mut out = gram.to_vec();
    for i in 0..110 {
        out[i * 110 + to] = gram[i * 110 + from] + 0.1 * gram[i * 110 + to];
    }
    let half = out.clone();
    for j in 0..110 {
        out[to * 110 + j] = half[from * 110 + j] + 0.1 * half[to * 110 + j];
    }
    out
}

/// The rows about components.
fn components() {
    let problem = arm(45);
    let (seconds, exact) = least(3, || {
        infer(&problem, &settings(Choice::Auto, 5000)).expect("auto")
    });
    let how = match exact.method {
        Method::Exact { .. } => "exact",
        _ => "sampled",
    };
    println!(
        "{:<44} {seconds:>10.6} {how}",
        "arm/110 columns in 45 components/auto"
    );
    let (seconds, sampled) = least(2, || {
        infer(&problem, &settings(Choice::Gibbs, 5000)).expect("gibbs")
    });
    if let Method::Gibbs { ess, r_hat, .. } = sampled.method {
        println!(
            "{:<44} {seconds:>10.6} ESS {ess:.0}, R-hat {r_hat:.4}",
            "arm/the same/gibbs, 4 chains of 5000"
        );
    }
    for (name, warm) in [("cold", None), ("warm", Some(&exact))] {
        let (seconds, found) = least(5, || approximate(&problem, warm).expect("search"));
        let worst = (0..110)
            .map(|k| (found.inclusion[k] - exact.inclusion[k]).abs())
            .fold(0.0, f64::max);
        let Method::Search { models, missing } = found.method else {
            continue;
        };
        println!(
            "{:<44} {seconds:>10.6} {models} models, {missing:.1e} missing, PIPs within {worst:.1e}",
            format!("arm/the same/search, {name}")
        );
    }
}

/// How far the worst of 200 probabilities is off after half a second on one core, beside chains forty times as long from another seed.
fn worst_errors() {
    const SECONDS: f64 = 0.5;
    for (correlation, effect) in [(0.5, 0.3), (0.9, 0.3), (0.9, 1.0)] {
        let problem = problem(200, correlation, effect);
        let gibbs = |draws: usize, seed: u64| {
            let asked = InferenceSettings {
                seed,
                allow_disagreement: true,
                ..settings(Choice::Gibbs, draws)
            };
            infer(&problem, &asked).expect("gibbs")
        };
        let (short, _) = least(1, || gibbs(1000, 1));
        let (long, _) = least(1, || gibbs(5000, 1));
        let each = (long - short) / 4000.0;
        let draws = (1000.0 + (SECONDS - short) / each).max(1000.0) as usize;
        let (seconds, own) = least(1, || gibbs(draws, 1));
        let reference = gibbs(40 * draws, 2);
        let worst = |values: &mut dyn Iterator<Item = f64>| values.fold(0.0, f64::max);
        let off = own.inclusion.iter().zip(&reference.inclusion);
        let off = worst(&mut off.map(|(a, b)| (a - b).abs()));
        let sure = worst(&mut reference.inclusion_mcse.iter().copied());
        let open = (reference.inclusion.iter()).filter(|pip| (0.05..0.95).contains(*pip));
        println!(
            "{:<44} {seconds:>10.6} worst PIP off by {off:.4} (reference: largest MCSE {sure:.4}, {} of 200 between 0.05 and 0.95)",
            format!("gibbs/200 columns/{correlation}/effect {effect}"),
            open.count()
        );
    }
}

fn main() {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .expect("one thread");
    println!("{:<44} {:>10}", "one core, CPU time", "seconds");
    pool.install(enumeration);
    pool.install(gibbs_scans);
    pool.install(worst_errors);
    pool.install(judged_chains);
    pool.install(rows_to_probabilities);
    pool.install(components);
    peers();
}

fn settings(method: Choice, draws: usize) -> InferenceSettings {
    InferenceSettings {
        method,
        chains: 4,
        draws,
        seed: 1,
        allow_disagreement: true,
    }
}

/// Time of exact enumeration with slabs and effects of several sizes.
fn enumeration() {
    for (size, slab, effect) in [
        (20, 1e-4, 0.05),
        (24, 1e-4, 0.05),
        (24, 100.0, 0.05),
        (28, 100.0, 0.05),
        (24, 100.0, 1.0),
    ] {
        let mut problem = problem(size, 0.5, effect);
        // So narrow a slab costs nobody anything: every model counts and is visited.
        problem.prior.slab.fill(slab);
        let (seconds, _) = least(7, || {
            infer(&problem, &settings(Choice::Exact, 0)).expect("exact")
        });
        let each = seconds * 1e9 / (1u64 << size) as f64;
        let what = match (slab < 1.0, effect < 0.5) {
            (true, _) => "every model visited",
            (false, true) => "weak effects",
            (false, false) => "four strong effects",
        };
        println!(
            "{:<44} {seconds:>10.6} {each:>9.3} ns/model",
            format!("exact/2^{size}/{what}")
        );
    }
}

/// Speed of scans: the narrower the slab, the more effects are undecided and the more flips a scan has.
fn gibbs_scans() {
    for (size, scans, correlation, effect, slab) in [
        (24, 400_000, 0.5, 1.0, 100.0),
        (24, 400_000, 0.9, 1.0, 100.0),
        (24, 400_000, 0.9, 0.3, 3.0),
        (50, 100_000, 0.5, 1.0, 100.0),
        (50, 100_000, 0.9, 1.0, 100.0),
        (200, 10_000, 0.5, 1.0, 100.0),
        (200, 10_000, 0.9, 1.0, 100.0),
        (200, 10_000, 0.9, 0.1, 0.1),
        (200, 10_000, 0.9, 0.1, 0.05),
        (200, 10_000, 0.9, 0.05, 0.02),
    ] {
        let mut problem = problem(size, correlation, effect);
        problem.prior.slab.fill(slab);
        let (seconds, flips) = least(5, || scan(&problem, scans, 1).expect("scans"));
        let (rate, flips) = (scans as f64 / seconds, 2.0 * flips as f64 / scans as f64);
        let name = format!("gibbs/{size} columns/{correlation}/effect {effect}/slab {slab}");
        println!(
            "{name:<44} {seconds:>10.6} {:>9.3} M scans/s, {flips:.2} flips per scan",
            rate * 1e-6
        );
    }
}

/// Time of a whole sampled answer with its own checks.
fn judged_chains() {
    let problem = problem(24, 0.5, 1.0);
    let (seconds, posterior) = least(3, || {
        infer(&problem, &settings(Choice::Gibbs, 5000)).expect("gibbs")
    });
    if let Method::Gibbs { ess, r_hat, .. } = posterior.method {
        println!(
            "{:<44} {seconds:>10.6} ESS {ess:.0}, R-hat {r_hat:.4}",
            "gibbs/24 columns/4 chains of 5000, judged"
        );
    }
}

/// Time from rows of white noise to an answer.
fn rows_to_probabilities() {
    let (columns, y) = rows(32, 20_000, 0.5, 1.0);
    let from_rows = || {
        let problem = question(32, &columns, &y);
        infer(&problem, &settings(Choice::Auto, 5000)).expect("an answer")
    };
    let (seconds, _) = least(5, from_rows);
    println!(
        "{:<44} {seconds:>10.6} to probabilities and intervals",
        "20 000 rows of 32 columns, white noise"
    );
}

/// Times of what people use today, measured by a program in Python.
fn peers() {
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
