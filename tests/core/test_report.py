# SPDX-License-Identifier: GPL-3.0-or-later
"""Notices: said once, counted in one line."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from ivg_addon.core.report import Notice, counted, headline, merge

GOLD = Notice("simplified", "material 'Gold'", "taken as diffuse")
FOG = Notice("left out", "volume 'Fog'", "not baked")
FLAT = Notice("warning", "object 'Plane'", "2 triangles have no area")

notices = st.lists(
    st.builds(Notice, st.sampled_from(["simplified", "left out", "warning"]), st.text(max_size=2), st.text(max_size=2))
)


@given(notices)
def test_each_is_kept_once_in_the_order_it_came(many: list[Notice]) -> None:
    merged = merge(many)
    assert set(merged) == set(many)
    assert len(merged) == len(set(many))
    assert list(merged) == sorted(merged, key=many.index)


def test_the_headline_counts() -> None:
    assert headline([]) == ""
    assert headline([GOLD]) == "1 simplified"
    assert headline([FLAT]) == "1 warning"
    assert headline([FLAT, GOLD, FOG, FOG, FLAT]) == "1 simplified, 2 left out, 2 warnings"


def test_a_notice_is_one_line() -> None:
    assert str(GOLD) == "simplified: material 'Gold': taken as diffuse"


def test_counted() -> None:
    assert [counted(n, "object") for n in (0, 1, 2, 1500)] == ["0 objects", "1 object", "2 objects", "1,500 objects"]
