"""Sphinx's settings for the documentation as a site: one theme, Markdown as it is, equations as MathML.

Sphinx and not MkDocs: its search and its pages work from disk without a server, and it reads the functions' docstrings.
Start with stage.py, which lays the pages out that are read here.
"""

from __future__ import annotations

import shutil
import sys
from importlib.metadata import version as installed_version
from pathlib import Path

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxTranslator

sys.path.insert(0, str(Path(__file__).parent))

project = "feedsim"
author = "the feedsim authors"
copyright = "the feedsim authors, MIT licence"
version = release = installed_version("feedsim")

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx_copybutton"]
root_doc = "index"
source_suffix = {".md": "markdown"}
myst_enable_extensions = ["dollarmath", "attrs_block", "colon_fence", "deflist"]
myst_heading_anchors = 4
autodoc_typehints = "none"
autodoc_member_order = "bysource"
python_use_unqualified_type_names = True
add_module_names = False
copybutton_prompt_text = r">>> |\.\.\. |\$ "
copybutton_prompt_is_regexp = True
highlight_language = "text"
nitpicky = False

html_theme = "furo"
html_title = "feedsim"
html_static_path = ["_static"]
html_css_files = ["feedsim.css"]
html_search_scorer = str(Path(__file__).with_name("scorer.js"))
html_show_sourcelink = False
html_copy_source = False
html_show_sphinx = False
html_last_updated_fmt = None
html_theme_options = {
    "navigation_with_keys": True,
    "light_css_variables": {"color-brand-primary": "#0060a0", "color-brand-content": "#0060a0"},
    "dark_css_variables": {"color-brand-primary": "#5ab4e6", "color-brand-content": "#5ab4e6"},
}


def _mathml(self: SphinxTranslator, node: nodes.Element) -> None:
    """Write an equation as MathML: every browser sets it, without a script and without a request."""
    display = isinstance(node, nodes.math_block)
    mathml = convert(node.astext(), display="block" if display else "inline")
    self.body.append(f'<div class="math">{mathml}</div>' if display else mathml)
    raise nodes.SkipNode


# What the theme and docutils leave out for keyboards and screen readers: what scrolls can be reached, parts have names.
ACCESSIBLE = (
    ('<p class="caption" role="heading">', '<p class="caption" role="heading" aria-level="2">'),
    ('<aside class="sidebar-drawer">', '<aside class="sidebar-drawer" aria-label="All pages">'),
    ('<aside class="toc-drawer', '<aside aria-label="This page" class="toc-drawer'),
    ("<pre", '<pre tabindex="0"'),
    ('<div class="table-wrapper', '<div tabindex="0" class="table-wrapper'),
    ('<div class="math">', '<div class="math" tabindex="0">'),
    ('<th class="head"><p></p></th>', "<td></td>"),
    ('<div id="search-results"></div>', '<h1>Search</h1><div id="search-results"></div>'),
)


def _accessible(app: Sphinx, exception: Exception | None) -> None:
    """Complete the pages as they were written; the theme has no setting for this. Then what lies beside them."""
    for path in Path(app.outdir).rglob("*.html") if exception is None else ():
        text = path.read_text(encoding="utf-8")
        for before, after in ACCESSIBLE:
            text = text if after in text and after != "<td></td>" else text.replace(before, after)  # written before
        path.write_text(text, encoding="utf-8")
    if exception is None and (beside := Path(app.srcdir) / "beside").is_dir():
        shutil.copytree(beside, app.outdir, dirs_exist_ok=True)


def setup(app: Sphinx) -> None:
    """Register the writer of equations in place of MathJax, which would be a script of a megabyte."""
    app.connect("build-finished", _accessible)
    app.add_node(nodes.math, override=True, html=(_mathml, None))
    app.add_node(nodes.math_block, override=True, html=(_mathml, None))
