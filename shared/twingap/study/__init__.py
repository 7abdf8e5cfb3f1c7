"""Blind study: worlds of known truth are sealed, diagnosed, unsealed and scored, next to rival methods.

This package depends on the virtual machines (`twingap.rigs`) and on the diagnosis (`twingap.gap`). Neither of these
depends on the other.
"""

from twingap.study.runner import Study, run_study
from twingap.study.written import write_study

__all__ = ["Study", "run_study", "write_study"]
