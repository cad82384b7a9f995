"""The command line: run benchmarks by name, all of them without one."""

import argparse
import json
import pkgutil
import sys
from dataclasses import asdict
from importlib import import_module
from pathlib import Path

import benchmarks

from ._machine import machine
from ._report import Report, show


def names() -> tuple[str, ...]:
    """The benchmarks found in this package."""
    found = (module.name for module in pkgutil.iter_modules(benchmarks.__path__))
    return tuple(sorted(name for name in found if not name.startswith("_")))


def main() -> None:
    """Run what was asked for, print a table each, and write everything as JSON to ``--json``."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=benchmarks.__doc__)
    parser.add_argument("names", nargs="*", metavar="name", help=f"{', '.join(names())}; all without one")
    parser.add_argument("--json", type=Path, metavar="PATH", help="also write the figures to this file")
    arguments = parser.parse_args()
    for unknown in sorted(set(arguments.names) - set(names())):
        parser.error(f"{unknown}: expected one of {', '.join(names())}")
    host = machine()
    print(", ".join(f"{key} {value}" for key, value in host.items()))
    reports: dict[str, Report] = {}
    for name in arguments.names or names():
        module = import_module(f"{benchmarks.__name__}.{name}")
        reports[name] = module.measure()
        show(name, (module.__doc__ or "").strip().splitlines()[0], reports[name])
        sys.stdout.flush()
    if arguments.json is not None:
        document = {"machine": host, "benchmarks": {name: asdict(report) for name, report in reports.items()}}
        arguments.json.write_text(json.dumps(document, indent=2) + "\n")


if __name__ == "__main__":
    main()
