"""Key names as printed on the caps, asked of imgui."""

from __future__ import annotations

from dataclasses import dataclass

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
    "End": (imgui.Key.end,),
    "Enter": (imgui.Key.enter, imgui.Key.keypad_enter),
    "Backspace": (imgui.Key.backspace,),
    "Comma": (imgui.Key.comma,),
    "Plus": (imgui.Key.equal, imgui.Key.keypad_add),
    "Minus": (imgui.Key.minus, imgui.Key.keypad_subtract),
    "PgUp": (imgui.Key.page_up,),
    "PgDn": (imgui.Key.page_down,),
    **{f"F{number}": (getattr(imgui.Key, f"f{number}"),) for number in range(1, 13)},
}
# Typed with different keys on different keyboards, so they are taken as characters.
_CHARACTERS = frozenset("?+=-,./[]")
_SCROLLING = frozenset(("Up", "Down", "PgUp", "PgDn"))  # the page of keys, while it is shown
_WHILE_TYPING = frozenset(("Esc", "F1"))
_OF_FIELDS = frozenset(("Ctrl+Z", "Ctrl+Shift+Z", "Ctrl+Y"))  # undo what was typed in a field of text
_REPEATING = frozenset(("Left", "Right", "Up", "Down", "PgUp", "PgDn"))
_ALL = tuple(dict.fromkeys(key for keys in _KEYS.values() for key in keys))


def run_pressed(context: commands.Context) -> None:
    """Run every command whose key goes down (or repeats) in this frame; while a text is typed or a card
    takes the keys, only with Ctrl, Esc, F1."""
    io = imgui.get_io()
    if io.app_focus_lost:
        _release_all(context)
    typing = io.want_text_input or context.state.path_field or context.state.desk.card is not None
    typed = "" if typing else "".join(map(chr, io.input_queue_characters))
    if not typed and not any(imgui.is_key_down(key) or imgui.is_key_released(key) for key in _ALL):
        return  # as in nearly all frames; to go through the commands takes four times as long
    held = _Held(_or_just_released(io.key_ctrl, _CTRL), _or_just_released(io.key_shift, _SHIFT))
    for name, command in commands.COMMANDS.items():
        keys = [key for key in command.keys if not (context.state.help and key in _SCROLLING)]
        if any(_pressed(key, typed, typing, held) for key in keys) and not io.key_alt:
            commands.run(name, context)
        if command.released is not None and any(imgui.is_key_released(key) for cap in command.keys for key in _KEYS[cap]):
            command.released(context)


def _release_all(context: commands.Context) -> None:
    """Let go of all keys that do something while they are held: another window hears when they come up."""
    for command in commands.COMMANDS.values():
        if command.released is not None:
            command.released(context)


@dataclass(frozen=True)
class _Held:
    """The keys that are held together with others."""

    ctrl: bool
    shift: bool


_CTRL = (imgui.Key.left_ctrl, imgui.Key.right_ctrl)
_SHIFT = (imgui.Key.left_shift, imgui.Key.right_shift)


def _pressed(name: str, typed: str, typing: bool, held: _Held) -> bool:
    if name in _CHARACTERS:
        return name in typed and not held.ctrl
    ctrl, shift, cap = "Ctrl+" in name, "Shift+" in name, name.rsplit("+", 1)[-1]
    shifted = held.shift and cap != "Plus"  # which has its key to itself on some keyboards, and needs Shift on others
    if (held.ctrl, shifted) != (ctrl, shift) or (typing and not held.ctrl and name not in _WHILE_TYPING):
        return False
    if name in _OF_FIELDS and imgui.get_io().want_text_input:
        return False
    return any(imgui.is_key_pressed(key, cap in _REPEATING) for key in _KEYS[cap])


def _or_just_released(held: bool, keys: tuple[imgui.Key, ...]) -> bool:
    """In a slow frame both keys of a chord may come up again; they still count as pressed together."""
    return held or any(imgui.is_key_released(key) for key in keys)
