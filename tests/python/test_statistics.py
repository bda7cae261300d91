"""Statistics of real logs: a fit to them is the fit to the logs. Truth: the fit to the logs themselves, and the schema."""

import json
import subprocess

import pyarrow as pa
import pytest
from conftest import ROOT, SHARED, program, twincal
from test_result_schema import problems

CASES = {
    "ur10": ("model.urdf", ["run0.parquet"], [], None),
    "double_pendulum": (
        "model_as_published.urdf",
        [f"run{number}.csv" for number in range(2, 8)],
        ["run0.csv", "run1.csv"],
        ROOT / "examples" / "double_pendulum" / "twincal.toml",
    ),
}


def pairs(a, b, place=""):
    """Every number of two values of the same form."""
    if isinstance(a, dict):
        assert a.keys() == b.keys(), place
        for key in a:
            yield from pairs(a[key], b[key], f"{place}/{key}")
    elif isinstance(a, list):
        assert len(a) == len(b), place
        for index, (x, y) in enumerate(zip(a, b)):
            yield from pairs(x, y, f"{place}/{index}")
    elif isinstance(a, (int, float)) and not isinstance(a, bool) and b is not None:
        yield place, a, b
    else:
        assert a == b, place


# What needs the rows themselves.
OF_ROWS = {"heavy_tails", "noise_varies_with_speed", "noise_varies_with_load", "depends_on_cutoff"}


def compare_findings(whole, own):
    """The same findings in the same words, but for those that need rows."""
    of = lambda result: {(f["code"], f["subject"], f["message"]) for f in result["findings"]}  # noqa: E731
    assert of(own) <= of(whole)
    assert {code for code, _, _ in of(whole) - of(own)} <= OF_ROWS


@pytest.mark.parametrize("robot", CASES)
def test_a_fit_to_statistics_is_the_fit_to_the_logs(robot, tmp_path):
    data = SHARED / robot
    if not data.is_dir():
        pytest.skip(f"../shared/data/{robot} is not there")
    model, logs, heldout, config = CASES[robot]
    logs, heldout = [data / log for log in logs], [data / log for log in heldout]
    settings = ["--config", config] if config else ["--no-config"]
    tested = ["--heldout", *heldout] if heldout else []
    twincal("statistics", *logs, "--model", data / model, *settings, "-o", tmp_path / "st")
    files = sorted((tmp_path / "st").glob("*.arrow"))
    assert len(files) == len(logs) and all(file.stat().st_size < 5e6 for file in files)
    twincal("fit", *logs, "--model", data / model, *settings, *tested, "-o", tmp_path / "whole")
    twincal("fit", "--statistics", *files, *settings, *tested, "-o", tmp_path / "own")
    whole, own = (json.loads((tmp_path / name / "result.json").read_text()) for name in ("whole", "own"))
    same = ["components", "terms", "groups", "noise", "prior", "likelihood", "curves", "inference"]
    for key in same + (["validation"] if heldout else []):
        for place, a, b in pairs(whole[key], own[key], key):
            # 1e-11: a centre of mass of -1 mm has an interval of ± 2 m
            assert a == pytest.approx(b, rel=1e-9, abs=1e-11), place
    assert problems(whole) == problems(own) == []
    compare_findings(whole, own)
    if heldout:
        # claims of one weight stand in the order in which logs were read
        for result in (whole, own):
            result["assessment"]["claims"].sort(key=lambda claim: (claim["code"], str(claim["subject"])))
        for place, a, b in pairs(whole["assessment"], own["assessment"], "assessment"):
            assert a == pytest.approx(b, rel=1e-9, abs=1e-11), place
    assert not [finding for finding in whole["findings"] if finding["code"].startswith("ripple_")]
    assert own["validation"]["split"] == ("heldout_logs" if heldout else "not_tested")
    assert own["assessment"]["answer"] in ("yes", "yes_within_limits", "not_yet", "no")
    if not heldout:
        assert (own["assessment"]["answer"], own["assessment"]["reason"]) == ("not_yet", "not_tested")


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Statistics of two logs of the example arm."""
    folder, arm = tmp_path_factory.mktemp("files"), ROOT / "examples" / "arm"
    (folder / "few.toml").write_text('[library]\ngeneric = false\nfamilies = ["payload", "viscous", "coulomb"]\n')
    logs = [arm / "run.csv", arm / "monday.csv"]
    twincal("statistics", *logs, "--model", arm / "arm.urdf", "--config", folder / "few.toml", "-o", folder)
    return [folder / f"{log.name}.arrow" for log in logs]


def test_other_programs_read_the_files(files, tmp_path):
    """By Arrow's own reader: a row per log in the order of names, and as many numbers as its text says."""
    merged = tmp_path / "merged.arrow"
    twincal("merge", *files, "-o", merged)
    read = pa.ipc.open_file(merged)
    metadata = json.loads(read.schema.metadata[b"twincal.statistics"])
    assert metadata["format"] == 5 and read.num_record_batches == 2
    names = ["monday.csv", "run.csv"]
    assert [log["name"] for log in metadata["logs"]] == names
    for number, name in enumerate(names):
        [row] = read.get_batch(number).to_pylist()
        text = json.loads(row["log"])
        assert text["header"]["about"]["facts"]["summary"]["name"] == name
        assert sum(record[-1] for record in text["records"]) == len(row["value"]) > 1000


@pytest.mark.parametrize(
    ("write", "says"),
    [
        (lambda table, to: pa.ipc.new_file(to, table.schema, options=pa.ipc.IpcWriteOptions(compression="zstd")), "row 0 is compressed"),
        (lambda table, to: pa.ipc.new_file(to, table.schema), None),
        (lambda table, to: pa.ipc.new_stream(to, table.schema), "is no Arrow file"),
    ],
)
def test_files_that_another_program_wrote(files, tmp_path, write, says):
    """The same rows are the same statistics, another form is refused by its name."""
    table = pa.ipc.open_file(files[0]).read_all()
    other = tmp_path / "other.arrow"
    with other.open("wb") as to, write(table, to) as writer:
        writer.write_table(table)
    command = [program("twincal"), "merge", other, files[1], "-o", tmp_path / "merged.arrow"]
    done = subprocess.run(command, capture_output=True, text=True)
    if says:
        assert done.returncode == 2 and says in done.stderr and "other.arrow" in done.stderr, done.stderr
        return
    twincal("merge", *files, "-o", tmp_path / "own.arrow")
    assert (tmp_path / "merged.arrow").read_bytes() == (tmp_path / "own.arrow").read_bytes(), done.stderr


def test_logs_in_one_record_batch_are_refused(files, tmp_path):
    merged = tmp_path / "merged.arrow"
    twincal("merge", *files, "-o", merged)
    table, together = pa.ipc.open_file(merged).read_all().combine_chunks(), tmp_path / "together.arrow"
    with together.open("wb") as to, pa.ipc.new_file(to, table.schema) as writer:
        writer.write_table(table)
    command = [program("twincal"), "merge", together, "-o", tmp_path / "no.arrow"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 2 and "has 1 rows, its metadata name 2" in done.stderr, done.stderr
