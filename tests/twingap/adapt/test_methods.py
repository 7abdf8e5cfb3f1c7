"""The nine methods: one loop, seeds, no labels from the target, the cache of modes, judging."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from twingap.adapt import (
    CRITERIA,
    METHODS,
    Alignment,
    Architecture,
    Fitted,
    MethodOptions,
    ModeInputs,
    Training,
    Windows,
    fit,
    judge,
    steps_of_epochs,
)
from twingap.adapt.domain_adaptation import split
from twingap.adapt.mode_svm import mode_features, train_svm
from twingap.adapt.training import varied
from twingap.errors import TwingapError
from twingap.signal import vmd

INPUTS = ModeInputs(n_modes=2, max_iterations=40)
SMALL = Training(steps=6, batch=8, checkpoints=3, vary=True)
PAPER = ("VMD+SVM", "Non-DA", "MMD", "DANN", "DACD", "Base-Attn", "Non-DN", "Base-NDN", "Proposed")
NETWORKS = tuple(name for name in PAPER if name != "VMD+SVM")


def toy(n: int = 48, seed: int = 0, colour: float = 0.0, prefix: str = "s", groups: int = 8) -> Windows:
    """Two classes of bursts, at 6 and 11 a window; a foreign domain rings elsewhere."""
    rng = np.random.default_rng(seed)
    labels = np.arange(n) % 2
    t = np.arange(256)
    x = 0.1 * rng.standard_normal((n, 256))
    for row, label in zip(x, labels, strict=True):
        for hit in np.arange(rng.integers(0, 20), 256, 256 / (11 if label else 6)):
            ring = np.exp(-(t - hit) / 6) * np.sin((1.9 + colour) * (t - hit))
            row += np.where(t >= hit, ring, 0.0)
    group = np.array([f"{prefix}{label}-{i // 2 % groups}" for i, label in enumerate(labels)])
    return Windows(x, np.full(n, 12_000.0), np.full(n, 1800.0), group, labels.astype(np.int64))


SOURCE, TARGET = toy(), toy(24, 1, 0.4, "t", 3)
UNLABELLED = TARGET.unlabelled()


def fitted(method: str | MethodOptions, seed: int = 0, settings: Training = SMALL) -> Fitted:
    return fit(method, SOURCE, UNLABELLED, seed, n_classes=2, settings=settings, inputs=INPUTS, device="cpu")


def same(one: Fitted, two: Fitted) -> bool:
    assert one.trained is not None and two.trained is not None
    return all(
        torch.equal(a.state[name], b.state[name])
        for a, b in zip(one.trained.checkpoints, two.trained.checkpoints, strict=True)
        for name in a.state
    )


# -- the table --------------------------------------------------------------------------------------------------------


def test_the_table_holds_the_papers_methods_and_changes_what_the_names_say() -> None:
    assert tuple(METHODS) == PAPER
    proposed = METHODS["Proposed"]
    assert proposed.architecture is not None and METHODS["VMD+SVM"].architecture is None
    assert METHODS["Non-DA"] == MethodOptions("Non-DA", proposed.architecture, Alignment())
    assert METHODS["Base-Attn"].architecture == replace(proposed.architecture, attention="time")
    assert METHODS["Non-DN"].architecture == replace(proposed.architecture, denoising=False)
    assert METHODS["Base-NDN"].architecture == replace(proposed.architecture, denoising=False, attention="time")
    for name in ("Base-Attn", "Non-DN", "Base-NDN"):
        assert METHODS[name].alignment == proposed.alignment, "ablations adapt as the proposed method does"
    assert len(proposed.alignment.discriminators) == 2
    rivals = [METHODS[name] for name in ("MMD", "DANN", "DACD")]
    assert len({m.architecture for m in rivals}) == 1, "rivals differ in their alignment alone"
    assert len({m.alignment for m in rivals}) == 3
    assert replace(METHODS["DACD"].alignment, discrepancy="none") == METHODS["DANN"].alignment


@pytest.mark.parametrize("name", NETWORKS)
def test_without_weight_an_alignment_changes_not_a_bit(name: str) -> None:
    options = METHODS[name]
    plain = fitted(replace(options, alignment=Alignment()))
    idle = fitted(replace(options, alignment=replace(options.alignment, weight=0.0)))
    assert same(plain, idle)
    if options.alignment.active:
        assert not same(plain, fitted(options)), "with its weight it does"


def test_target_windows_do_not_matter_without_an_alignment() -> None:
    other = replace(UNLABELLED, samples=UNLABELLED.samples[::-1].copy())
    again = fit("Non-DA", SOURCE, other, 0, n_classes=2, settings=SMALL, inputs=INPUTS, device="cpu")
    assert same(fitted("Non-DA"), again)


# -- seeds ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["Proposed", "DACD", "Base-NDN"])
def test_same_seed_same_bytes(name: str) -> None:
    one, two, other = fitted(name, 1), fitted(name, 1), fitted(name, 2)
    assert same(one, two) and not same(one, other)
    assert one.criteria == two.criteria and one.chosen == two.chosen
    assert np.array_equal(one.predict_proba(TARGET), two.predict_proba(TARGET))


def test_the_machine_has_no_seed() -> None:
    one, two = fitted("VMD+SVM", 1), fitted("VMD+SVM", 2)
    assert np.array_equal(one.predict_proba(TARGET), two.predict_proba(TARGET))
    assert one.history == [] and one.checkpoints == 1 and one.place == 0


# -- labels -----------------------------------------------------------------------------------------------------------


def test_target_labels_are_refused_and_inputs_do_not_read_any() -> None:
    with pytest.raises(TwingapError, match="adaptation have labels"):
        fit("Non-DA", SOURCE, TARGET, 0, n_classes=2)
    with pytest.raises(TwingapError, match="source windows have no labels"):
        fit("Non-DA", SOURCE.unlabelled(), UNLABELLED, 0, n_classes=2)
    with pytest.raises(TwingapError, match="unknown method 'Best'"):
        fit("Best", SOURCE, UNLABELLED, 0, n_classes=2)
    with pytest.raises(TwingapError, match="unknown criterion"):
        fit("Non-DA", SOURCE, UNLABELLED, 0, n_classes=2, criterion="target_accuracy")
    with pytest.raises(TwingapError, match="the evaluation have no labels"):
        judge(fitted("VMD+SVM"), UNLABELLED)
    assert np.array_equal(INPUTS(TARGET), INPUTS(UNLABELLED))


def test_what_the_network_cannot_take_is_refused_in_words() -> None:
    spectra = replace(INPUTS, quantity="envelope_spectrum")
    with pytest.raises(TwingapError, match="vary = false"):
        fit("Non-DA", SOURCE, UNLABELLED, 0, n_classes=2, settings=SMALL, inputs=spectra)
    plain = replace(SMALL, vary=False)
    done = fit("Non-DA", SOURCE, UNLABELLED, 0, n_classes=2, settings=plain, inputs=spectra, device="cpu")
    assert done.predict_proba(UNLABELLED).shape == (24, 2)
    short = replace(SOURCE, samples=SOURCE.samples[:, :250])
    with pytest.raises(TwingapError, match="250 points per channel, a multiple of 32 and at least 256"):
        fit("Non-DA", short, UNLABELLED, 0, n_classes=2, settings=SMALL, inputs=INPUTS)


def test_held_out_groups_are_not_trained_on() -> None:
    """Windows of held-out groups can be anything: the weights stay."""
    assert SOURCE.labels is not None
    part, held = split(SOURCE.labels, SOURCE.group, 0.25, 0)
    assert not set(SOURCE.group[part]) & set(SOURCE.group[held]) and len(part) + len(held) == len(SOURCE)
    samples = SOURCE.samples.copy()
    samples[held] = np.random.default_rng(9).standard_normal((len(held), 256))
    altered = replace(SOURCE, samples=samples)
    again = fit("Proposed", altered, UNLABELLED, 0, n_classes=2, settings=SMALL, inputs=INPUTS, device="cpu")
    assert same(fitted("Proposed"), again)


# -- end to end -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", PAPER)
def test_every_method_predicts_embeds_and_is_judged(name: str) -> None:
    done = fitted(name)
    p, features = done.predict_proba(TARGET), done.embed(TARGET)
    assert p.shape == (24, 2) and np.allclose(p.sum(axis=1), 1) and (p >= 0).all()
    assert len(features) == 24 and np.isfinite(features).all()
    judged = judge(done, TARGET)
    assert np.array_equal(judged.probabilities, p)
    assert judged.accuracy == np.mean(p.argmax(axis=1) == TARGET.labels)
    assert judged.oracle_accuracy == max(judged.accuracy_by_checkpoint) >= judged.accuracy
    assert len(judged.accuracy_by_checkpoint) == done.checkpoints
    if name != "VMD+SVM":
        assert set(judged.accuracy_by_criterion) == set(CRITERIA) and [h["step"] for h in done.history] == [2, 4, 6]
        adversarial = bool(METHODS[name].alignment.discriminators)
        assert np.isfinite([h["domain_accuracy"] for h in done.history]).all() == adversarial
    assert judged.plain()["confusion"].sum() == 24


@pytest.mark.parametrize("name", ["MMD", "DACD", "Proposed"])
def test_methods_learn_and_alignment_does_not_collapse_the_classes(name: str) -> None:
    longer = Training(steps=60, batch=16, checkpoints=2, vary=True)
    alike = toy(24, 1, 0.0, "t", 3)
    done = fit(name, SOURCE, alike.unlabelled(), 0, n_classes=2, settings=longer, inputs=INPUTS, device="cpu")
    assert judge(done, alike).accuracy > 0.9


def test_steps_of_epochs() -> None:
    assert steps_of_epochs(25, 1500, 64) == 586 and steps_of_epochs(1, 3, 64) == 1


# -- inputs -----------------------------------------------------------------------------------------------------------


def test_modes_are_those_of_the_unit_window_by_frequency() -> None:
    modes = ModeInputs(n_modes=3)(TARGET)
    x = TARGET.samples[5] - TARGET.samples[5].mean()
    assert modes.shape == (24, 3, 256) and modes.dtype == np.float32
    np.testing.assert_allclose(modes[5], vmd(x / x.std(), 3).in_order().values, atol=1e-6)
    centre = np.array([np.argmax(np.abs(np.fft.rfft(m))) for m in modes[5]])
    assert (np.diff(centre) > 0).all()
    louder = replace(TARGET, samples=40 * TARGET.samples + 3)
    np.testing.assert_allclose(ModeInputs(n_modes=3)(louder), modes, atol=1e-5)


@pytest.mark.parametrize(
    ("quantity", "points"), [("modes", 256), ("envelope", 256), ("envelope_spectrum", 512), ("waveform", 256)]
)
def test_quantities_of_modes(quantity: str, points: int) -> None:
    x = replace(INPUTS, quantity=quantity)(TARGET)
    assert x.shape == (24, 2, points) and x.dtype == np.float32 and np.isfinite(x).all()
    if quantity in ("envelope", "waveform"):
        np.testing.assert_allclose(x.mean(axis=2), 0, atol=1e-5)
        np.testing.assert_allclose(x.std(axis=2), 1, atol=1e-4)
    with pytest.raises(TwingapError, match="unknown quantity"):
        ModeInputs(quantity="smell")


def test_the_cache_is_keyed_by_content_and_survives_damage(tmp_path: Path) -> None:
    kept, fresh = replace(INPUTS, cache=tmp_path / "modes"), INPUTS
    first = kept(TARGET)
    (path,) = (tmp_path / "modes").iterdir()
    assert np.array_equal(first, fresh(TARGET))
    marked = first.copy()
    marked[0] = 7.0
    np.save(path, marked)
    assert np.array_equal(kept(replace(TARGET, labels=None)), marked), "read, whatever the labels"
    path.write_bytes(path.read_bytes()[:200])
    assert np.array_equal(kept(TARGET), first), "a damaged file is computed again"
    assert np.array_equal(np.load(path), first)
    keys = {
        kept.key(TARGET),
        kept.key(TARGET.take(np.arange(23))),
        kept.key(replace(TARGET, samples=TARGET.samples + 1e-9)),
        replace(kept, alpha=1999.0).key(TARGET),
        replace(kept, n_modes=3).key(TARGET),
        replace(kept, tol=1e-6).key(TARGET),
        replace(kept, max_iterations=41).key(TARGET),
    }
    assert len(keys) == 7
    assert replace(kept, quantity="envelope").key(TARGET) == kept.key(TARGET), "one set of modes serves all quantities"


def test_variations_shift_and_flip_whole_samples() -> None:
    x = torch.arange(2 * 3 * 8, dtype=torch.float32).reshape(2, 3, 8) + 1
    seen = set()
    for draw in range(40):
        y = varied(x, np.random.default_rng(draw))
        for one, other in zip(x, y, strict=True):
            matches = [
                (shift, sign)
                for shift in range(8)
                for sign in (-1, 1)
                if torch.equal(other, sign * torch.roll(one, -shift, 1))
            ]
            assert len(matches) == 1
            seen |= set(matches)
    assert len(seen) == 16


# -- support vector machine -------------------------------------------------------------------------------------------


def test_mode_features_are_free_of_unit_and_of_time_shift_for_a_tone() -> None:
    t = np.arange(256)
    tones = np.stack([np.sin(2 * np.pi * 16 / 256 * t), 0.5 * np.sin(2 * np.pi * 60 / 256 * t)])[None]
    found = mode_features(tones.astype(np.float32)).reshape(2, -1)
    np.testing.assert_allclose(found[:, 0], np.log([0.8, 0.2]), atol=1e-5)
    np.testing.assert_allclose(found[:, 1], [16 / 256, 60 / 256], atol=1e-5)
    np.testing.assert_allclose(found[:, 2], 1.5, atol=1e-2)  # kurtosis of a sine
    np.testing.assert_allclose(mode_features((9 * tones).astype(np.float32)).reshape(2, -1), found, atol=1e-4)
    assert np.isfinite(mode_features(np.zeros((1, 2, 64), dtype=np.float32))).all()


def test_the_machine_knows_classes_that_the_source_lacks() -> None:
    x = INPUTS(SOURCE)
    labels = SOURCE.labels
    assert labels is not None
    p = train_svm(x, 2 * labels, 4).probabilities(x)
    assert p.shape == (48, 4) and not p[:, [1, 3]].any() and np.allclose(p.sum(axis=1), 1)
    assert np.mean(p.argmax(axis=1) == 2 * labels) > 0.9


def test_an_architecture_of_ones_own() -> None:
    own = MethodOptions("own", Architecture(attention="mappings", maps=1, width=8), Alignment(("conditional",)))
    assert fitted(own).method == own
