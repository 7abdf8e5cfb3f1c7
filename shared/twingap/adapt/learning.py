"""Training of the classifier that ships with twingap, from simulated fleets of random machines.

seed, part --> 20 fleets --features--> parts/*.npz --all parts--> trees
seed, part --> 20 other fleets ------> parts/*.npz -------------> temperature, reliability
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from twingap.adapt.fault_classifier import FaultClassifier
from twingap.adapt.order_classifier import FEATURES, TREES_FILE, VERSION, of_names, shipped_folder, write_classifier
from twingap.adapt.population import CLASSES
from twingap.adapt.random_fleets import random_fleet
from twingap.errors import TwingapError
from twingap.files import replacing

Progress = Callable[[str, float], None]

FLEETS: Final = 2000
"""Simulated fleets to learn from. More make the classifier better and training longer."""
CALIBRATED_ON: Final = 4
"""One fleet to calibrate on for so many to learn from."""
FLEETS_PER_PART: Final = 20
"""What is lost at an interruption, at most, by each process."""
LEARN, CALIBRATE = 1, 2
"""Streams of random numbers."""
WINDOWS: Final = {LEARN: 2, CALIBRATE: 6}
LENGTHS: Final = {LEARN: (2.0, 2.0), CALIBRATE: (1.0, 6.0)}
"""Windows of a recording, and its length in windows. A window tells little more than the one beside it, so that trees
learn more from more recordings; confidence is calibrated on as many windows as `classify` reads."""
LARGEST_FILE: Final = 2_500_000
"""Bytes that the trees may take in the package."""

Part = tuple[NDArray[np.float32], NDArray[np.int64], NDArray[np.float64]]
"""Features [recordings, windows, features], labels [recordings] and weights [recordings, windows]."""


def train_classifier(
    folder: Path | None = None,
    *,
    seed: int,
    jobs: int,
    fleets: int = FLEETS,
    progress: Progress | None = None,
) -> FaultClassifier:
    """Simulate fleets, fit the classifier and write it.

    Parts that are done are kept in the folder until the classifier is written, so that a run that was interrupted goes
    on where it was when it is started again with the same seed.

    Parameters
    ----------
    folder : Path, optional
        Where to write; the package itself when absent.
    seed : int
        Same seed and number of fleets, same bytes, whatever the number of processes.
    jobs : int
        Processes.
    fleets : int
        To learn from, at least `FLEETS_PER_PART`.
    progress : callable, optional
        Called with what is being done and how much is done (0 to 1).

    Returns
    -------
    FaultClassifier

    Raises
    ------
    TwingapError
        For too few fleets or a folder that cannot be written.
    """
    import joblib

    if fleets < FLEETS_PER_PART or jobs < 1:
        raise TwingapError(f"{fleets} fleets in {jobs} processes, at least {FLEETS_PER_PART} in 1 expected")
    folder, progress = shipped_folder() if folder is None else folder, progress or _quiet
    store = folder / "parts"
    learned, calibrated = fleets // FLEETS_PER_PART, max(1, fleets // CALIBRATED_ON // FLEETS_PER_PART)
    wanted = [(LEARN, number) for number in range(learned)] + [(CALIBRATE, number) for number in range(calibrated)]
    places = {key: store / f"v{VERSION}-seed{seed}-{key[0]}-{key[1]}.npz" for key in wanted}
    missing = [key for key in wanted if not places[key].exists()]
    progress("simulating fleets", 0.9 * (1 - len(missing) / len(wanted)))
    tasks = (joblib.delayed(write_part)(places[key], seed, *key) for key in missing)
    for done, _ in enumerate(joblib.Parallel(n_jobs=jobs, return_as="generator_unordered")(tasks), 1):
        progress("simulating fleets", 0.9 * (1 - (len(missing) - done) / len(wanted)))
    progress("training", 0.9)
    learn, calibrate = ([_read(p) for key, p in places.items() if key[0] == use] for use in (LEARN, CALIBRATE))
    made = {"seed": seed, "fleets": learned * FLEETS_PER_PART, "recordings": sum(len(y) for _, y, _ in learn)}
    found = fit_classifier(learn, calibrate, seed)
    write_classifier(found, folder, made | {"calibration_recordings": sum(len(y) for _, y, _ in calibrate)})
    if (size := (folder / TREES_FILE).stat().st_size) > LARGEST_FILE:
        raise TwingapError(f"takes {size} bytes, at most {LARGEST_FILE} expected", where=folder / TREES_FILE)
    for place in store.glob(f"v*-seed{seed}-*.npz"):
        place.unlink()
    if store.exists() and not any(store.iterdir()):
        store.rmdir()
    progress("training", 1.0)
    return found


def write_part(place: Path, seed: int, use: int, number: int) -> None:
    """Simulate one part and store it.

    Parameters
    ----------
    place : Path
    seed : int
    use : int
        `LEARN` or `CALIBRATE`.
    number : int
        Of the part: each has random numbers of its own.
    """
    rng = np.random.default_rng([seed, 41, use, number])
    made = [
        random_fleet(rng, WINDOWS[use], lengths=LENGTHS[use], wrong_speeds=use == CALIBRATE)
        for _ in range(FLEETS_PER_PART)
    ]
    with replacing(place) as temporary, temporary.open("wb") as stream:
        np.savez(
            stream,
            features=np.concatenate([fleet.features for fleet in made]),
            labels=np.concatenate([fleet.labels for fleet in made]),
            weights=np.concatenate([fleet.weights for fleet in made]),
        )


def _read(place: Path) -> Part:
    with np.load(place, allow_pickle=False) as stored:
        features, labels, weights = stored["features"], stored["labels"], stored["weights"]
    if features.shape[2] != len(FEATURES):
        raise TwingapError("holds other features than this version of twingap has", where=place, mend="delete it")
    return features, labels, weights


def fit_classifier(learn: Sequence[Part], calibrate: Sequence[Part], seed: int) -> FaultClassifier:
    """Fit trees to some recordings and the temperature to others.

    Parameters
    ----------
    learn, calibrate : sequence of Part
    seed : int

    Returns
    -------
    FaultClassifier
        Its labels are the names of `CLASSES`.

    Raises
    ------
    TwingapError
        When a class is missing.
    """
    features, labels, _ = (np.concatenate(arrays) for arrays in zip(*learn, strict=True))
    if missing := sorted(set(range(len(CLASSES))) - set(labels.tolist())):
        raise TwingapError(f"no {CLASSES[missing[0]]} recording among {len(labels)}", mend="simulate more fleets")
    found = FaultClassifier(random_state=seed).fit(features, labels)
    return of_names(found.calibrate(*(np.concatenate(arrays) for arrays in zip(*calibrate, strict=True))))


def _quiet(what: str, fraction: float) -> None:
    """Report nothing."""
