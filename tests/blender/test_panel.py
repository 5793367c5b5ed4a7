# SPDX-License-Identifier: GPL-3.0-or-later
"""What panels draw: buttons that stay in their places, a stop that is said, options that are grey."""

import threading
from collections import Counter
from types import SimpleNamespace

import bpy
import numpy as np
import pytest
from bipeds import Figure, walk
from conftest import choose, lumpy, new_object
from test_textures import Body
from test_transfer import store_identity, transfer
from test_transfer_kinds import photo

from addon import job, manual, notes_panel, notice, outfit_panel, panels, properties, transfer_panel
from addon.operators import carry, fix, match, outfit, running, step
from addon.transfer import KINDS, Bodies, has_effect

BUTTONS = ("spectral_match.match", "spectral_match.transfer")


class Layout:
    """Notes in their order what is drawn, and whether it is grey."""

    def __init__(self, drawn, grey=False):
        self.drawn, self.grey = drawn, grey

    def __setattr__(self, name, value):
        if name == "active":
            name, value = "grey", self.grey or not value
        super().__setattr__(name, value)

    def operator(self, name, **_more):
        self.drawn.append((name, self.grey))
        return SimpleNamespace()

    def prop(self, _data, name, **_more):
        self.drawn.append((name, self.grey))

    def progress(self, **_more):
        self.drawn.append(("progress", self.grey))

    def label(self, text="", **_more):
        self.drawn.append((text, self.grey))

    def __getattr__(self, name):
        return lambda *_given, **_more: Layout(self.drawn, self.grey)


@pytest.fixture
def bodies(scene, monkeypatch):
    """A source with keys, groups and a UV map, and a target that is its copy, matched."""
    source, target = new_object("Source", *lumpy(6)), new_object("Target", *lumpy(6))
    for number in range(8):
        group = source.vertex_groups.new(name=f"Bone {number}")
        group.add(range(len(source.data.vertices)), (1.0 + number) / 36.0, "REPLACE")
    source.data.uv_layers.new(name="UVMap")
    source.shape_key_add(name="Basis")
    source.shape_key_add(name="Smile").data[0].co.z += 0.1
    store_identity(source, target)
    choose(source, target)
    monkeypatch.setattr("addon.drawing.wrapped", lambda text, _fits: [text])
    yield source, target
    notice.clear()


def drawn(panel):
    """What a panel draws, in its order."""
    found = []
    context = SimpleNamespace(
        region=SimpleNamespace(width=280),
        space_data=None,
        **{name: getattr(bpy.context, name) for name in ("scene", "preferences", "view_layer")},
    )
    panel.draw(SimpleNamespace(layout=Layout(found), **panels_own(panel)), context)
    return found


def panels_own(panel):
    return {name: getattr(panel, name) for name in vars(panel) if name.startswith("_draw")}


def test_both_steps_stay_where_they_are(bodies, monkeypatch):
    """Nothing that comes and goes is above them; progress takes the place of the button that was pressed."""

    def above_and_steps():
        names = [name for name, _ in drawn(panels.VIEW3D_PT_spectral_match)]
        steps = [name for name in names if name in (*BUTTONS, "progress")]
        return names[: names.index(steps[0])], steps

    above, steps = before = above_and_steps()
    assert steps == [*BUTTONS]
    notice.say("Something\nis wrong")
    assert above_and_steps() == before
    assert bpy.ops.spectral_match.transfer() == {"FINISHED"} and notice.done is not None
    assert above_and_steps() == before
    for place, button in enumerate(BUTTONS):
        going = job.Job()
        going.button = button
        monkeypatch.setattr(job, "current", going)
        expected = [*BUTTONS]
        expected[place] = "progress"
        assert above_and_steps() == (above, expected)


@pytest.mark.parametrize(
    ("button", "panel"),
    [
        ("spectral_match.swap_sides", panels.VIEW3D_PT_spectral_match_fix),
        ("spectral_match.match", panels.VIEW3D_PT_spectral_match_fix),
        ("spectral_match.alternative", panels.VIEW3D_PT_spectral_match_result),
        ("spectral_match.fit_outfit", outfit_panel.VIEW3D_PT_spectral_match_outfit),
        ("spectral_match.batch", panels.VIEW3D_PT_spectral_match_batch),
    ],
)
def test_progress_is_where_the_button_was_pressed(bodies, monkeypatch, button, panel):
    bodies[1].data.spectral_match.alternatives = 2
    before = [name for name, _ in drawn(panel)]
    place = len(before) - 1 - before[::-1].index(button)
    if button == "spectral_match.alternative":
        # Between two arrows, which stay.
        place -= 1
    assert before[place] == button
    going = job.Job()
    going.button = button
    monkeypatch.setattr(job, "current", going)
    found = [name for name, _ in drawn(panel)]
    assert found[place] == "progress" and found[place + 1] == "spectral_match.cancel"
    del found[place + 1]
    assert [*before[:place], "progress", *before[place + 1 :]] == found
    assert "progress" not in [name for name, _ in drawn(transfer_panel.VIEW3D_PT_spectral_match_transfer)]


def test_a_step_from_a_menu_shows_its_progress_above():
    """There it cannot be folded away; one pressed in the sidebar shows it in place of its button."""

    class Pressed:
        stands_for = running.JobOperator.stands_for

        def execute(self, _context):
            return {"FINISHED"}

    for operator, of_menu in (
        (match.SPECTRAL_MATCH_OT_match, "spectral_match.match"),
        (carry.SPECTRAL_MATCH_OT_transfer, "spectral_match.transfer"),
        (match.SPECTRAL_MATCH_OT_batch, "spectral_match.match"),
        (outfit.SPECTRAL_MATCH_OT_fit_outfit, "spectral_match.match"),
    ):
        for region, expected in (("WINDOW", of_menu), ("UI", operator.bl_idname), (None, of_menu)):
            pressed = type("Pressed", (Pressed,), vars(Pressed) | {"bl_idname": operator.bl_idname})()
            pressed.stands_for = operator.stands_for
            there = None if region is None else SimpleNamespace(type=region)
            operator.invoke(pressed, SimpleNamespace(region=there), None)
            assert pressed.said_at == expected


class Running(running.JobOperator):
    """Reads in two steps, then works until it is let go."""

    told = ()

    def begin(self, _context):
        self.work = threading.Event()
        yield
        yield 0.5, "Reading"
        held = job.Job()
        held._work = lambda _sgmds: self.work.wait()
        return held

    def conclude(self, _context, _job):
        self.warn(self.told)
        return {"FINISHED"}

    def report(self, _kinds, _words):
        """The status bar is not looked at."""


@pytest.mark.parametrize("step", ["", *notice.BESIDE])
def test_what_was_said_goes_when_work_begins(bodies, monkeypatch, step):
    """That an earlier one was stopped, or what it brought; beside a button that says so itself that alone."""
    context = SimpleNamespace(
        region=SimpleNamespace(type="UI"),
        window=None,
        window_manager=SimpleNamespace(
            windows=[],
            event_timer_add=lambda *_given, **_more: None,
            modal_handler_add=lambda _operator: None,
        ),
        workspace=SimpleNamespace(status_text_set=lambda _words: None),
    )
    monkeypatch.setattr(running, "bpy", SimpleNamespace(app=SimpleNamespace(background=False)))
    for told in (["A doubt"], []):
        going = type("Going", (Running,), {"bl_idname": step, "told": told})()
        notice.finish(bpy.context, bodies[1:], lambda: "Done", ["Above"])
        notice.say("Stopped", "INFO", step)
        assert going.invoke(context, None) == {"RUNNING_MODAL"}
        tick = SimpleNamespace(type="TIMER", value="NOTHING")
        for _ in range(5):
            assert (notice.words, notice.beside) == ("Above" if step else "", {})
            assert (notice.done is None) == (not step) and job.current.button == step
            going._follow(context, tick)
        going.work.set()
        job.current.wait()
        assert going._follow(context, tick) == {"FINISHED"}
        words = "\n".join(told)
        above = words if not step else "Above"
        assert notice.words == above and notice.beside == ({step: (words, "ERROR")} if step and told else {})


def test_a_message_of_fit_outfit_is_beside_its_button(bodies):
    """What is below the result stays as high, and the cross takes each away alone."""
    fit, panel = outfit_panel.FIT, outfit_panel.VIEW3D_PT_spectral_match_outfit
    above = notes_panel.VIEW3D_PT_spectral_match_message
    before, names = drawn(above), [name for name, _ in drawn(panel)]
    notice.say("It is torn", step=fit)
    assert drawn(above) == before and not above.poll(bpy.context)
    found = [name for name, _ in drawn(panel)]
    assert found == [fit, "It is torn", "spectral_match.dismiss", *names[1:]] and names[0] == fit
    notice.say("Scale is 0")
    assert not notice.beside
    notice.say("It is torn", step=fit)
    assert bpy.ops.spectral_match.dismiss(step=fit) == {"FINISHED"}
    assert notice.words == "Scale is 0" and [name for name, _ in drawn(panel)] == names


def test_reasons_of_a_match_stay_after_a_transfer(bodies):
    _, target = bodies
    target.data.spectral_match.reasons = "the bodies differ"
    before = drawn(panels.VIEW3D_PT_spectral_match_result)
    assert "The bodies have different proportions" in [words for words, _ in before]
    assert bpy.ops.spectral_match.transfer() == {"FINISHED"}
    assert drawn(panels.VIEW3D_PT_spectral_match_result) == before


def test_what_a_transfer_brought_stays_while_maps_are_gone_through(bodies):
    """With its notes, Before and After; on another map it says with which one it came."""
    stored = bodies[1].data.spectral_match
    stored.identifier, stored.alternatives, stored.alternative = "a match", 3, 1
    assert bpy.ops.spectral_match.transfer() == {"FINISHED"}
    panel = notes_panel.VIEW3D_PT_spectral_match_message
    before = drawn(panel)
    assert before[0][0].startswith("Done: ")

    pressed = type("Pressed", (step.Step,), {"forget": fix.SPECTRAL_MATCH_OT_alternative.forget})()

    def take(number):
        """As the operator does, without the core's maps."""
        pressed.forget()
        stored.alternative = number

    take(2)
    words = "This came with map 2. To use map 3, press Transfer"
    assert drawn(panel) == [before[0], (words, False), *before[1:]]
    take(1)
    assert drawn(panel) == before
    take(2)
    assert bpy.ops.spectral_match.transfer() == {"FINISHED"}
    assert words not in [said for said, _ in drawn(panel)] and notice.done is not None


@pytest.mark.parametrize(
    ("operator", "what"),
    [
        (match.SPECTRAL_MATCH_OT_match, "Match"),
        (carry.SPECTRAL_MATCH_OT_transfer, "Transfer"),
        (outfit.SPECTRAL_MATCH_OT_fit_outfit, "Fitting"),
    ],
)
def test_a_stop_is_said_in_the_panel(bodies, operator, what):
    stopped = match.MatchJob([], [], None, {}) if what == "Match" else job.Job()
    stopped.cancelled = True

    class Pressed(step.Step):
        _done = ()

        def report(self, kinds, words):
            self.told = kinds, words

    pressed = Pressed()
    assert operator.conclude(pressed, bpy.context, stopped) == {"CANCELLED"}
    words = f"{what} stopped; nothing was changed"
    assert pressed.told == ({"INFO"}, words) and (notice.words, notice.icon) == (words, "INFO")
    assert words in [drawn_words for drawn_words, _ in drawn(notes_panel.VIEW3D_PT_spectral_match_message)]


def test_messages_come_and_go_below_the_result(bodies):
    """What is above them stays in its place. What a transfer brought is there too, whatever is folded."""
    message = notes_panel.VIEW3D_PT_spectral_match_message
    order = [cls.bl_order for cls in panels.CLASSES if hasattr(cls, "bl_order")]
    above = panels.CLASSES[: panels.CLASSES.index(message)]
    assert order == sorted(order) and panels.VIEW3D_PT_spectral_match_result in above
    # The lists of pieces are long.
    assert panels.VIEW3D_PT_spectral_match_pieces not in above

    def height():
        shown = (panels.VIEW3D_PT_spectral_match, panels.VIEW3D_PT_spectral_match_result)
        return [drawn(panel) for panel in shown]

    before = height()
    assert not message.poll(bpy.context)
    notice.say("Something\nis wrong")
    assert message.poll(bpy.context) and height() == before
    assert "HIDE_HEADER" in message.bl_options
    notice.finish(bpy.context, bodies[1:], lambda: "Done", ["A note"])
    assert message.poll(bpy.context) and height() == before
    assert {"Done", "open_notes"} <= {words for words, _ in drawn(message)}
    assert "Done" not in [words for words, _ in drawn(transfer_panel.VIEW3D_PT_spectral_match_transfer)]
    notice.say("It failed")
    assert notice.icon == "ERROR"


def grey(bodies):
    """Options of kinds that are drawn grey."""
    found, folds = [], bpy.context.window_manager.spectral_match_panel
    for kind in KINDS:
        setattr(folds, f"open_{kind.identifier}", True)
    transfer_panel.draw_kinds(bpy.context, Layout(found), bodies)
    for kind in KINDS:
        folds.property_unset(f"open_{kind.identifier}")
    shown = {name for kind in KINDS for name in kind.shown}
    return {name for name, is_grey in found if is_grey and name in shown}


def test_every_option_has_a_name_of_its_own():
    """Kinds share one list of properties with the settings of the scene, in which the last of a name wins."""
    names = [name for kind in KINDS for name in kind.options]
    names += [f"{use}_{kind.identifier}" for kind in KINDS for use in ("use", "open")]
    for holder in (properties.SPECTRAL_MATCH_PG_settings, carry.SPECTRAL_MATCH_OT_transfer):
        names += vars(holder)["__annotations__"]
    assert [name for name, count in Counter(names).items() if count > 1] == []


def test_options_without_effect_are_grey(bodies, scene):
    source, target = bodies
    both, settings = Bodies([source], [target]), scene.spectral_match
    settings.use_armature = False
    bare = {"limit", "own_rig", "others_give_way", "replace_uv"}
    assert grey(both) == bare
    settings.limit_total, settings.scale_keys, settings.split_seams = True, False, True
    assert grey(both) == (bare - {"limit"}) | {"keep_contacts", "split_bare"}
    settings.split_seams = False
    target.data.uv_layers.new(name="UVMap")
    assert grey(both) == {"own_rig", "others_give_way", "keep_contacts", "split_bare"}
    # Of a kind that is left out, all.
    settings.use_keys = False
    assert grey(both) >= {"scale_keys", "keep_contacts", "skip_still"}


def test_options_of_rigs_are_grey_without_one(scene):
    source, target = Figure("Source", pose="T"), Figure("Target", "stout", "A", seed=3)
    target.store_known(source)
    rig = source.rigged()
    both = Bodies([source.obj], [target.obj])
    assert {"fit_animation", "own_rig"} <= grey(both) and "others_give_way" not in grey(both)
    walk(rig)
    own = target.rigged()
    assert not {"fit_animation", "own_rig", "others_give_way"} & grey(both)
    # A rig that came from the source is none of the target's own.
    target.obj.modifiers.clear()
    transfer(source.obj, target.obj, kinds="groups,armature")
    assert target.obj.find_armature() not in (rig, own) and "own_rig" in grey(both)


def test_options_of_outfits_and_characters_are_grey_too(bodies, scene):
    source, target = bodies
    settings = scene.spectral_match

    def is_grey(panel, name):
        return dict(drawn(panel))[name]

    outfits, options = outfit_panel.VIEW3D_PT_spectral_match_outfit, panels.VIEW3D_PT_spectral_match_options
    assert is_grey(outfits, "outfit_body_keys") and not is_grey(outfits, "outfit_hide")
    target.shape_key_add(name="Basis")
    assert not is_grey(outfits, "outfit_body_keys")
    # Two meshes by themselves are the same characters in any case; a mesh of several is not.
    assert is_grey(options, "whole_characters") and not is_grey(options, "shape")
    root = bpy.data.objects.new("Root", None)
    bpy.context.collection.objects.link(root)
    source.parent = new_object("Hat", *lumpy(3)).parent = root
    for whole in (True, False):
        settings.whole_characters = whole
        assert not is_grey(options, "whole_characters")


@pytest.mark.parametrize(
    ("kinds", "others", "option"),
    [
        ("groups", {"limit_total": False}, {"limit": (1, 4)}),
        ("keys", {"scale_keys": False}, {"keep_contacts": (False, True)}),
        ("uv", {"split_seams": True}, {"split_bare": (False, True)}),
    ],
)
def test_grey_options_change_nothing(bodies, kinds, others, option):
    source, target = bodies
    ((name, values),) = option.items()
    assert not has_effect(name, SimpleNamespace(**others), None)
    results = []
    for value in values:
        transfer(source, target, kinds=kinds, **others, **{name: value})
        results.append(state(target))
    for first, second in zip(*results, strict=True):
        np.testing.assert_array_equal(first, second)


def test_options_of_layouts_are_grey_where_nothing_is_baked(scene):
    body, settings = Body(photo(64)), scene.spectral_match
    both, sizes = Bodies([body.source], [body.target]), {"bake_size", "bake_margin"}
    assert not (sizes | {"bake_uv"}) & grey(both) and "split_bare" in grey(both)
    body.target.data.uv_layers.remove(body.target.data.uv_layers["Own"])
    # The source's UV map shows its textures.
    assert sizes | {"bake_uv"} <= grey(both) and "split_bare" not in grey(both)
    # It is unwrapped instead.
    settings.bake_unwrap = "OVERLAPS"
    assert {"bake_uv", "split_bare"} <= grey(both) and not sizes & grey(both)
    # For a source without textures it is not.
    body.source.data.materials.clear()
    assert "split_bare" not in grey(both)


def test_textures_alone_are_baked_to_a_target_without_a_layout(scene):
    body, settings = Body(photo(64)), scene.spectral_match
    body.target.data.uv_layers.remove(body.target.data.uv_layers["Own"])
    settings.use_uv = False
    assert not {"bake_size", "bake_margin"} & grey(Bodies([body.source], [body.target]))


@pytest.mark.parametrize(
    ("wish", "name", "values"),
    [
        ("NEEDED", "bake_size", ("512", "1024")),
        ("NEEDED", "bake_margin", (0, 16)),
        ("NEEDED", "bake_uv", ("", "UVMap")),
        ("OVERLAPS", "split_bare", (False, True)),
    ],
)
def test_grey_options_of_layouts_change_nothing(scene, wish, name, values):
    results = []
    for value in values:
        body = Body(photo(64))
        body.target.data.uv_layers.remove(body.target.data.uv_layers["Own"])
        scene.spectral_match.bake_unwrap = wish
        assert not has_effect(name, scene.spectral_match, Bodies([body.source], [body.target]))
        transfer(body.source, body.target, kinds="uv,materials,textures", **{name: value})
        (material,) = body.target.data.materials
        (image,) = (node.image for node in material.node_tree.nodes if node.type == "TEX_IMAGE")
        results.append((*state(body.target), np.array(image.size), np.array(image.pixels[:])))
        for obj in (body.source, body.target):
            bpy.data.objects.remove(obj)
    for first, second in zip(*results, strict=True):
        np.testing.assert_array_equal(first, second)


def state(obj):
    """Weights, keys and UVs of a mesh as arrays."""
    weights = [[(entry.group, entry.weight) for entry in v.groups] for v in obj.data.vertices]
    keys = obj.data.shape_keys
    places = [point.co[:] for block in (keys.key_blocks if keys else ()) for point in block.data]
    layers = [uv.vector[:] for layer in obj.data.uv_layers for uv in layer.uv]
    return np.array(weights).ravel(), np.array(places), np.array(layers), len(obj.data.vertices)


def test_kinds_that_the_source_lacks_are_behind_one_line(bodies, scene):
    for opened in (True, False):
        bpy.context.window_manager.spectral_match_panel.open_lacking = opened
        found = [words for words, _ in drawn(transfer_panel.VIEW3D_PT_spectral_match_transfer)]
        assert "use_keys" in found and "use_armature" not in found
        assert ("Armature" in found) == opened


def test_batch_shows_what_goes_before_a_first_match(scene):
    source = new_object("Source", *lumpy(3))
    source.vertex_groups.new(name="Bone")
    targets = [new_object(name, *lumpy(3)) for name in ("First", "Second")]
    choose(source, *targets)
    found = [words for words, _ in drawn(panels.VIEW3D_PT_spectral_match_batch)]
    assert "Match and transfer the checked data to all 2 selected targets" in " ".join(found)
    assert "use_groups" in found and "use_keys" not in found


def test_manual_and_reports_have_buttons_where_there_is_a_website(monkeypatch):
    for address, count in (("https://example.org/", 2), ("", 0)):
        monkeypatch.setattr(manual, "website", lambda address=address: address)
        found = []
        manual.draw_links(Layout(found))
        assert [name for name, _ in found] == ["wm.url_open"] * count
