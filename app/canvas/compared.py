"""The synthesis against the captured view."""

from __future__ import annotations

import moderngl

from app.canvas.passes import Passes
from app.canvas.synthesized import Synthesized
from app.canvas.textures import Textures
from app.geometry import Point
from app.tone import Tone


class Compared:
    """Makes pictures of differences at the light field's own size."""

    def __init__(self, passes: Passes, textures: Textures, synthesized: Synthesized) -> None:
        self._passes = passes
        self._textures = textures
        self._synthesized = synthesized

    def error(self, viewpoint: Point, share: float, gain: float) -> moderngl.Texture:
        """Absolute difference of what is shown at the viewpoint from the captured view, multiplied by the gain."""
        textures = self._textures
        result = textures.picture
        if not result.outdated("error", viewpoint, share, gain):
            return result.texture
        if textures.newest_at == viewpoint and share >= 1.0:
            # In float32, since the steps of 8 bits would be seen when they are multiplied by the gain.
            shown = self._synthesized.copied(textures.precise, textures.exact, 0, Tone())
        else:
            shown = self._synthesized.picture(viewpoint, share, Tone())
        result.target.use()
        self._passes.get("error.frag").render({"picture": shown.texture, "captured": textures.captured}, {"gain": gain})
        return result.texture
