"""FIGAROH beside `twincal fit`: the same robot, the same long log, the same question but for selection, in one run.

    python -m venv figaroh-environment
    figaroh-environment/bin/pip install figaroh==1.0.2 pin==4.1.0 ndcurves==2.3.0 numpy==2.4.6 scipy==1.17.1 pandas==3.1.1 pyarrow==26.0.1 \
        matplotlib==3.11.2 meshcat==0.3.2 numdifftools==0.11.2 picos==2.6.2 pyyaml==6.0.3 rospkg==1.6.3
    python studies/speed/figaroh.py --figaroh-python figaroh-environment/bin/python [--minutes 10] [--threads 2] [--repeat 3] [--ways rows,log]

FIGAROH has an environment of its own and is no part of requirements-check.txt (cyipopt is not needed here). Robot and log are those of
long_log.py; the question: inertia of every link, viscous and Coulomb friction, torque offset and motor inertia of every joint. FIGAROH
answers by least squares weighted by joint, for base parameters with their standard deviations; twincal also says which effects are there.
A long log has three ways through FIGAROH:

    rows     the user low-passes the log at twincal's cut-off and cuts it to twincal's row rate, then `initialize()` and
             `solve(decimate=False)`: the least work, but sign(q̇) meets a low-passed torque
    hundred  the user brings the log to 100 Hz, the rate that FIGAROH's filters have as their default; `solve()` decimates every column to
             twincal's row rate
    log      the log as it is: the regressor at 1 kHz (9 GB for 10 minutes), every column of which `solve()` decimates by 10, its default

Each fit is one process, from importing FIGAROH and reading the Parquet to base parameters. Every step is FIGAROH's own code:
`_apply_filters` (median, then zero-phase Butterworth), `_differentiate_signal` from the logged q̇, `build_regressor_basic`,
`get_index_eliminate`, `_apply_decimation`, `QRDecomposer.double_decomposition`, `_apply_weighted_least_squares`, `relative_stdev`. Only the
Parquet is read and samples are skipped by this file. FIGAROH is spared the columns of the fingers, which are locked first, and a second
regressor of the same size, by which `solve()` would score the log that it has fitted. Its linear algebra has one thread: on cores that
others use too, OpenBLAS with two took 3 to 40 times as long; `--figaroh-threads 2` is for a machine with nothing else running. twincal's
time holds in addition: self-check, cut-off sweep, posterior probabilities, held-out check, result.json, twin and report.

Counted for neither is the score: both fit the first 70 % of the log once more and predict the rest at the log's rate from q and q̇; the
error is low-passed at the cut-off and cut to rows. Friction in the log is tanh(q̇/0.02), which is twincal's column, while FIGAROH has
sign(q̇): the score of moving joints leaves out what is near a standstill. Joint 2 has a spring that neither is asked about.
"""

import argparse
import json
import os
import statistics
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from long_log import PROGRAM, arms, log, measured

HERE = Path(__file__).resolve().parent
ROBOT = "panda"
FAMILIES = ["payload", "mass_moments", "tensor", "viscous", "coulomb", "offset", "motor_inertia"]
WAYS = ("rows", "hundred", "log")
LAPS = ("import", "read and filter", "regressor", "decimate, QR and solve")
TRAINING = 0.7  # of the log, for the score
BORDER = 2.0  # s at either end which the score leaves to the filters
MOVING = (0.05, 0.2)  # rad/s, for as many s to either side


def columns(file, kind):
    """The columns `kind`1, `kind`2, … of a log: samples x joints."""
    names = [name for name in pq.read_schema(file).names if name.rstrip("0123456789") == kind]
    table = pq.read_table(file, columns=names)
    return np.column_stack([table[name].to_numpy() for name in names])


# ---- in FIGAROH's environment


def steps(job):
    """How many samples of the log make one of the regressor, and how many of those one row of the fit."""
    row = round(arms.RATE / job["row_rate"])
    return {"rows": (row, 1), "hundred": (10, row // 10), "log": (1, 10)}[job["way"]]


def configuration(job, joints):
    """FIGAROH's configuration file, which is YAML: JSON will do."""
    components = {"friction": True, "actuator_inertia": True, "joint_offset": True}
    signal = {"sampling_frequency": arms.RATE, "cutoff_frequency": job["cutoff"]}
    return {
        "robot": {"name": ROBOT, "properties": {"joints": {"active_joints": joints}}},
        "tasks": {"identification": {"problem": {"model_components": components}, "signal_processing": signal}},
    }


def locked_robot(job):
    """Pinocchio's robot without the locked joints."""
    import pinocchio as pin

    model = pin.buildModelFromUrdf(job["model"])
    return pin.RobotWrapper(pin.buildReducedModel(model, [model.getJointId(joint) for joint in job["locked"]], pin.neutral(model)))


def identification(job, file, step):
    """FIGAROH's workflow for one log, of which every step-th sample goes into the regressor."""
    from figaroh.identification import BaseIdentification

    class LongLog(BaseIdentification):
        """What a user of FIGAROH writes for a robot."""

        def load_trajectory_data(self, data_source=None):
            kinds = {"timestamps": "t", "positions": "q", "velocities": "qd", "torques": "tau"}
            return {name: columns(file, kind) for name, kind in kinds.items()} | {"accelerations": None}

        def process_kinematics_data(self, filter_config=None):
            super().process_kinematics_data(filter_config)
            self.processed_data = {name: signal[::step] for name, signal in self.processed_data.items()}

        def process_torque_data(self, **kwargs):
            if step == 1:
                return super().process_torque_data(**kwargs)
            below = self.filter_config["filter_params"] | {"f_butter": 0.4 * arms.RATE / step}  # rows: twincal's cut-off
            return self._apply_filters(self.raw_data["torques"], **below)[::step]

        def _compute_validation_metrics(self):
            return None  # otherwise a second regressor, of the log that was fitted

    robot = locked_robot(job)
    joints = list(robot.model.names)[1:]
    written = Path(job["output"]).with_suffix(".yaml")
    written.write_text(json.dumps(configuration(job, joints)))
    made = LongLog(robot, str(written))
    made.identif_config |= {"active_joints": joints, "act_idxq": list(range(robot.nq)), "act_idxv": list(range(robot.nv))}
    return made


def figaroh_torque(job, fitted):
    """Torque of the rest of the log at its own rate, computed as FIGAROH's validation does: samples x joints."""
    from figaroh.tools.regressor import build_regressor_basic, build_regressor_reduced

    rest = identification(job, job["rest"], 1)
    rest.process_data()
    motion = [rest.processed_data[name] for name in ("positions", "velocities", "accelerations")]
    regressor = build_regressor_basic(rest.robot, *motion, rest.identif_config)
    base = build_regressor_reduced(regressor, fitted._idx_eliminated)[:, fitted._base_indices]
    return (base @ fitted.phi_base).reshape(rest.model.nv, -1).T


def child(job):
    """One fit by FIGAROH, its numbers as JSON; with a rest of the log also the torque there."""
    sys.path[:] = [folder for folder in sys.path if Path(folder).resolve() != HERE]  # there `figaroh` is this file
    began = [time.perf_counter()]
    step, decimation = steps(job)
    fitted = identification(job, job["log"], step)
    began.append(time.perf_counter())
    fitted.process_data()
    began.append(time.perf_counter())
    fitted.calculate_full_regressor()  # with the line before and the line after next: initialize()
    began.append(time.perf_counter())
    fitted.initialize_standard_parameters()
    fitted.solve(decimate=decimation > 1, decimation_factor=decimation, plotting=False, wls=True)
    began.append(time.perf_counter())
    if job["rest"]:
        np.save(Path(job["output"]).with_suffix(".npy"), figaroh_torque(job, fitted))
    told = {"laps": np.diff(began).tolist(), "base": len(fitted.phi_base), "rows": len(fitted.tau_noised) // fitted.model.nv}
    Path(job["output"]).write_text(json.dumps(told))


# ---- in the environment of the check


def run_figaroh(python, folder, job):
    """Wall time in s and memory in MB of a fit by FIGAROH, and what it told."""
    job |= {"output": str(folder / "figaroh.json")}
    (folder / "job.json").write_text(json.dumps(job))
    try:
        seconds, memory, _ = measured([str(python), str(Path(__file__).resolve()), "child", str(folder / "job.json")])
    except SystemExit as end:
        sys.exit(f"FIGAROH ended without a result, way {job['way']}; without a word it ran out of memory: --ways without log\n{end}")
    return seconds, memory, json.loads((folder / "figaroh.json").read_text())


def run_twincal(folder, file, threads):
    """Wall time in s and memory in MB of a fit by twincal, and its result.json."""
    locked = ", ".join(f'"{joint}" = 0.0' for joint in arms.ROBOTS[ROBOT].locked)
    (folder / "figaroh.toml").write_text(f"[model]\nlocked = {{ {locked} }}\n[library]\nfamilies = {json.dumps(FAMILIES)}\n")
    command = [PROGRAM, "fit", file, "--model", arms.model_file(ROBOT), "--config", folder / "figaroh.toml", "-o", folder / "twin"]
    command += ["--force", "--threads", threads]
    seconds, memory, _ = measured([str(part) for part in command])
    return seconds, memory, json.loads((folder / "twin/result.json").read_text())


def twincal_torque(folder, file, joints, threads):
    """Torque of a log by the twin in the folder, NaN where the motion filter does not reach: samples x joints."""
    output = folder / "predicted.parquet"
    measured([str(part) for part in (PROGRAM, "predict", file, "--twin", folder / "twin", "-o", output, "--force", "--threads", threads)])
    table = pq.read_table(output, columns=["t", *(f"{joint}.tau" for joint in joints)])
    t = columns(file, "t")[:, 0]
    torque = np.full((len(t), len(joints)), np.nan)
    reached = np.searchsorted(t, table["t"].to_numpy() - 0.5 / arms.RATE)
    torque[reached] = np.column_stack([table[f"{joint}.tau"].to_numpy() for joint in joints])
    return torque


def score(file, torque, signal):
    """RMSE by joint in N m, of all samples and of moving joints; of the error low-passed at the cut-off without a lag, at the row rate."""
    from scipy.ndimage import minimum_filter1d
    from scipy.signal import butter, sosfiltfilt

    border, row = round(BORDER * arms.RATE / 2), round(arms.RATE / signal["rate_hz"])
    error = (columns(file, "tau") - torque)[border:-border]
    low = sosfiltfilt(butter(4, signal["cutoff_hz"], fs=arms.RATE, output="sos"), error, axis=0)[border:-border:row]
    slowest = minimum_filter1d(np.abs(columns(file, "qd")), 2 * round(MOVING[1] * arms.RATE) + 1, axis=0)[2 * border : -2 * border : row]
    return np.sqrt([np.mean(low**2, axis=0), np.average(low**2, axis=0, weights=slowest > MOVING[0])])


def line(name, runs, rmse, beside=None):
    """Prints one line of the table; returns the median wall time and the largest memory."""
    seconds, memory = statistics.median(run[0] for run in runs), max(run[1] for run in runs)
    ratios = f"{seconds / beside[0]:7.2f} {memory / beside[1]:7.2f}" if beside else f"{'':15}"
    total = np.sqrt(np.mean(rmse**2, axis=1))
    each = " ".join(f"{joint:.4f}" for joint in rmse[1])
    print(f"{name:17} {seconds:7.2f} {memory:7.0f} {ratios} {total[0]:9.4f} {total[1]:9.4f}   {each}")
    return seconds, memory


def scores(python, folder, file, ways, job, signal, threads):
    """Held-out RMSE of twincal and of each way through FIGAROH, all fitted to the first part of the log."""
    table = pq.read_table(file)
    cut = round(TRAINING * table.num_rows)
    first, rest = folder / "first.parquet", folder / "rest.parquet"
    pq.write_table(table.slice(0, cut), first)
    pq.write_table(table.slice(cut), rest)
    joints = [noise["joint"] for noise in run_twincal(folder, first, threads)[2]["noise"]]
    held_out = {"twincal": score(rest, twincal_torque(folder, rest, joints, threads), signal)}
    for way in ways:
        run_figaroh(python, folder, job | {"log": str(first), "rest": str(rest), "way": way})
        held_out[way] = score(rest, np.load(folder / "figaroh.npy"), signal)
    return held_out


def compare(given, ways, folder, file):
    """All fits, taking turns, and the table."""
    job = {"log": str(file), "rest": None, "model": str(arms.model_file(ROBOT)), "locked": arms.ROBOTS[ROBOT].locked}
    twincal, figaroh = [], {way: [] for way in ways}
    for _ in range(given.repeat):
        twincal.append(run_twincal(folder, file, given.threads))
        signal = twincal[0][2]["signal"]
        job |= {"cutoff": signal["cutoff_hz"], "row_rate": signal["rate_hz"]}
        for way in ways:
            figaroh[way].append(run_figaroh(given.figaroh_python, folder, job | {"way": way}))
    held_out = scores(given.figaroh_python, folder, file, ways, job, signal, given.threads)

    print(f"{ROBOT}, {given.minutes:g} min at 1 kHz, cut-off {signal['cutoff_hz']:g} Hz; median time of {given.repeat}, largest memory;")
    print(f"twincal with {given.threads} threads, FIGAROH with {given.figaroh_threads}; ratios: FIGAROH / twincal;")
    print("held-out RMSE in N m: all samples, moving joints, these joint by joint")
    print(f"{'':17} {'s':>7} {'MB':>7} {'time':>7} {'memory':>7} {'all':>9} {'moving':>9}")
    beside = line("twincal fit", twincal, held_out["twincal"])
    for way in ways:
        line(f"FIGAROH, {way}", figaroh[way], held_out[way], beside)
    for way in ways:
        told = figaroh[way][-1][2]
        laps = [f"{seconds:.1f} s {name}" for seconds, name in zip(told["laps"], LAPS)]
        print(f"FIGAROH, {way}: {told['rows']} rows per joint, {told['base']} base parameters; last run: {', '.join(laps)}")


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--figaroh-python", type=Path, required=True, help="python of the environment that has FIGAROH")
    arguments.add_argument("--minutes", type=float, default=10)
    arguments.add_argument("--threads", type=int, default=2, help="of twincal")
    arguments.add_argument("--figaroh-threads", type=int, default=1, help="of the linear algebra under FIGAROH")
    arguments.add_argument("--repeat", type=int, default=3)
    arguments.add_argument("--ways", default=",".join(WAYS), help="through FIGAROH, with commas [default: all three]")
    arguments.add_argument("--folder", type=Path, help="keep the log here and use it again")
    given = arguments.parse_args()
    ways = given.ways.split(",")
    if unknown := set(ways) - set(WAYS):
        sys.exit(f"--ways: {', '.join(sorted(unknown))} is none of {', '.join(WAYS)}")
    os.environ |= {name: str(given.figaroh_threads) for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")}
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        kept = given.folder or folder
        kept.mkdir(parents=True, exist_ok=True)
        file = kept / f"{ROBOT}-{given.minutes:g}.parquet"
        if not file.exists():
            pq.write_table(pa.table(log(ROBOT, given.minutes)), file)
        compare(given, ways, folder, file)


if __name__ == "__main__":
    if sys.argv[1:2] == ["child"]:
        child(json.loads(Path(sys.argv[2]).read_text()))
    else:
        main()
