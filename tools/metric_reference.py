#!/usr/bin/env python3
"""Writes tests/metric_reference.json: what well-known implementations say of small images, for tests/metric_agreement.rs.

    python3 -m venv target/venv
    target/venv/bin/pip install numpy==1.26.4 scikit-image==0.24.0 flip-evaluator==1.7 cpbd-py312==1.0.3
    target/venv/bin/python tools/metric_reference.py

The images are made by integers and powers of two, so that tests/metric_support/pattern.rs makes the very same ones.
"""

import importlib.metadata
import json
import math
import sys
from pathlib import Path

import cpbd
import flip_evaluator
import numpy as np
from skimage.metrics import structural_similarity

WIDTH, HEIGHT = 80, 72


class Random:
    """The linear congruential generator of Numerical Recipes, its upper 24 bits."""

    def __init__(self, seed):
        self.state = seed

    def next(self, below):
        self.state = (self.state * 1664525 + 1013904223) % 2**32
        return (self.state >> 8) % below


def discs(seed, grey):
    """8-bit codes: discs of random size and colour, each hiding those under it."""
    random, image = Random(seed), np.full((HEIGHT, WIDTH, 3), 128)
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    for _ in range(70):
        radius, cx, cy = 2 + random.next(14), random.next(WIDTH), random.next(HEIGHT)
        colour = [40 + random.next(176) for _ in range(3)]
        image[(x - cx) ** 2 + (y - cy) ** 2 < radius**2] = [colour[0]] * 3 if grey else colour
    return image


def noise(image, seed, amount):
    random = Random(seed)
    offsets = np.array([random.next(2 * amount + 1) - amount for _ in range(image.size)]).reshape(image.shape)
    return np.clip(image + offsets, 0, 255)


def blur(image):
    padded = np.pad(image, ((1, 1), (1, 1), (0, 0)), mode="edge")
    across = padded[:, :-2] + 2 * padded[:, 1:-1] + padded[:, 2:]
    return (across[:-2] + 2 * across[1:-1] + across[2:] + 8) >> 4


VARIANTS = {
    "same": lambda image: image,
    "noise": lambda image: noise(image, 11, 20),
    "blur": blur,
    "blurrier": lambda image: blur(blur(blur(image))),
    "shifted": lambda image: np.roll(image, 1, axis=1),
    "darker": lambda image: image * 3 >> 2,
}


def display(codes):
    return codes.astype(np.float32) / np.float32(255)


def linear(codes, space):
    """Scene-linear values: as they are, over 16 stops from left to right, or partly negative."""
    if space == "wide":
        stops = np.arange(WIDTH) * 16 // WIDTH - 6
        return (codes * 2.0 ** stops[None, :, None] / 256).astype(np.float32)
    return ((codes - (100 if space == "negative" else 0)) / 128).astype(np.float32)


def encode(x):
    x = np.clip(x, 0, 1)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.power(x, 1 / 2.4) - 0.055).astype(np.float32)


def decode(x):
    return np.where(x <= 0.04045, x / 12.92, np.power((x + 0.055) / 1.055, 2.4)).astype(np.float32)


def both(codes, space):
    """Linear and display values."""
    if space == "display":
        shown = display(codes)
        return decode(shown), shown
    light = linear(codes, space)
    return light, encode(light)


def luma(shown):
    rgb = np.round(shown * 255.0).astype(np.uint32)
    return ((rgb[..., 0] * 19595 + rgb[..., 1] * 38470 + rgb[..., 2] * 7471 + 0x8000) >> 16).astype(np.uint8)


def flip(frame, reference, space):
    index, kind = (1, "LDR") if space == "display" else (0, "HDR")
    images = [np.ascontiguousarray(np.maximum(pair[index], 0)) for pair in (reference, frame)]
    error_map, mean, _ = flip_evaluator.evaluate(*images, kind, inputsRGB=True, applyMagma=False, parameters={"ppd": 67.0})
    return float(mean), [float(error_map[y, x].ravel()[0]) for y, x in ((0, 0), (10, 20), (40, 33), (71, 79))]


def measure(frame, reference, space):
    shown, light = (np.subtract(frame[i], reference[i], dtype=np.float64) for i in (1, 0))
    mse = float(np.mean(shown**2))
    flip_mean, flip_pixels = flip(frame, reference, space)
    return {
        "flip": flip_mean,
        "flip_pixels": flip_pixels,
        "rmse": math.sqrt(mse),
        "rmse_linear": math.sqrt(float(np.mean(light**2))),
        "psnr": None if mse == 0 else -10 * math.log10(mse),
        "relative_mse": float(np.mean(light**2 / (np.square(reference[0], dtype=np.float64) + 0.01))),
        "ssim": float(
            structural_similarity(
                reference[1], frame[1], channel_axis=2, data_range=1.0, gaussian_weights=True, sigma=1.5, use_sample_covariance=False
            )
        ),
        "cpbd": float(cpbd.compute(luma(frame[1]))),
        "cpbd_reference": float(cpbd.compute(luma(reference[1]))),
        "energy_ratio": float(np.sum(frame[0], dtype=np.float64) / np.sum(reference[0], dtype=np.float64)),
    }


def images():
    rows = []
    for grey in (True, False):
        for space in ("display", "plain", "wide", "negative"):
            base = discs(5 if grey else 9, grey)
            reference = both(base, space)
            for name, variant in VARIANTS.items():
                codes = variant(base)
                measured = measure(both(codes, space), reference, space)
                rows.append({"grey": grey, "space": space, "variant": name, "code_sum": int(codes.sum()), **measured})
    return rows


def sequences():
    """Unsteadiness of four frames, each with another variant, in both spaces."""
    rows, base = [], discs(9, False)
    for space in ("display", "wide"):
        reference = both(base, space)
        frames = [both(VARIANTS[name](base), space) for name in ("noise", "same", "blur", "noise")]
        row = {"space": space}
        for index, key in ((1, "display"), (0, "linear")):
            errors = np.stack([(f[index] - reference[index]).astype(np.float64) for f in frames])
            bend = errors[2:] - 2 * errors[1:-1] + errors[:-2]
            row[key] = {"std": float(errors.std(axis=0).mean()), "second_difference": float(np.abs(bend).mean())}
        rows.append(row)
    return rows


def main():
    packages = ("numpy", "scipy", "scikit-image", "flip-evaluator", "cpbd-py312")
    versions = {"python": sys.version.split()[0], **{name: importlib.metadata.version(name) for name in packages}}
    made_by = "tools/metric_reference.py"
    table = {"made_by": made_by, "versions": versions, "size": [WIDTH, HEIGHT], "images": images(), "sequences": sequences()}
    path = Path(__file__).resolve().parent.parent / "tests" / "metric_reference.json"
    path.write_text(json.dumps(table, indent=1) + "\n")


if __name__ == "__main__":
    main()
