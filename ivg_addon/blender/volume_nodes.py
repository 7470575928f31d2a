# SPDX-License-Identifier: GPL-3.0-or-later
"""The trilinear look-up (core/look_up.py) as geometry nodes, of the volume that a grid has (docs/file-format.md).

Positions x are in voxels from the grid's lower corner: vertices are whole numbers.
"""

from __future__ import annotations

from dataclasses import dataclass

import bpy

from ..core.look_up_rules import FULLY_COUNTED, LEAST_DIVIDED, LEAST_SPOKEN, WITHIN
from ..core.vdb_grid import CHANNELS, DIVIDED, PLANE_NORMALS, PLANE_OFFSETS, PLANE_SLACKS, RESOLUTION
from .geometry_maths import GeometryMaths
from .node_formulas import Socket, Value
from .reconstruction_nodes import coefficients

_CORNERS = 8


def fill_look_up(tree: bpy.types.GeometryNodeTree) -> None:
    """Fill an empty tree so that it gives the irradiance at a position in the world, for a normal.

    Of the normal 0 it is the mean over all normals: then E(n) = ½ (F·n + Σ_k D_k·W_k) is Σ_k D_kk/6.
    """
    for name, kind in (
        ("Volume", "NodeSocketGeometry"),
        ("Position", "NodeSocketVector"),
        ("Normal", "NodeSocketVector"),
        ("Normal Bias", "NodeSocketFloat"),
    ):
        tree.interface.new_socket(name, in_out="INPUT", socket_type=kind)
    tree.interface.new_socket("Irradiance", in_out="OUTPUT", socket_type="NodeSocketVector")
    build = GeometryMaths(tree)
    found = _LookUp(build).irradiance()
    build.made("NodeGroupOutput", found)
    build.arrange()


@dataclass(frozen=True)
class _Place:
    """A position x, the first vertex of its voxel, and the least weight of a vertex along an axis."""

    x: Socket
    base: Socket
    least: Value


class _LookUp:
    """The formulas, in the order of `look_up.look_up`."""

    def __init__(self, build: GeometryMaths) -> None:
        self._build = build
        given = build.tree.nodes.new("NodeGroupInput").outputs
        self._volume = given["Volume"]
        self._validity = self._grid("FLOAT", "validity")
        self._planes = [self._grid("VECTOR", name) for name in PLANE_NORMALS]
        self._offsets, self._slacks = self._grid("VECTOR", PLANE_OFFSETS), self._grid("VECTOR", PLANE_SLACKS)
        first = (0.0, 0.0, 0.0)
        self._divided = build.math("GREATER_THAN", self._at("FLOAT", self._grid("FLOAT", DIVIDED), first), 0.5)
        self._top = self._at("VECTOR", self._grid("VECTOR", RESOLUTION), first)
        self._to_world = build.value("GeometryNodeGridInfo", self._validity, data_type="FLOAT")
        to_grid = build.value("FunctionNodeInvertMatrix", self._to_world)
        self._here = self._clamped(build.value("FunctionNodeTransformPoint", given["Position"], to_grid))
        self._n = build.vector("NORMALIZE", given["Normal"])
        self._bias = given["Normal Bias"]

    def irradiance(self) -> Socket:
        """Return E."""
        build, n = self._build, self._n
        away, any_divided = self._step_back()
        here = build.choose("VECTOR", self._divided, away, self._here)
        unlit = build.math("MAXIMUM", build.math("SUBTRACT", 1.0, self._smooth("FLOAT", self._validity, here)), 0.0)
        x = build.vector("ADD", here, build.scaled(n, build.math("MULTIPLY", self._bias, unlit)))
        x = self._clamped(x)
        # Beside a wall not into the next voxel: whose vertices know which side they are on is not known.
        voxel = self._base(here)
        within = build.vector("MINIMUM", build.vector("MAXIMUM", x, voxel), build.vector("ADD", voxel, (1.0,) * 3))
        beside_wall = build.choose("BOOLEAN", self._divided, any_divided, False)
        place = _Place(
            x=build.choose("VECTOR", beside_wall, within, x),
            base=build.choose("VECTOR", beside_wall, voxel, self._base(x)),
            least=build.choose("FLOAT", beside_wall, WITHIN, 0.0),
        )
        return self._blend(here, place, beside_wall)

    def _blend(self, here: Socket, place: _Place, beside_wall: Socket) -> Socket:
        """Return E of the lit vertices around a place, weighted as `look_up.leave_to_speakers` does."""
        build = self._build
        numbers = coefficients(build, self._n)
        rows = [build.combined(*numbers[row : row + 3]) for row in range(0, len(numbers), 3)]
        names = [(part, letter) for part in ("F", "D_x", "D_y", "D_z") for letter in CHANNELS]
        grids = {name: self._grid("VECTOR", "_".join(name)) for name in names}
        number, zone = build.repeat(
            _CORNERS,
            light=("VECTOR", (0.0, 0.0, 0.0)),
            weight=("FLOAT", 0.0),
            heard=("VECTOR", (0.0, 0.0, 0.0)),
            spoken=("FLOAT", 0.0),
        )
        vertex, share = self._corner(number, place)
        weight = build.math("MULTIPLY", share, self._lit(vertex))
        channels = []
        for letter in CHANNELS:
            parts = [
                build.vector("DOT_PRODUCT", self._at("VECTOR", grids[part, letter], vertex), row)
                for part, row in zip(("F", "D_x", "D_y", "D_z"), rows, strict=True)
            ]
            channels.append(
                build.math("ADD", build.math("ADD", parts[0], parts[1]), build.math("ADD", parts[2], parts[3]))
            )
        light = build.scaled(build.combined(*channels), weight)
        speaks = build.choose("FLOAT", beside_wall, self._speaks(vertex, here)[0], 1.0)
        light, weight, heard, spoken = zone.close(
            light=build.vector("ADD", zone["light"], light),
            weight=build.math("ADD", zone["weight"], weight),
            heard=build.vector("ADD", zone["heard"], build.scaled(light, speaks)),
            spoken=build.math("MULTIPLY_ADD", weight, speaks, zone["spoken"]),
        )
        some = build.math("GREATER_THAN", spoken, 0.0)
        light, weight = build.choose("VECTOR", some, heard, light), build.choose("FLOAT", some, spoken, weight)
        e = build.scaled(light, build.math("DIVIDE", 1.0, weight))
        return build.vector("MAXIMUM", e, (0.0, 0.0, 0.0))

    def _step_back(self) -> tuple[Socket, Socket]:
        """Return where `look_up.step_back` goes, and whether walls divide vertices around the position."""
        build, here = self._build, self._here
        place = _Place(here, self._base(here), 0.0)
        number, zone = build.repeat(
            _CORNERS,
            spoken=("FLOAT", 0.0),
            total=("FLOAT", 0.0),
            most=("FLOAT", 0.0),
            wall=("VECTOR", (0.0, 0.0, 0.0)),
            divided=("FLOAT", 0.0),
        )
        vertex, share = self._corner(number, place)
        weight = build.math("MULTIPLY", share, self._lit(vertex))
        speaks, wall, divided = self._speaks(vertex, here)
        silent = build.math("MULTIPLY", weight, build.math("SUBTRACT", 1.0, speaks))
        more = build.math("GREATER_THAN", silent, zone["most"])
        spoken, total, _, wall, divided = zone.close(
            spoken=build.math("MULTIPLY_ADD", weight, speaks, zone["spoken"]),
            total=build.math("ADD", zone["total"], weight),
            most=build.math("MAXIMUM", silent, zone["most"]),
            wall=build.choose("VECTOR", more, wall, zone["wall"]),
            divided=build.math("MULTIPLY_ADD", divided, weight, zone["divided"]),
        )
        lonely = build.math("LESS_THAN", spoken, build.math("MULTIPLY", total, LEAST_SPOKEN))
        away = build.vector("SUBTRACT", here, build.scaled(wall, build.math("MULTIPLY", lonely, 0.5)))
        return self._clamped(away), build.math("GREATER_THAN", divided, LEAST_DIVIDED)

    def _speaks(self, vertex: Socket, x: Socket) -> tuple[Socket, Socket, Socket]:
        """Return, of a vertex, 1 if it speaks for x, the normal of a plane that denies it, and 1 if it has planes."""
        build = self._build
        normals = [self._at("VECTOR", grid, vertex) for grid in self._planes]
        offsets = build.separated(self._at("VECTOR", self._offsets, vertex))
        slacks = build.separated(self._at("VECTOR", self._slacks, vertex))
        speaks: Value = 1.0
        wall: Value = (0.0, 0.0, 0.0)
        # The first plane that denies x decides: it comes last.
        for normal, offset, slack in reversed([*zip(normals, offsets, slacks, strict=True)]):
            distance = build.math("SUBTRACT", build.vector("DOT_PRODUCT", normal, x), offset)
            distance = build.math("MULTIPLY_ADD", slack, build.vector("DOT_PRODUCT", normal, self._n), distance)
            behind = build.math("LESS_THAN", distance, 0.0)
            speaks = build.math("MULTIPLY", speaks, build.math("SUBTRACT", 1.0, behind))
            wall = build.choose("VECTOR", behind, normal, wall)
        divided = build.vector("DOT_PRODUCT", normals[0], normals[0])
        return speaks, wall, divided

    def _corner(self, number: Socket, place: _Place) -> tuple[Socket, Socket]:
        """Return corner `number`, 0 … 7, of a place's voxel, and its trilinear weight."""
        build = self._build
        halves = build.math("FLOOR", build.math("MULTIPLY", number, 0.5))
        quarters = build.math("FLOOR", build.math("MULTIPLY", number, 0.25))
        offset = build.combined(*(build.math("MODULO", value, 2.0) for value in (number, halves, quarters)))
        vertex = build.vector("ADD", place.base, offset)
        apart = build.vector("ABSOLUTE", build.vector("SUBTRACT", vertex, place.x))
        near = build.separated(build.vector("SUBTRACT", (1.0, 1.0, 1.0), apart))
        a, b, c = (build.math("MAXIMUM", number, place.least) for number in near)
        return vertex, build.math("MULTIPLY", build.math("MULTIPLY", a, b), c)

    def _base(self, x: Socket) -> Socket:
        """Return the first vertex of the voxel that x lies in."""
        build = self._build
        last = build.vector("SUBTRACT", self._top, (1.0, 1.0, 1.0))
        return build.vector("MINIMUM", build.vector("FLOOR", x), last)

    def _clamped(self, x: Socket) -> Socket:
        """Return the nearest position in the grid's box."""
        return self._build.vector("MINIMUM", self._build.vector("MAXIMUM", x, (0.0, 0.0, 0.0)), self._top)

    def _lit(self, vertex: Socket) -> Socket:
        """Return how much a vertex counts, by the lit share of its cell."""
        share = self._build.math("DIVIDE", self._at("FLOAT", self._validity, vertex), FULLY_COUNTED)
        return self._build.math("MINIMUM", share, 1.0)

    def _grid(self, kind: str, name: str) -> Socket:
        """Return one of the volume's grids."""
        return self._build.made("GeometryNodeGetNamedGrid", self._volume, name, False, data_type=kind).outputs["Grid"]

    def _at(self, kind: str, grid: Socket, vertex: Value) -> Socket:
        """Return a grid's value at a vertex."""
        whole = self._build.separated(vertex)
        return self._build.value("GeometryNodeSampleGridIndex", grid, *whole, data_type=kind)

    def _smooth(self, kind: str, grid: Socket, x: Socket) -> Socket:
        """Return a grid's trilinear value at x."""
        place = self._build.value("FunctionNodeTransformPoint", x, self._to_world)
        return self._build.value("GeometryNodeSampleGrid", grid, place, "Trilinear", data_type=kind)
