"""Neural posterior estimation of which effects are missing, from the public library `sbi`: an optional rival.

examples: indicators of effects [24] + noise --> theta;  plain statistics --PCA--> x
q(theta | x) learnt once (masked autoregressive flow) --samples--> P(effect is missing | x) --> Found

M. Deistler et al., sbi reloaded: a toolkit for simulation-based inference workflows, J. Open Source Softw. 10 (2025)
7754, doi:10.21105/joss.07754; D. S. Greenberg, M. Nonnenmacher, J. H. Macke, Automatic posterior transformation for
likelihood-free inference, ICML 2019, arXiv:1905.07488.
"""

from __future__ import annotations

import importlib
import importlib.util
import io
import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from twingap.study.rivals import Examples, Filled, Rival, named
from twingap.study.verdicts import Found

Array = NDArray[np.float64]

COMPONENTS: Final = 50
SAMPLES: Final = 1000
HALF_WIDTH: Final = 0.4
"""Indicators 0 and 1 are spread evenly by this, since flows describe densities, not atoms."""


class NeuralPosterior(Rival):
    """Amortised neural posterior over the indicators of all effects together.

    A gap is claimed when more than half of the posterior's draws have an effect; the effects of marginal probability
    0.5 are named, or else the most probable one. "Outside" is read from a claimed gap of which no effect reaches 0.5.
    """

    name = "sbi, neural posterior"

    def __init__(self, epochs: int = 200) -> None:
        self.epochs = epochs

    def skip(self) -> str | None:
        """Whether `sbi` is missing."""
        if importlib.util.find_spec("sbi") is None:
            return "sbi is not installed: pip install 'twingap[study]'"
        return None

    def fit(self, examples: Examples, rng: np.random.Generator) -> None:
        """Learn the posterior in one round."""
        import torch
        from sklearn.decomposition import PCA

        self.effects, self.fill = examples.effects, Filled(examples.x)
        ready = self.fill(examples.x)
        self.components = PCA(min(COMPONENTS, *ready.shape), random_state=0).fit(ready)
        noise = rng.uniform(-HALF_WIDTH, HALF_WIDTH, examples.present.shape)
        theta = torch.as_tensor(examples.present + noise, dtype=torch.float32)
        x = self._input(examples.x)
        # sbi prints its progress; standard output belongs to results.
        with _seeded(int(rng.integers(2**31))), warnings.catch_warnings(), redirect_stdout(io.StringIO()):
            warnings.simplefilter("ignore")
            logging.getLogger("arviz").setLevel(logging.ERROR)
            # Optional: imported by name, so that neither this module nor its type check needs it.
            sbi: Any = importlib.import_module("sbi.inference")
            box: Any = importlib.import_module("sbi.utils").BoxUniform

            prior = box(torch.full(theta.shape[1:], -HALF_WIDTH), torch.full(theta.shape[1:], 1 + HALF_WIDTH))
            inference = sbi.NPE(prior=prior, density_estimator="maf", show_progress_bars=False, tracker=_Untracked())
            self.density: Any = inference.append_simulations(theta, x).train(
                max_num_epochs=self.epochs, show_train_summary=False
            )
        self.seed = int(rng.integers(2**31))

    def judge(self, x: Array) -> list[Found]:
        """From draws of the posterior."""
        import torch

        found = []
        with _seeded(self.seed), torch.no_grad():
            for row in self._input(x):
                draws = self.density.sample((SAMPLES,), condition=row[None])[:, 0].numpy() > 0.5
                p = draws.mean(axis=0)
                by_effect = dict(zip(self.effects, p.tolist(), strict=True))
                if draws.any(axis=1).mean() < 0.5:
                    found.append(Found("no_gap", probability=by_effect))
                    continue
                which = named(p, self.effects)
                status = "explained" if which else "unexplained"
                found.append(Found(status, which or (self.effects[int(p.argmax())],), probability=by_effect))
        return found

    def _input(self, x: Array) -> Any:
        import torch

        return torch.as_tensor(self.components.transform(self.fill(x)), dtype=torch.float32)


class _Untracked:
    """Where sbi may report its training: nowhere. Its own default writes TensorBoard logs into the working folder."""

    log_dir: str | None = None

    def log_metric(self, name: str, value: float, step: int | None = None) -> None:
        """Take no note."""

    def log_metrics(self, metrics: dict[str, float], step: int | None = None) -> None:
        """Take no note."""

    def log_params(self, params: dict[str, Any]) -> None:
        """Take no note."""

    def add_figure(self, name: str, figure: Any, step: int | None = None) -> None:
        """Take no note."""

    def flush(self) -> None:
        """Nothing waits."""


@contextmanager
def _seeded(seed: int) -> Iterator[None]:
    """Torch's global generator at a seed within the block, as it was after it."""
    import torch

    state = torch.get_rng_state()
    torch.manual_seed(seed)
    try:
        yield
    finally:
        torch.set_rng_state(state)
