"""Sphinx: `sphinx-build -W docs docs/_build/html`. Nothing here needs the network."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "_ext"))

import feeder_sim

project = "feeder_sim"
author = "feeder_sim maintainers"
copyright = author
version = release = feeder_sim.__version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_design",
    "mathml",
    "notebooks",
    "reference",
]
exclude_patterns = ["_build"]
source_suffix = {".md": "markdown"}
myst_enable_extensions = ["colon_fence", "dollarmath", "fieldlist"]
myst_heading_anchors = 4

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_class_signature = "separated"
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True

html_math_renderer = "mathml"
html_theme = "furo"
html_title = f"feeder_sim {release}"
html_static_path = ["_static"]
html_css_files = ["wide.css"]
smartquotes = False  # keys and values are quoted as they are written
html_copy_source = False
