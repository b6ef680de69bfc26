#!/usr/bin/env python3
"""MeshLab's own figures for a distance: hausdorff.py ORIGINAL RESULT SAMPLES RUNS

Both are raw meshes (bench/src/raw.rs). Prints one line of JSON: mean and rms of each run, the worse of both directions, over area samples alone,
relative to the diagonal of the original.
"""
import json
import sys

import pymeshlab

from simplify import read


def main():
    original, result, samples, runs = sys.argv[1], sys.argv[2], int(sys.argv[3]), int(sys.argv[4])
    meshes = pymeshlab.MeshSet()
    for path in (original, result):
        points, corners = read(path)
        meshes.add_mesh(pymeshlab.Mesh(points, corners.astype("int32")))

    def side(sampled):
        return meshes.get_hausdorff_distance(
            sampledmesh=sampled,
            targetmesh=1 - sampled,
            samplevert=False,
            sampleedge=False,
            sampleface=True,
            samplenum=samples,
            maxdist=pymeshlab.PercentageValue(100),
        )

    found = []
    for _ in range(runs):
        sides = [side(0), side(1)]
        diagonal = sides[0]["diag_mesh_0"]
        found.append({key: max(s[name] for s in sides) / diagonal for key, name in (("mean", "mean"), ("rms", "RMS"))})
    print(json.dumps(found))


if __name__ == "__main__":
    main()
