"""Studies: one case, many runs, because friction, joints and geometry of old masonry are never known.

``plan`` reads the study file, ``sampling`` draws the runs, ``single`` carries out one, ``campaign`` all of them on
Dask, ``ledger`` keeps what is finished; ``fragility``, ``sensitivity`` and ``pictures`` say what came out.
"""

from .campaign import study
from .study_file import Study, read_study

__all__ = ["Study", "read_study", "study"]
