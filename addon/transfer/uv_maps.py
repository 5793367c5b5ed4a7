# SPDX-License-Identifier: GPL-3.0-or-later
"""UV maps: every target face takes all its UVs from one side of a seam, extrapolated in that side's own
chart.
"""

import numpy as np

from ..mesh_read import UnusableObjectError
from .kind import Kind, Prepared

# Two places are on one side of every seam when the chart of each foretells the other's UV with an error of at
# most a share of their distance (in UV, at the chart's local scale). Across a seam the error is far larger,
# except towards its end, where its two sides meet. A face is suspected early, which costs only the walk
# below; on the walk curvature must not look like a seam: it costs up to 0.36 on half a turn.
SUSPECT_MISS = 0.12
SEAM_MISS = 0.5
# UV differences below this are rounding.
UV_ROUNDING = 1e-5
# Places asked for on the way from a face's centre to its corner, to learn on which side of a seam the corner
# is.
WALK = (0.25, 0.5, 0.75, 0.95)
MOST_UV_MAPS = 8


def names(source):
    return [layer.name for layer in source.data.uv_layers]


def prepare(route, wanted, _options):
    source, target = route.source.data, route.target.data
    room = MOST_UV_MAPS - len(target.uv_layers)
    if sum(name not in target.uv_layers for name in wanted) > room:
        raise UnusableObjectError(
            f"'{route.target.name}' has room for {room} more UV maps only; {MOST_UV_MAPS} are the most there "
            "can be. Remove one"
        )
    carried = {}
    for name in wanted:
        values = np.empty(len(source.loops) * 2, np.float32)
        source.uv_layers[name].uv.foreach_get("vector", values)
        carried[name] = carry_uv(route, values.reshape(-1, 2).astype(np.float64))
    return Prepared(lambda: _write(source, target, carried))


def _write(source, target, carried):
    for name, values in carried.items():
        layer = target.uv_layers.get(name) or target.uv_layers.new(name=name, do_init=False)
        layer.uv.foreach_set("vector", values.astype(np.float32).ravel())
    active = source.uv_layers.active
    if active is not None and active.name in carried:
        target.uv_layers.active = target.uv_layers[active.name]
    for layer in source.uv_layers:
        if layer.active_render and layer.name in carried:
            target.uv_layers[layer.name].active_render = True


class Charts:
    """A UV map as charts: `island` of each triangle, and the affine map from its plane to UV."""

    def __init__(self, route, uv):
        self.uv = uv[route.triangle_corners]
        self.island = triangle_islands(route.triangles, self.uv)
        self.points = route.source_points[route.triangles]
        along, up = self.points[:, 1] - self.points[:, 0], self.points[:, 2] - self.points[:, 0]
        # Rows of the plane's pseudo-inverse: gradients of the second and third barycentric weight.
        aa, ab, bb = (np.einsum("ij,ij->i", x, y) for x, y in ((along, along), (along, up), (up, up)))
        area = aa * bb - ab * ab
        area = np.where(area > 1e-12 * aa * bb, area, np.inf)[:, None]
        second = (bb[:, None] * along - ab[:, None] * up) / area
        third = (aa[:, None] * up - ab[:, None] * along) / area
        du, dv = self.uv[:, 1] - self.uv[:, 0], self.uv[:, 2] - self.uv[:, 0]
        self.jacobian = np.einsum("ia,ib->iab", du, second) + np.einsum("ia,ib->iab", dv, third)
        scale = np.linalg.norm(self.jacobian, axis=(1, 2))
        # A triangle without area says nothing about scale: it takes the middle one.
        usual = np.median(scale[scale > 0.0]) if (scale > 0.0).any() else 0.0
        self.scale = np.where(scale > 0.0, scale, usual)

    def at(self, triangle, points):
        """UV of points in the planes of their triangles, beyond the edges too: (q, 2)."""
        offset = points - self.points[triangle, 0]
        return self.uv[triangle, 0] + np.einsum("qab,qb->qa", self.jacobian[triangle], offset)

    def one_side(self, triangle, uv, points, other_triangle, other_uv, other_points, miss):
        """True where two places lie on one side of every seam."""
        step, way = other_uv - uv, other_points - points
        misses = [
            np.linalg.norm(step - np.einsum("qab,qb->qa", self.jacobian[start], way), axis=1)
            for start in (triangle, other_triangle)
        ]
        scale = np.maximum(self.scale[triangle], self.scale[other_triangle])
        room = miss * scale * np.linalg.norm(way, axis=1) + UV_ROUNDING
        return (self.island[triangle] == self.island[other_triangle]) & (np.maximum(*misses) <= room)


def carry_uv(route, uv):
    """UVs at source corners → UVs at target corners, (c, 2)."""
    charts = Charts(route, uv)
    vertex = route.corner_vertex
    triangle = route.face[vertex]
    point = route.image[vertex]
    carried = np.einsum("qk,qkc->qc", route.barycentric[vertex], charts.uv[triangle])
    following = route.next_corner
    ahead = (triangle[following], carried[following], point[following])
    whole = charts.one_side(triangle, carried, point, *ahead, SUSPECT_MISS)
    straddling = np.unique(route.corner_face[~whole])
    if len(straddling):
        corners = np.flatnonzero(np.isin(route.corner_face, straddling))
        carried[corners] = _from_one_side(route, charts, straddling, corners)
    return carried


def _from_one_side(route, charts, faces, corners):
    """UVs of the corners of straddling faces, each followed from the face's centre along the chart."""
    place = np.searchsorted(faces, route.corner_face[corners])
    centre = route.face_centre[faces]
    triangle, start = route.nearest(centre)
    last_triangle, last_point = triangle[place], start[place]
    last_uv = charts.at(last_triangle, last_point)
    goal = route.image[route.corner_vertex[corners]]
    walking = np.ones(len(corners), bool)
    for share in WALK:
        on = np.flatnonzero(walking)
        step_triangle, step_point = route.nearest(centre[place[on]] + share * (goal[on] - centre[place[on]]))
        step_uv = charts.at(step_triangle, step_point)
        same = charts.one_side(
            last_triangle[on], last_uv[on], last_point[on], step_triangle, step_uv, step_point, SEAM_MISS
        )
        walking[on[~same]] = False
        on = on[same]
        last_triangle[on], last_point[on], last_uv[on] = step_triangle[same], step_point[same], step_uv[same]
    return last_uv + np.einsum("qab,qb->qa", charts.jacobian[last_triangle], goal - last_point)


def triangle_islands(triangles, uv):
    """Number of each triangle's UV island: triangles hang together at a common vertex with a common UV."""
    rounded = np.round(uv.reshape(-1, 2) / UV_ROUNDING).astype(np.int64)
    keys = np.column_stack([triangles.ravel().astype(np.int64), rounded])
    _, spot = np.unique(keys, axis=0, return_inverse=True)
    spot = spot.reshape(-1, 3)
    label = np.arange(spot.max() + 1) if len(spot) else np.zeros(0, np.int64)
    while True:
        # Each triangle pulls its spots down to their lowest label, and labels are followed to their roots.
        lowest = label[spot].min(axis=1)
        lower = label.copy()
        for k in range(3):
            np.minimum.at(lower, label[spot[:, k]], lowest)
            np.minimum.at(lower, spot[:, k], lowest)
        while not np.array_equal(lower, lower[lower]):
            lower = lower[lower]
        if np.array_equal(lower, label):
            return label[spot[:, 0]]
        label = lower


KIND = Kind("uv", "UV Maps", "GROUP_UVS", "Carry UV maps, cut where the source's seams fall", names, prepare)
