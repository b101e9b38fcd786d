"""The site of these pages: `sphinx-build -W docs site`, with what `pip install ".[docs]"` installs."""

import fourbar

project = "fourbar"
version = release = fourbar.__version__
extensions = ["myst_parser"]
myst_heading_anchors = 3
html_theme = "alabaster"
html_theme_options = {
    "description": "The planar four-bar linkage, from position to pin forces",
    **{"page_width": "1300px", "body_max_width": "none", "code_font_size": "0.8em"},  # a docstring's 120 columns
}
html_show_copyright = False
exclude_patterns = ["ci"]
suppress_warnings = ["myst.xref_missing"]
