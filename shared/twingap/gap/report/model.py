"""Gap report: the result of a diagnosis as immutable objects of plain numbers, and as data frames.

Verdict, Place, Candidate, Metric, Curve --> GapReport --> .where, .which, .shrink (data frames)

`twingap.gap.report.files` writes and reads it.
"""

from __future__ import annotations

import html
import itertools
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Literal

from twingap.gap.distance.domain_names import DomainName

if TYPE_CHECKING:
    import pandas as pd

Status = Literal["no_gap", "explained", "partly_explained", "unexplained"]
Sign = Literal["records_higher", "twin_higher", "shape"]
"""Which has more in a place: the records, the twin, or neither throughout."""
Change = Literal["gone", "smaller", "same", "larger", "new"]
"""What adding the verdict's effects does to a place; "new" is one that only the twin with the effects has."""
Interval = tuple[float, float]
_LEAST_CLOSURE, _MOST_CLOSURE = -10.0, 2.0
"""Bounds of closures: values beyond occur where there is hardly anything to close."""
_LEFT_OUT = 0.03
"""Part of the gap from which what groups that are not listed close is stated too."""
REFERENCE = "healthy_vibration"
"""Entry of the calibration: RMS of the twin's healthy vibration in the unit of the records, of which "healthy rms" in
values of effects is a multiple."""
Numbers = tuple[float, ...]
"""NaN where nothing was measured, written as null."""


@dataclass(frozen=True)
class GroupName:
    """A group of effects that the data do not tell apart, the most probable first, and the probability that at least
    one of them is missing."""

    group: str
    effects: tuple[str, ...]
    probability: float


@dataclass(frozen=True)
class Verdict:
    """Verdict: whether there is a gap, which effects explain it, and how certain that is.

    Parameters
    ----------
    status : {"no_gap", "explained", "partly_explained", "unexplained"}
    effects : tuple[str, ...]
        Missing effects, the one that closes most first; empty for no_gap and unexplained.
    confidence_set : tuple[tuple[str, ...], ...]
        Sets of effects that the data do not distinguish at 90 %; ((),) is no effect. Effects that are undetectable on
        most similar machines count neither as missing nor as absent.
    p_value : float
        Of no gap at all, after calibration of the twin.
    closure, closure_ci : float and (float, float), or None
        Part of the gap that adding all `effects` closes, on held-out records, with its 90 % interval.
    groups : tuple of GroupName
        Groups of which some member is missing, the most probable first.
    p_floor : float
        Smallest p-value that the null distribution allows for such records; a p-value at it is only an upper bound.
    """

    status: Status
    effects: tuple[str, ...]
    confidence_set: tuple[tuple[str, ...], ...]
    p_value: float
    closure: float | None = None
    closure_ci: Interval | None = None
    p_floor: float = 0.0
    groups: tuple[GroupName, ...] = ()

    @property
    def p_words(self) -> str:
        """The p-value in a sentence: "p = 0.031", or "p < 0.006" where it is as small as it can be."""
        if self.p_value > self.p_floor * (1 + 1e-6):
            return f"p = {self.p_value:.2g}" if self.p_value >= 0.001 else "p < 0.001"
        step = 10.0 ** math.floor(math.log10(max(self.p_value, 1e-9)))
        return f"p < {max(math.ceil(self.p_value / step * (1 - 1e-6)) * step, 0.001):.1g}"

    @property
    def sentence(self) -> str:
        """One sentence: the missing effects, the closure when they are added, and the certainty."""
        return self.sentence_with("it" if len(self.effects) == 1 else "them")

    def sentence_with(self, it: str) -> str:
        """The sentence, where `it` are the effects that can be added."""
        p = self.p_words
        if self.status == "no_gap":
            return f"After calibration these records and the twin cannot be distinguished ({p})."
        if self.status == "unexplained":
            return f"The twin differs from the records ({p}), and no effect of the catalogue can be named as the cause."
        closes = f"how far adding {it} would shrink the gap could not be measured"
        if self.closure is not None:
            closes = f"adding {it} closes {_percent(self.closure)} of the gap"
            widens = round(100 * self.closure) < 0  # less than half a per cent is neither
            far = self.closure < -1  # of a gap that is more than doubled, the percentage tells nothing
            if widens:
                by = "" if far else f" by {_percent(-self.closure)}"
                closes = f"adding {it} at the values found widens the gap{by}"
            if self.closure_ci is not None and not far:
                ends = self.closure_ci if not widens else (-self.closure_ci[1], -self.closure_ci[0])
                closes += " (90 % interval {} to {})".format(*map(_percent, ends))
        rest = "little of it remains"
        if self.status == "partly_explained":
            little = self.closure is not None and 0 <= self.closure < 0.5
            rest = "most of it remains" if little else "a significant rest remains"
        elif self.closure is not None and self.closure < 0.9:
            rest = "what remains is no sign of a further effect"
        # "Nothing at all" in the confidence set counts as an explanation like any other.
        others = sum(1 for effects in self.confidence_set if set(effects) != set(self.effects))
        sure = "at 90 % no other explanation fits"
        if others:
            sure = f"{count_words(others)} other explanation{'s' * (others > 1)} cannot be ruled out at 90 %"
        return f"The twin lacks {listed(self.effects)}: {closes}, {rest}, and {sure} ({p} of no gap at all)."


@dataclass(frozen=True)
class Place:
    """Where a part of the gap lies.

    Parameters
    ----------
    domain : str
        frequency (Hz of the raw spectrum), envelope_order and order (multiples of shaft speed), amplitude (quantiles
        of |x|), time (s within the record), condition (named in `condition`).
    lo, hi : float or None
        Bounds in `unit`; None for domain condition.
    share : float
        Part of the gap, 0 to 1.
    p_value : float
        P-value adjusted for all places tested.
    condition : Mapping or None
        speed_rpm, fault, load_n or time_s range to which the place applies; None = all.
    sign : str or None
        "records_higher", "twin_higher" or "shape"; None where there is no order, as between conditions.
    after : str or None
        What adding the verdict's effects does to it: "gone", "smaller", "same", "larger", or "new".
    """

    domain: DomainName
    lo: float | None
    hi: float | None
    unit: str
    share: float
    p_value: float
    condition: Mapping[str, Any] | None = None
    sign: Sign | None = None
    after: Change | None = None


@dataclass(frozen=True)
class ParameterValue:
    """A number with its unit and interval; None without an interval, as for a given value."""

    value: float
    unit: str = ""
    ci: Interval | None = None


@dataclass(frozen=True)
class Candidate:
    """An effect of the catalogue, evaluated.

    Parameters
    ----------
    probability : float
        That the machine has it and the twin lacks it, 0 to 1.
    gap_before, gap_after : float
        Without and with it, on held-out records.
    closure : float
        (before - after) / (before - floor); 0 when nothing could be closed.
    closure_ci : (float, float)
        90 % interval.
    parameters : Mapping[str, ParameterValue]
        Fitted values; empty where none were fitted.
    acts : str or None
        Reason why it could not be added to this simulator; None where it could.
    fitted_with : tuple[str, ...]
        Other effects that were present while it was fitted and evaluated.
    """

    effect: str
    probability: float
    gap_before: float
    gap_after: float
    closure: float
    closure_ci: Interval
    parameters: Mapping[str, ParameterValue] = field(default_factory=dict)
    acts: str | None = None
    fitted_with: tuple[str, ...] = ()


@dataclass(frozen=True)
class Metric:
    """A measure of the gap before and after the verdict's effects are added, on held-out records.

    Parameters
    ----------
    metric : str
        Name, such as "log-spectral distance" or "accuracy on the records".
    floor : float
        Records against records: the value of a perfect twin.
    ci_after, ci_before : (float, float)
        90 % intervals of `after` and `before`.
    higher_is_better : bool
        True for an accuracy.
    """

    metric: str
    before: float
    after: float
    floor: float
    ci_after: Interval
    ci_before: Interval | None = None
    unit: str = ""
    higher_is_better: bool = False

    @property
    def worse(self) -> bool:
        """Whether it is worse after, beyond the 90 % interval."""
        low, high = self.ci_after
        return high < self.before if self.higher_is_better else low > self.before

    @property
    def closure(self) -> float | None:
        """(before - after) / (before - floor); None where there was nothing to close."""
        worse = self.before - self.floor if not self.higher_is_better else self.floor - self.before
        gained = self.before - self.after if not self.higher_is_better else self.after - self.before
        if worse <= 1e-12 * max(abs(self.before), abs(self.floor)):
            return None
        return min(max(gained / worse, _LEAST_CLOSURE), _MOST_CLOSURE)


@dataclass(frozen=True)
class ClosestEffect:
    """An effect of the closest twin with its values; `closest.toml` holds lists such as a frequency response."""

    effect: str
    parameters: Mapping[str, ParameterValue] = field(default_factory=dict)


@dataclass(frozen=True)
class EffectShare:
    """Share of one effect in what its group closes."""

    effect: str
    share: float


@dataclass(frozen=True)
class GroupShare:
    """Share of a group of effects in the closure of the closest twin."""

    group: str
    effects: tuple[EffectShare, ...]  # the largest first
    # Of the gap. Shares of all groups add up to the closure (Shapley values).
    share: float
    share_ci: Interval  # 90 % interval over recordings
    p_value: float  # of held-out records being no closer with the group than without it
    shown: bool = True  # whether that is shown, at a false discovery rate of 10 % over all groups


@dataclass(frozen=True)
class Ceiling:
    """Closure that real records reach in place of the twin: others of the same bearing, and those of other bearings
    with the same fault. None where the set has no such records."""

    same_unit: float | None = None
    other_unit: float | None = None


@dataclass(frozen=True)
class ClosestTwin:
    """The closest twin: all effects that bring it closer, named or not, with what each group of them closes."""

    effects: tuple[ClosestEffect, ...] = ()
    closure: float = 0.0  # part of the gap that they close, on held-out records, with its 90 % interval
    closure_ci: Interval = (0.0, 0.0)
    # The largest share first; empty where nothing closes, or it was not requested.
    attribution: tuple[GroupShare, ...] = ()
    ceiling: Ceiling = field(default_factory=Ceiling)
    twin: str = ""  # name of its twin file, beside gap.json; empty without one
    metrics: tuple[Metric, ...] = ()

    @property
    def sentence(self) -> str:
        """What closes, and by which groups; empty where nothing was attributed."""
        if not self.attribution:
            return ""
        shown = [share for share in self.attribution if share.shown and round(100 * share.share) > 0]
        parts = ", ".join(
            f"{share.group} {_percent(share.share)}"
            + (f" ({listed((e.effect for e in share.effects), 'or')} cannot be told apart)" * (len(share.effects) > 1))
            for share in shown
        )
        if parts and abs(left := self.closure - sum(share.share for share in shown)) >= _LEFT_OUT:
            parts += f"; all others {_percent(left)}"
        ends = "{} to {}".format(*map(_percent, self.closure_ci))
        closes = f"The closest twin closes {_percent(self.closure)} of the gap (90 % interval {ends})"
        by = f": {parts}" if parts else "; no group of effects alone is shown to"
        limit = self.ceiling.same_unit
        most = f". Other real records of the same bearing close {_percent(limit)}" if limit is not None else ""
        return f"{closes}{by}{most}."


@dataclass(frozen=True)
class TwoSampleTest:
    """A two-sample test of records against the calibrated twin, with a p-value from permutations."""

    name: str
    statistic: float
    p_value: float


@dataclass(frozen=True)
class Curve:
    """Curves of the records, of the calibrated twin, and of the twin with the verdict's effects.

    Parameters
    ----------
    x : sequence of float, or of str for conditions
        Places, as many as values in each line.
    x_unit : str
        Unit or quantity for the axis: "Hz", "shaft orders", "quantile".
    real, before : sequence of float
        Medians over held-out records; NaN where not measured.
    after : sequence of float or None
        None when the verdict adds nothing.
    domain : str
        The places of this domain are marked on it.
    bands : Mapping[str, (lo, hi)]
        "real", "before" or "after" -> two lines between which 90 % of the records lie.
    log_y : bool
        Whether values are better read on a logarithmic axis.
    marks : Mapping[str, float]
        Name -> place on the axis, such as "BPFO" -> 3.58.
    """

    x: tuple[float, ...] | tuple[str, ...]
    x_unit: str
    real: Numbers
    before: Numbers
    after: Numbers | None
    y_unit: str
    title: str
    domain: DomainName
    bands: Mapping[str, tuple[Numbers, Numbers]] = field(default_factory=dict)
    log_y: bool = False
    marks: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        words = any(isinstance(v, str) for v in self.x)
        x: Any = tuple(map(str, self.x)) if words else _numbers(self.x)  # type: ignore[arg-type]
        after = None if self.after is None else _numbers(self.after)
        bands = {name: (_numbers(lo), _numbers(hi)) for name, (lo, hi) in self.bands.items()}
        _set(self, x=x, real=_numbers(self.real), before=_numbers(self.before), after=after, bands=bands)
        sizes = [
            len(line) for line in (self.real, self.before, after, *itertools.chain(*bands.values())) if line is not None
        ]
        if any(size != len(x) for size in sizes):
            raise ValueError(f"curve {self.title!r}: lines of {sizes} values, {len(x)} expected")


@dataclass(frozen=True)
class GapReport:
    """Result of a diagnosis.

    Parameters
    ----------
    places : tuple[Place, ...]
        Where the gap lies, the largest share first.
    candidates : tuple[Candidate, ...]
        All candidates, the most probable first.
    metrics : tuple[Metric, ...]
        The first is the one that closures refer to.
    provenance : Mapping
        At least seed, version, records_sha256, runtime_s. The page also shows further entries, such as records, twin,
        twin_effects, n_records, n_fit, n_held_out, bearing, fs_hz, simulator.
    notes : tuple[str, ...]
        Remarks on what could not be decided, and on replacements.
    calibration : Mapping[str, ParameterValue]
        Identified parameters of the twin, the speed correction (speed_correction) and the unit gain (unit_gain).
    calibration_after : Mapping[str, ParameterValue]
        Those that differ where the twin was calibrated again with the named effects.
    rest : tuple[Place, ...]
        Where the unexplained rest lies, the largest share first.
    curves : Mapping[str, Curve]
        For figures; any of "spectrum", "envelope", "order", "amplitude", "time", "condition", or others.
    closest : ClosestTwin
        What the closest twin closes, and which group of effects closes it.
    """

    verdict: Verdict
    places: tuple[Place, ...]
    candidates: tuple[Candidate, ...]
    metrics: tuple[Metric, ...]
    provenance: Mapping[str, Any]
    notes: tuple[str, ...] = ()
    calibration: Mapping[str, ParameterValue] = field(default_factory=dict)
    rest: tuple[Place, ...] = ()
    tests: tuple[TwoSampleTest, ...] = ()
    curves: Mapping[str, Curve] = field(default_factory=dict)
    closest: ClosestTwin = field(default_factory=lambda: ClosestTwin())
    calibration_after: Mapping[str, ParameterValue] = field(default_factory=dict)

    def __post_init__(self) -> None:
        places, rest = (tuple(sorted(own, key=lambda p: -p.share)) for own in (self.places, self.rest))
        _set(self, places=places, rest=rest, candidates=tuple(sorted(self.candidates, key=lambda c: -c.probability)))

    @property
    def sentence(self) -> str:
        """The verdict in one plain sentence; a closure that it does not state is that of the first metric.

        Where nothing could be added, the metrics are equal before and after and define no closure.
        """
        verdict = self.verdict
        if verdict.effects and verdict.closure is None and self.metrics:
            first = self.metrics[0]
            verdict = replace(verdict, closure=first.closure if first.after != first.before else None)
        left_out = {c.effect for c in self.candidates if c.acts is not None}
        added = [name for name in verdict.effects if name not in left_out]
        # What cannot be added to finished waveforms closes nothing.
        return verdict.sentence_with(listed(added)) if 0 < len(added) < len(verdict.effects) else verdict.sentence

    @property
    def closest_sentence(self) -> str:
        """What the closest twin closes, and by which groups, beside the verdict; empty where nothing was attributed."""
        said, named = self.closest.sentence, self.verdict.closure
        no_more = named is not None and round(100 * self.closest.closure) <= round(100 * named)
        return said.replace("twin closes", "twin closes no more,", 1) if no_more else said

    @property
    def where(self) -> pd.DataFrame:
        """Places, largest share first: domain, lo, hi, unit, condition, share, p_value."""
        columns = ("domain", "lo", "hi", "unit", "condition", "share", "p_value")
        return _frame(({name: getattr(p, name) for name in columns} for p in self.places), columns)

    @property
    def which(self) -> pd.DataFrame:
        """Candidates, most probable first: effect, probability, gap_before, gap_after, closure, closure_lo, ..."""
        plain_ones = ("effect", "probability", "gap_before", "gap_after", "closure")
        columns = (*plain_ones, "closure_lo", "closure_hi", "parameters", "fitted_with", "acts")
        rows = (
            {name: getattr(c, name) for name in plain_ones}
            | {"closure_lo": c.closure_ci[0], "closure_hi": c.closure_ci[1], "acts": c.acts}
            | {"parameters": {n: p.value for n, p in c.parameters.items()}, "fitted_with": ", ".join(c.fitted_with)}
            for c in self.candidates
        )
        return _frame(rows, columns)

    @property
    def shrink(self) -> pd.DataFrame:
        """Measures of the gap: metric, before, after, after_lo, after_hi, floor, closure, unit."""
        columns = ("metric", "before", "after", "after_lo", "after_hi", "floor", "closure", "unit")
        rows = (
            {"metric": m.metric, "before": m.before, "after": m.after, "floor": m.floor, "unit": m.unit}
            | {"after_lo": m.ci_after[0], "after_hi": m.ci_after[1]}
            | {"closure": math.nan if m.closure is None else m.closure}
            for m in self.metrics
        )
        return _frame(rows, columns)

    def __str__(self) -> str:
        """The verdict, and what the closest twin closes."""
        return "\n".join(filter(None, (self.sentence, self.closest_sentence)))

    def _repr_html_(self) -> str:
        """The verdict, and the named effects with closures and values, for notebooks."""
        columns = ("effect", "probability", "closes (90 % interval)", "values")
        rows = [
            (
                c.effect,
                _percent(c.probability),
                "cannot be added" if c.acts else "{} ({} to {})".format(*map(_percent, (c.closure, *c.closure_ci))),
                ", ".join(f"{name} = {p.value:.4g} {p.unit}".strip() for name, p in c.parameters.items()),
            )
            for c in self.candidates
            if c.effect in self.verdict.effects
        ]
        table = _frame((dict(zip(columns, row, strict=True)) for row in rows), columns)
        shown = "".join(f"<p>{html.escape(text)}</p>" for text in (self.sentence, self.closest_sentence) if text)
        return shown + (table.to_html(index=False, border=0) if rows else "")


def listed(effects: Iterable[str], last: str = "and") -> str:
    """Names of effects in a sentence: "a, b and c"; "no effect" for none."""
    names = [name.replace("_", " ") for name in effects]
    return f" {last} ".join(filter(None, (", ".join(names[:-1]), names[-1]))) if names else "no effect"


def count_words(number: int) -> str:
    """Small numbers as words."""
    words = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine")
    return words[number] if number < len(words) else str(number)


def _percent(part: float) -> str:
    return f"{round(100 * part)} %"


def _frame(rows: Iterable[Mapping[str, Any]], columns: tuple[str, ...]) -> pd.DataFrame:
    import pandas as pd

    return pd.DataFrame(list(rows), columns=list(columns))


def _numbers(values: Iterable[float | None]) -> Numbers:
    """Floats; all values that are not finite become the same NaN object, so that equal curves compare equal."""
    floats = (math.nan if v is None else float(v) for v in values)
    return tuple(v if math.isfinite(v) else math.nan for v in floats)


def _set(target: object, **values: Any) -> None:
    """Set normalised values of a frozen object, from its ``__post_init__``."""
    for name, value in values.items():
        object.__setattr__(target, name, value)
