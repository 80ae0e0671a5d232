"""Types as a user's checker sees them from outside the package: py.typed is there, and hints say what comes back."""

import subprocess
import sys

RIGHT = """
import warp_eulsph as es
from warp_eulsph.geometry import box
from warp_eulsph.output import Run

x, volume = box(lower=(0.0, 0.0), upper=(1.0, 1.0), spacing=0.1)
body = es.Body(x=x, volume=volume, material=es.NeoHookean(density=1100.0, young=17e6, poisson=0.3))
simulation = es.Simulation(body, boundaries=[es.Fixed(lambda X: X[:, 0] < 0.1), es.Gravity(), es.Damping()])
simulation.run(until=1e-3, every=1e-4, output="run")
reached: float = es.settle(simulation, until=1.0)
reveal_type(simulation.x)
reveal_type(simulation.energy())
reveal_type(Run("run")[-1])
"""
WRONG = """
import warp_eulsph as es

es.Gravity(g="down")
es.Simulation(3)
es.Damping(2.0).rat
"""


def test_a_users_program_is_checked(tmp_path):
    """Both in one go, for the checker reads the whole package."""
    (tmp_path / "right.py").write_text(RIGHT)
    (tmp_path / "wrong.py").write_text(WRONG)
    command = [sys.executable, "-m", "mypy", "--strict", "--cache-dir", str(tmp_path / "cache"), "right.py", "wrong.py"]
    shown = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path).stdout
    for line, kind in ((11, "numpy.ndarray["), (12, "dict[str, float]"), (13, "warp_eulsph.output.reader.RunFrame")):
        assert f'right.py:{line}: note: Revealed type is "{kind}' in shown.replace("builtins.", "")
    assert 'wrong.py:4: error: Argument "g" to "Gravity" has incompatible type "str"' in shown
    assert "wrong.py:5: error: Argument 1 to" in shown
    assert 'wrong.py:6: error: "Damping" has no attribute "rat"' in shown
    assert "Found 3 errors in 1 file" in shown
