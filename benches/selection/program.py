"""`twincal fit` as one more method: config in, what result.json says out, with the processor time of the whole program."""

import json
import os
import subprocess

import numpy as np

# The paper's prior and likelihood (issue of the paper: every row independent, one variance).
PAPER = """[prior]
slab = { scaled_variance = 1000.0 }
inclusion = { probability = 0.2 }
noise = { shape = 0.001, scale = 0.001 }
[noise]
model = "iid"
per_joint = false
"""
REFUSED = 4  # exit code: these data cannot answer
OFF = "[signal]\ncutoff_hz = 0\n"


def fit(program, model, train, heldout, config, folder):
    """Runs the program on one thread; returns result.json (None where it refuses) and seconds of processor time."""
    (folder / "twincal.toml").write_text(config)
    command = [program, "fit", *train, *(["--heldout", *heldout] if heldout else []), "--model", model]
    command += ["--config", folder / "twincal.toml", "-o", folder / "out", "--force", "--threads", "1"]
    with open(folder / "words.txt", "w") as words:
        started = subprocess.Popen([str(c) for c in command], stdin=subprocess.DEVNULL, stdout=words, stderr=words)
        _, status, usage = os.wait4(started.pid, 0)
    started.returncode = os.waitstatus_to_exitcode(status)
    if started.returncode == REFUSED:
        return None, usage.ru_utime + usage.ru_stime
    if started.returncode not in (0, 3):
        raise RuntimeError(f"twincal fit: exit {started.returncode}\n{(folder / 'words.txt').read_text()}")
    return json.loads((folder / "out" / "result.json").read_text()), usage.ru_utime + usage.ru_stime


def answer(result, columns):
    """What a peer would return, for these columns; columns that the program dropped, or all after a refusal, are out."""
    terms = {term["name"]: term for term in result["terms"] if term["pip"] is not None} if result else {}
    out = {key: np.zeros(len(columns)) for key in ("beta", "low", "high", "chance")}
    for k, name in enumerate(columns):
        if name in terms:
            term = terms[name]
            out["beta"][k], out["chance"][k] = term["mean"], term["pip"]
            out["low"][k], out["high"][k] = term["interval95"]
    payload = next((c for c in result["components"] if c["name"] == "payload" and c["pip"] is not None), None) if result else None
    if payload:
        # Its own columns are about another point than these: what it is in its frame is told by its parameters, given that it is in.
        known = {p["name"]: p["mean"] or 0.0 for p in payload["parameters"]}
        known["m"] = known["mass"]
        known |= {f"m{axis}": known["mass"] * known[f"com_{axis}"] for axis in "xyz"}
        for k, name in enumerate(columns):
            if name.startswith("payload."):
                out["beta"][k] = payload["pip"] * known[name.removeprefix("payload.")]
                out["chance"][k] = payload["pip"]
    return out


def verdicts(result):
    """Kept or not, and the probability, of every component by name: kept is what is likelier in than not and seen by the data."""
    live = [c for c in (result or {"components": []})["components"] if c["pip"] is not None]
    return {c["name"]: (c["pip"] >= 0.5 and c["status"] != "unidentifiable", c["pip"]) for c in live}
