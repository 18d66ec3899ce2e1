"""From the names in a folder to a grid of views: which file is the view in which row and column."""

from __future__ import annotations

import configparser
import math
import re
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path

from lfcore.errors import InputError

Index = tuple[int, int]

_GANTRY = re.compile(r"out_(\d+)_(\d+)_(-?\d+(?:\.\d+)?)_(-?\d+(?:\.\d+)?)_?", re.IGNORECASE)
_HCI = re.compile(r"input_cam(\d+)", re.IGNORECASE)
# Families of names taken before any other when a folder holds several of one size (views beside depth maps, say).
_PREFERRED = re.compile(r"(view|lf|input_cam|out|sai)", re.IGNORECASE)

GANTRY = "Stanford gantry folder"

RULES = "view_RR_CC, lf_R_C, input_CamNNN, out_RR_CC_Y_X, or any names with the row and the column as two whole numbers"


@dataclass(frozen=True)
class Grid:
    """The views of a folder: the file of each (row, column) from 0 without gaps, and what else the names tell."""

    kind: str
    files: Mapping[Index, Path]
    rows: int
    columns: int
    facts: Mapping[str, str] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    between: tuple[int, int] = (0, 0)  # numbers of rows, and of columns, left out between two that are there

    @property
    def steps(self) -> tuple[int, int]:
        """Rows and columns from corner to corner, those that are left out counted."""
        return (self.rows - 1) * (self.between[0] + 1), (self.columns - 1) * (self.between[1] + 1)


def find_grid(folder: Path, pictures: Sequence[Path]) -> Grid:
    """The grid of views among the picture files of a folder.

    Files are grouped by their names with the digits left out; the largest group is taken. Raises InputError where there
    is no such group, two are equally likely, or a view is missing or there twice.
    """
    families = _families(pictures)
    if not families:
        raise InputError(f"{folder} holds no pictures; expected one file per view, named {RULES}.")
    template, files = _choose(folder, families)
    if len(files) == 1:
        raise InputError(
            f"{folder} holds one view only ({files[0].name}); a light field needs at least its four corner views, "
            f"named {RULES}."
        )
    if template == "gantry":
        grid = _gantry(folder, files)
    elif template == "hci":
        grid = _hci(folder, files)
    else:
        grid = _two_numbers(folder, files)
    ignored = len(pictures) - len(files)
    if not ignored:
        return grid
    facts = {**grid.facts, "Other pictures": f"{ignored} in the folder, not part of the grid"}
    return replace(grid, facts=facts)


def belongs_to_grid(file: Path, pictures: Sequence[Path]) -> bool:
    """Whether `file` looks like one view of a grid made by its neighbours: three or more alike, two numbers varying; or one,
    where names such as view_00_01 say what they are."""
    template = _template(file)
    files = _families(pictures).get(template, [])
    if template in ("gantry", "hci"):
        return len(files) > 1
    numbers = [_numbers(name) for name in files]
    varying = len(_row_and_column(numbers))
    said = bool(_PREFERRED.match(file.stem)) and len(numbers[0]) >= 2
    return len(files) >= 3 and (varying == 2 or (varying == 1 and said))


def _template(file: Path) -> str:
    if _GANTRY.fullmatch(file.stem):
        return "gantry"
    if _HCI.fullmatch(file.stem):
        return "hci"
    return re.sub(r"\d+", "#", file.stem) + file.suffix.lower()


def _families(pictures: Iterable[Path]) -> dict[str, list[Path]]:
    families: dict[str, list[Path]] = defaultdict(list)
    for picture in sorted(pictures):
        families[_template(picture)].append(picture)
    return families


def _choose(folder: Path, families: Mapping[str, list[Path]]) -> tuple[str, list[Path]]:
    most = max(len(files) for files in families.values())
    largest = {template: files for template, files in families.items() if len(files) == most}
    if len(largest) > 1:
        preferred = {template: files for template, files in largest.items() if _PREFERRED.match(files[0].name)}
        largest = preferred if len(preferred) == 1 else largest
    if len(largest) > 1 and most > 1:
        first, second = (files[0].name for files in list(largest.values())[:2])
        raise InputError(
            f"{folder} holds two sets of {most} pictures, such as {first} and {second}; leave one set of views there."
        )
    return next(iter(largest.items()))


def _numbers(file: Path) -> list[int]:
    return [int(digits) for digits in re.findall(r"\d+", file.stem)]


def _varying(numbers: Sequence[Sequence[int]]) -> list[int]:
    """Positions at which the numbers of the names differ."""
    return [position for position, values in enumerate(zip(*numbers, strict=True)) if len(set(values)) > 1]


def _two_numbers(folder: Path, files: Sequence[Path]) -> Grid:
    numbers = [_numbers(file) for file in files]
    varying = _row_and_column(numbers)
    if len(varying) != 2:
        names = f"{files[0].name} .. {files[-1].name}"
        if len(varying) == 1 and len(numbers[0]) >= 2:
            raise InputError(
                f"{folder} holds {len(files)} views in a single row or column ({names}); "
                "a light field needs at least two rows and two columns."
            )
        raise InputError(
            f"{folder} holds {len(files)} pictures ({names}) whose names do not give a row and a column; expected {RULES}."
        )
    indexed = [((values[varying[0]], values[varying[1]]), file) for values, file in zip(numbers, files, strict=True)]
    return _arrange(folder, "folder of views", indexed)


def _row_and_column(numbers: Sequence[Sequence[int]]) -> list[int]:
    """Positions of the row and the column among the numbers of the names, or of whatever varies where they are not two.

    Where more than two vary (a running number before them, a position behind them), the first or the last two are taken if
    they number every place of a full grid once.
    """
    varying = _varying(numbers)
    for pair in (varying[:2], varying[-2:]):
        rows, columns = ({values[position] for values in numbers} for position in pair) if len(pair) == 2 else ((), ())
        places = {tuple(values[position] for position in pair) for values in numbers}
        if len(places) == len(numbers) == len(rows) * len(columns):
            return pair
    return varying


def _arrange(folder: Path, kind: str, indexed: Iterable[tuple[Index, Path]]) -> Grid:
    """Renumber rows and columns from 0; refuse gaps and repeats, naming the view."""
    files: dict[Index, Path] = {}
    for index, file in indexed:
        if index in files:
            raise InputError(
                f"{folder} holds the view in row {index[0]}, column {index[1]} twice: {files[index].name} and "
                f"{file.name}; remove one of them."
            )
        files[index] = file
    rows = _even_steps(folder, "row", {row for row, _ in files})
    columns = _even_steps(folder, "column", {column for _, column in files})
    missing = [(row, column) for row in rows for column in columns if (row, column) not in files]
    if missing:
        more = f" (and {len(missing) - 1} more)" if len(missing) > 1 else ""
        pattern = next(iter(files.values())).name
        raise InputError(
            f"{folder} lacks the view in row {missing[0][0]}, column {missing[0][1]}{more}: found {len(files)} of "
            f"{len(rows)} x {len(columns)} views named like {pattern}; add what is missing."
        )
    ordered = {(i, j): files[row, column] for i, row in enumerate(rows) for j, column in enumerate(columns)}
    facts = {}
    if (rows[0], columns[0]) != (0, 0) or rows[1:2] != [1] or columns[1:2] != [1]:
        facts["Numbers in the names"] = f"rows {_listed(rows)}; columns {_listed(columns)}"
    if len(rows) == len(columns) == 2:
        kind = "corner views"
    between = rows[1] - rows[0] - 1, columns[1] - columns[0] - 1
    return Grid(kind, ordered, len(rows), len(columns), facts, between=between)


def _even_steps(folder: Path, axis: str, numbers: set[int]) -> list[int]:
    ordered = sorted(numbers)
    if len(ordered) < 2:
        raise InputError(f"{folder} holds views of a single {axis} ({ordered[0]}); a light field needs at least two.")
    step = min(after - before for before, after in pairwise(ordered))
    for before, after in pairwise(ordered):
        if after - before != step:
            raise InputError(
                f"{folder} lacks {axis} {before + step} of its views: found {axis}s {_listed(ordered)}, which are not "
                "evenly spaced; add what is missing."
            )
    return ordered


def _listed(numbers: Sequence[int]) -> str:
    if len(numbers) <= 4:
        return ", ".join(map(str, numbers))
    return f"{numbers[0]}, {numbers[1]}, .., {numbers[-1]}"


def _gantry(folder: Path, files: Sequence[Path]) -> Grid:
    """Stanford's gantry: out_ROW_COLUMN_Y_X with the camera's position.

    The archive's scenes differ in the direction in which the columns are counted; the positions tell: x grows to the
    right in all of them, so the columns are put in the order of x. The sign of y differs between scenes: not used.
    """
    indexed, positions = [], []
    for file in files:
        match = _GANTRY.fullmatch(file.stem)
        assert match is not None
        indexed.append(((int(match[1]), int(match[2])), file))
        positions.append((int(match[2]), float(match[4])))
    grid = _arrange(folder, GANTRY, indexed)
    low, high = min(column for column, _ in positions), max(column for column, _ in positions)
    first = [x for column, x in positions if column == low]
    last = [x for column, x in positions if column == high]
    mean_first, mean_last = sum(first) / len(first), sum(last) / len(last)
    facts = dict(grid.facts)
    facts["Camera x"] = f"{mean_first:.6g} in the first column of the names, {mean_last:.6g} in the last"
    ordered = grid.files
    if mean_last < mean_first:
        ordered = {(row, grid.columns - 1 - column): file for (row, column), file in ordered.items()}
        facts["Column order"] = "reversed against the names, so that the camera moves to the right"
    return Grid(GANTRY, ordered, grid.rows, grid.columns, facts)


def _hci(folder: Path, files: Sequence[Path]) -> Grid:
    """The HCI 4D benchmark: input_CamNNN, row-major from the top left; parameters.cfg tells the size of the grid."""
    config = folder / "parameters.cfg"
    warnings: tuple[str, ...] = ()
    if config.is_file():
        rows, columns, facts = read_hci_parameters(config)
    else:
        rows = columns = math.isqrt(len(files))
        facts = {}
        if rows * columns != len(files):
            raise InputError(
                f"{folder} holds {len(files)} pictures input_CamNNN, which make no square grid, and no parameters.cfg "
                "(num_cams_x, num_cams_y) that gives its size; add the missing views or that file."
            )
        warnings = (f"No parameters.cfg beside the views: {rows} x {columns} taken from their number.",)
    numbered = {int(match[1]): file for file in files if (match := _HCI.fullmatch(file.stem))}
    missing = [number for number in range(rows * columns) if number not in numbered]
    if missing:
        raise InputError(
            f"{folder} lacks the view input_Cam{missing[0]:03}: found {len(files)} of {rows} x {columns} = "
            f"{rows * columns} views; add what is missing."
        )
    if len(numbered) != len(files) or len(files) != rows * columns:
        raise InputError(
            f"{folder} holds {len(files)} views input_CamNNN, but parameters.cfg speaks of {rows} x {columns}; remove "
            "what is too many or correct that file."
        )
    ordered = {divmod(number, columns): file for number, file in numbered.items()}
    return Grid("HCI folder", ordered, rows, columns, facts, warnings)


def read_hci_parameters(config: Path) -> tuple[int, int, dict[str, str]]:
    """Rows, columns and facts from an HCI parameters.cfg. Raises InputError where the grid's size is not in it."""
    parser = configparser.ConfigParser(interpolation=None)
    try:
        parser.read_string(config.read_text(encoding="utf-8", errors="replace"))
        rows = parser.getint("extrinsics", "num_cams_y")
        columns = parser.getint("extrinsics", "num_cams_x")
    except (configparser.Error, ValueError, OSError) as error:
        reason = str(error).splitlines()[0]
        raise InputError(
            f"{config} does not give the grid's size ({reason}); expected num_cams_x and num_cams_y under [extrinsics]."
        ) from error
    if not (2 <= rows <= 1000 and 2 <= columns <= 1000):
        raise InputError(f"{config} speaks of {rows} x {columns} views; expected at least 2 x 2.")
    facts = {}
    for fact, section, key, unit in _HCI_FACTS:
        value = parser.get(section, key, fallback="").strip()
        if value:
            facts[fact] = f"{value} {unit}".strip()
    try:
        near, far = parser.getfloat("meta", "disp_max"), parser.getfloat("meta", "disp_min")
    except (configparser.Error, ValueError):
        return rows, columns, facts
    # HCI counts nearer as positive: there the content moves to smaller x as the column grows.
    facts["Disparity stated"] = f"{-near:g} to {-far:g} px between neighbouring views (from disp_max, disp_min)"
    return rows, columns, facts


_HCI_FACTS = (
    ("Scene", "meta", "scene", ""),
    ("Focal length", "intrinsics", "focal_length_mm", "mm"),
    ("Sensor size", "intrinsics", "sensor_size_mm", "mm"),
    ("f-number", "intrinsics", "fstop", ""),
    ("Baseline", "extrinsics", "baseline_mm", "mm between neighbouring cameras"),
    ("Focus distance", "extrinsics", "focus_distance_m", "m"),
)
