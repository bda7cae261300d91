"""What it costs to fit arrays in the place of a Parquet file, and what importing and fitting keep.

    python benches/peers/arrays.py MODEL LOG.parquet [FITS]

Prints the CPU time of a fit to the file and of one to its columns as arrays (least of five, in turn), the time of the import, and by
how much resident memory grows between fit 20 and fit FITS (default 120; 0 leaves that out).
"""

from __future__ import annotations

import subprocess
import sys
import time

import pyarrow.parquet
import twincal


def resident() -> float:
    """Resident memory of this process, MB."""
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * 4096e-6


def cpu(call) -> float:
    """CPU seconds of a call, all threads."""
    began = time.process_time()
    call()
    return time.process_time() - began


def main() -> None:
    model, path = sys.argv[1:3]
    fits = int(sys.argv[3]) if len(sys.argv) > 3 else 120
    robot = twincal.Robot.from_urdf(model)
    frame = pyarrow.parquet.read_table(path).to_pandas()

    def of_file():
        return twincal.fit(robot, twincal.Log.read(path))

    def of_arrays():
        return twincal.fit(robot, twincal.Log.from_dataframe(frame, name="log"))

    seconds = [(cpu(of_file), cpu(of_arrays)) for _ in range(5)]
    file, arrays = (min(own) for own in zip(*seconds))
    print(f"fit to the file {file:.2f} s of CPU, to arrays {arrays:.2f} s: {100 * (arrays / file - 1):+.1f} %")
    code = "import time; t = time.perf_counter(); import twincal; print(time.perf_counter() - t)"
    times = [float(subprocess.run([sys.executable, "-c", code], capture_output=True, check=True, text=True).stdout) for _ in range(5)]
    print(f"import {min(times):.3f} s")
    after = {}
    for number in range(1, fits + 1):
        of_arrays()
        after[number] = resident()
    if fits > 20:
        print(f"resident memory after fit 20 {after[20]:.1f} MB, after fit {fits} {after[fits]:.1f} MB")


if __name__ == "__main__":
    main()
