"""Training steps of paper 3's methods, and where their time goes, block by block, on one thread."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.harness import Measurement, Target

MODES, SAMPLES, BATCH, CLASSES = 4, 2048, 64, 4
EPOCHS, WINDOWS = 25, 1500


def measure(quick: bool, seed: int = 0) -> Measurement:
    """Whole steps of each method (source batch of 64, target batch of 64), and single blocks, forward and backward."""
    import torch

    from twingap.adapt import METHODS, Training, reproducible, steps_of_epochs, train

    rounds, steps, batch = (1, 1, 4) if quick else (5, 4, BATCH)
    rng = np.random.default_rng(seed)
    x = rng.standard_normal((4 * batch, MODES, SAMPLES)).astype(np.float32)
    labels = np.arange(len(x)) % CLASSES
    settings = Training(steps=steps, batch=batch, checkpoints=1, vary=True)

    def training(name: str) -> Callable[[], object]:
        method = METHODS[name]
        return lambda: train(x, labels, x, method.alignment, settings, seed, CLASSES, "cpu", method.architecture)

    rows: list[dict[str, Any]] = []
    for name, method in METHODS.items():
        if method.architecture is not None:
            rows.append({"what": f"step, {name}", "ms": _cpu_ms(training(name), rounds) / steps})
    with reproducible(seed):
        for block, call in _blocks(torch.from_numpy(x[: 2 * batch])).items():
            rows.append({"what": f"block, {block}", "ms": _cpu_ms(call, rounds)})
    slowest = max(row["ms"] for row in rows if row["what"].startswith("step"))
    training_s = slowest * 1e-3 * steps_of_epochs(EPOCHS, WINDOWS, BATCH)
    return Measurement(
        f"batches of {batch} source and {batch} target windows, {MODES} modes of {SAMPLES} samples, one thread",
        rows,
        ()
        if quick
        else (Target("trainings a minute, slowest method, 25 epochs of 1500 windows", 60 / training_s, 1.0),),
        (
            "processor time, best of the rounds; blocks are timed alone on both batches together, forward and backward",
            f"a training: {EPOCHS} epochs of {WINDOWS} source windows, {steps_of_epochs(EPOCHS, WINDOWS, BATCH)} steps",
        ),
    )


def _cpu_ms(call: Callable[[], object], rounds: int) -> float:
    """Least processor time of a call, ms; one thread, so that what else the machine does counts for little."""
    call()
    taken = []
    for _ in range(rounds):
        begin = time.process_time()
        call()
        taken.append(time.process_time() - begin)
    return 1e3 * min(taken)


def _blocks(x: Any) -> dict[str, Callable[[], object]]:
    """Forward and backward of each block on an input of the shape that it gets."""
    import torch

    from twingap.adapt import Alignment, Architecture, ModeNetwork
    from twingap.adapt.alignment import Aligner, BatchOutputs
    from twingap.adapt.attention import TimeAttention

    network = ModeNetwork(Architecture(), SAMPLES, MODES, CLASSES)
    bare = ModeNetwork(Architecture(denoising=False, attention="none"), SAMPLES, MODES, CLASSES)
    denoising = network.extractor.get_submodule("denoising")
    with torch.no_grad():
        branched = denoising.get_submodule("branches")(x)
        fused = denoising.get_submodule("fusion")(branched)
        features = network.extractor(x)
    half = len(x) // 2
    labels = torch.arange(half) % CLASSES
    channels, length = fused.shape[1:]

    def both_ways(module: Callable[[Any], Any], given: Any, needs_input: bool = True) -> Callable[[], object]:
        leaf = given.detach().clone().requires_grad_(needs_input)
        return lambda: module(leaf).sum().backward()

    def aligned(alignment: Alignment) -> Callable[[Any], Any]:
        aligner = Aligner(alignment, CLASSES)

        def loss(f: Any) -> Any:
            logits = network.classifier(f)
            return aligner(BatchOutputs(f[:half], logits[:half]), labels, BatchOutputs(f[half:], logits[half:]), 0.5)[0]

        return loss

    return {
        "branches": both_ways(denoising.get_submodule("branches"), x, needs_input=False),
        "fusion": both_ways(denoising.get_submodule("fusion"), branched),
        "gate": both_ways(denoising.get_submodule("gate"), fused),
        "lift (in place of the three)": both_ways(bare.extractor.get_submodule("lift"), x, needs_input=False),
        "attention, cosine": both_ways(network.extractor.get_submodule("attention"), fused),
        "attention, time": both_ways(TimeAttention(channels, length, 64), fused),
        "feed-forward extractor": both_ways(network.extractor.get_submodule("feed_forward"), fused),
        "classifier": both_ways(network.classifier, features),
        "two discriminators": both_ways(aligned(Alignment(("features", "conditional"))), features),
        "discrepancy, domain": both_ways(aligned(Alignment(discrepancy="domain")), features),
        "discrepancy, category": both_ways(aligned(Alignment(discrepancy="category")), features),
    }
