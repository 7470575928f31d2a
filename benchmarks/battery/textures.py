# SPDX-License-Identifier: GPL-3.0-or-later
"""Base colours by image, procedural texture, attribute and coordinate: a floor of them, or many small things."""

from __future__ import annotations

from collections.abc import Callable

import bpy
import numpy as np

from .nodes import Maker, diffuse, material, mix, node, ramp
from .stage import (
    ABOVE,
    FLOOR,
    TESTED,
    Case,
    add_object,
    box_mesh,
    card,
    card_mesh,
    image,
    lamp,
    plain,
    room,
    walls,
    with_floor,
)

_BLUE = (0.1, 0.2, 0.8)
_SAND = (0.8, 0.7, 0.3)


def _image_floor(extension: str = "REPEAT", vector: Maker | None = None, **settings: object) -> Callable[[], object]:
    """Return what makes a floor whose image lies on it two and a half times, and off-centre."""

    def build() -> None:
        picture = {"image": image(TESTED), "extension": extension, "interpolation": "Closest", **settings}
        at = {} if vector is None else {"Vector": vector}
        room(material(TESTED, diffuse(node("TexImage", settings=picture, **at))))
        layer = bpy.data.meshes[TESTED].uv_layers[0].uv
        uvs = np.empty((len(layer), 2), dtype=np.float32)
        layer.foreach_get("vector", uvs.reshape(-1))
        layer.foreach_set("vector", (2.5 * uvs - (0.6, 0.8)).astype(np.float32).ravel())

    return build


def _plain_image(colorspace: str) -> Callable[[], object]:
    def build() -> None:
        picture = image(TESTED)
        picture.colorspace_settings.name = colorspace
        room(material(TESTED, diffuse(node("TexImage", settings={"image": picture}))))

    return build


def _image_with_holes() -> None:
    """Lay a floor of an image's colours, whose alpha nobody asks for."""
    picture = {"image": image(TESTED, alpha=True), "interpolation": "Closest"}
    room(material(TESTED, diffuse(node("TexImage", settings=picture))))


def _second_map(named: bool) -> Callable[[], object]:
    """Return what makes a floor of two UV maps: renders take the second, editing the first, nodes which they name."""

    def build() -> None:
        at = {"Vector": node("UVMap", settings={"uv_map": "UVMap"})} if named else {}
        room(material(TESTED, diffuse(node("TexImage", settings={"image": image(TESTED)}, **at))))
        data = bpy.data.meshes[TESTED]
        second = data.uv_layers.new(name="Second")
        second.uv.foreach_set("vector", np.full(8, 0.1, dtype=np.float32))
        second.active_render = True

    return build


def _missing_image() -> None:
    picture = bpy.data.images.new(TESTED, 4, 4)
    picture.source, picture.filepath = "FILE", "/nowhere/missing.png"
    room(material(TESTED, diffuse(node("TexImage", settings={"image": picture}))))


def _coloured_floor(domain: str, kind: str) -> Callable[[], object]:
    """Return what makes a floor coloured by an attribute of its mesh."""

    def build() -> None:
        read = (
            node("Attribute", settings={"attribute_name": "Paint"})
            if kind == "Attribute"
            else node("VertexColor", settings={"layer_name": "Paint"})
        )
        data = card_mesh(1.5, material(TESTED, diffuse(read)), cuts=4, name=TESTED)
        paint = data.color_attributes.new("Paint", "FLOAT_COLOR", domain)
        colours = np.random.default_rng(2).uniform(0.05, 0.95, (len(paint.data), 4))
        paint.data.foreach_set("color", colours.astype(np.float32).ravel())
        walls()
        lamp()
        add_object(TESTED, data, location=(0.0, 0.0, FLOOR))

    return build


def _tiles(colour: Callable[[], Maker], paint: Callable[[bpy.types.Object, int], None]) -> Callable[[], object]:
    """Return what makes a floor of 36 boxes that share a mesh, each with a colour of its own."""

    def build() -> None:
        room(plain("Floor", (0.05, 0.05, 0.05)))
        data = box_mesh((0.48, 0.48, 0.1), material(TESTED, diffuse(colour())))
        for index in range(36):
            place = (0.5 * (index % 6) - 1.25, 0.5 * (index // 6) - 1.25, FLOOR + 0.06)
            paint(add_object(f"{TESTED} {index}", data, location=place), index)

    return build


def _random_colour() -> Maker:
    return ramp(node("ObjectInfo", "Random"), (0.0, (0.9, 0.1, 0.1)), (1.0, (0.1, 0.2, 0.9)))


def _own_colour(made: bpy.types.Object, index: int) -> None:
    made.color = (*np.random.default_rng(index).uniform(0.0, 1.0, 3), 1.0)


def _own_property(made: bpy.types.Object, index: int) -> None:
    made["shade"] = float(np.random.default_rng(index).uniform(0.0, 1.0))


def _of(attribute: str, kind: str) -> Maker:
    return node(
        "Attribute", "Fac" if attribute == "shade" else "Color", {"attribute_name": attribute, "attribute_type": kind}
    )


def _instanced() -> None:
    """Lay tiles by a collection's instances, coloured by what the instancing objects say of themselves."""
    room(plain("Floor", (0.05, 0.05, 0.05)))
    tile = add_object(TESTED, box_mesh((0.48, 0.48, 0.1), material(TESTED, diffuse(_of("shade", "INSTANCER")))))
    collection = bpy.data.collections.new("Tiles")
    bpy.context.scene.collection.objects.unlink(tile)
    collection.objects.link(tile)
    for index in range(36):
        holder = add_object(f"Holder {index}", None, instance_type="COLLECTION", instance_collection=collection)
        holder.location = (0.5 * (index % 6) - 1.25, 0.5 * (index // 6) - 1.25, FLOOR + 0.06)
        _own_property(holder, index)


def _instanced_by_nodes() -> None:
    """Lay tiles by geometry nodes: rows of instances, instanced, both with an attribute of the same name."""
    room(plain("Floor", (0.05, 0.05, 0.05)))
    tree = bpy.data.node_groups.new("Tiles", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")

    def made(kind: str, geometry: bpy.types.NodeSocket | None = None, **inputs: object) -> bpy.types.Node:
        """Return a node that takes geometry by its first input."""
        added = tree.nodes.new(f"GeometryNode{kind}")
        if geometry is not None:
            tree.links.new(geometry, added.inputs[0])
        for name, value in inputs.items():
            socket = added.inputs[name.replace("_", " ")]
            if isinstance(value, bpy.types.NodeSocket):
                tree.links.new(value, socket)
            else:
                socket.default_value = value
        return added

    def spread(
        what: bpy.types.NodeSocket, start: tuple[float, ...], step: tuple[float, ...], first: float
    ) -> bpy.types.Node:
        """Instance something on six points with identifiers, and number the instances by an attribute."""
        line = made("MeshLine", Count=6, Start_Location=start, Offset=step)
        index = made("InputIndex").outputs[0]
        number, shade = (tree.nodes.new("ShaderNodeMath") for _ in range(2))
        for line_of, factor, summand in ((number, -7.0, 100.0), (shade, 0.17, first)):
            line_of.operation = "MULTIPLY_ADD"
            tree.links.new(index, line_of.inputs[0])
            line_of.inputs[1].default_value, line_of.inputs[2].default_value = factor, summand
        points = made("SetID", line.outputs[0], ID=number.outputs[0])
        instances = made("InstanceOnPoints", points.outputs[0], Instance=what)
        stored = made("StoreNamedAttribute", instances.outputs[0], Name="shade", Value=shade.outputs[0])
        stored.domain = "INSTANCE"
        return stored

    tile = made("MeshCube", Size=(0.48, 0.48, 0.1)).outputs[0]
    painted = made("SetMaterial", tile, Material=material(TESTED, diffuse(_of("shade", "INSTANCER")))).outputs[0]
    row = spread(painted, (-1.25, 0.0, 0.0), (0.5, 0.0, 0.0), 0.1)
    rows = spread(row.outputs[0], (0.0, -1.25, 0.0), (0.0, 0.5, 0.0), 0.0)
    tree.links.new(rows.outputs[0], tree.nodes.new("NodeGroupOutput").inputs[0])
    host = add_object(TESTED, bpy.data.meshes.new("Nothing"), location=(0.0, 0.0, FLOOR + 0.06))
    host.modifiers.new("Nodes", "NODES").node_group = tree


def _two_materials() -> None:
    """Lay a floor of 16 faces that take turns in two materials, one of them shining."""
    data = card_mesh(1.5, material(TESTED, diffuse(_SAND)), cuts=4, name=TESTED)
    data.materials.append(plain("Other", _BLUE))
    data.polygons.foreach_set("material_index", [index % 2 for index in range(16)])
    walls()
    lamp()
    add_object(TESTED, data, location=(0.0, 0.0, FLOOR))


def _coloured(make: Callable[[], Maker]) -> Callable[[], object]:
    return lambda: with_floor(diffuse(make()))()


def _checker(scale: float = 2.0, **vector: Maker) -> Maker:
    """Return a checker of squares that the cells tell apart."""
    return node("TexChecker", Color1=(0.9, 0.8, 0.4), Color2=(0.02, 0.05, 0.3), Scale=scale, **vector)


CASES = (
    Case("texture: image, repeat", _image_floor()),
    Case("texture: image, extend", _image_floor("EXTEND")),
    Case("texture: image, clip", _image_floor("CLIP")),
    Case("texture: image, mirror", _image_floor("MIRROR")),
    Case("texture: image, linear", _image_floor(interpolation="Linear")),
    Case("texture: image, cubic", _image_floor(interpolation="Cubic")),
    Case(
        "texture: image by Mapping",
        _image_floor(
            vector=node("Mapping", Vector=node("TexCoord", "UV"), Rotation=(0.0, 0.0, 0.5), Scale=(0.7, 0.4, 1.0))
        ),
    ),
    Case("texture: image by Generated", _image_floor(vector=node("TexCoord", "Generated"))),
    Case("texture: image, box projection", _image_floor(projection="BOX", projection_blend=0.2)),
    Case("texture: image, non-colour", _plain_image("Non-Color")),
    Case("texture: image, colour beside holes", _image_with_holes),
    Case("texture: image on the render's UV map", _second_map(False)),
    Case("texture: image on a named UV map", _second_map(True)),
    Case("texture: image that is missing", _missing_image),
    Case("texture: noise", _coloured(lambda: node("TexNoise", "Color", Scale=2.0))),
    Case("texture: checker", _coloured(_checker)),
    Case("texture: brick", _coloured(lambda: node("TexBrick", Color1=_SAND, Color2=_BLUE, Scale=2.0))),
    Case("texture: wave", _coloured(lambda: node("TexWave", Scale=1.0, Distortion=3.0))),
    Case("texture: voronoi", _coloured(lambda: node("TexVoronoi", "Color", Scale=2.0))),
    Case("texture: gradient", _coloured(lambda: node("TexGradient"))),
    Case("texture: magic", _coloured(lambda: node("TexMagic", Scale=2.0))),
    Case("texture: ramp of noise", _coloured(lambda: ramp(node("TexNoise", Scale=2.0), (0.45, _SAND), (0.55, _BLUE)))),
    Case("texture: hue shift", _coloured(lambda: node("HueSaturation", Hue=0.7, Color=_SAND))),
    Case(
        "texture: mixed colours, linear light",
        _coloured(
            lambda: node(
                "Mix",
                "Result_Color",
                {"data_type": "RGBA", "blend_type": "LINEAR_LIGHT", "clamp_result": True},
                Factor_Float=0.7,
                A_Color=node("TexNoise", "Color", Scale=2.0),
                B_Color=_SAND,
            )
        ),
    ),
    *(
        Case(
            f"texture: checker by {output}",
            _coloured(lambda output=output, scale=scale: _checker(scale, Vector=node("TexCoord", output))),
        )
        for output, scale in (("Generated", 2.0), ("Object", 0.7), ("UV", 2.0), ("Normal", 2.0))
    ),
    Case("texture: checker by Position", _coloured(lambda: _checker(0.7, Vector=node("NewGeometry", "Position")))),
    Case(
        "texture: checker by Mapping",
        _coloured(
            lambda: _checker(
                Vector=node("Mapping", Vector=node("TexCoord", "UV"), Rotation=(0.0, 0.0, 0.5), Scale=(2.0, 1.0, 1.0))
            )
        ),
    ),
    Case("texture: attribute of face corners", _coloured_floor("CORNER", "Attribute")),
    Case("texture: attribute of points", _coloured_floor("POINT", "Attribute")),
    Case("texture: Color Attribute node", _coloured_floor("CORNER", "VertexColor")),
    Case("texture: Object Info, random", _tiles(_random_colour, lambda made, index: None)),
    Case("texture: Object Info, colour", _tiles(lambda: node("ObjectInfo", "Color"), _own_colour)),
    Case("texture: attribute of objects", _tiles(lambda: _of("shade", "OBJECT"), _own_property)),
    Case("texture: attribute of instancers", _instanced),
    Case("texture: attribute of instances", _instanced_by_nodes),
    Case("texture: two materials in a mesh", _two_materials),
    Case(
        "texture: albedo above 1",
        lambda: (room(), card(material(TESTED, diffuse((1.5, 0.9, 0.2))), 0.45, ABOVE)),
    ),
    Case(
        "texture: facing as colour",
        with_floor(mix(0.0, diffuse(node("LayerWeight", "Facing", Blend=0.6)), diffuse(_BLUE))),
    ),
    Case(
        "texture: ramp of facing",
        with_floor(diffuse(ramp(node("LayerWeight", "Facing", Blend=0.5), (0.3, _SAND), (0.8, _BLUE)))),
    ),
    Case(
        "texture: ramp of Fresnel in Principled",
        with_floor(
            node(
                "BsdfPrincipled", Base_Color=ramp(node("Fresnel", IOR=1.5), (0.05, _BLUE), (0.4, _SAND)), Roughness=0.4
            )
        ),
    ),
)
