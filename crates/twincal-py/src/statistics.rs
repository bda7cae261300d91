//! Statistics of logs: what a fit takes of each, which adds.

use crate::errors::Problem;
use crate::fit::{config_of, sources};
use crate::follow::Following;
use crate::log::Log;
use crate::pool;
use crate::robot::Robot;
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::Arc;
use twincal_cli::Failure;
use twincal_cli::session::{self, Request};
use twincal_io::artifact::{Inputs, OutputFile};
use twincal_io::statistics::StatisticsFile;

/// How logs become statistics: those with one plan add.
#[pyclass(frozen, module = "twincal._twincal")]
#[derive(Debug)]
pub(crate) struct Plan {
    plan: Arc<twincal::calibrate::Plan>,
    keywords: String,
}

/// Statistics of one log or of several.
#[pyclass(frozen, module = "twincal._twincal")]
#[derive(Debug)]
pub(crate) struct Statistics {
    pub(crate) file: StatisticsFile,
}

/// Plan of a fit to these logs.
#[pyfunction]
pub(crate) fn plan(
    py: Python<'_>,
    robot: &Robot,
    logs: Vec<PyRef<'_, Log>>,
    keywords: String,
) -> PyResult<Plan> {
    let all: Vec<&Log> = logs.iter().map(|log| &**log).collect();
    let config = config_of(robot, &all, &keywords).map_err(|problem| problem.raise(py))?;
    let request = Request {
        model: robot.input.clone(),
        config,
        logs: sources(&logs),
        heldout: Vec::new(),
    };
    let plan = Following::SILENTLY.run(py, move |_| Ok(request.plan()?))?;
    Ok(Plan {
        plan: Arc::new(plan),
        keywords,
    })
}

#[pymethods]
impl Statistics {
    /// Of one log under a plan.
    #[staticmethod]
    fn map(py: Python<'_>, robot: &Robot, log: &Log, plan: &Plan) -> PyResult<Self> {
        let config = config_of(robot, &[log], &plan.keywords).map_err(|e| e.raise(py))?;
        let (input, plan) = (robot.input.clone(), Arc::clone(&plan.plan));
        let source = log.source.clone();
        let file = Following::SILENTLY.run(py, move |_| {
            Ok(session::statistics(&input, &plan, &source, &config)?)
        })?;
        Ok(Self { file })
    }

    /// The sum with others of the same plan.
    fn merge(&self, py: Python<'_>, other: &Self) -> PyResult<Self> {
        let file = pool::detached(py, None, || session::merged(&self.file, &other.file))?;
        Ok(Self { file })
    }

    /// Names of the logs.
    #[getter]
    fn log_names(&self) -> Vec<&str> {
        self.file.statistics.log_names().collect()
    }

    /// Reads a file of `twincal statistics`.
    #[staticmethod]
    fn read(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let file = pool::detached(py, None, || StatisticsFile::read(&path))?;
        Ok(Self { file })
    }

    /// Writes it, complete or not at all.
    fn write(&self, py: Python<'_>, path: PathBuf, force: bool) -> PyResult<()> {
        pool::detached(py, None, || {
            let mut output = OutputFile::create(&path, force, &Inputs::default())?;
            let written = match output.file() {
                Some(file) => self.file.write_to(std::io::BufWriter::new(file))?,
                None => {
                    let problem = "a file that cannot be written";
                    return Err(Failure::usage(problem, "give another path").into());
                }
            };
            Ok::<_, Problem>(output.commit(written)?)
        })
    }
}
