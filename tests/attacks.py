"""Attacks on what must be neither silent nor lost: ``python tests/attacks.py --seed 0 --count 900``.

Each attack is drawn at random from its class by a seed, which is printed where it goes wrong, to run it again. It ends
as *held*, the right value came out, or *refused*, an error that says what is wrong. Anything else is a fault:
*silent*, a wrong value that nobody was told; *lost*, data that were whole before; *traceback*, an error that nobody
meant. A table says how many of each there were; exit status 1 where there was a fault.
"""

import argparse
import collections
import contextlib
import io
import logging
import random
import sys
import tempfile
import traceback
from pathlib import Path

from attacks_on_input import mesh_file, values, wrong_type
from attacks_on_runs import changed_load, exception_in_a_step, interrupt, run_folder
from faults import FAULTS, HELD, REFUSED, LostError, SilentError

ATTACKS = {
    "exceptions at any launch of a step": (exception_in_a_step, 2),
    "Ctrl-C at any moment": (interrupt, 1),
    "regions and values, orders, shapes": (values, 2),
    "run folders damaged": (run_folder, 1),
    "loads changed before a resume": (changed_load, 1),
    "meshes written otherwise or spoilt": (mesh_file, 2),
    "wrong types": (wrong_type, 2),
}


def attacked(name, seed, folder):
    """One attack of a class: how it ended, and what is to be said where it is a fault."""
    attack, rng = ATTACKS[name][0], random.Random(f"{name} {seed}")
    said = io.StringIO()
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            outcome = attack(rng, folder)
        if "Traceback" in said.getvalue():
            return "traceback", said.getvalue()
        return outcome, ""
    except SilentError as error:
        return "silent", str(error)
    except LostError as error:
        return "lost", str(error)
    except Exception:
        return "traceback", traceback.format_exc()


def campaign(seed, count, only=None):
    """Outcomes by class of attack, ``count`` attacks in all."""
    names = [name for name in ATTACKS if only is None or only in name]
    share = sum(ATTACKS[name][1] for name in names)
    outcomes = {name: collections.Counter() for name in names}
    logging.disable(logging.WARNING)
    try:
        for name in names:
            with tempfile.TemporaryDirectory() as folder:
                for k in range(-(-count * ATTACKS[name][1] // share)):
                    outcome, said = attacked(name, seed + k, Path(folder))
                    outcomes[name][outcome] += 1
                    if outcome in FAULTS:
                        print(f"{outcome}: {name}, seed {seed + k}: {said}", flush=True)
    finally:
        logging.disable(logging.NOTSET)
    return outcomes


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=0, help="of the first attack of each class")
    parser.add_argument("--count", type=int, default=900, help="attacks in all")
    parser.add_argument("--only", help="part of the name of a class")
    arguments = parser.parse_args()
    outcomes = campaign(arguments.seed, arguments.count, arguments.only)
    columns = (HELD, REFUSED, *FAULTS)
    print(f"{'attacks':38} {'count':>6} " + " ".join(f"{column:>10}" for column in columns))
    for name, counts in [*outcomes.items(), ("all", sum(outcomes.values(), collections.Counter()))]:
        print(f"{name:38} {counts.total():6} " + " ".join(f"{counts[column]:10}" for column in columns))
    return int(any(counts[fault] for counts in outcomes.values() for fault in FAULTS))


if __name__ == "__main__":
    sys.exit(main())
