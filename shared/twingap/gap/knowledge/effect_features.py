"""Which signatures can tell of which effect: what keeps a detector from learning coincidences.

The catalogue says of every effect what tells it apart; these are the signatures that measure it, and those that
measure what it might be taken for. A user's own effect may be told by any signature.
"""

from __future__ import annotations

from fnmatch import fnmatchcase
from functools import cache
from typing import Final

_FOLLOWED = ("events.strike_*", "events.phase_lock", "events.harmonic_*")
_TIMING = (
    *_FOLLOWED, "events.smear_*", "events.wander_*", "events.timing_*", "events.jitter_*", "events.walk_*",
    "events.rate_log_ratio", "events.cycle_width_deg", "lines.shaft_lock", "lines.order_1_excess",
    "background.segment_spread", "background.spectral_drift", "lines.peaks_log", "events.scatter_sigma",
)  # fmt: skip
_STRENGTH = (
    *_FOLLOWED, "events.scatter_*", "events.strength_*", "events.shaft_depth", "events.shaft_line_log",
    "events.cage_*", "events.zone_depth", "events.jitter_sigma", "events.walk_sigma", "events.wander_log",
    "events.timing_log_1", "background.envelope_1x", "background.kurtosis_log", "background.crest_log",
    "background.quantile_*", "background.knock_count_log",
)  # fmt: skip
_SHAPE = (
    "shape|*", "path|*", "change|*", "answer|*", "comb|*", "answer.*", "background.band_*", "background.mode_*",
    "background.white_level", "background.rest_*", "background.edge_*", "background.rms_log",
    "background.time_asymmetry", "background.kurtosis_log", "background.rough_*", "background.envelope_1x",
    "events.strike_level", "events.strike_snr", "background.knock_*", "background.foreign_score",
    "background.quantile_*", "pooled|envelope_*",
)  # fmt: skip
_TONES = (
    "lines.*",
    "pooled|*",
    "background.band_00",
    "background.band_01",
    "events.rate_log_ratio",
    "events.strike_snr",
)
_KNOCKS = (
    "background.knock_*", "background.white_kurtosis_log", "background.kurtosis_log", "background.crest_log",
    "background.quantile_*", "background.foreign_*", "background.rms_log", "background.rest_*", "background.band_*",
    "lines.comb_*", "background.segment_*", "converter.gap_*", "events.strike_snr", "events.scatter_sigma", "shape|*",
    "answer|*",
)  # fmt: skip
_LEVEL = (
    "background.rms_log", "background.white_level", "background.mode_over_white_log", "background.kurtosis_log",
    "background.crest_log", "background.quantile_*", "events.strike_*", "background.band_*", "background.rest_rms",
    "background.knock_peak_log", "lines.fault_low_excess", "events.harmonic_1", "background.rest_low", "answer.*",
    "answer|level", "trend|*",
)  # fmt: skip

TELLING: Final[dict[str, tuple[str, ...]]] = {
    "speed_fluctuation": _TIMING,
    "mean_slip": (
        "events.rate_log_ratio", "events.shaft_log_ratio", "events.strike_*", "lines.*_ratio_log", "lines.shaft_lock",
        "lines.wave_*_score", "lines.fault_comb_*", "context|slip*", "context|speed*", "events.wander_log",
    ),
    "slip_jitter": _TIMING,
    "impact_scatter": _STRENGTH,
    "load_zone": _STRENGTH,
    "cage_modulation": _STRENGTH,
    "entry_exit": (
        *_FOLLOWED, "events.echo_gain", "events.arc_*", "events.exit_ratio", "events.cycle_*",
        "events.timing_*", "events.jitter_sigma", "background.echo_*", "shape|faulty_*", "answer|*", "answer.*",
        "comb|*", "background.time_asymmetry", "background.band_*", "lines.fault_*", "change|*",
    ),
    "distributed_roughness": _SHAPE,
    "speed_gain": _LEVEL,
    "damage_growth": _LEVEL,
    "second_resonance": _SHAPE,
    "sensor_rolloff": _SHAPE,
    "shaft_harmonics": _TONES,
    "looseness": _TONES,
    "mains_interference": _TONES,
    "drive_interference": _TONES,
    "gear_mesh": _TONES,
    "foreign_bearing": (*_KNOCKS, "pooled|foreign*", "lines.free_*", "background.modulation_*", "background.rough_*"),
    "coloured_noise": _SHAPE,
    "impulsive_noise": _KNOCKS,
    "waviness": _TONES,
    "clipping": ("converter.*", "background.quantile_*", "background.crest_log", "background.kurtosis_log"),
    "quantisation": ("converter.*", "background.white_level", "background.quantile_50"),
    "dropout": (
        "converter.*", "background.knock_*", "background.rms_log", "background.segment_*", "background.white_level",
    ),
}  # fmt: skip
"""Effect -> patterns of signatures, and of features that are none (`shape|`, `change|`, `comb|`, `context|`, ...)."""

_TRENDED: Final = {"speed_gain": ("on_speed",), "damage_growth": ("on_time",)}
"""Effects that show in how a signature changes over conditions; for all others trends are left out."""


@cache
def columns(effect: str, features: tuple[str, ...]) -> tuple[int, ...]:
    """Places among the features of `comparison.feature_names` that can tell of the effect; all for an unknown one."""
    patterns = TELLING.get(effect)
    if patterns is None:
        return tuple(range(len(features)))
    out = []
    for place, feature in enumerate(features):
        of, _, kind = feature.partition("|")
        if of == "context":
            fits = kind in _ALWAYS or any(fnmatchcase(feature, p) for p in patterns)
        elif of == "view":
            fits = True  # how far records and twin lie apart where is asked of every effect
        elif of in ("shape", "path", "change", "pooled", "answer", "comb", "trend"):
            fits = any(fnmatchcase(feature, p) for p in patterns)
        else:
            trend = kind.startswith("on_")
            wanted = _TRENDED.get(effect, ())
            fits = any(fnmatchcase(of, p) for p in patterns) and (not trend or kind.startswith(wanted or ("none",)))
        if fits:
            out.append(place)
    return tuple(out)


_ALWAYS: Final = ("own_simulator", "records", "healthy_share", "log_samples", "log_turns", "speeds", "span_s")
