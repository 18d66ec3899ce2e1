"""Which values lie behind the picture on screen: made anew when that changes."""

from __future__ import annotations

from app.comparison import Source
from app.engine import Answer
from app.samples import Samples
from lfcore.lightfield import LightField


class Sampler:
    """Keeps the samples of what is on screen for as long as that stays the same."""

    def __init__(self) -> None:
        self._samples: Samples | None = None
        self._partner: Answer | None = None
        self._source = Source.CAPTURED

    def take(
        self, light_field: LightField, picture: Answer, partner: Answer | None, source: Source, shows_captured: bool
    ) -> Samples:
        """The samples of a complete picture. source: what it is compared with; partner: that, where it is a model's."""
        last, synthesis = self._samples, picture.synthesis
        viewpoint = synthesis.u, synthesis.v
        if (
            last is None
            or last.light_field is not light_field
            or last.image is not synthesis.image
            or last.weights is not synthesis.weights
            or (last.viewpoint, last.shows_captured) != (viewpoint, shows_captured)
            or self._partner is not partner
            or self._source is not source
        ):
            place = light_field.at(*viewpoint)
            captured = light_field.views[place] if place is not None else None
            against = captured if source is Source.CAPTURED else partner.synthesis.image if partner is not None else None
            arrays = (synthesis.image, synthesis.disparity, captured, against)
            last = Samples(light_field, viewpoint, *arrays, shows_captured, synthesis.weights)
            self._samples, self._partner, self._source = last, partner, source
        return last
