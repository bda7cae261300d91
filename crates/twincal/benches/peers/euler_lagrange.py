"""NumPy's time for the Euler-Lagrange columns of the planar 2R arm's 17 generic terms, called by euler_lagrange.rs.

The formulas are written by hand, sines and cosines are computed once, results go to memory that exists already: the best
a person would do. Prints the least seconds per sample and the sum of every entry, joint by joint.
"""

import json
import sys
import time

import numpy as np


def columns(q1, q2, v1, v2, a1, a2, out1, out2):
    s1, c1, s2, c2 = np.sin(q1), np.cos(q1), np.sin(q2), np.cos(q2)
    s12, c12 = np.sin(q1 + q2), np.cos(q1 + q2)
    v11, v12, v22 = v1 * v1, v1 * v2, v2 * v2
    one = ((1.0, 0.0), (c2, -s2), (s2, c2))
    i = j = 0
    for n, (h, dh) in enumerate(one):  # qd1^2 h(q2)
        if n == 0:
            out1[i] = 2.0 * a1
        else:
            out1[i] = 2.0 * (a1 * h + v12 * dh)
            out2[j] = -v11 * dh
            j += 1
        i += 1
    for n, (h, dh) in enumerate(one):  # qd1 qd2 h(q2)
        out1[i] = a2 if n == 0 else a2 * h + v22 * dh
        out2[j] = a1 if n == 0 else a1 * h
        i, j = i + 1, j + 1
    for n, (h, dh) in enumerate(one):  # qd2^2 h(q2)
        out2[j] = 2.0 * a2 if n == 0 else 2.0 * a2 * h + v22 * dh
        j += 1
    out1[i], out1[i + 1] = s1, -c1  # cos(q1), sin(q1)
    out2[j], out2[j + 1] = s2, -c2
    out1[i + 2], out1[i + 3] = s12, -c12
    out2[j + 2], out2[j + 3] = s12, -c12
    out1[i + 4] = -2.0 * q1
    out2[j + 4] = -2.0 * q2


def main():
    n, repeats = int(sys.argv[1]), int(sys.argv[2])
    k = np.arange(n, dtype=np.float64)
    motion = [c * np.sin(f * k + p) for c, f, p in json.loads(sys.argv[3])]
    out1, out2 = np.empty((11, n)), np.empty((13, n))
    best = float("inf")
    for _ in range(repeats):
        start = time.process_time()
        columns(*motion, out1, out2)
        best = min(best, time.process_time() - start)
    sums = [float(np.abs(row).sum()) for row in (*out1, *out2)]
    print(json.dumps({"numpy": np.__version__, "seconds_per_sample": best / n, "sums": sorted(sums)}))


if __name__ == "__main__":
    main()
