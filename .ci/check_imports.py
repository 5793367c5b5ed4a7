"""The core's rooms import only rooms above them, and no two of its files import one another in a circle.

    python .ci/check_imports.py

The order is that in which data flow. Code of unit tests does not count. Exit status 1 when an import points
the other way.
"""

import re
import sys
from collections import defaultdict
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

SOURCE = Path(__file__).resolve().parent.parent / "rust" / "core" / "src"
ROOMS = (
    "error",
    "watch",
    "settings",
    "algebra",
    "mesh",
    "envelope",
    "spectrum",
    "geodesics",
    "deformation",
    "shape",
    "baselines",
    "matching::settings",
    "matching::problem",
    "matching::search",
    "matching::refinement",
    "matching::ranking",
    "matching::symmetry",
    "matching::standing",
    "matching::detail",
    "matching::result",
    "matching::completed",
    "matching::partial",
    "matching",
    "transfer",
    "figure",
    "memory",
)


def module(path: Path) -> str:
    parts = path.relative_to(SOURCE).with_suffix("").parts
    return "::".join(parts[:-1] if parts[-1] == "mod" else parts)


def code(path: Path) -> str:
    """Without unit tests and comments."""
    return re.sub(r"//.*", "", path.read_text().split("#[cfg(test)]\nmod tests")[0])


def imports(name: str, text: str, known) -> set[str]:
    """Modules that a module names, but for those that it is in or that are in it."""
    parent = name.rpartition("::")[0]
    found = set()
    for root, rest in re.findall(r"\b(crate|super)((?:::\w+)+)", text):
        parts = (parent.split("::") if root == "super" and parent else []) + rest[2:].split("::")
        while parts and "::".join(parts) not in known:
            parts.pop()
        other = "::".join(parts)
        if other and not f"{name}::".startswith(f"{other}::") and not other.startswith(f"{name}::"):
            found.add(other)
    return found


def room(name: str) -> int:
    """Place of the innermost room that a module is in."""
    while name not in ROOMS:
        name, _, last = name.rpartition("::")
        if not name:
            sys.exit(f"{last} is in no room: add it to ROOMS in {__file__}")
    return ROOMS.index(name)


def main() -> int:
    paths = {module(path): path for path in sorted(SOURCE.rglob("*.rs"))}
    for outside in ("lib", "testing"):
        paths.pop(outside)
    graph = {name: imports(name, code(path), paths) for name, path in paths.items()}
    wrong = [f"{a} imports {b}" for a in graph for b in sorted(graph[a]) if room(a) < room(b)]
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        wrong.append("a circle: " + " → ".join(error.args[1]))
    rooms = defaultdict(set)
    for a, others in graph.items():
        rooms[room(a)] |= {room(b) for b in others} - {room(a)}
    print(f"{len(rooms)} rooms, {sum(map(len, rooms.values()))} arrows between them")
    print("\n".join(wrong) or "every import points up the list, without a circle")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
