"""`lfview cache`: what is kept on disk of past syntheses, decoded captures and thumbnails, and how to be rid of it."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from app.cli.common import Verbs, add_verb, write_json
from lfcore.errors import OutputError

if TYPE_CHECKING:
    from lfcore.kept_files import FileStore
    from lfcore.store import ViewStore


def add_parser(verbs: Verbs[Any], name: str) -> None:
    """Declare the verb."""
    parser = add_verb(
        verbs,
        name,
        "say how much is kept on disk of past syntheses, decoded captures and thumbnails, or remove it",
        "lfview cache --clear\n\nThe environment variable LFVIEW_CACHE names another folder.",
    )
    parser.add_argument("--clear", action="store_true", help="remove all of it")
    parser.add_argument("--json", action="store_true", help="print JSON instead of text")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Print what the stores hold, after clearing them if asked to."""
    from lfcore.decode.kept import default_store
    from lfcore.kept_files import default_root
    from lfcore.store import ViewStore
    from lfcore.thumbnails import default_store as thumbnail_store

    store, decoded, thumbnails = ViewStore(default_root()), default_store(), thumbnail_store()
    files = {"decoded captures": decoded, "thumbnails": thumbnails}
    views_before = store.usage()
    files_before = {name: kept.usage() for name, kept in files.items()}
    failures = _clear([store, decoded, thumbnails]) if options.clear else []
    usage, left = store.usage(), {name: kept.usage() for name, kept in files.items()}
    if options.json:
        facts = {"folder": str(store.root), "views": usage.views, "light_fields": usage.light_fields, "bytes": usage.bytes}
        facts["removed"] = views_before.views - usage.views
        facts |= dict(zip(("decoded_captures", "decoded_bytes"), left["decoded captures"], strict=True))
        write_json(facts | dict(zip(("thumbnails", "thumbnail_bytes"), left["thumbnails"], strict=True)), "-")
    elif options.clear:
        print(f"{store.root}: {_views(views_before.views - usage.views)} removed, {_mib(views_before.bytes - usage.bytes)}")
        for name, (count, size) in files_before.items():
            print(f"{name}: {count - left[name][0]} removed, {_mib(size - left[name][1])}")
    else:
        fields = "1 light field" if usage.light_fields == 1 else f"{usage.light_fields} light fields"
        print(f"{store.root}: {_views(usage.views)} of {fields}, {_mib(usage.bytes)}")
        for name, (count, size) in left.items():
            print(f"{name}: {count}, {_mib(size)}")
    if failures:
        raise OutputError(" ".join(failures))
    return 0


def _clear(stores: Sequence[ViewStore | FileStore]) -> list[str]:
    """Clear all of them, also where one cannot be cleared wholly; what there is to say of those."""
    failures = []
    for store in stores:
        try:
            store.clear()
        except OutputError as error:
            failures.append(str(error))
    return failures


def _mib(size: int) -> str:
    return f"{size / 2**20:.1f} MiB"


def _views(count: int) -> str:
    return "1 view" if count == 1 else f"{count} views"
