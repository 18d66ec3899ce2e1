"""What lies around the picture: files to choose from, undo, the palette, settings, the look of the interface itself."""

from __future__ import annotations

from app.commands.kinds import PROGRAM, Action, Ask, Browse, Command, Context, Needs, Run, request
from app.desk import Card
from app.dialogs import Purpose
from app.settings import Theme


def _card(card: Card) -> Run:
    def run(context: Context) -> None:
        context.state.help = context.state.path_field = False
        context.state.desk.toggle(card)

    return run


def _browse(context: Context) -> None:
    desk = context.state.desk
    if desk.card is Card.BROWSER:
        desk.card = None
        return
    context.state.help = context.state.path_field = False
    desk.show(Card.BROWSER)
    context.requests.append(Browse(None))


def _show_path_field(context: Context) -> None:
    context.state.path_field = True
    context.state.help = False
    context.state.desk.card = None


def _other_theme(context: Context) -> None:
    desk = context.state.desk
    desk.theme = Theme.DARK if desk.theme is Theme.LIGHT else Theme.LIGHT


def _scale(steps: int) -> Run:
    def run(context: Context) -> None:
        context.state.desk.change_scale(steps, context.scale)

    return run


def _own_scale(context: Context) -> None:
    context.state.desk.scale = None


_ANYTIME = Needs.NOTHING

COMMANDS: dict[str, Command] = {
    "open": Command(("Ctrl+O",), "Open a file", PROGRAM, request(Ask(Purpose.OPEN_FILE)), _ANYTIME),
    "open folder": Command(("Ctrl+Shift+B",), "Open a folder", PROGRAM, request(Ask(Purpose.OPEN_FOLDER)), _ANYTIME),
    "path": Command(("Ctrl+Shift+O",), "Open a file or folder by its path", PROGRAM, _show_path_field, _ANYTIME),
    "reopen": Command(("Ctrl+R",), "Open it again, as it is now on disk", PROGRAM, request(Action.REOPEN), Needs.PICTURE),
    "browse": Command(("Ctrl+B",), "Show the light fields of the folder, with pictures", PROGRAM, _browse, _ANYTIME),
    "undo": Command(("Ctrl+Z",), "Undo the last change of the view", PROGRAM, request(Action.UNDO)),
    "redo": Command(("Ctrl+Y", "Ctrl+Shift+Z"), "Redo what was undone", PROGRAM, request(Action.REDO)),
    "palette": Command(("Ctrl+P", "Ctrl+Shift+P", "/"), "Find a command by its words", PROGRAM, _card(Card.PALETTE), _ANYTIME),
    "settings": Command(("Ctrl+Comma",), "Settings", PROGRAM, _card(Card.SETTINGS), _ANYTIME),
    "forget": Command((), "Forget the recent files, and how files were looked at", PROGRAM, request(Action.FORGET), _ANYTIME),
    "theme": Command(("Ctrl+Shift+L",), "Light or dark interface", PROGRAM, _other_theme, _ANYTIME),
    "larger": Command(("Ctrl+Plus",), "Larger interface", PROGRAM, _scale(1), _ANYTIME),
    "smaller": Command(("Ctrl+Minus",), "Smaller interface", PROGRAM, _scale(-1), _ANYTIME),
    "own scale": Command(("Ctrl+0",), "Interface in the scale of the monitor", PROGRAM, _own_scale, _ANYTIME),
}
