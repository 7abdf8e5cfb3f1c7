"""The machine without effects: structure, noise and impact strength, for both arms.

twin arm:     pulses + white force -> one mode (displacement) -> every 4th sample
contact arm:  Hertzian pulses (size and length by load and speed) + rolling noise -> modes (acceleration)
              -> anti-alias filter -> every 4th sample

In internal units the noise of a healthy record at mean speed and load has unit RMS.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, signal

from twingap.rigs.worlds.layout import Layout
from twingap.rigs.worlds.motion import deposit, fault_order

Array = NDArray[np.float64]
OVERSAMPLING: Final = 4
"""Steps of the simulation per sample; more place impacts more finely and are slower."""
OWN: Final = ("load_zone", "slip_jitter", "impact_scatter", "shaft_harmonics")
"""Effects that the base machine of the contact arm may have, unless the case adds them."""


@dataclass(frozen=True)
class Mode:
    """One structural mode.

    Parameters
    ----------
    frequency_hz, damping_ratio : float
    gain : float
        Peak of its impulse response, positive or negative.
    """

    frequency_hz: float
    damping_ratio: float
    gain: float

    def lag(self, rate_hz: float) -> int:
        """Steps by which its response is late, at this rate."""
        return 0


@dataclass(frozen=True)
class LateMode(Mode):
    """A mode of a part farther from the bearing: its response arrives later than that of the others.

    Parameters
    ----------
    delay_s : float
        Travel time to the part and on to the sensor beyond that of the direct way, s.
    """

    delay_s: float = 0.0

    def lag(self, rate_hz: float) -> int:
        """Steps by which its response is late, at this rate."""
        return round(self.delay_s * rate_hz)


def path_modes(p: Mapping[str, Any]) -> tuple[LateMode, ...]:
    """Modes that the effect `transfer_path` adds, from its parameters."""
    columns = (p[name] for name in ("frequencies_hz", "damping_ratios", "gains", "delays_s"))
    return tuple(LateMode(*values) for values in zip(*columns, strict=True))


@dataclass(frozen=True)
class Base:
    """A machine without effects.

    Parameters
    ----------
    arm : {"twin", "contact"}
    fs_hz : float
    modes : tuple of Mode
    structure_rms, white_rms : float
        RMS of the noise that passes the modes, and of the white noise that does not, internal units.
    electronic_share : float
        Fraction of the white noise's power that is added after the sensor.
    pulse_s : float
        Duration of an impact at reference speed and load, s.
    level : dict[str, float]
        Fault -> impulse of an impact at reference speed and load.
    ratio : dict[str, float]
        Fault -> RMS of its impacts over that of the noise.
    reference_rpm, reference_n : float
        Speed, rpm, and load, N, at which `level` and `pulse_s` hold.
    speed_power, load_power : float
        Impulse ~ speed^p load^q; zero in the twin arm.
    rolling_power : float
        Structure noise ~ speed^p.
    gain : float
        Record unit per internal unit.
    unit : str
    own : dict[str, dict[str, Any]]
        Effects of the base machine, with parameters; they are no part of the gap and not in `Truth.effects`.
    """

    arm: str
    fs_hz: float
    modes: tuple[Mode, ...]
    structure_rms: float
    white_rms: float
    electronic_share: float
    pulse_s: float
    level: dict[str, float]
    ratio: dict[str, float]
    reference_rpm: float
    reference_n: float
    speed_power: float
    load_power: float
    rolling_power: float
    gain: float
    unit: str
    own: dict[str, dict[str, Any]]

    @property
    def hertz(self) -> bool:
        """Whether impacts are Hertzian contacts."""
        return self.arm == "contact"

    @property
    def settle_s(self) -> float:
        """Time simulated before each record, s: the slowest mode decays to a thousandth within it."""
        slowest = min(m.frequency_hz * m.damping_ratio for m in self.modes)
        return float(np.clip(6.9 / (2 * np.pi * slowest), 0.02, 0.15))

    def impact(self, fault: str, speed_rpm: float, load_n: float) -> tuple[float, float]:
        """Impulse and duration, s, of an impact at this speed and load.

        Hertzian impact at velocity v: duration ~ v^(-1/5), impulse ~ v (Goldsmith, Impact, 1960, ch. 4). A contact
        under load Q is stiffer by Q^(1/3), so its duration is shorter by Q^(-1/6).
        """
        v, q = speed_rpm / self.reference_rpm, load_n / self.reference_n
        length = self.pulse_s * (v**-0.2 * q ** (-1 / 6) if self.hertz else 1.0)
        return self.level[fault] * v**self.speed_power * q**self.load_power, length

    def structure_scale(self, speed_rpm: float) -> float:
        """Standard deviation of the noise force on the fine grid at this speed."""
        unit = noise_norm(self.modes, self.hertz, self.fs_hz)
        return float(self.structure_rms / unit * (speed_rpm / self.reference_rpm) ** self.rolling_power)

    def path(self, force: Array, drift: Array | None = None) -> Array:
        """Response at the sensor to a force.

        Parameters
        ----------
        force : Array [4 samples]
            On the fine grid.
        drift : Array [4 samples], optional
            Relative change of all natural frequencies over time.

        Returns
        -------
        Array [samples]
            At the sampling rate.
        """
        return thin(through(self.modes, force, self.hertz, self.fs_hz, drift), self.hertz)

    def with_modes(self, *more: Mode) -> Base:
        """The same machine, same noise force, with more modes."""
        modes = (*self.modes, *more)
        unit = noise_norm(modes, self.hertz, self.fs_hz) / noise_norm(self.modes, self.hertz, self.fs_hz)
        return replace(self, modes=modes, structure_rms=self.structure_rms * unit)


@lru_cache(maxsize=4096)
def _filter(frequency_hz: float, damping_ratio: float, hertz: bool, step_s: float) -> tuple[Array, Array]:
    """Digital filter of a mode under a force held constant over each step (exact), unit impulse in, unit peak out.

    q'' + 2 zeta w q' + w^2 q = F, held inputs: Franklin, Powell and Workman, Digital Control, ch. 4.3. Output: q times
    the damped frequency (twin arm), or q'' over w (contact arm).
    """
    w, zeta = 2 * np.pi * frequency_hz, damping_ratio
    block = np.zeros((3, 3))
    block[:2] = [[0.0, 1.0, 0.0], [-(w**2), -2 * zeta * w, 1.0]]
    e = linalg.expm(block * step_s)
    a, b = e[:2, :2], e[:2, 2:]
    if hertz:
        c, d = np.array([[-w, -2 * zeta]]), np.array([[1 / w]])
    else:
        c, d = np.array([[w * np.sqrt(1 - zeta**2), 0.0]]), np.array([[0.0]])
    denominator = np.array([1.0, -np.trace(a), np.linalg.det(a)])
    # numerator = c adj(z - a) b + d det(z - a)
    adj = np.array([[-a[1, 1], a[0, 1]], [a[1, 0], -a[0, 0]]])
    numerator = np.array([0.0, (c @ b).item(), (c @ adj @ b).item()]) + d.item() * denominator
    return numerator, denominator


def through(modes: tuple[Mode, ...], force: Array, hertz: bool, fs_hz: float, drift: Array | None = None) -> Array:
    """Sum of all modes' responses on the fine grid."""
    step_s = 1 / (OVERSAMPLING * fs_hz)
    total = np.zeros(force.size)
    for mode in modes:
        lag = mode.lag(OVERSAMPLING * fs_hz)
        late = np.concatenate([np.zeros(lag), force[:-lag]]) if lag else force
        if drift is None:
            b, a = _filter(mode.frequency_hz, mode.damping_ratio, hertz, step_s)
            total += mode.gain * signal.lfilter(b, a, late)
            continue
        block = 256
        state = np.zeros(2)
        for at in range(0, force.size, block):
            # Steps of a thousandth of the frequency are below what the spectrum resolves.
            hz = mode.frequency_hz * (1 + round(float(drift[at]), 3))
            b, a = _filter(hz, mode.damping_ratio, hertz, step_s)
            part, state = signal.lfilter(b, a, late[at : at + block], zi=state)
            total[at : at + block] += mode.gain * part
    return total


def response(modes: tuple[Mode, ...], hertz: bool, fs_hz: float, hz: Array) -> NDArray[np.complex128]:
    """Frequency response of the path at these frequencies, on the fine grid."""
    fine_hz = OVERSAMPLING * fs_hz
    total = np.zeros(hz.size, dtype=np.complex128)
    for mode in modes:
        b, a = _filter(mode.frequency_hz, mode.damping_ratio, hertz, 1 / fine_hz)
        own = mode.gain * signal.freqz(b, a, worN=hz, fs=fine_hz)[1]
        lag = mode.lag(fine_hz)
        total += own * np.exp(-2j * np.pi * hz / fine_hz * lag) if lag else own
    return total


def response_power(modes: tuple[Mode, ...], hertz: bool, fs_hz: float, hz: Array) -> Array:
    """Squared modulus of the path's frequency response at these frequencies."""
    return np.asarray(np.abs(response(modes, hertz, fs_hz, hz)) ** 2)


@lru_cache(maxsize=1)
def _taps() -> Array:
    return np.asarray(signal.firwin(20 * OVERSAMPLING + 1, 0.94 / OVERSAMPLING, window=("kaiser", 6.0)))


def thin(fine: Array, filtered: bool) -> Array:
    """From the fine grid to the sampling rate, with or without anti-alias filter (modes alone attenuate, too)."""
    if not filtered:
        return np.asarray(fine[::OVERSAMPLING])
    taps = _taps()
    start = (taps.size // 2) // OVERSAMPLING
    return np.asarray(signal.upfirdn(taps, fine, 1, OVERSAMPLING)[start : start + fine.size // OVERSAMPLING])


@lru_cache(maxsize=1024)
def noise_norm(modes: tuple[Mode, ...], hertz: bool, fs_hz: float) -> float:
    """RMS of the response at the sampling rate to a white force of unit variance on the fine grid."""
    slowest = min(m.frequency_hz * m.damping_ratio for m in modes)
    n = OVERSAMPLING * int(np.ceil(fs_hz * 4 / (2 * np.pi * slowest)) + 64)
    unit = np.zeros(n)
    unit[OVERSAMPLING * 16] = 1.0
    h = through(modes, unit, hertz, fs_hz)
    if hertz:
        h = signal.lfilter(_taps(), [1.0], h)
    return float(np.sqrt(np.sum(h**2)))


def unit_response(base: Base) -> Array:
    """Response at the sampling rate to one impact of unit impulse."""
    n = OVERSAMPLING * int((base.settle_s + 0.02) * base.fs_hz)
    at = np.array([0.01])
    return base.path(deposit(at, np.ones(1), np.full(1, base.pulse_s), 0.0, n, OVERSAMPLING * base.fs_hz, base.hertz))


def detectable_ratio(base: Base, rate_hz: float, line_db: float, duration_s: float) -> float:
    """RMS of impacts over that of all noise at which their envelope line is `line_db` above the floor in one record.

    In the mode's band of width B = pi zeta f the squared envelope of noise of power N has a floor of N^2 / (B T) per
    line. Impacts of power P whose response decays as exp(-4 pi zeta f t) have a line of P^2 / (1 + (rate / (2 zeta
    f))^2).
    """
    mode = base.modes[0]
    half_hz = mode.damping_ratio * mode.frequency_hz
    band_hz = np.pi * half_hz
    noise = base.structure_rms**2 + base.white_rms**2 * 2 * band_hz / base.fs_hz
    rounded = 1 + (rate_hz / (2 * half_hz)) ** 2
    power = noise * np.sqrt(10 ** (line_db / 10) * rounded / max(band_hz * duration_s, 1.0))
    return float(np.sqrt(power / (base.structure_rms**2 + base.white_rms**2)))


FAINTEST_DB: Final = 14.0
"""Fault line of the faintest defect over the floor of one record's envelope spectrum, dB; lower allows defects that
a single record hardly shows."""


def draw_base(arm: str, layout: Layout, rng: np.random.Generator) -> Base:
    """Random machine; effects of the base machine are added by the caller, since they depend on the case."""
    fs = layout.fs_hz
    first = fs * rng.uniform(0.08, 0.35)
    modes = [Mode(first, float(np.exp(rng.uniform(np.log(0.01), np.log(0.1)))), 1.0)]
    pulse_s = rng.uniform(0.15, 0.6) / fs
    structure = rng.uniform(0.15, 0.85)  # share of the noise's power
    ratio = np.exp(rng.uniform(np.log(0.35), np.log(3.5)))
    speed_power = load_power = rolling_power = 0.0
    if arm == "contact":
        for _ in range(int(rng.integers(1, 4))):
            while True:
                hz = fs * np.exp(rng.uniform(np.log(0.05), np.log(0.42)))
                if all(abs(hz / m.frequency_hz - 1) > 0.15 for m in modes):
                    break
            damping = float(np.exp(rng.uniform(np.log(0.012), np.log(0.07))))
            modes.append(Mode(float(hz), damping, float(rng.choice([-1, 1]) * rng.uniform(0.15, 0.9))))
        pulse_s = rng.uniform(0.8, 2.2) / (2 * max(m.frequency_hz for m in modes))
        speed_power, load_power = rng.uniform(0.7, 1.1), rng.uniform(0.2, 0.6)
        rolling_power = rng.uniform(0.3, 1.0)
        structure, ratio = rng.uniform(0.3, 0.9), 1.2 * ratio
    base = Base(
        arm=arm,
        fs_hz=fs,
        modes=tuple(modes),
        structure_rms=float(np.sqrt(structure)),
        white_rms=float(np.sqrt(1 - structure)),
        electronic_share=float(np.exp(rng.uniform(np.log(0.003), np.log(0.05)))),
        pulse_s=float(pulse_s),
        level={},
        ratio={},
        reference_rpm=layout.mean_rpm,
        reference_n=float(np.exp(np.mean(np.log(layout.load_n)))),
        speed_power=float(speed_power),
        load_power=float(load_power),
        rolling_power=float(rolling_power),
        gain=float(np.exp(rng.uniform(np.log(0.01), np.log(100)))),
        unit=str(rng.choice(["", "m/s^2", "g"], p=[0.6, 0.2, 0.2])),
        own={},
    )
    energy = float(np.sum(unit_response(base) ** 2))
    for fault in ("inner", "outer", "ball"):
        rate = fault_order(layout.bearing, fault, 1.0) * layout.mean_rpm / 60
        faint = detectable_ratio(base, rate, FAINTEST_DB, layout.n_samples / fs)
        own_ratio = max(float(np.clip(ratio * np.exp(rng.uniform(-0.4, 0.4)), 0.3, 4.0)), faint)
        base.ratio[fault] = own_ratio
        base.level[fault] = own_ratio / float(np.sqrt(energy * rate / fs))
    return base
