"""Fragment shaders, compiled when first used, and run over everything in the viewport."""

from __future__ import annotations

from collections.abc import Mapping

import moderngl

from app import glsl
from app.tone import Curve, Tone
from lfcore.errors import LfviewError
from lfcore.lightfield import CORNERS

AnyTexture = moderngl.Texture | moderngl.TextureArray
Uniform = float | int | bool | tuple[float, ...] | tuple[tuple[float, ...], ...]

_TONES = {
    Curve.STORED: "tone_stored.glsl",
    Curve.SRGB: "tone_srgb.glsl",
    Curve.GAMMA: "tone_gamma.glsl",
    Curve.AUTHORS: "tone_bright.glsl",
}


class Pass:
    """One fragment shader."""

    def __init__(self, context: moderngl.Context, fragment: str, instead: Mapping[str, str] | None = None) -> None:
        source = glsl.load(fragment, instead)
        vertex = "placed.vert" if "placement.glsl" in source.files else "everywhere.vert"
        try:
            self._program = context.program(glsl.load(vertex).text, source.text)
        except moderngl.Error as error:
            raise LfviewError(f"A shader does not compile on this computer: {source.located(str(error))}") from error
        self._triangle = context.vertex_array(self._program, [])
        if "corner_positions" in self._program:
            self._set("corner_positions", CORNERS)

    def render(self, textures: Mapping[str, AnyTexture], uniforms: Mapping[str, Uniform]) -> None:
        """Draw with these textures bound to the samplers of those names, and these values of uniforms."""
        for unit, (name, texture) in enumerate(textures.items()):
            texture.use(unit)
            self._set(name, unit)
        self.set(uniforms)
        self._triangle.render(moderngl.TRIANGLES, vertices=3)

    def set(self, uniforms: Mapping[str, Uniform]) -> None:
        """Give uniforms values, which they keep."""
        for name, value in uniforms.items():
            self._set(name, value)

    def _set(self, name: str, value: Uniform) -> None:
        member = self._program[name]
        assert isinstance(member, moderngl.Uniform)
        member.value = value


class Passes:
    """The passes of one context, by fragment shader and what it includes."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._compiled: dict[tuple[str, ...], Pass] = {}

    def get(self, fragment: str, **included: str) -> Pass:
        """The fragment shader with these files in place of the includes NAME.glsl."""
        instead = {"tone": _TONES[Curve.STORED], **included}
        key = (fragment, *(f"{name}:{file}" for name, file in sorted(instead.items())))
        if key not in self._compiled:
            self._compiled[key] = Pass(self._context, fragment, {f"{name}.glsl": file for name, file in instead.items()})
        return self._compiled[key]

    def toned(self, fragment: str, tone: Tone, **included: str) -> Pass:
        """The same for a shader that turns stored values into shown ones, which it will do in this tone."""
        made = self.get(fragment, tone=_TONES[tone.curve], **included)
        made.set({"exposure": tone.exposure} | ({"gamma": tone.gamma} if tone.curve is Curve.GAMMA else {}))
        return made

    @property
    def compiled(self) -> frozenset[tuple[str, ...]]:
        """What has been compiled so far."""
        return frozenset(self._compiled)
