# SPDX-License-Identifier: GPL-3.0-or-later
"""Closures: a surface as a sum of weighted lobes whose values may be known only later.

Inputs are constants, or leaves: values that are known at k points of the surface once they were evaluated. All that is
done with them is done for those k points at a time, in linear RGB; a constant has k = 1.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .bumps import unit_normals
from .principled import COSINE_WEIGHTS, COSINES, dielectric_curve, facing_curve
from .shading import OwnNormal

Float64 = NDArray[np.float64]


@dataclass(frozen=True)
class Leaf:
    """A value that is known later, by its place among the leaves of a material."""

    index: int


@dataclass(frozen=True)
class Directed:
    """A value that depends on the direction of view: leaves at `VIEWS`."""

    leaves: tuple[Leaf, ...]


Value = Leaf | Directed | tuple[float, ...]
"""A leaf, or several; or a constant: (x,) a number, (r, g, b) a colour."""

VIEWS = (0.0, 0.08, 0.2, 0.33, 0.47, 0.6, 0.74, 0.87, 1.0)
"""Cosines to the surface's normal at which values that depend on them are known; they are linear in between."""
_AT_COSINES: Float64 = np.stack([np.interp(COSINES, VIEWS, row) for row in np.eye(len(VIEWS))], axis=1)
_SHARES: Float64 = COSINE_WEIGHTS @ _AT_COSINES
"""What each of `VIEWS` counts for light towards all sides."""


@dataclass(frozen=True)
class Factor:
    """A factor of a closure's weight.

    Parameters
    ----------
    value
        A number, clamped to [0, 1] unless it shapes something.
    complement
        The factor is 1 − value.
    shape
        "CONSTANT"; or the value shapes a function of the direction of view: "FRESNEL", the reflectance of a dielectric
        of that index of refraction, "FACING", the output of a Layer Weight node of that blend.
    """

    value: Value
    complement: bool = False
    shape: str = "CONSTANT"


@dataclass(frozen=True)
class Normal:
    """A normal that is known later, and what it is: flags of `bumps`."""

    value: Leaf
    bump: int


@dataclass(frozen=True)
class Closure:
    """One closure of a shader tree.

    Parameters
    ----------
    kind
        "DIFFUSE", "EMISSION", "GLOSSY", "METALLIC", "GLASS", "REFRACTION", "TRANSLUCENT", "TRANSPARENT",
        "SHEEN" or "PRINCIPLED".
    inputs
        By the names that the code below asks for.
    weight
        Multiplied with each other.
    multiscatter
        See `scene.Lobes`.
    normal, coat_normal
        Where they are not the surface's own.
    """

    kind: str
    inputs: Mapping[str, Value]
    weight: tuple[Factor, ...] = ()
    multiscatter: bool = False
    normal: Normal | None = None
    coat_normal: Normal | None = None


@dataclass(frozen=True)
class Caustics:
    """Which lobes Cycles keeps for light that was diffusely reflected."""

    reflective: bool = True
    refractive: bool = True


class Values:
    """Values of inputs, as arrays."""

    def __init__(self, leaves: Sequence[Float64]) -> None:
        self._leaves = leaves

    def __call__(self, value: Value) -> Float64:
        """Return a value, (k, 1) or (k, 3); of one that depends on the direction of view its mean."""
        if isinstance(value, Leaf):
            return self._leaves[value.index]
        if isinstance(value, Directed):
            table = np.stack([self._leaves[leaf.index] for leaf in value.leaves])
            mean: Float64 = np.einsum("v,vkc->kc", _SHARES, table)
            return mean
        return np.array([value], dtype=np.float64)

    def share(self, value: Value) -> Float64:
        """Return a number within [0, 1]; 0 where it is none."""
        return np.nan_to_num(np.clip(self(value), 0.0, 1.0))

    def looks(self, value: Value) -> Float64:
        """Return how a value depends on the direction of view at `principled.COSINES`, on average over all points.

        (directions, 1) or (directions, 3), 1 in the mean over directions.
        """
        if not isinstance(value, Directed):
            return np.ones((len(COSINES), 1))
        curve = _AT_COSINES @ np.stack([self._leaves[leaf.index].mean(axis=0) for leaf in value.leaves])
        mean = COSINE_WEIGHTS @ curve
        return np.asarray(np.divide(curve, mean, out=np.ones_like(curve), where=mean > 0.0))

    def normal(self, normal: Normal | None) -> OwnNormal | None:
        """Return a closure's normals."""
        return None if normal is None else OwnNormal(unit_normals(self._leaves[normal.value.index]), normal.bump)

    def mean(self, value: Value) -> float:
        """Return the mean of a number."""
        return float(np.mean(self(value)))

    def weight(self, factors: Iterable[Factor]) -> Float64:
        """Return a product of factors, (k, 1), without those that depend on the direction of view."""
        product = np.ones((1, 1))
        for factor in factors:
            if factor.shape == "CONSTANT":
                share = self.share(factor.value)
                product = product * (1.0 - share if factor.complement else share)
        return product

    def curve(self, factors: Iterable[Factor]) -> Float64:
        """Return the product of those that do, (directions, 1) at `principled.COSINES`."""
        product = np.ones((len(COSINES), 1))
        for factor in factors:
            if isinstance(factor.value, Directed):
                share = float(np.mean(self.share(factor.value)))
                looks = self.looks(factor.value)
                left = (1.0 - share * looks) / max(1.0 - share, 1e-6) if factor.complement else looks
                product = product * np.maximum(left, 0.0)
            elif factor.shape != "CONSTANT":
                value = float(np.nan_to_num(self.mean(factor.value)))
                curve = dielectric_curve(usable_index(value)) if factor.shape == "FRESNEL" else facing_curve(value)
                product = product * (1.0 - curve if factor.complement else curve)[:, None]
        return product


def usable_index(ior: float) -> float:
    """Return an index of refraction with which the mean reflectance can be computed."""
    return max(ior, 1e-5)


def default_principled(colour: tuple[float, ...]) -> Closure:
    """Return a Principled BSDF as it is when it is added: what Cycles takes where there is no material."""
    return Closure(
        "PRINCIPLED",
        {
            "Base Color": colour,
            "Metallic": (0.0,),
            "Roughness": (0.5,),
            "IOR": (1.5,),
            "Alpha": (1.0,),
            "Diffuse Roughness": (0.0,),
            "Specular IOR Level": (0.5,),
            "Specular Tint": (1.0, 1.0, 1.0),
            "Transmission Weight": (0.0,),
            "Coat Weight": (0.0,),
            "Coat Roughness": (0.03,),
            "Coat IOR": (1.5,),
            "Coat Tint": (1.0, 1.0, 1.0),
            "Sheen Weight": (0.0,),
            "Sheen Roughness": (0.5,),
            "Sheen Tint": (1.0, 1.0, 1.0),
            "Emission Color": (1.0, 1.0, 1.0),
            "Emission Strength": (0.0,),
        },
        multiscatter=True,
    )
