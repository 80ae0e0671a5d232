"""Cases with references that no run of this package made: exact solutions, published and independent figures."""

from .case import Case, load, load_all, names

__all__ = ["Case", "load", "load_all", "names"]
