"""Print the lower bounds of the package's dependencies and extras as constraints: ``name==version``, a line each."""

import re
import tomllib
from pathlib import Path

PROJECT = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EXTRAS = PROJECT["optional-dependencies"]
OF_USERS = [requirement for extra in EXTRAS if extra not in ("all", "docs", "test") for requirement in EXTRAS[extra]]

for requirement in [*PROJECT["dependencies"], *OF_USERS]:
    name, version = re.fullmatch(r"([\w-]+)>=([\w.]+)", requirement).groups()
    print(f"{name}=={version}")
