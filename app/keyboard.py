"""Key names as printed on the caps, asked of imgui."""

from __future__ import annotations

from imgui_bundle import imgui

from app import commands

_KEYS: dict[str, tuple[imgui.Key, ...]] = {
    **{letter.upper(): (getattr(imgui.Key, letter),) for letter in "abcdefghijklmnopqrstuvwxyz"},
    **{digit: (getattr(imgui.Key, f"_{digit}"), getattr(imgui.Key, f"keypad{digit}")) for digit in "0123456789"},
    "Left": (imgui.Key.left_arrow,),
    "Right": (imgui.Key.right_arrow,),
    "Up": (imgui.Key.up_arrow,),
    "Down": (imgui.Key.down_arrow,),
    "Home": (imgui.Key.home,),
    "Tab": (imgui.Key.tab,),
    "Esc": (imgui.Key.escape,),
    "F1": (imgui.Key.f1,),
}
# Typed with different keys on different keyboards, so they are taken as characters.
_CHARACTERS = frozenset("?+=-,.")
_WHILE_TYPING = frozenset(("Esc", "F1"))
_REPEATING = frozenset(("Left", "Right", "Up", "Down"))


def run_pressed(context: commands.Context) -> None:
    """Run every command whose key goes down (or repeats) in this frame; while a text is typed, only with Ctrl, Esc, F1."""
    io = imgui.get_io()
    typing = io.want_text_input or context.state.path_field
    typed = "" if typing else "".join(map(chr, io.input_queue_characters))
    ctrl = io.key_ctrl or _ctrl_just_released()
    for name, command in commands.COMMANDS.items():
        if any(_pressed(key, typed, typing, ctrl) for key in command.keys) and not io.key_alt:
            commands.run(name, context)


def _pressed(name: str, typed: str, typing: bool, ctrl: bool) -> bool:
    if name in _CHARACTERS:
        return name in typed and not ctrl
    cap = name.removeprefix("Ctrl+")
    if ctrl != (cap != name) or (typing and not ctrl and name not in _WHILE_TYPING):
        return False
    return any(imgui.is_key_pressed(key, name in _REPEATING) for key in _KEYS[cap])


def _ctrl_just_released() -> bool:
    """In a slow frame both Ctrl and the key may come up again; the key still counts as pressed with Ctrl."""
    return imgui.is_key_released(imgui.Key.left_ctrl) or imgui.is_key_released(imgui.Key.right_ctrl)
