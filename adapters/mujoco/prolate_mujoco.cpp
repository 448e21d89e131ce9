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
// Contacts of trees with each other, with planes, spheres, capsules, ellipsoids, cylinders and boxes are those of
// contacts(): this library replaces entries of mjCOLLISIONFUNC, and hands what is not its own on to what stood there.
// So margins and gaps work, and `sdf_iterations` does not matter; `sdf_initpoints` stays the most contacts of a pair
// (16 are enough). Against meshes, other SDFs and flexes, and for rays, MuJoCo asks for distances and gradients, which
// come from signed_distance(). Height fields are not served. Threads: as MuJoCo's.
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
    Frame tree_in_geom; // MuJoCo moves a mesh to its centre of mass and turns it to its principal axes
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
    auto made = std::make_unique<Instance>(Instance{*tree, {}});
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
    if (fresh && type == mjGEOM_CYLINDER) take(prolate::cylinder_tree(size.x, size.y));
    if (fresh && type == mjGEOM_BOX) take(prolate::box_tree(size));
    if (fresh && type == mjGEOM_ELLIPSOID) take(prolate::ellipsoid_tree({.l11 = size.x, .l22 = size.y, .l33 = size.z}));
    return tree ? &*tree : nullptr;
}

struct Body {
    TreeView tree;
    Frame frame;
};
std::optional<Body> body_of(const mjModel* m, const mjData* d, int geom) {
    const Frame frame = frame_of_geom(d, geom);
    if (m->geom_type[geom] == mjGEOM_SDF) {
        const Instance& of = *instance_of(d, m->geom_plugin[geom]);
        return Body{of.tree, frame * of.tree_in_geom};
    }
    const Tree* const tree = simple_tree(m, geom);
    return tree != nullptr ? std::optional<Body>({tree->view(), frame}) : std::nullopt;
}

// Found in the frame `in`; the deepest manifolds come first. MuJoCo's normals point from the first geom to the second.
int give(const prolate::ContactManifolds& found, const Frame& in, mjtNum sign, int most, mjPreContact* con) {
    int count = 0;
    for (uint32_t i = 0; i < found.count; ++i) {
        const prolate::Manifold& manifold = found.manifolds[i];
        const mjtNum normal[] = {sign * manifold.normal.x, sign * manifold.normal.y, sign * manifold.normal.z};
        for (uint32_t k = 0; k < manifold.count && count < most; ++k, ++count) {
            const prolate::ContactPoint& p = manifold.points[k];
            const auto middle = [](float a, float b) { return 0.5 * (mjtNum{a} + mjtNum{b}); };
            const mjtNum at[] = {middle(p.point_a.x, p.point_b.x), middle(p.point_a.y, p.point_b.y),
                                 middle(p.point_a.z, p.point_b.z)};
            con[count].dist = -p.depth;
            mju_trnVecPose(con[count].pos, in.pos, in.quat, at);
            mju_rotVecQuat(con[count].normal, normal, in.quat);
            mju_zero3(con[count].tangent);
        }
    }
    return count;
}

// All in the frame of the first tree, so that the distance from the world's origin costs no accuracy.
int collide(const mjModel* m, mjData* d, mjPreContact* con, int g1, int g2, mjtNum margin) {
    const bool plane = m->geom_type[g1] == mjGEOM_PLANE;
    if (!is_ours(m, g2) || (m->geom_type[g1] == mjGEOM_SDF && !is_ours(m, g1)))
        return others[m->geom_type[g1]][m->geom_type[g2]](m, d, con, g1, g2, margin);
    const int most = std::min(m->opt.sdf_initpoints, mjMAXCONPAIR);
    const prolate::QueryOptions options{.margin = static_cast<float>(margin)};
    prolate::ContactManifolds found;
    const auto body = body_of(m, d, g2);
    if (!body) return 0;
    if (plane) {
        const Frame ground = inverse(body->frame) * frame_of_geom(d, g1);
        const mjtNum up[] = {0, 0, 1};
        mjtNum normal[3];
        mju_rotVecQuat(normal, up, ground.quat);
        const prolate::HalfSpace half_space{to_prolate(normal), static_cast<float>(mju_dot3(normal, ground.pos))};
        contacts(body->tree, {}, half_space, found, context(), options);
        return give(found, body->frame, -1, most, con); // ours points into the ground
    }
    const auto first = body_of(m, d, g1);
    if (!first) return 0;
    contacts(first->tree, {}, body->tree, to_prolate(inverse(first->frame) * body->frame), found, context(), options);
    return give(found, first->frame, 1, most, con);
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
