"""Information of motions: `twincal design --model` beside FIGAROH's optimal trajectories, UR10, in the same limits.

    run [--folder DIR] --program P [--ways NAME …] [--seeds 5] [--runs 3]

Every motion is one process with one thread and stays in DIR/motions-…; a later call takes it from there. All motions are judged by the same
code, `Judge`, which is neither tool's.
"""

import argparse
import itertools
import json
import logging
import os
import resource
import subprocess
import sys
import time
from importlib import metadata
from pathlib import Path

import numpy as np
import pinocchio as pin
from scipy.linalg import qr

HERE = Path(__file__).resolve().parent
ROBOT = "cmeel.prefix/share/example-robot-data/robots/ur_description/urdf/ur10_robot.urdf"
SECONDS = 20.0
RATE = 500  # Hz, of motions
EVERY = 5  # samples of a motion from one that is judged to the next: 100 Hz
JERK_TIME = 0.1  # s: jerk limit = acceleration limit / 0.1 s
COULOMB_VELOCITY = 0.02  # rad/s
STATES = 2000  # random ones
KINDS = ("position", "velocity", "acceleration", "jerk", "torque")
INDEPENDENT = 1e-6  # smallest part of a column that counts, of one of size 1
ALLOWED = 1e-6  # beyond a limit, as a share of it: rounding
SLOWEST = 1800  # s, of one motion
ATTEMPTS = 5  # at a first guess within the limits: FIGAROH's guesses are 12 % too fast, IPOPT makes them feasible
# FIGAROH: s between waypoints, intervals of a segment, segments, Hz in the search, IPOPT's iterations, columns beyond the rigid body, aim.
WAYS = {
    "2 s": (2.0, 5, 2, 20, 25, False, "condition"),
    "1.25 s": (1.25, 8, 2, 16, 25, False, "condition"),
    "1 s": (1.0, 5, 4, 20, 25, False, "condition"),
    "0.6 s": (0.625, 8, 4, 16, 25, False, "condition"),
    "0.5 s": (0.5, 8, 5, 16, 25, False, "condition"),
    "1.25 s, det": (1.25, 8, 2, 16, 25, False, "determinant"),
    "1 s, det": (1.0, 5, 4, 20, 25, False, "determinant"),
    "0.6 s, det": (0.625, 8, 4, 16, 25, False, "determinant"),
    "0.6 s, all, det": (0.625, 8, 4, 16, 25, True, "determinant"),
    "0.6 s, long": (0.625, 8, 4, 16, 100, False, "condition"),
}
OWN = {"twincal": "determinant", "twincal, condition": "condition"}  # criteria of twincal
STEEPEST = 10.0 / 3.0**0.5 / 1.875  # peak acceleration over peak velocity of a quintic from rest to rest in 1 s, 1/s


def model_file():
    return Path(metadata.distribution("example-robot-data").locate_file(ROBOT))


def named(way, seed=""):
    """Name of a run's files."""
    return "-".join([*way.replace(",", "").split(), str(seed)])


class Limits:
    """Limits of the model file, with accelerations and jerks that it does not have."""

    def __init__(self, model, acceleration_time):
        self.links = [frame.name for frame in model.frames if frame.type == pin.FrameType.BODY]
        self.low, self.high = model.lowerPositionLimit, model.upperPositionLimit
        self.velocity, self.torque = model.velocityLimit, model.effortLimit
        self.acceleration = self.velocity / acceleration_time
        self.jerk = self.acceleration / JERK_TIME

    def toml(self, names):
        """Limits for twincal; pairs of links are left out as in FIGAROH's search."""
        lines = [f"ignore = {json.dumps([list(pair) for pair in itertools.combinations(self.links, 2)])}"]
        for j, name in enumerate(names):
            lines += [f'[joint."{name}"]', f"position = [{self.low[j]}, {self.high[j]}]"]
            lines += [f"{key} = {getattr(self, key)[j]}" for key in ("velocity", "acceleration", "jerk", "torque")]
        return "\n".join(lines) + "\n"

    def states(self, count, ordinary=False):
        """Random states within the limits; `ordinary`: within ±π, 2 rad/s and 5 rad/s² of them."""
        rng = np.random.default_rng(7)
        bounds = [self.high, self.velocity, self.acceleration]
        if ordinary:
            bounds = [np.minimum(bound, most) for bound, most in zip(bounds, (np.pi, 2.0, 5.0), strict=True)]
        return tuple(rng.uniform(-bound, bound, (count, bound.size)) for bound in bounds)


class Judge:
    """ln det and condition number of base columns, whitened at random states."""

    def __init__(self, model, limits, weights="limits"):
        self.model, self.data = model, model.createData()
        states = limits.states(STATES, ordinary=weights == "ordinary")
        torque = np.array([pin.rnea(model, self.data, *state) for state in zip(*states, strict=True)])
        size = np.sqrt(np.mean(torque**2, axis=0))
        self.weight = np.ones(model.nv) if weights == "none" else 1.0 / np.maximum(size, 1e-3 * size.max())
        self.columns, self.scale = {}, {}
        for kind in ("rigid", "all"):
            rows = self.rows(states, kind)
            scale = np.sqrt(np.sum(rows**2, axis=0) / STATES)
            seen = np.flatnonzero(scale > 1e-9 * scale.max())
            _, r, order = qr(rows[:, seen] / scale[seen], mode="economic", pivoting=True)
            rank = int(np.sum(np.abs(np.diag(r)) > INDEPENDENT * np.abs(r[0, 0])))
            self.columns[kind] = np.sort(seen[order[:rank]])
            self.scale[kind] = scale[self.columns[kind]]

    def rows(self, motion, kind):
        """Torque of every parameter, weighted: rows are samples x joints."""
        q, qd, qdd = motion
        rigid = np.array([pin.computeJointTorqueRegressor(self.model, self.data, *state) for state in zip(q, qd, qdd, strict=True)])
        parts = [rigid]
        if kind == "all":
            terms = (qdd, qd, np.tanh(qd / COULOMB_VELOCITY), np.ones_like(qd))
            parts += [term[:, :, None] * np.eye(q.shape[1]) for term in terms]
        rows = np.concatenate(parts, axis=2) * self.weight[None, :, None]
        return rows.reshape(-1, rows.shape[2])

    def __call__(self, motion, kind):
        rows = self.rows(motion, kind)[:, self.columns[kind]]
        values = np.linalg.svd(rows / self.scale[kind], compute_uv=False)
        samples = len(motion[0])
        return 2.0 * float(np.sum(np.log(values / np.sqrt(samples)))), float(values[0] / values[-1])

    def raw_condition(self, motion, kind="rigid"):
        """Condition number without any scaling of columns."""
        values = np.linalg.svd(self.rows(motion, kind)[:, self.columns[kind]], compute_uv=False)
        return float(values[0] / values[-1])


def used(model, limits, motion):
    """The largest share of each kind of limit that a motion uses, by its samples; raises where derivatives disagree."""
    q, qd, qdd = motion
    for x, slope, tolerance in ((q, qd, 1e-3), (qd, qdd, 0.05)):
        middle = (x[2:] - x[:-2]) * (RATE / 2.0)
        if np.abs(middle - slope[1:-1]).max() > tolerance * np.abs(slope).max():
            raise ValueError("derivatives of a motion disagree")
    data = model.createData()
    torque = np.array([pin.rnea(model, data, *state) for state in zip(*(x[::EVERY] for x in motion), strict=True)])
    middle, half = (limits.high + limits.low) / 2.0, (limits.high - limits.low) / 2.0
    jerk = np.diff(qdd, axis=0) * RATE
    pairs = {"position": (q - middle, half), "velocity": (qd, limits.velocity), "acceleration": (qdd, limits.acceleration),
             "jerk": (jerk, limits.jerk), "torque": (torque, limits.torque)}  # fmt: skip
    return {name: float((np.abs(x) / limit).max()) for name, (x, limit) in pairs.items()}


# ---- FIGAROH


def configuration(folder, names, way):
    """FIGAROH's configuration file, which is YAML: JSON will do."""
    interval, intervals, _, frequency, iterations, everything, _ = WAYS[way]
    components = {"friction": everything, "joint_offset": everything, "actuator_inertia": everything}
    identification = {
        "enabled": True,
        "problem": {"use_joint_torques": True, "include_external_forces": False, "model_components": components},
        "signal_processing": {"sampling_frequency": float(RATE), "cutoff_frequency": 50.0, "filter_type": "butterworth", "filter_order": 4},
    }
    trajectory = {
        "enabled": True,
        "problem": {"soft_lim": 0.0, "max_attempts": ATTEMPTS, "max_iterations": iterations, "segment_attempts": 3},
        "trajectory": {"waypoints": intervals + 1, "frequency": frequency, "segment_duration": interval},
    }
    content = {"robot": {"name": "ur10", "properties": {"joints": {"active_joints": names}}},
               "tasks": {"identification": identification, "optimal_trajectory": trajectory}}  # fmt: skip
    path = folder / f"{named(way)}.yaml"
    path.write_text(json.dumps(content))
    return path


def generator(model, judge, path, way):
    """FIGAROH's generator as a user of FIGAROH sets it up."""
    from figaroh.optimal.base_optimal_trajectory import BaseOptimalTrajectory, BaseTrajectoryIPOPTProblem

    class Generator(BaseOptimalTrajectory):
        def create_ipopt_problem(self, *given):
            return BaseTrajectoryIPOPTProblem(self, *given)

    class Determinant(Generator):
        """With twincal's aim: ln det of the rows, of joints whose torque has size 1."""

        def objective_function(self, x, opt_cb, tps, vel_wps, acc_wps, wp_init, W_stack=None):  # noqa: N803
            waypoints = np.vstack([wp_init, np.reshape(x, (-1, model.nv))]).T
            t, q, qd, qdd = self.CB.get_full_config(self.trajectory_config["freq"], tps, waypoints, vel_wps, acc_wps)
            opt_cb.update(t_f=t, p_f=q, v_f=qd, a_f=qdd)
            rows = self._stack_base_regressors(q, qd, qdd, W_stack=W_stack)
            weight = np.tile(np.repeat(judge.weight, len(q)), len(rows) // (len(q) * model.nv))
            values = np.linalg.svd(rows * weight[:, None], compute_uv=False)
            return float(-2.0 * np.sum(np.log(np.maximum(values, 1e-9))))

    names = list(model.names)[1:]
    kind = Determinant if WAYS[way][-1] == "determinant" else Generator
    made = kind(pin.RobotWrapper(model), names, str(path))
    ids = [model.getJointId(name) for name in names]
    joints = [model.joints[j] for j in ids]
    made.identif_config |= {"active_joints": names, "act_Jid": ids, "act_J": joints,
                            "act_idxq": [j.idx_q for j in joints], "act_idxv": [j.idx_v for j in joints]}  # fmt: skip
    return made


def fine(made, way, segment):
    """A segment at RATE: q, qd, qdd."""
    interval, intervals, _, frequency = WAYS[way][:4]
    times = interval * np.arange(intervals + 1)
    waypoints = segment[np.round(frequency * times).astype(int)].T
    still = np.zeros_like(waypoints)
    return made.CB.get_full_config(RATE, np.matrix(times).T, waypoints, still, still)[1:]


def figaroh_motion(way, seed, folder, limits):
    """One run of FIGAROH in this process; its motion and notes become files."""
    logging.basicConfig(level=logging.ERROR)
    model = pin.buildModelFromUrdf(str(model_file()))
    segments = WAYS[way][2]
    judge = Judge(model, limits)
    # FIGAROH has no limit of acceleration: with this velocity its motions respect it.
    model.velocityLimit = np.minimum(limits.velocity, limits.acceleration * WAYS[way][0] / STEEPEST)
    made = generator(model, judge, configuration(folder, list(model.names)[1:], way), way)
    np.random.seed(seed)
    before, clock = time.process_time(), time.perf_counter()
    made.initialize()
    prepared = time.process_time() - before
    result = made.solve(segments)
    notes = {"cpu": time.process_time() - before, "wall": time.perf_counter() - clock, "prepared": prepared,
             "base": len(made.idx_b), "segments": len(result["P_F"]),
             "converged": [bool(data["converged"]) for data in result["iteration_data"]],
             "attempts": [data["attempt"] for data in result["iteration_data"]],
             "objective": [[float(data["obj_values"][0]), float(data["obj_values"][-1])] for data in result["iteration_data"]]}  # fmt: skip
    path = folder / named(way, seed)
    if notes["segments"] == segments:
        parts = [fine(made, way, segment) for segment in result["P_F"]]
        parts = [part if k == 0 else [x[1:] for x in part] for k, part in enumerate(parts)]
        np.save(f"{path}.npy", np.array([np.concatenate(x) for x in zip(*parts, strict=True)]))
    Path(f"{path}.json").write_text(json.dumps(notes))


def twincal_motion(program, way, seed, folder, limits, names):
    """One run of twincal; its motion and notes become files."""
    (folder / "limits.toml").write_text(limits.toml(names))
    before, clock = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    options = ["--duration", str(SECONDS), "--rate", str(RATE), "--seed", str(seed), "--threads", "1", "-o", folder / "motion", "--force"]
    command = [program, "design", "--model", model_file(), "--criterion", OWN[way], "--limits", folder / "limits.toml", *options]
    subprocess.run(command, check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    table = np.loadtxt(folder / "motion" / "motion.csv", delimiter=",", skiprows=1)
    found = json.loads((folder / "motion" / "design.json").read_text())
    notes = {"cpu": after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, "wall": time.perf_counter() - clock,
             "base": found["base_parameters"], "objective": [found["log_determinant"], found["condition"]]}  # fmt: skip
    n = len(names)
    np.save(folder / f"{named(way, seed)}.npy", np.array([table[:, 1 + k * n : 1 + (k + 1) * n] for k in range(3)]))
    (folder / f"{named(way, seed)}.json").write_text(json.dumps(notes))


# ---- the table


def judged(folder, name, model, limits, judges):
    """What a motion is worth, or None where there is none."""
    notes = json.loads((folder / f"{name}.json").read_text())
    if not (folder / f"{name}.npy").exists():
        return notes, None
    motion = tuple(np.load(folder / f"{name}.npy"))
    if motion[0].shape[0] != round(SECONDS * RATE) + 1:
        raise ValueError(f"{name}: {motion[0].shape[0]} samples")
    shares = used(model, limits, motion)
    some = tuple(x[::EVERY] for x in motion)
    line = {"used": shares, "within": all(share <= 1.0 + ALLOWED for key, share in shares.items() if key != "jerk"),
            "raw": judges["none"].raw_condition(some)}  # fmt: skip
    for key, judge in judges.items():
        line[key] = {kind: judge(some, kind) for kind in ("all", "rigid")}
    return notes, line


def middle(lines, weights, kind):
    """Median ln det and median condition number of some motions."""
    return np.median([line[weights][kind] for _, line in lines], axis=0)


def wider(lines, best, judge, weights, kind):
    """How much wider intervals of base parameters are than with `best`: geometric mean, medians of ln det."""
    less = middle(best, weights, kind)[0] - middle(lines, weights, kind)[0]
    return f"{np.exp(less / (2 * len(judge.columns[kind]))):.2f}"


def tables(found, judges):
    good = {way: [pair for pair in lines if pair[1] and pair[1]["within"]] for way, lines in found.items()}
    best = good["twincal"]
    print("\nMedian (best); all: with friction, motor inertia and offset; unscaled: rigid columns in SI units\n")
    print("| motion | runs | all: ln det | wider | condition | rigid: ln det | wider | condition | unscaled | CPU, s |\n" + "|---" * 10 + "|")
    for way, lines in good.items():
        if not lines:
            print(f"| {way} | 0 of {len(found[way])} |")
            continue
        cells = [way, str(len(lines))]
        for kind in ("all", "rigid"):
            values = np.array([line["limits"][kind] for _, line in lines])
            cells.append(f"{np.median(values[:, 0]):.1f} ({values[:, 0].max():.1f})")
            cells.append(wider(lines, best, judges["limits"], "limits", kind))
            cells.append(f"{np.median(values[:, 1]):.1f} ({values[:, 1].min():.1f})")
        raw = np.array([line["raw"] for _, line in lines])
        cells += [f"{np.median(raw):.0f} ({raw.min():.0f})", f"{np.median([notes['cpu'] for notes, _ in lines]):.0f}"]
        print("| " + " | ".join(cells) + " |")
    print("\nOther weights of joints\n\n| motion | weights | all: wider | condition | rigid: wider | condition |\n" + "|---" * 6 + "|")
    for way, lines in good.items():
        for weights in ("ordinary", "none") if lines else ():
            cells = [f"{wider(lines, best, judges[weights], weights, kind)} | {middle(lines, weights, kind)[1]:.1f}" for kind in ("all", "rigid")]
            print(f"| {way} | {weights} | " + " | ".join(cells) + " |")
    print("\nLargest share of each limit\n\n| motion | failed | beyond | " + " | ".join(KINDS) + " |\n" + "|---" * 8 + "|")
    for way, lines in found.items():
        made = [line for _, line in lines if line]
        cells = [f"{100 * max((line['used'][kind] for line in made), default=np.nan):.2f} %" for kind in KINDS]
        beyond = sum(not line["within"] for line in made)
        print(f"| {way} | {len(lines) - len(made)} | {beyond} | " + " | ".join(cells) + " |")
    segments = [done for way in list(found)[len(OWN):] for notes, _ in found[way] for done in notes["converged"]]
    print(f"\nFIGAROH: IPOPT converged in {sum(segments)} of {len(segments)} segments; the others end at its iteration limit, feasible.")


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--folder", type=Path, required=True)
    arguments.add_argument("--program", type=Path, default=Path(os.environ.get("TWINCAL", HERE.parents[2] / "target/release/twincal")))
    ways = f"of FIGAROH: {'; '.join(WAYS)}"
    arguments.add_argument("--ways", nargs="+", choices=sorted(WAYS), default=list(WAYS), metavar="NAME", help=ways)
    helped = "acceleration limit: velocity limit over this time, s"
    arguments.add_argument("--acceleration-time", type=float, default=0.2, help=helped)
    arguments.add_argument("--seeds", type=int, default=5, help="runs of twincal")
    arguments.add_argument("--runs", type=int, default=3, help="runs of every way of FIGAROH")
    arguments.add_argument("--one", nargs=2, help=argparse.SUPPRESS)
    given = arguments.parse_args()
    folder = given.folder.resolve() / f"motions-{given.acceleration_time}"
    folder.mkdir(parents=True, exist_ok=True)
    model = pin.buildModelFromUrdf(str(model_file()))
    names, limits = list(model.names)[1:], Limits(model, given.acceleration_time)
    if given.one:
        return figaroh_motion(given.one[0], int(given.one[1]), folder, limits)
    judges = {weights: Judge(model, limits, weights) for weights in ("limits", "ordinary", "none")}
    print(", ".join(f"{kind}: {len(columns)} base parameters" for kind, columns in judges["limits"].columns.items()), flush=True)
    found = {}
    for way in [*OWN, *given.ways]:
        found[way] = []
        for seed in range(1, (given.seeds if way in OWN else given.runs) + 1):
            name = named(way, seed)
            if not (folder / f"{name}.json").exists():
                if way in OWN:
                    twincal_motion(given.program.resolve(), way, seed, folder, limits, names)
                else:
                    command = [sys.executable, __file__, "--folder", given.folder, "--acceleration-time", str(given.acceleration_time), "--one", way, str(seed)]
                    with (folder / f"{name}.log").open("w") as log:
                        subprocess.run(command, check=True, stdout=log, stderr=log, timeout=SLOWEST)
            pair = judged(folder, name, model, limits, judges)
            found[way].append(pair)
            print(name, json.dumps({"cpu": round(pair[0]["cpu"], 1)} | ({"limits": pair[1]["limits"], "raw": pair[1]["raw"]} if pair[1] else {})),
                  flush=True)  # fmt: skip
    tables(found, judges)


if __name__ == "__main__":
    main()
