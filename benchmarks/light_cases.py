"""The lights that are proved one by one: every type and option that Cycles and the bake share.

Each case fills an empty Blender scene with one light above the box `BOUNDS_MIN` … `BOUNDS_MAX`, and
where it says so with a plate that casts a shadow into it. No light lies inside the box: there the
variance of a cell's mean is infinite.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import bpy
import numpy as np

from ivg_addon.core.scene import Geometry

BOUNDS_MIN = (-1.0, -1.0, 0.0)
BOUNDS_MAX = (1.0, 1.0, 1.5)
RESOLUTION = (8, 8, 6)

COLOR = (0.9, 0.5, 0.2)
LOCATION = (0.35, -0.25, 2.3)
ROTATION = (0.35, 0.25, 0.6)
SHADING = (0.2, -0.1, 1.85)
ASIDE = (1.4, 1.3, -0.4)
"""Where the plate lies, tiny, when it is to shade nothing but the world; the bake needs some geometry."""
BLACK = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Case:
    """One light: its name, and what makes it and returns the scene's triangles."""

    name: str
    build: Callable[[], Geometry]
    emission: tuple[float, float, float] = (0.0, 0.0, 0.0)


def light(
    kind: str,
    *,
    plate: bool = False,
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0),
    **settings: object,
) -> Callable[[], Geometry]:
    """Return what makes a light datablock with some settings."""

    def build() -> Geometry:
        data = bpy.data.lights.new("Light", kind)
        data.color = COLOR
        data.energy = 3.0 if kind == "SUN" else 100.0
        for name, value in settings.items():
            setattr(data, name, value)
        item = bpy.data.objects.new("Light", data)
        item.location, item.rotation_euler, item.scale = LOCATION, ROTATION, scale
        bpy.context.scene.collection.objects.link(item)
        return _plate(0.35, SHADING, BLACK) if plate else _plate(0.02, ASIDE, BLACK)

    return build


def world(*, plate: bool = False) -> Callable[[], Geometry]:
    """Return what makes a world of one colour."""

    def build() -> Geometry:
        made = bpy.data.worlds.new("World")
        background = made.node_tree.get_output_node("CYCLES").inputs["Surface"].links[0].from_node
        background.inputs["Color"].default_value = (*COLOR, 1.0)
        background.inputs["Strength"].default_value = 0.7
        bpy.context.scene.world = made
        return _plate(0.8, SHADING, BLACK) if plate else _plate(0.02, ASIDE, BLACK)

    return build


EMISSIVE = (4.0, 1.5, 0.5)


def emissive_mesh() -> Geometry:
    """Make a tilted square that shines from both sides."""
    return _plate(0.4, LOCATION, EMISSIVE)


def _plate(half: float, location: tuple[float, float, float], radiance: tuple[float, float, float]) -> Geometry:
    """Make a tilted square of black, or shining, material; return its two triangles."""
    rotation = np.array([[0.8, 0.36, 0.48], [0.0, 0.8, -0.6], [-0.6, 0.48, 0.64]])
    corners = half * np.array([(-1.0, -1.0, 0.0), (1.0, -1.0, 0.0), (1.0, 1.0, 0.0), (-1.0, 1.0, 0.0)])
    vertices = (corners @ rotation.T + location).astype(np.float32)
    data = bpy.data.meshes.new("Plate")
    data.from_pydata(vertices.tolist(), [], [(0, 1, 2, 3)])
    data.materials.append(_emission(radiance))
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Plate", data))
    triangles = np.array([(0, 1, 2), (0, 2, 3)], dtype=np.int32)
    normal = np.cross(vertices[1] - vertices[0], vertices[2] - vertices[0])
    return Geometry(
        vertices=vertices,
        triangles=triangles,
        corner_normals=np.broadcast_to(normal / np.linalg.norm(normal), (2, 3, 3)).astype(np.float32),
        uvs=np.zeros((2, 3, 2), dtype=np.float32),
        material=np.zeros(2, dtype=np.int32),
        object=np.zeros(2, dtype=np.int32),
    )


def _emission(radiance: tuple[float, float, float]) -> bpy.types.Material:
    """Return a material that emits, and reflects nothing."""
    made = bpy.data.materials.new("Plate")
    tree = made.node_tree
    tree.nodes.clear()
    shader = tree.nodes.new("ShaderNodeEmission")
    shader.inputs["Color"].default_value = (*radiance, 1.0)
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(shader.outputs["Emission"], output.inputs["Surface"])
    return made


def _area_cases() -> list[Case]:
    sizes = {
        "RECTANGLE": {"size": 0.5, "size_y": 0.9},
        "SQUARE": {"size": 0.6},
        "DISK": {"size": 0.6},
        "ELLIPSE": {"size": 0.5, "size_y": 0.9},
    }
    return [
        Case(
            f"area {shape.lower()}, spread {spread}°",
            light("AREA", shape=shape, spread=math.radians(spread), **size),
        )
        for shape, size in sizes.items()
        for spread in (180, 90, 20)
    ]


def _point_cases() -> list[Case]:
    shapes = {
        "exact point": {"shadow_soft_size": 0.0},
        "sphere": {"shadow_soft_size": 0.25, "use_soft_falloff": False},
        "soft falloff": {"shadow_soft_size": 0.25, "use_soft_falloff": True},
    }
    cases = [Case(f"point, {name}", light("POINT", **shape)) for name, shape in shapes.items()]
    for name, shape in shapes.items():
        for blend in (0.0, 0.15, 1.0):
            spot = {"spot_size": math.radians(65.0), "spot_blend": blend, **shape}
            cases.append(Case(f"spot, {name}, blend {blend:g}", light("SPOT", **spot)))
    return cases


CASES = (
    *_area_cases(),
    *_point_cases(),
    *(Case(f"sun, {angle}°", light("SUN", angle=math.radians(angle))) for angle in (0, 5, 60)),
    Case("mesh, both sides", emissive_mesh, EMISSIVE),
    Case("world, one colour", world()),
    Case(
        "area rectangle, scaled (0.5, 2, 1)",
        light("AREA", shape="RECTANGLE", size=0.5, size_y=0.4, scale=(0.5, 2.0, 1.0)),
    ),
    Case("area disk, spread 4°", light("AREA", shape="DISK", size=0.9, spread=math.radians(4.0))),
    Case("area disk, parallel", light("AREA", shape="DISK", size=0.9, spread=0.0)),
    Case("area square, not normalised", light("AREA", shape="SQUARE", size=0.6, normalize=False, energy=40.0)),
    Case(
        "spot, scaled (1, 2, 1.5)",
        light("SPOT", spot_size=1.0, spot_blend=0.4, shadow_soft_size=0.1, scale=(1.0, 2.0, 1.5)),
    ),
    Case("point, not normalised", light("POINT", shadow_soft_size=0.25, normalize=False, energy=60.0)),
    Case(
        "point, temperature and exposure",
        light("POINT", shadow_soft_size=0.0, use_temperature=True, temperature=3000.0, exposure=-1.5),
    ),
    Case("sun, 20°, not normalised", light("SUN", angle=math.radians(20.0), normalize=False)),
    Case("area disk, shadow", light("AREA", shape="DISK", size=0.6, plate=True)),
    Case("point, exact point, shadow", light("POINT", shadow_soft_size=0.0, plate=True)),
    Case("point, soft falloff, shadow", light("POINT", shadow_soft_size=0.25, plate=True)),
    Case("point, sphere, shadow", light("POINT", shadow_soft_size=0.25, use_soft_falloff=False, plate=True)),
    Case("sun, 5°, shadow", light("SUN", angle=math.radians(5.0), plate=True)),
    Case("world, shadow", world(plate=True)),
)
