"""t-SNE of a network's features, for figures."""

from typing import Any

import numpy as np
from numpy.typing import NDArray


def embed(features: NDArray[Any], seed: int) -> NDArray[np.float32]:
    """t-SNE of features [records, features], standardised, in two dimensions [records, 2]."""
    from sklearn.manifold import TSNE

    scaled = (features - features.mean(axis=0)) / (features.std(axis=0) + 1e-6)
    perplexity = min(30.0, (len(features) - 1) / 3)
    return np.asarray(TSNE(perplexity=perplexity, init="pca", random_state=seed).fit_transform(scaled), np.float32)
