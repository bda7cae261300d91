use super::*;
use crate::random::Random;

/// Six directions whose torque has rank three: the prior of the torque, Σ image imageᵀ, stays what it was, by three directions.
#[test]
fn what_no_motion_shows_is_left_out_and_the_torque_keeps_its_prior() {
    let mut random = Random::new(4, 0);
    for rank in 0..=6 {
        let directions: Vec<Ten> = (0..6)
            .map(|_| std::array::from_fn(|_| random.normal()))
            .collect();
        // Torque of ten parameters: that of `rank` combinations of the directions' duals alone.
        let seen: Vec<Vec<f64>> = (0..rank)
            .map(|_| (0..10).map(|_| random.normal()).collect())
            .collect();
        let mix: Vec<Vec<f64>> = (0..30)
            .map(|_| (0..rank).map(|_| random.normal()).collect())
            .collect();
        let torque: Vec<Vec<f64>> = (0..10)
            .map(|p| {
                let of = |row: &Vec<f64>| (0..rank).map(|r| row[r] * seen[r][p]).sum();
                mix.iter().map(of).collect()
            })
            .collect();
        let own = split(&directions, &torque);
        let shown = if rank == 0 { 6 } else { rank };
        assert_eq!(own.shown.len(), shown, "rank {rank}");
        let kernel = |directions: &[Ten], i: usize, j: usize| -> f64 {
            let image = |d: &Ten, row: usize| (0..10).map(|p| d[p] * torque[p][row]).sum::<f64>();
            directions.iter().map(|d| image(d, i) * image(d, j)).sum()
        };
        for (i, j) in [(0, 0), (3, 17), (29, 4)] {
            let (before, after) = (kernel(&directions, i, j), kernel(&own.shown, i, j));
            assert!(
                (before - after).abs() < 1e-9 * (1.0 + before.abs()),
                "{before} {after}"
            );
        }
    }
}
