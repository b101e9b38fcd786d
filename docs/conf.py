"""The site of these pages: `sphinx-build -W docs site`, with what `pip install ".[docs]"` installs.

Formulas are drawn by MathJax, which the browser fetches from the network; without it they stand as TeX.
"""

import fourbar

project = "fourbar"
version = release = fourbar.__version__
extensions = ["myst_parser", "sphinx.ext.mathjax"]
myst_enable_extensions = ["dollarmath", "amsmath"]
myst_heading_anchors = 3
html_theme = "furo"
html_title = f"fourbar {version}"
html_static_path = ["style"]
html_css_files = ["narrow.css"]
html_show_copyright = False
exclude_patterns = ["ci"]
