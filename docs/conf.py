"""The documentation site, built by `python -m sphinx -W -n docs build/site`; its pages are those
beside this file.

What can be generated is: `site_pages` writes the catalogues, the pages of the tasks and the list of
public calls into `docs/generated/` before the pages are read.
"""

import sys
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

project, author = "tractexp", "the tractexp authors"
copyright = f"2026 {author}"
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "site_pages.mathml"]
exclude_patterns = ["site_pages"]
root_doc = "index"

myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 4  # links to headings, as other viewers of Markdown make them
html_math_renderer = "mathml"
smartquotes = False  # X' is a reactance

highlight_language = "none"  # what has no language is a terminal's answer
default_role = "code"  # single backticks of docstrings
autodoc_typehints = "signature"
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_use_ivar = True  # attributes are no targets of links: several classes have a name
autodoc_member_order = "bysource"
# types of signatures are no links; links of pages are checked all the same
nitpick_ignore_regex = [("py:.*", ".*")]

html_theme = "furo"
html_title = "tractexp"
html_static_path = ["site_pages/static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sphinx = False


def generate(app: Any) -> None:
    """Write the pages that plugins and public calls make themselves."""
    from site_pages import generated

    generated.write(HERE / "generated")


def setup(app: Any) -> None:
    app.connect("builder-inited", generate)
