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


class Id(c.Structure):
    _fields_ = [("index", c.c_uint32), ("generation", c.c_uint32)]


class HalfSpace(c.Structure):
    _fields_ = [("normal", Vec3), ("offset", c.c_float)]


class WorldBody(c.Structure):
    _fields_ = [("size", c.c_uint32), ("version", c.c_uint32), ("tree", c.POINTER(Tree)), ("pose", Pose),
                ("user", c.c_uint64), ("layers", c.c_uint32), ("mask", c.c_uint32), ("margin", c.c_float),
                ("half_space", c.POINTER(HalfSpace)), ("parts", c.c_void_p), ("part_count", c.c_size_t)]


class BodyPair(c.Structure):
    _fields_ = [("a", Id), ("b", Id), ("slot", c.c_uint32), ("begins", c.c_bool), ("moved", c.c_bool)]


class Workers(c.Structure):
    _fields_ = [("jobs", c.c_void_p), ("scratch", c.c_void_p), ("scratch_size", c.c_size_t)]


class Ray(c.Structure):
    _fields_ = [("origin", Vec3), ("direction", Vec3), ("max_t", c.c_float)]


class RayHit(c.Structure):
    _fields_ = [("body", Id), ("verdict", c.c_uint8), ("t", c.c_double), ("clear", c.c_double), ("point", Vec3),
                ("normal", Vec3), ("node", c.c_uint32), ("triangle", c.c_uint32)]


def world(lib, tree, scratch, size):
    """A box on the ground: do they meet, and what does a ray hit?"""
    handle = c.c_void_p()
    assert lib.prolate_world_create(None, None, c.byref(handle)) == 0
    floor, ids = HalfSpace(Vec3(0, 0, 1), 0), [Id(), Id()]
    ground = WorldBody(size=c.sizeof(WorldBody), version=1, half_space=c.pointer(floor))
    box = WorldBody(size=c.sizeof(WorldBody), version=1, tree=c.pointer(tree),
                    pose=Pose(Vec3(0, 0, 0.49), Quat(0, 0, 0, 1)))
    for body, of in zip((ground, box), ids):
        assert lib.prolate_world_insert(handle, c.byref(body), c.byref(of)) == 0
    pairs, count = c.POINTER(BodyPair)(), c.c_size_t()
    assert lib.prolate_world_update_pairs(handle, None, c.byref(pairs), c.byref(count)) == 0
    assert count.value == 1 and pairs[0].begins and pairs[0].b.index == ids[1].index
    workers, verdicts = Workers(None, scratch, size), (c.c_uint8 * 1)()
    assert lib.prolate_world_collide(handle, pairs, count, c.byref(workers), None, verdicts) == 0
    assert verdicts[0] == 1
    ray, hit = Ray(Vec3(0, 0, 5), Vec3(0, 0, -1), float("inf")), RayHit()
    assert lib.prolate_world_raycast(handle, c.byref(ray), c.c_size_t(1), c.c_uint32(2**32 - 1), c.byref(workers), None,
                                     c.byref(hit)) == 0
    assert hit.body.index == ids[1].index and abs(hit.t - 4.01) < 1e-5 and hit.triangle < 12
    lib.prolate_world_destroy(handle)


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
    world(lib, tree, scratch, size)
    assert lib.prolate_distance(body(0), body(3), None, c.c_size_t(size), None, c.byref(result)) == 11
    print("distance 2 between", round(result.point_a.x, 3), "...: ctypes agrees")


main(sys.argv[1])
