"""Arguments of a simulation: what cannot be meant is refused, what is seldom meant is said."""

import logging
from collections.abc import Sequence
from typing import Any

import numpy as np
import warp as wp

from .body import Body
from .boundaries import Assembly
from .checks import instance, positive, short
from .overlap import Encounters
from .scheme.arrangement import Arrangement
from .scheme.base import Scheme
from .scheme.policy import ReferencePolicy
from .scheme.time_step import TimeStep
from .weights import Weight

log = logging.getLogger(__name__)

# Rounding of positions in float32, in spacings, from which on it shows: steps move particles by a hundredth of one.
COARSE_POSITIONS = 1e-4


def check_options(
    reference: Any, arrangement: Any, scheme: Any, time_step: Any, weight: Any, dilation: Any, dtype: Any
) -> None:
    """ValueError unless these are what they should be, with what to write instead."""
    checked_dtype(dtype)
    instance(reference, ReferencePolicy, "reference", "Always()")
    instance(arrangement, Arrangement, "arrangement", "Convected()")
    if scheme is not None:
        instance(scheme, Scheme, "scheme", "Verlet()")
    instance(time_step, TimeStep, "time_step", "TimeStep(cfl=0.7)")
    if weight is not None:
        instance(weight, Weight, "weight", "CubicSpline()")
    if dilation is not None:
        positive(dilation, "dilation", "1.3 is the tested value")


def bound(option: Any, kind: type, assembly: Assembly) -> Any:
    """What a condition or an interaction is at work.

    Raises:
        ValueError: its ``bind`` returns no ``kind``.
    """
    who = f"what {type(option).__name__}.bind(assembly) returns"
    return instance(option.bind(assembly), kind, who, f"a {kind.__name__}, made of option and assembly")


def checked_dtype(given: Any) -> Any:
    """``wp.float64`` or ``wp.float32``.

    Raises:
        ValueError: neither; it names the one that was meant.
    """
    if given in (wp.float32, wp.float64):
        return given
    try:
        meant = {"float32": "wp.float32", "float64": "wp.float64"}.get(np.dtype(given).name)
    except (TypeError, ValueError):  # numpy's, of what is no type
        meant = None
    hint = f"; write dtype={meant}" if meant else ""
    raise ValueError(f"dtype must be wp.float32 or wp.float64, got {short(given)}{hint}")


def warn(bodies: Sequence[Body], encounters: Encounters, real: Any) -> None:
    """Log a warning for bodies that overlap or touch, and for positions that are too far for their precision.

    Args:
        bodies: of the simulation.
        encounters: of the bodies.
        real: ``wp.float32`` or ``wp.float64``.
    """
    X, spacing = (np.concatenate([getattr(body, name) for body in bodies]) for name in ("x", "spacing"))
    coarse = check_precision(X, spacing, real)
    for line in (*encounters.look(X, 0.0, 0), *([coarse] if coarse else [])):
        log.warning("%s", line)


def check_precision(X: np.ndarray, spacing: np.ndarray, real: type) -> str | None:
    """A warning where float32 is too coarse for positions X [m], (n, dim), because they are far from the origin."""
    far, across = float(np.abs(X).max()), float(np.ptp(X, axis=0).max())
    step = float(np.spacing(np.float32(far))) / float(spacing.min())
    if real is wp.float64 or step < COARSE_POSITIONS or far < 2.0 * across:
        return None
    return (
        f"in float32 positions as far as {far:.6g} m from the origin are rounded to {step:.2g} spacings, which spoils "
        "gradients; put the origin into the bodies, or use float64"
    )
