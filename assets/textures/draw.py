#!/usr/bin/env python3
"""Draws the textures of the examples: python3 assets/textures/draw.py

Needs nothing but Python. The results are committed, so only whoever changes this
file has to run it.
"""

import math
import struct
import zlib
from pathlib import Path

HERE = Path(__file__).parent


def save(name, width, height, pixel):
    """Writes an RGB PNG (RFC 2083) of pixel(u, v), u and v in [0, 1)."""
    rows = bytearray()
    for y in range(height):
        rows.append(0)
        for x in range(width):
            for channel in pixel(x / width, y / height):
                rows.append(max(0, min(255, round(255 * channel))))

    def chunk(kind, data):
        crc = zlib.crc32(kind + data)
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", crc)

    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    (HERE / name).write_bytes(
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", header)
        + chunk(b"IDAT", zlib.compress(bytes(rows), 9))
        + chunk(b"IEND", b"")
    )


def noise(x, y, period):
    """Smooth value noise in [0, 1] that repeats after `period` in x and y."""

    def corner(i, j):
        n = (i % period) * 374761393 + (j % period) * 668265263
        n = (n ^ (n >> 13)) * 1274126177 & 0xFFFFFFFF
        return ((n ^ (n >> 16)) & 0xFFFF) / 0xFFFF

    i, j = math.floor(x), math.floor(y)
    s, t = x - i, y - j
    s, t = s * s * (3 - 2 * s), t * t * (3 - 2 * t)
    low = corner(i, j) * (1 - s) + corner(i + 1, j) * s
    high = corner(i, j + 1) * (1 - s) + corner(i + 1, j + 1) * s
    return low * (1 - t) + high * t


def fractal(u, v, period, octaves=4):
    total = weight = 0.0
    for octave in range(octaves):
        scale = period << octave
        total += noise(u * scale, v * scale, scale) / (1 << octave)
        weight += 1 / (1 << octave)
    return total / weight


def mix(a, b, t):
    return tuple(x * (1 - t) + y * t for x, y in zip(a, b))


def marble(u, v):
    """White with swirls and a dark ribbon, to be tinted by the material."""
    swirl = fractal(u, v, 4)
    ribbon = math.sin(2 * math.pi * (3 * u + 1.5 * math.sin(math.pi * v) + 1.2 * swirl))
    light = 0.82 + 0.18 * swirl
    shade = 0.5 + 0.5 * math.tanh(3.5 * (ribbon - 0.35))
    return mix((light, light, light), (0.22, 0.22, 0.28), 0.8 * shade)


def wood(u, v):
    """Four planks along v, with grain; repeats in both directions."""
    plank = math.floor(4 * u)
    across = 4 * u - plank
    shift = plank * 0.37
    grain = fractal(u, (v / 8 + shift) % 1, 16)
    rings = 0.5 + 0.5 * math.sin(2 * math.pi * (across * 5 + 5 * fractal(u, v + shift, 4, 2)))
    tone = 0.55 * grain + 0.25 * rings + 0.2 * noise(plank, 7, 4)
    colour = mix((0.40, 0.24, 0.12), (0.72, 0.50, 0.29), tone)
    gap = min(across, 1 - across)
    return mix((0.16, 0.09, 0.05), colour, min(1, gap / 0.02))


if __name__ == "__main__":
    save("marble.png", 512, 256, marble)
    save("wood.png", 512, 512, wood)
