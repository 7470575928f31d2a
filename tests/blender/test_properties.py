# SPDX-License-Identifier: GPL-3.0-or-later
"""`scene.ivg`: numbered enums, tooltips as Blender writes them, and the same names on the operator."""

from __future__ import annotations

import importlib
from typing import Any

import bpy
import pytest


@pytest.fixture
def settings(extension: str) -> Any:
    """Return the settings of a scene that nobody has changed."""
    bpy.ops.wm.read_homefile(use_empty=True)
    return bpy.context.scene.ivg


def own_properties(group: Any) -> list[Any]:
    """Return the properties of a group that this extension declares."""
    return [found for found in group.bl_rna.properties if found.identifier not in {"rna_type", "name"}]


def test_defaults_are_those_of_a_bake(settings: Any) -> None:
    """What the panel starts with is what `BakeSettings` has where nothing is said."""
    from ivg_addon.core.settings import BakeSettings

    defaults = BakeSettings((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (1, 1, 1))
    for name in ("photons", "bounces", "seed", "estimator", "include_direct", "threads"):
        assert getattr(settings, name) == getattr(defaults, name), name


def test_look_up_defaults_are_those_of_the_grid(settings: Any) -> None:
    import inspect

    from ivg_addon.core import IrradianceVectorGrid

    parameters = inspect.signature(IrradianceVectorGrid.irradiance).parameters
    assert settings.spatial == parameters["spatial"].default
    assert settings.directional == parameters["directional"].default
    assert settings.normal_bias == parameters["normal_bias"].default


@pytest.mark.parametrize("name", ["estimator", "spatial", "directional"])
def test_enums_offer_what_the_core_knows(settings: Any, name: str) -> None:
    core = importlib.import_module("ivg_addon.core.settings")
    known = {"estimator": core.Estimator, "spatial": core.Spatial, "directional": core.Directional}[name]
    assert set(settings.bl_rna.properties[name].enum_items.keys()) == {str(item) for item in known}


def test_saved_numbers_of_enum_items(settings: Any) -> None:
    """Files hold these numbers: an item that moves would change what they say."""
    numbers = {
        found.identifier: {item.identifier: item.value for item in found.enum_items}
        for found in own_properties(settings)
        if found.type == "ENUM"
    }
    assert numbers == {
        "bounds_mode": {"SCENE": 0, "OBJECT": 1},
        "resolution_mode": {"AUTO": 0, "MANUAL": 1},
        "estimator": {"TRACK_LENGTH": 0, "CROSSING": 1, "REPORT": 2},
        "spatial": {"TRILINEAR": 0, "TRICUBIC": 1},
        "directional": {"LEAST_SQUARES": 0, "REPORT": 1},
        "light_from": {"GRID": 0, "MODIFIER": 1},
    }


def test_every_property_has_a_tooltip_without_full_stop(settings: Any) -> None:
    described = [found for found in own_properties(settings) if found.type not in {"POINTER"}]
    assert len(described) > 10
    for found in described:
        assert found.description, found.identifier
        texts = [found.description]
        if found.type == "ENUM":
            texts += [item.description for item in found.enum_items]
        assert not [text for text in texts if not text or text.endswith(".")], found.identifier


def test_operator_has_every_setting_of_a_bake(extension: str, settings: Any) -> None:
    """The same names, types, defaults and limits on `scene.ivg` and on `bpy.ops.ivg.bake`."""
    properties = importlib.import_module(f"{extension}.ivg_addon.blender.properties")
    operator = bpy.ops.ivg.bake.get_rna_type().properties
    for name in properties.settings_properties():
        ours, theirs = settings.bl_rna.properties[name], operator[name]
        assert (ours.type, ours.description) == (theirs.type, theirs.description)
        assert theirs.is_skip_save, f"{name} would be remembered from one call to the next"
        for trait in ("default", "hard_min", "hard_max", "soft_max"):
            assert getattr(ours, trait, None) == getattr(theirs, trait, None), (name, trait)


def test_settings_and_summary_are_saved_with_the_blend(settings: Any, tmp_path: Any) -> None:
    settings.photons = 1234
    settings.estimator = "CROSSING"
    row = settings.last_bake.rows.add()
    row.name, row.value = "Light", "3 W"
    path = str(tmp_path / "kept.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.ops.wm.open_mainfile(filepath=path)
    kept = bpy.context.scene.ivg
    assert (kept.photons, kept.estimator) == (1234, "CROSSING")
    assert [(row.name, row.value) for row in kept.last_bake.rows] == [("Light", "3 W")]
