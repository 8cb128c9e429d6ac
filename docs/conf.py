"""The site: `make docs` builds it with Sphinx, MyST and furo, without a network, into build/docs."""

from __future__ import annotations

import sys
import tomllib
from hashlib import sha256
from importlib.metadata import version as installed
from pathlib import Path

DOCS = Path(__file__).parent
ROOT = DOCS.parent
sys.path[:0] = [str(DOCS), str(ROOT)]


def sources() -> str:
    """A digest of all that outputs of pages depend on: the package's sources, robots, and versions of what computes."""
    digest = sha256()
    for path in sorted([*(ROOT / "robot_dyn").rglob("*"), *(ROOT / "urdf").rglob("*")]):
        if path.is_file() and "__pycache__" not in path.parts:
            digest.update(path.relative_to(ROOT).as_posix().encode() + path.read_bytes())
    digest.update("".join(installed(name) for name in ("pin", "numpy", "scipy", "casadi", "llvmlite")).encode())
    return digest.hexdigest()[:16]


project = "robot_dyn"
author = "the robot_dyn developers"
copyright = f"2026, {author}"  # noqa: A001
with (ROOT / "pyproject.toml").open("rb") as file:
    version = release = tomllib.load(file)["project"]["version"]

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.intersphinx", "sphinx.ext.napoleon", "site_parts"]
# names of other packages link to their pages, by inventories that are kept here: the site is built without a network
intersphinx_mapping = {
    name: (address, str(DOCS / "data" / "inventories" / f"{name}.inv"))
    for name, address in {
        "python": "https://docs.python.org/3",
        "numpy": "https://numpy.org/doc/stable",
        "scipy": "https://docs.scipy.org/doc/scipy/reference",
    }.items()
}
root_doc = "README"
include_patterns = ["**.md"]

html_theme = "furo"
html_title = "robot_dyn"
html_static_path = ["static"]
html_css_files, html_js_files = ["site.css"], ["site.js"]
html_copy_source = html_show_sourcelink = False
pygments_style, pygments_dark_style = "a11y-high-contrast-light", "a11y-high-contrast-dark"

myst_enable_extensions = ["dollarmath", "colon_fence", "deflist"]
myst_heading_anchors = 4
html_math_renderer = "mathml"

package_digest = sources()
nb_execution_mode = "cache"
nb_execution_cache_path = str(ROOT / "build" / "docs_cache" / package_digest)
nb_execution_timeout = 240
nb_execution_raise_on_error = True
nb_execution_show_tb = True

autodoc_typehints = "signature"
autodoc_type_aliases = {"ArrayLike": "numpy.typing.ArrayLike"}  # its definition is long
autodoc_member_order = "bysource"
autodoc_class_signature = "mixed"
napoleon_numpy_docstring = False
napoleon_use_ivar = True
napoleon_attr_annotations = False
python_use_unqualified_type_names = True
toc_object_entries_show_parents = "hide"
