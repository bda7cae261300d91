"""Fails if a source distribution lacks a file that its Rust code includes, or a licence.

    python tests/python/require_whole_sdist.py SDIST.tar.gz
"""

from __future__ import annotations

import os
import re
import sys
import tarfile
import tempfile
from pathlib import Path

LICENCES = ("LICENSE-MIT", "LICENSE-APACHE")
# A path in quotes, relative to the source file, or to the crate's folder with concat!(env!("CARGO_MANIFEST_DIR"), …).
INCLUDE = re.compile(
    r"include_(?:bytes|str)!\(\s*(concat!\(\s*env!\(\"CARGO_MANIFEST_DIR\"\)\s*,\s*)?\"([^\"]+)\""
)


def included(source: Path) -> list[Path]:
    """Files that a Rust file includes."""
    crate = next(own for own in source.parents if (own / "Cargo.toml").exists())
    found = INCLUDE.findall(source.read_text(encoding="utf-8"))
    return [
        Path(f"{crate}{path}") if by_crate else source.parent / path for by_crate, path in found
    ]


def missing(root: Path) -> list[str]:
    """What an unpacked source distribution lacks."""
    files = [(own, path) for own in sorted(root.rglob("*.rs")) for path in included(own)]
    if not files:
        raise SystemExit(f"{root.name}: no Rust file includes another; is this the sdist?")
    lacks = [
        f"{os.path.relpath(path, root)} of {own.relative_to(root)}"
        for own, path in files
        if not path.exists()
    ]
    return lacks + [name for name in LICENCES if not (root / name).exists()]


def main(sdist: str) -> int:
    with tempfile.TemporaryDirectory() as folder, tarfile.open(sdist) as archive:
        archive.extractall(folder, filter="data")
        [root] = Path(folder).iterdir()
        lacks = missing(root)
    for own in lacks:
        print(f"{sdist}: lacks {own}", file=sys.stderr)
    return 1 if lacks else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
