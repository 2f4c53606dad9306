"""Studies: many runs of one case, because friction, joints and geometry of old masonry are uncertain.

``study_file`` reads the study, ``sampling`` chooses the runs, ``run_one`` carries out one, ``campaign`` all of them on
Dask, ``study_folder`` records the finished ones; ``fragility``, ``sensitivity``, ``summary`` and ``pictures`` evaluate
them.
"""

from .campaign import study
from .study_file import Study, read_study

__all__ = ["Study", "read_study", "study"]
