"""Cases with references that no run of this package made: exact solutions, published and independent figures."""

from .case import Case, load, load_all, names
from .report import Figure, table

__all__ = ["Case", "Figure", "load", "load_all", "names", "table"]
