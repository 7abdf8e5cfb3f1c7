"""Figures 3 to 14 of the paper on these runs, in colours that colour-blind readers tell apart (Okabe and Ito; cividis).

Figures 1 and 2 of the paper are drawings of the method. Where two of its figures show the same thing of a principle and
of a bearing (3 and 4, 5 and 10, 6 and 12), one is drawn here, of a bearing.
"""

from collections.abc import Iterator
from typing import Final

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import FancyBboxPatch

from papers.figures import LINE_NAMES, grid, rule, subplots
from papers.framework import Work
from papers.paper1_rul_varying_speed.job import CaseResult, simulate
from papers.paper1_rul_varying_speed.lives.options import Options
from papers.paper1_rul_varying_speed.lives.tables import LIVES, layers
from papers.paper1_rul_varying_speed.lives.tables import errors as errors_of
from papers.paper1_rul_varying_speed.methods.architecture import MODELS, LifeArchitecture
from papers.paper1_rul_varying_speed.methods.metrics import rmse
from twingap.signal.envelope import squared_envelope_spectrum

COLOURS: Final = dict(
    zip((*MODELS, LIVES), ("#E69F00", "#CC79A7", "#56B4E9", "#009E73", "#0072B2", "0.45"), strict=True)
)
MARKERS: Final = dict(zip(MODELS, "oD<>s", strict=True))
MEASURED, SIMULATED, TRUE = "#D55E00", "#0072B2", "k"


def all_figures(work: Work) -> Iterator[tuple[str, Figure]]:
    """Every figure of every bearing with its name; the network is the same for all."""
    results, options, data = work["results"], work.options, work.title
    shown = results[0].trainings[-1].job
    yield "figure08-network", network(shown.architecture, shown.model)
    for result in (r for r in results if r.variant == results[0].variant):
        name = result.case.name
        yield f"figure03_04-{name}-speed", speed(result, options, data)
        yield f"figure05_10-{name}-anomaly", anomaly(result, options, data)
        yield f"figure07-{name}-remaining", remaining(result, data)
        yield f"figure09-{name}-run", run(result, options, data)
    for twin in dict.fromkeys(r.variant for r in results):
        own = [r for r in results if r.variant == twin]
        about = f"{data}; {twin} twin"
        for result in own:
            name = result.case.name
            yield f"figure06_12-{name}-trajectories-{twin}", trajectories(result, options, about)
            yield f"figure11-{name}-signals-{twin}", signals(result, data)
            if "embedding" in result.trainings[0].value:
                yield f"figure13-{name}-tsne-{twin}", embedding(result, about)
            yield f"figure14-{name}-{twin}", predicted(result, about)
        yield f"table5-{twin}", table5(pd.DataFrame(errors_of(own, options, data)))


def speed(result: CaseResult, options: Options, data: str) -> Figure:
    """Figures 3 and 4: healthy peak to peak over speed, and S that runs through it."""
    case, influence = result.case, result.case.known.twin.influence
    healthy = case.run.rows_in(options.adaptation.reference_min)
    figure, (left, right) = subplots((11, 4.6), 1, 2)
    minutes = case.run.time_s[:healthy] / 60
    left.plot(minutes, case.run.peak_to_peak[:healthy], ".-", color=MEASURED, lw=0.8)
    left.set(xlabel="time (min)", ylabel=f"peak to peak ({case.known.unit})", title="healthy beginning")
    other = left.twinx()
    other.step(minutes, case.run.speed_rpm[:healthy], color="0.6", lw=1.2, where="mid")
    other.set_ylabel("speed (rpm), grey")
    fine = np.linspace(influence.speeds_rpm[0], influence.speeds_rpm[-1], 400)
    right.plot(case.run.speed_rpm[:healthy], case.run.peak_to_peak[:healthy], ".", color=MEASURED, label="records")
    right.plot(fine, influence.amplitude(fine), color=SIMULATED, label="S, interpolated (eqs. 9, 10)")
    right.plot(influence.speeds_rpm, influence.amplitude(influence.speeds_rpm), "o", color=SIMULATED, ms=6)
    right.set(xlabel="speed (rpm)", ylabel=f"peak to peak ({case.known.unit})", title="influence of speed")
    right.set_ylim(bottom=0)
    right.legend()
    return _titled(figure, result, data)


def _titled(figure: Figure, result: CaseResult, data: str) -> Figure:
    figure.suptitle(f"{result.case.name}, {data}")
    return figure


def anomaly(result: CaseResult, options: Options, data: str) -> Figure:
    """Figures 5 and 10: peak to peak, the same with speed taken out and the anomaly in it, the speed profile."""
    case, twin = result.case, result.case.known.twin
    minutes = case.run.time_s / 60
    figure, (first, second, third) = subplots((11, 8), 3, 1, sharex=True)
    first.plot(minutes, case.run.peak_to_peak, color=MEASURED, lw=0.9)
    first.axhline(options.adaptation.limit, color="k", ls="--", lw=1, label="end of life")
    first.set_ylabel(f"peak to peak ({case.known.unit})")
    first.legend(loc="upper left")
    second.plot(minutes, case.normalised, color=MEASURED, lw=0.9)
    second.axhline(twin.anomaly.limit, color="k", ls=":", label="limit")
    second.axvline(minutes[twin.onset_row], color=SIMULATED, label="anomaly, as detected")
    second.axvline(minutes[twin.now_row], color=SIMULATED, ls="--", label="now: lives are predicted from here")
    if case.onset_s is not None:
        second.axvline(case.onset_s / 60, color="0.5", lw=3, alpha=0.5, label="true onset")
    second.set_ylabel("normalised\npeak to peak")
    second.legend(loc="upper left")
    third.step(minutes, case.run.speed_rpm, color="0.3", lw=0.8, where="mid")
    third.set(xlabel="time (min)", ylabel="speed (rpm)")
    return _titled(figure, result, data)


def trajectories(result: CaseResult, options: Options, data: str) -> Figure:
    """Figures 6 and 12: the fit of eq. 12, simulated lives, and the peak to peak of their signals."""
    case, twin = result.case, result.case.known.twin
    made, _ = simulate(result.trainings[0].job, case.known)
    minute = case.run.dt_s / 60
    onset, end = twin.onset_row, case.run.time_s.size
    figure, (left, right) = subplots((12, 5), 1, 2)
    rows = np.arange(onset, end)
    seen, later = rows[rows <= twin.now_row], rows[rows > twin.now_row]
    left.plot(later * minute, case.normalised[later], ".", color="0.75", label="measured later")
    left.plot(seen * minute, case.normalised[seen], ".", color=MEASURED, label="measured up to now")
    for i, life in enumerate(twin.lives):
        at = (onset + np.arange(life.growth.size)) * minute
        left.plot(at, life.growth, color=SIMULATED, lw=1, alpha=0.8, label="simulated lives" if i == 0 else None)
    left.set(xlabel="time (min)", ylabel="normalised peak to peak", title="D of each life (eq. 12)")
    left.set_ylim(0, 1.15 * max(life.growth[-1] for life in twin.lives))
    left.legend()
    heights = np.ptp(made.samples, axis=1)
    for i in np.unique(made.life):
        own = np.flatnonzero(made.life == i)
        own = own[np.argsort(made.position[own], kind="stable")]
        right.plot((onset + made.position[own]) * minute, heights[own], color=SIMULATED, lw=0.6, alpha=0.7)
    right.plot(rows * minute, case.run.peak_to_peak[rows], color=MEASURED, lw=1.2, label="measured")
    right.plot([], [], color=SIMULATED, label="simulated signals")
    right.axhline(options.adaptation.limit, color="k", ls="--", lw=1, label="end of life")
    right.set(xlabel="time (min)", ylabel=f"peak to peak ({case.known.unit})", title="signals of eq. 1")
    right.legend()
    return _titled(figure, result, data)


def remaining(result: CaseResult, data: str) -> Figure:
    """Figure 7: remaining revolutions, remaining time, speed; and the slope of -1 at constant speed."""
    case = result.case
    assert case.judged.revolutions is not None
    at = (case.known.twin.onset_row + case.judged.position) * case.run.dt_s / 60
    figure, (first, second, third) = subplots((10, 7.5), 3, 1, sharex=True)
    first.plot(at, case.judged.revolutions / 1000, color=TRUE)
    first.set_ylabel("remaining\nrevolutions (1000)")
    second.plot(at, case.true_min, ".-", color=TRUE, lw=0.8, label="RUL by eq. 14")
    for i, k in enumerate(np.flatnonzero(np.diff(case.judged.speed_rpm) == 0)):
        label = "constant speed: slope -1" if i == 0 else None
        second.plot(at[k : k + 2], case.true_min[k : k + 2], color="#E69F00", lw=3, label=label)
    second.set_ylabel("remaining time (min)")
    second.legend()
    third.step(at, case.judged.speed_rpm, color="0.3", where="mid")
    third.set(xlabel="time (min)", ylabel="speed (rpm)")
    return _titled(figure, result, f"{data}: true remaining life after the anomaly")


def network(own: LifeArchitecture, model: str) -> Figure:
    """Figure 8: the network with the sizes that were run."""
    figure, axes = subplots((13, 4.6))
    axes.set_axis_off()
    axes.set(xlim=(-0.15, 13.15), ylim=(0.1, 4.4))

    def box(x: float, y: float, text: str, colour: str, width: float) -> None:
        axes.add_patch(FancyBboxPatch((x, y), width, 1.0, boxstyle="round,pad=0.05", fc=colour, ec="k", alpha=0.35))
        axes.text(x + width / 2, y + 0.5, text, ha="center", va="center", fontsize=11)

    (_, c1, s1), (_, p1, _), (_, c2, s2), (_, p2, _) = layers(own)
    box(0.0, 3.2, f"record\n{own.length} samples", "0.7", 1.6)
    box(2.1, 3.2, f"convolution, ReLU\n{s1}\nlength {c1}, pooled to {p1}", "#56B4E9", 2.4)
    box(5.0, 3.2, f"convolution, ReLU\n{s2}\nlength {c2}, pooled to {p2}", "#56B4E9", 2.4)
    box(5.0, 1.7, f"sequence encoding\n(eq. 13), length {own.d_model}", "#009E73", 2.4)
    box(5.0, 0.2, f"speed encoding\n(eq. 13), length {own.d_model}", "#009E73", 2.4)
    box(8.0, 1.7, f"concatenated\nlength {own.joined}", "0.7", 1.6)
    box(10.2, 2.9, "regressor\n64, 32, 1 (ReLU)\nremaining revolutions", "#E69F00", 2.8)
    box(10.2, 0.5, f"gradient reversal, λ = {own.reversal:g}\n64, 32, 1 (sigmoid)\nsimulated or real", "#CC79A7", 2.8)
    for a, b in (((1.65, 3.7), (2.05, 3.7)), ((4.55, 3.7), (4.95, 3.7)), ((7.45, 3.5), (8.3, 2.75)),
                 ((7.45, 2.2), (7.95, 2.2)), ((7.45, 0.9), (8.3, 1.65)), ((9.65, 2.4), (10.15, 3.3)),
                 ((9.65, 2.0), (10.15, 1.1))):  # fmt: skip
        axes.annotate("", b, a, arrowprops={"arrowstyle": "->", "lw": 1.2})
    figure.suptitle(f"Network of {model}, sizes as run")
    return figure


def run(result: CaseResult, options: Options, data: str) -> Figure:
    """Figure 9: a whole run."""
    case = result.case
    figure, axes = subplots((11, 4.4))
    minutes = case.run.time_s / 60
    other = axes.twinx()
    other.step(minutes, case.run.speed_rpm, color="0.75", lw=0.8, where="mid")
    other.set(ylabel="speed (rpm), grey", ylim=(0, 2.2 * case.run.speed_rpm.max()))
    axes.plot(minutes, case.run.peak_to_peak, color=MEASURED, lw=1)
    axes.axhline(options.adaptation.limit, color="k", ls="--", lw=1)
    axes.set(xlabel="time (min)", ylabel=f"peak to peak ({case.known.unit})")
    axes.set_zorder(other.get_zorder() + 1)
    axes.patch.set_visible(False)
    return _titled(figure, result, data)


def signals(result: CaseResult, data: str) -> Figure:
    """Figure 11: a record after the anomaly, a simulated one like it, and their envelope spectra."""
    case = result.case
    made, _ = simulate(result.trainings[0].job, case.known)
    seen = int(np.flatnonzero(~case.later)[-1])
    rpm, known = case.judged.speed_rpm[seen], case.known
    # The simulated record at that speed, where there is any, whose peak to peak is nearest.
    same = np.flatnonzero(made.speed_rpm == rpm)
    same = same if same.size else np.arange(len(made))
    heights = np.ptp(made.samples, axis=1)[same]
    near = int(same[np.argmin(np.abs(heights - np.ptp(case.judged.samples[seen].astype(float))))])
    fault_hz = known.bearing.fault_order(known.fault) * rpm / 60
    line = f"{LINE_NAMES[known.fault]} = {fault_hz:.1f} Hz"
    figure, panels = subplots((12, 6.4), 2, 2, sharex="col")
    for row, (name, x, colour) in enumerate((
        (f"record of the {data}", case.judged.samples[seen].astype(float), MEASURED),
        (f"simulated by the {result.variant} twin", made.samples[near].astype(float), SIMULATED),
    )):  # fmt: skip
        t = np.arange(x.size) / known.fs_hz
        show = t < 0.1
        panels[row, 0].plot(1000 * t[show], x[show], color=colour, lw=0.6)
        panels[row, 0].set(ylabel=f"acceleration ({known.unit})", title=name)
        spectrum = squared_envelope_spectrum(x, known.fs_hz)
        low = spectrum.frequency < 5.5 * fault_hz
        for k in range(1, 6):
            label = f"{line}, and harmonics" if k == 1 else None
            panels[row, 1].axvline(k * fault_hz, color="0.4", ls=":", lw=1.4, label=label)
        panels[row, 1].plot(spectrum.frequency[low], spectrum.values[low], color=colour, lw=0.8)
        panels[row, 1].set(ylabel="modulation depth (no unit)", title="squared envelope spectrum")
        panels[row, 1].legend(loc="upper right")
    panels[1, 0].set_xlabel("time (ms)")
    panels[1, 1].set_xlabel("frequency (Hz)")
    figure.suptitle(f"{case.name} at {rpm:.0f} rpm")
    return figure


def embedding(result: CaseResult, data: str) -> Figure:
    """Figure 13: t-SNE of the regressor's second layer, first seed: colour is speed, size remaining life."""
    found = {t.job.model: t.value["embedding"] for t in result.trainings if "embedding" in t.value}
    case = result.case
    # Three across at most, here and below, so that they can be read at half size.
    figure, panels = grid(len(found), 3, (4.6, 4.4), (1, 0.4))
    for panel, (model, embedded) in zip(panels.flat, found.items(), strict=False):
        size = 12 + 200 * case.true_min / case.true_min.max()
        looks = {"cmap": "cividis", "alpha": 0.8, "edgecolors": "0.3", "linewidths": 0.4}
        image = panel.scatter(*np.asarray(embedded).T, s=size, c=case.judged.speed_rpm, **looks)
        panel.set(title=model, xticks=[], yticks=[])
    figure.colorbar(image, ax=panels, label="speed (rpm)")
    longest = f"{case.true_min.max():.0f} min"
    return _titled(figure, result, f"{data}: t-SNE of 32 features; size: remaining time, up to {longest}")


def predicted(result: CaseResult, data: str) -> Figure:
    """Figure 14: remaining time over the run by each model: mean over seeds and their range; speed below."""
    case, models = result.case, result.models
    at = (case.known.twin.onset_row + case.judged.position) * case.run.dt_s / 60
    across = min(len(models), 3)
    down = -(-len(models) // across)
    size, ratios = (4.8 * across, 5.2 * down + 0.8), [3, 1] * down
    figure, panels = subplots(size, 2 * down, across, sharex=True, squeeze=False, height_ratios=ratios)
    lives, speeds = (panels.reshape(down, 2, across)[:, line].ravel() for line in (0, 1))
    for unused in (*lives[len(models) :], *speeds[len(models) :]):
        unused.set_axis_off()
    now = case.known.twin.now_row * case.run.dt_s / 60
    for panel, below, model in zip(lives, speeds, models, strict=False):
        each = np.array([result.predicted_min(t) for t in result.of(model)])
        panel.plot(at, case.true_min, color=TRUE, lw=1.4, label="true")
        panel.fill_between(at, each.min(axis=0), each.max(axis=0), color=COLOURS[model], alpha=0.3, lw=0)
        panel.plot(at, each.mean(axis=0), color=COLOURS[model], lw=1.4, label="predicted: mean and range of seeds")
        panel.plot(at, case.minutes(case.mean_of_lives()), color=COLOURS[LIVES], lw=1, ls="--", label=LIVES)
        panel.axvline(now, color="0.5", ls=":", label="now: later records were never seen")
        error = np.mean([rmse(case.true_min, e) for e in each])
        panel.set_title(f"{model}: RMSE {error:.1f} min")
        below.step(at, case.judged.speed_rpm, color="0.3", lw=0.9, where="mid")
        below.tick_params(labelbottom=True)
        below.set_xlabel("time (min)")
    for line in (lives, speeds):
        for panel in line[1 : len(models)]:
            panel.sharey(line[0])
        line[0].autoscale()
    for left in range(0, len(models), across):
        lives[left].set_ylabel("remaining time at\nthe present speed (min)")
        speeds[left].set_ylabel("speed (rpm)")
    figure.legend(*lives[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return _titled(figure, result, data)


def table5(errors: pd.DataFrame) -> Figure:
    """Table 5 as a figure: mean RMSE by run and model in numbers, 95 % intervals over seeds, the paper's beside."""
    models = [m for m in dict.fromkeys(errors["model"]) if m != LIVES]
    bearings = list(dict.fromkeys(errors["bearing"]))
    figure, panels = grid(len(bearings), 3, (4.6, 3.0), (1.6, 1.3), sharex=True, sharey=True)
    errors = errors.reindex(columns=[*dict.fromkeys([*errors.columns, "low_95", "high_95", "published_min"])])
    highest = float(errors[["rmse_min", "high_95"]].max().max())
    for panel, bearing in zip(panels.flat, bearings, strict=False):
        own = errors[errors["bearing"] == bearing].set_index("model")
        for place, model in enumerate(models):
            row = own.loc[model]
            if np.isfinite(row["low_95"]):
                panel.plot([max(row["low_95"], 0), row["high_95"]], [place] * 2, color=COLOURS[model], lw=4, alpha=0.5)
            panel.plot(row["rmse_min"], place, MARKERS[model], color=COLOURS[model], mec="k", mew=0.6, ms=9)
            panel.text(1.09 * highest, place, f"{row['rmse_min']:.1f}", ha="left", va="center", fontsize=11)
            panel.plot(row["published_min"], place, "x", color="k", ms=7, mew=1.6)
        panel.axvline(own.loc[LIVES, "rmse_min"], color=COLOURS[LIVES], ls="--", lw=1.4)
        panel.set_yticks(range(len(models)), models)
        panel.set(title=bearing, ylim=(len(models) - 0.5, -0.5), xlim=(0, 1.25 * highest))
        rule(panel, "x")
    for panel in panels[-1]:
        panel.set_xlabel("RMSE of remaining time (min)")
    mean = "mean of seeds (number), 95 % interval (bar)"
    handles = [
        Line2D([], [], color="0.4", marker="o", mec="k", lw=4, alpha=0.8, label=mean),
        Line2D([], [], color="k", marker="x", ls="", ms=7, mew=1.6, label="paper, on its own set"),
        Line2D([], [], color=COLOURS[LIVES], ls="--", label=LIVES),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    figure.suptitle(f"{errors['data'].iloc[0]}; {errors['twin'].iloc[0]} twin")
    return figure
