# SPDX-License-Identifier: GPL-3.0-or-later
"""What a material's shader tree amounts to: diffuse reflection and emission.

A surface is a sum of weighted closures. Mix and Add nodes with constant factors are exact sums;
closures other than diffuse reflection and emission reflect nothing, and are named.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import bpy
import numpy as np

from ..core.principled import Colour, Layers, coat_share, diffuse_share, oren_nayar_albedo
from .export_colours import ColourReader, Float64, Paint
from .export_nodes import Input, Output, follow

_TRACE = 1e-4
"""A weight below this is nothing."""


@dataclass(frozen=True)
class Surface:
    """A weighted sum of closures.

    Parameters
    ----------
    diffuse
        The colours of its diffuse lobes.
    emission : (3,) float64
        Radiance, W/(m² sr).
    passing
        Weight of what lets light through: transparent, glass, refraction.
    """

    diffuse: tuple[Paint, ...] = ()
    emission: Float64 = field(default_factory=lambda: np.zeros(3))
    passing: float = 0.0

    @property
    def lets_light_pass(self) -> bool:
        """Tell whether to leave its faces out rather than to let them block light."""
        return self.passing > 0.5 and not self.emission.any()

    def scaled(self, factor: float) -> Surface:
        """Return it with every closure's weight multiplied."""
        return Surface(
            tuple(paint.scaled(factor) for paint in self.diffuse), self.emission * factor, self.passing * factor
        )

    def __add__(self, other: Surface) -> Surface:
        """Return the closures of both."""
        return Surface(self.diffuse + other.diffuse, self.emission + other.emission, self.passing + other.passing)


class SurfaceReader:
    """Reads one material's closures.

    Parameters
    ----------
    colours
        Reads its sockets.
    reflective_caustics
        The scene's setting: where it is off, Cycles' diffuse rays see no specular layers.
    """

    def __init__(self, colours: ColourReader, reflective_caustics: bool) -> None:
        self._colours = colours
        self._caustics = reflective_caustics
        self._omitted: dict[str, None] = {}

    def read(self, tree: bpy.types.NodeTree) -> Surface:
        """Return the surface of a material's node tree; notices go to the colour reader's notes."""
        notes = self._colours.notes
        node = tree.get_output_node("CYCLES")
        if node is None:
            notes.add("warning", "has no material output: black")
            return Surface()
        surface_input, volume, displacement = (
            Input(node.inputs[name]) for name in ("Surface", "Volume", "Displacement")
        )
        surface = self._closure(surface_input)
        if follow(volume)[1] is not None:
            self._omitted["volume"] = None
            if follow(surface_input)[1] is None:
                surface = Surface(passing=1.0)
        if follow(displacement)[1] is not None:
            self._omitted["displacement"] = None
        self._note(surface)
        return surface

    def _note(self, surface: Surface) -> None:
        """Say what was not taken into account."""
        notes = self._colours.notes
        if not surface.lets_light_pass and surface.passing > _TRACE:
            self._omitted["transparency (taken as opaque)"] = None
        without = f"without {', '.join(self._omitted)}"
        if surface.lets_light_pass:
            passes = "light passes straight through its faces"
            notes.add("left out", f"{passes}, {without}" if self._omitted else passes)
        elif self._omitted:
            notes.add("simplified", f"diffuse reflection and emission only, {without}")

    def _closure(self, entry: Input) -> Surface:
        _, output = follow(entry)
        if output is None:
            return Surface()
        if output.socket.type != "SHADER":
            # A colour in place of a shader shines, in Cycles.
            return Surface(emission=self._colours.colour(entry, "Surface"))
        reader = _READERS.get(output.node.type)
        if reader is None:
            self._omitted[output.label] = None
            return Surface()
        return reader(self, output)

    def _sum(self, output: Output) -> Surface:
        return self._closure(output.input("Shader")) + self._closure(output.input("Shader_001"))

    def _mix(self, output: Output) -> Surface:
        factor = min(max(self._colours.number(output.input("Fac"), "shader mix factor"), 0.0), 1.0)
        mixed = Surface()
        if factor < 1.0:
            mixed += self._closure(output.input("Shader")).scaled(1.0 - factor)
        if factor > 0.0:
            mixed += self._closure(output.input("Shader_001")).scaled(factor)
        return mixed

    def _emission(self, output: Output) -> Surface:
        strength = self._colours.number(output.input("Strength"))
        if strength == 0.0:
            return Surface()
        return Surface(emission=strength * self._colours.colour(output.input("Color")))

    def _diffuse(self, output: Output) -> Surface:
        self._bump(output)
        return Surface((self._rough(self._colours.paint(output.input("Color")), output, "Roughness"),))

    def _subsurface(self, output: Output) -> Surface:
        self._bump(output)
        self._omitted["subsurface scattering (taken as diffuse)"] = None
        return Surface((self._colours.paint(output.input("Color")),))

    def _toon(self, output: Output) -> Surface:
        if output.node.component != "DIFFUSE":
            self._omitted[output.label] = None
            return Surface()
        self._omitted["toon shading (taken as diffuse)"] = None
        return Surface((self._colours.paint(output.input("Color")),))

    def _transparent(self, output: Output) -> Surface:
        return Surface(passing=1.0)

    def _refraction(self, output: Output) -> Surface:
        self._omitted["refraction"] = None
        return Surface(passing=1.0)

    def _principled(self, output: Output) -> Surface:
        colours = self._colours

        def number(name: str) -> float:
            return colours.number(output.input(name))

        def share(name: str) -> float:
            return min(max(number(name), 0.0), 1.0)

        opacity = share("Alpha")
        coat = share("Coat Weight")
        metallic = share("Metallic")
        transmission = share("Transmission Weight")
        layers = Layers(
            metallic=metallic,
            transmission=transmission,
            ior=number("IOR"),
            specular_ior_level=number("Specular IOR Level"),
            specular_tint=self._tint(output, "Specular Tint"),
            roughness=share("Roughness"),
            coat=coat,
            coat_roughness=share("Coat Roughness") if coat > 0.0 else 0.0,
            coat_ior=number("Coat IOR") if coat > 0.0 else 1.5,
            coat_tint=self._tint(output, "Coat Tint") if coat > 0.0 else (1.0, 1.0, 1.0),
            multiscatter=output.node.distribution == "MULTI_GGX",
            specular=self._caustics,
        )
        self._note_layers(output, layers, share("Sheen Weight"))
        surface = Surface(passing=1.0 - opacity + opacity * transmission * (1.0 - metallic))
        kept = opacity * diffuse_share(layers)
        if np.max(kept) > _TRACE:
            self._bump(output)
            base = self._rough(colours.paint(output.input("Base Color")), output, "Diffuse Roughness")
            surface += Surface((base.scaled(kept),))
        strength = number("Emission Strength")
        if strength != 0.0:
            shining = opacity * strength * coat_share(layers)
            surface += Surface(emission=shining * colours.colour(output.input("Emission Color")))
        return surface

    def _note_layers(self, output: Output, layers: Layers, sheen: float) -> None:
        """Name the lobes of a Principled BSDF that reflect nothing here."""
        weights = {
            "metallic": layers.metallic,
            "specular": (1.0 - layers.metallic) * layers.specular_ior_level * (layers.ior != 1.0),
            "coat": layers.coat,
            "sheen": sheen,
            "refraction": layers.transmission,
            "subsurface scattering (taken as diffuse)": self._colours.number(output.input("Subsurface Weight")),
        }
        self._omitted.update(dict.fromkeys(name for name, weight in weights.items() if weight > 0.0))

    def _tint(self, output: Output, name: str) -> Colour:
        red, green, blue = np.maximum(self._colours.colour(output.input(name)), 0.0)
        return float(red), float(green), float(blue)

    def _rough(self, paint: Paint, output: Output, name: str) -> Paint:
        """Return a paint with the total reflectance of a rough (Oren–Nayar) diffuse lobe."""
        roughness = min(max(self._colours.number(output.input(name)), 0.0), 1.0)
        if roughness < 1e-5:
            return paint
        colour = np.clip(self._colours.mean(paint), 1e-6, 1.0)
        return paint.scaled(oren_nayar_albedo(colour, roughness) / colour)

    def _bump(self, output: Output) -> None:
        if follow(output.input("Normal"))[1] is not None:
            self._omitted["bump or normal map"] = None


_READERS: dict[str, Callable[[SurfaceReader, Output], Surface]] = {
    "ADD_SHADER": SurfaceReader._sum,
    "MIX_SHADER": SurfaceReader._mix,
    "EMISSION": SurfaceReader._emission,
    "BSDF_DIFFUSE": SurfaceReader._diffuse,
    "BSDF_PRINCIPLED": SurfaceReader._principled,
    "SUBSURFACE_SCATTERING": SurfaceReader._subsurface,
    "BSDF_TOON": SurfaceReader._toon,
    "BSDF_TRANSPARENT": SurfaceReader._transparent,
    "BSDF_GLASS": SurfaceReader._refraction,
    "BSDF_REFRACTION": SurfaceReader._refraction,
}
