# SPDX-License-Identifier: GPL-3.0-or-later
"""`scene.ivg.last_bake` and `scene.ivg.last_compare`: what was told to the user; outcome.py writes and reads it."""

from __future__ import annotations

import bpy
from bpy.props import CollectionProperty, IntProperty, StringProperty


class IvgRow(bpy.types.PropertyGroup):
    """One line of a summary; `name` is its label."""

    __annotations__ = {"value": StringProperty(name="Value", options=set())}


class IvgNotice(bpy.types.PropertyGroup):
    """One thing that was simplified, left out or wondered about; `name` is all of it."""

    __annotations__ = {
        "kind": StringProperty(name="Kind", options=set()),
        "subject": StringProperty(name="Subject", options=set()),
        "message": StringProperty(name="Message", options=set()),
    }


class IvgOutcome(bpy.types.PropertyGroup):
    """What the last bake or comparison did, as it was told to the user."""

    __annotations__ = {
        "filepath": StringProperty(name="File", subtype="FILE_PATH", options={"PATH_SUPPORTS_BLEND_RELATIVE"}),
        "rows": CollectionProperty(type=IvgRow),
        "notices": CollectionProperty(type=IvgNotice),
        "active_notice": IntProperty(name="Notice", default=0, min=0, options=set()),
    }
