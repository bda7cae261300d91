"""How long does the exported C function take?

    python studies/industrial_arms/export_speed.py [--robot panda]

Simulates an arm (simulate_arms.py), fits it with default candidates, exports C, compiles it with `cc -O2` and times calls on the
held-out states; the fastest of ten rounds, processor time of one core.
"""

import argparse
import json
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from acceptance import PROGRAM, run
from simulate_arms import ROBOTS

HARNESS = r"""
#include <stdio.h>
#include <time.h>
int twincal_evaluate(const double *, const double *, const double *, double *, double *, double *);
static double x[ROWS][3][N] = { {{0}} };
int main(int argc, char **argv)
{
    FILE *file = fopen(argv[argc - 1], "rb");
    if (!file || fread(x, sizeof x, 1, file) != 1) return 1;
    double best = 1e9, sum = 0;
    for (int round = 0; round < 10; round++) {
        struct timespec a, b;
        clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &a);
        for (int k = 0; k < 20 * ROWS; k++) {
            double tau[N], low[N], high[N];
            sum += twincal_evaluate(x[k % ROWS][0], x[k % ROWS][1], x[k % ROWS][2], tau, low, high) + tau[0] + high[N - 1];
        }
        clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &b);
        double each = ((b.tv_sec - a.tv_sec) * 1e9 + (b.tv_nsec - a.tv_nsec)) / (20.0 * ROWS);
        if (each < best) best = each;
    }
    printf("%.0f %g\n", best, sum);
    return 0;
}
"""


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--robot", choices=ROBOTS, default="panda")
    given = arguments.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        truth, _ = run(given.robot, 0.0, folder, 1)
        n = len(truth["joints"])
        export = [PROGRAM, "export", "--twin", folder / "out", "--to", "c", "-o", folder / "twin.c", "--json"]
        told = json.loads(subprocess.run(export, capture_output=True, check=True).stdout)
        log = np.genfromtxt(folder / "heldout.csv", delimiter=",", names=True)
        states = np.array([[log[f"{kind}{j + 1}"] for j in range(n)] for kind in ("q", "qd", "qdd")]).transpose(2, 0, 1)
        np.ascontiguousarray(states).tofile(folder / "states.bin")
        (folder / "main.c").write_text(f"#define N {n}\n#define ROWS {len(states)}\n" + HARNESS)
        subprocess.run(["cc", "-O2", "-D_POSIX_C_SOURCE=199309L", "-std=c99", folder / "twin.c", folder / "main.c", "-o", folder / "main", "-lm"], check=True)  # fmt: skip
        done = subprocess.run([folder / "main", folder / "states.bin"], capture_output=True, text=True, check=True)
        print(f"{given.robot}: {n} joints, {told['kept']} parameters in the interval, {told['steps']} steps: {done.stdout.split()[0]} ns per call; "
              f"interval within {100 * told['interval_error']:.2f} % of its width")  # fmt: skip


if __name__ == "__main__":
    main()
