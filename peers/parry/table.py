#!/usr/bin/env python3
"""Makes a table of what `cargo bench` prints here: `cargo bench 2>/dev/null | ./table.py`."""

import re
import sys

NANOSECONDS = {"ns": 1.0, "µs": 1e3, "ms": 1e6, "s": 1e9}
PAIRS = 100  # in a line, as in benches/pairs.rs

pair, medians = None, {}
for line in sys.stdin:
    if group := re.match(r"[├╰]─ (\w+)", line):
        pair = group[1]
    number = r"([\d.]+) (\S+)\s+│\s+"
    if row := re.search(r"_(taw|parry)\s+" + 2 * number + number, line):
        medians.setdefault(pair, {})[row[1]] = float(row[6]) * NANOSECONDS[row[7]] / PAIRS

print("| pair | taw | parry3d | ratio |\n|---|---|---|---|")
for pair, time in sorted(medians.items()):
    name = pair.replace("_", ", ").replace("touch, ", "manifold of ")
    taw, parry = time["taw"], time["parry"]
    print(f"| {name} | {taw:.0f} ns | {parry:.0f} ns | {taw / parry:.2f} |")
