"""Exact solution of the impacted bar, which is that of the validation case, by short names."""

from warp_eulsph.validation.cases.bar import DENSITY, LENGTH, SPEED, WAVE_SPEED, YOUNG
from warp_eulsph.validation.cases.bar import exact as bar_exact

__all__ = ["DENSITY", "LENGTH", "SPEED", "WAVE_SPEED", "YOUNG", "bar_exact"]
