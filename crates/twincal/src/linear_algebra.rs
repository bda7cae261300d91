//! Dense linear algebra: the one module that knows the linear-algebra crate (faer). Slices in, slices out, row-major.
