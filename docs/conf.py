"""Settings of the documentation (Sphinx): `make docs` builds it into docs/_build, every warning is an error."""

import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parent)]  # docs/building, and the program that the reference is made from

project = "planetpose"
author = "the planetpose developers"
copyright = author
extensions = ["myst_parser", "building.mathml", "building.generated", "building.sidebar"]
source_suffix = {".md": "markdown"}
exclude_patterns = ["_build", "building", "notebooks"]
smartquotes = False
highlight_language = "none"

myst_enable_extensions = ["dollarmath", "colon_fence", "deflist"]
myst_heading_anchors = 3

html_theme = "furo"
html_title = "planetpose"
html_static_path = ["_static"]
html_css_files = ["planetpose.css"]
html_math_renderer = "mathml"
html_copy_source = False
html_show_copyright = False
html_show_sphinx = False
