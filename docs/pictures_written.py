"""Pictures of gallery scripts: those that they write as files."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

from sphinx_gallery.scrapers import figure_rst


def show_pictures(block: tuple[Any, ...], block_vars: dict[str, Any], gallery_conf: dict[str, Any]) -> str:
    """Move the pictures that a part of a script has written to where sphinx-gallery wants them, and show them.

    Parameters
    ----------
    block : tuple
        The part of the script.
    block_vars : dict
        ``src_file`` and ``image_path_iterator`` of the script.
    gallery_conf : dict
    """
    folder = Path(block_vars["src_file"]).parent
    shown = []
    for picture in sorted(folder.glob("*.png"), key=lambda path: path.stat().st_mtime_ns):
        shown.append(next(block_vars["image_path_iterator"]))
        shutil.move(picture, shown[-1])
    return str(figure_rst(shown, gallery_conf["src_dir"]))
