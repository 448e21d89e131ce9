// prolate in MuJoCo: a plugin of the SDF kind, named "prolate.tree", by which trees are geoms that collide as they are,
// holes and threads included. (Of a mesh, MuJoCo takes the convex hull.)
//
//     prolate bake nut.obj --exact -o nut.etree
//     mj_loadPluginLibrary("libprolate_mujoco.so");         // once, before the model is compiled
//
//     <extension>
//       <plugin plugin="prolate.tree">
//         <instance name="nut"> <config key="file" value="nut.etree"/> </instance>
//       </plugin>
//     </extension>
//     <asset>
//       <mesh name="nut" file="nut.obj"> <plugin instance="nut"/> </mesh>
//     </asset>
//     ...
//     <geom type="sdf" mesh="nut"> <plugin instance="nut"/> </geom>
//
// The mesh is drawn and weighed, the tree collides. Without file="nut.obj", MuJoCo makes a mesh of the tree, by
// marching cubes. Keys of <config>: `file`, relative to the working directory, and `scale`, 1 if absent: let the mesh
// have the same. A file that is read is kept as long as the process runs, and shared between models; if it has changed
// since, it is read again for the next model.
//
// This library replaces entries of mjCOLLISIONFUNC, and hands what is not its own on to what stood there. Contacts with
// planes, spheres, capsules, ellipsoids, cylinders and boxes are those of contacts(). Between trees of closed meshes,
// they are the corners of either that lie in the other, or within the margin of it, each with the normal of the surface
// that is nearest to it: so threads that interlock and rings that are linked know the shortest way out at each point,
// which no manifold of one normal does. Where edges cross, contacts() has points; those that the distances confirm
// count, too. `sdf_iterations` does not matter; `sdf_initpoints` stays the most contacts of a pair.
//
// Against meshes, other SDFs and flexes, and for rays, MuJoCo asks for distances and gradients, which come from
// signed_distance(). Height fields are not served. Threads: as MuJoCo's.
#include <prolate/bounds.hpp>
#include <prolate/contacts.hpp>
#include <prolate/half_space.hpp>
#include <prolate/points.hpp>
#include <prolate/primitives.hpp>
#include <prolate/tree.hpp>

#include <mujoco/mjplugin.h>
#include <mujoco/mujoco.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <iterator>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

namespace {

using prolate::Pose;
using prolate::Tree;
using prolate::TreeView;
using prolate::Vec3;

constexpr const char* kName = "prolate.tree";
const char* const kAttributes[] = {"file", "scale"};

int our_slot = -1;                                    // of the plugin, among all that are registered
mjfCollision others[mjNGEOMTYPES][mjNGEOMTYPES] = {}; // what stood in mjCOLLISIONFUNC

// --- frames, in double precision ------------------------------------------------------------------------------------

struct Frame {
    mjtNum pos[3] = {0, 0, 0}, quat[4] = {1, 0, 0, 0};
};
Frame operator*(const Frame& a, const Frame& b) {
    Frame out;
    mju_mulPose(out.pos, out.quat, a.pos, a.quat, b.pos, b.quat);
    return out;
}
Frame inverse(const Frame& a) {
    Frame out;
    mju_negPose(out.pos, out.quat, a.pos, a.quat);
    return out;
}
Frame frame_of_geom(const mjData* d, int geom) {
    Frame out;
    mju_copy3(out.pos, d->geom_xpos + 3 * geom);
    mju_mat2Quat(out.quat, d->geom_xmat + 9 * geom);
    return out;
}
Vec3 to_prolate(const mjtNum v[3]) {
    return {static_cast<float>(v[0]), static_cast<float>(v[1]), static_cast<float>(v[2])};
}
Pose to_prolate(const Frame& f) {
    const auto q = [&](int i) { return static_cast<float>(f.quat[i]); };
    return {to_prolate(f.pos), {q(1), q(2), q(3), q(0)}};
}

// --- trees of files -------------------------------------------------------------------------------------------------

// All that were read. MuJoCo makes an instance for each mjData, and names trees by numbers before there is any.
class Files {
public:
    /// A number for tree(); below 0 if the file cannot be read, of which MuJoCo is warned.
    int number_of(const std::string& path) {
        const std::lock_guard lock(mutex_);
        std::error_code none;
        const auto time = std::filesystem::last_write_time(path, none);
        const auto same = [&](const File& f) { return f.path == path && f.time == time; };
        if (const auto found = std::find_if(files_.rbegin(), files_.rend(), same); found != files_.rend())
            return static_cast<int>(files_.rend() - found) - 1;
        auto tree = prolate::load(path.c_str());
        if (!tree) {
            mju_warning("%s: file \"%s\": %s", kName, path.c_str(), tree.error().what);
            return -1;
        }
        files_.push_back({path, time, std::make_unique<Tree>(std::move(*tree))});
        return static_cast<int>(files_.size()) - 1;
    }
    std::optional<TreeView> tree(int number, float scale) {
        const std::lock_guard lock(mutex_);
        if (number < 0 || number >= static_cast<int>(files_.size())) return {};
        const auto out = files_[static_cast<size_t>(number)].tree->view().scaled(scale);
        return out ? std::optional<TreeView>(*out) : std::nullopt;
    }

private:
    struct File {
        std::string path;
        std::filesystem::file_time_type time;
        std::unique_ptr<Tree> tree;
    };
    std::mutex mutex_;
    std::vector<File> files_;
};
Files& files() {
    static Files all;
    return all;
}

// The attributes as numbers, in the order of kAttributes: that of the tree, its scale.
std::array<mjtNum, 2> numbers_of(const char* file, const char* scale) {
    const bool given = scale != nullptr && *scale != '\0';
    return {mjtNum(files().number_of(file == nullptr ? "" : file)), given ? std::strtod(scale, nullptr) : 1};
}
std::optional<TreeView> tree_of(const mjtNum* attributes) {
    return files().tree(static_cast<int>(attributes[0]), static_cast<float>(attributes[1]));
}

prolate::QueryContext& context() {
    static thread_local const auto own = std::make_unique<prolate::QueryContext>();
    return *own;
}

// --- an instance ----------------------------------------------------------------------------------------------------

struct Instance {
    TreeView tree;
    prolate::Bounds box; // in the tree's frame
    Frame tree_in_geom;  // MuJoCo moves a mesh to its centre of mass and turns it to its principal axes
};

const Instance* instance_of(const mjData* d, int instance) {
    return reinterpret_cast<const Instance*>(d->plugin_data[instance]);
}

int init(const mjModel* m, mjData* d, int instance) {
    const auto attributes =
        numbers_of(mj_getPluginConfig(m, instance, "file"), mj_getPluginConfig(m, instance, "scale"));
    const auto tree = tree_of(attributes.data());
    if (!tree) {
        mju_warning("%s: there is no tree, or it cannot have the scale %g", kName, attributes[1]);
        return -1;
    }
    int mesh = -1;
    for (int g = 0; g < m->ngeom; ++g) {
        if (m->geom_plugin[g] != instance || m->geom_dataid[g] < 0) continue;
        const int other = m->geom_dataid[g];
        if (mesh >= 0 &&
            (!std::equal(m->mesh_pos + 3 * mesh, m->mesh_pos + 3 * mesh + 3, m->mesh_pos + 3 * other) ||
             !std::equal(m->mesh_quat + 4 * mesh, m->mesh_quat + 4 * mesh + 4, m->mesh_quat + 4 * other))) {
            mju_warning("%s: geoms of one instance have different meshes; give each its own instance", kName);
            return -1;
        }
        mesh = other;
    }
    auto made = std::make_unique<Instance>(Instance{*tree, prolate::bounds(*tree, {}), {}});
    if (mesh >= 0) {
        Frame in_mesh;
        mju_copy3(in_mesh.pos, m->mesh_pos + 3 * mesh), mju_copy4(in_mesh.quat, m->mesh_quat + 4 * mesh);
        made->tree_in_geom = inverse(in_mesh);
    }
    d->plugin_data[instance] = reinterpret_cast<uintptr_t>(made.release());
    return 0;
}

void destroy(mjData* d, int instance) {
    delete instance_of(d, instance);
    d->plugin_data[instance] = 0;
}

// --- distances of points --------------------------------------------------------------------------------------------

mjtNum value_of(const prolate::SignedDistance& at) {
    const double middle = 0.5 * (at.lower + at.upper);
    return std::isfinite(middle) ? middle : mjMAXVAL;
}

mjtNum sdf_distance(const mjtNum point[3], const mjData* d, int instance) {
    const Instance& of = *instance_of(d, instance);
    const Frame geom_in_tree = inverse(of.tree_in_geom);
    mjtNum here[3];
    mju_trnVecPose(here, geom_in_tree.pos, geom_in_tree.quat, point);
    return value_of(signed_distance(of.tree, {}, to_prolate(here), context()));
}

void sdf_gradient(mjtNum gradient[3], const mjtNum point[3], const mjData* d, int instance) {
    const Instance& of = *instance_of(d, instance);
    const Frame geom_in_tree = inverse(of.tree_in_geom);
    mjtNum here[3];
    mju_trnVecPose(here, geom_in_tree.pos, geom_in_tree.quat, point);
    const Vec3 there = signed_distance(of.tree, {}, to_prolate(here), context()).gradient;
    const mjtNum g[3] = {there.x, there.y, there.z};
    mju_rotVecQuat(gradient, g, of.tree_in_geom.quat);
}

// For the compiler's marching cubes, before there is an instance.
mjtNum sdf_staticdistance(const mjtNum point[3], const mjtNum* attributes) {
    const auto tree = tree_of(attributes);
    return tree ? value_of(signed_distance(*tree, {}, to_prolate(point), context())) : mjMAXVAL;
}

void sdf_aabb(mjtNum aabb[6], const mjtNum* attributes) {
    std::fill_n(aabb, 3, 0), std::fill_n(aabb + 3, 3, 1);
    const auto tree = tree_of(attributes);
    if (!tree) return;
    const prolate::Bounds box = prolate::bounds(*tree, {});
    const mjtNum low[] = {box.lower.x, box.lower.y, box.lower.z}, high[] = {box.upper.x, box.upper.y, box.upper.z};
    mjtNum size = 0;
    for (int i = 0; i < 3; ++i) size = std::max(size, high[i] - low[i]);
    for (int i = 0; i < 3; ++i) // a little room, in which the mesh closes
        aabb[i] = 0.5 * (low[i] + high[i]), aabb[3 + i] = 0.5 * (high[i] - low[i]) + 0.02 * size;
}

void sdf_attribute(mjtNum attribute[], const char* name[], const char* value[]) {
    (void)name; // those of kAttributes
    const auto numbers = numbers_of(value[0], value[1]);
    std::copy(numbers.begin(), numbers.end(), attribute);
}

// --- collisions -----------------------------------------------------------------------------------------------------

bool is_ours(const mjModel* m, int geom) {
    const int instance = m->geom_plugin[geom];
    return m->geom_type[geom] == mjGEOM_SDF && instance >= 0 && m->plugin[instance] == our_slot;
}

// A tree for a simple geom, kept by its type and size. Null if it has no volume.
const Tree* simple_tree(const mjModel* m, int geom) {
    static thread_local std::map<std::array<float, 4>, std::optional<Tree>> made;
    const Vec3 size = to_prolate(m->geom_size + 3 * geom);
    const int type = m->geom_type[geom];
    const auto [at, fresh] = made.try_emplace({static_cast<float>(type), size.x, size.y, size.z});
    std::optional<Tree>& tree = at->second;
    const auto take = [&](auto result) {
        if (result) tree.emplace(std::move(*result));
    };
    if (fresh && type == mjGEOM_SPHERE) take(prolate::capsule_tree({}, {}, size.x));
    if (fresh && type == mjGEOM_CAPSULE) take(prolate::capsule_tree({0, 0, -size.y}, {0, 0, size.y}, size.x));
    if (fresh && type == mjGEOM_CYLINDER) take(prolate::cylinder_tree(size.x, size.y, 128));
    if (fresh && type == mjGEOM_BOX) take(prolate::box_tree(size));
    if (fresh && type == mjGEOM_ELLIPSOID)
        take(prolate::ellipsoid_tree({.center = {}, .l11 = size.x, .l22 = size.y, .l33 = size.z}));
    return tree ? &*tree : nullptr;
}

// A point of contact; the normal points from the first geom to the second, as MuJoCo has it.
struct Touch {
    mjtNum dist, pos[3], normal[3];
};

// Those of manifolds, the deepest manifold first.
void add_manifolds(const prolate::ContactManifolds& found, mjtNum sign, std::vector<Touch>& out) {
    for (uint32_t i = 0; i < found.count; ++i) {
        const prolate::Manifold& m = found.manifolds[i];
        for (uint32_t k = 0; k < m.count; ++k) {
            const prolate::ContactPoint& p = m.points[k];
            const auto middle = [](float a, float b) { return 0.5 * (mjtNum{a} + mjtNum{b}); };
            out.push_back(
                {-p.depth,
                 {middle(p.point_a.x, p.point_b.x), middle(p.point_a.y, p.point_b.y), middle(p.point_a.z, p.point_b.z)},
                 {sign * m.normal.x, sign * m.normal.y, sign * m.normal.z}});
        }
    }
}

// The corners of `one` within the margin of `other`, in the frame of `other`. `sign`: of its gradient, for the normal.
void add_corners(const TreeView& one, const Frame& one_in_other, const Instance& other, mjtNum margin, mjtNum sign,
                 std::vector<Touch>& out) {
    constexpr size_t kAtOnce = 64;
    Vec3 points[kAtOnce];
    prolate::Verdict sides[kAtOnce];
    size_t count = 0;
    // Which side a point is on is soon known; how deep is asked of those inside, and of others as far as it matters.
    const auto ask = [&] {
        contains(other.tree, {}, {points, count}, {sides, count}, context());
        for (size_t i = 0; i < count; ++i) {
            const bool outside = sides[i] == prolate::Verdict::separated;
            if (outside && !(margin > 0)) continue;
            const prolate::PointOptions options{.max_distance = outside ? margin : mjMAXVAL};
            const prolate::SignedDistance answer = signed_distance(other.tree, {}, points[i], context(), options);
            const mjtNum dist = value_of(answer);
            if (!(dist <= margin)) continue;
            const Vec3 &p = points[i], &g = answer.gradient;
            out.push_back({dist,
                           {p.x - 0.5 * dist * g.x, p.y - 0.5 * dist * g.y, p.z - 0.5 * dist * g.z},
                           {sign * g.x, sign * g.y, sign * g.z}});
        }
        count = 0;
    };
    const Vec3 &low = other.box.lower, &high = other.box.upper;
    const auto within = [&](mjtNum x, float from, float to) { return x >= from - margin && x <= to + margin; };
    for (uint32_t v = 0; v < one.vertex_count(); ++v) {
        const Vec3 stored = one.vertex(v);
        const mjtNum scale = one.scale(), corner[] = {scale * stored.x, scale * stored.y, scale * stored.z};
        mjtNum p[3];
        mju_trnVecPose(p, one_in_other.pos, one_in_other.quat, corner);
        if (!within(p[0], low.x, high.x) || !within(p[1], low.y, high.y) || !within(p[2], low.z, high.z)) continue;
        points[count++] = to_prolate(p);
        if (count == kAtOnce) ask();
    }
    ask();
}

// Is the second body as deep in the first one as a manifold says, and farther and farther out of it if it is moved on
// along the normal? If that is not the shortest way out, it is not.
bool confirms(const Instance& first, const Touch& touch) {
    constexpr mjtNum kStep = 1e-3, kRises = 0.7, kSame = 0.2; // of the size; of the step; of the depth
    const Vec3 &low = first.box.lower, &high = first.box.upper;
    const mjtNum step = kStep * std::max({high.x - low.x, high.y - low.y, high.z - low.z});
    const auto after = [&](mjtNum way) { // of the second body's point there; `pos` is half-way
        mjtNum p[3];
        mju_addScl3(p, touch.pos, touch.normal, 0.5 * touch.dist + way);
        return value_of(signed_distance(first.tree, {}, to_prolate(p), context()));
    };
    return std::abs(after(0) - touch.dist) <= kSame * (std::abs(touch.dist) + step) &&
           after(step - touch.dist) >= kRises * step;
}

// The deepest, then always the one that is farthest from those that are taken.
void thin_out(std::vector<Touch>& touches, size_t most) {
    if (touches.size() <= most) return;
    const auto nearest_first = [](const Touch& a, const Touch& b) { return a.dist < b.dist; };
    std::iter_swap(touches.begin(), std::min_element(touches.begin(), touches.end(), nearest_first));
    std::vector<mjtNum> apart(touches.size(), mjMAXVAL);
    for (size_t taken = 1; taken < most; ++taken) {
        size_t next = taken;
        for (size_t i = taken; i < touches.size(); ++i) {
            apart[i] = std::min(apart[i], mju_dist3(touches[i].pos, touches[taken - 1].pos));
            if (apart[i] > apart[next]) next = i;
        }
        std::swap(touches[taken], touches[next]), std::swap(apart[taken], apart[next]);
    }
    touches.resize(most);
}

// From the frame `in` to the world.
int give(const std::vector<Touch>& touches, const Frame& in, mjPreContact* con) {
    for (const Touch& touch : touches) {
        con->dist = touch.dist;
        mju_trnVecPose(con->pos, in.pos, in.quat, touch.pos);
        mju_rotVecQuat(con->normal, touch.normal, in.quat);
        mju_zero3(con->tangent);
        ++con;
    }
    return static_cast<int>(touches.size());
}

bool is_closed_mesh(const TreeView& tree) {
    return tree.has_triangles() && !tree.surface_mode();
}

// Two trees of ours; in the frame of the first.
void add_pair(const Instance& a, const Instance& b, const Frame& b_in_a, float margin, std::vector<Touch>& out) {
    const bool closed = is_closed_mesh(a.tree) && is_closed_mesh(b.tree);
    if (closed) {
        add_corners(b.tree, b_in_a, a, margin, 1, out);
        const size_t first_in_b = out.size();
        add_corners(a.tree, inverse(b_in_a), b, margin, -1, out);
        for (size_t i = first_in_b; i < out.size(); ++i) {
            const Touch in_b = out[i];
            mju_trnVecPose(out[i].pos, b_in_a.pos, b_in_a.quat, in_b.pos);
            mju_rotVecQuat(out[i].normal, in_b.normal, b_in_a.quat);
        }
    }
    if (!out.empty()) return;
    prolate::ContactManifolds found;
    contacts(a.tree, {}, b.tree, to_prolate(b_in_a), found, context(), {.margin = margin});
    add_manifolds(found, 1, out);
    if (closed)
        out.erase(std::remove_if(out.begin(), out.end(), [&](const Touch& t) { return !confirms(a, t); }), out.end());
}

// All in the frame of one of the trees, so that the distance from the world's origin costs no accuracy.
int collide(const mjModel* m, mjData* d, mjPreContact* con, int g1, int g2, mjtNum margin) {
    const int type = m->geom_type[g1];
    if (!is_ours(m, g2) || (type == mjGEOM_SDF && !is_ours(m, g1)))
        return others[type][m->geom_type[g2]](m, d, con, g1, g2, margin);
    const Instance& b = *instance_of(d, m->geom_plugin[g2]);
    const Frame in_b = frame_of_geom(d, g2) * b.tree_in_geom, frame = frame_of_geom(d, g1);
    const prolate::QueryOptions options{.margin = static_cast<float>(margin)};
    static thread_local std::vector<Touch> touches;
    touches.clear();
    Frame in = in_b;
    prolate::ContactManifolds found;
    if (type == mjGEOM_SDF) {
        const Instance& a = *instance_of(d, m->geom_plugin[g1]);
        in = frame * a.tree_in_geom;
        add_pair(a, b, inverse(in) * in_b, options.margin, touches);
    } else if (type == mjGEOM_PLANE) {
        const Frame ground = inverse(in_b) * frame;
        const mjtNum up[] = {0, 0, 1};
        mjtNum normal[3];
        mju_rotVecQuat(normal, up, ground.quat);
        const prolate::HalfSpace half_space{to_prolate(normal), static_cast<float>(mju_dot3(normal, ground.pos))};
        contacts(b.tree, {}, half_space, found, context(), options);
        add_manifolds(found, -1, touches); // ours points into the ground
    } else if (const Tree* const simple = simple_tree(m, g1)) {
        contacts(simple->view(), to_prolate(inverse(in_b) * frame), b.tree, {}, found, context(), options);
        add_manifolds(found, 1, touches);
    }
    thin_out(touches, static_cast<size_t>(std::clamp(m->opt.sdf_initpoints, 0, mjMAXCONPAIR)));
    return give(touches, in, con);
}

// --- registration ---------------------------------------------------------------------------------------------------

void register_plugin() {
    mjpPlugin plugin;
    mjp_defaultPlugin(&plugin);
    plugin.name = kName;
    plugin.capabilityflags = mjPLUGIN_SDF;
    plugin.nattribute = std::size(kAttributes);
    plugin.attributes = kAttributes;
    plugin.nstate = [](const mjModel*, int) { return 0; };
    plugin.init = init;
    plugin.destroy = destroy;
    plugin.reset = [](const mjModel*, mjtNum*, void*, int) {};
    plugin.compute = [](const mjModel*, mjData*, int, int) {};
    plugin.sdf_distance = sdf_distance;
    plugin.sdf_gradient = sdf_gradient;
    plugin.sdf_staticdistance = sdf_staticdistance;
    plugin.sdf_aabb = sdf_aabb;
    plugin.sdf_attribute = sdf_attribute;
    our_slot = mjp_registerPlugin(&plugin);
    for (const int type :
         {mjGEOM_PLANE, mjGEOM_SPHERE, mjGEOM_CAPSULE, mjGEOM_ELLIPSOID, mjGEOM_CYLINDER, mjGEOM_BOX, mjGEOM_SDF})
        others[type][mjGEOM_SDF] = std::exchange(mjCOLLISIONFUNC[type][mjGEOM_SDF], collide);
}

} // namespace

mjPLUGIN_LIB_INIT(prolate_tree) {
    register_plugin();
}
