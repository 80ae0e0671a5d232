"""Case files: a whole problem as TOML, checked before it runs.

``read_case`` gives a ``Case``, which builds a ``Simulation``, or a ``TransportCase``, which builds a ``Transport``; the
schema is made from the classes of the package.
"""

from .case import Case
from .reading import CaseError, json_schema, parse_case, read_case
from .transport import TransportCase

__all__ = ["Case", "CaseError", "TransportCase", "json_schema", "parse_case", "read_case"]
