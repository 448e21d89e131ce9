"""Runs one convex decomposition, for bench/covers/cover.cpp.

    decompose.py list                           names of those that are installed, a line each
    decompose.py NAME COUNT SECONDS IN OUT      at most COUNT hulls of the Wavefront mesh IN, into OUT

Rapier's function takes no count: it makes as many as its defaults lead to.

OUT has the hulls one after the other, each a closed surface oriented outwards. The last line of the standard output is
the cost, as JSON. A run of more than SECONDS is killed by SIGALRM.
"""

import importlib.metadata
import json
import resource
import signal
import sys
import time

# by the name of the package that runs them
PEERS = {"V-HACD": "vhacdx", "CoACD": "coacd", "Rapier": "rapier3d"}


def installed(name):
    try:
        return importlib.metadata.version(PEERS[name])
    except importlib.metadata.PackageNotFoundError:
        return None


def read(path):
    import numpy as np

    vertices, faces = [], []
    with open(path) as file:
        for line in file:
            words = line.split()
            if words[:1] == ["v"]:
                vertices.append([float(x) for x in words[1:4]])
            elif words[:1] == ["f"]:
                faces.append([int(i) - 1 for i in words[1:4]])
    return np.array(vertices), np.array(faces, dtype=np.uint32)


def decompose(name, count, vertices, faces):
    if name == "V-HACD":
        import vhacdx

        return vhacdx.compute_vhacd(vertices, faces, maxConvexHulls=count, asyncACD=False)
    if name == "Rapier":
        import rapier3d

        parts = rapier3d.SharedShape.convex_decomposition(vertices, faces).as_compound().shapes()
        return [shape.as_convex_polyhedron().to_trimesh() for _, shape in parts]
    import coacd

    coacd.set_log_level("off")
    # The lowest threshold that it takes, so that the count decides; all else is its default, as for V-HACD but for threads,
    return coacd.run_coacd(coacd.Mesh(vertices, faces.astype("int32")), threshold=0.01, max_convex_hull=count)


def write(path, hulls):
    import numpy as np

    with open(path, "w") as file:
        first = 1
        for number, (vertices, faces) in enumerate(hulls):
            vertices, faces = np.asarray(vertices, float), np.asarray(faces).reshape(-1, 3)
            corners = vertices[faces] - vertices.mean(0)
            inward = np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) < 0
            file.write("o hull_%d\n" % number)
            file.writelines("v %.9g %.9g %.9g\n" % tuple(v) for v in vertices)
            file.writelines("f %d %d %d\n" % tuple(f[::-1] + first if inward else f + first) for f in faces.astype(int))
            first += len(vertices)


def main():
    if sys.argv[1:] == ["list"]:
        print(*(name for name in PEERS if installed(name)), sep="\n")
        return
    name, count, seconds, source, target = sys.argv[1:]
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.alarm(int(seconds))
    mesh = read(source)
    wall, cpu = time.monotonic(), time.process_time()
    hulls = decompose(name, int(count), *mesh)
    wall, cpu = time.monotonic() - wall, time.process_time() - cpu
    write(target, hulls)
    print(
        json.dumps(
            {
                "hulls": len(hulls),
                "wall_seconds": wall,
                "cpu_seconds": cpu,
                "version": installed(name),
                "megabytes": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
            }
        )
    )


main()
