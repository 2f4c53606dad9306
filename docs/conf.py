"""How the manual is built: ``python -m sphinx -W -b html docs docs/_build``, without a network."""

import os
import re
import shutil
import subprocess
import sys
import warnings
from importlib.metadata import version as installed
from pathlib import Path

HERE = Path(__file__).parent
ROOT = HERE.parent
sys.path[:0] = [str(ROOT), str(HERE)]

project = "blockvis"
author = "The blockvis developers"
version = release = installed("blockvis")

extensions = [
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "numpydoc",
    "myst_parser",
    "sphinx_gallery.gen_gallery",
    # Formulas as pictures: a page that is opened from the disk has no network to fetch MathJax from.
    "matplotlib.sphinxext.mathmpl",
]
exclude_patterns = ["_build", "gallery", "tutorials", "generated/validation_tables.md", "walls_beside_engines.md"]
myst_enable_extensions = ["colon_fence", "deflist"]
myst_heading_anchors = 3
autosummary_generate = True
autodoc_typehints = "none"
numpydoc_show_class_members = False
mathmpl_fontsize = 12.0
mathmpl_srcset = ["2x"]

html_theme = "pydata_sphinx_theme"
html_title = "blockvis"
html_static_path = ["_static"]
html_css_files = ["manual.css"]
# Pages at the top have no section to navigate in.
html_sidebars: dict[str, list[str]] = {"*": []}
html_show_sourcelink = False
html_theme_options = {"show_prev_next": False, "navigation_with_keys": False, "secondary_sidebar_items": ["page-toc"]}
templates_path = ["_templates"]


sphinx_gallery_conf = {
    "examples_dirs": ["gallery", "tutorials"],
    "gallery_dirs": ["auto_gallery", "auto_tutorials"],
    "filename_pattern": r"\.py$",
    "within_subsection_order": "FileNameSortKey",
    "image_scrapers": ("pictures_written.show_pictures",),
    "abort_on_example_error": True,
    # Figures of responses and the player; paths that functions return are no news.
    "capture_repr": ("_repr_html_",),
    "download_all_examples": False,
    "show_memory": False,
    "show_signature": False,
    "min_reported_time": 10_000,
    "remove_config_comments": True,
}
# Blocks that a drawing leaves out, cut light pieces and the like: the scripts print what they are about.
warnings.filterwarnings("ignore", category=UserWarning, module="blockvis")

# A formula that cannot be drawn would be left out with a warning that Sphinx does not count.
warnings.filterwarnings("error", message="Could not render math expression")

#: Where the generated pages go; not in git.
GENERATED = HERE / "generated"


def write_generated(app) -> None:
    """Write the pages that come from the code: pictures and the validation tables."""
    GENERATED.mkdir(exist_ok=True)
    shutil.copytree(ROOT / "assets", HERE / "_static" / "assets", dirs_exist_ok=True)
    tables = GENERATED / "validation_tables.md"
    # Single pages are looked at with -D plot_gallery=0, which leaves out whatever takes long.
    if str(app.config.overrides.get("plot_gallery", 1)) in ("0", "False"):
        if not tables.is_file():
            tables.write_text("Not computed in this build.\n", encoding="utf-8")
        return
    # Two minutes of tests: not again while neither they nor the mechanics have changed.
    sources = [*(ROOT / "solver").rglob("*.py"), *(ROOT / "tests" / "validation").glob("*.py")]
    if tables.is_file() and tables.stat().st_mtime > max(path.stat().st_mtime for path in sources):
        return
    tool = ROOT / "tools" / "validation_tables.py"
    subprocess.run([sys.executable, str(tool), str(tables)], check=True, cwd=ROOT, env=dict(os.environ))


def bars_of_absolute_values(app, what, name, obj, options, lines) -> None:
    """Replace the bars of |T|, which reStructuredText takes for a substitution, by others that look alike."""
    lines[:] = [re.sub(r"\|([^\s|][^|]*)\|", "\N{DIVIDES}\\1\N{DIVIDES}", line) for line in lines]


def setup(app) -> None:
    """Have the generated pages written before the sources are read."""
    app.connect("builder-inited", write_generated, priority=100)
    app.connect("autodoc-process-docstring", bars_of_absolute_values, priority=900)
