"""Meshes and trees that all tests share, and a slow reference."""

from __future__ import annotations

import os

import numpy as np
import pytest

import prolate


def box_mesh(half=(1.0, 1.0, 1.0), center=(0.0, 0.0, 0.0)):
    """A closed box of 12 triangles."""
    corner = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=np.float64)
    faces = [
        [0, 1, 3],
        [0, 3, 2],
        [4, 6, 7],
        [4, 7, 5],
        [0, 4, 5],
        [0, 5, 1],
        [2, 3, 7],
        [2, 7, 6],
        [0, 2, 6],
        [0, 6, 4],
        [1, 5, 7],
        [1, 7, 3],
    ]
    return corner * half + center, np.array(faces)


def poses(rng, count, spread, dtype=np.float64):
    """Random poses, uniform rotations."""
    out = np.empty((count, 7))
    out[:, :3] = rng.normal(size=(count, 3)) * spread
    q = rng.normal(size=(count, 4))
    out[:, 3:] = q / np.linalg.norm(q, axis=1, keepdims=True)
    return out.astype(dtype)


def matrix(pose):
    """4x4 of x y z qx qy qz qw, in double precision."""
    x, y, z, w = np.asarray(pose[3:], dtype=np.float64) / np.linalg.norm(pose[3:])
    out = np.eye(4)
    out[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    out[:3, 3] = pose[:3]
    return out


def box_gap(half_a, pose_a, half_b, pose_b):
    """Signed gap of two boxes along the best of the 15 axes of the separating axis test."""
    ma, mb = matrix(pose_a), matrix(pose_b)
    axes = [*ma[:3, :3].T, *mb[:3, :3].T]
    axes += [np.cross(u, v) for u in ma[:3, :3].T for v in mb[:3, :3].T]
    best = -np.inf
    for axis in axes:
        length = np.linalg.norm(axis)
        if length < 1e-9:
            continue
        n = axis / length
        reach = np.abs(n @ ma[:3, :3]) @ half_a + np.abs(n @ mb[:3, :3]) @ half_b
        best = max(best, abs(n @ (mb[:3, 3] - ma[:3, 3])) - reach)
    return best


HALF_A = np.array([1.0, 0.5, 0.25])
HALF_B = np.array([0.3, 0.3, 0.8])
IDENTITY = np.array([0, 0, 0, 0, 0, 0, 1.0])


@pytest.fixture(scope="session")
def box_a():
    return prolate.bake(*box_mesh(HALF_A), exact=True)


@pytest.fixture(scope="session")
def box_b():
    return prolate.bake(*box_mesh(HALF_B), exact=True)


@pytest.fixture(scope="session")
def cover():
    return prolate.bake(*box_mesh(HALF_A), levels=2, quality="fast")


@pytest.fixture(scope="session")
def bakes(tmp_path_factory):
    """A cache of bakes that all tests share, also those that other processes run (pytest-xdist)."""
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "bakes"
    folder.mkdir(exist_ok=True)
    return folder


@pytest.fixture
def own_folder(tmp_path, monkeypatch):
    """The current folder: MuJoCo leaves MUJOCO_LOG.TXT there."""
    monkeypatch.chdir(tmp_path)
