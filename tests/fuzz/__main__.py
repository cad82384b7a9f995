"""``make fuzz``: 10,000 damaged inputs by a fresh seed, or by the one given; exits with 1 for a fault."""

import sys
import tempfile
import time
from pathlib import Path

from .fuzz import read_damaged, run_damaged

RUNS, COMMANDS = 10_000, 40


def main() -> None:
    seed = int(sys.argv[1]) if len(sys.argv) > 1 else time.time_ns() % 10**9
    runs = int(sys.argv[2]) if len(sys.argv) > 2 else RUNS
    with tempfile.TemporaryDirectory() as read, tempfile.TemporaryDirectory() as commanded:
        counts, broken = read_damaged(Path(read), seed, runs)
        broken += run_damaged(Path(commanded), seed, COMMANDS * runs // RUNS)
    for name, count in sorted(counts.items()):
        print(f"{name}: {count}")
    for text in broken:
        print(text)
    print(f"seed {seed}: {runs} inputs, {len(broken)} that break the promise")
    sys.exit(bool(broken))


if __name__ == "__main__":
    main()
