"""Small robots that tests write, and a slow reference of where their links are."""

from __future__ import annotations

import numpy as np


def rotation(axis, angle):
    """4x4, by Rodrigues' formula."""
    x, y, z = axis
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    out = np.eye(4)
    out[:3, :3] += np.sin(angle) * k + (1 - np.cos(angle)) * k @ k
    return out


def translation(by):
    out = np.eye(4)
    out[:3, 3] = by
    return out


def from_quaternion(x, y, z, w):
    out = np.eye(4)
    s, v = w, np.array([x, y, z])
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    out[:3, :3] = (s * s - v @ v) * np.eye(3) + 2 * np.outer(v, v) + 2 * s * k
    return out


def motion(joint, values):
    if joint.kind in ("revolute", "continuous"):
        return rotation(joint.axis, values[0] - joint.zero)
    if joint.kind == "prismatic":
        return translation(np.array(joint.axis) * (values[0] - joint.zero))
    if joint.kind == "ball":
        return from_quaternion(*values)
    if joint.kind == "floating":
        return translation(values[:3]) @ from_quaternion(*values[3:])
    assert joint.kind == "fixed"
    return np.eye(4)


def frames(description, q):
    """Poses (4, 4) of all links in the root's frame, by name, as the docstring of Joint says."""
    values, at = {}, 0
    for joint in description.joints:
        values[joint.name] = q[at : at + joint.coordinates]
        at += joint.coordinates
    assert at == len(q) == description.nq == len(description.home)
    out = {description.links[0].name: np.eye(4)}
    for joint in description.joints:
        own = values[joint.name]
        if joint.mimic:
            own = [joint.mimic.multiplier * values[joint.mimic.joint][0] + joint.mimic.offset]
        there = translation(joint.anchor) @ motion(joint, own) @ translation(-np.array(joint.anchor))
        out[joint.child] = out[joint.parent] @ joint.origin @ there
    return out


def link(description, name):
    return next(link for link in description.links if link.name == name)


def texts(description, kind):
    return [str(note) for note in description.notes if note.kind == kind]


TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 2 0\nv 0 0 3\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


def volume(mesh):
    """Signed: above 0 if the faces are counter-clockwise seen from outside."""
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)
