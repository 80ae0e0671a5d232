"""How an attack ends, and the errors by which it says that something went wrong."""

HELD, REFUSED = "held", "refused"
FAULTS = ("silent", "lost", "traceback")


class SilentError(AssertionError):
    """A wrong value, and nobody was told."""


class LostError(AssertionError):
    """What was whole is gone."""


def right(condition, what):
    """SilentError unless it holds."""
    if not condition:
        raise SilentError(what)
