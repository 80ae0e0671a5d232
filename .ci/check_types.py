"""mypy on all of the package, but for what stands in kernels, which Warp compiles and mypy cannot read.

    python .ci/check_types.py        exit status 1 and the findings in host code, if there are any

Kernels and functions of the device (``wp.kernel``, ``wp.func`` and their kin) annotate with types made at run time, and
index and add what to mypy are functions. Findings in their lines are left out; all else is checked with every code on.
"""

import ast
import functools
import re
import subprocess
import sys
from pathlib import Path

DEVICE = re.compile(r"wp\.(kernel|func|func_native|struct)\b")
FINDING = re.compile(r"(?P<path>[^:]+\.py):(?P<line>\d+): error: ")


@functools.cache
def device_lines(path: str) -> frozenset[int]:
    """Lines of the functions and structs that Warp compiles, with their decorators."""
    lines: set[int] = set()
    for node in ast.walk(ast.parse(Path(path).read_text(encoding="utf-8"))):
        decorators = node.decorator_list if isinstance(node, ast.FunctionDef | ast.ClassDef) else []
        if any(DEVICE.match(ast.unparse(decorator)) for decorator in decorators):
            lines |= set(range(decorators[0].lineno, node.end_lineno + 1))
    return frozenset(lines)


def main() -> int:
    """Check; the exit status of the checker for host code."""
    ran = subprocess.run([sys.executable, "-m", "mypy", *sys.argv[1:]], capture_output=True, text=True)
    findings = [(line, FINDING.match(line)) for line in ran.stdout.splitlines()]
    errors = [(line, found) for line, found in findings if found]
    if ran.returncode not in (0, 1) or (ran.returncode and not errors):
        print(ran.stdout + ran.stderr)
        return 2
    host = [line for line, found in errors if int(found["line"]) not in device_lines(found["path"])]
    print("\n".join([*host, f"{len(host)} findings in host code; {len(errors) - len(host)} in kernels, left out"]))
    return 1 if host else 0


if __name__ == "__main__":
    sys.exit(main())
