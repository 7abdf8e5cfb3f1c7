"""What every test may rely on, however the tests were started."""

import signal
import threading
from typing import Any

import pytest

# A shell that starts a job in the background leaves SIGINT ignored, and children inherit that: programs that tests
# interrupt would never notice. A handler, unlike "ignore", is not inherited.
if threading.current_thread() is threading.main_thread() and signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session")
def learnt() -> Any:
    """What the diagnosis has learnt, as it ships."""
    from twingap.gap.knowledge import shipped

    return shipped()
