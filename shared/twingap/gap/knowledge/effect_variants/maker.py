"""What makes another form of an effect."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from twingap.effects import Effect
from twingap.gap.knowledge.machines import Machine

Maker = Callable[[dict[str, Any], Machine, np.random.Generator], Effect | None]
"""Values of an effect, the machine that has it, chances -> another form of it; None where these values have none."""
