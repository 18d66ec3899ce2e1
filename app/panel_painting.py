"""imgui's panels painted by the processor (app.painting), where it does the graphics' work anyway."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from imgui_bundle import ImVec2, ImVec4, imgui

from app import painting
from app.painting import CORNER_BYTES, Box, Memory, Texture

_INDEX_BYTES = 4


@dataclass(frozen=True)
class Piece:
    """Triangles with one texture, within a rectangle. Its memory is imgui's, which keeps it until the next frame. number: the
    texture's."""

    box: Box
    number: int
    texture: Texture
    corners: Memory
    indices: Memory


def pieces_of(data: imgui.ImDrawData, size: tuple[int, int]) -> Sequence[Piece] | None:
    """What a frame of (width, height) pixels consists of, in the order in which it is painted. None where the graphics have to
    draw it: of textures some are not imgui's own, or the graphics have yet to be told of a change in them."""
    if not painting.compiled() or imgui.INDEX_SIZE != _INDEX_BYTES or imgui.VERTEX_SIZE != CORNER_BYTES:
        return None
    textures = _textures(data)
    if textures is None:
        return None
    pieces: list[Piece] = []
    for drawn in data.cmd_lists:
        corners, indices = drawn.vtx_buffer, drawn.idx_buffer
        for command in drawn.cmd_buffer:
            number = command.get_tex_id()
            texture = textures.get(number)
            if texture is None:
                return None
            first, count = command.vtx_offset, command.elem_count
            if count == 0:
                continue
            own_corners = _memory(corners.data_address() + CORNER_BYTES * first, CORNER_BYTES * (corners.size() - first))
            own_indices = _memory(indices.data_address() + _INDEX_BYTES * command.idx_offset, _INDEX_BYTES * count)
            placed = _in_pixels(own_corners, data.display_pos, data.framebuffer_scale)
            box = _box(command.clip_rect, data.display_pos, data.framebuffer_scale, size[1])
            pieces.append(Piece(box, number, texture, placed, own_indices))
    return pieces


def _textures(data: imgui.ImDrawData) -> dict[int, Texture] | None:
    """Pixels of imgui's own textures by their number; None where the graphics do not have them as they are."""
    known: dict[int, Texture] = {}
    for texture in data.textures:
        if texture.status != imgui.ImTextureStatus.ok or texture.bytes_per_pixel != painting.CHANNELS:
            return None
        flat = np.asarray(texture.get_pixels_array(), np.uint8)
        pixels = flat.reshape(texture.height, texture.width, painting.CHANNELS)
        known[texture.tex_id] = Texture(pixels, white=not texture.use_colors)
    return known


def _memory(address: int, size: int) -> ctypes.Array[ctypes.c_char]:
    return (ctypes.c_char * size).from_address(address)


def _in_pixels(corners: ctypes.Array[ctypes.c_char], origin: ImVec2, scale: ImVec2) -> Memory:
    """Corners in window units as such in pixels."""
    if (origin.x, origin.y, scale.x, scale.y) == (0.0, 0.0, 1.0, 1.0):
        return corners
    values = np.frombuffer(bytes(corners), np.float32).reshape(-1, CORNER_BYTES // 4).copy()
    values[:, :2] = (values[:, :2] - (origin.x, origin.y)) * (scale.x, scale.y)
    return values


def _box(clip: ImVec4, origin: ImVec2, scale: ImVec2, height: int) -> Box:
    """A rectangle in window units as whole pixels, as imgui's own drawing by OpenGL has it, whose y goes up."""
    left, right = (clip.x - origin.x) * scale.x, (clip.z - origin.x) * scale.x
    top, bottom = (clip.y - origin.y) * scale.y, (clip.w - origin.y) * scale.y
    lowest = height - int(height - bottom)
    return Box(int(left), lowest - int(bottom - top), int(left) + int(right - left), lowest)
