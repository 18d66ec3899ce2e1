"""The command `lfview`: finds the verb, runs it, and turns errors into one sentence and an exit code.

Exit codes: 0 done, 1 a bug of the program, 2 bad input, 130 Ctrl-C, 141 nobody reads on, 143 terminated. Imports stay light
here and in the verbs' modules, so that `lfview --help` answers at once: the window, torch and the readers are imported by the
verb that needs them.
"""

from __future__ import annotations

import argparse
import contextlib
import difflib
import errno
import os
import signal
import sys
import threading
import traceback
from collections.abc import Sequence
from pathlib import Path
from types import FrameType
from typing import NoReturn

from app.cli import bench, cache, decode, evaluate, generate, info, sweep, synth, train, view
from lfcore.errors import LfviewError, is_out_of_memory
from lfcore.patience import wait_shortly

VERBS = {
    "view": view,
    "info": info,
    "decode": decode,
    "synth": synth,
    "sweep": sweep,
    "eval": evaluate,
    "train": train,
    "generate": generate,
    "bench": bench,
    "cache": cache,
}

_EXAMPLES = """examples:
  lfview                                      open the viewer on the sample light field
  lfview capture.png                          the same on a light field of yours
  lfview info capture.png
  lfview decode captures/ --out decoded/
  lfview synth capture.png --uv 0.3,0.7 --out view.png
  lfview sweep capture.png --path circle --frames 60 --fps 30 --out sweep.mp4
  lfview eval scenes/* --model full --model mean --json scores.json --out figures
  lfview train --data training/* --val held_out/* --out weights.safetensors --minutes 60
  lfview generate --count 12 --textures photographs/ --out scenes/
  lfview bench --json bench.json
  lfview cache --clear
`lfview VERB --help` tells more."""


_WITH_PAIRS = ("--uv", "--from", "--to", "--focus")


class _Parser(argparse.ArgumentParser):
    """An argument parser whose complaint is one sentence."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{self.prog}: {message}; see {self.prog} --help.\n")


class _Version(argparse.Action):
    """Prints the version; looked up only when asked for."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object, **__: object) -> NoReturn:
        from importlib.metadata import PackageNotFoundError, version

        try:
            number = version("lfview")
        except PackageNotFoundError:
            number = "(run from a checkout, not installed)"
        print(f"lfview {number}")
        parser.exit()


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    _open_closed_streams()
    given = list(sys.argv[1:] if arguments is None else arguments)
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, _terminate)
    try:
        options = _parser().parse_args(_normalised(given))
    except SystemExit as stop:  # argparse's way out after --help or a complaint
        return stop.code if isinstance(stop.code, int) else 2
    wait_shortly()
    try:
        status: int = options.run(options)
        sys.stdout.flush()
    except LfviewError as error:
        _say(f"lfview: {error}")
        return 2
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:
        # Whoever read the output has gone; give the interpreter something to flush into at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 141
    except OSError as error:
        if error.errno != errno.ENOSPC and error.filename is None:
            return _bug(error, options.debug)
        if error.errno != errno.ENOSPC:
            _say(
                f"lfview: {error.filename} cannot be used: {error.strerror}; check its name, where it lies and its permissions."
            )
            return 2
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        _say("lfview: there is no room left for what was to be written; make some, or write elsewhere.")
        return 2
    except Exception as error:
        if is_out_of_memory(error):
            _say("lfview: there is not enough memory for this; use a smaller light field or close other programs.")
            return 2
        return _bug(error, options.debug)
    return status


def _open_closed_streams() -> None:
    """What is written to a standard output or error that the caller has closed is for nobody."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, Path(os.devnull).open("w", encoding="utf-8"))  # noqa: SIM115, open to the end


def _bug(error: Exception, debug: bool) -> int:
    """Say that this should not have happened; returns the exit code."""
    if debug:
        traceback.print_exc()
    _say(
        f"lfview: this is a bug ({type(error).__name__}: {error}); run the same command with --debug and report what it prints."
    )
    return 1


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="lfview",
        description="View light fields and synthesize any view between their corner views.",
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="print the version and leave")
    parser.add_argument("--debug", action="store_true", help="print the traceback of an unexpected error")
    verbs = parser.add_subparsers(metavar="VERB", required=True, title="verbs (none: view)")
    for name, module in VERBS.items():
        module.add_parser(verbs, name)
    return parser


def _normalised(given: list[str]) -> list[str]:
    """The arguments with --debug first, `view` put in where there is no verb, and values of pairs tied to their options."""
    arguments: list[str] = []
    for argument in given:
        if arguments and arguments[-1] in _WITH_PAIRS:
            arguments[-1] += f"={argument}"  # argparse would take "-0.1,0.5" for an option
        elif argument != "--debug":
            arguments.append(argument)
    debug = ["--debug"] if "--debug" in given else []
    first = arguments[0] if arguments else "view"
    if first in VERBS or first in ("-h", "--help", "--version"):
        return debug + (arguments or ["view"])
    if not first.startswith("-"):
        _check_not_a_typo(first)
    return [*debug, "view", *arguments]


def _check_not_a_typo(word: str) -> None:
    """Say so where a word that is no file looks like a verb."""
    near = difflib.get_close_matches(word, VERBS, n=1, cutoff=0.7)
    if near and not Path(word).exists():
        _say(f"lfview: there is no verb or file {word!r}; did you mean {near[0]!r}?")
        raise SystemExit(2)


def _say(sentence: str) -> None:
    with contextlib.suppress(OSError):
        print(sentence, file=sys.stderr)


def _terminate(number: int, frame: FrameType | None) -> NoReturn:
    """SIGTERM as an exception, so that temporary files are removed on the way out."""
    raise SystemExit(128 + number)


if __name__ == "__main__":
    sys.exit(main())
