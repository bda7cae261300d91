"""Sphinx settings of the documentation: the pages of docs, and a reference that is made from the program (reference.py)."""

import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

project = "twincal"
author = "the authors of twincal"
release = tomllib.loads((ROOT / "Cargo.toml").read_text())["workspace"]["package"]["version"]
extensions = [
    "myst_nb",  # myst_parser with notebooks
    "autoapi.extension",  # the Python package from its sources, without importing it
    "sphinx.ext.napoleon",  # docstrings of NumPy's kind
]
autoapi_dirs = [str(ROOT / "crates/twincal-py/python")]
autoapi_root = "reference/python"
autoapi_options = ["members", "undoc-members", "imported-members", "show-module-summary"]
autoapi_own_page_level = "class"
autoapi_add_toctree_entry = False
autoapi_python_class_content = "both"
napoleon_google_docstring = False
napoleon_use_ivar = True
napoleon_use_rtype = False
nb_execution_mode = "off"  # docs/notebooks/run executes them
myst_enable_extensions = ["deflist", "dollarmath"]
myst_heading_anchors = 4
exclude_patterns = ["site", "**/.ipynb_checkpoints"]
html_theme = "pydata_sphinx_theme"
html_title = f"twincal {release}"
html_theme_options = {"show_prev_next": False, "navigation_with_keys": False, "use_edit_page_button": False}
html_show_sourcelink = False
html_static_path = ["static"]
html_css_files = ["notebook.css"]


def setup(app):
    """The README is no page of the site: its place is the first page."""

    def first_page(_, __, source):
        source[0] = re.sub(r"\]\((?:\.\./)+README\.md(#[^)]*)?\)", "](/index.md)", source[0])

    app.connect("source-read", first_page)
