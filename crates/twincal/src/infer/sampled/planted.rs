//! Planted bugs: mistakes that are easy to make, each behind a switch that exists in tests only, so that the tests can show that
//! they would see it.

/// The right value; in tests the wrong one while bug number `$bug` is switched on.
macro_rules! planted {
    ($bug:expr, $right:expr, $wrong:expr) => {{
        #[cfg(test)]
        let value = if crate::infer::sampled::planted::is_on($bug) {
            $wrong
        } else {
            $right
        };
        #[cfg(not(test))]
        let value = $right;
        value
    }};
}

pub(super) use planted;

/// What each number is.
#[cfg(test)]
pub(super) const BUGS: [&str; 12] = [
    "the slab's mass above its bounds is forgotten",
    "the determinant enters without its square root",
    "a component counts itself among the others of its family",
    "an exchange does not pay for what leaves",
    "the stationary start of a run is forgotten in ρ",
    "σ² counts every row twice",
    "the ends of runs are forgotten in the AR(1) form",
    "bounded coefficients stay in the torque that free ones explain",
    "a bounded coefficient is drawn without its bound",
    "the precision is that of independent rows",
    "slices have no height",
    "b0 is forgotten",
];

#[cfg(test)]
std::thread_local! {
    static ON: std::cell::Cell<Option<usize>> = const { std::cell::Cell::new(None) };
}

/// Whether a bug is switched on in this thread.
#[cfg(test)]
pub(super) fn is_on(bug: usize) -> bool {
    ON.get() == Some(bug)
}

/// Runs something with a bug.
#[cfg(test)]
pub(super) fn with<T>(bug: usize, run: impl FnOnce() -> T) -> T {
    ON.set(Some(bug));
    let value = run();
    ON.set(None);
    value
}
