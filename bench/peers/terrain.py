#!/usr/bin/env python3
"""One run of a peer that makes triangles of a height grid: terrain.py TOOL GRID OUT ERROR

GRID: "PMGRID01", columns and rows (u64), heights (f32), row after row, little-endian. OUT is a raw mesh (bench/src/raw.rs) of columns, rows
and heights. Prints one line of JSON: seconds of the library's own call.
"""
import json
import struct
import sys
import time

import numpy as np

MAGIC = b"PMRAW001"


def read(path):
    with open(path, "rb") as file:
        assert file.read(8) == b"PMGRID01", path
        columns, rows = struct.unpack("<QQ", file.read(16))
        return np.fromfile(file, "<f4", columns * rows).reshape(rows, columns)


def write(path, points, corners):
    with open(path, "wb") as file:
        file.write(MAGIC + struct.pack("<QQ", len(points), len(corners)))
        np.ascontiguousarray(points, "<f8").tofile(file)
        np.ascontiguousarray(corners, "<u4").tofile(file)


def delatin(heights, error):
    from pydelatin import Delatin

    start = time.perf_counter()
    tin = Delatin(heights, max_error=error)
    points, corners = np.asarray(tin.vertices), np.asarray(tin.triangles)
    seconds = time.perf_counter() - start
    points = points.astype(np.float64).reshape(-1, 3)
    # It counts rows from the last.
    points[:, 1] = heights.shape[0] - 1 - points[:, 1]
    return points, corners.reshape(-1, 3), seconds


def martini(heights, error):
    from pymartini import Martini

    # Squares of a power of two and one: the borders are repeated.
    side = 1
    while side + 1 < max(heights.shape):
        side *= 2
    rest = [(0, side + 1 - n) for n in heights.shape]
    square = np.pad(heights, rest, mode="edge")
    start = time.perf_counter()
    points, corners = Martini(side + 1).create_tile(square).get_mesh(error)
    seconds = time.perf_counter() - start
    points = np.asarray(points).reshape(-1, 2).astype(int)
    points = np.column_stack([points, square[points[:, 1], points[:, 0]]]).astype(np.float64)
    return points, np.asarray(corners).reshape(-1, 3), seconds


def main():
    tool, grid, out, error = sys.argv[1:]
    points, corners, seconds = {"delatin": delatin, "martini": martini}[tool](read(grid), float(error))
    write(out, points, corners)
    print(json.dumps({"seconds": seconds}))


main()
