/* The runtime for C (C11), and for every language that calls C: libprolate.so. The C++ headers beside this one are the
 * reference of what is asked and certified; each function below names its own.
 *
 * Conventions
 *  - Functions return a prolate_status, and PROLATE_OK is 0. A failed call writes nothing but *error.
 *  - Structs that may grow begin with their size and a version. Make them with PROLATE_INIT(type), or set `size` to
 *    sizeof and `version` to PROLATE_API_VERSION. A library reads and writes no more than the size that it is told, so
 *    that a program runs with later libraries of the same version. Anything else is PROLATE_BAD_STRUCT.
 *  - Options may be NULL for the defaults, and so may caches and errors. All other pointers must not be NULL:
 *    PROLATE_BAD_ARGUMENT.
 *  - Queries allocate nothing: they work in `scratch`, memory of the caller's of any alignment, for one query at a
 * time. prolate_scratch_size_of() says how much its trees need, a few KiB; with prolate_scratch_size() bytes, some
 * queries make fewer tests (query.hpp: Scratch). It needs no initialisation. Only what has workers needs the latter for
 * each, aligned to 64. Only the functions that make primitives and worlds allocate, the latter by the caller's
 * functions.
 *  - Trees may be shared between threads. Nothing has hidden state.
 *  - Lengths in metres or any unit used consistently; a pose rotates first, then translates; quaternions are
 *    x, y, z, w.
 *  - What is not finite is no error of a query, but never *separated* (query.hpp).
 */
#ifndef PROLATE_PROLATE_H
#define PROLATE_PROLATE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#if defined(__GNUC__)
#define PROLATE_API __attribute__((visibility("default")))
#else
#define PROLATE_API
#endif

/** Of this header. Raised when a struct or function changes so that older programs would not run. */
#define PROLATE_API_VERSION 1u

/** A struct of this type with its size and version set, and all else 0. C only: C++ has headers of its own. */
#define PROLATE_INIT(type) ((type){.size = sizeof(type), .version = PROLATE_API_VERSION})

/** What went wrong. Values are stable; 1 to 10, and 14, are those of prolate::ErrorCode. */
typedef int32_t prolate_status;
enum {
    PROLATE_OK = 0,
    PROLATE_BAD_OPTIONS = 1,
    PROLATE_BAD_MESH = 2,
    PROLATE_BAD_FILE = 3,
    PROLATE_NEWER_VERSION = 4,
    PROLATE_IO = 5,
    PROLATE_CANCELLED = 6,
    PROLATE_UNSUPPORTED = 7,
    PROLATE_INTERNAL = 8,
    PROLATE_OUT_OF_MEMORY = 9,
    PROLATE_BAD_ID = 10,
    PROLATE_BAD_ARGUMENT = 11, /**< a pointer is NULL, or scratch too small or not aligned */
    PROLATE_BAD_STRUCT = 12,   /**< the size or version of a struct */
    PROLATE_NO_ROOM = 13,      /**< a buffer is too small; *needed says how large it must be */
    PROLATE_BUSY = 14          /**< a world is calling a function of the caller's, and must not change */
};

/** One line of English, static; of any number. */
PROLATE_API const char* prolate_status_text(prolate_status status);

/** More about a failure: static text, and the byte offset, index or errno that it is about. */
typedef struct prolate_error {
    const char* what;
    uint64_t where;
} prolate_error;

/** PROLATE_API_VERSION of the library. */
PROLATE_API uint32_t prolate_api_version(void);
/** Bytes of scratch that are enough for every query of all trees. */
PROLATE_API size_t prolate_scratch_size(void);

/* ---- values ---- */

typedef struct prolate_vec3 {
    float x, y, z;
} prolate_vec3;
typedef struct prolate_quat {
    float x, y, z, w;
} prolate_quat;
typedef struct prolate_pose {
    prolate_vec3 translation;
    prolate_quat rotation;
} prolate_pose;
typedef struct prolate_box3 {
    prolate_vec3 lower, upper;
} prolate_box3;

/** query.hpp: Verdict. Only PROLATE_SEPARATED is a promise that nothing touches. */
typedef uint8_t prolate_verdict;
enum { PROLATE_SEPARATED = 0, PROLATE_OVERLAPPING = 1, PROLATE_UNDECIDED = 2 };

/** collide.hpp: MeetingPair. Triangles are UINT32_MAX where there are none. */
typedef struct prolate_meeting_pair {
    uint32_t node_a, node_b, triangle_a, triangle_b;
} prolate_meeting_pair;

/* ---- trees ---- */

/** An opened tree: it holds no memory, and points into the bytes that it was opened in, which must outlive it. May be
 * copied. */
typedef struct prolate_tree {
    uint64_t opaque[48];
} prolate_tree;

/** tree.hpp: TreeView::open(). Checks `bytes`, so that no file whatsoever makes a later query fail. */
PROLATE_API prolate_status prolate_tree_open(const void* bytes, size_t count, prolate_tree* tree, prolate_error* error);
/** Reads a file into `buffer`, of `capacity` bytes, and opens it there. `needed`, if not NULL, gets the file's size,
 * also with PROLATE_NO_ROOM. */
PROLATE_API prolate_status prolate_tree_load(const char* path, void* buffer, size_t capacity, size_t* needed,
                                             prolate_tree* tree, prolate_error* error);

typedef struct prolate_tree_info {
    uint32_t size, version;
    uint32_t nodes, levels, triangles, vertices;
    bool exact, surface_mode, proved, prefix;
    double volume, center[3], inertia[6]; /**< mass.hpp, at density 1: xx, yy, zz, xy, xz, yz */
    double volume_error, center_error, inertia_error;
    uint32_t inner_nodes; /**< of the inner cover; 0: there is none */
} prolate_tree_info;
/** query.hpp: scratch_size(): bytes that the queries of `a` need at least, or those of `a` and `b` if that is not NULL.
 * Of trees that are not open, prolate_scratch_size(). */
PROLATE_API size_t prolate_scratch_size_of(const prolate_tree* a, const prolate_tree* b);

PROLATE_API prolate_status prolate_tree_describe(const prolate_tree* tree, prolate_tree_info* info);

/** tree.hpp: TreeView::scaled(). The same bytes, seen `scale` times as large. `scaled` may be `tree`. */
PROLATE_API prolate_status prolate_tree_scale(const prolate_tree* tree, float scale, prolate_tree* scaled,
                                              prolate_error* error);

/** tree.hpp: TreeView::rounded(). `rounded` may be `tree`. */
PROLATE_API prolate_status prolate_tree_round(const prolate_tree* tree, float radius, prolate_tree* rounded,
                                              prolate_error* error);

/** tree.hpp: TreeView::coarser(). The levels 0 to `last`. `coarser` may be `tree`. */
PROLATE_API prolate_status prolate_tree_coarser(const prolate_tree* tree, uint32_t last, prolate_tree* coarser);

/** tree.hpp: TreeView::inner(). PROLATE_UNSUPPORTED if the tree has no inner cover. `inner` may be `tree`. */
PROLATE_API prolate_status prolate_tree_inner(const prolate_tree* tree, prolate_tree* inner);

/** primitives.hpp. Their bytes go into `buffer` as with prolate_tree_load(); prolate_primitive_size() is enough but for
 * large polyhedra and cylinders of more than 64 sides. `triangles`: three indices each. */
PROLATE_API size_t prolate_primitive_size(void);
PROLATE_API prolate_status prolate_make_box(prolate_vec3 half, void* buffer, size_t capacity, size_t* needed,
                                            prolate_tree* tree, prolate_error* error);
PROLATE_API prolate_status prolate_make_sphere(float radius, void* buffer, size_t capacity, size_t* needed,
                                               prolate_tree* tree, prolate_error* error);
PROLATE_API prolate_status prolate_make_cylinder(float radius, float half_height, uint32_t sides, void* buffer,
                                                 size_t capacity, size_t* needed, prolate_tree* tree,
                                                 prolate_error* error);
/** capsule_tree(): `tree` is rounded by the radius, which `buffer` does not hold. */
PROLATE_API prolate_status prolate_make_capsule(prolate_vec3 a, prolate_vec3 b, float radius, void* buffer,
                                                size_t capacity, size_t* needed, prolate_tree* tree,
                                                prolate_error* error);
PROLATE_API prolate_status prolate_make_convex(const prolate_vec3* points, size_t point_count,
                                               const uint32_t* triangles, size_t triangle_count, void* buffer,
                                               size_t capacity, size_t* needed, prolate_tree* tree,
                                               prolate_error* error);

/* ---- queries ---- */

/** A tree at a pose. */
typedef struct prolate_body {
    const prolate_tree* tree;
    prolate_pose pose;
} prolate_body;

/** query.hpp: QueryOptions. 0 of max_tests and max_level means no limit. */
typedef struct prolate_query_options {
    uint32_t size, version;
    uint64_t max_tests;
    uint32_t max_level; /**< 0: all; else 1 more than QueryOptions::max_level */
    float margin;
} prolate_query_options;

/** query.hpp: QueryStats. */
typedef struct prolate_stats {
    uint64_t pair_tests, block_tests, triangle_tests;
    uint32_t deepest_level;
} prolate_stats;

/** collide.hpp: PairCache. Set it to 0 before its first use, and when a tree changes. */
typedef struct prolate_pair_cache {
    uint64_t opaque[10];
    uint32_t used;
} prolate_pair_cache;

typedef struct prolate_collide_result {
    uint32_t size, version;
    prolate_verdict verdict;
    bool enclosed;
    prolate_meeting_pair pair;
    prolate_stats stats;
} prolate_collide_result;
/** collide.hpp: collide(). */
PROLATE_API prolate_status prolate_collide(prolate_body a, prolate_body b, void* scratch, size_t scratch_size,
                                           const prolate_query_options* options, prolate_pair_cache* cache,
                                           prolate_collide_result* result);

typedef struct prolate_collide_all_result {
    uint32_t size, version;
    prolate_verdict verdict;
    bool enclosed;
    uint64_t found; /**< all of them; the first `capacity` are written */
    prolate_stats stats;
} prolate_collide_all_result;
/** collide.hpp: collide_all(). `pairs` has room for `capacity`, and may be NULL if that is 0. */
PROLATE_API prolate_status prolate_collide_all(prolate_body a, prolate_body b, prolate_meeting_pair* pairs,
                                               size_t capacity, void* scratch, size_t scratch_size,
                                               const prolate_query_options* options,
                                               prolate_collide_all_result* result);

/** distance.hpp: DistanceOptions. 0 of max_distance and max_tests means no limit, of tolerances the default. */
typedef struct prolate_distance_options {
    uint32_t size, version;
    double tolerance_absolute, tolerance_relative, max_distance;
    uint64_t max_tests;
} prolate_distance_options;
typedef struct prolate_distance_result {
    uint32_t size, version;
    prolate_verdict verdict;
    bool enclosed;
    double lower, upper; /**< certified: lower <= distance <= upper */
    prolate_vec3 point_a, point_b, normal;
    prolate_meeting_pair pair;
    prolate_stats stats;
} prolate_distance_result;
/** distance.hpp: distance(). */
PROLATE_API prolate_status prolate_distance(prolate_body a, prolate_body b, void* scratch, size_t scratch_size,
                                            const prolate_distance_options* options, prolate_distance_result* result);

typedef struct prolate_solids_result {
    uint32_t size, version;
    prolate_verdict verdict; /**< of the solids, both ways certain; PROLATE_UNDECIDED: within the band */
    bool out_of_budget;
    prolate_stats stats;
} prolate_solids_result;
/** solids.hpp: collide() of solids, made for this call. */
PROLATE_API prolate_status prolate_collide_solids(prolate_body a, prolate_body b, void* scratch, size_t scratch_size,
                                                  const prolate_query_options* options, prolate_solids_result* result);

typedef struct prolate_solids_distance {
    uint32_t size, version;
    prolate_verdict verdict;
    double lower, upper;           /**< certified, of the solids; `upper` is infinite without inner covers */
    prolate_vec3 point_a, point_b; /**< of the solids, `upper` apart; set if 0 < upper < infinity */
    prolate_stats stats;
} prolate_solids_distance;
/** solids.hpp: distance() of solids. */
PROLATE_API prolate_status prolate_distance_solids(prolate_body a, prolate_body b, void* scratch, size_t scratch_size,
                                                   const prolate_distance_options* options,
                                                   prolate_solids_distance* result);

/** deform.hpp: DeformedBody. `q` may be null where `q_count` is 0: all coordinates are 0. `bones`: 12 floats for each,
 * a matrix of 3 by 4, row by row; may be null where `bone_count` is 0: all are the identity. */
typedef struct prolate_deformed_body {
    prolate_body body;
    const float* q;
    uint32_t q_count;
    const float* bones;
    uint32_t bone_count;
} prolate_deformed_body;
/** deform.hpp: Undecided, why a query of deformed bodies decided nothing. */
typedef uint8_t prolate_undecided;
enum {
    PROLATE_DECIDED = 0,
    PROLATE_UNDECIDED_COORDINATES = 1, /**< another number than the tree has modes, or bones; out of range, or NaN */
    PROLATE_UNDECIDED_INPUT = 2,       /**< a pose or a ray that is not finite */
    PROLATE_UNDECIDED_BUDGET = 3
};
/** Modes of the tree's deformation; 0 if it has none, or `tree` was not opened. */
PROLATE_API uint32_t prolate_mode_count(const prolate_tree* tree);
/** Largest absolute value of coordinate `mode`; 0 if there is no such mode. */
PROLATE_API float prolate_mode_range(const prolate_tree* tree, uint32_t mode);
/** Bones of the tree's skin; 0 if it has none, or `tree` was not opened. */
PROLATE_API uint32_t prolate_bone_count(const prolate_tree* tree);
/** deform.hpp: collide() and distance(). `reason` may be NULL. */
PROLATE_API prolate_status prolate_collide_deformed(prolate_deformed_body a, prolate_deformed_body b, void* scratch,
                                                    size_t scratch_size, const prolate_query_options* options,
                                                    prolate_collide_result* result, prolate_undecided* reason);
PROLATE_API prolate_status prolate_distance_deformed(prolate_deformed_body a, prolate_deformed_body b, void* scratch,
                                                     size_t scratch_size, const prolate_distance_options* options,
                                                     prolate_distance_result* result, prolate_undecided* reason);

/** contacts.hpp: ContactPoint, Manifold, ContactManifolds. Set the last to 0 before its first use; keep it from one
 * query to the next. */
typedef struct prolate_contact_point {
    prolate_vec3 point_a, point_b;
    float depth;
    uint32_t age;
    uint64_t id;
    float impulse[3];
} prolate_contact_point;
typedef struct prolate_manifold {
    prolate_vec3 normal;
    uint32_t count;
    prolate_contact_point points[4];
} prolate_manifold;
typedef struct prolate_manifolds {
    uint32_t count;
    prolate_manifold manifolds[4];
} prolate_manifolds;
typedef struct prolate_contact_result {
    uint32_t size, version;
    prolate_verdict verdict;
    bool enclosed;
    uint64_t found;
    prolate_stats stats;
} prolate_contact_result;
/** contacts.hpp: contacts(). */
PROLATE_API prolate_status prolate_contacts(prolate_body a, prolate_body b, prolate_manifolds* manifolds, void* scratch,
                                            size_t scratch_size, const prolate_query_options* options,
                                            prolate_contact_result* result);

typedef struct prolate_solids_contacts {
    uint32_t size, version;
    prolate_verdict verdict;
    double depth_lower, depth_upper; /**< certified, of the solids; `depth_upper` is infinite if no way out was found */
    prolate_vec3 way_out;            /**< moving `b` by it, of length depth_upper, certainly separates the solids */
    uint64_t found;
    prolate_stats stats;
} prolate_solids_contacts;
/** solids.hpp: contacts() of solids. */
PROLATE_API prolate_status prolate_contacts_solids(prolate_body a, prolate_body b, prolate_manifolds* manifolds,
                                                   void* scratch, size_t scratch_size,
                                                   const prolate_query_options* options,
                                                   prolate_solids_contacts* result);

/** sweep.hpp: Motion. */
typedef struct prolate_motion {
    prolate_pose start;
    prolate_vec3 linear, angular, center;
} prolate_motion;
typedef struct prolate_sweep_options {
    uint32_t size, version;
    double tolerance;
    uint64_t max_tests; /**< 0: no limit */
    float margin;
} prolate_sweep_options;
typedef struct prolate_sweep_result {
    uint32_t size, version;
    prolate_verdict verdict;
    bool enclosed;
    double time_lower, time_upper, distance;
    prolate_vec3 point_a, point_b, normal;
    prolate_meeting_pair pair;
    prolate_stats stats;
} prolate_sweep_result;
/** sweep.hpp: sweep(). */
PROLATE_API prolate_status prolate_sweep(const prolate_tree* a, prolate_motion motion_a, const prolate_tree* b,
                                         prolate_motion motion_b, void* scratch, size_t scratch_size,
                                         const prolate_sweep_options* options, prolate_sweep_result* result);

/** raycast.hpp: Ray, RaycastResult. */
typedef struct prolate_ray {
    prolate_vec3 origin, direction;
    float max_t;
} prolate_ray;
typedef struct prolate_raycast_result {
    uint32_t size, version;
    prolate_verdict verdict;
    double t, clear;
    prolate_vec3 point, normal;
    uint32_t node, triangle;
    prolate_stats stats;
} prolate_raycast_result;
/** raycast.hpp: raycast(). */
PROLATE_API prolate_status prolate_raycast(prolate_body body, prolate_ray ray, void* scratch, size_t scratch_size,
                                           const prolate_query_options* options, prolate_raycast_result* result);
/** deform.hpp: raycast(). `reason` may be NULL. */
PROLATE_API prolate_status prolate_raycast_deformed(prolate_deformed_body body, prolate_ray ray, void* scratch,
                                                    size_t scratch_size, const prolate_query_options* options,
                                                    prolate_raycast_result* result, prolate_undecided* reason);
/** raycast.hpp: raycast() of many rays: a hit for each. */
typedef struct prolate_tree_hit {
    prolate_verdict verdict;
    double t, clear;
    prolate_vec3 point, normal;
    uint32_t node, triangle;
} prolate_tree_hit;
PROLATE_API prolate_status prolate_raycasts(prolate_body body, const prolate_ray* rays, size_t count, void* scratch,
                                            size_t scratch_size, const prolate_query_options* options,
                                            prolate_tree_hit* hits);

/** shapes.hpp: HalfSpace. */
typedef struct prolate_half_space {
    prolate_vec3 normal;
    float offset;
} prolate_half_space;
/** shapes.hpp: Sphere (center `a`), Capsule (from `a` to `b`), Box (`half` at `a`, turned by `rotation`), HalfSpace
 * (normal `a`, offset `radius`). A shape has no use for the other numbers. */
typedef int32_t prolate_shape_kind;
enum { PROLATE_SPHERE = 0, PROLATE_CAPSULE = 1, PROLATE_BOX = 2, PROLATE_HALF_SPACE = 3 };
typedef struct prolate_shape {
    prolate_shape_kind kind;
    prolate_vec3 a, b, half;
    prolate_quat rotation;
    float radius;
} prolate_shape;
typedef struct prolate_overlap_result {
    uint32_t size, version;
    prolate_verdict verdict;
    bool enclosed;
    uint32_t node, triangle;
    prolate_stats stats;
} prolate_overlap_result;
/** shapes.hpp: overlap(). */
PROLATE_API prolate_status prolate_overlap(prolate_body body, const prolate_shape* shape, void* scratch,
                                           size_t scratch_size, const prolate_query_options* options,
                                           prolate_overlap_result* result);

/** half_space.hpp: distance(), contacts() and sweep(). */
PROLATE_API prolate_status prolate_half_space_distance(prolate_body body, prolate_half_space half_space, void* scratch,
                                                       size_t scratch_size, const prolate_distance_options* options,
                                                       prolate_distance_result* result);
PROLATE_API prolate_status prolate_half_space_contacts(prolate_body body, prolate_half_space half_space,
                                                       prolate_manifolds* manifolds, void* scratch, size_t scratch_size,
                                                       const prolate_query_options* options,
                                                       prolate_contact_result* result);

PROLATE_API prolate_status prolate_half_space_sweep(const prolate_tree* tree, prolate_motion motion,
                                                    prolate_half_space half_space, void* scratch, size_t scratch_size,
                                                    const prolate_sweep_options* options, prolate_sweep_result* result);

/** points.hpp: SignedDistance, of many points. */
typedef struct prolate_signed_distance {
    double lower, upper; /**< certified; below 0 inside */
    prolate_vec3 point, gradient;
    uint32_t node, triangle;
    prolate_verdict verdict;
} prolate_signed_distance;
/** points.hpp: signed_distance() and contains(). `results` and `sides` have room for `count`; points may be NULL if
 * that is 0. max_distance: 0 means no limit. */
PROLATE_API prolate_status prolate_signed_distances(prolate_body body, const prolate_vec3* points, size_t count,
                                                    double max_distance, void* scratch, size_t scratch_size,
                                                    prolate_signed_distance* results);
PROLATE_API prolate_status prolate_contains(prolate_body body, const prolate_vec3* points, size_t count, void* scratch,
                                            size_t scratch_size, prolate_verdict* sides);

/** bounds.hpp: bounds(), and deform.hpp: bounds() of a deformed body. */
PROLATE_API prolate_status prolate_bounds(prolate_body body, float margin, prolate_box3* box);
PROLATE_API prolate_status prolate_bounds_deformed(prolate_deformed_body body, float margin, prolate_box3* box);

/** types.hpp: Ellipsoid. */
typedef struct prolate_ellipsoid {
    prolate_vec3 center;
    float l11, l21, l22, l31, l32, l33;
} prolate_ellipsoid;
/** pairs.hpp: PairDistance. */
typedef struct prolate_pair_distance {
    float lower, upper;
    prolate_vec3 normal, point_a, point_b;
} prolate_pair_distance;
/** pairs.hpp: collide() and distance() of two single ellipsoids. They need no scratch. */
PROLATE_API prolate_status prolate_pair_collide(const prolate_ellipsoid* a, prolate_pose pose_a,
                                                const prolate_ellipsoid* b, prolate_pose pose_b, float margin,
                                                prolate_verdict* verdict);
PROLATE_API prolate_status prolate_pair_distance_of(const prolate_ellipsoid* a, prolate_pose pose_a,
                                                    const prolate_ellipsoid* b, prolate_pose pose_b, float tolerance,
                                                    prolate_pair_distance* distance);

/* ---- worlds ---- */

/** world.hpp: World. */
typedef struct prolate_world prolate_world;

/** Where a world's memory comes from: `allocate` returns `size` bytes aligned to `alignment`, or NULL. */
typedef struct prolate_allocator {
    void* (*allocate)(void* user, size_t size, size_t alignment);
    void (*release)(void* user, void* memory, size_t size, size_t alignment);
    void* user;
} prolate_allocator;

/** jobs.hpp: Jobs. */
typedef struct prolate_jobs {
    void (*run)(void* user, uint32_t count, uint32_t grain,
                void (*body)(void* job, uint32_t begin, uint32_t end, uint32_t worker), void* job);
    void* user;
    uint32_t workers;
} prolate_jobs;

/** poses.hpp: collide_poses(), the verdicts alone. One of the counts may be 1, for one pose at all of the other's;
 * `verdicts` has room for the larger. `scratch` holds workers * prolate_scratch_size() bytes. `jobs` may be NULL. */
PROLATE_API prolate_status prolate_collide_poses(const prolate_tree* a, const prolate_pose* poses_a, size_t count_a,
                                                 const prolate_tree* b, const prolate_pose* poses_b, size_t count_b,
                                                 const prolate_jobs* jobs, void* scratch, size_t scratch_size,
                                                 const prolate_query_options* options, prolate_verdict* verdicts);

typedef struct prolate_body_id {
    uint32_t index, generation;
} prolate_body_id;
typedef struct prolate_body_pair {
    prolate_body_id a, b;
    uint32_t slot;
    bool begins, moved;
} prolate_body_pair;

/** All but slack is 0 for the defaults of world.hpp; a slack of 0 stands for 0.1. */
typedef struct prolate_world_options {
    uint32_t size, version;
    float slack;
} prolate_world_options;
/** world.hpp: Part. */
typedef struct prolate_part {
    const prolate_tree* tree; /**< its bytes must outlive the body */
    prolate_pose pose;        /**< in the body's frame */
} prolate_part;
/** A body of a world: world.hpp, Body. */
typedef struct prolate_world_body {
    uint32_t size, version;
    const prolate_tree* tree; /**< its bytes must outlive the body; NULL of a half-space */
    prolate_pose pose;
    uint64_t user;
    uint32_t layers, mask; /**< if both are 0: in layer 1, and meets all */
    float margin;
    const prolate_half_space* half_space; /**< or NULL. Of a body there is either this or a tree */
    const prolate_part* parts;            /**< more trees of the body, or NULL */
    size_t part_count;                    /**< at most 65535 */
} prolate_world_body;

/** `allocator`: NULL for malloc(). Destroy the world with prolate_world_destroy(), which takes NULL, too. */
PROLATE_API prolate_status prolate_world_create(const prolate_world_options* options,
                                                const prolate_allocator* allocator, prolate_world** world);
PROLATE_API void prolate_world_destroy(prolate_world* world);
PROLATE_API prolate_status prolate_world_reserve(prolate_world* world, uint32_t bodies, uint32_t pairs);
PROLATE_API prolate_status prolate_world_insert(prolate_world* world, const prolate_world_body* body,
                                                prolate_body_id* id);
PROLATE_API prolate_status prolate_world_remove(prolate_world* world, prolate_body_id id);
PROLATE_API prolate_status prolate_world_move(prolate_world* world, prolate_body_id id, prolate_pose pose);
/** World::move() of many. `where` of the error is the index of the offence. */
PROLATE_API prolate_status prolate_world_move_many(prolate_world* world, const prolate_body_id* ids,
                                                   const prolate_pose* poses, size_t count, const prolate_jobs* jobs,
                                                   prolate_error* error);
PROLATE_API prolate_status prolate_world_refilter(prolate_world* world, prolate_body_id id, uint32_t layers,
                                                  uint32_t mask);
/** World::find(): the pose and the user's number of a body or part. Either may be NULL. */
PROLATE_API prolate_status prolate_world_find(const prolate_world* world, prolate_body_id id, prolate_pose* pose,
                                              uint64_t* user);
/** World::body_of() and World::part(). PROLATE_BAD_ID where these have no answer. */
PROLATE_API prolate_status prolate_world_body_of(const prolate_world* world, prolate_body_id part,
                                                 prolate_body_id* body);
PROLATE_API prolate_status prolate_world_part(const prolate_world* world, prolate_body_id body, uint32_t i,
                                              prolate_body_id* part);
/** World::update_pairs(): *pairs are `count` pairs, which are valid until the next call. `jobs` may be NULL: serial. */
PROLATE_API prolate_status prolate_world_update_pairs(prolate_world* world, const prolate_jobs* jobs,
                                                      const prolate_body_pair** pairs, size_t* count);
/** World::ended_pairs() and World::slot_count(). */
PROLATE_API prolate_status prolate_world_ended_pairs(const prolate_world* world, const prolate_body_pair** pairs,
                                                     size_t* count);
PROLATE_API prolate_status prolate_world_slot_count(const prolate_world* world, uint32_t* count);

/** Who works on the queries of a world below: world_queries.hpp, Workers. `scratch` holds workers *
 * prolate_scratch_size() bytes, aligned to 64. */
typedef struct prolate_workers {
    const prolate_jobs* jobs; /**< or NULL: serial */
    void* scratch;
    size_t scratch_size;
} prolate_workers;

/** world_queries.hpp: collide(), the verdicts alone: verdicts[i] of pairs[i]. */
PROLATE_API prolate_status prolate_world_collide(const prolate_world* world, const prolate_body_pair* pairs,
                                                 size_t count, const prolate_workers* workers,
                                                 const prolate_query_options* options, prolate_verdict* verdicts);
/** The same of the solids (solids.hpp): certain both ways. `max_level` of the options is not used. */
PROLATE_API prolate_status prolate_world_collide_solids(const prolate_world* world, const prolate_body_pair* pairs,
                                                        size_t count, const prolate_workers* workers,
                                                        const prolate_query_options* options,
                                                        prolate_verdict* verdicts);
/** world_queries.hpp: distance(). */
typedef struct prolate_distance_answer {
    double lower, upper;
    prolate_vec3 point_a, point_b, normal;
    prolate_verdict verdict;
    bool enclosed;
} prolate_distance_answer;
PROLATE_API prolate_status prolate_world_distance(const prolate_world* world, const prolate_body_pair* pairs,
                                                  size_t count, const prolate_workers* workers,
                                                  const prolate_distance_options* options,
                                                  prolate_distance_answer* answers);

/** world_queries.hpp: PairContacts. Set to 0 before its first use. */
typedef struct prolate_pair_contacts {
    prolate_body_id a, b;
    prolate_verdict verdict;
    bool enclosed;
    uint64_t found;
    prolate_stats stats;
    bool touching, reported;
    prolate_manifolds manifolds;
} prolate_pair_contacts;
/** world_queries.hpp: contacts(). `records`: prolate_world_slot_count() of them. */
PROLATE_API prolate_status prolate_world_contacts(const prolate_world* world, const prolate_body_pair* pairs,
                                                  size_t count, const prolate_workers* workers,
                                                  const prolate_query_options* options, prolate_pair_contacts* records,
                                                  size_t record_count);
/** world_queries.hpp: ContactEvent, contact_events(). */
enum { PROLATE_CONTACT_BEGAN = 0, PROLATE_CONTACT_STAYS = 1, PROLATE_CONTACT_ENDED = 2 };
typedef struct prolate_contact_event {
    prolate_body_id a, b;
    uint32_t slot;
    uint8_t kind;
} prolate_contact_event;
PROLATE_API prolate_status prolate_world_contact_events(const prolate_world* world, prolate_pair_contacts* records,
                                                        size_t record_count, prolate_contact_event* events,
                                                        size_t capacity, size_t* count);

/** world_queries.hpp: RayHit, raycast(). Of bodies that have a layer in `mask`. */
typedef struct prolate_ray_hit {
    prolate_body_id body;
    prolate_verdict verdict;
    double t, clear;
    prolate_vec3 point, normal;
    uint32_t node, triangle;
} prolate_ray_hit;
PROLATE_API prolate_status prolate_world_raycast(const prolate_world* world, const prolate_ray* rays, size_t count,
                                                 uint32_t mask, const prolate_workers* workers,
                                                 const prolate_query_options* options, prolate_ray_hit* hits);
/** world_queries.hpp: overlap() with `count` spheres, capsules and boxes. found[i] is the number of bodies that meet
 * shapes[i], or may; ids[i * most] and following are theirs, in ascending order of index: `most` of them, the lowest,
 * if there are more. */
PROLATE_API prolate_status prolate_world_overlap(const prolate_world* world, const prolate_shape* shapes, size_t count,
                                                 uint32_t mask, const prolate_workers* workers,
                                                 const prolate_query_options* options, prolate_body_id* ids,
                                                 size_t most, uint32_t* found);
/** world_queries.hpp: sweep() of one tree, from outside. *body is what it hits first, if anything. */
PROLATE_API prolate_status prolate_world_sweep(const prolate_world* world, const prolate_tree* tree,
                                               prolate_motion motion, uint32_t mask, const prolate_workers* workers,
                                               const prolate_sweep_options* options, prolate_body_id* body,
                                               prolate_sweep_result* result);

#ifdef __cplusplus
}
#endif

#endif
