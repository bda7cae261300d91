//! How fast is inference, on one core and beside what people use today?
use std::time::Instant;
use twincal::infer::{Choice, InferenceSettings, infer};
use twincal::posterior::Problem;
use twincal::prior::{Inclusion, Prior};

fn problem(size: usize) -> Problem {
    let mut state = 88172645463325252u64;
    let mut uniform = move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    let mut normal = move || (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
    let (mut gram, mut xy, mut yy) = (vec![0.0; size * size], vec![0.0; size], 0.0);
    for _ in 0..400 {
        let common = normal();
        let x: Vec<f64> = (0..size).map(|_| 0.7 * common + 0.7 * normal()).collect();
        let y = x[0] - 0.5 * x[3] + 0.3 * x[5] + normal();
        for i in 0..size {
            xy[i] += x[i] * y;
            for j in 0..size {
                gram[i * size + j] += x[i] * x[j];
            }
        }
        yy += y * y;
    }
    Problem {
        gram,
        xy,
        yy,
        n: 400.0,
        log_constant: 0.0,
        names: (0..size).map(|k| format!("{k}")).collect(),
        prior: Prior {
            slab: vec![100.0; size],
            family: vec![0; size],
            inclusion: Inclusion::ExpectedTerms(5.0),
            shape: 1e-3,
            scale: 1e-3,
        },
    }
}

fn main() {
    rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build_global()
        .unwrap();
    for size in [12, 20, 22, 24] {
        let p = problem(size);
        let s = InferenceSettings {
            method: Choice::Exact,
            chains: 4,
            draws: 5000,
            seed: 1,
            allow_disagreement: false,
        };
        let mut best = f64::INFINITY;
        let mut sum = 0.0;
        for _ in 0..if size > 22 { 3 } else { 10 } {
            let t = Instant::now();
            let r = infer(&p, &s).unwrap();
            best = best.min(t.elapsed().as_secs_f64());
            sum += r.inclusion[0];
            if best > 2.0 {
                break;
            }
        }
        println!(
            "{size} {best:.6} s  {:.3} ns/model {sum}",
            best * 1e9 / (1u64 << size) as f64
        );
    }
}
