/* The whole C interface, called by a program in C11: right answers, and a status for everything that is wrong. */
#include <prolate/prolate.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int failures = 0;

static void check(bool good, const char* what, int line) {
    if (good) return;
    fprintf(stderr, "capi_test.c:%d: %s\n", line, what);
    ++failures;
}
#define CHECK(what) check(what, #what, __LINE__)
#define CHECK_STATUS(call, expected) check((call) == (expected), #call, __LINE__)
#define CHECK_OK(call) CHECK_STATUS(call, PROLATE_OK)

static void* scratch;
static size_t scratch_size;
static unsigned char box_bytes[16384], ball_bytes[16384], other_bytes[16384];
static prolate_tree box, ball;

static const prolate_quat upright = {0, 0, 0, 1};
static prolate_body at(const prolate_tree* tree, float x, float y, float z) {
    const prolate_body out = {tree, {{x, y, z}, upright}};
    return out;
}

static void test_trees(void) {
    prolate_error error = {NULL, 0};
    size_t needed = 0;
    CHECK(prolate_api_version() == PROLATE_API_VERSION);
    CHECK_OK(prolate_make_box((prolate_vec3){0.5f, 0.5f, 0.5f}, box_bytes, sizeof box_bytes, &needed, &box, &error));
    CHECK(needed > 0 && needed <= prolate_primitive_size());
    CHECK_OK(prolate_make_sphere(1, ball_bytes, sizeof ball_bytes, NULL, &ball, NULL));
    prolate_tree other;
    CHECK_OK(prolate_make_cylinder(1, 2, 32, other_bytes, sizeof other_bytes, &needed, &other, NULL));
    CHECK(needed <= prolate_primitive_size());

    prolate_tree_info info = PROLATE_INIT(prolate_tree_info);
    CHECK_OK(prolate_tree_describe(&box, &info));
    CHECK(info.triangles == 12 && info.vertices == 8 && info.exact && !info.surface_mode && !info.prefix);

    const prolate_vec3 points[] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    const uint32_t triangles[] = {0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3};
    CHECK_OK(prolate_make_convex(points, 4, triangles, 4, other_bytes, sizeof other_bytes, &needed, &other, &error));
    CHECK_STATUS(prolate_make_convex(points, 4, triangles, 3, other_bytes, sizeof other_bytes, NULL, &other, &error),
                 PROLATE_BAD_MESH);
    CHECK(error.what != NULL && strlen(error.what) > 10 && error.where == 3);
    CHECK_STATUS(prolate_make_convex(NULL, 4, triangles, 4, other_bytes, sizeof other_bytes, NULL, &other, NULL),
                 PROLATE_BAD_ARGUMENT);
    CHECK_STATUS(prolate_make_box((prolate_vec3){0.5f, -1, 0.5f}, other_bytes, sizeof other_bytes, NULL, &other, NULL),
                 PROLATE_BAD_OPTIONS);
    CHECK_STATUS(prolate_make_box((prolate_vec3){1, 1, 1}, other_bytes, 100, &needed, &other, NULL), PROLATE_NO_ROOM);
    CHECK(needed > 100);
    CHECK_STATUS(prolate_make_sphere(1, NULL, 100, NULL, &other, NULL), PROLATE_BAD_ARGUMENT);
    CHECK_STATUS(prolate_make_sphere(1, other_bytes, sizeof other_bytes, NULL, NULL, NULL), PROLATE_BAD_ARGUMENT);

    /* The bytes of a tree are a file. */
    CHECK_OK(prolate_make_box((prolate_vec3){1, 2, 3}, other_bytes, sizeof other_bytes, &needed, &other, NULL));
    CHECK_OK(prolate_tree_open(other_bytes, needed, &other, &error));
    CHECK_STATUS(prolate_tree_open(other_bytes, needed - 1, &other, &error), PROLATE_BAD_FILE);
    CHECK_STATUS(prolate_tree_open(NULL, 5, &other, &error), PROLATE_BAD_ARGUMENT);
    CHECK_STATUS(prolate_tree_open(NULL, 0, &other, &error), PROLATE_BAD_FILE);
    CHECK_STATUS(prolate_tree_open(other_bytes, needed, NULL, &error), PROLATE_BAD_ARGUMENT);
    const unsigned char version = other_bytes[8];
    other_bytes[8] = 99;
    CHECK_STATUS(prolate_tree_open(other_bytes, needed, &other, &error), PROLATE_NEWER_VERSION);
    other_bytes[8] = version;

    const char* const path = "capi_test.etree";
    FILE* const file = fopen(path, "wb");
    CHECK(file != NULL && fwrite(other_bytes, 1, needed, file) == needed);
    if (file != NULL) fclose(file);
    size_t size = 0;
    CHECK_STATUS(prolate_tree_load(path, NULL, 0, &size, &other, NULL), PROLATE_NO_ROOM);
    CHECK(size == needed);
    void* const bytes = malloc(size);
    CHECK_OK(prolate_tree_load(path, bytes, size, NULL, &other, &error));
    CHECK_OK(prolate_tree_describe(&other, &info));
    free(bytes);
    remove(path);
    CHECK_STATUS(prolate_tree_load(path, other_bytes, sizeof other_bytes, NULL, &other, &error), PROLATE_IO);
    CHECK(error.where != 0);
}

static void test_pairs(void) {
    prolate_collide_result c = PROLATE_INIT(prolate_collide_result);
    prolate_pair_cache cache;
    memset(&cache, 0, sizeof cache);
    for (int i = 0; i < 3; ++i) {
        CHECK_OK(prolate_collide(at(&box, 0, 0, 0), at(&ball, 3, 0, 0), scratch, scratch_size, NULL, &cache, &c));
        CHECK(c.verdict == PROLATE_SEPARATED);
    }
    CHECK_OK(prolate_collide(at(&box, 0, 0, 0), at(&ball, 1.2f, 0, 0), scratch, scratch_size, NULL, NULL, &c));
    CHECK(c.verdict == PROLATE_OVERLAPPING && c.pair.triangle_b == UINT32_MAX && c.stats.pair_tests > 0);
    prolate_query_options options = PROLATE_INIT(prolate_query_options);
    options.margin = 2;
    CHECK_OK(prolate_collide(at(&box, 0, 0, 0), at(&ball, 3, 0, 0), scratch, scratch_size, &options, NULL, &c));
    CHECK(c.verdict == PROLATE_OVERLAPPING);

    prolate_distance_result d = PROLATE_INIT(prolate_distance_result);
    CHECK_OK(prolate_distance(at(&box, 0, 0, 0), at(&box, 3, 0, 0), scratch, scratch_size, NULL, &d));
    CHECK(d.verdict == PROLATE_SEPARATED && d.lower <= 2 && d.upper >= 2 && d.upper - d.lower < 1e-5);
    CHECK(fabsf(d.point_a.x - 0.5f) < 1e-5f && fabsf(d.point_b.x - 2.5f) < 1e-5f);
    CHECK(fabsf(d.normal.x - 1) < 1e-6f && fabsf(d.point_a.x - 0.5f) < 1e-6f);
    prolate_distance_options near = PROLATE_INIT(prolate_distance_options);
    near.max_distance = 0.5;
    CHECK_OK(prolate_distance(at(&box, 0, 0, 0), at(&box, 3, 0, 0), scratch, scratch_size, &near, &d));
    CHECK(d.verdict == PROLATE_SEPARATED && d.lower >= 0.5);

    prolate_manifolds manifolds;
    memset(&manifolds, 0, sizeof manifolds);
    prolate_contact_result k = PROLATE_INIT(prolate_contact_result);
    for (uint32_t step = 0; step < 3; ++step) {
        CHECK_OK(prolate_contacts(at(&box, 0, 0, 0), at(&box, 0.1f, 0.1f, 0.999f), &manifolds, scratch, scratch_size,
                                  NULL, &k));
        CHECK(k.verdict == PROLATE_OVERLAPPING && manifolds.count == 1 && manifolds.manifolds[0].count == 4);
        CHECK(fabsf(manifolds.manifolds[0].normal.z - 1) < 1e-5f);
        CHECK(manifolds.manifolds[0].points[0].age == step);
        CHECK(fabsf(manifolds.manifolds[0].points[0].depth - 0.001f) < 1e-5f);
    }

    prolate_sweep_result s = PROLATE_INIT(prolate_sweep_result);
    const prolate_motion rest = {{{0, 0, 0}, upright}, {0, 0, 0}, {0, 0, 0}, {0, 0, 0}},
                         flight = {{{5, 0, 0}, upright}, {-8, 0, 0}, {0, 0, 0}, {0, 0, 0}};
    CHECK_OK(prolate_sweep(&box, rest, &box, flight, scratch, scratch_size, NULL, &s));
    CHECK(s.verdict == PROLATE_OVERLAPPING && fabs(s.time_upper - 0.5) < 1e-3);
}

static void test_deformed(void) { /* fuzz_capi asks about trees that have modes */
    prolate_collide_result c = PROLATE_INIT(prolate_collide_result);
    prolate_distance_result d = PROLATE_INIT(prolate_distance_result);
    prolate_raycast_result r = PROLATE_INIT(prolate_raycast_result);
    prolate_undecided reason = PROLATE_UNDECIDED_INPUT;
    const prolate_ray ray = {{-5, 0, 0}, {1, 0, 0}, 10};
    prolate_deformed_body still = {at(&box, 0, 0, 0), NULL, 0, NULL, 0},
                          near_by = {at(&box, 0.5f, 0, 0), NULL, 0, NULL, 0},
                          far_off = {at(&box, 3, 0, 0), NULL, 0, NULL, 0};
    CHECK_OK(prolate_collide_deformed(still, far_off, scratch, scratch_size, NULL, &c, &reason));
    CHECK(c.verdict == PROLATE_SEPARATED && reason == PROLATE_DECIDED);
    CHECK_OK(prolate_collide_deformed(still, near_by, scratch, scratch_size, NULL, &c, NULL));
    CHECK(c.verdict == PROLATE_OVERLAPPING && !c.enclosed);
    CHECK_OK(prolate_distance_deformed(still, far_off, scratch, scratch_size, NULL, &d, &reason));
    CHECK(d.verdict == PROLATE_SEPARATED && reason == PROLATE_DECIDED && d.lower > 0 && d.lower <= d.upper);
    prolate_distance_result rigid = PROLATE_INIT(prolate_distance_result);
    CHECK_OK(prolate_distance(still.body, far_off.body, scratch, scratch_size, NULL, &rigid));
    CHECK(fabs(d.upper - rigid.upper) <= 1e-5 * rigid.upper);
    CHECK_OK(prolate_raycast_deformed(far_off, ray, scratch, scratch_size, NULL, &r, &reason));
    CHECK(r.verdict == PROLATE_OVERLAPPING && reason == PROLATE_DECIDED && r.t > 6 && r.t < 8);
    prolate_box3 tight, wide;
    CHECK_OK(prolate_bounds(far_off.body, 0, &tight));
    CHECK_OK(prolate_bounds_deformed(far_off, 0, &wide));
    CHECK(wide.lower.x <= tight.lower.x + 1e-5f && wide.upper.x >= tight.upper.x - 1e-5f && wide.lower.x > 0);
    CHECK_STATUS(prolate_bounds_deformed(far_off, 0, NULL), PROLATE_BAD_ARGUMENT);
    const float q[1] = {0};
    still.q = q, still.q_count = 1; /* the tree has no modes */
    CHECK_OK(prolate_collide_deformed(still, far_off, scratch, scratch_size, NULL, &c, &reason));
    CHECK(c.verdict == PROLATE_UNDECIDED && reason == PROLATE_UNDECIDED_COORDINATES);
    CHECK_OK(prolate_distance_deformed(far_off, still, scratch, scratch_size, NULL, &d, &reason));
    CHECK(d.verdict == PROLATE_UNDECIDED && reason == PROLATE_UNDECIDED_COORDINATES && d.lower == 0 && isinf(d.upper));
    CHECK_OK(prolate_raycast_deformed(still, ray, scratch, scratch_size, NULL, &r, &reason));
    CHECK(r.verdict == PROLATE_UNDECIDED && reason == PROLATE_UNDECIDED_COORDINATES && r.clear == 0);
    CHECK_OK(prolate_bounds_deformed(still, 0, &wide));
    CHECK(isinf(wide.upper.x));
    still.q = NULL;
    CHECK_STATUS(prolate_collide_deformed(still, far_off, scratch, scratch_size, NULL, &c, &reason),
                 PROLATE_BAD_ARGUMENT);
    CHECK_STATUS(prolate_distance_deformed(far_off, still, scratch, scratch_size, NULL, &d, &reason),
                 PROLATE_BAD_ARGUMENT);
    CHECK_STATUS(prolate_raycast_deformed(still, ray, scratch, scratch_size, NULL, &r, &reason), PROLATE_BAD_ARGUMENT);
    CHECK(prolate_mode_count(&box) == 0 && prolate_mode_range(&box, 0) == 0 && prolate_mode_count(NULL) == 0);
    const float bones[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
    still.q_count = 0, still.bones = bones, still.bone_count = 1; /* nor has it bones */
    CHECK_OK(prolate_collide_deformed(still, far_off, scratch, scratch_size, NULL, &c, &reason));
    CHECK(c.verdict == PROLATE_UNDECIDED && reason == PROLATE_UNDECIDED_COORDINATES);
    still.bones = NULL;
    CHECK_STATUS(prolate_raycast_deformed(still, ray, scratch, scratch_size, NULL, &r, &reason), PROLATE_BAD_ARGUMENT);
    CHECK(prolate_bone_count(&box) == 0 && prolate_bone_count(NULL) == 0);
}

static void test_solids(void) {
    prolate_tree coarser, inner;
    CHECK_OK(prolate_tree_coarser(&box, 0, &coarser));
    prolate_tree_info info = PROLATE_INIT(prolate_tree_info);
    CHECK_OK(prolate_tree_describe(&coarser, &info));
    CHECK(info.levels == 1 && info.inner_nodes == 0);
    CHECK_STATUS(prolate_tree_inner(&box, &inner), PROLATE_UNSUPPORTED);
    CHECK_STATUS(prolate_tree_inner(&box, NULL), PROLATE_BAD_ARGUMENT);
    CHECK_STATUS(prolate_tree_coarser(NULL, 0, &coarser), PROLATE_BAD_ARGUMENT);

    prolate_solids_result result = PROLATE_INIT(prolate_solids_result); /* of triangles: both ways certain */
    CHECK_OK(prolate_collide_solids(at(&box, 0, 0, 0), at(&box, 3, 0, 0), scratch, scratch_size, NULL, &result));
    CHECK(result.verdict == PROLATE_SEPARATED && !result.out_of_budget);
    CHECK_OK(prolate_collide_solids(at(&box, 0, 0, 0), at(&box, 0.5f, 0, 0), scratch, scratch_size, NULL, &result));
    CHECK(result.verdict == PROLATE_OVERLAPPING);
    CHECK_OK(prolate_collide_solids(at(&box, 0, 0, 0), at(&ball, 1, 0, 0), scratch, scratch_size, NULL, &result));
    CHECK(result.verdict == PROLATE_UNDECIDED && !result.out_of_budget); /* the ball has no inner cover */
    CHECK_STATUS(prolate_collide_solids(at(&box, 0, 0, 0), at(&ball, 1, 0, 0), NULL, scratch_size, NULL, &result),
                 PROLATE_BAD_ARGUMENT);

    prolate_solids_distance d = PROLATE_INIT(prolate_solids_distance);
    CHECK_OK(prolate_distance_solids(at(&box, 0, 0, 0), at(&box, 3, 0, 0), scratch, scratch_size, NULL, &d));
    CHECK(d.verdict == PROLATE_SEPARATED && d.lower <= 2 && d.upper >= 2 && d.upper - d.lower < 1e-5);
    CHECK_OK(prolate_distance_solids(at(&box, 0, 0, 0), at(&ball, 3, 0, 0), scratch, scratch_size, NULL, &d));
    CHECK(d.verdict == PROLATE_SEPARATED && d.lower <= 1.5 && d.lower > 1.49 && isinf(d.upper));
    d.size = 4;
    CHECK_STATUS(prolate_distance_solids(at(&box, 0, 0, 0), at(&ball, 3, 0, 0), scratch, scratch_size, NULL, &d),
                 PROLATE_BAD_STRUCT);

    prolate_manifolds manifolds = {0};
    prolate_solids_contacts deep = PROLATE_INIT(prolate_solids_contacts);
    const prolate_body here = at(&box, 0, 0, 0), near_it = at(&box, 0.9f, 0, 0);
    CHECK_OK(prolate_contacts_solids(here, near_it, &manifolds, scratch, scratch_size, NULL, &deep));
    CHECK(deep.verdict == PROLATE_OVERLAPPING && deep.depth_lower == 0 && manifolds.count == 1);
    CHECK(deep.depth_upper > 0.0999 && deep.depth_upper < 0.11 && fabsf(deep.way_out.x) > 0.0999f);
    CHECK_OK(prolate_contacts_solids(here, at(&box, 3, 0, 0), &manifolds, scratch, scratch_size, NULL, &deep));
    CHECK(deep.verdict == PROLATE_SEPARATED && deep.depth_upper == 0 && manifolds.count == 0);
    CHECK_STATUS(prolate_contacts_solids(here, near_it, NULL, scratch, scratch_size, NULL, &deep), PROLATE_BAD_ARGUMENT);
}

static void test_one_body(void) {
    prolate_raycast_result r = PROLATE_INIT(prolate_raycast_result);
    const prolate_ray ray = {{-5, 0.1f, 0.1f}, {1, 0, 0}, INFINITY};
    CHECK_OK(prolate_raycast(at(&box, 0, 0, 0), ray, scratch, scratch_size, NULL, &r));
    CHECK(r.verdict == PROLATE_OVERLAPPING && fabs(r.t - 4.5) < 1e-5 && fabsf(r.normal.x + 1) < 1e-5f);

    prolate_ray rays[20]; /* more than are cast at once */
    prolate_tree_hit hits[20];
    for (int i = 0; i < 20; ++i) {
        rays[i] = ray;
        rays[i].origin.y = 0.05f * (float)i;
    }
    CHECK_OK(prolate_raycasts(at(&box, 0, 0, 0), rays, 20, scratch, scratch_size, NULL, hits));
    for (int i = 0; i < 20; ++i) {
        CHECK_OK(prolate_raycast(at(&box, 0, 0, 0), rays[i], scratch, scratch_size, NULL, &r));
        CHECK(hits[i].verdict == r.verdict && hits[i].t == r.t && hits[i].triangle == r.triangle);
        CHECK(hits[i].verdict == (i <= 10 ? PROLATE_OVERLAPPING : PROLATE_SEPARATED));
    }
    CHECK_OK(prolate_raycasts(at(&box, 0, 0, 0), NULL, 0, scratch, scratch_size, NULL, NULL));
    CHECK_STATUS(prolate_raycasts(at(&box, 0, 0, 0), NULL, 1, scratch, scratch_size, NULL, hits), PROLATE_BAD_ARGUMENT);
    CHECK_STATUS(prolate_raycasts(at(&box, 0, 0, 0), rays, 1, scratch, 0, NULL, hits), PROLATE_BAD_ARGUMENT);

    const prolate_half_space ground = {{0, 0, 1}, 0};
    prolate_distance_result d = PROLATE_INIT(prolate_distance_result);
    CHECK_OK(prolate_half_space_distance(at(&box, 0, 0, 2), ground, scratch, scratch_size, NULL, &d));
    CHECK(fabs(d.lower - 1.5) < 1e-6 && d.verdict == PROLATE_SEPARATED);
    prolate_manifolds manifolds;
    memset(&manifolds, 0, sizeof manifolds);
    prolate_contact_result k = PROLATE_INIT(prolate_contact_result);
    CHECK_OK(prolate_half_space_contacts(at(&box, 0, 0, 0.49f), ground, &manifolds, scratch, scratch_size, NULL, &k));
    CHECK(manifolds.count == 1 && manifolds.manifolds[0].count == 4 && manifolds.manifolds[0].normal.z == -1);

    prolate_vec3 points[100];
    prolate_signed_distance distances[100];
    prolate_verdict sides[100];
    for (int i = 0; i < 100; ++i) points[i] = (prolate_vec3){0.02f * (float)i, 0, 0};
    CHECK_OK(prolate_signed_distances(at(&box, 0, 0, 0), points, 100, 0, scratch, scratch_size, distances));
    CHECK_OK(prolate_contains(at(&box, 0, 0, 0), points, 100, scratch, scratch_size, sides));
    for (int i = 0; i < 100; ++i) {
        const double truth = (double)points[i].x - 0.5;
        CHECK(distances[i].lower <= truth + 1e-12 && distances[i].upper >= truth - 1e-12);
        CHECK(distances[i].verdict == sides[i] && sides[i] == (truth > 0 ? PROLATE_SEPARATED : PROLATE_OVERLAPPING));
    }
    CHECK_OK(prolate_contains(at(&box, 0, 0, 0), NULL, 0, scratch, scratch_size, NULL));

    prolate_box3 bounds;
    CHECK_OK(prolate_bounds(at(&box, 10, 0, 0), 0, &bounds));
    CHECK(bounds.lower.x <= 9.5f && bounds.lower.x > 9.4f && bounds.upper.x >= 10.5f && bounds.upper.x < 10.6f);
}

/* Serial jobs, in ranges of two. */
static void run(void* user, uint32_t count, uint32_t grain, void (*body)(void*, uint32_t, uint32_t, uint32_t),
                void* job) {
    (void)grain;
    ++*(int*)user;
    for (uint32_t i = 0; i < count; i += 2) body(job, i, i + 2 < count ? i + 2 : count, 0);
}

static long allocated = 0;
static void* take(void* user, size_t size, size_t alignment) {
    (void)user;
    allocated += (long)size;
    return aligned_alloc(alignment, (size + alignment - 1) / alignment * alignment);
}
static void* take_nothing(void* user, size_t size, size_t alignment) {
    (void)user, (void)size, (void)alignment;
    return NULL;
}
static void give(void* user, void* memory, size_t size, size_t alignment) {
    (void)user, (void)alignment;
    allocated -= (long)size;
    free(memory);
}

static void test_scaled_and_shapes(void) {
    prolate_tree twice;
    prolate_error error = {NULL, 0};
    CHECK_OK(prolate_tree_scale(&box, 2, &twice, &error));
    CHECK_STATUS(prolate_tree_scale(&box, 0, &twice, &error), PROLATE_BAD_OPTIONS);
    CHECK_STATUS(prolate_tree_scale(NULL, 1, &twice, &error), PROLATE_BAD_ARGUMENT);
    prolate_distance_result d = PROLATE_INIT(prolate_distance_result);
    CHECK_OK(prolate_distance(at(&twice, 0, 0, 0), at(&box, 3, 0, 0), scratch, scratch_size, NULL, &d));
    CHECK(d.lower <= 1.5 && d.upper >= 1.5 && d.upper - d.lower < 1e-5);

    /* A capsule is a rounded segment; a box may have round edges. */
    unsigned char segment_bytes[16384];
    prolate_tree capsule, round_box;
    CHECK_OK(prolate_make_capsule((prolate_vec3){0, 0, -1}, (prolate_vec3){0, 0, 1}, 0.25f, segment_bytes,
                                  sizeof segment_bytes, NULL, &capsule, &error));
    CHECK_OK(prolate_distance(at(&capsule, 0, 0, 0), at(&box, 3, 0, 0), scratch, scratch_size, NULL, &d));
    CHECK(d.lower <= 2.25 && d.upper >= 2.25 && d.upper - d.lower < 1e-5);
    CHECK_OK(prolate_tree_round(&box, 0.5f, &round_box, &error));
    CHECK_OK(prolate_distance(at(&round_box, 0, 0, 0), at(&box, 3, 0, 0), scratch, scratch_size, NULL, &d));
    CHECK(d.lower <= 1.5 && d.upper >= 1.5);
    CHECK_STATUS(prolate_tree_round(&box, -1, &round_box, &error), PROLATE_BAD_OPTIONS);
    CHECK_STATUS(prolate_make_capsule((prolate_vec3){0, 0, 0}, (prolate_vec3){0, 0, 1}, 0, segment_bytes,
                                      sizeof segment_bytes, NULL, &capsule, &error),
                 PROLATE_BAD_OPTIONS);

    /* Scratch of the least size, at any address; and less. */
    const size_t least = prolate_scratch_size_of(&box, &ball);
    CHECK(least < 8192 && prolate_scratch_size_of(NULL, NULL) == prolate_scratch_size());
    unsigned char small[8192];
    CHECK_OK(prolate_distance(at(&box, 0, 0, 0), at(&ball, 3, 0, 0), small + 1, least, NULL, &d));
    CHECK(d.lower > 1.49 && d.verdict == PROLATE_SEPARATED);
    CHECK_STATUS(prolate_distance(at(&box, 0, 0, 0), at(&ball, 3, 0, 0), small, least - 1, NULL, &d),
                 PROLATE_BAD_ARGUMENT);

    prolate_meeting_pair pairs[200];
    prolate_collide_all_result all = PROLATE_INIT(prolate_collide_all_result);
    CHECK_OK(prolate_collide_all(at(&box, 0, 0, 0), at(&box, 0.3f, 0.2f, 0.1f), pairs, 200, scratch, scratch_size, NULL,
                                 &all));
    CHECK(all.verdict == PROLATE_OVERLAPPING && all.found > 3 && all.found < 200 && pairs[0].triangle_a < 12);
    const uint64_t found = all.found;
    CHECK_OK(
        prolate_collide_all(at(&box, 0, 0, 0), at(&box, 0.3f, 0.2f, 0.1f), NULL, 0, scratch, scratch_size, NULL, &all));
    CHECK(all.found == found);
    CHECK_STATUS(prolate_collide_all(at(&box, 0, 0, 0), at(&box, 0, 0, 0), NULL, 5, scratch, scratch_size, NULL, &all),
                 PROLATE_BAD_ARGUMENT);

    prolate_shape shape;
    memset(&shape, 0, sizeof shape);
    prolate_overlap_result o = PROLATE_INIT(prolate_overlap_result);
    const struct {
        prolate_shape_kind kind;
        float near, far; /* along x, where it meets the box, and where not */
    } cases[] = {{PROLATE_SPHERE, 0.9f, 1.1f}, {PROLATE_CAPSULE, 0.9f, 1.1f}, {PROLATE_BOX, 0.9f, 1.1f}};
    shape.radius = 0.5f, shape.half = (prolate_vec3){0.5f, 0.1f, 0.1f}, shape.rotation = upright;
    for (size_t i = 0; i < 3; ++i) {
        shape.kind = cases[i].kind;
        shape.a.x = cases[i].near, shape.b = (prolate_vec3){cases[i].near, 0, 1};
        CHECK_OK(prolate_overlap(at(&box, 0, 0, 0), &shape, scratch, scratch_size, NULL, &o));
        CHECK(o.verdict == PROLATE_OVERLAPPING && o.triangle < 12);
        shape.a.x = cases[i].far, shape.b.x = cases[i].far;
        CHECK_OK(prolate_overlap(at(&box, 0, 0, 0), &shape, scratch, scratch_size, NULL, &o));
        CHECK(o.verdict == PROLATE_SEPARATED);
    }
    shape.kind = PROLATE_HALF_SPACE, shape.a = (prolate_vec3){0, 0, 1}, shape.radius = -0.6f;
    CHECK_OK(prolate_overlap(at(&box, 0, 0, 0), &shape, scratch, scratch_size, NULL, &o));
    CHECK(o.verdict == PROLATE_SEPARATED);
    shape.kind = 9;
    CHECK_STATUS(prolate_overlap(at(&box, 0, 0, 0), &shape, scratch, scratch_size, NULL, &o), PROLATE_BAD_OPTIONS);
    CHECK_STATUS(prolate_overlap(at(&box, 0, 0, 0), NULL, scratch, scratch_size, NULL, &o), PROLATE_BAD_ARGUMENT);

    const prolate_motion fall = {{{0, 0, 5}, upright}, {0, 0, -9}, {0, 0, 0}, {0, 0, 0}};
    prolate_sweep_result s = PROLATE_INIT(prolate_sweep_result);
    CHECK_OK(prolate_half_space_sweep(&box, fall, (prolate_half_space){{0, 0, 1}, 0}, scratch, scratch_size, NULL, &s));
    CHECK(s.verdict == PROLATE_OVERLAPPING && fabs(s.time_upper - 0.5) < 1e-3);

    const prolate_ellipsoid e = {{0, 0, 0}, 1, 0, 1, 0, 0, 2};
    const prolate_pose here = {{0, 0, 0}, upright}, there = {{5, 0, 0}, upright};
    prolate_verdict verdict = PROLATE_UNDECIDED;
    prolate_pair_distance gap;
    CHECK_OK(prolate_pair_collide(&e, here, &e, there, 0, &verdict));
    CHECK(verdict == PROLATE_SEPARATED);
    CHECK_OK(prolate_pair_distance_of(&e, here, &e, there, 0, &gap));
    CHECK(gap.lower <= 3 && gap.upper >= 3 && gap.upper - gap.lower < 1e-5f);
    CHECK_STATUS(prolate_pair_collide(NULL, here, &e, there, 0, &verdict), PROLATE_BAD_ARGUMENT);
    CHECK_STATUS(prolate_pair_distance_of(&e, here, &e, there, 0, NULL), PROLATE_BAD_ARGUMENT);

    const prolate_pose many[] = {here, there, {{0.9f, 0, 0}, upright}};
    prolate_verdict verdicts[3];
    CHECK_OK(prolate_collide_poses(&box, &here, 1, &box, many, 3, NULL, scratch, scratch_size, NULL, verdicts));
    CHECK(verdicts[0] == PROLATE_OVERLAPPING && verdicts[1] == PROLATE_SEPARATED && verdicts[2] == PROLATE_OVERLAPPING);
    CHECK_STATUS(prolate_collide_poses(&box, many, 2, &box, many, 3, NULL, scratch, scratch_size, NULL, verdicts),
                 PROLATE_BAD_OPTIONS);
    CHECK_STATUS(prolate_collide_poses(&box, many, 2, &box, NULL, 3, NULL, scratch, scratch_size, NULL, verdicts),
                 PROLATE_BAD_ARGUMENT);
}

static void test_worlds(void) {
    prolate_world* world = NULL;
    const prolate_allocator allocator = {take, give, NULL}, none = {take_nothing, give, NULL},
                            half = {take, NULL, NULL};
    CHECK_STATUS(prolate_world_create(NULL, &none, &world), PROLATE_OUT_OF_MEMORY);
    CHECK_STATUS(prolate_world_create(NULL, &half, &world), PROLATE_BAD_ARGUMENT);
    CHECK_OK(prolate_world_create(NULL, &allocator, &world));
    CHECK(allocated > 0);
    CHECK_OK(prolate_world_reserve(world, 16, 64));
    prolate_body_id ids[12];
    prolate_world_body body = PROLATE_INIT(prolate_world_body);
    body.tree = &box;
    body.pose.rotation = upright;
    for (int i = 0; i < 12; ++i) {
        body.pose.translation.x = 0.9f * (float)i;
        CHECK_OK(prolate_world_insert(world, &body, &ids[i]));
    }
    int runs = 0;
    const prolate_jobs jobs = {run, &runs, 2};
    void* const both = aligned_alloc(64, 2 * scratch_size); /* one for each worker */
    const prolate_workers two = {&jobs, both, 2 * scratch_size}, too_few = {&jobs, both, scratch_size},
                          one = {NULL, scratch, scratch_size};
    const prolate_body_pair* pairs = NULL;
    size_t count = 0;
    CHECK_OK(prolate_world_update_pairs(world, &jobs, &pairs, &count));
    CHECK(count >= 11);
    prolate_verdict* const verdicts = malloc(count + 1);
    CHECK_STATUS(prolate_world_collide(world, pairs, count, &too_few, NULL, verdicts), PROLATE_BAD_ARGUMENT);
    CHECK_OK(prolate_world_collide(world, pairs, count, &two, NULL, verdicts));
    int meeting = 0;
    for (size_t i = 0; i < count; ++i) meeting += verdicts[i] == PROLATE_OVERLAPPING;
    CHECK(meeting == 11 && runs > 0);
    CHECK_OK(prolate_world_collide(world, pairs, count, &one, NULL, verdicts));
    prolate_verdict* const certain = malloc(count + 1);
    CHECK_OK(prolate_world_collide_solids(world, pairs, count, &two, NULL, certain));
    for (size_t i = 0; i < count; ++i) CHECK(certain[i] == verdicts[i] || certain[i] == PROLATE_UNDECIDED);
    free(certain);
    free(verdicts);
    prolate_distance_answer* const distances = calloc(count, sizeof *distances);
    CHECK_OK(prolate_world_distance(world, pairs, count, &two, NULL, distances));
    for (size_t i = 0; i < count; ++i) CHECK(distances[i].lower <= distances[i].upper);
    free(distances);
    CHECK_OK(prolate_world_move(world, ids[0], (prolate_pose){{50, 0, 0}, upright}));
    CHECK_OK(prolate_world_remove(world, ids[4]));
    CHECK_STATUS(prolate_world_remove(world, ids[4]), PROLATE_BAD_ID);
    CHECK_STATUS(prolate_world_move(world, ids[4], (prolate_pose){{50, 0, 0}, upright}), PROLATE_BAD_ID);
    prolate_verdict unused[64];
    CHECK_STATUS(prolate_world_collide(world, pairs, count, &one, NULL, unused), PROLATE_BAD_ID);
    CHECK_STATUS(prolate_world_collide_solids(world, pairs, count, &one, NULL, unused), PROLATE_BAD_ID);
    CHECK_OK(prolate_world_update_pairs(world, NULL, &pairs, &count));
    CHECK_STATUS(prolate_world_insert(world, NULL, &ids[0]), PROLATE_BAD_ARGUMENT);
    body.version = 9;
    CHECK_STATUS(prolate_world_insert(world, &body, &ids[0]), PROLATE_BAD_STRUCT);
    free(both);
    prolate_world_destroy(world);
    prolate_world_destroy(NULL);
    CHECK(allocated == 0);
}

/* A compound stands on the ground: contacts, events, rays, probes and sweeps; then it is taken away. */
static void test_scene(void) {
    prolate_world* world = NULL;
    const prolate_allocator allocator = {take, give, NULL};
    CHECK_OK(prolate_world_create(NULL, &allocator, &world));
    const prolate_workers one = {NULL, scratch, scratch_size};
    const prolate_half_space floor = {{0, 0, 1}, 0};
    prolate_world_body body = PROLATE_INIT(prolate_world_body);
    prolate_body_id ground, id, part, owner;
    CHECK_STATUS(prolate_world_insert(world, &body, &ground), PROLATE_BAD_ARGUMENT); /* neither */
    body.half_space = &floor;
    CHECK_OK(prolate_world_insert(world, &body, &ground));
    body.tree = &box; /* both */
    CHECK_STATUS(prolate_world_insert(world, &body, &id), PROLATE_BAD_ARGUMENT);
    const prolate_part parts[] = {{&ball, {{3, 0, 0.5f}, upright}}};
    body.half_space = NULL, body.parts = parts, body.part_count = 1, body.user = 7;
    body.pose = (prolate_pose){{0, 0, 0.49f}, upright};
    CHECK_OK(prolate_world_insert(world, &body, &id));
    body.parts = NULL;
    CHECK_STATUS(prolate_world_insert(world, &body, &part), PROLATE_BAD_ARGUMENT);
    CHECK_OK(prolate_world_part(world, id, 1, &part));
    CHECK_STATUS(prolate_world_part(world, id, 2, &owner), PROLATE_BAD_ID);
    CHECK_OK(prolate_world_body_of(world, part, &owner));
    CHECK(owner.index == id.index && owner.generation == id.generation);
    prolate_pose pose;
    uint64_t user = 0;
    CHECK_OK(prolate_world_find(world, part, &pose, &user));
    CHECK(user == 7 && fabsf(pose.translation.x - 3) < 1e-6f && fabsf(pose.translation.z - 0.99f) < 1e-6f);
    CHECK_STATUS(prolate_world_find(world, (prolate_body_id){9, 9}, &pose, NULL), PROLATE_BAD_ID);

    const prolate_body_pair* pairs = NULL;
    size_t count = 0, events = 0;
    uint32_t slots = 0;
    CHECK_OK(prolate_world_update_pairs(world, NULL, &pairs, &count));
    CHECK_OK(prolate_world_slot_count(world, &slots));
    CHECK(count == 2 && slots == 2);
    prolate_pair_contacts records[2];
    memset(records, 0, sizeof records);
    prolate_contact_event event[8];
    CHECK_OK(prolate_world_contacts(world, pairs, count, &one, NULL, records, slots));
    CHECK_STATUS(prolate_world_contacts(world, pairs, count, &one, NULL, records, 1), PROLATE_BAD_OPTIONS);
    CHECK(records[0].touching && records[0].verdict == PROLATE_OVERLAPPING && records[0].manifolds.count == 1);
    CHECK(records[0].manifolds.manifolds[0].count == 4 && records[0].manifolds.manifolds[0].normal.z == 1);
    CHECK_OK(prolate_world_contact_events(world, records, slots, event, 8, &events));
    CHECK(events == 2 && event[0].kind == PROLATE_CONTACT_BEGAN && event[1].kind == PROLATE_CONTACT_BEGAN);
    CHECK_OK(prolate_world_contact_events(world, records, slots, event, 8, &events));
    CHECK(events == 2 && event[0].kind == PROLATE_CONTACT_STAYS);
    CHECK_STATUS(prolate_world_contact_events(world, records, slots, event, 1, &events), PROLATE_BAD_OPTIONS);

    const prolate_ray rays[] = {{{0, 0, 9}, {0, 0, -1}, INFINITY},
                                {{3, 0, 9}, {0, 0, -1}, INFINITY},
                                {{9, 0, 9}, {0, 0, -1}, INFINITY},
                                {{9, 0, 9}, {0, 0, 1}, INFINITY}};
    prolate_ray_hit hits[4];
    CHECK_OK(prolate_world_raycast(world, rays, 4, UINT32_MAX, &one, NULL, hits));
    CHECK(hits[0].body.index == id.index && fabs(hits[0].t - 8.01) < 1e-5 && hits[0].normal.z > 0.99f);
    CHECK(hits[1].body.index == part.index && hits[2].body.index == ground.index && fabs(hits[2].t - 9) < 1e-6);
    CHECK(hits[3].verdict == PROLATE_SEPARATED && hits[3].body.generation == 0);

    prolate_shape shapes[70]; // more than are worked on at once
    memset(shapes, 0, sizeof shapes);
    for (size_t i = 0; i < 70; ++i) shapes[i].a = (prolate_vec3){0, 0, i % 2 ? 0.5f : 50}, shapes[i].radius = 1;
    prolate_body_id met[70];
    uint32_t found[70];
    memset(met, 0, sizeof met);
    CHECK_OK(prolate_world_overlap(world, shapes, 70, UINT32_MAX, &one, NULL, met, 1, found));
    for (size_t i = 0; i < 70; ++i)
        CHECK(found[i] == (i % 2 ? 2u : 0u) && met[i].generation == (i % 2 ? ground.generation : 0));
    CHECK(met[69].index == ground.index);
    CHECK_OK(prolate_world_overlap(world, shapes, 70, UINT32_MAX, &one, NULL, NULL, 0, found));
    CHECK(found[69] == 2);
    shapes[69].kind = PROLATE_HALF_SPACE;
    CHECK_STATUS(prolate_world_overlap(world, shapes, 70, UINT32_MAX, &one, NULL, met, 1, found), PROLATE_BAD_OPTIONS);
    CHECK_STATUS(prolate_world_overlap(world, NULL, 1, UINT32_MAX, &one, NULL, met, 1, found), PROLATE_BAD_ARGUMENT);

    prolate_sweep_result s = PROLATE_INIT(prolate_sweep_result);
    const prolate_motion fall = {{{0, 0, 5}, upright}, {0, 0, -5}, {0, 0, 0}, {0, 0, 0}};
    CHECK_OK(prolate_world_sweep(world, &box, fall, UINT32_MAX, &one, NULL, &owner, &s));
    CHECK(owner.index == id.index && s.verdict == PROLATE_OVERLAPPING && s.time_upper > 0.69 && s.time_upper < 0.71);

    const prolate_pose away = {{0, 0, 90}, upright};
    prolate_error error = {NULL, 0};
    CHECK_STATUS(prolate_world_move_many(world, &part, &away, 1, NULL, &error), PROLATE_BAD_ID);
    CHECK(error.what != NULL && error.where == 0);
    CHECK_OK(prolate_world_move_many(world, &id, &away, 1, NULL, &error));
    CHECK_OK(prolate_world_update_pairs(world, NULL, &pairs, &count));
    CHECK(count == 0);
    CHECK_OK(prolate_world_ended_pairs(world, &pairs, &count));
    CHECK(count == 2 && pairs[0].a.index == ground.index);
    CHECK_OK(prolate_world_contact_events(world, records, slots, event, 8, &events));
    CHECK(events == 2 && event[0].kind == PROLATE_CONTACT_ENDED);
    CHECK_OK(prolate_world_refilter(world, id, 1, 0));
    CHECK_OK(prolate_world_remove(world, id));
    prolate_world_destroy(world);
    CHECK(allocated == 0);
}

static void test_bad_input(void) {
    prolate_collide_result c = PROLATE_INIT(prolate_collide_result);
    prolate_tree never_opened;
    memset(&never_opened, 0, sizeof never_opened);
    const prolate_body good = at(&box, 0, 0, 0);
    CHECK_STATUS(prolate_collide(at(NULL, 0, 0, 0), good, scratch, scratch_size, NULL, NULL, &c), PROLATE_BAD_ARGUMENT);
    CHECK_STATUS(prolate_collide(good, at(&never_opened, 0, 0, 0), scratch, scratch_size, NULL, NULL, &c),
                 PROLATE_BAD_ARGUMENT);
    CHECK_STATUS(prolate_collide(good, good, NULL, scratch_size, NULL, NULL, &c), PROLATE_BAD_ARGUMENT);
    CHECK_STATUS(prolate_collide(good, good, scratch, 100, NULL, NULL, &c), PROLATE_BAD_ARGUMENT);
    CHECK_STATUS(prolate_collide(good, good, scratch, scratch_size, NULL, NULL, NULL), PROLATE_BAD_ARGUMENT);
    c.version = 2;
    CHECK_STATUS(prolate_collide(good, good, scratch, scratch_size, NULL, NULL, &c), PROLATE_BAD_STRUCT);
    c = PROLATE_INIT(prolate_collide_result);
    c.size = 3;
    CHECK_STATUS(prolate_collide(good, good, scratch, scratch_size, NULL, NULL, &c), PROLATE_BAD_STRUCT);
    prolate_query_options options = {0};
    c = PROLATE_INIT(prolate_collide_result);
    CHECK_STATUS(prolate_collide(good, good, scratch, scratch_size, &options, NULL, &c), PROLATE_BAD_STRUCT);

    /* An older program's struct, which ends after the verdict: no byte behind it changes. */
    c.size = 9;
    c.pair.node_a = 12345;
    CHECK_OK(prolate_collide(good, at(&box, 0.7f, 0, 0), scratch, scratch_size, NULL, NULL, &c));
    CHECK(c.verdict == PROLATE_OVERLAPPING && c.pair.node_a == 12345);

    /* What is not finite is never separated. */
    c = PROLATE_INIT(prolate_collide_result);
    prolate_distance_result d = PROLATE_INIT(prolate_distance_result);
    const float bad[] = {NAN, INFINITY, -INFINITY};
    for (int i = 0; i < 3; ++i) {
        CHECK_OK(prolate_collide(good, at(&box, bad[i], 9, 9), scratch, scratch_size, NULL, NULL, &c));
        CHECK(c.verdict != PROLATE_SEPARATED);
        CHECK_OK(prolate_distance(good, at(&box, bad[i], 9, 9), scratch, scratch_size, NULL, &d));
        CHECK(d.verdict != PROLATE_SEPARATED && d.lower == 0);
    }
    const prolate_body no_rotation = {&box, {{9, 9, 9}, {0, 0, 0, 0}}};
    CHECK_OK(prolate_collide(good, no_rotation, scratch, scratch_size, NULL, NULL, &c));
    CHECK(c.verdict != PROLATE_SEPARATED);
    CHECK_STATUS(prolate_bounds(good, 0, NULL), PROLATE_BAD_ARGUMENT);
    for (prolate_status s = -2; s < 20; ++s) CHECK(strlen(prolate_status_text(s)) > 5);
}

int main(void) {
    scratch_size = (prolate_scratch_size() + 63) / 64 * 64;
    scratch = aligned_alloc(64, scratch_size);
    test_trees();
    test_pairs();
    test_deformed();
    test_solids();
    test_one_body();
    test_scaled_and_shapes();
    test_worlds();
    test_scene();
    test_bad_input();
    free(scratch);
    if (failures == 0) puts("the C interface answers as it should");
    return failures != 0;
}
