"""Noise in case files: a case or one named error, never a traceback."""

import contextlib

import numpy as np
from case_files import FILES

from warp_eulsph.cases import CaseError, parse_case, read_case
from warp_eulsph.cases.reading import tomllib


def mutated(text, random):
    """A case file with one line or one character changed, dropped, repeated or swapped with another's."""
    lines = text.splitlines()
    k, j = random.integers(len(lines), size=2)
    match random.integers(7):
        case 0:
            del lines[k]
        case 1:
            lines.insert(k, lines[j])
        case 2:
            lines[k], lines[j] = lines[j], lines[k]
        case 3:  # a character
            i = random.integers(len(lines[k]) + 1)
            lines[k] = lines[k][:i] + chr(random.integers(32, 127)) + lines[k][i + 1 :]
        case 4:  # the value of one key becomes that of another
            key, value = lines[k].partition("=")[0], lines[j].partition("=")[2]
            lines[k] = f"{key}={value}"
        case 5:  # a number
            words = lines[k].split(" ")
            i = random.integers(len(words))
            words[i] = str(
                random.choice(["-1", "0", "1e400", "nan", "1e-300", "'x'", "[]", "{}", "true", "99999999999"])
            )
            lines[k] = " ".join(words)
        case 6:  # a quoted word
            lines[k] = lines[k].replace('"', "", int(random.integers(1, 3)))
    return "\n".join(lines)


def fuzzed(random):
    """Noise: bytes, or the words of case files in any order."""
    if random.integers(2):
        return bytes(random.integers(256, size=random.integers(200), dtype=np.uint8))
    words = [
        "[",
        "]",
        "[[",
        "]]",
        "{",
        "}",
        "=",
        ",",
        ".",
        '"',
        "'",
        "\n",
        "body",
        "a",
        "kind",
        "box",
        "until",
        "1",
        "x",
    ]
    words += ["shape", "material", "boundary", "parameters", "inf", "1e999", "#", '"""', "true", "1979-05-27", "\x00"]
    return " ".join(random.choice(words, size=random.integers(60))).encode()


def read_or_named(path):
    """A case, or the lines of one named error; anything else is a traceback and fails the test."""
    try:
        return read_case(path)
    except CaseError as error:
        assert error.problems and all(line.strip() for line in error.problems)
        return None


def test_2000_fuzzed_files_give_one_named_error_each(tmp_path):
    random = np.random.default_rng(1)
    for _ in range(2000):
        (tmp_path / "case.toml").write_bytes(fuzzed(random))
        assert read_or_named(tmp_path / "case.toml") is None


def test_500_mutated_files_are_valid_or_named(tmp_path, monkeypatch):
    monkeypatch.setattr("warp_eulsph.geometry.lattice.MOST_PARTICLES", 20_000)  # a digit more is not worth the time
    random = np.random.default_rng(2)
    valid = 0
    for k in range(500):
        path = tmp_path / "case.toml"
        path.write_text(mutated(FILES[k % len(FILES)].read_text(encoding="utf-8"), random), encoding="utf-8")
        case = read_or_named(path)
        if case is not None:
            valid += 1
            assert parse_case(case.describe()).describe() == case.describe()
            if case.dim < 3:
                with contextlib.suppress(ValueError):  # with one message: not finite, or too coarse
                    [body.build(name) for name, body in getattr(case, "body", {}).items()]
    assert 50 < valid < 450


def test_500_mutated_tables_are_valid_or_named():
    """Values of every type in every place of valid tables."""
    random = np.random.default_rng(3)
    values = [
        None,
        True,
        -1,
        0,
        7,
        0.5,
        float("nan"),
        float("inf"),
        10**400,
        "",
        "x",
        "Never",
        "1/n",
        [],
        [1],
        [[1]],
        {},
    ]
    values += [{"kind": "Fixed"}, {"kind": 3}, {"kind": []}, b"x", "\x00", "-" * 999, "(" * 300, "é", [1, "x", None]]
    for k in range(500):
        data = tomllib.loads(FILES[k % len(FILES)].read_text(encoding="utf-8"))
        place = data
        while True:
            keys = list(place) if isinstance(place, dict) else range(len(place))
            key = keys[random.integers(len(keys))]
            if not isinstance(place[key], (dict, list)) or not place[key] or random.integers(4) == 0:
                break
            place = place[key]
        if random.integers(4) and isinstance(place, dict):
            place[str(random.choice(["kind", "x", key]))] = values[random.integers(len(values))]
        else:
            place[key] = values[random.integers(len(values))]
        try:
            parse_case(data)
        except CaseError as error:
            assert error.problems and all(line.strip() for line in error.problems)
