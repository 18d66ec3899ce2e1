"""`lfview cache`: what is kept on disk of past syntheses, decoded captures and thumbnails, and how to be rid of it."""

from __future__ import annotations

import argparse
from typing import Any

from app.cli.common import Verbs, add_verb, write_json


def add_parser(verbs: Verbs[Any], name: str) -> None:
    """Declare the verb."""
    parser = add_verb(
        verbs,
        name,
        "say how much is kept on disk of past syntheses, decoded captures and thumbnails, or remove it",
        "lfview cache --clear\n\nThe environment variable LFVIEW_CACHE names another folder.",
    )
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--info", action="store_true", help="say where it is and how much it holds (default)")
    what.add_argument("--clear", action="store_true", help="remove all of it")
    parser.add_argument("--json", action="store_true", help="print JSON instead of text")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Print what the stores hold, after clearing them if asked to."""
    from lfcore.decode.kept import default_store
    from lfcore.kept_files import default_root
    from lfcore.store import ViewStore
    from lfcore.thumbnails import default_store as thumbnail_store

    store = ViewStore(default_root())
    decoded = default_store()
    before = store.usage()
    captures, captures_bytes = decoded.usage()
    thumbnails = thumbnail_store()
    small, small_bytes = thumbnails.usage()
    if options.clear:
        store.clear()
        decoded.clear()
        thumbnails.clear()
    usage = store.usage()
    if options.json:
        removed = before.views - usage.views
        facts = {"folder": str(store.root), "views": usage.views, "light_fields": usage.light_fields, "bytes": usage.bytes}
        left, left_bytes = decoded.usage()
        facts |= {"removed": removed, "decoded_captures": left, "decoded_bytes": left_bytes}
        left, left_bytes = thumbnails.usage()
        write_json({**facts, "thumbnails": left, "thumbnail_bytes": left_bytes}, "-")
    elif options.clear:
        print(f"{store.root}: {_views(before.views)} removed, {before.bytes / 2**20:.1f} MiB")
        print(f"decoded captures: {captures} removed, {captures_bytes / 2**20:.1f} MiB")
        print(f"thumbnails: {small} removed, {small_bytes / 2**20:.1f} MiB")
    else:
        fields = "1 light field" if usage.light_fields == 1 else f"{usage.light_fields} light fields"
        print(f"{store.root}: {_views(usage.views)} of {fields}, {usage.bytes / 2**20:.1f} MiB")
        print(f"decoded captures: {captures}, {captures_bytes / 2**20:.1f} MiB")
        print(f"thumbnails: {small}, {small_bytes / 2**20:.1f} MiB")
    return 0


def _views(count: int) -> str:
    return "1 view" if count == 1 else f"{count} views"
