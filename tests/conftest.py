"""What every test may rely on, however the tests were started."""

import os
import shutil
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

# A shell that starts a job in the background leaves SIGINT ignored, and children inherit that: programs that tests
# interrupt would never notice. A handler, unlike "ignore", is not inherited.
if threading.current_thread() is threading.main_thread() and signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# Small trainings on many threads wait for each other for minutes where several workers share the cores.
os.environ.setdefault("OMP_NUM_THREADS", "1")


@pytest.fixture(autouse=True)
def one_thread() -> Iterator[None]:
    """Threads of torch and scikit-learn as stated above after each test: numba's kernels set those of their library."""
    yield
    if (torch := sys.modules.get("torch")) is not None and os.environ.get("OMP_NUM_THREADS") == "1":
        torch.set_num_threads(1)


@pytest.fixture(scope="session")
def learnt() -> Any:
    """What the diagnosis has learnt, as it ships."""
    from twingap.gap.knowledge import shipped

    return shipped()


@pytest.fixture(scope="module")
def few_trials() -> Iterator[None]:
    """Searches for the values of effects with fewer trials, where their precision is not what is tested."""
    from twingap.gap.search import evidence

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(evidence, "SAMPLES_TRIED", 6e6)
        yield


@pytest.fixture(scope="session")
def new_database(tmp_path_factory: pytest.TempPathFactory) -> Callable[[Path], str]:
    """Makes an empty tracking store at a path and returns its URI; a copy, since MLflow takes seconds to make one."""
    from twingap.track.mlflow import _quiet_mlflow

    template = tmp_path_factory.mktemp("store") / "mlflow.db"
    _quiet_mlflow().MlflowClient(f"sqlite:///{template}").search_experiments()

    def made(path: Path) -> str:
        path.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(template, path)
        return f"sqlite:///{path}"

    return made
