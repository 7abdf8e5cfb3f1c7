"""What every test may rely on, however the tests were started."""

import os
import signal
import threading
from pathlib import Path
from typing import Any

import filelock
import pytest

FEW_MACHINES = 150  # of them some sixty without a gap: p-values have to reach below `which.ALPHA`
PLAIN = ("mains_interference", "clipping", "quantisation")

# A shell that starts a job in the background leaves SIGINT ignored, and children inherit that: programs that tests
# interrupt would never notice. A handler, unlike "ignore", is not inherited.
if threading.current_thread() is threading.main_thread() and signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session")
def learnt_home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A TWINGAP_HOME in which the diagnosis has learnt a few plain effects from few machines: it runs."""
    from twingap.gap.knowledge import train

    shared = tmp_path_factory.getbasetemp()
    shared = shared.parent if "PYTEST_XDIST_WORKER" in os.environ else shared
    home = shared / "learnt"
    with filelock.FileLock(shared / "learnt.lock"):  # workers share one training
        train(home / "gap", machines=FEW_MACHINES, jobs=2, among=PLAIN)
    return home


@pytest.fixture(scope="session")
def learnt(learnt_home: Path) -> Any:
    """What was learnt there."""
    from twingap.gap.knowledge import load, train

    return load(train(learnt_home / "gap", machines=FEW_MACHINES, jobs=2, among=PLAIN))


@pytest.fixture
def small_training(learnt_home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Lets commands find what was learnt there."""
    monkeypatch.setenv("TWINGAP_HOME", str(learnt_home))
    monkeypatch.setenv("TWINGAP_GAP_MACHINES", str(FEW_MACHINES))
    monkeypatch.setenv("TWINGAP_GAP_EFFECTS", ",".join(PLAIN))
