"""The first attacks of each class of ``attacks.py``, which has the long campaign."""

import attacks
import faults
import pytest


@pytest.mark.parametrize("name", attacks.ATTACKS)
def test_first_attacks_are_held_or_refused(name, tmp_path):
    for seed in range(6 * attacks.ATTACKS[name][1]):
        outcome, said = attacks.attacked(name, seed, tmp_path)
        assert outcome in (faults.HELD, faults.REFUSED), (seed, said)


def test_faults_are_found_and_counted(monkeypatch, tmp_path, capsys):
    def wrong(rng, folder):
        faults.right(False, "a wrong value")

    def gone(rng, folder):
        raise faults.LostError("a snapshot")

    def broken(rng, folder):
        return {}["not there"]

    for attack, outcome in ((wrong, "silent"), (gone, "lost"), (broken, "traceback")):
        monkeypatch.setattr(attacks, "ATTACKS", {"one": (attack, 1)})
        assert attacks.attacked("one", 0, tmp_path)[0] == outcome
        monkeypatch.setattr("sys.argv", ["attacks.py", "--count", "3"])
        assert attacks.main() == 1 and capsys.readouterr().out.splitlines()[-1].split()[:2] == ["all", "3"]
