//! Random damage to good models.

use super::{MJCF, URDF, build};
use proptest::prelude::*;

proptest! {
    #![proptest_config(ProptestConfig { cases: 3000, rng_seed: proptest::test_runner::RngSeed::Fixed(11),
        failure_persistence: None, ..ProptestConfig::default() })]

    /// Whatever bytes stand in the file: an answer or a refusal, never a panic.
    #[test]
    fn mutated_models_never_panic(
        urdf in any::<bool>(),
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<prop::sample::Index>(), 0usize..6, any::<u8>()), 1..8),
    ) {
        let mut bytes = if urdf { URDF } else { MJCF }.as_bytes().to_vec();
        for (at, to, kind, byte) in edits {
            let at = at.index(bytes.len());
            let to = at + to.index(bytes.len() - at);
            match kind {
                0 => bytes[at] = byte,
                1 => bytes.insert(at, b"<>\"'/&= -0e"[byte as usize % 11]),
                2 => drop(bytes.drain(at..to.min(at + 12))),
                3 => { let copy = bytes[at..to.min(at + 200)].to_vec(); bytes.splice(at..at, copy); }
                4 => bytes.truncate(at.max(1)),
                _ => { let word: &[u8] = [&b"1e999"[..], b"nan", b"-1", b"0 0 0", b"&#0;", b"\xf0\x9f\x92\xa9"][byte as usize % 6]; bytes.splice(at..to.min(at + 3), word.iter().copied()); }
            }
            if bytes.is_empty() { bytes.push(b'<'); }
        }
        if let Ok((robot, _)) = build("mutated", &bytes) {
            let n = robot.dof();
            let mut tau = vec![0.0; n];
            let mut workspace = twincal::robot::Workspace::new(&robot);
            twincal::robot::inverse_dynamics(&robot, &mut workspace, &vec![0.1; n], &vec![0.2; n], &vec![0.3; n], &mut tau);
        }
    }
}
