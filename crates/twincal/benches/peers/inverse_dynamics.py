"""Pinocchio's least time per call of rnea for a URDF given as text, ns; called by inverse_dynamics.rs."""

import re
import sys
import time

import numpy as np
import pinocchio as pin


def main():
    model = pin.buildModelFromXML(re.sub(r"<mimic[^>]*/>", "", sys.argv[1]))
    data = model.createData()
    rng = np.random.default_rng(1)
    states = [(pin.randomConfiguration(model, -np.ones(model.nq), np.ones(model.nq)), rng.normal(size=model.nv), rng.normal(size=model.nv)) for _ in range(1000)]
    best = float("inf")
    for _ in range(100):
        start = time.process_time()
        for q, v, a in states:
            pin.rnea(model, data, q, v, a)
        best = min(best, time.process_time() - start)
    print(1e9 * best / len(states))


if __name__ == "__main__":
    main()
