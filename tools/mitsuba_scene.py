"""Builds glTF scenes in Mitsuba 3, for tools/compare-mitsuba: reads the files by itself, and shares nothing with stillray but the
definition of the BRDF, which mitsuba_brdf.py writes down once more.

    mitsuba_scene.py write  SCENES WORK        the scenes to compare, with camera and lights of their own, into WORK/scenes
    mitsuba_scene.py render WORK               Mitsuba's pictures of them, into WORK/NAME/mitsuba
    mitsuba_scene.py break  WORK WHAT          changes WHAT (light, roughness) in the scenes a little, to see that it is found
    mitsuba_scene.py report WORK               the table, from the pictures and what `stillray compare` measured

ONLY holds names of scenes with ; between them, to leave out the others.
"""

import base64
import dataclasses
import io
import json
import math
import os
import shutil
import struct
import sys
import time
from pathlib import Path

import mitsuba_brdf
import numpy as np
from mitsuba_brdf import MATERIALS

SIZE = (128, 96)
# Mitsuba's film has this many box-filtered subpixels a pixel and axis; they are weighed as glsl/include/filter.glsl weighs samples.
SUBPIXELS = 8
SPP = 32  # a subpixel and run
RUNS = 4
DEVIATION = 0.5  # of the reconstruction filter, pixels: stillray's default filter.width
TILE = 16  # pixels

# What users are promised. The worst tile is told only: where light is narrow it is as good as the samples.
MEAN = 0.01
FLIP = 0.02


@dataclasses.dataclass
class Scene:
    """A file, the side it is seen from (towards +Z is 0 degrees, towards +X 90), and how it is lit."""

    file: str
    azimuth: float = 35.0
    elevation: float = 20.0
    nearer: float = 1.0  # how much nearer than where the bounding sphere fits
    light: str = "lights"  # a sun and a lamp; "area": a rectangle; "map": a map of light from all around
    eye: tuple = ()  # from and to, instead of the side
    unmapped: bool = False  # roughness textures, which have mirrors in them, are left out, too
    metal: bool = False  # white metal of roughness 0.3 all over: Mitsuba's own `roughconductor`


SCENES = {
    "BoxTextured": Scene("BoxTextured-Embedded/BoxTextured.gltf"),
    "WaterBottle": Scene("WaterBottle/WaterBottle.gltf", nearer=1.2),
    "FlightHelmet": Scene("FlightHelmet/FlightHelmet.gltf", nearer=1.2),
    "MetalRoughSpheres": Scene("MetalRoughSpheresNoTextures/MetalRoughSpheresNoTextures.glb", 0, 0, 1.3),
    "NormalTangentTest": Scene("NormalTangentTest/NormalTangentTest.glb", 0, 10, 1.3, unmapped=True),
    "VertexColorTest": Scene("VertexColorTest/VertexColorTest.glb", 0, 10, 1.3),
    "NegativeScaleTest": Scene("NegativeScaleTest/NegativeScaleTest.glb", 10, 15, 1.3),
    "TextureTransformTest": Scene("TextureTransformTest/TextureTransformTest.gltf", 0, 5, 1.3),
    "LightsPunctualLamp": Scene("LightsPunctualLamp/LightsPunctualLamp.gltf", 20, 20, 1.2),
    "CesiumMan": Scene("CesiumMan/CesiumMan.glb", 35, 15, 1.2, "area"),
    "Fox": Scene("Fox/Fox.glb", 60, 15, 1.3, "area"),
    "Sponza": Scene("Sponza/Sponza.gltf", eye=((8, 2, 0), (0, 3, 0))),
    "Fox, map": Scene("Fox/Fox.glb", 60, 15, 1.3, "map"),
    "FlightHelmet, map": Scene("FlightHelmet/FlightHelmet.gltf", -30, 15, 1.2, "map"),
    "CesiumMan, metal": Scene("CesiumMan/CesiumMan.glb", 35, 15, 1.2, metal=True),
    "NegativeScaleTest, metal": Scene("NegativeScaleTest/NegativeScaleTest.glb", 10, 15, 1.3, metal=True),
}
METAL_ROUGHNESS = 0.3
# A sharp light in a smoother surface is a spike, smaller than a pixel, which samples of both find or miss by chance.
LEAST_ROUGHNESS = 0.25


def folder(name):
    return name.replace(", ", "-")


# --- glTF ---------------------------------------------------------------------------------------------------------------------

COMPONENTS = {5120: np.int8, 5121: np.uint8, 5122: np.int16, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


class Document:
    """A glTF file: its JSON, and its buffers when they are asked for."""

    def __init__(self, path):
        self.path, data, self.binary = Path(path), Path(path).read_bytes(), b""
        if data[:4] == b"glTF":
            length = struct.unpack_from("<I", data, 12)[0]
            self.json, self.binary = json.loads(data[20 : 20 + length]), data[28 + length :]
        else:
            self.json = json.loads(data)

    def list(self, key):
        return self.json.setdefault(key, [])

    def resolve(self, uri):
        if uri.startswith("data:"):
            return base64.b64decode(uri.split(",", 1)[1])
        return (self.path.parent / uri.replace("%20", " ")).read_bytes()

    def view(self, index):
        view = self.json["bufferViews"][index]
        buffer = self.json["buffers"][view["buffer"]]
        data = self.resolve(buffer["uri"]) if "uri" in buffer else self.binary
        start = view.get("byteOffset", 0)
        return data[start : start + view["byteLength"]], view.get("byteStride")

    def accessor(self, index):
        """Rows of float64, or of integers that are not normalised."""
        a = self.json["accessors"][index]
        assert "sparse" not in a, "sparse accessors are not read"
        kind, width = np.dtype(COMPONENTS[a["componentType"]]), WIDTHS[a["type"]]
        data, stride = self.view(a["bufferView"])
        shape, strides = (a["count"], width), (stride or kind.itemsize * width, kind.itemsize)
        rows = np.ndarray(shape, kind, data, a.get("byteOffset", 0), strides).copy()
        if a.get("normalized"):
            return np.maximum(rows / np.iinfo(kind).max, -1.0)
        return rows.astype(np.float64) if kind.kind == "f" else rows.astype(np.int64)

    def image(self, texture):
        """8-bit RGB texels of a texture, the upper row first."""
        from PIL import Image

        image = self.json["images"][self.json["textures"][texture]["source"]]
        return np.array(Image.open(io.BytesIO(self.encoded(image))).convert("RGB"))

    def encoded(self, image):
        return self.resolve(image["uri"]) if "uri" in image else self.view(image["bufferView"])[0]

    def worlds(self, scale=1.0, origin=(0, 0, 0)):
        """World matrices of all nodes in the scene, by number; with another length for a metre, about another origin."""
        root = np.diag((scale, scale, scale, 1.0))
        root[:3, 3] = -scale * np.array(origin)
        found, stack = {}, [(n, root) for n in self.json["scenes"][self.json.get("scene", 0)]["nodes"]]
        while stack:
            index, parent = stack.pop()
            node = self.json["nodes"][index]
            found[index] = parent @ local_matrix(node)
            stack += [(child, found[index]) for child in node.get("children", [])]
        return found

    def write(self, path):
        text = json.dumps(self.json).encode()
        text += b" " * (-len(text) % 4)
        if not self.binary:
            return path.write_bytes(text)
        chunk = struct.pack("<II", len(text), 0x4E4F534A) + text
        chunk += struct.pack("<II", len(self.binary), 0x004E4942) + self.binary
        path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunk)) + chunk)


def local_matrix(node):
    if "matrix" in node:
        return np.array(node["matrix"], float).reshape(4, 4).T
    x, y, z, w = np.array(node.get("rotation", (0, 0, 0, 1)), float)
    m = np.eye(4)
    m[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    m[:3, :3] *= node.get("scale", (1, 1, 1))
    m[:3, 3] = node.get("translation", (0, 0, 0))
    return m


@dataclasses.dataclass
class Part:
    """Triangles of one material in world space; the counter-clockwise side is the front."""

    material: int
    triangles: np.ndarray
    positions: np.ndarray
    normals: np.ndarray | None
    uvs: np.ndarray | None
    colors: np.ndarray | None
    tangents: np.ndarray | None  # xyz and handedness


def parts(document, scale=1.0, origin=(0, 0, 0)):
    worlds = document.worlds(scale, origin)
    for index in sorted(worlds):
        node = document.json["nodes"][index]
        for primitive in document.json["meshes"][node["mesh"]]["primitives"] if "mesh" in node else []:
            assert primitive.get("mode", 4) == 4 and "targets" not in primitive, "only triangles that do not morph are read"
            yield part(document, primitive, skinned(document, node, primitive, worlds) or worlds[index])


def skinned(document, node, primitive, worlds):
    """A matrix for each vertex, or none."""
    if "skin" not in node:
        return None
    skin = document.json["skins"][node["skin"]]
    inverse = document.accessor(skin["inverseBindMatrices"]).reshape(-1, 4, 4).transpose(0, 2, 1)
    joints = np.array([worlds[j] for j in skin["joints"]]) @ inverse
    of, weights = (document.accessor(primitive["attributes"][key]) for key in ("JOINTS_0", "WEIGHTS_0"))
    weights = weights / weights.sum(1, keepdims=True)
    return [np.einsum("vj,vjab->vab", weights, joints[of])]


def part(document, primitive, world):
    matrices = world[0] if isinstance(world, list) else world[None]
    read = {key: document.accessor(index) for key, index in primitive["attributes"].items()}
    linear = matrices[:, :3, :3]
    turn = lambda m, v: np.einsum("vab,vb->va", np.broadcast_to(m, (len(v), 3, 3)), v)
    positions = turn(linear, read["POSITION"]) + matrices[:, :3, 3]
    count = len(positions)
    triangles = document.accessor(primitive["indices"])[:, 0] if "indices" in primitive else np.arange(count)
    triangles = triangles.reshape(-1, 3)
    mirrored = np.linalg.det(linear[0]) < 0
    # A mirror turns the front of a triangle to the other side; glTF wants it to stay.
    triangles = triangles[:, ::-1] if mirrored else triangles
    normals, tangents = read.get("NORMAL"), read.get("TANGENT")
    if tangents is not None:
        handedness = tangents[:, 3:] * (-1 if mirrored else 1)
        tangents = np.hstack([turn(linear, tangents[:, :3]), handedness])
    if normals is not None:
        normals = turn(np.linalg.inv(linear).transpose(0, 2, 1), normals)
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    colors = read.get("COLOR_0")
    material = primitive.get("material", -1)
    return Part(material, triangles, positions, normals, read.get("TEXCOORD_0"), None if colors is None else colors[:, :3], tangents)


# --- the scenes that both render ----------------------------------------------------------------------------------------------


def look_along(direction, eye):
    """A node's matrix, column by column: -Z along a direction."""
    d = np.array(direction, float) / np.linalg.norm(direction)
    right = np.cross(d, (0, 1, 0))
    right /= np.linalg.norm(right)
    m = np.eye(4)
    m[:3, 0], m[:3, 1], m[:3, 2], m[:3, 3] = right, np.cross(right, d), -d, eye
    return list(m.T.ravel())


YFOV = math.radians(45)


def view(scene, document):
    """Where the camera is and what it looks at, and the radius of the scene, metres."""
    if scene.eye:
        eye, to = np.array(scene.eye, float)
        return eye, to, np.linalg.norm(to - eye)
    points = np.vstack([p.positions[np.unique(p.triangles)] for p in parts(document)])
    low, high = points.min(0), points.max(0)
    center, radius = (low + high) / 2, np.linalg.norm(high - low) / 2
    a, e = math.radians(scene.azimuth), math.radians(scene.elevation)
    back = np.array((math.sin(a) * math.cos(e), math.sin(e), math.cos(a) * math.cos(e)))
    return center + back * radius / math.sin(YFOV / 2) / scene.nearer, center, radius


def write(scene, source, target):
    document = Document(source)
    tree = document.json
    plain(tree, scene)
    eye, to, radius = view(scene, document)
    forward = (to - eye) / np.linalg.norm(to - eye)
    right = np.cross(forward, (0, 1, 0))
    right /= np.linalg.norm(right)
    nodes = [{"camera": 0, "matrix": look_along(forward, eye)}]
    tree["cameras"] = [{"type": "perspective", "perspective": {"yfov": YFOV, "znear": 0.01}}]
    lights = []
    if scene.light == "lights":
        sun = forward - 0.5 * right - (0, 0.8, 0)
        lamp = to - forward * 1.2 * radius - right * 1.5 * radius + (0, 0.6 * radius, 0)
        if scene.eye:
            sun, lamp = np.array((0.3, -1.0, 0.15)), eye + forward + 0.5 * right
        lights = [{"type": "directional", "color": [1.0, 0.9, 0.7], "intensity": 3.0}]
        lights += [{"type": "point", "color": [0.5, 0.7, 1.0], "intensity": (1.0 if scene.eye else 4.0) * radius**2}]
        nodes += [{"matrix": look_along(sun, (0, 0, 0))}, {"matrix": look_along(forward, lamp)}]
    if scene.light == "area":
        lamp = to - forward * 1.5 * radius + right * 1.5 * radius + (0, 2.0 * radius, 0)
        shape = {"shape": "rectangle", "width": 1.2 * radius, "height": 0.8 * radius}
        lights = [{"type": "point", "intensity": 20.0 * radius**2, "extras": {"stillray": shape}}]
        nodes += [{"matrix": look_along(to - lamp, lamp)}]
    for number in range(len(lights)):
        nodes[1 + number]["extensions"] = {"KHR_lights_punctual": {"light": number}}
    if lights:
        tree["extensions"] = {"KHR_lights_punctual": {"lights": lights}}
    tree["extensionsUsed"] = ["KHR_lights_punctual", "KHR_texture_transform"]
    first = len(tree["nodes"])
    tree["nodes"] += nodes
    tree["scenes"][tree.get("scene", 0)]["nodes"] += range(first, first + len(nodes))
    # Contents alone: who may not write the source may write this.
    shutil.copytree(source.parent, target, copy_function=shutil.copyfile, dirs_exist_ok=True)
    for place in (target, *target.rglob("*")):
        place.chmod(0o755 if place.is_dir() else 0o644)
    decode(document, target)
    document.write(target / f"scene{source.suffix}")
    if scene.light == "map":
        write_exr(sky(), target / "sky.exr")


def decode(document, target):
    """JPEG's decoders may differ by a step or two, and in how they spread colour: both get what one of them makes of it."""
    from PIL import Image

    for number, image in enumerate(document.json.get("images", [])):
        picture = Image.open(io.BytesIO(document.encoded(image)))
        if picture.format == "JPEG":
            document.json["images"][number] = {"uri": f"decoded-{number}.png"}
            picture.convert("RGB").save(target / f"decoded-{number}.png", compress_level=1)


def plain(tree, scene):
    """Leaves out what is not compared: movement, emission, holes, what has no back, mirrors, further layers, lights and cameras."""
    for key in ("animations", "extensions", "extensionsRequired"):
        tree.pop(key, None)
    for node in tree["nodes"]:
        node.pop("camera", None)
        node.pop("extensions", None)
    for index, material in enumerate(tree.setdefault("materials", [])):
        for key in ("emissiveFactor", "emissiveTexture", "alphaMode", "alphaCutoff", "extensions"):
            material.pop(key, None)
        material["doubleSided"] = True
        pbr = material.setdefault("pbrMetallicRoughness", {})
        pbr["roughnessFactor"] = max(pbr.get("roughnessFactor", 1.0), LEAST_ROUGHNESS)
        if scene.unmapped:
            pbr.pop("metallicRoughnessTexture", None)
            pbr["roughnessFactor"], pbr["metallicFactor"] = 0.5, 0.5
        if scene.metal:
            factors = {"metallicFactor": 1.0, "roughnessFactor": METAL_ROUGHNESS}
            tree["materials"][index] = {"pbrMetallicRoughness": factors, "doubleSided": True}


def sky():
    """A map whose texels differ little from their neighbours: stillray's are even, Mitsuba's are blended."""
    height, width = 256, 512
    theta = (np.arange(height) + 0.5)[:, None] / height * math.pi
    phi = (np.arange(width) + 0.5)[None] / width * 2 * math.pi
    up = np.cos(theta)
    spot = np.cos(theta) * math.cos(1.0) + np.sin(theta) * math.sin(1.0) * np.cos(phi - 4.2)
    blue = (0.35 + 0.25 * up)[..., None] * np.array((0.7, 0.9, 1.2))
    return np.broadcast_to(blue, (height, width, 3)) + (6 * np.exp(20 * (spot - 1)))[..., None] * np.array((1.0, 0.8, 0.5))


# --- Mitsuba ------------------------------------------------------------------------------------------------------------------


def write_exr(picture, path):
    load().Bitmap(np.ascontiguousarray(picture, np.float32)).write(str(path))


def load():
    import mitsuba as mi

    if mi.variant() is None:
        mi.set_variant("llvm_ad_rgb")
        mitsuba_brdf.define(mi)
    return mi


WRAPS = {10497: "repeat", 33648: "mirror", 33071: "clamp"}


def texture(mi, document, use, raw):
    """One of Mitsuba's own: it decodes, blends and wraps."""
    entry = document.json["textures"][use["index"]]
    sampler = document.json["samplers"][entry["sampler"]] if "sampler" in entry else {}
    wraps = {sampler.get(key, 10497) for key in ("wrapS", "wrapT")}
    assert len(wraps) == 1 and use.get("texCoord", 0) == 0, "one way to wrap and one set of coordinates are known"
    t = use.get("extensions", {}).get("KHR_texture_transform", {})
    (x, y), (w, h), r = t.get("offset", (0, 0)), t.get("scale", (1, 1)), t.get("rotation", 0)
    matrix = [[w * math.cos(r), h * math.sin(r), x], [-w * math.sin(r), h * math.cos(r), y], [0, 0, 1]]
    return mi.load_dict({
        "type": "bitmap",
        "bitmap": mi.Bitmap(document.image(use["index"])),
        "raw": raw,
        "format": "variant",
        "filter_type": "nearest" if sampler.get("magFilter") == 9728 else "bilinear",
        "wrap_mode": WRAPS[wraps.pop()],
        "to_uv": mi.ScalarTransform3f(matrix),
    })


def bsdf(mi, document, part, metal):
    if metal:
        return mi.load_dict({"type": "twosided", "bsdf": {
            "type": "roughconductor", "material": "none", "distribution": "ggx", "alpha": METAL_ROUGHNESS**2}})
    m = document.json["materials"][part.material] if part.material >= 0 else {}
    pbr = m.get("pbrMetallicRoughness", {})
    made = {"base": pbr.get("baseColorFactor", (1, 1, 1))[:3]}
    made |= {"metallic": pbr.get("metallicFactor", 1.0), "roughness": pbr.get("roughnessFactor", 1.0)}
    if part.uvs is not None:
        slots = {"base_map": (pbr.get("baseColorTexture"), False), "mr_map": (pbr.get("metallicRoughnessTexture"), True)}
        slots["normal_map"] = (m.get("normalTexture"), True)
        made |= {slot: texture(mi, document, use, raw) for slot, (use, raw) in slots.items() if use}
    made["scale"] = m.get("normalTexture", {}).get("scale", 1.0)
    attribute = lambda name: mi.load_dict({"type": "mesh_attribute", "name": name})
    if part.colors is not None:
        made["color"] = attribute("vertex_color")
    if part.tangents is not None:
        made |= {"tangent": attribute("vertex_tangent"), "handedness": attribute("vertex_handedness")}
    MATERIALS.append(made)
    return mi.load_dict({"type": "layered", "number": len(MATERIALS) - 1})


def mesh(mi, document, part, metal):
    props = mi.Properties()
    props["bsdf"] = bsdf(mi, document, part, metal)
    smooth, mapped = part.normals is not None, part.uvs is not None
    made = mi.Mesh("part", len(part.positions), len(part.triangles), props, smooth, mapped)
    flat = lambda rows: np.ascontiguousarray(rows, np.float32).ravel()
    if part.colors is not None:
        made.add_attribute("vertex_color", 3, flat(part.colors))
    if part.tangents is not None:
        made.add_attribute("vertex_tangent", 3, flat(part.tangents[:, :3]))
        made.add_attribute("vertex_handedness", 1, flat(part.tangents[:, 3]))
    params = mi.traverse(made)
    params["vertex_positions"] = flat(part.positions)
    params["faces"] = np.ascontiguousarray(part.triangles, np.uint32).ravel()
    if smooth:
        params["vertex_normals"] = flat(part.normals)
    if mapped:
        params["vertex_texcoords"] = flat(part.uvs)
    params.update()
    return made


# Mitsuba keeps rays off surfaces by 0.00018 of a unit and as much of the largest coordinate: light leaks through what is small
# or far from the origin. So all is built this large, about the middle of the scene or the camera in it.
RADIUS = 100.0


def magnification(document):
    """The length of a metre, and the origin."""
    points = np.vstack([p.positions[np.unique(p.triangles)] for p in parts(document)])
    low, high = points.min(0), points.max(0)
    eye = next(w[:3, 3] for i, w in document.worlds().items() if "camera" in document.json["nodes"][i])
    inside = ((low < eye) & (eye < high)).all()
    return RADIUS / (np.linalg.norm(high - low) / 2), eye if inside else (low + high) / 2


def emitter(mi, light, world, scale):
    at, along = world[:3, 3], -world[:3, 2]
    color = [c * light.get("intensity", 1.0) for c in light.get("color", (1, 1, 1))]
    rgb = lambda values: {"type": "rgb", "value": [float(v) for v in values]}
    shape = light.get("extras", {}).get("stillray")
    if light["type"] == "directional":
        return {"type": "directional", "direction": list(along / np.linalg.norm(along)), "irradiance": rgb(color)}
    if not shape:
        return {"type": "point", "position": list(at), "intensity": rgb(c * scale**2 for c in color)}
    # Mitsuba's rectangle is 2 x 2 and looks along +Z. What shines evenly has its intensity over its area as radiance.
    w, h = shape["width"], shape["height"]
    turned = world @ np.diag((w / 2, h / 2, 1, 1)) @ np.diag((-1, 1, -1, 1))
    radiance = rgb(c / (w * h) for c in color)
    return {"type": "rectangle", "to_world": mi.ScalarTransform4f(turned), "emitter": {"type": "area", "radiance": radiance}}


def build(path, metal):
    mi = load()
    document = Document(path)
    scale, origin = magnification(document)
    worlds = document.worlds(scale, origin)
    made = {"type": "scene", "integrator": {"type": "direct", "hide_emitters": False}}
    for number, one in enumerate(parts(document, scale, origin)):
        made[f"mesh{number}"] = mesh(mi, document, one, metal)
    for index, world in worlds.items():
        node = document.json["nodes"][index]
        if "camera" in node:
            camera = document.json["cameras"][node["camera"]]["perspective"]
            made["sensor"] = sensor(mi, world @ np.diag((1 / scale, 1 / scale, 1 / scale, 1)), camera["yfov"])
        if "KHR_lights_punctual" in node.get("extensions", {}):
            number = node["extensions"]["KHR_lights_punctual"]["light"]
            light = document.json["extensions"]["KHR_lights_punctual"]["lights"][number]
            made[f"light{number}"] = emitter(mi, light, world, scale)
    if (path.parent / "sky.exr").exists():
        # The middle of the map is towards -Z; Mitsuba's towards +Z.
        turn = mi.ScalarTransform4f().rotate((0, 1, 0), 180)
        made["map"] = {"type": "envmap", "filename": str(path.parent / "sky.exr"), "to_world": turn}
    return mi, mi.load_dict(made)


def sensor(mi, world, yfov):
    film = {"type": "hdrfilm", "width": SIZE[0] * SUBPIXELS, "height": SIZE[1] * SUBPIXELS, "pixel_format": "rgb"}
    film |= {"component_format": "float32", "rfilter": {"type": "box"}}
    # Mitsuba's camera looks along +Z with +X to the left.
    to_world = mi.ScalarTransform4f(world @ np.diag((-1.0, 1.0, -1.0, 1.0)))
    return {"type": "perspective", "fov": math.degrees(yfov), "fov_axis": "y", "near_clip": 0.01, "far_clip": 1e5,
            "to_world": to_world, "film": film, "sampler": {"type": "independent"}}


def reconstruct(fine):
    """The Gaussian of glsl/include/filter.glsl over 3 x 3 pixels, on subpixels; beyond the border there are none."""
    steps = (np.arange(3 * SUBPIXELS) + 0.5) / SUBPIXELS - 1.5
    kernel = np.exp(-steps * steps / (2 * DEVIATION**2))

    def along(rows):
        padded = np.pad(rows, [(SUBPIXELS, SUBPIXELS)] + [(0, 0)] * (rows.ndim - 1))
        count = len(rows) // SUBPIXELS
        windows = [padded[i * SUBPIXELS : (i + 3) * SUBPIXELS] for i in range(count)]
        return np.array([np.tensordot(kernel, window, 1) for window in windows])

    both = lambda picture: along(along(picture).swapaxes(0, 1)).swapaxes(0, 1)
    return both(fine) / both(np.ones(fine.shape[:2]))[..., None]


def render(work):
    for name, scene in chosen().items():
        start = time.time()
        path = next((work / "scenes" / folder(name)).glob("scene.gl*"))
        MATERIALS.clear()
        mi, built = build(path, scene.metal)
        fine = sum(np.array(mi.render(built, spp=SPP, seed=run)) for run in range(RUNS)) / RUNS
        target = work / folder(name) / "mitsuba"
        target.mkdir(parents=True, exist_ok=True)
        write_exr(reconstruct(fine), target / "frame-00000.exr")
        print(f"mitsuba: {name}, {time.time() - start:.1f} s")


# --- the table ----------------------------------------------------------------------------------------------------------------


def read_exr(place):
    return np.array(load().Bitmap(str(next(place.glob("*.exr")))))[..., :3].astype(np.float64)


def worst_tile(a, b):
    """The largest difference of mean radiances over tiles, as a part of the tile's or the picture's, which is more."""
    a, b = (p.mean(2).reshape(SIZE[1] // TILE, TILE, SIZE[0] // TILE, TILE).mean((1, 3)) for p in (a, b))
    return (np.abs(a - b) / np.maximum(b, b.mean())).max()


def side_by_side(pictures, path):
    from PIL import Image

    encoded = [np.where(p <= 0.0031308, 12.92 * p, 1.055 * np.maximum(p, 1e-9) ** (1 / 2.4) - 0.055) for p in pictures]
    encoded.append(np.clip(np.abs(encoded[0].clip(0, 1) - encoded[1].clip(0, 1)) * 4, 0, 1))
    Image.fromarray((np.hstack(encoded).clip(0, 1) * 255 + 0.5).astype(np.uint8)).save(path)


def spoil(work, what):
    """What Mitsuba has rendered is changed in the files that stillray renders: by more than what is allowed, if little more."""
    for name in chosen():
        path = next((work / "scenes" / folder(name)).glob("scene.gl*"))
        document = Document(path)
        tree = document.json
        for light in tree.get("extensions", {}).get("KHR_lights_punctual", {}).get("lights", []):
            light["intensity"] *= 1.02 if what == "light" else 1
        for material in tree["materials"]:
            material["pbrMetallicRoughness"]["roughnessFactor"] *= 0.7 if what == "roughness" else 1
        document.write(path)
        if what == "light" and (path.parent / "sky.exr").exists():
            write_exr(sky() * 1.02, path.parent / "sky.exr")


def report(work):
    lines = ["| scene | light | stillray | Mitsuba | ratio | FLIP | worst tile |", "| --- | --- | ---: | ---: | ---: | ---: | ---: |"]
    failed = []
    for name, scene in chosen().items():
        place = work / folder(name)
        ours, theirs = read_exr(place / "stillray"), read_exr(place / "mitsuba")
        flip = json.loads((place / "compare.json").read_text())["mean"]["flip"]
        ratio, tile = ours.mean() / theirs.mean(), worst_tile(ours, theirs)
        side_by_side([ours, theirs], place / "side-by-side.png")
        # Not a number is no agreement.
        good = abs(ratio - 1) <= MEAN and flip <= FLIP
        failed += [] if good else [name]
        row = f"| {name} | {scene.light} | {ours.mean():.5f} | {theirs.mean():.5f} | {ratio:.4f} | {flip:.4f} | {tile:.2%} |"
        lines.append(row if good else row + " DIFFERS")
    text = "\n".join(lines) + "\n"
    (work / "mitsuba.md").write_text(text)
    print(text, end="")
    return f"compare-mitsuba: {len(failed)} of {len(chosen())} differ: {'; '.join(failed)}" if failed else 0


def chosen():
    """All scenes, or those named in ONLY, with ; between them."""
    only = [name for name in os.environ.get("ONLY", "").split(";") if name]
    return {name: scene for name, scene in SCENES.items() if not only or name in only}


def main(what, *places):
    if what == "write":
        scenes, work = map(Path, places)
        for name, scene in chosen().items():
            write(scene, scenes / scene.file, work / "scenes" / folder(name))
            print(folder(name))
        return 0
    return {"render": render, "break": spoil, "report": report}[what](Path(places[0]), *places[1:])


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
