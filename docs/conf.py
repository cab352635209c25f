"""The documentation site: `make site` makes it of the pages in this folder, README and docstrings.

Warnings are errors there, so a link or a reference that leads nowhere fails.
"""

import importlib.metadata

project = "utank-hil"
author = "the developers of utank-hil"
version = release = importlib.metadata.version("utank-hil")

root_doc = "docs/index"
include_patterns = [
    "SECURITY.md",
    "README.md",
    "CONTRIBUTING.md",
    "CHANGELOG.md",
    "configs/seas/README.md",
    "docs/**.md",
]
exclude_patterns = ["docs/evidence"]
extensions = ["myst_parser", "numpydoc", "sphinx.ext.autodoc", "sphinx.ext.viewcode"]

myst_heading_anchors = 4
numpydoc_show_class_members = False
autodoc_member_order = "bysource"
autodoc_typehints = "signature"  # docstrings repeat no type that says enough there

html_theme = "furo"
html_title = "utank-hil"
html_show_sphinx = False
html_copy_source = False
html_static_path = ["_static"]
html_css_files = ["site.css"]
