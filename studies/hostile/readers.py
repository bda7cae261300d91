"""Every reader against damaged files: 20 cuts, 20 bit flips, 20 hostile beginnings and 20 hostile values of fields each.

    python readers.py [--program twincal] [--only mcap,urdf] [--seed 1] [--cells cells.csv]

Every cell is one run of the program. It must end by itself with exit code 0, 1, 2, 3 or 4, within 5 s of CPU time and 512 MB, and leave the
damaged file as it was. Memory counts the fork of this script, about 75 MB. Printed as Markdown, per reader and damage: how many ended with an error, with a finding that the good file does not
have, and silently; the longest CPU time and the most memory. Exit code 1 if a cell breaks a rule.
"""

import argparse
import csv
import hashlib
import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path

import damage
from good_files import ASSETS, good_table, log_bytes, write_log

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = Path(os.environ.get("TWINCAL", ROOT / "target/release/twincal"))
LOGS = ("csv", "parquet", "arrow", "arrows", "npz", "mcap", "db3", "rosbag2")
READERS = (*LOGS, "urdf", "mjcf", "toml", "twin")
KINDS = ("cut", "flip", "beginning", "value")
SECONDS, MEGABYTES = 5.0, 512
GOOD_CODES = (0, 1, 2, 3, 4)


@dataclass
class Ended:
    """How one run of the program ended."""

    code: int  # negative: signal
    seconds: float  # of CPU
    megabytes: float
    out: str
    error: str


def run(command, folder):
    """Runs the program with bounds of its own; CPU time and memory are those of this process alone."""
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as error:
        bound = lambda: (resource.setrlimit(resource.RLIMIT_CPU, (30, 30)), resource.setrlimit(resource.RLIMIT_AS, (4 << 30, 4 << 30)))
        child = subprocess.Popen(command, cwd=folder, stdout=out, stderr=error, stdin=subprocess.DEVNULL, preexec_fn=bound)
        limit = time.monotonic() + 120
        while True:
            done, status, used = os.wait4(child.pid, os.WNOHANG)
            if done:
                break
            if time.monotonic() > limit:
                child.kill()
            time.sleep(0.002)
        child.returncode = os.waitstatus_to_exitcode(status)
        texts = [file.seek(0) or file.read().decode("utf-8", "replace") for file in (out, error)]
    return Ended(child.returncode, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024, *texts)


class Place:
    """A folder with good files, and the command that reads the damaged one among them."""

    def __init__(self, reader, folder, program, seed):
        self.reader, self.folder, self.program, self.seed = reader, folder, program, seed
        folder.mkdir(parents=True, exist_ok=True)
        shutil.copy(ASSETS / "arm.urdf", folder / "arm.urdf")
        (folder / "good.csv").write_bytes(log_bytes("csv", good_table()))
        self.target, self.given = self.make()
        self.good = self.target.read_bytes()

    def make(self):
        """Writes the good file; returns the file whose bytes are damaged and the path that the program is given."""
        if self.reader in LOGS:
            return write_log(self.reader, self.folder, good_table())
        if self.reader in ("urdf", "mjcf"):
            path = self.folder / {"urdf": "model.urdf", "mjcf": "model.xml"}[self.reader]
            shutil.copy(ASSETS / path.name.replace("model", "arm"), path)
            return path, path
        if self.reader == "toml":
            path = self.folder / "twincal.toml"
            path.write_text('[model]\nfile = "arm.urdf"\n')
            return path, path
        twin = self.folder / "twin"
        done = run([self.program, "fit", ASSETS / "train1.parquet", "--model", "arm.urdf", "-o", "twin", "--force"], self.folder)
        assert done.code in (0, 3), done.error
        return twin / "twin.json", twin

    def command(self, kind):
        """What is run on the damaged file: `doctor` where the numbers of a log are wrong."""
        if self.reader in LOGS:
            return [self.program, "doctor" if kind == "value" else "inspect", self.given, "--model", "arm.urdf", "--json"]
        if self.reader == "toml":
            return [self.program, "inspect", "good.csv", "--model", "arm.urdf", "--config", self.given, "--json"]
        if self.reader == "twin":
            return [self.program, "predict", "good.csv", "--twin", self.given, "-o", "out.csv", "--force", "--json"]
        return [self.program, "inspect", "good.csv", "--model", self.given, "--json"]

    def put(self, data):
        """Puts these bytes in the file's place; a twin's manifest agrees with them."""
        self.target.write_bytes(data)
        if self.reader == "twin":
            manifest = self.given / "manifest.json"
            self.manifest = getattr(self, "manifest", None) or manifest.read_text()
            tree = json.loads(self.manifest)
            tree["files"][self.target.name] = {"bytes": len(data), "sha256": hashlib.sha256(data).hexdigest()}
            manifest.write_text(json.dumps(tree))

    def damages(self, kind):
        """Twenty functions that put a damaged file in place."""
        if kind == "value" and self.reader in LOGS:
            return self.log_values()
        text = self.good.decode() if self.reader in ("urdf", "mjcf", "toml", "twin") else ""
        if kind == "cut":
            made = damage.cuts(self.good)
        elif kind == "flip":
            made = damage.flips(self.good, self.seed)
        elif kind == "beginning":
            special = {"urdf": damage.xml_beginnings, "mjcf": damage.xml_beginnings, "toml": damage.toml_beginnings}
            made = special[self.reader](text) if self.reader in special else damage.beginnings(self.good, self.seed)
        else:
            values = {"urdf": damage.urdf_values, "mjcf": damage.mjcf_values, "toml": damage.toml_values,
                      "twin": lambda text: damage.json_values(text, self.seed)}  # fmt: skip
            made = values[self.reader](text)
        return [lambda data=data: self.put(data) for data in made]

    def log_values(self):
        """Twenty hostile values of a log; of a bag's folder those of its metadata."""
        if self.reader == "rosbag2":
            return [lambda data=data: self.put(data) for data in damage.metadata_values(self.good.decode())]
        tables = damage.tables(good_table())
        if self.reader in ("mcap", "db3"):
            changes = damage.message_changes()
            return [lambda table=table: write_log(self.reader, self.folder, table) for table in tables[:10]] + [
                lambda change=change: write_log(self.reader, self.folder, good_table(), change) for change in changes]  # fmt: skip
        return [lambda table=table: write_log(self.reader, self.folder, table) for table in tables]


def said(ended):
    """Findings of a run, as (code, subject, count)."""
    try:
        tree = json.loads(ended.out)
    except ValueError:
        return set()
    out = set()

    def walk(node):
        if isinstance(node, dict):
            if {"code", "severity", "message"} <= node.keys():
                out.add((node["code"], node.get("subject", ""), node.get("count", 0)))
            for child in node.values():
                walk(child)
        elif isinstance(node, list):
            for child in node:
                walk(child)

    walk(tree)
    return out


@dataclass
class Cell:
    """One damaged file: what became of it."""

    reader: str
    kind: str
    number: int
    code: int
    answer: str  # "error", "finding", "silent" or "broken"
    seconds: float
    megabytes: float
    words: str


def cell(place, kind, number, clean):
    """Runs the program on the file that lies in place."""
    before = place.target.read_bytes()
    ended = run(place.command(kind), place.folder)
    if ended.code in GOOD_CODES and ended.seconds > SECONDS:
        # a loaded machine counts more CPU time for the same work
        ended = min(ended, run(place.command(kind), place.folder), key=lambda e: e.seconds)
    more = said(ended) - clean
    if ended.code not in GOOD_CODES or ended.seconds > SECONDS or ended.megabytes > MEGABYTES or place.target.read_bytes() != before:
        answer = "broken"
    elif ended.code in (2, 4):
        answer = "error"
    else:
        answer = "finding" if more else "silent"
    errors = [line for line in ended.error.splitlines() if line.startswith(("error", "warning", "thread", "memory"))]
    words = " ".join(errors)[:300] or " ".join(sorted({code for code, _, _ in more}))
    return Cell(place.reader, kind, number, ended.code, answer, ended.seconds, ended.megabytes, words)


def attack(reader, program, seed, kinds=KINDS, count=damage.COUNT):
    """All cells of one reader."""
    cells = []
    with tempfile.TemporaryDirectory() as name:
        place = Place(reader, Path(name), program, seed)
        for kind in kinds:
            clean = run(place.command(kind), place.folder)
            assert clean.code in (0, 3), f"{reader}: the good file ends with {clean.code}\n{clean.error}"
            known = said(clean)
            for number, put in enumerate(place.damages(kind)[:: damage.COUNT // count]):
                put()
                cells.append(cell(place, kind, number, known))
            place.put(place.good)
            if reader == "rosbag2":
                place.make()
    return cells


def table(cells):
    """Markdown, one line per reader and damage, and lines for what is broken."""
    rows = defaultdict(list)
    for c in cells:
        rows[c.reader, c.kind].append(c)
    lines = ["| reader | damage | error | finding | silent | broken | CPU, s | MB |", "|---|---|---|---|---|---|---|---|"]
    for (reader, kind), group in rows.items():
        counts = [sum(c.answer == answer for c in group) for answer in ("error", "finding", "silent", "broken")]
        worst = f"{max(c.seconds for c in group):.2f} | {max(c.megabytes for c in group):.0f}"
        lines.append(f"| {reader} | {kind} | {' | '.join(map(str, counts))} | {worst} |")
    broken = [c for c in cells if c.answer == "broken"]
    more = [f"broken: {c.reader}, {c.kind} {c.number}: exit {c.code}, {c.seconds:.1f} s, {c.megabytes:.0f} MB: {c.words}" for c in broken]
    return lines, more


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--program", type=Path, default=PROGRAM)
    arguments.add_argument("--only", default="", help="readers, with commas")
    arguments.add_argument("--seed", type=int, default=1)
    arguments.add_argument("--cells", type=Path, help="CSV with every cell")
    given = arguments.parse_args()
    readers = given.only.split(",") if given.only else READERS
    cells = [c for reader in readers for c in attack(reader, given.program.resolve(), given.seed)]
    if given.cells:
        with given.cells.open("w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(Cell.__dataclass_fields__)
            writer.writerows([vars(c).values() for c in cells])
    lines, broken = table(cells)
    print("\n".join([*lines, "", *broken, f"{len(cells)} cells, {len(broken)} broken"]))
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
