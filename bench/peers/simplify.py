#!/usr/bin/env python3
"""One run of a Python peer: simplify.py TOOL IN OUT TARGET

IN and OUT are raw meshes (bench/src/raw.rs). Prints one line of JSON: seconds of the library's own call, seconds from arrays to
arrays, triangles, peak memory.
"""
import json
import struct
import sys
import time

import numpy as np

MAGIC = b"PMRAW001"


def read(path):
    with open(path, "rb") as file:
        assert file.read(8) == MAGIC, path
        vertices, triangles = struct.unpack("<QQ", file.read(16))
        points = np.fromfile(file, "<f8", 3 * vertices).reshape(-1, 3)
        corners = np.fromfile(file, "<u4", 3 * triangles).reshape(-1, 3)
    return points, corners


def write(path, points, corners):
    with open(path, "wb") as file:
        file.write(MAGIC + struct.pack("<QQ", len(points), len(corners)))
        np.ascontiguousarray(points, "<f8").tofile(file)
        np.ascontiguousarray(corners, "<u4").tofile(file)


def fast_simplification(points, corners, target):
    import fast_simplification

    corners = corners.astype(np.int32)
    start = time.perf_counter()
    out = fast_simplification.simplify(points, corners, target_count=target)
    seconds = time.perf_counter() - start
    return out[0], out[1], seconds, seconds


def pyfqmr(points, corners, target):
    import pyfqmr

    corners = corners.astype(np.int32)
    simplifier = pyfqmr.Simplify()
    start = time.perf_counter()
    simplifier.setMesh(points, corners)
    simplifier.simplify_mesh(target_count=target, aggressiveness=7, preserve_border=False, verbose=False)
    out = simplifier.getMesh()
    seconds = time.perf_counter() - start
    return out[0], out[1], seconds, seconds


def meshlab(points, corners, target):
    import pymeshlab

    corners = corners.astype(np.int32)
    start = time.perf_counter()
    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(points, corners))
    inner = time.perf_counter()
    meshes.meshing_decimation_quadric_edge_collapse(targetfacenum=target)
    call = time.perf_counter() - inner
    mesh = meshes.current_mesh()
    out = mesh.vertex_matrix(), mesh.face_matrix()
    return *out, call, time.perf_counter() - start


def peak():
    """Most memory this process had, bytes; None where the system does not say."""
    try:
        with open("/proc/self/status") as status:
            for line in status:
                if line.startswith("VmHWM:"):
                    return 1024 * int(line.split()[1])
    except OSError:
        pass
    return None


def main():
    tool, source, out, target = sys.argv[1:5]
    run = {"fast-simplification": fast_simplification, "pyfqmr": pyfqmr, "meshlab": meshlab}[tool]
    points, corners, call, arrays = run(*read(source), int(target))
    write(out, points, corners)
    print(json.dumps({"call_seconds": call, "arrays_seconds": arrays, "triangles": len(corners), "peak_bytes": peak()}))


if __name__ == "__main__":
    main()
