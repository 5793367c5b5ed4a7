"""What the scripts beside this one say of many maps at the end."""

import json

import numpy as np

# Mean error ×100 of a map that is wrong: a limb turned or swapped adds as much.
WRONG_ABOVE = 6


def told(records, kept=None) -> int:
    """Prints errors and grades of the records, writes them to the path `kept`, and returns the exit status:
    1 when a map beyond the bound is graded green."""
    errors = np.array([record["error"] for record in records])
    wrong = errors > WRONG_ABOVE
    trusted = sum(w and record["grade"] == "green" for w, record in zip(wrong, records, strict=True))
    grades = {g: sum(r["grade"] == g for r in records) for g in ("green", "amber", "red")}
    print(
        f"{len(errors)} pairs: mean {errors.mean():.2f}, median {np.median(errors):.2f}, worst "
        f"{errors.max():.2f}; {wrong.sum()} beyond {WRONG_ABOVE}, {trusted} of them green; {grades}"
    )
    if kept:
        with open(kept, "w", encoding="utf-8") as file:
            json.dump(records, file, indent=1)
    return 1 if trusted else 0
