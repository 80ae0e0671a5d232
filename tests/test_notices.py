"""What a newcomer sees while kernels are compiled: one line, and nothing that hides others' messages."""

import io
import logging
import os
import subprocess
import sys

import pytest
import warp as wp

from warp_eulsph import notices
from warp_eulsph.notices import EXPECTED, Notices

OWN = "Module _make_mean__locals__mean_1a2b3c4d 5e6f7a8 load on device 'cpu' took {} ms  ({})"


class Heard:
    def __init__(self):
        self.messages = []

    def debug(self, message):
        self.messages.append(("debug", message))

    def info(self, message):
        self.messages.append(("info", message))

    def warning(self, message, category=None, stacklevel=1):
        self.messages.append(("warning", message, category, stacklevel))

    def error(self, message):
        self.messages.append(("error", message))


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture
def heard():
    return Heard()


def test_forty_modules_make_one_line(heard):
    stream = io.StringIO()
    notice = Notices(heard, stream)
    for seconds in (1.5, *[0.2] * 39):
        notice.info(OWN.format(1e3 * seconds, "compiled"))
    assert stream.getvalue() == f"compiling kernels once, about {EXPECTED * 0.2:.0f} s\n"
    assert not heard.messages


def test_a_full_cache_makes_no_line(heard, caplog):
    stream = io.StringIO()
    notice = Notices(heard, stream)
    with caplog.at_level(logging.DEBUG, "warp_eulsph.kernels"):
        for _ in range(40):
            notice.info(OWN.format(0.2, "cached"))
        notice.info("Warp 1.19.0 initialized:\n   CUDA not enabled")
    assert not stream.getvalue() and not heard.messages
    assert len(caplog.records) == 41


def test_messages_of_others_pass_through(heard):
    stream = io.StringIO()
    notice = Notices(heard, stream)
    theirs = "Module __main__ 5e6f7a8 load on device 'cpu' took 200.00 ms (compiled)"
    for _ in range(3):
        notice.info(theirs)
    notice.debug("d")
    notice.warning("w", UserWarning, stacklevel=2)
    notice.error("e")
    assert heard.messages == [("info", theirs)] * 3 + [("debug", "d"), ("warning", "w", UserWarning, 3), ("error", "e")]
    assert not stream.getvalue()


def test_quiet_is_quiet(heard, monkeypatch):
    monkeypatch.setattr(wp.config, "quiet", True, raising=False)
    stream = io.StringIO()
    notice = Notices(heard, stream)
    for _ in range(5):
        notice.info(OWN.format(200.0, "compiled"))
    assert not stream.getvalue()


def test_bar_on_a_terminal_goes_away(heard, monkeypatch):
    monkeypatch.setattr(notices, "PATIENCE", 0.05)
    terminal = Terminal()
    notice = Notices(heard, terminal)
    for _ in range(EXPECTED + 5):
        notice.info(OWN.format(200.0, "compiled"))
    assert "compiling kernels once, about 10 s" in terminal.getvalue()
    notice._idle.join(5.0)
    assert notice._bar is None
    assert terminal.getvalue().endswith("\r")  # the line was wiped


def test_first_run_says_one_line_and_the_second_none(tmp_path):
    """With an empty cache, in a process of its own: a wave on a line of particles in a few kernels."""
    code = (
        "import numpy as np, warp_eulsph as es\n"
        "x = np.linspace(0.0, 1.0, 12)[:, None]\n"
        "bar = es.Body(x=x, volume=1.0 / 11.0, material=es.Bar(density=1.0, young=1.0))\n"
        "es.Simulation(bar, reference=es.Never(), dilation=1.0)\n"
    )
    environment = {**os.environ, "WARP_CACHE_PATH": str(tmp_path / "cache")}
    shown = []
    for _ in range(2):
        ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment, check=True)
        assert not ran.stdout
        shown.append([line for line in ran.stderr.splitlines() if "compiling" in line])
    assert len(shown[0]) == 1 and shown[0][0].startswith("compiling kernels once, about ")
    assert not shown[1]
