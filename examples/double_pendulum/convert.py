"""Turns the makers' records of the DFKI double pendulum (design C.1) into logs that twincal reads.

    git clone https://github.com/dfki-ric-underactuated-lab/double_pendulum
    git -C double_pendulum checkout 1e8544e
    python convert.py double_pendulum pendulum      # CLONE, folder to write

Writes run0.csv ... run7.csv (t, q, qd, torque from the drive current, commanded torque; SI units, nothing filtered) and
model_as_published.urdf. Python's standard library is enough.
"""

import csv
import sys
from pathlib import Path

# The makers' system-identification records of one afternoon, in time order.
RECORDS = ("143339", "143524", "143601", "143704", "143747", "143906", "144003", "144115")
# Makers' column -> ours. q = 0 hangs down, q2 is relative to the first link; signs are already those of the URDF.
COLUMNS = {"time": "t", "pos_meas": "q", "vel_meas": "qd", "tau_meas": "tau", "tau_con": "tau_cmd"}
MODEL = "design_C.1/model_1.0/acrobot.urdf"


def only(paths, what):
    """The first path of a search (the makers keep copies); none is an error that says what to look at."""
    paths = sorted(paths)
    if not paths:
        sys.exit(f"convert.py: {what} is not in this clone; is the commit 1e8544e checked out?")
    return paths[0]


def convert(source, target):
    """One record: column names as ours, nine digits (the encoders resolve 2e-4 rad)."""
    with open(source, newline="") as rows, open(target, "w", newline="") as out:
        reader, writer = csv.DictReader(rows), csv.writer(out, lineterminator="\n")
        theirs, ours = ["time"], ["t"]
        for name, short in list(COLUMNS.items())[1:]:
            theirs += [f"{name}1", f"{name}2"]
            ours += [f"{short}1", f"{short}2"]
        missing = [name for name in theirs if name not in (reader.fieldnames or [])]
        if missing:
            sys.exit(f"convert.py: {source} has no column {', '.join(missing)}; is it a record of this clone?")
        writer.writerow(ours)
        writer.writerows([format(float(row[name]), ".9g") for name in theirs] for row in reader)


def main(clone, folder):
    """Finds the records and the model in the clone and writes ours."""
    clone, folder = Path(clone), Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    for run, stamp in enumerate(RECORDS):
        record = f"20230629-{stamp}/trajectory.csv"
        source = only(clone.glob(f"data/experiment_records/design_C.1/**/{record}"), record)
        convert(source, folder / f"run{run}.csv")
        print(f"run{run}.csv  from {source.relative_to(clone)}")
    model = only(clone.glob(f"data/**/{MODEL}"), MODEL)
    (folder / "model_as_published.urdf").write_bytes(model.read_bytes())
    print(f"model_as_published.urdf  from {model.relative_to(clone)}")


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
