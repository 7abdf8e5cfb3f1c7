"""Half of the records that a diagnosis simulates, in a second process: the same numbers, sooner, on two cores.

Evidence --once: records' conditions, grids, the simulator as given--> second process
simulator's values, effects, replicate --each time--> second process --> Views of every second record --+
                                       --meanwhile here--------------------> Views of the others -------+--> Views

Random streams depend on root, replicate and record alone, so that it does not matter where they are drawn. Whatever
goes wrong there (no process to be had, it was killed, a simulator that cannot be sent) is done here instead.
"""

from __future__ import annotations

import io
import pickle
from collections.abc import Iterator, Sequence
from concurrent.futures import Future
from contextlib import contextmanager
from itertools import zip_longest
from typing import TYPE_CHECKING, Any, Final

import cloudpickle
import numpy as np

from twingap.effects import Effect
from twingap.gap.calibrate import Calibrated
from twingap.gap.distance import Paired
from twingap.gap.evidence import Evidence
from twingap.gap.own_simulator import OwnSimulator
from twingap.gap.simulator import Simulator
from twingap.gap.view import RecordView
from twingap.gap.views import Grid, Views, measure
from twingap.records import Condition
from twingap.twins.twin_file import TwinSpec

if TYPE_CHECKING:
    from twingap.gap.view import Frame

_MOST_SENT: Final = 2e7
"""Samples of the user's own simulated records that are sent; more would be held in memory a second time."""
_IDLE_S: Final = 3600
"""Time without work after which the process ends by itself."""
_SENT_ALONE: Final = (bool, int, float, str, type(None))
"""Values of a simulator that are no heavier than a reference to them."""


@contextmanager
def second_process(wanted: bool) -> Iterator[SecondProcess | None]:
    """A process beside this one, where there is a core for it; it ends with the block, Ctrl-C included.

    Parameters
    ----------
    wanted : bool
        None is begun without.
    """
    import joblib
    from joblib.externals.loky import ProcessPoolExecutor

    if not wanted or joblib.cpu_count() < 2:
        yield None
        return
    try:
        executor = ProcessPoolExecutor(1, timeout=_IDLE_S)
    except OSError:  # no semaphores, no memory
        yield None
        return
    try:
        executor.submit(_wake)
        yield SecondProcess(executor)
    finally:
        executor.shutdown(wait=True, kill_workers=True)


class SecondProcess:
    """What can be asked of it once it knows a diagnosis's conditions and simulator."""

    def __init__(self, executor: Any) -> None:
        self._executor = executor
        self._known: dict[int, str] = {}
        self._kept: Simulator | None = None

    def take(
        self, evidence: Evidence, simulator: Simulator, places: Sequence[tuple[Sequence[Condition], Grid]]
    ) -> None:
        """Send what all simulations have in common.

        Parameters
        ----------
        evidence : Evidence
        simulator : Simulator
            As given: later ones are sent as what differs from it.
        places : sequence of (sequence of Condition, Grid)
            Records that will be simulated, and the grid of their views.
        """
        if isinstance(simulator, OwnSimulator) and sum(c.n_samples for c in simulator.sim.conditions) > _MOST_SENT:
            self._executor = None
            return
        self._kept = simulator  # or its parts' identities would be given to others
        try:
            sent = cloudpickle.dumps((evidence.root, evidence.frame, simulator, tuple(places)))
            self._executor.submit(_take, sent)
        except Exception:
            self._executor = None
            return
        self._known = {id(v): name for name, v in vars(simulator).items() if not isinstance(v, _SENT_ALONE)}

    def views(
        self, simulator: Simulator, effects: Sequence[Effect], place: int, replicate: int
    ) -> Future[Views] | None:
        """Views of one simulation of every second record of a place; None where it has to be made here."""
        if self._executor is None:
            return None
        written = io.BytesIO()
        try:
            _Pickler(written, self._known).dump((simulator, tuple(effects)))
            asked: Future[Views] = self._executor.submit(_views, written.getvalue(), place, replicate)
        except Exception:  # values may hold anything, too
            self._executor = None
            return None
        return asked

    def given_up(self) -> None:
        """Ask nothing more of it."""
        self._executor = None


class EvidenceOfTwo(Evidence):
    """Evidence that has every second record of a simulation made elsewhere.

    Parameters
    ----------
    calibrated, simulator, spec, root, dampings
        See `Evidence`.
    second : SecondProcess
    """

    def __init__(
        self,
        calibrated: Calibrated,
        simulator: Simulator,
        spec: TwinSpec,
        root: int,
        dampings: Sequence[float],
        second: SecondProcess,
    ) -> None:
        super().__init__(calibrated, simulator, spec, root, dampings)
        part = calibrated.held_out.conditions
        self._places = ((self._tried.conditions, self._tried_grid), (part, Grid.of(part, self.frame.bearing)))
        self._second = second
        second.take(self, simulator, self._places)

    def tried(self, simulator: Simulator, effects: Sequence[Effect]) -> Paired:
        """See `Evidence.tried`."""
        numbers = self._two(simulator, self._tried.conditions)
        made = [self._halves(simulator, effects, 0, k) for k in numbers]
        return Paired(self._tried_views, made, None, self._trial_yardstick)

    def replicates(self, simulator: Simulator, effects: Sequence[Effect], numbers: Sequence[int]) -> list[Views]:
        """Views of these simulations of the held-out part."""
        return [self._halves(simulator, effects, 1, k) for k in numbers]

    def _halves(self, simulator: Simulator, effects: Sequence[Effect], place: int, replicate: int) -> Views:
        conditions, grid = self._places[place]

        def here(some: Sequence[Condition]) -> Views:
            return self.views(self.simulated(simulator, effects, some, replicate), grid)

        asked = self._second.views(simulator, effects, place, replicate) if len(conditions) > 1 else None
        if asked is None:
            return here(conditions)
        first = here(conditions[0::2])
        try:
            second = asked.result()
        except Exception as error:  # what is wrong with these values is found here as well
            if type(error).__module__.partition(".")[0] != "twingap":
                self._second.given_up()
            second = here(conditions[1::2])
        return _interleaved(first, second)


def _interleaved(first: Views, second: Views) -> Views:
    """Views of records of which every second one is in `second`."""
    count = len(first) + len(second)
    values = {}
    for domain, rows in first.values.items():
        values[domain] = np.empty((count, rows.shape[1]))
        values[domain][0::2], values[domain][1::2] = rows, second.values[domain]
    conditions = [c for pair in zip_longest(first.conditions, second.conditions) for c in pair if c is not None]
    return Views(values, first.axes, tuple(conditions))


class _Pickler(cloudpickle.CloudPickler):  # type: ignore[misc]
    """Writes a name in place of what the other process has got."""

    def __init__(self, file: io.BytesIO, known: dict[int, str]) -> None:
        super().__init__(file, protocol=5)
        self._names = known

    def persistent_id(self, obj: object) -> str | None:
        return self._names.get(id(obj))


class _Unpickler(pickle.Unpickler):
    def persistent_load(self, pid: str) -> Any:
        return vars(_taken["simulator"])[pid]


_taken: dict[str, Any] = {}
"""In the second process: what was sent last."""


def _wake() -> None:
    """Import while the first process calibrates."""
    import twingap.gap.signatures
    import twingap.twins  # noqa: F401


def _take(sent: bytes) -> None:
    _taken.clear()
    root, frame, simulator, places = pickle.loads(sent)
    _taken.update(root=root, frame=frame, simulator=simulator, places=places)


def _views(sent: bytes, place: int, replicate: int) -> Views:
    simulator, effects = _Unpickler(io.BytesIO(sent)).load()
    conditions, grid = _taken["places"][place]
    frame: Frame = _taken["frame"]
    made = simulator.simulate(effects, conditions[1::2], _taken["root"], replicate)
    return measure((RecordView(r.samples, r.condition, frame) for r in made), grid)
