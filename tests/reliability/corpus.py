"""Folders of meshes of any kind, each in processes of their own with limits: right, wrong, refused.

    python tests/reliability/corpus.py FOLDER… [--every 1] [--limit N] [--seconds 60] [--gigabytes 4]
        [--trials turned,decimated,other] [--seed 0] [--json OUT]

Three trials a file. `turned`: the mesh to itself, turned, scaled, moved and renumbered. `decimated`: to
itself with about half of the vertices, by clusters of which one vertex stays, turned likewise. `other`: to
the next file of the folders, which has no truth. The error is the mean distance of the images from the true
points over √area, ×100, weighted by area; above 6 a map is wrong, as in `verdict.py`. Seconds are of the
processor.
Exit status 1 when a map is wrong and green, or a process goes beyond a limit or ends in anything but a map
or a refusal.

    python tests/reliability/corpus.py --one TRIAL SEED FILE [OTHER]

does one of them and prints a line of JSON.
"""

import argparse
import json
import os
import re
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np
from verdict import WRONG_ABOVE

TRIALS = ("turned", "decimated", "other")
GRADES = ("green", "amber", "red")
LARGE = 5000
"""Vertices from which on a peak says something of one vertex: less is the program's own."""


def turned(vertices, rng):
    """The same points turned, scaled by 0.1 to 10 and moved."""
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    size = np.ptp(vertices, axis=0).max() or 1.0
    return 10 ** rng.uniform(-1, 1) * vertices @ turn.T + rng.normal(size=3) * size


def renumbered(vertices, faces, rng):
    """The mesh with other numbers of vertices and faces, and the old number of each vertex."""
    old = rng.permutation(len(vertices))
    new = np.empty_like(old)
    new[old] = np.arange(len(old))
    return vertices[old], new[faces][rng.permutation(len(faces))], old


def decimated(vertices, faces):
    """The mesh with about half of its vertices, and the old number of each vertex that stayed.

    Vertices of one cell of a grid become the one nearest to their mean; triangles that lose their area go.
    """
    used = np.unique(faces)
    low, extent = vertices[used].min(axis=0), np.ptp(vertices[used], axis=0).max()
    cell = extent / 4
    for _ in range(40):
        keys = np.floor((vertices[used] - low) / cell).astype(np.int64)
        _, cluster = np.unique(keys, axis=0, return_inverse=True)
        if cluster.max() + 1 >= len(used) / 2:
            break
        cell *= 0.85
    cluster = cluster.reshape(-1)
    count = np.bincount(cluster)
    mean = np.stack([np.bincount(cluster, vertices[used, k]) for k in range(3)], axis=1) / count[:, None]
    apart = np.linalg.norm(vertices[used] - mean[cluster], axis=1)
    order = np.lexsort((apart, cluster))
    stays = used[order[np.searchsorted(cluster[order], np.arange(len(count)))]]
    number = np.full(len(vertices), -1)
    number[used] = cluster
    left = number[faces]
    whole = (left[:, 0] != left[:, 1]) & (left[:, 1] != left[:, 2]) & (left[:, 2] != left[:, 0])
    return vertices[stays], left[whole], stays


def areas(vertices, faces):
    """Area of each face, and each vertex's share of it."""
    corners = vertices[faces]
    of_faces = (
        np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    )
    return of_faces, np.bincount(faces.ravel(), np.repeat(of_faces / 3, 3), len(vertices))


def one(trial, seed, path, other=None):
    """One trial: grade, error and counts, or why it was refused."""
    import sgmds
    from sgmds.files import read_mesh

    rng = np.random.default_rng(seed)
    found = {}
    try:
        vertices, faces = read_mesh(path)
        found |= {"vertices": len(vertices), "faces": len(faces)}
        if trial == "other":
            target, old = read_mesh(other), None
        else:
            kept = np.arange(len(vertices))
            target = vertices, faces
            if trial == "decimated":
                *target, kept = decimated(vertices, faces)
            *target, order = renumbered(*target, rng)
            old = kept[order]
            target = turned(target[0], rng), target[1]
        corr = sgmds.match((vertices, faces), tuple(target), threads=1)
    except sgmds.InternalError as error:
        return found | {"end": "panic", "reason": str(error)}
    except sgmds.SgmdsError as error:
        return found | {"end": "refused", "reason": str(error).replace(str(path), "").lstrip(": ")}
    found |= {"end": "matched", "grade": corr.quality.grade, "reason": "; ".join(corr.quality.reasons)}
    if old is not None:
        images = np.einsum("nk,nkc->nc", corr.barycentric, vertices[faces[corr.faces]])
        whole, _ = areas(vertices, faces)
        _, weights = areas(*target)
        apart = np.linalg.norm(images - vertices[old], axis=1)
        found["error"] = float(100 * np.average(apart, weights=weights) / np.sqrt(whole.sum()))
    return found


def peak(process="self"):
    """Most memory that a process has held, in bytes; `getrusage` tells at least what its parent held."""
    found = re.search(r"VmHWM:\s+(\d+)", Path(f"/proc/{process}/status").read_text())
    return 1024 * int(found[1]) if found else 0


def limited(command, seconds, size):
    """What a process prints last, how it ended, its processor seconds and its peak in bytes."""
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    tick = os.sysconf("SC_CLK_TCK")
    beyond = ""
    while process.poll() is None:
        time.sleep(0.05)
        try:
            fields = Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()
            held = peak(process.pid)
        except OSError:
            continue
        used = (int(fields[11]) + int(fields[12])) / tick
        beyond = f"more than {seconds} s" if used > seconds else ""
        if held > size:
            beyond = f"more than {size / 1e9:g} GB"
        if beyond:
            process.kill()
    out, error = process.communicate()
    return out, error, process.returncode, beyond


def measured(trial, seed, path, other, options):
    command = [sys.executable, __file__, "--one", trial, str(seed), str(path), str(other)]
    out, error, status, beyond = limited(command, options.seconds, options.gigabytes * 1e9)
    record = {"file": str(path), "trial": trial}
    if beyond:
        return record | {"end": "beyond", "reason": beyond}
    if status:
        last = (error.strip().splitlines() or ["nothing said"])[-1]
        return record | {"end": "crash", "reason": f"status {status}: {last}"}
    return record | json.loads(out.splitlines()[-1])


def summary(records):
    """Counts of each trial, refusals by reason, and what a vertex of the large meshes takes."""
    trials = {}
    for trial in TRIALS:
        own = [record for record in records if record["trial"] == trial]
        if not own:
            continue
        ends = Counter(record["end"] for record in own)
        matched = [record for record in own if record["end"] == "matched"]
        of_grades = {
            "right": [record for record in matched if record.get("error", np.inf) <= WRONG_ABOVE],
            "wrong": [record for record in matched if record.get("error", 0) > WRONG_ABOVE],
            "without truth": [record for record in matched if "error" not in record],
        }
        counts = {name: Counter(record["grade"] for record in group) for name, group in of_grades.items()}
        trials[trial] = {
            "files": len(own),
            **{name: {grade: count[grade] for grade in GRADES} for name, count in counts.items()},
            "refused": ends["refused"],
            "ended badly": ends["panic"] + ends["crash"],
            "beyond a limit": ends["beyond"],
        }
    # Numbers differ from file to file.
    refusals = Counter(
        re.sub(r"\d[\d.,]*", "N", record["reason"]) for record in records if record["end"] == "refused"
    )
    matched = [record for record in records if record["end"] == "matched"]
    large = [record for record in matched if record["vertices"] >= LARGE]
    rates = {
        unit: [1000 * record[name] / record["vertices"] for record in large]
        for name, unit in (("peak_mb", "kB"), ("seconds", "ms"))
    }
    vertices = [record["vertices"] for record in matched]
    return {
        "vertices": [min(vertices), max(vertices)] if vertices else [],
        "trials": trials,
        "refusals": dict(refusals.most_common()),
        "a large vertex": {
            unit: {"median": round(float(np.median(rate)), 2), "most": round(max(rate), 2)}
            for unit, rate in rates.items()
            if rate
        },
        "most seconds": max((record["seconds"] for record in matched), default=0),
        "most megabytes": max((record["peak_mb"] for record in matched), default=0),
    }


def told(records):
    """Prints the counts and returns the exit status."""
    found = summary(records)
    print("| trial | files | right | wrong: green | amber | red | refused | panic, crash | beyond a limit |")
    print("|---|---|---|---|---|---|---|---|---|")
    for trial, own in found["trials"].items():
        if trial == "other":
            shown = ["–", *(f"({own['without truth'][grade]})" for grade in GRADES)]
        else:
            right = own["right"]
            by_grade = ", ".join(f"{count} {grade}" for grade, count in right.items() if count)
            shown = [f"{sum(right.values())} ({by_grade})", *map(str, own["wrong"].values())]
        bad = f"{own['ended badly']} | {own['beyond a limit']}"
        print(f"| {trial} | {own['files']} | {' | '.join(shown)} | {own['refused']} | {bad} |")
    for reason, count in found["refusals"].items():
        print(f"refused, {count}: {reason}")
    for unit, rate in found["a large vertex"].items():
        print(f"{unit} a vertex from {LARGE} on: median {rate['median']}, most {rate['most']}")
    failed = [record for record in records if record["end"] in ("panic", "crash", "beyond")]
    failed += [
        record
        for record in records
        if record["end"] == "matched" and record["grade"] == "green" and record.get("error", 0) > WRONG_ABOVE
    ]
    for record in failed:
        print(f"{record['end']}: {record['file']} {record['trial']}: {record['reason']}")
    return int(bool(failed))


def main():
    if sys.argv[1:2] == ["--one"]:
        import resource

        trial, seed, *paths = sys.argv[2:]
        import sgmds  # noqa: F401 - what it takes is not the mesh's

        before, held = resource.getrusage(resource.RUSAGE_SELF), peak()
        found = one(trial, int(seed), *paths)
        after = resource.getrusage(resource.RUSAGE_SELF)
        found["peak_mb"] = round((peak() - held) / 2**20, 1)
        found["seconds"] = round(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, 2)
        print(json.dumps(found))
        return 0
    from sgmds.files import mesh_format

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--every", type=int, default=1, metavar="N", help="only every Nth file")
    parser.add_argument("--limit", type=int, metavar="N", help="only the first N of them")
    parser.add_argument("--seconds", type=float, default=60)
    parser.add_argument("--gigabytes", type=float, default=4)
    parser.add_argument("--trials", default=",".join(TRIALS))
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json")
    options = parser.parse_args()
    files = sorted(
        path
        for folder in options.folders
        for path in folder.rglob("*")
        if path.is_file() and mesh_format(path)
    )
    files = files[:: options.every][: options.limit]
    records = []
    for number, path in enumerate(files):
        for trial in options.trials.split(","):
            record = measured(trial, options.seed + number, path, files[(number + 1) % len(files)], options)
            records.append(record)
            error = f", error {record['error']:.2f}" if "error" in record else ""
            what = f"{record['end']} {record.get('grade', '')}{error}: {record['reason']}"
            print(
                f"{number + 1} of {len(files)} {path.name} {trial}: {what[:200]}", file=sys.stderr, flush=True
            )
            if options.json:
                kept = {"corpus": summary(records), "records": records}
                Path(options.json).write_text(json.dumps(kept, indent=1))
    return told(records)


if __name__ == "__main__":
    sys.exit(main())
