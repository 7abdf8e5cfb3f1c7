"""The blind study: worlds of known truth, sealed; diagnosed; unsealed; scored beside what a reader would use instead.

It stands above both the virtual machines (`twingap.rigs`) and the diagnosis (`twingap.gap`), between which no arrow
leads either way.
"""

from twingap.study.runner import Study, run_study
from twingap.study.written import write_study

__all__ = ["Study", "run_study", "write_study"]
