# SPDX-License-Identifier: GPL-3.0-or-later
"""Drive Blender's window from inside: a generator of steps, real mouse and keys, pictures of the screen.

A step function yields the seconds that the window may have before it goes on; see `workflow.py`.
"""

import os
import subprocess
import sys
import time
import traceback

import bpy

HEIGHT = int(os.environ["SCREEN_HEIGHT"])


def run(steps):
    """Step through the generator on a timer, then end Blender: status 0, or 1 after an exception."""
    bpy.context.preferences.view.show_splash = False
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
        yield 0.4


def picture(name):
    path = os.path.join(os.environ["PICTURES"], f"{name}.png")
    subprocess.run(["import", "-silent", "-window", "root", path], check=True)


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


def click(x, y):
    # Blender wants to see the pointer arrive before the button goes down.
    for way in (4, 0):
        subprocess.run(["xdotool", "mousemove", str(int(x) - way), str(int(y))], check=True)
        time.sleep(0.05)
    subprocess.run(["xdotool", "mousedown", "1", "sleep", "0.1", "mouseup", "1"], check=True)


def key(name):
    subprocess.run(["xdotool", "key", name], check=True)
