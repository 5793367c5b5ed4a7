# SPDX-License-Identifier: GPL-3.0-or-later
"""The pages by task: their scripts run as they stand, on small characters, and do what the page says."""

import re
from pathlib import Path

import bpy
import figures
import numpy as np
import pytest
from test_transfer import weights_of

from addon import command_line

TASKS = Path(__file__).resolve().parents[2] / "docs" / "tasks"


def blocks(page, language="python"):
    text = (TASKS / f"{page}.md").read_text(encoding="utf-8")
    found = re.findall(rf"^( *)```{language}\n(.*?)^ *```", text, re.DOTALL | re.MULTILINE)
    return [re.sub(rf"^{indent}", "", block, flags=re.MULTILINE) for indent, block in found]


def follow(page, **names):
    """Run a page's blocks as they stand."""
    for block in blocks(page):
        exec(compile(block, f"{page}.md", "exec"), names)
    return names


@pytest.fixture
def cast(scene):
    """Mia with rig, key, texture and a layout; Bruno with a layout alone."""
    mia = figures.character("Mia")
    bruno = figures.character("Bruno", moved=True, weights=False, rigged=False)
    key = [mia.body.shape_key_add(name=name, from_mix=False) for name in ("Basis", "jawOpen")][1]
    for point in key.data:
        point.co.y -= 0.2 * max(point.co.z, 0.0)
    image = bpy.data.images.new("Paint", 64, 64)
    image.generated_color = (0.8, 0.3, 0.1, 1.0)
    look = bpy.data.materials.new("Painted")
    look.use_nodes = True
    node = look.node_tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    look.node_tree.links.new(
        node.outputs["Color"], look.node_tree.nodes["Principled BSDF"].inputs["Base Color"]
    )
    mia.body.data.materials.append(look)
    for body in (mia.body, bruno.body):
        layer = body.data.uv_layers.new(name=f"{body.name} Layout")
        side = int(np.ceil(np.sqrt(len(body.data.polygons))))
        for number, polygon in enumerate(body.data.polygons):
            for k, loop in enumerate(polygon.loop_indices):
                corner = ((0.1, 0.1), (0.9, 0.1), (0.9, 0.9), (0.1, 0.9))[k]
                place = np.array((number % side, number // side)) + corner
                layer.uv[loop].vector = place / side
    return mia, bruno


def test_index_names_every_page():
    pages = {path.stem for path in TASKS.glob("*.md")} - {"index"}
    index = (TASKS / "index.md").read_text(encoding="utf-8")
    assert set(re.findall(r"\(([a-z-]+)\.md\)", index)) == pages


@pytest.mark.parametrize("page", sorted(path.stem for path in TASKS.glob("*.md") if path.stem != "index"))
def test_every_page_has_five_steps(page):
    text = (TASKS / f"{page}.md").read_text(encoding="utf-8")
    assert re.findall(r"^(\d)\. ", text, re.MULTILINE) == ["1", "2", "3", "4", "5"]
    assert text.count("![") in (2, 3)


@pytest.mark.parametrize("page", ["rig", "outfit", "faces", "lods", "textures", "vrm-gltf"])
def test_every_block_chooses_as_the_index_does(page):
    (choice,) = blocks("index")
    (block,) = blocks(page)
    chosen = choice.split("\n\n")[1].partition("\n")[2]
    assert block.startswith("import bpy\n") and chosen in block


def test_rig(cast):
    mia, bruno = cast
    follow("rig")
    assert bruno.body.find_armature() and bruno.body.find_armature() != mia.rig
    carried = weights_of(bruno.body)
    for vertex in range(0, len(bruno.body.data.vertices), 7):
        wanted = figures.low_share(np.array(mia.body.data.vertices[bruno.old["Body"][vertex]].co)[None])[0]
        # Twice the edge's length along which weights go from 0 to 1 is the least that tells right from wrong.
        assert carried.get((vertex, "Low"), 0.0) == pytest.approx(wanted, abs=0.25)


def test_outfit(cast):
    coat = cast[0].shirt
    coat.name = "Mia Coat"
    follow("outfit")
    assert coat.spectral_match_part == "LEFT_OUT"
    (copy,) = [obj for obj in bpy.data.objects if obj.get("spectral_match_made_from") == "Mia Coat"]
    assert len(copy.data.vertices) == len(coat.data.vertices)


def test_faces(cast):
    mia, bruno = cast
    for made, name in zip(cast, ("Mia", "Bruno"), strict=True):
        made.body.name, made.shirt.name = f"{name} Head", f"{name} Hair"
    follow("faces")
    assert mia.shirt.spectral_match_part == "LEFT_OUT" == bruno.shirt.spectral_match_part
    keys = bruno.body.data.shape_keys.key_blocks
    moved = np.array([(a.co - b.co).length for a, b in zip(keys["jawOpen"].data, keys[0].data, strict=True)])
    wanted = 0.2 * np.maximum([mia.body.data.vertices[k].co.z for k in bruno.old["Body"]], 0.0)
    assert np.corrcoef(moved, wanted)[0, 1] > 0.95


def test_lods(cast):
    bruno = cast[1]
    follow("lods")
    assert {"Low", "High"} <= {group.name for group in bruno.body.vertex_groups}
    assert "jawOpen" in bruno.body.data.shape_keys.key_blocks
    assert "Mia Body Layout" in bruno.body.data.uv_layers


def test_textures(cast):
    bruno = cast[1]
    follow("textures")
    numbers = [polygon.material_index for polygon in bruno.body.data.polygons]
    nodes = bruno.body.data.materials[max(set(numbers), key=numbers.count)].node_tree.nodes
    (image,) = [node.image for node in nodes if node.type == "TEX_IMAGE"]
    assert image.name != "Paint" and tuple(image.size) == (1024, 1024)
    pixels = np.array(image.pixels).reshape(-1, 4)[:, :3]
    painted = np.abs(pixels - (0.8, 0.3, 0.1)).max(axis=1) < 0.02
    # Islands cover 64 % of their cells, and not all cells are used.
    assert painted.mean() > 0.5


def test_vrm_gltf(cast, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for made, name in zip(cast, ("mia", "bruno"), strict=True):
        bpy.ops.object.select_all(action="DESELECT")
        for obj in [*made.pieces, *([made.rig] if made.rig else [])]:
            obj.select_set(True)
        bpy.ops.export_scene.gltf(filepath=f"{name}.glb", use_selection=True)
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    names = {"bpy": bpy}
    for block in blocks("vrm-gltf"):
        exec(compile(block, "vrm-gltf.md", "exec"), names)
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    bpy.ops.import_scene.gltf(filepath="bruno_rigged.glb")
    body = bpy.data.objects["Bruno Body"]
    assert body.find_armature() and {"Low", "High"} <= {group.name for group in body.vertex_groups}


def test_studio(registered, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "cast").mkdir()
    for name, path, options in (
        ("Mia", "hero.blend", {}),
        ("Bruno", "cast/bruno.blend", {"moved": True, "weights": False}),
    ):
        bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
        figures.character(name, **options)
        bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / path))
    (tmp_path / "cast.toml").write_text(blocks("studio", "toml")[0], encoding="utf-8")
    (command,) = re.findall(r"--command spectral_match (.+?)`", (TASKS / "studio.md").read_text())
    assert command_line.run(command.split()) == command_line.DONE
    (made,) = (tmp_path / "dressed").glob("*.blend")
    bpy.ops.wm.open_mainfile(filepath=str(made))
    assert weights_of(bpy.data.objects["Bruno Body"])


def test_researchers():
    first, second = (figures.meshes()["Body"] for _ in range(2))
    faces = np.array([corners for quad in first[1] for corners in (quad[:3], [quad[0], *quad[2:]])])
    names = {"vertices_1": first[0], "faces_1": faces, "vertices_2": second[0], "faces_2": faces}
    for block in blocks("researchers"):
        exec(compile(block, "researchers.md", "exec"), names)
    np.testing.assert_array_equal(names["p2p_21"], np.arange(len(first[0])))
    np.testing.assert_allclose(names["points_21"], first[0], atol=1e-6)
