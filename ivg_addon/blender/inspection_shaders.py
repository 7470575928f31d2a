# SPDX-License-Identifier: GPL-3.0-or-later
"""Shaders that draw a grid's spheres, arrows and slices.

Instances read what they are from a texture, `per_row` of them in a row, so that moving a slider changes uniforms only.
A sphere is a square that faces the eye: the fragment shader finds where its ray meets the sphere, and the irradiance
of that direction by least squares (reconstruction.py), so both are exact at any size.

Viewports blend what is drawn over a picture that is already in the display's colours. So no view transform is applied:
what comes out is linear where the target encodes sRGB itself, and sRGB elsewhere.
"""

from __future__ import annotations

import functools
from typing import Any

import gpu

SPHERE_TEXELS = 10
"""Position and validity, then for each channel F_x F_y F_z D_xx | D_xy D_xz D_yx D_yy | D_yz D_zx D_zy D_zz."""
ARROW_TEXELS = 3
"""Position, vector, colour."""
RAMP = 256

_DISPLAY = """
vec4 displayed(vec3 light, float coverage) {
  vec3 c = clamp(light, 0.0, 1.0);
  vec3 encoded = mix(12.92 * c, 1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055, step(vec3(0.0031308), c));
  return vec4(srgbTarget ? c : encoded, coverage);
}
"""
_INSTANCE = """
vec4 texel(int instance, int index) {
  int row = instance / per_row;
  return texelFetch(instances, ivec2((instance - row * per_row) * TEXELS + index, row), 0);
}
"""
_SPHERE_VERTEX = (
    _INSTANCE
    + """
void main() {
  vec4 told = texel(gl_InstanceID, 0);
  float radius = told.w > 0.0 ? radii.x : radii.y;
  vec3 to_eye = eye.xyz - eye.w * told.xyz;
  float away = length(to_eye);
  vec3 z = to_eye / away;
  // In perspective the outline is nearer than the centre, and looks larger.
  float outline = eye.w > 0.0 ? away / sqrt(max(away * away - radius * radius, 1e-12)) : 1.0;
  bool drawn = radius > 0.0 && (eye.w == 0.0 || away > radius);
  float half_side = drawn ? 1.1 * outline * radius : 0.0;
  vec3 x = normalize(abs(z.z) < 0.9 ? vec3(-z.y, z.x, 0.0) : vec3(0.0, -z.z, z.y));
  vec3 y = cross(z, x);
  place = told.xyz + half_side * (corner.x * x + corner.y * y);
  centre = vec4(told.xyz, told.w > 0.0 ? radius : -radius);
  r0 = texel(gl_InstanceID, 1); r1 = texel(gl_InstanceID, 2); r2 = texel(gl_InstanceID, 3);
  g0 = texel(gl_InstanceID, 4); g1 = texel(gl_InstanceID, 5); g2 = texel(gl_InstanceID, 6);
  b0 = texel(gl_InstanceID, 7); b1 = texel(gl_InstanceID, 8); b2 = texel(gl_InstanceID, 9);
  gl_Position = view_projection * vec4(place, 1.0);
}
"""
)
_SPHERE_FRAGMENT = (
    _DISPLAY
    + """
void main() {
  float radius = abs(centre.w);
  vec3 ray = eye.w > 0.0 ? normalize(place - eye.xyz) : -eye.xyz;
  vec3 from = place - centre.xyz;
  float along = dot(from, ray);
  float aside = length(from - along * ray);
  float coverage = clamp((radius - aside) / max(fwidth(aside), 1e-9) + 0.5, 0.0, 1.0);
  if (coverage == 0.0) {
    discard;
  }
  vec3 hit = from - (along + sqrt(max(radius * radius - aside * aside, 0.0))) * ray;
  vec4 clip = view_projection * vec4(centre.xyz + hit, 1.0);
  gl_FragDepth = 0.5 + 0.5 * clip.z / clip.w;
  if (centre.w < 0.0) {
    fragColor = displayed(UNLIT, coverage);
    return;
  }
  vec3 n = clamp(normalize(hit), -1.0, 1.0);
  vec3 a = asin(n);
  vec3 even = 0.5 * n.xyz * n.yzx;
  vec3 odd = (a.xyz * n.yzx - a.yzx * n.xyz) / (PI - 2.0);
  vec3 up = even + odd;
  vec3 down = even - odd;
  vec4 w0 = 0.5 * vec4(n, n.x * n.x);
  vec4 w1 = 0.5 * vec4(up.x, down.z, down.x, n.y * n.y);
  vec4 w2 = 0.5 * vec4(up.y, up.z, down.y, n.z * n.z);
  vec3 irradiance = vec3(dot(w0, r0) + dot(w1, r1) + dot(w2, r2), dot(w0, g0) + dot(w1, g1) + dot(w2, g2),
                         dot(w0, b0) + dot(w1, b1) + dot(w2, b2));
  fragColor = displayed(gain * irradiance, coverage);
}
"""
)
_ARROW_VERTEX = (
    _INSTANCE
    + """
void main() {
  vec3 along = scale * texel(gl_InstanceID, 1).xyz;
  float size = length(along);
  vec3 z = along / max(size, 1e-20);
  vec3 x = normalize(abs(z.z) < 0.9 ? vec3(-z.y, z.x, 0.0) : vec3(0.0, -z.z, z.y));
  place = texel(gl_InstanceID, 0).xyz + size * (pos.x * x + pos.y * cross(z, x) + pos.z * z);
  color = texel(gl_InstanceID, 2).rgb;
  gl_Position = view_projection * vec4(place, 1.0);
}
"""
)
_ARROW_FRAGMENT = (
    _DISPLAY
    + """
void main() {
  vec3 n = normalize(cross(dFdx(place), dFdy(place)));
  vec3 to_eye = normalize(eye.xyz - eye.w * place);
  fragColor = displayed(gain * color * (0.5 + 0.5 * abs(dot(n, to_eye))), 1.0);
}
"""
)
_SLICE_VERTEX = """
void main() {
  color = value;
  gl_Position = view_projection * vec4(pos, 1.0);
}
"""
_SLICE_FRAGMENT = (
    _DISPLAY
    + """
void main() {
  vec3 shown = gain * color;
  if (false_color) {
    float amount = clamp(dot(shown, vec3(0.2126, 0.7152, 0.0722)), 0.0, 1.0);
    shown = texelFetch(ramp, ivec2(int(0.5 + amount * float(RAMP - 1)), 0), 0).rgb;
  }
  fragColor = displayed(shown, 1.0);
}
"""
)


@functools.lru_cache(maxsize=1)
def sphere_shader() -> Any:
    """Return the shader of spheres: vertices `corner` of a square, instances of `SPHERE_TEXELS`.

    Uniforms: view_projection; eye (a position and 1, or the direction to the viewer and 0); radii of vertices with and
    without light, metres; gain; per_row.
    """
    info = _instance_info(SPHERE_TEXELS, PI="3.14159265358979", UNLIT="vec3(1.0, 0.0, 0.6)")
    info.push_constant("VEC2", "radii")
    info.vertex_in(0, "VEC2", "corner")
    between = gpu.types.GPUStageInterfaceInfo("ivg_sphere")
    between.smooth("VEC3", "place")
    for name in ("centre", "r0", "r1", "r2", "g0", "g1", "g2", "b0", "b1", "b2"):
        between.flat("VEC4", name)
    info.vertex_out(between)
    info.depth_write("ANY")
    return _made(info, _SPHERE_VERTEX, _SPHERE_FRAGMENT)


@functools.lru_cache(maxsize=1)
def arrow_shader() -> Any:
    """Return the shader of arrows: vertices `pos` of an arrow to (0, 0, 1), instances of `ARROW_TEXELS`.

    Uniforms: view_projection; eye, as for spheres; scale of the vectors; gain; per_row.
    """
    info = _instance_info(ARROW_TEXELS)
    info.push_constant("FLOAT", "scale")
    info.vertex_in(0, "VEC3", "pos")
    between = gpu.types.GPUStageInterfaceInfo("ivg_arrow")
    between.smooth("VEC3", "place")
    between.flat("VEC3", "color")
    info.vertex_out(between)
    return _made(info, _ARROW_VERTEX, _ARROW_FRAGMENT)


@functools.lru_cache(maxsize=1)
def slice_shader() -> Any:
    """Return the shader of slices: vertices `pos` with a `value`, and a texture of `RAMP` false colours, `ramp`.

    Uniforms: view_projection; gain; false_color.
    """
    info = _info(RAMP=str(RAMP))
    info.push_constant("BOOL", "false_color")
    info.sampler(0, "FLOAT_2D", "ramp")
    info.vertex_in(0, "VEC3", "pos")
    info.vertex_in(1, "VEC3", "value")
    between = gpu.types.GPUStageInterfaceInfo("ivg_slice")
    between.smooth("VEC3", "color")
    info.vertex_out(between)
    return _made(info, _SLICE_VERTEX, _SLICE_FRAGMENT)


def forget() -> None:
    """Free all shaders."""
    for shader in (sphere_shader, arrow_shader, slice_shader):
        shader.cache_clear()


def _info(**defines: str) -> Any:
    """Return what all shaders have in common."""
    info = gpu.types.GPUShaderCreateInfo()
    for name, value in defines.items():
        info.define(name, value)
    info.push_constant("MAT4", "view_projection")
    info.push_constant("FLOAT", "gain")
    # Blender sets it to whether the target encodes sRGB.
    info.push_constant("BOOL", "srgbTarget")
    info.fragment_out(0, "VEC4", "fragColor")
    return info


def _instance_info(texels: int, **defines: str) -> Any:
    """Return what the shaders of instances, each of so many texels, have in common."""
    info = _info(TEXELS=str(texels), **defines)
    info.push_constant("VEC4", "eye")
    info.push_constant("INT", "per_row")
    info.sampler(0, "FLOAT_2D", "instances")
    return info


def _made(info: Any, vertex: str, fragment: str) -> Any:
    info.vertex_source(vertex)
    info.fragment_source(fragment)
    return gpu.shader.create_from_info(info)
