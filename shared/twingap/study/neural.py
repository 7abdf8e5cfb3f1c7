"""Neural posterior estimation of the missing effects with the public library `sbi`: an optional rival.

examples: indicators of effects [24] + noise --> theta;  plain statistics --PCA--> x
q(theta | x), masked autoregressive flow trained once --samples--> P(effect is missing | x) --> Found

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

from twingap.records import Array
from twingap.study.rivals import Examples, Filled, Rival, named
from twingap.study.verdicts import Found

COMPONENTS: Final = 50
"""Principal components of the statistics; more keep more detail and need more training worlds."""
SAMPLES: Final = 1000
"""Posterior samples per world; more make probabilities less noisy."""
HALF_WIDTH: Final = 0.4
"""Half width of the uniform noise on the indicators 0 and 1, as flows model densities. Larger values blur the two."""


class NeuralPosterior(Rival):
    """Amortised neural posterior over the indicators of all effects jointly.

    A gap is claimed when more than half of the posterior samples contain an effect. The effects of marginal
    probability 0.5 or more are named, or else the most probable one. A claimed gap in which no effect reaches 0.5
    counts as "outside the catalogue".
    """

    name = "sbi, neural posterior"

    def __init__(self, epochs: int = 200) -> None:
        self.epochs = epochs

    def skip(self) -> str | None:
        """Reason to skip: `sbi` is not installed; None when it is."""
        if importlib.util.find_spec("sbi") is None:
            return "sbi is not installed: pip install 'twingap[study]'"
        return None

    def fit(self, examples: Examples, rng: np.random.Generator) -> None:
        """Train the posterior in one round."""
        import torch
        from sklearn.decomposition import PCA

        self.effects, self.fill = examples.effects, Filled(examples.x)
        ready = self.fill(examples.x)
        self.components = PCA(min(COMPONENTS, *ready.shape), random_state=0).fit(ready)
        noise = rng.uniform(-HALF_WIDTH, HALF_WIDTH, examples.present.shape)
        theta = torch.as_tensor(examples.present + noise, dtype=torch.float32)
        x = self._input(examples.x)
        # sbi prints its progress; standard output is reserved for results.
        with _seeded(int(rng.integers(2**31))), warnings.catch_warnings(), redirect_stdout(io.StringIO()):
            warnings.simplefilter("ignore")
            logging.getLogger("arviz").setLevel(logging.ERROR)
            # Optional dependency: imported by name, so that neither this module nor its type check requires it.
            sbi: Any = importlib.import_module("sbi.inference")
            box: Any = importlib.import_module("sbi.utils").BoxUniform

            prior = box(torch.full(theta.shape[1:], -HALF_WIDTH), torch.full(theta.shape[1:], 1 + HALF_WIDTH))
            inference = sbi.NPE(prior=prior, density_estimator="maf", show_progress_bars=False, tracker=_Untracked())
            self.density: Any = inference.append_simulations(theta, x).train(
                max_num_epochs=self.epochs, show_train_summary=False
            )
        self.seed = int(rng.integers(2**31))

    def predict(self, x: Array) -> list[Found]:
        """Effects named for each world from samples of the posterior."""
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
    """A tracker for sbi that discards everything; sbi's default writes TensorBoard logs into the working folder."""

    log_dir: str | None = None

    def log_metric(self, name: str, value: float, step: int | None = None) -> None: ...
    def log_metrics(self, metrics: dict[str, float], step: int | None = None) -> None: ...
    def log_params(self, params: dict[str, Any]) -> None: ...
    def add_figure(self, name: str, figure: Any, step: int | None = None) -> None: ...
    def flush(self) -> None: ...


@contextmanager
def _seeded(seed: int) -> Iterator[None]:
    """Seed torch's global generator within the block and restore its state afterwards."""
    import torch

    state = torch.get_rng_state()
    torch.manual_seed(seed)
    try:
        yield
    finally:
        torch.set_rng_state(state)
