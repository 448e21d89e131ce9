// libFuzzer target: whatever numbers and bytes a program hands to the C interface, it answers with a status, and a
// verdict that is not *separated* where something is not finite.
//
//   build-fuzz/tests/fuzz_capi -max_total_time=60 -max_len=4096 corpus tests/data
//
// The input: numbers for poses, shapes and options first, then the bytes of a tree; where these are no tree, the whole
// input as one (so that files are seeds), or a box.
#include <prolate/prolate.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <vector>

namespace {

void require_at(bool holds, int line) {
    if (holds) return;
    std::fprintf(stderr, "fuzz_capi.cpp:%d\n", line);
    std::abort();
}
#define require(...) require_at(__VA_ARGS__, __LINE__) // NOLINT(cppcoreguidelines-macro-usage): the line is what helps

// Takes values from the input's front; zeros when it has ended.
class Input {
public:
    Input(const uint8_t* data, size_t size) : data_(data), size_(size) {}
    template <class T> T take() {
        T out{};
        const size_t count = std::min(sizeof out, size_);
        if (count > 0) std::memcpy(static_cast<void*>(&out), data_, count);
        data_ += count, size_ -= count;
        return out;
    }
    // Mostly numbers of a scene; the raw bits now and then.
    float number() {
        const auto kind = take<uint8_t>();
        return kind % 4 == 0 ? take<float>() : static_cast<float>(take<int16_t>()) / 8192;
    }
    prolate_vec3 vector() {
        const float x = number(), y = number(), z = number();
        return {x, y, z};
    }
    prolate_pose pose() {
        const prolate_vec3 t = vector(), axis = vector();
        return {t, {axis.x, axis.y, axis.z, number()}};
    }
    const uint8_t* data() const { return data_; }
    size_t size() const { return size_; }

private:
    const uint8_t* data_;
    size_t size_;
};

template <class T> T fresh() {
    T out{};
    out.size = sizeof out, out.version = PROLATE_API_VERSION;
    return out;
}

bool is_finite(const prolate_pose& p) {
    const double x = p.rotation.x, y = p.rotation.y, z = p.rotation.z, w = p.rotation.w;
    const double square = x * x + y * y + z * z + w * w;
    const double sum = double{p.translation.x} + double{p.translation.y} + double{p.translation.z};
    return std::isfinite(sum) && std::isfinite(square) && square > 0;
}

struct Scratch {
    alignas(64) unsigned char bytes[size_t{1} << 17];
};

void query(Input& in, const prolate_body& a, const prolate_body& b, Scratch& scratch) {
    void* const memory = scratch.bytes;
    const size_t room = sizeof scratch.bytes;
    auto options = fresh<prolate_query_options>();
    options.max_tests = in.take<uint16_t>(), options.max_level = in.take<uint8_t>() % 4, options.margin = in.number();
    const bool finite = is_finite(a.pose) && is_finite(b.pose);
    auto c = fresh<prolate_collide_result>();
    prolate_pair_cache cache = in.take<prolate_pair_cache>();
    cache.used = 0;
    require(prolate_collide(a, b, memory, room, &options, &cache, &c) == PROLATE_OK);
    require(finite || c.verdict != PROLATE_SEPARATED);
    auto again = fresh<prolate_collide_result>();
    require(prolate_collide(a, b, memory, room, &options, &cache, &again) == PROLATE_OK);
    auto limits = fresh<prolate_distance_options>();
    limits.max_tests = options.max_tests, limits.max_distance = in.number(), limits.tolerance_relative = in.number();
    auto d = fresh<prolate_distance_result>();
    require(prolate_distance(a, b, memory, room, &limits, &d) == PROLATE_OK);
    require(d.lower <= d.upper && (finite || d.verdict != PROLATE_SEPARATED));
    auto manifolds = std::make_unique<prolate_manifolds>(in.take<prolate_manifolds>()); // as if of an earlier query
    auto k = fresh<prolate_contact_result>();
    require(prolate_contacts(a, b, manifolds.get(), memory, room, &options, &k) == PROLATE_OK);
    require(manifolds->count <= 4);
    const prolate_half_space ground{in.vector(), in.number()};
    require(prolate_half_space_contacts(a, ground, manifolds.get(), memory, room, &options, &k) == PROLATE_OK);
    require(manifolds->count <= 1);
    require(prolate_half_space_distance(a, ground, memory, room, &limits, &d) == PROLATE_OK);
    require(d.lower <= d.upper);
    const prolate_ray ray{in.vector(), in.vector(), in.number()};
    auto r = fresh<prolate_raycast_result>();
    require(prolate_raycast(a, ray, memory, room, &options, &r) == PROLATE_OK);
    const prolate_ray rays[] = {ray, {in.vector(), ray.direction, in.number()}};
    prolate_tree_hit hits[2];
    require(prolate_raycasts(a, rays, 2, memory, room, &options, hits) == PROLATE_OK);
    require(hits[0].verdict == r.verdict);
    const prolate_vec3 points[] = {in.vector(), in.vector(), in.vector()};
    prolate_signed_distance signed_distances[3];
    prolate_verdict sides[3];
    require(prolate_signed_distances(a, points, 3, in.number(), memory, room, signed_distances) == PROLATE_OK);
    require(prolate_contains(a, points, 3, memory, room, sides) == PROLATE_OK);
    for (const auto& s : signed_distances) require(s.lower <= s.upper);
    auto s = fresh<prolate_sweep_result>();
    auto step = fresh<prolate_sweep_options>();
    step.max_tests = 1 + in.take<uint8_t>(), step.tolerance = in.number(), step.margin = in.number();
    const prolate_motion motion_a{a.pose, in.vector(), in.vector(), in.vector()}, motion_b{b.pose, {}, {}, {}};
    require(prolate_sweep(a.tree, motion_a, b.tree, motion_b, memory, room, &step, &s) == PROLATE_OK);
    require(s.time_lower <= s.time_upper || s.verdict == PROLATE_SEPARATED);
}

// Coordinates within the ranges of a tree's modes, and not; matrices of its bones that are finite, and not.
void query_deformed(Input& in, const prolate_body& a, const prolate_body& b, Scratch& scratch) {
    void* const memory = scratch.bytes;
    const size_t room = sizeof scratch.bytes;
    float q[64];
    const uint32_t modes = prolate_mode_count(b.tree);
    require(modes <= 64);
    bool in_range = true;
    for (uint32_t m = 0; m < modes; ++m) {
        q[m] = prolate_mode_range(b.tree, m) * in.number();
        in_range = in_range && std::fabs(q[m]) <= prolate_mode_range(b.tree, m);
    }
    static float bones[12 * 1024];
    const uint32_t bone_count = prolate_bone_count(b.tree);
    require(bone_count <= 1024);
    for (uint32_t i = 0; i < 12 * bone_count; ++i) {
        bones[i] = in.number();
        in_range = in_range && std::fabs(bones[i]) <= (i % 4 < 3 ? 1024 : 0x1p74f);
    }
    const prolate_deformed_body still{a, nullptr, 0, nullptr, 0}, moved{b, q, modes, bones, bone_count};
    const bool finite = is_finite(a.pose) && is_finite(b.pose);
    auto options = fresh<prolate_query_options>();
    options.max_tests = in.take<uint16_t>(), options.max_level = in.take<uint8_t>() % 4, options.margin = in.number();
    auto limits = fresh<prolate_distance_options>();
    limits.max_tests = options.max_tests, limits.max_distance = in.number(), limits.tolerance_relative = in.number();
    prolate_undecided reason;
    prolate_box3 box;
    require(prolate_bounds_deformed(moved, in.number(), &box) == PROLATE_OK);
    require(in_range || std::isinf(box.upper.x));
    auto c = fresh<prolate_collide_result>();
    require(prolate_collide_deformed(still, moved, memory, room, &options, &c, &reason) == PROLATE_OK);
    require(in_range == (reason != PROLATE_UNDECIDED_COORDINATES));
    require((in_range && finite) || c.verdict != PROLATE_SEPARATED);
    require((reason == PROLATE_DECIDED) == (c.verdict != PROLATE_UNDECIDED));
    auto d = fresh<prolate_distance_result>();
    require(prolate_distance_deformed(moved, still, memory, room, &limits, &d, &reason) == PROLATE_OK);
    require(d.lower <= d.upper);
    require((in_range && finite) || (d.verdict == PROLATE_UNDECIDED && d.lower == 0 && std::isinf(d.upper)));
    require((reason == PROLATE_DECIDED) == (d.verdict != PROLATE_UNDECIDED));
    const prolate_ray ray{in.vector(), in.vector(), in.number()};
    auto r = fresh<prolate_raycast_result>();
    require(prolate_raycast_deformed(moved, ray, memory, room, &options, &r, &reason) == PROLATE_OK);
    require(in_range || (r.verdict == PROLATE_UNDECIDED && reason == PROLATE_UNDECIDED_COORDINATES));
}

void query_more(Input& in, const prolate_body& a, const prolate_body& b, Scratch& scratch) {
    void* const memory = scratch.bytes;
    const size_t room = sizeof scratch.bytes;
    auto options = fresh<prolate_query_options>();
    options.max_tests = in.take<uint16_t>(), options.margin = in.number();
    prolate_tree scaled;
    const bool has_scale = prolate_tree_scale(a.tree, in.number(), &scaled, nullptr) == PROLATE_OK;
    const prolate_body other{has_scale ? &scaled : a.tree, a.pose};
    auto c = fresh<prolate_collide_result>();
    require(prolate_collide(other, b, memory, room, &options, nullptr, &c) == PROLATE_OK);
    require((is_finite(a.pose) && is_finite(b.pose)) || c.verdict != PROLATE_SEPARATED);
    prolate_meeting_pair pairs[8];
    auto all = fresh<prolate_collide_all_result>();
    require(prolate_collide_all(other, b, pairs, in.take<uint8_t>() % 9, memory, room, &options, &all) == PROLATE_OK);
    const prolate_shape shape{in.take<uint8_t>() % 4, in.vector(), in.vector(), in.vector(),
                              b.pose.rotation,        in.number()};
    auto o = fresh<prolate_overlap_result>();
    require(prolate_overlap(other, &shape, memory, room, &options, &o) == PROLATE_OK);
    const prolate_motion motion{a.pose, in.vector(), in.vector(), in.vector()};
    auto step = fresh<prolate_sweep_options>();
    step.max_tests = 1 + in.take<uint8_t>(), step.tolerance = in.number(), step.margin = in.number();
    auto s = fresh<prolate_sweep_result>();
    const prolate_half_space ground{in.vector(), in.number()};
    require(prolate_half_space_sweep(other.tree, motion, ground, memory, room, &step, &s) == PROLATE_OK);
    require(s.time_lower <= s.time_upper || s.verdict == PROLATE_SEPARATED);

    prolate_world* world = nullptr;
    require(prolate_world_create(nullptr, nullptr, &world) == PROLATE_OK);
    const prolate_part part{b.tree, b.pose};
    auto body = fresh<prolate_world_body>();
    prolate_body_id id;
    body.tree = other.tree, body.pose = a.pose, body.parts = &part, body.part_count = 1;
    require(prolate_world_insert(world, &body, &id) == PROLATE_OK);
    body.tree = b.tree, body.pose = b.pose, body.part_count = 0, body.margin = in.number();
    (void)prolate_world_insert(world, &body, &id);
    body.tree = nullptr, body.margin = 0, body.half_space = &ground;
    require(prolate_world_insert(world, &body, &id) == PROLATE_OK);
    const prolate_body_pair* listed = nullptr;
    size_t count = 0, events = 0;
    require(prolate_world_update_pairs(world, nullptr, &listed, &count) == PROLATE_OK);
    require(count <= 5); // of four entries, of which two are one body
    const prolate_workers workers{nullptr, memory, room};
    prolate_verdict verdicts[8];
    prolate_distance_answer distances[8];
    const auto records = std::make_unique<prolate_pair_contacts[]>(8);
    prolate_contact_event event[16];
    auto limits = fresh<prolate_distance_options>();
    limits.max_tests = options.max_tests;
    require(prolate_world_collide(world, listed, count, &workers, &options, verdicts) == PROLATE_OK);
    require(prolate_world_distance(world, listed, count, &workers, &limits, distances) == PROLATE_OK);
    require(prolate_world_contacts(world, listed, count, &workers, &options, records.get(), 8) == PROLATE_OK);
    require(prolate_world_contact_events(world, records.get(), 8, event, 16, &events) == PROLATE_OK);
    const prolate_ray ray{in.vector(), in.vector(), in.number()};
    prolate_ray_hit hit;
    require(prolate_world_raycast(world, &ray, 1, in.take<uint8_t>(), &workers, &options, &hit) == PROLATE_OK);
    prolate_body_id ids[2];
    prolate_shape probe = shape;
    probe.kind %= 3;
    uint32_t found = 0;
    require(prolate_world_overlap(world, &probe, 1, UINT32_MAX, &workers, &options, ids, 2, &found) == PROLATE_OK);
    require(prolate_world_sweep(world, b.tree, motion, UINT32_MAX, &workers, &step, &id, &s) == PROLATE_OK);
    prolate_world_destroy(world);
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    Input in(data, size);
    const auto scratch = std::make_unique<Scratch>();
    std::vector<unsigned char> box(prolate_primitive_size());
    prolate_tree made, opened;
    require(prolate_make_box({1, 0.5f, 0.25f}, box.data(), box.size(), nullptr, &made, nullptr) == PROLATE_OK);
    const prolate_pose pose_a = in.pose(), pose_b = in.pose();
    auto info = fresh<prolate_tree_info>();
    Input rest = in;
    for (int i = 0; i < 256; ++i) rest.take<uint8_t>(); // what follows the numbers
    const bool sound = prolate_tree_open(rest.data(), rest.size(), &opened, nullptr) == PROLATE_OK ||
                       prolate_tree_open(data, size, &opened, nullptr) == PROLATE_OK;
    if (sound) require(prolate_tree_describe(&opened, &info) == PROLATE_OK);
    query(in, {&made, pose_a}, {sound ? &opened : &made, pose_b}, *scratch);
    query_deformed(in, {&made, pose_a}, {sound ? &opened : &made, pose_b}, *scratch);
    query_more(in, {&made, pose_a}, {sound ? &opened : &made, pose_b}, *scratch);
    const prolate_vec3 half = in.vector();
    prolate_tree other;
    (void)prolate_make_box(half, box.data(), box.size(), nullptr, &other, nullptr);
    (void)prolate_make_sphere(half.x, box.data(), box.size(), nullptr, &other, nullptr);
    (void)prolate_make_cylinder(half.x, half.y, 32, box.data(), box.size(), nullptr, &other, nullptr);
    return 0;
}
