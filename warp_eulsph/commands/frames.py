"""Which frames of a run a command takes."""

import sys


def chosen(count: int, text: str) -> list[int]:
    """Numbers of the frames that ``text`` names as Python does: ``-1``, ``0,5,10``, ``::2``, ``10:``.

    Raises:
        ValueError: not such a text, or no such frame.
    """
    every, picked = list(range(count)), []
    for part in text.split(","):
        try:
            if ":" in part:
                picked += every[slice(*(int(bound) if bound.strip() else None for bound in part.split(":")))]
            else:
                picked.append(every[int(part)])
        except (ValueError, TypeError, IndexError):
            raise ValueError(f"frames must be such as -1, 0,5,10 or ::2 of {count}, got {part!r}") from None
    if not picked:
        raise ValueError(f"frames {text!r} choose none of {count}")
    return picked


def complain(error: object) -> int:
    """Say what is wrong on standard error; the status 2."""
    print(f"warp-eulsph: {error}", file=sys.stderr)
    return 2
