"""Errors of estimated effect parameters, for quantities that worlds and catalogue define alike.

report: effect -> parameter -> value, ci --+
truth: effect -> parameter ----------------+--COMPARABLE--> relative error, coverage of the interval
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

from twingap.study.scores import median, rate
from twingap.study.verdicts import Row

COMPARABLE: Final[Mapping[tuple[str, str], Callable[[Mapping[str, Any]], float]]] = {
    ("speed_fluctuation", "level"): lambda p: p["rms_fraction"],
    ("mean_slip", "slip"): lambda p: -p["cage_speed_change"],
    ("slip_jitter", "sigma"): lambda p: p["std_fraction"],
    ("impact_scatter", "sigma"): lambda p: p["std_fraction"],
    ("cage_modulation", "depth"): lambda p: p["depth_fraction"],
    ("speed_gain", "exponent"): lambda p: p["exponent"],
    ("second_resonance", "frequency_hz"): lambda p: p["frequency_hz"],
    ("second_resonance", "damping_ratio"): lambda p: p["damping_ratio"],
    ("sensor_rolloff", "corner_hz"): lambda p: p["corner_hz"],
    ("mains_interference", "mains_hz"): lambda p: p["mains_hz"],
    ("drive_interference", "carrier_hz"): lambda p: p["carrier_hz"],
    ("drive_interference", "sideband_order"): lambda p: p["pole_pairs"],
    ("gear_mesh", "teeth"): lambda p: p["teeth"],
    ("foreign_bearing", "order"): lambda p: p["order"],
    ("impulsive_noise", "rate_hz"): lambda p: p["rate_per_s"],
    ("dropout", "rate_hz"): lambda p: p["stretches_per_s"],
    ("dropout", "length_s"): lambda p: p["length_s"],
}
"""(effect, parameter of the catalogue) -> the same quantity from a world's parameters. Amplitudes are left out, since
worlds define them in internal units; so are shapes that worlds and catalogue parametrise differently."""


def parameter_errors(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Median relative error and interval coverage, over worlds in which the effect was present and named.

    Returns
    -------
    list of dict
        One per parameter in the order of `COMPARABLE`, without those that were never estimated: effect, parameter, n,
        median relative error with interval, share of 90 % intervals that contain the truth with interval.
    """
    table = []
    for (effect, parameter), truth in COMPARABLE.items():
        errors, held = [], []
        for row in rows:
            estimated = row.found.parameters.get(effect, {}).get(parameter)
            if estimated is None or effect not in row.was.effects or effect not in row.was.parameters:
                continue
            true, value = float(truth(row.was.parameters[effect])), estimated.get("value")
            if value is None or not math.isfinite(value) or true == 0:
                continue
            errors.append(abs(float(value) / true - 1))
            if estimated.get("ci"):
                low, high = estimated["ci"]
                held.append(low <= true <= high)
        if errors:
            error, cover = median("error", effect, errors), rate("coverage", effect, held)
            table.append(
                {
                    "effect": effect, "parameter": parameter, "n": len(errors),
                    "median_relative_error": error.row["value"], "low": error.row["low"], "high": error.row["high"],
                    "ci_covers": cover.row["value"], "ci_covers_low": cover.low, "ci_covers_high": cover.high,
                    "with_ci": len(held),
                }
            )  # fmt: skip
    return table
