"""The C interface through Python's ctypes, as other languages call it:  ctypes_test.py libprolate.so

Structs are written down here by hand, so that a change of prolate.h that breaks programs is noticed.
"""
import ctypes as c
import sys


class Vec3(c.Structure):
    _fields_ = [("x", c.c_float), ("y", c.c_float), ("z", c.c_float)]


class Quat(c.Structure):
    _fields_ = [("x", c.c_float), ("y", c.c_float), ("z", c.c_float), ("w", c.c_float)]


class Pose(c.Structure):
    _fields_ = [("translation", Vec3), ("rotation", Quat)]


class Tree(c.Structure):
    _fields_ = [("opaque", c.c_uint64 * 48)]


class Body(c.Structure):
    _fields_ = [("tree", c.POINTER(Tree)), ("pose", Pose)]


class Pair(c.Structure):
    _fields_ = [(name, c.c_uint32) for name in ("node_a", "node_b", "triangle_a", "triangle_b")]


class Stats(c.Structure):
    _fields_ = [("pair_tests", c.c_uint64), ("block_tests", c.c_uint64), ("triangle_tests", c.c_uint64),
                ("deepest_level", c.c_uint32)]


class DistanceResult(c.Structure):
    _fields_ = [("size", c.c_uint32), ("version", c.c_uint32), ("verdict", c.c_uint8), ("enclosed", c.c_bool),
                ("lower", c.c_double), ("upper", c.c_double), ("point_a", Vec3), ("point_b", Vec3), ("normal", Vec3),
                ("pair", Pair), ("stats", Stats)]


def main(path):
    lib = c.CDLL(path)
    lib.prolate_scratch_size.restype = c.c_size_t
    lib.prolate_status_text.restype = c.c_char_p
    assert lib.prolate_api_version() == 1
    size = lib.prolate_scratch_size()
    memory = c.create_string_buffer(size + 64)
    scratch = c.c_void_p((c.addressof(memory) + 63) // 64 * 64)
    buffer, tree = c.create_string_buffer(16384), Tree()
    needed = c.c_size_t()
    status = lib.prolate_make_box(Vec3(0.5, 0.5, 0.5), buffer, c.c_size_t(len(buffer)), c.byref(needed), c.byref(tree),
                                  None)
    assert status == 0, lib.prolate_status_text(status)

    def body(x):
        return Body(c.pointer(tree), Pose(Vec3(x, 0, 0), Quat(0, 0, 0, 1)))

    result = DistanceResult(size=c.sizeof(DistanceResult), version=1)
    status = lib.prolate_distance(body(0), body(3), scratch, c.c_size_t(size), None, c.byref(result))
    assert status == 0, lib.prolate_status_text(status)
    assert result.verdict == 0 and abs(result.lower - 2) < 1e-5 and result.lower <= 2 <= result.upper
    assert abs(result.point_b.x - 2.5) < 1e-6 and result.stats.pair_tests > 0
    status = lib.prolate_distance(body(0), body(0.5), scratch, c.c_size_t(size), None, c.byref(result))
    assert status == 0 and result.verdict == 1
    assert lib.prolate_distance(body(0), body(3), None, c.c_size_t(size), None, c.byref(result)) == 11
    print("distance 2 between", round(result.point_a.x, 3), "...: ctypes agrees")


main(sys.argv[1])
