"""Writes the tables of docs/accuracy.md, docs/speed.md and docs/reliability.md from docs/results/*.json.

    python .ci/tables.py
    python .ci/tables.py --check
    python .ci/tables.py --record OUT.json [--reverse] [--characters] [--machine TEXT]

With --check the exit status is 1 when a page and the results differ. --record takes over what
`sgmds evaluate --json OUT.json` wrote (--reverse: of wholes against parts), `.ci/face_benchmark.py` or
`sgmds bench --json OUT.json` (--machine: on which either of these ran), `tests/reliability/corpus.py --json
OUT.json` (--characters: of characters alone), or `tests/fuzz/campaign.py` in build/fuzz/figures.json, with
date and commit: the one that was measured has to be checked out. A table is between
`<!-- table: NAME -->` and `<!-- end of table -->`.
"""

import argparse
import datetime
import json
import re
import subprocess
import sys
from math import log
from pathlib import Path
from statistics import fmean, linear_regression, median

ROOT = Path(__file__).resolve().parent.parent
ACCURACY, SPEED = ROOT / "docs" / "results" / "accuracy.json", ROOT / "docs" / "results" / "speed.json"
FACES = ROOT / "docs" / "results" / "faces.json"
RELIABILITY = ROOT / "docs" / "results" / "reliability.json"
SHOWN_KEYS = ("eye-left-closure", "mouth-corner-puller", "mouth-open")
BLOCK = re.compile(r"(<!-- table: (.+?) -->\n)(.*?)(<!-- end of table -->)", re.DOTALL)
NOTHING = "–"
# As pages call the trials of tests/reliability/corpus.py and the targets of tests/fuzz/campaign.py.
TRIALS = {"turned": "turned", "decimated": "half of the vertices", "other": "another"}
TARGETS = {
    "gz": "content of a gzipped OBJ",
    "accessors": "accessors and nodes of a GLB",
    "toml": "manifests in TOML",
}
# What exact distances say is quoted where it is recorded.
DISTANCES = ("exact", "heat")
SUMMARY = ("pairs", "direct", "median", "worst", "right", "mirrored", "broken")
STAGES = ("reading", "simplification", "operator", "eigenpairs", "sampling", "geodesics", "distance operator")
STAGES += ("search", "selection", "refinement", "dense map")
KERNELS = (
    ("200 eigenpairs, beside scipy's eigsh", "our eigenpairs", "eigsh"),
    (
        "as many sparse solves in blocks and nothing else, beside the eigenpairs",
        "our solves",
        "our eigenpairs",
    ),
    ("fast marching from 20 sources, beside potpourri3d", "our marching", "fast marching"),
)
# Those after which the peak of the memory is told.
PEAKS = ("simplification", "operator", "eigenpairs", "search")
# Growth is fitted from here on, as by the bench.
FITTED_FROM = 45_000


def read(path: Path) -> dict:
    return json.loads(path.read_text(encoding="utf-8"))


def table(head: list[str], rows: list[list[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "".join(f"| {' | '.join(cells)} |\n" for cells in lines)


def seconds(value: float | None) -> str:
    if value is None:
        return NOTHING
    if value < 0.1:
        return f"{1000 * value:.2g} ms"
    return f"{value:.{0 if value >= 10 else 1 if value >= 1 else 2}f} s"


def number(value: float | None, digits: int) -> str:
    return NOTHING if value is None else f"{value:.{digits}f}"


def gigabytes(megabytes: float | None) -> str:
    return NOTHING if megabytes is None else f"{megabytes / 1000:.2f} GB"


def ratio(value: float | None, by: float | None) -> float | None:
    return value / by if value and by else None


def span(values: list[float], digits: int, unit: str = "") -> str:
    least, most = (f"{pick(values):.{digits}f}" for pick in (min, max))
    return f"{least}{unit}" if least == most else f"{least} to {most}{unit}"


# ------------------------------------------------------------------ accuracy


def accuracy() -> str:
    rows, recorded = [], {}
    for entry in read(ACCURACY)["sets"]:
        known = [name for name in DISTANCES if name in entry]
        found = entry[known[0]]
        s = found["summary"]
        beside = [f"{name} {entry[name]['summary']['direct']:.2f}" for name in known[1:]]
        rows.append(
            [entry["label"], str(s["pairs"])]
            + [f"{s['direct']:.2f}", f"{s['median']:.2f}", f"{s['worst']:.1f}"]
            + [f"{s['right']} (< {found['bound']:g})", str(s["mirrored"]), str(s["broken"])]
            + [known[0] + (f" ({', '.join(beside)})" if beside else "")]
        )
        recorded.setdefault((found["date"], found["commit"]), []).append(entry["label"].split(" (")[0])
    head = ["set", "pairs", "mean", "median", "worst", "right", "mirrored", "broken", "distances"]
    if len(recorded) == 1:
        notes = [f"Recorded on {date} at `{commit}`." for date, commit in recorded]
    else:
        notes = [f"Recorded on {d} at `{c}`: {'; '.join(sets)}." for (d, c), sets in sorted(recorded.items())]
    return table(head, rows) + "\n" + "\n".join(notes) + "\n"


# --------------------------------------------------------------------- faces


def faces() -> str:
    data, rows = read(FACES), []
    for name, found in data["pairs"].items():
        keys, pair = found["keys"], found["pair"]
        closed = keys[SHOWN_KEYS[0]]["closed"]
        rows.append(
            [name, " → ".join(f"{n:,}" for n in pair["vertices"])]
            + [f"{keys[key]['error %']:.0f}" for key in SHOWN_KEYS]
            + [f"{fmean(key[what] for key in keys.values()):.0f}" for what in ("error %", "95 %", "angle")]
            + [number(closed, 2), str(pair["lids"] + pair["lips"] + pair["pieces"]), pair["grade"]]
            + [f"{pair['CPU seconds']:.1f} s"]
        )
    head = ["pair", "vertices", "blink", "smile", "jaw open", "all keys", "95 %", "angle °", "lid gap closed"]
    note = f"{len(keys)} keys. Recorded on {where(data)}."
    return table([*head, "exchanged", "grade", "CPU time"], rows) + f"\n{note}\n"


# --------------------------------------------------------------- reliability


def corpus(name: str) -> str:
    data, rows = read(RELIABILITY)[name], []
    for trial, own in data["trials"].items():
        if trial == "other":
            shown = [NOTHING, *(f"({count})" for count in own["without truth"].values())]
        else:
            by_grade = ", ".join(f"{count} {grade}" for grade, count in own["right"].items() if count)
            shown = [f"{sum(own['right'].values())} ({by_grade})", *map(str, own["wrong"].values())]
        ends = [str(own[end]) for end in ("refused", "ended badly", "beyond a limit")]
        rows.append([TRIALS[trial], str(own["files"]), *shown, *ends])
    head = ["trial", "files", "right", "wrong: green", "amber", "red", "refused", "panic, crash"]
    least, most = data["vertices"]
    memory = data["a large vertex"]["kB"]
    note = (
        f"Those matched have {least:,} to {most:,} vertices. The longest match took "
        f"{data['most seconds']:.0f} s of one processor, the largest {data['most megabytes']:.0f} MB beside "
        f"what importing takes; from 5,000 vertices on a vertex takes {memory['median']:.0f} kB in the "
        f"median, {memory['most']:.0f} at most.\n"
        f"Recorded on {data['date']} at `{data['commit']}`."
    )
    return table([*head, "beyond a limit"], rows) + f"\n{note}\n"


def fuzzing() -> str:
    rows = []
    for target, own in read(RELIABILITY)["fuzzing"].items():
        reached = f"{own['reached']:,}, from {own['first']:,}"
        found = str(own["findings"] or "nothing")
        recorded = f"{own['date']}, `{own['commit']}`"
        rows.append(
            [TARGETS[target], f"{own['seconds']:,.0f} s", f"{own['inputs']:,}", reached, found, recorded]
        )
    return table(["target", "processor time", "inputs", "edges reached", "findings", "recorded"], rows)


# --------------------------------------------------------------------- speed


def where(group: dict) -> str:
    return f"{group['date']} at `{group['commit']}`, {group['machine']}"


def of_size(data: dict, vertices: int) -> dict:
    """The record whose size is nearest to that."""
    return min(data["sizes"]["records"], key=lambda record: abs(record["vertices"] - vertices))


def sizes(data: dict) -> str:
    head = ["vertices of each", "pair", "prepared", "preparing one", "peak memory beside the meshes"]
    rows = [
        [f"{r['vertices']:,}", *(seconds(r[key]) for key in ("pair", "match_prepared", "prepare"))]
        + [gigabytes(r["peak_mb"]), number(r.get("error"), 2)]
        for r in data["sizes"]["records"]
    ]
    large = [r for r in data["sizes"]["records"] if r["vertices"] >= FITTED_FROM]
    note = (
        f"From {large[0]['vertices']:,} to {large[-1]['vertices']:,} vertices the time of a pair grows with "
        f"the exponent {growth(data):.2f}. Recorded on {where(data['sizes'])}."
    )
    return table([*head, "mean error ×100"], rows) + f"\n{note}\n"


def growth(data: dict) -> float:
    large = [r for r in data["sizes"]["records"] if r["vertices"] >= FITTED_FROM]
    return linear_regression([log(r["vertices"]) for r in large], [log(r["pair"]) for r in large]).slope


def stages(data: dict) -> str:
    rows = [
        [f"{r['vertices']:,}"]
        + [f"{1000 * r[f'stage {n}']:,.0f}" if f"stage {n}" in r else "" for n in STAGES]
        + [f"{1000 * r['transfer']:,.0f}"]
        for r in data["sizes"]["records"]
    ]
    return table(["vertices", *STAGES, "transfer"], rows) + "\n" + memory(data) + "\n"


def memory(data: dict) -> str:
    """Peaks of the smallest and the largest size, in a line."""
    lines = []
    for r in (data["sizes"]["records"][i] for i in (0, -1)):
        known = {stage: mb for stage, mb in r.get("stage_peaks_mb", {}).items() if stage in PEAKS}
        peaks = ", ".join(f"{mb:,.0f} MB until after {stage}" for stage, mb in known.items())
        lines.append(f"at {r['vertices']:,} vertices {peaks}, {r['peak_mb']:,.0f} MB at the end")
    return f"Memory at the peak, beside the meshes: {'; '.join(lines)}."


def peers(data: dict) -> str:
    head = ["vertices of each", "our pair", "eigsh, one shape", "potpourri3d, 20 sources: marching", "heat"]
    keys = ("pair", "eigsh", "fast marching", "heat", "pyfmaps")
    rows, notes = [], []
    for group in data["peers"]:
        records = group["records"]
        rows += [[f"{r['vertices']:,}", *(seconds(r[key]) for key in keys)] for r in records]
        sizes_of = f"{records[0]['vertices']:,} to {records[-1]['vertices']:,} vertices"
        notes.append(f"{sizes_of} on {where(group)}")
    return table([*head, "pyfmaps, the pair"], rows) + "\n" + f"Recorded: {'; '.join(notes)}.\n"


def kernels(data: dict) -> str:
    """Parts of the work beside their peers, and the eigenpairs beside what they cannot do without."""
    rows = [
        [name, f"{r['vertices']:,}", seconds(r[ours]), seconds(r[other]), f"{r[other] / r[ours]:.2g} times"]
        for r in data["sizes"]["records"]
        for name, ours, other in KERNELS
        if r.get(ours) and r.get(other)
    ]
    errors = ", ".join(f"{name} {100 * error:.2f} %" for name, error in data["sphere"].items())
    note = f"Mean error of fast marching on a sphere: {errors}."
    return table(["", "vertices", "ours", "beside", "longer by"], rows) + f"\n{note}\n"


def spread(data: dict) -> str:
    """How far the runs of one bench differ, since others use the machine too."""
    rows = [
        [name.replace(" by ", " / "), *(f"{pick(v):.3g}" for pick in (min, median, max)), str(len(v))]
        for name, v in data["spread"]["ratios"].items()
        if len(v) > 2
    ]
    return (
        table(["5,008 vertices", "least", "median", "most", "values"], rows)
        + f"\nRecorded on {where(data['spread'])}.\n"
    )


def goals(data: dict) -> str:
    runs, sphere = data["spread"]["ratios"], data["sphere"]
    small, middle, large = (of_size(data, n) for n in (5_000, 20_000, 1_000_000))
    fifty, hundred = of_size(data, 50_000), of_size(data, 100_000)
    rows = [
        ["a pair of 5,000 vertices in 0.8 s", span(runs["pair"], 2, " s")],
        ["in 0.4 of an eigsh (200 pairs, same mesh)", span([1 / x for x in runs["eigsh by pair"]], 2)],
        ["ten times as fast as pyfmaps", span(runs["pyfmaps by pair"], 0, " times")],
        ["200 eigenpairs six times as fast as eigsh", span(runs["eigsh by our eigenpairs"], 0, " times")],
        ["within 2.5 times their floor", span(runs["our eigenpairs by our solves"], 1, " times")],
        [
            "marching four times as fast as potpourri3d's, with no larger error",
            f"{span(runs['fast marching by our marching'], 0, ' times')}, "
            f"{100 * sphere['ours']:.2f} % against {100 * sphere['potpourri3d']:.2f} % on a sphere",
        ],
        ["two prepared shapes in half the time of arrays", span(runs["prepared by pair"], 2)],
        [
            "a pair of 50,000 in 4 s and twice that eigsh",
            f"{seconds(fifty['pair'])}, {number(ratio(fifty['pair'], small.get('eigsh')), 1)} times",
        ],
        ["a pair of 100,000 in 8 s", seconds(hundred["pair"])],
        [
            "a million in 60 s and 6 GB, error within 20 % of that at 20,000",
            f"{seconds(large['pair'])}, {gigabytes(large['peak_mb'])}, "
            f"{number(ratio(large['error'], middle['error']), 2)}",
        ],
        ["exponent from 50,000 to a million below 1.15", f"{growth(data):.2f}"],
    ]
    return table(["goal", "reached"], rows)


def one_thread(data: dict, vertices: int) -> str:
    found = next(p for p in data["one_thread"] if p["vertices"] == vertices)
    total = found["milliseconds"]
    rows = [[stage, str(ms), f"{100 * ms / total:.0f} %"] for stage, ms in found["stages"].items()]
    return (
        table(["stage", "ms", "share"], [*rows, ["all", f"{total:,}", ""]])
        + f"\nRecorded on {where(found)}.\n"
    )


def tables() -> dict[str, str]:
    data = read(SPEED)
    made = {f"one thread {p['vertices']}": one_thread(data, p["vertices"]) for p in data["one_thread"]}
    for make in (sizes, stages, peers, kernels, spread, goals):
        made[make.__name__] = make(data)
    made |= {name: corpus(name) for name in ("corpus", "characters")}
    return made | {make.__name__: make() for make in (accuracy, faces, fuzzing)}


# ----------------------------------------------------------------- recording


def record(path: Path, reverse: bool, characters: bool, machine: str | None) -> None:
    """Takes over what `sgmds evaluate` or `sgmds bench` wrote."""
    git = ["git", "-C", str(ROOT), "rev-parse", "--short", "HEAD"]
    commit = subprocess.run(git, check=True, capture_output=True, text=True).stdout.strip()
    when = {"commit": commit, "date": datetime.date.today().isoformat()}
    new = json.loads(path.read_text(encoding="utf-8"))
    if "corpus" in new:
        recorded, known = RELIABILITY, read(RELIABILITY)
        known["characters" if characters else "corpus"] = when | new["corpus"]
    elif isinstance(new, dict) and new.keys() & TARGETS.keys():
        recorded, known = RELIABILITY, read(RELIABILITY)
        known["fuzzing"] |= {name: when | new[name] for name in TARGETS if name in new}
    elif "faces" in new:
        recorded = FACES
        known = when | {
            "machine": machine or sys.exit("--machine says on what it ran"),
            "pairs": new["faces"],
        }
    elif isinstance(new, list):
        recorded, known = SPEED, read(SPEED)
        if not machine:
            sys.exit("--machine says on what the bench ran")
        known["sizes"] = when | {"machine": machine, "records": new}
    else:
        recorded, known = ACCURACY, read(ACCURACY)
        for name, found in new["sets"].items():
            entries = [e for e in known["sets"] if (e["set"], e["reverse"]) == (name, reverse)]
            if found["method"] != "auto" or not entries:
                sys.exit(
                    f"{path}: {name} by {found['method']} is not in {recorded.name}: add its label there"
                )
            summary = {key: found["summary"][key] for key in SUMMARY}
            entries[0][found["distances"]] = when | {"bound": found["bound"], "summary": summary}
    recorded.write_text(json.dumps(known, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--check", action="store_true")
    parser.add_argument("--record", type=Path, metavar="OUT.json")
    parser.add_argument("--reverse", action="store_true", help="of wholes against parts")
    parser.add_argument("--characters", action="store_true", help="of a corpus of characters")
    parser.add_argument("--machine", help="on which bench or benchmark ran")
    options = parser.parse_args()
    if options.record:
        record(options.record, options.reverse, options.characters, options.machine)
    made, stale = tables(), []
    for page in (ROOT / "docs" / f"{name}.md" for name in ("accuracy", "speed", "reliability")):
        text = page.read_text(encoding="utf-8")
        new = BLOCK.sub(lambda found: f"{found[1]}\n{made[found[2]]}\n{found[4]}", text)
        if new != text:
            stale.append(page.name)
            if not options.check:
                page.write_text(new, encoding="utf-8")
    if options.check and stale:
        print(f"{', '.join(stale)}: other than docs/results/*.json, run python .ci/tables.py")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
