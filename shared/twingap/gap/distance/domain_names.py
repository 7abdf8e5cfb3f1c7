"""Names of the domains in which a gap is measured, tested and localised, in the order of the feature vector."""

from __future__ import annotations

from typing import Literal

DomainName = Literal["frequency", "envelope_order", "order", "amplitude", "time", "condition"]
