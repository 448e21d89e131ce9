"""Writes three modes of a mesh: two bends and a twist about its longest axis, each vertex by up to 20 % of that.

python3 examples/bend.py MESH MODES.npz      # the file is for prolate bake --modes
"""

import sys

import numpy as np

import prolate

mesh = prolate.load_mesh(sys.argv[1])
x = mesh.vertices - (mesh.vertices.min(0) + mesh.vertices.max(0)) / 2
size = np.ptp(x, axis=0)
along, *across = np.argsort(-size)
s = 2 * x[:, along] / size[along]  # -1 ... 1

modes = np.zeros((3, *x.shape), dtype=np.float32)
for mode, axis in enumerate(across):
    modes[mode, :, axis] = 0.2 * size[along] * s * np.abs(s)
modes[2, :, across[0]], modes[2, :, across[1]] = s * x[:, across[1]], -s * x[:, across[0]]
np.savez(sys.argv[2], modes=modes, ranges=np.array([1, 1, 0.5], dtype=np.float32))
