//! What a problem must be before its posterior can be computed.

use crate::error::{Error, Result};
use crate::posterior::Problem;
use crate::prior::{Inclusion, Prior};

/// Most values of the sum behind heredity: it is done anew for every problem.
const HEREDITY_VALUES: f64 = 1e5;

/// Sizes that fit, numbers that are numbers, a prior that is one.
///
/// # Errors
/// [`Error::NotFinite`] naming the column, [`Error::Setting`] for an impossible prior.
pub(super) fn check(problem: &Problem) -> Result<()> {
    check_sizes(problem)?;
    check_components(&problem.prior)?;
    check_heredity(&problem.prior)?;
    check_bounds(problem)?;
    check_columns(problem)?;
    check_totals(problem)?;
    check_noise_prior(problem)?;
    check_inclusion(problem)
}

/// Every array belongs to the same K columns.
fn check_sizes(problem: &Problem) -> Result<()> {
    let (size, prior) = (problem.xy.len(), &problem.prior);
    let fits = problem.gram.len() == size * size
        && problem.names.len() == size
        && prior.slab.len() == size
        && prior.component.len() == size
        && prior.lower.len() == size;
    if fits {
        return Ok(());
    }
    Err(Error::Setting {
        key: "problem".into(),
        problem: format!(
            "{size} right-hand sides, {} matrix entries, {} names, {} slabs, {} components, {} bounds",
            problem.gram.len(),
            problem.names.len(),
            prior.slab.len(),
            prior.component.len(),
            prior.lower.len()
        ),
        remedy: "all must belong to the same K columns".into(),
    })
}

/// Every column has a component, every component a column and a family.
fn check_components(prior: &Prior) -> Result<()> {
    let components = prior.components();
    let mut occurs = vec![false; components];
    let inside = prior
        .component
        .iter()
        .all(|&c| occurs.get_mut(c).map(|o| *o = true).is_some());
    if !inside || occurs.contains(&false) || prior.family.iter().any(|&f| f >= prior.families()) {
        return Err(Error::Setting {
            key: "problem".into(),
            problem: format!(
                "{components} components of {} families do not match the columns",
                prior.families()
            ),
            remedy: "every column needs a component, every component a column and a family".into(),
        });
    }
    Ok(())
}

/// Parents are components, none is its own ancestor, and the sum over them is small enough.
fn check_heredity(prior: &Prior) -> Result<()> {
    let components = prior.components();
    let ancestors = |c: usize| {
        std::iter::successors(prior.parent_of(c), |&p| prior.parent_of(p)).take(components + 1)
    };
    let known = prior.parent.is_empty() || prior.parent.len() == components;
    if !known || prior.parent.iter().flatten().any(|&p| p >= components) {
        return Err(Error::Setting {
            key: "problem".into(),
            problem: format!("{} parents for {components} components", prior.parent.len()),
            remedy: "every component has one of the components for its parent, or none".into(),
        });
    }
    if (0..components).any(|c| ancestors(c).any(|a| a == c)) {
        return Err(Error::Setting {
            key: "prior.heredity".into(),
            problem: "a component is its own ancestor".into(),
            remedy: "leave out one of the pairs that lead back to it".into(),
        });
    }
    let values = prior.heredity_values();
    if values > HEREDITY_VALUES {
        return Err(Error::Setting {
            key: "prior.heredity".into(),
            problem: format!(
                "pairs that hang together bind so many families that their prior takes {values:.0} numbers"
            ),
            remedy: format!(
                "bind fewer families to each other: up to {HEREDITY_VALUES:.0} numbers are kept, Π (components + 1) over the families"
            ),
        });
    }
    Ok(())
}

/// Every bound allows 0.
fn check_bounds(problem: &Problem) -> Result<()> {
    let lower = &problem.prior.lower;
    if let Some(k) = (0..lower.len()).find(|&k| lower[k].is_nan() || lower[k] > 0.0) {
        return Err(Error::Setting {
            key: "prior.lower".into(),
            problem: format!(
                "`{}` must be at least {}, which forbids 0",
                problem.names[k], lower[k]
            ),
            remedy: "give a bound that is not above 0: being out means exactly 0".into(),
        });
    }
    Ok(())
}

/// The error of a number that is none.
fn not_finite(what: &str, column: &str) -> Error {
    Error::NotFinite {
        what: what.into(),
        column: column.into(),
        remedy: "look for samples that are not numbers, or columns that grow beyond 1e150".into(),
    }
}

/// Products and slab variance of every column are numbers.
fn check_columns(problem: &Problem) -> Result<()> {
    let size = problem.xy.len();
    for k in 0..size {
        let diagonal = problem.gram[k * size + k];
        if diagonal < 0.0
            || problem.gram[k * size..(k + 1) * size]
                .iter()
                .any(|x| !x.is_finite())
        {
            return Err(not_finite("the Gram matrix", &problem.names[k]));
        }
        if !problem.xy[k].is_finite() {
            return Err(not_finite(
                "the product with the residual torque",
                &problem.names[k],
            ));
        }
        let slab = problem.prior.slab[k];
        if diagonal > 0.0 && !(slab > 0.0 && slab.is_finite()) {
            return Err(not_finite("the slab variance", &problem.names[k]));
        }
    }
    Ok(())
}

/// What belongs to all columns together is a number.
fn check_totals(problem: &Problem) -> Result<()> {
    if !(problem.yy >= 0.0 && problem.yy.is_finite() && problem.n >= 0.0 && problem.n.is_finite()) {
        return Err(not_finite(
            "the sum of squares or the number of rows",
            "torque",
        ));
    }
    if !problem.log_constant.is_finite() {
        return Err(not_finite(
            "the log-determinant of the noise weights",
            "torque",
        ));
    }
    Ok(())
}

/// The error of an impossible setting of the prior.
fn setting(key: &str, problem: String, remedy: &str) -> Error {
    Error::Setting {
        key: key.into(),
        problem,
        remedy: remedy.into(),
    }
}

/// Shape and scale of the noise's prior are positive; scale 0 needs a torque of 0.
fn check_noise_prior(problem: &Problem) -> Result<()> {
    let prior = &problem.prior;
    if !(prior.shape > 0.0 && prior.shape.is_finite()) {
        return Err(setting(
            "prior.noise.shape",
            format!("{} is not positive", prior.shape),
            "use 0.001 or more",
        ));
    }
    if !(prior.scale >= 0.0 && prior.scale.is_finite()) || (prior.scale == 0.0 && problem.yy > 0.0)
    {
        return Err(setting(
            "prior.noise.scale",
            format!("{} is not positive", prior.scale),
            "use 0.001 or more",
        ));
    }
    Ok(())
}

/// Odds of families and inclusion of components are possible.
fn check_inclusion(problem: &Problem) -> Result<()> {
    let prior = &problem.prior;
    if let Some(r) = prior.odds.iter().find(|r| !(**r > 0.0 && r.is_finite())) {
        return Err(setting(
            "prior.odds",
            format!("{r} is not positive"),
            "use 1, or e.g. 0.1 for a family that should need more evidence",
        ));
    }
    let (size, components) = (problem.xy.len(), prior.components());
    match prior.inclusion {
        Inclusion::Probability(p) if !(p > 0.0 && p < 1.0) => Err(setting(
            "prior.inclusion.probability",
            format!("{p} is not between 0 and 1"),
            "use 0.2, or `expected_terms`",
        )),
        Inclusion::ExpectedTerms(m) if size > 0 && !(m > 0.0 && m < components as f64) => {
            Err(setting(
                "prior.inclusion.expected_terms",
                format!("{m} of {components} components"),
                "it must lie between 0 and the number of components",
            ))
        }
        _ => Ok(()),
    }
}
