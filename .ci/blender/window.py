# SPDX-License-Identifier: GPL-3.0-or-later
"""Drive Blender's window from inside: a generator of steps, real mouse and keys, pictures of the screen.

A step function yields the seconds that the window may have before it goes on; see `workflow.py`.
Buttons of the sidebar are found by resting the pointer on them and pressing Ctrl C, which copies the Python
command behind a button; so nothing depends on where a theme or a version draws them.
"""

import os
import subprocess
import sys
import time
import traceback

import bpy

HEIGHT = int(os.environ["SCREEN_HEIGHT"])
# Pixels between two places where the sidebar is asked for a button; the lowest button is 18 high.
ROW = 9
# Distances below a button at which the header of the next panel may be.
HEADERS = range(22, 96, 10)
# Above it is the tab's own header.
FIRST_ROW = 36

# Function keys by their codes: for their names other keys would be pressed too.
FUNCTION_KEYS = {f"F{number}": str(66 + number) for number in range(1, 11)}

# Where buttons were seen last: share of the width → command → pixels from the sidebar's top.
_seen = {}


def run(steps):
    """Step through the generator on a timer, then end Blender: status 0, or 1 after an exception."""
    bpy.context.preferences.view.show_splash = False
    _quiet_copying()
    going = steps()

    def step():
        try:
            return float(next(going))
        except StopIteration:
            leave(0)
        except BaseException:
            traceback.print_exc()
            picture("failed")
            leave(1)

    bpy.app.timers.register(step, first_interval=2.0)


def _quiet_copying():
    """Ctrl C over anything else than a button would write the selected objects to a file."""
    for keymap in bpy.context.window_manager.keyconfigs.user.keymaps:
        for item in keymap.keymap_items:
            if item.idname == "view3d.copybuffer":
                item.active = False


def leave(status):
    # Quitting would ask whether to save.
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)


def until(condition, what, seconds=60.0):
    """`yield from until(...)`: wait for a fact; software OpenGL has no fixed times."""
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            raise TimeoutError(f"waited {seconds} s for: {what}")
        yield 0.1


def redrawn():
    """`yield from redrawn()`: let everything be drawn."""
    for _ in range(3):
        for area in bpy.context.window_manager.windows[0].screen.areas:
            area.tag_redraw()
        yield 0.3


def picture(name):
    path = os.path.join(os.environ["PICTURES"], f"{name}.png")
    subprocess.run(["import", "-silent", "-window", "root", path], check=True)


def shot(name):
    """`yield from shot(name)`: rest the pointer where nothing lights up, and take a picture."""
    pointer(*point("WINDOW", 420, 40))
    yield from redrawn()
    picture(name)
    print("PICTURE", name)


def view():
    """Context of the first 3D viewport, for `temp_override`."""
    window = bpy.context.window_manager.windows[0]
    area = next(area for area in window.screen.areas if area.type == "VIEW_3D")
    return {"window": window, "screen": window.screen, "area": area, "region": region("WINDOW")}


def region(kind):
    window = bpy.context.window_manager.windows[0]
    area = next(area for area in window.screen.areas if area.type == "VIEW_3D")
    return next(region for region in area.regions if region.type == kind)


def open_tab(name):
    """`yield from open_tab("Match")`: the tab can be chosen only after the sidebar was drawn once."""
    view()["area"].spaces.active.show_region_ui = True
    yield from redrawn()
    region("UI").active_panel_category = name
    yield from redrawn()


def point(kind, x, y_from_top):
    """Screen pixel of a place in a region, given from its upper left corner."""
    place = region(kind)
    return place.x + x, HEIGHT - (place.y + place.height) + y_from_top


def pointer(x, y):
    # Blender wants to see the pointer arrive.
    for way in (4, 0):
        subprocess.run(["xdotool", "mousemove", str(int(x) - way), str(int(y))], check=True)
        time.sleep(0.03)


def click(x, y, button=1):
    pointer(x, y)
    subprocess.run(["xdotool", "mousedown", str(button), "sleep", "0.1", "mouseup", str(button)], check=True)


def key(*names):
    subprocess.run(["xdotool", "key", *(FUNCTION_KEYS.get(name, name) for name in names)], check=True)


def _command_at(share, row):
    """`yield from`: the command of the button at this place of the sidebar, "" where there is none."""
    bpy.context.window_manager.clipboard = ""
    x, y = (str(int(value)) for value in point("UI", (region("UI").width - 24) * share, row))
    subprocess.run(
        ["xdotool", "mousemove", str(int(x) - 4), y, "mousemove", x, y, "key", "ctrl+c"], check=True
    )
    yield 0.12
    found = bpy.context.window_manager.clipboard
    if found:
        _seen.setdefault(share, {})[found] = row
    return found


def find(command, share=0.5, *, below=0):
    """`yield from`: how far from the sidebar's top the button with this command is, or None.

    `share` is how far across the width it is looked for, first where it was seen last and around there.
    """
    known = next((row for text, row in _seen.get(share, {}).items() if command in text), 0)
    rows = range(max(below, FIRST_ROW), region("UI").height, ROW)
    for row in sorted(rows, key=lambda row: abs(row - known)):
        if command in (yield from _command_at(share, row)):
            return row
    return None


def is_at(command, row, share=0.5, *, asked=10):
    """`yield from`: whether the button with this command is at this row; a busy window answers late."""
    for _ in range(asked):
        if command in (yield from _command_at(share, row)):
            return True
    return False


def press(command, share=0.5):
    """`yield from`: click the button with this command."""
    row = yield from find(command, share)
    assert row is not None, f"no button for {command}"
    click(*point("UI", (region("UI").width - 24) * share, row))
    yield 0.3


def open_panel(after, reveals, share=0.5, *, distances=HEADERS):
    """`yield from`: open the panel whose header follows the button `after`, and so the button `reveals`.

    Where several headers follow it, `distances` tells where the wanted one is.
    """
    if (yield from find(reveals, share)) is not None:
        return
    start = yield from find(after)
    assert start is not None, f"no button for {after}"
    for distance in distances:
        click(*point("UI", 70, start + distance))
        yield from redrawn()
        if (yield from find(reveals, share, below=start)) is not None:
            return
    raise AssertionError(f"no panel with {reveals} after {after}")


def close_panel(first):
    """`yield from`: fold the panel whose uppermost button is `first`."""
    start = yield from find(first)
    assert start is not None, f"no button for {first}"
    for distance in HEADERS:
        click(*point("UI", 70, start - distance))
        yield from redrawn()
        if first not in (yield from _command_at(0.5, start)):
            return
    raise AssertionError(f"no panel with {first}")
