# SPDX-License-Identifier: GPL-3.0-or-later
"""The least-squares reconstruction as nodes: the twelve coefficients that a normal gives F and D (core/moments.py).

E(n) = ½ (F·n + Σ_kj W_kj(n) D_kj)                                       (core/reconstruction.py has W)
"""

from __future__ import annotations

import math

from .node_formulas import NodeFormulas, Socket

_OWN = 1.0 / (math.pi - 2.0)
_ALONG = 2.0 * math.pi / (math.pi**2 - 4.0)
_ACROSS = 4.0 / (math.pi**2 - 4.0)
"""W_kk = _OWN (r_k − mean r) + 1/3 and W_kl = _ALONG a_k n_l − _ACROSS a_l n_k."""


def coefficients(maths: NodeFormulas, normal: Socket) -> list[Socket]:
    """Return the coefficients of F_x … D_zz at a unit normal, numbers; at 0 those of the mean over all normals."""
    # Rounding makes unit vectors longer than one, of which EEVEE's arc sine is 0.
    n = maths.vector("MINIMUM", maths.vector("MAXIMUM", normal, (-1.0,) * 3), (1.0,) * 3)
    components = maths.separated(n)
    arcs = [maths.math("ARCSINE", component) for component in components]
    a = maths.combined(*arcs)
    square = maths.vector("MULTIPLY", n, n)
    s = maths.vector("POWER", maths.vector("SUBTRACT", (1.0,) * 3, square), (0.5,) * 3)
    half_r = maths.vector("MULTIPLY_ADD", a, n, s)
    # ½ W_kk = _OWN (½ r_k − mean ½ r) + 1/6
    shift = maths.math("MULTIPLY_ADD", maths.dot(half_r, (1.0,) * 3), -_OWN / 3.0, 1.0 / 6.0)
    own = maths.vector("MULTIPLY_ADD", half_r, (_OWN,) * 3, maths.combined(shift, shift, shift))
    along = maths.scaled(n, 0.5 * _ALONG)
    across = maths.scaled(a, -0.5 * _ACROSS)
    diagonal = maths.separated(own)
    found = list(maths.separated(maths.scaled(n, 0.5)))
    for k in range(3):
        row = maths.vector("ADD", maths.scaled(along, arcs[k]), maths.scaled(across, components[k]))
        found += [diagonal[k] if j == k else component for j, component in enumerate(maths.separated(row))]
    return found
