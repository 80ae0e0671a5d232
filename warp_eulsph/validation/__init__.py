"""Cases with references that no run of this package made: exact solutions, published and independent figures."""

from .case import Case, cases

__all__ = ["Case", "cases"]
