"""The documentation's site: ``python -m sphinx -W docs build/docs``."""

import re
from importlib import metadata

project, author = "warp_eulsph", "the warp_eulsph authors"
version = release = metadata.version("warp_eulsph")

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "sphinx_copybutton",
]
myst_enable_extensions = ["colon_fence", "deflist"]
myst_heading_anchors = 3
# Pages that run are run at every build: what they show is what the package does
nb_execution_mode, nb_execution_timeout = "force", 300
nb_execution_raise_on_error = nb_execution_in_temp = True
nb_output_stderr = "remove"

autodoc_member_order = "bysource"
autodoc_typehints = "none"  # the text says shapes and units, which types do not
napoleon_google_docstring, napoleon_numpy_docstring = True, False
napoleon_use_param = napoleon_use_rtype = False
napoleon_use_ivar = True

html_theme = "pydata_sphinx_theme"
html_title = "warp_eulsph"
html_theme_options = {
    "show_toc_level": 2,
    "navigation_with_keys": False,
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": [],
}
html_show_sourcelink = False
copyright = "the warp_eulsph authors, Apache-2.0"


def _keep_bars(app, what, name, obj, options, lines):
    """|v| is a length here, and would be a substitution in reStructuredText."""
    lines[:] = [re.sub(r"(``.*?``)|\|", lambda found: found[1] or r"\|", line) for line in lines]


def setup(app):
    """Called by Sphinx."""
    app.connect("autodoc-process-docstring", _keep_bars, priority=900)
