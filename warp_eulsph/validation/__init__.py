"""Cases with references that no run of this package made: exact solutions, published and independent figures."""

from .case import Case, cases, load, names

__all__ = ["Case", "cases", "load", "names"]
