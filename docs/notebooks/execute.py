"""Executes notebooks in a copy of what they read; `run` beside this file says how it is called."""

import argparse
import os
import shutil
import sys
import tempfile
import time
from pathlib import Path

import nbformat
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
READ = ("examples/arm", "studies/planar_arm")  # folders of the clone that notebooks read
PENDULUM = "TWINCAL_PENDULUM"
NEEDS_PENDULUM = "double_pendulum"
LARGEST = 200_000  # bytes of a notebook with its outputs
CELL_SECONDS = 600


def pendulum():
    """The folder with the pendulum's files, or None where they are not there."""
    folder = Path(os.environ.get(PENDULUM) or ROOT / "pendulum").resolve()
    return folder if (folder / "model_as_published.urdf").is_file() else None


def environment(place):
    """Settings of the kernel: none of the user's, and figures within the notebook."""
    for name in ("IPYTHONDIR", "JUPYTER_CONFIG_DIR", "JUPYTER_DATA_DIR", "MPLCONFIGDIR"):
        folder = place / "settings" / name
        folder.mkdir(parents=True)
        os.environ[name] = str(folder)
    os.environ.pop("MPLBACKEND", None)
    if folder := pendulum():
        os.environ[PENDULUM] = str(folder)


def execute(name, place):
    """The notebook with its outputs; it runs in `docs/notebooks` of a copy of the clone."""
    folder = place / name / "docs" / "notebooks"
    folder.mkdir(parents=True)
    for read in READ:
        shutil.copytree(ROOT / read, place / name / read, ignore=shutil.ignore_patterns("__pycache__"))
    notebook = nbformat.read(HERE / f"{name}.ipynb", as_version=4)
    NotebookClient(
        notebook,
        timeout=CELL_SECONDS,
        kernel_name="python3",
        record_timing=False,
        extra_arguments=["--IPKernelApp.log_level=40"],  # no warning about the kernel's port
        resources={"metadata": {"path": str(folder)}},
    ).execute()
    return notebook


def stripped(notebook):
    """The notebook without what changes between runs or says where it ran."""
    notebook.metadata = {
        "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
        "language_info": {"name": "python"},
    }
    for cell in notebook.cells:
        cell.metadata = {key: value for key, value in cell.metadata.items() if key == "tags"}
        for output in cell.get("outputs", []):
            output.metadata = {}
    return notebook


def write(name, notebook):
    """Stores the notebook; refuses one that is too large, or that names a folder of this machine."""
    text = nbformat.writes(stripped(notebook)) + "\n"
    if len(text.encode()) > LARGEST:
        sys.exit(f"{name}: {len(text.encode())} bytes with its outputs; at most {LARGEST}: fewer or smaller figures")
    here = {str(ROOT), str(Path.home()), tempfile.gettempdir(), sys.prefix, os.environ.get(PENDULUM, "")} - {"", "/"}
    named = [folder for folder in sorted(here) if f"{folder}/" in text]
    if named:
        sys.exit(f"{name}: an output names {', '.join(named)}; print no folder of this machine")
    (HERE / f"{name}.ipynb").write_text(text, encoding="utf-8")


def main():
    """Command line."""
    names = sorted(path.stem for path in HERE.glob("*.ipynb"))
    parser = argparse.ArgumentParser(prog="docs/notebooks/run", description="Runs the notebooks of this folder.")
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"default: all of {', '.join(names)}")
    parser.add_argument("--write", action="store_true", help="store what the cells print and draw")
    asked = parser.parse_args()
    if unknown := [name for name in asked.names if name not in names]:
        parser.error(f"there is no notebook {', '.join(unknown)}; there are {', '.join(names)}")
    failed = []
    with tempfile.TemporaryDirectory(prefix="twincal-notebooks-") as place:
        environment(Path(place))
        for name in asked.names or names:
            if name == NEEDS_PENDULUM and pendulum() is None:
                print(f"skipped: {name} (no model_as_published.urdf; {PENDULUM} names its folder, docs/tutorial.md makes it)")
                continue
            began = time.monotonic()
            try:
                notebook = execute(name, Path(place))
            except CellExecutionError as error:
                failed.append(name)
                print(f"{name}: failed\n{error}", file=sys.stderr)
                continue
            if asked.write:
                write(name, notebook)
            print(f"{name}: passed in {time.monotonic() - began:.0f} s", flush=True)
    if failed:
        sys.exit(f"notebooks that failed: {', '.join(failed)}")


if __name__ == "__main__":
    main()
