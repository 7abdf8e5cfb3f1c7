"""Advice after a diagnosis: next steps in sentences, and lines for the twin file.

GapReport --next_steps--> a few sentences, the first the most useful
GapReport --snippet-----> lines for TWIN.toml: the verdict's effects with their fitted parameters
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Mapping
from typing import Any, Final

from twingap.config import to_toml
from twingap.effects import catalogue
from twingap.gap.distance.domain_names import DomainName
from twingap.gap.distance.domains import DOMAIN
from twingap.gap.report.at_hand import RECORDS_HAVE, without_what_is_there
from twingap.gap.report.model import Candidate, GapReport, ParameterValue, Place, listed

_HIDDEN_DB: Final = 6.0
"""Level by which the records' peak must exceed that at the calibrated resonance for a warning."""
_CAREFUL: Final = "Careful"
"""First word of a contradiction that the reader has to resolve."""
_IMPROBABLE: Final = 0.1
"""Probability below which an effect is not advised to be decided. A smaller value asks for more measurements."""
_PERFECT: Final = 0.99
"""Accuracy of a classifier that no twin can improve."""
_THROUGHOUT_ADVICE: Final = (
    "Throughout the records single impacts or bursts stand out more, or less, than in the twin: look at the waveforms."
)
_UNDETERMINED: Final = 4.0
"""Ratio of the ends of a value's interval above which it is not determined. A smaller ratio warns of more values."""
_UNDETERMINED_HZ: Final = 2.0
"""The same for a frequency, of which the range of records is a few octaves."""
_SMALL_P: Final = 0.05
"""P-value below which a single test is mentioned beside a verdict of no gap."""


def next_steps(report: GapReport) -> tuple[str, ...]:
    """Next steps in sentences, the most useful first."""
    verdict = report.verdict
    steps: list[str] = []
    if any(note.startswith(_CAREFUL) for note in contradictions(report)):
        steps.append(
            "Compare the curves below before you rely on the verdict: they show what the two-sample tests distinguish. "
            "More or longer records may settle it."
        )
    elif verdict.status == "no_gap":
        steps.append(
            "Use the twin as it is for conditions like these. A gap that shows only elsewhere (other speeds, loads or "
            "faults) would not have been found."
        )
        steps.append("More or longer records would reveal smaller gaps: repeat the diagnosis when you have them.")
    if verdict.effects:
        them = "it" if len(verdict.effects) == 1 else "them"
        added = [c for c in report.candidates if c.effect in verdict.effects and c.acts is None]
        if added and (verdict.closure or 0.0) > 0:
            steps.append(_add(report, added))
        elif added:
            steps.append(
                f"{_upper(listed(c.effect for c in added))} show{'s' * (len(added) == 1)} in the records, and at the "
                f"values found {'it brings' if len(added) == 1 else 'they bring'} records and twin no closer: check "
                "the values below before you add anything to TWIN.toml."
            )
        steps.extend(
            f"{_upper(listed((c.effect,)))} cannot be added to your simulator's records: {c.acts}."
            for c in report.candidates
            if c.effect in verdict.effects and c.acts is not None
        )
        if not added or _own_simulator(report):
            steps.append(f"Model {listed(verdict.effects)} in your simulator and compare {them} again.")
    open_ones = tuple(name for name in undecided(report) if _is_open(report, name))
    known = [catalogue()[name] for name in open_ones if name in catalogue()]
    deciding = list(dict.fromkeys(kind.deciding_measurement for kind in known))
    if deciding:
        steps.append(
            f"The data leave open {_open(open_ones)}. To decide, "
            + "; or ".join(deciding[:3])
            + ("." if len(deciding) <= 3 else "; and others.")
        )
    if verdict.status in ("unexplained", "partly_explained"):
        left = report.rest or report.places
        subject = "rest" if verdict.effects else "gap"
        kinds = [_kind(report, place) for place in left]
        for kind in dict.fromkeys(kinds[:6]):
            own = [place for place, its in zip(left, kinds, strict=True) if its == kind]
            at = "; ".join(dict.fromkeys(place_words(p) for p in own[:3]))
            domain, throughout, twin_higher = kind
            advice = _THROUGHOUT_ADVICE if throughout else DOMAIN[domain].advice
            steps.append(
                f"The {subject} lies in {DOMAIN[domain].phrase}: {at}. "
                f"{_twin_has_more(report, own) if twin_higher else advice}"
            )
        steps.append(_closest(report))
        steps.append(
            "Once you have a suspicion, write it as an effect of your own (a short class, see `twingap.effects`) and "
            "register it: the diagnosis tries it like any other."
        )
    had = report.provenance.get(RECORDS_HAVE, {})
    return tuple(without_what_is_there(step, had) for step in steps)


def _kind(report: GapReport, place: Place) -> tuple[DomainName, bool, bool]:
    """Places that get one advice: domain, whether it covers whole records, whether the twin has more there."""
    throughout = place.domain == "time" and _throughout(report, place)
    return place.domain, throughout, place.sign == "twin_higher" and not throughout


def _throughout(report: GapReport, place: Place) -> bool:
    """Whether a place in time covers whole records, as single impacts and bursts do."""
    curve = report.curves.get("time")
    if place.lo is None or place.hi is None:
        return True
    if curve is None or len(curve.x) < 2:
        return False
    first, *_, last = (float(x) for x in curve.x)
    return place.lo <= first and place.hi >= last


def _add(report: GapReport, added: Iterable[Candidate]) -> str:
    """Advice to add effects to the twin file, or to the user's own simulator."""
    spectra = [c.effect for c in added if _measured(c)]
    plain = [c for c in added if not _measured(c)]
    if _own_simulator(report):
        names = listed(c.effect for c in added)
        return f"Add {names} to your simulator, at the values below, and compare again: the gap should shrink as shown."
    lists = ""
    if spectra:
        file = f"`{report.closest.twin}`" if report.closest.twin else "`closest.toml`, written without `--quick`,"
        are = "is a spectrum" if len(spectra) == 1 else "are spectra"
        lists = f"{_upper(listed(spectra))} {are} of many values: {file} holds {'it' if len(spectra) == 1 else 'them'}."
    if not plain:
        return lists
    loose = [f"`{c.effect}.{n}`" for c in plain for n, value in c.parameters.items() if _undetermined(value)]
    check = ""
    if loose:
        those = " and ".join(loose) if len(loose) < 3 else f"{len(loose)} of these values, marked below"
        check = f" The records do not determine {those}: commented out, as below, the next diagnosis fits them again."
    return (
        f"Add {listed(c.effect for c in plain)} to your twin: in its file replace the table [twin] by that below, and "
        f"append the others. {lists + ' ' if lists else ''}Then run the diagnosis again; the gap as a whole should "
        f"shrink as shown. `twingap close` does both, until no further effect shrinks the gap.{check}"
    )


def _measured(candidate: Candidate) -> bool:
    """Whether an effect is measured from spectra: its values are lists, too long for a page."""
    return candidate.effect in catalogue() and catalogue()[candidate.effect].measured


def _own_simulator(report: GapReport) -> bool:
    """Whether the simulated records were given, so that there is no twin file to change."""
    return bool(report.provenance.get("simulator"))


def _is_open(report: GapReport, name: str) -> bool:
    """Whether an effect of some explanations may well be missing: it is not named, and not improbable."""
    probability = next((c.probability for c in report.candidates if c.effect == name), 1.0)
    return name not in report.verdict.effects and probability >= _IMPROBABLE


def _closest(report: GapReport) -> str:
    """Advice on the closest twin, from the accuracy of a classifier trained on it."""
    found = report.closest
    if not found.attribution and found.twin:
        return f"Nothing in the catalogue brings the twin clearly closer: `{found.twin}` is the verdict's twin."
    if not found.attribution:
        return (
            "If a twin for training matters more than names, let the diagnosis find the closest one: leave out "
            "`--quick`."
        )
    use = f"If a twin for training matters more than names, use the closest one, `{found.twin}`" if found.twin else ""
    accuracy = next((m for m in found.metrics if m.higher_is_better), None)
    if accuracy is None or not use or accuracy.before >= _PERFECT:
        return f"{use or 'For records of the closest twin, which has no twin file, diagnose with `--export`'}."
    verdict = next((m.after for m in report.metrics if m.metric == accuracy.metric), accuracy.before)
    named, as_it_was, by_verdict = (f"{100 * part:.0f} %" for part in (accuracy.after, accuracy.before, verdict))
    right = f"{named} of held-out records; {as_it_was} after the twin as calibrated, {by_verdict} after the verdict's"
    if accuracy.after > max(accuracy.before, verdict):
        return f"{use}: a classifier then names {right}."
    return f"The closest twin does not improve a classifier (it names {right}): closer is not better for every use."


def _twin_has_more(report: GapReport, places: Iterable[Place]) -> str:
    """Advice for places in which the twin has more than the records: the cause is the twin, not the machine."""
    if report.verdict.effects and any(p.after == "new" for p in places):
        them = "it" if len(report.verdict.effects) == 1 else "them"
        return (
            f"There the twin with {listed(report.verdict.effects)} has more than the records, and without {them} it "
            "has not: the values found are too large there. Lower them, or identify the twin again with them."
        )
    return (
        "There the twin has more than the records: the machine lacks, or has less of, what the twin models. Check the "
        "twin's levels and parameters before you add anything."
    )


def warnings(report: GapReport) -> tuple[str, ...]:
    """Cautions in sentences: measures that get worse, and a calibrated resonance that is not the records'."""
    out = []
    worse = [m for m in report.metrics if m.worse] if report.verdict.effects else []
    if worse:
        names = "; ".join(f"{m.metric.replace('_', ' ')} {m.before:.3g} → {m.after:.3g}" for m in worse)
        out.append(f"Worse with the effects added: {names}.")
    resonance, spectrum = report.calibration.get("resonance_hz"), report.curves.get("spectrum")
    if resonance is not None and spectrum is not None and not isinstance(spectrum.x[0], str):
        level = {float(x): y for x, y in zip(spectrum.x, spectrum.real, strict=True) if y == y}
        peak = max(level, key=level.__getitem__)
        near = level[min(level, key=lambda x: abs(x - resonance.value))]
        if abs(math.log2(peak / resonance.value)) > 1 and level[peak] - near > _HIDDEN_DB:
            out.append(
                f"The twin's resonance is calibrated at {resonance.value:.4g} Hz, but the records' spectrum peaks at "
                f"{peak:.4g} Hz, {level[peak] - near:.0f} dB higher: state resonance_hz in the twin file, or check the "
                "records for a disturbance at one of the two."
            )
    return tuple(out)


def contradictions(report: GapReport) -> tuple[str, ...]:
    """Contradictions between parts of a report, in sentences."""
    small = [t for t in report.tests if t.p_value < _SMALL_P]
    if report.verdict.status != "no_gap" or not small:
        return ()
    clear = [t for t in small if t.p_value * len(report.tests) < 0.01]  # Bonferroni
    if not clear:
        tests = " and ".join(f"{t.name} (p = {t.p_value:.2g})" for t in small)
        return (
            f"One test alone would call a gap: {tests}. Of machines without a gap, one in twenty does so by chance in "
            "each test; the verdict weighs all statistics together, and is calibrated on such machines.",
        )
    tests = " and ".join(f"{t.name} (p = {t.p_value:.2g})" for t in clear)
    return (
        f"{_CAREFUL}: the verdict is no gap, but the two-sample tests distinguish records and twin: {tests}. Check the "
        "curves before you rely on the verdict.",
    )


def only_together(report: GapReport) -> str:
    """One sentence where each of the named effects, left out, leaves a larger gap than no effect does, and all of them
    close it; else empty.

    Of two effects, leaving one out adds the other alone.
    """
    named = [c for c in report.candidates if c.effect in report.verdict.effects]
    if len(named) < 2 or not report.metrics or any(c.acts is not None for c in named):
        return ""
    gap = report.metrics[0]
    # Candidates are measured with fewer simulated records than the verdict: within its interval they are no larger.
    largest = gap.before if gap.ci_before is None else gap.ci_before[1]
    if gap.ci_after[1] >= gap.before or any(c.gap_before <= largest for c in named):
        return ""
    names = listed(c.effect for c in named)
    alone = "either of them alone widens it" if len(named) == 2 else "without any one of them the others widen it"
    return (
        f"{_upper(names)} close the gap only together, from {gap.before:.3g} to {gap.after:.3g}: "
        f"{alone}, to {min(c.gap_before for c in named):.3g} or more."
    )


def undecided(report: GapReport) -> tuple[str, ...]:
    """Effects that are in some of the confidence set's explanations but not in all."""
    sets = report.verdict.confidence_set
    everywhere = set.intersection(*(set(s) for s in sets)) if sets else set()
    return tuple(dict.fromkeys(name for s in sets for name in s if name not in everywhere))


def snippet(report: GapReport) -> str | None:
    """Lines for TWIN.toml with the verdict's effects and their fitted parameters; None when there are none to add.

    Effects that are measured from spectra, such as a transfer path, are left out: their values are in the closest
    twin's file.

    Effects that the twin has already (provenance ``twin_effects``) are kept in the list.
    """
    added = [c for c in report.candidates if c.effect in report.verdict.effects and c.acts is None]
    added = [c for c in added if not _measured(c)]
    if not added or _own_simulator(report):
        return None
    had = report.provenance.get("twin_effects", ())
    present = [str(name) for name in had] if isinstance(had, (list, tuple)) else []
    names = list(dict.fromkeys([*present, *(n for n in report.verdict.effects if n in {c.effect for c in added})]))
    model = str(report.provenance.get("twin_model", "phenomenological"))
    tables: dict[str, Any] = {"twin": {"model": model, "effects": tuple(names)}}
    parameters = {c.effect: _fitted(c) for c in added if c.parameters}
    if parameters:
        tables["parameters"] = parameters
    return _with_intervals(to_toml(tables).replace("[parameters]\n\n", ""), added)


def _with_intervals(text: str, added: Iterable[Candidate]) -> str:
    """The lines of a twin file, with the interval of each fitted value as a comment; undetermined values commented out,
    so that the next diagnosis fits them."""
    of = {f"[parameters.{c.effect}]": c.parameters for c in added}
    lines: list[str] = []
    table: Mapping[str, ParameterValue] = {}
    for line in text.splitlines():
        table = of.get(line, {}) if line.startswith("[") else table
        own = table.get(line.partition(" = ")[0])
        if own is not None and own.ci is not None and own.ci[0] < own.ci[1] and not line.endswith(("true", "false")):
            ends = f"{own.ci[0]:.4g} to {own.ci[1]:.4g}"
            line = f"# {line}  # not determined: {ends}" if _undetermined(own) else f"{line}  # {ends}"
        lines.append(line)
    return "\n".join(lines) + "\n" * text.endswith("\n")


def _undetermined(value: ParameterValue) -> bool:
    """Whether the interval of a value is so wide that the records do not determine it."""
    ratio = _UNDETERMINED_HZ if value.unit == "Hz" else _UNDETERMINED
    return value.ci is not None and 0 < ratio * value.ci[0] < value.ci[1]


def place_words(place: Place) -> str:
    """A place in words: "2150 to 2870 Hz (inner)"."""
    if place.domain == "time" and place.lo is None and place.hi is None:
        named = condition_words(place.condition)
        return "throughout the record" + (f" ({named})" if named else "")
    unit = "" if place.unit in ("", "1") else f" {place.unit}"
    # Of frequencies beyond 10 kHz four digits would be written with an exponent.
    lo, hi = (None if v is None else f"{v:.0f}" if 1e4 <= v < 1e7 else f"{v:.4g}" for v in (place.lo, place.hi))
    if lo is not None and hi is not None:
        where = f"{lo}{unit}" if lo == hi else f"{lo} to {hi}{unit}"
    elif lo is not None:
        where = f"above {lo}{unit}"
    else:
        where = f"below {hi}{unit}" if hi is not None else ""
    named = condition_words(place.condition)
    return f"{where} ({named})" if where and named else where or named or "everywhere"


def condition_words(condition: Mapping[str, Any] | None) -> str:
    """A condition in words: "1797 rpm, inner"; empty for all."""
    if not condition:
        return ""
    units = {"speed_rpm": "rpm", "load_n": "N", "time_s": "s into the run"}
    parts = []
    for name, value in condition.items():
        ends = value if isinstance(value, (list, tuple)) else (value,)
        between = " to " if all(isinstance(v, (int, float)) for v in ends) else ", "
        shown = between.join(f"{v:.5g}" if isinstance(v, float) else str(v) for v in ends)
        if name == "fault":
            shown = "unknown fault" if value is None else shown
        parts.append(f"{shown} {units[name]}" if name in units else shown if name == "fault" else f"{name} {shown}")
    return ", ".join(parts)


def _open(names: tuple[str, ...]) -> str:
    return f"whether {listed(names)} is missing too" if len(names) == 1 else f"which of {listed(names)} is missing"


def _fitted(candidate: Candidate) -> dict[str, Any]:
    """Values for the twin file: integers and booleans where the effect requires them."""
    kinds: Iterable[Any] = ()
    if candidate.effect in catalogue():
        kinds = dataclasses.fields(catalogue()[candidate.effect])  # type: ignore[arg-type]
    wanted = {f.name: f.type for f in kinds}
    values: dict[str, Any] = {}
    for name, parameter in candidate.parameters.items():
        value = float(f"{parameter.value:.4g}")
        of_list, _, place = name.rpartition(".")
        if place.isdecimal() and of_list in wanted:
            values[of_list] = (*values.get(of_list, ()), value)
            continue
        kind = wanted.get(name)
        values[name] = bool(round(value)) if kind == "bool" else round(value) if kind == "int" else value
    return values


def _upper(text: str) -> str:
    return text[:1].upper() + text[1:]
