"""Sphinx settings of the documentation: the pages of docs, and a reference that is made from the program (reference.py)."""

import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

project = "twincal"
author = "the authors of twincal"
release = tomllib.loads((ROOT / "Cargo.toml").read_text())["workspace"]["package"]["version"]
extensions = ["myst_parser"]
myst_enable_extensions = ["deflist", "dollarmath"]
myst_heading_anchors = 4
exclude_patterns = ["site"]
html_theme = "pydata_sphinx_theme"
html_title = f"twincal {release}"
html_theme_options = {"show_prev_next": False, "navigation_with_keys": False, "use_edit_page_button": False}
html_show_sourcelink = False


def setup(app):
    """The README is no page of the site: its place is the first page."""
    app.connect("source-read", lambda _, __, source: source.__setitem__(0, source[0].replace("](../README.md)", "](index.md)")))
