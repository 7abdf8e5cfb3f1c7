"""The contact twin on a GPU: the same records as on the CPU, within rounding.

A GPU fuses multiplications with additions, and its power function is its own: a few units in the last place, which
damping keeps from growing. A kernel for the CPU that is compiled to fuse too changes records of two seconds by 7e-11 of
their RMS, and by 3e-10 with the hard edge of the papers. `ROUNDING` leaves room for more; in numba's simulator nothing
differs.
"""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numba import config, cuda

from benchmarks.contact import prepared
from twingap.bearing import BEARINGS
from twingap.effects import make_effect
from twingap.errors import TwingapError
from twingap.records import Condition
from twingap.twins import ContactTwin, PhenomenologicalTwin, base, contact_dynamics, gpu
from twingap.twins.contact import PRESETS

ROUNDING = 0.0 if config.ENABLE_CUDASIM else 1e-8
FAULTS = ("healthy", "inner", "outer", "ball")
B6205 = BEARINGS["6205"]
SOFT = replace(PRESETS["physical"], stiffness=1e8, damping=3000.0, eccentricity_um=5.0, load_x_n=50.0, oversampling=4)
EFFECTS = ("speed_fluctuation", "slip_jitter", "second_resonance", "sensor_rolloff", "clipping")

on_gpu = pytest.mark.skipif(not cuda.is_available(), reason="there is no GPU that CUDA can use")


def conditions(count: int) -> list[Condition]:
    """Records of different faults, speeds, rates and lengths."""
    return [
        Condition(f"{i}", 1797.0 + 50 * i, (4000.0, 5000.0)[i // 3 % 2], 10 + 2 * i, FAULTS[i % 4])
        for i in range(count)
    ]


@on_gpu
def test_integrators_of_cylinders_and_hard_edges_agree() -> None:
    own = replace(SOFT, contact="line", edge=0.0)
    here, there = (prepared(own, 3, 20, 4, device)() for device in ("cpu", "cuda"))
    np.testing.assert_allclose(there, here, rtol=0, atol=ROUNDING * np.abs(here).max())


@on_gpu
def test_records_agree(monkeypatch: pytest.MonkeyPatch) -> None:
    """In batches, of which the first is too long to be integrated at once."""
    monkeypatch.setattr(base, "GPU_SAMPLES", 0)
    monkeypatch.setattr(contact_dynamics, "GPU_SAMPLES", 4000)
    monkeypatch.setattr(ContactTwin, "batch", 34)
    launched, run = [], gpu.integrate
    monkeypatch.setattr(gpu, "integrate", lambda state, *others: (launched.append(len(state)), run(state, *others)))
    wanted, twin = conditions(38), ContactTwin(B6205, SOFT, map(make_effect, EFFECTS))
    here, there = (list(twin.on(device).stream(wanted, np.random.default_rng(1))) for device in ("cpu", "cuda"))
    assert [record.condition for record in there] == wanted
    for a, b in zip(here, there, strict=True):
        np.testing.assert_allclose(b.samples, a.samples, rtol=0, atol=ROUNDING * a.samples.std())
    assert launched == [2, 2, 1]


@on_gpu
def test_its_failures_are_one_line_that_agree(monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise MemoryError("CUDA_ERROR_OUT_OF_MEMORY")

    monkeypatch.setattr(gpu.cuda, "device_array", full)
    with pytest.raises(TwingapError, match="device 'cuda': the GPU cannot be used: MemoryError: CUDA_ERROR_OUT_OF"):
        list(ContactTwin(B6205, SOFT).on("cuda").stream(conditions(1), np.random.default_rng(1)))


@pytest.mark.slow
@pytest.mark.skipif(config.ENABLE_CUDASIM, reason="this is the simulator")
def test_in_the_simulator() -> None:
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", str(Path(__file__)), "-k", "agree"]
    env = {**os.environ, "NUMBA_ENABLE_CUDASIM": "1"}
    done = subprocess.run(command, env=env, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0 and "3 passed" in done.stdout, done.stdout + done.stderr


@pytest.mark.skipif(cuda.is_available(), reason="there is a GPU")
def test_without_a_gpu_it_says_so() -> None:
    twin = ContactTwin(B6205)
    with pytest.raises(TwingapError, match="contact: there is no GPU that CUDA can use; it takes an NVIDIA"):
        twin.on("cuda")
    assert twin.device == "cpu"


def test_without_numba_cuda_it_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr("twingap.twins.gpu")
    monkeypatch.setitem(sys.modules, "twingap.twins.gpu", None)
    with pytest.raises(TwingapError, match=r"contact: numba has no CUDA: .*; pip install 'twingap\[gpu\]'"):
        ContactTwin(B6205).on("cuda")


def test_other_devices_and_other_twins_are_refused() -> None:
    with pytest.raises(TwingapError, match="unknown device 'tpu'; use cpu or cuda"):
        ContactTwin(B6205).on("tpu")
    with pytest.raises(TwingapError, match="only the integration of the contact twin runs on 'cuda'; leave the device"):
        PhenomenologicalTwin(B6205).on("cuda")


def test_batches_have_at_least_so_many_records_and_samples() -> None:
    five = [Condition(f"{i}", 1797.0, 800.0, 100 + 7 * i) for i in range(5)]
    assert [(start, len(batch)) for start, batch in base._batches(five, 2, 0)] == [(0, 2), (2, 2), (4, 1)]
    assert [(start, len(batch)) for start, batch in base._batches(five, 1, 300)] == [(0, 3), (3, 2)]
    assert [(start, len(batch)) for start, batch in base._batches([], 1, 0)] == []
    short = [replace(each, n_samples=1) for each in five]  # settling counts
    assert [(start, len(batch)) for start, batch in base._batches(short, 1, 300)] == [(0, 3), (3, 2)]
