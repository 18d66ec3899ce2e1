import numpy as np
import pytest

from lfcore.errors import InputError
from lfcore.lightfield import CORNERS, LightField, as_float, check_viewpoint, is_extrapolated


def numbered(rows: int = 3, columns: int = 4) -> LightField:
    """Each view is filled with 10 * row + column."""
    views = np.zeros((rows, columns, 2, 5, 3), np.uint8)
    for r in range(rows):
        for c in range(columns):
            views[r, c] = 10 * r + c
    return LightField(views, "numbered", "generated", "generated")


def test_corners_come_in_the_order_of_the_colour_network() -> None:
    corners = numbered().corners() * 255
    assert [round(float(view.mean())) for view in corners] == [0, 20, 3, 23]  # top-left, bottom-left, top-right, bottom-right
    assert CORNERS == ((0, 0), (0, 1), (1, 0), (1, 1))


def test_columns_run_along_u_and_rows_along_v() -> None:
    field = numbered()
    assert field.position(0, 3) == (1, 0)
    assert field.position(2, 0) == (0, 1)
    assert field.nearest(0.34, 0.9) == (2, 1)
    assert field.nearest(-0.2, 1.2) == (2, 0)


def test_a_captured_view_is_found_only_where_it_sits() -> None:
    field = numbered()
    assert field.at(1 / 3, 0.5) == (1, 1)
    assert field.at(0.4, 0.5) is None


def test_the_key_depends_on_pixels_and_arrangement() -> None:
    field = numbered()
    assert field.content_key == numbered().content_key
    transposed = LightField(np.swapaxes(field.views, 0, 1).copy(), "t", "", "")
    brighter = LightField(field.views + np.uint8(1), "b", "", "")
    assert len({field.content_key, transposed.content_key, brighter.content_key}) == 3


def test_stored_values_become_floats_with_white_at_one() -> None:
    assert as_float(np.array([0, 255], np.uint8)).tolist() == [0, 1]
    assert as_float(np.array([0, 65535], np.uint16)).tolist() == [0, 1]
    assert as_float(np.array([0.5, 3], np.float32)).tolist() == [0.5, 3]


@pytest.mark.parametrize("shape", [(1, 5), (5, 1), (1, 1)])
def test_a_single_row_or_column_is_refused(shape: tuple[int, int]) -> None:
    with pytest.raises(InputError, match="at least 2 x 2"):
        LightField(np.zeros((*shape, 4, 4, 3), np.uint8), "line", "", "")


@pytest.mark.parametrize("u", [float("nan"), float("inf"), -0.26, 1.2501])
def test_viewpoints_that_are_no_numbers_or_too_far_out_are_refused(u: float) -> None:
    with pytest.raises(InputError, match="viewpoint"):
        check_viewpoint(u, 0.5)
    with pytest.raises(InputError, match="viewpoint"):
        check_viewpoint(0.5, u)


def test_a_little_extrapolation_is_allowed_and_known() -> None:
    check_viewpoint(-0.25, 1.25)
    assert is_extrapolated(-0.01, 0.5)
    assert not is_extrapolated(1, 0)
