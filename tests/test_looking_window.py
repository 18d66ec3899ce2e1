"""Ways of looking in the real window: keys and mouse on a virtual screen, and what is then on the screen."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
from moving_scene import DISPARITY, light_field, truth
from test_whole_program import BESIDE, EXACT, INSIDE, PROGRAM, VIEW, save, shown, shows
from virtual_screen import VirtualScreen, comes, wait_until

from app.looking import LEVEL_STEP
from app.tone import Curve, Tone, toned
from lfcore import colormaps
from lfcore.colormaps import ColourMap


def test_tones_insides_sway_and_the_inspector(screen: VirtualScreen, tmp_path: Path) -> None:
    stored = truth(0.5, 0.5, VIEW)
    lowest = np.broadcast_to(colormaps.colours(ColourMap.VIRIDIS)[0] / 255, (*VIEW, 3))
    above = slice(0, VIEW[0] // 2)  # legends lie over the lower part

    def mostly_lowest() -> bool:
        # One step of 8 bits is a thirtieth of the range.
        return float(np.quantile(np.abs(shown(screen) - lowest)[INSIDE][above], 0.9)) <= 0.06

    with screen.program(PROGRAM, str(save(light_field(4, 4, VIEW), tmp_path))) as program:
        wait_until(lambda: screen.pixels().max() > 100, "the window")
        screen.xdotool("mousemove", *BESIDE)
        wait_until(lambda: (screen.xdotool("key", "z"), shows(screen, stored, EXACT))[1], "the first synthesis")

        screen.xdotool("key", "x")
        wait_until(lambda: shows(screen, toned(stored, Tone(stops=0.5)), EXACT), "half a stop more")
        screen.xdotool("key", "shift+x")  # and G only then: within one frame it would count as pressed with Shift
        wait_until(lambda: shows(screen, stored, EXACT), "half a stop less")
        screen.xdotool("key", "g")
        wait_until(lambda: shows(screen, toned(stored, Tone(Curve.SRGB)), EXACT), "sRGB")
        screen.xdotool("key", "t")
        wait_until(lambda: shows(screen, toned(stored, Tone(Curve.AUTHORS)), EXACT), "the authors' tone")
        screen.xdotool("key", "t")
        wait_until(lambda: shows(screen, stored, EXACT), "values as they are stored")

        # The sweep matches at the level of the scene, and the warped inputs agree at its true disparity.
        screen.xdotool("key", "shift+0")
        wait_until(lambda: not shows(screen, stored, 0.1) and not mostly_lowest(), "the deviation at level 0")
        for _ in range(round(-DISPARITY / LEVEL_STEP)):
            screen.xdotool("key", "Next")
        wait_until(mostly_lowest, "no deviation at the scene's level")
        screen.xdotool("key", "1")
        wait_until(lambda: shows(screen, stored, EXACT), "the synthesis")
        screen.xdotool("key", "0")
        wait_until(mostly_lowest, "no disagreement")
        screen.xdotool("key", "1")
        wait_until(lambda: shows(screen, stored, EXACT), "the synthesis again")

        card = screen.pixels()[560:760, 700:980]
        screen.xdotool("key", "v")
        wait_until(lambda: (screen.pixels()[560:760, 700:980] != card).mean() > 0.2, "the inspector")
        screen.xdotool("key", "v")
        wait_until(lambda: np.array_equal(screen.pixels()[560:760, 700:980], card), "the inspector to go")

        screen.xdotool("key", "b")
        wait_until(lambda: not shows(screen, stored, 4 * EXACT), "the picture to move by itself")
        screen.xdotool("key", "b", "Home")
        wait_until(lambda: shows(screen, stored, EXACT), "the centre")
        time.sleep(0.5)
        assert shows(screen, stored, EXACT)

        # A double click fits, the next one goes back to 1:1.
        for _ in range(10):  # two clicks are a double click where the window draws frames fast enough
            screen.xdotool("click", "--repeat", 2, "--delay", 60, 1)
            if comes(lambda: not shows(screen, stored, 0.1), 3.0):
                break
        assert not shows(screen, stored, 0.1)  # the fitted picture
        screen.xdotool("key", "z")
        wait_until(lambda: shows(screen, stored, EXACT), "1:1")

        screen.xdotool("key", "ctrl+q")
        assert program.wait(30) == 0
        assert program.stderr is not None
        assert program.stderr.read() == ""
