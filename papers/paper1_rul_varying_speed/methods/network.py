"""Network that predicts remaining life from a record, its speed and its place in the run; plain or adversarial.

Which of the encodings and whether the discriminator take part are options of one network, so that two models differ in
nothing else. Source: section 3.7, tables 1, 2 and 4 of paper 1.
"""

import torch
from torch import Tensor, nn

from papers.paper1_rul_varying_speed.methods.architecture import LifeArchitecture
from twingap import TwingapError
from twingap.adapt.dann import reverse_gradient


class LifeNetwork(nn.Module):
    """Feature extractor, regressor and (adversarial only) discriminator of paper 1: 25,000 samples -> 4 x 1555 -> 4 x
    194 -> 16 x 60 -> 16 x 7 = 112 features. The regressor ends in a ReLU, as printed; its bias begins at 0.5, the
    middle of the labels, since a unit that is 0 for all records learns nothing more. Raises `TwingapError` for records
    without a feature."""

    def __init__(self, architecture: LifeArchitecture | None = None) -> None:
        super().__init__()
        own = architecture or LifeArchitecture()
        if own.features < 1:
            raise TwingapError(
                f"{own.length} samples leave no feature", where="network", mend="give longer records or smaller strides"
            )
        self.architecture = own
        (first, second), (wide, narrow), (stride, step), pools = own.filters, own.kernels, own.strides, own.pools
        self.extractor = nn.Sequential(
            nn.Conv1d(1, first, wide, stride), nn.ReLU(), nn.MaxPool1d(pools[0]),
            nn.Conv1d(first, second, narrow, step), nn.ReLU(), nn.MaxPool1d(pools[1]), nn.Flatten(),
        )  # fmt: skip

        def hidden() -> tuple[nn.Module, ...]:
            return nn.Linear(own.joined, 64), nn.ReLU(), nn.Linear(64, 32), nn.ReLU()

        # The layer of 32 that figure 13 shows is the end of `hidden`.
        self.hidden = nn.Sequential(*hidden())
        self.output = nn.Linear(32, 1)
        nn.init.constant_(self.output.bias, 0.5)
        self.discriminator = nn.Sequential(*hidden(), nn.Linear(32, 1)) if own.adversarial else None

    def join(self, x: Tensor, sequence: Tensor | None = None, speed: Tensor | None = None) -> Tensor:
        """Features of records [batch, length] with the encodings [batch, d_model] that it takes behind them."""
        own = self.architecture
        if x.ndim != 2 or x.shape[1] != own.length:
            raise TwingapError(f"records of shape {tuple(x.shape)}, [batch, {own.length}] expected", where="network")
        parts = [self.extractor(x[:, None])]
        for wanted, name, value in ((own.sequence, "sequence", sequence), (own.speed, "speed", speed)):
            if not wanted:
                continue
            if value is None or value.shape != (x.shape[0], own.d_model):
                shape = None if value is None else tuple(value.shape)
                raise TwingapError(f"{name} encoding {shape}, {(x.shape[0], own.d_model)} expected", where="network")
            parts.append(value)
        return torch.cat(parts, dim=1)

    def embed(self, joined: Tensor) -> Tensor:
        """The regressor's second layer [batch, 32], which figure 13 shows."""
        out: Tensor = self.hidden(joined)
        return out

    def life(self, joined: Tensor) -> Tensor:
        """Remaining life [batch], at least 0, in the unit of the labels."""
        return torch.relu(self.output(self.hidden(joined)).squeeze(1))

    def domain(self, joined: Tensor) -> Tensor:
        """Logits [batch] of "this is a real record", behind the gradient reversal; table 2's sigmoid is in the loss."""
        if self.discriminator is None:
            raise TwingapError("this network has no discriminator", where="network", mend="choose an adversarial model")
        logits: Tensor = self.discriminator(reverse_gradient(joined, self.architecture.reversal)).squeeze(1)
        return logits

    def forward(self, x: Tensor, sequence: Tensor | None = None, speed: Tensor | None = None) -> Tensor:
        """Remaining life [batch] of records [batch, length]."""
        return self.life(self.join(x, sequence, speed))
