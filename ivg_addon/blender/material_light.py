# SPDX-License-Identifier: GPL-3.0-or-later
"""A grid's light in materials: put in beside every BSDF that reflects diffusely, and taken out without a trace.

One node follows such a BSDF, wherever in the tree or in a group of it that is: it adds ρ/π E (light_groups.py). So
mixes weight the light as they weight the BSDF. It reads what the BSDF's own inputs read, and E: of a grid at the BSDF's
normal (irradiance_nodes.py), or as the modifier "IVG Light" has stored it. Nothing else is changed: to take the light
out is to link what comes into these nodes to what they go to, whatever has become of the tree meanwhile.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator

import bpy

from ..core.report import Notice, merge
from .export_nodes import ADDED, Input, Output, follow
from .irradiance_formula import BESIDE, OPEN, WALLS
from .light_groups import INPUTS, is_light_group, light_group
from .marks import bears
from .modifier_nodes import ATTRIBUTE

KEY = "ivg_light"
"""Of a material that has the light: which grid's, whether as stored, and how Cycles sampled its emission before."""

_DIFFUSE = {
    "BSDF_DIFFUSE": "DIFFUSE",
    "SUBSURFACE_SCATTERING": "DIFFUSE",
    "BSDF_TOON": "DIFFUSE",
    "BSDF_SHEEN": "SHEEN",
    "BSDF_PRINCIPLED": "PRINCIPLED",
}
"""Kinds of light groups by types of nodes."""
_UNLIT = {
    "BSDF_TRANSLUCENT": "has no light of the grid in EEVEE; Cycles follows its rays to what lies behind",
    "BSDF_HAIR": "gets no light of the grid",
    "BSDF_HAIR_PRINCIPLED": "gets no light of the grid",
    "EEVEE_SPECULAR": "gets no light of the grid: use a Principled BSDF",
}
"""What is said of other nodes that scatter light widely."""
_TARGETS = ("CYCLES", "EEVEE")


def grid_of(material: bpy.types.Material) -> bpy.types.Image | None:
    """Return the image of the grid whose light a material has; None without, or if the grid was removed."""
    return material[KEY].get("grid") if has_light(material) else None


def has_light(material: bpy.types.Material) -> bool:
    """Tell whether a material has a grid's light."""
    return KEY in material


def takes_stored(material: bpy.types.Material) -> bool:
    """Tell whether a material has the light that the modifier has stored, and looks nothing up."""
    return has_light(material) and bool(material[KEY].get("stored"))


def lit_materials() -> list[bpy.types.Material]:
    """Return the file's own materials that have a grid's light."""
    return [material for material in bpy.data.materials if has_light(material) and not material.library]


def add_light(
    materials: Iterable[bpy.types.Material], image: bpy.types.Image, stored: Collection[bpy.types.Material] = ()
) -> tuple[Notice, ...]:
    """Add a grid's light to materials, in place of a grid's that they have; return what is to be said.

    What its BSDFs' inputs read is read anew: so this brings the light up to date with a material that was edited.

    Parameters
    ----------
    stored
        Those that take E from the attribute of the modifier "IVG Light". A node group that others use too looks the
        grid up for all of them.

    Raises
    ------
    GridFileError
        The grid cannot be read by nodes; then nothing was changed.
    """
    chosen = []
    notices = []
    for material in materials:
        wrong = _problem(material)
        notices += [Notice("left out", f"material '{material.name}'", wrong)] if wrong else []
        chosen += [] if wrong else [material]
    looks_up = [material for material in chosen if material not in stored]
    looks_up += [each for each in lit_materials() if each not in chosen and not takes_stored(each)]
    looking = {tree for material in looks_up for tree in _trees(material.node_tree)}
    if any(tree in looking for material in chosen for tree in _trees(material.node_tree)):
        from .irradiance_nodes import irradiance_group

        irradiance_group(image)
    remove_light(chosen)
    filled: set[bpy.types.NodeTree] = set()
    for material in chosen:
        notices += _add(material, image, looking, filled)
        if has_light(material):
            material[KEY]["stored"] = material in stored
    _remove_unused()
    return merge(notices)


def remove_light(materials: Iterable[bpy.types.Material]) -> None:
    """Take a grid's light out of materials, and what then nobody uses out of the file.

    A node group keeps it as long as another material with light uses it.
    """
    chosen = [material for material in materials if has_light(material)]
    others = [material for material in lit_materials() if material not in chosen]
    kept = {tree for material in others for tree in _trees(material.node_tree)}
    for material in chosen:
        for tree in _trees(material.node_tree):
            if tree not in kept and tree.is_editable:
                _clear(tree)
        _restore_sampling(material)
        del material[KEY]
    if chosen:
        _remove_unused()


def _problem(material: bpy.types.Material) -> str:
    """Return why a material cannot be given light, and the cure; empty if it can."""
    if material.library:
        return f"is linked from {material.library.filepath}: add the light there, or make it local"
    if material.override_library:
        return "is a library override, whose nodes cannot be changed: add the light in its own file, or make it local"
    if not material.is_editable:
        return "cannot be changed: make it local"
    if not any(material.node_tree.get_output_node(target) for target in _TARGETS):
        return "has no output node and is black: add a Material Output"
    return ""


def _add(
    material: bpy.types.Material,
    image: bpy.types.Image,
    looking: set[bpy.types.NodeTree],
    filled: set[bpy.types.NodeTree],
) -> Iterator[Notice]:
    """Add light to a material that has none.

    Parameters
    ----------
    looking
        Trees in which the grid is looked up.
    filled
        Groups that have got the light just now, and here those that get it.
    """
    found = _surfaces(material.node_tree)
    trees: dict[bpy.types.NodeTree, _Insertion] = {}
    lit = False
    subject = f"material '{material.name}'"
    for output in found:
        kind = _kind(output.node)
        tree = output.node.id_data
        lit = lit or bool(kind and tree.is_editable)
        if kind and not tree.is_editable:
            cure = "make the group local"
            yield Notice("left out", subject, f"node group '{tree.name}' is linked and gets no light: {cure}")
        elif kind and tree not in filled:
            if tree not in trees:
                # A group that other materials use has kept its light.
                _clear(tree)
                trees[tree] = _Insertion(tree, image if tree in looking else None)
            trees[tree].add(output, kind)
        elif output.node.type in _UNLIT:
            yield Notice("simplified", subject, f"{output.label} {_UNLIT[output.node.type]}")
    filled.update(trees)
    if lit:
        material[KEY] = {"grid": image}
        if not any(_shines(output) for output in found):
            _sample_no_emission(material)


def _surfaces(tree: bpy.types.NodeTree) -> list[Output]:
    """Return the shaders that make up a material's surface, each node once, in whichever engine."""
    found: dict[tuple[bpy.types.NodeTree, str], Output] = {}
    seen = set()
    ends = [node for node in (tree.get_output_node(target) for target in _TARGETS) if node is not None]
    todo = [Input(node.inputs["Surface"]) for node in ends]
    while todo:
        _, output = follow(todo.pop())
        if output is None or (output.node, output.groups) in seen:
            continue
        seen.add((output.node, output.groups))
        if output.node.type in ("ADD_SHADER", "MIX_SHADER"):
            todo += [Input(socket, output.groups) for socket in output.node.inputs if socket.type == "SHADER"]
        else:
            found.setdefault((output.node.id_data, output.node.name), output)
    return list(found.values())


def _kind(node: bpy.types.Node) -> str:
    """Return the kind of light group that a node needs; empty if it reflects nothing diffusely."""
    if node.type == "BSDF_TOON" and node.component != "DIFFUSE":
        return ""
    return _DIFFUSE.get(node.type, "")


def _shines(output: Output) -> bool:
    """Tell whether a shader gives light of its own."""
    if output.socket.type != "SHADER" or output.node.type == "EMISSION":
        return True
    if output.node.type != "BSDF_PRINCIPLED":
        return False
    strength, source = follow(output.input("Emission Strength"))
    return source is not None or strength.socket.default_value != 0.0


class _Insertion:
    """Puts light into one tree: a grid's, where BSDFs with the same normal share a look-up, or without one the stored.

    What is stored is for the normal of the geometry: bumps cannot turn it.
    """

    def __init__(self, tree: bpy.types.NodeTree, image: bpy.types.Image | None) -> None:
        self._tree = tree
        self._image = image
        self._sources: dict[bpy.types.NodeSocket | None, dict[str, bpy.types.NodeSocket]] = {}

    def add(self, output: Output, kind: str) -> None:
        """Put a light group between a BSDF and all that it goes to."""
        bsdf = output.node
        after = [(link.to_socket, link.is_muted) for link in output.socket.links]
        light = self._group(light_group(kind), bsdf, 40.0)
        for name in INPUTS[kind]:
            self._read(bsdf, name, light)
        for name, source in self._irradiance(bsdf).items():
            self._tree.links.new(source, light.inputs[name])
        for socket, muted in after:
            self._tree.links.new(light.outputs["BSDF"], socket).is_muted = muted
        self._tree.links.new(output.socket, light.inputs["BSDF"])

    def _irradiance(self, bsdf: bpy.types.Node) -> dict[str, bpy.types.NodeSocket]:
        """Return what inputs of a BSDF's light group read: E of either way to look it up, and which of them counts.

        Where the last is not given, it is that in the open.
        """
        if self._image is None:
            normal = None
        else:
            normal = _source(bsdf.inputs["Normal"]) if "Normal" in bsdf.inputs else None
        if normal not in self._sources:
            stored = self._image is None
            self._sources[normal] = self._stored(bsdf) if stored else self._looked_up(bsdf, normal)
        return self._sources[normal]

    def _looked_up(self, bsdf: bpy.types.Node, normal: bpy.types.NodeSocket | None) -> dict[str, bpy.types.NodeSocket]:
        """Return E of the grid at a BSDF's normal."""
        from .irradiance_nodes import irradiance_group

        node = self._group(irradiance_group(self._image), bsdf, -200.0)
        if normal is not None:
            self._tree.links.new(normal, node.inputs["Normal"])
        return {name: node.outputs[name] for name in (OPEN, BESIDE, WALLS)}

    def _stored(self, bsdf: bpy.types.Node) -> dict[str, bpy.types.NodeSocket]:
        """Return E as the modifier has stored it."""
        node = self._new("ShaderNodeAttribute", bsdf, -200.0)
        node.attribute_name = ATTRIBUTE
        return {OPEN: node.outputs["Color"]}

    def _group(self, group: bpy.types.ShaderNodeTree, bsdf: bpy.types.Node, above: float) -> bpy.types.Node:
        """Add a node that is a group."""
        node = self._new("ShaderNodeGroup", bsdf, above)
        node.node_tree = group
        return node

    def _new(self, kind: str, bsdf: bpy.types.Node, above: float) -> bpy.types.Node:
        """Add a node, collapsed, by a BSDF."""
        node = self._tree.nodes.new(kind)
        node[ADDED] = True
        node.select = False
        node.hide = True
        x, y = bsdf.location_absolute
        node.location = (x, y + above)
        return node

    def _read(self, bsdf: bpy.types.Node, name: str, light: bpy.types.Node) -> None:
        """Let a light group read what an input of a BSDF reads; one that the BSDF does not have stays as it is."""
        if name not in bsdf.inputs:
            return
        source = _source(bsdf.inputs[name])
        if source is not None:
            self._tree.links.new(source, light.inputs[name])
        elif name != "Normal":
            light.inputs[name].default_value = bsdf.inputs[name].default_value


def _source(socket: bpy.types.NodeSocket) -> bpy.types.NodeSocket | None:
    """Return the output that an input is linked to."""
    return next((link.from_socket for link in socket.links if link.is_valid and not link.is_muted), None)


def _trees(tree: bpy.types.NodeTree) -> set[bpy.types.NodeTree]:
    """Return a tree and all groups in it, but for those of the light."""
    found = {tree}
    todo = [tree]
    while todo:
        for node in todo.pop().nodes:
            inner = node.node_tree if node.type == "GROUP" and not node.get(ADDED) else None
            if inner is not None and inner not in found:
                found.add(inner)
                todo.append(inner)
    return found


def _clear(tree: bpy.types.NodeTree) -> None:
    """Remove what was added to a tree, and link what came into it to what it went to."""
    added = [node for node in tree.nodes if node.get(ADDED)]
    for node in added:
        if node.type != "GROUP" or node.node_tree is None or not is_light_group(node.node_tree):
            continue
        before = next((link.from_socket for link in node.inputs["BSDF"].links), None)
        for socket, muted in [(link.to_socket, link.is_muted) for link in node.outputs["BSDF"].links]:
            if before is not None:
                tree.links.new(before, socket).is_muted = muted
    for node in added:
        tree.nodes.remove(node)


def _sample_no_emission(material: bpy.types.Material) -> None:
    """Let Cycles not take a material without light of its own for a lamp: other surfaces would send rays to it."""
    cycles = getattr(material, "cycles", None)
    if cycles is not None:
        material[KEY]["sampling"] = cycles.emission_sampling if cycles.is_property_set("emission_sampling") else ""
        cycles.emission_sampling = "NONE"


def _restore_sampling(material: bpy.types.Material) -> None:
    """Let Cycles sample a material as before, unless somebody has changed it since."""
    cycles, before = getattr(material, "cycles", None), material[KEY].get("sampling")
    if cycles is None or before is None or cycles.emission_sampling != "NONE":
        return
    if before:
        cycles.emission_sampling = before
    else:
        cycles.property_unset("emission_sampling")


def _remove_unused() -> None:
    """Remove the node groups of light and look-ups that nothing uses, and the groups in them."""
    from .irradiance_nodes import FORMAT

    ours = [group for group in bpy.data.node_groups if is_light_group(group) or bears(group, FORMAT)]
    names = {tree.name for group in ours for tree in _trees(group) if not tree.library}
    while True:
        found = (bpy.data.node_groups.get((name, None)) for name in names)
        unused = [group for group in found if group is not None and group.users == 0]
        if not unused:
            return
        bpy.data.batch_remove(unused)
