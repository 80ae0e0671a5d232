"""What objects show of themselves: a few rows of names and values, as text and as HTML for notebooks."""

from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np

Rows = Sequence[tuple[str, str]]


def as_text(title: str, rows: Rows) -> str:
    """A title and rows of two columns, one line each."""
    width = max(len(name) for name, _ in rows)
    return "\n".join([title, *(f"  {name:<{width}}  {value}" for name, value in rows)])


def as_html(title: str, rows: Rows) -> str:
    """The same as a table."""
    lines = "".join(f"<tr><th style='text-align:left'>{escape(a)}</th><td>{escape(b)}</td></tr>" for a, b in rows)
    return f"<table><caption>{escape(title)}</caption>{lines}</table>"


def extent(x: np.ndarray) -> str:
    """Least and largest coordinates of positions (n, dim) [m]: ``0 … 1 × 0 … 6 m``."""
    sides = zip(x.min(axis=0), x.max(axis=0), strict=True)
    return " × ".join(f"{low:.4g} … {high:.4g}" for low, high in sides) + " m"


def least_to_largest(values: Any, unit: str) -> str:
    """A number, or least and largest where they differ by more than round-off."""
    low, high = float(np.min(values)), float(np.max(values))
    if high - low <= 1e-9 * max(abs(low), abs(high)):
        return f"{low:.6g} {unit}"
    return f"{low:.4g} … {high:.4g} {unit}"


def mass_unit(dim: int) -> str:
    """Of a body's mass: per metre of depth in 2-D, per square metre in 1-D."""
    return {1: "kg/m²", 2: "kg/m", 3: "kg"}[dim]
