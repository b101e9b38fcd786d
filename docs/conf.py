"""The site of these pages: `sphinx-build -W docs site`.

`pip install ".[docs]"` installs what it needs. Formulas become MathML, which browsers
draw by themselves: the site has no script for them and needs no network.
"""

import re
import runpy
from pathlib import Path

import imagesize
from docutils.nodes import SkipNode, image
from latex2mathml.converter import convert
from pygments.lexers.special import TextLexer

import fourbar

project = "fourbar"
version = release = fourbar.__version__
extensions = ["myst_parser"]
myst_enable_extensions = ["dollarmath", "amsmath"]
myst_heading_anchors = 3
html_theme = "furo"
html_title = f"fourbar {version}"
html_static_path = ["style"]
html_css_files = ["pages.css"]
# what index.md names in a <picture>, which the builder does not read
html_extra_path = ["crank_rocker.svg", "crank_rocker-linkage.svg"]
html_math_renderer = "mathml"
html_show_copyright = False
exclude_patterns = ["ci"]
TELEPHONE = 560
"""Width of a picture above which its words are too small on a telephone, px."""
SPACE = '<mspace width="0.17em" />'
"""Space on both sides of a function's name, as in TeX."""


def append_reference(app, page, source):
    """Append to a page what is made of the code: docstrings, options of commands."""
    if page in ("api", "commands"):
        source[0] += (
            "\n" + runpy.run_path(str(Path(__file__).with_name(f"{page}.py")))["text"]()
        )


def mark_wide_pictures(app, doctree):
    """Give pictures of many parts a class, by which a telephone shows them larger."""
    for picture in doctree.findall(image):
        width, _ = imagesize.get(Path(app.srcdir) / picture["uri"])
        if width > TELEPHONE:
            picture["classes"].append("of-many-parts")


def setup(app):
    """Write formulas as MathML, in the line or below it.

    The pages of reference are completed too.
    """

    def written(display):
        def write(page, node):
            formula = convert(
                node.astext().replace("{aligned}", "{align*}"),
                display=display,
            )
            page.body.append(
                re.sub(
                    r"<mi>[a-z]{3}</mi>(?!<mo[^>]*>&#x00028;)",
                    rf"<mrow>{SPACE}\g<0>{SPACE}</mrow>",
                    formula,
                )
            )
            raise SkipNode

        return write, None

    app.add_html_math_renderer("mathml", written("inline"), written("block"))
    app.add_lexer("csv", TextLexer)
    app.connect("source-read", append_reference)
    app.connect("doctree-read", mark_wide_pictures)
