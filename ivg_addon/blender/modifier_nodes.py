# SPDX-License-Identifier: GPL-3.0-or-later
"""The node group of the modifier "IVG Light": irradiance at the points of any geometry, as a colour attribute.

Meshes whose corners at a vertex have different normals (flat faces, sharp edges, custom normals) store it per corner,
others per point, a quarter of the look-ups. What has no surface (curves, points) stores the mean over all normals.
Instances are realised: each has light of its own at each point.
"""

from __future__ import annotations

import bpy

from ..core.grid import DEFAULT_NORMAL_BIAS
from ..core.vdb_grid import RESOLUTION
from .geometry_maths import GeometryMaths
from .marks import KEY
from .node_formulas import Socket
from .volume_nodes import fill_look_up

NAME = "IVG Light"
LOOK_UP_NAME = "IVG Light Look-Up"
FORMAT = "irradiance-vector-grid-modifier"
VERSION = 2
ATTRIBUTE = "ivg_irradiance"
GRID, BIAS, STORED = "Grid", "Normal Bias", "Attribute"
"""Inputs of the modifier."""

_DIFFERENT = 1e-4
"""Distance of two unit normals from which on a vertex has more than one."""
UNREADABLE = "the file of the grid's volume is missing, or holds no grid: objects are black; press Restore in the panel"
"""What a modifier says of its grid."""


def make_group() -> bpy.types.GeometryNodeTree:
    """Return a new node group for modifiers, with the look-up in a group of its own."""
    look_up = bpy.data.node_groups.new(LOOK_UP_NAME, "GeometryNodeTree")
    fill_look_up(look_up)
    tree = bpy.data.node_groups.new(NAME, "GeometryNodeTree")
    tree.is_modifier = True
    tree[KEY] = {"format": FORMAT, "version": VERSION}
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    grid = tree.interface.new_socket(GRID, in_out="INPUT", socket_type="NodeSocketObject")
    grid.description = "Object of the grid's volume; it need not be in the scene"
    bias = tree.interface.new_socket(BIAS, in_out="INPUT", socket_type="NodeSocketFloat")
    bias.default_value, bias.min_value, bias.max_value = DEFAULT_NORMAL_BIAS, 0.0, 4.0
    bias.description = "Look up this many voxels above the surface, where geometry cuts the grid's cells"
    stored = tree.interface.new_socket(STORED, in_out="INPUT", socket_type="NodeSocketString")
    stored.default_value = ATTRIBUTE
    stored.description = "Name of the colour attribute that gets the irradiance, W/m²"
    build = GeometryMaths(tree)
    build.made("NodeGroupOutput", _lit(build, look_up))
    build.arrange()
    return tree


def _lit(build: GeometryMaths, look_up: bpy.types.GeometryNodeTree) -> Socket:
    """Return the geometry with its irradiance."""
    given = build.tree.nodes.new("NodeGroupInput").outputs
    volume = build.made("GeometryNodeObjectInfo", given[GRID], transform_space="ORIGINAL").outputs["Geometry"]
    resolution = build.made("GeometryNodeGetNamedGrid", volume, RESOLUTION, False, data_type="VECTOR").outputs["Grid"]
    found = build.value("GeometryNodeSampleGridIndex", resolution, 0, 0, 0, data_type="VECTOR")
    missing = build.math("LESS_THAN", build.separated(found)[0], 0.5)
    build.made("GeometryNodeWarning", missing, UNREADABLE, warning_type="WARNING")
    itself = build.value("GeometryNodeSelfObject")
    to_world = build.made("GeometryNodeObjectInfo", itself, transform_space="ORIGINAL").outputs["Transform"]
    position = build.value("FunctionNodeTransformPoint", build.value("GeometryNodeInputPosition"), to_world)
    # Normals stay across surfaces under any scale: they go by the inverse, transposed.
    across = build.value("FunctionNodeTransposeMatrix", build.value("FunctionNodeInvertMatrix", to_world))
    own = build.made("GeometryNodeInputNormal").outputs["Normal"]
    normal = build.value("FunctionNodeTransformDirection", own, across)

    def irradiance(n: Socket | tuple[float, ...]) -> Socket:
        return build.value("GeometryNodeGroup", volume, position, n, given[BIAS], node_tree=look_up)

    def store(geometry: Socket, value: Socket, domain: str) -> Socket:
        kind = {"data_type": "FLOAT_COLOR", "domain": domain}
        return build.value("GeometryNodeStoreNamedAttribute", geometry, True, given[STORED], value, **kind)

    parts = build.made(
        "GeometryNodeSeparateComponents", build.value("GeometryNodeRealizeInstances", given["Geometry"])
    ).outputs
    facing, anywhere = irradiance(normal), irradiance((0.0, 0.0, 0.0))
    mesh = parts["Mesh"]
    surface = build.choose(
        "GEOMETRY", _has_edges(build, mesh, own), store(mesh, facing, "CORNER"), store(mesh, facing, "POINT")
    )
    faces = build.made("GeometryNodeAttributeDomainSize", mesh, component="MESH").outputs["Face Count"]
    mesh = build.choose("GEOMETRY", faces, surface, store(mesh, anywhere, "POINT"))
    join = build.tree.nodes.new("GeometryNodeJoinGeometry")
    # Links to one socket are kept in an order of which the last that was made comes first.
    for name in ("Volume", "Grease Pencil"):
        build.feed(join.inputs[0], parts[name])
    for name in ("Point Cloud", "Curve"):
        build.feed(join.inputs[0], store(parts[name], anywhere, "POINT"))
    build.feed(join.inputs[0], mesh)
    return join.outputs[0]


def _has_edges(build: GeometryMaths, mesh: Socket, normal: Socket) -> Socket:
    """Tell whether corners of a mesh have other normals than their vertices."""
    smooth = build.value("GeometryNodeFieldOnDomain", normal, data_type="FLOAT_VECTOR", domain="POINT")
    apart = build.vector("DISTANCE", normal, smooth)
    most = build.made("GeometryNodeAttributeStatistic", mesh, True, apart, data_type="FLOAT", domain="CORNER")
    return build.math("GREATER_THAN", most.outputs["Max"], _DIFFERENT)
