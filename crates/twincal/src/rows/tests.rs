//! Rows against brute force: a stand-in model whose columns are known functions of the motion.
mod coarser_clock;

use super::evaluate::{Constant, Source};
use super::*;
use crate::lanes::Aligned;
use crate::robot::Motion;
use crate::signal::fir::column_kernel;
use crate::signal::{DerivedFrom, LoggedSamples, Payload, Segment};
use crate::term::Course;

const COLUMNS: [&[usize]; 2] = [&[0, 2, 3], &[1, 2]];
const BETA: [f64; 4] = [0.7, -1.3, 0.25, 2.0];

/// Value of a column at one sample.
fn column(column: usize, q: f64, qd: f64, qdd: f64) -> f64 {
    match column {
        0 => qdd,
        1 => q.sin(),
        2 => qd * qd * q.cos(),
        _ => qd.signum(),
    }
}

struct StandIn {
    recipes: Vec<Arc<Recipes>>,
}

/// What a part of a joint is: its columns in order, but the last one of joint 1 with the one before added.
fn part(joint: usize, part: usize, [q, qd, qdd]: [f64; 3]) -> f64 {
    let value = |c: usize| column(COLUMNS[joint][c], q, qd, qdd);
    if (joint, part) == (1, 1) {
        return value(1) + value(0);
    }
    value(part)
}

impl StandIn {
    fn new() -> Self {
        let recipe = |joint: usize, column: usize| match (joint, column) {
            (1, 1) => vec![(1, 1.0), (0, -1.0)],
            _ => vec![(column, 1.0)],
        };
        let recipes = |joint: usize| {
            let count = COLUMNS[joint].len();
            let columns = (0..count).map(|column| recipe(joint, column));
            Arc::new(Recipes::new(count, columns.collect()))
        };
        Self {
            recipes: (0..2).map(recipes).collect(),
        }
    }

    fn fill(
        motion: Motion<'_>,
        nominal: &mut [f64],
        (stride, out): (usize, &mut [Aligned]),
        of: impl Fn(usize, usize, [f64; 3]) -> f64,
    ) {
        for joint in 0..2 {
            out[joint].resize(COLUMNS[joint].len() * stride);
            for s in 0..motion.len {
                let i = joint * motion.len + s;
                nominal[i] = motion.q[i] * 3.0 - motion.qdd[i];
                for c in 0..COLUMNS[joint].len() {
                    let state = [motion.q[i], motion.qd[i], motion.qdd[i]];
                    out[joint][c * stride + s] = of(joint, c, state);
                }
            }
        }
    }
}

impl Source for StandIn {
    fn columns(&self, joint: usize) -> &[usize] {
        COLUMNS[joint]
    }

    fn recipes(&self, joint: usize) -> &Arc<Recipes> {
        &self.recipes[joint]
    }

    fn evaluate(&mut self, course: Course<'_>, torque: Constant<'_>, out: &mut [Aligned]) {
        let (motion, nominal) = (course.motion, torque.nominal);
        let of = |joint: usize, c: usize, s: [f64; 3]| column(COLUMNS[joint][c], s[0], s[1], s[2]);
        Self::fill(motion, nominal, (motion.len, out), of);
    }

    fn evaluate_parts(
        &mut self,
        course: Course<'_>,
        torque: Constant<'_>,
        stride: usize,
        out: &mut [Aligned],
    ) {
        let (motion, nominal) = (course.motion, torque.nominal);
        Self::fill(motion, nominal, (stride, out), part);
    }
}

fn pipeline(cutoff_hz: f64) -> Pipeline {
    Pipeline {
        cutoff_hz,
        motion_cutoff_hz: 4.0 * cutoff_hz,
        rate_hz: 2.5 * cutoff_hz,
        motion_interval: 0.0,
        coulomb_velocity: 0.02,
        standstill_velocity: vec![0.02; 2],
        derived_from: vec![DerivedFrom::Position; 2],
        velocity_from: Vec::new(),
        corrections: crate::signal::Corrections::default(),
        history: Vec::new(),
    }
}

/// Motion whose torque is exactly nominal + Φβ.
fn trajectory(samples: usize, interval: f64) -> Trajectory {
    let time: Vec<f64> = (0..samples).map(|i| i as f64 * interval).collect();
    let wave = |f: fn(f64, f64) -> f64| -> Vec<f64> {
        (0..2)
            .flat_map(|j| time.iter().map(move |&t| f(t, 1.0 + f64::from(j))))
            .collect()
    };
    let q = wave(|t, a| (a * t).sin() + 0.3 * (4.1 * t).cos());
    let qd = wave(|t, a| a * (a * t).cos() - 1.23 * (4.1 * t).sin());
    let qdd = wave(|t, a| -a * a * (a * t).sin() - 5.043 * (4.1 * t).cos());
    let mut tau = Vec::new();
    for joint in 0..2 {
        for s in 0..samples {
            let i = joint * samples + s;
            let correction: f64 = COLUMNS[joint]
                .iter()
                .map(|&k| BETA[k] * column(k, q[i], qd[i], qdd[i]))
                .sum();
            tau.push(q[i] * 3.0 - qdd[i] + correction);
        }
    }
    let standstill = (0..2 * samples).map(|i| i % 700 < 100).collect();
    let segment = Segment {
        time,
        input_rows: (5..5 + samples).collect(),
        logged: None,
        q,
        qd,
        qdd,
        tau,
        standstill,
        history: Vec::new(),
        interval,
        logged_interval: interval,
    };
    Trajectory {
        name: "stand-in".into(),
        dof: 2,
        segments: vec![segment],
        payload: Payload::None,
        payload_acts: true,
    }
}

/// All rows of joint `joint`: (time, input row, columns…, measured, nominal, standstill).
fn collect(
    trajectory: &Trajectory,
    pipeline: &Pipeline,
    signal: RowSignal,
    chunk: Option<usize>,
) -> Vec<Vec<Vec<f64>>> {
    let all = slices(pipeline, trajectory, signal, f64::NEG_INFINITY, usize::MAX);
    collect_slices(trajectory, pipeline, signal, chunk, &all)
}

/// [`collect`] of some slices.
fn collect_slices(
    trajectory: &Trajectory,
    pipeline: &Pipeline,
    signal: RowSignal,
    chunk: Option<usize>,
    slices: &[Slice],
) -> Vec<Vec<Vec<f64>>> {
    let mut rows = vec![Vec::new(); 2];
    let mut seen_first = false;
    let mut gather = |block: &RowBlock<'_>| {
        assert_eq!(block.first, !seen_first && slices[0].rows.start == 0);
        seen_first = true;
        assert!(block.len <= MAX_BLOCK && block.len == block.time.len());
        for (joint, data) in block.joints.iter().enumerate() {
            for r in 0..block.len {
                let mut row = vec![block.time[r], block.input_rows[r] as f64];
                row.extend((0..data.columns.len()).map(|c| data.x[c * data.stride + r]));
                let standstill = f64::from(u8::from(data.standstill[r]));
                row.extend([data.measured[r], data.nominal[r], standstill]);
                rows[joint].push(row);
            }
        }
        Ok(())
    };
    match chunk {
        Some(chunk) => filtered::visit(
            &mut StandIn::new(),
            pipeline,
            (&slices[0], Form::Columns),
            &trajectory.segments[0],
            2,
            Some(chunk),
            &mut gather,
        )
        .unwrap(),
        None => {
            visit_source(
                &mut StandIn::new(),
                pipeline,
                trajectory,
                signal,
                (slices, Form::Columns),
                &mut gather,
            )
            .unwrap();
        }
    }
    rows
}

/// Rows of parts, followed by their recipes, are the rows of columns: filtered to the bit, as there they are made so.
#[test]
fn rows_of_parts_make_rows_of_columns() {
    let (trajectory, pipeline) = (trajectory(3000, 0.002), pipeline(5.0));
    for signal in [RowSignal::Filtered, RowSignal::Raw] {
        let all = slices(
            &pipeline,
            &trajectory,
            signal,
            f64::NEG_INFINITY,
            usize::MAX,
        );
        let columns_in = |form: Form| {
            let mut columns = vec![Vec::new(); 2];
            let mut gather = |block: &RowBlock<'_>| {
                for (all, rows) in columns.iter_mut().zip(&block.joints) {
                    let mut made = Vec::new();
                    match rows.recipes {
                        Some(recipes) => recipes.combine(rows.x, rows.stride, block.len, &mut made),
                        None => (rows.x.chunks(rows.stride))
                            .for_each(|column| made.extend_from_slice(&column[..block.len])),
                    }
                    all.push(made);
                }
                Ok(())
            };
            let mut source = StandIn::new();
            let slices = (&all[..], form);
            visit_source(
                &mut source,
                &pipeline,
                &trajectory,
                signal,
                slices,
                &mut gather,
            )
            .unwrap();
            columns.concat().concat()
        };
        let (columns, parts) = (columns_in(Form::Columns), columns_in(Form::Parts));
        assert!(columns.len() > 5 * 30);
        assert_eq!(columns.len(), parts.len());
        for (a, b) in columns.iter().zip(&parts) {
            assert!(a == b || signal == RowSignal::Raw && (a - b).abs() < 1e-14);
        }
    }
}

#[test]
fn filtered_rows_are_the_brute_force_convolution_at_kept_samples() {
    let (trajectory, pipeline) = (trajectory(3000, 0.002), pipeline(5.0));
    let rows = collect(&trajectory, &pipeline, RowSignal::Filtered, None);
    let segment = &trajectory.segments[0];
    let kernel = column_kernel(5.0, 0.002);
    let half = kernel.len() / 2;
    // 500 Hz over 12.5 Hz: every 40th sample
    assert_eq!(rows[0].len(), (3000 - kernel.len()) / 40 + 1);
    assert_eq!(
        count_rows(&pipeline, &trajectory, RowSignal::Filtered),
        rows[0].len()
    );
    for (joint, columns) in COLUMNS.iter().enumerate() {
        for (r, row) in rows[joint].iter().enumerate() {
            let centre = half + 40 * r;
            assert_eq!(row[0], segment.time[centre]);
            assert_eq!(row[1], (5 + centre) as f64);
            let convolve = |f: &dyn Fn(usize) -> f64| -> f64 {
                (0..kernel.len())
                    .map(|k| kernel[k] * f(joint * 3000 + centre - half + k))
                    .sum()
            };
            for (c, &k) in columns.iter().enumerate() {
                let expected =
                    convolve(&|i| column(k, segment.q[i], segment.qd[i], segment.qdd[i]));
                assert!(
                    (row[2 + c] - expected).abs() < 1e-13,
                    "joint {joint} row {r} column {k}"
                );
            }
            let measured = row[2 + columns.len()];
            assert!((measured - convolve(&|i| segment.tau[i])).abs() < 1e-13);
            assert_eq!(
                row[4 + columns.len()] != 0.0,
                segment.standstill[joint * 3000 + centre]
            );
        }
    }
}

#[test]
fn filtering_keeps_the_regression_exact() {
    // τ = τ_nom + Φβ sample by sample, so F τ − F τ_nom = (F Φ) β row by row, to rounding.
    let rows = collect(
        &trajectory(4000, 0.001),
        &pipeline(8.0),
        RowSignal::Filtered,
        None,
    );
    for (joint, columns) in COLUMNS.iter().enumerate() {
        assert!(rows[joint].len() > 50);
        for row in &rows[joint] {
            let fitted: f64 = columns
                .iter()
                .enumerate()
                .map(|(c, &k)| BETA[k] * row[2 + c])
                .sum();
            let residual = row[2 + columns.len()] - row[3 + columns.len()];
            assert!((residual - fitted).abs() < 1e-12, "{residual} {fitted}");
        }
    }
}

#[test]
fn chunks_do_not_change_a_bit() {
    let (trajectory, mut pipeline) = (trajectory(5000, 0.001), pipeline(5.0));
    for rate in [12.5, 1000.0, 0.9] {
        pipeline.rate_hz = rate;
        let whole = collect(&trajectory, &pipeline, RowSignal::Filtered, None);
        for chunk in [1, 7, 64, 1000, 100_000] {
            assert!(
                collect(&trajectory, &pipeline, RowSignal::Filtered, Some(chunk)) == whole,
                "chunk {chunk} at {rate} Hz"
            );
        }
    }
}

#[test]
fn slices_do_not_change_a_bit() {
    let (trajectory, mut pipeline) = (trajectory(5000, 0.001), pipeline(5.0));
    for (signal, rate) in [
        (RowSignal::Filtered, 12.5),
        (RowSignal::Filtered, 0.9),
        (RowSignal::Raw, 12.5),
    ] {
        pipeline.rate_hz = rate;
        let whole = collect(&trajectory, &pipeline, signal, None);
        for most in [1, 2, 7, 1000] {
            let all = slices(&pipeline, &trajectory, signal, f64::NEG_INFINITY, most);
            let lengths: Vec<usize> = all.iter().map(|slice| slice.rows.len()).collect();
            assert_eq!(lengths.iter().sum::<usize>(), whole[0].len());
            assert!(lengths.iter().all(|&len| 0 < len && len <= most));
            let mut joined = vec![Vec::new(); 2];
            for slice in all {
                let part = collect_slices(&trajectory, &pipeline, signal, None, &[slice]);
                joined.iter_mut().zip(part).for_each(|(a, b)| a.extend(b));
            }
            assert!(joined == whole, "slices of {most} rows at {rate} Hz");
        }
        let since = 2.345;
        let late = slices(&pipeline, &trajectory, signal, since, 100);
        let rows = collect_slices(&trajectory, &pipeline, signal, None, &late);
        let expected: Vec<_> = (whole[0].iter().filter(|row| row[0] >= since))
            .cloned()
            .collect();
        assert!(rows[0] == expected);
    }
}

#[test]
fn raw_rows_are_every_sample_and_off_is_the_same() {
    let trajectory = trajectory(1000, 0.001);
    let raw = collect(&trajectory, &pipeline(5.0), RowSignal::Raw, None);
    let off = collect(&trajectory, &Pipeline::off(2), RowSignal::Filtered, None);
    assert!(raw == off);
    assert_eq!(raw[0].len(), 1000);
    let segment = &trajectory.segments[0];
    for (i, row) in raw[1].iter().enumerate() {
        assert_eq!(row[1], (5 + i) as f64);
        assert_eq!(row[2], segment.q[1000 + i].sin());
        assert_eq!(row[4], segment.tau[1000 + i]);
    }
}

#[test]
fn raw_rows_of_an_uneven_log_are_its_own_samples() {
    let mut trajectory = trajectory(2000, 0.001);
    let segment = &mut trajectory.segments[0];
    let stamps: Vec<f64> = (0..900)
        .map(|i| 0.3 + 0.001 * (f64::from(i) + 0.4 * f64::from(i).sin()))
        .collect();
    segment.input_rows.clear();
    segment.logged = Some(LoggedSamples {
        input_rows: (300..1200).collect(),
        tau: (0..1800).map(f64::from).collect(),
        time: stamps.clone(),
    });
    let raw = collect(&trajectory, &pipeline(5.0), RowSignal::Raw, None);
    assert_eq!(raw[0].len(), 900);
    for (i, row) in raw[0].iter().enumerate() {
        let t = stamps[i];
        assert_eq!((row[0], row[1], row[5]), (t, 300.0 + i as f64, i as f64));
        // column 0 of joint 0 is q̈
        let qdd = -(t.sin()) - 5.043 * (4.1 * t).cos();
        assert!((row[2] - qdd).abs() < 1e-9, "{}", row[2] - qdd);
    }
    // Filtered rows name the nearest logged row.
    let filtered = collect(&trajectory, &pipeline(5.0), RowSignal::Filtered, None);
    for row in &filtered[0] {
        let nearest = (0..900)
            .min_by(|&a, &b| {
                (stamps[a] - row[0])
                    .abs()
                    .total_cmp(&(stamps[b] - row[0]).abs())
            })
            .unwrap();
        assert_eq!(row[1], 300.0 + nearest as f64);
    }
}

#[test]
fn an_error_of_the_visitor_ends_the_visit() {
    let mut blocks = 0;
    let mut stop = |_: &RowBlock<'_>| {
        blocks += 1;
        Err(crate::Error::Refused {
            problem: "enough".into(),
            remedy: String::new(),
        })
    };
    assert!(
        visit_source(
            &mut StandIn::new(),
            &pipeline(5.0),
            &trajectory(3000, 0.001),
            RowSignal::Raw,
            (
                &[Slice {
                    segment: 0,
                    rows: 0..3000
                }],
                Form::Columns
            ),
            &mut stop
        )
        .is_err()
    );
    assert_eq!(blocks, 1);
}

#[test]
fn spread_pieces_are_all_of_a_short_log_and_evenly_spread_over_a_long_one() {
    let pipeline = pipeline(20.0);
    let rows = |slices: &[Slice]| -> usize { slices.iter().map(|slice| slice.rows.len()).sum() };
    const ALL_RAW: usize = 4 * SPREAD_RAW;
    for samples in [1_000, ALL_RAW] {
        let all = spread_raw(&pipeline, &trajectory(samples, 1e-3), f64::NEG_INFINITY, 8);
        assert_eq!(rows(&all), samples);
    }
    for samples in [ALL_RAW + 1, 3 * ALL_RAW / 2, 10 * ALL_RAW + 77] {
        let long = trajectory(samples, 1e-3);
        let some = spread_raw(&pipeline, &long, f64::NEG_INFINITY, 1);
        assert!(
            rows(&some).abs_diff(SPREAD_RAW) <= 2 * RAW_PIECE,
            "{samples}"
        );
        assert!(some.iter().all(|slice| slice.rows.len() <= RAW_PIECE));
        // No piece twice, no stretch without one.
        let starts: Vec<usize> = some.iter().map(|slice| slice.rows.start).collect();
        let apart = samples as f64 / some.len() as f64;
        assert!(starts.windows(2).all(|w| {
            let gap = (w[1] - w[0]) as f64;
            w[1] > w[0] && (gap - apart).abs() <= 1.01 * RAW_PIECE as f64
        }));
        assert!(starts[0] == 0 && samples - starts[starts.len() - 1] < 2 * apart as usize);
    }
    // Of 500 logs 65 536 rows together, of 5000 logs 64 of each.
    for (logs, each) in [(500, SPREAD_RAW_TOGETHER / 500), (5000, LEAST_RAW)] {
        let log = trajectory(1_000, 1e-3);
        let some = spread_raw(&pipeline, &log, f64::NEG_INFINITY, logs);
        assert!(rows(&some).abs_diff(each) <= 2 * each / 4, "{logs}");
        assert!(some.len() >= 4 && some[some.len() - 1].rows.start >= 600);
    }
}
