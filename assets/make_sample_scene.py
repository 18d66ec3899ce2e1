"""The scene of the sample light field, modelled in code and rendered by Blender's Cycles: a table at a garden window.

Development only: runs in an interpreter that has `bpy`, started by `make_sample.py`, which hands it a job file (JSON: the
camera, the frames to render and where to write them). Lengths in metres; x to the right, y away from the camera, z up; the
table's top is z = 0. Every shape and every texture is made here; all randomness comes from seeded generators.
"""

from __future__ import annotations

import json
import math
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import numpy.typing as npt
from mathutils import Matrix, Vector

Points = npt.NDArray[np.float64]
Rng = np.random.Generator
Colour = tuple[float, float, float]

GROUND = -0.75  # the garden's level below the table's top


# ---------------------------------------------------------------- meshes


class Shape:
    """Vertices and faces gathered from grids and tubes, with two numbers per vertex that materials read as `s` and `w`."""

    def __init__(self) -> None:
        self._points: list[Points] = []
        self._s: list[Points] = []
        self._w: list[Points] = []
        self._faces: list[list[int]] = []
        self._slots: list[int] = []
        self._count = 0

    def grid(
        self, points: Points, s: Points | None = None, w: Points | None = None, *, wrap: bool = False, slot: int = 0
    ) -> None:
        """Add a sheet of quads; `points` is (rows, columns, 3); `wrap` joins the last column to the first."""
        rows, columns = points.shape[:2]
        unit_s, unit_w = np.meshgrid(np.linspace(0, 1, rows), np.linspace(-1, 1, columns), indexing="ij")
        self._points.append(points.reshape(-1, 3))
        self._s.append((unit_s if s is None else s).reshape(-1))
        self._w.append((unit_w if w is None else w).reshape(-1))
        for row in range(rows - 1):
            for column in range(columns if wrap else columns - 1):
                following = (column + 1) % columns
                a, b = self._count + row * columns + column, self._count + row * columns + following
                self._faces.append([a, b, b + columns, a + columns])
                self._slots.append(slot)
        self._count += rows * columns

    def tube(self, path: Points, radii: Points | float, *, sides: int = 7, slot: int = 0) -> None:
        """Add a round tube along `path` (n, 3); its ends taper to a point."""
        radius = np.broadcast_to(np.asarray(radii, float), (len(path),))
        tangents = np.gradient(path, axis=0)
        tangents /= np.linalg.norm(tangents, axis=1, keepdims=True) + 1e-12
        side = np.cross(tangents[0], (0.31, 0.22, 0.93))
        rings = []
        angles = np.arange(sides) * (2 * math.pi / sides)
        for centre, tangent, r in zip(path, tangents, radius, strict=True):
            side = side - tangent * (side @ tangent)
            side /= np.linalg.norm(side) + 1e-12
            other = np.cross(tangent, side)
            rings.append(centre + r * (np.cos(angles)[:, None] * side + np.sin(angles)[:, None] * other))
        caps_start = path[0] + (rings[0] - path[0]) * 1e-3
        caps_end = path[-1] + (rings[-1] - path[-1]) * 1e-3
        self.grid(np.stack([caps_start, *rings, caps_end]), wrap=True, slot=slot)

    def lathe(self, profile: Sequence[tuple[float, float]], *, segments: int = 64, slot: int = 0) -> None:
        """Add the surface swept by `profile`, pairs of (radius, height), about the z axis."""
        angles = np.arange(segments) * (2 * math.pi / segments)
        radius, height = np.array(profile, float).T
        points = np.stack(
            [
                radius[:, None] * np.cos(angles),
                radius[:, None] * np.sin(angles),
                np.broadcast_to(height[:, None], (len(radius), segments)),
            ],
            axis=-1,
        )
        self.grid(points, wrap=True, slot=slot)

    def mesh(self, name: str, materials: Sequence[Any], *, smooth: bool = True) -> Any:
        """The Blender mesh of what was gathered."""
        mesh = bpy.data.meshes.new(name)
        mesh.from_pydata(np.concatenate(self._points).tolist(), [], self._faces)
        for attribute, values in (("s", self._s), ("w", self._w)):
            mesh.attributes.new(attribute, "FLOAT", "POINT").data.foreach_set("value", np.concatenate(values))
        for material in materials:
            mesh.materials.append(material)
        mesh.polygons.foreach_set("material_index", self._slots)
        mesh.polygons.foreach_set("use_smooth", [smooth] * len(self._faces))
        mesh.update()
        return mesh


def place(mesh: Any, matrix: Matrix | None = None) -> Any:
    """Put a mesh into the scene; meshes may be placed many times."""
    thing = bpy.data.objects.new(mesh.name, mesh)
    thing.matrix_world = matrix or Matrix()
    bpy.context.scene.collection.objects.link(thing)
    return thing


def pose(position: Iterable[float], *, yaw: float = 0.0, tilt: float = 0.0, roll: float = 0.0, scale: float = 1.0) -> Matrix:
    """Scale, then roll about y, tilt about x, yaw about z (degrees), then move."""
    turn = (
        Matrix.Rotation(math.radians(yaw), 4, "Z")
        @ Matrix.Rotation(math.radians(tilt), 4, "X")
        @ Matrix.Rotation(math.radians(roll), 4, "Y")
    )
    return Matrix.Translation(Vector(tuple(position))) @ turn @ Matrix.Scale(scale, 4)


def aimed(position: Points, direction: Points, spin: float, scale: float) -> Matrix:
    """Local z along `direction`, turned about it by `spin` radians."""
    turn = Vector(direction.tolist()).to_track_quat("Z", "Y").to_matrix().to_4x4()
    return Matrix.Translation(Vector(position.tolist())) @ turn @ Matrix.Rotation(spin, 4, "Z") @ Matrix.Scale(scale, 4)


def spline(knots: Sequence[Sequence[float]], per_span: int = 12) -> Points:
    """Catmull-Rom curve through the knots, (n, k)."""
    k = np.array(knots, float)
    k = np.concatenate([[2 * k[0] - k[1]], k, [2 * k[-1] - k[-2]]])
    spans = []
    for a, b, c, d in zip(k[:-3], k[1:-2], k[2:-1], k[3:], strict=True):
        t = np.linspace(0, 1, per_span, endpoint=False)[:, None]
        spans.append(0.5 * (2 * b + (c - a) * t + (2 * a - 5 * b + 4 * c - d) * t**2 + (3 * b - a - 3 * c + d) * t**3))
    return np.concatenate([*spans, k[-2:-1]])


def box(size: Sequence[float], material: Any, bevel: float, name: str = "box") -> Any:
    """A bevelled box about the origin, placed in the scene."""
    x, y, z = (extent / 2 for extent in size)
    corners = [(i * x, j * y, k * z) for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(corners, [], faces)
    mesh.materials.append(material)
    thing = place(mesh)
    modifier = thing.modifiers.new("bevel", "BEVEL")
    modifier.width, modifier.segments = bevel, 3
    for polygon in mesh.polygons:
        polygon.use_smooth = True
    thing.modifiers.new("normals", "WEIGHTED_NORMAL")
    return thing


# ---------------------------------------------------------------- materials


class Nodes:
    """A material (or world) under construction: `add` makes a node and connects or sets its inputs."""

    def __init__(self, owner: Any) -> None:
        owner.use_nodes = True
        self.owner = owner
        self.tree = owner.node_tree
        self.tree.nodes.clear()

    def add(self, kind: str, inputs: dict[str | int, Any] | None = None, **properties: Any) -> Any:
        """A node whose inputs are values or other nodes' outputs; returns its first output."""
        return self.node(kind, inputs, **properties).outputs[0]

    def node(self, kind: str, inputs: dict[str | int, Any] | None = None, **properties: Any) -> Any:
        """The node itself, for those whose later outputs matter."""
        node = self.tree.nodes.new(kind)
        for name, value in properties.items():
            setattr(node, name, value)
        for key, value in (inputs or {}).items():
            if isinstance(value, bpy.types.NodeSocket):
                self.tree.links.new(value, node.inputs[key])
            elif isinstance(value, tuple) and node.inputs[key].type == "RGBA":
                node.inputs[key].default_value = (*value, 1.0)
            else:
                node.inputs[key].default_value = value
        return node

    def math(self, operation: str, a: Any, b: Any = 0.0) -> Any:
        """One arithmetic node."""
        return self.add("ShaderNodeMath", {0: a, 1: b}, operation=operation)

    def mix(self, factor: Any, a: Any, b: Any, blend: str = "MIX") -> Any:
        """Blend two colours."""
        node = self.node("ShaderNodeMix", data_type="RGBA", blend_type=blend)
        for index, value in ((0, factor), (6, a), (7, b)):
            if isinstance(value, bpy.types.NodeSocket):
                self.tree.links.new(value, node.inputs[index])
            else:
                node.inputs[index].default_value = (*value, 1.0) if isinstance(value, tuple) else value
        return node.outputs[2]

    def ramp(self, factor: Any, stops: Sequence[tuple[float, Colour]]) -> Any:
        """A colour ramp through (position, colour) stops."""
        node = self.node("ShaderNodeValToRGB", {0: factor})
        elements = node.color_ramp.elements
        while len(elements) < len(stops):
            elements.new(1.0)
        for element, (position, colour) in zip(elements, stops, strict=True):
            element.position, element.color = position, (*colour, 1.0)
        return node.outputs[0]

    def mapped(self, scale: Sequence[float], coordinates: str = "Object") -> Any:
        """Texture coordinates, scaled, and shifted per object so that no two objects carry the same pattern."""
        source = self.node("ShaderNodeTexCoord").outputs[coordinates]
        per_object = self.node("ShaderNodeObjectInfo").outputs["Random"]
        shift = self.add("ShaderNodeCombineXYZ", {0: self.math("MULTIPLY", per_object, 37.0), 1: per_object, 2: per_object})
        scaled = self.add("ShaderNodeVectorMath", {0: source, 1: tuple(scale)}, operation="MULTIPLY")
        return self.add("ShaderNodeVectorMath", {0: scaled, 1: shift}, operation="ADD")

    def noise(self, scale: Sequence[float], detail: float = 4.0, rough: float = 0.55, distortion: float = 0.0) -> Any:
        """Fractal noise in 0..1 of the object's own coordinates."""
        return self.add(
            "ShaderNodeTexNoise",
            {"Vector": self.mapped(scale), "Scale": 1.0, "Detail": detail, "Roughness": rough, "Distortion": distortion},
        )

    def attribute(self, name: str) -> Any:
        """A number stored per vertex."""
        return self.node("ShaderNodeAttribute", attribute_name=name).outputs["Fac"]

    def axis(self, index: int) -> Any:
        """One coordinate in the object's own frame."""
        coordinates = self.node("ShaderNodeTexCoord").outputs["Object"]
        return self.node("ShaderNodeSeparateXYZ", {0: coordinates}).outputs[index]

    def bump(self, height: Any, strength: float, distance: float) -> Any:
        """A normal bent by a height field."""
        return self.add("ShaderNodeBump", {"Height": height, "Strength": strength, "Distance": distance})

    def surface(self, shader: Any) -> Any:
        """Make `shader` the surface and return the material."""
        self.tree.links.new(shader, self.node("ShaderNodeOutputMaterial").inputs["Surface"])
        return self.owner

    def principled(self, **inputs: Any) -> Any:
        """The principled shader; underscores in the names stand for spaces."""
        return self.add("ShaderNodeBsdfPrincipled", {key.replace("_", " "): value for key, value in inputs.items()})


def material(name: str) -> Nodes:
    """An empty material."""
    return Nodes(bpy.data.materials.new(name))


def dimmed(colour: Colour, factor: float) -> Colour:
    """The colour, darker."""
    return colour[0] * factor, colour[1] * factor, colour[2] * factor


def plain(name: str, colour: Colour, roughness: float = 0.5, **inputs: Any) -> Any:
    """One colour, a little uneven."""
    n = material(name)
    uneven = n.ramp(n.noise((30, 30, 30)), [(0.25, dimmed(colour, 0.82)), (0.75, colour)])
    return n.surface(n.principled(Base_Color=uneven, Roughness=roughness, **inputs))


def wood(name: str, dark: Colour, light: Colour, roughness: float, scale: float = 1.0) -> Any:
    """Grain along x: stretched noise for fibres, distorted bands for growth rings."""
    n = material(name)
    rings = n.add(
        "ShaderNodeTexWave",
        {
            "Vector": n.mapped((0.55 * scale, 6 * scale, 6 * scale)),
            "Scale": 1.5,
            "Distortion": 7.0,
            "Detail": 3.0,
            "Detail Scale": 1.2,
        },
        bands_direction="Y",
    )
    fibres = n.noise((5 * scale, 190 * scale, 190 * scale), 5.0, 0.7)
    blotches = n.noise((3 * scale, 9 * scale, 9 * scale), 3.0)
    middle = ((dark[0] + light[0]) / 2, (dark[1] + light[1]) / 2, (dark[2] + light[2]) / 2)
    colour = n.ramp(rings, [(0.0, dark), (0.5, middle), (1.0, light)])
    colour = n.mix(0.75, colour, n.ramp(fibres, [(0.3, (0.45, 0.42, 0.4)), (0.62, (1.0, 1.0, 1.0))]), "MULTIPLY")
    colour = n.mix(0.5, colour, n.ramp(blotches, [(0.3, (0.55, 0.5, 0.46)), (0.65, (1.0, 1.0, 1.0))]), "MULTIPLY")
    gloss = n.math("ADD", n.math("MULTIPLY", fibres, 0.25), roughness - 0.12)
    return n.surface(n.principled(Base_Color=colour, Roughness=gloss, Normal=n.bump(fibres, 0.35, 0.0015)))


def leaf_colour(n: Nodes, base: Colour, tip: Colour, per_object: float) -> Any:
    """Colour from base to tip with a paler rib; brightness differs from one placed object to the next by `per_object`."""
    colour = n.ramp(n.attribute("s"), [(0.0, base), (1.0, tip)])
    rib = n.math("POWER", n.math("ABSOLUTE", n.attribute("w")), 0.35)
    colour = n.mix(n.math("MULTIPLY", n.math("SUBTRACT", 1.0, rib), 0.35), colour, (1.0, 0.95, 0.7), "SCREEN")
    chance = n.node("ShaderNodeObjectInfo").outputs["Random"]
    bright = n.math("ADD", n.math("MULTIPLY", chance, per_object), 1.0 - per_object / 2)
    return n.add("ShaderNodeHueSaturation", {"Color": colour, "Value": bright})


def leafy(name: str, base: Colour, tip: Colour, through: float, per_object: float) -> Any:
    """A matt leaf or petal; the fraction `through` of its light shines through it."""
    n = material(name)
    colour = leaf_colour(n, base, tip, per_object)
    front = n.add("ShaderNodeBsdfDiffuse", {"Color": colour})
    back = n.add("ShaderNodeBsdfTranslucent", {"Color": colour})
    return n.surface(n.add("ShaderNodeMixShader", {0: through, 1: front, 2: back}))


def glossy_leaf(name: str, base: Colour, tip: Colour, through: float) -> Any:
    """A leaf with a shine, for those near enough to show it."""
    n = material(name)
    colour = leaf_colour(n, base, tip, 0.3)
    front = n.principled(Base_Color=colour, Roughness=0.38)
    back = n.add("ShaderNodeBsdfTranslucent", {"Color": colour})
    return n.surface(n.add("ShaderNodeMixShader", {0: through, 1: front, 2: back}))


def glaze() -> Any:
    """Stoneware: a deep blue-green glaze over a pale body, thinner at the rim, with a painted band of strokes."""
    n = material("glaze")
    height = n.axis(2)
    flow = n.math("ADD", height, n.math("MULTIPLY", n.noise((30, 30, 6), 2.0), 0.02))
    colour = n.ramp(
        n.math("MULTIPLY", flow, 4.0),
        [
            (0.10, (0.42, 0.31, 0.21)),
            (0.155, (0.46, 0.36, 0.25)),
            (0.185, (0.010, 0.075, 0.10)),
            (0.55, (0.012, 0.14, 0.19)),
            (0.80, (0.05, 0.27, 0.31)),
            (1.0, (0.24, 0.44, 0.42)),
        ],
    )
    x, y = n.axis(0), n.axis(1)
    around = n.math("MULTIPLY", n.math("ARCTAN2", y, x), 14.0)
    stroke = n.math("GREATER_THAN", n.math("SINE", n.math("ADD", around, n.math("MULTIPLY", height, 260.0))), 0.1)
    band = n.add("ShaderNodeMath", {0: height, 1: 0.151, 2: 0.0085}, operation="COMPARE")
    lines = n.math(
        "MAXIMUM",
        n.add("ShaderNodeMath", {0: height, 1: 0.1635, 2: 0.0014}, operation="COMPARE"),
        n.add("ShaderNodeMath", {0: height, 1: 0.1385, 2: 0.0014}, operation="COMPARE"),
    )
    painted = n.math("MAXIMUM", n.math("MULTIPLY", band, stroke), lines)
    colour = n.mix(n.math("MULTIPLY", painted, 0.85), colour, (0.75, 0.66, 0.47))
    specks = n.math("GREATER_THAN", n.noise((260, 260, 260), 2.0), 0.69)
    colour = n.mix(n.math("MULTIPLY", specks, 0.7), colour, (0.03, 0.02, 0.015))
    shiny = n.principled(Base_Color=colour, Roughness=0.13, Coat_Weight=0.6, Coat_Roughness=0.03)
    return n.surface(shiny)


def gingham() -> Any:
    """Checked linen: warp and weft stripes, whose crossings are darker, and a visible weave."""
    n = material("gingham")
    x, y = n.axis(0), n.axis(1)
    pitch = 0.034

    def stripe(position: Any) -> Any:
        return n.math("GREATER_THAN", n.math("FRACT", n.math("MULTIPLY", position, 1 / pitch)), 0.5)

    count = n.math("MULTIPLY", n.math("ADD", stripe(x), stripe(y)), 0.5)
    colour = n.ramp(count, [(0.0, (0.80, 0.76, 0.68)), (0.5, (0.50, 0.17, 0.13)), (1.0, (0.30, 0.025, 0.025))])
    thread = n.math("MULTIPLY", n.math("SINE", n.math("MULTIPLY", x, 2400.0)), n.math("SINE", n.math("MULTIPLY", y, 2400.0)))
    slub = n.noise((25, 420, 60), 3.0)
    colour = n.mix(0.5, colour, n.ramp(slub, [(0.3, (0.62, 0.6, 0.58)), (0.6, (1.0, 1.0, 1.0))]), "MULTIPLY")
    height = n.math("ADD", n.math("MULTIPLY", thread, 0.3), slub)
    cloth = n.principled(
        Base_Color=colour, Roughness=0.85, Sheen_Weight=0.25, Sheen_Roughness=0.5, Normal=n.bump(height, 0.5, 0.001)
    )
    return n.surface(cloth)


def lemon_skin() -> Any:
    """Yellow, greener at the ends, with pores."""
    n = material("lemon skin")
    ends = n.math("ABSOLUTE", n.math("MULTIPLY", n.axis(2), 28.0))
    chance = n.node("ShaderNodeObjectInfo").outputs["Random"]
    body = n.mix(chance, (0.86, 0.50, 0.02), (0.80, 0.58, 0.035))
    colour = n.mix(n.ramp(ends, [(0.75, (0.0, 0.0, 0.0)), (1.0, (0.6, 0.6, 0.6))]), body, (0.36, 0.36, 0.04))
    pores = n.noise((420, 420, 420), 2.0)
    return n.surface(n.principled(Base_Color=colour, Roughness=0.34, Normal=n.bump(pores, 0.35, 0.0012)))


def lemon_cut() -> Any:
    """The face of a halved lemon: rind, pith, and nine segments of flesh between pale walls."""
    n = material("lemon cut")
    x, y = n.axis(0), n.axis(1)
    radius = n.math("MULTIPLY", n.math("SQRT", n.math("ADD", n.math("MULTIPLY", x, x), n.math("MULTIPLY", y, y))), 1 / 0.028)
    walls = n.math("ABSOLUTE", n.math("SINE", n.math("MULTIPLY", n.math("ARCTAN2", y, x), 4.5)))
    gap = n.math("MULTIPLY", walls, radius)
    flesh = n.math("MULTIPLY", n.math("GREATER_THAN", gap, 0.11), n.math("LESS_THAN", radius, 0.82))
    juice = n.ramp(n.noise((700, 700, 700), 2.0), [(0.3, (0.80, 0.55, 0.06)), (0.7, (0.93, 0.76, 0.22))])
    pith = n.ramp(radius, [(0.86, (0.92, 0.87, 0.66)), (0.95, (0.84, 0.60, 0.04))])
    colour = n.mix(flesh, pith, juice)
    gloss = n.math("SUBTRACT", 0.5, n.math("MULTIPLY", flesh, 0.38))
    return n.surface(n.principled(Base_Color=colour, Roughness=gloss))


def brass() -> Any:
    """Polished brass with a little tarnish."""
    n = material("brass")
    tarnish = n.noise((40, 40, 40), 4.0)
    colour = n.ramp(tarnish, [(0.35, (0.50, 0.27, 0.07)), (0.6, (0.86, 0.56, 0.20))])
    roughness = n.math("ADD", n.math("MULTIPLY", tarnish, 0.18), 0.08)
    return n.surface(n.principled(Base_Color=colour, Metallic=1.0, Roughness=roughness))


def glass(name: str, tint: Colour) -> Any:
    """Glass that lets light pass straight through for shadows, so that it needs no caustics."""
    n = material(name)
    clear = n.principled(Base_Color=tint, Roughness=0.0, IOR=1.45, Transmission_Weight=1.0)
    shadow = n.add("ShaderNodeBsdfTransparent", {"Color": tint})
    is_shadow = n.node("ShaderNodeLightPath").outputs["Is Shadow Ray"]
    return n.surface(n.add("ShaderNodeMixShader", {0: is_shadow, 1: clear, 2: shadow}))


def book_cover(name: str, colour: Colour) -> Any:
    """Book cloth with gilt lines across the spine (along x)."""
    n = material(name)
    x = n.axis(0)
    gilt: Any = 0.0
    for position in (-0.072, -0.066, -0.035, 0.035, 0.066, 0.072):
        gilt = n.math("MAXIMUM", gilt, n.add("ShaderNodeMath", {0: x, 1: position, 2: 0.0011}, operation="COMPARE"))
    letters = n.math("GREATER_THAN", n.noise((330, 60, 160), 1.0), 0.56)
    panel = n.add("ShaderNodeMath", {0: x, 1: 0.0, 2: 0.026}, operation="COMPARE")
    middle = n.add("ShaderNodeMath", {0: n.axis(2), 1: 0.0, 2: 0.0045}, operation="COMPARE")
    spine = n.math("LESS_THAN", n.axis(1), -0.0600)
    panel = n.math("MULTIPLY", panel, n.math("MULTIPLY", middle, spine))
    gilt = n.math("MAXIMUM", gilt, n.math("MULTIPLY", letters, panel))
    worn = n.ramp(n.noise((60, 60, 60), 5.0, 0.7), [(0.3, dimmed(colour, 0.6)), (0.75, colour)])
    cloth = n.principled(Base_Color=worn, Roughness=0.62, Normal=n.bump(n.noise((900, 900, 900), 1.0), 0.3, 0.0006))
    gold = n.principled(Base_Color=(0.83, 0.58, 0.24), Metallic=1.0, Roughness=0.3)
    return n.surface(n.add("ShaderNodeMixShader", {0: gilt, 1: cloth, 2: gold}))


def paper_edges() -> Any:
    """The edge of a block of pages."""
    n = material("pages")
    lines = n.noise((20, 20, 1500), 2.0, 0.8)
    return n.surface(
        n.principled(Base_Color=n.ramp(lines, [(0.3, (0.42, 0.33, 0.20)), (0.65, (0.80, 0.71, 0.52))]), Roughness=0.8)
    )


# ---------------------------------------------------------------- small plants


def petal(length: float, width: float, cup: float, notch: float, across: int = 7, along: int = 8) -> Points:
    """One petal or leaf as a sheet: it grows along +x, `cup` lifts its tip and edges; (along, across, 3)."""
    s, w = np.meshgrid(np.linspace(0, 1, along), np.linspace(-1, 1, across), indexing="ij")
    half = 0.5 * width * np.sin(np.pi * (0.04 + 0.94 * s**0.85)) ** 0.75
    x = length * (s - notch * np.exp(-((w / 0.25) ** 2)) * s**4)
    z = length * cup * (0.55 * s**2 + 0.45 * w**2 * s)
    return np.stack([x, w * half, z], axis=-1)


def turned(points: Points, yaw: float, tilt: float = 0.0, roll: float = 0.0) -> Points:
    """Rotate points about the origin (degrees)."""
    rotation = np.array(pose((0, 0, 0), yaw=yaw, tilt=tilt, roll=roll).to_3x3())
    return points @ rotation.T


def blossom(seed: int, materials: Sequence[Any]) -> Any:
    """A five-petalled cherry blossom, 27 mm across, opening along +z, with stamens."""
    rng = np.random.default_rng(seed)
    shape = Shape()
    for k in range(5):
        sheet = petal(0.0135, 0.0125, 0.35 + rng.uniform(0, 0.4), 0.10)
        sheet[..., 2] += 0.0006 * rng.normal() * np.sin(sheet[..., 1] * 700)
        shape.grid(turned(sheet, 72 * k + rng.uniform(-7, 7), roll=-rng.uniform(0, 18)), slot=0)
    for _ in range(16):
        direction = np.array([rng.normal(0, 0.45), rng.normal(0, 0.45), 1.0])
        direction *= rng.uniform(0.0045, 0.0075) / np.linalg.norm(direction)
        shape.tube(np.array([[0, 0, 0], 0.6 * direction, direction]), 0.00016, sides=4, slot=1)
        bead = direction + 0.0006 * np.array([[0, 0, -1], [0, 0, 0], [0, 0, 1.0]])
        shape.tube(bead, np.array([0.0003, 0.0006, 0.0003]), sides=5, slot=2)
    shape.tube(np.array([[0, 0, -0.007], [0, 0, -0.003], [0, 0, 0.0005]]), np.array([0.0007, 0.0018, 0.0012]), slot=3)
    return shape.mesh("blossom", materials)


def bud(materials: Sequence[Any]) -> Any:
    """A closed bud on its stalk."""
    shape = Shape()
    path = np.array([[0, 0, z] for z in np.linspace(0.0, 0.011, 8)])
    shape.tube(path, 0.0042 * np.sin(np.pi * np.linspace(0.12, 0.95, 8)) ** 0.8, sides=10, slot=0)
    shape.tube(np.array([[0, 0, -0.009], [0, 0, -0.003], [0, 0, 0.003]]), np.array([0.0006, 0.001, 0.0034]), slot=1)
    return shape.mesh("bud", materials)


def leaf(length: float, width: float, cup: float, leaf_material: Any) -> Any:
    """A leaf that grows along +z and arches."""
    shape = Shape()
    sheet = petal(length, width, cup, -0.12, across=5, along=9)
    sheet[..., 2] += 0.03 * length * np.sin(np.linspace(0, 14, 9))[:, None] * np.abs(np.linspace(-1, 1, 5))
    shape.grid(turned(sheet, 0, roll=-78))
    return shape.mesh("leaf", [leaf_material])


class Branches:
    """Cherry twigs in blossom: bark gathered into one mesh, blossoms, buds and leaves placed as instances."""

    def __init__(self, rng: Rng, bark: Any, blossoms: Sequence[Any], buds: Sequence[Any], leaves: Sequence[Any]) -> None:
        self.rng, self.bark_material = rng, bark
        self.blossoms, self.buds, self.leaves = blossoms, buds, leaves
        self.bark = Shape()

    def grow(self, knots: Sequence[Sequence[float]], thick: float, thin: float, spurs: float, flowering: float) -> None:
        """One branch through `knots`; every `spurs` metres a short spur with flowers or leaves leaves it."""
        path = spline(knots)
        path[1:-1] += self.rng.normal(0, 0.0008, path[1:-1].shape)
        t = np.linspace(0, 1, len(path))
        radius = thick + (thin - thick) * t
        knobs = 1 + 0.25 * np.maximum(0, np.sin(np.cumsum(self.rng.uniform(0.4, 1.1, len(path)))))
        self.bark.tube(path, radius * knobs, sides=8)
        lengths = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
        at = 0.12 * lengths[-1]
        while at < lengths[-1]:
            index = min(int(np.searchsorted(lengths, at)), len(path) - 2)
            along = path[index + 1] - path[index - 1]
            self._spur(path[index], along / np.linalg.norm(along), float(radius[index]), flowering)
            at += spurs * self.rng.uniform(0.6, 1.5)
        tip = path[-1] - path[-3]
        self._cluster(path[-1], tip / np.linalg.norm(tip), flowering)

    def _spur(self, start: Points, along: Points, radius: float, flowering: float) -> None:
        away = np.cross(along, self.rng.normal(size=3))
        away /= np.linalg.norm(away)
        direction = away + 0.55 * along + np.array([0, 0, 0.25])
        direction /= np.linalg.norm(direction)
        length = self.rng.uniform(0.008, 0.03)
        path = start + np.outer(np.linspace(0, length, 5), direction) + self.rng.normal(0, 0.0006, (5, 3))
        self.bark.tube(path, np.linspace(min(radius * 0.6, 0.0017), 0.0009, 5), sides=6)
        self._cluster(path[-1], direction, flowering)

    def _cluster(self, centre: Points, direction: Points, flowering: float) -> None:
        if self.rng.random() < flowering:
            for _ in range(self.rng.integers(1, 4)):
                facing = direction + self.rng.normal(0, 0.75, 3) + np.array([0, -0.35, 0])
                facing /= np.linalg.norm(facing)
                mesh = self.blossoms[int(self.rng.integers(len(self.blossoms)))]
                place(mesh, aimed(centre + facing * 0.009, facing, self.rng.uniform(0, 6.3), self.rng.uniform(0.8, 1.12)))
        if self.rng.random() < 0.55:
            facing = direction + self.rng.normal(0, 0.5, 3)
            facing /= np.linalg.norm(facing)
            mesh = self.buds[int(self.rng.integers(len(self.buds)))]
            place(mesh, aimed(centre + facing * 0.008, facing, 0.0, self.rng.uniform(0.7, 1.1)))
        for _ in range(self.rng.integers(0, 3)):
            facing = direction + self.rng.normal(0, 0.7, 3)
            facing /= np.linalg.norm(facing)
            mesh = self.leaves[int(self.rng.integers(len(self.leaves)))]
            place(mesh, aimed(centre, facing, self.rng.uniform(0, 6.3), self.rng.uniform(0.5, 1.0)))

    def finish(self) -> None:
        """Place the bark."""
        place(self.bark.mesh("bark", [self.bark_material]))


def cherry(rng: Rng) -> Branches:
    """A grower of blossoming twigs."""
    white = leafy("petals", (0.80, 0.42, 0.47), (0.90, 0.80, 0.80), 0.35, 0.1)
    stamen, anther = plain("stamen", (0.75, 0.5, 0.45)), plain("anther", (0.75, 0.42, 0.05))
    sepal = plain("sepal", (0.22, 0.09, 0.05), 0.6)
    bark = plain("bark", (0.105, 0.06, 0.042), 0.75)
    rose = leafy("bud", (0.70, 0.14, 0.22), (0.85, 0.42, 0.48), 0.2, 0.1)
    green = glossy_leaf("young leaf", (0.12, 0.20, 0.02), (0.30, 0.26, 0.04), 0.5)
    return Branches(
        rng,
        bark,
        [blossom(seed, [white, stamen, anther, sepal]) for seed in range(5)],
        [bud([rose, sepal])],
        [leaf(0.03, 0.013, cup, green) for cup in (0.25, 0.6)],
    )


# ---------------------------------------------------------------- the still life


def table(rng: Rng) -> None:
    """Five oiled planks."""
    boards = [
        wood("plank a", (0.155, 0.068, 0.028), (0.37, 0.19, 0.085), 0.40),
        wood("plank b", (0.19, 0.088, 0.036), (0.43, 0.235, 0.11), 0.43),
        wood("plank c", (0.13, 0.056, 0.024), (0.32, 0.155, 0.07), 0.38),
    ]
    edge = 0.40
    for index, width in enumerate((0.19, 0.16, 0.18, 0.15, 0.17, 0.16, 0.16)):
        plank = box((2.6, width - 0.003, 0.04), boards[(2 * index) % 3], 0.003, "plank")
        plank.matrix_world = pose((rng.uniform(-0.2, 0.2), edge + width / 2, -0.02 + rng.uniform(-0.0006, 0.0006)))
        edge += width


def cloth(rng: Rng) -> None:
    """A napkin laid askew with soft folds and a fringe."""
    rows, columns = 150, 190
    y, x = np.meshgrid(np.linspace(-0.21, 0.21, rows), np.linspace(-0.27, 0.27, columns), indexing="ij")
    z = np.zeros_like(x)
    for _ in range(7):
        angle, phase = rng.uniform(0, math.pi), rng.uniform(0, 6.3)
        wave = math.cos(angle) * x + math.sin(angle) * y
        z += rng.uniform(0.001, 0.0021) * (1 + np.sin(wave * rng.uniform(22, 60) + phase))
    for ridge_angle, ridge_at, height in ((0.5, -0.10, 0.011), (-0.35, 0.17, 0.013), (1.25, 0.02, 0.008)):
        across = math.cos(ridge_angle) * x + math.sin(ridge_angle) * y - ridge_at
        across = across + 0.012 * np.sin(9 * (x - y))
        z += height * np.exp(-((across / 0.012) ** 2)) * (0.35 + 0.65 * np.sin(3 * (y - x) + ridge_angle) ** 2)
    z += 0.0015
    outer = np.maximum(np.abs(x) / 0.27, np.abs(y) / 0.21)
    z = z * (1 - 0.6 * np.clip((outer - 0.75) / 0.25, 0, 1)) + 0.001
    points = np.stack([x, y, z], axis=-1)
    shape = Shape()
    shape.grid(points)
    for row in (0, rows - 1):
        for column in range(0, columns, 1):
            start = points[row, column]
            sign = -1.0 if row == 0 else 1.0
            end = start + np.array([rng.normal(0, 0.002), sign * rng.uniform(0.010, 0.016), 0.0])
            end[2] = 0.0008
            shape.tube(np.stack([start, (start + end) / 2 + [0, 0, 0.001], end]), 0.0006, sides=4)
    place(shape.mesh("cloth", [gingham()]), pose((0.085, 1.07, 0.0), yaw=-17))


def jug() -> None:
    """A stoneware jug with a drawn lip and a pulled handle, to hold the branches."""
    outer = spline(
        [
            (0.001, 0.0),
            (0.040, 0.0),
            (0.047, 0.006),
            (0.064, 0.050),
            (0.068, 0.092),
            (0.056, 0.140),
            (0.041, 0.176),
            (0.040, 0.196),
            (0.049, 0.222),
        ],
        10,
    )
    inner = outer[::-1] * np.array([0.93, 1.0]) + np.array([-0.001, 0.001])
    profile = np.concatenate([outer, inner[:70]])
    segments = 96
    angles = np.arange(segments) * (2 * math.pi / segments)
    radius = profile[:, 0][:, None]
    lip = np.clip((profile[:, 1][:, None] - 0.17) / 0.05, 0, 1) ** 2
    # The lip: pulled out towards angle 0, pressed in beside it, and lifted.
    pull = np.exp(-((np.angle(np.exp(1j * angles)) / 0.34) ** 2)) - 0.35 * np.exp(
        -(((np.abs(np.angle(np.exp(1j * angles))) - 0.75) / 0.3) ** 2)
    )
    shape = Shape()
    r = radius + 0.019 * lip * pull
    z = profile[:, 1][:, None] + 0.010 * lip * np.maximum(pull, 0)
    shape.grid(np.stack([r * np.cos(angles), r * np.sin(angles), z + 0 * r], axis=-1), wrap=True)
    handle = spline(
        [(-0.040, 0, 0.198), (-0.066, 0, 0.208), (-0.096, 0, 0.185), (-0.102, 0, 0.145), (-0.088, 0, 0.100), (-0.062, 0, 0.072)]
    )
    shape.tube(
        handle, np.interp(np.linspace(0, 1, len(handle)), [0, 0.15, 0.85, 1], [0.0095, 0.0075, 0.0065, 0.0085]), sides=14
    )
    thing = place(shape.mesh("jug", [glaze()]), pose((-0.115, 1.17, 0.0), yaw=150))
    thing.modifiers.new("smooth", "SUBSURF").render_levels = 1


def lemon(seed: int) -> Shape:
    """One whole lemon along z, 78 mm long."""
    rng = np.random.default_rng(seed)
    profile = spline(
        [
            (0.0005, -0.039),
            (0.005, -0.036),
            (0.013, -0.031),
            (0.024, -0.020),
            (0.0285, 0.0),
            (0.025, 0.018),
            (0.014, 0.029),
            (0.007, 0.033),
            (0.0045, 0.038),
            (0.0005, 0.040),
        ],
        7,
    )
    angles = np.arange(48) * (2 * math.pi / 48)
    uneven = 1 + 0.03 * np.sin(angles + rng.uniform(0, 6)) + 0.02 * np.sin(2 * angles + rng.uniform(0, 6))
    r = profile[:, :1] * uneven
    shape = Shape()
    shape.grid(np.stack([r * np.cos(angles), r * np.sin(angles), profile[:, 1:] + 0 * r], axis=-1), wrap=True)
    return shape


def basket_and_lemons(rng: Rng) -> None:
    """A wire basket of lemons with a tall handle: fine wires before bright fruit."""
    copper = material("wire")
    wire = copper.surface(copper.principled(Base_Color=(0.30, 0.155, 0.085), Metallic=1.0, Roughness=0.28))
    centre = (0.150, 1.06, 0.006)
    profile = spline([(0.055, 0.0), (0.078, 0.012), (0.099, 0.045), (0.108, 0.086)], 8)
    shape = Shape()
    turns = 30
    for k in range(turns):
        angle = 2 * math.pi * k / turns
        path = np.stack([profile[:, 0] * math.cos(angle), profile[:, 0] * math.sin(angle), profile[:, 1]], axis=-1)
        shape.tube(path, 0.00095, sides=6)
    circle = np.linspace(0, 2 * math.pi, 97)
    for t, thick in ((0, 0.0016), (6, 0.001), (11, 0.001), (16, 0.001), (20, 0.001), (24, 0.0022)):
        r, z = profile[t]
        shape.tube(np.stack([r * np.cos(circle), r * np.sin(circle), 0 * circle + z], axis=-1), thick, sides=8)
    for offset in (-0.0035, 0.0035):
        arch = np.linspace(0, math.pi, 60)
        twist = offset * np.cos(arch * 16)
        path = np.stack([0.108 * np.cos(arch), twist, 0.086 + 0.135 * np.sin(arch) ** 0.8], axis=-1)
        shape.tube(path, 0.0013, sides=7)
    place(shape.mesh("basket", [wire]), pose(centre, yaw=28))
    skin = lemon_skin()
    lemons = [lemon(seed).mesh("lemon", [skin]) for seed in range(4)]
    spots = [
        (-0.048, -0.035, 0.036),
        (0.030, -0.052, 0.036),
        (0.056, 0.020, 0.037),
        (-0.015, 0.052, 0.036),
        (-0.062, 0.03, 0.046),
    ]
    spots += [(0.0, -0.012, 0.078), (0.052, -0.038, 0.082), (-0.046, -0.008, 0.086), (0.022, 0.042, 0.082)]
    for index, spot in enumerate(spots):
        where = np.array(centre) + np.array(spot)
        turn = pose(where, yaw=rng.uniform(0, 360), tilt=rng.uniform(55, 115), scale=rng.uniform(0.93, 1.05))
        place(lemons[index % 4], turn)
    green = glossy_leaf("lemon leaf", (0.018, 0.075, 0.012), (0.05, 0.15, 0.02), 0.3)
    big = leaf(0.065, 0.028, 0.3, green)
    for spot, yaw, tilt in (
        ((-0.02, -0.05, 0.108), 200, 70),
        ((0.045, -0.02, 0.112), 120, 62),
        ((-0.06, -0.03, 0.105), 250, 80),
    ):
        place(big, pose(np.array(centre) + np.array(spot), yaw=yaw, tilt=tilt))
    # One whole lemon and one half beside the basket.
    place(lemons[1], pose((-0.012, 1.01, 0.038), yaw=62, tilt=88))
    half = Shape()
    profile_half = [(0.0005, -0.037), (0.006, -0.034), (0.015, -0.028), (0.025, -0.014), (0.028, 0.0)]
    half.lathe([tuple(p) for p in spline(profile_half, 6)], slot=0)
    half.lathe([(0.028, 0.0), (0.0275, 0.0004), (0.014, 0.0002), (0.0003, 0.0002)], slot=1)
    place(half.mesh("half lemon", [skin, lemon_cut()]), pose((0.055, 0.965, 0.0295), yaw=18, tilt=60))


def books() -> None:
    """Three old books, stacked, their spines towards the camera."""
    pages = paper_edges()
    covers = [
        book_cover("oxblood", (0.22, 0.028, 0.022)),
        book_cover("moss", (0.055, 0.082, 0.034)),
        book_cover("ochre", (0.40, 0.21, 0.055)),
    ]
    top = 0.0
    for cover, (width, depth, thick), shift, yaw in zip(
        covers,
        [(0.205, 0.145, 0.034), (0.19, 0.135, 0.026), (0.172, 0.122, 0.030)],
        [0.0, 0.008, -0.006],
        [11, 4, 19],
        strict=True,
    ):
        frame = pose((-0.335 + shift, 1.335, top + thick / 2), yaw=yaw)
        for z in (-1, 1):
            board = box((width, depth, 0.003), cover, 0.0009, "board")
            board.matrix_world = frame @ Matrix.Translation((0, 0, z * (thick / 2 - 0.0015)))
        shape = Shape()
        bow = np.linspace(-math.pi / 2, math.pi / 2, 13)
        section = np.stack([-depth / 2 - 0.006 * np.cos(bow), (thick / 2) * np.sin(bow)], axis=-1)
        ends = np.array([-width / 2, width / 2])
        sheet = np.stack(
            [
                np.broadcast_to(ends[:, None], (2, 13)),
                np.broadcast_to(section[:, 0], (2, 13)),
                np.broadcast_to(section[:, 1], (2, 13)),
            ],
            axis=-1,
        )
        shape.grid(sheet)
        place(shape.mesh("spine", [cover]), frame)
        block = box((width - 0.008, depth - 0.006, thick - 0.006), pages, 0.0005, "pages")
        block.matrix_world = frame @ Matrix.Translation((0, -0.002, 0))
        top += thick + 0.0003


def candlestick() -> None:
    """A turned brass candlestick with a burnt-down candle."""
    metal = brass()
    shape = Shape()
    shape.lathe(
        [
            tuple(p)
            for p in spline(
                [
                    (0.0005, 0.0),
                    (0.050, 0.0),
                    (0.052, 0.005),
                    (0.046, 0.010),
                    (0.022, 0.016),
                    (0.011, 0.026),
                    (0.009, 0.040),
                    (0.017, 0.048),
                    (0.018, 0.053),
                    (0.009, 0.062),
                    (0.0075, 0.090),
                    (0.0085, 0.112),
                    (0.016, 0.122),
                    (0.017, 0.127),
                    (0.012, 0.134),
                    (0.013, 0.142),
                    (0.026, 0.150),
                    (0.027, 0.153),
                    (0.014, 0.154),
                    (0.0005, 0.153),
                ],
                6,
            )
        ],
        segments=80,
    )
    place(shape.mesh("candlestick", [metal]), pose((0.345, 1.36, 0.0)))
    wax_nodes = material("wax")
    wax = wax_nodes.surface(
        wax_nodes.principled(
            Base_Color=(0.86, 0.77, 0.58),
            Roughness=0.45,
            Subsurface_Weight=0.35,
            Subsurface_Scale=0.01,
            Subsurface_Radius=(1.0, 0.6, 0.35),
        )
    )
    candle = Shape()
    candle.lathe(
        [(0.0110, 0.0), (0.0110, 0.06), (0.0112, 0.090), (0.0104, 0.0945), (0.0075, 0.0935), (0.0004, 0.0915)], segments=40
    )
    place(candle.mesh("candle", [wax]), pose((0.345, 1.36, 0.150)))
    wick = Shape()
    wick.tube(spline([(0, 0, 0.09), (0.0005, 0, 0.097), (0.003, 0, 0.102)]), 0.0008, sides=6)
    place(wick.mesh("wick", [plain("wick", (0.01, 0.008, 0.007), 0.9)]), pose((0.345, 1.36, 0.150)))


def bottle() -> None:
    """A small bottle of thick greenish glass with a cork."""
    outer = spline(
        [
            (0.0005, 0.0),
            (0.030, 0.0),
            (0.034, 0.005),
            (0.035, 0.03),
            (0.035, 0.088),
            (0.030, 0.106),
            (0.0145, 0.122),
            (0.0125, 0.135),
            (0.0125, 0.148),
            (0.0155, 0.151),
            (0.0155, 0.157),
        ],
        8,
    )
    inner = spline(
        [
            (0.0115, 0.157),
            (0.0100, 0.148),
            (0.0100, 0.130),
            (0.012, 0.120),
            (0.027, 0.103),
            (0.0315, 0.086),
            (0.0315, 0.012),
            (0.0005, 0.009),
        ],
        8,
    )
    shape = Shape()
    shape.lathe([tuple(p) for p in np.concatenate([outer, inner])], segments=72)
    place(shape.mesh("bottle", [glass("bottle glass", (0.78, 0.93, 0.82))]), pose((0.035, 1.40, 0.0)))
    cork = Shape()
    cork.lathe([(0.0095, 0.0), (0.0105, 0.018), (0.0118, 0.026), (0.0108, 0.0275), (0.0004, 0.0275)], segments=30)
    place(cork.mesh("cork", [plain("cork", (0.50, 0.32, 0.17), 0.85)]), pose((0.035, 1.40, 0.139)))


def cup() -> None:
    """A white cup of tea on its saucer, with two blue lines."""
    n = material("porcelain")
    height = n.axis(2)
    blue = n.math(
        "MAXIMUM",
        n.add("ShaderNodeMath", {0: height, 1: 0.0445, 2: 0.0016}, operation="COMPARE"),
        n.add("ShaderNodeMath", {0: height, 1: 0.0395, 2: 0.0006}, operation="COMPARE"),
    )
    colour = n.mix(blue, (0.82, 0.79, 0.73), (0.03, 0.075, 0.22))
    porcelain = n.surface(n.principled(Base_Color=colour, Roughness=0.12, Coat_Weight=0.5, Coat_Roughness=0.02))
    at = np.array([-0.232, 1.055, 0.0])
    saucer = Shape()
    saucer.lathe(
        [
            tuple(p)
            for p in spline(
                [
                    (0.0005, 0.004),
                    (0.034, 0.001),
                    (0.037, 0.0),
                    (0.050, 0.005),
                    (0.069, 0.0125),
                    (0.070, 0.0140),
                    (0.068, 0.0142),
                    (0.050, 0.0085),
                    (0.033, 0.0055),
                    (0.0005, 0.0055),
                ],
                6,
            )
        ],
        segments=80,
    )
    place(saucer.mesh("saucer", [porcelain]), pose(at))
    body = Shape()
    body.lathe(
        [
            tuple(p)
            for p in spline(
                [
                    (0.0005, 0.007),
                    (0.020, 0.006),
                    (0.021, 0.010),
                    (0.031, 0.022),
                    (0.038, 0.040),
                    (0.0415, 0.058),
                    (0.0410, 0.0588),
                    (0.0398, 0.058),
                    (0.036, 0.040),
                    (0.029, 0.023),
                    (0.0005, 0.014),
                ],
                7,
            )
        ],
        segments=80,
    )
    handle = spline([(0.037, 0, 0.049), (0.050, 0, 0.053), (0.060, 0, 0.043), (0.052, 0, 0.028), (0.034, 0, 0.024)])
    body.tube(handle, 0.0032, sides=12)
    place(body.mesh("cup", [porcelain]), pose(at, yaw=-38))
    tea = Shape()
    tea.lathe([(0.0003, 0.0), (0.0376, 0.0)], segments=60)
    place(tea.mesh("tea", [plain("tea", (0.19, 0.05, 0.008), 0.04)]), pose(at + np.array([0, 0, 0.0475])))
    spoon_steel = material("spoon")
    steel = spoon_steel.surface(spoon_steel.principled(Base_Color=(0.72, 0.68, 0.60), Metallic=1.0, Roughness=0.16))
    bowl = Shape()
    s, w = np.meshgrid(np.linspace(0, 1, 14), np.linspace(-1, 1, 11), indexing="ij")
    half = 0.0105 * np.sqrt(np.maximum(1 - (2 * s - 1) ** 2, 0.0005)) * (1.1 - 0.2 * s)
    bowl.grid(np.stack([0.034 * s, w * half, 0.006 * (w**2 + (2 * s - 1) ** 2 - 1)], axis=-1))
    bowl.tube(
        spline([(0.001, 0, 0.0), (-0.02, 0, 0.004), (-0.06, 0, 0.006), (-0.092, 0, 0.001)]),
        np.interp(np.linspace(0, 1, 37), [0, 0.3, 1], [0.0016, 0.0013, 0.0030]),
        sides=8,
    )
    place(bowl.mesh("spoon", [steel]), pose((-0.262, 0.968, 0.0066), yaw=186))


def scattered(rng: Rng, grower: Branches) -> None:
    """Petals and two blossoms that fell on the table and the cloth."""
    sheet = Shape()
    sheet.grid(petal(0.0135, 0.0125, 0.25, 0.10))
    fallen = sheet.mesh("fallen petal", [leafy("fallen petals", (0.82, 0.48, 0.52), (0.90, 0.80, 0.80), 0.3, 0.1)])
    bpy.context.view_layer.update()
    graph = bpy.context.evaluated_depsgraph_get()
    spots = [(rng.normal(-0.06, 0.17), rng.uniform(0.90, 1.30)) for _ in range(34)]
    for x, y in spots:
        found, top, normal, *_ = bpy.context.scene.ray_cast(graph, (x, y, 0.5), (0, 0, -1))
        if found and top.z < 0.04 and normal.z > 0.6:
            place(fallen, pose((x, y, top.z + 0.002), yaw=rng.uniform(0, 360), tilt=rng.normal(0, 14)))
    for x, y in ((-0.105, 0.975), (0.235, 0.945)):
        top = bpy.context.scene.ray_cast(graph, (x, y, 0.5), (0, 0, -1))[1]
        place(grower.blossoms[1], aimed(np.array([x, y, top.z + 0.008]), np.array([0.2, -0.5, 0.8]), 1.0, 1.0))


# ---------------------------------------------------------------- the window and the garden


def window() -> None:
    """A painted frame with slender glazing bars and a deep sill; no panes."""
    paint = plain("paint", (0.66, 0.66, 0.58), 0.42)
    for size, position in (
        ((2.6, 0.22, 0.035), (0, 1.70, -0.004)),
        ((2.6, 0.05, 0.05), (0, 1.80, 0.03)),
        ((2.6, 0.018, 0.018), (0, 1.80, 0.405)),
        ((0.020, 0.022, 1.2), (-0.205, 1.80, 0.60)),
        ((0.020, 0.022, 1.2), (0.235, 1.80, 0.60)),
        ((0.065, 0.05, 1.4), (-0.645, 1.80, 0.65)),
        ((0.065, 0.05, 1.4), (0.665, 1.80, 0.65)),
    ):
        bar = box(size, paint, 0.004, "bar")
        bar.matrix_world = pose(position)


def blades(rng: Rng, count: int, side: float, height: float, grass: Any) -> Any:
    """A square tuft of grass blades, `side` metres wide."""
    shape = Shape()
    for _ in range(count):
        x, y = rng.uniform(-side / 2, side / 2, 2)
        tall, lean, heading = height * rng.uniform(0.5, 1.2), rng.uniform(0.1, 0.7), rng.uniform(0, 6.3)
        s = np.array([0.0, 0.5, 1.0])
        spine = np.stack(
            [x + np.cos(heading) * lean * tall * s**2, y + np.sin(heading) * lean * tall * s**2, tall * s], axis=-1
        )
        across = np.array([-np.sin(heading), np.cos(heading), 0]) * 0.0035
        shape.grid(np.stack([spine - across * (1.05 - s)[:, None], spine + across * (1.05 - s)[:, None]], axis=1))
    return shape.mesh("grass", [grass])


def foliage(rng: Rng, count: int, size: float, leaf_material: Any) -> Any:
    """A ball of leaves of radius 1, denser towards its skin; leaf length `size`."""
    shape = Shape()
    for _ in range(count):
        outward = rng.normal(size=3)
        outward /= np.linalg.norm(outward)
        centre = outward * rng.uniform(0.25, 1.0) ** 0.45
        facing = outward + rng.normal(0, 0.8, 3)
        frame = np.array(aimed(np.zeros(3), facing / np.linalg.norm(facing), rng.uniform(0, 6.3), size * rng.uniform(0.6, 1.2)))
        quad = np.array([[[-0.5, 0, 0], [-0.5, 0, 0]], [[0, -0.28, 0.05], [0, 0.28, 0.05]], [[0.5, 0, 0], [0.5, 0, 0]]])
        shape.grid(quad @ frame[:3, :3].T + centre)
    return shape.mesh("foliage", [leaf_material])


def garden(rng: Rng) -> None:
    """Lawn, shrubs, hedge, a bed of flowers, trees, and hills in the haze."""
    lawn(rng)
    greens = [
        leafy("shrub a", (0.07, 0.15, 0.02), (0.22, 0.33, 0.05), 0.5, 0.5),
        leafy("shrub b", (0.11, 0.18, 0.025), (0.33, 0.38, 0.07), 0.5, 0.5),
        leafy("shrub c", (0.045, 0.11, 0.03), (0.13, 0.23, 0.06), 0.45, 0.5),
    ]
    shrubbery(rng, greens)
    flower_bed(rng, greens[1])
    trees(rng)
    hills()


def lawn(rng: Rng) -> None:
    """Rough ground under tufts of grass."""
    soil = material("lawn")
    colour = soil.ramp(soil.noise((0.9, 0.9, 0.9), 5.0, 0.6), [(0.35, (0.060, 0.105, 0.018)), (0.65, (0.125, 0.175, 0.032))])
    earth = soil.surface(soil.principled(Base_Color=colour, Roughness=0.9))
    ground = Shape()
    ground.grid(np.array([[[-60, 2, GROUND], [60, 2, GROUND]], [[-60, 120, GROUND], [60, 120, GROUND]]], float))
    place(ground.mesh("ground", [earth]))
    tuft = blades(rng, 1400, 1.0, 0.055, leafy("grass", (0.08, 0.17, 0.015), (0.30, 0.40, 0.06), 0.5, 0.3))
    for row in range(5, 14):
        half = int(0.4 * row) + 2
        for column in range(-half, half + 1):
            place(tuft, pose((column + rng.uniform(-0.1, 0.1), row, GROUND), yaw=90 * int(rng.integers(4))))


def shrubbery(rng: Rng, greens: Sequence[Any]) -> None:
    """A wood beyond the garden, a hedge before it, and a few shrubs on the lawn."""
    shrubs = [foliage(rng, 1500, 0.13, green) for green in greens]
    fine = [foliage(rng, 1500, 0.075, green) for green in greens]
    hazy = leafy("wood beyond", (0.24, 0.33, 0.16), (0.50, 0.56, 0.30), 0.5, 0.4)
    wood_beyond = foliage(rng, 1500, 0.10, hazy)
    for _ in range(60):
        x, y = rng.uniform(-15, 15), rng.uniform(20, 27)
        size = rng.uniform(1.3, 2.3)
        place(wood_beyond, pose((x, y, GROUND + rng.uniform(0.3, 1.1) * size), yaw=rng.uniform(0, 360), scale=size))
    for _ in range(46):
        x = rng.uniform(-8.5, 8.5)
        y = rng.uniform(12.5, 14.5)
        place(
            shrubs[rng.integers(3)],
            pose((x, y, GROUND + rng.uniform(0.1, 0.45)), yaw=rng.uniform(0, 360), scale=rng.uniform(0.5, 1.05)),
        )
    for x, y, size in (
        (-2.6, 8.0, 0.55),
        (-3.4, 8.8, 0.8),
        (3.0, 8.6, 0.6),
        (3.9, 9.4, 0.85),
        (2.3, 9.6, 0.4),
        (-1.9, 9.2, 0.42),
    ):
        place(fine[int(rng.integers(3))], pose((x, y, GROUND + 0.55 * size), yaw=rng.uniform(0, 360), scale=size))


def flower_bed(rng: Rng, green: Any) -> None:
    """Heads on stalks, seen as points of colour, in longer grass."""
    heads = []
    for name, base, tip in (
        ("poppy", (0.50, 0.02, 0.01), (0.78, 0.06, 0.02)),
        ("lavender", (0.20, 0.08, 0.36), (0.36, 0.20, 0.55)),
        ("daisy", (0.85, 0.62, 0.08), (0.88, 0.86, 0.78)),
        ("rose", (0.60, 0.10, 0.20), (0.80, 0.36, 0.42)),
    ):
        head = Shape()
        for k in range(6):
            head.grid(turned(petal(0.05, 0.045, 0.5, 0.05, 3, 4), 60 * k))
        head.tube(np.array([[0.01, 0.02, -0.45], [0.0, 0.0, -0.2], [0, 0, 0]]), 0.005, sides=4, slot=1)
        heads.append(head.mesh(name, [leafy(name, base, tip, 0.4, 0.3), green]))
    for _ in range(230):
        x, y = rng.uniform(-4.5, 4.5), rng.normal(7.6, 0.5)
        kind = int(np.clip((math.sin(1.7 * x) + rng.normal(0, 0.5)) * 1.4 + 1.8, 0, 3))
        place(
            heads[kind],
            pose(
                (x, y, GROUND + rng.uniform(0.22, 0.5)),
                yaw=rng.uniform(0, 360),
                tilt=rng.normal(25, 18),
                scale=rng.uniform(0.7, 1.3),
            ),
        )
    bed = blades(rng, 500, 1.0, 0.30, green)
    for x in range(-5, 6):
        for y in (7.1, 7.9):
            place(bed, pose((x, y, GROUND), yaw=90 * int(rng.integers(4))))


def trees(rng: Rng) -> None:
    """Four trees in young leaf."""
    bark = plain("trunk", (0.10, 0.07, 0.05), 0.9)
    crown = foliage(rng, 1100, 0.15, leafy("crown", (0.10, 0.19, 0.02), (0.34, 0.42, 0.07), 0.5, 0.5))
    for x, y, height, count in ((-3.3, 11.0, 2.6, 16), (2.1, 11.8, 2.3, 15), (5.4, 12.8, 2.8, 14), (-6.0, 13.0, 3.0, 14)):
        trunk = Shape()
        base = np.array([x, y, GROUND])
        trunk.tube(
            base + spline([(0, 0, 0), (0.05, 0, 0.8), (-0.04, 0.05, 1.6), (0.05, 0, height)]),
            np.linspace(0.14, 0.06, 37),
            sides=9,
        )
        for angle in rng.uniform(0, 6.3, 5):
            x_tip, y_tip = math.cos(angle) * 0.9, math.sin(angle) * 0.9
            fork, tip = 0.55 * height, height + rng.uniform(-0.2, 0.3)
            bend = (x_tip / 2, y_tip / 2, (fork + tip) / 2 + 0.15)
            trunk.tube(base + spline([(0, 0, fork), bend, (x_tip, y_tip, tip)]), np.linspace(0.06, 0.02, 25), sides=6)
        place(trunk.mesh("trunk", [bark]))
        for _ in range(count):
            spot = base + np.array([rng.normal(0, 0.75), rng.normal(0, 0.6), height + rng.normal(0.1, 0.5)])
            place(crown, pose(spot, yaw=rng.uniform(0, 360), scale=rng.uniform(0.4, 0.75)))


def hills() -> None:
    """Three ridges, paler with distance."""
    for distance, rise, colour, seed in (
        (45, 2.2, (0.16, 0.24, 0.10), 1),
        (80, 6.0, (0.30, 0.42, 0.36), 2),
        (140, 14.0, (0.48, 0.60, 0.66), 3),
    ):
        shape = Shape()
        x = np.linspace(-1.2 * distance, 1.2 * distance, 200)
        hill = np.random.default_rng(seed)
        z = rise * (0.75 + 0.25 * np.sin(x / distance * 5 + seed))
        for _ in range(12):
            height = hill.uniform(0.01, 0.03) * rise
            z = z + height * np.sin(x / distance * hill.uniform(30, 160) + hill.uniform(0, 6))
        top = np.stack([x, 0 * x + distance, z], axis=-1)
        shape.grid(np.stack([top * [1, 1, 0] + [0, 0, GROUND], top]))
        place(shape.mesh("hill", [plain(f"hill {seed}", colour, 1.0)]))


def light() -> None:
    """Late sun through the window from the left, open sky beyond, a dim warm room behind the camera, a soft side light."""
    n = Nodes(bpy.data.worlds.new("world"))
    bpy.context.scene.world = n.owner
    direction = n.node("ShaderNodeTexCoord").outputs["Generated"]
    parts = n.node("ShaderNodeSeparateXYZ", {0: direction})
    sky = n.ramp(
        parts.outputs[2],
        [(0.0, (0.66, 0.57, 0.46)), (0.08, (0.60, 0.63, 0.66)), (0.35, (0.42, 0.60, 0.85)), (1.0, (0.22, 0.40, 0.75))],
    )
    outside = n.ramp(
        n.math("ADD", n.math("MULTIPLY", parts.outputs[1], 0.5), 0.5), [(0.30, (0.15, 0.12, 0.095)), (0.62, (1.0, 1.0, 1.0))]
    )
    strength = n.add("ShaderNodeBackground", {"Color": n.mix(1.0, sky, outside, "MULTIPLY"), "Strength": 1.5})
    n.tree.links.new(strength, n.node("ShaderNodeOutputWorld").inputs["Surface"])

    sun = bpy.data.lights.new("sun", "SUN")
    sun.energy, sun.angle, sun.color = 6.5, math.radians(1.6), (1.0, 0.77, 0.50)
    lamp = bpy.data.objects.new("sun", sun)
    lamp.rotation_euler = Vector((0.80, -0.36, -0.50)).to_track_quat("-Z", "Y").to_euler()
    bpy.context.scene.collection.objects.link(lamp)

    area = bpy.data.lights.new("side", "AREA")
    area.shape, area.size, area.size_y, area.energy, area.color = "RECTANGLE", 0.7, 0.9, 5.5, (1.0, 0.93, 0.84)
    lamp = bpy.data.objects.new("side", area)
    lamp.location = (-1.05, 0.25, 0.95)
    lamp.rotation_euler = (Vector((0.0, 1.15, 0.06)) - lamp.location).to_track_quat("-Z", "Y").to_euler()
    bpy.context.scene.collection.objects.link(lamp)


def near_plants(rng: Rng) -> None:
    """Ears of grass rising at the right, close to the lens."""
    straw = leafy("straw", (0.24, 0.20, 0.05), (0.55, 0.42, 0.16), 0.35, 0.3)
    for x, y, top, lean in (
        (0.168, 0.66, 0.225, 0.012),
        (0.186, 0.63, 0.275, 0.020),
        (0.205, 0.71, 0.205, -0.022),
        (0.214, 0.68, 0.300, -0.012),
        (0.150, 0.64, 0.180, -0.016),
    ):
        shape = Shape()
        stem = spline(
            [(x, y, -0.05), (x + 0.1 * lean, y, 0.5 * top), (x + lean, y - 0.01, top), (x + 1.9 * lean, y - 0.02, top + 0.035)]
        )
        shape.tube(stem, np.linspace(0.0011, 0.0006, len(stem)), sides=6)
        ear = stem[-14:]
        for index, centre in enumerate(ear):
            for side in (0, 120, 240):
                along = ear[min(index + 1, 13)] - ear[max(index - 1, 0)]
                grain = turned(petal(0.0105, 0.0032, 0.5, -0.1, 3, 5), 0, roll=-60)
                frame = np.array(aimed(np.zeros(3), along / np.linalg.norm(along), math.radians(side + 50 * index), 1.0))
                shape.grid(grain @ frame[:3, :3].T + centre)
                awn = np.array([[0, 0, 0.006], [0.004, 0, 0.018], [0.010, 0, 0.034]]) @ frame[:3, :3].T + centre
                if index % 2 == 0:
                    shape.tube(awn, np.array([0.00022, 0.00018, 0.0001]), sides=3)
        place(shape.mesh("ear", [straw]))


def build() -> None:
    """The whole scene."""
    for thing in list(bpy.data.objects):
        bpy.data.objects.remove(thing)
    table(np.random.default_rng(1))
    cloth(np.random.default_rng(2))
    jug()
    basket_and_lemons(np.random.default_rng(3))
    books()
    candlestick()
    bottle()
    cup()
    window()
    garden(np.random.default_rng(5))
    grower = cherry(np.random.default_rng(6))
    scattered(np.random.default_rng(7), grower)
    mouth = (-0.115, 1.17, 0.19)
    grower.grow(
        [mouth, (-0.10, 1.165, 0.27), (-0.03, 1.13, 0.335), (0.075, 1.10, 0.365), (0.19, 1.07, 0.395)],
        0.0042,
        0.0013,
        0.026,
        0.75,
    )
    grower.grow(
        [mouth, (-0.13, 1.20, 0.28), (-0.115, 1.26, 0.36), (-0.06, 1.33, 0.43), (0.02, 1.38, 0.47)], 0.0038, 0.0013, 0.028, 0.7
    )
    grower.grow(
        [mouth, (-0.155, 1.15, 0.265), (-0.215, 1.12, 0.325), (-0.29, 1.08, 0.345), (-0.35, 1.05, 0.335)],
        0.0038,
        0.0012,
        0.026,
        0.75,
    )
    grower.grow(
        [(-0.03, 1.13, 0.335), (0.0, 1.09, 0.30), (0.055, 1.05, 0.285), (0.10, 1.01, 0.262)], 0.0022, 0.0010, 0.026, 0.8
    )
    # A second spray enters from the upper left, close to the lens.
    grower.grow(
        [(-0.30, 0.62, 0.44), (-0.19, 0.61, 0.392), (-0.115, 0.60, 0.366), (-0.03, 0.605, 0.361)], 0.0028, 0.0010, 0.030, 0.6
    )
    grower.grow(
        [(-0.19, 0.61, 0.392), (-0.165, 0.625, 0.345), (-0.155, 0.635, 0.300), (-0.130, 0.645, 0.262)],
        0.0018,
        0.0009,
        0.030,
        0.55,
    )
    grower.finish()
    near_plants(np.random.default_rng(8))
    light()


# ---------------------------------------------------------------- rendering


def prepare(job: dict[str, Any]) -> Any:
    """Set up Cycles and the camera as the job says; returns the camera object."""
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = job["width"], job["height"]
    scene.render.resolution_percentage = 100
    scene.render.use_persistent_data = True
    scene.render.threads_mode, scene.render.threads = "FIXED", job["threads"]
    scene.render.film_transparent = False
    cycles = scene.cycles
    cycles.device = "CPU"
    cycles.use_adaptive_sampling = False
    cycles.use_light_tree = False
    cycles.diffuse_bounces, cycles.glossy_bounces = 2, 3
    cycles.transmission_bounces, cycles.transparent_max_bounces = 8, 8
    cycles.caustics_reflective = cycles.caustics_refractive = False
    cycles.sample_clamp_indirect = 4.0
    cycles.denoiser = "OPENIMAGEDENOISE"
    cycles.denoising_input_passes, cycles.denoising_prefilter = "RGB_ALBEDO_NORMAL", "ACCURATE"
    cycles.denoising_quality = "HIGH"
    data = bpy.data.cameras.new("camera")
    camera = bpy.data.objects.new("camera", data)
    scene.collection.objects.link(camera)
    scene.camera = camera
    data.sensor_fit, data.sensor_width = "HORIZONTAL", 36.0
    data.lens = 36.0 * job["focal_px"] / job["width"]
    data.clip_start, data.clip_end = 0.01, 1000.0
    return camera


def as_beauty(samples: int) -> None:
    """Many denoised samples a pixel; written as linear half floats."""
    scene = bpy.context.scene
    scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.filter_width = samples, True, 1.3
    scene.cycles.max_bounces = 5
    scene.view_layers[0].use_pass_z = False
    settings = scene.render.image_settings
    settings.media_type = "IMAGE"
    settings.file_format, settings.color_mode, settings.color_depth = "OPEN_EXR", "RGB", "16"
    settings.exr_codec = "ZIP"


def as_depth() -> None:
    """One ray through the centre of each pixel, so that no depth is a blend of two surfaces; 32-bit floats."""
    scene = bpy.context.scene
    scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.filter_width = 1, False, 0.01
    scene.cycles.max_bounces = 0
    scene.view_layers[0].use_pass_z = True
    settings = scene.render.image_settings
    settings.media_type = "MULTI_LAYER_IMAGE"
    settings.file_format, settings.color_depth, settings.exr_codec = "OPEN_EXR_MULTILAYER", "32", "ZIP"


def render(job: dict[str, Any], report: Callable[[str], None]) -> None:
    """Render every frame of the job; each file appears whole or not at all."""
    camera = prepare(job)
    scene = bpy.context.scene
    pitch = math.radians(job["pitch_degrees"])
    up = Vector((0, math.sin(pitch), math.cos(pitch)))
    camera.rotation_euler = (math.pi / 2 - pitch, 0, 0)
    for kind in ("depth", "beauty"):
        frames = [frame for frame in job["frames"] if frame["kind"] == kind]
        if kind == "depth":
            as_depth()
        else:
            as_beauty(job["samples"])
        for frame in frames:
            camera.location = Vector(job["centre"]) + Vector((frame["right"], 0, 0)) - up * frame["down"]
            camera.data.shift_x, camera.data.shift_y = frame["shift_x"], frame["shift_y"]
            scene.cycles.seed = frame["seed"]
            target = Path(frame["path"])
            partial = target.with_name(f".{target.stem}.part.exr")
            scene.render.filepath = str(partial)
            bpy.ops.render.render(write_still=True)
            partial.replace(target)
            report(f"{time.monotonic():.1f} s: rendered {target.name}")


def main() -> None:
    """Read the job file named on the command line, build the scene, render."""
    job = json.loads(Path(sys.argv[1]).read_text())
    build()
    render(job, lambda line: print(line, flush=True))


if __name__ == "__main__":
    main()
