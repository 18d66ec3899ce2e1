"""Which synthesis is on screen, and how far it has been faded in over what was there before."""

from __future__ import annotations

import math
from dataclasses import replace

from app.engine import Answer, disparity_range
from app.geometry import Point
from app.limits import within
from app.readout import ScoreText
from app.state import SEAMLESS, Step

FADE_SECONDS = 0.06
# A synthesis for a viewpoint that the hand has left is of use as long as it is not much farther off than the one at hand.
_FARTHER = 0.02
_SPAN_TAIL = 1.0  # per cent of the disparities left out at either end of the scene's span


class OnScreen:
    """The newest synthesis, and whether it is that of the viewpoint; one that comes during a fade waits for its end."""

    def __init__(self) -> None:
        self.newest: Answer | None = None  # carried by its disparity map to the viewpoint
        self.picture: Answer | None = None  # the same, where it was made for exactly the viewpoint
        self.span: tuple[float, float] | None = None  # least and greatest disparity of the scene, by the first map
        self._next: Answer | None = None
        self._now = 0.0
        self._fade_from = -math.inf

    def clear(self) -> None:
        """Nothing is on screen."""
        self.newest = self.picture = self._next = self.span = None

    @property
    def share(self) -> float:
        """How far the newest synthesis has been faded in."""
        return within((self._now - self._fade_from) / FADE_SECONDS, (0.0, 1.0))

    def pass_time(self, now: float) -> None:
        """It is `now`, in seconds, perhaps long after the last frame: what comes from now on fades in from now on."""
        self._now = now

    def go_on(self, here: Point) -> None:
        """What waited for the end of a fade may follow."""
        if self._next is not None and self.share >= 1.0:
            answer, self._next = self._next, None
            self.accept(answer, here)

    def accept(self, answer: Answer, here: Point) -> None:
        """Show an answer at the viewpoint `here`, unless something better is there, once that has been faded in."""
        exact = viewpoint_of(answer) == here
        if self.picture is not None and (not exact or (self.picture.final and not answer.final)):
            return
        if self.newest is not None and not exact:
            distance = math.dist(viewpoint_of(self.newest), here)
            if math.dist(viewpoint_of(answer), here) > distance + _FARTHER:
                return
        if self.newest is not None and self.share < 1.0:
            self._next = answer
            return
        same = self.picture is not None and self.picture.final  # as on screen, but now with its score
        if not same and not self._follows_seamlessly(answer):
            self._fade_from = self._now
        self.newest = answer
        if self.span is None and answer.percentiles is not None:
            self.span = disparity_range(answer.percentiles, _SPAN_TAIL)
        if exact:
            self.picture = answer

    def move(self, here: Point, known: Answer | None) -> None:
        """The viewpoint has moved to `here`; what is known of it is on screen at once, without a fade."""
        self.picture = known
        if known is not None:
            self.newest, self._next = known, None
            self._fade_from = -math.inf
        elif self.newest is not None and viewpoint_of(self.newest) == here:
            self.picture = self.newest

    def outdate(self) -> None:
        """Another model has been chosen: what is on screen stays until its first picture is there."""
        self._next = None
        if self.newest is not None:
            self.newest = replace(self.newest, final=False)

    def score(self, score: ScoreText | None) -> None:
        """The picture has another score."""
        if self.picture is not None:
            self.picture = replace(self.picture, score=score)

    def _follows_seamlessly(self, answer: Answer) -> bool:
        """Whether the answer can take the place of what is on screen without a fade: one quick synthesis after another,
        carried a short way, differ by less than can be seen (docs/speed.md), and a fade would only cost time."""
        newest = self.newest
        if newest is None or not newest.step is answer.step is Step.REALTIME:
            return False
        return math.dist(viewpoint_of(newest), viewpoint_of(answer)) <= SEAMLESS


def viewpoint_of(answer: Answer) -> Point:
    """(u, v) for which an answer was made."""
    return answer.synthesis.u, answer.synthesis.v
