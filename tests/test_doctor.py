"""``warp-eulsph doctor`` says what is there, and notices when something is not."""

import importlib.metadata
from pathlib import Path

import pytest
import warp as wp

from warp_eulsph.cli import main
from warp_eulsph.commands import doctor


def test_doctor_tells_versions_devices_and_speed(capsys, monkeypatch, device):
    monkeypatch.setattr(doctor, "SIDE", 5)
    monkeypatch.setattr(doctor, "STEPS", 2)
    assert main(["doctor"]) == 0
    shown = capsys.readouterr().out
    lines = dict(line.split(maxsplit=1) for line in shown.splitlines())
    assert lines["warp-lang"] == importlib.metadata.version("warp-lang")
    assert lines["kernel"] == f"cache   {wp.config.kernel_cache_dir}"
    assert lines["device"].startswith(device.alias)
    speed = float(lines["speed"].split()[1])
    assert 1e3 < speed < 1e9 and "5³ particles" in lines["speed"]
    if device.is_cpu:
        page = (Path(__file__).parents[1] / "docs" / "performance.md").read_text(encoding="utf-8")
        assert f"{doctor.RECORDED / 1e6:.1f} M particle-steps/s\non two cores" in page
        assert "of what docs/performance.md has of two cores, 9e+05" in shown


def test_doctor_notices_what_is_missing_and_what_is_wrong(capsys, monkeypatch):
    monkeypatch.setattr(doctor, "NEEDED", (*doctor.NEEDED, "warp-eulsph-unheard-of"))
    monkeypatch.setattr(doctor, "EXTRAS", {"warp-eulsph-nowhere": "viz"})
    assert main(["doctor", "--no-speed"]) == 1
    shown = capsys.readouterr().out
    assert "needed: pip install warp_eulsph" in shown and "pip install 'warp_eulsph[viz]'" in shown
    assert "speed" not in shown
    monkeypatch.undo()
    monkeypatch.setattr(doctor, "_timed", lambda device: (1e5, 0.01))
    assert main(["doctor"]) == 1
    assert "1.0e-02 of the energy is not accounted for" in capsys.readouterr().out


@pytest.mark.parametrize("package", doctor.NEEDED)
def test_what_is_needed_is_what_the_package_asks_for(package):
    asked = importlib.metadata.requires("warp_eulsph") or []
    assert package == "warp_eulsph" or any(line.startswith(package) for line in asked)
