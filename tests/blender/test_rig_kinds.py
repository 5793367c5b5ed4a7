# SPDX-License-Identifier: GPL-3.0-or-later
"""Bones of the usual kinds of rigs find one another, by what they move."""

from itertools import product

import numpy as np
import pytest
import sgmds
from bipeds import _known, _made
from sgmds import characters

SOURCE, TARGET = ("plain", "T", 0), ("stout", "A", 3)
# Names of the bones along each of a biped's, by its side.
KINDS = {
    "MakeHuman": {
        "hips": ["spine05"],
        "chest": ["spine04", "spine03", "spine02", "spine01"],
        "neck": ["neck01", "neck02"],
        "head": ["head"],
        "upper_arm": ["upperarm01.{}", "upperarm02.{}"],
        "forearm": ["lowerarm01.{}", "lowerarm02.{}"],
        "hand": ["wrist.{}"],
        "thigh": ["upperleg01.{}", "upperleg02.{}"],
        "shin": ["lowerleg01.{}", "lowerleg02.{}"],
        "foot": ["foot.{}"],
    },
    "Mixamo": {
        "hips": ["mixamorig:Hips"],
        "chest": ["mixamorig:Spine", "mixamorig:Spine1", "mixamorig:Spine2"],
        "neck": ["mixamorig:Neck"],
        "head": ["mixamorig:Head"],
        "upper_arm": ["mixamorig:{}Arm"],
        "forearm": ["mixamorig:{}ForeArm"],
        "hand": ["mixamorig:{}Hand"],
        "thigh": ["mixamorig:{}UpLeg"],
        "shin": ["mixamorig:{}Leg"],
        "foot": ["mixamorig:{}Foot"],
    },
    "VRM": {
        "hips": ["J_Bip_C_Hips"],
        "chest": ["J_Bip_C_Spine", "J_Bip_C_Chest", "J_Bip_C_UpperChest"],
        "neck": ["J_Bip_C_Neck"],
        "head": ["J_Bip_C_Head"],
        "upper_arm": ["J_Bip_{}_UpperArm"],
        "forearm": ["J_Bip_{}_LowerArm"],
        "hand": ["J_Bip_{}_Hand"],
        "thigh": ["J_Bip_{}_UpperLeg"],
        "shin": ["J_Bip_{}_LowerLeg"],
        "foot": ["J_Bip_{}_Foot"],
    },
    "Rigify": {
        "hips": ["DEF-spine"],
        "chest": ["DEF-spine.001", "DEF-spine.002", "DEF-spine.003"],
        "neck": ["DEF-spine.004", "DEF-spine.005"],
        "head": ["DEF-spine.006"],
        "upper_arm": ["DEF-upper_arm.{}", "DEF-upper_arm.{}.001"],
        "forearm": ["DEF-forearm.{}", "DEF-forearm.{}.001"],
        "hand": ["DEF-hand.{}"],
        "thigh": ["DEF-thigh.{}", "DEF-thigh.{}.001"],
        "shin": ["DEF-shin.{}", "DEF-shin.{}.001"],
        "foot": ["DEF-foot.{}"],
    },
}
SIDES = {"Mixamo": {".L": "Left", ".R": "Right"}}
# Rigify hangs limbs on controls, and these on none of the bones that move the spine.
CONTROLS = {"Rigify": {"upper_arm": "ORG-shoulder.{}", "thigh": "ORG-spine"}}


class Rig:
    """The bones of one kind of rig on a biped: `names`, `parents`, `weights` (vertices, bones), and in
    `part_of` of which of the biped's bones each is which part, counted from its root."""

    def __init__(self, kind, key):
        made = _made(*key)
        self.names, self.parents, self.part_of, columns = [], [], [], []
        last = {}

        def add(name, parent, part, weights):
            self.names.append(name)
            self.parents.append(parent)
            self.part_of.append(part)
            columns.append(weights)
            return len(self.names) - 1

        nothing = np.zeros(len(made.vertices))
        root = add("root", -1, ("", 0), nothing)
        for number, bone in enumerate(characters.SKELETONS["biped"]):
            stem, side = bone.name[:-2], bone.name[-2:]
            if side not in {".L", ".R"}:
                stem, side = bone.name, ""
            if stem not in KINDS[kind]:
                # Ears, snout and tail go with what they hang on.
                last[bone.name] = last[bone.parent]
                columns[last[bone.name]] = columns[last[bone.name]] + made.weights[:, number]
                continue
            spoken = SIDES.get(kind, {".L": "L", ".R": "R"}).get(side, "")
            parent = last.get(bone.parent, root)
            control = CONTROLS.get(kind, {}).get(stem)
            if control is not None:
                parent = add(control.format(spoken), root, ("", 0), nothing)
            names = KINDS[kind][stem]
            start, axis = made.body.starts[number], made.body.ends[number] - made.body.starts[number]
            along = np.clip((made.vertices - start) @ axis / (axis @ axis), 0.0, 1.0)
            middles = (np.arange(len(names)) + 0.5) / len(names)
            for part, (name, share) in enumerate(zip(names, np.eye(len(names)), strict=True)):
                weights = made.weights[:, number] * np.interp(along, middles, share)
                parent = add(name.format(spoken), parent, (bone.name, part), weights)
            last[bone.name] = parent
        self.weights = np.stack(columns, axis=1)


@pytest.mark.parametrize(("given", "own"), list(product(KINDS, KINDS)))
def test_bones_find_those_that_move_the_same(given, own):
    meshes = [(_made(*key).vertices, _made(*key).faces) for key in (SOURCE, TARGET)]
    along = sgmds.SurfaceMap(*meshes, *_known(SOURCE, TARGET))
    one, other = Rig(given, SOURCE), Rig(own, TARGET)
    found = along.bones(one.weights, other.weights, one.parents, other.parents)
    chains = {}
    for number, (bone, _) in enumerate(one.part_of):
        if bone:
            best = found.partners[number] if found.partners[number] >= 0 else found.nearest[number]
            assert other.part_of[best][0] == bone, (one.names[number], other.names[best])
            chains.setdefault(bone, []).append(found.partners[number])
    for bone, partners in chains.items():
        parts = [other.part_of[partner][1] for partner in partners if partner >= 0]
        assert parts == sorted(set(parts)), bone
        assert len(parts) == min(len(partners), sum(part[0] == bone for part in other.part_of)), bone
