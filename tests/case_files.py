"""Case files that tests share: those of the examples, and a small one."""

import json
from pathlib import Path

CASES = Path(__file__).parents[1] / "examples" / "cases"
FILES = sorted(CASES.glob("*.toml"))
SMALL = {
    "until": 0.1,
    "body": {
        "a": {
            "shape": {"kind": "box", "lower": [0, 0], "upper": [1, 1], "spacing": 0.25},
            "material": {"kind": "NeoHookean", "density": 1000, "young": 1e6, "poisson": 0.3},
        }
    },
}


def small(**changes):
    """The small case with other top-level entries."""
    return {**json.loads(json.dumps(SMALL)), **changes}
