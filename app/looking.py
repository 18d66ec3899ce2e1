"""How pictures and maps are looked at: tone, colours, range, level. One value, so that it is undone and kept as one."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from app.tone import Curve, Tone


@dataclass(frozen=True)
class Looking:
    """What belongs to looking, beyond the look itself."""

    tone: Tone = field(default_factory=Tone)

    def bounded(self) -> Looking:
        """With everything held within its limits."""
        return replace(self, tone=self.tone.bounded())

    def brightened_or_not(self) -> Looking:
        """In the authors' tone, or as stored where it was in that."""
        curve = Curve.STORED if self.tone.curve is Curve.AUTHORS else Curve.AUTHORS
        return replace(self, tone=replace(self.tone, curve=curve))
