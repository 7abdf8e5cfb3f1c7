"""An Inception-style network for small images, trained on simulated ones.

Each block has the four branches of Szegedy et al. 2015 (DOI 10.1109/CVPR.2015.7298594): 1x1; 1x1 then 3x3; 1x1 then
5x5, made of two 3x3 as in Inception V3 (DOI 10.1109/CVPR.2016.308), which paper 2 names; pooling then 1x1. The 1x1
bottlenecks keep it small. V3 itself expects 299 x 299 photographs and 24 million weights; a twin's images are 16 x 96.
Carriers are pooled away in the end, since resonances lie elsewhere on every machine; orders keep their places.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor, nn

from papers.paper2_digital_twin.methods.scalograms import Images
from twingap.adapt.selection import Evidence
from twingap.adapt.training import Labels, Outputs, State, reproducible


class InceptionBlock(nn.Module):
    """Four branches of so much width side by side, joined and normalised: 4 `width` channels."""

    def __init__(self, channels: int, width: int) -> None:
        super().__init__()
        self.point = nn.Conv2d(channels, width, 1)
        self.small = nn.Sequential(nn.Conv2d(channels, width, 1), nn.ReLU(), nn.Conv2d(width, width, 3, padding=1))
        self.large = nn.Sequential(
            nn.Conv2d(channels, width, 1), nn.ReLU(),
            nn.Conv2d(width, width, 3, padding=1), nn.ReLU(),
            nn.Conv2d(width, width, 3, padding=1),
        )  # fmt: skip
        self.pooled = nn.Sequential(nn.MaxPool2d(3, stride=1, padding=1), nn.Conv2d(channels, width, 1))
        self.norm = nn.GroupNorm(4, 4 * width)

    def forward(self, x: Tensor) -> Tensor:
        """[batch, channels, rows, columns] -> [batch, 4 width, rows, columns]."""
        branches = (self.point(x), self.small(x), self.large(x), self.pooled(x))
        joined: Tensor = torch.relu(self.norm(torch.cat(branches, dim=1)))
        return joined


class InceptionNet(nn.Module):
    """Stem, three blocks, one linear classifier; normalised by groups of channels within an image. `shape` is channels,
    carriers (8 or more), orders (16 or more); `width` that of the first block's branches, later ones have twice as
    much."""

    def __init__(self, shape: tuple[int, int, int], n_classes: int, width: int = 6) -> None:
        super().__init__()
        channels, rows, columns = shape
        if rows < 8 or columns < 16:
            raise ValueError(f"images of {rows} x {columns}, at least 8 x 16 expected")
        self.stem = nn.Sequential(
            nn.Conv2d(channels, 16, (3, 5), stride=2, padding=(1, 2)), nn.GroupNorm(4, 16), nn.ReLU()
        )
        self.first = InceptionBlock(16, width)
        self.second = InceptionBlock(4 * width, 2 * width)
        self.third = InceptionBlock(8 * width, 2 * width)
        self.shrink = nn.MaxPool2d(2)
        left = ((columns + 1) // 2) // 4
        self.classifier = nn.Sequential(nn.Dropout(0.3), nn.Linear(2 * 8 * width * left, n_classes))

    def forward(self, x: Tensor) -> Tensor:
        """Logits [batch, classes]."""
        x = self.third(self.shrink(self.second(self.shrink(self.first(self.stem(x))))))
        x = torch.cat((x.mean(dim=2), x.amax(dim=2)), dim=1).flatten(1)
        logits: Tensor = self.classifier(x)
        return logits


@dataclass(frozen=True)
class InceptionTraining:
    steps: int = 400
    batch: int = 64
    learning_rate: float = 2e-3  # learning_rate, weight_decay: of AdamW
    weight_decay: float = 1e-3
    checkpoints: int = 5  # states kept for selection, evenly spaced over the second half of training and its end
    width: int = 6  # of the network


def train_inception(
    source: Images, labels: Labels, n_classes: int, settings: InceptionTraining, seed: int
) -> list[State]:
    """Train on labelled (simulated) images: weights at the checkpoints; same seed, same bytes. Carriers are moved by up
    to two rows and the level is varied: where a resonance lies and how loud a mounting is must not matter."""
    with reproducible(seed):
        net = InceptionNet(source.shape[1:], n_classes, settings.width)
        optimiser = torch.optim.AdamW(net.parameters(), lr=settings.learning_rate, weight_decay=settings.weight_decay)
        schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, settings.learning_rate, settings.steps)
        x, y = torch.from_numpy(source), torch.from_numpy(labels)
        rng, loss = np.random.default_rng([seed, 7]), nn.CrossEntropyLoss(label_smoothing=0.05)
        half = settings.steps // 2
        marks = {
            half + round((i + 1) * (settings.steps - half) / settings.checkpoints) for i in range(settings.checkpoints)
        }
        kept: list[State] = []
        for step in range(1, settings.steps + 1):
            chosen = torch.from_numpy(rng.integers(len(x), size=settings.batch))
            optimiser.zero_grad()
            loss(net(_varied(x[chosen], rng)), y[chosen]).backward()
            optimiser.step()
            schedule.step()
            if step in marks:
                kept.append({name: value.clone() for name, value in net.state_dict().items()})
    return kept


def _varied(x: Tensor, rng: np.random.Generator) -> Tensor:
    x = torch.roll(x, int(rng.integers(-2, 3)), dims=2).clone()
    x[:, 2] += torch.from_numpy(rng.normal(0, 0.1, (len(x), 1, 1)).astype(np.float32))
    return x


def evidence(
    states: Sequence[State], source: Images, labels: Labels, target: Images, n_classes: int, settings: InceptionTraining
) -> list[Evidence]:
    """What label-free criteria look at, per checkpoint: held-out simulated images and unlabelled measured ones."""
    own = n_classes, settings
    return [Evidence(outputs(s, source, *own), labels, outputs(s, target, *own)) for s in states]


def outputs(state: State, x: Images, n_classes: int, settings: InceptionTraining) -> Outputs:
    """Logits [images, classes]; no features."""
    net = InceptionNet(x.shape[1:], n_classes, settings.width)
    net.load_state_dict(state)
    net.eval()
    with reproducible(0), torch.no_grad():
        logits = torch.cat([net(torch.from_numpy(x[i : i + 256])) for i in range(0, len(x), 256)])
    return Outputs(logits.numpy(), np.zeros((len(x), 0), dtype=np.float32))
