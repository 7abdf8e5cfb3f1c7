"""Vibration snapshots of simulated lives, labelled; and those of the real run, without labels.

lives: speed, S(k) D(k), revolutions --amplitude for that peak to peak--> phenomenological twin --> Snapshots, labelled
records of the run after K_anomaly, speed, place ------------------------------------------------> Snapshots, no labels

Eq. 1 of paper 1: x_k = S(k) D(k) sum_i h(t - iT - tau_i) q(iT) A_i + n(t). S and D scale the impacts, and n(t) stays as
it is: `effects.SpeedGain`, which drives all excitation, is not what eq. 1 says, so the two factors of each row are
handed to the chain together. The end of life is defined on peak to peak, so amplitudes are such that the simulated
record, its noise included, has S(k) D(k) peak to peak on average.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from twingap.bearing import Bearing
from twingap.effects import Draft, Effect, ImpactScatter, LoadZone, SlipJitter, Stage
from twingap.errors import TwingapError
from twingap.prognosis.adaptive_twin import AdaptiveTwin
from twingap.prognosis.degradation import Trajectory
from twingap.prognosis.encoding import sequence_position
from twingap.records import Condition, RecordSet
from twingap.twins.phenomenological import PhenomenologicalParameters, PhenomenologicalTwin

Array = NDArray[np.float64]
Samples = NDArray[np.float32]

PILOTS = 6
"""Records behind each point of the amplitude table."""
_GAINS = np.concatenate(([0.0], np.geomspace(0.02, 3.0, 25)))
"""Amplitudes tried, in multiples of that whose impacts alone have the wanted peak to peak."""


@dataclass(frozen=True)
class Snapshots:
    """Records of one or several lives, as a network is shown them.

    Parameters
    ----------
    samples : Samples [records, length]
        In the unit of the measurements.
    speed_rpm : Array [records]
    position : Array [records]
        Rows after K_anomaly, the pos of eq. 13.
    life : NDArray[int64] [records]
        Which life each is of.
    revolutions : Array [records] or None
        Remaining, eq. 14. None: not known, as of a bearing that still runs.
    """

    samples: Samples
    speed_rpm: Array
    position: Array
    life: NDArray[np.int64]
    revolutions: Array | None = None

    def __len__(self) -> int:
        return int(self.samples.shape[0])

    def unlabelled(self) -> Snapshots:
        """The same without labels."""
        return replace(self, revolutions=None)

    def take(self, places: NDArray[np.int64] | NDArray[np.bool_]) -> Snapshots:
        """Some of the records."""
        left = None if self.revolutions is None else self.revolutions[places]
        return Snapshots(
            self.samples[places], self.speed_rpm[places], self.position[places], self.life[places], left
        )  # fmt: skip


@dataclass(frozen=True)
class SignalModel:
    """What eq. 1 leaves open.

    Parameters
    ----------
    jitter : float
        Standard deviation of tau_i, impact spacings.
    load_zone : float
        Depth of q.
    scatter : float
        Standard deviation of A_i.
    noise : {"constant", "with_speed"}
        n(t) of eq. 1 is the same at all speeds. "with_speed": what passes the structure follows S, as healthy vibration
        of real machines does; the measuring chain's white noise does not.
    noise_share : float
        Peak to peak of the noise over that of a healthy record, at the speed where that is least.
    """

    jitter: float = 0.02
    load_zone: float = 0.3
    scatter: float = 0.1
    noise: Literal["constant", "with_speed"] = "constant"
    noise_share: float = 0.8


@dataclass(frozen=True)
class _RowGain(Effect):
    """S(k) D(k) on the impacts of row k, and the row's level of structure noise; both in the record's columns."""

    stage: ClassVar[Stage] = Stage.EXCITATION

    def apply(self, draft: Draft, rng: np.random.Generator) -> None:
        if draft.impacts is not None:
            draft.impacts.amplitudes = draft.impacts.amplitudes * float(draft.condition.extra["impact_gain"])
        draft.amplify_force(float(draft.condition.extra["noise_gain"]))


class LifeSimulator:
    """Eq. 1 for one bearing, its amplitudes set by peak to peak.

    Parameters
    ----------
    twin : AdaptiveTwin
    bearing : Bearing
    fault : {"inner", "outer", "ball", "cage"}
    fs_hz : float
    n_samples : int
    rng : numpy.random.Generator
        For the pilots from which amplitudes are set.
    model : SignalModel
    unit : str

    Raises
    ------
    TwingapError
        When the mode lies beyond half the sampling rate.
    """

    def __init__(
        self,
        twin: AdaptiveTwin,
        bearing: Bearing,
        fault: str,
        fs_hz: float,
        n_samples: int,
        rng: np.random.Generator,
        model: SignalModel | None = None,
        unit: str = "g",
    ) -> None:
        self.twin, self.fault, self.fs_hz, self.n_samples = twin, fault, fs_hz, n_samples
        self.model = model or SignalModel()
        own, mode = self.model, twin.mode
        total = float(np.hypot(mode.structure_noise_rms, mode.white_noise_rms))
        structure = mode.structure_noise_rms / total if total > 0 else 0.0
        white = float(np.sqrt(max(1 - structure**2, 0.0)))
        parameters = PhenomenologicalParameters(
            mode.resonance_hz, mode.damping_ratio, {fault: 1.0}, structure, max(white, 1e-9), 1.0
        )
        effects = (SlipJitter(sigma=own.jitter), LoadZone(depth=own.load_zone), ImpactScatter(sigma=own.scatter))
        base = PhenomenologicalTwin(bearing, parameters, (*effects, _RowGain()), unit)
        # Noise of unit RMS has this peak to peak in a record of this length; then n(t) is known.
        quiet = self._made(base, np.full(PILOTS, twin.influence.speeds_rpm[0]), 0.0, 1.0, rng, "healthy")
        least = float(twin.influence.amplitude(twin.influence.speeds_rpm).min())
        self.noise_rms = own.noise_share * least / float(np.mean(np.ptp(quiet, axis=1)))
        self._chain = PhenomenologicalTwin(
            bearing,
            replace(
                parameters,
                structure_noise_rms=structure * self.noise_rms,
                white_noise_rms=max(white * self.noise_rms, 1e-9),
            ),
            base.effects,
            unit,
        )
        self._least = least
        self._tabulate(rng)

    def noise_gain(self, speed_rpm: Array) -> Array:
        """Factor on the structure noise at speeds [...]."""
        if self.model.noise == "constant":
            return np.ones_like(speed_rpm)
        return self.twin.influence.amplitude(speed_rpm) / self._least

    def impact_gain(self, peak_to_peak: Array, speed_rpm: Array) -> Array:
        """Amplitude of impacts [rows] for which records have that peak to peak on average; 0 where noise alone has it.

        Parameters
        ----------
        peak_to_peak, speed_rpm : Array [rows]
        """
        out = np.empty(peak_to_peak.size)
        near = np.abs(self._speeds[None] - speed_rpm[:, None]).argmin(axis=1)
        for place in np.unique(near):
            own = near == place
            # Beyond the table noise no longer matters, and peak to peak is proportional to the amplitude.
            wanted, heights, gains = peak_to_peak[own], self._heights[place], self._amplitudes[place]
            out[own] = np.interp(wanted, heights, gains) * np.maximum(wanted / heights[-1], 1.0)
        return out

    def snapshots(self, lives: Iterable[Trajectory], rng: np.random.Generator, most: int | None = None) -> Snapshots:
        """Labelled records of lives, every row after K_anomaly to the end.

        Parameters
        ----------
        lives : iterable of Trajectory
        rng : numpy.random.Generator
        most : int, optional
            Records in all; where there are more rows, evenly spread ones are made.

        Returns
        -------
        Snapshots
        """
        lives = list(lives)
        speed = np.concatenate([life.speed_rpm[1:] for life in lives])
        height = np.concatenate([life.peak_to_peak[1:] for life in lives])
        position = np.concatenate([life.positions[1:] for life in lives])
        left = np.concatenate([life.remaining_revolutions[1:] for life in lives])
        number = np.concatenate([np.full(life.speed_rpm.size - 1, i) for i, life in enumerate(lives)])
        running = np.flatnonzero(speed > 0)
        if most is not None and running.size > most:
            running = running[np.unique(np.linspace(0, running.size - 1, most).round().astype(int))]
        speed, height = speed[running], height[running]
        samples = self._made(
            self._chain, speed, self.impact_gain(height, speed), self.noise_gain(speed), rng, self.fault
        )
        return Snapshots(samples, speed, position[running], number[running].astype(np.int64), left[running])

    def _tabulate(self, rng: np.random.Generator) -> None:
        """Mean peak to peak over amplitude, at each operating speed."""
        self._speeds = self.twin.influence.speeds_rpm
        all_speeds = np.repeat(self._speeds, PILOTS)
        silent = replace(self._chain.parameters, structure_noise_rms=0.0, white_noise_rms=1e-12)
        struck = PhenomenologicalTwin(self._chain.bearing, silent, self._chain.effects, self._chain.unit)
        impacts = self._made(struck, all_speeds, 1.0, 1.0, rng, self.fault)
        noise = self._made(self._chain, all_speeds, 0.0, self.noise_gain(all_speeds), rng, "healthy")
        unit = np.ptp(impacts, axis=1).reshape(-1, PILOTS).mean(axis=1)
        self._amplitudes, self._heights = [], []
        for place in range(self._speeds.size):
            own = slice(place * PILOTS, (place + 1) * PILOTS)
            # Up to twenty times the healthy level: any end of life lies below or is proportional by then.
            amplitudes = _GAINS * 20 * self._least / 3 / unit[place]
            heights = [float(np.ptp(noise[own] + np.float32(a) * impacts[own], axis=1).mean()) for a in amplitudes]
            self._amplitudes.append(amplitudes)
            self._heights.append(np.maximum.accumulate(heights))

    def _made(
        self,
        chain: PhenomenologicalTwin,
        speed_rpm: Array,
        impact_gain: Array | float,
        noise_gain: Array | float,
        rng: np.random.Generator,
        fault: str,
    ) -> Samples:
        gains = np.broadcast_to(impact_gain, speed_rpm.shape), np.broadcast_to(noise_gain, speed_rpm.shape)
        conditions = (
            Condition(
                str(i), float(speed), self.fs_hz, self.n_samples, fault,
                extra={"impact_gain": float(gains[0][i]), "noise_gain": float(gains[1][i])},
            )
            for i, speed in enumerate(speed_rpm)
        )  # fmt: skip
        out = np.empty((speed_rpm.size, self.n_samples), np.float32)
        for i, record in enumerate(chain.stream(conditions, rng, threads=1)):
            out[i] = record.samples
        return out


def measured_snapshots(records: RecordSet, onset_row: int, rows: Iterable[int], n_samples: int) -> Snapshots:
    """Records of a real run, without labels.

    Parameters
    ----------
    records : RecordSet
        The run, a record per row.
    onset_row : int
        K_anomaly.
    rows : iterable of int
        Which.
    n_samples : int
        From the beginning of each record.

    Returns
    -------
    Snapshots

    Raises
    ------
    TwingapError
        When a record is shorter.
    """
    places = list(rows)
    out = np.empty((len(places), n_samples), np.float32)
    for i, record in enumerate(records.take(places)):
        if record.samples.size < n_samples:
            raise TwingapError(
                f"{record.samples.size} samples, {n_samples} needed", where=f"record {record.condition.name!r}",
                mend="choose a shorter window",
            )  # fmt: skip
        out[i] = record.samples[:n_samples]
    speed = np.array([records.conditions[p].speed_rpm for p in places], float)
    return Snapshots(out, speed, sequence_position(np.array(places), onset_row), np.zeros(len(places), np.int64))


def joined(parts: Sequence[Snapshots]) -> Snapshots:
    """Snapshots one after the other; labels where all parts have them.

    Parameters
    ----------
    parts : sequence of Snapshots
        At least one.
    """
    if len(parts) == 1:
        return parts[0]
    labels = [p.revolutions for p in parts if p.revolutions is not None]
    return Snapshots(
        np.concatenate([p.samples for p in parts]),
        np.concatenate([p.speed_rpm for p in parts]),
        np.concatenate([p.position for p in parts]),
        np.concatenate([p.life for p in parts]),
        np.concatenate(labels) if len(labels) == len(parts) else None,
    )
