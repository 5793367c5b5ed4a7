# SPDX-License-Identifier: GPL-3.0-or-later
"""What can be carried over: a module for each kind of data, its `KIND` listed in `KINDS`."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Generator, Iterable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from typing import Any

import bpy
from bpy.props import BoolProperty

from .. import completion, mesh_read, stored_match
from ..mesh_read import UnusableObjectError
from ..translation import MORE, said
from ..typed import Chosen, Options
from . import (
    armatures,
    attachment,
    attributes,
    colours,
    companions,
    edge_marks,
    joined,
    layouts,
    materials,
    normals,
    partners,
    seam_splits,
    shape_keys,
    textures,
    unwrapping,
    uv_maps,
    vertex_groups,
)
from .actions import actions_from
from .kind import Bodies, Kind, Prepared
from .redirect import redirect
from .route import FigureRoute, Route
from .weights import rigs

__all__ = [
    "KINDS",
    "LASTING",
    "Bodies",
    "Carried",
    "Kind",
    "Prepared",
    "TransferAdjustments",
    "TransferChoice",
    "TransferOptions",
    "carry_all",
    "checked",
    "has_effect",
    "names_of",
    "others",
]

# In the order of the panel, which is the order of writing.
KINDS = (
    vertex_groups.KIND,
    shape_keys.KIND,
    edge_marks.KIND,
    normals.KIND,
    uv_maps.KIND,
    materials.KIND,
    colours.KIND,
    attributes.KIND,
    textures.KIND,
    armatures.KIND,
    companions.KIND,
)

# Kinds that belong to a character as a whole, however many meshes it has.
OF_FIGURES = (armatures.KIND, companions.KIND)
# Kinds of which each mesh of a target gets all, whichever mesh of the source answers.
OVER_ALL = (vertex_groups.KIND, shape_keys.KIND, *OF_FIGURES)

# The stages in which the target is written to, which cannot be stopped; and how far a transfer is where each
# of them begins: of 76 actions that are fitted the time is half of all.
WRITING, ANIMATING = LASTING = ("Writing", "Fitting the animation")
PREPARED, WRITTEN = 0.5, 0.55

# A figure in a note, apart from those in names.
FIGURE = re.compile(r"(?<![\w'.])\d+(?:\.\d+)?(?![\w'])")

# These classes only bring properties to the property group or operator that inherits them.
TransferOptions: Any = type(
    "TransferOptions",
    (),
    {
        "__doc__": "Every option of every kind.",
        "__annotations__": {name: made for kind in KINDS for name, made in kind.options.items()},
    },
)
TransferKinds: Any = type(
    "TransferKinds",
    (),
    {
        "__doc__": "`use_KIND` chooses a kind.",
        "__annotations__": {
            f"use_{kind.identifier}": BoolProperty(
                name=kind.label, description=kind.description, default=kind.default
            )
            for kind in KINDS
        },
    },
)
TransferFolds: Any = type(
    "TransferFolds",
    (),
    {
        "__doc__": "`open_KIND` lists a kind's items in the panel.",
        "__annotations__": {
            f"open_{kind.identifier}": BoolProperty(
                name="Show", description="Show how this is carried, and each of its items"
            )
            for kind in KINDS
        },
    },
)


# For the operator, each run of which begins with the defaults.
TransferAdjustments: Any = type(
    "TransferAdjustments",
    (),
    {
        "__doc__": "Which kinds go, and every option of every kind.",
        "__annotations__": {
            name: made.function(
                **{**made.keywords, "options": made.keywords.get("options", set()) | {"SKIP_SAVE"}}
            )
            for properties in (TransferKinds, TransferOptions)
            for name, made in properties.__annotations__.items()
        },
    },
)


def checked(settings: Options) -> Chosen:
    """The choice made in the panel, for `carry_all`."""

    def chosen(kind: Kind, name: str) -> bool:
        return getattr(settings, f"use_{kind.identifier}") and not settings.skips(kind.identifier, name)

    return chosen


def names_of(kind: Kind, sources: Sequence[bpy.types.Object]) -> list[str]:
    """What these meshes of a source have of a kind, each name once."""
    if kind is companions.KIND:
        return list(dict.fromkeys(obj.name for obj in companions.hanging_on(sources)))
    return list(dict.fromkeys(name for source in sources for name in kind.names(source)))


def has_effect(name: str, options: Options, bodies: Bodies | None) -> bool:
    """Whether an option of a kind changes anything as the others are set, between these bodies if known."""
    return all(kind.effects[name](options, bodies) for kind in KINDS if name in kind.effects)


@dataclass
class Carried:
    """What a transfer brought: names by the identifier of their kind, words for the artist, and the names of
    actions that came with rigs, keys and objects.
    """

    names: dict[str, list[str]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    actions: list[str] = field(default_factory=list)

    def add(self, other: Carried) -> None:
        """Count what another transfer brought too; a name counts once."""
        for kind, names in other.names.items():
            self.names[kind] = list(dict.fromkeys([*self.names.get(kind, ()), *names]))
        self.notes += other.notes
        self.actions = list(dict.fromkeys([*self.actions, *other.actions]))

    def summary(self) -> str:
        """Words such as "41 groups, 1 UV map, rig, 1 action", in the order of the panel."""
        found = [(kind, len(self.names.get(kind.identifier, ()))) for kind in KINDS]
        words = [kind.counted(count) for kind, count in found if count]
        if self.actions:
            many = len(self.actions)
            words.append(said("{} action", many) if many == 1 else said("{} actions", many))
        return said(", ").join(words)


def carry_all(
    targets: Sequence[bpy.types.Object], name: str, options: Options, chosen: Chosen
) -> Generator[tuple[float, str], None, Carried]:
    """Carry to the meshes of a target all names for which `chosen(kind, name)` holds. All were matched with
    the same source, of which messages speak by this name if it has several.

    A generator: it yields between its steps how far it is, from 0 to 1, and what it does; its value is what
    was `Carried`. Everything is computed before anything is written, so that a kind that cannot be carried
    leaves the target as it was; so does the generator when it is closed before it says one of `LASTING`. Of
    a target of several meshes only that is left out which one of them cannot get.
    """
    for target in targets:
        mesh_read.check_usable(target, as_target=True)
        stored_match.require(target)
    sources = [obj for obj, _, _ in stored_match.sources_of(targets[0])]
    mesh_read.place(bpy.context, _standing(sources, targets))
    with joined.seen(sources, name, targets) as view, ExitStack() as splits:
        routes, told, brought = [], list(view.notes), Carried()
        for target in targets:
            route = Route(target, view)
            route.wanted = _wanted(route, chosen)
            _settle_names(route, options)
            route, words = splits.enter_context(
                seam_splits.split(route, route.wanted[uv_maps.KIND.identifier], options)
            )
            words += splits.enter_context(
                unwrapping.unwrapped(route, route.wanted[textures.KIND.identifier], options)
            )
            routes.append(route)
            told += ((target, note) for note in words)
        figure = routes[0]
        if len(routes) > 1:
            figure = FigureRoute(targets, view)
            figure.wanted, figure.sides = routes[0].wanted, routes[0].sides
            figure.uv_names = routes[0].uv_names
        told += yield from _prepare(routes, figure, options, brought)
        yield PREPARED, WRITING
        ways = list(dict.fromkeys([*routes, figure]))
        for way in ways:
            for part in way.prepared:
                part.write()
        for target in targets:
            target.data.update()
        if any(figure.wanted[kind.identifier] for kind in (shape_keys.KIND, *OF_FIGURES)):
            for share in redirect(figure, routes):
                yield WRITTEN + (1.0 - WRITTEN) * share, ANIMATING
        animated = list(_animated(figure, routes, brought))
        brought.actions = list(
            dict.fromkeys(name for given, own in animated for name in actions_from(given, own))
        )
        told += ((figure.target, note) for note in _halves(figure))
        told += ((way.target, note) for way in ways for part in way.prepared for note in part.notes)
        brought.notes = said_once(told)
        return brought


def _animated(
    figure: Route, routes: Sequence[Route], brought: Carried
) -> Iterator[tuple[bpy.types.ID, bpy.types.ID]]:
    """What of the source may be animated, and what was made from it on the target."""
    for rig in rigs(figure.source):
        own = armatures.fitted_rig(figure.target, rig)
        if own is not None and rig.name in brought.names.get(armatures.KIND.identifier, ()):
            yield rig, own
    for companion in companions.hanging(figure.source):
        copy = attachment.copy_of(figure.target, companion)
        if copy is not None and companion.name in brought.names.get(companions.KIND.identifier, ()):
            yield companion, copy
    if shape_keys.KIND.identifier in brought.names:
        for route in routes:
            for keys in (piece.data.shape_keys for piece in route.view.pieces):
                if keys is not None and route.target.data.shape_keys is not None:
                    yield keys, route.target.data.shape_keys


def said_once(pairs: Iterable[tuple[bpy.types.Object, str]]) -> list[str]:
    """Words about meshes, in pairs (mesh, words): what is the same of several, but for its figures, is said
    once, of the one with the largest figures and how many more there are.
    """
    told: dict[str, list[tuple[tuple[float, ...], str, str]]] = {}
    for obj, words in pairs:
        words = words.replace(f"'{obj.name}'", "\0")
        figures = tuple(map(float, FIGURE.findall(words)))
        told.setdefault(FIGURE.sub("", words), []).append((figures, obj.name, words))
    notes = []
    for alike in told.values():
        _, name, words = max(alike, key=lambda each: each[0])
        more = others(len({other for _, other, _ in alike}) - 1)
        notes.append(words.replace("\0", f"'{name}'{more}"))
    return notes


def said_of_targets(told: Sequence[tuple[Collection[str], Sequence[str]]]) -> list[str]:
    """Notes on several targets, in pairs (names of what each has, notes): what is the same of several, but
    for these names and for figures, is said once, of the one with the largest figures, and of how many.
    """
    alike: dict[tuple[str, int], list[tuple[tuple[float, ...], str]]] = {}
    for names, notes in told:
        counts: Counter[str] = Counter()
        for note in notes:
            words = _without(names, note)
            figures = tuple(map(float, FIGURE.findall(words)))
            key = FIGURE.sub("", words)
            alike.setdefault((key, counts[key]), []).append((figures, note))
            counts[key] += 1
    worst = [(max(each, key=lambda note: note[0])[1], len(each)) for each in alike.values()]
    return [note if many == 1 else f"{note} (on {many} targets)" for note, many in worst]


def _without(names: Iterable[str], words: str) -> str:
    """Words without these names, without the numbers that Blender adds where another object has one, and
    without how many others a name stands for.
    """
    for name in sorted(names, key=len, reverse=True):
        words = re.sub(rf"(?<!\w){re.escape(name)}(?!\w)", "\0", words)
    return re.sub(rf"(?<=\w)\.\d\d\d\b|{MORE}\b", "", words)


def others(many: int) -> str:
    """Words after the name of a mesh that stands for so many others too."""
    if many == 0:
        return ""
    return " and 1 more mesh" if many == 1 else f" and {many} more meshes"


def _wanted(route: Route, chosen: Chosen) -> dict[str, list[str]]:
    """Chosen names by kind: what belongs to the whole figure, else what the pieces have that answer."""
    wanted = {}
    for kind in KINDS:
        names = kind.names(route.source)
        if len(route.view.pieces) > 1 and kind not in OVER_ALL:
            there = names_of(kind, route.answering)
            names = [name for name in names if name in there]
        wanted[kind.identifier] = [name for name in names if chosen(kind, name)]
    return wanted


def _settle_names(route: Route, options: Options) -> None:
    """Under which names the target gets what is carried."""
    route.sides = partners.sides(route, options)
    maps = route.wanted[uv_maps.KIND.identifier]
    known = {given: own for own, given in layouts.carried_maps(route.target.data).items()}
    route.uv_names = known | layouts.names_on_target(route.source, route.target, maps, options.replace_uv)
    _check_twins(route)


def _prepare(
    routes: Sequence[Route], figure: Route, options: Options, brought: Carried
) -> Generator[tuple[float, str], None, list[tuple[bpy.types.Object, str]]]:
    """Have every kind prepare what it carries: to each mesh, or to the whole figure at once.

    A generator as `carry_all`, of pairs of a mesh and why it does not get something.
    """
    refused, steps = [], []
    for route in dict.fromkeys([*routes, figure]):
        for kind in KINDS:
            fits = route in ([figure] if kind in OF_FIGURES else routes)
            if fits and route.wanted[kind.identifier]:
                steps.append((route, kind))
    for number, (route, kind) in enumerate(steps):
        yield PREPARED * number / len(steps), kind.label
        names = route.wanted[kind.identifier]
        try:
            route.prepared.append(kind.prepare(route, names, options))
            if arrived := [name for name in names if name not in route.prepared[-1].left_out]:
                brought.add(Carried({kind.identifier: arrived}))
        except UnusableObjectError as reason:
            if len(routes) == 1:
                raise
            refused.append((route.target, str(reason)))
    if refused and not any(route.prepared for route in [*routes, figure]):
        raise UnusableObjectError("\n".join(said_once(refused)))
    return refused


def _standing(
    sources: Sequence[bpy.types.Object], targets: Sequence[bpy.types.Object]
) -> list[bpy.types.Object]:
    """All bodies with their rigs, what they are mirrored about and what hangs on them."""
    bodies = [*sources, *targets]
    moving = [rig for body in bodies for rig in rigs(body)]
    mirrors = [obj for body in bodies for obj in completion.mirror_objects(body)]
    return [*bodies, *moving, *mirrors, *companions.hanging_on(sources), *companions.hanging_on(targets)]


def _halves(route: Route) -> list[str]:
    """A note when a modifier adds a half to the target, by whose surface no objects can be placed."""
    if not (route.wanted[companions.KIND.identifier] and route.target_mirrors):
        return []
    return [
        f"'{route.target.name}' is completed by a Mirror modifier, and the map knows its modelled half "
        "alone. Objects of the other half may lie beside it: apply the modifier and match again, or "
        "symmetrize them"
    ]


def _check_twins(route: Route) -> None:
    """Raise `UnusableObjectError` for a vertex group and an attribute of one name.

    Blender makes the group beside the attribute, but no attribute beside the group, which is written first.
    """
    layers = route.wanted[colours.KIND.identifier] + route.wanted[attributes.KIND.identifier]
    groups, _ = route.sides.of_all(route.wanted[vertex_groups.KIND.identifier])
    for name in groups.values():
        if name in layers and name not in route.target.data.attributes:
            raise UnusableObjectError(
                f"'{route.source.name}' brings both a vertex group and an attribute named '{name}', which "
                f"'{route.target.name}' cannot get at once. Rename one of the two"
            )
