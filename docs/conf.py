"""Settings of Sphinx for the documentation; `make docs` builds it into build/site."""

import subprocess
import sys
from pathlib import Path

DOCS = Path(__file__).resolve().parent
ROOT = DOCS.parent
sys.path.insert(0, str(ROOT / "scripts"))

from wheels import project_version  # noqa: E402

# Written when the site is built, from the stubs and docstrings of the package.
for script, folder in (("make_reference.py", "api"), ("make_notebooks.py", "notebooks")):
    subprocess.run([sys.executable, ROOT / "scripts" / script, DOCS / folder], check=True)

project = "Warp on MLIR"
author = "The developers of Warp on MLIR"
copyright = f"2026, {author}"
version = release = project_version()
html_title = f"Warp on MLIR {release}"
extensions = ["myst_parser", "sphinx_design", "sphinx_copybutton"]
myst_enable_extensions = ["colon_fence", "fieldlist"]
myst_heading_anchors = 3
# Single backticks in docstrings are code.
default_role = "code"
exclude_patterns = ["site", "templates", "README.md"]
html_theme = "furo"
html_theme_options = {"navigation_with_keys": True}
html_static_path = ["static"]
html_css_files = ["site.css"]
html_extra_path = ["notebooks", "versions.js"]
templates_path = ["templates"]
# Furo's, with the list of versions.
html_sidebars = {
    "**": [
        "sidebar/brand.html",
        "versions.html",
        "sidebar/search.html",
        "sidebar/scroll-start.html",
        "sidebar/navigation.html",
        "sidebar/scroll-end.html",
    ]
}
copybutton_prompt_text = r">>> |\.\.\. |\$ "
copybutton_prompt_is_regexp = True
# IR of the dialect has attributes that Pygments does not know; generated pages skip heading levels.
suppress_warnings = ["misc.highlighting_failure", "myst.header", "myst.xref_missing"]
# A page that no table of contents names yet is found by search and links.
suppress_warnings += ["toc.not_included"]
toc_object_entries_show_parents = "hide"
