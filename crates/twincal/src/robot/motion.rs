//! Motion of samples, as the batched algorithms read it.

/// Motion of `len` samples in structure-of-arrays form: `q[joint * len + sample]`. SI units.
#[derive(Debug, Clone, Copy)]
pub struct Motion<'a> {
    /// Number of samples.
    pub len: usize,
    /// Positions, dof × len, rad or m.
    pub q: &'a [f64],
    /// Velocities, dof × len.
    pub qd: &'a [f64],
    /// Accelerations, dof × len.
    pub qdd: &'a [f64],
}
