"""The report: tables and a picture, without any time in them, so that the same work gives the same bytes."""

from __future__ import annotations

import csv
import json
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from .. import pictures
from ..errors import in_one_line
from ..whole_file import begins_with, whole_file
from .manifest import Batch

COLUMNS = ("status", "grade", "energy", "local_distortion", "orientation", "confidence", "unmatched")
MATRICES = {
    "energy": "S-GMDS energy",
    "confidence": "mean confidence",
    "local_distortion": "mean change of short distances",
}
"""Figures of a pair that are also written as a matrix, and what they are called in the picture."""
NAMES = ("pairs.csv", *(f"{name}.csv" for name in MATRICES), "distances.png", "report.json")
"""Files of the report."""
BEGINNINGS = (b"source,", b"\x89PNG\r\n\x1a\n", b'{\n "pairs": ')
"""By which they are known: tables, the picture and the summary."""
GRADES = ("green", "amber", "red")
FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n", "\uff1d", "\uff0b", "\uff0d", "\uff20")
"""What programs of tables take for the beginning of a formula, also in full width (OWASP, CSV Injection)."""
LABELLED = 60
"""Rows of a picture that have room for their names."""


def write(batch: Batch, records: Iterable[tuple[int, dict | None]]) -> dict:
    """Writes the report beside the maps and returns its summary.

    `pairs.csv` has a line a pair. `energy.csv` and the like are matrices, a row a source, a column a target,
    empty where a pair was not asked for or failed. `report.json` is the summary, with every failure.
    `distances.png` shows the matrices.
    """
    sources, targets = _sides(batch)
    rows, columns = ({s: i for i, s in enumerate(side)} for side in (sources, targets))
    matrices = {name: np.full((len(sources), len(targets)), np.nan) for name in MATRICES}
    statuses: Counter[str] = Counter()
    grades: Counter[str] = Counter()
    failures = []
    names = [shape.name for shape in batch.shapes]
    with whole_file(batch.folder / "pairs.csv") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(("source", "target", *COLUMNS, "map", "reason"))
        for number, record in records:
            pair = batch.pair(number)
            record = record or {"status": "open", "reason": "not done yet"}
            ends = names[pair.source], names[pair.target]
            done = record["status"] == "done"
            statuses[record["status"]] += 1
            if done:
                grades[record["grade"]] += 1
            else:
                failures.append({"source": ends[0], "target": ends[1], "reason": record["reason"]})
            place = _shown(pair.map, batch.folder) if done and pair.map else ""
            row = (*ends, *(record.get(c, "") for c in COLUMNS), place, record["reason"])
            table.writerow(map(_cell, row))
            for name, matrix in matrices.items():
                if name in record:
                    matrix[rows[pair.source], columns[pair.target]] = record[name]
    matrices = {name: matrix for name, matrix in matrices.items() if np.isfinite(matrix).any()}
    labels = [names[s] for s in sources], [names[t] for t in targets]
    for name, matrix in matrices.items():
        with whole_file(batch.folder / f"{name}.csv") as file:
            table = csv.writer(file, lineterminator="\n")
            table.writerow(("source", *map(_cell, labels[1])))
            for label, row in zip(labels[0], matrix.tolist(), strict=True):
                table.writerow((_cell(label), *("" if np.isnan(v) else v for v in row)))
    if matrices:
        _picture(batch.folder / "distances.png", matrices, *labels)
    summary = {
        "pairs": len(batch),
        "shapes": len(batch.shapes),
        "options": batch.options,
        "done": statuses["done"],
        "failed": statuses["failed"],
        "open": statuses["open"],
        "grades": {grade: grades[grade] for grade in GRADES},
        "failures": failures,
    }
    with whole_file(batch.folder / "report.json") as file:
        file.write(json.dumps(summary, indent=1, ensure_ascii=False) + "\n")
    return summary


def is_report(path: Path) -> bool:
    """Whether a file is one of a report, or the beginning of one."""
    return any(begins_with(path, beginning) for beginning in BEGINNINGS)


def _cell(value):
    """What programs of tables show as it is: text that they would compute begins with an apostrophe."""
    return f"'{value}" if isinstance(value, str) and value.startswith(FORMULA) else value


def _sides(batch):
    """Shapes that are a source, and those that are a target, in the order of the batch."""
    everyone = set(range(batch.everyone))
    sources = everyone | {pair.source for pair in batch.listed}
    targets = everyone | {pair.target for pair in batch.listed}
    return sorted(sources), sorted(targets)


def _shown(path: Path, folder: Path) -> str:
    return (path.relative_to(folder) if path.is_relative_to(folder) else path).as_posix()


def _picture(path, matrices, sources, targets):
    from matplotlib import colormaps
    from matplotlib.figure import Figure

    named = len(sources) <= LABELLED and len(targets) <= LABELLED
    wide, high = (max(3.0, (0.16 if named else 0.05) * min(len(side), 160)) for side in (targets, sources))
    figure = Figure(figsize=((wide + 1.8) * len(matrices), high + 1.8), layout="constrained")
    panels = figure.subplots(1, len(matrices), squeeze=False)[0]
    for axes, (name, matrix) in zip(panels, matrices.items(), strict=True):
        colours = colormaps["viridis"].with_extremes(bad="0.85")
        image = axes.imshow(matrix, cmap=colours, interpolation="nearest", aspect="auto")
        axes.set_title(MATRICES[name], fontsize="medium")
        axes.set_xlabel("target")
        axes.set_ylabel("source")
        if named:
            # A dollar in a name begins no formula.
            look = {"fontsize": 6, "parse_math": False}
            axes.set_xticks(range(len(targets)), map(in_one_line, targets), rotation=90, **look)
            axes.set_yticks(range(len(sources)), map(in_one_line, sources), **look)
        figure.colorbar(image, ax=axes, shrink=0.8)
    pictures.save(figure, path, dpi=120, metadata={"Software": None})
