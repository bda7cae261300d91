//! Spike-and-slab regression of any columns.

use crate::errors::Problem;
use crate::follow::{Following, Watch};
use crate::pool;
use crate::robot::{numbers, owned};
use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use std::sync::Arc;
use twincal::infer::{Choice, EXACT_LIMIT, InferenceSettings};
use twincal::likelihood::NoiseModel;
use twincal::posterior::draws::draw;
use twincal::posterior::summary::{ColumnSummary, summarise};
use twincal::prior::{Inclusion, PriorSettings};
use twincal::regression::{self, Design, Regressed};
use twincal::signal::Auto;
use twincal_cli::Failure;
use twincal_io::config::{Config, InferenceTable, MethodWord};

/// Random stream of its draws.
const STREAM: u64 = (1 << 32) + 4;

/// A NumPy array.
type Numbers<'py> = Bound<'py, PyArray1<f64>>;

/// A posterior of coefficients.
#[pyclass(frozen, module = "twincal._twincal")]
#[derive(Debug)]
pub(crate) struct Regression {
    regressed: Arc<Regressed>,
    summaries: Vec<ColumnSummary>,
}

/// What a regression is asked for.
#[derive(FromPyObject)]
pub(crate) struct Asked {
    groups: Vec<usize>,
    noise: String,
    method: String,
    scaled_variance: Option<f64>,
    expected_terms: Option<f64>,
    probability: Option<f64>,
    chains: u64,
    draws: u64,
    seed: u64,
    intercept: bool,
}

impl Asked {
    fn settings(&self) -> Result<regression::Settings, Problem> {
        let unknown = |key: &str, given: &str, known: &str| {
            let problem = format!("{key} is `{given}`");
            Problem::from(Failure::usage(
                problem,
                format!("give one of {known}").as_str(),
            ))
        };
        let noise = match self.noise.as_str() {
            "iid" => NoiseModel::Iid,
            "ar1" => NoiseModel::Ar1,
            "tempered" | "decoys" => NoiseModel::Tempered,
            other => {
                let known = "`iid`, `ar1`, `tempered`, `decoys`";
                return Err(unknown("noise", other, known));
            }
        };
        let method = match self.method.as_str() {
            "auto" => MethodWord::Auto,
            "exact" => MethodWord::Exact,
            "gibbs" => MethodWord::Gibbs,
            other => return Err(unknown("method", other, "`auto`, `exact`, `gibbs`")),
        };
        let inference = self.inference(method)?;
        let inclusion = match (self.probability, self.expected_terms) {
            (Some(probability), _) => Some(Inclusion::Probability(probability)),
            (None, Some(terms)) => Some(Inclusion::ExpectedTerms(terms)),
            (None, None) => None,
        };
        Ok(regression::Settings {
            groups: self.groups.clone(),
            noise,
            intercept: self.intercept,
            prior: PriorSettings {
                scaled_variance: self.scaled_variance.map_or(Auto::Auto, Auto::Value),
                inclusion,
                noise: None,
                families: Vec::new(),
                forced: Vec::new(),
                heredity: None,
            },
            inference,
        })
    }

    /// `[inference]` with the limits of `twincal.toml`; draws that the memory does not hold are refused.
    fn inference(&self, method: MethodWord) -> Result<InferenceSettings, Problem> {
        let mut config = Config::default();
        config.file.inference = InferenceTable {
            method: Some(method),
            chains: Some(self.chains),
            draws: Some(self.draws),
            seed: Some(self.seed),
            threads: None,
        };
        let mut inference = config.settings()?.calibration.inference;
        inference.allow_disagreement = true;
        let samples = match inference.method {
            Choice::Auto => self.groups.iter().max() >= Some(&EXACT_LIMIT),
            Choice::Exact => false,
            Choice::Gibbs => true,
        };
        if samples {
            // a chain also keeps two numbers per draw to be compared by
            let numbers = [inference.chains, inference.draws, self.groups.len() + 2];
            pool::require_memory("draws of all chains", &numbers)?;
        }
        Ok(inference)
    }
}

impl Regression {
    fn new(regressed: Regressed) -> Self {
        Self {
            summaries: summarise(&regressed.posterior),
            regressed: Arc::new(regressed),
        }
    }
}

/// The decoys of a calibration at the states of one joint, decoy * rows + row.
#[pyfunction]
pub(crate) fn decoys<'py>(
    py: Python<'py>,
    q: PyReadonlyArray1<'py, f64>,
    qd: PyReadonlyArray1<'py, f64>,
) -> PyResult<Numbers<'py>> {
    let (q, qd) = (numbers(py, &q)?, numbers(py, &qd)?);
    if q.len() != qd.len() {
        let problem = format!("{} positions and {} velocities", q.len(), qd.len());
        let failure = Failure::usage(problem, "give one velocity per position");
        return Err(Problem::from(failure).raise(py));
    }
    Ok(PyArray1::from_vec(py, regression::decoys(q, qd)))
}

/// Regresses `y` on columns, `x[column * rows + row]`; `breaks` are rows that start a new run, `decoys` is laid out as `x` and may be empty.
#[pyfunction]
pub(crate) fn regress(
    py: Python<'_>,
    x: PyReadonlyArray1<'_, f64>,
    y: PyReadonlyArray1<'_, f64>,
    decoys: PyReadonlyArray1<'_, f64>,
    breaks: Vec<usize>,
    asked: Asked,
) -> PyResult<Regression> {
    let settings = asked.settings().map_err(|problem| problem.raise(py))?;
    let (x, y, decoys) = (owned(py, &x)?, owned(py, &y)?, owned(py, &decoys)?);
    Following::SILENTLY.run(py, move |_| {
        let design = Design {
            x: &x,
            y: &y,
            breaks: &breaks,
            decoys: &decoys,
        };
        Ok(Regression::new(regression::regress(design, &settings)?))
    })
}

#[pymethods]
impl Regression {
    /// Posterior inclusion probability of each column.
    #[getter]
    fn inclusion<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        PyArray1::from_slice(py, &self.regressed.posterior.inclusion)
    }

    /// Posterior mean of each coefficient.
    #[getter]
    fn mean<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        PyArray1::from_slice(py, &self.regressed.posterior.mean)
    }

    /// Posterior sd of each coefficient.
    #[getter]
    fn sd<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        PyArray1::from_slice(py, &self.regressed.posterior.sd)
    }

    /// Ends of the central 95 % interval of each coefficient, column * 2 + end.
    #[getter]
    fn interval95<'py>(&self, py: Python<'py>) -> Numbers<'py> {
        let ends = self
            .summaries
            .iter()
            .flat_map(|own| own.interval95)
            .collect();
        PyArray1::from_vec(py, ends)
    }

    /// Constant of the model.
    #[getter]
    fn intercept(&self) -> f64 {
        self.regressed.intercept
    }

    /// sd of one row around the model.
    #[getter]
    fn sigma(&self) -> f64 {
        self.regressed.sigma
    }

    /// First-order autocorrelation of the noise; 0 unless `ar1`.
    #[getter]
    fn rho(&self) -> f64 {
        self.regressed.rho
    }

    /// Rows that count as one.
    #[getter]
    fn rows_per_independent(&self) -> f64 {
        self.regressed.rows_per_independent
    }

    /// ln of the evidence; none with Gibbs.
    #[getter]
    fn log_evidence(&self) -> Option<f64> {
        self.regressed.posterior.log_evidence
    }

    /// Mean and sd of a new row of `y`, for rows x[row * columns + column].
    fn predict<'py>(
        &self,
        py: Python<'py>,
        rows: PyReadonlyArray1<'py, f64>,
    ) -> PyResult<(Numbers<'py>, Numbers<'py>)> {
        let (rows, regressed) = (owned(py, &rows)?, Arc::clone(&self.regressed));
        let predict = move |_: Watch<'_>| Ok(regressed.predict(&rows));
        let (mean, sd) = Following::SILENTLY.run(py, predict)?;
        Ok((PyArray1::from_vec(py, mean), PyArray1::from_vec(py, sd)))
    }

    /// The whole posterior as JSON, for pickle.
    fn to_json(&self, py: Python<'_>) -> PyResult<String> {
        let text = serde_json::to_string(&*self.regressed);
        text.map_err(|e| Problem::Panicked(e.to_string()).raise(py))
    }

    /// The posterior that [`Self::to_json`] wrote.
    #[staticmethod]
    fn from_json(py: Python<'_>, text: &str) -> PyResult<Self> {
        let regressed: Regressed = serde_json::from_str(text).map_err(|e| {
            let failure = Failure::usage(format!("not a pickled regression: {e}"), "fit again");
            Problem::from(failure).raise(py)
        })?;
        Ok(Self::new(regressed))
    }

    /// Draws of the coefficients, draw * columns + column.
    fn draws<'py>(&self, py: Python<'py>, count: usize, seed: u64) -> PyResult<Numbers<'py>> {
        let posterior = &self.regressed.posterior;
        let draws = pool::detached(py, None, || {
            pool::require_memory("draws", &[count, posterior.mean.len().max(1)])?;
            Ok::<_, Problem>(draw(posterior, count, seed, STREAM))
        })?;
        Ok(PyArray1::from_vec(py, draws.beta))
    }
}
