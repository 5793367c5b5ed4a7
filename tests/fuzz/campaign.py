"""Fuzzing by processor time, one process after the other, with a line of figures each.

    python tests/fuzz/campaign.py [TARGET=SECONDS ...]

Without arguments the times of docs/reliability.md. libFuzzer's own limit counts the clock, which says little
on a machine that does other things too. Figures add up in build/fuzz/figures.json, so a campaign that was
stopped goes on where it was, and more seconds are asked for by a larger number. A finding ends its target;
what it was is in build/fuzz. Exit status 1 then.
"""

import json
import os
import re
import resource
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).parent
CORE = {"intake": 900, "restore": 480, "match": 300}
READERS = {"map": 300, "shape": 300, "obj": 240, "off": 240, "ply": 240, "stl": 240, "glb": 240}
READERS |= {"gz": 900, "accessors": 900, "toml": 900}
# Seconds of the clock after which figures are noted. Instrumenting the readers takes half a minute itself.
SLICE = 300
FIGURES = Path("build/fuzz/figures.json")


def command(target, seconds):
    program = [HERE / "run"] if target in CORE else [sys.executable, HERE / "readers.py"]
    return [*map(str, program), target, str(seconds), "-print_final_stats=1"]


def processor_time():
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def slice_of(target, figures):
    """Fuzzes for a while and adds to the figures. True when something was found."""
    before = processor_time()
    done = subprocess.run(
        command(target, SLICE),
        env={**os.environ, "FUZZ_BUILD": "no"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        check=False,
    )
    reached = [int(count) for count in re.findall(r"\bcov: (\d+)", done.stdout)] or [0]
    figures["seconds"] = figures.get("seconds", 0) + processor_time() - before
    figures["inputs"] = figures.get("inputs", 0) + sum(
        map(int, re.findall(r"number_of_executed_units: (\d+)", done.stdout))
    )
    figures.setdefault("first", reached[0])
    figures["reached"] = max([figures.get("reached", 0), *reached])
    figures["findings"] = figures.get("findings", 0) + (done.returncode != 0)
    if done.returncode:
        FIGURES.with_name(f"{target}.log").write_text(done.stdout)
    return done.returncode != 0


def main():
    asked = dict(word.split("=") for word in sys.argv[1:]) or {**CORE, **READERS}
    figures = json.loads(FIGURES.read_text()) if FIGURES.exists() else {}
    found = []
    for target, budget in asked.items():
        if target in CORE:
            # Builds the program; not counted.
            subprocess.run(command(target, 1), capture_output=True, check=False)
        own = figures.setdefault(target, {})
        while own.get("seconds", 0) < float(budget) and target not in found:
            if slice_of(target, own):
                found.append(target)
            FIGURES.write_text(json.dumps(figures, indent=1))
        print(
            f"| {target} | {own.get('seconds', 0):.0f} s | {own.get('inputs', 0):,} | {own.get('first')} → "
            f"{own.get('reached')} | {'FOUND' if target in found else ''} |",
            flush=True,
        )
    return int(bool(found))


if __name__ == "__main__":
    sys.exit(main())
